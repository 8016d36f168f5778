//! What is in a trial that was recorded, and what is thought of it.

use super::Job;
use super::happening::{Happening, RecordedTrial, Settled, TrialFault, TrialPart};
use super::operator::{Judged, Ready, Words};
use crate::body::worn::kept::Kept;
use crate::body::worn::swaps::swaps_in_walk;
use crate::error::Error;
use crate::job::heard::SILENT_S;
use crate::recording::{SensorMoment, SensorSeries, sensor_series};
use crate::sensing::{Ended, wall_clock};
use crate::session::angles::{WornMotion, body_of};
use crate::session::doubted;
use crate::session::files::{BODY_KEY, SCHEMA, TrialFile, TrialRecording, Verdict, trial_of};
use crate::session::tap::taps;
use std::collections::BTreeMap;

/// What marks of repetitions say.
pub(super) const GOOD: &str = "repetition";
pub(super) const BAD: &str = "repetition, bad";

/// Asks what is thought of a trial, and writes it down.
pub(super) fn judge(job: &Job, name: &str) -> Result<(), Ended> {
    let operator = job.operator;
    let files = job.progress.unjudged.get(name).cloned().unwrap_or_default();
    let (action, number) = trial_of(name).unwrap_or((name, 0));
    let mut recordings = Vec::new();
    let mut series = Vec::new();
    for file in files {
        // One that was cut off before its first byte cannot be read, and must not be in the way.
        let read = sensor_series(&job.folder.path(&file)).unwrap_or_else(|error| {
            operator.hear(Happening::Unreadable(&error));
            SensorSeries::default()
        });
        let said = read.start.as_ref().and_then(|start| start.metadata.get("subject").cloned());
        recordings.push(TrialRecording { subject: said.unwrap_or_default(), file });
        series.push(read);
    }
    let Some(first) = series.first() else {
        return Err(Error::new("a trial has no recording").at(name).into());
    };
    let recorded = recorded(name, &series, first.start_ns());
    operator.hear(Happening::Recorded(&recorded));
    let marked = first.markers.iter().filter(|marker| marker.text == GOOD).count();
    let usual = match recorded.faults.iter().all(TrialFault::is_slight) {
        true => Verdict::Keep,
        false => Verdict::Retake,
    };
    // Where nothing was heard there is nothing to keep.
    let is_empty = series.iter().all(|part| part.sensors.values().all(Vec::is_empty));
    let is_known = recordings.iter().all(|recording| !recording.subject.is_empty());
    let verdict = match is_known && !is_empty {
        true => operator.judge(Judged::Trial { trial: name }, usual)?,
        false => {
            operator.ready(Ready::Retake { trial: name })?;
            Verdict::Retake
        }
    };
    let good_repetitions = match verdict {
        Verdict::Keep => operator.repetitions(marked)?.count(),
        Verdict::Retake => 0,
    };
    let notes = operator.words(match verdict {
        Verdict::Keep => Words::Notes,
        Verdict::Retake => Words::WhatWasWrong,
    })?;
    let planned = job.session()?.plan.actions.iter().find(|planned| planned.name == action);
    let usual = planned.map_or("", |planned| planned.props.as_str());
    let props = match verdict {
        Verdict::Keep => operator.words(Words::Props { usual })?,
        Verdict::Retake => String::new(),
    };
    let trial = TrialFile {
        schema: SCHEMA,
        action: action.to_owned(),
        number,
        judged: wall_clock(),
        verdict,
        good_repetitions,
        notes,
        props: if props.is_empty() { usual.to_owned() } else { props },
        closed: series.iter().all(|series| series.whole),
        missed_samples: series.iter().map(|series| series.missed).sum(),
        duration_s: first.duration_s(),
        recordings,
        taps: recorded.taps,
    };
    job.folder.write_new(&format!("trials/{name}.toml"), &trial)?;
    operator.hear(Happening::Settled(Settled::Trial(&trial)));
    Ok(())
}

/// What is in a trial, and what is wrong with it.
fn recorded(name: &str, series: &[SensorSeries], start_ns: u64) -> RecordedTrial {
    let mut faults = Vec::new();
    for part in series {
        if !part.whole {
            faults.push(TrialFault::CutOff);
        }
        if part.missed > 0 {
            faults.push(TrialFault::Missing { samples: part.missed });
        }
        // Where it is known what is missing that says enough.
        faults.extend(hole(part).filter(|_| part.missed == 0));
        faults.extend(silent(part));
        faults.extend(of_worn(part));
    }
    let part = |part: &SensorSeries| TrialPart {
        duration_s: part.duration_s(),
        samples: part.sensors.iter().map(|(name, said)| (name.clone(), said.len())).collect(),
    };
    // The sensors of all subjects: names differ, and the clock is one.
    let all: BTreeMap<String, Vec<SensorMoment>> =
        series.iter().flat_map(|series| series.sensors.clone()).collect();
    RecordedTrial {
        trial: name.to_owned(),
        parts: series.iter().map(part).collect(),
        faults,
        taps: taps(&all, start_ns),
    }
}

