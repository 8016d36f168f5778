//! Real captures, which are not part of this project: the folder named by `GAITWAY_CAPTURES`. Without it a
//! test does nothing, and says so aloud.

#![allow(dead_code, reason = "each test file uses a part")]

use std::io::Write as _;
use std::path::{Path, PathBuf};

/// Past the runner's capture: a skip that nobody reads is a test that nobody knows is missing.
fn skipped(why: &str) {
    let _ = writeln!(std::io::stderr(), "SKIPPED: {why}");
}

/// The folder of captures, or a loud word that a test did nothing.
pub fn captures() -> Option<PathBuf> {
    let folder = std::env::var_os("GAITWAY_CAPTURES").map(PathBuf::from);
    if folder.is_none() {
        skipped("set GAITWAY_CAPTURES to a folder of captures to run this test");
    }
    folder
}

/// A folder in it.
pub fn captured(name: &str) -> Option<PathBuf> {
    let folder = captures()?.join(name);
    if !folder.is_dir() {
        skipped(&format!("no {name} under GAITWAY_CAPTURES"));
        return None;
    }
    Some(folder)
}

/// All BVH files under a folder, sorted.
pub fn bvh_files(folder: &Path) -> Vec<PathBuf> {
    files_of(folder, "bvh")
}

/// All C3D files of the capture folder, sorted, or a loud word that a test did nothing.
pub fn c3d_files() -> Option<Vec<PathBuf>> {
    Some(files_of(&captured("mocap/c3d")?, "c3d"))
}

/// All files under a folder with this ending in letters of any size, sorted.
fn files_of(folder: &Path, ending: &str) -> Vec<PathBuf> {
    let mut files = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).expect("a readable folder") {
            let path = entry.expect("a readable entry").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|of| of.eq_ignore_ascii_case(ending)) {
                files.push(path);
            }
        }
    }
    files.sort();
    files
}

/// The one file of that name under the capture folder.
pub fn capture_file(folder: &Path, name: &str) -> Option<PathBuf> {
    let found = bvh_files(folder).into_iter().find(|path| path.ends_with(name));
    if found.is_none() {
        skipped(&format!("{name} is not under {}", folder.display()));
    }
    found
}
