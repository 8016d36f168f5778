//! A motion of the body model as an H-Anim humanoid (ISO/IEC 19774-1:2019) in X3D 4.0 (ISO/IEC
//! 19775-1): Y up, facing +Z, metres, standing in I pose at zero, joints of level of articulation 1. It
//! moves over a chequered floor, and cameras go with it.

use crate::body::contact;
use crate::body::proportions::{End, proximal_joint};
use crate::body::{Joint, JointPositions, Segment, SegmentPose};
use crate::mocap::scene::Scene;
use glam::{DQuat, DVec3};
use std::fmt::Write;

/// What the standard calls a segment's joint and the segment.
const fn names(segment: Segment) -> (&'static str, &'static str) {
    match segment {
        Segment::Pelvis => ("humanoid_root", "sacrum"),
        Segment::Torso => ("vl5", "l5"),
        Segment::Head => ("skullbase", "skull"),
        Segment::LeftUpperArm => ("l_shoulder", "l_upperarm"),
        Segment::LeftForearm => ("l_elbow", "l_forearm"),
        Segment::RightUpperArm => ("r_shoulder", "r_upperarm"),
        Segment::RightForearm => ("r_elbow", "r_forearm"),
        Segment::LeftThigh => ("l_hip", "l_thigh"),
        Segment::LeftShank => ("l_knee", "l_calf"),
        Segment::LeftFoot => ("l_talocrural", "l_talus"),
        Segment::RightThigh => ("r_hip", "r_thigh"),
        Segment::RightShank => ("r_knee", "r_calf"),
        Segment::RightFoot => ("r_talocrural", "r_talus"),
    }
}

/// Points a segment is drawn to, from its own joint.
fn drawn_to(segment: Segment) -> (&'static [Joint], &'static [End]) {
    match segment {
        Segment::Pelvis => (&[Joint::LeftHip, Joint::RightHip, Joint::Torso], &[]),
        Segment::Torso => (&[Joint::Neck, Joint::LeftShoulder, Joint::RightShoulder], &[]),
        Segment::Head => (&[], &[End::HeadTop]),
        Segment::LeftUpperArm => (&[Joint::LeftElbow], &[]),
        Segment::RightUpperArm => (&[Joint::RightElbow], &[]),
        Segment::LeftForearm => (&[Joint::LeftWrist], &[End::LeftFingertip]),
        Segment::RightForearm => (&[Joint::RightWrist], &[End::RightFingertip]),
        Segment::LeftThigh => (&[Joint::LeftKnee], &[]),
        Segment::RightThigh => (&[Joint::RightKnee], &[]),
        Segment::LeftShank => (&[Joint::LeftAnkle], &[]),
        Segment::RightShank => (&[Joint::RightAnkle], &[]),
        // Feet have soles, which are no lines.
        Segment::LeftFoot | Segment::RightFoot => (&[], &[]),
    }
}

/// How thick a segment is drawn, as a radius, part of the stature: enough to be seen, ours.
const fn thickness(segment: Segment) -> f64 {
    match segment {
        Segment::Pelvis | Segment::Torso => 0.03,
        Segment::Head => 0.04,
        Segment::LeftThigh | Segment::RightThigh => 0.03,
        Segment::LeftShank | Segment::RightShank => 0.022,
        Segment::LeftUpperArm | Segment::RightUpperArm => 0.02,
        Segment::LeftForearm | Segment::RightForearm => 0.016,
        Segment::LeftFoot | Segment::RightFoot => 0.02,
    }
}

/// Left is blue, right is red.
const fn colour(segment: Segment) -> &'static str {
    match segment {
        Segment::Pelvis | Segment::Torso | Segment::Head => "0.35 0.35 0.38",
        Segment::LeftUpperArm
        | Segment::LeftForearm
        | Segment::LeftThigh
        | Segment::LeftShank
        | Segment::LeftFoot => "0.12 0.37 0.75",
        Segment::RightUpperArm
        | Segment::RightForearm
        | Segment::RightThigh
        | Segment::RightShank
        | Segment::RightFoot => "0.75 0.22 0.17",
    }
}

