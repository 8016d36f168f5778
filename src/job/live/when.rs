//! What a robot does by itself when somebody before the sensors does something: a motion of its own for an action of
//! theirs.

use crate::body::{BodyFigure, JointAngles, Proportions};
use crate::control::{Motion, Planned};
use crate::error::{Error, ErrorKind};
use crate::job::recognise;
use crate::job::recognised::RecognisedAction;
use crate::job::report::{Outcome, PlayReport};
use crate::job::source::RobotMotion;
use crate::motion::Setpoint;
use crate::recognise::features::{Extractor, FEATURES, Feature};
use crate::recognise::model::{ActionModel, BodySide};
use crate::recognise::points::{Lengths, Points};
use crate::recognise::posture::EquationReading;
use crate::time::Instant;
use glam::{DQuat, DVec3};
use serde::Serialize;
use std::path::Path;
use std::str::FromStr;

/// Stature of the person on whom it is tried what sensors show, m: that does not depend on it.
const STATURE_M: f64 = 1.75;
/// So many answers are kept for the report; all are told.
const MOST_KEPT: usize = 10_000;

/// When somebody does an action, the robot plays a motion: `ACTION=play:MOTION`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct When {
    /// An action, of any side (`wave`) or of one (`wave-r`).
    pub action: String,
    /// What the robot plays.
    pub motion: String,
}

impl FromStr for When {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let parts = text.split_once('=').and_then(|(action, answer)| {
            let motion = answer.strip_prefix("play:")?;
            (!action.is_empty() && !motion.is_empty())
                .then(|| (action.to_owned(), motion.to_owned()))
        });
        let (action, motion) = parts.ok_or_else(|| {
            Error::of(ErrorKind::Malformed, "this says no action and what to play then")
                .at("--when")
                .got(text)
                .allowed("ACTION=play:MOTION, e.g. wave-r=play:bow")
        })?;
        Ok(Self { action, motion })
    }
}

impl When {
    /// Whether it means an action of this name and side.
    fn means(&self, action: &str, side: Option<BodySide>) -> bool {
        let letter = |side: BodySide| match side {
            BodySide::Left => "-l",
            BodySide::Right => "-r",
        };
        let of_side = || self.action.strip_prefix(action).zip(side);
        self.action == action || of_side().is_some_and(|(end, side)| end == letter(side))
    }

    /// The same, where it does not hold.
    fn wrong(&self, what: &str, kind: ErrorKind) -> Error {
        Error::of(kind, what).at("--when").got(format!("{}=play:{}", self.action, self.motion))
    }
}

/// Looks whether each action can be named from what is worn, and is asked for once.
///
/// # Errors
/// An action that no model names, one whose models all need what the sensors do not show, one that has two answers,
/// models that cannot be read.
pub fn check(whens: &[When], folder: Option<&Path>, worn: &[bool; 13]) -> Result<(), Error> {
    if whens.is_empty() {
        return Ok(());
    }
    let models = recognise::models(folder)?;
    let hidden = hidden(worn)?;
    for (at, when) in whens.iter().enumerate() {
        if whens[..at].iter().any(|other| other.action == when.action) {
            return Err(when.wrong("one action has two answers", ErrorKind::Refused));
        }
        let fits = |model: &&ActionModel| when.means(&model.action, model.side);
        let of_action: Vec<&ActionModel> = models.iter().filter(fits).collect();
        if of_action.is_empty() {
            let mut known: Vec<&str> = models.iter().map(|model| model.action.as_str()).collect();
            known.sort_unstable();
            known.dedup();
            return Err(when
                .wrong("no model names this action", ErrorKind::Unknown)
                .allowed(format!("{}, and with a side -l or -r", known.join(", "))));
        }
        let lacks = |model: &ActionModel| -> Vec<Feature> {
            model.needs().into_iter().filter(|feature| hidden[feature.index()]).collect()
        };
        let least = of_action.into_iter().map(lacks).min_by_key(Vec::len).unwrap_or_default();
        if !least.is_empty() {
            let names: Vec<String> = least.into_iter().map(Feature::name).collect();
            return Err(when
                .wrong("the sensors do not show what its models need", ErrorKind::Refused)
                .allowed(format!("sensors that show {}", names.join(", ")))
                .remedy("wear sensors there as well, or take another action"));
        }
    }
    Ok(())
}

