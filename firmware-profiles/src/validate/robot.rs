//! Rules for robots: a tree of joints, each on a servo or actuator that can reach its limits.

mod body;
mod can;

use super::{Verdict, finite, is_name, not_empty, positive, unique, version_and_name};
use crate::error::{Faults, ProfileError};
use crate::files;
use crate::schema::{Anatomy, Joint, LineKind, Protocol, Robot, Role, Segment, Servo, Setup};
use std::collections::{BTreeMap, BTreeSet};

/// How far the length of an axis may be from 1.
const AXIS_TOLERANCE: f64 = 1e-6;
/// Slower, goals are too far apart to be watched; faster, no line here carries them.
const RATES_HZ: std::ops::RangeInclusive<f64> = 20.0..=1000.0;
/// Written when a motion begins, and by nothing but the checked motion itself.
const NOT_SET_UP: [Role; 6] = [
    Role::GoalPosition,
    Role::GoalVelocity,
    Role::GoalCurrent,
    Role::GoalPwm,
    Role::GoalTime,
    Role::TorqueEnable,
];

pub(crate) fn robot(file: &str, robot: &Robot) -> Verdict {
    let mut faults = Faults::default();
    faults.note(version_and_name(file, robot.schema, &robot.name));
    for (key, text) in [
        ("description", &robot.description),
        ("source", &robot.source),
        ("acceleration_source", &robot.acceleration_source),
    ] {
        faults.note(not_empty(file, key, text));
    }
    faults.note(rate(file, robot.rate_hz));
    for line in &robot.lines {
        faults.note(line_name(file, &line.name));
    }
    faults.note(unique(file, "line name", "line", robot.lines.iter().map(|line| &line.name)));
    faults.note(unique(file, "joint name", "joint", robot.joints.iter().map(|joint| &joint.name)));
    if robot.joints.is_empty() {
        faults.note(Err(ProfileError::new(file, "the robot has no joint").at("joint")));
    }
    let joints: BTreeMap<&str, &Joint> =
        robot.joints.iter().map(|joint| (joint.name.as_str(), joint)).collect();
    for setup in &robot.setups {
        faults.note(one_setup(file, setup, &joints));
    }
    let mut ids = BTreeSet::new();
    let mut earlier = BTreeSet::new();
    let mut on_can_are_sound = true;
    for joint in &robot.joints {
        let is_sound = numbers(file, joint, &mut faults);
        faults.note(parent(file, joint, &earlier, &joints));
        earlier.insert(joint.name.as_str());
        let on_can = robot.lines.iter().any(|l| l.name == joint.line && l.can().is_some());
        if !on_can && !ids.insert((joint.line.as_str(), joint.id)) {
            faults.note(Err(ProfileError::new(file, "two joints on a line have the same ID")
                .at(place(joint))
                .got(format!("ID {} on line {:?}", joint.id, joint.line))
                .allowed("each ID once on a line")));
        }
        let hangs_well = on_the_bus(file, robot, joint, is_sound, &mut faults);
        on_can_are_sound &= hangs_well && is_sound || !on_can;
        faults.note(shared_case(file, joint, &joints));
    }
    if on_can_are_sound {
        for line in robot.lines.iter().filter(|line| line.can().is_some()) {
            faults.note(can::line(file, robot, line));
        }
    }
    if let Some(of) = &robot.anatomy {
        anatomy(file, of, robot, &joints, &mut faults);
    }
    if let Some(of) = &robot.body {
        body::body(file, of, robot, &mut faults);
    }
    faults.verdict()
}

fn rate(file: &str, rate_hz: f64) -> Verdict {
    if RATES_HZ.contains(&rate_hz) {
        return Ok(());
    }
    Err(ProfileError::new(file, "the robot cannot be driven at this rate")
        .at("rate_hz")
        .got(rate_hz)
        .allowed(format!("{}..{}", RATES_HZ.start(), RATES_HZ.end())))
}

