//! The matrix of real processes: each command that touches torque, each way to disturb it, each phase.
//! The command is the real binary, the robot a virtual one behind a TCP port, and what was commanded is
//! read off the wire by the test itself.
//!
//! A sample runs always; with `GAITWAY_LONG=1` all cells do. The table is printed either way.

mod aloud;
#[path = "matrix/bench.rs"]
mod bench;
#[path = "matrix/judge.rs"]
mod judge;
mod priority;
mod program;
#[path = "matrix/tap.rs"]
mod tap;
#[path = "matrix/wire.rs"]
mod wire;

use aloud::aloud;
use bench::{DUCK, Fault, Job, OP3, Phase, Robot};
use judge::{ended_by_a_stall, faults_of, left_late, misses_goals};
use priority::run_before_others;
use std::sync::{Mutex, PoisonError};

/// One cell at a time: time is real here, and two robots on a small machine are late.
static ALONE: Mutex<()> = Mutex::new(());

const JOBS: [Job; 5] = [Job::Play, Job::Live, Job::Move, Job::Hold, Job::Calibrate];
const PHASES: [Phase; 7] = [
    Phase::Before,
    Phase::Arming,
    Phase::Torque,
    Phase::Approach,
    Phase::Motion,
    Phase::Ramp,
    Phase::Alone,
];
/// Rows of the table; the steps of a panic depend on the phase.
const ROWS: [(&str, Fault); 11] = [
    ("nothing", Fault::Nothing),
    ("SIGINT", Fault::Signal(2)),
    ("SIGTERM", Fault::Signal(15)),
    ("SIGHUP", Fault::Signal(1)),
    ("file size limit", Fault::FileSize),
    ("stdout unread", Fault::Pipe),
    ("stdout closed", Fault::OutClosed),
    ("stderr closed", Fault::ErrClosed),
    ("both /dev/full", Fault::Full),
    ("panic", Fault::Panic("")),
    ("kill -9", Fault::Kill),
];
/// How often a cell is begun again that the host's own lateness ended; nothing else is repeated.
const REPEATS: u32 = 3;
/// Of so many cells at least all but one are seen whole: the others are judged as runs that a stall ended.
const SEEN_WHOLE: u32 = 5;

/// Why there is no such cell, or the faults it is made of.
fn cell(job: Job, row: Fault, phase: Phase) -> Result<Vec<Fault>, &'static str> {
    let none = match (job, phase) {
        (Job::Hold, Phase::Approach | Phase::Motion | Phase::Ramp) => "hold moves nothing",
        (Job::Calibrate, Phase::Arming) => "calibrate arms nothing",
        (Job::Calibrate, Phase::Ramp) => "calibrate moves nothing",
        (Job::Move, Phase::Approach) => "one transition, no approach",
        _ => "",
    };
    if !none.is_empty() {
        return Err(none);
    }
    match (row, phase) {
        (Fault::Panic(_), _) => {
            Ok(steps(job, phase).iter().map(|&step| Fault::Panic(step)).collect())
        }
        (Fault::Nothing, Phase::Alone) => Ok(vec![row]),
        (Fault::Nothing, _) => Err("the twin has no moment"),
        (row, Phase::Alone) if !row.is_lasting() => Err("needs a moment"),
        (row, _) => Ok(vec![row]),
    }
}

/// Where a panic is put in.
fn steps(job: Job, phase: Phase) -> &'static [&'static str] {
    const CYCLE: &[&str] = &["read", "judge", "sink", "advance", "admit", "write"];
    // Once, and whenever it comes there again.
    const AGAIN: &[&str] = &[
        "read", "judge", "sink", "advance", "admit", "write", "read+", "judge+", "sink+",
        "advance+", "admit+", "write+",
    ];
    match (job, phase) {
        (_, Phase::Before) => &["preflight"],
        (Job::Calibrate, Phase::Torque) => &["limp"],
        (Job::Calibrate, Phase::Approach) => &["hand"],
        (Job::Calibrate, Phase::Motion) => &["offset"],
        (Job::Calibrate, _) => &["save"],
        (_, Phase::Arming) => &["arm-registers", "arm-goals"],
        (_, Phase::Torque) => &["arm-torque", "arm-read-back"],
        (_, Phase::Alone) => &["leave"],
        (_, Phase::Motion) => AGAIN,
        (_, _) => CYCLE,
    }
}

