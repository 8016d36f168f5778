//! SlimeVR trackers over UDP: whoever looks for a server finds us, and may be heard if it is worn.
//!
//! The protocol knows no secret: a tracker is who it says it is. So the socket is open to this machine
//! alone unless its address says otherwise, only trackers that are worn are heard where that was said,
//! and a tracker that speaks cannot be displaced by another of its name.

use super::event::SensingEvent;
use super::intake::{Intake, Named, SourceReport};
use super::{LOOK, PATIENCE};
use crate::capture::Chain;
use crate::error::{Error, ErrorKind};
use crate::port::{Clock, MonotonicClock};
use crate::recording::SourceKind;
use crate::time::{Duration, Instant};
use crate::wire::sensor::Reading;
use crate::wire::sensor::slimevr::{self, Message};
use gaitway_profiles::Sensor;
use std::collections::{BTreeMap, BTreeSet};
use std::net::{SocketAddr, UdpSocket};

/// Trackers time out after a second without a heartbeat.
const HEARTBEAT: Duration = Duration::from_millis(500);
/// Trackers served at most; whoever else calls is not answered.
const MOST_TRACKERS: usize = 64;
/// Sensors of one tracker at most.
const MOST_SENSORS: u8 = 16;
/// Who called and sent nothing of a sensor for so long is forgotten, and whoever fell silent for so long
/// may come back from another address.
const SILENCE: Duration = Duration::from_secs(3);
/// So many refusals are said one by one.
const MOST_SAID: u64 = 16;

/// An open socket and the trackers that called so far.
pub struct Trackers {
    name: String,
    sensor: Sensor,
    socket: UdpSocket,
    listen: SocketAddr,
    /// Names of the trackers that are worn; empty if nobody said so.
    worn: BTreeSet<String>,
    trackers: BTreeMap<SocketAddr, Tracker>,
    /// Handshakes that were not answered.
    refused: u64,
}

struct Tracker {
    name: String,
    /// When it called, and when it last said something of a sensor.
    called: Instant,
    heard: Option<Instant>,
    /// Number of the last datagram; some firmware numbers none.
    last: u64,
    missed: u64,
    late: u64,
    sensors: BTreeMap<u8, (Named, Chain)>,
}

impl Trackers {
    /// Listens at an address. `worn` are the names of all sensors that are worn: if trackers are
    /// among them, others are not heard.
    ///
    /// # Errors
    /// A port that something else listens at.
    pub fn open(
        name: String,
        sensor: Sensor,
        listen: SocketAddr,
        worn: &[String],
    ) -> Result<Self, Error> {
        let refused = |cause: std::io::Error| {
            Error::of(ErrorKind::Busy, "the port cannot be opened for listening")
                .at(format!("udp:{listen}"))
                .got(cause.to_string())
                .remedy("end the other server (SlimeVR?), or choose another port")
        };
        let socket = UdpSocket::bind(listen).map_err(refused)?;
        socket.set_read_timeout(Some(LOOK)).map_err(refused)?;
        let prefix = format!("{name}-");
        let ours = worn.iter().filter(|sensor| sensor.starts_with(&prefix));
        let worn = ours.filter_map(|sensor| Some(sensor.rsplit_once('-')?.0.to_owned())).collect();
        let trackers = BTreeMap::new();
        Ok(Self { name, sensor, socket, listen, worn, trackers, refused: 0 })
    }

