//! Variations of an action (Zheng et al. 2007, Sec. 4): other velocity functions from a database,
//! and perturbed parameters.
//!
//! Angles are perturbed at the seams, which two neighbours share. The two sides of a body that
//! share a waveform stay copies of one another, phases and rates of groups are kept, and so is the
//! first turning point of every cycle: phase differences stay what they were. Durations inside an
//! action change against one another but not their sum; the whole is stretched for all groups
//! alike.

use crate::action::database::Database;
use crate::action::{Action, Ends, Group, Turn};
use crate::actionlet::Shape;
use crate::actionlet::shape::PEAK_AT;
use crate::body::{Dof, Joint};
use crate::error::Error;
use nalgebra::DVector;
use rand::{Rng, RngExt};
use std::ops::Range;

/// Standard deviation of what is drawn evenly from -1 to 1.
const EVENLY: f64 = 0.577_350_269_189_625_8;
/// Standard deviation of the peaks of actionlets of one type, T: they lie all over their range.
const PEAKS_OF_A_TYPE: f64 = 0.15;
/// Neighbours that both move by so much of what lies between them do not pass one another.
const NEARLY_HALF: f64 = 0.45;

impl Action {
    /// The same action with the speed peak of every half sine at one place (as in Fig. 5c of the
    /// paper, T = 0.3 and 0.5).
    ///
    /// # Errors
    /// If the place is not in [`PEAK_AT`].
    pub fn with_peak(mut self, peak_at: f64) -> Result<Self, Error> {
        let shape = Shape::half_sine(peak_at)?;
        for turn in self.waveforms.iter_mut().flatten() {
            if let Shape::HalfSine(_) = turn.shape {
                turn.shape = shape.clone();
            }
        }
        Ok(self)
    }
}

/// How far variations go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// Seam angles move by at most half this part of the smaller angle change beside them, so that
    /// two that approach each other cannot pass: 0 to 0.9.
    pub angle: f64,
    /// Seam times move by at most this part of the shorter duration beside them: 0 to 0.45.
    pub time: f64,
    /// Peaks of half sines move by at most this: 0 to 0.8.
    pub peak: f64,
    /// The whole action gets longer or shorter by at most this part: 0 to 0.9.
    pub duration: f64,
    /// Probability that an actionlet's velocity function is exchanged for one of its type: 0 to 1.
    pub exchange: f64,
    /// How much strides of a cyclic action differ from one another, against how much a person's do:
    /// 0 to 3.
    pub stride: f64,
    /// The body is taller or shorter by at most this part: 0 to 0.3.
    pub stature: f64,
    /// The body faces at most so far away from +X, rad: 0 to half a turn.
    pub heading_rad: f64,
}

impl Default for Spread {
    fn default() -> Self {
        Self {
            angle: 0.1,
            time: 0.05,
            peak: 0.1,
            duration: 0.1,
            exchange: 0.2,
            stride: 1.0,
            stature: 0.0,
            heading_rad: 0.0,
        }
    }
}

impl Spread {
    /// Checks that every figure is in its range.
    ///
    /// # Errors
    /// If one is not.
    pub fn check(&self) -> Result<(), Error> {
        for (key, value, most, unit) in [
            ("angle", self.angle, 0.9, ""),
            ("time", self.time, 0.45, ""),
            ("peak", self.peak, 0.8, ""),
            ("duration", self.duration, 0.9, ""),
            ("exchange", self.exchange, 1.0, ""),
            ("stride", self.stride, 3.0, ""),
            ("stature", self.stature, 0.3, " of it"),
            ("heading_deg", rounded_deg(self.heading_rad), 180.0, " deg"),
        ] {
            if !(0.0..=most).contains(&value) {
                return Err(Error::new("a spread is out of range")
                    .at(format!("vary_{key}"))
                    .got(format!("{value}{unit}"))
                    .allowed(format!("0 to {most}{unit}")));
            }
        }
        Ok(())
    }
}

/// For a person to read: what was said in degrees comes back as it was said.
fn rounded_deg(angle_rad: f64) -> f64 {
    (angle_rad.to_degrees() * 1e9).round() / 1e9
}

