//! Other people's clients, unmodified, on our virtual robots: everything they offer works, but for
//! defects of their own, each of which has a test here.
//!
//! Clients sit behind real pseudo-terminals and keep real time. What they set is looked up in the
//! world, past the line; what they read was put there past the line.

mod aloud;
mod python;

#[path = "clients/bench.rs"]
mod bench;
#[path = "clients/defects.rs"]
mod defects;
#[path = "clients/dynamixel_sdk.rs"]
mod dynamixel_sdk;
#[path = "clients/feetech.rs"]
mod feetech;
#[path = "clients/registers.rs"]
mod registers;
#[path = "clients/rustypot_wheel.rs"]
mod rustypot_wheel;
#[path = "clients/scenario.rs"]
mod scenario;
#[path = "clients/tap.rs"]
mod tap;

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
