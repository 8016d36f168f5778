//! Named joints on devices on lines: signs, zeros and limits resolved once, so that everything
//! above speaks joint angles in the robot's own sense.

pub mod body;
pub mod link;
pub mod model;
pub mod preflight;
pub mod reading;
pub mod urdf_text;

pub use body::{RobotBody, Sole};
pub use link::{LinePort, Link, LinkError};

use crate::bus::Protocol;
use crate::calibration::Calibration;
use crate::device::actuator::Placing;
use crate::device::{Actuator, FeedbackBlock, HealthBlock, InertialBoard, JointState, Model};
use crate::error::Error;
use crate::motion::JointLimits;
use gaitway_profiles::{self as profiles, CanSpeed, LineKind, Register, Role};
use std::collections::BTreeMap;

/// What turns a joint.
#[derive(Clone, Debug)]
pub enum Drive {
    /// A servo with registers, on a serial line.
    Servo(Box<ServoDrive>),
    /// An actuator on a CAN line.
    Actuator(Actuator),
}

/// A joint's servo: its control table, how it is configured and what is read of it.
#[derive(Clone, Debug)]
pub struct ServoDrive {
    /// Its registers.
    pub model: Model,
    /// Raw values its registers are configured to, by register name.
    pub setup: BTreeMap<String, i64>,
    /// Read in every cycle.
    feedback: FeedbackBlock,
    /// Read instead where that is too much.
    position: FeedbackBlock,
    health: HealthBlock,
}

impl ServoDrive {
    fn new(file: &profiles::Robot, joint: &profiles::Joint) -> Result<Self, Error> {
        let servo = profiles::servo(&joint.servo).map_err(|e| Error::new(e.to_string()))?;
        let unfit = |e: crate::device::RegisterError| Error::new(e.to_string());
        let model = Model::new(servo);
        model.register(Role::GoalPosition).map_err(unfit)?;
        Ok(Self {
            model,
            setup: file.setup_for(joint).1,
            feedback: FeedbackBlock::of(model).map_err(unfit)?,
            position: FeedbackBlock::position_of(model).map_err(unfit)?,
            health: HealthBlock::of(model),
        })
    }

    /// The angle nearest to `angle_rad` that its goal register can hold, on the side of it that
    /// `up` names.
    fn tellable_rad(&self, angle_rad: f64, up: bool) -> Result<f64, Error> {
        let unfit = |e: crate::device::RegisterError| Error::new(e.to_string());
        let goal = self.model.register(Role::GoalPosition).map_err(unfit)?;
        let raw = self.model.raw_from_si(goal, angle_rad).map_err(unfit)?;
        let told_rad = self.model.si_from_raw(goal, raw);
        let next = if up && told_rad < angle_rad {
            raw + 1
        } else if !up && told_rad > angle_rad {
            raw - 1
        } else {
            raw
        };
        Ok(self.model.si_from_raw(goal, next))
    }

    /// True if it can be asked for its own registers in a question to several.
    #[must_use]
    pub fn bulk_read(&self) -> bool {
        match self.model.protocol() {
            Protocol::Dynamixel1 => self.model.profile().bulk_read,
            Protocol::Dynamixel2 => true,
            Protocol::FeetechSts | Protocol::FeetechScs => false,
        }
    }
}

/// What a motor can do, seen from the joint it turns, with the voltage its figures hold for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotorCurve {
    /// Torque at which it stands still, N m.
    pub stall_torque_nm: f64,
    /// Speed at which it has no torque left, rad/s.
    pub no_load_speed_rad_s: f64,
}

/// One degree of freedom, resolved.
#[derive(Clone, Debug)]
pub struct Joint {
    /// Its name in the robot file.
    pub name: String,
    /// Index of its line in [`Robot::lines`].
    pub line: usize,
    /// Bus ID.
    pub id: u8,
    /// What turns it.
    pub drive: Drive,
    /// Limits, rounded inwards to what the drive can be told exactly, so that no goal that keeps
    /// them can be rounded out of them.
    pub limits: JointLimits,
    /// The range in the robot file, rad: beyond the limits by less than a count of its drive.
    pub range_rad: [f64; 2],
    /// Pose the robot file starts in, rad.
    pub initial_rad: f64,
    /// Turns of the joint for one turn of the drive, with its sign.
    ratio: f64,
    offset_rad: f64,
}

