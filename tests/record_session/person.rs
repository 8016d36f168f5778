//! A virtual person who wears sensors and does what the test says, in real time: what is said next is
//! not known beforehand, so the motion cannot be either.

use gaitway::action::Motion;
use gaitway::body::proportions::proximal_joint;
use gaitway::body::{Dof, JointAngles, Proportions, Segment, SegmentPose};
use gaitway_sim::imu::{GRAVITY_M_S2, ImuWire, Measured};
use glam::{DQuat, DVec3};
use rustix::fd::OwnedFd;
use rustix::fs::{Mode, OFlags};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{
    OptionalActions, QueueSelector, ioctl_tiocnxcl, tcflush, tcgetattr, tcsetattr,
};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Samples per second: the profile's.
const RATE_HZ: f64 = 100.0;
/// From one act to the next, s.
const CHANGE_S: f64 = 0.4;
pub const STATURE_M: f64 = 1.70;

/// What the person does.
#[derive(Clone)]
pub enum Act {
    /// Stands so.
    Pose(JointAngles),
    /// Turns these by so many radians and back, again and again, once in so many seconds.
    Swing(Vec<Dof>, f64, f64),
    /// Bows with a straight back, 0.9 rad, once in so many seconds.
    Bow(f64),
    /// An action, once, twice as fast as usual. Sensors feel every kink, so it is asked as it is and
    /// not as samples of it.
    Action(Arc<Motion>),
}

/// Angles and how far the pelvis leans forward, rad.
type State = (JointAngles, f64);

impl Act {
    fn at(&self, time_s: f64) -> State {
        let swing = |period_s: f64| {
            0.5 * (1.0 - (std::f64::consts::TAU * time_s.max(0.0) / period_s).cos())
        };
        match self {
            Self::Pose(angles) => (*angles, 0.0),
            Self::Swing(dofs, far_rad, period_s) => {
                let mut angles = JointAngles::default();
                for dof in dofs {
                    angles[*dof] = far_rad * swing(*period_s);
                }
                (angles, 0.0)
            }
            Self::Bow(period_s) => (JointAngles::default(), 0.9 * swing(*period_s)),
            Self::Action(motion) => {
                let at_s = (2.0 * time_s).clamp(0.0, motion.duration_s());
                (motion.angles_at(at_s), 0.0)
            }
        }
    }
}

/// What is done since when, and from which state.
struct Doing {
    from: State,
    act: Act,
    since_s: f64,
    /// When the person was tapped.
    taps_s: Vec<f64>,
}

impl Doing {
    fn at(&self, time_s: f64) -> State {
        let x = ((time_s - self.since_s) / CHANGE_S).clamp(0.0, 1.0);
        let share = x * x * x * (10.0 - 15.0 * x + 6.0 * x * x);
        // The act begins once it is reached, from where it begins.
        let (angles, lean) = self.act.at(time_s - self.since_s - CHANGE_S);
        let mix = |from: f64, to: f64| from + share * (to - from);
        let mixed = std::array::from_fn(|n| mix(self.from.0.0[n], angles.0[n]));
        (JointAngles(mixed), mix(self.from.1, lean))
    }

    fn pose(&self, time_s: f64) -> SegmentPose {
        let (angles, lean) = self.at(time_s);
        angles.to_pose(DVec3::Z, DQuat::from_rotation_y(lean))
    }

    /// A blow of 20 ms and 100 m/s^2, upwards.
    fn blow_m_s2(&self, time_s: f64) -> f64 {
        let bell = |tap_s: &f64| {
            let x = (time_s - tap_s) / 0.01;
            if x.abs() < 1.0 { 50.0 * (1.0 + (std::f64::consts::PI * x).cos()) } else { 0.0 }
        };
        self.taps_s.iter().map(bell).sum()
    }
}

/// A sensor on a segment, at the far end of a line.
struct Line {
    segment: Segment,
    mount: DQuat,
    /// Both ends of its line, while it is plugged in.
    port: Mutex<Option<(OwnedFd, OwnedFd)>>,
    /// A link to the terminal that it is behind.
    link: PathBuf,
    /// What was said and is not on the line yet.
    pending: Mutex<Vec<u8>>,
    /// It lost its battery.
    is_silent: AtomicBool,
}

