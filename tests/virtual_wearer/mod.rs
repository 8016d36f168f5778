//! Somebody who wears thirteen virtual sensors, in virtual time: what they measure, fused as live, and what becomes of it.

use gaitway::body::proportions::proximal_joint;
use gaitway::body::worn::doubt::{DoubtChange, Doubts};
use gaitway::body::worn::{Calibration, HeadingBy, Mount, Wearing, WornPose};
use gaitway::body::{JointAngles, Proportions, Segment, SegmentPose};
use gaitway::capture::{Mode, Orientation, Stuck};
use gaitway::device::sensor::SensorSample;
use gaitway::time::Instant;
use gaitway_sim::imu::{BodyMotion, Mount as Strapped};
use glam::{DQuat, DVec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Poses per second of a performance, and samples per second of each sensor.
pub const POSES_HZ: f64 = 120.0;
pub const RATE_HZ: f64 = 100.0;
/// So long the body stands in N pose first, and is calibrated at the end of that, s.
pub const STANDS_S: f64 = 6.0;
/// So long somebody takes to be as fast as a motion is.
const EASES_S: f64 = 0.6;

/// A motion after N pose: what follows is laid where the one before ended, facing as it did, and is gone over to within so long.
pub struct Performance {
    pub poses: Vec<SegmentPose>,
    body: Proportions,
}

impl Performance {
    pub fn new() -> Self {
        let body = Proportions::of_stature(1.75).expect("a person");
        let standing =
            JointAngles::default().to_pose(DVec3::Z * body.root_height_m(), DQuat::IDENTITY);
        Self { poses: vec![standing; (STANDS_S * POSES_HZ) as usize], body }
    }

    pub fn lasts_s(&self) -> f64 {
        self.poses.len() as f64 / POSES_HZ
    }

    pub fn go_on(&mut self, mut motion: Vec<SegmentPose>, within_s: f64) {
        let (Some(last), Some(first)) = (self.poses.last().cloned(), motion.first().cloned())
        else {
            return;
        };
        let facing = |pose: &SegmentPose| {
            let ahead = pose.orientation[Segment::Pelvis.index()] * DVec3::X;
            ahead.y.atan2(ahead.x)
        };
        let turn = DQuat::from_rotation_z(facing(&last) - facing(&first));
        let at_m = DVec3::new(last.root_m.x, last.root_m.y, 0.0);
        let from_m = DVec3::new(first.root_m.x, first.root_m.y, 0.0);
        for pose in &mut motion {
            pose.root_m = at_m + turn * (pose.root_m - from_m);
            pose.orientation.iter_mut().for_each(|q| *q = turn * *q);
        }
        let count = (within_s * POSES_HZ) as usize;
        for n in 1..count {
            let t = n as f64 / count as f64;
            let share = t * t * t * (10.0 - 15.0 * t + 6.0 * t * t);
            self.poses.push(on_its_way(&last, &motion[0], share));
        }
        self.poses.append(&mut motion);
    }
}

/// A body on its way from one pose to another: each segment turns on what carries it, as joints do. Turned in the world each by itself,
/// arms would go through elbows that are bent backward.
fn on_its_way(from: &SegmentPose, to: &SegmentPose, share: f64) -> SegmentPose {
    let mut pose = from.towards(to, share);
    for segment in Segment::ALL {
        let Some(above) = segment.parent().map(Segment::index) else { continue };
        let at = segment.index();
        let [turned, will_be] =
            [from, to].map(|pose| pose.orientation[above].inverse() * pose.orientation[at]);
        let will_be = if turned.dot(will_be) < 0.0 { -will_be } else { will_be };
        pose.orientation[at] = pose.orientation[above] * turned.slerp(will_be, share);
    }
    pose
}

/// A motion from its beginning to its end, `lasts_s` long, at [`POSES_HZ`], begun from rest and ended at rest: nobody runs from one moment
/// to the next.
pub fn from_rest_to_rest(lasts_s: f64, at: impl Fn(f64) -> SegmentPose) -> Vec<SegmentPose> {
    let eases_s = EASES_S.min(lasts_s);
    let all_s = lasts_s + eases_s;
    let done_s = |since_s: f64| {
        let part = (since_s / eases_s).min(1.0);
        eases_s * part.powi(3) * (1.0 - 0.5 * part) + (since_s - eases_s).max(0.0)
    };
    let time_s = |now_s: f64| match now_s < 0.5 * all_s {
        true => done_s(now_s),
        false => lasts_s - done_s(all_s - now_s),
    };
    let count = (all_s * POSES_HZ) as u32;
    (0..=count).map(|n| at(time_s(f64::from(n) / POSES_HZ))).collect()
}

/// What a sensor gets wrong all the time.
#[derive(Clone, Copy, Default)]
struct Errors {
    rate_bias: DVec3,
    acceleration_bias: DVec3,
    scale: f64,
    /// How it is shaken on the flesh: angle and rate, rad and rad/s, and how easily.
    wobble: [DVec3; 2],
    soft: f64,
    /// How it was turned at the sample before.
    before: Option<DQuat>,
}

/// Noise of a sample, rad/s and m/s^2: as of the thirteen sensors of the worn recording, and so are what they are off.
const RATE_NOISE: f64 = 0.0022;
const ACCELERATION_NOISE: f64 = 0.026;
/// Flesh swings at this rate, rad/s, and so much it is damped.
const FLESH_RAD_S: f64 = core::f64::consts::TAU * 9.0;
const FLESH_DAMPED: f64 = 0.25;

/// Said in place of what was measured.
#[derive(Clone, Copy, Default)]
pub struct Spoilt {
    pub rate: DVec3,
    pub force: DVec3,
    pub stuck: bool,
}

pub struct VirtualWearer {
    motions: Vec<BodyMotion>,
    straps: Vec<Strapped>,
    errors: Vec<Errors>,
    filters: Vec<Orientation>,
    random: ChaCha8Rng,
    wearing: Option<Wearing>,
    pub doubts: Doubts,
    /// By segment, which sensor is taken for its own.
    pub taken_for: [usize; 13],
    n: u64,
    lasts_s: f64,
    stuck: Vec<Stuck>,
    unfused_s: [f64; 13],
    fused: [DQuat; 13],
    last: Vec<(DVec3, DVec3)>,
    /// Nothing is doubted.
    pub trusts: bool,
    /// Nothing is made of gravity.
    pub unweighed: bool,
}

fn normal(random: &mut ChaCha8Rng) -> f64 {
    (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0
}

fn three(random: &mut ChaCha8Rng) -> DVec3 {
    DVec3::new(normal(random), normal(random), normal(random))
}

impl VirtualWearer {
    pub fn new(performance: &Performance, seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let places: Vec<_> =
            performance.poses.iter().map(|pose| performance.body.positions(pose)).collect();
        let mut all = Self {
            motions: Vec::new(),
            straps: Vec::new(),
            errors: Vec::new(),
            filters: Segment::ALL
                .map(|_| Orientation::new(1.0 / RATE_HZ, Mode::SixAxes))
                .into_iter()
                .collect(),
            random: ChaCha8Rng::seed_from_u64(seed ^ 0x5eed),
            wearing: None,
            doubts: Doubts::default(),
            taken_for: std::array::from_fn(|at| at),
            n: 0,
            lasts_s: performance.lasts_s(),
            stuck: vec![Stuck::default(); 13],
            unfused_s: [0.0; 13],
            fused: [DQuat::IDENTITY; 13],
            last: vec![(DVec3::ZERO, DVec3::ZERO); 13],
            trusts: false,
            unweighed: false,
        };
        for segment in Segment::ALL {
            let joint = proximal_joint(segment);
            let positions: Vec<[f64; 3]> =
                places.iter().map(|at| at.joint_m(joint).to_array()).collect();
            let turns = performance.poses.iter().map(|pose| pose.orientation[segment.index()]);
            let turns: Vec<[f64; 4]> = turns.map(|q| [q.w, q.x, q.y, q.z]).collect();
            all.motions.push(BodyMotion::new(POSES_HZ, &positions, &turns).expect("a motion"));
            let strapped = DQuat::from_rotation_z(0.15 * normal(&mut random))
                * DQuat::from_rotation_y(0.15 * normal(&mut random));
            all.straps.push(Strapped {
                offset_m: (segment.long_axis() * 0.12).to_array(),
                orientation: [strapped.w, strapped.x, strapped.y, strapped.z],
            });
            use Segment as S;
            let soft = match segment {
                S::LeftThigh | S::RightThigh => 1.0,
                S::LeftShank | S::RightShank => 0.6,
                S::LeftFoot | S::RightFoot => 0.2,
                S::LeftUpperArm | S::RightUpperArm => 0.6,
                _ => 0.3,
            };
            all.errors.push(Errors {
                rate_bias: 0.0008 * three(&mut random),
                acceleration_bias: 0.1 * three(&mut random),
                scale: 1.0 + 0.01 * normal(&mut random),
                wobble: [DVec3::ZERO; 2],
                soft: soft * (0.5 + random.random::<f64>()),
                before: None,
            });
        }
        all
    }

    /// True until the motion is over.
    pub fn goes_on(&self) -> bool {
        (self.n as f64) / RATE_HZ < self.lasts_s
    }

    pub fn time_s(&self) -> f64 {
        self.n as f64 / RATE_HZ
    }

    fn measured(&mut self, at: usize, time_s: f64) -> (DVec3, DVec3, DQuat) {
        let truth = self.motions[at].at(time_s, &self.straps[at]);
        let [w, x, y, z] = truth.orientation;
        let turned = DQuat::from_xyzw(x, y, z, w);
        let force = DVec3::from(truth.specific_force_m_s2);
        let errors = &mut self.errors[at];
        let dt_s = 1.0 / RATE_HZ;
        let pulls = force - turned.inverse() * (DVec3::Z * 9.806_65);
        // A degree for each g, where it would stay.
        let pushed =
            errors.soft * 0.0175 / 10.0 * FLESH_RAD_S * FLESH_RAD_S * DVec3::X.cross(pulls);
        let [angle, swing] = errors.wobble;
        let back = -2.0 * FLESH_DAMPED * FLESH_RAD_S * swing - FLESH_RAD_S * FLESH_RAD_S * angle;
        let swing = swing + (pushed + back) * dt_s;
        errors.wobble = [angle + swing * dt_s, swing];
        let wobbled = DQuat::from_scaled_axis(errors.wobble[0]);
        // What a gyroscope adds up to between two samples is how it was turned between them.
        let now = turned * wobbled;
        let before = errors.before.replace(now).unwrap_or(now);
        let step = before.inverse() * now;
        let step = if step.w < 0.0 { -step } else { step };
        let errors = self.errors[at];
        let rate = step.to_scaled_axis() / dt_s + errors.rate_bias;
        let force = wobbled.inverse() * force * errors.scale + errors.acceleration_bias;
        let rate = rate + RATE_NOISE * three(&mut self.random);
        (rate, force + ACCELERATION_NOISE * three(&mut self.random), turned)
    }

    /// The next moment: what is shown, once somebody is calibrated, and what began to be doubted. `spoil` changes what a
    /// sensor measures.
    pub fn step(
        &mut self,
        mut spoil: impl FnMut(f64, Segment, &mut Spoilt),
    ) -> Option<(WornPose, Vec<DoubtChange>)> {
        let (time_s, dt_s) = (self.time_s(), 1.0 / RATE_HZ);
        let taken = Instant::from_nanos(self.n * 10_000_000 + 1);
        self.n += 1;
        let mut said = [(DQuat::IDENTITY, DVec3::ZERO, DQuat::IDENTITY, false); 13];
        for segment in Segment::ALL {
            let at = segment.index();
            let (rate, force, truth) = self.measured(at, time_s);
            let mut says = Spoilt { rate, force, stuck: false };
            spoil(time_s, segment, &mut says);
            if says.stuck {
                (says.rate, says.force) = self.last[at];
            }
            self.last[at] = (says.rate, says.force);
            let sample = SensorSample {
                angular_rate_rad_s: Some(says.rate),
                acceleration_m_s2: Some(says.force),
                ..SensorSample::default()
            };
            let stuck = self.stuck[at].take(&sample, taken);
            self.unfused_s[at] += dt_s;
            if !stuck {
                let step_s = std::mem::take(&mut self.unfused_s[at]);
                let fused = self.filters[at].take(step_s, Some(says.rate), Some(says.force), None);
                self.fused[at] = fused.expect("measured").orientation;
            }
            said[at] = (self.fused[at], says.force, truth, stuck);
        }
        let said: [_; 13] = std::array::from_fn(|at| said[self.taken_for[at]]);
        let Some(wearing) = &mut self.wearing else {
            if time_s >= STANDS_S - 0.5 {
                let mounts = Segment::ALL.map(|segment| {
                    let (standing, _, truth, _) = said[segment.index()];
                    let turned = truth * standing.inverse();
                    let off = 0.06 * normal(&mut self.random);
                    let heading_rad = 2.0 * turned.z.atan2(turned.w) + off;
                    let upright = DQuat::from_rotation_z(-heading_rad);
                    Mount {
                        segment,
                        heading_rad,
                        sensor_from_segment: (standing.inverse() * upright).normalize(),
                        heading_by: HeadingBy::Movement,
                        consistency: None,
                        strapped_off_rad: None,
                    }
                });
                let (mounts, notes) = (mounts.to_vec(), Vec::new());
                self.wearing = Some(Wearing::new(&Calibration { mounts, notes }));
            }
            return None;
        };
        let mut all = [None; 13];
        for segment in Segment::ALL {
            let (turned, force, _, stuck) = said[segment.index()];
            all[segment.index()] = Some(turned);
            self.doubts.hear(segment, turned, taken, stuck);
            let force =
                wearing.in_world(segment, turned * force).filter(|_| !stuck && !self.unweighed);
            self.doubts.weigh(segment, force, dt_s);
        }
        let mut changes = self.doubts.judge(dt_s);
        if self.trusts {
            changes.clear();
        }
        for change in &changes {
            match change.doubted {
                Some(_) => wearing.hold(change.segment),
                None => wearing.release(change.segment, change.heading_lost),
            }
        }
        let moment = wearing.pose(&all, dt_s);
        self.doubts.look(&wearing.as_said(), &wearing.worn());
        Some((moment, changes))
    }
}
