//! Which source is worn by whom and where: its name says so.

use crate::body::Segment;
use crate::body::segment_named;

/// Who wears a source of this name, counted from zero, and where: `torso`, or `2-torso` for the
/// second subject. `None` if it is not worn.
#[must_use]
pub fn wearer(source: &str) -> Option<(usize, Segment)> {
    let (subject, name) = match source.split_once('-') {
        Some(("1", name)) => (0, name),
        Some(("2", name)) => (1, name),
        _ => (0, source),
    };
    Some((subject, segment_named(name).ok()?))
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
    fn a_source_is_named_like_the_segment_and_if_need_be_the_subject() {
        for segment in Segment::ALL {
            let name = crate::body::segment_name(segment);
            assert_eq!(wearer(name), Some((0, segment)));
            assert_eq!(wearer(&name.replace('_', "-")), Some((0, segment)));
            assert_eq!(wearer(&format!("1-{name}")), Some((0, segment)));
            assert_eq!(wearer(&format!("2-{name}")), Some((1, segment)));
        }
        for name in ["", "3-torso", "left", "lines", "2-"] {
            assert_eq!(wearer(name), None, "{name}");
        }
        let both = worn_by(1, ["torso", "2-torso", "2-head", "desk"].into_iter());
        assert_eq!(both, [("2-torso", Segment::Torso), ("2-head", Segment::Head)]);
    }
}
