use super::*;
use proptest::prelude::*;

fn at(seconds: f64) -> Instant {
    Instant::from_nanos((seconds * 1e9) as u64)
}

fn counting(bits: u32) -> Timeline {
    Timeline::new(Telling {
        counter_bits: Some(bits),
        clock: None,
        period_s: 0.01,
        latency: Duration::ZERO,
    })
}

#[test]
fn a_counter_that_goes_round_is_no_gap() {
    let mut timeline = counting(8);
    let stamps: Vec<Stamp> = (0..1000_u64)
        .map(|n| timeline.take(Some(n & 0xFF), None, at(1.0 + n as f64 * 0.01)))
        .collect();
    assert!(stamps.iter().all(|stamp| stamp.order == Order::Next));
    assert_eq!(stamps[999].number, 999);
    assert_eq!(timeline.counts(), Counts { samples: 1000, ..Counts::default() });
}

#[test]
fn gaps_repetitions_and_disorder_are_told_apart_and_counted() {
    let mut timeline = counting(8);
    let orders: Vec<(Order, u64)> = [250, 251, 251, 255, 2, 1, 3, 103]
        .into_iter()
        .enumerate()
        .map(|(n, counter)| {
            // The last comes after a silence.
            let silent_s = if counter == 103 { 1.0 } else { 0.0 };
            timeline.take(Some(counter), None, at(1.0 + n as f64 * 0.01 + silent_s))
        })
        .map(|stamp| (stamp.order, stamp.missed))
        .collect();
    assert_eq!(
        orders,
        [
            (Order::Next, 0),
            (Order::Next, 0),
            (Order::Duplicate, 0),
            (Order::Gap, 3),
            (Order::Gap, 2),
            (Order::Late, 0),
            (Order::Next, 0),
            (Order::Gap, 99),
        ]
    );
    let expected =
        Counts { samples: 8, gaps: 3, missed: 104, duplicates: 1, late: 1, ..Counts::default() };
    assert_eq!(timeline.counts(), expected);
}

#[test]
fn a_clock_alone_shows_gaps_and_resets() {
    let mut timeline = Timeline::new(Telling {
        counter_bits: None,
        clock: Some((32, 1e-6)),
        period_s: 0.01,
        latency: Duration::from_millis(2),
    });
    let start = u64::from(u32::MAX) - 15_000;
    let mut take = |ticks: u64, s: f64| timeline.take(Some(9), Some(ticks & 0xFFFF_FFFF), at(s));
    take(start, 1.0);
    let next = take(start + 10_100, 1.01);
    assert_eq!(next.order, Order::Next);
    assert!((next.step_s - 0.0101).abs() < 1e-9);
    // Over the end of the 32 bits, two samples missing.
    let gap = take(start + 40_000, 1.04);
    assert_eq!((gap.order, gap.missed), (Order::Gap, 2));
    assert_eq!(take(start + 40_000, 1.041).order, Order::Duplicate);
    // A jump back by two seconds that stays is a reset; the latency stays taken off.
    assert_eq!(take(start - 2_000_000, 1.99).order, Order::Doubted);
    let reset = take(start - 1_990_000, 2.0);
    assert_eq!((reset.order, reset.step_s), (Order::Reset, 0.0));
    assert_eq!(reset.taken, at(1.998));
}

fn untold() -> Timeline {
    Timeline::new(Telling {
        counter_bits: None,
        clock: None,
        period_s: 0.01,
        latency: Duration::ZERO,
    })
}

/// Samples every 10 ms from 1 s on, read every 16 ms, and, at these times, only when the host wakes. All that was read.
fn read(
    timeline: &mut Timeline,
    stalls_s: &[(f64, f64)],
    lost: impl Fn(f64) -> bool,
) -> Vec<Stamp> {
    let mut stamps = Vec::new();
    for n in 0..1000_u32 {
        let taken_s = 1.0 + f64::from(n) * 0.01;
        if lost(taken_s) {
            continue;
        }
        let read_s = (taken_s / 0.016).ceil() * 0.016;
        let stall = stalls_s.iter().find(|(from, to)| (*from..*to).contains(&read_s));
        stamps.push(timeline.take(None, None, at(stall.map_or(read_s, |(_, to)| *to))));
    }
    stamps
}

