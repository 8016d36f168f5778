//! Whoever a job is done for: hears what happens, and may want it to end.

use crate::body::JointAngles;
use crate::sensing::SensingEvent;
use serde::Serialize;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

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
}

/// Hears what happens during a job. Of it the loop that moves joints calls only
/// [`Observer::wants_to_stop`].
pub trait Observer: Sync {
    /// Something happened.
    fn hear(&self, event: Event<'_>) {
        let _ = event;
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
        self.meter.0.load(Ordering::Relaxed) as f64 / 1e3
    }

    /// From the first goal to the last, the approach included, s.
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

/// Time played so far, in milliseconds: written by the loop, read by another thread.
#[derive(Clone, Debug, Default)]
pub(super) struct Meter(Arc<AtomicU64>);

impl Meter {
    /// Says how far the motion is, s.
    pub(super) fn set(&self, seconds: f64) {
        // Non-negative and far below the range of u64.
        self.0.store((seconds * 1e3) as u64, Ordering::Relaxed);
    }
}
