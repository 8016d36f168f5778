//! Markers to bones: a trial becomes a skeleton in motion, joint angles and segment poses, with what every marker
//! says of how good they are.

use super::clean_check::marker_files_in;
use super::convert::mot;
use super::observer::{Event, Observer};
use super::report::Outcome;
use super::source::fit_markers;
use crate::action::table;
use crate::body::proportions::proximal_joint;
use crate::body::{JointAngles, Proportions, Segment, SegmentPose, segment_name};
use crate::corpus::store::check_outside;
use crate::draft::{Drafts, check_apart, check_free};
use crate::error::{Error, ErrorKind};
use crate::mocap::bvh;
use crate::mocap::c3d;
use crate::mocap::export::{BodyOffsets, bvh_with};
use crate::mocap::fit::Fitted;
use crate::mocap::fit::bones::{BoneFit, FittedBones, fit_bones};
use crate::mocap::fit::centres::SideMeasures;
use crate::mocap::fit::functional::{self, FunctionalHip};
use crate::mocap::marker_files;
use crate::mocap::markers::{FramesOf, Head};
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
    /// Which bones a BVH file has.
    pub skeleton: FitSkeleton,
    /// A file (.bvh, .csv, .mot, .c3d), or a folder for all of it.
    pub output: PathBuf,
    /// Files may replace those that are there.
    pub replace: bool,
}

/// Which bones are laid over the markers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FitSkeleton {
    /// The 13 segments of the body model.
    #[default]
    Segments,
    /// The 21 bones of the Human Motion Database.
    Bones,
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
    /// The 21 bones, if a file has them.
    pub fine_bones: Vec<FineBoneFigures>,
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