#[test]
fn a_host_that_stood_still_lost_nothing_and_what_it_reads_at_once_was_not_taken_at_once() {
    let mut timeline = untold();
    let stamps = read(&mut timeline, &[(3.0, 3.3), (5.0, 5.31), (5.35, 6.2)], |_| false);
    assert_eq!(timeline.counts().estimated, Some(0));
    for (n, stamp) in stamps.iter().enumerate().skip(200) {
        assert!((stamp.step_s - 0.01).abs() < 1e-4, "{n}: {}", stamp.step_s);
        let off_s = stamp.taken.as_nanos() as f64 / 1e9 - (1.0 + n as f64 * 0.01);
        assert!((-1e-9..0.012).contains(&off_s), "{n}: {off_s}");
    }
}

#[test]
fn what_does_not_come_after_a_silence_is_lost_and_how_much_is_an_estimate() {
    for (from_s, to_s) in [(3.0, 3.4), (3.0, 4.5)] {
        let mut timeline = untold();
        let stamps = read(&mut timeline, &[], |t| (from_s..to_s).contains(&t));
        let counts = timeline.counts();
        let estimated = counts.estimated.expect("an estimate") as f64;
        let lost = (to_s - from_s) / 0.01;
        assert!((estimated - lost).abs() <= 3.0, "{estimated} of {lost}");
        assert_eq!((counts.missed, counts.gaps), (0, 1));
        assert_eq!(serde_json::json!(counts)["missed"], serde_json::Value::Null);
        let passed_s: f64 = stamps.iter().map(|stamp| stamp.step_s).sum();
        assert!((passed_s - 9.99).abs() < 0.03, "{passed_s}");
    }
    // Of a sensor that hung for ten seconds nobody waits to hear more.
    let mut timeline = untold();
    timeline.take(None, None, at(1.0));
    assert_eq!(timeline.take(None, None, at(11.0)).estimated, 999);
}

/// One digit of one time is another: what is told there is not used, and nothing was missing.
#[test]
fn a_time_that_was_misread_is_no_reset_and_no_loss() {
    for wrong in [9_000_000_u64, 1_000_000, 5_900_000, 4_980_000, 0, u64::from(u32::MAX)] {
        let mut timeline = Timeline::new(Telling {
            counter_bits: None,
            clock: Some((32, 1e-6)),
            period_s: 0.01,
            latency: Duration::ZERO,
        });
        let mut passed_s = 0.0;
        for n in 0..1000_u64 {
            let ticks = if n == 500 { wrong } else { n * 10_000 };
            let stamp = timeline.take(None, Some(ticks), at(1.0 + n as f64 * 0.01));
            // One that is a little late has no number of its own.
            let behind = u64::from(wrong == 4_980_000 && n >= 500);
            assert_eq!(stamp.number, n - behind, "{wrong}");
            passed_s += stamp.step_s;
        }
        let expected = Counts { samples: 1000, misread: 1, ..Counts::default() };
        assert_eq!(timeline.counts(), expected, "{wrong}");
        assert!((passed_s - 9.99).abs() < 1e-9, "{wrong}: {passed_s}");
    }
}

/// What else befalls it is told as it is of others: one time that is misread, one sample twice, one out of order, a new beginning.
#[test]
fn a_device_at_another_rate_than_its_profiles_is_judged_as_others_are() {
    for period_us in [2_500_u64, 5_000, 15_000, 20_000, 80_000] {
        let mut timeline = Timeline::new(Telling {
            counter_bits: None,
            clock: Some((32, 1e-6)),
            period_s: 0.01,
            latency: Duration::ZERO,
        });
        let mut told = 0;
        for n in 0..1000_u64 {
            // Lost.
            if [5, 6, 300, 700].contains(&n) {
                continue;
            }
            let ticks = match n {
                400 => 3_000_000_000,
                500 => (n - 1) * period_us,
                600 => (n - 3) * period_us,
                // It begins again.
                900.. => (n - 900) * period_us,
                _ => n * period_us,
            };
            let arrival = at(1.0 + (n * period_us) as f64 * 1e-6);
            told += timeline.take(None, Some(ticks), arrival).missed;
        }
        let counts = timeline.counts();
        // In one's place another came twice: it is missing. In another's place one came that seemed to be late: it was misread.
        let seen = (counts.missed, counts.resets, counts.duplicates, counts.late, counts.misread);
        assert_eq!(seen, (5, 1, 1, 0, 2), "{period_us} us: {counts:?}");
        assert_eq!(told, 5, "{period_us} us");
        assert!((timeline.period_s() / (period_us as f64 * 1e-6) - 1.0).abs() < 1e-3);
    }
}

