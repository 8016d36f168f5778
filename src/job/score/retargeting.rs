//! How well what people do is carried over to a robot: what is left of how their limbs point, where hands and feet
//! are, whether soles stand where they stand, and whether feet do what the action asks of them.

use super::motions::{FeatureKept, Judging, MotionScore, MotionScoreOrder, mean, mean_interval};
use crate::body::{Segment, SegmentPose};
use crate::corpus::rows::TrialEntry;
use crate::error::{Error, ErrorKind};
use crate::job::bodily::{self, Laid};
use crate::job::corpus::capture_of;
use crate::job::pending::go_on;
use crate::job::source::{self, MotionOrder, RobotMotion, Source};
use crate::job::{Event, Observer};
use crate::mocap::anatomy::Capture;
use crate::motion::{Plan, PlanOptions, Setpoint};
use crate::retarget::base::{BasePath, ON_FLOOR_M, StandingSole};
use crate::robot::{Robot, RobotBody};
use std::collections::BTreeMap;

/// Limbs whose direction is compared.
const LIMBS: [Segment; 8] = [
    Segment::LeftUpperArm,
    Segment::RightUpperArm,
    Segment::LeftForearm,
    Segment::RightForearm,
    Segment::LeftThigh,
    Segment::RightThigh,
    Segment::LeftShank,
    Segment::RightShank,
];
/// Who has no foot on the floor for this part of the time flies.
const FLIES: f64 = 0.03;
/// Who has both feet on the floor for this part of the time stands.
const STANDS: f64 = 0.9;

/// What feet do in an action.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum FeetRule {
    /// Both stand nearly all the time.
    Stands,
    /// One stands at any time.
    Steps,
    /// At times none does.
    Flies,
}

impl FeetRule {
    /// Of feet that are on the floor or not, instant by instant.
    fn of(contacts: impl Iterator<Item = [bool; 2]>) -> Option<Self> {
        let (mut none, mut both, mut all) = (0, 0, 0);
        for [left, right] in contacts {
            none += usize::from(!left && !right);
            both += usize::from(left && right);
            all += 1;
        }
        let part = |count: usize| count as f64 / all as f64;
        match all {
            0 => None,
            _ if part(none) >= FLIES => Some(Self::Flies),
            _ if part(both) >= STANDS => Some(Self::Stands),
            _ => Some(Self::Steps),
        }
    }
}

/// A trial as a robot does it.
#[derive(Clone, Debug, Default)]
struct Done {
    directions_deg: Option<f64>,
    hands_mm: Option<f64>,
    feet_mm: Option<f64>,
    skate_mm_s: Option<f64>,
    touches: Option<f64>,
    slower: Option<f64>,
    falls: Option<f64>,
    footing: Option<FeetRule>,
}

impl Done {
    fn of(robot: &Robot, motion: &RobotMotion) -> Result<Self, Error> {
        let start_rad: Vec<f64> = robot.joints.iter().map(|joint| joint.initial_rad).collect();
        let options = PlanOptions { retime: true, ..PlanOptions::default() };
        let Laid { planned, base, figures, .. } =
            bodily::laid(robot, &start_rad, motion, options, false)?;
        let off = figures.direction_error_rad;
        let known: Vec<f64> =
            [off.upper_arm, off.forearm, off.thigh, off.shank].into_iter().flatten().collect();
        let mm = |metres: Option<f64>| metres.map(|metres| 1e3 * metres);
        let stands = figures.slip_m_s.is_some();
        let footing = match (base, RobotBody::of(&robot.file)?) {
            (Some(base), Some(body)) if stands => footing(&body, &base, &planned),
            _ => None,
        };
        Ok(Self {
            directions_deg: (!known.is_empty()).then(|| mean(&known).to_degrees()),
            hands_mm: mm(figures.hand_error_m),
            feet_mm: mm(figures.foot_error_m),
            skate_mm_s: mm(figures.slip_m_s),
            touches: figures.self_collision_share,
            slower: Some(planned.stretch),
            falls: stands.then(|| f64::from(u8::from(figures.predicted_fall_s.is_some()))),
            footing,
        })
    }
}

/// What a robot's soles do in a motion: on the floor is a sole whose lowest corner is.
fn footing(body: &RobotBody, base: &BasePath, planned: &Plan) -> Option<FeetRule> {
    let soles = StandingSole::all(body);
    let mut setpoints = vec![Setpoint::default(); planned.trajectory.joints().len()];
    let clip_s = planned.clip_start_s..=planned.clip_start_s + planned.clip_s;
    let time_s = |at: usize| at as f64 / base.rate_hz;
    let instants = (0..base.places.len()).filter(|at| clip_s.contains(&time_s(*at)));
    FeetRule::of(instants.map(|at| {
        planned.trajectory.sample(time_s(at), &mut setpoints);
        let pose: Vec<f64> = setpoints.iter().map(|setpoint| setpoint.position_rad).collect();
        let placed = body.tree.place(base.places[at], &body.angles(&pose));
        let is_down = |sole: &StandingSole| {
            sole.corners_m.iter().any(|corner| placed[sole.link].point(*corner).z < ON_FLOOR_M)
        };
        [0, 1].map(|side| soles.iter().filter(|sole| sole.side == side).any(is_down))
    }))
}

