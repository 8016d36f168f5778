//! Any bytes as a capture (BVH) and as a table of joint angles (CSV): no panic, every bound kept,
//! and a capture that is read is read the same after it was written.

use crate::shared::Scratch;
use gaitway::job::source::joints;
use gaitway::mocap::bvh::{self, Bvh, MAX_DEPTH, MAX_JOINTS, MAX_POSES};
use gaitway::mocap::clip::Clip;
use gaitway::mocap::mapping::Mapping;

fn capture(text: &[u8]) {
    let Ok(bvh) = bvh::parse(text) else { return };
    let (joints, poses) = (bvh.joints.len(), bvh.pose_count());
    assert!((1..=MAX_JOINTS).contains(&joints) && (1..=MAX_POSES).contains(&poses));
    assert_eq!(bvh.values.len(), poses * bvh.channel_count());
    assert!(bvh.values.iter().all(|value| value.is_finite()) && bvh.time_step_s > 0.0);
    for (index, joint) in bvh.joints.iter().enumerate() {
        assert!(joint.parent.is_none_or(|parent| parent < index) && joint.offset.is_finite());
    }
    let depth = |mut joint: usize| {
        let mut depth = 1;
        while let Some(parent) = bvh.joints[joint].parent {
            (joint, depth) = (parent, depth + 1);
        }
        depth
    };
    assert!((0..joints).all(|joint| depth(joint) <= MAX_DEPTH));
    let again = bvh::parse(bvh::write(&bvh).as_bytes()).expect("what was written");
    assert_eq!(plain(again), plain(bvh.clone()));
    let _ = Mapping::find(&bvh, None);
    if let Ok(clip) = Clip::new(bvh, None) {
        let _ = gaitway::mocap::anatomy::capture(&clip);
    }
}

/// What a writer may leave to a reader: children stand behind one another in any order.
fn plain(mut bvh: Bvh) -> Bvh {
    for joint in &mut bvh.joints {
        // A name's blanks and what is no text are the reader's.
        joint.name = joint.name.split_whitespace().collect();
    }
    bvh
}

pub fn fuzz(input: &[u8]) {
    capture(input);
    let scratch = Scratch::new("motions");
    let path = scratch.write("table.csv", input);
    let _ = joints::read(&path, &["a".to_owned(), "b".to_owned()]);
}
