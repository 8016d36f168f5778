//! Acclaim skeletons and motions: by hand, against the same takes in other formats, and broken.

use crate::captured::captured;
use crate::program;
use gaitway::mocap::acclaim::{self, AcclaimSkeleton};
use gaitway::mocap::bvh::{self, Bvh};
use gaitway::mocap::c3d;
use gaitway::mocap::files::{self, CaptureOptions};
use gaitway::mocap::skeleton::{Placed, Skeleton};
use glam::DVec3;
use std::path::{Path, PathBuf};

const ASF: &str = "# a comment
:version 1.10
:name test
:units
  mass 1.0
  length 0.45
  angle deg
:documentation
  begin: of a text that is no skeleton
:root
  order TX TY TZ RX RY RZ
  axis XYZ
  position 0 0 0
  orientation 0 0 0
:bonedata
  begin
    id 1
    name arm
    direction 1 0 0
    length 2
    axis 0 0 90 XYZ
    dof rx
    limits (-160.0 20.0)
  end
  begin
    id 2
    name hand
    direction 0 2 0
    length 1
    axis 90 0 90 XYZ
    dof rz rx
    limits (-1 1)
           (-1 1)
  end
  begin
    id 3
    name tail
    direction 0 0 1
    length 3
    axis 0 0 0 XYZ
  end
:hierarchy
  begin
    root arm tail
    arm hand
  end
";

const AMC: &str = "#!OML:ASF somewhere
:FULLY-SPECIFIED
:DEGREES
1
root 1 2 3 0 0 0
arm 90
hand 0 0
2
root 0 0 0 90 0 90
arm 0
hand 90 0
";

fn skeleton() -> AcclaimSkeleton {
    acclaim::parse_skeleton(ASF.as_bytes()).expect("a skeleton")
}

fn motion(text: &str) -> Result<(Bvh, Vec<String>), gaitway::Error> {
    acclaim::parse(text.as_bytes(), &skeleton(), None)
}

fn refusal(text: &str) -> String {
    motion(text).expect_err("broken").to_string()
}

/// Where the joints are in a frame, and the end of a joint.
fn placed(bvh: &Bvh, pose: usize) -> Placed {
    let mut placed = Placed::default();
    Skeleton::new(bvh).place(bvh.pose(pose), &mut placed);
    placed
}

fn end(bvh: &Bvh, placed: &Placed, name: &str) -> DVec3 {
    let at = bvh.joints.iter().position(|joint| joint.name == name).expect("a joint");
    placed.position[at] + placed.rotation[at] * bvh.joints[at].ends[0]
}

/// Worked by hand from the definition: a bone turns about its own axes, which are turned by `axis`; rotations
/// are about fixed axes in the order that is listed.
#[test]
fn bones_are_where_the_definition_puts_them() {
    let (bvh, notes) = motion(AMC).expect("a motion");
    let names: Vec<&str> = bvh.joints.iter().map(|joint| joint.name.as_str()).collect();
    assert_eq!(names, ["root", "arm", "tail", "hand"]);
    assert_eq!((bvh.pose_count(), 1.0 / bvh.time_step_s), (2, 120.0));
    assert!(
        notes.iter().any(|note| note.contains("120 Hz, which the file does not say")),
        "{notes:?}"
    );
    let near =
        |a: DVec3, b: [f64; 3]| assert!((a - DVec3::from_array(b)).length() < 1e-12, "{a} {b:?}");
    // The x axis of the arm is the world's y: 90 degrees about it carry x to -z.
    let first = placed(&bvh, 0);
    near(first.position[3], [1.0, 2.0, 1.0]);
    near(end(&bvh, &first, "hand"), [1.0, 3.0, 1.0]);
    near(end(&bvh, &first, "tail"), [1.0, 2.0, 6.0]);
    // The root: about x, then about the fixed z. x goes to y, y to z, z to -y and so to x.
    let second = placed(&bvh, 1);
    near(second.position[3], [0.0, 2.0, 0.0]);
    near(end(&bvh, &second, "tail"), [3.0, 0.0, 0.0]);
    // The hand's z axis: C = Rz(90) Rx(90) takes z to -y and that to x. 90 degrees about x take the hand's y
    // to z, which the root then takes to x.
    near(end(&bvh, &second, "hand"), [1.0, 2.0, 0.0]);
}

#[test]
fn angles_may_be_radians_and_rates_are_asked_for_said_or_usual() {
    let degrees = motion(AMC).expect("a motion").0;
    let in_radians = AMC
        .replace(":DEGREES", ":RADIANS\n:SAMPLES-PER-SECOND 60")
        .replace(" 90", &format!(" {}", std::f64::consts::FRAC_PI_2));
    let (radians, _) = motion(&in_radians).expect("a motion");
    for (a, b) in degrees.values.iter().zip(&radians.values) {
        assert!((a - b).abs() < 1e-9, "{a} {b}");
    }
    assert_eq!(1.0 / radians.time_step_s, 60.0);
    let asked = acclaim::parse(in_radians.as_bytes(), &skeleton(), Some(30.0)).expect("a motion");
    assert!((1.0 / asked.0.time_step_s - 30.0).abs() < 1e-9);
    let crlf = motion(&AMC.replace('\n', "\r\n")).expect("a motion").0;
    assert_eq!(crlf, degrees);
}

