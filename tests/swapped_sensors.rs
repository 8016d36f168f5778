//! Swapped sensors of arms and legs are named by a walk, and a walk of sensors that are where they belong names none.

mod aloud;

use aloud::aloud;
use gaitway::body::worn::swaps::{SwapWatch, swaps_in_walk};
use gaitway::body::{Dof, JointAngles, Segment, SegmentPose};
use gaitway::job::source::body_motion;
use gaitway::mocap::anatomy::Capture;
use glam::{DQuat, DVec3};
use std::path::{Path, PathBuf};

use Segment as S;

/// What changes places, and what must be named.
const SWAPS: [(&[(S, S)], &str); 10] = [
    (&[(S::LeftShank, S::RightShank)], "sensors of the two shanks"),
    (&[(S::LeftThigh, S::RightThigh)], "sensors of the two thighs"),
    (&[(S::LeftFoot, S::RightFoot)], "sensors of the two feet"),
    (&[(S::LeftThigh, S::LeftShank)], "left thigh and the left shank"),
    (&[(S::RightThigh, S::RightShank)], "right thigh and the right shank"),
    (&[(S::LeftUpperArm, S::RightUpperArm)], "sensors of the two upper arms"),
    (&[(S::LeftForearm, S::RightForearm)], "sensors of the two forearms"),
    (
        &[(S::LeftUpperArm, S::RightUpperArm), (S::LeftForearm, S::RightForearm)],
        "sensors of both arms",
    ),
    (&[(S::LeftUpperArm, S::LeftForearm)], "left upper arm and the left forearm"),
    (&[(S::RightUpperArm, S::RightForearm)], "right upper arm and the right forearm"),
];

fn captured(motion: &str) -> Option<Capture> {
    body_motion(motion, None, &Default::default()).ok().map(|(capture, _)| capture)
}

fn named(poses: &[SegmentPose], rate_hz: f64) -> Vec<String> {
    swaps_in_walk(poses, &vec![[true; 13]; poses.len()], rate_hz)
}

fn swapped(poses: &[SegmentPose], pairs: &[(S, S)]) -> Vec<SegmentPose> {
    let swap = |pose: &SegmentPose| {
        let mut pose = pose.clone();
        pairs.iter().for_each(|(one, other)| pose.orientation.swap(one.index(), other.index()));
        pose
    };
    poses.iter().map(swap).collect()
}

#[test]
fn a_walk_names_sensors_that_were_swapped_and_no_others() {
    for motion in ["walk:8s", "run:6s", "walk:3s"] {
        let capture = captured(motion).expect("shipped");
        assert!(named(&capture.poses, capture.rate_hz).is_empty(), "{motion}");
        for (pairs, words) in SWAPS {
            let said = named(&swapped(&capture.poses, pairs), capture.rate_hz);
            assert_eq!(said.len(), 1, "{motion}, {pairs:?}: {said:?}");
            assert!(said[0].contains(words), "{motion}, {pairs:?}: {said:?}");
        }
        // Of a limb whose sensor is silent nothing is said, and what it leaves open is.
        let without = |segment: S, pairs: &[(S, S)]| {
            let mut measured = [true; 13];
            measured[segment.index()] = false;
            let measured = vec![measured; capture.poses.len()];
            swaps_in_walk(&swapped(&capture.poses, pairs), &measured, capture.rate_hz)
        };
        assert!(without(S::LeftShank, SWAPS[0].0).is_empty());
        assert!(without(S::LeftUpperArm, SWAPS[5].0).is_empty());
        for (segment, pairs, words) in [
            (S::LeftFoot, SWAPS[0].0, "of the two thighs, or of the two shanks, seem"),
            (S::RightForearm, SWAPS[5].0, "of both arms, or of the legs, seem"),
            (S::RightUpperArm, SWAPS[6].0, "of both arms, or of the legs, seem"),
        ] {
            let said = without(segment, pairs);
            assert!(said.len() == 1 && said[0].contains(words), "{motion}, {segment:?}: {said:?}");
        }
    }
    // Whatever else somebody does names nobody, and too little of it neither.
    for motion in ["squat:x3", "bow", "kick-l:x3", "jump:x3", "box-r:x3", "sit-down", "walk:2s"] {
        let capture = captured(motion).expect("shipped");
        assert!(named(&capture.poses, capture.rate_hz).is_empty(), "{motion}");
    }
    assert!(named(&[], 50.0).is_empty());
}

