//! All models over one stream of poses of one person.

use super::features::{Extractor, FEATURES, Feature, Noise};
use super::machine::{ActionEvent, ModelMachine, Span};
use super::model::{ActionModel, BodySide};
use super::points::{Lengths, Points};
use super::posture::EquationReading;
use super::waiting::WaitingRoom;
use std::collections::BTreeMap;

/// Of what happened in a longer time without a frame nothing is known, s: what was under way is over, and nothing goes across.
pub const LONGEST_GAP_S: f64 = 0.3;

/// What each model has named last. Several models may show one action, and then name one and the same.
#[derive(Clone, Debug)]
struct Named {
    spans: Vec<Option<Span>>,
    /// The other models that show the same action on the same side.
    twins: Vec<Vec<usize>>,
}

impl Named {
    fn new(models: &[ActionModel]) -> Self {
        let mut by_action: BTreeMap<(&str, Option<BodySide>), Vec<usize>> = BTreeMap::new();
        for (index, model) in models.iter().enumerate() {
            by_action.entry((&model.action, model.side)).or_default().push(index);
        }
        let twins = |model: &ActionModel| by_action[&(model.action.as_str(), model.side)].clone();
        Self { spans: vec![None; models.len()], twins: models.iter().map(twins).collect() }
    }

    /// What becomes of an event of a model: what another has named already (the same action, on the same side, with more
    /// than half of the shorter of both in common) is broken off.
    fn once(&mut self, models: &[ActionModel], index: usize, what: ActionEvent) -> ActionEvent {
        let ActionEvent::Done { span, .. } = &what else { return what };
        let is_named = self.twins[index].iter().any(|other| {
            let Some(named) = self.spans[*other].filter(|_| *other != index) else { return false };
            let common_s = span.end_s.min(named.end_s) - span.start_s.max(named.start_s);
            let shorter_s = (span.end_s - span.start_s).min(named.end_s - named.start_s);
            common_s > shorter_s / 2.0
        });
        if is_named {
            return ActionEvent::BrokenOff { number: models[index].phases.len() };
        }
        self.spans[index] = Some(*span);
        what
    }
}

/// Names what one person does, frame by frame, one frame after it is over. Several persons have one each. An action
/// that several models show is named once.
#[derive(Clone, Debug)]
pub struct Recogniser {
    extractor: Extractor,
    models: Vec<ActionModel>,
    machines: Vec<ModelMachine>,
    waiting: WaitingRoom,
    named: Named,
    seen: [bool; FEATURES],
    time_s: f64,
    has_begun: bool,
}

impl Recogniser {
    /// For a body of these lengths; `noise` is that of its source, if it is known.
    #[must_use]
    pub fn new(
        models: Vec<ActionModel>,
        lengths: Lengths,
        reading: EquationReading,
        noise: Option<Noise>,
    ) -> Self {
        let machines = models.iter().map(|_| ModelMachine::new(reading)).collect();
        Self {
            extractor: Extractor::new(lengths, reading, noise),
            waiting: WaitingRoom::new(&models),
            named: Named::new(&models),
            models,
            machines,
            seen: [false; FEATURES],
            time_s: 0.0,
            has_begun: false,
        }
    }

    /// The time of the last frame, s; the first is at zero.
    #[must_use]
    pub const fn time_s(&self) -> f64 {
        self.time_s
    }

    /// The models, by their index.
    #[must_use]
    pub fn models(&self) -> &[ActionModel] {
        &self.models
    }

    /// The next frame, so long after the last, s; the first is at zero. What happens is told to `tell`: the
    /// model's index, the time, what. Frames need not be as far apart as those before; after more than
    /// [`LONGEST_GAP_S`] a stream begins anew.
    pub fn next(
        &mut self,
        points: &Points,
        dt_s: f64,
        mut tell: impl FnMut(usize, f64, ActionEvent),
    ) {
        if core::mem::replace(&mut self.has_begun, true) {
            if dt_s > LONGEST_GAP_S {
                self.finish(&mut tell);
                self.extractor.interrupt();
            }
            self.time_s += dt_s;
        }
        let time_s = self.time_s;
        let row = self.extractor.next(points, dt_s);
        for (seen, value) in self.seen.iter_mut().zip(&row.values) {
            *seen |= !value.is_nan();
        }
        self.waiting.wake(&row);
        let mut from = 0;
        while let Some(index) = self.waiting.awake_from(from) {
            from = index + 1;
            let (model, machine) = (&self.models[index], &mut self.machines[index]);
            machine.next(model, &row, time_s, &mut |what| {
                tell(index, time_s, self.named.once(&self.models, index, what));
            });
            if machine.is_idle() {
                self.waiting.rest(index, model, &row);
            }
        }
    }

