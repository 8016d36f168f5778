//! What was measured on one robot of flesh and bolts: where each joint's zero is, which way it
//! turns, how far it goes. Laid over the robot file, which says what all of its kind share.

use crate::error::{Error, ErrorKind};
use crate::toml_text::to_toml;
use gaitway_profiles as profiles;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Version of the file format.
const SCHEMA: u32 = 1;

/// A calibration file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Calibration {
    /// Version of this file format; 1.
    pub schema: u32,
    /// The robot it was measured on, by name.
    pub robot: String,
    /// Joints that were measured; all others are as the robot file says.
    #[serde(default, rename = "joint")]
    pub joints: Vec<JointCalibration>,
}

/// One joint as it was measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JointCalibration {
    /// Its name in the robot file.
    pub name: String,
    /// +1 or -1, in place of the robot file's.
    pub direction: i8,
    /// Joint angle = direction x gear x servo angle - this, rad; in place of the robot file's.
    pub offset_rad: f64,
    /// Lowest joint angle that was reached by hand, rad; only narrows the robot file's range.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lower_rad: Option<f64>,
    /// Highest joint angle that was reached by hand, rad.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub upper_rad: Option<f64>,
    /// The servo's homing offset that the measurement goes with, raw, and that the servo must still
    /// have; absent: as the robot file says.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub homing_offset_raw: Option<i64>,
}

impl Calibration {
    /// Nothing measured yet.
    #[must_use]
    pub fn of(robot: &str) -> Self {
        Self { schema: SCHEMA, robot: robot.to_owned(), joints: Vec::new() }
    }

    /// The joint called `name`, if it was measured.
    #[must_use]
    pub fn joint(&self, name: &str) -> Option<&JointCalibration> {
        self.joints.iter().find(|joint| joint.name == name)
    }

    /// Puts a joint in, in place of what was known of it.
    pub fn put(&mut self, joint: JointCalibration) {
        match self.joints.iter_mut().find(|known| known.name == joint.name) {
            Some(known) => *known = joint,
            None => self.joints.push(joint),
        }
    }

    /// Reads a calibration.
    ///
    /// # Errors
    /// A file that cannot be read, has another form, or names a joint twice.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let text = profiles::read_text(path)?;
        Self::parse(&text).map_err(|e| e.at(path.display().to_string()))
    }

    /// Reads the text of a calibration.
    ///
    /// # Errors
    /// As [`Calibration::read`], but for the file.
    pub fn parse(text: &str) -> Result<Self, Error> {
        let calibration: Self = profiles::from_toml(text).map_err(|e| {
            Error::of(ErrorKind::Malformed, "not a calibration file")
                .got(profiles::plain_words(e.message()).replace('\n', "; "))
        })?;
        if calibration.schema != SCHEMA {
            return Err(Error::new("a calibration of another version")
                .got(calibration.schema.to_string())
                .allowed(SCHEMA.to_string()));
        }
        for (index, joint) in calibration.joints.iter().enumerate() {
            joint.check()?;
            let mut before = calibration.joints[..index].iter();
            if let Some(first) = before.position(|other| other.name == joint.name) {
                return Err(Error::of(ErrorKind::Malformed, "a joint is named twice").got(
                    format!(
                        "{}: [[joint]] number {} and number {}",
                        joint.name,
                        first + 1,
                        index + 1
                    ),
                ));
            }
        }
        Ok(calibration)
    }

    /// The file's text.
    ///
    /// # Errors
    /// None that a calibration can have.
    pub fn text(&self) -> Result<String, Error> {
        let remark = format!(
            "Written by `gaitway calibrate {}`. Joint angle = direction x gear x servo angle - offset.",
            self.robot
        );
        to_toml(&remark, self)
    }

    /// Lays the calibration over a robot file.
    ///
    /// # Errors
    /// Another robot's calibration, a joint the robot does not have, a range that leaves nothing.
    pub fn apply(&self, file: &mut profiles::Robot) -> Result<(), Error> {
        if self.robot != file.name {
            return Err(Error::new("this is another robot's calibration")
                .got(self.robot.clone())
                .allowed(file.name.clone()));
        }
        for measured in &self.joints {
            let known = file.joints.iter_mut().find(|joint| joint.name == measured.name);
            let Some(joint) = known else {
                let names = file.joints.iter().map(|joint| &joint.name);
                return Err(Error::of(
                    ErrorKind::Unknown,
                    "the calibration names a joint the robot does not have",
                )
                .at(format!("robot {}", file.name))
                .none_of(&measured.name, names, "calibrate this robot"));
            };
            joint.direction = measured.direction;
            joint.offset_rad = measured.offset_rad;
            // What the hand reached beyond the robot file's range is not granted.
            joint.lower_rad =
                measured.lower_rad.map_or(joint.lower_rad, |l| l.max(joint.lower_rad));
            joint.upper_rad =
                measured.upper_rad.map_or(joint.upper_rad, |u| u.min(joint.upper_rad));
            if !(joint.lower_rad < joint.upper_rad) {
                return Err(Error::new(
                    "the calibrated range and the robot file's have no common part",
                )
                .at(format!("robot {}, joint {}", file.name, joint.name)));
            }
            let initial_rad = joint.initial_rad().clamp(joint.lower_rad, joint.upper_rad);
            joint.initial = Some(initial_rad);
            if let Some(raw) = measured.homing_offset_raw {
                let (firmware, servo) = (setup_firmware(file, &measured.name), &measured.name);
                let profile = file.joint(servo).map(|j| j.servo.clone()).unwrap_or_default();
                if let Some(register) = homing_register(&profile) {
                    file.setups.push(profiles::Setup {
                        servo: profile,
                        joints: Some(vec![measured.name.clone()]),
                        firmware,
                        registers: [(register, raw)].into(),
                        source: "calibration".to_owned(),
                    });
                }
            }
        }
        Ok(())
    }
}

