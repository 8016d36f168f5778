//! The HTML page of a motion on a robot: what is drawn, and what is said beside it.

pub(super) mod body;
pub mod file;
pub mod live;
mod look;

use super::recorder::Series;
use super::report::PlayReport;
use super::source::RobotMotion;
use super::weight::Fall;
use crate::body::{Proportions, SegmentPose, contact};
use crate::error::Error;
use crate::mocap::scene::{DrawnFeet, Scene};
use crate::motion::Plan;
use crate::retarget::BodyFigures;
use crate::retarget::base::BasePath;
use crate::robot::{Robot, RobotBody};
use crate::view::person::PersonTrack;
use crate::view::robot::{collisions, still};
use crate::view::scene::ViewScene;
use crate::view::series::Coded;
use crate::view::tracks::{JointTrack, JointTracks, Quantity, SampleClock, SpanKind, ViewSpan};
use crate::view::{ANGLE_RAD, ViewPage};
use glam::DVec3;

/// Poses of a person per second, at most.
const PERSON_HZ: f64 = 60.0;
/// The row of the time line with the parts of a run.
const PART: &str = "part";
/// Most spans of one kind on the time line.
const SPANS: usize = 200;

/// A motion on a robot, planned, and perhaps played.
pub(super) struct RobotScene<'a> {
    pub(super) robot: &'a Robot,
    pub(super) motion: &'a RobotMotion,
    pub(super) planned: &'a Plan,
    /// Playing speed.
    pub(super) speed: f64,
    /// Where its base goes, if it has a body.
    pub(super) base: Option<&'a BasePath>,
    pub(super) metrics: &'a BodyFigures,
    /// What its joints were asked, and did.
    pub(super) series: &'a Series,
}

