//! C3D files written so that every program opens them: Intel numbers, real data, and the rules of
//! [`super::check`].
//!
//! All parameters that were read are written again as they stand, those that nobody here knows included.
//! Only what must agree with the data is corrected: counts, rates, lists that are too short.
//! Positions are written as they are held, bit for bit; residuals in the steps of the source.

use super::header::{Header, MAX_EVENTS};
use super::meaning::{self, KINDS};
use super::section;
use crate::error::{Error, ErrorKind, counted, either};
use crate::mocap::markers::{
    Frame, Frames, Head, MarkerEvent, MarkerPoint, PointKind, PointSample,
};
use crate::mocap::parameters::{MAX_LENGTH, Parameter, ParameterKind, Parameters};
use std::io::Write;

/// Step of a residual where the source has none, file units.
const USUAL_STEP: f32 = 0.01;
/// Longest count of frames that 16 bits tell.
const LONGEST: usize = 65_535;
/// The largest ANALOG:OFFSET that all programs take alike.
const MAX_OFFSET: f64 = 32_767.0;

/// Writes all frames. What could not be written is in the notes that come back.
///
/// # Errors
/// A file that cannot be written, frames that cannot be read, frames without a rate, or more points or
/// channels than a C3D file can name.
pub fn write(out: &mut impl Write, frames: &mut dyn Frames) -> Result<Vec<String>, Error> {
    let head = frames.head().clone();
    let mut notes = Vec::new();
    let rate_hz = head.rate_hz.ok_or_else(|| {
        Error::new("frames per second are not known, and a C3D file must say them")
            .remedy("say them: --rate HZ")
    })?;
    let folded = folded(&head);
    let step = if head.residual_step > 0.0 { head.residual_step } else { USUAL_STEP };
    let parameters = agreeing(&head, rate_hz, step, &folded, &mut notes)?;
    // Where the data begin is known once the parameters are laid out, whose length it does not change: whatever stood
    // there, a long list perhaps, is one number then.
    let mut parameters = parameters;
    parameters.set("POINT", Parameter::int("DATA_START", 0));
    let blocks = section::write(&parameters)?.len() / super::header::BLOCK;
    let data_start = u16::try_from(blocks + 2).unwrap_or(u16::MAX);
    parameters.set("POINT", Parameter::int("DATA_START", data_start));
    let section = section::write(&parameters)?;
    let header = header(&head, rate_hz, step, data_start)?;
    let unwritable = |cause: std::io::Error| Error::unwritten("the file cannot be written", &cause);
    out.write_all(&header.write()).map_err(unwritable)?;
    out.write_all(&section).map_err(unwritable)?;
    let (mut frame, mut bytes, mut written) = (Frame::default(), Vec::new(), 0);
    while frames.next_frame(&mut frame)? {
        bytes.clear();
        for point in 0..head.points.len() {
            put_point(&mut bytes, frame.points.get(point).copied().flatten(), step);
        }
        let channels = head.analog.channels.len();
        for at in 0..head.analog.counts_per_frame() {
            let count = frame.analog.get(at).copied().unwrap_or(0.0);
            let zero = at.checked_rem(channels).and_then(|at| folded.get(at)).copied();
            let count = f64::from(count) - zero.unwrap_or(0.0);
            bytes.extend((count as f32).to_le_bytes());
        }
        out.write_all(&bytes).map_err(unwritable)?;
        written += 1;
    }
    if written != head.frames {
        return Err(Error::of(
            ErrorKind::Malformed,
            "the source has not the frames that it tells of",
        )
        .got(counted(written, "frame"))
        .allowed(counted(head.frames, "frame")));
    }
    // Programs read whole blocks.
    let word = 4 * (4 * head.points.len() + head.analog.counts_per_frame());
    let over = word.saturating_mul(written) % super::header::BLOCK;
    if over > 0 {
        out.write_all(&[0; super::header::BLOCK][over..]).map_err(unwritable)?;
    }
    out.flush().map_err(unwritable)?;
    Ok(notes)
}

