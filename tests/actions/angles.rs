//! Joint angles of whole clips and what is made of them: inside their ranges, alike wherever a clip is
//! cut, and the same motion under noise. The tables are those of docs/actions.md.

use crate::common::{bvh_files, captures};
use gaitway::action::Motion;
use gaitway::action::decompose::{DecomposedMotion, motion_of};
use gaitway::action::vocabulary;
use gaitway::body::{AngleSeries, Dof, JointAngles, SegmentPose};
use gaitway::mocap::anatomy::Capture;
use gaitway::mocap::read_bvh;
use glam::{DQuat, DVec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::io::Write;

/// Degrees of freedom that move less do not count.
const MOVING_DEG: f64 = 5.0;

/// Tells past the runner's capture.
fn tell(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

/// All captures that can be read, every so many of them.
fn read_captures(every: usize) -> Option<Vec<Capture>> {
    let files = bvh_files(&captures()?);
    Some(files.iter().step_by(every).filter_map(|path| read_bvh(path, None).ok()).collect())
}

/// Angles of a clip, each pose nearest to the one before: what live use does.
fn one_by_one(poses: &[SegmentPose]) -> Vec<JointAngles> {
    let mut series: Vec<JointAngles> = Vec::new();
    for pose in poses {
        let measured = match series.last() {
            None => JointAngles::of_pose(pose),
            Some(before) => JointAngles::of_pose_after(pose, before),
        };
        series.push(measured.angles);
    }
    series
}

fn column(series: &[JointAngles], dof: Dof) -> impl Iterator<Item = f64> {
    series.iter().map(move |angles| angles[dof])
}

fn range_deg(series: &[JointAngles], dof: Dof) -> f64 {
    let (low, high) = column(series, dof)
        .fold((f64::MAX, f64::MIN), |(low, high), angle| (low.min(angle), high.max(angle)));
    (high - low).to_degrees()
}

/// By how much an angle is outside its range, deg.
fn outside_deg(dof: Dof, angle_rad: f64) -> f64 {
    let (lower, upper) = dof.range_rad();
    (lower - angle_rad).max(angle_rad - upper).max(0.0).to_degrees()
}

/// Of a sorted list the value at a part of it.
fn at_part(values: &mut [f64], part: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values[((values.len() - 1) as f64 * part).round() as usize]
}

/// How well the angles of many clips keep to their ranges.
#[derive(Debug, Default)]
struct Ranges {
    angles: usize,
    inside: usize,
    /// Series whose range is above 360 deg.
    wound: usize,
    /// Series that are more than 5 deg outside for more than half of the time.
    outside: usize,
    worst_range_deg: f64,
}

impl Ranges {
    fn add(&mut self, series: &[JointAngles]) {
        for dof in Dof::ALL {
            let inside = column(series, dof).filter(|a| outside_deg(dof, *a) <= 1e-6).count();
            let far = column(series, dof).filter(|a| outside_deg(dof, *a) > 5.0).count();
            let range_deg = range_deg(series, dof);
            self.angles += series.len();
            self.inside += inside;
            self.wound += usize::from(range_deg > 360.0);
            self.outside += usize::from(2 * far > series.len());
            self.worst_range_deg = self.worst_range_deg.max(range_deg);
        }
    }

    fn share_inside(&self) -> f64 {
        self.inside as f64 / self.angles as f64
    }

    fn tell(&self, how: &str) {
        tell(&format!(
            "{how}: {:.1} % inside; {} series over 360 deg, the worst {:.0} deg; {} outside for most \
             of the time",
            100.0 * self.share_inside(),
            self.wound,
            self.worst_range_deg,
            self.outside
        ));
    }
}

#[test]
fn angles_of_captures_keep_to_their_ranges_and_do_not_wind() {
    let Some(captures) = read_captures(1) else { return };
    let (mut canonical, mut live) = (Ranges::default(), Ranges::default());
    for capture in &captures {
        canonical.add(&JointAngles::of_clip(&capture.poses, capture.rate_hz).angles);
        live.add(&one_by_one(&capture.poses));
    }
    tell(&format!("{} captures", captures.len()));
    canonical.tell("whole clips");
    live.tell("pose by pose");
    assert!(canonical.share_inside() >= live.share_inside());
    assert!(canonical.wound <= live.wound && canonical.outside <= live.outside);
}

/// The share of angles of joints with three degrees of freedom that a cut leaves as they were, away
/// from the singularity, and the number of clips in which it is not all of them.
fn same_when_cut(captures: &[Capture], from: f64, to: f64) -> (f64, usize) {
    let (mut same, mut all, mut changed) = (0, 0, 0);
    for capture in captures {
        let place = |part: f64| (part * capture.poses.len() as f64) as usize;
        let (first, last) = (place(from), place(to));
        let whole = JointAngles::of_clip(&capture.poses, capture.rate_hz).angles;
        let cut = JointAngles::of_clip(&capture.poses[first..last], capture.rate_hz).angles;
        let (same_before, all_before) = (same, all);
        for ((cut, whole), pose) in cut.iter().zip(&whole[first..]).zip(&capture.poses[first..]) {
            let near = JointAngles::of_pose(pose).near_singular;
            for dof in Dof::ALL.into_iter().filter(|dof| !near.contains(&dof.joint())) {
                all += 1;
                same += usize::from((cut[dof] - whole[dof]).abs() < 1e-6);
            }
        }
        changed += usize::from(same - same_before < all - all_before);
    }
    (same as f64 / all as f64, changed)
}

#[test]
fn angles_of_captures_do_not_depend_on_where_they_are_cut() {
    let Some(captures) = read_captures(1) else { return };
    for (from, to) in [(0.2, 0.6), (0.5, 1.0), (0.0, 0.3)] {
        let (share, changed) = same_when_cut(&captures, from, to);
        tell(&format!("{from} to {to}: {:.2} % the same, {changed} clips change", 100.0 * share));
        assert!(share > 0.97, "{from} to {to}: {share}");
    }
}

/// A motion with known angles.
struct Truth {
    rate_hz: f64,
    angles: Vec<JointAngles>,
    poses: Vec<SegmentPose>,
}

fn actions() -> Vec<Truth> {
    let rate_hz = 120.0;
    let of = |name: &str| {
        let angles = vocabulary::find(name).unwrap().perform().unwrap().sampled(rate_hz).unwrap();
        let pose = |angles: &JointAngles| angles.to_pose(DVec3::ZERO, DQuat::IDENTITY);
        Truth { rate_hz, poses: angles.iter().map(pose).collect(), angles }
    };
    vocabulary::names().map(of).collect()
}

fn captured() -> Option<Vec<Truth>> {
    let of = |capture: Capture| Truth {
        rate_hz: capture.rate_hz,
        angles: JointAngles::of_clip(&capture.poses, capture.rate_hz).angles,
        poses: capture.poses,
    };
    let every = if std::env::var_os("GAITWAY_LONG").is_some() { 4 } else { 12 };
    Some(read_captures(every)?.into_iter().map(of).collect())
}

/// Normally distributed with a standard deviation of 1 (Box and Muller).
fn normal(random: &mut ChaCha8Rng) -> f64 {
    let (one, other): (f64, f64) = (random.random(), random.random());
    (-2.0 * (1.0 - one).ln()).sqrt() * (std::f64::consts::TAU * other).cos()
}

/// Where noise comes in.
#[derive(Clone, Copy, Debug)]
enum Noise {
    /// On each of the 22 angles.
    Angles,
    /// On the orientation of each segment, about three axes: a joint, between two, is off by as much
    /// about each.
    Segments,
}

impl Noise {
    fn put_on(self, truth: &Truth, size_deg: f64, random: &mut ChaCha8Rng) -> Vec<JointAngles> {
        let size = size_deg.to_radians();
        match self {
            Self::Angles => {
                let mut angles = truth.angles.clone();
                for angle in angles.iter_mut().flat_map(|angles| &mut angles.0) {
                    *angle += size * normal(random);
                }
                angles
            }
            Self::Segments => {
                let mut poses = truth.poses.clone();
                for orientation in poses.iter_mut().flat_map(|pose| &mut pose.orientation) {
                    let turn = [(); 3].map(|()| size / 2f64.sqrt() * normal(random));
                    *orientation *= DQuat::from_scaled_axis(DVec3::from_array(turn));
                }
                let AngleSeries { angles, .. } = JointAngles::of_clip(&poses, truth.rate_hz);
                angles
            }
        }
    }
}

fn taken_apart(angles: &[JointAngles], rate_hz: f64) -> DecomposedMotion {
    motion_of(angles, rate_hz, 1f64.to_radians()).unwrap()
}

/// What noise makes of the actionlets of many motions.
#[derive(Debug, Default)]
struct UnderNoise {
    clean: usize,
    noisy: usize,
    /// Root mean square error against the truth of every degree of freedom that moves, deg.
    errors_deg: Vec<f64>,
    /// What it would be at least, were all cuts known: that of the clean series, and what noise does to as many numbers, deg.
    least_deg: Vec<f64>,
}

impl UnderNoise {
    fn of(truths: &[Truth], noise: Noise, size_deg: f64) -> Self {
        let mut found = Self::default();
        let mut random = ChaCha8Rng::seed_from_u64(11);
        for truth in truths {
            let moving = |motion: &Motion| motion.moving().count();
            let clean = taken_apart(&truth.angles, truth.rate_hz);
            found.clean += moving(&clean.motion);
            let noisy = noise.put_on(truth, size_deg, &mut random);
            let again = taken_apart(&noisy, truth.rate_hz).motion;
            found.noisy += moving(&again);
            let dofs =
                Dof::ALL.into_iter().filter(|dof| range_deg(&truth.angles, *dof) > MOVING_DEG);
            for dof in dofs {
                let squares = column(&truth.angles, dof).enumerate().map(|(index, angle)| {
                    let time_s = index as f64 / truth.rate_hz;
                    (again.at(dof, time_s).position_rad - angle).powi(2)
                });
                let rms = (squares.sum::<f64>() / truth.angles.len() as f64).sqrt();
                found.errors_deg.push(rms.to_degrees());
                let figure = clean.figures.iter().find(|figure| figure.dof == dof).unwrap();
                let known = (1 + 3 * figure.actionlets) as f64 / truth.angles.len() as f64;
                found.least_deg.push(figure.rms_rad.to_degrees().hypot(size_deg * known.sqrt()));
            }
        }
        found
    }

    fn times(&self) -> f64 {
        self.noisy as f64 / self.clean as f64
    }

    fn tell(&mut self, what: &str) {
        let [median, most, worst] =
            [0.5, 0.95, 1.0].map(|part| at_part(&mut self.errors_deg, part));
        let [least, least_most] = [0.5, 0.95].map(|part| at_part(&mut self.least_deg, part));
        tell(&format!(
            "{what}: {:.2} times the actionlets; error median {median:.2}, 95 % {most:.2}, worst \
             {worst:.2} deg; with known cuts {least:.2}, {least_most:.2} deg",
            self.times()
        ));
    }
}

#[test]
fn noise_on_shipped_actions_makes_no_actionlets() {
    let truths = actions();
    for noise in [Noise::Angles, Noise::Segments] {
        for size_deg in [0.5, 1.0, 2.0] {
            let mut found = UnderNoise::of(&truths, noise, size_deg);
            found.tell(&format!("actions, {size_deg} deg on {noise:?}"));
            assert!(found.times() <= 1.3, "{noise:?}, {size_deg} deg: {}", found.times());
            let most_deg = at_part(&mut found.errors_deg, 0.95);
            assert!(most_deg <= 1.5, "{noise:?}, {size_deg} deg: {most_deg} deg off");
        }
    }
}

#[test]
fn noise_on_captures_makes_no_actionlets() {
    let Some(truths) = captured() else { return };
    for noise in [Noise::Angles, Noise::Segments] {
        for size_deg in [0.5, 1.0, 2.0] {
            let mut found = UnderNoise::of(&truths, noise, size_deg);
            found.tell(&format!("captures, {size_deg} deg on {noise:?}"));
            assert!(found.times() <= 1.3, "{noise:?}, {size_deg} deg: {}", found.times());
            let median_deg = at_part(&mut found.errors_deg, 0.5);
            assert!(median_deg <= 1.5, "{noise:?}, {size_deg} deg: {median_deg} deg off");
            let [most_deg, least_deg] =
                [&mut found.errors_deg, &mut found.least_deg].map(|of| at_part(of, 0.95));
            // An arm that points straight out makes of turned segments angles as far off as one likes.
            let is_told = matches!(noise, Noise::Angles);
            assert!(!is_told || most_deg <= 1.1 * least_deg, "{size_deg} deg: {most_deg} deg off");
        }
    }
}

/// What the table in docs/actions.md says of every capture taken apart.
#[test]
fn every_capture_is_taken_apart_and_what_misses_the_tolerance_is_said() {
    let Some(captures) = read_captures(1) else { return };
    let (mut rms_deg, mut actionlets, mut seconds, mut missed, mut noisy) = (vec![], 0, 0.0, 0, 0);
    let (mut near, mut off_deg) = (vec![], 0.0f64);
    for capture in &captures {
        let series = JointAngles::of_clip(&capture.poses, capture.rate_hz);
        let found = taken_apart(&series.angles, capture.rate_hz);
        for figure in found.figures.iter().filter(|f| f.range_rad.to_degrees() > MOVING_DEG) {
            rms_deg.push(figure.rms_rad.to_degrees());
            actionlets += figure.actionlets;
            seconds += found.motion.duration_s();
            missed += usize::from(figure.rms_rad > 1f64.to_radians());
            noisy += usize::from(figure.noise_rad > 0.0);
        }
        for joint in &series.near_singular {
            near.push(joint.share);
            off_deg = off_deg.max(joint.off_rad.to_degrees());
        }
    }
    let some = near.iter().filter(|share| **share > 0.0).count();
    tell(&format!(
        "{} captures, {} series: median rms {:.2} deg, {:.2} actionlets/s, {missed} miss 1 deg, \
         {noisy} noisy; {some} of {} joints near singular, {:.2} % of the time, {off_deg:.1} deg beside",
        captures.len(),
        rms_deg.len(),
        at_part(&mut rms_deg, 0.5),
        actionlets as f64 / seconds,
        near.len(),
        100.0 * near.iter().sum::<f64>() / near.len() as f64,
    ));
    assert!(at_part(&mut rms_deg, 0.5) <= 1.0);
}
