//! Markers cleaned: what the command writes, what it leaves alone, how well gaps are filled and artefacts found.

#[path = "clean/artefacts.rs"]
mod artefacts;
#[path = "clean/gaps.rs"]
mod gaps;
#[path = "clean/joints.rs"]
mod joints;
#[path = "clean/made.rs"]
mod made;

use crate::captured;
use crate::program;
use crate::program::{folder, gaitway, json, words};
use gaitway::clean::aids::Aids;
use gaitway::clean::choice::Chooser;
use gaitway::clean::detect;
use gaitway::clean::edits::{EditList, Remedy};
use gaitway::clean::fill::Method;
use gaitway::clean::trial::Trial;
use gaitway::mocap::marker_files;
use gaitway::mocap::markers::{Frame, Markers};
use glam::DVec3;
use made::{Body, write_c3d};
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

fn clean(folder: &Path, arguments: &str) -> Output {
    let mut command = gaitway();
    command.current_dir(folder).arg("clean").args(arguments.split_whitespace());
    command.output().expect("the command")
}

fn place(markers: &Markers, point: usize, frame: usize) -> Option<[u32; 3]> {
    markers.sample(frame, point).map(|sample| sample.position.map(f32::to_bits))
}

/// Gaps of so many frames, each of one marker.
const GAPS: [(usize, std::ops::Range<usize>); 3] = [(2, 100..112), (7, 200..250), (2, 280..340)];

#[test]
fn gaps_are_filled_and_every_other_sample_stays_as_it_is_bit_for_bit() {
    let folder = folder("gaps");
    let truth = Body::new(5).markers(&[]);
    let raw = Body::new(5).markers(&GAPS);
    write_c3d(&folder.join("raw.c3d"), &raw);
    let output = clean(&folder, "raw.c3d -o out.c3d --json");
    assert_eq!(output.status.code(), Some(0), "{}", words(&output));
    let report = json(&output);
    assert_eq!(report["outcome"], "done");
    let artefacts = report["artefacts"].as_array().expect("a list");
    assert_eq!(artefacts.len(), GAPS.len(), "{report:#}");
    for (artefact, (marker, frames)) in artefacts.iter().zip([&GAPS[0], &GAPS[2], &GAPS[1]]) {
        assert_eq!(artefact["kind"], "dropout");
        assert_eq!(artefact["marker"], format!("M{marker}"));
        assert_eq!(artefact["cause"], "occlusion");
        let start_s = artefact["start_s"].as_f64().expect("a time");
        assert!((start_s - frames.start as f64 / 100.0).abs() < 1e-9, "{artefact}");
        let expected_m = artefact["expected_error_m"].as_f64().expect("an expectation");
        assert!((1e-6..0.02).contains(&expected_m), "{artefact}");
    }
    let out = marker_files::read(&folder.join("out.c3d"), None).expect("read");
    let (mut same, mut filled) = (0, 0);
    for frame in 0..out.head().frames {
        for point in 0..out.head().points.len() {
            let is_gap =
                GAPS.iter().any(|(marker, frames)| *marker == point && frames.contains(&frame));
            if is_gap {
                let (is, was) = (out.sample(frame, point), truth.sample(frame, point));
                let [is, was] =
                    [is, was].map(|of| DVec3::from(of.expect("seen").position.map(f64::from)));
                assert!(is.distance(was) < 20.0, "{} mm off", is.distance(was));
                filled += 1;
            } else {
                assert_eq!(place(&out, point, frame), place(&raw, point, frame));
                same += 1;
            }
        }
    }
    assert_eq!(report["filled_samples"], filled);
    let untouched = &report["untouched_sha256"];
    assert_eq!(untouched["samples"], same);
    assert_eq!(untouched["before"], untouched["after"]);
    assert_eq!(untouched["before"].as_str().map(str::len), Some(64));
}

