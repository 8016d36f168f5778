//! From one gait into another without a stop.
//!
//! Both are cyclic, and at the change the second is in the phase that the first has got to: who counts
//! strides from the same foot goes on from the foot that stands. Joints come to rest at different
//! times. So each degree of freedom leaves the first cycle at one of its own seams and joins the second
//! at one of its own, by a transition actionlet; of all such pairs of seams within a period that a
//! person can follow, the one that stays nearest to both cycles. Since the seams differ from one degree
//! of freedom to the next, the body goes on moving, and that it does is checked.
//!
//! What hips, knees and ankles do decides where feet are and how fast the body travels over them: they are
//! chosen together, so that the body keeps its pace and its height (`legs`).

mod footing;
mod legs;

use crate::action::feet::FootingBounds;
use crate::action::join::{SAME_ANGLE_RAD, TRANSITION_MIN_S, TRANSITION_RAD_S, TRANSITION_RAD_S2};
use crate::action::motion::{SAME_INSTANT_S, resting_until, then_until};
use crate::action::perform::{MAX_ROUNDS, Way};
use crate::action::{Action, Motion, Turn};
use crate::actionlet::{Actionlet, Peaks, Sequence, Shape, shortest_duration_s};
use crate::body::{Dof, Proportions};
use crate::error::{Error, ErrorKind};
use crate::motion::JointLimits;

/// Samples of the time around a change in which ways are compared.
const SAMPLES: usize = 96;

/// How one degree of freedom goes over.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// Which.
    pub dof: Dof,
    /// When it leaves what it did before, at rest, s.
    pub left_s: f64,
    /// Angle there, rad.
    pub left_rad: f64,
    /// When it joins what it does from then on, at rest, s.
    pub joined_s: f64,
    /// Angle there, rad.
    pub joined_rad: f64,
}

/// A change from one gait into another.
#[derive(Clone, Debug, PartialEq)]
pub struct GaitChange {
    /// Name of the action before.
    pub from: String,
    /// Name of the action after.
    pub to: String,
    /// When the cycle of one ends and that of the other begins, s.
    pub time_s: f64,
    /// Phase of both at that time, in periods.
    pub phase: f64,
    /// How each degree of freedom goes over that moves in either of them.
    pub crossings: Vec<Crossing>,
}

impl GaitChange {
    /// The same, so much later.
    #[must_use]
    pub fn later(mut self, by_s: f64) -> Self {
        self.time_s += by_s;
        for crossing in &mut self.crossings {
            crossing.left_s += by_s;
            crossing.joined_s += by_s;
        }
        self
    }
}

/// A turning point in the time of the whole.
#[derive(Clone, Debug, PartialEq)]
struct Seam {
    at_s: f64,
    angle_rad: f64,
    shape: Shape,
}

impl Seam {
    /// Reached by a transition actionlet.
    fn by_transition(at_s: f64, angle_rad: f64) -> Self {
        Self { at_s, angle_rad, shape: Shape::default() }
    }
}

/// A cyclic action in the time of the whole.
struct Gait<'a> {
    action: &'a Action,
    way: Way<'a>,
    begin_s: f64,
    /// The legs rested in the gait before, and begin as the action does by itself.
    legs_lead_in: bool,
    /// The legs rest in the gait after, and end as the action does by itself.
    legs_lead_out: bool,
}

