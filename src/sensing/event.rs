//! What happens while sensors are heard.

use crate::capture::{Captured, Order};
use crate::port::Clock;
use crate::time::Instant;
use crate::wire::natnet::Version;
use glam::{DQuat, DVec3};
use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;

/// Something that whoever set the sensors up may want to know at once.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum SensingEvent<'a> {
    /// A sensor has sent no byte since it was opened.
    NothingComes {
        /// Its name.
        sensor: &'a str,
    },
    /// A sensor sends bytes, but none of its profile's packets.
    NoPackets {
        /// Its name.
        sensor: &'a str,
        /// Its profile.
        profile: &'a str,
        /// The speed of its line, bit/s.
        baud_bps: u32,
    },
    /// A source is gone, for good or until it is there again.
    Gone {
        /// Its name.
        sensor: &'a str,
        /// Why, in words.
        why: &'a str,
    },
    /// A source that was gone is there again.
    Back {
        /// Its name.
        sensor: &'a str,
        /// For how long it was gone, s.
        gone_s: f64,
    },
    /// The values of a sensor stand still while its number or time goes on.
    Stuck {
        /// Its name.
        sensor: &'a str,
    },
    /// A sensor that stood still measures again.
    Unstuck {
        /// Its name.
        sensor: &'a str,
    },
    /// A sensor samples at another rate than was known: than its profile says, or than before.
    Rate {
        /// Its name.
        sensor: &'a str,
        /// Samples per second by its own clock.
        rate_hz: f64,
        /// By its profile.
        profile_rate_hz: f64,
    },
    /// A socket is open to a network.
    OpenToNetwork {
        /// Where it listens.
        listen: SocketAddr,
        /// Trackers that are heard; empty: the first of those that call.
        worn: &'a [&'a str],
        /// Trackers heard at most.
        most: usize,
    },
    /// No tracker has called so far.
    NoTracker {
        /// Where it is listened.
        listen: SocketAddr,
    },
    /// A tracker that called is not heard.
    TrackerRefused {
        /// Why, in words.
        why: &'a str,
    },
    /// A server of rigid bodies is heard from now on.
    Server {
        /// Where it is.
        server: IpAddr,
        /// The version of NatNet that it speaks.
        version: Version,
    },
    /// No rigid body was heard so far.
    NoBody {
        /// The server, or the multicast group, as it was typed.
        at: SocketAddr,
        /// True if a server has answered.
        server: bool,
    },
}

/// Whoever is told of events, on the thread of the source that they happen to.
pub type Tell<'a> = &'a (dyn Fn(SensingEvent<'_>) + Sync);

/// What somebody who listens to the sensors hears.
#[derive(Clone, Debug, PartialEq)]
pub enum Said {
    /// A sample of a sensor.
    Sample {
        /// Name of the sensor.
        sensor: Arc<str>,
        /// Turns vectors of the sensor into those of its own world, Z up; `None` while nobody
        /// knows.
        orientation: Option<DQuat>,
        /// What its accelerometer said, in its own axes, m/s^2, if the orientation is made of it.
        acceleration_m_s2: Option<DVec3>,
        /// True if the device or the filter began anew: its heading has nothing to do with the one
        /// before.
        anew: bool,
        /// True if its values stand still: nothing is measured.
        stuck: bool,
        /// When it was read.
        arrival: Instant,
        /// When it was taken.
        taken: Instant,
    },
    /// There will be no more of a sensor.
    Ended {
        /// Name of the sensor.
        sensor: Arc<str>,
        /// Why, in words.
        why: String,
    },
    /// A sensor is gone, and waited for.
    Gone {
        /// Name of the sensor.
        sensor: Arc<str>,
        /// Why, in words.
        why: String,
    },
    /// A sensor that was gone is there again.
    Back {
        /// Name of the sensor.
        sensor: Arc<str>,
    },
}

impl Said {
    /// What a captured sample says: the fused orientation once that is settled or, of a sensor that
    /// sends no angular rate, its own. Its moments are those of `clock`.
    #[must_use]
    pub fn of(sensor: &Arc<str>, captured: &Captured, clock: &dyn Clock) -> Self {
        let settled = captured.fused.is_none_or(|fused| fused.settled);
        let orientation = captured.orientation().filter(|_| settled);
        let unsettled = captured.fused.is_some_and(|fused| !fused.settled);
        let anew = unsettled || captured.stamp.order == Order::Reset;
        let of_clock = |at| clock.of_system(at);
        let (arrival, taken) = (of_clock(captured.stamp.arrival), of_clock(captured.stamp.taken));
        let (sensor, stuck) = (Arc::clone(sensor), captured.stuck);
        let acceleration_m_s2 =
            captured.sample.acceleration_m_s2.filter(|_| captured.fused.is_some());
        Self::Sample { sensor, orientation, acceleration_m_s2, anew, stuck, arrival, taken }
    }
}
