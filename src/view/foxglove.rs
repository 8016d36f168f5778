//! The scene of a page as messages of Foxglove's in an MCAP file: for Foxglove, rerun, and what else reads them.
//!
//! Frames are told relative to their parents (`foxglove.FrameTransforms`), from `world` (Z up, the floor at zero) over
//! a robot's links, each by its name; what hangs on them is told once (`foxglove.SceneUpdate`). Links of the goal have
//! `goal/` before their names. Values are rounded as on the page ([`super::ANGLE_RAD`], [`super::PLACE_M`]).

mod messages;
mod points;
mod robot;

use super::scene::ViewScene;
use super::tracks::{SampleClock, SpanKind, ViewSpan};
use crate::recording::{MessageFile, Schema};
use messages::{Colour, Log, LogLevel, SceneUpdate, Timestamp, Told};
use points::{Dots, Figure};
use robot::Actor;
use std::io::{self, Write};
use std::marker::PhantomData;

/// Instants per second, at most.
const LOOKS_HZ: f64 = 60.0;
/// The frame that does not move.
const WORLD: &str = "world";
/// How thick lines are, m.
const LINE_M: f64 = 0.004;
/// What stands, or carries.
const GOOD: Colour = Colour::new([0.1, 0.65, 0.35, 1.0]);
/// What is wrong.
const WRONG: Colour = Colour::new([0.85, 0.15, 0.1, 1.0]);
/// The centre of mass.
const MASS: Colour = Colour::new([0.5, 0.3, 0.8, 1.0]);

/// A scene on its way into a file.
#[derive(Clone, Copy, Debug)]
pub struct SceneFile<'a> {
    /// What is drawn.
    pub scene: &'a ViewScene,
    /// The robot as URDF, whose links have the names of the frames.
    pub urdf: Option<&'a str>,
    /// When it begins, ns since 1970.
    pub start_ns: u64,
}

/// What was written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SceneCounts {
    /// Instants of whatever moves.
    pub instants: usize,
    /// Links of a robot.
    pub links: usize,
}

/// What is told at one instant: the number of its sample, or of the span.
#[derive(Clone, Copy)]
enum Turn {
    Span(usize),
    Robot,
    Person(usize),
    Markers(usize),
}

impl SceneFile<'_> {
    /// Writes it.
    ///
    /// # Errors
    /// What cannot be written.
    pub fn write(&self, to: impl Write) -> io::Result<SceneCounts> {
        let mut stage = Stage { file: MessageFile::new(to), start_ns: self.start_ns };
        let scene = self.scene;
        let mut turns: Vec<(f64, Turn)> = Vec::new();
        let spans = scene.spans.iter().enumerate();
        turns.extend(spans.map(|(n, span)| (span.start_s.max(0.0), Turn::Span(n))));
        let mut actor = None;
        if let Some(track) = &scene.robot {
            if let Some(urdf) = self.urdf {
                stage.describe(urdf)?;
            }
            actor = Some(Actor::new(&mut stage, track, scene)?);
            let count = (scene.duration_s * LOOKS_HZ).floor() as usize;
            turns.extend((0..=count).map(|n| (n as f64 / LOOKS_HZ, Turn::Robot)));
        }
        let figure = scene.person.as_ref().map(|person| Figure::new(&mut stage, person));
        let figure = figure.transpose()?;
        let dots = scene.markers.as_ref().map(|markers| Dots::new(&mut stage, markers));
        let dots = dots.transpose()?;
        let looks = |clock: &SampleClock| -> Vec<(usize, f64)> {
            let times_s = clock.times_s();
            let mean_hz = times_s.len().saturating_sub(1) as f64
                / times_s.last().copied().unwrap_or(0.0).max(1e-9);
            // Rates of captures are a little off what they are meant to be.
            let every = (mean_hz / LOOKS_HZ - 0.01).ceil().max(1.0) as usize;
            times_s.into_iter().enumerate().step_by(every).collect()
        };
        if let Some(person) = &scene.person {
            turns.extend(looks(&person.clock).into_iter().map(|(n, at_s)| (at_s, Turn::Person(n))));
        }
        if let Some(markers) = &scene.markers {
            turns.extend(
                looks(&markers.clock).into_iter().map(|(n, at_s)| (at_s, Turn::Markers(n))),
            );
        }
        turns.sort_by(|one, two| one.0.total_cmp(&two.0));
        let events = stage.channel::<Log>("/events")?;
        let mut counts = SceneCounts::default();
        for (at_s, turn) in turns {
            counts.instants += usize::from(!matches!(turn, Turn::Span(_)));
            match turn {
                Turn::Span(n) => stage.tell(events, at_s, |ns| log(&scene.spans[n], ns))?,
                Turn::Robot => {
                    actor.iter_mut().try_for_each(|actor| actor.put(&mut stage, at_s))?
                }
                Turn::Person(n) => figure.iter().try_for_each(|of| of.put(&mut stage, n, at_s))?,
                Turn::Markers(n) => dots.iter().try_for_each(|of| of.put(&mut stage, n, at_s))?,
            }
        }
        counts.links = scene.robot.as_ref().map_or(0, |robot| robot.links.len());
        stage.file.finish()?.flush()?;
        Ok(counts)
    }
}