fn line_name(file: &str, name: &str) -> Verdict {
    if is_name(name, b'_') {
        return Ok(());
    }
    Err(ProfileError::new(file, "this cannot be the name of a line")
        .at("line")
        .got(format!("{name:?}"))
        .allowed("[a-z0-9_]+"))
}

fn one_setup(file: &str, setup: &Setup, joints: &BTreeMap<&str, &Joint>) -> Verdict {
    let place = format!("setup of {:?}", setup.servo);
    let servo = known_servo(file, &place, &setup.servo)?;
    not_empty(file, &format!("{place}, source"), &setup.source)?;
    let firmware = servo.firmware;
    if setup.firmware < firmware.min || firmware.max.is_some_and(|max| setup.firmware > max) {
        let highest = firmware.max.map_or(String::new(), |max| max.to_string());
        return Err(ProfileError::new(file, "the servo's profile is not for this firmware")
            .at(place)
            .got(setup.firmware)
            .allowed(format!("{}..{highest}", firmware.min)));
    }
    for (name, &raw) in &setup.registers {
        let Some(item) = servo.register_named(name) else {
            return Err(ProfileError::new(file, "the servo has no register of this name")
                .at(place)
                .got(format!("{name:?}"))
                .allowed(format!("a register name of {}", servo.name)));
        };
        if item.register.role.is_some_and(|role| NOT_SET_UP.contains(&role)) {
            return Err(ProfileError::new(file, "goals and torque are not set up in a file")
                .at(format!("{place}, {name}"))
                .remedy("leave it out: a motion writes it, checked"));
        }
        let (min, max) = item.register.range();
        if !(min..=max).contains(&raw) {
            return Err(ProfileError::new(file, "the register does not accept this value")
                .at(format!("{place}, {name}"))
                .got(raw)
                .allowed(format!("{min}..{max}")));
        }
    }
    for name in setup.joints.iter().flatten() {
        let of_this_servo = joints.get(name.as_str()).is_some_and(|j| j.servo == setup.servo);
        if !of_this_servo {
            return Err(ProfileError::new(file, "no joint of this name has this servo")
                .at(place)
                .got(format!("{name:?}")));
        }
    }
    Ok(())
}

/// What can be said of a joint's numbers without looking elsewhere; false if something is.
fn numbers(file: &str, joint: &Joint, faults: &mut Faults) -> bool {
    let before = faults.count();
    let refuse = |what: &str| ProfileError::new(file, what).at(place(joint));
    if !is_name(&joint.name, b'_') {
        faults.note(Err(refuse("this cannot be the name of a joint").allowed("[a-z0-9_]+")));
    }
    faults.note(positive(file, || format!("{}, gear", place(joint)), joint.gear));
    if joint.direction != 1 && joint.direction != -1 {
        let refusal = refuse("the direction is a sign").got(joint.direction).allowed("1 or -1");
        faults.note(Err(refusal));
    }
    for (key, value) in [
        ("offset_rad", joint.offset_rad),
        ("lower_rad", joint.lower_rad),
        ("upper_rad", joint.upper_rad),
        ("initial_rad", joint.initial.unwrap_or(0.0)),
    ] {
        faults.note(finite(file, || format!("{}, {key}", place(joint)), value));
    }
    for (key, value) in [
        ("velocity_rad_s", joint.velocity_rad_s),
        ("acceleration_rad_s2", joint.acceleration_rad_s2),
    ] {
        faults.note(positive(file, || format!("{}, {key}", place(joint)), value));
    }
    faults.note(range(file, joint));
    faults.note(mounting(file, joint));
    faults.count() == before
}

