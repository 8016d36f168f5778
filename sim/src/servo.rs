//! One virtual servo: its control table, its motor and what its firmware does between them.
//!
//! The bus sees bytes at addresses ([`access`]); everything here works on roles. What the manuals
//! leave open is decided where it arises and said there: modes and positions ([`mode`]), goals,
//! gains and reports ([`control`]), errors and torque ([`protection`]), [`backup`].
//!
//! Bus Watchdog(98), DYNAMIXEL 2.0: any instruction on the line starts it anew, whoever it is for.
//! When it bites, the motor stops where it is, or gives nothing in current and PWM mode; goals are
//! refused until 0 is written, and the motor then waits for a new goal.

mod access;
mod backup;
mod control;
mod mode;
mod protection;

use crate::body::Push;
use crate::motor::{Advance, Motor};
use crate::table::{Item, Model};
use crate::world::{TorqueSwitch, ZeroSpeed};
use gaitway_profiles::{Encoding, Protocol, Region, Role};
use std::ops::Range;
use std::sync::Arc;

/// Time from power-up or reboot until a servo listens (assumed).
pub(crate) const BOOT_NS: u64 = 300_000_000;
/// Shortest time a Feetech servo takes to answer (assumed; the maker gives none).
const FEETECH_LATENCY_NS: u64 = 50_000;
/// One count of DYNAMIXEL Bus Watchdog(98).
const WATCHDOG_UNIT_NS: u64 = 20_000_000;

/// Why a servo does not do what an instruction says. The values are DYNAMIXEL 2.0's error numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Refusal {
    Failed = 1,
    Instruction = 2,
    Range = 4,
    Length = 5,
    Limit = 6,
    Access = 7,
}

impl Refusal {
    /// The bit of protocol 1.0's error byte that says so: angle limit, range or instruction.
    pub fn status_bit(self) -> u8 {
        match self {
            Refusal::Limit => 1 << 1,
            Refusal::Range | Refusal::Access => 1 << 3,
            Refusal::Failed | Refusal::Instruction | Refusal::Length => 1 << 6,
        }
    }
}

/// What happened inside a servo that the referee judges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Event {
    /// A goal position was written, or refused. The shaft is that far from it by its encoder, and
    /// turns that fast.
    Goal {
        raw: i64,
        accepted: bool,
        off_rad: f64,
        speed_rad_s: f64,
    },
    /// Torque came on with this much between goal and present position, counts both.
    TorqueOn {
        goal: i64,
        present: i64,
        error_rad: f64,
    },
    TorqueOff,
    /// The host has been silent for so long that the device gives up its goal.
    HostSilent,
    /// A write to this EEPROM address was tried.
    Eeprom {
        address: u16,
    },
    /// A CAN actuator keeps this over power-off from now on.
    Kept(&'static str),
}

#[derive(Clone, Debug)]
pub(crate) struct Servo {
    /// The joint it turns; a stray servo turns none.
    pub joint: Option<usize>,
    pub model: Arc<Model>,
    pub motor: Motor,
    /// Plugged in.
    pub attached: bool,
    /// Spans in which it neither hears nor answers, ns.
    pub silent: Vec<Range<u64>>,
    /// What the position register shows for good, whatever the shaft does: a fault of the encoder.
    pub frozen: Option<i64>,
    /// Whether it hears the packet now on the line.
    pub hears: bool,
    /// Statuses it has given so far.
    pub statuses: u64,
    /// Its one transmitter is busy until then.
    pub speaks_until_ns: u64,
    /// The position it has told in the answer it is giving, counts.
    pub told: Option<i64>,
    pub events: Vec<Event>,
    /// Index on the line of the other axis in the same case.
    pub mate: Option<usize>,
    /// That axis has torque, so EEPROM is closed to both.
    pub mate_torque: bool,
    /// What both axes in a case share has changed here: line speed or protocol.
    pub case_changed: bool,
    /// The instruction carried out is for its group.
    grouped: bool,
    pub zero_speed: ZeroSpeed,
    torque_switch: TorqueSwitch,
    /// When torque comes on by itself: the servo has started by then.
    torque_due_ns: Option<u64>,
    table: Vec<u8>,
    /// EEPROM as it will be after the next power-up.
    persistent: Vec<u8>,
    registered: Option<(u16, Vec<u8>)>,
    /// The control table a Control Table Backup has kept; outlives power.
    backup: Option<Vec<u8>>,
    booted_ns: u64,
    asleep_until_ns: u64,
    heard_ns: u64,
    watchdog_latched: bool,
    /// Bits as in the hardware error (or status) register, or as in protocol 1.0's error byte.
    errors: i64,
    /// The motor gives torque.
    engaged: bool,
    /// A goal was written since the mode was chosen.
    goal_written: bool,
    /// The turn positions within one turn are in.
    turn: i64,
    /// Counts by which the reading is off: an encoder that jumped, less whole turns cleared.
    reading_offset: i64,
    /// Shaft angle when the world began.
    start_rad: f64,
}

