//! Sessions without people: `gaitway record --session` at a pseudo-terminal, and `gaitway simulate imus --follow` beside it, each
//! a process as a user starts it. The test is the operator, and nobody else. Time is real here.

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

use dialogue::Dialogue;
use gaitway::body::Dof;
use gaitway::session::manifest::Manifest;
use gaitway::session::{BodyCheck, DeviceCheck, TrialFile, Verdict};
use guided::{ASKED, passes, read};
use person::Person;
use program::json;
use std::io::Read;
use std::path::Path;
use std::process::{Child, Stdio};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Longer nobody waits: something is wrong then.
const PATIENCE: Duration = Duration::from_secs(60);
/// From what somebody does to what is asked, s, and a little more.
const CHANGE_S: f64 = 1.4;

/// `gaitway simulate imus --follow`.
struct Virtual {
    child: Child,
    said: Arc<Mutex<String>>,
    seen: usize,
}

impl Virtual {
    fn start(folder: &Path, body: &str, worn: &str, more: &[&str]) -> Self {
        let mut child = program::gaitway()
            .current_dir(folder)
            .args(["simulate", "imus", "--follow", "lab", "--pty", body, "--wear", worn])
            .args(["--seed", "5"])
            .args(more)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the command");
        let said = Arc::new(Mutex::new(String::new()));
        let out = child.stdout.take().expect("piped");
        let err = child.stderr.take().expect("piped");
        let listen = |mut from: Box<dyn Read + Send>| {
            let to = Arc::clone(&said);
            std::thread::spawn(move || {
                let mut bytes = [0_u8; 4096];
                while let Ok(count @ 1..) = from.read(&mut bytes) {
                    to.lock().expect("whole").push_str(&String::from_utf8_lossy(&bytes[..count]));
                }
            });
        };
        listen(Box::new(out));
        listen(Box::new(err));
        let mut started = Self { child, said, seen: 0 };
        started.expect("the sensors lie on a table");
        started
    }

