//! Segment frames: one skeleton has one calibration, a rest pose is not always how people stand, and how
//! a trunk leans is kept through every conversion, or said where a robot cannot show it.

use crate::aloud::aloud;
use crate::common::puppet::{self, Convention};
use crate::common::{bvh_files, capture_file, captures, op3, op3_initial_rad};
use crate::program;
use gaitway::body::{Dof, JointAngles, Proportions, Segment, SegmentPose, segment_name};
use gaitway::job::model::robot_model;
use gaitway::mocap::anatomy::{self, Anatomy, Capture, Poses, Posture};
use gaitway::mocap::bvh::{self, Axis, Bvh, Channel};
use gaitway::mocap::clip::Clip;
use gaitway::mocap::retarget::retarget;
use gaitway::mocap::siblings::{self, CaptureFile};
use gaitway::mocap::skeleton::{Placed, Skeleton};
use gaitway::robot::Robot;
use glam::{DQuat, DVec3, EulerRot};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

const STATURE_M: f64 = 1.75;

fn deg(degrees: f64) -> f64 {
    degrees.to_radians()
}

/// Names that say which joint is what, and which most programs use.
fn plain_name(segment: Segment) -> &'static str {
    match segment {
        Segment::Pelvis => "Hips",
        Segment::Torso => "Spine",
        Segment::Head => "Head",
        Segment::LeftUpperArm => "LeftArm",
        Segment::LeftForearm => "LeftForeArm",
        Segment::RightUpperArm => "RightArm",
        Segment::RightForearm => "RightForeArm",
        Segment::LeftThigh => "LeftUpLeg",
        Segment::LeftShank => "LeftLeg",
        Segment::LeftFoot => "LeftFoot",
        Segment::RightThigh => "RightUpLeg",
        Segment::RightShank => "RightLeg",
        Segment::RightFoot => "RightFoot",
    }
}

/// A file in cm with Y up, its bones drawn so.
fn drawn(bone: fn(Segment, &Convention) -> DQuat) -> Convention {
    Convention {
        to_file: DQuat::from_rotation_y(deg(-90.0)) * DQuat::from_rotation_x(deg(-90.0)),
        units_per_m: 100.0,
        order: ([Axis::Z, Axis::X, Axis::Y], EulerRot::ZXY),
        bone,
        name: plain_name,
    }
}

/// N pose but for the head, which is thrown back by this much.
fn head_back<const DEGREES: i32>(segment: Segment, convention: &Convention) -> DQuat {
    let back = if segment == Segment::Head { f64::from(DEGREES) } else { 0.0 };
    DQuat::from_rotation_y(deg(back)) * puppet::drawn_as_n(segment, convention)
}

/// N pose but for the chest, which is bent forward by this much.
fn chest_bent<const DEGREES: i32>(segment: Segment, convention: &Convention) -> DQuat {
    let bent = if segment == Segment::Torso { f64::from(DEGREES) } else { 0.0 };
    DQuat::from_rotation_y(deg(-bent)) * puppet::drawn_as_n(segment, convention)
}

/// The same motion by somebody who stoops: all above the waist leans forward.
fn stooped(poses: &[SegmentPose], lean_deg: f64) -> Vec<SegmentPose> {
    let is_above = |segment: &Segment| {
        std::iter::successors(Some(*segment), |s| s.parent()).any(|s| s == Segment::Torso)
    };
    let stoop = |pose: &SegmentPose| {
        let pelvis = pose.orientation[Segment::Pelvis.index()];
        let lean = pelvis * DQuat::from_rotation_y(deg(lean_deg)) * pelvis.inverse();
        let mut pose = pose.clone();
        for segment in Segment::ALL.iter().filter(|segment| is_above(segment)) {
            pose.orientation[segment.index()] = lean * pose.orientation[segment.index()];
        }
        pose
    };
    poses.iter().map(stoop).collect()
}

/// Through the text, as a user's file comes.
fn clip_of(bvh: &Bvh) -> Clip {
    Clip::new(bvh::parse(bvh::write(bvh).as_bytes()).expect("a BVH file"), None).expect("a person")
}

fn save(folder: &Path, name: &str, bvh: &Bvh) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, bvh::write(bvh)).expect("a file");
    path
}

