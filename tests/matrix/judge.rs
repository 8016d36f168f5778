//! What must be true of a cell, from the wire and the process.

use crate::bench::{Fault, Job, Phase, Ran, Robot};
use crate::tap::Question;
use gaitway::calibration::Calibration;
use gaitway_sim::Rule;
use serde_json::Value;
use std::time::Duration;

/// How far a joint may run when its host is dead, rad: the bound on tracking.
const BOUND_RAD: f64 = 0.35;
/// A word is seen by the test later than it was sent, by up to so much, s: the test's own wake-up.
const SEEN_LATE_S: f64 = 0.006;

/// Everything that is wrong with what came of a cell; empty is right.
pub fn faults_of(ran: &Ran, job: Job, fault: Fault, phase: Phase, robot: Robot) -> Vec<String> {
    let mut wrong = Vec::new();
    let mut expect = |is_right: bool, words: String| {
        if !is_right {
            wrong.push(words);
        }
    };
    expect(ran.undone == 0, format!("{} faults found no moment", ran.undone));
    if fault == Fault::Kill {
        expect(ran.signal == Some(9), format!("ended by signal {:?}, not 9", ran.signal));
    } else {
        let mut codes = codes(job, fault, phase, ran);
        // Whatever else was to come: a stop for a host that stood still.
        codes.extend(ended_by_a_stall(ran).map(|_| 4));
        let ended = format!("exit code {:?}, signal {:?}, not {codes:?}", ran.code, ran.signal);
        expect(ran.code.is_some_and(|code| codes.contains(&code)), ended);
    }
    if let Fault::Panic(step) = fault {
        let words = format!("put in on purpose at {}", step.trim_end_matches('+'));
        let told = ran.report.as_ref().map(Value::to_string).unwrap_or_default();
        let is_told = told.contains(&words) || ran.report.is_none() && ran.said.contains(&words);
        expect(is_told, "the panic is not in the report".into());
    }
    let stops = !matches!(fault, Fault::FileSize | Fault::Pipe | Fault::Nothing);
    if job != Job::Calibrate && stops && matches!(phase, Phase::Before | Phase::Arming) {
        let on = ran.seen.torque.iter().filter(|(_, on)| *on).count();
        expect(on == 0, format!("torque was switched on {on} times"));
    }
    wrong.extend(torque_faults(ran, job, fault, phase));
    wrong.extend(match fault {
        Fault::Kill => far_goals(ran, robot),
        _ => motion_faults(ran, job, fault, robot),
    });
    wrong.extend(refereed(ran, fault));
    if let Some(fault) = recording_fault(ran, fault) {
        wrong.push(fault);
    }
    if ran.watchdogs > 0 && fault != Fault::Kill && !says(ran, "watchdog may still be on") {
        wrong.push(format!("{} watchdogs are left on and nothing is said", ran.watchdogs));
    }
    wrong
}

/// The last questions of the host and how the robot answered them, as the tap saw it: who was late.
pub fn last_questions(ran: &Ran) -> String {
    let Some(end) = ran.seen.questions.last() else { return "nothing was asked".into() };
    let recent = ran.seen.questions.len().saturating_sub(24);
    let lines = ran.seen.questions[recent..].iter().map(|question| {
        let before_ms = (end.asked - question.asked).as_secs_f64() * 1000.0;
        let took = question.answered.map(|at| (at - question.asked).as_secs_f64() * 1000.0);
        let took = took.map_or("no answer".into(), |took_ms| format!("last after {took_ms:.2} ms"));
        let Question { address, statuses, .. } = question;
        format!("{before_ms:9.2} ms before the last: {address:3}, {statuses:2} answers, {took}")
    });
    lines.collect::<Vec<_>>().join("\n")
}

/// What the referee in the simulator saw, but for what a dead host cannot help.
fn refereed(ran: &Ran, fault: Fault) -> Vec<String> {
    let helpless = fault == Fault::Kill || makes_no_goals(fault) || left_late(ran);
    let seen = ran.violations.iter().filter(|seen| {
        let unheard = seen.rule == Rule::RestAtEnds
            && missed_goals(ran).any(|joint| seen.joint.as_deref() == Some(joint));
        let beyond_help =
            helpless && matches!(seen.rule, Rule::RestAtEnds | Rule::SpeedChange | Rule::GoalStep);
        !unheard && !beyond_help
    });
    seen.map(|seen| format!("referee: {seen}")).collect()
}

