//! Which trials, and which frames, answer a question. Partitions and row groups that cannot hold an answer are not
//! read, and of the others only the columns that are asked for.

use super::query::{Comparison, FieldTest, Literal, QueryField, Question, Test};
use super::rows::{SubjectEntry, TrialEntry};
use super::store::Store;
use super::tables::{LABELS, TRIALS, measure_name, trial_columns, trials_of};
use super::version::FileNote;
use crate::body::anthropometry::Measure;
use crate::columnar::{Column, ColumnKind, Span, TableReader};
use crate::error::Error;
use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::ops::Range;

/// More frames no trial has: ten days at 100 a second. A table of strangers may say anything.
const MOST_FRAMES: usize = 100_000_000;

/// What was looked at, and how many answer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Looked {
    /// Trials that answer.
    pub trials: u64,
    /// Files of the catalogue there are ...
    pub files: u64,
    /// ... and those that were opened.
    pub files_read: u64,
    /// Row groups in these ...
    pub groups: u64,
    /// ... and those that were read.
    pub groups_read: u64,
}

/// Frames of a trial that answer, the last one included.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct FrameSpan {
    /// The first.
    pub first_frame: i64,
    /// The last.
    pub last_frame: i64,
}

/// Ids of trials, by set and action.
type ByPartition = HashMap<(String, String), HashSet<String>>;
/// Labels and their frames, by the id of a trial.
type ByTrial = HashMap<String, Vec<(String, Range<usize>)>>;

/// A question, with what is known of people and labels.
pub struct Selection<'a> {
    store: &'a Store,
    question: &'a Question,
    subjects: Vec<SubjectEntry>,
    /// By label test, trials in which it is true somewhere, by partition.
    labelled: Vec<(FieldTest, ByPartition)>,
    /// True if labels and signals are asked frame by frame.
    by_frame: bool,
}

impl<'a> Selection<'a> {
    /// Asks a corpus. `by_frame` if frames are wanted, and not whole trials.
    ///
    /// # Errors
    /// Tables that cannot be read; a question about signals that is not asked by frame.
    pub fn new(store: &'a Store, question: &'a Question, by_frame: bool) -> Result<Self, Error> {
        let tests = question.tests();
        let signal = tests.iter().find_map(|test| match &test.field {
            QueryField::Frame(name) => Some(name),
            _ => None,
        });
        if let Some(name) = signal.filter(|_| !by_frame) {
            return Err(Error::new("this is a question about frames")
                .got(format!("frame.{name}"))
                .remedy("add --frames: the answer is then from which frame to which"));
        }
        let asks_people = tests.iter().any(|test| matches!(test.field, QueryField::Subject(..)));
        let subjects = if asks_people { store.subjects()? } else { Vec::new() };
        let mut labelled: Vec<(FieldTest, _)> = Vec::new();
        for test in tests.iter().filter(|test| test.field == QueryField::Label) {
            let positive = FieldTest { nowhere: false, ..(*test).clone() };
            if !labelled.iter().any(|(known, _)| *known == positive) {
                labelled.push((positive, HashMap::new()));
            }
        }
        let mut selection = Self { store, question, subjects, labelled, by_frame };
        selection.look_at_labels()?;
        Ok(selection)
    }

    fn look_at_labels(&mut self) -> Result<(), Error> {
        if self.labelled.is_empty() {
            return Ok(());
        }
        for note in self.store.files(LABELS) {
            let table = self.store.table(&note.path)?;
            for group in 0..table.groups() {
                let span = table.span(group, "label");
                if !self.labelled.iter().any(|(test, _)| may_hold(&test.test, &span)) {
                    continue;
                }
                let [labels, values, trials] =
                    ["label", "value", "trial"].map(|name| table.column(group, name, None));
                let (labels, values, trials) = (labels?, values?, trials?);
                for (test, found) in &mut self.labelled {
                    let key = (note.set.clone(), note.action.clone());
                    for row in 0..labels.len() {
                        let is =
                            values.real(row) == Some(1.0) && test.test.of_text(labels.text(row));
                        if let Some(trial) = trials.text(row).filter(|_| is) {
                            let of = found.entry(key.clone()).or_default();
                            if !of.contains(trial) {
                                of.insert(trial.to_owned());
                            }
                        }
                    }
                }
            }
        }
        Ok(())
    }

    fn labelled(&self, test: &FieldTest) -> Option<&ByPartition> {
        let is = |known: &FieldTest| known.test == test.test;
        self.labelled.iter().find(|(known, _)| is(known)).map(|(_, found)| found)
    }

