//! A share of what is to be made, where several processes or machines make one each.

use crate::error::{Error, ErrorKind};
use std::fmt;

/// Most shares of a whole.
const MOST: usize = 100_000;

/// One of equal shares, every so-many-th thing; typed as `3/100`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Share {
    part: usize,
    of: usize,
}

impl Share {
    /// All of it.
    pub const WHOLE: Self = Self { part: 1, of: 1 };

    /// A share as it is typed.
    ///
    /// # Errors
    /// What is none.
    pub fn parse(text: &str) -> Result<Self, Error> {
        let wrong = || {
            Error::of(ErrorKind::Malformed, "this is no part of a whole")
                .at("--part")
                .got(text)
                .allowed("K/N with K from 1 to N, and N up to 100000: 3/100")
        };
        let (part, of) = text.split_once('/').ok_or_else(wrong)?;
        let number = |text: &str| text.trim().parse::<usize>().map_err(|_| wrong());
        let (part, of) = (number(part)?, number(of)?);
        if (1..=of).contains(&part) && of <= MOST { Ok(Self { part, of }) } else { Err(wrong()) }
    }

    /// Whether the thing at a place, counted from 0, belongs to it.
    #[must_use]
    pub const fn has(self, place: usize) -> bool {
        place % self.of == self.part - 1
    }

    /// Which share, counted from 1, and of how many.
    #[must_use]
    pub const fn numbers(self) -> [usize; 2] {
        [self.part, self.of]
    }
}

impl fmt::Display for Share {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.part, self.of)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_have_everything_once() {
        let shares = ["1/3", "2/3", " 3 / 3 "].map(|text| Share::parse(text).expect("a share"));
        assert!((0..20).all(|at| shares.iter().filter(|share| share.has(at)).count() == 1));
        assert!((0..20).all(|at| Share::WHOLE.has(at)));
        assert_eq!((shares[2].numbers(), shares[2].to_string()), ([3, 3], "3/3".to_owned()));
        for text in ["", "3", "0/3", "4/3", "1/0", "1/100001", "-1/3", "1/3/5", "a/b"] {
            assert!(Share::parse(text).is_err(), "{text}");
        }
    }
}
