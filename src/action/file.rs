//! Action files: TOML that a person can write. The format is described in `docs/actions.md`, for
//! editors in `actions/schema.json`.

use crate::action::{Action, Ends, Group, Kind, Phase, Track, Turn};
use crate::actionlet::{Sampled, Shape};
use crate::body::{Dof, JointAngles};
use crate::error::{Error, ErrorKind, counted};
use crate::toml_text::{from_toml, plain_words};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::sync::Arc;
use toml::Spanned;

/// Version of the format.
pub const SCHEMA: u32 = 1;
/// Most bytes of an action file.
pub const MAX_BYTES: usize = 1 << 20;
/// Longest action or period, s.
pub const MAX_DURATION_S: f64 = 86_400.0;
/// Captured angles may leave anatomical ranges, by skin, markers and odd skeletons, and turn round
/// several times; beyond this they are no angles, rad.
const CAPTURED_RAD: f64 = 100.0;
/// Shortest action or period, s.
pub const MIN_DURATION_S: f64 = 0.01;

type Rows = BTreeMap<Spanned<String>, Vec<Spanned<Vec<Cell>>>>;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawAction {
    schema: Spanned<u32>,
    name: Spanned<String>,
    #[serde(default)]
    note: String,
    #[serde(default)]
    source: String,
    mirror_of: Option<Spanned<String>>,
    #[serde(default)]
    captured: bool,
    kind: Option<Kind>,
    #[serde(default)]
    cyclic: bool,
    duration_s: Option<Spanned<f64>>,
    rounds: Option<Spanned<u32>>,
    #[serde(default)]
    pose: BTreeMap<Spanned<String>, f64>,
    #[serde(default)]
    shapes: BTreeMap<String, Spanned<Vec<f64>>>,
    #[serde(default)]
    flights: Vec<Spanned<[f64; 2]>>,
    #[serde(default)]
    phases: Vec<(f64, String)>,
    start: Option<RawStart>,
    stop: Option<RawStop>,
    #[serde(default)]
    group: Vec<Spanned<RawGroup>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawStart {
    #[serde(default)]
    phase: f64,
    after: Option<f64>,
    #[serde(default)]
    turns: Rows,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawStop {
    before: Option<f64>,
    #[serde(default)]
    turns: Rows,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawGroup {
    name: String,
    kind: Kind,
    #[serde(default)]
    phase: f64,
    rate: Option<[u32; 2]>,
    mirrors: Option<String>,
    from: Option<String>,
    #[serde(default)]
    turns: Rows,
}

/// A cell of a row: a number, or the name of a velocity function.
#[derive(Deserialize)]
#[serde(untagged)]
enum Cell {
    Number(f64),
    Word(String),
}

/// Where other actions are looked up by name, for `mirror_of` and `from`.
pub type Library<'a> = &'a dyn Fn(&str) -> Option<Action>;

/// Reads an action. `place` names the file in errors; `library` finds the actions it leans on.
///
/// # Errors
/// If the text is not an action file: with line, degree of freedom and rule.
pub fn parse(text: &str, place: &str, library: Library<'_>) -> Result<Action, Error> {
    if text.len() > MAX_BYTES {
        return Err(Error::of(ErrorKind::Malformed, "an action file is too long")
            .at(place)
            .got(counted(text.len(), "byte"))
            .allowed(format!("{MAX_BYTES}")));
    }
    let raw: RawAction = from_toml(text).map_err(|error| {
        let line = error.span().map_or(0, |span| line_of(text, span.start));
        Error::of(ErrorKind::Malformed, "not an action file")
            .at(format!("{place} line {line}"))
            .got(plain_words(error.message()))
            .allowed("the keys of docs/actions.md")
    })?;
    let captured = raw.captured;
    Reader { captured, text, place, library, shapes: BTreeMap::new() }.read(&raw)
}

fn line_of(text: &str, byte: usize) -> usize {
    text.bytes().take(byte).filter(|b| *b == b'\n').count() + 1
}

struct Reader<'a> {
    captured: bool,
    text: &'a str,
    place: &'a str,
    library: Library<'a>,
    shapes: BTreeMap<String, Shape>,
}

impl Reader<'_> {
    fn at<T>(&self, spanned: &Spanned<T>) -> String {
        format!("{} line {}", self.place, line_of(self.text, spanned.span().start))
    }

    fn read(&mut self, raw: &RawAction) -> Result<Action, Error> {
        if *raw.schema.get_ref() != SCHEMA {
            return Err(Error::of(ErrorKind::Malformed, "an action file of another version")
                .at(self.at(&raw.schema))
                .got(format!("schema = {}", raw.schema.get_ref()))
                .allowed(format!("schema = {SCHEMA}")));
        }
        let name = raw.name.get_ref();
        let fits = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
        if name.is_empty() || !name.chars().all(fits) {
            return Err(Error::new("an action's name is not usable")
                .at(self.at(&raw.name))
                .got(name.clone())
                .allowed("small letters, digits and hyphens"));
        }
        for (shape, samples) in &raw.shapes {
            let sampled = Sampled::through(samples.get_ref()).map_err(|e| {
                let sample = e.place.as_deref().unwrap_or("all samples").to_owned();
                e.at(format!("{}, shape {shape}, {sample}", self.at(samples)))
            })?;
            self.shapes.insert(shape.clone(), Shape::Sampled(Arc::new(sampled)));
        }
        match &raw.mirror_of {
            Some(other) => self.mirrored(raw, other),
            None => self.whole(raw),
        }
    }

    /// An action that is another one seen in a mirror.
    fn mirrored(&self, raw: &RawAction, other: &Spanned<String>) -> Result<Action, Error> {
        if raw.duration_s.is_some() || !raw.group.is_empty() || raw.cyclic || !raw.pose.is_empty() {
            return Err(Error::new("a mirrored action has nothing of its own but name and note")
                .at(self.at(other))
                .remedy("leave out everything but schema, name, note, source and mirror_of"));
        }
        let found = (self.library)(other.get_ref()).ok_or_else(|| {
            Error::of(ErrorKind::Unknown, "no such action to mirror")
                .at(self.at(other))
                .got(other.get_ref().clone())
        })?;
        let mut action = found.mirrored();
        action.name.clone_from(raw.name.get_ref());
        if !raw.note.is_empty() {
            action.note.clone_from(&raw.note);
        }
        if !raw.source.is_empty() {
            action.source.clone_from(&raw.source);
        }
        Ok(action)
    }

    fn whole(&self, raw: &RawAction) -> Result<Action, Error> {
        let durations = MIN_DURATION_S..=MAX_DURATION_S;
        let Some(duration) = &raw.duration_s else {
            return Err(Error::new("an action needs a duration")
                .at(self.place)
                .remedy("add duration_s, s; of a cyclic action the period"));
        };
        if !durations.contains(duration.get_ref()) {
            return Err(Error::new("an action's duration is out of range")
                .at(self.at(duration))
                .got(format!("{} s", duration.get_ref()))
                .allowed(format!("{} to {} s", durations.start(), durations.end())));
        }
        let rounds = raw.rounds.as_ref().map_or(1, |rounds| *rounds.get_ref());
        if let Some(given) = &raw.rounds
            && !(raw.cyclic && (1..=crate::action::perform::MAX_ROUNDS).contains(&rounds))
        {
            return Err(Error::new("rounds are for cyclic actions, at least one")
                .at(self.at(given))
                .got(rounds.to_string()));
        }
        let mut action = Action {
            name: raw.name.get_ref().clone(),
            note: raw.note.clone(),
            source: raw.source.clone(),
            captured: raw.captured,
            kind: raw.kind.unwrap_or(Kind::Action),
            cyclic: raw.cyclic.then(|| self.ends(raw)).transpose()?,
            duration_s: *duration.get_ref(),
            rounds,
            pose: self.pose(&raw.pose)?,
            groups: Vec::new(),
            waveforms: Vec::new(),
            strides: Vec::new(),
            flights: self.flights(&raw.flights, raw.cyclic)?,
            phases: Vec::new(),
        };
        if !raw.cyclic && (raw.start.is_some() || raw.stop.is_some()) {
            return Err(Error::new("start and stop are for cyclic actions").at(self.place));
        }
        for (at, name) in &raw.phases {
            if !(0.0..=1.0).contains(at) {
                return Err(Error::new("a phase is not within the action")
                    .at(format!("{}, phase {name}", self.place))
                    .got(at.to_string())
                    .allowed("0 to 1, a part of the duration"));
            }
            action.phases.push(Phase { at: *at, name: name.clone() });
        }
        for group in &raw.group {
            self.group(&mut action, group)?;
        }
        let dofs: Vec<Dof> = action.tracks().map(|track| track.dof).collect();
        action.kind.admit(&dofs).map_err(|e| e.at(self.place))?;
        // What the pieces cannot show alone: seams out of order on the way in and out.
        action.perform().map_err(|mut e| {
            e.place = Some(format!("{}: {}", self.place, e.place.unwrap_or_default()).into());
            e
        })?;
        Ok(action)
    }

    fn dof(&self, name: &Spanned<String>) -> Result<Dof, Error> {
        Dof::named(name.get_ref()).ok_or_else(|| {
            Error::of(ErrorKind::Unknown, "no such degree of freedom").at(self.at(name)).none_of(
                name.get_ref(),
                Dof::ALL.map(Dof::name),
                "take one of these",
            )
        })
    }

    fn angle(&self, dof: Dof, angle_deg: f64, place: String) -> Result<f64, Error> {
        let (lower, upper) = dof.range_rad();
        let angle_rad = angle_deg.to_radians();
        // A thousandth of a degree for what was rounded when it was written.
        let slack = 1e-3f64.to_radians();
        let (lower, upper) =
            if self.captured { (-CAPTURED_RAD, CAPTURED_RAD) } else { (lower, upper) };
        if !(lower - slack..=upper + slack).contains(&angle_rad) {
            return Err(Error::of(
                ErrorKind::OutsideLimits,
                "an angle is outside the anatomical range",
            )
            .at(place)
            .got(format!("{angle_deg} deg"))
            .allowed(format!(
                "{:.0} to {:.0} deg",
                lower.to_degrees(),
                upper.to_degrees()
            )));
        }
        Ok(angle_rad)
    }

    fn pose(&self, raw: &BTreeMap<Spanned<String>, f64>) -> Result<JointAngles, Error> {
        let mut pose = JointAngles::default();
        for (name, angle_deg) in raw {
            let dof = self.dof(name)?;
            let place = format!("{}, pose, {}", self.at(name), dof.name());
            pose[dof] = self.angle(dof, *angle_deg, place)?;
        }
        Ok(pose)
    }

    fn flights(&self, raw: &[Spanned<[f64; 2]>], cyclic: bool) -> Result<Vec<(f64, f64)>, Error> {
        let mut flights = Vec::new();
        let mut since = 0.0;
        for flight in raw {
            let [from, to] = *flight.get_ref();
            let last = if cyclic { 2.0 } else { 1.0 };
            if !(since <= from && from < 1.0 && from < to && to <= last && to - from < 1.0) {
                return Err(Error::new("a flight is not within the action, or overlaps another")
                    .at(self.at(flight))
                    .got(format!("{from} to {to}"))
                    .allowed("parts of the duration, in order"));
            }
            since = to;
            flights.push((from, to));
        }
        Ok(flights)
    }

    fn ends(&self, raw: &RawAction) -> Result<Ends, Error> {
        let start = raw.start.as_ref();
        let stop = raw.stop.as_ref();
        let ends = Ends {
            phase: start.map_or(0.0, |start| start.phase),
            after: start.and_then(|start| start.after).unwrap_or(0.25),
            before: stop.and_then(|stop| stop.before).unwrap_or(0.25),
            lead_in: self.lead(start.map(|start| &start.turns), 0.0..=1.0)?,
            lead_out: self.lead(stop.map(|stop| &stop.turns), -1.0..=0.0)?,
        };
        let early = |(_, turn): &&(Dof, Turn)| !(turn.at < ends.after);
        let late = |(_, turn): &&(Dof, Turn)| !(turn.at > -ends.before);
        if let Some((dof, turn)) =
            ends.lead_in.iter().find(early).or(ends.lead_out.iter().find(late))
        {
            return Err(Error::new("a turning point on the way in or out lies within the cycle")
                .at(format!("{}, {}", self.place, dof.name()))
                .got(turn.at.to_string())
                .allowed("before start.after, or after stop.before from the end"));
        }
        for (what, value) in [("start.after", ends.after), ("stop.before", ends.before)] {
            if !(value > 0.0 && value <= 1.0) {
                return Err(Error::new(format!("{what} is out of range"))
                    .at(self.place)
                    .got(value.to_string())
                    .allowed("above 0 to 1 period"));
            }
        }
        if !(0.0..1.0).contains(&ends.phase) {
            return Err(Error::new("start.phase is out of range")
                .at(self.place)
                .got(ends.phase.to_string())
                .allowed("0 to below 1"));
        }
        Ok(ends)
    }

    fn lead(
        &self,
        rows: Option<&Rows>,
        range: std::ops::RangeInclusive<f64>,
    ) -> Result<Vec<(Dof, Turn)>, Error> {
        let mut leads = Vec::new();
        for (name, rows) in rows.into_iter().flatten() {
            let dof = self.dof(name)?;
            let turns = self.turns(dof, rows, &range)?;
            leads.extend(turns.into_iter().map(|turn| (dof, turn)));
        }
        Ok(leads)
    }

    /// Rows of a degree of freedom: `[at, deg]`, `[at, deg, T]` or `[at, deg, "shape"]`.
    fn turns(
        &self,
        dof: Dof,
        rows: &[Spanned<Vec<Cell>>],
        range: &std::ops::RangeInclusive<f64>,
    ) -> Result<Vec<Turn>, Error> {
        let mut turns: Vec<Turn> = Vec::new();
        for row in rows {
            let place = format!("{}, {}", self.at(row), dof.name());
            let (at, angle_deg, shape) = match row.get_ref().as_slice() {
                [Cell::Number(at), Cell::Number(deg)] => (*at, *deg, Shape::default()),
                [Cell::Number(at), Cell::Number(deg), Cell::Number(peak_at)] => {
                    let shape = Shape::half_sine(*peak_at).map_err(|e| e.at(place.clone()))?;
                    (*at, *deg, shape)
                }
                [Cell::Number(at), Cell::Number(deg), Cell::Word(word)] => {
                    (*at, *deg, self.shape(word).map_err(|e| e.at(place.clone()))?)
                }
                _ => {
                    return Err(Error::new("a row is not an actionlet")
                        .at(place)
                        .allowed("[when it ends, angle there in deg, T or name of a shape]"));
                }
            };
            if !range.contains(&at) {
                return Err(Error::new("an actionlet ends outside the action")
                    .at(place)
                    .got(at.to_string())
                    .allowed(format!(
                        "{} to {}, a part of the duration",
                        range.start(),
                        range.end()
                    )));
            }
            if turns.last().is_some_and(|before| !(before.at < at)) {
                return Err(Error::new("an actionlet must end after the one before")
                    .at(place)
                    .got(at.to_string())
                    .remedy("put the rows in order of time"));
            }
            let angle_rad = self.angle(dof, angle_deg, place)?;
            turns.push(Turn { at, angle_rad, shape });
        }
        Ok(turns)
    }

    fn shape(&self, word: &str) -> Result<Shape, Error> {
        if word == "minimum-jerk" {
            return Ok(Shape::MinimumJerk);
        }
        self.shapes.get(word).cloned().ok_or_else(|| {
            Error::of(ErrorKind::Unknown, "no such velocity function")
                .got(word)
                .allowed("T from 0.1 to 0.9, \"minimum-jerk\", or a name under [shapes]")
        })
    }

    fn group(&self, action: &mut Action, raw: &Spanned<RawGroup>) -> Result<(), Error> {
        let place = format!("{}, group {}", self.at(raw), raw.get_ref().name);
        let raw = raw.get_ref();
        let refuse = |what: &str| Err(Error::new(what).at(place.clone()));
        if action.groups.iter().any(|group| group.name == raw.name) {
            return refuse("two groups have the same name");
        }
        let [numerator, denominator] = raw.rate.unwrap_or([1, 1]);
        if !((1..=100).contains(&numerator) && (1..=100).contains(&denominator)) {
            return refuse("a rate is not two whole numbers from 1 to 100");
        }
        if !raw.phase.is_finite() {
            return refuse("a phase is not finite");
        }
        if action.cyclic.is_none() && (raw.phase != 0.0 || numerator != denominator) {
            return refuse("phase and rate are for cyclic actions");
        }
        let given = [!raw.turns.is_empty(), raw.mirrors.is_some(), raw.from.is_some()];
        if given.into_iter().filter(|given| *given).count() != 1 {
            return refuse("a group needs exactly one of turns, mirrors and from");
        }
        let tracks = if let Some(other) = &raw.mirrors {
            let Some(group) = action.groups.iter().find(|group| group.name == *other) else {
                return refuse("a group mirrors one that does not stand before it");
            };
            let mirrored: Vec<(Dof, f64, usize)> = group
                .tracks
                .iter()
                .map(|t| (t.dof.mirrored().0, t.dof.mirrored().1, t.waveform))
                .collect();
            mirrored
                .into_iter()
                .map(|(dof, sign, waveform)| Track {
                    dof,
                    waveform: if sign < 0.0 { action.negated(waveform) } else { waveform },
                })
                .collect()
        } else if let Some(other) = &raw.from {
            self.borrowed(action, other).map_err(|e| e.at(place.clone()))?
        } else {
            self.own_tracks(action, raw)?
        };
        let group = Group {
            name: raw.name.clone(),
            kind: raw.kind,
            tracks,
            phase: raw.phase.rem_euclid(1.0),
            rate: (numerator, denominator),
        };
        let dofs: Vec<Dof> = group.tracks.iter().map(|track| track.dof).collect();
        raw.kind.admit(&dofs).map_err(|e| e.at(place.clone()))?;
        for other in &action.groups {
            if let Some(twice) = other.tracks.iter().find(|track| dofs.contains(&track.dof)) {
                return Err(Error::new("a degree of freedom is driven twice").at(place).got(
                    format!(
                        "{}: in group {} and in group {}",
                        twice.dof.name(),
                        other.name,
                        raw.name
                    ),
                ));
            }
        }
        action.groups.push(group);
        Ok(())
    }

    fn own_tracks(&self, action: &mut Action, raw: &RawGroup) -> Result<Vec<Track>, Error> {
        let mut tracks = Vec::new();
        for (name, rows) in &raw.turns {
            let dof = self.dof(name)?;
            let turns = self.turns(dof, rows, &(0.0..=1.0))?;
            let place = || format!("{}, {}", self.at(name), dof.name());
            let Some(first) = turns.first() else {
                return Err(Error::new("a degree of freedom has no turning point").at(place()));
            };
            let last = turns.last().map_or(first.at, |turn| turn.at);
            if action.cyclic.is_some() {
                if turns.len() < 2 || !(last < first.at + 1.0) {
                    return Err(Error::new("a cycle needs two turning points within one period")
                        .at(place())
                        .allowed("at from 0 to below 1"));
                }
            } else if !(first.at > 0.0) {
                return Err(Error::new("the first actionlet starts at 0 and must end later")
                    .at(place())
                    .remedy("say the angle at the start under [pose]"));
            }
            tracks.push(Track { dof, waveform: action.waveforms.len() });
            action.waveforms.push(turns);
        }
        tracks.sort_by_key(|track| track.dof);
        Ok(tracks)
    }

    /// The tracks of a group of another action: `ACTION/GROUP`.
    fn borrowed(&self, action: &mut Action, other: &str) -> Result<Vec<Track>, Error> {
        let missing = || {
            Error::of(ErrorKind::Unknown, "no such group to take from")
                .got(other)
                .allowed("\"ACTION/GROUP\"")
        };
        let (name, group) = other.split_once('/').ok_or_else(missing)?;
        let lender = (self.library)(name).ok_or_else(missing)?;
        let group = lender.groups.iter().find(|g| g.name == group).ok_or_else(missing)?;
        if lender.cyclic.is_some() != action.cyclic.is_some() {
            return Err(
                Error::new("a cyclic action cannot lend to one that is done once").got(other)
            );
        }
        let mut tracks = Vec::new();
        for track in &group.tracks {
            tracks.push(Track { dof: track.dof, waveform: action.waveforms.len() });
            action.waveforms.push(lender.waveforms[track.waveform].clone());
        }
        Ok(tracks)
    }
}

impl Action {
    /// Everything that moves.
    pub fn tracks(&self) -> impl Iterator<Item = &Track> {
        self.groups.iter().flat_map(|group| &group.tracks)
    }

    /// Whether it drives a hip, knee or ankle.
    pub(super) fn moves_legs(&self) -> bool {
        self.tracks().any(|track| track.dof.is_of_leg())
    }

    /// Adds a waveform with every angle of another turned around.
    fn negated(&mut self, waveform: usize) -> usize {
        let turned = self.waveforms[waveform].iter();
        let turned = turned.map(|turn| Turn { angle_rad: -turn.angle_rad, ..turn.clone() });
        self.waveforms.push(turned.collect());
        self.waveforms.len() - 1
    }

    /// Left and right exchanged.
    #[must_use]
    pub fn mirrored(&self) -> Self {
        let mut mirrored = self.clone();
        for dof in Dof::ALL {
            let (other, sign) = dof.mirrored();
            mirrored.pose[other] = sign * self.pose[dof];
        }
        for group in 0..self.groups.len() {
            mirrored.groups[group].name = swapped(&self.groups[group].name);
            for track in 0..self.groups[group].tracks.len() {
                let Track { dof, waveform } = self.groups[group].tracks[track];
                let (dof, sign) = dof.mirrored();
                let waveform = if sign < 0.0 { mirrored.negated(waveform) } else { waveform };
                mirrored.groups[group].tracks[track] = Track { dof, waveform };
            }
        }
        for phase in &mut mirrored.phases {
            phase.name = swapped(&phase.name);
        }
        mirrored.note = swapped(&self.note);
        if let Some(ends) = &mut mirrored.cyclic {
            for (dof, turn) in ends.lead_in.iter_mut().chain(&mut ends.lead_out) {
                let (other, sign) = dof.mirrored();
                *dof = other;
                turn.angle_rad *= sign;
            }
        }
        mirrored
    }
}

/// The words left and right exchanged.
fn swapped(text: &str) -> String {
    text.replace("left", "\0").replace("right", "left").replace('\0', "right")
}
