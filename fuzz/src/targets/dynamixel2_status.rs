//! Any line of Protocol 2.0: no panic, progress at every step, and the same statuses whether the
//! bytes arrive at once or a few at a time. What is accepted is what the encoder would have sent.

use crate::shared::{Seen, mend_dynamixel2, read_line};
use gaitway::wire::Decoded;
use gaitway::wire::dynamixel2::{MAX_PACKET, abandon, decode};

fn statuses(line: &[u8], portion: usize) -> Vec<Seen> {
    let mut scratch = Vec::new();
    let front = |bytes: &[u8]| match decode(bytes, &mut scratch) {
        Decoded::Packet(status, n) => {
            assert!(status.params.len() + 11 <= n && n <= MAX_PACKET);
            Decoded::Packet((status.id.get(), status.params.to_vec()), n)
        }
        Decoded::Need(n) => Decoded::Need(n),
        Decoded::Skip(n) => Decoded::Skip(n),
        Decoded::Bad(reason, n) => Decoded::Bad(reason, n),
        Decoded::Echo(n) => Decoded::Echo(n),
    };
    let seen = read_line(line, portion, MAX_PACKET, front, abandon);
    assert!(scratch.len() <= MAX_PACKET);
    seen
}

// The first byte is the portion in which the line arrives.
pub fn fuzz(input: &[u8]) {
    let [portion, line @ ..] = input else { return };
    let portion = usize::from(*portion).max(1);
    assert_eq!(statuses(line, portion), statuses(line, line.len() + 1));
    let mut line = line.to_vec();
    mend_dynamixel2(&mut line);
    assert_eq!(statuses(&line, portion), statuses(&line, line.len() + 1));
}