impl Gait<'_> {
    fn period_s(&self) -> f64 {
        self.action.duration_s
    }

    fn end_s(&self) -> f64 {
        self.begin_s + self.way.periods * self.period_s()
    }

    /// The way of the legs.
    fn way_of_legs(&self) -> Way<'_> {
        let from_rest = self.way.from_rest || self.legs_lead_in;
        Way { from_rest, to_rest: self.way.to_rest || self.legs_lead_out, ..self.way.clone() }
    }

    /// Seams of a degree of freedom, a period beyond either end that is in motion; none if it is not
    /// driven.
    fn seams(&self, dof: Dof) -> Option<Vec<Seam>> {
        let way = if dof.is_of_leg() { self.way_of_legs() } else { self.way.clone() };
        let seam = |turn: Turn| Seam {
            at_s: self.begin_s + turn.at * self.period_s(),
            angle_rad: turn.angle_rad,
            shape: turn.shape,
        };
        Some(self.action.turns_on(&way, dof)?.into_iter().map(seam).collect())
    }

    fn leads_in(&self, dof: Dof) -> bool {
        self.legs_lead_in && dof.is_of_leg()
    }

    fn leads_out(&self, dof: Dof) -> bool {
        self.legs_lead_out && dof.is_of_leg()
    }

    /// Flights in s of the whole.
    fn flights_s(&self) -> impl Iterator<Item = (f64, f64)> {
        let in_s = |part: f64| {
            let time_s = self.begin_s + part * self.period_s();
            time_s.max(self.begin_s).min(self.end_s())
        };
        self.action
            .flights_on(&self.way_of_legs())
            .into_iter()
            .map(move |(from, to)| (in_s(from), in_s(to)))
    }

    /// Greatest speed and acceleration of a degree of freedom in the cycle; zero if it is not driven.
    fn peaks(&self, dof: Dof) -> Peaks {
        let mut peaks = Peaks::default();
        let group = self.action.groups.iter().find_map(|group| {
            let track = group.tracks.iter().find(|track| track.dof == dof)?;
            Some((group.rate, &self.action.waveforms[track.waveform]))
        });
        let Some((rate, turns)) = group else { return peaks };
        let period_s = self.period_s() * f64::from(rate.1) / f64::from(rate.0);
        let round = turns.iter().cycle().skip(1);
        for (before, turn) in turns.iter().zip(round) {
            let part = (turn.at - before.at).rem_euclid(1.0);
            let (from_rad, to_rad) = (before.angle_rad, turn.angle_rad);
            let shape = turn.shape.clone();
            // A cycle of one turning point does not move.
            let Ok(piece) = Actionlet::new(0.0, part * period_s, from_rad, to_rad, shape) else {
                continue;
            };
            let of = piece.peaks();
            peaks.velocity_rad_s = peaks.velocity_rad_s.max(of.velocity_rad_s);
            peaks.acceleration_rad_s2 = peaks.acceleration_rad_s2.max(of.acceleration_rad_s2);
        }
        peaks
    }
}

/// Every degree of freedom goes over in the way chosen for it.
fn go_over(
    lines: &mut [Line],
    choices: &[Choice],
    chosen: &[usize],
    (from, to): (&Gait<'_>, &Gait<'_>),
) -> Vec<Crossing> {
    let ways = lines.iter_mut().zip(choices).zip(chosen);
    ways.filter_map(|((line, choice), way)| line.goes_over(choice, *way, from, to)).collect()
}

