//! A trial as a capture.

use crate::body::{Segment, SegmentPose, segment_name};
use crate::corpus::rows::TrialEntry;
use crate::mocap::anatomy::Capture;

/// A trial with these poses.
pub(in crate::job) fn capture_of(entry: &TrialEntry, poses: Vec<SegmentPose>) -> Capture {
    let unseen: Vec<&str> =
        entry.untracked.as_deref().unwrap_or_default().split_whitespace().collect();
    Capture {
        rate_hz: entry.rate_hz,
        poses,
        tracked: Segment::ALL.map(|segment| !unseen.contains(&segment_name(segment))),
        stature_m: entry.body_stature_m,
        is_made: entry.synthetic,
        notes: Vec::new(),
    }
}