#[test]
fn an_edit_list_applied_again_gives_the_same_file_and_an_edit_that_is_deleted_is_undone_alone() {
    let folder = folder("again");
    write_c3d(&folder.join("raw.c3d"), &Body::new(6).markers(&GAPS));
    assert_eq!(clean(&folder, "raw.c3d -o out.c3d").status.code(), Some(0));
    let again = clean(&folder, "raw.c3d -o again.c3d --edits out.edits.toml --json");
    assert_eq!(again.status.code(), Some(0), "{}", words(&again));
    let bytes = |name: &str| fs::read(folder.join(name)).expect("a file");
    assert_eq!(bytes("out.c3d"), bytes("again.c3d"));

    let text = String::from_utf8(bytes("out.edits.toml")).expect("text");
    let mut list = EditList::parse(&text).expect("a list");
    assert_eq!(list.edits.len(), GAPS.len());
    let undone = list.edits.remove(0);
    assert_eq!((undone.first_frame, undone.last_frame), (101, 112), "as the file counts");
    list.edits[0].remedy = Remedy::Leave;
    fs::write(folder.join("less.toml"), list.to_text().expect("text")).expect("a file");
    let less = clean(&folder, "raw.c3d -o less.c3d --edits less.toml --json");
    assert_eq!(less.status.code(), Some(3), "a gap is left: {}", words(&less));
    let read = |name: &str| marker_files::read(&folder.join(name), None).expect("read");
    let (whole, less) = (read("out.c3d"), read("less.c3d"));
    for frame in 0..whole.head().frames {
        for point in 0..whole.head().points.len() {
            let is_left = point == 2 && (GAPS[0].1.contains(&frame) || GAPS[2].1.contains(&frame));
            let expected = if is_left { None } else { place(&whole, point, frame) };
            assert_eq!(place(&less, point, frame), expected);
        }
    }
}

/// The markers of [`Body`], and a nameless point that has a piece of one of them.
fn with_a_nameless_piece(
    truth: &Markers,
    raw: &Markers,
    piece: (usize, std::ops::Range<usize>),
) -> Markers {
    let mut head = raw.head().clone();
    let mut point = head.points[0].clone();
    point.label = "*15".to_owned();
    head.points.push(point);
    let mut all = Markers::with_room(head).expect("room");
    let (mut frame, mut full) = (Frame::default(), Frame::default());
    for number in 0..raw.head().frames {
        assert!(raw.frame(number, &mut frame) && truth.frame(number, &mut full));
        let nameless = piece.1.contains(&number).then(|| full.points[piece.0]).flatten();
        frame.points.push(nameless);
        all.push(&frame);
    }
    all
}

#[test]
fn a_person_crops_takes_sections_out_and_gives_nameless_pieces_their_names() {
    let folder = folder("by-hand");
    let (truth, raw) = (Body::new(9).markers(&[]), Body::new(9).markers(&GAPS));
    let raw = with_a_nameless_piece(&truth, &raw, (7, 200..250));
    write_c3d(&folder.join("raw.c3d"), &raw);
    let list = "schema = 1\nsource = \"raw.c3d\"\nkeep_frames = [51, 400]\n\n\
        [[edit]]\nkind = \"by_hand\"\nmarker = \"M7\"\nfirst_frame = 201\nlast_frame = 250\n\
        remedy = \"exchange\"\nwith = \"*15\"\n\n\
        [[edit]]\nkind = \"by_hand\"\nmarker = \"M3\"\nfirst_frame = 301\nlast_frame = 310\n\
        remedy = \"remove\"\n";
    fs::write(folder.join("hand.toml"), list).expect("a file");
    let output = clean(&folder, "raw.c3d -o out.c3d --edits hand.toml --json");
    assert_eq!(output.status.code(), Some(0), "{}", words(&output));
    let report = json(&output);
    assert_eq!(report["cropped_frames"], 150);
    assert_eq!(report["removed_samples"], 10);
    assert_eq!(report["untouched_sha256"]["before"], report["untouched_sha256"]["after"]);
    let out = marker_files::read(&folder.join("out.c3d"), None).expect("read");
    assert_eq!((out.head().first_frame, out.head().frames), (51, 350));
    for frame in 50..400 {
        for point in 0..out.head().points.len() {
            let is = place(&out, point, frame - 50);
            let was = match (point, frame) {
                (7, 200..250) => place(&truth, 7, frame),
                (15, _) | (3, 300..310) => None,
                _ => place(&raw, point, frame),
            };
            assert_eq!(is, was, "point {point}, frame {frame}");
        }
    }
    for (from, to) in [
        ("[51, 400]", "[51, 501]"),
        ("[51, 400]", "[0, 400]"),
        ("[51, 400]", "[60, 51]"),
        ("[51, 400]", "[51, 400, 7]"),
        ("[51, 400]", "[51]"),
    ] {
        fs::write(folder.join("hand.toml"), list.replace(from, to)).expect("a file");
        let output = clean(&folder, "raw.c3d -o no.c3d --edits hand.toml");
        assert_eq!(output.status.code(), Some(1), "{to}");
        assert!(words(&output).contains("keep_frames"), "{to}: {}", words(&output));
        assert!(!folder.join("no.c3d").exists(), "{to}");
    }
}