    /// True if a file of trials may hold an answer.
    fn may_be_in(&self, note: &FileNote) -> bool {
        let key = (note.set.clone(), note.action.clone());
        self.question.holds(&mut |test| match &test.field {
            QueryField::Set => test.test.of_text(Some(&note.set)),
            QueryField::Action => test.test.of_text(Some(&note.action)),
            QueryField::Label if !test.nowhere => {
                self.labelled(test).is_some_and(|found| found.contains_key(&key))
            }
            _ => true,
        })
    }

    /// True if a row group of a file may hold an answer.
    fn may_be_in_group(&self, note: &FileNote, table: &TableReader, group: usize) -> bool {
        self.question.holds(&mut |test| match &test.field {
            QueryField::Set => test.test.of_text(Some(&note.set)),
            QueryField::Action => test.test.of_text(Some(&note.action)),
            QueryField::Trial(name, _) => may_hold(&test.test, &table.span(group, name)),
            QueryField::Subject(..) => {
                let span = table.span(group, "subject");
                let within = |id: &str| match &span {
                    Span::Text(least, most) => {
                        least.as_slice() <= id.as_bytes() && id.as_bytes() <= most.as_slice()
                    }
                    Span::Nothing => false,
                    _ => true,
                };
                // Of a trial that nobody did everything is missing.
                let nobody = test.test == Test::Missing(true);
                nobody
                    || self
                        .subjects
                        .iter()
                        .any(|of| within(&of.subject.id) && of_subject(test, Some(of)))
            }
            QueryField::Label | QueryField::Frame(_) => true,
        })
    }

    /// Hands on the trials that answer, in the order of their files; those beyond `most` are only counted.
    ///
    /// # Errors
    /// Tables that cannot be read; what `take` says.
    pub fn trials(
        &self,
        most: u64,
        mut take: impl FnMut(TrialEntry) -> Result<(), Error>,
    ) -> Result<Looked, Error> {
        let mut looked = Looked::default();
        let columns = trial_columns();
        for note in self.store.files(TRIALS) {
            looked.files += 1;
            if !self.may_be_in(note) {
                continue;
            }
            looked.files_read += 1;
            let table = self.store.table(&note.path)?;
            for group in 0..table.groups() {
                looked.groups += 1;
                if !self.may_be_in_group(note, &table, group) {
                    continue;
                }
                looked.groups_read += 1;
                let rows = self.rows_in(note, &table, group)?;
                let count: usize = rows.iter().map(ExactSizeIterator::len).sum();
                let wanted = most.saturating_sub(looked.trials);
                looked.trials += count as u64;
                let rows = first_of(rows, usize::try_from(wanted).unwrap_or(usize::MAX));
                if rows.is_empty() {
                    continue;
                }
                let found = columns
                    .iter()
                    .map(|(name, _)| table.column(group, name, Some(&rows)))
                    .collect::<Result<Vec<Column>, Error>>()
                    .and_then(|columns| trials_of(&columns, &note.set, &note.action))
                    .map_err(|error| error.in_file(&self.store.path(&note.path)))?;
                found.into_iter().try_for_each(&mut take)?;
            }
        }
        Ok(looked)
    }

    /// The rows of a group that answer.
    fn rows_in(
        &self,
        note: &FileNote,
        table: &TableReader,
        group: usize,
    ) -> Result<Vec<Range<usize>>, Error> {
        let rows = table.rows_in(group);
        let mut read: BTreeMap<String, Column> = BTreeMap::new();
        let column = |name: &str| table.column(group, name, None);
        let mask = self.mask(
            self.question,
            rows,
            &mut |name| {
                if !read.contains_key(name) {
                    read.insert(name.to_owned(), column(name)?);
                }
                Ok(read[name].clone())
            },
            note,
        );
        mask.map(|mask| runs(&mask)).map_err(|error| error.in_file(&self.store.path(&note.path)))
    }

    fn mask(
        &self,
        question: &Question,
        rows: usize,
        column: &mut dyn FnMut(&str) -> Result<Column, Error>,
        note: &FileNote,
    ) -> Result<Vec<bool>, Error> {
        match question {
            Question::All(of) => {
                let mut all = vec![true; rows];
                for one in of {
                    // What no row has does not have to be looked at further.
                    if !all.contains(&true) {
                        break;
                    }
                    let mask = self.mask(one, rows, column, note)?;
                    all.iter_mut().zip(mask).for_each(|(all, one)| *all &= one);
                }
                Ok(all)
            }
            Question::Any(of) => {
                let mut any = vec![false; rows];
                for one in of {
                    if !any.contains(&false) {
                        break;
                    }
                    let mask = self.mask(one, rows, column, note)?;
                    any.iter_mut().zip(mask).for_each(|(any, one)| *any |= one);
                }
                Ok(any)
            }
            Question::One(test) => self.mask_of(test, rows, column, note),
        }
    }

