//! Segments of the body by name, as files and people write them.

use super::Segment;
use crate::error::{Error, ErrorKind};

/// Name of a segment in mapping files and messages.
#[must_use]
pub const fn segment_name(segment: Segment) -> &'static str {
    match segment {
        Segment::Pelvis => "pelvis",
        Segment::Torso => "torso",
        Segment::Head => "head",
        Segment::LeftUpperArm => "left_upper_arm",
        Segment::LeftForearm => "left_forearm",
        Segment::RightUpperArm => "right_upper_arm",
        Segment::RightForearm => "right_forearm",
        Segment::LeftThigh => "left_thigh",
        Segment::LeftShank => "left_shank",
        Segment::LeftFoot => "left_foot",
        Segment::RightThigh => "right_thigh",
        Segment::RightShank => "right_shank",
        Segment::RightFoot => "right_foot",
    }
}

/// The segment of this name; hyphens count as underscores.
///
/// # Errors
/// No such segment.
pub fn segment_named(name: &str) -> Result<Segment, Error> {
    let wanted = name.replace('-', "_");
    let found = Segment::ALL.into_iter().find(|segment| segment_name(*segment) == wanted);
    found.ok_or_else(|| {
        Error::of(ErrorKind::Unknown, "no such segment of the body").none_of(
            name,
            Segment::ALL.map(segment_name),
            "take one of these",
        )
    })
}
