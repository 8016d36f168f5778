//! Variations by the thousand, of one class or of many, streamed to disk.

use super::SynthOrder;
use super::catalogue::{Catalogue, ClassNote, open_folder, stem, subject};
use super::room::{self, Watched};
use crate::action::corpus::{Corpus, VariationRow, VariationStatus, Variations};
use crate::action::parquet::{CorpusWriter, Packed, SetEnd, TableLayout};
use crate::action::{Fits, phrase};
use crate::draft::Draft;
use crate::error::{Error, counted};
use crate::job::pending::{Pending, go_on, unless_stopped};
use crate::job::report::Outcome;
use crate::job::share::Share;
use crate::job::{Event, Observer};
use serde::Serialize;
use std::io::{BufWriter, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

/// Poses in a row group, about, so that a query for one variation reads few others and memory does
/// not grow with length and rate; and most variations. Neither depends on the machine, so that files
/// are the same everywhere.
const POSES_IN_BATCH: usize = 20_000;
const MAX_IN_BATCH: usize = 250;
/// Row groups in the files of a folder. A file is what a kill loses.
const BATCHES_IN_FILE: u32 = 5;
/// Most variations of a class.
pub const MAX_VARIATIONS: u32 = 100_000_000;
/// Variations from which the room is estimated that all take.
const SAMPLE: u32 = 16;
/// What a row of the table of variations takes, about, bytes.
const ROW_BYTES: u64 = 60;

/// A class of a corpus.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ClassOrder {
    /// What a learner is to call it.
    pub label: String,
    /// The action, or several, as in [`phrase`].
    pub phrase: String,
    /// How many variations.
    pub variations: u32,
}

/// What came of it.
#[derive(Clone, Debug, Serialize)]
pub struct VariedReport {
    /// `done`, or `done_with_loss` if the feet of some do not hold.
    pub outcome: Outcome,
    /// Variations in all, or in the part.
    pub variations: u64,
    /// Which part of how many.
    pub part: [usize; 2],
    /// Variations that were there already.
    pub found: u64,
    /// What was there and is not what it was, or was cut off, and so was made anew: which file, and why.
    pub mended: Vec<String>,
    /// Poses written now.
    pub poses: u64,
    /// By class.
    pub classes: Vec<ClassReport>,
    /// Where.
    pub written: String,
}

/// What came of one class.
#[derive(Clone, Debug, Serialize)]
pub struct ClassReport {
    /// What a learner is to call it.
    pub label: String,
    /// The actions' names.
    pub class: String,
    /// Its variations.
    pub variations: u32,
    /// Of those made now, whose feet hold as they were drawn ...
    pub valid: u64,
    /// ... since they were repaired ...
    pub repaired: u64,
    /// ... and not at all, after as many draws as are made.
    pub implausible: u64,
    /// Draws whose feet did not hold, that were drawn anew.
    pub rejected: u64,
}

impl VariedReport {
    /// How many variations, and in which part, if it is one.
    #[must_use]
    pub fn variations_text(&self) -> String {
        match self.part {
            [1, 1] => counted(self.variations, "variation"),
            [part, of] => {
                format!("{} (part {part}/{of})", counted(self.variations, "variation"))
            }
        }
    }

    /// With what came of its classes.
    fn with(mut self, classes: Vec<ClassReport>) -> Self {
        if classes.iter().any(|class| class.implausible > 0) {
            self.outcome = Outcome::DoneWithLoss;
        }
        self.classes = classes;
        self
    }
}

impl ClassReport {
    fn count(&mut self, row: &VariationRow) {
        *match row.status {
            VariationStatus::Valid => &mut self.valid,
            VariationStatus::Repaired => &mut self.repaired,
            VariationStatus::Implausible => &mut self.implausible,
        } += 1;
        self.rejected += u64::from(row.rejected);
    }
}

/// A class, and how its files are laid out.
struct Class {
    made: Variations,
    note: ClassNote,
    variations: u32,
    /// Variations in a row group.
    in_batch: u32,
    layout: TableLayout,
    /// How they were made, as its files note it.
    notes: String,
}

/// Variations of one class that go into one set of files.
#[derive(Clone)]
struct Stretch {
    class: Arc<Class>,
    range: Range<u32>,
}

/// A set of files: poses, actionlets, variations.
struct Set {
    poses: PathBuf,
    stretches: Vec<Stretch>,
}

/// What there is of a set.
enum There {
    Nothing,
    /// All of it.
    Whole,
    /// Fewer variations, from when there were to be fewer.
    Fewer,
    /// Something else: which file, and why.
    Damaged(String),
}

