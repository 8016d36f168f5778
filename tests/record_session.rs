//! A person's session, from start to a finished database folder: `gaitway record --session` behind a
//! real pseudo-terminal, with a virtual person who wears virtual sensors. Time is real here.

mod aloud;
#[allow(dead_code)]
#[path = "record_session/dialogue.rs"]
mod dialogue;
#[allow(dead_code)]
#[path = "record_session/guided.rs"]
mod guided;
#[allow(dead_code)]
#[path = "record_session/person.rs"]
mod person;
mod program;

use aloud::aloud;
use dialogue::Dialogue;
use gaitway::action::vocabulary;
use gaitway::body::{Dof, JointAngles, Segment};
use gaitway::recording::sensor_series;
use gaitway::session::manifest::Manifest;
use gaitway::session::{DeviceCheck, SessionFile, TrialFile, Verdict};
use gaitway_sim::imu::{BodyMotion, ImuDoor, ImuErrors, ImuWire, Mount, Stage, VirtualImu};
use guided::{calibrated, passes, raises_an_arm, read, stand_and_type, stand_until};
use person::{Act, Person, STATURE_M};
use program::json;
use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::path::Path;
use std::process::Stdio;
use std::sync::Arc;

const PLAN: &str = r#"
still_s = 1.5

[[action]]
name = "wave-r"
repetitions = 2

[[action]]
name = "reach-up"
explain = "Reach up with the right hand, straight, and lower it."
repetitions = 1
props = "a lamp"
"#;

fn waving() -> Act {
    let wave = vocabulary::find("wave-r").and_then(|action| action.perform()).expect("shipped");
    Act::Action(Arc::new(wave))
}

/// Session and subject, with answers that nobody can use among them.
fn set_up(operator: &mut Dialogue) {
    operator.answer("name of the session", "");
    operator.answer("operator", "Ada");
    operator.answer("place", "");
    operator.answer("remarks", "a rehearsal");
    operator.answer("id of the subject", "Anna B");
    operator.expect("! not an id");
    operator.answer("id of the subject", "s01");
    operator.answer("gender", "f");
    operator.answer("age", "thirty");
    operator.expect("not a number");
    operator.answer("age", "31");
    operator.answer("stature", "170");
    operator.expect("not a plausible measure");
    operator.answer("stature", "");
    operator.answer("stature", "170 cm");
    operator.answer("mass", "60");
    operator.answer("left leg length", "40 cm");
    operator.answer("Is it right?", "");
    operator.answer("left leg length", ".");
    operator.answer("remarks: actions", "");
}

/// Lies still, after having been moved.
fn devices(operator: &mut Dialogue, person: &Person) {
    person.does(raises_an_arm());
    passes(0.5);
    operator.answer("Do they lie still?", "");
    operator.expect("REPEAT");
    operator.expect("it moved");
    person.stands();
    operator.answer("Not every sensor is good", "");
    passes(0.6);
    operator.answer("Do they lie still?", "");
    operator.expect("written: calibration/device-02.toml");
}

