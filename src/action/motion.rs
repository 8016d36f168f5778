//! 22 chains of actionlets over one time scope.

use crate::actionlet::{Actionlet, Sequence, Shape, State};
use crate::body::{
    Dof, JointAngles, PelvisAngles, Proportions, Segment, SegmentPose, root, stance,
};
use crate::error::Error;
use glam::{DQuat, DVec3};
use std::ops::RangeInclusive;

/// Poses per second a motion can be sampled at.
pub const RATES_HZ: RangeInclusive<f64> = 1.0..=10_000.0;
/// Most poses of a sampled motion: an hour at 3,000 per second.
pub const MAX_POSES: usize = 11_000_000;
/// Instants nearer than this are one, s: sums of durations are rounded.
pub const SAME_INSTANT_S: f64 = 1e-9;

/// Rate at which feet and floor are looked at: at this one what is spread sinks by less than a millimetre.
const GRID_HZ: f64 = 250.0;

/// Where a pelvis is and how it is turned, at [`GRID_HZ`].
struct PelvisPath {
    turns_rad: Vec<DVec3>,
    roots_m: Vec<DVec3>,
}

impl PelvisPath {
    /// How it is turned and where it is at a time.
    fn at(&self, time_s: f64) -> (DQuat, DVec3) {
        let [rotation_rad, obliquity_rad, tilt_rad] =
            spline_at(&self.turns_rad, time_s * GRID_HZ).to_array();
        let turned = PelvisAngles { rotation_rad, obliquity_rad, tilt_rad };
        (turned.to_orientation(), spline_at(&self.roots_m, time_s * GRID_HZ))
    }
}

/// Between points that are already smooth: the uniform cubic B-spline they span, whose acceleration has no
/// jumps; the first and the last point go on.
fn spline_at(points: &[DVec3], at: f64) -> DVec3 {
    let last = points.len().saturating_sub(1);
    let whole = at.floor();
    let u = at - whole;
    // Times are not negative; the cast saturates.
    let whole = whole as usize;
    let point = |ahead: usize| points[(whole + ahead).saturating_sub(1).min(last)];
    let weights = [
        (1.0 - u).powi(3),
        3.0 * u.powi(3) - 6.0 * u * u + 4.0,
        -3.0 * u.powi(3) + 3.0 * u * u + 3.0 * u + 1.0,
        u.powi(3),
    ];
    let middle = point(1);
    let about = weights.into_iter().enumerate().map(|(i, weight)| (point(i) - middle) * weight);
    middle + about.sum::<DVec3>() / 6.0
}

/// What a body does from 0 s to an end, every degree of freedom at rest at both (Zheng et al. 2007,
/// Eqs. 2, 3).
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    tracks: Vec<Sequence>,
    duration_s: f64,
    flights_s: Vec<(f64, f64)>,
    heading_rad: f64,
}

impl Motion {
    /// A motion of 22 chains, in the order of [`Dof::ALL`], each beginning at 0 s; those that end
    /// early rest to the end of the longest.
    ///
    /// # Errors
    /// If there are not 22, one does not begin at 0 s, or nothing lasts any time.
    pub fn new(tracks: Vec<Sequence>) -> Result<Self, Error> {
        if tracks.len() != Dof::ALL.len() || tracks.iter().any(|track| track.begin_s() != 0.0) {
            return Err(Error::new("a motion is not 22 chains that begin at 0 s"));
        }
        let duration_s = tracks.iter().map(Sequence::end_s).fold(0.0, f64::max);
        if !(duration_s > 0.0) {
            return Err(Error::new("a motion has no duration"));
        }
        let rested = tracks.into_iter().map(|track| resting_until(track, duration_s));
        let tracks = rested.collect::<Result<_, _>>()?;
        Ok(Self { tracks, duration_s, flights_s: Vec::new(), heading_rad: 0.0 })
    }

