//! What capturing costs and how well it orients.
//!
//! - per format, the share of one core that 15 sensors at 200 Hz take: decoding alone, and from bytes
//!   to fused samples; then the whole `gaitway record` over pseudo-terminals (`capture/record.rs`);
//! - the orientation filter beside the C++ package of its authors and x-io Fusion, each built from the
//!   sources of its Python package and called once per sample on the same samples in the same run;
//! - their errors on the recordings under `GAITWAY_CAPTURES/imu`, if there are any.
//!
//! Run: `cargo bench --bench capture`. Without Python, PyPI or a C++ compiler the others' rows are left
//! out, and it says so.

#[path = "../tests/orientation/mod.rs"]
mod orientation;
#[path = "capture/record.rs"]
mod record;
#[path = "capture/theirs.rs"]
mod theirs;

use gaitway::capture::{Chain, Mode, Orientation};
use gaitway::device::sensor::stream_format;
use gaitway::time::Instant;
use gaitway::wire::sensor::Stream;
use gaitway_sim::imu::{BodyMotion, ImuErrors, ImuWire, Mount, VirtualImu};
use glam::{DQuat, DVec3};
use orientation::{
    BROAD_PERIOD_S, JOINT_PERIOD_S, broad_rmse_deg, floats, joint_rmse_deg, table, vector,
};
use std::hint::black_box;
use std::path::PathBuf;
use std::time::Instant as Clock;
use theirs::{FILTERS, Sample, Theirs};

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
    println!("15 sensors at 200 Hz: ns per sample and share of one core");
    println!("  {:<24} {:>18} {:>22}", "", "decoding alone", "to fused samples");
    for (name, wire) in [
        ("witmotion-wt901", ImuWire::WitMotion),
        ("bno08x-rvc", ImuWire::Bno08xRvc),
        ("xsens-mti", ImuWire::Xsens),
        ("vectornav-vn100", ImuWire::VectorNavBinary),
        ("vectornav-vn100-ascii", ImuWire::VectorNavAscii),
        ("x-imu3", ImuWire::XImu3),
        ("mpu6050-teapot", ImuWire::Teapot),
        ("arduino-csv", ImuWire::Csv),
        ("nmea-imu", ImuWire::Nmea),
        ("cobs-imu", ImuWire::Cobs),
        ("slip-imu", ImuWire::Slip),
    ] {
        let mut sensor = gaitway_profiles::sensor(name).expect("shipped");
        sensor.rate_hz = RATE_HZ;
        let imu = VirtualImu::new(motion(), Mount::default(), errors(), wire, RATE_HZ);
        let sent: Vec<_> = imu.expect("a sensor").collect();
        let format = stream_format(&sensor).expect("columns").expect("a stream");
        let decoding_s = least_s(|| {
            let mut stream = Stream::new(format.clone());
            for one in &sent {
                stream.push(&one.bytes, |reading| {
                    black_box(reading);
                });
            }
        });
        let chain_s = least_s(|| {
            let mut stream = Stream::new(format.clone());
            let mut chain = Chain::new(&sensor, Mode::SixAxes);
            for one in &sent {
                let arrival = Instant::from_nanos((one.due_s * 1e9) as u64);
                stream.push(&one.bytes, |reading| {
                    black_box(chain.take(&reading, arrival));
                });
            }
        });
        let [decoding, chain] = [decoding_s, chain_s].map(|seconds| {
            let each_s = seconds / sent.len() as f64;
            format!("{:>8.0} ns {:>7.3} %", each_s * 1e9, each_s * SENSORS * RATE_HZ * 100.0)
        });
        println!("  {name:<24} {decoding:>20} {chain:>22}");
    }
}

fn filters(theirs: Option<&Theirs>) {
    let imu = VirtualImu::new(motion(), Mount::default(), errors(), ImuWire::Csv, RATE_HZ);
    let field = DVec3::new(0.0, 20e-6, -44e-6);
    let samples: Vec<Sample> = imu
        .expect("a sensor")
        .map(|sent| {
            let [rate, force] = [sent.truth.rate_rad_s, sent.truth.specific_force_m_s2];
            (DVec3::from_array(rate), DVec3::from_array(force), Some(field))
        })
        .collect();
    println!("\none fused sample, ns (ratio to ours)");
    for (axes, mode) in [("six axes", Mode::SixAxes), ("nine axes", Mode::NineAxes)] {
        let nine = mode == Mode::NineAxes;
        let seconds = least_s(|| {
            let mut filter = Orientation::new(1.0 / RATE_HZ, mode);
            for (rate, force, field) in &samples {
                let field = field.filter(|_| nine);
                black_box(filter.take(1.0 / RATE_HZ, Some(*rate), Some(*force), field));
            }
        });
        let ours_ns = seconds / samples.len() as f64 * 1e9;
        print!("  {axes:<10} ours {ours_ns:.0}");
        for (filter, name) in FILTERS {
            match theirs.map(|theirs| theirs.run(filter, nine, RATE_HZ, &samples)) {
                Some(Ok((ns, _))) => print!(", {name} {ns:.0} ({:.2})", ns / ours_ns),
                Some(Err(cause)) => print!(", {name}: {cause}"),
                None => {}
            }
        }
        println!();
    }
}

