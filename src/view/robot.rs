//! A robot as a page draws it: links with their shapes, and where its base goes. Where links are follows in the
//! page from the angles of the joints.

use super::person::places;
use super::series::Coded;
use super::tracks::{SampleClock, SpanKind, ViewSpan};
use crate::retarget::base::BasePath;
use crate::retarget::collision::{SelfContact, TOUCHES_M};
use crate::rigid::{Placement, Volume};
use crate::robot::RobotBody;
use crate::robot::model::surface::{Surface, coarse};
use glam::{DQuat, DVec3};
use serde::Serialize;

/// What places of the base are rounded to, m, and parts of its turn.
const BASE_M: f64 = 1e-4;
const TURN: f64 = 1.0 / 16_384.0;
/// What corners of meshes are rounded to, m.
const MESH_M: f64 = 1e-4;
/// Triangles of meshes of all links together, at most.
const TRIANGLES: usize = 40_000;
/// Instants per second in which links are held against each other, at most.
const LOOKS_HZ: f64 = 50.0;
/// Spans of one pair of links that are no further apart are one, s.
const TOGETHER_S: f64 = 0.1;
/// Most of them on the time line.
const SPANS: usize = 200;

/// A robot over time.
#[derive(Clone, Debug, Serialize)]
pub struct RobotTrack {
    pub(super) name: String,
    /// In the order in which they hang on one another; the joint of link n + 1 is the robot's n.
    pub(super) links: Vec<LinkShape>,
    /// Links on joints that follow others.
    pub(super) couplings: Vec<Follows>,
    /// Link and corners in its axes, m.
    pub(super) soles: Vec<(usize, Vec<[f64; 3]>)>,
    /// When the base is told.
    pub(super) clock: SampleClock,
    /// Where it is, m.
    pub(super) at: [Coded; 3],
    /// How it is turned: w, x, y, z.
    pub(super) turn: [Coded; 4],
    /// Of the feet that are meant to stand the sum of 1 (left) and 2 (right).
    pub(super) contacts: Coded,
    /// What of it cannot be shown, in words.
    #[serde(skip)]
    pub(super) unseen: Option<String>,
}

/// A link.
#[derive(Clone, Debug, Serialize)]
pub(super) struct LinkShape {
    pub(super) name: String,
    pub(super) parent: Option<usize>,
    /// Its joint in the axes of its parent, m.
    pub(super) origin_m: [f64; 3],
    pub(super) axis: [f64; 3],
    pub(super) mass_kg: f64,
    pub(super) centre_m: [f64; 3],
    pub(super) shapes: Vec<Shape>,
    /// What it looks like, in its axes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) mesh: Option<Mesh>,
}

/// Triangles between points.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Mesh {
    /// Places of corners, m.
    pub(super) points: [Coded; 3],
    /// First, second and third corner of each triangle.
    pub(super) triangles: [Coded; 3],
}

/// What a link takes up, in its axes.
#[derive(Clone, Debug, Serialize)]
#[serde(untagged)]
pub(super) enum Shape {
    Capsule { from_m: [f64; 3], to_m: [f64; 3], radius_m: f64 },
    Cuboid { centre_m: [f64; 3], half_m: [f64; 3], turn: [f64; 4] },
}

/// A joint that follows others.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Follows {
    pub(super) link: usize,
    pub(super) of: Vec<(usize, f64)>,
    pub(super) offset_rad: f64,
}

fn parts(turn: DQuat) -> [f64; 4] {
    [turn.w, turn.x, turn.y, turn.z]
}

impl RobotTrack {
    /// A robot of this body, whose base goes along a path.
    #[must_use]
    pub fn of(name: &str, body: &RobotBody, base: &BasePath) -> Self {
        let links = body.tree.links().iter().zip(&body.volumes).map(|(link, volumes)| LinkShape {
            name: link.name.clone(),
            parent: link.parent,
            origin_m: link.origin.at_m.to_array(),
            axis: link.axis.to_array(),
            mass_kg: link.mass.mass_kg,
            centre_m: link.mass.centre_m.to_array(),
            shapes: volumes.iter().map(shape).collect(),
            mesh: None,
        });
        let couplings = body.tree.couplings().iter().map(|coupling| Follows {
            link: coupling.link,
            of: coupling.of.clone(),
            offset_rad: coupling.offset,
        });
        let soles = body.soles.iter().map(|sole| {
            (sole.link, sole.corners_m.iter().map(|corner_m| corner_m.to_array()).collect())
        });
        let at_m: Vec<DVec3> = base.places.iter().map(|place| place.at_m).collect();
        let turns = steady(base.places.iter().map(|place| place.turn));
        let turn =
            [0, 1, 2, 3].map(|part| Coded::of(turns.iter().map(|turn| parts(*turn)[part]), TURN));
        let stands = base
            .contacts
            .iter()
            .map(|[left, right]| f64::from(u8::from(*left)) + 2.0 * f64::from(u8::from(*right)));
        Self {
            name: name.to_owned(),
            links: links.collect(),
            couplings: couplings.collect(),
            soles: soles.collect(),
            clock: SampleClock::Even { rate_hz: base.rate_hz, count: base.places.len() },
            at: places(&at_m, BASE_M),
            turn,
            contacts: Coded::of(stands, 1.0),
            unseen: None,
        }
    }
}

