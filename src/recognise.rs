//! Naming what a body does, as it happens: the multiphase action recogniser of Salamah and Brunnett,
//! "Multiphase Action Representation for Online Classification of Motion Capture Data", 2016.
//!
//! ```text
//! poses -> points -> contact, posture -> features (a row of numbers a frame)
//!                                           |
//! model files -> model -> waiting -> machine (one for each model) -> events -> score
//! ```
//!
//! Nothing here knows where poses come from. Whatever a source does not show is unknown, never zero: a
//! model that needs it cannot fire. Where the paper's equations and its state machine cannot mean what they
//! say there are two readings ([`posture::EquationReading`]): the repaired one, and the strict one for comparison.

pub mod contact;
pub mod example;
pub mod explain;
pub mod features;
pub mod machine;
pub mod model;
pub mod points;
pub mod posture;
pub mod score;
pub mod stream;
pub mod waiting;
