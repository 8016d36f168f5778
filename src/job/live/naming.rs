//! What a body that is followed does, named as it happens.

use crate::body::root::StandingRoot;
use crate::body::{BodyFigure, JointAngles, Proportions, SegmentPose};
use crate::error::Error;
use crate::job::recognise::{self, EquationReading, Found};
use crate::job::recognised::{RecognisedAction, RecognitionEvent, event, recognised};
use crate::recognise::machine::ActionEvent;
use crate::recognise::model::ActionModel;
use crate::recognise::points::{Lengths, Points};
use crate::recognise::stream::{LONGEST_GAP_S, Recogniser};
use crate::recording::{RecordedSource, Recorder, SourceId, SourceKind, SourceRecord};
use crate::time::Instant;
use glam::DQuat;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::Sender;

/// Stature of a body nobody measured, m: thresholds are in its limbs, and angles do not depend on it.
const STATURE_M: f64 = 1.75;
/// So many actions are kept for the report; all are told and recorded.
const MOST_KEPT: usize = 10_000;

/// Most poses that are kept for a page: half an hour, 50 times a second.
const MOST_POSES: usize = 90_000;

/// How what is done is named.
#[derive(Clone, Debug, PartialEq)]
pub struct HowNamed {
    /// Folder of models in place of the shipped ones.
    pub models: Option<PathBuf>,
    /// How the paper's equations are read.
    pub equations: EquationReading,
    /// Everything takes so many times as long as where a person does it.
    pub slowed: f64,
    /// Poses are kept, for a page.
    pub keeps_poses: bool,
}

/// What is said while somebody moves, by a thread that may wait.
pub enum LiveWord {
    /// Something to be read.
    Words(String),
    /// The same, and a mark in the recording of when it was so.
    Marked(Instant, String),
    /// Something that was recognised.
    Recognised(RecognitionEvent),
    /// What the body does.
    Posed(Box<PosedNow>),
}

/// A body that wears sensors, as it is now.
pub struct PosedNow {
    /// The pose.
    pub pose: SegmentPose,
    /// By segment, how its sensor is turned.
    pub sensors: [Option<DQuat>; 13],
    /// The angles of its joints.
    pub angles: JointAngles,
    /// How long ago the oldest of its sensors was read, s.
    pub age_s: f64,
}

/// What was named of a body that is no longer heard.
pub struct NamedBody {
    /// What was found.
    pub found: Found,
    /// The poses, s from when it was first looked at, at most [`MOST_POSES`] of them.
    pub poses: Vec<(f64, SegmentPose)>,
    /// Which segments were known at any time.
    pub seen: [bool; 13],
    /// When it was seen last, s.
    pub last_s: f64,
}

/// Names what a body does, from moment to moment.
pub struct Naming {
    recogniser: Recogniser,
    models: Vec<ActionModel>,
    body: Proportions,
    root: StandingRoot,
    slowed: f64,
    before_s: Option<f64>,
    before: Instant,
    channel: Option<(Arc<Recorder>, SourceId)>,
    done: Vec<RecognisedAction>,
    poses: Option<Vec<(f64, SegmentPose)>>,
    seen: [bool; 13],
}

impl Naming {
    /// For a body of which nothing was seen yet. What happens is written to the recording, if there is one:
    /// `/lines/actions`, a line of JSON for each event.
    ///
    /// # Errors
    /// Models that cannot be read.
    pub fn new(how: &HowNamed, recorder: Option<Arc<Recorder>>) -> Result<Self, Error> {
        let models = recognise::models(how.models.as_deref())?;
        // Thresholds of models are in limbs of this figure.
        let body = Proportions::of_figure(BodyFigure::DrillisContini, STATURE_M)?;
        let lengths = Lengths::of(&body);
        let channel = recorder.map(|recorder| {
            let source = recorder.add_source(RecordedSource {
                name: "actions".to_owned(),
                metadata: Default::default(),
                kind: SourceKind::Lines,
            });
            (recorder, source)
        });
        Ok(Self {
            recogniser: Recogniser::new(models.clone(), lengths, how.equations, None),
            models,
            // How a pelvis moves over feet depends on how wide hips are: that is of people as they are measured.
            root: StandingRoot::new(Proportions::of_stature(STATURE_M)?),
            body,
            slowed: how.slowed,
            before_s: None,
            before: Instant::ZERO,
            channel,
            done: Vec::new(),
            poses: how.keeps_poses.then(Vec::new),
            seen: [false; 13],
        })
    }

    /// The body as it was at this moment, `at_s` after it was first looked at, and which of its segments are known then;
    /// what happens is told, and `done` hears of what is done by now.
    pub fn hear(
        &mut self,
        pose: &SegmentPose,
        known: &[bool; 13],
        now: Instant,
        at_s: f64,
        tell: &Sender<LiveWord>,
        mut done: impl FnMut(&RecognisedAction),
    ) {
        let dt_s = self.before_s.map_or(0.0, |before_s| at_s - before_s);
        if self.before_s.is_some() && !(dt_s > 0.0) {
            return;
        }
        (self.before_s, self.before) = (Some(at_s), now);
        if dt_s / self.slowed > LONGEST_GAP_S {
            let words =
                format!("nothing was seen for {dt_s:.1} s: what was done then is not named");
            let _ = tell.send(LiveWord::Words(words));
        }
        let pose = SegmentPose { root_m: self.root.next(pose, dt_s), ..pose.clone() };
        for (seen, known) in self.seen.iter_mut().zip(known) {
            *seen |= known;
        }
        let points = Points::of(&self.body, &pose, known);
        if let Some(poses) = self.poses.as_mut().filter(|poses| poses.len() < MOST_POSES) {
            poses.push((at_s, pose));
        }
        // The machines count from their first frame, as fast as a person does it.
        let dt_s = dt_s / self.slowed;
        let began_s = at_s - (self.recogniser.time_s() + dt_s) * self.slowed;
        let Self { recogniser, models, channel, done: kept, slowed, .. } = self;
        let mut taken = Taken { models, began_s, slowed: *slowed, channel, now, tell, kept };
        recogniser.next(&points, dt_s, |index, known_s, what| {
            taken.take(index, known_s, what, &mut done);
        });
    }