    /// Records until it is to stop.
    pub fn record(mut self, intake: &Intake) {
        let mut buffer = [0_u8; 2048];
        let began = MonotonicClock.now();
        let mut beaten = began;
        let mut remarked = false;
        if !self.listen.ip().is_loopback() {
            let worn: Vec<&str> = self.worn.iter().map(String::as_str).collect();
            let (listen, worn, most) = (self.listen, &worn[..], MOST_TRACKERS);
            (intake.tell)(SensingEvent::OpenToNetwork { listen, worn, most });
        }
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
                (intake.tell)(SensingEvent::NoTracker { listen: self.listen });
            }
        }
        self.report(intake);
    }

    fn take(&mut self, datagram: &[u8], from: SocketAddr, now: Instant, intake: &Intake) {
        let mut messages = Vec::new();
        let number = slimevr::decode(datagram, |message| messages.push(message)).unwrap_or(0);
        for message in messages {
            if let Message::Handshake { mac, .. } = message {
                match self.admit(mac, from, now) {
                    // A tracker that is gone is noticed by its silence.
                    Ok(()) => drop(self.socket.send_to(&slimevr::handshake_reply(), from)),
                    Err(why) => self.refuse(&why, intake),
                }
                continue;
            }
            let Some(tracker) = self.trackers.get_mut(&from) else { return };
            tracker.count(number);
            if let Message::SensorInfo { sensor, status } = message {
                let _ = self.socket.send_to(&slimevr::sensor_info_reply(sensor, status), from);
            }
            let all = tracker.sensors.values().map(|(source, _)| source);
            match message {
                Message::Battery(_, level) => all.for_each(|source| intake.battery(source, level)),
                Message::Signal(dbm) => all.for_each(|source| intake.signal(source, dbm)),
                _ => {}
            }
            let Some((sensor, reading)) = reading(&message) else { continue };
            if sensor >= MOST_SENSORS {
                continue;
            }
            tracker.heard = Some(now);
            let tracker_name = tracker.name.clone();
            let (source, chain) = tracker.sensors.entry(sensor).or_insert_with(|| {
                let wanted = format!("{tracker_name}-{sensor}");
                let metadata = [("profile", self.sensor.name.as_str())];
                let source = intake.add(&wanted, SourceKind::Imu, &metadata);
                intake.expects(&source, self.sensor.rate_hz);
                (source, Chain::new(&self.sensor, intake.mode))
            });
            for captured in chain.take(&reading, now).into_iter().flatten() {
                intake.take(source, captured);
            }
        }
    }

    /// Takes whoever calls for a tracker, or says why not.
    fn admit(&mut self, mac: [u8; 6], from: SocketAddr, now: Instant) -> Result<(), String> {
        let name = tracker_name(&self.name, mac);
        // Who called and has nothing to say stands in nobody's way.
        self.trackers
            .retain(|_, tracker| tracker.heard.is_some() || now.since(tracker.called) < SILENCE);
        if let Some(tracker) = self.trackers.get_mut(&from) {
            if tracker.name != name {
                return Err(format!("{from} is {} and calls itself {name} now", tracker.name));
            }
            // It begins to count anew.
            (tracker.last, tracker.called) = (0, now);
            return Ok(());
        }
        if !self.worn.is_empty() && !self.worn.contains(&name) {
            return Err(format!(
                "{name} at {from} is not worn; --wear SEGMENT={name}-0 says where it is"
            ));
        }
        // Old firmware says no address, so many trackers have one name then.
        let says_who = mac != [0; 6] || !self.worn.is_empty();
        let of_name = |(_, tracker): &(&SocketAddr, &Tracker)| says_who && tracker.name == name;
        if let Some((&other, tracker)) = self.trackers.iter().find(of_name) {
            if now.since(tracker.heard.unwrap_or(tracker.called)) < SILENCE {
                return Err(format!("{name} speaks from {other} and calls from {from} as well"));
            }
            // It was away, and has another address since.
            if let Some(tracker) = self.trackers.remove(&other) {
                self.trackers.insert(from, Tracker { last: 0, called: now, ..tracker });
            }
            return Ok(());
        }
        if self.trackers.len() >= MOST_TRACKERS {
            return Err(format!("{name} at {from} is one more than {MOST_TRACKERS} trackers"));
        }
        self.trackers.insert(from, Tracker::new(name, now));
        Ok(())
    }

    /// Counts a refusal, and says the first of them.
    fn refuse(&mut self, why: &str, intake: &Intake) {
        self.refused += 1;
        if self.refused <= MOST_SAID {
            (intake.tell)(SensingEvent::TrackerRefused { why });
        }
    }

    fn report(self, intake: &Intake) {
        if self.trackers.is_empty() {
            let ended = Some("no tracker has called".to_owned());
            let (name, refused) = (self.name, self.refused);
            intake.report(SourceReport { name, ended, refused, ..SourceReport::default() });
            return;
        }
        // Nobody's in particular: they are told once.
        let mut refused = self.refused;
        for tracker in self.trackers.into_values() {
            for (index, (source, chain)) in tracker.sensors.into_values().enumerate() {
                let mut report = SourceReport::of(&source.name, &chain);
                report.refused = std::mem::take(&mut refused);
                // Datagrams are the tracker's, not a sensor's: they are told once.
                if index == 0 {
                    report.counts.missed += tracker.missed;
                    report.counts.late += tracker.late;
                }
                // Datagrams are numbered: what is missing is known.
                report.counts.estimated = None;
                intake.report(report);
            }
        }
    }
}