/// Strides that differ before they come again.
const STRIDES: usize = 32;
/// Standard deviation of a turning point's angle from stride to stride, rad: of a knee, and of hips, ankles
/// and what was not measured. Of its time, parts of a stride. Measured on 50 strides of five people in
/// Helwig and Hsiao-Wecksler, "Multivariate Gait Data", UCI Machine Learning Repository, 2022: 0.77 to
/// 0.83 deg at the hip, 1.1 to 1.5 at the knee, 0.63 to 1.4 at the ankle; times 0.5 to 1.1 % of a stride.
/// From one stride to the next nothing was found to stay.
const STRIDE_RAD: [f64; 2] = [0.022, 0.014];
const STRIDE_TIME: f64 = 0.007;
/// Correlation of turning points of one knee in one stride, and of the times of one joint, from the same.
const STRIDE_TOGETHER: [f64; 2] = [0.45, 0.34];

/// A variation of an action as it is drawn, whether or not feet hold. The same state of `random` gives
/// the same variation.
#[must_use]
pub fn mutate(
    action: &Action,
    spread: &Spread,
    database: &Database,
    random: &mut impl Rng,
) -> Action {
    let seams = Seams::of(action, spread);
    let drawn = seams.draw(action, database, random);
    seams.with_strides(seams.moved(&drawn.exchanged, &drawn.offsets), &drawn.strides)
}

/// Where something of an action can be moved.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Place {
    /// Its duration.
    Duration,
    /// The angle of neighbouring turning points of a waveform that are equal: a rest between.
    Angle(usize, Range<usize>),
    /// The time of a turning point of a waveform.
    Time(usize, usize),
    /// The peak of the half sine that ends at a turning point of a waveform.
    Peak(usize, usize),
    /// The same of a turning point on the way in or out.
    LeadAngle(Way, usize),
    LeadTime(Way, usize),
    LeadPeak(Way, usize),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Way {
    In,
    Out,
}

/// Something that can be moved, and how far.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Seam {
    place: Place,
    /// It is drawn evenly from minus to plus this ...
    reach: f64,
    /// ... and moved no further than this.
    most: f64,
    /// Standard deviation of what is drawn, exchanges included.
    pub(super) deviation: f64,
    /// Whether it moves a leg.
    pub(super) is_of_leg: bool,
}

/// All that varies of an action.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Seams {
    spread: Spread,
    pub(super) seams: Vec<Seam>,
}

/// What was drawn.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Drawn {
    /// The action with velocity functions from the database.
    pub(super) exchanged: Action,
    /// How far its seams are moved, in their order.
    pub(super) offsets: Vec<f64>,
    /// How far exchanged velocity functions had moved them.
    pub(super) displaced: Vec<f64>,
    /// How much further each stride moves them: none if all are alike.
    pub(super) strides: Vec<Vec<f64>>,
}

impl Seams {
    pub(super) fn of(action: &Action, spread: &Spread) -> Self {
        let mut seams = Self { spread: *spread, seams: Vec::new() };
        seams.push(Place::Duration, spread.duration, 0.9, false);
        for waveform in 0..action.waveforms.len() {
            let dofs: Vec<Dof> =
                action.tracks().filter(|t| t.waveform == waveform).map(|t| t.dof).collect();
            let Some(dof) = dofs.first().copied() else { continue };
            let is_of_leg = dof.is_of_leg();
            seams.push_angles(action, dof, waveform);
            seams.push_times(action, waveform, is_of_leg);
            for (index, turn) in action.waveforms[waveform].iter().enumerate() {
                seams.push_peak(Place::Peak(waveform, index), &turn.shape, is_of_leg);
            }
        }
        if let Some(ends) = &action.cyclic {
            seams.push_leads(action, ends, Way::In);
            seams.push_leads(action, ends, Way::Out);
        }
        seams
    }

    fn push(&mut self, place: Place, reach: f64, most: f64, is_of_leg: bool) {
        self.push_as_wide(place, reach, most, reach * EVENLY, is_of_leg);
    }

    fn push_as_wide(
        &mut self,
        place: Place,
        reach: f64,
        most: f64,
        deviation: f64,
        is_of_leg: bool,
    ) {
        if deviation > 0.0 && most > 0.0 {
            self.seams.push(Seam { place, reach, most: most.max(reach), deviation, is_of_leg });
        }
    }