/// Cyclic actions, each with its rounds, one after the other as one motion that does not come to rest
/// between them, and how it goes over from each to the next. The last round of the last one goes on to
/// the phase at which it ends.
///
/// # Errors
/// If there are none, one is done once, rounds are out of range, a foot is in the air at a change, a
/// degree of freedom would have to be faster than in either gait, or everything would rest at once.
pub fn without_a_stop(
    actions: &[(Action, u32)],
    body: &Proportions,
) -> Result<(Motion, Vec<GaitChange>), Error> {
    let gaits = gaits(actions)?;
    let ([first, ..], [.., last]) = (gaits.as_slice(), gaits.as_slice()) else {
        return Err(Error::new("no action was named"));
    };
    let mut changes: Vec<GaitChange> = Vec::new();
    for pair in gaits.windows(2) {
        let [from, to] = pair else { continue };
        if !to.legs_lead_in && !from.legs_lead_out {
            stands(from, to)?;
        }
        changes.push(GaitChange {
            from: from.action.name.clone(),
            to: to.action.name.clone(),
            time_s: to.begin_s,
            phase: to.way.phase,
            crossings: Vec::new(),
        });
    }
    let end_s = last.end_s();
    let mut lines = Dof::ALL.map(|dof| Line::of(first, dof));
    let mut all_bounds = Some(FootingBounds::default());
    for (pair, change) in gaits.windows(2).zip(changes.iter_mut()) {
        let [from, to] = pair else { continue };
        let mut choices = Vec::new();
        for line in &lines {
            choices.push(line.choice(from, to)?);
        }
        let nearest: Vec<usize> = choices.iter().map(Choice::nearest).collect();
        if !(from.action.moves_legs() && to.action.moves_legs()) {
            change.crossings = go_over(&mut lines, &choices, &nearest, (from, to));
            continue;
        }
        let bounds = footing::bounds(from, to, body)?;
        let mut best: Option<(f64, [Line; 22], Vec<Crossing>)> = None;
        for chosen in legs::together(&lines, &choices, &Around::of(from, to), &nearest)? {
            let mut tried = lines.clone();
            let mut crossings = go_over(&mut tried, &choices, &chosen, (from, to));
            let share = match &bounds {
                Some(bounds) => {
                    footing::hold(&mut tried, (from, to), &mut crossings, bounds, body)?
                }
                None => 0.0,
            };
            if best.as_ref().is_none_or(|(least, ..)| share < *least) {
                best = Some((share, tried, crossings));
            }
            if share < footing::GOOD {
                break;
            }
        }
        if let Some((_, tried, crossings)) = best {
            (lines, change.crossings) = (tried, crossings);
        }
        all_bounds = all_bounds.zip(bounds).map(|(all, bounds)| all.or(&bounds));
    }
    let mut tracks = Vec::with_capacity(Dof::ALL.len());
    for line in lines {
        tracks.push(resting_until(line.chain()?, end_s)?);
    }
    for change in &changes {
        goes_on(&tracks, change, end_s)?;
    }
    let motion = Motion::new(tracks)?;
    let last_s = motion.duration_s();
    let flights = gaits.iter().flat_map(|gait| gait.flights_s()).map(|(a, b)| (a, b.min(last_s)));
    let motion = motion.in_flight(flights.collect())?;
    if let Some(bounds) = all_bounds {
        footing::held(&motion, &changes, &bounds, body)?;
    }
    Ok((motion, changes))
}

/// The actions in the time of the whole.
fn gaits(actions: &[(Action, u32)]) -> Result<Vec<Gait<'_>>, Error> {
    let names = || actions.iter().map(|(action, _)| action.name.as_str()).collect::<Vec<_>>();
    let mut gaits: Vec<Gait<'_>> = Vec::new();
    for (index, (action, rounds)) in actions.iter().enumerate() {
        let Some(ends) = &action.cyclic else {
            return Err(Error::new("an action that is done once begins and ends at rest")
                .at(names().join("+"))
                .got(action.name.clone())
                .allowed("cyclic actions, such as walk and run, on both sides of a +")
                .remedy("join it with a comma"));
        };
        if !(1..=MAX_ROUNDS).contains(rounds) {
            return Err(Error::new("the number of rounds of an action is out of range")
                .at(names().join("+"))
                .got(format!("{rounds} of {}", action.name))
                .allowed(format!("1 to {MAX_ROUNDS}")));
        }
        let to_rest = index + 1 == actions.len();
        let moves_legs = action.moves_legs();
        let legs_rested = gaits.last().is_some_and(|last| !last.action.moves_legs());
        let legs_lead_in = moves_legs && legs_rested;
        let legs_rest_next = actions.get(index + 1).is_some_and(|next| !next.0.moves_legs());
        let legs_lead_out = moves_legs && legs_rest_next;
        // Whole rounds, so that every change is in the phase at which the first action started; but legs that
        // come out of rest begin as they do by themselves.
        let phase = match gaits.last() {
            Some(last) if last.legs_lead_out => last.way.ends.phase,
            Some(last) if !legs_lead_in => last.way.phase,
            _ => ends.phase,
        };
        let to_its_end = to_rest || legs_lead_out;
        let rest_of_round = if to_its_end { (ends.phase - phase).rem_euclid(1.0) } else { 0.0 };
        let begin_s = gaits.last().map_or(0.0, Gait::end_s);
        let periods = f64::from(*rounds) + rest_of_round;
        let way = Way { ends, phase, periods, from_rest: index == 0, to_rest };
        gaits.push(Gait { action, way, begin_s, legs_lead_in, legs_lead_out });
    }
    Ok(gaits)
}

