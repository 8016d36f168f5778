//! Parameters of a C3D file: named arrays in named groups, kept byte for byte.
//!
//! A reader of one kind of file cannot know what every laboratory stores there. So all of it is kept as it
//! stands, with numbers in Intel byte order, and what this project needs is looked up by name. The
//! structure is that of "The C3D File Format: User Guide" (Motion Lab Systems, 2008), chapter "The
//! parameter section".

use crate::error::counted;
use std::borrow::Cow;
use std::collections::BTreeMap;

/// Most entries that one parameter can have along an axis, and most bytes of a text.
pub const MAX_LENGTH: usize = 255;

/// What the bytes of a parameter are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParameterKind {
    /// Characters; the first dimension is the length of each text.
    Char,
    /// Bytes, unsigned.
    Byte,
    /// Integers of 16 bits. Whether they are signed only the name tells.
    Int,
    /// Real numbers of 32 bits.
    Float,
}

impl ParameterKind {
    /// Of the number that the file has for it.
    #[must_use]
    pub const fn of_code(code: i8) -> Option<Self> {
        match code {
            -1 => Some(Self::Char),
            1 => Some(Self::Byte),
            2 => Some(Self::Int),
            4 => Some(Self::Float),
            _ => None,
        }
    }

    /// The number that the file has for it.
    #[must_use]
    pub const fn code(self) -> i8 {
        match self {
            Self::Char => -1,
            Self::Byte => 1,
            Self::Int => 2,
            Self::Float => 4,
        }
    }

    /// Bytes of an element.
    #[must_use]
    pub const fn size(self) -> usize {
        match self {
            Self::Char | Self::Byte => 1,
            Self::Int => 2,
            Self::Float => 4,
        }
    }
}

/// One array.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Parameter {
    /// Name as it stands in the file.
    pub name: Vec<u8>,
    /// True if programs are asked not to let a person change it.
    pub locked: bool,
    /// What its elements are.
    pub kind: ParameterKind,
    /// Lengths of its axes, the first runs fastest; empty of a scalar.
    pub dimensions: Vec<u8>,
    /// The elements, Intel byte order. As many as the dimensions say.
    pub data: Vec<u8>,
    /// What it is for, in somebody's words.
    pub description: Vec<u8>,
}

impl Parameter {
    fn new(name: &str, kind: ParameterKind, dimensions: &[usize], data: Vec<u8>) -> Self {
        let dimensions = dimensions.iter().map(|&n| u8::try_from(n).unwrap_or(u8::MAX)).collect();
        let name = name.as_bytes().to_vec();
        Self { name, locked: false, kind, dimensions, data, description: Vec::new() }
    }

    /// One integer.
    #[must_use]
    pub fn int(name: &str, value: u16) -> Self {
        Self::new(name, ParameterKind::Int, &[], value.to_le_bytes().to_vec())
    }

    /// Integers along these axes, at most [`MAX_LENGTH`] on each.
    #[must_use]
    pub fn ints(name: &str, dimensions: &[usize], values: &[u16]) -> Self {
        let data = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        Self::new(name, ParameterKind::Int, dimensions, data)
    }

    /// One real number.
    #[must_use]
    pub fn float(name: &str, value: f32) -> Self {
        Self::new(name, ParameterKind::Float, &[], value.to_le_bytes().to_vec())
    }

    /// Real numbers along these axes, at most [`MAX_LENGTH`] on each.
    #[must_use]
    pub fn floats(name: &str, dimensions: &[usize], values: &[f32]) -> Self {
        let data = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        Self::new(name, ParameterKind::Float, dimensions, data)
    }

    /// One text, of at most [`MAX_LENGTH`] bytes.
    #[must_use]
    pub fn text(name: &str, text: &str) -> Self {
        let data: Vec<u8> = text.bytes().take(MAX_LENGTH).collect();
        Self::new(name, ParameterKind::Char, &[data.len()], data)
    }

    /// At most [`MAX_LENGTH`] texts, each as long as the longest.
    #[must_use]
    pub fn texts_of(name: &str, texts: &[String]) -> Self {
        let longest = texts.iter().map(String::len).max().unwrap_or(0).clamp(1, MAX_LENGTH);
        let mut data = Vec::with_capacity(longest * texts.len());
        for text in texts {
            let filled = text.bytes().chain(std::iter::repeat(b' '));
            data.extend(filled.take(longest));
        }
        Self::new(name, ParameterKind::Char, &[longest, texts.len()], data)
    }

    /// How many elements its dimensions make.
    #[must_use]
    pub fn count(&self) -> usize {
        self.dimensions.iter().map(|&length| usize::from(length)).product()
    }

