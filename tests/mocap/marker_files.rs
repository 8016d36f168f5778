//! Markers as texts (TRC, tables), what `info` tells of a file of markers, and what `convert` makes of it.

use crate::c3d_made::{Made, Values};
use crate::captured;
use crate::program::{folder, gaitway, json, words};
use gaitway::mocap::markers::{FramesOf, Markers};
use gaitway::mocap::{c3d, csm, marker_table, trc};
use rustix::process::{Pid, Signal, kill_process};
use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::Path;
use std::process::Stdio;
use std::time::Duration;

const TRC: &str = "PathFileType\t4\t(X/Y/Z)\ttrial.trc\n\
DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames\n\
50\t50\t3\t2\tmm\t50\t1\t3\n\
Frame#\tTime\tR.Heel\t\t\tL Toe\t\t\n\
\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n\
\n\
1\t0.00\t1.5\t2\t-3e2\t4\t5\t6\n\
2\t0.02\t\t\t\t4\t5\t7\n\
3\t0.04\t1.75\t2\tNaN\t\t\t\n";

fn positions(markers: &Markers) -> Vec<Vec<Option<[f32; 3]>>> {
    let points = markers.head().points.len();
    let of = |frame| (0..points).map(|p| markers.sample(frame, p).map(|s| s.position)).collect();
    (0..markers.head().frames).map(of).collect()
}

#[test]
fn a_trc_file_is_read_as_written_with_its_gaps() {
    let markers = trc::parse(TRC.as_bytes()).expect("read");
    let head = markers.head();
    let labels: Vec<&str> = head.points.iter().map(|point| point.label.as_str()).collect();
    assert_eq!(labels, ["R.Heel", "L Toe"]);
    assert_eq!((head.rate_hz, head.unit.as_str(), head.first_frame), (Some(50.0), "mm", 1));
    let expected = [
        vec![Some([1.5, 2.0, -300.0]), Some([4.0, 5.0, 6.0])],
        vec![None, Some([4.0, 5.0, 7.0])],
        vec![None, None],
    ];
    assert_eq!(positions(&markers), expected);
    assert!(
        head.notes.iter().any(|note| note.starts_with("1 sample with one or two")),
        "{:?}",
        head.notes
    );
    for other in [TRC.replace('\n', "\r\n"), format!("\u{feff}{TRC}"), TRC.replace("\n\n", "\n")] {
        assert_eq!(positions(&trc::parse(other.as_bytes()).expect("read")), expected);
    }
    let lying = trc::parse(TRC.replace("50\t50\t3\t2", "50\t50\t9\t5").as_bytes()).expect("read");
    let notes = lying.head().notes.join("\n");
    assert!(
        notes.contains("NumFrames says 9, 3 rows") && notes.contains("NumMarkers says 5, 2"),
        "{notes}"
    );
    assert_eq!(lying.head().lost_frames, 6);
    let unsaid = trc::parse(TRC.replace("50\t50\t3", "0\t50\t3").as_bytes()).expect("read");
    assert!((unsaid.head().rate_hz.expect("by the times") - 50.0).abs() < 1e-9);
}

#[test]
fn what_is_wrong_in_a_trc_file_is_said_with_its_line() {
    for (from, to, said) in [
        ("PathFileType", "Path", "not a TRC file"),
        ("1.5\t2", "1,5\t2", "line 7"),
        ("2\t0.02", "x\t0.02", "line 8"),
        ("4\t5\t7", "4\t5\t7\t8", "more cells"),
        ("R.Heel\t\t\tL Toe", "", "no usable number of markers"),
    ] {
        let refused =
            trc::parse(TRC.replacen(from, to, 1).as_bytes()).expect_err("broken").to_string();
        assert!(refused.contains(said), "{said}: {refused}");
    }
    for length in 0..TRC.len() {
        let _ = trc::parse(&TRC.as_bytes()[..length]);
    }
}

