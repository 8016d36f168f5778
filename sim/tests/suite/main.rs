//! The virtual servos against the makers' published bytes, timings and rules.

mod door;
mod dynamixel2;
mod faults;
mod feetech;
mod line;
mod motion;
mod properties;
mod referee;
mod scene;