#[test]
fn a_list_without_edits_takes_edits_that_a_person_adds() {
    let list = EditList {
        schema: 1,
        source: "raw.c3d".to_owned(),
        source_sha256: None,
        keep_frames: None,
        minutes: None,
        static_trial: None,
        other_trials: Vec::new(),
        aids_sha256: None,
        edits: Vec::new(),
    };
    let text = list.to_text().expect("text");
    let own = "[[edit]]\nkind = \"by_hand\"\nmarker = \"M1\"\nfirst_frame = 2\nlast_frame = 3\n\
               remedy = \"remove\"\n";
    let read = EditList::parse(&format!("{text}\n{own}")).expect("a list");
    assert_eq!((read.edits.len(), read.edits[0].remedy), (1, Remedy::Remove));
}

#[test]
fn where_no_room_is_left_the_file_that_was_to_be_written_is_named_and_nothing_stays() {
    let folder = folder("full");
    write_c3d(&folder.join("raw.c3d"), &Body::new(6).markers(&GAPS));
    // Files may have 8 kB and no more.
    for deed in ["clean raw.c3d -o out.c3d", "convert raw.c3d out.c3d"] {
        let line = format!("trap '' XFSZ; ulimit -f 8; exec {} {deed}", program::PATH);
        let output = Command::new("bash").args(["-c", &line]).current_dir(&folder).output();
        let output = output.expect("the command");
        assert_eq!(output.status.code(), Some(1), "{}", words(&output));
        assert!(words(&output).contains("out.c3d"), "{deed}: {}", words(&output));
        let left = fs::read_dir(&folder).expect("a folder").count();
        assert_eq!(left, 1, "{deed}");
    }
}

#[test]
fn an_edit_list_that_cannot_be_applied_is_refused_with_what_is_wrong() {
    let folder = folder("refused");
    write_c3d(&folder.join("raw.c3d"), &Body::new(7).markers(&GAPS));
    write_c3d(&folder.join("other.c3d"), &Body::new(8).markers(&GAPS));
    assert_eq!(clean(&folder, "raw.c3d -o out.c3d").status.code(), Some(0));
    let text = fs::read_to_string(folder.join("out.edits.toml")).expect("a list");
    for (from, to, file, said) in [
        ("", "", "other.c3d", "belongs to other markers"),
        ("schema = 1", "schema = 2", "raw.c3d", "another version"),
        ("marker = \"M2\"", "marker = \"M21\"", "raw.c3d", "no such marker"),
        ("last_frame = 112", "last_frame = 11200", "raw.c3d", "no such frames"),
        ("first_frame = 101", "first_frame = 0", "raw.c3d", "no such frames"),
        ("remedy = \"fill\"", "remedy = \"fil\"", "raw.c3d", "did you mean `fill`"),
        ("method = ", "# method = ", "raw.c3d", "lacks `method`"),
        ("remedy = \"fill\"", "remedy = \"exchange\"", "raw.c3d", "lacks `with`"),
    ] {
        fs::write(folder.join("edits.toml"), text.replacen(from, to, 1)).expect("a file");
        let output = clean(&folder, &format!("{file} -o no.c3d --edits edits.toml"));
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(words(&output).contains(said), "{said}: {}", words(&output));
        assert!(!folder.join("no.c3d").exists(), "{said}");
    }
    let output = clean(&folder, "raw.c3d -o out.c3d");
    assert_eq!(output.status.code(), Some(1));
    assert!(words(&output).contains("--force"), "{}", words(&output));
    let output = clean(&folder, "raw.c3d -o raw.c3d --force");
    assert_eq!(output.status.code(), Some(1), "the file that is read is never written over");
    assert_eq!(clean(&folder, "raw.c3d -o out.txt").status.code(), Some(1));
}

#[test]
fn what_is_wrong_is_mended_and_said_and_tables_and_texts_are_cleaned_too() {
    let folder = folder("mended");
    let body = Body::new(9);
    let mut raw = body.trial();
    for frame in 150..170 {
        let off = raw.at(4, frame).map(|place| place + DVec3::new(0.03, -0.04, 0.0));
        raw.put(4, frame, off);
    }
    raw.exchange(8, 10, 220..260);
    let stands = raw.at(0, 299);
    (300..330).for_each(|frame| raw.put(0, frame, stands));
    for ending in ["c3d", "trc", "csv"] {
        let markers = made::markers_of(&raw, "mm");
        made::write(&folder.join(format!("raw.{ending}")), &markers);
        let output = clean(&folder, &format!("raw.{ending} -o out-{ending}.{ending} --json"));
        assert_eq!(output.status.code(), Some(0), "{}", words(&output));
        let report = json(&output);
        let found: Vec<(&str, &str, f64, f64)> = report["artefacts"]
            .as_array()
            .expect("a list")
            .iter()
            .map(|of| {
                let text = |key: &str| of[key].as_str().expect("a text");
                let time = |key: &str| of[key].as_f64().expect("a time");
                (text("kind"), text("marker"), time("start_s"), time("end_s"))
            })
            .collect();
        let expected =
            [("stuck", "M0", 3.0, 3.3), ("jump", "M4", 1.5, 1.7), ("swap_inside", "M8", 2.2, 2.6)];
        assert_eq!(found.len(), expected.len(), "{report:#}");
        for (found, expected) in found.iter().zip(expected) {
            assert_eq!((found.0, found.1), (expected.0, expected.1), "{report:#}");
            assert!((found.2 - expected.2).abs() < 0.015, "{found:?}");
            assert!((found.3 - expected.3).abs() < 0.015, "{found:?}");
        }
        let out =
            marker_files::read(&folder.join(format!("out-{ending}.{ending}")), None).expect("read");
        let unit_m = out.head().metres_per_unit().expect("a unit");
        let truth = body.trial();
        for marker in 0..truth.markers() {
            for frame in 0..truth.frames() {
                let sample = out.sample(frame, marker).expect("nothing is missing");
                let is = DVec3::from(sample.position.map(f64::from)) * unit_m;
                let off_m = is.distance(truth.at(marker, frame).expect("seen"));
                assert!(off_m < 0.01, "{marker} in frame {frame}: {off_m} m");
            }
        }
    }
}