/// A trial on a robot, by both ways.
struct Judged {
    entry: TrialEntry,
    ours: Done,
    copied: Done,
    footing: Option<FeetRule>,
}

/// How well the trials of a corpus are carried over to a robot.
///
/// # Errors
/// As [`super::motions::generalisation`]; a robot that is not known, or of which nobody knows how it is built.
pub fn retargeting(
    order: &MotionScoreOrder,
    robot: &str,
    observer: &dyn Observer,
) -> Result<MotionScore, Error> {
    let robot = Robot::load(robot)?;
    if robot.file.body.is_none() {
        return Err(Error::of(ErrorKind::Absent, "nobody knows how this robot is built")
            .at(robot.name.clone())
            .allowed("a robot whose file has a [body]")
            .remedy("`gaitway robot import` makes one of its URDF"));
    }
    let mut judging = Judging::of(order)?;
    let mut trials = std::mem::take(&mut judging.trials);
    trials.retain(|held| judging.split.judges(&held.entry));
    let mut report = judging.report(
        "retargeting",
        (
            "the person of each trial: how upper arms, forearms, thighs and shanks point, against trunk and pelvis",
            "deg",
        ),
    );
    let mut judged: Vec<Judged> = Vec::new();
    let mut repetitions: BTreeMap<(String, String), Vec<Vec<SegmentPose>>> = BTreeMap::new();
    let total = trials.len() as u64;
    for (done, held) in (0u64..).zip(&trials) {
        go_on(observer)?;
        observer.hear(Event::Step { done, total, what: "trials" });
        let capture = capture_of(&held.entry, held.frames.poses());
        match of_trial(&robot, &held.entry, capture) {
            Ok(of) if of.ours.directions_deg.is_some() => judged.push(of),
            Ok(_) => report.pass_over("no limb that the robot has", 1),
            Err(error) => report.pass_over(&error.what, 1),
        }
        if let Some(subject) = &held.entry.subject {
            let who = (held.entry.action.clone(), subject.clone());
            repetitions.entry(who).or_default().push(held.poses());
        }
    }
    if judged.is_empty() {
        return Ok(report);
    }
    let [ours, copied] =
        [|of: &Judged| of.ours.directions_deg, |of: &Judged| of.copied.directions_deg]
            .map(|of| judged.iter().filter_map(of).collect::<Vec<f64>>());
    report.tell(&ours, [("each angle of the body copied to the joint that turns alike", &copied)]);
    report.bound = scatter_deg(&repetitions)
        .map(|bound| ("repetitions of an action by one person, from one another", bound));
    let mut by_action: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for of in &judged {
        by_action.entry(of.entry.action.clone()).or_default().extend(of.ours.directions_deg);
    }
    report.per_class = by_action.iter().map(|(action, of)| (action.clone(), mean(of))).collect();
    report.judged = judged.len() as u64;
    report.features = features(&judged, order.seed);
    Ok(report)
}

fn of_trial(robot: &Robot, entry: &TrialEntry, capture: Capture) -> Result<Judged, Error> {
    let of = MotionOrder::of(&entry.name);
    let order = MotionOrder { balanced_at: Some(1.0), may_fall: true, ..of };
    let copied = source::copied(robot, &entry.name, capture.clone())?;
    let touches = copied.footfalls().iter().map(|of| of.touches.unwrap_or([true; 2]));
    let footing = FeetRule::of(touches);
    let ours = source::of_person(&order, robot, capture, Source::default(), false)?;
    Ok(Judged {
        entry: entry.clone(),
        ours: Done::of(robot, &ours)?,
        copied: Done::of(robot, &copied)?,
        footing,
    })
}