/// Makes variations: into one set of files, or a folder of them that is taken up again where it was
/// left, and grows.
///
/// # Errors
/// If a figure is out of range, there is no room, files cannot be written, or the folder holds another
/// corpus.
pub fn vary(
    order: &SynthOrder,
    classes: &[ClassOrder],
    observer: &dyn Observer,
) -> Result<VariedReport, Error> {
    order.check_varied()?;
    let out = &order.file;
    let is_file = out.extension().is_some_and(|e| e == "parquet");
    if !is_file {
        refuse_file_names(out)?;
    } else if order.part != Share::WHOLE {
        return Err(Error::new("a single file is not made in parts")
            .at("--part")
            .got(order.part.to_string())
            .remedy("name a folder: -o corpus/"));
    }
    let (asked, classes) = {
        let (order, classes) = (order.clone(), classes.to_vec());
        unless_stopped(observer, move || classes_of(&order, &classes, is_file))?
    };
    let total = classes.iter().map(|class| u64::from(class.variations)).sum();
    let mut made = VariedReport {
        outcome: Outcome::Done,
        variations: total,
        part: order.part.numbers(),
        found: 0,
        mended: Vec::new(),
        poses: 0,
        classes: Vec::new(),
        written: out.display().to_string(),
    };
    let classes_report = classes.iter().map(|class| class.report()).collect();
    let mut steps = Steps { done: 0, total, observer, classes: classes_report };
    if is_file {
        let whole =
            |class: &Arc<Class>| Stretch { class: Arc::clone(class), range: 0..class.variations };
        let set = Set { poses: out.clone(), stretches: classes.iter().map(whole).collect() };
        let mut missing = Missing::of(std::slice::from_ref(&set), observer)?;
        room::check(out, missing.bytes)?;
        made.poses = set.write(&mut missing, &mut steps)?;
        return Ok(made.with(steps.classes));
    }
    let all = classes.iter().flat_map(|class| class.sets(out)).enumerate();
    let own: Vec<Set> =
        all.filter(|(place, _)| order.part.has(*place)).map(|(_, set)| set).collect();
    made.variations = own.iter().map(Set::variations).sum();
    steps.total = made.variations;
    let mut sets = Vec::new();
    for set in own {
        go_on(observer)?;
        match set.there() {
            There::Whole => {
                made.found += set.variations();
                steps.take(set.variations());
                continue;
            }
            There::Damaged(how) => made.mended.push(how),
            There::Nothing | There::Fewer => {}
        }
        sets.push(set);
    }
    let mut missing = Missing::of(&sets, observer)?;
    room::check(out, missing.bytes)?;
    let _lock = open_folder(out, &asked, order.replace, order.part)?;
    for set in &sets {
        made.poses += set.write(&mut missing, &mut steps)?;
    }
    Ok(made.with(steps.classes))
}

/// The classes in the order of their labels, and what is written of them.
fn classes_of(
    order: &SynthOrder,
    classes: &[ClassOrder],
    is_file: bool,
) -> Result<(Catalogue, Vec<Arc<Class>>), Error> {
    let mut ordered: Vec<&ClassOrder> = classes.iter().collect();
    ordered.sort_by(|a, b| a.label.cmp(&b.label));
    if let Some(pair) = ordered.windows(2).find(|pair| pair[0].label == pair[1].label) {
        return Err(Error::new("two classes have one label").got(pair[0].label.clone()));
    }
    let mut corpora = Vec::new();
    let mut fits = Fits::of(order.figures.body()?);
    for class in ordered {
        let mut corpus = order.corpus(&class.phrase, &mut fits)?;
        corpus.label.clone_from(&class.label);
        let note = ClassNote::of(&corpus, &class.phrase, Some(class.variations));
        corpora.push((corpus, note, class.variations));
    }
    let Some((first, ..)) = corpora.first() else {
        return Err(Error::new("no class was named"));
    };
    let catalogue = Catalogue {
        generator: format!("gaitway {}", env!("CARGO_PKG_VERSION")),
        seed: order.seed,
        rate_hz: order.rate_hz,
        set: order.figures.pairs.clone(),
        database: order.database.iter().map(|folder| folder.display().to_string()).collect(),
        points: order.has_points,
        subject: subject(first),
        stature_m: first.body.stature_m(),
        classes: corpora.iter().map(|(_, note, _)| note.clone()).collect(),
    };
    catalogue.check_stems()?;
    let laid_out = corpora.into_iter().map(|(corpus, note, variations)| {
        let mut notes = catalogue.clone();
        if !is_file {
            notes.classes = vec![ClassNote { variations: None, ..note.clone() }];
        }
        let notes = notes.text()?;
        let layout = TableLayout::new(&corpus, &catalogue.subject, &notes)?;
        let in_batch = in_batch(&corpus)?;
        let made = Variations::of(corpus)?;
        Ok(Arc::new(Class { made, note, variations, in_batch, layout, notes }))
    });
    let laid_out = laid_out.collect::<Result<_, Error>>()?;
    Ok((catalogue, laid_out))
}

