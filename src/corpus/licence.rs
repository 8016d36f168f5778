//! What a licence allows, as far as its name tells.

/// What may be done with motions under a licence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Licence {
    /// Not for what earns money.
    pub noncommercial: bool,
    /// What is made of them may not be passed on.
    pub no_derivatives: bool,
    /// Nobody said which licence it is.
    pub unknown: bool,
}

/// The word for a licence that nobody knows.
pub const UNKNOWN: &str = "unknown";

impl Licence {
    /// By its name, as SPDX writes it: `CC-BY-NC-4.0`, `CC-BY-ND-4.0`, `CC0-1.0`. The parts NC and ND count, and so do
    /// the words `noncommercial` and `non-commercial`; whatever else it says is left to whoever reads it.
    #[must_use]
    pub fn of(name: &str) -> Self {
        let lower = name.to_ascii_lowercase();
        let has = |part: &str| lower.split(|c: char| !c.is_ascii_alphanumeric()).any(|p| p == part);
        let says = |words: &str| lower.contains(words);
        Self {
            noncommercial: has("nc") || says("noncommercial") || says("non-commercial"),
            no_derivatives: has("nd") || says("noderiv") || says("no-deriv"),
            unknown: lower.trim().is_empty() || lower.trim() == UNKNOWN,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_name_of_a_licence_tells_what_it_forbids() {
        let of = |name| {
            let Licence { noncommercial, no_derivatives, unknown } = Licence::of(name);
            (noncommercial, no_derivatives, unknown)
        };
        assert_eq!(of("CC-BY-4.0"), (false, false, false));
        assert_eq!(of("CC-BY-NC-4.0"), (true, false, false));
        assert_eq!(of("cc-by-nc-nd-4.0"), (true, true, false));
        assert_eq!(of("CC BY-ND 4.0"), (false, true, false));
        assert_eq!(of("for non-commercial use"), (true, false, false));
        assert_eq!(of("MIT OR Apache-2.0 (INC)"), (false, false, false));
        assert_eq!(of("unknown"), (false, false, true));
        assert_eq!(of(" "), (false, false, true));
    }
}
