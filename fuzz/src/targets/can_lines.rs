//! Any frame to every decoder of a CAN dialect and to virtual actuators of every family; any bytes
//! to an adapter that speaks slcan, and from one to the driver. No panic, numbers finite, an adapter that
//! says and hears the same however its bytes are cut, and two codecs that read what the other writes.

use gaitway::wire::can::slcan::{self, SlcanReader, SlcanSaid};
use gaitway::wire::can::{
    CanFrame, CanId, Format, cubemars, damiao, error_frame, moteus, odrive, recoil, robstride,
};
use gaitway_sim::can::slcan::Adapter;
use gaitway_sim::can::{self as sim, Actuator, CanHeard, CanLine, CanOptions};

const MODELS: [&str; 7] =
    ["ak80-9", "ak80-9-servo", "dm4310", "cybergear", "odrive-s1", "moteus-n1", "recoil-5010"];

/// Identifier (four bytes), format, then the payload.
fn frame(bytes: &[u8]) -> Option<CanFrame> {
    let [a, b, c, d, format, payload @ ..] = bytes else { return None };
    let number = u32::from_be_bytes([*a, *b, *c, *d]);
    let id = CanId::standard(number).or_else(|| CanId::extended(number & 0x1FFF_FFFF))?;
    let format = match format % 4 {
        0 => Format::Classic,
        1 => Format::Remote { length: format / 4 % 9 },
        fast => Format::Fd { fast: fast == 3 },
    };
    let most = match format {
        Format::Classic => 8,
        Format::Remote { .. } => 0,
        Format::Fd { .. } => 64,
    };
    let payload = &payload[..payload.len().min(most)];
    (0..=payload.len()).rev().find_map(|length| CanFrame::new(id, format, &payload[..length]))
}

fn decoders(frame: &CanFrame) {
    let _ = cubemars::mit_reply(frame);
    let _ = cubemars::servo_feedback(frame);
    let _ = odrive::message(frame);
    let _ = recoil::message(frame);
    let _ = robstride::message(frame);
    let _ = moteus::ends(frame);
    assert!(moteus::parts(frame.payload()).count() <= 1 + frame.payload().len());
    for id in [0, 1, 0x11, 0x7F, 0xFF] {
        if let Some(id) = damiao::Id::new(id) {
            let _ = damiao::feedback(id, 0x11, frame);
            let _ = damiao::register_value(id, 0x11, 7, frame);
        }
        if let Some(id) = moteus::Id::new(id) {
            let _ = moteus::feedback(id, frame);
        }
        if let Some(id) = odrive::Id::new(id) {
            let _ = odrive::words(id, 1, frame);
        }
    }
    let report = error_frame::ErrorFrame::decode(frame.id().number(), frame.payload());
    assert!(!report.to_string().is_empty());
}

fn to_sim(frame: &CanFrame) -> sim::CanFrame {
    let kind = match frame.format() {
        Format::Classic => sim::Kind::Classic,
        Format::Remote { length } => sim::Kind::Remote(length),
        Format::Fd { fast } => sim::Kind::Fd { fast },
    };
    let (id, extended) = (frame.id().number(), frame.id().is_extended());
    sim::CanFrame { id, extended, kind, bytes: frame.payload().to_vec() }
}

/// A few frames to an actuator; whatever it answers, the decoders take.
fn actuator(model: &str, frames: &[CanFrame]) {
    let actuator = Actuator::new(model, 1).expect("a shipped actuator");
    let mut line = CanLine::new(CanOptions::default(), vec![actuator]);
    line.run_until(400_000_000);
    for frame in frames {
        let _ = line.send(to_sim(frame));
        line.run_until(line.now_ns() + 1_000_000);
        while let Some(heard) = line.receive() {
            let CanHeard::Frame(answer) = heard else { continue };
            let id = if answer.extended {
                CanId::extended(answer.id)
            } else {
                CanId::standard(answer.id)
            };
            let format = match answer.kind {
                sim::Kind::Classic => Format::Classic,
                sim::Kind::Remote(length) => Format::Remote { length },
                sim::Kind::Fd { fast } => Format::Fd { fast },
            };
            let answer = CanFrame::new(id.expect("an identifier"), format, &answer.bytes);
            decoders(&answer.expect("a frame that can be on a line"));
        }
    }
    let actuator = &line.actuators()[0];
    assert!(actuator.position_rad().is_finite() && actuator.velocity_rad_s().is_finite());
}

/// What an adapter answers and sends on if it hears `bytes` in portions.
fn adapter(bytes: &[u8], portion: usize) -> (Vec<u8>, Vec<sim::CanFrame>) {
    let mut adapter = Adapter::new(CanOptions::default());
    let (mut said, mut sent) = (adapter.hear(b"S8\rO\r", |_| true), Vec::new());
    for part in bytes.chunks(portion) {
        said.extend(adapter.hear(part, |frame| {
            sent.push(frame);
            true
        }));
    }
    // What it tells of a frame it would take for the same frame.
    let mut fresh = Adapter::new(CanOptions::default());
    fresh.hear(b"S8\rO\r", |_| true);
    for frame in &sent {
        let told = fresh.tell(&CanHeard::Frame(frame.clone()), 0);
        let mut heard = None;
        fresh.hear(&told, |frame| {
            heard = Some(frame);
            true
        });
        assert_eq!(heard.as_ref(), Some(frame));
    }
    (said, sent)
}

/// What the driver makes of an adapter's bytes, and of these frames by way of an adapter that is not its own.
fn driver(bytes: &[u8], frames: &[CanFrame]) {
    let mut reader = SlcanReader::default();
    let said = bytes.iter().filter(|&&byte| reader.next(byte).is_some()).count();
    assert!(said + reader.garbled() as usize <= 2 * bytes.len());
    for frame in frames {
        let mut text = Vec::new();
        slcan::write_frame(frame, &mut text);
        let mut adapter = Adapter::new(CanOptions::default());
        adapter.hear(b"S8\rO\r", |_| true);
        let mut sent = None;
        adapter.hear(&text, |frame| {
            sent = Some(frame);
            true
        });
        assert_eq!(sent, Some(to_sim(frame)));
        let told = adapter.tell(&CanHeard::Frame(to_sim(frame)), 0);
        let mut reader = SlcanReader::default();
        let said: Vec<SlcanSaid> = told.iter().filter_map(|&byte| reader.next(byte)).collect();
        assert_eq!(said, [SlcanSaid::Frame(*frame)]);
    }
}

// The first byte is the family, or the portion in which an adapter's bytes come; frames of an
// actuator are cut from the rest, up to 13 bytes each.
pub fn fuzz(input: &[u8]) {
    let [first, rest @ ..] = input else { return };
    let portion = usize::from(*first).max(1);
    assert_eq!(adapter(rest, portion), adapter(rest, rest.len().max(1)));
    let long: Option<CanFrame> = frame(rest);
    long.iter().for_each(decoders);
    let short: Vec<CanFrame> = rest.chunks(13).filter_map(frame).collect();
    short.iter().for_each(decoders);
    driver(rest, &short);
    driver(rest, long.as_slice());
    let model = MODELS[usize::from(*first) % MODELS.len()];
    actuator(model, &short);
    actuator(model, long.as_slice());
}
