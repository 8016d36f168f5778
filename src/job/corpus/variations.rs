//! Files of variations, as `synth --variations` writes them, read trial by trial.

use crate::action::parquet::NOTES;
use crate::columnar::{Column, TableReader};
use crate::corpus::tables::{TrialFrames, signal_names};
use crate::error::{Error, ErrorKind};
use crate::job::synth::tables_beside;
use std::path::Path;

/// A variation of an action.
#[derive(Clone, Debug)]
pub struct Variation {
    /// What a learner is to call it.
    pub label: String,
    /// The actions' names.
    pub class: String,
    /// Seed of all of them.
    pub seed: i64,
    /// Which one.
    pub number: i64,
    /// True if its feet hold.
    pub holds: bool,
    /// Stature of its body, m.
    pub stature_m: f64,
    /// Frames per second.
    pub rate_hz: f64,
    /// Its frames.
    pub frames: TrialFrames,
}

/// Reads the variations whose poses are in a file.
///
/// # Errors
/// A file that cannot be read or is none of variations, tables beside it that are not there; what `take` says.
pub fn read(
    poses: &Path,
    mut take: impl FnMut(Variation) -> Result<(), Error>,
) -> Result<(), Error> {
    let wrong = |got: &str| {
        Error::of(ErrorKind::Malformed, "these are no variations of an action")
            .at(poses.display().to_string())
            .got(got)
            .allowed("what `gaitway synth --variations` writes")
    };
    let [_, beside] = tables_beside(poses);
    let (table, rows) = (TableReader::open(poses)?, TableReader::open(&beside)?);
    let notes: serde_json::Value =
        table.note(NOTES).and_then(|text| serde_json::from_str(text).ok()).unwrap_or_default();
    let rate_hz =
        notes["rate_hz"].as_f64().filter(|hz| *hz > 0.0).ok_or_else(|| wrong("no rate"))?;
    let signals = signal_names();
    for group in 0..rows.groups() {
        let column = |name: &str| rows.column(group, name, None);
        let (labels, classes, states) = (column("label")?, column("class")?, column("status")?);
        let (numbers, seeds, statures) =
            (column("variation")?, column("seed")?, column("stature_m")?);
        let (groups, counts) = (column("row_group")?, column("rows")?);
        let mut read: Option<(usize, Vec<Column>, usize)> = None;
        for row in 0..labels.len() {
            let whole = |column: &Column| column.whole(row).and_then(|v| usize::try_from(v).ok());
            let (Some(in_group), Some(count)) = (whole(&groups), whole(&counts)) else {
                return Err(wrong("a row without a place"));
            };
            if read.as_ref().is_none_or(|(known, ..)| *known != in_group) {
                let columns = signals.iter().map(|name| table.column(in_group, name, None));
                read = Some((in_group, columns.collect::<Result<_, _>>()?, 0));
            }
            let Some((_, columns, from)) = &mut read else { continue };
            let range = *from..from.saturating_add(count);
            *from = range.end;
            let signal = |column: &Column| match column {
                Column::Single(all) => all.get(range.clone()).map(<[f32]>::to_vec),
                _ => None,
            };
            let signals = columns.iter().map(signal).collect::<Option<Vec<_>>>();
            take(Variation {
                label: labels.text(row).unwrap_or_default().to_owned(),
                class: classes.text(row).unwrap_or_default().to_owned(),
                seed: seeds.whole(row).unwrap_or(0),
                number: numbers.whole(row).unwrap_or(0),
                holds: states.text(row) != Some("implausible"),
                stature_m: statures.real(row).unwrap_or(0.0),
                rate_hz,
                frames: TrialFrames { signals: signals.ok_or_else(|| wrong("fewer poses"))? },
            })?;
        }
    }
    Ok(())
}
