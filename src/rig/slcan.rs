//! A CAN line behind an adapter that speaks slcan on a serial line.

use super::address::BusKind;
use super::wire::{CAN_LATENCY, interface_at, spoken, wire};
use crate::error::{Error, ErrorKind};
use crate::port::slcan::{NotOpened, SlcanAdapter, SlcanSpeeds};
use crate::port::{FramePort, PortError};
use crate::time::Duration;
use crate::wire::can::slcan::RATES_BPS;
use gaitway_profiles::CanSpeed;

/// Speed of an adapter's serial line if nobody says one, bit/s. Most are USB devices, to which it means nothing.
const USUAL_BAUD_BPS: u32 = 115_200;

/// Speeds of the line at `bus`: those that were typed, else those of the robot's file or the usual ones.
pub(super) fn speed_at(bus: &BusKind, known: CanSpeed) -> CanSpeed {
    match *bus {
        BusKind::Slcan { bitrate_bps, data_bitrate_bps, .. } => CanSpeed {
            bitrate_bps: bitrate_bps.unwrap_or(known.bitrate_bps),
            data_bitrate_bps: data_bitrate_bps.or(known.data_bitrate_bps),
            ..known
        },
        _ => known,
    }
}

/// The CAN line at `bus`, an interface or an adapter, at `speed`, and how long frames may be held back.
pub(super) fn frames_at(
    bus: &BusKind,
    speed: CanSpeed,
) -> Result<(Box<dyn FramePort>, Duration), Error> {
    match bus {
        BusKind::Can { interface } => Ok((interface_at(interface, speed)?, CAN_LATENCY)),
        BusKind::Slcan { adapter, .. } => adapter_at(bus, adapter, speed),
        _ => Err(not_can(bus)),
    }
}

pub(super) fn not_can(bus: &BusKind) -> Error {
    Error::new("not a CAN line")
        .at(bus.to_string())
        .allowed("can:can0, can:slcan:/dev/ttyACM0, or sim and sim:pty with --robot")
}

fn adapter_at(
    bus: &BusKind,
    adapter: &BusKind,
    speed: CanSpeed,
) -> Result<(Box<dyn FramePort>, Duration), Error> {
    let (port, latency) = wire(adapter, adapter.baud_bps().unwrap_or(USUAL_BAUD_BPS))?;
    let CanSpeed { bitrate_bps, data_bitrate_bps, .. } = speed;
    let speeds = SlcanSpeeds { bitrate_bps, data_bitrate_bps };
    let place = bus.to_string();
    match SlcanAdapter::open(port, &place, speeds) {
        Ok(port) => Ok((Box::new(port), latency)),
        Err(error) => Err(not_opened(place, &error)),
    }
}

fn not_opened(place: String, error: &NotOpened) -> Error {
    match error {
        NotOpened::Port(PortError::TimedOut) | NotOpened::Silent => {
            Error::of(ErrorKind::Silent, "nothing there answers as an slcan adapter does")
                .at(place)
                .got("no answer to V, S and O")
                .remedy(
                    "`gaitway ports` lists what is there; an adapter with other firmware (candleLight, gs_usb) is a \
                     CAN interface of the system: can:can0. One that has to be spoken to at a certain speed: ?baud=N",
                )
        }
        NotOpened::Port(error) => Error::of(ErrorKind::Io, "the adapter is lost while it is opened")
            .at(place)
            .got(spoken(error))
            .remedy("plug it in again; `gaitway ports` lists what is there"),
        NotOpened::Refused(command, what) => {
            Error::of(ErrorKind::Refused, "the slcan adapter refuses what it needs to do")
                .at(place)
                .got(format!("no to {command}: {what}"))
                .remedy("plug the adapter out and in again; it may not know this bit rate, or no CAN FD")
        }
        NotOpened::NoSuchRate(bps) => {
            let rates: Vec<String> = RATES_BPS.iter().map(ToString::to_string).collect();
            Error::new("slcan adapters cannot be told this bit rate")
                .at(place)
                .got(format!("{bps} bit/s"))
                .allowed(format!(
                    "{} bit/s; of fast payloads 1000000, 2000000, 4000000, 5000000",
                    rates.join(", ")
                ))
        }
    }
}
