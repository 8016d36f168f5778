//! Human motion capture: files, skeletons, and the way from a recorded person to a robot's joints.

pub mod bvh;
