//! The walk that ships with gaitway is what its generator makes, and reads back as the same body.

use gaitway::body::walk::Walk;
use gaitway::body::{Proportions, Segment, SegmentPose};
use gaitway::mocap::clip::Clip;
use gaitway::mocap::{anatomy, bvh, export};

const SHIPPED: &str = include_str!("../motions/walk.bvh");
const RATE_HZ: f64 = 60.0;

fn synthesised() -> (Proportions, Vec<SegmentPose>) {
    let body = Proportions::of_stature(1.75).expect("a stature");
    let walk = Walk { rate_hz: RATE_HZ, ..Walk::default() };
    let samples = walk.synthesise(&body).expect("a walk");
    (body, samples.iter().map(|sample| sample.to_pose()).collect())
}

#[test]
fn the_file_is_what_the_generator_makes() {
    let (body, poses) = synthesised();
    let text = bvh::write(&export::bvh_of(&poses, &body, RATE_HZ));
    assert!(text == SHIPPED, "run `cargo run --example make_walk > motions/walk.bvh`");
}

#[test]
fn reading_it_back_gives_the_segments_that_were_written() {
    let (_, poses) = synthesised();
    let file = bvh::parse(SHIPPED.as_bytes()).expect("a BVH file");
    let clip = Clip::new(file, None).expect("a person");
    let capture = anatomy::capture(&clip).expect("a body");
    assert!((capture.stature_m - 1.75).abs() < 0.1, "stature {} m", capture.stature_m);
    let dropped = poses.len() - capture.poses.len();
    assert!(dropped <= 1, "{dropped} poses dropped");
    for segment in Segment::ALL {
        let off = |(read, written): (&SegmentPose, &SegmentPose)| {
            let relative = |pose: &SegmentPose| {
                pose.orientation[Segment::Pelvis.index()].inverse()
                    * pose.orientation[segment.index()]
            };
            relative(read).angle_between(relative(written)).to_degrees()
        };
        let worst = capture.poses.iter().zip(&poses[dropped..]).map(off).fold(0.0, f64::max);
        assert!(worst < 3.0, "{segment:?} is {worst:.2} deg off");
    }
}
