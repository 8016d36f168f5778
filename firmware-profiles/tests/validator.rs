//! Each rule of the validator: a small good file, one thing changed, the right complaint.

use gaitway_profiles::{
    MAX_FILE_BYTES, Profile, ProfileError, parse_adapter, parse_board, parse_robot, parse_servo,
    profile, robot, servo,
};
use std::fs;
use std::path::PathBuf;

const SERVO: &str = include_str!("fixtures/tiny.toml");
const ROBOT: &str = include_str!("fixtures/pair.toml");
const ADAPTER: &str = r#"
schema = 1
name = "cable"
model = "A cable"
usb_ids = ["0403:6014"]
echo = false
latency_s = 0.001
source = "its label"
"#;

/// Replaces the first `from`, which must be there, so that a test cannot go blind.
fn changed(text: &str, from: &str, to: &str) -> String {
    assert!(text.contains(from), "the fixture has no {from:?}");
    text.replacen(from, to, 1)
}

#[track_caller]
fn refused<T>(result: Result<T, ProfileError>, what: &str, place: &str) {
    let Err(error) = result else { panic!("accepted, expected: {what}") };
    assert!(error.what.contains(what), "expected {what:?} in:\n{error}");
    let found = error.place.as_deref().unwrap_or_default();
    assert!(found.contains(place), "expected the place {place:?} in:\n{error}");
}

#[track_caller]
fn servo_refused(from: &str, to: &str, what: &str, place: &str) {
    refused(parse_servo("tiny.toml", &changed(SERVO, from, to)), what, place);
}

#[track_caller]
fn robot_refused(from: &str, to: &str, what: &str, place: &str) {
    refused(parse_robot("pair.toml", &changed(ROBOT, from, to)), what, place);
}

#[test]
fn the_unchanged_fixtures_are_accepted() {
    parse_servo("tiny.toml", SERVO).unwrap();
    parse_servo("any/folder/tiny.toml", SERVO).unwrap();
    parse_robot("pair.toml", ROBOT).unwrap();
    parse_adapter("cable.toml", ADAPTER).unwrap();
}

// The file as a whole.

#[test]
fn an_unknown_key_is_refused_and_named_with_its_line() {
    let text = changed(ROBOT, "upper_rad = 1.0", "upper_rad = 1.0\nuper_rad = 0.5");
    let error = parse_robot("pair.toml", &text).unwrap_err();
    assert!(error.got.as_deref().unwrap_or_default().contains("uper_rad"), "{error}");
    let line = text.lines().position(|line| line.starts_with("uper_rad")).unwrap() + 1;
    assert_eq!(error.place.as_deref(), Some(format!("line {line}, joint \"hip\"").as_str()));
    let servo = changed(SERVO, "address = 0\n", "address = 0\nlength = 2\n");
    assert!(parse_servo("tiny.toml", &servo).unwrap_err().to_string().contains("length"));
}

#[test]
fn a_file_cut_off_at_any_byte_is_an_error_or_a_whole_profile_never_a_panic() {
    for end in 0..SERVO.len() {
        let _ = parse_servo("tiny.toml", &SERVO[..end]);
    }
    for end in 0..ROBOT.len() {
        let _ = parse_robot("pair.toml", &ROBOT[..end]);
    }
    let error = parse_robot("pair.toml", &ROBOT[..ROBOT.len() / 2]).unwrap_err();
    assert_eq!(&*error.file, "pair.toml");
}

#[test]
fn deep_nesting_is_an_error_not_a_stack_overflow() {
    let text = format!("schema = {}", "[".repeat(1_000_000));
    assert!(parse_robot("pair.toml", &text).is_err());
    assert!(parse_robot("pair.toml", &format!("a{} = 1", ".a".repeat(400_000))).is_err());
}

#[test]
fn another_format_version_is_refused() {
    servo_refused("schema = 1", "schema = 2", "version", "schema");
    robot_refused("schema = 1", "schema = 0", "version", "schema");
}

#[test]
fn the_name_must_be_the_files_own_and_never_a_path() {
    refused(parse_servo("other.toml", SERVO), "name of its file", "name");
    refused(
        parse_robot("pair.toml", &changed(ROBOT, "\"pair\"", "\"Pair\"")),
        "name of a profile",
        "name",
    );
    refused(parse_adapter("other.toml", ADAPTER), "name of its file", "name");
    for bad in ["Tiny", "../tiny", "ti ny", "", "tiny_1", "tiný"] {
        servo_refused("name = \"tiny\"", &format!("name = {bad:?}"), "name of a profile", "name");
    }
}

// Servos.

#[test]
fn registers_need_distinct_names_and_roles() {
    servo_refused("name = \"Present Velocity\"", "name = \"ID\"", "register name twice", "");
    servo_refused("role = \"led\"", "role = \"id\"", "same role", "\"LED\" at 65");
    servo_refused(
        "name = \"Moving\"",
        "name = \"Indirect Address 29\"",
        "register name twice",
        "register",
    );
}

#[test]
fn registers_that_overlap_or_are_out_of_order_are_refused() {
    servo_refused("address = 132", "address = 131", "overlap", "Present Position");
    servo_refused("address = 65", "address = 64", "overlap", "LED");
    servo_refused("address = 70", "address = 200", "out of order", "Profile Acc");
    servo_refused("repeat = 2\n", "repeat = 5\n", "overlap", "Indirect Data");
}

#[test]
fn a_register_beyond_the_protocols_addresses_is_refused() {
    servo_refused("address = 634", "address = 65535", "beyond", "at 65535");
    let feetech = include_str!("../servos/feetech/sts3215.toml");
    let text = changed(feetech, "address = 86", "address = 256");
    refused(parse_servo("sts3215.toml", &text), "beyond", "at 256");
}