    /// Angles of turning points, but where an action that is done once starts and ends.
    fn push_angles(&mut self, action: &Action, dof: Dof, waveform: usize) {
        let closed = action.cyclic.is_some();
        let given: Vec<f64> =
            action.waveforms[waveform].iter().map(|turn| turn.angle_rad).collect();
        let count = given.len();
        let mut index = 0;
        while index < count {
            let mut end = index;
            while end + 1 < count && given[end + 1] == given[index] {
                end += 1;
            }
            let before = match index.checked_sub(1) {
                Some(before) => given[before],
                None if closed => given[count - 1],
                None => action.pose[dof],
            };
            let after =
                if end + 1 < count { Some(given[end + 1]) } else { closed.then(|| given[0]) };
            if let Some(after) = after {
                let smaller = (given[index] - before).abs().min((after - given[index]).abs());
                self.push_angle(Place::Angle(waveform, index..end + 1), smaller, dof.is_of_leg());
            }
            index = end + 1;
        }
    }

    /// Two neighbours may approach each other: half the change is the most for each.
    fn push_angle(&mut self, place: Place, smaller: f64, is_of_leg: bool) {
        self.push(place, self.spread.angle * smaller / 2.0, NEARLY_HALF * smaller, is_of_leg);
    }

    /// Times of turning points but the first of a cycle and the last of an action that is done once.
    fn push_times(&mut self, action: &Action, waveform: usize, is_of_leg: bool) {
        let closed = action.cyclic.is_some();
        let given: Vec<f64> = action.waveforms[waveform].iter().map(|turn| turn.at).collect();
        let count = given.len();
        for index in 0..count {
            let before = if index == 0 { 0.0 } else { given[index - 1] };
            let after = if index + 1 < count { given[index + 1] } else { given[0] + 1.0 };
            let fixed = if closed { index == 0 } else { index + 1 == count };
            if !fixed {
                let shorter = (given[index] - before).min(after - given[index]);
                self.push_time(Place::Time(waveform, index), shorter, is_of_leg);
            }
        }
    }

    fn push_time(&mut self, place: Place, shorter: f64, is_of_leg: bool) {
        self.push(place, self.spread.time * shorter, NEARLY_HALF * shorter, is_of_leg);
    }

    fn push_peak(&mut self, place: Place, shape: &Shape, is_of_leg: bool) {
        if let Shape::HalfSine(_) = shape {
            let drawn = self.spread.peak * EVENLY;
            let exchanged = self.spread.exchange.sqrt() * PEAKS_OF_A_TYPE;
            self.push_as_wide(place, self.spread.peak, 1.0, drawn.hypot(exchanged), is_of_leg);
        }
    }

    /// Turning points on the way in, from the pose, or out, back to it.
    fn push_leads(&mut self, action: &Action, ends: &Ends, way: Way) {
        let turns = way.turns(ends);
        for (index, (dof, turn)) in turns.iter().enumerate() {
            let own = |other: &&(Dof, Turn)| other.0 == *dof;
            let before = turns[..index].iter().rfind(own).map(|(_, turn)| turn);
            let after = turns[index + 1..].iter().find(own).map(|(_, turn)| turn);
            let (from, to) = match way {
                Way::In => ((0.0, Some(action.pose[*dof])), (ends.after, None)),
                Way::Out => ((-ends.before, None), (0.0, Some(action.pose[*dof]))),
            };
            // The last one on the way out is the pose.
            if way == Way::Out && after.is_none() && turn.at >= 0.0 {
                self.push_peak(Place::LeadPeak(way, index), &turn.shape, dof.is_of_leg());
                continue;
            }
            let of = |other: Option<&Turn>, end: (f64, Option<f64>)| {
                other.map_or(end, |turn| (turn.at, Some(turn.angle_rad)))
            };
            let (before, after) = (of(before, from), of(after, to));
            let changes = [before.1, after.1].into_iter().flatten();
            let smaller =
                changes.map(|angle| (turn.angle_rad - angle).abs()).reduce(f64::min).unwrap_or(0.0);
            let shorter = (turn.at - before.0).min(after.0 - turn.at);
            self.push_angle(Place::LeadAngle(way, index), smaller, dof.is_of_leg());
            self.push_time(Place::LeadTime(way, index), shorter, dof.is_of_leg());
            self.push_peak(Place::LeadPeak(way, index), &turn.shape, dof.is_of_leg());
        }
    }