/// A panic that keeps coming where goals are made.
fn makes_no_goals(fault: Fault) -> bool {
    matches!(fault, Fault::Panic("advance+" | "admit+" | "write+"))
}

/// Goals that left late, or not at all, or were held back since answers came late: this machine's doing, and
/// said by the command itself.
pub fn left_late(ran: &Ran) -> bool {
    let excepted = ran.report.as_ref().and_then(|report| report["exceptions"].as_array());
    excepted.is_some_and(|all| all.iter().any(|one| LATE.iter().any(|late| one["kind"] == *late)))
}

/// What ended a run that the machine was too slow for: it says so itself, and stops at rest.
pub fn ended_by_a_stall(ran: &Ran) -> Option<String> {
    let report = ran.report.as_ref()?;
    let code = report["stop"]["code"].as_str().unwrap_or_default();
    let reason = report["stop_reason"].as_str().unwrap_or_default();
    let excepted = report["exceptions"].as_array();
    let is_stalled = excepted.is_some_and(|all| all.iter().any(|one| one["kind"] == "stalled"));
    let is_late = matches!(code, "late" | "stalled") || is_stalled;
    (is_late || reason.starts_with("the host stall")).then(|| reason.to_owned())
}

/// True if a joint may not have heard goals.
pub fn misses_goals(ran: &Ran) -> bool {
    missed_goals(ran).next().is_some()
}

/// How a report names that.
const LATE: [&str; 4] = ["sent-late", "held-back", "joint-held-back", "stalled"];

/// Joints that may not have heard goals since their answers came late: where no line is disturbed that is
/// this machine's doing too. It excuses no more than that their first or last two goals differ (R2b).
fn missed_goals(ran: &Ran) -> impl Iterator<Item = &str> {
    let excepted = ran.report.as_ref().and_then(|report| report["exceptions"].as_array());
    let missed = excepted.into_iter().flatten().filter(|one| one["kind"] == "missed-goals");
    missed.filter_map(|one| one["joint"].as_str())
}

fn says(ran: &Ran, words: &str) -> bool {
    ran.said.contains(words) || ran.report.as_ref().is_some_and(|r| r.to_string().contains(words))
}

/// Exit codes that are documented for the cell.
fn codes(job: Job, fault: Fault, phase: Phase, ran: &Ran) -> Vec<i32> {
    let moves = matches!(job, Job::Play | Job::Live | Job::Move);
    // What was held before a signal came is held.
    let held =
        (job == Job::Hold && phase == Phase::Torque && !ran.seen.goals.is_empty()).then_some(0);
    let stopped = |number: i32| std::iter::once(128 + number).chain(held).collect();
    match (fault, phase) {
        // The first reason counts; which of two in the same few cycles came first is not known.
        (Fault::Panic(_), Phase::Ramp) => vec![130, 1],
        // The first signal counts, and a stop for more than a loss.
        (Fault::Signal(_) | Fault::FileSize | Fault::Pipe, Phase::Ramp) => vec![130],
        (Fault::Signal(number), _) => stopped(number),
        (Fault::Panic(_), _) => vec![1],
        (Fault::FileSize, Phase::Before) if moves => vec![1, 3],
        (Fault::FileSize, _) if job == Job::Calibrate => vec![1],
        (Fault::FileSize, _) => vec![3],
        (Fault::Pipe, _) => vec![if job == Job::Calibrate { 0 } else { 3 }],
        (Fault::Full, Phase::Alone) => vec![3],
        (Fault::Full, Phase::Torque) if held.is_some() => vec![130, 3],
        (Fault::OutClosed | Fault::ErrClosed, Phase::Alone) | (Fault::Nothing, _) => vec![0],
        (Fault::OutClosed | Fault::ErrClosed | Fault::Full, _) => stopped(2),
        (Fault::Kill, _) => Vec::new(),
    }
}

