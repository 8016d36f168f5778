//! One servo whose model is known: registers in, registers out, never a goal and never torque.

use super::{Which, value};
use crate::bus::{AskError, Miss, Protocol};
use crate::device::Model;
use crate::error::{Error, ErrorKind};
use crate::rig::{OpenLine, ask_error, board_of, identify, open_bus};
use gaitway_profiles::{self as profiles, Access, Region, RegisterItem, Role, Servo};

/// So often it is tried to close a lock.
const LOCK_ROUNDS: usize = 3;

/// A servo that answers.
pub struct Device {
    /// The line it hangs on.
    pub line: OpenLine,
    /// Its ID.
    pub id: u8,
    /// What it is.
    pub model: Model,
    /// What it calls its model.
    pub model_number: u16,
    /// Its firmware.
    pub firmware: u16,
    /// The line's address, for words.
    bus: String,
    /// What else has to be typed to reach the line, for words.
    again: String,
    /// Under which ID and at which line speed else it may answer, bits per second.
    elsewhere: Vec<(u8, u32)>,
}

/// A register that was changed, raw.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Change {
    /// Before.
    pub old: i64,
    /// Now, read back.
    pub new: i64,
}

/// The servo that the robot file has at this place, if it can be the one that answered: several of one
/// maker's have one model number.
fn in_robot(which: &Which, protocol: Protocol, model_number: u16) -> Option<&'static Servo> {
    let robot = profiles::robot(which.robot.as_deref()?).ok()?;
    let is_here = |joint: &&profiles::Joint| {
        joint.id == which.id && which.bus.line.as_ref().is_none_or(|line| *line == joint.line)
    };
    let mut here = robot.joints.iter().filter(is_here);
    let servo = profiles::servo(&here.next()?.servo).ok()?;
    let fits = servo.model_number == model_number && Model::new(servo).protocol() == protocol;
    (here.next().is_none() && fits).then_some(servo)
}

impl Device {
    /// Opens the line and asks who is there.
    ///
    /// # Errors
    /// Nobody answers, or a model without profile and none named by `--servo`.
    pub fn open(which: &Which) -> Result<Self, Error> {
        // 254 is everybody, and 255 begins a packet.
        const LAST_ID: u8 = 253;
        if which.id > LAST_ID {
            return Err(Error::new("not an ID of a serial line")
                .at(which.bus.to_string())
                .got(which.id.to_string())
                .allowed(format!("0 to {LAST_ID}")));
        }
        let mut line = open_bus(&which.bus, which.robot.as_deref(), 0)?;
        let place = format!("ID {} on {} at {} bit/s", which.id, which.bus, line.baud_bps);
        let found = identify(&mut line, which.id, which.protocol);
        let found = found.map_err(|e| ask_error(place.clone(), &e))?;
        let silent = || ask_error(place.clone(), &AskError::Miss(Miss::Silent));
        let found = found.ok_or_else(silent)?;
        let named = which.model.as_deref().map(profiles::servo).transpose()?;
        let of_robot = || in_robot(which, found.protocol, found.model_number);
        let profile = named.or_else(of_robot).or(found.profile).ok_or_else(|| {
            if let Some(board) = board_of(found.protocol, found.model_number) {
                return Error::new("this is a board among servos, and no servo")
                    .at(place.clone())
                    .got(board.model.clone())
                    .remedy(
                        "gaitway list boards: names it; gaitway profile show NAME: its registers",
                    );
            }
            Error::of(ErrorKind::Unknown, "there is no profile for this servo model")
                .at(place.clone())
                .got(format!("model number {}, {}", found.model_number, found.protocol))
                .allowed(profiles::servo_names().collect::<Vec<_>>().join(", "))
                .remedy("name the nearest with --servo if you know that its registers are the same")
        })?;
        let model = Model::new(profile);
        if model.protocol() != found.protocol {
            return Err(Error::new("the servo speaks another protocol than that profile")
                .at(place)
                .got(found.protocol.to_string())
                .allowed(model.protocol().to_string()));
        }
        Ok(Self {
            line,
            id: which.id,
            model,
            model_number: found.model_number,
            firmware: found.firmware,
            bus: which.bus.to_string(),
            again: which.again(),
            elsewhere: Vec::new(),
        })
    }

