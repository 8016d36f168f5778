//! Sets of a corpus that the body model fills: every trial is where it is to be, and parts make the whole.

use crate::aloud::aloud;
use crate::program::{folder, gaitway, json, words};
use crate::python;
use gaitway::action::parametric::{Ask, Performer};
use gaitway::body::contact::Footing;
use gaitway::body::{Dof, End, JointAngles, Proportions};
use glam::{DQuat, DVec3};
use serde_json::Value;
use std::path::{Path, PathBuf};

fn new(name: &str) -> (PathBuf, String) {
    let folder = folder(name);
    let corpus = folder.join("moves").display().to_string();
    assert!(gaitway().args(["corpus", "new", &corpus]).output().expect("runs").status.success());
    (folder, corpus)
}

fn generate(corpus: &str, more: &[&str]) -> Value {
    generate_set(corpus, "generalisation", more)
}

fn generate_set(corpus: &str, set: &str, more: &[&str]) -> Value {
    let mut command = gaitway();
    command.args(["corpus", "generate", corpus, set, "--json"]).args(more);
    json(&command.output().expect("the program"))
}

/// Angles, root and pelvis of a trial as its rows say them, read without what wrote them: the position of an end by
/// its own chain of turns.
fn right_fingertip_m(body: &Proportions, row: &[f64]) -> DVec3 {
    let turn = |axis: DVec3, rad: f64| DQuat::from_axis_angle(axis, rad);
    let angle = |dof: Dof| row[dof.index()];
    let pelvis = DQuat::from_xyzw(row[26], row[27], row[28], row[25]);
    // Flexion forward turns about -Y (arms), +Y (trunk); abduction of the right side about -X; rotation inwards about +Z.
    let torso = pelvis
        * turn(DVec3::Y, angle(Dof::TorsoFlexion))
        * turn(-DVec3::X, angle(Dof::TorsoLateralBend))
        * turn(DVec3::Z, angle(Dof::TorsoAxial));
    let arm = torso
        * turn(-DVec3::Y, angle(Dof::RightShoulderFlexion))
        * turn(DVec3::X, -angle(Dof::RightShoulderAbduction))
        * turn(DVec3::Z, angle(Dof::RightShoulderRotation));
    let forearm = arm * turn(-DVec3::Y, angle(Dof::RightElbowFlexion));
    let offset = |joint| body.joint_offset_m(joint).expect("a joint").1;
    use gaitway::body::Joint::{RightElbow, RightShoulder, Torso};
    let root = DVec3::new(row[22], row[23], row[24]);
    root + pelvis * offset(Torso)
        + torso * offset(RightShoulder)
        + arm * offset(RightElbow)
        + forearm * body.end_offset_m(End::RightFingertip).1
}

fn rows(corpus: &str, name: &str, folder: &Path) -> Vec<Vec<f64>> {
    let out = folder.join(format!("{name}-bvh"));
    let question = format!("name={name}");
    let shown = out.display().to_string();
    let arguments = ["corpus", "export", corpus, &question, "--format", "bvh", "-o", &shown];
    assert!(gaitway().args(arguments).output().expect("runs").status.success());
    use gaitway::corpus::query::Question;
    use gaitway::corpus::select::Selection;
    use gaitway::corpus::store::Store;
    let store = Store::open(Path::new(corpus)).expect("a corpus");
    let mut entries = Vec::new();
    let question = Question::parse(&question).expect("a question");
    Selection::new(&store, &question, false)
        .expect("a selection")
        .trials(u64::MAX, |entry| {
            entries.push(entry);
            Ok(())
        })
        .expect("trials");
    let mut found = Vec::new();
    store
        .frames_of(&entries.iter().collect::<Vec<_>>(), |_, frames| {
            found = (0..frames.len())
                .map(|row| frames.signals.iter().map(|of| f64::from(of[row])).collect())
                .collect();
            Ok(())
        })
        .expect("frames");
    found
}

