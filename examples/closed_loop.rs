//! Actions that a virtual robot plays over its bus, named from what its servos reported back: a table.
//!
//! ```text
//! cargo run --release --example closed_loop -- [--models DIR] [--keep DIR] [VARIATIONS] [ACTION ...]
//! ```
//!
//! Each action is played once as it ships and then as variations of it, which come to the robot as captures do: as BVH
//! files. Right is a run in which the action was named, on its side if it has one; how often it is named in the motion itself,
//! before the robot, stands beside it. What was played is kept in a folder if one is named, and only named again where it is
//! there: by other models (`--models`), in a minute. The list was fixed before anything was played: actions without a flight, a chair or a waist, which OP3 has not. Its servos are slower than people: runs are slowed,
//! and seen by how much they were.

use gaitway::Error;
use gaitway::job::Nobody;
use gaitway::job::recognise::{RecogniseOrder, RecognisedAction, recognise};
use gaitway::job::share::Share;
use gaitway::job::synth::{Figures, SynthOrder, synth};
use gaitway::{Options, open};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

const ROBOT: &str = "op3";
const SHOWN: [&str; 21] = [
    "box-l",
    "box-r",
    "chop-l",
    "chop-r",
    "drink-l",
    "drink-r",
    "kick-l",
    "kick-r",
    "knee-kick-l",
    "knee-kick-r",
    "side-kick-l",
    "side-kick-r",
    "squat",
    "swing-arms-circular",
    "swing-arms-sagittal",
    "swing-arms-transverse",
    "throw-l",
    "throw-r",
    "walk",
    "wave-l",
    "wave-r",
];

/// What was asked for on the command line.
struct Asked {
    models: Option<PathBuf>,
    keep: Option<PathBuf>,
    variations: u32,
    actions: Vec<String>,
}

impl Asked {
    fn read() -> Self {
        let mut asked = Self { models: None, keep: None, variations: 20, actions: Vec::new() };
        let mut words = std::env::args().skip(1);
        while let Some(word) = words.next() {
            match word.as_str() {
                "--models" => asked.models = words.next().map(PathBuf::from),
                "--keep" => asked.keep = words.next().map(PathBuf::from),
                word => match word.parse() {
                    Ok(variations) => asked.variations = variations,
                    Err(_) => asked.actions.push(word.to_owned()),
                },
            }
        }
        if asked.actions.is_empty() {
            asked.actions = SHOWN.map(str::to_owned).to_vec();
        }
        asked
    }
}

fn main() -> Result<(), Error> {
    let asked = Asked::read();
    let scratch = std::env::temp_dir().join(format!("closed-loop-{}", std::process::id()));
    let folder = asked.keep.as_ref().unwrap_or(&scratch);
    std::fs::create_dir_all(folder).map_err(|e| Error::new(e.to_string()))?;
    println!(
        "{:22} {:>6} {:>6} {:>6} {:>8}  named otherwise",
        "", "played", "itself", "right", "slowed"
    );
    let (mut played, mut itself, mut right) = (0, 0, 0);
    for action in &asked.actions {
        let mut tally = Tally::default();
        for variation in std::iter::once(None).chain((0..asked.variations).map(Some)) {
            tally.add(action, run(folder, asked.models.as_deref(), action, variation));
        }
        println!(
            "{action:22} {:>6} {:>6} {:>6} {:>8.2}  {}",
            tally.played,
            tally.itself,
            tally.right,
            tally.slowed / f64::from(tally.played.max(1)),
            tally.others()
        );
        played += tally.played;
        itself += tally.itself;
        right += tally.right;
    }
    println!(
        "{:22} {played:>6} {itself:>6} {right:>6}  {:.1} %",
        "all",
        100.0 * f64::from(right) / f64::from(played.max(1))
    );
    match asked.keep {
        Some(_) => Ok(()),
        None => std::fs::remove_dir_all(&scratch).map_err(|e| Error::new(e.to_string())),
    }
}

