use super::*;

fn at(seconds: f64) -> Instant {
    Instant::from_nanos((seconds * 1e9).round() as u64)
}

/// So many seconds of samples every `period_s` of a sensor that should send one every `nominal_s`, read every 16 ms.
fn paced(nominal_s: f64, period_s: f64, seconds: f64) -> (Pace, Vec<(f64, Laid)>) {
    let mut pace = Pace::new(nominal_s);
    let laid = (0..(seconds / period_s) as u32).map(|n| {
        let taken_s = 1.0 + f64::from(n) * period_s;
        let read_s = (taken_s / 0.016).ceil() * 0.016;
        (taken_s, pace.take(1.0, n == u32::MAX, at(read_s)))
    });
    let laid = laid.collect();
    (pace, laid)
}

#[test]
fn a_rate_that_is_not_the_profiles_is_found_in_two_seconds_and_better_in_ten() {
    for (nominal_s, period_s) in [(0.1, 0.005), (0.005, 0.025), (0.02, 0.005), (0.01, 0.0102)] {
        for (seconds, off) in [(4.0, 0.01), (15.0, 0.001)] {
            let (pace, _) = paced(nominal_s, period_s, seconds);
            let found = pace.period_s() / period_s - 1.0;
            assert!(found.abs() < off, "{nominal_s} {period_s} {seconds}: {found}");
        }
        let (_, laid) = paced(nominal_s, period_s, 15.0);
        for (taken_s, laid) in laid.iter().filter(|(taken_s, _)| *taken_s > 5.0) {
            let off_s = laid.taken.as_nanos() as f64 / 1e9 - taken_s;
            assert!((-0.01..0.018).contains(&off_s), "{nominal_s} {period_s}: {off_s}");
            assert_eq!(laid.estimated, 0);
        }
    }
}

#[test]
fn the_nominal_period_stands_as_long_as_nothing_contradicts_it() {
    let (pace, laid) = paced(0.01, 0.010_005, 15.0);
    assert_eq!(pace.period_s().to_bits(), 0.01_f64.to_bits());
    assert!(laid.iter().skip(1).all(|(_, laid)| (laid.step_s - 0.01).abs() < 1e-12));
}

#[test]
fn a_device_that_begins_again_keeps_its_period_and_time_does_not_run_back() {
    let (mut pace, laid) = paced(0.1, 0.005, 10.0);
    let last = laid.last().expect("samples").1.taken;
    pace.restart();
    assert!((pace.period_s() / 0.005 - 1.0).abs() < 0.01);
    let first = pace.take(1.0, false, at(10.0));
    assert!(first.taken >= last && first.step_s == 0.0 && first.estimated == 0);
}