#[test]
fn reaches_touch_their_points_and_parts_make_the_same_corpus_as_the_whole() {
    let (folder, corpus) = new("sets-reach");
    // Every 33rd of the 330: reaches, a seat, kicks, steps, a hop or jump, speeds.
    let first = generate(&corpus, &["--part", "3/33"]);
    assert_eq!(first["outcome"], "done", "{first:#}");
    assert_eq!(first["added"], 10);
    let trials = first["trials"].as_array().expect("trials");
    for trial in trials {
        assert!(trial["away_mm"].as_f64().expect("mm") < 20.0, "{trial}");
        assert!(trial["sinks_mm"].as_f64().expect("mm") < 1.0, "{trial}");
        assert!(trial["slides_mm"].as_f64().expect("mm") < 5.0, "{trial}");
    }
    // The same again adds nothing, and is what it was.
    let again = generate(&corpus, &["--part", "3/33", "--verify"]);
    assert_eq!((&again["added"], &again["found"]), (&0.into(), &10.into()));
    assert_eq!(again["changed"], Value::Array(Vec::new()));
    assert_eq!(again["version"], first["version"]);

    // In three parts, the last first, and two of them at once.
    let (_, parts) = new("sets-parts");
    generate(&parts, &["--part", "69/99"]);
    let begin = |part: &str| {
        let mut command = gaitway();
        command.args(["corpus", "generate", &parts, "generalisation", "--part", part]);
        command.stdout(std::process::Stdio::null()).stderr(std::process::Stdio::null());
        command.spawn().expect("the program")
    };
    for mut running in [begin("3/99"), begin("36/99")] {
        assert!(running.wait().expect("ends").success());
    }
    let whole = generate(&parts, &["--part", "3/33"]);
    assert_eq!((&whole["added"], &whole["version"]), (&0.into(), &first["version"]));

    // The hand, told by another chain of turns than the program's, is where the row says: from the floor below the centre
    // of mass.
    let body = Proportions::of_stature(1.75).expect("a body");
    let reach = trials.iter().find(|of| of["action"] == "reach").expect("a reach");
    let name = reach["name"].as_str().expect("a name");
    let question = format!("name={name}");
    let row = json(
        &gaitway().args(["corpus", "query", &corpus, &question, "--json"]).output().expect("runs"),
    );
    let of = &row["clips"][0]["parameters"];
    let value = |key: &str| of[key].as_f64().expect("a number");
    let target = DVec3::new(value("target_x_m"), value("target_y_m"), value("target_z_m"));
    let nearest = rows(&corpus, name, &folder)
        .iter()
        .map(|row| right_fingertip_m(&body, row).distance(target))
        .fold(f64::MAX, f64::min);
    assert!(nearest < 0.001, "{name}: {nearest} m");
}

#[test]
fn another_seed_draws_other_targets_beside_the_grid_and_the_same_each_time() {
    let (_, corpus) = new("sets-seed");
    let grid = generate(&corpus, &["--part", "20/330"]);
    let drawn = generate(&corpus, &["--part", "20/330", "--seed", "5"]);
    assert_eq!((&grid["added"], &drawn["added"]), (&1.into(), &1.into()));
    assert_ne!(grid["trials"][0]["trial"], drawn["trials"][0]["trial"]);
    // A jog has nothing that could be drawn: it is not added twice, and said.
    let jog = |seed: &str| generate(&corpus, &["--part", "247/330", "--seed", seed]);
    assert_eq!(jog("0")["added"], 1);
    let again = jog("1");
    assert_eq!((&again["added"], again["alike"].as_array().map(Vec::len)), (&0.into(), Some(1)));
    let (_, other) = new("sets-seed-again");
    let again = generate(&other, &["--part", "20/330", "--seed", "5"]);
    assert_eq!(again["trials"][0]["trial"], drawn["trials"][0]["trial"]);
}

#[test]
fn a_set_or_a_part_that_is_none_is_said_with_what_is_allowed() {
    let (_, corpus) = new("sets-wrong");
    for (arguments, said) in [
        (vec!["generalization"], "generalisation"),
        (vec!["generalisation", "--part", "0/4"], "K from 1 to N"),
        (vec!["generalisation", "--part", "5/4"], "K from 1 to N"),
        (vec!["generalisation", "--part", "3"], "3/100"),
    ] {
        let output = gaitway()
            .args(["corpus", "generate", &corpus])
            .args(&arguments)
            .output()
            .expect("runs");
        assert!(!output.status.success(), "{arguments:?}");
        let text = words(&output);
        assert!(text.contains(said), "{arguments:?}: {text}");
    }
}

fn standing_still(motion: &gaitway::action::Motion) -> bool {
    let ends = [0.0, motion.duration_s()];
    let rests = |dof: &Dof| ends.iter().all(|at| motion.at(*dof, *at).velocity_rad_s.abs() < 1e-9);
    Dof::ALL.iter().all(rests) && motion.angles_at(0.0) == JointAngles::default()
}

#[test]
fn a_heavier_load_is_held_by_a_body_that_leans_back_and_pressed_against_the_floor() {
    let mut performer = Performer::of(Proportions::of_stature(1.75).expect("a body"));
    let body = *performer.body();
    let mut behind = f64::MAX;
    for load_kg in [0.0, 10.0, 20.0] {
        let made = performer.make(&Ask::Lift { load_kg }).expect("a lift");
        assert!(standing_still(&made.motion));
        assert!(made.missed(&body).expect("feet").is_empty());
        let poses = made.motion.poses(&body, 60.0).expect("poses");
        let masses = gaitway::body::mass::segment_masses(&body);
        let last = poses.last().expect("a pose");
        let centre = gaitway::body::mass::centre_of_mass_m(&body, &masses, last);
        let soles = gaitway::body::contact::places_m(&body, last);
        let over = centre.x - soles[2].x;
        assert!(over < behind - 0.01 || load_kg == 0.0, "{load_kg} kg: {over} after {behind}");
        behind = over;
    }
    assert!(performer.make(&Ask::Lift { load_kg: 60.0 }).is_err());
    assert!(performer.make(&Ask::SitAndStand { height_m: 0.9 }).is_err());
    assert!(performer.make(&Ask::Step { direction_rad: 0.0, length_m: 2.0 }).is_err());
}