impl Line {
    fn new(segment: Segment, mount: DQuat, folder: &Path) -> Self {
        let link = folder.join(gaitway::body::segment_name(segment));
        let (port, pending, is_silent) = Default::default();
        let line = Self { segment, mount, port, link, pending, is_silent };
        line.plug();
        line
    }

    /// Plugs it in, perhaps behind another terminal than before.
    fn plug(&self) {
        // The program that listens holds no end of it, or nobody could pull it out.
        let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC;
        let master = openpt(flags).expect("a terminal");
        grantpt(&master).and_then(|()| unlockpt(&master)).expect("a terminal of ours");
        let path = ptsname(&master, Vec::new()).expect("a name").into_string().expect("ASCII");
        let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC;
        let slave = rustix::fs::open(path.as_str(), flags, Mode::empty()).expect("its other end");
        let mut settings = tcgetattr(&slave).expect("settings");
        settings.make_raw();
        tcsetattr(&slave, OptionalActions::Now, &settings).expect("raw");
        rustix::fs::fcntl_setfl(&master, OFlags::RDWR | OFlags::NONBLOCK).expect("patience");
        let _ = std::fs::remove_file(&self.link);
        std::os::unix::fs::symlink(path, &self.link).expect("a link");
        *self.port.lock().expect("nobody fell") = Some((master, slave));
    }

    /// Pulls it out.
    fn pull(&self) {
        let _ = std::fs::remove_file(&self.link);
        *self.port.lock().expect("nobody fell") = None;
        self.pending.lock().expect("nobody fell").clear();
    }

    /// Says more. A host that stalls reads later, and not half a line.
    fn say(&self, bytes: &[u8]) {
        let mut pending = self.pending.lock().expect("nobody fell");
        let port = self.port.lock().expect("nobody fell");
        let Some((master, _)) = &*port else { return };
        pending.extend_from_slice(bytes);
        if let Ok(written) = rustix::io::write(master, &pending) {
            pending.drain(..written);
        }
    }

    /// What the sensor measures of a motion, from differences over two milliseconds.
    fn measured(&self, doing: &Doing, body: &Proportions, number: u64) -> Measured {
        const STEP_S: f64 = 0.002;
        let time_s = number as f64 / RATE_HZ;
        let [before, now, after] = [-STEP_S, 0.0, STEP_S].map(|off| {
            let pose = doing.pose(time_s + off);
            let q = pose.orientation[self.segment.index()];
            let joint = body.positions(&pose).joint_m(proximal_joint(self.segment));
            (q, joint + q * (self.segment.long_axis() * 0.1))
        });
        let turned = (now.0 * self.mount).inverse();
        let step = after.0 * before.0.inverse();
        let step = if step.w < 0.0 { -step } else { step };
        let rate = turned * (step.to_scaled_axis() / (2.0 * STEP_S));
        let acceleration = (after.1 - 2.0 * now.1 + before.1) / (STEP_S * STEP_S);
        let up = DVec3::Z * (GRAVITY_M_S2 + doing.blow_m_s2(time_s));
        // As sensors have it; in 17 samples all of it comes once, and its mean is nothing.
        let noise = |axis: u64| ((number * 5 + axis * 3) % 17) as f64 / 8.0 - 1.0;
        let noise = DVec3::new(noise(0), noise(1), noise(2));
        Measured {
            rate_rad_s: (rate + 0.002 * noise).to_array(),
            specific_force_m_s2: (turned * (acceleration + up) + 0.02 * noise).to_array(),
            linear_acceleration_m_s2: (turned * acceleration).to_array(),
            field_t: [0.0; 3],
            orientation: [1.0, 0.0, 0.0, 0.0],
            number,
            device_s: time_s,
        }
    }
}

/// The person; ends with the test.
pub struct Person {
    doing: Arc<Mutex<Doing>>,
    lines: Arc<Vec<Line>>,
    is_heard: Arc<AtomicBool>,
    stop: Arc<AtomicBool>,
    began: Instant,
    thread: Option<JoinHandle<()>>,
}

