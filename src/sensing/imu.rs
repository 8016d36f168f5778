//! An inertial sensor on a serial line or behind a TCP port.

use super::event::SensingEvent;
use super::intake::{Intake, Named, SourceReport};
use super::{LOOK, PARTIAL_PACKET, PATIENCE};
use crate::capture::Chain;
use crate::device::sensor::stream_format;
use crate::error::Error;
use crate::port::{BytePort, Clock, MonotonicClock, PortError};
use crate::recording::SourceKind;
use crate::time::Duration;
use crate::wire::sensor::Stream;
use gaitway_profiles::{Sensor, hex_bytes};

/// A sensor whose line is open.
pub struct SerialImu {
    name: String,
    address: String,
    sensor: Sensor,
    stream: Stream,
    port: Box<dyn BytePort>,
    again: Again,
}

/// Opens the port of a sensor that was gone once more.
pub type Again = Box<dyn Fn() -> Result<Box<dyn BytePort>, Error> + Send>;

/// How often it is looked whether a sensor is back.
const RETRY: Duration = Duration::from_millis(250);

impl SerialImu {
    /// A sensor of this profile at the other end of `port`.
    ///
    /// # Errors
    /// A profile without a stream.
    pub fn new(
        name: String,
        address: &str,
        sensor: Sensor,
        port: Box<dyn BytePort>,
        again: Again,
    ) -> Result<Self, Error> {
        let format = stream_format(&sensor)?.ok_or_else(|| {
            Error::new("this sensor sends datagrams, not a stream").at(address.to_owned())
        })?;
        let stream = Stream::new(format);
        Ok(Self { name, address: address.to_owned(), sensor, stream, port, again })
    }

    /// Records until it is to stop or the port is gone.
    pub fn record(mut self, intake: &Intake) {
        let metadata = [("profile", self.sensor.name.as_str()), ("source", self.address.as_str())];
        let source = intake.add(&self.name, SourceKind::Imu, &metadata);
        intake.expects(&source, self.sensor.rate_hz);
        let mut chain = Chain::new(&self.sensor, intake.mode);
        let mut ended = self.say(&self.sensor.start.clone()).err();
        let mut buffer = [0_u8; 4096];
        let began = MonotonicClock.now();
        let mut remarked = false;
        let mut stuck = false;
        let mut told_hz = self.sensor.rate_hz;
        let (mut gone, mut gone_s) = (0, 0.0);
        while ended.is_none() && !intake.stopped() {
            match self.port.receive(&mut buffer, MonotonicClock.now() + LOOK) {
                Ok(count) => {
                    let arrival = MonotonicClock.now();
                    self.stream.push(&buffer[..count], |reading| {
                        for captured in chain.take(&reading, arrival).into_iter().flatten() {
                            if captured.stuck != stuck {
                                stuck = captured.stuck;
                                let sensor = &*source.name;
                                (intake.tell)(match stuck {
                                    true => SensingEvent::Stuck { sensor },
                                    false => SensingEvent::Unstuck { sensor },
                                });
                            }
                            intake.take(&source, captured);
                        }
                    });
                    intake.samples_at(&source, &chain, &mut told_hz);
                }
                Err(PortError::TimedOut) => {}
                Err(error) if intake.is_patient() => {
                    let (away_s, back) = self.wait_for(intake, &source, &error);
                    (gone, gone_s) = (gone + 1, gone_s + away_s);
                    match back {
                        true => ended = self.say(&self.sensor.start.clone()).err(),
                        false => ended = Some(error),
                    }
                }
                Err(error) => ended = Some(error),
            }
            let silent = chain.timeline().counts().samples == 0;
            if silent && !remarked && MonotonicClock.now().since(began) > PATIENCE {
                remarked = true;
                (intake.tell)(self.silence(&source.name));
            }
        }
        if let Some(error) = ended.as_ref().filter(|_| gone == 0) {
            intake.ended(&source, &error.to_string());
        }
        let counts = self.stream.counts();
        // The first packet is usually cut in two: recording began in the middle of it.
        let tail = counts.stray_bytes <= PARTIAL_PACKET && counts.bad <= 1;
        let _ = self.say(&self.sensor.stop.clone());
        intake.report(SourceReport {
            stray_bytes: counts.stray_bytes,
            bad_packets: if tail { 0 } else { counts.bad },
            gone,
            gone_s,
            ended: ended.map(|error| error.to_string()),
            ..SourceReport::of(&source.name, &chain)
        });
    }

    /// Waits until the port can be opened again, or nobody waits any more; for how long, s, and whether it is back.
    fn wait_for(&mut self, intake: &Intake, source: &Named, why: &PortError) -> (f64, bool) {
        let since = MonotonicClock.now();
        intake.gone(source, &why.to_string());
        while intake.is_patient() {
            MonotonicClock.sleep_until(MonotonicClock.now() + RETRY);
            let Ok(port) = (self.again)() else { continue };
            let gone_s = MonotonicClock.now().seconds_since(since);
            self.port = port;
            self.stream.forget();
            intake.back(source, Some(gone_s));
            return (gone_s, true);
        }
        intake.back(source, None);
        (MonotonicClock.now().seconds_since(since), false)
    }

    /// Why a sensor may be silent, as far as it can be told from what came.
    fn silence<'a>(&'a self, sensor: &'a str) -> SensingEvent<'a> {
        let counts = self.stream.counts();
        match counts.bad + counts.stray_bytes {
            0 => SensingEvent::NothingComes { sensor },
            _ => SensingEvent::NoPackets {
                sensor,
                profile: &self.sensor.name,
                baud_bps: self.sensor.baud_bps.unwrap_or(0),
            },
        }
    }

    fn say(&mut self, commands: &[String]) -> Result<(), PortError> {
        for command in commands.iter().filter_map(|command| hex_bytes(command)) {
            self.port.send(&command, MonotonicClock.now() + LOOK)?;
            // Small devices lose a command that follows at once.
            MonotonicClock.sleep_until(MonotonicClock.now() + LOOK);
        }
        Ok(())
    }
}
