//! Each rule of the validator for CAN: actuators, and robots that have them.

use gaitway_profiles::{
    Dialect, LineKind, ProfileError, TimeoutKind, actuator, actuator_names, parse_actuator,
    parse_robot,
};

const ROBOT: &str = include_str!("fixtures/mixed.toml");
const CODED: &str = include_str!("../actuators/damiao/dm4310.toml");
const ELECTRICAL: &str = include_str!("../actuators/cubemars/ak80-9-servo.toml");
const PLAIN: &str = include_str!("../actuators/mjbots/moteus-n1.toml");

/// Replaces the first `from`, which must be there, so that a test cannot go blind.
fn changed(text: &str, from: &str, to: &str) -> String {
    assert!(text.contains(from), "the fixture has no {from:?}");
    text.replacen(from, to, 1)
}

#[track_caller]
fn refused<T>(result: Result<T, ProfileError>, what: &str, place: &str) {
    let Err(error) = result else { panic!("accepted, expected: {what}") };
    assert!(error.to_string().contains(what), "expected {what:?} in:\n{error}");
    let found = error.place.as_deref().unwrap_or_default();
    assert!(found.contains(place), "expected the place {place:?} in:\n{error}");
}

#[track_caller]
fn robot_refused(from: &str, to: &str, what: &str, place: &str) {
    refused(parse_robot("mixed.toml", &changed(ROBOT, from, to)), what, place);
}

#[track_caller]
fn coded_refused(from: &str, to: &str, what: &str, place: &str) {
    refused(parse_actuator("dm4310.toml", &changed(CODED, from, to)), what, place);
}

#[test]
fn the_unchanged_fixtures_are_accepted() {
    let robot = parse_robot("mixed.toml", ROBOT).unwrap();
    let on_can = |line: &str| {
        robot.lines.iter().any(|l| l.name == line && matches!(l.kind, LineKind::Can(_)))
    };
    assert_eq!(robot.joints.iter().filter(|joint| on_can(&joint.line)).count(), 12);
    assert_eq!(robot.joints.iter().filter(|joint| !on_can(&joint.line)).count(), 6);
    parse_actuator("dm4310.toml", CODED).unwrap();
    parse_actuator("ak80-9-servo.toml", ELECTRICAL).unwrap();
    parse_actuator("moteus-n1.toml", PLAIN).unwrap();
}

#[test]
fn a_file_cut_off_at_any_byte_is_an_error_or_a_whole_profile_never_a_panic() {
    for end in (0..ROBOT.len()).step_by(7) {
        let _ = parse_robot("mixed.toml", &ROBOT[..end]);
    }
    for end in 0..CODED.len() {
        let _ = parse_actuator("dm4310.toml", &CODED[..end]);
    }
}

// Actuators.

#[test]
fn an_actuator_says_what_it_is_and_where_that_is_written() {
    coded_refused("model = \"DM-J4310-2EC\"", "model = \"\"", "empty", "model");
    coded_refused("maker = \"Damiao\"", "maker = \" \"", "empty", "maker");
    coded_refused("schema = 1", "schema = 2", "version", "schema");
    refused(parse_actuator("other.toml", CODED), "name of its file", "name");
    let [file, ranges, timeout, gear] =
        ["dialect = \"damiao\"\n", "readable = true\n", "cleared\"\n", "ratio = 10.0\n"];
    for (before, place) in [
        (file, "source"),
        (ranges, "ranges.source"),
        (timeout, "timeout.source"),
        (gear, "gear.source"),
    ] {
        let (head, tail) = CODED.split_once(before).unwrap();
        let (_, rest) = tail.split_once('\n').unwrap();
        let text = format!("{head}{before}source = \"\"\n{rest}");
        refused(parse_actuator("dm4310.toml", &text), "empty", place);
    }
    coded_refused("dialect = \"damiao\"", "dialect = \"morse\"", "form", "line");
    coded_refused("readable = true", "readable = true\nreadible = true", "form", "line");
}

