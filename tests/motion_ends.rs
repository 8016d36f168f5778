//! What reaches a servo begins and ends at rest and without acceleration: goals before they are
//! rounded to counts, cycle by cycle, of actions, captures and stops on the shipped robots, against
//! the printed forms.

mod aloud;
mod captured;
#[path = "motion_ends/forms.rs"]
mod forms;
#[path = "motion_ends/limbs.rs"]
mod limbs;

use aloud::aloud;
use captured::{bvh_files, captures};
use gaitway::action::{Join, Motion as Action, phrase, vocabulary};
use gaitway::control::{Motion as _, Planned};
use gaitway::error::Error;
use gaitway::job::model::robot_model;
use gaitway::job::source::{self, MotionOrder};
use gaitway::motion::{Path, Plan, PlanOptions, Setpoint, plan};
use gaitway::robot::Robot;
use gaitway::time::Instant;
use gaitway_profiles::Segment;
use limbs::limbs;
use std::f64::consts::FRAC_PI_2;

/// Share of its acceleration limit by which a joint's acceleration may be another than the form's.
const SHARE: f64 = 0.02;
/// How far a joint may be from where Eq. 1 has it, deg.
const OFF_DEG: f64 = 0.02;

/// Shipped robots with legs.
fn bodies() -> Vec<Robot> {
    let robots = gaitway_profiles::robot_names().map(|name| Robot::load(name).expect("shipped"));
    let walks = |robot: &Robot| {
        let anatomy = robot.file.anatomy.as_ref();
        anatomy.is_some_and(|of| of.segments.iter().any(|link| link.segment == Segment::LeftShank))
    };
    robots.filter(walks).collect()
}

/// A motion laid out for a robot that stands in its initial pose.
struct Laid<'a> {
    robot: &'a Robot,
    start_rad: Vec<f64>,
    path: Path,
    plan: Plan,
    cycle_s: f64,
}

impl<'a> Laid<'a> {
    fn new(robot: &'a Robot, order: &MotionOrder, speed: f64) -> Result<Self, Error> {
        let loaded = source::load(order, robot)?;
        let start_rad: Vec<f64> = robot.joints.iter().map(|joint| joint.initial_rad).collect();
        let path = loaded.path_from(robot, &start_rad)?;
        let options = PlanOptions { speed, ..PlanOptions::default() };
        let plan = plan(&start_rad, &path, &robot.limits(), options)?;
        let path = path.stretched(plan.retimed.factor / speed);
        Ok(Self { robot, start_rad, path, plan, cycle_s: 1.0 / robot.file.rate_hz })
    }

    /// Goals of every cycle, by the loop's own source of them, until they rest: `[cycle][joint]`,
    /// rad. Stopped in a cycle, if that is said.
    fn goals(&self, stop_in: Option<usize>) -> Vec<Vec<f64>> {
        let mut motion = Planned::new(&self.plan.trajectory, self.robot).expect("its own joints");
        let mut setpoints = vec![Setpoint::default(); self.start_rad.len()];
        let mut goals = Vec::new();
        loop {
            if stop_in == Some(goals.len()) {
                motion.stop();
            }
            let dt_s = if goals.is_empty() { 0.0 } else { self.cycle_s };
            let over = motion.advance(dt_s, Instant::ZERO, &mut setpoints);
            goals.push(setpoints.iter().map(|setpoint| setpoint.position_rad).collect());
            if over {
                return goals;
            }
        }
    }

    /// Where the printed forms have a joint at a time: an actionlet to the first pose, the path by
    /// its own clock, which gains and loses its speed as half an actionlet.
    fn form_rad(&self, joint: usize, time_s: f64) -> f64 {
        let spline = &self.path.splines()[joint];
        let (start, first) = (self.start_rad[joint], spline.values()[0]);
        let since_s = time_s - self.plan.clip_start_s;
        if since_s <= 0.0 {
            return start + (first - start) * forms::middle(time_s, self.plan.approach_s);
        }
        let eases_s = [self.plan.ease_in_s, self.plan.ease_out_s];
        spline.sample(forms::clip_clock_s(since_s, self.path.duration_s(), eases_s))[0]
    }

    /// The first and last two cycles, and those about the beginning of the clip.
    fn ends(&self, cycles: usize) -> Vec<usize> {
        let clip = (self.plan.clip_start_s / self.cycle_s).ceil() as usize;
        let all = [0, 1, clip, clip + 1, clip + 2, cycles - 2, cycles - 1, cycles];
        all.into_iter().filter(|cycle| *cycle <= cycles).collect()
    }