#[test]
fn the_size_must_go_with_the_encoding() {
    servo_refused("bytes = 4\nencoding = \"i32\"", "bytes = 2\nencoding = \"i32\"", "size", "");
    servo_refused("bytes = 4\nencoding = \"i32\"", "bytes = 3\nencoding = \"i32\"", "size", "");
    servo_refused("encoding = \"u16\"", "encoding = \"i8\"", "size", "Model Number");
}

#[test]
fn ranges_and_initial_values_must_agree() {
    servo_refused("max = 252", "max = 252\ninitial = 253", "initial", "\"ID\" at 7");
    servo_refused("min = 0\nmax = 252", "min = 10\nmax = 2", "upside down", "\"ID\" at 7");
    servo_refused("max = 252", "max = 256", "encoding cannot hold", "\"ID\" at 7");
    servo_refused("min = 0\nmax = 252", "min = -1\nmax = 252", "encoding cannot hold", "ID");
    // The last of two indirect addresses would start at 661 + 1.
    servo_refused("initial = 634", "initial = 661", "initial", "Indirect Address");
}

#[test]
fn a_scale_must_be_finite_and_above_zero() {
    for bad in ["0.0", "-1.0", "nan", "inf", "-nan"] {
        servo_refused("scale = 0.229", &format!("scale = {bad}"), "above zero", "scale");
    }
}

#[test]
fn each_register_must_say_where_it_is_written() {
    servo_refused("source = \"page 1\"", "source = \" \"", "where it is written", "Model Number");
}

#[test]
fn repeats_are_one_or_more_and_first_needs_them() {
    servo_refused("repeat = 2\n", "repeat = 0\n", "one or more", "Indirect Address");
    servo_refused("repeat = 2\n", "", "counted from", "Indirect Address");
}

#[test]
fn error_bits_are_distinct_and_in_one_byte() {
    servo_refused("bit = 5", "bit = 8", "eight bits", "error_bit");
    servo_refused("bit = 5", "bit = 2", "error bit twice", "error_bit");
}

#[test]
fn an_error_register_holds_bits_or_codes_and_each_code_once() {
    let both = "error_code = [{ value = 1, name = \"hot\" }]\nerror_bit = [";
    servo_refused("error_bit = [", both, "bits or one code", "error_code");
    let codes = SERVO.replace("error_bit = [", "error_code = [").replace("{ bit =", "{ value =");
    parse_servo("tiny.toml", &codes).unwrap();
    let with = |value: &str| parse_servo("tiny.toml", &changed(&codes, "value = 5", value));
    refused(with("value = 2"), "error code twice", "error_code");
    refused(with("value = 0"), "0 says", "error_code");
}

#[test]
fn counts_may_begin_below_zero_but_zero_lies_among_them() {
    let text = changed(SERVO, "zero_count = 2048", "zero_count = 0, lowest_count = -2048");
    parse_servo("tiny.toml", &text).unwrap();
    let above = changed(&text, "zero_count = 0", "zero_count = 2048");
    refused(parse_servo("tiny.toml", &above), "angle zero lies outside", "position");
}

#[test]
fn every_required_role_is_missed() {
    for role in [
        "model_number",
        "firmware_version",
        "id",
        "baud_rate",
        "return_delay",
        "status_return_level",
        "operating_mode",
        "min_position_limit",
        "max_position_limit",
        "torque_enable",
        "hardware_error",
        "goal_position",
        "present_position",
        "present_velocity",
        "present_voltage",
        "profile_velocity",
        "profile_acceleration",
    ] {
        servo_refused(&format!("role = \"{role}\"\n"), "", "missing", "register");
    }
    let feetech = include_str!("../servos/feetech/sts3215.toml");
    for role in ["firmware_version_minor", "eeprom_lock"] {
        let text = changed(feetech, &format!("role = \"{role}\"\n"), "");
        refused(parse_servo("sts3215.toml", &text), "missing", "register");
    }
}

#[test]
fn what_the_driver_must_write_must_be_writable() {
    servo_refused("max = 252\naccess = \"rw\"", "max = 252\naccess = \"r\"", "writable", "ID");
}

#[test]
fn indirect_addresses_and_data_pair() {
    servo_refused("role = \"indirect_data\"\n", "", "pair", "register");
}

#[test]
fn the_model_number_stands_once_or_the_same_twice() {
    servo_refused("model_number = 7", "model_number = 8", "twice, differently", "model_number");
}

#[test]
fn the_baud_table_is_distinct_and_within_its_register() {
    servo_refused("index = 3", "index = 1", "baud index twice", "baud");
    servo_refused("bps = 1000000", "bps = 57600", "line speed twice", "baud");
    servo_refused("index = 3", "index = 8", "cannot ask", "baud");
    servo_refused("bps = 1000000", "bps = 0", "cannot ask", "baud");
}

#[test]
fn encoder_motor_and_firmware_are_plausible() {
    servo_refused("counts = 4096", "counts = 0", "no scale", "position");
    servo_refused("degrees = 360", "degrees = 0", "no scale", "position");
    servo_refused("zero_count = 2048", "zero_count = 4096", "outside the encoder", "zero_count");
    servo_refused("zero_count = 2048", "zero_count = -1", "outside the encoder", "zero_count");
    servo_refused("voltage_v = 12.0", "voltage_v = nan", "above zero", "voltage_v");
    servo_refused("stall_current_a = 1.0", "stall_current_a = 0.0", "above zero", "motor");
    servo_refused("min = 40, max = 50", "min = 40, max = 39", "upside down", "firmware");
}

// Robots.

#[test]
fn names_of_joints_and_lines_are_plain() {
    for bad in ["Hip", "hip-1", "hip 1", ""] {
        robot_refused("name = \"hip\"", &format!("name = {bad:?}"), "name of a joint", "joint");
        robot_refused("name = \"leg\"", &format!("name = {bad:?}"), "name of a line", "line");
    }
}

