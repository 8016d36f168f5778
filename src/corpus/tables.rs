//! The tables of a corpus: which columns they have, and how rows go into them and come out again.

use super::rows::{
    Consent, FramesPlace, LabelEntry, PARAMETERS, SubjectEntry, TrialEntry, TrialKind,
};
use crate::body::anthropometry::{Measure, Subject};
use crate::body::{Dof, JointAngles, Segment, SegmentPose};
use crate::clean::sha256::Sha256;
use crate::columnar::{Column, ColumnKind, ColumnSpec, TableSchema, Word};
use crate::error::{Error, ErrorKind};
use glam::{DQuat, DVec3};
use std::collections::BTreeMap;

/// The tables that are partitioned by set and action.
pub const TRIALS: &str = "trials";
/// As [`TRIALS`].
pub const LABELS: &str = "labels";
/// As [`TRIALS`].
pub const FRAMES: &str = "frames";
/// The table of people.
pub const SUBJECTS: &str = "subjects";

/// Rows of the catalogue in a row group.
pub const ROWS_IN_GROUP: usize = 16_384;

fn spec(name: &str, kind: ColumnKind) -> ColumnSpec {
    (name.to_owned(), kind)
}

/// Columns of the table of trials; set and action are told by the folders they lie in.
#[must_use]
pub fn trial_columns() -> Vec<ColumnSpec> {
    use ColumnKind::{Flag, Real, Text, Whole};
    let before = [
        ("trial", Text),
        ("name", Text),
        ("kind", Text),
        ("synthetic", Flag),
        ("subject", Text),
        ("session", Text),
        ("source", Text),
        ("format", Text),
        ("source_sha256", Text),
        ("source_file", Text),
        ("provenance", Text),
        ("licence", Text),
        ("noncommercial", Flag),
        ("verdict", Text),
        ("repetitions", Whole),
        ("edits_sha256", Text),
        ("untracked", Text),
        ("part_of", Text),
        ("body_stature_m", Real),
        ("frames", Whole),
        ("rate_hz", Real),
        ("duration_s", Real),
        ("frames_sha256", Text),
    ];
    let parameters = PARAMETERS.map(|name| (name, Real));
    let place = [("frames_file", Text), ("frames_group", Whole), ("frames_first_row", Whole)];
    let all = before.into_iter().chain(parameters).chain(place);
    all.map(|(name, kind)| spec(name, kind)).collect()
}

/// Columns of the table of labels.
#[must_use]
pub fn label_columns() -> Vec<ColumnSpec> {
    use ColumnKind::{Real, Text, Whole};
    let all = [
        ("trial", Text),
        ("label", Text),
        ("first_frame", Whole),
        ("last_frame", Whole),
        ("value", Real),
        ("annotator", Text),
    ];
    all.map(|(name, kind)| spec(name, kind)).to_vec()
}

/// What a measure is called in a table.
#[must_use]
pub fn measure_name(measure: Measure) -> String {
    // Its name in files is the one that is serialized.
    let name = serde_json::to_value(measure).ok();
    name.and_then(|name| name.as_str().map(str::to_owned)).unwrap_or_default()
}

/// Columns of the table of people.
#[must_use]
pub fn subject_columns() -> Vec<ColumnSpec> {
    use ColumnKind::{Real, Text};
    let words = ["subject", "gender", "consent", "remarks"].map(|name| spec(name, Text));
    let measures = Measure::ALL.map(|measure| (measure_name(measure), Real));
    words.into_iter().chain(measures).collect()
}

/// Columns of the frames that are told in every frame, in their order: angles, the root, how the pelvis is turned.
#[must_use]
pub fn signal_names() -> Vec<String> {
    let angles = Dof::ALL.map(|dof| format!("{}_rad", dof.name()));
    let root = ["root_x_m", "root_y_m", "root_z_m"].map(str::to_owned);
    let turned = ["root_qw", "root_qx", "root_qy", "root_qz"].map(str::to_owned);
    angles.into_iter().chain(root).chain(turned).collect()
}

/// Columns of the table of frames.
#[must_use]
pub fn frame_columns() -> Vec<ColumnSpec> {
    use ColumnKind::{Single, Text, Whole};
    let before = [spec("trial", Text), spec("frame", Whole), spec("time_s", Single)];
    before.into_iter().chain(signal_names().into_iter().map(|name| (name, Single))).collect()
}