#[test]
fn steps_and_jumps_come_down_where_they_were_asked_to() {
    let mut performer = Performer::of(Proportions::of_stature(1.75).expect("a body"));
    let body = *performer.body();
    let eighth = std::f64::consts::FRAC_PI_4;
    for (ask, goes) in [
        (Ask::Step { direction_rad: 2.0 * eighth, length_m: 0.2 }, DVec3::new(0.0, -0.2, 0.0)),
        (Ask::Step { direction_rad: 4.0 * eighth, length_m: 0.2 }, DVec3::new(-0.2, 0.0, 0.0)),
        (Ask::Jump { direction_rad: 6.0 * eighth, length_m: 0.2 }, DVec3::new(0.0, 0.2, 0.0)),
    ] {
        let made = performer.make(&ask).expect("made");
        assert!(standing_still(&made.motion));
        let poses = made.motion.poses(&body, 120.0).expect("poses");
        let middle = |at: usize| {
            gaitway::body::contact::places_m(&body, &poses[at]).iter().sum::<DVec3>() / 4.0
        };
        let gone = middle(poses.len() - 1) - middle(0);
        assert!(gone.distance(goes) < 0.02, "{ask:?}: {gone}");
        let footing = Footing::of(&body, &poses, 120.0).expect("feet");
        assert!(footing.lowest_m() > -0.001 && footing.slide_m() < 0.005, "{ask:?}");
    }
}

/// What a command writes, as numbers.
fn synthesised(action: &str, variation: &str, folder: &Path) -> Vec<Vec<f64>> {
    let file = folder.join("twin.csv").display().to_string();
    let arguments =
        ["synth", action, "--variation", variation, "--seed", "4", "--force", "-o", &file];
    assert!(gaitway().args(arguments).output().expect("runs").status.success());
    let text = std::fs::read_to_string(file).expect("a table");
    let row = |line: &str| line.split(',').map(|cell| cell.parse().expect("a number")).collect();
    text.lines().skip(1).map(row).collect()
}

#[test]
fn sets_of_words_are_filled_with_variations_of_the_shipped_actions_and_say_what_nobody_does() {
    let (folder, corpus) = new("sets-words");
    let fill = |set: &str, part: &str| {
        let arguments =
            ["corpus", "generate", &corpus, set, "--seed", "4", "--part", part, "--json"];
        let output = gaitway().args(arguments).output().expect("runs");
        assert!([Some(0), Some(3)].contains(&output.status.code()), "{output:?}");
        json(&output)
    };
    let words = fill("praxicon", "1/1");
    let count = |of: &Value| of.as_array().map_or(0, Vec::len);
    // 92 words of 111 are kept.
    assert_eq!(count(&words["trials"]) + count(&words["left_out"]), 92);
    assert!(count(&words["trials"]) > 12, "{words:#}");
    assert!(words["left_out"].to_string().contains("\"sweep\""), "{}", words["left_out"]);
    let mut falls = 0;
    for trial in words["trials"].as_array().expect("a list") {
        falls += usize::from(count(&trial["missed"]) > 0);
    }
    assert!(falls * 10 <= count(&words["trials"]), "{falls} do not stand");
    // A twin by the command that makes one variation.
    for (name, action) in [("bow", "bow"), ("kick", "kick-r")] {
        let (own, twin) = (rows(&corpus, name, &folder), synthesised(action, "0", &folder));
        assert_eq!(own.len(), twin.len(), "{name}");
        for (own, twin) in own.iter().zip(&twin) {
            let apart = (0..22).map(|n| (own[n] - twin[1 + n]).abs()).fold(0.0, f64::max);
            assert!(apart < 1e-6, "{name}: {apart}");
        }
    }
    let both = fill("composition", "1/1");
    let names = both["trials"].to_string();
    assert!(names.contains("\"walk>kick\"") && names.contains("\"walk+wave\""), "{names}");
    assert!(both["left_out"].to_string().contains("walk-and-clap"));
    // What each is made of is labelled where it is done: a bow, and then a wave.
    let (bow, wave) = (synthesised("bow", "0", &folder), synthesised("wave-r", "0", &folder));
    let whole = rows(&corpus, "bow-then-wave", &folder);
    let asked = |label: &str| {
        let question = format!("name=bow-then-wave and label={label}");
        let arguments = ["corpus", "query", &corpus, &question, "--frames", "--json"];
        let told = json(&gaitway().args(arguments).output().expect("runs"));
        ["first_frame", "last_frame"]
            .map(|of| told["clips"][0]["answering"][0][of].as_u64().expect("a frame"))
    };
    let ([begins, ends], [later, last]) = (asked("bow"), asked("wave"));
    assert_eq!((begins, ends as usize, last as usize), (0, bow.len() - 1, whole.len() - 1));
    assert!(
        ends < later && last - later < wave.len() as u64 && last - later + 3 > wave.len() as u64
    );
    // The same by many people, who differ.
    let people = fill("cross-validation", "5/97");
    let made = people["trials"].as_array().expect("a list");
    assert!(made.len() > 5, "{people:#}");
    let how_many = |who: &str| {
        let question = format!("set=cross-validation and body_stature_m{who}");
        let asked = gaitway().args(["corpus", "query", &corpus, &question, "--json"]).output();
        json(&asked.expect("runs"))["trials"].as_u64().expect("a number") as usize
    };
    let (small, tall) = (how_many("<1.72"), how_many(">1.78"));
    assert!(small > 0 && tall > 0 && small + tall <= made.len(), "{small} and {tall}");
    let none = gaitway().args(["corpus", "generate", &corpus, "interactions"]).output();
    let none = none.expect("runs");
    assert_eq!(none.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&none.stderr).contains("interaction"), "{none:?}");
    // Made again, they are what they were.
    let again = fill("composition", "1/1");
    assert_eq!((&again["added"], count(&again["changed"])), (&0.into(), 0));
}

