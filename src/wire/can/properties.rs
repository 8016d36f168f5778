//! For all frames: decoders give a value or none and never panic, and numbers survive the way out.

use super::{
    CanFrame, CanId, Format, Number, cubemars, damiao, error_frame, fd_length, mit, moteus, odrive,
    recoil, robstride,
};
use proptest::prelude::*;

fn any_frame() -> impl Strategy<Value = CanFrame> {
    let id = prop_oneof![
        (0_u32..0x800).prop_filter_map("fits", CanId::standard),
        (0_u32..0x2000_0000).prop_filter_map("fits", CanId::extended),
    ];
    let bytes = proptest::collection::vec(any::<u8>(), 0..=64);
    (id, bytes, any::<bool>(), any::<bool>()).prop_filter_map("fits", |(id, bytes, fd, flag)| {
        let format = match (fd, flag) {
            (true, fast) => Format::Fd { fast },
            (false, true) => Format::Remote { length: bytes.len() as u8 % 9 },
            (false, false) => Format::Classic,
        };
        let length = match format {
            Format::Classic => bytes.len().min(8),
            Format::Remote { .. } => 0,
            Format::Fd { .. } => fd_length(bytes.len()).filter(|&l| l == bytes.len()).unwrap_or(0),
        };
        CanFrame::new(id, format, &bytes[..length])
    })
}

proptest! {
    #[test]
    fn any_frame_gives_every_decoder_a_value_or_none(frame in any_frame(), number in any::<u8>()) {
        let _ = cubemars::mit_reply(&frame);
        let _ = cubemars::servo_feedback(&frame);
        let _ = robstride::message(&frame);
        let _ = odrive::message(&frame);
        let _ = recoil::message(&frame);
        let _ = moteus::ends(&frame);
        if let Some(id) = damiao::Id::new(number) {
            let _ = damiao::feedback(id, 0x11, &frame);
            let _ = damiao::register_value(id, 0x11, number, &frame);
        }
        if let Some(id) = moteus::Id::new(number) {
            let _ = moteus::feedback(id, &frame);
        }
        let report = error_frame::ErrorFrame::decode(frame.id().number(), frame.payload());
        prop_assert!(!report.to_string().is_empty());
    }

    #[test]
    fn any_bytes_end_a_moteus_reply(bytes in proptest::collection::vec(any::<u8>(), 0..=64)) {
        // Every part but a value takes at least two bytes, and a value at least one.
        prop_assert!(moteus::parts(&bytes).count() <= 1 + bytes.len());
    }

    /// Unpacked here by shifting the whole number, as the drawing of the frame has it.
    #[test]
    fn a_setpoint_keeps_every_bit(
        position in any::<u16>(),
        velocity in 0_u16..0x1000,
        kp in 0_u16..0x1000,
        kd in 0_u16..0x1000,
        torque in 0_u16..0x1000,
    ) {
        let setpoint = mit::Setpoint { position, velocity, kp, kd, torque };
        let id = CanId::standard_of(1);
        let frame = mit::setpoint(id, setpoint);
        let whole = frame.payload().iter().fold(0, |whole: u64, b| whole << 8 | u64::from(*b));
        let field = |shift: u32| u64::from(u16::MAX >> 4) & whole >> shift;
        prop_assert_eq!(whole >> 48, u64::from(position));
        let fields = [field(36), field(24), field(12), field(0)];
        prop_assert_eq!(fields, [velocity, kp, kd, torque].map(u64::from));
    }

    #[test]
    fn a_reply_keeps_every_bit(p in any::<u16>(), v in 0_u16..0x1000, t in 0_u16..0x1000) {
        let whole = u64::from(p) << 24 | u64::from(v) << 12 | u64::from(t);
        let [_, _, _, bytes @ ..] = whole.to_be_bytes();
        let code = |code, bits| Number::Code { code, bits };
        prop_assert_eq!(mit::state(bytes), [code(p, 16), code(v, 12), code(t, 12)]);
    }

    #[test]
    fn written_registers_come_back_as_they_went(
        values in proptest::collection::vec(any::<i16>(), 1..=28),
        start in 0_u16..0x200,
    ) {
        let mut message = moteus::Message::default();
        message.write(start, moteus::Values::Int16(&values)).expect("fits");
        let one = moteus::Id::new(1).expect("an id");
        let route = moteus::Route { source: one, destination: one, reply: false, fast: true };
        let mut reply = message.frame(route).payload().to_vec();
        reply[0] |= 0x20; // a reply has the form of a write
        let got: Vec<_> = moteus::parts(&reply).collect();
        let wanted: Vec<_> = values.iter().enumerate().map(|(k, &x)| {
            let number = (x != i16::MIN).then_some(Number::Steps(x.into()));
            moteus::Part::Value(u32::from(start) + k as u32, number)
        }).collect();
        prop_assert_eq!(got, wanted);
    }
}
