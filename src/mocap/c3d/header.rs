//! The first 512 bytes of a C3D file.

use super::number::Processor;
use crate::mocap::markers::MarkerEvent;
use crate::mocap::parameters::text_of;

/// Bytes of a block, the unit in which places in the file are counted.
pub const BLOCK: usize = 512;
/// What the second byte must be.
pub const KEY: u8 = 0x50;
/// What stands before labels of four characters.
const EVENTS_KEY: u16 = 12_345;
/// Most events of a header.
pub const MAX_EVENTS: usize = 18;

/// The header. Its numbers are copies of parameters, and not always good ones.
#[derive(Clone, Debug, PartialEq)]
pub struct Header {
    /// Points per frame.
    pub points: u16,
    /// Analog counts per frame.
    pub analog: u16,
    /// Number of the first frame.
    pub first: u16,
    /// Number of the last frame; 65,535 in longer files.
    pub last: u16,
    /// Size of a count of an integer file; negative of a real one.
    pub scale: f32,
    /// Block in which the data begin, from 1.
    pub data_start: u16,
    /// Analog samples of a channel per frame.
    pub per_frame: u16,
    /// Frames per second.
    pub rate_hz: f32,
    /// Events.
    pub events: Vec<MarkerEvent>,
}

impl Header {
    /// Reads the block; what it lacks is zero.
    pub fn read(block: &[u8], processor: Processor) -> Self {
        let word = |number: usize| processor.word16_at(block, 2 * (number - 1)).unwrap_or(0);
        let float = |number: usize| processor.float_at(block, 2 * (number - 1)).unwrap_or(0.0);
        Self {
            points: word(2),
            analog: word(3),
            first: word(4),
            last: word(5),
            scale: float(7),
            data_start: word(9),
            per_frame: word(10),
            rate_hz: float(11),
            events: events(block, processor),
        }
    }

    /// Frames that it claims; `None` if the last comes before the first.
    pub fn frames(&self) -> Option<u64> {
        (self.last >= self.first).then(|| u64::from(self.last - self.first) + 1)
    }

    /// The block, for an Intel machine, with the parameters in the second block.
    pub fn write(&self) -> [u8; BLOCK] {
        let mut block = [0; BLOCK];
        let mut put = |number: usize, bytes: &[u8]| {
            if let Some(place) =
                block.get_mut(2 * (number - 1)..).and_then(|rest| rest.get_mut(..bytes.len()))
            {
                place.copy_from_slice(bytes);
            }
        };
        put(1, &[2, KEY]);
        put(2, &self.points.to_le_bytes());
        put(3, &self.analog.to_le_bytes());
        put(4, &self.first.to_le_bytes());
        put(5, &self.last.to_le_bytes());
        put(7, &self.scale.to_le_bytes());
        put(9, &self.data_start.to_le_bytes());
        put(10, &self.per_frame.to_le_bytes());
        put(11, &self.rate_hz.to_le_bytes());
        put(150, &EVENTS_KEY.to_le_bytes());
        let count = self.events.len().min(MAX_EVENTS);
        put(151, &(count as u16).to_le_bytes());
        for (at, event) in self.events.iter().take(MAX_EVENTS).enumerate() {
            put(153 + 2 * at, &(event.time_s as f32).to_le_bytes());
            let mut label = [b' '; 4];
            for (place, byte) in label.iter_mut().zip(event.label.bytes()) {
                *place = byte;
            }
            put(199 + 2 * at, &label);
        }
        block
    }
}

fn events(block: &[u8], processor: Processor) -> Vec<MarkerEvent> {
    let word = |number: usize| processor.word16_at(block, 2 * (number - 1)).unwrap_or(0);
    if word(150) != EVENTS_KEY {
        return Vec::new();
    }
    let count = usize::from(word(151)).min(MAX_EVENTS);
    let event = |at: usize| {
        let time_s = f64::from(processor.float_at(block, 2 * (152 + 2 * at))?);
        let label = block.get(2 * (198 + 2 * at)..)?.first_chunk::<4>()?;
        let label = text_of(label).trim_matches(['\0', ' ']).to_owned();
        let (context, subject, description) = Default::default();
        let event = MarkerEvent { time_s, label, context, subject, description };
        time_s.is_finite().then_some(event)
    };
    (0..count).filter_map(event).collect()
}
