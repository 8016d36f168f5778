//! Rigid bodies and bones that Motive (OptiTrack) streams, by NatNet over UDP: each is heard as a sensor that tells its
//! orientation.
//!
//! The protocol knows no secret. Nothing is taken but what the server's address sends: the one that was typed or, where a
//! multicast group was, the first that sends to it, which is said.

use super::event::SensingEvent;
use super::intake::{Intake, Named, SourceReport};
use super::{LOOK, PATIENCE};
use crate::capture::Chain;
use crate::error::{Error, ErrorKind};
use crate::port::{Clock, MonotonicClock};
use crate::recording::SourceKind;
use crate::time::{Duration, Instant};
use crate::wire::natnet::{self, Body, Data, Frame, Message, Model, Part, Server, Version};
use crate::wire::sensor::Reading;
use gaitway_profiles::Sensor;
use std::collections::BTreeMap;
use std::net::{IpAddr, Ipv4Addr, SocketAddr, UdpSocket};

/// How often a server is asked for what is not known yet, and told that somebody listens.
const ASK: Duration = Duration::from_millis(500);
/// A server that was silent for so long may have begun anew, and is asked who it is.
const SILENCE: Duration = Duration::from_secs(3);
/// Bodies heard at most, and names kept.
const MOST_BODIES: usize = 256;
const MOST_NAMES: usize = 4096;
/// Longest part of a name that is kept.
const MOST_LETTERS: usize = 64;
/// No datagram is longer.
const DATAGRAM_BYTES: usize = 65_536;

/// Open sockets, and what of the server is known so far.
pub struct Bodies {
    name: Option<String>,
    sensor: Sensor,
    /// As it was typed: the server's command port, or a multicast group.
    address: SocketAddr,
    command: UdpSocket,
    /// Where frames come if they do not come where the server was asked.
    group: Option<UdpSocket>,
    frames_first: bool,
    server: Option<SocketAddr>,
    info: Option<Server>,
    names: BTreeMap<Part, String>,
    /// What is streamed is to be asked for (again).
    asks_names: bool,
    worn: Vec<String>,
    /// `None`: nobody wears it.
    heard: BTreeMap<Part, Option<Heard>>,
    /// Those that have another name now.
    renamed: Vec<Heard>,
    asked: Option<Instant>,
    last: Instant,
    bad: u64,
    refused: u64,
    ended: Option<String>,
}

struct Heard {
    source: Named,
    chain: Chain,
    /// Frames that came and in which it was not tracked: all, those since its last sample, and those between two samples.
    lost: u64,
    lost_since: u64,
    lost_between: u64,
    /// Samples per second, as they were told last.
    told_hz: f64,
}

impl Bodies {
    /// Opens sockets for a server's command port, or for the multicast group that it streams to. `worn` are the names of all
    /// sensors that are worn: if there are any, other bodies are not heard.
    ///
    /// # Errors
    /// An address that is not of IPv4, a port that something else listens at.
    pub fn open(
        name: Option<String>,
        sensor: Sensor,
        address: SocketAddr,
        worn: &[String],
    ) -> Result<Self, Error> {
        let IpAddr::V4(ip) = address.ip() else {
            return Err(Error::new("NatNet is spoken over IPv4")
                .at(format!("udp:{address}"))
                .allowed(
                    "udp:192.168.1.10:1510, the server, or udp:239.255.42.99:1511, its group",
                ));
        };
        // What only this machine can send is not heard of the network.
        let own = if ip.is_loopback() { Ipv4Addr::LOCALHOST } else { Ipv4Addr::UNSPECIFIED };
        let command = listening(SocketAddr::from((own, 0)))?;
        let (group, server) = match ip.is_multicast() {
            true => (Some(join(ip, address.port(), Ipv4Addr::UNSPECIFIED)?), None),
            false => (None, Some(address)),
        };
        let worn = worn.to_vec();
        let (names, heard, renamed) = Default::default();
        let (info, asked, ended) = Default::default();
        let (asks_names, last, bad, refused) = (true, MonotonicClock.now(), 0, 0);
        let bodies = Self {
            name,
            sensor,
            address,
            command,
            group,
            frames_first: false,
            server,
            info,
            names,
            asks_names,
            worn,
            heard,
            renamed,
            asked,
            last,
            bad,
            refused,
            ended,
        };
        bodies.wait_at_one()?;
        Ok(bodies)
    }

