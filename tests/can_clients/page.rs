//! The page that says what was compared with whom, and what others do wrong.

use super::python::REQUIREMENTS;
use std::fmt::Write as _;
use std::path::Path;

/// Package, dialect, what its frames were, what it reads, what it moves.
const COMPARED: [[&str; 5]; 7] = [
    [
        "damiao-motor",
        "Damiao",
        "all orders, modes 1 to 4, registers; setpoints to a step",
        "feedback, registers [1]",
        "virtual DM-J4310",
    ],
    [
        "robstride-dynamics",
        "RobStride",
        "orders, parameters; setpoints to two steps",
        "feedback, faults, parameters",
        "virtual RS02",
    ],
    [
        "CyberGearDriver",
        "CyberGear",
        "orders, parameters from 0x7005 on; setpoints to a step on its range of 12.5 rad",
        "feedback [2]",
        "virtual CyberGear",
    ],
    [
        "TMotorCANControl",
        "CubeMars, MIT and servo mode",
        "orders; setpoints of MIT mode to two steps [3]",
        "feedback of both modes [3]",
        "-",
    ],
    [
        "moteus",
        "moteus",
        "positions, stop, queries and console, byte for byte",
        "our commands, a device's reply",
        "-",
    ],
    ["lerobot", "Damiao", "registers' numbers, ranges of 12 of 13 models", "-", "-"],
    ["odrive", "ODrive, firmware 0.6", "-", "every error has a word, states", "-"],
];

/// Client, what it does wrong, and the test that shows it.
const DEFECTS: [[&str; 3]; 3] = [
    [
        "damiao-motor",
        "takes feedback for the value of a register if its second byte is below 16, its third 0x33 \
         and its fourth a register's number: near -11.6 rad at some speeds the state is lost and a \
         register gets a value no device has.",
        "damiao_motor_takes_some_feedback_for_a_register",
    ],
    [
        "CyberGearDriver",
        "looks for mode and faults beyond the two bytes they stand in: it never sees a fault, nor \
         that the motor runs.",
        "cybergear_driver_never_sees_a_fault_or_that_the_motor_runs",
    ],
    [
        "TMotorCANControl",
        "raises an error before it sends any command of servo mode but the origin's, and when \
         feedback has a number below zero (with NumPy 2).",
        "tmotor_can_control_cannot_command_servo_mode_nor_read_negative_numbers",
    ],
];

const HEAD: &str = "\
# Conformance, CAN

Our CAN dialects against other people's Python packages, unmodified, by `tests/can_clients.rs`: what
they send is what we send, and they read a device's answer as we do. Setpoints of a coded range may
be some steps apart, for most round down where we round to the nearest step. What moves is a virtual
actuator behind a slcan adapter on a pseudo-terminal; where it really is is looked up past the line.
That the makers' frames go through the kernel as they are is shown by `tests/can.rs`. To write this
page anew:

```
GAITWAY_WRITE_CONFORMANCE=1 cargo test --test can_clients
```

The Rust crate moteus-protocol is held against ours in `tests/can_against_others.rs`.

";

fn version(package: &str) -> &'static str {
    let line = REQUIREMENTS.lines().find_map(|line| line.strip_prefix(package)?.strip_prefix("=="));
    line.unwrap_or_else(|| panic!("{package} is not among the requirements"))
}

fn page() -> String {
    let mut page = HEAD.to_owned();
    page +=
        "| package | dialect | sends as we do | reads as we do | moves |\n|---|---|---|---|---|\n";
    for [package, dialect, sends, reads, moves] in COMPARED {
        let version = version(package);
        let row = format!("| {package} {version} | {dialect} | {sends} | {reads} | {moves} |");
        writeln!(page, "{row}").expect("a string");
    }
    page += "\n## Defects\n\n";
    for (number, [client, what, test]) in (1..).zip(DEFECTS) {
        writeln!(page, "{number}. **{client}**: {what} `{test}`").expect("a string");
    }
    page
}

#[test]
fn the_page_of_can_conformance_is_as_these_tests_have_it() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/conformance-can.md");
    let page = page();
    if std::env::var_os("GAITWAY_WRITE_CONFORMANCE").is_some() {
        std::fs::write(&path, &page).expect("written");
    }
    let shipped = std::fs::read_to_string(&path).unwrap_or_default();
    assert_eq!(shipped, page, "GAITWAY_WRITE_CONFORMANCE=1 cargo test --test can_clients");
    // Each test that a defect names is there.
    for [_, _, test] in DEFECTS {
        assert!(include_str!("../can_clients.rs").contains(&format!("fn {test}()")), "{test}");
    }
}