    /// Waits until this is said, after what was expected before.
    fn expect(&mut self, words: &str) {
        let began = Instant::now();
        loop {
            let said = self.said.lock().expect("whole").clone();
            if let Some(at) = said[self.seen..].find(words) {
                self.seen += at + words.len();
                return;
            }
            assert!(began.elapsed() < PATIENCE, "{words:?} was not said:\n{said}");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    fn is_there(&mut self) -> bool {
        self.child.try_wait().expect("its state").is_none()
    }

    /// Ctrl-C; the exit code.
    fn ends(mut self) -> Option<i32> {
        let id = i32::try_from(self.child.id()).ok().and_then(rustix::process::Pid::from_raw);
        rustix::process::kill_process(id.expect("a process"), rustix::process::Signal::INT)
            .expect("interrupted");
        self.child.wait().expect("its end").code()
    }
}

impl Drop for Virtual {
    fn drop(&mut self) {
        // Shown for a test that fails, and with --nocapture.
        println!("{}", self.said.lock().expect("whole"));
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Sources as they are typed.
fn sources(body: &Path, worn: &str, prefix: &str) -> Vec<String> {
    let body = body.display();
    let source = |name: &str| format!("{prefix}{name}=imu:xsens-mti@{body}/{name}");
    worn.split(',').map(source).collect()
}

/// What is asked of one subject; nothing but the stature is known of them.
fn set_up(operator: &mut Dialogue, ids: &[&str]) {
    for question in ["name of the session", "operator", "place", "remarks"] {
        operator.answer(question, "");
    }
    operator.answer("id of the subject", ids[0]);
    for second in &ids[1..] {
        operator.answer("id of the second subject", second);
    }
    for _ in ids {
        for (question, answer) in [("gender", ""), ("age", ""), ("stature", "1.75"), ("mass", ".")]
        {
            operator.answer(question, answer);
        }
        operator.answer("remarks: actions", "");
    }
}

fn lies(operator: &mut Dialogue) {
    operator.expect("Do they lie still?");
    // The filters settle.
    passes(1.0);
    operator.say("");
    operator.expect("written: calibration/device-01.toml");
}

/// The operator waits until the person stands as asked. Who stood still while the machine did not is asked once more.
fn stands(operator: &mut Dialogue, person: &mut Virtual, next: &str) {
    operator.expect(ASKED);
    for _ in 0..5 {
        person.expect("stands in N pose (n pose is asked,");
        passes(CHANGE_S);
        operator.say("");
        if operator.expect_one_of(&[next, ASKED]) == next {
            return;
        }
    }
    panic!("five times no N pose");
}

/// A trial of which one repetition is good.
fn kept(operator: &mut Dialogue, person: &mut Virtual, trial: &str, lasts_s: f64) {
    operator.answer(&format!("Record {trial}?"), "");
    stands(operator, person, &format!("RECORDING {trial}"));
    person.expect("again and again (perform is asked");
    // It begins a second after it was asked, from N pose and back, and comes to its pace and to rest in half a second.
    passes(1.0 + 0.8 + lasts_s + 0.5 + 0.9);
    operator.press(" ");
    operator.expect("1 good, 0 bad");
    operator.say(".");
    operator.answer("keep it?", "k");
    person.expect("stands in N pose (nothing is asked");
    for question in ["good repetitions in it", "notes", "props"] {
        operator.answer(question, "");
    }
}

/// The greatest angle of a column of a table, deg.
fn most_deg(path: &Path, dof: Dof) -> f64 {
    let text = std::fs::read_to_string(path).expect("a table");
    let mut lines = text.lines();
    let title = format!("{}_rad", dof.name());
    let at = lines.next().and_then(|titles| titles.split(',').position(|t| t == title));
    let at = at.expect("a column");
    let angle = |line: &str| line.split(',').nth(at).and_then(|c| c.parse::<f64>().ok());
    lines.map(|line| angle(line).expect("a number")).fold(f64::MIN, f64::max).to_degrees()
}

/// What is typed to begin a session with these sources.
fn begun(sources: Vec<String>) -> Vec<String> {
    let begin = ["--session", "lab", "--plan", "plan.toml"].map(str::to_owned);
    begin.into_iter().chain(sources).collect()
}

const PLAN: &str = r#"
still_s = 1.5
repetitions = 1

[[action]]
name = "bow"

[[action]]
name = "arms-up"
explain = "Raise both straight arms forward, and lower them."
"#;

/// Nothing ships under this name.
const ARMS_UP: &str = r#"
schema = 1
name = "arms-up"
note = "Both straight arms forward and up, and down"
duration_s = 2.4
phases = [[0.0, "up"], [0.5, "down"]]

[[group]]
name = "left arm"
kind = "joint"
turns.left_shoulder_flexion = [[0.5, 80], [1.0, 0]]

[[group]]
name = "right arm"
kind = "joint"
mirrors = "left arm"
"#;

#[test]
fn a_whole_session_is_rehearsed_by_a_virtual_person_who_does_what_is_asked() {
    let folder = program::folder("follow");
    std::fs::write(folder.join("plan.toml"), PLAN).expect("a plan");
    std::fs::write(folder.join("up.toml"), ARMS_UP).expect("an action");
    let worn = "torso,left_upper_arm,right_upper_arm,right_forearm,left_thigh,left_shank";
    // The person is there before anybody thinks of a session.
    let mut person = Virtual::start(&folder, "body", worn, &["--action", "arms-up=up.toml"]);
    let nobody = Person::wearing(&[]);
    let begin = begun(sources(&folder.join("body"), worn, ""));
    let mut operator = Dialogue::start(&folder, &begin, &nobody);
    set_up(&mut operator, &["s01"]);
    lies(&mut operator);
    person.expect("stands in N pose (put on is asked");
    operator.answer("Are they on?", "");
    stands(&mut operator, &mut person, "T pose: arms straight out");
    person.expect("stands in T pose (t pose is asked");
    for (movement, seen) in [
        ("then: bow", "bows and comes up again (bow is asked"),
        ("then: sit", "sits down and stands up again (sit to stand is asked"),
        ("then: march", "marches on the spot (bend is asked"),
        ("then: raise", "raises both arms and lowers them (raise arms is asked"),
    ] {
        operator.expect(movement);
        person.expect(seen);
        operator.expect("good");
    }
    operator.expect("written: calibration/body-s01-01.toml");
    operator.expect("bow, s01: 0 of 1 good repetition");
    operator.answer("Explain it and show it", "");
    operator.expect("Let it be practised");
    person.expect("does bow again and again (practise is asked");
    operator.say("");
    kept(&mut operator, &mut person, "bow-01", 2.8);
    operator.answer("Explain it and show it", "");
    operator.answer("Let it be practised", "");
    kept(&mut operator, &mut person, "arms-up-01", 2.4);
    operator.expect("finished: 2 trials, 2 kept, 2 good repetitions");
    assert_eq!(operator.ends(), Some(0));
    person.expect("no session is led there");
    assert_eq!(person.ends(), Some(0));
    assert!(!folder.join("body/torso").exists(), "its terminals are gone");

    let lab = folder.join("lab");
    for left in ["now.json", "now.json.new"] {
        assert!(!lab.join(left).exists(), "{left}");
    }
    let device: DeviceCheck = read(&lab.join("calibration/device-01.toml"));
    assert!(device.passed && device.sensors.len() == 6);
    let check: BodyCheck = read(&lab.join("calibration/body-s01-01-check.toml"));
    assert!(check.passed && check.notes.is_empty(), "{check:?}");
    let manifest: Manifest = read(&lab.join("manifest.toml"));
    let trials: Vec<_> =
        manifest.trials.iter().map(|trial| (trial.name.as_str(), trial.verdict)).collect();
    assert_eq!(trials, [("arms-up-01", Verdict::Keep), ("bow-01", Verdict::Keep)]);
    assert!(manifest.trials.iter().all(|trial| trial.no_angles.is_none()));
    // What its file says that arms and torso do is what is read back.
    for (table, dof, deg) in [
        ("arms-up-01", Dof::LeftShoulderFlexion, 80.0),
        ("arms-up-01", Dof::RightShoulderFlexion, 80.0),
        ("bow-01", Dof::LeftShoulderFlexion, 38.0),
    ] {
        let most = most_deg(&lab.join(format!("angles/{table}.csv")), dof);
        println!("{table}: {} at most {most:.1} deg, by its file {deg}", dof.name());
        assert!((most - deg).abs() < 8.0, "{table}: {} {most}", dof.name());
    }
    let run = |arguments: &[&str]| {
        let mut command = program::gaitway();
        json(&command.current_dir(&folder).args(arguments).arg("--json").output().expect("it"))
    };
    run(&["corpus", "new", "moves"]);
    let added = run(&["corpus", "add", "moves", "lab", "--consent", "given"]);
    assert_eq!(added["added"], 2, "{added:#}");
    assert_eq!(run(&["corpus", "check", "moves"])["outcome"], "done");
}

const MISHAPS: &str = r#"
seed = 2

[[mishap]]              # two sensors are put on the wrong way round
kind = "swap"
segments = ["left_forearm", "right_forearm"]
asked = "put_on"

[[mishap]]              # in the middle of standing still
kind = "stumble"
asked = "n_pose"
after_s = 2.4

[[mishap]]
kind = "wrong"
instead = "arms_forward"
asked = "t_pose"

[[mishap]]              # and the right way round the next time
kind = "swap"
segments = ["left_forearm", "right_forearm"]
asked = "put_on"
number = 2

[[mishap]]
kind = "lose"
segment = "right_forearm"
for_s = 2
asked = "perform"
after_s = 1.5
"#;

#[test]
fn what_goes_wrong_with_a_virtual_person_by_script_is_noticed_by_the_session() {
    let folder = program::folder("follow-mishaps");
    let plan = "still_s = 1.5\nrepetitions = 1\n[[action]]\nname = \"wave-r\"\n";
    std::fs::write(folder.join("plan.toml"), plan).expect("a plan");
    std::fs::write(folder.join("mishaps.toml"), MISHAPS).expect("a script");
    let worn = "left_upper_arm,right_upper_arm,left_forearm,right_forearm";
    let mut person = Virtual::start(&folder, "body", worn, &["--script", "mishaps.toml"]);
    let nobody = Person::wearing(&[]);
    let begin = begun(sources(&folder.join("body"), worn, ""));
    let mut operator = Dialogue::start(&folder, &begin, &nobody);
    set_up(&mut operator, &["s01"]);
    lies(&mut operator);
    person.expect("the sensors left_forearm and right_forearm change places (script)");
    operator.answer("Are they on?", "");
    // The first N pose ends in a stumble.
    operator.expect(ASKED);
    person.expect("stands in N pose (n pose is asked,");
    passes(CHANGE_S);
    operator.say("");
    person.expect("stumbles (script)");
    operator.expect("moved (");
    stands(&mut operator, &mut person, "T pose: arms straight out");
    // Arms straight forward: each by itself looks right, until the movements tell where forward is.
    person
        .expect("holds both arms straight forward (script: arms_forward instead) (t pose is asked");
    operator.expect("then: march");
    operator.expect("then: raise");
    operator.expect("measured error in T pose: at most 9");
    operator.answer("Keep this calibration?", "r");
    stands(&mut operator, &mut person, "T pose: arms straight out");
    person.expect("stands in T pose (t pose is asked");
    operator.expect("then: march");
    operator.expect("then: raise");
    operator.expect("seem to be swapped");
    // It is not kept unless somebody says so.
    operator.expect("Keep this calibration?");
    operator.answer("[Enter or r: repeat", "k");
    // Somebody kept it all the same, and thinks better of it.
    operator.expect("wave-r, s01: 0 of 1 good repetition");
    operator.answer("Explain it and show it", "");
    operator.answer("Let it be practised", "");
    operator.answer("Record wave-r-01?", "c");
    person.expect("the sensors left_forearm and right_forearm change places (script)");
    operator.answer("Are they on?", "");
    stands(&mut operator, &mut person, "T pose: arms straight out");
    operator.expect("then: march");
    operator.expect("then: raise");
    operator.expect("written: calibration/body-s01-03.toml");
    operator.answer("Explain it and show it", "");
    operator.answer("Let it be practised", "");
    // A sensor is pulled out in the middle of a trial, and plugged in again.
    operator.answer("Record wave-r-01?", "");
    stands(&mut operator, &mut person, "RECORDING wave-r-01");
    person.expect("the sensor right_forearm is pulled out for 2 s (script)");
    operator.expect("! it ends here, sensor right_forearm is gone");
    person.expect("the sensor right_forearm is plugged in again");
    operator.expect("keep it?");
    operator.expect("right_forearm is back after");
    operator.say("r");
    operator.answer("what was wrong", "cable");
    kept(&mut operator, &mut person, "wave-r-02", 5.0);
    operator.expect("finished: 2 trials, 1 kept, 1 good repetition");
    assert_eq!(operator.ends(), Some(0));

    let lab = folder.join("lab");
    let check =
        |n: u32| read::<BodyCheck>(&lab.join(format!("calibration/body-s01-0{n}-check.toml")));
    let (first, second, third) = (check(1), check(2), check(3));
    assert!(!first.passed && first.worst_rad.is_some_and(|rad| rad > 1.4), "{first:?}");
    assert!(second.notes.iter().any(|note| note.contains("swapped")), "{second:?}");
    assert!(third.notes.is_empty() && third.passed, "{third:?}");
    let trial: TrialFile = read(&lab.join("trials/wave-r-01.toml"));
    assert_eq!((trial.verdict, trial.notes.as_str()), (Verdict::Retake, "cable"));
    // The forearm that waved is the right one again.
    let table = lab.join("angles/wave-r-02.csv");
    let (right, left) =
        (most_deg(&table, Dof::RightElbowFlexion), most_deg(&table, Dof::LeftElbowFlexion));
    println!("elbows: right at most {right:.1} deg, left {left:.1} deg");
    assert!(right > 60.0 && left < 15.0, "{right} {left}");
}

#[test]
fn shanks_that_were_swapped_are_named_by_a_trial_in_which_somebody_walks() {
    let folder = program::folder("follow-walk");
    let plan = "still_s = 1.5\nrepetitions = 1\n[[action]]\nname = \"walk\"\n";
    std::fs::write(folder.join("plan.toml"), plan).expect("a plan");
    let swap = "[[mishap]]\nkind = \"swap\"\nsegments = [\"left_shank\", \"right_shank\"]\n\
                asked = \"put_on\"\n";
    std::fs::write(folder.join("swap.toml"), swap).expect("a script");
    let worn = "left_thigh,right_thigh,left_shank,right_shank";
    let more = ["--script", "swap.toml", "--action", "walk=walk:6s"];
    let mut person = Virtual::start(&folder, "body", worn, &more);
    let nobody = Person::wearing(&[]);
    let begin = begun(sources(&folder.join("body"), worn, ""));
    let mut operator = Dialogue::start(&folder, &begin, &nobody);
    set_up(&mut operator, &["s01"]);
    lies(&mut operator);
    person.expect("the sensors left_shank and right_shank change places (script)");
    operator.answer("Are they on?", "");
    stands(&mut operator, &mut person, "then: sit");
    operator.expect("then: march");
    // Whatever it says of them, somebody keeps it.
    operator.answer("Keep this calibration?", "k");
    operator.answer("Explain it and show it", "");
    operator.answer("Let it be practised", "");
    operator.answer("Record walk-01?", "");
    stands(&mut operator, &mut person, "RECORDING walk-01");
    person.expect("does walk again and again (perform is asked,");
    passes(9.0);
    operator.say(".");
    operator.expect("! the left thigh swings with the right shank");
    // It is not kept unless somebody says so.
    operator.answer("[Enter or r: retake", "");
    operator.answer("what was wrong", "the sensors");
    operator.answer("Record walk-02?", "q");
    assert_eq!(operator.ends(), Some(4));
    let trial: TrialFile = read(&folder.join("lab/trials/walk-01.toml"));
    assert_eq!(trial.verdict, Verdict::Retake);
    assert!(!folder.join("lab/now.json").exists(), "a session that was stopped asks for nothing");
}

#[test]
fn two_virtual_persons_take_turns_each_when_it_is_asked_and_may_come_late_or_again() {
    let folder = program::folder("follow-two");
    let plan = "still_s = 1.5\nrepetitions = 1\n[[action]]\nname = \"bow\"\n";
    std::fs::write(folder.join("plan.toml"), plan).expect("a plan");
    let mut anna = Virtual::start(&folder, "anna", "torso", &["--subject", "s01"]);
    let late = "[[mishap]]\nkind = \"late\"\nfor_s = 7\nasked = \"bow\"\n";
    std::fs::write(folder.join("late.toml"), late).expect("a script");
    let of_bert = ["--subject", "s02", "--script", "late.toml"];
    let mut bert = Virtual::start(&folder, "bert", "torso", &of_bert);
    let nobody = Person::wearing(&[]);
    let anna_and_bert = [("anna", ""), ("bert", "2-")];
    let both = anna_and_bert.map(|(name, prefix)| sources(&folder.join(name), "torso", prefix));
    let begin = begun(both.concat());
    let mut operator = Dialogue::start(&folder, &begin, &nobody);
    set_up(&mut operator, &["s01", "s02"]);
    lies(&mut operator);
    for (person, is_late) in [(&mut anna, false), (&mut bert, true)] {
        person.expect("stands in N pose (put on is asked,");
        operator.answer("Are they on?", "");
        stands(&mut operator, person, "then: bow");
        if is_late {
            // It was the first bow that is asked of him and the second of the session.
            person.expect("waits for 7 s first (script)");
            operator.expect("it has not been begun yet");
        }
        person.expect("bows and comes up again (bow is asked");
        // No arm wears a sensor: nothing verifies it in T pose.
        operator.answer("Keep this calibration?", "k");
    }
    operator.answer("Explain it and show it", "");
    operator.answer("Let it be practised", "");
    // The computer of the first one is begun anew.
    operator.expect("Record bow-01?");
    assert_eq!(anna.ends(), Some(0));
    operator.expect("torso is gone");
    let mut anna = Virtual::start(&folder, "anna", "torso", &["--subject", "s01"]);
    operator.expect("torso is back after");
    operator.say("");
    let performs = |operator: &mut Dialogue, person: &mut Virtual, trial: &str| {
        stands(operator, person, &format!("RECORDING {trial}"));
        person.expect("does bow again and again (perform is asked");
        passes(5.5);
        operator.press(" ");
        operator.expect("1 good, 0 bad");
        operator.say(".");
        operator.answer("keep it?", "k");
        for question in ["good repetitions in it", "notes", "props"] {
            operator.answer(question, "");
        }
    };
    performs(&mut operator, &mut anna, "bow-01");
    operator.answer("Explain it and show it", "");
    operator.answer("Let it be practised", "");
    operator.answer("Record bow-02?", "");
    performs(&mut operator, &mut bert, "bow-02");
    operator.expect("finished: 2 trials, 2 kept, 2 good repetitions");
    assert_eq!(operator.ends(), Some(0));
    for (person, trial) in [(anna, "bow-01"), (bert, "bow-02")] {
        let said = person.said.lock().expect("whole").clone();
        assert_eq!(
            said.matches("does bow again and again (perform is asked,").count(),
            1,
            "{trial}: {said}"
        );
    }
    let manifest: Manifest = read(&folder.join("lab/manifest.toml"));
    assert_eq!(manifest.trials.len(), 2);
}

#[test]
fn whatever_stands_where_a_session_says_what_it_asks_is_told_in_words_and_does_no_harm() {
    let folder = program::folder("follow-hostile");
    let lab = folder.join("lab");
    std::fs::create_dir(&lab).expect("a folder");
    let now = lab.join("now.json");
    let mut person = Virtual::start(&folder, "body", "torso", &[]);
    let put = |bytes: &[u8]| {
        let beside = lab.join("beside");
        std::fs::write(&beside, bytes).expect("written");
        std::fs::rename(&beside, &now).expect("put there");
    };
    put(b"\x1b[2J{\"gaitway_now\"");
    person.expect("this is not what a session asks for");
    put(&vec![b'['; 20 << 20]);
    person.expect("more than 65536 bytes");
    put(br#"{"gaitway_now": 7}"#);
    person.expect("version 7");
    std::fs::remove_file(&now).expect("taken away");
    std::fs::create_dir(&now).expect("a folder in its place");
    person.expect("now.json");
    std::fs::remove_dir(&now).expect("taken away");
    // Left by a process that is gone, whatever it asks.
    let asks = |pid: u32, request: u64, action: &str| {
        serde_json::json!({
            "gaitway_now": 1, "pid": pid, "started": 0, "change": 1, "request": request,
            "times": 1, "wanted": "perform", "action": {"name": action}, "colour": "green",
        })
        .to_string()
    };
    put(asks(u32::MAX, 1, "bow").as_bytes());
    passes(0.5);
    // There and away, over and over; what is asked is a name, and no file of this machine.
    let own = std::process::id();
    for n in 0..2000 {
        put(asks(own, n, "../../../../etc/passwd\x1b[31m").as_bytes());
        let _ = std::fs::remove_file(&now);
    }
    put(asks(own, 9999, "../../../../etc/passwd\x1b[31m").as_bytes());
    person.expect("request 9999");
    let said = person.said.lock().expect("whole").clone();
    assert!(said.contains("no such action ships with gaitway"), "{said}");
    assert!(!said.contains("does bow"), "nobody asked that: {said}");
    assert!(!said.contains('\x1b'), "what stands in a file is no command to a terminal");
    assert!(person.is_there());
    assert_eq!(person.ends(), Some(0));
}

#[test]
fn a_script_or_an_action_that_is_none_is_refused_before_anything_is_opened() {
    let folder = program::folder("follow-refused");
    std::fs::write(folder.join("bad.toml"), "[[mishap]]\nkind = 'fly'\nat_s = 1\n").expect("it");
    let lost = "[[mishap]]\nkind = 'lose'\nsegment = 'head'\nfor_s = 1\nat_s = 1\n";
    std::fs::write(folder.join("lost.toml"), lost).expect("it");
    let refused = |more: &[&str]| {
        let output = program::gaitway()
            .current_dir(&folder)
            .args(["simulate", "imus", "--follow", "lab", "--pty", "body", "--wear", "torso"])
            .args(more)
            .output()
            .expect("the command");
        assert!(!output.status.success(), "{more:?}");
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    let said = refused(&["--script", "bad.toml"]);
    assert!(said.contains("stumble, swap, lose, late, wrong"), "{said}");
    let said = refused(&["--script", "lost.toml"]);
    assert!(said.contains("a sensor that is not worn") && said.contains("head"), "{said}");
    assert!(refused(&["--action", "bow"]).contains("NAME=MOTION"));
    assert!(refused(&["--action", "bow=nothing.bvh"]).contains("nothing.bvh"));
    assert!(refused(&["--motion", "bow"]).contains("--follow"));
    assert!(!folder.join("body").exists() && !folder.join("lab").exists());
}