#[test]
fn servo_and_line_must_exist() {
    robot_refused("servo = \"xl430-w250\"\nd", "servo = \"xl431\"\nd", "no valid servo", "hip");
    robot_refused("id = 1\nline = \"leg\"", "id = 1\nline = \"arm\"", "no such line", "hip");
}

#[test]
fn joints_and_ids_are_distinct() {
    robot_refused("name = \"knee\"", "name = \"hip\"", "joint name twice", "joint");
    robot_refused("id = 2", "id = 1", "same ID", "knee");
    robot_refused("id = 2", "id = 253", "no such ID", "knee");
    robot_refused("id = 2", "id = 256", "form", "line");
}

#[test]
fn a_direction_is_a_sign() {
    robot_refused("direction = -1", "direction = 0", "sign", "knee");
    robot_refused("direction = -1", "direction = 2", "sign", "knee");
}

#[test]
fn limits_are_in_order_and_hold_the_initial_angle() {
    robot_refused("upper_rad = 1.0", "upper_rad = -1.0", "upside down", "hip");
    robot_refused("initial_rad = 0.5", "initial_rad = 1.01", "outside its limits", "hip");
    robot_refused("initial_rad = 0.5", "initial_rad = -1.01", "outside its limits", "hip");
}

#[test]
fn nothing_of_a_joint_may_be_nan_or_infinite() {
    for (key, good) in [
        ("offset_rad", "0.0"),
        ("lower_rad", "-1.0"),
        ("upper_rad", "1.0"),
        ("initial_rad", "0.5"),
        ("velocity_rad_s", "4.0"),
        ("acceleration_rad_s2", "20.0"),
    ] {
        for bad in ["nan", "inf", "-inf", "-nan"] {
            robot_refused(&format!("{key} = {good}"), &format!("{key} = {bad}"), "number", key);
        }
    }
    robot_refused("origin_m = [0.0, ", "origin_m = [nan, ", "not a number", "origin_m");
    robot_refused("axis = [0.0, ", "axis = [nan, ", "unit length", "hip");
    robot_refused("velocity_rad_s = 4.0", "velocity_rad_s = 0.0", "above zero", "hip");
    robot_refused("acceleration_rad_s2 = 20.0", "acceleration_rad_s2 = -1.0", "above zero", "hip");
    robot_refused("n_pose_rad = { hip = 0.1", "n_pose_rad = { hip = nan", "not a number", "hip");
    robot_refused("direction_weight = 1.0", "direction_weight = nan", "weight", "direction_weight");
    robot_refused("twist_weight = 0.5", "twist_weight = -0.5", "weight", "twist_weight");
    robot_refused("twist_weight = 0.5", "twist_weight = inf", "weight", "twist_weight");
}

#[test]
fn an_axis_has_unit_length_to_a_millionth() {
    robot_refused("axis = [0.0, 1.0, 0.0]", "axis = [0.0, 1.000002, 0.0]", "unit", "hip");
    robot_refused("axis = [0.0, 1.0, 0.0]", "axis = [0.0, 0.0, 0.0]", "unit", "hip");
    let close = changed(ROBOT, "axis = [0.0, 1.0, 0.0]", "axis = [0.0, 1.0000005, 0.0]");
    parse_robot("pair.toml", &close).unwrap();
}

#[test]
fn parents_exist_come_first_and_make_no_cycle() {
    robot_refused("parent = \"hip\"", "parent = \"spine\"", "no such parent", "knee");
    robot_refused("parent = \"hip\"", "parent = \"knee\"", "own ancestor", "knee");
    robot_refused("name = \"hip\"\n", "name = \"hip\"\nparent = \"knee\"\n", "own ancestor", "hip");
    let later = changed(ROBOT, "parent = \"hip\"\n", "");
    let later = changed(&later, "name = \"hip\"\n", "name = \"hip\"\nparent = \"knee\"\n");
    refused(parse_robot("pair.toml", &later), "later in the file", "hip");
}

#[test]
fn a_setup_names_registers_of_its_servo_and_values_they_accept() {
    robot_refused("\"Operating Mode\" = 3", "\"Operation Mode\" = 3", "no register", "setup");
    robot_refused("\"Operating Mode\" = 3", "\"Operating Mode\" = 17", "accept", "Operating Mode");
    robot_refused("\"Operating Mode\" = 3", "\"Shutdown\" = -1", "accept", "Shutdown");
    robot_refused("joints = [\"knee\"]", "joints = [\"ankle\"]", "no joint of this name", "setup");
    robot_refused("firmware = 45", "firmware = 44", "firmware", "setup");
    robot_refused("[[setup]]\nservo = \"xl430-w250\"", "[[setup]]\nservo = \"x\"", "no valid", "x");
}

#[test]
fn the_line_speed_is_in_the_servos_table_and_in_the_setup() {
    robot_refused("baud_bps = 1000000", "baud_bps = 250000", "cannot run", "line \"leg\"");
    robot_refused("baud_bps = 1000000", "baud_bps = 57600", "baud register", "line \"leg\"");
}

