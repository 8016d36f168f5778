//! Motions as NumPy reads them. Of a robot, for learners of whole-body tracking: a `.npz` of positions and velocities of
//! joints and links. Of a person: turns of segments as axes and angles, with the keys that AMASS has (Mahmood et al., "AMASS:
//! Archive of motion capture as surface shapes", ICCV 2019), of our own body and not of SMPL's.
//!
//! Keys and shapes are those that the `MotionLoader` of BeyondMimic reads (`whole_body_tracking/tasks/tracking/mdp/commands.py`
//! of HybridRobotics/whole_body_tracking, and mjlab after it): `fps`, `joint_pos`, `joint_vel`, `body_pos_w`, `body_quat_w`
//! (w x y z), `body_lin_vel_w`, `body_ang_vel_w`. It goes by index, and simulators order links differently; so `joint_names`
//! and `body_names` stand beside them. The file is a ZIP (PKWARE's APPNOTE) of arrays in NumPy's format 1.0, not packed.

use crate::body::{Segment, SegmentPose, segment_name};
use crate::recording::crc32;
use crate::rigid::Placement;
use crate::robot::RobotBody;
use glam::{DQuat, DVec3};

/// An array of a file: its name, type, shape and bytes.
struct Array {
    name: &'static str,
    kind: String,
    shape: Vec<usize>,
    bytes: Vec<u8>,
}

impl Array {
    fn numbers(name: &'static str, shape: Vec<usize>, values: impl Iterator<Item = f64>) -> Self {
        let bytes = values.flat_map(|value| (value as f32).to_le_bytes()).collect();
        Self { name, kind: "<f4".to_owned(), shape, bytes }
    }

    /// Names, each as long as the longest, in UTF-32.
    fn names(name: &'static str, names: &[String]) -> Self {
        let longest = names.iter().map(|name| name.chars().count()).max().unwrap_or(1).max(1);
        let mut bytes = Vec::with_capacity(4 * longest * names.len());
        for name in names {
            let letters = name.chars().map(u32::from).chain(std::iter::repeat(0));
            bytes.extend(letters.take(longest).flat_map(u32::to_le_bytes));
        }
        Self { name, kind: format!("<U{longest}"), shape: vec![names.len()], bytes }
    }

    /// As a file of its own.
    fn npy(&self) -> Vec<u8> {
        let shape: Vec<String> = self.shape.iter().map(|n| format!("{n},")).collect();
        let mut header = format!(
            "{{'descr': '{}', 'fortran_order': False, 'shape': ({}), }}",
            self.kind,
            shape.join(" ")
        );
        // What comes before the data is a multiple of 64 bytes long.
        while (10 + header.len() + 1) % 64 != 0 {
            header.push(' ');
        }
        header.push('\n');
        let mut file = b"\x93NUMPY\x01\x00".to_vec();
        file.extend((header.len() as u16).to_le_bytes());
        file.extend(header.as_bytes());
        file.extend(&self.bytes);
        file
    }
}

/// A ZIP of files that are not packed.
fn zipped(arrays: &[Array]) -> Vec<u8> {
    let (mut file, mut listed) = (Vec::new(), Vec::new());
    for array in arrays {
        let (name, data) = (format!("{}.npy", array.name), array.npy());
        // Version 2.0, no flags, stored, 1 January 1980.
        let mut about = vec![20, 0, 0, 0, 0, 0, 0, 0, 0x21, 0];
        about.extend(crc32(&data).to_le_bytes());
        about.extend([data.len() as u32, data.len() as u32].into_iter().flat_map(u32::to_le_bytes));
        about.extend((name.len() as u16).to_le_bytes());
        about.extend([0, 0]);
        listed.extend(b"PK\x01\x02\x14\x00");
        listed.extend(&about);
        listed.extend([0; 10]);
        listed.extend((file.len() as u32).to_le_bytes());
        listed.extend(name.as_bytes());
        file.extend(b"PK\x03\x04");
        file.extend(&about);
        file.extend(name.as_bytes());
        file.extend(data);
    }
    let (at, length, count) = (file.len() as u32, listed.len() as u32, arrays.len() as u16);
    file.extend(listed);
    file.extend(b"PK\x05\x06\x00\x00\x00\x00");
    file.extend([count, count].into_iter().flat_map(u16::to_le_bytes));
    file.extend([length, at].into_iter().flat_map(u32::to_le_bytes));
    file.extend([0, 0]);
    file
}

/// The instants before and after, and how far they are apart in frames.
fn beside(at: usize, count: usize) -> (usize, usize, f64) {
    let (before, after) = (at.saturating_sub(1), (at + 1).min(count - 1));
    (before, after, (after - before).max(1) as f64)
}

/// Spin of what is turned so and then so, rad, in the world.
fn turned_rad(before: DQuat, after: DQuat) -> DVec3 {
    let turn = after * before.inverse();
    // The shorter of the two ways round.
    let turn = if turn.w < 0.0 { -turn } else { turn };
    turn.to_scaled_axis()
}

