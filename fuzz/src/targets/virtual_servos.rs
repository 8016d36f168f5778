//! Any bytes from a host to virtual servos of every family: no panic, an end in bounded time, and
//! nothing said that is not in the form of the family; what the host does wrong, it hears nothing of.

use crate::shared::{dynamixel2_packet, mend_dynamixel2, mend_feetech, mixed_robot};
use gaitway::wire::Decoded;
use gaitway::wire::dynamixel2;
use gaitway_profiles::Robot;
use gaitway_sim::{Options, World};

/// Time for everything to be said, ns.
const LATER_NS: u64 = 2_000_000_000;

/// What the servos answer to a line of the host's that comes in portions.
fn answers(robot: &Robot, line: &[u8], portion: usize) -> Vec<u8> {
    let options = Options { permit_eeprom: true, ..Options::default() };
    let mut world = World::new(robot, options).expect("a robot that can be built");
    for bytes in line.chunks(portion) {
        assert_eq!(world.transmit(0, bytes, 1_000_000), bytes.len());
        world.run_until(world.now_ns() + 200_000);
    }
    let (mut heard, mut buffer) = (Vec::new(), vec![0; 4096]);
    let end_ns = world.now_ns() + LATER_NS;
    loop {
        match world.receive(0, &mut buffer, end_ns) {
            0 => break,
            count => heard.extend_from_slice(&buffer[..count]),
        }
    }
    assert!(world.now_ns() <= end_ns);
    let _ = world.verdict();
    heard
}

/// One question to one servo is answered by one whole status or by nothing; the driver's decoder was
/// written apart from the servos. (A write may change the speed at which it answers.)
fn one_answer(packet: &[u8]) {
    let mut alone = mixed_robot();
    alone.joints.truncate(1);
    let heard = answers(&alone, packet, packet.len());
    let mut scratch = Vec::new();
    match dynamixel2::decode(&heard, &mut scratch) {
        Decoded::Packet(status, count) => {
            assert_eq!(count, heard.len());
            assert_eq!(status.id.get(), packet[4]);
        }
        Decoded::Need(_) => assert!(heard.is_empty(), "{heard:02X?}"),
        other => panic!("{other:?} of {heard:02X?}"),
    }
}

// The first byte is the portion in which the line comes.
pub fn fuzz(input: &[u8]) {
    let [portion, line @ ..] = input else { return };
    let portion = usize::from(*portion).max(1);
    let (robot, mut line) = (mixed_robot(), line.to_vec());
    answers(&robot, &line, portion);
    mend_dynamixel2(&mut line);
    mend_feetech(&mut line);
    answers(&robot, &line, portion);
    // A ping or a read with parameters of the fuzzer's.
    if let [code, params @ ..] = line.as_slice()
        && params.len() < 64
    {
        one_answer(&dynamixel2_packet(1, code % 2 + 1, params));
    }
}