    /// Where this servo is, in words.
    #[must_use]
    pub fn place(&self) -> String {
        format!("{}, ID {} on {}", self.model.profile().model, self.id, self.bus)
    }

    /// The line's address as the user can type it.
    #[must_use]
    pub fn bus(&self) -> &str {
        &self.bus
    }

    /// Words for a question that failed.
    #[must_use]
    pub fn failed(&self, error: &AskError) -> Error {
        ask_error(self.place(), error)
    }

    /// The register for `role`.
    #[must_use]
    pub fn item(&self, role: Role) -> Option<RegisterItem<'static>> {
        self.model.profile().register(role)?.item(0)
    }

    /// The raw value of a register.
    ///
    /// # Errors
    /// No answer, or one that does not fit.
    pub fn read(&mut self, item: &RegisterItem<'_>) -> Result<i64, Error> {
        let budget = self.line.budget();
        let length = u16::from(item.register.bytes);
        let asked =
            self.line.bus.read(self.model.protocol(), self.id, item.address, length, budget);
        let reply = asked.map_err(|e| self.failed(&e))?;
        let raw = self.model.raw_from_bytes(item.register, &reply.bytes);
        raw.map_err(|e| Error::new(e.to_string()).at(self.place()))
    }

    /// The raw value of the register for `role`; nothing if the model has none.
    ///
    /// # Errors
    /// As [`Device::read`].
    pub fn read_role(&mut self, role: Role) -> Result<Option<i64>, Error> {
        self.item(role).map(|item| self.read(&item)).transpose()
    }

    /// The SI value of the register for `role`; nothing if the model has none.
    ///
    /// # Errors
    /// As [`Device::read`].
    pub fn read_si(&mut self, role: Role) -> Result<Option<f64>, Error> {
        let Some(item) = self.item(role) else { return Ok(None) };
        let raw = self.read(&item)?;
        Ok(Some(self.model.si_from_raw(item.register, raw)))
    }

    /// True if the servo drives its motor.
    ///
    /// # Errors
    /// As [`Device::read`].
    pub fn torque_on(&mut self) -> Result<bool, Error> {
        Ok(self.read_role(Role::TorqueEnable)?.is_some_and(|raw| raw != 0))
    }

    /// Switches torque off, and its watchdog: whoever switches torque on next may know nothing of it.
    ///
    /// # Errors
    /// A servo that does not confirm that it is limp.
    pub fn let_go(&mut self) -> Result<(), Error> {
        let item = self.item(Role::TorqueEnable);
        let told = item.map_or(Ok(()), |item| self.tell(&item, 0));
        if told.is_err() || !matches!(self.torque_on(), Ok(false)) {
            return Err(Error::of(ErrorKind::Silent, "torque may still be on")
                .at(self.place())
                .got("no confirmation")
                .remedy("switch its power off before you touch it"));
        }
        match (self.item(Role::BusWatchdog), self.read_role(Role::BusWatchdog)?) {
            (Some(item), Some(raw)) if raw != 0 => self.tell(&item, 0),
            _ => Ok(()),
        }
    }

    /// Refuses while torque is on: no servo takes its kept registers then, and none should.
    ///
    /// # Errors
    /// Torque is on.
    pub fn must_be_limp(&mut self) -> Result<(), Error> {
        if !self.torque_on()? {
            return Ok(());
        }
        Err(Error::of(
            ErrorKind::NotReady,
            "torque is on; what a servo keeps is only changed while it is limp",
        )
        .at(self.place())
        .remedy(
            "support it, then: gaitway servo torque BUS ID off, or gaitway limp ROBOT --bus BUS",
        ))
    }

    /// Writes a register and reads it back. Kept registers only with `permit_eeprom`, only while
    /// torque is off, and through the lock where the servo has one.
    ///
    /// # Errors
    /// What is refused here (read-only, a goal, torque, EEPROM without permit, out of range), what
    /// the servo refuses, and a value it did not keep.
    pub fn set(
        &mut self,
        item: &RegisterItem<'_>,
        raw: i64,
        permit_eeprom: bool,
    ) -> Result<Change, Error> {
        self.may_set(item, raw, permit_eeprom)?;
        let old = self.read(item)?;
        if old == raw {
            return Ok(Change { old, new: raw });
        }
        if item.register.region == Region::Eeprom {
            self.must_be_limp()?;
            self.unlocked(|device| device.tell(item, raw))?;
        } else {
            self.tell(item, raw)?;
        }
        let new = self.read(item)?;
        if new == raw {
            return Ok(Change { old, new });
        }
        Err(Error::new("the servo did not keep what was written")
            .at(format!("{}, register {}", self.place(), item.name()))
            .got(format!("{new} (raw), {old} before"))
            .allowed(format!("{raw} (raw)")))
    }

    /// The rules for writing, before anything is written.
    ///
    /// # Errors
    /// As [`Device::set`].
    pub fn may_set(
        &self,
        item: &RegisterItem<'_>,
        raw: i64,
        permit_eeprom: bool,
    ) -> Result<(), Error> {
        let place = || format!("{}, register {}", self.place(), item.name());
        let register = item.register;
        if register.access == Access::R {
            return Err(Error::new("this register can only be read").at(place()));
        }
        // Closing a lock that was left open is no more than was promised.
        let closes = item.register.role == Some(Role::EepromLock)
            && self.model.eeprom_lock().is_some()
            && raw == 1;
        if let Some(command) = other_command(item).filter(|_| !closes) {
            return Err(Error::new("this register is not written here")
                .at(place())
                .remedy(command));
        }
        let (lowest, highest) = register.range();
        if !(lowest..=highest).contains(&raw) {
            return Err(Error::of(ErrorKind::OutsideLimits, "outside the register's range")
                .at(place())
                .got(format!("{raw} (raw)"))
                .allowed(value::range_words(&self.model, item)));
        }
        if register.region == Region::Eeprom && !permit_eeprom {
            return Err(Error::of(
                ErrorKind::NotPermitted,
                "this register is kept at power-off; nothing was written",
            )
            .at(place())
            .remedy("add --permit-eeprom if that is meant"));
        }
        Ok(())
    }

    /// Writes a register without reading it back and without any rule.
    pub fn write(&mut self, item: &RegisterItem<'_>, raw: i64) -> Result<(), AskError> {
        let mut bytes = Vec::with_capacity(4);
        let fits = self.model.append_raw(item.register, raw, &mut bytes);
        fits.map_err(|e| AskError::Unsayable(e.to_string()))?;
        let budget = self.line.budget();
        let protocol = self.model.protocol();
        self.line.bus.write(protocol, self.id, item.address, &bytes, budget).map(|_| ())
    }

    /// Writes a register whose new value is read back next: a servo whose status return level says
    /// that it answers reads only does so in silence.
    fn tell(&mut self, item: &RegisterItem<'_>, raw: i64) -> Result<(), Error> {
        match self.write(item, raw) {
            Err(error) if !is_lost(&error) => Err(self.failed(&error)),
            _ => Ok(()),
        }
    }

    /// From now on it may answer under another ID or at another line speed.
    pub fn may_be_found_at(&mut self, id: u8, baud_bps: u32) {
        self.elsewhere.extend([(self.id, self.line.baud_bps), (id, baud_bps)]);
    }

    /// Does `work` while the servo keeps what is written to it. Its lock is closed again whatever
    /// comes of that, wherever the servo may be found by then, or said to be open. Commands that come
    /// here let an interrupt wait (they defer signals).
    ///
    /// # Errors
    /// What `work` fails with, a servo that does not open or close its lock.
    pub fn unlocked<T>(
        &mut self,
        work: impl FnOnce(&mut Self) -> Result<T, Error>,
    ) -> Result<T, Error> {
        let done = self.unlock().and_then(|()| work(self));
        let Err(open) = self.lock() else { return done };
        let Err(error) = done else {
            return Err(open.got("what was asked for is done; that it closed was not confirmed"));
        };
        let also = format!("{}: {}", open.what, open.remedy.unwrap_or_default());
        let remedy = error.remedy.clone().map_or(also.clone(), |first| format!("{first}; {also}"));
        Err(error.remedy(remedy))
    }

    /// Lets the servo keep what is written from now on. A Dynamixel always does, unless somebody
    /// locked it.
    fn unlock(&mut self) -> Result<(), Error> {
        let Some(lock) = self.model.eeprom_lock() else { return self.must_be_open() };
        let Some(item) = lock.item(0) else { return Ok(()) };
        self.tell(&item, 0)?;
        match self.read(&item)? {
            0 => Ok(()),
            kept => Err(Error::new("the servo did not open its lock")
                .at(self.place())
                .got(kept.to_string())
                .allowed("0")),
        }
    }

    fn must_be_open(&mut self) -> Result<(), Error> {
        if self.read_role(Role::EepromLock)?.unwrap_or(0) == 0 {
            return Ok(());
        }
        Err(Error::new(
            "the servo is locked: what it keeps cannot be changed until its power goes off",
        )
        .at(self.place())
        .remedy("switch its power off and on"))
    }

    /// Closes the lock again, of servos whose lock can be opened again.
    fn lock(&mut self) -> Result<(), Error> {
        let Some(item) = self.model.eeprom_lock().and_then(|lock| lock.item(0)) else {
            return Ok(());
        };
        let here = (self.id, self.line.baud_bps);
        let mut places = vec![here];
        places.extend(self.elsewhere.iter().filter(|&&place| place != here));
        // An answer may be lost, and a servo that changed its terms has just restarted.
        let closed = (0..LOCK_ROUNDS).any(|_| places.iter().any(|&at| self.closes(&item, at)));
        self.id = here.0;
        if self.line.baud_bps != here.1 {
            self.line.set_speed(here.1)?;
        }
        if closed {
            return Ok(());
        }
        let (bus, again, lock) = (&self.bus, &self.again, item.name());
        let ids: Vec<String> = places.iter().map(|(id, _)| id.to_string()).collect();
        let id = ids.join(" or ");
        Err(Error::new(
            "the servo's EEPROM lock may be open: it would keep whatever is written to it",
        )
        .at(self.place())
        .got("no answer when it was closed")
        .remedy(format!(
            "close it with `gaitway servo set {bus} {id} '{lock}' 1{again}`, or switch the \
                 servo's power off and on"
        )))
    }

    /// Tells the servo that may be at `at` to close its lock; true if it says that it is closed.
    fn closes(&mut self, lock: &RegisterItem<'_>, (id, baud_bps): (u8, u32)) -> bool {
        if self.line.baud_bps != baud_bps && self.line.set_speed(baud_bps).is_err() {
            return false;
        }
        self.id = id;
        // Whether it heard that is seen by asking.
        let _ = self.write(lock, 1);
        self.read(lock).is_ok_and(|kept| kept == 1)
    }
}

