//! The BVH reader: what it accepts, what it refuses, and that it never does anything else.

use gaitway::error::Error;
use gaitway::mocap::bvh::{self, Axis, Bvh, Channel};
use glam::DVec3;
use proptest::prelude::*;

const SMALL: &str = "HIERARCHY
ROOT Hips
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Left Leg
  {
    OFFSET 0 -4.5 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {
      OFFSET 0 -4 0
    }
  }
}
MOTION
Frames: 2
Frame Time: .0083333
1 2 3 4 5 6 7 8 9
-1 2.5 +3 4e1 5E-2 .6 7. 8 -9
";

fn parse(text: &str) -> Result<Bvh, Error> {
    bvh::parse(text.as_bytes())
}

fn refusal(text: &str) -> String {
    parse(text).expect_err("the text is malformed").to_string()
}

#[test]
fn a_small_file_is_read_as_written() {
    let bvh = parse(SMALL).unwrap();
    assert_eq!(bvh.joints.len(), 2);
    assert_eq!(bvh.joints[1].name, "Left Leg");
    assert_eq!(bvh.joints[1].parent, Some(0));
    assert_eq!(bvh.joints[1].offset, DVec3::new(0.0, -4.5, 0.0));
    assert_eq!(bvh.joints[1].first_channel, 6);
    assert_eq!(bvh.joints[1].channels[1], Channel::Rotation(Axis::X));
    assert_eq!(bvh.joints[1].ends, [DVec3::new(0.0, -4.0, 0.0)]);
    assert_eq!((bvh.pose_count(), bvh.channel_count()), (2, 9));
    assert_eq!(bvh.time_step_s, 0.0083333);
    assert_eq!(bvh.pose(1), [-1.0, 2.5, 3.0, 40.0, 0.05, 0.6, 7.0, 8.0, -9.0]);
}

#[test]
fn line_ends_tabs_case_and_byte_order_marks_do_not_matter() {
    let plain = parse(SMALL).unwrap();
    for other in [
        SMALL.replace('\n', "\r\n"),
        SMALL.replace('\n', "\r"),
        SMALL.replace("  ", "\t"),
        SMALL.replace("Frames: 2", "Frames:\t2").replace("Frame Time:", "frame  time :"),
        SMALL.replace("HIERARCHY", "\u{feff}hierarchy").replace("Zrotation", "zRotation"),
        SMALL.replace("Leg\n  {", "Leg {").replace("End Site\n    {", "End Site {"),
        SMALL.replace("Frames: 2", "Frames: 2.0"),
        SMALL.trim_end().to_owned(),
        format!("{SMALL}\n \t\r\n"),
    ] {
        assert_eq!(parse(&other).unwrap(), plain, "{other}");
    }
}

#[test]
fn leaves_need_no_end_site_and_rotations_may_come_first() {
    let text = "HIERARCHY ROOT a\n{ OFFSET 0 0 0 CHANNELS 4 Yrotation Xposition Zrotation Xrotation
        JOINT b\n{ OFFSET 1 0 0 } JOINT c\n{ OFFSET 2 0 0 CHANNELS 1 Xrotation } }
        MOTION\nFrames: 1\nFrame Time: 0.1\n1 2 3 4 5\n";
    let bvh = parse(text).unwrap();
    assert_eq!(bvh.joints[0].channels[1], Channel::Position(Axis::X));
    assert_eq!(bvh.joints[1].channels, []);
    assert_eq!(bvh.joints[2].first_channel, 4);
    assert_eq!(bvh.pose(0), [1.0, 2.0, 3.0, 4.0, 5.0]);
}

#[test]
fn a_number_that_is_not_one_is_refused_with_line_and_joint() {
    for bad in ["nan", "NaN", "inf", "-Infinity", "1e999", "0,5", "--1", "1e10", "x"] {
        let message = refusal(&SMALL.replace("7. 8 -9", &format!("7. {bad} -9")));
        for part in ["line 20", "pose 2", "joint Left Leg", "Xrotation", bad] {
            assert!(message.contains(part), "{message}");
        }
    }
    let message = refusal(&SMALL.replace("0 -4.5 0", "0 nan 0"));
    assert!(message.contains("line 8") && message.contains("Left Leg"), "{message}");
}

#[test]
fn every_malformed_header_is_refused_where_it_is_wrong() {
    let cases = [
        ("HIERARCHY", "HIERARCHIE", "line 1"),
        ("ROOT Hips", "JOINT Hips", "line 2"),
        ("ROOT Hips", "ROOT", "line 2"),
        ("  OFFSET 0 0 0\n", "", "OFFSET"),
        ("OFFSET 0 -4.5 0", "OFFSET 0 -4.5", "line 9"),
        ("CHANNELS 3 Z", "CHANNELS 4 Z", "line 10"),
        ("CHANNELS 3 Z", "CHANNELS 2 Z", "line 9"),
        ("CHANNELS 3 Z", "CHANNELS 99999999999 Z", "line 9"),
        ("CHANNELS 3 Z", "CHANNELS -3 Z", "line 9"),
        ("CHANNELS 6 X", "CHANNELS 6 W", "line 5"),
        ("Xposition Y", "Yposition Y", "listed twice"),
        ("    End Site", "    Ende", "line 10"),
        ("MOTION", "}\nMOTION", "line 16"),
        ("Frames: 2", "Frames: 0", "line 17"),
        ("Frames: 2", "Frames: 2000001", "line 17"),
        ("Frames: 2", "Frames: 1e300", "line 17"),
        ("Frames: 2", "Frames: -1", "line 17"),
        ("Frames: 2", "Frames: 1.5", "line 17"),
        ("Frames: 2", "Poses: 2", "line 17"),
        ("Time: .0083333", "Time: 0", "line 18"),
        ("Time: .0083333", "Time: nan", "line 18"),
        ("Time: .0083333", "Time: -0.1", "line 18"),
    ];
    for (from, to, part) in cases {
        let message = refusal(&SMALL.replace(from, to));
        assert!(message.contains(part), "{from} -> {to}: {message}");
    }
}