impl Person {
    /// Stands in N pose and wears sensors on these segments.
    pub fn wearing(segments: &[Segment]) -> Self {
        static PERSONS: AtomicU32 = AtomicU32::new(0);
        let number = PERSONS.fetch_add(1, Ordering::Relaxed);
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR"))
            .join(format!("{}-person-{number}", env!("CARGO_CRATE_NAME")));
        std::fs::create_dir_all(&folder).expect("a folder");
        let line = |(n, segment): (usize, &Segment)| {
            let mount = DQuat::from_rotation_z(0.2 * n as f64 - 0.3) * DQuat::from_rotation_y(0.15);
            Line::new(*segment, mount, &folder)
        };
        let lines: Arc<Vec<Line>> = Arc::new(segments.iter().enumerate().map(line).collect());
        let still = (JointAngles::default(), 0.0);
        let act = Act::Pose(JointAngles::default());
        let doing = Doing { from: still, act, since_s: 0.0, taps_s: Vec::new() };
        let doing = Arc::new(Mutex::new(doing));
        let (is_heard, stop) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicBool::new(false)));
        let began = Instant::now();
        let shared = (Arc::clone(&doing), Arc::clone(&lines), Arc::clone(&is_heard));
        let ends = Arc::clone(&stop);
        let thread =
            std::thread::spawn(move || perform(began, &shared.0, &shared.1, &shared.2, &ends));
        Self { doing, lines, is_heard, stop, began, thread: Some(thread) }
    }

    fn now_s(&self) -> f64 {
        self.began.elapsed().as_secs_f64()
    }

    /// From now on the person does this.
    pub fn does(&self, act: Act) {
        let mut doing = self.doing.lock().expect("nobody fell");
        // What is sampled next comes after what was sampled last, however late that is.
        let now_s = self.now_s() + 0.05;
        doing.from = doing.at(now_s);
        (doing.act, doing.since_s) = (act, now_s);
    }

    /// Stands in N pose.
    pub fn stands(&self) {
        self.does(Act::Pose(JointAngles::default()));
    }

    /// A sensor says nothing more, or speaks again.
    pub fn silences(&self, segment: Segment, is_silent: bool) {
        let line = self.lines.iter().find(|line| line.segment == segment).expect("it is worn");
        line.is_silent.store(is_silent, Ordering::Release);
    }

    /// The sensor on a segment is pulled out, or plugged in again.
    pub fn pulls(&self, segment: Segment, is_out: bool) {
        let line = self.lines.iter().find(|line| line.segment == segment).expect("it is worn");
        if is_out { line.pull() } else { line.plug() }
    }

    /// Somebody taps the person, so that all sensors feel it.
    pub fn is_tapped(&self) {
        let at_s = self.now_s() + 0.1;
        self.doing.lock().expect("nobody fell").taps_s.push(at_s);
    }

    /// Sources as they are typed.
    pub fn sources(&self) -> Vec<String> {
        let source = |line: &Line| {
            let name = gaitway::body::segment_name(line.segment);
            format!("{name}=imu:arduino-csv@{}", line.link.display())
        };
        self.lines.iter().map(source).collect()
    }

    /// A program is about to open the lines.
    pub fn is_listened_to(&self) {
        self.is_heard.store(true, Ordering::Release);
    }

    /// The program that had them open is gone: what it did not read is lost, and others may have them.
    pub fn is_left(&self) {
        self.is_heard.store(false, Ordering::Release);
        for line in self.lines.iter() {
            line.pending.lock().expect("nobody fell").clear();
            if let Some((_, slave)) = &*line.port.lock().expect("nobody fell") {
                let _ = tcflush(slave, QueueSelector::IFlush);
                let _ = ioctl_tiocnxcl(slave);
            }
        }
    }
}

impl Drop for Person {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// Says sample after sample when it is due; after a stall all that are.
fn perform(
    began: Instant,
    doing: &Mutex<Doing>,
    lines: &[Line],
    is_heard: &AtomicBool,
    stop: &AtomicBool,
) {
    let body = Proportions::of_stature(STATURE_M).expect("a body");
    let mut number = 0_u64;
    while !stop.load(Ordering::Acquire) {
        let due = (began.elapsed().as_secs_f64() * RATE_HZ).floor() as u64;
        while number <= due {
            let doing = doing.lock().expect("nobody fell");
            let speak = |line: &&Line| {
                is_heard.load(Ordering::Acquire) && !line.is_silent.load(Ordering::Acquire)
            };
            for line in lines.iter().filter(speak) {
                line.say(&ImuWire::Csv.encode(&line.measured(&doing, &body, number)));
            }
            number += 1;
        }
        std::thread::sleep(Duration::from_millis(3));
    }
}
