//! The operator's page of a session: `record --session --view` behind a pseudo-terminal, with a virtual person who wears
//! virtual sensors, and a browser that looks on. What the page says is what the terminal says. Time is real here.

mod aloud;
mod browser;
#[allow(dead_code)]
mod chromium;
#[allow(dead_code)]
#[path = "record_session/dialogue.rs"]
mod dialogue;
#[allow(dead_code)]
#[path = "record_session/guided.rs"]
mod guided;
#[allow(dead_code)]
#[path = "record_session/person.rs"]
mod person;
mod priority;
mod program;

use browser::browser;
use chromium::Browser;
use dialogue::Dialogue;
use gaitway::body::worn::check::t_pose;
use gaitway::body::{Dof, Segment};
use guided::{passes, raises_an_arm};
use person::{Act, Person};
use std::collections::BTreeMap;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::time::{Duration, Instant};

/// How long something may take on a busy machine.
const PATIENCE: Duration = Duration::from_secs(30);

const PLAN: &str = r#"
still_s = 2

[[action]]
name = "wave-r"
repetitions = 2

[[action]]
name = "reach-up"
explain = "Reach up with the right hand, straight, and lower it."
repetitions = 1
"#;

/// The operator with a terminal and a page.
struct Desk<'a> {
    operator: Dialogue<'a>,
    browser: Browser,
}

impl Desk<'_> {
    fn text(&mut self, id: &str) -> String {
        let text = self.browser.value(&format!(
            "document.getElementById('{id}').hidden ? '' : document.getElementById('{id}').textContent"
        ));
        text.as_str().expect("a text").to_owned()
    }

    /// Waits until a part of the page says these words; all that it says then.
    fn shows(&mut self, id: &str, words: &str) -> String {
        let began = Instant::now();
        loop {
            let text = self.text(id);
            if text.contains(words) {
                return text;
            }
            assert!(began.elapsed() < PATIENCE, "{id} never says {words:?}: {text:?}");
            self.browser.frames(1);
        }
    }

    /// Waits until what is to be done, and what is asked, are these on the page; the terminal said the same, in the same
    /// order, and nothing else that is to be done since.
    fn is_told(&mut self, instruction: &str, asked: &str) {
        let shown = self.shows("do", instruction);
        let question = self.shows("asked", asked);
        let began = Instant::now();
        // The page may be a moment ahead of the terminal.
        loop {
            let said = self.operator.said();
            let since = said.rfind(&shown).map(|at| &said[at..]);
            let is_asked = since.is_some_and(|since| since.contains(&question));
            let is_all = !asked.is_empty() || self.text("asked").is_empty();
            if is_asked && is_all {
                return;
            }
            let so_far = format!("{shown:?}, {question:?}; the terminal:\n{said}");
            assert!(began.elapsed() < PATIENCE, "not said by both: {so_far}");
            self.browser.frames(1);
        }
    }

    fn answers(&mut self, line: &str) {
        self.operator.say(line);
    }
}

/// Every file in a folder, and how large it is.
fn files(folder: &Path, found: &mut BTreeMap<String, u64>) {
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            files(&path, found);
        } else {
            let length = path.metadata().expect("a file").len();
            found.insert(path.display().to_string(), length);
        }
    }
}

fn post_stop(url: &str) -> String {
    let rest = url.strip_prefix("http://").expect("a page");
    let (host, path) = rest.split_at(rest.find('/').expect("a path"));
    let mut stream = TcpStream::connect(host).expect("it listens");
    let request = format!("POST {path}stop HTTP/1.1\r\nHost: {host}\r\n\r\n");
    stream.write_all(request.as_bytes()).expect("asked");
    let mut answer = String::new();
    stream.read_to_string(&mut answer).expect("an answer");
    answer
}

/// Keeps each time that is left as it changes on the screen, while one is shown.
const LOOKS_AT_THE_CLOCK: &str = "window.seen = []; (function look() {
    const left = document.getElementById('left'), s = parseFloat(left.textContent);
    const isShown = !document.getElementById('count').hidden && !document.getElementById('gone').hidden;
    if (isShown && s !== window.seen.at(-1)) window.seen.push(s);
    requestAnimationFrame(look);
})(); 0";