/// A model's angles and forces beside markers, two points of one name, an angle without its unit.
const MIXED: &str = "frame,time_s,LANK_x_m,LANK_y_m,LANK_z_m,LANK#2_x_m,LANK#2_y_m,LANK#2_z_m,\
LKneeAngles_x_deg,LKneeAngles_y_deg,LKneeAngles_z_deg,LForce_x_N,LForce_y_N,LForce_z_N,\
LTurn_x_rad,LTurn_y_rad,LTurn_z_rad,LBend_x_angle,LBend_y_angle,LBend_z_angle,\
LSum_x_scalar,LSum_y_scalar,LSum_z_scalar\n\
1,0,1,2,3,4,5,6,7,8,9,10,11,12,0.5,0.25,0.125,30,40,50,1,1,1\n\
2,0.01,1,2,3,,,,7,8,9,10,11,12,0.5,0.25,0.125,30,40,50,1,1,1\n";

#[test]
fn a_table_says_what_is_no_place_and_another_file_made_of_it_says_it_too() {
    use gaitway::mocap::markers::PointKind::{Angle, Force, Marker, Scalar};
    assert!(marker_table::is_of_markers(MIXED));
    let markers = marker_table::parse(MIXED.as_bytes()).expect("read");
    let told = |markers: &Markers| {
        let points = markers.head().points.iter();
        points.map(|of| (of.label.clone(), of.kind, of.unit.clone())).collect::<Vec<_>>()
    };
    let expected: Vec<_> = [
        ("LANK", Marker, "m"),
        ("LANK#2", Marker, "m"),
        ("LKneeAngles", Angle, "deg"),
        ("LForce", Force, "N"),
        ("LTurn", Angle, "rad"),
        ("LBend", Angle, ""),
        ("LSum", Scalar, ""),
    ]
    .map(|(label, kind, unit)| (label.to_owned(), kind, unit.to_owned()))
    .into();
    assert_eq!(told(&markers), expected);
    let mut text = Vec::new();
    marker_table::write(&mut text, &mut FramesOf::new(&markers)).expect("written");
    let again = marker_table::parse(&text).expect("read");
    assert_eq!((told(&again), positions(&again)), (expected.clone(), positions(&markers)));
    let mut bytes = Vec::new();
    // A C3D file has one unit for all angles.
    let refused = c3d::write::write(&mut bytes, &mut FramesOf::new(&markers));
    let refused = refused.expect_err("two units").to_string();
    assert!(refused.contains("LKneeAngles in deg, LTurn in rad"), "{refused}");
    let alike = MIXED.replace("_rad", "_deg").replace("_angle", "_deg");
    let markers = marker_table::parse(alike.as_bytes()).expect("read");
    c3d::write::write(&mut bytes, &mut FramesOf::new(&markers)).expect("written");
    let read = c3d::parse(&bytes).expect("read");
    let kinds = |all: Vec<(String, _, String)>| all.into_iter().map(|(_, kind, _)| kind);
    assert!(kinds(told(&read)).eq(kinds(expected)), "{:?}", told(&read));
    assert_eq!(positions(&read), positions(&markers));
    // What holds places alone is not written without any.
    let titles = "time_s,A_x_deg,A_y_deg,A_z_deg\n0,1,2,3\n0.01,1,2,3\n";
    let angles = marker_table::parse(titles.as_bytes()).expect("read");
    let mut none = FramesOf::new(&angles);
    for refused in
        [trc::write(&mut Vec::new(), "a", &mut none), csm::write(&mut Vec::new(), "a", &mut none)]
    {
        let refused = refused.expect_err("nothing to write").to_string();
        assert!(refused.contains("1 point, of angles"), "{refused}");
    }
    let table = |name: &str| MIXED.lines().next().expect("titles").replace("LANK#2", name);
    assert!(marker_table::parse(table("LANK").as_bytes()).is_err(), "a column comes twice");
    assert!(!marker_table::is_of_markers("time_s,base_x_m,base_y_m,base_z_m,left_knee_x_rad"));
}

const CSM: &str = include_str!("../../fuzz/seeds/marker_texts/trial.csm");

