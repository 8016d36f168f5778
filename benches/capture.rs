//! What capturing costs: the share of one core that 15 sensors at 200 Hz take from bytes to fused
//! samples, per format; and the orientation filter beside the C++ package of its authors (Python wheel
//! `vqf`, `updateBatch`, all outputs) on the same samples in the same run.
//!
//! `GAITWAY_PYTHON` names an interpreter that has `vqf` and `numpy`; without it that line is left out.

use gaitway::capture::{Chain, Mode, Orientation};
use gaitway::device::sensor::stream_format;
use gaitway::time::Instant;
use gaitway::wire::sensor::Stream;
use gaitway_sim::imu::{BodyMotion, ImuErrors, ImuWire, Mount, VirtualImu};
use glam::{DQuat, DVec3};
use std::hint::black_box;
use std::process::Command;
use std::time::Instant as Clock;

const SENSORS: f64 = 15.0;
const RATE_HZ: f64 = 200.0;
const SECONDS: f64 = 60.0;
const ROUNDS: usize = 5;

fn motion() -> BodyMotion {
    let turn = |n: u32| {
        let t = f64::from(n) / 100.0;
        let q = DQuat::from_rotation_z((2.1 * t).sin()) * DQuat::from_rotation_y((1.3 * t).sin());
        [q.w, q.x, q.y, q.z]
    };
    let turns: Vec<_> = (0..=(SECONDS * 100.0) as u32).map(turn).collect();
    BodyMotion::new(100.0, &vec![[0.0; 3]; turns.len()], &turns).expect("a motion")
}

fn errors() -> ImuErrors {
    let (rate_noise_rad_s, acceleration_noise_m_s2) = (0.002, 0.03);
    ImuErrors { rate_noise_rad_s, acceleration_noise_m_s2, ..ImuErrors::default() }
}

/// The least time of a few rounds, s: what the machine does beside only adds.
fn least_s(mut round: impl FnMut()) -> f64 {
    let times = (0..ROUNDS).map(|_| {
        let began = Clock::now();
        round();
        began.elapsed().as_secs_f64()
    });
    times.fold(f64::INFINITY, f64::min)
}

fn formats() {
    println!("bytes to fused samples, 15 sensors at 200 Hz: share of one core");
    for (name, wire) in [
        ("witmotion-wt901", ImuWire::WitMotion),
        ("xsens-mti", ImuWire::Xsens),
        ("vectornav-vn100", ImuWire::VectorNavBinary),
        ("vectornav-vn100-ascii", ImuWire::VectorNavAscii),
        ("x-imu3", ImuWire::XImu3),
        ("arduino-csv", ImuWire::Csv),
        ("cobs-imu", ImuWire::Cobs),
    ] {
        let mut sensor = gaitway_profiles::sensor(name).expect("shipped");
        sensor.rate_hz = RATE_HZ;
        let imu = VirtualImu::new(motion(), Mount::default(), errors(), wire, RATE_HZ);
        let sent: Vec<_> = imu.expect("a sensor").collect();
        let format = stream_format(&sensor).expect("columns").expect("a stream");
        let seconds = least_s(|| {
            let mut stream = Stream::new(format.clone());
            let mut chain = Chain::new(&sensor, Mode::SixAxes);
            for one in &sent {
                let arrival = Instant::from_nanos((one.due_s * 1e9) as u64);
                stream.push(&one.bytes, |reading| {
                    black_box(chain.take(&reading, arrival));
                });
            }
        });
        let per_sample_ns = seconds / sent.len() as f64 * 1e9;
        let share = per_sample_ns * 1e-9 * SENSORS * RATE_HZ;
        println!("  {name:<24} {per_sample_ns:>7.0} ns/sample  {:>6.3} %", share * 100.0);
    }
}

fn filter() {
    let imu = VirtualImu::new(motion(), Mount::default(), errors(), ImuWire::Csv, RATE_HZ);
    let samples: Vec<(DVec3, DVec3)> = imu
        .expect("a sensor")
        .map(|sent| {
            let truth = sent.truth;
            (DVec3::from_array(truth.rate_rad_s), DVec3::from_array(truth.specific_force_m_s2))
        })
        .collect();
    let field = Some(DVec3::new(0.0, 20e-6, -44e-6));
    println!("one fused sample");
    for (mode, field) in [(Mode::SixAxes, None), (Mode::NineAxes, field)] {
        let seconds = least_s(|| {
            let mut filter = Orientation::new(1.0 / RATE_HZ, mode);
            for (rate, force) in &samples {
                black_box(filter.take(1.0 / RATE_HZ, Some(*rate), Some(*force), field));
            }
        });
        println!("  {mode:?}: {:.0} ns", seconds / samples.len() as f64 * 1e9);
    }
    let Some(python) = std::env::var_os("GAITWAY_PYTHON") else {
        println!("  C++ VQF: left out, GAITWAY_PYTHON is not set");
        return;
    };
    let numbers = samples.iter().flat_map(|(rate, force)| [rate.to_array(), force.to_array()]);
    let bytes: Vec<u8> = numbers.flatten().flat_map(f64::to_le_bytes).collect();
    let file = std::env::temp_dir().join(format!("gaitway-bench-{}.f64", std::process::id()));
    std::fs::write(&file, bytes).expect("a temporary file");
    let program = include_str!("capture/vqf_batch.py");
    let run = Command::new(python).args(["-c", program]).arg(&file).output().expect("Python");
    let _ = std::fs::remove_file(&file);
    print!("{}{}", String::from_utf8_lossy(&run.stdout), String::from_utf8_lossy(&run.stderr));
}

fn main() {
    formats();
    filter();
}
