//! A limb whose sensors are lost while the rest of the body is followed: it goes to rest on what carries it, and is followed
//! again only when all its sensors speak, their headings were mended since, and somebody agrees.

use crate::body::Segment;

/// A sensor that has said nothing for so long is lost, s.
pub const LOST_AFTER_S: f64 = 1.0;

/// An arm, a leg, or the head.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WornLimb {
    /// Upper arm and forearm.
    LeftArm,
    /// Upper arm and forearm.
    RightArm,
    /// The head.
    Head,
    /// Thigh, shank and foot.
    LeftLeg,
    /// Thigh, shank and foot.
    RightLeg,
}

impl WornLimb {
    /// All of them.
    pub const ALL: [Self; 5] =
        [Self::LeftArm, Self::RightArm, Self::Head, Self::LeftLeg, Self::RightLeg];

    /// The limb that a segment belongs to; none of the trunk does.
    #[must_use]
    pub const fn of(segment: Segment) -> Option<Self> {
        use Segment as S;
        match segment {
            S::Pelvis | S::Torso => None,
            S::Head => Some(Self::Head),
            S::LeftUpperArm | S::LeftForearm => Some(Self::LeftArm),
            S::RightUpperArm | S::RightForearm => Some(Self::RightArm),
            S::LeftThigh | S::LeftShank | S::LeftFoot => Some(Self::LeftLeg),
            S::RightThigh | S::RightShank | S::RightFoot => Some(Self::RightLeg),
        }
    }

    /// Its segments.
    pub fn segments(self) -> impl Iterator<Item = Segment> {
        Segment::ALL.into_iter().filter(move |segment| Self::of(*segment) == Some(self))
    }

    /// True of what a body stands on.
    #[must_use]
    pub const fn is_leg(self) -> bool {
        matches!(self, Self::LeftLeg | Self::RightLeg)
    }

    /// What it is called.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Self::LeftArm => "left arm",
            Self::RightArm => "right arm",
            Self::Head => "head",
            Self::LeftLeg => "left leg",
            Self::RightLeg => "right leg",
        }
    }

    const fn index(self) -> usize {
        self as usize
    }
}

/// How the sensor of a segment is heard at a moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Hearing {
    /// It is not there.
    Gone,
    /// It has said nothing that could be used for so long, s.
    Silent(f64),
    /// It speaks.
    Speaks,
}

impl Hearing {
    fn is_lost(self) -> bool {
        match self {
            Self::Gone => true,
            Self::Silent(silent_s) => !(silent_s <= LOST_AFTER_S),
            Self::Speaks => false,
        }
    }
}

/// What becomes of a limb.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LimbChange {
    /// It goes to rest, for the sensor of this segment is lost.
    Rests(Segment),
    /// All its sensors speak again.
    Speaks,
    /// Their headings were mended: whoever is asked may agree.
    Mended,
    /// It is followed again.
    Followed,
    /// Somebody agreed who was not to be asked yet: a sensor does not speak.
    StillLost,
    /// Somebody agreed who was not to be asked yet: no heading was mended.
    NotMended,
}

#[derive(Clone, Copy, Debug, Default)]
struct Of {
    rests: bool,
    speaks: bool,
    mended: bool,
}

/// The limbs of a body that may go to rest by themselves.
#[derive(Clone, Debug)]
pub struct WornLimbs {
    may_rest: [bool; 5],
    of: [Of; 5],
    lost: [bool; 13],
    times: [u64; 13],
    lost_s: [f64; 13],
}

impl WornLimbs {
    /// WornLimbs that `may_rest`; of the others nothing is judged.
    pub fn new(may_rest: impl Fn(WornLimb) -> bool) -> Self {
        Self {
            may_rest: WornLimb::ALL.map(may_rest),
            of: [Of::default(); 5],
            lost: [false; 13],
            times: [0; 13],
            lost_s: [0.0; 13],
        }
    }