impl RobotScene<'_> {
    /// What is drawn.
    ///
    /// # Errors
    /// A body no tree can be made of, a stature nobody has.
    pub(super) fn view(&self) -> Result<ViewScene, Error> {
        let series = self.series;
        let duration_s = series.time_s.last().copied().unwrap_or(0.0);
        let start_rad: Vec<f64> = self.robot.joints.iter().map(|joint| joint.initial_rad).collect();
        let body = drawable(self.robot)?;
        let stands_still = body.as_ref().map(|body| still(body, &start_rad));
        let mut spans = self.parts(duration_s);
        spans.extend(self.missed());
        spans.extend(self.foreseen()?);
        let robot = body.as_ref().zip(self.base.or(stands_still.as_ref()));
        Ok(ViewScene {
            duration_s,
            robot: robot.map(|(body, base)| look::drawn(self.robot, body, base)),
            joints: Some(self.joints()),
            person: self.person(duration_s)?,
            spans,
            ..ViewScene::default()
        })
    }

    /// What can be said of the motion before it is played: where it was too fast as it came in, where it would tip, and
    /// where it touches itself.
    ///
    /// # Errors
    /// A body no tree can be made of.
    pub(super) fn foreseen(&self) -> Result<Vec<ViewSpan>, Error> {
        let mut spans = self.slow();
        spans.extend(self.doubts());
        if let Some((body, base)) = drawable(self.robot)?.zip(self.base) {
            let start_rad: Vec<f64> =
                self.robot.joints.iter().map(|joint| joint.initial_rad).collect();
            spans.extend(self.collisions(&body, base, &start_rad));
        }
        Ok(spans)
    }

    fn joints(&self) -> JointTracks {
        let limits = self.robot.joints.iter().map(|joint| NamedLimits {
            name: joint.name.clone(),
            range_rad: Some([joint.limits.lower_rad(), joint.limits.upper_rad()]),
            velocity_rad_s: finite(joint.limits.velocity_rad_s()),
            acceleration_rad_s2: finite(joint.limits.acceleration_rad_s2()),
        });
        joint_tracks(self.series, limits.collect())
    }

    /// The person whose motion it is, in the robot's time.
    fn person(&self, duration_s: f64) -> Result<Option<PersonTrack>, Error> {
        let Some(person) = self.motion.person() else { return Ok(None) };
        let lengths = Proportions::of_stature(person.stature_m)?;
        let floor_m = contact::floor_m(&lengths, &person.poses);
        let rate_hz = self.robot.file.rate_hz.min(PERSON_HZ);
        let count = (duration_s * rate_hz).floor() as usize + 1;
        let at = |index: usize| {
            let path_s = self.planned.path_time_s(index as f64 / rate_hz);
            let pose = person.at(self.motion.source_time_s(path_s));
            SegmentPose { root_m: pose.root_m - DVec3::Z * floor_m, ..pose }
        };
        let poses: Vec<SegmentPose> = (0..count).map(at).collect();
        let scene = Scene {
            title: &self.motion.name,
            poses: &person.poses,
            body: &lengths,
            rate_hz: person.rate_hz,
            floor_m,
            feet: DrawnFeet::of(person.is_made, &person.tracked),
        };
        // The person's own pace tells what is slow.
        let carries = scene.carries().map(|all| {
            let at = |index: usize| {
                let path_s = self.planned.path_time_s(index as f64 / rate_hz);
                let pose = (self.motion.source_time_s(path_s) * person.rate_hz).round();
                all.get((pose.max(0.0) as usize).min(all.len().saturating_sub(1))).copied()
            };
            (0..count).map_while(at).collect::<Vec<_>>()
        });
        let clock = SampleClock::Even { rate_hz, count };
        Ok(Some(PersonTrack::drawn(&scene, clock, &poses, carries.as_deref())))
    }

    /// The way to the motion, the motion, and the way to rest.
    fn parts(&self, duration_s: f64) -> Vec<ViewSpan> {
        let Plan { clip_start_s, clip_s, ease_in_s, ease_out_s, .. } = *self.planned;
        let end_s = clip_start_s + clip_s;
        let is_long = duration_s - end_s > clip_s / 2.0;
        let after = if is_long { "further rounds" } else { "at rest" };
        let parts = [
            (SpanKind::Part, "approach", 0.0, clip_start_s),
            (SpanKind::Part, "motion", clip_start_s, end_s),
            (SpanKind::Part, after, end_s, duration_s),
            (SpanKind::Phase, "ease in", clip_start_s, clip_start_s + ease_in_s),
            (SpanKind::Phase, "ease out", end_s - ease_out_s, end_s),
        ];
        let made = parts.into_iter().filter_map(|(kind, label, start_s, end_s)| {
            let (start_s, end_s) = (start_s.min(duration_s), end_s.min(duration_s));
            let row = if kind == SpanKind::Part { PART } else { "clock of the motion" };
            let is_there = end_s - start_s > 0.02;
            is_there.then(|| ViewSpan::new(kind, row, label, start_s, end_s))
        });
        made.collect()
    }

    /// Cycles in which a joint was asked and no angle came.
    fn missed(&self) -> Vec<ViewSpan> {
        let Series { time_s, missed, .. } = self.series;
        let mut spans: Vec<ViewSpan> = Vec::new();
        for (index, cycles) in missed.iter().enumerate() {
            let name = &self.robot.joints[index].name;
            let mut runs = cycles.chunk_by(|a, b| a == b).scan(0, |at, run| {
                *at += run.len();
                Some((*at - run.len(), run))
            });
            while let Some((first, run)) = runs.next().filter(|_| spans.len() < SPANS) {
                if run[0] && run.len() < cycles.len() {
                    let last = (first + run.len()).min(time_s.len() - 1);
                    let (start_s, end_s) = (time_s[first], time_s[last]);
                    let row = "missed readings";
                    spans.push(ViewSpan::new(SpanKind::Wrong, row, name, start_s, end_s));
                }
            }
        }
        spans
    }

    /// Where the motion was too fast, in the robot's time.
    fn slow(&self) -> Vec<ViewSpan> {
        let Some(retime) = &self.metrics.retime else { return Vec::new() };
        let Plan { clip_start_s, clip_s, .. } = *self.planned;
        // The clock of the motion never goes back: when it is somewhere is found by halves.
        let when = |asked_s: f64| {
            let (mut low_s, mut high_s) = (clip_start_s, clip_start_s + clip_s);
            for _ in 0..40 {
                let middle_s = f64::midpoint(low_s, high_s);
                if self.planned.path_time_s(middle_s) < asked_s * self.speed {
                    low_s = middle_s;
                } else {
                    high_s = middle_s;
                }
            }
            low_s
        };
        let span = |of: &crate::retarget::SlowStretch| {
            let label = format!("{}: {:.2} times too fast", of.joint, of.factor);
            let (start_s, end_s) = (when(of.start_s), when(of.end_s));
            ViewSpan::new(SpanKind::Doubt, "too fast as it came in", &label, start_s, end_s)
        };
        retime.local.iter().map(span).collect()
    }

    /// Where it would tip.
    fn doubts(&self) -> Vec<ViewSpan> {
        let outside = self.metrics.unbalanced.iter().map(|[start_s, end_s]| {
            let label = "the floor would have to push outside the soles";
            ViewSpan::new(SpanKind::Doubt, "out of balance", label, *start_s, *end_s)
        });
        let falls = self.metrics.predicted_fall_s.map(|at_s| {
            let label = "on its own feet it would be lost from here on";
            ViewSpan::new(SpanKind::Wrong, "predicted fall", label, at_s, at_s)
        });
        outside.chain(falls).collect()
    }

    /// When it touches itself, over the time in which its base is told.
    fn collisions(&self, body: &RobotBody, base: &BasePath, start_rad: &[f64]) -> Vec<ViewSpan> {
        let Series { time_s, goal_rad, .. } = self.series;
        let poses = sampled(time_s, goal_rad, base.rate_hz, base.places.len(), start_rad);
        collisions(body, start_rad, &poses, base.rate_hz)
    }
}

