//! What is doubted of bodies and sensors that are as they should be: captured people, and one who wore sensors.

#[path = "captured/mod.rs"]
mod captured;

use gaitway::body::worn::doubt::{DoubtChange, Doubts};
use gaitway::body::{Segment, SegmentPose};
use gaitway::capture::{Mode, Orientation, Stuck};
use gaitway::device::sensor::SensorSample;
use gaitway::mocap::{self, files::CaptureOptions};
use gaitway::time::Instant;
use glam::{DQuat, DVec3};

const RATE_HZ: f64 = 100.0;

/// Looks at a body from moment to moment; who is doubted, and from when on.
fn doubted(poses: impl Iterator<Item = SegmentPose>, worn: [bool; 13]) -> Vec<(f64, DoubtChange)> {
    let mut doubts = Doubts::default();
    let mut found = Vec::new();
    for (n, pose) in poses.enumerate() {
        let taken = Instant::from_nanos(n as u64 * 10_000_000 + 1);
        for segment in Segment::ALL.into_iter().filter(|segment| worn[segment.index()]) {
            doubts.hear(segment, pose.orientation[segment.index()], taken, false);
        }
        let new = doubts.judge(1.0 / RATE_HZ);
        doubts.look(&pose, &worn);
        found.extend(new.into_iter().map(|change| (n as f64 / RATE_HZ, change)));
    }
    found.retain(|(_, change)| change.doubted.is_some());
    found
}

/// Everything that the captures show, dancing, fighting and handsprings as well, some of which nobody cleaned.
#[test]
fn of_captured_people_hardly_anything_is_doubted() {
    let Some(folder) = captured::captured("mocap/bvh") else { return };
    let (mut seconds, mut files, mut clean, mut skipped) = (0.0, 0, 0, 0);
    let mut all = Vec::new();
    for path in captured::bvh_files(&folder) {
        let read = mocap::files::read(&path, &CaptureOptions::default());
        let clip = read.and_then(|file| mocap::clip::Clip::new(file.bvh, None));
        let Ok(capture) = clip.and_then(|clip| mocap::anatomy::capture(&clip)) else {
            skipped += 1;
            continue;
        };
        let length_s = capture.poses.len() as f64 / capture.rate_hz;
        let count = (length_s * RATE_HZ) as u32;
        let poses = (0..count).map(|n| capture.at(f64::from(n) / RATE_HZ));
        let found = doubted(poses, capture.tracked);
        for (at_s, change) in &found {
            eprintln!("{} at {at_s:.2} s: {}", path.display(), change.words());
        }
        (seconds, files) = (seconds + length_s, files + 1);
        clean += usize::from(found.is_empty());
        all.extend(found);
    }
    eprintln!(
        "{} doubts in {:.0} s of {files} captures, {clean} without any, {skipped} skipped",
        all.len(),
        seconds
    );
    assert!(files >= 60, "{files}");
    assert!(clean * 100 >= files * 85, "{clean} of {files}");
    assert!(all.len() as f64 <= 4.0 * seconds / 60.0, "{} in {seconds} s", all.len());
}

/// A minute of somebody who stands, sits and walks, with thirteen real sensors: what each measured becomes its orientation, and none
/// turns or is jolted as nobody can, nor stands still.
#[test]
fn of_somebody_who_wears_sensors_nothing_is_doubted() {
    let Some(folder) = captured::captured("imu/qmt_full_body") else { return };
    let bytes = std::fs::read(folder.join("full_body_16imu_100hz_t40-100s.f32")).expect("a file");
    let (values, rest) = bytes.as_chunks::<4>();
    assert!(rest.is_empty());
    let values: Vec<f64> =
        values.iter().map(|bytes| f64::from(f32::from_le_bytes(*bytes))).collect();
    // As its description lists them; the lower back and the hands are segments of their own there, and none here.
    use Segment as S;
    let order = [
        Some(S::LeftFoot),
        Some(S::LeftShank),
        Some(S::LeftThigh),
        Some(S::RightFoot),
        Some(S::RightShank),
        Some(S::RightThigh),
        Some(S::Pelvis),
        None,
        Some(S::Torso),
        Some(S::Head),
        None,
        Some(S::LeftForearm),
        Some(S::LeftUpperArm),
        None,
        Some(S::RightForearm),
        Some(S::RightUpperArm),
    ];
    let mut filters: Vec<Orientation> =
        order.iter().map(|_| Orientation::new(0.01, Mode::SixAxes)).collect();
    let mut stuck = vec![Stuck::default(); order.len()];
    let mut doubts = Doubts::default();
    let (mut rows, mut found) = (0_u64, Vec::new());
    for row in values.chunks_exact(6 * order.len()) {
        let taken = Instant::from_nanos(rows * 10_000_000 + 1);
        rows += 1;
        for ((said, segment), (filter, stuck)) in
            row.chunks_exact(6).zip(order).zip(filters.iter_mut().zip(&mut stuck))
        {
            let (rate, acceleration) =
                (DVec3::from_slice(&said[..3]), DVec3::from_slice(&said[3..]));
            let fused = filter.take(0.01, Some(rate), Some(acceleration), None).expect("measured");
            let sample = SensorSample {
                angular_rate_rad_s: Some(rate),
                acceleration_m_s2: Some(acceleration),
                ..SensorSample::default()
            };
            let is_stuck = stuck.take(&sample, taken);
            if let Some(segment) = segment.filter(|_| fused.settled) {
                doubts.hear(segment, fused.orientation, taken, is_stuck);
            }
        }
        found.extend(doubts.judge(0.01));
    }
    assert_eq!(rows, 6000);
    assert!(found.is_empty(), "{found:?}");
}

/// What a look at every segment and every joint takes is printed, and held by nothing: it depends on the machine.
#[test]
fn limbs_that_swing_are_not_doubted_and_what_a_look_takes_is_printed() {
    let mut doubts = Doubts::default();
    let mut pose = SegmentPose { root_m: glam::DVec3::ZERO, orientation: [DQuat::IDENTITY; 13] };
    let began = std::time::Instant::now();
    let mut changes = 0;
    for n in 0..20_000_u64 {
        let taken = Instant::from_nanos(n * 10_000_000 + 1);
        for segment in Segment::ALL {
            let turned = DQuat::from_rotation_y(0.3 * (n as f64 / 30.0).sin());
            pose.orientation[segment.index()] = turned;
            doubts.hear(segment, turned, taken, false);
        }
        changes += doubts.judge(0.01).len();
        doubts.look(&pose, &[true; 13]);
    }
    eprintln!("{:.4} ms a cycle", began.elapsed().as_secs_f64() * 1e3 / 20_000.0);
    assert_eq!(changes, 0);
}
