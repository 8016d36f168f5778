//! The language in which a corpus is asked: `action=kick and subject.age<12 and subject.stature_m>1.4`.
//!
//! ```text
//! question   = and-list { "or" and-list }
//! and-list   = not { "and" not }
//! not        = [ "not" ] ( "(" question ")" | test )
//! test       = field ( "=" | "!=" | "<" | "<=" | ">" | ">=" ) value     compares
//!            | field [ "not" ] "in" "(" value { "," value } ")"         is one of these
//!            | field [ "not" ] "like" value                             * stands for anything
//!            | field "is" [ "not" ] "missing"                           nobody said
//!            | field                                                    of yes and no: yes
//! ```
//!
//! Values are numbers, `true`, `false`, or words; words with blanks or signs stand in quotes. As in SQL what is
//! missing is neither equal nor unequal to anything, and neither `not`.

use super::rows::{Consent, TrialKind};
use super::tables::{signal_names, subject_columns, trial_columns};
use crate::columnar::ColumnKind;
use crate::error::{Error, ErrorKind, counted};
use crate::toml_text::advice;

/// Most bytes of a question.
const MAX_BYTES: usize = 16 << 10;
/// Most brackets in brackets.
const MAX_DEPTH: usize = 64;

/// What is asked: tests put together. There is no `not`: it has gone into the tests.
#[derive(Clone, Debug, PartialEq)]
pub enum Question {
    /// All of these hold; always true without any.
    All(Vec<Question>),
    /// One of these holds.
    Any(Vec<Question>),
    /// This holds.
    One(FieldTest),
}

/// A test of one field.
#[derive(Clone, Debug, PartialEq)]
pub struct FieldTest {
    /// Which field.
    pub field: QueryField,
    /// What must be true of it.
    pub test: Test,
    /// Of labels: true if it must hold nowhere.
    pub nowhere: bool,
}

/// A field one can ask for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum QueryField {
    /// The set of a trial.
    Set,
    /// Its action.
    Action,
    /// A column of the table of trials.
    Trial(String, ColumnKind),
    /// A column of the table of people.
    Subject(String, ColumnKind),
    /// What is done in frames of it.
    Label,
    /// A column of the table of frames.
    Frame(String),
}

/// What must be true of a value; never of one that is missing, but for [`Test::Missing`].
#[derive(Clone, Debug, PartialEq)]
pub enum Test {
    /// It compares so with this one.
    Compare(Comparison, Literal),
    /// It is one of these, or none of them if `false`.
    OneOf(Vec<Literal>, bool),
    /// It looks like this, or does not if `false`; `*` stands for anything.
    Like(String, bool),
    /// It is missing; it is there if `false`.
    Missing(bool),
}

/// How two values compare.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Comparison {
    Equal,
    Unequal,
    Less,
    LessOrEqual,
    Greater,
    GreaterOrEqual,
}

/// A value that is asked for.
#[derive(Clone, Debug, PartialEq)]
pub enum Literal {
    /// A word.
    Text(String),
    /// A number.
    Number(f64),
    /// Yes or no.
    Flag(bool),
}

impl Comparison {
    /// The opposite.
    #[must_use]
    pub const fn negated(self) -> Self {
        match self {
            Self::Equal => Self::Unequal,
            Self::Unequal => Self::Equal,
            Self::Less => Self::GreaterOrEqual,
            Self::LessOrEqual => Self::Greater,
            Self::Greater => Self::LessOrEqual,
            Self::GreaterOrEqual => Self::Less,
        }
    }

    /// True if values that compare so are meant.
    #[must_use]
    pub fn holds(self, order: std::cmp::Ordering) -> bool {
        match self {
            Self::Equal => order.is_eq(),
            Self::Unequal => order.is_ne(),
            Self::Less => order.is_lt(),
            Self::LessOrEqual => order.is_le(),
            Self::Greater => order.is_gt(),
            Self::GreaterOrEqual => order.is_ge(),
        }
    }
}

