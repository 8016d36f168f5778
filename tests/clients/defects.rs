//! What clients do wrong, each shown by what they send or say. A test that fails here means that a
//! client was corrected: take it out of the list, and it counts as working.

use crate::bench::{Bench, Client, Lost};
use crate::crates;
use crate::dynamixel_sdk as sdk;
use crate::feetech;
use crate::pypot;
use crate::python::Python;
use crate::rustypot_wheel as wheel;
use crate::scenario::{About, Record, Run, Scenario};
use crate::tap::{Tap, contains, hex};
use dynamixel2::instructions::BulkReadData;
use gaitway_sim::{MissingInChain, Options};
use serde_json::json;

/// All of them, in the order of the conformance table.
pub static ALL: [&Scenario; 14] = [
    &SDK_STUFFING,
    &SDK_FAST_BULK_READ,
    &SDK_ACTION,
    &SDK_OLD_BULK_READ,
    &WHEEL_INDIRECT_DATA,
    &CRATE_STUFFING,
    &CRATE_BULK_READ,
    &CRATE_SCAN,
    &PYPOT_FLUSH,
    &FTSERVO_NEGATIVE,
    &FTSERVO_SYNC_READ,
    &FEETECH_SERVO_SDK_STALE,
    &FEETECH_CLI_OVERLOAD,
    &FEETECH_CLI_SCS_LOCK,
];

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

pub static PYPOT_FLUSH: Scenario = Scenario::new(
    pypot::NAME,
    "DYNAMIXEL 1.0",
    About::Defect(
        "Sync Write",
        "empties its output buffer before every instruction, so that a write that nobody answers is \
         lost if the next instruction comes before the adapter has sent it",
    ),
    Run::Python(pypot_throws_away_what_it_has_written),
);

/// Whether something is lost is a matter of microseconds; that it is asked for is certain.
fn pypot_throws_away_what_it_has_written(python: &Python, _: &mut Record) -> Result<(), Lost> {
    let tap = Tap::silent();
    let mut client = Client::start(python, "pypot_client.py", &[tap.port()]);
    let calls = client.ask("calls_of_two_writes", json!([1, "LED", 1]))?;
    assert_eq!(calls, json!(["flushOutput", "write", "flushOutput", "write"]));
    Ok(())
}

pub static SDK_ACTION: Scenario = Scenario::new(
    sdk::NAME,
    "DYNAMIXEL 2.0",
    About::Defect(
        "Action",
        "does not wait for the status of an Action to one servo: it says that all went well though \
         nobody is there, and its next instruction may meet the status on the line",
    ),
    Run::Python(|python, _| {
        let tap = Tap::silent();
        let mut client = tapped(python, &tap, 2);
        client.ask("action", json!([1]))?;
        // e-Manual, Action to one servo: there is a status.
        assert_eq!(tap.heard(10), hex("FF FF FD 00 01 03 00 05 02 CE"));
        Ok(())
    }),
);

pub static WHEEL_INDIRECT_DATA: Scenario = Scenario::new(
    wheel::NAME,
    "DYNAMIXEL 2.0",
    About::Defect(
        "Read",
        "has the indirect data of the XL330 at 224, where firmware before 52 had it (so the maker's \
         `.model` files), not at the e-Manual's 208: with firmware 52 its `indirect_data_1` is the \
         servo's Indirect Data 17. It also lists an acceleration limit the XL330 does not have, \
         and current registers the XL430 does not have",
    ),
    Run::Python(|python, _| {
        let bench = Bench::open("dynamixel2", Options::default());
        // e-Manual XL330-M288: Indirect Address 1 at 168, Indirect Data 1 at 208; LED at 65.
        bench.set("xl330", "Indirect Address 1", 65);
        bench.set("xl330", "Indirect Address 17", 84);
        bench.set("xl330", "LED", 1);
        bench.set("xl330", "Position P Gain", 0x0177);
        let mut client = wheel::client(python, bench.port(0), "Xl330");
        assert_eq!(client.ask("read_raw_data", json!([3, 208, 1]))?, json!([1]));
        assert_eq!(client.ask("read_register", json!([3, "indirect_data_1"]))?, 0x77);
        Ok(())
    }),
);