fn put_point(bytes: &mut Vec<u8>, sample: Option<PointSample>, step: f32) {
    let Some(PointSample { position, residual, cameras }) = sample else {
        for number in [0.0_f32, 0.0, 0.0, -1.0] {
            bytes.extend(number.to_le_bytes());
        }
        return;
    };
    for number in position {
        bytes.extend(number.to_le_bytes());
    }
    let residual = (residual / step).round().clamp(0.0, 255.0);
    let word = f32::from(cameras & 0x7f) * 256.0 + residual;
    bytes.extend(word.to_le_bytes());
}

/// Zeros that are taken out of the counts, since other programs would read them otherwise; of each channel.
fn folded(head: &Head) -> Vec<f64> {
    let is_plain = |offset: f64| (0.0..=MAX_OFFSET).contains(&offset) && offset.fract() == 0.0;
    let channels = head.analog.channels.iter();
    channels.map(|channel| if is_plain(channel.offset) { 0.0 } else { channel.offset }).collect()
}

fn header(head: &Head, rate_hz: f64, step: f32, data_start: u16) -> Result<Header, Error> {
    let too_many = |what: &str, count: usize| {
        Error::of(ErrorKind::OutsideLimits, format!("too many {what} for a C3D file"))
            .got(count.to_string())
            .allowed("at most 65535")
            .remedy("write another kind of file")
    };
    let (points, analog) = (head.points.len(), head.analog.counts_per_frame());
    let (first, last) = range(head);
    Ok(Header {
        points: u16::try_from(points).map_err(|_| too_many("points", points))?,
        analog: u16::try_from(analog).map_err(|_| too_many("analog counts per frame", analog))?,
        first,
        last,
        scale: -step,
        data_start,
        // One where there are no channels, too, as the two rates say.
        per_frame: u16::try_from(head.analog.per_frame.max(1))
            .map_err(|_| too_many("analog samples per frame", head.analog.per_frame))?,
        rate_hz: rate_hz as f32,
        events: head.events.iter().take(MAX_EVENTS).cloned().collect(),
    })
}

/// First and last frame as 16 bits tell them: where they cannot, from 1 on.
fn range(head: &Head) -> (u16, u16) {
    let last = (head.first_frame + head.frames as u64).saturating_sub(1);
    match (u16::try_from(head.first_frame), u16::try_from(last)) {
        (Ok(first), Ok(last)) => (first, last),
        _ => (1, u16::try_from(head.frames).unwrap_or(u16::MAX)),
    }
}

/// The parameters, with all that must agree with the data put right.
fn agreeing(
    head: &Head,
    rate_hz: f64,
    step: f32,
    folded: &[f64],
    notes: &mut Vec<String>,
) -> Result<Parameters, Error> {
    let mut parameters = head.parameters.clone();
    notes.extend(parameters.make_names_unique());
    let mut all = Agreeing { parameters, notes };
    all.points(head, rate_hz, step)?;
    all.analog(head, rate_hz, folded);
    all.plates();
    all.trial(head);
    all.events(&head.events);
    Ok(all.parameters)
}

struct Agreeing<'a> {
    parameters: Parameters,
    notes: &'a mut Vec<String>,
}

