//! The page that is served while something happens: to a browser, to programs that mean no good, and beside a robot
//! that moves.

mod aloud;
mod browser;
#[allow(dead_code)]
mod chromium;
mod priority;
mod program;

use browser::browser;
use chromium::Browser;
use gaitway::job::page::live;
use gaitway::view::live::{LiveCounts, LiveFrame, LiveQuantity, LiveView};
use std::io::{BufRead, BufReader, ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

/// Place of r_sho_roll among OP3's joints: who turns it lifts the arm.
const RIGHT_SHOULDER_ROLL: usize = 2;
/// How long an answer may take on a busy machine.
const PATIENCE: Duration = Duration::from_secs(60);

fn view() -> LiveView {
    let page = live::page("op3", "a test").expect("a page");
    LiveView::open(&page, 0).expect("a port")
}

/// Address and path of a page.
fn parts(url: &str) -> (SocketAddr, &str) {
    let rest = url.strip_prefix("http://").expect("a page");
    let (host, path) = rest.split_at(rest.find('/').expect("a path"));
    (host.parse().expect("an address"), path)
}

fn connected(host: SocketAddr) -> TcpStream {
    let stream = TcpStream::connect(host).expect("it listens");
    stream.set_read_timeout(Some(PATIENCE)).expect("a timeout");
    stream
}

fn asked(host: SocketAddr, text: &str) -> TcpStream {
    let mut stream = connected(host);
    // One that is refused at once is closed before it has asked.
    let _ = stream.write_all(text.as_bytes());
    stream
}

fn head(host: SocketAddr, way: &str, path: &str, more: &str) -> String {
    format!("{way} {path} HTTP/1.1\r\nHost: {host}\r\n{more}\r\n")
}

/// All of an answer; empty if the connection was closed.
fn answered(mut stream: TcpStream) -> String {
    let mut bytes = Vec::new();
    match stream.read_to_end(&mut bytes) {
        Err(error) if error.kind() != ErrorKind::ConnectionReset => panic!("{error}"),
        _ => String::from_utf8_lossy(&bytes).into_owned(),
    }
}

fn get(host: SocketAddr, path: &str) -> String {
    answered(asked(host, &head(host, "GET", path, "")))
}

/// Waits until something counted is so.
fn counted(view: &LiveView, is_so: impl Fn(LiveCounts) -> bool) {
    let began = Instant::now();
    while !is_so(view.counts()) {
        assert!(began.elapsed() < PATIENCE, "{:?}", view.counts());
        std::thread::sleep(Duration::from_millis(10));
    }
}

fn frame(time_s: f64, rad: f64) -> LiveFrame {
    LiveFrame::of(time_s, [[rad, -rad], [f64::NAN, 0.25]].into_iter())
}

#[test]
fn who_knows_the_address_gets_the_page_and_what_is_told_and_nobody_else_does() {
    let view = view();
    let url = view.url();
    let (host, path) = parts(&url);
    assert!(host.ip().is_loopback());
    let page = get(host, path);
    assert!(page.starts_with("HTTP/1.1 200 OK\r\n") && page.ends_with("</html>\n"));
    assert!(page.contains("connect-src 'self'") && page.contains("frame-ancestors 'none'"));

    view.tell(&frame(1.5, 0.5));
    let mut stream = BufReader::new(asked(host, &head(host, "GET", &format!("{path}frames"), "")));
    let mut next = || loop {
        let mut line = String::new();
        stream.read_line(&mut line).expect("a line");
        if let Some(data) = line.strip_prefix("data: ") {
            return serde_json::from_str::<serde_json::Value>(data).expect("JSON");
        }
    };
    let expected = |time_s: f64, rad: f64| serde_json::json!({ "time_s": time_s, "goal_rad": [rad, null], "present_rad": [-rad, 0.25] });
    assert_eq!(next(), expected(1.5, 0.5));
    view.tell(&frame(1.6, 0.75));
    assert_eq!(next(), expected(1.6, 0.75));

    let token = path.trim_matches('/');
    assert!(token.len() == 32 && token.bytes().all(|byte| byte.is_ascii_hexdigit()));
    for wrong in ["/", "/index.html", &path[..path.len() - 1], "/00000000000000000000000000000000/"]
    {
        assert!(get(host, wrong).starts_with("HTTP/1.1 404"), "{wrong}");
    }
    for strange in ["Origin: https://example.org\r\n", "Origin: null\r\n"] {
        for (way, place) in [("GET", ""), ("GET", "frames"), ("POST", "stop")] {
            let answer =
                answered(asked(host, &head(host, way, &format!("{path}{place}"), strange)));
            assert!(answer.starts_with("HTTP/1.1 403"), "{way} {place}: {answer}");
        }
    }
    let rebound = format!("GET {path} HTTP/1.1\r\nHost: example.org:{}\r\n\r\n", host.port());
    assert!(answered(asked(host, &rebound)).starts_with("HTTP/1.1 403"));
    assert!(!view.wants_to_stop());
    assert!(
        answered(asked(host, &head(host, "POST", &format!("{path}stop"), "")))
            .starts_with("HTTP/1.1 204")
    );
    assert!(view.wants_to_stop());
    let other = self::view().url();
    assert_ne!(parts(&other).1, path, "a token is used once");
}

#[test]
fn garbage_floods_and_clients_that_never_read_are_refused_counted_and_in_nobodys_way() {
    let view = view();
    let url = view.url();
    let (host, path) = parts(&url);
    for garbage in ["\r\n\r\n", "\u{0}\u{1}\u{2}\r\n\r\n", "GET\r\n\r\n", "G / \u{fffd}\r\n\r\n"] {
        assert!(answered(asked(host, garbage)).starts_with("HTTP/1.1 400"), "{garbage:?}");
    }
    // A head without an end.
    let endless = "GET / HTTP/1.1\r\n".to_owned() + &"X: y\r\n".repeat(4000);
    let _ = answered(asked(host, &endless));
    let refused = view.counts().refused;
    assert!(refused >= 5, "{refused}");

    // Nobody is at home behind these.
    let silent: Vec<TcpStream> = (0..1000).map(|_| connected(host)).collect();
    counted(&view, |counts| counts.refused >= refused + 900);
    drop(silent);
    counted(&view, |_| get(host, path).starts_with("HTTP/1.1 200"));

    let stalled = view.counts().stalled;
    // These ask for all that is told and read nothing, while much is told.
    let frames = head(host, "GET", &format!("{path}frames"), "");
    let deaf: Vec<TcpStream> = (0..16).map(|_| asked(host, &frames)).collect();
    counted(&view, |counts| counts.streams >= 16);
    let too_many = answered(asked(host, &frames));
    assert!(too_many.starts_with("HTTP/1.1 503"), "{too_many}");
    let much = LiveFrame::of(1.0, std::iter::repeat_n([0.123_45, -0.543_21], 20_000));
    let (mut told, began) = (0, Instant::now());
    while view.counts().stalled < stalled + 16 {
        assert!(began.elapsed() < PATIENCE, "{:?}", view.counts());
        view.tell(&much);
        told += 1;
        std::thread::sleep(Duration::from_millis(20));
    }
    assert!(told > 20, "whoever tells does not wait: {told}");
    assert!(get(host, path).starts_with("HTTP/1.1 200"), "places are free again");
    drop(deaf);
}

/// Asks the page again and again until an expression is true.
fn until(browser: &mut Browser, expression: &str) {
    let began = Instant::now();
    while browser.value(expression) != true {
        assert!(began.elapsed() < PATIENCE, "never so: {expression}");
        browser.frames(2);
    }
}

#[test]
fn in_a_browser_the_robot_moves_as_it_is_told_and_a_button_stops_it() {
    let Some(mut browser) = browser("live") else { return };
    let view = view();
    browser.look(1280, 900, false);
    browser.open_served(&view.url());
    until(&mut browser, "document.documentElement.dataset.live === 'waiting'");
    let shoulder = |rad: f64| {
        (0..20).map(move |joint| if joint == RIGHT_SHOULDER_ROLL { [rad; 2] } else { [0.0; 2] })
    };
    let hand = "gaitway.links(gaitway.figures().now, 'present').map(link => link.slice(0, 3))";
    let mut seen = Vec::new();
    for (time_s, rad) in [(0.1, 0.0), (0.2, 1.0), (0.3, 1.0)] {
        view.tell(&LiveFrame::of(time_s, shoulder(rad)));
        until(&mut browser, &format!("gaitway.figures().now === {time_s}"));
        seen.push(browser.value(hand));
    }
    assert_ne!(seen[0], seen[1], "the arm moves");
    assert_eq!(seen[1], seen[2]);
    // What was is looked at again, and what comes meanwhile is not lost.
    browser.key("Home", "Home");
    view.tell(&LiveFrame::of(0.4, shoulder(0.5)));
    until(&mut browser, "gaitway.figures().duration === 0.4");
    assert_eq!(browser.value("gaitway.figures().now"), 0);
    browser.key("End", "End");
    until(&mut browser, "gaitway.figures().now === 0.4");
    browser.value("document.getElementById('play').click()");
    view.tell(&LiveFrame::of(0.5, shoulder(0.5)));
    until(&mut browser, "gaitway.figures().duration === 0.5");
    assert_eq!(browser.value("gaitway.figures().now"), 0.4);
    // A run that begins anew forgets the one before.
    view.tell(&LiveFrame::of(0.05, shoulder(0.0)));
    until(&mut browser, "gaitway.figures().duration === 0.05");

    assert!(!view.wants_to_stop());
    browser.value("document.getElementById('stop').click()");
    until(&mut browser, "document.getElementById('stop').textContent === 'told to stop'");
    assert!(view.wants_to_stop());
    assert_eq!(browser.complaints(), [""; 0]);
    drop(view);
    until(&mut browser, "document.documentElement.dataset.live === 'off'");
    assert_eq!(browser.value("document.getElementById('stop').disabled"), true);
}

#[test]
fn what_else_is_read_of_a_joint_can_be_looked_at_once_it_has_come() {
    let Some(mut browser) = browser("quantities") else { return };
    let view = view();
    browser.look(1280, 900, false);
    browser.open_served(&view.url());
    let offered =
        "[...document.querySelectorAll('.quantities label')].map(of => of.textContent.trim())";
    let told = |time_s: f64, warm_c: Option<f64>| {
        let values: Vec<_> = (0..20).map(|joint| warm_c.map(|c| c + f64::from(joint))).collect();
        let (name, unit) = ("temperature", "\u{b0}C");
        let others = warm_c.map(|_| LiveQuantity { name, unit, values }).into_iter().collect();
        view.tell(&LiveFrame {
            others,
            ..LiveFrame::of(time_s, std::iter::repeat_n([0.1; 2], 20))
        });
    };
    told(0.1, None);
    until(&mut browser, "gaitway.figures().now === 0.1");
    let before = browser.value(offered);
    assert!(!before.as_array().expect("names").contains(&"temperature".into()), "{before}");
    told(0.2, Some(40.0));
    until(&mut browser, &format!("{offered}.includes('temperature')"));
    browser.value("[...document.querySelectorAll('.quantities label')].find(of => of.textContent.trim() === 'temperature').click()");
    // The joint that is chosen at first is the robot's first.
    let says = |degrees: &str| {
        format!(
            "[...document.querySelectorAll('figcaption')].some(of => of.textContent.includes('temperature') && of.textContent.includes('{degrees} \u{b0}C'))"
        )
    };
    until(&mut browser, &says("40.0"));
    // What is not read again just now is what it was.
    told(0.3, None);
    until(&mut browser, "gaitway.figures().now === 0.3");
    until(&mut browser, &says("40.0"));
    told(0.4, Some(41.5));
    until(&mut browser, &says("41.5"));
    // Another run knows nothing of that.
    told(0.05, None);
    until(&mut browser, "gaitway.figures().duration === 0.05");
    until(
        &mut browser,
        "[...document.querySelectorAll('figcaption')].some(of => of.textContent.includes('temperature') && of.textContent.includes('no reading'))",
    );
    assert_eq!(browser.complaints(), [""; 0]);
}

#[test]
fn a_robot_that_is_looked_at_tells_how_warm_it_is() {
    let (mut child, url) = serving(&["view", "op3", "--bus", "sim:pty"]);
    let (host, path) = parts(&url);
    let stream = asked(host, &head(host, "GET", &format!("{path}frames"), ""));
    let frames = BufReader::new(stream).lines().map(|line| line.expect("a line"));
    let mut frames = frames.filter_map(|line| line.strip_prefix("data: ").map(str::to_owned));
    let frame: serde_json::Value =
        serde_json::from_str(&frames.next().expect("a frame")).expect("JSON");
    let others = frame["others"].as_array().expect("a list");
    let warm = others.iter().find(|of| of["name"] == "temperature").expect("it is read");
    assert_eq!(warm["unit"], "\u{b0}C");
    let values = warm["values"].as_array().expect("joints");
    assert!(values.len() == 20 && values.iter().all(|c| c.as_f64().is_some_and(|c| c > 0.0)));
    let stopped = answered(asked(host, &head(host, "POST", &format!("{path}stop"), "")));
    assert!(stopped.starts_with("HTTP/1.1 204"), "{stopped}");
    assert!(child.wait().expect("it ends").success());
}

/// A command that serves a page, and where.
fn serving(arguments: &[&str]) -> (Child, String) {
    let mut command = program::gaitway();
    command.args(arguments).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().expect("the program");
    let url = page_of(&mut child);
    (child, url)
}

/// Where a command that was begun serves its page.
fn page_of(child: &mut Child) -> String {
    let mut said = BufReader::new(child.stderr.take().expect("piped"));
    let mut all = String::new();
    let url = loop {
        let mut line = String::new();
        assert!(said.read_line(&mut line).expect("words") > 0, "it ended: {all}");
        if let Some(url) = line.trim().strip_prefix("view ") {
            break url.trim().to_owned();
        }
        all += &line;
    };
    std::thread::spawn(move || std::io::copy(&mut said, &mut std::io::sink()));
    url
}

#[test]
fn a_robot_that_plays_is_seen_to_move_and_comes_to_rest_when_the_page_says_so() {
    priority::run_before_others();
    let arguments = ["view", "play", "bow:60s", "--robot", "op3", "--bus", "sim:pty", "--json"];
    let (child, url) = serving(&arguments);
    let (host, path) = parts(&url);
    let stream = asked(host, &head(host, "GET", &format!("{path}frames"), ""));
    let mut seen: Vec<(f64, serde_json::Value)> = Vec::new();
    for line in BufReader::new(stream).lines() {
        let line = line.expect("a line");
        let Some(data) = line.strip_prefix("data: ") else { continue };
        let frame: serde_json::Value = serde_json::from_str(data).expect("JSON");
        seen.push((frame["time_s"].as_f64().expect("a time"), frame["present_rad"].clone()));
        if seen.len() > 10 && seen[seen.len() - 1].0 > 1.0 {
            break;
        }
    }
    assert!(seen.windows(2).all(|two| two[0].0 <= two[1].0), "time goes on");
    assert!(seen.iter().any(|frame| frame.1 != seen[0].1), "and the robot with it");
    let stopped = answered(asked(host, &head(host, "POST", &format!("{path}stop"), "")));
    assert!(stopped.starts_with("HTTP/1.1 204"), "{stopped}");
    let output = child.wait_with_output().expect("it ends");
    let report = program::json(&output);
    assert_eq!((output.status.code(), &report["outcome"]), (Some(4), &"stopped".into()));
    assert!(report["referee"]["violations"].as_array().expect("a list").is_empty(), "{report:#}");
}

#[test]
fn a_robot_that_is_led_by_hand_is_seen_while_it_is_recorded_and_the_page_ends_the_recording() {
    priority::run_before_others();
    let folder = program::folder("recorded");
    let file = folder.join("hand.mcap").display().to_string();
    let arguments = ["record", "servos:op3@sim:pty", "--limp", "-o", &file, "--view", "--json"];
    let (child, url) = serving(&arguments);
    let (host, path) = parts(&url);
    let stream = asked(host, &head(host, "GET", &format!("{path}frames"), ""));
    let frames = BufReader::new(stream).lines().map(|line| line.expect("a line"));
    let frames = frames.filter_map(|line| line.strip_prefix("data: ").map(str::to_owned));
    let seen: Vec<serde_json::Value> =
        frames.take(10).map(|data| serde_json::from_str(&data).expect("JSON")).collect();
    let times: Vec<f64> =
        seen.iter().map(|frame| frame["time_s"].as_f64().expect("a time")).collect();
    assert!(times.windows(2).all(|two| two[0] < two[1]), "{times:?}");
    let last = seen[9]["present_rad"].as_array().expect("joints");
    assert!(last.len() == 20 && last.iter().all(serde_json::Value::is_number), "{last:?}");
    let stopped = answered(asked(host, &head(host, "POST", &format!("{path}stop"), "")));
    assert!(stopped.starts_with("HTTP/1.1 204"), "{stopped}");
    let output = child.wait_with_output().expect("it ends");
    let report = program::json(&output);
    assert_eq!((output.status.code(), &report["outcome"]), (Some(0), &"done".into()), "{report:#}");
    let recorded = gaitway::recording::read(std::path::Path::new(&file)).expect("a recording");
    // Told to who looks on is what is recorded.
    let cycle = recorded.cycles.last().expect("a cycle");
    let shoulder_rad = cycle.joints[RIGHT_SHOULDER_ROLL].present_position_rad.expect("read");
    let shown_rad = last[RIGHT_SHOULDER_ROLL].as_f64().expect("a number");
    assert!((shoulder_rad - shown_rad).abs() < 1e-4, "{shoulder_rad} rad, {shown_rad} shown");
}

/// A hand turns a joint of a virtual robot, through its control channel.
#[test]
fn a_virtual_robot_is_seen_as_it_really_is_and_the_page_ends_it() {
    let mut command = program::gaitway();
    command.args(["simulate", "op3", "--control", "stdin", "--view"]);
    command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped());
    let mut child = command.spawn().expect("the program");
    let url = page_of(&mut child);
    let (host, path) = parts(&url);
    let stream = asked(host, &head(host, "GET", &format!("{path}frames"), ""));
    let frames = BufReader::new(stream).lines().map(|line| line.expect("a line"));
    let frames = frames.filter_map(|line| line.strip_prefix("data: ").map(str::to_owned));
    let mut shoulder_rad = frames.map(|data| {
        let frame: serde_json::Value = serde_json::from_str(&data).expect("JSON");
        assert!(frame["goal_rad"][0].is_null(), "what it was asked, its servos know");
        frame["present_rad"][RIGHT_SHOULDER_ROLL].as_f64().expect("a place")
    });
    let at_first_rad = shoulder_rad.next().expect("a frame");
    let mut hand = child.stdin.take().expect("piped");
    let order = r#"{"do": "hand", "joint": "r_sho_roll", "to_rad": -0.2}"#;
    writeln!(hand, "{order}").expect("it listens");
    let began = Instant::now();
    let arrived = shoulder_rad.find(|rad| (rad + 0.2).abs() < 0.01 || began.elapsed() > PATIENCE);
    let arrived_rad = arrived.expect("frames go on");
    assert!((arrived_rad + 0.2).abs() < 0.01, "from {at_first_rad} to {arrived_rad} rad");
    assert!((at_first_rad - arrived_rad).abs() > 0.3, "from {at_first_rad} to {arrived_rad} rad");
    let stopped = answered(asked(host, &head(host, "POST", &format!("{path}stop"), "")));
    assert!(stopped.starts_with("HTTP/1.1 204"), "{stopped}");
    assert_eq!(child.wait().expect("it ends").code(), Some(0));
}

