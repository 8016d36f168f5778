//! Our CAN dialects against other people's Python packages, at the versions of
//! `tests/python/requirements.txt`: what they send is what we send, and they read a device's answer
//! as we do. What they do wrong has a test of its own, named after it.

mod aloud;
mod python;

#[path = "can_clients/asked.rs"]
mod asked;
#[path = "can_clients/moteus.rs"]
mod moteus;
#[path = "can_clients/on_the_line.rs"]
mod on_the_line;
#[path = "can_clients/page.rs"]
mod page;

use aloud::aloud;
use asked::{asked, assert_sent, bytes, error, hexadecimal, number, sent};
use gaitway::device::coded::{Impedance, mit_setpoint, robstride_setpoint, symmetric};
use gaitway::wire::can::{CanFrame, CanId, Faults, Format, Number};
use gaitway::wire::can::{cubemars, damiao, odrive, robstride};
use gaitway_profiles::{Ranges, actuator};
use serde_json::{Value, json};

fn ranges(actuator_name: &str) -> Ranges {
    actuator(actuator_name).expect("shipped").ranges.expect("coded")
}

/// Setpoints over all of the ranges and a little beyond, in units.
fn setpoints(ranges: &Ranges) -> Vec<Impedance> {
    let shares = [-1.1, -1.0, -0.613, -0.25, -0.001, 0.0, 0.001, 0.4, 0.77, 1.0, 1.1];
    let share = |k: usize| shares[k % shares.len()];
    (0..shares.len() * 5)
        .map(|k| Impedance {
            position_rad: share(k) * ranges.position_rad,
            velocity_rad_s: share(k * 3 + 1) * ranges.velocity_rad_s,
            kp_nm_rad: share(k * 5 + 2).clamp(0.0, 1.0) * ranges.kp_nm_rad,
            kd_nm_s_rad: share(k * 7 + 3).clamp(0.0, 1.0) * ranges.kd_nm_s_rad,
            torque_nm: share(k * 2 + 4).clamp(-1.0, 1.0) * ranges.torque_nm,
        })
        .collect()
}

/// Fields of the given bits, most significant first.
fn fields<const N: usize>(payload: &[u8], bits: [u32; N]) -> [i64; N] {
    let mut whole = payload.iter().fold(0_u128, |whole, byte| whole << 8 | u128::from(*byte));
    let mut fields = [0; N];
    for (field, bits) in fields.iter_mut().zip(bits).rev() {
        *field = (whole & ((1 << bits) - 1)) as i64;
        whole >>= bits;
    }
    fields
}

/// Others round down, we round to the nearest step; some divide by a step too many, too.
#[track_caller]
fn assert_steps_apart<const N: usize>(most: i64, theirs: &[u8], ours: &[u8], bits: [u32; N]) {
    let pairs = fields(theirs, bits).into_iter().zip(fields(ours, bits));
    for (theirs_step, step) in pairs {
        assert!((theirs_step - step).abs() <= most, "{theirs:02X?} {ours:02X?}");
    }
}

const MIT: [u32; 5] = [16, 12, 12, 12, 12];

fn frame(id: Option<CanId>, payload: &[u8]) -> CanFrame {
    CanFrame::new(id.expect("fits"), Format::Classic, payload).expect("fits")
}

fn close(ours: f64, theirs: &Value, tolerance: f64) {
    let theirs = number(theirs);
    assert!((ours - theirs).abs() <= tolerance, "{ours} is not {theirs}");
}

// damiao-motor.

fn damiao_one() -> damiao::Id {
    damiao::Id::new(1).expect("an id")
}

