use super::*;
use proptest::prelude::*;

fn cubic(t: f64) -> [f64; 4] {
    // 2 t^3 - 3 t^2 + 0.5 t - 1 and its derivatives.
    [
        2.0 * t.powi(3) - 3.0 * t * t + 0.5 * t - 1.0,
        6.0 * t * t - 6.0 * t + 0.5,
        12.0 * t - 6.0,
        12.0,
    ]
}

#[test]
fn a_clamped_spline_through_a_cubic_is_that_cubic() {
    let values: Vec<f64> = (0..=6).map(|i| cubic(f64::from(i) * 0.25)[0]).collect();
    let ends = (End::Velocity(cubic(0.0)[1]), End::Velocity(cubic(1.5)[1]));
    let spline = Spline::through(values, 0.25, ends.0, ends.1).unwrap();
    for i in 0..=150 {
        let t = f64::from(i) * 0.01;
        let got = spline.sample(t);
        for (derivative, value) in got.into_iter().enumerate() {
            assert!((value - cubic(t)[derivative]).abs() < 1e-12, "{derivative} at {t}");
        }
    }
    let extremes = spline.extremes();
    // 6 t^2 - 6 t + 0.5 = 0 at t = (6 + sqrt(24)) / 12; the greatest value is at the end.
    let low = (6.0 + 24f64.sqrt()) / 12.0;
    assert!((extremes.position.min.time_s - low).abs() < 1e-12);
    assert!((extremes.position.min.value - cubic(low)[0]).abs() < 1e-12);
    assert_eq!(extremes.position.max.time_s, 1.5);
    assert!((extremes.position.max.value - -0.25).abs() < 1e-12);
    assert!((extremes.velocity.min.time_s - 0.5).abs() < 1e-12);
    assert!((extremes.velocity.min.value - -1.0).abs() < 1e-12);
    assert!((extremes.velocity.max.value - 5.0).abs() < 1e-12);
    assert!((extremes.acceleration.min.value - -6.0).abs() < 1e-12);
    assert!((extremes.acceleration.max.value - 12.0).abs() < 1e-12);
    assert!((extremes.jerk.peak().value - 12.0).abs() < 1e-9);
}

#[test]
fn two_points_without_conditions_are_a_straight_line() {
    let spline = Spline::through(vec![1.0, 3.0], 0.5, End::Free, End::Free).unwrap();
    assert_eq!(spline.sample(0.25), [2.0, 4.0, 0.0]);
}

#[test]
fn outside_its_span_a_spline_keeps_its_ends() {
    let spline =
        Spline::through(vec![1.0, 3.0, 2.0], 0.5, End::Velocity(0.0), End::Velocity(0.0)).unwrap();
    assert_eq!(spline.sample(-1.0), spline.sample(0.0));
    assert_eq!(spline.sample(f64::NAN), spline.sample(0.0));
    assert_eq!(spline.sample(9.0), spline.sample(1.0));
    assert_eq!(spline.sample(f64::INFINITY)[0], 2.0);
    assert_eq!(spline.sample(1.0)[1], 0.0);
}

#[test]
fn a_value_that_is_not_a_number_reaches_the_extremes() {
    let values = vec![0.0, 0.1, f64::NAN, 0.1, 0.0];
    let spline = Spline::through(values, 0.1, End::Free, End::Free).unwrap();
    assert!(spline.extremes().position.min.value.is_nan());
    assert!(spline.extremes().velocity.peak().value.is_nan());
}

#[test]
fn not_a_number_is_neither_hidden_by_values_before_nor_by_values_after() {
    let mut range = Range::of(Extreme { time_s: 0.0, value: 1.0 });
    for value in [2.0, f64::NAN, 0.5, 3.0] {
        range.include(0.1, value);
    }
    assert!(range.min.value.is_nan() && range.max.value.is_nan() && range.peak().value.is_nan());
}