/// A side of a square of the floor, m, unless the way is so long that there would be too many.
const SQUARE_M: f64 = 0.5;
/// Squares of the floor at most, along each side.
const MOST_SQUARES: f64 = 200.0;
/// The floor goes on so far beyond the body, m.
const MARGIN_M: f64 = 3.0;
/// The standard's usual field of view, rad.
const FIELD_OF_VIEW_RAD: f64 = core::f64::consts::FRAC_PI_4;
/// Cameras look down so steeply, rad.
const LOOK_DOWN_RAD: f64 = 0.15;

/// From X forward, Y left, Z up to X left, Y up, Z forward.
const fn turned(v: DVec3) -> DVec3 {
    DVec3::new(v.y, v.z, v.x)
}

fn number(value: f64) -> String {
    let text = format!("{value:.5}");
    let short = text.trim_end_matches('0').trim_end_matches('.');
    if short == "-0" { "0".to_owned() } else { short.to_owned() }
}

fn vector(v: DVec3) -> String {
    let v = turned(v);
    format!("{} {} {}", number(v.x), number(v.y), number(v.z))
}

fn rotation(q: DQuat) -> String {
    let q = if q.w < 0.0 { -q } else { q };
    let (axis, angle_rad) = q.to_axis_angle();
    if angle_rad < 1e-9 {
        return "0 1 0 0".to_owned();
    }
    format!("{} {}", vector(axis), number(angle_rad))
}

/// The turn that brings what points up into a direction.
fn rotation_from_up(direction: DVec3) -> String {
    rotation(DQuat::from_rotation_arc(DVec3::Z, direction))
}

/// Text that is safe inside an XML attribute.
fn escaped(text: &str) -> String {
    let plain: String = text.chars().filter(|c| !c.is_control()).collect();
    plain.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;").replace('\'', "&apos;")
}

/// The scene as a file, which plays the motion over and over.
#[must_use]
pub fn x3d_of(scene: &Scene<'_>) -> String {
    let standing = crate::body::JointAngles::default()
        .to_pose(DVec3::new(0.0, 0.0, scene.body.root_height_m()), DQuat::IDENTITY);
    let at = scene.body.positions(&standing);
    let title = escaped(scene.title);
    let duration_s = scene.poses.len().saturating_sub(1).max(1) as f64 / scene.rate_hz;
    let mut out = format!(
        "<?xml version='1.0' encoding='UTF-8'?>\n\
         <!DOCTYPE X3D PUBLIC 'ISO//Web3D//DTD X3D 4.0//EN' \
         'https://www.web3d.org/specifications/x3d-4.0.dtd'>\n\
         <X3D profile='Immersive' version='4.0'>\n<head>\n\
         <component name='HAnim' level='1'/>\n\
         <unit category='length' name='metre' conversionFactor='1'/>\n\
         <meta name='title' content='{title}'/>\n\
         <meta name='generator' content='gaitway'/>\n</head>\n<Scene>\n\
         <NavigationInfo type='\"EXAMINE\" \"ANY\"'/>\n\
         <Background skyColor='0.93 0.95 0.97'/>\n\
         <DirectionalLight direction='0.4 -1 -0.3' intensity='0.7' global='true'/>\n"
    );
    write_cameras(&mut out, scene, &title);
    write_floor(&mut out, scene);
    out.push_str(
        "<HAnimHumanoid DEF='humanoid' name='humanoid' version='2.0' loa='1' \
         skeletalConfiguration='BASIC'>\n",
    );
    write_joint(&mut out, Segment::Pelvis, &at, scene);
    for segment in Segment::ALL {
        let (joint, bone) = names(segment);
        let _ = writeln!(out, "<HAnimJoint USE='{joint}' containerField='joints'/>");
        let _ = writeln!(out, "<HAnimSegment USE='{bone}' containerField='segments'/>");
    }
    let _ = writeln!(
        out,
        "</HAnimHumanoid>\n<TimeSensor DEF='clock' cycleInterval='{}' loop='true'/>",
        number(duration_s)
    );
    write_motion(&mut out, scene);
    out.push_str("</Scene>\n</X3D>\n");
    out
}

