//! Rules for bodies: links of the robot's own joints, with masses and shapes that something can have.

use super::super::{Verdict, finite, is_name, not_empty, positive, unique};
use crate::error::{Faults, ProfileError};
use crate::files;
use crate::schema::{
    BaseKind, Body, BodyBalance, BodyImu, BodyLink, BodyServos, CoupledJoint, Joint, Line, Robot,
    SignedAxis, Yielding,
};
use std::collections::BTreeSet;

/// How far the length of an axis or a quaternion may be from 1.
const UNIT_TOLERANCE: f64 = 1e-5;
/// How far below zero rounding may take a principal minor, as a share of what it is made of.
const ROUNDING: f64 = 1e-6;
/// Highest ID of a device of its own on a serial line.
const MOST_ID: u8 = 252;
/// Furthest that a joint is moved for balance, rad: what goes further is another motion.
const MOST_RAD: f64 = 0.3;
/// Share of a joint's limits that balance may keep for itself.
const MOST_SHARE: f64 = 0.5;
/// A joint that answers more than this shakes.
const MOST_GAIN: f64 = 5.0;

pub(super) fn body(file: &str, body: &Body, robot: &Robot, faults: &mut Faults) {
    for (key, text) in [
        ("body, source", &body.source),
        ("body, licence", &body.licence),
        ("body, shape_source", &body.shape_source),
    ] {
        faults.note(not_empty(file, key, text));
    }
    for joint in robot.joints.iter().filter(|joint| joint.origin_m.is_none()) {
        faults.note(Err(ProfileError::new(file, "a joint of a robot with a body has its place")
            .at(format!("joint {:?}", joint.name))
            .allowed("origin_m and axis")));
    }
    let driven: BTreeSet<&str> = robot.joints.iter().map(|joint| joint.name.as_str()).collect();
    let mut joints = driven.clone();
    for coupled in &body.coupled {
        faults.note(follower(file, coupled, &driven, &joints));
        joints.insert(&coupled.name);
    }
    let mut seen = BTreeSet::new();
    for link in &body.links {
        let place = place(link);
        if let Some(joint) = &link.joint
            && !joints.contains(joint.as_str())
        {
            faults.note(Err(ProfileError::new(file, "there is no such joint").at(place.clone())));
        }
        if !seen.insert(link.joint.as_deref()) {
            faults.note(Err(ProfileError::new(file, "a link stands once").at(place.clone())));
        }
        faults.note(weighs(file, link, &place));
        faults.note(takes_up(file, link, &place));
    }
    if let Some(servos) = &body.servos {
        give_way(file, servos, &driven, faults);
    }
    if let Some(of) = &body.imu {
        faults.note(imu(file, of, robot));
    }
    if let Some(of) = &body.balance {
        balance(file, of, body, &driven, faults);
    }
    if !body.links.iter().any(|link| link.mass_kg > 0.0) {
        faults.note(Err(ProfileError::new(file, "a body without mass is none").at("body, link")));
    }
}

fn give_way(file: &str, servos: &BodyServos, driven: &BTreeSet<&str>, faults: &mut Faults) {
    faults.note(not_empty(file, "body, servos, source", &servos.source));
    holds(file, "body, servos", servos.usual, faults);
    let mut seen = BTreeSet::new();
    for (at, other) in servos.others.iter().enumerate() {
        let place = format!("body, servos, other {}", at + 1);
        holds(file, &place, other.each, faults);
        let refuse = |what: &str| ProfileError::new(file, what).at(format!("{place}, joints"));
        if other.joints.is_empty() {
            faults.note(Err(refuse("it names no joint").allowed("one joint or more")));
        }
        for joint in &other.joints {
            if !driven.contains(joint.as_str()) {
                let known = driven.iter().copied().collect::<Vec<_>>().join(", ");
                faults.note(Err(refuse("the robot has no such joint").got(joint).allowed(known)));
            }
            if !seen.insert(joint) {
                faults.note(Err(refuse("this joint is named twice").got(joint)));
            }
        }
    }
}

/// The numbers of one servo.
fn holds(file: &str, place: &str, of: Yielding, faults: &mut Faults) {
    for (key, value) in [("stiffness_nm_rad", of.stiffness_nm_rad), ("torque_nm", of.torque_nm)] {
        faults.note(positive(file, || format!("{place}, {key}"), value));
    }
    for (key, value) in [
        ("damping_nm_s_rad", of.damping_nm_s_rad),
        ("armature_kg_m2", of.armature_kg_m2),
        ("friction_nm", of.friction_nm),
    ] {
        faults.note(finite(file, || format!("{place}, {key}"), value));
        if value < 0.0 {
            faults.note(Err(ProfileError::new(file, "a servo does not push itself")
                .at(format!("{place}, {key}"))
                .got(value)
                .allowed("0 or more")));
        }
    }
}

