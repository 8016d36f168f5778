//! Actions that a virtual robot plays over its bus, named from what its servos reported back: a table.
//!
//! ```text
//! cargo run --release --example closed_loop -- [VARIATIONS] [ACTION ...]
//! ```
//!
//! Each action is played once as it ships and then as variations of it, which come to the robot as captures do: as BVH
//! files. Right is a run in which the action was named, on its side if it has one. The list was fixed before anything was
//! played: actions without a flight, a chair or a waist, which OP3 has not. Its servos are slower than people: runs are slowed,
//! and seen by how much they were.

use gaitway::Error;
use gaitway::job::recognise::{RecogniseOrder, RecognisedAction, recognise};
use gaitway::job::synth::{Figures, SynthOrder, synth};
use gaitway::{Options, open};
use std::collections::BTreeMap;
use std::path::Path;

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

fn main() -> Result<(), Error> {
    let mut words = std::env::args().skip(1);
    let variations: u32 = words.next().and_then(|word| word.parse().ok()).unwrap_or(20);
    let mut actions: Vec<String> = words.collect();
    if actions.is_empty() {
        actions = SHOWN.map(str::to_owned).to_vec();
    }
    let folder = std::env::temp_dir().join(format!("closed-loop-{}", std::process::id()));
    std::fs::create_dir_all(&folder).map_err(|e| Error::new(e.to_string()))?;
    println!("{:22} {:>6} {:>6} {:>8}  named otherwise", "", "played", "right", "slowed");
    let (mut played, mut right) = (0, 0);
    for action in &actions {
        let mut tally = Tally::default();
        for variation in std::iter::once(None).chain((0..variations).map(Some)) {
            tally.add(action, run(&folder, action, variation));
        }
        println!(
            "{action:22} {:>6} {:>6} {:>8.2}  {}",
            tally.played,
            tally.right,
            tally.slowed / f64::from(tally.played.max(1)),
            tally.others()
        );
        played += tally.played;
        right += tally.right;
    }
    println!(
        "{:22} {played:>6} {right:>6}  {:.1} %",
        "all",
        100.0 * f64::from(right) / f64::from(played)
    );
    std::fs::remove_dir_all(&folder).map_err(|e| Error::new(e.to_string()))
}

/// Plays an action, or a variation of it, and names what came back; how much slower it was.
fn run(
    folder: &Path,
    action: &str,
    variation: Option<u32>,
) -> Result<(Vec<RecognisedAction>, f64), Error> {
    let (file, recording) = (folder.join("varied.bvh"), folder.join("run.mcap"));
    let motion = match variation {
        None => action.to_owned(),
        Some(_) => {
            let order = SynthOrder {
                inserts: Default::default(),
                figures: Figures::read(&[])?,
                rate_hz: 120.0,
                seed: 1,
                database: Vec::new(),
                has_points: false,
                file: file.clone(),
                replace: true,
            };
            synth(&order, action, variation)?;
            file.display().to_string()
        }
    };
    let mut rig = open(ROBOT, "sim")?;
    let motion = rig.motion(&motion)?;
    let options = Options {
        record: Some(recording.clone()),
        replace: true,
        retime: Some(true),
        allow_fall: true,
        ..Options::default()
    };
    let report = rig.play(&motion, options)?;
    let slowed = report.retime_factor;
    let order = RecogniseOrder {
        motion: recording.display().to_string(),
        slowed: Some(slowed),
        ..Default::default()
    };
    Ok((recognise(&order, |_| ())?.events, slowed))
}

#[derive(Default)]
struct Tally {
    played: u32,
    right: u32,
    slowed: f64,
    others: BTreeMap<String, u32>,
}

impl Tally {
    fn add(&mut self, action: &str, run: Result<(Vec<RecognisedAction>, f64), Error>) {
        self.played += 1;
        let (events, slowed) = match run {
            Ok(run) => run,
            Err(error) => {
                *self.others.entry(format!("not played: {error}")).or_default() += 1;
                return;
            }
        };
        self.slowed += slowed;
        let name = |event: &RecognisedAction| match event.side {
            Some(side) => format!("{}-{}", event.action, &side.word()[..1]),
            None => event.action.clone(),
        };
        let mut names: Vec<String> = events.iter().map(name).collect();
        names.sort();
        names.dedup();
        let is_it = |name: &String| {
            name == action
                || name.strip_prefix(action).is_some_and(|side| ["-l", "-r"].contains(&side))
        };
        self.right += u32::from(names.iter().any(is_it));
        for name in names.into_iter().filter(|name| !is_it(name)) {
            *self.others.entry(name).or_default() += 1;
        }
    }

    fn others(&self) -> String {
        let others = self.others.iter().map(|(name, times)| format!("{name} {times} x"));
        others.collect::<Vec<_>>().join(", ")
    }
}