/// What of a robot can be drawn: its body, or its joints alone.
pub(super) fn drawable(robot: &Robot) -> Result<Option<RobotBody>, Error> {
    RobotBody::of(&robot.file)?.map_or_else(|| RobotBody::bare(&robot.file), |body| Ok(Some(body)))
}

/// A joint's name and limits.
struct NamedLimits {
    name: String,
    range_rad: Option<[f64; 2]>,
    velocity_rad_s: Option<f64>,
    acceleration_rad_s2: Option<f64>,
}

/// Joints with all that is known of them; what never was is left out.
fn joint_tracks(series: &Series, limits: Vec<NamedLimits>) -> JointTracks {
    let coded = |values: &[f64]| {
        let is_there = values.iter().any(|value| value.is_finite());
        is_there.then(|| Coded::of(values.iter().copied(), ANGLE_RAD))
    };
    let joints = limits.into_iter().enumerate().map(|(index, limits)| JointTrack {
        name: limits.name,
        goal: series.goal_rad.get(index).and_then(|values| coded(values)),
        present: coded(&series.drawn_rad(index)),
        others: series.others(index),
        range_rad: limits.range_rad,
        velocity_limit_rad_s: limits.velocity_rad_s,
        acceleration_limit_rad_s2: limits.acceleration_rad_s2,
        initial_rad: None,
    });
    JointTracks { clock: SampleClock::of(&series.time_s), joints: joints.collect() }
}

/// Poses at even times: of each joint the first value from then on, or where it starts if nobody knows.
fn sampled(
    time_s: &[f64],
    angles_rad: &[Vec<f64>],
    rate_hz: f64,
    count: usize,
    start_rad: &[f64],
) -> Vec<Vec<f64>> {
    let pose = |index: usize| {
        let later = time_s.partition_point(|time_s| *time_s < index as f64 / rate_hz);
        let at = later.min(time_s.len().saturating_sub(1));
        let of = |(angles_rad, start_rad): (&Vec<f64>, &f64)| {
            angles_rad.get(at).copied().filter(|angle| angle.is_finite()).unwrap_or(*start_rad)
        };
        angles_rad.iter().zip(start_rad).map(of).collect()
    };
    (0..count).map(pose).collect()
}

fn finite(value: f64) -> Option<f64> {
    Some(value).filter(|value| value.is_finite())
}

