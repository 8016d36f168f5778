//! One device in SI units: a profile's registers and what is read and written in every cycle.

pub mod coded;
pub mod feedback;
pub mod registers;

pub use feedback::{FeedbackBlock, Health, HealthBlock, JointState};
pub use registers::{Model, RegisterError};