/// Limits in order, with the pose the robot starts in between them.
fn range(file: &str, joint: &Joint) -> Verdict {
    let refuse = |what: &str| ProfileError::new(file, what).at(place(joint));
    let (lower_rad, upper_rad) = (joint.lower_rad, joint.upper_rad);
    if !(lower_rad.is_finite() && upper_rad.is_finite()) {
        return Ok(());
    }
    if lower_rad >= upper_rad {
        return Err(refuse("the limits are upside down")
            .got(format!("lower_rad {lower_rad}, upper_rad {upper_rad}")));
    }
    let initial_rad = joint.initial_rad();
    if initial_rad.is_finite() && !(lower_rad..=upper_rad).contains(&initial_rad) {
        return Err(refuse("the joint would start outside its limits")
            .got(format!("initial_rad {initial_rad}"))
            .allowed(format!("{lower_rad}..{upper_rad}")));
    }
    Ok(())
}

/// Where the joint sits and what it turns about: both or neither.
fn mounting(file: &str, joint: &Joint) -> Verdict {
    let refuse = |what: &str| ProfileError::new(file, what).at(place(joint));
    let (origin_m, axis) = match (joint.origin_m, joint.axis) {
        (Some(origin_m), Some(axis)) => (origin_m, axis),
        (None, None) => return Ok(()),
        (origin_m, _) => {
            let (given, missing) =
                if origin_m.is_some() { ("origin_m", "axis") } else { ("axis", "origin_m") };
            return Err(refuse("where a joint sits and what it turns about go together")
                .got(format!("{given} without {missing}"))
                .allowed("origin_m and axis, or neither"));
        }
    };
    for value in origin_m {
        finite(file, || format!("{}, origin_m", place(joint)), value)?;
    }
    let length = axis.iter().map(|value| value * value).sum::<f64>().sqrt();
    let is_unit = (length - 1.0).abs() <= AXIS_TOLERANCE;
    if !is_unit {
        return Err(refuse("the axis is not of unit length")
            .got(format!("{axis:?}, length {length}"))
            .allowed(format!("length 1 within {AXIS_TOLERANCE}")));
    }
    Ok(())
}

/// The parent comes earlier in the file, so that there is no cycle and a single pass suffices.
fn parent(
    file: &str,
    joint: &Joint,
    earlier: &BTreeSet<&str>,
    joints: &BTreeMap<&str, &Joint>,
) -> Verdict {
    let Some(parent) = joint.parent.as_deref() else { return Ok(()) };
    let refuse = |what: &str| {
        ProfileError::new(file, what)
            .at(place(joint))
            .got(format!("parent {parent:?}"))
            .allowed("a joint that stands earlier in the file, or no parent for the base")
    };
    if earlier.contains(parent) {
        return Ok(());
    }
    let mut ancestor = Some(parent);
    for _ in 0..joints.len() {
        match ancestor.and_then(|name| joints.get(name)) {
            None => break,
            Some(found) if found.name == joint.name => {
                return Err(refuse("the joint is its own ancestor"));
            }
            Some(found) => ancestor = found.parent.as_deref(),
        }
    }
    if joints.contains_key(parent) {
        return Err(
            refuse("the parent stands later in the file").remedy("move the parent's [[joint]] up")
        );
    }
    Err(refuse("there is no such parent"))
}

