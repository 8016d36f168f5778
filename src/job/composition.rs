//! From a phrase to one motion: actions in a row, gaits that go over into one another, inserts. And what
//! was done on the way, for reports.

use crate::action::phrase::{self, Part};
use crate::action::{
    Crossing, Fits, GaitChange, Inserted, Inserts, Join, Meanwhile, Motion, PastedTrack,
};
use crate::body::Dof;
use crate::error::Error;
use serde::Serialize;
use std::fmt::Write;

/// A motion, and what was done to make it.
#[derive(Clone, Debug)]
pub struct Composed {
    /// The motion.
    pub motion: Motion,
    /// Changes of gait without a stop. Their times are those before anything was inserted.
    pub changes: Vec<GaitChangeReport>,
    /// Inserts, in the order in which they were done.
    pub inserts: Vec<InsertReport>,
}

/// Performs a phrase, which is fitted already, and inserts what is to be inserted, fitted to the same body.
///
/// # Errors
/// If an action cannot be performed, joined or changed into another, or an insert is refused.
pub fn compose(
    parts: &[Part],
    join: Join,
    inserts: &Inserts,
    fits: &mut Fits,
) -> Result<Composed, Error> {
    let performed = phrase::performed_by(parts, join, fits.body())?;
    let (motion, inserted) = inserts.apply(performed.motion, fits)?;
    let told = inserts.list.iter().zip(&inserted);
    Ok(Composed {
        motion,
        changes: performed.changes.iter().map(GaitChangeReport::of).collect(),
        inserts: told
            .map(|(insert, done)| InsertReport::of(insert.source(), inserts.meanwhile, done))
            .collect(),
    })
}

impl Composed {
    /// What was done, a line each.
    #[must_use]
    pub fn notes(&self) -> Vec<String> {
        let change = |of: &GaitChangeReport| {
            format!("{} goes over into {} at {:.3} s without a stop", of.from, of.to, of.time_s)
        };
        let insert = |of: &InsertReport| {
            let dofs: Vec<&str> = of.dofs.iter().map(|dof| dof.dof).collect();
            let (from, to, at) = (of.from_s, of.to_s, of.target_s);
            let what = format!("{} from {from:.3} to {to:.3} s inserted at {at:.3} s", of.source);
            format!("{what}: {}", dofs.join(", "))
        };
        self.changes.iter().map(change).chain(self.inserts.iter().map(insert)).collect()
    }
}

/// What an insert did.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct InsertReport {
    /// What the piece was cut out of.
    pub source: String,
    /// Begin of the cut, s of the source.
    pub from_s: f64,
    /// End of the cut, s of the source.
    pub to_s: f64,
    /// Where it went, s of the motion before.
    pub target_s: f64,
    /// By how much the motion is longer in what the piece moves, s.
    pub longer_by_s: f64,
    /// What was pasted, by degree of freedom.
    pub dofs: Vec<PastedReport>,
    /// Degrees of freedom that move, but not in the cut.
    pub kept: Vec<&'static str>,
    /// What those do meanwhile: `go_on` or `wait`.
    pub meanwhile: &'static str,
}

/// What an insert did to a degree of freedom.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PastedReport {
    /// Name of the degree of freedom.
    pub dof: &'static str,
    /// Begin of its cut, s of the source.
    pub cut_from_s: f64,
    /// End of its cut, s of the source.
    pub cut_to_s: f64,
    /// By how much its cut was moved to a seam, s; 0 if it was not.
    pub cut_moved_s: f64,
    /// Its first seam in the cut, s of the source: what begins there and later was pasted.
    pub seam_s: f64,
    /// Where that begins, s of the motion.
    pub pasted_from_s: f64,
    /// Where it ends, s of the motion.
    pub pasted_to_s: f64,
    /// What is added to the angles of what follows, rad.
    pub angles_after_moved_rad: f64,
}

/// A change of gait without a stop.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GaitChangeReport {
    /// Name of the action before.
    pub from: String,
    /// Name of the action after.
    pub to: String,
    /// When the cycle of one ends and that of the other begins, s.
    pub time_s: f64,
    /// Phase of both there, in periods.
    pub phase: f64,
    /// How each degree of freedom goes over.
    pub dofs: Vec<CrossingReport>,
}

