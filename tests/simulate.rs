//! `simulate` as a process: what it says first, its doors, its faults, and how it ends.

mod program;

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Command, Stdio};

/// DYNAMIXEL 2.0: ping ID 1 (e-Manual, Protocol 2.0).
const PING_1: [u8; 10] = [0xFF, 0xFF, 0xFD, 0x00, 0x01, 0x03, 0x00, 0x01, 0x19, 0x4E];

struct Simulator {
    child: Child,
    stdout: BufReader<ChildStdout>,
}

impl Simulator {
    fn start(arguments: &[&str]) -> Self {
        let mut child = crate::program::gaitway()
            .arg("simulate")
            .args(arguments)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the simulator");
        let stdout = BufReader::new(child.stdout.take().expect("its output"));
        Self { child, stdout }
    }

    fn line(&mut self) -> String {
        let mut line = String::new();
        self.stdout.read_line(&mut line).expect("a line");
        line.trim_end().to_string()
    }

    /// Ends it as Ctrl-C does; returns what it said to people.
    fn end(mut self) -> String {
        let pid = self.child.id().to_string();
        let killed = Command::new("kill").args(["-INT", &pid]).status().expect("kill");
        assert!(killed.success());
        let mut said = String::new();
        self.child.stderr.take().expect("its remarks").read_to_string(&mut said).expect("text");
        assert_eq!(self.child.wait().expect("an end").code(), Some(0), "{said}");
        said
    }
}

