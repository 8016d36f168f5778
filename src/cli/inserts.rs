//! What is pasted into a motion, as it is typed, and what was done, as it is told.

use crate::action::{Insert, Inserts, Meanwhile, NoSeam};
use crate::job::composition::{GaitChangeReport, InsertReport};
use clap::Args;
use std::fmt::Write;

/// Pieces of other actions that are pasted in.
#[derive(Clone, Debug, Default, Args)]
pub struct InsertArgs {
    /// Paste a piece of another action in, from and to times of its own, at a time of the motion:
    /// bow:0.5s..1.4s@3.6s; all of it: bow@3.6s. May be given several times; they are done in order,
    /// each into what the one before made
    #[arg(long, value_name = "ACTION:FROM..TO@TIME")]
    insert: Vec<Insert>,
    /// Where a joint does not come to rest in the cut, move its cut to its nearest rest, instead of
    /// refusing the insert
    #[arg(long, requires = "insert")]
    insert_nearest: bool,
    /// What follows the piece keeps its angles; refused where the last movement would turn around
    /// [default: it is moved by as much as the piece ends elsewhere]
    #[arg(long, requires = "insert")]
    insert_keep_end: bool,
    /// What the piece does not move waits for it, so that all stay in step [default: it goes on]
    #[arg(long, requires = "insert")]
    insert_wait: bool,
}

impl InsertArgs {
    /// What is to be inserted.
    #[must_use]
    pub fn order(&self) -> Inserts {
        Inserts {
            list: self.insert.clone(),
            no_seam: if self.insert_nearest { NoSeam::Moved } else { NoSeam::Refused },
            keep_end: self.insert_keep_end,
            meanwhile: if self.insert_wait { Meanwhile::Waits } else { Meanwhile::GoesOn },
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
