//! The parameter section of a C3D file: read with what is wrong with it, and written.

use super::header::{BLOCK, KEY};
use super::number::Processor;
use crate::error::{Error, ErrorKind, counted};
use crate::mocap::parameters::{Group, Parameter, ParameterKind, Parameters, shown_name};

/// Most parameters that are read.
const MAX_PARAMETERS: usize = 16_384;
/// Most blocks of a section, as its head can tell them.
const MAX_BLOCKS: usize = 255;
/// Most faults that are told one by one.
const MAX_NOTES: usize = 20;

/// What was read.
pub struct Section {
    pub processor: Processor,
    pub parameters: Parameters,
    /// Bytes from its beginning to the end of its last entry.
    pub length: usize,
    /// Faults, and what was made of them.
    pub notes: Vec<String>,
}

/// Bytes that the head of a section claims, from its first four bytes.
pub fn claimed_bytes(head: &[u8]) -> usize {
    usize::from(head.get(2).copied().unwrap_or(0)) * BLOCK
}

struct Entries<'a> {
    bytes: &'a [u8],
    /// Where the section begins in the file, for messages.
    origin: usize,
    processor: Processor,
    parameters: Parameters,
    count: usize,
    length: usize,
    notes: Vec<String>,
    untold: usize,
}

/// Reads a section out of the bytes from its beginning on. `origin` is where it begins in the file.
pub fn read(bytes: &[u8], origin: usize) -> Result<Section, Error> {
    let Some([_, _, _, machine]) = bytes.first_chunk::<4>().copied() else {
        return Err(Error::of(ErrorKind::Malformed, "the file ends before its parameters")
            .at(format!("byte {origin}"))
            .got(counted(bytes.len(), "byte"))
            .allowed("4 bytes at least, which say how long the parameter section is")
            .remedy("copy the file again"));
    };
    let processor = Processor::of_byte(machine);
    let mut entries = Entries {
        bytes,
        origin,
        processor: processor.unwrap_or(Processor::Intel),
        parameters: Parameters::default(),
        count: 0,
        length: 4,
        notes: Vec::new(),
        untold: 0,
    };
    if processor.is_none() {
        let place = origin + 3;
        entries.note(format!(
            "byte {place}: {machine} is no kind of machine (84 Intel, 85 DEC, 86 MIPS); taken as Intel"
        ));
    }
    entries.read_all();
    if entries.untold > 0 {
        entries.notes.push(format!("{} of parameters", counted(entries.untold, "more fault")));
    }
    let Entries { processor, parameters, length, notes, .. } = entries;
    Ok(Section { processor, parameters, length, notes })
}

