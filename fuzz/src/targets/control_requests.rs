//! Any bytes as requests of the control channel: no panic, no more output than its bound, and the same
//! replies from another world.

use crate::shared::mixed_robot;
use gaitway_sim::control::{Session, Surroundings};
use gaitway_sim::{Options, World};
use std::time::Duration;

/// What may wait for a program that does not read, bytes.
const MOST_UNREAD: usize = 3 << 20;
/// Time that passes on the way to each look, so that whoever waits is told in the end.
const LOOK: Duration = Duration::from_secs(900);

pub fn fuzz(input: &[u8]) {
    let Some((&first, requests)) = input.split_first() else { return };
    let reads = first & 1 == 0;
    let replies = || {
        let mut world = World::new(&mixed_robot(), Options::default()).expect("a world");
        world.keep_journal(true);
        let mut session = Session::new(Surroundings::default());
        let mut said = Vec::new();
        let mut now = Duration::ZERO;
        for part in requests.chunks(usize::from(first) + 1) {
            session.hear(part);
            session.work(&mut world, now);
            assert!(session.output().len() < MOST_UNREAD);
            if reads {
                said.extend_from_slice(session.output());
                session.was_read(usize::MAX);
            }
            now += LOOK;
        }
        session.hear(b"\n");
        for _ in 0..100 {
            session.work(&mut world, now);
            now += LOOK;
        }
        said.extend_from_slice(session.output());
        assert!(said.is_empty() || said.ends_with(b"\n"));
        said
    };
    assert_eq!(replies(), replies());
}