#[test]
fn arms_that_are_raised_with_headings_that_are_off_name_nobody() {
    let rate_hz = 50.0;
    let pose = |n: u32| {
        let part = (1.0 - (f64::from(n) / 400.0 * std::f64::consts::TAU).cos()) / 2.0;
        let mut angles = JointAngles::default();
        angles[Dof::LeftShoulderAbduction] = 1.6 * part;
        angles[Dof::RightShoulderAbduction] = 1.6 * part;
        let mut pose = angles.to_pose(DVec3::ZERO, DQuat::IDENTITY);
        for (segment, off_rad) in [(S::LeftForearm, 0.5), (S::RightUpperArm, 0.5)] {
            let turned = &mut pose.orientation[segment.index()];
            *turned = DQuat::from_rotation_z(off_rad) * *turned;
        }
        pose
    };
    let poses: Vec<SegmentPose> = (0..800).map(pose).collect();
    assert_eq!(named(&poses, rate_hz), Vec::<String>::new());
}

fn bvh_files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.is_dir() {
            bvh_files(&path, found);
        } else if path.extension().is_some_and(|ending| ending == "bvh") {
            found.push(path);
        }
    }
}

#[test]
fn no_capture_of_people_names_sensors_that_are_where_they_belong_and_walks_name_those_that_are_not()
{
    let Ok(captures) = std::env::var("GAITWAY_CAPTURES") else {
        aloud!("SKIPPED: GAITWAY_CAPTURES names no captures");
        return;
    };
    let mut files = Vec::new();
    bvh_files(Path::new(&captures), &mut files);
    files.sort();
    let (mut seconds, mut walks, mut found, mut others) = (0.0, 0, [0; SWAPS.len()], 0);
    for file in &files {
        let Some(capture) = captured(&file.display().to_string()) else { continue };
        let lasts_s = capture.poses.len() as f64 / capture.rate_hz;
        seconds += lasts_s;
        let said = named(&capture.poses, capture.rate_hz);
        assert!(said.is_empty(), "{}: {said:?}", file.display());
        let name = file.file_name().expect("a name").to_string_lossy().to_lowercase();
        let walks_or_runs = name.contains("walk") || name.contains("run");
        if lasts_s >= 4.0 && walks_or_runs {
            walks += 1;
        }
        for (n, (pairs, words)) in SWAPS.into_iter().enumerate() {
            let said = named(&swapped(&capture.poses, pairs), capture.rate_hz);
            let is_named = said.iter().any(|said| said.contains(words));
            if lasts_s >= 4.0 && walks_or_runs {
                found[n] += i32::from(is_named);
            } else {
                others += i32::from(is_named);
            }
        }
    }
    println!(
        "{} captures, {seconds:.0} s: none named by itself; of {walks} walks and runs of 4 s and more, what is swapped is named in \
         {found:?} ({SWAPS:?}); {others} swaps in other motions",
        files.len()
    );
    // Somebody who marches on the spot, walks bent over or turns all the time cannot tell.
    assert!(walks >= 10 && found.iter().all(|found| *found * 2 >= walks), "{found:?} of {walks}");
}

/// What is named of poses that come one by one, and when, s.
fn named_live(poses: &[SegmentPose], rate_hz: f64) -> Vec<(f64, String)> {
    let mut watch = SwapWatch::default();
    let mut found = Vec::new();
    for (n, pose) in poses.iter().enumerate() {
        let said = watch.take(pose, &[true; 13], 1.0 / rate_hz);
        found.extend(said.into_iter().map(|said| (n as f64 / rate_hz, said)));
    }
    found
}