/// The farthest that a segment is off against another, over all poses, deg.
fn off_deg(found: &Capture, truth: &[SegmentPose], segment: Segment, against: Segment) -> f64 {
    assert_eq!(found.poses.len(), truth.len());
    let turned = |pose: &SegmentPose| {
        pose.orientation[against.index()].inverse() * pose.orientation[segment.index()]
    };
    let off = found.poses.iter().zip(truth).map(|(a, b)| turned(a).angle_between(turned(b)));
    off.fold(0.0, f64::max).to_degrees()
}

fn torso_off_deg(found: &Capture, truth: &[SegmentPose]) -> f64 {
    off_deg(found, truth, Segment::Torso, Segment::Pelvis)
}

#[test]
fn files_of_one_skeleton_share_their_frames_whichever_of_them_is_read() {
    let (upright, rate_hz) = puppet::exercise();
    let stoops = stooped(&upright, 30.0);
    let convention = drawn(puppet::drawn_along_x);
    let folder = program::folder("family");
    let one = save(&folder, "b-upright.bvh", &puppet::write(&upright, rate_hz, &convention));
    let mut other = puppet::write(&stoops, rate_hz, &convention);
    // Rounding, and another place to stand.
    other.joints[3].offset.x += 0.03;
    other.joints[0].offset = DVec3::new(3.0, 90.0, -400.0);
    let two = save(&folder, "a-stooped.bvh", &other);
    // What is beside them and has no part: another skeleton, what is no capture, a folder, and a pipe on
    // which nobody writes.
    let mut wider = puppet::write(&upright, rate_hz, &convention);
    wider.joints[3].offset *= 1.1;
    save(&folder, "c-another.bvh", &wider);
    std::fs::write(folder.join("d-broken.bvh"), "HIERARCHY\nROOT Hips\n{").expect("a file");
    std::fs::create_dir(folder.join("e-folder.bvh")).expect("a folder");
    let pipe = std::process::Command::new("mkfifo").arg(folder.join("f-pipe.bvh")).status();
    assert!(pipe.expect("coreutils").success());

    let read = |path: &Path| siblings::read(path, None, &Default::default()).expect("a capture");
    let (one, two) = (read(&one), read(&two));
    assert_eq!(one.frames, two.frames);
    assert_eq!(one.frames.files, ["a-stooped.bvh", "b-upright.bvh"]);
    assert_eq!((one.frames.files_of_skeleton, one.frames.posture), (2, Posture::Upright));
    let found = two.capture();
    let off = torso_off_deg(&found, &stoops);
    assert!(off < 3.0, "who stoops is straightened by {off:.1} deg");
    assert!(torso_off_deg(&one.capture(), &upright) < 3.0);
    let said = found.notes.iter().any(|note| note.contains("shared by the 2 files"));
    assert!(said && found.notes.iter().any(|n| n.contains(&two.frames.fingerprint)));

    // Its twin by itself: nothing shows that it stoops, and that is said.
    let alone = save(&program::folder("alone"), "stooped.bvh", &other);
    let alone = read(&alone);
    assert_ne!(alone.frames.fingerprint, two.frames.fingerprint);
    assert_eq!((alone.frames.files_of_skeleton, alone.frames.posture), (1, Posture::Straightest));
    let found = alone.capture();
    assert!(torso_off_deg(&found, &stoops) > 8.0);
    assert!(found.notes.iter().any(|note| note.contains("nobody stands upright")), "{found:?}");
}

#[test]
fn what_is_read_of_many_files_does_not_depend_on_which_is_asked_for() {
    let (poses, rate_hz) = puppet::exercise();
    let convention = drawn(puppet::drawn_along_x);
    let folder = program::folder("many");
    for number in 0..40 {
        let part = &poses[number..number + 30];
        save(&folder, &format!("{number:02}.bvh"), &puppet::write(part, rate_hz, &convention));
    }
    let read = |name: &str| {
        siblings::read(&folder.join(name), None, &Default::default()).expect("a capture").frames
    };
    let one = read("00.bvh");
    assert_eq!((one.files.len(), one.files_of_skeleton), (32, 40));
    let mut names = (0..40).map(|number| format!("{number:02}.bvh"));
    let unread = names.find(|name| !one.files.contains(name)).expect("eight");
    assert_eq!(one, read(&unread));
    // And it is the same the next time.
    assert_eq!(one, read("00.bvh"));
}

