//! Variations by the thousand, streamed to disk.

use super::SynthOrder;
use crate::action::corpus::{Batch, Corpus};
use crate::action::parquet::CorpusWriter;
use crate::action::phrase;
use crate::error::{Error, ErrorKind};
use crate::job::{Event, Observer};
use serde::Serialize;
use std::fmt::{self, Write as _};
use std::fs::{self, File};
use std::io::BufWriter;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Poses in a row group, about, so that memory and what a kill loses do not grow with length and
/// rate; and most variations. Neither depends on the machine, so that files are the same everywhere.
const POSES_IN_BATCH: usize = 125_000;
const MAX_IN_BATCH: usize = 250;
/// Row groups in a pair of files of a folder.
const BATCHES_IN_FILE: u32 = 40;
/// Most variations of a corpus.
pub const MAX_VARIATIONS: u32 = 100_000_000;
const ABOUT: &str = "corpus.json";

/// What is made, as it is written beside the files: equal figures make equal files.
#[derive(Debug, PartialEq, Serialize)]
struct About {
    generator: String,
    action: String,
    variations: u32,
    seed: u64,
    rate_hz: f64,
    set: Vec<String>,
    database: Vec<String>,
    /// Of everything the variations come from: files may have been edited since.
    fingerprint: String,
}

/// What came of it.
#[derive(Clone, Debug, Serialize)]
pub struct VariedReport {
    /// `done`.
    pub outcome: &'static str,
    /// Variations in all.
    pub variations: u32,
    /// Variations that were there already.
    pub found: u32,
    /// Poses written now.
    pub poses: u64,
    /// Where.
    pub written: String,
}

/// Makes variations: into one pair of files, or a folder of them that is taken up again where it was
/// left.
///
/// # Errors
/// If a figure is out of range, files cannot be written, or the folder holds another corpus.
pub fn vary(
    order: &SynthOrder,
    variations: u32,
    observer: &dyn Observer,
) -> Result<VariedReport, Error> {
    order.check_varied()?;
    let corpus = order.corpus()?;
    let about = about(order, variations, &corpus)?;
    let out = &order.file;
    let mut made = VariedReport {
        outcome: "done",
        variations,
        found: 0,
        poses: 0,
        written: out.display().to_string(),
    };
    let mut steps = Steps { done: 0, total: variations, observer };
    let in_batch = in_batch(&corpus)?;
    if out.extension().is_some_and(|e| e == "parquet") {
        let batches = batches(0..variations, in_batch);
        made.poses = write_pair(&corpus, out, &batches, &about, &mut steps)?;
        return Ok(made);
    }
    refuse_file_names(out)?;
    open_folder(out, &about, order.replace)?;
    let in_file = in_batch * BATCHES_IN_FILE;
    let mut from = 0;
    while from < variations {
        let to = from.saturating_add(in_file).min(variations);
        let poses = out.join(format!("poses-{:06}.parquet", from / in_file));
        // The second of the pair is renamed last: where it is, both are whole.
        if actionlets_beside(&poses).exists() {
            made.found += to - from;
            steps.take(to - from);
        } else {
            let batches = batches(from..to, in_batch);
            made.poses += write_pair(&corpus, &poses, &batches, &about, &mut steps)?;
        }
        from = to;
    }
    Ok(made)
}

/// Says how many variations are made.
struct Steps<'a> {
    done: u32,
    total: u32,
    observer: &'a dyn Observer,
}

impl Steps<'_> {
    fn take(&mut self, variations: u32) {
        self.done += variations;
        let (done, total) = (u64::from(self.done), u64::from(self.total));
        self.observer.hear(Event::Step { done, total, what: "variations" });
    }
}

/// Variations in a row group, from how many poses the action has as it is.
fn in_batch(corpus: &Corpus) -> Result<u32, Error> {
    let poses = phrase::perform(&corpus.parts, corpus.join)?.pose_count(corpus.rate_hz)?;
    // At most MAX_IN_BATCH; the cast cannot wrap.
    Ok((POSES_IN_BATCH / poses).clamp(1, MAX_IN_BATCH) as u32)
}

fn refuse_file_names(folder: &Path) -> Result<(), Error> {
    let kind = folder.extension().and_then(|e| e.to_str()).unwrap_or_default();
    if ["csv", "bvh", "x3d", "html"].contains(&kind) {
        return Err(Error::new("variations are not written as this kind of file")
            .at("-o")
            .got(folder.display().to_string())
            .allowed("a name that ends in .parquet, or a folder")
            .remedy("for one of them in a file of its own say --variation NUMBER"));
    }
    Ok(())
}

/// FNV-1a, 64 bits (Fowler, Noll and Vo), of what is written to it.
struct Fingerprint(u64);

impl fmt::Write for Fingerprint {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for byte in text.bytes() {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
        Ok(())
    }
}

impl Fingerprint {
    fn of(corpus: &Corpus) -> String {
        let mut all = Self(0xcbf2_9ce4_8422_2325);
        let _ = write!(all, "{corpus:?}");
        format!("{:016x}", all.0)
    }
}

