//! Writes the walk that ships with gaitway to stdout: synthesised, not captured.
//!
//! `cargo run --example make_walk > motions/walk.bvh`

use gaitway::body::Proportions;
use gaitway::body::walk::Walk;
use gaitway::mocap::{bvh, export};

fn main() -> Result<(), gaitway::error::Error> {
    let body = Proportions::of_stature(1.75)?;
    let walk = Walk { rate_hz: 60.0, ..Walk::default() };
    let poses: Vec<_> = walk.synthesise(&body)?.iter().map(|sample| sample.to_pose()).collect();
    print!("{}", bvh::write(&export::bvh_of(&poses, &body, walk.rate_hz)));
    Ok(())
}
