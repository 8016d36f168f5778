//! How long one question and its answer take on a line.

use crate::bus::scan::scan;
use crate::bus::{AskError, Protocol};
use crate::error::{Error, ErrorKind};
use crate::job::finding::Finding;
use crate::rig::Address;
use crate::rig::{OpenLine, is_can, open_bus, open_can};
use crate::time::Duration;

/// Questions asked.
const QUESTIONS: usize = 200;
/// A median above this leaves a 100 Hz cycle little time for anything else, s.
const SLOW_S: f64 = 0.004;
/// More than looking for a servo takes.
const LONGEST: Duration = Duration::from_secs(60);

/// A line that cannot be opened, or on which nobody answers.
fn refused(about: String, error: Error) -> Finding {
    let remedy = error.remedy.unwrap_or_else(|| "see above".into());
    let got = error.got.map(|got| format!(": {got}")).unwrap_or_default();
    Finding::problem(about, format!("{}{got}", error.what), remedy)
}

/// Round trips with the first servo that answers on the line.
#[must_use]
pub fn measured(address: &Address, robot: Option<&str>) -> Finding {
    let about = format!("round trip on {address}");
    if is_can(address, robot).unwrap_or(false) {
        let line = match open_can(address, robot, 0) {
            Ok(line) => line,
            Err(error) => return refused(about, error),
        };
        let speed = line.speed_words();
        let found = format!("is measured on serial lines only; this one opens, at {speed}");
        let remedy = "gaitway scan BUS says who answers; gaitway play --dry-run plans the line";
        return Finding::advice(about, found, remedy);
    }
    let opened = open_bus(address, robot, 0);
    let taken = opened.and_then(|mut line| {
        let (protocol, id) = first_servo(&mut line)?;
        Ok((id, round_trips_s(&mut line, protocol, id)?))
    });
    let (id, (mut taken_s, missed)) = match taken {
        Ok(taken) => taken,
        Err(error) => return refused(about, error),
    };
    taken_s.sort_by(f64::total_cmp);
    let at = |share: f64| {
        let index = (share * (taken_s.len().saturating_sub(1)) as f64).round() as usize;
        taken_s.get(index).copied().unwrap_or(f64::NAN)
    };
    let found = format!(
        "{} of {QUESTIONS} answers from ID {id}: median {:.2} ms, 99 % within {:.2} ms, longest \
         {:.2} ms",
        taken_s.len(),
        at(0.5) * 1e3,
        at(0.99) * 1e3,
        at(1.0) * 1e3
    );
    if missed > 0 {
        let remedy = "check connectors, the supply and the line's terminator";
        return Finding::problem(about, found, remedy);
    }
    if !(at(0.5) <= SLOW_S) {
        let remedy = "lower the adapter's latency timer (see above), the servos' Return Delay Time, \
                      or raise the line speed";
        return Finding::advice(about, found, remedy);
    }
    Finding::ok(about, found)
}

fn first_servo(line: &mut OpenLine) -> Result<(Protocol, u8), Error> {
    let failed = |e: AskError| Error::of(ErrorKind::Damaged, "the line failed").got(e.to_string());
    let nobody = || {
        Error::of(ErrorKind::Silent, "nobody answers")
            .got(format!("at {} bit/s", line.baud_bps))
            .remedy("check power and cable; gaitway scan BUS --baud all")
    };
    let groups = [
        vec![Protocol::Dynamixel2],
        vec![Protocol::FeetechSts],
        vec![Protocol::Dynamixel1, Protocol::FeetechScs],
    ];
    for protocols in groups {
        let budget = line.clock.now() + LONGEST;
        let scanned = scan(&mut line.bus, &protocols, |_| Vec::new(), budget).map_err(failed)?;
        if let Some(found) = scanned.found.first() {
            return Ok((found.protocol, found.id));
        }
    }
    Err(nobody())
}

/// Times of the answers, s, and how many did not come.
fn round_trips_s(
    line: &mut OpenLine,
    protocol: Protocol,
    id: u8,
) -> Result<(Vec<f64>, usize), Error> {
    line.bus.set_retries(0);
    let mut taken_s = Vec::with_capacity(QUESTIONS);
    let mut missed = 0;
    for _ in 0..QUESTIONS {
        line.clock.sleep_until(line.bus.ready_at());
        let began = line.clock.now();
        let budget = line.budget();
        match line.bus.ping(protocol, id, budget) {
            Ok(_) => taken_s.push(line.clock.now().since(began).as_secs_f64()),
            Err(AskError::Miss(_)) => missed += 1,
            Err(error) => {
                return Err(Error::of(ErrorKind::Damaged, "the line failed").got(error.to_string()));
            }
        }
    }
    Ok((taken_s, missed))
}
