use super::*;
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn sampled(chain: &Sequence, rate_hz: f64) -> Vec<f64> {
    let count = (chain.end_s() * rate_hz).round() as usize + 1;
    let mut samples = vec![0.0; count];
    chain.sample_into(rate_hz, &mut samples);
    samples
}

fn built(steps: &[(f64, f64, f64)]) -> Sequence {
    let start = Sequence::starting_at(0.0, 0.2).unwrap();
    steps.iter().fold(start, |chain, (duration, change, t)| {
        let to = chain.to_rad() + change;
        let shape = Shape::half_sine(*t).unwrap();
        if *change == 0.0 { chain.rest(*duration) } else { chain.then(*duration, to, shape) }
            .unwrap()
    })
}

fn same_actionlets(got: &Sequence, expected: &Sequence) {
    let (found, given) = (got.actionlets(), expected.actionlets());
    assert_eq!(found.len(), given.len(), "{found:#?}");
    for (found, given) in found.iter().zip(given) {
        assert!((found.end_s() - given.end_s()).abs() < 1e-3, "{found:?} is not {given:?}");
        assert!((found.to_rad() - given.to_rad()).abs() < 1e-4, "{found:?} is not {given:?}");
        let (Shape::HalfSine(a), Shape::HalfSine(b)) = (found.shape(), given.shape()) else {
            panic!("{found:?}");
        };
        assert!(given.is_rest() || (a.value() - b.value()).abs() < 5e-3, "{found:?}, {given:?}");
    }
}

#[test]
fn crossings_touches_and_rests_are_found() {
    // Up, up again after a touch, a rest, down, up.
    let chain = built(&[
        (0.5, 0.6, 0.3),
        (0.4, 0.5, 0.6),
        (0.3, 0.0, 0.5),
        (0.6, -0.9, 0.45),
        (0.5, 0.3, 0.5),
    ]);
    let got = decompose(&sampled(&chain, 120.0), 120.0, 1f64.to_radians()).unwrap();
    same_actionlets(&got.chain, &chain);
    assert_eq!(got.numbers(), 1 + 3 * 4 + 2);
}

#[test]
fn a_chain_comes_back_at_every_usual_rate() {
    let chain = built(&[(0.5, 0.6, 0.35), (0.7, -0.9, 0.55), (0.5, 0.4, 0.5), (0.8, 0.3, 0.4)]);
    for rate_hz in [60.0, 100.0, 120.0, 240.0, 1000.0] {
        let got = decompose(&sampled(&chain, rate_hz), rate_hz, 1f64.to_radians()).unwrap();
        same_actionlets(&got.chain, &chain);
        assert!(got.rms_rad < 1e-6, "{} at {rate_hz} Hz", got.rms_rad);
    }
}

#[test]
fn what_hardly_moves_is_one_number() {
    let samples: Vec<f64> = (0..500).map(|i| 0.3 + 0.005 * (f64::from(i) * 0.1).sin()).collect();
    let got = decompose(&samples, 120.0, 1f64.to_radians()).unwrap();
    assert_eq!(got.numbers(), 1);
    assert!((got.chain.from_rad() - 0.3).abs() < 1e-3);
}

#[test]
fn a_dearer_cut_is_taken_only_as_far_as_the_tolerance_asks() {
    // Three waves that begin and end at rest, as actionlets do.
    let wave = |i: i32| {
        let turn = f64::from(i) / 1200.0 * core::f64::consts::TAU;
        0.5 * (3.0 * turn).cos() + 0.2 * (11.0 * turn).cos() + 0.05 * (27.0 * turn).cos()
    };
    let samples: Vec<f64> = (0..=1200).map(wave).collect();
    let mut before = usize::MAX;
    for tolerance_deg in [0.5, 1.0, 2.0, 4.0f64] {
        let got = decompose(&samples, 120.0, tolerance_deg.to_radians()).unwrap();
        assert!(got.rms_rad <= tolerance_deg.to_radians(), "{tolerance_deg}: {}", got.rms_rad);
        assert!(got.numbers() <= before);
        before = got.numbers();
    }
    assert!(before < 100, "{before} numbers");
}

#[test]
fn unusable_series_are_refused() {
    let fine = [0.0, 0.1, 0.2, 0.1];
    assert!(decompose(&fine[..2], 100.0, 0.01).is_err());
    assert!(decompose(&[0.0, f64::NAN, 1.0], 100.0, 0.01).is_err());
    assert!(decompose(&fine, 0.0, 0.01).is_err());
    assert!(decompose(&fine, 100.0, 0.0).is_err());
    assert!(decompose(&fine, f64::NAN, 0.01).is_err());
}

/// The same samples with normally distributed noise (Box and Muller).
fn with_noise(samples: &[f64], size: f64, random: &mut ChaCha8Rng) -> Vec<f64> {
    let mut normal = || {
        let (one, other): (f64, f64) = (random.random(), random.random());
        (-2.0 * (1.0 - one).ln()).sqrt() * (core::f64::consts::TAU * other).cos()
    };
    samples.iter().map(|value| value + size * normal()).collect()
}

