//! Captures of one skeleton that lie in one folder share their segment frames.
//!
//! The constants of [`crate::mocap::anatomy`] belong to a skeleton. What its rest pose does not
//! show is found in motion, and a clip alone shows it badly: who stoops all through is taken for
//! straight. So a file is calibrated together with those beside it that are of the same skeleton
//! ([`Bones`]). What is read depends on the folder alone and not on which of its files was asked
//! for, nothing is kept anywhere, and [`SegmentFrames`] says which files took part. Whoever wants other
//! company for a file puts it in another folder.

use crate::body::segment_name;
use crate::error::{Error, counted};
use crate::mocap::anatomy::{Anatomy, Capture, Poses, Posture};
use crate::mocap::bones::Bones;
use crate::mocap::clip::Clip;
use crate::mocap::files::{self, CaptureOptions};
use crate::mocap::mapping::MappingFile;
use serde::Serialize;
use std::collections::BTreeMap;
use std::ffi::{OsStr, OsString};
use std::fs;
use std::path::{Path, PathBuf};

/// Most files of a folder whose headers are read, and most of a skeleton whose poses are: of more,
/// so many evenly over the names in order.
const MOST_HEADERS: usize = 4096;
const MOST_FILES: usize = 32;
/// A file larger than this is not read for the sake of another, bytes.
const MOST_BYTES: u64 = 16 << 20;

/// What the segment frames of a capture were found from.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SegmentFrames {
    /// Sixteen digits: runs that say the same used the same frames.
    pub fingerprint: String,
    /// Names of the files whose poses were looked at, all in the capture's folder.
    pub files: Vec<String>,
    /// Files of this skeleton in the folder.
    pub files_of_skeleton: usize,
    /// Poses looked at.
    pub poses: usize,
    /// What showed how the trunk and the head lie in a person who stands.
    pub posture: Posture,
    /// By segment, how far the rest pose is drawn tilted from how people stand; these were set
    /// upright. deg.
    pub tilted_deg: BTreeMap<&'static str, f64>,
}

/// A capture file with the frames of its skeleton.
#[derive(Clone, Debug)]
pub struct CaptureFile {
    /// The file understood.
    pub clip: Clip,
    /// The constants of its skeleton.
    pub anatomy: Anatomy,
    /// What they were found from.
    pub frames: SegmentFrames,
}

/// Reads a skeleton in motion, and the files beside it that tell more of it. `mapping` names joints
/// where the search for them needs help.
///
/// # Errors
/// If the file cannot be read, breaks the format, or shows no person in motion. The others are
/// left out if they do.
pub fn read(
    path: &Path,
    mapping: Option<&MappingFile>,
    options: &CaptureOptions,
) -> Result<CaptureFile, Error> {
    let in_file = |error: Error| match error.place {
        None => error.at(path.display().to_string()),
        Some(_) => error,
    };
    let read = |path: &Path, options: &CaptureOptions| {
        let file = files::read(path, options)?;
        let mut clip = Clip::new(file.bvh, mapping)?;
        clip.note_first(file.notes);
        Ok(clip)
    };
    let clip: Clip = read(path, options).map_err(in_file)?;
    // What was said of this file alone is not said of the others.
    let usual = CaptureOptions { rate_hz: options.rate_hz, ..CaptureOptions::default() };
    let own = path.file_name().unwrap_or_default();
    let folder = folder_of(path);
    let family = family(path, own, &clip.bones());
    let chosen = chosen(&family);
    let mut poses = Poses::default();
    let mut files = Vec::new();
    for name in &chosen {
        if *name == own {
            poses.add(&clip, chosen.len());
        } else {
            let other: Result<Clip, Error> = read(&folder.join(name), &usual);
            let Ok(other) = other else { continue };
            if !other.mapping().is_alike(clip.mapping()) {
                continue;
            }
            poses.add(&other, chosen.len());
        }
        files.push(name.to_string_lossy().into_owned());
    }
    if files.is_empty() {
        poses = Poses::of(&clip);
        files.push(own.to_string_lossy().into_owned());
    }
    let anatomy = Anatomy::find(&poses).map_err(in_file)?;
    let tilted = anatomy.tilted_rad().iter();
    let frames = SegmentFrames {
        fingerprint: anatomy.fingerprint(),
        files_of_skeleton: family.len().max(files.len()),
        files,
        poses: anatomy.pose_count(),
        posture: anatomy.posture(),
        tilted_deg: tilted.map(|(at, rad)| (segment_name(*at), rad.to_degrees())).collect(),
    };
    Ok(CaptureFile { clip, anatomy, frames })
}

