//! Where down is, as each sensor of a body measures it.
//!
//! A filter turns an orientation until what the accelerometer says, on the mean of some seconds, points upward. So a tilt that it
//! followed slowly shows nothing. But where a gyroscope says what is not (one axis is dead, or its bias is beyond what a filter takes
//! for one) the filter comes too late for as long as that lasts, and where an accelerometer says what is not, its length is not that of
//! weight. Either way the mean of what was measured, turned into the world, is elsewhere than straight up and one g long, and elsewhere than
//! that of the other sensors. Nobody who moves changes that: a body is accelerated to and fro.

use crate::body::Segment;
use glam::DVec3;

/// Standard gravity, m/s^2.
const GRAVITY_M_S2: f64 = 9.806_65;
/// Means are taken twice, one of the other, over so long a time each, s.
const MEAN_S: f64 = 0.6;
/// So long nothing is made of a sensor that begins, s.
const FIRST_S: f64 = 5.0;
/// So far from weight nobody is who hardly moves, m/s^2: accelerometers of cheap sensors are off by 0.8.
const MOST_OFF_M_S2: f64 = 1.5;
/// And so much of what it is shaken, root mean square.
const SHAKEN: f64 = 0.2;
/// Who is astray is not any more at this share of it.
const BACK: f64 = 0.6;
/// A mean that is no further from straight up than this, m/s^2, is upright: four degrees.
const LEVEL_M_S2: f64 = 0.7;
/// And so much of what it is shaken, root mean square.
const LEVEL_SHAKEN: f64 = 0.05;

/// What one sensor measures.
#[derive(Clone, Copy, Debug, Default)]
struct Down {
    /// Mean, and mean of that, m/s^2.
    means: [DVec3; 2],
    /// Mean square of what is off the mean, m^2/s^4.
    shaken: f64,
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
            of.means = [force; 2];
        }
        let step_s = std::mem::take(&mut of.silent_s).min(MEAN_S);
        of.heard_s += step_s;
        let share = step_s / MEAN_S;
        let [first, mean] = of.means;
        of.means = [first + (force - first) * share, mean + (first - mean) * share];
        of.shaken += ((force - mean).length_squared() - of.shaken) * share;
    }

    /// The sensor of a segment began anew.
    pub fn forget(&mut self, segment: Segment) {
        self.of[segment.index()] = Down::default();
    }

    /// By [`Segment::index`]: whether its sensor is tilted as its orientation has it; `None`: nobody knows.
    pub fn level(&self) -> [Option<bool>; 13] {
        self.of.map(|of| {
            let most = LEVEL_M_S2 + LEVEL_SHAKEN * of.shaken.sqrt();
            (of.heard_s >= FIRST_S).then(|| of.means[1].truncate().length() <= most)
        })
    }

    /// By [`Segment::index`]: whose sensor measures what is neither weight nor what the others measure.
    pub fn astray(&mut self) -> [bool; 13] {
        let weight = DVec3::Z * GRAVITY_M_S2;
        let is_known = |of: &Down| of.heard_s >= FIRST_S;
        let known: Vec<DVec3> =
            self.of.iter().filter(|of| is_known(of)).map(|of| of.means[1]).collect();
        // What all share is how the body is carried along, as in a lift.
        let others = if known.len() >= 3 { middle(&known) } else { weight };
        self.of.each_mut().map(|of| {
            if !is_known(of) {
                return false;
            }
            let most = MOST_OFF_M_S2 + SHAKEN * of.shaken.sqrt();
            let mean = of.means[1];
            let off = (mean - weight).length().min((mean - others).length());
            of.astray = !(off <= if of.astray { BACK * most } else { most });
            of.astray
        })
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