impl Test {
    fn negated(self) -> Self {
        match self {
            Self::Compare(how, value) => Self::Compare(how.negated(), value),
            Self::OneOf(values, is) => Self::OneOf(values, !is),
            Self::Like(pattern, is) => Self::Like(pattern, !is),
            Self::Missing(is) => Self::Missing(!is),
        }
    }

    /// True of this word.
    #[must_use]
    pub fn of_text(&self, value: Option<&str>) -> bool {
        let Some(value) = value else { return *self == Self::Missing(true) };
        let is = |literal: &Literal| matches!(literal, Literal::Text(text) if text == value);
        match self {
            Self::Compare(how, Literal::Text(other)) => {
                how.holds(value.as_bytes().cmp(other.as_bytes()))
            }
            Self::Compare(..) => false,
            Self::OneOf(values, wanted) => values.iter().any(is) == *wanted,
            Self::Like(pattern, wanted) => is_like(value, pattern) == *wanted,
            Self::Missing(wanted) => !wanted,
        }
    }

    /// True of this number.
    #[must_use]
    pub fn of_number(&self, value: Option<f64>) -> bool {
        let Some(value) = value else { return *self == Self::Missing(true) };
        match self {
            Self::Compare(how, Literal::Number(other)) => {
                value.partial_cmp(other).is_some_and(|order| how.holds(order))
            }
            Self::Compare(..) | Self::Like(..) => false,
            Self::OneOf(values, wanted) => values.contains(&Literal::Number(value)) == *wanted,
            Self::Missing(wanted) => !wanted,
        }
    }

    /// True of this yes or no.
    #[must_use]
    pub fn of_flag(&self, value: Option<bool>) -> bool {
        let Some(value) = value else { return *self == Self::Missing(true) };
        match self {
            Self::Compare(how, Literal::Flag(other)) => how.holds(value.cmp(other)),
            Self::Compare(..) | Self::Like(..) => false,
            Self::OneOf(values, wanted) => values.contains(&Literal::Flag(value)) == *wanted,
            Self::Missing(wanted) => !wanted,
        }
    }
}

/// True if a word looks like a pattern, in which `*` stands for anything.
fn is_like(value: &str, pattern: &str) -> bool {
    let mut parts = pattern.split('*');
    let first = parts.next().unwrap_or_default();
    let Some(mut rest) = value.strip_prefix(first) else { return false };
    let mut parts: Vec<&str> = parts.collect();
    let Some(last) = parts.pop() else { return rest.is_empty() };
    for part in parts {
        match rest.find(part) {
            Some(at) => rest = &rest[at + part.len()..],
            None => return false,
        }
    }
    rest.ends_with(last)
}

impl Question {
    /// Reads a question; an empty one is true of every trial.
    ///
    /// # Errors
    /// Where it cannot be understood, and what would have been.
    pub fn parse(text: &str) -> Result<Self, Error> {
        if text.len() > MAX_BYTES {
            return Err(Error::of(ErrorKind::OutsideLimits, "the question is too long")
                .got(counted(text.len(), "byte"))
                .allowed(format!("at most {MAX_BYTES} bytes")));
        }
        let tokens = tokens(text)?;
        if tokens.len() == 1 {
            return Ok(Self::All(Vec::new()));
        }
        let mut parser = Parser { tokens, at: 0 };
        let question = parser.any(false, 0)?;
        match parser.next() {
            Token { kind: TokenKind::End, .. } => Ok(question),
            other => Err(other.unlike("`and`, `or`, or the end")),
        }
    }

    /// All its tests.
    pub fn tests(&self) -> Vec<&FieldTest> {
        match self {
            Self::All(of) | Self::Any(of) => of.iter().flat_map(Self::tests).collect(),
            Self::One(test) => vec![test],
        }
    }

    /// True if it holds, given which of its tests do.
    pub fn holds(&self, test: &mut impl FnMut(&FieldTest) -> bool) -> bool {
        match self {
            Self::All(of) => of.iter().all(|one| one.holds(test)),
            Self::Any(of) => of.iter().any(|one| one.holds(test)),
            Self::One(of) => test(of),
        }
    }
}

