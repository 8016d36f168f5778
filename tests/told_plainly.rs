//! What is told where somebody has mistyped a name, named a file that cannot be, or taken one kind of thing for
//! another: what it is, and what was meant.

mod program;

use serde_json::Value;
use std::process::Output;

fn run(arguments: &[&str]) -> Output {
    crate::program::gaitway().args(arguments).output().expect("the command")
}

fn assert_told(arguments: &[&str], code: i32, words: &[&str]) {
    let output = run(arguments);
    let told = crate::program::words(&output);
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {told}");
    for word in words {
        assert!(told.contains(word), "{arguments:?}: {word:?} is missing in:\n{told}");
    }
}

#[test]
fn every_name_that_is_mistyped_is_told_which_one_was_meant() {
    let folder = crate::program::folder("names");
    let corpus = folder.join("corpus").display().to_string();
    assert_told(&["corpus", "new", &corpus], 0, &[]);
    for (arguments, meant) in [
        (&["profile", "show", "xm430"][..], "did you mean xm430-w210 or xm430-w350?"),
        (&["profile", "check", "STS3125"], "did you mean sts3215?"),
        (&["simulate", "OP3"], "did you mean op3?"),
        (&["corpus", "add", &corpus, "WALK"], "did you mean walk?"),
        (&["corpus", "plan", &corpus, "praxicn"], "did you mean praxicon?"),
        (&["corpus", "export", &corpus, "--format", "BVH", "-o", "x"], "did you mean bvh?"),
        (&["corpus", "query", &corpus, "acton=walk"], "did you mean action?"),
        (&["corpus", "add", &corpus, "walk", "--verdict", "retak"], "did you mean retake?"),
        (&["model", "explain", "walk", "--model", "squatt"], "did you mean squat?"),
        (&["list", "actons"], "did you mean actions?"),
        (&["man", "playy"], "did you mean play?"),
        (&["scan", "leftt=sim", "--robot", "berkeley-humanoid-lite"], "left"),
    ] {
        assert_told(arguments, 1, &[meant]);
    }
    let only = ["play", "walk", "--robot", "op3", "--bus", "sim", "--only", "head_pn", "--json"];
    assert_told(&only, 1, &["did you mean head_pan?"]);
}

#[test]
fn every_name_there_is_is_listed_with_what_it_stands_for() {
    let all = crate::program::json(&run(&["list", "--json"]));
    let of = |kind: &str| -> Vec<String> {
        let kinds = all["kinds"].as_array().expect("kinds");
        let found = kinds.iter().find(|of| of["kind"] == kind).expect(kind);
        let names = found["names"].as_array().expect("names").iter();
        names.map(|of| of["name"].as_str().expect("a name").to_owned()).collect()
    };
    // By the folders that they come from.
    for (kind, folder) in
        [("actions", "actions"), ("models", "models"), ("robots", "firmware-profiles/robots")]
    {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
        let entries = std::fs::read_dir(path).expect(folder).flatten().map(|entry| entry.path());
        let files = entries.filter(|path| path.extension().is_some_and(|of| of == "toml"));
        let name = |path: std::path::PathBuf| {
            path.file_stem().and_then(|stem| stem.to_str()).expect("a name").to_owned()
        };
        let mut files: Vec<String> = files.map(name).collect();
        files.sort();
        let mut listed = of(kind);
        listed.sort();
        assert_eq!(listed, files, "{kind}");
    }
    assert!(of("servos").contains(&"xm430-w350".to_owned()));
    assert!(of("corpus-sets").contains(&"praxicon".to_owned()));
    assert_told(&["list", "actions"], 0, &["walk", "Walking straight ahead"]);
}

#[test]
fn a_table_with_semicolons_is_told_so_by_every_command_that_reads_tables() {
    let folder = crate::program::folder("semicolons");
    let path = |name: &str| folder.join(name).display().to_string();
    let (table, out, corpus) = (path("angles.csv"), path("out.bvh"), path("corpus"));
    std::fs::write(&table, "time_s;left_knee_flexion_rad\n0;0\n1;0,5\n").expect("a file");
    std::fs::copy("motions/walk.bvh", path("walk.bvh")).expect("a capture");
    assert_told(&["corpus", "new", &corpus], 0, &[]);
    let clips = folder.display().to_string();
    for arguments in [
        &["convert", &table, &out][..],
        &["recognise", &table],
        &["info", &table],
        &["actionlets", &table, "-o", &path("a.toml")],
        &["retarget", &table, "--robot", "op3", "-o", &path("a.csv")],
        &["clean", &table, "-o", &path("b.csv")],
        &["fit", &table, "-o", &out],
        &["score", "classification", &clips, "--labels", &table],
        &["corpus", "add", &corpus, &table],
        &["corpus", "add", &corpus, "--trials", &table],
        &["corpus", "add", &corpus, "walk", "--labels", &table],
    ] {
        assert_told(arguments, 1, &["separated by semicolons", "commas between columns"]);
    }
}