/// Fails if one of the two is in the air when one goes over into the other.
fn stands(from: &Gait<'_>, to: &Gait<'_>) -> Result<(), Error> {
    let phase = to.way.phase;
    for gait in [from, to] {
        let flies = |(begin, end): &&(f64, f64)| {
            let since = (phase - begin).rem_euclid(1.0);
            let rounded = SAME_INSTANT_S;
            since > rounded && since < end - begin - rounded
        };
        if let Some((begin, end)) = gait.action.flights.iter().find(flies) {
            return Err(Error::new(
                "no foot is on the ground where one gait goes over into the other",
            )
            .at(format!("{}+{}", from.action.name, to.action.name))
            .got(format!("phase {phase}; {} flies from {begin} to {end}", gait.action.name))
            .allowed("a change while a foot stands in both")
            .remedy("join them with a comma"));
        }
    }
    Ok(())
}

/// One degree of freedom, from 0 s as far as it is decided and, if the gait that it is in drives it, a
/// period further.
#[derive(Clone)]
struct Line {
    dof: Dof,
    seams: Vec<Seam>,
    /// The gait that it is in drives it.
    driven: bool,
    /// From this seam on it may leave that gait.
    since: usize,
}

/// What a degree of freedom may do at a change.
struct Choice {
    /// Every way over that a person can follow, and how far it strays from both cycles; none if it rests in
    /// both, at one angle.
    ways: Vec<(Over, f64)>,
    /// Seams of the gait after, if it drives it; where there are no ways, they begin at the angle at which it
    /// rests.
    next: Option<Vec<Seam>>,
    /// What the gait after has it do.
    after: Sequence,
}

impl Choice {
    /// The way that strays least.
    fn nearest(&self) -> usize {
        let ways = self.ways.iter().enumerate();
        ways.min_by(|a, b| a.1.1.total_cmp(&b.1.1)).map_or(0, |(index, _)| index)
    }
}

/// A way from a seam of the gait before to one of the gait after.
struct Over {
    /// Seams of the line that stay.
    kept: usize,
    left: Seam,
    joined: Seam,
    /// Index of the seam of the gait after that follows the one joined.
    rest: usize,
}

impl Over {
    fn distance_rad(&self) -> f64 {
        self.joined.angle_rad - self.left.angle_rad
    }

    fn duration_s(&self) -> f64 {
        self.joined.at_s - self.left.at_s
    }

    /// How many times too fast it would be.
    fn haste(&self, limits: &JointLimits) -> f64 {
        let needed_s = shortest_duration_s(&Shape::default(), self.distance_rad(), limits, None);
        needed_s / self.duration_s()
    }
}

impl Line {
    fn of(first: &Gait<'_>, dof: Dof) -> Self {
        let mut seams = vec![Seam::by_transition(0.0, first.action.pose[dof])];
        let own = first.seams(dof);
        let driven = own.is_some() && !first.leads_out(dof);
        seams.extend(own.unwrap_or_default());
        Self { dof, seams, driven, since: 0 }
    }

    /// Where it is decided up to, or rests from.
    fn last(&self) -> (f64, f64) {
        self.seams.last().map_or((0.0, 0.0), |seam| (seam.at_s, seam.angle_rad))
    }

    fn chain(&self) -> Result<Sequence, Error> {
        chain(&self.seams)
    }

    /// How it may leave the gait before and join the one after.
    fn choice(&self, from: &Gait<'_>, to: &Gait<'_>) -> Result<Choice, Error> {
        let next = to.seams(self.dof);
        let pose_rad = to.action.pose[self.dof];
        let after = match &next {
            Some(seams) => chain(seams)?,
            None => Sequence::starting_at(0.0, pose_rad)?,
        };
        let goes_on = !self.driven && (next.is_none() || to.leads_in(self.dof));
        if goes_on && (pose_rad - self.last().1).abs() <= SAME_ANGLE_RAD {
            return Ok(Choice { ways: Vec::new(), next, after });
        }
        let limits = limits(from, to, self.dof)?;
        let overs = self.overs(from, to, next.as_deref(), pose_rad, &limits);
        if overs.iter().all(|over| over.haste(&limits) > 1.0 + 1e-9) {
            return Err(too_fast(from, to, self.dof, &overs, &limits));
        }
        let around = Around::of(from, to);
        let (before_rad, after_rad) = (around.angles(&self.chain()?), around.angles(&after));
        let mut ways = Vec::new();
        for over in overs {
            if over.haste(&limits) <= 1.0 + 1e-9 {
                let goes_rad = around.goes(&over, &before_rad, &after_rad)?;
                let strays = around.strays(&goes_rad, &before_rad, &after_rad);
                ways.push((over, strays));
            }
        }
        Ok(Choice { ways, next, after })
    }