#[test]
fn a_lost_or_extra_value_is_found_by_its_line() {
    let message = refusal(&SMALL.replace("1 2 3 4 5 6 7 8 9\n", "1 2 3 4 5 6 7 8\n"));
    assert!(message.contains("line 20") && message.contains("pose 1"), "{message}");
    let message = refusal(&SMALL.replace("1 2 3 4 5 6 7 8 9\n", "1 2 3 4 5 6 7 8 9 10\n"));
    assert!(message.contains("line 19") && message.contains("pose 1"), "{message}");
    let message = refusal(&format!("{SMALL}1 2 3 4 5 6 7 8 9\n"));
    assert!(message.contains("line 21") && message.contains("Frames"), "{message}");
}

#[test]
fn missing_poses_are_counted() {
    let message = refusal(&SMALL.replace("Frames: 2", "Frames: 1000000"));
    assert!(message.contains("claims 1000000 poses and holds 2"), "{message}");
    let cut = SMALL.find(" 5E-2").unwrap();
    let message = refusal(&SMALL[..cut]);
    assert!(message.contains("claims 2 poses and holds 1"), "{message}");
    assert!(message.contains("4 of 9 values"), "{message}");
}

#[test]
fn a_file_cut_off_at_any_byte_is_refused() {
    // Up to the first digit of the last value the loss can be seen.
    let last_value = SMALL.rfind("-9").unwrap() + 2;
    for end in 0..last_value {
        let result = bvh::parse(&SMALL.as_bytes()[..end]);
        assert!(result.is_err(), "cut at byte {end}");
    }
    assert!(bvh::parse(&SMALL.as_bytes()[..last_value]).is_ok());
}

#[test]
fn bounds_on_joints_and_depth_hold() {
    let nested = |depth: usize| {
        let mut text = "HIERARCHY\nROOT j\n{ OFFSET 0 0 0 CHANNELS 1 Xrotation\n".to_owned();
        for _ in 1..depth {
            text += "JOINT j\n{ OFFSET 0 0 0\n";
        }
        text + &"}".repeat(depth) + "\nMOTION\nFrames: 1\nFrame Time: 1\n0\n"
    };
    assert!(parse(&nested(bvh::MAX_DEPTH)).is_ok());
    assert!(refusal(&nested(bvh::MAX_DEPTH + 1)).contains("deep"));
    let wide = |joints: usize| {
        let child = "JOINT j\n{ OFFSET 0 0 0 }\n";
        "HIERARCHY\nROOT j\n{ OFFSET 0 0 0 CHANNELS 1 Xrotation\n".to_owned()
            + &child.repeat(joints - 1)
            + "}\nMOTION\nFrames: 1\nFrame Time: 1\n0\n"
    };
    assert!(parse(&wide(bvh::MAX_JOINTS)).is_ok());
    assert!(refusal(&wide(bvh::MAX_JOINTS + 1)).contains("too many joints"));
}

#[test]
fn a_word_without_end_is_refused() {
    let text = format!("HIERARCHY\nROOT {}\n", "x".repeat(1 << 20));
    assert!(refusal(&text).contains("too long"));
}

#[test]
fn a_file_that_does_not_exist_is_named() {
    let error = bvh::read(std::path::Path::new("/no/such/walk.bvh")).unwrap_err();
    assert!(error.to_string().contains("/no/such/walk.bvh"), "{error}");
}

#[test]
fn what_is_written_reads_back_equal() {
    let bvh = parse(SMALL).unwrap();
    assert_eq!(parse(&bvh::write(&bvh)).unwrap(), bvh);
}

proptest! {
    #[test]
    fn any_bytes_give_a_value_or_an_error(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        let _ = bvh::parse(&bytes);
    }

    #[test]
    fn a_damaged_file_never_panics(
        at in 0..SMALL.len(),
        byte in any::<u8>(),
        cut in 0..SMALL.len(),
    ) {
        let mut bytes = SMALL.as_bytes().to_vec();
        bytes[at] = byte;
        let _ = bvh::parse(&bytes);
        bytes.remove(cut);
        let _ = bvh::parse(&bytes);
    }

    #[test]
    fn numbers_survive_writing_and_reading(
        values in prop::collection::vec(-1e9..1e9f64, 18),
        step in 1e-5..10.0f64,
    ) {
        let mut bvh = parse(SMALL).unwrap();
        bvh.values = values;
        bvh.time_step_s = step;
        prop_assert_eq!(parse(&bvh::write(&bvh)).unwrap(), bvh);
    }
}