#[test]
fn limits_must_lie_within_the_counts_the_servo_can_be_sent_to() {
    // Half a turn up from 2048 is count 4096, one more than the encoder has.
    robot_refused("upper_rad = 1.0", "upper_rad = 3.14159265", "cannot reach", "hip\", upper_rad");
    let one_count_less = changed(ROBOT, "upper_rad = 1.0", "upper_rad = 3.1400");
    parse_robot("pair.toml", &one_count_less).unwrap();
    // The knee's register limit is 3000: (3000 - 2048) x pi / 2048 = 1.4604 rad of the servo. Its
    // direction is -1 and its offset 0.25 rad, so the joint can go down to -1.7104 rad.
    robot_refused("lower_rad = -1.4", "lower_rad = -1.712", "cannot reach", "knee\", lower_rad");
    parse_robot("pair.toml", &changed(ROBOT, "lower_rad = -1.4", "lower_rad = -1.71")).unwrap();
    robot_refused("offset_rad = 0.25", "offset_rad = -0.1", "cannot reach", "knee\", lower_rad");
    let many_turns = changed(ROBOT, "\"Operating Mode\" = 3", "\"Operating Mode\" = 4");
    let many_turns = changed(&many_turns, "upper_rad = 1.0", "upper_rad = 20.0");
    parse_robot("pair.toml", &many_turns).unwrap();
}

#[test]
fn anatomy_speaks_of_known_joints_and_of_each_segment_once() {
    robot_refused("n_pose_rad = { hip", "n_pose_rad = { hop", "no such joint", "n_pose_rad");
    robot_refused("joint = \"knee\"", "joint = \"ankle\"", "no such joint", "LeftShank");
    robot_refused("\"left_shank\"", "\"left_thigh\"", "played twice", "LeftThigh");
    robot_refused("\"left_shank\"", "\"pelvis\"", "played twice", "Pelvis");
    robot_refused("[\"pelvis\"]", "[\"pelvis\", \"pelvis\"]", "played twice", "anatomy.base");
    robot_refused("[\"pelvis\"]", "[\"head\"]", "base cannot play", "anatomy.base");
    robot_refused("\"left_shank\"", "\"tail\"", "form", "line");
}

#[test]
fn texts_that_a_reader_needs_are_not_empty() {
    robot_refused(
        "acceleration_source = \"assumed: a fixture\"",
        "acceleration_source = \"\"",
        "must not be empty",
        "acceleration_source",
    );
    robot_refused("description = \"two joints\"", "description = \" \"", "empty", "description");
    servo_refused("maker = \"Nobody\"", "maker = \"\"", "empty", "maker");
}

// What a robot file need not say.

const ARM: &str = r#"
schema = 1
name = "my-arm"

[[line]]
name = "arm"
baud_bps = 1000000

[[joint]]
name = "shoulder"
line = "arm"
id = 1
servo = "xm430-w350"
lower_rad = 0.25
upper_rad = 1.5
velocity_rad_s = 2.0
acceleration_rad_s2 = 10.0
"#;

#[test]
fn an_arm_needs_lines_and_joints_and_a_name_that_is_not_its_files() {
    let arm = parse_robot("whatever.toml", ARM).expect("an arm");
    let joint = &arm.joints[0];
    assert_eq!((arm.name.as_str(), arm.rate_hz), ("my-arm", 50.0));
    assert_eq!((joint.direction, joint.offset_rad, joint.gear), (1, 0.0, 1.0));
    let near_zero = 0.25 + 0.01 * 1.25;
    assert!((joint.initial_rad() - near_zero).abs() < 1e-12, "just inside, towards zero");
    assert!(arm.anatomy.is_none() && joint.mounting().is_none());
    // What the file does not tell is told to be not known.
    let unsaid: Vec<_> = arm.unconfirmed().into_iter().map(|fact| fact.place).collect();
    assert_eq!(unsaid, ["source"]);
    assert!(arm.acceleration_source.starts_with("assumed: "));
}

#[test]
fn a_servo_without_a_setup_is_as_it_left_the_factory_at_the_speed_of_its_line() {
    let arm = parse_robot("my-arm.toml", ARM).expect("an arm");
    let (firmware, registers) = arm.setup_for(&arm.joints[0]);
    let servo = servo("xm430-w350").expect("shipped");
    assert_eq!(firmware, servo.firmware.max.unwrap_or(servo.firmware.min));
    // XM430-W350, baud rate (8): 3 is 1 Mbit/s.
    assert_eq!(registers.into_iter().collect::<Vec<_>>(), [("Baud Rate".to_owned(), 3)]);
    // The second setup of the fixture is for the knee alone.
    let text = changed(ROBOT, "# for both", "joints = [\"knee\"]");
    let pair = parse_robot("pair.toml", &text).expect("a robot");
    let (_, hip) = pair.setup_for(&pair.joints[0]);
    assert_eq!(hip.into_iter().collect::<Vec<_>>(), [("Baud Rate".to_owned(), 3)]);
}

#[test]
fn who_follows_a_body_says_where_every_joint_sits_and_nobody_says_half_of_it() {
    let bare = changed(ROBOT, "origin_m = [0.0, 0.0, -0.1]\naxis = [0.0, 1.0, 0.0]\n", "");
    refused(parse_robot("pair.toml", &bare), "follows a body", "knee");
    let origin = changed(ARM, "id = 1\n", "id = 1\norigin_m = [0.0, 0.0, 0.0]\n");
    let refusal = parse_robot("my-arm.toml", &origin).expect_err("half");
    assert_eq!(refusal.got.as_deref(), Some("origin_m without axis"));
    let axis = changed(ARM, "id = 1\n", "id = 1\naxis = [0.0, 0.0, 1.0]\n");
    refused(parse_robot("my-arm.toml", &axis), "go together", "shoulder");
}

// All at once.

fn places(error: &ProfileError) -> Vec<String> {
    let all = std::iter::once(error).chain(&error.also);
    all.map(|one| one.place.as_deref().unwrap_or_default().to_owned()).collect()
}

