//! Virtual servos at register level on virtual half-duplex lines, and virtual CAN actuators, for tests
//! without hardware.
//!
//! - [`World`]: a robot's servos and the time they share. Virtual time passes only when asked, so a
//!   minute of motion takes milliseconds, and the same seed and host bytes give the same bytes.
//! - [`bench()`]: servos without a robot around them.
//! - [`Fault`]: what goes wrong, on purpose; [`Script`] reads faults from a file.
//! - [`Verdict`]: what the referee saw; it judges at register level and knows only the robot file.
//! - [`imu`]: virtual inertial sensors on a moving body.
//! - [`can`]: CAN lines, of a world or alone, and what hangs on them.
//! - [`control`]: the same verbs for a program outside, as lines of JSON.
//! - [`Door`]: the same world behind a pseudo-terminal, in real time, for other programs; a CAN line
//!   as a USB-CAN adapter. [`LiveCan`]: a CAN line in real time, to be carried elsewhere.
//!
//! The device side of the protocols is written here from the makers' manuals alone. This crate
//! never uses the driver's codec: a mistake made twice would be seen, one that is shared would not.

/// The README's Rust example is compiled and run as a test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

mod adapter;
mod bench;
mod body;
pub mod can;
pub mod control;
mod door;
mod dynamixel1;
mod dynamixel2;
mod exchange;
mod family;
mod fault;
mod feetech;
mod hand;
pub mod imu;
mod journal;
mod line;
mod motor;
mod referee;
mod script;
mod servo;
mod table;
mod world;

/// The files that say what servos, adapters and robots are.
pub use gaitway_profiles as profiles;

pub use adapter::Usb;
pub use bench::{BenchError, BenchServos, bench};
pub use body::{Body, Felt, Outside, Push, Turned};
pub use door::{Door, DoorError, LiveCan, PatientTime};
pub use fault::{Damage, Fault, Struck};
pub use hand::Hand;
pub use journal::{Asked, Entry, Happening, Journal};
pub use referee::{Rule, Verdict, Violation};
pub use script::{Script, ScriptError};
pub use world::{BadChecksum, JointState, MissingInChain, Options, TorqueSwitch, World, ZeroSpeed};

/// Why a world cannot be built.
#[derive(Debug, thiserror::Error)]
pub enum SimError {
    /// A joint names a servo nobody describes.
    #[error("no servo profile is named {0:?}")]
    UnknownServo(String),
    /// A joint names a line the robot does not have.
    #[error("no line is named {0:?}")]
    UnknownLine(String),
    /// A fault names a joint, or a `LINE/ID`, the robot does not have.
    #[error("no joint is named {0:?}, and no line has a servo with such an ID")]
    UnknownJoint(String),
    /// A fault is for a CAN line, and this is none.
    #[error("line {0:?} is no CAN line")]
    NotCan(String),
    /// A CAN actuator is asked for a register by name.
    #[error("{0} is a CAN actuator, and has no registers with names")]
    NoRegisters(String),
    /// A joint of a body is moved by what knows no body.
    #[error("{0} is moved by a CAN actuator, and these have no weight to move here")]
    NoWeight(String),
    /// A fault of a robot with weight, and the robot has none.
    #[error("a {0} needs a robot with weight")]
    NeedsWeight(&'static str),
    /// A servo has no such register.
    #[error("{servo} has no register {register:?}")]
    UnknownRegister {
        /// The servo's profile.
        servo: String,
        /// What was asked for.
        register: String,
        /// Those it has.
        known: String,
    },
    /// A register does not hold such a value.
    #[error("{register} does not hold {raw}: {low}..{high} are allowed")]
    Value {
        /// The register.
        register: String,
        /// The value.
        raw: i64,
        /// The least it holds.
        low: i64,
        /// The most.
        high: i64,
    },
    /// The position of a joint that torque holds is set as if it were a number.
    #[error("torque holds {0} where it is: setting its position would turn it in no time")]
    Held(String),
    /// A hand's speed or force is not above zero, or a number is none.
    #[error("a hand needs an angle, and a speed and a force above zero")]
    NoHand,
    /// No fault has this number, or nothing is left of it.
    #[error("there is no fault {0} that could end")]
    NoSuchFault(u64),
    /// Time can be stepped only while it is frozen.
    #[error("time runs by itself: freeze it first")]
    TimeRuns,
    /// Time goes with a host in this process.
    #[error("this world's time waits for its host and belongs to it")]
    OthersTime,
    /// So many faults are in force that none can be added.
    #[error("as many faults as there may be, {0}, have not ended")]
    TooManyFaults(usize),
    /// A latency timer that cannot be set, or not so.
    #[error("{}", latency_timer_words(adapter, *has_one))]
    LatencyTimer {
        /// The adapter.
        adapter: String,
        /// It has one.
        has_one: bool,
    },
    /// No adapter profile has this name.
    #[error("no adapter is named {0:?}")]
    UnknownAdapter(String),
    /// A servo or CAN actuator cannot play its part.
    #[error("joint {joint}: servo {servo} {reason}")]
    BadServo {
        /// The joint.
        joint: String,
        /// Its servo's profile.
        servo: String,
        /// What is wrong, as the rest of a sentence.
        reason: String,
    },
}

fn latency_timer_words(adapter: &str, has_one: bool) -> String {
    match has_one {
        true => format!("the latency timer of {adapter} can be 1 to 255 ms"),
        false => format!("{adapter} has no latency timer"),
    }
}