#[test]
fn an_output_that_can_be_no_file_is_told_what_it_is() {
    let folder = crate::program::folder("outputs");
    let path = |name: &str| folder.join(name).display().to_string();
    let (bow, link) = (["play", "bow", "--robot", "op3", "--bus", "sim"], path("link"));
    std::os::unix::fs::symlink("/nowhere/x", folder.join("link")).expect("a link");
    for force in [&[][..], &["--force"]] {
        let to_link = [&bow[..], &["--html", &link], force].concat();
        assert_told(&to_link, 1, &["a link that leads nowhere", "/nowhere/x"]);
        let to_dash = [&bow[..], &["--html", "-"], force].concat();
        assert_told(&to_dash, 1, &["no name of a file", "standard output"]);
        let convert = [&["convert", "motions/walk.bvh", "-"][..], force].concat();
        assert_told(&convert, 1, &["no name of a file"]);
    }
    assert!(!std::path::Path::new("-").exists());
    let corpus = path("corpus");
    assert_told(&["corpus", "new", &corpus], 0, &[]);
    let plan = ["corpus", "plan", &corpus, "praxicon"];
    for (option, name, allowed) in [("--plot", "a.png", ".svg"), ("-o", "a.csv", ".toml")] {
        let name = path(name);
        assert_told(&[&plan[..], &[option, &name]].concat(), 1, &["cannot be written", allowed]);
        assert!(!std::path::Path::new(&name).exists());
    }
    // A finished export is told so, and another one is still something else.
    assert_told(&["corpus", "add", &corpus, "bow"], 0, &[]);
    let export = |format: &str| {
        ["corpus", "export", &corpus, "--format", format, "-o", &path("export")].map(str::to_owned)
    };
    let words = |of: [String; 7]| crate::program::words(&run(&of.each_ref().map(String::as_str)));
    assert!(words(export("bvh")).contains("1 trial as bvh"));
    assert!(words(export("bvh")).contains("this export is there already, and whole"));
    assert!(words(export("c3d")).contains("holds no part of this export"));
}

#[test]
fn a_recording_of_a_robot_is_no_recording_of_sensors() {
    let folder = crate::program::folder("of-a-robot");
    let path = |name: &str| folder.join(name).display().to_string();
    let recording = path("bow.mcap");
    let play = ["play", "bow", "--robot", "op3", "--bus", "sim", "--record", &recording];
    assert_told(&play, 0, &[]);
    let to_body = ["convert", &recording, &path("bow.bvh")];
    assert_told(&to_body, 1, &["a recording of a robot", "gaitway retarget"]);
    assert!(!crate::program::words(&run(&to_body)).contains("sensors were worn"));
    assert_told(&["convert", &recording, &path("bow.csv")], 0, &[]);
    // What the advice says can be done.
    assert_told(&["retarget", &recording, "--robot", "op3", "-o", &path("bow.bvh")], 0, &[]);
}

#[test]
fn quiet_tells_how_it_ended_and_what_was_written() {
    let folder = crate::program::folder("quiet");
    let page = folder.join("bow.html").display().to_string();
    let play = ["play", "bow", "--robot", "op3", "--bus", "sim", "--html", &page];
    let told = crate::program::words(&run(&[&play[..], &["--force", "-q"]].concat()));
    assert_eq!(told, format!("done: bow on op3 over sim\nplots     {page}\n"));
    let told = crate::program::words(&run(&[&play[..], &["--force"]].concat()));
    assert!(told.lines().count() > 20, "{told}");
    let refused = run(&["play", "wlak", "--robot", "op3", "--bus", "sim", "-q"]);
    assert!(crate::program::words(&refused).contains("did you mean walk?"));
}

