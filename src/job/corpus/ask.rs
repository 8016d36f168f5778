//! A corpus asked: which trials, or which frames of them.

use crate::corpus::query::Question;
use crate::corpus::rows::{PARAMETERS, TrialEntry};
use crate::corpus::select::{FrameSpan, Looked, Selection};
use crate::corpus::store::Store;
use crate::draft::{Draft, check_free};
use crate::error::{Error, ErrorKind};
use crate::job::report::Outcome;
use crate::table::TableWriter;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// What is asked.
#[derive(Clone, Debug, Default)]
pub struct AskOrder {
    /// The folder of the corpus.
    pub corpus: PathBuf,
    /// The question; all trials if it is empty.
    pub question: String,
    /// Frames are wanted, not whole trials.
    pub by_frame: bool,
    /// Trials that are listed at most; all are counted.
    pub most: u64,
    /// A table of all that answer.
    pub file: Option<PathBuf>,
    /// Replace a file that is there.
    pub replace: bool,
}

/// The answer.
#[derive(Clone, Debug, Serialize)]
pub struct AskReport {
    /// `done`.
    pub outcome: Outcome,
    /// The folder of the corpus.
    pub corpus: String,
    /// Its version.
    pub version: String,
    /// The question.
    pub question: String,
    /// How many answer, and what was read for it.
    #[serde(flatten)]
    pub looked: Looked,
    /// How long those that are listed, or in the table, are, s.
    pub duration_s: f64,
    /// The first of those that answer.
    pub clips: Vec<Answer>,
    /// The table of all.
    pub written: Option<String>,
}

/// A trial that answers.
#[derive(Clone, Debug, Serialize)]
pub struct Answer {
    /// The trial.
    #[serde(flatten)]
    pub entry: TrialEntry,
    /// The frames that answer, where frames are asked for.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub answering: Vec<FrameSpan>,
}

/// Asks a corpus.
///
/// # Errors
/// No corpus, a question that cannot be understood, tables that cannot be read, a table that cannot be written.
pub fn ask(order: &AskOrder) -> Result<AskReport, Error> {
    let question = Question::parse(&order.question)?;
    order.file.iter().try_for_each(|file| check_free(file, order.replace))?;
    let mut tried = 0;
    loop {
        let store = Store::open(&order.corpus)?;
        let number = store.version().number;
        match answered(order, &store, &question) {
            // Somebody changed it while it was read: what is asked is the corpus as it is now.
            Err(error) if error.kind == ErrorKind::Absent && tried < 3 => {
                tried += 1;
                if Store::open(&order.corpus)?.version().number == number {
                    return Err(error);
                }
            }
            answered => return answered,
        }
    }
}

fn answered(order: &AskOrder, store: &Store, question: &Question) -> Result<AskReport, Error> {
    let selection = Selection::new(store, question, order.by_frame)?;
    let mut table = order.file.as_deref().map(|file| Answers::new(file, order)).transpose()?;
    let (mut clips, mut duration_s) = (Vec::new(), 0.0);
    let mut take = |entry: &TrialEntry, spans: &[FrameSpan]| -> Result<(), Error> {
        duration_s += match spans {
            [] => entry.duration_s,
            spans => {
                let frames = |span: &FrameSpan| span.last_frame - span.first_frame + 1;
                spans.iter().map(frames).sum::<i64>() as f64 / entry.rate_hz
            }
        };
        if (clips.len() as u64) < order.most {
            clips.push(Answer { entry: entry.clone(), answering: spans.to_vec() });
        }
        table.iter_mut().try_for_each(|table| table.row(entry, spans))
    };
    let looked = if order.by_frame {
        selection.frames(&mut take)?
    } else {
        let most = if order.file.is_some() { u64::MAX } else { order.most };
        selection.trials(most, |entry| take(&entry, &[]))?
    };
    let written = table.map(Answers::finish).transpose()?;
    Ok(AskReport {
        outcome: Outcome::Done,
        corpus: super::shown(store.root()),
        version: store.version().version.clone(),
        question: order.question.clone(),
        looked,
        duration_s,
        clips,
        written,
    })
}

/// The table of all that answer.
struct Answers {
    table: TableWriter<Draft>,
    path: PathBuf,
    by_frame: bool,
}

const COLUMNS: [&str; 16] = [
    "trial",
    "name",
    "set",
    "action",
    "kind",
    "subject",
    "session",
    "licence",
    "noncommercial",
    "verdict",
    "frames",
    "rate_hz",
    "duration_s",
    "body_stature_m",
    "source",
    "source_file",
];

impl Answers {
    fn new(path: &Path, order: &AskOrder) -> Result<Self, Error> {
        let draft = Draft::whole(path, order.replace).map_err(|e| unwritable(path, &e))?;
        let mut table = TableWriter::new(draft);
        let frames: &[&str] = if order.by_frame { &["first_frame", "last_frame"] } else { &[] };
        table.row(COLUMNS.iter().chain(PARAMETERS.iter()).chain(frames))?;
        Ok(Self { table, path: path.to_owned(), by_frame: order.by_frame })
    }

    fn row(&mut self, of: &TrialEntry, spans: &[FrameSpan]) -> Result<(), Error> {
        let word = |text: &Option<String>| text.clone().unwrap_or_default();
        let cells = [
            of.trial.clone(),
            of.name.clone(),
            of.set.clone(),
            of.action.clone(),
            of.kind.word().to_owned(),
            word(&of.subject),
            word(&of.session),
            of.licence.clone(),
            of.noncommercial.to_string(),
            word(&of.verdict),
            of.frames.to_string(),
            of.rate_hz.to_string(),
            of.duration_s.to_string(),
            of.body_stature_m.to_string(),
            of.source.clone(),
            word(&of.source_file),
        ];
        let parameter =
            |name: &&str| of.parameters.get(*name).map_or_else(String::new, f64::to_string);
        let cells: Vec<String> =
            cells.into_iter().chain(PARAMETERS.iter().map(parameter)).collect();
        if !self.by_frame {
            return self.table.row(&cells);
        }
        for span in spans {
            let frames = [span.first_frame.to_string(), span.last_frame.to_string()];
            self.table.row(cells.iter().chain(&frames))?;
        }
        Ok(())
    }

    fn finish(self) -> Result<String, Error> {
        let mut draft = self.table.finish()?;
        draft.sync().and_then(|()| draft.keep()).map_err(|e| unwritable(&self.path, &e))?;
        Ok(super::shown(&self.path))
    }
}

fn unwritable(path: &Path, cause: &std::io::Error) -> Error {
    Error::of(cause.into(), "the table cannot be written")
        .at(path.display().to_string())
        .got(cause.to_string())
}
