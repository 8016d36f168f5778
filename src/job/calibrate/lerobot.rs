//! Calibrations as LeRobot keeps them: JSON, for each motor its ID, its homing offset, and the range it was moved through, in
//! counts (huggingface/lerobot, `motors/motors_bus.py`, `MotorCalibration`). There the middle of the range is zero.

use super::measure::MARGIN_RAD;
use super::reading::Scale;
use super::{CalibrateReport, Files, JointMeasured, finish};
use crate::calibration::{Calibration, JointCalibration, usual_path};
use crate::draft;
use crate::error::{Error, ErrorKind};
use crate::job::report::Outcome;
use crate::job::{Event, Observer};
use crate::robot::{Joint, Robot};
use gaitway_profiles::Role;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Which way.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum LerobotWay {
    /// This file of theirs becomes ours.
    From(PathBuf),
    /// Ours becomes this file of theirs.
    To(PathBuf),
}

/// Whose calibration is carried over.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LerobotOrder {
    /// Robot by name, or path of its file.
    pub robot: String,
    /// Which way.
    pub way: LerobotWay,
    /// Our file; `None`: the usual one of this robot.
    pub calibration: Option<PathBuf>,
    /// What is there may be replaced.
    pub replace: bool,
    /// Nothing is written.
    pub dry_run: bool,
}

/// A motor as LeRobot knows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct MotorCalibration {
    id: u8,
    /// 1 where it turns the other way.
    drive_mode: i64,
    /// What its register holds.
    homing_offset: i64,
    /// Lowest count that was reached with that.
    range_min: i64,
    /// Highest.
    range_max: i64,
}

/// Carries a calibration over; nothing is asked of a robot. Our file says what must stand in its servos: that is looked at before
/// anything moves.
///
/// # Errors
/// A file that cannot be read, is of another robot, or leaves a joint without a range; one that would be written over.
pub fn carry_over(order: &LerobotOrder, observer: &dyn Observer) -> Result<CalibrateReport, Error> {
    let robot = Robot::load(&order.robot)?;
    let file = order.calibration.clone().or_else(|| usual_path(&robot.name)).ok_or_else(|| {
        Error::new("no place for the calibration").remedy("name one with --calibration FILE.toml")
    })?;
    match &order.way {
        LerobotWay::From(theirs) => {
            let text = gaitway_profiles::read_text(theirs)?;
            let at = |error: Error| {
                let place = error.place.as_deref().map_or_else(String::new, |of| format!(", {of}"));
                error.at(format!("{}{place}", theirs.display()))
            };
            let calibration = ours(&robot, &text).map_err(at)?;
            let absent = robot.joints.iter().filter(|of| calibration.joint(&of.name).is_none());
            let absent: Vec<&str> = absent.map(|of| of.name.as_str()).collect();
            if !absent.is_empty() {
                let note =
                    format!("not in the file, and as the robot file says: {}", absent.join(", "));
                observer.hear(Event::Note(&note));
            }
            if file.exists() && !order.replace {
                return Err(Error::of(ErrorKind::Exists, "the robot is calibrated already")
                    .at(file.display().to_string())
                    .remedy("add --force to replace it; what is there is kept beside it"));
            }
            let mut report = report(&robot, &calibration, file.clone());
            report.dry_run = order.dry_run;
            if !order.dry_run {
                report.undo.push(finish(&Files::of(file), &calibration)?);
                observer.hear(Event::Note(&format!("to undo: {}", report.undo[0])));
            }
            Ok(report)
        }
        LerobotWay::To(path) => {
            let calibration = Calibration::read(&file)?;
            calibration.apply(&mut robot.file.clone())?;
            let motors = theirs(&robot, &calibration, observer)?;
            let text = serde_json::to_string_pretty(&motors)
                .map_err(|e| Error::new("the calibration cannot be written").got(e.to_string()))?;
            if !order.dry_run {
                draft::write_file(path, order.replace, (text + "\n").as_bytes())?;
            }
            let told = report(&robot, &calibration, path.clone());
            Ok(CalibrateReport { dry_run: order.dry_run, ..told })
        }
    }
}