    /// The same motion with times, s, in which no foot touches the ground: from, to.
    ///
    /// # Errors
    /// If they are not inside the motion and one after the other.
    pub fn in_flight(mut self, flights_s: Vec<(f64, f64)>) -> Result<Self, Error> {
        let mut since_s = 0.0;
        for (from_s, to_s) in &flights_s {
            if !(since_s <= *from_s && from_s < to_s && *to_s <= self.duration_s) {
                return Err(Error::new("a flight is not inside the motion, or overlaps another")
                    .got(format!("{from_s} to {to_s} s"))
                    .allowed(format!("{since_s} to {} s", self.duration_s)));
            }
            since_s = *to_s;
        }
        self.flights_s = flights_s;
        Ok(self)
    }

    /// The same motion of a body that faces so far to the left of +X at first, rad.
    #[must_use]
    pub const fn facing(mut self, heading_rad: f64) -> Self {
        self.heading_rad = heading_rad;
        self
    }

    /// How long it lasts, s.
    #[must_use]
    pub const fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// Times in which no foot touches the ground, s.
    #[must_use]
    pub fn flights_s(&self) -> &[(f64, f64)] {
        &self.flights_s
    }

    /// The chain of a degree of freedom.
    #[must_use]
    pub fn track(&self, dof: Dof) -> &Sequence {
        &self.tracks[dof.index()]
    }

    /// Angle and derivatives of a degree of freedom at a time.
    #[must_use]
    pub fn at(&self, dof: Dof, time_s: f64) -> State {
        self.track(dof).at(time_s)
    }

    /// All angles at a time.
    #[must_use]
    pub fn angles_at(&self, time_s: f64) -> JointAngles {
        JointAngles(Dof::ALL.map(|dof| self.at(dof, time_s).position_rad))
    }

    /// Number of poses at a rate: one at 0 s, the last at the end or just before it.
    ///
    /// # Errors
    /// If the rate is not in [`RATES_HZ`] or there are more than [`MAX_POSES`].
    pub fn pose_count(&self, rate_hz: f64) -> Result<usize, Error> {
        if !RATES_HZ.contains(&rate_hz) {
            return Err(Error::new("the rate of a motion is out of range")
                .got(format!("{rate_hz} Hz"))
                .allowed(format!("{} to {} Hz", RATES_HZ.start(), RATES_HZ.end())));
        }
        let poses = (self.duration_s * rate_hz + SAME_INSTANT_S * rate_hz).floor() + 1.0;
        if !(poses <= MAX_POSES as f64) {
            return Err(Error::new("a motion has too many poses")
                .got(format!("{poses} at {rate_hz} Hz"))
                .allowed(format!("{MAX_POSES}"))
                .remedy("lower the rate, or make it shorter"));
        }
        Ok(poses as usize)
    }

    /// Angles at an even rate from 0 s on.
    ///
    /// # Errors
    /// As [`Self::pose_count`].
    pub fn sampled(&self, rate_hz: f64) -> Result<Vec<JointAngles>, Error> {
        let mut poses = vec![JointAngles::default(); self.pose_count(rate_hz)?];
        let mut column = vec![0.0; poses.len()];
        for (dof, track) in Dof::ALL.into_iter().zip(&self.tracks) {
            track.sample_into(rate_hz, &mut column);
            for (pose, angle_rad) in poses.iter_mut().zip(&column) {
                pose[dof] = *angle_rad;
            }
        }
        Ok(poses)
    }

    /// Poses at an even rate from 0 s on, of a body with these proportions that starts above the
    /// origin, facing +X: on the foot that stands ([`stance`]), or in free fall ([`root`]).
    ///
    /// # Errors
    /// As [`Self::pose_count`].
    pub fn poses(&self, body: &Proportions, rate_hz: f64) -> Result<Vec<SegmentPose>, Error> {
        let placed = self.placed(body, rate_hz)?.into_iter();
        Ok(placed
            .map(|(angles, pelvis, root_m)| stance::on_flat_soles(&angles, root_m, pelvis))
            .collect())
    }

