//! What a robot looks like: the meshes that its file names.

use crate::error::counted;
use crate::job::robot_model::{MESH_BYTES_MAX, bytes_of};
use crate::retarget::base::BasePath;
use crate::rigid::Placement;
use crate::robot::model::surface::Surface;
use crate::robot::{Robot, RobotBody};
use crate::view::robot::RobotTrack;
use gaitway_profiles::BodyMesh;
use glam::{DQuat, DVec3};
use std::path::Path;

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
    let (mut unread, mut left) = (Vec::new(), ALL_BYTES_MAX);
    let mut looks = Vec::new();
    for (index, link) in body.tree.links().iter().enumerate() {
        let joint = (index > 0).then_some(link.name.as_str());
        let meshes = links.iter().filter(|link| link.joint.as_deref() == joint);
        let mut look = Surface::default();
        for mesh in meshes.flat_map(|link| &link.meshes) {
            match surface(folder, mesh, &mut left) {
                Ok(surface) => look.join(surface),
                Err(cause) => unread.push(format!("{} ({cause})", mesh.file)),
            }
        }
        looks.push(look);
    }
    let said = unread.first().map(|first| {
        let of = counted(unread.len(), "mesh");
        format!("{of} of the robot cannot be shown, its shapes stand for them: {first}")
    });
    track.looking_like(&looks, said)
}

/// A mesh in the axes of its link, m.
fn surface(folder: &Path, mesh: &BodyMesh, left: &mut u64) -> Result<Surface, String> {
    let path = folder.join(&mesh.file);
    let bytes = bytes_of(&path, MESH_BYTES_MAX.min(*left)).map_err(|cause| cause.to_string())?;
    *left -= bytes.len() as u64;
    let surface = Surface::read(&bytes).ok_or("neither STL nor OBJ")?;
    let [w, x, y, z] = mesh.turn;
    let turn = DQuat::from_xyzw(x, y, z, w).normalize();
    Ok(surface.placed(mesh.scale.into(), Placement { at_m: DVec3::from(mesh.at_m), turn }))
}
