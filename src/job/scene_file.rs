//! What a file shows, as a scene for other people's viewers; a robot as a model for them.

use super::page::drawable;
use super::page::file::shown;
use super::report::Outcome;
use crate::draft::{self, Draft, Drafts};
use crate::error::{Error, ErrorKind};
use crate::mocap::files::CaptureOptions;
use crate::robot::Robot;
use crate::robot::urdf_text::urdf;
use crate::view::foxglove::SceneFile;
use serde::Serialize;
use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};

/// Which file becomes which scene.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneOrder {
    /// A capture, markers, or a recording.
    pub source: PathBuf,
    /// What it does not say itself.
    pub reading: CaptureOptions,
    /// The file (.mcap).
    pub file: PathBuf,
    /// It may replace one that is there.
    pub replace: bool,
}

/// What came of it.
#[derive(Clone, Debug, Serialize)]
pub struct SceneReport {
    /// `done`, or `done_with_loss` if something is missing in the file that was read.
    pub outcome: Outcome,
    /// Instants of whatever moves.
    pub instants: usize,
    /// Links of a robot.
    pub links: usize,
    /// From the first instant to the last, s.
    pub duration_s: f64,
    /// Choices made on the way, and what is missing.
    pub notes: Vec<String>,
    /// Where.
    pub written: String,
}

/// Writes what a file shows as messages of Foxglove's.
///
/// # Errors
/// A file that cannot be read or shows nothing, another ending than .mcap, a file that exists or cannot be written.
pub fn write_scene(order: &SceneOrder) -> Result<SceneReport, Error> {
    if order.file.extension().is_none_or(|ending| ending != "mcap") {
        return Err(Error::of(ErrorKind::Unknown, "this kind of file holds no scene")
            .at(order.file.display().to_string())
            .allowed("with --scene, a file that ends in .mcap"));
    }
    draft::check_free(&order.file, order.replace)?;
    let drawn = shown(&order.source, &order.reading)?;
    let model = drawn.robot.as_ref().map(model).transpose()?;
    let failed = |cause: std::io::Error| draft::unwritten(&order.file, &cause);
    let file =
        SceneFile { scene: &drawn.page.scene, urdf: model.as_deref(), start_ns: drawn.start_ns };
    let mut draft = Draft::whole(&order.file, order.replace).map_err(failed)?;
    let mut buffered = BufWriter::new(&mut draft);
    let counts = file.write(&mut buffered).map_err(failed)?;
    buffered.flush().map_err(failed)?;
    drop(buffered);
    let mut drafts = Drafts::default();
    drafts.add(&order.file, draft);
    drafts.keep()?;
    // What a page warns of is missing in the file.
    let is_whole = drawn.page.warnings.is_empty();
    let notes = drawn.page.warnings.iter().chain(&drawn.page.notes).cloned().collect();
    Ok(SceneReport {
        outcome: if is_whole { Outcome::Done } else { Outcome::DoneWithLoss },
        instants: counts.instants,
        links: counts.links,
        duration_s: drawn.page.scene.duration_s,
        notes,
        written: order.file.display().to_string(),
    })
}

/// A robot's body as URDF.
fn model(robot: &Robot) -> Result<String, Error> {
    let body = drawable(robot)?.ok_or_else(|| {
        Error::of(ErrorKind::Absent, "nobody said where the joints of this robot are")
            .at(format!("robot {}", robot.name))
            .remedy("gaitway robot import MODEL gives its file a body")
    })?;
    Ok(urdf(&robot.name, &body, &robot.limits()))
}

/// Writes a robot's body as URDF.
///
/// # Errors
/// A robot nobody knows or without a body, another ending than .urdf, a file that exists or cannot be written.
pub fn write_model(robot: &str, file: &Path, replace: bool) -> Result<(), Error> {
    if file.extension().is_none_or(|ending| ending != "urdf") {
        return Err(Error::of(ErrorKind::Unknown, "this kind of file holds no model")
            .at(file.display().to_string())
            .allowed("a file that ends in .urdf"));
    }
    draft::write_file(file, replace, model(&Robot::load(robot)?)?.as_bytes())
}
