//! What `live` tells beyond what every run tells.

use super::onto_robot::{self, OntoRobot};
use super::when::AnswersReport;
use crate::body::segment_name;
use crate::body::{Dof, JointAngles, Segment};
use crate::control::{BalanceFigures, Mirror, Settings};
use crate::job::recognised::RecognisedAction;
use crate::job::report::PlayReport;
use crate::retarget::adjust::Lifts;
use crate::sensing::{Guided, SourceReport};
use crate::time::Utc;
use serde::Serialize;
use std::collections::BTreeMap;

/// One joint that followed.
#[derive(Clone, Debug, Serialize)]
pub struct LiveJoint {
    /// Joint name.
    pub name: String,
    /// Cycles in which its limits kept it more than 0.01 rad from what the body did.
    pub limited_samples: u64,
}

/// Time from a motion to the goal it led to: the age of the newest pose when a goal was written.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct LatencyReport {
    /// Half of all goals are faster, s.
    pub median_s: f64,
    /// One of a hundred is slower, s.
    pub p99_s: f64,
}

/// Everything `live` reports: the fields of `play`, and these.
#[derive(Clone, Debug, Serialize)]
pub struct LiveReport {
    /// As for `play`.
    #[serde(flatten)]
    pub run: PlayReport,
    /// By segment of the body: false if nothing is known of it, and it was taken to be at rest.
    #[serde(serialize_with = "by_name")]
    pub worn: [bool; 13],
    /// Sum over all joints.
    pub limited_samples: u64,
    /// Joint by joint.
    pub limited: Vec<LiveJoint>,
    /// How far goals ran behind the body because of the joints' limits, s; null if nothing moved. Of several stretches of
    /// following the most, also of `latency`.
    pub lag_s: Option<f64>,
    /// Null if no pose was followed.
    pub latency: Option<LatencyReport>,
    /// Time on the way to the body's pose, at a share of the limits, s.
    pub approaching_s: f64,
    /// Time following, s.
    pub following_s: f64,
    /// Time without a fresh pose: braking, or at rest, s.
    pub stale_s: f64,
    /// How sensors sit on the body; null if none are worn.
    pub body: Option<BodyReport>,
    /// What came from each sensor.
    pub sensors: Vec<SourceReport>,
    /// How often a robot on its own feet lifted one, and did not although the person did.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub feet: Option<Lifts>,
    /// How often a joint of a leader leapt for a single reading, which was not followed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub leaps: Option<u64>,
    /// The last angles of the body, by degree of freedom, rad, where they were only shown.
    pub angles_rad: Option<BTreeMap<&'static str, f64>>,
    /// What the person did, if it was to be named, at most 10,000 actions; times count from when the body was first looked at.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub events: Option<Vec<RecognisedAction>>,
    /// What the robot played because of what the person did, if it was to.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub answers: Option<AnswersReport>,
}

/// A body that wears sensors.
#[derive(Clone, Debug, Serialize)]
pub struct BodyReport {
    /// Who.
    pub subject: String,
    /// When it was calibrated, UTC.
    pub calibrated: String,
    /// Sensors that seem to be on another segment than was said.
    pub doubts: Vec<String>,
    /// Heading resets that were asked for.
    pub heading_resets: u64,
    /// Sensor by sensor.
    pub sensors: Vec<MountReport>,
}

/// One sensor on a body.
#[derive(Clone, Debug, Serialize)]
pub struct MountReport {
    /// The segment that wears it.
    pub segment: &'static str,
    /// Its name.
    pub sensor: String,
    /// How its heading was found: `movement`, `t_pose`, `leaning` or `strapping`.
    pub heading_by: &'static str,
    /// Second over first principal component of how it leaned.
    pub consistency: Option<f64>,
    /// Heading by strapping minus the heading found, rad.
    pub strapped_off_rad: Option<f64>,
    /// How far the segment was from where it belongs in T pose, rad; null if that was not seen.
    pub off_t_pose_rad: Option<f64>,
    /// Heading that the joints mended, rad; null where no joint tells.
    pub drift_corrected_rad: Option<f64>,
    /// The same per time, rad/s; null in the first ten seconds.
    pub drift_rad_s: Option<f64>,
    /// Heading taken by resets, rad.
    pub heading_reset_rad: f64,
    /// Time in which its newest sample was too old to be followed, s.
    pub stale_s: f64,
    /// How often it began anew, and its heading elsewhere.
    pub heading_lost: u64,
    /// How often it said what cannot be, and its segment waited.
    pub doubted: u64,
    /// For how long, s.
    pub doubted_s: f64,
    /// How often it was lost, where the robot was to keep going: gone, or silent for a second.
    pub lost: u64,
    /// For how long, s.
    pub lost_s: f64,
}