/// RMSE on BROAD: total, heading and inclination.
fn broad(folder: &std::path::Path, theirs: Option<&Theirs>) {
    for (name, file, nine) in [
        ("BROAD 21, nine axes", "21_undisturbed_fast_combined_full.f32", true),
        ("BROAD 21, six axes", "21_undisturbed_fast_combined_full.f32", false),
        ("BROAD 28 (magnet), nine axes", "28_disturbed_stationary_magnet_A_60s.f32", true),
        ("BROAD 28 (magnet), six axes", "28_disturbed_stationary_magnet_A_60s.f32", false),
    ] {
        let rows = floats(&folder.join("broad").join(file), 14);
        let mode = if nine { Mode::NineAxes } else { Mode::SixAxes };
        let mut filter = Orientation::new(BROAD_PERIOD_S, mode);
        let ours = broad_rmse_deg(&rows, nine, |rate, force, field| {
            let fused = filter.take(BROAD_PERIOD_S, Some(rate), Some(force), field);
            fused.map_or(DQuat::NAN, |fused| fused.orientation)
        });
        print!("  {name:<30} ours {ours:.2?}");
        let sample = |row: &Vec<f64>| {
            let field = Some(vector(row, 6)).filter(|v| v.is_finite());
            (vector(row, 0), vector(row, 3), field)
        };
        let samples: Vec<Sample> = rows.iter().map(sample).collect();
        for (filter, name) in FILTERS {
            let ran = theirs.map(|theirs| theirs.run(filter, nine, 1.0 / BROAD_PERIOD_S, &samples));
            if let Some(Ok((_, orientations))) = ran {
                let mut orientations = orientations.into_iter();
                let next = |_, _, _| orientations.next().unwrap_or(DQuat::NAN);
                print!(", {name} {:.2?}", broad_rmse_deg(&rows, nine, next));
            }
        }
        println!();
    }
}

/// RMSE of the relative orientation of two segments.
fn joints(folder: &std::path::Path, theirs: Option<&Theirs>) {
    for file in ["data_1D_03.csv", "data_2D_02.csv", "data_3D_02.csv"] {
        let rows = table(&folder.join("weygers_kok_2imu").join(file));
        let mut filters = [0, 1].map(|_| Orientation::new(JOINT_PERIOD_S, Mode::SixAxes));
        let ours = joint_rmse_deg(&rows, |sensor, rate, force| {
            let fused = filters[sensor].take(JOINT_PERIOD_S, Some(rate), Some(force), None);
            fused.map_or(DQuat::NAN, |fused| fused.orientation)
        });
        print!("  {file:<30} ours {ours:.2}");
        for (filter, name) in FILTERS {
            let run = |sensor: usize| {
                let sample =
                    |row: &Vec<f64>| (vector(row, 6 * sensor + 3), vector(row, 6 * sensor), None);
                let samples: Vec<Sample> = rows.iter().map(sample).collect();
                theirs?.run(filter, false, 1.0 / JOINT_PERIOD_S, &samples).ok()
            };
            if let Some(((_, one), (_, two))) = run(0).zip(run(1)) {
                let mut both = [one.into_iter(), two.into_iter()];
                let next = |sensor: usize, _, _| both[sensor].next().unwrap_or(DQuat::NAN);
                print!(", {name} {:.2}", joint_rmse_deg(&rows, next));
            }
        }
        println!();
    }
}

fn main() {
    let theirs = Theirs::build();
    if let Err(cause) = &theirs {
        println!("nobody else's filters: {cause}");
    }
    let theirs = theirs.ok();
    formats();
    filters(theirs.as_ref());
    let captures = std::env::var_os("GAITWAY_CAPTURES").map(PathBuf::from);
    match captures.map(|folder| folder.join("imu")).filter(|folder| folder.is_dir()) {
        Some(folder) => {
            println!("\nRMSE against optical truth, degrees (total, heading, inclination)");
            broad(&folder, theirs.as_ref());
            joints(&folder, theirs.as_ref());
        }
        None => println!("\nno imu under GAITWAY_CAPTURES: no errors against truth"),
    }
    record::over_terminals();
}