#[derive(Default)]
struct Count {
    runs: u32,
    repeated: u32,
    ended_late: u32,
    excused: u32,
    wrong: Vec<String>,
}

impl Count {
    /// Runs and judges one fault of a cell; true if all is right.
    fn judge(&mut self, job: Job, fault: Fault, phase: Phase, robot: Robot) -> bool {
        let place = format!("{} {job:?}, {fault:?}, {phase:?}", robot.name);
        let mut ran = bench::run(job, fault, phase, robot);
        self.runs += 1;
        for _ in 0..REPEATS {
            let Some(words) = ended_by_a_stall(&ran) else { break };
            aloud!("REPEATED {place}: {words}");
            self.repeated += 1;
            ran = bench::run(job, fault, phase, robot);
        }
        self.ended_late += u32::from(ended_by_a_stall(&ran).is_some());
        self.excused += u32::from(left_late(&ran) || misses_goals(&ran));
        if std::env::var_os("GAITWAY_CELL").is_some() {
            aloud!("{place}: {}", judge::on_the_wire(&ran, robot));
        }
        let wrong = faults_of(&ran, job, fault, phase, robot);
        for words in &wrong {
            let reason = ran.report.as_ref().map(|report| report["stop_reason"].to_string());
            aloud!("WRONG {place}: {words}; {}\n{}", reason.unwrap_or_default(), ran.said);
            aloud!("{}", judge::last_questions(&ran));
            self.wrong.push(format!("{place}: {words}"));
        }
        wrong.is_empty()
    }

    fn conclude(self) {
        let Self { runs, repeated, ended_late, excused, wrong } = self;
        aloud!(
            "{runs} runs, {repeated} repeated for a late host, {ended_late} ended by one all the same, \
             in {excused} goals left late, {} wrong",
            wrong.len()
        );
        assert!(wrong.is_empty(), "{wrong:#?}");
        let most = runs.div_ceil(SEEN_WHOLE);
        assert!(ended_late <= most, "the host ended {ended_late} of {runs} runs: nothing was seen");
    }
}

/// The table of one robot; `wanted` says which cells are run.
fn table(robot: Robot, wanted: impl Fn(Job, Fault, Phase) -> bool) {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    run_before_others();
    let mut count = Count::default();
    for job in JOBS {
        aloud!("\n{job:?} on {}", robot.name);
        let head: Vec<String> = PHASES.iter().map(|phase| format!("{phase:?}")).collect();
        aloud!("{:<16}{}", "", head.iter().map(|word| format!("{word:<11}")).collect::<String>());
        let mut why = Vec::new();
        for (name, row) in ROWS {
            let mut line = format!("{name:<16}");
            for phase in PHASES {
                let word = match cell(job, row, phase) {
                    Err(none) => {
                        why.push(none);
                        "-".to_owned()
                    }
                    Ok(_) if !wanted(job, row, phase) => ".".to_owned(),
                    Ok(faults) => {
                        let right = faults.iter().filter(|&&f| count.judge(job, f, phase, robot));
                        let (right, all) = (right.count(), faults.len());
                        let verdict = if right == all { "ok" } else { "WRONG" };
                        if all > 1 {
                            format!("{verdict} {right}/{all}")
                        } else {
                            verdict.to_owned()
                        }
                    }
                };
                line += &format!("{word:<11}");
            }
            aloud!("{line}");
        }
        why.sort_unstable();
        why.dedup();
        aloud!("-: {}", why.join("; "));
    }
    aloud!(
        ".: not in this sample. Streams that are closed or full are so from the start, and SIGINT"
    );
    aloud!(
        "comes at the phase. Ramp: after a SIGINT in the motion. calibrate: approach is a joint in"
    );
    aloud!("somebody's hand, motion the moment in which a servo's EEPROM is open.");
    count.conclude();
}