/// How all tables are laid out.
pub struct Schemas {
    /// Trials.
    pub trials: TableSchema,
    /// Labels.
    pub labels: TableSchema,
    /// People.
    pub subjects: TableSchema,
    /// Frames.
    pub frames: TableSchema,
}

impl Schemas {
    /// The layouts of this version.
    ///
    /// # Errors
    /// None that these columns have.
    pub fn new() -> Result<Self, Error> {
        Ok(Self {
            trials: TableSchema::new(TRIALS, trial_columns(), &[])?,
            labels: TableSchema::new(LABELS, label_columns(), &[])?,
            subjects: TableSchema::new(SUBJECTS, subject_columns(), &[])?,
            frames: TableSchema::new(FRAMES, frame_columns(), &["time_s"])?,
        })
    }
}

/// Fills a row group, cell by cell.
struct Filling<'a> {
    columns: &'a mut [Column],
    at: usize,
}

impl Filling<'_> {
    fn next(&mut self) -> Option<&mut Column> {
        let column = self.columns.get_mut(self.at);
        self.at += 1;
        column
    }

    fn text(&mut self, value: Option<&str>) {
        if let Some(Column::Text(all)) = self.next() {
            all.push(value.map(Word::from));
        }
    }

    fn whole(&mut self, value: Option<i64>) {
        if let Some(Column::Whole(all)) = self.next() {
            all.push(value);
        }
    }

    fn real(&mut self, value: Option<f64>) {
        if let Some(Column::Real(all)) = self.next() {
            all.push(value);
        }
    }

    fn flag(&mut self, value: bool) {
        if let Some(Column::Flag(all)) = self.next() {
            all.push(value);
        }
    }
}

/// Appends a trial to a row group of [`trial_columns`].
pub fn push_trial(columns: &mut [Column], of: &TrialEntry) {
    let mut row = Filling { columns, at: 0 };
    row.text(Some(&of.trial));
    row.text(Some(&of.name));
    row.text(Some(of.kind.word()));
    row.flag(of.synthetic);
    row.text(of.subject.as_deref());
    row.text(of.session.as_deref());
    row.text(Some(&of.source));
    row.text(Some(&of.format));
    row.text(of.source_sha256.as_deref());
    row.text(of.source_file.as_deref());
    row.text(of.provenance.as_deref());
    row.text(Some(&of.licence));
    row.flag(of.noncommercial);
    row.text(of.verdict.as_deref());
    row.whole(of.repetitions);
    row.text(of.edits_sha256.as_deref());
    row.text(of.untracked.as_deref());
    row.text(of.part_of.as_deref());
    row.real(Some(of.body_stature_m));
    row.whole(Some(of.frames));
    row.real(Some(of.rate_hz));
    row.real(Some(of.duration_s));
    row.text(Some(&of.frames_sha256));
    for name in PARAMETERS {
        row.real(of.parameters.get(name).copied());
    }
    row.text(of.place.as_ref().map(|place| place.file.as_str()));
    row.whole(of.place.as_ref().map(|place| place.group));
    row.whole(of.place.as_ref().map(|place| place.first_row));
}

/// Appends a label to a row group of [`label_columns`].
pub fn push_label(columns: &mut [Column], of: &LabelEntry) {
    let mut row = Filling { columns, at: 0 };
    row.text(Some(&of.trial));
    row.text(Some(&of.label));
    row.whole(Some(of.first_frame));
    row.whole(Some(of.last_frame));
    row.real(Some(of.value));
    row.text(Some(&of.annotator));
}

/// Appends a person to a row group of [`subject_columns`].
pub fn push_subject(columns: &mut [Column], of: &SubjectEntry) {
    let mut row = Filling { columns, at: 0 };
    let told = |text: &'_ str| (!text.is_empty()).then(|| text.to_owned());
    row.text(Some(&of.subject.id));
    row.text(told(&of.subject.gender).as_deref());
    row.text(Some(of.consent.word()));
    row.text(told(&of.subject.remarks).as_deref());
    for measure in Measure::ALL {
        row.real(of.measure(measure));
    }
}

/// Reads rows out of a row group of the columns with these names.
struct Rows<'a> {
    specs: &'a [ColumnSpec],
    columns: &'a [Column],
}

