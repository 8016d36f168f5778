//! The knee and hip of running as actionlets, arranged as Fig. 5 of Zheng et al., "Human Motion
//! Simulation and Action Corpus", 2007, and the body at the six positions A to F, as in its Fig. 4:
//! one HTML page on stdout.
//!
//! `cargo run --example running_curves > running.html`

#[path = "gait_curves/stick.rs"]
mod stick;

use gaitway::action::{Motion, vocabulary};
use gaitway::actionlet::Actionlet;
use gaitway::body::{Dof, Proportions};
use gaitway::error::Error;
use std::fmt::Write;

/// The paper's temporal resolution.
const RATE_HZ: f64 = 3000.0;
const KNEE: Dof = Dof::RightKneeFlexion;
const HIP: Dof = Dof::RightHipFlexion;
const WIDTH: f64 = 900.0;
const HEIGHT: f64 = 260.0;
const MARGIN: f64 = 40.0;

/// A panel over some seconds, from -20 to 100 degrees.
struct Panel {
    from_s: f64,
    to_s: f64,
    body: String,
}

impl Panel {
    fn x(&self, time_s: f64) -> f64 {
        MARGIN + (time_s - self.from_s) / (self.to_s - self.from_s) * (WIDTH - 2.0 * MARGIN)
    }

    fn y(angle_rad: f64) -> f64 {
        HEIGHT - MARGIN - (angle_rad.to_degrees() + 20.0) / 120.0 * (HEIGHT - 2.0 * MARGIN)
    }

    fn curve(&mut self, motion: &Motion, dof: Dof, style: &str) {
        let mut points = String::new();
        let poses = ((self.to_s - self.from_s) * RATE_HZ) as usize;
        for pose in 0..=poses {
            let time_s = self.from_s + pose as f64 / RATE_HZ;
            let y = Self::y(motion.at(dof, time_s).position_rad);
            let _ = write!(points, "{:.2},{y:.2} ", self.x(time_s));
        }
        let _ = writeln!(self.body, "<polyline points='{points}' fill='none' {style}/>");
    }

    fn mark(&mut self, name: &str, time_s: f64, angle_rad: f64) {
        let (x, y) = (self.x(time_s), Self::y(angle_rad));
        let _ = writeln!(
            self.body,
            "<circle cx='{x:.1}' cy='{y:.1}' r='4'/><text x='{:.1}' y='{:.1}'>{name}</text>",
            x + 6.0,
            y - 6.0
        );
    }

    fn span(&mut self, name: &str, from_s: f64, to_s: f64, y: f64) {
        let (a, b) = (self.x(from_s), self.x(to_s));
        let _ = writeln!(
            self.body,
            "<line x1='{a:.1}' x2='{b:.1}' y1='{y}' y2='{y}' stroke='#888'/>\
             <text x='{:.1}' y='{}' text-anchor='middle'>{name}</text>",
            f64::midpoint(a, b),
            y - 4.0
        );
    }

    fn svg(&self, title: &str) -> String {
        let foot = HEIGHT - MARGIN + 24.0;
        let mut axis = String::new();
        for angle_deg in [0.0, 50.0, 100.0f64] {
            let y = Self::y(angle_deg.to_radians());
            let _ = write!(
                axis,
                "<line x1='{MARGIN}' x2='{}' y1='{y:.1}' y2='{y:.1}' stroke='#ddd'/>\
                 <text x='4' y='{y:.1}'>{angle_deg}°</text>",
                WIDTH - MARGIN
            );
        }
        format!(
            "<h2>{title}</h2><svg viewBox='0 0 {WIDTH} {HEIGHT}' width='{WIDTH}'>{axis}{}\
             <text x='{MARGIN}' y='{foot}'>{:.3} s</text>\
             <text x='{}' y='{foot}' text-anchor='end'>{:.3} s</text></svg>\n",
            self.body,
            self.from_s,
            WIDTH - MARGIN,
            self.to_s
        )
    }
}

/// Actionlets of a degree of freedom that begin at or after a time.
fn pieces(motion: &Motion, dof: Dof, from_s: f64) -> Vec<&Actionlet> {
    let all = motion.track(dof).actionlets().iter();
    all.filter(|piece| piece.begin_s() >= from_s - 1e-9).collect()
}

