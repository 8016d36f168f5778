//! Markers to bones: a trial becomes a skeleton in motion, joint angles and segment poses, with what every marker
//! says of how good they are.

use super::convert::mot;
use super::report::Outcome;
use super::source::fit_markers;
use crate::action::table;
use crate::body::proportions::proximal_joint;
use crate::body::{JointAngles, Proportions, Segment, SegmentPose, segment_name};
use crate::draft::{check_free, write_file};
use crate::error::{Error, ErrorKind};
use crate::mocap::bvh;
use crate::mocap::export::{BodyOffsets, bvh_with};
use crate::mocap::fit::Fitted;
use crate::mocap::fit::centres::SideMeasures;
use crate::mocap::fit::functional::{self, FunctionalHip};
use crate::mocap::marker_files;
use crate::table::TableWriter;
use serde::Serialize;
use std::path::{Path, PathBuf};

pub use crate::mocap::fit::FitSettings;
pub use crate::mocap::fit::centres::{HipBy, JointsAt};
pub use crate::mocap::fit::marker_set::MarkerSet;

/// Which trial becomes what.
#[derive(Clone, Debug, PartialEq)]
pub struct FitOrder {
    /// Markers in motion.
    pub trial: PathBuf,
    /// Markers of the same person who stands still.
    pub static_trial: Option<PathBuf>,
    /// Frames per second of the trial, where the file does not say them.
    pub rate_hz: Option<f64>,
    /// How it is fitted.
    pub settings: FitSettings,
    /// Trials in which legs swing, which show where hips are.
    pub hip_trials: Vec<PathBuf>,
    /// A file (.bvh, .csv, .mot), or a folder for all of it.
    pub output: PathBuf,
    /// Files may replace those that are there.
    pub replace: bool,
}

/// What came of it.
#[derive(Clone, Debug, Serialize)]
pub struct FitReport {
    /// `done`, or `done_with_loss` if a segment was not seen for a while.
    pub outcome: Outcome,
    /// The trial.
    pub trial: String,
    /// The static trial; null if the trial calibrated itself.
    pub static_trial: Option<String>,
    /// The marker set.
    pub marker_set: String,
    /// Whose markers; empty if labels name nobody.
    pub subject: String,
    /// Frames.
    pub frames: usize,
    /// Frames per second.
    pub rate_hz: f64,
    /// Stature by the legs, m.
    pub stature_m: f64,
    /// The measures that were used, left and right.
    pub measures: [SideMeasures; 2],
    /// Every segment that has markers.
    pub bones: Vec<BoneFigures>,
    /// Every marker that was used.
    pub markers: Vec<ResidualFigures>,
    /// Times in which a segment was not seen, and is filled in.
    pub unseen: Vec<UnseenFigures>,
    /// What was found out, taken for granted or lost.
    pub notes: Vec<String>,
    /// Files written.
    pub written: Vec<String>,
}

/// One segment.
#[derive(Clone, Debug, Serialize)]
pub struct BoneFigures {
    /// Its name.
    pub name: &'static str,
    /// Its length between joints; null of trunk, head and feet.
    pub length_m: Option<f64>,
    /// Root mean square residual of its markers.
    pub residual_m: f64,
}

/// One marker.
#[derive(Clone, Debug, Serialize)]
pub struct ResidualFigures {
    /// Its place.
    pub name: String,
    /// The segment that carries it.
    pub bone: &'static str,
    /// Root mean square distance from where its segment says it is.
    pub residual_m: f64,
    /// The largest such distance.
    pub worst_m: f64,
    /// Frames in which it was not seen.
    pub missing_frames: usize,
}

/// A time in which a segment was not seen.
#[derive(Clone, Debug, Serialize)]
pub struct UnseenFigures {
    /// The segment.
    pub bone: &'static str,
    /// From this time, s.
    pub start_s: f64,
    /// To this time, s.
    pub end_s: f64,
}

/// The settings, with the hips that trials of swinging legs show: of several, by the one in which the leg swings most.
fn hips_shown(order: &FitOrder) -> Result<(FitSettings, Vec<String>), Error> {
    let mut settings = order.settings.clone();
    let mut best: [Option<FunctionalHip>; 2] = [None; 2];
    for path in &order.hip_trials {
        let motion = marker_files::read(path, None)?;
        for hip in functional::hips(&motion, &settings).map_err(|error| error.in_file(path))? {
            let known = &mut best[hip.side as usize];
            if known.is_none_or(|known| known.spread_rad < hip.spread_rad) {
                *known = Some(hip);
            }
        }
    }
    settings.hips_m = best.map(|hip| Some(hip?.centre_m));
    Ok((settings, best.iter().flatten().map(FunctionalHip::words).collect()))
}

/// Fits a trial and writes what was asked for.
///
/// # Errors
/// As [`fit_markers`], an ending that nobody writes, files that exist or cannot be written.
pub fn fit(order: &FitOrder) -> Result<FitReport, Error> {
    let files = outputs(order)?;
    for (file, _) in &files {
        check_free(file, order.replace)?;
    }
    let stands = order.static_trial.as_deref();
    let (settings, hip_notes) = hips_shown(order)?;
    let mut fitted = fit_markers(&order.trial, stands, order.rate_hz, &settings)?;
    fitted.notes.extend(hip_notes);
    let capture = fitted.capture();
    for (file, kind) in &files {
        if let Some(folder) = file.parent().filter(|folder| !folder.as_os_str().is_empty()) {
            std::fs::create_dir_all(folder).map_err(|cause| {
                Error::of((&cause).into(), "the folder cannot be made")
                    .at(folder.display().to_string())
                    .got(cause.to_string())
            })?;
        }
        let bytes = match kind {
            FitFile::Skeleton => {
                let body = offsets(&fitted)?;
                bvh::write(&bvh_with(&capture.poses, &body, capture.rate_hz)).into_bytes()
            }
            FitFile::Angles => angles(&capture.poses, capture.rate_hz)?,
            FitFile::Motion => {
                let angles = JointAngles::of_clip(&capture.poses, capture.rate_hz).angles;
                mot(file, &angles, &capture.poses, capture.rate_hz)
            }
            FitFile::Segments => segments(&capture.poses, capture.rate_hz)?,
        };
        write_file(file, order.replace, &bytes)?;
    }
    Ok(report(order, &fitted, &files))
}