impl Series {
    /// Where a joint was, cycle by cycle. Between two readings of one that is read in turn it is on the straight line from
    /// one to the other, as a plot of them would have it; where a reading was missed nobody knows.
    fn drawn_rad(&self, joint: usize) -> Vec<f64> {
        let mut values = self.present_rad.get(joint).cloned().unwrap_or_default();
        let was_missed =
            |at: usize| self.missed.get(joint).is_some_and(|of| of.get(at) == Some(&true));
        let mut last: Option<usize> = None;
        for at in 0..values.len() {
            if was_missed(at) {
                last = None;
            }
            if !values[at].is_finite() {
                continue;
            }
            if let Some(from) = last.replace(at) {
                let (begin, span) = (values[from], (self.time_s[at] - self.time_s[from]).max(1e-9));
                for between in from + 1..at {
                    let share = (self.time_s[between] - self.time_s[from]) / span;
                    values[between] = begin + (values[at] - begin) * share;
                }
            }
        }
        values
    }

    /// What was read of a joint beside its angle.
    fn others(&self, joint: usize) -> Vec<Quantity> {
        let kinds = [
            ("velocity as read", "\u{b0}/s", &self.velocity_rad_s, ANGLE_RAD),
            ("current", "A", &self.current_a, 1e-3),
            ("load", "of full", &self.load_ratio, 1e-3),
            ("temperature", "\u{b0}C", &self.temperature_c, 0.1),
            ("voltage", "V", &self.voltage_v, 0.01),
        ];
        let read = kinds.into_iter().filter_map(|(name, unit, values, quantum)| {
            let values = values.get(joint)?;
            let there = || self.time_s.iter().zip(values).filter(|(_, value)| value.is_finite());
            let times_s: Vec<f64> = there().map(|(time_s, _)| *time_s).collect();
            let scale = if unit == "\u{b0}/s" { 180.0 / std::f64::consts::PI } else { 1.0 };
            let values = Coded::of(there().map(|(_, value)| value * scale), quantum);
            (!times_s.is_empty()).then(|| Quantity {
                name,
                unit,
                clock: SampleClock::of(&times_s),
                values,
            })
        });
        read.collect()
    }
}

/// The motion was left there, on the way to rest.
fn brakes(spans: &mut Vec<ViewSpan>, at_s: f64, end_s: f64) {
    for span in spans.iter_mut().filter(|span| span.row == PART) {
        span.end_s = span.end_s.min(at_s);
    }
    spans.retain(|span| span.row != PART || span.end_s > span.start_s);
    spans.push(ViewSpan::new(SpanKind::Part, PART, "brakes", at_s, end_s));
}

/// The page of a motion that was played, or planned for a file.
///
/// # Errors
/// As [`ViewPage::html`].
pub fn page(report: &PlayReport, mut scene: ViewScene) -> Result<String, Error> {
    let mut rows = vec![("outcome", report.headline()), ("retimed", retiming(report))];
    if report.cycles > 0 {
        let cycles = format!(
            "{} at {:.0} Hz, {} missed, {} late",
            report.cycles, report.cycle_hz, report.missed_cycles, report.late_cycles
        );
        rows.push(("cycles", cycles));
        rows.push(("line", format!("{:.0} % busy", 100.0 * report.bus_load)));
        rows.push(("tracking", tracking(report)));
    }
    rows.push(("duration", format!("{:.1} s", report.duration_s)));
    rows.extend(report.metrics.iter().flat_map(figures));
    rows.push(("made by", format!("gaitway {}", env!("CARGO_PKG_VERSION"))));
    let mut warnings: Vec<String> = report.stop_reason.iter().cloned().collect();
    if let Some(referee) = &report.referee {
        warnings.extend(referee.violations.iter().cloned());
    }
    let metrics = report.metrics.as_ref();
    if let Some(at_s) = metrics.and_then(|metrics| metrics.predicted_fall_s) {
        warnings.push(format!("a robot on its own feet would fall, at {at_s:.1} s"));
    }
    if let Some(physics) = &report.physics {
        warnings.extend(physics.fall.as_ref().map(Fall::words));
    }
    if let Some(reason) = &report.stop_reason {
        let end_s = scene.duration_s;
        scene.spans.push(ViewSpan::new(SpanKind::Wrong, "stopped", reason, end_s, end_s));
        let cycle = report.stop.as_ref().and_then(|stop| stop.cycle);
        let times_s = scene.joints.as_ref().map(|joints| joints.clock.times_s());
        if let Some(&at_s) = cycle.zip(times_s.as_ref()).and_then(|(at, all)| all.get(at as usize))
        {
            brakes(&mut scene.spans, at_s, end_s);
        }
    }
    let mut notes = report.notes.clone();
    if scene.robot.is_some() {
        let weighed = report.physics.as_ref().is_some_and(|physics| physics.is_drawn);
        notes.push(if weighed {
            "where the base is is where the virtual robot's weight and servos took it; of several \
             rounds of the person the first is told, and after it they stand still"
                .to_owned()
        } else {
            "where the base is is predicted from goals and soles; of several rounds the first is \
             told, and after it base and person stand still"
                .to_owned()
        });
    }
    let page = ViewPage {
        title: format!("{} on {}", report.motion, report.robot),
        summary_rows: rows.into_iter().map(|(label, text)| (label.to_owned(), text)).collect(),
        warnings,
        notes,
        scene,
    };
    page.html()
}

