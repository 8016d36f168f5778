//! What is said of trials that are added: on the command line for all, in a table for each.

use crate::body::anthropometry::{Measure, Subject, check_id};
use crate::corpus::rows::{Consent, PARAMETERS, SubjectEntry};
use crate::corpus::store::check_name;
use crate::corpus::tables::measure_name;
use crate::error::{Error, ErrorKind, counted};
use crate::job::labels::read_text;
use crate::table::{Row, rows};
use crate::toml_text::{from_toml, plain_words};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Longest name of a trial, a session or a licence, bytes: as long as a file may be called.
const LONGEST_NAME: usize = 255;
/// Longest remark, bytes.
const LONGEST_REMARK: usize = 4096;
/// Longest list of the trials that one is put together from, bytes.
const LONGEST_LIST: usize = 64 * 1024;
/// So much of a text that is too long is shown, letters.
const MOST_SHOWN: usize = 40;

/// What is said of a trial; nothing of what nobody said.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AboutTrial {
    /// What it is called.
    pub name: Option<String>,
    /// The set it belongs to.
    pub set: Option<String>,
    /// What is done in it.
    pub action: Option<String>,
    /// Id of who did it.
    pub subject: Option<String>,
    /// The session in which it was recorded.
    pub session: Option<String>,
    /// Its licence.
    pub licence: Option<String>,
    /// Who made it, where it was published.
    pub provenance: Option<String>,
    /// Keep or retake.
    pub verdict: Option<String>,
    /// Good repetitions in it.
    pub repetitions: Option<i64>,
    /// The edit list by which it was cleaned.
    pub edits: Option<PathBuf>,
    /// Trials that it is put together from, with a blank between them.
    pub part_of: Option<String>,
    /// Its parameters.
    pub parameters: BTreeMap<String, f64>,
}

impl AboutTrial {
    /// With what `other` says where this says nothing.
    #[must_use]
    pub fn or(mut self, other: &Self) -> Self {
        let words = [
            (&mut self.name, &other.name),
            (&mut self.set, &other.set),
            (&mut self.action, &other.action),
            (&mut self.subject, &other.subject),
            (&mut self.session, &other.session),
            (&mut self.licence, &other.licence),
            (&mut self.provenance, &other.provenance),
            (&mut self.verdict, &other.verdict),
            (&mut self.part_of, &other.part_of),
        ];
        for (own, others) in words {
            if own.is_none() {
                own.clone_from(others);
            }
        }
        self.repetitions = self.repetitions.or(other.repetitions);
        self.edits = self.edits.or_else(|| other.edits.clone());
        for (name, value) in &other.parameters {
            self.parameters.entry(name.clone()).or_insert(*value);
        }
        self
    }

    /// Takes a value by the name of its column.
    fn take(&mut self, column: &str, cell: &str, folder: &Path) -> Result<(), Error> {
        let text = || Some(cell.to_owned());
        match column {
            "name" => self.name = text(),
            "set" => self.set = text(),
            "action" => self.action = text(),
            "subject" => self.subject = text(),
            "session" => self.session = text(),
            "licence" => self.licence = text(),
            "provenance" => self.provenance = text(),
            "verdict" => self.verdict = text(),
            "part_of" => self.part_of = text(),
            "edits" => self.edits = Some(folder.join(cell)),
            "repetitions" => {
                let count = cell.parse().ok().filter(|count| *count >= 0);
                self.repetitions = Some(count.ok_or_else(|| {
                    Error::of(ErrorKind::Malformed, "not a number of repetitions").got(cell)
                })?);
            }
            parameter => {
                self.parameters.insert(parameter.to_owned(), number(parameter, cell)?);
            }
        }
        Ok(())
    }

