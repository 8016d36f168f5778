//! What the parameters of a C3D file mean: names, units, events, force plates.

use super::header::Header;
use super::layout::Layout;
use crate::error::{counted, either};
use crate::mocap::markers::{
    Analog, AnalogChannel, ForcePlate, Head, MarkerEvent, MarkerFormat, MarkerPoint, PlateKind,
    PointKind,
};
use crate::mocap::parameters::{Parameter, ParameterKind, Parameters};
use std::collections::BTreeMap;

/// Most force plates that are told of.
const MAX_PLATES: usize = 255;

/// Makes a head of what was read.
pub fn head(header: &Header, layout: &Layout, parameters: Parameters, encoding: String) -> Head {
    let mut head = Head::new(MarkerFormat::C3d);
    head.encoding = encoding;
    head.frames = usize::try_from(layout.frames).unwrap_or(usize::MAX);
    head.lost_frames = layout.claimed - layout.frames;
    head.first_frame = layout.first;
    head.notes.clone_from(&layout.notes);
    head.has_residuals = true;
    head.residual_step = layout.scale.abs();
    let text = |group: &str, name: &str| {
        parameters.get(group, name).and_then(Parameter::first_text).unwrap_or_default()
    };
    head.unit = text("POINT", "UNITS");
    if head.unit.is_empty() && layout.points > 0 {
        head.notes.push("POINT:UNITS is missing: the unit of length is unknown".to_owned());
    }
    head.screen = [text("POINT", "X_SCREEN"), text("POINT", "Y_SCREEN")];
    let program = [text("MANUFACTURER", "COMPANY"), text("MANUFACTURER", "SOFTWARE")];
    let version = text("MANUFACTURER", "VERSION_LABEL");
    let program = program.into_iter().chain([version]).filter(|word| !word.is_empty());
    head.made_by = program.collect::<Vec<_>>().join(" ");
    head.subjects = parameters.texts("SUBJECTS", "NAMES");
    head.subjects.retain(|name| !name.is_empty());
    head.analog = analog(header, layout, &parameters, &mut head.notes);
    head.rate_hz = rate(header, &parameters, &head.analog, &mut head.notes);
    if head.analog.rate_hz.is_none() && !head.analog.channels.is_empty() {
        head.analog.rate_hz = head.rate_hz.map(|rate| rate * head.analog.per_frame as f64);
        head.notes.push("ANALOG:RATE is missing: taken from the samples per frame".to_owned());
    }
    head.points = points(layout, &parameters, &mut head.notes, &head.unit);
    head.events = events(header, &parameters, &mut head.notes);
    head.plates = plates(&parameters, layout.channels, &mut head.notes);
    head.parameters = parameters;
    head
}

fn positive(number: f64) -> Option<f64> {
    (number.is_finite() && number > 0.0).then_some(number)
}

fn rate(
    header: &Header,
    parameters: &Parameters,
    analog: &Analog,
    notes: &mut Vec<String>,
) -> Option<f64> {
    let stored = parameters.get("POINT", "RATE").and_then(Parameter::number).and_then(positive);
    let of_header = positive(header.rate_hz.into());
    match (stored, of_header) {
        (Some(stored), Some(other)) if (stored - other).abs() > 1e-3 * stored => {
            notes.push(format!(
                "POINT:RATE says {stored} Hz, the header {other} Hz: {stored} Hz is taken"
            ));
        }
        (None, Some(other)) => {
            notes.push(format!("POINT:RATE is missing or unusable: {other} Hz by the header"));
        }
        (None, None) => {
            let by_analog = analog.rate_hz.map(|rate| rate / analog.per_frame.max(1) as f64);
            notes.push(match by_analog {
                Some(rate) => format!("POINT:RATE is missing: {rate} Hz by the analog channels"),
                None => "POINT:RATE is missing: frames per second are unknown".to_owned(),
            });
            return by_analog;
        }
        _ => {}
    }
    stored.or(of_header)
}