#[test]
fn bit_rates_are_those_of_can() {
    let rates = "bitrates_bps = [1000000, 500000, 250000, 200000, 125000]";
    coded_refused(rates, "bitrates_bps = []", "needs a bit rate", "line.bitrates_bps");
    let twice = "bitrates_bps = [1000000, 1000000]";
    coded_refused(rates, twice, "bit rate twice", "line.bitrates_bps");
    for bad in ["9999", "1000001"] {
        let to = format!("bitrates_bps = [{bad}]");
        coded_refused(rates, &to, "no CAN line has this bit rate", "line.bitrates_bps");
    }
    let fast = "data_bitrates_bps = [5000000,";
    coded_refused(fast, "data_bitrates_bps = [8000001,", "no CAN line", "line.data_bitrates_bps");
    coded_refused(fast, "data_bitrates_bps = [4000000,", "twice", "line.data_bitrates_bps");
}

#[test]
fn ids_fit_the_dialect_and_the_factorys_is_among_them() {
    coded_refused("first_id = 1", "first_id = 16", "do not fit", "first_id");
    coded_refused("factory_id = 1", "factory_id = 16", "none that may be given", "factory_id");
    let text = changed(PLAIN, "last_id = 126", "last_id = 128");
    refused(parse_actuator("moteus-n1.toml", &text), "do not fit the dialect", "last_id");
    for (dialect, last) in [
        (Dialect::CubemarsMit, 255),
        (Dialect::CubemarsServo, 255),
        (Dialect::Damiao, 255),
        (Dialect::Robstride, 254),
        (Dialect::Odrive, 63),
        (Dialect::Moteus, 127),
        (Dialect::Recoil, 127),
    ] {
        assert_eq!(dialect.last_id(), last, "{dialect:?}");
    }
}

#[test]
fn ranges_stand_with_exactly_the_dialects_that_code_numbers() {
    let (head, rest) = CODED.split_once("[ranges]").unwrap();
    let (_, tail) = rest.split_once("[timeout]").unwrap();
    let without = format!("{head}[timeout]{tail}");
    refused(parse_actuator("dm4310.toml", &without), "without ranges", "ranges");
    let ranges = rest.split_once("[timeout]").unwrap().0;
    let with = format!("{PLAIN}\n[ranges]{ranges}");
    refused(parse_actuator("moteus-n1.toml", &with), "units of its own", "ranges");
    for key in ["position_rad = 12.5", "velocity_rad_s = 30.0", "torque_nm = 10.0"] {
        let name = key.split_once(' ').unwrap().0;
        for bad in ["0.0", "-1.0", "nan", "inf"] {
            coded_refused(key, &format!("{name} = {bad}"), "above zero", name);
        }
    }
    coded_refused("kp_nm_rad = 500.0", "kp_nm_rad = nan", "above zero", "kp_nm_rad");
    coded_refused("kd_nm_s_rad = 5.0", "kd_nm_s_rad = 0.0", "above zero", "kd_nm_s_rad");
}

#[test]
fn a_timeout_that_does_not_exist_has_no_length() {
    let none = changed(CODED, "kind = \"register\"", "kind = \"none\"");
    refused(parse_actuator("dm4310.toml", &none), "does not exist", "timeout");
    parse_actuator("dm4310.toml", &changed(&none, "step_s = 0.00005\n", "")).unwrap();
    coded_refused("step_s = 0.00005", "step_s = 0.0", "above zero", "timeout.step_s");
    let text = changed(PLAIN, "factory_s = 0.1", "factory_s = nan");
    refused(parse_actuator("moteus-n1.toml", &text), "above zero", "timeout.factory_s");
    let (head, rest) = CODED.split_once("action = ").unwrap();
    let text = format!("{head}action = \"\"\n{}", rest.split_once('\n').unwrap().1);
    refused(parse_actuator("dm4310.toml", &text), "empty", "timeout.action");
}

#[test]
fn pole_pairs_stand_with_exactly_the_dialects_that_tell_electrical_speeds() {
    let electrical = |text: &str| parse_actuator("ak80-9-servo.toml", text);
    let what = "without pole pairs";
    refused(electrical(&changed(ELECTRICAL, "pole_pairs = 21\n", "")), what, "gear.pole_pairs");
    let zero = changed(ELECTRICAL, "pole_pairs = 21", "pole_pairs = 0");
    refused(electrical(&zero), what, "gear.pole_pairs");
    let (without_gear, _) = ELECTRICAL.split_once("[gear]").unwrap();
    refused(electrical(without_gear), what, "gear.pole_pairs");
    coded_refused("ratio = 10.0", "ratio = 10.0\npole_pairs = 14", "no electrical", "pole_pairs");
    coded_refused("ratio = 10.0", "ratio = -10.0", "above zero", "gear.ratio");
}

