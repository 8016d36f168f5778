//! What is pasted into a motion, as it is typed.

use crate::action::{Insert, Inserts, Meanwhile, NoSeam};
use clap::Args;

pub use crate::job::composition::told;

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
