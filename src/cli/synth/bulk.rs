//! Variations by the thousand, streamed to disk.

use super::{Figures, SynthArgs};
use crate::action::corpus::{Batch, Corpus};
use crate::action::parquet::CorpusWriter;
use crate::action::{Database, phrase};
use crate::cli::Remarks;
use crate::error::Error;
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use std::fs::{self, File};
use std::io::BufWriter;
use std::path::{Path, PathBuf};

/// Variations in a row group, and in a pair of files of a folder. Neither depends on the machine,
/// so that files are the same everywhere.
const IN_BATCH: u32 = 250;
const IN_FILE: u32 = 10_000;
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
}

/// What came of it.
#[derive(Debug, Serialize)]
pub struct Made {
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

/// Makes `args.variations` variations: into one pair of files, or a folder of them that is taken up
/// again where it was left.
///
/// # Errors
/// If a figure is out of range, files cannot be written, or the folder holds another corpus.
pub fn make(args: &SynthArgs, figures: &Figures, remarks: Remarks) -> Result<Made, Error> {
    let variations = args.variations.unwrap_or(1);
    let corpus = corpus(args, figures)?;
    let about = about(args, variations)?;
    let out = &args.output_file;
    let mut made = Made {
        outcome: "done",
        variations,
        found: 0,
        poses: 0,
        written: out.display().to_string(),
    };
    let bar = bar(variations, remarks);
    if out.extension().is_some_and(|e| e == "parquet") {
        args.output.check_files(&[&Some(out.clone()), &Some(pieces_beside(out))])?;
        made.poses = write_pair(&corpus, out, 0, variations, &about, &bar)?;
        return Ok(made);
    }
    open_folder(out, &about, args.output.force())?;
    let mut from = 0;
    while from < variations {
        let to = from.saturating_add(IN_FILE).min(variations);
        let poses = out.join(format!("poses-{:06}.parquet", from / IN_FILE));
        // The second of the pair is renamed last: where it is, both are whole.
        if pieces_beside(&poses).exists() {
            made.found += to - from;
            bar.inc(u64::from(to - from));
        } else {
            made.poses += write_pair(&corpus, &poses, from, to, &about, &bar)?;
        }
        from = to;
    }
    bar.finish_and_clear();
    Ok(made)
}

fn corpus(args: &SynthArgs, figures: &Figures) -> Result<Corpus, Error> {
    let mut database = Database::shipped()?;
    for folder in &args.database {
        database.add_folder(folder)?;
    }
    let mut parts = phrase::load(&args.action)?;
    for part in &mut parts {
        part.action = figures.applied(part.action.clone())?;
    }
    figures.spread.check()?;
    Ok(Corpus {
        parts,
        join: figures.join(),
        spread: figures.spread,
        database,
        seed: args.seed,
        rate_hz: args.rate,
    })
}

fn about(args: &SynthArgs, variations: u32) -> Result<String, Error> {
    let about = About {
        generator: format!("gaitway {}", env!("CARGO_PKG_VERSION")),
        action: args.action.clone(),
        variations,
        seed: args.seed,
        rate_hz: args.rate,
        set: args.set.clone(),
        database: args.database.iter().map(|folder| folder.display().to_string()).collect(),
    };
    serde_json::to_string_pretty(&about)
        .map(|text| text + "\n")
        .map_err(|e| Error::new("the corpus cannot be described").got(e.to_string()))
}

fn bar(variations: u32, remarks: Remarks) -> ProgressBar {
    if !remarks.shows_progress() {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("{bar:40} {pos} of {len} variations, {eta} left")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::new(u64::from(variations)).with_style(style)
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
        return Err(Error::new("the folder holds another corpus")
            .at(note.display().to_string())
            .got(found.trim().to_owned())
            .allowed(about.trim().to_owned())
            .remedy("choose another folder, or repeat the command that began this one"));
    }
    fs::create_dir_all(folder).map_err(|e| failed("cannot make the folder", e))?;
    let mut entries = fs::read_dir(folder).map_err(|e| failed("cannot read the folder", e))?;
    if !force && entries.next().is_some() {
        return Err(Error::new("the folder is not empty and holds no corpus")
            .at(folder.display().to_string())
            .remedy("choose another folder, or add --force"));
    }
    fs::write(&note, about).map_err(|e| failed("cannot write into the folder", e))
}

/// `poses-000001.parquet` has `actionlets-000001.parquet` beside it, `run.parquet`
/// `run.actionlets.parquet`.
fn pieces_beside(poses: &Path) -> PathBuf {
    let stem = poses.file_stem().and_then(|stem| stem.to_str()).unwrap_or("corpus");
    let name = match stem.strip_prefix("poses-") {
        Some(number) => format!("actionlets-{number}.parquet"),
        None => format!("{stem}.actionlets.parquet"),
    };
    poses.with_file_name(name)
}

/// Writes variations `from..to` under temporary names, then renames: what has its name is whole.
fn write_pair(
    corpus: &Corpus,
    poses: &Path,
    from: u32,
    to: u32,
    about: &str,
    bar: &ProgressBar,
) -> Result<u64, Error> {
    let pieces = pieces_beside(poses);
    let part = |path: &Path| path.with_extension("parquet.part");
    let create = |path: &Path| {
        File::create(part(path)).map(|file| BufWriter::with_capacity(1 << 20, file)).map_err(|e| {
            Error::new("cannot write the corpus").at(path.display().to_string()).got(e.to_string())
        })
    };
    let notes = [("gaitway".to_owned(), about.to_owned())];
    let mut writer = CorpusWriter::new(create(poses)?, create(&pieces)?, &notes)?;
    let mut rows = 0;
    in_order(corpus, from, to, |batch| {
        rows += batch.variation.len() as u64;
        bar.inc(u64::from(IN_BATCH));
        writer.write(&batch)
    })?;
    writer.finish()?;
    for path in [poses, &pieces] {
        fs::rename(part(path), path).map_err(|e| {
            Error::new("cannot name the corpus").at(path.display().to_string()).got(e.to_string())
        })?;
    }
    Ok(rows)
}

/// Makes batches on all processors, one each at a time, and hands them on in order: while some are
/// made, those before are written. Memory holds two rounds of batches, however many there are.
fn in_order(
    corpus: &Corpus,
    from: u32,
    to: u32,
    mut take: impl FnMut(Batch) -> Result<(), Error>,
) -> Result<(), Error> {
    let workers = std::thread::available_parallelism().map_or(1, usize::from);
    let starts: Vec<u32> = (from..to).step_by(IN_BATCH as usize).collect();
    let mut before: Vec<Batch> = Vec::new();
    for round in starts.chunks(workers) {
        let made = std::thread::scope(|scope| {
            let begun: Vec<_> = round
                .iter()
                .map(|start| {
                    let end = start.saturating_add(IN_BATCH).min(to);
                    scope.spawn(move || corpus.batch(*start, end))
                })
                .collect();
            let written = before.drain(..).try_for_each(&mut take);
            let made = begun.into_iter().map(|worker| {
                worker.join().unwrap_or_else(|_| Err(Error::new("a worker of the corpus broke")))
            });
            let made = made.collect::<Result<Vec<Batch>, Error>>();
            written.and(made)
        });
        before = made?;
    }
    before.into_iter().try_for_each(take)
}
