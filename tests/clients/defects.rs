//! What clients do wrong, each shown by what they send or say. A test that fails here means that a
//! client was corrected: take it out of the list, and it counts as working.

use crate::bench::{Bench, Client, Lost};
use crate::dynamixel_sdk as sdk;
use crate::python::Python;
use crate::scenario::{About, Record, Run, Scenario};
use crate::tap::{Tap, contains, hex};
use gaitway_sim::Options;
use serde_json::json;

/// All of them, in the order of the conformance table.
pub static ALL: [&Scenario; 3] = [&SDK_STUFFING, &SDK_FAST_BULK_READ, &SDK_OLD_BULK_READ];

pub static SDK_STUFFING: Scenario = Scenario::new(
    sdk::NAME,
    "DYNAMIXEL 2.0",
    About::Defect(
        "Write",
        "leaves out byte stuffing: it computes the stuffed packet and sends the other one. A servo \
         may take `FF FF FD 00` inside it for the start of a packet. Reads are unstuffed rightly",
    ),
    Run::Python(sdk_sends_a_header_inside_a_packet),
);

fn tapped(python: &Python, tap: &Tap, protocol: u8) -> Client {
    let arguments = [tap.port(), "1000000", &protocol.to_string()];
    Client::start(python, "dynamixel_sdk_client.py", &arguments)
}

/// XM430: Goal Current(102) = -1 and Goal Velocity(104) = 253 are the bytes FF FF FD 00 00 00.
fn sdk_sends_a_header_inside_a_packet(python: &Python, _: &mut Record) -> Result<(), Lost> {
    let tap = Tap::silent();
    let mut client = tapped(python, &tap, 2);
    client.ask("sync_write", json!([102, 6, [[1, 0xFD_FFFF]]]))?;
    let heard = tap.heard(21);
    // e-Manual, "Byte Stuffing": FF FF FD becomes FF FF FD FD and the length counts it.
    assert!(!contains(&heard, &hex("01 FF FF FD FD 00 00 00")), "{heard:02X?}");
    assert_eq!(heard[..19], hex("FF FF FD 00 FE 0E 00 83 66 00 06 00 01 FF FF FD 00 00 00"));
    // The other way round it is right.
    let bench = Bench::open("dynamixel2", Options::default());
    bench.set("xm", "Goal Current", -1);
    bench.set("xm", "Goal Velocity", 253);
    let mut client = sdk::client(python, &bench, 0, 1_000_000, 2);
    let seen = client.ask("read_with_error", json!([1, 102, 6]))?;
    assert_eq!(seen, json!([[0xFF, 0xFF, 0xFD, 0, 0, 0], 0]));
    Ok(())
}

pub static SDK_FAST_BULK_READ: Scenario = Scenario::new(
    sdk::NAME,
    "DYNAMIXEL 2.0",
    About::Defect(
        "Fast Bulk Read",
        "looks for an ID among all bytes of its request, so that ID 4 after a length of 4 is given \
         a wrong length: servos after it keep their old values, or none, and the read counts as \
         successful",
    ),
    Run::Python(sdk_mistakes_a_length_for_an_id),
);

fn sdk_mistakes_a_length_for_an_id(python: &Python, _: &mut Record) -> Result<(), Lost> {
    let bench = Bench::open("op3", Options::default());
    let mut client = sdk::client(python, &bench, 0, 2_000_000, 2);
    bench.set("r_el", "Present Position", 1234);
    // Voltage 144 of ID 4, position 132 of IDs 1 and 5.
    let right = client.ask("fast_bulk_read", json!([[[4, 144, 2], [1, 132, 4], [5, 132, 4]]]))?;
    assert_eq!(right[0], bench.register("l_sho_roll", "Present Input Voltage"));
    assert_eq!(right[2], 1234);
    let asked = json!([[[1, 132, 4], [4, 144, 2], [5, 132, 4]]]);
    let seen = client.ask("bulk_read", asked.clone())?;
    assert_eq!(seen, json!([right[1], right[0], 1234]), "not fast, the same question is answered");
    // It says that all went well and has no value for ID 5.
    let complaint = client.complaint("fast_bulk_read", asked)?;
    assert!(complaint.as_str().is_some_and(|said| said.starts_with("IndexError")), "{complaint}");
    Ok(())
}

pub static SDK_OLD_BULK_READ: Scenario = Scenario::new(
    sdk::NAME,
    "DYNAMIXEL 1.0",
    About::Defect(
        "Bulk Read",
        "`GroupBulkRead` calls the packet handler with one argument too many and raises a \
         `TypeError` before anything is sent; `bulkReadTx` and `readRx` by themselves work",
    ),
    Run::Python(|python, _| {
        let tap = Tap::silent();
        let mut client = tapped(python, &tap, 1);
        let complaint = client.complaint("bulk_read", json!([[[2, 36, 2]]]))?;
        assert!(
            complaint.as_str().is_some_and(|said| said.starts_with("TypeError")),
            "{complaint}"
        );
        Ok(())
    }),
);
