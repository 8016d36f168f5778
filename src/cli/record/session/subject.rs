//! Subject calibration: how sensors sit on a body, by the same guide as for `live`.

use super::Job;
use super::console::Ended;
use crate::body::segment_name;
use crate::body::worn::Movement;
use crate::body::worn::check::T_POSE_FAIL_RAD;
use crate::body::worn::kept::Kept;
use crate::error::Error;
use crate::sensing::MonotonicClock;
use crate::sensing::{self, Feed, Guide, Guided, Place, Plan, Sensors};
use crate::session::files::{BodyCheck, SCHEMA};
use crate::session::wearers::worn_by;
use glam::DVec3;
use std::collections::BTreeMap;

/// Leads a subject through N pose, T pose and the movements that turn what is worn, and writes down
/// what was found.
pub fn calibrate(job: &mut Job, id: &str) -> Result<(), Ended> {
    let places = job.places(id)?;
    let worn: Vec<&str> = places.iter().map(|place| segment_name(place.segment)).collect();
    job.console.say(&format!(
        "\nCalibration of subject {id}. Put the sensors on: {}; X forward where nothing else is \
         known. Face the same way throughout.",
        worn.join(", ")
    ));
    job.console.choose("Are they on?", &[("y", "begin")])?;
    let plan = Plan {
        n_pose_after: None,
        t_pose: true,
        moves: Movement::ALL.to_vec(),
        subject: id.to_owned(),
    };
    loop {
        match lead(job, places.clone(), |guide| guide.calibrate(&plan)) {
            Ok(guided) => {
                if settle(job, id, &guided)? {
                    return Ok(());
                }
            }
            Err(Ended::Failed(error)) => {
                job.console.say(&format!("! {error}"));
                job.console.choose("It did not work.", &[("r", "repeat")])?;
            }
            Err(ended) => return Err(ended),
        }
    }
}

/// Judges a calibration and writes it down; true if it may be used.
fn settle(job: &mut Job, id: &str, guided: &Guided) -> Result<bool, Ended> {
    let off = guided.off_t_pose_rad.iter();
    let off: BTreeMap<String, f64> =
        off.map(|(segment, rad)| (segment_name(*segment).to_owned(), *rad)).collect();
    let worst_rad = off.values().copied().reduce(f64::max);
    let mut notes = guided.kept.calibration.notes.clone();
    notes.extend(guided.doubts.iter().cloned());
    match worst_rad {
        Some(rad) => job.console.say(&format!(
            "measured error in T pose: at most {:.1} deg ({:.0} allowed)",
            rad.to_degrees(),
            T_POSE_FAIL_RAD.to_degrees()
        )),
        None => notes.push("not verified: no T pose was seen, or no arm wears a sensor".into()),
    }
    let mut passed = worst_rad.is_none_or(|rad| rad <= T_POSE_FAIL_RAD);
    if !passed || !notes.is_empty() {
        for note in &notes {
            job.console.say(&format!("  {note}"));
        }
        let (keep, again) = (("k", "keep it"), ("r", "repeat (what was measured is kept)"));
        let choices = if passed { [keep, again] } else { [again, keep] };
        passed = job.console.choose("Keep this calibration?", &choices)? == "k";
    }
    let made = job.now();
    let check = BodyCheck {
        schema: SCHEMA,
        subject: id.to_owned(),
        made,
        expires: made.plus_hours(job.session()?.plan.body_hours),
        passed,
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
    if passed {
        job.console.say(&format!("written: {kept}; it holds until {}", check.expires));
    }
    Ok(passed)
}

/// Lets a subject stand in N pose: headings found anew, because they drift, and begin elsewhere
/// after the sensors or this program were switched off.
pub fn face_forward(job: &Job, id: &str) -> Result<Kept, Ended> {
    let body = job.progress.bodies.get(id);
    let body = body.ok_or_else(|| Error::new(format!("subject {id} is not calibrated")))?;
    let (known, plan) = (body.kept.clone(), Plan { subject: id.to_owned(), ..Plan::default() });
    let places = job.places(id)?;
    job.console.say(&format!("subject {id}:"));
    Ok(lead(job, places, |guide| guide.take_up(known.clone(), &plan))?.kept)
}

/// Lets the guide lead whoever wears these sensors.
fn lead(
    job: &Job,
    places: Vec<Place>,
    what: impl FnOnce(&mut Guide) -> Result<Guided, sensing::Ended>,
) -> Result<Guided, Ended> {
    let mut sensors = Sensors::new(places, Feed::Live(job.hub.listen()));
    let operator = job.console.operator();
    let mut guide = Guide::new(&mut sensors, &MonotonicClock, &operator);
    let led = guide.wait_for_sensors().and_then(|()| what(&mut guide));
    job.hub.forget();
    led.map_err(|ended| match ended {
        sensing::Ended::Failed(error) => Ended::Failed(error),
        // A signal tells more than that there was one.
        sensing::Ended::Stopped => job.console.check().err().unwrap_or(Ended::Stopped),
    })
}

impl Job<'_> {
    /// What a subject wears.
    pub fn places(&self, id: &str) -> Result<Vec<Place>, Error> {
        let subjects = &self.session()?.subjects;
        let index = subjects.iter().position(|known| known == id).unwrap_or(0);
        let names = self.names();
        let worn = worn_by(index, names.iter().map(String::as_str));
        if worn.is_empty() {
            return Err(Error::new(format!("subject {id} wears no sensor"))
                .got(names.join(", "))
                .remedy(
                    "name sources like segments: torso=imu:..., of the second 2-torso=imu:...",
                ));
        }
        let place = |(name, segment): (&str, _)| Place {
            segment,
            sensor: name.to_owned(),
            forward: Some(DVec3::X),
        };
        Ok(worn.into_iter().map(place).collect())
    }
}