    /// Leaves the gait before and joins the one after in one of the ways that it may.
    fn goes_over(
        &mut self,
        choice: &Choice,
        way: usize,
        from: &Gait<'_>,
        to: &Gait<'_>,
    ) -> Option<Crossing> {
        let next_drives = choice.next.is_some() && !to.leads_out(self.dof);
        let Some((over, _)) = choice.ways.get(way) else {
            let crossing = match &choice.next {
                Some(next) => self.led_in(next, to),
                None => self.led_out(from),
            };
            self.rests_until(to.begin_s);
            self.since = self.seams.len();
            self.driven = next_drives;
            self.seams.extend(choice.next.iter().flatten().cloned());
            return crossing;
        };
        let crossing = Crossing {
            dof: self.dof,
            left_s: over.left.at_s,
            left_rad: over.left.angle_rad,
            joined_s: over.joined.at_s,
            joined_rad: over.joined.angle_rad,
        };
        self.seams.truncate(over.kept);
        if over.left.at_s > self.last().0 + SAME_INSTANT_S {
            self.seams.push(over.left.clone());
        }
        self.since = self.seams.len();
        self.seams.push(over.joined.clone());
        self.driven = next_drives;
        self.seams.extend(choice.next.iter().flatten().skip(over.rest).cloned());
        Some(crossing)
    }

    fn rests_until(&mut self, time_s: f64) {
        let (last_s, last_rad) = self.last();
        if time_s > last_s + SAME_INSTANT_S {
            self.seams.push(Seam::by_transition(time_s, last_rad));
        }
    }

    /// From rest into the cycle of the gait after as that is led in by itself.
    fn led_in(&self, next: &[Seam], to: &Gait<'_>) -> Option<Crossing> {
        let lead_in = to.way.ends.lead_in.iter().filter(|(dof, _)| *dof == self.dof);
        let joined = next.get(lead_in.count())?;
        Some(Crossing {
            dof: self.dof,
            left_s: to.begin_s,
            left_rad: self.last().1,
            joined_s: joined.at_s,
            joined_rad: joined.angle_rad,
        })
    }

    /// Out of the cycle of the gait before, as that is led out by itself, to rest.
    fn led_out(&self, from: &Gait<'_>) -> Option<Crossing> {
        if !from.leads_out(self.dof) {
            return None;
        }
        let leaves_s = from.end_s() - from.way.ends.before * from.period_s();
        let left = self.seams.iter().rfind(|seam| seam.at_s <= leaves_s + SAME_INSTANT_S)?;
        let (joined_s, joined_rad) = self.last();
        let (left_s, left_rad) = (left.at_s, left.angle_rad);
        (joined_s > left_s).then_some(Crossing {
            dof: self.dof,
            left_s,
            left_rad,
            joined_s,
            joined_rad,
        })
    }

