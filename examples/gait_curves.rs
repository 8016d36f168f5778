//! The shipped walk and run beside measured people: hip, knee and ankle along the stride, and a
//! strip of stick figures. One HTML page on stdout.
//!
//! `cargo run --example gait_curves > gait.html`

#[path = "../tests/gait/measured.rs"]
mod measured;
#[path = "gait_curves/stick.rs"]
mod stick;

use gaitway::action::vocabulary;
use gaitway::body::{Dof, Proportions};
use gaitway::error::Error;
use measured::{Measured, RUNNING, WALKING};
use std::fmt::Write;

const WIDTH: f64 = 440.0;
const HEIGHT: f64 = 260.0;
const MARGIN: f64 = 34.0;
/// Poses per second of the strip.
const RATE_HZ: f64 = 240.0;

/// A joint's panel: line ours, circles measured; from -40 to 110 degrees over one stride.
fn panel(title: &str, ours_deg: &[f64], measured_deg: [f64; 20]) -> String {
    let x = |part: f64| MARGIN + part * (WIDTH - 2.0 * MARGIN);
    let y = |deg: f64| HEIGHT - MARGIN - (deg + 40.0) / 150.0 * (HEIGHT - 2.0 * MARGIN);
    let mut drawn = String::new();
    for deg in [-30.0, 0.0, 30.0, 60.0, 90.0] {
        let _ = write!(
            drawn,
            "<line x1='{MARGIN}' x2='{}' y1='{y:.1}' y2='{y:.1}' stroke='#ddd'/>\
             <text x='2' y='{y:.1}'>{deg}°</text>",
            WIDTH - MARGIN,
            y = y(deg)
        );
    }
    let mut points = String::new();
    for (sample, deg) in ours_deg.iter().enumerate() {
        let part = sample as f64 / (ours_deg.len() - 1) as f64;
        let _ = write!(points, "{:.1},{:.1} ", x(part), y(*deg));
    }
    let line = "fill='none' stroke='#1f5fbf' stroke-width='2'";
    let _ = write!(drawn, "<polyline points='{points}' {line}/>");
    for (sample, deg) in measured_deg.into_iter().enumerate() {
        let (x, y) = (x(sample as f64 / 20.0), y(deg));
        let _ = write!(drawn, "<circle cx='{x:.1}' cy='{y:.1}' r='3' fill='#c0392b'/>");
    }
    format!(
        "<svg viewBox='0 0 {WIDTH} {HEIGHT}' width='{WIDTH}'><text x='{MARGIN}' y='16'>{title}\
         </text>{drawn}<text x='{MARGIN}' y='{foot}'>contact</text><text x='{}' y='{foot}' \
         text-anchor='end'>next contact</text></svg>",
        WIDTH - MARGIN,
        foot = HEIGHT - 10.0
    )
}

fn action(name: &str, measured: &Measured) -> Result<String, Error> {
    let action = vocabulary::find(name)?;
    let motion = action.perform()?;
    let begin_s = 1.5 * action.duration_s;
    let curve = |dof| -> Vec<f64> {
        let part = |sample: u32| begin_s + f64::from(sample) / 100.0 * action.duration_s;
        (0..=100).map(|sample| motion.at(dof, part(sample)).position_rad.to_degrees()).collect()
    };
    let hip_deg = measured.hip_deg.map(|hip| hip - measured.pelvis_deg);
    let mut page = format!("<h2>{name}</h2>");
    page += &panel("hip flexion", &curve(Dof::LeftHipFlexion), hip_deg);
    page += &panel("knee flexion", &curve(Dof::LeftKneeFlexion), measured.knee_deg);
    page += &panel("ankle dorsiflexion", &curve(Dof::LeftAnkleDorsiflexion), measured.ankle_deg);
    let body = Proportions::of_stature(1.75)?;
    let poses = motion.poses(&body, RATE_HZ)?;
    let figures: Vec<(String, _)> = (0..=10u32)
        .filter_map(|tenth| {
            let time_s = begin_s + f64::from(tenth) / 10.0 * action.duration_s;
            let pose = poses.get((time_s * RATE_HZ).round() as usize)?;
            Some((format!("{} %", tenth * 10), body.positions(pose)))
        })
        .collect();
    page += &stick::strip(&figures);
    Ok(page)
}

fn main() -> Result<(), Error> {
    println!(
        "<!DOCTYPE html><html lang='en'><meta charset='utf-8'><title>Gait</title>\
         <style>body{{font:14px sans-serif;margin:24px}}text{{font-size:12px}}</style>\
         <h1>Left leg of the actions (lines) and measured people (dots)</h1>{}{}</html>",
        action("walk", &WALKING)?,
        action("run", &RUNNING)?
    );
    Ok(())
}