/// The body at A to E, where an actionlet of the knee begins, and at F, where the last one ends.
fn postures(motion: &Motion, cycle: &[&Actionlet]) -> Result<String, Error> {
    let body = Proportions::of_stature(1.75)?;
    let poses = motion.poses(&body, RATE_HZ)?;
    let seams_s = cycle.iter().map(|piece| piece.begin_s());
    let seams_s = seams_s.chain(cycle.last().map(|piece| piece.end_s()));
    let figures: Vec<_> = ["A", "B", "C", "D", "E", "F"]
        .into_iter()
        .zip(seams_s)
        .filter_map(|(name, time_s)| {
            let pose = poses.get((time_s * RATE_HZ).round() as usize)?;
            Some((name.to_owned(), body.positions(pose)))
        })
        .collect();
    Ok(stick::strip(&figures))
}

fn main() -> Result<(), Error> {
    let run = vocabulary::find("run")?;
    let motion = run.perform()?;
    // A: contact, where the knee begins to flex in stance, which is the smaller flexion; X: where
    // the hip begins to extend.
    let knee = pieces(&motion, KNEE, 1.2);
    let contact = |piece: &&Actionlet| (0.0..0.6).contains(&piece.change_rad());
    let cycle = knee.iter().position(contact).and_then(|at| knee.get(at..at + 5));
    let cycle = cycle.ok_or_else(|| Error::new("the knee does not go round"))?;
    let (a_s, e_s) = (cycle[0].begin_s(), cycle[4].begin_s());
    let hip = pieces(&motion, HIP, a_s - 0.3 * run.duration_s);
    let extends = hip.iter().find(|piece| piece.change_rad() < 0.0);
    let x_s = extends.map_or(a_s, |piece| piece.begin_s());
    let z_s = x_s + run.duration_s;
    let panel = || Panel { from_s: a_s - 0.2, to_s: a_s + 0.9, body: String::new() };
    let (red, blue) = ("stroke='#c0392b' stroke-width='2'", "stroke='#1f5fbf' stroke-width='2'");
    let mut knees = panel();
    knees.curve(&motion, KNEE, red);
    for (name, piece) in ["A", "B", "C", "D", "E"].into_iter().zip(cycle) {
        knees.mark(name, piece.begin_s(), piece.from_rad());
    }
    knees.mark("F", cycle[4].end_s(), cycle[4].to_rad());
    let mut both = panel();
    both.curve(&motion, KNEE, red);
    both.curve(&motion, HIP, blue);
    both.mark("X", x_s, motion.at(HIP, x_s).position_rad);
    both.mark("Z", z_s, motion.at(HIP, z_s).position_rad);
    both.mark("A", a_s, motion.at(KNEE, a_s).position_rad);
    both.mark("E", e_s, motion.at(KNEE, e_s).position_rad);
    both.span("|A - X|", x_s, a_s, 14.0);
    both.span("|E - A| = |Z - X|", a_s, e_s, 32.0);
    let mut mutated = panel();
    for (peak_at, dash) in [(0.3, ""), (0.5, " stroke-dasharray='3 4'")] {
        let motion = run.clone().with_peak(peak_at)?.perform()?;
        mutated.curve(&motion, KNEE, &format!("{red}{dash}"));
        mutated.curve(&motion, HIP, &format!("{blue}{dash}"));
    }
    println!(
        "<!DOCTYPE html><html lang='en'><meta charset='utf-8'><title>Running</title>\
         <style>body{{font:14px sans-serif;margin:24px}}text{{font-size:13px}}</style>\
         <h1>Running at {RATE_HZ} frames a second</h1>{}{}{}{}</html>",
        postures(&motion, cycle)?,
        knees.svg("(a) right knee: actionlets AB, BC, CD, DE"),
        both.svg("(b) right knee (red) and hip (blue): equal periods, a phase between"),
        mutated.svg("(c) knee and hip with T = 0.3 (solid) and T = 0.5 (dotted)")
    );
    Ok(())
}
