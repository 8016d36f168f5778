//! Bones out of markers: against the bones that Plug-in Gait stored in real trials, and against a body whose motion
//! is known.

use crate::aloud::aloud;
use crate::captured;
use crate::program;
use gaitway::body::{Joint, Segment};
use gaitway::mocap::c3d;
use gaitway::mocap::fit::bones::fit_bones;
use gaitway::mocap::fit::centres::{HipBy, JointsAt};
use gaitway::mocap::fit::marker_set::{Labelled, MarkerPlace};
use gaitway::mocap::fit::{FitSettings, Fitted, MarkedBody, fit};
use gaitway::mocap::markers::{
    Frame, FramesOf, Head, MarkerFormat, MarkerPoint, Markers, PointKind, PointSample,
};
use gaitway::mocap::plug_in_gait::GaitBones;
use glam::{DQuat, DVec3};
use std::path::Path;

/// Trials with Plug-in Gait's own bones, the static trial of each, and the radius of their markers, m: from the
/// distance of the stored knee joints to the knee markers, which is half a knee's width and this.
const TRIALS: [(&str, &str, f64); 3] = [
    ("PiG_Motion-FlatFoot-Full.c3d", "PiG_Calibration-FlatFoot-Full.c3d", 0.008),
    ("cgm_Movement_trial.c3d", "cgm_Static_trial.c3d", 0.007),
    ("cgm_Static_trial.c3d", "cgm_Static_trial.c3d", 0.007),
];

const JOINTS: [(&str, [Joint; 2]); 6] = [
    ("hip", [Joint::LeftHip, Joint::RightHip]),
    ("knee", [Joint::LeftKnee, Joint::RightKnee]),
    ("ankle", [Joint::LeftAnkle, Joint::RightAnkle]),
    ("shoulder", [Joint::LeftShoulder, Joint::RightShoulder]),
    ("elbow", [Joint::LeftElbow, Joint::RightElbow]),
    ("wrist", [Joint::LeftWrist, Joint::RightWrist]),
];

/// Segments whose long axis is compared, with the joints at its ends.
const AXES: [(&str, [(Joint, Joint); 2]); 4] = [
    ("thigh", [(Joint::LeftHip, Joint::LeftKnee), (Joint::RightHip, Joint::RightKnee)]),
    ("shank", [(Joint::LeftKnee, Joint::LeftAnkle), (Joint::RightKnee, Joint::RightAnkle)]),
    (
        "upper arm",
        [(Joint::LeftShoulder, Joint::LeftElbow), (Joint::RightShoulder, Joint::RightElbow)],
    ),
    ("forearm", [(Joint::LeftElbow, Joint::LeftWrist), (Joint::RightElbow, Joint::RightWrist)]),
];

/// Root mean squares of distances of joints, mm, and of angles of long axes, deg, against the stored bones.
struct Off {
    joints_mm: Vec<f64>,
    axes_deg: Vec<f64>,
    frames: usize,
}

fn off(trial: &Markers, fitted: &Fitted) -> Off {
    let bones = GaitBones::of(trial.head(), "").expect("stored bones");
    let mut frame = Frame::default();
    let (mut joints, mut axes) = (vec![(0.0, 0); JOINTS.len()], vec![(0.0, 0); AXES.len()]);
    for (n, own) in fitted.joints_m.iter().enumerate() {
        assert!(trial.frame(n, &mut frame));
        let truth = |joint: Joint| bones.joint_m(&frame.points, joint).map(|p| fitted.upright * p);
        let ours = |joint: Joint| own[joint.index()];
        for (sum, (_, both)) in joints.iter_mut().zip(JOINTS) {
            for joint in both {
                let Some((a, b)) = truth(joint).zip(ours(joint)) else { continue };
                sum.0 += a.distance_squared(b) * 1e6;
                sum.1 += 1;
            }
        }
        for (sum, (_, both)) in axes.iter_mut().zip(AXES) {
            for (from, to) in both {
                let theirs = truth(from).zip(truth(to)).map(|(a, b)| b - a);
                let own = ours(from).zip(ours(to)).map(|(a, b)| b - a);
                let Some((a, b)) = theirs.zip(own) else { continue };
                sum.0 += a.angle_between(b).to_degrees().powi(2);
                sum.1 += 1;
            }
        }
    }
    let rms = |sums: Vec<(f64, i32)>| {
        sums.into_iter().map(|(sum, n)| (sum / f64::from(n.max(1))).sqrt()).collect()
    };
    Off { joints_mm: rms(joints), axes_deg: rms(axes), frames: trial.head().frames }
}

fn table(title: &str, rows: &[(&str, Off)]) {
    aloud!("{title}: rms against the stored bones, joints mm, long axes deg");
    for (name, off) in rows {
        let joints = JOINTS.iter().zip(&off.joints_mm).map(|((of, _), mm)| format!("{of} {mm:.1}"));
        let axes = AXES.iter().zip(&off.axes_deg).map(|((of, _), deg)| format!("{of} {deg:.2}"));
        let all: Vec<String> = joints.chain(axes).collect();
        aloud!("  {name}, {} frames: {}", off.frames, all.join(", "));
    }
}

fn compared(folder: &Path, settings: &FitSettings) -> Vec<(&'static str, Off)> {
    let mut rows = Vec::new();
    for (trial, stands, marker_radius_m) in TRIALS {
        let read = |name: &str| c3d::read(&folder.join(name)).expect("read");
        let (trial_of, stands) = (read(trial), read(stands));
        let settings = FitSettings { marker_radius_m, ..settings.clone() };
        let fitted = fit(Some(&stands), &trial_of, &settings).expect("fitted");
        rows.push((trial, off(&trial_of, &fitted)));
    }
    rows
}

#[test]
fn joints_moved_inwards_by_the_widths_are_where_plug_in_gait_has_them() {
    let Some(folder) = captured::captured("mocap/c3d/pig") else { return };
    let rows = compared(&folder, &FitSettings::default());
    table("joints moved inwards, hip by leg length", &rows);
    for (name, off) in &rows {
        let most = [15.0, 10.0, 10.0];
        for ((joint, _), (mm, most)) in JOINTS.iter().zip(off.joints_mm.iter().zip(most)) {
            assert!(*mm <= most, "{name}: {joint} {mm:.1} mm");
        }
        for ((axis, _), deg) in AXES.iter().zip(&off.axes_deg).take(2) {
            assert!(*deg <= 3.0, "{name}: {axis} {deg:.2} deg");
        }
    }
}

