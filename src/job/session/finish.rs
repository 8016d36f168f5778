//! The end of a session: joint angles of every trial that is kept, and the manifest.

use super::Job;
use super::happening::Happening;
use super::trial::measures;
use crate::body::worn::kept::Kept;
use crate::error::Error;
use crate::recording::sensor_series;
use crate::sensing::{Ended, wall_clock};
use crate::session::angles::{WornMotion, body_of};
use crate::session::files::{BODY_KEY, TrialFile, TrialRecording, Verdict};
use crate::session::manifest::{Manifest, TrialRow};

/// Exports what is missing and writes the manifest: the folder is finished then.
pub(super) fn finish(job: &Job) -> Result<(), Ended> {
    job.operator.hear(Happening::Finishing);
    let rate_hz = job.session()?.plan.rate_hz;
    let mut rows = Vec::new();
    for trial in &job.progress.trials {
        job.check()?;
        let mut row = TrialRow::of(trial);
        if trial.verdict == Verdict::Keep {
            export(job, trial, rate_hz, &mut row);
        }
        rows.push(row);
    }
    let manifest = Manifest::of(job.session()?, &job.progress, rows, wall_clock());
    job.folder.write_new("manifest.toml", &manifest)?;
    Ok(())
}

/// A trial without angles is no reason not to finish: the manifest says why.
fn export(job: &Job, trial: &TrialFile, rate_hz: f64, row: &mut TrialRow) {
    for recording in &trial.recordings {
        match angles(job, recording, rate_hz) {
            Ok((motion, files)) => {
                job.operator.hear(Happening::Angles { files: &files });
                row.add_angles(&motion, files);
            }
            Err(error) => {
                let recording = recording.file.as_str();
                job.operator.hear(Happening::NoAngles { recording, error: &error });
                row.no_angles = Some(error.what);
            }
        }
    }
}

fn angles(
    job: &Job,
    recording: &TrialRecording,
    rate_hz: f64,
) -> Result<(WornMotion, Vec<String>), Error> {
    let series = sensor_series(&job.folder.path(&recording.file))?;
    let metadata = series.start.as_ref().map(|start| &start.metadata);
    let said = |key: &str| metadata.and_then(|metadata| metadata.get(key));
    let text = said(BODY_KEY)
        .ok_or_else(|| Error::new("the recording does not know how its sensors were worn"))?;
    // What was measured wrongly and changed later is right in the subject's file.
    let mut measured = metadata.cloned().unwrap_or_default();
    measured.extend(measures(job, &recording.subject));
    let body = body_of(&measured)?;
    let motion = WornMotion::of(&series, &Kept::parse(text)?, body, rate_hz)?;
    let stem = recording.file.trim_start_matches("trials/").trim_end_matches(".mcap");
    let mut files = Vec::new();
    for (ending, bytes) in [("csv", motion.csv()?), ("bvh", motion.bvh().into_bytes())] {
        let file = format!("angles/{stem}.{ending}");
        // Files appear whole: one that is there was written by a run that did not get further.
        if !job.folder.has(&file) {
            job.folder.write_new_bytes(&file, &bytes)?;
        }
        files.push(file);
    }
    Ok((motion, files))
}
