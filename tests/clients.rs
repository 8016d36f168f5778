//! Other people's clients, unmodified, on our virtual robots: everything they offer works, but for
//! defects of their own, each of which has a test here.
//!
//! Clients sit behind real pseudo-terminals and keep real time. What they set is looked up in the
//! world, past the line; what they read was put there past the line.

mod aloud;
mod program;
mod python;

#[path = "clients/bench.rs"]
mod bench;
#[path = "clients/command.rs"]
mod command;
#[path = "clients/conformance.rs"]
mod conformance;
#[path = "clients/crates.rs"]
mod crates;
#[path = "clients/defects.rs"]
mod defects;
#[path = "clients/dynamixel_sdk.rs"]
mod dynamixel_sdk;
#[path = "clients/feetech.rs"]
mod feetech;
#[path = "clients/lerobot.rs"]
mod lerobot;
#[path = "clients/pypot.rs"]
mod pypot;
#[path = "clients/registers.rs"]
mod registers;
#[path = "clients/rustypot_wheel.rs"]
mod rustypot_wheel;
#[path = "clients/scenario.rs"]
mod scenario;
#[path = "clients/tap.rs"]
mod tap;

use aloud::aloud;
use scenario::Scenario;

/// What each client can do; its defects follow from [`defects::ALL`].
const EVERYTHING: [&Scenario; 19] = [
    &dynamixel_sdk::PROTOCOL_2,
    &rustypot_wheel::PROTOCOL_2,
    &crates::DYNAMIXEL2_PROTOCOL_2,
    &crates::RUSTYPOT_PROTOCOL_2,
    &lerobot::PROTOCOL_2,
    &dynamixel_sdk::PROTOCOL_1,
    &rustypot_wheel::PROTOCOL_1,
    &crates::RUSTYPOT_PROTOCOL_1,
    &pypot::PROTOCOL_1,
    &feetech::FTSERVO,
    &feetech::FEETECH_SERVO_SDK,
    &feetech::FEETECH_CLI,
    &rustypot_wheel::STS,
    &crates::RUSTYPOT_STS,
    &lerobot::STS,
    &feetech::FTSERVO_SCS,
    &feetech::FEETECH_SERVO_SDK_SCS,
    &feetech::FEETECH_CLI_SCS,
    &rustypot_wheel::SCS,
];

#[test]
fn the_conformance_tables_are_what_the_runs_say() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let lock_file = std::fs::read_to_string(root.join("Cargo.lock")).expect("a lock file");
    let scenarios = [&EVERYTHING[..], &defects::ALL].concat();
    let page = match conformance::page(&scenarios, &lock_file) {
        Ok(page) => page,
        Err(why) => {
            aloud!("SKIPPED: docs/conformance.md was not compared, not all clients ran: {why}");
            return;
        }
    };
    let path = root.join("docs/conformance.md");
    if std::env::var_os("GAITWAY_WRITE_CONFORMANCE").is_some() {
        std::fs::write(&path, page).expect("docs/conformance.md written");
        return;
    }
    let kept = std::fs::read_to_string(&path).unwrap_or_default();
    let differs = kept.lines().zip(page.lines()).find(|(kept, page)| kept != page);
    assert!(
        kept == page,
        "GAITWAY_WRITE_CONFORMANCE=1 cargo test --test clients writes it anew; {differs:?}"
    );
}

#[test]
fn lerobot_finds_every_motor_of_its_robots_where_their_files_have_them() {
    lerobot::robots();
}

#[test]
fn lerobots_own_commands_go_from_a_port_to_a_replayed_episode() {
    lerobot::commands();
}

#[test]
fn dynamixel_sdk_can_do_everything_it_offers_with_protocol_2() {
    dynamixel_sdk::PROTOCOL_2.outcome();
}

#[test]
fn ftservo_python_sdk_can_do_everything_it_offers() {
    feetech::FTSERVO.outcome();
}

#[test]
fn feetech_servo_sdk_can_do_everything_it_offers() {
    feetech::FEETECH_SERVO_SDK.outcome();
}

#[test]
fn feetech_cli_can_do_everything_it_offers() {
    feetech::FEETECH_CLI.outcome();
}

