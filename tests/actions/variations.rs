//! Variations of actions stand on their feet, and still differ.

use gaitway::action::corpus::{Corpus, VariationStatus, Variations, Varied};
use gaitway::action::{Database, Join, Motion, Spread, mutate, phrase};
use gaitway::actionlet::Shape;
use gaitway::body::contact::Footing;
use gaitway::body::{Dof, PelvisAngles, Proportions};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

const RATE_HZ: f64 = 250.0;
const COUNT: u32 = 40;

fn corpus(action: &str, spread: Spread) -> Corpus {
    Corpus {
        label: action.to_owned(),
        parts: phrase::load(action).expect("an action"),
        join: Join::Transition,
        spread,
        database: Database::shipped().expect("actions"),
        seed: 5,
        rate_hz: 60.0,
        body: Proportions::of_stature(1.75).expect("a body"),
        has_points: false,
    }
}

fn variations(action: &str, spread: Spread) -> Vec<Varied> {
    let made = Variations::of(corpus(action, spread)).expect("it can be performed");
    (0..COUNT).map(|number| made.variation(number).expect("a variation")).collect()
}

/// As they would be if nobody looked at their feet.
fn drawn(action: &str) -> Vec<Motion> {
    let Corpus { parts, spread, database, .. } = corpus(action, Spread::default());
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let draw = |_| mutate(&parts[0].action, &spread, &database, &mut random).perform();
    (0..COUNT).map(draw).collect::<Result<_, _>>().expect("motions")
}

fn footing(motion: &Motion) -> Footing {
    let body = Proportions::of_stature(1.75).expect("a body");
    let poses = motion.poses(&body, RATE_HZ).expect("poses");
    Footing::of(&body, &poses, RATE_HZ).expect("told")
}

/// Angles at seams and T of all actionlets that move.
fn seams(motion: &Motion) -> (Vec<f64>, Vec<f64>) {
    let angles = motion.moving().map(|(_, piece)| piece.to_rad()).collect();
    let peak = |piece: &Shape| match piece {
        Shape::HalfSine(peak_at) => peak_at.value(),
        _ => f64::NAN,
    };
    (angles, motion.moving().map(|(_, piece)| peak(piece.shape())).collect())
}

/// Root of the mean of the variances at each place.
fn spread_of(rows: &[Vec<f64>]) -> f64 {
    let count = rows.len() as f64;
    let places = rows[0].len();
    let variance = |place: usize| {
        let mean = rows.iter().map(|row| row[place]).sum::<f64>() / count;
        rows.iter().map(|row| (row[place] - mean).powi(2)).sum::<f64>() / count
    };
    ((0..places).map(variance).sum::<f64>() / places as f64).sqrt()
}

#[test]
fn feet_of_variations_hold_and_few_are_rejected() {
    // Of 600 less than a third of runs is repaired; so few scatter.
    for (action, most_repaired, slides_m, root_m_s2) in [
        ("walk", 0.3, 0.005, 18.0),
        ("run", 0.45, 0.005, 18.0),
        ("jump", 0.3, 0.005, 18.0),
        ("kick-r", 0.2, 0.005, 18.0),
        ("box-r", 0.1, 0.005, 18.0),
        ("hop", 0.1, 0.005, 18.0),
        ("throw-r", 0.1, 0.005, 18.0),
    ] {
        let made = variations(action, Spread::default());
        let rejected: u32 = made.iter().map(|varied| varied.rejected).sum();
        let repaired = made.iter().filter(|v| v.status == VariationStatus::Repaired).count();
        println!("{action}: {repaired} of {COUNT} repaired, {rejected} draws rejected");
        for (number, varied) in made.iter().enumerate() {
            assert_ne!(varied.status, VariationStatus::Implausible, "{action} {number}");
            let footing = footing(&varied.motion);
            let told = format!(
                "{action} {number}: {:.1} mm, slides {:.1} mm, {:.1} m/s2",
                footing.lowest_m() * 1e3,
                footing.slide_m() * 1e3,
                footing.root_acceleration_m_s2()
            );
            assert!(footing.lowest_m() > -0.001, "{told}");
            assert!(footing.slide_m() < slides_m, "{told}");
            let flies = footing.flying(0..varied.motion.pose_count(RATE_HZ).expect("poses")) > 0.0;
            let most_m_s2 = if flies { 40.0 } else { root_m_s2 };
            assert!(footing.root_acceleration_m_s2() < most_m_s2, "{told}");
            // Hops go on and on, and wander.
            let comes_back = !["walk", "run", "hop"].contains(&action);
            assert!(!comes_back || footing.travel_m().1 < 0.02, "{told}, {:?}", footing.travel_m());
        }
        let share = f64::from(rejected) / f64::from(COUNT + rejected);
        assert!(share <= 0.1, "{action}: {rejected}");
        assert!(repaired as f64 <= most_repaired * f64::from(COUNT), "{action}: {repaired}");
    }
}