#[test]
fn a_rest_pose_is_not_believed_where_nobody_stands_as_it_is_drawn() {
    let (poses, rate_hz) = puppet::exercise();
    type Case = (fn(Segment, &Convention) -> DQuat, Option<(Segment, f64)>, f64);
    let cases: [Case; 5] = [
        (head_back::<50>, Some((Segment::Head, 50.0)), 3.0),
        // Drawn bent, so that who looks ahead would look at the sky.
        (head_back::<-20>, Some((Segment::Head, 20.0)), 3.0),
        // What may be a posture is believed: heads are held bent forward.
        (head_back::<20>, None, 23.0),
        (chest_bent::<24>, Some((Segment::Torso, 24.0)), 3.0),
        (chest_bent::<8>, None, 11.0),
    ];
    for (bone, tilted, most_deg) in cases {
        let clip = clip_of(&puppet::write(&poses, rate_hz, &drawn(bone)));
        let anatomy = Anatomy::find(&Poses::of(&clip)).expect("a body");
        assert_eq!(anatomy.posture(), Posture::Drawn);
        let found = anatomy.capture(&clip);
        let notes: Vec<&String> = found.notes.iter().filter(|n| n.contains("tilted")).collect();
        match (tilted, anatomy.tilted_rad()) {
            (Some((segment, much_deg)), [(at, rad)]) => {
                assert_eq!(*at, segment);
                assert!((rad.to_degrees() - much_deg).abs() < 3.0, "{:.1}", rad.to_degrees());
                assert!(notes.len() == 1 && notes[0].contains(segment_name(segment)), "{notes:?}");
            }
            (None, []) => assert!(notes.is_empty(), "{notes:?}"),
            (expected, found) => panic!("{found:?} instead of {expected:?}"),
        }
        let head = off_deg(&found, &poses, Segment::Head, Segment::Pelvis);
        let torso = torso_off_deg(&found, &poses);
        assert!(head < most_deg && torso < most_deg, "{head:.1} and {torso:.1} deg");
    }
}

#[test]
fn who_stoops_in_a_file_with_a_rest_pose_stoops_in_what_is_read() {
    let (poses, rate_hz) = puppet::exercise();
    for lean_deg in [10.0, 16.0, 30.0] {
        let stoops = stooped(&poses, lean_deg);
        let bvh = puppet::write(&stoops, rate_hz, &drawn(puppet::drawn_as_t));
        let found = anatomy::capture(&clip_of(&bvh)).expect("a body");
        let off = torso_off_deg(&found, &stoops);
        assert!(off < 1.0, "{lean_deg} deg: off by {off:.2} deg");
        let pelvis = off_deg(&found, &stoops, Segment::LeftThigh, Segment::Pelvis);
        assert!(pelvis < 2.0, "{lean_deg} deg: the thigh is off by {pelvis:.2} deg");
    }
}

/// Somebody who stands, bows with pelvis and trunk, and stands again: 60 poses per second.
fn bow(pelvis_deg: f64, trunk_deg: f64) -> (Vec<SegmentPose>, f64) {
    let body = Proportions::of_stature(STATURE_M).expect("a body");
    let pose = |sample: i32| {
        let share = (std::f64::consts::PI * f64::from(sample - 60) / 120.0).sin().max(0.0);
        let share = if (60..180).contains(&sample) { share } else { 0.0 };
        let mut angles = JointAngles::default();
        angles[Dof::TorsoFlexion] = deg(trunk_deg) * share;
        for hip in [Dof::LeftHipFlexion, Dof::RightHipFlexion] {
            angles[hip] = deg(pelvis_deg) * share;
        }
        let root_m = DVec3::new(0.0, 0.0, body.root_height_m());
        angles.to_pose(root_m, DQuat::from_rotation_y(deg(pelvis_deg) * share))
    };
    ((0..240).map(pose).collect(), 60.0)
}

