//! Any bytes as a capture (BVH) and as a table of joint angles (CSV): no panic, every bound kept,
//! and a capture that is read is read the same after it was written.

use crate::shared::{Scratch, keeps_bounds};
use gaitway::job::source::joints;
use gaitway::mocap::bvh::{self, Bvh, MAX_DEPTH};
use gaitway::mocap::clip::Clip;
use gaitway::mocap::mapping::Mapping;

fn capture(text: &[u8]) {
    let Ok(bvh) = bvh::parse(text) else { return };
    keeps_bounds(&bvh);
    let depth = |mut joint: usize| {
        let mut depth = 1;
        while let Some(parent) = bvh.joints[joint].parent {
            (joint, depth) = (parent, depth + 1);
        }
        depth
    };
    assert!((0..bvh.joints.len()).all(|joint| depth(joint) <= MAX_DEPTH));
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