    /// Offsets of the seams as parts of their standard deviations.
    pub(super) fn in_deviations(&self, offsets: &[f64]) -> DVector<f64> {
        let parts = offsets.iter().zip(&self.seams).map(|(offset, seam)| offset / seam.deviation);
        DVector::from_iterator(offsets.len(), parts)
    }

    pub(super) fn draw(
        &self,
        action: &Action,
        database: &Database,
        random: &mut impl Rng,
    ) -> Drawn {
        let mut exchanged = action.clone();
        for waveform in 0..action.waveforms.len() {
            let track = action.tracks().find(|track| track.waveform == waveform);
            let Some(dof) = track.map(|track| track.dof) else { continue };
            let turns = &mut exchanged.waveforms[waveform];
            exchange(action, dof, turns, &self.spread, database, random);
        }
        let offsets = self.seams.iter().map(|seam| around_zero(random, seam.reach)).collect();
        let displaced = self.seams.iter().map(|seam| match seam.place {
            Place::Peak(waveform, index) => {
                let [now, given] =
                    [&exchanged, action].map(|of| &of.waveforms[waveform][index].shape);
                match (now, given) {
                    (Shape::HalfSine(now), Shape::HalfSine(given)) => now.value() - given.value(),
                    _ => 0.0,
                }
            }
            _ => 0.0,
        });
        let displaced = displaced.collect();
        let strides = self.draw_strides(action, random);
        Drawn { exchanged, offsets, displaced, strides }
    }

    /// How strides differ.
    fn draw_strides(&self, action: &Action, random: &mut impl Rng) -> Vec<Vec<f64>> {
        if action.cyclic.is_none() || !(self.spread.stride > 0.0) {
            return Vec::new();
        }
        let mut stride = || {
            let mut shared = vec![[None; 2]; action.waveforms.len()];
            let offset = |seam: &Seam| {
                let (waveform, kind) = match seam.place {
                    Place::Angle(waveform, _) => (waveform, 0),
                    Place::Time(waveform, _) => (waveform, 1),
                    _ => return 0.0,
                };
                let track = action.tracks().find(|track| track.waveform == waveform);
                let is_knee = track.is_some_and(|track| {
                    [Joint::LeftKnee, Joint::RightKnee].contains(&track.dof.joint())
                });
                let (deviation, together) = match (kind, is_knee) {
                    (0, true) => (STRIDE_RAD[0], STRIDE_TOGETHER[0]),
                    (0, false) => (STRIDE_RAD[1], 0.0),
                    _ => (STRIDE_TIME, STRIDE_TOGETHER[1]),
                };
                let evenly = 1.0 / EVENLY;
                let shared: &mut Option<f64> = &mut shared[waveform][kind];
                let shared = *shared.get_or_insert_with(|| around_zero(random, evenly));
                let own = around_zero(random, evenly);
                let drawn = together.sqrt() * shared + (1.0 - together).sqrt() * own;
                drawn * (self.spread.stride * deviation).min(seam.most / 4.0)
            };
            self.seams.iter().map(offset).collect()
        };
        (0..STRIDES).map(|_| stride()).collect()
    }

    /// The action with strides that differ so much.
    pub(super) fn with_strides(&self, mut action: Action, strides: &[Vec<f64>]) -> Action {
        let strides = strides.iter().map(|offsets| self.moved(&action, offsets).waveforms);
        action.strides = strides.collect();
        action
    }

