//! Whether a foot that was measured carries: one that is low and slow.
//!
//! Measured feet are never still and never quite on the floor: markers sit on shoes, joints are computed, soles
//! bend. So a part of a foot (heel, ankle, toe) carries while it is near the ground and hardly moves, with room between
//! beginning and ending so that noise does not make it step; a foot carries while a part of it does. For bodies
//! that are made, whose soles lie on the floor exactly, there is [`crate::body::contact`].
//!
//! The numbers are ours. Against force plates (20 N), on level ground and on stairs, feet found so touch and leave within
//! two frames of 100 and 120 a second (`tests/measured_force.rs`).

/// A part that is no higher than this above where it is when the foot stands is near the ground, in shanks.
pub const NEAR_SHANKS: f64 = 0.1;
/// How much higher a part of a foot that carries may be.
const KEEPS: f64 = 1.5;
/// A foot begins to carry below this speed of a part, in legs per second ...
const BEGINS_LEG_S: f64 = 0.8;
/// ... and ends above this one: a toe that leaves is pushed off.
const ENDS_LEG_S: f64 = 1.2;

/// A part of a foot in one frame; not numbers where it was not seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FootPart {
    /// How much higher it is than when the foot stands on the ground under it, m.
    pub height_m: f64,
    /// How fast it moves, m/s.
    pub speed_m_s: f64,
}

/// A foot that is followed frame by frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeasuredFoot {
    shank_m: f64,
    leg_m: f64,
    carries: bool,
}

impl MeasuredFoot {
    /// Of a leg of these lengths, knee to ankle and hip to ankle, in the air.
    #[must_use]
    pub const fn new(shank_m: f64, leg_m: f64) -> Self {
        Self { shank_m, leg_m, carries: false }
    }

    /// Whether it carries in the next frame.
    pub fn next(&mut self, parts: &[FootPart]) -> bool {
        let near_m = NEAR_SHANKS * self.shank_m;
        let (most_m, most_m_s) = if self.carries {
            (KEEPS * near_m, ENDS_LEG_S * self.leg_m)
        } else {
            (near_m, BEGINS_LEG_S * self.leg_m)
        };
        let carries = |part: &FootPart| part.height_m <= most_m && part.speed_m_s <= most_m_s;
        self.carries = parts.iter().any(carries);
        self.carries
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const UNSEEN: FootPart = FootPart { height_m: f64::NAN, speed_m_s: f64::NAN };

    fn part(height_m: f64, speed_m_s: f64) -> FootPart {
        FootPart { height_m, speed_m_s }
    }

    #[test]
    fn a_foot_carries_while_a_part_of_it_is_low_and_slow() {
        let mut foot = MeasuredFoot::new(0.4, 0.8);
        let swings = part(0.02, 3.0);
        assert!(!foot.next(&[swings, swings]));
        assert!(!foot.next(&[UNSEEN, part(0.3, 0.0)]), "lifted and held");
        assert!(foot.next(&[part(0.01, 0.3), swings]), "the heel is down");
        assert!(foot.next(&[swings, part(0.0, 0.1)]), "the toe took over");
        assert!(!foot.next(&[swings, swings]));
        assert!(!foot.next(&[UNSEEN, UNSEEN]) && !foot.next(&[]));
    }

    #[test]
    fn a_foot_leaves_faster_and_higher_than_it_comes() {
        let (quick, raised) = (part(0.0, 0.9), part(0.05, 0.0));
        for between in [quick, raised] {
            let mut foot = MeasuredFoot::new(0.4, 0.8);
            assert!(!foot.next(&[between]), "{between:?}");
            foot.next(&[part(0.0, 0.0)]);
            assert!(foot.next(&[between]), "{between:?}");
        }
    }
}