#[test]
fn a_body_in_which_nothing_is_wrong_is_left_whole() {
    for seed in 20..26 {
        let trial = Body::new(seed).trial();
        assert_eq!(detect::artefacts(&trial, |_, _| {}), [], "seed {seed}");
    }
}

/// Trials that nobody recorded.
fn hostile() -> Vec<(&'static str, Trial)> {
    let labels = |count: usize| (0..count).map(|of| format!("M{of}")).collect();
    let trial =
        |count: usize, frames: usize| Trial::new(100.0, labels(count), frames).expect("room");
    let filled = |count, frames, place: &dyn Fn(usize, usize) -> Option<DVec3>| {
        let mut trial = trial(count, frames);
        for marker in 0..count {
            (0..frames).for_each(|frame| trial.put(marker, frame, place(marker, frame)));
        }
        trial
    };
    let scatter = |marker: usize, frame: usize| {
        let at = |of: u64| made::noise(of ^ (marker as u64) << 32 ^ (frame as u64) << 8);
        Some(DVec3::new(at(1), at(2), at(3)))
    };
    vec![
        ("nothing", trial(0, 0)),
        ("no frames", trial(5, 0)),
        ("no markers", trial(0, 50)),
        ("one frame", filled(8, 1, &scatter)),
        ("two frames", filled(8, 2, &scatter)),
        ("all missing", trial(12, 200)),
        ("one marker", filled(1, 300, &|m, f| scatter(m, f).filter(|_| f % 9 != 4))),
        ("all in one place", filled(12, 120, &|_, f| Some(DVec3::ONE).filter(|_| f % 20 != 3))),
        ("scattered", filled(12, 200, &|m, f| scatter(m, f).filter(|_| (m + f) % 7 != 0))),
        ("every second", filled(12, 200, &|m, f| scatter(m, f).filter(|_| f % 2 == 0))),
        ("not a number", filled(12, 200, &|_, f| Some(DVec3::new(f64::NAN, 0.0, f as f64)))),
        ("infinite", filled(12, 200, &|_, f| Some(DVec3::splat(1e30 * f as f64)))),
        ("far", filled(12, 200, &|m, f| Some(DVec3::splat(900.0 + (m * f % 90) as f64)))),
        ("tiny", filled(12, 200, &|m, f| Some(DVec3::splat((m * f) as f64 * 1e-42)))),
        ("many markers", filled(10_000, 3, &|m, f| scatter(m, f).filter(|_| m % 5 != f))),
    ]
}

#[test]
fn no_trial_however_odd_breaks_anything() {
    for (name, trial) in hostile() {
        let found = detect::artefacts(&trial, |_, _| {});
        for artefact in &found {
            let range = &artefact.frames;
            assert!(range.start < range.end && range.end <= trial.frames(), "{name}: {artefact:?}");
            assert!((0.0..=1.0).contains(&artefact.confidence), "{name}: {artefact:?}");
        }
        let mut left = trial.clone();
        // Every other is one of the other trials.
        let others = hostile().into_iter().filter(|of| of.0 != name && of.0 != "many markers");
        let others: Vec<Trial> = others.map(|(_, trial)| trial).collect();
        let mut aids = Aids { body: None, others: others.clone() };
        for marker in 0..trial.markers().min(40) {
            for gap in trial.gaps(marker).into_iter().take(3) {
                let mut chooser = Chooser::new(&mut left, &mut aids);
                let choice = chooser.choose(&gap);
                for method in Method::ALL {
                    let places = chooser.fill(&gap, method).unwrap_or_default();
                    assert!(places.iter().all(|place| place.is_finite()), "{name}: {method:?}");
                    assert!(places.is_empty() || places.len() == gap.frames.len(), "{name}");
                }
                if let Some(method) = choice.method {
                    assert!(chooser.fill(&gap, method).is_some(), "{name}: {choice:?}");
                }
            }
        }
        assert_eq!(format!("{left:?}"), format!("{trial:?}"), "{name}: choosing changes nothing");
        assert_eq!(format!("{:?}", aids.others), format!("{others:?}"), "{name}: nor here");
    }
}

