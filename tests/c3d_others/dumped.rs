//! One C3D file as one reader sees it.

use gaitway::mocap::c3d;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// What a reader found.
pub struct Seen {
    pub frames: usize,
    pub points: usize,
    pub rate_hz: f64,
    pub first: u64,
    pub labels: Vec<String>,
    /// Of every frame every point: x, y, z and residual; none if it was not seen.
    pub samples_of_points: Vec<Option<[f64; 4]>>,
    pub channels: usize,
    pub samples: usize,
    /// Every channel of every sample.
    pub analog: Vec<f64>,
}

pub fn by_us(path: &Path) -> Result<Seen, String> {
    let read = c3d::read(path).map_err(|error| error.to_string())?;
    let head = read.head();
    let points = head.points.len();
    let sample = |at: usize| {
        let sample = read.sample(at / points, at % points)?;
        let [x, y, z] = sample.position.map(f64::from);
        Some([x, y, z, f64::from(sample.residual)])
    };
    let channels = head.analog.channels.len();
    let values = (0..head.frames).flat_map(|frame| {
        let counts = read.analog_counts(frame).iter().enumerate();
        counts.map(|(at, count)| head.analog.channels[at % channels].value(*count))
    });
    Ok(Seen {
        frames: head.frames,
        points,
        rate_hz: head.rate_hz.unwrap_or(0.0),
        first: head.first_frame,
        labels: head.points.iter().map(|point| point.label.clone()).collect(),
        samples_of_points: (0..head.frames * points).map(sample).collect(),
        channels,
        samples: if channels == 0 { 0 } else { head.frames * head.analog.per_frame },
        analog: values.collect(),
    })
}

pub fn by_c3dio(path: &Path) -> Result<Seen, String> {
    let bytes = fs::read(path).map_err(|cause| cause.to_string())?;
    let read = std::panic::catch_unwind(|| {
        c3dio::prelude::C3d::from_bytes(&bytes).map_err(|error| format!("{error:?}"))
    });
    let read = read.map_err(|_| "it panics".to_owned())??;
    let points = &read.points;
    let (rows, columns) = points.points.size();
    let samples_of_points = points.points.iter().map(|point| {
        let [x, y, z] = point.point.map(f64::from);
        (point.residual >= 0.0).then_some([x, y, z, f64::from(point.residual)])
    });
    let analog = &read.analog;
    let (samples, channels) = analog.analog.size();
    Ok(Seen {
        frames: rows,
        points: columns,
        rate_hz: f64::from(points.frame_rate),
        first: points.first_frame.into(),
        labels: points.labels.iter().take(columns).cloned().collect(),
        samples_of_points: samples_of_points.collect(),
        channels,
        samples,
        analog: analog.analog.iter().copied().collect(),
    })
}

/// What the Python packages found in some files.
pub struct Dumped {
    folder: PathBuf,
}

/// Has the Python packages read files, and keeps what they found in a folder.
pub fn dumped(python: &Path, folder: &Path, files: &[PathBuf]) -> Dumped {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/c3d_others/read.py");
    let mut command = Command::new(python);
    let output = command.arg(script).arg(folder).args(files).output().expect("it ran before");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    Dumped { folder: folder.to_owned() }
}

impl Dumped {
    /// What a package found in the file of this number.
    pub fn seen(&self, number: usize, package: &str) -> Result<Seen, String> {
        let bytes = fs::read(self.folder.join(format!("{number}.{package}"))).expect("a dump");
        let end = bytes.iter().position(|byte| *byte == b'\n').expect("a line");
        let head: serde_json::Value = serde_json::from_slice(&bytes[..end]).expect("JSON");
        if let Some(cause) = head["refused"].as_str() {
            return Err(cause.to_owned());
        }
        let count = |name: &str| head[name].as_u64().expect("a count") as usize;
        let (words, rest) = bytes[end + 1..].as_chunks::<8>();
        assert!(rest.is_empty());
        let numbers: Vec<f64> = words.iter().map(|word| f64::from_le_bytes(*word)).collect();
        let (frames, points) = (count("frames"), count("points"));
        let (samples, analog) = numbers.split_at(4 * frames * points);
        let labels = head["labels"].as_array().into_iter().flatten();
        let labels = labels.filter_map(|label| Some(label.as_str()?.trim().to_owned()));
        let sample =
            |sample: &[f64; 4]| (!sample[..3].iter().any(|n| n.is_nan())).then_some(*sample);
        Ok(Seen {
            frames,
            points,
            rate_hz: head["rate_hz"].as_f64().unwrap_or(0.0),
            first: head["first"].as_u64().unwrap_or(0),
            labels: labels.collect(),
            samples_of_points: samples.as_chunks::<4>().0.iter().map(sample).collect(),
            channels: if analog.is_empty() { 0 } else { count("channels") },
            samples: if analog.is_empty() { 0 } else { count("samples") },
            analog: analog.to_vec(),
        })
    }
}