fn report(robot: &Robot, calibration: &Calibration, file: PathBuf) -> CalibrateReport {
    let measured = |of: &JointCalibration| {
        let gear = robot.file.joint(&of.name).map_or(1.0, |joint| joint.gear);
        JointMeasured {
            name: of.name.clone(),
            direction: of.direction,
            offset_rad: of.offset_rad,
            zero_servo_rad: of.offset_rad / (f64::from(of.direction) * gear),
            lower_rad: of.lower_rad,
            upper_rad: of.upper_rad,
            homing_offset_raw: of.homing_offset_raw,
        }
    };
    CalibrateReport {
        outcome: Outcome::Done,
        stop_reason: None,
        stop: None,
        robot: robot.name.clone(),
        dry_run: false,
        calibration: file,
        joints: calibration.joints.iter().map(measured).collect(),
        undo: Vec::new(),
    }
}

/// What a joint's file says: how it turns with its servo, +1 or -1, and its gear.
fn turns(robot: &Robot, name: &str) -> (i8, f64) {
    robot.file.joint(name).map_or((1, 1.0), |joint| (joint.direction, joint.gear))
}

/// Their calibration as ours.
fn ours(robot: &Robot, text: &str) -> Result<Calibration, Error> {
    let motors: BTreeMap<String, MotorCalibration> = serde_json::from_str(text).map_err(|e| {
        Error::of(ErrorKind::Malformed, "not a calibration of LeRobot")
            .got(e.to_string())
            .allowed("{\"JOINT\": {\"id\": 1, \"drive_mode\": 0, \"homing_offset\": 0, \"range_min\": 0, \"range_max\": 4095}, ...}")
    })?;
    let mut calibration = Calibration::of(&robot.name);
    for (name, motor) in &motors {
        let place = format!("joint {name}");
        let joint =
            robot.joints.iter().find(|joint| joint.name == *name).ok_or_else(|| {
                let names: Vec<&str> = robot.joints.iter().map(|of| of.name.as_str()).collect();
                Error::of(ErrorKind::Unknown, "the robot has no such joint")
                    .at(place.clone())
                    .none_of(name, names, "name it as the robot's file does")
            })?;
        calibration.put(of_motor(robot, joint, motor).map_err(|error| error.at(place))?);
    }
    if calibration.joints.is_empty() {
        return Err(Error::of(ErrorKind::Malformed, "no motor is in the file"));
    }
    calibration.apply(&mut robot.file.clone())?;
    Ok(calibration)
}

fn of_motor(
    robot: &Robot,
    joint: &Joint,
    motor: &MotorCalibration,
) -> Result<JointCalibration, Error> {
    if joint.id != motor.id {
        return Err(Error::new("the joint has another ID")
            .got(motor.id.to_string())
            .allowed(format!("{}, by the robot file", joint.id)));
    }
    let scale = servo_scale(joint)?;
    let last = scale.turn_counts() - 1;
    let MotorCalibration { drive_mode, homing_offset, range_min, range_max, .. } = *motor;
    if !(0 <= range_min
        && range_min < range_max
        && range_max <= last
        && (0..=1).contains(&drive_mode))
    {
        return Err(Error::of(ErrorKind::OutsideLimits, "this range or drive mode is none")
            .got(format!("range_min {range_min}, range_max {range_max}, drive_mode {drive_mode}"))
            .allowed(format!("counts of 0 to {last}, the lowest first; drive_mode 0 or 1")));
    }
    let homing_offset_raw = match joint.register(Role::HomingOffset) {
        Some(register) => {
            let (least, most) = register.range();
            if !(least..=most).contains(&homing_offset) {
                return Err(Error::of(ErrorKind::OutsideLimits, "the servo takes no such offset")
                    .got(homing_offset.to_string())
                    .allowed(format!("{least} to {most}")));
            }
            Some(homing_offset)
        }
        None => None,
    };
    let (as_filed, gear) = turns(robot, &joint.name);
    let direction = if drive_mode == 0 { as_filed } else { -as_filed };
    // Their zero, half a count apart where the range is odd.
    let half_rad = (range_max - range_min) as f64 / 2.0 * scale.rad_per_count();
    let zero_servo_rad = scale.angle_rad(range_min) + half_rad;
    let reach_rad = half_rad * gear.abs() - MARGIN_RAD;
    if !(reach_rad > 0.0) {
        return Err(
            Error::new("the joint was hardly moved").got(format!("{range_min} to {range_max}"))
        );
    }
    Ok(JointCalibration {
        name: joint.name.clone(),
        direction,
        offset_rad: f64::from(direction) * gear * zero_servo_rad,
        lower_rad: Some(-reach_rad),
        upper_rad: Some(reach_rad),
        homing_offset_raw,
    })
}