impl Servo {
    /// A servo as it comes from the factory, but for `firmware`.
    pub fn new(model: Arc<Model>, firmware: u16) -> Servo {
        let mut servo = Servo {
            joint: None,
            motor: Motor::new(&model.profile.motor, model.radians_per_count),
            attached: true,
            silent: Vec::new(),
            frozen: None,
            hears: false,
            statuses: 0,
            speaks_until_ns: 0,
            told: None,
            events: Vec::new(),
            mate: None,
            mate_torque: false,
            case_changed: false,
            grouped: false,
            zero_speed: ZeroSpeed::NoLimit,
            torque_switch: TorqueSwitch::WaitsForRegister,
            torque_due_ns: None,
            table: vec![0; model.length],
            persistent: vec![0; model.length],
            registered: None,
            backup: None,
            booted_ns: 0,
            asleep_until_ns: 0,
            heard_ns: 0,
            watchdog_latched: false,
            errors: 0,
            engaged: false,
            goal_written: false,
            turn: 0,
            reading_offset: 0,
            start_rad: 0.0,
            model,
        };
        servo.factory_table();
        servo.put(Role::ModelNumber, i64::from(servo.model.profile.model_number));
        match servo.model.role(Role::FirmwareVersionMinor) {
            Some(_) => {
                servo.put(Role::FirmwareVersion, i64::from(firmware >> 8));
                servo.put(Role::FirmwareVersionMinor, i64::from(firmware & 0xFF));
            }
            None => servo.put(Role::FirmwareVersion, i64::from(firmware)),
        }
        servo.persistent.clone_from(&servo.table);
        servo.boot();
        servo
    }

    fn factory_table(&mut self) {
        for item in &self.model.items {
            item.encode(item.initial, &mut self.table[item.range()]);
        }
    }

    /// What the firmware works out for itself at power-up.
    fn boot(&mut self) {
        self.goals_to_limits();
        self.note_turn();
        self.put_held(Role::GoalPosition, self.present_position());
        self.update_regulator();
    }

    /// Power is lost and comes back: RAM at power-up values, EEPROM as last stored, no torque.
    pub fn restart(&mut self, now_ns: u64, awake_ns: u64) {
        self.advance(now_ns);
        let model = Arc::clone(&self.model);
        for item in &model.items {
            let range = item.range();
            match item.region {
                Region::Eeprom => {
                    self.table[range.clone()].copy_from_slice(&self.persistent[range]);
                }
                Region::Ram if model.is_measured(item) => {}
                Region::Ram => item.encode(item.initial, &mut self.table[range]),
            }
        }
        // A factory value of 1 would be a fault of the profile; what brings torque on by itself
        // does so once the servo has started.
        self.put(Role::TorqueEnable, 0);
        self.errors = 0;
        self.watchdog_latched = false;
        self.goal_written = false;
        self.registered = None;
        self.follow_torque();
        self.forget_turns();
        // A restart while the power is gone does not bring it back.
        self.asleep_until_ns = self.asleep_until_ns.max(awake_ns);
        self.booted_ns = self.asleep_until_ns.saturating_sub(BOOT_NS);
        self.boot();
        self.start_up();
        self.set_torque_switch(self.torque_switch);
    }

    /// What switches its torque on from now on, if it is a FEETECH; it has just been powered up.
    pub fn set_torque_switch(&mut self, torque_switch: TorqueSwitch) {
        self.torque_switch = torque_switch;
        let feetech = matches!(self.model.protocol, Protocol::FeetechSts | Protocol::FeetechScs);
        let by_itself = feetech && torque_switch == TorqueSwitch::OnAtPowerUp;
        self.torque_due_ns = by_itself.then_some(self.asleep_until_ns);
        self.advance(self.motor.now_ns());
    }

    /// Torque comes on by itself, where the shaft stands.
    fn wake_with_torque(&mut self, due_ns: u64) {
        self.turn_until(due_ns);
        self.torque_due_ns = None;
        self.put_held(Role::GoalPosition, self.present_position());
        if !self.is_shut_down() {
            self.put(Role::TorqueEnable, 1);
            self.follow_torque();
        }
    }

