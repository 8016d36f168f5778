//! How far somebody is with a movement that was asked for.

use crate::time::{Duration, Instant};

/// How long somebody stands after a movement.
const OVER: Duration = Duration::from_millis(700);

/// How far somebody is with a movement: standing first, for arms may still be on their way down from T
/// pose, then away, then standing again.
#[derive(Debug, Default)]
pub struct Progress {
    stood: Option<Instant>,
    went: bool,
    back: Option<Instant>,
}

impl Progress {
    /// True once somebody went away from where they stood.
    pub const fn has_begun(&self) -> bool {
        self.went
    }

    /// Takes a moment; once it is over, since when.
    pub fn take(&mut self, now: Instant, is_back: bool, is_away: bool) -> Option<Instant> {
        if !is_back {
            self.back = None;
            self.went |= is_away && self.stood.is_some();
            return None;
        }
        let stood = *self.stood.get_or_insert(now);
        if !self.went {
            return None;
        }
        let back = *self.back.get_or_insert(now);
        (now.since(back) >= OVER).then_some(stood)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_movement_begins_from_standing_and_is_over_after_standing_again() {
        let mut progress = Progress::default();
        let at = |seconds: f64| Instant::from_nanos((seconds * 1e9) as u64);
        // Arms that come down from T pose are no movement.
        assert_eq!(progress.take(at(0.0), false, true), None);
        assert_eq!(progress.take(at(1.0), true, false), None);
        assert_eq!(progress.take(at(3.0), true, false), None);
        assert!(!progress.has_begun());
        assert_eq!(progress.take(at(4.0), false, true), None);
        assert!(progress.has_begun());
        // On the way back, with a stumble.
        assert_eq!(progress.take(at(5.0), true, false), None);
        assert_eq!(progress.take(at(5.5), false, false), None);
        assert_eq!(progress.take(at(5.6), true, false), None);
        assert_eq!(progress.take(at(6.2), true, false), None);
        assert_eq!(progress.take(at(6.31), true, false), Some(at(1.0)));
    }
}
