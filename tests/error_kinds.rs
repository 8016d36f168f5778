//! Refusals that a program can match: each has its kind, whatever its words.

mod program;

use gaitway::{Error, ErrorKind, MotionOrder, Options, Outcome};

fn folder() -> std::path::PathBuf {
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("error-kinds");
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("a folder");
    folder
}

/// Kind of the refusal.
fn kind<T>(refused: Result<T, Error>) -> ErrorKind {
    refused.err().expect("a refusal").kind
}

#[test]
fn each_refusal_has_the_kind_that_a_program_would_look_for() {
    let folder = folder();
    let file = |name: &str, text: &str| {
        let path = folder.join(name);
        std::fs::write(&path, text).expect("a file");
        path.display().to_string()
    };
    let op3 = || gaitway::open("op3", "sim").expect("a virtual robot");
    let motion = |motion: &str| kind(op3().motion(motion));
    let order = |order: MotionOrder| kind(op3().motion_of(&order));
    let of = |text: &str| MotionOrder::of(text);
    // Robots and lines.
    assert_eq!(kind(gaitway::open("optimus", "sim")), ErrorKind::Unknown);
    let broken = file("broken.toml", "schema = ");
    assert_eq!(kind(gaitway::open(&broken, "sim")), ErrorKind::Malformed);
    assert_eq!(kind(gaitway::open("op3", "telepathy")), ErrorKind::Unknown);
    assert_eq!(kind(gaitway::open("op3", "serial:/dev/ttyNOPE0")), ErrorKind::Absent);
    // Motions.
    assert_eq!(motion("moonwalk"), ErrorKind::Unknown);
    assert_eq!(motion("nowhere.bvh"), ErrorKind::Absent);
    assert_eq!(motion(&file("dance.bvh", "HIERARCHY")), ErrorKind::Malformed);
    assert_eq!(motion(&file("table.csv", "1,2,3\n")), ErrorKind::Malformed);
    let strange = file("strange.csv", "time_s,tail_rad\n0,0\n0.4,0\n");
    assert_eq!(motion(&strange), ErrorKind::Unknown);
    let far = file("far.csv", "time_s,head_pan_rad\n0,0\n0.4,9\n");
    assert_eq!(motion(&far), ErrorKind::OutsideLimits);
    let tail = MotionOrder { only: vec!["tail".to_owned()], ..of("bow") };
    assert_eq!(order(tail), ErrorKind::Unknown);
    // What is there already, and a rate that the line does not carry.
    let mut rig = op3();
    let bow = rig.motion("bow").expect("an action");
    let record = Some(folder.join("broken.toml"));
    let taken = rig.play(&bow, Options { record, ..Options::default() });
    assert_eq!(kind(taken), ErrorKind::Exists);
    let fast = rig.play(&bow, Options { rate_hz: Some(1000.0), ..Options::default() });
    assert_eq!(kind(fast), ErrorKind::TooSlow);
}

#[test]
fn a_report_of_a_refusal_has_its_kind_beside_the_words() {
    let output = crate::program::gaitway()
        .args(["play", "moonwalk", "--robot", "op3", "--bus", "sim", "--json"])
        .output()
        .expect("the command");
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).expect("a report");
    assert_eq!((&report["outcome"], &report["refusal"]), (&"refused".into(), &"unknown".into()));
    let mut rig = gaitway::open("op3", "sim").expect("a virtual robot");
    let bow = rig.motion("bow").expect("an action");
    let report = rig.play(&bow, Options::default()).expect("played");
    assert_eq!((report.outcome, report.refusal), (Outcome::Done, None));
}
