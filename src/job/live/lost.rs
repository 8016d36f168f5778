//! WornLimbs whose sensors are lost while a robot follows the rest of a body.

use crate::body::Segment;
use crate::body::worn::Wearing;
use crate::body::worn::calibrate::words as segment_words;
use crate::body::worn::limb::{Hearing, LimbChange, WornLimb, WornLimbs};
use crate::mocap::retarget::RobotModel;
use crate::motion::follow::STALE_S;
use crate::port::patient::PatientClock;
use crate::recording::{Marker, RecordedSource, Recorder, SourceId, SourceKind, SourceRecord};
use crate::sensing::Sensors;
use crate::time::Instant;
use std::sync::Arc;

/// Which limbs of a body rest.
pub struct Lost {
    pub limbs: WornLimbs,
    worn: [bool; 13],
}

impl Lost {
    /// None yet, of a body on which these segments are worn.
    pub fn new(limbs: WornLimbs, worn: &[bool; 13]) -> Self {
        Self { limbs, worn: *worn }
    }

    /// Takes how the sensors are heard at a moment, and what whoever wears them asked for.
    pub fn judge(
        &mut self,
        sensors: &Sensors,
        now: Instant,
        mends: bool,
        agrees: bool,
        dt_s: f64,
    ) -> Vec<(WornLimb, LimbChange)> {
        let heard = sensors.newest().into_iter().map(|(segment, newest)| {
            let silent_s = newest.map_or(f64::INFINITY, |(_, taken)| now.seconds_since(taken));
            let hearing = match silent_s {
                _ if sensors.is_gone(segment) => Hearing::Gone,
                silent_s if silent_s <= STALE_S => Hearing::Speaks,
                silent_s => Hearing::Silent(silent_s),
            };
            (segment, hearing)
        });
        let heard: Vec<_> = heard.collect();
        self.limbs.judge(&heard, mends, agrees, dt_s)
    }

    /// True if nothing that is worn is followed any more.
    pub fn is_all(&self) -> bool {
        let mut worn = Segment::ALL.into_iter().filter(|segment| self.worn[segment.index()]);
        self.limbs.any_rests() && worn.all(|segment| self.limbs.rests(segment))
    }

    /// Joints, of those of each limb, of limbs that rest or are on their way back.
    pub fn careful(&self, wearing: &Wearing, of_limbs: &[Vec<bool>; 5]) -> Vec<bool> {
        let mut careful = Vec::new();
        for (limb, joints) in WornLimb::ALL.into_iter().zip(of_limbs) {
            if self.limbs.is_resting(limb) || wearing.is_on_its_way(limb) {
                careful.resize(joints.len(), false);
                careful.iter_mut().zip(joints).for_each(|(careful, of)| *careful |= of);
            }
        }
        careful
    }

    /// What still rests at the end, a line each.
    pub fn notes(&self) -> impl Iterator<Item = String> {
        let resting = WornLimb::ALL.into_iter().filter(|limb| self.limbs.is_resting(*limb));
        resting.map(|limb| format!("the {} rested at the end: a sensor was lost", limb.words()))
    }
}

/// By joint: true of those that move a limb and nothing else of a body.
pub fn joints(model: &RobotModel, limb: WornLimb) -> Vec<bool> {
    let mut moves = vec![[false; 2]; model.joints.len()];
    for link in &model.links {
        let is_other = WornLimb::of(link.segment) != Some(limb);
        let chain = std::iter::successors(Some(link.joint), |at| model.joints[*at].parent);
        chain.for_each(|joint| moves[joint][usize::from(is_other)] = true);
    }
    moves.into_iter().map(|[own, other]| own && !other).collect()
}

/// What becomes of a limb, in words.
pub fn words(limb: WornLimb, change: LimbChange) -> String {
    let name = limb.words();
    match change {
        LimbChange::Rests(segment) => format!(
            "the sensor on the {} is lost: the {name} goes to rest, the others are followed",
            segment_words(segment)
        ),
        LimbChange::Speaks => format!(
            "all sensors of the {name} speak again; it rests until their headings are mended: stand in N pose and press r"
        ),
        LimbChange::Mended => {
            format!("the {name} can be followed again, slowly: press g if that is right")
        }
        LimbChange::Followed => format!("the {name} is followed again, slowly"),
        LimbChange::StillLost => format!("the {name} still rests: not all its sensors speak"),
        LimbChange::NotMended => {
            format!("the {name} still rests: first stand in N pose and press r, then g")
        }
    }
}

/// LostMarks in a recording, if there is one.
pub struct LostMarks {
    recorder: Option<Arc<Recorder>>,
    patience: Option<PatientClock>,
    source: Option<SourceId>,
}

impl LostMarks {
    /// Of moments of the robot's clock, if that is a patient one.
    pub fn of(recorder: Option<Arc<Recorder>>, patience: Option<PatientClock>) -> Self {
        Self { recorder, patience, source: None }
    }

    /// Sets a mark. A recording without marks has no channel for them.
    pub fn take(&mut self, at: Instant, text: String) {
        let Some(recorder) = &self.recorder else { return };
        let source = *self.source.get_or_insert_with(|| {
            recorder.add_source(RecordedSource {
                name: "marks".to_owned(),
                metadata: Default::default(),
                kind: SourceKind::Marks,
            })
        });
        let at = self.patience.as_ref().map_or(at, |clock| clock.to_system(at));
        recorder.take_record(source, SourceRecord::Mark(Marker { at, text }));
    }
}
