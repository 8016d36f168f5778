//! Markers cleaned: what is wrong with a trial is found, and mended by a list of edits that can be read, changed,
//! undone and applied again.
//!
//! [`trial`] is the markers over time, [`neighbours`] which go with which. [`artefact`] names what may be wrong.
//! [`fill`] fills gaps in five ways and [`choice`] finds out which is best for a gap, on the
//! trial itself. [`edits`] is the list, and what it does. What is seen and is not named by an edit stays as it is, bit for
//! bit: [`sha256`] shows it. [`joints`] looks at skeletons. [`thresholds`] is what a corpus of trials allows itself.
//!
//! Here places are in metres, in the axes of the file.

pub mod artefact;
pub mod choice;
pub mod detect;
mod edge;
pub mod edits;
pub mod fill;
pub mod joints;
pub mod neighbours;
pub mod regression;
pub mod sha256;
pub mod source;
pub mod thresholds;
pub mod trial;