#[test]
fn other_hips_and_joints_on_markers_are_off_by_what_is_told() {
    let Some(folder) = captured::captured("mocap/c3d/pig") else { return };
    for (title, hips) in [("Bell", HipBy::Bell), ("Harrington", HipBy::Harrington)] {
        let rows = compared(&folder, &FitSettings { hips, ..FitSettings::default() });
        table(&format!("joints moved inwards, hip by {title}"), &rows);
    }
    let joints = JointsAt::EachFrame;
    let rows = compared(&folder, &FitSettings { joints, ..FitSettings::default() });
    table("joints moved inwards in each frame anew", &rows);
    for (name, off) in &rows {
        assert!(off.joints_mm.iter().all(|mm| *mm <= 3.0), "{name}: {:?} mm", off.joints_mm);
    }
    let joints = JointsAt::Markers;
    let rows = compared(&folder, &FitSettings { joints, ..FitSettings::default() });
    table("joints on markers", &rows);
    for (name, off) in &rows {
        // A marker is half a width and its own radius away from the joint under it.
        assert!((40.0..120.0).contains(&off.joints_mm[1]), "{name}: knee {}", off.joints_mm[1]);
        assert!((25.0..80.0).contains(&off.joints_mm[2]), "{name}: ankle {}", off.joints_mm[2]);
    }
}

/// Bell's regression (1990) on a level pelvis, by hand: the ASIS 0.24 m apart, 0.36, 0.22 and 0.30 of that outwards, backwards and
/// down.
#[test]
fn a_hip_by_bell_is_where_its_numbers_put_it_by_hand() {
    use gaitway::mocap::fit::centres::{Measures, Side, hip, pelvis};
    let mut seen = [None; gaitway::mocap::fit::marker_set::PLACES];
    // X right, Y up, Z forward in the example: Z, -X, Y here.
    let here = |right: f64, up: f64, forward: f64| DVec3::new(forward, -right, up);
    seen[MarkerPlace::RASI as usize] = Some(here(0.12, 1.0, 0.1));
    seen[MarkerPlace::LASI as usize] = Some(here(-0.12, 1.0, 0.1));
    seen[MarkerPlace::SACR as usize] = Some(here(0.0, 1.0, -0.1));
    let on = pelvis(&seen).expect("a pelvis");
    let at = |side| on.world(hip(&seen, side, &Measures::default(), HipBy::Bell).expect("a hip"));
    for (side, sign) in [(Side::Right, 1.0), (Side::Left, -1.0)] {
        let by_hand = here(sign * 0.0864, 0.9280, 0.0472);
        assert!(at(side).distance(by_hand) < 1e-9, "{side:?}: {} {by_hand}", at(side));
    }
}

/// Plug-in Gait's own rule, without our constant lengths: the stored joints of every frame, to the rounding of 32 bits.
#[test]
fn the_rules_of_plug_in_gait_give_its_stored_joints_in_every_frame() {
    use gaitway::mocap::fit::centres::{
        Measures, Side, ankle, elbow, elbow_out, hip, knee, pelvis, shoulder, thorax, wrist,
    };
    use gaitway::mocap::fit::marker_set::{Labelled, MarkerSet};
    let Some(folder) = captured::captured("mocap/c3d/pig") else { return };
    for (name, _, radius_m) in TRIALS {
        let trial = c3d::read(&folder.join(name)).expect("read");
        let labelled = Labelled::find(trial.head(), &MarkerSet::shipped(), None).expect("a set");
        let bones = GaitBones::of(trial.head(), "").expect("stored bones");
        let mut notes = Vec::new();
        let first = labelled.seen(&trial, trial.head().frames / 2);
        let measures = Measures::of(&[trial.head()], &first, radius_m, &mut notes);
        assert_eq!(notes, Vec::<String>::new(), "{name}: all widths are in the file");
        let mut frame = Frame::default();
        let (mut worst, mut compared) = (0.0_f64, 0);
        for n in 0..trial.head().frames {
            trial.frame(n, &mut frame);
            let seen = labelled.seen(&trial, n);
            let truth = |joint: Joint| bones.joint_m(&frame.points, joint);
            for side in Side::BOTH {
                let mut check = |left: Joint, right: Joint, found: Option<DVec3>| {
                    if let Some((a, b)) = truth(side.of(left, right)).zip(found) {
                        worst = worst.max(a.distance(b));
                        compared += 1;
                    }
                };
                let Some(basin) = pelvis(&seen) else { continue };
                let hip_m = hip(&seen, side, &measures, HipBy::PlugInGait).map(|p| basin.world(p));
                check(Joint::LeftHip, Joint::RightHip, hip_m);
                let knee_m = knee(&seen, side, hip_m.expect("a hip"), &measures);
                check(Joint::LeftKnee, Joint::RightKnee, knee_m);
                let ankle_m = knee_m.and_then(|knee_m| ankle(&seen, side, knee_m, &measures));
                check(Joint::LeftAnkle, Joint::RightAnkle, ankle_m);
                let Some(trunk) = thorax(&seen, radius_m) else { continue };
                let Some(shoulder_m) = shoulder(&seen, side, &trunk, &measures) else { continue };
                check(Joint::LeftShoulder, Joint::RightShoulder, Some(shoulder_m));
                let out = elbow_out(&seen, side, shoulder_m);
                let elbow_m = out.and_then(|out| elbow(&seen, side, shoulder_m, out, &measures));
                let Some(elbow_m) = elbow_m else { continue };
                check(Joint::LeftElbow, Joint::RightElbow, Some(elbow_m));
                let wrist_m = wrist(&seen, side, elbow_m, &measures);
                check(Joint::LeftWrist, Joint::RightWrist, wrist_m);
            }
        }
        aloud!(
            "{name}: {compared} joints by Plug-in Gait's rules, at most {:.3} mm off",
            worst * 1e3
        );
        assert!(compared > 900 && worst < 3e-3, "{name}: {compared} joints, {worst} m");
    }
}

