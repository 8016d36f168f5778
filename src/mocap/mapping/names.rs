//! What the names of joints say: side and body part, in the dialects seen in the field (CMU and
//! Acclaim, HDM05, Poser and Daz, Mixamo, Xsens MVN, Rokoko, Perception Neuron, LAFAN1, Bandai
//! Namco, 3ds Max Biped, MotionBuilder, Unreal, Unity, VRM, SMPL, Vicon, Nokov).

use std::collections::BTreeMap;

/// Side of the body a name gives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The person's left.
    Left,
    /// The person's right.
    Right,
    /// On the midline, or not said.
    Middle,
}

/// Parts of a limb or of the trunk that names are searched for, with the words for each. A word
/// earlier in the list is the surer one: `LeftShoulder` is the collarbone where there is a
/// `LeftArm`, and the upper arm where there is none.
pub const THIGH: &[&str] =
    &["thigh", "upleg", "upperleg", "legupper", "upperthigh", "femur", "hip", "leg"];
/// Below the knee.
pub const SHANK: &[&str] =
    &["shin", "shank", "calf", "lowerleg", "lowleg", "leglower", "tibia", "knee", "leg"];
/// From the ankle.
pub const FOOT: &[&str] = &["ankle", "foot"];
/// From the ball of the foot.
pub const TOE: &[&str] =
    &["toe", "toes", "toebase", "ball", "forefoot", "football", "toejoint", "bigtoe", "foot"];
/// From the shoulder joint.
pub const UPPER_ARM: &[&str] =
    &["upperarm", "uparm", "armupper", "humerus", "shldr", "bicep", "arm", "shoulder"];
/// From the elbow.
pub const FOREARM: &[&str] =
    &["forearm", "lowerarm", "lowarm", "armlower", "radius", "ulna", "elbow"];
/// From the wrist.
pub const HAND: &[&str] = &["wrist", "hand", "palm"];
/// The head, without its decorations.
pub const HEAD: &[&str] = &["head", "skull"];
/// The neck.
pub const NECK: &[&str] = &["neck", "lowerneck", "upperneck", "neckbase", "cervical"];
/// The pelvis.
pub const PELVIS: &[&str] = &["hips", "pelvis", "hip"];

const ALL: [&[&str]; 10] = [THIGH, SHANK, FOOT, TOE, UPPER_ARM, FOREARM, HAND, HEAD, NECK, PELVIS];

/// Words with a side that name no segment of ours, for splitting `lclavicle` and the like.
const OTHERS: &[&str] =
    &["clavicle", "collar", "hipjoint", "buttock", "fingers", "finger", "thumb", "eye"];

/// Parts of names that only decorate: `ThighBend`, `shoulder_jnt`.
const DECORATIONS: &[&str] = &["bend", "bone", "jnt", "joint", "bind", "def", "skin", "link"];

/// A name taken apart.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Name {
    /// Side, if said.
    pub side: Side,
    /// What is left, lower case, letters only: `upleg`.
    pub word: String,
}

/// Takes the names of all joints of one skeleton apart.
#[must_use]
pub fn parse(names: &[&str]) -> Vec<Name> {
    let mut stems: Vec<&str> =
        names.iter().map(|name| name.rsplit([':', '|']).next().unwrap_or(name)).collect();
    while let Some(prefix) = common_prefix(&stems) {
        for stem in &mut stems {
            *stem = stem.strip_prefix(prefix.as_str()).unwrap_or(stem);
        }
    }
    stems.iter().map(|stem| parse_one(stem)).collect()
}

/// What at least four of five names begin with, up to and including a separator: `Bip01 `,
/// `mixamorig_`, `Character1_`.
fn common_prefix(stems: &[&str]) -> Option<String> {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for stem in stems {
        if let Some(end) = stem.find(['_', ' ', '.', '-'])
            && end + 1 < stem.len()
        {
            *counts.entry(&stem[..=end]).or_default() += 1;
        }
    }
    let (prefix, count) = counts.into_iter().max_by_key(|(_, count)| *count)?;
    (stems.len() >= 5 && 5 * count >= 4 * stems.len()).then(|| prefix.to_owned())
}