impl Tracker {
    const fn new(name: String, now: Instant) -> Self {
        let sensors = BTreeMap::new();
        Self { name, called: now, heard: None, last: 0, missed: 0, late: 0, sensors }
    }

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capture::Mode;
    use std::net::Ipv4Addr;
    use std::sync::atomic::AtomicBool;

    fn at_s(seconds: f64) -> Instant {
        Instant::ZERO + Duration::from_secs_f64(100.0 + seconds)
    }

    fn from(host: u8, port: u16) -> SocketAddr {
        SocketAddr::from(([192, 168, 1, host], port))
    }

    fn mac(number: u8) -> [u8; 6] {
        [2, 0, 0, 0, 0xAA, number]
    }

    /// `id(4) number(8)`, board facts, build, no version, the address.
    fn handshake(mac: [u8; 6]) -> Vec<u8> {
        let mut packet = vec![0, 0, 0, 3];
        packet.extend([0; 8 + 24 + 4 + 1]);
        packet.extend(mac);
        packet
    }

    /// The orientation of sensor 0, one.
    fn rotation() -> Vec<u8> {
        let mut packet = vec![0, 0, 0, 17];
        packet.extend([0; 8 + 2]);
        packet.extend([0.0_f32, 0.0, 0.0, 1.0].iter().flat_map(|value| value.to_be_bytes()));
        packet
    }

    fn trackers(worn: &[&str]) -> Trackers {
        let sensor = gaitway_profiles::sensor("slimevr").expect("a shipped profile");
        let worn: Vec<String> = worn.iter().map(|&name| name.to_owned()).collect();
        let listen = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
        Trackers::open("tracker".to_owned(), sensor, listen, &worn).expect("a socket")
    }

    /// Runs a scene; what was reported of each source: name, samples, refused.
    fn scene(
        mut trackers: Trackers,
        play: impl FnOnce(&mut dyn FnMut(&[u8], SocketAddr, f64)),
    ) -> Vec<(String, u64, u64)> {
        let stop = AtomicBool::new(false);
        let intake = Intake::new(None, &stop, Mode::SixAxes, &|_| ());
        play(&mut |datagram, from, time_s| trackers.take(datagram, from, at_s(time_s), &intake));
        trackers.report(&intake);
        let reports = intake.into_reports().into_iter();
        let mut told: Vec<_> =
            reports.map(|report| (report.name, report.counts.samples, report.refused)).collect();
        told.sort();
        told
    }

    #[test]
    fn only_trackers_that_are_worn_are_heard_and_the_others_counted() {
        let told = scene(trackers(&["tracker-00aa01-0", "torso"]), |take| {
            for number in [1, 2] {
                take(&handshake(mac(number)), from(number, 6969), 0.0);
                take(&rotation(), from(number, 6969), 0.1);
            }
        });
        assert_eq!(told, [("tracker-00aa01-0".to_owned(), 1, 1)]);
        // Where nobody said who is worn, whoever calls is heard and can be named.
        let told = scene(trackers(&["torso"]), |take| {
            take(&handshake(mac(2)), from(2, 6969), 0.0);
            take(&rotation(), from(2, 6969), 0.1);
        });
        assert_eq!(told, [("tracker-00aa02-0".to_owned(), 1, 0)]);
    }