/// What a run gave: names in the motion itself, names from the servos, how much slower it was.
struct Named {
    itself: Vec<String>,
    servos: Vec<String>,
    slowed: f64,
}

/// Plays an action, or a variation of it, and names it and what came back.
fn run(
    folder: &Path,
    models: Option<&Path>,
    action: &str,
    variation: Option<u32>,
) -> Result<Named, Error> {
    let number = variation.map_or_else(|| "ships".to_owned(), |number| number.to_string());
    let file = |ending: &str| folder.join(format!("{action}-{number}.{ending}"));
    let (bvh, recording, pace) = (file("bvh"), file("mcap"), file("slowed"));
    let motion = match variation {
        None => action.to_owned(),
        Some(_) => bvh.display().to_string(),
    };
    let known = std::fs::read_to_string(&pace).ok().and_then(|text| text.parse::<f64>().ok());
    let slowed = match known {
        Some(slowed) => slowed,
        None => {
            if variation.is_some() {
                make(&bvh, action, variation)?;
            }
            let slowed = play(&motion, &recording)?;
            std::fs::write(&pace, slowed.to_string()).map_err(|e| Error::new(e.to_string()))?;
            slowed
        }
    };
    let itself = names(&motion, models, 1.0)?;
    let servos = names(&recording.display().to_string(), models, slowed)?;
    Ok(Named { itself, servos, slowed })
}

/// Writes a variation of an action.
fn make(file: &Path, action: &str, variation: Option<u32>) -> Result<(), Error> {
    let order = SynthOrder {
        inserts: Default::default(),
        figures: Figures::read(&[])?,
        rate_hz: 120.0,
        seed: 1,
        database: Vec::new(),
        has_points: false,
        html: None,
        part: Share::WHOLE,
        file: file.to_owned(),
        replace: true,
    };
    synth(&order, action, variation, &Nobody).map(|_| ())
}

/// Plays a motion on a virtual robot; how much slower it was.
fn play(motion: &str, recording: &Path) -> Result<f64, Error> {
    let mut rig = open(ROBOT, "sim")?;
    let motion = rig.motion(motion)?;
    let options = Options {
        record: Some(recording.to_owned()),
        replace: true,
        retime: Some(true),
        allow_fall: true,
        ..Options::default()
    };
    Ok(rig.play(&motion, options)?.retime_factor)
}

/// What is named in a motion, each name once.
fn names(motion: &str, models: Option<&Path>, slowed: f64) -> Result<Vec<String>, Error> {
    let order = RecogniseOrder {
        motion: motion.to_owned(),
        models: models.map(Path::to_owned),
        slowed: Some(slowed),
        ..Default::default()
    };
    let name = |event: &RecognisedAction| match event.side {
        Some(side) => format!("{}-{}", event.action, &side.word()[..1]),
        None => event.action.clone(),
    };
    let mut names: Vec<String> = recognise(&order, |_| ())?.events.iter().map(name).collect();
    names.sort();
    names.dedup();
    Ok(names)
}

#[derive(Default)]
struct Tally {
    played: u32,
    itself: u32,
    right: u32,
    slowed: f64,
    others: BTreeMap<String, u32>,
}

impl Tally {
    fn add(&mut self, action: &str, run: Result<Named, Error>) {
        self.played += 1;
        let Named { itself, servos, slowed } = match run {
            Ok(run) => run,
            Err(error) => {
                *self.others.entry(format!("not played: {error}")).or_default() += 1;
                return;
            }
        };
        self.slowed += slowed;
        let is_it = |name: &String| {
            name == action
                || name.strip_prefix(action).is_some_and(|side| ["-l", "-r"].contains(&side))
        };
        self.itself += u32::from(itself.iter().any(is_it));
        self.right += u32::from(servos.iter().any(is_it));
        for name in servos.into_iter().filter(|name| !is_it(name)) {
            *self.others.entry(name).or_default() += 1;
        }
    }

    fn others(&self) -> String {
        let others = self.others.iter().map(|(name, times)| format!("{name} {times} x"));
        others.collect::<Vec<_>>().join(", ")
    }
}
