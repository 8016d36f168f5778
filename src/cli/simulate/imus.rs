//! `simulate imus`: a virtual person who wears virtual sensors, each of which other programs open.

use crate::body::Segment;
use crate::body::{segment_name, segment_named};
use crate::cli::Remarks;
use crate::cli::duration::duration;
use crate::cli::signals::Signals;
use crate::error::{Error, ErrorKind};
use crate::job::simulate::person::Person;
use crate::job::simulate::worn::{Strapping, Worn, wire};
use crate::job::source::body_motion;
use crate::time::Duration;
use clap::Args;
use gaitway_profiles::Sensor;
use gaitway_sim::imu::{ImuDoor, ImuWire, Stage, VirtualImu};
use std::fmt::Write;
use std::net::{SocketAddr, ToSocketAddrs};
use std::path::{Path, PathBuf};

/// How often it is looked what the person does.
const LOOK: std::time::Duration = std::time::Duration::from_millis(50);
/// First line of a file of what is worn; one that begins so is ours to write over.
const HEAD: &str = "# Which segment wears which virtual sensor, written by gaitway simulate imus";

/// Arguments of `simulate imus`.
#[derive(Debug, Args)]
#[command(after_help = "\
Somebody stands in N pose, raises the arms to T pose, bows, stands, does the motion and stands again.
It begins when the first sensor is opened, and starts again once all have been closed. Standard output
has one line for each sensor: what to open, and its segment; DIR/wear.toml says the same to
`gaitway live`.

Example:
  gaitway simulate imus --motion walk:30s --pty /tmp/body
  gaitway live --wear /tmp/body/wear.toml --robot op3 --bus sim:pty --n-pose-after 1s --moves bow")]
pub struct ImusArgs {
    /// What the person does after the calibration poses
    #[arg(long, value_name = "MOTION", default_value = "walk:30s")]
    motion: String,
    /// Segments that wear a sensor (comma between names), or all
    #[arg(long, value_name = "SEGMENTS", value_delimiter = ',', default_value = "all")]
    wear: Vec<String>,
    /// What the sensors are (see `gaitway profile list`)
    #[arg(long, value_name = "NAME", default_value = "xsens-mti")]
    profile: String,
    /// Folder for a link to each sensor's pseudo-terminal; made if it is not there
    #[arg(long, value_name = "DIR", required_unless_present = "udp")]
    pty: Option<PathBuf>,
    /// Where the trackers' server is (SlimeVR)
    #[arg(long, value_name = "HOST:PORT", conflicts_with = "pty")]
    udp: Option<String>,
    /// Where to write which segment wears which sensor [default: DIR/wear.toml]
    #[arg(long, value_name = "FILE.toml")]
    wear_file: Option<PathBuf>,
    /// How long the person stands in N pose at first, and before the motion, e.g. 10s
    #[arg(long, value_name = "TIME", value_parser = duration, default_value = "10s")]
    stand: Duration,
    /// Noise and bias as a multiple of a usual sensor's; 0: none
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, value_parser = factor)]
    noise: f64,
    /// Drift of headings that sensors compute themselves, deg/min
    #[arg(long, value_name = "DEG_MIN", default_value_t = 1.0, allow_negative_numbers = true)]
    drift: f64,
    /// How far straps are turned about the limbs, root mean square, deg
    #[arg(long, value_name = "DEG", default_value_t = 8.0, value_parser = degrees)]
    strapping: f64,
    /// An adapter holds bytes back to multiples of this time, e.g. 16ms
    #[arg(long, value_name = "TIME", value_parser = duration)]
    batch: Option<Duration>,
    /// Probability that a sample is lost, 0 to 1
    #[arg(long, value_name = "SHARE", default_value_t = 0.0, value_parser = share)]
    loss: f64,
    /// Seed of everything random
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
}

/// Reads a number from zero to `most`.
fn up_to(most: f64, text: &str) -> Result<f64, String> {
    let value = text.parse::<f64>().ok().filter(|value| (0.0..=most).contains(value));
    value.ok_or_else(|| format!("allowed are 0 to {most}"))
}

fn factor(text: &str) -> Result<f64, String> {
    up_to(1e3, text)
}

fn degrees(text: &str) -> Result<f64, String> {
    up_to(180.0, text)
}

fn share(text: &str) -> Result<f64, String> {
    up_to(1.0, text)
}

/// Runs `simulate imus` until a signal comes.
///
/// # Errors
/// An unknown motion, segment or profile, a folder or terminal that cannot be had.
pub fn run(args: &ImusArgs, remarks: Remarks) -> Result<i32, Error> {
    let signals = Signals::listen().map_err(|e| Error::new(format!("no signals: {e}")))?;
    let segments = segments(&args.wear)?;
    let sensor = gaitway_profiles::sensor(&args.profile)?;
    let wire = wire(&sensor)?;
    let (capture, _) = body_motion(&args.motion, None)?;
    let person = Person::new(&capture, args.stand.as_secs_f64())?;
    let stage = Stage::default();
    let mut place = Place::of(args, &sensor, wire)?;
    let strapping = Strapping {
        noise: args.noise,
        drift_rad_s: args.drift.to_radians() / 60.0,
        twist_rad: args.strapping.to_radians(),
        batch_s: args.batch.map_or(0.0, |batch| batch.as_secs_f64()),
        loss: args.loss,
    };
    let mut worn = Worn::new(&person, &sensor, strapping, args.seed)?;
    let mut doors = Vec::new();
    for segment in segments {
        let imu = worn.on(segment).map_err(|e| e.at("--motion"))?;
        doors.push(place.open(&stage, segment, imu)?);
    }
    place.finish(remarks)?;
    let mut doing = None;
    while signals.first().is_none() {
        std::thread::sleep(LOOK);
        let now = stage.began().map(|began| person.doing(began.elapsed().as_secs_f64()));
        if now != doing {
            remarks.say(now.unwrap_or("nobody listens"));
            doing = now;
        }
    }
    drop(doors);
    Ok(0)
}