#[test]
fn everything_that_is_wrong_with_a_robot_is_told_at_once() {
    let text = changed(ROBOT, "rate_hz = 100.0", "rate_hz = 5.0");
    let text = changed(&text, "upper_rad = 1.0", "upper_rad = -1.5");
    let text = changed(&text, "direction = -1", "direction = 3");
    let text = changed(&text, "\"Operating Mode\" = 3", "\"Operating Mode\" = 17");
    let text = changed(&text, "joint = \"knee\"", "joint = \"ankle\"");
    let error = parse_robot("pair.toml", &text).expect_err("five faults");
    let expected = [
        "rate_hz",
        "setup of \"xl430-w250\", Operating Mode",
        "joint \"hip\"",
        "joint \"knee\"",
        "anatomy.segment LeftShank",
    ];
    assert_eq!(places(&error), expected, "{error}");
    assert_eq!(error.to_string().matches("file     pair.toml").count(), 5);
}

#[test]
fn keys_that_are_missing_unknown_or_of_another_kind_are_told_at_once_with_their_lines() {
    let text = changed(ROBOT, "baud_bps = 1000000", "baud_bps = \"fast\"");
    let text = changed(&text, "upper_rad = 1.0", "uper_rad = 1.0");
    let text = changed(&text, "id = 2", "id = 2.5");
    let text = changed(&text, "base = [\"pelvis\"]\n", "");
    let error = parse_robot("pair.toml", &text).expect_err("five faults");
    let line = |of: &str| 1 + text.lines().position(|line| line.starts_with(of)).expect("a line");
    let header = |name: &str| line(&format!("name = {name:?}")) - 1;
    let expected = [
        format!("line {}, line \"leg\"", line("baud_bps = \"fast\"")),
        format!("line {}, joint \"hip\"", header("hip")),
        format!("line {}, joint \"hip\"", line("uper_rad")),
        format!("line {}, joint \"knee\"", line("id = 2.5")),
        format!("line {}", line("[anatomy]")),
    ];
    assert_eq!(places(&error), expected, "{error}");
    for words in [
        "there is no key `uper_rad`; did you mean `upper_rad`?",
        "the key `upper_rad` is missing",
        "the key `base` is missing",
    ] {
        assert!(error.to_string().contains(words), "{error}");
    }
}

#[test]
fn a_servo_too_is_told_all_its_registers_faults_at_once() {
    let text = changed(SERVO, "model = ", "model = \"\" # ");
    let text = changed(&text, "[motor]", "[motor]\nsomething = 1");
    let error = parse_servo("tiny.toml", &text).expect_err("a fault of form");
    assert!(error.to_string().contains("there is no key `something`"), "{error}");
    let text = changed(SERVO, "encoding = \"u16\"", "encoding = \"u8\"");
    let text = changed(&text, "maker = \"Nobody\"", "maker = \"\"");
    let error = parse_servo("tiny.toml", &text).expect_err("two faults");
    assert_eq!(error.also.len(), 1, "{error}");
}

#[test]
fn a_file_of_nothing_but_faults_is_told_of_some_and_ends() {
    let joint = "[[joint]]\nname = 1\nbad = 2\n";
    let text = format!("schema = 1\nname = \"many\"\n{}", joint.repeat(300));
    let error = parse_robot("many.toml", &text).expect_err("faults");
    // What is the same of all joints is told once, with where it is; of what differs there are some.
    assert!((2..=50).contains(&error.also.len()), "{} more", error.also.len());
    let (head, joint) = ARM.split_at(ARM.find("[[joint]]").expect("a joint"));
    let joint = |at: usize| {
        let named = joint.replace("\"shoulder\"", &format!("\"j{at}\""));
        named.replace("id = 1", &format!("id = {}", at + 1)).replace("xm430-w350", "none")
    };
    let text: String = std::iter::once(head.to_owned()).chain((0..200).map(joint)).collect();
    let error = parse_robot("my-arm.toml", &text).expect_err("no servo");
    let place = error.place.expect("where");
    assert!(place.starts_with("joint \"j0\"; joint \"j1\""), "{place}");
    assert!(place.ends_with("; and 192 more"), "{place}");
    // However long names are, and however many faults share theirs.
    let long = text.replace("name = \"j", &format!("name = \"{}", "x".repeat(20_000)));
    let error = parse_robot("my-arm.toml", &long).expect_err("no servo");
    assert!(error.to_string().len() < 200_000, "{}", error.to_string().len());
    let long = "x".repeat(500_000);
    let text = changed(ARM, "\"shoulder\"", &format!("\"{long}!\""));
    let error = parse_robot("my-arm.toml", &text).expect_err("a name");
    assert!(error.to_string().len() < 1_600_000, "{}", error.to_string().len());
}

// Adapters.

#[test]
fn adapters_have_proper_ids_and_a_latency() {
    for bad in ["0403:601", "0403-6014", "0403:601G", "0403:ABCD", ":", "04036014", "0403:60145"] {
        let text = changed(ADAPTER, "0403:6014", bad);
        refused(parse_adapter("cable.toml", &text), "not a USB id", "usb_ids");
    }
    let twice = changed(ADAPTER, "\"0403:6014\"", "\"0403:6014\", \"0403:6014\"");
    refused(parse_adapter("cable.toml", &twice), "USB id twice", "usb_ids");
    for bad in ["nan", "-0.001", "inf"] {
        let text = changed(ADAPTER, "latency_s = 0.001", &format!("latency_s = {bad}"));
        refused(parse_adapter("cable.toml", &text), "latency", "latency_s");
    }
}

// Finding and reading files.

fn temporary(name: &str) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("validator");
    fs::create_dir_all(&folder).unwrap();
    folder.join(name)
}

#[test]
fn a_robot_is_found_by_name_or_read_from_a_path() {
    assert_eq!(robot("op3").unwrap().name, "op3");
    let path = temporary("pair.toml");
    fs::write(&path, ROBOT).unwrap();
    assert_eq!(robot(path.to_str().unwrap()).unwrap().joints.len(), 2);
}

