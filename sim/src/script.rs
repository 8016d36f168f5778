//! Faults as data: a TOML file with one `[[fault]]` table for each, and perhaps a `[behaviour]` table
//! for what the manuals leave open. The keys are listed in this crate's README.

pub(crate) mod keys;

use crate::adapter::Usb;
use crate::can::{CanFrame, Trouble};
use crate::fault::{Damage, Fault};
use crate::world::{BadChecksum, MissingInChain, Options, TorqueSwitch, ZeroSpeed};
use gaitway_profiles::counted;
use keys::{Keys, line_of};
use serde::Deserialize;
use std::path::PathBuf;
use toml::{Spanned, Table};

/// Longest script, bytes.
const LONGEST: usize = 1 << 20;
const DAMAGES: [&str; 11] = [
    "mute",
    "lie",
    "wrong-id",
    "flip-bit",
    "drop-byte",
    "duplicate",
    "stale-reply",
    "garbage",
    "false-header",
    "echo",
    "length",
];
const SERVO_FAULTS: [&str; 9] =
    ["silent", "overload", "reboot", "stuck", "frozen", "jump", "register", "twin", "trouble"];
const BODY_FAULTS: [&str; 2] = ["push", "slope"];
/// Hardest push, N, and steepest floor, rad.
const HARDEST_N: f64 = 10_000.0;
const STEEPEST_RAD: f64 = 1.5;
const LINE_FAULTS: [&str; 6] = ["brownout", "slow-line", "hang-up", "blocked", "bus-off", "babble"];

/// Faults and switches read from a script.
///
/// ```
/// let script = gaitway_sim::Script::parse(
///     "[[fault]]\nkind = 'silent'\njoint = 'r_knee'\nfrom_s = 2\nuntil_s = 2.5\n",
/// )?;
/// let options = script.apply(gaitway_sim::Options::default());
/// assert_eq!(options.faults.len(), 1);
/// # Ok::<(), gaitway_sim::ScriptError>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Script {
    /// The seed the script asks for.
    pub seed: Option<u64>,
    /// The faults, in the order of the file.
    pub faults: Vec<Fault>,
    /// What it says of [`Options::missing_in_chain`].
    pub missing_in_chain: Option<MissingInChain>,
    /// What it says of [`Options::bad_checksum`].
    pub bad_checksum: Option<BadChecksum>,
    /// What it says of [`Options::zero_speed`].
    pub zero_speed: Option<ZeroSpeed>,
    /// What it says of [`Options::torque_switch`].
    pub torque_switch: Option<TorqueSwitch>,
}

/// What is wrong with a script.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{at}: got {got}; allowed: {allowed}")]
pub struct ScriptError {
    /// Which fault, in which line, and which key.
    pub at: String,
    /// What is there.
    pub got: String,
    /// What could be.
    pub allowed: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    seed: Option<u64>,
    behaviour: Option<Spanned<Table>>,
    #[serde(default)]
    fault: Vec<Spanned<Table>>,
}

impl Script {
    /// Reads a script. Whether its joints and lines exist is seen when a world is built with it.
    ///
    /// # Errors
    /// Not TOML, an unknown kind or key, a value outside its range.
    pub fn parse(text: &str) -> Result<Script, ScriptError> {
        if text.len() > LONGEST {
            return Err(ScriptError {
                at: "script".to_string(),
                got: counted(text.len(), "byte"),
                allowed: format!("at most {LONGEST} bytes"),
            });
        }
        let file: File = gaitway_profiles::from_toml(text).map_err(|e| ScriptError {
            at: e.span().map_or("script".to_string(), |span| line_of(text, span.start)),
            got: e.message().to_string(),
            allowed: "TOML with [[fault]] tables, and perhaps a seed and [behaviour]".to_string(),
        })?;
        let mut script = Script { seed: file.seed, ..Script::default() };
        if let Some(table) = file.behaviour {
            let place = format!("behaviour ({})", line_of(text, table.span().start));
            script.read_behaviour(Keys::new(place, table.into_inner()))?;
        }
        for (k, table) in file.fault.into_iter().enumerate() {
            let place = format!("fault {} ({})", k + 1, line_of(text, table.span().start));
            script.faults.extend(read_fault(Keys::new(place, table.into_inner()))?);
        }
        Ok(script)
    }

    /// The options with what this script asks for.
    pub fn apply(self, options: Options) -> Options {
        Options {
            seed: self.seed.unwrap_or(options.seed),
            faults: self.faults,
            missing_in_chain: self.missing_in_chain.unwrap_or(options.missing_in_chain),
            bad_checksum: self.bad_checksum.unwrap_or(options.bad_checksum),
            zero_speed: self.zero_speed.unwrap_or(options.zero_speed),
            torque_switch: self.torque_switch.unwrap_or(options.torque_switch),
            ..options
        }
    }