#[test]
fn a_session_ends_as_a_finished_database_folder_whatever_happens_in_between() {
    let folder = crate::program::folder("record-session");
    std::fs::write(folder.join("plan.toml"), PLAN).expect("a plan");
    let worn = [Segment::Torso, Segment::RightUpperArm, Segment::RightForearm];
    let person = Person::wearing(&worn);
    let lab = folder.join("lab");

    // Set-up, and an operator who goes for lunch.
    let mut begin: Vec<String> =
        ["--session", "lab", "--plan", "plan.toml"].map(str::to_owned).to_vec();
    begin.extend(person.sources());
    let mut operator = Dialogue::start(&folder, &begin, &person);
    set_up(&mut operator);
    operator.answer("Do they lie still?", "perhaps");
    operator.expect("not one of the answers");
    operator.answer("Do they lie still?", "q");
    operator.expect("to go on: gaitway record --session lab");
    assert_eq!(operator.ends(), Some(4));

    // Calibration, a trial that is kept, one that is not, and a computer that loses power.
    let mut operator = Dialogue::start(&folder, &["--session".into(), "lab".into()], &person);
    operator.expect("going on where it was");
    devices(&mut operator, &person);
    let second = crate::program::gaitway()
        .current_dir(&folder)
        .args(["record", "--session", "lab"])
        .output()
        .expect("the command");
    assert!(
        String::from_utf8_lossy(&second.stderr)
            .contains("a session is already running in this folder")
    );
    calibrated(&mut operator, &person);
    kept_trial(&mut operator, &person);
    retaken_trial(&mut operator, &person);
    cut_off_trial(&mut operator, &person);
    operator.dies();

    // A recording that had only just been begun.
    std::fs::write(lab.join("trials/wave-r-04.mcap"), []).expect("written");

    // It goes on where it was.
    let mut operator = Dialogue::start(&folder, &["--session".into(), "lab".into()], &person);
    operator.expect("Trial wave-r-03 was recorded and not judged");
    operator.expect("it was cut off");
    // What is cut off is not kept unless somebody says so.
    operator.answer("keep it?", "k");
    operator.answer("good repetitions in it [Enter: 1", "");
    operator.answer("notes", "power was cut");
    operator.answer("props", "");
    operator.expect("Trial wave-r-04 was recorded and not judged");
    operator.answer("keep it?", "k");
    operator.expect("not one of the answers");
    operator.answer("keep it?", "r");
    operator.answer("what was wrong", "there is nothing in it");
    last_trial(&mut operator, &person);
    operator.expect("finished: 5 trials, 3 kept, 3 good repetitions");
    assert_eq!(operator.ends(), Some(0));

    // There is nothing left to be done, and nothing is asked.
    let mut operator = Dialogue::start(&folder, &["--session".into(), "lab".into()], &person);
    operator.expect("finished already");
    assert_eq!(operator.ends(), Some(0));
    check_folder(&lab);
    check_angles(&lab);
    check_corpus(&folder, &lab);
}