/// Of twice the period, with one lost: too few samples have come to tell one by one, and the recording ends, or the device begins again.
#[test]
fn what_is_missing_among_the_first_samples_is_counted_though_the_rate_is_known_late() {
    let telling = Telling {
        counter_bits: None,
        clock: Some((32, 1e-6)),
        period_s: 0.01,
        latency: Duration::ZERO,
    };
    for begins_again in [false, true] {
        let mut timeline = Timeline::new(telling);
        let mut told = 0;
        for n in [0, 1, 2, 4, 5, 6, 7, 8, 9_u64] {
            let ticks = if begins_again && n > 7 { n - 7 } else { n + 100 };
            let stamp = timeline.take(None, Some(ticks * 20_000), at(1.0 + n as f64 * 0.02));
            told += stamp.missed;
            assert!(stamp.number <= n, "{n}: {stamp:?}");
        }
        let counts = timeline.counts();
        let expected = (1, 1, u64::from(begins_again), u64::from(begins_again));
        assert_eq!((counts.missed, counts.gaps, counts.resets, told), expected);
    }
}

#[test]
fn a_jump_that_stays_is_a_loss_if_it_is_short_and_else_a_new_beginning() {
    // By how much the clock goes on: lost, samples missed, resets.
    for (jump, missed, resets) in [(400_000_i64, 40, 0), (4_000_000, 0, 1), (-3_000_000, 0, 1)] {
        let mut timeline = Timeline::new(Telling {
            counter_bits: None,
            clock: Some((32, 1e-6)),
            period_s: 0.01,
            latency: Duration::ZERO,
        });
        for n in 0..1000_i64 {
            let jumped = if n < 500 { 0 } else { jump };
            let ticks = u64::try_from(n * 10_000 + jumped).expect("after zero");
            timeline.take(None, Some(ticks), at(1.0 + n as f64 * 0.01));
        }
        let counts = timeline.counts();
        let gaps = u64::from(missed > 0);
        let expected = Counts { samples: 1000, gaps, missed, resets, ..Counts::default() };
        assert_eq!(counts, expected, "{jump}");
    }
}

/// While the host stood still the line's memory ran over: what was lost then is seen at once, and is no doubt.
#[test]
fn what_was_lost_while_the_host_stood_still_is_a_loss() {
    let mut timeline = Timeline::new(Telling {
        counter_bits: None,
        clock: Some((32, 1e-6)),
        period_s: 0.01,
        latency: Duration::ZERO,
    });
    for n in (0..1000_u64).filter(|n| !(520..560).contains(n)) {
        let taken_s = 1.0 + n as f64 * 0.01;
        let read_s = if (500..560).contains(&n) { 6.6 } else { taken_s };
        let stamp = timeline.take(None, Some(n * 10_000), at(read_s));
        assert_ne!(stamp.order, Order::Doubted, "{n}");
    }
    assert_eq!(
        timeline.counts(),
        Counts { samples: 960, gaps: 1, missed: 40, ..Counts::default() }
    );
}

proptest! {
    /// Losses in any pattern shorter than half a turn of the counter are counted exactly.
    #[test]
    fn what_is_lost_is_counted(lost in prop::collection::vec(0_u64..100, 1..200)) {
        let mut timeline = counting(8);
        let mut counter = 7_u64;
        timeline.take(Some(counter), None, at(1.07));
        for gap in &lost {
            counter += gap + 1;
            timeline.take(Some(counter & 0xFF), None, at(1.0 + counter as f64 * 0.01));
        }
        prop_assert_eq!(timeline.counts().missed, lost.iter().sum::<u64>());
    }

    #[test]
    fn any_counters_and_clocks_are_taken(
        samples in prop::collection::vec((any::<u64>(), any::<u64>(), any::<u32>()), 0..100),
        bits in 4_u32..=64,
    ) {
        let mut timeline = Timeline::new(Telling {
            counter_bits: Some(bits),
            clock: Some((bits, 1e-9)),
            period_s: 0.01,
            latency: Duration::ZERO,
        });
        let (mut now, mut last) = (0, Instant::ZERO);
        for (counter, ticks, wait) in samples {
            now += u64::from(wait);
            let stamp = timeline.take(Some(counter), Some(ticks), Instant::from_nanos(now));
            prop_assert!(stamp.taken >= last && stamp.taken <= stamp.arrival);
            prop_assert!(stamp.step_s >= 0.0);
            last = stamp.taken;
        }
    }
}