    /// EEPROM as it left the factory, but for what `keep` names, then a restart. As one of a group
    /// a servo keeps its EEPROM and does nothing.
    pub fn factory_reset(&mut self, now_ns: u64, keep: &[Role]) {
        if self.grouped {
            return;
        }
        self.case_changed = true;
        let kept: Vec<_> = keep
            .iter()
            .chain(&[Role::ModelNumber, Role::FirmwareVersion, Role::FirmwareVersionMinor])
            .filter_map(|&role| Some((role, self.value(role)?)))
            .collect();
        self.events.push(Event::Eeprom { address: 0 });
        self.factory_table();
        for (role, raw) in kept {
            self.put(role, raw);
        }
        self.persistent.clone_from(&self.table);
        self.restart(now_ns, now_ns + BOOT_NS);
    }

    /// True if it makes out bytes that come at this speed.
    pub fn is_set_to(&self, baud_bps: u32) -> bool {
        // A receiver samples mid-bit: about 3 % of difference still reads ten bits.
        let same = |own: u32| u64::from(own.abs_diff(baud_bps)) * 100 <= u64::from(own) * 3;
        self.baud_bps().is_some_and(same)
    }

    /// True if it can hear a packet that ends at `now_ns` at `baud_bps`.
    pub fn can_hear(&self, now_ns: u64, baud_bps: u32) -> bool {
        self.attached
            && now_ns >= self.asleep_until_ns
            && !self.silent.iter().any(|span| span.contains(&now_ns))
            && self.is_set_to(baud_bps)
    }

    /// Any instruction on the line feeds the watchdog.
    pub fn heard(&mut self, now_ns: u64) {
        if self.watchdog_ns().is_some() {
            self.advance(now_ns);
        }
        self.heard_ns = now_ns;
    }

    pub fn advance(&mut self, now_ns: u64) {
        if let Some(due_ns) = self.torque_due_ns.filter(|&due_ns| due_ns <= now_ns) {
            self.wake_with_torque(due_ns);
        }
        if let Some(span_ns) = self.watchdog_ns() {
            let deadline_ns = self.heard_ns + span_ns;
            if self.torque_on() && now_ns > deadline_ns {
                self.turn_until(deadline_ns);
                self.bite();
            }
        }
        self.turn_until(now_ns);
        self.protect();
    }

    fn turn_until(&mut self, now_ns: u64) {
        loop {
            match self.motor.advance(now_ns) {
                Advance::Done => break,
                Advance::Overloaded => self.overloaded(),
                Advance::Overcurrent => self.overcurrent(),
            }
        }
    }

    /// From here on a body turns the shaft.
    pub fn carry(&mut self) {
        self.motor.carry();
    }

    /// Its shaft turns by itself again.
    pub fn put_down(&mut self) {
        self.motor.put_down();
    }

    /// What the servo does in its next step to a body that turns its shaft, in the sense of its
    /// registers.
    pub fn push_body(&mut self, now_ns: u64) -> Push {
        self.advance(now_ns);
        let (pushed, exceeded) = self.motor.push_body();
        match exceeded {
            Advance::Done => {}
            Advance::Overloaded => self.overloaded(),
            Advance::Overcurrent => self.overcurrent(),
        }
        let stall_nm = self.model.profile.motor.stall_torque_nm;
        Push {
            torque_nm: self.side() * pushed.torque_ratio * stall_nm,
            gives_nm_s_rad: pushed.gives_s_rad * stall_nm,
            armature_kg_m2: self.motor.inertia_ratio_s2_rad() * stall_nm,
        }
    }

    /// How far a body has turned the shaft since the start, rad, and how fast, in the sense of its
    /// registers.
    pub fn carry_to(&mut self, turned_rad: f64, rate_rad_s: f64) {
        let position_rad = self.start_rad + self.side() * turned_rad;
        self.motor.carry_to(position_rad, self.side() * rate_rad_s);
    }

    /// Bus Watchdog(98): 1..127 are counts of 20 ms, 0 is off and 255 means it has bitten.
    fn watchdog_ns(&self) -> Option<u64> {
        let raw = self.value(Role::BusWatchdog)?;
        (1..=127).contains(&raw).then(|| raw as u64 * WATCHDOG_UNIT_NS)
    }

    fn bite(&mut self) {
        self.watchdog_latched = true;
        self.put(Role::BusWatchdog, -1);
        self.stand_still();
    }

    pub fn id(&self) -> u8 {
        self.value(Role::Id).unwrap_or(0) as u8
    }

