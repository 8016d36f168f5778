//! What the servos of a motion have to give: torque joint by joint, and how much of what they have that is.
//!
//! Torques by inverse dynamics (Featherstone, Rigid Body Dynamics Algorithms, 2008, 5.3) of poses, their rates and accelerations.
//! What the floor gives is told by these as a whole; where both feet stand it is shared out as the zero-moment point lies
//! between them (nobody knows better without the feet's own springs), so that the parts add up to it. Rotors turn with their joints where the robot's file says how much they weigh; friction is left out.
//!
//! A motor gives `stall torque x voltage - stall torque / speed without load x speed`, voltage as a part of the one its figures
//! hold for; so what it needs at a torque and a speed is `torque / stall torque + speed / speed without load`.

use crate::error::Error;
use crate::motion::{Path, low_pass};
use crate::retarget::balance::{CUTOFF_HZ, CUTOFF_SHARE, HARDLY};
use crate::retarget::base::{BasePath, ON_FLOOR_M, StandingSole};
use crate::rigid::ground::GRAVITY_M_S2;
use crate::rigid::{Drive, Efforts, Placement, TreeMotion};
use crate::robot::{MotorCurve, RobotBody};
use glam::{DVec2, DVec3};
use nalgebra::Vector6;
use serde::Serialize;

/// The most that is asked of a motor in a motion.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PeakEffort {
    /// As part of what it has.
    pub share: f64,
    /// The joint it turns.
    pub joint: String,
    /// When, s from the start of the trajectory.
    pub at_s: f64,
}

/// A motion of which efforts are asked.
#[derive(Clone, Copy, Debug)]
pub struct Exertion<'a> {
    /// The robot.
    pub body: &'a RobotBody,
    /// What it may stand on; nothing for one that hangs or whose base is fixed: its base is held.
    pub soles: &'a [StandingSole],
    /// Angles of its joints, rad, at even times.
    pub poses: &'a [Vec<f64>],
    /// Where its base is at those times.
    pub path: &'a BasePath,
}

impl Exertion<'_> {
    /// Torque of each of the robot's joints, pose by pose, N m.
    ///
    /// # Errors
    /// A rate at which nothing can be filtered.
    pub fn torques_nm(&self) -> Result<Vec<Vec<f64>>, Error> {
        let joints = self.poses.first().map_or(0, Vec::len);
        let mut series = vec![Vec::with_capacity(self.poses.len()); joints];
        for at in 0..self.poses.len() {
            let motion = self.motion(at);
            let efforts = self.body.tree.inverse_dynamics(&motion, GRAVITY);
            let mut all = self.without_floor(&motion, efforts);
            for (at, drive) in self.body.drives.iter().flatten().enumerate() {
                all[at] += drive.armature_kg_m2 * motion.accelerations[at];
            }
            let own = self.body.tree.gathered(&all);
            series.iter_mut().zip(own).for_each(|(series, torque_nm)| series.push(torque_nm));
        }
        let cutoff_hz = CUTOFF_HZ.min(CUTOFF_SHARE * self.path.rate_hz);
        series.iter().map(|of| low_pass(of, self.path.rate_hz, cutoff_hz)).collect()
    }

    /// What everything does at a pose. Before the first and after the last nothing moves.
    fn motion(&self, at: usize) -> TreeMotion {
        let (rate_hz, last) = (self.path.rate_hz, self.poses.len() - 1);
        let beside = [at.saturating_sub(1), (at + 1).min(last)];
        let [before, now, after] =
            [beside[0], at, beside[1]].map(|at| self.body.angles(&self.poses[at]));
        let [was, is, will] = [beside[0], at, beside[1]].map(|at| self.path.places[at]);
        let each = |of: &dyn Fn(f64, f64, f64) -> f64| -> Vec<f64> {
            (0..now.len()).map(|n| of(before[n], now[n], after[n])).collect()
        };
        let spin = |from: Placement, to: Placement| {
            let turn = to.turn * from.turn.inverse();
            let turn = if turn.w < 0.0 { -turn } else { turn };
            turn.to_scaled_axis() * rate_hz
        };
        let [coming, going] = [spin(was, is), spin(is, will)];
        TreeMotion {
            base: is,
            velocity_m_s: (will.at_m - was.at_m) * (0.5 * rate_hz),
            spin_rad_s: (coming + going) * 0.5,
            acceleration_m_s2: (will.at_m - is.at_m * 2.0 + was.at_m) * (rate_hz * rate_hz),
            spin_rate_rad_s2: (going - coming) * rate_hz,
            rates: each(&|before, _, after| (after - before) * (0.5 * rate_hz)),
            accelerations: each(&|before, now, after| {
                (after - 2.0 * now + before) * (rate_hz * rate_hz)
            }),
            angles: now,
        }
    }

    /// Efforts in joints where it is not the base that is held, but feet that stand.
    fn without_floor(&self, motion: &TreeMotion, efforts: Efforts) -> Vec<f64> {
        let Efforts { base_force_n: force, base_torque_nm, mut joints } = efforts;
        let weight_n = self.body.tree.mass_kg() * GRAVITY_M_S2;
        if self.soles.is_empty() || force.z <= HARDLY * weight_n {
            return joints;
        }
        let placed = self.body.tree.place(motion.base, &motion.angles);
        let mut feet: Vec<(usize, DVec2)> = Vec::new();
        for sole in self.soles {
            let corners = sole.corners_m.iter().map(|corner| placed[sole.link].point(*corner));
            let down: Vec<DVec2> = corners
                .filter(|corner| corner.z < ON_FLOOR_M)
                .map(|corner| corner.truncate())
                .collect();
            if !down.is_empty() {
                feet.push((sole.link, down.iter().sum::<DVec2>() / down.len() as f64));
            }
        }
        // About the origin of the floor: N = p x F, and what is left turns about the vertical.
        let moment = base_torque_nm + motion.base.at_m.cross(force);
        let point_m = DVec2::new(-moment.y, moment.x) / force.z;
        let turning_nm = moment.z - point_m.perp_dot(force.truncate());
        let shares = shares(&feet, point_m);
        let middle_m: DVec2 = feet.iter().zip(&shares).map(|((_, at), share)| *at * *share).sum();
        for ((link, at_m), share) in feet.iter().zip(shares) {
            let pushed_m = (*at_m + point_m - middle_m).extend(0.0);
            let of = self.body.tree.jacobian(&placed, *link, pushed_m);
            let (push, turn) = (force * share, DVec3::Z * (turning_nm * share));
            let pushes = Vector6::new(push.x, push.y, push.z, turn.x, turn.y, turn.z);
            let given = of.tr_mul(&pushes);
            joints.iter_mut().zip(given.iter()).for_each(|(torque, given)| *torque -= given);
        }
        joints
    }
}

