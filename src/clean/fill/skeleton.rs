//! A marker as part of a person's skeleton: each segment is laid over the markers that are seen, from the pelvis
//! outwards, and carries the marker along; and a bridge over what it misses.

use super::super::aids::CarryingBody;
use super::super::edge::{JUDGED, bridge};
use super::super::trial::{Gap, Trial};
use glam::DVec3;

pub(super) fn fill(trial: &Trial, gap: &Gap, body: &CarryingBody) -> Option<Vec<DVec3>> {
    let first = gap.frames.start.saturating_sub(JUDGED);
    let frames = first..(gap.frames.end + JUDGED).min(trial.frames());
    // What is not seen all through the gap does not help beside it either: it would be another prediction.
    let around = gap.frames.start.saturating_sub(1)..gap.frames.end + 1;
    let carried = body.carried(trial, gap.marker, frames, |marker| {
        !trial.is_seen_throughout(marker, around.clone())
    })?;
    bridge(trial, gap, |frame| carried.get(frame.checked_sub(first)?).copied().flatten())
}
