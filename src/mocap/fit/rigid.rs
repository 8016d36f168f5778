//! The turn that lays points over points best (Kabsch, Acta Crystallographica A32, 1976; Söderkvist and Wedin,
//! "Determining the movements of the skeleton using well-configured markers", Journal of Biomechanics 26, 1993).

use glam::{DMat3, DQuat, DVec3};
use nalgebra::Matrix3;

/// A residual that halves a marker's weight, m: a marker that has slipped or was taken for another counts for
/// little, one on moving skin counts.
const DOUBT_M: f64 = 0.02;
/// Rounds of weighing.
const ROUNDS: usize = 4;
/// How much the turn before counts against what markers say: as points this far out, m, and of this weight.
const MEMORY_M: f64 = 0.05;
const MEMORY: f64 = 0.01;

/// A point of a segment: where it is on the segment, where it was seen, and how much it counts.
#[derive(Clone, Copy, Debug)]
pub struct Pair {
    /// In the segment's own frame, m.
    pub own_m: DVec3,
    /// In the world, m.
    pub world_m: DVec3,
    /// Its weight.
    pub weight: f64,
}

/// How a segment lies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lie {
    /// From the segment's frame to the world.
    pub turn: DQuat,
    /// The frame's origin in the world, m.
    pub at_m: DVec3,
}

impl Lie {
    /// A point of the segment in the world.
    #[must_use]
    pub fn world(&self, own_m: DVec3) -> DVec3 {
        self.at_m + self.turn * own_m
    }

    /// A point of the world on the segment.
    #[must_use]
    pub fn own(&self, world_m: DVec3) -> DVec3 {
        self.turn.inverse() * (world_m - self.at_m)
    }
}

/// Lays a segment over what was seen of it, points that do not go with the others counting less. `before` is how it
/// would be turned by what is known without them: it decides what they leave open. `at_m` is where its origin is, if
/// that is known; else three points are needed, or two where what is known decides the rest. `None` if there is no
/// point, or too few.
#[must_use]
pub fn register(pairs: &[Pair], at_m: Option<DVec3>, before: DQuat) -> Option<Lie> {
    let needed = if at_m.is_some() { 1 } else { 2 };
    if pairs.len() < needed {
        return None;
    }
    let mut lie = once(pairs, at_m, before, |_| 1.0)?;
    // Of two points nobody can tell which of them is wrong.
    if pairs.len() >= 3 {
        for _ in 0..ROUNDS {
            let last = lie;
            let trusted = |pair: &Pair| trust((last.world(pair.own_m) - pair.world_m).length());
            lie = once(pairs, at_m, before, trusted)?;
        }
    }
    Some(lie)
}

/// How much a marker counts that is so far from where the others have it, m: a half at 2 cm, and less and less.
#[must_use]
pub fn trust(off_m: f64) -> f64 {
    let off = off_m / DOUBT_M;
    1.0 / (1.0 + off * off)
}

/// The turn that lays points over points, both about their middles, all counting alike; `None` of none.
#[must_use]
pub fn turn_over(own: &[DVec3], world: &[DVec3]) -> Option<DQuat> {
    let pair =
        |(own_m, world_m): (&DVec3, &DVec3)| Pair { own_m: *own_m, world_m: *world_m, weight: 1.0 };
    let pairs: Vec<Pair> = own.iter().zip(world).map(pair).collect();
    once(&pairs, None, DQuat::IDENTITY, |_| 1.0).map(|lie| lie.turn)
}

fn once(
    pairs: &[Pair],
    at_m: Option<DVec3>,
    before: DQuat,
    trust: impl Fn(&Pair) -> f64,
) -> Option<Lie> {
    let weights: Vec<f64> = pairs.iter().map(|pair| pair.weight * trust(pair)).collect();
    let total: f64 = weights.iter().sum();
    let mean = |of: fn(&Pair) -> DVec3| {
        pairs.iter().zip(&weights).map(|(pair, weight)| of(pair) * *weight).sum::<DVec3>() / total
    };
    let (own, world) = match at_m {
        Some(at_m) => (DVec3::ZERO, at_m),
        None => (mean(|pair| pair.own_m), mean(|pair| pair.world_m)),
    };
    let memory = DMat3::from_quat(before) * (MEMORY * MEMORY_M * MEMORY_M);
    let mut sum = memory;
    for (pair, weight) in pairs.iter().zip(&weights) {
        let (a, b) = (pair.own_m - own, (pair.world_m - world) * *weight);
        sum += DMat3::from_cols(b * a.x, b * a.y, b * a.z);
    }
    if !sum.is_finite() {
        return None;
    }
    let svd = Matrix3::from_column_slice(&sum.to_cols_array()).svd(true, true);
    let (u, v) = (svd.u?, svd.v_t?);
    let mut keep = Matrix3::identity();
    keep[(2, 2)] = (u.determinant() * v.determinant()).signum();
    let turn = u * keep * v;
    let turn = DMat3::from_cols_array(turn.as_slice().try_into().ok()?);
    let turn = DQuat::from_mat3(&turn).normalize();
    Some(Lie { turn, at_m: at_m.unwrap_or(world - turn * own) })
}

#[cfg(test)]
mod tests {
    use super::trust;

    #[test]
    fn a_marker_that_is_off_takes_a_joint_with_it_by_a_centimetre_at_most() {
        let moved = |off_m: f64| off_m * trust(off_m);
        assert!(moved(0.002) > 0.0019, "a marker on moving skin takes it all the way");
        assert!((0..1000_u32).all(|mm| moved(f64::from(mm) / 1e3) < 0.0101));
        assert!(moved(0.5) < 0.001, "one that was taken for another hardly");
    }
}
