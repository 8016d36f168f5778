//! Files that a folder of strangers names as its own.

use crate::error::{Error, ErrorKind};
use std::path::{Component, Path, PathBuf};

/// A file in a folder, as `named` by a file of it: wherever links lead, it does not lie elsewhere.
///
/// # Errors
/// One that leads out of the folder.
pub fn inside(folder: &Path, file: &str, named: &Path) -> Result<PathBuf, Error> {
    let path = folder.join(file);
    let leads_out = match (folder.canonicalize(), path.canonicalize()) {
        (Ok(folder), Ok(path)) => !path.starts_with(folder),
        // What is not there is said by whoever opens it.
        _ => Path::new(file)
            .components()
            .any(|part| !matches!(part, Component::Normal(_) | Component::CurDir)),
    };
    if leads_out {
        return Err(Error::of(ErrorKind::Malformed, "a folder names a file that is not its own")
            .at(named.display().to_string())
            .got(file)
            .allowed(format!("files in {}", folder.display())));
    }
    Ok(path)
}