#[derive(Clone, Debug, PartialEq)]
enum TokenKind {
    /// A name, a word or a number, as it stands there.
    Bare(String),
    /// What stood in quotes.
    Quoted(String),
    Sign(&'static str),
    End,
}

#[derive(Clone, Debug)]
struct Token {
    kind: TokenKind,
    /// The letter of the question where it begins, from 1.
    at: usize,
}

impl Token {
    fn shown(&self) -> String {
        match &self.kind {
            TokenKind::Bare(text) => format!("`{text}`"),
            TokenKind::Quoted(text) => format!("\"{text}\""),
            TokenKind::Sign(sign) => format!("`{sign}`"),
            TokenKind::End => "the end".to_owned(),
        }
    }

    fn wrong(&self, what: impl Into<String>) -> Error {
        Error::of(ErrorKind::Malformed, what).at(format!("letter {} of the question", self.at))
    }

    fn unlike(&self, allowed: &str) -> Error {
        self.wrong("the question cannot be understood").got(self.shown()).allowed(allowed)
    }

    /// True if it is this word of the language.
    fn is(&self, word: &str) -> bool {
        matches!(&self.kind, TokenKind::Bare(text) if text.eq_ignore_ascii_case(word))
    }

    fn is_sign(&self, sign: &str) -> bool {
        self.kind
            == TokenKind::Sign(match sign {
                "(" => "(",
                ")" => ")",
                _ => ",",
            })
    }
}

const SIGNS: [&str; 10] = ["<=", ">=", "!=", "==", "=", "<", ">", "(", ")", ","];

fn tokens(text: &str) -> Result<Vec<Token>, Error> {
    let (mut tokens, mut rest, mut at) = (Vec::new(), text, 1);
    loop {
        let trimmed = rest.trim_start();
        at += rest[..rest.len() - trimmed.len()].chars().count();
        rest = trimmed;
        let mut token = Token { kind: TokenKind::End, at };
        let Some(first) = rest.chars().next() else {
            tokens.push(token);
            return Ok(tokens);
        };
        let taken = if let Some(sign) = SIGNS.into_iter().find(|sign| rest.starts_with(sign)) {
            token.kind = TokenKind::Sign(if sign == "==" { "=" } else { sign });
            sign.len()
        } else if first == '"' || first == '\'' {
            let Some(end) = rest[1..].find(first) else {
                return Err(token
                    .wrong("a quote is not closed")
                    .got(rest.chars().take(40).collect::<String>()));
            };
            token.kind = TokenKind::Quoted(rest[1..=end].to_owned());
            end + 2
        } else {
            let ends = |c: char| c.is_whitespace() || "<>=!(),\"'".contains(c);
            let length = rest.find(ends).unwrap_or(rest.len());
            if length == 0 {
                return Err(token.wrong("a sign that means nothing here").got(first).allowed(
                    "names, values, = != < <= > >= ( ) , and the words and, or, not, in, like, is",
                ));
            }
            token.kind = TokenKind::Bare(rest[..length].to_owned());
            length
        };
        at += rest[..taken].chars().count();
        rest = &rest[taken..];
        tokens.push(token);
    }
}

struct Parser {
    tokens: Vec<Token>,
    at: usize,
}

const TESTS: &str = "=, !=, <, <=, >, >=, in, not in, like, not like, is missing or is not missing";

impl Parser {
    fn peek(&self) -> Token {
        // The last one is the end.
        self.tokens[self.at.min(self.tokens.len() - 1)].clone()
    }

    fn next(&mut self) -> Token {
        let token = self.peek();
        self.at += 1;
        token
    }

    fn any(&mut self, negated: bool, depth: usize) -> Result<Question, Error> {
        let mut of = vec![self.all(negated, depth)?];
        while self.peek().is("or") {
            self.next();
            of.push(self.all(negated, depth)?);
        }
        Ok(joined(of, !negated))
    }

    fn all(&mut self, negated: bool, depth: usize) -> Result<Question, Error> {
        let mut of = vec![self.not(negated, depth)?];
        while self.peek().is("and") {
            self.next();
            of.push(self.not(negated, depth)?);
        }
        Ok(joined(of, negated))
    }

