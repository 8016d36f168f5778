//! What somebody who wears sensors does, or a robot by its servos, named as it happens.

use super::live::naming::{HowNamed, LiveWord, NamedBody, Naming};
use super::live::{self, LiveOrder};
use super::recognise::{RecogniseOrder, RecogniseReport, concluded, slowed_by};
use super::source::Source as SourceReport;
use super::source::recorded::SeenRobot;
use super::taught::refuse_who_only_obeys;
use super::{Event, Observer};
use crate::body::{Segment, SegmentPose, segment_name};
use crate::capture::Mode;
use crate::error::{Error, ErrorKind};
use crate::mocap::anatomy::Capture;
use crate::recording::SampleEncoding;
use crate::rig::{Address, Connection, calibrated, connect};
use crate::robot::preflight::same_servos;
use crate::sensing::{Person, Plan, Source, What};
use crate::time::Duration;
use std::path::PathBuf;
use std::sync::mpsc::channel;

mod servos;

use servos::{HeardRobot, listen};

/// Frames per second of labels and pages of what was heard live.
const RATE_HZ: f64 = 50.0;
/// Stature of a body nobody measured, m.
const STATURE_M: f64 = 1.75;

/// Whom to listen to, and what of it is written.
#[derive(Clone, Debug)]
pub struct RecogniseLiveOrder {
    /// By which models, what is written. The motion is what is listened to, in a line.
    pub what: RecogniseOrder,
    /// Sensors as `live` takes them, or a robot: `servos:ROBOT@BUS`.
    pub sources: Vec<String>,
    /// Which segment wears which sensor: `SEGMENT=SENSOR`, or files of those.
    pub wear: Vec<String>,
    /// How the body is calibrated.
    pub plan: Plan,
    /// Calibration of the body: taken up if the file is there, else made and kept there.
    pub body_calibration: Option<PathBuf>,
    /// Make it anew, and replace the file.
    pub recalibrate: bool,
    /// Which sensors headings are told from.
    pub mode: Mode,
    /// End after this time; `None`: when the observer wants to.
    pub time: Option<Duration>,
}

/// True if this is heard live: a source, not a motion that is read.
#[must_use]
pub fn is_source(text: &str) -> bool {
    let rest = match text.split_once('=') {
        Some((name, rest)) if !name.contains(['/', '.', ':', '@']) => rest,
        _ => text,
    };
    let begins =
        |kind: &str| rest.strip_prefix(kind).is_some_and(|after| after.starts_with([':', '@']));
    rest.starts_with("replay:") || ["imu", "servos", "lines"].into_iter().any(begins)
}

/// Listens until the time is over, the observer wants to stop or a source is gone, and tells the observer what is recognised
/// meanwhile. Nothing is written to a robot. What was found is written down however it ends. `person` wears the sensors, or
/// speaks for whoever does.
///
/// # Errors
/// Sources that cannot be opened or heard together, models that cannot be read, a person who stops before the sensors are
/// calibrated, a page or a table that cannot be written.
pub fn recognise_live(
    order: &RecogniseLiveOrder,
    observer: &dyn Observer,
    person: &dyn Person,
) -> Result<RecogniseReport, Error> {
    let how = HowNamed {
        models: order.what.models.clone(),
        equations: order.what.equations,
        slowed: slowed_by(order.what.slowed)?,
        keeps_poses: order.what.html.is_some(),
    };
    // Models that cannot be read are said before anybody stands still for a calibration.
    super::recognise::models(how.models.as_deref())?;
    match order.sources.iter().find(|text| is_robot(text)) {
        Some(text) if order.sources.len() > 1 || !order.wear.is_empty() => {
            Err(Error::new("one body at a time: a robot is heard alone").at(text.clone()))
        }
        Some(text) => of_servos(order, text, how, observer),
        None => of_wearer(order, how, observer, person),
    }
}

fn is_robot(text: &str) -> bool {
    matches!(text.parse(), Ok(Source { what: What::Servos { .. }, .. }))
}

