//! Any Feetech line, STS and SCS alike: no panic, progress at every step, and the same statuses whether the bytes
//! arrive at once or a few at a time.

use crate::shared::{Seen, mend_feetech, read_line};
use gaitway::wire::feetech::{MAX_PACKET, abandon, decode};

fn statuses(line: &[u8], portion: usize, longest: usize) -> Vec<Seen> {
    let front = |bytes: &[u8]| {
        decode(bytes, longest).map(|status| {
            assert!(status.params.len() <= longest);
            (status.id.get(), status.params.to_vec())
        })
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