#[test]
fn where_a_trial_is_too_short_the_expectation_comes_from_elsewhere_and_says_so() {
    let folder = folder("short");
    write_c3d(&folder.join("raw.c3d"), &Body::new(11).part(0..70, &[(3, 20..50)]));
    let of = |arguments: &str, from: &str, said: &str| {
        let output = clean(&folder, &format!("{arguments} --force --json"));
        let report = json(&output);
        let artefacts = report["artefacts"].as_array().expect("a list");
        assert_eq!(artefacts.len(), 1, "{report:#}");
        assert_eq!(artefacts[0]["expected_from"], from, "{report:#}");
        assert!(report["notes"].to_string().contains(said), "{report:#}");
        (artefacts[0]["fill"].clone(), artefacts[0]["expected_error_m"].as_f64().expect("known"))
    };
    let (fill, error_m) = of("raw.c3d -o out.c3d", "stored", "stored figures");
    assert_eq!(fill, "pattern", "the usual way");
    // Between what a walk and stairs show for 0.25 and 0.5 s.
    assert!((0.001..0.01).contains(&error_m), "{error_m}");
    // Somebody else, in trials that are long enough; what others do is not the same as what this one does.
    fs::create_dir(folder.join("others")).expect("a folder");
    for seed in [12, 13] {
        let file = folder.join(format!("others/{seed}.c3d"));
        write_c3d(&file, &Body::new(seed).markers(&[]));
    }
    let (_, error_m) = of("raw.c3d -o out.c3d --others others", "other_trials", "tried on other");
    assert!((1e-5..0.01).contains(&error_m), "{error_m}");
    // Longer than anything that is stored.
    write_c3d(&folder.join("raw.c3d"), &Body::new(11).part(0..150, &[(3, 10..140)]));
    let report = json(&clean(&folder, "raw.c3d -o out.c3d --force --json"));
    assert!(report["artefacts"][0]["expected_error_m"].is_null(), "{report:#}");
    assert!(report["artefacts"][0]["expected_from"].is_null(), "{report:#}");
    assert!(report["notes"].to_string().contains("nobody knows"), "{report:#}");
}

/// An edit list of one fill.
fn one_fill(marker: &str, frames: [u64; 2], method: &str, needs: &str) -> String {
    format!(
        "schema = 1\nsource = \"raw.c3d\"\n{needs}\n[[edit]]\nkind = \"by_hand\"\nmarker = \"{marker}\"\n\
         first_frame = {}\nlast_frame = {}\nremedy = \"fill\"\nmethod = \"{method}\"\n",
        frames[0], frames[1]
    )
}

#[test]
fn a_short_trial_is_filled_after_other_trials_of_the_same_body() {
    let folder = folder("others");
    // Its thigh swings for too short a time to tell how markers go together.
    let (whole, raw) = (Body::new(31).part(0..60, &[]), Body::new(31).part(0..60, &[(7, 12..48)]));
    write_c3d(&folder.join("raw.c3d"), &raw);
    write_c3d(&folder.join("other.c3d"), &Body::new(31).part(100..500, &[]));
    let off_mm = |method: &str, needs: &str| {
        let list = one_fill("M7", [13, 48], method, needs);
        fs::write(folder.join("edits.toml"), list).expect("a file");
        let output = clean(&folder, "raw.c3d -o out.c3d --edits edits.toml --force");
        assert_eq!(output.status.code(), Some(0), "{}", words(&output));
        let out = marker_files::read(&folder.join("out.c3d"), None).expect("read");
        let place = |markers: &Markers, frame| {
            DVec3::from(markers.sample(frame, 7).expect("filled").position.map(f64::from))
        };
        let off = (12..48).map(|frame| place(&out, frame).distance(place(&whole, frame)));
        off.sum::<f64>() / 36.0
    };
    let cubic = off_mm("cubic", "");
    let others = off_mm("other_trials", "other_trials = [\"other.c3d\"]\n");
    println!("cubic {cubic:.1} mm, by another trial {others:.1} mm");
    assert!(others < 3.0 && others < cubic / 3.0, "{others} mm by another trial, {cubic} mm cubic");

    let list = one_fill("M7", [13, 48], "other_trials", "other_trials = [\"gone.c3d\"]\n");
    fs::write(folder.join("edits.toml"), list).expect("a file");
    let output = clean(&folder, "raw.c3d -o no.c3d --edits edits.toml");
    assert_eq!(output.status.code(), Some(1));
    assert!(words(&output).contains("gone.c3d") && words(&output).contains("--others"));
}

