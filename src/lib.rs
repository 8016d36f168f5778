//! Gaitway: from human motion to small humanoid robots.
//!
//! The map: [`wire`] turns bytes into packets and knows no clock; [`port`] moves bytes and is the
//! only place that waits; [`bus`] asks one question at a time on a shared line; [`device`] speaks
//! SI units to one device; [`robot`] names joints on devices. [`motion`], [`actionlet`], [`body`],
//! [`action`]
//! and [`mocap`] are mathematics and know no hardware. [`control`] is the loop and its last gate,
//! [`recording`] the files it leaves, [`cli`] what a person types.

pub mod action;
pub mod actionlet;
pub mod body;
pub mod bus;
pub mod calibration;
pub mod capture;
pub mod cli;
pub mod control;
pub mod device;
pub mod draft;
pub mod error;
pub mod guard;
pub mod mocap;
pub mod motion;
pub mod plot;
pub mod port;
pub mod recording;
pub mod rig;
pub mod robot;
pub mod session;
pub mod time;
pub mod toml_text;
pub mod units;
pub mod wire;