impl Rows<'_> {
    fn column(&self, name: &str) -> Option<&Column> {
        let index = self.specs.iter().position(|(known, _)| known == name)?;
        self.columns.get(index)
    }

    fn text(&self, name: &str, row: usize) -> Option<String> {
        self.column(name)?.text(row).map(str::to_owned)
    }

    fn needed(&self, name: &str, row: usize) -> Result<String, Error> {
        self.text(name, row).ok_or_else(|| lacks(name))
    }

    fn whole(&self, name: &str, row: usize) -> Option<i64> {
        self.column(name)?.whole(row)
    }

    fn real(&self, name: &str, row: usize) -> Option<f64> {
        self.column(name)?.real(row)
    }
}

fn lacks(column: &str) -> Error {
    Error::of(ErrorKind::Malformed, "a row of the corpus lacks what it must have").at(column)
}

/// The trials in a row group of a partition.
///
/// # Errors
/// A row that lacks what it must have.
pub fn trials_of(columns: &[Column], set: &str, action: &str) -> Result<Vec<TrialEntry>, Error> {
    let specs = trial_columns();
    let rows = Rows { specs: &specs, columns };
    (0..columns.first().map_or(0, Column::len))
        .map(|row| trial_of(&rows, row, set, action))
        .collect()
}

fn trial_of(rows: &Rows<'_>, row: usize, set: &str, action: &str) -> Result<TrialEntry, Error> {
    let flag = |name: &str| rows.column(name).and_then(|c| c.flag(row)).ok_or_else(|| lacks(name));
    let number = |name: &str| rows.real(name, row).ok_or_else(|| lacks(name));
    let kind = rows.needed("kind", row)?;
    let kind = TrialKind::ALL.into_iter().find(|known| known.word() == kind);
    let parameters: BTreeMap<String, f64> = PARAMETERS
        .iter()
        .filter_map(|name| Some(((*name).to_owned(), rows.real(name, row)?)))
        .collect();
    let place = rows.text("frames_file", row).and_then(|file| {
        let group = rows.whole("frames_group", row)?;
        Some(FramesPlace { file, group, first_row: rows.whole("frames_first_row", row)? })
    });
    Ok(TrialEntry {
        trial: rows.needed("trial", row)?,
        name: rows.needed("name", row)?,
        set: set.to_owned(),
        action: action.to_owned(),
        kind: kind.ok_or_else(|| lacks("kind"))?,
        synthetic: flag("synthetic")?,
        subject: rows.text("subject", row),
        session: rows.text("session", row),
        source: rows.needed("source", row)?,
        format: rows.needed("format", row)?,
        source_sha256: rows.text("source_sha256", row),
        source_file: rows.text("source_file", row),
        provenance: rows.text("provenance", row),
        licence: rows.needed("licence", row)?,
        noncommercial: flag("noncommercial")?,
        verdict: rows.text("verdict", row),
        repetitions: rows.whole("repetitions", row),
        edits_sha256: rows.text("edits_sha256", row),
        untracked: rows.text("untracked", row),
        part_of: rows.text("part_of", row),
        body_stature_m: number("body_stature_m")?,
        frames: rows.whole("frames", row).ok_or_else(|| lacks("frames"))?,
        rate_hz: number("rate_hz")?,
        duration_s: number("duration_s")?,
        frames_sha256: rows.needed("frames_sha256", row)?,
        parameters,
        place,
    })
}

/// The labels in a row group of a partition.
///
/// # Errors
/// A row that lacks what it must have.
pub fn labels_of(columns: &[Column], set: &str, action: &str) -> Result<Vec<LabelEntry>, Error> {
    let specs = label_columns();
    let rows = Rows { specs: &specs, columns };
    let label = |row: usize| -> Result<LabelEntry, Error> {
        let frame = |name: &str| rows.whole(name, row).ok_or_else(|| lacks(name));
        Ok(LabelEntry {
            trial: rows.needed("trial", row)?,
            set: set.to_owned(),
            action: action.to_owned(),
            label: rows.needed("label", row)?,
            first_frame: frame("first_frame")?,
            last_frame: frame("last_frame")?,
            value: rows.real("value", row).ok_or_else(|| lacks("value"))?,
            annotator: rows.needed("annotator", row)?,
        })
    };
    (0..columns.first().map_or(0, Column::len)).map(label).collect()
}