/// Cells that touch each row and each column of each command once.
fn is_in_sample(job: Job, row: Fault, phase: Phase) -> bool {
    matches!(
        (job, row, phase),
        (Job::Play, Fault::Signal(2), Phase::Torque)
            | (_, Fault::Nothing, _)
            | (Job::Play, Fault::FileSize, Phase::Motion)
            | (Job::Play, Fault::Kill, Phase::Motion)
            | (Job::Play, Fault::Signal(15), Phase::Ramp)
            | (Job::Live, Fault::Signal(1), Phase::Approach)
            | (Job::Live, Fault::Pipe, Phase::Approach)
            | (Job::Live, Fault::Full, Phase::Motion)
            | (Job::Move, Fault::OutClosed, Phase::Motion)
            | (Job::Move, Fault::Signal(15), Phase::Arming)
            | (Job::Move, Fault::Panic(_), Phase::Torque)
            | (Job::Hold, Fault::Signal(_), Phase::Before | Phase::Arming | Phase::Torque)
            | (Job::Hold, Fault::Panic(_), _)
            | (Job::Hold, Fault::Full, Phase::Alone)
            | (Job::Calibrate, Fault::Signal(2), _)
            | (Job::Calibrate, Fault::Panic(_), _)
            | (Job::Calibrate, Fault::ErrClosed, Phase::Motion)
            | (Job::Calibrate, Fault::FileSize, Phase::Motion)
    )
}

fn is_long() -> bool {
    std::env::var_os("GAITWAY_LONG").is_some_and(|value| value == "1")
}

/// A cell named by `GAITWAY_CELL=JOB:ROW:PHASE`, by what it begins with.
fn is_named(job: Job, row: Fault, phase: Phase) -> Option<bool> {
    let named = std::env::var("GAITWAY_CELL").ok()?;
    let cell = format!("{job:?}:{row:?}:{phase:?}");
    let mut parts = named.split(':').zip(cell.split(':'));
    Some(parts.all(|(named, part)| part.starts_with(named)))
}

#[test]
fn every_command_ends_well_whatever_disturbs_it_and_whenever() {
    table(DUCK, |job, row, phase| {
        is_named(job, row, phase).unwrap_or_else(|| is_long() || is_in_sample(job, row, phase))
    });
}

#[test]
fn servos_with_a_watchdog_are_left_without_it_whatever_disturbs_the_command() {
    table(OP3, |job, row, phase| {
        let sample = matches!(
            (job, row, phase),
            (Job::Play, Fault::Signal(2), Phase::Motion)
                | (Job::Hold, Fault::Signal(2), Phase::Torque)
        );
        let named = is_named(job, row, phase);
        job != Job::Calibrate && named.unwrap_or_else(|| is_long() || sample)
    });
}

/// A panic that is put in needs a feature that no release has.
#[test]
fn releases_have_no_way_to_put_a_panic_in() {
    let text = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml"));
    let file: toml::Table = text.expect("the manifest").parse().expect("TOML");
    let features = file["features"].as_table().expect("features");
    assert!(features.contains_key("inject-panic"));
    let enables = |list: &toml::Value| list.as_array().is_some_and(|on| !on.is_empty());
    assert!(!features.values().any(enables), "no feature turns another on: {features:?}");
    let asks = |section: &str| {
        let own = file.get(section).and_then(|all| all.get("gaitway"));
        own.and_then(|own| own.get("features")).map(ToString::to_string).unwrap_or_default()
    };
    assert!(asks("dev-dependencies").contains("inject-panic"));
    assert_eq!(asks("dependencies") + &asks("build-dependencies"), "");
}
