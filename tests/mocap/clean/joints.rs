//! Joints of skeletons: what is put into captures is found, and captures as they are give few alarms.

use super::captured::{bvh_files, captured};
use super::gaps::Dice;
use gaitway::body::SegmentPose;
use gaitway::clean::artefact::ArtefactKind;
use gaitway::clean::joints::{JointArtefact, artefacts, jointed};
use gaitway::mocap::read_bvh;
use glam::{DQuat, DVec3};
use std::collections::BTreeMap;
use std::ops::Range;

/// A hit is of that joint and kind, and shares more than half of its frames with the truth.
fn is_hit(found: &JointArtefact, truth: &JointArtefact) -> bool {
    let (a, b) = (&found.frames, &truth.frames);
    let shared = a.end.min(b.end).saturating_sub(a.start.max(b.start));
    let all = a.end.max(b.end) - a.start.min(b.start);
    found.kind == truth.kind && found.segment == truth.segment && 2 * shared > all
}

/// Turns a segment, and all that it carries, or holds it where it lay on what carries it.
fn put(poses: &mut [SegmentPose], truth: &JointArtefact, turn: DQuat) {
    let (at, parent) = (truth.segment.index(), truth.segment.parent().expect("a joint").index());
    let first = poses[truth.frames.start].clone();
    let held = first.orientation[parent].inverse() * first.orientation[at];
    for pose in &mut poses[truth.frames.clone()] {
        let was = pose.orientation[at];
        let is = match truth.kind {
            ArtefactKind::Stuck => pose.orientation[parent] * held,
            _ => was * turn,
        };
        let change = is * was.inverse();
        for segment in gaitway::body::Segment::ALL {
            let carried = std::iter::successors(Some(segment), |of| of.parent())
                .any(|of| of == truth.segment);
            if carried {
                pose.orientation[segment.index()] = change * pose.orientation[segment.index()];
            }
        }
    }
}

/// Frames around which a joint turns faster than slowly: what sticks while a joint rests anyway shows nothing.
fn moves(poses: &[SegmentPose], truth: &JointArtefact, rate_hz: f64) -> bool {
    let (at, parent) = (truth.segment.index(), truth.segment.parent().expect("a joint").index());
    let turn = |pose: &SegmentPose| pose.orientation[parent].inverse() * pose.orientation[at];
    let end = truth.frames.end;
    turn(&poses[end - 1]).angle_between(turn(&poses[end + 3])) * rate_hz / 4.0 > 1.0
}

#[test]
fn joints_that_jump_or_stick_are_found_in_captures() {
    let Some(folder) = captured("mocap/bvh") else { return };
    let (mut dice, mut rows) = (Dice(71), BTreeMap::<String, (usize, usize, usize)>::new());
    let files = bvh_files(&folder);
    // Twice, with other dice.
    for file in files.iter().chain(&files) {
        let Ok(capture) = read_bvh(file, None) else { continue };
        let rate_hz = capture.rate_hz;
        let usual = artefacts(&capture.poses, &capture.tracked, rate_hz);
        let joints: Vec<_> = jointed(&capture.tracked).map(|(segment, _)| segment).collect();
        for (kind, size, length_s) in [
            (ArtefactKind::Jump, 20.0_f64, 0.2),
            (ArtefactKind::Jump, 45.0, 0.2),
            (ArtefactKind::Jump, 90.0, 0.05),
            (ArtefactKind::Stuck, 0.1, 0.1),
            (ArtefactKind::Stuck, 0.5, 0.5),
        ] {
            let length = ((length_s * rate_hz) as usize).max(2) + 1;
            // At 30 frames a second people move by more than small jumps from one frame to the next.
            if capture.poses.len() < length + 40 || rate_hz < 50.0 {
                continue;
            }
            let truth = (0..200).find_map(|_| {
                let start = 10 + dice.below(capture.poses.len() - length - 20);
                let segment = joints[dice.below(joints.len())];
                let frames: Range<usize> = start..start + length;
                let truth = JointArtefact { kind, segment, frames };
                let shows = kind == ArtefactKind::Jump || moves(&capture.poses, &truth, rate_hz);
                shows.then_some(truth)
            });
            let Some(truth) = truth else { continue };
            let mut poses = capture.poses.clone();
            let way = DVec3::new(dice.below(100) as f64 - 50.0, dice.below(100) as f64 + 1.0, 20.0);
            put(&mut poses, &truth, DQuat::from_axis_angle(way.normalize(), size.to_radians()));
            let found = artefacts(&poses, &capture.tracked, rate_hz);
            let row = rows.entry(format!("{} {size}", kind.word())).or_default();
            row.0 += 1;
            row.1 += usize::from(found.iter().any(|of| is_hit(of, &truth)));
            // Where a joint stops sticking, it may well jump.
            let is_other = |of: &&JointArtefact| of.segment != truth.segment && !usual.contains(of);
            row.2 += found.iter().filter(is_other).count();
        }
    }
    for (name, (tried, hit, others)) in &rows {
        println!("{name}: {hit} of {tried} found, {others} others told");
    }
    for name in ["jump 45", "jump 90", "stuck 0.5"] {
        let (tried, hit, others) = rows[name];
        assert!(tried >= 30 && hit * 100 >= tried * 95, "{name}: {hit} of {tried}");
        assert!(others * 10 <= tried, "{name}: {others} others");
    }
}

#[test]
fn captured_skeletons_as_they_are_give_few_alarms() {
    let Some(folder) = captured("mocap/bvh") else { return };
    let (mut minutes, mut jumps, mut stuck, mut files) = (0.0, 0, 0, 0);
    for file in bvh_files(&folder) {
        let Ok(capture) = read_bvh(&file, None) else { continue };
        let found = artefacts(&capture.poses, &capture.tracked, capture.rate_hz);
        minutes += capture.poses.len() as f64 / capture.rate_hz / 60.0;
        files += 1;
        for of in &found {
            println!("{}: {of:?} at {} Hz", file.display(), capture.rate_hz);
        }
        let of = |kind| found.iter().filter(|of| of.kind == kind).count();
        jumps += of(ArtefactKind::Jump);
        stuck += of(ArtefactKind::Stuck);
    }
    println!("{jumps} jumps and {stuck} stuck told in {minutes:.1} min of {files} captures");
    assert!(files > 60);
    // What sticks repeats its numbers in the file; whether a jump was one nobody knows.
    assert!(f64::from(u32::try_from(jumps).expect("few")) < minutes / 2.0, "{jumps} jumps");
}