    /// By [`Segment::index`]: segments of limbs that may go to rest by themselves.
    #[must_use]
    pub fn may_rest(&self) -> [bool; 13] {
        Segment::ALL
            .map(|segment| WornLimb::of(segment).is_some_and(|limb| self.may_rest[limb.index()]))
    }

    /// True of a segment whose limb rests.
    #[must_use]
    pub fn rests(&self, segment: Segment) -> bool {
        WornLimb::of(segment).is_some_and(|limb| self.of[limb.index()].rests)
    }

    /// True while a limb rests.
    #[must_use]
    pub const fn is_resting(&self, limb: WornLimb) -> bool {
        self.of[limb.index()].rests
    }

    /// True while any limb rests.
    #[must_use]
    pub fn any_rests(&self) -> bool {
        self.of.iter().any(|of| of.rests)
    }

    /// The sensor of a segment began anew: its heading is a guess, whatever was mended before.
    pub fn began_anew(&mut self, segment: Segment) {
        if let Some(limb) = WornLimb::of(segment) {
            self.of[limb.index()].mended = false;
        }
    }

    /// Takes how all worn sensors are heard, `dt_s` after it was asked before, whether headings were mended just now, and
    /// whether somebody agrees to what rests being followed again.
    pub fn judge(
        &mut self,
        heard: &[(Segment, Hearing)],
        mends: bool,
        agrees: bool,
        dt_s: f64,
    ) -> Vec<(WornLimb, LimbChange)> {
        let mut changes = Vec::new();
        for limb in WornLimb::ALL.into_iter().filter(|limb| self.may_rest[limb.index()]) {
            let mut own = heard.iter().filter(|(at, _)| WornLimb::of(*at) == Some(limb)).peekable();
            if own.peek().is_none() {
                continue;
            }
            let (mut missing, mut all_speak) = (None, true);
            for (segment, hearing) in own {
                let at = segment.index();
                let is_lost = hearing.is_lost();
                // One that is there again and says nothing yet is lost as before, and not once more.
                let was_lost = self.lost[at] && *hearing != Hearing::Speaks;
                self.times[at] += u64::from(is_lost && !self.lost[at]);
                self.lost[at] = is_lost || was_lost;
                self.lost_s[at] += if self.lost[at] { dt_s } else { 0.0 };
                all_speak &= *hearing == Hearing::Speaks;
                missing = missing.or(Some(*segment).filter(|_| is_lost));
            }
            let of = &mut self.of[limb.index()];
            let mut tell = |change| changes.push((limb, change));
            if let Some(segment) = missing {
                (of.speaks, of.mended) = (false, false);
                if !of.rests {
                    of.rests = true;
                    tell(LimbChange::Rests(segment));
                }
            }
            if !of.rests {
                continue;
            }
            if all_speak && !of.speaks {
                of.speaks = true;
                tell(LimbChange::Speaks);
            }
            if mends && all_speak {
                of.mended = true;
                tell(LimbChange::Mended);
            }
            if !agrees {
                continue;
            }
            match (all_speak, of.mended) {
                (false, _) => tell(LimbChange::StillLost),
                (true, false) => tell(LimbChange::NotMended),
                (true, true) => {
                    *of = Of::default();
                    tell(LimbChange::Followed);
                }
            }
        }
        changes
    }

