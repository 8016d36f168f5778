//! Megabytes per second of captures that are read whole, of C3D beside c3dio on every file that both open, of BVH beside
//! the plainest way to read its numbers (split at blanks, `f64::from_str`), all in one run:
//! `GAITWAY_CAPTURES=FOLDER cargo bench --bench readers`. Files below 100 kB are left out.
//!
//! c3dio decodes points, residuals, cameras and analog samples, as we do; a file's bytes are in memory before.

use c3dio::prelude::C3d;
use gaitway::mocap::{bvh, c3d};
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::time::Instant;

const LEAST_BYTES: u64 = 100_000;

/// Seconds of the best of nine calls.
fn best_s(mut call: impl FnMut()) -> f64 {
    let times = (0..9).map(|_| {
        let start = Instant::now();
        call();
        start.elapsed().as_secs_f64()
    });
    times.fold(f64::INFINITY, f64::min)
}

fn files(folder: &Path, ending: &str, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        let is_meant = path.extension().is_some_and(|of| of.eq_ignore_ascii_case(ending));
        if path.is_dir() {
            files(&path, ending, found);
        } else if is_meant && path.metadata().expect("a file").len() >= LEAST_BYTES {
            found.push(path);
        }
    }
    found.sort();
}

/// All numbers of a motion, in the plainest way.
fn numbers(text: &str) -> f64 {
    let rows = text.split_once("Frame Time:").map_or("", |(_, rows)| rows);
    rows.split_ascii_whitespace().filter_map(|number| number.parse::<f64>().ok()).sum()
}

fn row(path: &Path, bytes: usize, ours_s: f64, theirs: Option<f64>, total: &mut [f64; 3]) {
    let mb = bytes as f64 / 1e6;
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let Some(theirs_s) = theirs else {
        println!("| {name} | {mb:.1} | {:.0} | refused | |", mb / ours_s);
        return;
    };
    println!(
        "| {name} | {mb:.1} | {:.0} | {:.0} | {:.2} |",
        mb / ours_s,
        mb / theirs_s,
        theirs_s / ours_s
    );
    for (sum, of) in total.iter_mut().zip([mb, ours_s, theirs_s]) {
        *sum += of;
    }
}

fn main() {
    let Some(folder) = std::env::var_os("GAITWAY_CAPTURES").map(PathBuf::from) else {
        println!("SKIPPED: GAITWAY_CAPTURES names no folder with captures");
        return;
    };
    for (ending, theirs) in [("c3d", "c3dio"), ("bvh", "plain")] {
        let (mut found, mut total) = (Vec::new(), [0.0; 3]);
        files(&folder, ending, &mut found);
        println!("| {ending} | MB | ours MB/s | {theirs} MB/s | ours / {theirs} |");
        println!("|---|---|---|---|---|");
        for path in found {
            let bytes = std::fs::read(&path).expect("a file");
            let (ours_s, theirs_s) = if ending == "c3d" {
                if c3d::parse(&bytes).is_err() {
                    continue;
                }
                let ours = best_s(|| drop(black_box(c3d::parse(black_box(&bytes)))));
                let opens = C3d::from_bytes(&bytes).is_ok();
                let theirs = best_s(|| drop(black_box(C3d::from_bytes(black_box(&bytes)))));
                (ours, opens.then_some(theirs))
            } else {
                let Ok(text) = std::str::from_utf8(&bytes) else { continue };
                if bvh::parse(&bytes).is_err() {
                    continue;
                }
                let ours = best_s(|| drop(black_box(bvh::parse(black_box(&bytes)))));
                let theirs = best_s(|| {
                    black_box(numbers(black_box(text)));
                });
                (ours, Some(theirs))
            };
            row(&path, bytes.len(), ours_s, theirs_s, &mut total);
        }
        let [mb, ours_s, theirs_s] = total;
        println!(
            "| all that both read | {mb:.1} | {:.0} | {:.0} | {:.2} |",
            mb / ours_s,
            mb / theirs_s,
            theirs_s / ours_s
        );
    }
}
