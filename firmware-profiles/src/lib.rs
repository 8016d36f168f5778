//! What each servo, adapter and robot is, as data, with the schema and the validator.
//!
//! The files under `servos/`, `adapters/` and `robots/` are compiled into the crate. A file is
//! validated once; whoever holds a [`Servo`] or a [`Robot`] from here may rely on it.

pub mod schema;

pub use schema::*;
