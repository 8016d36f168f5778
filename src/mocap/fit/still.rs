//! Where a person stands still in a trial, and which way is up there; what is not seen, filled in.

use super::marker_set::{MarkerPlace, PLACES, SeenMarkers};
use crate::error::{Error, ErrorKind};
use crate::mocap::markers::Head;
use glam::{DQuat, DVec3};

/// How long somebody must stand still to be calibrated, s.
const STILL_S: f64 = 0.5;
/// Cosine of how far a person may lean from an axis of the file to stand along it: 35 degrees.
const STANDS: f64 = 0.82;
/// A half second in which markers move faster than this on average is no standing still, m/s. Ours.
const STILL_M_S: f64 = 0.05;

/// The mean of every marker over the half second in which markers move least, m, axes of the file. Among half
/// seconds, those in which most markers were seen come first.
pub fn quietest(
    frames: usize,
    seen: &dyn Fn(usize) -> SeenMarkers,
    rate_hz: f64,
    notes: &mut Vec<String>,
) -> Result<SeenMarkers, Error> {
    let length = ((STILL_S * rate_hz).round() as usize).clamp(1, frames.max(1));
    if frames == 0 {
        return Err(Error::of(ErrorKind::Absent, "there are no frames to calibrate from"));
    }
    let mut before = seen(0);
    // Of each frame: mean speed of markers since the last one, and how many are seen.
    let mut speeds = vec![0.0];
    let mut counts = vec![before.iter().flatten().count()];
    for frame in 1..frames {
        let now = seen(frame);
        let moves = now.iter().zip(&before).filter_map(|(a, b)| Some(a.as_ref()?.distance((*b)?)));
        let (sum, count) = moves.fold((0.0, 0_usize), |(sum, n), m| (sum + m, n + 1));
        speeds.push(if count > 0 { sum / count as f64 * rate_hz } else { f64::INFINITY });
        counts.push(now.iter().flatten().count());
        before = now;
    }
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let windows = (0..=frames - length).map(|start| {
        let all = start..start + length;
        let most = counts[all.clone()].iter().max().copied().unwrap_or(0);
        (start, most, mean(&speeds[all]))
    });
    let best = windows.min_by(|a, b| b.1.cmp(&a.1).then(a.2.total_cmp(&b.2)));
    let (start, _, speed) = best.unwrap_or((0, 0, 0.0));
    let of = |frame: usize| frame as f64 / rate_hz;
    notes.push(format!(
        "calibrated from {:.2} to {:.2} s, where markers move least: {:.0} mm/s on average",
        of(start),
        of(start + length - 1),
        speed * 1e3
    ));
    if speed > STILL_M_S {
        notes.push(
            "nobody stands still there: joints and zero angles are as that half second shows them; a \
             static trial is better (--static FILE)"
                .to_owned(),
        );
    }
    let (mut sums, mut seen_in) = ([DVec3::ZERO; PLACES], [0_usize; PLACES]);
    for frame in start..start + length {
        for (at, place) in seen(frame).into_iter().enumerate() {
            if let Some(place) = place {
                sums[at] += place;
                seen_in[at] += 1;
            }
        }
    }
    Ok(std::array::from_fn(|at| (seen_in[at] > 0).then(|| sums[at] / seen_in[at] as f64)))
}

/// The turn that makes Z of the axis of the file that is up: along which the person stands.
pub fn upright(still: &SeenMarkers, head: &Head) -> Result<DQuat, Error> {
    let mean = |places: &[MarkerPlace]| {
        let seen: Vec<DVec3> = places.iter().filter_map(|place| still[*place as usize]).collect();
        (!seen.is_empty()).then(|| seen.iter().sum::<DVec3>() / seen.len() as f64)
    };
    let feet = mean(&[MarkerPlace::LANK, MarkerPlace::RANK, MarkerPlace::LHEE, MarkerPlace::RHEE]);
    let top = mean(&[MarkerPlace::C7, MarkerPlace::CLAV])
        .or_else(|| mean(&[MarkerPlace::LASI, MarkerPlace::RASI]));
    let stands = feet.zip(top).and_then(|(feet, top)| (top - feet).try_normalize());
    let axes = [DVec3::X, DVec3::Y, DVec3::Z].into_iter().flat_map(|axis| [axis, -axis]);
    let up = stands.and_then(|along| axes.clone().find(|axis| axis.dot(along) >= STANDS));
    let said = || {
        axes.clone()
            .zip(["+X", "-X", "+Y", "-Y", "+Z", "-Z"])
            .find(|(_, name)| head.screen[1].eq_ignore_ascii_case(name))
    };
    let up = up.or_else(|| said().map(|(axis, _)| axis)).ok_or_else(|| {
        Error::of(ErrorKind::Refused, "it cannot be told which way is up")
            .got("a person who does not stand, in a file that does not say which axis is up")
            .remedy("calibrate with a trial in which the person stands: --static FILE")
    })?;
    // From Y up to Z up the usual way: X stays.
    Ok(DQuat::from_rotation_arc(up, DVec3::Z))
}

/// A series without its gaps, and where they were. What is missing at the ends is as the nearest; nothing if all
/// is missing.
pub fn filled<T: Copy>(
    seen: &[Option<T>],
    between: impl Fn(T, T, f64) -> T,
) -> (Vec<T>, Vec<(usize, usize)>) {
    let (mut filled, mut gaps) = (Vec::with_capacity(seen.len()), Vec::new());
    let mut at = 0;
    while at < seen.len() {
        if let Some(value) = seen[at] {
            filled.push(value);
            at += 1;
            continue;
        }
        let end = (at..seen.len()).find(|&next| seen[next].is_some()).unwrap_or(seen.len());
        let before = filled.last().copied();
        let after = seen.get(end).copied().flatten();
        let (Some(from), Some(to)) = (before.or(after), after.or(before)) else {
            return (Vec::new(), vec![(0, seen.len())]);
        };
        let steps = (end - at + 1) as f64;
        filled.extend((at..end).map(|n| between(from, to, (n - at + 1) as f64 / steps)));
        gaps.push((at, end));
        at = end;
    }
    (filled, gaps)
}
