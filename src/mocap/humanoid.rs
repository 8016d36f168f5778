//! A motion of the body model as an H-Anim humanoid (ISO/IEC 19774-1:2019) in X3D 4.0 (ISO/IEC
//! 19775-1): Y up, facing +Z, metres, standing in I pose at zero, joints of level of articulation 1.

use crate::body::proportions::{End, Proportions, proximal_joint};
use crate::body::{Joint, Segment, SegmentPose};
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
        Segment::LeftFoot => (&[], &[End::LeftHeel, End::LeftToe]),
        Segment::RightFoot => (&[], &[End::RightHeel, End::RightToe]),
    }
}

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

/// Text that is safe inside an XML attribute.
fn escaped(text: &str) -> String {
    let plain: String = text.chars().filter(|c| !c.is_control()).collect();
    plain.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;").replace('\'', "&apos;")
}

/// Writes `poses` of a body with these proportions, at `rate_hz`, as a scene that plays the motion
/// over and over.
#[must_use]
pub fn x3d_of(title: &str, poses: &[SegmentPose], body: &Proportions, rate_hz: f64) -> String {
    let standing = crate::body::JointAngles::default()
        .to_pose(DVec3::new(0.0, 0.0, body.root_height_m()), DQuat::IDENTITY);
    let at = body.positions(&standing);
    let title = escaped(title);
    let duration_s = poses.len().saturating_sub(1).max(1) as f64 / rate_hz;
    let mut out = format!(
        "<?xml version='1.0' encoding='UTF-8'?>\n\
         <!DOCTYPE X3D PUBLIC 'ISO//Web3D//DTD X3D 4.0//EN' \
         'https://www.web3d.org/specifications/x3d-4.0.dtd'>\n\
         <X3D profile='Immersive' version='4.0'>\n<head>\n\
         <component name='HAnim' level='1'/>\n\
         <unit category='length' name='metre' conversionFactor='1'/>\n\
         <meta name='title' content='{title}'/>\n\
         <meta name='generator' content='gaitway'/>\n</head>\n<Scene>\n\
         <Viewpoint position='-3 1.2 3' orientation='0 1 0 -0.785' description='{title}'/>\n\
         <HAnimHumanoid DEF='humanoid' name='humanoid' version='2.0' loa='1' \
         skeletalConfiguration='BASIC'>\n"
    );
    write_joint(&mut out, Segment::Pelvis, &at);
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
    write_motion(&mut out, poses, body);
    out.push_str("</Scene>\n</X3D>\n");
    out
}

fn write_joint(out: &mut String, segment: Segment, at: &crate::body::JointPositions) {
    let (joint, bone) = names(segment);
    let centre = at.joint_m(proximal_joint(segment));
    let field = if segment == Segment::Pelvis { "skeleton" } else { "children" };
    let _ = writeln!(
        out,
        "<HAnimJoint DEF='{joint}' name='{joint}' center='{}' containerField='{field}'>",
        vector(centre)
    );
    let (joints, ends) = drawn_to(segment);
    let points = joints.iter().map(|joint| at.joint_m(*joint));
    let points: Vec<DVec3> = points.chain(ends.iter().map(|end| at.end_m(*end))).collect();
    let coordinates: Vec<String> =
        points.iter().map(|point| format!("{} {}", vector(centre), vector(*point))).collect();
    let counts = vec!["2"; points.len()].join(" ");
    let _ = writeln!(
        out,
        "<HAnimSegment DEF='{bone}' name='{bone}'><Shape><Appearance><Material \
         emissiveColor='0.1 0.3 0.7'/><LineProperties linewidthScaleFactor='4'/></Appearance>\
         <LineSet vertexCount='{counts}'><Coordinate point='{}'/></LineSet></Shape></HAnimSegment>",
        coordinates.join(", ")
    );
    for child in Segment::ALL.into_iter().filter(|child| child.parent() == Some(segment)) {
        write_joint(out, child, at);
    }
    out.push_str("</HAnimJoint>\n");
}

fn write_motion(out: &mut String, poses: &[SegmentPose], body: &Proportions) {
    let last = poses.len().saturating_sub(1).max(1) as f64;
    let keys: Vec<String> = (0..poses.len()).map(|i| number(i as f64 / last)).collect();
    let keys = keys.join(" ");
    let start = DVec3::new(0.0, 0.0, body.root_height_m());
    let places: Vec<String> = poses.iter().map(|pose| vector(pose.root_m - start)).collect();
    let _ = writeln!(
        out,
        "<PositionInterpolator DEF='path' key='{keys}' keyValue='{}'/>\n\
         <ROUTE fromNode='clock' fromField='fraction_changed' toNode='path' \
         toField='set_fraction'/>\n\
         <ROUTE fromNode='path' fromField='value_changed' toNode='humanoid_root' \
         toField='set_translation'/>",
        places.join(", ")
    );
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