/// A text of each of so many; those that the file does not have are empty.
fn filled(mut texts: Vec<String>, count: usize) -> Vec<String> {
    texts.resize(count, String::new());
    texts
}

/// Labels of so many, all different from empty.
fn labels(texts: Vec<String>, count: usize, what: &str, notes: &mut Vec<String>) -> Vec<String> {
    let more = texts.len().saturating_sub(count);
    if more > 0 {
        notes.push(format!(
            "{} for {}: the last {more} {} none",
            counted(texts.len(), "label"),
            counted(count, what),
            either(more, "names", "name")
        ));
    }
    let mut labels = filled(texts, count);
    let mut unnamed = 0;
    for (at, label) in labels.iter_mut().enumerate() {
        if label.is_empty() {
            *label = format!("{what} {}", at + 1);
            unnamed += 1;
        }
    }
    if unnamed > 0 {
        notes.push(format!(
            "{unnamed} of {} {}",
            counted(count, what),
            either(
                unnamed,
                "has no label: called by its number",
                "have no label: called by their numbers"
            )
        ));
    }
    let mut seen = BTreeMap::new();
    for label in &labels {
        *seen.entry(label.as_str()).or_insert(0_usize) += 1;
    }
    let double: Vec<&str> =
        seen.iter().filter(|(_, count)| **count > 1).map(|(label, _)| *label).collect();
    if let Some(first) = double.first() {
        notes.push(format!(
            "{} {} for more than one {what}, {first} for one",
            counted(double.len(), "label"),
            either(double.len(), "stands", "stand")
        ));
    }
    labels
}

fn points(
    layout: &Layout,
    parameters: &Parameters,
    notes: &mut Vec<String>,
    length: &str,
) -> Vec<MarkerPoint> {
    let count = layout.points;
    let labels = labels(parameters.texts("POINT", "LABELS"), count, "point", notes);
    let descriptions = filled(parameters.texts("POINT", "DESCRIPTIONS"), count);
    let kinds = kinds(parameters);
    let of = |(label, description): (String, String)| {
        let known = kind_of(&kinds, &label);
        let (kind, unit) = known.map_or((PointKind::Marker, length), |(kind, unit)| (*kind, unit));
        let unit = if kind.is_place() { length } else { unit }.to_owned();
        MarkerPoint { label, description, kind, unit }
    };
    labels.into_iter().zip(descriptions).map(of).collect()
}

/// Lists of points that are no markers, what they are, and where their unit is.
pub const KINDS: [(&str, PointKind, &str); 6] = [
    ("ANGLES", PointKind::Angle, "ANGLE_UNITS"),
    ("FORCES", PointKind::Force, "FORCE_UNITS"),
    ("MOMENTS", PointKind::Moment, "MOMENT_UNITS"),
    ("POWERS", PointKind::Power, "POWER_UNITS"),
    ("SCALARS", PointKind::Scalar, "SCALAR_UNITS"),
    ("MODELED_MARKERS", PointKind::Modelled, "MODELED_MARKER_UNITS"),
];

/// What a point is by these lists, and its unit; none of a marker.
pub fn kind_of<'a>(
    kinds: &'a BTreeMap<String, (PointKind, String)>,
    label: &str,
) -> Option<&'a (PointKind, String)> {
    // Models of two subjects have one list of outputs.
    let plain = label.rsplit(':').next().unwrap_or(label);
    kinds.get(label).or_else(|| kinds.get(plain))
}