    /// Only one socket is waited at: that to which frames come.
    fn wait_at_one(&self) -> Result<(), Error> {
        let refused = |cause: std::io::Error| {
            Error::of(ErrorKind::Busy, "the port cannot be listened at")
                .at(format!("udp:{}", self.address))
                .got(cause.to_string())
        };
        self.command.set_nonblocking(self.group.is_some()).map_err(refused)
    }

    /// Records until it is to stop, or the server speaks what is not read here.
    pub fn record(mut self, intake: &Intake) {
        let mut buffer = vec![0_u8; DATAGRAM_BYTES];
        let began = MonotonicClock.now();
        let mut remarked = false;
        while self.ended.is_none() && !intake.stopped() {
            self.ask(MonotonicClock.now());
            let received = self.receive(&mut buffer);
            let now = MonotonicClock.now();
            if let Some((count, from)) = received {
                self.take(&buffer[..count], from, now, intake);
            }
            let is_silent = self.heard.values().flatten().next().is_none();
            if is_silent && !remarked && now.since(began) > PATIENCE {
                remarked = true;
                let (at, server) = (self.address, self.info.is_some());
                (intake.tell)(SensingEvent::NoBody { at, server });
            }
        }
        if let Some(server) = self.server {
            // One that does not hear it finds out by the silence.
            let _ = self.command.send_to(&natnet::disconnect(), server);
        }
        if let Some(why) = &self.ended {
            intake.ended_early(&self.own_name(), why);
        }
        self.report(intake);
    }

    /// The next datagram. Where there are two sockets each is looked at first in turn: whoever floods one keeps nobody from being
    /// heard at the other.
    fn receive(&mut self, buffer: &mut [u8]) -> Option<(usize, SocketAddr)> {
        let Some(group) = &self.group else { return self.command.recv_from(buffer).ok() };
        self.frames_first = !self.frames_first;
        let (first, then) = match self.frames_first {
            true => (group, &self.command),
            false => (&self.command, group),
        };
        first.recv_from(buffer).or_else(|_| then.recv_from(buffer)).ok()
    }

    /// Asks for what is not known yet. What gets lost is asked for again.
    fn ask(&mut self, now: Instant) {
        let Some(server) = self.server else { return };
        if self.asked.is_some_and(|asked| now.since(asked) < ASK) {
            return;
        }
        self.asked = Some(now);
        let connects = self.info.is_none() || now.since(self.last) > SILENCE;
        if connects {
            let _ = self.command.send_to(&natnet::connect(), server);
        }
        if self.info.is_some() {
            if self.asks_names {
                let _ = self.command.send_to(&natnet::request_models(), server);
            }
            let _ = self.command.send_to(&natnet::keep_alive(), server);
        }
    }

    fn take(&mut self, datagram: &[u8], from: SocketAddr, now: Instant, intake: &Intake) {
        match self.server {
            Some(server) if server.ip() == from.ip() => {}
            Some(_) => {
                self.refused += 1;
                return;
            }
            None => self.server = Some(SocketAddr::from((from.ip(), natnet::COMMAND_PORT))),
        }
        self.last = now;
        match natnet::decode(datagram, self.info.map(|info| info.version)) {
            Ok(Message::Server(info)) => self.meet(info, from, intake),
            Ok(Message::Models(models)) => self.name(models),
            Ok(Message::Frame(frame)) => self.hear(&frame, now, intake),
            Ok(Message::Other(_)) => {}
            Err(_) => self.bad += 1,
        }
    }

    /// A server has said who it is.
    fn meet(&mut self, info: Server, from: SocketAddr, intake: &Intake) {
        if !info.version.is_read() {
            let (oldest, newest) = (Version::OLDEST, Version::NEWEST);
            self.ended = Some(format!(
                "{from} speaks NatNet {}; {oldest} to {newest} are read, and a newer 4 as {newest}: choose one of these in Motive",
                info.version
            ));
            return;
        }
        if self.info.is_none() {
            let (server, version) = (from.ip(), info.version);
            (intake.tell)(SensingEvent::Server { server, version });
        }
        self.info = Some(info);
        // Names are asked for at once.
        (self.asks_names, self.asked) = (true, None);
        let Some(Data { port, group: Some(group) }) = info.data else { return };
        if self.group.is_none() {
            let joined = self.join(Ipv4Addr::from(group), port, from);
            self.ended = joined.err().map(|refused| refused.to_string());
        }
    }