#[test]
fn a_file_is_served_until_a_signal_and_what_cannot_be_seen_is_refused() {
    let folder = program::folder("files");
    let file = folder.join("bow.bvh").display().to_string();
    let made = program::gaitway().args(["synth", "bow", "-o", &file]).output().expect("it runs");
    assert!(made.status.success(), "{}", program::words(&made));
    let (mut child, url) = serving(&["view", &file]);
    let (host, path) = parts(&url);
    let page = get(host, path);
    assert!(page.starts_with("HTTP/1.1 200") && page.contains("bow"), "{}", &page[..200]);
    let pid = rustix::process::Pid::from_child(&child);
    rustix::process::kill_process(pid, rustix::process::Signal::INT).expect("told");
    assert_eq!(child.wait().expect("it ends").code(), Some(0));

    for (arguments, words) in [
        (&["view", "play", "bow", "--robot", "op3", "--bus", "sim"][..], "--bus sim:pty"),
        (&["play", "bow", "--robot", "op3", "--bus", "sim", "--view"], "--bus sim:pty"),
        (&["view", &file, "--mirror"], "a file is shown as it is"),
        (&["view", "nobody.bvh"], "there is no such file"),
        (&["record", "lines@/dev/null", "-o", "x.mcap", "--view"], "a page shows a robot"),
        (&["live", "--from", "a=b", "--dry-run", "--view"], "a page shows a robot"),
    ] {
        let output = program::gaitway().args(arguments).output().expect("it runs");
        let said = program::words(&output);
        assert!(!output.status.success() && said.contains(words), "{arguments:?}: {said}");
    }
}
