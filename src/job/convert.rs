//! A capture on the body model: its 22 joint angles, and where the pelvis is and how it is turned, as
//! a table, a skeleton, a scene, a page or a motion file of OpenSim's.

use super::source::{self, Source};
use crate::action::table;
use crate::body::{JointAngles, Proportions, Segment, SegmentPose, contact};
use crate::draft;
use crate::error::{Error, ErrorKind};
use crate::mocap::files::CaptureOptions;
use crate::mocap::scene::{DrawnFeet, Scene};
use crate::mocap::{bvh, export, humanoid, opensim};
use crate::table::TableWriter;
use crate::view::scene::page_of;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Which capture becomes which file.
#[derive(Clone, Debug, PartialEq)]
pub struct ConvertOrder {
    /// A capture (.bvh, .amc).
    pub capture: PathBuf,
    /// What it does not say itself.
    pub reading: CaptureOptions,
    /// File that says which joint of the capture is which body segment.
    pub mapping: Option<PathBuf>,
    /// Stature of the body, m; `None`: as estimated from the capture.
    pub stature_m: Option<f64>,
    /// The file, whose ending says what is written.
    pub file: PathBuf,
    /// It may replace one that is there.
    pub replace: bool,
}

/// What came of it.
#[derive(Clone, Debug, Serialize)]
pub struct ConvertReport {
    /// `done`.
    pub outcome: &'static str,
    /// The capture as it came in.
    pub source: Source,
    /// Poses written.
    pub poses: usize,
    /// Poses per second.
    pub rate_hz: f64,
    /// Stature of the body, m.
    pub stature_m: f64,
    /// Farthest that the torso leans against the pelvis, deg.
    pub most_torso_lean_deg: f64,
    /// Farthest that the pelvis leans against the vertical, deg.
    pub most_pelvis_lean_deg: f64,
    /// Choices made on the way.
    pub notes: Vec<String>,
    /// Where.
    pub written: String,
}

/// What is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum BodyFile {
    /// A table.
    Csv,
    /// A skeleton.
    Bvh,
    /// A scene.
    X3d,
    /// A page that draws it.
    Html,
    /// Joint angles for OpenSim.
    Mot,
}

impl BodyFile {
    fn of(path: &Path) -> Result<Self, Error> {
        match path.extension().and_then(|ending| ending.to_str()) {
            Some("csv") => Ok(Self::Csv),
            Some("bvh") => Ok(Self::Bvh),
            Some("x3d") => Ok(Self::X3d),
            Some("html") => Ok(Self::Html),
            Some("mot") => Ok(Self::Mot),
            _ => Err(Error::of(ErrorKind::Unknown, "this kind of file cannot be written")
                .at(path.display().to_string())
                .allowed("of a capture, a file that ends in .csv, .bvh, .mot, .x3d or .html")),
        }
    }
}

/// Writes a capture as a motion of the body model. What the model has no joint for (the head's turning
/// and its lean to the side, the forearm's turning) is left out; trunk and pelvis are whole.
///
/// # Errors
/// A capture that cannot be read, another ending of the file, a stature that no person has, a file
/// that cannot be written.
pub fn convert(order: &ConvertOrder) -> Result<ConvertReport, Error> {
    let kind = BodyFile::of(&order.file)?;
    let motion = order.capture.display().to_string();
    let (capture, source) = source::body_motion(&motion, order.mapping.as_deref(), &order.reading)?;
    let stature_m = order.stature_m.unwrap_or(capture.stature_m);
    let body = Proportions::of_stature(stature_m)?;
    let angles = JointAngles::of_clip(&capture.poses, capture.rate_hz).angles;
    let modelled = |(angles, pose): (&JointAngles, &SegmentPose)| {
        angles.to_pose(pose.root_m, pose.orientation[Segment::Pelvis.index()])
    };
    let poses: Vec<SegmentPose> = angles.iter().zip(&capture.poses).map(modelled).collect();
    let scene = || Scene {
        title: &motion,
        poses: &poses,
        body: &body,
        rate_hz: capture.rate_hz,
        floor_m: contact::floor_m(&body, &poses),
        feet: DrawnFeet::of(capture.is_made, &capture.tracked),
    };
    let bytes = match kind {
        BodyFile::Csv => csv(&angles, &poses, capture.rate_hz)?,
        BodyFile::Bvh => bvh::write(&export::bvh_of(&poses, &body, capture.rate_hz)).into_bytes(),
        BodyFile::X3d => humanoid::x3d_of(&scene()).into_bytes(),
        BodyFile::Html => page_of(&scene())?.into_bytes(),
        BodyFile::Mot => mot(&order.file, &angles, &poses, capture.rate_hz),
    };
    draft::write_file(&order.file, order.replace, &bytes)?;
    let most = |lean_rad: &dyn Fn(&SegmentPose) -> f64| {
        poses.iter().map(lean_rad).fold(0.0, f64::max).to_degrees()
    };
    Ok(ConvertReport {
        outcome: "done",
        source,
        poses: poses.len(),
        rate_hz: capture.rate_hz,
        stature_m,
        most_torso_lean_deg: most(&SegmentPose::torso_lean_rad),
        most_pelvis_lean_deg: most(&SegmentPose::pelvis_lean_rad),
        notes: capture.notes,
        written: order.file.display().to_string(),
    })
}

/// Joint angles, and where the pelvis is and how it is turned, for OpenSim; of each pose its angles.
pub(super) fn mot(
    file: &Path,
    angles: &[JointAngles],
    poses: &[SegmentPose],
    rate_hz: f64,
) -> Vec<u8> {
    let name = file.file_stem().unwrap_or_default().to_string_lossy();
    let rows = angles.iter().zip(poses);
    let rows = rows
        .map(|(angles, pose)| (*angles, pose.root_m, pose.orientation[Segment::Pelvis.index()]));
    opensim::write(&name, rate_hz, rows).into_bytes()
}

/// Angles, root and pelvis, a row per pose.
fn csv(angles: &[JointAngles], poses: &[SegmentPose], rate_hz: f64) -> Result<Vec<u8>, Error> {
    let mut out = TableWriter::new(Vec::new());
    out.row(table::titles().chain(table::pelvis_titles()))?;
    for (n, (angles, pose)) in angles.iter().zip(poses).enumerate() {
        let cells = table::cells(n, rate_hz, angles, pose.root_m);
        out.row(cells.chain(table::pelvis_cells(pose.orientation[Segment::Pelvis.index()])))?;
    }
    out.finish()
}
