//! A motion database one can ask: trials with who did them, what they are called and how they were done,
//! labels frame by frame, and the frames themselves, as Parquet tables in a folder.
//!
//! `trials`, `labels` and `frames` are partitioned by set and action, as `set=praxicon/action=kick/`;
//! `subjects.parquet` is one table. A corpus changes in whole steps ([`store`]), and has a
//! version: the hash of its rows, whatever the order in which they came.

pub mod coverage;
pub mod licence;
pub mod manifest;
pub mod query;
pub mod rows;
pub mod select;
pub mod sets;
pub mod store;
pub mod tables;
pub mod version;