    /// Every way over within a period. What a gait does not drive rests, and may leave its rest, or be
    /// left at rest, whenever it suits the other.
    fn overs(
        &self,
        from: &Gait<'_>,
        to: &Gait<'_>,
        next: Option<&[Seam]>,
        pose_rad: f64,
        limits: &JointLimits,
    ) -> Vec<Over> {
        let near = |seam: &Seam, gait: &Gait<'_>| {
            (seam.at_s - to.begin_s).abs() <= gait.period_s() + SAME_INSTANT_S
        };
        let in_time = |from_rad: f64, to_rad: f64| {
            let least_s = shortest_duration_s(&Shape::default(), to_rad - from_rad, limits, None);
            least_s.max(TRANSITION_MIN_S)
        };
        let (last_s, last_rad) = self.last();
        let leaves = self.seams.iter().enumerate().skip(self.since);
        let leaves = leaves.filter(|(_, seam)| near(seam, from));
        let joins = |next: &[Seam]| -> Vec<(usize, Seam)> {
            let seams = next.iter().enumerate().filter(|(_, seam)| near(seam, to));
            seams.map(|(j, seam)| (j + 1, Seam::by_transition(seam.at_s, seam.angle_rad))).collect()
        };
        let mut overs = Vec::new();
        match (self.driven, next) {
            (true, Some(next)) => {
                let joins = joins(next);
                for (i, left) in leaves {
                    let later = joins.iter().filter(|(_, joined)| joined.at_s > left.at_s);
                    overs.extend(later.map(|(rest, joined)| Over {
                        kept: i + 1,
                        left: left.clone(),
                        joined: joined.clone(),
                        rest: *rest,
                    }));
                }
            }
            (true, None) => overs.extend(leaves.map(|(i, left)| {
                let at_s = left.at_s + in_time(left.angle_rad, pose_rad);
                let joined = Seam::by_transition(at_s, pose_rad);
                Over { kept: i + 1, left: left.clone(), joined, rest: 0 }
            })),
            (false, Some(next)) => overs.extend(joins(next).into_iter().map(|(rest, joined)| {
                let at_s = joined.at_s - in_time(last_rad, joined.angle_rad);
                let left = Seam::by_transition(at_s, last_rad);
                Over { kept: self.seams.len(), left, joined, rest }
            })),
            (false, None) => {
                let left = Seam::by_transition(to.begin_s.max(last_s), last_rad);
                let at_s = left.at_s + in_time(last_rad, pose_rad);
                let joined = Seam::by_transition(at_s, pose_rad);
                overs.push(Over { kept: self.seams.len(), left, joined, rest: 0 });
            }
        }
        overs.retain(|over| {
            let begins = over.left.at_s >= self.seams[over.kept - 1].at_s - SAME_INSTANT_S;
            begins && over.joined.at_s <= to.end_s()
        });
        overs
    }
}

fn chain(seams: &[Seam]) -> Result<Sequence, Error> {
    let (at_s, angle_rad) = seams.first().map_or((0.0, 0.0), |seam| (seam.at_s, seam.angle_rad));
    let start = Sequence::starting_at(at_s, angle_rad)?;
    seams.iter().skip(1).try_fold(start, |chain, seam| {
        then_until(chain, seam.at_s, seam.angle_rad, seam.shape.clone())
    })
}

/// What a person can follow in a change: what they do in either gait, or an unhurried transition.
fn limits(from: &Gait<'_>, to: &Gait<'_>, dof: Dof) -> Result<JointLimits, Error> {
    let (before, after) = (from.peaks(dof), to.peaks(dof));
    let speed = before.velocity_rad_s.max(after.velocity_rad_s);
    let acceleration = before.acceleration_rad_s2.max(after.acceleration_rad_s2);
    let (speed, acceleration) = (speed.max(TRANSITION_RAD_S), acceleration.max(TRANSITION_RAD_S2));
    JointLimits::new(-1e3, 1e3, speed, acceleration)
}

fn too_fast(
    from: &Gait<'_>,
    to: &Gait<'_>,
    dof: Dof,
    overs: &[Over],
    limits: &JointLimits,
) -> Error {
    let place = format!("{}+{}, {}", from.action.name, to.action.name, dof.name());
    let slowest = |a: &&Over, b: &&Over| a.haste(limits).total_cmp(&b.haste(limits));
    let got = match overs.iter().min_by(slowest) {
        None => "no two instants of rest within a period of the change".to_owned(),
        Some(over) => format!(
            "at best from {:.1} deg at {:.3} s to {:.1} deg at {:.3} s, {:.2} times as fast as allowed",
            over.left.angle_rad.to_degrees(),
            over.left.at_s,
            over.joined.angle_rad.to_degrees(),
            over.joined.at_s,
            over.haste(limits)
        ),
    };
    Error::of(ErrorKind::OutsideLimits, "this change of gait is faster than a person")
        .at(place)
        .got(got)
        .allowed(format!(
            "what it does in either gait, or an unhurried transition: {:.0} deg/s, {:.0} deg/s^2",
            limits.velocity_rad_s().to_degrees(),
            limits.acceleration_rad_s2().to_degrees()
        ))
        .remedy("join them with a comma, or bring their paces nearer to one another (walk@1.2)")
}

