//! The maker's own package against ours, both ways.

use super::asked::{asked, bytes, hexadecimal, sent};
use super::close;
use gaitway::wire::can::{CanFrame, Number, moteus};
use serde_json::{Value, json};

fn moteus_frame(message: &moteus::Message, reply: bool) -> CanFrame {
    let [source, destination] = [0, 1].map(|number| moteus::Id::new(number).expect("an id"));
    message.frame(moteus::Route { source, destination, reply, fast: true })
}

/// Ours is filled up with "nothing" to a length CAN FD has; the maker leaves that to the transport.
#[track_caller]
fn assert_same_moteus(answer: &Value, ours: &CanFrame) {
    let (id, theirs) = sent(answer);
    assert_eq!(id.number(), ours.id().number());
    let (front, filling) = ours.payload().split_at(theirs.len());
    assert_eq!(front, theirs);
    assert!(filling.iter().all(|&byte| byte == 0x50), "{filling:02X?}");
}

#[test]
fn moteus_sends_what_we_send() {
    use moteus::{MODE_POSITION, Message, Resolution, Values, register};
    let all = |message: &mut Message| {
        message.read(Resolution::Int8, register::MODE, 1).expect("fits");
        message.read(Resolution::Float, register::POSITION, 3).expect("fits");
        message.read(Resolution::Int8, 0x00D, 3).expect("fits");
    };
    let mut plain = Message::default();
    plain.write(register::MODE, Values::Int8(&[MODE_POSITION])).expect("fits");
    plain.write(register::COMMAND, Values::Float(&[0.5, 0.25, -0.5])).expect("fits");
    plain.write(register::WATCHDOG, Values::Float(&[0.1])).expect("fits");
    all(&mut plain);
    let mut coarse = Message::default();
    coarse.write(register::MODE, Values::Int8(&[MODE_POSITION])).expect("fits");
    // In steps of 0.0001 rev and 0.00025 rev/s; no position is the smallest number.
    coarse.write(register::COMMAND, Values::Int16(&[i16::MIN, -1000])).expect("fits");
    let mut stop = Message::default();
    stop.write(register::MODE, Values::Int8(&[0])).expect("fits");
    let mut query = Message::default();
    all(&mut query);
    let mut console = Message::default();
    console.stream(1, b"tel get servo_stats\n").expect("fits");
    let mut poll = Message::default();
    poll.poll_stream(1, 48).expect("fits");
    let position = json!({
        "position": 0.5, "velocity": 0.25, "feedforward_torque": -0.5, "watchdog_timeout": 0.1,
        "query": true
    });
    let cases = [
        (json!(["moteus", "make_position", position]), moteus_frame(&plain, true)),
        (
            json!(["moteus", "make_position", {"position": null, "velocity": -0.25}, true]),
            moteus_frame(&coarse, false),
        ),
        (json!(["moteus", "make_stop", {}]), moteus_frame(&stop, false)),
        (json!(["moteus", "make_query", {}]), moteus_frame(&query, true)),
        (
            json!(["moteus", "make_diagnostic_write", {"data": "tel get servo_stats\n"}]),
            moteus_frame(&console, false),
        ),
        (json!(["moteus", "make_diagnostic_read", {}]), moteus_frame(&poll, true)),
    ];
    let Some(answers) = asked(&cases.clone().map(|(request, _)| request)) else { return };
    for (answer, (_, ours)) in answers.iter().zip(&cases) {
        assert_same_moteus(answer, ours);
    }
}

#[test]
fn moteus_reads_our_commands_and_a_devices_reply_as_we_do() {
    use moteus::{MODE_POSITION, Message, Part, Resolution, Values, register};
    let mut message = Message::default();
    message.write(register::MODE, Values::Int8(&[MODE_POSITION])).expect("fits");
    message.write(register::COMMAND, Values::Int16(&[5000, -400, 100])).expect("fits");
    message.read(Resolution::Int32, register::POSITION, 2).expect("fits");
    let command = moteus_frame(&message, true);
    // The example of its reference.
    let reply = bytes("2404000a005000000170ff230d181400");
    let requests = [
        json!(["moteus", "hear", 0x8001, hexadecimal(command.payload())]),
        json!(["moteus", "hear", 0x100, hexadecimal(&reply)]),
    ];
    let Some(answers) = asked(&requests) else { return };
    let said = &answers[0][0];
    assert_eq!(said["0"], 10.0);
    close(0.5, &said["32"], 1e-9); // 5000 steps of 0.0001 rev
    close(-0.1, &said["33"], 1e-9); // -400 steps of 0.00025 rev/s
    close(1.0, &said["34"], 1e-9); // 100 steps of 0.01 N m
    assert_eq!(answers[0][2].as_array().map(Vec::len), Some(2), "{}", answers[0][2]);
    // Steps of each register's own for 16 bits, and for 8 from 0x00D on.
    let scale = |register| match register {
        1 => 0.0001,
        2 => 0.00025,
        3 => 0.01,
        0x0D => 0.5,
        _ => 1.0,
    };
    let mut read = 0;
    for part in moteus::parts(&reply) {
        let Part::Value(register, Some(Number::Steps(steps))) = part else { panic!("{part:?}") };
        close(f64::from(steps) * scale(register), &answers[1][1][register.to_string()], 1e-9);
        read += 1;
    }
    assert_eq!(read, 7);
}
