//! How an action is done, shown by a figure that does it over and over.

use crate::action::phrase::is_phrase;
use crate::body::Proportions;
use crate::error::Error;
use crate::job::source::{CaptureOptions, body_motion};
use crate::mocap::anatomy::Capture;
use crate::session::{Plan, PlannedAction};
use crate::view::session::PersonNow;
use std::path::Path;

/// The figure stands still for so long before it begins again, s.
const PAUSE_S: f64 = 1.0;

/// A figure that does an action.
pub(super) struct Demonstration {
    motion: Capture,
    body: Proportions,
}

/// Files that show how actions of a plan are done lie beside it: from now on they are named so that they are found from anywhere.
pub fn find_demonstrations(plan: &mut Plan, beside: &Path) {
    for action in &mut plan.actions {
        let motion = &mut action.demonstration;
        // Shipped actions, however long, are no files.
        if motion.is_empty() || (is_phrase(motion) && !motion.ends_with(".toml")) {
            continue;
        }
        let file = beside.join(&*motion);
        *motion = std::fs::canonicalize(&file).unwrap_or(file).display().to_string();
    }
}

/// Fails if a plan names a motion that cannot be shown.
pub(super) fn check(action: &PlannedAction) -> Result<(), Error> {
    if action.demonstration.is_empty() {
        return Ok(());
    }
    let at = |error: Error| {
        // `MOTION` is what is typed at a command.
        let cause = error.place.as_ref().filter(|place| &***place != "MOTION");
        let cause = cause.map_or_else(String::new, |place| format!(", {place}"));
        error.at(format!("demonstration of {}{cause}", action.name))
    };
    Demonstration::of(&action.demonstration).map(drop).map_err(at)
}

impl Demonstration {
    /// Of a motion of a body: actions, or a file.
    ///
    /// # Errors
    /// A motion that cannot be read.
    pub(super) fn of(motion: &str) -> Result<Self, Error> {
        let (motion, _) = body_motion(motion, None, &CaptureOptions::default())?;
        let body = Proportions::of_stature(motion.stature_m)?;
        Ok(Self { motion, body })
    }

    /// How long it takes once, s.
    pub(super) fn lasts_s(&self) -> f64 {
        (self.motion.poses.len().max(1) - 1) as f64 / self.motion.rate_hz
    }

    /// The figure, so long after it was shown first, s.
    pub(super) fn at(&self, time_s: f64) -> PersonNow {
        let lasts_s = self.lasts_s();
        let pose = self.motion.at((time_s % (lasts_s + PAUSE_S)).min(lasts_s));
        PersonNow::of(&self.body, &pose, &[None; 13])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_figure_does_the_action_and_begins_again_after_a_pause() {
        let figure = Demonstration::of("wave-r").expect("shipped");
        let lasts_s = figure.lasts_s();
        assert!(lasts_s > 1.0);
        let rest = figure.at(0.0);
        let moved_m = |of: &PersonNow| {
            let apart = |(a, b): (&[f64; 3], &[f64; 3])| (0..3).map(|k| (a[k] - b[k]).abs()).sum();
            rest.places_m.iter().zip(&of.places_m).map(apart).fold(0.0, f64::max)
        };
        assert!(moved_m(&figure.at(0.5 * lasts_s)) > 0.3, "a hand is up");
        assert!(moved_m(&figure.at(lasts_s + 0.9 * PAUSE_S)) < 0.01, "it stands");
        let again = figure.at(lasts_s + PAUSE_S + 0.5 * lasts_s);
        assert_eq!(again.places_m, figure.at(0.5 * lasts_s).places_m);
    }

    #[test]
    fn a_file_beside_the_plan_is_found_from_anywhere_and_actions_are_no_files() {
        let folder = std::env::temp_dir().join(format!("gaitway-shown-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder");
        std::fs::write(folder.join("lift.bvh"), "").expect("a file");
        std::fs::write(folder.join("walk"), "").expect("a file");
        let shown = |motions: [&str; 5]| {
            let action = |demonstration: &str| PlannedAction {
                demonstration: demonstration.to_owned(),
                ..PlannedAction::default()
            };
            let mut plan = Plan { actions: motions.map(action).into(), ..Plan::default() };
            find_demonstrations(&mut plan, &folder);
            plan.actions.into_iter().map(|action| action.demonstration).collect::<Vec<_>>()
        };
        let beside = |name: &str| folder.join(name).display().to_string();
        let found = std::fs::canonicalize(folder.join("lift.bvh")).expect("it is there");
        assert_eq!(
            shown(["lift.bvh", "none.bvh", "walk", "walk:4s,wave-r", ""]),
            [&found.display().to_string(), &beside("none.bvh"), "walk", "walk:4s,wave-r", ""]
        );
        let again = shown([&found.display().to_string(), "walk", "walk", "walk", ""]);
        assert_eq!(again[0], found.display().to_string(), "as a session keeps it");
        std::fs::remove_dir_all(folder).expect("removed");
    }

    #[test]
    fn a_demonstration_that_is_no_motion_is_refused_with_the_action_it_was_to_show() {
        let action = PlannedAction {
            name: "lift-box".to_owned(),
            demonstration: "no-such-file.bvh".to_owned(),
            ..PlannedAction::default()
        };
        let said = check(&action).expect_err("no such file").to_string();
        assert!(
            said.contains("demonstration of lift-box") && said.contains("no-such-file.bvh"),
            "{said}"
        );
    }
}