    fn mask_of(
        &self,
        test: &FieldTest,
        rows: usize,
        column: &mut dyn FnMut(&str) -> Result<Column, Error>,
        note: &FileNote,
    ) -> Result<Vec<bool>, Error> {
        match &test.field {
            QueryField::Set => Ok(vec![test.test.of_text(Some(&note.set)); rows]),
            QueryField::Action => Ok(vec![test.test.of_text(Some(&note.action)); rows]),
            QueryField::Trial(name, kind) => Ok(column_mask(&column(name)?, *kind, &test.test)),
            QueryField::Subject(..) => {
                let ids = column("subject")?;
                let by_id: HashMap<&str, bool> = self
                    .subjects
                    .iter()
                    .map(|of| (of.subject.id.as_str(), of_subject(test, Some(of))))
                    .collect();
                let nobody = of_subject(test, None);
                let is =
                    |row| ids.text(row).and_then(|id| by_id.get(id)).copied().unwrap_or(nobody);
                Ok((0..rows).map(is).collect())
            }
            // By frame, what is labelled somewhere may be an answer, and so may what is so nowhere.
            QueryField::Label if self.by_frame && test.nowhere => Ok(vec![true; rows]),
            QueryField::Label => {
                let key = (note.set.clone(), note.action.clone());
                let Some(found) = self.labelled(test).and_then(|found| found.get(&key)) else {
                    return Ok(vec![test.nowhere; rows]);
                };
                let trials = column("trial")?;
                let is =
                    |row| trials.text(row).is_some_and(|id| found.contains(id)) != test.nowhere;
                Ok((0..rows).map(is).collect())
            }
            QueryField::Frame(_) => Ok(vec![true; rows]),
        }
    }

    /// Hands on the trials that answer with the frames that do. Trials whose frames are not kept have no answer to a
    /// question about signals.
    ///
    /// # Errors
    /// Tables that cannot be read; what `take` says.
    pub fn frames(
        &self,
        mut take: impl FnMut(&TrialEntry, &[FrameSpan]) -> Result<(), Error>,
    ) -> Result<Looked, Error> {
        let mut trials = Vec::new();
        let looked = self.trials(u64::MAX, |trial| {
            trials.push(trial);
            Ok(())
        })?;
        let labels = self.labels_of(&trials)?;
        let signals = self.signals();
        let mut answered = 0;
        if signals.is_empty() {
            for trial in &trials {
                let frames = usize::try_from(trial.frames).unwrap_or(0).min(MOST_FRAMES);
                let spans = self.spans(trial, frames, &labels, &BTreeMap::new());
                if !spans.is_empty() {
                    answered += 1;
                    take(trial, &spans)?;
                }
            }
            return Ok(Looked { trials: answered, ..looked });
        }
        let place = |trial: &TrialEntry| trial.place.as_ref().map(|p| (p.file.clone(), p.group));
        let mut placed: Vec<&TrialEntry> = trials.iter().filter(|t| t.place.is_some()).collect();
        let row = |trial: &TrialEntry| trial.place.as_ref().map_or(0, |place| place.first_row);
        placed.sort_by_key(|trial| (place(trial), row(trial)));
        let mut opened: Option<(String, TableReader)> = None;
        for together in placed.chunk_by(|a, b| place(a) == place(b)) {
            let Some((file, group)) = place(together[0]) else { continue };
            if opened.as_ref().is_none_or(|(name, _)| *name != file) {
                opened = Some((file.clone(), self.store.table(&file)?));
            }
            let Some((_, table)) = &opened else { continue };
            let group = usize::try_from(group).unwrap_or(usize::MAX);
            let may = self.question.holds(&mut |test| match &test.field {
                QueryField::Frame(name) => may_hold(&test.test, &table.span(group, name)),
                _ => true,
            });
            if !may {
                continue;
            }
            let in_order = |trial: &&TrialEntry| {
                let first = usize::try_from(row(trial)).unwrap_or(usize::MAX);
                let frames = usize::try_from(trial.frames).unwrap_or(0).min(MOST_FRAMES);
                first..first.saturating_add(frames)
            };
            let rows: Vec<Range<usize>> = together.iter().map(in_order).collect();
            let mut columns = BTreeMap::new();
            for name in &signals {
                let column = table.column(group, name, Some(&rows));
                let column = column.map_err(|error| error.in_file(&self.store.path(&file)))?;
                columns.insert(name.as_str(), column);
            }
            let mut from = 0;
            for (trial, rows) in together.iter().zip(&rows) {
                let own: BTreeMap<&str, Vec<f64>> = columns
                    .iter()
                    .map(|(name, column)| {
                        let values = (from..from + rows.len()).map(|row| column.real(row));
                        (*name, values.map(Option::unwrap_or_default).collect())
                    })
                    .collect();
                from += rows.len();
                let spans = self.spans(trial, rows.len(), &labels, &own);
                if !spans.is_empty() {
                    answered += 1;
                    take(trial, &spans)?;
                }
            }
        }
        Ok(Looked { trials: answered, ..looked })
    }

