//! The page that is served while something happens: to a browser, to programs that mean no good, and beside a robot
//! that moves.

mod aloud;
mod browser;
#[allow(dead_code)]
mod chromium;
mod page;
mod priority;
mod program;

use browser::browser;
use chromium::Browser;
use gaitway::body::Dof;
use gaitway::job::page::live::{self, Shows};
use gaitway::view::live::{LiveCounts, LiveEvent, LiveFrame, LiveQuantity, LiveView, MOST_KEPT};
use gaitway::view::session::{PersonNow, SessionFrame};
use gaitway::view::tracks::SpanKind;
use std::io::{BufRead, BufReader, ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::Path;
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

/// Place of r_sho_roll among OP3's joints: who turns it lifts the arm.
const RIGHT_SHOULDER_ROLL: usize = 2;
/// How long an answer may take on a busy machine.
const PATIENCE: Duration = Duration::from_secs(60);

fn view() -> LiveView {
    let page = live::page(Some("op3"), "a test", Shows::default()).expect("a page");
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

/// Something a page is told.
enum Told {
    Frame(serde_json::Value),
    /// The number of what happened, and what it is.
    Happened(u64, serde_json::Value),
}

/// All that a page is told, from its stream (HTML Living Standard, 9.2.6), until it ends.
fn stream(url: &str) -> impl Iterator<Item = Told> {
    let (host, path) = parts(url);
    let lines = BufReader::new(asked(host, &head(host, "GET", &format!("{path}frames"), "")));
    let (mut kind, mut id) = (String::new(), String::new());
    lines.lines().map_while(Result::ok).filter_map(move |line| {
        let (field, value) = line.split_once(": ").unwrap_or((&line, ""));
        match field {
            "event" => value.clone_into(&mut kind),
            "id" => value.clone_into(&mut id),
            "" => kind.clear(),
            "data" => {
                let value = serde_json::from_str(value).expect("JSON");
                return Some(match kind.as_str() {
                    "" => Told::Frame(value),
                    "happened" => Told::Happened(id.parse().expect("a number"), value),
                    other => panic!("{other}"),
                });
            }
            _ => {}
        }
        None
    })
}

/// The frames alone.
fn frames(url: &str) -> impl Iterator<Item = serde_json::Value> {
    stream(url).filter_map(|told| match told {
        Told::Frame(frame) => Some(frame),
        Told::Happened(..) => None,
    })
}

/// What happened alone.
fn happenings(url: &str) -> impl Iterator<Item = (u64, serde_json::Value)> {
    stream(url).filter_map(|told| match told {
        Told::Frame(_) => None,
        Told::Happened(number, what) => Some((number, what)),
    })
}

fn happened(time_s: f64, label: &str) -> LiveEvent {
    let (row, label) = ("told".to_owned(), label.to_owned());
    LiveEvent {
        time_s: Some(time_s),
        lasts_s: 0.0,
        kind: SpanKind::Wrong,
        row,
        label,
        links: Vec::new(),
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
fn what_happens_once_is_told_in_order_to_each_page_however_late_it_comes_and_at_the_very_end() {
    let view = view();
    let url = view.url();
    (0..3).for_each(|n| view.happened(happened(f64::from(n), &n.to_string())));
    let mut early = happenings(&url);
    let first: Vec<(u64, serde_json::Value)> = early.by_ref().take(3).collect();
    let told = |n: u64| serde_json::json!({ "time_s": n as f64, "lasts_s": 0.0, "kind": "wrong", "row": "told", "label": n.to_string() });
    assert_eq!(first, [(0, told(0)), (1, told(1)), (2, told(2))]);
    // Pictures come between, and only the newest of them; nothing of what happens is left out.
    let all = 3 + MOST_KEPT as u64;
    for n in 3..all {
        view.tell(&frame(n as f64, 0.1));
        view.happened(happened(n as f64, &n.to_string()));
    }
    let mut late = happenings(&url);
    let expected: Vec<u64> = (3..all).collect();
    assert_eq!(late.by_ref().take(MOST_KEPT).map(|of| of.0).collect::<Vec<_>>(), expected);
    // One that heard in time may have read slowly, and then the oldest are gone for it.
    let heard: Vec<u64> = early.by_ref().map(|of| of.0).take_while(|n| *n < all - 1).collect();
    assert!(heard.windows(2).all(|two| two[0] < two[1]), "{heard:?}");
    // The clock begins anew: whoever comes now is told that these were before.
    view.begins_anew();
    view.happened(happened(0.5, "after"));
    let anew: Vec<serde_json::Value> = happenings(&url).take(MOST_KEPT).map(|of| of.1).collect();
    assert!(anew[0]["time_s"].is_null() && anew[MOST_KEPT - 2]["time_s"].is_null());
    assert_eq!(anew[MOST_KEPT - 1]["time_s"], 0.5);
    // What is told at the very end still arrives.
    view.happened(happened(1.0, "the end"));
    drop(view);
    assert_eq!(late.last().expect("more").1["label"], "the end");
    assert_eq!(early.last().expect("more").1["label"], "the end");
}

#[test]
fn in_a_browser_what_happens_stands_in_the_list_and_on_the_time_line_and_another_run_begins_anew() {
    let Some(mut browser) = browser("happens") else { return };
    let view = view();
    browser.look(1280, 900, false);
    view.happened(LiveEvent { time_s: None, ..happened(0.0, "calibrated") });
    browser.open_served(&view.url());
    let list =
        "[...document.querySelectorAll('#events button')].map(of => of.textContent).join('|')";
    until(&mut browser, &format!("{list} === 'before: told: calibrated'"));
    assert_eq!(browser.value("document.getElementById('line').hidden"), true);
    for time_s in [1.0, 2.0, 3.0] {
        view.tell(&frame(time_s, 0.1));
        until(&mut browser, &format!("gaitway.figures().now === {time_s}"));
    }
    view.happened(happened(2.0, "<b>no answer</b>"));
    until(
        &mut browser,
        &format!("{list} === '2.00 s: told: <b>no answer</b>|before: told: calibrated'"),
    );
    assert_eq!(browser.value("document.getElementById('line').hidden"), false);
    assert_eq!(
        browser.value("document.getElementById('said').textContent"),
        "told: <b>no answer</b>"
    );
    browser.value("document.getElementById('events').open = true");
    browser.value("document.querySelector('#events button').click()");
    until(&mut browser, "gaitway.figures().now === 2 && !gaitway.figures().playing");
    // A stream that is begun again tells all of it once more: it is on the page once.
    assert_eq!(browser.value("document.querySelectorAll('#events li').length"), 2);
    view.begins_anew();
    view.tell(&frame(0.25, 0.1));
    until(&mut browser, "gaitway.figures().duration === 0.25");
    until(
        &mut browser,
        &format!("{list} === 'before: told: <b>no answer</b>|before: told: calibrated'"),
    );
    assert_eq!(browser.value("document.getElementById('line').hidden"), true);
    assert_eq!(browser.complaints(), [""; 0]);
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

    // Here a processor draws, which may be the one that moves a robot: ten pictures a second are enough, and of what is
    // looked at again each is drawn.
    assert_eq!(browser.value("gaitway.spares()"), true);
    let mut due = |spares: bool| {
        let stamps = "[0, 16, 99, 100, 133, 199, 200]";
        browser.value(&format!("gaitway.due({spares}, {stamps})")).to_string()
    };
    assert_eq!([due(true), due(false)], ["[0,100,200]", "[0,16,99,100,133,199,200]"]);

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
    let frame = frames(&url).next().expect("a frame");
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
    let mut seen: Vec<(f64, serde_json::Value)> = Vec::new();
    let (mut warm, mut parts_of_it) = (Vec::new(), Vec::new());
    let told = stream(&url);
    let mut told = told.inspect(|told| {
        if let Told::Happened(_, what) = told
            && what["kind"] == "part"
        {
            parts_of_it.push(what["label"].clone());
        }
    });
    for told in told.by_ref() {
        let Told::Frame(frame) = told else { continue };
        for other in frame["others"].as_array().into_iter().flatten() {
            warm.push(other["name"].as_str().expect("a name").to_owned());
        }
        seen.push((frame["time_s"].as_f64().expect("a time"), frame["present_rad"].clone()));
        if seen.len() > 10 && seen[seen.len() - 1].0 > 1.0 {
            break;
        }
    }
    assert!(seen.windows(2).all(|two| two[0].0 <= two[1].0), "time goes on");
    assert!(seen.iter().any(|frame| frame.1 != seen[0].1), "and the robot with it");
    // What OP3's servos tell with each angle, and what is read of them in turn.
    for quantity in ["current", "temperature", "voltage"] {
        assert!(warm.iter().any(|name| name == quantity), "{quantity}: {warm:?}");
    }
    let stopped = answered(asked(host, &head(host, "POST", &format!("{path}stop"), "")));
    assert!(stopped.starts_with("HTTP/1.1 204"), "{stopped}");
    let last = told.last().expect("more is told");
    let Told::Happened(_, end) = last else { panic!("the end is told last") };
    assert_eq!((&end["row"], &end["kind"]), (&"end".into(), &"wrong".into()), "{end}");
    assert!(end["label"].as_str().expect("words").starts_with("stopped: "), "{end}");
    assert_eq!(parts_of_it, ["approach", "motion"]);
    let output = child.wait_with_output().expect("it ends");
    let report = program::json(&output);
    assert_eq!((output.status.code(), &report["outcome"]), (Some(4), &"stopped".into()));
    assert!(report["referee"]["violations"].as_array().expect("a list").is_empty(), "{report:#}");
}

#[test]
fn what_is_foreseen_of_a_motion_is_told_as_it_begins_and_is_what_its_page_has() {
    let folder = program::folder("foreseen");
    // From where the robot starts, the right arm down and its hand to the left, into the hip.
    let cross: String = [(0.0, 0.0), (0.5, 0.0), (1.0, 0.5), (1.5, 1.0), (2.0, 1.0), (2.5, 1.0)]
        .iter()
        .map(|(t, part)| format!("{t},{},{}\n", -0.785 - 0.7 * part, 0.785 + 0.715 * part))
        .collect();
    let [arms, html] =
        ["arms.csv", "arms.html"].map(|name| folder.join(name).display().to_string());
    std::fs::write(&arms, format!("time_s,r_sho_roll_rad,r_el_rad\n{cross}")).unwrap();
    let order = ["view", "play", &arms, "--robot", "op3", "--bus", "sim:pty", "--hang", "--retime"];
    let (child, url) = serving(&[&order[..], &["--html", &html, "--json"]].concat());
    let touches: Vec<serde_json::Value> = happenings(&url)
        .map(|(_, what)| what)
        .filter(|what| what["row"] == "touches itself")
        .collect();
    let output = child.wait_with_output().expect("it ends");
    assert_eq!(program::json(&output)["outcome"], "done");
    let data = page::data(&std::fs::read_to_string(&html).expect("a page"));
    let spans = data["spans"].as_array().expect("a list");
    let of_page: Vec<&serde_json::Value> =
        spans.iter().filter(|span| span["row"] == "touches itself").collect();
    assert!(!of_page.is_empty() && of_page.len() == touches.len(), "{touches:?}, {of_page:?}");
    for (told, drawn) in touches.iter().zip(of_page) {
        for key in ["label", "links", "kind"] {
            assert_eq!(told[key], drawn[key]);
        }
        let of = |what: &serde_json::Value, key: &str| what[key].as_f64().expect("a time");
        let ends = [of(told, "time_s"), of(told, "time_s") + of(told, "lasts_s")];
        let drawn = [of(drawn, "start_s"), of(drawn, "end_s")];
        // The page has cycles as they were, what is foreseen as they will be.
        assert!(ends.iter().zip(drawn).all(|(a, b)| (a - b).abs() < 0.05), "{ends:?}, {drawn:?}");
    }
}

#[test]
fn a_robot_that_is_led_by_hand_is_seen_while_it_is_recorded_and_the_page_ends_the_recording() {
    priority::run_before_others();
    let folder = program::folder("recorded");
    let file = folder.join("hand.mcap").display().to_string();
    let arguments = ["record", "servos:op3@sim:pty", "--limp", "-o", &file, "--view", "--json"];
    let (child, url) = serving(&arguments);
    let (host, path) = parts(&url);
    // How sources are heard may be told before the first angle.
    let has_joints = |frame: &serde_json::Value| frame["present_rad"] != serde_json::json!([]);
    let seen: Vec<serde_json::Value> = frames(&url).filter(has_joints).take(10).collect();
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

#[test]
fn two_subjects_of_a_session_are_drawn_beside_each_other() {
    let Some(mut browser) = browser("two") else { return };
    let page = live::session_page("lab").expect("a page");
    let view = LiveView::open(&page, 0).expect("a port");
    browser.look(1280, 900, false);
    browser.open_served(&view.url());
    let points = gaitway::body::Joint::ALL.len() + gaitway::body::End::ALL.len();
    let at = |x_m: f64| vec![[x_m, 0.25, 1.0]; points];
    let told = |time_s: f64, persons: Vec<Vec<[f64; 3]>>| {
        let somebody = |places_m| PersonNow { places_m, sensors: Vec::new() };
        let persons = persons.into_iter().map(somebody).collect();
        view.tell(&SessionFrame { time_s, persons, ..SessionFrame::default() });
    };
    let places = "JSON.stringify(gaitway.persons(gaitway.figures().now).map(of => of[0] || null))";
    told(0.5, vec![at(0.5)]);
    until(&mut browser, &format!("{places} === '[[0.5,0.25,1],null]'"));
    // The second is known first where the first takes the sensors off.
    told(1.0, vec![Vec::new(), at(0.75)]);
    until(&mut browser, &format!("{places} === '[[0.5,0.25,1],[0.75,-0.75,1]]'"));
    told(1.5, vec![at(0.6), at(0.8)]);
    until(&mut browser, &format!("{places} === '[[0.6,0.25,1],[0.8,-0.75,1]]'"));
    assert_eq!(browser.complaints(), [""; 0]);
}

/// A virtual person with sensors on these segments, behind pseudo-terminals in this folder.
fn wearer(folder: &Path, segments: &str) -> Child {
    let mut command = program::gaitway();
    command.current_dir(folder).args(["simulate", "imus", "--pty", "worn", "--wear", segments]);
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("runs");
    let mut said = BufReader::new(child.stderr.take().expect("piped")).lines();
    assert!(said.by_ref().map_while(Result::ok).any(|line| line.contains("then:")));
    std::thread::spawn(move || said.map_while(Result::ok).for_each(drop));
    child
}

#[test]
fn sensors_that_are_recorded_are_seen_each_with_its_rate_and_who_is_gone_is_told() {
    priority::run_before_others();
    let folder = program::folder("heard");
    let mut worn = wearer(&folder, "torso,head");
    let mut command = program::gaitway();
    command.current_dir(&folder).arg("record");
    for name in ["torso", "head"] {
        command.arg(format!("{name}=imu:xsens-mti@serial:worn/{name}"));
    }
    command.args(["-o", "all.mcap", "--view", "--json"]);
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("runs");
    let url = page_of(&mut child);
    let mut told = stream(&url);
    let full = told.by_ref().find_map(|told| match told {
        Told::Frame(frame) => {
            let sensors = frame["sensors"].as_array()?;
            let is_full = |of: &serde_json::Value| {
                let usual = of["usual_rate_hz"].as_f64().expect("a rate");
                let rate = of["rate_hz"].as_f64().expect("a rate");
                usual > 0.0 && (0.5 * usual..1.5 * usual).contains(&rate) && of["silent"] == ""
            };
            (sensors.len() == 2 && sensors.iter().all(is_full)).then_some(frame)
        }
        Told::Happened(..) => None,
    });
    let facts = full.expect("frames go on")["facts"].to_string();
    assert!(facts.contains("\"recorded\""), "{facts}");
    let pid = rustix::process::Pid::from_child(&worn);
    rustix::process::kill_process(pid, rustix::process::Signal::INT).expect("told");
    worn.wait().expect("it ends");
    let gone: Vec<String> = told
        .filter_map(|told| match told {
            Told::Happened(_, what) if what["row"] == "sensors" => Some(what["label"].to_string()),
            _ => None,
        })
        .collect();
    for name in ["torso", "head"] {
        assert!(gone.iter().any(|label| label.contains(&format!("{name} is gone"))), "{gone:?}");
    }
    let output = child.wait_with_output().expect("it ends, as all are gone");
    assert_eq!(program::json(&output)["outcome"], "done_with_loss");
}

#[test]
fn whoever_wears_sensors_is_drawn_as_they_move_with_their_angles_and_without_a_robot() {
    let Some(mut browser) = browser("worn") else { return };
    priority::run_before_others();
    let folder = program::folder("worn");
    let mut worn = wearer(&folder, "torso,right_upper_arm,right_forearm");
    let mut command = program::gaitway();
    command.current_dir(&folder).args(["live", "--wear", "worn/wear.toml", "--dry-run", "--view"]);
    command.args(["--n-pose-after", "1s", "--moves", "bow", "--json"]);
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("runs");
    let url = page_of(&mut child);
    browser.look(1280, 900, false);
    browser.open_served(&url);
    let nobody = "document.getElementById('nothing').textContent";
    // Who stands a few steps away reads what to do.
    until(&mut browser, &format!("/^(N pose: upright|bow with a straight back)/.test({nobody})"));
    browser.frames(2);
    let seen = browser.value(&format!("[{nobody}, gaitway.lines()]"));
    // Until they are calibrated nothing of anybody is drawn.
    assert!(seen[0] == "" || seen[1] == 0, "{seen}");
    until(&mut browser, "document.querySelectorAll('#sensors tbody tr').length === 3");
    until(&mut browser, &format!("{nobody} === '' && gaitway.person(0).length > 20"));
    let told = "[...document.querySelectorAll('#events li')].map(of => of.textContent)";
    until(&mut browser, &format!("{told}.some(words => words.endsWith('calibration: good'))"));
    until(&mut browser, "gaitway.lines() > 20");
    // Axes of the sensors, each where it is worn and turned by something.
    until(
        &mut browser,
        "gaitway.sensors(gaitway.figures().now).filter(of => of.worn).map(of => of.name).sort().join() \
         === 'right_forearm,right_upper_arm,torso'",
    );
    let turned = browser.value(
        "gaitway.sensors(gaitway.figures().now).filter(of => of.worn).map(of => Math.hypot(...of.worn.turn))",
    );
    let turned: Vec<f64> = serde_json::from_value(turned).expect("numbers");
    assert!(turned.iter().all(|length| (length - 1.0).abs() < 1e-6), "{turned:?}");
    let names =
        browser.value("[...document.querySelectorAll('#choice button')].map(of => of.textContent)");
    let names: Vec<&str> =
        names.as_array().expect("names").iter().filter_map(|of| of.as_str()).collect();
    assert_eq!(names, Dof::ALL.map(Dof::name), "each angle can be looked at");
    // The walk swings the arm: what is drawn moves.
    let elbow = "JSON.stringify(gaitway.person(gaitway.figures().now)[7])";
    let at_first = browser.value(elbow);
    until(&mut browser, &format!("{elbow} !== {:?}", at_first.as_str().expect("text")));
    until(
        &mut browser,
        "/age of the pose: \\d+ ms/.test(document.getElementById('known').textContent)",
    );
    let (host, path) = parts(&url);
    let stopped = answered(asked(host, &head(host, "POST", &format!("{path}stop"), "")));
    assert!(stopped.starts_with("HTTP/1.1 204"), "{stopped}");
    assert_eq!(program::json(&child.wait_with_output().expect("it ends"))["outcome"], "done");
    // Who spoke as long as somebody told of them speaks no more.
    until(
        &mut browser,
        "[...document.querySelectorAll('#sensors tbody tr')].every(row => row.cells[3].textContent === 'the program has ended')",
    );
    assert_eq!(browser.complaints(), [""; 0]);
    let pid = rustix::process::Pid::from_child(&worn);
    rustix::process::kill_process(pid, rustix::process::Signal::INT).expect("told");
    worn.wait().expect("it ends");
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
    let mut shoulder_rad = frames(&url).map(|frame| {
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
        (&["live", "--from", "file:bow", "--dry-run", "--view"], "a page shows a robot"),
    ] {
        let output = program::gaitway().args(arguments).output().expect("it runs");
        let said = program::words(&output);
        assert!(!output.status.success() && said.contains(words), "{arguments:?}: {said}");
    }
}
