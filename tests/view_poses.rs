//! Key frames made on the page of a robot: by sliders, by hand in the scene, and of the robot as it is. What is downloaded,
//! `play` takes; what the page draws between key frames is what `play` makes of them.

mod aloud;
mod browser;
#[allow(dead_code)]
mod chromium;
mod priority;
mod program;

use browser::browser;
use chromium::Browser;
use gaitway::job::page::live;
use gaitway::job::source::joints;
use gaitway::robot::Robot;
use gaitway::view::live::{LiveFrame, LiveView};
use serde_json::{Value, json};
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

/// How long an answer may take on a busy machine.
const PATIENCE: Duration = Duration::from_secs(60);

/// So near to the end of its range a joint gets, rad.
const HAIR_RAD: f64 = 2e-4;

/// A command that serves a page, and where; ends with the test.
struct Served(Child);

impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn serving(arguments: &[&str]) -> (Served, String) {
    let mut command = program::gaitway();
    command.args(arguments).stdout(Stdio::null()).stderr(Stdio::piped());
    let mut child = command.spawn().expect("the program");
    let mut said = BufReader::new(child.stderr.take().expect("piped"));
    let child = Served(child);
    let mut all = String::new();
    loop {
        let mut line = String::new();
        assert!(said.read_line(&mut line).expect("words") > 0, "it ended: {all}");
        if let Some(url) = line.trim().strip_prefix("view ") {
            let url = url.trim().to_owned();
            std::thread::spawn(move || std::io::copy(&mut said, &mut std::io::sink()));
            return (child, url);
        }
        all += &line;
    }
}

/// Asks the page again and again until an expression is true.
fn until(browser: &mut Browser, expression: &str) {
    let began = Instant::now();
    while browser.value(expression) != true {
        assert!(began.elapsed() < PATIENCE, "never so: {expression}");
        browser.frames(2);
    }
}

/// Puts the slider of a joint to so many degrees, as a hand does.
fn slide(browser: &mut Browser, joint: usize, deg: f64) {
    browser.value(&format!(
        "(slider => {{ slider.value = {deg}; slider.dispatchEvent(new Event('input', {{ bubbles: true }})); }})\
         (document.getElementById('turn-{joint}'))"
    ));
}

fn press(browser: &mut Browser, id: &str) {
    browser.value(&format!("document.getElementById('{id}').click()"));
}

/// So many seconds after the key frame before.
fn after(browser: &mut Browser, seconds: f64) {
    browser.value(&format!(
        "(of => {{ of.value = {seconds}; of.dispatchEvent(new Event('change', {{ bubbles: true }})); }})\
         (document.getElementById('pose-after'))"
    ));
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().expect("a list").iter().map(|of| of.as_f64().expect("a number")).collect()
}

/// Downloads the table.
fn downloaded(browser: &mut Browser, folder: &Path, robot: &str) -> PathBuf {
    let path = folder.display().to_string();
    browser.ask("Page.setDownloadBehavior", json!({ "behavior": "allow", "downloadPath": path }));
    press(browser, "pose-download");
    let file = folder.join(format!("{robot}-key-frames.csv"));
    let began = Instant::now();
    while !file.exists() {
        assert!(began.elapsed() < PATIENCE, "nothing was downloaded");
        browser.frames(2);
    }
    file
}

