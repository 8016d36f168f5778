//! What is wrong with a trial, in the words of Guerra-Filho and Biswas ("The human motion database: a cognitive and
//! parametric sampling of human motion", Image and Vision Computing 30, 2012) and one more: a marker that sticks.

use serde::{Deserialize, Serialize};
use std::ops::Range;

/// What is wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ArtefactKind {
    /// Somewhere else for a while.
    Jump,
    /// Trembling faster than a person does.
    Shake,
    /// A short blow that the others do not show.
    ImpactJerk,
    /// Not seen.
    Dropout,
    /// Off the person for good.
    Fallen,
    /// The names of two markers are exchanged from the first frame on.
    SwapAtStart,
    /// The names of two markers are exchanged for a while.
    SwapInside,
    /// The names of two markers are exchanged after one of them was not seen.
    SwapAfterGap,
    /// The same place again and again while the others move.
    Stuck,
    /// What a person saw, who edits by hand; nothing here finds it.
    ByHand,
}

impl ArtefactKind {
    /// The word for it, as in files.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Jump => "jump",
            Self::Shake => "shake",
            Self::ImpactJerk => "impact_jerk",
            Self::Dropout => "dropout",
            Self::Fallen => "fallen",
            Self::SwapAtStart => "swap_at_start",
            Self::SwapInside => "swap_inside",
            Self::SwapAfterGap => "swap_after_gap",
            Self::Stuck => "stuck",
            Self::ByHand => "by_hand",
        }
    }

    /// True if two markers have each other's names.
    #[must_use]
    pub const fn is_swap(self) -> bool {
        matches!(self, Self::SwapAtStart | Self::SwapInside | Self::SwapAfterGap)
    }
}

/// Why it is so, where that can be told.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// Something was in the way of the cameras: others around it were seen.
    Occlusion,
    /// Most markers were lost at the same time.
    LostTracking,
    /// It was made of rays of several markers, or given another's name.
    BadReconstruction,
    /// It came off.
    LooseAttachment,
    /// The skin under it moved.
    SkinMovement,
}

impl Cause {
    /// The words for it.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Self::Occlusion => "occlusion",
            Self::LostTracking => "lost tracking",
            Self::BadReconstruction => "bad reconstruction",
            Self::LooseAttachment => "loose attachment",
            Self::SkinMovement => "skin movement",
        }
    }
}

/// One thing that is wrong with one marker.
#[derive(Clone, Debug, PartialEq)]
pub struct Artefact {
    /// What.
    pub kind: ArtefactKind,
    /// Index of the marker.
    pub marker: usize,
    /// Of a swap, the other one.
    pub with: Option<usize>,
    /// Indices of the frames.
    pub frames: Range<usize>,
    /// Why, where that can be told.
    pub cause: Option<Cause>,
    /// How sure that is, 0 to 1.
    pub confidence: f64,
}