/// Every marker of a body that stands, m: a person of 1.75 m with the arms bent, who faces +X.
fn standing() -> Vec<(&'static str, [f64; 3])> {
    let mut all = vec![("C7", [-0.06, 0.0, 1.48]), ("T10", [-0.10, 0.0, 1.22])];
    all.extend([("CLAV", [0.06, 0.0, 1.42]), ("STRN", [0.10, 0.0, 1.26])]);
    all.push(("RBAK", [-0.09, -0.09, 1.34]));
    let sides = [
        ("LFHD", "RFHD", [0.10, 0.07, 1.68]),
        ("LBHD", "RBHD", [-0.08, 0.07, 1.69]),
        ("LSHO", "RSHO", [0.0, 0.18, 1.47]),
        ("LELB", "RELB", [-0.02, 0.24, 1.13]),
        ("LWRA", "RWRA", [0.24, 0.19, 1.16]),
        ("LWRB", "RWRB", [0.24, 0.25, 1.12]),
        ("LASI", "RASI", [0.10, 0.12, 1.0]),
        ("LPSI", "RPSI", [-0.10, 0.05, 1.02]),
        ("LTHI", "RTHI", [0.0, 0.19, 0.75]),
        ("LKNE", "RKNE", [0.0, 0.15, 0.50]),
        ("LTIB", "RTIB", [0.0, 0.17, 0.30]),
        ("LANK", "RANK", [0.0, 0.13, 0.08]),
        ("LHEE", "RHEE", [-0.07, 0.09, 0.04]),
        ("LTOE", "RTOE", [0.14, 0.10, 0.04]),
    ];
    for (left, right, [x, y, z]) in sides {
        all.extend([(left, [x, y, z]), (right, [x, -y, z])]);
    }
    all
}

fn head(labels: &[String], frames: usize) -> Head {
    let mut head = Head::new(MarkerFormat::C3d);
    head.unit = "mm".to_owned();
    head.frames = frames;
    head.set_rate(100.0);
    let point = |label: &String| MarkerPoint {
        label: label.clone(),
        description: String::new(),
        kind: PointKind::Marker,
        unit: "mm".to_owned(),
    };
    head.points = labels.iter().map(point).collect();
    head
}

/// Markers of a body in motion: `moved` says where a marker of the standing body is in a frame, if it is seen.
fn markers(
    rename: impl Fn(&str) -> String,
    frames: usize,
    moved: impl Fn(&str, DVec3, usize) -> Option<DVec3>,
) -> Markers {
    let standing = standing();
    let labels: Vec<String> = standing.iter().map(|(label, _)| rename(label)).collect();
    let mut all = Markers::with_room(head(&labels, frames)).expect("room");
    for frame in 0..frames {
        let points = standing.iter().map(|(label, place)| {
            let place = moved(label, DVec3::from_array(*place), frame)? * 1e3;
            let position = place.to_array().map(|number| number as f32);
            Some(PointSample { position, residual: 0.0, cameras: 0 })
        });
        all.push(&Frame { points: points.collect(), analog: Vec::new() });
    }
    all
}

fn named(label: &str) -> String {
    label.to_owned()
}

/// Where the body is in a frame: it walks a circle and leans forward by up to 20 degrees, as one piece.
fn carried(frame: usize) -> (DQuat, DVec3) {
    let time = frame as f64 / 100.0;
    let lean = DQuat::from_rotation_y(0.35 * (1.0 - (2.0 * time).cos()) / 2.0);
    (DQuat::from_rotation_z(0.8 * time) * lean, DVec3::new(time, 0.2 * time * time, 0.0))
}

fn in_one_piece(_: &str, place: DVec3, frame: usize) -> Option<DVec3> {
    let (turn, shift) = carried(frame);
    Some(turn * place + shift)
}

/// The turn of each segment since the first frame, against the truth; the worst, rad.
fn worst_turn(fitted: &Fitted, truth: impl Fn(Segment, usize) -> DQuat) -> f64 {
    let mut worst = 0.0_f64;
    for (frame, pose) in fitted.poses.iter().enumerate() {
        for segment in Segment::ALL {
            let at = segment.index();
            let since = pose.orientation[at] * fitted.poses[0].orientation[at].inverse();
            let expected = truth(segment, frame) * truth(segment, 0).inverse();
            worst = worst.max(since.angle_between(expected));
        }
    }
    worst
}

fn stands() -> Markers {
    markers(named, 60, |_, place, _| Some(place))
}

#[test]
fn a_body_that_moves_as_one_piece_is_fitted_exactly_with_bones_of_constant_length() {
    let trial = markers(named, 300, in_one_piece);
    let fitted = fit(Some(&stands()), &trial, &FitSettings::default()).expect("fitted");
    assert!(worst_turn(&fitted, |_, frame| carried(frame).0) < 1e-5);
    assert_eq!(fitted.tracked, [true; 13]);
    assert_eq!(fitted.unseen, []);
    for marker in &fitted.markers {
        assert!(marker.worst_m < 1e-5 && marker.missing == 0, "{marker:?}");
    }
    for (segment, length_m) in &fitted.lengths_m {
        let (from, to) = match segment {
            Segment::LeftThigh => (Joint::LeftHip, Joint::LeftKnee),
            Segment::RightShank => (Joint::RightKnee, Joint::RightAnkle),
            Segment::LeftUpperArm => (Joint::LeftShoulder, Joint::LeftElbow),
            _ => continue,
        };
        for joints in &fitted.joints_m {
            let ends = [from, to].map(|joint| joints[joint.index()].expect("found"));
            let found_m = ends[0].distance(ends[1]);
            assert!((found_m - length_m).abs() < 2e-6, "{segment:?}: {found_m} m");
        }
    }
}

fn bend(frame: usize) -> DQuat {
    DQuat::from_rotation_y(1.2 * (frame as f64 / 40.0).sin().powi(2))
}

fn kicked(knee: DVec3, label: &str, place: DVec3, frame: usize) -> DVec3 {
    let is_below = ["LTIB", "LANK", "LHEE", "LTOE"].contains(&label);
    if is_below { knee + bend(frame) * (place - knee) } else { place }
}

/// The left leg kicks about its knee: the shank and the foot turn about an axis along Y through the knee joint.
#[test]
fn a_knee_that_bends_is_seen_to_bend_by_as_much() {
    let still = fit(Some(&stands()), &stands(), &FitSettings::default()).expect("fitted");
    let knee = still.joints_m[0][Joint::LeftKnee.index()].expect("a knee");
    let trial = markers(named, 200, |label, place, frame| Some(kicked(knee, label, place, frame)));
    let fitted = fit(Some(&stands()), &trial, &FitSettings::default()).expect("fitted");
    let truth = |segment: Segment, frame: usize| match segment {
        Segment::LeftShank | Segment::LeftFoot => bend(frame),
        _ => DQuat::IDENTITY,
    };
    let worst = worst_turn(&fitted, truth);
    // 70 degrees of bend; the marker of this knee sits a centimetre beside its axis.
    assert!(worst < 0.06, "{worst} rad");
    let heights: Vec<f64> =
        fitted.joints_m.iter().map(|j| j[Joint::LeftKnee.index()].expect("a knee").z).collect();
    assert!(heights.iter().all(|z| (z - heights[0]).abs() < 1e-4));
}