#[test]
fn key_frames_made_by_sliders_are_downloaded_played_unchanged_and_drawn_as_play_makes_them() {
    let Some(mut browser) = browser("sliders") else { return };
    priority::run_before_others();
    let folder = program::folder("key-frames");
    let robot = Robot::load("op3").expect("a robot");
    let names = robot.joint_names();
    let at = |name: &str| names.iter().position(|known| known == name).expect("a joint");
    let (roll, knee) = (at("r_sho_roll"), at("l_knee"));
    let (_program, url) = serving(&["view", "op3"]);
    browser.look(1280, 900, false);
    browser.open_served(&url);
    assert_eq!(browser.value("document.getElementById('stop').hidden"), true, "nothing moves");

    // Limits are shown, and kept, at both ends.
    let limits = &robot.joints[knee].limits;
    for (far_deg, end_rad) in [(1e4, limits.upper_rad()), (-1e4, limits.lower_rad())] {
        slide(&mut browser, knee, far_deg);
        let kept = browser.value(&format!("gaitway.poses().angles[0][{knee}]"));
        let kept_rad = kept.as_f64().expect("a number");
        assert!((limits.lower_rad()..=limits.upper_rad()).contains(&kept_rad), "{kept_rad}");
        assert!((kept_rad - end_rad).abs() < HAIR_RAD, "{kept_rad}, {end_rad}");
    }
    let ends = browser.value(&format!(
        "document.getElementById('turn-{knee}').parentElement.querySelector('.ends').textContent"
    ));
    let deg = [limits.lower_rad(), limits.upper_rad()]
        .map(|rad| format!("{:.0}\u{b0}", rad.to_degrees()));
    assert_eq!(ends, deg.join(" to "));
    assert_eq!(browser.value("document.getElementById('pose-download').disabled"), true);
    let said = "document.getElementById('pose-said').textContent";
    assert_eq!(browser.value(said), "Two key frames make a motion.");

    // Three poses, a second apart at first; one later; one that no joint can reach so soon.
    let initial = robot.joints[knee].initial_rad.to_degrees();
    slide(&mut browser, knee, initial);
    press(&mut browser, "pose-add");
    slide(&mut browser, roll, -30.0);
    press(&mut browser, "pose-add");
    slide(&mut browser, roll, -10.0);
    assert_eq!(numbers(&browser.value("gaitway.poses().times")), [0.0, 1.0, 2.0]);
    after(&mut browser, 1.7);
    assert_eq!(numbers(&browser.value("gaitway.poses().times")), [0.0, 1.0, 2.7]);
    after(&mut browser, 0.1);
    let least = numbers(&browser.value("gaitway.poses().times"))[2] - 1.0;
    assert!(least > 0.5, "nearer rows are no key frames: {least} s");
    after(&mut browser, 1.7);
    // The last pose comes one earlier, goes back, is copied, and the copy deleted; what is undone is as it was.
    let poses = browser.value("gaitway.poses().angles");
    press(&mut browser, "pose-earlier");
    assert_ne!(browser.value("gaitway.poses().angles"), poses);
    press(&mut browser, "pose-later");
    assert_eq!(browser.value("gaitway.poses().angles"), poses);
    press(&mut browser, "pose-add");
    assert_eq!(browser.value("gaitway.poses().angles.length"), 4);
    press(&mut browser, "pose-delete");
    assert_eq!(browser.value("gaitway.poses().angles"), poses);
    press(&mut browser, "pose-delete");
    press(&mut browser, "pose-undo");
    assert_eq!(browser.value("gaitway.poses().angles"), poses);
    assert_eq!(numbers(&browser.value("gaitway.poses().times")), [0.0, 1.0, 2.7]);

    // What is downloaded is a motion of that robot for the program, and the same as on the page at every instant.
    let file = downloaded(&mut browser, &folder, "op3");
    let shown = browser.value("gaitway.poses()");
    let text = std::fs::read_to_string(&file).expect("a table");
    assert_eq!(text, shown["table"].as_str().expect("a table"));
    let motion = joints::read(&file, &names).expect("a table").expect("of joints");
    let (made, _, source) = motion.on(&robot, None, None).expect("a motion");
    assert_eq!(source.format, "key frames");
    assert!((made.rate_hz - shown["rate"].as_f64().expect("a rate")).abs() < 1e-9);
    let mut moved = 0.0_f64;
    for (joint, made_rad) in made.joints.iter().zip(&made.positions_rad) {
        let shown_rad = numbers(&shown["motion"][joint]);
        assert_eq!(shown_rad.len(), made_rad.len());
        for (at, (shown_rad, made_rad)) in shown_rad.iter().zip(made_rad).enumerate() {
            // Six places are written.
            assert!((shown_rad - made_rad).abs() < 2e-6, "{joint} at {at}");
        }
        let [low, high] = made_rad
            .iter()
            .fold([f64::MAX, f64::MIN], |[low, high], rad| [rad.min(low), rad.max(high)]);
        moved = moved.max(high - low);
    }
    assert!(moved > 0.3, "something moves: {moved} rad");
    let play = program::gaitway()
        .args([
            "play",
            file.to_str().expect("a path"),
            "--robot",
            "op3",
            "--bus",
            "sim",
            "--hang",
            "--json",
        ])
        .output()
        .expect("it runs");
    let report = program::json(&play);
    assert_eq!((play.status.code(), &report["outcome"]), (Some(0), &"done".into()), "{report:#}");
    assert!(report["referee"]["violations"].as_array().expect("a list").is_empty(), "{report:#}");
    assert_eq!(browser.complaints(), [""; 0]);
}

