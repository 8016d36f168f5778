//! Variations whose feet hold: where soles of an action stand, those of its variations stand too.
//!
//! Seams of legs are not free of one another: a knee that bends more asks for a hip and an ankle that make
//! up for it, or the foot slides or sinks. How soles and root answer to each seam is found once, by moving
//! each a little ([`Foothold::of`]). What is drawn is then moved, as little as the spread of each seam
//! allows, to where soles that carry stay where they stand: the most probable draw, given that they do
//! (linear regression with that prior; where it is not enough, the same step is taken again from what the
//! soles then do). Every degree of freedom stays a chain of actionlets all the while.

use glam::DVec3;
use nalgebra::{Cholesky, DMatrix, DVector};
use rand::Rng;
use std::ops::Range;

use crate::action::feet::{Feet, FootingBounds};
use crate::action::mutate::{Drawn, Seams};
use crate::action::phrase::{Item, Part};
use crate::action::{Action, Database, Motion, Spread};
use crate::body::Proportions;
use crate::body::contact::ON_FLOOR_M;
use crate::error::Error;

/// Soles and root are looked at about so often to tell how they answer to seams.
const LOOKS_HZ: f64 = 125.0;
/// ... and so often to tell how they answer to seams of one stride: every variation has many.
const STRIDE_LOOKS_HZ: f64 = 60.0;
/// Rounds of a cyclic action that are looked at: one led in, one between others, one led out.
const ROUNDS: u32 = 3;
/// The same where strides are looked at.
const STRIDE_ROUNDS: u32 = 2;
/// A seam is moved by this part of its standard deviation to tell how soles answer.
const NUDGE: f64 = 0.2;
/// Soles that carry are held as well as this, m ...
const HOLDS_M: f64 = 0.000_3;
/// ... soles of one stride that differs from those beside it as well as this ...
const STRIDE_HOLDS_M: f64 = 0.000_3;
/// ... and the root's acceleration, m/s^2 ...
const ROOT_HOLDS_M_S2: f64 = 4.0;
/// ... on the average over this time, s.
const HOLDS_FOR_S: f64 = 0.05;
/// A sole that swings lower than this keeps clear of the floor ...
const LOW_M: f64 = 0.02;
/// ... as high as that of the action, or at least so high, m.
const CLEAR_M: f64 = 0.009;
/// Feet that come back are held there as well as this, m.
const AWAY_M: f64 = 0.001;
/// Of what soles of the action slide so much is left to those of variations.
const SLIDES_LEFT: f64 = 0.5;
/// A contact that slides by more counts so many times as much in the next repair, m.
const NEARLY_SLIDES_M: f64 = 0.004;
const MATTERS_MORE: f64 = 1.5;
/// A draw is moved so often by what its feet do before it is looked at.
const SETTLES: usize = 3;
/// ... each time by all of what would still them, or by half of it and so on: so often.
const HALVINGS: usize = 4;
/// A draw whose feet do not come back is moved so often by how its own soles answer, as each move tells.
const LEARNS: usize = 40;
/// Legs are drawn further to make up for what feet that hold take away, at most so many times.
const MOST_FURTHER: f64 = 1.25;
/// More seams of legs are not looked at: a capture's many actionlets are varied as they are drawn.
const MOST_SEAMS: usize = 400;

/// The body of an action that is looked at, at instants that are the same parts of its duration however
/// long it lasts.
#[derive(Clone, Debug)]
struct Look {
    item: Item,
    rounds: u32,
    looks: usize,
    rate_hz: f64,
    /// What soles and root do that do what they are to.
    feet: Feet,
    contacts: Vec<(usize, Range<usize>)>,
    /// Soles that are low but not on the floor, and when.
    swinging: Vec<(usize, usize)>,
}