#[test]
fn as_they_are_drawn_feet_would_slide() {
    let slides = drawn("walk").iter().filter(|motion| footing(motion).slide_m() > 0.005).count();
    assert!(slides > COUNT as usize / 2, "{slides} of {COUNT}");
}

#[test]
fn variations_whose_feet_hold_spread_about_as_far_as_what_is_drawn() {
    for action in ["walk", "kick-r", "box-r"] {
        let made = variations(action, Spread::default());
        let drawn = drawn(action);
        let of = |motions: &[&Motion]| {
            let (angles, peaks): (Vec<_>, Vec<_>) = motions.iter().map(|m| seams(m)).unzip();
            let durations: Vec<Vec<f64>> = motions.iter().map(|m| vec![m.duration_s()]).collect();
            [spread_of(&angles), spread_of(&peaks), spread_of(&durations)]
        };
        let taken = of(&made.iter().map(|varied| &varied.motion).collect::<Vec<_>>());
        let drawn = of(&drawn.iter().collect::<Vec<_>>());
        println!("{action}: angles, T, durations {taken:?} of {drawn:?}");
        // Where two feet stand at once, the joints of both legs decide together: they vary less.
        let least = if action == "walk" { [0.6, 0.5, 0.7] } else { [0.7; 3] };
        for ((taken, drawn), least) in taken.into_iter().zip(drawn).zip(least) {
            assert!(taken > least * drawn, "{action}: {taken} of {drawn}");
        }
    }
}

#[test]
fn strides_of_one_walk_differ_about_half_as_much_as_a_persons() {
    let turns = |motion: &Motion| -> Vec<f64> {
        let knee = motion.track(Dof::LeftKneeFlexion).actionlets();
        // Where it is bent most: in swing, once a stride.
        let most = knee.iter().map(|piece| piece.to_rad()).filter(|rad| *rad > 0.8);
        most.collect()
    };
    let deviations = |stride: f64| -> Vec<f64> {
        let spread = Spread { stride, ..Spread::default() };
        let made = variations("walk:x6", spread);
        made.iter()
            .map(|varied| {
                // The first and the last belong to its ends.
                let turns = turns(&varied.motion);
                let turns: Vec<Vec<f64>> =
                    turns[1..turns.len() - 1].iter().map(|rad| vec![*rad]).collect();
                spread_of(&turns).to_degrees()
            })
            .collect()
    };
    assert!(deviations(0.0).iter().all(|deg| *deg < 1e-9));
    let usual = deviations(1.0);
    let mean_deg = usual.iter().sum::<f64>() / usual.len() as f64;
    // Helwig and Hsiao-Wecksler, "Multivariate Gait Data": 1.1 deg, from 0.75 to 1.24 times that by person.
    // What a knee may do by itself and both feet still stand is about half of that.
    println!("strides differ by {mean_deg:.2} deg");
    assert!((0.4..1.7).contains(&mean_deg), "{mean_deg}");
}

#[test]
fn bodies_and_headings_vary_on_request() {
    let spread = Spread { stature: 0.05, heading_rad: 3.0, ..Spread::default() };
    let made = variations("kick-r", spread);
    let statures: Vec<Vec<f64>> = made.iter().map(|v| vec![v.body.stature_m()]).collect();
    assert!((spread_of(&statures) - 1.75 * 0.05 / 3.0_f64.sqrt()).abs() < 0.015);
    let headings = made.iter().map(|varied| {
        let placed = varied.motion.placed(&varied.body, 10.0).expect("poses");
        vec![PelvisAngles::of(placed[0].1).rotation_rad]
    });
    let headings: Vec<Vec<f64>> = headings.collect();
    assert!((spread_of(&headings) - 3.0_f64.sqrt()).abs() < 0.5, "{}", spread_of(&headings));
    for varied in variations("kick-r", Spread::default()) {
        assert_eq!(varied.body.stature_m(), 1.75);
    }
}

#[test]
fn an_action_whose_own_feet_slide_is_varied_as_it_is_and_said_to_be_implausible() {
    let mut corpus = corpus("kick-r", Spread::default());
    let action = &mut corpus.parts[0].action;
    let knee = action.tracks().find(|track| track.dof == Dof::LeftKneeFlexion).expect("a knee");
    let waveform = knee.waveform;
    for turn in &mut action.waveforms[waveform] {
        turn.angle_rad += 0.3 * (turn.at * core::f64::consts::PI).sin();
    }
    let made = Variations::of(corpus).expect("it can be performed");
    let varied = made.variation(0).expect("a variation");
    assert_eq!((varied.status, varied.rejected), (VariationStatus::Implausible, 1));
}