/// One of the 21 bones.
#[derive(Clone, Debug, Serialize)]
pub struct FineBoneFigures {
    /// Its name.
    pub name: &'static str,
    /// Its length while the person stands, m.
    pub length_m: f64,
    /// Root mean square distance of its markers from where it says that they are, m.
    pub residual_m: f64,
    /// Frames in which too little of it was seen: it goes with the one that carries it.
    pub unseen_frames: usize,
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
        let motion = marker_files::read_places(path, None)?;
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

/// The marker sets that a trial may have: the one of that name or file (`.toml`), else all that are shipped.
///
/// # Errors
/// If there is no such set, or the file cannot be read.
pub fn marker_sets(name: Option<&str>) -> Result<Vec<MarkerSet>, Error> {
    let Some(name) = name else { return Ok(MarkerSet::shipped()) };
    if !name.ends_with(".toml") {
        return Ok(vec![MarkerSet::named(name).map_err(|error| error.at("--markers"))?]);
    }
    let text = gaitway_profiles::read_text(Path::new(name))?;
    Ok(vec![MarkerSet::parse(&text).map_err(|error| error.at(name.to_owned()))?])
}

/// Fits a trial and writes what was asked for.
///
/// # Errors
/// As [`fit_markers`], an ending that nobody writes, files that exist or cannot be written.
pub fn fit(order: &FitOrder) -> Result<FitReport, Error> {
    let files = outputs(order)?;
    for (file, _) in &files {
        check_outside(file)?;
        check_free(file, order.replace)?;
    }
    let read = std::iter::once(&order.trial).chain(&order.static_trial).chain(&order.hip_trials);
    check_apart(read.map(PathBuf::as_path), files.iter().map(|(file, _)| file.as_path()))?;
    let stands = order.static_trial.as_deref();
    let (settings, hip_notes) = hips_shown(order)?;
    let mut fitted = fit_markers(&order.trial, stands, order.rate_hz, &settings)?;
    fitted.notes.extend(hip_notes);
    let is_fine = |kind: FitFile| match kind {
        FitFile::Skeleton => order.skeleton == FitSkeleton::Bones,
        FitFile::VirtualMarkers | FitFile::BoneFrames => true,
        FitFile::Angles | FitFile::Motion | FitFile::Segments => false,
    };
    let is_any_fine = files.iter().any(|(_, kind)| is_fine(*kind));
    let fine = is_any_fine.then(|| fine_bones(order, &settings)).transpose()?;
    if let Some((bones, _)) = &fine {
        let known: Vec<String> = fitted.notes.clone();
        fitted.notes.extend(bones.notes.iter().filter(|note| !known.contains(note)).cloned());
    }
    let capture = fitted.capture();
    let mut made = Drafts::default();
    for (file, kind) in &files {
        if let Some(folder) = file.parent().filter(|folder| !folder.as_os_str().is_empty()) {
            std::fs::create_dir_all(folder).map_err(|cause| {
                Error::of((&cause).into(), "the folder cannot be made")
                    .at(folder.display().to_string())
                    .got(cause.to_string())
            })?;
        }
        let bytes = match (kind, &fine) {
            (FitFile::Skeleton, Some((bones, _))) if is_fine(*kind) => {
                bvh::write(&bones.bvh()).into_bytes()
            }
            (FitFile::VirtualMarkers, Some((bones, head))) => {
                let markers = bones.virtual_markers(head)?;
                let mut bytes = Vec::new();
                c3d::write::write(&mut bytes, &mut FramesOf::new(&markers))?;
                bytes
            }
            (FitFile::BoneFrames, Some((bones, _))) => bone_frames(bones, fitted.rate_hz)?,
            // There are bones wherever one of their files is.
            (FitFile::Skeleton | FitFile::VirtualMarkers | FitFile::BoneFrames, _) => {
                let body = offsets(&fitted)?;
                bvh::write(&bvh_with(&capture.poses, &body, capture.rate_hz)).into_bytes()
            }
            (FitFile::Angles, _) => angles(&capture.poses, capture.rate_hz)?,
            (FitFile::Motion, _) => {
                let angles = JointAngles::of_clip(&capture.poses, capture.rate_hz).angles;
                mot(file, &angles, &capture.poses, capture.rate_hz)
            }
            (FitFile::Segments, _) => segments(&capture.poses, capture.rate_hz)?,
        };
        made.write(file, order.replace, &bytes)?;
    }
    made.keep()?;
    let mut report = report(order, &fitted, &files);
    for bone in fine.iter().flat_map(|(bones, _)| bones.bones()) {
        let BoneFit { name, length_m, residual_m, unseen_frames } = bone;
        report.fine_bones.push(FineBoneFigures { name, length_m, residual_m, unseen_frames });
    }
    Ok(report)
}

/// The 21 bones laid over the trial, and its head.
fn fine_bones(order: &FitOrder, settings: &FitSettings) -> Result<(FittedBones, Head), Error> {
    let stands = order.static_trial.as_deref();
    let stands = stands.map(|path| marker_files::read_places(path, None)).transpose()?;
    let trial = marker_files::read_places(&order.trial, order.rate_hz)?;
    let bones = fit_bones(stands.as_ref(), &trial, settings);
    let bones = bones.map_err(|error| error.in_file(&order.trial))?;
    Ok((bones, trial.head().clone()))
}

/// What came of the trials of a folder.
#[derive(Clone, Debug, Serialize)]
pub struct FitFolderReport {
    /// `done`, or `done_with_loss` if a segment was not seen for a while, or a trial could not be fitted.
    pub outcome: Outcome,
    /// All trials, by name.
    pub trials: Vec<FitTrialFigures>,
}

/// One trial of a folder.
#[derive(Clone, Debug, Serialize)]
pub struct FitTrialFigures {
    /// The file.
    pub trial: String,
    /// What came of it; null if it could not be fitted.
    pub report: Option<FitReport>,
    /// Why it could not be fitted.
    pub error: Option<String>,
}

/// Fits several trials, and all of folders, each into a folder of its own name in `output`, by one static trial. The
/// order says how; its own trial is not looked at.
///
/// # Errors
/// A folder that cannot be read or has no markers, two trials of one name, files that exist. A trial among others that cannot be
/// fitted is part of the report.
pub fn fit_each(
    order: &FitOrder,
    trials: &[PathBuf],
    observer: &dyn Observer,
) -> Result<FitFolderReport, Error> {
    if order.output.extension().is_some() {
        return Err(Error::of(ErrorKind::Unknown, "of several trials, a folder is written")
            .at(order.output.display().to_string())
            .allowed("a name without an ending"));
    }
    // Each with its name in the output.
    let mut found: Vec<(PathBuf, PathBuf)> = Vec::new();
    for trial in trials {
        if !trial.is_dir() {
            let name = trial.file_name().map(PathBuf::from).unwrap_or_default();
            found.push((trial.clone(), order.output.join(name).with_extension("")));
            continue;
        }
        let mut inside = Vec::new();
        marker_files_in(trial, &mut inside)?;
        inside.retain(|file| !file.starts_with(&order.output));
        found.extend(inside.into_iter().map(|file| {
            let to =
                order.output.join(file.strip_prefix(trial).unwrap_or(&file)).with_extension("");
            (file, to)
        }));
    }
    for (at, (trial, to)) in found.iter().enumerate() {
        if let Some((other, _)) = found[..at].iter().find(|(_, of)| of == to) {
            return Err(Error::new("two trials would go into one folder")
                .at(to.display().to_string())
                .got(format!("{} and {}", other.display(), trial.display()))
                .remedy("fit them one after the other, or give them other names"));
        }
    }
    let one = |(trial, output): (PathBuf, PathBuf)| FitOrder { trial, output, ..order.clone() };
    let orders: Vec<FitOrder> = found.into_iter().map(one).collect();
    if orders.is_empty() {
        let looked_in: Vec<String> = trials.iter().map(|path| path.display().to_string()).collect();
        return Err(Error::of(ErrorKind::Absent, "the folder has no trials of markers")
            .at(looked_in.join(", "))
            .allowed("files that end in .c3d, .trc, .csm, or tables (.csv) of markers"));
    }
    for one in &orders {
        for (file, _) in outputs(one)? {
            check_free(&file, order.replace)?;
        }
    }
    let total = orders.len() as u64;
    let mut trials = Vec::new();
    for (done, one) in orders.iter().enumerate() {
        observer.hear(Event::Step { done: done as u64, total, what: "trials" });
        let (report, error) = match fit(one) {
            Ok(report) => (Some(report), None),
            Err(error) => (None, Some(error.in_one_line())),
        };
        trials.push(FitTrialFigures { trial: one.trial.display().to_string(), report, error });
    }
    observer.hear(Event::Step { done: total, total, what: "trials" });
    let is_good = |of: &FitTrialFigures| {
        of.report.as_ref().is_some_and(|report| report.outcome == Outcome::Done)
    };
    let outcome = match trials.iter().all(is_good) {
        true => Outcome::Done,
        false => Outcome::DoneWithLoss,
    };
    Ok(FitFolderReport { outcome, trials })
}

/// What is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum FitFile {
    Skeleton,
    Angles,
    Motion,
    Segments,
    VirtualMarkers,
    BoneFrames,
}

