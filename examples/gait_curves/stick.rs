//! Stick figures side by side, seen from the right: left limbs grey, right limbs red.

use gaitway::body::{End, Joint, JointPositions};
use std::fmt::Write;

const SCALE: f64 = 90.0;
const APART: f64 = 118.0;
const GROUND: f64 = 190.0;

/// Figures with names under them, on one ground; each is placed by its own pelvis.
pub fn strip(figures: &[(String, JointPositions)]) -> String {
    let width = APART * figures.len() as f64;
    let mut drawn = String::new();
    for (place, (name, at)) in figures.iter().enumerate() {
        let middle = APART * (place as f64 + 0.5);
        let root_m = at.joint_m(Joint::Pelvis);
        let mut line = |points_m: &[glam::DVec3], colour: &str| {
            let mut points = String::new();
            for p in points_m {
                let x = middle + (p.x - root_m.x) * SCALE;
                let _ = write!(points, "{x:.1},{:.1} ", GROUND - p.z * SCALE);
            }
            let style = format!("fill='none' stroke='{colour}' stroke-width='3'");
            let _ = write!(drawn, "<polyline points='{points}' {style}/>");
        };
        let joints = |all: &[Joint]| all.iter().map(|j| at.joint_m(*j)).collect::<Vec<_>>();
        let mut limb = |all: &[Joint], ends: &[End], colour: &str| {
            let mut points = joints(all);
            points.extend(ends.iter().map(|end| at.end_m(*end)));
            line(&points, colour);
        };
        let (grey, red, dark) = ("#999", "#c0392b", "#222");
        use End::{HeadTop, LeftFingertip, LeftHeel, LeftToe, RightFingertip, RightHeel, RightToe};
        use Joint::{LeftAnkle, LeftElbow, LeftHip, LeftKnee, LeftShoulder, Neck, Pelvis};
        use Joint::{RightAnkle, RightElbow, RightHip, RightKnee, RightShoulder, Torso};
        limb(&[LeftHip, LeftKnee, LeftAnkle], &[LeftHeel, LeftToe], grey);
        limb(&[LeftShoulder, LeftElbow], &[LeftFingertip], grey);
        limb(&[Pelvis, Torso, Neck], &[HeadTop], dark);
        limb(&[RightHip, RightKnee, RightAnkle], &[RightHeel, RightToe], red);
        limb(&[RightShoulder, RightElbow], &[RightFingertip], red);
        let (x, y) = (middle, GROUND + 18.0);
        let _ = write!(drawn, "<text x='{x}' y='{y}' text-anchor='middle'>{name}</text>");
    }
    format!(
        "<p><svg viewBox='0 0 {width} 215' width='{width}'><line x1='0' x2='{width}' y1='{GROUND}' \
         y2='{GROUND}' stroke='#888'/>{drawn}</svg></p>\n"
    )
}