fn segments(typed: &[String]) -> Result<Vec<Segment>, Error> {
    if typed.iter().any(|name| name == "all") {
        return Ok(Segment::ALL.to_vec());
    }
    let mut segments = Vec::new();
    for name in typed {
        let segment = segment_named(name).map_err(|e| e.at("--wear"))?;
        if !segments.contains(&segment) {
            segments.push(segment);
        }
    }
    Ok(segments)
}

/// Where sensors are opened, and what is told of it.
struct Place<'a> {
    args: &'a ImusArgs,
    server: Option<SocketAddr>,
    baud_bps: u32,
    wear: String,
}

impl<'a> Place<'a> {
    fn of(args: &'a ImusArgs, sensor: &Sensor, wire: ImuWire) -> Result<Self, Error> {
        let misfit = |remedy: &str| {
            Error::new("the profile and the way it is sent do not fit together")
                .at("--profile")
                .got(args.profile.clone())
                .remedy(remedy.to_owned())
        };
        let server = match (&args.udp, wire) {
            (None, ImuWire::SlimeVr) => {
                return Err(misfit("SlimeVR trackers send UDP: --udp 127.0.0.1:6969"));
            }
            (None, _) => None,
            (Some(text), ImuWire::SlimeVr) => {
                let found = text.to_socket_addrs().ok().and_then(|mut all| all.next());
                Some(found.ok_or_else(|| {
                    Error::new("not an address").at("--udp").got(text.clone()).allowed("HOST:PORT")
                })?)
            }
            (Some(_), _) => return Err(misfit("only SlimeVR trackers send UDP: use --pty DIR")),
        };
        if let Some(folder) = &args.pty {
            std::fs::create_dir_all(folder).map_err(|e| {
                Error::of(ErrorKind::Io, "the folder cannot be made")
                    .at(folder.display().to_string())
                    .got(e.to_string())
            })?;
        }
        let mut wear = format!("{HEAD}\n");
        if let Some(server) = server {
            let _ = writeln!(wear, "sources = [\"imu:slimevr@udp:{}\"]", server.port());
        }
        wear.push_str("[segments]\n");
        let baud_bps = sensor.baud_bps.unwrap_or(115_200);
        Ok(Self { args, server, baud_bps, wear })
    }

    fn open(&mut self, stage: &Stage, segment: Segment, imu: VirtualImu) -> Result<ImuDoor, Error> {
        let name = segment_name(segment);
        let failed = |place: String| {
            move |e: gaitway_sim::DoorError| {
                Error::new("a virtual sensor cannot be set up")
                    .at(place)
                    .got(e.to_string())
                    .remedy("choose another folder, or another address")
            }
        };
        if let Some(server) = self.server {
            let number = segment.index() as u8 + 1;
            // The second bit of a network address: given by whoever runs the network.
            let mac = [2, 0, 0, 0, 0, number];
            let door = ImuDoor::open_slimevr(stage, imu, server, mac)
                .map_err(failed(server.to_string()))?;
            let tracker = format!("tracker-0000{number:02x}-0");
            let _ = writeln!(self.wear, "{name} = \"{tracker}\"");
            super::tell(&format!("{tracker} {name}\n"))?;
            return Ok(door);
        }
        let link = self.args.pty.as_deref().unwrap_or(Path::new(".")).join(name);
        let door = ImuDoor::open_on(stage, imu, self.baud_bps, Some(&link))
            .map_err(failed(link.display().to_string()))?;
        let path = std::path::absolute(&link).unwrap_or(link);
        let source = format!("imu:{}@serial:{}", self.args.profile, path.display());
        let _ = writeln!(self.wear, "{name} = {source:?}");
        super::tell(&format!("{} {name}\n", path.display()))?;
        Ok(door)
    }

    /// Writes down what is worn, and says how to go on.
    fn finish(self, remarks: Remarks) -> Result<(), Error> {
        let usual = || self.args.pty.as_ref().map(|folder| folder.join("wear.toml"));
        let Some(path) = self.args.wear_file.clone().or_else(usual) else { return Ok(()) };
        let is_ours = std::fs::read_to_string(&path).is_ok_and(|text| text.starts_with(HEAD));
        if path.exists() && !is_ours {
            return Err(Error::of(ErrorKind::Exists, "the file exists already")
                .at(path.display().to_string())
                .remedy("choose another folder, or another --wear-file"));
        }
        std::fs::write(&path, &self.wear).map_err(|e| {
            Error::of(ErrorKind::Io, "cannot write the file")
                .at(path.display().to_string())
                .got(e.to_string())
        })?;
        remarks.say(&format!(
            "then: gaitway live --wear {} --robot op3 --bus sim:pty --n-pose-after 1s --moves bow\n\
             Ctrl-C ends it",
            path.display()
        ));
        Ok(())
    }
}
