//! What a capture or a file of markers holds: what a person wants to know before anything is done with it.

use super::info_columns::{self, ColumnsOverview};
use super::info_folders::{self, FolderOverview};
use super::labels::{self, LabelsOverview, label_kind};
use super::sensors::{self, SensorsOverview};
use super::source::angles_table;
use super::table_text::text_of;
use crate::error::{Error, ErrorKind, counted, either};
use crate::mocap::clip::Clip;
use crate::mocap::files::{self, CaptureOptions};
use crate::mocap::marker_files;
use crate::mocap::markers::{Frame, Frames, Head, MarkerEvent, PointKind};
use crate::mocap::opensim;
use crate::mocap::plates::Plates;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::Path;

/// What is in a file.
#[derive(Clone, Debug, Serialize)]
#[serde(untagged)]
pub enum FileOverview {
    /// Points, and what was recorded beside them.
    Markers(Box<MarkerOverview>),
    /// A skeleton in motion.
    Capture(CaptureOverview),
    /// A table of OpenSim's, or of joint angles.
    Table(TableOverview),
    /// What is done when, as somebody labelled it.
    Labels(LabelsOverview),
    /// Inertial sensors.
    Sensors(SensorsOverview),
    /// A folder that programs keep motions in.
    Folder(FolderOverview),
    /// Columns that are not known.
    Columns(ColumnsOverview),
}

/// A table of OpenSim's, or of joint angles of the body.
#[derive(Clone, Debug, Serialize)]
pub struct TableOverview {
    /// `opensim` or `angles`.
    pub format: &'static str,
    /// What the file calls itself.
    pub name: String,
    /// What a cell holds: `double`, `Vec3` or `Quaternion`.
    pub cells: &'static str,
    /// Whether angles are in degrees; null if the file does not say.
    pub in_degrees: Option<bool>,
    /// Rows.
    pub rows: usize,
    /// Rows that the file claims and does not hold.
    pub lost_rows: u64,
    /// Rows per second on average; null of fewer than two.
    pub rate_hz: Option<f64>,
    /// From the first row to the last, s.
    pub duration_s: f64,
    /// Titles of the columns behind the time.
    pub columns: Vec<String>,
    /// Degrees of freedom of the body that columns say.
    pub body: Vec<&'static str>,
    /// What was wrong with the file, and what was made of it.
    pub notes: Vec<String>,
}

/// A skeleton in motion.
#[derive(Clone, Debug, Serialize)]
pub struct CaptureOverview {
    /// `bvh` or `amc`.
    pub format: &'static str,
    /// Joints.
    pub joints: usize,
    /// Poses, leading rest poses among them.
    pub frames: usize,
    /// Poses per second.
    pub rate_hz: f64,
    /// From the first pose to the last, s.
    pub duration_s: f64,
    /// Length of the file's unit, m.
    pub metres_per_unit: f64,
    /// The axis of the file that is up.
    pub up: [f64; 3],
    /// Stature, m, estimated from the legs.
    pub stature_m: f64,
    /// What was found out or taken for granted.
    pub notes: Vec<String>,
}

