//! Every name that gaitway knows without a file: what may be typed where.

use super::corpus::ExportFormat;
use super::profile::ProfileList;
use super::report::Outcome;
use crate::action::vocabulary;
use crate::corpus::sets::PlannedSet;
use crate::error::{Error, ErrorKind};
use crate::job::report::counted;
use crate::mocap::fit::marker_set::MarkerSet;
use crate::recognise::model::vocabulary as models;
use serde::Serialize;
use std::fmt::Write;

/// Letters in a line of names.
const LINE: usize = 96;

/// All names, or those of one kind.
#[derive(Debug, Serialize)]
pub struct KnownNames {
    /// Always `done`.
    pub outcome: Outcome,
    /// Kind by kind.
    pub kinds: Vec<NamesOfKind>,
}

/// The names of one kind.
#[derive(Debug, Serialize)]
pub struct NamesOfKind {
    /// The kind, as it is asked for.
    pub kind: &'static str,
    /// Where such a name is typed.
    pub used_in: &'static str,
    /// The names.
    pub names: Vec<KnownName>,
}

/// A name.
#[derive(Debug, Serialize)]
pub struct KnownName {
    /// As it is typed.
    pub name: String,
    /// What it stands for.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub words: String,
}

impl KnownNames {
    /// The names of this kind, or all.
    ///
    /// # Errors
    /// No such kind.
    pub fn of(kind: Option<&str>) -> Result<Self, Error> {
        let mut kinds = all()?;
        if let Some(word) = kind {
            if !kinds.iter().any(|of| of.kind == word) {
                let known = kinds.iter().map(|of| of.kind);
                return Err(Error::of(ErrorKind::Unknown, "no kind of names is called so")
                    .none_of(word, known, "take one of these"));
            }
            kinds.retain(|of| of.kind == word);
        }
        Ok(Self { outcome: Outcome::Done, kinds })
    }

    /// One kind with what each name stands for; of all kinds the names.
    #[must_use]
    pub fn words(&self) -> String {
        let mut out = String::new();
        for NamesOfKind { kind, used_in, names } in &self.kinds {
            let _ = writeln!(out, "{kind} ({used_in})");
            let mut line = String::new();
            for (at, KnownName { name, words }) in names.iter().enumerate() {
                if self.kinds.len() == 1 {
                    let _ = writeln!(out, "{}", format!("  {name:<26} {words}").trim_end());
                    continue;
                }
                if line.len() + name.len() + 2 > LINE {
                    let _ = writeln!(out, "  {}", line.trim_end());
                    line.clear();
                }
                let comma = if at + 1 < names.len() { ", " } else { "" };
                line.push_str(name);
                line.push_str(comma);
            }
            if !line.is_empty() {
                let _ = writeln!(out, "  {}", line.trim_end());
            }
        }
        out
    }
}

fn all() -> Result<Vec<NamesOfKind>, Error> {
    let profiles = ProfileList::of_all()?;
    let of = |listed: Vec<super::profile::ListedProfile>| -> Vec<KnownName> {
        let words = |maker: Option<String>, model: String| match maker {
            Some(maker) => format!("{maker} {model}"),
            None => model,
        };
        let known = |of: super::profile::ListedProfile| KnownName {
            name: of.name,
            words: words(of.maker, of.model),
        };
        listed.into_iter().map(known).collect()
    };
    let plain = |name: &str, words: &str| KnownName { name: name.into(), words: words.into() };
    let actions = vocabulary::names().map(|name| Ok(plain(name, &vocabulary::find(name)?.note)));
    let shipped_models = models::names().map(|name| Ok(plain(name, &models::find(name)?.note)));
    let sets = PlannedSet::ALL.map(|set| plain(set.word(), &counted(set.trials().len(), "trial")));
    let markers =
        MarkerSet::shipped().into_iter().map(|set| plain(&set.name, &set.title)).collect();
    let kind = |kind, used_in, names| NamesOfKind { kind, used_in, names };
    Ok(vec![
        kind(
            "actions",
            "play, synth, retarget, recognise, corpus add",
            actions.collect::<Result<_, Error>>()?,
        ),
        kind(
            "models",
            "recognise, model, live --recognise",
            shipped_models.collect::<Result<_, Error>>()?,
        ),
        kind("robots", "--robot, simulate, monitor, hold, limp, calibrate", of(profiles.robots)),
        kind("servos", "simulate --servo, servo, robot files", of(profiles.servos)),
        kind("actuators", "simulate --servo, robot files", of(profiles.actuators)),
        kind("sensors", "record imu:NAME@BUS, live, simulate imus", of(profiles.sensors)),
        kind("adapters", "simulate --adapter", of(profiles.adapters)),
        kind("boards", "robot files ([body.imu])", of(profiles.boards)),
        kind("marker-sets", "fit --markers, clean", markers),
        kind("corpus-sets", "corpus plan, corpus generate", sets.into()),
        kind(
            "export-formats",
            "corpus export --format",
            ExportFormat::ALL.map(|of| plain(of.word(), "")).into(),
        ),
    ])
}