impl Joint {
    fn new(file: &profiles::Robot, joint: &profiles::Joint, line: usize) -> Result<Self, Error> {
        let place = || format!("robot {}, joint {}", file.name, joint.name);
        let drive = match file.lines[line].kind {
            LineKind::Serial { .. } => {
                let servo = ServoDrive::new(file, joint).map_err(|e| e.at(place()))?;
                Drive::Servo(Box::new(servo))
            }
            LineKind::Can(speed) => {
                Drive::Actuator(actuator(joint, speed).map_err(|e| e.at(place()))?)
            }
        };
        let direction = f64::from(joint.direction);
        let ratio = direction * joint.gear;
        let inward = |limit_rad: f64, raised: bool| -> Result<f64, Error> {
            let wanted_rad = direction * (limit_rad + joint.offset_rad) / joint.gear;
            // What is further inside for the joint is further up or down for its drive.
            let up = raised == (joint.direction > 0);
            let told_rad = match &drive {
                Drive::Servo(servo) => servo.tellable_rad(wanted_rad, up)?,
                Drive::Actuator(actuator) => actuator.tellable_rad(wanted_rad, up),
            };
            Ok(ratio * told_rad - joint.offset_rad)
        };
        let limits = JointLimits::new(
            inward(joint.lower_rad, true)?,
            inward(joint.upper_rad, false)?,
            joint.velocity_rad_s,
            joint.acceleration_rad_s2,
        )
        .map_err(|e| e.at(place()))?;
        Ok(Self {
            name: joint.name.clone(),
            line,
            id: joint.id,
            drive,
            limits,
            range_rad: [joint.lower_rad, joint.upper_rad],
            initial_rad: joint.initial_rad(),
            ratio,
            offset_rad: joint.offset_rad,
        })
    }

    /// Its servo, if a servo turns it.
    #[must_use]
    pub fn servo(&self) -> Option<&ServoDrive> {
        match &self.drive {
            Drive::Servo(servo) => Some(servo),
            Drive::Actuator(_) => None,
        }
    }

    /// What its motor can do, seen from the joint; nothing for an actuator, of which no curve is known.
    #[must_use]
    pub fn motor_curve(&self) -> Option<MotorCurve> {
        let motor = &self.servo()?.model.profile().motor;
        Some(MotorCurve {
            stall_torque_nm: motor.stall_torque_nm / self.ratio.abs(),
            no_load_speed_rad_s: motor.no_load_speed_rad_s * self.ratio.abs(),
        })
    }

    /// The registers of its servo, for what only a servo can do.
    ///
    /// # Errors
    /// A CAN actuator, which has none.
    pub fn model(&self) -> Result<Model, Error> {
        self.servo().map(|servo| servo.model).ok_or_else(|| {
            Error::new("this needs a servo's registers, and the joint has none")
                .at(format!("joint {}, ID {}", self.name, self.id))
                .got("an actuator on a CAN line")
        })
    }

    /// Its actuator, if it hangs on a CAN line.
    #[must_use]
    pub fn actuator(&self) -> Option<&Actuator> {
        match &self.drive {
            Drive::Servo(_) => None,
            Drive::Actuator(actuator) => Some(actuator),
        }
    }