    /// True if an instruction to this ID is carried out: its own, or that of its group (Secondary
    /// ID(12), 253 and above = none). As one of a group it never answers.
    pub fn obeys(&self, id: u8) -> bool {
        let group = self.value(Role::SecondaryId).filter(|group| (0..=252).contains(group));
        id == self.id() || group == Some(i64::from(id))
    }

    /// Carries out an instruction to its Secondary ID: EEPROM is closed.
    pub fn as_one_of_group<T>(&mut self, carry_out: impl FnOnce(&mut Servo) -> T) -> T {
        self.grouped = true;
        let done = carry_out(self);
        self.grouped = false;
        done
    }

    pub fn baud_bps(&self) -> Option<u32> {
        let index = self.value(Role::BaudRate)?;
        let line = self.model.profile.baud.iter().find(|line| i64::from(line.index) == index);
        let bps = line.map(|line| line.bps);
        match self.model.protocol {
            // Baud Rate(4): 2 Mbps / (value + 1), whether the manual's table lists it or not.
            Protocol::Dynamixel1 => bps.or(u32::try_from(2_000_000 / (index + 1)).ok()),
            _ => bps,
        }
    }

    pub fn firmware(&self) -> u16 {
        let major = self.value(Role::FirmwareVersion).unwrap_or(0) as u16;
        match self.value(Role::FirmwareVersionMinor) {
            Some(minor) => major << 8 | minor as u16,
            None => major,
        }
    }

    /// Time between an instruction's end and the status, ns.
    pub fn return_delay_ns(&self) -> u64 {
        // DYNAMIXEL Return Delay Time(9) and Feetech address 7 both count 2 us.
        let delay_ns = self.value(Role::ReturnDelay).unwrap_or(0).max(0) as u64 * 2_000;
        match self.model.protocol {
            Protocol::Dynamixel1 | Protocol::Dynamixel2 => delay_ns,
            Protocol::FeetechSts | Protocol::FeetechScs => delay_ns.max(FEETECH_LATENCY_NS),
        }
    }

    /// Raw value of the register with this role.
    pub fn value(&self, role: Role) -> Option<i64> {
        let item = self.model.role(role)?;
        Some(item.decode(&self.table[item.range()]))
    }

    /// Value in SI units of the register with this role.
    fn si(&self, role: Role) -> Option<f64> {
        let item = self.model.role(role)?;
        Some(self.model.si(item, item.decode(&self.table[item.range()])))
    }

    fn put(&mut self, role: Role, raw: i64) {
        if let Some(item) = self.model.role(role) {
            item.encode(raw, &mut self.table[item.range()]);
        }
    }

    /// As [`Servo::put`], but a value that does not fit becomes the nearest that does.
    fn put_held(&mut self, role: Role, raw: i64) {
        if let Some(item) = self.model.role(role) {
            let (low, high) = item.representable();
            item.encode(raw.clamp(low, high), &mut self.table[item.range()]);
        }
    }

    fn put_si(&mut self, role: Role, si: f64) {
        if let Some(item) = self.model.role(role) {
            let raw = self.model.raw(item, si);
            item.encode(raw, &mut self.table[item.range()]);
        }
    }

    /// What a board measures; what does not fit becomes the nearest that does.
    pub fn measure(&mut self, address: u16, raw: f64) {
        if let Some(item) = self.model.at(address) {
            let (low, high) = item.representable();
            let raw = raw.round().clamp(low as f64, high as f64) as i64;
            item.encode(raw, &mut self.table[item.range()]);
        }
    }

    /// Raw value of the named register, refreshed.
    pub fn named(&mut self, name: &str) -> Option<i64> {
        self.refresh();
        let item = self.model.named(name)?;
        Some(item.decode(&self.table[item.range()]))
    }

    /// Puts a raw value where no bus could, for setting up a scene. Returns false if there is no
    /// such register or the value does not fit.
    pub fn force(&mut self, name: &str, raw: i64) -> bool {
        let Some(&item) = self.model.named(name) else { return false };
        let unsigned_twin = item.encoding == Encoding::I8 && (0..=255).contains(&raw);
        let (low, high) = item.representable();
        if !(low..=high).contains(&raw) && !unsigned_twin {
            return false;
        }
        let si = self.model.si(&item, raw);
        match item.role {
            Some(Role::PresentTemperature) => self.motor.set_temperature_c(si),
            Some(Role::PresentVoltage) => self.motor.set_supply_v(si),
            Some(Role::PresentPosition) => self.motor.place(self.shaft_rad(raw)),
            Some(Role::HardwareError) => self.errors = raw,
            _ => {}
        }
        item.encode(raw, &mut self.table[item.range()]);
        self.persistent[item.range()].copy_from_slice(&self.table[item.range()]);
        self.note_turn();
        self.update_regulator();
        self.follow_torque();
        true
    }

