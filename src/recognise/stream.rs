//! All models over one stream of poses of one person.

use super::features::{Extractor, FEATURES, Feature, Noise};
use super::machine::{ActionEvent, ModelMachine, Span};
use super::model::ActionModel;
use super::points::{Lengths, Points};
use super::posture::EquationReading;

/// What each model has named last. Several models may show one action, and then name one and the same.
#[derive(Clone, Debug, Default)]
struct Named(Vec<Option<Span>>);

impl Named {
    /// What becomes of an event of a model: what another has named already (the same action, on the same side, with more
    /// than half of the shorter of both in common) is broken off.
    fn once(&mut self, models: &[ActionModel], index: usize, what: ActionEvent) -> ActionEvent {
        let ActionEvent::Done { span, .. } = &what else { return what };
        let own = &models[index];
        let is_named = models.iter().zip(&self.0).enumerate().any(|(other, (model, named))| {
            let Some(named) = named.filter(|_| other != index) else { return false };
            let common_s = span.end_s.min(named.end_s) - span.start_s.max(named.start_s);
            let shorter_s = (span.end_s - span.start_s).min(named.end_s - named.start_s);
            model.action == own.action && model.side == own.side && common_s > shorter_s / 2.0
        });
        if is_named {
            return ActionEvent::BrokenOff { number: own.phases.len() };
        }
        self.0[index] = Some(*span);
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
            named: Named(vec![None; models.len()]),
            models,
            machines,
            seen: [false; FEATURES],
            time_s: 0.0,
            has_begun: false,
        }
    }

    /// The models, by their index.
    #[must_use]
    pub fn models(&self) -> &[ActionModel] {
        &self.models
    }

    /// The next frame, so long after the last, s; the first is at zero. What happens is told to `tell`: the
    /// model's index, the time, what.
    pub fn next(
        &mut self,
        points: &Points,
        dt_s: f64,
        mut tell: impl FnMut(usize, f64, ActionEvent),
    ) {
        if core::mem::replace(&mut self.has_begun, true) {
            self.time_s += dt_s;
        }
        let time_s = self.time_s;
        let row = self.extractor.next(points, dt_s);
        for (seen, value) in self.seen.iter_mut().zip(&row.values) {
            *seen |= !value.is_nan();
        }
        for (index, (model, machine)) in self.models.iter().zip(&mut self.machines).enumerate() {
            machine.next(model, &row, time_s, &mut |what| {
                tell(index, time_s, self.named.once(&self.models, index, what));
            });
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
    use crate::recognise::model::BodySide;
    use crate::recognise::model::file::{Bands, parse};
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
        parse(text, "raise-l", &Bands::default(), &|_| None).expect("a model")
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
