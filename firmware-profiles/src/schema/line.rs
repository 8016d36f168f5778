//! The type of a robot's lines: serial or CAN, each with the speeds of its kind.

use serde::Deserialize;

/// Host id on a CAN line unless the file says otherwise: that of the examples in the CyberGear
/// manual (section 4).
const HOST_ID: u8 = 0xFD;

/// One shared line.
#[derive(Clone, Debug, Deserialize)]
#[serde(try_from = "Keys")]
pub struct Line {
    /// Name used by `--bus NAME=BUS`.
    pub name: String,
    /// What kind it is, and how fast.
    pub kind: LineKind,
}

/// Kinds of lines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LineKind {
    /// Half-duplex serial line.
    Serial {
        /// Bits per second.
        baud_bps: u32,
    },
    /// CAN line.
    Can(CanSpeed),
}

/// How fast a CAN line is, and who the host is on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CanSpeed {
    /// Bits per second; of FD frames those outside the payload.
    pub bitrate_bps: u32,
    /// Bits per second in the payload of FD frames; absent: there are none.
    pub data_bitrate_bps: Option<u32>,
    /// The host's own id, for the dialect that has one (RobStride).
    pub host_id: u8,
}

impl Line {
    /// Bits per second of a serial line.
    #[must_use]
    pub fn baud_bps(&self) -> Option<u32> {
        match self.kind {
            LineKind::Serial { baud_bps } => Some(baud_bps),
            LineKind::Can(_) => None,
        }
    }

    /// Speeds of a CAN line.
    #[must_use]
    pub fn can(&self) -> Option<CanSpeed> {
        match self.kind {
            LineKind::Serial { .. } => None,
            LineKind::Can(speed) => Some(speed),
        }
    }
}

/// A line as the file has it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Keys {
    name: String,
    #[serde(default)]
    kind: Kind,
    baud_bps: Option<u32>,
    bitrate_bps: Option<u32>,
    data_bitrate_bps: Option<u32>,
    host_id: Option<u8>,
}

#[derive(Clone, Copy, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Kind {
    #[default]
    Serial,
    Can,
}

impl TryFrom<Keys> for Line {
    type Error = String;

    fn try_from(keys: Keys) -> Result<Self, String> {
        let Keys { name, kind, baud_bps, bitrate_bps, data_bitrate_bps, host_id } = keys;
        let kind = match (kind, baud_bps, bitrate_bps) {
            (Kind::Serial, Some(baud_bps), None)
                if data_bitrate_bps.is_none() && host_id.is_none() =>
            {
                LineKind::Serial { baud_bps }
            }
            (Kind::Serial, ..) => {
                return Err(format!(
                    "line {name:?}: a serial line has baud_bps and no other speed"
                ));
            }
            (Kind::Can, None, Some(bitrate_bps)) => LineKind::Can(CanSpeed {
                bitrate_bps,
                data_bitrate_bps,
                host_id: host_id.unwrap_or(HOST_ID),
            }),
            (Kind::Can, ..) => {
                return Err(format!("line {name:?}: a CAN line has bitrate_bps and no baud_bps"));
            }
        };
        Ok(Self { name, kind })
    }
}