const GRAVITY: DVec3 = DVec3::new(0.0, 0.0, -GRAVITY_M_S2);

/// Which part of the weight each foot has: of two, as the point between them lies; evenly of more.
fn shares(feet: &[(usize, DVec2)], point_m: DVec2) -> Vec<f64> {
    if let [(_, one_m), (_, two_m)] = feet {
        let way_m = *two_m - *one_m;
        let along = (point_m - *one_m).dot(way_m) / way_m.length_squared().max(f64::MIN_POSITIVE);
        let second = along.clamp(0.0, 1.0);
        return vec![1.0 - second, second];
    }
    vec![1.0 / feet.len() as f64; feet.len()]
}

/// The most that motors have to give: of their torque, and of their voltage.
#[must_use]
pub fn peaks(
    torques_nm: &[Vec<f64>],
    poses: &[Vec<f64>],
    rate_hz: f64,
    motors: &[Option<MotorCurve>],
    names: &[&str],
) -> [Option<PeakEffort>; 2] {
    let mut most: [Option<(f64, usize, usize)>; 2] = [None; 2];
    for (joint, (series, motor)) in torques_nm.iter().zip(motors).enumerate() {
        let Some(motor) = motor else { continue };
        for (at, torque_nm) in series.iter().enumerate() {
            let [before, after] = [at.saturating_sub(1), (at + 1).min(series.len() - 1)];
            let moved_rad = poses[after][joint] - poses[before][joint];
            let speed_rad_s = moved_rad * 0.5 * rate_hz;
            let of_torque = torque_nm / motor.stall_torque_nm;
            let of_voltage = of_torque + speed_rad_s / motor.no_load_speed_rad_s;
            for (most, share) in most.iter_mut().zip([of_torque, of_voltage]) {
                if most.is_none_or(|(known, ..)| share.abs() > known) {
                    *most = Some((share.abs(), joint, at));
                }
            }
        }
    }
    most.map(|most| {
        let (share, joint, at) = most?;
        let joint = (*names.get(joint)?).to_owned();
        Some(PeakEffort { share, joint, at_s: at as f64 / rate_hz })
    })
}

