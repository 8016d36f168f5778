//! Published packets of inertial sensors, and what their makers say they mean.
//!
//! Each vector names its source. Those marked "built" were put together by hand from the layout in
//! the maker's manual, sums computed apart; the others are printed there.

use gaitway::wire::sensor::{Column, Format, Lines, Reading, Stream, World, framing, slimevr};

fn hex(text: &str) -> Vec<u8> {
    text.split_whitespace().map(|byte| u8::from_str_radix(byte, 16).expect("hex")).collect()
}

fn read(format: Format, bytes: &[u8]) -> Vec<Reading> {
    let mut stream = Stream::new(format);
    let mut readings = Vec::new();
    stream.push(bytes, |reading| readings.push(reading));
    readings
}

fn one(format: Format, bytes: &[u8]) -> Reading {
    let readings = read(format, bytes);
    assert_eq!(readings.len(), 1, "{readings:?}");
    readings[0]
}

fn columns(text: &str) -> Vec<Column> {
    text.split(' ').map(|name| name.parse().expect("a column")).collect()
}

fn near<const N: usize>(found: Option<[f64; N]>, expected: [f64; N], tolerance: f64) {
    let found = found.expect("it is there");
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() <= tolerance, "{found} is not {expected}");
    }
}

/// Built from "WIT Standard Protocol": full scale 16 g, 2000 deg/s, 180 deg over 32768.
#[test]
fn witmotion_packets_mean_what_the_manual_says() {
    let packet = |text| one(Format::WitMotion, &hex(text));
    let gravity = packet("55 51 00 00 00 00 00 08 C4 09 7B");
    near(gravity.acceleration.map(|a| a.map(|c| c / 32768.0 * 16.0)), [0.0, 0.0, 1.0], 0.0);
    assert_eq!(gravity.temperature.map(|c| c / 100.0), Some(25.0));
    let turning = packet("55 52 9A F9 00 00 66 06 C4 09 73");
    let rate = turning.angular_rate.map(|g| g.map(|c| c / 32768.0 * 2000.0));
    near(rate, [-99.98, 0.0, 99.98], 0.01);
    let angle = packet("55 53 00 40 00 E0 FF 7F 00 00 46").euler;
    near(angle.map(|e| e.map(|c| c / 32768.0 * 180.0)), [90.0, -45.0, 179.99], 0.01);
    let half = packet("55 59 00 40 00 40 00 40 00 40 AE").quaternion;
    near(half.map(|q| q.map(|c| c / 32768.0)), [0.5; 4], 0.0);
    let one = packet("55 59 FF 7F 00 00 00 00 00 00 2C").quaternion;
    near(one.map(|q| q.map(|c| c / 32768.0)), [1.0, 0.0, 0.0, 0.0], 1e-4);
}

/// Printed in the manual of the Bluetooth models: magnetic field 360, 105, 122.
#[test]
fn witmotion_over_bluetooth_answers_a_register_read() {
    let mut bytes = hex("55 71 3A 00 68 01 69 00 7A 00");
    bytes.resize(20, 0);
    near(one(Format::WitMotionBle, &bytes).magnetic_field, [360.0, 105.0, 122.0], 0.0);
}

/// Printed in the BNO080 data sheet, section 1.3.5.2: index 222, yaw 0.01, pitch -1.10, roll 20.85
/// degrees, acceleration -371, -20, 977 mg.
#[test]
fn the_rvc_report_of_the_data_sheet_is_read() {
    let bytes = hex("AA AA DE 01 00 92 FF 25 08 8D FE EC FF D1 03 00 00 00 E7");
    let reading = one(Format::Bno08xRvc, &bytes);
    assert_eq!(reading.counter, Some(222));
    near(reading.euler, [2085.0, -110.0, 1.0], 0.0);
    near(reading.acceleration, [-371.0, -20.0, 977.0], 0.0);
}

/// Payload of an MTi in the tests of a public C driver for Xsens MTi; frame and sum built.
#[test]
fn an_xsens_message_is_read_item_by_item() {
    let bytes = hex(
        "FA FF 36 26 10 20 02 46 82 10 60 04 01 C4 FC 3E 20 10 10 3F 71 CE 6C BE A5 6B CF 3C 61 \
         3B D8 BD 69 1D 25 E0 20 04 00 40 00 03 12",
    );
    let reading = one(Format::Xsens, &bytes);
    assert_eq!((reading.counter, reading.ticks), (Some(18_050), Some(29_686_846)));
    near(reading.quaternion, [0.944_556, -0.323_088, 0.013_747, -0.056_913], 1e-6);
    assert_eq!(reading.world, Some(World::EastNorthUp));
}

