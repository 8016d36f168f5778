//! Every way a file comes in, by name: how it is read, a small valid file, and hostile ones.

use std::fs;
use std::io;
use std::path::Path;

use gaitway::action::vocabulary as action;
use gaitway::body::anthropometry::Subject;
use gaitway::body::worn::kept::Kept;
use gaitway::calibration::Calibration;
use gaitway::job::source::joints;
use gaitway::mocap::mapping::MappingFile;
use gaitway::mocap::{acclaim, bvh, c3d, marker_files, opensim};
use gaitway::recording;
use gaitway::session::files::{BodyCheck, DeviceCheck, SessionFile, TrialFile};
use gaitway::session::folder::Folder;
use gaitway::session::plan::Plan;
use gaitway_profiles::{profile, read_text};
use gaitway_sim::Script;

use crate::{c3d_files, mcap_files, text_files};

/// Files of one case, made when it is run.
pub type Files = Box<dyn Fn() -> Vec<Vec<u8>> + Send>;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reader {
    Info,
    Recover,
    Convert,
    Replay,
    Sensors,
    PlayRecording,
    PlayTable,
    Bvh,
    C3d,
    Trc,
    Csm,
    OpenSim,
    MarkerTable,
    Acclaim,
    Robot,
    Servo,
    Actuator,
    Sensor,
    Adapter,
    Action,
    Mapping,
    Calibration,
    BodyCalibration,
    Plan,
    Session,
    Trial,
    DeviceCheck,
    BodyCheck,
    Subject,
    FaultScript,
}

impl Reader {
    pub const ALL: [Self; 30] = [
        Self::Info,
        Self::Recover,
        Self::Convert,
        Self::Replay,
        Self::Sensors,
        Self::PlayRecording,
        Self::PlayTable,
        Self::Bvh,
        Self::C3d,
        Self::Trc,
        Self::Csm,
        Self::OpenSim,
        Self::MarkerTable,
        Self::Acclaim,
        Self::Robot,
        Self::Servo,
        Self::Actuator,
        Self::Sensor,
        Self::Adapter,
        Self::Action,
        Self::Mapping,
        Self::Calibration,
        Self::BodyCalibration,
        Self::Plan,
        Self::Session,
        Self::Trial,
        Self::DeviceCheck,
        Self::BodyCheck,
        Self::Subject,
        Self::FaultScript,
    ];

    pub fn named(name: &str) -> Self {
        let found = Self::ALL.into_iter().find(|reader| format!("{reader:?}") == name);
        found.expect("the name of a reader")
    }

