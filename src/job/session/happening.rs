//! What happens during a session.

use crate::body::{Proportions, SegmentPose};
use crate::error::Error;
use crate::job::heard::SensorNow;
use crate::sensing::SensingEvent;
use crate::session::tap::Tap;
use crate::session::{
    BodyCheck, DeviceCheck, PlannedAction, SensorCheck, SessionFile, Step, TrialFile,
};
use crate::time::Utc;
use glam::DQuat;
use std::collections::BTreeMap;

/// Something that whoever leads a session is told. What is in the session's files afterwards stands
/// there once more.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Happening<'a> {
    /// A session that was begun before goes on where it was.
    GoingOn(&'a SessionFile),
    /// A new session: what it is to be is asked next.
    NewSession,
    /// All that is to be done, in its order; the first of it is done now.
    Ahead {
        /// What the session is, once that is known.
        session: Option<&'a SessionFile>,
        /// Each step.
        steps: &'a [Step],
    },
    /// The answer before cannot be used, and is asked for once more.
    Refused(&'a Error),
    /// The measures of a subject are asked next.
    Measures {
        /// Id of the subject.
        subject: &'a str,
    },
    /// The measures of a subject were taken in another session: they are not asked.
    KnownSubject {
        /// Id of the subject.
        subject: &'a str,
    },
    /// What was answered before is asked again: an empty answer leaves it as it is.
    Editing {
        /// `session`, or the id of a subject.
        what: &'a str,
    },
    /// How that is which is asked next.
    AsItIs {
        /// In words; empty: nothing was said.
        words: &'a str,
    },
    /// Sensors that lie still are listened to.
    MeasuringStill {
        /// For so long, s.
        seconds: f64,
    },
    /// What was measured of a sensor that lay still.
    SensorChecked(&'a SensorCheck),
    /// A calibration that may be used was written.
    Written {
        /// The file, in the session's folder.
        file: &'a str,
        /// Until when it is trusted.
        holds_until: Utc,
    },
    /// How far segments are from where they belong in T pose.
    InTPose {
        /// The largest of them, rad.
        worst_rad: f64,
    },
    /// A subject is led into N pose before a trial, to find headings anew.
    FacingForward {
        /// Id of the subject.
        subject: &'a str,
    },
    /// The next trial is of this action.
    NextTrial {
        /// Number of the action in the plan, from 1.
        number: usize,
        /// Actions in the plan.
        total: usize,
        /// What is to be done.
        action: &'a PlannedAction,
        /// Ids of those who do it.
        subjects: &'a [String],
        /// Good repetitions so far.
        good: u32,
        /// Good repetitions wanted.
        wanted: u32,
    },
    /// No figure shows how the action is done; told on a thread of its own.
    NotShown(&'a Error),
    /// A trial is recorded from now on.
    Recording {
        /// Name of the trial.
        trial: &'a str,
    },
    /// A mark was taken.
    Marked {
        /// The words of a note; `None`: a repetition.
        note: Option<&'a str>,
        /// Good repetitions that were marked so far.
        good: u32,
        /// Bad ones.
        bad: u32,
        /// For so long the trial is recorded, s.
        time_s: f64,
    },
    /// The trial ends before anybody said so.
    CutShort(CutShort<'a>),
    /// Some of the trial is not in its recording: the disk could not keep up, or failed.
    NotAllRecorded,
    /// A trial was recorded before and is judged only now.
    Unjudged {
        /// Name of the trial.
        trial: &'a str,
    },
    /// A recording of the trial cannot be read: it was cut off before its first byte, or is damaged.
    Unreadable(&'a Error),
    /// What is in a trial that was recorded; it is judged next.
    Recorded(&'a RecordedTrial),
    /// What became of something that was calibrated or recorded.
    Settled(Settled<'a>),
    /// All actions are recorded: joint angles are made.
    Finishing,
    /// Joint angles of a recording were written into these files.
    Angles {
        /// The files, in the session's folder.
        files: &'a [String],
    },
    /// There are no joint angles of a recording.
    NoAngles {
        /// The recording, in the session's folder.
        recording: &'a str,
        /// Why.
        error: &'a Error,
    },
    /// What is asked for now cannot be written into `now.json`: whoever reads it there does not know it. Told once.
    NotAnnounced(&'a Error),
    /// Something that happened to a sensor; told on that sensor's thread.
    Sensing(SensingEvent<'a>),
    /// How the sensors are heard, twice a second; told on a thread of its own to an operator who
    /// [looks](super::Operator::looks).
    Heard(&'a [SensorNow]),
    /// What whoever wears the sensors does, as they say; told as [`Happening::Heard`] is, many times a second.
    Posed {
        /// Which of the subjects, from 0.
        subject: usize,
        /// The pose.
        pose: &'a SegmentPose,
        /// By segment, how its sensor is turned in the same world; `None`: it is not worn, or says nothing.
        sensors: &'a [Option<DQuat>; 13],
        /// Whose it is.
        body: &'a Proportions,
    },
}

/// What became of something.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Settled<'a> {
    /// Of a device calibration.
    Devices(&'a DeviceCheck),
    /// Of a calibration of a subject.
    Body(&'a BodyCheck),
    /// Of a trial.
    Trial(&'a TrialFile),
}

/// Why a trial ends before anybody said so.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CutShort<'a> {
    /// Nothing more can be written.
    Disk {
        /// Why, in words.
        cause: &'a str,
    },
    /// There will be no more of a sensor.
    Sensor {
        /// Its name.
        name: &'a str,
        /// Why, in words.
        why: &'a str,
    },
}

/// What is in a trial.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedTrial {
    /// Name of the trial.
    pub trial: String,
    /// Its recordings, one for each subject.
    pub parts: Vec<TrialPart>,
    /// What is wrong with it; empty is right.
    pub faults: Vec<TrialFault>,
    /// Taps that several sensors felt.
    pub taps: Vec<Tap>,
}

/// One subject's recording of a trial.
#[derive(Clone, Debug, PartialEq)]
pub struct TrialPart {
    /// From the first to the last message, s.
    pub duration_s: f64,
    /// Samples by sensor.
    pub samples: BTreeMap<String, usize>,
}

/// What may be wrong with a trial.
#[derive(Clone, Debug, PartialEq)]
pub enum TrialFault {
    /// Its recording was not closed: its last second may be missing.
    CutOff,
    /// Samples are missing in it.
    Missing {
        /// How many are known to be.
        samples: u64,
    },
    /// For some time nothing came of a sensor, and nobody knows how much is missing: the computer stood.
    Hole {
        /// Name of the sensor; the one that was silent for longest.
        sensor: String,
        /// From when on, s.
        from_s: f64,
        /// For so long, s.
        seconds: f64,
    },
    /// Nothing of a sensor that is worn is in it.
    Unheard {
        /// Name of the sensor.
        sensor: String,
    },
    /// Two sensors seem to be on one another's segments, as the trial shows.
    Swapped {
        /// Which, and why, in words.
        what: String,
    },
    /// Sensors say what a body cannot do.
    Doubted {
        /// Which, when and why, in words.
        what: Vec<String>,
        /// For so long, all of them together, s.
        seconds: f64,
    },
    /// A sensor says nothing at its end.
    Silent {
        /// Name of the sensor.
        sensor: String,
        /// For so long, s.
        seconds: f64,
    },
}

/// Doubts of less than this do not spoil a trial, s: a knock is one of 0.8 s.
const SLIGHT_S: f64 = 1.5;

impl TrialFault {
    /// True if the trial is as good as ever, but for a moment.
    #[must_use]
    pub fn is_slight(&self) -> bool {
        matches!(self, Self::Doubted { seconds, .. } if *seconds < SLIGHT_S)
    }
}
