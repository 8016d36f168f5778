//! Whoever a job is done for: hears what happens, and may want it to end.

use super::heard::{SensorNow, row};
use super::recognised::RecognitionEvent;
use crate::body::{JointAngles, SegmentPose};
use crate::device::{Health, JointState};
use crate::sensing::SensingEvent;
use crate::view::tracks::ViewSpan;
use glam::DQuat;
use serde::Serialize;
use std::fmt::Write as _;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

/// One joint at one time; absent: not read.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct JointReading {
    /// Its name.
    pub name: String,
    /// Its ID.
    pub id: u8,
    /// The goal that stands in its servo, rad.
    pub goal_rad: Option<f64>,
    /// Where it is, rad.
    pub present_rad: Option<f64>,
    /// How fast it turns, rad/s.
    pub velocity_rad_s: Option<f64>,
    /// Load by the servo's own word, 1 = full.
    pub load_ratio: Option<f64>,
    /// Current, A.
    pub current_a: Option<f64>,
    /// Temperature, degrees Celsius.
    pub temperature_c: Option<f64>,
    /// Supply, V.
    pub voltage_v: Option<f64>,
    /// True if it drives its motor.
    pub torque_on: Option<bool>,
    /// What the servo reports, or why it says nothing.
    pub error: Option<String>,
}

/// How a recording goes.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordingNow {
    /// Since it began, s.
    pub time_s: f64,
    /// How long it is to be, s, if that is known.
    pub of_s: Option<f64>,
    /// What ends it before, in words.
    pub ended_by: &'static str,
    /// Source by source, in the order in which they were opened.
    pub sources: Vec<SensorNow>,
    /// Messages that the disk was too slow for.
    pub dropped: u64,
    /// When the last mark was set, s, and its text.
    pub mark: Option<(f64, String)>,
    /// The note that is typed and not ended yet.
    pub note: String,
}

/// Of a mark so many letters are shown while it is recorded: the status is redrawn all the time.
const MARK_SHOWN: usize = 40;

impl RecordingNow {
    /// How it goes, for a person: its time and its last mark, then its sources, a line each.
    #[must_use]
    pub fn words(&self) -> String {
        let mut text = match self.of_s {
            Some(of_s) => format!("{:.0} of {of_s:.0} s", self.time_s),
            None => format!("{:.0} s; {} ends it", self.time_s, self.ended_by),
        };
        if let Some((at_s, words)) = &self.mark {
            let mut shown: String = words.chars().take(MARK_SHOWN).collect();
            if shown.len() < words.len() {
                shown.push('\u{2026}');
            }
            let _ = write!(text, "; last mark at {at_s:.1} s: {shown}");
        }
        // Above the sources: where a window is too low, the last lines are not seen.
        if !self.note.is_empty() {
            let _ = write!(text, "\n  note: {}", self.note);
        }
        for source in &self.sources {
            let rate_hz = source.rate_hz;
            let lost = match source.missed {
                0 => String::new(),
                missed => format!(", {missed} missing"),
            };
            let battery = source.battery.map(|level| format!(", battery {:.0} %", level * 100.0));
            let battery = battery.unwrap_or_default();
            let signal = source.signal_dbm.map(|dbm| format!(", receives {dbm} dBm"));
            let signal = signal.unwrap_or_default();
            // Why it is gone was said when it went.
            let silent = match source.gone {
                Some(_) => "gone".to_owned(),
                None => row(source).silent,
            };
            let silent = if silent.is_empty() { silent } else { format!(", {silent}") };
            let usual_hz = source.usual_rate_hz;
            let profile = source.own_rate_hz.map(|_| format!(" (its profile says {usual_hz})"));
            let profile = profile.unwrap_or_default();
            let name = &source.name;
            let _ = write!(
                text,
                "\n  {name:<16} {rate_hz:.0}/s{profile}{lost}{battery}{signal}{silent}"
            );
        }
        text
    }
}

