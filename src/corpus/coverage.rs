//! Which people a corpus lacks.
//!
//! People are points of stature and mass, each scaled to 0 to 1. The next to be asked is the one furthest from all who
//! are there, inside the hull of what people are: of the places that are nearest to three people at once (the vertices
//! of their Voronoi diagram), or to two on the edge of the hull, or a corner of it (Guerra-Filho and Biswas, "The
//! human motion database: A cognitive and parametric sampling of human motion", Image and Vision Computing 30, 2012).
//! The hull is ours: from 1 to 2 m, as lean and as heavy as people of that stature are.

use glam::DVec2;
use serde::Serialize;

/// Stature, m, with the least and the greatest body mass index there, kg/m²: corners of the hull. Ours, so wide that few people
/// are outside.
const HULL: [(f64, f64, f64); 4] =
    [(1.0, 13.0, 22.0), (1.3, 13.0, 26.0), (1.6, 17.0, 40.0), (2.0, 17.0, 40.0)];
/// What stature and mass are scaled by: least and greatest of the hull, m and kg.
const STATURE_M: [f64; 2] = [1.0, 2.0];
const MASS_KG: [f64; 2] = [13.0, 160.0];
/// Most people among whom places are looked for: the others are as far as they were.
const MOST: usize = 100;
/// Years of age of each group, and statures that people of it have, m. The last has no end.
const AGES: [([u32; 2], [f64; 2]); 5] = [
    ([7, 12], [1.05, 1.65]),
    ([13, 17], [1.35, 1.95]),
    ([18, 39], [1.40, 2.05]),
    ([40, 64], [1.40, 2.05]),
    ([65, 120], [1.40, 1.95]),
];

/// Somebody whose stature and mass are known.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct KnownPerson {
    /// Stature, m.
    pub stature_m: f64,
    /// Mass, kg.
    pub mass_kg: f64,
    /// Age, years, if it is known.
    pub age_years: Option<f64>,
    /// Gender, in their words; may be empty.
    pub gender: String,
}

/// Somebody to be asked next.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NextPerson {
    /// About this stature, m.
    pub stature_m: f64,
    /// About this mass, kg.
    pub mass_kg: f64,
    /// Of an age from and to, years: the group of which there are fewest, among those of that stature.
    pub age_years: [u32; 2],
    /// Of this gender, if some are rarer than others.
    pub gender: Option<String>,
    /// How far from whoever is nearest, as a part of the range of stature and mass.
    pub distance: f64,
}

/// Which of [`AGES`] are young adults.
const ADULTS: usize = 2;

/// A place of stature and mass.
fn place(stature_m: f64, mass_kg: f64) -> DVec2 {
    let scaled = |value: f64, [low, high]: [f64; 2]| (value - low) / (high - low);
    DVec2::new(scaled(stature_m, STATURE_M), scaled(mass_kg, MASS_KG))
}

/// The corners of the hull, one after the other round it, m and kg.
#[must_use]
pub fn hull() -> Vec<(f64, f64)> {
    let mass = |stature_m: f64, index: f64| (stature_m, index * stature_m * stature_m);
    let below = HULL.iter().map(|(stature_m, low, _)| mass(*stature_m, *low));
    let above = HULL.iter().rev().map(|(stature_m, _, high)| mass(*stature_m, *high));
    below.chain(above).collect()
}

/// Whether a place lies in a polygon: how often a ray from it crosses its edges.
fn is_inside(corners: &[DVec2], at: DVec2) -> bool {
    edges(corners).fold(false, |inside, (from, to)| {
        let crosses = (from.y > at.y) != (to.y > at.y)
            && at.x < (to.x - from.x) * (at.y - from.y) / (to.y - from.y) + from.x;
        inside != crosses
    })
}

fn edges(corners: &[DVec2]) -> impl Iterator<Item = (DVec2, DVec2)> + '_ {
    corners.iter().copied().zip(corners.iter().copied().cycle().skip(1))
}

/// The place that is as far from three others; none if they are on a line.
fn between_three([a, b, c]: [DVec2; 3]) -> Option<DVec2> {
    let (b, c) = (b - a, c - a);
    let twice = 2.0 * b.perp_dot(c);
    if twice.abs() < 1e-12 {
        return None;
    }
    let (bb, cc) = (b.length_squared(), c.length_squared());
    Some(a + DVec2::new(c.y * bb - b.y * cc, b.x * cc - c.x * bb) / twice)
}

/// The place of an edge that is as far from two others; none if there is none.
fn between_two(a: DVec2, b: DVec2, (from, to): (DVec2, DVec2)) -> Option<DVec2> {
    let along = to - from;
    let slope = 2.0 * along.dot(b - a);
    let part = ((b.length_squared() - a.length_squared()) - 2.0 * from.dot(b - a)) / slope;
    (0.0..=1.0).contains(&part).then(|| from + along * part)
}

/// The place in the hull that is furthest from all others, and how far.
fn emptiest(corners: &[DVec2], people: &[DVec2]) -> Option<(DVec2, f64)> {
    let seen = &people[..people.len().min(MOST)];
    let mut places: Vec<DVec2> = corners.to_vec();
    for (i, a) in seen.iter().enumerate() {
        for (j, b) in seen.iter().enumerate().skip(i + 1) {
            places.extend(edges(corners).filter_map(|edge| between_two(*a, *b, edge)));
            places.extend(seen[j + 1..].iter().filter_map(|c| between_three([*a, *b, *c])));
        }
    }
    let on_edge = |at: DVec2| {
        edges(corners).any(|(from, to)| {
            let part = (at - from).dot(to - from) / (to - from).length_squared();
            (0.0..=1.0).contains(&part) && (from + (to - from) * part).distance(at) < 1e-9
        })
    };
    let away = |at: DVec2| people.iter().map(|of| of.distance(at)).fold(f64::MAX, f64::min);
    let inside = places.into_iter().filter(|at| is_inside(corners, *at) || on_edge(*at));
    inside.map(|at| (at, away(at))).max_by(|one, other| one.1.total_cmp(&other.1))
}