#[test]
fn an_unknown_name_lists_what_there_is_and_no_name_is_a_path() {
    for name in ["op4", "../robots/op3", "/etc/passwd", "op3\0", "", "OP3"] {
        let error = robot(name).unwrap_err();
        let allowed = error.allowed.as_deref().unwrap_or_default();
        assert!(
            allowed.starts_with("berkeley-humanoid-lite, hope-jr-arm, hope-jr-hand, koch"),
            "{error}"
        );
        assert!(servo(name).unwrap_err().allowed.unwrap().contains("xm430-w350"));
    }
}

#[test]
fn files_that_are_missing_too_long_no_text_or_no_files_are_refused() {
    assert!(robot("/nowhere/pair.toml").unwrap_err().what.contains("cannot be read"));
    let long = temporary("long.toml");
    fs::write(&long, "#".repeat(2 * 1024 * 1024)).unwrap();
    let error = robot(long.to_str().unwrap()).unwrap_err();
    assert!(error.allowed.unwrap().contains(&MAX_FILE_BYTES.to_string()));
    let binary = temporary("binary.toml");
    fs::write(&binary, b"schema = 1\n\xff\xfe").unwrap();
    assert_eq!(robot(binary.to_str().unwrap()).unwrap_err().place.as_deref(), Some("byte 11"));
    let folder = temporary("folder.toml");
    fs::create_dir_all(&folder).unwrap();
    assert!(robot(folder.to_str().unwrap()).unwrap_err().what.contains("not a regular file"));
}

#[test]
fn an_error_reads_as_rows_of_what_where_got_and_allowed() {
    let text = changed(ROBOT, "id = 2", "id = 253");
    let error = parse_robot("pair.toml", &text).unwrap_err();
    assert_eq!(
        error.to_string(),
        "the protocol has no such ID\n  file     pair.toml\n  where    joint \"knee\"\n  \
         got      253\n  allowed  0..252"
    );
}

#[test]
fn a_joint_faster_than_its_servo_is_refused() {
    let what = "faster than its servo";
    robot_refused("velocity_rad_s = 4.0", "velocity_rad_s = 6.0", what, "joint");
}

#[test]
fn a_rate_nobody_can_drive_is_refused() {
    for rate in ["19.9", "1001.0", "5e3", "0.0", "nan"] {
        let to = format!("rate_hz = {rate}");
        robot_refused("rate_hz = 100.0", &to, "driven at this rate", "rate_hz");
    }
}

#[test]
fn a_setup_that_would_write_a_goal_or_torque_is_refused() {
    for register in ["Goal Position", "Torque Enable"] {
        let to = format!("[setup.registers]\n\"{register}\" = 1");
        robot_refused("[setup.registers]", &to, "goals and torque are not set up", register);
    }
}

// Files written as another servo plus what differs.

const EXTENDED: &str = r#"
extends = "xl430-w250"
without = ["fast_sync_read_from_firmware"]
name = "mine"
model = "Mine"
model_number = 4711

[[register]]
name = "Model Number"
initial = 4711
source = "its label"

[[register]]
name = "Backup Ready"
remove = true

[[register]]
name = "Lamp"
address = 66
bytes = 1
encoding = "u8"
region = "ram"
access = "rw"
source = "its label"

[[register]]
name = "Indirect Data"
first = 29
initial = 7
source = "its label"
"#;

#[test]
fn an_extended_servo_is_its_base_with_the_changes_laid_over() {
    let base = servo("xl430-w250").unwrap();
    let mine = parse_servo("mine.toml", EXTENDED).unwrap();
    assert_eq!((mine.model.as_str(), mine.maker.as_str()), ("Mine", "ROBOTIS"));
    assert_eq!((mine.model_number, mine.fast_sync_read_from_firmware), (4711, None));
    assert_eq!(mine.baud.len(), base.baud.len());
    assert_eq!(mine.registers.len(), base.registers.len(), "one less, one more");
    assert!(mine.register_named("Backup Ready").is_none());
    let lamp = mine.registers.iter().position(|register| register.name == "Lamp").unwrap();
    assert_eq!(mine.registers[lamp - 1].name, "LED", "registers stand in order of address");
    // Of two blocks with one name the number of the first item tells which is meant.
    assert_eq!(mine.register_named("Indirect Data 28").unwrap().initial(), Some(0));
    assert_eq!(mine.register_named("Indirect Data 29").unwrap().initial(), Some(7));
    let model = mine.register_named("Model Number").unwrap().register;
    assert_eq!((model.address, model.source.as_str()), (0, "its label"));
    let position = mine.register_named("Goal Position").unwrap().register;
    assert!(position.source.contains("XL430-W250"), "an untouched register keeps its source");
}

#[test]
fn an_extended_servo_must_be_right_as_a_whole() {
    let wrong = |from: &str, to: &str, what: &str, place: &str| {
        refused(parse_servo("mine.toml", &changed(EXTENDED, from, to)), what, place);
    };
    wrong("xl430-w250", "xl431", "no shipped servo", "extends");
    wrong("\"xl430-w250\"", "4", "no shipped servo", "extends");
    wrong("fast_sync_read_from_firmware", "secret", "no such key", "without");
    wrong("[\"fast_sync_read_from_firmware\"]", "\"backup\"", "a list of keys", "without");
    let one = "extends = \"xl430-w250\"\nname = \"mine\"\n[register]\nname = \"ID\"\ninitial = 2\n";
    refused(parse_servo("mine.toml", one), "[[register]]", "register");
    wrong("name = \"Backup Ready\"", "name = \"Backup\"", "of the base", "Backup");
    wrong("remove = true", "remove = false", "of the base", "Backup Ready");
    wrong("first = 29", "first = 28", "form", "");
    wrong("name = \"Lamp\"", "name = \"Model Number\"", "changed twice", "Model Number");
    wrong("address = 66", "address = 65", "overlap", "Lamp");
    wrong("initial = 4711", "initial = 4712", "twice, differently", "model_number");
    wrong("initial = 4711\nsource = \"its label\"", "initial = 4711", "where it is written", "");
    wrong("initial = 7", "inital = 7", "form", "");
    let text = changed(EXTENDED, "[[register]]", "[[registers]]");
    assert!(parse_servo("mine.toml", &text).unwrap_err().to_string().contains("registers"));
    for end in 0..EXTENDED.len() {
        let _ = parse_servo("mine.toml", &EXTENDED[..end]);
    }
}

