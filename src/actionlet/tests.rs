use super::*;
use proptest::prelude::*;

fn vector(peak_at: f64) -> Actionlet {
    Actionlet::new(0.0, 2.0, 0.2, 1.0, Shape::half_sine(peak_at).unwrap()).unwrap()
}

/// Values to nine decimals, worked out from Eqs. 1 and 4 for a = 0.2, b = 1.0, D = 2.
fn same(got: f64, expected: f64) {
    assert!((got - expected).abs() <= 5.1e-10, "{got} is not {expected}");
}

#[test]
fn an_early_peak_gives_the_angles_of_equation_four() {
    let early = vector(0.3);
    same(early.at(0.3).position_rad, 0.243_605_627);
    same(early.at(0.3).velocity_rad_s, 0.4);
    same(early.at(0.3).acceleration_rad_s2, 2.094_395_102);
    same(early.at(1.0).position_rad, 0.739_364_227);
    same(early.at(1.0).velocity_rad_s, 0.649_395_921);
    same(early.at(1.0).acceleration_rad_s2, -0.701_770_298);
    same(early.at(1.8).position_rad, 0.997_341_311);
}

#[test]
fn a_middle_peak_gives_the_angles_of_equation_four() {
    let middle = vector(0.5);
    same(middle.at(0.3).position_rad, 0.216_992_757);
    same(middle.at(1.3).position_rad, 0.823_007_243);
    same(middle.at(1.3).velocity_rad_s, 0.635_114_101);
}

#[test]
fn jerk_steps_at_the_peak_and_at_both_ends() {
    let early = vector(0.3);
    same(early.at(0.0).jerk_rad_s3, 10.966_227_112);
    let before = early.at(0.6 - 1e-9).jerk_rad_s3;
    assert!((before - -10.966_227_112).abs() < 1e-6, "{before}");
    same(early.at(0.6).jerk_rad_s3, -2.014_204_980);
    same(early.at(2.0).jerk_rad_s3, 2.014_204_980);
    assert_eq!(early.at(2.1).jerk_rad_s3, 0.0);
    assert_eq!(early.at(-0.1).jerk_rad_s3, 0.0);
}

#[test]
fn peaks_are_those_of_the_closed_form() {
    use core::f64::consts::PI;
    let peaks = vector(0.3).peaks();
    same(peaks.velocity_rad_s, 0.8);
    same(peaks.acceleration_rad_s2, PI * 0.8 / (4.0 * 0.3));
    same(peaks.jerk_rad_s3, 10.966_227_112);
    let minimum_jerk = Actionlet::new(0.0, 2.0, 0.2, 1.0, Shape::MinimumJerk).unwrap();
    same(minimum_jerk.peaks().velocity_rad_s, 1.875 * 0.8 / 2.0);
}

#[test]
fn a_rest_does_not_move() {
    let rest = Actionlet::rest(1.0, 2.0, 0.7).unwrap();
    assert!(rest.is_rest());
    for time_s in [0.0, 1.0, 2.0, 3.0, 9.0] {
        assert_eq!(rest.at(time_s), State::at_rest(0.7));
    }
    assert_eq!(rest.peaks(), Peaks::default());
}

#[test]
fn unusable_numbers_are_refused() {
    let with = |begin, duration, from, to| {
        Actionlet::new(begin, duration, from, to, Shape::default()).is_err()
    };
    for bad in [f64::NAN, f64::INFINITY] {
        assert!(with(bad, 1.0, 0.0, 1.0) && with(0.0, bad, 0.0, 1.0));
        assert!(with(0.0, 1.0, bad, 1.0) && with(0.0, 1.0, 0.0, bad));
    }
    assert!(with(0.0, 0.0, 0.0, 1.0) && with(0.0, -1.0, 0.0, 1.0));
    assert!(!with(-3.0, 1.0, 0.0, 1.0));
}

proptest! {
    #[test]
    fn it_is_at_rest_exactly_at_its_ends_and_moves_one_way_between(
        (begin, duration) in (-10.0..10.0, 0.01..10.0),
        (from, to) in (-3.0..3.0f64, -3.0..3.0f64),
        t in 0.1..0.9,
        part in 0.001..0.999,
    ) {
        prop_assume!((to - from).abs() > 1e-6);
        let shape = Shape::half_sine(t).unwrap();
        let got = Actionlet::new(begin, duration, from, to, shape).unwrap();
        let (first, last) = (got.at(got.begin_s()), got.at(got.end_s()));
        prop_assert_eq!((first.position_rad, first.velocity_rad_s), (from, 0.0));
        prop_assert_eq!((last.position_rad, last.velocity_rad_s), (to, 0.0));
        let inside = got.at(begin + part * duration);
        prop_assert!(inside.velocity_rad_s * got.change_rad() > 0.0);
        let part_done = (inside.position_rad - from) / got.change_rad();
        prop_assert!(part_done > 0.0 && part_done < 1.0);
        let peaks = got.peaks();
        prop_assert!(inside.velocity_rad_s.abs() <= peaks.velocity_rad_s * (1.0 + 1e-12));
        prop_assert!(inside.acceleration_rad_s2.abs() <= peaks.acceleration_rad_s2 * (1.0 + 1e-12));
        prop_assert!(inside.jerk_rad_s3.abs() <= peaks.jerk_rad_s3 * (1.0 + 1e-12));
    }
}