    fn not(&mut self, mut negated: bool, depth: usize) -> Result<Question, Error> {
        while self.peek().is("not") {
            self.next();
            negated = !negated;
        }
        if !self.peek().is_sign("(") {
            return self.test(negated);
        }
        let open = self.next();
        if depth >= MAX_DEPTH {
            return Err(open
                .wrong("too many brackets in brackets")
                .allowed(format!("at most {MAX_DEPTH}")));
        }
        let question = self.any(negated, depth + 1)?;
        let close = self.next();
        if close.is_sign(")") { Ok(question) } else { Err(close.unlike("`and`, `or`, or `)`")) }
    }

    fn test(&mut self, negated: bool) -> Result<Question, Error> {
        let name = self.next();
        let field = field(&name)?;
        let sign = self.peek();
        let comparison = match &sign.kind {
            TokenKind::Sign("=") => Some(Comparison::Equal),
            TokenKind::Sign("!=") => Some(Comparison::Unequal),
            TokenKind::Sign("<") => Some(Comparison::Less),
            TokenKind::Sign("<=") => Some(Comparison::LessOrEqual),
            TokenKind::Sign(">") => Some(Comparison::Greater),
            TokenKind::Sign(">=") => Some(Comparison::GreaterOrEqual),
            _ => None,
        };
        let test = if let Some(how) = comparison {
            self.next();
            Test::Compare(how, self.value(&field)?)
        } else if sign.is("is") {
            self.next();
            let is = !self.takes("not");
            let missing = self.next();
            if !missing.is("missing") {
                return Err(missing.unlike("`missing` or `not missing`"));
            }
            Test::Missing(is)
        } else {
            let turned = self.followed_by_in_or_like() && self.takes("not");
            let word = self.peek();
            if word.is("in") {
                self.next();
                Test::OneOf(self.values(&field)?, !turned)
            } else if word.is("like") {
                self.next();
                let pattern = self.next();
                match (field.kind(), pattern.kind.clone()) {
                    (ColumnKind::Text, TokenKind::Bare(text) | TokenKind::Quoted(text)) => {
                        Test::Like(text, !turned)
                    }
                    (ColumnKind::Text, _) => {
                        return Err(pattern.unlike("a word in which * stands for anything"));
                    }
                    _ => return Err(word.unlike("a comparison: this field is no word")),
                }
            } else if field.kind() == ColumnKind::Flag {
                Test::Compare(Comparison::Equal, Literal::Flag(true))
            } else {
                return Err(word.unlike(TESTS));
            }
        };
        // That a label is nowhere is not that another is somewhere.
        let is_label = field == QueryField::Label;
        let test = if negated && !is_label { test.negated() } else { test };
        Ok(Question::One(FieldTest { field, test, nowhere: negated && is_label }))
    }

    fn takes(&mut self, word: &str) -> bool {
        let is = self.peek().is(word);
        self.at += usize::from(is);
        is
    }

    fn followed_by_in_or_like(&self) -> bool {
        let after = self.tokens.get(self.at + 1);
        after.is_some_and(|token| token.is("in") || token.is("like"))
    }

    fn values(&mut self, field: &QueryField) -> Result<Vec<Literal>, Error> {
        let open = self.next();
        if !open.is_sign("(") {
            return Err(open.unlike("`(` and values"));
        }
        let mut values = Vec::new();
        loop {
            values.push(self.value(field)?);
            let after = self.next();
            if after.is_sign(")") {
                return Ok(values);
            }
            if !after.is_sign(",") {
                return Err(after.unlike("`,` or `)`"));
            }
        }
    }