impl Look {
    fn at(part: &Part, body: &Proportions, rounds: u32, looks_hz: f64) -> Result<Self, Error> {
        let motion = performed(&part.item, &part.action, rounds)?;
        let looks = (motion.duration_s() * looks_hz).ceil();
        let rate_hz = looks / motion.duration_s();
        let feet = Feet::of(body, &motion.poses(body, rate_hz)?);
        let contacts = feet.contacts();
        let swings_low = |sole: usize, look: usize| {
            (ON_FLOOR_M..LOW_M).contains(&feet.soles_m[look][sole].z).then_some((sole, look))
        };
        let all = 0..feet.soles_m.len();
        let swinging =
            (0..4).flat_map(|sole| all.clone().filter_map(move |look| swings_low(sole, look)));
        let swinging = swinging.collect();
        let (item, looks) = (part.item.clone(), looks as usize);
        Ok(Self { item, rounds, looks, rate_hz, feet, contacts, swinging })
    }

    /// Makes contacts matter more that slide too far, by row of [`Self::feet_off`].
    fn weigh(&self, feet: &Feet, weights: &mut DVector<f64>) {
        let last = feet.soles_m.len() - 1;
        let mut row = 0;
        for (sole, range) in &self.contacts {
            let place_m = |look: usize| feet.soles_m[look.min(last)][*sole];
            let first_m = place_m(range.start);
            let (least_m, most_m) = range.clone().fold((first_m, first_m), |extent, look| {
                (extent.0.min(place_m(look)), extent.1.max(place_m(look)))
            });
            let rows = row..row + 3 * range.len();
            if (most_m - least_m).truncate().length() > NEARLY_SLIDES_M {
                weights.as_mut_slice()[rows.clone()]
                    .iter_mut()
                    .for_each(|one| *one *= MATTERS_MORE);
            }
            row = rows.end;
        }
    }

    /// The body at these instants.
    fn feet(&self, action: &Action, body: &Proportions) -> Result<Feet, Error> {
        let motion = performed(&self.item, action, self.rounds)?;
        let rate_hz = self.looks as f64 / motion.duration_s();
        Ok(Feet::of(body, &motion.poses(body, rate_hz)?))
    }

    /// The part that a look has in what is allowed.
    fn part(&self) -> f64 {
        (1.0 / (self.rate_hz * HOLDS_FOR_S)).sqrt()
    }

    /// How far soles that carry leave where others have them under the root: two feet that stand at once hold one
    /// another only if each stands where it does in the others, whatever the other's stride is like.
    fn under_root_off(&self, feet: &Feet, others: &Feet) -> DVector<f64> {
        let scale = self.part() / STRIDE_HOLDS_M;
        let under = |feet: &Feet, look: usize, sole: usize| {
            let look = look.min(feet.roots_m.len() - 1);
            feet.soles_m[look][sole] - feet.roots_m[look]
        };
        let looks =
            self.contacts.iter().flat_map(|(sole, range)| range.clone().map(|look| (look, *sole)));
        let off = looks.flat_map(|(look, sole)| {
            ((under(feet, look, sole) - under(others, look, sole)) * scale).to_array()
        });
        DVector::from_iterator(
            3 * self.contacts.iter().map(|(_, range)| range.len()).sum::<usize>(),
            off,
        )
    }