#[test]
fn dynamixel_sdk_can_do_everything_it_offers_with_protocol_1() {
    dynamixel_sdk::PROTOCOL_1.outcome();
}

#[test]
fn dynamixel_sdk_leaves_out_byte_stuffing() {
    defects::SDK_STUFFING.outcome();
}

#[test]
fn dynamixel_sdk_mistakes_a_length_for_an_id_in_a_fast_bulk_read() {
    defects::SDK_FAST_BULK_READ.outcome();
}

#[test]
fn dynamixel_sdk_cannot_bulk_read_with_protocol_1() {
    defects::SDK_OLD_BULK_READ.outcome();
}

#[test]
fn the_rustypot_wheel_can_do_everything_it_offers_with_protocol_2() {
    rustypot_wheel::PROTOCOL_2.outcome();
}

#[test]
fn the_rustypot_wheel_can_do_everything_it_offers_with_protocol_1() {
    rustypot_wheel::PROTOCOL_1.outcome();
}

#[test]
fn the_rustypot_wheel_can_do_everything_it_offers_with_sts_servos() {
    rustypot_wheel::STS.outcome();
}

#[test]
fn the_rustypot_wheel_can_do_everything_it_offers_with_scs_servos() {
    rustypot_wheel::SCS.outcome();
}

#[test]
fn ftservo_python_sdk_can_do_everything_it_offers_with_scs_servos() {
    feetech::FTSERVO_SCS.outcome();
}

#[test]
fn feetech_servo_sdk_can_do_everything_it_offers_with_scs_servos() {
    feetech::FEETECH_SERVO_SDK_SCS.outcome();
}

#[test]
fn pypot_can_do_everything_it_offers() {
    pypot::PROTOCOL_1.outcome();
}

#[test]
fn pypot_throws_away_what_is_still_under_way() {
    defects::PYPOT_FLUSH.outcome();
}

#[test]
fn the_dynamixel2_crate_can_do_everything_it_offers() {
    crates::DYNAMIXEL2_PROTOCOL_2.outcome();
}

#[test]
fn the_rustypot_crate_can_do_everything_it_offers() {
    crates::RUSTYPOT_PROTOCOL_2.outcome();
    crates::RUSTYPOT_PROTOCOL_1.outcome();
    crates::RUSTYPOT_STS.outcome();
}

#[test]
fn dynamixel_sdk_does_not_wait_for_the_status_of_an_action() {
    defects::SDK_ACTION.outcome();
}

#[test]
fn the_rustypot_wheel_has_the_indirect_data_of_another_servo() {
    defects::WHEEL_INDIRECT_DATA.outcome();
}

#[test]
fn the_dynamixel2_crate_misses_bytes_to_stuff() {
    defects::CRATE_STUFFING.outcome();
}

#[test]
fn the_dynamixel2_crate_garbles_a_bulk_read_of_two() {
    defects::CRATE_BULK_READ.outcome();
}

#[test]
fn the_dynamixel2_crate_stops_listening_before_high_ids_answer() {
    defects::CRATE_SCAN.outcome();
}

#[test]
fn ftservo_python_sdk_sends_goals_below_zero_as_twos_complement() {
    defects::FTSERVO_NEGATIVE.outcome();
}

#[test]
fn ftservo_python_sdk_overlooks_a_servo_missing_in_a_sync_read() {
    defects::FTSERVO_SYNC_READ.outcome();
}

#[test]
fn feetech_servo_sdk_believes_an_old_answer() {
    defects::FEETECH_SERVO_SDK_STALE.outcome();
}

#[test]
fn feetech_cli_does_not_know_an_overload_by_name() {
    defects::FEETECH_CLI_OVERLOAD.outcome();
}

#[test]
fn what_one_client_sets_on_a_simulated_robot_another_finds() {
    command::BETWEEN_TWO.outcome();
}

#[test]
fn lerobot_can_do_everything_it_offers() {
    lerobot::STS.outcome();
    lerobot::PROTOCOL_2.outcome();
}

#[test]
fn feetech_cli_can_do_what_it_offers_with_scs_servos() {
    feetech::FEETECH_CLI_SCS.outcome();
}

#[test]
fn feetech_cli_opens_the_wrong_lock_of_scs_servos() {
    defects::FEETECH_CLI_SCS_LOCK.outcome();
}