#[test]
fn verbose_tells_when_each_remark_was_made_and_what_is_foreseen_as_the_page_has_it() {
    let folder = crate::program::folder("verbose");
    // From where the robot starts, the right arm down and its hand to the left, into the hip.
    let cross: String = [(0.0, 0.0), (0.5, 0.0), (1.0, 0.5), (1.5, 1.0), (2.0, 1.0), (2.5, 1.0)]
        .iter()
        .map(|(t, part)| format!("{t},{},{}\n", -0.785 - 0.7 * part, 0.785 + 0.715 * part))
        .collect();
    let arms = folder.join("arms.csv").display().to_string();
    std::fs::write(&arms, format!("time_s,r_sho_roll_rad,r_el_rad\n{cross}")).unwrap();
    let play = ["play", &arms, "--robot", "op3", "--bus", "sim", "--hang", "--retime"];
    let told = |more: &[&str]| {
        let output = run(&[&play[..], more].concat());
        assert!(output.status.success(), "{}", crate::program::words(&output));
        String::from_utf8(output.stderr).expect("UTF-8")
    };
    assert!(!told(&[]).contains("foreseen"));
    for more in [&["-v"][..], &["-v", "--dry-run"]] {
        let said = told(more);
        let mut last_s = 0.0;
        for line in said.lines() {
            let (stamp, _) = line.split_once(" s  ").unwrap_or_else(|| panic!("no time: {line}"));
            let at_s: f64 = stamp.trim().parse().expect("a time");
            assert!(at_s >= last_s, "{said}");
            last_s = at_s;
        }
        assert!(said.contains("foreseen: touches itself, "), "{said}");
        assert_eq!(said.contains("planned: "), more.len() == 1, "{said}");
    }
    let both = run(&[&play[..], &["-v", "-q"]].concat());
    assert_eq!(both.status.code(), Some(2), "{}", crate::program::words(&both));
}

#[test]
fn a_line_behind_tcp_has_no_speed_that_anybody_here_knows() {
    let mut simulator = crate::program::gaitway()
        .args(["simulate", "so101", "--tcp", "0"])
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::null())
        .spawn()
        .expect("a simulator");
    let mut place = String::new();
    let out = simulator.stdout.take().expect("piped");
    std::io::BufRead::read_line(&mut std::io::BufReader::new(out), &mut place).expect("a line");
    let place = place.trim();
    let report = crate::program::json(&run(&["scan", place, "--json"]));
    let text = crate::program::words(&run(&["scan", place, "--timeout", "20"]));
    let said = crate::program::json(&run(&["scan", &format!("{place}?baud=1000000"), "--json"]));
    simulator.kill().and_then(|()| simulator.wait()).expect("an end");
    assert_eq!(report["scanned_baud_bps"], serde_json::json!([]), "{report:#}");
    assert!(
        report["devices"]
            .as_array()
            .expect("devices")
            .iter()
            .all(|of| of["baud_bps"] == Value::Null)
    );
    assert!(text.contains("6 devices on tcp:") && text.contains("not known here"), "{text}");
    assert_eq!(said["devices"][0]["baud_bps"], 1_000_000);
}

#[test]
fn texts_of_another_kind_are_told_what_they_are() {
    use std::os::unix::ffi::OsStringExt;
    let folder = crate::program::folder("texts");
    let path = |name: &str| folder.join(name).display().to_string();
    let capture = std::fs::read_to_string("motions/walk.bvh").expect("a capture");
    let utf16 = |text: &str| -> Vec<u8> {
        let units = std::iter::once(0xfeff).chain(text.encode_utf16());
        units.flat_map(u16::to_le_bytes).collect()
    };
    std::fs::write(path("utf16.bvh"), utf16(&capture)).expect("a file");
    assert_told(&["info", &path("utf16.bvh")], 1, &["this text is UTF-16", "iconv"]);
    std::fs::write(path("commas.bvh"), capture.replace('.', ",")).expect("a file");
    assert_told(&["info", &path("commas.bvh")], 1, &["numbers have a point and no comma"]);
    std::fs::write(path("cycles.csv"), "cycle,time_s\n0,0\n").expect("a file");
    let play = ["play", &path("cycles.csv"), "--robot", "op3", "--bus", "sim"];
    assert_told(&play, 1, &["play the recording (.mcap)"]);
    // A name that is no text is said, where only a text can be.
    let name = std::ffi::OsString::from_vec(b"walk\xff".to_vec());
    let output = crate::program::gaitway()
        .args(["play", "--robot", "op3", "--bus", "sim"])
        .arg(name)
        .output()
        .expect("the command");
    let told = crate::program::words(&output);
    assert!(told.contains("walk\\xFF") && told.contains("UTF-8"), "{told}");
    assert_eq!(output.status.code(), Some(2));
}

