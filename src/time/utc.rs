//! Moments of the calendar, in whole seconds, as text that everybody reads the same way.

use jiff::Timestamp;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;
use std::str::FromStr;

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

impl fmt::Display for Utc {
    /// A moment beyond the year 9999 is written as the last of it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let seconds = i64::try_from(self.0).unwrap_or(i64::MAX).min(Timestamp::MAX.as_second());
        Timestamp::from_second(seconds).map_err(|_| fmt::Error)?.fmt(f)
    }
}

impl FromStr for Utc {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let read = text.parse::<Timestamp>().ok().and_then(|at| u64::try_from(at.as_second()).ok());
        // Written again it is the same: no other zone, no parts of a second.
        let moment = read.map(Self).filter(|moment| moment.to_string() == text);
        moment.ok_or_else(|| format!("{text:?} is no moment like 2026-11-21T09:40:39Z"))
    }
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

    /// The calendar's last second: some hours before the year 10,000, so that it has a name in every zone
    /// (documentation of `jiff::Timestamp::MAX`).
    const LAST: u64 = 253_402_207_200;

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
        for text in ["2026-11-21T09:40:39+01:00", "2026-11-21T09:40:39.5Z", "1969-12-31T23:59:59Z"]
        {
            assert!(text.parse::<Utc>().is_err(), "{text}");
        }
        assert_eq!(Utc(u64::MAX).to_string(), Utc(LAST).to_string());
    }

    proptest! {
        #[test]
        fn every_moment_is_read_as_it_was_written(seconds in 0..=LAST) {
            prop_assert_eq!(Utc(seconds).to_string().parse(), Ok(Utc(seconds)));
        }

        #[test]
        fn no_text_makes_it_fall(text: String) {
            let _ = text.parse::<Utc>();
        }
    }
}