    fn value(&mut self, field: &QueryField) -> Result<Literal, Error> {
        let token = self.next();
        let (TokenKind::Bare(text) | TokenKind::Quoted(text)) = &token.kind else {
            return Err(token.unlike("a value"));
        };
        match field.kind() {
            ColumnKind::Text => {
                let known = field.words();
                if !known.is_empty() && !known.contains(&text.as_str()) {
                    return Err(token.unlike(&known.join(", ")).remedy(advice(
                        text,
                        &known,
                        "take one of these",
                    )));
                }
                Ok(Literal::Text(text.clone()))
            }
            ColumnKind::Flag => match text.as_str() {
                "true" | "yes" => Ok(Literal::Flag(true)),
                "false" | "no" => Ok(Literal::Flag(false)),
                _ => Err(token.unlike("true or false")),
            },
            _ => match text.parse::<f64>() {
                Ok(value) if value.is_finite() => Ok(Literal::Number(value)),
                _ => Err(token.unlike(&format!("a number{}", field.unit()))),
            },
        }
    }
}

fn joined(mut of: Vec<Question>, all: bool) -> Question {
    // A list of one is that one, whichever it is.
    match (of.len(), all) {
        (1, _) => of.swap_remove(0),
        (_, true) => Question::Any(of),
        (_, false) => Question::All(of),
    }
}

impl QueryField {
    /// What it holds.
    #[must_use]
    pub const fn kind(&self) -> ColumnKind {
        match self {
            Self::Set | Self::Action | Self::Label => ColumnKind::Text,
            Self::Trial(_, kind) | Self::Subject(_, kind) => *kind,
            Self::Frame(_) => ColumnKind::Single,
        }
    }

    /// The words that it may be, if they are few.
    fn words(&self) -> Vec<&'static str> {
        match self {
            Self::Trial(name, _) if name == "kind" => TrialKind::ALL.map(TrialKind::word).to_vec(),
            Self::Trial(name, _) if name == "verdict" => vec!["keep", "retake"],
            Self::Subject(name, _) if name == "consent" => Consent::ALL.map(Consent::word).to_vec(),
            _ => Vec::new(),
        }
    }

    fn unit(&self) -> &'static str {
        let (Self::Trial(name, _) | Self::Subject(name, _) | Self::Frame(name)) = self else {
            return "";
        };
        let units = [
            ("_m_s", " of m/s"),
            ("_rad", " of rad"),
            ("_kg", " of kg"),
            ("_hz", " of Hz"),
            ("_m", " of m"),
            ("_s", " of s"),
            ("_years", " of years"),
        ];
        units.iter().find(|(end, _)| name.ends_with(end)).map_or("", |(_, unit)| unit)
    }
}

/// Names of all fields, as they are asked for.
#[must_use]
pub fn field_names() -> Vec<String> {
    let of_trials = trial_columns().into_iter().map(|(name, _)| name);
    let of_subjects =
        subject_columns().into_iter().skip(1).map(|(name, _)| format!("subject.{name}"));
    let of_frames = signal_names().into_iter().map(|name| format!("frame.{name}"));
    let first = ["set", "action", "label", "subject.age"].map(str::to_owned);
    first
        .into_iter()
        .chain(of_trials)
        .chain(of_subjects)
        .chain(["frame.frame".to_owned(), "frame.time_s".to_owned()])
        .chain(of_frames)
        .collect()
}

