//! A picture of what a corpus has of a set, and whom it lacks.

use crate::corpus::coverage::{KnownPerson, NextPerson, hull};
use crate::corpus::sets::PlannedSet;
use crate::error::counted;
use std::fmt::Write as _;

/// Size of the two halves, px.
const HALF_PX: f64 = 480.0;
const HEIGHT_PX: f64 = 420.0;
const EDGE_PX: f64 = 50.0;
/// Squares of the trials: how many in a row, and how wide, px.
const IN_ROW: usize = 24;
const SQUARE_PX: f64 = 17.0;

/// What the shapes look like, in the light and in the dark.
const STYLE: &str = "<style>text{font:12px sans-serif;fill:#222}.hull{fill:#8881;stroke:#888}.known{fill:#0072b2}\
.next{fill:none;stroke:#d55e00;stroke-width:2}.done{fill:#009e73}.made{fill:#e69f00}.none{fill:none;stroke:#888}\
@media(prefers-color-scheme:dark){svg{background:#111}text{fill:#ddd}}</style>";

/// A trial that is asked for.
pub(super) struct Square<'a> {
    /// What it is called.
    pub name: &'a str,
    /// How many people are to do it.
    pub people: u32,
    /// How many did.
    pub done_by: usize,
    /// Trials of it that the program made.
    pub made: usize,
}

/// As SVG: people by stature and mass, with those who are to be asked next; and every trial as a square, filled if a
/// person did it, or if the program made it.
pub(super) fn drawn(
    set: PlannedSet,
    squares: &[Square<'_>],
    people: &[KnownPerson],
    next: &[NextPerson],
) -> String {
    let rows = squares.len().div_ceil(IN_ROW) as f64;
    let height = HEIGHT_PX.max(2.0 * EDGE_PX + 30.0 + rows * SQUARE_PX);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {} {height}\" role=\"img\" aria-label=\"coverage\">{STYLE}",
        2.0 * HALF_PX
    );
    let place = |stature_m: f64, mass_kg: f64| {
        let x = EDGE_PX + (stature_m - 0.95) / 1.1 * (HALF_PX - 2.0 * EDGE_PX);
        let y = HEIGHT_PX - EDGE_PX - mass_kg / 170.0 * (HEIGHT_PX - 2.0 * EDGE_PX);
        (x, y)
    };
    let corners: Vec<String> = hull()
        .iter()
        .map(|(stature, mass)| place(*stature, *mass))
        .map(|(x, y)| format!("{x:.1},{y:.1}"))
        .collect();
    let _ = write!(svg, "<polygon class=\"hull\" points=\"{}\"/>", corners.join(" "));
    let known = people.len();
    let _ = write!(
        svg,
        "<text x=\"{EDGE_PX}\" y=\"22\">{known} (dots), and whom to ask next (circles, in order)</text>",
        known = counted(known, "person")
    );
    for tenth in 10..=20 {
        let (x, y) = place(f64::from(tenth) / 10.0, 0.0);
        if tenth % 2 == 0 {
            let stature_m = f64::from(tenth) / 10.0;
            let _ = write!(
                svg,
                "<text x=\"{x:.0}\" y=\"{:.0}\" text-anchor=\"middle\">{stature_m:.1} m</text>",
                y + 18.0
            );
        }
    }
    for step in 0..=3 {
        let mass_kg = 50.0 * f64::from(step);
        let (x, y) = place(0.95, mass_kg);
        let _ = write!(
            svg,
            "<text x=\"{:.0}\" y=\"{y:.0}\" text-anchor=\"end\">{mass_kg:.0} kg</text>",
            x - 4.0
        );
    }
    for of in people {
        let (x, y) = place(of.stature_m, of.mass_kg);
        let _ = write!(
            svg,
            "<circle class=\"known\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4\"><title>{:.2} m, {:.0} kg</title></circle>",
            of.stature_m, of.mass_kg
        );
    }
    for (at, of) in next.iter().enumerate() {
        let (x, y) = place(of.stature_m, of.mass_kg);
        let _ = write!(
            svg,
            "<circle class=\"next\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"8\"><title>{:.2} m, {:.0} kg, {} to {}</title></circle>\
             <text x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
            of.stature_m,
            of.mass_kg,
            of.age_years[0],
            counted(of.age_years[1], "year"),
            y + 4.0,
            at + 1
        );
    }
    let done = squares.iter().filter(|of| of.done_by > 0).count();
    let made = squares.iter().filter(|of| of.done_by == 0 && of.made > 0).count();
    let left = HALF_PX + EDGE_PX;
    let _ = write!(
        svg,
        "<text x=\"{left}\" y=\"22\">{}: {}, {done} done by people (green), {made} only made (orange)</text>",
        set.word(),
        counted(squares.len(), "trial")
    );
    for (at, of) in squares.iter().enumerate() {
        let x = left + (at % IN_ROW) as f64 * SQUARE_PX * 0.95;
        let y = EDGE_PX + (at / IN_ROW) as f64 * SQUARE_PX;
        let class = match (of.done_by, of.made) {
            (1.., _) => "done",
            (0, 1..) => "made",
            _ => "none",
        };
        // Names are of small letters, digits and lines.
        let _ = write!(
            svg,
            "<rect class=\"{class}\" x=\"{x:.1}\" y=\"{y:.1}\" width=\"13\" height=\"13\"><title>{}: {} of {}</title></rect>",
            of.name, of.done_by, of.people
        );
    }
    svg.push_str("</svg>\n");
    svg
}
