//! Moments of the calendar, in whole seconds, as text that everybody reads the same way.

use crate::body::worn::kept::utc;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;
use std::str::FromStr;

const DAY_S: u64 = 86_400;

/// Seconds since the beginning of 1970, written as `2026-11-21T09:40:39Z`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Utc(pub u64);

impl Utc {
    /// So many hours later.
    #[must_use]
    pub fn plus_hours(self, hours: f64) -> Self {
        let seconds = (hours * 3600.0).clamp(0.0, 1e9) as u64;
        Self(self.0.saturating_add(seconds))
    }
}

impl From<std::time::SystemTime> for Utc {
    fn from(time: std::time::SystemTime) -> Self {
        Self(time.duration_since(std::time::UNIX_EPOCH).map_or(0, |since| since.as_secs()))
    }
}

impl fmt::Display for Utc {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&utc(self.0))
    }
}

impl FromStr for Utc {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("{text:?} is no moment like 2026-11-21T09:40:39Z");
        let number =
            |from: usize, to: usize| text.get(from..to).and_then(|t| t.parse::<u64>().ok());
        let parts = [(0, 4), (5, 7), (8, 10), (11, 13), (14, 16), (17, 19)];
        let parts = parts.map(|(from, to)| number(from, to));
        let [Some(year), Some(month), Some(date), Some(hour), Some(minute), Some(second)] = parts
        else {
            return Err(wrong());
        };
        if !(1970..=9999).contains(&year) || !(1..=12).contains(&month) {
            return Err(wrong());
        }
        let moment = Self(day(year, month, date) * DAY_S + hour * 3600 + minute * 60 + second);
        // Written again it is the same: no thirtieth of February, no signs, nothing behind it.
        if moment.to_string() == text { Ok(moment) } else { Err(wrong()) }
    }
}

/// Days from 1970 to a date: the inverse of what [`utc`] does; years begin in March, so that the leap
/// day is their last.
fn day(year: u64, month: u64, date: u64) -> u64 {
    let (year, march_month) = if month > 2 { (year, month - 3) } else { (year - 1, month + 9) };
    let (era, of_era) = (year / 400, year % 400);
    let of_year = (153 * march_month + 2) / 5 + date.saturating_sub(1);
    (era * 146_097 + of_era * 365 + of_era / 4 - of_era / 100 + of_year).saturating_sub(719_468)
}

impl Serialize for Utc {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Utc {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        String::deserialize(from)?.parse().map_err(serde::de::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Values of `date -u -d @SECONDS`.
    #[test]
    fn known_moments_are_written_as_the_calendar_has_them() {
        for (seconds, text) in [
            (0, "1970-01-01T00:00:00Z"),
            (951_782_400, "2000-02-29T00:00:00Z"),
            (1_000_000_000, "2001-09-09T01:46:40Z"),
            (4_107_542_399, "2100-02-28T23:59:59Z"),
            (4_107_542_400, "2100-03-01T00:00:00Z"),
        ] {
            assert_eq!(Utc(seconds).to_string(), text);
            assert_eq!(text.parse(), Ok(Utc(seconds)));
        }
        for text in ["", "2026-02-30T00:00:00Z", "2026-11-21 09:40:39", "2026-13-01T00:00:00Z"] {
            assert!(text.parse::<Utc>().is_err(), "{text}");
        }
    }

    proptest! {
        #[test]
        fn every_moment_is_read_as_it_was_written(seconds in 0_u64..253_402_300_800) {
            prop_assert_eq!(Utc(seconds).to_string().parse(), Ok(Utc(seconds)));
        }

        #[test]
        fn no_text_makes_it_fall(text: String) {
            let _ = text.parse::<Utc>();
        }
    }
}
