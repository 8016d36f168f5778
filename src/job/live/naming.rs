//! What a body that is followed does, named as it happens.

use crate::body::root::StandingRoot;
use crate::body::{BodyFigure, Proportions, SegmentPose};
use crate::error::Error;
use crate::job::recognise::{self, RecognisedAction};
use crate::recognise::machine::ActionEvent;
use crate::recognise::model::ActionModel;
use crate::recognise::points::{Lengths, Points};
use crate::recognise::posture::EquationReading;
use crate::recognise::stream::{LONGEST_GAP_S, Recogniser};
use crate::recording::{RecordedSource, Recorder, SourceId, SourceKind, SourceRecord};
use crate::time::Instant;
use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::Sender;

/// Stature of a body nobody measured, m: thresholds are in its limbs, and angles do not depend on it.
const STATURE_M: f64 = 1.75;
/// So many actions are kept for the report; all are told and recorded.
const MOST_KEPT: usize = 10_000;

/// Names what a body does, from moment to moment.
pub struct Naming {
    recogniser: Recogniser,
    models: Vec<ActionModel>,
    body: Proportions,
    root: StandingRoot,
    worn: [bool; 13],
    before_s: Option<f64>,
    channel: Option<(Arc<Recorder>, SourceId)>,
    told: Vec<RecognisedAction>,
}

impl Naming {
    /// For a body that wears these sensors, by the models of a folder or those that ship with gaitway. What happens is
    /// written to the recording, if there is one: `/lines/actions`, a line of JSON for each event.
    ///
    /// # Errors
    /// Models that cannot be read.
    pub fn new(
        folder: Option<&Path>,
        worn: [bool; 13],
        recorder: Option<Arc<Recorder>>,
    ) -> Result<Self, Error> {
        let models = recognise::models(folder)?;
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
            recogniser: Recogniser::new(models.clone(), lengths, EquationReading::Repaired, None),
            models,
            // How a pelvis moves over feet depends on how wide hips are: that is of people as they are measured.
            root: StandingRoot::new(Proportions::of_stature(STATURE_M)?),
            body,
            worn,
            before_s: None,
            channel,
            told: Vec::new(),
        })
    }

    /// The body as it was at this moment, `at_s` after it was first looked at; what is done by now is told in words,
    /// and `done` hears of it.
    pub fn hear(
        &mut self,
        pose: &SegmentPose,
        now: Instant,
        at_s: f64,
        tell: &Sender<String>,
        mut done: impl FnMut(&RecognisedAction),
    ) {
        let dt_s = self.before_s.map_or(0.0, |before_s| at_s - before_s);
        if self.before_s.is_some() && !(dt_s > 0.0) {
            return;
        }
        self.before_s = Some(at_s);
        if dt_s > LONGEST_GAP_S {
            let _ = tell
                .send(format!("nothing was seen for {dt_s:.1} s: what was done then is not named"));
        }
        let pose = SegmentPose { root_m: self.root.next(pose, dt_s), ..pose.clone() };
        let points = Points::of(&self.body, &pose, &self.worn);
        let Self { recogniser, models, channel, told, .. } = self;
        // The machines count from their first frame.
        let began_s = at_s - recogniser.time_s() - dt_s;
        let own = |time_s: f64| began_s + time_s;
        recogniser.next(&points, dt_s, |index, known_s, what| {
            let model = &models[index];
            let event = recognise::event(model, known_s, &what).timed(own);
            if let Some((recorder, source)) = channel
                && let Ok(line) = serde_json::to_string(&event)
            {
                recorder.take_record(*source, SourceRecord::Line(now, line));
            }
            if let ActionEvent::Done { span, phases } = what {
                let action = recognise::recognised(model, known_s, span, &phases).timed(own);
                // Nobody listens any more only at the very end.
                let _ = tell.send(action.words());
                done(&action);
                if told.len() < MOST_KEPT {
                    told.push(action);
                }
            }
        });
    }

    /// What was done.
    pub fn into_actions(self) -> Vec<RecognisedAction> {
        self.told
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::action::vocabulary;
    use crate::recognise::model::BodySide;
    use std::sync::mpsc::channel;

    #[test]
    fn every_stride_of_somebody_whose_place_is_not_known_is_named_on_its_side() {
        let body = Proportions::of_stature(1.6).expect("a body");
        let walk =
            vocabulary::find("walk").and_then(|walk| walk.perform_rounds(5)).expect("a walk");
        let poses = walk.poses(&body, 60.0).expect("poses");
        let mut naming = Naming::new(None, [true; 13], None).expect("models");
        let (tell, _told) = channel();
        for (n, pose) in poses.iter().enumerate() {
            let pose = SegmentPose { root_m: glam::DVec3::ZERO, ..pose.clone() };
            naming.hear(&pose, Instant::from_nanos(n as u64), n as f64 / 60.0, &tell, |_| ());
        }
        let actions = naming.into_actions();
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
        let mut naming = Naming::new(None, [true; 13], None).expect("models");
        let (tell, told) = channel();
        let mut heard = Vec::new();
        for (n, pose) in poses.iter().enumerate() {
            let pose = SegmentPose { root_m: glam::DVec3::ZERO, ..pose.clone() };
            // Heard late, and one moment twice.
            let at_s = 7.0 + n as f64 / 60.0;
            for _ in 0..1 + usize::from(n == 20) {
                let done = |action: &RecognisedAction| heard.push(action.words());
                naming.hear(&pose, Instant::from_nanos(n as u64), at_s, &tell, done);
            }
        }
        drop(tell);
        let actions = naming.into_actions();
        let names: Vec<&str> = actions.iter().map(|of| of.action.as_str()).collect();
        assert_eq!(names, ["bow"]);
        let end_s = 7.0 + poses.len() as f64 / 60.0;
        assert!(actions[0].start_s > 7.0 && actions[0].recognised_at_s < end_s, "{actions:?}");
        assert_eq!(told.iter().collect::<Vec<_>>(), [actions[0].words()]);
        assert_eq!(heard, [actions[0].words()]);
    }
}