/// Cameras that go where the root goes over the floor, but not up and down with it, so far away that the
/// whole body is in the picture all the time.
fn write_cameras(out: &mut String, scene: &Scene<'_>, title: &str) {
    let room = scene.room();
    let away_m = 1.1 * room.ball_m() / (FIELD_OF_VIEW_RAD / 2.0).sin();
    let centre = DVec3::Z * room.middle_m();
    let _ = writeln!(out, "<Transform DEF='camera'>");
    for (name, words, yaw_rad) in [
        ("ahead", "from ahead", -core::f64::consts::FRAC_PI_4),
        ("aside", "from the right", -core::f64::consts::FRAC_PI_2),
    ] {
        // A camera that is not turned looks from +Z, which is where a body that is not turned looks to.
        let turned = DQuat::from_rotation_z(yaw_rad) * DQuat::from_rotation_y(-LOOK_DOWN_RAD);
        let _ = writeln!(
            out,
            "<Viewpoint DEF='{name}' description='{title}, {words}' position='{}' orientation='{}' \
             centerOfRotation='{}' fieldOfView='{}'/>",
            vector(centre + turned * DVec3::X * away_m),
            rotation(turned),
            vector(centre),
            number(FIELD_OF_VIEW_RAD)
        );
    }
    out.push_str("</Transform>\n");
}

/// A chequered floor under the whole way.
fn write_floor(out: &mut String, scene: &Scene<'_>) {
    let (least_m, most_m) = scene.path_m();
    let span_m = (most_m - least_m).max_element() + 2.0 * MARGIN_M;
    let mut side_m = SQUARE_M;
    while span_m / side_m > MOST_SQUARES {
        side_m *= 2.0;
    }
    let first = ((least_m - MARGIN_M) / side_m).floor();
    let count = ((most_m + MARGIN_M) / side_m).ceil() - first;
    // Along the axes of the file: X to the left, Z forward.
    let (across, along) = (count.y as usize, count.x as usize);
    let heights = vec!["0"; (across + 1) * (along + 1)].join(" ");
    let shade = |square: usize| {
        if (square / across + square % across).is_multiple_of(2) {
            "0.72 0.75 0.78"
        } else {
            "0.9 0.92 0.94"
        }
    };
    let shades: Vec<&str> = (0..across * along).map(shade).collect();
    let _ = writeln!(
        out,
        "<Transform DEF='floor' translation='{}'><Shape><Appearance><Material \
         ambientIntensity='0.5'/></Appearance>\n\
         <ElevationGrid xDimension='{}' zDimension='{}' xSpacing='{}' zSpacing='{}' solid='false' \
         colorPerVertex='false' height='{heights}'>\n<Color color='{}'/></ElevationGrid></Shape></Transform>",
        vector((first * side_m).extend(scene.floor_m)),
        across + 1,
        along + 1,
        number(side_m),
        number(side_m),
        shades.join(", ")
    );
}

fn write_joint(out: &mut String, segment: Segment, at: &JointPositions, scene: &Scene<'_>) {
    let (joint, bone) = names(segment);
    let centre = at.joint_m(proximal_joint(segment));
    let field = if segment == Segment::Pelvis { "skeleton" } else { "children" };
    let _ = writeln!(
        out,
        "<HAnimJoint DEF='{joint}' name='{joint}' center='{}' containerField='{field}'>\n\
         <HAnimSegment DEF='{bone}' name='{bone}'>",
        vector(centre)
    );
    let (colour, radius_m) = (colour(segment), thickness(segment) * scene.body.stature_m());
    let look = format!("<Appearance><Material diffuseColor='{colour}'/></Appearance>");
    write_ball(out, centre, radius_m, &look);
    let (joints, ends) = drawn_to(segment);
    let points = joints.iter().map(|joint| at.joint_m(*joint));
    for point in points.chain(ends.iter().map(|end| at.end_m(*end))) {
        let bone = point - centre;
        let _ = writeln!(
            out,
            "<Transform translation='{}' rotation='{}'><Shape>{look}<Cylinder radius='{}' \
             height='{}'/></Shape></Transform>",
            vector(centre + bone / 2.0),
            rotation_from_up(bone.normalize_or(DVec3::Z)),
            number(radius_m),
            number(bone.length())
        );
        write_ball(out, point, radius_m, &look);
    }
    match segment {
        Segment::LeftFoot => {
            write_foot(out, centre, [End::LeftHeel, End::LeftToe], at, scene, &look)
        }
        Segment::RightFoot => {
            write_foot(out, centre, [End::RightHeel, End::RightToe], at, scene, &look);
        }
        _ => {}
    }
    out.push_str("</HAnimSegment>\n");
    for child in Segment::ALL.into_iter().filter(|child| child.parent() == Some(segment)) {
        write_joint(out, child, at, scene);
    }
    out.push_str("</HAnimJoint>\n");
}

