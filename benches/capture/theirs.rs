//! Other people's filters, built from the sources of their Python packages: once, under the target
//! folder. It takes Python with `venv`, a way to PyPI and a C++ compiler.

use glam::{DQuat, DVec3};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The filters, as [`Theirs::run`] names them and as people do.
pub const FILTERS: [(&str, &str); 2] =
    [("vqf", "VQF 2.1.2 (C++)"), ("fusion", "x-io Fusion 1.3.3 (C)")];

const BUILD: &str = r#"
set -e
cd "$1"
python3 -m venv v
v/bin/python -m pip download --quiet --disable-pip-version-check --no-deps --no-binary vqf,imufusion \
    vqf==2.1.2 imufusion==1.3.3
for archive in *.tar.gz; do tar xzf "$archive"; done
for file in Ahrs Bias Compass Convention Remap; do
    cc -O3 -DNDEBUG -c "imufusion-1.3.3/Fusion/Fusion$file.c"
done
c++ -O3 -DNDEBUG -I vqf-2.1.2/vqf/cpp -I imufusion-1.3.3/Fusion \
    "$2" vqf-2.1.2/vqf/cpp/vqf.cpp Fusion*.o -lm -o theirs.new
mv theirs.new theirs
"#;

/// A program that runs them.
pub struct Theirs {
    folder: PathBuf,
}

/// A sample: angular rate in rad/s, specific force in m/s^2, magnetic field if there is one.
pub type Sample = (DVec3, DVec3, Option<DVec3>);

impl Theirs {
    /// Builds the program, unless it is there; in words why there is none.
    pub fn build() -> Result<Self, String> {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("their-filters");
        if !folder.join("theirs").exists() {
            let _ = fs::remove_dir_all(&folder);
            fs::create_dir_all(&folder).map_err(|e| e.to_string())?;
            let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/capture/theirs.cpp");
            let mut build = Command::new("sh");
            build.args(["-c", BUILD, "sh"]).arg(&folder).arg(source);
            let output = build.output().map_err(|e| e.to_string())?;
            if !output.status.success() {
                return Err(String::from_utf8_lossy(&output.stderr).into_owned());
            }
        }
        Ok(Self { folder })
    }

    /// Runs a filter over samples: ns per sample, and the orientations.
    pub fn run(
        &self,
        filter: &str,
        nine: bool,
        rate_hz: f64,
        samples: &[Sample],
    ) -> Result<(f64, Vec<DQuat>), String> {
        let name = |end: &str| self.folder.join(format!("{}.{end}", std::process::id()));
        let (input, output) = (name("in"), name("out"));
        let none = DVec3::NAN;
        let bytes: Vec<u8> = samples
            .iter()
            .flat_map(|(rate, force, field)| [*rate, *force, field.unwrap_or(none)])
            .flat_map(|vector| vector.to_array())
            .flat_map(f64::to_le_bytes)
            .collect();
        fs::write(&input, bytes).map_err(|e| e.to_string())?;
        let mut program = Command::new(self.folder.join("theirs"));
        program.args([filter, if nine { "9" } else { "6" }, &rate_hz.to_string()]);
        let ran = program.arg(&input).arg(&output).output().map_err(|e| e.to_string())?;
        let found = fs::read(&output).map_err(|e| e.to_string())?;
        let _ = (fs::remove_file(&input), fs::remove_file(&output));
        let ns = String::from_utf8_lossy(&ran.stdout).trim().parse::<f64>();
        let numbers: Vec<f64> =
            found.as_chunks::<8>().0.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect();
        let quaternion = |q: &[f64; 4]| DQuat::from_xyzw(q[1], q[2], q[3], q[0]);
        let quaternions = numbers.as_chunks::<4>().0.iter().map(quaternion).collect();
        Ok((ns.map_err(|e| e.to_string())?, quaternions))
    }
}