#[test]
fn a_table_with_a_torque_limit_needs_no_profile_but_a_speed() {
    let xl320 = include_str!("../servos/robotis/xl320.toml");
    let text = changed(xl320, "role = \"goal_velocity\"\n", "");
    refused(parse_servo("xl320.toml", &text), "missing", "register");
}

#[test]
fn instructions_are_claimed_only_where_the_protocol_has_them() {
    let claim =
        |key: &str, text: &str| changed(text, "firmware = {", &format!("{key}\nfirmware = {{"));
    let text = claim("bulk_read = true", SERVO);
    refused(parse_servo("tiny.toml", &text), "knows no such", "bulk_read");
    let feetech = include_str!("../servos/feetech/sts3215.toml");
    for key in ["fast_sync_read_from_firmware", "clear_from_firmware", "backup_from_firmware"] {
        let text = claim(&format!("{key} = 42"), feetech);
        refused(parse_servo("sts3215.toml", &text), "knows no such", key);
        parse_servo("tiny.toml", &claim(&format!("{key} = 42"), SERVO)).unwrap();
    }
}

// Operating modes.

#[test]
fn the_modes_of_a_servo_are_distinct_and_fit_its_register() {
    servo_refused("value = 4", "value = 3", "operating mode twice", "operating_mode");
    servo_refused("value = 4", "value = 17", "cannot ask", "operating_mode");
    servo_refused("mode = \"position\"", "mode = \"pwm\"", "not all listed", "operating_mode");
    let first = "min = 0\nmax = 16\n";
    let factory = format!("{first}initial = 5\n");
    servo_refused(first, &factory, "not all listed", "operating_mode");
    servo_refused("mode = \"position\"", "mode = \"hover\"", "form", "line");
    let scs = include_str!("../servos/feetech/scs15.toml");
    let listed = "[[operating_mode]]\nvalue = 0\nmode = \"position\"\n\n[[error_bit]]";
    let text = changed(scs, "[[error_bit]]", listed);
    refused(parse_servo("scs15.toml", &text), "no register chooses", "operating_mode");
}

// Two joints in one case, lines of several families, profiles of any kind.

#[test]
fn joints_that_share_a_case_name_each_other() {
    let shared = |hip: &str, knee: &str| {
        let text = changed(ROBOT, "name = \"hip\"\n", &format!("name = \"hip\"\n{hip}"));
        changed(&text, "name = \"knee\"\n", &format!("name = \"knee\"\n{knee}"))
    };
    let (to_knee, to_hip) = ("shares_case_with = \"knee\"\n", "shares_case_with = \"hip\"\n");
    parse_robot("pair.toml", &shared(to_knee, to_hip)).unwrap();
    let what = "cannot share a case";
    refused(parse_robot("pair.toml", &shared(to_knee, "")), what, "hip");
    refused(parse_robot("pair.toml", &shared(to_hip, "")), what, "hip");
    refused(parse_robot("pair.toml", &shared("shares_case_with = \"toe\"\n", "")), what, "hip");
}

#[test]
fn a_profile_of_any_kind_is_found_by_name_or_read_from_a_path() {
    assert!(matches!(profile("op3"), Ok(Profile::Robot(robot)) if robot.name == "op3"));
    assert!(matches!(profile("ax-12a"), Ok(Profile::Servo(servo)) if servo.model_number == 12));
    assert!(matches!(profile("u2d2"), Ok(Profile::Adapter(adapter)) if !adapter.echo));
    for (name, text) in [("pair.toml", ROBOT), ("mine.toml", EXTENDED), ("cable.toml", ADAPTER)] {
        let path = temporary(name);
        fs::write(&path, text).unwrap();
        profile(path.to_str().unwrap()).unwrap();
    }
    let error = profile("ax-12b").unwrap_err();
    let allowed = error.allowed.as_deref().unwrap_or_default();
    assert!(allowed.contains("ax-12a") && allowed.contains("op3") && allowed.contains("u2d2"));
}

// A board in the base, and how a robot balances.

#[track_caller]
fn op3_refused(from: &str, to: &str, what: &str, place: &str) {
    let text = gaitway_profiles::robot_text("op3").unwrap();
    refused(parse_robot("op3.toml", &changed(&text, from, to)), what, place);
}

#[test]
fn a_board_in_the_base_hangs_on_a_line_that_is_there_at_its_speed_with_an_id_of_its_own() {
    let imu = "[body.imu]\nline = \"body\"";
    op3_refused(imu, "[body.imu]\nline = \"head\"", "no serial line", "body, imu, line");
    op3_refused("id = 200", "id = 7", "the same ID", "body, imu, id");
    op3_refused("id = 200", "id = 254", "nobody's ID", "body, imu, id");
    op3_refused("\"opencr-op3\"", "\"opencr\"", "cannot be used", "body, imu, board");
    let slow = "baud_bps = 2000000";
    let text = gaitway_profiles::robot_text("op3").unwrap();
    let text =
        changed(&changed(&text, slow, "baud_bps = 10500000"), "\"Baud Rate\" = 4", "\"LED\" = 0");
    let error = parse_robot("op3.toml", &text).unwrap_err().to_string();
    assert!(error.contains("does not know its line's speed"), "{error}");
}