/// What is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum FitFile {
    Skeleton,
    Angles,
    Motion,
    Segments,
}

fn outputs(order: &FitOrder) -> Result<Vec<(PathBuf, FitFile)>, Error> {
    let one = |kind| Ok(vec![(order.output.clone(), kind)]);
    match order.output.extension().and_then(|ending| ending.to_str()) {
        Some("bvh") => one(FitFile::Skeleton),
        Some("csv") => one(FitFile::Angles),
        Some("mot") => one(FitFile::Motion),
        None => {
            let name = order.trial.file_stem().unwrap_or_default().to_string_lossy();
            let file = |ending: &str| order.output.join(format!("{name}{ending}"));
            Ok(vec![
                (file(".bvh"), FitFile::Skeleton),
                (file(".csv"), FitFile::Angles),
                (file(".mot"), FitFile::Motion),
                (file(".segments.csv"), FitFile::Segments),
            ])
        }
        Some(_) => Err(Error::of(ErrorKind::Unknown, "this kind of file cannot be written")
            .at(order.output.display().to_string())
            .allowed(
                "of fitted markers, a file that ends in .bvh, .csv or .mot, or a folder for all",
            )),
    }
}

/// The bones of the person as measured; what was not measured is as usual at this stature.
fn offsets(fitted: &Fitted) -> Result<BodyOffsets, Error> {
    let mut body = BodyOffsets::of(&Proportions::of_stature(fitted.stature_m)?);
    for segment in Segment::ALL.into_iter().filter(|segment| segment.parent().is_some()) {
        if let Some(offset_m) = fitted.offsets_m[proximal_joint(segment).index()] {
            body.begins_m[segment.index()] = offset_m;
        }
    }
    Ok(body)
}

/// The 22 joint angles, the root and the pelvis, a row per pose.
fn angles(poses: &[SegmentPose], rate_hz: f64) -> Result<Vec<u8>, Error> {
    let angles = JointAngles::of_clip(poses, rate_hz).angles;
    let mut out = TableWriter::new(Vec::new());
    out.row(table::titles().chain(table::pelvis_titles()))?;
    for (n, (angles, pose)) in angles.iter().zip(poses).enumerate() {
        let cells = table::cells(n, rate_hz, angles, pose.root_m);
        out.row(cells.chain(table::pelvis_cells(pose.orientation[Segment::Pelvis.index()])))?;
    }
    out.finish()
}

/// The orientation of every segment in the world, a row per pose.
fn segments(poses: &[SegmentPose], rate_hz: f64) -> Result<Vec<u8>, Error> {
    let mut out = TableWriter::new(Vec::new());
    let root = ["time_s", "root_x_m", "root_y_m", "root_z_m"].map(str::to_owned);
    let turns = Segment::ALL.into_iter().flat_map(|segment| {
        ["qw", "qx", "qy", "qz"].map(|part| format!("{}_{part}", segment_name(segment)))
    });
    out.row(root.into_iter().chain(turns))?;
    for (n, pose) in poses.iter().enumerate() {
        let turns = pose.orientation.iter().flat_map(|q| [q.w, q.x, q.y, q.z]);
        let values = pose.root_m.to_array().into_iter().chain(turns);
        let time = format!("{:.6}", n as f64 / rate_hz);
        out.row(std::iter::once(time).chain(values.map(|value| format!("{value:.9}"))))?;
    }
    out.finish()
}

fn report(order: &FitOrder, fitted: &Fitted, files: &[(PathBuf, FitFile)]) -> FitReport {
    let length = |segment| fitted.lengths_m.iter().find(|(of, _)| *of == segment).map(|of| of.1);
    let bones = Segment::ALL.into_iter().filter_map(|segment| {
        let residual_m = fitted.residual_m(segment)?;
        Some(BoneFigures { name: segment_name(segment), length_m: length(segment), residual_m })
    });
    let markers = fitted.markers.iter().map(|marker| ResidualFigures {
        name: marker.place.name(),
        bone: segment_name(marker.segment),
        residual_m: marker.residual_m,
        worst_m: marker.worst_m,
        missing_frames: marker.missing,
    });
    let unseen = fitted.unseen.iter().map(|gap| UnseenFigures {
        bone: segment_name(gap.segment),
        start_s: gap.from as f64 / fitted.rate_hz,
        end_s: gap.to as f64 / fitted.rate_hz,
    });
    let shown = |path: &Path| path.display().to_string();
    FitReport {
        outcome: if fitted.unseen.is_empty() { Outcome::Done } else { Outcome::DoneWithLoss },
        trial: shown(&order.trial),
        static_trial: order.static_trial.as_deref().map(shown),
        marker_set: fitted.labelled.set.name.clone(),
        subject: fitted.labelled.subject.clone(),
        frames: fitted.poses.len(),
        rate_hz: fitted.rate_hz,
        stature_m: fitted.stature_m,
        measures: fitted.measures,
        bones: bones.collect(),
        markers: markers.collect(),
        unseen: unseen.collect(),
        notes: fitted.notes.clone(),
        written: files.iter().map(|(file, _)| shown(file)).collect(),
    }
}
