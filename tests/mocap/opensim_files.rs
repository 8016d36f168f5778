//! OpenSim's tables: what is read of them, and that its joint angles are the same poses on this body.

use crate::program::{folder, gaitway, json, words};
use gaitway::body::{Dof, JointAngles, Segment};
use gaitway::mocap::opensim::{self, OpenSimCell};
use glam::{DMat3, DQuat, DVec3};
use std::fs;

const MOT: &str = include_str!("../../fuzz/seeds/marker_texts/walk.mot");
const STO: &str = include_str!("../../fuzz/seeds/marker_texts/turn.sto");

#[test]
fn a_table_is_read_as_it_stands() {
    let table = opensim::parse(MOT.as_bytes()).expect("read");
    assert_eq!((table.name.as_str(), table.in_degrees), ("Coordinates", Some(true)));
    assert_eq!(table.columns, ["hip_flexion_r", "knee_angle_r", "pelvis_ty", "mtp_angle_r"]);
    assert_eq!((table.rows(), table.rate_hz(), table.duration_s()), (3, Some(100.0), 0.02));
    assert_eq!(table.cell(2, 1), Some(&[-22.5][..]));
    assert_eq!((table.cell(3, 0), table.cell(0, 4)), (None, None));

    let table = opensim::parse(STO.as_bytes()).expect("read");
    assert_eq!((table.cell, table.in_degrees), (OpenSimCell::Quaternion, None));
    assert_eq!(table.cell(0, 1), Some(&[0.8, 0.6, 0.0, 0.0][..]));
    assert!(table.cell(1, 1).expect("a cell").iter().all(|number| number.is_nan()));

    // Four of a quaternion in the second of two columns; `info` says it.
    let said = table.not_numbers().expect("some are none");
    assert_eq!(said, "4 of 16 numbers are not finite, the first at 0.010 s in pelvis_imu");
    assert_eq!(opensim::parse(MOT.as_bytes()).expect("read").not_numbers(), None);
    let hole = MOT.replacen("-22.5", "nan", 1);
    let file = folder("hole").join("walk.mot");
    fs::write(&file, hole).expect("written");
    let told = gaitway().arg("info").arg(&file).output().expect("it runs");
    let told = words(&told);
    assert!(
        told.contains("1 of 12 numbers is not finite, the first at 0.020 s in knee_angle_r"),
        "{told}"
    );

    // The head of SIMM, which older files have.
    let old = "name walk\ndatacolumns 2\ndatarows 9\nrange 0 1\nendheader\n\ntime a\n0 1\n1 2\n";
    let table = opensim::parse(old.as_bytes()).expect("read");
    assert_eq!((table.name.as_str(), table.rows(), table.lost_rows), ("walk", 2, 7));
    assert!(table.notes[0].contains("says 9 rows, 2 are there"), "{:?}", table.notes);
}

#[test]
fn what_is_wrong_in_a_table_is_said_with_its_line() {
    for (from, to, said) in [
        ("endheader", "endhead", "its head does not end"),
        ("time", "zeit", "the first column is not time"),
        ("0.01", "x", "line 9"),
        ("0.02", "0.01", "time does not go on"),
        ("-21", "-21 1", "more cells"),
        ("0.951\t1", "0.951", "ends before its last column"),
        ("-21", "-21,1", "not what the head says"),
        ("version=1", "DataType=SpatialVec", "cells of this type are not read"),
    ] {
        let broken = MOT.replacen(from, to, 1);
        let refused = opensim::parse(broken.as_bytes()).expect_err(said).to_string();
        assert!(refused.contains(said), "{said}: {refused}");
    }
    for text in [MOT, STO] {
        for length in 0..text.len() {
            let _ = opensim::parse(&text.as_bytes()[..length]);
        }
    }
    let none = STO
        .replace("Quaternion", "double")
        .replace("1,0,0,0", "1")
        .replace("0.8,0.6,0,0", "1")
        .replace("nan,nan,nan,nan", "1");
    let refused = opensim::parse(none.as_bytes()).expect("read").body_angles().expect_err("none");
    assert!(refused.to_string().contains("torso_imu"), "{refused}");
}

/// A rotation about an axis of OpenSim's world.
fn about(axis: DVec3, degrees: f64) -> DMat3 {
    DMat3::from_axis_angle(axis, degrees.to_radians())
}

/// From OpenSim's X forward, Y up, Z right to X forward, Y left, Z up.
fn ours(v: DVec3) -> DVec3 {
    DVec3::new(v.x, -v.z, v.y)
}

