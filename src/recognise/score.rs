//! How good a recognition is, as Salamah and Brunnett measure it (their Sec. 7).

use super::machine::Span;

/// Frames that a cut may be off without counting (their tolerance; they state no rate).
pub const TOLERANCE_FRAMES: f64 = 10.0;

/// Whether what was found is the action that was cut by hand: they overlap for more than half of it.
#[must_use]
pub fn is_same(found: &Span, by_hand: &Span) -> bool {
    let overlap_s = found.end_s.min(by_hand.end_s) - found.start_s.max(by_hand.start_s);
    overlap_s > (by_hand.end_s - by_hand.start_s) / 2.0
}

/// How far a cut is from those that were made by hand, beyond the tolerance; in frames if they are.
#[must_use]
pub fn segmentation_error(found: f64, by_hand: &[f64]) -> f64 {
    let mean = by_hand.iter().sum::<f64>() / by_hand.len().max(1) as f64;
    ((found - mean).abs() - TOLERANCE_FRAMES).max(0.0)
}

/// Counts of one class.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct ClassTally {
    /// Recognised rightly.
    pub correct: usize,
    /// Recognised.
    pub recognised: usize,
    /// There.
    pub truth: usize,
}

impl ClassTally {
    /// Share of what was recognised that is right; none if nothing was.
    #[must_use]
    pub fn precision(&self) -> Option<f64> {
        share(self.correct, self.recognised)
    }

    /// Share of what is there that was recognised; none if nothing is.
    #[must_use]
    pub fn recall(&self) -> Option<f64> {
        share(self.correct, self.truth)
    }

    /// Both together.
    #[must_use]
    pub const fn plus(self, other: Self) -> Self {
        Self {
            correct: self.correct + other.correct,
            recognised: self.recognised + other.recognised,
            truth: self.truth + other.truth,
        }
    }
}

fn share(of: usize, all: usize) -> Option<f64> {
    (all > 0).then(|| of as f64 / all as f64)
}

/// The 95 % interval of a share of counts (Wilson, "Probable inference, the law of succession, and
/// statistical inference", 1927); none without any.
#[must_use]
pub fn interval(of: usize, all: usize) -> Option<[f64; 2]> {
    const Z: f64 = 1.959_963_984_540_054;
    let (p, n) = (share(of, all)?, all as f64);
    let middle = p + Z * Z / (2.0 * n);
    let half = Z * (p * (1.0 - p) / n + Z * Z / (4.0 * n * n)).sqrt();
    let whole = 1.0 + Z * Z / n;
    Some([((middle - half) / whole).max(0.0), ((middle + half) / whole).min(1.0)])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn span(start_s: f64, end_s: f64) -> Span {
        Span { start_s, end_s }
    }

    #[test]
    fn nine_of_ten_frames_in_common_are_more_than_half_of_eleven() {
        // Frames 2 to 12 by hand, 3 to 11 found: each frame is one long.
        assert!(is_same(&span(3.0, 12.0), &span(2.0, 13.0)));
        assert!(!is_same(&span(7.5, 30.0), &span(2.0, 13.0)), "exactly half is not more");
        assert!(!is_same(&span(20.0, 30.0), &span(2.0, 13.0)));
    }

    #[test]
    fn a_cut_at_131_is_7_frames_off_112_and_116() {
        assert_eq!(segmentation_error(131.0, &[112.0, 116.0]), 7.0);
        assert_eq!(segmentation_error(105.0, &[112.0, 116.0]), 0.0);
    }

    #[test]
    fn precision_counts_what_was_said_and_recall_what_was_there() {
        let tally = ClassTally { correct: 3, recognised: 4, truth: 6 };
        assert_eq!((tally.precision(), tally.recall()), (Some(0.75), Some(0.5)));
        assert_eq!(ClassTally::default().precision(), None);
        assert_eq!(tally.plus(tally).correct, 6);
    }

    #[test]
    fn ten_of_ten_is_at_least_72_percent_with_95_percent_certainty() {
        // Wilson's interval of 10 of 10 is n / (n + z^2) to 1.
        let [low, high] = interval(10, 10).expect("some");
        assert!((low - 10.0 / (10.0 + 1.96 * 1.96)).abs() < 1e-4, "{low}");
        assert!((high - 1.0).abs() < 1e-12, "{high}");
        assert_eq!(interval(0, 0), None);
    }
}
