//! Named joints on devices on lines: signs, zeros and limits resolved once, so that everything
//! above speaks joint angles in the robot's own sense.

pub mod link;
pub mod preflight;
pub mod reading;

pub use link::{Link, LinkError};

use crate::bus::Protocol;
use crate::calibration::Calibration;
use crate::device::{FeedbackBlock, HealthBlock, JointState, Model};
use crate::error::Error;
use crate::motion::JointLimits;
use gaitway_profiles::{self as profiles, Role};
use std::collections::BTreeMap;

/// One degree of freedom, resolved.
#[derive(Clone, Debug)]
pub struct Joint {
    /// Its name in the robot file.
    pub name: String,
    /// Index of its line in [`Robot::lines`].
    pub line: usize,
    /// Bus ID.
    pub id: u8,
    /// The servo that turns it.
    pub model: Model,
    /// Limits, rounded inwards to whole counts of the servo, so that no goal that keeps them
    /// can be rounded out of them.
    pub limits: JointLimits,
    /// Pose the robot file starts in, rad.
    pub initial_rad: f64,
    /// Raw values its registers are configured to, by register name.
    pub setup: BTreeMap<String, i64>,
    /// Turns of the joint for one turn of the servo, with its sign.
    ratio: f64,
    offset_rad: f64,
    /// Read in every cycle.
    feedback: FeedbackBlock,
    /// Read instead where that is too much.
    position: FeedbackBlock,
    health: HealthBlock,
}

impl Joint {
    fn new(file: &profiles::Robot, joint: &profiles::Joint, line: usize) -> Result<Self, Error> {
        let place = || format!("robot {}, joint {}", file.name, joint.name);
        let servo =
            profiles::servo(&joint.servo).map_err(|e| Error::new(e.to_string()).at(place()))?;
        let model = Model::new(servo);
        let unfit = |e: crate::device::RegisterError| Error::new(e.to_string()).at(place());
        let goal = model.register(Role::GoalPosition).map_err(unfit)?;
        let direction = f64::from(joint.direction);
        let ratio = direction * joint.gear;
        let servo_angle = |joint_rad: f64| direction * (joint_rad + joint.offset_rad) / joint.gear;
        let inward = |limit_rad: f64, towards: f64| -> Result<f64, Error> {
            let wanted = servo_angle(limit_rad);
            let mut raw = model.raw_from_si(goal, wanted).map_err(unfit)?;
            let back = |raw| ratio * model.si_from_raw(goal, raw) - joint.offset_rad;
            if (back(raw) - limit_rad) * towards < 0.0 {
                raw += if direction * towards > 0.0 { 1 } else { -1 };
            }
            Ok(back(raw))
        };
        let limits = JointLimits::new(
            inward(joint.lower_rad, 1.0)?,
            inward(joint.upper_rad, -1.0)?,
            joint.velocity_rad_s,
            joint.acceleration_rad_s2,
        )
        .map_err(|e| e.at(place()))?;
        Ok(Self {
            name: joint.name.clone(),
            line,
            id: joint.id,
            model,
            limits,
            initial_rad: joint.initial_rad,
            setup: file.setup_for(joint).1,
            ratio,
            offset_rad: joint.offset_rad,
            feedback: FeedbackBlock::of(model).map_err(unfit)?,
            position: FeedbackBlock::position_of(model).map_err(unfit)?,
            health: HealthBlock::of(model),
        })
    }

    /// SI value of a configuration register as the robot file, or else the factory, sets it.
    #[must_use]
    pub fn configured(&self, role: Role) -> Option<f64> {
        let register = self.model.register(role).ok()?;
        let raw = self.setup.get(&register.name).copied().or(register.initial)?;
        Some(self.model.si_from_raw(register, raw))
    }

    /// True if its servo can be asked for its own registers in a question to several.
    #[must_use]
    pub fn bulk_read(&self) -> bool {
        match self.model.protocol() {
            Protocol::Dynamixel1 => self.model.profile().bulk_read,
            Protocol::Dynamixel2 => true,
            Protocol::FeetechSts | Protocol::FeetechScs => false,
        }
    }

    /// The servo's angle for a joint angle, rad.
    #[must_use]
    pub fn servo_rad(&self, joint_rad: f64) -> f64 {
        (joint_rad + self.offset_rad) / self.ratio
    }

    /// The servo's speed for a speed of the joint, rad/s, without sign.
    #[must_use]
    pub fn servo_speed_rad_s(&self, joint_rad_s: f64) -> f64 {
        (joint_rad_s / self.ratio).abs()
    }

    /// The joint's state from what its servo reported.
    #[must_use]
    pub fn joint_state(&self, servo: JointState) -> JointState {
        JointState {
            position_rad: self.ratio * servo.position_rad - self.offset_rad,
            velocity_rad_s: servo.velocity_rad_s.map(|rad_s| self.ratio * rad_s),
            current_a: servo.current_a.map(|current_a| self.ratio.signum() * current_a),
            load_ratio: servo.load_ratio.map(|load| self.ratio.signum() * load),
            ..servo
        }
    }
}

/// A serial line of the robot.
#[derive(Clone, Debug)]
pub struct Line {
    /// Its name in the robot file.
    pub name: String,
    /// Bits per second.
    pub baud_bps: u32,
}

/// A robot as its file describes it, resolved against the servo profiles.
#[derive(Clone, Debug)]
pub struct Robot {
    /// Its name.
    pub name: String,
    /// Joints in the file's order; every list of joint values in this crate has this order.
    pub joints: Vec<Joint>,
    /// Lines in the file's order.
    pub lines: Vec<Line>,
    /// The file itself.
    pub file: profiles::Robot,
}

impl Robot {
    /// Resolves a validated robot file.
    ///
    /// # Errors
    /// A servo without the registers that playing needs; limits outside the servo's travel.
    pub fn new(file: profiles::Robot) -> Result<Self, Error> {
        let lines: Vec<Line> = file
            .lines
            .iter()
            .map(|line| Line { name: line.name.clone(), baud_bps: line.baud_bps().unwrap_or(0) })
            .collect();
        let mut joints = Vec::with_capacity(file.joints.len());
        for joint in &file.joints {
            let line = lines.iter().position(|line| line.name == joint.line).ok_or_else(|| {
                Error::new("a joint hangs on a line the robot does not have")
                    .at(format!("robot {}, joint {}", file.name, joint.name))
                    .got(joint.line.clone())
            })?;
            joints.push(Joint::new(&file, joint, line)?);
        }
        Ok(Self { name: file.name.clone(), joints, lines, file })
    }

    /// Loads a robot by name or path.
    ///
    /// # Errors
    /// Unknown name, unreadable or invalid file.
    pub fn load(name_or_path: &str) -> Result<Self, Error> {
        let file = profiles::robot(name_or_path)?;
        Self::new(file)
    }

    /// The same robot with what was measured on this one.
    ///
    /// # Errors
    /// A calibration that does not fit the robot (see [`Calibration::apply`]) or its servos.
    pub fn with_calibration(mut self, calibration: &Calibration) -> Result<Self, Error> {
        calibration.apply(&mut self.file)?;
        Self::new(self.file)
    }

    /// Limits of all joints.
    #[must_use]
    pub fn limits(&self) -> Vec<JointLimits> {
        self.joints.iter().map(|joint| joint.limits).collect()
    }

    /// Names of all joints.
    #[must_use]
    pub fn joint_names(&self) -> Vec<String> {
        self.joints.iter().map(|joint| joint.name.clone()).collect()
    }
}