impl Entries<'_> {
    fn note(&mut self, note: String) {
        if self.notes.len() < MAX_NOTES {
            self.notes.push(note);
        } else {
            self.untold += 1;
        }
    }

    fn read_all(&mut self) {
        let mut at = 4;
        while let Some(next) = self.entry(at) {
            at = next;
        }
    }

    /// Reads the entry at a place; where the next one is, if there is one.
    fn entry(&mut self, at: usize) -> Option<usize> {
        let bytes = self.bytes;
        let [length, id] = *bytes.get(at..)?.first_chunk::<2>()?;
        if length == 0 {
            return None;
        }
        let place = self.origin + at;
        let locked = length.cast_signed() < 0;
        let length = usize::from(length.cast_signed().unsigned_abs());
        let name_end = at + 2 + length;
        let (Some(name), Some(offset)) =
            (bytes.get(at + 2..name_end), self.processor.word16_at(bytes, name_end))
        else {
            self.note(format!(
                "byte {place}: an entry claims a name of {}, of which the section has {}; it and \
                 what follows is left out",
                counted(length, "byte"),
                bytes.len().saturating_sub(at + 2)
            ));
            return None;
        };
        let content = name_end + 2;
        let id_number = id.cast_signed();
        let end = if id_number < 0 {
            self.group(name, id_number.unsigned_abs(), locked, content)
        } else {
            self.parameter(name, id, locked, content, place)
        };
        self.length = self.length.max(end.unwrap_or(content));
        let pointed = (offset != 0).then(|| name_end + usize::from(offset));
        match (end, pointed) {
            // The offset of the last entry is zero by the book; it may be followed by others for all that.
            (end, None) => end,
            (Some(end), Some(pointed)) if pointed == end => Some(end),
            (Some(end), Some(pointed)) => {
                let is_entry = |at: usize| self.is_entry(at);
                // A pointer that leads on is believed, one that leads into this entry or out of the
                // section is not.
                let next = if pointed > end && is_entry(pointed) { pointed } else { end };
                if is_entry(next) {
                    self.note(format!(
                        "byte {place}: {} is said to end at byte {}, and ends at byte {}",
                        shown_name(name),
                        self.origin + pointed,
                        self.origin + end
                    ));
                }
                Some(next)
            }
            (None, Some(pointed)) => Some(pointed).filter(|&pointed| pointed > at),
        }
    }

    /// True if what is there may be an entry: a name that is text, and an offset.
    fn is_entry(&self, at: usize) -> bool {
        let Some([length, _]) = self.bytes.get(at..).and_then(|rest| rest.first_chunk::<2>())
        else {
            return false;
        };
        let length = usize::from(length.cast_signed().unsigned_abs());
        let name = self.bytes.get(at + 2..at + 2 + length).unwrap_or_default();
        length > 0 && name.len() == length && name.iter().all(|byte| (0x20..0x7f).contains(byte))
    }

    /// A group; where it ends.
    fn group(&mut self, name: &[u8], id: u8, locked: bool, at: usize) -> Option<usize> {
        let length = usize::from(self.bytes.get(at).copied().unwrap_or(0));
        let description = self.bytes.get(at + 1..at + 1 + length).unwrap_or_default().to_vec();
        let end = at + 1 + description.len();
        let known = self.parameters.groups.iter_mut().find(|group| group.id == id);
        match known {
            Some(known) if known.name.is_empty() => {
                (known.name, known.locked, known.description) =
                    (name.to_vec(), locked, description);
            }
            // Two groups of one number have their parameters in common.
            Some(known) => {
                let of = shown_name(&known.name);
                let place = self.origin + at;
                self.note(format!(
                    "byte {place}: group {} has the number {id} of group {of}: taken as one",
                    shown_name(name)
                ));
            }
            None => {
                let (name, parameters) = (name.to_vec(), Vec::new());
                self.parameters.groups.push(Group { id, name, locked, description, parameters });
            }
        }
        Some(end)
    }

    /// A parameter; where it ends, unless it claims more than there is.
    fn parameter(
        &mut self,
        name: &[u8],
        id: u8,
        locked: bool,
        at: usize,
        place: usize,
    ) -> Option<usize> {
        let bytes = self.bytes;
        let of = shown_name(name);
        let [code, axes] = *bytes.get(at..)?.first_chunk::<2>()?;
        let Some(kind) = ParameterKind::of_code(code.cast_signed()) else {
            let code = code.cast_signed();
            self.note(format!(
                "byte {place}: parameter {of} is of the unknown type {code} (allowed: -1, 1, 2, 4); left out"
            ));
            return None;
        };
        let data_at = at + 2 + usize::from(axes);
        let dimensions = bytes.get(at + 2..data_at).unwrap_or_default().to_vec();
        let lengths = dimensions.iter().map(|&length| usize::from(length));
        let count = lengths.fold(1_usize, usize::saturating_mul);
        let size = count.saturating_mul(kind.size());
        let data = bytes.get(data_at..data_at.saturating_add(size));
        let Some(data) = data.filter(|_| dimensions.len() == usize::from(axes)) else {
            self.note(format!(
                "byte {place}: parameter {of} claims {size}, of which the section has {}; left out",
                bytes.len().saturating_sub(data_at),
                size = counted(size, "byte")
            ));
            return None;
        };
        let described_at = data_at + size;
        let length = usize::from(bytes.get(described_at).copied().unwrap_or(0));
        let description =
            bytes.get(described_at + 1..described_at + 1 + length).unwrap_or_default();
        let end = (described_at + 1 + description.len()).min(bytes.len());
        self.count += 1;
        if self.count > MAX_PARAMETERS {
            self.note(format!(
                "byte {place}: more than {MAX_PARAMETERS} parameters; {of} is left out"
            ));
            return Some(end);
        }
        let parameter = Parameter {
            name: name.to_vec(),
            locked,
            kind,
            dimensions,
            data: self.in_intel_order(kind, data),
            description: description.to_vec(),
        };
        let groups = &mut self.parameters.groups;
        let group = match groups.iter_mut().position(|group| group.id == id) {
            Some(known) => known,
            None => {
                let (name, description, parameters) = Default::default();
                groups.push(Group { id, name, locked: false, description, parameters });
                groups.len() - 1
            }
        };
        let group = groups.get_mut(group)?;
        let is_double = group
            .parameters
            .iter()
            .any(|known| known.name.trim_ascii().eq_ignore_ascii_case(name.trim_ascii()));
        let in_group = shown_name(&group.name);
        group.parameters.push(parameter);
        if is_double {
            self.note(format!(
                "byte {place}: parameter {in_group}:{of} comes a second time: the first one counts"
            ));
        }
        Some(end)
    }

    fn in_intel_order(&self, kind: ParameterKind, data: &[u8]) -> Vec<u8> {
        match (kind, self.processor) {
            (ParameterKind::Int, Processor::Mips) => {
                data.as_chunks::<2>().0.iter().flat_map(|&[a, b]| [b, a]).collect()
            }
            (ParameterKind::Float, Processor::Dec | Processor::Mips) => {
                let numbers = data.as_chunks::<4>().0.iter();
                numbers.flat_map(|&bytes| self.processor.float(bytes).to_le_bytes()).collect()
            }
            _ => data.to_vec(),
        }
    }
}