#[test]
fn a_bow_keeps_its_depth_in_every_file_of_the_body_model() {
    let (poses, rate_hz) = bow(40.0, 30.0);
    let folder = program::folder("bow");
    let bvh = puppet::write(&poses, rate_hz, &drawn(puppet::drawn_as_t));
    let capture = save(&folder, "bow.bvh", &bvh);
    let convert = |name: &str| {
        let out = folder.join(name);
        let done = program::gaitway().arg("convert").args([&capture, &out]).output();
        let done = done.expect("the command");
        assert!(done.status.success(), "{}", program::words(&done));
        let said = "the torso leans by up to 30 deg against the pelvis, the pelvis by up to 40 deg";
        assert!(program::words(&done).contains(said), "{}", program::words(&done));
        out
    };
    let deepest = 120;

    let table = std::fs::read_to_string(convert("bow.csv")).expect("a table");
    let rows: Vec<Vec<&str>> = table.lines().map(|line| line.split(',').collect()).collect();
    let cell = |title: &str| {
        let column = rows[0].iter().position(|name| *name == title).expect(title);
        rows[deepest + 1][column].parse::<f64>().expect("a number").to_degrees()
    };
    for (title, expected) in [
        ("torso_flexion_rad", 30.0),
        ("pelvis_tilt_rad", 40.0),
        ("pelvis_obliquity_rad", 0.0),
        ("left_hip_flexion_rad", 40.0),
    ] {
        assert!((cell(title) - expected).abs() < 1.0, "{title}: {:.2} deg", cell(title));
    }

    // The file's own joints, placed by nothing but their angles.
    std::fs::create_dir(folder.join("out")).expect("a folder");
    let read = bvh::read(&convert("out/model.bvh")).expect("a BVH file");
    let mut placed = Placed::default();
    Skeleton::new(&read).place(read.pose(deepest), &mut placed);
    for (name, expected) in [("Hips", 40.0), ("Spine", 70.0)] {
        let joint = read.joints.iter().position(|joint| joint.name == name).expect(name);
        let lean = (placed.rotation[joint] * DVec3::Y).angle_between(DVec3::Y).to_degrees();
        assert!((lean - expected).abs() < 1.0, "{name}: {lean:.2} deg");
    }

    let scene = std::fs::read_to_string(convert("bow.x3d")).expect("a scene");
    for (joint, expected) in [("humanoid_root", 40.0), ("vl5", 30.0)] {
        let line = scene.lines().find(|line| line.contains(&format!("DEF='turn_{joint}'")));
        let values = line.and_then(|line| line.split("keyValue='").nth(1)).expect("key values");
        let turn = values.split(", ").nth(deepest).expect("a value for each pose");
        let angle = turn.trim_end_matches("'/>").split(' ').nth(3).expect("an angle");
        let angle = angle.parse::<f64>().expect("a number").to_degrees();
        assert!((angle - expected).abs() < 1.0, "{joint}: {angle:.2} deg");
    }
}

#[test]
fn what_does_not_go_with_a_capture_is_refused_by_convert() {
    let (poses, rate_hz) = bow(10.0, 10.0);
    let folder = program::folder("refused");
    let bvh = puppet::write(&poses[..90], rate_hz, &drawn(puppet::drawn_as_t));
    let capture = save(&folder, "bow.bvh", &bvh);
    let said = |out: &str, more: &[&str]| {
        let mut command = program::gaitway();
        command.arg("convert").args([&capture, &folder.join(out)]).args(more);
        let done = command.output().expect("the command");
        assert_eq!(done.status.code(), Some(1), "{out} {more:?}");
        program::words(&done)
    };
    assert!(said("bow.mcap", &[]).contains(".csv, .bvh, .mot, .x3d or .html"));
    assert!(said("bow.csv", &["--rate", "50"]).contains("--rate"));
    assert!(said("bow.csv", &["--samples"]).contains("--samples"));
    assert!(said("bow.csv", &["--stature", "9"]).contains("0.3 to 3 m"));
    assert!(said("bow.bvh", &["--force"]).contains("would be written over"));
}

