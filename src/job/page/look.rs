//! What a robot looks like: the meshes that its file names.

use crate::error::counted;
use crate::job::robot_model::{MESH_BYTES_MAX, NO_MESH, bytes_of};
use crate::retarget::base::BasePath;
use crate::rigid::Placement;
use crate::robot::model::surface::Surface;
use crate::robot::{Robot, RobotBody};
use crate::view::robot::RobotTrack;
use gaitway_profiles::BodyMesh;
use glam::{DQuat, DVec3};
use std::path::Path;

/// So many times as far as the robot no mesh of it reaches.
const TIMES: f64 = 10.0;
/// So many that cannot be shown are named.
const NAMED: usize = 6;
/// Most bytes of all meshes of a robot.
const ALL_BYTES_MAX: u64 = 256 << 20;

/// A robot whose base goes along a path, as it looks.
pub(super) fn drawn(robot: &Robot, body: &RobotBody, base: &BasePath) -> RobotTrack {
    let track = RobotTrack::of(&robot.name, body, base);
    let links = robot.file.body.as_ref().map(|body| body.links.as_slice()).unwrap_or_default();
    if links.iter().all(|link| link.meshes.is_empty()) {
        return track;
    }
    let folder = robot.file.origin.as_ref().and_then(|origin| origin.path.parent());
    let folder = folder.unwrap_or(Path::new("."));
    let far_m = TIMES * reach_m(body);
    let (mut unread, mut left) = (Vec::new(), ALL_BYTES_MAX);
    let mut looks = Vec::new();
    for (index, link) in body.tree.links().iter().enumerate() {
        let joint = (index > 0).then_some(link.name.as_str());
        let meshes = links.iter().filter(|link| link.joint.as_deref() == joint);
        let mut look = Surface::default();
        for mesh in meshes.flat_map(|link| &link.meshes) {
            match surface(folder, mesh, far_m, &mut left) {
                Ok(surface) => look.join(surface),
                Err(cause) => unread.push(format!("{} ({cause})", mesh.file)),
            }
        }
        looks.push(look);
    }
    let said = (!unread.is_empty()).then(|| {
        let of = counted(unread.len(), "mesh");
        let more = match unread.len().saturating_sub(NAMED) {
            0 => String::new(),
            more => format!(" and {more} more"),
        };
        unread.truncate(NAMED);
        let named = unread.join(", ");
        format!("{of} of the robot cannot be shown, its shapes stand for them: {named}{more}")
    });
    track.looking_like(&looks, said)
}

/// How far from its base a robot reaches, about, m.
fn reach_m(body: &RobotBody) -> f64 {
    let placed = body.tree.place(Placement::IDENTITY, &vec![0.0; body.tree.moving()]);
    let volumes = body.volumes.iter().zip(&placed);
    let shapes = volumes.flat_map(|(volumes, at)| volumes.iter().map(|of| of.placed(*at).ball_m()));
    let shapes = shapes.map(|(middle_m, radius_m)| middle_m.length() + radius_m);
    placed.iter().map(|at| at.at_m.length()).chain(shapes).fold(0.1, f64::max)
}

/// A mesh in the axes of its link, m; its corners are nearer than that.
fn surface(folder: &Path, mesh: &BodyMesh, far_m: f64, left: &mut u64) -> Result<Surface, String> {
    let path = folder.join(&mesh.file);
    let bytes = bytes_of(&path, MESH_BYTES_MAX).map_err(|cause| cause.to_string())?;
    *left = left.checked_sub(bytes.len() as u64).ok_or_else(|| {
        format!("with it, meshes of the robot are more than {}", counted(ALL_BYTES_MAX, "byte"))
    })?;
    let surface = Surface::read(&bytes).ok_or(NO_MESH)?;
    let [w, x, y, z] = mesh.turn;
    let turn = DQuat::from_xyzw(x, y, z, w).normalize();
    let at = Placement { at_m: DVec3::from(mesh.at_m), turn };
    let surface = surface.placed(mesh.scale.into(), at);
    let own_far_m = surface.points_m.iter().map(|point_m| point_m.length()).fold(0.0, f64::max);
    if own_far_m < far_m && surface.points_m.iter().all(|point_m| point_m.is_finite()) {
        return Ok(surface);
    }
    Err(format!(
        "it reaches {own_far_m:.3e} m far: lengths in mm want scale = [0.001, 0.001, 0.001]"
    ))
}