/// Frames of a trial by title: the 22 angles are not among these.
struct Seen {
    rows: Vec<Vec<f64>>,
}

impl Seen {
    fn of(corpus: &str, name: &str, folder: &Path) -> Self {
        Self { rows: rows(corpus, name, folder) }
    }

    fn angle(&self, at: usize, of: Dof) -> f64 {
        self.rows[at][of.index()]
    }

    fn root_m(&self, at: usize) -> [f64; 3] {
        [22, 23, 24].map(|column| self.rows[at][column])
    }

    /// The first frame in which an angle is not what it was at first, and the last before it is what it stays.
    fn moves(&self, of: Dof) -> (usize, usize) {
        let last = self.rows.len() - 1;
        let differs =
            |at: &usize, from: usize| (self.angle(*at, of) - self.angle(from, of)).abs() > 1e-4;
        let begins = (0..=last).find(|at| differs(at, 0)).expect("it moves");
        (begins, (0..=last).rev().find(|at| differs(at, last)).expect("it moves"))
    }
}

#[test]
fn who_does_two_at_once_has_the_legs_of_one_and_the_arm_of_the_other() {
    let (folder, corpus) = new("sets-at-once");
    generate_set(&corpus, "composition", &["--seed", "4"]);
    let seen = Seen::of(&corpus, "walk-and-wave", &folder);
    let (walk, wave) = (synthesised("walk", "0", &folder), synthesised("wave-r", "0", &folder));
    assert_eq!(seen.rows.len(), walk.len().max(wave.len()));
    let arm = [Dof::RightShoulderFlexion, Dof::RightShoulderAbduction, Dof::RightElbowFlexion];
    for at in 0..walk.len().min(wave.len()) {
        for dof in [Dof::LeftKneeFlexion, Dof::RightHipFlexion, Dof::LeftShoulderFlexion] {
            assert!((seen.angle(at, dof) - walk[at][1 + dof.index()]).abs() < 1e-6, "{dof:?}");
        }
        for dof in arm {
            assert!((seen.angle(at, dof) - wave[at][1 + dof.index()]).abs() < 1e-6, "{dof:?}");
        }
    }
}

#[test]
fn the_second_of_a_step_and_a_reach_begins_before_the_first_is_over() {
    let (folder, corpus) = new("sets-overlap");
    let made = generate_set(&corpus, "co-articulation", &["--part", "1/8"]);
    assert_eq!(made["trials"].as_array().map(Vec::len), Some(2), "{made:#}");
    assert_eq!((&made["outcome"], &made["left_out"]), (&"done".into(), &Value::Array(vec![])));
    let foot = Dof::RightKneeFlexion;
    let step = Seen::of(&corpus, "step-then-reach-001", &folder);
    let (begins, _) = step.moves(Dof::RightElbowFlexion);
    let (first, last) = step.moves(foot);
    assert!(first < begins && begins < last, "{first} {begins} {last}");
    let reach = Seen::of(&corpus, "reach-then-step-001", &folder);
    let (hand, back) = reach.moves(Dof::RightElbowFlexion);
    let (begins, _) = reach.moves(foot);
    assert!(hand < begins && begins < back, "{hand} {begins} {back}");
    // What each is made of is labelled, and the two overlap.
    let asked = |label: &str| {
        let question = format!("name=step-then-reach-001 and label={label}");
        let arguments = ["corpus", "query", &corpus, &question, "--frames", "--json"];
        let told = json(&gaitway().args(arguments).output().expect("runs"));
        ["first_frame", "last_frame"]
            .map(|of| told["clips"][0]["answering"][0][of].as_u64().expect("a frame") as usize)
    };
    let ([from, to], [later, _]) = (asked("step"), asked("reach"));
    let (begins, _) = step.moves(Dof::RightElbowFlexion);
    assert!(from == 0 && later < to && later <= begins && begins < later + 60, "{later} {to}");
    // Another seed steps another way.
    let drawn = generate_set(&corpus, "co-articulation", &["--part", "1/8", "--seed", "1"]);
    assert_eq!((&drawn["added"], &drawn["alike"]), (&2.into(), &Value::Array(vec![])));
    // Where the step goes: 15 cm ahead.
    let gone = |seen: &Seen| seen.root_m(seen.rows.len() - 1)[0] - seen.root_m(0)[0];
    assert!((gone(&step) - 0.15).abs() < 0.02 && (gone(&reach) - 0.15).abs() < 0.02);
}