impl Drop for Simulator {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn ping(port: &mut TcpStream) -> Vec<u8> {
    port.write_all(&PING_1).expect("a write");
    let mut answer = vec![0; 14];
    port.read_exact(&mut answer).expect("an answer");
    answer
}

#[test]
fn over_tcp_it_says_the_address_first_and_answers_there() {
    let mut simulator = Simulator::start(&["op3", "--tcp", "0"]);
    let line = simulator.line();
    let address = line.strip_prefix("tcp:").expect("an address");
    assert!(address.starts_with("127.0.0.1:"), "{address}");
    for _ in 0..2 {
        let mut port = TcpStream::connect(address).expect("a connection");
        assert_eq!(ping(&mut port)[..5], PING_1[..5]);
    }
    assert!(simulator.end().contains("referee: no rule broken"));
}

/// How often the thread that serves the first line has gone to sleep.
fn sleeps(simulator: &Simulator) -> u64 {
    let tasks = format!("/proc/{}/task", simulator.child.id());
    let threads = std::fs::read_dir(tasks).expect("threads").flatten().map(|task| task.path());
    let named = |thread: &PathBuf| {
        std::fs::read_to_string(thread.join("comm")).is_ok_and(|name| name.trim_end() == "door 0")
    };
    let door = threads.filter(named).collect::<Vec<_>>();
    assert_eq!(door.len(), 1, "one thread serves the line");
    let status = std::fs::read_to_string(door[0].join("status")).expect("its counts");
    let count = status.lines().find_map(|line| line.strip_prefix("voluntary_ctxt_switches:"));
    count.and_then(|count| count.trim().parse().ok()).expect("a count")
}

// Each time it wakes it waits for its turn, on a busy machine for some milliseconds; the client looks at its
// clock meanwhile.
#[test]
fn a_transaction_wakes_the_line_as_often_as_something_happens_on_it() {
    const TRANSACTIONS: u64 = 200;
    for (options, wakes) in [
        // The instruction.
        (&["--no-line-timing"][..], 1),
        // The instruction, its end on the line, the end of the status.
        (&[][..], 3),
    ] {
        let bench = ["--servo", "xm430-w350:1", "--baud", "57600", "--tcp", "0"];
        let mut simulator = Simulator::start(&[&bench[..], options].concat());
        let line = simulator.line();
        let mut port = TcpStream::connect(line.strip_prefix("tcp:").expect("an address"))
            .expect("a connection");
        ping(&mut port);
        let before = sleeps(&simulator);
        for _ in 0..TRANSACTIONS {
            ping(&mut port);
        }
        let each = (sleeps(&simulator) - before) as f64 / TRANSACTIONS as f64;
        // A quarter of a second without bytes wakes it too.
        assert!(each < wakes as f64 + 0.5, "{options:?}: {each} sleeps in each transaction");
    }
}

#[test]
fn each_line_of_a_robot_is_a_terminal_with_its_own_link() {
    let folder = crate::program::folder("simulate-lines");
    let link = folder.join("poppy").display().to_string();
    let mut simulator = Simulator::start(&["poppy-humanoid", "--pty", &link]);
    let mut links = Vec::new();
    for _ in 0..2 {
        let line = simulator.line();
        let (path, name) = line.split_once(' ').expect("a path and a name");
        let own = PathBuf::from(format!("{link}-{name}"));
        assert_eq!(std::fs::read_link(&own).expect("a link"), Path::new(path));
        links.push(own);
    }
    assert_ne!(links[0], links[1]);
    simulator.end();
    for link in links {
        assert!(std::fs::symlink_metadata(&link).is_err(), "{} is left", link.display());
    }
}

#[test]
fn faults_of_a_script_strike_and_are_told() {
    let script = crate::program::folder("simulate-faults").join("faults.toml");
    let text = "[[fault]]\nkind = 'lie'\nline = 'body'\nid = 1\nat = 0\nxor = 255\nnth = 1\n";
    std::fs::write(&script, text).expect("a script");
    let script = script.display().to_string();
    let mut simulator = Simulator::start(&["op3", "--tcp", "0", "--faults", &script]);
    let line = simulator.line();
    let mut port = TcpStream::connect(&line["tcp:".len()..]).expect("a connection");
    let answers: Vec<u8> = (0..3).map(|_| ping(&mut port)[9]).collect();
    assert_eq!(answers, [0xFC, 0x03, 0xFC], "1020 is 0x03FC");
    let said = simulator.end();
    assert!(said.contains("s: lie, r_sho_pitch, status 1"), "{said}");
    assert!(said.contains("faults: 1 struck"), "{said}");
}

/// Goal position of ID 1 in DYNAMIXEL 2.0, two of them: 4000 and 100 counts (6 rad apart).
const GOALS: [[u8; 16]; 2] = [
    [0xFF, 0xFF, 0xFD, 0, 1, 9, 0, 3, 116, 0, 0xA0, 0x0F, 0, 0, 0x1E, 0x09],
    [0xFF, 0xFF, 0xFD, 0, 1, 9, 0, 3, 116, 0, 0x64, 0, 0, 0, 0xF3, 0xD9],
];
/// Torque Enable 1.
const TORQUE: [u8; 13] = [0xFF, 0xFF, 0xFD, 0, 1, 6, 0, 3, 64, 0, 1, 0xDB, 0x66];

#[test]
fn a_client_that_jumps_is_told_so_unless_nobody_wants_to_know() {
    for (options, told) in [(&[][..], true), (&["--no-referee"], false)] {
        let mut simulator = Simulator::start(&[&["op3", "--tcp", "0"], options].concat());
        let line = simulator.line();
        let mut port = TcpStream::connect(&line["tcp:".len()..]).expect("a connection");
        for instruction in [&TORQUE[..], &GOALS[0], &GOALS[1], &GOALS[0]] {
            port.write_all(instruction).expect("a write");
            let mut status = [0; 11];
            port.read_exact(&mut status).expect("a status");
            assert_eq!(status[8], 0, "refused: {status:02X?}");
        }
        let said = simulator.end();
        assert!(!said.contains("no rule broken"), "{said}");
        let words =
            "a careful host lets no goal step further than its joint can turn meanwhile: R2 at";
        assert_eq!(said.matches(words).count(), if told { 3 } else { 0 }, "{said}");
        assert_eq!(said.contains("not as a careful host does it; 3 goals written"), told, "{said}");
        assert_eq!(said.contains("referee"), told, "{said}");
    }
}

#[test]
fn a_wrong_script_is_refused_with_its_place() {
    let script = crate::program::folder("simulate-wrong").join("faults.toml");
    std::fs::write(&script, "\n[[fault]]\nkind = 'mute'\njoint = 'r_knee'\nnht = 3\n")
        .expect("a script");
    let output = crate::program::gaitway()
        .args(["simulate", "op3", "--faults"])
        .arg(&script)
        .output()
        .expect("a run");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success());
    assert!(output.stdout.is_empty());
    for part in ["fault 1 (line 2), key nht", "allowed", "nth"] {
        assert!(said.contains(part), "{said}");
    }
}