/// The file of a clip: the base and joints in every frame.
pub(super) fn written(
    body: &RobotBody,
    joints: &[String],
    rows: &[(Placement, Vec<f64>)],
    fps: u32,
) -> Vec<u8> {
    let rate_hz = f64::from(fps);
    let count = rows.len();
    let links: Vec<Vec<Placement>> = rows
        .iter()
        .map(|(base, joints_rad)| body.tree.place(*base, &body.angles(joints_rad)))
        .collect();
    let names: Vec<String> = body.tree.links().iter().map(|link| link.name.clone()).collect();
    let (joint_count, link_count) = (joints.len(), names.len());
    let frames = 0..count;
    let velocity = |at: usize, joint: usize| {
        let (before, after, steps) = beside(at, count);
        (rows[after].1[joint] - rows[before].1[joint]) * rate_hz / steps
    };
    let moved = |at: usize, link: usize| {
        let (before, after, steps) = beside(at, count);
        (links[after][link].at_m - links[before][link].at_m) * (rate_hz / steps)
    };
    let spin = |at: usize, link: usize| {
        let (before, after, steps) = beside(at, count);
        turned_rad(links[before][link].turn, links[after][link].turn) * (rate_hz / steps)
    };
    let each = |of: &dyn Fn(usize, usize) -> Vec<f64>, width: usize| -> Vec<f64> {
        frames.clone().flat_map(|at| (0..width).flat_map(move |n| of(at, n))).collect()
    };
    let place = |at: usize, link: usize| links[at][link].at_m.to_array().to_vec();
    let turn = |at: usize, link: usize| {
        let turn = links[at][link].turn;
        vec![turn.w, turn.x, turn.y, turn.z]
    };
    let array = |name, parts: &[usize], values: Vec<f64>| {
        let shape = std::iter::once(count).chain(parts.iter().copied()).collect();
        Array::numbers(name, shape, values.into_iter())
    };
    let fps = i64::from(fps).to_le_bytes().to_vec();
    let bodies = [link_count, 3];
    zipped(&[
        Array { name: "fps", kind: "<i8".to_owned(), shape: vec![1], bytes: fps },
        array("joint_pos", &[joint_count], each(&|at, n| vec![rows[at].1[n]], joint_count)),
        array("joint_vel", &[joint_count], each(&|at, n| vec![velocity(at, n)], joint_count)),
        array("body_pos_w", &bodies, each(&place, link_count)),
        array("body_quat_w", &[link_count, 4], each(&turn, link_count)),
        array(
            "body_lin_vel_w",
            &bodies,
            each(&|at, n| moved(at, n).to_array().to_vec(), link_count),
        ),
        array(
            "body_ang_vel_w",
            &bodies,
            each(&|at, n| spin(at, n).to_array().to_vec(), link_count),
        ),
        Array::names("joint_names", joints),
        Array::names("body_names", &names),
    ])
}

/// The file of a person's motion: `poses` (each frame the axis times the angle of each segment against the one before
/// it, rad, the pelvis against the world: as long as there are segments, three each), `trans` (the pelvis, m),
/// `mocap_framerate`, and beside them `segment_names` and `stature_m`, since the body is not SMPL's and has no `betas`.
pub(super) fn of_person(poses: &[SegmentPose], rate_hz: f64, stature_m: f64) -> Vec<u8> {
    let turn = |pose: &SegmentPose, segment: Segment| {
        let own = pose.orientation[segment.index()];
        let before = segment.parent().map_or(DQuat::IDENTITY, |of| pose.orientation[of.index()]);
        turned_rad(DQuat::IDENTITY, before.inverse() * own)
    };
    let turns: Vec<f64> = poses
        .iter()
        .flat_map(|pose| Segment::ALL.map(|segment| turn(pose, segment).to_array()).concat())
        .collect();
    let places = poses.iter().flat_map(|pose| pose.root_m.to_array());
    let count = poses.len();
    let single = |value: f64| value.to_le_bytes().to_vec();
    zipped(&[
        Array::numbers("poses", vec![count, 3 * Segment::ALL.len()], turns.into_iter()),
        Array::numbers("trans", vec![count, 3], places),
        Array {
            name: "mocap_framerate",
            kind: "<f8".to_owned(),
            shape: Vec::new(),
            bytes: single(rate_hz),
        },
        Array {
            name: "stature_m",
            kind: "<f8".to_owned(),
            shape: Vec::new(),
            bytes: single(stature_m),
        },
        Array::names(
            "segment_names",
            &Segment::ALL.map(|segment| segment_name(segment).to_owned()),
        ),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_turns_evenly_spins_evenly_whichever_sign_its_quaternion_has() {
        let turn = |rad: f64| DQuat::from_axis_angle(DVec3::Z, rad);
        for (before, after) in [(turn(0.1), turn(0.3)), (turn(0.1), -turn(0.3))] {
            assert!((turned_rad(before, after) - DVec3::Z * 0.2).length() < 1e-12);
        }
    }

    #[test]
    fn an_array_begins_where_numpy_looks_for_it() {
        let array = Array::numbers("a", vec![2, 3], (0..6).map(f64::from));
        let file = array.npy();
        let header = u16::from_le_bytes([file[8], file[9]]) as usize;
        assert_eq!((10 + header) % 64, 0);
        assert_eq!(file.len(), 10 + header + 24);
        assert_eq!(zipped(&[array])[..4], *b"PK\x03\x04");
    }
}
