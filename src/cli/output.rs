//! Results on stdout, remarks on stderr, files that are never overwritten unasked.

use crate::error::Error;
use std::fs::OpenOptions;
use std::io::Write;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// Prints a result.
pub fn print(text: &str) {
    let mut out = std::io::stdout().lock();
    // A reader that has had enough (`| head`) is no error.
    let _ = out.write_all(text.as_bytes()).and_then(|()| out.flush());
}

/// Fails if no file can be written at `path`, as far as that can be known before.
fn check_place(path: &Path) -> Result<(), Error> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    let folder = folder.unwrap_or(Path::new("."));
    if !folder.is_dir() {
        return Err(Error::new("there is no such folder")
            .at(folder.display().to_string())
            .remedy("make it first, or choose another place"));
    }
    let written = if path.exists() { path } else { folder };
    rustix::fs::access(written, rustix::fs::Access::WRITE_OK).map_err(|e| {
        Error::new("you may not write here")
            .at(written.display().to_string())
            .got(e.to_string())
            .remedy("choose another place")
    })
}

/// What is said beside the result, unless the user wants quiet.
#[derive(Clone, Copy, Debug, Default)]
pub struct Remarks {
    /// True if only results and errors are wanted.
    pub quiet: bool,
}

impl Remarks {
    /// Says something to the person at the terminal.
    pub fn say(self, text: &str) {
        if !self.quiet {
            eprintln!("{text}");
        }
    }

    /// True if a progress bar may be shown.
    #[must_use]
    pub fn shows_progress(self) -> bool {
        !self.quiet && rustix::termios::isatty(rustix::stdio::stderr())
    }
}

/// Where a report goes.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct Output {
    /// Print one JSON document instead of text
    #[arg(long)]
    json: bool,
    /// Write the JSON document to this file as well
    #[arg(long, value_name = "FILE.json")]
    report: Option<PathBuf>,
    /// Overwrite files that exist
    #[arg(long)]
    force: bool,
}

impl Output {
    /// True if files may be overwritten.
    #[must_use]
    pub const fn force(&self) -> bool {
        self.force
    }

    /// No report, and files that exist are overwritten if `force`.
    #[must_use]
    pub fn forced(force: bool) -> Self {
        Self { force, ..Self::default() }
    }

    /// Prints a report as text or JSON and writes it to `--report`.
    ///
    /// # Errors
    /// A report file that exists or cannot be written.
    pub fn report(&self, report: &impl serde::Serialize, text: &str) -> Result<(), Error> {
        let json = serde_json::to_string_pretty(report)
            .map_err(|e| Error::new(format!("the report cannot be written as JSON: {e}")))?;
        if self.json {
            print(&format!("{json}\n"));
        } else {
            print(text);
        }
        if let Some(path) = &self.report {
            self.write_file(path, format!("{json}\n").as_bytes())?;
        }
        Ok(())
    }

    /// Fails early if one of the files to be written exists, cannot be made, or is named twice:
    /// before anything moves.
    ///
    /// # Errors
    /// The file exists and `--force` was not given; its folder does not exist; the same path twice.
    pub fn check_files(&self, wanted: &[&Option<PathBuf>]) -> Result<(), Error> {
        let paths: Vec<&Path> =
            wanted.iter().copied().chain([&self.report]).filter_map(|p| p.as_deref()).collect();
        for (index, path) in paths.iter().enumerate() {
            if paths[..index].contains(path) {
                return Err(Error::new("two outputs have the same name")
                    .at(path.display().to_string())
                    .remedy("give each its own"));
            }
            self.check_free(path)?;
            check_place(path)?;
        }
        Ok(())
    }

    /// Fails if an output is the very file that is read, whatever its name: `--force` permits to
    /// replace results, not to lose what they are made of.
    ///
    /// # Errors
    /// An output, or the report, that is `input`.
    pub fn check_apart(&self, input: &Path, wanted: &[&Path]) -> Result<(), Error> {
        let id = |path: &Path| std::fs::metadata(path).ok().map(|file| (file.dev(), file.ino()));
        let Some(read) = id(input) else { return Ok(()) };
        let mut written = wanted.iter().copied().chain(self.report.as_deref());
        match written.find(|path| id(path) == Some(read)) {
            None => Ok(()),
            Some(path) => Err(Error::new("the file that is read would be written over")
                .at(path.display().to_string())
                .remedy("choose another name; --force is not for this")),
        }
    }

    /// Fails if `path` exists and may not be overwritten.
    fn check_free(&self, path: &Path) -> Result<(), Error> {
        if path.is_dir() {
            return Err(Error::new("this is a folder, not a file")
                .at(path.display().to_string())
                .remedy("give the name of a file in it"));
        }
        // A dangling link counts as taken: writing through it would write elsewhere.
        if self.force || path.symlink_metadata().is_err() {
            return Ok(());
        }
        Err(Error::new("the file exists already")
            .at(path.display().to_string())
            .remedy("choose another name, or add --force to overwrite it"))
    }

    /// Writes a whole file, never over an existing one without `--force`.
    ///
    /// # Errors
    /// The file exists, or cannot be written.
    pub fn write_file(&self, path: &Path, bytes: &[u8]) -> Result<(), Error> {
        self.check_free(path)?;
        let mut options = OpenOptions::new();
        options.write(true);
        if self.force {
            options.create(true).truncate(true);
        } else {
            options.create_new(true);
        }
        let written = options.open(path).and_then(|mut file| file.write_all(bytes));
        written.map_err(|e| {
            Error::new("cannot write the file").at(path.display().to_string()).got(e.to_string())
        })
    }
}