/// A board on one of the robot's serial lines, at an ID of its own and at the line's speed.
fn imu(file: &str, imu: &BodyImu, robot: &Robot) -> Verdict {
    let refuse =
        |what: &str, key: &str| ProfileError::new(file, what).at(format!("body, imu, {key}"));
    not_empty(file, "body, imu, source", &imu.source)?;
    let line = robot.lines.iter().find(|line| line.name == imu.line);
    let Some(baud_bps) = line.and_then(Line::baud_bps) else {
        return Err(refuse("the board hangs on no serial line of the robot", "line")
            .got(format!("{:?}", imu.line)));
    };
    let board = files::board(&imu.board)
        .map_err(|cause| refuse("the board's profile cannot be used", "board").got(cause))?;
    if !board.baud.iter().any(|baud| baud.bps == baud_bps) {
        return Err(refuse("the board does not know its line's speed", "board")
            .got(format!("{} on line {:?} at {baud_bps} bps", imu.board, imu.line)));
    }
    let taken = |joint: &&Joint| joint.line == imu.line && joint.id == imu.id;
    if let Some(joint) = robot.joints.iter().find(taken) {
        return Err(refuse("a joint of this line has the same ID", "id")
            .got(imu.id)
            .allowed(format!("another than that of joint {:?}", joint.name)));
    }
    if imu.id > MOST_ID {
        return Err(refuse("this is nobody's ID", "id")
            .got(imu.id)
            .allowed(format!("0..{MOST_ID}")));
    }
    let [x, y, z] = imu.axes.map(SignedAxis::unit);
    let cross =
        |axis: usize| x[(axis + 1) % 3] * y[(axis + 2) % 3] - x[(axis + 2) % 3] * y[(axis + 1) % 3];
    if (0..3).any(|axis| (cross(axis) - z[axis]).abs() > ROUNDING) {
        return Err(refuse("these are no axes that a sensor can be turned to", "axes")
            .got(format!("{:?}", imu.axes))
            .allowed("three different ones, right-handed as x, y, z are"));
    }
    Ok(())
}

/// What joints may do so that a robot stays upright is small, and leaves the motion its part.
fn balance(
    file: &str,
    balance: &BodyBalance,
    body: &Body,
    driven: &BTreeSet<&str>,
    faults: &mut Faults,
) {
    let refuse =
        |what: &str, key: &str| ProfileError::new(file, what).at(format!("body, balance, {key}"));
    faults.note(not_empty(file, "body, balance, source", &balance.source));
    for (key, value, most) in
        [("most_rad", balance.most_rad, MOST_RAD), ("limit_share", balance.limit_share, MOST_SHARE)]
    {
        if !(value > 0.0 && value <= most) {
            faults.note(Err(refuse("balance may not take so much", key)
                .got(value)
                .allowed(format!("above 0, at most {most}"))));
        }
    }
    faults.note(positive(file, || "body, balance, tilt_time_s".to_owned(), balance.tilt_time_s));
    if body.imu.is_none() {
        faults.note(Err(refuse("nobody feels a tilt without a sensor", "joint")
            .got("no [body.imu]")
            .remedy("name the board in [body.imu], or leave [body.balance] out")));
    }
    if body.base == BaseKind::Fixed {
        faults
            .note(Err(refuse("a base that is held cannot tilt", "joint").got("base = \"fixed\"")));
    }
    for joint in &balance.joints {
        if !driven.contains(joint.joint.as_str()) {
            faults.note(Err(
                refuse("there is no such joint", "joint").got(format!("{:?}", joint.joint))
            ));
        }
        for gain in [joint.roll, joint.roll_s, joint.pitch, joint.pitch_s] {
            if !(gain.abs() <= MOST_GAIN) {
                faults.note(Err(refuse("a joint is not to answer so much", "joint")
                    .got(format!("{gain} of joint {:?}", joint.joint))
                    .allowed(format!("-{MOST_GAIN}..{MOST_GAIN}"))));
            }
        }
    }
    let names = balance.joints.iter().map(|joint| &joint.joint);
    faults.note(unique(file, "joint", "body, balance, joint", names));
    if balance.joints.is_empty() {
        faults.note(Err(refuse("no joint answers", "joint").allowed("one or more")));
    }
}

fn place(link: &BodyLink) -> String {
    match &link.joint {
        Some(joint) => format!("body, link of joint {joint:?}"),
        None => "body, link of the base".to_owned(),
    }
}

fn all_finite(file: &str, place: &str, key: &str, values: &[f64]) -> Verdict {
    values.iter().try_for_each(|&value| finite(file, || format!("{place}, {key}"), value))
}