fn of_wearer(
    order: &RecogniseLiveOrder,
    how: HowNamed,
    observer: &dyn Observer,
    person: &dyn Person,
) -> Result<RecogniseReport, Error> {
    let follow = LiveOrder {
        samples: SampleEncoding::default(),
        from: order.sources.clone(),
        wear: order.wear.clone(),
        robot: None,
        buses: Vec::new(),
        calibration: None,
        seed: 0,
        rate_hz: None,
        time: order.time,
        plan: order.plan.clone(),
        body_calibration: order.body_calibration.clone(),
        recalibrate: order.recalibrate,
        mode: order.mode,
        record: None,
        replace: order.what.replace,
        accept_firmware: false,
        hangs: false,
        physics: false,
        balances: false,
        faults: None,
        dry_run: true,
        recognise: true,
        models: order.what.models.clone(),
        when: Vec::new(),
        keep_going: false,
        despite_swaps: false,
    };
    let (heard, named) = live::named(&follow, how, observer, person)?;
    let Some(named) = named else {
        return Err(Error::of(ErrorKind::Stopped, "stopped before the sensors were calibrated"));
    };
    let worn = heard.worn;
    let unknown = Segment::ALL.into_iter().filter(|segment| !worn[segment.index()]);
    let unknown: Vec<&str> = unknown.map(segment_name).collect();
    let mut notes = heard.run.notes;
    if !unknown.is_empty() {
        notes.push(format!("not worn, and therefore unknown: {}", unknown.join(", ")));
    }
    let mut report = written(order, "worn", named, notes, heard.run.stop_reason)?;
    report.sensors = heard.sensors;
    Ok(report)
}

fn of_servos(
    order: &RecogniseLiveOrder,
    text: &str,
    how: HowNamed,
    observer: &dyn Observer,
) -> Result<RecogniseReport, Error> {
    let Source { what: What::Servos { robot, addresses }, .. } = text.parse()? else {
        return Err(Error::new("this is no robot").at(text.to_owned()));
    };
    let (seen, mut connection) = opened(&robot, &addresses, observer)?;
    let naming = Naming::new(&how, None)?;
    same_servos(&mut connection.link)?;
    let (tell, told) = channel();
    let is_over = || observer.wants_to_stop();
    let HeardRobot { named, lost } = std::thread::scope(|scope| {
        // Whoever reads servos may not wait for a terminal.
        scope.spawn(move || {
            told.into_iter().for_each(|told| match told {
                LiveWord::Words(text) | LiveWord::Marked(_, text) => {
                    observer.hear(Event::Note(&text));
                }
                LiveWord::Recognised(event) => observer.hear(Event::Recognised(&event)),
                LiveWord::Posed(_) => {}
            });
        });
        listen(&mut connection.link, &seen, naming, tell, order.time, &is_over)
    });
    written(order, "servos", named, seen.notes, lost)
}

/// A robot with its lines open, of which nothing but reads is asked.
fn opened(
    robot: &str,
    addresses: &[Address],
    observer: &dyn Observer,
) -> Result<(SeenRobot, Connection), Error> {
    let (robot, calibration) = calibrated(robot, addresses, None)?;
    let seen = SeenRobot::of(&robot)?;
    let connection = connect(robot, addresses, 0)?;
    if !connection.real_time {
        return Err(Error::new("nothing moves a virtual robot in virtual time meanwhile")
            .at("servos:...@sim")
            .remedy(
                "start `gaitway simulate` in another terminal, or name a recording of what it plays",
            ));
    }
    refuse_who_only_obeys(&connection)?;
    if let Some(path) = calibration {
        observer.hear(Event::Note(&format!("calibration {}", path.display())));
    }
    Ok((seen, connection))
}

/// Writes down what was heard, however that ended.
fn written(
    order: &RecogniseLiveOrder,
    format: &str,
    named: NamedBody,
    notes: Vec<String>,
    lost: Option<String>,
) -> Result<RecogniseReport, Error> {
    let NamedBody { found, poses, seen, last_s } = named;
    let frames = (last_s * RATE_HZ) as usize + 1;
    let source = SourceReport {
        format: format.to_owned(),
        frames,
        rate_hz: RATE_HZ,
        duration_s: last_s,
        ..SourceReport::default()
    };
    let capture = evenly(&poses).map(|poses| Capture {
        rate_hz: RATE_HZ,
        poses,
        tracked: seen,
        stature_m: STATURE_M,
        is_made: false,
        notes: notes.clone(),
    });
    let mut report = concluded(&order.what, capture.as_ref(), found, source)?;
    report.notes = notes;
    if let Some(path) = order.what.html.as_ref().filter(|_| capture.is_none()) {
        report.html = None;
        report.notes.push(format!("{}: there is nothing to show", path.display()));
    }
    if lost.is_some() {
        (report.outcome, report.stop_reason) = ("stopped", lost);
    }
    Ok(report)
}

/// Poses at an even rate from time zero on: at each moment the last that was heard.
fn evenly(poses: &[(f64, SegmentPose)]) -> Option<Vec<SegmentPose>> {
    let (last_s, _) = poses.last()?;
    let count = (last_s * RATE_HZ) as usize + 1;
    let at = |n: usize| {
        let heard = poses.partition_point(|(at_s, _)| *at_s <= n as f64 / RATE_HZ + 1e-9);
        poses[heard.saturating_sub(1)].1.clone()
    };
    Some((0..count).map(at).collect())
}

#[cfg(test)]
mod tests;