// What the shipped ones are, after their makers' documents.

#[test]
fn every_dialect_has_an_actuator_and_the_timeouts_are_as_documented() {
    let all: Vec<_> = actuator_names().map(|name| actuator(name).unwrap()).collect();
    for dialect in [
        Dialect::CubemarsMit,
        Dialect::CubemarsServo,
        Dialect::Damiao,
        Dialect::Robstride,
        Dialect::Odrive,
        Dialect::Moteus,
        Dialect::Recoil,
    ] {
        assert!(all.iter().any(|actuator| actuator.dialect == dialect), "{dialect:?}");
    }
    for actuator in &all {
        let timeout = &actuator.timeout;
        match actuator.dialect {
            // 20000 is one second: RS00 user manual, canTimeout; damiao-motor, TIMEOUT.
            Dialect::Damiao => assert_eq!(timeout.step_s, Some(5e-5), "{}", actuator.name),
            Dialect::Robstride if actuator.name != "cybergear" => {
                assert_eq!((timeout.kind, timeout.step_s), (TimeoutKind::Register, Some(5e-5)));
            }
            // servo.default_timeout_s of its reference; watchdog_timeout = 1000 ms of its firmware.
            Dialect::Moteus => assert_eq!(timeout.factory_s, Some(0.1)),
            Dialect::Recoil => assert_eq!(timeout.factory_s, Some(1.0)),
            _ => assert_eq!(timeout.kind, TimeoutKind::Configured, "{}", actuator.name),
        }
    }
}

// Robots.

#[test]
fn a_line_has_the_speeds_of_its_kind() {
    let rate = "bitrate_bps = 1000000";
    robot_refused(rate, "baud_bps = 1000000", "a CAN line has bitrate_bps", "line");
    robot_refused(rate, "bitrate_bps = 1000000\nbaud_bps = 9600", "and no baud_bps", "line");
    robot_refused("kind = \"can\"\n", "", "a serial line has baud_bps", "line");
    let baud = "baud_bps = 2000000";
    robot_refused(baud, "baud_bps = 2000000\nhost_id = 1", "a serial line has baud_bps", "line");
    robot_refused("kind = \"can\"", "kind = \"lin\"", "form", "line");
    let fast = "bitrate_bps = 1000000\ndata_bitrate_bps = 3000000";
    robot_refused(rate, fast, "cannot run at its data speed", "left_hip_yaw");
    robot_refused(rate, "bitrate_bps = 800000", "cannot run at its speed", "left_hip_yaw");
    let fast = changed(ROBOT, rate, "bitrate_bps = 1000000\ndata_bitrate_bps = 5000000");
    parse_robot("mixed.toml", &fast).unwrap();
}

#[test]
fn servos_hang_on_serial_lines_and_actuators_on_can_lines() {
    robot_refused("servo = \"dm4310\"", "servo = \"xm430-w350\"", "a servo cannot hang", "hip_yaw");
    robot_refused("servo = \"dm4310\"", "servo = \"dm4311\"", "no valid actuator", "hip_yaw");
    let arm = "servo = \"xm430-w350\"\ndirection";
    let what = "a CAN actuator cannot hang on a serial line";
    robot_refused(arm, "servo = \"dm4310\"\ndirection", what, "right_shoulder_pitch");
    for key in
        ["answer_id = 17", "kp_nm_rad = 1.0", "kd_nm_s_rad = 1.0", "timeout_configured_s = 1.0"]
    {
        let to = format!("servo = \"xm430-w350\"\n{key}\ndirection");
        robot_refused(arm, &to, "only a joint on a CAN line", key.split_once(' ').unwrap().0);
    }
}

#[test]
fn ids_on_a_can_line_are_the_dialects_and_distinct() {
    robot_refused("id = 1\n", "id = 16\n", "cannot have this id", "left_hip_yaw");
    robot_refused("id = 2\n", "id = 1\n", "same ID", "left_hip_roll");
    let other = "servo = \"recoil-5010\"\ndirection";
    let damiao =
        "servo = \"dm4310\"\nanswer_id = 17\nkp_nm_rad = 40.0\nkd_nm_s_rad = 1.0\ndirection";
    robot_refused(damiao, other, "identifiers of two dialects would mix", "left_hip_roll");
    // One with long identifiers stays out of the others' way.
    let long = "servo = \"rs02\"\nkp_nm_rad = 40.0\nkd_nm_s_rad = 1.0\ndirection";
    parse_robot("mixed.toml", &changed(ROBOT, damiao, long)).unwrap();
    let host = changed(ROBOT, "bitrate_bps = 1000000", "bitrate_bps = 1000000\nhost_id = 1");
    let host = changed(&host, damiao, long);
    refused(parse_robot("mixed.toml", &host), "the host's own id", "left_hip_yaw");
}

