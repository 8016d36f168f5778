//! Fewer points for a curve that looks the same: every peak and every gap stays.

/// One point of a curve; `None` is a gap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Point {
    pub(super) time_s: f64,
    pub(super) value: Option<f64>,
}

/// At most about `most` points of a curve. Longer curves are cut into equal stretches of samples,
/// each of which keeps its least value, its greatest and one gap; both ends stay. Values that are
/// not finite are gaps; samples whose time is not finite are left out.
pub(super) fn decimate(time_s: &[f64], values: &[f64], most: usize) -> Vec<Point> {
    let points: Vec<Point> = time_s
        .iter()
        .zip(values)
        .filter(|(time_s, _)| time_s.is_finite())
        .map(|(&time_s, &value)| Point { time_s, value: Some(value).filter(|v| v.is_finite()) })
        .collect();
    if points.len() <= most {
        return points;
    }
    let stretches = (most / 3).max(1);
    let mut kept = vec![0];
    for stretch in 0..stretches {
        let from = stretch * points.len() / stretches;
        let to = (stretch + 1) * points.len() / stretches;
        kept.extend(extremes(&points[from..to]).into_iter().map(|index| from + index));
    }
    kept.push(points.len() - 1);
    kept.dedup();
    kept.into_iter().map(|index| points[index]).collect()
}

/// The indices of the least value, the greatest and the first gap, in order.
fn extremes(points: &[Point]) -> Vec<usize> {
    let values = || points.iter().enumerate().filter_map(|(i, point)| Some((i, point.value?)));
    let least = values().min_by(|a, b| a.1.total_cmp(&b.1)).map(|(index, _)| index);
    let greatest = values().max_by(|a, b| a.1.total_cmp(&b.1)).map(|(index, _)| index);
    let gap = points.iter().position(|point| point.value.is_none());
    let mut kept: Vec<usize> = [least, greatest, gap].into_iter().flatten().collect();
    kept.sort_unstable();
    kept.dedup();
    kept
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_short_curve_is_kept_as_it_is() {
        let points = decimate(&[0.0, 1.0, 2.0], &[5.0, f64::NAN, 6.0], 3);
        let values: Vec<_> = points.iter().map(|point| point.value).collect();
        assert_eq!(values, [Some(5.0), None, Some(6.0)]);
    }

    #[test]
    fn one_peak_among_ten_thousand_samples_stays() {
        let time_s: Vec<f64> = (0..10_000).map(|n| f64::from(n) * 0.01).collect();
        let mut values = vec![0.0; 10_000];
        (values[4_321], values[4_322]) = (3.0, -3.0);
        let points = decimate(&time_s, &values, 300);
        assert!(points.contains(&Point { time_s: 43.21, value: Some(3.0) }));
        assert!(points.contains(&Point { time_s: 43.22, value: Some(-3.0) }));
    }

    #[test]
    fn one_gap_among_ten_thousand_samples_stays() {
        let time_s: Vec<f64> = (0..10_000).map(f64::from).collect();
        let mut values = vec![1.0; 10_000];
        values[777] = f64::NAN;
        let points = decimate(&time_s, &values, 300);
        let gaps: Vec<_> = points.iter().filter(|point| point.value.is_none()).collect();
        assert_eq!(gaps, [&Point { time_s: 777.0, value: None }]);
    }

    proptest! {
        #[test]
        fn extremes_and_ends_stay_in_order_and_the_number_is_bounded(
            values in prop::collection::vec(
                prop_oneof![9 => -1e3..1e3_f64, 1 => Just(f64::NAN)], 1..3_000),
            most in 3_usize..400,
        ) {
            let time_s: Vec<f64> = (0..values.len()).map(|n| n as f64).collect();
            let points = decimate(&time_s, &values, most);
            prop_assert!(points.len() <= most.max(3) + 2);
            prop_assert!(points.is_sorted_by(|a, b| a.time_s < b.time_s));
            prop_assert_eq!(points[0].time_s, 0.0);
            prop_assert_eq!(points[points.len() - 1].time_s, (values.len() - 1) as f64);
            let fold = |values: &mut dyn Iterator<Item = f64>| {
                values.filter(|v| v.is_finite()).fold((f64::MAX, f64::MIN), |(least, most), v| {
                    (least.min(v), most.max(v))
                })
            };
            let before = fold(&mut values.iter().copied());
            let after = fold(&mut points.iter().filter_map(|point| point.value));
            prop_assert_eq!(before, after);
            for point in points {
                let given = values[point.time_s as usize];
                prop_assert_eq!(point.value, Some(given).filter(|given| given.is_finite()));
            }
        }
    }
}
