//! What an operator and whoever wears the sensors do together, in any session.

use super::dialogue::Dialogue;
use super::person::{Act, Person};
use gaitway::body::Dof;
use gaitway::body::worn::check::t_pose;
use serde::de::DeserializeOwned;
use std::path::Path;
use std::time::Duration;

/// What is asked at each N pose.
pub const ASKED: &str = "Enter when you stand so";

/// A file of a session.
pub fn read<T: DeserializeOwned>(path: &Path) -> T {
    let text = std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    toml::from_str(&text).unwrap_or_else(|e| panic!("{}: {e}\n{text}", path.display()))
}

pub fn raises_an_arm() -> Act {
    Act::Swing(vec![Dof::RightShoulderFlexion], 1.4, 2.0)
}

/// Something real takes so long.
pub fn passes(seconds: f64) {
    std::thread::sleep(Duration::from_secs_f64(seconds));
}

/// N pose. Who stood still while the machine did not is asked once more.
pub fn stand_until(operator: &mut Dialogue, next: &str) {
    stand_and_type(operator, &[], next);
}

/// The same for somebody who types something while they are to hold still.
pub fn stand_and_type(operator: &mut Dialogue, early: &[&str], next: &str) {
    operator.expect(ASKED);
    for _ in 0..4 {
        operator.say("");
        if !early.is_empty() {
            operator.expect("hold still");
        }
        early.iter().for_each(|early| operator.say(early));
        if operator.expect_one_of(&[next, ASKED]) == next {
            return;
        }
    }
    panic!("four times no N pose");
}

/// N pose first, then the movement once, and N pose again.
pub fn movement(operator: &mut Dialogue, person: &Person, act: Act) {
    person.stands();
    passes(0.9);
    person.does(act);
    // A period of two seconds after the change, and then it stands.
    passes(2.35);
    person.stands();
    operator.expect("good");
}

/// Poses and movements as the guide asks for them.
pub fn calibrated(operator: &mut Dialogue, person: &Person) {
    operator.answer("Are they on?", "");
    stand_until(operator, "T pose: arms straight out");
    person.does(Act::Pose(t_pose()));
    operator.expect("then: bow");
    movement(operator, person, Act::Bow(2.0));
    operator.expect("then: march");
    movement(operator, person, Act::Swing(vec![Dof::RightElbowFlexion], 1.5, 2.0));
    operator.expect("then: raise");
    movement(operator, person, raises_an_arm());
    operator.expect("measured error in T pose");
    operator.expect("written: calibration/body-s01-01.toml");
}