fn about(order: &SynthOrder, variations: u32, corpus: &Corpus) -> Result<String, Error> {
    let about = About {
        generator: format!("gaitway {}", env!("CARGO_PKG_VERSION")),
        action: order.phrase.clone(),
        variations,
        seed: order.seed,
        rate_hz: order.rate_hz,
        set: order.figures.pairs.clone(),
        database: order.database.iter().map(|folder| folder.display().to_string()).collect(),
        fingerprint: Fingerprint::of(corpus),
    };
    serde_json::to_string_pretty(&about)
        .map(|text| text + "\n")
        .map_err(|e| Error::new("the corpus cannot be described").got(e.to_string()))
}

/// A folder that is new, or holds the beginning of the same corpus.
fn open_folder(folder: &Path, about: &str, force: bool) -> Result<(), Error> {
    let failed = |what: &str, e: std::io::Error| {
        Error::new(what).at(folder.display().to_string()).got(e.to_string())
    };
    let note = folder.join(ABOUT);
    if let Ok(found) = fs::read_to_string(&note) {
        if found == about {
            return Ok(());
        }
        return Err(Error::of(ErrorKind::Exists, "the folder holds another corpus")
            .at(note.display().to_string())
            .got(found.trim().to_owned())
            .allowed(about.trim().to_owned())
            .remedy("choose another folder, or repeat the command that began this one"));
    }
    fs::create_dir_all(folder).map_err(|e| failed("cannot make the folder", e))?;
    let mut entries = fs::read_dir(folder).map_err(|e| failed("cannot read the folder", e))?;
    if !force && entries.next().is_some() {
        return Err(Error::of(ErrorKind::Exists, "the folder is not empty and holds no corpus")
            .at(folder.display().to_string())
            .remedy("choose another folder, or add --force"));
    }
    fs::write(&note, about).map_err(|e| failed("cannot write into the folder", e))
}

/// `poses-000001.parquet` has `actionlets-000001.parquet` beside it, `run.parquet`
/// `run.actionlets.parquet`.
#[must_use]
pub fn actionlets_beside(poses: &Path) -> PathBuf {
    let stem = poses.file_stem().and_then(|stem| stem.to_str()).unwrap_or("corpus");
    let name = match stem.strip_prefix("poses-") {
        Some(number) => format!("actionlets-{number}.parquet"),
        None => format!("{stem}.actionlets.parquet"),
    };
    poses.with_file_name(name)
}

fn batches(variations: Range<u32>, in_batch: u32) -> Vec<Range<u32>> {
    let end = variations.end;
    let starts = variations.step_by(in_batch as usize);
    starts.map(|start| start..start.saturating_add(in_batch).min(end)).collect()
}

/// Writes batches under temporary names, then renames: what has its name is whole, and on the disk.
fn write_pair(
    corpus: &Corpus,
    poses: &Path,
    batches: &[Range<u32>],
    about: &str,
    steps: &mut Steps<'_>,
) -> Result<u64, Error> {
    let pieces = actionlets_beside(poses);
    let part = |path: &Path| path.with_extension("parquet.part");
    let failed = |path: &Path, e: std::io::Error| {
        Error::of(ErrorKind::Io, "cannot write the corpus")
            .at(path.display().to_string())
            .got(e.to_string())
    };
    let create = |path: &Path| {
        let file = File::create(part(path)).map_err(|e| failed(path, e))?;
        let stream = file.try_clone().map_err(|e| failed(path, e))?;
        Ok::<_, Error>((file, BufWriter::with_capacity(1 << 20, stream)))
    };
    let ((poses_file, to_poses), (pieces_file, to_pieces)) = (create(poses)?, create(&pieces)?);
    let notes = [("gaitway".to_owned(), about.to_owned())];
    let mut writer = CorpusWriter::new(to_poses, to_pieces, &notes)?;
    let mut rows = 0;
    in_order(corpus, batches, |range, batch| {
        rows += batch.variation.len() as u64;
        steps.take(range.end - range.start);
        writer.write(&batch)
    })?;
    writer.finish()?;
    for (path, file) in [(poses, poses_file), (pieces.as_path(), pieces_file)] {
        let named = file.sync_all().and_then(|()| fs::rename(part(path), path));
        named.map_err(|e| failed(path, e))?;
    }
    Ok(rows)
}

/// Makes batches on all processors, one each at a time, and hands them on in order: while some are
/// made, those before are written. Memory holds two rounds of batches, however many there are.
fn in_order(
    corpus: &Corpus,
    batches: &[Range<u32>],
    mut take: impl FnMut(&Range<u32>, Batch) -> Result<(), Error>,
) -> Result<(), Error> {
    let workers = std::thread::available_parallelism().map_or(1, usize::from);
    let mut before: Vec<(&Range<u32>, Batch)> = Vec::new();
    for round in batches.chunks(workers) {
        let made = std::thread::scope(|scope| {
            let begun: Vec<_> = round
                .iter()
                .map(|range| (range, scope.spawn(|| corpus.batch(range.start, range.end))))
                .collect();
            let written = before.drain(..).try_for_each(|(range, batch)| take(range, batch));
            let made = begun.into_iter().map(|(range, worker)| {
                let batch = worker.join();
                let broke = |_| Err(Error::new("a worker thread of the corpus failed"));
                Ok((range, batch.unwrap_or_else(broke)?))
            });
            let made = made.collect::<Result<Vec<_>, Error>>();
            written.and(made)
        });
        before = made?;
    }
    before.into_iter().try_for_each(|(range, batch)| take(range, batch))
}