/// Writes a section for an Intel machine, filled up to whole blocks.
///
/// # Errors
/// If it is longer than its head can tell.
pub fn write(parameters: &Parameters) -> Result<Vec<u8>, Error> {
    let mut bytes = vec![1, KEY, 0, 84];
    for group in &parameters.groups {
        let id = (group.id & 0x7f).cast_signed();
        let mut content = Vec::with_capacity(1 + group.description.len());
        put_text(&mut content, &group.description);
        put_entry(&mut bytes, &group.name, group.locked, -id, &content);
        for parameter in &group.parameters {
            let mut content = vec![parameter.kind.code().cast_unsigned()];
            put_text(&mut content, &parameter.dimensions);
            content.extend(&parameter.data);
            put_text(&mut content, &parameter.description);
            put_entry(&mut bytes, &parameter.name, parameter.locked, id, &content);
        }
    }
    // The end of the list is a name without length. c3dio takes an empty list for one entry, and so
    // reads on behind it; a block of nothing keeps that from leading out of the section.
    bytes.extend([0; BLOCK]);
    let blocks = bytes.len().div_ceil(BLOCK);
    let Ok(count) = u8::try_from(blocks) else {
        return Err(Error::of(
            ErrorKind::OutsideLimits,
            "the parameters do not fit into a C3D file",
        )
        .got(format!("{blocks} of {BLOCK} bytes", blocks = counted(blocks, "block")))
        .allowed(format!("at most {MAX_BLOCKS}"))
        .remedy("write another kind of file, or fewer points"));
    };
    bytes.resize(blocks * BLOCK, 0);
    if let Some(place) = bytes.get_mut(2) {
        *place = count;
    }
    Ok(bytes)
}

/// A length of at most 255, and so many bytes.
fn put_text(bytes: &mut Vec<u8>, text: &[u8]) {
    let length = u8::try_from(text.len()).unwrap_or(u8::MAX);
    bytes.push(length);
    bytes.extend(text.iter().take(usize::from(length)));
}

fn put_entry(bytes: &mut Vec<u8>, name: &[u8], locked: bool, id: i8, content: &[u8]) {
    let length = i8::try_from(name.len()).unwrap_or(i8::MAX);
    let signed = if locked { -length } else { length };
    bytes.extend([signed.cast_unsigned(), id.cast_unsigned()]);
    bytes.extend(name.iter().take(usize::from(length.unsigned_abs())));
    let offset = u16::try_from(content.len() + 2).unwrap_or(u16::MAX);
    bytes.extend(offset.to_le_bytes());
    bytes.extend(content);
}
