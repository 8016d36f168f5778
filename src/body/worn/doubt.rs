//! What a body cannot do: a sensor that says so is doubted, and its segment waits where it is on what carries it,
//! with all that it carries.
//!
//! - Its values stand still (whoever hears it says so).
//! - It turns, or begins to turn, faster than that segment of anybody in 81 captures of walking, dancing, fighting and falling did.
//! - A joint would be turned further than a joint goes: a knee or an elbow bent the wrong way, a limb turned about its own length
//!   against the one above; or a shank about its own length by 25 degrees more than it was against its thigh until now.
//! - What it measures of gravity is not down, and not what the others measure.
//!
//! It is taken up again when it has said nothing of that kind for half a second. After an impossible turn its heading means
//! nothing any more, and its tilt not much: it is taken up again after a stride, once what it measures of gravity is up again, and the segment
//! is taken to face as it usually did.

use super::calibrate::words;
use super::down::Downs;
use super::facing::STRIDE_S;
use crate::body::{Segment, SegmentPose};
use crate::time::Instant;
use crate::units::wrap_rad;
use glam::{DQuat, DVec3};

/// So long nothing may be wrong before a segment is taken up again, s.
const CLEAR_S: f64 = 0.5;
/// After a turn that cannot be, heading and tilt are guesses until a stride has shown the one and the filter has found down anew. So long it
/// is waited at least, and at most for what is measured to point upward again, s.
const LEVEL_S: (f64, f64) = (STRIDE_S + 0.05, 8.0);
/// Samples that are nearer together say too little of how fast something turns, s; those further apart nothing.
const LEAST_STEP_S: f64 = 0.008;
const MOST_STEP_S: f64 = 0.1;
/// Over so long a turn is compared with what it was before, s.
const JOLT_S: f64 = 0.025;

/// A shank is not turned about its own length by more than this beside how it usually is against its thigh, rad; what is usual follows
/// what is said at so much, rad/s: straps and headings may be off, and headings drift by less.
const MOST_UNUSUAL_RAD: f64 = 25.0 * core::f64::consts::PI / 180.0;
const USUAL_RAD_S: f64 = 2.0 * core::f64::consts::PI / 180.0;
/// After headings were mended what is usual is found anew for so long, s.
const MENDED_S: f64 = 10.0;

/// Why a segment is doubted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Why {
    /// Its sensor's values stand still.
    Stuck,
    /// It turns faster than anybody's.
    Turn,
    /// It begins to turn faster than anybody's.
    Jolt,
    /// Its joint does not go so far.
    Range,
    /// What it measures of gravity is not down.
    Gravity,
}

impl Why {
    /// Why, in words.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Self::Stuck => "its values stand still",
            Self::Turn => "it turns faster than anybody can",
            Self::Jolt => "it is jolted as nobody can move",
            Self::Gravity => "what it measures of gravity is not down, nor what the others measure",
            Self::Range => {
                "the joint does not go so far; if it is the heading, N pose and r mend it"
            }
        }
    }

    /// True if the sensor's heading means nothing after that.
    const fn loses_heading(self) -> bool {
        matches!(self, Self::Turn | Self::Jolt | Self::Gravity)
    }
}

/// A segment that began to be doubted, or that is taken up again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DoubtChange {
    /// Which.
    pub segment: Segment,
    /// Why it is doubted; `None`: it is taken up again.
    pub doubted: Option<Why>,
    /// True if its heading is a guess from here on.
    pub heading_lost: bool,
}

impl DoubtChange {
    /// What happened, in words.
    #[must_use]
    pub fn words(&self) -> String {
        let segment = words(self.segment);
        match self.doubted {
            Some(why) => format!("the sensor on the {segment} is doubted: {}", why.words()),
            None if self.heading_lost => format!(
                "the {segment} is followed again, slowly; its heading is a guess: stand in N pose and press r"
            ),
            None => format!("the {segment} is followed again, slowly"),
        }
    }
}

/// Fastest turn of a segment, rad/s, and how much that changes within [`JOLT_S`] at most, rad/s. Measured, at 100 Hz: most over 54,000
/// captured poses (trunk and head turn with 16 and change by 17, arms 43 and 45, thighs 27 and 18, shanks and feet 31 and 23; of one in
/// ten thousand the changes are half as large), and over a minute of walking with real sensors, which a step shakes on the flesh
/// of a leg (pelvis and trunk 9 and 9, thighs 23 and 40, shanks 28 and 35).
const fn bounds(segment: Segment) -> (f64, f64) {
    use Segment as S;
    match segment {
        S::Pelvis | S::Torso | S::Head => (18.0, 11.0),
        S::LeftUpperArm | S::LeftForearm | S::RightUpperArm | S::RightForearm => (50.0, 35.0),
        S::LeftThigh | S::RightThigh => (32.0, 55.0),
        S::LeftShank | S::RightShank | S::LeftFoot | S::RightFoot => (42.0, 50.0),
    }
}

