//! Sets that a corpus may be filled with: which trials they ask for.
//!
//! The generalisation set is that of the Human Motion Database (Guerra-Filho and Biswas, "The human motion database: A
//! cognitive and parametric sampling of human motion", Image and Vision Computing 30, 2012): one action for each of many
//! targets, directions, heights, speeds and loads. How many of each is theirs; which ones exactly is ours, since they are
//! published as a picture only.

use core::f64::consts::FRAC_PI_4;
use serde::Serialize;
use std::collections::BTreeMap;

/// A set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlannedSet {
    /// One action for each of many targets, directions, heights, speeds and loads.
    Generalisation,
}

impl PlannedSet {
    /// All of them.
    pub const ALL: [Self; 1] = [Self::Generalisation];

    /// As a word.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Generalisation => "generalisation",
        }
    }

    /// Its trials, in their order, for bodies of these statures, m.
    #[must_use]
    pub fn trials(self) -> Vec<PlannedTrial> {
        match self {
            Self::Generalisation => generalisation(),
        }
    }
}

/// A trial that a set asks for.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PlannedTrial {
    /// What it is called: `reach-001`.
    pub name: String,
    /// What is done in it.
    pub action: &'static str,
    /// Which of the people who do the set: 1 or 2.
    pub performer: u32,
    /// Its parameters, of [`super::rows::PARAMETERS`].
    pub parameters: BTreeMap<&'static str, f64>,
    /// How far each may lie from that and still be it: half of what it differs by from its neighbours.
    pub beside: BTreeMap<&'static str, f64>,
}

/// Reaches are to points of a lattice of this width, m ...
const LATTICE_M: f64 = 0.2;
/// ... the 163 nearest to this point ...
const REACHES: usize = 163;
const MIDDLE_M: [f64; 3] = [0.3, -0.15, 1.0];
/// ... that are further than this from the vertical through the body ...
const BODY_M: f64 = 0.3;
/// ... and not behind it.
const BEHIND_M: f64 = -0.01;
/// Kicks are to a plane so far ahead, m.
const KICK_PLANE_M: f64 = 0.8;

fn round(value: f64) -> f64 {
    (value * 1e6).round() / 1e6
}

struct Filling {
    trials: Vec<PlannedTrial>,
}