    /// The signals that are asked for.
    fn signals(&self) -> Vec<String> {
        let tests = self.question.tests();
        let named = tests.iter().filter_map(|test| match &test.field {
            QueryField::Frame(name) => Some(name.clone()),
            _ => None,
        });
        named.collect::<BTreeSet<String>>().into_iter().collect()
    }

    fn labels_of(&self, trials: &[TrialEntry]) -> Result<ByTrial, Error> {
        let mut found = ByTrial::new();
        if self.labelled.is_empty() {
            return Ok(found);
        }
        let asked: HashSet<&str> = trials.iter().map(|trial| trial.trial.as_str()).collect();
        let partitions: HashSet<(&str, &str)> =
            trials.iter().map(|trial| (trial.set.as_str(), trial.action.as_str())).collect();
        for note in self.store.files(LABELS) {
            if !partitions.contains(&(note.set.as_str(), note.action.as_str())) {
                continue;
            }
            for label in self.store.labels_in(note)? {
                if label.value == 1.0 && asked.contains(label.trial.as_str()) {
                    let first = usize::try_from(label.first_frame).unwrap_or(0);
                    let end =
                        usize::try_from(label.last_frame).map_or(0, |last| last.saturating_add(1));
                    found.entry(label.trial).or_default().push((label.label, first..end));
                }
            }
        }
        Ok(found)
    }

    /// The frames of a trial that answer.
    fn spans(
        &self,
        trial: &TrialEntry,
        frames: usize,
        labels: &ByTrial,
        signals: &BTreeMap<&str, Vec<f64>>,
    ) -> Vec<FrameSpan> {
        let own = labels.get(&trial.trial).map(Vec::as_slice).unwrap_or_default();
        let mask = self.frame_mask(self.question, trial, frames, own, signals);
        let span = |run: Range<usize>| FrameSpan {
            first_frame: run.start as i64,
            last_frame: run.end as i64 - 1,
        };
        runs(&mask).into_iter().map(span).collect()
    }

    fn frame_mask(
        &self,
        question: &Question,
        trial: &TrialEntry,
        frames: usize,
        labels: &[(String, Range<usize>)],
        signals: &BTreeMap<&str, Vec<f64>>,
    ) -> Vec<bool> {
        let mask = |one: &Question| self.frame_mask(one, trial, frames, labels, signals);
        match question {
            Question::All(of) => of.iter().map(mask).fold(vec![true; frames], |mut all, one| {
                all.iter_mut().zip(one).for_each(|(all, one)| *all &= one);
                all
            }),
            Question::Any(of) => of.iter().map(mask).fold(vec![false; frames], |mut any, one| {
                any.iter_mut().zip(one).for_each(|(any, one)| *any |= one);
                any
            }),
            Question::One(FieldTest { field: QueryField::Frame(name), test, .. }) => {
                let values = signals.get(name.as_str()).map(Vec::as_slice).unwrap_or_default();
                values.iter().map(|value| test.of_number(Some(*value))).collect()
            }
            Question::One(FieldTest { field: QueryField::Label, test, nowhere }) => {
                let mut is = vec![false; frames];
                for (_, range) in labels.iter().filter(|(name, _)| test.of_text(Some(name))) {
                    let end = range.end.min(frames);
                    let range = range.start.min(end)..end;
                    is[range].fill(true);
                }
                is.iter().map(|is| is != nowhere).collect()
            }
            Question::One(test) => vec![self.of_trial(test, trial); frames],
        }
    }