/// Torque in the end is what the report says, or what it was.
fn torque_faults(ran: &Ran, job: Job, fault: Fault, phase: Phase) -> Vec<String> {
    let mut wrong = Vec::new();
    let on: Vec<&str> = ran.torque.iter().filter(|(_, on)| *on).map(|(n, _)| n.as_str()).collect();
    if job == Job::Calibrate {
        // Torque goes off only, and a calibration is there whole or not at all.
        if ran.seen.torque.iter().any(|(_, on)| *on) || !ran.seen.goals.is_empty() {
            wrong.push("something was switched on".into());
        }
        let file = ran.folder.join("calibrated.toml");
        let is_done = ran.code == Some(0) || ran.code == Some(3);
        if file.exists() != is_done && !(fault == Fault::Kill && phase == Phase::Alone) {
            wrong.push(format!("the calibration is there: {}", file.exists()));
        }
        for ending in ["toml", "toml.partial"] {
            let file = ran.folder.join(format!("calibrated.{ending}"));
            if let (true, Err(e)) = (file.exists(), Calibration::read(&file)) {
                wrong.push(format!("calibrated.{ending} is half written: {e}"));
            }
        }
        let opened = if fault == Fault::Kill && phase == Phase::Motion { 1 } else { 0 };
        if ran.locks_open > opened {
            wrong.push(format!("{} EEPROM locks are open", ran.locks_open));
        }
        return wrong;
    }
    let Some(left) = ran.report.as_ref().and_then(|report| report["left"].as_object()) else {
        return wrong;
    };
    let holding: Vec<&str> =
        left["holding"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
    let is_same = match job {
        Job::Move => holding.len() == on.len(),
        _ => holding == on,
    };
    if !is_same {
        wrong.push(format!("said to hold: {holding:?}, but torque is on in {on:?}"));
    }
    if job != Job::Move && on.len() != ran.torque.len() {
        wrong.push(format!("torque is on in {} of {}", on.len(), ran.torque.len()));
    }
    wrong
}

/// A host that died: no goal is further from its joint than the bound and one step.
fn far_goals(ran: &Ran, robot: Robot) -> Vec<String> {
    let Some((_, last)) = ran.seen.goals.last() else { return Vec::new() };
    let before = ran.seen.goals.iter().rev().nth(1).map_or(last, |(_, goals)| goals);
    let mut wrong = Vec::new();
    for (id, goal) in last {
        let Some(present) = ran.seen.present.get(id) else { continue };
        let step = before.get(id).map_or(0, |before| (goal - before).abs());
        let most = (BOUND_RAD / robot.rad_per_count()).ceil() as i64 + step;
        if (goal - present).abs() > most {
            wrong.push(format!("ID {id}: the last goal is {} counts away", (goal - present).abs()));
        }
    }
    wrong
}

/// Goals end at rest, and on the way there no speed changes by more than a stop may: twice the
/// joint's acceleration, as seen by somebody who sees each goal a little late.
fn motion_faults(ran: &Ran, job: Job, fault: Fault, robot: Robot) -> Vec<String> {
    let goals = &ran.seen.goals;
    if let [.., (_, before), (_, last)] = goals.as_slice()
        && before != last
    {
        return vec!["the last two goals differ".into()];
    }
    let mut wrong = Vec::new();
    let excepted = ran.report.as_ref().and_then(|report| report["exceptions"].as_array());
    let kinds = excepted.into_iter().flatten().map(|one| &one["kind"]);
    let kinds: Vec<&Value> = kinds.filter(|kind| *kind != "missed-goals").collect();
    // Goals that the host's own stall kept back are counted by themselves.
    let is_broken = |kind: &Value| makes_no_goals(fault) && kind == "goals-broke";
    if kinds.iter().any(|kind| !LATE.iter().any(|late| *kind == *late) && !is_broken(kind)) {
        wrong.push(format!("exceptions: {excepted:?}"));
    }
    if !kinds.is_empty() {
        return wrong;
    }
    let ids: Vec<u8> = goals.first().map(|(_, g)| g.keys().copied().collect()).unwrap_or_default();
    for id in ids {
        let (_, acceleration_rad_s2) = robot.limits(id, job);
        let path: Vec<_> = goals.iter().filter_map(|(at, g)| Some((*at, *g.get(&id)?))).collect();
        let mut before: Option<(f64, f64, f64)> = None;
        for two in path.windows(2) {
            let seconds = (two[1].0 - two[0].0).as_secs_f64();
            let counts = (two[1].1 - two[0].1) as f64;
            // The lowest and highest speed that this may have been.
            let speeds = [-1.0, 1.0].into_iter().flat_map(|rounding| {
                [-SEEN_LATE_S, SEEN_LATE_S].map(|late_s| {
                    let longest = seconds.max(robot.period().as_secs_f64() / 2.0);
                    (counts + rounding) * robot.rad_per_count() / (longest + late_s).max(0.004)
                })
            });
            let (low, high) = speeds.fold((f64::MAX, f64::MIN), |(l, h), v| (v.min(l), v.max(h)));
            if let Some((low_before, high_before, seconds_before)) = before {
                let gained = (low - high_before).max(low_before - high).max(0.0);
                let time_s = (seconds + seconds_before) / 2.0 + SEEN_LATE_S;
                let most = 2.0 * acceleration_rad_s2 * time_s;
                if gained > most {
                    wrong.push(format!(
                        "ID {id}: its goal's speed changes by {gained:.2} rad/s in {:.0} ms, at most \
                         {most:.2}",
                        time_s * 1e3
                    ));
                    break;
                }
            }
            before = Some((low, high, seconds));
        }
    }
    wrong
}

/// What was recorded is readable by `gaitway info`.
fn recording_fault(ran: &Ran, fault: Fault) -> Option<String> {
    let file = ran.folder.join("run.mcap");
    if !file.exists() {
        return None;
    }
    let output = crate::program::gaitway().arg("info").arg(&file).output();
    let output = output.expect("the command");
    // Of a file that was not allowed to begin there is nothing to be read.
    let is_empty = std::fs::metadata(&file).map_or(0, |file| file.len()) == 0;
    let is_right = output.status.code() == Some(0) || is_empty && fault == Fault::FileSize;
    (!is_right).then(|| {
        format!("`gaitway info` on the recording: {}", String::from_utf8_lossy(&output.stderr))
    })
}

/// The highest speed of a goal when the last fault was put in, rad/s, and how far the last goals led
/// before they stood, counts.
pub fn on_the_wire(ran: &Ran, robot: Robot) -> String {
    let goals = &ran.seen.goals;
    let step = |at: usize| -> Option<(f64, i64)> {
        let (from, to) = (goals.get(at.checked_sub(1)?)?, goals.get(at)?);
        let steps = to.1.iter().map(|(id, goal)| (goal - from.1.get(id).unwrap_or(goal)).abs());
        Some(((to.0 - from.0).as_secs_f64(), steps.max().unwrap_or(0)))
    };
    let at = ran.seen.put_in.last().map_or(goals.len(), |&count| count.saturating_sub(1));
    let speed = step(at).map_or(0.0, |(s, counts)| counts as f64 * robot.rad_per_count() / s);
    let steps: Vec<i64> = (1..goals.len()).filter_map(|at| Some(step(at)?.1)).collect();
    let last = steps.len().saturating_sub(10);
    format!(
        "{} goal writes; {speed:.2} rad/s at the fault; last steps {:?}",
        steps.len(),
        &steps[last..]
    )
}

impl Robot {
    fn period(self) -> Duration {
        Duration::from_secs(1) / self.rate_hz
    }

    /// Highest speed and acceleration of the goals of a servo.
    fn limits(self, id: u8, job: Job) -> (f64, f64) {
        if job == Job::Move {
            // 30 deg/s are 30 % of the limit, which is reached in a quarter of a second.
            let velocity = 30.0_f64.to_radians() / 0.3;
            return (velocity, velocity / 0.25);
        }
        let file = gaitway_profiles::robot(self.name).expect("a shipped robot");
        let joint = file.joints.iter().find(|joint| joint.id == id).expect("a joint");
        (joint.velocity_rad_s, joint.acceleration_rad_s2)
    }

    /// Both servos count 4096 to a turn.
    fn rad_per_count(self) -> f64 {
        std::f64::consts::TAU / 4096.0
    }
}