#[test]
fn a_session_can_be_interrupted_or_told_by_a_script_and_keeps_what_was_done() {
    let folder = crate::program::folder("record-session-script");
    let person = Person::wearing(&[Segment::Torso]);
    let mut begin: Vec<String> = ["--session", "lab"].map(str::to_owned).to_vec();
    begin.extend(person.sources());
    // Ctrl-C in the middle of the set-up: nothing is half there.
    let mut operator = Dialogue::start(&folder, &begin, &person);
    operator.answer("name of the session", "first");
    operator.expect("operator (who leads it)");
    operator.interrupts();
    operator.expect("to go on: gaitway record --session lab");
    assert_eq!(operator.ends(), Some(130));
    assert!(!folder.join("lab/session.toml").exists());

    // A script that ends early ends the session, to be gone on with.
    person.is_listened_to();
    let script =
        "first\n\n\n\nbow nonsense\n\nbow walk lift-box\nLift the box.\ns01\n\n\n1.8\n.\n\n";
    let told = |arguments: &[String], script: &str| {
        std::fs::write(folder.join("script"), script).expect("a script");
        let output = crate::program::gaitway()
            .current_dir(&folder)
            .arg("record")
            .args(arguments)
            .stdin(std::fs::File::open(folder.join("script")).expect("the script"))
            .output()
            .expect("the command");
        let said = String::from_utf8_lossy(&output.stdout).into_owned();
        (output.status.code(), said + &String::from_utf8_lossy(&output.stderr))
    };
    let (code, said) = told(&begin, script);
    assert_eq!(code, Some(4), "{said}");
    assert!(said.contains("the vocabulary has no such action"), "{said}");
    let session: SessionFile = read(&folder.join("lab/session.toml"));
    let names: Vec<&str> = session.plan.actions.iter().map(|a| a.name.as_str()).collect();
    assert_eq!((names, session.plan.repetitions), (vec!["bow", "walk", "lift-box"], 10));
    assert_eq!(session.plan.actions[2].explain, "Lift the box.");
    assert!(folder.join("lab/subjects/s01.toml").exists());

    // Other sensors than it was begun with, or none that is worn, are refused.
    let go_on = |source: &str| told(&["--session".into(), "lab".into(), source.into()], "");
    let (code, said) = go_on("head=imu:arduino-csv@/dev/null");
    assert!(code == Some(1) && said.contains("begun with other sensors"), "{said}");
    let (code, said) = go_on("imu:arduino-csv@/dev/null");
    assert!(code == Some(1) && said.contains("which segment wears this sensor"), "{said}");
    // What would be ignored is refused: the session keeps what it was begun with.
    std::fs::write(folder.join("other.toml"), "[[action]]\nname = \"walk\"\n").expect("a plan");
    for other in ["--plan=other.toml", "--magnetometer", "--wear=head=tracker-000001-0"] {
        let (code, said) = go_on(other);
        assert!(
            code == Some(1) && said.contains("the session was begun with other settings"),
            "{said}"
        );
        assert!(said.contains(other.split('=').next().unwrap_or(other)), "{said}");
    }
    // The same plan is no other one.
    let same = "[[action]]\nname = \"bow\"\n[[action]]\nname = \"walk\"\n\
        [[action]]\nname = \"lift-box\"\nexplain = \"Lift the box.\"\n";
    std::fs::write(folder.join("same.toml"), same).expect("a plan");
    let (code, said) = go_on("--plan=same.toml");
    assert!(code == Some(4) && said.contains("going on where it was"), "{said}");
    a_session_of_which_a_document_is_wanted_or_nothing_is_seen(&folder);
    // Refused is a folder that is somebody else's.
    let (code, said) = told(&["--session".into(), ".".into(), begin[2].clone()], "");
    assert!(code == Some(1) && said.contains("holds something else"), "{said}");
    let (code, said) = told(&["--session".into(), "new".into()], "");
    assert!(code == Some(1) && said.contains("a session needs sensors"), "{said}");
    assert!(!folder.join("new").exists(), "a name mistyped makes no folder");
    // All ports that are not there are told, and nothing is left of the try.
    let two = ["torso=imu:arduino-csv@/dev/no-a", "head=imu:arduino-csv@/dev/no-b"];
    let try_in =
        |lab: &str| told(&["--session".into(), lab.into(), two[0].into(), two[1].into()], "");
    let (code, said) = try_in("new");
    assert!(code == Some(1) && said.contains("/dev/no-a") && said.contains("/dev/no-b"), "{said}");
    assert!(!folder.join("new").exists());
    std::fs::create_dir(folder.join("empty")).expect("a folder");
    assert_eq!(try_in("empty").0, Some(1));
    let left = std::fs::read_dir(folder.join("empty")).expect("it stays").count();
    assert_eq!(left, 0, "a folder that was there is as it was");
    person.is_left();
}

/// Standard output is the document's, however the session ends; and nobody is asked what they do not see.
fn a_session_of_which_a_document_is_wanted_or_nothing_is_seen(folder: &Path) {
    let record = |more: &[&str]| {
        let mut record = crate::program::gaitway();
        record.current_dir(folder).args(["record", "--session", "lab"]).args(more);
        record
    };
    let output = record(&["--json"]).stdin(Stdio::null()).output().expect("the command");
    let report = json(&output);
    assert_eq!((&report["outcome"], output.status.code()), (&"stopped".into(), Some(4)));
    assert_eq!((&report["session"], &report["trials"]), (&"lab".into(), &0.into()), "{report}");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(
        said.contains("going on where it was") && said.contains("Do they lie still?"),
        "{said}"
    );

    // A report takes the place of another where that is asked for, and the session is as it was.
    let begun = std::fs::read(folder.join("lab/session.toml")).expect("a session");
    for (more, code) in [(None, 4), (None, 1), (Some("--force"), 4)] {
        let mut record = record(&["--report", "stopped.json"]);
        let output = record.args(more).stdin(Stdio::null()).output().expect("the command");
        assert_eq!(output.status.code(), Some(code), "{}", crate::program::words(&output));
    }
    assert_eq!(std::fs::read(folder.join("lab/session.toml")).expect("the session"), begun);

    let full = std::fs::OpenOptions::new().write(true).open("/dev/full").expect("there");
    let mut unseen = record(&[]);
    unseen.stdin(Stdio::piped()).stdout(full).stderr(Stdio::piped());
    let mut unseen = unseen.spawn().expect("the command");
    // Somebody who could answer, and waits.
    let answers = unseen.stdin.take();
    let output = unseen.wait_with_output().expect("it ends");
    drop(answers);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("a question could not be asked: the session ends here"), "{said}");
    assert_eq!(output.status.code(), Some(4), "{said}");
}

