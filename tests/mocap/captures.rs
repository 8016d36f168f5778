//! Real captures on a virtual op3: done, or refused with the cause named.
//!
//! Reads every third .bvh, or with `GAITWAY_LONG` every one, below the folder named by `GAITWAY_CAPTURES`; says loudly if there is none.

use crate::aloud::aloud;
use crate::captured::{bvh_files, captures};
use gaitway::job::Nobody;
use gaitway::job::play::{Options, PlayOrder, play};
use gaitway::job::report::{JointReport, Outcome, PlayReport};
use gaitway::job::source::MotionOrder;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

fn play_on_op3(file: &Path) -> PlayReport {
    let file = file.to_str().expect("a UTF-8 path");
    let order = PlayOrder {
        motion: MotionOrder::of(file),
        robot: "op3".to_owned(),
        buses: vec!["sim".parse().expect("an address")],
        calibration: None,
        seed: 0,
        options: Options::default(),
    };
    play(&order, &Nobody).report
}

/// What comes of each file, in their order, on as many processors as there are.
fn all_on_op3(files: &[PathBuf]) -> Vec<PlayReport> {
    let next = AtomicUsize::new(0);
    let work = || {
        let mut done = Vec::new();
        loop {
            let at = next.fetch_add(1, Ordering::Relaxed);
            let Some(file) = files.get(at) else { return done };
            done.push((at, play_on_op3(file)));
        }
    };
    let mut all: Vec<(usize, PlayReport)> = thread::scope(|scope| {
        let count = thread::available_parallelism().map_or(1, usize::from);
        let workers: Vec<_> = (0..count).map(|_| scope.spawn(work)).collect();
        workers.into_iter().flat_map(|worker| worker.join().expect("no panic")).collect()
    });
    all.sort_by_key(|(at, _)| *at);
    all.into_iter().map(|(_, report)| report).collect()
}

fn most_clipped(report: &PlayReport) -> Option<&JointReport> {
    report.joints.iter().max_by(|a, b| a.clipped_share.total_cmp(&b.clipped_share))
}

#[test]
fn captures_are_played_safely_or_refused_with_their_cause() {
    let Some(folder) = captures() else { return };
    let every = if std::env::var_os("GAITWAY_LONG").is_some() { 1 } else { 3 };
    let files: Vec<PathBuf> = bvh_files(&folder).into_iter().step_by(every).collect();
    assert!(!files.is_empty(), "no .bvh file below {}", folder.display());
    let mut good = 0;
    let mut broken = Vec::new();
    aloud!("{:<58} {:>7} {:<14} {:>8} {:<14}", "capture", "factor", "joint", "clipped", "joint");
    for (file, report) in files.iter().zip(all_on_op3(&files)) {
        let name = file.strip_prefix(&folder).unwrap_or(file).display().to_string();
        let reason = report.stop_reason.clone().unwrap_or_default();
        let Some(clipped) = most_clipped(&report).filter(|_| report.outcome == Outcome::Done)
        else {
            aloud!("{name:<58} {:?}: {}", report.outcome, reason.lines().next().unwrap_or(""));
            if report.outcome != Outcome::Refused || reason.is_empty() {
                broken.push(format!("{name}: {:?}: {reason}", report.outcome));
            }
            continue;
        };
        let fits = report.retime_factor <= 5.0 && clipped.clipped_share <= 0.2;
        good += usize::from(fits);
        aloud!(
            "{name:<58} {:>7.2} {:<14} {:>6.1} % {:<14}{}",
            report.retime_factor,
            report.retime_joint.as_deref().unwrap_or("-"),
            100.0 * clipped.clipped_share,
            clipped.name,
            if fits { "" } else { " <" }
        );
        let violations = report.referee.map(|referee| referee.violations).unwrap_or_default();
        broken.extend(violations.into_iter().map(|violation| format!("{name}: {violation}")));
        let ends = report.max_start_velocity_rad_s.max(report.max_end_velocity_rad_s);
        if !(ends <= 1e-9) {
            broken.push(format!("{name}: starts or ends with {ends} rad/s"));
        }
    }
    let all = files.len();
    aloud!("{good} of {all} files within factor 5 and 20 % clipped");
    assert!(broken.is_empty(), "{}", broken.join("\n"));
    assert!(10 * good >= 9 * all, "only {good} of {all} files fit the robot");
}
