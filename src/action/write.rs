//! Action files, written.

use crate::action::{Action, Group, Kind, Motion, Track, Turn};
use crate::actionlet::{Actionlet, Shape};
use crate::body::{Dof, JointAngles};
use crate::error::Error;
use std::collections::BTreeMap;
use std::fmt::Write;

/// The parts of a body that are written together.
const PARTS: [(&str, &[Dof]); 5] = [
    ("trunk", &[Dof::TorsoFlexion, Dof::TorsoLateralBend, Dof::TorsoAxial, Dof::NeckFlexion]),
    (
        "left arm",
        &[
            Dof::LeftShoulderFlexion,
            Dof::LeftShoulderAbduction,
            Dof::LeftShoulderRotation,
            Dof::LeftElbowFlexion,
        ],
    ),
    (
        "right arm",
        &[
            Dof::RightShoulderFlexion,
            Dof::RightShoulderAbduction,
            Dof::RightShoulderRotation,
            Dof::RightElbowFlexion,
        ],
    ),
    (
        "left leg",
        &[
            Dof::LeftHipFlexion,
            Dof::LeftHipAbduction,
            Dof::LeftHipRotation,
            Dof::LeftKneeFlexion,
            Dof::LeftAnkleDorsiflexion,
        ],
    ),
    (
        "right leg",
        &[
            Dof::RightHipFlexion,
            Dof::RightHipAbduction,
            Dof::RightHipRotation,
            Dof::RightKneeFlexion,
            Dof::RightAnkleDorsiflexion,
        ],
    ),
];

impl Action {
    /// A captured motion as an action that is done once, in groups of trunk, arms and legs.
    #[must_use]
    pub fn of_motion(name: &str, note: &str, source: &str, motion: &Motion) -> Self {
        let mut action = Self {
            name: name.to_owned(),
            note: note.to_owned(),
            source: source.to_owned(),
            captured: true,
            kind: Kind::Action,
            cyclic: None,
            duration_s: motion.duration_s(),
            rounds: 1,
            pose: JointAngles::default(),
            groups: Vec::new(),
            waveforms: Vec::new(),
            strides: Vec::new(),
            flights: Vec::new(),
            phases: Vec::new(),
        };
        let part = |time_s: f64| (time_s / motion.duration_s()).min(1.0);
        action.flights = motion.flights_s().iter().map(|(a, b)| (part(*a), part(*b))).collect();
        for (name, dofs) in PARTS {
            let mut tracks = Vec::new();
            for dof in dofs {
                let chain = motion.track(*dof);
                action.pose[*dof] = chain.from_rad();
                let pieces = chain.actionlets();
                if pieces.iter().all(Actionlet::is_rest) {
                    continue;
                }
                let turn = |piece: &Actionlet| Turn {
                    at: part(piece.end_s()),
                    angle_rad: piece.to_rad(),
                    shape: piece.shape().clone(),
                };
                tracks.push(Track { dof: *dof, waveform: action.waveforms.len() });
                action.waveforms.push(pieces.iter().map(turn).collect());
            }
            if !tracks.is_empty() {
                action.groups.push(Group {
                    name: name.to_owned(),
                    kind: Kind::Group,
                    tracks,
                    phase: 0.0,
                    rate: (1, 1),
                });
            }
        }
        action
    }

    /// The action as a file. Times are written to 1e-7 of the duration, angles to 1e-4 deg, peaks
    /// to 1e-4.
    ///
    /// # Errors
    /// If the action is cyclic: those are written by people.
    pub fn to_toml(&self) -> Result<String, Error> {
        if self.cyclic.is_some() {
            return Err(Error::new("cyclic actions are written by hand").got(self.name.clone()));
        }
        let mut out = String::new();
        let quoted = |text: &str| serde_json::Value::from(text).to_string();
        let _ = writeln!(out, "schema = {}", super::file::SCHEMA);
        let _ = writeln!(out, "name = {}", quoted(&self.name));
        let _ = writeln!(out, "note = {}", quoted(&self.note));
        let _ = writeln!(out, "source = {}", quoted(&self.source));
        if self.captured {
            let _ = writeln!(out, "captured = true");
        }
        let _ = writeln!(out, "duration_s = {}", float(self.duration_s, 6));
        let flight = |(from, to): &(f64, f64)| format!("[{}, {}]", float(*from, 7), float(*to, 7));
        let flights: Vec<String> = self.flights.iter().map(flight).collect();
        if !flights.is_empty() {
            let _ = writeln!(out, "flights = [{}]", flights.join(", "));
        }
        let shapes = self.sampled_shapes();
        if !shapes.is_empty() {
            let _ = writeln!(out, "\n[shapes]");
            for (samples, name) in &shapes {
                let _ = writeln!(out, "{name} = [{samples}]");
            }
        }
        let _ = writeln!(out, "\n[pose]");
        for dof in Dof::ALL {
            let angle_deg = float(self.pose[dof].to_degrees(), 4);
            let _ = writeln!(out, "{} = {angle_deg}", dof.name());
        }
        for group in &self.groups {
            let kind = group.kind.name();
            let _ = writeln!(out, "\n[[group]]\nname = {}\nkind = \"{kind}\"", quoted(&group.name));
            for track in &group.tracks {
                let _ = writeln!(out, "turns.{} = [", track.dof.name());
                let mut before_rad = self.pose[track.dof];
                for turn in &self.waveforms[track.waveform] {
                    let at = float(turn.at, 7);
                    let deg = float(turn.angle_rad.to_degrees(), 4);
                    let rests = turn.angle_rad == before_rad;
                    let shape =
                        if rests { String::new() } else { shape_cell(&turn.shape, &shapes) };
                    let _ = writeln!(out, "  [{at}, {deg}{shape}],");
                    before_rad = turn.angle_rad;
                }
                let _ = writeln!(out, "]");
            }
        }
        Ok(out)
    }

    /// Samples as text, and the name each gets.
    fn sampled_shapes(&self) -> BTreeMap<String, String> {
        let mut shapes = BTreeMap::new();
        for turn in self.waveforms.iter().flatten() {
            if let Shape::Sampled(_) = turn.shape {
                let name = format!("shape-{}", shapes.len() + 1);
                shapes.entry(samples_of(&turn.shape)).or_insert(name);
            }
        }
        shapes
    }
}

fn samples_of(shape: &Shape) -> String {
    let Shape::Sampled(sampled) = shape else { return String::new() };
    let values: Vec<String> = sampled.velocities().iter().map(|v| float(*v, 6)).collect();
    values.join(", ")
}

/// The last cell of a row.
fn shape_cell(shape: &Shape, shapes: &BTreeMap<String, String>) -> String {
    match shape {
        Shape::HalfSine(peak_at) => format!(", {}", float(peak_at.value(), 4)),
        Shape::MinimumJerk => ", \"minimum-jerk\"".to_owned(),
        Shape::Sampled(_) => {
            shapes.get(&samples_of(shape)).map_or_else(String::new, |name| format!(", \"{name}\""))
        }
    }
}

/// A number with at most so many decimals, and always a point: integers are another type in TOML.
fn float(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let short = text.trim_end_matches('0').trim_end_matches('.');
    let short = if short == "-0" { "0" } else { short };
    if short.contains('.') { short.to_owned() } else { format!("{short}.0") }
}
