//! The types a profile file is read into. Reading alone proves only the syntax; what the numbers
//! mean together is checked by the validator, after which they are trusted.
//!
//! Unknown keys are refused everywhere: a misspelt limit must never be a limit that is not there.

mod actuator;
mod board;
mod body;
mod line;
mod sensor;

pub use actuator::{Actuator, CanLine, Dialect, Gear, Ranges, Timeout, TimeoutKind};
pub use board::{Board, BoardImu};
pub use body::{
    BalanceJoint, BaseKind, Body, BodyBalance, BodyBox, BodyCapsule, BodyImu, BodyLink, BodyMesh,
    BodyServos, CoupledJoint, CoupledTo, OtherServos, WhenFallen, Yielding,
};
pub use line::{CanSpeed, Line, LineKind};
pub use sensor::{
    Channel, Counter, DeviceClock, LineLayout, Quantity, Sensor, SensorProtocol, SensorUnit,
    SignedAxis, WorldAxes, hex_bytes,
};

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// One servo model: its control table and everything a driver or a virtual servo must know of it.
///
/// A file may be written as another servo plus what differs (`extends`); what is read here is
/// always the whole.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Servo {
    /// Version of this file format; 1.
    pub schema: u32,
    /// The file's own name, `[a-z0-9-]+`.
    pub name: String,
    /// The name on the label, e.g. `XM430-W350`.
    pub model: String,
    /// Who makes it.
    pub maker: String,
    /// The protocol it speaks.
    pub protocol: Protocol,
    /// What the servo itself answers when asked for its model.
    pub model_number: u16,
    /// The firmware range this file was checked against.
    pub firmware: FirmwareRange,
    /// Address of the maker's manual.
    pub manual: String,
    /// How encoder counts relate to angle.
    pub position: PositionScale,
    /// Line speeds by the value of the baud register.
    pub baud: Vec<Baud>,
    /// Facts on the motor, for the virtual servo's motion model.
    pub motor: Motor,
    /// Lowest firmware that answers Fast Sync Read, if any does.
    #[serde(default)]
    pub fast_sync_read_from_firmware: Option<u16>,
    /// Lowest firmware that obeys Clear, if any does.
    #[serde(default)]
    pub clear_from_firmware: Option<u16>,
    /// Lowest firmware that obeys Control Table Backup, if any does.
    #[serde(default)]
    pub backup_from_firmware: Option<u16>,
    /// Protocol 1.0 only: whether the servo answers Bulk Read (MX does, AX does not). Every
    /// Protocol 2.0 servo does; no Feetech does.
    #[serde(default)]
    pub bulk_read: bool,
    /// Values of the operating mode register the servo knows. Empty where there is no such
    /// register (Protocol 1.0 and SCS choose the mode by their angle limits).
    #[serde(default, rename = "operating_mode")]
    pub operating_modes: Vec<OperatingMode>,
    /// Bits of the hardware error (or status) register.
    #[serde(default, rename = "error_bit")]
    pub error_bits: Vec<ErrorBit>,
    /// What the values of the hardware error register say, where it holds one code and no bits.
    #[serde(default, rename = "error_code")]
    pub error_codes: Vec<ErrorCode>,
    /// The control table, complete, in order of address.
    #[serde(rename = "register")]
    pub registers: Vec<Register>,
}

/// Serial protocol families.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Hash)]
pub enum Protocol {
    /// ROBOTIS DYNAMIXEL Protocol 1.0.
    #[serde(rename = "dynamixel-1.0")]
    Dynamixel1,
    /// ROBOTIS DYNAMIXEL Protocol 2.0.
    #[serde(rename = "dynamixel-2.0")]
    Dynamixel2,
    /// FEETECH STS/SMS: the protocol 1.0 frame, little-endian words, sign-magnitude values.
    #[serde(rename = "feetech-sts")]
    FeetechSts,
    /// FEETECH SCS: as STS, but words are big-endian, and there is no group read.
    #[serde(rename = "feetech-scs")]
    FeetechScs,
}

/// One value of an operating mode register.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(deny_unknown_fields)]
pub struct OperatingMode {
    /// Value of the register.
    pub value: u8,
    /// What it makes of the servo.
    pub mode: Mode,
}

