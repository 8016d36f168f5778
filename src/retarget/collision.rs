//! Whether a robot is in itself.
//!
//! Links that are at most two joints apart (a link, its parent and that one's parent; those on one parent)
//! are left out: what is mounted there is made to fit, and simplified shapes overlap. So are those whose
//! shapes are in one another in the pose the robot starts in: the shapes are too large there.

use crate::rigid::{Placement, Volume, WayOut};
use crate::robot::RobotBody;
use glam::DVec3;

/// Links deeper in one another than this touch, m.
pub const TOUCHES_M: f64 = 0.001;

/// What of a robot could touch what.
#[derive(Clone, Debug)]
pub struct SelfContact {
    volumes: Vec<Volume>,
    /// Of each volume its link, and a ball in the link's axes that holds it: middle and radius, m.
    balls: Vec<(usize, DVec3, f64)>,
    /// Volumes of links that are not neighbours.
    pairs: Vec<(usize, usize)>,
    overlarge: Vec<(usize, usize)>,
}

/// Two links that are in one another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Overlap {
    /// How deep, m.
    pub depth_m: f64,
    /// Indices of the links.
    pub links: (usize, usize),
}

impl SelfContact {
    /// Of a body, whose joints start at these angles, rad.
    ///
    /// # Panics
    /// If there are not as many as joints of the robot.
    #[must_use]
    pub fn of(body: &RobotBody, start_rad: &[f64]) -> Self {
        let all = body.volumes.iter().enumerate();
        let (volumes, balls): (Vec<Volume>, Vec<(usize, DVec3, f64)>) = all
            .flat_map(|(link, volumes)| {
                volumes.iter().map(move |volume| {
                    let (middle, radius_m) = volume.ball_m();
                    (*volume, (link, middle, radius_m))
                })
            })
            .unzip();
        let count = volumes.len();
        let pairs: Vec<(usize, usize)> = (0..count)
            .flat_map(|one| (one + 1..count).map(move |two| (one, two)))
            .filter(|&(one, two)| !body.are_neighbours(balls[one].0, balls[two].0))
            .collect();
        let mut all = Self { volumes, balls, pairs, overlarge: Vec::new() };
        let placed = body.tree.place(Placement::IDENTITY, &body.angles(start_rad));
        while let Some(overlap) = all.deepest(&placed).filter(|of| of.depth_m > TOUCHES_M) {
            let Self { balls, pairs, .. } = &mut all;
            pairs.retain(|&(one, two)| (balls[one].0, balls[two].0) != overlap.links);
            all.overlarge.push(overlap.links);
        }
        all
    }

    /// Links that are not looked at because their shapes are too large, two by two.
    #[must_use]
    pub fn overlarge(&self) -> &[(usize, usize)] {
        &self.overlarge
    }

    /// The deepest overlap of a body that is placed; none if nothing overlaps.
    #[must_use]
    pub fn deepest(&self, placed: &[Placement]) -> Option<Overlap> {
        let middles: Vec<DVec3> =
            self.balls.iter().map(|(link, middle, _)| placed[*link].point(*middle)).collect();
        let mut deepest: Option<Overlap> = None;
        for &(one, two) in &self.pairs {
            let reach_m = self.balls[one].2 + self.balls[two].2;
            if !(middles[one].distance_squared(middles[two]) < reach_m * reach_m) {
                continue;
            }
            let links = (self.balls[one].0, self.balls[two].0);
            let (a, b) = (
                self.volumes[one].placed(placed[links.0]),
                self.volumes[two].placed(placed[links.1]),
            );
            let depth_m = a.depth_m(&b);
            if depth_m > deepest.map_or(0.0, |of| of.depth_m) {
                deepest = Some(Overlap { depth_m, links });
            }
        }
        deepest
    }

    /// Which links are in one another, and how they part; where they meet as exactly as that can be told.
    #[must_use]
    pub fn touching(&self, placed: &[Placement]) -> Vec<((usize, usize), WayOut)> {
        let mut found = Vec::new();
        self.near(placed, 0.0, |links, [one, two]| {
            let at_m = || one.meeting_m(&two);
            found.extend(one.way_out(&two).map(|way| (links, WayOut { at_m: at_m(), ..way })));
        });
        found
    }

    /// Hands over how links part that are nearer to one another than `room_m`, of those that are
    /// `looked_at`: links, and the way out of shapes that are larger by half of the room.
    pub fn nearer_than(
        &self,
        placed: &[Placement],
        room_m: f64,
        looked_at: impl Fn(usize, usize) -> bool,
        mut found: impl FnMut((usize, usize), WayOut),
    ) {
        self.near(placed, room_m, |links, volumes| {
            if !looked_at(links.0, links.1) {
                return;
            }
            let [one, two] = volumes.map(|volume| volume.grown(room_m / 2.0));
            if let Some(way) = one.way_out(&two) {
                found(links, way);
            }
        });
    }

    /// Hands over shapes, placed, and their links, whose balls are nearer to one another than `room_m`.
    fn near(
        &self,
        placed: &[Placement],
        room_m: f64,
        mut found: impl FnMut((usize, usize), [Volume; 2]),
    ) {
        let middles: Vec<DVec3> =
            self.balls.iter().map(|(link, middle, _)| placed[*link].point(*middle)).collect();
        for &(one, two) in &self.pairs {
            let reach_m = self.balls[one].2 + self.balls[two].2 + room_m;
            if middles[one].distance_squared(middles[two]) < reach_m * reach_m {
                let links = (self.balls[one].0, self.balls[two].0);
                let volume = |at: usize, link: usize| self.volumes[at].placed(placed[link]);
                found(links, [volume(one, links.0), volume(two, links.1)]);
            }
        }
    }
}

/// Height of the lowest point of a body that is placed, its soles among it, m.
#[must_use]
pub fn lowest_m(body: &RobotBody, placed: &[Placement]) -> f64 {
    let volumes = body.volumes.iter().zip(placed).flat_map(|(volumes, place)| {
        volumes.iter().map(|volume| -volume.placed(*place).reach_m(DVec3::NEG_Z))
    });
    let soles = body
        .soles
        .iter()
        .flat_map(|sole| sole.corners_m.iter().map(|corner| placed[sole.link].point(*corner).z));
    volumes.chain(soles).fold(f64::INFINITY, f64::min)
}