impl JointCalibration {
    fn check(&self) -> Result<(), Error> {
        let angles = [Some(self.offset_rad), self.lower_rad, self.upper_rad];
        let finite = angles.iter().flatten().all(|angle| angle.is_finite());
        let ordered = match (self.lower_rad, self.upper_rad) {
            (Some(lower), Some(upper)) => lower < upper,
            _ => true,
        };
        if finite && ordered && matches!(self.direction, 1 | -1) {
            return Ok(());
        }
        Err(Error::new("a joint's calibration is not usable")
            .got(format!("{self:?}"))
            .allowed("direction 1 or -1, finite angles, the lower below the upper"))
    }
}

fn setup_firmware(file: &profiles::Robot, joint: &str) -> u16 {
    file.joint(joint).map_or(0, |joint| file.setup_for(joint).0)
}

fn homing_register(servo: &str) -> Option<String> {
    let servo = profiles::servo(servo).ok()?;
    Some(servo.register(profiles::Role::HomingOffset)?.name.clone())
}

/// Where a robot's calibration lies if nothing else is said.
#[must_use]
pub fn usual_path(robot: &str) -> Option<PathBuf> {
    let config = std::env::var_os("XDG_CONFIG_HOME").filter(|folder| !folder.is_empty());
    let config = config.map(PathBuf::from).filter(|folder| folder.is_absolute());
    let home = || std::env::var_os("HOME").map(|home| PathBuf::from(home).join(".config"));
    Some(config.or_else(home)?.join("gaitway/calibration").join(format!("{robot}.toml")))
}

/// How a maker's servos use their homing offset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HomingSign {
    /// Present = actual + offset (DYNAMIXEL e-Manual, Homing Offset(20)).
    Added,
    /// Present = actual - offset (FEETECH; huggingface/lerobot, motors/feetech).
    Subtracted,
}

/// The homing offset that makes a servo read `wanted` where it reads `present` with `offset` now.
#[must_use]
pub const fn homing_offset(sign: HomingSign, present: i64, offset: i64, wanted: i64) -> i64 {
    match sign {
        HomingSign::Added => wanted - (present - offset),
        HomingSign::Subtracted => (present + offset) - wanted,
    }
}

/// Follows an encoder that begins anew after each turn, in steps of less than half a turn.
#[derive(Clone, Copy, Debug)]
pub struct Unwrapped {
    counts_per_turn: i64,
    at: i64,
    lowest: i64,
    highest: i64,
    fastest: i64,
}

impl Unwrapped {
    /// Begins at a reading.
    #[must_use]
    pub const fn from(reading: i64, counts_per_turn: i64) -> Self {
        Self { counts_per_turn, at: reading, lowest: reading, highest: reading, fastest: 0 }
    }

    /// Goes on to the next reading, the short way.
    pub fn follow(&mut self, reading: i64) {
        let turn = self.counts_per_turn;
        let step = (reading - self.at + turn / 2).rem_euclid(turn) - turn / 2;
        self.at += step;
        self.fastest = self.fastest.max(step.abs());
        self.lowest = self.lowest.min(self.at);
        self.highest = self.highest.max(self.at);
    }

    /// The present count, counted on through the turns.
    #[must_use]
    pub const fn now(&self) -> i64 {
        self.at
    }

    /// Lowest and highest count so far, counted on through the turns.
    #[must_use]
    pub const fn range(&self) -> (i64, i64) {
        (self.lowest, self.highest)
    }

