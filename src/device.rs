//! One device in SI units: a profile's registers and what is read and written in every cycle; what
//! a profile makes of a sensor's stream.

pub mod actuator;
pub mod coded;
pub mod feedback;
pub mod inertial;
pub mod parameter;
pub mod registers;
pub mod sensor;

pub use actuator::Actuator;
pub use feedback::{FeedbackBlock, Health, HealthBlock, JointState};
pub use inertial::{Inertial, InertialBoard};
pub use registers::{Model, RegisterError};
pub use sensor::SensorSample;