#[test]
fn two_people_do_something_together_by_one_clock_and_each_in_their_place() {
    let (folder, corpus) = new("sets-together");
    let made = generate_set(&corpus, "interaction", &[]);
    let trials = made["trials"].as_array().expect("a list");
    assert_eq!(trials.len() / 2 + made["left_out"].as_array().map_or(0, Vec::len), 20);
    for pair in ["pass-by", "follow", "bow-to-one-another"] {
        let [one, other] =
            ["01", "02"].map(|who| Seen::of(&corpus, &format!("{pair}-{who}"), &folder));
        assert_eq!(one.rows.len(), other.rows.len(), "{pair}");
        let last = one.rows.len() - 1;
        let ahead = |at: usize| other.root_m(at)[0] - one.root_m(at)[0];
        let apart = |at: usize| ahead(at).hypot(other.root_m(at)[1] - one.root_m(at)[1]);
        let nearest = (0..=last).map(apart).fold(f64::MAX, f64::min);
        assert!(nearest > 0.6, "{pair}: nobody walks through the other: {nearest} m");
        // The pelvis of the second is turned about Z by pi, of who is behind by nothing: w, x, y, z.
        let faces = other.rows[0][28].abs();
        match pair {
            "pass-by" => assert!(ahead(0) > 1.0 && ahead(last) < -1.0, "they pass"),
            "follow" => assert!(ahead(0) < -1.0 && ahead(last) < -0.6, "one stays behind"),
            _ => assert!((ahead(0) - ahead(last)).abs() < 0.02, "both stay where they are"),
        }
        assert!((faces - f64::from(u8::from(pair != "follow"))).abs() < 0.05, "{pair}: {faces}");
    }
    // Nobody does the same as somebody else, or as whoever does it alone.
    generate_set(&corpus, "praxicon", &[]);
    let checked = gaitway().args(["corpus", "check", &corpus]).output().expect("runs");
    assert!(checked.status.success(), "{}", words(&checked));
    let asked = ["corpus", "query", &corpus, "session=pass-by-0", "--json"];
    let both = json(&gaitway().args(asked).output().expect("runs"));
    assert_eq!(both["trials"], 2, "{both:#}");
}

mod scores {
    use super::*;
    use gaitway::body::anthropometry::{Measure, Subject};
    use gaitway::corpus::query::Question;
    use gaitway::corpus::rows::{SubjectEntry, TrialEntry};
    use gaitway::corpus::select::Selection;
    use gaitway::corpus::store::{NewTrial, Store};
    use gaitway::corpus::tables::TrialFrames;

    /// 28 reaches all over the volume.
    fn reaches(name: &str) -> (PathBuf, String, Vec<(TrialEntry, TrialFrames)>) {
        let (folder, corpus) = new(name);
        for k in (1..=163).step_by(6) {
            generate(&corpus, &["--part", &format!("{k}/330")]);
        }
        let store = Store::open(Path::new(&corpus)).expect("a corpus");
        let mut entries = Vec::new();
        Selection::new(&store, &Question::parse("").expect("all"), false)
            .expect("a selection")
            .trials(u64::MAX, |entry| {
                entries.push(entry);
                Ok(())
            })
            .expect("trials");
        let mut all = Vec::new();
        store
            .frames_of(&entries.iter().collect::<Vec<_>>(), |entry, frames| {
                all.push((entry.clone(), frames));
                Ok(())
            })
            .expect("frames");
        assert_eq!(all.len(), 28);
        (folder, corpus, all)
    }

    /// A corpus of these trials.
    fn of(folder: &Path, name: &str, trials: Vec<(TrialEntry, TrialFrames)>) -> String {
        let corpus = folder.join(name).display().to_string();
        assert!(
            gaitway().args(["corpus", "new", &corpus]).output().expect("runs").status.success()
        );
        let mut store = Store::open_to_change(Path::new(&corpus)).expect("a corpus");
        let new = |(mut entry, frames): (TrialEntry, TrialFrames)| {
            entry.frames_sha256 = frames.sha256(entry.rate_hz);
            entry.trial = entry.frames_sha256.chars().take(16).collect();
            entry.place = None;
            NewTrial { entry, frames: Some(frames), labels: Vec::new(), source: None }
        };
        let new = trials.into_iter().map(new).collect();
        store.add("generalisation", "reach", new, &[], "").expect("added");
        corpus
    }

    fn score(name: &str, corpus: &str) -> Value {
        json(&gaitway().args(["score", name, corpus, "--json"]).output().expect("the program"))
    }

