//! Virtual inertial sensors: what they measure is what the motion does, and nothing else.

use gaitway_sim::imu::{
    AROUND, BodyMotion, Disturbance, GRAVITY_M_S2, ImuDoor, ImuError, ImuErrors, ImuMotion,
    ImuWire, MadeMotion, MakesPoses, Measured, Mount, SegmentAt, Stage, VirtualImu,
};

use std::sync::Arc;

fn near(found: [f64; 3], expected: [f64; 3], tolerance: f64) {
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() <= tolerance, "{found} is not {expected}");
    }
}

/// A segment on a turntable: radius 0.5 m, 2 rad/s about the vertical, its X axis outwards.
fn turntable() -> BodyMotion {
    let (rate_hz, radius_m, speed_rad_s) = (100.0, 0.5, 2.0);
    let angles: Vec<f64> = (0..=400).map(|n| f64::from(n) / rate_hz * speed_rad_s).collect();
    let positions: Vec<_> =
        angles.iter().map(|a| [radius_m * a.cos(), radius_m * a.sin(), 1.0]).collect();
    let orientations: Vec<_> =
        angles.iter().map(|a| [(a / 2.0).cos(), 0.0, 0.0, (a / 2.0).sin()]).collect();
    BodyMotion::new(rate_hz, &positions, &orientations).expect("a motion")
}

/// On a circle the acceleration is v^2/r towards the middle; mounted 0.2 m further in, less.
#[test]
fn a_turntable_gives_its_rate_gravity_and_the_centripetal_acceleration() {
    let motion = turntable();
    let at = motion.at(2.0, &Mount::default());
    near(at.rate_rad_s, [0.0, 0.0, 2.0], 1e-4);
    near(at.specific_force_m_s2, [-2.0, 0.0, GRAVITY_M_S2], 1e-3);
    let inner = Mount { offset_m: [-0.2, 0.0, 0.0], ..Mount::default() };
    near(motion.at(2.0, &inner).specific_force_m_s2, [-0.3 * 4.0, 0.0, GRAVITY_M_S2], 1e-3);
    // Turned on its segment by 90 degrees about X: the sensor's Y axis points up.
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let turned = Mount { orientation: [half, half, 0.0, 0.0], ..Mount::default() };
    let at = motion.at(2.0, &turned);
    near(at.rate_rad_s, [0.0, 2.0, 0.0], 1e-4);
    near(at.specific_force_m_s2, [-2.0, GRAVITY_M_S2, 0.0], 1e-3);
}

/// A swing that speeds up and slows down: the tangential part is angular acceleration times radius.
#[test]
fn a_swing_accelerates_what_hangs_on_it() {
    let rate_hz = 200.0;
    let angle = |t: f64| 0.5 * (3.0 * t).sin();
    let orientations: Vec<_> = (0..=800)
        .map(|n| angle(f64::from(n) / rate_hz))
        .map(|a| [(a / 2.0).cos(), 0.0, 0.0, (a / 2.0).sin()])
        .collect();
    let motion =
        BodyMotion::new(rate_hz, &vec![[0.0; 3]; orientations.len()], &orientations).expect("one");
    let mount = Mount { offset_m: [0.4, 0.0, 0.0], ..Mount::default() };
    for t in [1.0_f64, 1.3, 2.1] {
        let (rate, change) = (1.5 * (3.0 * t).cos(), -4.5 * (3.0 * t).sin());
        let at = motion.at(t, &mount);
        near(at.rate_rad_s, [0.0, 0.0, rate], 1e-3);
        let expected = [-0.4 * rate * rate, 0.4 * change, GRAVITY_M_S2];
        near(at.specific_force_m_s2, expected, 5e-3);
    }
}

fn samples(errors: ImuErrors, wire: ImuWire) -> Vec<gaitway_sim::imu::Sent> {
    VirtualImu::new(turntable(), Mount::default(), errors, wire, 100.0).expect("one").collect()
}