/// Trackers name themselves; who wears which is said.
#[test]
fn slimevr_trackers_are_worn_as_was_said() {
    let folder = crate::program::folder("record-session-trackers");
    let free = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).and_then(|socket| socket.local_addr());
    let port = free.expect("a port").port();
    let motion = BodyMotion::still(60.0).expect("a motion");
    let (mount, errors) = (Mount::default(), ImuErrors::default());
    let imu = VirtualImu::new(motion, mount, errors, ImuWire::SlimeVr, 100.0).expect("a sensor");
    let server = SocketAddr::from((Ipv4Addr::LOCALHOST, port));
    let mac = [2, 0, 0, 0, 0, 1];
    let _tracker = ImuDoor::open_slimevr(&Stage::default(), imu, server, mac).expect("a tracker");
    let source = format!("imu:slimevr@udp:127.0.0.1:{port}");
    let nobody = Person::wearing(&[]);
    let refused = crate::program::gaitway()
        .current_dir(&folder)
        .args(["record", "--session", "lab", &source])
        .output()
        .expect("the command");
    let said = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(said.contains("--wear"), "{said}");

    std::fs::write(folder.join("plan.toml"), PLAN).expect("a plan");
    let begin =
        ["--session", "lab", "--plan", "plan.toml", &source, "--wear", "head=tracker-000001-0"];
    let mut operator = Dialogue::start(&folder, &begin.map(str::to_owned), &nobody);
    for question in ["name of the session", "operator", "place", "remarks"] {
        operator.answer(question, "");
    }
    operator.answer("id of the subject", "s01");
    for (question, answer) in [("gender", ""), ("age", "."), ("stature", "1.7"), ("remarks", "")] {
        operator.answer(question, answer);
    }
    // It looks for its server twice a second.
    passes(1.5);
    operator.answer("Do they lie still?", "");
    operator.expect("head ");
    operator.expect("samples");
    // What is typed before a question is asked is no answer to it.
    operator.answer("Are they on?", "q");
    operator.ends();
    let session: SessionFile = read(&folder.join("lab/session.toml"));
    assert_eq!(session.wear["tracker-000001-0"], "head");
}

/// A tap, a good repetition and a bad one.
fn kept_trial(operator: &mut Dialogue, person: &Person) {
    operator.expect("0 of 2 good repetitions");
    operator.answer("Explain it and show it", "");
    operator.answer("Let it be practised", "");
    operator.answer("Record wave-r-01?", "");
    stand_until(operator, "RECORDING wave-r-01");
    passes(0.8);
    person.is_tapped();
    passes(0.4);
    person.does(waving());
    passes(3.2);
    operator.say("");
    operator.expect("1 good, 0 bad");
    operator.say("x");
    operator.expect("1 good, 1 bad");
    // How it goes stands below what is said, what is typed as well.
    operator.expect("a dot ends it; last mark at");
    operator.expect("torso");
    operator.expect("/s");
    operator.press("the phone");
    operator.expect("note: the phone");
    operator.say(" rang");
    operator.expect("1 good, 1 bad; note: the phone rang");
    person.stands();
    passes(0.6);
    operator.say(".");
    operator.expect("one time base");
    operator.answer("keep it?", "maybe");
    operator.expect("not one of the answers");
    operator.answer("keep it?", "k");
    operator.answer("good repetitions in it [Enter: 1", "many");
    operator.expect("not a number of repetitions");
    operator.answer("good repetitions in it", "");
    operator.answer("notes", "the first");
    operator.answer("props", "");
}

fn retaken_trial(operator: &mut Dialogue, person: &Person) {
    operator.expect("1 of 2 good repetitions");
    operator.answer("Record wave-r-02?", "");
    person.stands();
    stand_until(operator, "RECORDING wave-r-02");
    passes(0.3);
    operator.say(".");
    operator.answer("keep it?", "r");
    operator.answer("what was wrong", "stumbled");
}