    fn value(report: &Value) -> f64 {
        report["value"].as_f64().expect("a value")
    }

    #[test]
    fn a_fifth_of_the_people_is_judged_by_what_the_others_did() {
        let (folder, corpus, all) = reaches("sets-people");
        let by_subject = |corpus: &str, more: &[&str]| {
            let arguments = ["score", "generalisation", corpus, "--by-subject", "--json"];
            gaitway().args(arguments).args(more).output().expect("the program")
        };
        let nobody = by_subject(&corpus, &[]);
        assert_eq!(nobody.status.code(), Some(1));
        assert!(words(&nobody).contains("2 or more"), "{}", words(&nobody));
        // Five people, each with a stoop of their own, who do all of it twice.
        let mut five = Vec::new();
        for (who, again) in (0..5_u8).flat_map(|who| [(who, 0_u8), (who, 1)]) {
            for (entry, frames) in &all {
                let (mut entry, mut frames) = (entry.clone(), frames.clone());
                entry.subject = Some(format!("s{who}"));
                entry.name = format!("{}-{who}-{again}", entry.name);
                let stoops = 0.1 * f32::from(who) + 0.0005 * f32::from(again);
                frames.signals[0].iter_mut().for_each(|angle| *angle += stoops);
                five.push((entry, frames));
            }
        }
        let corpus = of(&folder, "five", five);
        let everybody = score("generalisation", &corpus);
        assert_eq!((&everybody["judged"], &everybody["people"]), (&280.into(), &Value::Null));
        let split = json(&by_subject(&corpus, &[]));
        let people = (&split["judged"], &split["people"]);
        assert_eq!(people, (&56.into(), &serde_json::json!([1, 4])), "{split:#}");
        // Who did the same a second time would be copied by who knows the truth; of the others nobody stoops alike.
        let bound = |of: &Value| of["bound"][1].as_f64().expect("mm");
        assert!(bound(&everybody) < 0.5 * bound(&split), "{everybody} {split}");
        let again = json(&by_subject(&corpus, &["--seed", "1"]));
        assert_eq!(again["value"], split["value"], "the seed says who");
        let told = gaitway().args(["score", "generalisation", &corpus, "--by-subject"]).output();
        let told = words(&told.expect("the program"));
        assert!(told.contains("1 of 5 judged") && told.contains("those of the 4 others"), "{told}");
    }

    #[test]
    fn scores_of_motions_beat_their_baselines_and_fall_when_the_corpus_is_spoilt() {
        let (folder, corpus, all) = reaches("sets-scores");

        let good = score("generalisation", &corpus);
        assert_eq!(good["judged"], 28);
        let (low, high) = (&good["interval"][0], &good["interval"][1]);
        assert!(
            low.as_f64().expect("mm") < value(&good) && value(&good) < high.as_f64().expect("mm")
        );
        let copied = good["baselines"][1]["value"].as_f64().expect("mm");
        assert!(
            value(&good) < copied,
            "{} mm, {copied} mm where the nearest is copied",
            value(&good)
        );
        // Every trial says the target of another: then nobody can tell.
        let mut swapped = all.clone();
        for (at, (entry, _)) in swapped.iter_mut().enumerate() {
            entry.parameters = all[(at + 13) % all.len()].0.parameters.clone();
        }
        let spoilt = score("generalisation", &of(&folder, "swapped", swapped));
        assert!(value(&spoilt) > 1.5 * value(&good), "{} after {}", value(&spoilt), value(&good));

        let good = score("transitioning", &corpus);
        let blend = good["baselines"][0]["value"].as_f64().expect("mm");
        assert!(value(&good) < blend, "{} mm, {blend} mm by a blend", value(&good));
        let bound = good["bound"][1].as_f64().expect("mm");
        assert!(bound > 0.0 && bound <= value(&good) && bound < blend, "{bound} mm at best");
        // An elbow that shakes.
        let mut shaken = all.clone();
        for (_, frames) in &mut shaken {
            for (at, angle) in frames.signals[11].iter_mut().enumerate() {
                *angle += if at % 2 == 0 { 0.05 } else { -0.05 };
            }
        }
        let spoilt = score("transitioning", &of(&folder, "shaken", shaken));
        assert!(value(&spoilt) > 1.5 * value(&good), "{} after {}", value(&spoilt), value(&good));

        let nobody = score("identification", &corpus);
        assert!(nobody["value"].is_null());
        assert!(nobody["truth"].as_str().expect("words").contains("no truth here"));
        // Two people, one of whom stoops.
        let people = |shuffled: bool| {
            let mut both = Vec::new();
            for (at, (entry, frames)) in all.iter().enumerate() {
                let (mut one, mut other) = (entry.clone(), entry.clone());
                let mut stoops = frames.clone();
                stoops.signals[0].iter_mut().for_each(|angle| *angle += 0.4);
                let swap = shuffled && at % 2 == 0;
                one.subject = Some(if swap { "s2" } else { "s1" }.to_owned());
                other.subject = Some(if swap { "s1" } else { "s2" }.to_owned());
                other.name.push('b');
                both.extend([(one, frames.clone()), (other, stoops)]);
            }
            both
        };
        let told = score("identification", &of(&folder, "people", people(false)));
        assert!(value(&told) > 0.9, "{}", value(&told));
        assert_eq!(told["baselines"][0]["value"], 0.5);
        assert!(told["features"].is_null(), "nothing is known of them but who they are");
        let mixed = score("identification", &of(&folder, "mixed", people(true)));
        assert!(value(&mixed) < value(&told) - 0.2, "{}", value(&mixed));

        // Four people, of whom the two old women stoop. Each is told by another one.
        let four = |shuffled: bool| {
            let mut all_four = people(false);
            for (at, (entry, _)) in all_four.iter_mut().enumerate() {
                let stoops = entry.subject.as_deref() == Some("s2");
                let stoops = stoops != (shuffled && at % 4 < 2);
                let second = at % 8 > 3;
                entry.subject = Some(format!("{}{}", if stoops { "w" } else { "b" }, second as u8));
            }
            let corpus = of(&folder, &format!("four-{shuffled}"), all_four);
            let person = |(id, gender, age): (&str, &str, f64)| SubjectEntry {
                subject: Subject {
                    id: id.to_owned(),
                    gender: gender.to_owned(),
                    measures: [(Measure::Age, age)].into(),
                    ..Subject::default()
                },
                ..SubjectEntry::default()
            };
            let known = [
                ("b0", "male", 10.0),
                ("b1", "male", 12.0),
                ("w0", "female", 70.0),
                ("w1", "female", 71.0),
            ];
            let mut store = Store::open_to_change(Path::new(&corpus)).expect("a corpus");
            store.tell_of(&known.map(person)).expect("told");
            drop(store);
            score("identification", &corpus)
        };
        let (told, mixed) = (four(false), four(true));
        let of = |report: &Value, at: usize, name: &str| {
            report["features"][at][name].as_f64().expect("a figure")
        };
        // Not all reaches have one alike among those of another person.
        assert!(of(&told, 0, "value") > of(&told, 0, "baseline") + 25.0, "{told}");
        assert!(of(&told, 1, "value") < 0.5 * of(&told, 1, "baseline"), "{told}");
        assert!(of(&mixed, 0, "value") < of(&told, 0, "value") - 20.0, "{mixed}");
        assert!(of(&mixed, 1, "value") > of(&told, 1, "value") + 10.0, "{mixed}");
    }
}