#[test]
fn damiao_motor_sends_what_we_send() {
    use damiao::{Command, Request, command, register, request};
    let id = damiao_one();
    let force = Command::PositionForce { position: 1.0, speed: 500, current: 5_000 };
    let go = Command::PositionVelocity { position: -1.5, speed: 2.0 };
    let acceleration = request(id, Request::Write(register::ACCELERATION, 20.0_f32.to_bits()));
    let cases = [
        (json!(["damiao", "enable"]), command(id, Command::Enable)),
        (json!(["damiao", "disable"]), command(id, Command::Disable)),
        (json!(["damiao", "set_zero_position"]), command(id, Command::SetZero)),
        (json!(["damiao", "clear_error"]), command(id, Command::ClearFaults)),
        (json!(["damiao", "send_cmd_pos_vel", -1.5, 2.0]), command(id, go)),
        (json!(["damiao", "send_cmd_vel", -2.0]), command(id, Command::Velocity(-2.0))),
        (json!(["damiao", "send_cmd_force_pos", 1.0, 5.0, 0.5]), command(id, force)),
        (json!(["damiao", "request_motor_feedback"]), request(id, Request::Feedback)),
        (json!(["damiao", "request_register_reading", 21]), request(id, Request::Read(21))),
        (json!(["damiao", "write_register", 10, 2]), request(id, Request::Write(10, 2))),
        (json!(["damiao", "write_register", 4, 20.0]), acceleration),
        (json!(["damiao", "set_can_timeout", 20]), request(id, Request::Write(9, 400))),
        (json!(["damiao", "store_parameters"]), request(id, Request::Save)),
    ];
    let Some(answers) = asked(&cases.clone().map(|(request, _)| request)) else { return };
    for (answer, (_, ours)) in answers.iter().zip(&cases) {
        assert_sent(answer, ours);
    }
}

#[test]
fn damiao_motors_setpoints_are_ours_to_a_step() {
    let ranges = ranges("dm4310");
    let wanted = setpoints(&ranges);
    let requests: Vec<_> = wanted
        .iter()
        .map(|w| {
            let Impedance { position_rad, velocity_rad_s, kp_nm_rad, kd_nm_s_rad, torque_nm } = w;
            json!([
                "damiao",
                "send_cmd_mit",
                position_rad,
                velocity_rad_s,
                kp_nm_rad,
                kd_nm_s_rad,
                torque_nm
            ])
        })
        .collect();
    let Some(answers) = asked(&requests) else { return };
    for (answer, wanted) in answers.iter().zip(wanted) {
        let setpoint = damiao::Command::Setpoint(mit_setpoint(wanted, &ranges));
        let ours = damiao::command(damiao_one(), setpoint);
        let (id, theirs) = sent(answer);
        assert_eq!(id, ours.id());
        assert_steps_apart(1, &theirs, ours.payload(), MIT);
    }
}

#[test]
fn damiao_motor_reads_feedback_and_registers_as_we_do() {
    let ranges = ranges("dm4310");
    let heard = [
        [0x11, 0x8A, 0x3C, 0x7F, 0xF7, 0xFF, 0x23, 0x1E],
        [0x01, 0x00, 0x00, 0xFF, 0xFF, 0xFF, 0x50, 0x51],
        [0xD1, 0xFF, 0xFF, 0x80, 0x00, 0x00, 0x1E, 0x1F],
        [0xE1, 0x12, 0x34, 0x56, 0x78, 0x9A, 0x00, 0xFF],
    ];
    let mut requests: Vec<_> =
        heard.iter().map(|bytes| json!(["damiao", "hear", 0x11, hexadecimal(bytes)])).collect();
    let value = [0x01, 0x00, 0x33, 0x15, 0x00, 0x00, 0x48, 0x41];
    requests.push(json!(["damiao", "hear", 0x11, hexadecimal(&value)]));
    let Some(answers) = asked(&requests) else { return };
    for (answer, bytes) in answers.iter().zip(&heard) {
        let frame = frame(CanId::standard(0x11), bytes);
        let ours = damiao::feedback(damiao_one(), 0x11, &frame).expect("feedback");
        let theirs = &answer[0];
        for (number, end, key) in [
            (ours.position, ranges.position_rad, "pos"),
            (ours.velocity, ranges.velocity_rad_s, "vel"),
            (ours.torque, ranges.torque_nm, "torq"),
        ] {
            let value = symmetric(number.expect("told"), end).expect("a step");
            close(value, &theirs[key], 1e-9);
        }
        assert_eq!(theirs["t_mos"], f64::from(bytes[6]));
        let words = match theirs["status"].as_str().expect("a word") {
            "ENABLED" | "DISABLED" => Faults::NONE,
            "LOST_COMM" => Faults::SILENCE,
            "OVERLOAD" => Faults::OVERLOAD,
            other => panic!("{other}"),
        };
        assert_eq!((ours.faults, ours.enabled), (words, Some(bytes[0] >> 4 == 1)));
    }
    let frame = frame(CanId::standard(0x11), &value);
    let ours = damiao::register_value(damiao_one(), 0x11, 21, &frame).map(f32::from_bits);
    assert_eq!(answers[4][1]["21"], f64::from(ours.expect("a value")));
}