/// What joint, line, servo and setup must be to one another; false if something is not. Numbers that are
/// wrong by themselves (`is_sound` is false) are not held against the servo as well.
fn on_the_bus(
    file: &str,
    robot: &Robot,
    joint: &Joint,
    is_sound: bool,
    faults: &mut Faults,
) -> bool {
    let refuse = |what: &str| ProfileError::new(file, what).at(place(joint));
    let Some(line) = robot.lines.iter().find(|line| line.name == joint.line) else {
        let names: Vec<_> = robot.lines.iter().map(|line| line.name.as_str()).collect();
        return faults.note(Err(refuse("there is no such line")
            .got(format!("{:?}", joint.line))
            .allowed(names.join(", "))));
    };
    let baud_bps = match line.kind {
        LineKind::Serial { baud_bps } => baud_bps,
        LineKind::Can(speed) => {
            return !is_sound || faults.note(can::joint(file, joint, line, speed));
        }
    };
    if files::actuator(&joint.servo).is_ok() {
        return faults.note(Err(refuse("a CAN actuator cannot hang on a serial line")
            .got(format!("{:?} on line {:?}", joint.servo, line.name))
            .allowed("a servo, or a line of kind = \"can\"")));
    }
    let before = faults.count();
    faults.note(can::not_on_serial(file, joint));
    let servo = match known_servo(file, &place(joint), &joint.servo) {
        Ok(servo) => servo,
        Err(unknown) => return faults.note(Err(unknown)),
    };
    if joint.id > servo.protocol.highest_id() {
        faults.note(Err(refuse("the protocol has no such ID")
            .got(joint.id)
            .allowed(format!("0..{}", servo.protocol.highest_id()))));
    }
    let fastest = servo.motor.no_load_speed_rad_s * joint.gear;
    if joint.velocity_rad_s > fastest {
        faults.note(Err(refuse("the joint may turn faster than its servo can")
            .got(format!("velocity_rad_s {}", joint.velocity_rad_s))
            .allowed(format!("at most {fastest}, {} without load", servo.model))));
    }
    let (_, registers) = robot.setup_for(joint);
    faults.note(line_speed(file, joint, baud_bps, servo, &registers));
    if is_sound {
        faults.note(reach(file, joint, servo, &registers));
    }
    faults.count() == before
}

fn line_speed(
    file: &str,
    joint: &Joint,
    baud_bps: u32,
    servo: &Servo,
    registers: &BTreeMap<String, i64>,
) -> Verdict {
    let Some(index) = servo.baud_index(baud_bps) else {
        let speeds: Vec<_> = servo.baud.iter().map(|baud| baud.bps.to_string()).collect();
        return Err(ProfileError::new(file, "a servo on this line cannot run at its speed")
            .at(format!("line {:?}, {}", joint.line, place(joint)))
            .got(baud_bps)
            .allowed(speeds.join(", ")));
    };
    let configured = configured(servo, Role::BaudRate, registers);
    if configured.is_some_and(|raw| raw != i64::from(index)) {
        return Err(ProfileError::new(file, "the setup's baud register is not the line's speed")
            .at(format!("line {:?}, {}", joint.line, place(joint)))
            .got(configured.unwrap_or_default())
            .allowed(format!("{index} for {} bps", baud_bps)));
    }
    Ok(())
}

/// Two joints in one case name each other and have the same servo on the same line.
fn shared_case(file: &str, joint: &Joint, joints: &BTreeMap<&str, &Joint>) -> Verdict {
    let Some(other) = joint.shares_case_with.as_deref() else { return Ok(()) };
    let is_pair = joints.get(other).is_some_and(|partner| {
        partner.name != joint.name
            && partner.shares_case_with.as_deref() == Some(joint.name.as_str())
            && (&partner.servo, &partner.line) == (&joint.servo, &joint.line)
    });
    if is_pair {
        return Ok(());
    }
    Err(ProfileError::new(file, "these joints cannot share a case")
        .at(place(joint))
        .got(format!("shares_case_with {other:?}"))
        .allowed("a joint with the same servo on the same line that names this one"))
}

/// Both limits must lie where the servo can be sent.
fn reach(file: &str, joint: &Joint, servo: &Servo, registers: &BTreeMap<String, i64>) -> Verdict {
    let mode = configured(servo, Role::OperatingMode, registers);
    // Dynamixel modes 4 and 5 turn more than once and do not look at the position limits.
    let many_turns = servo.protocol == Protocol::Dynamixel2 && matches!(mode, Some(4 | 5));
    let (lowest, highest) = if many_turns {
        servo.register(Role::GoalPosition).map_or((0, 0), |register| register.range())
    } else {
        (
            configured(servo, Role::MinPositionLimit, registers).unwrap_or(0),
            configured(servo, Role::MaxPositionLimit, registers)
                .unwrap_or(i64::from(servo.position.counts) - 1),
        )
    };
    for (key, angle) in [("lower_rad", joint.lower_rad), ("upper_rad", joint.upper_rad)] {
        let servo_angle = f64::from(joint.direction) * (angle + joint.offset_rad) / joint.gear;
        let count = (f64::from(servo.position.zero_count)
            + servo_angle / servo.radians_per_count())
        .round();
        if !(count >= lowest as f64 && count <= highest as f64) {
            return Err(ProfileError::new(file, "the servo cannot reach this limit")
                .at(format!("{}, {key}", place(joint)))
                .got(format!("{angle} rad, count {count}"))
                .allowed(format!("counts {lowest}..{highest}")));
        }
    }
    Ok(())
}