/// Keys and shapes as BeyondMimic's `MotionLoader` takes them, and velocities that are those of the places.
const NUMPY: &str = "
import json, sys, numpy as np
data = np.load(sys.argv[1], allow_pickle=False)
fps, pos, vel = float(data['fps'][0]), data['body_pos_w'], data['body_lin_vel_w']
steps = np.gradient(pos, 1.0 / fps, axis=0)
quat = data['body_quat_w']
joint = np.gradient(data['joint_pos'], 1.0 / fps, axis=0)
print(json.dumps({
  'shapes': {name: list(data[name].shape) for name in data.files},
  'fps': fps,
  'bodies': [str(name) for name in data['body_names']],
  'joints': [str(name) for name in data['joint_names']],
  'linear': float(np.abs(steps - vel).max()),
  'joint': float(np.abs(joint - data['joint_vel']).max()),
  'unit': float(np.abs(np.linalg.norm(quat, axis=2) - 1.0).max()),
}))
";

#[test]
fn what_a_robot_would_do_is_read_by_numpy_as_learners_of_tracking_read_it() {
    let python = match python::python() {
        Ok(python) => python,
        Err(why) => {
            aloud!("SKIPPED: {why}");
            return;
        }
    };
    let (folder, corpus) = new("sets-npz");
    generate(&corpus, &["--part", "80/330"]);
    let out = folder.join("npz").display().to_string();
    let arguments =
        ["corpus", "export", &corpus, "", "--format", "robot-npz", "--robot", "op3", "-o", &out];
    assert!(gaitway().args(arguments).output().expect("runs").status.success());
    let about = std::fs::read_to_string(Path::new(&out).join("export.json")).expect("a report");
    let about: Value = serde_json::from_str(&about).expect("JSON");
    let file = Path::new(&out).join(about["trials"][0]["files"][0].as_str().expect("a file"));
    let read = std::process::Command::new(&python.program).args(["-c", NUMPY]).arg(&file).output();
    let read = read.expect("Python");
    assert!(read.status.success(), "{}", String::from_utf8_lossy(&read.stderr));
    let read: Value = serde_json::from_slice(&read.stdout).expect("JSON");
    assert_eq!(read["fps"], 50.0);
    assert_eq!(read["joints"], about["joints"]);
    let joints = about["joints"].as_array().expect("joints").len();
    let bodies = read["bodies"].as_array().expect("bodies").len();
    let frames = read["shapes"]["joint_pos"][0].as_u64().expect("frames");
    assert!(frames > 50 && bodies > joints, "{read}");
    for (key, rest) in [
        ("joint_vel", vec![joints]),
        ("body_pos_w", vec![bodies, 3]),
        ("body_quat_w", vec![bodies, 4]),
        ("body_lin_vel_w", vec![bodies, 3]),
        ("body_ang_vel_w", vec![bodies, 3]),
    ] {
        let shape: Vec<usize> = serde_json::from_value(read["shapes"][key].clone()).expect(key);
        assert_eq!((shape[0] as u64, &shape[1..]), (frames, &rest[..]), "{key}");
    }
    for (key, most) in [("linear", 2e-3), ("joint", 2e-3), ("unit", 1e-5)] {
        assert!(read[key].as_f64().expect(key) < most, "{key}: {read}");
    }
}

