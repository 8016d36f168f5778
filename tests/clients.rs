//! Other people's clients, unmodified, on our virtual robots: everything they offer works, but for
//! defects of their own, each of which has a test here.
//!
//! Clients sit behind real pseudo-terminals and keep real time. What they set is looked up in the
//! world, past the line; what they read was put there past the line.

mod aloud;
mod python;

#[path = "clients/bench.rs"]
mod bench;
#[path = "clients/dynamixel_sdk.rs"]
mod dynamixel_sdk;
#[path = "clients/feetech.rs"]
mod feetech;
#[path = "clients/registers.rs"]
mod registers;
#[path = "clients/scenario.rs"]
mod scenario;

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