#[test]
fn a_bench_is_one_line_and_answers_as_its_servos_do() {
    let bench = ["--servo", "xm430_w350:1,2", "--servo", "sts3215:3", "--baud", "1000000"];
    let mut simulator = Simulator::start(&[&bench[..], &["--tcp", "0"]].concat());
    let line = simulator.line();
    let mut port = TcpStream::connect(&line["tcp:".len()..]).expect("a connection");
    // An XM430-W350 has the model number 1020 (e-Manual).
    assert_eq!(ping(&mut port)[9..11], 1020_u16.to_le_bytes());
    port.write_all(&[0xFF, 0xFF, 3, 2, 1, 0xF9]).expect("a write");
    let mut answer = [0; 6];
    port.read_exact(&mut answer).expect("an answer");
    assert_eq!(answer, [0xFF, 0xFF, 3, 2, 0, 0xFA]);
    assert!(simulator.end().contains("virtual bench with 3 servos"));
}

#[test]
fn a_bench_that_cannot_be_says_what_could() {
    for (arguments, words) in [
        (&["--servo", "xm430_w350:1", "--servo", "sts3215:3"][..], "--baud N"),
        (&["--servo", "sts3215:1,1"], "two devices on one line have the ID 1"),
        (&["--servo", "sts3214:1"], "did you mean sts3215?"),
        (&["--servo", "sts3215"], "xm430-w350:1,2,5-8"),
        (&["--servo", "sts3215:1", "--baud", "9600"], "38400"),
        (&["op3", "--servo", "sts3215:1"], "cannot be used with"),
        (&["op3", "--baud", "9600"], "cannot be used with"),
        (&["--tcp", "0"], "<ROBOT>"),
    ] {
        let output = crate::program::gaitway().arg("simulate").args(arguments).output();
        let output = output.expect("the program");
        let said = crate::program::words(&output);
        assert_ne!(output.status.code(), Some(0), "{arguments:?}");
        assert!(said.contains(words), "{arguments:?}: {said}");
    }
}

#[test]
fn a_robot_in_other_letters_is_refused_with_its_name_as_by_every_command() {
    for command in [["simulate", "Open_Duck_Mini_v2"], ["info", "Open_Duck_Mini_v2"]] {
        let output = crate::program::gaitway().args(command).output().expect("the program");
        assert_eq!(output.status.code(), Some(1), "{command:?}");
    }
    let output = crate::program::gaitway().args(["simulate", "Open_Duck_Mini_v2"]).output();
    let said = crate::program::words(&output.expect("the program"));
    assert!(said.contains("open-duck-mini-v2"), "{said}");
}