/// Noise of 2 mm on each axis, and every fourth marker gone for a while: the turn stays within what such noise makes of a
/// segment with markers 5 to 15 cm apart.
#[test]
fn noise_and_missing_markers_cost_a_little_accuracy_and_nothing_else() {
    let noise = |label: &str, frame: usize, axis: u64| {
        let mut hash = 0xcbf2_9ce4_8422_2325_u64 ^ axis;
        for byte in label.bytes().chain((frame as u32).to_le_bytes()) {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
        hash ^= hash >> 29;
        ((hash.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 11) as f64 / (1_u64 << 53) as f64 - 0.5)
            * 0.007
    };
    let gone = ["LPSI", "T10", "RFHD", "LTHI", "RANK"];
    let trial = markers(named, 200, |label, place, frame| {
        let place = in_one_piece(label, place, frame)?;
        let off =
            DVec3::new(noise(label, frame, 1), noise(label, frame, 2), noise(label, frame, 3));
        let is_gone = gone.contains(&label) && (80..120).contains(&frame);
        (!is_gone).then_some(place + off)
    });
    let fitted = fit(Some(&stands()), &trial, &FitSettings::default()).expect("fitted");
    assert_eq!(fitted.unseen, [], "other markers bridge them");
    let (mut sum, mut count) = (0.0, 0.0);
    for (frame, pose) in fitted.poses.iter().enumerate() {
        for segment in [Segment::Pelvis, Segment::Torso, Segment::Head, Segment::LeftThigh] {
            let at = segment.index();
            let axis = pose.orientation[at] * DVec3::Z;
            let still = carried(frame).0 * DVec3::Z;
            let tilt = if segment == Segment::LeftThigh { 0.0 } else { axis.angle_between(still) };
            sum += tilt.to_degrees().powi(2);
            count += 1.0;
        }
    }
    let rms: f64 = (sum / count).sqrt();
    aloud!("2 mm of noise and gaps of 0.4 s: long axes {rms:.2} deg rms off");
    assert!(rms < 2.0, "{rms} deg");
    let missing: usize = fitted.markers.iter().map(|marker| marker.missing).sum();
    assert_eq!(missing, gone.len() * 40);
}

#[test]
fn a_segment_without_any_marker_is_filled_in_and_told_of() {
    let foot = ["LHEE", "LTOE"];
    let trial = markers(named, 100, |label, place, frame| {
        let is_gone = foot.contains(&label) && (40..60).contains(&frame);
        (!is_gone).then(|| in_one_piece(label, place, frame)).flatten()
    });
    let fitted = fit(Some(&stands()), &trial, &FitSettings::default()).expect("fitted");
    let told: Vec<_> = fitted.unseen.iter().map(|gap| (gap.segment, gap.from, gap.to)).collect();
    assert_eq!(told, [(Segment::LeftFoot, 40, 60)]);
    assert!(worst_turn(&fitted, |_, frame| carried(frame).0) < 0.01);
}

#[test]
fn a_trial_without_a_static_one_calibrates_itself_where_it_is_quietest_and_says_so() {
    let trial = markers(named, 300, |label, place, frame| {
        in_one_piece(label, place, frame.saturating_sub(100))
    });
    let fitted = fit(None, &trial, &FitSettings::default()).expect("fitted");
    assert!(fitted.notes.iter().any(|note| note.contains("calibrates itself")));
    assert!(
        fitted.notes.iter().any(|note| note.contains("calibrated from 0.0")),
        "{:?}",
        fitted.notes
    );
    assert!(worst_turn(&fitted, |_, f| carried(f.saturating_sub(100)).0) < 1e-5);
}

#[test]
fn other_names_prefixes_and_another_axis_up_make_no_difference() {
    let cmu = |label: &str| {
        let known = match label {
            "LASI" => "LFWT",
            "RASI" => "RFWT",
            "LPSI" => "LBWT",
            "RPSI" => "RBWT",
            "LTIB" => "LSHN",
            "RTIB" => "RSHN",
            // The set is told by its fifth metatarsals; the trunk does without the lower back marker.
            "RBAK" => "LMT5",
            "RFHD" => "RMT5",
            other => other,
        };
        format!("Daniel:{known}")
    };
    // X to the right, Y up, Z backwards.
    let y_up = |place: DVec3| DVec3::new(-place.y, place.z, -place.x);
    let feet = |label: &str, place: DVec3| match label {
        "RBAK" => DVec3::new(0.10, 0.15, 0.04),
        "RFHD" => DVec3::new(0.10, -0.15, 0.04),
        _ => place,
    };
    let trial = markers(cmu, 100, |label, place, frame| {
        in_one_piece(label, feet(label, place), frame).map(y_up)
    });
    let stands = markers(cmu, 60, |label, place, _| Some(y_up(feet(label, place))));
    let fitted = fit(Some(&stands), &trial, &FitSettings::default()).expect("fitted");
    assert_eq!(
        (fitted.labelled.set.name.as_str(), fitted.labelled.subject.as_str()),
        ("cmu-41", "Daniel")
    );
    let plain =
        fit(Some(&self::stands()), &markers(named, 100, in_one_piece), &FitSettings::default());
    let plain = plain.expect("fitted").capture();
    for (a, b) in fitted.capture().poses.iter().zip(&plain.poses) {
        assert!((a.root_m - b.root_m).length() < 1e-4, "{} {}", a.root_m, b.root_m);
        let thigh = Segment::LeftThigh.index();
        assert!(a.orientation[thigh].angle_between(b.orientation[thigh]) < 1e-3);
    }
}

#[test]
fn what_matches_no_set_is_refused_with_what_was_found_and_what_is_lacking() {
    let nothing = markers(|label| format!("x{label}"), 60, |_, place, _| Some(place));
    let refused = fit(None, &nothing, &FitSettings::default()).expect_err("no set").to_string();
    assert!(refused.contains("xC7") && refused.contains("plug-in-gait (lacks LASI"), "{refused}");
    let wanted = FitSettings { subject: Some("Eve".to_owned()), ..FitSettings::default() };
    let refused = fit(None, &stands(), &wanted).expect_err("no Eve").to_string();
    assert!(refused.contains("--subject"), "{refused}");
}

#[test]
fn two_subjects_are_asked_for_by_name_and_legs_alone_are_fitted_as_legs() {
    let two = |label: &str| match label.starts_with('L') {
        true => format!("A:{label}"),
        false => format!("B:{label}"),
    };
    // Neither half is a person.
    assert!(fit(None, &markers(two, 60, |_, p, _| Some(p)), &FitSettings::default()).is_err());
    let lower = |label: &str| match label {
        "LASI" | "RASI" | "LPSI" | "RPSI" | "LTHI" | "RTHI" | "LKNE" | "RKNE" | "LTIB" | "RTIB"
        | "LANK" | "RANK" | "LHEE" | "RHEE" | "LTOE" | "RTOE" => label.to_owned(),
        _ => format!("*{label}"),
    };
    let fitted = fit(None, &markers(lower, 100, in_one_piece), &FitSettings::default());
    let fitted = fitted.expect("fitted");
    assert_eq!(fitted.labelled.set.name, "plug-in-gait-lower");
    assert!(!fitted.tracked[Segment::Torso.index()] && fitted.tracked[Segment::LeftFoot.index()]);
    assert!(fitted.notes.iter().any(|note| note.contains("torso has too few markers")));
}

fn c3d_of(folder: &Path, name: &str, markers: &Markers) -> String {
    let mut bytes = Vec::new();
    c3d::write::write(&mut bytes, &mut FramesOf::new(markers)).expect("written");
    let file = folder.join(name);
    std::fs::write(&file, bytes).expect("a file");
    file.to_str().expect("a path").to_owned()
}

#[test]
fn the_command_writes_a_skeleton_angles_and_segments_and_markers_go_on_to_a_robot() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("fit-command");
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("a folder");
    let still = fit(Some(&stands()), &stands(), &FitSettings::default()).expect("fitted");
    let knee = still.joints_m[0][Joint::LeftKnee.index()].expect("a knee");
    let kicks = markers(named, 200, |label, place, frame| Some(kicked(knee, label, place, frame)));
    let trial = c3d_of(&folder, "trial.c3d", &kicks);
    let stands = c3d_of(&folder, "stands.c3d", &stands());
    let path = |name: &str| folder.join(name).to_str().expect("a path").to_owned();
    let run = |arguments: &[&str]| {
        let done = program::gaitway().args(arguments).output().expect("it runs");
        let said = String::from_utf8_lossy(&done.stderr).into_owned();
        assert_eq!(done.status.code(), Some(0), "{arguments:?}: {said}");
        String::from_utf8(done.stdout).expect("text")
    };
    let told = run(&["fit", &trial, "--static", &stands, "-o", &path("out"), "--json"]);
    let report: serde_json::Value = serde_json::from_str(&told).expect("JSON");
    assert_eq!(report["outcome"], "done");
    assert_eq!(report["marker_set"], "plug-in-gait");
    let bones = report["bones"].as_array().expect("bones");
    assert_eq!(bones.len(), 13);
    assert!(bones.iter().all(|bone| bone["residual_m"].as_f64().expect("m") < 0.01), "{told}");
    let thigh = bones.iter().find(|bone| bone["name"] == "left_thigh").expect("a thigh");
    let length_m = thigh["length_m"].as_f64().expect("m");
    assert!(report["markers"][0]["residual_m"].as_f64().is_some());
    // The skeleton that was written has these bones, in cm, and opens as a capture.
    let text = std::fs::read_to_string(path("out/trial.bvh")).expect("a skeleton");
    let shank = text.split("JOINT LeftLeg").nth(1).expect("a shank").split("OFFSET").nth(1);
    let numbers = shank.expect("an offset").split_whitespace().take(3);
    let squares: f64 = numbers.map(|n| n.parse::<f64>().expect("a number").powi(2)).sum();
    assert!((squares.sqrt() / 100.0 - length_m).abs() < 1e-5);
    run(&["info", &path("out/trial.bvh")]);
    run(&["info", &path("out/trial.mot")]);
    let angles = std::fs::read_to_string(path("out/trial.csv")).expect("angles");
    assert_eq!(angles.lines().count(), 201);
    assert!(angles.starts_with("time_s,"));
    assert_eq!(angles.lines().next().expect("titles").split(',').count(), 1 + 22 + 3 + 3);
    let segments = std::fs::read_to_string(path("out/trial.segments.csv")).expect("segments");
    assert_eq!(segments.lines().next().expect("titles").split(',').count(), 4 + 4 * 13);
    let robot = ["--robot", "op3", "--static", &stands];
    let out = path("robot.csv");
    run(&[&["retarget", trial.as_str(), "-o", out.as_str()], &robot[..]].concat());
    run(&["convert", &trial, &path("model.bvh"), "--static", &stands]);
    run(&[
        "actionlets",
        &trial,
        "-o",
        &path("kick.toml"),
        "--static",
        &stands,
        "--tolerance",
        "10",
    ]);
    let play = ["play", trial.as_str(), "--bus", "sim", "--to", "1"];
    run(&[&play[..], &robot[..]].concat());
    // What is there is not written over.
    let again = program::gaitway().args(["fit", &trial, "-o", &path("out")]).output();
    assert_eq!(again.expect("it runs").status.code(), Some(1));
}

