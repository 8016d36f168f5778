//! Any text as an Acclaim skeleton and as a motion of one: no panic, every bound kept.

use gaitway::mocap::acclaim::{parse, parse_skeleton};
use gaitway::mocap::bvh::{Bvh, MAX_JOINTS, MAX_POSES};
use gaitway::mocap::clip::Clip;

const SKELETON: &[u8] = include_bytes!("../../seeds/acclaim/skeleton.asf");
const MOTION: &[u8] = include_bytes!("../../seeds/acclaim/motion.amc");

fn check(bvh: Bvh) {
    let (joints, poses) = (bvh.joints.len(), bvh.pose_count());
    assert!((1..=MAX_JOINTS).contains(&joints) && (1..=MAX_POSES).contains(&poses));
    assert_eq!(bvh.values.len(), poses * bvh.channel_count());
    assert!(bvh.values.iter().all(|value| value.is_finite()) && bvh.time_step_s > 0.0);
    for (index, joint) in bvh.joints.iter().enumerate() {
        assert!(joint.parent.is_none_or(|parent| parent < index) && joint.offset.is_finite());
    }
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
