//! A marker as part of a rigid body: the markers whose distance to it hardly changes are laid over how they lay before
//! the gap, and carry it along.

use super::super::edge::bridge;
use super::super::neighbours::Neighbour;
use super::super::trial::{Gap, Trial};
use super::donors;
use crate::mocap::fit::rigid::{Lie, Pair, register};
use glam::{DQuat, DVec3};

/// Markers of the body beside the one that is missing.
const DONORS: usize = 4;
/// Fewest of them: two leave a turn open.
const FEWEST: usize = 3;
/// Distances that vary more are those of no body, m.
const LOOSEST_M: f64 = 0.03;
/// Frames on each side by which it is known where the marker sits.
const SEATED: usize = 24;

pub(super) fn fill(trial: &Trial, gap: &Gap, near: &[Neighbour]) -> Option<Vec<DVec3>> {
    let body: Vec<Neighbour> =
        near.iter().copied().take_while(|of| of.spread_m <= LOOSEST_M).collect();
    let donors: Vec<usize> = donors(trial, gap, &body, DONORS).iter().map(|of| of.marker).collect();
    if donors.len() < FEWEST {
        return None;
    }
    let places = |frame: usize| -> Option<Vec<DVec3>> {
        donors.iter().map(|marker| trial.at(*marker, frame)).collect()
    };
    let reference = places(gap.frames.start - 1)?;
    let middle = reference.iter().sum::<DVec3>() / reference.len() as f64;
    let own: Vec<DVec3> = reference.into_iter().map(|place| place - middle).collect();
    let lie = |frame: usize| -> Option<Lie> {
        let pairs: Vec<Pair> = own
            .iter()
            .zip(places(frame)?)
            .map(|(own_m, world_m)| Pair { own_m: *own_m, world_m, weight: 1.0 })
            .collect();
        // Once more from where the first ended, since what is known before has some weight.
        let first = register(&pairs, None, DQuat::IDENTITY)?;
        register(&pairs, None, first.turn)
    };
    let first = gap.frames.start.saturating_sub(SEATED);
    let around = (first..gap.frames.start).chain(gap.frames.end..gap.frames.end + SEATED);
    let seats: Vec<DVec3> =
        around.filter_map(|frame| Some(lie(frame)?.own(trial.at(gap.marker, frame)?))).collect();
    if seats.is_empty() {
        return None;
    }
    let seat = seats.iter().sum::<DVec3>() / seats.len() as f64;
    bridge(trial, gap, |frame| Some(lie(frame)?.world(seat)))
}
