//! The board with an inertial sensor in a robot's base, among its servos on a line.
//!
//! It stands still and upright unless the robot has weight and was let go; then it feels what the body's first link does.
//! What it measures has no noise and no bias; what is beyond its words stays at their ends.

use super::World;
use crate::SimError;
use crate::body::Felt;
use crate::fault::plan::Place;
use crate::servo::Servo;
use crate::table::Model;
use gaitway_profiles::{BoardImu, Robot, Role, SignedAxis};
use std::sync::Arc;

/// A board, and how it is screwed to the base.
#[derive(Clone)]
pub(super) struct BaseBoard {
    pub name: String,
    pub id: u8,
    pub place: Place,
    imu: BoardImu,
    /// The base's axes as axes of the sensor.
    axes: [SignedAxis; 3],
}

impl BaseBoard {
    /// A vector of the base along the sensor's axes.
    fn turned(&self, of_base: [f64; 3]) -> [f64; 3] {
        let mut of_sensor = [0.0; 3];
        for (axis, value) in self.axes.into_iter().zip(of_base) {
            for (out, share) in of_sensor.iter_mut().zip(axis.unit()) {
                *out += share * value;
            }
        }
        of_sensor
    }
}

impl World {
    /// The board that the robot's file names joins the servos of its line.
    pub(super) fn add_board(&mut self, robot: &Robot) -> Result<(), SimError> {
        let Some(of) = robot.body.as_ref().and_then(|body| body.imu.as_ref()) else {
            return Ok(());
        };
        let wrong = |reason: String| SimError::BadServo {
            joint: "base".to_owned(),
            servo: of.board.clone(),
            reason,
        };
        let profile =
            gaitway_profiles::board(&of.board).map_err(|error| wrong(error.to_string()))?;
        let line = self.lines.iter().position(|line| line.name == of.line);
        let line = line.ok_or_else(|| SimError::UnknownLine(of.line.clone()))?;
        let baud_bps = self.lines[line].baud_bps;
        let baud = profile.baud.iter().find(|baud| baud.bps == baud_bps);
        let baud = baud.ok_or_else(|| wrong("does not know its line's speed".to_owned()))?;
        let mut servo = Servo::new(Arc::new(Model::of_board(&profile)), profile.firmware.min);
        servo.set_up(Role::Id, i64::from(of.id));
        servo.set_up(Role::BaudRate, i64::from(baud.index));
        servo.mark_start();
        let place = Place { line, servo: self.lines[line].servos.len() };
        self.lines[line].servos.push(servo);
        self.board = Some(BaseBoard {
            name: of.board.clone(),
            id: of.id,
            place,
            imu: profile.imu,
            axes: of.axes,
        });
        self.feel(Felt::STILL);
        Ok(())
    }

    /// What the base feels is in the board's registers from now on.
    pub(super) fn feel(&mut self, felt: Felt) {
        let Some(board) = &self.board else { return };
        let servo = &mut self.lines[board.place.line].servos[board.place.servo];
        let spin = board.turned(felt.spin_rad_s).map(f64::to_degrees);
        let acceleration = board.turned(felt.acceleration_g);
        let words = [
            (board.imu.gyroscope, spin, board.imu.gyroscope_deg_s),
            (board.imu.accelerometer, acceleration, board.imu.accelerometer_g),
        ];
        for (first, values, count) in words {
            for (address, value) in (first..).step_by(2).zip(values) {
                servo.measure(address, value / count);
            }
        }
    }
}