fn cut_off_trial(operator: &mut Dialogue, person: &Person) {
    operator.expect("1 of 2 good repetitions");
    operator.answer("Record wave-r-03?", "");
    // A dot that came before the trial does not end it.
    stand_and_type(operator, &["."], "RECORDING wave-r-03");
    person.does(waving());
    passes(3.0);
    operator.say("");
    operator.expect("1 good, 0 bad");
    // A second is what may be lost.
    passes(1.2);
}

fn last_trial(operator: &mut Dialogue, person: &Person) {
    person.stands();
    operator.expect("reach-up, s01: 0 of 1 good repetition");
    operator.expect("props: a lamp");
    operator.answer("Explain it and show it", "");
    operator.answer("Let it be practised", "");
    operator.answer("Record reach-up-01?", "");
    stand_until(operator, "RECORDING reach-up-01");
    person.does(raises_an_arm());
    passes(2.35);
    person.stands();
    operator.say("");
    operator.expect("1 good");
    passes(0.6);
    operator.say(".");
    operator.answer("keep it?", "");
    operator.answer("good repetitions in it", "");
    operator.answer("notes", "");
    operator.answer("props", "");
}

fn check_folder(lab: &Path) {
    let first: DeviceCheck = read(&lab.join("calibration/device-01.toml"));
    let second: DeviceCheck = read(&lab.join("calibration/device-02.toml"));
    assert!(!first.passed && second.passed && second.sensors.len() == 3);
    let trial = |name: &str| read::<TrialFile>(&lab.join(format!("trials/{name}.toml")));
    let kept = trial("wave-r-01");
    assert_eq!((kept.verdict, kept.good_repetitions), (Verdict::Keep, 1));
    assert_eq!(kept.notes, "the first");
    assert!(kept.closed);
    assert_eq!(kept.taps.len(), 1, "{:?}", kept.taps);
    assert_eq!(kept.taps[0].offset_s.len(), 3);
    let retaken = trial("wave-r-02");
    assert_eq!((retaken.verdict, retaken.counted()), (Verdict::Retake, 0));
    assert_eq!(retaken.notes, "stumbled");
    assert!(lab.join("trials/wave-r-02.mcap").exists(), "it is kept, and marked");
    let cut = trial("wave-r-03");
    assert!(!cut.closed && cut.verdict == Verdict::Keep);
    let series = sensor_series(&lab.join("trials/wave-r-01.mcap")).expect("read");
    let marks: Vec<&str> = series.markers.iter().map(|marker| marker.text.as_str()).collect();
    assert_eq!(marks, ["repetition", "repetition, bad", "the phone rang"]);

    let manifest: Manifest = read(&lab.join("manifest.toml"));
    assert_eq!((manifest.session.as_str(), manifest.operator.as_str()), ("lab", "Ada"));
    assert_eq!(manifest.choices.range_of_subjects, "s01, f, 31 years, 1.7 m, 60 kg");
    let verdicts: Vec<_> = manifest.trials.iter().map(|t| (t.name.as_str(), t.verdict)).collect();
    assert_eq!(
        verdicts,
        [
            ("reach-up-01", Verdict::Keep),
            ("wave-r-01", Verdict::Keep),
            ("wave-r-02", Verdict::Retake),
            ("wave-r-03", Verdict::Keep),
            ("wave-r-04", Verdict::Retake),
        ]
    );
    for trial in &manifest.trials {
        assert_eq!(trial.no_angles, None);
        assert_eq!(trial.angles.len(), if trial.verdict == Verdict::Keep { 2 } else { 0 });
        for file in trial.angles.iter().chain(&trial.recordings) {
            assert!(lab.join(file).exists(), "{file}");
        }
    }
    assert!(manifest.trials[0].not_worn.contains(&"left_thigh".to_owned()));
    assert_eq!(manifest.actions[0].good_repetitions, 2);
    for entry in std::fs::read_dir(lab.join("trials")).expect("trials") {
        let name = entry.expect("an entry").file_name();
        assert!(!name.to_string_lossy().ends_with(".new"), "{name:?}");
    }
}