#[test]
fn answers_are_told_apart_and_are_nobodys_commands() {
    let second = "answer_id = 18";
    robot_refused(second, "answer_id = 17", "answer alike", "left_hip_roll\", answer_id");
    robot_refused(second, "answer_id = 3", "a command to another", "left_hip_roll\", answer_id");
    // 0x100 + 5: the position and speed command of device 5.
    robot_refused(second, "answer_id = 261", "a command to another", "left_hip_roll\", answer_id");
    robot_refused(second, "answer_id = 2047", "a command to another", "left_hip_roll\", answer_id");
    robot_refused(second, "answer_id = 2048", "more than 11 bits", "left_hip_roll\", answer_id");
    let all_zero = ROBOT.lines().filter(|line| !line.starts_with("answer_id")).collect::<Vec<_>>();
    parse_robot("mixed.toml", &all_zero.join("\n")).unwrap();
    let recoil = "servo = \"recoil-5010\"\nanswer_id = 17\ndirection";
    let damiao =
        "servo = \"dm4310\"\nanswer_id = 17\nkp_nm_rad = 40.0\nkd_nm_s_rad = 1.0\ndirection";
    robot_refused(damiao, recoil, "no id to choose", "left_hip_yaw\", answer_id");
}

#[test]
fn gains_are_given_to_exactly_the_actuators_that_are_told_them() {
    robot_refused("kp_nm_rad = 40.0\n", "", "must be told its gains", "left_hip_yaw\", kp");
    robot_refused("kd_nm_s_rad = 1.0\n", "", "must be told its gains", "left_hip_yaw\", kd");
    for bad in ["0.0", "-1.0", "500.1", "nan", "inf"] {
        let to = format!("kp_nm_rad = {bad}");
        robot_refused("kp_nm_rad = 40.0", &to, "cannot have this gain", "left_hip_yaw\", kp");
    }
    robot_refused("kd_nm_s_rad = 1.0", "kd_nm_s_rad = 5.1", "cannot have this gain", "kd_nm_s_rad");
    let damiao =
        "servo = \"dm4310\"\nanswer_id = 17\nkp_nm_rad = 40.0\nkd_nm_s_rad = 1.0\ndirection";
    let recoil = "servo = \"recoil-5010\"\nkp_nm_rad = 40.0\ndirection";
    robot_refused(damiao, recoil, "keeps its own gains", "left_hip_yaw\", kp");
}

#[test]
fn a_timeout_is_said_by_the_user_only_where_the_line_cannot_set_it() {
    let damiao = "kd_nm_s_rad = 1.0\ndirection";
    let said = "kd_nm_s_rad = 1.0\ntimeout_configured_s = 0.1\ndirection";
    robot_refused(damiao, said, "not the user's to say", "timeout_configured_s");
    let whole =
        "servo = \"dm4310\"\nanswer_id = 17\nkp_nm_rad = 40.0\nkd_nm_s_rad = 1.0\ndirection";
    for bad in ["0.0", "-0.1", "nan", "inf"] {
        let recoil = format!("servo = \"recoil-5010\"\ntimeout_configured_s = {bad}\ndirection");
        robot_refused(whole, &recoil, "above zero", "left_hip_yaw\", timeout_configured_s");
    }
}

#[test]
fn a_joint_stays_within_what_its_actuator_can_be_told() {
    robot_refused("velocity_rad_s = 6.0", "velocity_rad_s = 30.1", "faster than its", "hip_yaw");
    robot_refused("upper_rad = 0.6", "upper_rad = 12.6", "cannot be told", "hip_yaw\", upper_rad");
    robot_refused(
        "lower_rad = -0.6",
        "lower_rad = -12.6",
        "cannot be told",
        "hip_yaw\", lower_rad",
    );
    robot_refused("offset_rad = 0.0", "offset_rad = 12.0", "cannot be told", "upper_rad");
    let far = changed(ROBOT, "upper_rad = 0.6", "upper_rad = 12.4");
    parse_robot("mixed.toml", &far).unwrap();
}