/// How a degree of freedom goes over from one gait into the other: by one actionlet.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CrossingReport {
    /// Name of the degree of freedom.
    pub dof: &'static str,
    /// When it leaves the one, at rest, s.
    pub left_s: f64,
    /// Angle there, rad.
    pub left_rad: f64,
    /// When it joins the other, at rest, s.
    pub joined_s: f64,
    /// Angle there, rad.
    pub joined_rad: f64,
}

impl InsertReport {
    fn of(source: &str, meanwhile: Meanwhile, done: &Inserted) -> Self {
        Self {
            source: source.to_owned(),
            from_s: done.cut.begin_s,
            to_s: done.cut.end_s,
            target_s: done.cut.target_s,
            longer_by_s: done.cut.length_s(),
            dofs: done.pasted.iter().map(PastedReport::of).collect(),
            kept: done.kept.iter().copied().map(Dof::name).collect(),
            meanwhile: match meanwhile {
                Meanwhile::GoesOn => "go_on",
                Meanwhile::Waits => "wait",
            },
        }
    }
}

impl PastedReport {
    fn of(track: &PastedTrack) -> Self {
        Self {
            dof: track.dof.name(),
            cut_from_s: track.cut_begin_s,
            cut_to_s: track.cut_end_s,
            cut_moved_s: track.cut_moved_s,
            seam_s: track.seam_s,
            pasted_from_s: track.from_s,
            pasted_to_s: track.to_s,
            angles_after_moved_rad: track.moved_rad,
        }
    }
}

impl GaitChangeReport {
    fn of(change: &GaitChange) -> Self {
        Self {
            from: change.from.clone(),
            to: change.to.clone(),
            time_s: change.time_s,
            phase: change.phase,
            dofs: change.crossings.iter().map(CrossingReport::of).collect(),
        }
    }
}

impl CrossingReport {
    fn of(crossing: &Crossing) -> Self {
        Self {
            dof: crossing.dof.name(),
            left_s: crossing.left_s,
            left_rad: crossing.left_rad,
            joined_s: crossing.joined_s,
            joined_rad: crossing.joined_rad,
        }
    }
}

/// What was done to make one motion, for a person; empty if it is one action as it is.
#[must_use]
pub fn told(changes: &[GaitChangeReport], inserts: &[InsertReport]) -> String {
    let mut text = String::new();
    for change in changes {
        let GaitChangeReport { from, to, time_s, phase, .. } = change;
        let _ = writeln!(text, "changed   {from} to {to} at {time_s:.3} s, phase {phase:.3}");
        for dof in &change.dofs {
            let _ = writeln!(
                text,
                "          {:<24} leaves {:>7.1} deg at {:.3} s, joins {:>7.1} deg at {:.3} s",
                dof.dof,
                dof.left_rad.to_degrees(),
                dof.left_s,
                dof.joined_rad.to_degrees(),
                dof.joined_s
            );
        }
    }
    for insert in inserts {
        let InsertReport { source, from_s, to_s, target_s, longer_by_s, .. } = insert;
        let _ = write!(text, "inserted  {source} from {from_s:.3} to {to_s:.3} s ");
        let _ = writeln!(text, "at {target_s:.3} s, {longer_by_s:.3} s longer");
        for dof in &insert.dofs {
            let moved = if dof.cut_moved_s == 0.0 {
                String::new()
            } else {
                let (from_s, to_s) = (dof.cut_from_s, dof.cut_to_s);
                format!(" (cut moved by {:+.3} to {from_s:.3} to {to_s:.3} s)", dof.cut_moved_s)
            };
            let (name, seam_s) = (dof.dof, dof.seam_s);
            let (begins_s, ends_s) = (dof.pasted_from_s, dof.pasted_to_s);
            let later_deg = dof.angles_after_moved_rad.to_degrees();
            let _ = write!(text, "          {name:<24} from its rest at {seam_s:.3} s{moved}: ");
            let _ = writeln!(
                text,
                "pasted at {begins_s:.3} to {ends_s:.3} s, later angles {later_deg:+.1} deg"
            );
        }
        let does = if insert.meanwhile == "wait" { "wait" } else { "go on" };
        if !insert.kept.is_empty() {
            let _ = writeln!(text, "          meanwhile {does}: {}", insert.kept.join(", "));
        }
    }
    text
}
