//! Any text as a script of faults: no panic, and a virtual robot that runs with what is accepted.

use crate::shared::{dynamixel1_packet, dynamixel2_packet, mixed_robot};
use gaitway_sim::{Options, Script, World};

/// How long the robot is asked, ns; one question in each millisecond.
const STEPS: u64 = 30;
const STEP_NS: u64 = 1_000_000;
/// Lies and garbage included, no answer to a ping is longer than a script may make it.
const LONGEST_ANSWER: usize = 2 * (4096 + 64);

pub fn fuzz(input: &[u8]) {
    let Ok(text) = std::str::from_utf8(input) else { return };
    let Ok(script) = Script::parse(text) else { return };
    assert!(script.faults.len() <= text.len());
    let Ok(mut world) = World::new(&mixed_robot(), script.apply(Options::default())) else {
        return;
    };
    let mut answer = vec![0; 1 << 16];
    for step in 0..STEPS {
        let id = (step % 5) as u8 + 1;
        let ping =
            if id == 1 { dynamixel2_packet(id, 1, &[]) } else { dynamixel1_packet(id, 1, &[]) };
        world.transmit(0, &ping, 1_000_000);
        let until_ns = (step + 1) * STEP_NS;
        let count = world.receive(0, &mut answer, until_ns);
        assert!(count <= LONGEST_ANSWER, "{count} bytes");
        world.run_until(until_ns);
        assert_eq!(world.now_ns(), until_ns.max(world.now_ns()));
    }
    let _ = world.verdict();
}