    /// Its elements as numbers, integers as signed; none of characters.
    #[must_use]
    pub fn numbers(&self) -> Vec<f64> {
        match self.kind {
            ParameterKind::Char => Vec::new(),
            ParameterKind::Byte => self.data.iter().map(|&byte| f64::from(byte)).collect(),
            ParameterKind::Int => {
                let words = self.data.as_chunks::<2>().0;
                words.iter().map(|&word| f64::from(i16::from_le_bytes(word))).collect()
            }
            ParameterKind::Float => {
                let words = self.data.as_chunks::<4>().0;
                words.iter().map(|&word| f64::from(f32::from_le_bytes(word))).collect()
            }
        }
    }

    /// Its first element as a number.
    #[must_use]
    pub fn number(&self) -> Option<f64> {
        self.numbers().first().copied()
    }

    /// Its elements as counts: integers as unsigned, since a count of more than 32,767 is stored so; real
    /// numbers if they are whole. `None` for what is no count.
    #[must_use]
    pub fn counts(&self) -> Vec<Option<u64>> {
        let of_number = |number: f64| {
            let is_count = (0.0..=4e9).contains(&number) && number.fract() == 0.0;
            is_count.then_some(number as u64)
        };
        let numbers = self.numbers().into_iter();
        if self.kind == ParameterKind::Int {
            let unsigned = |n: f64| if n < 0.0 { n + 65_536.0 } else { n };
            return numbers.map(|number| of_number(unsigned(number))).collect();
        }
        numbers.map(of_number).collect()
    }

    /// Its first element as a count.
    #[must_use]
    pub fn first_count(&self) -> Option<u64> {
        self.counts().first().copied().flatten()
    }

    /// Its texts without the blanks at their ends; none if it holds no characters.
    #[must_use]
    pub fn texts(&self) -> Vec<String> {
        if self.kind != ParameterKind::Char {
            return Vec::new();
        }
        let length = usize::from(self.dimensions.first().copied().unwrap_or(1));
        if length == 0 {
            return vec![String::new(); self.dimensions.get(1).copied().unwrap_or(0).into()];
        }
        self.data.chunks(length).map(|bytes| trimmed(bytes).into_owned()).collect()
    }

    /// Its first text, unless that is empty.
    #[must_use]
    pub fn first_text(&self) -> Option<String> {
        self.texts().into_iter().next().filter(|text| !text.is_empty())
    }
}

/// Bytes of a file as text: UTF-8 if they are that, else Latin-1, which most programs wrote.
#[must_use]
pub fn text_of(bytes: &[u8]) -> Cow<'_, str> {
    match str::from_utf8(bytes) {
        Ok(text) => Cow::Borrowed(text),
        Err(_) => Cow::Owned(bytes.iter().map(|&byte| char::from(byte)).collect()),
    }
}

/// A name as it is told to a person: what stands where a name should may be any bytes, and many.
#[must_use]
pub fn shown_name(bytes: &[u8]) -> String {
    const MOST: usize = 40;
    let text = text_of(bytes);
    let plain = |c: char| if c.is_control() { char::REPLACEMENT_CHARACTER } else { c };
    let shown: String = text.chars().take(MOST).map(plain).collect();
    match text.chars().count() {
        all if all > MOST => format!("{shown}... ({all})", all = counted(all, "letter")),
        _ => shown,
    }
}

fn trimmed(bytes: &[u8]) -> Cow<'_, str> {
    let is_blank = |byte: &u8| matches!(byte, 0 | b' ' | b'\t' | b'\r' | b'\n');
    let start = bytes.iter().position(|byte| !is_blank(byte)).unwrap_or(bytes.len());
    let end = bytes.iter().rposition(|byte| !is_blank(byte)).map_or(start, |last| last + 1);
    text_of(bytes.get(start..end).unwrap_or_default())
}

/// Parameters that belong together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Group {
    /// Number by which its parameters name it, 1 to 127.
    pub id: u8,
    /// Name as it stands in the file; empty if there are only parameters that name its number.
    pub name: Vec<u8>,
    /// True if programs are asked not to let a person change it.
    pub locked: bool,
    /// What it is for, in somebody's words.
    pub description: Vec<u8>,
    /// Its parameters in the order of the file.
    pub parameters: Vec<Parameter>,
}

/// All groups of a file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Parameters {
    /// In the order of the file.
    pub groups: Vec<Group>,
}

fn is_called(name: &[u8], wanted: &str) -> bool {
    name.trim_ascii().eq_ignore_ascii_case(wanted.as_bytes())
}

impl Parameters {
    /// True if there is a group of this name.
    #[must_use]
    pub fn has_group(&self, group: &str) -> bool {
        self.groups.iter().any(|of| is_called(&of.name, group))
    }

    /// The first parameter of this name in the groups of this name. Case does not matter.
    #[must_use]
    pub fn get(&self, group: &str, name: &str) -> Option<&Parameter> {
        let groups = self.groups.iter().filter(|of| is_called(&of.name, group));
        groups.flat_map(|of| &of.parameters).find(|of| is_called(&of.name, name))
    }

