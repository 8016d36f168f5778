//! Meshes, as what takes up room: the capsule or box that holds all their corners.

use super::Meshes;
use super::surface::Surface;
use crate::rigid::{Capsule, Cuboid, Volume};
use core::f64::consts::PI;
use glam::{DQuat, DVec3};

/// A cylinder this many times longer than it is wide is a capsule.
const LONG: f64 = 1.6;

/// The volume around the mesh in this file; nothing if it cannot be read.
pub(super) fn fitted(file: &str, scale: DVec3, meshes: &mut Meshes<'_>) -> Option<Volume> {
    let surface = Surface::read(&meshes(file).ok()?)?;
    around(surface.points_m.into_iter().map(|corner| corner * scale))
}

/// A capsule or a box, whichever takes up less room, both along the axes and around all points.
fn around(points: impl Iterator<Item = DVec3>) -> Option<Volume> {
    let points: Vec<DVec3> = points.collect();
    let first = *points.first()?;
    let (low, high) =
        points.iter().fold((first, first), |(low, high), &point| (low.min(point), high.max(point)));
    let (centre_m, half_m) = ((low + high) / 2.0, (high - low) / 2.0);
    let long = if half_m.x >= half_m.y.max(half_m.z) {
        DVec3::X
    } else if half_m.y >= half_m.z {
        DVec3::Y
    } else {
        DVec3::Z
    };
    let length = half_m.dot(long);
    let off_axis = |point: &DVec3| (*point - centre_m).reject_from_normalized(long).length();
    let radius_m = points.iter().map(off_axis).fold(0.0, f64::max);
    // As short as leaves every point inside.
    let end = |point: &DVec3| {
        let away = *point - centre_m;
        let across = away.reject_from_normalized(long).length_squared();
        away.dot(long).abs() - (radius_m * radius_m - across).max(0.0).sqrt()
    };
    let reach = points.iter().map(end).fold(0.0, f64::max);
    let capsule_m3 = PI * radius_m * radius_m * (2.0 * reach + 4.0 / 3.0 * radius_m);
    if length <= radius_m || 8.0 * half_m.element_product() < capsule_m3 {
        return Some(Volume::Cuboid(Cuboid { centre_m, turn: DQuat::IDENTITY, half_m }));
    }
    let (from_m, to_m) = (centre_m - long * reach, centre_m + long * reach);
    Some(Volume::Capsule(Capsule { from_m, to_m, radius_m }))
}

/// A cylinder along Z as the box around it if it is flat, else as the capsule of its length.
pub(super) fn cylinder(radius_m: f64, half_m: f64) -> Volume {
    if half_m < LONG * radius_m {
        let half_m = DVec3::new(radius_m, radius_m, half_m);
        return Volume::Cuboid(Cuboid { centre_m: DVec3::ZERO, turn: DQuat::IDENTITY, half_m });
    }
    let end = DVec3::Z * (half_m - radius_m / 2.0);
    Volume::Capsule(Capsule { from_m: -end, to_m: end, radius_m })
}