impl BodyReport {
    /// What a calibration tells.
    pub fn of(guided: &Guided) -> Self {
        let kept = &guided.kept;
        let off = |segment| {
            guided.off_t_pose_rad.iter().find(|(at, _)| *at == segment).map(|(_, rad)| *rad)
        };
        let mounts = kept.calibration.mounts.iter().zip(&kept.sensors);
        let mounts = mounts.map(|(mount, sensor)| MountReport {
            segment: segment_name(mount.segment),
            sensor: sensor.clone(),
            heading_by: mount.heading_by.word(),
            consistency: mount.consistency,
            strapped_off_rad: mount.strapped_off_rad,
            off_t_pose_rad: off(mount.segment),
            drift_corrected_rad: None,
            drift_rad_s: None,
            heading_reset_rad: 0.0,
            stale_s: 0.0,
            heading_lost: 0,
            doubted: 0,
            doubted_s: 0.0,
            lost: 0,
            lost_s: 0.0,
        });
        Self {
            subject: kept.subject.clone(),
            calibrated: Utc(kept.made_unix_s).to_string(),
            doubts: guided.doubts.clone(),
            heading_resets: 0,
            sensors: mounts.collect(),
        }
    }
}

/// Angles by the names of the degrees of freedom, rad.
pub fn angles_by_name(angles: JointAngles) -> BTreeMap<&'static str, f64> {
    Dof::ALL.into_iter().map(|dof| (dof.name(), angles[dof])).collect()
}

fn by_name<S: serde::Serializer>(worn: &[bool; 13], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(
        Segment::ALL.map(|segment| (crate::body::segment_name(segment), worn[segment.index()])),
    )
}

impl LiveReport {
    /// A report of nothing yet.
    pub fn new(run: PlayReport) -> Self {
        Self {
            run,
            worn: [false; 13],
            limited_samples: 0,
            limited: Vec::new(),
            lag_s: None,
            latency: None,
            approaching_s: 0.0,
            following_s: 0.0,
            stale_s: 0.0,
            body: None,
            sensors: Vec::new(),
            feet: None,
            leaps: None,
            angles_rad: None,
            events: None,
            answers: None,
        }
    }

    /// Takes up a later stretch of following: counts and times are sums, latency and lag the greatest.
    pub fn take_up(&mut self, later: Self) {
        let greatest = |one: Option<f64>, other: Option<f64>| match (one, other) {
            (Some(one), Some(other)) => Some(one.max(other)),
            (one, other) => one.or(other),
        };
        self.limited_samples += later.limited_samples;
        for (joint, other) in self.limited.iter_mut().zip(&later.limited) {
            joint.limited_samples += other.limited_samples;
        }
        self.lag_s = greatest(self.lag_s, later.lag_s);
        self.latency = match (self.latency, later.latency) {
            (Some(one), Some(other)) => Some(LatencyReport {
                median_s: one.median_s.max(other.median_s),
                p99_s: one.p99_s.max(other.p99_s),
            }),
            (one, other) => one.or(other),
        };
        if let (Some(all), Some(later)) = (&mut self.feet, later.feet) {
            all.lifted += later.lifted;
            all.kept_down += later.kept_down;
        }
        self.approaching_s += later.approaching_s;
        self.following_s += later.following_s;
        self.stale_s += later.stale_s;
        self.run.take_up(later.run);
        self.run.approach_s = self.approaching_s;
    }

    /// Takes what became of the feet, and the way to the first pose that was none of the follower's.
    pub(super) fn describe_feet(&mut self, onto: &OntoRobot<'_>) {
        let arriving_s = onto.arriving_s().min(self.following_s);
        self.following_s -= arriving_s;
        self.approaching_s += arriving_s;
        self.run.approach_s = self.approaching_s;
        self.feet = onto.lifts();
    }

    /// Says what became of feet and of balance, where there are any.
    pub(super) fn describe_body(&mut self) {
        self.run.notes.extend(self.feet.and_then(onto_robot::note));
        self.run.notes.extend(self.run.balance.as_ref().map(BalanceFigures::words));
    }

    /// Takes the follower's figures.
    pub fn describe(&mut self, mirror: &Mirror<'_>, settings: Settings) {
        let tally = mirror.tally();
        let period_s = settings.period.as_secs_f64();
        self.limited_samples = tally.limited_samples.iter().sum();
        self.lag_s = tally.lag_s();
        self.latency = mirror
            .latency()
            .map(|latency| LatencyReport { median_s: latency.median_s, p99_s: latency.p99_s });
        self.approaching_s = tally.approach_samples as f64 * period_s;
        self.following_s = tally.followed_samples as f64 * period_s;
        self.stale_s = tally.stale_samples as f64 * period_s;
        self.run.approach_s = self.approaching_s;
    }
}