/// What a span says.
fn log(span: &ViewSpan, time_ns: u64) -> Log {
    let level = match span.kind {
        SpanKind::Part | SpanKind::Event | SpanKind::Phase | SpanKind::Mended => LogLevel::Info,
        SpanKind::Doubt => LogLevel::Warning,
        SpanKind::Wrong => LogLevel::Error,
    };
    let ViewSpan { row, label, start_s, end_s, .. } = span;
    Log {
        timestamp: Some(Timestamp::of(time_ns)),
        level: level.into(),
        message: format!("{label} ({start_s:.2} to {end_s:.2} s)"),
        name: row.clone(),
    }
}

/// A channel of messages of one kind.
struct Channel<M>(u16, PhantomData<M>);

impl<M> Clone for Channel<M> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<M> Copy for Channel<M> {}

/// The file that messages go into.
struct Stage<W: Write> {
    file: MessageFile<W>,
    start_ns: u64,
}

impl<W: Write> Stage<W> {
    fn channel<M: Told>(&mut self, topic: &str) -> io::Result<Channel<M>> {
        Ok(Channel(self.file.channel(topic, M::SCHEMA)?, PhantomData))
    }

    /// Tells what is made of an instant, which it is given in ns since 1970.
    fn tell<M: Told>(
        &mut self,
        channel: Channel<M>,
        at_s: f64,
        made: impl FnOnce(u64) -> M,
    ) -> io::Result<()> {
        let time_ns = self.start_ns.saturating_add((at_s.max(0.0) * 1e9).round() as u64);
        self.file.add(channel.0, time_ns, &made(time_ns).encode_to_vec())
    }

    /// Tells the robot's model, as ROS does.
    fn describe(&mut self, urdf: &str) -> io::Result<()> {
        const TEXT: Schema<'_> = Schema {
            name: "std_msgs/String",
            encoding: "jsonschema",
            data: br#"{"type":"object","properties":{"data":{"type":"string"}}}"#,
            messages: "json",
        };
        let channel = self.file.channel("/robot_description", TEXT)?;
        let message = serde_json::json!({ "data": urdf }).to_string();
        self.file.add(channel, self.start_ns, message.as_bytes())
    }
}

/// A place among samples.
#[derive(Clone, Copy)]
struct Between {
    index: usize,
    share: f64,
}

impl Between {
    /// Where an instant is among rising times.
    fn of(times_s: &[f64], at_s: f64) -> Self {
        let after = times_s.partition_point(|time_s| *time_s <= at_s);
        let index = after.saturating_sub(1);
        let share = match (times_s.get(index), times_s.get(index + 1)) {
            (Some(from_s), Some(to_s)) if to_s > from_s => {
                ((at_s - from_s) / (to_s - from_s)).clamp(0.0, 1.0)
            }
            _ => 0.0,
        };
        Self { index, share }
    }

    /// The value there; at the edge of a gap that which is nearer. Not a number: nobody knows.
    fn mixed(self, values: &[f64]) -> f64 {
        let value = |index: usize| values.get(index).copied().unwrap_or(f64::NAN);
        let [one, two] = [value(self.index), value(self.index + 1)];
        if self.share == 0.0 {
            return one;
        }
        if one.is_nan() || two.is_nan() {
            return if self.share < 0.5 { one } else { two };
        }
        one + (two - one) * self.share
    }
}

/// One entity.
fn update(entity: messages::SceneEntity) -> SceneUpdate {
    SceneUpdate { entities: vec![entity] }
}