    /// What a file of this kind is called.
    pub fn file_name(self) -> &'static str {
        match self {
            _ if self.takes_recordings() => "recording.mcap",
            Self::PlayTable => "table.csv",
            Self::Bvh => "capture.bvh",
            Self::C3d => "trial.c3d",
            Self::Trc => "trial.trc",
            Self::Csm => "trial.csm",
            Self::OpenSim => "walk.mot",
            Self::MarkerTable => "trial.csv",
            Self::Acclaim => "motion.amc",
            Self::Robot => "so101.toml",
            Self::Servo => "xm430-w350.toml",
            Self::Actuator => "dm4310.toml",
            Self::Sensor => "bno08x-rvc.toml",
            Self::Adapter => "u2d2.toml",
            Self::Action => "bow.toml",
            _ => "file.toml",
        }
    }

    fn takes_recordings(self) -> bool {
        use Reader::{Convert, Info, PlayRecording, Recover, Replay, Sensors};
        matches!(self, Info | Recover | Convert | Replay | Sensors | PlayRecording)
    }

    /// Reads as the commands do.
    pub fn read(self, path: &Path) -> Result<(), String> {
        match self {
            Self::Info => recording::summary(path).map(drop).map_err(|e| e.to_string()),
            Self::Recover => recover(path),
            Self::Convert => {
                recording::write_csv(path, &mut io::sink()).map(drop).map_err(|e| e.to_string())
            }
            Self::Replay => recording::read_orientations(path).map(drop).map_err(|e| e.to_string()),
            Self::Sensors => recording::sensor_series(path).map(drop).map_err(|e| e.to_string()),
            Self::PlayRecording | Self::PlayTable => {
                joints::read(path, &[]).map(drop).map_err(|e| e.to_string())
            }
            Self::Bvh => bvh::read(path).map(drop).map_err(|e| e.to_string()),
            Self::C3d => c3d::read(path).map(drop).map_err(|e| e.to_string()),
            Self::OpenSim => opensim::read(path).map(drop).map_err(|e| e.to_string()),
            Self::Trc | Self::Csm | Self::MarkerTable => {
                marker_files::open(path).map(drop).map_err(|e| e.to_string())
            }
            Self::Acclaim => {
                let skeleton = acclaim::parse_skeleton(text_files::ASF.as_bytes());
                let skeleton = skeleton.expect("a skeleton");
                acclaim::read(path, &skeleton, None).map(drop).map_err(|e| e.to_string())
            }
            Self::Robot | Self::Servo | Self::Actuator | Self::Sensor | Self::Adapter => {
                let path = path.to_str().expect("a path of letters");
                profile(path).map(drop).map_err(|e| e.to_string())
            }
            Self::Action => action::read(path).map(drop).map_err(|e| e.to_string()),
            Self::Calibration => Calibration::read(path).map(drop).map_err(|e| e.to_string()),
            Self::Session => session::<SessionFile>(path),
            Self::Trial => session::<TrialFile>(path),
            Self::DeviceCheck => session::<DeviceCheck>(path),
            Self::BodyCheck => session::<BodyCheck>(path),
            Self::Subject => session::<Subject>(path),
            Self::Mapping | Self::BodyCalibration | Self::Plan | Self::FaultScript => {
                self.read_text(&read_text(path).map_err(|e| e.to_string())?)
            }
        }
    }

    fn read_text(self, text: &str) -> Result<(), String> {
        match self {
            Self::Mapping => MappingFile::parse(text).map(drop).map_err(|e| e.to_string()),
            Self::BodyCalibration => Kept::parse(text).map(drop).map_err(|e| e.to_string()),
            Self::Plan => Plan::parse(text, "plan.toml").map(drop).map_err(|e| e.to_string()),
            _ => Script::parse(text).map(drop).map_err(|e| e.to_string()),
        }
    }

    /// A small file that is read without complaint.
    pub fn minimal(self) -> Vec<u8> {
        if self.takes_recordings() {
            return mcap_files::minimal();
        }
        match self {
            Self::PlayTable => text_files::TABLE.into(),
            Self::Bvh => text_files::BVH.into(),
            Self::C3d => c3d_files::minimal(),
            Self::Trc => text_files::TRC.into(),
            Self::Csm => text_files::CSM.into(),
            Self::OpenSim => text_files::MOT.into(),
            Self::MarkerTable => text_files::MARKER_TABLE.into(),
            Self::Acclaim => text_files::AMC.into(),
            Self::Robot => profiles("robots/so101.toml"),
            Self::Servo => profiles("servos/robotis/xm430-w350.toml"),
            Self::Actuator => profiles("actuators/damiao/dm4310.toml"),
            Self::Sensor => profiles("sensors/bno08x-rvc.toml"),
            Self::Adapter => profiles("adapters/u2d2.toml"),
            Self::Action => fs::read("actions/bow.toml").expect("a shipped action"),
            Self::Mapping => text_files::MAPPING.into(),
            Self::Calibration => text_files::CALIBRATION.into(),
            Self::BodyCalibration => text_files::BODY_CALIBRATION.into(),
            Self::Plan => text_files::PLAN.into(),
            Self::Session => text_files::SESSION.into(),
            Self::Trial => text_files::TRIAL.into(),
            Self::DeviceCheck => text_files::DEVICE_CHECK.into(),
            Self::BodyCheck => text_files::BODY_CHECK.into(),
            Self::Subject => text_files::SUBJECT.into(),
            _ => text_files::FAULTS.into(),
        }
    }

    /// Cases by name.
    pub fn hostile(self) -> Vec<(&'static str, Files)> {
        let minimal = self.minimal();
        if self.takes_recordings() {
            // Each recovery is synchronised to the disk.
            let most = if self == Self::Recover { 60 } else { 600 };
            return mcap_files::hostile(&minimal, most);
        }
        match self {
            Self::PlayTable => text_files::hostile_tables(&minimal),
            Self::Bvh => text_files::hostile_bvh(&minimal),
            Self::C3d => c3d_files::hostile(&minimal),
            Self::Trc => text_files::hostile_trc(&minimal),
            Self::Csm => text_files::hostile_csm(&minimal),
            Self::OpenSim => text_files::hostile_opensim(&minimal),
            Self::MarkerTable => text_files::hostile_marker_tables(&minimal),
            Self::Acclaim => text_files::hostile_acclaim(&minimal),
            // All are read by the same parser; these, by how much else is kept beside what it gives.
            Self::Servo | Self::Action | Self::Mapping => {
                let mut cases = text_files::hostile_toml(&minimal);
                cases.extend(text_files::hostile_structure());
                cases
            }
            _ => text_files::hostile_toml(&minimal),
        }
    }
}

fn profiles(file: &str) -> Vec<u8> {
    fs::read(Path::new("firmware-profiles").join(file)).expect("a shipped profile")
}

fn recover(path: &Path) -> Result<(), String> {
    let recovered = recording::recover(path, true).map_err(|e| e.to_string())?;
    // Beside the hostile ones it would be read as one of them.
    fs::remove_file(recovered.path).map_err(|e| e.to_string())
}

/// A file of a session is read through the session's folder.
fn session<T: serde::de::DeserializeOwned>(path: &Path) -> Result<(), String> {
    let root = path.with_extension("session");
    let folder = Folder::open(&root).map_err(|e| e.to_string())?;
    fs::copy(path, folder.path("session.toml")).map_err(|e| e.to_string())?;
    let read = folder.read::<T>("session.toml").map(drop).map_err(|e| e.to_string());
    let _ = fs::remove_dir_all(&root);
    read
}
