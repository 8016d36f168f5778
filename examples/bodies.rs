//! How other bodies stand on their feet while they do the shipped actions, or those named: a table.

use gaitway::action::{Action, Fits, vocabulary};
use gaitway::body::contact::Footing;
use gaitway::body::{BodyFigure, Proportions, Sex};
use gaitway::error::Error;

const RATE_HZ: f64 = 240.0;

/// Bodies that are asked for, by what is asked.
fn bodies() -> Result<Vec<(&'static str, Proportions)>, Error> {
    let usual = Proportions::of_stature(1.75)?;
    // Its legs, as they are measured, are 0.971 m long.
    let leg_m = 0.971;
    Ok(vec![
        ("1.75", usual),
        ("female", usual.of_sex(Some(Sex::Female))),
        ("male", usual.of_sex(Some(Sex::Male))),
        ("0.9", Proportions::of_stature(0.9)?),
        ("1.2", Proportions::of_stature(1.2)?),
        ("1.5", Proportions::of_stature(1.5)?),
        ("1.9", Proportions::of_stature(1.9)?),
        ("2.1", Proportions::of_stature(2.1)?),
        ("drillis", Proportions::of_figure(BodyFigure::DrillisContini, 1.75)?),
        ("leg x0.7", usual.with_leg_length_m(0.7 * leg_m)?),
        ("leg x1.15", usual.with_leg_length_m(1.15 * leg_m)?),
    ])
}

fn main() -> Result<(), Error> {
    let mut names: Vec<String> = std::env::args().skip(1).collect();
    if names.is_empty() {
        names = vocabulary::names().map(str::to_owned).collect();
    }
    let actions: Vec<Action> =
        names.iter().map(|name| vocabulary::find(name)).collect::<Result<_, _>>()?;
    println!("sinks, mm; slides, mm; root, m/s2");
    for (asked, body) in bodies()? {
        let mut fits = Fits::of(body);
        for action in &actions {
            let begun = std::time::Instant::now();
            let action = fits.fit(action)?;
            let took_s = begun.elapsed().as_secs_f64();
            let poses = action.perform()?.poses(&body, RATE_HZ)?;
            let footing = Footing::of(&body, &poses, RATE_HZ)?;
            println!(
                "{asked:10} {:22} {:6.1} {:6.1} {:6.1} {took_s:.1}",
                action.name,
                -footing.lowest_m() * 1e3,
                footing.slide_m() * 1e3,
                footing.root_acceleration_m_s2(),
            );
        }
    }
    Ok(())
}
