//! Forces of the ground out of force plates: by hand from the definitions of the C3D User Guide and Kistler's
//! equations, and against the package ezc3d of PyPI on real files.

use crate::aloud::aloud;
use crate::captured;
use crate::python;
use gaitway::mocap::c3d;
use gaitway::mocap::markers::{
    Analog, AnalogChannel, ForcePlate, Head, MarkerFormat, Markers, PlateKind,
};
use gaitway::mocap::plates::{GroundForce, Plate, Plates};
use glam::DVec3;
use std::fs;
use std::path::Path;
use std::process::Command;

/// A plate 0.4 m by 0.6 m whose middle is at (1, 2, 0) of a laboratory with Z up. Its X goes along the laboratory's
/// Y, its Y along X, so its Z goes down.
fn head(kind: PlateKind, origin: [f32; 3], units: &[&str], calibration: Vec<f32>) -> Head {
    let mut head = Head::new(MarkerFormat::C3d);
    head.unit = "mm".to_owned();
    let channel = |unit: &&str| AnalogChannel {
        label: String::new(),
        description: String::new(),
        unit: (*unit).to_owned(),
        scale: 2.0,
        offset: 10.0,
    };
    head.analog =
        Analog { channels: units.iter().map(channel).collect(), per_frame: 2, rate_hz: None };
    head.plates = vec![ForcePlate {
        kind,
        // Corners at +X+Y, -X+Y, -X-Y, +X-Y of the plate.
        corners: [
            [1200.0, 2300.0, 0.0],
            [1200.0, 1700.0, 0.0],
            [800.0, 1700.0, 0.0],
            [800.0, 2300.0, 0.0],
        ],
        origin,
        channels: (0..units.len()).map(Some).collect(),
        calibration,
    }];
    head
}

/// Counts that stand for values: (count - 10) * 2.
fn counts(values: &[f64]) -> Vec<f32> {
    values.iter().map(|value| (value / 2.0 + 10.0) as f32).collect()
}

fn force(head: &Head, values: &[f64]) -> GroundForce {
    let plate = Plate::of(head, &head.plates[0]).expect("a plate");
    plate.at(&head.analog, &counts(values))
}

#[track_caller]
fn assert_near(found: DVec3, expected: [f64; 3]) {
    let expected = DVec3::from_array(expected);
    assert!((found - expected).length() < 1e-6, "{found} instead of {expected}");
}

const SIX: [&str; 6] = ["N", "N", "N", "Nmm", "Nmm", "Nmm"];

/// 700 N of weight stand 0.1 m along the plate's X and 0.05 m along its Y from the middle, and push 20 N along X.
/// The sensor's origin is 40 mm below the surface, so the surface is at z = -0.04 m of the plate. The plate gives
/// F = (20, 0, -700) N at p = (0.1, 0.05, -0.04) m, and p x F = (-35, 69.2, -1) Nm.
const STANDS: [f64; 6] = [20.0, 0.0, -700.0, -35_000.0, 69_200.0, -1_000.0];

#[test]
fn a_plate_of_forces_and_moments_says_where_somebody_stands_and_pushes_up() {
    let head = head(PlateKind::ForcesMoments, [0.0, 0.0, -40.0], &SIX, Vec::new());
    let found = force(&head, &STANDS);
    assert_near(found.force_n, [0.0, 20.0, 700.0]);
    // The plate's X is the laboratory's Y: 0.1 m along it, 0.05 m along the laboratory's X.
    assert_near(found.centre_of_pressure_m.expect("pressed"), [1.05, 2.1, 0.0]);
    assert_near(found.free_moment_nm, [0.0, 0.0, 0.0]);
    // About the middle of the surface: (0.05, 0.1, 0) x (0, 20, 700) in the laboratory.
    assert_near(found.moment_nm, [70.0, -35.0, 1.0]);
    let plate = Plate::of(&head, &head.plates[0]).expect("a plate");
    assert_near(found.moment_about_nm(&plate, DVec3::new(1.05, 2.1, 0.0)), [0.0; 3]);
    assert_near(plate.up(), [0.0, 0.0, 1.0]);
    assert_near(plate.centre_m(), [1.0, 2.0, 0.0]);
    assert!(plate.is_over(DVec3::new(1.19, 2.29, 0.1)));
    assert!(!plate.is_over(DVec3::new(1.21, 2.0, 0.1)));
}

#[test]
fn an_origin_that_is_stored_upside_down_is_turned_and_told_of() {
    let head = head(PlateKind::ForcesMoments, [0.0, 0.0, 40.0], &SIX, Vec::new());
    let place = force(&head, &STANDS).centre_of_pressure_m.expect("pressed");
    assert_near(place, [1.05, 2.1, 0.0]);
    let notes = Plates::of(&head).notes;
    assert!(notes.iter().any(|note| note.contains("ORIGIN")), "{notes:?}");
}

