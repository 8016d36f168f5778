//! Any text as an Acclaim skeleton and as a motion of one: no panic, every bound kept.

use crate::shared::keeps_bounds;
use gaitway::mocap::acclaim::{parse, parse_skeleton};
use gaitway::mocap::bvh::{Bvh, MAX_JOINTS};
use gaitway::mocap::clip::Clip;

const SKELETON: &[u8] = include_bytes!("../../seeds/acclaim/skeleton.asf");
const MOTION: &[u8] = include_bytes!("../../seeds/acclaim/motion.amc");

fn check(bvh: Bvh) {
    keeps_bounds(&bvh);
    let _ = Clip::new(bvh, None);
}

pub fn fuzz(input: &[u8]) {
    let known = parse_skeleton(SKELETON).expect("a skeleton");
    if let Ok((bvh, _)) = parse(input, &known, None) {
        check(bvh);
    }
    if let Ok(skeleton) = parse_skeleton(input) {
        assert!(skeleton.joints().len() <= MAX_JOINTS);
        if let Ok((bvh, _)) = parse(MOTION, &skeleton, None) {
            check(bvh);
        }
    }
}