#[test]
fn unusable_input_is_refused() {
    assert!(Spline::through(vec![], 0.1, End::Free, End::Free).is_err());
    assert!(Spline::through(vec![1.0], 0.1, End::Free, End::Free).is_err());
    for step_s in [0.0, -0.1, f64::NAN, f64::INFINITY] {
        assert!(Spline::through(vec![1.0, 2.0], step_s, End::Free, End::Free).is_err());
    }
    let end = End::Velocity(f64::NAN);
    assert!(Spline::through(vec![1.0, 2.0], 0.1, end, End::Free).is_err());
}

proptest! {
    #[test]
    fn a_spline_meets_its_knots_and_has_no_step_in_its_first_two_derivatives(
        values in prop::collection::vec(-3.0..3.0, 2..40),
        step_s in 0.005..0.5,
        start in prop::option::of(-5.0..5.0),
    ) {
        let start = start.map_or(End::Free, End::Velocity);
        let spline = Spline::through(values.clone(), step_s, start, End::Velocity(0.0)).unwrap();
        for (index, value) in values.iter().enumerate() {
            prop_assert!((spline.sample(index as f64 * step_s)[0] - value).abs() < 1e-9);
        }
        for index in 1..spline.pieces() {
            let (before, after) = (spline.piece(index - 1), spline.piece(index));
            prop_assert_eq!(before.velocity(1.0), after.velocity(0.0));
            let step = (before.acceleration(1.0) - after.acceleration(0.0)).abs();
            prop_assert!(step < 1e-9 / step_s / step_s, "{}", step);
        }
        match start {
            End::Free => prop_assert!(spline.sample(0.0)[2].abs() < 1e-9 / step_s / step_s),
            End::Velocity(velocity) => prop_assert_eq!(spline.sample(0.0)[1], velocity),
        }
        prop_assert_eq!(spline.sample(spline.duration_s())[1], 0.0);
    }

    #[test]
    fn dense_samples_never_pass_the_extremes_and_come_close_to_them(
        values in prop::collection::vec(-3.0..3.0, 2..12),
        step_s in 0.01..0.5,
    ) {
        let spline = Spline::through(values, step_s, End::Free, End::Velocity(0.0)).unwrap();
        let extremes = spline.extremes();
        let ranges = [extremes.position, extremes.velocity, extremes.acceleration];
        let mut seen = [[f64::INFINITY, f64::NEG_INFINITY]; 3];
        for piece in 0..spline.pieces() {
            for i in 0..=400 {
                let u = f64::from(i) / 400.0;
                let piece = spline.piece(piece);
                let got = [piece.position(u), piece.velocity(u), piece.acceleration(u)];
                for (seen, value) in seen.iter_mut().zip(got) {
                    *seen = [seen[0].min(value), seen[1].max(value)];
                }
            }
        }
        for (range, seen) in ranges.iter().zip(seen) {
            let size = range.peak().value.abs();
            prop_assert!(seen[0] >= range.min.value - 1e-9 * size);
            prop_assert!(seen[1] <= range.max.value + 1e-9 * size);
            prop_assert!(seen[0] - range.min.value < 1e-3 * size);
            prop_assert!(range.max.value - seen[1] < 1e-3 * size);
        }
        for (derivative, range) in ranges.iter().enumerate() {
            for extreme in [range.min, range.max] {
                let again = spline.sample(extreme.time_s)[derivative];
                let size = 1.0 + range.peak().value.abs();
                prop_assert!((again - extreme.value).abs() < 1e-6 * size);
            }
        }
    }

    #[test]
    fn stretching_time_divides_velocity_and_acceleration(
        values in prop::collection::vec(-3.0..3.0, 3..12),
        factor in 0.2..5.0,
        u in 0.0..1.0,
    ) {
        let spline = Spline::through(values, 0.1, End::Free, End::Free).unwrap();
        let slow = spline.stretched(factor);
        let t = u * spline.duration_s();
        let ([p, v, _], [ps, vs, _]) = (spline.sample(t), slow.sample(t * factor));
        prop_assert!((p - ps).abs() < 1e-9 && (v / factor - vs).abs() < 1e-7);
        let (a, b) = (spline.extremes().acceleration.peak(), slow.extremes().acceleration.peak());
        prop_assert!((a.value / factor / factor - b.value).abs() < 1e-9 * a.value.abs());
    }
}