#[test]
fn a_turn_of_the_foot_is_left_as_free_moment() {
    let head = head(PlateKind::ForcesMoments, [0.0, 0.0, -40.0], &SIX, Vec::new());
    let mut turned = STANDS;
    turned[5] += 5_000.0;
    // The plate's Z points down.
    assert_near(force(&head, &turned).free_moment_nm, [0.0, 0.0, -5.0]);
}

#[test]
fn a_plate_of_pressures_says_the_same_in_its_own_words() {
    let units = ["N", "N", "N", "mm", "mm", "Nmm"];
    let head = head(PlateKind::CentreOfPressure, [0.0; 3], &units, Vec::new());
    let found = force(&head, &[20.0, 0.0, -700.0, 100.0, 50.0, 5_000.0]);
    assert_near(found.force_n, [0.0, 20.0, 700.0]);
    assert_near(found.centre_of_pressure_m.expect("pressed"), [1.05, 2.1, 0.0]);
    assert_near(found.free_moment_nm, [0.0, 0.0, -5.0]);
    assert_near(found.moment_nm, [70.0, -35.0, -4.0]);
}

/// Posts 0.1 m (X) and 0.2 m (Y) from the middle: a weight of 400 N right above the first post, at (0.1, 0.2), and
/// a push of 6 N along X that all of the posts 1 and 2 take up.
#[test]
fn a_plate_on_four_posts_is_worked_out_by_kistlers_equations() {
    let head = head(PlateKind::Posts, [100.0, 200.0, -50.0], &["N"; 8], Vec::new());
    let found = force(&head, &[6.0, 0.0, 0.0, 0.0, -400.0, 0.0, 0.0, 0.0]);
    assert_near(found.force_n, [0.0, 6.0, 400.0]);
    // Mx = 0.2 * -400 = -80, My = 0.1 * 400 = 40 (+ 0.05 * 6 = 40.3 at the surface), Mz = 0.2 * -6 = -1.2 Nm.
    let place = found.centre_of_pressure_m.expect("pressed");
    assert_near(place, [1.2, 2.0 + 40.3 / 400.0, 0.0]);
    // Plate axes (X, Y, Z) are laboratory (Y, X, -Z).
    assert_near(found.moment_nm, [40.3, -80.0, 1.2]);
}

/// A matrix whose first column alone is not that of unity: the first channel reads into all six.
#[test]
fn a_calibrated_plate_multiplies_its_channels_by_columns() {
    let mut matrix = vec![0.0; 36];
    for at in 0..6 {
        matrix[7 * at] = 1.0;
    }
    matrix[..6].copy_from_slice(&[2.0, 0.5, -1.0, 100.0, 200.0, 300.0]);
    let head = head(PlateKind::Calibrated, [0.0, 0.0, 0.0], &SIX, matrix);
    let found = force(&head, &[10.0, 0.0, -700.0, 0.0, 0.0, 0.0]);
    // (20, 5, -710) N and (1, 2, 3) Nm of the plate.
    assert_near(found.force_n, [5.0, 20.0, 710.0]);
    assert_near(found.moment_nm, [2.0, 1.0, -3.0]);
}

#[test]
fn a_frame_is_the_mean_of_its_samples_and_an_empty_plate_has_no_pressure() {
    let head = head(PlateKind::ForcesMoments, [0.0, 0.0, -40.0], &SIX, Vec::new());
    let plate = Plate::of(&head, &head.plates[0]).expect("a plate");
    let two: Vec<f32> = [counts(&STANDS), counts(&[0.0; 6])].concat();
    let mean = plate.during(&head.analog, &two);
    assert_near(mean.force_n, [0.0, 10.0, 350.0]);
    assert_near(mean.centre_of_pressure_m.expect("pressed"), [1.05, 2.1, 0.0]);
    let empty = plate.at(&head.analog, &counts(&[0.0, 0.0, -3.0, 0.0, 0.0, 0.0]));
    assert_eq!(empty.centre_of_pressure_m, None);
    assert_eq!(plate.during(&head.analog, &[]), GroundForce::default());
}

#[test]
fn a_plate_that_says_too_little_is_refused_with_what_is_missing() {
    let whole = head(PlateKind::ForcesMoments, [0.0, 0.0, -40.0], &SIX, Vec::new());
    let refused = |change: fn(&mut Head), word: &str| {
        let mut head = whole.clone();
        change(&mut head);
        let refused = Plate::of(&head, &head.plates[0]).expect_err(word).to_string();
        assert!(refused.contains(word), "{refused}");
        assert!(Plates::of(&head).list.is_empty());
    };
    refused(|head| head.unit.clear(), "POINT:UNITS");
    refused(|head| head.plates[0].corners = [[0.0; 3]; 4], "CORNERS");
    refused(|head| head.plates[0].channels[4] = None, "CHANNEL");
    refused(|head| head.plates[0].kind = PlateKind::Other(21), "TYPE");
}