    /// Joins the group that a server streams to, on the network where that is.
    fn join(&mut self, group: Ipv4Addr, port: u16, server: SocketAddr) -> Result<(), Error> {
        let towards = listening(SocketAddr::from((Ipv4Addr::UNSPECIFIED, 0)))?;
        let own = towards.connect(server).and_then(|()| towards.local_addr());
        let own = match own.map(|own| own.ip()) {
            Ok(IpAddr::V4(own)) => own,
            _ => Ipv4Addr::UNSPECIFIED,
        };
        self.group = Some(join(group, port, own)?);
        self.wait_at_one()
    }

    fn name(&mut self, models: Vec<Model>) {
        self.asks_names = false;
        let before = std::mem::take(&mut self.names);
        for Model { part, owner, name } in models {
            let name = match owner {
                Some(owner) if !name.starts_with(&format!("{owner}_")) => format!("{owner}_{name}"),
                _ => name,
            };
            let name = match &self.name {
                Some(prefix) => format!("{prefix}-{}", plain(&name)),
                None => plain(&name),
            };
            if self.names.len() < MOST_NAMES {
                self.names.insert(part, name);
            }
        }
        // A number that is another body's now is another sensor.
        let (names, renamed) = (&self.names, &mut self.renamed);
        self.heard.retain(|part, heard| {
            let is_same = names.get(part) == before.get(part);
            renamed.extend(heard.take_if(|_| !is_same));
            is_same
        });
    }

    fn hear(&mut self, frame: &Frame, now: Instant, intake: &Intake) {
        self.asks_names |= frame.models_changed;
        let ticks = Some(self.microseconds(frame));
        for body in &frame.bodies {
            if !self.heard.contains_key(&body.part) && !self.begin(body, intake) {
                continue;
            }
            let Some(Some(heard)) = self.heard.get_mut(&body.part) else { continue };
            if !body.is_tracked {
                heard.lost += 1;
                heard.lost_since += 1;
                continue;
            }
            heard.lost_between += std::mem::take(&mut heard.lost_since);
            let counter = Some(u64::from(frame.number));
            let quaternion = Some(body.quaternion);
            let reading = Reading { quaternion, counter, ticks, ..Reading::default() };
            for captured in heard.chain.take(&reading, now).into_iter().flatten() {
                intake.take(&heard.source, captured);
            }
            intake.samples_at(&heard.source, &heard.chain, &mut heard.told_hz);
        }
    }

    /// Makes a source of a body that was not in any frame so far; false if it has no name yet, or is one too many.
    fn begin(&mut self, body: &Body, intake: &Intake) -> bool {
        let Some(name) = self.names.get(&body.part) else {
            self.asks_names = true;
            return false;
        };
        let is_worn = self.worn.is_empty() || self.worn.contains(name);
        let heard = self.heard.values().flatten().count() + self.renamed.len();
        if is_worn && heard >= MOST_BODIES {
            self.refused += 1;
            return false;
        }
        let heard = is_worn.then(|| {
            let metadata = [("profile", self.sensor.name.as_str())];
            let source = intake.add(name, SourceKind::Imu, &metadata);
            let chain = Chain::new(&self.sensor, intake.mode);
            let told_hz = chain.profile_rate_hz();
            Heard { source, chain, lost: 0, lost_since: 0, lost_between: 0, told_hz }
        });
        self.heard.insert(body.part, heard);
        true
    }

    /// When a frame was taken, on the server's clock: when its shutters were open, if that is told.
    fn microseconds(&self, frame: &Frame) -> u64 {
        let ticks_per_s = self.info.map_or(0, |info| info.ticks_per_s);
        match (frame.exposed_ticks, ticks_per_s) {
            (0, _) | (_, 0) => (frame.time_s * 1e6).round() as u64,
            (ticks, per_s) => {
                let exposed = u128::from(ticks) * 1_000_000 / u128::from(per_s);
                // Ticks of more than a microsecond and half a million years.
                u64::try_from(exposed).unwrap_or(u64::MAX)
            }
        }
    }

    fn own_name(&self) -> String {
        self.name.clone().unwrap_or_else(|| self.sensor.name.clone())
    }