    /// How often the sensor of a segment was lost, and for how long, s.
    #[must_use]
    pub const fn tally(&self, segment: Segment) -> (u64, f64) {
        (self.times[segment.index()], self.lost_s[segment.index()])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::worn::{Calibration, HeadingBy, Mount, Wearing};
    use Hearing::{Gone, Silent, Speaks};
    use Segment::{Head, LeftForearm, LeftThigh, LeftUpperArm, Pelvis};
    use glam::DQuat;

    fn limbs() -> WornLimbs {
        WornLimbs::new(|limb| !limb.is_leg())
    }

    /// What becomes of the left arm whose forearm is heard so.
    fn arm(limbs: &mut WornLimbs, forearm: Hearing, mends: bool, agrees: bool) -> Vec<LimbChange> {
        let heard =
            [(Pelvis, Speaks), (Head, Speaks), (LeftUpperArm, Speaks), (LeftForearm, forearm)];
        let found = limbs.judge(&heard, mends, agrees, 0.5);
        assert!(found.iter().all(|(limb, _)| *limb == WornLimb::LeftArm), "{found:?}");
        found.into_iter().map(|(_, change)| change).collect()
    }

    #[test]
    fn an_arm_rests_until_its_sensors_speak_were_mended_and_somebody_agrees_in_this_order() {
        let mut limbs = limbs();
        assert_eq!(arm(&mut limbs, Speaks, false, true), []);
        assert_eq!(arm(&mut limbs, Gone, false, false), [LimbChange::Rests(LeftForearm)]);
        assert!(limbs.rests(LeftUpperArm) && limbs.rests(LeftForearm) && !limbs.rests(Head));
        assert_eq!(arm(&mut limbs, Gone, true, true), [LimbChange::StillLost]);
        assert_eq!(arm(&mut limbs, Speaks, false, false), [LimbChange::Speaks]);
        assert_eq!(arm(&mut limbs, Speaks, false, true), [LimbChange::NotMended]);
        assert_eq!(arm(&mut limbs, Speaks, true, false), [LimbChange::Mended]);
        assert_eq!(arm(&mut limbs, Speaks, false, true), [LimbChange::Followed]);
        assert!(!limbs.any_rests());
        assert_eq!(limbs.tally(LeftForearm), (1, 1.0));
        assert_eq!(limbs.tally(LeftUpperArm), (0, 0.0));
    }

    #[test]
    fn what_was_mended_before_a_sensor_was_lost_again_or_began_anew_counts_no_more() {
        let mut limbs = limbs();
        for again in [true, false] {
            assert_eq!(arm(&mut limbs, Gone, false, false), [LimbChange::Rests(LeftForearm)]);
            assert_eq!(
                arm(&mut limbs, Speaks, true, false),
                [LimbChange::Speaks, LimbChange::Mended]
            );
            if again {
                assert_eq!(arm(&mut limbs, Gone, false, false), []);
                assert_eq!(arm(&mut limbs, Speaks, false, false), [LimbChange::Speaks]);
            } else {
                limbs.began_anew(LeftForearm);
            }
            assert_eq!(arm(&mut limbs, Speaks, false, true), [LimbChange::NotMended]);
            assert_eq!(
                arm(&mut limbs, Speaks, true, true),
                [LimbChange::Mended, LimbChange::Followed]
            );
        }
        assert_eq!(limbs.tally(LeftForearm).0, 3);
    }

    #[test]
    fn a_short_silence_is_no_loss_but_nobody_is_followed_out_of_it() {
        let mut limbs = limbs();
        assert_eq!(arm(&mut limbs, Silent(LOST_AFTER_S), false, false), []);
        assert_eq!(arm(&mut limbs, Silent(1.01), false, false), [LimbChange::Rests(LeftForearm)]);
        arm(&mut limbs, Speaks, true, false);
        assert_eq!(arm(&mut limbs, Silent(0.3), false, true), [LimbChange::StillLost]);
        assert_eq!(arm(&mut limbs, Speaks, false, true), [LimbChange::Followed]);
    }

    /// A body on which every segment is worn, with sensors along the segments.
    fn wearing() -> Wearing {
        let mount = |segment| Mount {
            segment,
            heading_rad: 0.0,
            sensor_from_segment: DQuat::IDENTITY,
            heading_by: HeadingBy::Strapping,
            consistency: None,
            strapped_off_rad: None,
        };
        let mounts = Segment::ALL.map(mount).to_vec();
        Wearing::new(&Calibration { mounts, notes: Vec::new() })
    }

    #[test]
    fn a_limb_goes_to_rest_on_what_carries_it_without_a_jump_and_comes_back_so() {
        let mut wearing = wearing();
        let raised = DQuat::from_rotation_y(-1.2);
        let mut before: Option<DQuat> = None;
        let mut fastest = 0.0_f64;
        for n in 0..800_u32 {
            // The body turns on the spot, the left arm is raised, and both arms' sensors are right all the while.
            let facing = DQuat::from_rotation_z(0.01 * f64::from(n));
            let mut said = [Some(facing); 13];
            for segment in WornLimb::LeftArm.segments().chain(WornLimb::RightArm.segments()) {
                said[segment.index()] = Some(facing * raised);
            }
            match n {
                100 => wearing.rest(WornLimb::LeftArm),
                500 => wearing.take_up(WornLimb::LeftArm),
                _ => {}
            }
            let pose = wearing.pose(&said, 0.01).pose;
            let on_trunk = |segment: Segment| {
                pose.orientation[Segment::Torso.index()].inverse()
                    * pose.orientation[segment.index()]
            };
            let arm = on_trunk(LeftUpperArm);
            assert!(on_trunk(Segment::RightUpperArm).angle_between(raised) < 1e-6);
            fastest = fastest.max(before.map_or(0.0, |before| before.angle_between(arm)) / 0.01);
            before = Some(arm);
            let wanted = match n {
                ..100 | 651.. => raised,
                251..500 => DQuat::IDENTITY,
                _ => continue,
            };
            assert!(arm.angle_between(wanted) < 1e-6, "{n}");
            assert_eq!(wearing.is_on_its_way(WornLimb::LeftArm), (251..500).contains(&n), "{n}");
        }
        // Of an even motion the peak of this one is half as fast again.
        assert!(fastest < 1.5 * 1.2 / 1.5 + 0.05, "{fastest}");
    }

    #[test]
    fn the_heading_of_what_rests_is_mended_at_once_and_of_what_is_followed_slowly() {
        let mut wearing = wearing();
        let mut said = [Some(DQuat::IDENTITY); 13];
        wearing.pose(&said, 0.01);
        wearing.rest(WornLimb::LeftArm);
        for segment in WornLimb::LeftArm.segments().chain(WornLimb::RightArm.segments()) {
            said[segment.index()] = Some(DQuat::from_rotation_z(2.0));
        }
        wearing.pose(&said, 0.01);
        wearing.reset_heading();
        wearing.pose(&said, 0.01);
        let off_rad = |segment: Segment| {
            wearing.as_said().orientation[segment.index()].angle_between(DQuat::IDENTITY)
        };
        assert!(off_rad(LeftForearm) < 1e-6);
        assert!(off_rad(Segment::RightForearm) > 1.9);
    }

    #[test]
    fn a_sensor_that_is_back_and_says_nothing_yet_is_lost_as_before_and_not_once_more() {
        let mut limbs = limbs();
        for hearing in [Gone, Silent(0.3), Silent(1.5), Speaks, Silent(0.3), Speaks] {
            limbs.judge(&[(LeftForearm, hearing)], false, false, 0.5);
        }
        assert_eq!(limbs.tally(LeftForearm), (1, 1.5));
        limbs.judge(&[(LeftForearm, Silent(2.0))], false, false, 0.5);
        assert_eq!(limbs.tally(LeftForearm), (2, 2.0));
    }

    #[test]
    fn what_may_not_rest_is_nobodys_business_here() {
        let mut limbs = limbs();
        assert_eq!(limbs.judge(&[(Pelvis, Gone), (LeftThigh, Gone)], true, true, 0.1), []);
        assert!(!limbs.any_rests());
        assert_eq!(limbs.may_rest().iter().filter(|may| **may).count(), 5);
    }
}