    /// The action with its seams moved, inside anatomical ranges and never further out of them than they
    /// are (captured ones may be). None moves over the instants at which a cycle is joined and left: the
    /// first and last rounds of all variations are made of the same actionlets.
    pub(super) fn moved(&self, action: &Action, offsets: &[f64]) -> Action {
        let mut varied = action.clone();
        for (seam, offset) in self.seams.iter().zip(offsets) {
            let offset = offset.clamp(-seam.most, seam.most);
            match &seam.place {
                Place::Duration => varied.duration_s *= 1.0 + offset,
                Place::Angle(waveform, turns) => {
                    let Some(track) = action.tracks().find(|t| t.waveform == *waveform) else {
                        continue;
                    };
                    for turn in &mut varied.waveforms[*waveform][turns.clone()] {
                        move_angle(turn, track.dof, offset);
                    }
                }
                Place::Time(waveform, index) => {
                    let at = action.waveforms[*waveform][*index].at;
                    let rounds = |at: f64| rounds_played(action, *waveform, at);
                    if rounds(at + offset) == rounds(at) {
                        varied.waveforms[*waveform][*index].at = at + offset;
                    }
                }
                Place::Peak(waveform, index) => {
                    move_peak(&mut varied.waveforms[*waveform][*index].shape, offset);
                }
                Place::LeadAngle(way, index) => {
                    if let Some((dof, turn)) = way.turn(&mut varied, *index) {
                        move_angle(turn, *dof, offset);
                    }
                }
                Place::LeadTime(way, index) => {
                    if let Some((_, turn)) = way.turn(&mut varied, *index) {
                        turn.at += offset;
                    }
                }
                Place::LeadPeak(way, index) => {
                    if let Some((_, turn)) = way.turn(&mut varied, *index) {
                        move_peak(&mut turn.shape, offset);
                    }
                }
            }
        }
        varied
    }
}

impl Way {
    fn turns(self, ends: &Ends) -> &[(Dof, Turn)] {
        match self {
            Self::In => &ends.lead_in,
            Self::Out => &ends.lead_out,
        }
    }

    fn turn(self, action: &mut Action, index: usize) -> Option<&mut (Dof, Turn)> {
        let ends = action.cyclic.as_mut()?;
        match self {
            Self::In => ends.lead_in.get_mut(index),
            Self::Out => ends.lead_out.get_mut(index),
        }
    }
}

fn move_angle(turn: &mut Turn, dof: Dof, offset_rad: f64) {
    let (lower, upper) = dof.range_rad();
    let moved = turn.angle_rad + offset_rad;
    turn.angle_rad = moved.clamp(lower.min(turn.angle_rad), upper.max(turn.angle_rad));
}

fn move_peak(shape: &mut Shape, offset: f64) {
    if let Shape::HalfSine(peak_at) = shape {
        let moved = (peak_at.value() + offset).clamp(*PEAK_AT.start(), *PEAK_AT.end());
        *shape = Shape::half_sine(moved).unwrap_or_default();
    }
}

/// Evenly distributed between minus and plus `most`.
pub(super) fn around_zero(random: &mut impl Rng, most: f64) -> f64 {
    if most > 0.0 { random.random_range(-most..=most) } else { 0.0 }
}

/// The angle an actionlet starts from.
fn from_rad(action: &Action, dof: Dof, turns: &[Turn], index: usize) -> f64 {
    match (index.checked_sub(1), &action.cyclic) {
        (Some(before), _) => turns[before].angle_rad,
        (None, None) => action.pose[dof],
        (None, Some(_)) => turns[turns.len() - 1].angle_rad,
    }
}

fn exchange(
    action: &Action,
    dof: Dof,
    turns: &mut [Turn],
    spread: &Spread,
    database: &Database,
    random: &mut impl Rng,
) {
    if !(spread.exchange > 0.0) {
        return;
    }
    for index in 0..turns.len() {
        let change_rad = turns[index].angle_rad - from_rad(action, dof, turns, index);
        let alike =
            database.type_of(dof, change_rad).map_or(&[][..], |kind| database.of_type(kind));
        if alike.is_empty() || !random.random_bool(spread.exchange) {
            continue;
        }
        let pick = random.random_range(0..alike.len());
        turns[index].shape = alike[pick].shape.clone();
    }
}

/// The first round of a cycle in which a turning point is played and the last, for every group that
/// plays it (Eq. 7, as `Action::perform_rounds` solves it).
fn rounds_played(action: &Action, waveform: usize, at: f64) -> Vec<[f64; 2]> {
    let Some(ends) = &action.cyclic else { return Vec::new() };
    let plays = |group: &&Group| group.tracks.iter().any(|track| track.waveform == waveform);
    let rounds = |group: &Group| {
        let rate = f64::from(group.rate.0) / f64::from(group.rate.1);
        let round = |time: f64| rate * (time + ends.phase) + group.phase - at;
        let left = f64::from(action.rounds) - ends.before;
        [round(ends.after).ceil(), round(left).floor()]
    };
    action.groups.iter().filter(plays).map(rounds).collect()
}