fn parse_one(stem: &str) -> Name {
    let mut side = Side::Middle;
    let mut words = Vec::new();
    for token in tokens(stem) {
        match token.as_str() {
            "l" | "left" | "lft" | "lt" => side = Side::Left,
            "r" | "right" | "rgt" | "rt" => side = Side::Right,
            word => words.push(word.to_owned()),
        }
    }
    // `LHipJoint` is a stub above the hip joint, not the thigh: only a trailing decoration of a
    // word known without it goes.
    while words.len() > 1
        && words.last().is_some_and(|last| DECORATIONS.contains(&last.as_str()))
        && !OTHERS.contains(&words.concat().as_str())
    {
        words.pop();
    }
    let mut word = words.concat();
    if side == Side::Middle
        && let Some((found, rest)) = fused_side(&word)
    {
        (side, word) = (found, rest);
    }
    Name { side, word }
}

/// `leftupleg` and `lfemur`: a side written into the word.
fn fused_side(word: &str) -> Option<(Side, String)> {
    let known =
        |rest: &str| ALL.iter().any(|words| words.contains(&rest)) || OTHERS.contains(&rest);
    let sides =
        [("left", Side::Left), ("right", Side::Right), ("l", Side::Left), ("r", Side::Right)];
    for (mark, side) in sides {
        let rest = word.strip_prefix(mark).or_else(|| word.strip_suffix(mark));
        if let Some(rest) = rest
            && known(rest)
        {
            return Some((side, rest.to_owned()));
        }
    }
    None
}

/// Lower-case words of a name; digits and signs separate, as do capitals.
fn tokens(stem: &str) -> Vec<String> {
    let letters: Vec<char> = stem.chars().collect();
    let mut tokens = Vec::new();
    let mut token = String::new();
    for (at, letter) in letters.iter().enumerate() {
        let next_is_lower = letters.get(at + 1).is_some_and(|next| next.is_lowercase());
        let after_lower = at > 0 && letters[at - 1].is_lowercase();
        let starts = letter.is_uppercase() && (after_lower || next_is_lower);
        if (starts || !letter.is_alphabetic()) && !token.is_empty() {
            tokens.push(std::mem::take(&mut token));
        }
        if letter.is_alphabetic() {
            token.extend(letter.to_lowercase());
        }
    }
    if !token.is_empty() {
        tokens.push(token);
    }
    tokens
}

/// The joint that fits a part best: the surest word, and of equals the first in the file.
#[must_use]
pub fn find(
    names: &[Name],
    side: Side,
    words: &[&str],
    allowed: impl Fn(usize) -> bool,
) -> Option<usize> {
    words.iter().find_map(|word| {
        (0..names.len())
            .find(|at| names[*at].side == side && names[*at].word == *word && allowed(*at))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one(name: &str) -> (Side, String) {
        let name = parse_one(name);
        (name.side, name.word)
    }

    #[test]
    fn every_dialect_names_its_sides_and_parts() {
        let cases = [
            ("LeftUpLeg", Side::Left, "upleg"),
            ("LHipJoint", Side::Left, "hipjoint"),
            ("lfemur", Side::Left, "femur"),
            ("rradius", Side::Right, "radius"),
            ("lShldr", Side::Left, "shldr"),
            ("rButtock", Side::Right, "buttock"),
            ("UpperArm_L", Side::Left, "upperarm"),
            ("thigh_l", Side::Left, "thigh"),
            ("upperarm.R", Side::Right, "upperarm"),
            ("L_Hip", Side::Left, "hip"),
            ("L Calf", Side::Left, "calf"),
            ("lThighBend", Side::Left, "thigh"),
            ("RightFoot", Side::Right, "foot"),
            ("Left_elbow", Side::Left, "elbow"),
            ("Spine1", Side::Middle, "spine"),
            ("Head", Side::Middle, "head"),
            ("lowerback", Side::Middle, "lowerback"),
            ("LowerNeck", Side::Middle, "lowerneck"),
            ("root", Side::Middle, "root"),
        ];
        for (name, side, word) in cases {
            assert_eq!(one(name), (side, word.to_owned()), "{name}");
        }
    }

    #[test]
    fn prefixes_common_to_a_skeleton_are_dropped() {
        for prefix in ["mixamorig:", "Bip01 ", "Character1_", "J_Bip_", "subject:Bip001 "] {
            let bare = ["Pelvis", "Spine", "L_Thigh", "L_Calf", "Head", "R_Thigh"];
            let full: Vec<String> = bare.iter().map(|name| format!("{prefix}{name}")).collect();
            let full: Vec<&str> = full.iter().map(String::as_str).collect();
            assert_eq!(parse(&full), parse(&bare), "{prefix}");
        }
    }
}