/// Its `is_register_reply` looks at three bytes that feedback may have, too.
#[test]
fn damiao_motor_takes_some_feedback_for_a_register() {
    let bytes = [0x11, 0x09, 0x33, 0x15, 0xF7, 0xFF, 0x23, 0x1E];
    let Some(answers) = asked(&[json!(["damiao", "hear", 0x11, hexadecimal(&bytes)])]) else {
        return;
    };
    assert_eq!(answers[0][0], json!({}), "no state");
    assert!(answers[0][1]["21"].is_number(), "a range that no device has");
    let frame = frame(CanId::standard(0x11), &bytes);
    assert!(damiao::feedback(damiao_one(), 0x11, &frame).is_some(), "ours asks before it reads");
    assert_eq!(damiao::register_value(damiao_one(), 0x11, 21, &frame), None);
}

// CyberGearDriver and robstride-dynamics.

fn to_gear(command: robstride::Command) -> CanFrame {
    let [host, id] = [0xFD, 0x7F].map(|number| robstride::Id::new(number).expect("an id"));
    robstride::command(host, id, command)
}

#[test]
fn cybergear_driver_sends_what_we_send() {
    use robstride::{Command, parameter};
    let write = |index, value: f32| to_gear(Command::Write(index, value.to_bits()));
    let same = [
        (json!(["cybergear", "stop"]), to_gear(Command::Disable { clear_faults: false })),
        (
            json!(["cybergear", "change_motor_id", 0x7F]),
            to_gear(Command::SetId(robstride::Id::new(0x7F).expect("an id"))),
        ),
    ];
    // It leaves the host's id out of these, which devices do not mind.
    let hostless = [
        (json!(["cybergear", "enable"]), to_gear(Command::Enable)),
        (json!(["cybergear", "set_zero_position"]), to_gear(Command::SetZero)),
        (
            json!(["cybergear", "set_parameter", "run_mode", 1]),
            to_gear(Command::Write(parameter::RUN_MODE, 1)),
        ),
        (json!(["cybergear", "set_parameter", "spd_ref", 2.0]), write(parameter::SPEED_GOAL, 2.0)),
        (
            json!(["cybergear", "set_parameter", "loc_ref", 1.0]),
            write(parameter::POSITION_GOAL, 1.0),
        ),
    ];
    let requests: Vec<_> =
        same.iter().chain(&hostless).map(|(request, _)| request.clone()).collect();
    let Some(answers) = asked(&requests) else { return };
    let (first, rest) = answers.split_at(same.len());
    for (answer, (_, ours)) in first.iter().zip(&same) {
        assert_sent(answer, ours);
    }
    for (answer, (_, ours)) in rest.iter().zip(&hostless) {
        let (id, theirs) = sent(answer);
        assert_eq!(id.number(), ours.id().number() & !0xFF00, "{ours:?}");
        assert_eq!(theirs, ours.payload());
    }
}