/// The periods around a change.
struct Around {
    change_s: f64,
    times_s: Vec<f64>,
}

impl Around {
    fn of(from: &Gait<'_>, to: &Gait<'_>) -> Self {
        let change_s = to.begin_s;
        let begin_s = change_s - from.period_s();
        let step_s = (from.period_s() + to.period_s()) / SAMPLES as f64;
        let times_s = (0..=SAMPLES).map(|sample| begin_s + sample as f64 * step_s).collect();
        Self { change_s, times_s }
    }

    fn angles(&self, chain: &Sequence) -> Vec<f64> {
        self.times_s.iter().map(|time_s| chain.at(*time_s).position_rad).collect()
    }

    /// Angles of a degree of freedom that goes over.
    fn goes(&self, over: &Over, before_rad: &[f64], after_rad: &[f64]) -> Result<Vec<f64>, Error> {
        let (left, joined) = (&over.left, &over.joined);
        let transition = Actionlet::new(
            left.at_s,
            over.duration_s(),
            left.angle_rad,
            joined.angle_rad,
            joined.shape.clone(),
        )?;
        let angles = self.times_s.iter().zip(before_rad.iter().zip(after_rad));
        let goes_rad = angles.map(|(time_s, (before_rad, after_rad))| {
            if *time_s < left.at_s {
                *before_rad
            } else if *time_s < joined.at_s {
                transition.at(*time_s).position_rad
            } else {
                *after_rad
            }
        });
        Ok(goes_rad.collect())
    }

    /// How far a way over is from the cycle before up to the change and from the one after since: the
    /// sum of squares, rad^2.
    fn strays(&self, goes_rad: &[f64], before_rad: &[f64], after_rad: &[f64]) -> f64 {
        let angles = goes_rad.iter().zip(before_rad.iter().zip(after_rad));
        let squares = self.times_s.iter().zip(angles).map(|(time_s, (goes, (before, after)))| {
            let cycle_rad = if *time_s < self.change_s { before } else { after };
            (goes - cycle_rad).powi(2)
        });
        squares.sum()
    }
}

/// Fails if there is an instant at which every degree of freedom rests while one gait goes over into
/// the other.
fn goes_on(tracks: &[Sequence], change: &GaitChange, end_s: f64) -> Result<(), Error> {
    let crossings = change.crossings.iter();
    let (from_s, to_s) = crossings.fold((change.time_s, change.time_s), |(from_s, to_s), of| {
        (from_s.min(of.left_s), to_s.max(of.joined_s))
    });
    let pieces = tracks.iter().flat_map(|track| track.actionlets());
    let moving = pieces.filter(|piece| !piece.is_rest());
    let mut moving: Vec<(f64, f64)> =
        moving.map(|piece| (piece.begin_s(), piece.end_s())).collect();
    moving.retain(|(begin_s, end_s)| *end_s > from_s && *begin_s < to_s);
    moving.sort_by(|a, b| a.0.total_cmp(&b.0));
    // Up to here something moves at every instant; at 0 s all begins.
    let mut reach_s = from_s;
    for (begin_s, end_s) in moving {
        if begin_s < reach_s - SAME_INSTANT_S || reach_s <= SAME_INSTANT_S {
            reach_s = reach_s.max(end_s);
        }
    }
    if reach_s > to_s + SAME_INSTANT_S || reach_s >= end_s - SAME_INSTANT_S {
        return Ok(());
    }
    Err(Error::new("one gait would come to rest before the other begins")
        .at(format!("{}+{}", change.from, change.to))
        .got(format!("every degree of freedom rests at {reach_s:.3} s"))
        .allowed("gaits in which joints come to rest at different times")
        .remedy("join them with a comma"))
}