    fn report(self, intake: &Intake) {
        let name = self.own_name();
        // Datagrams are nobody's in particular: they are told once.
        let (mut refused, mut bad_packets) = (self.refused, self.bad);
        let mut is_heard = false;
        let all = self.renamed.into_iter().chain(self.heard.into_values().flatten());
        for Heard { source, chain, lost, lost_between, .. } in all {
            is_heard = true;
            let mut report = SourceReport::of(&source.name, &chain);
            report.refused = std::mem::take(&mut refused);
            report.bad_packets = std::mem::take(&mut bad_packets);
            // A frame that came without the body was not lost on the way.
            report.counts.missed = report.counts.missed.saturating_sub(lost_between);
            report.incomplete += lost;
            report.ended.clone_from(&self.ended);
            intake.report(report);
        }
        if !is_heard {
            let silent = match self.info {
                None => "no server has answered",
                Some(_) => "no rigid body or bone was streamed that is worn",
            };
            let ended = Some(self.ended.unwrap_or_else(|| silent.to_owned()));
            let told = SourceReport { name, ended, refused, bad_packets, ..Default::default() };
            intake.report(told);
        }
    }
}

/// A name as sensors have them: letters, digits, `-` and `_`.
fn plain(name: &str) -> String {
    let fits = |letter: char| letter.is_ascii_alphanumeric() || matches!(letter, '-' | '_');
    name.chars().take(MOST_LETTERS).map(|c| if fits(c) { c } else { '_' }).collect()
}

/// A socket that is waited at for as long as a silent source may be.
fn listening(at: SocketAddr) -> Result<UdpSocket, Error> {
    let refused = |cause: std::io::Error| {
        Error::of(ErrorKind::Busy, "the port cannot be opened for listening")
            .at(format!("udp:{at}"))
            .got(cause.to_string())
            .remedy("end the other program that listens to Motive, or choose another port there")
    };
    let socket = UdpSocket::bind(at).map_err(refused)?;
    socket.set_read_timeout(Some(LOOK)).map_err(refused)?;
    Ok(socket)
}

