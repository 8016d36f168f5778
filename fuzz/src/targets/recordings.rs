//! Any bytes as a recording, through everything that reads one: no panic, and what is recovered is a
//! finished file that says the same.

use crate::shared::Scratch;
use gaitway::job::source::joints;
use gaitway::recording::{
    Recording, read_orientations, recover, run_start, sensor_series, summary, write_csv,
};

/// Makes the records of every chunk good as they are: a check sum of zero says that there is none.
fn mend(file: &mut [u8]) {
    const MAGIC: usize = 8;
    let mut at = MAGIC;
    while let Some(head) = at.checked_add(9).and_then(|end| file.get(at..end)) {
        let (opcode, length) = (head[0], u64::from_le_bytes(head[1..].try_into().expect("eight")));
        if let Some(crc) = file.get_mut(at + 9 + 24..at + 9 + 28).filter(|_| opcode == 6) {
            crc.fill(0);
        }
        at = at.saturating_add(9).saturating_add(usize::try_from(length).unwrap_or(usize::MAX));
    }
}

fn check(scratch: &Scratch, bytes: &[u8]) {
    let whole = Recording::from_source(bytes);
    let path = scratch.write("recording.mcap", bytes);
    let _ = write_csv(&path, &mut std::io::sink());
    let _ = read_orientations(&path);
    let _ = sensor_series(&path);
    let _ = run_start(&path);
    let _ = joints::read(&path, &["a".to_owned(), "b".to_owned()]);
    let before = summary(&path);
    let Ok(recovered) = recover(&path, true) else {
        assert!(before.is_err(), "what can be looked into can be recovered");
        return;
    };
    let before = before.expect("what can be recovered can be looked into");
    let after = summary(&recovered.path).expect("a recovered file is a recording");
    assert!(after.finished && after.lost_bytes == 0);
    assert_eq!(after.channels, before.channels);
    assert_eq!(after.channels.values().sum::<u64>(), recovered.messages);
    assert_eq!((after.robot, after.outcome), (before.robot, before.outcome));
    if let Ok(whole) = whole {
        let bytes = std::fs::read(&recovered.path).expect("the recovered file");
        let again = Recording::from_source(bytes.as_slice()).expect("what was read before");
        // Written as text, because a value may be not-a-number, which equals nothing.
        assert_eq!(format!("{:?}", again.cycles), format!("{:?}", whole.cycles));
    }
}

pub fn fuzz(input: &[u8]) {
    let scratch = Scratch::new("recordings");
    check(&scratch, input);
    let mut input = input.to_vec();
    mend(&mut input);
    check(&scratch, &input);
}