#[test]
fn a_csm_file_is_read_as_written_with_its_gaps() {
    let markers = csm::parse(CSM.as_bytes()).expect("read");
    let head = markers.head();
    let labels: Vec<&str> = head.points.iter().map(|point| point.label.as_str()).collect();
    assert_eq!((labels, head.subjects.as_slice()), (vec!["C7", "LTOE"], &["somebody".into()][..]));
    assert_eq!((head.rate_hz, head.unit.as_str(), head.first_frame), (Some(50.0), "mm", 1));
    let expected = [
        vec![Some([1.5, 2.0, -300.0]), Some([4.0, 5.0, 6.0])],
        vec![None, Some([4.0, 5.0, 7.0])],
        vec![Some([1.75, 2.0, 3.0]), None],
    ];
    assert_eq!(positions(&markers), expected);
    assert!(head.notes.iter().any(|note| note.contains("millimetres are taken")));
    let mut text = Vec::new();
    csm::write(&mut text, "again", &mut FramesOf::new(&markers)).expect("written");
    let again = csm::parse(&text).expect("read");
    assert_eq!(positions(&again), expected);
    assert_eq!((again.head().rate_hz, &again.head().subjects), (head.rate_hz, &head.subjects));
    let lying = CSM.replace("$LastFrame 3", "$LastFrame 9").replace("Markers 2", "Markers 7");
    let lying = csm::parse(lying.as_bytes()).expect("read");
    let notes = lying.head().notes.join("\n");
    assert!(notes.contains("make 9 frames, 3 rows") && notes.contains("says 7"), "{notes}");
    assert_eq!(lying.head().lost_frames, 6);
}

#[test]
fn what_is_wrong_in_a_csm_file_is_said_with_its_line() {
    for (from, to, said) in [
        ("$Filename trial.csm", "trial.csm", "not a CSM file"),
        ("C7 LTOE", "", "no usable number of markers"),
        ("$Rate 50", "$Rate fast", "line 6"),
        ("1.5", "1,5", "line 10"),
        ("2 DROPOUT", "x DROPOUT", "line 11"),
        ("4 5 7", "4 5", "ends before its last marker"),
        ("4 5 7", "4 5 7 8", "more cells"),
        ("$Points", "$Place", "not a CSM file"),
    ] {
        let broken = CSM.replacen(from, to, 1);
        let refused = csm::parse(broken.as_bytes()).expect_err(said).to_string();
        assert!(refused.contains(said), "{said}: {refused}");
    }
    for length in 0..CSM.len() {
        let _ = csm::parse(&CSM.as_bytes()[..length]);
    }
}

const TABLE: &str = "frame,time_s,C7_x_mm,C7_y_mm,C7_z_mm,note,\"a,b_x_m\",\"a,b_y_m\",\"a,b_z_m\"\n\
11,0.1,1000,-2,3.5,said,1,2,3\n\
12,0.11,,,,,1,2,3\n";

#[test]
fn a_table_says_by_its_titles_what_is_in_it() {
    let markers = marker_table::parse(TABLE.as_bytes()).expect("read");
    let head = markers.head();
    let labels: Vec<&str> = head.points.iter().map(|point| point.label.as_str()).collect();
    assert_eq!(labels, ["C7", "a,b"]);
    assert_eq!((head.unit.as_str(), head.first_frame, head.rate_hz), ("m", 11, Some(100.0)));
    let ab = Some([1.0, 2.0, 3.0]);
    assert_eq!(positions(&markers), [vec![Some([1.0, -0.002, 0.0035]), ab], vec![None, ab]]);
    assert!(head.notes.iter().any(|note| note.contains("1 column is no coordinate")));
    for (from, to, said) in [
        ("time_s", "time", "no column time_s"),
        ("C7_z_mm", "C7_w_mm", "not all three"),
        ("C7_z_mm", "C7_y_mm", "twice"),
        ("1000", "x", "line 2"),
        ("0.11", "0.1", "time does not go on"),
        ("12,0.11,", "12,0.11", "one cell per column"),
    ] {
        let refused = marker_table::parse(TABLE.replacen(from, to, 1).as_bytes());
        let refused = refused.expect_err("broken").to_string();
        assert!(refused.contains(said), "{said}: {refused}");
    }
    assert!(marker_table::is_of_markers(TABLE));
    // A robot's joints may be called x, y and z, and its base has a place.
    for joints in
        ["time_s,l_hip_rad,base_x_m,base_y_m,base_z_m\n", "time_s,hip_x_rad,hip_y_rad,hip_z_rad\n"]
    {
        assert!(!marker_table::is_of_markers(joints), "{joints}");
    }
}

