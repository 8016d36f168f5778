//! How segments usually face on what carries them. A sensor that was knocked has lost its heading, and at any one moment of a stride a
//! trunk or a thigh faces elsewhere than it does on the mean: what it faced on the mean before tells where it faces now.

use crate::units::wrap_rad;
use glam::DVec2;
use std::collections::VecDeque;

/// What is usual is a mean, and the mean of that, over so long a time each, s: a stride does not show.
const USUAL_S: f64 = 0.8;
/// So long somebody is looked at before anything is usual, s.
const FIRST_S: f64 = 2.0;
/// Of one that is doubted what it said last counts, s: a stride.
pub(super) const STRIDE_S: f64 = 1.15;

/// How one segment faces on what carries it.
#[derive(Clone, Debug, Default)]
pub(super) struct Facing {
    /// Means of directions.
    usual: [DVec2; 2],
    heard_s: f64,
    /// What was said while it is doubted, each with how long.
    last: VecDeque<(f64, DVec2)>,
}

impl Facing {
    /// Takes how a segment faces, rad, `dt_s` after the moment before.
    pub(super) fn take(&mut self, faces_rad: f64, dt_s: f64, is_doubted: bool) {
        let faces = DVec2::from_angle(faces_rad);
        if is_doubted {
            self.last.push_back((dt_s, faces));
            let mut lasts_s: f64 = self.last.iter().map(|(of_s, _)| of_s).sum();
            while let Some((of_s, _)) =
                self.last.front().filter(|(of_s, _)| lasts_s - of_s > STRIDE_S)
            {
                lasts_s -= of_s;
                self.last.pop_front();
            }
            return;
        }
        self.last.clear();
        if self.heard_s == 0.0 {
            self.usual = [faces; 2];
        }
        self.heard_s += dt_s;
        let share = (dt_s / USUAL_S).min(1.0);
        let [first, mean] = self.usual;
        self.usual = [first + (faces - first) * share, mean + (first - mean) * share];
    }

    /// By how much it has to be turned to face as is usual, on the mean, rad; `None`: nobody knows.
    pub(super) fn owed_rad(&self) -> Option<f64> {
        let said: DVec2 = self.last.iter().map(|(of_s, faces)| *of_s * *faces).sum();
        let lasts_s: f64 = self.last.iter().map(|(of_s, _)| of_s).sum();
        let is_known = self.heard_s >= FIRST_S && lasts_s >= 0.9 * STRIDE_S;
        // Directions that are all over the place have no mean.
        let has_mean = said.length() > 0.5 * lasts_s && self.usual[1].length() > 0.5;
        (is_known && has_mean).then(|| wrap_rad(self.usual[1].to_angle() - said.to_angle()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_swings_is_turned_to_where_it_faced_on_the_mean_whenever_its_heading_was_lost() {
        let swing = |t: f64| 0.3 + 0.25 * (core::f64::consts::TAU * t / 1.1).sin();
        for lost_s in [10.0, 10.2, 10.4, 10.6, 10.8, 11.0] {
            let mut facing = Facing::default();
            for n in 0..1500 {
                let t = f64::from(n) / 100.0;
                let is_doubted = t >= lost_s;
                facing.take(swing(t) + if is_doubted { 2.9 } else { 0.0 }, 0.01, is_doubted);
                if t < lost_s + 1.0 {
                    assert_eq!(facing.owed_rad(), None, "{t}");
                }
            }
            let owed_rad = facing.owed_rad().expect("it was seen for long enough");
            assert!((owed_rad + 2.9).abs() < 0.06, "{lost_s}: {owed_rad}");
        }
    }

    #[test]
    fn of_who_turns_all_round_or_was_hardly_seen_nothing_is_usual() {
        let mut facing = Facing::default();
        for n in 0..600 {
            let t = f64::from(n) / 100.0;
            facing.take(if t < 4.0 { 0.0 } else { 9.0 * t }, 0.01, t >= 4.0);
        }
        assert_eq!(facing.owed_rad(), None);
        let mut facing = Facing::default();
        for n in 0..300 {
            facing.take(0.0, 0.01, n >= 100);
        }
        assert_eq!(facing.owed_rad(), None);
    }
}
