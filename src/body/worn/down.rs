//! Where down is, as each sensor of a body measures it.
//!
//! A filter turns an orientation until what the accelerometer says, on the mean of some seconds, points upward. So a tilt that it
//! followed slowly shows nothing. But where a gyroscope says what is not (one axis is dead, or its bias is beyond what a filter takes
//! for one) the filter comes too late for as long as that lasts, and where an accelerometer says what is not, its length is not that of
//! weight. Either way the mean of what was measured, turned into the world, is elsewhere than straight up and one g long, and elsewhere than
//! that of the other sensors. Nobody who moves changes that: a body is accelerated to and fro.
//!
//! A short mean shows it soon, but has to allow for how a limb is swung. A long one hardly has to; it shows what is hidden in a swing:
//! an arm that runs with an accelerometer that is off, or blows again and again, which a body that moves does not give one after the
//! other to the same side.

use crate::body::Segment;
use glam::DVec3;

/// Standard gravity, m/s^2.
const GRAVITY_M_S2: f64 = 9.806_65;
/// Means are taken twice, one of the other, over so long a time each, s: the short one and the long one.
const MEANS_S: [f64; 2] = [0.6, 2.0];
/// How a sensor is shaken is a mean over so long, s.
const SHAKEN_S: f64 = 0.6;
/// How it usually is shaken is a mean over so long, s, to which a sample adds at most so many times what it is, or what it would be of
/// who hardly moves, m^2/s^4: blows do not excuse themselves.
const USUALLY_S: f64 = 4.0;
const MOST_TIMES_USUAL: f64 = 4.0;
const HARDLY_M2_S4: f64 = 1.0;
/// So long nothing is made of a sensor that begins, s.
const FIRST_S: f64 = 5.0;
/// So far from weight is no mean of somebody who hardly moves, m/s^2: accelerometers of cheap sensors are off by 0.8.
const MOST_OFF_M_S2: [f64; 2] = [1.5, 1.2];
/// And so much of what it is shaken, root mean square: the short mean of what it is now, the long one of what it usually is.
const SHAKEN: [f64; 2] = [0.2, 0.1];
/// Who is astray is not any more at this share of it.
const BACK: f64 = 0.6;
/// A mean that is no further from straight up than this, m/s^2, is upright: four degrees.
const LEVEL_M_S2: f64 = 0.7;
/// And so much of what it is shaken, root mean square.
const LEVEL_SHAKEN: f64 = 0.05;

/// What one sensor measures.
#[derive(Clone, Copy, Debug, Default)]
struct Down {
    /// Mean, and mean of that, m/s^2; short and long.
    means: [[DVec3; 2]; 2],
    /// Mean square of what is off the short mean, m^2/s^4: now, and usually.
    shaken: [f64; 2],
    heard_s: f64,
    /// Since it said something last, s.
    silent_s: f64,
    astray: bool,
}

/// What the sensors of a body measure.
#[derive(Clone, Debug, Default)]
pub struct Downs {
    of: [Down; 13],
}

impl Downs {
    /// Takes what a segment's sensor measured on the mean since the moment before, `dt_s` ago, turned into the world, m/s^2; `None`: nothing.
    pub fn take(&mut self, segment: Segment, force: Option<DVec3>, dt_s: f64) {
        let of = &mut self.of[segment.index()];
        of.silent_s += dt_s;
        let Some(force) = force.filter(|force| force.is_finite()) else { return };
        if of.heard_s == 0.0 {
            of.means = [[force; 2]; 2];
        }
        let step_s = std::mem::take(&mut of.silent_s).min(SHAKEN_S);
        of.heard_s += step_s;
        let before = of.short();
        for ([first, mean], mean_s) in of.means.iter_mut().zip(MEANS_S) {
            let share = step_s / mean_s;
            *mean += (*first - *mean) * share;
            *first += (force - *first) * share;
        }
        let off = (force - before).length_squared();
        let [now, usually] = &mut of.shaken;
        *now += (off - *now) * step_s / SHAKEN_S;
        *usually +=
            (off.min(MOST_TIMES_USUAL * (*usually + HARDLY_M2_S4)) - *usually) * step_s / USUALLY_S;
    }

    /// The sensor of a segment began anew.
    pub fn forget(&mut self, segment: Segment) {
        self.of[segment.index()] = Down::default();
    }

    /// By [`Segment::index`]: whether its sensor is tilted as its orientation has it; `None`: nobody knows.
    pub fn level(&self) -> [Option<bool>; 13] {
        self.of.map(|of| {
            let most = LEVEL_M_S2 + LEVEL_SHAKEN * of.shaken[0].sqrt();
            (of.heard_s >= FIRST_S).then(|| of.short().truncate().length() <= most)
        })
    }

    /// By [`Segment::index`]: whose sensor measures what is neither weight nor what the others measure.
    pub fn astray(&mut self) -> [bool; 13] {
        let weight = DVec3::Z * GRAVITY_M_S2;
        let is_known = |of: &Down| of.heard_s >= FIRST_S;
        // What all share is how the body is carried along, as in a lift.
        let others = [0, 1].map(|long: usize| {
            let known: Vec<DVec3> =
                self.of.iter().filter(|of| is_known(of)).map(|of| of.means[long][1]).collect();
            if known.len() >= 3 { middle(&known) } else { weight }
        });
        self.of.each_mut().map(|of| {
            if !is_known(of) {
                return false;
            }
            let is_off = |long: usize| {
                let mean = of.means[long][1];
                let off = (mean - weight).length().min((mean - others[long]).length());
                let most = MOST_OFF_M_S2[long] + SHAKEN[long] * of.shaken[long].sqrt();
                !(off <= if of.astray { BACK * most } else { most })
            };
            of.astray = is_off(0) || is_off(1);
            of.astray
        })
    }
}

impl Down {
    /// The short mean of means.
    const fn short(&self) -> DVec3 {
        self.means[0][1]
    }
}

/// The median by each axis.
fn middle(known: &[DVec3]) -> DVec3 {
    let axis = |axis: usize| {
        let mut values: Vec<f64> = known.iter().map(|one| one[axis]).collect();
        let (_, middle, _) = values.select_nth_unstable_by(known.len() / 2, f64::total_cmp);
        *middle
    };
    DVec3::new(axis(0), axis(1), axis(2))
}