/// Of its voltage and of its torque a motor is asked for so much at most; the rest is for friction, a battery that is not full
/// and a body that weighs more than its file says.
const SPARE_SHARE: f64 = 0.9;
/// Slower than this a motion is not made for its motors: what they could not do then either is left as it is.
const SLOWEST: f64 = 4.0;

/// By sample of a motion on a robot whose base is held upright, how many times as long it would have to take there for its
/// motors; 1 where they can do it.
#[must_use]
pub fn held_factors(body: &RobotBody, path: &Path, motors: &[Option<MotorCurve>]) -> Vec<f64> {
    let tree = &body.tree;
    let drive = |joint: usize| body.drives.as_ref().and_then(|drives| drives.get(joint));
    let motors: Vec<Option<MotorCurve>> =
        motors.iter().enumerate().map(|(at, motor)| Some(weaker((*motor)?, drive(at)))).collect();
    let own = |values: &[f64]| -> Vec<f64> {
        let mut all = values.to_vec();
        all.resize(tree.moving(), 0.0);
        tree.coupled_rates(&all)
    };
    let at = |sample: usize| {
        let time_s = sample as f64 * path.step_s();
        let found: Vec<[f64; 3]> =
            path.splines().iter().map(|spline| spline.sample(time_s)).collect();
        let of = |n: usize| -> Vec<f64> { found.iter().map(|of| of[n]).collect() };
        let mut motion = TreeMotion::at_rest(Placement::IDENTITY, body.angles(&of(0)));
        let mut rest_nm = tree.inverse_dynamics(&motion, GRAVITY).joints;
        (motion.rates, motion.accelerations) = (own(&of(1)), own(&of(2)));
        let mut moved_nm = tree.inverse_dynamics(&motion, GRAVITY).joints;
        for (at, drive) in body.drives.iter().flatten().enumerate() {
            moved_nm[at] += drive.armature_kg_m2 * motion.accelerations[at];
        }
        (rest_nm, moved_nm) = (tree.gathered(&rest_nm), tree.gathered(&moved_nm));
        let each = motors.iter().enumerate().filter_map(|(joint, motor)| {
            let asked = Asked {
                rest_nm: rest_nm[joint],
                moving_nm: moved_nm[joint] - rest_nm[joint],
                speed_rad_s: found[joint][1],
            };
            Some(asked.factor(&(*motor)?))
        });
        each.fold(1.0, f64::max)
    };
    (0..path.samples()).map(at).collect()
}

/// The weaker of what a motor's maker says and of what the robot's file says of its servos.
fn weaker(motor: MotorCurve, drive: Option<&Drive>) -> MotorCurve {
    let Some(drive) = drive else { return motor };
    let no_load_speed_rad_s = if drive.damping_nm_s_rad > 0.0 {
        motor.no_load_speed_rad_s.min(drive.torque_nm / drive.damping_nm_s_rad)
    } else {
        motor.no_load_speed_rad_s
    };
    MotorCurve { stall_torque_nm: motor.stall_torque_nm.min(drive.torque_nm), no_load_speed_rad_s }
}

/// What is asked of a motor at an instant.
struct Asked {
    /// By weight alone.
    rest_nm: f64,
    /// By motion, beside that.
    moving_nm: f64,
    speed_rad_s: f64,
}

impl Asked {
    /// The larger of its shares of torque and of voltage, so many times slower.
    fn share(&self, motor: &MotorCurve, slower: f64) -> f64 {
        let torque = (self.rest_nm + self.moving_nm / (slower * slower)) / motor.stall_torque_nm;
        let voltage = torque + self.speed_rad_s / slower / motor.no_load_speed_rad_s;
        torque.abs().max(voltage.abs())
    }

    /// How much slower it has to be, to a hundredth.
    fn factor(&self, motor: &MotorCurve) -> f64 {
        let fits_as_it_is = self.share(motor, 1.0) <= SPARE_SHARE;
        let fits_never = self.share(motor, SLOWEST) > SPARE_SHARE;
        if fits_as_it_is || fits_never {
            return 1.0;
        }
        let (mut short, mut long) = (1.0, SLOWEST);
        while long - short > 0.01 {
            let middle = 0.5 * (short + long);
            let fits = self.share(motor, middle) <= SPARE_SHARE;
            *(if fits { &mut long } else { &mut short }) = middle;
        }
        long
    }
}