#[test]
fn cybergear_driver_and_robstride_dynamics_send_our_setpoints_to_two_steps() {
    // The former's range of position is that of the manual's sample code.
    let gear = Ranges { position_rad: 12.5, ..ranges("cybergear") };
    let rs02 = ranges("rs02");
    let mut cases = Vec::new();
    for w in setpoints(&gear) {
        let Impedance { position_rad, velocity_rad_s, kp_nm_rad, kd_nm_s_rad, torque_nm } = w;
        cases.push((
            json!([
                "cybergear",
                "control",
                position_rad,
                velocity_rad_s,
                torque_nm,
                kp_nm_rad,
                kd_nm_s_rad
            ]),
            robstride_setpoint(w, &gear),
        ));
    }
    for w in setpoints(&rs02) {
        let Impedance { position_rad, velocity_rad_s, kp_nm_rad, kd_nm_s_rad, torque_nm } = w;
        cases.push((
            json!([
                "robstride",
                "write_operation_frame",
                position_rad,
                kp_nm_rad,
                kd_nm_s_rad,
                velocity_rad_s,
                torque_nm
            ]),
            robstride_setpoint(w, &rs02),
        ));
    }
    let requests: Vec<_> = cases.iter().map(|(request, _)| request.clone()).collect();
    let Some(answers) = asked(&requests) else { return };
    for (answer, (_, setpoint)) in answers.iter().zip(&cases) {
        let ours = to_gear(robstride::Command::Setpoint(*setpoint));
        let (id, theirs) = sent(answer);
        assert_steps_apart(2, &theirs, ours.payload(), [16; 4]);
        let torque = |id: CanId| i64::from(id.number() >> 8 & 0xFFFF);
        assert!((torque(id) - torque(ours.id())).abs() <= 2, "{id} {ours:?}");
        assert_eq!(id.number() & 0xFF00_00FF, ours.id().number() & 0xFF00_00FF);
    }
}

#[test]
fn robstride_dynamics_sends_what_we_send() {
    use robstride::{Command, parameter};
    let cases = [
        (json!(["robstride", "enable"]), to_gear(Command::Enable)),
        (json!(["robstride", "disable"]), to_gear(Command::Disable { clear_faults: false })),
        (
            json!(["robstride", "write", "CAN_TIMEOUT", 2000]),
            to_gear(Command::Write(parameter::CAN_TIMEOUT, 2000)),
        ),
        (
            json!(["robstride", "write", "TORQUE_LIMIT", 6.5]),
            to_gear(Command::Write(parameter::TORQUE_LIMIT, 6.5_f32.to_bits())),
        ),
        (json!(["robstride", "write", "MODE", 0]), to_gear(Command::Write(parameter::RUN_MODE, 0))),
    ];
    let Some(answers) = asked(&cases.clone().map(|(request, _)| request)) else { return };
    for (answer, (_, ours)) in answers.iter().zip(&cases) {
        assert_sent(answer, ours);
    }
}

#[test]
fn feedback_of_robstride_is_read_alike_and_so_is_a_parameter() {
    let rs02 = ranges("rs02");
    let heard = [
        [0x7F, 0xFE, 0x80, 0x73, 0x7F, 0xFF, 0x01, 0x18],
        [0x12, 0x34, 0x56, 0x78, 0x9A, 0xBC, 0x01, 0xF4],
    ];
    let id = 0x0280_7FFD;
    let mut requests: Vec<_> = heard
        .iter()
        .flat_map(|bytes| {
            ["robstride", "cybergear"].map(|name| json!([name, "hear", id, hexadecimal(bytes)]))
        })
        .collect();
    let parameter = "197000000000803f";
    requests.push(json!(["robstride", "read", "MECHANICAL_POSITION", parameter]));
    let Some(answers) = asked(&requests) else { return };
    for (pair, bytes) in answers.chunks(2).zip(&heard) {
        let frame = frame(CanId::extended(id), bytes);
        let Some((_, robstride::Message::Feedback(ours))) = robstride::message(&frame) else {
            panic!("feedback")
        };
        let [position, velocity, torque] = [ours.position, ours.velocity, ours.torque];
        let value =
            |number: Option<Number>, end| symmetric(number.expect("told"), end).expect("a step");
        // The one puts zero on step 0x7FFF: half a step from the middle of the range.
        let half = 1.0 / 65_534.0;
        close(value(position, rs02.position_rad), &pair[0][0][0], 2.1 * half * rs02.position_rad);
        close(
            value(velocity, rs02.velocity_rad_s),
            &pair[0][0][1],
            2.1 * half * rs02.velocity_rad_s,
        );
        close(value(torque, rs02.torque_nm), &pair[0][0][2], 2.1 * half * rs02.torque_nm);
        let Some(Number::Steps(celsius)) = ours.temperature else { panic!("a temperature") };
        close(f64::from(celsius) / 10.0, &pair[0][0][3], 1e-9);
        close(value(position, 12.5), &pair[1][0]["position"], 1e-9);
        close(value(velocity, 30.0), &pair[1][0]["velocity"], 1e-9);
        close(value(torque, 12.0), &pair[1][0]["torque"], 1e-9);
        close(f64::from(celsius) / 10.0, &pair[1][0]["temperature"], 1e-9);
    }
    let frame = frame(CanId::extended(0x1100_7FFD), &bytes(parameter));
    let ours = robstride::message(&frame).map(|(_, message)| message);
    let expected = robstride::Message::Parameter(robstride::parameter::POSITION, 1.0_f32.to_bits());
    assert_eq!((ours, number(&answers[4])), (Some(expected), 1.0));
}