#[test]
fn over_standard_input_a_program_has_it_in_hand_and_its_end_ends_it() {
    let mut child = crate::program::gaitway()
        .args(["simulate", "--servo", "xm430-w350:1", "--tcp", "0", "--control", "stdin"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the simulator");
    let mut stdin = child.stdin.take().expect("its input");
    let mut stdout = BufReader::new(child.stdout.take().expect("its output"));
    let mut line = || {
        let mut line = String::new();
        stdout.read_line(&mut line).expect("a line");
        line.trim_end().to_string()
    };
    let address = line()["tcp:".len()..].to_string();
    let mut port = TcpStream::connect(address).expect("a connection");
    ping(&mut port);
    stdin.write_all(b"{\"do\":\"count\",\"instruction\":\"ping\"}\nnonsense\n").expect("a write");
    assert_eq!(line(), r#"{"ok":true,"count":1,"next":2,"lost":0}"#);
    assert!(line().starts_with(r#"{"ok":false,"error":{"at":"request""#));
    // What is asked for last is done, too.
    stdin.write_all(b"{\"do\":\"wait\",\"kind\":\"reset\",\"timeout_s\":0.2}\n").expect("a write");
    drop(stdin);
    assert!(line().contains("0 within 0.2 s"));
    assert_eq!(child.wait().expect("an end").code(), Some(0));
}

#[test]
fn a_control_socket_is_there_with_the_port_and_gone_with_it() {
    let path = crate::program::folder("simulate-control").join("c");
    let place = path.display().to_string();
    let mut simulator = Simulator::start(&["so101", "--tcp", "0", "--control", &place]);
    let port = simulator.line();
    let mut stream = UnixStream::connect(&path).expect("the channel");
    stream.write_all(b"{\"do\":\"about\"}\n").expect("a write");
    let mut said = String::new();
    BufReader::new(&stream).read_line(&mut said).expect("a reply");
    assert!(said.contains(&format!(r#""place":"{port}""#)), "{said}");
    assert!(said.contains(r#""robot":"so101""#), "{said}");
    let second = crate::program::gaitway()
        .args(["simulate", "so101", "--tcp", "0", "--control", &place])
        .output()
        .expect("the program");
    assert_eq!(second.status.code(), Some(1));
    assert!(crate::program::words(&second).contains("is there already"));
    simulator.end();
    assert!(!path.exists());
}

/// Memory of the simulator, kB.
fn resident_kb(simulator: &Simulator) -> u64 {
    let status = format!("/proc/{}/status", simulator.child.id());
    let status = std::fs::read_to_string(status).expect("its status");
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).expect("a size");
    line.trim().trim_end_matches(" kB").parse().expect("a number")
}

// Ten minutes at 1,000 resets a second with GAITWAY_LONG, else as many as one test makes in some seconds.
#[test]
fn reset_again_and_again_amid_traffic_it_grows_no_further() {
    let resets = if std::env::var_os("GAITWAY_LONG").is_some() { 600_000 } else { 10_000 };
    let folder = crate::program::folder("simulate-resets");
    let path = folder.join("control");
    let place = path.display().to_string();
    let bench = ["--servo", "xm430-w350:1", "--baud", "57600", "--tcp", "0", "--no-line-timing"];
    let mut simulator = Simulator::start(&[&bench[..], &["--control", &place]].concat());
    let line = simulator.line();
    let mut port =
        TcpStream::connect(line.strip_prefix("tcp:").expect("an address")).expect("a connection");
    let mut control = UnixStream::connect(&path).expect("the channel");
    let mut replies = BufReader::new(control.try_clone().expect("a stream"));
    let mut after_a_tenth = 0;
    let began = std::time::Instant::now();
    for number in 0..resets {
        if number % 10 == 0 {
            assert_eq!(ping(&mut port)[..5], PING_1[..5]);
        }
        control.write_all(b"{\"do\":\"reset\"}\n").expect("a write");
        let mut reply = String::new();
        replies.read_line(&mut reply).expect("a reply");
        assert_eq!(reply, "{\"ok\":true}\n");
        if number == resets / 10 {
            after_a_tenth = resident_kb(&simulator);
        }
    }
    let (kb, took) = (resident_kb(&simulator), began.elapsed());
    let each_second = f64::from(resets) / took.as_secs_f64();
    println!(
        "{resets} resets, {each_second:.0} in a second; {after_a_tenth} kB, at the end {kb} kB"
    );
    assert!(kb <= after_a_tenth + 512, "{after_a_tenth} kB, then {kb} kB");
}