/// What happens during a job, for whoever wants to know at once. The report at its end has all of
/// it once more.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Event<'a> {
    /// A choice that was made on the way.
    Note(&'a str),
    /// A way of that many seconds was planned and checked; torque comes next.
    Planned {
        /// From the first goal to the last, approach and motion, s.
        duration_s: f64,
        /// Of these the way to the motion's first pose, s.
        approach_s: f64,
        /// How much slower the motion is than it was asked for; 1 = as asked.
        retime_factor: f64,
    },
    /// What can be said of what was planned, by its own time; of what is played again and again, of the first round. Told to an
    /// observer who [looks](Observer::looks).
    Foreseen(&'a [ViewSpan]),
    /// The robot follows from now on, until it is told to stop or there is nothing more to follow.
    Following,
    /// The angles of a body, where no robot follows it.
    Angles {
        /// By degree of freedom, rad.
        angles: &'a JointAngles,
        /// By segment: true if a sensor tells.
        worn: &'a [bool; 13],
    },
    /// How every joint of a robot is that is looked at again and again.
    Joints {
        /// Since the first look, s.
        time_s: f64,
        /// In the order of the robot file.
        joints: &'a [JointReading],
    },
    /// What whoever wears sensors does, many times a second; told, as [`Event::Heard`], to an observer who
    /// [looks](Observer::looks).
    Posed {
        /// The pose.
        pose: &'a SegmentPose,
        /// By segment, how its sensor is turned in the same world; `None`: it is not worn, or says nothing.
        sensors: &'a [Option<DQuat>; 13],
        /// By degree of freedom, rad.
        angles: &'a JointAngles,
        /// When the oldest of its sensors was read, so long ago, s.
        age_s: f64,
    },
    /// How sources are heard, twice a second, on a thread of its own.
    Heard(&'a [SensorNow]),
    /// So many of so many steps are done.
    Step {
        /// Done.
        done: u64,
        /// All.
        total: u64,
        /// What comes next, in a word or two.
        what: &'a str,
    },
    /// Something that happened to a sensor.
    Sensing(SensingEvent<'a>),
    /// How a recording goes, twice a second.
    Recording(&'a RecordingNow),
    /// Something of what a body does that was recognised now.
    Recognised(&'a RecognitionEvent),
}

/// Hears what happens during a job. Of it the loop that moves joints calls only
/// [`Observer::wants_to_stop`].
pub trait Observer: Sync {
    /// Something happened.
    fn hear(&self, event: Event<'_>) {
        let _ = event;
    }

    /// True if somebody wants to see all the time how things are.
    fn looks(&self) -> bool {
        false
    }

    /// True once the job is to end. What moves is led to rest, and torque stays on. Asked in every
    /// cycle, and before the first one at each step of checking and arming, so it must not wait.
    fn wants_to_stop(&self) -> bool {
        false
    }

    /// Called once on the thread that asked for the job while joints move. It must return when
    /// [`Progress::is_over`] says so, and sleep between its looks. Virtual time does not wait for it.
    fn watch(&self, progress: &Progress<'_>) {
        let _ = progress;
    }
}

/// Nobody looks on: the job runs to its end.
#[derive(Clone, Copy, Debug, Default)]
pub struct Nobody;

impl Observer for Nobody {}

/// How far a motion is.
pub struct Progress<'a> {
    pub(super) meter: &'a Meter,
    pub(super) duration_s: f64,
    pub(super) is_over: &'a dyn Fn() -> bool,
}

impl Progress<'_> {
    /// Time since the first cycle, the approach included, s: see [`Event::Planned`] for how much that is.
    #[must_use]
    pub fn time_s(&self) -> f64 {
        self.snapshot().time_s()
    }

    /// What the loop last wrote down, to be read elsewhere.
    #[must_use]
    pub fn snapshot(&self) -> Snapshot {
        Snapshot(self.meter.clone())
    }

    /// From the first goal to the last, the approach included, s; infinite if nobody knows.
    #[must_use]
    pub const fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// True once nothing moves any more.
    #[must_use]
    pub fn is_over(&self) -> bool {
        (self.is_over)()
    }
}

/// What the loop last wrote down, for another thread to read. Neither waits for the other: the loop
/// stores numbers, and whoever reads finds the newest of each.
#[derive(Clone, Debug, Default)]
pub(super) struct Meter {
    /// Time played so far, ms.
    time_ms: Arc<AtomicU64>,
    /// Of each joint its goal and its angle, rad, as two `f32` in one word: they belong together.
    joints: Arc<[AtomicU64]>,
    /// Of each joint what else was read and not yet taken, as `f32`: see [`OtherReading`].
    others: Arc<[[AtomicU32; 4]]>,
    /// Of each joint how many readings were missed.
    missed: Arc<[AtomicU32]>,
}

/// What else was read of a joint; NaN: nothing new.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OtherReading {
    /// Motor current, A.
    pub current_a: f64,
    /// Output as a share of full drive.
    pub load_ratio: f64,
    /// Temperature inside, degrees Celsius.
    pub temperature_c: f64,
    /// Supply, V.
    pub voltage_v: f64,
}

impl Meter {
    /// A meter of so many joints.
    pub(super) fn of(joints: usize) -> Self {
        let unread = |_| AtomicU64::new(word(f32::NAN, f32::NAN));
        let nothing = |_| [(); 4].map(|()| AtomicU32::new(f32::NAN.to_bits()));
        Self {
            time_ms: Arc::default(),
            joints: (0..joints).map(unread).collect(),
            others: (0..joints).map(nothing).collect(),
            missed: (0..joints).map(|_| AtomicU32::default()).collect(),
        }
    }

    /// Says how far the motion is, s.
    pub(super) fn set(&self, seconds: f64) {
        // Non-negative and far below the range of u64.
        self.time_ms.store((seconds * 1e3) as u64, Ordering::Relaxed);
    }

    /// Says where a joint is to be and is, rad; NaN: not known.
    pub(super) fn set_joint(&self, joint: usize, goal_rad: f64, present_rad: f64) {
        if let Some(place) = self.joints.get(joint) {
            place.store(word(goal_rad as f32, present_rad as f32), Ordering::Relaxed);
        }
    }

    /// Says what else was read of a joint with its angle.
    pub(super) fn set_state(&self, joint: usize, state: &JointState) {
        let JointState { current_a, load_ratio, temperature_c, voltage_v, .. } = *state;
        self.set_others(joint, [current_a, load_ratio, temperature_c, voltage_v]);
    }

    /// Says what was read of a joint now and then.
    pub(super) fn set_health(&self, joint: usize, health: &Health) {
        self.set_others(joint, [None, None, health.temperature_c, health.voltage_v]);
    }

    fn set_others(&self, joint: usize, read: [Option<f64>; 4]) {
        let Some(places) = self.others.get(joint) else { return };
        for (place, value) in places.iter().zip(read) {
            if let Some(value) = value {
                place.store((value as f32).to_bits(), Ordering::Relaxed);
            }
        }
    }

    /// Says that a joint was asked and did not answer.
    pub(super) fn missed(&self, joint: usize) {
        if let Some(count) = self.missed.get(joint) {
            count.fetch_add(1, Ordering::Relaxed);
        }
    }
}

const fn word(goal_rad: f32, present_rad: f32) -> u64 {
    (goal_rad.to_bits() as u64) << 32 | present_rad.to_bits() as u64
}

/// What a moving robot's loop last wrote down. It may be read from any thread, at any time.
#[derive(Clone, Debug)]
pub struct Snapshot(Meter);

impl Snapshot {
    /// Time since the first cycle, s.
    #[must_use]
    pub fn time_s(&self) -> f64 {
        self.0.time_ms.load(Ordering::Relaxed) as f64 / 1e3
    }

    /// Of each joint, in the robot's order, its goal and its measured angle, rad; NaN: not known.
    pub fn joints_rad(&self) -> impl Iterator<Item = [f64; 2]> {
        self.0.joints.iter().map(|place| {
            let word = place.load(Ordering::Relaxed);
            [(word >> 32) as u32, word as u32].map(|bits| f64::from(f32::from_bits(bits)))
        })
    }

    /// Of each joint what else was read since this was asked last, by anybody.
    pub fn take_readings(&self) -> impl Iterator<Item = OtherReading> {
        self.0.others.iter().map(|places| {
            let nothing = f32::NAN.to_bits();
            let take = |place: &AtomicU32| {
                f64::from(f32::from_bits(place.swap(nothing, Ordering::Relaxed)))
            };
            let [current_a, load_ratio, temperature_c, voltage_v] = places.each_ref().map(take);
            OtherReading { current_a, load_ratio, temperature_c, voltage_v }
        })
    }

    /// Of each joint how many of its readings were missed so far.
    pub fn missed(&self) -> impl Iterator<Item = u32> {
        self.0.missed.iter().map(|count| count.load(Ordering::Relaxed))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_tells_of_each_source_what_it_tells_of_itself() {
        let sensor = |name: &str, battery, signal_dbm, gone: Option<&str>| SensorNow {
            name: name.to_owned(),
            rate_hz: 99.6,
            usual_rate_hz: 100.0,
            own_rate_hz: None,
            samples: 400,
            missed: 3,
            silent_s: Some(0.0),
            stuck: false,
            battery,
            signal_dbm,
            gone: gone.map(str::to_owned),
        };
        let now = RecordingNow {
            time_s: 4.0,
            of_s: None,
            ended_by: "a dot",
            sources: vec![
                sensor("head", Some(0.81), Some(-61), None),
                sensor("torso", None, None, Some("pulled out")),
                SensorNow {
                    rate_hz: 0.0,
                    silent_s: Some(2.6),
                    ..sensor("pelvis", None, None, None)
                },
            ],
            dropped: 0,
            mark: Some((2.5, "2 good, 0 bad".to_owned())),
            note: "the pho".to_owned(),
        };
        let lines = [
            "4 s; a dot ends it; last mark at 2.5 s: 2 good, 0 bad",
            "  note: the pho",
            "  head             100/s, 3 missing, battery 81 %, receives -61 dBm",
            "  torso            100/s, 3 missing, gone",
            "  pelvis           0/s, 3 missing, silent for 3 s",
        ];
        assert_eq!(now.words(), lines.join("\n"));
    }

    #[test]
    fn a_snapshot_has_the_newest_of_each_joint_and_gaps_where_nothing_was_read() {
        let meter = Meter::of(3);
        let snapshot = Snapshot(meter.clone());
        meter.set(1.25);
        meter.set_joint(0, 0.5, -0.25);
        meter.set_joint(1, -1.5, f64::NAN);
        meter.set_joint(1, -1.0, f64::NAN);
        meter.set_joint(7, 1.0, 1.0);
        assert!((snapshot.time_s() - 1.25).abs() < 1e-9);
        let joints: Vec<[f64; 2]> = snapshot.joints_rad().collect();
        assert_eq!(joints[0], [0.5, -0.25]);
        assert!(joints[1][0] == -1.0 && joints[1][1].is_nan());
        assert!(joints[2].iter().all(|rad| rad.is_nan()));
    }

    #[test]
    fn what_else_was_read_is_told_once_and_what_was_not_read_again_stays_untold() {
        let meter = Meter::of(2);
        let snapshot = Snapshot(meter.clone());
        let state = JointState { current_a: Some(0.25), ..JointState::default() };
        meter.set_state(1, &state);
        meter.set_health(1, &Health { temperature_c: Some(40.0), ..Health::default() });
        meter.missed(0);
        let told: Vec<OtherReading> = snapshot.take_readings().collect();
        assert!(told[0].current_a.is_nan() && told[1].load_ratio.is_nan());
        assert_eq!((told[1].current_a, told[1].temperature_c), (0.25, 40.0));
        meter.set_health(1, &Health { voltage_v: Some(12.0), ..Health::default() });
        let told: Vec<OtherReading> = snapshot.take_readings().collect();
        assert!(told[1].current_a.is_nan() && told[1].temperature_c.is_nan());
        assert_eq!(told[1].voltage_v, 12.0);
        assert_eq!(snapshot.missed().collect::<Vec<_>>(), [1, 0]);
    }
}