fn write_ball(out: &mut String, centre: DVec3, radius_m: f64, look: &str) {
    let _ = writeln!(
        out,
        "<Transform translation='{}'><Shape>{look}<Sphere radius='{}'/></Shape></Transform>",
        vector(centre),
        number(radius_m)
    );
}

/// A flat sole, and the foot up to the ankle.
fn write_foot(
    out: &mut String,
    ankle: DVec3,
    [heel, toe]: [End; 2],
    at: &JointPositions,
    scene: &Scene<'_>,
    look: &str,
) {
    let half_m = DVec3::Y * contact::half_breadth_m(scene.body);
    let (heel, toe) = (at.end_m(heel), at.end_m(toe));
    let corners = [heel + half_m, heel - half_m, toe - half_m, toe + half_m, ankle];
    let _ = writeln!(
        out,
        "<Shape>{look}<IndexedFaceSet solid='false' coordIndex='0 1 2 3 -1 0 4 1 -1 1 4 2 -1 2 4 3 -1 3 4 0 \
         -1'><Coordinate point='{}'/></IndexedFaceSet></Shape>",
        corners.map(vector).join(", ")
    );
}

fn write_motion(out: &mut String, scene: &Scene<'_>) {
    let poses = scene.poses;
    let last = poses.len().saturating_sub(1).max(1) as f64;
    // Keys in five digits would shift the poses of a capture of some minutes.
    let keys: Vec<String> = (0..poses.len()).map(|i| format!("{:.7}", i as f64 / last)).collect();
    let keys = keys.join(" ");
    let start = DVec3::new(0.0, 0.0, scene.body.root_height_m());
    let body: Vec<String> = poses.iter().map(|pose| vector(pose.root_m - start)).collect();
    let level = |pose: &SegmentPose| vector(pose.root_m.truncate().extend(0.0));
    let camera: Vec<String> = poses.iter().map(level).collect();
    for (path, node, places) in [("path", "humanoid_root", body), ("level_path", "camera", camera)]
    {
        let _ = writeln!(
            out,
            "<PositionInterpolator DEF='{path}' key='{keys}' keyValue='{}'/>\n\
             <ROUTE fromNode='clock' fromField='fraction_changed' toNode='{path}' \
             toField='set_fraction'/>\n\
             <ROUTE fromNode='{path}' fromField='value_changed' toNode='{node}' \
             toField='set_translation'/>",
            places.join(", ")
        );
    }
    for segment in Segment::ALL {
        let (joint, _) = names(segment);
        let local = |pose: &SegmentPose| {
            let own = pose.orientation[segment.index()];
            let carrier = segment.parent().map_or(DQuat::IDENTITY, |p| pose.orientation[p.index()]);
            rotation(carrier.inverse() * own)
        };
        let turns: Vec<String> = poses.iter().map(local).collect();
        let _ = writeln!(
            out,
            "<OrientationInterpolator DEF='turn_{joint}' key='{keys}' keyValue='{}'/>\n\
             <ROUTE fromNode='clock' fromField='fraction_changed' toNode='turn_{joint}' \
             toField='set_fraction'/>\n\
             <ROUTE fromNode='turn_{joint}' fromField='value_changed' toNode='{joint}' \
             toField='set_rotation'/>",
            turns.join(", ")
        );
    }
}
