//! A body in motion over a floor, as it is drawn: what a camera that follows it has to show.

use crate::body::{Proportions, Segment, SegmentPose, carrying, contact};
use glam::{DVec2, DVec3};

/// What is drawn.
#[derive(Clone, Copy, Debug)]
pub struct Scene<'a> {
    /// What it is called.
    pub title: &'a str,
    /// The poses.
    pub poses: &'a [SegmentPose],
    /// Whose they are.
    pub body: &'a Proportions,
    /// Poses per second.
    pub rate_hz: f64,
    /// Height of the floor, m.
    pub floor_m: f64,
    /// Whose its feet are.
    pub feet: DrawnFeet,
}

/// Whose feet are drawn, and so how what carries is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DrawnFeet {
    /// Those of a body that was made: what is on the floor carries.
    Made,
    /// Those of a person who was measured: what is low and slow carries.
    Measured,
    /// They are only drawn on: nobody knows what carries.
    DrawnOn,
}

impl DrawnFeet {
    /// Of a body of whose segments these are known.
    #[must_use]
    pub fn of(is_made: bool, known: &[bool; 13]) -> Self {
        let feet = [Segment::LeftFoot, Segment::RightFoot];
        match feet.iter().all(|foot| known[foot.index()]) {
            true if is_made => Self::Made,
            true => Self::Measured,
            false => Self::DrawnOn,
        }
    }
}

/// The upright cylinder about the root that holds the whole body in every pose, and the floor under it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Room {
    /// How far anything is from the root, level, m.
    pub radius_m: f64,
    /// Height of its lower end, m.
    pub bottom_m: f64,
    /// Height of its upper end, m.
    pub top_m: f64,
}

impl Room {
    /// Height of its middle, m.
    #[must_use]
    pub const fn middle_m(&self) -> f64 {
        f64::midpoint(self.bottom_m, self.top_m)
    }

    /// Radius of the ball about its middle that holds it, m.
    #[must_use]
    pub fn ball_m(&self) -> f64 {
        self.radius_m.hypot((self.top_m - self.bottom_m) / 2.0)
    }
}

impl Scene<'_> {
    /// Which of [`SOLES`](crate::body::root::SOLES) carry, by pose; none where nobody knows.
    #[must_use]
    pub fn carries(&self) -> Option<Vec<[bool; 4]>> {
        let places = self.poses.iter().map(|pose| {
            let places_m = contact::places_m(self.body, pose);
            places_m.map(|place_m| place_m - DVec3::Z * self.floor_m)
        });
        match self.feet {
            DrawnFeet::Made => Some(places.map(|places_m| contact::on_floor(&places_m)).collect()),
            DrawnFeet::Measured => {
                Some(carrying::soles(self.body, &places.collect::<Vec<_>>(), self.rate_hz))
            }
            DrawnFeet::DrawnOn => None,
        }
    }

    /// What the body takes up while it moves.
    #[must_use]
    pub fn room(&self) -> Room {
        let mut room = Room { radius_m: 0.0, bottom_m: self.floor_m, top_m: self.floor_m };
        for pose in self.poses {
            let at = self.body.positions(pose);
            for point_m in at.joints_m.iter().chain(&at.ends_m) {
                let away_m = (*point_m - pose.root_m).truncate().length();
                room.radius_m = room.radius_m.max(away_m);
                room.bottom_m = room.bottom_m.min(point_m.z);
                room.top_m = room.top_m.max(point_m.z);
            }
        }
        room
    }

    /// The rectangle over which the root moves, m: its least and its greatest corner.
    #[must_use]
    pub fn path_m(&self) -> (DVec2, DVec2) {
        let mut places = self.poses.iter().map(|pose| pose.root_m.truncate());
        let first = places.next().unwrap_or_default();
        places.fold((first, first), |(least, most), at| (least.min(at), most.max(at)))
    }
}