#[test]
fn a_joint_that_would_be_too_fast_gets_more_time_and_play_takes_that_as_it_is() {
    let Some(mut browser) = browser("fast") else { return };
    let folder = program::folder("fast-key-frames");
    let robot = Robot::load("so101").expect("a robot");
    let page = live::editor("so101").expect("a page").html().expect("a page");
    let path = folder.join("so101.html");
    std::fs::write(&path, page).expect("written");
    browser.look(1280, 900, false);
    // It opens from the disk as well.
    browser.open(&path, "");
    press(&mut browser, "pose-add");
    let limits = &robot.joints[0].limits;
    slide(&mut browser, 0, limits.upper_rad().to_degrees());
    press(&mut browser, "pose-add");
    slide(&mut browser, 0, limits.lower_rad().to_degrees());
    after(&mut browser, 0.6);
    let times = numbers(&browser.value("gaitway.poses().times"));
    let way_rad = limits.upper_rad() - limits.lower_rad();
    // A half sine is at most twice as fast as the mean; its acceleration 2 pi times the way by the square of its time.
    let took_s = times[2] - times[1];
    assert!(2.0 * way_rad / took_s <= limits.velocity_rad_s(), "{took_s} s");
    assert!(std::f64::consts::TAU * way_rad / took_s.powi(2) <= limits.acceleration_rad_s2());
    let said = browser.value("document.getElementById('pose-said').textContent");
    let expected = format!("{} needs {took_s:.1} s from key frame 2 to 3.", robot.joint_names()[0]);
    assert_eq!(said, expected.as_str());
    let file = downloaded(&mut browser, &folder, "so101");
    let play = program::gaitway()
        .args([
            "play",
            file.to_str().expect("a path"),
            "--robot",
            "so101",
            "--bus",
            "sim",
            "--json",
        ])
        .output()
        .expect("it runs");
    let report = program::json(&play);
    assert_eq!((play.status.code(), &report["outcome"]), (Some(0), &"done".into()), "{report:#}");
    assert_eq!(browser.complaints(), [""; 0]);
}

/// Presses at a place, moves, and lets go.
fn drag(browser: &mut Browser, from: [f64; 2], to: [f64; 2]) {
    let mut event = |kind: &str, [x, y]: [f64; 2]| {
        let event = json!({ "type": kind, "x": x, "y": y, "button": "left", "buttons": 1, "clickCount": 1 });
        browser.ask("Input.dispatchMouseEvent", event);
    };
    event("mousePressed", from);
    for part in 1..=8 {
        let share = f64::from(part) / 8.0;
        event("mouseMoved", [0, 1].map(|axis| from[axis] + share * (to[axis] - from[axis])));
    }
    event("mouseReleased", to);
}

#[test]
fn a_limb_that_is_dragged_follows_the_hand_within_its_limits_and_can_be_let_back() {
    let Some(mut browser) = browser("dragged") else { return };
    let robot = Robot::load("op3").expect("a robot");
    let view = LiveView::serving(live::editor("op3").expect("a page").html().expect("a page"), 0)
        .expect("a port");
    browser.look(1280, 900, false);
    browser.open_served(&view.url());
    // The middle of the link that the right elbow turns.
    let names = robot.joint_names();
    let elbow = names.iter().position(|name| name == "r_el").expect("a joint");
    let link = elbow + 1;
    let hand = "(JSON.parse(document.getElementById('data').textContent).robot.links[LINK].shapes.map(shape => shape.to_m || shape.centre_m)[0])".replace("LINK", &link.to_string());
    let seen = format!("gaitway.seen({link}, {hand})");
    let place = |browser: &mut Browser| -> [f64; 2] {
        numbers(&browser.value(&seen)).try_into().expect("x and y")
    };
    let before = place(&mut browser);
    let target = [before[0] - 25.0, before[1] - 45.0];
    drag(&mut browser, before, target);
    browser.frames(2);
    let there = place(&mut browser);
    let off = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
    assert!(
        off(there, target) < 0.4 * off(before, target),
        "{before:?} to {there:?}, not {target:?}"
    );
    let angles = numbers(&browser.value("gaitway.poses().angles[0]"));
    let turned: Vec<&str> = names
        .iter()
        .zip(&angles)
        .zip(&robot.joints)
        .filter(|((_, rad), joint)| (*rad - joint.initial_rad).abs() > 1e-3)
        .map(|((name, _), _)| name.as_str())
        .collect();
    assert!(
        !turned.is_empty()
            && turned.iter().all(|name| name.starts_with("r_sho") || *name == "r_el"),
        "{turned:?}"
    );
    // Far out of reach, nothing goes beyond its limits.
    drag(&mut browser, there, [there[0] - 500.0, there[1] - 300.0]);
    for (rad, joint) in
        numbers(&browser.value("gaitway.poses().angles[0]")).iter().zip(&robot.joints)
    {
        assert!(
            (joint.limits.lower_rad()..=joint.limits.upper_rad()).contains(rad),
            "{}: {rad}",
            joint.name
        );
    }
    // Beside the robot a drag turns the camera, and no joint.
    let poses = browser.value("gaitway.poses().angles");
    drag(&mut browser, [60.0, 120.0], [160.0, 140.0]);
    assert_eq!(browser.value("gaitway.poses().angles"), poses);
    let began = Instant::now();
    while browser.value("document.getElementById('pose-undo').disabled") != true {
        press(&mut browser, "pose-undo");
        assert!(began.elapsed() < PATIENCE);
    }
    for (rad, joint) in
        numbers(&browser.value("gaitway.poses().angles[0]")).iter().zip(&robot.joints)
    {
        assert!((rad - joint.initial_rad).abs() < HAIR_RAD, "{}", joint.name);
    }
    // What follows an undo at once is undone by itself.
    for deg in [20.0, 30.0] {
        slide(&mut browser, 0, deg);
        press(&mut browser, "pose-undo");
        let now = numbers(&browser.value("gaitway.poses().angles[0]"))[0];
        assert!((now - robot.joints[0].initial_rad).abs() < HAIR_RAD, "{now} after {deg} deg");
    }
    assert_eq!(browser.complaints(), [""; 0]);
}

