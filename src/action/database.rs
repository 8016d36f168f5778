//! Actionlets of many actions, by type. The actions themselves are files: shipped ones and those of
//! folders, synthesised and captured alike.

use crate::action::{Action, vocabulary};
use crate::actionlet::Shape;
use crate::body::Dof;
use crate::error::Error;
use std::collections::BTreeMap;
use std::path::Path;

/// Angle changes below this are rests, rad (0.1 deg).
const REST_RAD: f64 = 0.1 * core::f64::consts::PI / 180.0;
/// Most files of a folder.
const MAX_FILES: usize = 100_000;

/// How far an actionlet goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum RangeClass {
    /// Below 15 degrees.
    Small,
    /// 15 to 45 degrees.
    Medium,
    /// Above 45 degrees.
    Large,
}

/// What makes actionlets one type, beside the degree of freedom and the direction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Types {
    /// How far they go, too (ours).
    #[default]
    ByRange,
    /// Nothing else, as in Zheng et al. 2007, Fig. 5a: of the four actionlets of a running knee the
    /// two that bend it are one type, and the two that stretch it another.
    ByDirection,
}

/// Actionlets of one type can stand for one another: they move the same degree of freedom in the
/// same direction and, with [`Types::ByRange`], about as far. Left and right count as the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Type {
    /// What moves; for a pair of limbs the left one.
    pub dof: Dof,
    /// Whether the angle grows.
    pub grows: bool,
    /// How far; none if that does not matter.
    pub range: Option<RangeClass>,
}

impl Type {
    /// The type of an actionlet by its range; none for a rest.
    #[must_use]
    pub fn of(dof: Dof, change_rad: f64) -> Option<Self> {
        let range = match change_rad.abs().to_degrees() {
            d if d < 15.0 => RangeClass::Small,
            d if d <= 45.0 => RangeClass::Medium,
            _ => RangeClass::Large,
        };
        let (other, sign) = dof.mirrored();
        let dof = if sign > 0.0 { dof.min(other) } else { dof };
        (change_rad.abs() > REST_RAD).then_some(Self {
            dof,
            grows: change_rad > 0.0,
            range: Some(range),
        })
    }
}

/// An actionlet of an action, and where it comes from.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// Its velocity function.
    pub shape: Shape,
    /// How far it goes, rad.
    pub change_rad: f64,
    /// How long it takes, s.
    pub duration_s: f64,
    /// The degree of freedom it was found at.
    pub dof: Dof,
    /// Name of the action.
    pub action: String,
    /// Where the action came from, in its own words.
    pub source: String,
}

/// Actions and their actionlets.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Database {
    types: Types,
    actions: BTreeMap<String, Action>,
    entries: BTreeMap<Type, Vec<Entry>>,
}

impl Database {
    /// The actions that ship with gaitway, their actionlets by range.
    ///
    /// # Errors
    /// As [`vocabulary::find`].
    pub fn shipped() -> Result<Self, Error> {
        Self::shipped_by(Types::default())
    }

    /// The actions that ship with gaitway, their actionlets by these types.
    ///
    /// # Errors
    /// As [`vocabulary::find`].
    pub fn shipped_by(types: Types) -> Result<Self, Error> {
        let mut database = Self { types, ..Self::default() };
        for name in vocabulary::names() {
            database.insert(vocabulary::find(name)?)?;
        }
        Ok(database)
    }

    /// Adds every action file (.toml) of a folder, in order of their names.
    ///
    /// # Errors
    /// If the folder or a file cannot be read, or a file is no action.
    pub fn add_folder(&mut self, folder: &Path) -> Result<(), Error> {
        let unreadable = |e: std::io::Error| {
            Error::new("cannot read a folder of actions")
                .at(folder.display().to_string())
                .got(e.to_string())
        };
        let mut paths = Vec::new();
        for entry in std::fs::read_dir(folder).map_err(unreadable)?.take(MAX_FILES) {
            let path = entry.map_err(unreadable)?.path();
            if path.extension().is_some_and(|e| e == "toml") {
                paths.push(path);
            }
        }
        paths.sort();
        for path in paths {
            self.insert(vocabulary::read(&path)?)?;
        }
        Ok(())
    }

    /// Adds an action and its actionlets; one of the same name is replaced.
    ///
    /// # Errors
    /// If the action cannot be performed.
    pub fn insert(&mut self, action: Action) -> Result<(), Error> {
        let motion = action.perform()?;
        if self.actions.remove(&action.name).is_some() {
            for entries in self.entries.values_mut() {
                entries.retain(|entry| entry.action != action.name);
            }
        }
        for (dof, piece) in motion.moving() {
            let Some(kind) = self.type_of(dof, piece.change_rad()) else { continue };
            let entry = Entry {
                shape: piece.shape().clone(),
                change_rad: piece.change_rad(),
                duration_s: piece.duration_s(),
                dof,
                action: action.name.clone(),
                source: action.source.clone(),
            };
            let entries = self.entries.entry(kind).or_default();
            // Rounds of a cycle repeat one another.
            if !entries.contains(&entry) {
                entries.push(entry);
            }
        }
        self.actions.insert(action.name.clone(), action);
        Ok(())
    }

    /// The type of an actionlet here; none for a rest.
    #[must_use]
    pub fn type_of(&self, dof: Dof, change_rad: f64) -> Option<Type> {
        let by_range = Type::of(dof, change_rad)?;
        Some(match self.types {
            Types::ByRange => by_range,
            Types::ByDirection => Type { range: None, ..by_range },
        })
    }

    /// Actionlets of a type, in the order in which they came in.
    #[must_use]
    pub fn of_type(&self, kind: Type) -> &[Entry] {
        self.entries.get(&kind).map_or(&[], Vec::as_slice)
    }

    /// Types and their actionlets.
    pub fn types(&self) -> impl Iterator<Item = (Type, &[Entry])> {
        self.entries.iter().map(|(kind, entries)| (*kind, entries.as_slice()))
    }

    /// An action by name.
    #[must_use]
    pub fn action(&self, name: &str) -> Option<&Action> {
        self.actions.get(name)
    }
}