/// It looks for the fault bits a byte each, beyond the two bytes they stand in.
#[test]
fn cybergear_driver_never_sees_a_fault_or_that_the_motor_runs() {
    let id = 0x02BF_7FFD; // running, and all six faults
    let requests =
        ["cybergear", "robstride"].map(|name| json!([name, "hear", id, "7fff7fff7fff0118"]));
    let Some(answers) = asked(&requests) else { return };
    assert_eq!(answers[0][0]["mode_status"], 0);
    let faults = answers[0][2].as_object().expect("faults");
    assert!(faults.len() == 6 && faults.values().all(|fault| fault == false), "{faults:?}");
    let said = answers[1][1].as_str().expect("what it printed");
    assert!(said.contains("uncalibrated") && said.contains("undervoltage"), "{said}");
    let frame = frame(CanId::extended(id), &bytes("7fff7fff7fff0118"));
    let Some((_, robstride::Message::Feedback(ours))) = robstride::message(&frame) else {
        panic!("feedback")
    };
    assert_eq!(ours.enabled, Some(true));
    for fault in [Faults::UNDER_VOLTAGE, Faults::CURRENT, Faults::HOT, Faults::NOT_CALIBRATED] {
        assert!(ours.faults.any(fault), "{}", ours.faults);
    }
}

/// Theirs against our profiles', and where they differ, as their sources do; see the files.
#[test]
fn ranges_of_others_are_ours_but_where_the_sources_disagree() {
    let requests = ["damiao", "robstride", "lerobot"].map(|name| json!([name, "ranges"]));
    let Some(answers) = asked(&requests) else { return };
    let (mut differ, mut compared) = (Vec::new(), 0);
    let mut compare = |name: String, theirs: &Value| {
        let Ok(profile) = actuator(&name) else { return };
        compared += 1;
        let ours = profile.ranges.expect("coded");
        let ours = [
            ours.position_rad,
            ours.velocity_rad_s,
            ours.torque_nm,
            ours.kp_nm_rad,
            ours.kd_nm_s_rad,
        ];
        let theirs: Vec<_> = theirs.as_array().expect("numbers").iter().map(number).collect();
        if theirs.iter().zip(ours).any(|(theirs, ours)| (theirs - ours).abs() > 1e-3) {
            differ.push(name);
        }
    };
    for (model, theirs) in answers[0].as_object().expect("models") {
        let name = match model.as_str() {
            "4310P" | "4340P" => format!("dm{}-48v", model[..4].to_lowercase()),
            letters if letters.starts_with(['G', 'H']) => format!("dm{}", letters.to_lowercase()),
            digits => format!("dm{}", digits.to_lowercase()),
        };
        compare(name, theirs);
    }
    for (model, theirs) in answers[1].as_object().expect("models") {
        compare(model.replace('-', ""), theirs);
    }
    for (model, theirs) in answers[2].as_object().expect("models") {
        compare(model.to_lowercase().replace('_', "-"), theirs);
    }
    // Registers of the DM-J4340 and DM-J3507 tell; RobStride's manuals, its own sample code and
    // this package have three kinds of numbers.
    assert_eq!(differ, ["dm4340", "rs00", "rs03", "rs05", "rs06", "dm3507"]);
    assert!(compared >= 11 + 7 + 13, "{compared}");
}