pub static CRATE_STUFFING: Scenario = Scenario::new(
    crates::DYNAMIXEL2,
    "DYNAMIXEL 2.0",
    About::Defect("Write", "misses `FF FF FD` after a third `FF` when it looks for bytes to stuff"),
    Run::Here(|_| {
        let tap = Tap::silent();
        let mut bus =
            crates::Bus::open_with_buffers(tap.port(), 1_000_000, vec![0; 1024], vec![0; 1024])
                .expect("a port");
        // Goal Position -257 = FF FE FF FF and its neighbour 0x0000_00FD make FF FF FD; with one FF
        // more before them the pattern is missed.
        let _ = bus.write(1, 116, &[0xFF, 0xFF, 0xFF, 0xFD, 0x00]);
        let heard = tap.heard(17);
        assert!(!contains(&heard, &hex("FF FF FF FD FD 00")), "{heard:02X?}");
        assert!(contains(&heard, &hex("74 00 FF FF FF FD 00")), "{heard:02X?}");
        Ok(())
    }),
);

pub static CRATE_BULK_READ: Scenario = Scenario::new(
    crates::DYNAMIXEL2,
    "DYNAMIXEL 2.0",
    About::Defect(
        "Bulk Read",
        "writes the entries of a request one byte apart instead of five, so that only a bulk read \
         of one servo asks for what it should",
    ),
    Run::Here(|_| {
        let (_bench, mut bus) = crates::open();
        let ask = |motor_id, address, count| BulkReadData { motor_id, address, count };
        assert!(bus.bulk_read(&[ask(3, 65, 1)]).is_ok());
        assert!(bus.bulk_read(&[ask(252, 144, 2)]).is_ok());
        // 03 FC 90 00 02 00 00 00 00 00: 144 bytes from address 36,944 of ID 3.
        assert!(bus.bulk_read(&[ask(3, 65, 1), ask(252, 144, 2)]).is_err());
        Ok(())
    }),
);

pub static CRATE_SCAN: Scenario = Scenario::new(
    crates::DYNAMIXEL2,
    "DYNAMIXEL 2.0",
    About::Defect(
        "Ping, broadcast",
        "listens for 69 ms at 1 Mbps. The maker's SDK allows 3 ms for each ID, and servos are known \
         to use them (ROBOTIS-GIT/Dynamixel2Arduino, issue 106), so that IDs above 20 are missed",
    ),
    Run::Here(|_| {
        let (_bench, mut bus) = crates::open();
        let found = (0..5).any(|_| crates::scanned(&mut bus) == [1, 3]);
        assert!(found, "of 1, 3 and 252 the first two are found");
        Ok(())
    }),
);

pub static FTSERVO_NEGATIVE: Scenario = Scenario::new(
    "ftservo-python-sdk",
    "FEETECH STS",
    About::Defect(
        "Write",
        "`WritePosEx` and its relatives send a goal below zero as two's complement, which a servo \
         takes for a goal far away: -100 becomes -32,668. Speeds, and positions read, are \
         converted rightly",
    ),
    Run::Python(|python, _| {
        let bench = Bench::open("feetech", Options { permit_eeprom: true, ..Options::default() });
        let mut client = feetech::start_vendor(python, bench.port(0), "ftservo-python-sdk", "sts");
        client.ask("WritePosEx", json!([1, -100, 0, 0]))?;
        // Sign in bit 15 (SMS_STS.cpp of the maker's C++ SDK): -100 would be 0x8064.
        bench.assert_holds("Goal Position", &[("one", -(0xFF9C - 0x8000))]);
        Ok(())
    }),
);

