//! The virtual servos against the makers' published bytes, timings and rules.

mod bench;
mod board;
mod can;
mod can_dialects;
mod can_line;
mod control;
mod door;
mod dynamixel1;
mod dynamixel2;
mod faults;
mod feetech;
mod imu;
mod line;
mod mixed;
mod modes;
mod motion;
mod properties;
mod protections;
mod referee;
mod scene;
mod script;
mod weight;
