//! Joint angles out of OpenSim's tables as a motion of the body.

use super::{ACTION_STATURE_M, Source};
use crate::body::{Proportions, SegmentPose, root};
use crate::error::Error;
use crate::mocap::anatomy::Capture;
use crate::mocap::opensim::{self, OpenSimBody};
use glam::{DQuat, DVec3};
use std::path::Path;

/// Reads a table of joint angles. The body is of usual stature, since the file does not say whose it is.
pub(super) fn capture(path: &Path) -> Result<(Capture, Source), Error> {
    let table = opensim::read(path)?;
    let body = table.body_angles().map_err(|error| error.in_file(path))?;
    let source = Source {
        format: "opensim".to_owned(),
        frames: table.rows(),
        rate_hz: body.rate_hz,
        duration_s: table.duration_s(),
        ..Source::default()
    };
    let mut notes = body.notes.clone();
    notes.push(format!("an OpenSim table does not say the stature: {ACTION_STATURE_M} m is taken"));
    // What the file does not say is at rest, which the notes tell.
    let tracked = [true; 13];
    let poses = placed(&body, &Proportions::of_stature(ACTION_STATURE_M)?);
    let (rate_hz, stature_m) = (body.rate_hz, ACTION_STATURE_M);
    Ok((Capture { rate_hz, poses, tracked, stature_m, is_made: false, notes }, source))
}

/// The poses: at the origin and facing ahead in the first, the lowest sole of all on the ground.
fn placed(body: &OpenSimBody, proportions: &Proportions) -> Vec<SegmentPose> {
    let ahead = body.pelvis.first().map_or(DVec3::X, |pelvis| *pelvis * DVec3::X);
    let straight = DQuat::from_rotation_z(-ahead.y.atan2(ahead.x));
    let turned = body.angles.iter().zip(&body.pelvis);
    let mut poses: Vec<SegmentPose> =
        turned.map(|(angles, pelvis)| angles.to_pose(DVec3::ZERO, straight * *pelvis)).collect();
    let grounded = root::path_m(proportions, &poses, body.rate_hz);
    let roots_m: Vec<DVec3> = match body.places_m.first() {
        None => grounded,
        Some(first) => {
            let from = |place: &DVec3| straight * (*place - DVec3::new(first.x, first.y, 0.0));
            let places: Vec<DVec3> = body.places_m.iter().map(from).collect();
            // What is above the ground stays so far above it: only the whole is lifted.
            let under = |(place, ground): (&DVec3, &DVec3)| ground.z - place.z;
            let lift = places.iter().zip(&grounded).map(under).fold(f64::NEG_INFINITY, f64::max);
            places.into_iter().map(|place| place + DVec3::new(0.0, 0.0, lift)).collect()
        }
    };
    for (pose, root_m) in poses.iter_mut().zip(roots_m) {
        pose.root_m = root_m;
    }
    poses
}