#[test]
fn what_a_fill_makes_use_of_stands_in_the_edit_list_and_must_be_the_same_when_it_is_applied() {
    let folder = folder("aids");
    // A whole segment is missing, for most of the trial.
    let gaps = [5, 6, 7, 8, 9].map(|marker| (marker, 12..48));
    write_c3d(&folder.join("raw.c3d"), &Body::new(31).part(0..60, &gaps));
    write_c3d(&folder.join("other.c3d"), &Body::new(31).part(100..300, &[]));
    write_c3d(&folder.join("third.c3d"), &Body::new(31).part(300..500, &[]));
    let done = clean(&folder, "raw.c3d -o out.c3d --others other.c3d --others third.c3d");
    assert_eq!(done.status.code(), Some(0), "{}", words(&done));
    let text = fs::read_to_string(folder.join("out.edits.toml")).expect("a list");
    let list = EditList::parse(&text).expect("a list");
    assert_eq!(list.edits[0].method, Some(Method::OtherTrials), "{text}");
    assert_eq!(list.other_trials, ["other.c3d", "third.c3d"], "{text}");
    let again = clean(&folder, "raw.c3d -o again.c3d --edits out.edits.toml");
    assert_eq!(again.status.code(), Some(0), "{}", words(&again));
    let bytes = |name: &str| fs::read(folder.join(name)).expect("a file");
    assert_eq!(bytes("out.c3d"), bytes("again.c3d"));
    write_c3d(&folder.join("other.c3d"), &Body::new(31).part(101..300, &[]));
    let output = clean(&folder, "raw.c3d -o no.c3d --edits out.edits.toml");
    assert_eq!(output.status.code(), Some(1));
    assert!(words(&output).contains("aids_sha256"), "{}", words(&output));
    assert!(!folder.join("no.c3d").exists());
}

#[test]
fn a_skeleton_carries_a_marker_over_a_gap_whoever_shows_the_skeleton() {
    let Some(pig) = captured::captured("mocap/c3d/pig") else { return };
    let folder = folder("skeleton");
    fs::copy(pig.join(gaps::STANDING[0]), folder.join("static.c3d")).expect("a copy");
    let whole = marker_files::read(&pig.join(gaps::TRIALS[0].1), None).expect("a trial");
    let point = |label: &str| {
        whole.head().points.iter().position(|of| of.label == label).expect("a marker")
    };
    let knee = point("LKNE");
    let mut raw = Markers::with_room(whole.head().clone()).expect("room");
    let mut frame = Frame::default();
    for number in 0..whole.head().frames {
        assert!(whole.frame(number, &mut frame));
        if (100..150).contains(&number) {
            frame.points[knee] = None;
        }
        raw.push(&frame);
    }
    write_c3d(&folder.join("raw.c3d"), &raw);
    let first = whole.head().first_frame;
    let frames = [first + 100, first + 149];
    let run = |list: String| {
        fs::write(folder.join("edits.toml"), list).expect("a file");
        clean(&folder, "raw.c3d -o out.c3d --edits edits.toml --force --json")
    };
    // A walk in which nobody stands still shows a poor skeleton; the choice would not take it.
    for (needs, most_mm) in [("static_trial = \"static.c3d\"\n", 15.0), ("", 100.0)] {
        let output = run(one_fill("LKNE", frames, "skeleton", needs));
        assert_eq!(output.status.code(), Some(0), "{}", words(&output));
        let out = marker_files::read(&folder.join("out.c3d"), None).expect("read");
        let place = |markers: &Markers, frame| {
            DVec3::from(markers.sample(frame, knee).expect("filled").position.map(f64::from))
        };
        let off = (100..150).map(|frame| place(&out, frame).distance(place(&whole, frame)));
        let off_mm = off.sum::<f64>() / 50.0;
        println!("{needs:?}: {off_mm:.1} mm");
        assert!(off_mm < most_mm, "{needs:?}: {off_mm} mm");
    }
    // Nobody stands in a file of other markers.
    write_c3d(&folder.join("nobody.c3d"), &Body::new(3).markers(&[]));
    let output = clean(&folder, "raw.c3d -o other.c3d --static nobody.c3d");
    assert_eq!(output.status.code(), Some(1));
    assert!(words(&output).contains("nobody.c3d"), "{}", words(&output));
}