/// Root mean square of the jerk of all joints over a stretch of poses, rad/s³; nothing if they are too few.
#[must_use]
pub fn jerk_rms_rad_s3(poses: &[Vec<f64>], rate_hz: f64) -> Option<f64> {
    let (mut sum, mut count) = (0.0, 0_usize);
    for four in poses.windows(4) {
        let [a, b, c, d] = four else { continue };
        for (((a, b), c), d) in a.iter().zip(b).zip(c).zip(d) {
            sum += ((d - a) - 3.0 * (c - b)).powi(2);
            count += 1;
        }
    }
    (count > 0).then(|| (sum / count as f64).sqrt() * rate_hz.powi(3))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_feet_share_the_weight_as_it_lies_between_them_and_one_has_it_all() {
        let feet = [(1, DVec2::new(0.0, 0.1)), (2, DVec2::new(0.0, -0.1))];
        assert_eq!(shares(&feet, DVec2::new(0.03, 0.05)), [0.75, 0.25]);
        assert_eq!(shares(&feet, DVec2::new(0.0, 0.4)), [1.0, 0.0]);
        assert_eq!(shares(&feet[..1], DVec2::ZERO), [1.0]);
        assert!(shares(&[], DVec2::ZERO).is_empty());
    }

    #[test]
    fn a_motor_that_brakes_needs_less_voltage_than_one_that_drives() {
        let motor = MotorCurve { stall_torque_nm: 4.0, no_load_speed_rad_s: 5.0 };
        let poses = [vec![0.0], vec![0.1], vec![0.2]];
        let most = |torque_nm: f64| {
            peaks(&[vec![0.0, torque_nm, 0.0]], &poses, 10.0, &[Some(motor)], &["knee"])
                .map(|of| of.expect("a motor").share)
        };
        // 1 rad/s is a fifth of its speed, 2 N m half of its torque.
        let ([driven, drives], [braked, brakes]) = (most(2.0), most(-2.0));
        assert!((driven - 0.5).abs() < 1e-12 && (braked - 0.5).abs() < 1e-12);
        assert!((drives - 0.7).abs() < 1e-12 && (brakes - 0.3).abs() < 1e-12);
    }

    #[test]
    fn a_motor_that_carries_half_of_its_torque_may_go_at_two_fifths_of_its_speed() {
        let motor = MotorCurve { stall_torque_nm: 4.0, no_load_speed_rad_s: 5.0 };
        let asked = |speed_rad_s: f64| Asked { rest_nm: 2.0, moving_nm: 0.0, speed_rad_s };
        assert!((asked(2.0).factor(&motor) - 1.0).abs() < 1e-12);
        assert!((asked(4.0).factor(&motor) - 2.0).abs() < 0.011);
        // What goes down brakes.
        assert!((asked(-4.0).factor(&motor) - 1.0).abs() < 1e-12);
        // What it cannot carry at rest no pace mends.
        let heavy = Asked { rest_nm: 4.1, moving_nm: 9.0, speed_rad_s: 1.0 };
        assert!((heavy.factor(&motor) - 1.0).abs() < 1e-12);
        let hastens = Asked { rest_nm: 0.0, moving_nm: 3.6 * 4.0, speed_rad_s: 0.0 };
        assert!((hastens.factor(&motor) - 2.0).abs() < 0.011);
    }

    #[test]
    fn servos_that_are_said_to_be_slower_than_their_makers_are_taken_for_slower() {
        let motor = MotorCurve { stall_torque_nm: 4.0, no_load_speed_rad_s: 5.0 };
        let drive = Drive {
            stiffness_nm_rad: 20.0,
            damping_nm_s_rad: 1.0,
            armature_kg_m2: 0.0,
            friction_nm: 0.0,
            torque_nm: 4.5,
        };
        let slow = MotorCurve { no_load_speed_rad_s: 4.5, ..motor };
        assert_eq!(weaker(motor, Some(&drive)), slow);
        assert_eq!(weaker(motor, Some(&Drive { damping_nm_s_rad: 0.0, ..drive })), motor);
        assert_eq!(weaker(motor, None), motor);
    }

    #[test]
    fn the_jerk_of_a_cubic_is_six_times_its_factor() {
        let poses: Vec<Vec<f64>> =
            (0..9).map(|n| vec![2.0 * (f64::from(n) / 50.0).powi(3)]).collect();
        assert!((jerk_rms_rad_s3(&poses, 50.0).expect("enough") - 12.0).abs() < 1e-6);
        assert_eq!(jerk_rms_rad_s3(&poses[..3], 50.0), None);
    }
}
