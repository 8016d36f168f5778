//! Files that hold a skeleton in motion, told apart by their endings.
//!
//! A BVH file has all in one. An AMC file needs the ASF file of its skeleton: the one that is named, or the one
//! in its folder whose name the motion's name goes on with, the longest of them (`01.asf` for `01_02.amc`);
//! if there is none, the one with which it has most letters in common from the first on. Two that have
//! equally much are refused.

use crate::error::{Error, ErrorKind};
use crate::mocap::acclaim::{self, AcclaimSkeleton};
use crate::mocap::bvh::{self, Bvh, Joint};
use std::fs;
use std::path::{Path, PathBuf};

/// A kind of file that holds a skeleton in motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CaptureFormat {
    /// Biovision hierarchy.
    Bvh,
    /// Acclaim motion, with a skeleton beside it.
    Amc,
}

impl CaptureFormat {
    /// The word for it, which is the ending of its files.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Bvh => "bvh",
            Self::Amc => "amc",
        }
    }
}

/// What a person says about a file that it does not say itself.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CaptureOptions {
    /// The ASF file of an AMC file.
    pub skeleton: Option<PathBuf>,
    /// Frames per second of an AMC file, or of markers.
    pub rate_hz: Option<f64>,
    /// The trial in which a person whose markers were recorded stands still.
    pub static_trial: Option<PathBuf>,
}

/// A skeleton in motion as it stands in a file: nothing interpreted.
#[derive(Clone, Debug, PartialEq)]
pub struct SkeletonFile {
    /// What kind of file it was.
    pub format: CaptureFormat,
    /// What it holds.
    pub bvh: Bvh,
    /// What was found out or taken for granted, a line each.
    pub notes: Vec<String>,
}

/// The kind of a file, by its ending.
#[must_use]
pub fn format_of(path: &Path) -> Option<CaptureFormat> {
    let ending = path.extension()?.to_str()?.to_ascii_lowercase();
    match ending.as_str() {
        "bvh" => Some(CaptureFormat::Bvh),
        "amc" => Some(CaptureFormat::Amc),
        _ => None,
    }
}

/// Reads a file.
///
/// # Errors
/// If it cannot be read or breaks its format, another ending, an AMC file whose skeleton is not found, or
/// options that do not go with it.
pub fn read(path: &Path, options: &CaptureOptions) -> Result<SkeletonFile, Error> {
    options.rate_hz.map_or(Ok(()), acclaim::check_rate)?;
    if let Some(stands) = &options.static_trial {
        return Err(Error::new("a static trial is for markers")
            .at(path.display().to_string())
            .got(format!("--static {}", stands.display()))
            .allowed("markers (.c3d, .trc, .csv)"));
    }
    match format_of(path) {
        Some(format @ CaptureFormat::Bvh) => {
            if options != &CaptureOptions::default() {
                return Err(Error::new("a BVH file has its skeleton and its rate in it")
                    .at(path.display().to_string())
                    .got("a skeleton or a rate beside it")
                    .allowed("these are for AMC files"));
            }
            Ok(SkeletonFile { format, bvh: bvh::read(path)?, notes: Vec::new() })
        }
        Some(format @ CaptureFormat::Amc) => {
            let (skeleton, place) = skeleton_of(path, options.skeleton.as_deref())?;
            let (bvh, mut notes) = acclaim::read(path, &skeleton, options.rate_hz)?;
            let named = if options.skeleton.is_some() { "as asked for" } else { "by its name" };
            notes.insert(0, format!("skeleton: {}, {named}", place.display()));
            Ok(SkeletonFile { format, bvh, notes })
        }
        None => Err(Error::of(ErrorKind::Unknown, "not a file with a skeleton in motion")
            .at(path.display().to_string())
            .allowed("a file that ends in .bvh or .amc")),
    }
}

/// Reads the joints of a file and leaves its poses.
///
/// # Errors
/// As [`read`].
pub fn read_joints(path: &Path) -> Result<Vec<Joint>, Error> {
    match format_of(path) {
        Some(CaptureFormat::Amc) => Ok(skeleton_of(path, None)?.0.joints()),
        _ => bvh::read_joints(path),
    }
}

/// The skeleton of an AMC file, and where it was found.
fn skeleton_of(path: &Path, named: Option<&Path>) -> Result<(AcclaimSkeleton, PathBuf), Error> {
    let place = match named {
        Some(place) => place.to_owned(),
        None => find_skeleton(path)?,
    };
    Ok((acclaim::read_skeleton(&place)?, place))
}

