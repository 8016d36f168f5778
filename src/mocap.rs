//! Human motion capture: files, skeletons, and the way from a recorded person to a robot's joints.
//!
//! [`bvh`] reads and writes files and interprets nothing. [`skeleton`] settles what the channels
//! mean, [`mapping`] which joint is which segment of the body, [`clip`] unit, axes and rest pose.
//! [`anatomy`] turns bones into segments whose orientation means the same in every capture,
//! [`siblings`] does so with the other captures of a skeleton at hand ([`bones`]), and [`retarget`]
//! puts segments on a robot's joints.
//!
//! [`markers`] are what optical systems record before there is a skeleton: [`c3d`].

use crate::error::Error;
use anatomy::Capture;
use mapping::MappingFile;
use std::path::Path;

pub mod anatomy;
pub mod bones;
pub mod bvh;
pub mod c3d;
pub mod clip;
pub mod export;
pub mod humanoid;
pub mod landmarks;
pub mod mapping;
pub mod markers;
pub mod page;
pub mod parameters;
pub mod retarget;
pub mod siblings;
pub mod skeleton;

/// Reads a BVH file as a motion of body segments. `mapping` names joints where the search for them
/// needs help.
///
/// # Errors
/// If the file cannot be read, breaks the format, or shows no person in motion.
pub fn read_bvh(path: &Path, mapping: Option<&MappingFile>) -> Result<Capture, Error> {
    Ok(siblings::read(path, mapping)?.capture())
}