/// Names, rates and so on, row by row.
const SENSORS: &str = "[...document.querySelectorAll('#sensors tbody tr')].map(row => [...row.cells].map(cell => cell.textContent))";

#[test]
fn the_page_of_a_session_says_what_the_terminal_says_at_each_state_and_stops_nothing() {
    let Some(mut browser) = browser("led") else { return };
    priority::run_before_others();
    let folder = program::folder("view-session");
    std::fs::write(folder.join("plan.toml"), PLAN).expect("a plan");
    let person = Person::wearing(&[Segment::Torso, Segment::RightUpperArm, Segment::RightForearm]);
    let mut arguments: Vec<String> =
        ["--session", "lab", "--plan", "plan.toml", "--view"].map(str::to_owned).to_vec();
    arguments.extend(person.sources());
    let mut operator = Dialogue::start(&folder, &arguments, &person);
    operator.expect("view ");
    let url = operator.rest_of_line();
    browser.look(1280, 900, false);
    browser.open_served(&url);
    let mut desk = Desk { operator, browser };

    // Who leads it, and whom it records.
    desk.is_told("Session. Enter alone leaves out", "name of the session [Enter: lab]");
    for (asked, answer) in
        [("name of the session", ""), ("operator (who", "Ada"), ("place", ""), ("remarks", "")]
    {
        desk.is_told("Session.", asked);
        desk.answers(answer);
    }
    desk.is_told("Session.", "id of the subject, needed");
    desk.answers("s01");
    for (asked, answer) in
        [("gender", "f"), ("age", ""), ("stature (", "1.7"), ("mass", "."), ("remarks: act", "")]
    {
        desk.is_told("Subject s01. Measures;", asked);
        if asked == "gender" {
            assert_eq!(
                desk.text("next"),
                "device calibrationcalibration of subject s01wave-r, s01"
            );
        }
        desk.answers(answer);
    }

    // Devices: what is heard is told, and who is silent.
    desk.is_told(
        "Device calibration. Lay all sensors down (",
        "Do they lie still?\n  [Enter or y: ",
    );
    let began = Instant::now();
    loop {
        let rows = desk.browser.value(SENSORS);
        let names: Vec<&str> =
            rows.as_array().expect("rows").iter().filter_map(|row| row[0].as_str()).collect();
        assert_eq!(names, ["torso", "right_upper_arm", "right_forearm"]);
        let rate = |row: &serde_json::Value| {
            let (now, usual) = row[1].as_str()?.split_once(" of ")?;
            Some((now.parse::<f64>().ok()?, usual.parse::<f64>().ok()?))
        };
        let rates: Vec<_> = rows.as_array().expect("rows").iter().map(rate).collect();
        if rates.iter().all(|rate| rate.is_some_and(|(now, usual)| usual == 100.0 && now > 80.0)) {
            break;
        }
        assert!(began.elapsed() < PATIENCE, "{rates:?}");
        desk.browser.frames(2);
    }
    assert_eq!(desk.text("silent"), "");
    person.silences(Segment::RightForearm, true);
    desk.shows("silent", "Not heard: right_forearm");
    desk.shows("sensors", "silent for 2 s");
    person.silences(Segment::RightForearm, false);
    let began = Instant::now();
    while !desk.text("silent").is_empty() {
        assert!(began.elapsed() < PATIENCE, "it speaks again");
        desk.browser.frames(2);
    }
    // A sensor that moves has to be laid down again, and the page says why.
    person.does(raises_an_arm());
    passes(0.5);
    desk.browser.value(LOOKS_AT_THE_CLOCK);
    desk.answers("");
    desk.is_told("measuring for 2 s", "Not every sensor is good.");
    // Whenever the page was drawn meanwhile, less was left: however seldom that was.
    let left = desk.browser.value("seen");
    let left: Vec<f64> =
        left.as_array().expect("a list").iter().filter_map(|of| of.as_f64()).collect();
    assert!(left.len() > 2 && (1.0..=2.0).contains(&left[0]), "{left:?}");
    assert!(left.windows(2).all(|two| two[1] < two[0]), "it runs: {left:?}");
    let checked = desk.text("remark");
    assert!(checked.contains("torso            pass") && checked.contains("it moved"), "{checked}");
    person.stands();
    passes(0.6);
    desk.answers("");
    let verdict = desk.shows("verdict", "device calibration: to be repeated (");
    assert!(verdict.contains("it moved"), "{verdict}");
    assert_eq!(desk.browser.value("document.getElementById('verdict').className"), "again");
    desk.is_told("Device calibration. Lay", "Do they lie still?");
    desk.answers("");
    desk.shows("verdict", "device calibration: kept");
    assert_eq!(desk.browser.value("document.getElementById('verdict').className"), "kept");

    // Poses and movements, each with what comes after it.
    desk.is_told("Calibration of subject s01. Put the sensors on: torso", "Are they on?");
    desk.answers("");
    desk.is_told("N pose: upright, arms down", "Enter when you stand so");
    assert!(desk.text("next").starts_with("T pose: arms straight out"), "{}", desk.text("next"));
    let drawn = desk.browser.value("gaitway.persons(0).map(of => of.length)");
    assert_eq!(drawn, serde_json::json!([0, 0]), "nobody is drawn yet");
    let box_of = "(of => { const at = of.getBoundingClientRect(); return document.elementFromPoint(at.x + 5, at.y + 5) === of; })";
    let is_seen = format!("{box_of}(document.getElementById('nothing'))");
    desk.shows("nothing", "Nobody is drawn before");
    assert_eq!(desk.browser.value(&is_seen), true, "and that is seen");
    stands(&mut desk);
    desk.is_told("T pose: arms straight out to the sides", "");
    assert!(desk.text("next").starts_with("bow with a straight back"), "{}", desk.text("next"));
    person.does(Act::Pose(t_pose()));
    desk.is_told("then: bow with a straight back", "");
    moves(&mut desk, &person, Act::Bow(2.0));
    desk.is_told("then: march on the spot", "");
    moves(&mut desk, &person, Act::Swing(vec![Dof::RightElbowFlexion], 1.5, 2.0));
    desk.is_told("then: raise both straight arms", "");
    assert!(desk.text("next").starts_with("wave-r, s01"), "{}", desk.text("next"));
    moves(&mut desk, &person, raises_an_arm());

    // A trial: which repetition, and what was marked.
    desk.shows("verdict", "calibration of subject s01: kept");
    desk.is_told("[1/2] wave-r, s01: 0 of 2 good repetitions", "Explain it and show it.");
    assert_eq!(desk.text("repetition"), "1 of 2");
    assert_eq!(
        desk.text("next"),
        "wave-r again, up to 2 good repetitionsreach-up, s01joint angles and the manifest"
    );
    // A figure shows it, over and over, while whoever wears the sensors stands there.
    desk.shows("remark", "The figure shows how it is done: wave-r, ");
    let wrist =
        "gaitway.person(gaitway.figures().now)[WRIST]".replace("WRIST", &wrist().to_string());
    for wanted in [true, false, true] {
        reaches(&mut desk, &wrist, wanted);
    }
    desk.answers("");
    desk.is_told("[1/2] wave-r, s01", "Let it be practised");
    reaches(&mut desk, &wrist, true);
    desk.answers("");
    desk.is_told("[1/2] wave-r, s01", "Record wave-r-01?");
    assert_eq!(desk.text("remark"), "");
    reaches(&mut desk, &wrist, false);
    desk.browser.frames(40);
    let height_m = desk.browser.value(&wrist)[2].as_f64().expect("a height");
    assert!(height_m < LOW_M, "whoever stands there is drawn again: {height_m} m");
    desk.answers("");
    desk.is_told("N pose", "Enter when you stand so");
    stands(&mut desk);
    desk.is_told("RECORDING wave-r-01. Enter or space: a good repetition", "");
    desk.shows("left", "recorded for 1.");
    // Whoever wears the sensors is seen to move: an arm forward puts the wrist before the hip.
    let before = desk.browser.value(&wrist);
    person.does(Act::Pose(forward()));
    let began = Instant::now();
    loop {
        let now = desk.browser.value(&wrist);
        let part = |place: &serde_json::Value, axis: usize| place[axis].as_f64().expect("a place");
        if part(&now, 0) - part(&before, 0) > 0.35 && part(&now, 2) - part(&before, 2) > 0.3 {
            break;
        }
        assert!(began.elapsed() < PATIENCE, "{before} {now}");
        desk.browser.frames(2);
    }
    desk.answers("");
    desk.shows("place", "in this trial 1 good, 0 bad");
    assert_eq!(desk.text("repetition"), "2 of 2");
    desk.answers("x");
    desk.shows("place", "in this trial 1 good, 1 bad");
    person.stands();
    passes(0.6);

    // The page is read-only: asking it to stop changes nothing, and the terminal goes on.
    assert!(post_stop(&url).starts_with("HTTP/1.1 404"));
    assert_eq!(desk.browser.value("document.getElementById('stop').hidden"), true);
    desk.answers(".");
    desk.is_told("wave-r-01: ", "Trial wave-r-01: keep it?");
    desk.answers("k");
    desk.is_told("wave-r-01: ", "good repetitions in it [Enter: 1");
    desk.answers("");
    desk.is_told("wave-r-01: ", "notes");
    desk.answers("the first");
    desk.is_told("wave-r-01: ", "props: what");
    desk.answers("");
    desk.is_told("[1/2] wave-r, s01: 1 of 2 good repetitions", "Record wave-r-02?");
    assert_eq!(desk.text("verdict"), "trial wave-r-01: kept, 1 good repetition (the first)");

    // One that is to be retaken, and why.
    desk.answers("");
    stands(&mut desk);
    desk.is_told("RECORDING wave-r-02", "");
    passes(0.3);
    desk.answers(".");
    desk.is_told("wave-r-02: ", "keep it?");
    desk.answers("r");
    desk.is_told("wave-r-02: ", "what was wrong");
    desk.answers("stumbled");
    desk.shows("verdict", "trial wave-r-02: to be retaken (stumbled)");
    desk.is_told("[1/2] wave-r, s01: 1 of 2 good repetitions", "Record wave-r-03?");
    assert_eq!(desk.browser.complaints(), [""; 0]);

    // No file is there that the session has not written without a page; and it goes on later.
    desk.answers("q");
    desk.operator.expect("to go on: gaitway record --session lab");
    let began = Instant::now();
    while desk.browser.value("document.documentElement.dataset.live") != "off" {
        assert!(began.elapsed() < PATIENCE, "the page knows that the program is gone");
        desk.browser.frames(2);
    }
    assert_eq!(desk.operator.ends(), Some(4));
    let mut found = BTreeMap::new();
    files(&folder, &mut found);
    assert!(!found.keys().any(|name| name.ends_with(".html")), "{found:?}");
}

