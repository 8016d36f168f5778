//! Human motion capture: files, skeletons, and the way from a recorded person to a robot's joints.
//!
//! [`bvh`] reads and writes files and interprets nothing, and what [`acclaim`] reads becomes the same; [`files`] tells
//! them apart. [`skeleton`] settles what the channels
//! mean, [`mapping`] which joint is which segment of the body, [`clip`] unit, axes and rest pose.
//! [`anatomy`] turns bones into segments whose orientation means the same in every capture,
//! [`siblings`] does so with the other captures of a skeleton at hand ([`bones`]), and [`retarget`]
//! puts segments on a robot's joints.
//!
//! [`markers`] are what optical systems record before there is a skeleton: [`c3d`], [`trc`], [`csm`] and tables
//! ([`marker_table`]), told apart by [`marker_files`]. [`plates`] make forces of what force plates recorded beside
//! them, and [`plug_in_gait`] reads the bones that a model of the laboratory's has put among them.
//! [`opensim`] reads that program's tables of joint angles.

use crate::error::Error;
use anatomy::Capture;
use files::CaptureOptions;
use mapping::MappingFile;
use std::path::Path;

pub mod acclaim;
pub mod anatomy;
pub mod bones;
pub mod bvh;
pub mod c3d;
pub mod clip;
pub mod csm;
mod even_times;
pub mod export;
pub mod files;
pub mod fit;
pub mod humanoid;
pub mod landmarks;
pub mod mapping;
pub mod marker_files;
pub mod marker_table;
pub mod markers;
mod opened;
pub mod opensim;
pub mod parameters;
pub mod plates;
pub mod plug_in_gait;
pub mod retarget;
pub mod scene;
pub mod siblings;
pub mod skeleton;
pub mod trc;

/// Reads a BVH file as a motion of body segments. `mapping` names joints where the search for them
/// needs help.
///
/// # Errors
/// If the file cannot be read, breaks the format, or shows no person in motion.
pub fn read_bvh(path: &Path, mapping: Option<&MappingFile>) -> Result<Capture, Error> {
    Ok(siblings::read(path, mapping, &CaptureOptions::default())?.capture())
}