    #[test]
    fn what_a_tracker_tells_of_itself_is_known_of_each_of_its_sensors_in_sessions_as_well() {
        let stop = AtomicBool::new(false);
        let names = [("tracker-00aa01-0".to_owned(), "head".to_owned())];
        let hub = crate::sensing::Hub::of(names.into_iter());
        let intake = Intake::new(None, &stop, Mode::SixAxes, &|_| ()).heard_by_hub(&hub);
        let mut trackers = trackers(&["tracker-00aa01-0"]);
        let mut battery = vec![0, 0, 0, 12];
        battery.extend([0; 8]);
        battery.extend([4.0_f32, 0.5].iter().flat_map(|value| value.to_be_bytes()));
        let mut signal = vec![0, 0, 0, 19];
        signal.extend([0; 8]);
        signal.extend([255, 0xC3]);
        for said in [handshake(mac(1)), rotation(), battery, signal] {
            trackers.take(&said, from(1, 6969), at_s(0.0), &intake);
        }
        let known = [&hub.heard()["head"], &intake.heard()[0].1]
            .map(|of| (of.samples, of.battery, of.signal_dbm));
        assert_eq!(known, [(1, Some(0.5), Some(-61)); 2]);
    }

    #[test]
    fn forged_handshakes_do_not_keep_a_tracker_out_for_good() {
        let told = scene(trackers(&[]), |take| {
            for number in 0..200 {
                take(&handshake(mac(number)), from(number, 4000), 0.0);
            }
            // The table is full, but of those who say nothing.
            take(&handshake(mac(250)), from(250, 6969), 1.0);
            take(&rotation(), from(250, 6969), 1.1);
            take(&handshake(mac(250)), from(250, 6969), 3.1);
            take(&rotation(), from(250, 6969), 3.2);
        });
        let refused = 200 - MOST_TRACKERS as u64 + 1;
        assert_eq!(told, [("tracker-00aafa-0".to_owned(), 1, refused)]);
    }

    #[test]
    fn a_tracker_that_speaks_is_not_displaced_and_one_that_was_away_comes_back() {
        let told = scene(trackers(&["tracker-00aa01-0"]), |take| {
            take(&handshake(mac(1)), from(1, 6969), 0.0);
            for tenth in 1..=20 {
                take(&rotation(), from(1, 6969), f64::from(tenth) / 10.0);
            }
            // Another of its name, another name from its address, and data without a handshake.
            take(&handshake(mac(1)), from(9, 6969), 2.1);
            take(&rotation(), from(9, 6969), 2.2);
            take(&handshake(mac(7)), from(1, 6969), 2.3);
            take(&rotation(), from(1, 6969), 2.4);
            // Silent since; the network gave it another address.
            take(&handshake(mac(1)), from(5, 6969), 6.0);
            take(&rotation(), from(5, 6969), 6.1);
            take(&rotation(), from(1, 6969), 6.2);
        });
        assert_eq!(told, [("tracker-00aa01-0".to_owned(), 22, 2)]);
    }

    #[test]
    fn trackers_of_old_firmware_that_say_no_address_are_told_apart_by_where_they_are() {
        let told = scene(trackers(&[]), |take| {
            for host in [1, 2] {
                take(&handshake([0; 6]), from(host, 6969), 0.0);
                take(&rotation(), from(host, 6969), 0.1);
            }
        });
        let expected = ["tracker-000000-0", "tracker-000000-0-2"];
        assert_eq!(told, expected.map(|name| (name.to_owned(), 1, 0)));
    }
}