/// What a servo controls.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Hash)]
#[serde(rename_all = "kebab-case")]
pub enum Mode {
    /// Position within one turn.
    Position,
    /// Position over many turns.
    ExtendedPosition,
    /// Position over many turns with a limit on the current.
    CurrentBasedPosition,
    /// Speed, endlessly.
    Velocity,
    /// Current.
    Current,
    /// Voltage on the motor, open loop.
    Pwm,
    /// Position relative to where it stands (Feetech).
    Step,
}

/// Inclusive range of firmware versions. Feetech's `major.minor` is written as
/// `major * 256 + minor`.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FirmwareRange {
    /// Lowest version this file holds for.
    pub min: u16,
    /// Highest version this file is known to hold for; absent = no upper bound known.
    #[serde(default)]
    pub max: Option<u16>,
}

/// Exact scale of position registers: `counts` encoder counts make `degrees`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PositionScale {
    /// Counts in the span given by `degrees`.
    pub counts: u32,
    /// Span in degrees.
    pub degrees: u32,
    /// The count that stands for angle zero of the servo (mid travel), e.g. 2048.
    pub zero_count: i32,
    /// The lowest count of a turn; absent = 0. Below 0 where counts go either way from mid travel.
    #[serde(default)]
    pub lowest_count: i32,
    /// Where it is written.
    pub source: String,
}

/// One line of the baud table.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Baud {
    /// Value of the baud register.
    pub index: u8,
    /// Bits per second.
    pub bps: u32,
}

/// What the virtual servo's motor model starts from.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Motor {
    /// Speed without load, rad/s, at `voltage_v`.
    pub no_load_speed_rad_s: f64,
    /// Stall torque, N m, at `voltage_v`.
    pub stall_torque_nm: f64,
    /// Stall current, A, at `voltage_v`.
    pub stall_current_a: f64,
    /// Supply voltage the figures hold for.
    pub voltage_v: f64,
    /// Where they are written, or `assumed: why`.
    pub source: String,
}

/// A bit of the error register.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ErrorBit {
    /// Bit number, 0 = least significant.
    pub bit: u8,
    /// What it says, in words for a person.
    pub name: String,
}

/// A value of an error register that holds one code at a time.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ErrorCode {
    /// The value.
    pub value: u8,
    /// What it says, in words for a person.
    pub name: String,
}

/// One item of a control table, or `repeat` equal items one after the other.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Register {
    /// The vendor's word, e.g. `Goal Position`. Repeated items are `NAME 1`, `NAME 2`, ...
    pub name: String,
    /// Our word; the driver and the virtual servo find registers by it.
    #[serde(default)]
    pub role: Option<Role>,
    /// Address of the first byte.
    pub address: u16,
    /// Size of one item in bytes: 1, 2 or 4.
    pub bytes: u8,
    /// How the bytes make a number.
    pub encoding: Encoding,
    /// Kept at power-off or not.
    pub region: Region,
    /// What the bus may do with it.
    pub access: Access,
    /// Unit of the scaled value.
    #[serde(default)]
    pub unit: Unit,
    /// One count is this many units. Absent: 1 (for `turn`: from [`Servo::position`]).
    #[serde(default)]
    pub scale: Option<f64>,
    /// Raw value that stands for zero units; absent = 0 (for `turn`: from [`Servo::position`]).
    #[serde(default)]
    pub zero: Option<i64>,
    /// Lowest raw value the device accepts.
    #[serde(default)]
    pub min: Option<i64>,
    /// Highest raw value the device accepts.
    #[serde(default)]
    pub max: Option<i64>,
    /// Raw factory value (EEPROM) or value at power-up (RAM).
    #[serde(default)]
    pub initial: Option<i64>,
    /// Number of equal items from `address` on; absent = 1, and the name then has no number.
    #[serde(default)]
    pub repeat: Option<u8>,
    /// Number in the name of the first of the repeated items; absent = 1.
    #[serde(default)]
    pub first: Option<u8>,
    /// Each further repeated item has an `initial` larger by this; absent = 0.
    #[serde(default)]
    pub initial_step: Option<i64>,
    /// Manual section, or `unconfirmed: why`, or `measured DATE, UNIT`.
    pub source: String,
}

/// One place in a control table: an item of a register.
#[derive(Clone, Copy, Debug)]
pub struct RegisterItem<'a> {
    /// The register it belongs to.
    pub register: &'a Register,
    /// Which of its items, 0 = the first.
    pub index: u16,
    /// Address of the item's first byte.
    pub address: u16,
}