    /// Fails if something is said at a length that nobody reads.
    ///
    /// # Errors
    /// As said.
    pub(super) fn check_lengths(&self) -> Result<(), Error> {
        for (column, text, longest) in [
            ("name", &self.name, LONGEST_NAME),
            ("session", &self.session, LONGEST_NAME),
            ("licence", &self.licence, LONGEST_NAME),
            ("provenance", &self.provenance, LONGEST_REMARK),
            ("part_of", &self.part_of, LONGEST_LIST),
        ] {
            text.iter().try_for_each(|text| check_length(column, text, longest))?;
        }
        Ok(())
    }

    /// Fails if it says something that cannot be.
    ///
    /// # Errors
    /// As said.
    pub fn check(&self) -> Result<(), Error> {
        self.check_lengths()?;
        for (what, name) in [("a set", &self.set), ("an action", &self.action)] {
            name.iter().try_for_each(|name| check_name(what, name))?;
        }
        self.subject.iter().try_for_each(|id| check_id(id))?;
        if let Some(verdict) =
            self.verdict.as_ref().filter(|v| !["keep", "retake"].contains(&v.as_str()))
        {
            return Err(Error::of(ErrorKind::Unknown, "no such verdict").none_of(
                verdict,
                ["keep", "retake"],
                "take one of these",
            ));
        }
        let known = |name: &&String| PARAMETERS.contains(&name.as_str());
        match self.parameters.keys().find(|name| !known(name)) {
            None => Ok(()),
            Some(name) => Err(no_parameter(name)),
        }
    }
}

/// Fails if the text of a column is too long.
fn check_length(column: &str, text: &str, longest: usize) -> Result<(), Error> {
    if text.len() <= longest {
        return Ok(());
    }
    let begins: String = text.chars().take(MOST_SHOWN).collect();
    Err(Error::of(ErrorKind::OutsideLimits, "what is said of a trial is too long")
        .at(column)
        .got(format!("{}: {begins}...", counted(text.len(), "byte")))
        .allowed(format!("at most {}", counted(longest, "byte")))
        .remedy("say it in fewer letters"))
}

fn number(name: &str, cell: &str) -> Result<f64, Error> {
    let value = cell.parse().ok().filter(|value: &f64| value.is_finite());
    value.ok_or_else(|| {
        Error::of(ErrorKind::Malformed, "not a number")
            .at(name)
            .got(cell)
            .allowed("a number, in SI")
    })
}

fn no_parameter(name: &str) -> Error {
    Error::of(ErrorKind::Unknown, "there is no such parameter").none_of(
        name,
        PARAMETERS,
        "take one of these",
    )
}

/// Reads `NAME=VALUE` of a parameter.
///
/// # Errors
/// Another form, a parameter there is not, no number.
pub fn parameter(text: &str) -> Result<(String, f64), Error> {
    let form =
        || Error::of(ErrorKind::Malformed, "not a parameter").got(text).allowed("NAME=VALUE");
    let (name, value) = text.split_once('=').ok_or_else(form)?;
    if PARAMETERS.contains(&name) {
        Ok((name.to_owned(), number(name, value)?))
    } else {
        Err(no_parameter(name))
    }
}

/// A table of trials: which file, and what is said of it.
#[derive(Clone, Debug, Default)]
pub struct TrialTable {
    /// By file, as the table names it from its own folder on, in its order.
    pub trials: Vec<(PathBuf, AboutTrial)>,
    /// People it tells of.
    pub subjects: Vec<SubjectEntry>,
    /// Which row tells of a file, by where it really is.
    by_place: BTreeMap<PathBuf, usize>,
}

const TRIAL_COLUMNS: [&str; 12] = [
    "file",
    "name",
    "set",
    "action",
    "subject",
    "session",
    "licence",
    "provenance",
    "verdict",
    "repetitions",
    "edits",
    "part_of",
];
const SUBJECT_COLUMNS: [&str; 3] = ["gender", "consent", "remarks"];