/// Says that one stands in N pose. Who stood still while the machine did not is asked once more.
fn stands(desk: &mut Desk<'_>) {
    for _ in 0..4 {
        desk.is_told("N pose", "Enter when you stand so");
        desk.answers("");
        desk.shows("remark", "hold still for 3 s");
        desk.shows("left", " s");
        let began = Instant::now();
        while desk.text("do").starts_with("N pose") && desk.text("asked").is_empty() {
            assert!(began.elapsed() < PATIENCE, "N pose comes to an end");
            desk.browser.frames(2);
        }
        if desk.text("asked").is_empty() || !desk.text("do").starts_with("N pose") {
            return;
        }
    }
    panic!("four times no N pose");
}

/// A wrist is up or down, m.
const LOW_M: f64 = 1.0;

/// Waits until a wrist is drawn up, or down.
fn reaches(desk: &mut Desk<'_>, wrist: &str, up: bool) {
    let began = Instant::now();
    while (desk.browser.value(wrist)[2].as_f64().expect("a height") > LOW_M) != up {
        assert!(began.elapsed() < PATIENCE, "a wrist is never {}", if up { "up" } else { "down" });
        desk.browser.frames(2);
    }
}

/// N pose first, then the movement once, and N pose again.
fn moves(desk: &mut Desk<'_>, person: &Person, act: Act) {
    let asked = desk.text("do");
    person.stands();
    passes(0.9);
    person.does(act);
    passes(2.35);
    person.stands();
    let began = Instant::now();
    while desk.text("do") == asked {
        assert!(began.elapsed() < PATIENCE, "{asked} is seen");
        desk.browser.frames(2);
    }
}

/// Both arms straight forward.
fn forward() -> gaitway::body::JointAngles {
    let mut angles = gaitway::body::JointAngles::default();
    angles[Dof::RightShoulderFlexion] = 1.4;
    angles
}

/// Number of the point of the right wrist.
const fn wrist() -> usize {
    gaitway::body::Joint::RightWrist.index()
}