/// Points, and what was recorded beside them.
#[derive(Clone, Debug, Serialize)]
pub struct MarkerOverview {
    /// `c3d`, `trc`, `csm` or `csv`.
    pub format: &'static str,
    /// How numbers are stored; empty of a text.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub encoding: String,
    /// The program that wrote it; empty if it does not say.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub made_by: String,
    /// Who was captured, as far as it says so.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub subjects: Vec<String>,
    /// Frames.
    pub frames: usize,
    /// Frames that the file claims and does not hold.
    pub lost_frames: u64,
    /// Number of the first frame.
    pub first_frame: u64,
    /// Frames per second; null if unknown.
    pub rate_hz: Option<f64>,
    /// From the first frame to the last, s; null if unknown.
    pub duration_s: Option<f64>,
    /// Unit of places as the file names it; empty if it does not.
    pub unit: String,
    /// Length of the unit, m; null if unknown.
    pub metres_per_unit: Option<f64>,
    /// Axes that point right and up on a screen; null if the file does not say.
    pub screen: Option<[String; 2]>,
    /// Points by kind.
    pub points: BTreeMap<&'static str, usize>,
    /// Every marker.
    pub markers: Vec<MarkerFigures>,
    /// Gaps of all markers.
    pub gaps: usize,
    /// Share of the samples of markers that were not seen.
    pub missing_share: f64,
    /// Analog channels, if there are any.
    pub analog: Option<AnalogFigures>,
    /// What happened.
    pub events: Vec<EventFigures>,
    /// Force plates.
    pub plates: Vec<PlateFigures>,
    /// Parameters of each group of a C3D file.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub groups: BTreeMap<String, usize>,
    /// What was wrong with the file, and what was made of it.
    pub notes: Vec<String>,
    /// What other programs may stumble over in it.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub findings: Vec<String>,
}

