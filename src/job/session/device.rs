//! Device calibration: all sensors lie still.

use super::Job;
use super::happening::{Happening, Settled};
use super::operator::{Ready, Unsteady, Words, ask_until};
use crate::error::Error;
use crate::sensing::{Clock, Ended, LOOK, MonotonicClock, Still, wall_clock};
use crate::session::files::{DeviceCheck, SCHEMA, SensorCheck};
use crate::session::still::judge;
use crate::time::Duration;
use std::collections::BTreeMap;

/// Looks at all sensors lying still, and writes down what was found.
pub(super) fn calibrate(job: &Job) -> Result<(), Ended> {
    let plan = &job.session()?.plan;
    let (still_s, hours) = (plan.still_s, plan.device_hours);
    // What stands in a file may be no time.
    let time = Duration::try_from_secs_f64(still_s).map_err(|cause| {
        let got = format!("{still_s}: {cause}");
        Error::new("a number of the plan is out of range").at("still_s").got(got)
    })?;
    let operator = job.operator;
    operator.ready(Ready::LyingStill { sensors: &job.names() })?;
    operator.hear(Happening::MeasuringStill { seconds: still_s });
    job.hub.begin_still();
    let ended = pause(job, time);
    let heard = job.hub.end_still();
    ended?;
    let mut check = checked(job, &heard, hours);
    for sensor in &check.sensors {
        operator.hear(Happening::SensorChecked(sensor));
    }
    if !check.passed && operator.unsteady()? == Unsteady::Accept {
        let ask = || operator.words(Words::WhyAccepted);
        check.accepted_because = ask_until(operator, ask, |words| match words.is_empty() {
            true => Err(Error::new("a reason is needed").allowed("some words")),
            false => Ok(words),
        })?;
    }
    let file = format!("calibration/{}.toml", job.progress.next_attempt("device"));
    job.folder.write_new(&file, &check)?;
    operator.hear(Happening::Settled(Settled::Devices(&check)));
    if check.is_usable() {
        operator.hear(Happening::Written { file: &file, holds_until: check.expires });
    }
    Ok(())
}

fn checked(job: &Job, heard: &BTreeMap<String, Still>, hours: f64) -> DeviceCheck {
    let made = wall_clock();
    let gone = job.hub.gone();
    let sensors: Vec<SensorCheck> = job
        .worn
        .iter()
        .map(|worn| {
            let silent = (Vec::new(), 0);
            let (samples, missed) = heard.get(&worn.name).unwrap_or(&silent);
            let mut check = judge(&worn.name, worn.rate_hz, samples, *missed);
            if let Some(why) = gone.get(&worn.name) {
                check.passed = false;
                check.why.push(format!("it is gone: {why}"));
            }
            check
        })
        .collect();
    DeviceCheck {
        schema: SCHEMA,
        made,
        expires: made.plus_hours(hours),
        passed: sensors.iter().all(|sensor| sensor.passed),
        accepted_because: String::new(),
        sensors,
    }
}

/// Lets time pass, unless the operator wants it to end.
fn pause(job: &Job, time: Duration) -> Result<(), Ended> {
    let until = MonotonicClock.now() + time;
    loop {
        job.check()?;
        let now = MonotonicClock.now();
        if now >= until {
            return Ok(());
        }
        MonotonicClock.sleep_until((now + LOOK).min(until));
    }
}