/// A socket that hears what is sent to a group, and nothing else.
fn join(group: Ipv4Addr, port: u16, own: Ipv4Addr) -> Result<UdpSocket, Error> {
    let socket = listening(SocketAddr::from((group, port)))?;
    socket.join_multicast_v4(&group, &own).map_err(|cause| {
        Error::of(ErrorKind::Absent, "the multicast group cannot be joined")
            .at(format!("udp:{group}:{port}"))
            .got(cause.to_string())
            .remedy(
                "is this machine in Motive's network? Or type Motive's address, udp:ADDRESS:1510",
            )
    })?;
    Ok(socket)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capture::Mode;
    use std::sync::Mutex;
    use std::sync::atomic::AtomicBool;

    const SERVER: Ipv4Addr = Ipv4Addr::new(127, 0, 0, 1);

    fn at_s(seconds: f64) -> Instant {
        Instant::ZERO + Duration::from_secs_f64(100.0 + seconds)
    }

    fn message(id: u16, payload: &[u8]) -> Vec<u8> {
        [&id.to_le_bytes()[..], &(payload.len() as u16).to_le_bytes(), payload].concat()
    }

    /// A name, the program's version and the protocol's, ticks of a millisecond, and that frames go where the question came from.
    fn server(major: u8, minor: u8) -> Vec<u8> {
        let mut payload = vec![0; 256 + 4];
        payload.extend([major, minor, 0, 0]);
        payload.extend(1000_u64.to_le_bytes());
        payload.extend([0xE7, 0x05, 0, 0, 0, 0, 0]);
        message(1, &payload)
    }

    /// Rigid bodies of NatNet 3.0: name, number, parent, place, no markers.
    fn models(bodies: &[(&str, i32)]) -> Vec<u8> {
        let mut payload = (bodies.len() as i32).to_le_bytes().to_vec();
        for (name, id) in bodies {
            payload.extend(1_i32.to_le_bytes());
            payload.extend(name.bytes());
            payload.push(0);
            payload.extend(id.to_le_bytes());
            payload.extend([0; 4 + 12 + 4]);
        }
        message(5, &payload)
    }

    /// A frame of NatNet 3.0 that holds rigid bodies alone, each as it was made, tracked or not; ten milliseconds from number to
    /// number.
    fn frame(number: u32, bodies: &[(i32, bool)]) -> Vec<u8> {
        let mut payload = number.to_le_bytes().to_vec();
        payload.extend([0; 8]);
        payload.extend((bodies.len() as i32).to_le_bytes());
        for (id, is_tracked) in bodies {
            payload.extend(id.to_le_bytes());
            let floats = [0.0_f32, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.001];
            payload.extend(floats.iter().flat_map(|value| value.to_le_bytes()));
            payload.extend(u16::from(*is_tracked).to_le_bytes());
        }
        // No skeletons, labelled markers, plates, devices; no time code.
        payload.extend([0; 16 + 8]);
        payload.extend(0_f64.to_le_bytes());
        payload.extend((5000 + 10 * u64::from(number)).to_le_bytes());
        payload.extend([0; 16 + 2 + 4]);
        message(7, &payload)
    }

    fn bodies(address: SocketAddr, name: Option<&str>, worn: &[&str]) -> Bodies {
        let sensor = gaitway_profiles::sensor("natnet").expect("a shipped profile");
        let worn: Vec<String> = worn.iter().map(|&name| name.to_owned()).collect();
        Bodies::open(name.map(str::to_owned), sensor, address, &worn).expect("sockets")
    }

    /// What was reported of each source, by name.
    fn scene(
        mut bodies: Bodies,
        play: impl FnOnce(&mut dyn FnMut(&[u8], Ipv4Addr, f64)),
    ) -> Vec<SourceReport> {
        let stop = AtomicBool::new(false);
        let intake = Intake::new(None, &stop, Mode::SixAxes, &|_| ());
        play(&mut |datagram, from, time_s| {
            bodies.take(datagram, SocketAddr::from((from, 1511)), at_s(time_s), &intake);
        });
        bodies.report(&intake);
        let mut reports = intake.into_reports();
        reports.sort_by(|a, b| a.name.cmp(&b.name));
        reports
    }

    fn typed() -> SocketAddr {
        SocketAddr::from((SERVER, natnet::COMMAND_PORT))
    }

    #[test]
    fn a_body_that_is_not_tracked_is_no_sample_and_no_frame_that_was_lost() {
        let reports = scene(bodies(typed(), None, &[]), |take| {
            take(&server(3, 0), SERVER, 0.0);
            take(&models(&[("left thigh", 4), ("Kopf/ä", 5)]), SERVER, 0.0);
            for number in 0..100_u32 {
                // Three frames are lost on the way; in ten a body is not seen, and in the last two.
                let is_seen = !(60..70).contains(&number) && number < 98;
                if !(20..23).contains(&number) {
                    let frame = frame(number, &[(4, is_seen), (5, true)]);
                    take(&frame, SERVER, f64::from(number) / 100.0);
                }
            }
        });
        let told = |report: &SourceReport| {
            let counts = report.counts;
            (report.name.clone(), counts.samples, counts.missed, report.incomplete)
        };
        let told: Vec<_> = reports.iter().map(told).collect();
        let expected = [("Kopf__", 97, 3, 0), ("left_thigh", 85, 3, 12)];
        assert_eq!(told, expected.map(|(name, n, m, i)| (name.to_owned(), n, m, i)));
        assert!(reports.iter().all(|report| report.counts.resets == 0 && !report.lossless()));
    }

    #[test]
    fn only_the_server_is_heard_and_damaged_datagrams_are_counted() {
        let stranger = Ipv4Addr::new(192, 168, 1, 66);
        let reports = scene(bodies(typed(), Some("m"), &[]), |take| {
            take(&server(3, 0), stranger, 0.0);
            // Before its version is known a frame cannot be read.
            take(&frame(0, &[(4, true)]), SERVER, 0.0);
            take(&server(3, 0), SERVER, 0.0);
            // Nor is a body heard that has no name yet.
            take(&frame(1, &[(4, true)]), SERVER, 0.01);
            take(&models(&[("hip", 4)]), SERVER, 0.015);
            for number in 2..12 {
                take(&frame(number, &[(4, true)]), SERVER, f64::from(number) / 100.0);
                take(&frame(number + 900, &[(4, true)]), stranger, f64::from(number) / 100.0);
            }
            let whole = frame(12, &[(4, true)]);
            take(&whole[..whole.len() - 8], SERVER, 0.12);
        });
        let [report] = &reports[..] else { panic!("{reports:?}") };
        assert_eq!((report.name.as_str(), report.counts.samples), ("m-hip", 10));
        assert_eq!((report.refused, report.bad_packets, report.counts.missed), (11, 1, 0));
    }

    #[test]
    fn only_bodies_that_are_worn_are_heard_where_that_was_said() {
        let reports = scene(bodies(typed(), None, &["hip", "torso"]), |take| {
            take(&server(3, 0), SERVER, 0.0);
            take(&models(&[("hip", 4), ("ball", 5)]), SERVER, 0.0);
            take(&frame(1, &[(4, true), (5, true)]), SERVER, 0.01);
        });
        let told: Vec<_> = reports.iter().map(|r| (r.name.as_str(), r.counts.samples)).collect();
        assert_eq!(told, [("hip", 1)]);
        let reports = scene(bodies(typed(), None, &["torso"]), |take| {
            take(&server(3, 0), SERVER, 0.0);
        });
        let why = reports[0].ended.as_deref();
        assert_eq!(why, Some("no rigid body or bone was streamed that is worn"));
    }

    #[test]
    fn a_number_that_goes_to_another_body_is_another_sensor() {
        let reports = scene(bodies(typed(), None, &[]), |take| {
            take(&server(3, 0), SERVER, 0.0);
            take(&models(&[("hip", 4), ("head", 5)]), SERVER, 0.0);
            for number in 0..30 {
                if number == 10 {
                    take(&models(&[("wand", 4), ("head", 5)]), SERVER, 0.1);
                }
                take(&frame(number, &[(4, true), (5, true)]), SERVER, f64::from(number) / 100.0);
            }
        });
        let told: Vec<_> = reports.iter().map(|r| (r.name.as_str(), r.counts.samples)).collect();
        assert_eq!(told, [("head", 30), ("hip", 10), ("wand", 20)]);
    }

    #[test]
    fn whoever_is_worn_is_heard_however_many_others_are_streamed() {
        let names: Vec<String> = (0..300).map(|at| format!("b{at}")).collect();
        let all: Vec<(&str, i32)> = names.iter().map(String::as_str).zip(0..).collect();
        let seen: Vec<(i32, bool)> = (0..300).map(|at| (at, true)).collect();
        for (worn, heard, refused) in [(["b299"].as_slice(), 1, 0), (&[], MOST_BODIES, 44)] {
            let reports = scene(bodies(typed(), None, worn), |take| {
                take(&server(3, 0), SERVER, 0.0);
                take(&models(&all), SERVER, 0.0);
                take(&frame(1, &seen), SERVER, 0.01);
            });
            assert_eq!((reports.len(), reports.iter().map(|r| r.refused).sum()), (heard, refused));
        }
    }

    #[test]
    fn a_version_that_is_not_read_is_refused_by_its_number() {
        for (major, minor) in [(2, 5), (5, 0)] {
            let reports = scene(bodies(typed(), None, &[]), |take| {
                take(&server(major, minor), SERVER, 0.0);
            });
            let why = reports[0].ended.clone().expect("it ends");
            let says = format!("NatNet {major}.{minor}; 2.6 to 4.2 are read");
            assert!(why.contains(&says), "{why}");
        }
    }

    /// As it is where a group was typed.
    #[test]
    fn who_sends_to_the_group_first_is_the_server_and_that_is_said() {
        let mut bodies = Bodies { server: None, ..bodies(typed(), None, &[]) };
        let stop = AtomicBool::new(false);
        let said = Mutex::new(Vec::new());
        let tell = |event: SensingEvent<'_>| {
            if let SensingEvent::Server { server, version } = event {
                said.lock().expect("a list").push(format!("{server} {version}"));
            }
        };
        let intake = Intake::new(None, &stop, Mode::SixAxes, &tell);
        let from = |last: u8| SocketAddr::from(([10, 0, 0, last], 1511));
        bodies.take(&frame(1, &[(4, true)]), from(7), at_s(0.0), &intake);
        assert_eq!(bodies.server, Some(SocketAddr::from(([10, 0, 0, 7], 1510))));
        bodies.take(&server(3, 0), from(8), at_s(0.1), &intake);
        assert!(bodies.info.is_none() && bodies.refused == 1);
        bodies.take(&server(3, 0), from(7), at_s(0.2), &intake);
        drop(intake);
        assert_eq!(said.into_inner().expect("a list"), ["10.0.0.7 3.0"]);
    }
}
