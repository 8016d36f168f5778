//! Corpora of motions.
//!
//! One program: what links once is built sooner, and whatever computes has both processors to the end.

#[path = "../aloud/mod.rs"]
mod aloud;
#[path = "../program/mod.rs"]
mod program;
#[path = "../python/mod.rs"]
mod python;

mod corpus;
mod from_others;
mod lerobot;
mod plan;
mod sets;
mod splicing;
