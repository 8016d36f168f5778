//! Sets that a corpus may be filled with: which trials they ask for.
//!
//! They are those of the Human Motion Database (Guerra-Filho and Biswas, "The human motion database: A cognitive and
//! parametric sampling of human motion", Image and Vision Computing 30, 2012): actions that words name, the same
//! actions by many people, one action for each of many targets, several actions at once or one after another, actions
//! that run into each other, and what two people do together. How many trials the generalisation set has of each
//! action is theirs; which targets, and which words and pairs the other sets have, is ours (`sets/*.csv`).

use crate::error::counted;
use core::f64::consts::{FRAC_PI_4, FRAC_PI_8};
use serde::Serialize;
use std::collections::BTreeMap;

/// The vocabulary: what is said to whoever does it, whether it is concrete, observable and voluntary, and why an
/// action is left out.
const PRAXICON: &str = include_str!("sets/praxicon.csv");
/// What is made of several actions, and what two people do.
const COMPOSITES: &str = include_str!("sets/composites.csv");
/// So many actions of the vocabulary, by so many people, are the cross-validation set.
const CROSS_ACTIONS: usize = 70;
const CROSS_PEOPLE: u32 = 50;
/// Good repetitions of an action that a set wants of each who does it.
const REPETITIONS: u32 = 10;

/// A set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlannedSet {
    /// Each action of the vocabulary, by one person.
    Praxicon,
    /// Seventy actions by fifty people.
    CrossValidation,
    /// One action for each of many targets, directions, heights, speeds and loads.
    Generalisation,
    /// Two actions at once, or one after the other.
    Composition,
    /// Two actions, the second of which begins before the first ends.
    CoArticulation,
    /// What two people do together.
    Interaction,
}

impl PlannedSet {
    /// All of them.
    pub const ALL: [Self; 6] = [
        Self::Praxicon,
        Self::CrossValidation,
        Self::Generalisation,
        Self::Composition,
        Self::CoArticulation,
        Self::Interaction,
    ];

    /// As a word.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Praxicon => "praxicon",
            Self::CrossValidation => "cross-validation",
            Self::Generalisation => "generalisation",
            Self::Composition => "composition",
            Self::CoArticulation => "co-articulation",
            Self::Interaction => "interaction",
        }
    }

    /// The set of a word.
    #[must_use]
    pub fn of(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|set| set.word() == word)
    }

    /// Its trials, in their order.
    #[must_use]
    pub fn trials(self) -> Vec<PlannedTrial> {
        match self {
            Self::Praxicon => praxicon(1),
            Self::CrossValidation => {
                let mut all = praxicon(CROSS_PEOPLE);
                all.truncate(CROSS_ACTIONS);
                all
            }
            Self::Generalisation => generalisation(),
            Self::Composition | Self::Interaction => composites(self).collect(),
            Self::CoArticulation => composites(self).flat_map(in_eight_directions).collect(),
        }
    }
}

/// A row of one of the tables, whose texts may stand in quotation marks.
fn fields(line: &'static str) -> Vec<&'static str> {
    let mut fields = Vec::new();
    let mut rest = line;
    loop {
        let (field, after) = match rest.strip_prefix('"').and_then(|text| text.split_once('"')) {
            Some((field, after)) => (field, after.strip_prefix(',')),
            None => {
                rest.split_once(',').map_or((rest, None), |(field, after)| (field, Some(after)))
            }
        };
        fields.push(field);
        let Some(after) = after else { return fields };
        rest = after;
    }
}

fn rows<const N: usize>(table: &'static str) -> impl Iterator<Item = [&'static str; N]> {
    table.lines().skip(1).filter_map(|line| fields(line).try_into().ok())
}

/// An action of the vocabulary.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Verb {
    /// Its name.
    pub action: &'static str,
    /// What is said to whoever does it.
    pub explain: &'static str,
    /// Whether it is a thing one does, and not one one thinks of.
    pub concrete: bool,
    /// Whether it is seen.
    pub observable: bool,
    /// Whether it is done at will.
    pub voluntary: bool,
    /// Why it is left out; empty if it is not.
    pub dropped: &'static str,
}

/// The vocabulary, with what is left out of it.
pub fn vocabulary() -> impl Iterator<Item = Verb> {
    rows(PRAXICON).map(|[action, explain, concrete, observable, voluntary, dropped]| Verb {
        action,
        explain,
        concrete: concrete == "yes",
        observable: observable == "yes",
        voluntary: voluntary == "yes",
        dropped,
    })
}

fn whole(action: &'static str, explain: &str, people: u32) -> PlannedTrial {
    PlannedTrial {
        name: action.replace('+', "-and-").replace('>', "-then-"),
        action,
        performer: 1,
        parameters: BTreeMap::new(),
        beside: BTreeMap::new(),
        explain: explain.to_owned(),
        people,
        together: false,
        repetitions: REPETITIONS,
    }
}

fn praxicon(people: u32) -> Vec<PlannedTrial> {
    let kept = vocabulary().filter(|word| word.dropped.is_empty());
    kept.map(|word| whole(word.action, word.explain, people)).collect()
}

fn composites(set: PlannedSet) -> impl Iterator<Item = PlannedTrial> {
    let own = rows(COMPOSITES).filter(move |[of, ..]: &[&str; 4]| *of == set.word());
    own.map(|[_, action, people, explain]| PlannedTrial {
        together: people == "2",
        ..whole(action, explain, 1)
    })
}