    /// How far soles that carry leave where they stand, those that swing come down, and how the root is
    /// accelerated otherwise, each as a part of what is allowed to them: nearly zero for the action itself.
    fn feet_off(&self, feet: &Feet) -> DVector<f64> {
        let part = self.part();
        let mut off = Vec::new();
        for (sole, range) in &self.contacts {
            let last = feet.soles_m.len() - 1;
            let now_m = |look: usize| feet.soles_m[look.min(last)][*sole];
            let then_m = |look: usize| self.feet.soles_m[look][*sole];
            let left_m = |look: usize| now_m(look) - then_m(look) * SLIDES_LEFT;
            let mean_m = range.clone().map(left_m).sum::<DVec3>() / range.len() as f64;
            for look in range.clone() {
                let slid_m = (left_m(look) - mean_m).with_z(now_m(look).z - then_m(look).z);
                off.extend((slid_m * (part / HOLDS_M)).to_array());
            }
        }
        // A sole that swings low over the floor keeps clear of it.
        for (sole, look) in &self.swinging {
            let height_m = self.feet.soles_m[*look][*sole].z.min(CLEAR_M);
            let now = &feet.soles_m[(*look).min(feet.soles_m.len() - 1)];
            off.push((now[*sole].z - height_m).min(0.0) * part / HOLDS_M);
        }
        if self.feet.come_back() {
            off.extend(((feet.away_m() - self.feet.away_m()) / AWAY_M).to_array());
        }
        // As if both lasted equally long: who is twice as fast has four times the acceleration.
        let scale = self.rate_hz * self.rate_hz * part / ROOT_HOLDS_M_S2;
        let mut bends_m = feet.bends_m();
        for own_m in self.feet.bends_m() {
            let bend_m = bends_m.next().unwrap_or(own_m);
            off.extend(((bend_m - own_m) * scale).to_array());
        }
        DVector::from_vec(off)
    }
}

/// From what soles do to how far seams are moved back, of how soles answer to seams; both in parts of what is
/// usual.
fn moving_back(answers: &DMatrix<f64>) -> DMatrix<f64> {
    let turned = answers.transpose();
    let normal = DMatrix::identity(answers.ncols(), answers.ncols()) + &turned * answers;
    // The sum of the identity and a square is positive definite.
    Cholesky::new(normal).map_or_else(
        || DMatrix::zeros(answers.ncols(), answers.nrows()),
        |factors| factors.solve(&turned),
    )
}

fn performed(item: &Item, action: &Action, most_rounds: u32) -> Result<Motion, Error> {
    let (action, rounds) = item.timed(action);
    action.perform_rounds(rounds.min(most_rounds))
}

/// How the soles of an action answer to its seams, and so which of its variations stand.
#[derive(Clone, Debug)]
pub struct Foothold {
    action: Action,
    seams: Seams,
    held: Option<Held>,
}

#[derive(Clone, Debug)]
struct Held {
    look: Look,
    /// How soles answer to seams.
    answers: DMatrix<f64>,
    /// From what soles do to how far seams are moved back, both in parts of what is usual.
    back: DMatrix<f64>,
    /// The same from how far seams are moved.
    moved_back: DMatrix<f64>,
    /// Legs are drawn so many times as far: feet that hold take that away again.
    further: f64,
    /// The same for seams of one stride, while those of the strides beside it stay.
    strides: Look,
    stride_back: DMatrix<f64>,
    stride_moved_back: DMatrix<f64>,
    /// Rounds that are performed.
    rounds: u32,
}

impl Foothold {
    /// Looks at an action, as a body does it. One whose own feet do not hold is varied as it is drawn.
    ///
    /// # Errors
    /// If it cannot be performed.
    pub fn of(part: &Part, spread: &Spread, body: &Proportions) -> Result<Self, Error> {
        let seams = Seams::of(&part.action, spread);
        let legs = seams.seams.iter().filter(|seam| seam.is_of_leg).count();
        let mut foothold = Self { action: part.action.clone(), seams, held: None };
        let varies = (1..=MOST_SEAMS).contains(&legs);
        let motion = performed(&part.item, &part.action, ROUNDS)?;
        if varies && FootingBounds::of(&motion, body)?.is_some() {
            foothold.held = Some(foothold.held(part, body)?);
        }
        Ok(foothold)
    }

