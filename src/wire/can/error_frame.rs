//! What Linux reports of the line itself: "error frames", which never were on the line.
//!
//! Source: Linux, `include/uapi/linux/can/error.h` and `Documentation/networking/can.rst`.

use std::fmt;

/// One report of the line. It may tell of several things at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ErrorFrame {
    classes: u32,
    controller: u8,
    counters: Option<[u8; 2]>,
}

const TX_TIMEOUT: u32 = 1;
pub(super) const LOST_ARBITRATION: u32 = 1 << 1;
pub(super) const CONTROLLER: u32 = 1 << 2;
pub(super) const PROTOCOL: u32 = 1 << 3;
const TRANSCEIVER: u32 = 1 << 4;
pub(super) const NO_ACK: u32 = 1 << 5;
pub(super) const BUS_OFF: u32 = 1 << 6;
pub(super) const BUS_ERROR: u32 = 1 << 7;
const RESTARTED: u32 = 1 << 8;
pub(super) const COUNTERS: u32 = 1 << 9;

pub(super) const RECEIVE_OVERFLOW: u8 = 0b1;
pub(super) const SEND_OVERFLOW: u8 = 0b10;
const OVERFLOW: u8 = RECEIVE_OVERFLOW | SEND_OVERFLOW;
pub(super) const WARNING: u8 = 0b1100;
pub(super) const PASSIVE: u8 = 0b11_0000;
pub(super) const ACTIVE: u8 = 0b100_0000;

impl ErrorFrame {
    /// From the bits of its identifier (without the error flag) and its bytes. Bits nobody has
    /// defined yet are left alone, missing bytes count as zero.
    #[must_use]
    pub fn decode(classes: u32, payload: &[u8]) -> Self {
        let byte = |k: usize| payload.get(k).copied().unwrap_or(0);
        let controller = if classes & CONTROLLER != 0 { byte(1) } else { 0 };
        let counters = (classes & COUNTERS != 0).then(|| [byte(6), byte(7)]);
        Self { classes, controller, counters }
    }

    /// The controller has left the line after too many errors; nothing is sent or heard until the
    /// interface is restarted.
    #[must_use]
    pub const fn bus_off(self) -> bool {
        self.classes & BUS_OFF != 0
    }

    /// Nobody acknowledged what was sent: no device is powered, or the line is cut.
    #[must_use]
    pub const fn no_ack(self) -> bool {
        self.classes & NO_ACK != 0
    }

    /// So many errors that the controller may not speak up any more.
    #[must_use]
    pub const fn passive(self) -> bool {
        self.controller & PASSIVE != 0
    }

    /// Many errors.
    #[must_use]
    pub const fn warning(self) -> bool {
        self.controller & WARNING != 0
    }

    /// The controller lost frames because nobody fetched them, or had no room for more.
    #[must_use]
    pub const fn overflow(self) -> bool {
        self.controller & OVERFLOW != 0
    }

    /// The controller takes part again, after bus-off or after errors.
    #[must_use]
    pub const fn recovered(self) -> bool {
        self.classes & RESTARTED != 0 || self.controller & ACTIVE != 0
    }

    /// Error counters of the controller, sending and receiving, where the driver tells them.
    #[must_use]
    pub const fn counters(self) -> Option<[u8; 2]> {
        self.counters
    }
}

impl fmt::Display for ErrorFrame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let said = [
            (self.bus_off(), "bus off"),
            (self.no_ack(), "no acknowledgement"),
            (self.passive(), "error passive"),
            (self.warning(), "many errors"),
            (self.overflow(), "frames lost in the controller"),
            (self.classes & TX_TIMEOUT != 0, "sending timed out"),
            (self.classes & LOST_ARBITRATION != 0, "arbitration lost"),
            (self.classes & PROTOCOL != 0, "protocol violated"),
            (self.classes & TRANSCEIVER != 0, "transceiver or wiring"),
            (self.classes & BUS_ERROR != 0, "bus error"),
            (self.recovered(), "recovered"),
        ];
        let words: Vec<_> = said.iter().filter(|(is, _)| *is).map(|(_, words)| *words).collect();
        f.write_str(if words.is_empty() { "unknown report" } else { "" })?;
        f.write_str(&words.join(", "))?;
        if let Some([sending, receiving]) = self.counters {
            write!(f, " (errors sending {sending}, receiving {receiving})")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_report_may_tell_of_several_things() {
        let report = ErrorFrame::decode(0x60, &[0; 8]);
        assert!(report.bus_off() && report.no_ack() && !report.passive());
        assert_eq!(report.to_string(), "bus off, no acknowledgement");
    }

    #[test]
    fn the_controllers_byte_counts_only_if_its_class_is_named() {
        let bytes = [0, 0x20, 0, 0, 0, 0, 128, 7];
        let report = ErrorFrame::decode(0x204, &bytes);
        assert!(report.passive() && !report.warning());
        assert_eq!(report.counters(), Some([128, 7]));
        assert_eq!(report.to_string(), "error passive (errors sending 128, receiving 7)");
        assert!(!ErrorFrame::decode(0x20, &bytes).passive());
    }

    #[test]
    fn a_report_without_bytes_is_still_one() {
        assert_eq!(ErrorFrame::decode(0x204, &[]).counters(), Some([0, 0]));
        assert_eq!(ErrorFrame::decode(0, &[]).to_string(), "unknown report");
        assert!(ErrorFrame::decode(0x100, &[]).recovered());
    }
}