/// What points are that are no markers: POINT:TYPE_GROUPS names pairs of a list of labels and a kind.
pub fn kinds(parameters: &Parameters) -> BTreeMap<String, (PointKind, String)> {
    let mut kinds = BTreeMap::new();
    let mut lists = parameters.texts("POINT", "TYPE_GROUPS");
    // Some files have the lists and not the index.
    for (usual, _, _) in KINDS {
        if !lists.iter().any(|list| list == usual) {
            lists.push(usual.to_owned());
        }
    }
    for list in lists {
        let known = KINDS.into_iter().find(|(usual, _, _)| *usual == list);
        let Some((_, kind, unit)) = known else { continue };
        let unit = parameters.get("POINT", unit).and_then(Parameter::first_text);
        let unit = unit.unwrap_or_default();
        for label in parameters.texts("POINT", &list) {
            if !label.is_empty() {
                kinds.entry(label).or_insert_with(|| (kind, unit.clone()));
            }
        }
    }
    kinds
}

fn analog(
    header: &Header,
    layout: &Layout,
    parameters: &Parameters,
    notes: &mut Vec<String>,
) -> Analog {
    let count = layout.channels;
    if count == 0 {
        return Analog::default();
    }
    let per_frame = layout.analog / count;
    if header.per_frame > 0 && usize::from(header.per_frame) != per_frame {
        notes.push(format!(
            "the header says {} per frame; {per_frame} by the counts of a frame",
            counted(header.per_frame, "analog sample")
        ));
    }
    let all = parameters.get("ANALOG", "GEN_SCALE").and_then(Parameter::number).unwrap_or(1.0);
    let scales = parameters.numbers("ANALOG", "SCALE");
    let offsets = offsets(parameters, notes);
    let labels = labels(parameters.texts("ANALOG", "LABELS"), count, "channel", notes);
    let descriptions = filled(parameters.texts("ANALOG", "DESCRIPTIONS"), count);
    let units = filled(parameters.texts("ANALOG", "UNITS"), count);
    let channels = labels.into_iter().zip(descriptions).zip(units).enumerate();
    let channels = channels.map(|(at, ((label, description), unit))| AnalogChannel {
        label,
        description,
        unit,
        scale: all * scales.get(at).copied().unwrap_or(1.0),
        offset: offsets.get(at).copied().unwrap_or(0.0),
    });
    let rate_hz = parameters.get("ANALOG", "RATE").and_then(Parameter::number).and_then(positive);
    Analog { channels: channels.collect(), per_frame, rate_hz }
}

/// Zeros of the channels. They are signed unless ANALOG:FORMAT says otherwise; -32,768, which nobody could
/// subtract in 16 bits, is the middle of an unsigned range.
fn offsets(parameters: &Parameters, notes: &mut Vec<String>) -> Vec<f64> {
    let unsigned = is_unsigned(parameters);
    let mut offsets = parameters.numbers("ANALOG", "OFFSET");
    let is_int = parameters.get("ANALOG", "OFFSET").is_some_and(|of| of.kind == ParameterKind::Int);
    let mut middle = false;
    for offset in offsets.iter_mut().filter(|_| is_int) {
        let is_middle = *offset == -32_768.0;
        if is_middle || (unsigned && *offset < 0.0) {
            *offset += 65_536.0;
            middle |= is_middle && !unsigned;
        }
    }
    if middle {
        notes.push("ANALOG:OFFSET of -32768 is taken as 32768, unsigned".to_owned());
    }
    offsets
}

/// True if analog counts of 16 bits are unsigned.
pub fn is_unsigned(parameters: &Parameters) -> bool {
    let format = parameters.get("ANALOG", "FORMAT").and_then(Parameter::first_text);
    format.is_some_and(|format| format.to_ascii_uppercase().starts_with("UNSIGNED"))
}