    /// How much the acceleration of the goals in a cycle differs from that of a form, as a share of
    /// the joint's limit. Before the first and after the last cycle goals stay.
    fn differs(
        &self,
        goals: &[Vec<f64>],
        joint: usize,
        cycle: usize,
        form: impl Fn(f64) -> f64,
    ) -> f64 {
        let off = |cycle: i64| {
            let held = cycle.clamp(0, goals.len() as i64 - 1);
            let time_s = cycle.max(0) as f64 * self.cycle_s;
            goals[held as usize][joint] - form(time_s)
        };
        let cycle = cycle as i64;
        let second = off(cycle - 1) - 2.0 * off(cycle) + off(cycle + 1);
        let limit = self.robot.joints[joint].limits.acceleration_rad_s2();
        second.abs() / (self.cycle_s * self.cycle_s) / limit
    }

    /// What is wrong with the ends: every joint rests there, is not accelerated, ends where its
    /// path ends, and goes by the forms in the cycles beside.
    fn wrong_ends(&self, name: &str) -> Vec<String> {
        let mut wrong = Vec::new();
        let trajectory = &self.plan.trajectory;
        let name = format!("{name} on {}", self.robot.name);
        let mut setpoints = vec![Setpoint::default(); self.start_rad.len()];
        for time_s in [0.0, self.plan.clip_start_s, trajectory.duration_s()] {
            trajectory.sample(time_s, &mut setpoints);
            for (joint, setpoint) in self.robot.joints.iter().zip(&setpoints) {
                let share = setpoint.acceleration_rad_s2.abs() / joint.limits.acceleration_rad_s2();
                if !(share <= SHARE && setpoint.velocity_rad_s.abs() <= 1e-3) {
                    let percent = 100.0 * share;
                    wrong.push(format!(
                        "{name}: {} at {time_s:.3} s: {:.4} rad/s, acceleration {percent:.1} %",
                        joint.name, setpoint.velocity_rad_s
                    ));
                }
            }
        }
        for (end, last) in trajectory.end_rad().iter().zip(self.path.last_rad()) {
            if !((end - last).abs() <= 1e-9) {
                wrong.push(format!("{name}: ends at {end}, not at {last} rad"));
            }
        }
        let goals = self.goals(None);
        for (joint, of) in self.robot.joints.iter().enumerate() {
            for cycle in self.ends(goals.len() - 1) {
                let share =
                    self.differs(&goals, joint, cycle, |time_s| self.form_rad(joint, time_s));
                if !(share <= SHARE) {
                    let (cycles, percent) = (goals.len(), 100.0 * share);
                    wrong.push(format!(
                        "{name}: {} in cycle {cycle} of {cycles} by {percent:.1} % of its limit",
                        of.name
                    ));
                }
            }
        }
        wrong
    }
}

/// Asks for every robot on a thread of its own; all that is wrong.
fn on_all_bodies(ask: impl Fn(&Robot) -> Vec<String> + Sync) -> Vec<String> {
    let robots = bodies();
    assert!(robots.len() >= 5, "{} robots", robots.len());
    std::thread::scope(|scope| {
        let ask = &ask;
        let asked: Vec<_> = robots.iter().map(|robot| scope.spawn(move || ask(robot))).collect();
        asked.into_iter().flat_map(|thread| thread.join().expect("an answer")).collect()
    })
}

fn told(wrong: &[String]) -> String {
    format!("{} are wrong:\n{}", wrong.len(), wrong[..wrong.len().min(40)].join("\n"))
}