/// What the motion does to the body, as far as it is known.
fn figures(of: &BodyFigures) -> Vec<(&'static str, String)> {
    let mut rows = Vec::new();
    if let Some(share) = of.self_collision_share {
        let links = of.self_collision_links.as_ref();
        let worst = links.zip(of.self_collision_depth_m).map(|([one, two], depth_m)| {
            format!(", at most {:.0} mm ({one}, {two})", depth_m * 1e3)
        });
        let worst = worst.unwrap_or_default();
        rows.push(("touches itself", format!("{:.0} % of the clip{worst}", share * 1e2)));
    }
    if let Some(share) = of.unbalanced_share {
        rows.push(("out of balance", format!("{:.0} % of the time", share * 1e2)));
    }
    if let Some(slip_m_s) = of.slip_m_s {
        rows.push(("feet slide", format!("{:.1} cm/s while they stand", slip_m_s * 1e2)));
    }
    rows
}

/// The joint that followed worst.
fn tracking(report: &PlayReport) -> String {
    let measured = report.joints.iter().filter_map(|j| Some((j.tracking_rms_rad?, &j.name)));
    let worst = measured.max_by(|a, b| a.0.total_cmp(&b.0));
    worst.map_or_else(
        || "not measured".to_owned(),
        |(rms_rad, joint)| format!("at most {:.2}\u{b0} RMS ({joint})", rms_rad.to_degrees()),
    )
}

fn retiming(report: &PlayReport) -> String {
    match (&report.retime_joint, &report.retime_limit) {
        (Some(joint), Some(limit)) => {
            format!("x {:.3}, asked for by {joint} ({limit})", report.retime_factor)
        }
        _ => "not needed".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::Series;

    #[test]
    fn between_two_readings_a_joint_is_on_the_line_between_them_and_where_one_was_missed_nowhere() {
        let read = [0.0, f64::NAN, f64::NAN, 3.0, f64::NAN, 5.0, f64::NAN];
        let series = Series {
            began: None,
            time_s: (0..7).map(f64::from).collect(),
            goal_rad: Vec::new(),
            goal_velocity_rad_s: Vec::new(),
            present_rad: vec![read.to_vec()],
            missed: vec![(0..7).map(|at| at == 4).collect()],
            velocity_rad_s: Vec::new(),
            current_a: Vec::new(),
            load_ratio: Vec::new(),
            temperature_c: Vec::new(),
            voltage_v: Vec::new(),
        };
        let drawn: Vec<Option<f64>> = series
            .drawn_rad(0)
            .into_iter()
            .map(|value| Some(value).filter(|v| v.is_finite()))
            .collect();
        assert_eq!(drawn, [Some(0.0), Some(1.0), Some(2.0), Some(3.0), None, Some(5.0), None]);
    }
}