/// The people in a row group.
///
/// # Errors
/// A row that lacks what it must have.
pub fn subjects_of(columns: &[Column]) -> Result<Vec<SubjectEntry>, Error> {
    let specs = subject_columns();
    let rows = Rows { specs: &specs, columns };
    let subject = |row: usize| -> Result<SubjectEntry, Error> {
        let consent = rows.needed("consent", row)?;
        let measures = Measure::ALL.into_iter().filter_map(|measure| {
            rows.real(&measure_name(measure), row).map(|value| (measure, value))
        });
        let subject = Subject {
            id: rows.needed("subject", row)?,
            gender: rows.text("gender", row).unwrap_or_default(),
            remarks: rows.text("remarks", row).unwrap_or_default(),
            measures: measures.collect(),
        };
        Ok(SubjectEntry {
            subject,
            consent: Consent::of(&consent).ok_or_else(|| lacks("consent"))?,
        })
    };
    (0..columns.first().map_or(0, Column::len)).map(subject).collect()
}

/// The frames of a trial: what the body does at an even rate, as numbers of single precision.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TrialFrames {
    /// Signal by signal, in the order of [`signal_names`]: frame by frame.
    pub signals: Vec<Vec<f32>>,
}

impl TrialFrames {
    /// Of poses that follow one another.
    #[must_use]
    pub fn of(poses: &[SegmentPose]) -> Self {
        let mut signals = vec![Vec::with_capacity(poses.len()); signal_names().len()];
        let mut before: Option<JointAngles> = None;
        let mut turned_before = DQuat::IDENTITY;
        for pose in poses {
            let measured = match &before {
                None => JointAngles::of_pose(pose),
                Some(before) => JointAngles::of_pose_after(pose, before),
            };
            let turned = pose.orientation[Segment::Pelvis.index()];
            // Of the two signs of a quaternion the one that goes on from the frame before.
            let turned = if turned.dot(turned_before) < 0.0 { -turned } else { turned };
            turned_before = turned;
            let root = pose.root_m.to_array();
            let values = measured.angles.0.into_iter().chain(root);
            let values = values.chain([turned.w, turned.x, turned.y, turned.z]);
            for (signal, value) in signals.iter_mut().zip(values) {
                signal.push(value as f32);
            }
            before = Some(measured.angles);
        }
        Self { signals }
    }

    /// How many frames.
    #[must_use]
    pub fn len(&self) -> usize {
        self.signals.first().map_or(0, Vec::len)
    }