/// Printed in the Xsens manual: the messages that start and stop a measurement. Their sums hold,
/// and they carry nothing.
#[test]
fn xsens_control_messages_are_whole_and_empty() {
    for text in ["FA FF 30 00 D1", "FA FF 10 00 F1"] {
        assert_eq!(one(Format::Xsens, &hex(text)), Reading::default());
    }
}

/// Built from "MT Low Level Communication Protocol": -1.5 as fp12.20, fp16.32 and f64, in a world
/// of north, east, down.
#[test]
fn xsens_numbers_are_read_in_every_format() {
    let formats = [
        (0x45, "FF E8 00 00"),
        (0x46, "80 00 00 00 FF FE"),
        (0x47, "BF F8 00 00 00 00 00 00"),
        (0x44, "BF C0 00 00"),
    ];
    for (low, number) in formats {
        let number = hex(number);
        let mut item = vec![0x20, 0x10 | low & 0xF, 4 * number.len() as u8];
        item.extend(number.repeat(4));
        let mut bytes = vec![0xFA, 0xFF, 0x36, item.len() as u8];
        bytes.extend(&item);
        bytes.push(bytes[1..].iter().fold(0_u8, |sum, byte| sum.wrapping_sub(*byte)));
        let reading = one(Format::Xsens, &bytes);
        near(reading.quaternion, [-1.5; 4], 0.0);
        assert_eq!(reading.world, Some(World::NorthEastDown));
    }
}

/// Example of the VectorNav C library and its manual.
#[test]
fn a_vectornav_binary_message_is_read() {
    let bytes =
        hex("FA 01 09 00 70 05 00 03 0A 00 00 00 48 0E 2C 42 08 4C 37 C1 10 38 8B C2 D4 CB");
    let reading = one(Format::VectorNavBinary, &bytes);
    assert_eq!(reading.ticks, Some(43_000_006_000));
    near(reading.euler, [-69.60950, -11.45606, 43.01395], 1e-5);
}

/// Lines of the VectorNav manual and library.
#[test]
fn vectornav_lines_are_read_and_false_ones_refused() {
    let line = b"$VNYMR,+100.949,-007.330,+000.715,-00.0049,-00.2449,+00.5397,-01.258,-00.100,\
                 -09.701,-00.000018,+00.001122,-00.000551*69\r\n";
    let reading = one(Format::VectorNavAscii, line);
    near(reading.euler, [0.715, -7.33, 100.949], 0.0);
    near(reading.magnetic_field, [-0.0049, -0.2449, 0.5397], 0.0);
    near(reading.acceleration, [-1.258, -0.1, -9.701], 0.0);
    near(reading.angular_rate, [-0.000_018, 0.001_122, -0.000_551], 0.0);
    // An error and an answer are whole, and no samples.
    for line in ["$VNERR,12*72\r\n", "$VNRRG,11*73\r\n"] {
        assert_eq!(one(Format::VectorNavAscii, line.as_bytes()), Reading::default());
    }
    // A public repository prints this with a sum of 4C; the exclusive or is 5C.
    assert!(read(Format::VectorNavAscii, b"$VNRRG,07,40*4C\r\n").is_empty());
    assert!(!read(Format::VectorNavAscii, b"$VNRRG,07,40*5C\r\n").is_empty());
}

/// Printed in the x-IMU3 user manual: one second, one g on z; and a line of Euler angles.
#[test]
fn x_imu3_messages_are_read_in_both_forms() {
    let mut bytes = hex("C9 40 42 0F 00 00 00 00 00");
    bytes.extend([0; 20]);
    bytes.extend(hex("00 00 80 3F 0A"));
    let reading = one(Format::XImu3, &bytes);
    assert_eq!(reading.ticks, Some(1_000_000));
    near(reading.angular_rate, [0.0; 3], 0.0);
    near(reading.acceleration, [0.0, 0.0, 1.0], 0.0);
    let line = one(Format::XImu3, b"A,1000000,0.0000,0.0000,0.0000\r\n");
    assert_eq!(line.ticks, Some(1_000_000));
    near(line.euler, [0.0; 3], 0.0);
}

/// Built from the sketch MPU6050_DMP6: counts of 16384.
#[test]
fn a_teapot_packet_is_read() {
    let reading = one(Format::Teapot, &hex("24 02 2D 41 00 00 2D 41 00 00 00 07 0D 0A"));
    let quaternion = reading.quaternion.map(|q| q.map(|c| c / 16384.0));
    near(quaternion, [0.70709, 0.0, 0.70709, 0.0], 1e-5);
    assert_eq!(reading.counter, Some(7));
}

