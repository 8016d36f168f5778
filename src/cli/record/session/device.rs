//! Device calibration: all sensors lie still.

use super::Job;
use super::console::Ended;
use crate::sensing::Still;
use crate::sensing::{Clock, MonotonicClock};
use crate::session::files::{DeviceCheck, SCHEMA, SensorCheck};
use crate::session::still::judge;
use crate::time::Duration;
use std::collections::BTreeMap;

/// Looks at all sensors lying still, and writes down what was found.
pub fn calibrate(job: &mut Job) -> Result<(), Ended> {
    let plan = &job.session()?.plan;
    let (still_s, hours) = (plan.still_s, plan.device_hours);
    job.console.say(&format!(
        "\nDevice calibration. Lay all sensors down ({}), for example on a table, and do not touch \
         it.",
        job.names().join(", ")
    ));
    job.console.choose("Do they lie still?", &[("y", "measure")])?;
    job.console.say(&format!("measuring for {still_s} s"));
    job.hub.begin_still();
    let ended = job.pause(Duration::from_secs_f64(still_s));
    let heard = job.hub.end_still();
    ended?;
    let mut check = checked(job, &heard, hours);
    for sensor in &check.sensors {
        job.console.say(&described(sensor));
    }
    if !check.passed {
        let choices =
            [("r", "repeat (what was measured is kept)"), ("a", "go on with them all the same")];
        if job.console.choose("Not every sensor is good.", &choices)? == "a" {
            check.accepted_because = job.console.ask_until("why?", |answer| match answer {
                "" => Err(crate::error::Error::new("a reason is needed").allowed("some words")),
                answer => Ok(answer.to_owned()),
            })?;
        }
    }
    let name = format!("calibration/{}.toml", job.progress.next_attempt("device"));
    job.folder.write_new(&name, &check)?;
    if check.is_usable() {
        job.console.say(&format!("written: {name}; it holds until {}", check.expires));
    }
    Ok(())
}

fn checked(job: &Job, heard: &BTreeMap<String, Still>, hours: f64) -> DeviceCheck {
    let made = job.now();
    let gone = job.hub.gone();
    let sensors: Vec<SensorCheck> = job
        .names()
        .iter()
        .map(|name| {
            let silent = (Vec::new(), 0);
            let (samples, missed) = heard.get(name).unwrap_or(&silent);
            let mut check = judge(name, job.nominal_rate_hz(name), samples, *missed);
            if let Some(why) = gone.get(name) {
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

fn described(sensor: &SensorCheck) -> String {
    let SensorCheck { name, samples, rate_hz, .. } = sensor;
    let mut line = format!(
        "  {name:<16} {}  {samples} samples, {rate_hz:.1} per second",
        if sensor.passed { "pass  " } else { "REPEAT" }
    );
    let deg = |rad: f64| rad.to_degrees();
    if let (Some(noise), Some(bias)) = (sensor.noise_rad_s, sensor.bias_rad_s) {
        line += &format!(", noise {:.2} deg/s, bias {:.2} deg/s", deg(noise), deg(bias));
    }
    if let Some(drift) = sensor.heading_drift_rad_s {
        line += &format!(", drift {:+.1} deg/min", deg(drift) * 60.0);
    }
    for why in &sensor.why {
        line += &format!("\n    {why}");
    }
    line
}

impl Job<'_> {
    /// Lets time pass.
    pub fn pause(&self, time: Duration) -> Result<(), Ended> {
        let until = MonotonicClock.now() + time;
        loop {
            self.console.check()?;
            let now = MonotonicClock.now();
            if now >= until {
                return Ok(());
            }
            MonotonicClock.sleep_until((now + crate::sensing::LOOK).min(until));
        }
    }
}