#[test]
fn a_gap_whose_fill_would_miss_by_more_than_is_tolerated_is_left_and_counts_as_loss() {
    let folder = folder("tolerance");
    write_c3d(&folder.join("raw.c3d"), &Body::new(12).markers(&GAPS));
    let output = clean(&folder, "raw.c3d -o out.c3d --tolerance 0.000001 --json");
    assert_eq!(output.status.code(), Some(3), "{}", words(&output));
    let report = json(&output);
    assert_eq!(
        (&report["outcome"], &report["filled_samples"]),
        (&"done_with_loss".into(), &0.into())
    );
    for artefact in report["artefacts"].as_array().expect("a list") {
        assert_eq!(artefact["remedy"], "leave", "{artefact}");
        assert!(artefact["expected_error_m"].is_number(), "{artefact}");
    }
}

#[test]
fn thresholds_that_lie_in_the_folder_travel_with_the_corpus() {
    let folder = folder("thresholds");
    write_c3d(&folder.join("gaps.c3d"), &Body::new(14).markers(&GAPS));
    let check = |arguments: &str| clean(&folder, &format!(". --check --json {arguments}"));
    let allowed = |text: &str| fs::write(folder.join("clean.toml"), text).expect("a file");
    assert_eq!(check("").status.code(), Some(3), "1.6 % are above the usual 1 %");
    allowed("schema = 1\nmost_doubt_percent = 2\n");
    let report = json(&check(""));
    assert_eq!((&report["outcome"], &report["most_doubt"]), (&"done".into(), &0.02.into()));
    assert_eq!(report["thresholds"], "./clean.toml");
    assert_eq!(check("--most-doubt 1").status.code(), Some(3), "what is typed counts more");
    allowed("schema = 1\nmost_doubt_percent = 2\n[most]\ndropout = 2\nfallen = 0\n");
    let output = check("");
    assert_eq!(output.status.code(), Some(3), "three gaps are more than two");
    assert_eq!(json(&output)["trials"][0]["above"], serde_json::json!(["dropout"]));
    for (text, said) in [
        ("schema = 2", "another version"),
        ("schema = 1\nmost_doubt = 2", "line 2"),
        ("schema = 1\nmost_doubt_percent = 101", "0 to 100"),
        ("schema = 1\n[most]\ndrop = 2", "clean.toml"),
    ] {
        allowed(text);
        let output = check("");
        assert_eq!(output.status.code(), Some(1), "{text}");
        assert!(words(&output).contains(said), "{said}: {}", words(&output));
    }
}