#[test]
fn lines_are_read_in_the_columns_that_were_declared() {
    let format = |prefix: &str, check| {
        Format::Lines(Lines {
            prefix: prefix.to_owned(),
            check,
            columns: columns("ticks ax ay az -"),
        })
    };
    let lines = b"# ticks,ax,ay,az,note\n12,0.5,-1,9.81,3\n13 0.5 -1 9.81 3\r\n\n14;1;2;3;4\n";
    let ticks: Vec<_> = read(format("", false), lines).iter().map(|r| r.ticks).collect();
    assert_eq!(ticks, [Some(12), Some(13), Some(14)]);
    let labelled = one(format("", false), b"t:7,ax:0.5,ay:-1,az:9.81,x:0\n");
    near(labelled.acceleration, [0.5, -1.0, 9.81], 0.0);
    // Too few, too many, not a number: no reading at all.
    for line in ["1,2,3\n", "1,2,3,4,5,6\n", "1,2,x,4,5\n"] {
        assert!(read(format("", false), line.as_bytes()).is_empty(), "{line}");
    }
    // Not-a-number said by the sensor is a missing acceleration, not a zero.
    assert_eq!(one(format("", false), b"1,nan,2,3,4\n").acceleration, None);
    // With a check, and the same line with one bit of the check wrong.
    let body = "IMU,1,2,3,4,5";
    let check = body.bytes().fold(0, |check, byte| check ^ byte);
    let good = format!("boot\r\n${body}*{check:02x}\r\n${body}*{:02x}\r\n", check ^ 1);
    near(one(format("$IMU", true), good.as_bytes()).acceleration, [2.0, 3.0, 4.0], 0.0);
}

/// Examples of the COBS paper and RFC 1055, built.
#[test]
fn records_are_cut_out_of_cobs_and_slip_streams() {
    for (record, frame) in [("00", "01 01 00"), ("11 22 00 33", "03 11 22 02 33 00"), ("", "01 00")]
    {
        let mut out = Vec::new();
        framing::cobs(&mut out, &hex(record));
        assert_eq!(out, hex(frame));
        assert_eq!(framing::uncobs(&out[..out.len() - 1]), Some(hex(record)));
    }
    let mut out = Vec::new();
    framing::slip(&mut out, &hex("01 C0 02 DB 03"));
    assert_eq!(out, hex("01 DB DC 02 DB DD 03 C0"));
    for length in 0..600 {
        let record: Vec<u8> =
            (0..length).map(|n| (n % 255) as u8 + u8::from(length > 300)).collect();
        let mut out = Vec::new();
        framing::cobs(&mut out, &record);
        assert_eq!(framing::uncobs(&out[..out.len() - 1]), Some(record));
    }
    let records = columns("counter:u16 ax:i16 ay:i16 az:i16");
    let record = hex("07 00 FF FF 00 00 E8 03");
    let (mut cobs, mut slip) = (Vec::new(), Vec::new());
    framing::cobs(&mut cobs, &record);
    framing::slip(&mut slip, &record);
    for (format, bytes) in [(Format::Cobs(records.clone()), cobs), (Format::Slip(records), slip)] {
        let reading = one(format, &bytes);
        assert_eq!(reading.counter, Some(7));
        near(reading.acceleration, [-1.0, 0.0, 1000.0], 0.0);
    }
}

fn messages(text: &str) -> (u64, Vec<slimevr::Message>) {
    let mut found = Vec::new();
    let number = slimevr::decode(&hex(text), |message| found.push(message));
    (number.expect("a whole datagram"), found)
}

/// Built from SlimeVR-Server at 5549763, udp/*.kt.
#[test]
fn slimevr_datagrams_are_read() {
    use slimevr::Message;
    let half = f64::from(std::f32::consts::FRAC_1_SQRT_2);
    let (number, found) = messages(
        "00 00 00 11 00 00 00 00 00 00 00 2A 00 01 00 00 00 00 00 00 00 00 3F 35 04 F3 3F 35 04 \
         F3 03",
    );
    assert_eq!(number, 42);
    assert_eq!(found, [Message::Rotation { sensor: 0, quaternion: [half, 0.0, 0.0, half] }]);

    let (number, found) = messages(
        "00 00 00 17 00 00 00 00 00 00 00 2B 00 00 00 00 00 5A 82 5A 82 00 00 00 00 04 E7",
    );
    assert_eq!(number, 43);
    let [Message::Motion { sensor: 0, quaternion, acceleration }] = found[..] else {
        panic!("{found:?}")
    };
    near(Some(quaternion), [half, 0.0, 0.0, half], 1e-4);
    near(Some(acceleration), [0.0, 0.0, 9.805], 1e-3);

    let (_, found) =
        messages("00 00 00 04 00 00 00 00 00 00 00 2C 00 00 00 00 00 00 00 00 41 1C E8 0A 00");
    let [Message::Acceleration { sensor: 0, acceleration }] = found[..] else {
        panic!("{found:?}")
    };
    near(Some(acceleration), [0.0, 0.0, 9.80665], 1e-5);
}