/// The features that somebody who wears sensors on these segments never shows: that are known of one who stands and
/// wears them all.
fn hidden(worn: &[bool; 13]) -> Result<[bool; FEATURES], Error> {
    let body = Proportions::of_figure(BodyFigure::DrillisContini, STATURE_M)?;
    let root_m = DVec3::Z * body.root_height_m();
    let stands = JointAngles::default().to_pose(root_m, DQuat::IDENTITY);
    let seen = |worn: &[bool; 13]| {
        let mut extractor = Extractor::new(Lengths::of(&body), EquationReading::Repaired, None);
        let points = Points::of(&body, &stands, worn);
        // Velocities are known from the second frame on.
        extractor.next(&points, 0.0);
        extractor.next(&points, 0.1).values
    };
    let (all, these) = (seen(&[true; 13]), seen(worn));
    Ok(core::array::from_fn(|at| these[at].is_nan() && !all[at].is_nan()))
}

/// A motion that answers, and is known to be one that the robot can play.
pub struct Answer {
    pub when: When,
    pub motion: RobotMotion,
}

/// An action that was done, and what answers it.
pub struct Call {
    /// Which answer.
    pub answer: usize,
    /// The action.
    pub action: RecognisedAction,
}

/// Waits for actions that have answers.
#[derive(Default)]
pub struct Answers {
    pub list: Vec<Answer>,
    called: Option<Call>,
    is_busy: bool,
    ignored: u64,
}

impl Answers {
    /// Of these motions.
    pub fn new(list: Vec<Answer>) -> Self {
        Self { list, ..Self::default() }
    }

    /// An action is done; what is said of it. While an answer is given there is no other.
    pub fn hear(&mut self, action: &RecognisedAction) -> Option<String> {
        let fits = |answer: &Answer| answer.when.means(&action.action, action.side);
        let answer = self.list.iter().position(fits)?;
        if self.is_busy {
            self.ignored += 1;
            return Some(format!("{} is not answered: the robot answers already", named(action)));
        }
        self.is_busy = true;
        self.called = Some(Call { answer, action: action.clone() });
        let motion = &self.list[answer].when.motion;
        Some(format!("{}: the robot comes to rest and plays {motion}", named(action)))
    }

    /// True from when an action is to be answered until that is taken.
    pub const fn is_called(&self) -> bool {
        self.called.is_some()
    }

    /// What is to be answered now.
    pub const fn take(&mut self) -> Option<Call> {
        self.called.take()
    }

    /// The answer is given, or was not: the next may come.
    pub const fn done(&mut self) {
        self.is_busy = false;
    }

    /// Actions that were not answered.
    pub const fn ignored(&self) -> u64 {
        self.ignored
    }
}

/// An action as it is told.
fn named(action: &RecognisedAction) -> String {
    match action.side {
        Some(side) => format!("{} {}", action.action, side.word()),
        None => action.action.clone(),
    }
}

/// A planned motion during which somebody is heard.
pub struct Overheard<'a> {
    pub planned: Planned<'a>,
    pub hear: &'a mut (dyn FnMut(Instant) + Send),
}

impl Motion for Overheard<'_> {
    fn advance(&mut self, dt_s: f64, now: Instant, setpoints: &mut [Setpoint]) -> bool {
        (self.hear)(now);
        self.planned.advance(dt_s, now, setpoints)
    }

    fn stop(&mut self) {
        self.planned.stop();
    }
}

/// A motion that was looked at before anything moved.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CheckedAnswer {
    /// For which action.
    pub action: String,
    /// What would be played.
    pub motion: String,
    /// From where the robot stood: the way to its beginning, s.
    pub approach_s: f64,
    /// So many times slower than it was made.
    pub retime_factor: f64,
}

/// A motion that answered an action, or was refused.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GivenAnswer {
    /// Which action.
    pub action: String,
    /// On which side, where it has one.
    pub side: Option<BodySide>,
    /// When it was known; times count as those of `events`, s.
    pub recognised_at_s: f64,
    /// What was to be played.
    pub motion: String,
    /// How that ended.
    pub outcome: Outcome,
    /// Why, unless done.
    pub stop_reason: Option<String>,
    /// The way to its beginning, s.
    pub approach_s: f64,
    /// So many times slower than it was made.
    pub retime_factor: f64,
    /// From the first to the last cycle, the way to its beginning included, s.
    pub duration_s: f64,
}

/// What was answered to what somebody did.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct AnswersReport {
    /// What was looked at before anything moved.
    pub checked: Vec<CheckedAnswer>,
    /// What was answered, at most 10,000 of them.
    pub given: Vec<GivenAnswer>,
    /// Actions that came while an answer was given: they have none.
    pub ignored: u64,
}