fn servo_scale(joint: &Joint) -> Result<Scale, Error> {
    if joint.actuator().is_some() {
        return Err(Error::new("LeRobot keeps no calibration of a CAN actuator like this")
            .at(format!("joint {}", joint.name)));
    }
    Scale::of(joint)
}

/// Our calibration as theirs. Where zero is not the middle of the range, that is said: theirs cannot say it.
fn theirs(
    robot: &Robot,
    calibration: &Calibration,
    observer: &dyn Observer,
) -> Result<BTreeMap<String, MotorCalibration>, Error> {
    let mut motors = BTreeMap::new();
    for of in &calibration.joints {
        let place = || format!("joint {}", of.name);
        let joint = robot.joints.iter().find(|joint| joint.name == of.name);
        let joint = joint.ok_or_else(|| Error::new("the robot has no such joint").at(place()))?;
        let scale = servo_scale(joint)?;
        let Some((lower_rad, upper_rad)) = of.lower_rad.zip(of.upper_rad) else {
            return Err(Error::of(
                ErrorKind::Absent,
                "the joint was hardly moved: it has no range",
            )
            .at(place())
            .remedy("gaitway calibrate, and move it from end to end"));
        };
        // What is not kept is as the robot's file has it, or as the servo leaves the factory.
        let stated = joint.register(Role::HomingOffset).and_then(|register| {
            let setup = joint.servo().and_then(|of| of.setup.get(&register.name).copied());
            setup.or(register.initial)
        });
        let homing_offset = of.homing_offset_raw.or(stated).unwrap_or(0);
        let (as_filed, gear) = turns(robot, &of.name);
        let sign = f64::from(of.direction) * gear;
        let count = |angle_rad: f64| {
            let servo_rad = (angle_rad + of.offset_rad) / sign;
            ((servo_rad - scale.angle_rad(0)) / scale.rad_per_count()).round() as i64
        };
        let ends = [count(lower_rad - MARGIN_RAD), count(upper_rad + MARGIN_RAD)];
        let middle_rad = f64::midpoint(lower_rad, upper_rad);
        if middle_rad.abs() > 2.0 * scale.rad_per_count() {
            observer.hear(Event::Note(&format!(
                "{}: LeRobot's zero is the middle of the range, {:.1} deg from this one",
                of.name,
                middle_rad.to_degrees()
            )));
        }
        let motor = MotorCalibration {
            id: joint.id,
            drive_mode: i64::from(of.direction != as_filed),
            homing_offset,
            range_min: ends[0].min(ends[1]),
            range_max: ends[0].max(ends[1]),
        };
        motors.insert(of.name.clone(), motor);
    }
    Ok(motors)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::JointState;
    use crate::job::Nobody;

    /// As LeRobot writes it: a published calibration of an SO-101 follower.
    const THEIRS: &str = r#"{
        "shoulder_pan": {"id": 1, "drive_mode": 0, "homing_offset": -1365, "range_min": 746, "range_max": 3477},
        "shoulder_lift": {"id": 2, "drive_mode": 0, "homing_offset": -1200, "range_min": 822, "range_max": 3211},
        "elbow_flex": {"id": 3, "drive_mode": 0, "homing_offset": -986, "range_min": 901, "range_max": 3110},
        "wrist_flex": {"id": 4, "drive_mode": 0, "homing_offset": -1696, "range_min": 849, "range_max": 3216}
    }"#;

    fn so101() -> Robot {
        Robot::load("so101").expect("shipped")
    }

    #[test]
    fn a_joint_stands_at_the_angle_that_lerobot_reckons() {
        let calibration = ours(&so101(), THEIRS).expect("theirs");
        let robot = so101().with_calibration(&calibration).expect("of this robot");
        for (name, min, max) in [("shoulder_pan", 746, 3477), ("elbow_flex", 901, 3110)] {
            let joint = robot.joints.iter().find(|joint| joint.name == name).expect("a joint");
            let filed = robot.file.joint(name).expect("a joint").direction;
            for count in [min, 1200, 2047, 2600, max] {
                // Their degrees: (count - mid) * 360 / 4095.
                let mid = f64::from(min + max) / 2.0;
                let wanted_deg = (f64::from(count) - mid) * 360.0 / 4095.0 * f64::from(filed);
                let position_rad = Scale::of(joint).expect("a servo").angle_rad(count.into());
                let seen = joint.joint_state(JointState { position_rad, ..JointState::default() });
                let off_deg = seen.position_rad.to_degrees() - wanted_deg;
                assert!(off_deg.abs() < 0.05, "{name} at {count}: {off_deg} deg off");
            }
        }
        let pan = calibration.joint("shoulder_pan").expect("carried over");
        assert_eq!(pan.homing_offset_raw, Some(-1365));
    }

    #[test]
    fn what_is_carried_over_and_back_is_the_same_to_a_count() {
        let given: BTreeMap<String, MotorCalibration> = serde_json::from_str(THEIRS).expect("JSON");
        let calibration = ours(&so101(), THEIRS).expect("theirs");
        assert_eq!(theirs(&so101(), &calibration, &Nobody).expect("ours"), given);
        // Turned round: the counts stay, the angles change their sign.
        let turned = THEIRS.replace("\"drive_mode\": 0", "\"drive_mode\": 1");
        let turned = ours(&so101(), &turned).expect("theirs");
        assert_eq!(turned.joints[0].direction, -calibration.joints[0].direction);
        let back = theirs(&so101(), &turned, &Nobody).expect("ours");
        assert!(back.values().all(|motor| motor.drive_mode == 1));
        assert_eq!(back["elbow_flex"].range_max, given["elbow_flex"].range_max);
    }

    #[test]
    fn what_is_no_calibration_of_this_robot_is_refused_with_the_joint() {
        for (from, to, said) in [
            ("shoulder_pan", "nose", "no such joint"),
            ("\"id\": 2", "\"id\": 9", "another ID"),
            ("822", "4000", "none"),
            ("3477", "5000", "none"),
            ("-1365", "-9000", "no such offset"),
            ("\"drive_mode\"", "\"drive\"", "not a calibration of LeRobot"),
            ("746", "3470", "hardly moved"),
        ] {
            let text = THEIRS.replacen(from, to, 1);
            let refused = ours(&so101(), &text).expect_err(to).to_string();
            assert!(refused.contains(said), "{to}: {refused}");
        }
        assert!(ours(&so101(), "{}").is_err());
        assert!(ours(&so101(), "[1, 2").is_err());
    }

    #[test]
    fn a_joint_without_a_range_has_no_counterpart_there() {
        let mut calibration = ours(&so101(), THEIRS).expect("theirs");
        calibration.joints[0].lower_rad = None;
        let refused = theirs(&so101(), &calibration, &Nobody).expect_err("no range").to_string();
        assert!(refused.contains("no range"), "{refused}");
    }
}
