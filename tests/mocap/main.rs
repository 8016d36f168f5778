//! Files of motion capture: read, mended, held against others, and what is made of them.
//!
//! One program: what links once is built sooner, and whatever computes has both processors to the end.

#[path = "../aloud/mod.rs"]
mod aloud;
#[path = "../c3d_made/mod.rs"]
mod c3d_made;
#[path = "../common/mod.rs"]
mod common;
#[path = "../c3d_others/dumped.rs"]
mod dumped;
#[path = "../c3d_others/judged.rs"]
mod judged;
#[path = "../program/mod.rs"]
mod program;
#[path = "../python/mod.rs"]
mod python;

use common::captured;

mod acclaim;
mod bvh_captures;
mod bvh_conventions;
mod bvh_frames;
mod bvh_mapping;
mod bvh_reader;
mod bvh_retarget;
mod c3d_against_others;
mod c3d_reader;
mod captures;
mod clean;
mod fit;
mod force_plates;
mod inputs_apart;
mod malformed;
mod marker_files;
mod measured_force;
mod opensim_files;
