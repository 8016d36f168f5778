//! A folder of trials cleaned, round after round: each into a folder of the cleaned, with its edit list beside it, which a
//! person may change before the next round. What came of each round is kept in a table.

use super::clean::{CleanOrder, clean_with};
use super::clean_aids::{AidFiles, OtherTrial};
use super::clean_check::{Allowed, TrialFigures, looked_at, marker_files_in};
use super::observer::{Event, Nobody, Observer};
use super::report::Outcome;
use crate::clean::artefact::ArtefactKind;
use crate::clean::thresholds::FILE_NAME;
use crate::corpus::store::check_outside;
use crate::draft::{check_free, write_file};
use crate::error::{Error, ErrorKind, counted};
use crate::sensing::wall_clock;
use crate::table::{TableWriter, rows};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// The table of rounds in the folder of the cleaned.
const ROUNDS: &str = "rounds.csv";
/// Its titles.
const TITLES: [&str; 11] = [
    "trial",
    "round",
    "ended",
    "machine_s",
    "person_minutes",
    "by",
    "doubt_before",
    "doubt_after",
    "artefacts",
    "not_mended",
    "above",
];
/// Most bytes of it.
const MOST_BYTES: u64 = 1 << 26;

/// What came of it.
#[derive(Clone, Debug, Serialize)]
pub struct FolderReport {
    /// `done`, or `done_with_loss` if a trial is still above what is allowed, is cut off or cannot be cleaned.
    pub outcome: Outcome,
    /// More doubt than this fails.
    pub most_doubt: f64,
    /// More artefacts of a kind than this fail, in one trial.
    pub most: BTreeMap<ArtefactKind, usize>,
    /// The file of thresholds that was made beside the cleaned trials; null if the folder has none.
    pub thresholds: Option<String>,
    /// All trials: what could not be cleaned first, then those with most doubt left.
    pub trials: Vec<RoundFigures>,
    /// The table of all rounds.
    pub rounds: String,
}

/// A round of one trial.
#[derive(Clone, Debug, Serialize)]
pub struct RoundFigures {
    /// The file, from the folder on.
    pub trial: String,
    /// Which round of it this is, from 1.
    pub round: usize,
    /// How long it took to compute, s.
    pub machine_s: f64,
    /// Minutes that a person spent on its edit list, as it says itself.
    pub person_minutes: Option<f64>,
    /// True if an edit list was applied; false if what is wrong was looked for.
    pub by_edit_list: bool,
    /// Share of samples that are part of an artefact, in the file that was read; null if it cannot be read.
    pub doubt_before: Option<f64>,
    /// The same in the one that was written.
    pub doubt_after: Option<f64>,
    /// Artefacts of each kind that are left.
    pub artefacts_after: BTreeMap<ArtefactKind, usize>,
    /// What was wrong.
    pub artefacts: usize,
    /// Of these not mended.
    pub not_mended: usize,
    /// Frames that the file claims and does not hold: it is cut off.
    pub lost_frames: u64,
    /// What is above its threshold after cleaning.
    pub above: Vec<String>,
    /// Where it was written.
    pub written: Option<String>,
    /// Its edit list.
    pub edits: Option<String>,
    /// Why it could not be cleaned.
    pub error: Option<String>,
}