#[test]
fn samples_come_by_the_sensors_own_clock_and_in_batches() {
    let errors = ImuErrors {
        clock_skew: 100e-6,
        batch_s: 0.016,
        latency_s: 0.002,
        jitter_s: 0.001,
        ..ImuErrors::default()
    };
    let sent = samples(errors, ImuWire::Csv);
    assert!((sent[100].taken_s - 1.0001).abs() < 1e-12);
    for pair in sent.windows(2) {
        assert!(pair[1].due_s >= pair[0].due_s);
    }
    for one in &sent {
        let batches = one.due_s / 0.016;
        assert!((batches - batches.round()).abs() < 1e-6 && one.due_s >= one.taken_s + 0.002);
    }
}

#[test]
fn the_same_seed_gives_the_same_bytes_and_loses_what_it_says() {
    let errors = |seed| ImuErrors {
        rate_noise_rad_s: 0.01,
        acceleration_noise_m_s2: 0.05,
        loss: 0.2,
        seed,
        ..ImuErrors::default()
    };
    let one = samples(errors(1), ImuWire::Xsens);
    assert_eq!(one, samples(errors(1), ImuWire::Xsens));
    assert_ne!(one, samples(errors(2), ImuWire::Xsens));
    let lost = one.iter().filter(|sent| sent.bytes.is_empty()).count();
    assert!((40..120).contains(&lost), "{lost} of 401");
}

#[test]
fn a_disturbed_field_is_disturbed_for_its_time_only() {
    let errors = ImuErrors {
        disturbances: vec![Disturbance { from_s: 1.0, to_s: 2.0, field_t: [30e-6, 0.0, 0.0] }],
        ..ImuErrors::default()
    };
    // The field is in the lines of VNQMR, cells 5 to 7, in gauss; its length does not turn.
    let strength = |sent: &gaitway_sim::imu::Sent| {
        let text = String::from_utf8(sent.bytes.clone()).expect("text");
        let cells: Vec<f64> =
            text.split(',').skip(5).take(3).map(|c| c.parse().expect("number")).collect();
        cells.iter().map(|c| c * c).sum::<f64>().sqrt()
    };
    let sent = samples(errors, ImuWire::VectorNavAscii);
    let quiet = (0.20_f64.powi(2) + 0.44_f64.powi(2)).sqrt();
    assert!((strength(&sent[50]) - quiet).abs() < 1e-3);
    assert!((strength(&sent[250]) - quiet).abs() < 1e-3);
    let loud = (0.30_f64.powi(2) + 0.20_f64.powi(2) + 0.44_f64.powi(2)).sqrt();
    assert!((strength(&sent[150]) - loud).abs() < 1e-3);
}

#[test]
fn what_makes_no_motion_is_refused() {
    let one = [[0.0; 3]];
    assert!(matches!(BodyMotion::new(100.0, &one, &[]), Err(ImuError::Poses { .. })));
    let (two, nan) = ([[0.0; 3]; 2], [[f64::NAN, 0.0, 0.0, 0.0]; 2]);
    assert!(matches!(BodyMotion::new(100.0, &two, &nan), Err(ImuError::Number(_))));
    assert!(matches!(BodyMotion::still(-1.0), Err(ImuError::Number(_))));
}

/// BNO080 data sheet, section 1.3.5.2: index 222, yaw 0.01, pitch -1.10, roll 20.85 degrees,
/// -371, -20, 977 mg; the reserved bytes are zero.
#[test]
fn the_report_of_the_data_sheet_is_built() {
    let [yaw, pitch, roll] = [0.01_f64, -1.10, 20.85].map(|a| a.to_radians() / 2.0);
    let (cy, sy, cp, sp, cr, sr) =
        (yaw.cos(), yaw.sin(), pitch.cos(), pitch.sin(), roll.cos(), roll.sin());
    let measured = Measured {
        rate_rad_s: [0.0; 3],
        specific_force_m_s2: [-0.371, -0.020, 0.977].map(|g| g * GRAVITY_M_S2),
        linear_acceleration_m_s2: [0.0; 3],
        field_t: [0.0; 3],
        orientation: [
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ],
        number: 222,
        device_s: 0.0,
    };
    assert_eq!(
        ImuWire::Bno08xRvc.encode(&measured),
        [
            0xAA, 0xAA, 0xDE, 0x01, 0x00, 0x92, 0xFF, 0x25, 0x08, 0x8D, 0xFE, 0xEC, 0xFF, 0xD1,
            0x03, 0x00, 0x00, 0x00, 0xE7
        ]
    );
}