/// True if the instruction may have been carried out all the same.
pub fn is_lost(error: &AskError) -> bool {
    matches!(error, AskError::Miss(miss) if !matches!(miss, Miss::Refused(_)))
}

/// The command that does what writing this register would do, where that needs more care.
fn other_command(item: &RegisterItem<'_>) -> Option<&'static str> {
    const MOVE: &str = "goals go through the guard: gaitway servo move BUS ID ANGLE_DEG, or play";
    match item.register.role {
        Some(Role::TorqueEnable) => Some(
            "torque: gaitway servo torque BUS ID on|off; of a robot: gaitway hold, gaitway limp",
        ),
        Some(Role::Id) => Some("gaitway servo set-id BUS ID NEW"),
        Some(Role::BaudRate) => Some("gaitway servo set-baud BUS ID BPS"),
        Some(Role::EepromLock) => Some("it is opened and closed where needed; nothing to do"),
        // Indirect data are other registers under another address, goals among them.
        Some(
            Role::GoalPosition
            | Role::GoalVelocity
            | Role::GoalCurrent
            | Role::GoalPwm
            | Role::GoalTime
            | Role::IndirectData,
        ) => Some(MOVE),
        _ if item.register.name.to_lowercase().starts_with("goal") => Some(MOVE),
        _ => None,
    }
}