/// How far a segment may be turned against the one that carries it: about its own length, either way, and, of a hinge, about
/// Y, least and greatest, rad. Ranges as of [`crate::body::Dof::range_rad`], and what straps and headings may be off.
const fn most_turned(segment: Segment) -> (f64, Option<(f64, f64)>) {
    use Segment as S;
    const DEGREE: f64 = core::f64::consts::PI / 180.0;
    match segment {
        S::LeftThigh | S::RightThigh => (90.0 * DEGREE, None),
        S::LeftShank | S::RightShank => (40.0 * DEGREE, Some((-40.0 * DEGREE, 175.0 * DEGREE))),
        S::LeftFoot | S::RightFoot => (65.0 * DEGREE, Some((-70.0 * DEGREE, 90.0 * DEGREE))),
        S::LeftForearm | S::RightForearm => (f64::INFINITY, Some((-175.0 * DEGREE, 35.0 * DEGREE))),
        S::Torso => (75.0 * DEGREE, None),
        S::Head => (100.0 * DEGREE, None),
        S::Pelvis | S::LeftUpperArm | S::RightUpperArm => (f64::INFINITY, None),
    }
}

#[derive(Clone, Copy, Debug, Default)]
struct Of {
    before: Option<(DQuat, Instant)>,
    /// How it turned last and before that, rad/s, and when.
    rates: [Option<(DVec3, Instant)>; 2],
    doubted: Option<Why>,
    clear_s: f64,
    /// Something was wrong since it was asked last, and what was worst for its heading.
    wrong: Option<Why>,
    heading_lost: bool,
    times: u64,
    doubted_s: f64,
}

impl Of {
    /// True once nothing was wrong for long enough. `level`: its sensor is tilted as its orientation has it; `None`: nobody knows.
    fn is_clear(&self, level: Option<bool>) -> bool {
        match (self.heading_lost, level) {
            (false, _) => self.clear_s >= CLEAR_S,
            (true, None | Some(true)) => self.clear_s >= LEVEL_S.0,
            (true, Some(false)) => self.clear_s >= LEVEL_S.1,
        }
    }
}

/// Looks at what all sensors of a body say.
#[derive(Clone, Debug, Default)]
pub struct Doubts {
    of: [Of; 13],
    downs: Downs,
    /// By the lower segment of a knee: how it is usually turned about its own length against the one above, rad.
    usual_rad: [f64; 13],
    /// Since headings were mended, s.
    mended_s: Option<f64>,
    /// Time between two looks, s.
    step_s: f64,
}

impl Doubts {
    /// Takes what a segment's sensor says, in its own world, and when.
    pub fn hear(&mut self, segment: Segment, said: DQuat, taken: Instant, stuck: bool) {
        let of = &mut self.of[segment.index()];
        if stuck {
            of.wrong = Some(Why::Stuck);
            (of.before, of.rates) = (None, [None; 2]);
            return;
        }
        let Some((before, at)) = of.before else {
            of.before = Some((said, taken));
            return;
        };
        let step_s = taken.seconds_since(at);
        if step_s < LEAST_STEP_S {
            return;
        }
        of.before = Some((said, taken));
        if step_s > MOST_STEP_S {
            of.rates = [None; 2];
            return;
        }
        let turn = said * before.inverse();
        let turn = if turn.w < 0.0 { -turn } else { turn };
        let rate_rad_s = turn.normalize().to_scaled_axis() / step_s;
        let is_near = |(_, at): &(DVec3, Instant)| taken.seconds_since(*at) <= JOLT_S;
        let near = of.rates.iter().flatten().filter(|rate| is_near(rate));
        let change_rad_s = near.map(|(rate, _)| (rate_rad_s - rate).length()).fold(0.0, f64::max);
        of.rates = [Some((rate_rad_s, taken)), of.rates[0]];
        let (most_rad_s, most_change_rad_s) = bounds(segment);
        if !(rate_rad_s.length() <= most_rad_s) {
            of.wrong = Some(Why::Turn);
        } else if !(change_rad_s <= most_change_rad_s) {
            of.wrong = Some(Why::Jolt);
        }
    }

    /// Takes what a segment's accelerometer measured on the mean since the moment before, `dt_s` ago, turned into the world, m/s^2;
    /// `None`: nothing.
    pub fn weigh(&mut self, segment: Segment, force: Option<DVec3>, dt_s: f64) {
        self.downs.take(segment, force, dt_s);
    }

    /// The sensor began anew: what it says now has nothing to do with what it said.
    pub fn began_anew(&mut self, segment: Segment) {
        self.downs.forget(segment);
        let of = &mut self.of[segment.index()];
        (of.before, of.rates) = (None, [None; 2]);
    }