#[test]
fn a_robot_with_a_waist_bows_as_deep_and_one_without_says_what_it_does_not_show() {
    let (poses, rate_hz) = bow(20.0, 30.0);
    let capture = puppet::truth(poses, rate_hz);
    let settings = Default::default();
    let result = retarget(&capture, &op3(), &op3_initial_rad(), &settings).expect("a motion");
    let lost = result.trunk_lean_lost.expect("OP3 has no waist");
    assert!((lost.most_deg - 30.0).abs() < 0.1 && (lost.at_s - 2.0).abs() < 0.05, "{lost:?}");
    assert!(lost.mean_deg > 5.0 && lost.mean_deg < 15.0, "{lost:?}");
    let notes = &result.notes;
    assert!(notes.iter().any(|note| note.contains("no waist") && note.contains("30 deg")));

    let poppy = robot_model(&Robot::load("poppy-humanoid").expect("shipped")).expect("an anatomy");
    let initial = vec![0.0; poppy.joints.len()];
    let result = retarget(&capture, &poppy, &initial, &settings).expect("a motion");
    assert_eq!(result.trunk_lean_lost, None);
    assert!(!result.notes.iter().any(|note| note.contains("waist")), "{:?}", result.notes);
    let link = poppy.links.iter().find(|link| link.segment == Segment::Torso).expect("a torso");
    let deepest: Vec<f64> = result.positions_rad.iter().map(|series| series[120]).collect();
    let n_pose = poppy.link_orientation(link.joint, &poppy.n_pose_rad);
    let turned = poppy.link_orientation(link.joint, &deepest) * n_pose.inverse();
    let lean = (turned * DVec3::Z).angle_between(DVec3::Z).to_degrees();
    assert!((lean - 30.0).abs() < 3.0, "Poppy's chest leans {lean:.1} deg against its base");
}

#[test]
fn a_report_says_which_files_the_frames_are_from_and_what_the_robot_does_not_show() {
    let (poses, rate_hz) = bow(20.0, 30.0);
    let folder = program::folder("report");
    let bvh = puppet::write(&poses, rate_hz, &drawn(puppet::drawn_as_t));
    let capture = save(&folder, "bow.bvh", &bvh);
    save(&folder, "again.bvh", &bvh);
    let run = |arguments: &[&str], out: &str| {
        let mut command = program::gaitway();
        command.arg(arguments[0]).arg(&capture).args(&arguments[1..]).arg("--json");
        command.arg("-o").arg(folder.join(out));
        program::json(&command.output().expect("the command"))
    };
    let report = run(&["retarget", "--robot", "op3"], "bow.csv");
    let frames = &report["source"]["segment_frames"];
    assert_eq!(frames["files"], serde_json::json!(["again.bvh", "bow.bvh"]), "{report}");
    assert_eq!(frames["posture"], "drawn");
    assert_eq!(frames["fingerprint"].as_str().map(str::len), Some(16));
    let lost = report["trunk_lean_lost"]["most_deg"].as_f64().expect("a figure");
    assert!((lost - 30.0).abs() < 1.0, "{lost}");
    let report = run(&["actionlets"], "bow.toml");
    assert_eq!(report["segment_frames"]["fingerprint"], frames["fingerprint"]);
    let lost = report["pelvis_lean_lost_deg"].as_f64().expect("a figure");
    assert!((lost - 20.0).abs() < 1.0, "{lost}");
}

/// Where the joints of a pose are and nothing else, by the rules of the format: a placing of our own, to
/// hold the program's against. All position channels replace the OFFSET.
fn places(bvh: &Bvh, pose: usize) -> Vec<DVec3> {
    let values = bvh.pose(pose);
    let mut turned: Vec<DQuat> = Vec::new();
    let mut places: Vec<DVec3> = Vec::new();
    for joint in &bvh.joints {
        let (mut turn, mut shift) = (DQuat::IDENTITY, joint.offset);
        for (channel, value) in joint.channels.iter().zip(&values[joint.first_channel..]) {
            match channel {
                Channel::Position(axis) => shift[*axis as usize] = *value,
                Channel::Rotation(axis) => {
                    turn *= DQuat::from_axis_angle(axis.unit(), value.to_radians());
                }
            }
        }
        let (carrier, from) =
            joint.parent.map_or((DQuat::IDENTITY, DVec3::ZERO), |p| (turned[p], places[p]));
        places.push(from + carrier * shift);
        turned.push(carrier * turn);
    }
    places
}

/// Files by folder and bones, where there are several.
fn families(files: &[PathBuf]) -> Vec<Vec<PathBuf>> {
    let mut families: Vec<(PathBuf, gaitway::mocap::bones::Bones, Vec<PathBuf>)> = Vec::new();
    for path in files {
        let Ok(clip) = bvh::read(path).and_then(|bvh| Clip::new(bvh, None)) else { continue };
        let (folder, bones) = (path.parent().expect("a folder").to_owned(), clip.bones());
        match families.iter_mut().find(|(of, known, _)| *of == folder && known.is_same(&bones)) {
            Some((_, _, members)) => members.push(path.clone()),
            None => families.push((folder, bones, vec![path.clone()])),
        }
    }
    families.into_iter().map(|(_, _, members)| members).filter(|m| m.len() > 1).collect()
}

