//! What happens during a session, in words.

use crate::body::worn::check::T_POSE_FAIL_RAD;
use crate::cli::cues;
use crate::error::either;
use crate::job::report::counted;
use crate::job::session::{CutShort, Happening, RecordedTrial, TrialFault};
use crate::session::SensorCheck;
use std::fmt::Write;

/// What is said of it.
pub fn of(happening: &Happening<'_>) -> String {
    match *happening {
        Happening::GoingOn(session) => {
            format!("Session {}, begun {}: going on where it was.", session.name, session.begun)
        }
        Happening::NewSession => {
            "Session. Enter alone leaves out what is not needed; q stops at any question."
                .to_owned()
        }
        Happening::Refused(error) | Happening::Unreadable(error) => format!("! {error}"),
        Happening::Measures { subject } => format!(
            "\nSubject {subject}. Measures; Enter alone: not measured; a dot: nothing more is \
             measured. Only the stature is needed."
        ),
        Happening::MeasuringStill { seconds } => format!("measuring for {seconds} s"),
        Happening::SensorChecked(check) => of_sensor(check),
        Happening::Written { file, holds_until } => {
            format!("written: {file}; it holds until {holds_until}")
        }
        Happening::InTPose { worst_rad } => format!(
            "measured error in T pose: at most {:.1} deg ({:.0} allowed)",
            worst_rad.to_degrees(),
            T_POSE_FAIL_RAD.to_degrees()
        ),
        Happening::FacingForward { subject } => format!("subject {subject}:"),
        Happening::NextTrial { number, total, action, subjects, good, wanted } => {
            let mut text = format!(
                "\n[{number}/{total}] {}, {}: {good} of {wanted}\n  {}",
                action.name,
                subjects.join(" and "),
                action.explain,
                wanted = counted(wanted, "good repetition")
            );
            if !action.props.is_empty() {
                let _ = write!(text, "\n  props: {}", action.props);
            }
            text
        }
        Happening::Recording { trial } => format!(
            "RECORDING {trial}. Enter: a good repetition is done; x: a bad one; words: a note; a \
             dot: the end"
        ),
        Happening::Marked { good, bad, time_s } => {
            format!("  {time_s:.1} s: {good} good, {bad} bad")
        }
        Happening::CutShort(CutShort::Disk { cause }) => {
            format!("! it ends here, the disk fails: {cause}")
        }
        Happening::CutShort(CutShort::Sensor { name, why }) => {
            format!("! it ends here, sensor {name} is gone: {why}")
        }
        Happening::NotAllRecorded => {
            "! the disk could not keep up, or failed: not all of it is recorded".to_owned()
        }
        Happening::Unjudged { trial } => {
            format!("\nTrial {trial} was recorded and not judged.")
        }
        Happening::Recorded(trial) => of_trial(trial),
        Happening::Finishing => "\nAll actions are recorded. Joint angles:".to_owned(),
        Happening::Angles { files } => format!("  {}", files.join(", ")),
        Happening::NoAngles { recording, error } => format!("  ! {recording}: {error}"),
        Happening::Sensing(event) => cues::of_event(event),
    }
}

fn of_sensor(sensor: &SensorCheck) -> String {
    let SensorCheck { name, samples, rate_hz, .. } = sensor;
    let mut line = format!(
        "  {name:<16} {}  {samples}, {rate_hz:.1} per second",
        if sensor.passed { "pass  " } else { "REPEAT" },
        samples = counted(*samples, "sample")
    );
    let deg = |rad: f64| rad.to_degrees();
    if let (Some(noise), Some(bias)) = (sensor.noise_rad_s, sensor.bias_rad_s) {
        line += &format!(", noise {:.2} deg/s, bias {:.2} deg/s", deg(noise), deg(bias));
    }
    if let Some(drift) = sensor.heading_drift_rad_s {
        line += &format!(", drift {:+.1} deg/min", deg(drift) * 60.0);
    }
    for why in &sensor.why {
        line += &format!("\n    {why}");
    }
    line
}

/// Each recording with its sensors, then what is wrong, then what tells whether times agree.
fn of_trial(recorded: &RecordedTrial) -> String {
    let mut lines = Vec::new();
    for part in &recorded.parts {
        lines.push(format!("{}: {:.1} s", recorded.trial, part.duration_s));
        let said = part.samples.iter();
        lines.extend(said.map(|(sensor, samples)| {
            format!("  {sensor:<16} {samples}", samples = counted(*samples, "sample"))
        }));
    }
    lines.extend(recorded.faults.iter().map(|fault| format!("  ! {}", of_fault(fault))));
    lines.extend(recorded.taps.iter().map(|tap| format!("  tap {}", tap.words())));
    lines.join("\n")
}

fn of_fault(fault: &TrialFault) -> String {
    match fault {
        TrialFault::CutOff => "it was cut off: its last second may be missing".to_owned(),
        TrialFault::Missing { samples } => format!(
            "{samples} {are} missing",
            samples = counted(samples, "sample"),
            are = either(samples, "is", "are")
        ),
        TrialFault::Unheard { sensor } => format!("{sensor} said nothing in it"),
        TrialFault::Silent { sensor, seconds } => {
            format!("{sensor} is silent for the last {seconds:.1} s")
        }
    }
}