#[test]
fn a_last_frame_that_is_not_whole_is_left_out_and_said_and_other_faults_are_refused() {
    let cut = AMC.strip_suffix("hand 90 0\n").expect("the last line");
    let (bvh, notes) = motion(cut).expect("a motion");
    assert_eq!(bvh.pose_count(), 1);
    assert!(
        notes.iter().any(|note| note.contains("frame 2") && note.contains("cut off")),
        "{notes:?}"
    );
    for (from, to, said) in [
        ("arm 90\n", "", "frame 1 without arm"),
        ("arm 90", "arm 90 1", "line 6"),
        ("arm 90", "arm", "0 numbers"),
        ("arm 90", "leg 90", "no such bone"),
        ("arm 90", "arm 90\narm 90", "twice"),
        ("arm 90", "arm nan", "a number is expected"),
        ("arm 90", "arm 1e99", "a number is expected"),
        ("1\nroot", "root", "number of a frame"),
    ] {
        let refused = refusal(&AMC.replacen(from, to, 1));
        assert!(refused.contains(said), "{said}: {refused}");
    }
    let jump = motion(&AMC.replace("\n2\n", "\n5\n")).expect("a motion").1;
    assert!(
        jump.iter().any(|note| note.contains("does not follow the one before, 1 time")),
        "{jump:?}"
    );
    for (from, to, said) in [
        ("root arm tail", "root arm", "tail"),
        ("arm hand", "arm hand arm", "below two others"),
        ("dof rx\n", "dof rx rx\n", "listed twice"),
        ("dof rx\n", "dof l\n", "is not read"),
        ("length 2\n", "", "not complete"),
        ("length 2", "length x", "a number is expected"),
        (":bonedata", ":bones", "not an ASF skeleton"),
    ] {
        let broken = ASF.replacen(from, to, 1);
        let refused = acclaim::parse_skeleton(broken.as_bytes()).expect_err("broken").to_string();
        assert!(refused.contains(said), "{said}: {refused}");
    }
}

#[test]
fn no_cut_or_flipped_byte_breaks_the_readers() {
    for (text, is_skeleton) in [(ASF, true), (AMC, false)] {
        let try_it = |bytes: &[u8]| {
            if is_skeleton {
                if let Ok(skeleton) = acclaim::parse_skeleton(bytes) {
                    let _ = acclaim::parse(AMC.as_bytes(), &skeleton, None);
                }
            } else if let Ok((bvh, _)) = acclaim::parse(bytes, &skeleton(), None) {
                assert_eq!(bvh.values.len(), bvh.pose_count() * bvh.channel_count());
                assert!(bvh.values.iter().all(|value| value.is_finite()));
            }
        };
        let bytes = text.as_bytes();
        for at in 0..bytes.len() {
            try_it(&bytes[..at]);
            for with in [0, b' ', b'\n', b'9', b':', 0xff] {
                let mut broken = bytes.to_vec();
                broken[at] = with;
                try_it(&broken);
            }
        }
    }
}

fn capture(name: &str) -> Option<PathBuf> {
    let file = captured("mocap")?.join(name);
    file.exists().then_some(file)
}

fn joint(bvh: &Bvh, names: &[&str]) -> usize {
    let is = |name: &str| names.iter().any(|of| name.eq_ignore_ascii_case(of));
    bvh.joints.iter().position(|joint| is(&joint.name)).expect("a joint")
}

/// Take 01_01 of the CMU database as an ASF/AMC pair, and as two BVH files that others made of it: one has a rest
/// pose in front. Below the thorax they are the same.
#[test]
fn a_motion_is_where_other_peoples_conversions_put_it() {
    let Some(file) = capture("asfamc/cmu_01_01.amc") else { return };
    let ours = files::read(&file, &CaptureOptions::default()).expect("read").bvh;
    assert_eq!((ours.pose_count(), ours.joints.len()), (2751, 31));
    for (name, shift) in [("fairmotion_01_01.bvh", 1), ("cmu_01_01_first1000.bvh", 0)] {
        let Some(other) = capture(&format!("bvh/cmu/{name}")) else { continue };
        let theirs = bvh::read(&other).expect("read");
        let pairs = [
            (&["lfemur"][..], &["LeftUpLeg", "LeftHip"][..]),
            (&["ltibia"], &["LeftLeg", "LeftKnee"]),
            (&["lfoot"], &["LeftFoot", "LeftAnkle"]),
            (&["rtibia"], &["RightLeg", "RightKnee"]),
            (&["rfoot"], &["RightFoot", "RightAnkle"]),
        ];
        let frames = ours.pose_count().min(theirs.pose_count() - shift);
        assert!(frames > 900, "{name}: {frames} frames");
        let mut worst: f64 = 0.0;
        for frame in 0..frames {
            let (a, b) = (placed(&ours, frame), placed(&theirs, frame + shift));
            for (mine, other) in pairs {
                let (mine, other) = (joint(&ours, mine), joint(&theirs, other));
                let (a, b) = (a.position[mine] - a.position[0], b.position[other] - b.position[0]);
                worst = worst.max((a - b).length() / a.length());
            }
        }
        assert!(worst < 1e-4, "{name}: {worst}");
    }
}