impl TrialTable {
    /// Reads one.
    ///
    /// # Errors
    /// A file that cannot be read, columns there are not, cells that say nothing, two things said of one person.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let text = read_text(path, "the table of trials")?;
        let folder = path.parent().unwrap_or(Path::new("."));
        Self::parse(&text, folder).map_err(|error| error.in_file(path))
    }

    fn parse(text: &str, folder: &Path) -> Result<Self, Error> {
        let mut rows = rows(text);
        let titles = rows
            .next()
            .ok_or_else(|| Error::of(ErrorKind::Malformed, "the table of trials is empty"))??;
        let measures = Measure::ALL.map(measure_name);
        let known: Vec<&str> = TRIAL_COLUMNS
            .into_iter()
            .chain(PARAMETERS)
            .chain(SUBJECT_COLUMNS)
            .chain(measures.iter().map(String::as_str))
            .collect();
        if let Some(strange) = titles.cells().find(|title| !known.contains(title)) {
            return Err(Error::of(ErrorKind::Unknown, "the table of trials has no such column")
                .at("line 1")
                .none_of(strange, known, "take one of these"));
        }
        if !titles.cells().any(|title| title == "file") {
            return Err(Error::of(
                ErrorKind::Malformed,
                "the table of trials does not name its files",
            )
            .at("line 1")
            .allowed(known.join(", ")));
        }
        let mut table = Self::default();
        for row in rows {
            let row = row?;
            table.take(&titles, &row, folder).map_err(|error| {
                let place = match &error.place {
                    Some(place) => format!("line {}, {place}", row.line),
                    None => format!("line {}", row.line),
                };
                error.at(place)
            })?;
        }
        Ok(table)
    }

    fn take(&mut self, titles: &Row, row: &Row, folder: &Path) -> Result<(), Error> {
        if row.width() != titles.width() {
            return Err(Error::of(
                ErrorKind::Malformed,
                "a row has other cells than there are titles",
            )
            .got(row.width().to_string())
            .allowed(titles.width().to_string()));
        }
        let mut about = AboutTrial::default();
        let mut file = None;
        let mut person = SubjectEntry::default();
        let cells = titles.cells().zip(row.cells()).filter(|(_, cell)| !cell.is_empty());
        for (title, cell) in cells {
            let measure = Measure::ALL.into_iter().find(|measure| measure_name(*measure) == title);
            match (title, measure) {
                ("file", _) => file = Some(folder.join(cell)),
                ("gender", _) => {
                    check_length(title, cell, LONGEST_NAME)?;
                    cell.clone_into(&mut person.subject.gender);
                }
                ("remarks", _) => {
                    check_length(title, cell, LONGEST_REMARK)?;
                    cell.clone_into(&mut person.subject.remarks);
                }
                ("consent", _) => person.consent = consent(cell)?,
                (_, Some(measure)) => {
                    person.subject.measures.insert(measure, measure.read(cell)?);
                }
                _ => about.take(title, cell, folder)?,
            }
        }
        about.check()?;
        let file =
            file.ok_or_else(|| Error::of(ErrorKind::Malformed, "a row does not name its file"))?;
        if person != SubjectEntry::default() {
            let id = about.subject.clone().ok_or_else(|| {
                Error::of(ErrorKind::Malformed, "a row tells of a person and does not say of whom")
                    .remedy("fill in the column subject")
            })?;
            person.subject.id = id;
            self.person(person)?;
        }
        self.by_place.entry(place(&file)).or_insert(self.trials.len());
        self.trials.push((file, about));
        Ok(())
    }

    fn person(&mut self, person: SubjectEntry) -> Result<(), Error> {
        match self.subjects.iter_mut().find(|known| known.subject.id == person.subject.id) {
            None => self.subjects.push(person),
            Some(known) => *known = merged(known, &person)?,
        }
        Ok(())
    }

    /// What it says of a file.
    #[must_use]
    pub fn about(&self, path: &Path) -> Option<&AboutTrial> {
        self.by_place.get(&place(path)).map(|row| &self.trials[*row].1)
    }
}

/// Where a file really is; of one that is not there, where it was said to be.
fn place(file: &Path) -> PathBuf {
    file.canonicalize().unwrap_or_else(|_| file.to_owned())
}

