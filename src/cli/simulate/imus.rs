//! `simulate imus`: a virtual person who wears virtual sensors, each of which other programs open.

use crate::body::segment_name;
use crate::cli::Remarks;
use crate::cli::signals::Signals;
use crate::error::Error;
use crate::job::simulate::imus::{ImusOrder, SensorDoors, put_on};
use crate::job::simulate::participant::FollowOrder;
use crate::job::simulate::virtual_person::{VirtualPerson, named_motion};
use crate::job::simulate::worn::{Strapping, degrees, factor, share};
use crate::time::{Duration, duration};
use clap::Args;
use std::path::PathBuf;

/// How often it is looked what the person does.
const LOOK: std::time::Duration = std::time::Duration::from_millis(50);

/// Arguments of `simulate imus`.
#[derive(Debug, Args)]
#[command(after_help = include_str!("../help/simulate-imus.txt"))]
pub struct ImusArgs {
    /// What the person does after the calibration poses
    #[arg(long, value_name = "MOTION", default_value = "walk:30s")]
    motion: String,
    /// Take part in the session in this folder (`record --session DIR`): do what is asked of its subject, and wait for the operator
    #[arg(long, value_name = "DIR", conflicts_with_all = ["motion", "stand"])]
    follow: Option<PathBuf>,
    /// Which subject of the session this is [default: whoever is asked]
    #[arg(long, value_name = "ID", requires = "follow")]
    subject: Option<String>,
    /// What is done for an action of the session: wave=FILE.bvh, or a phrase of actions; without it what ships under that name
    #[arg(long, value_name = "NAME=MOTION", requires = "follow", value_parser = named_motion)]
    action: Vec<(String, String)>,
    /// What goes wrong: a stumble, swapped or lost sensors, something late or wrong (see docs/capture.md)
    #[arg(long, value_name = "FILE.toml", requires = "follow")]
    script: Option<PathBuf>,
    /// Segments that wear a sensor (comma between names), or all; or a file that says how sensors are worn, as `live --wear` reads it
    #[arg(long, value_name = "SEGMENTS|FILE.toml", value_delimiter = ',', default_value = "all")]
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

/// Runs `simulate imus` until a signal comes.
///
/// # Errors
/// As [`VirtualPerson::open`].
pub fn run(args: &ImusArgs, remarks: Remarks) -> Result<i32, Error> {
    let signals = Signals::listen().map_err(|e| Error::new(format!("no signals: {e}")))?;
    let (subject, script) = (args.subject.clone(), args.script.clone());
    let actions = args.action.clone();
    let follow = |session| FollowOrder { session, subject, actions, script };
    let mut person = VirtualPerson::open(&order(args)?, args.follow.clone().map(follow))?;
    for sensor in person.sensors() {
        super::tell(&format!("{} {}\n", sensor.place, segment_name(sensor.segment)))?;
    }
    if let Some(next) = person.next() {
        remarks.say(&format!("then: {next}\nCtrl-C ends it"));
    }
    while signals.first().is_none() {
        std::thread::sleep(LOOK);
        person.attend().iter().for_each(|line| remarks.say(line));
    }
    Ok(0)
}

fn order(args: &ImusArgs) -> Result<ImusOrder, Error> {
    let doors = match (&args.udp, &args.pty) {
        (Some(server), _) => SensorDoors::SlimeVr(server.clone()),
        (None, Some(folder)) => SensorDoors::Terminals(folder.clone()),
        (None, None) => {
            return Err(Error::new("where are the sensors to be?").allowed("--pty, --udp"));
        }
    };
    let (segments, known) = put_on(&args.wear)?;
    Ok(ImusOrder {
        motion: args.motion.clone(),
        segments,
        known,
        profile: args.profile.clone(),
        doors,
        wear_file: args.wear_file.clone(),
        stand_s: args.stand.as_secs_f64(),
        strapping: Strapping {
            noise: args.noise,
            drift_rad_s: args.drift.to_radians() / 60.0,
            twist_rad: args.strapping.to_radians(),
            batch_s: args.batch.map_or(0.0, |batch| batch.as_secs_f64()),
            loss: args.loss,
        },
        seed: args.seed,
    })
}