fn outputs(order: &FitOrder) -> Result<Vec<(PathBuf, FitFile)>, Error> {
    let one = |kind| Ok(vec![(order.output.clone(), kind)]);
    match order.output.extension().and_then(|ending| ending.to_str()) {
        Some("bvh") => one(FitFile::Skeleton),
        Some("csv") => one(FitFile::Angles),
        Some("mot") => one(FitFile::Motion),
        Some("c3d") => one(FitFile::VirtualMarkers),
        None => {
            let name = order.trial.file_stem().unwrap_or_default().to_string_lossy();
            let file = |ending: &str| order.output.join(format!("{name}{ending}"));
            Ok(vec![
                (file(".bvh"), FitFile::Skeleton),
                (file(".csv"), FitFile::Angles),
                (file(".mot"), FitFile::Motion),
                (file(".segments.csv"), FitFile::Segments),
                (file(".bones.c3d"), FitFile::VirtualMarkers),
                (file(".bones.csv"), FitFile::BoneFrames),
            ])
        }
        Some(_) => Err(Error::of(ErrorKind::Unknown, "this kind of file cannot be written")
            .at(order.output.display().to_string())
            .allowed(
                "of fitted markers, a file that ends in .bvh, .csv, .mot or .c3d, or a folder for all",
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

/// Where each of the 21 bones is and how it is turned, a row per frame, in the axes of the file.
fn bone_frames(bones: &FittedBones, rate_hz: f64) -> Result<Vec<u8>, Error> {
    let mut out = TableWriter::new(Vec::new());
    let titles = bones.bone_frames(0).into_iter().flat_map(|bone| {
        ["x_m", "y_m", "z_m", "qw", "qx", "qy", "qz"].map(|part| format!("{}_{part}", bone.name))
    });
    out.row(std::iter::once("time_s".to_owned()).chain(titles))?;
    for n in 0..bones.frames() {
        let values = bones.bone_frames(n).into_iter().flat_map(|bone| {
            let [x, y, z, w] = bone.turn.to_array();
            let at_m = bone.at_m.to_array();
            at_m.into_iter().chain([w, x, y, z])
        });
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
        outcome: match fitted.unseen.is_empty() && fitted.lost_frames == 0 {
            true => Outcome::Done,
            false => Outcome::DoneWithLoss,
        },
        trial: shown(&order.trial),
        static_trial: order.static_trial.as_deref().map(shown),
        marker_set: fitted.labelled.set.name.clone(),
        subject: fitted.labelled.subject.clone(),
        frames: fitted.poses.len(),
        rate_hz: fitted.rate_hz,
        stature_m: fitted.stature_m,
        measures: fitted.measures,
        bones: bones.collect(),
        fine_bones: Vec::new(),
        markers: markers.collect(),
        unseen: unseen.collect(),
        notes: fitted.notes.clone(),
        written: files.iter().map(|(file, _)| shown(file)).collect(),
    }
}