/// Byte layouts. Little-endian on the wire, but for [`Protocol::FeetechScs`].
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum Encoding {
    /// Unsigned.
    U8,
    /// Unsigned.
    U16,
    /// Unsigned.
    U32,
    /// Two's complement.
    I8,
    /// Two's complement.
    I16,
    /// Two's complement.
    I32,
    /// Bit 10 is the sign of the ten bits below it.
    #[serde(rename = "sign-magnitude-10")]
    SignMagnitude10,
    /// Bit 11 is the sign of the eleven bits below it.
    #[serde(rename = "sign-magnitude-11")]
    SignMagnitude11,
    /// Bit 15 is the sign of the fifteen bits below it.
    #[serde(rename = "sign-magnitude-15")]
    SignMagnitude15,
}

/// Memory region.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum Region {
    /// Survives power-off; writing needs the user's permit.
    Eeprom,
    /// Lost at power-off.
    Ram,
}

/// Access from the bus.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum Access {
    /// Read only.
    R,
    /// Read and write.
    Rw,
}

/// Units of scaled values. `rpm` and the like are the manuals' own; the driver converts to SI.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq)]
pub enum Unit {
    /// A plain number, an index or a set of bits.
    #[default]
    #[serde(rename = "none")]
    None,
    /// Angle by [`Servo::position`]; absolute positions count from `zero_count`.
    #[serde(rename = "turn")]
    Turn,
    /// Angle by [`Servo::position`], relative (an offset or a width): no zero is subtracted.
    #[serde(rename = "turn-relative")]
    TurnRelative,
    /// Revolutions per minute.
    #[serde(rename = "rpm")]
    Rpm,
    /// Encoder counts per second, by [`Servo::position`].
    #[serde(rename = "count/s")]
    CountPerSecond,
    /// Revolutions per minute squared.
    #[serde(rename = "rpm2")]
    Rpm2,
    /// Encoder counts per second squared, by [`Servo::position`].
    #[serde(rename = "count/s2")]
    CountPerSecond2,
    /// Ampere.
    #[serde(rename = "A")]
    Ampere,
    /// Volt.
    #[serde(rename = "V")]
    Volt,
    /// Degrees Celsius.
    #[serde(rename = "degC")]
    Celsius,
    /// Second.
    #[serde(rename = "s")]
    Second,
    /// Ratio, 1 = full scale.
    #[serde(rename = "ratio")]
    Ratio,
}

/// Our words for what a register is for. The driver and the virtual servo look up roles only.
/// A role belongs to one register; only `IndirectAddress` and `IndirectData` may have several.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[serde(rename_all = "snake_case")]
#[allow(missing_docs)]
pub enum Role {
    ModelNumber,
    FirmwareVersion,
    /// Second byte of a `major, minor` firmware pair.
    FirmwareVersionMinor,
    Id,
    BaudRate,
    ReturnDelay,
    /// Dynamixel 0..2; Feetech "response level" 0..1.
    StatusReturnLevel,
    DriveMode,
    OperatingMode,
    SecondaryId,
    ProtocolType,
    HomingOffset,
    MovingThreshold,
    TemperatureLimit,
    MaxVoltageLimit,
    MinVoltageLimit,
    PwmLimit,
    CurrentLimit,
    AccelerationLimit,
    VelocityLimit,
    MaxPositionLimit,
    MinPositionLimit,
    StartupConfiguration,
    Shutdown,
    /// Feetech: 55, 1 = EEPROM writes do not persist.
    EepromLock,
    TorqueEnable,
    Led,
    RegisteredInstruction,
    HardwareError,
    PositionPGain,
    PositionIGain,
    PositionDGain,
    VelocityPGain,
    VelocityIGain,
    Feedforward1stGain,
    Feedforward2ndGain,
    BusWatchdog,
    GoalPwm,
    GoalCurrent,
    GoalVelocity,
    GoalTime,
    ProfileAcceleration,
    ProfileVelocity,
    GoalPosition,
    TorqueLimit,
    MaxTorque,
    RealtimeTick,
    Moving,
    MovingStatus,
    PresentPwm,
    PresentLoad,
    PresentCurrent,
    PresentVelocity,
    PresentPosition,
    VelocityTrajectory,
    PositionTrajectory,
    PresentVoltage,
    PresentTemperature,
    IndirectAddress,
    IndirectData,
    AlarmLed,
    Punch,
    CwComplianceMargin,
    CcwComplianceMargin,
    CwComplianceSlope,
    CcwComplianceSlope,
    /// MX with protocol 1.0: the reading is divided by this.
    ResolutionDivider,
    /// MX-64 and MX-106 with protocol 1.0: 1 = follows [`Role::GoalCurrent`].
    TorqueControlEnable,
    PwmSlope,
    BackupReady,
    /// Feetech: setting bits of address 18.
    Phase,
    ProtectiveTorque,
    ProtectionTime,
    OverloadTorque,
    ProtectionCurrent,
    OverCurrentTime,
    MinStartupForce,
    CwDeadZone,
    CcwDeadZone,
    AngularResolution,
    MaxSpeed,
    MaxAcceleration,
}

