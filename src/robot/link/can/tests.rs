//! What counts as a state.

use super::*;
use crate::port::sim::{SharedWorld, VirtualCanLine, VirtualClock};
use crate::robot::Link;
use gaitway_sim::{Fault, Options, World};

#[test]
fn what_was_heard_long_ago_is_no_state_however_often_the_line_was_listened_to() {
    let robot = Robot::load("berkeley-humanoid-lite").expect("shipped");
    // The first joint answers once, and then never again.
    let joint = robot.joints[0].name.clone();
    let silent = Fault::Silent { joint, from_ns: 20_000_000, until_ns: u64::MAX };
    let options = Options { faults: vec![silent], ..Options::default() };
    let world = World::new(&robot.file, options).expect("a virtual robot");
    let world = SharedWorld::new(world);
    let clock: Arc<dyn Clock> = Arc::new(VirtualClock(world.clone()));
    let port = |line| -> Box<dyn FramePort> { Box::new(VirtualCanLine::new(world.clone(), line)) };
    let ports = (0..robot.lines.len()).map(|line| (port(line), Duration::ZERO)).collect();
    let mut link = Link::new(robot, ports, Arc::clone(&clock));

    let pause = Duration::from_millis(20);
    let asked = link.each_can(|can| can.begin_states(true, clock.now() + pause));
    assert!(asked.iter().all(Result::is_ok), "{asked:?}");
    for _ in 0..10 {
        clock.sleep_until(clock.now() + pause);
        link.break_silence(pause);
    }
    let states = link.states(clock.now() + pause).expect("lines that work");
    assert!(matches!(states[0], Err(Miss::Silent)), "{:?}", states[0]);
    assert!(states[1..].iter().all(Result::is_ok), "the others were asked anew");
}
