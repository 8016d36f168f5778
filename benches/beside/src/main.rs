//! Megabytes per second of BVH files that are read whole, beside bvh_anim, in one run:
//! `cd benches/beside && cargo run --release FOLDER`. Files below 100 kB are left out; a file's bytes are in memory before.
//! Both decode every number; bvh_anim keeps 32 bits of it, we keep 64.

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

fn files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        let is_bvh = path.extension().is_some_and(|of| of.eq_ignore_ascii_case("bvh"));
        if path.is_dir() {
            files(&path, found);
        } else if is_bvh && path.metadata().expect("a file").len() >= LEAST_BYTES {
            found.push(path);
        }
    }
    found.sort();
}

fn main() {
    let Some(folder) = std::env::args_os().nth(1).map(PathBuf::from) else {
        println!("say the folder with BVH files");
        return;
    };
    let mut found = Vec::new();
    files(&folder, &mut found);
    let (mut bytes_of_all, mut ours_of_all, mut theirs_of_all, mut count) = (0.0, 0.0, 0.0, 0);
    println!("| file | MB | ours MB/s | bvh_anim MB/s | ours / bvh_anim |\n|---|---|---|---|---|");
    for path in found {
        let bytes = std::fs::read(&path).expect("a file");
        if gaitway::mocap::bvh::parse(&bytes).is_err() {
            continue;
        }
        let mb = bytes.len() as f64 / 1e6;
        let ours_s = best_s(|| drop(black_box(gaitway::mocap::bvh::parse(black_box(&bytes)))));
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if bvh_anim::from_bytes(bytes.as_slice()).is_err() {
            println!("| {name} | {mb:.1} | {:.0} | refused | |", mb / ours_s);
            continue;
        }
        let theirs_s =
            best_s(|| drop(black_box(bvh_anim::from_bytes(black_box(bytes.as_slice())))));
        println!(
            "| {name} | {mb:.1} | {:.0} | {:.0} | {:.2} |",
            mb / ours_s,
            mb / theirs_s,
            theirs_s / ours_s
        );
        bytes_of_all += mb;
        ours_of_all += ours_s;
        theirs_of_all += theirs_s;
        count += 1;
    }
    println!(
        "| all {count} that both read | {bytes_of_all:.1} | {:.0} | {:.0} | {:.2} |",
        bytes_of_all / ours_of_all,
        bytes_of_all / theirs_of_all,
        theirs_of_all / ours_of_all
    );
}