fn field(token: &Token) -> Result<QueryField, Error> {
    let TokenKind::Bare(name) = &token.kind else {
        return Err(token.unlike("the name of a field, or `(`"));
    };
    let of = |columns: Vec<(String, ColumnKind)>, name: &str| {
        columns.into_iter().find(|(known, _)| known == name)
    };
    let found = match name.split_once('.') {
        None if name == "set" => Some(QueryField::Set),
        None if name == "action" => Some(QueryField::Action),
        None if name == "label" => Some(QueryField::Label),
        None => of(trial_columns(), name).map(|(name, kind)| QueryField::Trial(name, kind)),
        Some(("subject", name)) => {
            let name = if name == "age" { "age_years" } else { name };
            let found = of(subject_columns(), name).filter(|(name, _)| name != "subject");
            found.map(|(name, kind)| QueryField::Subject(name, kind))
        }
        Some(("frame", name)) => {
            let known =
                name == "time_s" || name == "frame" || signal_names().contains(&name.to_owned());
            known.then(|| QueryField::Frame(name.to_owned()))
        }
        Some(_) => None,
    };
    found.ok_or_else(|| {
        let names = field_names();
        let known: Vec<&str> = names.iter().map(String::as_str).collect();
        token
            .wrong("there is no such field")
            .got(format!("`{name}`"))
            .allowed(known.join(", "))
            .remedy(advice(name, &known, "take one of these"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn refused(text: &str) -> String {
        Question::parse(text).expect_err(text).to_string()
    }

    fn test(field: QueryField, test: Test) -> Question {
        Question::One(FieldTest { field, test, nowhere: false })
    }

    fn word(how: Comparison, text: &str) -> Test {
        Test::Compare(how, Literal::Text(text.to_owned()))
    }

    fn age(how: Comparison, years: f64) -> Question {
        let field = QueryField::Subject("age_years".to_owned(), ColumnKind::Real);
        test(field, Test::Compare(how, Literal::Number(years)))
    }

    #[test]
    fn questions_are_read_with_and_before_or() {
        let kick = || test(QueryField::Action, word(Comparison::Equal, "kick"));
        let young = age(Comparison::Less, 12.0);
        let of = |text| Question::parse(text).expect(text);
        assert_eq!(
            of("action=kick and subject.age<12"),
            Question::All(vec![kick(), young.clone()])
        );
        let set = test(QueryField::Set, word(Comparison::Unequal, "a b"));
        let all = Question::All(vec![kick(), young]);
        assert_eq!(
            of("set != 'a b' OR action=kick AND subject.age < 12"),
            Question::Any(vec![set, all])
        );
        assert_eq!(of("  "), Question::All(Vec::new()));
        assert_eq!(of("((action = \"kick\"))"), kick());
    }

    #[test]
    fn not_goes_into_the_tests() {
        let of = |text| Question::parse(text).expect(text);
        assert_eq!(of("not (action=a or subject.age<12)"), of("action!=a and subject.age>=12"));
        assert_eq!(of("not (action=a and not synthetic)"), of("action!=a or synthetic"));
        assert_eq!(of("not not session in (a, b)"), of("session in (a,b)"));
        assert_eq!(of("not session not like x*"), of("session like x*"));
        assert_eq!(of("not session is missing"), of("session is not missing"));
        let Question::One(label) = of("not label=wave") else { panic!("one test") };
        assert!(label.nowhere && label.test == word(Comparison::Equal, "wave"));
    }

    #[test]
    fn what_is_wrong_is_said_with_its_place_and_what_was_meant() {
        let said = refused("action=kick and subject.statue_m>1.4");
        assert!(said.contains("letter 17") && said.contains("subject.stature_m"), "{said}");
        assert!(refused("subject.age<old").contains("letter 13"), "{}", refused("subject.age<old"));
        assert!(refused("action=kick subject.age<3").contains("`and`, `or`, or the end"));
        assert!(refused("(action=kick").contains("`)`"));
        assert!(refused("action='kick").contains("not closed"));
        assert!(refused("kind=captured").contains("capture, session, generated"));
        assert!(refused("action ! kick").contains("letter 8"));
        assert!(refused("action").contains("like"));
        assert!(refused("frames like 3*").contains("no word"));
        assert!(refused("action in kick").contains("`(`"));
        assert!(refused("and").contains("no such field"));
        assert!(refused("subject.age<nan").contains("a number of years"));
        assert!(refused(&"(".repeat(1000)).contains("brackets"));
        assert!(refused(&"not ".repeat(10_000)).contains("too long"));
    }

    #[test]
    fn a_star_stands_for_anything() {
        for (value, pattern, expected) in [
            ("kick-left", "kick*", true),
            ("kick-left", "*left", true),
            ("kick-left", "k*l*t", true),
            ("kick-left", "kick", false),
            ("kick", "kick", true),
            ("aba", "ab*ba", false),
            ("", "*", true),
            ("abab", "*ab", true),
        ] {
            assert_eq!(is_like(value, pattern), expected, "{value} {pattern}");
        }
    }

    proptest! {
        #[test]
        fn any_text_is_understood_or_refused(text in "[a-z<>=!().,'\" *é]{0,60}") {
            let _ = Question::parse(&text);
        }
    }
}