    fn held(&self, part: &Part, body: &Proportions) -> Result<Held, Error> {
        let look = Look::at(part, body, ROUNDS, LOOKS_HZ)?;
        let strides = Look::at(part, body, STRIDE_ROUNDS, STRIDE_LOOKS_HZ)?;
        let count = self.seams.seams.len();
        let columns = |off: DVector<f64>| DMatrix::zeros(off.len(), count);
        let mut answers = columns(look.feet_off(&look.feet));
        let mut stride_answers = columns(strides.under_root_off(&strides.feet, &strides.feet));
        for (index, seam) in self.seams.seams.iter().enumerate() {
            if !seam.is_of_leg {
                continue;
            }
            let nudged = |look: &Look, part: f64| {
                let mut offsets = vec![0.0; count];
                offsets[index] = part * seam.deviation;
                look.feet(&self.seams.moved(&self.action, &offsets), body)
            };
            let slope = |look: &Look, off: &dyn Fn(&Feet) -> DVector<f64>| {
                let (more, less) = (nudged(look, NUDGE)?, nudged(look, -NUDGE)?);
                Ok::<_, Error>((off(&more) - off(&less)) / (2.0 * NUDGE))
            };
            answers.set_column(index, &slope(&look, &|feet| look.feet_off(feet))?);
            let under_root = |feet: &Feet| strides.under_root_off(feet, &strides.feet);
            stride_answers.set_column(index, &slope(&strides, &under_root)?);
        }
        let back = moving_back(&answers);
        let moved_back = &back * &answers;
        let further = self.further(&moved_back);
        let stride_back = moving_back(&stride_answers);
        let stride_moved_back = &stride_back * &stride_answers;
        let rounds = part.item.timed(&self.action).1;
        Ok(Held {
            look,
            answers,
            back,
            moved_back,
            further,
            strides,
            stride_back,
            stride_moved_back,
            rounds,
        })
    }

    /// By how much legs vary less where their feet hold, turned round.
    fn further(&self, moved_back: &DMatrix<f64>) -> f64 {
        let left = DMatrix::identity(moved_back.nrows(), moved_back.ncols()) - moved_back;
        let legs: Vec<f64> = (0..left.nrows())
            .filter(|seam| self.seams.seams[*seam].is_of_leg)
            .map(|seam| left.row(seam).norm_squared())
            .collect();
        let mean = legs.iter().sum::<f64>() / legs.len().max(1) as f64;
        if mean > 0.0 { mean.sqrt().recip().min(MOST_FURTHER) } else { 1.0 }
    }

    /// A variation as it is drawn, moved to where feet about hold: by how soles of the action answer, and then by
    /// what they really do on a body that is about the one looked at; and each stride in the same way.
    ///
    /// # Errors
    /// If it cannot be performed: seams passed one another.
    pub fn draw(
        &self,
        body: &Proportions,
        database: &Database,
        random: &mut impl Rng,
    ) -> Result<Footstep<'_>, Error> {
        let drawn = self.seams.draw(&self.action, database, random);
        let strides = drawn.strides.clone();
        let moved = DVector::zeros(drawn.offsets.len());
        let weights = None;
        let (kept, body) = (1.0, *body);
        let mut step = Footstep { foothold: self, body, kept, moved, weights, drawn, strides };
        if let Some(held) = &self.held {
            step.widen(held.further);
            step.stand(held)?;
        }
        Ok(step)
    }

    /// A stride's own part, moved to where each foot stands under the pelvis as it does without.
    fn on_its_feet(
        &self,
        held: &Held,
        mut stride: Vec<f64>,
        alike: &Footstep<'_>,
        feet: &Feet,
    ) -> Result<Vec<f64>, Error> {
        let wanted = self.seams.in_deviations(&stride);
        let move_by = |stride: &mut [f64], moved: &DVector<f64>| {
            for ((offset, moved), seam) in stride.iter_mut().zip(moved).zip(&self.seams.seams) {
                *offset -= moved * seam.deviation;
            }
        };
        move_by(&mut stride, &(&held.stride_moved_back * &wanted));
        let own = self.seams.with_strides(alike.alike(), std::slice::from_ref(&stride));
        let off = held.strides.under_root_off(&held.strides.feet(&own, &alike.body)?, feet);
        // As a repair does: from where it was drawn to where soles would then be still.
        let moved = self.seams.in_deviations(&stride) - &wanted;
        let back = &held.stride_back * off - &held.stride_moved_back * &moved + &moved;
        move_by(&mut stride, &back);
        Ok(stride)
    }
}