    /// Turns the limp shaft so that its register angle (zero at `zero_count`) is `angle_rad`.
    pub fn place(&mut self, angle_rad: f64) {
        let zero = i64::from(self.model.profile.position.zero_count);
        self.motor.place(self.shaft_rad(zero) + self.side() * angle_rad);
        self.note_turn();
        self.put_held(Role::GoalPosition, self.present_position());
    }

    /// Turns the shaft by hand, in the sense of its registers.
    pub fn turn_by(&mut self, angle_rad: f64) {
        self.motor.place(self.motor.position_rad() + self.side() * angle_rad);
        self.note_turn();
    }

    /// Its plug is drawn: it loses its power, and neither hears nor answers.
    pub fn unplug(&mut self, now_ns: u64) {
        self.restart(now_ns, now_ns);
        self.put(Role::TorqueEnable, 0);
        self.follow_torque();
        self.torque_due_ns = None;
        self.attached = false;
    }

    /// It is plugged in, and boots.
    pub fn plug(&mut self, now_ns: u64) {
        self.attached = true;
        self.restart(now_ns, now_ns + BOOT_NS);
    }

    /// Power that was to come back later comes back now.
    pub fn power_back(&mut self, now_ns: u64) {
        if self.asleep_until_ns > now_ns + BOOT_NS {
            self.asleep_until_ns = now_ns + BOOT_NS;
            self.booted_ns = now_ns;
            if self.torque_due_ns.is_some() {
                self.torque_due_ns = Some(self.asleep_until_ns);
            }
        }
    }

    /// Somebody takes the shaft to where it has turned by `turned_rad` since the start, with at most
    /// this share of its stall torque.
    pub fn grip(&mut self, turned_rad: f64, speed_rad_s: f64, most: f64, holds_on: bool) {
        let to_rad = self.start_rad + self.side() * turned_rad;
        self.motor.grip(to_rad, speed_rad_s, most, holds_on);
    }

    /// Puts a raw value into EEPROM, or RAM, by role.
    pub fn set_up(&mut self, role: Role, raw: i64) {
        self.put(role, raw);
        if let Some(item) = self.model.role(role) {
            self.persistent[item.range()].copy_from_slice(&self.table[item.range()]);
        }
    }

    /// From here on [`Servo::turned_rad`] counts.
    pub fn mark_start(&mut self) {
        self.start_rad = self.motor.position_rad();
    }

    /// How far the shaft has turned since the start, in the sense of its registers, rad.
    pub fn turned_rad(&self) -> f64 {
        self.side() * (self.motor.position_rad() - self.start_rad)
    }

    pub fn velocity_rad_s(&self) -> f64 {
        self.side() * self.motor.velocity_rad_s()
    }

    /// The encoder's reading jumps.
    pub fn jump(&mut self, counts: i64) {
        self.reading_offset += counts;
    }

    /// By how many counts its reading has jumped so far, less whole turns cleared.
    pub fn reading_offset(&self) -> i64 {
        self.reading_offset
    }

    /// Clear (multi-turn): the reading becomes that within one turn.
    pub fn clear_turns(&mut self) -> Result<(), Refusal> {
        if self.is_moving() {
            return Err(Refusal::Failed);
        }
        let turn = i64::from(self.model.profile.position.counts);
        self.reading_offset -= self.present_position().div_euclid(turn) * turn;
        self.put(Role::GoalPosition, self.present_position());
        Ok(())
    }

    /// Stores a write for [`Servo::action`].
    pub fn register(&mut self, address: u16, bytes: &[u8]) -> Result<(), Refusal> {
        if self.model.protocol == Protocol::Dynamixel2 {
            self.check(address, bytes)?;
        }
        self.registered = Some((address, bytes.to_vec()));
        self.put(Role::RegisteredInstruction, 1);
        Ok(())
    }

    pub fn action(&mut self, now_ns: u64) -> Result<(), Refusal> {
        let (address, bytes) = self.registered.take().ok_or(Refusal::Instruction)?;
        self.put(Role::RegisteredInstruction, 0);
        self.write(address, &bytes, now_ns)
    }

    fn item_bytes(&self, item: &Item) -> &[u8] {
        &self.table[item.range()]
    }
}