/// So long a sensor that speaks again said nothing, s, or there is no hole.
const HOLE_S: f64 = 0.5;

/// The longest time in which a sensor said nothing, and then spoke again.
fn hole(part: &SensorSeries) -> Option<TrialFault> {
    let moments = part.sensors.values().flatten();
    let first_ns = moments.map(|moment| moment.taken_ns).min()?;
    let gaps = part.sensors.iter().flat_map(|(name, said)| {
        let gap = |pair: &[SensorMoment]| pair[1].taken_ns.saturating_sub(pair[0].taken_ns);
        said.windows(2).map(move |pair| (gap(pair), pair[0].taken_ns, name))
    });
    let (gap_ns, from_ns, sensor) = gaps.max()?;
    let (sensor, seconds) = (sensor.clone(), gap_ns as f64 / 1e9);
    let from_s = from_ns.saturating_sub(first_ns) as f64 / 1e9;
    (seconds > HOLE_S).then_some(TrialFault::Hole { sensor, from_s, seconds })
}

/// How often a second it is looked how arms and legs move.
const LOOKED_AT_HZ: f64 = 50.0;

/// Sensors that are on one another's segments, if somebody walks in a recording, and what others say that cannot be.
fn of_worn(part: &SensorSeries) -> Vec<TrialFault> {
    let metadata = part.start.as_ref().map(|start| &start.metadata);
    let kept = metadata.and_then(|metadata| Kept::parse(metadata.get(BODY_KEY)?).ok());
    let body = metadata.and_then(|metadata| body_of(metadata).ok());
    let (Some(kept), Some(body)) = (kept, body) else { return Vec::new() };
    // What cannot be made angles of is told by whoever makes them.
    let (Ok(motion), Ok(doubted)) =
        (WornMotion::of(part, &kept, body, LOOKED_AT_HZ), doubted::doubted(part, &kept))
    else {
        return Vec::new();
    };
    let found = swaps_in_walk(&motion.poses, &motion.measured, LOOKED_AT_HZ);
    let mut faults: Vec<TrialFault> =
        found.into_iter().map(|what| TrialFault::Swapped { what }).collect();
    if !doubted.is_empty() {
        let seconds = doubted.iter().map(|of| of.to_s - of.from_s).sum();
        faults.push(TrialFault::Doubted { what: doubted::words(&doubted), seconds });
    }
    faults
}

/// Sensors that were worn and say nothing in a recording, or at its end.
fn silent(part: &SensorSeries) -> Vec<TrialFault> {
    let worn = part.start.as_ref().and_then(|start| start.metadata.get(BODY_KEY));
    let worn = worn.and_then(|text| Kept::parse(text).ok());
    let mut found = Vec::new();
    for sensor in worn.iter().flat_map(|kept| &kept.sensors) {
        let sensor = sensor.clone();
        match part.sensors.get(&sensor).and_then(|moments| moments.last()) {
            None => found.push(TrialFault::Unheard { sensor }),
            Some(last) => {
                let seconds = part.last_ns.saturating_sub(last.taken_ns) as f64 / 1e9;
                if !(seconds <= SILENT_S) {
                    found.push(TrialFault::Silent { sensor, seconds });
                }
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_of_which_nothing_came_is_told_once_and_samples_one_after_the_other_are_none() {
        let said = |times_ms: &[u64]| -> Vec<SensorMoment> {
            let moment = |ms: &u64| SensorMoment {
                taken_ns: 1_000_000_000 + ms * 1_000_000,
                rate_rad_s: None,
                acceleration_m_s2: None,
                field_t: None,
                orientation: None,
            };
            times_ms.iter().map(moment).collect()
        };
        let of = |head: &[u64], torso: &[u64]| SensorSeries {
            sensors: BTreeMap::from([("head".into(), said(head)), ("torso".into(), said(torso))]),
            ..SensorSeries::default()
        };
        assert_eq!(hole(&of(&[0, 10, 20, 500], &[5, 15])), None);
        let stood = of(&[0, 10, 2010, 2020], &[5, 15, 5515, 5525]);
        let sensor = "torso".to_owned();
        let told = TrialFault::Hole { sensor, from_s: 0.015, seconds: 5.5 };
        assert!(!told.is_slight());
        assert_eq!(hole(&stood), Some(told));
        assert_eq!(hole(&SensorSeries::default()), None);
    }
}
