//! A model of an action: ordered phases, each a partial pose state. What a phase does not name may be anything.
//!
//! Compiled from a file ([`mod@file`]) to conditions on rows of features, so that a machine does nothing but
//! compare numbers. What is not a number is in no range.

pub mod file;
pub mod vocabulary;

use super::features::{Feature, FeatureRow};
use std::collections::BTreeSet;

/// Numbers from one to another, both among them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FeatureRange {
    /// The least.
    pub from: f64,
    /// The greatest.
    pub to: f64,
}

impl FeatureRange {
    /// All numbers.
    pub const ANY: Self = Self { from: f64::NEG_INFINITY, to: f64::INFINITY };

    /// Whether a number is in it; what is not a number is not.
    #[must_use]
    pub fn holds(&self, value: f64) -> bool {
        value >= self.from && value <= self.to
    }

    /// The part that it shares with another; its end is before its beginning if there is none.
    #[must_use]
    pub fn shared(&self, other: &Self) -> Self {
        Self { from: self.from.max(other.from), to: self.to.min(other.to) }
    }

    /// Whether no number is in it.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.from > self.to
    }

    fn negated(self) -> Self {
        Self { from: -self.to, to: -self.from }
    }
}

/// That a feature is in a range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Condition {
    /// Which.
    pub feature: Feature,
    /// Where.
    pub range: FeatureRange,
}

/// How far and how fast a part moves in a phase.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Travel {
    /// Its motion along an axis.
    pub feature: Feature,
    /// -1 for backward, down and right.
    pub sign: f64,
    /// The signed sum over the phase, limb lengths.
    pub amount: FeatureRange,
    /// That over the phase's duration, limb lengths per second.
    pub speed: FeatureRange,
}

/// What kind of a demand was not met.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Demand {
    /// Of each frame: a feature in a range.
    Frame,
    /// Of each frame: a posture, one of several.
    Posture,
    /// When the phase ends: how far a part has moved.
    Amount,
    /// When the phase ends: how fast it moved on average.
    Speed,
    /// When the phase ends: the mean of a feature.
    Average,
    /// How long the phase lasts.
    Duration,
}

/// A demand of a phase that was not met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shortfall {
    /// What kind of demand.
    pub demand: Demand,
    /// Of which feature; of several postures the first. None for a duration.
    pub feature: Option<Feature>,
    /// What there was; not a number where the source does not show it.
    pub value: f64,
    /// What was asked for.
    pub range: FeatureRange,
}

impl Shortfall {
    /// How far it was out of the range: above zero beyond its end, below zero before its beginning, not a number
    /// where there was none.
    #[must_use]
    pub fn by(&self) -> f64 {
        if self.value < self.range.from {
            self.value - self.range.from
        } else if self.value > self.range.to {
            self.value - self.range.to
        } else if self.value.is_nan() {
            f64::NAN
        } else {
            0.0
        }
    }
}

/// One phase.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelPhase {
    /// Its name in the model.
    pub name: String,
    /// What every frame must be; all of one of the alternatives beside it.
    pub gates: Vec<Condition>,
    /// Postures of which one must be; empty for any.
    pub postures: Vec<Feature>,
    /// What must have moved when it ends.
    pub travels: Vec<Travel>,
    /// What must hold of the mean over its frames when it ends.
    pub means: Vec<Condition>,
    /// Shortest, s.
    pub shortest_s: f64,
    /// Longest, s.
    pub longest_s: f64,
    /// It is over as soon as it may be: what follows, or that all is done, waits for no frame that ends it.
    pub ends_soon: bool,
}

impl ModelPhase {
    /// Whether a frame can belong to it.
    #[must_use]
    pub fn fits(&self, row: &FeatureRow) -> bool {
        self.gates.iter().all(|gate| gate.range.holds(row.value(gate.feature)))
            && (self.postures.is_empty()
                || self.postures.iter().any(|posture| row.value(*posture) == 1.0))
    }

    /// Why a frame cannot belong to it; empty if it can.
    #[must_use]
    pub fn misfits(&self, row: &FeatureRow) -> Vec<Shortfall> {
        let out = self.gates.iter().filter(|gate| !gate.range.holds(row.value(gate.feature)));
        let mut misfits: Vec<Shortfall> = out
            .map(|gate| Shortfall {
                demand: Demand::Frame,
                feature: Some(gate.feature),
                value: row.value(gate.feature),
                range: gate.range,
            })
            .collect();
        if let Some(first) = self.postures.first()
            && !self.postures.iter().any(|posture| row.value(*posture) == 1.0)
        {
            misfits.push(Shortfall {
                demand: Demand::Posture,
                feature: Some(*first),
                value: row.value(*first),
                range: FeatureRange { from: 1.0, to: 1.0 },
            });
        }
        misfits
    }

    /// What it looks at.
    pub fn needs(&self) -> impl Iterator<Item = Feature> + '_ {
        let conditions = self.gates.iter().chain(&self.means).map(|condition| condition.feature);
        let travels = self.travels.iter().map(|travel| travel.feature);
        conditions.chain(travels).chain(self.postures.iter().copied())
    }

    fn mirrored(&self) -> Self {
        let conditions = |conditions: &[Condition]| {
            let mirrored = conditions.iter().map(|condition| {
                let (feature, sign) = condition.feature.mirrored();
                let range = if sign < 0.0 { condition.range.negated() } else { condition.range };
                Condition { feature, range }
            });
            mirrored.collect()
        };
        let travels = self.travels.iter().map(|travel| {
            let (feature, sign) = travel.feature.mirrored();
            Travel { feature, sign: travel.sign * sign, ..*travel }
        });
        Self {
            gates: conditions(&self.gates),
            means: conditions(&self.means),
            travels: travels.collect(),
            ..self.clone()
        }
    }
}

/// A side of the body.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize,
)]
#[serde(rename_all = "lowercase")]
pub enum BodySide {
    /// The person's left.
    Left,
    /// The person's right.
    Right,
}

impl BodySide {
    /// The other one.
    #[must_use]
    pub const fn mirrored(self) -> Self {
        match self {
            Self::Left => Self::Right,
            Self::Right => Self::Left,
        }
    }

    /// `left` or `right`.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Left => "left",
            Self::Right => "right",
        }
    }
}

/// A model of an action.
#[derive(Clone, Debug, PartialEq)]
pub struct ActionModel {
    /// Its own name, that of its file.
    pub name: String,
    /// The action it shows; several models may show one.
    pub action: String,
    /// The side on which, where the action has one.
    pub side: Option<BodySide>,
    /// What it shows, a sentence.
    pub note: String,
    /// Where it comes from.
    pub source: String,
    /// Other words for the action, in the labels of clips.
    pub also: Vec<String>,
    /// Longest time between two phases, s.
    pub gap_s: f64,
    /// Longest interruption of a phase, s.
    pub slack_s: f64,
    /// So many of the first phases are optional.
    pub leading: usize,
    /// Phases in their order, at least one of them not optional.
    pub phases: Vec<ModelPhase>,
}

impl ActionModel {
    /// The model seen in a mirror.
    #[must_use]
    pub fn mirrored(&self) -> Self {
        Self {
            side: self.side.map(BodySide::mirrored),
            phases: self.phases.iter().map(ModelPhase::mirrored).collect(),
            ..self.clone()
        }
    }

    /// What it looks at but in leading phases: without one of these it cannot fire.
    #[must_use]
    pub fn needs(&self) -> BTreeSet<Feature> {
        self.phases[self.leading..].iter().flat_map(ModelPhase::needs).collect()
    }
}
