//! What a planned motion does to all of the robot: where its base goes, and the figures of its body.

use super::source::RobotMotion;
use crate::error::Error;
use crate::job::model::robot_model;
use crate::motion::retime::needs;
use crate::motion::{JointLimits, Path, Plan, PlanOptions, Setpoint, plan};
use crate::retarget::base::BasePath;
use crate::retarget::figures::{BodyMotion, Original, figures};
use crate::retarget::{BodyFigures, PaceNeed, PeakEffort, SlowStretch};
use crate::robot::{Joint, Robot, RobotBody};

/// Instants that are looked at, per second, at most: bodies are slower.
const MOST_HZ: f64 = 100.0;
/// Stretches that have to be slower are one if they are no further apart, s.
const TOGETHER_S: f64 = 0.1;
/// Most of them that are listed, the worst.
const STRETCHES: usize = 20;

/// How a robot file says that its shapes are nobody's drawing.
const MADE_UP: &str = "made here";

/// What is predicted.
pub(super) const WOULD_FALL: &str = "a robot on its own feet would fall in this motion";
/// What to do about it.
pub(super) const INSTEAD: &str = "--hang if it hangs on a stand, --only for some joints, --speed for a slower \
                                  motion, --allow-fall to let it fall";

/// A robot that does not even stand.
pub(super) const TOO_SOFT: &str =
    "with servos as its file has them ([body.servos]) the robot does not stand on its own feet";
/// What helps such a robot.
pub(super) const STIFFER: &str = "--hang if it hangs on a stand, --allow-fall to let it fall, or stiffer gains in its servos, and these in \
                                  [body.servos] of a robot file of your own";

/// A line about a fall that is predicted, if one is.
pub(super) fn fall_note(figures: &BodyFigures) -> Option<String> {
    let at_s = figures.predicted_fall_s?;
    let told = match figures.still_fall_s {
        Some(still_s) => {
            format!("{TOO_SOFT}: it tips over by itself within {still_s:.1} s; {STIFFER}")
        }
        None => {
            format!("{WOULD_FALL}, at {at_s:.1} s, and a real one is not sent there: {INSTEAD}")
        }
    };
    Some(told)
}

/// A line about a fall with soft servos, of who stays with those it has.
pub(super) fn soft_note(figures: &BodyFigures) -> Option<String> {
    let at_s = figures.soft_fall_s.filter(|_| figures.predicted_fall_s.is_none())?;
    Some(format!(
        "stay near: it stays on its feet, but with servos softer by a third, or a body that weighs so much more, it would fall at {at_s:.1} s"
    ))
}

/// A line about servos that are asked for more torque than they have.
pub(super) fn weak_note(figures: &BodyFigures) -> Option<String> {
    let PeakEffort { share, joint, at_s } = figures.peak_torque.as_ref()?;
    (*share > 1.0).then(|| {
        format!(
            "{joint} would have to give {share:.1} times what its servo has, at {at_s:.1} s: it will not follow there"
        )
    })
}

/// If the robot would fall on its way to the first pose, that way takes so many times as long, tried in this order.
const CALMER: [f64; 2] = [2.0, 4.0];
/// Whoever falls within this time after the way to the first pose falls because of it, s.
const TIPS_S: f64 = 1.0;

/// A motion that was laid, and what it does to all of the robot.
pub(super) struct Laid {
    /// How many times as long as joints need the way to the first pose takes.
    calm: f64,
    pub(super) planned: Plan,
    pub(super) base: Option<BasePath>,
    pub(super) figures: BodyFigures,
}

impl Laid {
    /// A line about a way to the first pose that takes longer than joints need.
    pub(super) fn calm_note(&self) -> Option<String> {
        (self.calm > 1.0).then(|| {
            format!(
                "the way to the first pose takes {:.0} times as long as joints need: on a shorter one the robot would fall",
                self.calm
            )
        })
    }
}

/// Lays a motion from this pose of the robot's joints, rad, and looks at it. If the robot would fall on its way to the first pose, that
/// way takes longer; if that does not help, it does not.
///
/// # Errors
/// As [`plan`] and [`look`].
pub(super) fn laid(
    robot: &Robot,
    start_rad: &[f64],
    motion: &RobotMotion,
    options: PlanOptions,
    hangs: bool,
) -> Result<Laid, Error> {
    let path = motion.path_from(robot, start_rad)?;
    let calmly = |calm: f64| {
        let planned = plan(start_rad, &path, &robot.limits(), PlanOptions { calm, ..options })?;
        let asked = path.stretched(1.0 / options.speed);
        let (base, figures) = look(robot, motion, &asked, &planned, hangs)?;
        Ok::<_, Error>(Laid { calm, planned, base, figures })
    };
    let usual = calmly(1.0)?;
    let Laid { planned, figures, .. } = &usual;
    let falls_s = figures.predicted_fall_s.filter(|_| figures.still_fall_s.is_none());
    let tips_s = planned.approach_s + TIPS_S;
    if planned.approach_s > 0.0 && falls_s.is_some_and(|at_s| at_s < tips_s) {
        for calm in CALMER {
            let calmer = calmly(calm)?;
            if calmer.figures.predicted_fall_s.is_none() {
                return Ok(calmer);
            }
        }
    }
    Ok(usual)
}