/// A USB serial adapter.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Adapter {
    /// Version of this file format; 1.
    pub schema: u32,
    /// The file's own name.
    pub name: String,
    /// What is printed on it.
    pub model: String,
    /// USB ids `vvvv:pppp`, lower-case hex.
    pub usb_ids: Vec<String>,
    /// True if the host hears its own bytes.
    pub echo: bool,
    /// Worst time the adapter holds received bytes back, s, as the driver sets it up by default.
    pub latency_s: f64,
    /// Its latency timer as it is plugged in, s: bytes wait so long unless a driver asks for less.
    /// Absent: it has none.
    #[serde(default)]
    pub latency_timer_s: Option<f64>,
    /// What else has these ids, and how to tell it apart; absent: nothing known.
    #[serde(default)]
    pub ambiguous: Option<String>,
    /// Where it is written.
    pub source: String,
}

/// A robot: named joints on servos or CAN actuators on lines, and how its links stand for a human's segments.
///
/// Lines and joints are always needed. Where joints sit ([`Joint::origin_m`]) and what they are in a
/// person ([`Anatomy`]) is needed to follow a body: by a table of angles, a recording or a hand a robot
/// is moved without.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Robot {
    /// Version of this file format; 1.
    pub schema: u32,
    /// What it is called, `[a-z0-9-]+`; the file may be named otherwise.
    pub name: String,
    /// One line for `profile list`.
    #[serde(default = "undescribed")]
    pub description: String,
    /// Where the figures come from.
    #[serde(default = "unsourced")]
    pub source: String,
    /// Rate the robot is driven at unless asked otherwise, Hz; absent = 50.
    #[serde(default = "usual_rate_hz")]
    pub rate_hz: f64,
    /// Where acceleration limits come from; `assumed: ...` is said in every report.
    #[serde(default = "assumed")]
    pub acceleration_source: String,
    /// Serial and CAN lines.
    #[serde(rename = "line")]
    pub lines: Vec<Line>,
    /// State the servos are configured to, by servo profile; a CAN actuator has none. A servo that no
    /// entry speaks of is as it leaves the factory, at the speed of its line.
    #[serde(default, rename = "setup")]
    pub setups: Vec<Setup>,
    /// Joints, in the order reports list them.
    #[serde(rename = "joint")]
    pub joints: Vec<Joint>,
    /// What stands for what in a human; absent: the robot follows no body.
    #[serde(default)]
    pub anatomy: Option<Anatomy>,
    /// What it weighs and takes up; absent: nobody said.
    #[serde(default)]
    pub body: Option<Body>,
    /// The file it was read from, if it is one of the user's own.
    #[serde(skip)]
    pub origin: Option<Origin>,
}

/// A file as it was when it was read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Origin {
    /// Where it lies.
    pub path: std::path::PathBuf,
    /// What stood in it.
    pub text: String,
}

fn undescribed() -> String {
    "a robot of one's own".to_owned()
}

fn unsourced() -> String {
    "unconfirmed: the file does not say where its figures come from".to_owned()
}

fn assumed() -> String {
    "assumed: the file does not say where its limits come from".to_owned()
}

fn usual_rate_hz() -> f64 {
    50.0
}

/// How servos of one model are configured in this robot: what preflight expects, and what the
/// virtual robot powers up with.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Setup {
    /// Servo profile by name.
    pub servo: String,
    /// Only these joints; absent: every joint with that servo. A later entry overrides an earlier.
    #[serde(default)]
    pub joints: Option<Vec<String>>,
    /// Firmware the virtual servo reports.
    pub firmware: u16,
    /// Raw values by register name.
    pub registers: BTreeMap<String, i64>,
    /// Where they are written.
    pub source: String,
}