    fn read_behaviour(&mut self, mut keys: Keys) -> Result<(), ScriptError> {
        let gap_ns = keys.time("missing_in_chain_gap_s")?;
        self.missing_in_chain = gap_ns.map(|gap_ns| MissingInChain::AnswerAfter { gap_ns });
        let checksum = [("ignore", BadChecksum::Ignore), ("answer", BadChecksum::Answer)];
        self.bad_checksum = keys.choice("bad_checksum", checksum)?;
        let zero = [("no-limit", ZeroSpeed::NoLimit), ("as-phase-says", ZeroSpeed::AsPhaseSays)];
        self.zero_speed = keys.choice("zero_speed", zero)?;
        let torque = [
            ("waits-for-register", TorqueSwitch::WaitsForRegister),
            ("comes-with-goal", TorqueSwitch::ComesWithGoal),
            ("on-at-power-up", TorqueSwitch::OnAtPowerUp),
        ];
        self.torque_switch = keys.choice("torque_switch", torque)?;
        keys.finish()
    }
}

/// The faults that one table stands for.
pub(crate) fn read_fault(mut keys: Keys) -> Result<Vec<Fault>, ScriptError> {
    let kind = keys.need_text("kind")?;
    let kinds = DAMAGES.iter().chain(&SERVO_FAULTS).chain(&LINE_FAULTS).chain(&BODY_FAULTS);
    let mut faults = if DAMAGES.contains(&kind.as_str()) {
        read_damage(&kind, &mut keys)?
    } else if SERVO_FAULTS.contains(&kind.as_str()) {
        let joint =
            keys.servo()?.ok_or_else(|| keys.missing("joint", "a joint, or line and id"))?;
        vec![read_servo_fault(&kind, joint, &mut keys)?]
    } else if LINE_FAULTS.contains(&kind.as_str()) {
        vec![read_line_fault(&kind, &mut keys)?]
    } else if BODY_FAULTS.contains(&kind.as_str()) {
        vec![read_body_fault(&kind, &mut keys)?]
    } else {
        let kinds: Vec<&str> = kinds.copied().collect();
        return Err(keys.wrong("kind", &format!("{kind:?}"), &kinds.join(", ")));
    };
    if let Some(probability) = keys.number("probability", 0.0, 1.0)? {
        for fault in &mut faults {
            match fault {
                // Drawn for each status.
                Fault::Statuses { probability: own, .. } => *own = probability,
                other => {
                    let fault = Box::new(other.clone());
                    *other = Fault::Perhaps { probability, fault };
                }
            }
        }
    }
    keys.finish()?;
    Ok(faults)
}

fn read_damage(kind: &str, keys: &mut Keys) -> Result<Vec<Fault>, ScriptError> {
    let damage = damage(kind, keys)?;
    let numbers = keys.numbers("nth")?;
    if let Some(numbers) = numbers {
        let servo = keys.servo()?;
        let joint =
            servo.ok_or_else(|| keys.missing("joint", "with nth: a joint, or line and id"))?;
        let status = |nth| Fault::Status { joint: joint.clone(), nth, damage };
        return Ok(numbers.into_iter().map(status).collect());
    }
    let of = match keys.servo()? {
        Some(joint) => Some(joint),
        None => keys.name("line")?.map(|line| format!("{line}/*")),
    };
    let (from_ns, until_ns) = keys.span()?;
    Ok(vec![Fault::Statuses { of, from_ns, until_ns, probability: 1.0, damage }])
}

fn damage(kind: &str, keys: &mut Keys) -> Result<Damage, ScriptError> {
    Ok(match kind {
        "mute" => Damage::Mute,
        "lie" => Damage::Lie {
            at: keys.integer("at", 0, 1023)?.unwrap_or(0) as usize,
            xor: keys.integer("xor", 1, 255)?.unwrap_or(0xFF) as u8,
        },
        "wrong-id" => Damage::WrongId { id: keys.need_integer("as_id", 0, 255)? as u8 },
        "flip-bit" => {
            Damage::FlipBit { bit: keys.integer("bit", 0, 8191)?.map(|bit| bit as usize) }
        }
        "drop-byte" => Damage::DropByte { at: keys.integer("at", 0, 1023)?.map(|at| at as usize) },
        "duplicate" => Damage::Duplicate,
        "stale-reply" => Damage::StaleReply { by_ns: keys.need_time("by_s")? },
        "garbage" => {
            Damage::Garbage { length: keys.integer("bytes", 1, 4096)?.unwrap_or(8) as usize }
        }
        "false-header" => Damage::FalseHeader,
        "echo" => Damage::Echo,
        _ => Damage::Length { length: keys.need_integer("length", 0, 65_535)? as u16 },
    })
}

