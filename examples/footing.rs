//! How the shipped actions, or the files named, stand on their feet: a table.

use gaitway::action::{Action, vocabulary};
use gaitway::body::Proportions;
use gaitway::body::contact::Footing;
use gaitway::error::Error;
use std::path::Path;

const RATE_HZ: f64 = 250.0;

fn main() -> Result<(), Error> {
    let files: Vec<String> = std::env::args().skip(1).collect();
    let body = Proportions::of_stature(1.75)?;
    println!(
        "{:22} {:>7} {:>7} {:>8} {:>6} {:>6} {:>6} {:>6} {:>7} {:>7}",
        "", "lowest", "slide", "root", "both", "flight", "force", "force", "furthest", "at last"
    );
    println!(
        "{:22} {:>7} {:>7} {:>8} {:>6} {:>6} {:>6} {:>6} {:>7} {:>7}",
        "", "mm", "mm", "m/s2", "%", "%", "1 %", "99 %", "m", "m"
    );
    let actions: Vec<Action> = if files.is_empty() {
        vocabulary::names().map(vocabulary::find).collect::<Result<_, _>>()?
    } else {
        files.iter().map(|file| vocabulary::read(Path::new(file))).collect::<Result<_, _>>()?
    };
    for action in actions {
        let poses = action.perform()?.poses(&body, RATE_HZ)?;
        let footing = Footing::of(&body, &poses, RATE_HZ)?;
        let (furthest_m, last_m) = footing.travel_m();
        println!(
            "{:22} {:7.2} {:7.1} {:8.1} {:6.1} {:6.1} {:6.2} {:6.2} {:7.3} {:7.3}",
            action.name,
            footing.lowest_m() * 1e3,
            footing.slide_m() * 1e3,
            footing.root_acceleration_m_s2(),
            footing.both_feet(0..poses.len()) * 1e2,
            footing.flying(0..poses.len()) * 1e2,
            footing.force_quantile(0.01),
            footing.force_quantile(0.99),
            furthest_m,
            last_m,
        );
    }
    Ok(())
}