#[test]
fn joint_angles_of_the_published_models_are_the_same_pose_on_this_body() {
    let titles = "pelvis_tilt pelvis_list pelvis_rotation hip_flexion_r hip_adduction_r hip_rotation_r \
                  knee_angle_r ankle_angle_r hip_flexion_l hip_adduction_l hip_rotation_l knee_angle_l \
                  lumbar_extension lumbar_bending lumbar_rotation arm_flex_r arm_add_r arm_rot_r \
                  arm_flex_l arm_add_l arm_rot_l elbow_flex_r";
    let angles: [f64; 22] = [
        5.0, -4.0, 30.0, 25.0, -12.0, 9.0, -40.0, 11.0, -15.0, 8.0, -6.0, -20.0, -14.0, 7.0, 18.0,
        50.0, -30.0, 20.0, -22.0, -17.0, 13.0, 65.0,
    ];
    let cells: Vec<String> = angles.iter().map(f64::to_string).collect();
    let cells = cells.join(" ");
    let text = format!("inDegrees=yes\nendheader\ntime {titles}\n0 {cells}\n0.01 {cells}\n");
    let body = opensim::parse(text.as_bytes()).expect("read").body_angles().expect("angles");
    let at = |title: &str| {
        let at = titles.split_whitespace().position(|one| one == title).expect("a column");
        angles[at]
    };
    let pose = body.angles[0].to_pose(DVec3::ZERO, body.pelvis[0]);
    // The joints of gait2392 and of Rajagopal's model, with their axes: the left ones mirrored.
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    let pelvis =
        about(z, at("pelvis_tilt")) * about(x, at("pelvis_list")) * about(y, at("pelvis_rotation"));
    let ball = |names: [&str; 3], side: f64| {
        about(z, at(names[0])) * about(side * x, at(names[1])) * about(side * y, at(names[2]))
    };
    let thigh_r = pelvis * ball(["hip_flexion_r", "hip_adduction_r", "hip_rotation_r"], 1.0);
    let thigh_l = pelvis * ball(["hip_flexion_l", "hip_adduction_l", "hip_rotation_l"], -1.0);
    let torso = pelvis * ball(["lumbar_extension", "lumbar_bending", "lumbar_rotation"], 1.0);
    let arm_r = torso * ball(["arm_flex_r", "arm_add_r", "arm_rot_r"], 1.0);
    // In gait2392 a knee that bends turns by a negative angle about Z.
    let shank_r = thigh_r * about(z, at("knee_angle_r"));
    for (segment, theirs) in [
        (Segment::Pelvis, pelvis),
        (Segment::RightThigh, thigh_r),
        (Segment::LeftThigh, thigh_l),
        (Segment::Torso, torso),
        (Segment::RightUpperArm, arm_r),
        (Segment::LeftUpperArm, torso * ball(["arm_flex_l", "arm_add_l", "arm_rot_l"], -1.0)),
        (Segment::RightShank, shank_r),
        (Segment::LeftShank, thigh_l * about(z, at("knee_angle_l"))),
        (Segment::RightFoot, shank_r * about(z, at("ankle_angle_r"))),
        (Segment::RightForearm, arm_r * about(z, at("elbow_flex_r"))),
    ] {
        for axis in [x, y, z] {
            let (theirs, found) =
                (ours(theirs * axis), pose.orientation[segment.index()] * ours(axis));
            assert!((theirs - found).length() < 1e-9, "{segment:?}: {theirs} {found}");
        }
    }
    assert!(body.notes.iter().any(|note| note.contains("knee_angle_r bends to negative")));
    assert_eq!(body.at_rest, [Dof::NeckFlexion, Dof::LeftElbowFlexion, Dof::LeftAnkleDorsiflexion]);

    // Rajagopal's model bends its knees to positive angles; the paths are those of OpenSim 4.
    let text = "inDegrees=no\nendheader\ntime /jointset/walker_knee_r/knee_angle_r/value \
                /jointset/walker_knee_r/knee_angle_r/speed\n0 0.5 1\n1 0.75 1\n2 0.5 1\n";
    let body = opensim::parse(text.as_bytes()).expect("read").body_angles().expect("angles");
    let knee: Vec<f64> = body.angles.iter().map(|angles| angles[Dof::RightKneeFlexion]).collect();
    assert_eq!((knee, body.rate_hz), (vec![0.5, 0.75, 0.5], 1.0));
}

/// Any angle within half a radian, of a number.
fn some(of: usize) -> f64 {
    0.5 * (of as f64 * 12.9898).sin()
}