/// How far frames lie from their mean, by segment: mean and worst, deg.
fn scatter(all: &[Anatomy]) -> BTreeMap<Segment, (f64, f64)> {
    let mut found = BTreeMap::new();
    for segment in Segment::ALL {
        let frames: Vec<DQuat> =
            all.iter().filter_map(|of| of.frame(segment)).map(|(_, frame)| frame).collect();
        let Some(first) = frames.first() else { continue };
        let near = |frame: &DQuat| if frame.dot(*first) < 0.0 { -*frame } else { *frame };
        let sum = frames.iter().map(near).fold(DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0), |a, b| a + b);
        let off: Vec<f64> =
            frames.iter().map(|f| f.angle_between(sum.normalize()).to_degrees()).collect();
        let mean = off.iter().sum::<f64>() / off.len() as f64;
        found.insert(segment, (mean, off.into_iter().fold(0.0, f64::max)));
    }
    found
}

/// Captures of equal bones: the frames that each finds by itself scatter, those that are used do not.
#[test]
fn captures_of_one_skeleton_have_one_set_of_frames() {
    let Some(folder) = captures() else { return };
    let families = families(&bvh_files(&folder));
    assert!(!families.is_empty(), "no two captures of one skeleton under {}", folder.display());
    for family in families {
        let read =
            |path: &PathBuf| siblings::read(path, None, &Default::default()).expect("a capture");
        let files: Vec<CaptureFile> = family.iter().map(read).collect();
        let by_itself = |file: &CaptureFile| Anatomy::find(&Poses::of(&file.clip)).expect("a body");
        let alone: Vec<Anatomy> = files.iter().map(by_itself).collect();
        let used: Vec<Anatomy> = files.iter().map(|file| file.anatomy.clone()).collect();
        let name = family[0].parent().and_then(Path::file_name).unwrap_or_default();
        let frames = &files[0].frames;
        aloud!(
            "{} files in {}, frames from {} of them, {:?}, {:?}",
            files.len(),
            name.display(),
            frames.files.len(),
            frames.posture,
            frames.tilted_deg
        );
        let title = "deg";
        aloud!("  {title:18} by itself: mean, worst; used: worst");
        let (alone, used) = (scatter(&alone), scatter(&used));
        for (segment, (mean, worst)) in alone {
            let (_, most) = used[&segment];
            aloud!("  {:18} {mean:6.2} {worst:6.2} {most:12.2}", format!("{segment:?}"));
            assert!(most <= 1.0, "{segment:?} scatters by {most:.2} deg in {}", name.display());
        }
    }
}

/// A skeleton that is drawn so that whoever looks ahead would have the head thrown back: while its
/// person stands, the head is upright. Who stands, joint positions say.
#[test]
fn nobody_stares_at_the_sky_because_the_skeleton_is_drawn_so() {
    let Some(folder) = captures() else { return };
    let name = "cmu_new3_back_handspring1_autolabel.bvh";
    let Some(path) = capture_file(&folder, name) else { return };
    let file = siblings::read(&path, None, &Default::default()).expect("a capture");
    let capture = file.capture();
    let mut placed = Placed::default();
    let (mut upright, mut on_trunk, mut in_world) = (0.0, 0.0, 0.0);
    for (index, pose) in capture.poses.iter().enumerate() {
        file.clip.place(index, &mut placed);
        let trunk = file.clip.landmarks(&placed).trunk().expect("a trunk");
        if trunk.z > 0.97 {
            let up = |segment: Segment| pose.orientation[segment.index()] * DVec3::Z;
            let head = up(Segment::Head);
            upright += 1.0;
            on_trunk += head.angle_between(up(Segment::Torso)).to_degrees();
            in_world += head.angle_between(DVec3::Z).to_degrees();
        }
    }
    let (on_trunk, in_world) = (on_trunk / upright, in_world / upright);
    aloud!(
        "drawn tilted: {:?} deg; in {upright} upright poses the head leans {on_trunk:.1} deg on the trunk, \
         {in_world:.1} deg in the world",
        file.frames.tilted_deg
    );
    assert!(file.frames.tilted_deg.contains_key("torso"));
    assert!(upright > 50.0 && on_trunk < 20.0 && in_world < 20.0, "{on_trunk:.1}, {in_world:.1}");
}

