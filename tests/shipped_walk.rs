//! The BVH file of the shipped walk is what the action makes, and reads back as the same body.

use gaitway::action::vocabulary;
use gaitway::body::{Proportions, Segment, SegmentPose};
use gaitway::mocap::clip::Clip;
use gaitway::mocap::{anatomy, bvh, export};

const SHIPPED: &str = include_str!("../motions/walk.bvh");
const RATE_HZ: f64 = 60.0;

fn synthesised() -> (Proportions, Vec<SegmentPose>) {
    let body = Proportions::of_stature(1.75).expect("a stature");
    let walk = vocabulary::find("walk").expect("a walk").perform().expect("a motion");
    let poses = walk.poses(&body, RATE_HZ).expect("poses");
    (body, poses)
}

#[test]
fn the_file_is_what_the_action_makes() {
    let (body, poses) = synthesised();
    let text = bvh::write(&export::bvh_of(&poses, &body, RATE_HZ));
    let remedy = "run `gaitway synth walk --rate 60 -o motions/walk.bvh --force`";
    // A unit in the last place is a matter of the platform's sine.
    assert_eq!(text.lines().count(), SHIPPED.lines().count(), "{remedy}");
    for (line, (made, shipped)) in text.lines().zip(SHIPPED.lines()).enumerate() {
        let numbers = |line: &str| -> Vec<Option<f64>> {
            line.split_whitespace().map(|word| word.parse().ok()).collect()
        };
        let near = |(a, b): (&Option<f64>, &Option<f64>)| match (a, b) {
            (Some(a), Some(b)) => (a - b).abs() < 2.5e-4,
            (a, b) => a == b,
        };
        let (made, shipped) = (numbers(made), numbers(shipped));
        let same = made.len() == shipped.len() && made.iter().zip(&shipped).all(near);
        assert!(same, "line {}: {remedy}", line + 1);
    }
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
