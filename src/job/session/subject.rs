//! Subject calibration: how sensors sit on a body, by the same guide as for `live`.

use super::Job;
use super::happening::{Happening, Settled};
use super::operator::{Judged, Ready};
use crate::body::worn::Movement;
use crate::body::worn::check::T_POSE_FAIL_RAD;
use crate::body::worn::kept::Kept;
use crate::body::worn::strap::StrapDirection;
use crate::body::{Segment, segment_name};
use crate::error::Error;
use crate::sensing::{
    Ended, Feed, Guide, Guided, MonotonicClock, Place, Plan, Sensors, wall_clock,
};
use crate::session::Verdict;
use crate::session::files::{BodyCheck, SCHEMA};
use crate::session::wearers::{wearer, worn_by};
use glam::DVec3;
use std::collections::BTreeMap;

/// Leads a subject through N pose, T pose and the movements that turn what is worn, and writes down
/// what was found.
pub(super) fn calibrate(job: &mut Job, id: &str) -> Result<(), Ended> {
    let places = places(job, id)?;
    let segments: Vec<Segment> = places.iter().map(|place| place.segment).collect();
    job.operator.ready(Ready::Worn { subject: id, segments: &segments })?;
    let plan = Plan {
        n_pose_after: None,
        t_pose: true,
        moves: Movement::ALL.to_vec(),
        subject: id.to_owned(),
    };
    job.looking
        .forget(places.first().and_then(|place| wearer(&place.sensor)).map_or(0, |(by, _)| by));
    loop {
        match lead(job, places.clone(), |guide| guide.calibrate(&plan)) {
            Ok(guided) => {
                if settle(job, id, &guided)? == Verdict::Keep {
                    return Ok(());
                }
            }
            Err(Ended::Failed(error)) => job.operator.ready(Ready::Again { error: &error })?,
            Err(ended) => return Err(ended),
        }
    }
}

/// Judges a calibration and writes it down; one that is to be kept may be used.
fn settle(job: &mut Job, id: &str, guided: &Guided) -> Result<Verdict, Ended> {
    let operator = job.operator;
    let off = guided.off_t_pose_rad.iter();
    let off: BTreeMap<String, f64> =
        off.map(|(segment, rad)| (segment_name(*segment).to_owned(), *rad)).collect();
    let worst_rad = off.values().copied().reduce(f64::max);
    let mut notes = guided.kept.calibration.notes.clone();
    notes.extend(guided.doubts.iter().cloned());
    match worst_rad {
        Some(worst_rad) => operator.hear(Happening::InTPose { worst_rad }),
        None => notes.push("not verified: no T pose was seen, or no arm wears a sensor".into()),
    }
    let is_good = worst_rad.is_none_or(|rad| rad <= T_POSE_FAIL_RAD);
    // Whose sensors seem to be swapped is calibrated anew, unless the operator insists.
    let usual = match is_good && guided.doubts.is_empty() {
        true => Verdict::Keep,
        false => Verdict::Retake,
    };
    let verdict = match is_good && notes.is_empty() {
        true => Verdict::Keep,
        false => operator.judge(Judged::Calibration { notes: &notes }, usual)?,
    };
    let made = wall_clock();
    let check = BodyCheck {
        schema: SCHEMA,
        subject: id.to_owned(),
        made,
        expires: made.plus_hours(job.session()?.plan.body_hours),
        passed: verdict == Verdict::Keep,
        sensors: guided.kept.sensors.len() as u64,
        worst_rad,
        off_t_pose_rad: off,
        notes,
    };
    let name = job.progress.next_attempt(&format!("body-{id}"));
    // The check comes last: without it the other counts for nothing.
    let (kept, judged) =
        (format!("calibration/{name}.toml"), format!("calibration/{name}-check.toml"));
    job.folder.write_new_bytes(&kept, guided.kept.text()?.as_bytes())?;
    job.folder.write_new(&judged, &check)?;
    job.reload()?;
    operator.hear(Happening::Settled(Settled::Body(&check)));
    if check.passed {
        operator.hear(Happening::Written { file: &kept, holds_until: check.expires });
    }
    Ok(verdict)
}

/// Lets a subject stand in N pose: headings found anew, because they drift, and begin elsewhere
/// after the sensors or this program were switched off.
pub(super) fn face_forward(job: &Job, id: &str) -> Result<Kept, Ended> {
    let body = job.progress.bodies.get(id);
    let body = body.ok_or_else(|| Error::new(format!("subject {id} is not calibrated")))?;
    let (known, plan) = (body.kept.clone(), Plan { subject: id.to_owned(), ..Plan::default() });
    let places = places(job, id)?;
    job.operator.hear(Happening::FacingForward { subject: id });
    Ok(lead(job, places, |guide| guide.take_up(known, &plan))?.kept)
}

/// Lets the guide lead whoever wears these sensors.
fn lead(
    job: &Job,
    places: Vec<Place>,
    what: impl FnOnce(&mut Guide) -> Result<Guided, Ended>,
) -> Result<Guided, Ended> {
    let mut sensors = Sensors::new(places, Feed::Live(job.hub.listen()));
    let mut guide = Guide::new(&mut sensors, &MonotonicClock, job.operator.person());
    let led = guide.wait_for_sensors().and_then(|()| what(&mut guide));
    job.hub.forget();
    if let Ok(guided) = &led {
        let known = job.progress.subjects.get(&guided.kept.subject);
        job.looking.wears(&guided.kept, known.and_then(|subject| subject.proportions().ok()));
    }
    led
}

/// What a subject wears.
fn places(job: &Job, id: &str) -> Result<Vec<Place>, Error> {
    let names = job.names();
    let worn = worn_by(job.number_of(id), names.iter().map(String::as_str));
    if worn.is_empty() {
        return Err(Error::new(format!("subject {id} wears no sensor"))
            .got(names.join(", "))
            .remedy("name sources like segments: torso=imu:..., of the second 2-torso=imu:..."));
    }
    let told = &job.session()?.forward;
    let place = |(name, segment): (&str, _)| {
        let forward = told.get(name).map_or(Ok(Some(DVec3::X)), StrapDirection::forward)?;
        Ok(Place { segment, sensor: name.to_owned(), forward })
    };
    worn.into_iter().map(place).collect()
}