/// What both say of a person.
///
/// # Errors
/// Two things said of one measure, or of the gender.
pub fn merged(known: &SubjectEntry, more: &SubjectEntry) -> Result<SubjectEntry, Error> {
    let unlike = |what: &str, one: String, other: String| {
        Error::of(ErrorKind::Malformed, "two things are said of one person")
            .at(format!("subject {}, {what}", known.subject.id))
            .got(format!("{one} and {other}"))
            .remedy("mend one of them; a person who was measured again is another id")
    };
    let mut both = known.clone();
    for (measure, value) in &more.subject.measures {
        let old = both.subject.measures.insert(*measure, *value);
        if let Some(old) = old.filter(|old| old != value) {
            return Err(unlike(measure.words(), old.to_string(), value.to_string()));
        }
    }
    for (what, own, other) in [
        ("gender", &mut both.subject.gender, &more.subject.gender),
        ("remarks", &mut both.subject.remarks, &more.subject.remarks),
    ] {
        if own.is_empty() {
            own.clone_from(other);
        } else if !other.is_empty() && own != other && what == "gender" {
            return Err(unlike(what, own.clone(), other.clone()));
        }
    }
    // The newest word of consent counts: it may be given, and taken back.
    if more.consent != Consent::Unknown {
        both.consent = more.consent;
    }
    Ok(both)
}

/// A word of consent.
///
/// # Errors
/// Another word.
pub fn consent(word: &str) -> Result<Consent, Error> {
    let words = Consent::ALL.map(Consent::word);
    Consent::of(word).ok_or_else(|| {
        Error::of(ErrorKind::Unknown, "no such word of consent").none_of(
            word,
            words,
            "take one of these",
        )
    })
}

/// Reads a person's file, as a recording session has it.
///
/// # Errors
/// A file that cannot be read, or says of no person.
pub fn subject_file(path: &Path) -> Result<Subject, Error> {
    let subject: Subject = from_toml(&read_text(path, "a subject")?).map_err(|cause| {
        Error::of(ErrorKind::Malformed, "not the file of a subject")
            .at(path.display().to_string())
            .got(plain_words(cause.message()))
            .remedy("write id = \"s01\", and under [measures] age_years, stature_m, mass_kg, ...")
    })?;
    subject.check().map_err(|error| error.in_file(path))?;
    Ok(subject)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(text: &str) -> Result<TrialTable, Error> {
        TrialTable::parse(text, Path::new("folder"))
    }

    #[test]
    fn a_table_says_of_each_file_what_it_is_and_of_each_person_once() {
        let table = parsed(
            "file,action,subject,age_years,stature_m,speed_m_s,consent\n\
             a.bvh,kick,s01,11,1.42,2.5,given\nb.bvh,walk,s01,,,,\nc.bvh,walk,,,,,\n",
        )
        .expect("a table");
        assert_eq!(table.trials.len(), 3);
        assert_eq!(table.trials[0].0, Path::new("folder/a.bvh"));
        assert_eq!(table.trials[0].1.parameters["speed_m_s"], 2.5);
        assert_eq!(table.subjects.len(), 1);
        assert_eq!(table.subjects[0].measure(Measure::Age), Some(11.0));
        assert_eq!(table.subjects[0].consent, Consent::Given);
    }

    #[test]
    fn what_a_table_cannot_say_is_refused_by_its_line() {
        for (text, said) in [
            ("file,acton\n", "action"),
            ("action\nkick\n", "does not name"),
            ("file,subject,age_years\na,s01,11\na,s01,12\n", "line 3"),
            ("file,age_years\na,11\n", "column subject"),
            ("file,speed_m_s\na,fast\n", "line 2, speed_m_s"),
            ("file,subject\na,Jane Doe\n", "a-z"),
            ("file,verdict\na,good\n", "keep, retake"),
            ("file,consent,subject\na,yes,s01\n", "given"),
            ("file,repetitions\na,-1\n", "repetitions"),
        ] {
            let error = parsed(text).expect_err(text).to_string();
            assert!(error.contains(said), "{text}: {error}");
        }
    }
}