    /// Takes where the sensors put the segments that wear one, doubted or not.
    pub fn look(&mut self, pose: &SegmentPose, worn: &[bool; 13]) {
        for segment in Segment::ALL {
            let Some(above) = segment.parent() else { continue };
            if !(worn[segment.index()] && worn[above.index()]) {
                continue;
            }
            let turned =
                pose.orientation[above.index()].inverse() * pose.orientation[segment.index()];
            if self.is_unusual(segment, above, turned) || is_beyond(segment, turned) {
                // Whose heading is lost is found again by how it waits.
                if [segment, above].iter().any(|one| self.of[one.index()].heading_lost) {
                    continue;
                }
                let culprit = culprit(segment, above, pose, worn);
                self.of[culprit.index()].wrong.get_or_insert(Why::Range);
            }
        }
    }

    /// Headings are mended from now on: what was usual is not any more.
    pub fn mended(&mut self) {
        self.mended_s = Some(0.0);
    }

    /// True of a knee that is turned about the shank's length as it was not before.
    fn is_unusual(&mut self, segment: Segment, above: Segment, turned: DQuat) -> bool {
        let is_knee = matches!(segment, Segment::LeftShank | Segment::RightShank);
        if !(is_knee && is_told(turned)) {
            return false;
        }
        let off_rad = wrap_rad(twist_rad(turned) - self.usual_rad[segment.index()]);
        if self.mended_s.is_some() {
            self.usual_rad[segment.index()] += off_rad;
            return false;
        }
        if [segment, above].iter().all(|one| self.of[one.index()].doubted.is_none()) {
            let most_rad = USUAL_RAD_S * self.step_s;
            self.usual_rad[segment.index()] += off_rad.clamp(-most_rad, most_rad);
        }
        !(off_rad.abs() <= MOST_UNUSUAL_RAD)
    }

    /// What that comes to, `dt_s` after it was asked before: who is doubted from now on, and who is not any more.
    pub fn judge(&mut self, dt_s: f64) -> Vec<DoubtChange> {
        let mut changes = Vec::new();
        self.step_s = dt_s;
        self.mended_s = self.mended_s.map(|since_s| since_s + dt_s).filter(|s| *s < MENDED_S);
        let (astray, level) = (self.downs.astray(), self.downs.level());
        for segment in Segment::ALL {
            let of = &mut self.of[segment.index()];
            if astray[segment.index()] {
                of.wrong.get_or_insert(Why::Gravity);
            }
            of.doubted_s += if of.doubted.is_some() { dt_s } else { 0.0 };
            match (of.wrong.take(), of.doubted) {
                (Some(why), doubted) => {
                    of.clear_s = 0.0;
                    of.heading_lost |= why.loses_heading();
                    if doubted.is_none() {
                        of.doubted = Some(why);
                        of.times += 1;
                        let doubted = Some(why);
                        changes.push(DoubtChange { segment, doubted, heading_lost: false });
                    }
                }
                (None, Some(_)) => {
                    of.clear_s += dt_s;
                    if of.is_clear(level[segment.index()]) {
                        of.doubted = None;
                        let heading_lost = std::mem::take(&mut of.heading_lost);
                        changes.push(DoubtChange { segment, doubted: None, heading_lost });
                    }
                }
                (None, None) => {}
            }
        }
        changes
    }

    /// How often a segment was doubted, and for how long, s.
    #[must_use]
    pub const fn tally(&self, segment: Segment) -> (u64, f64) {
        let of = &self.of[segment.index()];
        (of.times, of.doubted_s)
    }
}

/// True if a segment cannot be turned so against the one that carries it.
fn is_beyond(segment: Segment, turned: DQuat) -> bool {
    let (most_twist_rad, bent) = most_turned(segment);
    if is_told(turned) && twist_rad(turned).abs() > most_twist_rad {
        return true;
    }
    // A hinge that is twisted shows no bend that could be judged.
    let Some((least_rad, most_rad)) = bent.filter(|_| turned.x.hypot(turned.z) < 0.4) else {
        return false;
    };
    let bend_rad = wrap_rad(2.0 * turned.y.atan2(turned.w));
    !(least_rad..=most_rad).contains(&bend_rad)
}

/// Near a half turn away from N pose nobody can tell how something is turned about its own length.
fn is_told(turned: DQuat) -> bool {
    turned.z.hypot(turned.w) > 0.4
}

/// How something is turned about its own length.
fn twist_rad(turned: DQuat) -> f64 {
    wrap_rad(2.0 * turned.z.atan2(turned.w))
}

/// Of the two segments of a joint that is turned too far the one that is turned more against its other neighbour.
fn culprit(segment: Segment, above: Segment, pose: &SegmentPose, worn: &[bool; 13]) -> Segment {
    let twisted = |below: Segment| {
        let carrier = below.parent().filter(|of| worn[of.index()] && worn[below.index()]);
        carrier.map_or(0.0, |carrier| {
            let turned =
                pose.orientation[carrier.index()].inverse() * pose.orientation[below.index()];
            twist_rad(turned).abs()
        })
    };
    let below = Segment::ALL.into_iter().filter(|of| of.parent() == Some(segment));
    let below_rad = below.map(twisted).fold(0.0, f64::max);
    if twisted(above) > below_rad { above } else { segment }
}

#[cfg(test)]
mod tests;