/// Two sensors of one body, opened 0.3 s apart: what they say was taken at the same time of its motion.
#[test]
fn sensors_of_one_body_share_the_time_of_its_motion_and_begin_again_when_all_were_closed() {
    use std::io::Read;
    let stage = Stage::default();
    let door = || {
        let motion = BodyMotion::still(0.5).expect("a motion");
        let errors = ImuErrors::default();
        let imu = VirtualImu::new(motion, Mount::default(), errors, ImuWire::Csv, 100.0);
        let imu = imu.expect("a sensor").then_still();
        ImuDoor::open_on(&stage, imu, 115_200, None).expect("a terminal")
    };
    let doors = [door(), door()];
    let first_tick = |port: &mut std::fs::File| -> u64 {
        let mut bytes = Vec::new();
        while !bytes.contains(&b',') {
            let mut buffer = [0; 64];
            let count = port.read(&mut buffer).expect("bytes");
            bytes.extend(&buffer[..count]);
        }
        let text = String::from_utf8_lossy(&bytes).into_owned();
        text.split(',').next().and_then(|ticks| ticks.parse().ok()).expect("microseconds")
    };
    assert_eq!(stage.began(), None);
    for round in 0..2 {
        let open = |door: &ImuDoor| std::fs::File::open(door.path()).expect("opens");
        let mut one = open(&doors[0]);
        assert!(first_tick(&mut one) < 200_000, "from the start, round {round}");
        std::thread::sleep(std::time::Duration::from_millis(300));
        let mut other = open(&doors[1]);
        let ticks = first_tick(&mut other);
        let passed = stage.began().expect("somebody listens").elapsed();
        // The host may have stalled since, but the motion had gone on before.
        assert!(ticks >= 290_000 && u128::from(ticks) <= passed.as_micros(), "{ticks}");
        drop((one, other));
        while stage.began().is_some() {
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
    }
}

#[test]
fn a_sensor_that_stays_goes_on_after_the_motion_and_a_heading_drifts_as_it_is_told() {
    let motion = BodyMotion::still(0.5).expect("a motion");
    let errors = ImuErrors { heading_drift_rad_s: 0.01, ..ImuErrors::default() };
    let imu = VirtualImu::new(motion, Mount::default(), errors, ImuWire::Teapot, 100.0);
    let sent: Vec<_> = imu.expect("a sensor").then_still().take(3001).collect();
    let last = &sent[3000];
    assert!((last.taken_s - 30.0).abs() < 1e-9);
    assert!((last.truth.specific_force_m_s2[2] - 9.80665).abs() < 1e-9);
    // The quaternion of a packet: four words from the third byte on, 16384 per unit.
    let word = |at: usize| f64::from(i16::from_be_bytes([last.bytes[at], last.bytes[at + 1]]));
    let heading = 2.0 * word(8).atan2(word(2));
    assert!((heading - 0.3).abs() < 1e-3, "{heading}");
}

/// Poses of the swing of a pendulum that is carried along, told when they are asked for.
struct Told {
    asked: std::sync::Mutex<u64>,
}

fn swung(number: u64) -> SegmentAt {
    let t = number as f64 / 120.0;
    let turned = 0.8 * (4.0 * t).sin();
    SegmentAt {
        position_m: [0.3 * t, 0.2 * (3.0 * t).cos(), 1.0 + 0.05 * (7.0 * t).sin()],
        orientation: [(turned / 2.0).cos(), 0.0, (turned / 2.0).sin(), 0.0],
    }
}

impl MakesPoses for Told {
    fn poses(&self, from: u64, into: &mut [SegmentAt]) {
        let mut asked = self.asked.lock().expect("nobody fell");
        *asked = (*asked).max(from + into.len() as u64);
        for (number, place) in (from..).zip(into) {
            *place = swung(number);
        }
    }
}

#[test]
fn a_motion_that_is_made_as_it_goes_is_felt_as_the_same_one_made_beforehand() {
    let told = Arc::new(Told { asked: std::sync::Mutex::new(0) });
    let made = MadeMotion::new(120.0, Arc::clone(&told) as Arc<dyn MakesPoses>).expect("a motion");
    let all: Vec<SegmentAt> = (0..=1200).map(swung).collect();
    let positions: Vec<_> = all.iter().map(|at| at.position_m).collect();
    let orientations: Vec<_> = all.iter().map(|at| at.orientation).collect();
    let before = BodyMotion::new(120.0, &positions, &orientations).expect("a motion");
    let mount = Mount { offset_m: [0.0, 0.1, -0.2], orientation: [0.6, 0.0, 0.0, 0.8] };
    // The end of what was made beforehand is an end; the other has none.
    for n in 0..1800 {
        let time_s = f64::from(n) / 200.0 + 0.0013;
        let (one, other) = (made.at(time_s, &mount), before.at(time_s, &mount));
        near(one.rate_rad_s, other.rate_rad_s, 1e-6);
        near(one.specific_force_m_s2, other.specific_force_m_s2, 1e-4);
        near(one.position_m, other.position_m, 1e-8);
        let along: f64 = one.orientation.iter().zip(other.orientation).map(|(a, b)| a * b).sum();
        assert!(along.abs() > 1.0 - 1e-12, "{along}");
        // No further ahead than it says: what is asked of the body now is soon felt.
        let ahead = *told.asked.lock().expect("nobody fell") as f64 - time_s * 120.0;
        assert!(ahead <= AROUND as f64 + 2.0, "{ahead} poses ahead");
    }
}

#[test]
fn sensors_feel_the_same_motion_as_it_is_made_as_they_play_beforehand_and_it_has_no_end() {
    let told = Arc::new(Told { asked: std::sync::Mutex::new(0) });
    let made = MadeMotion::new(120.0, told as Arc<dyn MakesPoses>).expect("a motion");
    let all: Vec<SegmentAt> = (0..=1200).map(swung).collect();
    let positions: Vec<_> = all.iter().map(|at| at.position_m).collect();
    let orientations: Vec<_> = all.iter().map(|at| at.orientation).collect();
    let before = BodyMotion::new(120.0, &positions, &orientations).expect("a motion");
    let errors = ImuErrors { rate_noise_rad_s: 0.01, loss: 0.1, seed: 5, ..ImuErrors::default() };
    let on = |motion: ImuMotion| {
        let mount = Mount::default();
        VirtualImu::new(motion, mount, errors.clone(), ImuWire::Csv, 100.0).expect("a sensor")
    };
    let bytes =
        |imu: VirtualImu| -> Vec<Vec<u8>> { imu.take(900).map(|sent| sent.bytes).collect() };
    let (one, other) = (bytes(on(made.clone().into())), bytes(on(before.into())));
    let same = one.iter().zip(&other).filter(|(one, other)| one == other).count();
    // Figures are rounded for the line; a few may round the other way.
    assert!(same >= 895, "{same} of 900 samples are the same");
    assert_eq!(on(made.into()).take(5000).count(), 5000);
    let refused = MadeMotion::new(0.0, Arc::new(Told { asked: Default::default() }));
    assert_eq!(refused.err(), Some(ImuError::Number("the rate of the poses")));
}

#[test]
fn a_stage_that_lasts_goes_on_when_nobody_listens() {
    let began = Stage::lasting().began();
    assert!(began.is_some());
    let stage = Stage::lasting();
    let motion = BodyMotion::still(600.0).expect("a motion");
    let errors = ImuErrors::default();
    let imu = VirtualImu::new(motion, Mount::default(), errors, ImuWire::Csv, 100.0).expect("one");
    let since = stage.began();
    let door = ImuDoor::open_on(&stage, imu, 115_200, None).expect("a door");
    let path = door.path().to_owned();
    let mut first_ticks = Vec::new();
    for _ in 0..2 {
        let file = std::fs::File::open(&path).expect("its terminal");
        let mut lines = std::io::BufReader::new(file);
        let (mut line, mut whole) = (String::new(), String::new());
        // The first line may have begun before it was listened to.
        std::io::BufRead::read_line(&mut lines, &mut line).expect("a line");
        std::io::BufRead::read_line(&mut lines, &mut whole).expect("a line");
        let tick = whole.split(',').next().and_then(|tick| tick.trim().parse::<f64>().ok());
        first_ticks.push(tick.unwrap_or_else(|| panic!("{whole:?}")));
        drop(lines);
        std::thread::sleep(std::time::Duration::from_millis(300));
    }
    assert_eq!(stage.began(), since);
    assert!(first_ticks[1] > first_ticks[0], "it went on: {first_ticks:?}");
}