/// A trial with a gap, analog channels, an event, a plate and a group that nobody knows.
fn trial() -> Made {
    let mut made = Made::new(3, 50, 7, 4);
    made.first = 201;
    made.set("POINT", "LABELS", &[4, 3], Values::Text(vec!["LASI", "RASI", "LKnA"]));
    made.set("POINT", "ANGLES", &[4, 1], Values::Text(vec!["LKnA"]));
    made.set("POINT", "ANGLE_UNITS", &[3], Values::Text(vec!["deg"]));
    made.set("EVENT", "USED", &[], Values::Ints(vec![1]));
    made.set("EVENT", "CONTEXTS", &[4, 1], Values::Text(vec!["Left"]));
    made.set("EVENT", "LABELS", &[11, 1], Values::Text(vec!["Foot Strike"]));
    made.set("EVENT", "TIMES", &[2, 1], Values::Floats(vec![0.0, 2.25]));
    made.set("FORCE_PLATFORM", "USED", &[], Values::Ints(vec![1]));
    made.set("FORCE_PLATFORM", "TYPE", &[1], Values::Ints(vec![2]));
    made.set("FORCE_PLATFORM", "CHANNEL", &[6, 1], Values::Ints((1..7).collect()));
    made.set("OURLAB", "MOOD", &[4], Values::Text(vec!["good"]));
    made
}

fn written(folder: &Path, name: &str, bytes: &[u8]) -> String {
    let path = folder.join(name);
    fs::write(&path, bytes).expect("a file");
    path.to_str().expect("a path").to_owned()
}

#[test]
fn info_tells_what_a_person_wants_to_know_of_markers() {
    let folder = folder("info");
    let file = written(&folder, "trial.c3d", &trial().bytes());
    let report = json(&gaitway().args(["info", &file, "--json"]).output().expect("it runs"));
    assert_eq!((&report["format"], &report["encoding"]), (&"c3d".into(), &"Intel, real".into()));
    assert_eq!((&report["frames"], &report["first_frame"]), (&50.into(), &201.into()));
    assert_eq!((&report["rate_hz"], &report["duration_s"]), (&100.0.into(), &0.49.into()));
    assert_eq!((&report["unit"], &report["metres_per_unit"]), (&"mm".into(), &0.001.into()));
    assert_eq!(report["points"], serde_json::json!({ "angle": 1, "marker": 2 }));
    // Every seventh sample is missing: frames 6, 13, ... 48 of the first marker, 5, 12, ... 47 of the second.
    assert_eq!(
        (&report["markers"][0]["gaps"], &report["markers"][0]["frames"]),
        (&7.into(), &43.into())
    );
    assert_eq!(report["markers"][0]["longest_gap_begins"], 207);
    assert_eq!(report["gaps"], 14);
    assert!((report["missing_share"].as_f64().expect("a share") - 0.14).abs() < 1e-12);
    assert_eq!(
        (&report["analog"]["rate_hz"], &report["analog"]["per_frame"]),
        (&400.0.into(), &4.into())
    );
    // The counts are n mod 4096 - 100, of 50 x 4 samples of 7 channels; (count - 12) / 8.
    assert_eq!(report["analog"]["channels"][0]["least"], (-100.0 - 12.0) / 8.0);
    assert_eq!(report["analog"]["channels"][6]["greatest"], (1399.0 - 100.0 - 12.0) / 8.0);
    let event = serde_json::json!({ "time_s": 2.25, "label": "Foot Strike", "context": "Left", "subject": "" });
    assert_eq!(report["events"], serde_json::json!([event]));
    assert_eq!(report["plates"][0]["type"], 2);
    assert_eq!(report["groups"]["OURLAB"], 1);
    let findings = report["findings"].to_string();
    assert!(findings.contains("ANALOG:LABELS is missing"), "{findings}");
    let text = words(&gaitway().args(["info", &file]).output().expect("it runs"));
    for said in
        ["50, from number 201 on", "100.00 Hz", "1 angle, 2 markers", "Foot Strike Left", "type 2"]
    {
        assert!(text.contains(said), "{said}: {text}");
    }
}

#[test]
fn analog_samples_that_are_no_numbers_are_told_and_where_the_first_is() {
    let folder = folder("no-numbers");
    let mut bytes = trial().bytes();
    // 50 frames of 160 bytes fill 16 blocks of 512; in each, 3 points of 16 bytes come first. Of seven channels in
    // turn, the third sample of the second frame and the one after it.
    let second = bytes.len() - 16 * 512 + 160 + 48;
    bytes[second + 8..second + 12].copy_from_slice(&f32::NAN.to_le_bytes());
    bytes[second + 12..second + 16].copy_from_slice(&f32::INFINITY.to_le_bytes());
    let file = written(&folder, "trial.c3d", &bytes);
    let told = words(&gaitway().args(["info", &file]).output().expect("it runs"));
    let said = "2 analog samples are no finite numbers, the first in frame 202, of channel 3";
    assert!(told.contains(said), "{told}");
}

