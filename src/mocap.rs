//! Human motion capture: files, skeletons, and the way from a recorded person to a robot's joints.
//!
//! [`bvh`] reads and writes files and interprets nothing. [`skeleton`] settles what the channels
//! mean, [`mapping`] which joint is which segment of the body, [`clip`] unit, axes and rest pose.
//! [`anatomy`] turns bones into segments whose orientation means the same in every capture, and
//! [`retarget`] puts these on a robot's joints.

use crate::error::Error;
use anatomy::Capture;
use clip::Clip;
use mapping::MappingFile;
use std::path::Path;

pub mod anatomy;
pub mod bvh;
pub mod clip;
pub mod export;
pub mod humanoid;
pub mod landmarks;
pub mod mapping;
pub mod page;
pub mod retarget;
pub mod skeleton;

/// Reads a BVH file as a motion of body segments. `mapping` names joints where the search for them
/// needs help.
///
/// # Errors
/// If the file cannot be read, breaks the format, or shows no person in motion.
pub fn read_bvh(path: &Path, mapping: Option<&MappingFile>) -> Result<Capture, Error> {
    let bvh = bvh::read(path)?;
    let capture = Clip::new(bvh, mapping).and_then(|clip| anatomy::capture(&clip));
    capture.map_err(|error| match error.place {
        None => error.at(path.display().to_string()),
        Some(_) => error,
    })
}
