//! Actions, from actionlets to what bodies and robots do with them.
//!
//! One program: what links once is built sooner, and whatever computes has both processors to the end.

#[path = "../aloud/mod.rs"]
mod aloud;
#[path = "../common/mod.rs"]
mod common;
#[allow(dead_code, reason = "running is compared elsewhere")]
#[path = "../gait/measured.rs"]
mod measured;
#[path = "../page/mod.rs"]
mod page;
#[path = "../program/mod.rs"]
mod program;
#[path = "../python/mod.rs"]
mod python;

use common::captured;

mod angles;
mod bodies;
mod bulk;
mod captures;
mod changes;
mod commands;
mod drawn;
mod files;
mod inserts;
mod labels_and_angles;
mod norms;
mod play;
mod properties;
mod variations;
mod vocabulary;
mod walk;