/// The raw value a register has in this robot: from the setup, else from the factory.
fn configured(servo: &Servo, role: Role, registers: &BTreeMap<String, i64>) -> Option<i64> {
    let register = servo.register(role)?;
    registers.get(&register.name).copied().or(register.initial)
}

/// A body is followed with every joint: each has its place.
fn anatomy(
    file: &str,
    anatomy: &Anatomy,
    robot: &Robot,
    joints: &BTreeMap<&str, &Joint>,
    faults: &mut Faults,
) {
    faults.note(not_empty(file, "anatomy.source", &anatomy.source));
    let unknown_joint = |place: &str, name: &str| {
        Err(ProfileError::new(file, "there is no such joint").at(place).got(format!("{name:?}")))
    };
    for (name, &angle) in &anatomy.n_pose_rad {
        faults.note(finite(file, || format!("anatomy.n_pose_rad, {name}"), angle));
        if !joints.contains_key(name.as_str()) {
            faults.note(unknown_joint("anatomy.n_pose_rad", name));
        }
    }
    let mut played = BTreeSet::new();
    for &segment in &anatomy.base {
        if matches!(segment, Segment::Pelvis | Segment::Torso) {
            faults.note(once(file, "anatomy.base", segment, &mut played));
        } else {
            faults.note(Err(ProfileError::new(file, "the base cannot play this segment")
                .at("anatomy.base")
                .got(format!("{segment:?}"))
                .allowed("pelvis, torso or both")));
        }
    }
    for link in &anatomy.segments {
        let place = format!("anatomy.segment {:?}", link.segment);
        faults.note(once(file, &place, link.segment, &mut played));
        if !joints.contains_key(link.joint.as_str()) {
            faults.note(unknown_joint(&place, &link.joint));
        }
        for (key, weight) in
            [("direction_weight", link.direction_weight), ("twist_weight", link.twist_weight)]
        {
            if !(weight.is_finite() && weight >= 0.0) {
                faults.note(Err(ProfileError::new(file, "a weight cannot be this")
                    .at(format!("{place}, {key}"))
                    .got(weight)
                    .allowed("a finite number, 0 or more")));
            }
        }
    }
    for joint in robot.joints.iter().filter(|j| j.origin_m.is_none() && j.axis.is_none()) {
        faults.note(Err(ProfileError::new(
            file,
            "a robot that follows a body says where its joints sit",
        )
        .at(place(joint))
        .got("neither origin_m nor axis")
        .remedy("give both, or leave [anatomy] out: tables, recordings and a hand need neither")));
    }
}

fn once(file: &str, place: &str, segment: Segment, played: &mut BTreeSet<Segment>) -> Verdict {
    if played.insert(segment) {
        return Ok(());
    }
    Err(ProfileError::new(file, "the segment is played twice")
        .at(place)
        .got(format!("{segment:?}"))
        .allowed("each segment once"))
}

fn known_servo(file: &str, place: &str, name: &str) -> Result<&'static Servo, ProfileError> {
    files::servo(name).map_err(|error| {
        let allowed = error.allowed.clone().unwrap_or_else(|| error.to_string().into());
        ProfileError::new(file, "there is no valid servo profile of this name")
            .at(place)
            .got(format!("{name:?}"))
            .allowed(allowed)
    })
}

fn place(joint: &Joint) -> String {
    format!("joint {:?}", joint.name)
}
