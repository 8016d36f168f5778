//! A virtual robot for one's own tests, in virtual time and to the byte: here it does not answer once,
//! and the referee says whether anything was done to it that a robot should not suffer.

use gaitway_sim::{Options, Script, World, profiles};

/// Ping ID 19, a servo of the head, in DYNAMIXEL Protocol 2.0.
const PING: [u8; 10] = [0xFF, 0xFF, 0xFD, 0x00, 19, 0x03, 0x00, 0x01, 0x1C, 0xA6];

pub(crate) fn main() -> Result<(), Box<dyn std::error::Error>> {
    let robot = profiles::robot("op3")?;
    let script = Script::parse("[[fault]]\nkind = 'mute'\njoint = 'head_pan'\nnth = 1\n")?;
    let mut world = World::new(&robot, script.apply(Options::default()))?;
    let mut answer = [0; 64];
    for expected in [14, 0, 14] {
        world.transmit(0, &PING, 2_000_000);
        // Time passes only here: until a byte is there, or for 5 ms.
        let deadline_ns = world.now_ns() + 5_000_000;
        let count = world.receive(0, &mut answer, deadline_ns);
        assert_eq!(count, expected);
        println!("{:5.1} ms: {count} bytes", world.now_ns() as f64 / 1e6);
    }
    assert!(world.verdict().is_clean());
    Ok(())
}
