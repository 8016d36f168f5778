//! Any Feetech line: no panic, progress at every step, and the same statuses whether the bytes
//! arrive at once or a few at a time.

#![no_main]

use gaitway::wire::Decoded;
use gaitway::wire::feetech::{MAX_PACKET, abandon, decode};
use gaitway_fuzz::{Seen, mend_feetech, read_line};
use libfuzzer_sys::fuzz_target;

fn statuses(line: &[u8], portion: usize, longest: usize) -> Vec<Seen> {
    let front = |bytes: &[u8]| match decode(bytes, longest) {
        Decoded::Packet(status, n) => {
            assert!(status.params.len() + 6 == n && status.params.len() <= longest);
            Decoded::Packet((status.id.get(), status.params.to_vec()), n)
        }
        Decoded::Need(n) => Decoded::Need(n),
        Decoded::Skip(n) => Decoded::Skip(n),
        Decoded::Bad(reason, n) => Decoded::Bad(reason, n),
        Decoded::Echo(n) => Decoded::Echo(n),
    };
    read_line(line, portion, MAX_PACKET, front, abandon)
}

// The first two bytes are the portion in which the line arrives and the longest answer expected.
fuzz_target!(|input: &[u8]| {
    let [portion, longest, line @ ..] = input else { return };
    let (portion, longest) = (usize::from(*portion).max(1), usize::from(*longest));
    assert_eq!(statuses(line, portion, longest), statuses(line, line.len() + 1, longest));
    let mut line = line.to_vec();
    mend_feetech(&mut line);
    assert_eq!(statuses(&line, portion, longest), statuses(&line, line.len() + 1, longest));
});