/// Who is to be asked next, one after the other, as if each came.
#[must_use]
pub fn next_people(known: &[KnownPerson], count: usize) -> Vec<NextPerson> {
    let corners: Vec<DVec2> = hull().iter().map(|(stature, mass)| place(*stature, *mass)).collect();
    let mut people: Vec<DVec2> = known.iter().map(|of| place(of.stature_m, of.mass_kg)).collect();
    let mut ages: Vec<usize> = AGES.iter().map(|(years, _)| of_age(known, *years)).collect();
    let mut genders: Vec<(String, usize)> = Vec::new();
    for of in known.iter().filter(|of| !of.gender.is_empty()) {
        match genders.iter_mut().find(|(gender, _)| *gender == of.gender) {
            Some((_, count)) => *count += 1,
            None => genders.push((of.gender.clone(), 1)),
        }
    }
    genders.sort();
    let mut next = Vec::new();
    for _ in 0..count {
        let found = if people.is_empty() {
            // Of nobody everybody is as far: an adult in the middle.
            Some((place(1.7, 23.0 * 1.7 * 1.7), 1.0))
        } else {
            emptiest(&corners, &people)
        };
        let Some((at, distance)) = found else { break };
        let stature_m = STATURE_M[0] + at.x * (STATURE_M[1] - STATURE_M[0]);
        let mass_kg = MASS_KG[0] + at.y * (MASS_KG[1] - MASS_KG[0]);
        let fits = |group: &usize| {
            let [low, high] = AGES[*group].1;
            (low..=high).contains(&stature_m)
        };
        // Of the ages of which there are as few, an adult's comes first.
        let rank = |group: &usize| (ages[*group], group.abs_diff(ADULTS));
        let group = (0..AGES.len()).filter(fits).min_by_key(rank).unwrap_or(0);
        ages[group] += 1;
        let rarest = genders.iter_mut().min_by_key(|of| of.1).map(|of| {
            of.1 += 1;
            of.0.clone()
        });
        people.push(at);
        next.push(NextPerson {
            stature_m,
            mass_kg,
            age_years: AGES[group].0,
            gender: rarest,
            distance,
        });
    }
    next
}

fn of_age(known: &[KnownPerson], [from, to]: [u32; 2]) -> usize {
    let years = f64::from(from)..f64::from(to) + 1.0;
    known.iter().filter(|of| of.age_years.is_some_and(|age| years.contains(&age))).count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn person(stature_m: f64, mass_kg: f64) -> KnownPerson {
        KnownPerson { stature_m, mass_kg, ..KnownPerson::default() }
    }

    /// How far a place is from whoever is nearest.
    fn away(known: &[KnownPerson], stature_m: f64, mass_kg: f64) -> f64 {
        let at = place(stature_m, mass_kg);
        known.iter().map(|of| place(of.stature_m, of.mass_kg).distance(at)).fold(f64::MAX, f64::min)
    }

    proptest! {
        /// Looked for on a grid of 1 cm and 1 kg, which knows nothing of diagrams.
        #[test]
        fn nobody_in_the_hull_is_further_from_those_who_are_there_than_the_next(
            people in proptest::collection::vec((1.0..2.0f64, 15.0..150.0f64), 1..12),
        ) {
            let known: Vec<KnownPerson> = people.iter().map(|(s, m)| person(*s, *m)).collect();
            let next = next_people(&known, 1).remove(0);
            prop_assert!((away(&known, next.stature_m, next.mass_kg) - next.distance).abs() < 1e-9);
            let corners: Vec<DVec2> = hull().iter().map(|(s, m)| place(*s, *m)).collect();
            for stature in 0..=100 {
                for mass in 13..=160 {
                    let (s, m) = (1.0 + f64::from(stature) / 100.0, f64::from(mass));
                    if is_inside(&corners, place(s, m)) {
                        let grid = away(&known, s, m);
                        prop_assert!(grid <= next.distance + 1e-9, "{s} m, {m} kg: {grid}");
                    }
                }
            }
        }
    }

    #[test]
    fn the_rarer_gender_and_the_rarest_age_of_that_stature_are_asked_for() {
        let of = |gender: &str, age: f64| KnownPerson {
            gender: gender.to_owned(),
            age_years: Some(age),
            ..person(1.7, 70.0)
        };
        let known = [of("female", 20.0), of("female", 25.0), of("male", 30.0)];
        let next = next_people(&known, 2);
        assert_eq!(next[0].gender.as_deref(), Some("male"));
        for of in &next {
            let [low, high] = of.age_years;
            assert!(high < 18 || low >= 40, "{of:?}");
            assert!(low < 18 || of.stature_m >= 1.4, "{of:?}");
        }
        assert_ne!(next[0].stature_m, next[1].stature_m);
    }

    #[test]
    fn an_empty_corpus_begins_in_the_middle_and_a_hundred_more_fill_the_hull() {
        let next = next_people(&[], 60);
        assert_eq!(next.len(), 60);
        assert!((next[0].stature_m - 1.7).abs() < 1e-9);
        assert!(next[59].distance < 0.12, "{}", next[59].distance);
        assert!(next.windows(2).skip(1).all(|two| two[1].distance <= two[0].distance + 1e-9));
    }
}