    /// True if some step was so large that the short way may have been the wrong one.
    #[must_use]
    pub const fn doubtful(&self) -> bool {
        self.fastest > self.counts_per_turn / 4
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn joint(name: &str) -> JointCalibration {
        JointCalibration {
            name: name.to_owned(),
            direction: -1,
            offset_rad: 0.125,
            lower_rad: Some(-0.5),
            upper_rad: Some(0.75),
            homing_offset_raw: Some(-12),
        }
    }

    /// The half-turn rule of huggingface/lerobot: with no offset yet, the pose in the middle shall
    /// read 2047; FEETECH gets position - 2047, DYNAMIXEL 2047 - position.
    #[test]
    fn each_makers_offset_has_its_own_sign() {
        assert_eq!(homing_offset(HomingSign::Subtracted, 1000, 0, 2047), -1047);
        assert_eq!(homing_offset(HomingSign::Added, 1000, 0, 2047), 1047);
    }

    proptest! {
        #[test]
        fn a_servo_with_the_new_offset_reads_what_was_wanted(
            actual in 0_i64..4096, old in -1024_i64..1024, wanted in 0_i64..4096
        ) {
            let new = homing_offset(HomingSign::Added, actual + old, old, wanted);
            prop_assert_eq!(actual + new, wanted);
            let new = homing_offset(HomingSign::Subtracted, actual - old, old, wanted);
            prop_assert_eq!(actual - new, wanted);
        }

        #[test]
        fn an_encoder_is_followed_through_its_wrap_in_small_steps(
            start in -5000_i64..5000, steps in prop::collection::vec(-1000_i64..1000, 1..50)
        ) {
            let mut followed = Unwrapped::from(start.rem_euclid(4096), 4096);
            let base = start - start.rem_euclid(4096);
            let (mut at, mut low, mut high) = (start, start, start);
            for step in steps {
                at += step;
                (low, high) = (low.min(at), high.max(at));
                followed.follow(at.rem_euclid(4096));
            }
            prop_assert_eq!(followed.range(), (low - base, high - base));
            prop_assert!(!followed.doubtful());
        }
    }

    #[test]
    fn a_leap_is_doubted() {
        let mut followed = Unwrapped::from(0, 4096);
        followed.follow(1500);
        assert!(followed.doubtful());
    }

    #[test]
    fn what_is_written_is_read_back_the_same() {
        let mut calibration = Calibration::of("op3");
        calibration.put(joint("r_knee"));
        calibration.put(JointCalibration { lower_rad: None, upper_rad: None, ..joint("l_knee") });
        assert_eq!(
            Calibration::parse(&calibration.text().expect("a text")).expect("its own text"),
            calibration
        );
    }

    #[test]
    fn files_that_say_nonsense_are_refused() {
        let good =
            |text: &str| format!("schema = 1\nrobot = \"op3\"\n[[joint]]\nname = \"a\"\n{text}");
        assert!(Calibration::parse(&good("direction = 1\noffset_rad = 0.0\n")).is_ok());
        for bad in [
            "direction = 2\noffset_rad = 0.0\n",
            "direction = 1\noffset_rad = nan\n",
            "direction = 1\noffset_rad = 0.0\nlower_rad = 1.0\nupper_rad = 0.5\n",
            "direction = 1\noffset_rad = 0.0\nlimit = 3\n",
            "direction = 1\n",
        ] {
            assert!(Calibration::parse(&good(bad)).is_err(), "{bad}");
        }
        assert!(Calibration::parse("schema = 2\nrobot = \"op3\"\n").is_err());
    }

    #[test]
    fn a_calibration_narrows_a_range_and_never_widens_it() {
        let mut file = profiles::robot("op3").expect("a shipped robot");
        let before = file.joint("r_knee").expect("a joint").clone();
        let mut calibration = Calibration::of("op3");
        calibration.put(JointCalibration {
            lower_rad: Some(before.lower_rad + 0.1),
            upper_rad: Some(before.upper_rad + 0.1),
            ..joint("r_knee")
        });
        calibration.apply(&mut file).expect("the robot's own");
        let after = file.joint("r_knee").expect("a joint").clone();
        assert_eq!(after.lower_rad, before.lower_rad + 0.1);
        assert_eq!(after.upper_rad, before.upper_rad);
        assert_eq!((after.direction, after.offset_rad), (-1, 0.125));
        assert_eq!(file.setup_for(&after).1.get("Homing Offset"), Some(&-12));
        // The firmware and the other registers of the setup stay.
        assert_eq!(file.setup_for(&after).0, file.setup_for(&before).0);
    }

    #[test]
    fn another_robots_calibration_and_an_unknown_joint_are_refused() {
        let mut file = profiles::robot("op3").expect("a shipped robot");
        assert!(Calibration::of("open-duck-mini-v2").apply(&mut file).is_err());
        let mut calibration = Calibration::of("op3");
        calibration.put(joint("third_knee"));
        assert!(calibration.apply(&mut file).is_err());
    }
}
