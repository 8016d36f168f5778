//! Gaitway: from human motion to small humanoid robots.
//!
//! The map: [`wire`] turns bytes into packets and knows no clock; [`port`] moves bytes and is the
//! only place that waits; [`bus`] asks one question at a time on a shared line; [`device`] speaks
//! SI units to one device; [`robot`] names joints on devices; [`rig`] opens robots and lines wherever
//! they are. [`motion`], [`actionlet`], [`body`], [`action`] and [`mocap`] are mathematics and know no
//! hardware; [`guard`] and [`control`] are the last gate and the loop. [`capture`] and [`session`] make
//! samples and trials of what sensors say, [`calibration`] is what was measured on one robot,
//! [`recording`] and [`plot`] are the files a run leaves. [`job`] is what is done with all of it, from an
//! order to a typed report; [`cli`] is what a person types.

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
pub mod job;
pub mod mocap;
pub mod motion;
pub mod plot;
pub mod port;
pub mod recording;
pub mod rig;
pub mod robot;
pub mod sensing;
pub mod session;
pub mod time;
pub mod toml_text;
pub mod units;
pub mod wire;
