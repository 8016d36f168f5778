//! Our CAN dialects against the makers' own programs.

use gaitway::wire::can::moteus::{self, MODE_POSITION, Message, Resolution, Values, register};
use gaitway::wire::can::{CanFrame, CanId, Format, Number};
use moteus_protocol::command::{PositionCommand, PositionFormat};
use moteus_protocol::query::{QueryFormat, QueryResult};
use moteus_protocol::{CanFdFrame, calculate_arbitration_id};
use proptest::prelude::*;

fn id(number: u8) -> moteus::Id {
    moteus::Id::new(number).expect("an id")
}

/// Ours is filled up with "nothing" to a length CAN FD has; the maker leaves that to the transport.
fn assert_same(ours: &CanFrame, theirs: &CanFdFrame) {
    let (front, filling) = ours.payload().split_at(theirs.payload().len());
    assert_eq!(front, theirs.payload());
    assert!(filling.iter().all(|&byte| byte == 0x50), "{filling:02X?}");
    assert_eq!(u32::from(theirs.arbitration_id as u16), ours.id().number());
}

proptest! {
    #[test]
    fn a_position_command_with_a_query_is_the_makers_byte_for_byte(
        position in -100.0_f32..100.0,
        velocity in -10.0_f32..10.0,
        torque in -5.0_f32..5.0,
        source in 0_u8..127,
        destination in 0_u8..127,
        reply in any::<bool>(),
    ) {
        let mut theirs = CanFdFrame::new();
        theirs.arbitration_id =
            calculate_arbitration_id(source as _, destination as _, 0, reply) as _;
        let mut command = PositionCommand::new();
        command.position = Some(position);
        command.velocity = Some(velocity);
        command.feedforward_torque = Some(torque);
        command.serialize(&mut theirs, &PositionFormat::default());
        QueryFormat::default().serialize(&mut theirs);

        let mut ours = Message::default();
        ours.write(register::MODE, Values::Int8(&[MODE_POSITION])).expect("fits");
        let values = [position, velocity, torque];
        ours.write(register::COMMAND, Values::Float(&values)).expect("fits");
        ours.read(Resolution::Int8, register::MODE, 1).expect("fits");
        ours.read(Resolution::Float, register::POSITION, 3).expect("fits");
        ours.read(Resolution::Int8, 0x00D, 3).expect("fits");
        let (source, destination) = (id(source), id(destination));
        let route = moteus::Route { source, destination, reply, fast: true };
        assert_same(&ours.frame(route), &theirs);
    }

    #[test]
    fn a_reply_is_read_as_the_maker_reads_it(
        position in -100.0_f32..100.0,
        velocity in -10.0_f32..10.0,
        torque in -5.0_f32..5.0,
        celsius in -20_i8..100,
    ) {
        let mut bytes = vec![0x21, 0x00, 10, 0x2F, 0x01];
        for value in [position, velocity, torque] {
            bytes.extend(value.to_le_bytes());
        }
        bytes.extend([0x22, 0x0E, celsius.cast_unsigned(), 0, 0x50, 0x50, 0x50]);
        let theirs = QueryResult::parse_data(&bytes);
        let reply = CanId::standard(0x100).expect("fits");
        let frame = CanFrame::new(reply, Format::Fd { fast: true }, &bytes).expect("fits");
        let ours = moteus::feedback(id(1), &frame).expect("feedback");
        prop_assert_eq!(ours.position, Some(Number::Value(theirs.position)));
        prop_assert_eq!(ours.velocity, Some(Number::Value(theirs.velocity)));
        prop_assert_eq!(ours.torque, Some(Number::Value(theirs.torque)));
        prop_assert_eq!(ours.temperature, Some(Number::Steps(theirs.temperature as i32)));
        prop_assert_eq!(theirs.fault, 0);
        prop_assert!(ours.faults.is_none());
    }
}