impl CheckedAnswer {
    /// What looking at it told.
    pub fn of(when: &When, run: &PlayReport) -> Self {
        Self {
            action: when.action.clone(),
            motion: when.motion.clone(),
            approach_s: run.approach_s,
            retime_factor: run.retime_factor,
        }
    }
}

impl AnswersReport {
    /// What came of an answer.
    pub fn give(&mut self, call: &Call, run: &PlayReport) {
        if self.given.len() == MOST_KEPT {
            return;
        }
        self.given.push(GivenAnswer {
            action: call.action.action.clone(),
            side: call.action.side,
            recognised_at_s: call.action.recognised_at_s,
            motion: run.motion.clone(),
            outcome: run.outcome,
            stop_reason: run.stop_reason.clone(),
            approach_s: run.approach_s,
            retime_factor: run.retime_factor,
            duration_s: run.duration_s,
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::Segment;

    fn when(text: &str) -> When {
        text.parse().expect(text)
    }

    #[test]
    fn an_answer_is_an_action_and_what_is_played() {
        assert_eq!(
            when("wave-r=play:walk:3s,bow"),
            When { action: "wave-r".to_owned(), motion: "walk:3s,bow".to_owned() }
        );
        for wrong in ["wave", "wave=bow", "=play:bow", "wave=play:", ""] {
            let error = wrong.parse::<When>().expect_err(wrong).to_string();
            assert!(error.contains("ACTION=play:MOTION"), "{wrong}: {error}");
        }
    }

    #[test]
    fn a_name_with_a_side_means_that_side_and_one_without_means_both() {
        let (left, right) = (Some(BodySide::Left), Some(BodySide::Right));
        assert!(
            when("wave=play:bow").means("wave", left) && when("wave=play:bow").means("wave", right)
        );
        assert!(when("wave-r=play:bow").means("wave", right));
        assert!(!when("wave-r=play:bow").means("wave", left));
        assert!(!when("wave-r=play:bow").means("wave", None));
        assert!(!when("side-kick=play:bow").means("kick", None));
    }

    #[test]
    fn an_action_is_refused_that_nothing_names_or_that_the_sensors_do_not_show() {
        let refused = |text: &str, worn: &[bool; 13]| {
            check(&[when(text)], None, worn).expect_err(text).to_string()
        };
        let mut arm = [false; 13];
        for segment in [Segment::Torso, Segment::RightUpperArm, Segment::RightForearm] {
            arm[segment.index()] = true;
        }
        assert!(refused("somersault=play:bow", &[true; 13]).contains("no model names"));
        let blind = refused("kick-r=play:bow", &arm);
        assert!(blind.contains("do not show") && blind.contains("right_foot"), "{blind}");
        check(&[when("kick-r=play:bow"), when("wave=play:bow")], None, &[true; 13]).expect("shown");
        let twice = [when("wave=play:bow"), when("wave=play:squat")];
        let error = check(&twice, None, &[true; 13]).expect_err("twice").to_string();
        assert!(error.contains("two answers"), "{error}");
    }

    #[test]
    fn what_comes_while_an_answer_is_given_is_counted_and_not_answered() {
        let robot = crate::robot::Robot::load("op3").expect("shipped");
        let order = crate::job::source::MotionOrder::of("bow");
        let motion = crate::job::source::load(&order, &robot).expect("a bow");
        let mut answers = Answers::new(vec![Answer { when: when("wave=play:bow"), motion }]);
        let action = |name: &str| RecognisedAction {
            action: name.to_owned(),
            side: Some(BodySide::Left),
            model: name.to_owned(),
            start_s: 1.0,
            end_s: 2.0,
            recognised_at_s: 2.1,
            person: 0,
            phases: Vec::new(),
        };
        assert_eq!(answers.hear(&action("kick")), None);
        assert!(!answers.is_called());
        let said = answers.hear(&action("wave")).expect("a word");
        assert!(said.contains("wave left") && said.contains("bow"), "{said}");
        assert!(answers.is_called());
        assert!(answers.take().is_some_and(|call| call.action.recognised_at_s == 2.1));
        assert!(answers.hear(&action("wave")).is_some_and(|said| said.contains("not answered")));
        assert!(!answers.is_called());
        answers.done();
        answers.hear(&action("wave"));
        assert!(answers.is_called());
        assert_eq!(answers.ignored(), 1);
    }
}