/// What the feet of a draw do, and how far that is off.
#[derive(Debug)]
struct Seen {
    feet: Feet,
    off: DVector<f64>,
}

/// A variation on its way to where its feet hold.
#[derive(Clone, Debug)]
pub struct Footstep<'a> {
    foothold: &'a Foothold,
    body: Proportions,
    drawn: Drawn,
    /// The part that is left of what was drawn ...
    kept: f64,
    /// ... and by which it is moved from there, in standard deviations.
    moved: DVector<f64>,
    /// How much it matters what soles and root do, once it was repaired.
    weights: Option<DVector<f64>>,
    /// How much further each stride moves the seams, once it is on its feet.
    strides: Vec<Vec<f64>>,
}

impl Footstep<'_> {
    /// How far what was drawn lies from the action, in standard deviations.
    fn wanted(&self) -> DVector<f64> {
        let drawn = self.drawn.offsets.iter().zip(&self.drawn.displaced);
        let sums: Vec<f64> = drawn.map(|(offset, displaced)| offset + displaced).collect();
        self.foothold.seams.in_deviations(&sums)
    }

    /// Draws legs so many times as far.
    fn widen(&mut self, further: f64) {
        for (offset, seam) in self.drawn.offsets.iter_mut().zip(&self.foothold.seams.seams) {
            if seam.is_of_leg {
                *offset *= further;
            }
        }
    }

    /// The variation.
    #[must_use]
    pub fn action(&self) -> Action {
        self.foothold.seams.with_strides(self.alike(), &self.strides)
    }

    /// The variation with strides that are alike.
    fn alike(&self) -> Action {
        // What was exchanged stays: the offset that undoes a part of it counts from there.
        let moved = self.wanted() * (self.kept - 1.0) + &self.moved;
        let seams = &self.foothold.seams;
        let offsets = self.drawn.offsets.iter().zip(&seams.seams).zip(moved.iter());
        let offsets: Vec<f64> =
            offsets.map(|((offset, seam), moved)| offset + moved * seam.deviation).collect();
        seams.moved(&self.drawn.exchanged, &offsets)
    }

    /// From what is left of the draw to where feet about hold, and each stride likewise.
    fn stand(&mut self, held: &Held) -> Result<(), Error> {
        self.weights = None;
        self.strides.clear();
        self.moved = -(&held.moved_back * self.wanted() * self.kept);
        let feet = held.look.feet(&self.action(), &self.body)?;
        let mut seen = Seen { off: held.look.feet_off(&feet), feet };
        for _ in 0..SETTLES {
            // From the draw to where the soles would be still, were they to answer as they did at first.
            let moved = -(&held.back * &seen.off) + &held.moved_back * &self.moved;
            let Some(better) = self.moved_towards(held, &moved, &seen.off, None) else { break };
            seen = better;
        }
        if held.look.feet.come_back() && !seen.feet.come_back() {
            self.come_back(held, seen);
        }
        let feet = held.strides.feet(&self.action(), &self.body)?;
        // A little before the first round and after the last one are seen.
        let last = 2 * held.rounds as usize + 6;
        let count = self.drawn.strides.len();
        let mut strides = Vec::with_capacity(count);
        for (number, stride) in self.drawn.strides.iter().enumerate() {
            let stride: Vec<f64> = stride.iter().map(|offset| offset * self.kept).collect();
            let is_seen = number < last || number + 2 >= count;
            strides.push(if is_seen {
                self.foothold.on_its_feet(held, stride, self, &feet)?
            } else {
                stride
            });
        }
        self.strides = strides;
        Ok(())
    }

    /// Moves it by how the soles of this very draw answer: each move tells that better, be it taken or not
    /// (Broyden's method).
    fn come_back(&mut self, held: &Held, mut seen: Seen) {
        let mut answers = held.answers.clone();
        let mut part = 1.0;
        for _ in 0..LEARNS {
            let back = moving_back(&answers);
            let target = &back * (&answers * &self.moved - &seen.off);
            let from = self.moved.clone();
            let step = (target - &from) * part;
            self.moved = &from + &step;
            // Seams that pass one another tell nothing.
            let there = self.seen(held).filter(|_| step.norm_squared() > 0.0);
            if let Some(there) = &there {
                let unforeseen = &there.off - &seen.off - &answers * &step;
                answers += unforeseen * step.transpose() / step.norm_squared();
            }
            let now = seen.off.norm_squared() + from.norm_squared();
            let is_better =
                |there: &Seen| there.off.norm_squared() + self.moved.norm_squared() < now;
            match there.filter(is_better) {
                Some(better) => (seen, part) = (better, 1.0),
                None => (self.moved, part) = (from, if part > 0.1 { part / 2.0 } else { 1.0 }),
            }
        }
    }

    /// What its feet do now; none if it cannot be performed.
    fn seen(&self, held: &Held) -> Option<Seen> {
        let feet = held.look.feet(&self.action(), &self.body).ok()?;
        Some(Seen { off: held.look.feet_off(&feet), feet })
    }

    /// Moves it to where its feet were to hold, or so far in that direction that they hold better than they do
    /// now: which feet carry changes on the way, and then soles answer otherwise. What they do there; none if
    /// nothing was better, and it stays where it was.
    fn moved_towards(
        &mut self,
        held: &Held,
        target: &DVector<f64>,
        off: &DVector<f64>,
        weights: Option<&DVector<f64>>,
    ) -> Option<Seen> {
        let weighted = |off: &DVector<f64>| match weights {
            Some(weights) => off.component_mul(weights).norm_squared(),
            None => off.norm_squared(),
        };
        let from = self.moved.clone();
        let now = weighted(off) + from.norm_squared();
        let mut part = 1.0;
        for _ in 0..HALVINGS {
            self.moved = &from + (target - &from) * part;
            // Seams that pass one another are no better.
            let is_better = |seen: &Seen| weighted(&seen.off) + self.moved.norm_squared() < now;
            if let Some(better) = self.seen(held).filter(is_better) {
                return Some(better);
            }
            part *= 0.5;
        }
        self.moved = from;
        None
    }

    /// Moves it by what its feet do now, those that slide too far above all; false if it cannot be moved.
    ///
    /// # Errors
    /// If it cannot be performed.
    pub fn repair(&mut self) -> Result<bool, Error> {
        let Some(held) = &self.foothold.held else { return Ok(false) };
        let feet = held.look.feet(&self.action(), &self.body)?;
        let off = held.look.feet_off(&feet);
        let mut weights = self.weights.take().unwrap_or_else(|| DVector::repeat(off.len(), 1.0));
        held.look.weigh(&feet, &mut weights);
        let mut answers = held.answers.clone();
        for (mut row, weight) in answers.row_iter_mut().zip(weights.iter()) {
            row *= *weight;
        }
        let back = moving_back(&answers);
        let target = -(&back * off.component_mul(&weights)) + &back * (&answers * &self.moved);
        let moved = self.moved_towards(held, &target, &off, Some(&weights)).is_some();
        self.weights = Some(weights);
        Ok(moved)
    }

    /// Goes back to a part of what was drawn, and of how its strides differ, and stands there anew; false if
    /// there is nothing to go back to.
    ///
    /// # Errors
    /// If it cannot be performed.
    pub fn retreat(&mut self, part: f64) -> Result<bool, Error> {
        let Some(held) = &self.foothold.held else { return Ok(false) };
        self.kept *= part;
        self.stand(held)?;
        Ok(true)
    }
}