#[test]
fn a_robot_that_is_led_by_hand_lends_its_pose_to_a_key_frame_and_is_seen_again_afterwards() {
    let Some(mut browser) = browser("lent") else { return };
    let view = LiveView::open(
        &live::page(Some("op3"), "led by hand", live::Shows::default()).expect("a page"),
        0,
    )
    .expect("a port");
    let robot = Robot::load("op3").expect("a robot");
    browser.look(1280, 900, false);
    browser.open_served(&view.url());
    let shoulder =
        robot.joint_names().iter().position(|name| name == "r_sho_roll").expect("a joint");
    let told = |time_s: f64, rad: f64| {
        let joints =
            (0..20).map(|joint| if joint == shoulder { [f64::NAN, rad] } else { [f64::NAN, 0.0] });
        view.tell(&LiveFrame::of(time_s, joints));
    };
    told(0.1, -0.5);
    until(&mut browser, "gaitway.figures().now === 0.1");
    assert_eq!(browser.value("document.getElementById('poses').hidden"), true);
    press(&mut browser, "edit");
    press(&mut browser, "pose-take");
    let pose = format!("gaitway.poses().angles.map(angles => angles[{shoulder}])");
    assert_eq!(numbers(&browser.value(&pose)), [-0.5]);
    // The hand goes on; what is drawn is the key frame.
    told(0.2, -1.0);
    until(&mut browser, "document.documentElement.dataset.live === 'on'");
    browser.frames(4);
    assert_eq!(browser.value("gaitway.figures().now"), 0);
    let beyond_rad = robot.joints[shoulder].limits.lower_rad() - 0.3;
    told(0.3, beyond_rad);
    // The third frame is there once its pose is what is lent.
    let began = Instant::now();
    loop {
        press(&mut browser, "pose-take");
        let lent = numbers(&browser.value(&pose));
        let last = lent[lent.len() - 1];
        if (last - robot.joints[shoulder].limits.lower_rad()).abs() < HAIR_RAD {
            break;
        }
        assert!(began.elapsed() < PATIENCE, "{lent:?}");
        press(&mut browser, "pose-undo");
    }
    // The stop button is still there, and the robot is seen again as it is.
    assert_eq!(browser.value("document.getElementById('stop').hidden"), false);
    press(&mut browser, "edit");
    told(0.4, -0.25);
    until(&mut browser, "gaitway.figures().now === 0.4");
    assert_eq!(browser.value("document.getElementById('signals').hidden"), false);
    assert!(!view.wants_to_stop());
    assert_eq!(browser.complaints(), [""; 0]);
}

#[test]
fn every_robot_that_ships_can_be_posed() {
    let Some(mut browser) = browser("all-robots") else { return };
    let folder = program::folder("all-robots-posed");
    browser.look(390, 844, true);
    for name in gaitway_profiles::robot_names() {
        let page = live::editor(name).and_then(|page| page.html()).expect("a page");
        let path = folder.join(format!("{name}.html"));
        std::fs::write(&path, page).expect("written");
        browser.open(&path, "");
        press(&mut browser, "pose-add");
        slide(&mut browser, 0, 5.0);
        browser.frames(2);
        assert_eq!(browser.complaints(), [""; 0], "{name}");
        let table = browser.value("gaitway.poses().table");
        let table = table.as_str().expect("a table");
        let robot = Robot::load(name).expect("a robot");
        let file = folder.join(format!("{name}.csv"));
        std::fs::write(&file, table).expect("written");
        let motion =
            joints::read(&file, &robot.joint_names()).expect("a table").expect("of joints");
        let (made, ..) = motion.on(&robot, None, None).expect("a motion of this robot");
        assert_eq!(made.joints, robot.joint_names(), "{name}");
        let wide = browser.value("document.documentElement.scrollWidth");
        assert_eq!(wide, 390, "{name}: nothing is wider than a phone");
    }
}