/// Compares a robot's joints with Eq. 1 wherever they stand in for one degree of freedom and no
/// limit has to do with it: all along, and accelerations at the ends. What is wrong, and how much
/// was seen.
fn against_eq_1(laid: &Laid<'_>, name: &str, action: &Action, speed: f64) -> (Vec<String>, usize) {
    let model = robot_model(laid.robot).expect("an anatomy");
    let goals = laid.goals(None);
    let (mut wrong, mut seen) = (Vec::new(), 0);
    // The clip's own clock.
    let slower = laid.plan.retimed.factor / speed;
    let action_s = |time_s: f64| (time_s - laid.plan.clip_start_s) / slower;
    let clip = (laid.plan.clip_start_s / laid.cycle_s).ceil() as usize;
    for limb in limbs(&model, action) {
        for played in &limb.joints {
            let joint_name = &laid.robot.joints[played.joint].name;
            let form = |time_s: f64| played.angle_rad(action, action_s(time_s));
            let mut furthest: (f64, f64) = (0.0, 0.0);
            for (cycle, goal) in goals.iter().enumerate().skip(clip) {
                let time_s = cycle as f64 * laid.cycle_s;
                if limb.is_free(action_s(time_s)) {
                    let off_deg = (goal[played.joint] - form(time_s)).abs().to_degrees();
                    if !(off_deg <= furthest.0) {
                        furthest = (off_deg, time_s);
                    }
                    seen += 1;
                }
            }
            if !(furthest.0 <= OFF_DEG) {
                let (off_deg, time_s) = furthest;
                let of = &laid.robot.name;
                wrong.push(format!(
                    "{name} on {of}: {joint_name} {off_deg:.4} deg at {time_s:.3} s"
                ));
            }
            for cycle in [clip + 1, clip + 2, goals.len() - 3, goals.len() - 2, goals.len() - 1] {
                if !limb.is_free(action_s(cycle as f64 * laid.cycle_s)) {
                    continue;
                }
                let share = laid.differs(&goals, played.joint, cycle, form);
                if !(share <= SHARE) {
                    let (of, percent) = (&laid.robot.name, 100.0 * share);
                    wrong.push(format!(
                        "{name} on {of}: {joint_name} in cycle {cycle} by {percent:.1} %"
                    ));
                }
            }
        }
    }
    (wrong, seen)
}

fn action(text: &str) -> Action {
    phrase::perform(&phrase::load(text).expect("actions"), Join::Transition).expect("a motion")
}

#[test]
fn joints_that_stand_in_for_one_degree_of_freedom_do_what_eq_1_says_and_all_end_as_it_does() {
    let wrong = on_all_bodies(|robot| {
        let (mut wrong, mut seen) = (Vec::new(), 0);
        for name in vocabulary::names() {
            let laid = Laid::new(robot, &MotionOrder::of(name), 1.0).expect("a plan");
            if (laid.plan.ease_in_s, laid.plan.ease_out_s) != (0.0, 0.0) {
                wrong.push(format!("{name} on {}: it does not keep its own clock", robot.name));
                continue;
            }
            let (more, compared) = against_eq_1(&laid, name, &action(name), 1.0);
            wrong.extend(more);
            wrong.extend(laid.wrong_ends(name));
            seen += compared;
        }
        aloud!("{}: {seen} goals of joints compared with Eq. 1", robot.name);
        if seen < 1000 {
            wrong.push(format!("only {seen} goals of {} were compared", robot.name));
        }
        wrong
    });
    assert!(wrong.is_empty(), "{}", told(&wrong));
}

#[test]
fn phrases_paces_and_playing_speeds_keep_the_curves_too() {
    let robot = Robot::load("op3").expect("shipped");
    let mut wrong = Vec::new();
    for (text, speed) in
        [("walk:x1@2,squat@0.5,wave-l", 1.0), ("bow@0.4,hop:x2", 2.0), ("kick-r", 0.3)]
    {
        let laid = Laid::new(&robot, &MotionOrder::of(text), speed).expect("a plan");
        let (more, seen) = against_eq_1(&laid, text, &action(text), speed);
        assert!(seen > 200, "{text}: {seen}");
        wrong.extend(more);
        wrong.extend(laid.wrong_ends(text));
    }
    assert!(wrong.is_empty(), "{}", told(&wrong));
}

/// A robot that is moved to keep its balance, and slowed in parts, ends as it would have: without
/// acceleration, by its own clock run down where the motion no longer is what Eq. 1 has.
#[test]
fn actions_that_are_moved_for_balance_end_at_rest_too() {
    let robot = Robot::load("op3").expect("shipped");
    let (mut wrong, mut moved) = (Vec::new(), 0);
    for name in vocabulary::names() {
        let order = MotionOrder { balanced_at: Some(1.0), ..MotionOrder::of(name) };
        let laid = Laid::new(&robot, &order, 1.0).expect("a plan");
        moved += usize::from(laid.plan.ease_out_s > 0.0);
        wrong.extend(laid.wrong_ends(name));
    }
    aloud!("{moved} actions are moved for balance");
    assert!(moved >= 5, "only {moved} actions are moved at all");
    assert!(wrong.is_empty(), "{}", told(&wrong));
}