/// At a hundred poses a second, the same again and again for so long.
fn for_seconds(capture: &Capture, lasts_s: f64) -> Vec<SegmentPose> {
    let length_s = capture.poses.len() as f64 / capture.rate_hz;
    (0..(lasts_s * 100.0) as u32).map(|n| capture.at((f64::from(n) / 100.0) % length_s)).collect()
}

#[test]
fn who_walks_on_is_named_within_seconds_and_once_and_whoever_wears_them_rightly_never() {
    for motion in ["walk:20s", "run:20s"] {
        let capture = captured(motion).expect("shipped");
        for rate_hz in [60.0, 100.0] {
            let count = (20.0 * rate_hz) as u32;
            let poses: Vec<_> = (0..count).map(|n| capture.at(f64::from(n) / rate_hz)).collect();
            assert!(named_live(&poses, rate_hz).is_empty(), "{motion}");
            for (pairs, words) in SWAPS {
                let said = named_live(&swapped(&poses, pairs), rate_hz);
                assert_eq!(said.len(), 1, "{motion}, {pairs:?}: {said:?}");
                assert!(said[0].1.contains(words) && said[0].0 < 8.0, "{motion}: {said:?}");
            }
        }
        // Whose legs say nothing for a while every second is never looked at for long enough.
        let mut watch = SwapWatch::default();
        for (n, pose) in swapped(&for_seconds(&capture, 20.0), SWAPS[0].0).iter().enumerate() {
            let mut measured = [true; 13];
            measured[S::LeftShank.index()] = n % 100 > 20;
            assert!(watch.take(pose, &measured, 0.01).is_empty());
        }
    }
}

#[test]
fn no_capture_is_named_by_mistake_as_it_goes_on_and_swapped_walks_are_and_what_it_takes_is_printed()
{
    let Ok(captures) = std::env::var("GAITWAY_CAPTURES") else {
        aloud!("SKIPPED: GAITWAY_CAPTURES names no captures");
        return;
    };
    let mut files = Vec::new();
    bvh_files(Path::new(&captures), &mut files);
    files.sort();
    let (mut walks, mut times_s, mut looked) = (0, [const { Vec::new() }; SWAPS.len()], 0);
    let began = std::time::Instant::now();
    for file in &files {
        let Some(capture) = captured(&file.display().to_string()) else { continue };
        let lasts_s = capture.poses.len() as f64 / capture.rate_hz;
        let poses = for_seconds(&capture, lasts_s.max(20.0));
        looked += poses.len();
        let said = named_live(&poses, 100.0);
        assert!(said.is_empty(), "{}: {said:?}", file.display());
        let name = file.file_name().expect("a name").to_string_lossy().to_lowercase();
        if lasts_s < 4.0 || !(name.contains("walk") || name.contains("run")) {
            continue;
        }
        walks += 1;
        for (n, (pairs, words)) in SWAPS.into_iter().enumerate() {
            let said = named_live(&swapped(&poses, pairs), 100.0);
            looked += poses.len();
            times_s[n]
                .extend(said.iter().filter(|(_, said)| said.contains(words)).map(|said| said.0));
        }
    }
    let told = times_s.each_mut().map(|times_s| {
        times_s.sort_by(f64::total_cmp);
        let (middle, last) = (times_s.get(times_s.len() / 2), times_s.last());
        (times_s.len(), middle.copied().unwrap_or(0.0), last.copied().unwrap_or(0.0))
    });
    println!(
        "of {walks} walks and runs, played for 20 s, what is swapped is named (how many, after how many seconds: half of them, \
         the last): {told:?}; {:.4} ms a cycle with the reading of the files",
        began.elapsed().as_secs_f64() * 1e3 / looked as f64
    );
    assert!(
        walks >= 10 && told.iter().all(|(count, ..)| count * 2 >= walks),
        "{told:?} of {walks}"
    );
    assert!(told.iter().all(|(_, half_s, _)| *half_s < 10.0), "{told:?}");
}