#[test]
fn what_is_written_turns_the_joints_of_the_published_models_into_the_same_poses() {
    let rows: Vec<(JointAngles, DVec3, DQuat)> = (0..40)
        .map(|row| {
            let mut angles = JointAngles::default();
            for (at, dof) in Dof::ALL.into_iter().enumerate() {
                angles[dof] = some(40 * at + row);
            }
            for knee in [Dof::LeftKneeFlexion, Dof::RightKneeFlexion] {
                angles[knee] = angles[knee].abs();
            }
            // Once round and a half, leaning.
            let heading = DQuat::from_rotation_z(0.25 * row as f64);
            let place_m = DVec3::new(some(row), some(row + 1), 1.0 + some(row + 2));
            let lean =
                DQuat::from_rotation_x(some(row + 3)) * DQuat::from_rotation_y(some(row + 4));
            (angles, place_m, lean * heading)
        })
        .collect();
    let text = opensim::write("a\nwalk", 50.0, rows.iter().copied());
    assert!(text.starts_with("awalk\nversion=1\nnRows=40\nnColumns=28\ninDegrees=yes\n"), "{text}");
    let table = opensim::parse(text.as_bytes()).expect("read");
    assert_eq!((table.rows(), table.rate_hz(), table.lost_rows), (40, Some(50.0), 0));
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    let mut before = None;
    for (row, (angles, place_m, pelvis)) in rows.iter().enumerate() {
        let at = |title: &str| -> f64 {
            let column = table.columns.iter().position(|one| one == title).expect("a column");
            table.cell(row, column).expect("a cell")[0]
        };
        let theirs = DVec3::new(at("pelvis_tx"), at("pelvis_ty"), at("pelvis_tz"));
        assert!(ours(theirs).distance(*place_m) < 1e-7, "row {row}");
        let turned = before
            .replace(at("pelvis_rotation"))
            .map_or(0.0, |was: f64| (at("pelvis_rotation") - was).abs());
        assert!(turned < 90.0, "row {row}: the heading jumps by {turned} deg");
        let pose = angles.to_pose(DVec3::ZERO, *pelvis);
        let pelvis = about(z, at("pelvis_tilt"))
            * about(x, at("pelvis_list"))
            * about(y, at("pelvis_rotation"));
        let ball = |names: [&str; 3], side: f64| {
            about(z, at(names[0])) * about(side * x, at(names[1])) * about(side * y, at(names[2]))
        };
        let torso = pelvis * ball(["lumbar_extension", "lumbar_bending", "lumbar_rotation"], 1.0);
        let mut all = vec![(Segment::Pelvis, pelvis), (Segment::Torso, torso)];
        for (side, sign, segments) in [
            ("r", 1.0, [Segment::RightThigh, Segment::RightShank, Segment::RightFoot]),
            ("l", -1.0, [Segment::LeftThigh, Segment::LeftShank, Segment::LeftFoot]),
        ] {
            let name = |of: &str| format!("{of}_{side}");
            let names = ["hip_flexion", "hip_adduction", "hip_rotation"].map(name);
            let thigh = pelvis * ball(names.each_ref().map(String::as_str), sign);
            // Rajagopal's knees turn about -Z.
            let shank = thigh * about(-z, at(&name("knee_angle")));
            let foot = shank * about(z, at(&name("ankle_angle")));
            all.extend(segments.into_iter().zip([thigh, shank, foot]));
        }
        for (side, sign, segments) in [
            ("r", 1.0, [Segment::RightUpperArm, Segment::RightForearm]),
            ("l", -1.0, [Segment::LeftUpperArm, Segment::LeftForearm]),
        ] {
            let name = |of: &str| format!("{of}_{side}");
            let names = ["arm_flex", "arm_add", "arm_rot"].map(name);
            let upper = torso * ball(names.each_ref().map(String::as_str), sign);
            let fore = upper * about(z, at(&name("elbow_flex")));
            all.extend(segments.into_iter().zip([upper, fore]));
        }
        for (segment, theirs) in all {
            for axis in [x, y, z] {
                let found = pose.orientation[segment.index()] * ours(axis);
                let off = (ours(theirs * axis) - found).length();
                assert!(off < 1e-6, "row {row}, {segment:?}: {off}");
            }
        }
    }
}

#[test]
fn uneven_times_are_made_even_on_straight_lines() {
    let text = "endheader\ntime knee_angle_r\n0 0\n1 10\n4 40\n";
    let body = opensim::parse(text.as_bytes()).expect("read").body_angles().expect("angles");
    assert_eq!(body.rate_hz, 0.5);
    let knee = |at: usize| body.angles[at][Dof::RightKneeFlexion].to_degrees();
    assert!(
        (knee(0)).abs() < 1e-9 && (knee(1) - 20.0).abs() < 1e-9 && (knee(2) - 40.0).abs() < 1e-9
    );
}

