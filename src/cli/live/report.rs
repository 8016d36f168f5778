//! What `live` tells beyond what every run tells.

use crate::body::Segment;
use crate::cli::report::PlayReport;
use crate::control::{Mirror, Settings};
use serde::Serialize;
use std::fmt::Write;

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
    /// How far goals ran behind the body because of the joints' limits, s; null if nothing moved.
    pub lag_s: Option<f64>,
    /// Null if no pose was followed.
    pub latency: Option<LatencyReport>,
    /// Time on the way to the body's pose, at a share of the limits, s.
    pub approaching_s: f64,
    /// Time following, s.
    pub following_s: f64,
    /// Time without a fresh pose: braking, or at rest, s.
    pub stale_s: f64,
}

fn by_name<S: serde::Serializer>(worn: &[bool; 13], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(
        Segment::ALL
            .map(|segment| (crate::mocap::mapping::segment_name(segment), worn[segment.index()])),
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
        }
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

    /// The report as lines for a person; `brief` leaves the notes out.
    pub fn text(&self, brief: bool) -> String {
        let mut out = self.run.text(brief);
        if self.run.cycles == 0 {
            return out;
        }
        let ms = |seconds: Option<f64>| {
            seconds.map_or_else(|| "-".to_owned(), |s| format!("{:.1} ms", s * 1e3))
        };
        let _ = writeln!(
            out,
            "following {:.2} s, approach {:.2} s, without a fresh pose {:.2} s",
            self.following_s, self.approaching_s, self.stale_s
        );
        let _ = writeln!(
            out,
            "behind    {} by limits ({} samples limited); poses {} old, p99 {}",
            ms(self.lag_s),
            self.limited_samples,
            ms(self.latency.map(|latency| latency.median_s)),
            ms(self.latency.map(|latency| latency.p99_s))
        );
        out
    }
}