/// Cleans the trials of a folder into another (`markers` and `file` of the order), in which edit lists that are there are
/// applied. More than `most_doubt` after cleaning fails; by the folder's own thresholds unless it is said.
///
/// # Errors
/// A folder that cannot be read, or without files of markers; thresholds or a table of rounds that are none; files that
/// exist or cannot be written; what goes with one trial alone. A trial among others that cannot be cleaned is part of the
/// report.
pub fn clean_folder(
    order: &CleanOrder,
    most_doubt: Option<f64>,
    observer: &dyn Observer,
) -> Result<FolderReport, Error> {
    if order.edits.is_some() || order.html.is_some() || !order.others.is_empty() {
        return Err(Error::new("edit lists, pages and other trials are named for one file alone")
            .at(order.markers.display().to_string())
            .remedy(
                "of a folder, edit lists stand beside what is written and are applied again, and each \
                 trial has the others; leave --edits, --html and --others out",
            ));
    }
    check_outside(&order.file)?;
    let allowed = Allowed::of(&order.markers, most_doubt)?;
    let trials = trials(order)?;
    let mut kept = Rounds::read(&order.file.join(ROUNDS))?;
    for trial in &trials {
        let to = order.file.join(trial);
        check_outside(&to)?;
        check_free(&to, order.replace)?;
    }
    let total = 2 * trials.len() as u64;
    let mut others = Vec::new();
    for (done, trial) in trials.iter().enumerate() {
        observer.hear(Event::Step { done: done as u64, total, what: "trials" });
        // What cannot be read is told of below, and helps nobody.
        let read = OtherTrial::read_into(&mut others, &order.markers.join(trial), order.rate_hz);
        if matches!(read, Ok(false)) {
            break;
        }
    }
    let aids = AidFiles::with(order.static_trial.as_deref(), others)?;
    let mut figures = Vec::new();
    for (done, trial) in trials.iter().enumerate() {
        let done = (trials.len() + done) as u64;
        observer.hear(Event::Step { done, total, what: "trials" });
        let mut round = of_trial(order, trial, &aids, &allowed);
        round.round = kept.next_of(&round.trial);
        kept.add(&round)?;
        figures.push(round);
        // What was done stays told, whatever happens to those that are left.
        kept.write()?;
    }
    observer.hear(Event::Step { done: total, total, what: "trials" });
    let doubt = |of: &RoundFigures| of.doubt_after.unwrap_or(f64::INFINITY);
    figures.sort_by(|a, b| doubt(b).total_cmp(&doubt(a)).then(a.trial.cmp(&b.trial)));
    let is_good =
        |of: &RoundFigures| of.above.is_empty() && of.error.is_none() && of.lost_frames == 0;
    let is_good = figures.iter().all(is_good);
    Ok(FolderReport {
        outcome: if is_good { Outcome::Done } else { Outcome::DoneWithLoss },
        most_doubt: allowed.most_doubt,
        thresholds: allowed.file.map(|file| taken_along(&file, &order.file)).transpose()?,
        most: allowed.most,
        trials: figures,
        rounds: kept.file.display().to_string(),
    })
}

/// The trials, from the folder on; not those that were cleaned into a folder in it.
fn trials(order: &CleanOrder) -> Result<Vec<PathBuf>, Error> {
    let whole = |path: &Path| std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    let (folder, output) = (whole(&order.markers), whole(&order.file));
    if folder == output {
        return Err(Error::of(
            ErrorKind::Refused,
            "the cleaned would stand in the place of the trials",
        )
        .at(order.file.display().to_string())
        .remedy("name another folder"));
    }
    let mut found = Vec::new();
    marker_files_in(&order.markers, &mut found)?;
    found.retain(|file| !whole(file).starts_with(&output));
    let from_here = found.iter().filter_map(|file| file.strip_prefix(&order.markers).ok());
    let trials: Vec<PathBuf> = from_here.map(Path::to_owned).collect();
    if trials.is_empty() {
        return Err(Error::of(ErrorKind::Absent, "the folder has no trials of markers")
            .at(order.markers.display().to_string())
            .allowed("files that end in .c3d, .trc, .csm, or tables (.csv) of markers"));
    }
    Ok(trials)
}

