//! Model files: TOML that a person writes. The format is described in `docs/recognition.md`, for editors in
//! `models/schema.json`.

use super::{ActionModel, BodySide, Condition, FeatureRange, ModelPhase, Travel};
use crate::error::{Error, ErrorKind, counted};
use crate::recognise::features::{BodyAxis, Feature, MovingPart};
use crate::recognise::posture::MajorPosture;
use crate::toml_text::{from_toml, plain_words};
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};

/// Version of the format.
pub const SCHEMA: u32 = 1;
/// Most bytes of a model file.
pub const MAX_BYTES: usize = 1 << 18;
/// Most phases of a model.
pub const MAX_PHASES: usize = 32;
/// Longest gap, slack or phase, s.
const MAX_S: f64 = 60.0;

/// What the words for directions, amounts and speeds mean. The paper gives no numbers; these are ours. Amounts
/// are in limb lengths (thigh and shank, or upper arm and forearm), speeds in limb lengths per second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bands {
    /// What is faster moves forward, up, ...
    pub moves_l_s: f64,
    /// What is slower is fixed.
    pub fixed_l_s: f64,
    /// Short below, mean from here on ...
    pub mean_l: f64,
    /// ... to here, and long.
    pub long_l: f64,
    /// Slow below, normal from here on ...
    pub normal_l_s: f64,
    /// ... to here, and fast.
    pub fast_l_s: f64,
}