#[test]
fn markers_go_from_one_kind_of_file_to_another_and_back() {
    let folder = folder("convert");
    let file = written(&folder, "trial.c3d", &trial().bytes());
    let place = |name: &str| folder.join(name).to_str().expect("a path").to_owned();
    let convert = |from: &str, to: &str| {
        let done = gaitway().args(["convert", from, to]).output().expect("it runs");
        assert!(done.status.success(), "{from} to {to}: {}", words(&done));
        words(&done)
    };
    let original = c3d::read(Path::new(&file)).expect("read");
    let said = convert(&file, &place("a.trc"));
    assert!(said.contains("1 point is no place") && said.contains("7 analog channels"), "{said}");
    let by_trc = trc::parse(&fs::read(place("a.trc")).expect("a file")).expect("read");
    convert(&file, &place("a.csv"));
    let by_table = marker_table::parse(&fs::read(place("a.csv")).expect("a file")).expect("read");
    convert(&file, &place("a.csm"));
    let by_csm = csm::parse(&fs::read(place("a.csm")).expect("a file")).expect("read");
    convert(&file, &place("b.c3d"));
    let copy = c3d::read(Path::new(&place("b.c3d"))).expect("read");
    assert_eq!(copy.head().parameters.get("OURLAB", "MOOD").expect("kept").texts(), ["good"]);
    assert_eq!((copy.head().first_frame, copy.head().events.len()), (201, 1));
    convert(&place("a.trc"), &place("c.c3d"));
    let by_both = c3d::read(Path::new(&place("c.c3d"))).expect("read");
    for frame in 0..50 {
        for point in 0..3 {
            let of = |markers: &Markers| markers.sample(frame, point).map(|s| s.position);
            let expected = of(&original);
            assert_eq!(of(&copy), expected, "frame {frame}, point {point}");
            if point < 2 {
                // The shortest text of a number of 32 bits is read as the same number.
                assert_eq!(of(&by_trc), expected, "frame {frame}, point {point}");
                assert_eq!(of(&by_csm), expected, "frame {frame}, point {point}");
                assert_eq!(of(&by_both), expected, "frame {frame}, point {point}");
                let in_m = expected.map(|p| p.map(|n| (f64::from(n) * 0.001) as f32));
                assert_eq!(of(&by_table), in_m, "frame {frame}, point {point}");
            } else {
                assert_eq!(of(&by_table), expected, "angles stay what they are");
            }
        }
    }
    for markers in [&by_trc, &by_csm, &by_table, &by_both] {
        let head = markers.head();
        assert_eq!((head.rate_hz, head.first_frame, head.frames), (Some(100.0), 201, 50));
    }
    let again = gaitway().args(["convert", &file, &place("a.trc")]).output().expect("it runs");
    assert!(!again.status.success() && words(&again).contains("--force"), "{}", words(&again));
}

#[test]
fn a_file_that_is_cut_off_is_converted_as_far_as_it_goes_with_exit_code_3() {
    let folder = folder("cut");
    let bytes = trial().bytes();
    let file = written(&folder, "cut.c3d", &bytes[..bytes.len() - 3000]);
    let out = folder.join("cut.csv");
    let done = gaitway().args(["convert", &file]).arg(&out).output().expect("it runs");
    assert_eq!(done.status.code(), Some(3), "{}", words(&done));
    assert!(words(&done).contains("50 frames are claimed"), "{}", words(&done));
    assert!(out.exists());
}