/// A star arc: from standing the left leg swings out and back in seven directions, as one piece about `hip_m`, by up to so
/// many degrees, while the body sways; 10 s.
fn star_arc(hip_m: DVec3, degrees: f64, noise_mm: f64, directions: usize) -> Markers {
    let mut dice = 0x9e37_79b9_7f4a_7c15_u64;
    let dice = std::cell::RefCell::new(move || {
        dice ^= dice << 13;
        dice ^= dice >> 7;
        dice ^= dice << 17;
        (dice >> 11) as f64 / (1_u64 << 53) as f64 * 2.0 - 1.0
    });
    markers(named, 1000, |label, place, frame| {
        let is_leg = ["LTHI", "LKNE", "LTIB", "LANK", "LHEE", "LTOE"].contains(&label);
        let time = frame as f64 / 1000.0 * directions as f64;
        let way = time.floor() / directions as f64 * std::f64::consts::PI;
        let swing = degrees.to_radians() * (time.fract() * std::f64::consts::TAU).sin();
        let turn = DQuat::from_axis_angle(DVec3::new(way.sin(), way.cos(), 0.0), swing);
        let place = if is_leg { hip_m + turn * (place - hip_m) } else { place };
        let (sway, shift) = carried(frame / 4);
        let one = || (dice.borrow_mut())() * noise_mm * 1e-3 * 3.0_f64.sqrt();
        Some(sway * place + shift + DVec3::new(one(), one(), one()))
    })
}

/// The hip of the standing body: beside the middle of the ASIS, behind and below it.
const TRUE_HIP: DVec3 = DVec3::new(0.045, 0.085, 0.925);

