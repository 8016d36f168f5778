//! The USB adapter between line and host: when it hands over what it has received.

use crate::SimError;
use crate::world::Options;

/// How an adapter gathers received bytes into USB packets. A packet goes to the host when it is
/// full, or when the timer expires and at least one byte is there. The timer starts anew with
/// each packet and each expiry, so how long a byte waits depends on when it comes.
///
/// Source: FTDI, AN232B-04, "Data Throughput, Latency and Handshaking".
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Usb {
    /// Bytes of the line in a full packet.
    pub packet_bytes: usize,
    /// Longest time a byte waits, ns.
    pub timer_ns: u64,
}

impl Usb {
    /// An FT232R as it is plugged in: packets of 64 bytes, two of which are its own, and a latency
    /// timer of 16 ms.
    pub const FTDI: Usb = Usb { packet_bytes: 62, timer_ns: 16_000_000 };
    /// The same after the driver was asked for low latency.
    pub const FTDI_LOW_LATENCY: Usb = Usb { packet_bytes: 62, timer_ns: 1_000_000 };
    /// A full-speed adapter without a timer of its own (CDC, CH340): what there is goes out in the
    /// next USB frame.
    pub const FULL_SPEED: Usb = Usb { packet_bytes: 64, timer_ns: 1_000_000 };
}

/// What FTDI's latency timer can be set to, s (AN232B-04, 1 to 255 ms).
const LATENCY_TIMER_S: std::ops::RangeInclusive<f64> = 0.001..=0.255;

impl Options {
    /// The same with the line behind an adapter of `firmware-profiles/adapters`, as it is plugged in: its
    /// echo, and how long it holds bytes back. `latency_timer_s` sets its latency timer, s, as a driver
    /// may that has access to it.
    ///
    /// # Errors
    /// No adapter has this name, or its latency timer is to be set and it has none, or not so.
    pub fn behind(
        mut self,
        adapter: &str,
        latency_timer_s: Option<f64>,
    ) -> Result<Options, SimError> {
        let profile = gaitway_profiles::adapters()
            .unwrap_or_default()
            .into_iter()
            .find(|profile| profile.name == adapter)
            .ok_or_else(|| SimError::UnknownAdapter(adapter.to_string()))?;
        // FTDI's chips (USB vendor 0403) put two bytes of their own into each packet.
        let ftdi = profile.usb_ids.iter().any(|id| id.starts_with("0403:"));
        let packet_bytes = if ftdi { Usb::FTDI } else { Usb::FULL_SPEED }.packet_bytes;
        self.echo = profile.echo;
        let timer_s = match (latency_timer_s, profile.latency_timer_s) {
            (None, own) => own.unwrap_or(profile.latency_s),
            (Some(timer_s), Some(_)) if LATENCY_TIMER_S.contains(&timer_s) => timer_s,
            (Some(_), own) => {
                let (adapter, has_one) = (adapter.to_string(), own.is_some());
                return Err(SimError::LatencyTimer { adapter, has_one });
            }
        };
        self.usb = Some(Usb { packet_bytes, timer_ns: (timer_s * 1e9) as u64 });
        Ok(self)
    }
}