/// Where ezc3d differs by its own source: the moment of a plate of type 1 is F x p less the free moment, the
/// negative of what the force does about the middle.
const TURNED_MOMENT: i64 = 1;

/// Numbers are equal to this part of the largest of their kind: ezc3d keeps analog values in 64 bits as we do, and
/// corners in 32.
const EQUAL: f64 = 1e-5;

#[test]
fn real_plates_give_the_forces_that_ezc3d_finds() {
    let Some(files) = captured::c3d_files() else { return };
    let python = match python::python() {
        Ok(python) => python,
        Err(cause) => return aloud!("SKIPPED: no Python with the package ezc3d: {cause}"),
    };
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("force-plates");
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).expect("a folder");
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/force_plates/forces.py");
    let mut command = Command::new(&python.program);
    let output = command.arg(script).arg(&folder).args(&files).output().expect("it ran before");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let (mut plates, mut samples) = (0, 0);
    for (number, path) in files.iter().enumerate() {
        let name = path.file_name().expect("a name").to_string_lossy().into_owned();
        let bytes = fs::read(folder.join(number.to_string())).expect("a dump");
        let end = bytes.iter().position(|byte| *byte == b'\n').expect("a line");
        let head: serde_json::Value = serde_json::from_slice(&bytes[..end]).expect("JSON");
        let ours = c3d::read(path).expect("opened");
        if let Some(cause) = head["refused"].as_str() {
            let own = ours.head().plates.len();
            aloud!("{name}: {own} plates, ezc3d refuses: {cause}");
            continue;
        }
        let found = Plates::of(ours.head());
        let theirs = head["plates"].as_array().expect("plates");
        if found.list.len() < theirs.len() {
            aloud!("{name}: {} of {} plates: {:?}", found.list.len(), theirs.len(), found.notes);
        }
        let (words, _) = bytes[end + 1..].as_chunks::<8>();
        let numbers: Vec<f64> = words.iter().map(|word| f64::from_le_bytes(*word)).collect();
        let mut rows = numbers.as_chunks::<12>().0.iter();
        for (at, theirs) in theirs.iter().enumerate() {
            let count = theirs["samples"].as_u64().expect("a count") as usize;
            let rows: Vec<&[f64; 12]> = rows.by_ref().take(count).collect();
            let Some((_, plate)) = found.list.iter().find(|(index, _)| *index == at) else {
                continue;
            };
            let turned = theirs["type"].as_i64() == Some(TURNED_MOMENT);
            compare(&name, at, &ours, plate, &rows, turned);
            plates += 1;
            samples += rows.len();
        }
    }
    assert!(plates > 0, "nothing was compared");
    aloud!("{plates} plates, {samples} samples agree with ezc3d");
}

fn compare(
    name: &str,
    at: usize,
    ours: &Markers,
    plate: &Plate,
    rows: &[&[f64; 12]],
    turned: bool,
) {
    let head = ours.head();
    let metres = head.metres_per_unit().expect("known");
    let channels = head.analog.channels.len();
    let counts = (0..head.frames).flat_map(|frame| ours.analog_counts(frame).chunks(channels));
    let mut compared = 0;
    let sizes = |place: usize| rows.iter().map(move |row| triple(row, place).length());
    let largest = |place: usize| sizes(place).filter(|n| n.is_finite()).fold(1e-9, f64::max);
    let [most_force, most_moment] = [largest(0), largest(3)];
    for (counts, row) in counts.zip(rows) {
        let found = plate.at(&head.analog, counts);
        let near = |what: &str, found: DVec3, place: usize, unit: f64, most: f64| {
            let expected = triple(row, place) * unit;
            let off = (found - expected).length();
            assert!(
                off <= EQUAL * most * unit,
                "{name}, plate {}: {what} {found} instead of {expected}",
                at + 1
            );
        };
        near("force", found.force_n, 0, 1.0, most_force);
        let sign = if turned { -1.0 } else { 1.0 };
        near("moment", found.moment_nm * sign, 3, metres, most_moment);
        if let Some(place) = found.centre_of_pressure_m
            && !turned
        {
            let expected = triple(row, 6) * metres;
            assert!((place - expected).length() < 1e-4, "{name}: pressure at {place}, {expected}");
            let free = triple(row, 9) * metres;
            assert!((found.free_moment_nm - free).length() < 1e-3 * (1.0 + free.length()));
        }
        compared += 1;
    }
    assert_eq!(compared, rows.len(), "{name}: samples");
}

fn triple(row: &[f64; 12], at: usize) -> DVec3 {
    DVec3::new(row[at], row[at + 1], row[at + 2])
}