/// A chain of turns there and back, of a size that people make.
fn any_chain(random: &mut ChaCha8Rng) -> Sequence {
    let steps: Vec<_> = (0..12)
        .map(|i| {
            let change = random.random_range(0.15..1.0);
            let signed = if i % 2 == 0 { change } else { -change };
            (random.random_range(0.3..0.9), signed, random.random_range(0.25..0.75))
        })
        .collect();
    built(&steps)
}

fn moving(chain: &Sequence) -> usize {
    chain.actionlets().iter().filter(|piece| !piece.is_rest()).count()
}

#[test]
fn a_chain_that_ends_between_two_samples_returns_its_own() {
    for rate_hz in [60.0, 120.0] {
        for part in [-0.9, -0.5, -0.1, 0.1, 0.4, 0.8] {
            let last_s = 0.5 + part / rate_hz;
            let chain = built(&[(0.5, 0.6, 0.35), (0.7, -0.9, 0.55), (last_s, 0.5, 0.45)]);
            // The last sample is the one at 1.7 s: the chain ends before it, or after.
            let mut samples = vec![0.0; (1.7 * rate_hz).round() as usize + 1];
            chain.sample_into(rate_hz, &mut samples);
            let got = decompose(&samples, rate_hz, 1f64.to_radians()).unwrap();
            same_actionlets(&got.chain, &chain);
            assert!(got.rms_rad < 1e-6, "{part} at {rate_hz} Hz: {}", got.rms_rad);
        }
    }
}

#[test]
fn noise_is_told_from_motion_and_not_fitted() {
    let mut random = ChaCha8Rng::seed_from_u64(7);
    for (rate_hz, size_deg) in [(60.0, 1.0), (60.0, 2.0), (120.0, 0.5), (120.0, 2.0), (240.0, 2.0)]
    {
        let size = f64::to_radians(size_deg);
        let (mut found, mut given) = (0, 0);
        for _ in 0..12 {
            let chain = any_chain(&mut random);
            let clean = sampled(&chain, rate_hz);
            let noisy = with_noise(&clean, size, &mut random);
            let got = decompose(&noisy, rate_hz, 1f64.to_radians()).unwrap();
            found += moving(&got.chain);
            given += moving(&chain);
            assert!((got.noise_rad / size - 1.0).abs() < 0.25, "{size_deg}: {}", got.noise_rad);
            let mut again = vec![0.0; clean.len()];
            got.chain.sample_into(rate_hz, &mut again);
            let squares = again.iter().zip(&clean).map(|(got, given)| (got - given).powi(2));
            let error_deg = (squares.sum::<f64>() / clean.len() as f64).sqrt().to_degrees();
            assert!(error_deg <= 1.5, "{rate_hz} Hz, {size_deg} deg of noise: {error_deg} deg off");
        }
        let times = found as f64 / given as f64;
        assert!(
            times <= 1.3,
            "{rate_hz} Hz, {size_deg} deg of noise: {times} times the actionlets"
        );
    }
}

#[test]
fn still_noise_is_one_number() {
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let noisy = with_noise(&[0.3; 600], 2f64.to_radians(), &mut random);
    let got = decompose(&noisy, 120.0, 1f64.to_radians()).unwrap();
    assert_eq!(got.numbers(), 1);
    assert!((got.chain.from_rad() - 0.3).abs() < 0.01);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn a_series_made_of_actionlets_returns_its_own(
        steps in prop::collection::vec((0.3..0.9f64, 0.15..1.0f64, 0.25..0.75f64), 1..8),
    ) {
        // One direction after another, so that no seam is a touch.
        let steps: Vec<_> = steps
            .into_iter()
            .enumerate()
            .map(|(i, (d, change, t))| (d, if i % 2 == 0 { change } else { -change }, t))
            .collect();
        let whole = |d: f64| (d * 240.0).round() / 240.0;
        let steps: Vec<_> = steps.into_iter().map(|(d, c, t)| (whole(d), c, t)).collect();
        let chain = built(&steps);
        let got = decompose(&sampled(&chain, 240.0), 240.0, 1f64.to_radians()).unwrap();
        same_actionlets(&got.chain, &chain);
    }

    #[test]
    fn any_series_gives_a_chain_of_its_length(
        samples in prop::collection::vec(-3.0..3.0, 3..200),
        rate_hz in 20.0..300.0,
    ) {
        let got = decompose(&samples, rate_hz, 0.02).unwrap();
        let duration_s = (samples.len() - 1) as f64 / rate_hz;
        prop_assert!((got.chain.end_s() - duration_s).abs() < 1e-9);
        prop_assert!(got.rms_rad.is_finite());
    }
}
