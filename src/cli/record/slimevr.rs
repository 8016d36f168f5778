//! SlimeVR trackers over UDP: whoever looks for a server finds us.

use super::intake::{Intake, Named, SourceReport};
use super::{LOOK, PATIENCE};
use crate::capture::Chain;
use crate::error::Error;
use crate::port::{Clock, MonotonicClock};
use crate::recording::SourceKind;
use crate::time::{Duration, Instant};
use crate::wire::sensor::Reading;
use crate::wire::sensor::slimevr::{self, Message};
use gaitway_profiles::Sensor;
use std::collections::BTreeMap;
use std::net::{SocketAddr, UdpSocket};

/// Trackers time out after a second without a heartbeat.
const HEARTBEAT: Duration = Duration::from_millis(500);
/// Trackers served at most; whoever else calls is not answered.
const MOST_TRACKERS: usize = 64;
/// Sensors of one tracker at most.
const MOST_SENSORS: u8 = 16;

/// An open socket and the trackers that called so far.
pub struct Trackers {
    name: String,
    sensor: Sensor,
    socket: UdpSocket,
    trackers: BTreeMap<SocketAddr, Tracker>,
}

#[derive(Default)]
struct Tracker {
    name: String,
    /// Number of the last datagram; some firmware numbers none.
    last: u64,
    missed: u64,
    late: u64,
    sensors: BTreeMap<u8, (Named, Chain)>,
}

impl Trackers {
    /// Listens at an address.
    ///
    /// # Errors
    /// A port that something else listens at.
    pub fn open(name: String, sensor: Sensor, listen: SocketAddr) -> Result<Self, Error> {
        let refused = |cause: std::io::Error| {
            Error::new("nobody can listen at the port")
                .at(format!("udp:{listen}"))
                .got(cause.to_string())
                .remedy("end the other server (SlimeVR?), or choose another port")
        };
        let socket = UdpSocket::bind(listen).map_err(refused)?;
        socket.set_read_timeout(Some(LOOK)).map_err(refused)?;
        Ok(Self { name, sensor, socket, trackers: BTreeMap::new() })
    }

    /// Records until it is to stop.
    pub fn record(mut self, intake: &Intake) {
        let mut buffer = [0_u8; 2048];
        let began = MonotonicClock.now();
        let mut beaten = began;
        let mut remarked = false;
        while !intake.stopped() {
            let received = self.socket.recv_from(&mut buffer);
            let now = MonotonicClock.now();
            if let Ok((count, from)) = received {
                self.take(&buffer[..count], from, now, intake);
            }
            if now.since(beaten) >= HEARTBEAT {
                beaten = now;
                for address in self.trackers.keys() {
                    // A tracker that is gone is noticed by its silence.
                    let _ = self.socket.send_to(&slimevr::heartbeat(), address);
                }
            }
            if self.trackers.is_empty() && !remarked && now.since(began) > PATIENCE {
                remarked = true;
                intake.remarks.say(
                    "no tracker has called yet; is this machine in their network, and does its \
                     firewall let UDP in?",
                );
            }
        }
        self.report(intake);
    }

    fn take(&mut self, datagram: &[u8], from: SocketAddr, now: Instant, intake: &Intake) {
        let mut messages = Vec::new();
        let number = slimevr::decode(datagram, |message| messages.push(message)).unwrap_or(0);
        for message in messages {
            if let Message::Handshake { mac, .. } = message {
                let known = self.trackers.contains_key(&from);
                if known || self.trackers.len() < MOST_TRACKERS {
                    let tracker = self.trackers.entry(from).or_default();
                    tracker.name = tracker_name(&self.name, mac);
                    // It begins to count anew.
                    tracker.last = 0;
                    let _ = self.socket.send_to(&slimevr::handshake_reply(), from);
                }
                continue;
            }
            let Some(tracker) = self.trackers.get_mut(&from) else { return };
            tracker.count(number);
            if let Message::SensorInfo { sensor, status } = message {
                let _ = self.socket.send_to(&slimevr::sensor_info_reply(sensor, status), from);
            }
            let Some((sensor, reading)) = reading(&message) else { continue };
            if sensor >= MOST_SENSORS {
                continue;
            }
            let tracker_name = tracker.name.clone();
            let (source, chain) = tracker.sensors.entry(sensor).or_insert_with(|| {
                let wanted = format!("{tracker_name}-{sensor}");
                let metadata = [("profile", self.sensor.name.as_str())];
                let source = intake.add(&wanted, SourceKind::Imu, &metadata);
                (source, Chain::new(&self.sensor, intake.mode))
            });
            if let Some(captured) = chain.take(&reading, now) {
                intake.take(source, captured);
            }
        }
    }

    fn report(self, intake: &Intake) {
        if self.trackers.is_empty() {
            let ended = Some("no tracker has called".to_owned());
            intake.report(SourceReport { name: self.name, ended, ..SourceReport::default() });
            return;
        }
        for tracker in self.trackers.into_values() {
            for (index, (source, chain)) in tracker.sensors.into_values().enumerate() {
                let mut report = SourceReport::of(&source.name, &chain);
                // Datagrams are the tracker's, not a sensor's: they are told once.
                if index == 0 {
                    report.counts.missed += tracker.missed;
                    report.counts.late += tracker.late;
                }
                intake.report(report);
            }
        }
    }
}

impl Tracker {
    /// Counts what is missing between datagrams.
    fn count(&mut self, number: u64) {
        if number == 0 {
            return;
        }
        if self.last != 0 && number > self.last {
            self.missed = self.missed.saturating_add(number - self.last - 1);
        }
        self.late += u64::from(number < self.last);
        self.last = self.last.max(number);
    }
}

/// A tracker keeps its name as long as it keeps its network hardware.
fn tracker_name(prefix: &str, mac: [u8; 6]) -> String {
    let [.., a, b, c] = mac;
    format!("{prefix}-{a:02x}{b:02x}{c:02x}")
}

fn reading(message: &Message) -> Option<(u8, Reading)> {
    let empty = Reading::default();
    match *message {
        Message::Rotation { sensor, quaternion } => {
            Some((sensor, Reading { quaternion: Some(quaternion), ..empty }))
        }
        Message::Motion { sensor, quaternion, acceleration } => {
            let linear_acceleration = Some(acceleration);
            Some((sensor, Reading { quaternion: Some(quaternion), linear_acceleration, ..empty }))
        }
        Message::Acceleration { sensor, acceleration } => {
            Some((sensor, Reading { linear_acceleration: Some(acceleration), ..empty }))
        }
        Message::Temperature(sensor, celsius) => {
            Some((sensor, Reading { temperature: Some(celsius), ..empty }))
        }
        _ => None,
    }
}
