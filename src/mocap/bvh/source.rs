//! Words of a text file, streamed through a buffer of fixed size, with line numbers.

use crate::error::{Error, ErrorKind};
use std::io::Read;
use std::ops::Range;

const BUFFER_BYTES: usize = 64 << 10;

/// A stream cut into words. The current word is [`Source::token`].
pub struct Source<R> {
    stream: R,
    buffer: Vec<u8>,
    filled: usize,
    at: usize,
    taken: u64,
    token: Range<usize>,
    line: usize,
    token_line: usize,
    after_cr: bool,
}

impl<R: Read> Source<R> {
    pub fn new(stream: R) -> Self {
        Self {
            stream,
            buffer: vec![0; BUFFER_BYTES],
            filled: 0,
            at: 0,
            taken: 0,
            token: 0..0,
            line: 1,
            token_line: 1,
            after_cr: false,
        }
    }

    /// Bytes used up so far.
    pub fn consumed(&self) -> u64 {
        self.taken + self.at as u64
    }

    /// The current word; empty before the first and after the last.
    pub fn token(&self) -> &[u8] {
        &self.buffer[self.token.clone()]
    }

    /// Line of the current word, from 1.
    pub fn token_line(&self) -> usize {
        self.token_line
    }

    /// Moves what is left, from `keep` on, to the front and reads more behind it. False at the end.
    fn refill(&mut self, keep: usize) -> Result<bool, Error> {
        self.buffer.copy_within(keep..self.filled, 0);
        self.filled -= keep;
        self.at -= keep;
        self.taken += keep as u64;
        if self.filled == self.buffer.len() {
            return Err(self
                .error("a word or line is too long")
                .allowed(format!("at most {BUFFER_BYTES} bytes"))
                .remedy("this is no text of motion, or it is damaged"));
        }
        loop {
            match self.stream.read(&mut self.buffer[self.filled..]) {
                Ok(count) => {
                    self.filled += count;
                    return Ok(count > 0);
                }
                Err(cause) if cause.kind() == std::io::ErrorKind::Interrupted => {}
                Err(cause) => {
                    return Err(self
                        .error("the file cannot be read")
                        .got(cause.to_string())
                        .remedy("give the path of a .bvh file"));
                }
            }
        }
    }

    /// Counts a line end once, be it LF, CR or CRLF.
    fn count_line(&mut self, byte: u8) {
        let second_of_crlf = byte == b'\n' && self.after_cr;
        if (byte == b'\n' || byte == b'\r') && !second_of_crlf {
            self.line += 1;
        }
        self.after_cr = byte == b'\r';
    }

    /// Goes to the next word, as blanks delimit it. False at the end of the file.
    pub fn next(&mut self) -> Result<bool, Error> {
        self.next_word(|_| false)
    }

    /// Goes to the next word of the header, where braces are words of their own; the end of the
    /// file is an error there.
    pub fn next_in_header(&mut self) -> Result<(), Error> {
        if self.next_word(|byte| byte == b'{' || byte == b'}')? {
            return Ok(());
        }
        Err(self
            .error("the file ends within its header")
            .remedy("the file is cut off or not a BVH file: copy it again"))
    }

    fn next_word(&mut self, single: impl Fn(u8) -> bool) -> Result<bool, Error> {
        loop {
            if self.at == self.filled && !self.refill(self.at)? {
                self.token = 0..0;
                self.token_line = self.line;
                return Ok(false);
            }
            let byte = self.buffer[self.at];
            if !is_blank(byte) {
                break;
            }
            self.count_line(byte);
            self.at += 1;
        }
        self.after_cr = false;
        self.token_line = self.line;
        let mut start = self.at;
        loop {
            if self.at == self.filled {
                let more = self.refill(start)?;
                start = 0;
                if !more {
                    break;
                }
            }
            let byte = self.buffer[self.at];
            if is_blank(byte) || (single(byte) && self.at > start) {
                break;
            }
            self.at += 1;
            if single(byte) {
                break;
            }
        }
        self.token = start..self.at;
        Ok(true)
    }

    /// What stands between the current word and the end of its line, without outer blanks.
    pub fn rest_of_line(&mut self) -> Result<String, Error> {
        let mut start = self.at;
        loop {
            if self.at == self.filled {
                let more = self.refill(start)?;
                start = 0;
                if !more {
                    break;
                }
            }
            if matches!(self.buffer[self.at], b'\n' | b'\r') {
                break;
            }
            self.at += 1;
        }
        self.token = start..start;
        Ok(String::from_utf8_lossy(&self.buffer[start..self.at]).trim().to_owned())
    }

    /// The next word of the header, which must be this one; case does not matter.
    pub fn keyword(&mut self, word: &str) -> Result<(), Error> {
        self.next_in_header()?;
        // A byte order mark is not part of the first word.
        let token = self.token().strip_prefix(b"\xef\xbb\xbf").unwrap_or(self.token());
        if token.eq_ignore_ascii_case(word.as_bytes()) {
            Ok(())
        } else if token.starts_with(b"\xff\xfe") || token.starts_with(b"\xfe\xff") {
            Err(self
                .error("this text is UTF-16")
                .allowed("UTF-8")
                .remedy("save it as UTF-8 in an editor, or: iconv -f utf-16 -t utf-8 OLD > NEW"))
        } else {
            Err(self.unexpected(word))
        }
    }

    /// The value in the next line, which must read `label: value`; case and blanks do not matter.
    pub fn labelled(&mut self, label: &str) -> Result<String, Error> {
        self.next_in_header()?;
        let first = String::from_utf8_lossy(self.token()).into_owned();
        let line = first + " " + &self.rest_of_line()?;
        let words = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
        match line.split_once(':') {
            Some((found, value)) if words(found).eq_ignore_ascii_case(label) => Ok(words(value)),
            _ => {
                let shown = line.chars().take(40).collect::<String>();
                Err(self.error(format!("{label}: is expected")).got(format!("\"{shown}\"")))
            }
        }
    }

    /// An error at the current line.
    pub fn error(&self, what: impl Into<String>) -> Error {
        Error::of(ErrorKind::Malformed, what).at(format!("line {}", self.token_line))
    }

    /// An error that the current word is not what it should be.
    pub fn unexpected(&self, allowed: &str) -> Error {
        let shown: String = String::from_utf8_lossy(self.token()).chars().take(40).collect();
        let error = self.error(format!("{allowed} is expected")).allowed(allowed);
        error.got(if shown.is_empty() { "nothing".to_owned() } else { format!("\"{shown}\"") })
    }

    /// The current line and a joint, for messages.
    pub fn place_in(&self, joint: &str) -> String {
        format!("line {}, joint {joint}", self.token_line)
    }
}

fn is_blank(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t' | b'\n' | b'\r' | 0x0b | 0x0c)
}