/// Each capture on one robot, which `choose` picks by the capture's number.
fn captures_end_well(choose: impl Fn(usize) -> usize) {
    let Some(folder) = captures() else { return };
    let (robots, files) = (bodies(), bvh_files(&folder));
    let (mut wrong, mut played) = (Vec::new(), 0);
    for (number, file) in files.iter().enumerate() {
        let motion = file.to_str().expect("a UTF-8 path");
        let name = file.file_name().and_then(|name| name.to_str()).unwrap_or(motion);
        // What cannot be played is refused; tests/mocap/captures.rs says how many.
        let robot = &robots[choose(number) % robots.len()];
        let Ok(laid) = Laid::new(robot, &MotionOrder::of(motion), 1.0) else { continue };
        played += 1;
        wrong.extend(laid.wrong_ends(name));
    }
    assert!(10 * played >= 9 * files.len(), "{played} of {} captures", files.len());
    assert!(wrong.is_empty(), "{}", told(&wrong));
}

#[test]
fn captures_end_on_op3_as_a_clock_does_that_is_run_down() {
    let op3 = bodies().iter().position(|robot| robot.name == "op3").expect("OP3");
    captures_end_well(|_| op3);
}

#[test]
fn captures_end_on_all_robots_in_turn_as_a_clock_does_that_is_run_down() {
    captures_end_well(|number| number);
}

#[test]
fn a_section_cut_out_of_an_action_is_run_up_and_down() {
    let robot = Robot::load("op3").expect("shipped");
    let order = MotionOrder { from_s: Some(1.6), to_s: Some(3.1), ..MotionOrder::of("walk") };
    let laid = Laid::new(&robot, &order, 1.0).expect("a plan");
    assert!(laid.plan.ease_in_s > 0.0 && laid.plan.ease_out_s > 0.0);
    let wrong = laid.wrong_ends("walk from 1.6 to 3.1 s");
    assert!(wrong.is_empty(), "{}", told(&wrong));
}

/// Stopped at many moments, the motion goes on along its path by a clock that loses its speed as
/// half an actionlet, and is at rest in time.
#[test]
fn a_stop_is_the_half_form_along_the_path_wherever_it_is_asked_for() {
    let wrong = on_all_bodies(|robot| {
        let mut wrong = Vec::new();
        let limits = robot.limits();
        let ramps = limits
            .iter()
            .map(|of| forms::half_form_s(of.velocity_rad_s(), of.acceleration_rad_s2()));
        let ramp_s = ramps.fold(0.0, f64::max);
        for name in ["walk", "run", "kick-r", "jumping-jacks", "bow"] {
            let laid = Laid::new(robot, &MotionOrder::of(name), 1.0).expect("a plan");
            let whole = laid.goals(None).len();
            for part in 1..16 {
                let stop_in = whole * part / 16;
                let goals = laid.goals(Some(stop_in));
                let stop_s = (stop_in - 1) as f64 * laid.cycle_s;
                let took_s = (goals.len() - stop_in) as f64 * laid.cycle_s;
                if !(took_s <= ramp_s + 2.0 * laid.cycle_s) {
                    wrong.push(format!("{name} on {}: stopped in {took_s} s", robot.name));
                }
                let trajectory = &laid.plan.trajectory;
                let at = |joint: usize, time_s: f64| {
                    let mut setpoints = vec![Setpoint::default(); limits.len()];
                    let motion_s = forms::stopped_clock_s(time_s, stop_s, ramp_s);
                    trajectory.sample(motion_s, &mut setpoints);
                    setpoints[joint].position_rad
                };
                let rests_s = goals.len() as f64 * laid.cycle_s;
                let ramp_ends =
                    forms::stopped_clock_s(rests_s, stop_s, ramp_s) < trajectory.duration_s();
                // From full speed the form itself still has so much of the limit a cycle before its
                // end; a brake at the limit would have all of it.
                let most = SHARE + FRAC_PI_2 * 2.0 * laid.cycle_s / ramp_s;
                for (joint, of) in robot.joints.iter().enumerate() {
                    let differs =
                        |cycle| laid.differs(&goals, joint, cycle, |time_s| at(joint, time_s));
                    let share = (stop_in + 1..=goals.len()).map(differs).fold(0.0, f64::max);
                    let last = laid.differs(&goals, joint, goals.len() - 1, |_| 0.0);
                    if !(share <= SHARE && (last <= most || !ramp_ends)) {
                        wrong.push(format!(
                            "{name} on {}, cycle {stop_in}: {} by {share:.3}, {last:.3} at last",
                            robot.name, of.name
                        ));
                    }
                }
            }
        }
        wrong
    });
    assert!(wrong.is_empty(), "{}", told(&wrong));
}