impl RobotTrack {
    /// The same robot, whose links look like these surfaces, in their order and axes; one without triangles is none.
    /// `unseen`: what cannot be shown, in words.
    #[must_use]
    pub fn looking_like(mut self, looks: &[Surface], unseen: Option<String>) -> Self {
        self.unseen = unseen;
        let points = || looks.iter().flat_map(|look| &look.points_m);
        let far_m = points().map(|at| at.length()).fold(0.0, f64::max);
        for (link, look) in self.links.iter_mut().zip(coarse(looks, far_m, TRIANGLES)) {
            let corner = |at: usize| look.triangles.iter().map(move |of| of[at] as f64);
            link.mesh = (!look.triangles.is_empty()).then(|| Mesh {
                points: places(&look.points_m, MESH_M),
                triangles: [0, 1, 2].map(|at| Coded::of(corner(at), 1.0)),
            });
        }
        self
    }
}

/// A base that stands still: upright, so high that no joint is below the floor with these angles, rad.
#[must_use]
pub fn still(body: &RobotBody, start_rad: &[f64]) -> BasePath {
    let placed = body.tree.place(Placement::IDENTITY, &body.angles(start_rad));
    let low_m = placed.iter().map(|place| place.at_m.z).fold(0.0, f64::min);
    let places = vec![Placement::at(DVec3::Z * -low_m)];
    BasePath { rate_hz: 1.0, places, contacts: vec![[false; 2]] }
}

/// Turns of which none jumps to the other quaternion of its two.
fn steady(turns: impl Iterator<Item = DQuat>) -> Vec<DQuat> {
    let mut before = DQuat::IDENTITY;
    turns
        .map(|turn| {
            before = if before.dot(turn) < 0.0 { -turn } else { turn };
            before
        })
        .collect()
}

fn shape(volume: &Volume) -> Shape {
    match volume {
        Volume::Capsule(of) => Shape::Capsule {
            from_m: of.from_m.to_array(),
            to_m: of.to_m.to_array(),
            radius_m: of.radius_m,
        },
        Volume::Cuboid(of) => Shape::Cuboid {
            centre_m: of.centre_m.to_array(),
            half_m: of.half_m.to_array(),
            turn: parts(of.turn),
        },
    }
}

/// When links of a robot are in one another, in poses that follow at `rate_hz`; `start_rad` are the angles it
/// starts with.
#[must_use]
pub fn collisions(
    body: &RobotBody,
    start_rad: &[f64],
    poses: &[Vec<f64>],
    rate_hz: f64,
) -> Vec<ViewSpan> {
    let contact = SelfContact::of(body, start_rad);
    let every = (rate_hz / LOOKS_HZ).ceil().max(1.0) as usize;
    let mut spans: Vec<ViewSpan> = Vec::new();
    for (at, pose) in poses.iter().enumerate().step_by(every) {
        let placed = body.tree.place(Placement::IDENTITY, &body.angles(pose));
        let found = contact.deepest(&placed).filter(|found| found.depth_m > TOUCHES_M);
        let Some(found) = found else { continue };
        let (start_s, end_s) = (at as f64 / rate_hz, (at + every) as f64 / rate_hz);
        let links = [found.links.0, found.links.1];
        let same = |span: &&mut ViewSpan| span.links == links && start_s - span.end_s < TOGETHER_S;
        let count = spans.len();
        match spans.iter_mut().rev().take(8).find(same) {
            Some(span) => span.end_s = end_s,
            None if count < SPANS => {
                let name = |link: usize| body.tree.links()[link].name.as_str();
                let label = format!("{} and {}", name(links[0]), name(links[1]));
                let span = ViewSpan::new(SpanKind::Wrong, "touches itself", &label, start_s, end_s);
                spans.push(ViewSpan { links: links.to_vec(), ..span });
            }
            None => break,
        }
    }
    spans
}