/// One degree of freedom.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Joint {
    /// `[a-z0-9_]+`
    pub name: String,
    /// Line it hangs on.
    pub line: String,
    /// Bus ID.
    pub id: u8,
    /// Servo profile by name; on a CAN line the name of an actuator profile.
    pub servo: String,
    /// Identifier of a CAN actuator's answers, where it can be chosen (Damiao's MST_ID); absent: 0.
    #[serde(default)]
    pub answer_id: Option<u16>,
    /// Gain on the error of position at the actuator's output, N m/rad. Present for exactly the
    /// CAN actuators that are told their gains with every goal.
    #[serde(default)]
    pub kp_nm_rad: Option<f64>,
    /// Gain on the error of velocity, N m s/rad; as [`Joint::kp_nm_rad`].
    #[serde(default)]
    pub kd_nm_s_rad: Option<f64>,
    /// The silence, s, after which a CAN actuator lets go, as the user set it with the maker's
    /// tool; only where the line cannot set it ([`TimeoutKind::Configured`]).
    #[serde(default)]
    pub timeout_configured_s: Option<f64>,
    /// +1 or -1: joint angle = direction x gear x servo angle - offset; absent = 1.
    #[serde(default = "forward")]
    pub direction: i8,
    /// Turns of the joint for one turn of the servo; absent = 1.
    #[serde(default = "one")]
    pub gear: f64,
    /// Joint angle reads zero where the servo angle (after direction and gear) equals this, rad;
    /// absent = 0.
    #[serde(default)]
    pub offset_rad: f64,
    /// The other joint of a servo with two axes in one case: they share line speed and power.
    #[serde(default)]
    pub shares_case_with: Option<String>,
    /// Lowest allowed joint angle, rad.
    pub lower_rad: f64,
    /// Highest allowed joint angle, rad.
    pub upper_rad: f64,
    /// Highest allowed speed, rad/s.
    pub velocity_rad_s: f64,
    /// Highest allowed acceleration, rad/s².
    pub acceleration_rad_s2: f64,
    /// Pose the robot starts in, rad; absent: see [`Joint::initial_rad`].
    #[serde(default, rename = "initial_rad")]
    pub initial: Option<f64>,
    /// Joint whose link carries this one; absent: the base.
    #[serde(default)]
    pub parent: Option<String>,
    /// Origin of the joint in the parent link's frame, m, at all joints zero (X forward, Y left,
    /// Z up, every link frame parallel to the base at zero). Present with [`Joint::axis`].
    #[serde(default)]
    pub origin_m: Option<[f64; 3]>,
    /// Axis of rotation in that frame, unit length; positive angle by the right-hand rule.
    #[serde(default)]
    pub axis: Option<[f64; 3]>,
}

fn one() -> f64 {
    1.0
}

fn forward() -> i8 {
    1
}

/// How the robot's links stand for a human's segments.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Anatomy {
    /// Human segments the base link plays: `pelvis`, `torso` or both.
    pub base: Vec<Segment>,
    /// Joint angles, rad, in which the robot stands as a person does in N pose (upright, arms down
    /// at the sides, palms inwards, feet forward); joints not named are at zero. May lie outside
    /// the limits: it is a reference, not a goal.
    pub n_pose_rad: BTreeMap<String, f64>,
    /// Links that play a segment.
    #[serde(rename = "segment")]
    pub segments: Vec<SegmentLink>,
    /// Where it comes from.
    pub source: String,
}

/// A link that plays a human segment.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct SegmentLink {
    /// The segment.
    pub segment: Segment,
    /// The last joint before the link.
    pub joint: String,
    /// Weight of the direction of the segment's long axis in the fit; 1 = normal.
    pub direction_weight: f64,
    /// Weight of the rotation about the long axis in the fit; 0 = ignored.
    pub twist_weight: f64,
}

/// Segments of the human body model (15 joints, 22 degrees of freedom).
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[serde(rename_all = "snake_case")]
#[allow(missing_docs)]
pub enum Segment {
    Pelvis,
    Torso,
    Head,
    LeftUpperArm,
    LeftForearm,
    RightUpperArm,
    RightForearm,
    LeftThigh,
    LeftShank,
    LeftFoot,
    RightThigh,
    RightShank,
    RightFoot,
}
