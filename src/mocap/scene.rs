//! A body in motion over a floor, as it is drawn: what a camera that follows it has to show.

use crate::body::{Proportions, SegmentPose};
use glam::DVec2;

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
    /// Whether the feet are the person's own, and not only drawn on: else nobody knows what carries.
    pub has_feet: bool,
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