    /// The texts of a parameter and of those that go on with it: LABELS, LABELS2, LABELS3, ...
    #[must_use]
    pub fn texts(&self, group: &str, name: &str) -> Vec<String> {
        let mut texts = self.get(group, name).map(Parameter::texts).unwrap_or_default();
        for number in 2.. {
            let Some(more) = self.get(group, &format!("{name}{number}")) else { break };
            texts.extend(more.texts());
        }
        texts
    }

    /// The numbers of a parameter and of those that go on with it.
    #[must_use]
    pub fn numbers(&self, group: &str, name: &str) -> Vec<f64> {
        let mut numbers = self.get(group, name).map(Parameter::numbers).unwrap_or_default();
        for number in 2.. {
            let Some(more) = self.get(group, &format!("{name}{number}")) else { break };
            numbers.extend(more.numbers());
        }
        numbers
    }

    /// Puts a parameter in the place of the one of its name, or behind the others of its group, which is
    /// made if it is not there. What describes and locks it stays. Without effect if there are 127
    /// groups already.
    pub fn set(&mut self, group: &str, parameter: Parameter) {
        let index = self.groups.iter().position(|of| is_called(&of.name, group));
        let Some(index) = index.or_else(|| self.add_group(group)) else { return };
        // A parameter may stand in the second of two groups of one name.
        let name = text_of(&parameter.name).into_owned();
        let known = self
            .groups
            .iter_mut()
            .filter(|of| is_called(&of.name, group))
            .flat_map(|of| &mut of.parameters)
            .find(|of| is_called(&of.name, &name));
        match known {
            Some(known) => {
                known.kind = parameter.kind;
                known.dimensions = parameter.dimensions;
                known.data = parameter.data;
            }
            None => {
                if let Some(group) = self.groups.get_mut(index) {
                    group.parameters.push(parameter);
                }
            }
        }
    }

    /// Takes a parameter out.
    pub fn remove(&mut self, group: &str, name: &str) {
        for of in self.groups.iter_mut().filter(|of| is_called(&of.name, group)) {
            of.parameters.retain(|parameter| !is_called(&parameter.name, name));
        }
    }

    /// Makes every name stand once, as programs expect: groups of one name become one, a parameter that
    /// comes again goes if it says the same, and gets a number behind its name if it does not. What was
    /// renamed.
    pub fn make_names_unique(&mut self) -> Vec<String> {
        let mut renamed = Vec::new();
        let mut groups: Vec<Group> = Vec::with_capacity(self.groups.len());
        for mut group in std::mem::take(&mut self.groups) {
            if group.name.is_empty() {
                group.name = format!("GROUP{}", group.id).into_bytes();
            }
            let name = text_of(&group.name).into_owned();
            match groups.iter_mut().find(|of| is_called(&of.name, name.trim())) {
                Some(first) => first.parameters.append(&mut group.parameters),
                None => groups.push(group),
            }
        }
        for group in &mut groups {
            let mut known: BTreeMap<String, usize> = BTreeMap::new();
            let mut kept: Vec<Parameter> = Vec::with_capacity(group.parameters.len());
            for mut parameter in std::mem::take(&mut group.parameters) {
                let name = text_of(&parameter.name).trim().to_ascii_uppercase();
                if let Some(first) = known.get(&name).and_then(|&at| kept.get(at)) {
                    if first.data == parameter.data && first.kind == parameter.kind {
                        continue;
                    }
                    let free = |number: &usize| !known.contains_key(&format!("{name}_{number}"));
                    let number = (2..).find(free).unwrap_or(2);
                    parameter.name = format!("{name}_{number}").into_bytes();
                    let (of, shown) = (shown_name(&group.name), shown_name(name.as_bytes()));
                    renamed.push(format!("the second {of}:{shown} is written as {shown}_{number}"));
                }
                let name = text_of(&parameter.name).trim().to_ascii_uppercase();
                known.insert(name, kept.len());
                kept.push(parameter);
            }
            group.parameters = kept;
        }
        self.groups = groups;
        renamed
    }

    fn add_group(&mut self, name: &str) -> Option<usize> {
        let id = (1..=127).find(|id| self.groups.iter().all(|group| group.id != *id))?;
        let name = name.as_bytes().to_vec();
        let description = Vec::new();
        self.groups.push(Group { id, name, locked: false, description, parameters: Vec::new() });
        Some(self.groups.len() - 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_told_in_one_short_line_whatever_its_bytes_are() {
        assert_eq!(shown_name(b"RATE"), "RATE");
        assert_eq!(shown_name(b"R\x07A\nTE"), "R\u{fffd}A\u{fffd}TE");
        let long = shown_name(&[0xE9; 127]);
        assert_eq!(long, format!("{}... (127 letters)", "\u{e9}".repeat(40)));
    }
}