#[test]
fn a_planned_motion_that_is_too_long_is_told_how_long_it_may_be() {
    let folder = crate::program::folder("long");
    let table = folder.join("keys.csv").display().to_string();
    std::fs::write(&table, "time_s,head_pan_rad\n0,0\n4999,0.1\n").expect("a table");
    let out = folder.join("out.csv").display().to_string();
    assert_told(
        &["retarget", &table, "--robot", "op3", "-o", &out],
        1,
        &["4999 s", "4000 s of 20 joints"],
    );
}

/// A walk in which the right knee is elsewhere in one frame.
fn with_a_glitch() -> String {
    let walk = std::fs::read_to_string(
        std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("motions/walk.bvh"),
    );
    let walk = walk.expect("the shipped walk");
    let (head, frames) = walk.split_once("Frame Time").expect("a capture");
    let channels = head.lines().filter_map(|line| {
        let mut words = line.split_whitespace();
        match words.next()? {
            "ROOT" | "JOINT" => Some((words.next().map(str::to_owned), 0)),
            "CHANNELS" => Some((None, words.next()?.parse().ok()?)),
            _ => None,
        }
    });
    let (mut column, mut knee) = (0, None);
    for (name, count) in channels {
        if name.as_deref() == Some("RightLeg") {
            knee = Some(column);
        }
        column += count;
    }
    let knee = knee.expect("a knee");
    let mut lines: Vec<String> = frames.lines().map(str::to_owned).collect();
    let mut values: Vec<String> = lines[151].split_whitespace().map(str::to_owned).collect();
    // Z, X, Y: it bends about X.
    let bent: f64 = values[knee + 1].parse().expect("a number");
    values[knee + 1] = (bent + 120.0).to_string();
    lines[151] = values.join(" ");
    format!("{head}Frame Time{}\n", lines.join("\n"))
}

#[test]
fn what_no_person_does_in_a_capture_is_told_where_it_is_played() {
    let folder = crate::program::folder("glitch");
    let (glitch, walk) = (folder.join("glitch.bvh").display().to_string(), "motions/walk.bvh");
    std::fs::write(&glitch, with_a_glitch()).expect("a file");
    let play = |motion: &str| {
        let arguments = ["play", motion, "--robot", "op3", "--bus", "sim", "--hang", "--dry-run"];
        crate::program::words(&run(&arguments))
    };
    let told = play(&glitch);
    assert!(told.contains("no person moves so: right_shank jumps at 2.50 s (1 frame)"), "{told}");
    assert!(told.contains("gaitway clean --check"), "{told}");
    let whole = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(walk).display().to_string();
    assert!(!play(&whole).contains("no person moves so"));
}

/// An arm whose line is too slow to ask all of it in every cycle.
fn slow_arm() -> String {
    let line = |name: &str, bps: u32| format!("[[line]]\nname = \"{name}\"\nbaud_bps = {bps}\n");
    let joint = |id: u32| {
        let line = if id < 3 { "a" } else { "b" };
        format!(
            "[[joint]]\nname = \"j{id}\"\nline = \"{line}\"\nid = {id}\nservo = \"xl430-w250\"\nlower_rad = -1.5\n\
             upper_rad = 1.5\nvelocity_rad_s = 2.0\nacceleration_rad_s2 = 10.0\n"
        )
    };
    let joints: String = (1..=5).map(joint).collect();
    format!("schema = 1\nname = \"arm5\"\n{}{}{joints}", line("a", 1_000_000), line("b", 57_600))
}

#[test]
fn a_joint_whose_turn_it_is_not_is_not_missed() {
    let folder = crate::program::folder("in-turn");
    let path = |name: &str| folder.join(name).display().to_string();
    std::fs::write(path("arm5.toml"), slow_arm()).expect("a file");
    let row = |at: u32| {
        let time_s = f64::from(at) * 0.02;
        let angle = format!(",{:.5}", 0.3 * (1.0 - (time_s * 1.5).cos()));
        format!("{time_s:.2}{}\n", angle.repeat(5))
    };
    let rows: String = (0..150).map(row).collect();
    let head = "time_s,j1_rad,j2_rad,j3_rad,j4_rad,j5_rad\n";
    std::fs::write(path("wave.csv"), format!("{head}{rows}")).expect("a file");
    let (robot, motion, file, page) =
        (path("arm5.toml"), path("wave.csv"), path("run.mcap"), path("run.html"));
    let arguments = [
        "play", &motion, "--robot", &robot, "--bus", "sim", "--rate", "45", "--record", &file,
        "--html", &page,
    ];
    assert_told(&arguments, 0, &["0 missed", "from 1 servo in turn; each joint every 3 cycles"]);
    assert_told(&["info", &file], 0, &["0 readings missed"]);
    let page = std::fs::read_to_string(page).expect("a page");
    assert!(
        page.contains("j5") && !page.contains("\"missed readings\""),
        "its page says that j5 was missed"
    );
}

