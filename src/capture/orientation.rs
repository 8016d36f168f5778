//! Orientation from angular rate and acceleration, and, if wanted, the magnetic field.
//!
//! The filter is VQF (D. Laidig and T. Seel, "VQF: Highly accurate IMU orientation estimation with
//! bias estimation and magnetic disturbance rejection", Information Fusion 91, 2023), in the crate
//! `vqf-rs`, with the paper's parameters. Without the magnetometer the heading starts anywhere and
//! drifts slowly; with it, it is told from magnetic north while the field is undisturbed. Indoors,
//! near motors and steel, the field rarely is: without is the default.

use glam::{DQuat, DVec3};
use vqf_rs::VQF;

/// A gap longer than this is not bridged: nobody knows what the sensor did in it.
const MOST_GAP_S: f64 = 0.5;
/// So long after the start and after every gap the inclination is still being found, s.
const SETTLING_S: f64 = 1.0;

/// Samples that come at a rate this many times off are filtered anew: the filter's times count samples.
const MOST_OFF_PERIOD: f64 = 1.2;

/// What heading is told from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// Angular rate alone; it starts anywhere.
    #[default]
    SixAxes,
    /// The magnetic field too.
    NineAxes,
}

/// An orientation and how far to trust it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fused {
    /// Turns vectors of the sensor into those of a world with Z up.
    pub orientation: DQuat,
    /// False while the inclination is still being found.
    pub settled: bool,
    /// Estimated bias of the angular rate, rad/s, in the sensor's axes.
    pub bias_rad_s: DVec3,
    /// Its standard deviation in the worst direction, rad/s.
    pub bias_sigma_rad_s: f64,
    /// True if the sensor lies still.
    pub at_rest: bool,
    /// True if the magnetic field is not the earth's alone; always, as long as none was seen.
    pub magnetically_disturbed: bool,
}

/// The filter of one sensor.
pub struct Orientation {
    filter: VQF,
    period_s: f64,
    mode: Mode,
    settled_in_s: f64,
    started: bool,
    restarts: u64,
}

impl Orientation {
    /// For samples that come every `period_s`.
    ///
    /// # Panics
    /// Never for a profile's rate: it is finite and above zero; other periods are taken as 10 ms.
    #[must_use]
    pub fn new(period_s: f64, mode: Mode) -> Self {
        let usable = period_s.is_finite() && period_s > 0.0;
        let period_s = if usable { period_s } else { 0.01 };
        let filter = VQF::new(period_s, None, None, None);
        let settled_in_s = SETTLING_S;
        Self { filter, period_s, mode, settled_in_s, started: false, restarts: 0 }
    }

    /// How often it began again after a gap too long to be bridged.
    #[must_use]
    pub const fn restarts(&self) -> u64 {
        self.restarts
    }

    /// Samples come every `period_s`: if that is far from what the filter was made for, it is made anew. Heading and bias stay, the
    /// inclination is found again.
    pub fn come_every(&mut self, period_s: f64) {
        let factor = period_s / self.period_s;
        let is_near = (1.0 / MOST_OFF_PERIOD..=MOST_OFF_PERIOD).contains(&factor);
        if is_near || !(period_s.is_finite() && period_s > 0.0) {
            return;
        }
        let before = *self.filter.state();
        let (bias, sigma) = self.filter.bias_estimate();
        self.filter = VQF::new(period_s, None, None, None);
        let state = self.filter.state_mut();
        (state.gyr_quat, state.acc_quat, state.delta) =
            (before.gyr_quat, before.acc_quat, before.delta);
        self.filter.set_bias_estimate(bias, Some(sigma));
        self.period_s = period_s;
        self.settled_in_s = SETTLING_S;
    }

    /// Takes a sample `step_s` after the one before (zero for the first); `None` if it has no
    /// measurement of angular rate or acceleration: invalid stays invalid.
    ///
    /// `rate_rad_s`, `acceleration_m_s2` and `field` are in the sensor's axes; the field in any
    /// unit.
    pub fn take(
        &mut self,
        step_s: f64,
        rate_rad_s: Option<DVec3>,
        acceleration_m_s2: Option<DVec3>,
        field: Option<DVec3>,
    ) -> Option<Fused> {
        let rate = rate_rad_s.filter(|v| v.is_finite())?;
        let acceleration = acceleration_m_s2.filter(|v| v.is_finite())?;
        self.step(step_s, rate, acceleration, field.filter(|v| v.is_finite()));
        let (bias, bias_sigma_rad_s) = self.filter.bias_estimate();
        let quaternion = match self.mode {
            Mode::SixAxes => self.filter.quat_6d(),
            Mode::NineAxes => self.filter.quat_9d(),
        };
        let orientation = DQuat::from_xyzw(quaternion.1, quaternion.2, quaternion.3, quaternion.0);
        orientation.is_finite().then_some(Fused {
            orientation,
            settled: self.settled_in_s <= 0.0,
            bias_rad_s: DVec3::from_array(bias),
            bias_sigma_rad_s,
            at_rest: self.filter.rest_detected(),
            magnetically_disturbed: self.filter.mag_dist_detected(),
        })
    }