/// Directions of limbs by the turns of the one file and by the markers of the other: neither reader is ours.
const TWO_FILES: &str = "
import json, sys, numpy as np, ezc3d
c3d, npz = ezc3d.c3d(sys.argv[1]), np.load(sys.argv[2], allow_pickle=False)
labels = c3d['parameters']['POINT']['LABELS']['value']
points = c3d['data']['points'][:3].transpose(2, 1, 0)
at = lambda name: points[:, labels.index(name)]
names = [str(name) for name in npz['segment_names']]
parents = {'torso': 'pelvis', 'head': 'torso'}
for side in ('left', 'right'):
    for of, to in (('upper_arm', 'torso'), ('forearm', 'upper_arm'), ('thigh', 'pelvis'), ('shank', 'thigh'), ('foot', 'shank')):
        parents[f'{side}_{of}'] = to if to in ('torso', 'pelvis') else f'{side}_{to}'
turns = npz['poses'].reshape(len(npz['poses']), len(names), 3)
def matrix(v):
    angle = np.linalg.norm(v)
    if angle < 1e-12: return np.eye(3)
    x, y, z = v / angle
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k
worst = 0.0
for frame in range(0, len(turns), 7):
    world = {}
    for name, turn in zip(names, turns[frame]):
        own = matrix(turn.astype(float))
        world[name] = world[parents[name]] @ own if name in parents else own
    for side in ('left', 'right'):
        for segment, a, b in (('upper_arm', 'shoulder', 'elbow'), ('forearm', 'elbow', 'wrist'), ('thigh', 'hip', 'knee'), ('shank', 'knee', 'ankle')):
            way = at(f'{side}_{b}')[frame] - at(f'{side}_{a}')[frame]
            told = world[f'{side}_{segment}'] @ np.array([0, 0, -1.0])
            worst = max(worst, np.degrees(np.arccos(np.clip(way @ told / np.linalg.norm(way), -1, 1))))
print(json.dumps({
  'worst_deg': float(worst), 'frames': [len(points), len(turns)],
  'rates': [float(c3d['parameters']['POINT']['RATE']['value'][0]), float(npz['mocap_framerate'])],
  'unit': c3d['parameters']['POINT']['UNITS']['value'][0],
  'pelvis_mm': float(np.abs(at('pelvis') - 1e3 * npz['trans']).max()),
  'labels': len(labels), 'stature_m': float(npz['stature_m']),
}))
";

#[test]
fn markers_and_turns_that_are_passed_on_are_of_one_motion_to_others() {
    let python = match python::python() {
        Ok(python) => python,
        Err(why) => {
            aloud!("SKIPPED: {why}");
            return;
        }
    };
    let (folder, corpus) = new("sets-two-files");
    generate(&corpus, &["--part", "80/330"]);
    let file = |format: &str| {
        let out = folder.join(format).display().to_string();
        let arguments = ["corpus", "export", &corpus, "", "--format", format, "-o", &out];
        let run = gaitway().args(arguments).output().expect("runs");
        assert!(run.status.success(), "{}", words(&run));
        let about = std::fs::read_to_string(Path::new(&out).join("export.json")).expect("a report");
        let about: Value = serde_json::from_str(&about).expect("JSON");
        Path::new(&out).join(about["trials"][0]["files"][0].as_str().expect("a file"))
    };
    let read = std::process::Command::new(&python.program)
        .args(["-c", TWO_FILES])
        .args([file("c3d"), file("axis-angle")])
        .output()
        .expect("Python");
    assert!(read.status.success(), "{}", String::from_utf8_lossy(&read.stderr));
    let read: Value = serde_json::from_slice(&read.stdout).expect("JSON");
    assert!(read["worst_deg"].as_f64().expect("deg") < 0.02, "{read}");
    assert!(read["pelvis_mm"].as_f64().expect("mm") < 1e-2, "{read}");
    assert_eq!(read["frames"][0], read["frames"][1]);
    assert_eq!((&read["rates"][0], &read["rates"][1]), (&Value::from(120.0), &Value::from(120.0)));
    assert_eq!((&read["unit"], &read["labels"]), (&Value::from("mm"), &Value::from(22)));
    assert_eq!(read["stature_m"], 1.75);
}