pub static FTSERVO_SYNC_READ: Scenario = Scenario::new(
    "ftservo-python-sdk",
    "FEETECH STS",
    About::Defect(
        "Sync Read",
        "says how the last servo's answer was for all of them: a servo that is missing before it \
         goes unnoticed unless `isAvailable` is asked for each",
    ),
    Run::Python(|python, _| {
        let missing_in_chain = MissingInChain::AnswerAfter { gap_ns: 1_000_000 };
        let bench = Bench::open("feetech", Options { missing_in_chain, ..Options::default() });
        let mut client = feetech::start_vendor(python, bench.port(0), "ftservo-python-sdk", "sts");
        // ID 9 is not there: the call itself succeeds, only asking for ID 9 fails.
        let complaint = client.complaint("sync_read", json!([[9, 2], 56, 2]))?;
        assert_eq!(complaint, "AssertionError: 9");
        Ok(())
    }),
);

pub static FEETECH_SERVO_SDK_STALE: Scenario = Scenario::new(
    "feetech-servo-sdk",
    "FEETECH STS",
    About::Defect(
        "Read",
        "does not drop old input before it asks (`clearPort` waits for its own output instead), so \
         that a status that came late is taken for the answer to the next question",
    ),
    Run::Python(feetech_servo_sdk_believes_old_answers),
);

fn feetech_servo_sdk_believes_old_answers(python: &Python, _: &mut Record) -> Result<(), Lost> {
    // Two statuses of ID 1 to the first question, as from an adapter that says all twice.
    let mut first = true;
    let tap = Tap::answering(move |_| {
        let old = hex("FF FF 01 04 00 11 11 D8");
        let twice = [&old[..], &old[..]].concat();
        if std::mem::take(&mut first) { twice } else { hex("FF FF 01 04 00 22 22 B6") }
    });
    let mut client = feetech::start_vendor(python, tap.port(), "feetech-servo-sdk", "sts");
    assert_eq!(client.ask("read", json!([1, 56, 2]))?, 0x1111);
    assert_eq!(client.ask("read", json!([1, 56, 2]))?, 0x1111, "0x2222 is what is there now");
    Ok(())
}

pub static FEETECH_CLI_OVERLOAD: Scenario = Scenario::new(
    "feetech-cli",
    "FEETECH STS",
    About::Defect(
        "Read",
        "names the error bits of a status wrongly: overload, bit 5 (32), is \"reserved-5\" to it, and \
         bit 6 \"overload\"",
    ),
    Run::Python(|python, _| {
        let bench = Bench::open("feetech", Options::default());
        let mut client = Client::start(python, "feetech_cli_client.py", &[bench.port(0), "sts"]);
        client.ask("connect", json!([]))?;
        bench.set("one", "Status", 0x20);
        let seen = client.ask("read_register_with_error", json!([1, "lock"]))?;
        assert_eq!(seen[1], 0x20, "the byte itself is passed on");
        assert_eq!(client.ask("describe_error", json!([0x20]))?, json!(["reserved-5"]));
        Ok(())
    }),
);

pub static FEETECH_CLI_SCS_LOCK: Scenario = Scenario::new(
    "feetech-cli",
    "FEETECH SCS",
    About::Defect(
        "Write",
        "has the addresses of STS servos only: with `--scs` it opens a lock at 55, where SCS servos \
         have none, and not theirs at 48, so that a new ID is gone with the power",
    ),
    Run::Python(|python, _| {
        let bench = Bench::open("scs", Options { permit_eeprom: true, ..Options::default() });
        let mut client = Client::start(python, "feetech_cli_client.py", &[bench.port(0), "scs"]);
        client.ask("connect", json!([]))?;
        bench.set("one", "Lock", 1);
        client.ask("unlock_eeprom", json!([1]))?;
        bench.assert_holds("Lock", &[("one", 1)]);
        Ok(())
    }),
);
