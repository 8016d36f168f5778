//! Names of body segments, and which source is worn by whom and where.

use crate::body::Segment;

/// Names in files and of sources, by [`Segment::index`].
const NAMES: [&str; 13] = [
    "pelvis",
    "torso",
    "head",
    "left_upper_arm",
    "left_forearm",
    "right_upper_arm",
    "right_forearm",
    "left_thigh",
    "left_shank",
    "left_foot",
    "right_thigh",
    "right_shank",
    "right_foot",
];

/// Name of a segment in files.
#[must_use]
pub const fn segment_name(segment: Segment) -> &'static str {
    NAMES[segment.index()]
}

/// The segment of a name; `-` is as good as `_`.
#[must_use]
pub fn segment_named(name: &str) -> Option<Segment> {
    let name = name.replace('-', "_");
    Segment::ALL.into_iter().find(|segment| segment_name(*segment) == name)
}

/// All names, for a person who has to choose one.
#[must_use]
pub fn segment_names() -> String {
    NAMES.join(", ")
}

/// Who wears a source of this name, counted from zero, and where: `torso`, or `2-torso` for the
/// second subject. `None` if it is not worn.
#[must_use]
pub fn wearer(source: &str) -> Option<(usize, Segment)> {
    let (subject, name) = match source.split_once('-') {
        Some(("1", name)) => (0, name),
        Some(("2", name)) => (1, name),
        _ => (0, source),
    };
    Some((subject, segment_named(name)?))
}

/// Sources that a subject wears, with their segments.
#[must_use]
pub fn worn_by<'a>(
    subject: usize,
    sources: impl Iterator<Item = &'a str>,
) -> Vec<(&'a str, Segment)> {
    let worn = |source: &'a str| {
        let (by, segment) = wearer(source)?;
        (by == subject).then_some((source, segment))
    };
    sources.filter_map(worn).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_segment_has_a_name_and_every_name_a_segment() {
        for segment in Segment::ALL {
            let name = segment_name(segment);
            assert_eq!(segment_named(name), Some(segment));
            assert_eq!(wearer(&name.replace('_', "-")), Some((0, segment)));
            assert_eq!(wearer(&format!("2-{name}")), Some((1, segment)));
            // As it is called in code, but for the case.
            assert_eq!(name.replace('_', ""), format!("{segment:?}").to_lowercase());
        }
        for name in ["", "3-torso", "left", "lines", "2-"] {
            assert_eq!(wearer(name), None, "{name}");
        }
    }
}