#[test]
fn registers_of_damiao_have_lerobots_numbers() {
    use damiao::register;
    let Some(answers) = asked(&[json!(["lerobot", "MotorVariable"])]) else { return };
    for (name, number) in [
        ("UV_VALUE", register::UNDER_VOLTAGE),
        ("OT_VALUE", register::OVER_TEMPERATURE),
        ("ACC", register::ACCELERATION),
        ("DEC", register::DECELERATION),
        ("MAX_SPD", register::SPEED_LIMIT),
        ("MST_ID", register::MST_ID),
        ("ESC_ID", register::ESC_ID),
        ("TIMEOUT", register::TIMEOUT),
        ("CTRL_MODE", register::CTRL_MODE),
        ("SW_VER", register::SOFTWARE),
        ("GR", register::GEAR_RATIO),
        ("PMAX", register::PMAX),
        ("VMAX", register::VMAX),
        ("TMAX", register::TMAX),
        ("CAN_BR", register::BIT_RATE),
    ] {
        assert_eq!(answers[0][name], number, "{name}");
    }
}

// TMotorCANControl.

fn cube(number: u8) -> cubemars::Id {
    cubemars::Id::new(number).expect("an id")
}

#[test]
fn tmotor_can_control_sends_our_mit_setpoints_to_two_steps() {
    let ranges = ranges("ak80-9");
    let wanted = setpoints(&ranges);
    let mut requests: Vec<_> = wanted
        .iter()
        .map(|w| {
            let Impedance { position_rad, velocity_rad_s, kp_nm_rad, kd_nm_s_rad, torque_nm } = w;
            json!([
                "tmotor",
                "MIT_controller",
                3,
                "AK80-9",
                position_rad,
                velocity_rad_s,
                kp_nm_rad,
                kd_nm_s_rad,
                torque_nm
            ])
        })
        .collect();
    for order in ["power_on", "power_off", "zero"] {
        requests.push(json!(["tmotor", order, 3]));
    }
    let Some(answers) = asked(&requests) else { return };
    let (setpoints, orders) = answers.split_at(wanted.len());
    for (answer, wanted) in setpoints.iter().zip(wanted) {
        let setpoint = cubemars::MitCommand::Setpoint(mit_setpoint(wanted, &ranges));
        let ours = cubemars::mit_command(cube(3), setpoint);
        let (id, theirs) = sent(answer);
        assert_eq!(id, ours.id());
        // It keeps off the upper end by two.
        assert_steps_apart(2, &theirs, ours.payload(), MIT);
    }
    use cubemars::MitCommand::{Disable, Enable, SetZero};
    for (answer, order) in orders.iter().zip([Enable, Disable, SetZero]) {
        assert_sent(answer, &cubemars::mit_command(cube(3), order));
    }
}

#[test]
fn tmotor_can_control_reads_both_modes_as_we_do() {
    let ranges = ranges("ak80-9");
    let mit = [0x03, 0x8A, 0x3C, 0x7F, 0xF7, 0xFF, 0x23, 0x01];
    let servo = [0x03, 0x84, 0x00, 0x64, 0x00, 0x32, 0x23, 0x02];
    let requests = [
        json!(["tmotor", "hear", 3, hexadecimal(&mit)]),
        json!(["tmotor", "hear", 3, hexadecimal(&mit[..6])]),
        json!(["tmotor", "hear", 0x2901, hexadecimal(&servo)]),
        json!(["tmotor", "comm_can_set_origin", 1, 1]),
    ];
    let Some(answers) = asked(&requests) else { return };
    let (_, ours) = cubemars::mit_reply(&frame(CanId::standard(3), &mit)).expect("a reply");
    let value =
        |number: Option<Number>, end| symmetric(number.expect("told"), end).expect("a step");
    for theirs in &answers[..2] {
        close(value(ours.position, ranges.position_rad), &theirs[0], 1e-9);
        close(value(ours.velocity, ranges.velocity_rad_s), &theirs[1], 1e-9);
        close(value(ours.torque, ranges.torque_nm), &theirs[2], 1e-9);
    }
    assert_eq!((&answers[0][3], &answers[0][4]), (&json!(35.0), &json!(1.0)), "over-temperature");
    assert!(ours.faults.any(Faults::HOT));
    assert_eq!(answers[1][3], -1.0, "six bytes tell no temperature");
    let (_, ours) =
        cubemars::servo_feedback(&frame(CanId::extended(0x2901), &servo)).expect("told");
    let steps = [ours.position, ours.velocity, ours.torque, ours.temperature];
    for (number, (scale, theirs)) in steps
        .into_iter()
        .zip([0.1, 10.0, 0.01, 1.0].into_iter().zip(answers[2].as_array().expect("")))
    {
        let Some(Number::Steps(steps)) = number else { panic!("{number:?}") };
        close(f64::from(steps) * scale, theirs, 1e-9);
    }
    assert!(ours.faults.any(Faults::CURRENT) && answers[2][4] == 2.0, "over-current");
    let origin = cubemars::ServoCommand::SetOrigin { kept: true };
    assert_sent(&answers[3], &cubemars::servo_command(cube(1), origin));
}