/// The same, with a step ahead and, in turn, further to the right.
fn in_eight_directions(of: PlannedTrial) -> impl Iterator<Item = PlannedTrial> {
    (0..8_u32).map(move |eighth| {
        let (name, explain) = (&of.name, of.explain.trim_end_matches('.'));
        let turn = counted(45 * eighth, "degree");
        PlannedTrial {
            name: format!("{name}-{:03}", eighth + 1),
            explain: format!("{explain}. Step {turn} to the right of straight ahead."),
            parameters: [("direction_rad", round(f64::from(eighth) * FRAC_PI_4))].into(),
            beside: [("direction_rad", FRAC_PI_8)].into(),
            ..of.clone()
        }
    })
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
    /// What is said to whoever does it.
    pub explain: String,
    /// How many people are to do it, each on their own.
    pub people: u32,
    /// Whether two people do it together.
    pub together: bool,
    /// Good repetitions wanted of each.
    pub repetitions: u32,
}

impl PlannedTrial {
    /// The actions it is made of, which are done alone in other trials: `walk` and `wave` of `walk+wave`; none of an
    /// action that is one.
    pub fn parts(&self) -> impl Iterator<Item = &'static str> {
        let several = self.action.contains(['+', '>']);
        self.action.split(['+', '>']).filter(move |_| several)
    }

    /// Whether a trial of this action and these parameters is it.
    #[must_use]
    pub fn is(&self, action: &str, parameters: &BTreeMap<String, f64>) -> bool {
        let near = |(name, value): (&&'static str, &f64)| {
            // What nothing is said of must be the same, but for what a person may be off by.
            let beside = self.beside.get(name).copied().unwrap_or(0.0).max(NEAR);
            parameters.get(*name).is_some_and(|own| (own - value).abs() <= beside)
        };
        self.action == action && self.parameters.iter().all(near)
    }
}

/// How far a parameter may be off of which a set does not say how far, in its own unit.
const NEAR: f64 = 0.02;

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

/// What is said to whoever does it: places as seen from where they stand.
fn explain(action: &str, parameters: &[(&'static str, f64, f64)]) -> String {
    let of = |name: &str| parameters.iter().find(|of| of.0 == name).map(|of| of.1);
    let mut said = match action {
        "reach" => "Reach with the right hand".to_owned(),
        "kick" => "Kick with the right foot".to_owned(),
        "sit-stand" => "Sit down and stand up".to_owned(),
        "lift" => "Lift a box with both hands".to_owned(),
        _ => format!("{}{}", action[..1].to_uppercase(), &action[1..]),
    };
    if let (Some(x), Some(y), Some(z)) = (of("target_x_m"), of("target_y_m"), of("target_z_m")) {
        let side = if y > 0.0 { "left" } else { "right" };
        said.push_str(&format!(", to {x:.2} m ahead, {:.2} m to the {side}, {z:.2} m up", y.abs()));
    }
    if let Some(direction_rad) = of("direction_rad") {
        let degrees = direction_rad.to_degrees();
        said.push_str(&format!(", {degrees:.0} degrees to the right of straight ahead"));
    }
    for (name, words) in [
        ("length_m", "m far"),
        ("height_m", "m high is the seat"),
        ("speed_m_s", "m/s fast"),
        ("load_kg", "kg heavy"),
    ] {
        if let Some(value) = of(name) {
            said.push_str(&format!(", {value:.2} {words}"));
        }
    }
    said + "."
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
            explain: explain(action, parameters),
            people: 1,
            together: false,
            repetitions: 1,
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

    #[test]
    fn every_word_left_out_says_why_and_the_others_are_concrete_observable_and_voluntary() {
        let words: Vec<Verb> = vocabulary().collect();
        assert_eq!(words.len(), PRAXICON.lines().count() - 1, "every line is a row");
        for word in &words {
            let fits = word.concrete && word.observable && word.voluntary;
            assert!(fits || !word.dropped.is_empty(), "{}", word.action);
            assert!(word.explain.ends_with('.'), "{}: {}", word.action, word.explain);
        }
        let planned = PlannedSet::CrossValidation.trials();
        assert_eq!(planned.iter().map(|of| u64::from(of.people)).sum::<u64>(), 3500);
        assert!(PlannedSet::Praxicon.trials().len() < words.len());
    }

    #[test]
    fn parts_of_composite_trials_are_trials_of_other_sets_and_names_are_names_of_a_session() {
        let mut alone: Vec<&str> =
            PlannedSet::Praxicon.trials().iter().map(|of| of.action).collect();
        alone.extend(PlannedSet::Generalisation.trials().iter().map(|of| of.action));
        let mut composites = 0;
        for set in PlannedSet::ALL {
            let trials = set.trials();
            for trial in &trials {
                let fits = |b: u8| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'-';
                assert!(trial.name.bytes().all(fits), "{}", trial.name);
                assert!(trial.parts().all(|part| alone.contains(&part)), "{}", trial.action);
                assert!(!trial.explain.is_empty() && !trial.explain.contains("NaN"));
                composites += usize::from(trial.parts().count() > 1);
            }
            let mut names: Vec<&str> = trials.iter().map(|of| of.name.as_str()).collect();
            names.sort_unstable();
            names.dedup();
            assert_eq!(names.len(), trials.len(), "{}", set.word());
        }
        assert_eq!(composites, 30 + 2 * 8);
    }

    #[test]
    fn a_trial_is_planned_if_its_parameters_are_nearer_than_half_way_to_the_next() {
        let reach = PlannedSet::Generalisation.trials().into_iter().next().expect("a reach");
        let mut own: BTreeMap<String, f64> =
            reach.parameters.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect();
        assert!(reach.is("reach", &own) && !reach.is("kick", &own));
        *own.get_mut("target_x_m").expect("x") += 0.03;
        assert!(reach.is("reach", &own));
        *own.get_mut("target_x_m").expect("x") += 0.05;
        assert!(!reach.is("reach", &own));
        assert!(!reach.is("reach", &BTreeMap::new()));
    }
}
