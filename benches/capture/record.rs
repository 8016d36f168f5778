//! `gaitway record` on fifteen sensors behind pseudo-terminals at 200 Hz, in real time: what share of
//! one core the recording process takes. The sensors run in this process; what the kernel spends on
//! moving a pseudo-terminal's bytes between the two is in neither figure.

use super::{RATE_HZ, SENSORS, errors, motion};
use gaitway_sim::imu::{ImuDoor, ImuWire, Mount, VirtualImu};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Between the two readings of the process's time.
const MEASURED: Duration = Duration::from_secs(10);

pub fn over_terminals() {
    println!("\n`gaitway record` of 15 sensors at 200 Hz over pseudo-terminals: share of one core");
    for (profile, wire) in [
        ("xsens-mti", ImuWire::Xsens),
        ("vectornav-vn100", ImuWire::VectorNavBinary),
        ("arduino-csv", ImuWire::Csv),
    ] {
        match share(profile, wire) {
            Ok((share, said)) => println!("  {profile:<24} {:>6.2} %  {said}", share * 100.0),
            Err(cause) => println!("  {profile:<24} {cause}"),
        }
    }
}

/// The share, and what was recorded.
fn share(profile: &str, wire: ImuWire) -> Result<(f64, String), String> {
    let doors = (0..SENSORS as u32).map(|_| {
        let imu = VirtualImu::new(motion(), Mount::default(), errors(), wire, RATE_HZ);
        ImuDoor::open(imu.expect("a sensor"), 115_200, None).map_err(|e| e.to_string())
    });
    let doors: Vec<ImuDoor> = doors.collect::<Result<_, _>>()?;
    let file = std::env::temp_dir().join(format!("gaitway-bench-{}.mcap", std::process::id()));
    let sources = doors
        .iter()
        .enumerate()
        .map(|(n, door)| format!("imu{n}=imu:{profile}@{}", door.path().display()));
    let child = Command::new(env!("CARGO_BIN_EXE_gaitway"))
        .args(["record", "--force", "--json", "--for", "13s", "-o"])
        .arg(&file)
        .args(sources)
        .stdout(Stdio::piped())
        .spawn()
        .map_err(|e| e.to_string())?;
    let process = child.id();
    std::thread::sleep(Duration::from_secs(2));
    let (began, before_s) = (Instant::now(), processor_s(process)?);
    std::thread::sleep(MEASURED);
    let (took_s, after_s) = (began.elapsed().as_secs_f64(), processor_s(process)?);
    let output = child.wait_with_output().map_err(|e| e.to_string())?;
    let bytes = std::fs::metadata(&file).map_or(0, |metadata| metadata.len());
    let _ = std::fs::remove_file(&file);
    let report: serde_json::Value =
        serde_json::from_slice(&output.stdout).map_err(|e| e.to_string())?;
    let count = |key: &str| -> u64 {
        let sources = report["sources"].as_array().into_iter().flatten();
        sources.filter_map(|source| source["counts"][key].as_u64()).sum()
    };
    let said = format!(
        "{} samples, {} missing, {} dropped, {:.1} MB",
        count("samples"),
        count("missed"),
        report["dropped"],
        bytes as f64 / 1e6
    );
    Ok(((after_s - before_s) / took_s, said))
}

/// Processor time of a process so far, user and system (proc(5), `stat`: the clock ticks 100 times a
/// second on Linux), s.
fn processor_s(process: u32) -> Result<f64, String> {
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat"));
    let stat = stat.map_err(|e| e.to_string())?;
    // The name may hold spaces; what follows it does not.
    let numbers = stat.rsplit(')').next().unwrap_or_default().split_whitespace().skip(11);
    let ticks: Vec<f64> = numbers.take(2).filter_map(|number| number.parse().ok()).collect();
    Ok(ticks.iter().sum::<f64>() / 100.0)
}