impl Agreeing<'_> {
    /// Sets a number, unless it stands there.
    fn float(&mut self, group: &str, name: &str, value: f32) {
        let known = self.parameters.get(group, name);
        let is_there = known.is_some_and(|known| {
            known.kind == ParameterKind::Float && known.number() == Some(value.into())
        });
        if !is_there {
            self.parameters.set(group, Parameter::float(name, value));
        }
    }

    fn int(&mut self, group: &str, name: &str, value: usize) {
        let known = self.parameters.get(group, name);
        let is_there = known.is_some_and(|known| {
            known.kind == ParameterKind::Int && known.first_count() == Some(value as u64)
        });
        if !is_there {
            let value = u16::try_from(value).unwrap_or(u16::MAX);
            self.parameters.set(group, Parameter::int(name, value));
        }
    }

    fn text(&mut self, group: &str, name: &str, text: &str) {
        if self.parameters.get(group, name).and_then(Parameter::first_text).as_deref() != Some(text)
        {
            self.parameters.set(group, Parameter::text(name, text));
        }
    }

    /// Sets texts, unless a list that begins with them stands there: LABELS, LABELS2, ...
    fn texts(&mut self, group: &str, name: &str, texts: &[String]) {
        let known = self.parameters.texts(group, name);
        let is_list = self.parameters.get(group, name).is_some_and(|known| {
            known.kind == ParameterKind::Char && (known.dimensions.len() == 2 || texts.len() == 1)
        });
        if is_list && known.starts_with(texts) {
            return;
        }
        let longest = texts.iter().map(String::len).max().unwrap_or(0);
        if longest > MAX_LENGTH {
            self.notes.push(format!("{group}:{name}: texts are cut off after {MAX_LENGTH} bytes"));
        }
        self.parts(group, name, texts.len(), &mut |name, range| {
            Parameter::texts_of(name, texts.get(range).unwrap_or_default())
        });
    }

    /// Sets numbers, unless a list that begins with them stands there.
    fn numbers(&mut self, group: &str, name: &str, kind: ParameterKind, numbers: &[f64]) {
        let known = self.parameters.numbers(group, name);
        let is_kind = self.parameters.get(group, name).is_some_and(|known| known.kind == kind);
        if is_kind && known.starts_with(numbers) {
            return;
        }
        self.parts(group, name, numbers.len(), &mut |name, range| {
            let part = numbers.get(range).unwrap_or_default();
            if kind == ParameterKind::Int {
                let part: Vec<u16> = part.iter().map(|&number| number as u16).collect();
                return Parameter::ints(name, &[part.len()], &part);
            }
            let part: Vec<f32> = part.iter().map(|&number| number as f32).collect();
            Parameter::floats(name, &[part.len()], &part)
        });
    }

    /// Sets a list in parts of what a parameter holds, and takes out what goes on behind it.
    fn parts(
        &mut self,
        group: &str,
        name: &str,
        count: usize,
        part: &mut dyn FnMut(&str, std::ops::Range<usize>) -> Parameter,
    ) {
        let parts = count.div_ceil(MAX_LENGTH).max(1);
        let title = |number: usize| match number {
            0 => name.to_owned(),
            _ => format!("{name}{}", number + 1),
        };
        for number in 0..parts {
            let range = number * MAX_LENGTH..((number + 1) * MAX_LENGTH).min(count);
            self.parameters.set(group, part(&title(number), range));
        }
        let mut number = parts;
        while self.parameters.get(group, &title(number)).is_some() {
            self.parameters.remove(group, &title(number));
            number += 1;
        }
    }

    fn points(&mut self, head: &Head, rate_hz: f64, step: f32) -> Result<(), Error> {
        let points = head.points.len();
        self.int("POINT", "USED", points);
        self.int("POINT", "FRAMES", head.frames.min(LONGEST));
        self.parameters.remove("POINT", "LONG_FRAMES");
        if head.frames > LONGEST {
            self.float("POINT", "LONG_FRAMES", head.frames as f32);
        }
        self.int("POINT", "DATA_START", 0);
        self.float("POINT", "SCALE", -step);
        self.float("POINT", "RATE", rate_hz as f32);
        if !head.unit.is_empty() {
            self.text("POINT", "UNITS", &head.unit);
        } else if self.parameters.get("POINT", "UNITS").is_none_or(|of| of.texts().is_empty()) {
            // Unknown, and yet a text: some programs refuse a file without one.
            self.parameters.set("POINT", Parameter::text("UNITS", "    "));
        }
        for (name, axis) in ["X_SCREEN", "Y_SCREEN"].into_iter().zip(&head.screen) {
            if !axis.is_empty() {
                self.text("POINT", name, axis);
            }
        }
        let labels: Vec<String> = head.points.iter().map(|point| point.label.clone()).collect();
        self.texts("POINT", "LABELS", &labels);
        let words: Vec<String> = head.points.iter().map(|p| p.description.clone()).collect();
        self.texts("POINT", "DESCRIPTIONS", &words);
        self.kinds(head)
    }

    /// Lists what is no marker, unless the parameters tell it already.
    fn kinds(&mut self, head: &Head) -> Result<(), Error> {
        for (list, kind, unit) in KINDS {
            let known = meaning::kinds(&self.parameters);
            let is_told = |point: &&MarkerPoint| {
                let told = meaning::kind_of(&known, &point.label);
                told.map_or(PointKind::Marker, |(kind, _)| *kind) == point.kind
            };
            let of_kind = || head.points.iter().filter(|point| point.kind == kind);
            let Some(first) = of_kind().next().filter(|_| !of_kind().all(|of| is_told(&of))) else {
                continue;
            };
            let labels: Vec<String> = of_kind().map(|point| point.label.clone()).collect();
            self.texts("POINT", list, &labels);
            if !kind.is_place() && !first.unit.is_empty() {
                self.text("POINT", unit, &first.unit);
            }
            if let Some(other) = of_kind().find(|of| of.unit != first.unit && !kind.is_place()) {
                let of = |point: &MarkerPoint| match point.unit.as_str() {
                    "" => format!("{} without a unit", point.label),
                    unit => format!("{} in {unit}", point.label),
                };
                return Err(Error::new(format!("a C3D file has one POINT:{unit} for all"))
                    .got(format!("{}, {}", of(first), of(other)))
                    .remedy("give them one unit, or write a table (.csv)"));
            }
        }
        Ok(())
    }

    fn analog(&mut self, head: &Head, rate_hz: f64, folded: &[f64]) {
        let channels = &head.analog.channels;
        self.int("ANALOG", "USED", channels.len());
        let of = |text: fn(&crate::mocap::markers::AnalogChannel) -> &String| -> Vec<String> {
            channels.iter().map(|channel| text(channel).clone()).collect()
        };
        self.texts("ANALOG", "LABELS", &of(|channel| &channel.label));
        self.texts("ANALOG", "DESCRIPTIONS", &of(|channel| &channel.description));
        self.texts("ANALOG", "UNITS", &of(|channel| &channel.unit));
        let all = self.parameters.get("ANALOG", "GEN_SCALE").and_then(Parameter::number);
        let all = all.unwrap_or(1.0);
        let known = self.parameters.numbers("ANALOG", "SCALE");
        let is_kept = channels
            .iter()
            .enumerate()
            .all(|(at, channel)| known.get(at).is_some_and(|scale| all * scale == channel.scale));
        if is_kept && !channels.is_empty() {
            self.float("ANALOG", "GEN_SCALE", all as f32);
            let kept = known.get(..channels.len()).unwrap_or_default().to_vec();
            self.numbers("ANALOG", "SCALE", ParameterKind::Float, &kept);
        } else {
            self.float("ANALOG", "GEN_SCALE", 1.0);
            let scales: Vec<f64> = channels.iter().map(|channel| channel.scale).collect();
            self.numbers("ANALOG", "SCALE", ParameterKind::Float, &scales);
        }
        let offsets = channels.iter().zip(folded).map(|(channel, folded)| channel.offset - folded);
        let offsets: Vec<f64> = offsets.collect();
        self.numbers("ANALOG", "OFFSET", ParameterKind::Int, &offsets);
        // What a reader expects of files without channels is the rate of the points.
        let per_frame = head.analog.per_frame.max(1) as f64;
        self.float("ANALOG", "RATE", (rate_hz * per_frame) as f32);
        self.text("ANALOG", "FORMAT", "SIGNED");
        if self.parameters.get("ANALOG", "BITS").is_none() {
            self.int("ANALOG", "BITS", 16);
        }
    }

    /// The group is there also if there are no plates.
    fn plates(&mut self) {
        let group = "FORCE_PLATFORM";
        if self.parameters.get(group, "USED").is_some() {
            return;
        }
        self.int(group, "USED", 0);
        for parameter in [
            Parameter::ints("TYPE", &[0], &[]),
            Parameter::ints("ZERO", &[2], &[1, 0]),
            Parameter::floats("CORNERS", &[3, 4, 0], &[]),
            Parameter::floats("ORIGIN", &[3, 0], &[]),
            Parameter::ints("CHANNEL", &[6, 0], &[]),
        ] {
            self.parameters.set(group, parameter);
        }
    }

    /// First and last frame in 32 bits, where 16 do not tell them or they are told already.
    fn trial(&mut self, head: &Head) {
        let (first, _) = range(head);
        let is_told = u64::from(first) == head.first_frame && head.frames <= LONGEST;
        if is_told && self.parameters.get("TRIAL", "ACTUAL_START_FIELD").is_none() {
            return;
        }
        let last = (head.first_frame + head.frames as u64).saturating_sub(1);
        for (name, frame) in [("ACTUAL_START_FIELD", head.first_frame), ("ACTUAL_END_FIELD", last)]
        {
            let words = [frame & 0xffff, (frame >> 16) & 0xffff].map(|word| word as u16);
            let field = Parameter::ints(name, &[2], &words);
            if self.parameters.get("TRIAL", name).is_none_or(|known| known.data != field.data) {
                self.parameters.set("TRIAL", field);
            }
        }
    }

    fn events(&mut self, events: &[MarkerEvent]) {
        if events.is_empty() {
            return;
        }
        let written = events.get(..MAX_LENGTH).unwrap_or(events);
        if written.len() < events.len() {
            let left = events.len() - written.len();
            self.notes.push(format!(
                "{left} {are} left out: a C3D file holds {MAX_LENGTH}",
                left = counted(left, "event"),
                are = either(left, "is", "are")
            ));
        }
        self.int("EVENT", "USED", written.len());
        let of = |text: fn(&MarkerEvent) -> &str| -> Vec<String> {
            written.iter().map(|event| text(event).to_owned()).collect()
        };
        let context = |event: &MarkerEvent| -> String {
            if event.context.is_empty() { "General" } else { &event.context }.to_owned()
        };
        let contexts: Vec<String> = written.iter().map(context).collect();
        self.texts("EVENT", "CONTEXTS", &contexts);
        self.texts("EVENT", "LABELS", &of(|event| &event.label));
        self.texts("EVENT", "SUBJECTS", &of(|event| &event.subject));
        self.texts("EVENT", "DESCRIPTIONS", &of(|event| &event.description));
        let known = self.parameters.get("EVENT", "TIMES");
        let is_pairs = known.is_some_and(|known| known.dimensions.first() == Some(&2));
        let times = known.map(Parameter::numbers).unwrap_or_default();
        let pairs = times.as_chunks::<2>().0.iter().map(|[minutes, s]| minutes * 60.0 + s);
        let is_same = pairs.eq(written.iter().map(|event| event.time_s));
        if !(is_pairs && is_same) {
            let split = |event: &MarkerEvent| {
                let minutes = (event.time_s / 60.0).floor();
                [minutes as f32, (event.time_s - 60.0 * minutes) as f32]
            };
            let pairs: Vec<f32> = written.iter().flat_map(split).collect();
            self.parameters.set("EVENT", Parameter::floats("TIMES", &[2, written.len()], &pairs));
        }
    }
}