    /// True of none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// True if every number is one.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.signals.iter().flatten().all(|value| value.is_finite())
    }

    /// SHA-256 of the rate and of all numbers, little endian, signal by signal.
    #[must_use]
    pub fn sha256(&self, rate_hz: f64) -> String {
        let mut hash = Sha256::default();
        hash.update(&rate_hz.to_le_bytes());
        for signal in &self.signals {
            let bytes: Vec<u8> = signal.iter().flat_map(|value| value.to_le_bytes()).collect();
            hash.update(&bytes);
        }
        hash.finish()
    }

    /// The poses.
    #[must_use]
    pub fn poses(&self) -> Vec<SegmentPose> {
        let value = |signal: usize, frame: usize| f64::from(self.signals[signal][frame]);
        let pose = |frame: usize| {
            let angles = JointAngles(std::array::from_fn(|dof| value(dof, frame)));
            let root = DVec3::new(value(22, frame), value(23, frame), value(24, frame));
            let [w, x, y, z] = [25, 26, 27, 28].map(|signal| value(signal, frame));
            let turned = DQuat::from_xyzw(x, y, z, w).normalize();
            angles.to_pose(root, turned)
        };
        (0..self.len()).map(pose).collect()
    }

    /// Appends its frames to a row group of [`frame_columns`].
    pub fn push(&self, columns: &mut [Column], trial: &str, rate_hz: f64) {
        let word = Word::from(trial);
        for (index, column) in columns.iter_mut().enumerate() {
            let frames = 0..self.len();
            match (index, column) {
                (0, Column::Text(all)) => all.extend(frames.map(|_| Some(word.clone()))),
                (1, Column::Whole(all)) => all.extend(frames.map(|frame| Some(frame as i64))),
                (2, Column::Single(all)) => {
                    all.extend(frames.map(|frame| (frame as f64 / rate_hz) as f32));
                }
                (_, Column::Single(all)) => {
                    if let Some(signal) = self.signals.get(index - 3) {
                        all.extend(signal);
                    }
                }
                _ => {}
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A trial with something in every place that may be empty, or with nothing.
    fn trial(full: bool) -> TrialEntry {
        let some = |text: &str| full.then(|| text.to_owned());
        TrialEntry {
            trial: "0123456789abcdef".to_owned(),
            name: "kick-01".to_owned(),
            set: "praxicon".to_owned(),
            action: "kick".to_owned(),
            kind: TrialKind::Session,
            synthetic: full,
            subject: some("s01"),
            session: some("monday"),
            source: "kick.bvh".to_owned(),
            format: "bvh".to_owned(),
            source_sha256: some("ab"),
            source_file: some("sources/ab/ab.bvh"),
            provenance: some("a lab"),
            licence: "CC-BY-NC-4.0".to_owned(),
            noncommercial: full,
            verdict: some("keep"),
            repetitions: full.then_some(10),
            edits_sha256: some("cd"),
            untracked: some("head"),
            part_of: some("fedcba9876543210"),
            body_stature_m: 1.75,
            frames: 120,
            rate_hz: 60.0,
            duration_s: 1.983,
            frames_sha256: "ef".to_owned(),
            parameters: full.then(|| ("speed_m_s".to_owned(), 2.5)).into_iter().collect(),
            place: full.then(|| FramesPlace { file: "f".to_owned(), group: 2, first_row: 7 }),
        }
    }

    #[test]
    fn rows_go_into_tables_and_come_out_the_same() {
        let schemas = Schemas::new().expect("schemas");
        let (mut columns, trials) = (schemas.trials.empty(), [trial(true), trial(false)]);
        trials.iter().for_each(|trial| push_trial(&mut columns, trial));
        assert_eq!(trials_of(&columns, "praxicon", "kick").expect("rows"), trials);
        let mut columns = schemas.labels.empty();
        let label = LabelEntry {
            trial: "0123456789abcdef".to_owned(),
            set: "a".to_owned(),
            action: "b".to_owned(),
            label: "wave".to_owned(),
            first_frame: 3,
            last_frame: 9,
            value: 0.5,
            annotator: "s".to_owned(),
        };
        push_label(&mut columns, &label);
        assert_eq!(labels_of(&columns, "a", "b").expect("rows"), [label]);
        let mut columns = schemas.subjects.empty();
        let measures = BTreeMap::from([(Measure::Age, 11.0), (Measure::Stature, 1.42)]);
        let subject = Subject { id: "s01".to_owned(), measures, ..Subject::default() };
        let subject = SubjectEntry { subject, consent: Consent::Given };
        push_subject(&mut columns, &subject);
        assert_eq!(subjects_of(&columns).expect("rows"), [subject]);
    }

    #[test]
    fn poses_become_frames_and_frames_the_same_poses() {
        let turn = DQuat::from_rotation_z(0.4) * DQuat::from_rotation_y(0.2);
        let pose = |n: usize| {
            let angles =
                JointAngles(std::array::from_fn(|dof| 0.3 * ((n + dof) as f64 * 0.37).sin()));
            angles.to_pose(DVec3::new(n as f64 * 0.01, -0.5, 0.9), turn)
        };
        let poses: Vec<SegmentPose> = (0..50).map(pose).collect();
        let frames = TrialFrames::of(&poses);
        assert_eq!(frames.len(), 50);
        for (one, other) in poses.iter().zip(frames.poses()) {
            assert!((one.root_m - other.root_m).length() < 1e-6);
            for (a, b) in one.orientation.iter().zip(other.orientation) {
                assert!(a.angle_between(b) < 1e-6, "{}", a.angle_between(b));
            }
        }
        let twin = TrialFrames::of(&frames.poses());
        assert_eq!(frames.sha256(60.0), TrialFrames { ..frames.clone() }.sha256(60.0));
        assert_ne!(frames.sha256(60.0), frames.sha256(30.0));
        assert_eq!(twin.len(), 50);
    }
}
