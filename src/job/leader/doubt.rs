//! A leader's joint that leaps for a single reading has not moved: it is doubted until the next one.
//!
//! What no hand can do is not believed at all ([`crate::control::plausible`]). This is about smaller lies: a hand could have
//! brought the joint there, but only by throwing it, and the next reading is back.

use crate::time::Instant;

/// How far a reading may be from where the joint was going, noise of cheap encoders included, rad.
const SLACK_RAD: f64 = 0.02;
/// A hand that leads an arm speeds a joint up so much at most; quicker ones are followed a cycle later, rad/s².
const BY_HAND_RAD_S2: f64 = 50.0;
/// Over a longer gap nobody knows where a joint was going, s.
const LONGEST_GAP_S: f64 = 0.1;

/// What was last read of a joint.
#[derive(Clone, Copy, Debug)]
pub struct Doubt {
    last: Option<(f64, Instant)>,
    velocity_rad_s: f64,
    /// The reading after it, if it is doubted.
    leapt: Option<(f64, Instant)>,
}

/// What to make of a reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trust {
    /// It is believed.
    Believed,
    /// It is believed, and the reading before was a lie.
    BackFromLie,
    /// Not before the next one says the same.
    Doubted,
}

impl Doubt {
    /// Nothing was read yet.
    pub const NEW: Self = Self { last: None, velocity_rad_s: 0.0, leapt: None };

    /// Takes the next reading.
    pub fn hear(&mut self, rad: f64, at: Instant) -> Trust {
        let trust = match self.leapt.take() {
            None => match self.is_expected(rad, at) {
                true => Trust::Believed,
                false => Trust::Doubted,
            },
            Some((leapt_rad, leapt_at)) => {
                let before_rad = self.last.map_or(leapt_rad, |(last_rad, _)| last_rad);
                if (rad - leapt_rad).abs() <= (rad - before_rad).abs() {
                    // It is still about where it leapt to: so that was true.
                    self.believe(leapt_rad, leapt_at);
                    Trust::Believed
                } else if self.is_expected(rad, at) {
                    Trust::BackFromLie
                } else {
                    Trust::Doubted
                }
            }
        };
        match trust {
            Trust::Doubted => self.leapt = Some((rad, at)),
            Trust::Believed | Trust::BackFromLie => self.believe(rad, at),
        }
        trust
    }

    fn is_expected(&self, rad: f64, at: Instant) -> bool {
        let Some((last_rad, last_at)) = self.last else { return true };
        let dt_s = at.seconds_since(last_at);
        let expected_rad = last_rad + self.velocity_rad_s * dt_s;
        let off_rad = (rad - expected_rad).abs().min((rad - last_rad).abs());
        dt_s > LONGEST_GAP_S || off_rad <= SLACK_RAD + 0.5 * BY_HAND_RAD_S2 * dt_s * dt_s
    }

    fn believe(&mut self, rad: f64, at: Instant) {
        self.velocity_rad_s =
            match self.last.map(|(last, last_at)| (last, at.seconds_since(last_at))) {
                Some((last_rad, dt_s)) if dt_s > 0.0 && dt_s <= LONGEST_GAP_S => {
                    (rad - last_rad) / dt_s
                }
                _ => 0.0,
            };
        self.last = Some((rad, at));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::Duration;
    use Trust::{BackFromLie, Believed, Doubted};

    /// Readings of one joint, 100 times a second.
    fn heard(positions_rad: &[f64]) -> Vec<Trust> {
        let mut doubt = Doubt::NEW;
        let at = |k: usize| Instant::ZERO + Duration::from_millis(10 * k as u64);
        let each = positions_rad.iter().enumerate();
        each.map(|(k, &rad)| doubt.hear(rad, at(k))).collect()
    }

    #[test]
    fn a_leap_that_comes_back_is_a_lie_and_one_that_stays_was_true() {
        let lie = heard(&[0.0, 0.0, 0.15, 0.0, 0.0]);
        assert_eq!(lie, [Believed, Believed, Doubted, BackFromLie, Believed]);
        let pushed = heard(&[0.0, 0.0, 0.15, 0.16, 0.17]);
        assert_eq!(pushed, [Believed, Believed, Doubted, Believed, Believed]);
    }

    #[test]
    fn a_lie_on_the_way_is_one_whichever_way_it_leaps() {
        for leap_rad in [0.1, -0.1] {
            let mut way: Vec<f64> = (0..10).map(|k| 0.02 * f64::from(k)).collect();
            way[5] += leap_rad;
            let heard = heard(&way);
            let expected = (0..10).map(|k| match k {
                5 => Doubted,
                6 => BackFromLie,
                _ => Believed,
            });
            assert_eq!(heard, expected.collect::<Vec<_>>(), "{leap_rad}");
        }
    }

    #[test]
    fn a_hand_that_hurries_is_believed_at_once_and_one_that_throws_a_cycle_later() {
        let way = |rad_s2: f64| -> Vec<f64> {
            (0..30).map(|k| 0.5 * rad_s2 * (0.01 * f64::from(k)).powi(2)).collect()
        };
        assert!(heard(&way(40.0)).iter().all(|trust| *trust == Believed));
        let thrown = heard(&way(1e3));
        assert!(thrown.contains(&Doubted), "{thrown:?}");
        for two in thrown.windows(2) {
            assert_ne!(two, [Doubted, Doubted], "no joint is doubted for longer than a cycle");
        }
    }

    #[test]
    fn noise_of_an_encoder_and_what_comes_after_a_gap_are_no_leaps() {
        let noisy: Vec<f64> = (0..50).map(|k| 0.004 * f64::from(k % 3)).collect();
        assert!(heard(&noisy).iter().all(|trust| *trust == Believed));
        let mut doubt = Doubt::NEW;
        doubt.hear(0.0, Instant::ZERO);
        let later = Instant::ZERO + Duration::from_millis(200);
        assert_eq!(doubt.hear(1.0, later), Believed);
    }
}
