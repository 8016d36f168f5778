//! What the files of a session say.

use super::plan::Plan;
use super::tap::Tap;
use crate::body::worn::strap::StrapDirection;
use crate::time::Utc;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Version of the files of a session.
pub const SCHEMA: u32 = 1;

/// `session.toml`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SessionFile {
    /// Version of the format; 1.
    pub schema: u32,
    /// Name of the session.
    pub name: String,
    /// When it was begun.
    pub begun: Utc,
    /// Who leads it.
    #[serde(default)]
    pub operator: String,
    /// Where it is.
    #[serde(default)]
    pub place: String,
    /// Anything else.
    #[serde(default)]
    pub remarks: String,
    /// Sources as they are given to `record`, each with its name.
    pub sources: Vec<String>,
    /// Trackers that name themselves, each with the name it goes by here.
    #[serde(default)]
    pub wear: BTreeMap<String, String>,
    /// By the name a sensor goes by here, what of it points forward in N pose; X of all others.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub forward: BTreeMap<String, StrapDirection>,
    /// True if headings are told from the magnetic field where there is one.
    #[serde(default)]
    pub magnetometer: bool,
    /// Ids of the subjects; files say the rest.
    pub subjects: Vec<String>,
    /// Actions that could not be done: what is there of them is all there will be.
    #[serde(default)]
    pub skipped: Vec<String>,
    /// What is to be recorded.
    pub plan: Plan,
    /// Version of the program that began it.
    pub gaitway_version: String,
}

/// `calibration/device-NN.toml`: one look at all sensors lying still.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DeviceCheck {
    /// Version of the format; 1.
    pub schema: u32,
    /// When it was made.
    pub made: Utc,
    /// Until when it is trusted.
    pub expires: Utc,
    /// True if every sensor passed.
    pub passed: bool,
    /// Why it is used although a sensor did not pass, in the operator's words.
    #[serde(default)]
    pub accepted_because: String,
    /// Sensor by sensor.
    #[serde(default, rename = "sensor")]
    pub sensors: Vec<SensorCheck>,
}

/// What was measured of one sensor lying still.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorCheck {
    /// Name of the source.
    pub name: String,
    /// True if nothing is wrong.
    pub passed: bool,
    /// What is wrong.
    #[serde(default)]
    pub why: Vec<String>,
    /// Samples that came.
    pub samples: u64,
    /// Samples known to be missing.
    pub missed: u64,
    /// From the first to the last, s.
    pub duration_s: f64,
    /// Samples per second of the host's clock.
    pub rate_hz: f64,
    /// Samples per second by the profile.
    pub nominal_rate_hz: f64,
    /// Angular rate less its mean, root mean square, rad/s.
    pub noise_rad_s: Option<f64>,
    /// Length of the mean angular rate, rad/s.
    pub bias_rad_s: Option<f64>,
    /// Length of the mean acceleration, m/s^2.
    pub acceleration_m_s2: Option<f64>,
    /// Acceleration less its mean, root mean square, m/s^2.
    pub acceleration_noise_m_s2: Option<f64>,
    /// How fast the fused heading turned, rad/s.
    pub heading_drift_rad_s: Option<f64>,
}

/// `calibration/body-ID-NN-check.toml`: how well it is known how sensors sit on a subject. How they
/// sit stands in `body-ID-NN.toml`, which `gaitway live` takes as well.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BodyCheck {
    /// Version of the format; 1.
    pub schema: u32,
    /// Id of the subject.
    pub subject: String,
    /// When it was made.
    pub made: Utc,
    /// Until when it is trusted.
    pub expires: Utc,
    /// True if it may be used.
    pub passed: bool,
    /// Sensors that were calibrated.
    pub sensors: u64,
    /// Largest error of a segment in T pose, rad.
    pub worst_rad: Option<f64>,
    /// Error in T pose by segment, rad.
    pub off_t_pose_rad: BTreeMap<String, f64>,
    /// What a person should know.
    #[serde(default)]
    pub notes: Vec<String>,
}

/// Under this key a recording's metadata holds how its sensors were worn: the text of a
/// [`Kept`](crate::body::worn::kept::Kept) calibration.
pub const BODY_KEY: &str = "body_calibration";
/// Under this key it holds where its sensors were worn and which way, where nobody was calibrated: the text of a file that says what is
/// worn ([`Wear`](crate::sensing::Wear)).
pub const WORN_KEY: &str = "worn";
/// Under this key it holds the stature of whoever wore them, m.
pub const STATURE_KEY: &str = "stature_m";
/// Under this key the length of their legs, if that was measured, m.
pub const LEGS_KEY: &str = "leg_length_m";

/// What was thought of a trial.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Part of the database.
    Keep,
    /// Not used, but not thrown away.
    Retake,
}

/// `trials/NAME-NN.toml`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrialFile {
    /// Version of the format; 1.
    pub schema: u32,
    /// Name of the action.
    pub action: String,
    /// Number of the trial of this action, from 1.
    pub number: u32,
    /// When it was judged.
    pub judged: Utc,
    /// Keep or retake.
    pub verdict: Verdict,
    /// Good repetitions in it; none count of a trial that is to be retaken.
    pub good_repetitions: u32,
    /// What happened.
    #[serde(default)]
    pub notes: String,
    /// What was held or used.
    #[serde(default)]
    pub props: String,
    /// False if the recording ended without being closed: its last second may be missing.
    pub closed: bool,
    /// Samples known to be missing in it.
    pub missed_samples: u64,
    /// How long it is, s.
    pub duration_s: f64,
    /// Recordings, one for each subject.
    #[serde(rename = "recording")]
    pub recordings: Vec<TrialRecording>,
    /// Taps that several sensors felt: whether their times agree.
    #[serde(default, rename = "tap")]
    pub taps: Vec<Tap>,
}

/// One subject's part of a trial.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrialRecording {
    /// Id of the subject.
    pub subject: String,
    /// The file, in the session's folder.
    pub file: String,
}

impl TrialFile {
    /// Name of a trial: of its files without ending.
    #[must_use]
    pub fn name(&self) -> String {
        trial_name(&self.action, self.number)
    }

    /// Repetitions that count.
    #[must_use]
    pub const fn counted(&self) -> u32 {
        match self.verdict {
            Verdict::Keep => self.good_repetitions,
            Verdict::Retake => 0,
        }
    }
}

/// `wave-r-03`.
#[must_use]
pub fn trial_name(action: &str, number: u32) -> String {
    format!("{action}-{number:02}")
}

/// Action and number of a trial's name.
#[must_use]
pub fn trial_of(name: &str) -> Option<(&str, u32)> {
    let (action, number) = name.rsplit_once('-')?;
    let digits = number.bytes().all(|b| b.is_ascii_digit());
    (digits && number.len() >= 2).then(|| Some((action, number.parse().ok()?)))?
}
