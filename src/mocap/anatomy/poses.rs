//! The poses in which the constants of a skeleton are found: some of each clip, spread evenly.

use crate::body::Segment;
use crate::mocap::clip::Clip;
use crate::mocap::landmarks::Landmarks;
use crate::mocap::mapping::{LEGS, Mapping};
use crate::mocap::skeleton::Placed;
use glam::DVec3;

/// Most poses of one clip.
const OF_ONE_CLIP: usize = 600;
/// Most poses of all clips together, unless these are so many that each gives the fewest.
const OF_ALL_CLIPS: usize = 1200;
/// Each clip of many gives this many.
const FEWEST: usize = 40;
/// A foot on the floor moves slower than this, m/s, and is this near its lowest, m.
const STILL_M_S: f64 = 0.3;
const NEAR_FLOOR_M: f64 = 0.03;

/// A pose of a skeleton in the world.
#[derive(Clone, Debug)]
pub struct Stance {
    /// Where the joints are, m, Z up.
    pub placed: Placed,
    /// Which foot stands still on the floor: left, right.
    pub foot_stands: [bool; 2],
    clip: usize,
}

/// How the joints of one clip are to be read.
#[derive(Clone, Debug)]
struct Interpretation {
    mapping: Mapping,
    metres_per_unit: f64,
}

/// Poses of clips of one skeleton, whose mappings name the same joints.
#[derive(Clone, Debug, Default)]
pub struct Poses {
    clips: Vec<Interpretation>,
    captured: Vec<Stance>,
    drawn: Vec<Stance>,
}

impl Poses {
    /// The poses of a clip alone.
    #[must_use]
    pub fn of(clip: &Clip) -> Self {
        let mut poses = Self::default();
        poses.add(clip, 1);
        poses
    }

    /// Adds a clip, one of so many.
    pub fn add(&mut self, clip: &Clip, clips: usize) {
        let most = (OF_ALL_CLIPS / clips.max(1)).clamp(FEWEST, OF_ONE_CLIP);
        let number = self.clips.len();
        let stance = |placed, foot_stands| Stance { placed, foot_stands, clip: number };
        self.drawn.extend(clip.rest().map(|placed| stance(placed, [false; 2])));
        let indices: Vec<usize> = clip.samples(most).collect();
        let placed: Vec<Placed> = indices.iter().map(|index| placed(clip, *index)).collect();
        let feet = LEGS.map(|[_, _, foot]| standing(clip, foot, &indices, &placed));
        let stances = placed.into_iter().enumerate().map(|(at, placed)| {
            let foot_stands = [feet[0][at], feet[1][at]];
            stance(placed, foot_stands)
        });
        self.captured.extend(stances);
        self.clips.push(Interpretation {
            mapping: clip.mapping().clone(),
            metres_per_unit: clip.metres_per_unit(),
        });
    }

    /// Poses out of the motion of the clips.
    #[must_use]
    pub fn captured(&self) -> &[Stance] {
        &self.captured
    }

    /// The poses that the clips' skeletons are drawn in, where they stand upright. What so looks at the
    /// beginning of a few clips of many is none.
    #[must_use]
    pub fn drawn(&self) -> &[Stance] {
        if 2 * self.drawn.len() >= self.clips.len() { &self.drawn } else { &[] }
    }

    /// The joint whose frame a segment is fixed in.
    #[must_use]
    pub fn carrier(&self, segment: Segment) -> Option<usize> {
        Some(self.clips.first()?.mapping.part(segment)?.carrier)
    }

    /// A pose seen as a body.
    #[must_use]
    pub fn body<'a>(&'a self, stance: &'a Stance) -> Landmarks<'a> {
        let Interpretation { mapping, metres_per_unit } = &self.clips[stance.clip];
        Landmarks { mapping, placed: &stance.placed, unit: *metres_per_unit }
    }
}

fn placed(clip: &Clip, index: usize) -> Placed {
    let mut placed = Placed::default();
    clip.place(index, &mut placed);
    placed
}

/// In which of some poses of a clip a foot stands still on the floor.
fn standing(clip: &Clip, foot: Segment, indices: &[usize], poses: &[Placed]) -> Vec<bool> {
    let ends = |placed: &Placed| -> Option<[DVec3; 2]> {
        let body = clip.landmarks(placed);
        let ankle = body.joint(foot)?;
        Some([ankle, ankle + body.bone(foot)?])
    };
    let places: Vec<Option<[DVec3; 2]>> = poses.iter().map(ends).collect();
    let floor = [0, 1].map(|end| {
        let mut heights: Vec<f64> = places.iter().flatten().map(|place| place[end].z).collect();
        heights.sort_by(f64::total_cmp);
        heights.get(heights.len() / 10).copied().unwrap_or(0.0) + NEAR_FLOOR_M
    });
    let mut next = Placed::default();
    let mut stands = |index: usize, here: [DVec3; 2]| {
        if index + 1 >= clip.pose_count() || (0..2).any(|end| here[end].z > floor[end]) {
            return false;
        }
        clip.place(index + 1, &mut next);
        let slow = |there: [DVec3; 2]| {
            (0..2).all(|end| (there[end] - here[end]).length() * clip.rate_hz() < STILL_M_S)
        };
        ends(&next).is_some_and(slow)
    };
    let all = indices.iter().zip(&places);
    all.map(|(index, here)| here.is_some_and(|here| stands(*index, here))).collect()
}