fn unit(file: &str, place: &str, key: &str, values: &[f64]) -> Verdict {
    let length = values.iter().map(|value| value * value).sum::<f64>().sqrt();
    if (length - 1.0).abs() <= UNIT_TOLERANCE {
        return Ok(());
    }
    Err(ProfileError::new(file, "this is not of unit length")
        .at(format!("{place}, {key}"))
        .got(length)
        .allowed(format!("1 within {UNIT_TOLERANCE}")))
}

fn follower(
    file: &str,
    coupled: &CoupledJoint,
    driven: &BTreeSet<&str>,
    joints: &BTreeSet<&str>,
) -> Verdict {
    let place = format!("body, coupled {:?}", coupled.name);
    let refuse = |what: &str| ProfileError::new(file, what).at(place.clone());
    if !is_name(&coupled.name, b'_') || joints.contains(coupled.name.as_str()) {
        return Err(refuse("this cannot be its name").allowed("[a-z0-9_]+, no other joint's"));
    }
    let strangers = coupled.of.iter().find(|of| !driven.contains(of.joint.as_str()));
    if let Some(of) = strangers {
        return Err(refuse("it follows no joint of the robot").got(format!("{:?}", of.joint)));
    }
    if coupled.of.is_empty() {
        return Err(refuse("it follows nothing").allowed("one joint or more"));
    }
    if let Some(parent) = &coupled.parent
        && !joints.contains(parent.as_str())
    {
        return Err(refuse("there is no such parent above it").got(format!("{parent:?}")));
    }
    let ratios: Vec<f64> = coupled.of.iter().map(|of| of.ratio).collect();
    all_finite(file, &place, "of", &ratios)?;
    all_finite(file, &place, "offset_rad", &[coupled.offset_rad])?;
    all_finite(file, &place, "origin_m", &coupled.origin_m)?;
    unit(file, &place, "axis", &coupled.axis)
}

/// A mass, and an inertia whose principal minors are not negative (Sylvester's criterion).
fn weighs(file: &str, link: &BodyLink, place: &str) -> Verdict {
    let refuse = |what: &str| ProfileError::new(file, what).at(place.to_owned());
    all_finite(file, place, "centre_m", &link.centre_m)?;
    all_finite(file, place, "inertia_kg_m2", &link.inertia_kg_m2)?;
    if !(link.mass_kg.is_finite() && link.mass_kg >= 0.0) {
        return Err(refuse("this cannot be a mass").got(link.mass_kg).allowed("0 or more"));
    }
    let [xx, yy, zz, xy, xz, yz] = link.inertia_kg_m2;
    let largest = link.inertia_kg_m2.iter().fold(0.0, |a: f64, b| a.max(b.abs()));
    let pairs = [(xx, yy, xy), (xx, zz, xz), (yy, zz, yz)];
    let minors =
        pairs.map(|(a, b, c)| (a * b - c * c) / (largest * largest).max(f64::MIN_POSITIVE));
    let whole = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz);
    let whole = whole / largest.powi(3).max(f64::MIN_POSITIVE);
    let single = [xx, yy, zz].map(|value| value / largest.max(f64::MIN_POSITIVE));
    let is_body = single.iter().chain(&minors).chain([&whole]).all(|minor| *minor >= -ROUNDING);
    if !is_body || link.mass_kg == 0.0 && largest > 0.0 {
        return Err(refuse("no body has this inertia")
            .got(format!("{:?}", link.inertia_kg_m2))
            .allowed("no negative moment about any axis; 0 without mass"));
    }
    Ok(())
}

fn takes_up(file: &str, link: &BodyLink, place: &str) -> Verdict {
    for capsule in &link.capsules {
        all_finite(file, place, "capsules", &[capsule.from_m, capsule.to_m].concat())?;
        positive(file, || format!("{place}, capsules, radius_m"), capsule.radius_m)?;
    }
    for of in &link.boxes {
        all_finite(file, place, "boxes", &of.centre_m)?;
        for half_m in of.half_m {
            positive(file, || format!("{place}, boxes, half_m"), half_m)?;
        }
        unit(file, place, "boxes, turn", &of.turn)?;
    }
    for of in &link.meshes {
        all_finite(file, place, "meshes, at_m", &of.at_m)?;
        all_finite(file, place, "meshes, scale", &of.scale)?;
        unit(file, place, "meshes, turn", &of.turn)?;
        if of.file.is_empty() || of.scale.contains(&0.0) {
            return Err(ProfileError::new(file, "a mesh has a file and a size")
                .at(format!("{place}, meshes"))
                .got(format!("file = {:?}, scale = {:?}", of.file, of.scale))
                .allowed("the path of an STL or OBJ file, and no scale of 0"));
        }
    }
    let Some(sole) = &link.sole_m else { return Ok(()) };
    all_finite(file, place, "sole_m", &sole.concat())?;
    if sole.len() < 3 {
        return Err(ProfileError::new(file, "a sole has corners")
            .at(format!("{place}, sole_m"))
            .got(sole.len())
            .allowed("3 or more"));
    }
    Ok(())
}