/// The session and every capture there is in one corpus: asked, labelled, exported, looked at.
fn check_corpus(folder: &Path, lab: &Path) {
    let corpus = folder.join("moves").display().to_string();
    let run = |arguments: &[&str]| {
        let ran = crate::program::gaitway().args(arguments).arg("--json").output();
        json(&ran.expect("the command"))
    };
    run(&["corpus", "new", &corpus]);
    let lab = lab.display().to_string();
    let added = run(&["corpus", "add", &corpus, &lab, "--consent", "given"]);
    assert_eq!(added["added"], 3, "those that were kept: {added:#}");
    let mut trials = 3;
    match std::env::var("GAITWAY_CAPTURES") {
        Err(_) => aloud!("SKIPPED: no captures beside the session: GAITWAY_CAPTURES names none"),
        Ok(captures) => {
            let arguments = ["corpus", "add", &corpus, &captures, "--action", "unknown"];
            let more = ["--recognise", "--licence", "unknown"];
            let added = run(&[&arguments[..], &more].concat());
            let added = added["added"].as_u64().expect("a number");
            assert!(added > 0, "captures");
            trials += added;
        }
    }
    let count = |question: &str| {
        run(&["corpus", "query", &corpus, question])["trials"].as_u64().expect("a number")
    };
    let (of_session, others) = (count("session=lab"), count("session is missing"));
    assert_eq!((of_session, of_session + others), (3, trials));
    assert_eq!(count("subject.stature_m>1.69 and subject.age=31"), 3);
    let labelled = count("label=walk");
    assert!(others == 0 || labelled > 0 && labelled < others, "{labelled} of {others}");
    // A wave of an arm as an episode for learners; the other arm was not worn.
    let dataset = folder.join("dataset").display().to_string();
    let arguments = ["corpus", "export", &corpus, "name=wave-r-01", "--format", "bvh"];
    let exported = run(&[&arguments[..], &["-o", &dataset]].concat());
    assert_eq!(exported["trials"].as_array().map(Vec::len), Some(1), "{exported:#}");
    let score = run(&["score", "identification", &corpus]);
    assert!(score["truth"].as_str().expect("words").contains("no truth here"), "{score:#}");
    assert_eq!(run(&["corpus", "check", &corpus])["outcome"], "done");
}

/// A column of a table of angles, rad.
fn column(path: &Path, dof: Dof) -> Vec<f64> {
    let text = std::fs::read_to_string(path).expect("a table");
    let mut lines = text.lines();
    let title = format!("{}_rad", dof.name());
    let at = lines.next().and_then(|titles| titles.split(',').position(|t| t == title));
    let at = at.expect("a column");
    lines
        .map(|line| line.split(',').nth(at).and_then(|c| c.parse().ok()).expect("a number"))
        .collect()
}

/// What came out is what was done, before and after the power was cut.
fn check_angles(lab: &Path) {
    let most = |trial: &str, dof: Dof| {
        column(&lab.join(format!("angles/{trial}.csv")), dof).into_iter().fold(f64::MIN, f64::max)
    };
    let wave = vocabulary::find("wave-r").and_then(|action| action.perform()).expect("shipped");
    let done: Vec<JointAngles> = wave.sampled(50.0).expect("sampled");
    let bent = done.iter().map(|angles| angles[Dof::RightElbowFlexion]).fold(f64::MIN, f64::max);
    for trial in ["wave-r-01", "wave-r-03"] {
        let off = (most(trial, Dof::RightElbowFlexion) - bent).to_degrees();
        println!("{trial}: elbow {off:+.1} deg off at its most");
        assert!(off.abs() < 5.0, "{trial}: {off}");
        assert!(most(trial, Dof::LeftElbowFlexion).abs() < 1e-6);
    }
    let off = (most("reach-up-01", Dof::RightShoulderFlexion) - 1.4).to_degrees();
    println!("reach-up-01: shoulder {off:+.1} deg off at its most");
    assert!(off.abs() < 5.0, "{off}");
    let bvh = lab.join("angles/reach-up-01.bvh");
    let (capture, _) =
        gaitway::job::source::body_motion(bvh.to_str().expect("a path"), None, &Default::default())
            .expect("a person");
    assert!((capture.stature_m - STATURE_M).abs() < 0.05, "{}", capture.stature_m);
}