/// One marker.
#[derive(Clone, Debug, Default, Serialize)]
pub struct MarkerFigures {
    /// Its label.
    pub name: String,
    /// Frames in which it was seen.
    pub frames: usize,
    /// Times between its first and its last frame in which it was not seen.
    pub gaps: usize,
    /// Frames of the longest gap.
    pub longest_gap_frames: usize,
    /// Number of the frame in which the longest gap begins; null without a gap.
    pub longest_gap_begins: Option<u64>,
    /// Frames in which it is said to be seen at the very origin.
    #[serde(skip_serializing_if = "is_zero")]
    pub frames_at_origin: usize,
    /// Frames since it was seen; none before it was.
    #[serde(skip)]
    unseen: Option<usize>,
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde asks so")]
fn is_zero(number: &usize) -> bool {
    *number == 0
}

/// Analog channels.
#[derive(Clone, Debug, Serialize)]
pub struct AnalogFigures {
    /// Samples per second; null if unknown.
    pub rate_hz: Option<f64>,
    /// Samples per frame.
    pub per_frame: usize,
    /// Every channel.
    pub channels: Vec<ChannelFigures>,
}

/// One channel.
#[derive(Clone, Debug, Serialize)]
pub struct ChannelFigures {
    /// Its label.
    pub name: String,
    /// Its unit; empty if the file does not say.
    pub unit: String,
    /// Its least value.
    pub least: Option<f64>,
    /// Its greatest value.
    pub greatest: Option<f64>,
}

/// One event.
#[derive(Clone, Debug, Serialize)]
pub struct EventFigures {
    /// When, s on the clock of the capture.
    pub time_s: f64,
    /// What.
    pub label: String,
    /// On which side.
    pub context: String,
    /// Of whom.
    pub subject: String,
}

/// One force plate.
#[derive(Clone, Debug, Serialize)]
pub struct PlateFigures {
    /// Its type by number.
    #[serde(rename = "type")]
    pub kind: u16,
    /// Its corners, file units.
    pub corners: [[f32; 3]; 4],
    /// Labels of its channels; null where the file names one it does not have.
    pub channels: Vec<Option<String>>,
    /// Largest force out of its surface, as somebody who stands on it is carried, N; null if it cannot be worked
    /// out. Negative if it is only ever pulled at.
    pub peak_vertical_n: Option<f64>,
}

/// Looks into a file; `None` if it is neither a capture nor markers nor a table of OpenSim's.
///
/// # Errors
/// A file that cannot be read, or breaks its format; options that do not go with it.
pub fn info(path: &Path, options: &CaptureOptions) -> Result<Option<FileOverview>, Error> {
    if marker_files::format_of(path).is_some() {
        let overview = of_markers(path, options)?;
        return Ok(Some(FileOverview::Markers(Box::new(overview))));
    }
    if files::format_of(path).is_some() {
        return Ok(Some(FileOverview::Capture(of_capture(path, options)?)));
    }
    if opensim::is_named(path) {
        return of_table(path, options).map(|table| Some(FileOverview::Table(table)));
    }
    if angles_table::is_named(path) {
        return of_angles(path, options).map(|table| Some(FileOverview::Table(table)));
    }
    if label_kind(path).is_some() {
        return labels::overview(path).map(|labels| Some(FileOverview::Labels(labels)));
    }
    let is = |ending: &str| path.extension().is_some_and(|of| of.eq_ignore_ascii_case(ending));
    if path.is_dir()
        && let Some(folder) = info_folders::overview(path)?
    {
        return Ok(Some(FileOverview::Folder(folder)));
    }
    if path.is_dir() || is("txt") {
        let sensors = sensors::overview(path, None).map_err(|error| match path.is_dir() {
            true => error.remedy(
                "name a file in it; trials of a folder are looked at by `gaitway clean FOLDER --check`",
            ),
            false => error,
        })?;
        return Ok(Some(FileOverview::Sensors(sensors)));
    }
    if is("asf") {
        return Err(Error::of(ErrorKind::Malformed, "a skeleton alone, without motion")
            .at(path.display().to_string())
            .remedy("name the .amc file beside it, which finds its skeleton, or says --skeleton"));
    }
    if is("csv") {
        let text = text_of(path)?;
        return info_columns::overview(path, &text).map(|of| Some(FileOverview::Columns(of)));
    }
    Ok(None)
}

fn of_table(path: &Path, options: &CaptureOptions) -> Result<TableOverview, Error> {
    if options != &CaptureOptions::default() {
        return Err(Error::new("a table has its times in it, and no skeleton")
            .at(path.display().to_string())
            .got("a skeleton or a rate beside it"));
    }
    let table = opensim::read(path)?;
    let body = table.body_columns().into_iter().map(|(_, dof)| dof.name()).collect();
    let not_numbers = table.not_numbers();
    Ok(TableOverview {
        format: "opensim",
        cells: table.cell.word(),
        in_degrees: table.in_degrees,
        rows: table.rows(),
        lost_rows: table.lost_rows,
        rate_hz: table.rate_hz(),
        duration_s: table.duration_s(),
        body,
        name: table.name,
        columns: table.columns,
        notes: table.notes.into_iter().chain(not_numbers).collect(),
    })
}

fn of_angles(path: &Path, options: &CaptureOptions) -> Result<TableOverview, Error> {
    if options != &CaptureOptions::default() {
        return Err(Error::new("a table has its times in it, and no skeleton")
            .at(path.display().to_string())
            .got("a skeleton or a rate beside it"));
    }
    let table = angles_table::read(path)?;
    let body: Vec<&'static str> = table.said.iter().map(|dof| dof.name()).collect();
    let root = if table.roots_m.is_empty() { &[][..] } else { &["root"] };
    let pelvis = if table.pelvis.is_empty() { &[][..] } else { &["pelvis"] };
    let columns = body.iter().chain(root).chain(pelvis).map(|name| (*name).to_owned()).collect();
    Ok(TableOverview {
        format: "angles",
        name: String::new(),
        cells: "double",
        in_degrees: Some(table.in_degrees),
        rows: table.angles.len(),
        lost_rows: 0,
        rate_hz: Some(table.rate_hz),
        duration_s: table.angles.len().saturating_sub(1) as f64 / table.rate_hz,
        columns,
        body,
        notes: table.notes,
    })
}

fn of_capture(path: &Path, options: &CaptureOptions) -> Result<CaptureOverview, Error> {
    let file = files::read(path, options)?;
    let joints = file.bvh.joints.len();
    let clip = Clip::new(file.bvh, None).map_err(|error| match error.place {
        None => error.at(path.display().to_string()),
        Some(_) => error,
    })?;
    let frames = clip.dropped() + clip.pose_count();
    Ok(CaptureOverview {
        format: file.format.word(),
        joints,
        frames,
        rate_hz: clip.rate_hz(),
        duration_s: frames.saturating_sub(1) as f64 / clip.rate_hz(),
        metres_per_unit: clip.metres_per_unit(),
        up: clip.file_up().to_array().map(f64::round),
        stature_m: clip.stature_m(),
        notes: file.notes.into_iter().chain(clip.notes().iter().cloned()).collect(),
    })
}

fn of_markers(path: &Path, options: &CaptureOptions) -> Result<MarkerOverview, Error> {
    if options.skeleton.is_some() {
        return Err(Error::new("markers have no skeleton")
            .at(path.display().to_string())
            .got("a skeleton beside it")
            .allowed("one for AMC files"));
    }
    let mut reader = marker_files::open(path)?;
    if let Some(rate_hz) = options.rate_hz {
        reader.take_rate(rate_hz)?;
    }
    let head = reader.head().clone();
    let is_marker = |at: &usize| head.points.get(*at).is_some_and(|p| p.kind == PointKind::Marker);
    let chosen: Vec<usize> = (0..head.points.len()).filter(is_marker).collect();
    let name = |at: &usize| head.points.get(*at).map(|p| p.label.clone()).unwrap_or_default();
    let mut markers: Vec<MarkerFigures> = chosen
        .iter()
        .map(|at| MarkerFigures { name: name(at), ..MarkerFigures::default() })
        .collect();
    let mut ranges = vec![(f64::INFINITY, f64::NEG_INFINITY); head.analog.channels.len()];
    let mut no_number: Option<(u64, String)> = None;
    let plates = Plates::of(&head);
    let mut peaks: Vec<Option<f64>> = vec![None; head.plates.len()];
    let (mut frame, mut number) = (Frame::default(), head.first_frame);
    while reader.next_frame(&mut frame)? {
        for (figures, at) in markers.iter_mut().zip(&chosen) {
            let sample = frame.points.get(*at).copied().flatten();
            figures.take(sample.map(|sample| sample.position), number);
        }
        if !ranges.is_empty() {
            for sample in frame.analog.chunks_exact(ranges.len()) {
                let values = sample.iter().zip(&head.analog.channels);
                for ((least, greatest), (count, channel)) in ranges.iter_mut().zip(values) {
                    let value = channel.value(*count);
                    if !value.is_finite() {
                        no_number
                            .get_or_insert_with(|| {
                                (0, format!("in frame {number}, of {}", channel.label))
                            })
                            .0 += 1;
                        continue;
                    }
                    *least = least.min(value);
                    *greatest = greatest.max(value);
                }
                for (at, plate) in &plates.list {
                    let up_n = plate.at(&head.analog, sample).force_n.dot(plate.up());
                    if let Some(peak) = peaks.get_mut(*at) {
                        *peak = Some(peak.map_or(up_n, |peak: f64| peak.max(up_n)));
                    }
                }
            }
        }
        number += 1;
    }
    let mut notes = head.notes.clone();
    notes.extend(reader.closing_notes());
    notes.extend(plates.notes);
    if let Some((count, first)) = no_number {
        let samples = counted(count, "analog sample");
        let are = either(count, "is no finite number", "are no finite numbers");
        notes.push(format!("{samples} {are}, the first {first}"));
    }
    let at_origin = markers.iter().filter(|figures| figures.frames_at_origin > 0).count();
    if at_origin > 0 {
        let samples: usize = markers.iter().map(|figures| figures.frames_at_origin).sum();
        notes.push(format!(
            "{} of {} {} at the very origin, and marked as seen: most likely {} not",
            counted(samples, "sample"),
            counted(at_origin, "marker"),
            either(samples, "is", "are"),
            either(samples, "it was", "they were")
        ));
    }
    let told = Told { markers, ranges, peaks, notes, findings: reader.findings() };
    Ok(overview(&head, told))
}

impl MarkerFigures {
    /// Takes in where it was in the next frame.
    fn take(&mut self, position: Option<[f32; 3]>, number: u64) {
        let Some(position) = position else {
            self.unseen = self.unseen.map(|unseen| unseen + 1);
            return;
        };
        self.frames += 1;
        self.frames_at_origin += usize::from(position == [0.0; 3]);
        if let Some(unseen) = self.unseen.filter(|unseen| *unseen > 0) {
            self.gaps += 1;
            if unseen > self.longest_gap_frames {
                self.longest_gap_frames = unseen;
                self.longest_gap_begins = Some(number - unseen as u64);
            }
        }
        self.unseen = Some(0);
    }
}

/// What the frames of a file told.
struct Told {
    markers: Vec<MarkerFigures>,
    /// Least and greatest value of each analog channel.
    ranges: Vec<(f64, f64)>,
    /// Of each force plate.
    peaks: Vec<Option<f64>>,
    notes: Vec<String>,
    findings: Vec<String>,
}

fn overview(head: &Head, told: Told) -> MarkerOverview {
    let Told { markers, ranges, peaks, notes, findings } = told;
    let mut points = BTreeMap::new();
    for point in &head.points {
        *points.entry(point.kind.word()).or_insert(0) += 1;
    }
    let samples = head.frames * markers.len();
    let seen: usize = markers.iter().map(|figures| figures.frames).sum();
    let channel =
        |(channel, (least, greatest)): (&crate::mocap::markers::AnalogChannel, &(f64, f64))| {
            let known = |value: f64| value.is_finite().then_some(value);
            ChannelFigures {
                name: channel.label.clone(),
                unit: channel.unit.clone(),
                least: known(*least),
                greatest: known(*greatest),
            }
        };
    let analog = (!head.analog.channels.is_empty()).then(|| AnalogFigures {
        rate_hz: head.analog.rate_hz,
        per_frame: head.analog.per_frame,
        channels: head.analog.channels.iter().zip(&ranges).map(channel).collect(),
    });
    let label = |at: &Option<usize>| {
        at.and_then(|at| head.analog.channels.get(at)).map(|channel| channel.label.clone())
    };
    let plates = head.plates.iter().zip(peaks).map(|(plate, peak)| PlateFigures {
        kind: plate.kind.number(),
        corners: plate.corners,
        channels: plate.channels.iter().map(label).collect(),
        peak_vertical_n: peak.filter(|peak| peak.is_finite()),
    });
    let event = |event: &MarkerEvent| EventFigures {
        time_s: event.time_s,
        label: event.label.clone(),
        context: event.context.clone(),
        subject: event.subject.clone(),
    };
    let mut groups = BTreeMap::new();
    for group in &head.parameters.groups {
        let name = crate::mocap::parameters::text_of(&group.name).into_owned();
        *groups.entry(name).or_insert(0) += group.parameters.len();
    }
    let is_said = head.screen.iter().any(|axis| !axis.is_empty());
    MarkerOverview {
        format: head.format.word(),
        encoding: head.encoding.clone(),
        made_by: head.made_by.clone(),
        subjects: head.subjects.clone(),
        frames: head.frames,
        lost_frames: head.lost_frames,
        first_frame: head.first_frame,
        rate_hz: head.rate_hz,
        duration_s: head.duration_s(),
        unit: head.unit.clone(),
        metres_per_unit: head.metres_per_unit(),
        screen: is_said.then(|| head.screen.clone()),
        points,
        gaps: markers.iter().map(|figures| figures.gaps).sum(),
        missing_share: if samples == 0 { 0.0 } else { 1.0 - seen as f64 / samples as f64 },
        markers,
        analog,
        events: head.events.iter().map(event).collect(),
        plates: plates.collect(),
        groups,
        notes,
        findings,
    }
}