    /// The body is no longer heard: what is over with that is told, too.
    pub fn finish(mut self, tell: &Sender<LiveWord>) -> NamedBody {
        let last_s = self.before_s.unwrap_or(0.0);
        let began_s = last_s - self.recogniser.time_s() * self.slowed;
        let Self { recogniser, models, channel, done: kept, slowed, before: now, .. } = &mut self;
        let now = *now;
        let mut taken = Taken { models, began_s, slowed: *slowed, channel, now, tell, kept };
        recogniser.finish(|index, known_s, what| taken.take(index, known_s, what, &mut |_| ()));
        NamedBody {
            found: Found::of(&self.recogniser, None, self.done),
            poses: self.poses.unwrap_or_default(),
            seen: self.seen,
            last_s,
        }
    }
}

/// Where goes what the machines say of one frame.
struct Taken<'a> {
    models: &'a [ActionModel],
    began_s: f64,
    slowed: f64,
    channel: &'a Option<(Arc<Recorder>, SourceId)>,
    now: Instant,
    tell: &'a Sender<LiveWord>,
    kept: &'a mut Vec<RecognisedAction>,
}

impl Taken<'_> {
    fn take(
        &mut self,
        index: usize,
        known_s: f64,
        what: ActionEvent,
        done: &mut impl FnMut(&RecognisedAction),
    ) {
        let (began_s, slowed) = (self.began_s, self.slowed);
        let own = |time_s: f64| began_s + time_s * slowed;
        let model = &self.models[index];
        let event = event(model, known_s, &what).timed(own);
        if let Some((recorder, source)) = self.channel
            && let Ok(line) = serde_json::to_string(&event)
        {
            recorder.take_record(*source, SourceRecord::Line(self.now, line));
        }
        // Nobody listens any more only at the very end.
        let _ = self.tell.send(LiveWord::Recognised(event));
        if let ActionEvent::Done { span, phases } = what {
            let action = recognised(model, known_s, span, &phases).timed(own);
            done(&action);
            if self.kept.len() < MOST_KEPT {
                self.kept.push(action);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::action::vocabulary;
    use crate::recognise::model::BodySide;
    use std::sync::mpsc::channel;

    fn how() -> HowNamed {
        HowNamed {
            models: None,
            equations: EquationReading::Repaired,
            slowed: 1.0,
            keeps_poses: false,
        }
    }

    #[test]
    fn every_stride_of_somebody_whose_place_is_not_known_is_named_on_its_side() {
        let body = Proportions::of_stature(1.6).expect("a body");
        let walk =
            vocabulary::find("walk").and_then(|walk| walk.perform_rounds(5)).expect("a walk");
        let poses = walk.poses(&body, 60.0).expect("poses");
        let mut naming = Naming::new(&how(), None).expect("models");
        let (tell, _told) = channel();
        for (n, pose) in poses.iter().enumerate() {
            let pose = SegmentPose { root_m: glam::DVec3::ZERO, ..pose.clone() };
            let now = Instant::from_nanos(n as u64);
            naming.hear(&pose, &[true; 13], now, n as f64 / 60.0, &tell, |_| ());
        }
        let actions = naming.finish(&tell).found.events;
        // Five rounds of two strides, the last of them half a one onto both feet.
        assert!(actions.len() >= 10, "{actions:?}");
        for (n, action) in actions.iter().enumerate() {
            let side = Some([BodySide::Left, BodySide::Right][n % 2]);
            assert_eq!((action.action.as_str(), action.side), ("walk", side), "{n}");
        }
    }

    #[test]
    fn what_somebody_does_whose_place_is_not_known_is_named_with_the_times_of_the_body() {
        let body = Proportions::of_stature(1.7).expect("a body");
        let bow = vocabulary::find("bow").and_then(|bow| bow.perform()).expect("a bow");
        let poses = bow.poses(&body, 60.0).expect("poses");
        let mut naming = Naming::new(&how(), None).expect("models");
        let (tell, told) = channel();
        let mut heard = Vec::new();
        for (n, pose) in poses.iter().enumerate() {
            let pose = SegmentPose { root_m: glam::DVec3::ZERO, ..pose.clone() };
            // Heard late, and one moment twice.
            let at_s = 7.0 + n as f64 / 60.0;
            for _ in 0..1 + usize::from(n == 20) {
                let done = |action: &RecognisedAction| heard.push(action.words());
                naming.hear(&pose, &[true; 13], Instant::from_nanos(n as u64), at_s, &tell, done);
            }
        }
        let actions = naming.finish(&tell).found.events;
        drop(tell);
        let names: Vec<&str> = actions.iter().map(|of| of.action.as_str()).collect();
        assert_eq!(names, ["bow"]);
        let end_s = 7.0 + poses.len() as f64 / 60.0;
        assert!(actions[0].start_s > 7.0 && actions[0].recognised_at_s < end_s, "{actions:?}");
        let words = told.iter().filter_map(|told| match told {
            LiveWord::Words(words) | LiveWord::Marked(_, words) => Some(words),
            LiveWord::Recognised(event) => event.words_of_done(),
            LiveWord::Posed(_) => None,
        });
        assert_eq!(words.collect::<Vec<_>>(), [actions[0].words()]);
        assert_eq!(heard, [actions[0].words()]);
    }
}