#[test]
fn a_hip_is_found_from_a_leg_that_swings_around_it() {
    use gaitway::mocap::fit::functional::hips;
    let seen = |name: &str| {
        let all = standing();
        DVec3::from_array(all.iter().find(|(label, _)| *label == name).expect("there").1)
    };
    // In the frame of the pelvis: its X from the PSIS to the ASIS, its Y to the left.
    let (front, back) = (seen("LASI").midpoint(seen("RASI")), seen("LPSI").midpoint(seen("RPSI")));
    let (x, y) = ((front - back).normalize(), DVec3::Y);
    let off = TRUE_HIP - front;
    let truth = DVec3::new(off.dot(x), off.dot(y), off.dot(x.cross(y)));
    for (noise_mm, degrees, most_mm) in [(0.0, 30.0, 0.01), (0.5, 30.0, 1.0), (1.0, 20.0, 3.0)] {
        let motion = star_arc(TRUE_HIP, degrees, noise_mm, 7);
        let found = hips(&motion, &FitSettings::default()).expect("a hip");
        let sides: Vec<_> = found.iter().map(|hip| format!("{:?}", hip.side)).collect();
        assert_eq!(sides, ["Left"], "the right leg stands still in the pelvis");
        let off_mm = found[0].centre_m.distance(truth) * 1e3;
        aloud!("star arc of {degrees} deg, {noise_mm} mm of noise: hip {off_mm:.2} mm off");
        assert!(off_mm < most_mm, "{noise_mm} mm of noise, {degrees} deg: {off_mm} mm off");
    }
}

#[test]
fn a_hip_is_not_guessed_from_a_leg_that_swings_in_one_plane_or_hardly() {
    use gaitway::mocap::fit::functional::hips;
    for (degrees, directions) in [(40.0, 1), (4.0, 7), (0.0, 7)] {
        let motion = star_arc(TRUE_HIP, degrees, 0.5, directions);
        let refused = hips(&motion, &FitSettings::default()).expect_err("no hip").to_string();
        assert!(refused.contains("sideways"), "{degrees} deg, {directions}: {refused}");
    }
}

#[test]
fn a_hip_that_motion_shows_is_where_the_thigh_hangs() {
    use gaitway::mocap::fit::functional::hips;
    let found = hips(&star_arc(TRUE_HIP, 30.0, 0.0, 7), &FitSettings::default()).expect("a hip");
    let settings =
        FitSettings { hips_m: [Some(found[0].centre_m), None], ..FitSettings::default() };
    let fitted = fit(Some(&stands()), &stands(), &settings).expect("fitted");
    let [left, right] =
        [Joint::LeftHip, Joint::RightHip].map(|hip| fitted.joints_m[0][hip.index()]);
    assert!(left.expect("a hip").distance(TRUE_HIP) < 1e-5, "{left:?}");
    let by_rule = fit(Some(&stands()), &stands(), &FitSettings::default()).expect("fitted");
    let other = by_rule.joints_m[0][Joint::RightHip.index()].expect("a hip");
    assert!(right.expect("a hip").distance(other) < 1e-9, "no trial showed the right one");
}

/// The names of OptiTrack for the markers of the standing body.
fn baseline(label: &str) -> String {
    let (side, place) = match label.split_at(1) {
        (side @ ("L" | "R"), place) => (side, place),
        _ => ("", label),
    };
    let other = match place {
        "C7" => "BackTop".to_owned(),
        "CLAV" => "Chest".to_owned(),
        "T10" => "BackLeft".to_owned(),
        "BAK" => "BackRight".to_owned(),
        "STRN" => "HeadTop".to_owned(),
        "BHD" => format!("{side}ShoulderBack"),
        "FHD" if side == "L" => "HeadSide".to_owned(),
        "FHD" => "HeadFront".to_owned(),
        "ASI" => format!("Waist{side}Front"),
        "PSI" => format!("Waist{side}Back"),
        "SHO" => format!("{side}ShoulderTop"),
        "ELB" => format!("{side}ElbowOut"),
        "WRA" => format!("{side}WristIn"),
        "WRB" => format!("{side}WristOut"),
        "THI" => format!("{side}Thigh"),
        "KNE" => format!("{side}KneeOut"),
        "TIB" => format!("{side}Shin"),
        "ANK" => format!("{side}AnkleOut"),
        "HEE" => format!("{side}Heel"),
        "TOE" => format!("{side}ToeIn"),
        place => place.to_owned(),
    };
    format!("Karlie_1:{other}")
}

#[test]
fn the_baseline_set_of_optitrack_is_fitted_with_trunk_and_head() {
    let put = |label: &str, place: DVec3| match label {
        "T10" => DVec3::new(-0.10, 0.08, 1.30),
        "RBAK" => DVec3::new(-0.10, -0.08, 1.30),
        "STRN" => DVec3::new(0.0, 0.0, 1.78),
        "LFHD" => DVec3::new(0.02, 0.08, 1.68),
        "RFHD" => DVec3::new(0.11, 0.0, 1.68),
        "LBHD" | "RBHD" => DVec3::new(-0.08, place.y * 2.0, 1.44),
        _ => place,
    };
    let stands = markers(baseline, 60, |label, place, _| Some(put(label, place)));
    let trial =
        markers(baseline, 200, |label, place, frame| in_one_piece(label, put(label, place), frame));
    let fitted = fit(Some(&stands), &trial, &FitSettings::default()).expect("fitted");
    assert_eq!(fitted.labelled.set.name, "baseline");
    assert_eq!(fitted.tracked, [true; 13]);
    assert!(worst_turn(&fitted, |_, frame| carried(frame).0) < 1e-5);
    // Upright and facing forward where it stands: all that stands out is how upper arms and forearms are held.
    let first = carried(0).0;
    for segment in [Segment::Pelvis, Segment::Torso, Segment::Head, Segment::LeftFoot] {
        let off = fitted.poses[0].orientation[segment.index()].angle_between(first);
        let most = if segment == Segment::LeftFoot { 0.1 } else { 1e-5 };
        assert!(off < most, "{segment:?}: {off} rad");
    }
}

/// Where the stored bones of Plug-in Gait have joints, by the bones that begin or end there.
const BEGINS: [(&str, [(&str, Joint); 2]); 6] = [
    ("hip", [("L_Upper_Leg", Joint::LeftHip), ("R_Upper_Leg", Joint::RightHip)]),
    ("knee", [("L_Lower_Leg", Joint::LeftKnee), ("R_Lower_Leg", Joint::RightKnee)]),
    ("ankle", [("L_Foot", Joint::LeftAnkle), ("R_Foot", Joint::RightAnkle)]),
    ("shoulder", [("L_Upper_Arm", Joint::LeftShoulder), ("R_Upper_Arm", Joint::RightShoulder)]),
    ("elbow", [("L_Lower_Arm", Joint::LeftElbow), ("R_Lower_Arm", Joint::RightElbow)]),
    ("wrist", [("L_Hand", Joint::LeftWrist), ("R_Hand", Joint::RightWrist)]),
];