    fn step(&mut self, step_s: f64, rate: DVec3, acceleration: DVec3, field: Option<DVec3>) {
        // Not a number and negative steps are no time that passed: the nominal one is taken.
        let known = step_s.is_finite() && step_s > 0.0;
        let step_s = if known { step_s } else { self.period_s };
        if self.started && step_s > MOST_GAP_S {
            // The bias of the angular rate has not changed meanwhile; the orientation may have.
            let (bias, sigma) = self.filter.bias_estimate();
            self.filter.reset_state();
            self.filter.set_bias_estimate(bias, Some(sigma));
            self.settled_in_s = SETTLING_S;
            self.restarts += 1;
        }
        let first_s = if self.started && step_s <= MOST_GAP_S { step_s } else { self.period_s };
        self.started = true;
        self.settled_in_s -= first_s;
        self.filter.update_gyr_with_ts(rate.to_array(), first_s);
        self.filter.update_acc(acceleration.to_array());
        if let Some(field) = field.filter(|_| self.mode == Mode::NineAxes) {
            self.filter.update_mag(field.to_array());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sensor_at_rest_knows_which_way_is_up_and_its_bias() {
        let mut filter = Orientation::new(0.01, Mode::SixAxes);
        // Lying on its left side: up is its own Y axis... which points along the world's Z.
        let up = DVec3::new(0.0, 9.81, 0.0);
        let bias = DVec3::new(0.01, -0.005, 0.002);
        let mut fused = None;
        for _ in 0..2000 {
            fused = filter.take(0.01, Some(bias), Some(up), None);
        }
        let fused = fused.expect("valid");
        let off = (fused.orientation * up.normalize() - DVec3::Z).length();
        assert!(off < 1e-3, "{off}");
        assert!(fused.settled && fused.at_rest);
        assert!((fused.bias_rad_s - bias).length() < 1e-3, "{}", fused.bias_rad_s);
    }

    #[test]
    fn a_quarter_turn_is_a_quarter_turn_though_samples_are_missing() {
        let mut filter = Orientation::new(0.01, Mode::SixAxes);
        let gravity = Some(DVec3::new(0.0, 0.0, 9.81));
        let still = filter.take(0.0, Some(DVec3::ZERO), gravity, None).expect("valid");
        // 1 rad/s about Z for 1.5 s, every third sample lost.
        let mut turned = still;
        for n in 1..=150 {
            if n % 3 == 1 {
                continue;
            }
            let step_s = if n % 3 == 2 { 0.02 } else { 0.01 };
            turned = filter.take(step_s, Some(DVec3::Z), gravity, None).expect("valid");
        }
        let angle = still.orientation.angle_between(turned.orientation);
        assert!((angle - 1.5).abs() < 1e-3, "{angle}");
    }

    #[test]
    fn what_is_no_measurement_gives_no_orientation_and_does_no_harm() {
        let mut filter = Orientation::new(0.01, Mode::NineAxes);
        let gravity = Some(DVec3::new(0.0, 0.0, 9.81));
        let zero = Some(DVec3::ZERO);
        for _ in 0..200 {
            assert!(filter.take(0.01, zero, gravity, None).is_some());
        }
        let nan = Some(DVec3::splat(f64::NAN));
        assert_eq!(filter.take(0.01, nan, gravity, None), None);
        assert_eq!(filter.take(0.01, zero, None, None), None);
        let after = filter.take(f64::NAN, zero, gravity, nan).expect("valid again");
        assert!(after.orientation.is_finite() && after.settled);
    }

    #[test]
    fn after_a_long_gap_it_settles_anew() {
        let mut filter = Orientation::new(0.01, Mode::SixAxes);
        let gravity = Some(DVec3::new(0.0, 0.0, 9.81));
        for _ in 0..200 {
            filter.take(0.01, Some(DVec3::ZERO), gravity, None);
        }
        let sideways = Some(DVec3::new(9.81, 0.0, 0.0));
        let after = filter.take(3.0, Some(DVec3::ZERO), sideways, None).expect("valid");
        assert!(!after.settled);
        assert_eq!(filter.restarts(), 1);
        let up = after.orientation * DVec3::X;
        assert!((up - DVec3::Z).length() < 1e-6, "{up}");
    }
}
