//! Whoever wears sensors, as a BVH file that goes on: over TCP, each program that connects is sent the hierarchy and then a line
//! for each pose.

use super::observer::{Event, Observer, Progress};
use super::page::live::{DRAWN_FOR_M, TOLD_HZ};
use crate::body::{Proportions, SegmentPose};
use crate::error::Error;
use crate::mocap::{bvh, export};
use glam::DVec3;
use std::io::{ErrorKind as Io, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::{Mutex, PoisonError};

/// So many programs are sent to at once.
const MOST_LISTENERS: usize = 8;
/// One that has so much still to read, bytes, is let go: some ten seconds of poses.
const MOST_PENDING: usize = 128 << 10;

/// An observer, and whoever reads what is worn besides.
pub struct BvhStream<'a> {
    observer: &'a dyn Observer,
    door: Option<Door>,
}

/// Where programs connect.
struct Door {
    listener: TcpListener,
    body: Proportions,
    listeners: Mutex<Vec<Listener>>,
}

/// A program that is sent to.
struct Listener {
    stream: TcpStream,
    pending: Vec<u8>,
}

impl<'a> BvhStream<'a> {
    /// Listens at `place`, written `HOST:PORT`, if it is wanted; the observer hears the same as ever.
    ///
    /// # Errors
    /// What is no such address, or cannot be listened at.
    pub fn new(observer: &'a dyn Observer, place: Option<&str>) -> Result<Self, Error> {
        Ok(Self { observer, door: place.map(Door::open).transpose()? })
    }

    /// Where programs connect, if they can.
    #[must_use]
    pub fn address(&self) -> Option<SocketAddr> {
        self.door.as_ref()?.listener.local_addr().ok()
    }
}

impl Door {
    fn open(place: &str) -> Result<Self, Error> {
        let refused = |got: String| {
            Error::new("nobody can connect there")
                .at(format!("--bvh {place}"))
                .got(got)
                .allowed("HOST:PORT of this machine, as 127.0.0.1:7001")
        };
        let listener = TcpListener::bind(place).map_err(|e| refused(e.to_string()))?;
        listener.set_nonblocking(true).map_err(|e| refused(e.to_string()))?;
        let body = Proportions::of_stature(DRAWN_FOR_M)?;
        Ok(Self { listener, body, listeners: Mutex::default() })
    }

    fn send(&self, pose: &SegmentPose) {
        let (head, line) = self.text(pose);
        let mut listeners = self.listeners.lock().unwrap_or_else(PoisonError::into_inner);
        // Those who come are few; who knocks and goes away is no error of ours.
        while let Ok((stream, _)) = self.listener.accept() {
            if listeners.len() < MOST_LISTENERS && stream.set_nonblocking(true).is_ok() {
                listeners.push(Listener { stream, pending: head.clone().into_bytes() });
            }
        }
        listeners.retain_mut(|listener| listener.take(line.as_bytes()));
    }

    /// What a file has before its poses, and the line of this one.
    fn text(&self, pose: &SegmentPose) -> (String, String) {
        let at = self.body.positions(pose);
        let all = at.joints_m.iter().chain(&at.ends_m);
        let floor_m = all.map(|point_m| point_m.z).fold(f64::INFINITY, f64::min);
        let stands = SegmentPose { root_m: pose.root_m - DVec3::Z * floor_m, ..pose.clone() };
        let file = bvh::write(&export::bvh_of(&[stands], &self.body, TOLD_HZ));
        let (head, line) = file.trim_end().rsplit_once('\n').unwrap_or((&file, ""));
        // How many there will be nobody knows.
        (format!("{}\n", head.replace("Frames: 1", "Frames: 0")), format!("{line}\n"))
    }
}

impl Listener {
    /// Sends what can be sent without waiting; false if nobody reads any more.
    fn take(&mut self, line: &[u8]) -> bool {
        self.pending.extend_from_slice(line);
        let mut said = [0_u8; 256];
        // Nothing that a listener says is of interest but that it went.
        match self.stream.read(&mut said) {
            Ok(0) => return false,
            Err(error) if error.kind() != Io::WouldBlock => return false,
            _ => {}
        }
        match self.stream.write(&self.pending) {
            Ok(count) => drop(self.pending.drain(..count)),
            Err(error) if error.kind() == Io::WouldBlock => {}
            Err(_) => return false,
        }
        self.pending.len() <= MOST_PENDING
    }
}

impl Observer for BvhStream<'_> {
    fn hear(&self, event: Event<'_>) {
        if let (Some(door), Event::Posed { pose, .. }) = (&self.door, event) {
            door.send(pose);
        }
        self.observer.hear(event);
    }

    fn looks(&self) -> bool {
        self.door.is_some() || self.observer.looks()
    }

    fn wants_to_stop(&self) -> bool {
        self.observer.wants_to_stop()
    }

    fn watch(&self, progress: &Progress<'_>) {
        self.observer.watch(progress);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_that_does_not_read_is_let_go_and_little_is_kept_for_it_until_then() {
        let door = TcpListener::bind("127.0.0.1:0").expect("a port");
        let reader = TcpStream::connect(door.local_addr().expect("its address")).expect("let in");
        let (stream, _) = door.accept().expect("it came");
        stream.set_nonblocking(true).expect("a stream");
        let mut listener = Listener { stream, pending: Vec::new() };
        let line = [b'7'; 4096];
        // What the system itself keeps on the way is some megabytes.
        let lines = (0..1_000_000).take_while(|_| listener.take(&line)).count();
        assert!(lines < 100_000, "{lines} lines were sent to who read none");
        assert!(listener.pending.len() <= MOST_PENDING + line.len());
        drop(reader);
    }
}