#[test]
fn the_21_bones_are_where_plug_in_gait_has_joints() {
    let Some(folder) = captured::captured("mocap/c3d/pig") else { return };
    for joints in [JointsAt::Centres, JointsAt::Markers] {
        for (trial, stands, marker_radius_m) in TRIALS {
            let read = |name: &str| c3d::read(&folder.join(name)).expect("read");
            let (trial_of, stands) = (read(trial), read(stands));
            let settings = FitSettings { marker_radius_m, joints, ..FitSettings::default() };
            let fitted = fit_bones(Some(&stands), &trial_of, &settings).expect("fitted");
            assert_eq!(fitted.bones().len(), 21, "{:?}", fitted.notes);
            let stored = GaitBones::of(trial_of.head(), "").expect("stored bones");
            let mut frame = Frame::default();
            let mut off = vec![(0.0, 0.0, 0.0); BEGINS.len()];
            for number in 0..trial_of.head().frames {
                assert!(trial_of.frame(number, &mut frame));
                let points = fitted.points_m(number);
                let point = |name: &str| points.iter().find(|of| of.0 == name).expect("one").1;
                let truth = |joint| stored.joint_m(&frame.points, joint);
                for (at, (_, both)) in BEGINS.iter().enumerate() {
                    for (side, (name, joint)) in both.iter().enumerate() {
                        let Some(here) = truth(*joint) else { continue };
                        off[at].0 += here.distance_squared(point(name)) * 1e6;
                        off[at].1 += 1.0;
                        // The bone from this joint to the next one of the limb.
                        let Some((_, next)) = BEGINS.get(at + 1).filter(|_| at % 3 < 2) else {
                            continue;
                        };
                        let Some(there) = truth(next[side].1) else { continue };
                        let own = point(next[side].0) - point(name);
                        off[at].2 += own.angle_between(there - here).to_degrees().powi(2);
                    }
                }
            }
            let told: Vec<(f64, f64)> =
                off.iter().map(|of| ((of.0 / of.1).sqrt(), (of.2 / of.1).sqrt())).collect();
            let words = BEGINS
                .iter()
                .zip(&told)
                .map(|((name, _), (mm, deg))| format!("{name} {mm:.1} mm, its bone {deg:.2} deg"));
            aloud!("21 bones, {joints:?}, {trial}: {}", words.collect::<Vec<_>>().join("; "));
            if joints == JointsAt::Centres {
                // Stored shanks of the stairs are up to 100 mm shorter than while standing.
                let ankle_mm = if trial.starts_with("cgm_Movement") { 15.0 } else { 10.0 };
                for (at, most_mm) in [(0, 15.0), (1, 10.0), (2, ankle_mm)] {
                    assert!(told[at].0 <= most_mm, "{trial}: {} {} mm", BEGINS[at].0, told[at].0);
                }
                for at in [0, 1, 3, 4] {
                    assert!(told[at].1 <= 3.0, "{trial}: {} {} deg", BEGINS[at].0, told[at].1);
                }
            }
        }
    }
}

