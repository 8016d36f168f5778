//! What a file costs that lies about itself: reading any file asks for at most four times its size
//! and 16 MiB more than reading a small valid one, and no more than that becomes resident.
//!
//! Each case is read in a process of its own, so that nothing is hidden in memory that was freed
//! before. An allocator counts what is asked for, touched or not; the system tells what is resident.

#[path = "memory/c3d_files.rs"]
mod c3d_files;
#[path = "c3d_made/mod.rs"]
mod c3d_made;
#[path = "memory/mcap_files.rs"]
mod mcap_files;
#[path = "memory/readers.rs"]
mod readers;
#[path = "memory/text_files.rs"]
mod text_files;

use std::alloc::System;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use libtest_mimic::{Arguments, Failed, Trial};
use peakmem_alloc::{INSTRUMENTED_SYSTEM, PeakMemAlloc, PeakMemAllocTrait};
use readers::Reader;

#[global_allocator]
static ALLOCATOR: &PeakMemAlloc<System> = &INSTRUMENTED_SYSTEM;

/// What reading may take beside [`PER_BYTE`] times the file.
const ALWAYS_BYTES: u64 = 16 << 20;
const PER_BYTE: u64 = 4;
/// Said to this program by itself: read, and tell what it took.
const MEASURE: &str = "--measure";

fn main() -> ExitCode {
    let mut args = std::env::args().skip(1);
    if args.next().as_deref() == Some(MEASURE) {
        let [reader, minimal, files] = [(); 3].map(|()| args.next().expect("three words"));
        measure(Reader::named(&reader), Path::new(&minimal), Path::new(&files));
        return ExitCode::SUCCESS;
    }
    let scene = tempfolder();
    let mut trials = Vec::new();
    for reader in Reader::ALL {
        for (name, files) in reader.hostile() {
            let folder = scene.join(format!("{reader:?}-{name}"));
            let title = format!("{reader:?}: {}", name.replace('-', " "));
            trials.push(Trial::test(title, move || judge(reader, &folder, files())));
        }
    }
    let conclusion = libtest_mimic::run(&Arguments::from_args(), trials);
    let _ = std::fs::remove_dir_all(&scene);
    conclusion.exit_code()
}

fn tempfolder() -> PathBuf {
    let path = std::env::temp_dir().join(format!("gaitway-memory-{}", std::process::id()));
    std::fs::create_dir_all(&path).expect("a folder for files");
    path
}

/// Writes the files of a case, has them read one after the other, and holds what was told of each
/// against its size.
fn judge(reader: Reader, folder: &Path, files: Vec<Vec<u8>>) -> Result<(), Failed> {
    let write = |folder: PathBuf, bytes: &[u8]| {
        // Some files must be called what they say that they are called.
        let path = folder.join(reader.file_name());
        std::fs::create_dir_all(folder).and_then(|()| std::fs::write(&path, bytes)).map(|()| path)
    };
    let minimal = folder.with_extension("minimal");
    let minimal = write(minimal, &reader.minimal()).map_err(|e| e.to_string())?;
    for (number, bytes) in files.iter().enumerate() {
        write(folder.join(format!("{number:05}")), bytes).map_err(|e| e.to_string())?;
    }
    let myself = std::env::current_exe().map_err(|e| e.to_string())?;
    let mut command = Command::new(myself);
    command.args([MEASURE, &format!("{reader:?}")]).arg(&minimal).arg(folder);
    let output = command.output().map_err(|e| e.to_string())?;
    let _ = std::fs::remove_dir_all(folder);
    let said = String::from_utf8_lossy(&output.stdout);
    if !output.status.success() {
        let complained = String::from_utf8_lossy(&output.stderr);
        return Err(format!("{}: {said}{complained}", output.status).into());
    }
    let mut read = 0;
    for line in said.lines() {
        let numbers: Vec<u64> = line.split(' ').map_while(|word| word.parse().ok()).collect();
        let [size, requested, resident] = numbers[..] else {
            return Err(format!("not told: {line}").into());
        };
        let allowed = PER_BYTE * size + ALWAYS_BYTES;
        if requested > allowed || resident > allowed {
            return Err(format!(
                "file {read} of {size} bytes: {requested} bytes asked for, {resident} resident, \
                 {allowed} allowed: {line}"
            )
            .into());
        }
        read += 1;
    }
    if read != files.len() || read == 0 {
        return Err(format!("{read} of {} files were read", files.len()).into());
    }
    Ok(())
}

/// Reads every file of a folder and says of each: its size, what was asked for, what was resident,
/// and what the reader said.
fn measure(reader: Reader, minimal: &Path, folder: &Path) {
    let said = reader.read(minimal);
    assert!(said.is_ok(), "the small file must be valid: {said:?}");
    let mut folders: Vec<PathBuf> = std::fs::read_dir(folder)
        .expect("a folder")
        .map(|e| e.expect("one of a file").path())
        .collect();
    folders.sort();
    for path in folders.into_iter().map(|folder| folder.join(reader.file_name())) {
        let size = path.metadata().expect("a file").len();
        let before = status_bytes("VmRSS:");
        forget_the_peak();
        ALLOCATOR.reset_peak_memory();
        let said = reader.read(&path);
        let requested = ALLOCATOR.get_peak_memory();
        let resident = status_bytes("VmHWM:").saturating_sub(before);
        let said = said.map_or_else(|error| format!("refused: {error}"), |()| "read".to_owned());
        let said: String = said.chars().take(200).collect();
        println!("{size} {requested} {resident} {}", said.replace('\n', " "));
    }
}

/// A line of `/proc/self/status`, which counts in KiB.
fn status_bytes(title: &str) -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").expect("Linux");
    let line = status.lines().find(|line| line.starts_with(title)).expect("a line");
    let kib = line.split_ascii_whitespace().nth(1).expect("a number");
    kib.parse::<u64>().expect("a number") << 10
}

/// Sets the most that was ever resident to what is resident now (proc(5), `clear_refs`).
fn forget_the_peak() {
    std::fs::write("/proc/self/clear_refs", "5").expect("Linux");
}