impl Filling {
    fn push(
        &mut self,
        prefix: &str,
        (action, performer): (&'static str, u32),
        parameters: &[(&'static str, f64, f64)],
    ) {
        let count = self.trials.iter().filter(|of| of.name.starts_with(prefix)).count() + 1;
        let values = parameters.iter().map(|(name, value, _)| (*name, round(*value)));
        let beside = parameters.iter().map(|(name, _, beside)| (*name, *beside));
        self.trials.push(PlannedTrial {
            name: format!("{prefix}{count:03}"),
            action,
            performer,
            parameters: values.collect(),
            beside: beside.collect(),
        });
    }

    fn directions(&mut self, prefix: &str, action: &'static str, length_m: Option<(f64, f64)>) {
        for eighth in 0..8 {
            let mut parameters = vec![("direction_rad", f64::from(eighth) * FRAC_PI_4, 0.0)];
            parameters.extend(length_m.map(|(length_m, beside)| ("length_m", length_m, beside)));
            self.push(prefix, (action, 1), &parameters);
        }
    }
}

/// Points that are reached for: ahead, left, up, from the floor below the centre of mass, m.
fn reach_points() -> Vec<[f64; 3]> {
    let mut points = Vec::new();
    for (x, y, z) in
        (-2..=6).flat_map(|x| (-6..=6).flat_map(move |y| (0..=12).map(move |z| (x, y, z))))
    {
        let at = [x, y, z].map(|n| f64::from(n) * LATTICE_M);
        let is_body = at[0].hypot(at[1]) < BODY_M;
        if !is_body && at[0] > BEHIND_M {
            points.push(at);
        }
    }
    let away = |at: &[f64; 3]| {
        at.iter().zip(MIDDLE_M).map(|(at, middle)| (at - middle).powi(2)).sum::<f64>()
    };
    points.sort_by(|a, b| away(a).total_cmp(&away(b)).then(a[1].total_cmp(&b[1])));
    points.truncate(REACHES);
    points.sort_by(|a, b| {
        a[2].total_cmp(&b[2]).then(a[0].total_cmp(&b[0])).then(a[1].total_cmp(&b[1]))
    });
    points
}

fn generalisation() -> Vec<PlannedTrial> {
    let mut all = Filling { trials: Vec::new() };
    let target = |[x, y, z]: [f64; 3], beside: [f64; 3]| {
        [("target_x_m", x, beside[0]), ("target_y_m", y, beside[1]), ("target_z_m", z, beside[2])]
    };
    for at in reach_points() {
        all.push("reach-", ("reach", 1), &target(at, [0.04; 3]));
    }
    for row in 0..7 {
        let height_m = 0.3 + 0.05 * f64::from(row);
        all.push("sit-stand-", ("sit-stand", 1), &[("height_m", height_m, 0.02)]);
    }
    for (row, column) in (0..6).flat_map(|row| (0..6).map(move |column| (row, column))) {
        let at = [KICK_PLANE_M, -0.4 + 0.1 * f64::from(column), 0.36 + 0.08 * f64::from(row)];
        let [x, y, z] = target(at, [0.0, 0.03, 0.03]);
        all.push("kick-", ("kick", 1), &[x, y, z, ("speed_m_s", 4.0, 0.0)]);
    }
    for size in 1..=4 {
        all.directions("step-", "step", Some((0.1 * f64::from(size), 0.03)));
    }
    all.directions("hop-", "hop", Some((0.15, 0.03)));
    all.directions("jog-", "jog", None);
    all.directions("jump-", "jump", Some((0.2, 0.03)));
    all.directions("walk-", "walk", None);
    for step in 0..16 {
        let [x, y, z] = target([KICK_PLANE_M, -0.1, 0.5], [0.0; 3]);
        let speed = ("speed_m_s", 1.5 + 0.3 * f64::from(step), 0.1);
        all.push("kick-speed-", ("kick", 2), &[x, y, z, speed]);
    }
    for step in 0..9 {
        all.push("lift-", ("lift", 2), &[("load_kg", 2.0 * f64::from(step), 0.8)]);
    }
    for step in 0..35 {
        let [x, y, z] = target([0.4, -0.2, 1.2], [0.0; 3]);
        let speed = ("speed_m_s", 0.4 + 0.1 * f64::from(step), 0.04);
        all.push("reach-speed-", ("reach", 2), &[x, y, z, speed]);
    }
    all.trials
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Their Section 6.2.3: 270 trials of one person and 60 of another.
    #[test]
    fn the_generalisation_set_has_as_many_trials_as_that_of_the_database() {
        let trials = PlannedSet::Generalisation.trials();
        let count = |action: &str, performer: u32| {
            trials.iter().filter(|of| of.action == action && of.performer == performer).count()
        };
        let first = ["reach", "sit-stand", "kick", "step", "hop", "jog", "jump", "walk"];
        assert_eq!(first.map(|of| count(of, 1)), [163, 7, 36, 32, 8, 8, 8, 8]);
        assert_eq!(["kick", "lift", "reach"].map(|of| count(of, 2)), [16, 9, 35]);
        assert_eq!(trials.len(), 270 + 60);
        let mut names: Vec<&str> = trials.iter().map(|of| of.name.as_str()).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), 330, "each has a name of its own");
    }

    #[test]
    fn no_two_trials_of_a_performer_ask_for_the_same() {
        let trials = PlannedSet::Generalisation.trials();
        for (at, one) in trials.iter().enumerate() {
            for other in &trials[at + 1..] {
                let same = one.action == other.action
                    && one.performer == other.performer
                    && one.parameters == other.parameters;
                assert!(!same, "{} and {}", one.name, other.name);
            }
        }
    }
}