fn read_servo_fault(kind: &str, joint: String, keys: &mut Keys) -> Result<Fault, ScriptError> {
    Ok(match kind {
        "silent" => {
            let (from_ns, until_ns) = keys.span()?;
            Fault::Silent { joint, from_ns, until_ns }
        }
        "overload" => Fault::Overload { joint, at_ns: keys.moment("at_s")? },
        "reboot" => Fault::Reboot { joint, at_ns: keys.moment("at_s")? },
        "stuck" => {
            let (from_ns, until_ns) = keys.span()?;
            Fault::StuckPosition { joint, from_ns, until_ns }
        }
        "frozen" => {
            let (from_ns, until_ns) = keys.span()?;
            Fault::FrozenPosition { joint, from_ns, until_ns }
        }
        "jump" => Fault::PositionJump {
            joint,
            at_ns: keys.moment("at_s")?,
            counts: keys.need_integer("counts", -1_000_000, 1_000_000)? as i32,
        },
        "register" => Fault::Register {
            joint,
            register: keys.need_text("register")?,
            raw: keys.need_integer("value", i64::from(i32::MIN), i64::from(u32::MAX))?,
            at_ns: keys.time("at_s")?.unwrap_or(0),
        },
        "trouble" => {
            let (from_ns, until_ns) = keys.span()?;
            let cause = keys.choice("cause", Trouble::NAMES)?;
            let names = Trouble::NAMES.map(|(name, _)| name).join(", ");
            let trouble = cause.ok_or_else(|| keys.missing("cause", &names))?;
            Fault::Trouble { joint, trouble, from_ns, until_ns }
        }
        _ => {
            let turn_rad = keys.number("turn_rad", -100.0, 100.0)?.unwrap_or(0.0);
            Fault::Twin { joint, turn_rad }
        }
    })
}

fn read_body_fault(kind: &str, keys: &mut Keys) -> Result<Fault, ScriptError> {
    let (from_ns, until_ns) = keys.span()?;
    if kind == "push" {
        let force_n = along(["ahead_n", "left_n", "up_n"], HARDEST_N, keys)?;
        let joint = keys.servo()?;
        return Ok(Fault::Push { joint, force_n, from_ns, until_ns });
    }
    let slope_rad = along(["ahead_rad", "left_rad"], STEEPEST_RAD, keys)?;
    Ok(Fault::Slope { slope_rad, from_ns, until_ns })
}

/// Parts of what has a direction: not all nothing.
fn along<const N: usize>(
    names: [&'static str; N],
    most: f64,
    keys: &mut Keys,
) -> Result<[f64; N], ScriptError> {
    let mut found = [0.0; N];
    for (value, name) in found.iter_mut().zip(names) {
        *value = keys.number(name, -most, most)?.unwrap_or(0.0);
    }
    if found == [0.0; N] {
        let allowed = format!("at least one of {}", names.join(", "));
        return Err(keys.missing(names[0], &allowed));
    }
    Ok(found)
}

fn read_line_fault(kind: &str, keys: &mut Keys) -> Result<Fault, ScriptError> {
    if kind == "brownout" {
        let (from_ns, until_ns) = keys.span()?;
        return Ok(Fault::Brownout { from_ns, until_ns });
    }
    let line = keys.name("line")?;
    Ok(match kind {
        "slow-line" => {
            let (from_ns, until_ns) = keys.span()?;
            let latency_ns = keys.time("latency_s")?.unwrap_or(0);
            let packet = keys.integer("packet_bytes", 1, 65_536)?;
            let packet_bytes = packet.map_or(Usb::FTDI.packet_bytes, |bytes| bytes as usize);
            let usb = keys.time("timer_s")?.map(|timer_ns| Usb { packet_bytes, timer_ns });
            Fault::SlowLine { line, from_ns, until_ns, latency_ns, usb }
        }
        "hang-up" => {
            let at_ns = keys.moment("at_s")?;
            let until_ns = keys.time("until_s")?;
            if until_ns.is_some_and(|until_ns| until_ns <= at_ns) {
                return Err(keys.wrong("until_s", "no later time", "later than at_s"));
            }
            let link = keys.text("link")?.map(PathBuf::from);
            Fault::HangUp { line, at_ns, until_ns, link }
        }
        "bus-off" => {
            let at_ns = keys.moment("at_s")?;
            let until_ns = keys.time("until_s")?;
            if until_ns.is_some_and(|until_ns| until_ns <= at_ns) {
                return Err(keys.wrong("until_s", "no later time", "later than at_s"));
            }
            Fault::BusOff { line, at_ns, until_ns }
        }
        "babble" => {
            let (from_ns, until_ns) = keys.span()?;
            let period_ns = keys.need_time("period_s")?;
            let id = keys.integer("frame_id", 0, 0x1FFF_FFFF)?.unwrap_or(0) as u32;
            let length = keys.integer("bytes", 0, 8)?.unwrap_or(8) as usize;
            let frame = CanFrame::classic(id, id > 0x7FF, &[0x55; 8][..length]);
            Fault::Babble { line, frame, period_ns, from_ns, until_ns }
        }
        _ => {
            let (from_ns, until_ns) = keys.span()?;
            let bytes = keys.integer("bytes", 0, 65_536)?.unwrap_or(0) as usize;
            Fault::Blocked { line, from_ns, until_ns, bytes }
        }
    })
}
