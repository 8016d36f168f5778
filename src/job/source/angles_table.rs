//! Joint angles out of tables (`synth`, `fit` and `convert` write such) as a motion of the body.

use super::{ACTION_STATURE_M, Source};
use crate::action::table::{self, AnglesTable};
use crate::body::{JointAngles, Proportions, SegmentPose, root};
use crate::error::{Error, ErrorKind};
use crate::mocap::anatomy::Capture;
use glam::{DQuat, DVec3};
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Largest table read, bytes.
const MAX_FILE_BYTES: u64 = 256 << 20;
/// Bytes of a table that are looked at to see what its columns are.
const TITLES_BYTES: u64 = 1 << 16;

/// True of a table of joint angles of the body.
pub fn is_named(path: &Path) -> bool {
    let is_csv = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("csv"));
    // A pipe is read once only.
    if !is_csv || !std::fs::metadata(path).is_ok_and(|found| found.is_file()) {
        return false;
    }
    let mut start = Vec::new();
    let read = File::open(path).and_then(|file| file.take(TITLES_BYTES).read_to_end(&mut start));
    read.is_ok() && table::is_of_body(&String::from_utf8_lossy(&start))
}

/// Reads a table of joint angles.
///
/// # Errors
/// If it cannot be read, and as [`table::parse`]; the error names it.
pub fn read(path: &Path) -> Result<AnglesTable, Error> {
    let unreadable = |cause: std::io::Error| {
        Error::of((&cause).into(), "the file cannot be read").in_file(path).got(cause.to_string())
    };
    let mut bytes = Vec::new();
    let file = File::open(path).map_err(unreadable)?;
    file.take(MAX_FILE_BYTES + 1).read_to_end(&mut bytes).map_err(unreadable)?;
    if bytes.len() as u64 > MAX_FILE_BYTES {
        return Err(Error::of(ErrorKind::Malformed, "the file is too large")
            .in_file(path)
            .allowed(format!("at most {MAX_FILE_BYTES} bytes")));
    }
    table::parse(&bytes).map_err(|error| error.in_file(path))
}

/// The motion of a table. The body is of usual stature, since the table does not say whose it is.
pub(super) fn capture(path: &Path) -> Result<(Capture, Source), Error> {
    let table = read(path)?;
    let stature_m = ACTION_STATURE_M;
    let pelvis = table.pelvis.iter().copied().chain(std::iter::repeat(DQuat::IDENTITY));
    let roots_m = table.roots_m.iter().copied().chain(std::iter::repeat(DVec3::ZERO));
    let posed = table.angles.iter().zip(pelvis).zip(roots_m);
    let pose =
        |((angles, pelvis), root_m): ((&JointAngles, DQuat), DVec3)| angles.to_pose(root_m, pelvis);
    let mut poses: Vec<SegmentPose> = posed.map(pose).collect();
    let mut notes = table.notes;
    notes.push(format!("a table of joint angles does not say the stature: {stature_m} m is taken"));
    if table.roots_m.is_empty() {
        notes.push(
            "where the root is, the table does not say: the lowest sole stands and does not slide"
                .to_owned(),
        );
        let path_m = root::path_m(&Proportions::of_stature(stature_m)?, &poses, table.rate_hz);
        for (pose, root_m) in poses.iter_mut().zip(path_m) {
            pose.root_m = root_m;
        }
    }
    let source = Source {
        format: "angles".to_owned(),
        frames: poses.len(),
        rate_hz: table.rate_hz,
        duration_s: poses.len().saturating_sub(1) as f64 / table.rate_hz,
        ..Source::default()
    };
    let (rate_hz, tracked) = (table.rate_hz, [true; 13]);
    Ok((Capture { rate_hz, poses, tracked, stature_m, is_made: false, notes }, source))
}
