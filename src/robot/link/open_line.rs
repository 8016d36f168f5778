//! One open line, serial or CAN: what every line can say of itself, whichever it is.

use super::LinePort;
use super::can::CanLine;
use crate::bus::can::{CanStats, CanTiming};
use crate::bus::{Bus, Timing};
use crate::port::Clock;
use crate::robot::reading::{LinePlan, LineReads, plan};
use crate::robot::{Joint, Robot};
use crate::time::{Duration, Instant};
use crate::units::line_time_s;
use gaitway_profiles::{LineKind, Role};
use std::sync::Arc;

/// An open line.
pub(super) enum OpenLine {
    Serial(Box<Bus>),
    Can(Box<CanLine>),
}

impl OpenLine {
    /// Line number `line` of the robot behind a port, whose adapter holds back what it received for
    /// `latency` at most.
    pub(super) fn new(
        robot: &Robot,
        line: usize,
        port: LinePort,
        clock: &Arc<dyn Clock>,
        latency: Duration,
    ) -> Self {
        let clock = Arc::clone(clock);
        match port {
            LinePort::Bytes(port) => {
                let baud_bps = robot.lines[line].bits_per_s();
                let return_delay = return_delay(robot, line);
                let timing = Timing { baud_bps, return_delay, latency };
                Self::Serial(Box::new(Bus::new(port, clock, timing)))
            }
            LinePort::Frames(port) => {
                let timing = can_timing(robot.lines[line].kind, latency);
                Self::Can(Box::new(CanLine::new(robot, line, port, clock, timing)))
            }
        }
    }

    pub(super) fn serial(&self) -> Option<&Bus> {
        match self {
            Self::Serial(bus) => Some(bus),
            Self::Can(_) => None,
        }
    }

    pub(super) fn serial_mut(&mut self) -> Option<&mut Bus> {
        match self {
            Self::Serial(bus) => Some(bus),
            Self::Can(_) => None,
        }
    }

    pub(super) fn can(&self) -> Option<&CanLine> {
        match self {
            Self::Serial(_) => None,
            Self::Can(can) => Some(can),
        }
    }

    pub(super) fn can_mut(&mut self) -> Option<&mut CanLine> {
        match self {
            Self::Serial(_) => None,
            Self::Can(can) => Some(can),
        }
    }

    /// How it is read in cycles of `period`; a CAN line tells by itself.
    pub(super) fn plan(
        &self,
        robot: &Robot,
        line: usize,
        firmware: &[u16],
        period: Duration,
    ) -> (LineReads, LinePlan) {
        match self {
            Self::Serial(bus) => plan(robot, line, bus, firmware, period),
            Self::Can(can) => (LineReads::none(), can.plan(&robot.lines[line].name, period)),
        }
    }

    /// The longest that servos wait before they answer; zero on a CAN line.
    pub(super) fn return_delay(&self) -> Duration {
        self.serial().map_or(Duration::ZERO, |bus| bus.timing().return_delay)
    }

    /// Time it was occupied so far, s; of a CAN line with the most stuff bits there can be.
    pub(super) fn busy_s(&self) -> f64 {
        match self {
            Self::Serial(bus) => {
                let bytes = usize::try_from(bus.stats().bytes).unwrap_or(usize::MAX);
                line_time_s(bytes, bus.timing().baud_bps)
            }
            Self::Can(can) => can.stats().busy_s,
        }
    }

    /// What happened on it, if it is a CAN line.
    pub(super) fn can_stats(&self) -> Option<CanStats> {
        self.can().map(CanLine::stats)
    }

    /// What it reported of itself, in words for a person.
    pub(super) fn troubles(&self) -> Option<String> {
        self.can()?.bus().troubles()
    }

    /// A joint whose drive told of a fault together with its state, or that it let go.
    pub(super) fn suspect(&self) -> Option<usize> {
        self.can()?.suspect()
    }

    /// The moment up to which something was said on it.
    pub(super) fn spoken_at(&self) -> Instant {
        match self {
            Self::Serial(bus) => bus.spoken_at(),
            Self::Can(can) => can.spoken_at(),
        }
    }

    /// When it may be spoken to again. A CAN line always may: its frames name their device.
    pub(super) fn ready_at(&self) -> Instant {
        self.serial().map_or(Instant::ZERO, Bus::ready_at)
    }

    /// True if part `part` of the slow facts of a joint of this line can be read by `budget`.
    pub(super) fn health_fits(&self, joint: &Joint, part: usize, budget: Instant) -> bool {
        match (joint.servo(), self) {
            (Some(servo), Self::Serial(bus)) => {
                let length = servo.health.reads().get(part).map_or(0, |&(_, length)| length);
                bus.fits(servo.model.protocol(), usize::from(length), budget)
            }
            (None, Self::Can(can)) => can.fits(budget),
            (Some(_), Self::Can(_)) | (None, Self::Serial(_)) => false,
        }
    }

    /// How late this host was so far in hearing it.
    pub(super) fn host_late(&self) -> Duration {
        match self {
            Self::Serial(bus) => bus.host_late(),
            Self::Can(can) => can.bus().host_late(),
        }
    }

    /// How often a lost answer is asked for again.
    pub(super) fn set_retries(&mut self, retries: u32) {
        match self {
            Self::Serial(bus) => bus.set_retries(retries),
            Self::Can(can) => can.bus_mut().set_retries(retries),
        }
    }

    /// Speaks to whoever heard nothing for `longest`: the answer does not matter.
    pub(super) fn break_silence(
        &mut self,
        robot: &Robot,
        line: usize,
        now: Instant,
        longest: Duration,
    ) {
        match self {
            Self::Serial(bus) => {
                let quiet = now.since(bus.spoken_at()) >= longest;
                let mut joints = robot.joints.iter().filter(|joint| joint.line == line);
                let first = joints.find_map(|joint| Some((joint.id, joint.servo()?)));
                if let Some((id, servo)) = first.filter(|_| quiet) {
                    let _ = bus.ping(servo.model.protocol(), id, now + longest);
                }
            }
            Self::Can(can) => {
                let _ = can.break_silence(longest);
            }
        }
    }
}

fn can_timing(kind: LineKind, latency: Duration) -> CanTiming {
    match kind {
        LineKind::Can(speed) => CanTiming {
            bitrate_bps: speed.bitrate_bps,
            data_bitrate_bps: speed.data_bitrate_bps.unwrap_or(speed.bitrate_bps),
            latency,
        },
        LineKind::Serial { baud_bps } => {
            CanTiming { bitrate_bps: baud_bps, data_bitrate_bps: baud_bps, latency }
        }
    }
}

/// Longest return delay among the servos of line number `line`, as the robot file sets it.
fn return_delay(robot: &Robot, line: usize) -> Duration {
    let on_line = robot.joints.iter().filter(|joint| joint.line == line);
    Duration::from_secs_f64(
        on_line
            .filter_map(|joint| joint.configured(Role::ReturnDelay))
            .fold(0.0, f64::max)
            .clamp(0.0, 1.0),
    )
}