impl Default for Bands {
    fn default() -> Self {
        Self {
            moves_l_s: 0.15,
            fixed_l_s: 0.3,
            mean_l: 0.25,
            long_l: 0.6,
            normal_l_s: 0.5,
            fast_l_s: 1.5,
        }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawModel {
    schema: u32,
    name: String,
    action: Option<String>,
    side: Option<BodySide>,
    #[serde(default)]
    note: String,
    #[serde(default)]
    source: String,
    #[serde(default)]
    also: Vec<String>,
    mirror_of: Option<String>,
    gap_s: Option<f64>,
    #[serde(default)]
    slack_s: f64,
    #[serde(default)]
    phase: Vec<RawPhase>,
}

/// A posture, or several of which one must be.
#[derive(Deserialize)]
#[serde(untagged)]
enum Words {
    One(String),
    Some(Vec<String>),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawMove {
    frontal: Option<String>,
    vertical: Option<String>,
    sagittal: Option<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawPhase {
    name: String,
    lead: Option<String>,
    motion: Option<String>,
    space: Option<String>,
    posture: Option<Words>,
    #[serde(default)]
    minor: Vec<String>,
    root: Option<RawMove>,
    torso: Option<RawMove>,
    left_hand: Option<RawMove>,
    right_hand: Option<RawMove>,
    left_foot: Option<RawMove>,
    right_foot: Option<RawMove>,
    #[serde(default)]
    contact: Vec<String>,
    #[serde(default)]
    no_contact: Vec<String>,
    #[serde(default)]
    measure: BTreeMap<String, [f64; 2]>,
    #[serde(default)]
    average: BTreeMap<String, [f64; 2]>,
    duration_s: Option<[f64; 2]>,
    ends: Option<String>,
}

/// Where other models are looked up by name, for `mirror_of`.
pub type Models<'a> = &'a dyn Fn(&str) -> Result<ActionModel, Error>;

/// Finds no model to mirror: a model that is mirrored itself, or that stands alone, mirrors no other.
///
/// # Errors
/// Always, with the name that was asked for.
pub fn none_to_mirror(name: &str) -> Result<ActionModel, Error> {
    Err(Error::of(ErrorKind::Unknown, "there is no model here to mirror")
        .got(name)
        .remedy("name the model that has the phases: what is mirrored cannot be mirrored again"))
}

fn malformed(what: impl Into<String>) -> Error {
    Error::of(ErrorKind::Malformed, what)
}

/// Reads a model. `place` names the file in errors; `models` finds the one it mirrors.
///
/// # Errors
/// If the text is no model: with the phase, the key and the rule.
pub fn parse(
    text: &str,
    place: &str,
    bands: &Bands,
    models: Models<'_>,
) -> Result<ActionModel, Error> {
    if text.len() > MAX_BYTES {
        return Err(malformed("a model file is too long")
            .at(place)
            .got(counted(text.len(), "byte"))
            .allowed(format!("{MAX_BYTES}")));
    }
    let raw: RawModel = from_toml(text).map_err(|error| {
        let before = text.bytes().take(error.span().map_or(0, |span| span.start));
        let line = before.filter(|byte| *byte == b'\n').count() + 1;
        malformed("not a model file")
            .at(format!("{place} line {line}"))
            .got(plain_words(error.message()))
            .allowed("the keys of docs/recognition.md")
    })?;
    model(raw, bands, models).map_err(|error| {
        let place = match &error.place {
            Some(within) => format!("{place}, {within}"),
            None => place.to_owned(),
        };
        error.at(place)
    })
}

fn model(raw: RawModel, bands: &Bands, models: Models<'_>) -> Result<ActionModel, Error> {
    if raw.schema != SCHEMA {
        return Err(malformed("a model file of another version")
            .got(format!("schema = {}", raw.schema))
            .allowed(format!("schema = {SCHEMA}")));
    }
    for name in [Some(&raw.name), raw.action.as_ref()].into_iter().flatten() {
        let fits = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
        if name.is_empty() || !name.chars().all(fits) {
            return Err(malformed("a name is not usable")
                .got(name.clone())
                .allowed("small letters, digits and hyphens"));
        }
    }
    if let Some(other) = &raw.mirror_of {
        if !raw.phase.is_empty() || raw.side.is_some() || raw.gap_s.is_some() {
            return Err(malformed("a mirrored model has nothing of its own but name and note")
                .remedy("leave out everything but schema, name, note, source and mirror_of"));
        }
        let found = models(other).map_err(|error| match &error.place {
            Some(within) => error.clone().at(format!("mirror_of, {within}")),
            None => error.at("mirror_of"),
        })?;
        let own = |text: String, other: String| if text.is_empty() { other } else { text };
        let mirrored = found.mirrored();
        return Ok(ActionModel {
            name: raw.name,
            action: raw.action.unwrap_or(mirrored.action),
            note: own(raw.note, mirrored.note),
            source: own(raw.source, mirrored.source),
            also: raw.also,
            ..mirrored
        });
    }
    let time = |name: &str, value: f64| {
        if (0.0..=MAX_S).contains(&value) {
            return Ok(value);
        }
        Err(Error::of(ErrorKind::OutsideLimits, "a time is out of range")
            .at(name.to_owned())
            .got(format!("{value} s"))
            .allowed(format!("0 to {MAX_S} s")))
    };
    let gap_s = time("gap_s", raw.gap_s.unwrap_or(0.1))?;
    let slack_s = time("slack_s", raw.slack_s)?;
    if !(1..=MAX_PHASES).contains(&raw.phase.len()) {
        return Err(malformed("a model has phases")
            .got(raw.phase.len().to_string())
            .allowed(format!("1 to {MAX_PHASES}")));
    }
    let leading = leading(&raw.phase)?;
    let phases = raw.phase.iter().map(|raw| {
        let place = format!("phase {}", raw.name);
        let found = phase(raw, bands).and_then(|phase| possible(&phase).map(|()| phase));
        found.map_err(|error| match error.place.clone() {
            Some(within) => error.at(format!("{place}, {within}")),
            None => error.at(place),
        })
    });
    let phases = phases.collect::<Result<_, Error>>()?;
    Ok(ActionModel {
        action: raw.action.unwrap_or_else(|| raw.name.clone()),
        name: raw.name,
        side: raw.side,
        note: raw.note,
        source: raw.source,
        also: raw.also,
        gap_s,
        slack_s,
        leading,
        phases,
    })
}

/// How many of the first phases lead. Each names the phase it leads to, which is the one after it; a
/// circle never comes to the first that does not lead.
fn leading(phases: &[RawPhase]) -> Result<usize, Error> {
    let mut names = BTreeSet::new();
    for phase in phases {
        if !names.insert(phase.name.as_str()) {
            return Err(malformed("two phases have one name").got(phase.name.clone()));
        }
    }
    let to = |name: &str| phases.iter().find(|phase| phase.name == name);
    for phase in phases {
        let (mut passed, mut at) = (vec![phase.name.as_str()], phase);
        while let Some(lead) = &at.lead {
            let Some(next) = to(lead) else {
                let known = names;
                return Err(Error::of(
                    ErrorKind::Unknown,
                    "a phase leads to one that is not there",
                )
                .at(format!("phase {}", at.name))
                .none_of(lead, known, "take one of these"));
            };
            passed.push(&next.name);
            if passed[..passed.len() - 1].contains(&next.name.as_str()) {
                return Err(malformed("leading phases lead in a circle")
                    .at(format!("phase {}", phase.name))
                    .got(passed.join(" -> "))
                    .allowed(
                        "each leads to the phase after it, the last to one that does not lead",
                    ));
            }
            at = next;
        }
    }
    let leading = phases.iter().take_while(|phase| phase.lead.is_some()).count();
    for (index, phase) in phases.iter().enumerate() {
        let next = phases.get(index + 1).map(|next| &next.name);
        if phase.lead.is_some() && (index >= leading || phase.lead.as_ref() != next) {
            return Err(malformed("a leading phase stands right before the one it leads to")
                .at(format!("phase {}", phase.name))
                .got(phase.lead.clone().unwrap_or_default())
                .allowed(next.cloned().unwrap_or_else(|| "nothing, at the end".to_owned())));
        }
    }
    Ok(leading)
}

fn phase(raw: &RawPhase, bands: &Bands) -> Result<ModelPhase, Error> {
    let mut phase = ModelPhase {
        name: raw.name.clone(),
        gates: Vec::new(),
        postures: Vec::new(),
        travels: Vec::new(),
        means: Vec::new(),
        shortest_s: 0.0,
        longest_s: f64::INFINITY,
        ends_soon: false,
    };
    either(&mut phase, "motion", raw.motion.as_deref(), ["dynamic", "static"], "dynamic")?;
    either(&mut phase, "space", raw.space.as_deref(), ["locomotive", "in_place"], "locomotive")?;
    phase.postures = postures(raw.posture.as_ref())?;
    for word in &raw.minor {
        let (name, holds) = minor(word)?;
        gate(&mut phase, name, holds)?;
    }
    for (words, holds) in [(&raw.contact, true), (&raw.no_contact, false)] {
        for part in words {
            gate(&mut phase, &format!("{part}_contact"), holds)?;
        }
    }
    let moves =
        [&raw.root, &raw.torso, &raw.left_hand, &raw.right_hand, &raw.left_foot, &raw.right_foot];
    for ((name, part), of) in Feature::parts().zip(moves) {
        let Some(of) = of else { continue };
        let axes = [
            (BodyAxis::Frontal, "frontal", ["forward", "backward"], &of.frontal),
            (BodyAxis::Vertical, "vertical", ["up", "down"], &of.vertical),
            (BodyAxis::Sagittal, "sagittal", ["left", "right"], &of.sagittal),
        ];
        for (axis, axis_name, directions, words) in axes {
            if let Some(words) = words {
                moving(&mut phase, (part, axis), directions, words, bands)
                    .map_err(|error| error.at(format!("{name}.{axis_name}")))?;
            }
        }
    }
    for (measures, is_mean) in [(&raw.measure, false), (&raw.average, true)] {
        for (name, [from, to]) in measures {
            let range = FeatureRange { from: *from, to: *to };
            let condition = Condition { feature: feature(name)?, range };
            if is_mean { &mut phase.means } else { &mut phase.gates }.push(condition);
        }
    }
    if let Some([shortest_s, longest_s]) = raw.duration_s {
        (phase.shortest_s, phase.longest_s) = (shortest_s, longest_s);
    }
    phase.ends_soon = match raw.ends.as_deref() {
        None | Some("late") => false,
        Some("soon") => true,
        Some(word) => {
            return Err(Error::of(ErrorKind::Unknown, "no such word")
                .at("ends")
                .got(word)
                .allowed("soon, late"));
        }
    };
    Ok(phase)
}

/// A feature by name.
fn feature(name: &str) -> Result<Feature, Error> {
    Feature::named(name).ok_or_else(|| {
        let names: Vec<String> = Feature::all().map(Feature::name).collect();
        Error::of(ErrorKind::Unknown, "no such feature").none_of(
            name,
            names,
            "`gaitway model features` lists them",
        )
    })
}

fn gate(phase: &mut ModelPhase, name: &str, holds: bool) -> Result<(), Error> {
    let at = f64::from(u8::from(holds));
    let range = FeatureRange { from: at, to: at };
    phase.gates.push(Condition { feature: feature(name)?, range });
    Ok(())
}

fn either(
    phase: &mut ModelPhase,
    key: &str,
    word: Option<&str>,
    words: [&str; 2],
    name: &str,
) -> Result<(), Error> {
    match word {
        None => Ok(()),
        Some(word) if words.contains(&word) => gate(phase, name, word == words[0]),
        Some(word) => Err(Error::of(ErrorKind::Unknown, "no such word")
            .at(key)
            .got(word)
            .allowed(words.join(", "))),
    }
}

fn postures(words: Option<&Words>) -> Result<Vec<Feature>, Error> {
    let words = match words {
        None => return Ok(Vec::new()),
        Some(Words::One(word)) => std::slice::from_ref(word),
        Some(Words::Some(words)) => words,
    };
    let posture = |word: &String| {
        let found = MajorPosture::ALL.into_iter().find(|posture| posture.word() == word);
        found.map(Feature::posture).ok_or_else(|| {
            let known = MajorPosture::ALL.map(MajorPosture::word);
            Error::of(ErrorKind::Unknown, "no such posture").at("posture").none_of(
                word,
                known,
                "take one of these",
            )
        })
    };
    words.iter().map(posture).collect()
}

/// The feature of a minor posture, and whether it must hold.
fn minor(word: &str) -> Result<(&str, bool), Error> {
    match word {
        "bent" => Ok(("upright", false)),
        "on_object" => Ok(("on_floor", false)),
        "asymmetric" => Ok(("symmetric", false)),
        "upright" | "on_floor" | "symmetric" | "on_belly" | "on_back" | "sideways" => {
            Ok((word, true))
        }
        _ => Err(Error::of(ErrorKind::Unknown, "no such minor posture")
            .at("minor")
            .got(word)
            .allowed(
                "upright, bent, on_floor, on_object, symmetric, asymmetric, on_belly, on_back, sideways",
            )
            .remedy(if word == "leaned" {
                "what is leaned against is in no capture"
            } else {
                "take one of these"
            })),
    }
}

/// What two words, with two dots between them, or one word mean together: `mean..long`, `0.2..`.
fn between(words: &str, of: &dyn Fn(&str) -> Option<(f64, f64)>) -> Option<FeatureRange> {
    let Some((first, last)) = words.split_once("..") else {
        return of(words).map(|(from, to)| FeatureRange { from, to });
    };
    let from = if first.is_empty() { 0.0 } else { of(first)?.0 };
    let to = if last.is_empty() { f64::INFINITY } else { of(last)?.1 };
    (first != last).then_some(FeatureRange { from, to })
}

/// A motion in words: a direction and, if wanted, how far and how fast: `forward long fast`.
fn moving(
    phase: &mut ModelPhase,
    (part, axis): (MovingPart, BodyAxis),
    directions: [&str; 2],
    words: &str,
    bands: &Bands,
) -> Result<(), Error> {
    let wrong = |word: &str| {
        Error::of(ErrorKind::Unknown, "no such word for a motion")
            .got(word)
            .allowed(format!(
                "fixed, or {} or {}, then short, mean, long, slow, normal, fast, from one to another \
                 (mean..long), or limb lengths (0.3..0.5) and limb lengths per second (1../s)",
                directions[0], directions[1]
            ))
            .remedy("leave the key out for a motion that does not matter")
    };
    let feature = Feature::moving(part, axis);
    let mut words = words.split_whitespace();
    let direction = words.next().unwrap_or_default();
    if direction == "fixed" {
        let range = FeatureRange { from: -bands.fixed_l_s, to: bands.fixed_l_s };
        phase.gates.push(Condition { feature, range });
        return words.next().map_or(Ok(()), |word| Err(wrong(word)));
    }
    let sign = match directions.iter().position(|word| *word == direction) {
        Some(0) => 1.0,
        Some(_) => -1.0,
        None => return Err(wrong(direction)),
    };
    let moves = FeatureRange { from: bands.moves_l_s, ..FeatureRange::ANY };
    let range = if sign > 0.0 { moves } else { moves.negated() };
    phase.gates.push(Condition { feature, range });
    let amount_of = |word: &str| match word {
        // What is short is less than what is mean: its end is not in it.
        "short" => Some((0.0, bands.mean_l.next_down())),
        "mean" => Some((bands.mean_l, bands.long_l.next_down())),
        "long" => Some((bands.long_l, f64::INFINITY)),
        _ => None,
    };
    let speed_of = |word: &str| match word {
        "slow" => Some((0.0, bands.normal_l_s.next_down())),
        "normal" => Some((bands.normal_l_s, bands.fast_l_s.next_down())),
        "fast" => Some((bands.fast_l_s, f64::INFINITY)),
        _ => None,
    };
    let mut travel = Travel { feature, sign, amount: FeatureRange::ANY, speed: FeatureRange::ANY };
    for word in words {
        let (word_of_speed, numbers) = match word.strip_suffix("/s") {
            Some(numbers) => (true, numbers),
            None => (false, word),
        };
        if let Some(range) = between(numbers, &|word| word.parse().ok().map(|n| (n, n))) {
            if word_of_speed { travel.speed = range } else { travel.amount = range }
        } else if let Some(range) = between(word, &amount_of) {
            travel.amount = range;
        } else if let Some(range) = between(word, &speed_of) {
            travel.speed = range;
        } else {
            return Err(wrong(word));
        }
    }
    if travel.amount != FeatureRange::ANY || travel.speed != FeatureRange::ANY {
        phase.travels.push(travel);
    }
    Ok(())
}

/// Fails for a phase that cannot happen.
fn possible(phase: &ModelPhase) -> Result<(), Error> {
    let never = |why: String| malformed("this phase cannot happen").got(why);
    let numbers = |range: &FeatureRange| format!("{} to {}", range.from, range.to);
    let mut gates: BTreeMap<Feature, FeatureRange> = BTreeMap::new();
    for gate in &phase.gates {
        let before = *gates.get(&gate.feature).unwrap_or(&FeatureRange::ANY);
        let shared = before.shared(&gate.range);
        let name = gate.feature.name();
        if gate.range.from.is_nan() || gate.range.to.is_nan() || gate.range.is_empty() {
            return Err(never(format!("{name} from {}", numbers(&gate.range))));
        }
        if shared.is_empty() {
            return Err(never(format!(
                "{name} from {} and from {}",
                numbers(&before),
                numbers(&gate.range)
            )));
        }
        gates.insert(gate.feature, shared);
    }
    for mean in &phase.means {
        let gate = gates.get(&mean.feature).unwrap_or(&FeatureRange::ANY);
        if !(mean.range.from <= mean.range.to) || mean.range.shared(gate).is_empty() {
            let name = mean.feature.name();
            return Err(never(format!(
                "{name} from {} on average, and from {} in each frame",
                numbers(&mean.range),
                numbers(gate)
            )));
        }
    }
    if !(phase.shortest_s >= 0.0 && phase.shortest_s <= phase.longest_s && phase.longest_s > 0.0) {
        return Err(never(format!("from {} to {} s long", phase.shortest_s, phase.longest_s)));
    }
    let rests = |name: &str| {
        Feature::named(name).and_then(|of| gates.get(&of)).is_some_and(|range| range.to < 1.0)
    };
    if rests("dynamic") && !phase.travels.is_empty() {
        return Err(never("static, and a part that moves".to_owned()));
    }
    for travel in &phase.travels {
        // What is travelled is speed times duration.
        let (least, most) = (
            travel.speed.from.max(0.0) * phase.shortest_s,
            if travel.speed.to == f64::INFINITY || phase.longest_s == f64::INFINITY {
                f64::INFINITY
            } else {
                travel.speed.to * phase.longest_s
            },
        );
        if travel.amount.from > most || travel.amount.to < least {
            return Err(never(format!(
                "{} by {} limb lengths at {} limb lengths/s within {} to {} s",
                travel.feature.name(),
                numbers(&travel.amount),
                numbers(&travel.speed),
                phase.shortest_s,
                phase.longest_s
            )));
        }
    }
    let sits = |posture: MajorPosture| phase.postures == [Feature::posture(posture)];
    let gated = |name: &str, value: f64| {
        let feature = Feature::named(name);
        feature.and_then(|of| gates.get(&of)).is_some_and(|range| !range.holds(1.0 - value))
    };
    if sits(MajorPosture::Lying) && gated("upright", 1.0) {
        return Err(never("lying, and upright".to_owned()));
    }
    if sits(MajorPosture::Kneeling)
        && gated("left_knee_contact", 0.0)
        && gated("right_knee_contact", 0.0)
    {
        return Err(never("kneeling, and no knee on the ground".to_owned()));
    }
    if gated("flight", 1.0) && (gated("left_foot_contact", 1.0) || gated("right_foot_contact", 1.0))
    {
        return Err(never("in flight, and a foot on the ground".to_owned()));
    }
    if phase.gates.is_empty() && phase.postures.is_empty() {
        return Err(never("no frame ends it: nothing is asked of a single frame".to_owned()));
    }
    Ok(())
}

#[cfg(test)]
mod tests;