/// Says how many variations are made.
struct Steps<'a> {
    done: u64,
    total: u64,
    observer: &'a dyn Observer,
    classes: Vec<ClassReport>,
}

impl Steps<'_> {
    fn count(&mut self, label: &str, packed: &Packed) {
        let class = self.classes.iter_mut().find(|class| class.label == label);
        class.into_iter().for_each(|class| packed.rows().iter().for_each(|row| class.count(row)));
    }

    fn take(&mut self, variations: u64) {
        self.done += variations;
        let (done, total) = (self.done, self.total);
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

/// The files beside one of poses: actionlets and variations. `poses-run-000001.parquet` has
/// `actionlets-run-000001.parquet`, `run.parquet` has `run.actionlets.parquet`.
#[must_use]
pub fn tables_beside(poses: &Path) -> [PathBuf; 2] {
    let stem = poses.file_stem().and_then(|stem| stem.to_str()).unwrap_or("corpus");
    ["actionlets", "variations"].map(|table| {
        let name = match stem.strip_prefix("poses-") {
            Some(rest) => format!("{table}-{rest}.parquet"),
            None => format!("{stem}.{table}.parquet"),
        };
        poses.with_file_name(name)
    })
}

/// What is still to be written.
struct Missing {
    bytes: u64,
    /// Bytes of a variation, by label.
    each: Vec<(String, u64)>,
}

impl Missing {
    fn of(sets: &[Set], observer: &dyn Observer) -> Result<Self, Error> {
        let mut missing = Self { bytes: 0, each: Vec::new() };
        for stretch in sets.iter().flat_map(|set| &set.stretches) {
            let label = &stretch.class.note.label;
            if !missing.each.iter().any(|(known, _)| known == label) {
                let few = stretch.clone();
                let each = unless_stopped(observer, move || few.bytes_of_one())?;
                missing.each.push((label.clone(), each));
            }
            missing.bytes += missing.bytes_of(stretch);
        }
        Ok(missing)
    }

    fn bytes_of(&self, stretch: &Stretch) -> u64 {
        let label = &stretch.class.note.label;
        let each = self.each.iter().find(|(known, _)| known == label).map_or(0, |(_, each)| *each);
        each.saturating_mul(stretch.range.len() as u64)
    }
}

impl Class {
    fn report(&self) -> ClassReport {
        let (label, class) = (self.note.label.clone(), self.note.class.clone());
        let variations = self.variations;
        ClassReport { label, class, variations, valid: 0, repaired: 0, implausible: 0, rejected: 0 }
    }

    /// Its files in a folder: all but the last hold equally many variations.
    fn sets(self: &Arc<Self>, folder: &Path) -> impl Iterator<Item = Set> {
        let in_file = self.in_batch * BATCHES_IN_FILE;
        let stem = stem(&self.note.label);
        (0..self.variations).step_by(in_file as usize).map(move |from| {
            let range = from..from.saturating_add(in_file).min(self.variations);
            let name = format!("poses-{stem}-{:06}.parquet", from / in_file);
            let stretch = Stretch { class: Arc::clone(self), range };
            Set { poses: folder.join(name), stretches: vec![stretch] }
        })
    }
}

impl Stretch {
    fn batches(&self) -> Vec<Range<u32>> {
        let (end, in_batch) = (self.range.end, self.class.in_batch);
        let starts = self.range.clone().step_by(in_batch as usize);
        starts.map(|start| start..start.saturating_add(in_batch).min(end)).collect()
    }

    fn packed(&self, range: &Range<u32>) -> Result<Packed, Error> {
        self.class.layout.pack(self.class.made.batch(range.start, range.end)?)
    }

    /// What a variation takes, bytes, from a few of them.
    fn bytes_of_one(&self) -> Result<u64, Error> {
        let few = SAMPLE.min(self.class.in_batch).min(self.range.len() as u32);
        let range = self.range.start..self.range.start + few;
        let bytes = self.packed(&range)?.bytes();
        Ok(bytes.div_ceil(u64::from(few.max(1))) + ROW_BYTES)
    }

    /// Makes batches on all processors, one each at a time, and hands them on in order: while some are
    /// made, those before are written. Memory holds two rounds of batches, however many there are.
    fn in_order(
        &self,
        observer: &dyn Observer,
        mut take: impl FnMut(&Range<u32>, Packed) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let workers = std::thread::available_parallelism().map_or(1, usize::from);
        let begun = |range: &Range<u32>| {
            let (stretch, range) = (self.clone(), range.clone());
            Pending::begin(move || stretch.packed(&range))
        };
        let mut before: Vec<(&Range<u32>, Packed)> = Vec::new();
        let batches = self.batches();
        for round in batches.chunks(workers) {
            let pending = round.iter().map(begun).collect::<Result<Vec<_>, _>>()?;
            before.drain(..).try_for_each(|(range, packed)| take(range, packed))?;
            for (range, pending) in round.iter().zip(pending) {
                before.push((range, pending.wait(observer)??));
            }
        }
        before.into_iter().try_for_each(|(range, packed)| take(range, packed))
    }
}

impl Set {
    fn variations(&self) -> u64 {
        self.stretches.iter().map(|stretch| stretch.range.len() as u64).sum()
    }

    fn paths(&self) -> [PathBuf; 3] {
        let [pieces, variations] = tables_beside(&self.poses);
        [self.poses.clone(), pieces, variations]
    }

    /// What there is of it in a folder, where it has one stretch.
    fn there(&self) -> There {
        let paths = self.paths();
        let Some(Stretch { class, range }) = self.stretches.first() else { return There::Nothing };
        if paths.iter().all(|path| path.symlink_metadata().is_err()) {
            return There::Nothing;
        }
        let whole = match SetEnd::of(&paths) {
            Ok(end) => end,
            Err(why) => return There::Damaged(why.to_string()),
        };
        let first = i64::from(range.start);
        let is_it = whole.notes.as_deref() == Some(&class.notes)
            && whole.first.map(i64::from) == Some(first);
        match whole.variations {
            count if is_it && count == self.variations() => There::Whole,
            count if is_it && count < self.variations() => There::Fewer,
            _ => {
                let [path, ..] = paths;
                There::Damaged(format!("{}: made from something else", path.display()))
            }
        }
    }

    /// Writes it under temporary names, then renames: what has its name is whole, and on the disk.
    fn write(&self, missing: &mut Missing, steps: &mut Steps<'_>) -> Result<u64, Error> {
        let why = Arc::new(OnceLock::new());
        let written = self.write_parts(&why, steps).map_err(|cause| match why.get() {
            Some(&why) => room::filled(&self.poses, missing.bytes, why),
            None => cause,
        })?;
        let bytes = self.stretches.iter().map(|stretch| missing.bytes_of(stretch)).sum();
        missing.bytes = missing.bytes.saturating_sub(bytes);
        Ok(written)
    }

    fn write_parts(
        &self,
        why: &Arc<OnceLock<std::io::ErrorKind>>,
        steps: &mut Steps<'_>,
    ) -> Result<u64, Error> {
        let failed = |path: &Path, e: std::io::Error| {
            room::remember(why, &e);
            Error::of((&e).into(), "cannot write the corpus")
                .at(path.display().to_string())
                .got(e.to_string())
        };
        let Some(first) = self.stretches.first() else { return Ok(0) };
        let begun = |path: PathBuf| -> Result<_, Error> {
            let draft = Draft::beside(&path).map_err(|e| failed(&path, e))?;
            let stream = Watched { draft, why: Arc::clone(why) };
            Ok((path, BufWriter::with_capacity(1 << 20, stream)))
        };
        let [a, b, c] = self.paths().map(begun);
        let mut parts = [a?, b?, c?];
        let name = self.poses.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        let streams = parts.each_mut().map(|(_, stream)| stream);
        let mut writer = CorpusWriter::new(&first.class.layout, name, streams)?;
        let mut poses = 0;
        for (index, stretch) in self.stretches.iter().enumerate() {
            if index > 0 {
                writer.end_class()?;
                writer.turn_to(&stretch.class.layout);
            }
            stretch.in_order(steps.observer, |range, packed| {
                poses += packed.poses();
                steps.count(&stretch.class.note.label, &packed);
                steps.take(range.len() as u64);
                writer.write(packed)
            })?;
        }
        writer.finish()?;
        for (path, stream) in &mut parts {
            let kept = stream.flush().and_then(|()| {
                let draft = &mut stream.get_mut().draft;
                draft.sync()?;
                draft.keep()?;
                draft.sync()
            });
            kept.map_err(|e| failed(path, e))?;
        }
        Ok(poses)
    }
}
