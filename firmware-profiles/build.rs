//! Compiles every profile file into the crate, so that a binary works wherever it is put.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::{env, fs, io};

fn main() -> io::Result<()> {
    let root = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").unwrap_or_default());
    let out = PathBuf::from(env::var_os("OUT_DIR").unwrap_or_default());
    let mut code = String::new();
    for (constant, folder) in [
        ("SERVOS", "servos"),
        ("ACTUATORS", "actuators"),
        ("ADAPTERS", "adapters"),
        ("ROBOTS", "robots"),
        ("SENSORS", "sensors"),
        ("BOARDS", "boards"),
    ] {
        let mut files = Vec::new();
        collect_toml(&root.join(folder), &mut files)?;
        files.sort_by_key(|path| path.file_stem().map(ToOwned::to_owned));
        write_list(&mut code, constant, &root, &files);
    }
    fs::write(out.join("embedded.rs"), code)
}

/// Finds the `.toml` files below `folder` and tells cargo to watch it, so that a new file counts.
fn collect_toml(folder: &Path, files: &mut Vec<PathBuf>) -> io::Result<()> {
    println!("cargo::rerun-if-changed={}", folder.display());
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            collect_toml(&path, files)?;
        } else if path.extension().is_some_and(|extension| extension == "toml") {
            println!("cargo::rerun-if-changed={}", path.display());
            files.push(path);
        }
    }
    Ok(())
}

fn write_list(code: &mut String, constant: &str, root: &Path, files: &[PathBuf]) {
    let _ = writeln!(code, "pub(crate) const {constant}: &[EmbeddedFile] = &[");
    for path in files {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let file = path.strip_prefix(root).unwrap_or(path).to_string_lossy();
        let _ = writeln!(
            code,
            "    EmbeddedFile {{ name: {stem:?}, file: {file:?}, text: include_str!({path:?}) }},"
        );
    }
    let _ = writeln!(code, "];");
}