    /// The register of its servo for `role`, if it has one.
    #[must_use]
    pub fn register(&self, role: Role) -> Option<&'static Register> {
        self.servo()?.model.register(role).ok()
    }

    /// SI value of a configuration register as the robot file, or else the factory, sets it.
    #[must_use]
    pub fn configured(&self, role: Role) -> Option<f64> {
        let servo = self.servo()?;
        let register = servo.model.register(role).ok()?;
        let raw = servo.setup.get(&register.name).copied().or(register.initial)?;
        Some(servo.model.si_from_raw(register, raw))
    }

    /// The drive's angle for a joint angle, rad.
    #[must_use]
    pub fn servo_rad(&self, joint_rad: f64) -> f64 {
        (joint_rad + self.offset_rad) / self.ratio
    }

    /// The drive's speed for a speed of the joint, rad/s, without sign.
    #[must_use]
    pub fn servo_speed_rad_s(&self, joint_rad_s: f64) -> f64 {
        (joint_rad_s / self.ratio).abs()
    }

    /// The joint's state from what its drive reported.
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

/// The board that a robot's file names.
fn base_sensor(file: &profiles::Robot, lines: &[Line]) -> Result<Option<BaseSensor>, Error> {
    let Some(of) = file.body.as_ref().and_then(|body| body.imu.as_ref()) else { return Ok(None) };
    let place = || format!("robot {}, body, imu", file.name);
    let line = lines.iter().position(|line| line.name == of.line).ok_or_else(|| {
        Error::new("a board hangs on a line the robot does not have")
            .at(place())
            .got(of.line.clone())
    })?;
    let profile = profiles::board(&of.board).map_err(|e| Error::new(e.to_string()).at(place()))?;
    let board = InertialBoard::new(&profile, of.axes);
    Ok(Some(BaseSensor { name: of.board.clone(), line, id: of.id, board }))
}

fn actuator(joint: &profiles::Joint, speed: CanSpeed) -> Result<Actuator, Error> {
    let profile = profiles::actuator(&joint.servo).map_err(|e| Error::new(e.to_string()))?;
    let placing = Placing {
        id: joint.id,
        answer_id: joint.answer_id.unwrap_or(0),
        kp_nm_rad: joint.kp_nm_rad.unwrap_or(0.0),
        kd_nm_s_rad: joint.kd_nm_s_rad.unwrap_or(0.0),
        timeout_configured_s: joint.timeout_configured_s,
    };
    Actuator::new(profile, placing, speed).map_err(Error::new)
}

/// A line of the robot.
#[derive(Clone, Debug)]
pub struct Line {
    /// Its name in the robot file.
    pub name: String,
    /// Serial or CAN, and how fast.
    pub kind: LineKind,
}

impl Line {
    /// Bits per second; of a CAN line those outside fast payloads.
    #[must_use]
    pub const fn bits_per_s(&self) -> u32 {
        match self.kind {
            LineKind::Serial { baud_bps } => baud_bps,
            LineKind::Can(speed) => speed.bitrate_bps,
        }
    }
}

/// The inertial sensor in a robot's base.
#[derive(Clone, Debug)]
pub struct BaseSensor {
    /// Profile of its board.
    pub name: String,
    /// Index of its line in [`Robot::lines`].
    pub line: usize,
    /// Bus ID.
    pub id: u8,
    /// How it is read.
    pub board: InertialBoard,
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
    /// What its base feels with, if it has such a thing on its lines.
    pub base_sensor: Option<BaseSensor>,
    /// The file itself.
    pub file: profiles::Robot,
}

impl Robot {
    /// Resolves a validated robot file.
    ///
    /// # Errors
    /// A servo without the registers that playing needs; limits outside the drive's travel.
    pub fn new(file: profiles::Robot) -> Result<Self, Error> {
        let lines: Vec<Line> = file
            .lines
            .iter()
            .map(|line| Line { name: line.name.clone(), kind: line.kind })
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
        let base_sensor = base_sensor(&file, &lines)?;
        Ok(Self { name: file.name.clone(), joints, lines, base_sensor, file })
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

    /// Name of the line of the joint of this name.
    #[must_use]
    pub fn line_of(&self, joint: &str) -> Option<String> {
        let joint = self.joints.iter().find(|of| of.name == joint)?;
        self.lines.get(joint.line).map(|line| line.name.clone())
    }

    /// Names of all joints.
    #[must_use]
    pub fn joint_names(&self) -> Vec<String> {
        self.joints.iter().map(|joint| joint.name.clone()).collect()
    }
}
