//! Messages of Open Sound Control, as bytes: an address, and what is said to it.
//!
//! Source: Wright, "The Open Sound Control 1.0 Specification", 2002. Numbers are big-endian, every part is filled with zeros to
//! four bytes, and a bundle holds messages that belong to one moment.

/// What an address is told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OscValue<'a> {
    /// A whole number.
    Int(i32),
    /// A number.
    Float(f32),
    /// Words. Behind a zero nothing of them is told.
    Text(&'a str),
}

/// Messages that are told together, at once.
#[derive(Clone, Debug)]
pub struct OscBundle(Vec<u8>);

impl Default for OscBundle {
    fn default() -> Self {
        // The time tag 1 means: now.
        Self(b"#bundle\0\0\0\0\0\0\0\0\x01".to_vec())
    }
}

impl OscBundle {
    /// Adds a message.
    pub fn tell(&mut self, address: &str, values: &[OscValue<'_>]) {
        let mut message = Vec::new();
        push_text(&mut message, address);
        let tags: String = values.iter().map(OscValue::tag).collect();
        push_text(&mut message, &format!(",{tags}"));
        for value in values {
            match value {
                OscValue::Int(number) => message.extend(number.to_be_bytes()),
                OscValue::Float(number) => message.extend(number.to_be_bytes()),
                OscValue::Text(words) => push_text(&mut message, words),
            }
        }
        let length = u32::try_from(message.len()).unwrap_or(u32::MAX);
        self.0.extend(length.to_be_bytes());
        self.0.extend(message);
    }

    /// The bundle as a packet.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.0
    }
}

impl OscValue<'_> {
    const fn tag(&self) -> char {
        match self {
            Self::Int(_) => 'i',
            Self::Float(_) => 'f',
            Self::Text(_) => 's',
        }
    }
}

/// Words, at least one zero, and zeros up to four bytes.
fn push_text(out: &mut Vec<u8>, words: &str) {
    let told = words.split('\0').next().unwrap_or_default().as_bytes();
    out.extend(told);
    out.extend(std::iter::repeat_n(0, 4 - told.len() % 4));
}

#[cfg(test)]
mod tests {
    use super::*;

    // The specification's examples: /oscillator/4/frequency with 440.0, and /foo with 1000, -1, "hello", 1.234, 5.678.
    #[test]
    fn messages_are_those_of_the_specification() {
        let mut bundle = OscBundle::default();
        bundle.tell("/oscillator/4/frequency", &[OscValue::Float(440.0)]);
        let head = b"#bundle\0\0\0\0\0\0\0\0\x01\0\0\0\x20";
        let message = b"/oscillator/4/frequency\0,f\0\0\x43\xDC\0\0";
        assert_eq!(bundle.bytes(), [&head[..], message].concat());

        let mut bundle = OscBundle::default();
        let (one, two) = (OscValue::Int(1000), OscValue::Int(-1));
        let (hello, fast) = (OscValue::Text("hello"), OscValue::Float(1.234));
        bundle.tell("/foo", &[one, two, hello, fast, OscValue::Float(5.678)]);
        let message = b"/foo\0\0\0\0,iisff\0\0\0\0\x03\xE8\xFF\xFF\xFF\xFFhello\0\0\0\x3F\x9D\xF3\xB6\x40\xB5\xB2\x2D";
        assert_eq!(bundle.bytes()[20..], message[..]);
    }
}