/// Looks at a planned motion, once through if it is played several times: the base, if the robot has a body,
/// and the figures.
///
/// # Errors
/// A body no tree can be made of, a rate too low to tell forces.
pub(super) fn look(
    robot: &Robot,
    motion: &RobotMotion,
    path: &Path,
    planned: &Plan,
    hangs: bool,
) -> Result<(Option<BasePath>, BodyFigures), Error> {
    let retime = Some(pace(path, &robot.limits()));
    let Some(body) = RobotBody::of(&robot.file)? else {
        let missing = vec![format!(
            "the file of {} has no [body]: nothing of weight, shape and floor",
            robot.name
        )];
        return Ok((None, BodyFigures { retime, missing, ..BodyFigures::default() }));
    };
    let rate_hz = robot.file.rate_hz.min(MOST_HZ);
    let trajectory = &planned.trajectory;
    let (from_s, to_s) = (planned.clip_start_s, planned.clip_start_s + planned.clip_s);
    let end_s = if to_s < trajectory.duration_s() { to_s } else { trajectory.duration_s() };
    let count = (end_s * rate_hz).ceil() as usize + 1;
    let mut setpoints = vec![Setpoint::default(); trajectory.joints().len()];
    let mut pose = |at: usize| -> Vec<f64> {
        trajectory.sample((at as f64 / rate_hz).min(end_s), &mut setpoints);
        setpoints.iter().map(|setpoint| setpoint.position_rad).collect()
    };
    let poses: Vec<Vec<f64>> = (0..count).map(&mut pose).collect();
    let path_time = |at: usize| planned.path_time_s(at as f64 / rate_hz);
    let path_times_s: Vec<f64> = (0..count).map(path_time).collect();
    let source_times_s: Vec<f64> =
        path_times_s.iter().map(|time_s| motion.source_time_s(*time_s)).collect();
    let first = ((from_s * rate_hz).ceil() as usize).min(count - 1);
    let model = motion.person().map(|_| robot_model(robot)).transpose()?;
    let original = motion.person().zip(model.as_ref()).map(|(person, model)| Original {
        poses: &person.poses,
        rate_hz: person.rate_hz,
        tracked: &person.tracked,
        stature_m: person.stature_m,
        model,
    });
    let footfalls = Some(motion.footfalls()).filter(|said| !said.is_empty());
    let (base, figures) = figures(&BodyMotion {
        body: &body,
        start_rad: &robot.joints.iter().map(|joint| joint.initial_rad).collect::<Vec<f64>>(),
        poses: &poses,
        rate_hz,
        path_times_s: &path_times_s,
        source_times_s: &source_times_s,
        clip: &(first..count),
        footfalls: footfalls.map(|said| (said, motion.rate_hz())),
        original,
        hangs,
        motors: &robot.joints.iter().map(Joint::motor_curve).collect::<Vec<_>>(),
    })?;
    let mut figures = BodyFigures { retime, ..figures };
    let made = robot.file.body.as_ref().is_some_and(|of| of.shape_source.starts_with(MADE_UP));
    if made {
        let rough = "its soles and shapes are guessed from its weight: floor, balance and contact are rough";
        figures.missing.push(rough.to_owned());
    }
    Ok((Some(base), figures))
}

/// How much slower a path would have to be, instant by instant.
fn pace(path: &Path, limits: &[JointLimits]) -> PaceNeed {
    let needs = needs(path, limits);
    let mut factors: Vec<f64> = needs.iter().map(|(factor, _)| factor.max(1.0)).collect();
    factors.sort_by(f64::total_cmp);
    let mut local: Vec<SlowStretch> = Vec::new();
    for (at, (factor, joint)) in needs.iter().enumerate().filter(|(_, (factor, _))| *factor > 1.0) {
        let time_s = at as f64 * path.step_s();
        match local.last_mut() {
            Some(last) if time_s - last.end_s <= TOGETHER_S => {
                last.end_s = time_s;
                if *factor > last.factor {
                    (last.factor, last.joint) = (*factor, path.joints()[*joint].clone());
                }
            }
            _ => local.push(SlowStretch {
                start_s: time_s,
                end_s: time_s,
                factor: *factor,
                joint: path.joints()[*joint].clone(),
            }),
        }
    }
    local.sort_by(|a, b| b.factor.total_cmp(&a.factor));
    local.truncate(STRETCHES);
    local.sort_by(|a, b| a.start_s.total_cmp(&b.start_s));
    PaceNeed {
        median: factors.get(factors.len() / 2).copied().unwrap_or(1.0),
        worst: factors.last().copied().unwrap_or(1.0),
        local,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_servo_that_is_asked_for_more_than_it_has_is_named_and_one_that_is_not_is_not() {
        let asked = |share: f64| {
            let peak = PeakEffort { share, joint: "r_knee".to_owned(), at_s: 2.04 };
            weak_note(&BodyFigures { peak_torque: Some(peak), ..BodyFigures::default() })
        };
        let told = asked(1.44).expect("a note");
        assert!(
            told.contains("r_knee would have to give 1.4 times") && told.contains("2.0 s"),
            "{told}"
        );
        assert_eq!((asked(0.99), weak_note(&BodyFigures::default())), (None, None));
    }
}
