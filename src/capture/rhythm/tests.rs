use super::*;
use proptest::prelude::*;

/// Numbers without a pattern, 0 to 1.
fn noise(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// A device's clock, and how it is read: ticks, s; and by how much a sample is taken beside its time, in periods.
#[derive(Clone, Copy, Debug)]
struct Clock {
    tick_s: f64,
    /// It goes on by so much at once, s.
    grain_s: f64,
    jitter: f64,
}

const CLOCKS: [Clock; 6] = [
    Clock { tick_s: 1e-9, grain_s: 1e-9, jitter: 0.0 },
    Clock { tick_s: 1e-6, grain_s: 1e-6, jitter: 0.0 },
    Clock { tick_s: 1e-6, grain_s: 1e-6, jitter: 0.08 },
    Clock { tick_s: 1e-4, grain_s: 1e-4, jitter: 0.0 },
    Clock { tick_s: 1.0 / 32768.0, grain_s: 1.0 / 32768.0, jitter: 0.03 },
    Clock { tick_s: 1e-6, grain_s: 1e-3, jitter: 0.0 },
];

/// What becomes of samples that are taken at these times, s, and of which these arrive.
struct Heard {
    rhythm: Rhythm,
    told: u64,
    last_s: Option<f64>,
}

impl Heard {
    fn at(nominal_hz: f64, clock: Clock) -> Self {
        Self { rhythm: Rhythm::new(1.0 / nominal_hz, clock.tick_s), told: 0, last_s: None }
    }

    fn hear(&mut self, clock: Clock, taken_s: f64, counted: Option<u64>) {
        let now_s = (taken_s / clock.grain_s + 1e-6).floor() * clock.grain_s;
        if let Some(last_s) = self.last_s {
            let ticks = ((now_s - last_s) / clock.tick_s).round();
            let stride = Stride { step_s: ticks * clock.tick_s, counted, came: 0 };
            self.told += self.rhythm.take(stride).samples;
        }
        self.last_s = Some(now_s);
    }

    fn missing(&self) -> u64 {
        self.told + self.rhythm.pending().samples
    }
}

/// So many samples of a device, of which some are lost; all that are lost after the first and before the last.
fn heard(
    nominal_hz: f64,
    rate_hz: f64,
    clock: Clock,
    count: u32,
    mut is_lost: impl FnMut(u32) -> bool,
) -> (Heard, u64) {
    let mut heard = Heard::at(nominal_hz, clock);
    let mut jitter = noise(7);
    let (mut lost, mut since) = (0, 0);
    for n in 0..count {
        let taken_s = 1.0 + (f64::from(n) + clock.jitter * (jitter() - 0.5)) / rate_hz;
        if n > 0 && is_lost(n) {
            since += 1;
            continue;
        }
        (lost, since) = (lost + since, 0);
        heard.hear(clock, taken_s, None);
    }
    (heard, lost)
}

const RATES_HZ: [f64; 12] =
    [12.5, 25.0, 40.0, 50.0, 60.0, 80.0, 95.0, 104.0, 120.0, 142.0, 200.0, 400.0];

/// Rates and clocks. One that goes on twice or thrice from sample to sample is too coarse.
fn devices() -> impl Iterator<Item = (f64, Clock)> {
    let all = RATES_HZ.iter().flat_map(|rate_hz| CLOCKS.map(|clock| (*rate_hz, clock)));
    all.filter(|(rate_hz, clock)| clock.grain_s * rate_hz <= 0.3)
}

#[test]
fn a_device_that_is_set_to_another_rate_loses_nothing_by_that_and_its_rate_is_found() {
    for nominal_hz in [60.0, 100.0, 400.0] {
        for (rate_hz, clock) in devices() {
            let (heard, _) = heard(nominal_hz, rate_hz, clock, 1000, |_| false);
            let told = format!("{nominal_hz}, {rate_hz} Hz, {clock:?}");
            assert_eq!(heard.missing(), 0, "{told}");
            let found_hz = heard.rhythm.rate_hz().expect("found");
            assert!((found_hz / rate_hz - 1.0).abs() < 0.01, "{told}: {found_hz}");
        }
    }
}

#[test]
fn losses_are_counted_by_the_rate_of_the_device_and_from_its_first_sample_on() {
    for nominal_hz in [60.0, 100.0, 400.0] {
        for (rate_hz, clock) in devices() {
            for (share, seed) in [(0.02, 1), (0.1, 2), (0.1, 4), (0.1, 5), (0.25, 3), (0.4, 6)] {
                let mut random = noise(seed);
                let is_lost = |n| random() < share || (300..340).contains(&n);
                let (heard, lost) = heard(nominal_hz, rate_hz, clock, 1000, is_lost);
                let told = format!("{nominal_hz}, {rate_hz} Hz, {clock:?}, {share}");
                assert!(lost > 40, "{told}");
                assert_eq!(heard.missing(), lost, "{told}");
                let found_hz = heard.rhythm.rate_hz().expect("found");
                assert!((found_hz / rate_hz - 1.0).abs() < 0.01, "{told}: {found_hz}");
            }
        }
    }
}

/// At the change itself nobody can tell whether the last sample at the old rate was lost.
#[test]
fn a_change_of_rate_amid_a_recording_is_followed() {
    for (before_hz, after_hz) in
        [(100.0, 50.0), (100.0, 200.0), (50.0, 25.0), (60.0, 120.0), (200.0, 30.0), (100.0, 80.0)]
    {
        for clock in CLOCKS {
            let mut heard = Heard::at(100.0, clock);
            let mut jitter = noise(11);
            let mut taken_s = 1.0;
            for n in 0..1000_u32 {
                let rate_hz = if n < 500 { before_hz } else { after_hz };
                taken_s += 1.0 / rate_hz;
                // Two in a row are lost, well after the change.
                if (800..802).contains(&n) {
                    continue;
                }
                heard.hear(clock, taken_s + clock.jitter * (jitter() - 0.5) / rate_hz, None);
                let told = format!("{before_hz} to {after_hz} Hz, {clock:?}, sample {n}");
                if n == 499 {
                    let found_hz = heard.rhythm.rate_hz().expect("found");
                    assert!((found_hz / before_hz - 1.0).abs() < 0.01, "{told}: {found_hz}");
                    assert_eq!(heard.missing(), 0, "{told}");
                }
                if n == 640 {
                    let found_hz = heard.rhythm.rate_hz().expect("found");
                    assert!((found_hz / after_hz - 1.0).abs() < 0.02, "{told}: {found_hz}");
                }
            }
            let most = (before_hz / after_hz).round().max(1.0) as u64 - 1;
            let missing = heard.missing();
            let told = format!("{before_hz} to {after_hz} Hz, {clock:?}");
            assert!((2..=2 + most).contains(&missing), "{told}: {missing}");
        }
    }
}

#[test]
fn who_loses_every_second_sample_is_not_taken_for_one_of_half_the_rate_where_a_counter_tells() {
    for clock in CLOCKS {
        let mut heard = Heard::at(100.0, clock);
        for n in 0..500 {
            heard.hear(clock, 1.0 + f64::from(n) * 0.02, Some(2));
        }
        let found_hz = heard.rhythm.rate_hz().expect("found");
        assert!((found_hz / 100.0 - 1.0).abs() < 0.01, "{clock:?}: {found_hz}");
    }
}

/// By the clock alone both say the same. Only who loses them unevenly says more.
#[test]
fn who_evenly_loses_every_second_sample_looks_like_one_of_half_the_rate_without_a_counter() {
    let clock = CLOCKS[1];
    let (evenly, _) = heard(100.0, 100.0, clock, 1000, |n| n % 2 == 1);
    assert_eq!(evenly.missing(), 0);
    assert!(evenly.rhythm.rate_hz().is_some_and(|found_hz| (found_hz - 50.0).abs() < 0.1));
    let mut random = noise(5);
    let (unevenly, lost) = heard(100.0, 100.0, clock, 1000, |_| random() < 0.5);
    assert_eq!(unevenly.missing(), lost);
    assert!(unevenly.rhythm.rate_hz().is_some_and(|found_hz| (found_hz - 100.0).abs() < 0.1));
}

#[test]
fn steps_that_agree_on_no_rate_are_counted_by_the_profiles() {
    let mut random = noise(3);
    let mut rhythm = Rhythm::new(0.01, 1e-6);
    let (mut told, mut expected) = (0_u64, 0_u64);
    for _ in 0..2000 {
        // Anything from a third of a period to nine: none is more frequent.
        let step_s = 0.003 * 27.0_f64.powf(random());
        expected += (step_s / 0.01).round().max(1.0) as u64 - 1;
        told += rhythm.take(Stride { step_s, counted: None, came: 0 }).samples;
    }
    told += rhythm.pending().samples;
    // Now and then some of them agree by chance with a period that is near.
    assert!(told.abs_diff(expected) < expected / 100, "{told} of {expected}");
    assert!((rhythm.period_s() / 0.01 - 1.0).abs() < 0.05, "{}", rhythm.period_s());
}

#[test]
fn uneven_stamps_are_no_higher_rate_that_loses_most() {
    // What the profile's rate makes of each pattern: 18 and 37 ms are two and four of it, 15 are two.
    for (pattern_ms, missed) in
        [(&[2.0, 18.0][..], 1), (&[1.0, 1.0, 1.0, 37.0][..], 3), (&[5.0, 15.0][..], 1)]
    {
        let mut rhythm = Rhythm::new(0.01, 1e-6);
        let mut told = 0;
        for _ in 0..500 {
            for step_ms in pattern_ms {
                let step_s = step_ms * 1e-3;
                told += rhythm.take(Stride { step_s, counted: None, came: 0 }).samples;
            }
        }
        told += rhythm.pending().samples;
        assert_eq!(told, 500 * missed, "{pattern_ms:?}");
        assert!((rhythm.period_s() / 0.01 - 1.0).abs() < 0.05, "{pattern_ms:?}");
    }
}

#[test]
fn a_clock_of_which_a_sample_takes_two_ticks_tells_no_losses_that_are_none_and_the_rate() {
    let clock = Clock { tick_s: 1e-3, grain_s: 1e-3, jitter: 0.0 };
    // A slower device than its profile's looks at first as if it lost some.
    for nominal_hz in [50.0, 100.0, 200.0, 400.0] {
        for rate_hz in [400.0, 450.0, 500.0, 600.0] {
            let (heard, _) = heard(nominal_hz, rate_hz, clock, 2000, |_| false);
            assert_eq!(heard.missing(), 0, "{rate_hz} Hz by a profile of {nominal_hz}");
            let found_hz = heard.rhythm.rate_hz().expect("found");
            assert!((found_hz / rate_hz - 1.0).abs() < 0.02, "{rate_hz}, {nominal_hz}: {found_hz}");
        }
    }
}

#[test]
fn a_rate_more_than_fifty_times_off_the_profiles_is_not_believed() {
    for (step_s, missed) in [(0.000_15, 0), (0.6, 59)] {
        let mut rhythm = Rhythm::new(0.01, 1e-6);
        let stride = Stride { step_s, counted: None, came: 0 };
        let told: u64 = (0..1000).map(|_| rhythm.take(stride).samples).sum();
        assert_eq!(told + rhythm.pending().samples, 1000 * missed, "{step_s}");
        assert_eq!(rhythm.period_s().to_bits(), 0.01_f64.to_bits(), "{step_s}");
    }
}

/// A device that begins again while it is not known yet how it is to be counted: that is told before, by what is known then.
#[test]
fn what_was_not_told_yet_is_told_when_the_device_begins_again() {
    let mut rhythm = Rhythm::new(0.01, 1e-6);
    let steps_s = [0.02, 0.02, 0.06, 0.02, 0.02, 0.02];
    for step_s in steps_s {
        let told = rhythm.take(Stride { step_s, counted: None, came: 0 });
        assert_eq!(told, Missing::default(), "it may be one of half the rate");
    }
    assert_eq!(rhythm.restart(), Missing { samples: 2, gaps: 1 });
    assert_eq!(rhythm.pending(), Missing::default());
}

proptest! {
    #[test]
    fn any_steps_are_taken_and_the_period_stays_near_the_profiles(
        steps in prop::collection::vec((any::<u64>(), 0_u32..64, any::<bool>(), 0_u64..5), 0..600),
        nominal_hz in 1.0..1000.0_f64,
    ) {
        let mut rhythm = Rhythm::new(1.0 / nominal_hz, 1e-9);
        for (ticks, shift, is_counted, came) in steps {
            let counted = is_counted.then_some(ticks % 40);
            let step_s = (ticks >> shift) as f64 * 1e-9;
            rhythm.take(Stride { step_s, counted, came });
            let off = rhythm.period_s() * nominal_hz;
            prop_assert!((1.0 / 50.1..=50.1).contains(&off), "{off}");
        }
        rhythm.pending();
    }
}