/// Cleans one trial, and looks at what came of it.
fn of_trial(order: &CleanOrder, trial: &Path, aids: &AidFiles, allowed: &Allowed) -> RoundFigures {
    let begun = Instant::now();
    let (from, to) = (order.markers.join(trial), order.file.join(trial));
    let list = edit_list(&to);
    let by_edit_list = list.exists();
    let before = looked_at(&from, order.rate_hz);
    let folder = to.parent().map_or(Ok(()), std::fs::create_dir_all);
    let folder = folder.map_err(|cause| {
        Error::of((&cause).into(), "the folder cannot be made").at(to.display().to_string())
    });
    let cleaned = folder.and_then(|()| {
        let order = CleanOrder {
            markers: from.clone(),
            file: to.clone(),
            edits: Some(list.clone()),
            static_trial: None,
            ..order.clone()
        };
        clean_with(&order, Some(aids.of(&from)), &Nobody)
    });
    let mut figures = RoundFigures {
        trial: trial.display().to_string(),
        round: 0,
        machine_s: 0.0,
        person_minutes: None,
        by_edit_list,
        doubt_before: before.doubt,
        doubt_after: None,
        artefacts_after: BTreeMap::new(),
        artefacts: 0,
        not_mended: 0,
        lost_frames: before.lost_frames,
        above: Vec::new(),
        written: None,
        edits: None,
        error: None,
    };
    match cleaned {
        Ok(report) => {
            let after: TrialFigures = looked_at(&to, order.rate_hz);
            figures.above = allowed.above(&after);
            figures.doubt_after = after.doubt;
            figures.artefacts_after = after.artefacts;
            figures.artefacts = report.artefacts.len();
            figures.not_mended = report.artefacts.iter().filter(|of| !of.is_mended()).count();
            figures.person_minutes = report.person_minutes;
            figures.written = Some(report.written);
            figures.edits = Some(report.edits);
        }
        Err(error) => figures.error = Some(error.in_one_line()),
    }
    figures.machine_s = begun.elapsed().as_secs_f64();
    figures
}

/// Where the edit list of a cleaned trial is: under its whole name, since `walk.c3d` and `walk.trc` are two.
fn edit_list(cleaned: &Path) -> PathBuf {
    let mut name = cleaned.file_name().unwrap_or_default().to_owned();
    name.push(".edits.toml");
    cleaned.with_file_name(name)
}

/// Thresholds go where the trials go.
fn taken_along(file: &Path, output: &Path) -> Result<String, Error> {
    let to = output.join(FILE_NAME);
    if !to.exists() {
        let text = gaitway_profiles::read_text(file)?;
        write_file(&to, false, text.as_bytes())?;
    }
    Ok(to.display().to_string())
}

/// The table of rounds.
struct Rounds {
    file: PathBuf,
    cells: Vec<Vec<String>>,
}

impl Rounds {
    fn read(file: &Path) -> Result<Self, Error> {
        let mut read = Self { file: file.to_owned(), cells: Vec::new() };
        if !file.exists() {
            return Ok(read);
        }
        let wrong = |what: String| {
            Error::of(ErrorKind::Malformed, "not a table of rounds")
                .at(file.display().to_string())
                .got(what)
                .remedy("move it away: a new one is begun")
        };
        let length = file.metadata().map_or(0, |of| of.len());
        if length > MOST_BYTES {
            return Err(wrong(counted(length, "byte")));
        }
        let text = std::fs::read_to_string(file).map_err(|cause| wrong(cause.to_string()))?;
        let mut is_titled = false;
        for row in rows(&text) {
            let row = row.map_err(|error| error.in_file(file))?;
            let cells: Vec<String> = row.cells().map(str::to_owned).collect();
            if !is_titled && cells != TITLES {
                return Err(wrong(cells.join(",")));
            }
            if is_titled {
                read.cells.push(cells);
            }
            is_titled = true;
        }
        Ok(read)
    }

    /// The number of a trial's next round.
    fn next_of(&self, trial: &str) -> usize {
        1 + self.cells.iter().filter(|row| row.first().is_some_and(|of| of == trial)).count()
    }

    fn add(&mut self, of: &RoundFigures) -> Result<(), Error> {
        let share = |doubt: Option<f64>| doubt.map_or_else(String::new, |of| format!("{of:.6}"));
        let above = match &of.error {
            Some(_) => "failed".to_owned(),
            None => of.above.join(" "),
        };
        self.cells.push(vec![
            of.trial.clone(),
            of.round.to_string(),
            wall_clock().to_string(),
            format!("{:.1}", of.machine_s),
            of.person_minutes.map_or_else(String::new, |of| of.to_string()),
            if of.by_edit_list { "edit_list" } else { "found" }.to_owned(),
            share(of.doubt_before),
            share(of.doubt_after),
            of.artefacts.to_string(),
            of.not_mended.to_string(),
            above,
        ]);
        Ok(())
    }

    fn write(&self) -> Result<(), Error> {
        let mut table = TableWriter::new(Vec::new());
        table.row(TITLES)?;
        for row in &self.cells {
            table.row(row)?;
        }
        write_file(&self.file, true, &table.finish()?)
    }
}