#[test]
fn a_conversion_that_is_interrupted_or_killed_leaves_nothing() {
    let folder = folder("interrupted");
    let file = written(&folder, "long.c3d", &Made::new(30, 60_000, 0, 0).bytes());
    let names = || {
        let entries = std::fs::read_dir(&folder).expect("a folder");
        let names = entries.map(|entry| entry.expect("one").file_name());
        let mut names: Vec<String> = names.map(|of| of.to_string_lossy().into_owned()).collect();
        names.sort();
        names
    };
    // Somebody else's, which only looks as if it belonged to this.
    fs::write(folder.join("out.csv.part"), "precious").expect("a file");
    for (signal, code) in
        [(Signal::INT, Some(130)), (Signal::TERM, Some(143)), (Signal::KILL, None)]
    {
        let mut child = gaitway()
            .args(["convert", &file])
            .arg(folder.join("out.csv"))
            .stderr(Stdio::null())
            .spawn()
            .expect("the command");
        // The test's own patience, not a promise.
        let grows = (0..6000).any(|_| {
            std::thread::sleep(Duration::from_millis(5));
            // It grows without a name, but among the files the program has open.
            let open = fs::read_dir(format!("/proc/{}/fd", child.id())).into_iter().flatten();
            open.flatten().any(|file| {
                let of = fs::metadata(file.path());
                of.is_ok_and(|of| of.is_file() && of.nlink() == 0 && of.len() > 100_000)
            })
        });
        let pid = Pid::from_child(&child);
        kill_process(pid, signal).expect("a signal");
        let status = child.wait().expect("its end");
        assert!(grows, "{signal:?}: nothing was written");
        assert_eq!(status.code(), code, "{signal:?}");
        assert_eq!(names(), ["long.c3d", "out.csv.part"], "{signal:?}");
    }
    let done = gaitway().args(["convert", &file]).arg(folder.join("out.csv")).output();
    let done = done.expect("it runs");
    assert_eq!(done.status.code(), Some(0), "{}", words(&done));
    assert_eq!(names(), ["long.c3d", "out.csv", "out.csv.part"]);
    assert_eq!(fs::read(folder.join("out.csv.part")).expect("a file"), b"precious");
}

#[test]
fn where_a_body_is_needed_markers_of_no_known_set_are_refused_with_what_to_do() {
    let folder = folder("needs-skeleton");
    let c3d = written(&folder, "trial.c3d", &trial().bytes());
    let trc = written(&folder, "trial.trc", TRC.as_bytes());
    let table = written(&folder, "trial.csv", TABLE.as_bytes());
    let out = |name: &str| folder.join(name).to_str().expect("a path").to_owned();
    for file in [&c3d, &trc, &table] {
        for arguments in [
            vec!["retarget", file, "--robot", "op3", "-o", &out("a.csv")],
            vec!["play", file, "--robot", "op3", "--bus", "sim"],
            vec!["actionlets", file, "-o", &out("a.toml")],
            vec!["convert", file, &out("a.bvh")],
        ] {
            let refused = gaitway().args(&arguments).output().expect("it runs");
            let said = words(&refused);
            assert!(
                said.contains("no marker set matches this file") && said.contains("--markers"),
                "{arguments:?}: {said}"
            );
            assert_eq!(refused.status.code(), Some(1), "{arguments:?}");
        }
    }
    let markers = c3d::read(Path::new(&c3d)).expect("read");
    let mut no_rate = Vec::new();
    let mut made = Made { rate_hz: 0.0, ..Made::new(1, 2, 0, 0) };
    made.without("POINT", "RATE");
    made.without("ANALOG", "RATE");
    let unknown = c3d::parse(&made.bytes()).expect("read");
    let refused =
        c3d::write::write(&mut no_rate, &mut FramesOf::new(&unknown)).expect_err("no rate");
    assert!(refused.to_string().contains("--rate"), "{refused}");
    assert!(markers.head().rate_hz.is_some());
}

/// Real trials: what `info` says of every file can be said at all, and in a sensible way.
#[test]
fn info_reads_every_real_file() {
    let Some(root) = captured::captured("mocap/c3d") else { return };
    let mut read = 0;
    for folder in fs::read_dir(root).expect("a folder") {
        for entry in fs::read_dir(folder.expect("an entry").path()).expect("a folder") {
            let path = entry.expect("an entry").path();
            let told = gaitway().arg("info").arg(&path).arg("--json").output().expect("it runs");
            assert!(told.status.success(), "{}: {}", path.display(), words(&told));
            let report = json(&told);
            assert!(report["frames"].as_u64().expect("frames") > 0, "{}", path.display());
            assert!(report["rate_hz"].as_f64().expect("a rate") >= 50.0, "{}", path.display());
            read += 1;
        }
    }
    assert!(read > 10, "{read} files");
}
