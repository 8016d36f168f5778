//! Whoever wears sensors, shown to programs that draw avatars: the Virtual Motion Capture protocol, over the network.
//!
//! Source: "VMC Protocol specification", <https://protocol.vmc.info/english>: a performer sends bundles of OSC, each bone by
//! the name that Unity has for it, turned and placed against the bone that carries it. Unity's world is left-handed, Y is up
//! and Z forward; its bones are not turned where a person stands in T pose.

use super::observer::{Event, Observer, Progress};
use super::page::live::DRAWN_FOR_M;
use crate::body::proportions::proximal_joint;
use crate::body::worn::check::t_pose;
use crate::body::{Proportions, Segment, SegmentPose};
use crate::error::Error;
use crate::port::{Clock, MonotonicClock};
use crate::time::Instant;
use crate::wire::osc::{OscBundle, OscValue};
use glam::{DQuat, DVec3};
use std::net::{SocketAddr, ToSocketAddrs, UdpSocket};

/// Unity's name for the bone of each segment, in the order of [`Segment::ALL`].
const BONES: [&str; 13] = [
    "Hips",
    "Spine",
    "Head",
    "LeftUpperArm",
    "LeftLowerArm",
    "RightUpperArm",
    "RightLowerArm",
    "LeftUpperLeg",
    "LeftLowerLeg",
    "LeftFoot",
    "RightUpperLeg",
    "RightLowerLeg",
    "RightFoot",
];

/// An observer, and whoever draws what is worn besides.
pub struct Avatar<'a> {
    observer: &'a dyn Observer,
    to: Option<Receiver>,
}

/// Who is sent to.
struct Receiver {
    socket: UdpSocket,
    body: Proportions,
    /// How each segment is turned in T pose.
    spread: [DQuat; 13],
    began: Instant,
}

impl<'a> Avatar<'a> {
    /// Sends to `place`, written `HOST:PORT`, if it is wanted; the observer hears the same as ever.
    ///
    /// # Errors
    /// What is no such address, or cannot be sent to.
    pub fn new(observer: &'a dyn Observer, place: Option<&str>) -> Result<Self, Error> {
        Ok(Self { observer, to: place.map(Receiver::open).transpose()? })
    }
}

impl Receiver {
    fn open(place: &str) -> Result<Self, Error> {
        let refused = |got: String| {
            Error::new("nothing can be sent there")
                .at(format!("--vmc {place}"))
                .got(got)
                .allowed("HOST:PORT, usually 127.0.0.1:39539")
        };
        let found = place.to_socket_addrs().map_err(|e| refused(e.to_string()))?.next();
        let to = found.ok_or_else(|| refused("no such host".to_owned()))?;
        if to.port() == 0 {
            return Err(refused("port 0, which is nobody's".to_owned()));
        }
        let from: SocketAddr = match to {
            SocketAddr::V4(_) => ([0, 0, 0, 0], 0).into(),
            SocketAddr::V6(_) => ([0_u16; 8], 0).into(),
        };
        let socket = UdpSocket::bind(from).map_err(|e| refused(e.to_string()))?;
        let ready = socket.connect(to).and_then(|()| socket.set_nonblocking(true));
        ready.map_err(|e| refused(e.to_string()))?;
        let body = Proportions::of_stature(DRAWN_FOR_M)?;
        let spread = t_pose().to_pose(DVec3::ZERO, DQuat::IDENTITY).orientation;
        Ok(Self { socket, body, spread, began: MonotonicClock.now() })
    }

    fn send(&self, pose: &SegmentPose) {
        let time_s = MonotonicClock.now().seconds_since(self.began);
        let packet = packet(&self.body, &self.spread, pose, time_s);
        // Whoever draws may come and go.
        let _ = self.socket.send(packet.bytes());
    }
}

impl Observer for Avatar<'_> {
    fn hear(&self, event: Event<'_>) {
        if let (Some(to), Event::Posed { pose, .. }) = (&self.to, event) {
            to.send(pose);
        }
        self.observer.hear(event);
    }

    fn looks(&self) -> bool {
        self.to.is_some() || self.observer.looks()
    }

    fn wants_to_stop(&self) -> bool {
        self.observer.wants_to_stop()
    }

    fn watch(&self, progress: &Progress<'_>) {
        self.observer.watch(progress);
    }
}

/// A pose as one bundle.
fn packet(body: &Proportions, spread: &[DQuat; 13], pose: &SegmentPose, time_s: f64) -> OscBundle {
    let mut bundle = OscBundle::default();
    bundle.tell("/VMC/Ext/OK", &[OscValue::Int(1)]);
    bundle.tell("/VMC/Ext/T", &[OscValue::Float(time_s as f32)]);
    tell_place(&mut bundle, "/VMC/Ext/Root/Pos", "root", DVec3::ZERO, DQuat::IDENTITY);
    let at = body.positions(pose);
    let all = at.joints_m.iter().chain(&at.ends_m);
    let floor_m = all.map(|point_m| point_m.z).fold(f64::INFINITY, f64::min);
    let turned =
        |segment: Segment| pose.orientation[segment.index()] * spread[segment.index()].inverse();
    for (segment, bone) in Segment::ALL.into_iter().zip(BONES) {
        let here_m = at.joint_m(proximal_joint(segment));
        let (place_m, turn) = match segment.parent() {
            None => (DVec3::Z * (here_m.z - floor_m), turned(segment)),
            Some(parent) => {
                let back = turned(parent).inverse();
                let from_m = at.joint_m(proximal_joint(parent));
                (back * (here_m - from_m), back * turned(segment))
            }
        };
        tell_place(&mut bundle, "/VMC/Ext/Bone/Pos", bone, place_m, turn);
    }
    bundle
}

/// X forward, Y left and Z up become Z, -X and Y; mirrored, a turn is the other way about its axis.
fn tell_place(bundle: &mut OscBundle, address: &str, name: &str, place_m: DVec3, turn: DQuat) {
    let numbers = [-place_m.y, place_m.z, place_m.x, turn.y, -turn.z, -turn.x, turn.w];
    let mut values = vec![OscValue::Text(name)];
    values.extend(numbers.map(|number| OscValue::Float(number as f32)));
    bundle.tell(address, &values);
}
