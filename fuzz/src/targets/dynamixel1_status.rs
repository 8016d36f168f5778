//! Any line of Protocol 1.0: no panic, progress at every step, the same statuses whether the bytes
//! arrive at once or a few at a time, and the same packets as Feetech's, which they share.

use crate::shared::{Seen, mend_feetech, read_line};
use gaitway::wire::dynamixel1::{MAX_PACKET, abandon, decode};
use gaitway::wire::feetech;

fn statuses(line: &[u8], portion: usize, longest: usize) -> Vec<Seen> {
    let front = |bytes: &[u8]| {
        let decoded = decode(bytes, longest).map(|status| {
            assert!(status.params.len() <= longest);
            // Whatever the bits are, they have a name.
            assert!(!status.error.to_string().is_empty());
            (status.id.get(), status.params.to_vec())
        });
        let theirs = feetech::decode(bytes, longest);
        assert_eq!(theirs.map(|status| (status.id.get(), status.params.to_vec())), decoded);
        decoded
    };
    read_line(line, portion, MAX_PACKET, front, abandon)
}

// The first two bytes are the portion in which the line arrives and the longest answer expected.
pub fn fuzz(input: &[u8]) {
    let [portion, longest, line @ ..] = input else { return };
    let (portion, longest) = (usize::from(*portion).max(1), usize::from(*longest));
    assert_eq!(statuses(line, portion, longest), statuses(line, line.len() + 1, longest));
    let mut line = line.to_vec();
    mend_feetech(&mut line);
    assert_eq!(statuses(&line, portion, longest), statuses(&line, line.len() + 1, longest));
}