/// Forward lean of a direction in the sagittal plane of a pelvis whose left is `across`, rad.
fn forward_lean_rad(direction: DVec3, across: DVec3, up: DVec3) -> f64 {
    let ahead = across.cross(up).normalize();
    direction.dot(ahead).atan2(direction.dot(up))
}

/// Who bows, by joint positions alone: the chest from `Chest` to `Neck`, the pelvis from `Hips` to
/// `Spine`, and the line from hips to neck, each against the vertical; and how deep the 22 joint
/// angles with the orientation of the pelvis go.
#[test]
fn bows_are_as_deep_in_the_joint_angles_as_between_the_joints_of_the_file() {
    let Some(folder) = captures() else { return };
    let mut bows = 0;
    let title = "bow, deg";
    aloud!("{title:34} chest: file, angles; trunk: file, angles; line: file, figure");
    for path in bvh_files(&folder) {
        let Ok(read) = bvh::read(&path) else { continue };
        let joint = |name: &str| read.joints.iter().position(|joint| joint.name == name);
        let names = ["Hips", "Spine", "Chest", "Neck", "UpperLeg_L", "UpperLeg_R"].map(joint);
        let [Some(hips), Some(spine), Some(chest), Some(neck), Some(left), Some(right)] = names
        else {
            continue;
        };
        let file = siblings::read(&path, None, &Default::default()).expect("a capture");
        let (capture, up) = (file.capture(), file.clip.file_up());
        // By pose: chest, pelvis, the line.
        let raw: Vec<[f64; 3]> = (file.clip.dropped()..read.pose_count())
            .map(|pose| {
                let at = places(&read, pose);
                let (across, middle) = (at[left] - at[right], at[left].midpoint(at[right]));
                let lines = [at[neck] - at[chest], at[spine] - at[hips], at[neck] - middle];
                lines.map(|line| forward_lean_rad(line, across, up).to_degrees())
            })
            .collect();
        let body = Proportions::of_stature(capture.stature_m).expect("a body");
        let angles = JointAngles::of_clip(&capture.poses, capture.rate_hz).angles;
        let ours: Vec<[f64; 3]> = angles
            .iter()
            .zip(&capture.poses)
            .map(|(angles, pose)| {
                let pelvis = pose.orientation[Segment::Pelvis.index()];
                let made = angles.to_pose(pose.root_m, pelvis);
                let of = |segment: Segment| made.orientation[segment.index()];
                let neck = body.positions(&made).joint_m(gaitway::body::Joint::Neck);
                let lines = [of(Segment::Torso) * DVec3::Z, pelvis * DVec3::Z, neck - made.root_m];
                lines.map(|line| forward_lean_rad(line, pelvis * DVec3::Y, DVec3::Z).to_degrees())
            })
            .collect();
        let deepest =
            (0..raw.len()).max_by(|a, b| raw[*a][0].total_cmp(&raw[*b][0])).expect("poses");
        // From how the person stands at the beginning.
        let depth = |series: &[[f64; 3]], line: usize| series[deepest][line] - series[0][line];
        if depth(&raw, 0) < 30.0 {
            continue;
        }
        bows += 1;
        let trunk = |series: &[[f64; 3]]| depth(series, 0) - depth(series, 1);
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        aloud!(
            "{name:34} {:11.1} {:7.1} {:12.1} {:7.1} {:11.1} {:7.1}",
            depth(&raw, 0),
            depth(&ours, 0),
            trunk(&raw),
            trunk(&ours),
            depth(&raw, 2),
            depth(&ours, 2)
        );
        let (chest_off, trunk_off) = (depth(&ours, 0) - depth(&raw, 0), trunk(&ours) - trunk(&raw));
        assert!(chest_off.abs() <= 2.0, "{name}: the chest bows {chest_off:+.1} deg");
        assert!(trunk_off.abs() <= 2.0, "{name}: the trunk bows {trunk_off:+.1} deg");
        // Straight is straight: not only the change is right.
        let stands = ours[deepest][0] - raw[deepest][0];
        assert!(stands.abs() <= 8.0, "{name}: the chest stands {stands:+.1} deg off the bone");
    }
    if bows == 0 {
        aloud!("SKIPPED: no capture of a bow with joints Hips, Spine, Chest, Neck");
    }
}
