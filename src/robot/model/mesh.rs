//! Meshes (STL, OBJ), read for one purpose: the capsule or box that holds all their corners.

use super::Meshes;
use crate::rigid::{Capsule, Cuboid, Volume};
use core::f64::consts::PI;
use glam::{DQuat, DVec3};

/// Most corners of a mesh that are looked at.
const CORNERS_MAX: usize = 400_000;
/// A cylinder this many times longer than it is wide is a capsule.
const LONG: f64 = 1.6;

/// The volume around the mesh in this file; nothing if it cannot be read.
pub(super) fn fitted(file: &str, scale: DVec3, meshes: &mut Meshes<'_>) -> Option<Volume> {
    let corners = corners(&meshes(file).ok()?)?;
    around(corners.into_iter().map(|corner| corner * scale))
}

/// Corners of an STL (binary or text) or OBJ mesh; nothing if it is neither, or has none.
#[must_use]
pub fn corners(bytes: &[u8]) -> Option<Vec<DVec3>> {
    let found = binary(bytes).or_else(|| text(bytes))?;
    let sound = !found.is_empty() && found.iter().all(|corner| corner.is_finite());
    sound.then_some(found)
}

/// Binary STL: 80 bytes, a count, then 50 bytes a triangle, of which 12 are its normal.
fn binary(bytes: &[u8]) -> Option<Vec<DVec3>> {
    let count = u32::from_le_bytes(bytes.get(80..84)?.try_into().ok()?) as usize;
    if bytes.len() != count.checked_mul(50)?.checked_add(84)? || 3 * count > CORNERS_MAX {
        return None;
    }
    let value = |four: &[u8]| f64::from(f32::from_le_bytes(four.try_into().unwrap_or_default()));
    let corner =
        |twelve: &[u8]| DVec3::new(value(&twelve[..4]), value(&twelve[4..8]), value(&twelve[8..]));
    let triangles = bytes[84..].chunks_exact(50);
    Some(triangles.flat_map(|triangle| triangle[12..48].chunks_exact(12).map(corner)).collect())
}

/// Lines that begin with `vertex` (STL) or `v` (OBJ).
fn text(bytes: &[u8]) -> Option<Vec<DVec3>> {
    let text = std::str::from_utf8(bytes).ok()?;
    let mut found = Vec::new();
    for line in text.lines() {
        let mut words = line.split_whitespace();
        if !matches!(words.next(), Some("vertex" | "v")) {
            continue;
        }
        let mut next = || words.next().and_then(|word| word.parse::<f64>().ok());
        found.push(DVec3::new(next()?, next()?, next()?));
        if found.len() > CORNERS_MAX {
            return None;
        }
    }
    Some(found)
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