    /// The same as angles, how the pelvis is turned in the world, and where the root (between the hip
    /// joints) is, m.
    ///
    /// # Errors
    /// As [`Self::pose_count`].
    pub fn placed(
        &self,
        body: &Proportions,
        rate_hz: f64,
    ) -> Result<Vec<(JointAngles, DQuat, DVec3)>, Error> {
        let angles = self.sampled(rate_hz)?;
        let grid = self.on_grid(body)?;
        let place = |(index, angles): (usize, JointAngles)| {
            let (pelvis, root_m) = grid.at(index as f64 / rate_hz);
            (angles, pelvis, root_m)
        };
        Ok(angles.into_iter().enumerate().map(place).collect())
    }

    /// Where the pelvis is at a fixed rate, whatever the rate asked for: feet and floor meet within
    /// milliseconds.
    fn on_grid(&self, body: &Proportions) -> Result<PelvisPath, Error> {
        let mut angles = self.sampled(GRID_HZ)?;
        // The last may lie just before the end.
        angles.push(self.angles_at(self.duration_s));
        let poses = stance::poses(body, &angles, GRID_HZ);
        let turns = poses.iter().map(|pose| pose.orientation[Segment::Pelvis.index()]);
        let heading = DVec3::X * self.heading_rad;
        let turns_rad = turns.map(|turn| DVec3::from(PelvisAngles::of(turn).to_array()) + heading);
        let faces = DQuat::from_rotation_z(self.heading_rad);
        let roots_m = root::path_m(body, &poses, GRID_HZ);
        Ok(PelvisPath {
            turns_rad: turns_rad.collect(),
            roots_m: roots_m.into_iter().map(|root_m| faces * root_m).collect(),
        })
    }

    /// Actionlets that move, over all degrees of freedom.
    pub fn moving(&self) -> impl Iterator<Item = (Dof, &Actionlet)> {
        Dof::ALL.into_iter().zip(&self.tracks).flat_map(|(dof, track)| {
            track
                .actionlets()
                .iter()
                .filter(|piece| !piece.is_rest())
                .map(move |piece| (dof, piece))
        })
    }

    /// The same motion in another time: every duration times `factor`.
    ///
    /// # Errors
    /// If the factor is not finite or not above zero.
    pub fn stretched(&self, factor: f64) -> Result<Self, Error> {
        let tracks = self.tracks.iter().map(|track| {
            let start = Sequence::starting_at(0.0, track.from_rad())?;
            track.actionlets().iter().try_fold(start, |chain, piece| {
                chain.then(piece.duration_s() * factor, piece.to_rad(), piece.shape().clone())
            })
        });
        let tracks = tracks.collect::<Result<Vec<_>, Error>>()?;
        let mut stretched = Self::new(tracks)?.facing(self.heading_rad);
        let flights = self.flights_s.iter();
        stretched.flights_s = flights.map(|(from, to)| (from * factor, to * factor)).collect();
        Ok(stretched)
    }

    /// Chains, in the order of [`Dof::ALL`].
    #[must_use]
    pub fn into_tracks(self) -> Vec<Sequence> {
        self.tracks
    }
}

/// Appends a rest up to `end_s` unless the chain is there already.
///
/// # Errors
/// As [`Sequence::then`].
pub fn resting_until(chain: Sequence, end_s: f64) -> Result<Sequence, Error> {
    let left_s = end_s - chain.end_s();
    if left_s > SAME_INSTANT_S { chain.rest(left_s) } else { Ok(chain) }
}

/// Appends an actionlet that ends at `end_s`.
///
/// # Errors
/// As [`Sequence::then`].
pub fn then_until(
    chain: Sequence,
    end_s: f64,
    to_rad: f64,
    shape: Shape,
) -> Result<Sequence, Error> {
    let duration_s = end_s - chain.end_s();
    chain.then(duration_s, to_rad, shape)
}