/// How well the name of a skeleton fits: letters in common, and whether that is all of it.
fn fit(skeleton: &str, motion: &str) -> (bool, usize) {
    let lower = |text: &str| text.to_lowercase();
    let (skeleton, motion) = (lower(skeleton), lower(motion));
    let common = skeleton.chars().zip(motion.chars()).take_while(|(a, b)| a == b).count();
    (common > 0 && motion.starts_with(&skeleton), common)
}

fn find_skeleton(path: &Path) -> Result<PathBuf, Error> {
    let stem = |path: &Path| path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let place = path.display().to_string();
    let remedy = "name the one that belongs to this motion: --skeleton FILE.asf";
    let entries = fs::read_dir(folder).map_err(|cause| {
        Error::of((&cause).into(), "the folder of the motion cannot be looked into")
            .at(folder.display().to_string())
            .got(cause.to_string())
            .remedy(remedy)
    })?;
    let is_skeleton =
        |path: &PathBuf| path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("asf"));
    let mut found: Vec<PathBuf> =
        entries.filter_map(|entry| Some(entry.ok()?.path())).filter(is_skeleton).collect();
    found.sort_unstable();
    let motion = stem(path);
    let best = found.iter().map(|of| fit(&stem(of), &motion)).max();
    let Some(best) = best else {
        return Err(Error::of(ErrorKind::Absent, "an AMC file needs the ASF file of its skeleton")
            .at(place)
            .got(format!("no .asf file in {}", folder.display()))
            .remedy(remedy));
    };
    let alone = found.len() == 1;
    let mut fitting = found.iter().filter(|of| fit(&stem(of), &motion) == best);
    match (fitting.next(), fitting.next()) {
        (Some(one), None) if best.1 > 0 || alone => Ok(one.clone()),
        (first, second) => {
            let names: Vec<String> = [first, second]
                .into_iter()
                .flatten()
                .chain(fitting)
                .map(|of| of.file_name().unwrap_or_default().to_string_lossy().into_owned())
                .collect();
            Err(Error::new("several skeletons could be that of the motion")
                .at(place)
                .got(names.join(", "))
                .allowed("one whose name the motion's name goes on with")
                .remedy(remedy))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(name: &str, skeletons: &[&str]) -> Result<String, Error> {
        let folder =
            std::env::temp_dir().join(format!("gaitway-asf-{}-{name}", std::process::id()));
        let _ = fs::remove_dir_all(&folder);
        fs::create_dir_all(&folder).expect("a folder");
        for skeleton in skeletons {
            fs::write(folder.join(skeleton), "").expect("a file");
        }
        let found = find_skeleton(&folder.join(name));
        let _ = fs::remove_dir_all(&folder);
        found.map(|path| path.file_name().unwrap_or_default().to_string_lossy().into_owned())
    }

    #[test]
    fn a_motion_finds_the_skeleton_whose_name_it_goes_on_with() {
        let found = |name: &str, skeletons: &[&str]| found(name, skeletons).expect("one");
        assert_eq!(found("01_02.amc", &["01.asf", "02.asf"]), "01.asf");
        // The longest of those that are wholly in the name, though another has more letters of it.
        assert_eq!(found("01_02.amc", &["0.asf", "01.ASF", "01_03.asf"]), "01.ASF");
        assert_eq!(found("HDM_dg_06-03.amc", &["HDM_bk.asf", "HDM_dg.asf"]), "HDM_dg.asf");
        assert_eq!(found("HDM_dg_06.amc", &["HDM_dx.asf", "other.asf"]), "HDM_dx.asf");
        assert_eq!(found("walk.amc", &["skeleton.asf"]), "skeleton.asf");
    }

    #[test]
    fn two_skeletons_that_fit_alike_are_refused_and_none_is_missed() {
        for skeletons in [&["01_a.asf", "01_b.asf"][..], &["x.asf", "y.asf"]] {
            let refused = found("01_02.amc", skeletons).expect_err("two").to_string();
            assert!(refused.contains("--skeleton") && refused.contains(skeletons[1]), "{refused}");
        }
        let refused = found("01_03.amc", &[]).expect_err("none");
        assert_eq!(refused.kind, ErrorKind::Absent);
    }
}
