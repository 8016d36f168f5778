//! Bending a value smoothly away from a limit.

/// Holds `x` strictly between `lower` and `upper`: the identity while `x` is further than `margin`
/// from both, beyond that a curve that approaches the limit and never reaches it. Twice
/// continuously differentiable and strictly rising (until differences fall below rounding).
///
/// The curve is `e / sqrt(1 + e^2)` with `e` in units of the margin: at e = 0 it has slope 1 and no
/// curvature, so it joins the identity without a step in velocity or acceleration. It nears its
/// limit as 1/(2 e^2), slower than a hyperbolic tangent, so that far outside values stay apart.
///
/// A spline through saturated samples may overshoot them a little between samples: use limits
/// pulled in by a milliradian.
///
/// `margin` is used up to half the range. With `lower` not below `upper`, or a margin of zero or
/// less, this clamps to `lower..=upper`; not-a-number stays so.
#[must_use]
pub fn saturate(x: f64, lower: f64, upper: f64, margin: f64) -> f64 {
    let margin = margin.min((upper - lower) / 2.0);
    if !(margin > 0.0) {
        return x.min(upper).max(lower);
    }
    if x > upper - margin {
        (upper - margin * gap((x - upper) / margin + 1.0)).min(upper.next_down())
    } else if x < lower + margin {
        (lower + margin * gap((lower - x) / margin + 1.0)).max(lower.next_up())
    } else {
        x
    }
}

/// `1 - e / sqrt(1 + e^2)` for e >= 0, without cancellation.
fn gap(e: f64) -> f64 {
    let hypotenuse = 1f64.hypot(e);
    1.0 / (hypotenuse * (hypotenuse + e))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const LOWER: f64 = -0.5;
    const UPPER: f64 = 1.5;
    const MARGIN: f64 = 0.2;

    fn bent(x: f64) -> f64 {
        saturate(x, LOWER, UPPER, MARGIN)
    }

    #[test]
    fn away_from_limits_nothing_changes() {
        for x in [-0.3, -0.1, 0.0, 1.0, 1.3] {
            assert_eq!(bent(x), x);
        }
    }

    #[test]
    fn the_curve_passes_through_known_points() {
        // One margin past the join: e = 1, so 1 / sqrt(2) of the margin.
        assert!((bent(1.5) - (1.3 + 0.2 / 2f64.sqrt())).abs() < 1e-15);
        assert!((bent(-0.5) - (-0.3 - 0.2 / 2f64.sqrt())).abs() < 1e-15);
    }

    #[test]
    fn the_limit_is_never_reached() {
        for x in [1.5, 2.0, 1e3, 1e12, f64::MAX, f64::INFINITY] {
            assert!(bent(x) < UPPER && bent(x) > UPPER - MARGIN, "{x}");
            assert!(bent(-x) > LOWER && bent(-x) < LOWER + MARGIN, "{x}");
        }
        assert!(bent(f64::NAN).is_nan());
    }

    #[test]
    fn first_and_second_derivative_do_not_jump_at_the_joins() {
        let d = 1e-4;
        for join in [LOWER + MARGIN, UPPER - MARGIN] {
            let slope = |x: f64| (bent(x + d) - bent(x - d)) / (2.0 * d);
            let bend = |x: f64| (bent(x + d) - 2.0 * bent(x) + bent(x - d)) / (d * d);
            assert!((slope(join - 2.0 * d) - slope(join + 2.0 * d)).abs() < 1e-5);
            // Curvature grows from zero as -3 e / margin: 75 per rad at most.
            assert!((bend(join - 2.0 * d) - bend(join + 2.0 * d)).abs() < 0.05);
        }
    }

    #[test]
    fn a_margin_wider_than_the_range_is_cut_to_half() {
        assert_eq!(saturate(0.5, 0.0, 1.0, 9.0), 0.5);
        assert!(saturate(5.0, 0.0, 1.0, 9.0) < 1.0);
        assert_eq!(saturate(5.0, 0.0, 1.0, 0.0), 1.0);
        assert_eq!(saturate(5.0, 1.0, 0.0, 0.1), 1.0);
    }

    proptest! {
        #[test]
        fn larger_stays_larger_and_inside(x in -50.0..50.0, more in 1e-6..10.0) {
            prop_assert!(bent(x) < bent(x + more));
            prop_assert!(bent(x) > LOWER && bent(x) < UPPER);
        }
    }
}