#[test]
fn the_21_bones_go_to_a_skeleton_and_to_virtual_markers_and_a_folder_is_fitted_by_one_static_trial()
{
    let folder = program::folder("bones");
    let still = fit(Some(&stands()), &stands(), &FitSettings::default()).expect("fitted");
    let knee = still.joints_m[0][Joint::LeftKnee.index()].expect("a knee");
    let frames = 60;
    let moving =
        markers(named, frames, |label, place, frame| Some(kicked(knee, label, place, frame)));
    std::fs::create_dir_all(folder.join("trials/more")).expect("a folder");
    c3d_of(&folder, "static.c3d", &stands());
    c3d_of(&folder.join("trials"), "kick.c3d", &moving);
    c3d_of(&folder.join("trials/more"), "stands.c3d", &stands());
    std::fs::write(folder.join("trials/broken.trc"), "no markers").expect("a file");
    let run = |arguments: &str| {
        let mut command = program::gaitway();
        command.current_dir(&folder).args(arguments.split_whitespace());
        command.output().expect("the command")
    };
    let one = run("fit trials/kick.c3d --static static.c3d --bones 21 -o kick.bvh --json");
    assert_eq!(one.status.code(), Some(0), "{}", program::words(&one));
    let report = program::json(&one);
    let bones = report["fine_bones"].as_array().expect("a list");
    assert!(bones.iter().any(|bone| bone["name"] == "L_Collar"), "{report:#}");
    let one = run("fit trials/kick.c3d --static static.c3d -o kick.c3d");
    assert_eq!(one.status.code(), Some(0), "{}", program::words(&one));
    // The joints of both files go the same way. What is below this knee, whose marker turns a centimetre beside its axis, is
    // where it was found in the virtual markers, and where bones of constant length put it in the skeleton.
    let bvh = gaitway::mocap::bvh::read(&folder.join("kick.bvh")).expect("a skeleton");
    let points = c3d::read(&folder.join("kick.c3d")).expect("virtual markers");
    assert_eq!((bvh.pose_count(), points.head().frames), (frames, frames));
    let at = |name: &str| points.head().points.iter().position(|of| of.label == name);
    let place = |name: &str, frame: usize| {
        let sample = points.sample(frame, at(name).expect("a point")).expect("seen");
        DVec3::from(sample.position.map(f64::from))
    };
    for frame in 0..frames {
        let numbers = bvh.pose(frame);
        let mut lies: Vec<(DQuat, DVec3)> = Vec::new();
        for joint in &bvh.joints {
            let own = &numbers[joint.first_channel..];
            let (moves, turns) = match joint.parent {
                None => (DVec3::new(own[0], own[1], own[2]), &own[3..6]),
                Some(_) => (DVec3::ZERO, &own[..3]),
            };
            let turn = DQuat::from_rotation_z(turns[0].to_radians())
                * DQuat::from_rotation_x(turns[1].to_radians())
                * DQuat::from_rotation_y(turns[2].to_radians());
            let (carrier, from) =
                joint.parent.map_or((DQuat::IDENTITY, DVec3::ZERO), |parent| lies[parent]);
            lies.push((carrier * turn, from + carrier * (joint.offset + moves)));
        }
        for (one, joint) in bvh.joints.iter().enumerate() {
            let other = (one + 5) % bvh.joints.len();
            let in_bvh = (lies[one].1 - lies[other].1).length() * 10.0;
            let in_c3d = place(&joint.name, frame).distance(place(&bvh.joints[other].name, frame));
            let is_below =
                |at: usize| ["L_Lower_Leg", "L_Foot"].contains(&bvh.joints[at].name.as_str());
            let most_mm = if is_below(one) || is_below(other) { 5.0 } else { 0.05 };
            assert!((in_bvh - in_c3d).abs() < most_mm, "{}: {in_bvh} {in_c3d} mm", joint.name);
        }
    }
    // A skeleton of 21 bones goes where captures go.
    let angles = |from: &str, to: &str| {
        let output = run(&format!("convert {from} {to}"));
        assert_eq!(output.status.code(), Some(0), "{}", program::words(&output));
        let text = std::fs::read_to_string(folder.join(to)).expect("a table");
        let title = text.lines().next().expect("titles").to_owned();
        let knee = title.split(',').position(|of| of == "left_knee_flexion_rad");
        let knee = knee.unwrap_or_else(|| panic!("{title}"));
        let cell = |row: &str| row.split(',').nth(knee).expect("a cell").parse::<f64>();
        text.lines().skip(1).map(|row| cell(row).expect("a number")).collect::<Vec<f64>>()
    };
    assert_eq!(run("fit trials/kick.c3d --static static.c3d -o plain.bvh").status.code(), Some(0));
    let (fine, plain) = (angles("kick.bvh", "fine.csv"), angles("plain.bvh", "plain.csv"));
    let bends = |of: &[f64]| of.iter().copied().fold(f64::MIN, f64::max) - of[0];
    assert!(bends(&plain) > 0.3, "{}", bends(&plain));
    assert!((bends(&fine) - bends(&plain)).abs() < 0.05, "{} {}", bends(&fine), bends(&plain));

    let all = run("fit trials --static static.c3d -o fitted --json");
    assert_eq!(all.status.code(), Some(3), "one is no trial: {}", program::words(&all));
    let report = program::json(&all);
    let trials = report["trials"].as_array().expect("a list");
    assert_eq!(trials.len(), 3, "{report:#}");
    assert!(trials[0]["error"].is_string() && trials[0]["report"].is_null(), "{report:#}");
    for file in ["kick/kick.bvh", "kick/kick.bones.c3d", "more/stands/stands.csv"] {
        assert!(folder.join("fitted").join(file).exists(), "{file}");
    }
    // Frames of bones: in the static trial Y goes from each virtual marker to the next, and X of both thighs the same way.
    let frames = std::fs::read_to_string(folder.join("fitted/more/stands/stands.bones.csv"))
        .expect("frames");
    let mut rows = frames.lines();
    let titles: Vec<&str> = rows.next().expect("titles").split(',').collect();
    assert!(titles.len() > 15 * 7 && titles.len() % 7 == 1, "{titles:?}");
    let row: Vec<f64> = rows
        .next()
        .expect("a row")
        .split(',')
        .map(|cell| cell.parse().expect("a number"))
        .collect();
    let of = |bone: &str| {
        let at = titles.iter().position(|title| *title == format!("{bone}_x_m")).expect(bone);
        let turn = DQuat::from_xyzw(row[at + 4], row[at + 5], row[at + 6], row[at + 3]);
        (DVec3::new(row[at], row[at + 1], row[at + 2]), turn)
    };
    for (bone, next) in
        [("L_Upper_Leg", "L_Lower_Leg"), ("R_Upper_Leg", "R_Lower_Leg"), ("Upper_Back", "Neck")]
    {
        let ((at, turn), (to, _)) = (of(bone), of(next));
        assert!((turn * DVec3::Y).angle_between(to - at) < 0.01, "{bone}");
    }
    let x = |bone: &str| of(bone).1 * DVec3::X;
    for bone in ["Upper_Leg", "Lower_Leg", "Foot", "Hip", "Collar"] {
        let (left, right) = (x(&format!("L_{bone}")), x(&format!("R_{bone}")));
        assert!(left.dot(right) > 0.0, "{bone}: {left} {right}");
    }
    // Neither these tables nor those of segments are markers.
    let found = run("clean fitted/more/stands --check --json");
    let found = program::json(&found)["trials"].clone();
    let names: Vec<&str> =
        found.as_array().expect("a list").iter().filter_map(|of| of["markers"].as_str()).collect();
    assert!(!names.iter().any(|name| name.ends_with(".csv")), "{names:?}");
    // Two trials by name, each into its own folder; of one name they are refused.
    let two = run("fit --static static.c3d trials/kick.c3d static.c3d -o two");
    assert_eq!(two.status.code(), Some(0), "{}", program::words(&two));
    assert!(
        folder.join("two/kick/kick.bvh").exists() && folder.join("two/static/static.bvh").exists()
    );
    let clash = run("fit --static static.c3d trials/kick.c3d trials -o clash");
    assert!(program::words(&clash).contains("into one folder"), "{}", program::words(&clash));
    let again = run("fit trials --static static.c3d -o fitted");
    assert_eq!(again.status.code(), Some(1), "nothing is written over");
}

#[test]
fn a_marker_is_carried_by_the_others_wherever_it_is_seen_itself() {
    let trial = markers(named, 40, in_one_piece);
    let settings = FitSettings::default();
    let labelled = Labelled::find(trial.head(), &settings.sets, None).expect("a set");
    let own = |frame| labelled.seen(&trial, frame);
    let body = MarkedBody::of(Some(&stands()), trial.head(), &own, &settings, &mut Vec::new());
    let body = body.expect("a body");
    // The elbow goes by both markers of the wrist: with one it is a little elsewhere.
    for (place, most_m) in [
        (MarkerPlace::LKNE, 1e-3),
        (MarkerPlace::RWRA, 1e-2),
        (MarkerPlace::C7, 1e-3),
        (MarkerPlace::LHEE, 1e-3),
    ] {
        let carried = body.carried(place, (0..40).map(own));
        let astray = (0..40).map(|frame| {
            let mut seen = own(frame);
            seen[place as usize] = seen[place as usize].map(|at| at + DVec3::splat(0.05));
            seen
        });
        assert_eq!(body.carried(place, astray), carried, "{place:?}");
        for (frame, at) in carried.into_iter().enumerate() {
            let off_m = at.expect("shown").distance(own(frame)[place as usize].expect("seen"));
            assert!(off_m < most_m, "{place:?} in frame {frame}: {off_m} m");
        }
    }
}