/// Its encoder takes two arguments and is given three, or one that has no value yet; and a
/// negative number does not fit the type it is put in.
#[test]
fn tmotor_can_control_cannot_command_servo_mode_nor_read_negative_numbers() {
    let requests = [
        json!(["tmotor", "comm_can_set_duty", 1, 0.1]),
        json!(["tmotor", "comm_can_set_current", 1, 1.0]),
        json!(["tmotor", "comm_can_set_cb", 1, 1.0]),
        json!(["tmotor", "comm_can_set_rpm", 1, 1000]),
        json!(["tmotor", "comm_can_set_pos", 1, 90.0]),
        json!(["tmotor", "comm_can_set_pos_spd", 1, 90.0, 500, 300]),
        json!(["tmotor", "hear", 0x2901, "ff84006400322300"]),
    ];
    let Some(answers) = asked(&requests) else { return };
    for answer in &answers[..6] {
        let error = error(answer);
        assert!(error.contains("TypeError") || error.contains("NameError"), "{error}");
    }
    assert!(error(&answers[6]).contains("OverflowError"));
    let frame = frame(CanId::extended(0x2901), &bytes("ff84006400322300"));
    let (_, ours) = cubemars::servo_feedback(&frame).expect("told");
    assert_eq!(ours.position, Some(Number::Steps(-124)));
}

// odrive.

#[test]
fn every_error_of_the_odrive_package_has_words() {
    let requests = [json!(["odrive", "ODriveError"]), json!(["odrive", "AxisState"])];
    let Some(answers) = asked(&requests) else { return };
    let errors = answers[0].as_object().expect("errors");
    assert!(errors.len() > 20, "{errors:?}");
    for (name, bit) in errors {
        let faults = odrive::faults(number(bit) as u32, odrive::Firmware::V06);
        let expected = match name.as_str() {
            "NONE" => Faults::NONE,
            "DC_BUS_OVER_VOLTAGE" => Faults::OVER_VOLTAGE,
            "DC_BUS_UNDER_VOLTAGE" => Faults::UNDER_VOLTAGE,
            "MOTOR_OVER_TEMP" => Faults::MOTOR_HOT,
            "INVERTER_OVER_TEMP" => Faults::HOT,
            "WATCHDOG_TIMER_EXPIRED" => Faults::SILENCE,
            "DRV_FAULT" => Faults::DRIVER,
            "MISSING_ESTIMATE" | "SPINOUT_DETECTED" => Faults::ENCODER,
            "BAD_CONFIG" | "CALIBRATION_ERROR" => Faults::NOT_CALIBRATED,
            name if name.contains("CURRENT") => Faults::CURRENT,
            name if name.contains("LIMIT_VIOLATION") => Faults::OUT_OF_RANGE,
            _ => Faults::OTHER,
        };
        assert_eq!(faults, expected, "{name}");
    }
    assert_eq!(answers[1]["IDLE"], odrive::STATE_IDLE);
    assert_eq!(answers[1]["CLOSED_LOOP_CONTROL"], odrive::STATE_CLOSED_LOOP);
}