/// Built from the same source.
#[test]
fn a_slimevr_tracker_is_known_by_its_handshake() {
    let text = "00 00 00 03 00 00 00 00 00 00 00 00 00 00 00 04 00 00 00 04 00 00 00 02 \
                00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 13 05 30 2E 35 2E 34 \
                A0 B1 C2 D3 E4 F5";
    let mac = [0xA0, 0xB1, 0xC2, 0xD3, 0xE4, 0xF5];
    assert_eq!(messages(text).1, [slimevr::Message::Handshake { build: 19, mac }]);
    let reply = slimevr::handshake_reply();
    assert_eq!((reply[0], &reply[1..13]), (3, &b"Hey OVR =D 5"[..]));
    assert!(reply[13..].iter().all(|&byte| byte == 0));
    assert_eq!(slimevr::heartbeat(), [0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0]);
    // The tracker sends a ping back as it is.
    let mut found = Vec::new();
    slimevr::decode(&slimevr::ping(7), |message| found.push(message)).expect("whole");
    assert_eq!(found, [slimevr::Message::Pong(7)]);
}

/// The server reads a number of a sensor, which the firmware leaves at 255, and a signed byte.
#[test]
fn a_tracker_says_how_strongly_it_receives_its_network() {
    let (number, found) = messages("00 00 00 13 00 00 00 00 00 00 00 07 FF C3");
    assert_eq!((number, found), (7, vec![slimevr::Message::Signal(-61)]));
}

#[test]
fn a_bundle_holds_several_packets_and_a_cut_one_is_refused() {
    use slimevr::Message;
    // Battery 4.0 V, 0.5; then an acknowledgement of sensor 1, in both kinds of bundle.
    let long = "00 00 00 64 00 00 00 00 00 00 00 05 00 0C 00 00 00 0C 40 80 00 00 3F 00 00 00 \
                00 06 00 00 00 0F 01 01";
    let short = "00 00 00 65 00 00 00 00 00 00 00 05 09 0C 40 80 00 00 3F 00 00 00 03 0F 01 01";
    for text in [long, short] {
        let (number, found) = messages(text);
        assert_eq!(number, 5);
        let expected = [Message::Battery(4.0, 0.5), Message::SensorInfo { sensor: 1, status: 1 }];
        assert_eq!(found, expected);
        let bytes = hex(text);
        assert!(slimevr::decode(&bytes[..bytes.len() - 1], |_| {}).is_err());
    }
}

/// Built from "Movella DOT BLE Services Specification" (XD0506P rev. C), table 15, Rate quantities: 28 bytes, which are filled up
/// with zeros to the 40 of a medium payload.
#[test]
fn a_record_may_be_followed_by_zeros_and_by_nothing_else() {
    let format = Format::Slip(columns("ticks:u32 ax:f32 ay:f32 az:f32 gx:f32 gy:f32 gz:f32"));
    let mut record = 1_000_000_u32.to_le_bytes().to_vec();
    for value in [0.0_f32, 0.0, 9.8125, 90.0, 0.0, -0.5] {
        record.extend(value.to_le_bytes());
    }
    assert_eq!(record.len(), 28);
    let frame = |record: &[u8]| {
        let mut out = Vec::new();
        framing::slip(&mut out, record);
        out
    };
    let mut filled = record.clone();
    filled.resize(40, 0);
    for record in [&record, &filled] {
        let reading = one(format.clone(), &frame(record));
        assert_eq!(reading.ticks, Some(1_000_000));
        near(reading.acceleration, [0.0, 0.0, 9.8125], 0.0);
        near(reading.angular_rate, [90.0, 0.0, -0.5], 0.0);
    }
    // Extended (Quaternion), say, whose status is not zero.
    filled[33] = 2;
    for record in [&filled[..], &record[..27]] {
        assert!(read(format.clone(), &frame(record)).is_empty(), "{record:?}");
    }
}