#[test]
fn axes_of_a_sensor_are_three_different_ones_and_right_handed() {
    let axes = "axes = [\"-x\", \"-y\", \"z\"]";
    let what = "no axes that a sensor can be turned to";
    for wrong in ["\"x\", \"-y\", \"z\"", "\"x\", \"x\", \"z\"", "\"y\", \"x\", \"z\""] {
        op3_refused(axes, &format!("axes = [{wrong}]"), what, "body, imu, axes");
    }
    for right in ["\"y\", \"-x\", \"z\"", "\"z\", \"x\", \"y\"", "\"x\", \"-y\", \"-z\""] {
        let text = gaitway_profiles::robot_text("op3").unwrap();
        parse_robot("op3.toml", &changed(&text, axes, &format!("axes = [{right}]"))).unwrap();
    }
}

#[test]
fn balance_takes_little_of_joints_that_are_there_and_needs_somebody_who_feels() {
    let of = |key: &str| format!("body, balance, {key}");
    op3_refused("most_rad = 0.15", "most_rad = 0.5", "so much", &of("most_rad"));
    op3_refused("most_rad = 0.15", "most_rad = nan", "so much", &of("most_rad"));
    op3_refused("limit_share = 0.3", "limit_share = 0.6", "so much", &of("limit_share"));
    op3_refused("tilt_time_s = 1.0", "tilt_time_s = 0", "above zero", &of("tilt_time_s"));
    op3_refused("{ joint = \"r_ank_pitch\"", "{ joint = \"r_toe\"", "no such joint", &of("joint"));
    op3_refused("{ joint = \"r_ank_pitch\"", "{ joint = \"l_ank_pitch\"", "twice", &of("joint"));
    op3_refused("pitch = 0.15", "pitch = 9.0", "so much", &of("joint"));
    let text = gaitway_profiles::robot_text("op3").unwrap();
    let (begin, end) = (text.find("[body.imu]").unwrap(), text.find("[body.balance]").unwrap());
    let blind = format!("{}{}", &text[..begin], &text[end..]);
    refused(parse_robot("op3.toml", &blind), "without a sensor", "body, balance");
}

#[test]
fn servos_of_a_body_give_way_by_numbers_that_something_can_have_each_joint_by_its_own() {
    let text = gaitway_profiles::robot_text("toddlerbot").unwrap();
    let refuse = |from: &str, to: &str, what: &str, place: &str| {
        refused(parse_robot("toddlerbot.toml", &changed(&text, from, to)), what, place);
    };
    let of = |key: &str| format!("body, servos, {key}");
    refuse("friction_nm = 0.292", "friction_nm = -0.1", "does not push itself", &of("friction_nm"));
    let first = |key: &str| of(&format!("other 1, {key}"));
    let neck = "joints = [\"neck_yaw\"]\nstiffness_nm_rad = 14.1797";
    let with = |joints: &str| format!("joints = [{joints}]\nstiffness_nm_rad = 14.1797");
    refuse(neck, &with(""), "names no joint", &first("joints"));
    refuse(neck, &with("\"tail\""), "no such joint", &first("joints"));
    refuse(neck, &with("\"neck_yaw\", \"neck_yaw\""), "named twice", &first("joints"));
    refuse(neck, &with("\"neck_pitch\""), "named twice", &of("other 2, joints"));
    refuse(
        "stiffness_nm_rad = 14.1797",
        "stiffness_nm_rad = 0",
        "above zero",
        &first("stiffness_nm_rad"),
    );
    for (from, to, what) in [
        ("friction_nm = 0.0154\n", "friction_n = 0.0154\n", "friction_n"),
        ("damping_nm_s_rad = 0.16214\n", "", "damping_nm_s_rad"),
        ("damping_nm_s_rad = 0.12\n", "", "damping_nm_s_rad"),
        ("torque_nm = 1.089", "torque_nm = \"much\"", "much"),
    ] {
        let error = parse_robot("toddlerbot.toml", &changed(&text, from, to)).expect_err(to);
        assert!(error.to_string().contains(what), "{what}: {error}");
    }
    let servos = parse_robot("toddlerbot.toml", &text).unwrap().body.unwrap().servos.unwrap();
    let [knee, neck, hand] =
        ["left_knee", "neck_yaw", "left_wrist_roll"].map(|name| servos.of(name));
    assert_eq!((knee.stiffness_nm_rad, knee.friction_nm), (21.0938, 0.134));
    assert_eq!((neck.stiffness_nm_rad, neck.torque_nm), (14.1797, 1.089));
    assert_eq!(hand, servos.usual);
}

#[test]
fn a_board_says_where_six_signed_words_stand_and_speaks_dynamixel_2() {
    let board = include_str!("../boards/opencr-op3.toml");
    let refuse = |from: &str, to: &str, what: &str, place: &str| {
        refused(parse_board("opencr-op3.toml", &changed(board, from, to)), what, place);
    };
    parse_board("opencr-op3.toml", board).unwrap();
    refuse("gyroscope = 32", "gyroscope = 30", "three signed words", "imu, gyroscope");
    refuse("accelerometer = 38", "accelerometer = 46", "three signed words", "imu, accelerometer");
    refuse(
        "gyroscope_deg_s = 0.06",
        "gyroscope_deg_s = -0.06",
        "above zero",
        "imu, gyroscope_deg_s",
    );
    refuse("\"dynamixel-2.0\"", "\"dynamixel-1.0\"", "not known", "protocol");
    refuse("role = \"id\"\n", "", "must have is missing", "register");
    refuse("address = 34", "address = 33", "overlap", "Gyro Y");
    for end in 0..board.len() {
        let _ = parse_board("opencr-op3.toml", &board[..end]);
    }
}