/// The same run of HDM05 as markers and as a skeleton: the marker on the ankle stays where it is on the foot's
/// joint. CMU's unit is 1/0.45 inch, and the axes go round.
#[test]
fn a_skeleton_and_the_markers_of_the_same_run_move_together() {
    let Some(file) = capture("asfamc/HDM_dg_06-03_03_120.amc") else { return };
    let Some(trial) = capture("c3d/hdm05/HDM_dg_06-03_03_120.c3d") else { return };
    let bvh = files::read(&file, &CaptureOptions::default()).expect("read").bvh;
    let markers = c3d::read(&trial).expect("read");
    assert_eq!(bvh.pose_count(), markers.head().frames);
    for (bone, label) in [("lfoot", "Daniel:LANK"), ("rfoot", "Daniel:RANK")] {
        let point = markers.head().points.iter().position(|point| point.label == label);
        let (point, bone) = (point.expect("a marker"), joint(&bvh, &[bone]));
        let mut distances = Vec::new();
        for frame in 0..bvh.pose_count() {
            let Some(sample) = markers.sample(frame, point) else { continue };
            let DVec3 { x, y, z } = placed(&bvh, frame).position[bone] * (25.4 / 0.45);
            let [a, b, c] = sample.position.map(f64::from);
            distances.push((DVec3::new(a, b, c) - DVec3::new(z, x, y)).length());
        }
        let mean = distances.iter().sum::<f64>() / distances.len() as f64;
        let square = distances.iter().map(|d| (d - mean).powi(2)).sum::<f64>();
        let deviation_mm = (square / distances.len() as f64).sqrt();
        assert!(distances.len() > 150 && deviation_mm < 0.3, "{label}: {deviation_mm} mm");
    }
}

fn run(arguments: &[&str]) -> std::process::Output {
    program::gaitway().args(arguments).output().expect("the program")
}

fn said(output: &std::process::Output) -> String {
    let (out, err) = (&output.stdout, &output.stderr);
    format!("{}{}", String::from_utf8_lossy(out), String::from_utf8_lossy(err))
}

/// Skeleton files go where a capture goes.
#[test]
fn an_amc_file_goes_everywhere_a_capture_goes() {
    let Some(file) = capture("asfamc/cmu_01_01.amc") else { return };
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("acclaim");
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("a folder");
    let motion = file.to_str().expect("a path");
    let out = |name: &str| folder.join(name).to_str().expect("a path").to_owned();
    let told = run(&["info", motion, "--json"]);
    let report: serde_json::Value = serde_json::from_slice(&told.stdout).expect("JSON");
    assert_eq!((&report["format"], &report["frames"]), (&"amc".into(), &2751.into()));
    assert_eq!(report["rate_hz"], 120.0);
    assert!((report["duration_s"].as_f64().expect("s") - 2750.0 / 120.0).abs() < 1e-9);
    assert_eq!(report["up"], serde_json::json!([0.0, 1.0, 0.0]));
    let stature = report["stature_m"].as_f64().expect("m");
    assert!((1.5..1.95).contains(&stature), "{stature} m");
    for arguments in [
        vec!["convert", motion, &out("a.bvh")],
        vec!["convert", motion, &out("a.csv"), "--rate", "60"],
        vec!["retarget", motion, "--robot", "op3", "-o", &out("op3.csv"), "--to", "2"],
        vec!["actionlets", motion, "-o", &out("a.toml"), "--tolerance", "5"],
    ] {
        let done = run(&arguments);
        assert!(matches!(done.status.code(), Some(0 | 3)), "{arguments:?}: {}", said(&done));
    }
    let table = std::fs::read_to_string(out("a.csv")).expect("a table");
    let second = table.lines().nth(2).and_then(|line| line.split(',').next()).expect("a time");
    assert!((second.parse::<f64>().expect("s") - 1.0 / 60.0).abs() < 1e-6, "{second}");
    // A copy without its skeleton beside it is refused until the skeleton is named.
    let copy = out("alone.amc");
    std::fs::copy(&file, &copy).expect("a copy");
    let alone = run(&["info", &copy]);
    assert!(said(&alone).contains("--skeleton") && !alone.status.success(), "{}", said(&alone));
    let asf = file.with_file_name("cmu_01.asf");
    let named = run(&["info", &copy, "--skeleton", asf.to_str().expect("a path")]);
    assert!(named.status.success(), "{}", said(&named));
    let other = file.with_file_name("HDM_dg.asf");
    let bvh = out("a.bvh");
    let wrong = run(&["info", &bvh, "--skeleton", other.to_str().expect("a path")]);
    assert!(said(&wrong).contains("these are for AMC files"), "{}", said(&wrong));
}