/// Two steps of a walk as a table: hips and knees swing.
fn walk() -> String {
    let mut text = "Coordinates\nnRows=201\ninDegrees=yes\nendheader\n\
                    time\tpelvis_tx\tpelvis_ty\tpelvis_tz\thip_flexion_r\thip_flexion_l\tknee_angle_r\t\
                    knee_angle_l\tsubtalar_angle_r\n"
        .to_owned();
    for row in 0..=200 {
        let time_s = f64::from(row) / 100.0;
        let phase = (std::f64::consts::TAU * time_s).sin();
        let knee = -30.0 * (1.0 + phase) - 5.0;
        text += &format!(
            "{time_s}\t{}\t0.95\t0\t{}\t{}\t{knee}\t{}\t0\n",
            1.2 * time_s,
            20.0 * phase,
            -20.0 * phase,
            -30.0 * (1.0 - phase) - 5.0,
        );
    }
    text
}

#[test]
fn a_walk_goes_where_captures_go_and_info_tells_of_it() {
    let folder = folder("opensim");
    let place = |name: &str| folder.join(name).to_str().expect("a path").to_owned();
    fs::write(place("walk.mot"), walk()).expect("written");
    fs::write(place("turn.sto"), STO).expect("written");

    let told = gaitway().args(["info", &place("walk.mot"), "--json"]).output().expect("it runs");
    let report = json(&told);
    assert_eq!((&report["rows"], &report["rate_hz"]), (&201.into(), &100.0.into()));
    assert_eq!(report["body"].as_array().expect("a list").len(), 4);
    let told = gaitway().args(["info", &place("turn.sto")]).output().expect("it runs");
    assert!(words(&told).contains("cells of type Quaternion"), "{}", words(&told));

    for out in ["walk.csv", "walk.bvh", "walk.x3d"] {
        let done =
            gaitway().args(["convert", &place("walk.mot"), &place(out)]).output().expect("ran");
        let said = words(&done);
        assert!(done.status.success(), "{said}");
        assert!(said.contains("no such joint: subtalar_angle_r"), "{said}");
        assert!(said.contains("1.75 m is taken"), "{said}");
    }
    let table = fs::read_to_string(place("walk.csv")).expect("a table");
    let titles: Vec<&str> = table.lines().next().expect("titles").split(',').collect();
    let cell = |row: usize, title: &str| -> f64 {
        let at = titles.iter().position(|one| *one == title).expect("a column");
        table
            .lines()
            .nth(row + 1)
            .expect("a row")
            .split(',')
            .nth(at)
            .expect("a cell")
            .parse()
            .expect("a number")
    };
    assert!((cell(25, "right_knee_flexion_rad") - 65_f64.to_radians()).abs() < 1e-6);
    assert!((cell(25, "left_hip_flexion_rad") + 20_f64.to_radians()).abs() < 1e-6);
    assert!((cell(100, "root_x_m") - cell(0, "root_x_m") - 1.2).abs() < 1e-6);

    // Written again for OpenSim it is the same walk; its knees bend the other way.
    let done = gaitway().args(["convert", &place("walk.mot"), &place("again.mot")]).output();
    assert!(done.expect("ran").status.success());
    let read = |name: &str| opensim::read(&folder.join(name)).expect("a table");
    let (was, is) = (read("walk.mot"), read("again.mot"));
    assert_eq!((is.rows(), is.rate_hz()), (201, Some(100.0)));
    for (title, sign) in [("hip_flexion_r", 1.0), ("knee_angle_l", -1.0), ("knee_angle_r", -1.0)] {
        let column = |table: &opensim::OpenSimTable| {
            table.columns.iter().position(|one| one == title).expect("a column")
        };
        for row in 0..201 {
            let (was, is) = (was.cell(row, column(&was)), is.cell(row, column(&is)));
            let (was, is) = (was.expect("a cell")[0], is.expect("a cell")[0]);
            assert!((is - sign * was).abs() < 1e-4, "{title} in row {row}: {was}, then {is}");
        }
    }

    let out = place("walk-op3.csv");
    let retargeted = ["retarget", &place("walk.mot"), "--robot", "op3", "-o", &out];
    let done = gaitway().args(retargeted).output().expect("it runs");
    assert!(done.status.success(), "{}", words(&done));
    // Orientations are sensors, and become a table of them.
    let done =
        gaitway().args(["convert", &place("turn.sto"), &place("turn.csv")]).output().expect("ran");
    assert!(done.status.success(), "{}", words(&done));
    let turned = fs::read_to_string(place("turn.csv")).expect("a table");
    assert!(turned.lines().count() == 5 && turned.contains("torso_imu,0.000000,0.70"), "{turned}");
}