    /// The stream is over.
    pub fn finish(&mut self, mut tell: impl FnMut(usize, f64, ActionEvent)) {
        let time_s = self.time_s;
        for (index, (model, machine)) in self.models.iter().zip(&mut self.machines).enumerate() {
            machine.finish(model, &mut |what| {
                tell(index, time_s, self.named.once(&self.models, index, what));
            });
        }
    }

    /// Models that could not fire so far, because the source has never shown what they need.
    #[must_use]
    pub fn blind(&self) -> Vec<(usize, Vec<Feature>)> {
        let missing = |model: &ActionModel| -> Vec<Feature> {
            model.needs().into_iter().filter(|feature| !self.seen[feature.index()]).collect()
        };
        let all = self.models.iter().enumerate().map(|(index, model)| (index, missing(model)));
        all.filter(|(_, missing)| !missing.is_empty()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::{BodyFigure, Dof, JointAngles, Proportions, Segment};
    use crate::recognise::model::file::{Bands, none_to_mirror, parse};
    use glam::{DQuat, DVec3};

    const RATE_HZ: f64 = 50.0;

    fn body() -> Proportions {
        Proportions::of_figure(BodyFigure::DrillisContini, 1.7).expect("a body")
    }

    /// Somebody who raises the left arm to the side within a second and lets it down again.
    fn arm_raised(tracked: [bool; 13]) -> Vec<Points> {
        let pose = |n: i32| {
            let mut angles = JointAngles::default();
            let up = f64::from(n.min(100 - n).clamp(0, 50)) / 50.0;
            angles[Dof::LeftShoulderAbduction] = 1.5 * up;
            let root_m = DVec3::new(0.0, 0.0, body().root_height_m());
            Points::of(&body(), &angles.to_pose(root_m, DQuat::IDENTITY), &tracked)
        };
        (0..130).map(pose).collect()
    }

    fn raise() -> ActionModel {
        let text = "schema = 1\nname = \"raise-l\"\n\
            [[phase]]\nname = \"up\"\nposture = \"standing\"\nleft_hand = { vertical = \"up 0.5..\" }\n\
            [[phase]]\nname = \"down\"\nleft_hand = { vertical = \"down 0.5..\" }\n";
        parse(text, "raise-l", &Bands::default(), &none_to_mirror).expect("a model")
    }

    fn recogniser() -> Recogniser {
        let model = raise();
        let mut mirrored = model.mirrored();
        mirrored.name = "raise-r".to_owned();
        Recogniser::new(
            vec![model, mirrored],
            Lengths::of(&body()),
            EquationReading::Repaired,
            None,
        )
    }

    #[test]
    fn a_raised_arm_is_named_while_it_moves_and_the_other_is_not() {
        let mut recogniser = recogniser();
        let mut told = Vec::new();
        for points in arm_raised([true; 13]) {
            recogniser.next(&points, 1.0 / RATE_HZ, |model, at_s, what| {
                told.push((model, at_s, what));
            });
        }
        assert!(told.iter().all(|(model, ..)| *model == 0), "{told:?}");
        let kinds: Vec<&str> = told
            .iter()
            .map(|(_, _, what)| match what {
                ActionEvent::Begun { .. } => "begun",
                ActionEvent::Phase { .. } => "phase",
                ActionEvent::Done { .. } => "done",
                ActionEvent::BrokenOff { .. } => "broken off",
            })
            .collect();
        assert_eq!(kinds, ["begun", "phase", "phase", "done"]);
        let ActionEvent::Done { span, .. } = &told[3].2 else { panic!("{told:?}") };
        // Up from 0 to 1 s, down to 2 s: within the time over which velocities are taken.
        assert!(span.start_s < 0.15 && (span.end_s - 2.0).abs() < 0.15, "{span:?}");
        assert!(told[3].1 - span.end_s < 1.5 / RATE_HZ, "one frame later: {told:?}");
        assert!(recogniser.blind().is_empty());
    }

    #[test]
    fn what_two_models_of_one_action_see_is_named_once_and_on_another_side_again() {
        let mut twin = raise();
        twin.name = "raise-too-l".to_owned();
        let mut other = twin.clone();
        other.side = Some(BodySide::Right);
        let lengths = Lengths::of(&body());
        let models = vec![raise(), twin, other];
        let mut recogniser = Recogniser::new(models, lengths, EquationReading::Repaired, None);
        let mut done = Vec::new();
        let mut broken_off = Vec::new();
        for points in arm_raised([true; 13]) {
            recogniser.next(&points, 1.0 / RATE_HZ, |model, _, what| match what {
                ActionEvent::Done { .. } => done.push(model),
                ActionEvent::BrokenOff { .. } => broken_off.push(model),
                _ => {}
            });
        }
        assert_eq!((done, broken_off), (vec![0, 2], vec![1]));
    }

    #[test]
    fn a_source_without_that_arm_makes_a_model_blind_and_silent() {
        let mut tracked = [true; 13];
        tracked[Segment::LeftForearm.index()] = false;
        let mut recogniser = recogniser();
        for points in arm_raised(tracked) {
            recogniser.next(&points, 1.0 / RATE_HZ, |_, _, what| panic!("{what:?}"));
        }
        let blind = recogniser.blind();
        assert_eq!(blind.len(), 1, "{blind:?}");
        assert!(blind[0].1.iter().all(|feature| feature.name() == "left_hand_vertical"));
    }

    #[test]
    fn a_stream_whose_rate_changes_is_named_by_its_times() {
        let mut recogniser = recogniser();
        let mut done = Vec::new();
        let frames = arm_raised([true; 13]);
        let mut last = 0;
        // First every frame, then every third, then two of three.
        for (n, points) in frames.iter().enumerate() {
            if (n > 40 && n < 80 && n % 3 != 0) || (n >= 80 && n % 3 == 0) {
                continue;
            }
            let dt_s = (n - last) as f64 / RATE_HZ;
            last = n;
            recogniser.next(points, dt_s, |model, _, what| {
                if let ActionEvent::Done { span, .. } = what {
                    done.push((model, span));
                }
            });
        }
        assert_eq!(done.len(), 1, "{done:?}");
        let (model, span) = done[0];
        assert!(model == 0 && span.start_s < 0.15 && (span.end_s - 2.0).abs() < 0.15, "{span:?}");
    }

    #[test]
    fn nothing_is_named_across_a_gap_of_which_nothing_is_known() {
        let frames = arm_raised([true; 13]);
        let named = |missing: core::ops::Range<usize>| {
            let (mut recogniser, mut told, mut last) = (recogniser(), Vec::new(), 0);
            for (n, points) in frames.iter().enumerate().filter(|(n, _)| !missing.contains(n)) {
                let dt_s = (n - last) as f64 / RATE_HZ;
                last = n;
                recogniser.next(points, dt_s, |_, _, what| told.push(what));
            }
            let is_done = |what: &ActionEvent| matches!(what, ActionEvent::Done { .. });
            let is_broken = |what: &ActionEvent| matches!(what, ActionEvent::BrokenOff { .. });
            (told.iter().any(is_done), told.iter().any(is_broken))
        };
        // On the way down, 0.18 s and 0.42 s.
        assert_eq!(named(60..68), (true, false));
        assert_eq!(named(60..80), (false, true));
    }

    #[test]
    fn points_that_are_no_numbers_break_nothing_and_name_nothing() {
        let mut recogniser = recogniser();
        for n in 0..200 {
            let lost =
                Points([DVec3::splat(if n % 3 == 0 { f64::NAN } else { f64::INFINITY }); 13]);
            recogniser.next(&lost, 1.0 / RATE_HZ, |_, _, what| panic!("{what:?}"));
        }
        recogniser.finish(|_, _, what| panic!("{what:?}"));
    }

    #[test]
    fn a_stream_that_is_cut_short_tells_what_was_broken_off() {
        let mut recogniser = recogniser();
        let mut told = Vec::new();
        for points in &arm_raised([true; 13])[..60] {
            recogniser.next(points, 1.0 / RATE_HZ, |_, _, what| told.push(what));
        }
        recogniser.finish(|_, _, what| told.push(what));
        assert!(matches!(told.last(), Some(ActionEvent::BrokenOff { number: 2 })), "{told:?}");
    }
}