fn events(header: &Header, parameters: &Parameters, notes: &mut Vec<String>) -> Vec<MarkerEvent> {
    let used = parameters.get("EVENT", "USED").and_then(Parameter::first_count).unwrap_or(0);
    if used == 0 {
        return header.events.clone();
    }
    let times = parameters.numbers("EVENT", "TIMES");
    let text = |name: &str| parameters.texts("EVENT", name);
    let (labels, contexts) = (text("LABELS"), text("CONTEXTS"));
    let (subjects, descriptions) = (text("SUBJECTS"), text("DESCRIPTIONS"));
    if contexts.is_empty() {
        notes.push("EVENT:CONTEXTS is missing: the events say no side".to_owned());
    }
    let at = |texts: &[String], index: usize| texts.get(index).cloned().unwrap_or_default();
    // A pair each: minutes and seconds.
    let events = times.as_chunks::<2>().0.iter().take(usize::try_from(used).unwrap_or(usize::MAX));
    let events = events.enumerate().map(|(index, [minutes, seconds])| MarkerEvent {
        time_s: minutes * 60.0 + seconds,
        label: at(&labels, index),
        context: at(&contexts, index),
        subject: at(&subjects, index),
        description: at(&descriptions, index),
    });
    let events: Vec<MarkerEvent> = events.filter(|event| event.time_s.is_finite()).collect();
    if (events.len() as u64) < used {
        notes.push(format!(
            "EVENT:USED claims {used}, {} {} a time",
            events.len(),
            either(events.len(), "has", "have"),
            used = counted(used, "event")
        ));
    }
    events
}

fn plates(parameters: &Parameters, channels: usize, notes: &mut Vec<String>) -> Vec<ForcePlate> {
    let get = |name: &str| parameters.get("FORCE_PLATFORM", name);
    let used = get("USED").and_then(Parameter::first_count).unwrap_or(0);
    let used = usize::try_from(used).unwrap_or(usize::MAX).min(MAX_PLATES);
    let kinds = get("TYPE").map(Parameter::counts).unwrap_or_default();
    let numbers = |name: &str| get(name).map(Parameter::numbers).unwrap_or_default();
    let (corners, origins, matrices) =
        (numbers("CORNERS"), numbers("ORIGIN"), numbers("CAL_MATRIX"));
    let wires = get("CHANNEL").map(Parameter::counts).unwrap_or_default();
    let per_plate = get("CHANNEL").and_then(|of| of.dimensions.first().copied()).unwrap_or(6);
    let triple = |numbers: &[f64], at: usize| -> [f32; 3] {
        std::array::from_fn(|axis| numbers.get(3 * at + axis).copied().unwrap_or(0.0) as f32)
    };
    let mut plates = Vec::with_capacity(used);
    for at in 0..used {
        let Some(kind) = kinds.get(at).copied().flatten() else {
            notes.push(format!("force plate {} has no type: left out", at + 1));
            continue;
        };
        let kind = PlateKind::of_number(u16::try_from(kind).unwrap_or(u16::MAX));
        let needed = if kind == PlateKind::Posts { 8 } else { 6 };
        let own = wires.iter().skip(at * usize::from(per_plate)).take(per_plate.into());
        let index = |wire: &Option<u64>| {
            let wire = usize::try_from((*wire)?.checked_sub(1)?).ok()?;
            (wire < channels).then_some(wire)
        };
        let own: Vec<Option<usize>> = own.take(needed).map(index).collect();
        if own.len() < needed || own.contains(&None) {
            let known = own.iter().flatten().count();
            notes.push(format!(
                "force plate {}: {known} of its {needed} channels {} there",
                at + 1,
                either(known, "is", "are")
            ));
        }
        let is_calibrated = kind == PlateKind::Calibrated;
        let matrix = matrices.iter().skip(36 * at).take(if is_calibrated { 36 } else { 0 });
        let calibration: Vec<f32> = matrix.map(|&number| number as f32).collect();
        if is_calibrated && calibration.len() < 36 {
            notes.push(format!(
                "force plate {} is of type 4 and has no calibration matrix: its channels are taken as \
                 forces and moments",
                at + 1
            ));
        }
        plates.push(ForcePlate {
            kind,
            corners: std::array::from_fn(|corner| triple(&corners, 4 * at + corner)),
            origin: triple(&origins, at),
            channels: own,
            calibration,
        });
    }
    plates
}