impl CaptureFile {
    /// The capture as a motion of segments.
    #[must_use]
    pub fn capture(&self) -> Capture {
        let mut capture = self.anatomy.capture(&self.clip);
        capture.notes.push(self.frames.note());
        capture
    }
}

impl SegmentFrames {
    /// Which files the frames are from, in one line.
    fn note(&self) -> String {
        let Self { fingerprint, files, files_of_skeleton, .. } = self;
        match (files_of_skeleton, files.len()) {
            (1, _) => format!("segment frames {fingerprint}: from this file alone"),
            (all, read) if *all == read => format!(
                "segment frames {fingerprint}: shared by the {all} of this skeleton in the \
                 folder",
                all = counted(all, "file")
            ),
            (all, read) => format!(
                "segment frames {fingerprint}: shared by the {all} of this skeleton in the \
                 folder, from {read} of them",
                all = counted(all, "file")
            ),
        }
    }
}

/// The folder that a file lies in.
fn folder_of(path: &Path) -> PathBuf {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder.to_owned(),
        _ => PathBuf::from("."),
    }
}

/// Names and sizes, bytes, of the files of one skeleton in the folder of one of them, in the order of
/// their names; none if the folder cannot be looked into.
fn family(path: &Path, own: &OsStr, bones: &Bones) -> Vec<(OsString, u64)> {
    // What is no file, a pipe for one, has no company.
    if !fs::metadata(path).is_ok_and(|found| found.is_file()) {
        return Vec::new();
    }
    let folder = folder_of(path);
    let Ok(entries) = fs::read_dir(&folder) else { return Vec::new() };
    let format = files::format_of(path);
    let is_alike = |name: &OsString| files::format_of(Path::new(name)) == format;
    let mut names: Vec<OsString> =
        entries.filter_map(|entry| Some(entry.ok()?.file_name())).filter(is_alike).collect();
    names.sort_unstable();
    let names: Vec<&OsStr> = names.iter().map(OsString::as_os_str).collect();
    let mut looked_at = spread(&names, MOST_HEADERS);
    if !looked_at.contains(&own) {
        looked_at.push(own);
        looked_at.sort_unstable();
    }
    // Of the many files of a folder few differ at all.
    let mut variants: Vec<(Bones, Vec<(OsString, u64)>)> = vec![(bones.clone(), Vec::new())];
    for name in looked_at {
        let file = folder.join(name);
        let Ok(found) = fs::metadata(&file) else { continue };
        if !found.is_file() {
            continue;
        }
        let member = (name.to_owned(), found.len());
        let bones = if name == own {
            bones.clone()
        } else {
            let Ok(joints) = files::read_joints(&file) else { continue };
            Bones::of(&joints)
        };
        match variants.iter_mut().find(|(known, _)| *known == bones) {
            Some((_, members)) => members.push(member),
            None => variants.push((bones, vec![member])),
        }
    }
    // Who is the same as any member is one, so that the family is the same whoever asks.
    let (mut kin, mut others) = (vec![variants.remove(0)], variants);
    loop {
        let is_kin = |(bones, _): &mut (Bones, Vec<_>)| kin.iter().any(|(of, _)| of.is_same(bones));
        let found: Vec<_> = others.extract_if(.., is_kin).collect();
        if found.is_empty() {
            break;
        }
        kin.extend(found);
    }
    let mut members: Vec<(OsString, u64)> = kin.into_iter().flat_map(|(_, of)| of).collect();
    members.sort_unstable();
    members
}

/// The files of a family whose poses are read.
fn chosen(family: &[(OsString, u64)]) -> Vec<&OsStr> {
    let small = family.iter().filter(|(_, bytes)| *bytes <= MOST_BYTES);
    let names: Vec<&OsStr> = small.map(|(name, _)| name.as_os_str()).collect();
    spread(&names, MOST_FILES)
}

/// At most so many of a list, evenly over it, the first and the last among them.
fn spread<T: Copy>(items: &[T], most: usize) -> Vec<T> {
    let count = items.len();
    if count <= most {
        return items.to_vec();
    }
    (0..most).map(|at| items[at * (count - 1) / (most - 1)]).collect()
}