#[test]
fn a_page_of_a_folder_of_motions_is_refused_with_what_can_be_drawn_of_it() {
    let folder = crate::program::folder("no-page");
    let path = |name: &str| folder.join(name).display().to_string();
    let (corpus, dataset, page) = (path("moves"), path("dataset"), path("page.html"));
    for arguments in [
        &["corpus", "new", &corpus][..],
        &["corpus", "add", &corpus, "bow"],
        &["corpus", "export", &corpus, "--format", "lerobot", "--robot", "op3", "-o", &dataset],
    ] {
        let output = run(arguments);
        assert!(output.status.success(), "{}", crate::program::words(&output));
    }
    let refused = "a page shows one motion";
    assert_told(&["info", &corpus, "--html", &page], 1, &[refused, "corpus export"]);
    // What it says to do can be done, word for word.
    let said = crate::program::words(&run(&["info", &corpus, "--html", &page]));
    let commands = said.split_once("to do    gaitway ").expect("a remedy").1.trim();
    let (export, draw) = commands.split_once(", then gaitway ").expect("two commands");
    let (exported, drawn) = (path("exported"), path("drawn.html"));
    for command in [export, draw] {
        let command = command.replace("DIR", &exported).replace("FILE.html", &drawn);
        assert_told(&command.split(' ').collect::<Vec<_>>(), 0, &[]);
    }
    assert!(folder.join("drawn.html").exists());
    let empty = path("empty");
    assert_told(&["corpus", "new", &empty], 0, &[]);
    assert_told(&["info", &empty, "--html", &page], 1, &[refused, "nothing is in it yet"]);
    let seed = folder.join("seed");
    std::fs::create_dir_all(seed.join("metadata")).expect("a folder");
    std::fs::create_dir_all(seed.join("soma_uniform/bvh/230711")).expect("a folder");
    std::fs::write(seed.join("metadata/seed_metadata_v004.csv"), "move_soma_uniform_path\n")
        .expect("a table");
    let seed = seed.display().to_string();
    assert_told(&["info", &seed, "--html", &page], 1, &[refused, "unpack soma_proportional"]);
    let clip = format!("{seed}/soma_uniform/bvh/230711/bow.bvh");
    assert_told(&["synth", "bow", "-o", &clip], 0, &[]);
    let draw = format!("gaitway info {clip} --html FILE.html");
    assert_told(&["info", &seed, "--html", &page], 1, &[refused, &draw]);
    let episode = format!("gaitway retarget '{dataset}#0' --robot NAME");
    assert_told(&["info", &dataset, "--html", &page], 1, &[refused, "LeRobot", &episode]);
    assert!(!folder.join("page.html").exists());
    // What it says to do can be done.
    let (episode, table) = (format!("{dataset}#0"), path("episode.csv"));
    assert_told(&["retarget", &episode, "--robot", "op3", "-o", &table, "--html", &page], 0, &[]);
    assert!(folder.join("page.html").exists());
}

#[test]
fn a_file_that_may_not_grow_any_more_is_told_as_that_and_not_as_a_full_disk() {
    let out = crate::program::folder("no-growth").join("walks").display().to_string();
    let make = |before: &str| {
        let script = format!("{before} exec \"$0\" synth walk --variations 40 -o {out}/");
        let mut limited = std::process::Command::new("sh");
        limited.args(["-c", &script, crate::program::PATH]).output().expect("a shell")
    };
    let output = make("ulimit -f 2000;");
    let told = crate::program::words(&output);
    assert_eq!(output.status.code(), Some(1), "{told}");
    assert!(told.contains("a file may not grow any more") && told.contains("ulimit -f"), "{told}");
    assert!(!told.contains("disk is full"), "{told}");
    // As it says, the same command goes on.
    let output = make("");
    assert!(output.status.success(), "{}", crate::program::words(&output));
}
