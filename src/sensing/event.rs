//! What happens while sensors are heard.

use std::net::SocketAddr;

/// Something that whoever set the sensors up may want to know at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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
}

/// Whoever is told of events, on the thread of the source that they happen to.
pub type Tell<'a> = &'a (dyn Fn(SensingEvent<'_>) + Sync);