fn features(judged: &[Judged], seed: u64) -> Vec<FeatureKept> {
    let rules = rules(judged);
    let keeps = |of: &Judged, done: &Done| {
        let rule = rules.get(&of.entry.action)?;
        Some(1e2 * f64::from(u8::from(done.footing? == *rule)))
    };
    let percent = |share: Option<f64>| share.map(|share| 1e2 * share);
    type Of<'a> = &'a dyn Fn(&Judged, &Done) -> Option<f64>;
    let all: [(&'static str, &'static str, Of<'_>); 7] = [
        ("hands from where they should be", "mm", &|_, done| done.hands_mm),
        ("feet from where they should be", "mm", &|_, done| done.feet_mm),
        ("soles skate while the person's feet stand", "mm/s", &|_, done| done.skate_mm_s),
        ("trials whose feet do what the action asks", "%", &keeps),
        ("time in which it touches itself", "%", &|_, done| percent(done.touches)),
        ("trials in which it would fall", "%", &|_, done| percent(done.falls)),
        ("slower than the person", "times", &|_, done| done.slower),
    ];
    let feature = |(what, unit, of): (&'static str, &'static str, Of<'_>)| {
        let ours: Vec<f64> = judged.iter().filter_map(|trial| of(trial, &trial.ours)).collect();
        let copied: Vec<f64> = judged.iter().filter_map(|trial| of(trial, &trial.copied)).collect();
        FeatureKept {
            what,
            unit,
            value: (!ours.is_empty()).then(|| mean(&ours)),
            interval: (ours.len() > 1).then(|| mean_interval(&ours, seed)),
            baseline: (!copied.is_empty()).then(|| mean(&copied)),
        }
    };
    all.into_iter().map(feature).collect()
}

/// What feet do in each action: as in most of its trials.
fn rules(judged: &[Judged]) -> BTreeMap<String, FeetRule> {
    let mut counts: BTreeMap<String, BTreeMap<FeetRule, usize>> = BTreeMap::new();
    for of in judged {
        let own = counts.entry(of.entry.action.clone()).or_default();
        of.footing.into_iter().for_each(|footing| *own.entry(footing).or_default() += 1);
    }
    let most =
        |of: &BTreeMap<FeetRule, usize>| of.iter().max_by_key(|(_, count)| **count).map(|of| *of.0);
    counts.iter().filter_map(|(action, of)| Some((action.clone(), most(of)?))).collect()
}

/// How far limbs of one repetition point from those of another of the same person, deg, at the same part of both; none
/// without repetitions.
fn scatter_deg(repetitions: &BTreeMap<(String, String), Vec<Vec<SegmentPose>>>) -> Option<f64> {
    let mut all = Vec::new();
    for of in repetitions.values() {
        for (at, one) in of.iter().enumerate() {
            all.extend(of[at + 1..].iter().map(|other| apart_deg(one, other)));
        }
    }
    (!all.is_empty()).then(|| mean(&all))
}

fn apart_deg(one: &[SegmentPose], other: &[SegmentPose]) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for (one, other) in one.iter().zip(other) {
        for limb in LIMBS {
            let base = match limb {
                Segment::LeftThigh
                | Segment::RightThigh
                | Segment::LeftShank
                | Segment::RightShank => Segment::Pelvis,
                _ => Segment::Torso,
            };
            let [one, other] = [one, other].map(|pose| {
                let turn = |of: Segment| pose.orientation[of.index()];
                turn(base).inverse() * turn(limb) * limb.long_axis()
            });
            sum += one.angle_between(other).to_degrees();
            count += 1.0;
        }
    }
    sum / f64::max(count, 1.0)
}

#[cfg(test)]
mod tests {
    use super::super::motions::INSTANTS;
    use super::*;
    use crate::body::{Dof, JointAngles};
    use glam::{DQuat, DVec3};

    #[test]
    fn feet_stand_step_or_fly_by_how_long_none_or_both_are_on_the_floor() {
        let of = |none: usize, one: usize, both: usize| {
            let all = std::iter::repeat_n([false; 2], none);
            let all = all.chain(std::iter::repeat_n([true, false], one));
            FeetRule::of(all.chain(std::iter::repeat_n([true; 2], both)))
        };
        assert_eq!(of(0, 0, 0), None);
        assert_eq!(of(2, 4, 94), Some(FeetRule::Stands));
        assert_eq!(of(2, 40, 58), Some(FeetRule::Steps));
        assert_eq!(of(3, 0, 97), Some(FeetRule::Flies));
    }

    #[test]
    fn repetitions_scatter_by_as_much_as_one_limb_points_elsewhere() {
        let pose = |angle_rad: f64| {
            let mut angles = JointAngles::default();
            angles[Dof::RightElbowFlexion] = angle_rad;
            vec![angles.to_pose(DVec3::ZERO, DQuat::IDENTITY); INSTANTS]
        };
        let who = ("wave".to_owned(), "s01".to_owned());
        let found = scatter_deg(&BTreeMap::from([(who, vec![pose(0.0), pose(0.8)])]));
        assert!((found.expect("two") - 0.8f64.to_degrees() / 8.0).abs() < 1e-9, "{found:?}");
        assert_eq!(scatter_deg(&BTreeMap::new()), None);
    }
}
