//! Human motion capture: files, skeletons, and the way from a recorded person to a robot's joints.

pub mod anatomy;
pub mod bvh;
pub mod clip;
pub mod landmarks;
pub mod mapping;
pub mod skeleton;