#[test]
fn a_folder_is_cleaned_round_after_round_and_what_came_of_each_is_kept() {
    let folder = folder("rounds");
    fs::create_dir_all(folder.join("raw/more")).expect("a folder");
    write_c3d(&folder.join("raw/good.c3d"), &Body::new(13).markers(&[]));
    made::write(&folder.join("raw/more/gaps.trc"), &Body::new(14).markers(&GAPS));
    fs::write(folder.join("raw/clean.toml"), "schema = 1\nmost_doubt_percent = 0.5\n")
        .expect("one");
    let output = clean(&folder, "raw -o raw/done --json");
    assert_eq!(output.status.code(), Some(0), "{}", words(&output));
    let report = json(&output);
    let trials = report["trials"].as_array().expect("a list");
    let of = |name: &str| {
        trials.iter().find(|of| of["trial"] == name).unwrap_or_else(|| panic!("{report:#}"))
    };
    assert_eq!((trials.len(), &of("good.c3d")["artefacts"]), (2, &0.into()), "{report:#}");
    let gaps = of("more/gaps.trc");
    assert_eq!((&gaps["artefacts"], &gaps["not_mended"]), (&3.into(), &0.into()), "{report:#}");
    assert!((gaps["doubt_before"].as_f64().expect("a share") - 122.0 / 7500.0).abs() < 1e-9);
    assert_eq!((&gaps["doubt_after"], &gaps["round"]), (&0.0.into(), &1.into()));
    assert!(folder.join("raw/done/clean.toml").exists(), "thresholds go along");
    // A person takes an edit back, and says how long it took.
    let list = folder.join("raw/done/more/gaps.trc.edits.toml");
    let text = fs::read_to_string(&list).expect("a list");
    let text = text.replacen("[[edit]]", "minutes = 12.5\n\n[[edit]]", 1);
    fs::write(&list, text.replacen("remedy = \"fill\"", "remedy = \"leave\"", 1)).expect("a list");
    let output = clean(&folder, "raw -o raw/done");
    assert_eq!(output.status.code(), Some(1), "nothing is written over: {}", words(&output));
    let output = clean(&folder, "raw -o raw/done --force --json");
    assert_eq!(output.status.code(), Some(0), "{}", words(&output));
    fs::write(folder.join("raw/clean.toml"), "schema = 1\nmost_doubt_percent = 0.1\n")
        .expect("one");
    let output = clean(&folder, "raw -o raw/done --force");
    assert_eq!(output.status.code(), Some(3), "12 of 7500 samples are above 0.1 %");
    assert!(words(&output).contains("too much: doubt"), "{}", words(&output));
    let rounds = fs::read_to_string(folder.join("raw/done/rounds.csv")).expect("a table");
    let rows: Vec<Vec<&str>> = rounds.lines().map(|row| row.split(',').collect()).collect();
    let column = |title: &str| rows[0].iter().position(|of| *of == title).expect("a title");
    let [trial, round, minutes] = ["trial", "round", "person_minutes"].map(column);
    let [by, after, above] = ["by", "doubt_after", "above"].map(column);
    let of_gaps: Vec<&Vec<&str>> =
        rows.iter().filter(|row| row[trial] == "more/gaps.trc").collect();
    let told: Vec<_> = of_gaps
        .iter()
        .map(|row| (row[round], row[minutes], row[by], row[after], row[above]))
        .collect();
    assert_eq!(
        told,
        [
            ("1", "", "found", "0.000000", ""),
            ("2", "12.5", "edit_list", "0.001600", ""),
            ("3", "12.5", "edit_list", "0.001600", "doubt"),
        ]
    );
    assert_eq!(rows.len(), 7, "two trials, three rounds: {rounds}");

    fs::write(folder.join("raw/broken.trc"), "no markers").expect("a file");
    let output = clean(&folder, "raw -o again --json");
    assert_eq!(output.status.code(), Some(3), "{}", words(&output));
    assert_eq!(json(&output)["trials"][0]["trial"], "broken.trc", "what failed comes first");
    assert!(folder.join("again/good.c3d").exists(), "others are cleaned even so");
    let output = clean(&folder, "raw -o raw");
    assert_eq!(output.status.code(), Some(1));
    assert!(words(&output).contains("another folder"), "{}", words(&output));
    fs::write(folder.join("again/rounds.csv"), "a,b\n1,2\n").expect("a file");
    let output = clean(&folder, "raw -o again --force");
    assert!(words(&output).contains("not a table of rounds"), "{}", words(&output));
}

#[test]
fn a_folder_is_ranked_by_doubt_and_fails_above_what_is_allowed() {
    let folder = folder("check");
    fs::create_dir(folder.join("more")).expect("a folder");
    write_c3d(&folder.join("good.c3d"), &Body::new(13).markers(&[]));
    write_c3d(&folder.join("more/bad.c3d"), &Body::new(14).markers(&GAPS));
    fs::write(folder.join("broken.trc"), "no markers").expect("a file");
    fs::write(folder.join("notes.txt"), "no markers").expect("a file");
    let before = fs::read_dir(&folder).expect("a folder").count();
    let output = clean(&folder, ". --check --json");
    assert_eq!(output.status.code(), Some(3), "{}", words(&output));
    let report = json(&output);
    let trials = report["trials"].as_array().expect("a list");
    let names: Vec<&str> = trials.iter().filter_map(|of| of["markers"].as_str()).collect();
    assert_eq!(names, ["./broken.trc", "./more/bad.c3d", "./good.c3d"]);
    assert!(trials[0]["error"].is_string() && trials[0]["doubt"].is_null(), "{report:#}");
    // 12, 50 and 60 frames of 15 markers in 500 frames.
    let doubt = trials[1]["doubt"].as_f64().expect("a share");
    assert!((doubt - 122.0 / 7500.0).abs() < 1e-9, "{doubt}");
    assert_eq!((&trials[2]["doubt"], &trials[1]["artefacts"]["dropout"]), (&0.0.into(), &3.into()));
    fs::remove_file(folder.join("broken.trc")).expect("removed");
    assert_eq!(clean(&folder, ". --check --most-doubt 2").status.code(), Some(0));
    assert_eq!(clean(&folder, ". --check").status.code(), Some(3), "1.6 % are above 1 %");
    assert_eq!(clean(&folder, "good.c3d --check").status.code(), Some(0));
    assert_eq!(clean(&folder, "notes.txt --check").status.code(), Some(1));
    assert_eq!(clean(&folder, ". --check -o out.c3d").status.code(), Some(2));
    assert_eq!(clean(&folder, "good.c3d").status.code(), Some(2), "nothing to write");
    assert_eq!(fs::read_dir(&folder).expect("a folder").count(), before - 1, "nothing is written");
}