    /// True if a test holds of a trial as a whole.
    fn of_trial(&self, test: &FieldTest, trial: &TrialEntry) -> bool {
        match &test.field {
            QueryField::Set => test.test.of_text(Some(&trial.set)),
            QueryField::Action => test.test.of_text(Some(&trial.action)),
            QueryField::Subject(..) => {
                let is = |of: &&SubjectEntry| Some(&of.subject.id) == trial.subject.as_ref();
                of_subject(test, self.subjects.iter().find(is))
            }
            QueryField::Trial(name, kind) => of_row(trial, name, *kind, &test.test),
            QueryField::Label | QueryField::Frame(_) => true,
        }
    }
}

fn of_row(trial: &TrialEntry, name: &str, kind: ColumnKind, test: &Test) -> bool {
    let mut columns: Vec<Column> =
        trial_columns().iter().map(|(_, kind)| Column::empty(*kind)).collect();
    super::tables::push_trial(&mut columns, trial);
    let index = trial_columns().iter().position(|(known, _)| known == name);
    let column = index.and_then(|index| columns.get(index));
    column.is_some_and(|column| column_mask(column, kind, test) == [true])
}

fn column_mask(column: &Column, kind: ColumnKind, test: &Test) -> Vec<bool> {
    let rows = 0..column.len();
    match kind {
        ColumnKind::Text => rows.map(|row| test.of_text(column.text(row))).collect(),
        ColumnKind::Flag => rows.map(|row| test.of_flag(column.flag(row))).collect(),
        _ => rows.map(|row| test.of_number(column.real(row))).collect(),
    }
}

/// True if a test holds of a person; nobody has nothing.
fn of_subject(test: &FieldTest, of: Option<&SubjectEntry>) -> bool {
    let QueryField::Subject(name, kind) = &test.field else { return false };
    let told = |text: &str| (!text.is_empty()).then(|| text.to_owned());
    if *kind == ColumnKind::Text {
        let text = of.and_then(|of| match name.as_str() {
            "gender" => told(&of.subject.gender),
            "remarks" => told(&of.subject.remarks),
            "consent" => Some(of.consent.word().to_owned()),
            _ => None,
        });
        return test.test.of_text(text.as_deref());
    }
    let measure = Measure::ALL.into_iter().find(|measure| measure_name(*measure) == *name);
    test.test.of_number(measure.and_then(|measure| of?.measure(measure)))
}

/// True if a value between these may pass a test.
fn may_hold(test: &Test, span: &Span) -> bool {
    match (test, span) {
        (Test::Missing(true), _) | (_, Span::Unknown) => true,
        (_, Span::Nothing) => false,
        (Test::Compare(how, Literal::Text(text)), Span::Text(least, most)) => {
            may_compare(*how, text.as_bytes(), least.as_slice(), most.as_slice())
        }
        (Test::Compare(how, Literal::Number(value)), Span::Real(least, most)) => {
            may_compare(*how, value, least, most)
        }
        (Test::Compare(how, Literal::Flag(value)), Span::Flag(least, most)) => {
            may_compare(*how, value, least, most)
        }
        (Test::OneOf(values, true), _) => values
            .iter()
            .any(|value| may_hold(&Test::Compare(Comparison::Equal, value.clone()), span)),
        _ => true,
    }
}

fn may_compare<T: PartialOrd + ?Sized>(how: Comparison, value: &T, least: &T, most: &T) -> bool {
    match how {
        Comparison::Equal => least <= value && value <= most,
        // What is least and greatest may be rounded: even if both are the value, others may be there.
        Comparison::Unequal => true,
        Comparison::Less => least < value,
        Comparison::LessOrEqual => least <= value,
        Comparison::Greater => most > value,
        Comparison::GreaterOrEqual => most >= value,
    }
}

/// Where a mask is true.
fn runs(mask: &[bool]) -> Vec<Range<usize>> {
    let (mut found, mut at) = (Vec::new(), 0);
    for run in mask.chunk_by(|a, b| a == b) {
        if run[0] {
            found.push(at..at + run.len());
        }
        at += run.len();
    }
    found
}

/// The first `most` rows of these.
fn first_of(rows: Vec<Range<usize>>, most: usize) -> Vec<Range<usize>> {
    let mut left = most;
    let mut found = Vec::new();
    for range in rows {
        let end = range.end.min(range.start.saturating_add(left));
        left -= end - range.start;
        if range.start < end {
            found.push(range.start..end);
        }
    }
    found
}
