//! Joint angles out of a recording of worn sensors: `gaitway convert`.

mod page;
mod program;

use gaitway::action::vocabulary;
use gaitway::body::proportions::proximal_joint;
use gaitway::body::segment_name;
use gaitway::body::worn::WornSensor;
use gaitway::body::worn::calibrate::calibrate;
use gaitway::body::worn::doubt::Why;
use gaitway::body::worn::kept::Kept;
use gaitway::body::{Dof, Joint, JointAngles, Proportions, Segment, SegmentPose};
use gaitway::capture::{Chain, Mode};
use gaitway::device::sensor::stream_format;
use gaitway::job::source::body_motion;
use gaitway::mocap::anatomy::Capture;
use gaitway::recording::{
    Marker, RecordedSource, Recorder, RunEnd, RunStart, SensorMoment, SourceKind, SourceRecord,
    read, sensor_series,
};
use gaitway::session::doubted::{Doubted, doubted};
use gaitway::time::{Duration, Instant};
use gaitway::wire::sensor::Stream;
use gaitway_sim::imu::{BodyMotion, ImuErrors, ImuWire, Mount, VirtualImu};
use glam::{DQuat, DVec3};
use std::collections::BTreeMap;
use std::path::Path;
use std::process::Output;
use std::time::UNIX_EPOCH;

const RATE_HZ: f64 = 120.0;
const STATURE_M: f64 = 1.62;
/// Standing in N pose before the action.
const STAND_S: f64 = 5.0;
/// Wall clock at the start of the recordings.
const WALL_S: u64 = 1_700_000_000;

fn gaitway(folder: &Path, arguments: &[&str]) -> Output {
    crate::program::gaitway().current_dir(folder).args(arguments).output().expect("the command")
}

/// Somebody who stands, then does an action.
struct Person {
    angles: Vec<JointAngles>,
    poses: Vec<SegmentPose>,
}

impl Person {
    fn doing(action: &str) -> Self {
        let motion = vocabulary::find(action).and_then(|a| a.perform_rounds(2)).expect("shipped");
        let body = Proportions::of_stature(STATURE_M).expect("a body");
        let mut angles = motion.sampled(RATE_HZ).expect("sampled");
        let mut poses = motion.poses(&body, RATE_HZ).expect("posed");
        let stand = (STAND_S * RATE_HZ) as usize;
        angles.splice(0..0, std::iter::repeat_n(angles[0], stand));
        poses.splice(0..0, std::iter::repeat_n(poses[0].clone(), stand));
        Self { angles, poses }
    }

    fn motion(&self, segment: Segment) -> BodyMotion {
        let body = Proportions::of_stature(STATURE_M).expect("a body");
        let joint = proximal_joint(segment);
        let positions: Vec<[f64; 3]> =
            self.poses.iter().map(|p| body.positions(p).joint_m(joint).to_array()).collect();
        let turn = |pose: &SegmentPose| {
            let q = pose.orientation[segment.index()];
            [q.w, q.x, q.y, q.z]
        };
        let orientations: Vec<[f64; 4]> = self.poses.iter().map(turn).collect();
        BodyMotion::new(RATE_HZ, &positions, &orientations).expect("a motion")
    }
}

/// Samples of one sensor in the order in which they come, and what it said while standing.
fn sensed(person: &Person, segment: Segment, loss: f64) -> (Vec<SourceRecord>, Vec<DQuat>) {
    let sensor = gaitway_profiles::sensor("x-imu3").expect("shipped");
    let tilt = DQuat::from_rotation_y(0.1) * DQuat::from_rotation_z(0.05 * segment.index() as f64);
    let mount = Mount {
        offset_m: (segment.long_axis() * 0.12).to_array(),
        orientation: [tilt.w, tilt.x, tilt.y, tilt.z],
    };
    let errors = ImuErrors {
        rate_noise_rad_s: 0.002,
        acceleration_noise_m_s2: 0.03,
        clock_skew: 20e-6,
        latency_s: 0.002,
        jitter_s: 0.001,
        loss,
        seed: segment.index() as u64 + 1,
        ..ImuErrors::default()
    };
    let motion = person.motion(segment);
    let imu = VirtualImu::new(motion, mount, errors, ImuWire::XImu3, sensor.rate_hz);
    let format = stream_format(&sensor).expect("a stream").expect("bytes one after another");
    let (mut stream, mut chain) = (Stream::new(format), Chain::new(&sensor, Mode::SixAxes));
    let (mut records, mut standing) = (Vec::new(), Vec::new());
    for sent in imu.expect("a sensor") {
        let arrival = Instant::from_nanos(1_000_000_000 + (sent.due_s * 1e9).round() as u64);
        stream.push(&sent.bytes, |reading| {
            let [_, Some(captured)] = chain.take(&reading, arrival) else { return };
            if let Some(fused) = captured.fused
                && (2.0..STAND_S - 0.5).contains(&sent.due_s)
            {
                standing.push(fused.orientation);
            }
            records.push(SourceRecord::Sample(Box::new(captured)));
        });
    }
    (records, standing)
}

/// What one sensor gets wrong while an action is recorded.
#[derive(Clone, Copy, PartialEq)]
enum Spoilt {
    Nothing,
    /// It says nothing from 1 s after the action began to 2 s.
    Silent(Segment),
    /// It is turned over within a sample 0.5 s after the action began, and back 0.2 s later.
    Knocked(Segment),
}

/// Records a person who wears sensors on these segments.
fn record(path: &Path, person: &Person, worn: &[Segment], is_known: bool, spoilt: Spoilt) {
    let sensed: Vec<_> = worn.iter().map(|segment| sensed(person, *segment, 0.0)).collect();
    let forward = Some(DVec3::X);
    let sensors: Vec<WornSensor> =
        worn.iter().map(|&segment| WornSensor { segment, forward }).collect();
    // The way it was strapped on tells nothing here: a sensor turned about the limb says so.
    let standing: Vec<Vec<DQuat>> = sensed.iter().map(|(_, said)| said.clone()).collect();
    let mut calibration = calibrate(&sensors, &standing, None, &[]).expect("calibrated");
    for (mount, said) in calibration.mounts.iter_mut().zip(&standing) {
        // A movement would have told it: in N pose the segment's X is the world's.
        let tilt = DQuat::from_rotation_y(0.1)
            * DQuat::from_rotation_z(0.05 * mount.segment.index() as f64);
        mount.sensor_from_segment = tilt.inverse();
        let turned = said[said.len() / 2] * tilt.inverse();
        mount.heading_rad = -2.0 * turned.z.atan2(turned.w);
    }
    let names: Vec<String> = worn.iter().map(|s| segment_name(*s).to_owned()).collect();
    let kept = Kept {
        subject: "s01".to_owned(),
        made_unix_s: WALL_S,
        sensors: names.clone(),
        calibration,
    };
    let mut metadata = BTreeMap::from([("trial".to_owned(), "walk-01".to_owned())]);
    if is_known {
        metadata.insert("body_calibration".to_owned(), kept.text().expect("a text"));
        metadata.insert("stature_m".to_owned(), STATURE_M.to_string());
    } else {
        std::fs::write(path.with_extension("toml"), kept.text().expect("a text")).expect("written");
    }
    let start = RunStart {
        robot: String::new(),
        motion: "walk-01".to_owned(),
        joints: Vec::new(),
        wall_clock_start: UNIX_EPOCH + Duration::from_secs(WALL_S),
        monotonic_start: Instant::from_nanos(1_000_000_000),
        gaitway_version: "test".to_owned(),
        metadata,
    };
    let recorder = Recorder::create_for_sources(path, false, start).expect("a file");
    let source = |name: &str, kind| {
        let (name, metadata) = (name.to_owned(), BTreeMap::new());
        recorder.add_source(RecordedSource { name, metadata, kind })
    };
    let ids: Vec<_> = names.iter().map(|name| source(name, SourceKind::Imu)).collect();
    let marks = source("marks", SourceKind::Marks);
    let mark = Marker { at: Instant::from_nanos(6_000_000_000), text: "begin".to_owned() };
    recorder.take_record(marks, SourceRecord::Mark(mark));
    let mut all: Vec<_> = sensed
        .into_iter()
        .zip(ids)
        .zip(worn)
        .flat_map(|(((said, _), id), s)| {
            said.into_iter().enumerate().map(move |(n, record)| (n, id, record, *s))
        })
        .collect();
    all.sort_by_key(|(n, ..)| *n);
    let mut at = Instant::ZERO;
    for (count, (_, id, mut record, segment)) in all.into_iter().enumerate() {
        let SourceRecord::Sample(captured) = &mut record else { continue };
        at = at.max(captured.stamp.arrival);
        let time_s = captured.stamp.arrival.seconds_since(Instant::from_nanos(1_000_000_000));
        let since_s = time_s - STAND_S;
        if spoilt == Spoilt::Silent(segment) && (1.0..2.0).contains(&since_s) {
            continue;
        }
        if spoilt == Spoilt::Knocked(segment) && (0.5..0.7).contains(&since_s) {
            let fused = captured.fused.as_mut().expect("fused");
            fused.orientation = DQuat::from_rotation_x(2.0) * fused.orientation;
        }
        recorder.take_record(id, record);
        if count % 3000 == 2999 {
            wait_for_bytes(path, (count as u64 - 2000) * 340);
        }
    }
    let end = RunEnd { outcome: "done".into(), stop_reason: None, at, metadata: BTreeMap::new() };
    let summary = recorder.finish(end);
    assert!(summary.is_complete(), "{summary:?}");
}

/// The recorder's queue is as long as sensors need in real time; here they come as fast as they can.
/// A sample takes more than 340 bytes, packed.
fn wait_for_bytes(path: &Path, bytes: u64) {
    let began = std::time::Instant::now();
    while std::fs::metadata(path).map_or(0, |m| m.len()) < bytes {
        assert!(began.elapsed().as_secs() < 30, "nothing is written");
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
}

struct Table {
    times_s: Vec<f64>,
    angles: Vec<JointAngles>,
    not_measured: Vec<String>,
}

fn table(path: &Path) -> Table {
    let text = std::fs::read_to_string(path).expect("a table");
    let mut lines = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let titles = lines.next().expect("titles");
    let wanted: Vec<String> = Dof::ALL.iter().map(|dof| format!("{}_rad", dof.name())).collect();
    assert_eq!(
        (titles[0], &titles[1..23]),
        ("time_s", &wanted.iter().map(String::as_str).collect::<Vec<_>>()[..])
    );
    let mut table = Table { times_s: Vec::new(), angles: Vec::new(), not_measured: Vec::new() };
    for line in lines {
        assert_eq!(line.len(), titles.len());
        let number = |at: usize| line[at].parse::<f64>().expect("a number");
        table.times_s.push(number(0));
        table.angles.push(JointAngles(std::array::from_fn(|n| number(n + 1))));
        table.not_measured.push(line[line.len() - 1].to_owned());
    }
    table
}

/// Root mean square error of a degree of freedom from one second before the action on, deg.
fn error_deg(table: &Table, person: &Person, first_s: f64, dof: Dof) -> f64 {
    let (mut squares, mut count) = (0.0, 0);
    for (time_s, angles) in table.times_s.iter().zip(&table.angles) {
        let at_s = time_s + first_s;
        if at_s > STAND_S - 1.0 {
            let at = ((at_s * RATE_HZ).round() as usize).min(person.angles.len() - 1);
            squares += (angles[dof] - person.angles[at][dof]).powi(2);
            count += 1;
        }
    }
    (squares / f64::from(count)).sqrt().to_degrees()
}

#[test]
fn a_walk_that_was_recorded_comes_out_as_the_angles_that_were_walked() {
    let folder = crate::program::folder("convert-worn");
    let person = Person::doing("walk");
    record(&folder.join("walk.mcap"), &person, &Segment::ALL, true, Spoilt::Nothing);
    let series = sensor_series(&folder.join("walk.mcap")).expect("read");
    assert!(series.whole && series.missed == 0);
    assert_eq!(series.markers.len(), 1);
    assert_eq!(
        (series.markers[0].text.as_str(), series.markers[0].at.as_nanos()),
        ("begin", 6_000_000_000)
    );

    for out in ["walk.csv", "walk.bvh", "angles.mcap"] {
        let output = gaitway(&folder, &["convert", "walk.mcap", out, "--rate", "60"]);
        assert_eq!(output.status.code(), Some(0), "{output:?}");
        // A file that is there is not written over.
        let again = gaitway(&folder, &["convert", "walk.mcap", out]);
        assert_eq!(again.status.code(), Some(1), "{again:?}");
    }
    let table = table(&folder.join("walk.csv"));
    assert!(table.not_measured.iter().all(String::is_empty));
    // The first second is the filters'.
    let first_s = STAND_S + person.angles.len() as f64 / RATE_HZ
        - STAND_S
        - table.times_s[table.times_s.len() - 1]
        - 1.0 / RATE_HZ;
    let mut worst: f64 = 0.0;
    for dof in Dof::ALL {
        worst = worst.max(error_deg(&table, &person, first_s, dof));
    }
    println!("worst joint {worst:.2} deg RMSE");
    assert!(worst < 2.0, "{worst}");

    // Fused again from the raw samples: the same angles.
    let fuse = ["convert", "walk.mcap", "again.csv", "--rate", "60", "--fuse", "six-axes"];
    let output = gaitway(&folder, &fuse);
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let again = self::table(&folder.join("again.csv"));
    let last_s = |table: &Table| table.times_s[table.times_s.len() - 1];
    let first_again_s = first_s + last_s(&table) - last_s(&again);
    for dof in Dof::ALL {
        let before = error_deg(&table, &person, first_s, dof);
        let after = error_deg(&again, &person, first_again_s, dof);
        assert!((after - before).abs() < 0.2, "{}: {before}, {after} deg", dof.name());
    }

    // The skeleton file is a person of this stature who does the same.
    let (capture, source) = gaitway::job::source::body_motion(
        folder.join("walk.bvh").to_str().expect("a path"),
        None,
        &Default::default(),
    )
    .expect("our own reader reads it");
    assert_eq!(source.frames, table.angles.len());
    assert!(capture.tracked.iter().all(|tracked| *tracked));
    assert!(bvh_error_deg(&capture, &table) < 1.0);

    // The page of the recording bends the knee as the table does, and has the mark where it was set.
    let output = gaitway(&folder, &["info", "walk.mcap", "--html", "walk.html"]);
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let data = page::data(&std::fs::read_to_string(folder.join("walk.html")).expect("a page"));
    let point = |joint: Joint| page::rows::<3>(&data["person"]["points"][joint.index()]);
    let [hip, knee, ankle] = [Joint::LeftHip, Joint::LeftKnee, Joint::LeftAnkle].map(point);
    assert_eq!(knee.len(), table.angles.len());
    for (at, row) in table.angles.iter().enumerate() {
        let [hip, knee, ankle] = [&hip, &knee, &ankle].map(|point| DVec3::from_array(point[at]));
        let bent_rad = (knee - hip).angle_between(ankle - knee);
        let off_rad = bent_rad - row[Dof::LeftKneeFlexion].abs();
        // Points are rounded to a millimetre, so that a leg that is straight may look bent.
        assert!(off_rad.abs() < 0.06, "{bent_rad} for {}", row[Dof::LeftKneeFlexion]);
    }
    // Sensors are drawn as they sat: turned in their straps, on segments that moved.
    let sensors = data["person"]["sensors"].as_array().expect("sensors");
    let names: Vec<&str> = sensors.iter().filter_map(|of| of["name"].as_str()).collect();
    assert_eq!(names, Segment::ALL.map(segment_name));
    for (sensor, segment) in sensors.iter().zip(Segment::ALL) {
        let tilt =
            DQuat::from_rotation_y(0.1) * DQuat::from_rotation_z(0.05 * segment.index() as f64);
        let drawn = page::rows::<4>(&sensor["turn"]);
        assert_eq!(drawn.len(), table.angles.len());
        let (mut squares, mut count) = (0.0, 0.0);
        for (at, [w, x, y, z]) in drawn.into_iter().enumerate() {
            let at_s = first_s + table.times_s[at];
            if at_s < STAND_S - 1.0 {
                continue;
            }
            let pose = ((at_s * RATE_HZ).round() as usize).min(person.poses.len() - 1);
            let pose = &person.poses[pose];
            let truth = pose.orientation[segment.index()] * tilt;
            let drawn = DQuat::from_xyzw(x, y, z, w).normalize();
            squares += drawn.angle_between(truth).powi(2);
            count += 1.0;
        }
        let rms_deg = f64::sqrt(squares / count).to_degrees();
        assert!(count > 100.0 && rms_deg < 3.0, "{}: {rms_deg} deg RMS", segment_name(segment));
    }
    let mark = &data["spans"][0];
    let marked_s = mark["start_s"].as_f64().expect("a time");
    assert_eq!((mark["label"].as_str(), mark["row"].as_str()), (Some("begin"), Some("marked")));
    assert!((marked_s - (5.0 - first_s)).abs() < 0.03, "{marked_s} s, poses from {first_s} s on");

    // Joint states, by name.
    let angles = read(&folder.join("angles.mcap")).expect("read");
    assert!(angles.finished && angles.joint_names.len() == 22);
    assert_eq!(angles.cycles.len(), table.angles.len());
    let knee = Dof::LeftKneeFlexion.index();
    for (cycle, row) in angles.cycles.iter().zip(&table.angles) {
        let position = cycle.joints[knee].present_position_rad.expect("measured");
        assert!((position - row[Dof::LeftKneeFlexion]).abs() < 1e-6);
    }
    let metadata = angles.start.expect("a start").metadata;
    assert_eq!((metadata["not_worn"].as_str(), metadata["subject"].as_str()), ("", "s01"));
}

/// Elbows and knees of the capture against the table, deg RMS.
fn bvh_error_deg(capture: &Capture, table: &Table) -> f64 {
    let (mut squares, mut count) = (0.0, 0);
    for (pose, row) in capture.poses.iter().zip(&table.angles) {
        let angles = JointAngles::of_pose(pose).angles;
        for dof in [Dof::LeftKneeFlexion, Dof::RightElbowFlexion, Dof::RightHipFlexion] {
            squares += (angles[dof] - row[dof]).powi(2);
            count += 1;
        }
    }
    (squares / f64::from(count)).sqrt().to_degrees()
}

#[test]
fn what_is_not_worn_is_at_rest_and_what_falls_silent_is_marked() {
    let folder = crate::program::folder("convert-part");
    let person = Person::doing("wave-r");
    let worn = [Segment::Torso, Segment::RightUpperArm, Segment::RightForearm];
    record(&folder.join("wave.mcap"), &person, &worn, true, Spoilt::Silent(Segment::RightForearm));
    let output = gaitway(&folder, &["convert", "wave.mcap", "wave.csv"]);
    // N pose would be of use to nobody, and is not ignored.
    let refused = gaitway(&folder, &["convert", "wave.mcap", "other.csv", "--n-pose", "0,1"]);
    let said = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert_eq!(refused.status.code(), Some(1), "{said}");
    assert!(said.contains("the recording holds a calibration"), "{said}");
    assert!(!folder.join("other.csv").exists());
    // Something is missing, and the exit code says so.
    assert_eq!(output.status.code(), Some(3), "{output:?}");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(said.contains("not worn") && said.contains("left_thigh"), "{said}");
    let table = table(&folder.join("wave.csv"));
    let is_arm = |dof: &Dof| {
        dof.name().starts_with("right_shoulder")
            || dof.name().starts_with("right_elbow")
            || dof.name().starts_with("torso")
    };
    for dof in Dof::ALL.iter().filter(|dof| !is_arm(dof)) {
        assert!(table.angles.iter().all(|row| row[*dof].abs() < 1e-6), "{}", dof.name());
    }
    let silent = table.not_measured.iter().filter(|row| row.contains("right_forearm")).count();
    assert!((90..=110).contains(&silent), "{silent} of a second at 100 Hz");
    assert!(table.not_measured.iter().all(|row| row.contains("left_thigh;left_shank")));
    let moved = table.angles.iter().map(|row| row[Dof::RightElbowFlexion]).fold(0.0, f64::max);
    assert!(moved > 1.5, "{moved}");
}

#[test]
fn what_is_read_is_never_written_over_whatever_it_is_called() {
    let folder = crate::program::folder("convert-apart");
    let path = folder.join("take.mcap");
    record(&path, &Person::doing("wave-r"), &[Segment::Torso], true, Spoilt::Nothing);
    std::os::unix::fs::symlink("take.mcap", folder.join("link.mcap")).expect("a link");
    std::fs::hard_link(&path, folder.join("twin.mcap")).expect("a second name");
    let before = std::fs::read(&path).expect("a recording");
    for arguments in [
        ["convert", "take.mcap", "take.mcap"].as_slice(),
        &["convert", "take.mcap", "./link.mcap"],
        &["convert", "take.mcap", "twin.mcap"],
        &["info", "take.mcap", "--report", "take.mcap"],
        &["recover", "take.mcap", "--report", "take.mcap"],
        &["live", "--from", "replay:take.mcap", "--dry-run", "--report", "take.mcap"],
    ] {
        let output = gaitway(&folder, &[arguments, &["--force"]].concat());
        assert_eq!(output.status.code(), Some(1), "{arguments:?}");
        let told = [output.stdout, output.stderr].concat();
        let told = String::from_utf8_lossy(&told).into_owned();
        assert!(told.contains("the file that is read would be written over"), "{told}");
        assert!(std::fs::read(&path).expect("still there") == before, "{arguments:?}");
    }
    let files = std::fs::read_dir(&folder).expect("the folder").count();
    assert_eq!(files, 3, "nothing else was written");
}

#[test]
fn a_recording_that_does_not_know_how_it_was_worn_is_a_table_of_samples_or_needs_to_be_told() {
    let folder = crate::program::folder("convert-unknown");
    let person = Person::doing("bow");
    record(&folder.join("bow.mcap"), &person, &[Segment::Torso], false, Spoilt::Nothing);
    let refused = gaitway(&folder, &["convert", "bow.mcap", "bow.bvh"]);
    assert_eq!(refused.status.code(), Some(1));
    let said = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(said.contains("--calibration-body") && !folder.join("bow.bvh").exists(), "{said}");
    assert_eq!(gaitway(&folder, &["convert", "bow.mcap", "bow.csv"]).status.code(), Some(0));
    let text = std::fs::read_to_string(folder.join("bow.csv")).expect("a table");
    assert!(text.starts_with("sensor,number"), "{}", &text[..40]);
    let told =
        gaitway(&folder, &["convert", "bow.mcap", "told.csv", "--calibration-body", "bow.toml"]);
    assert_eq!(told.status.code(), Some(0), "{told:?}");
    let bowed = table(&folder.join("told.csv"));
    let most = bowed.angles.iter().map(|row| row[Dof::TorsoFlexion]).fold(0.0, f64::max);
    assert!(most > 0.3, "{most}");
    // Or who wore them, and when somebody stood in N pose.
    std::fs::write(folder.join("wear.toml"), "[segments]\ntorso = \"torso\"\n").expect("written");
    let worn = ["convert", "bow.mcap", "worn.csv", "--wear", "wear.toml", "--n-pose", "1.5,4.5"];
    let worn = gaitway(&folder, &worn);
    assert!(worn.status.success(), "{worn:?}");
    let bowed = table(&folder.join("worn.csv"));
    let again = bowed.angles.iter().map(|row| row[Dof::TorsoFlexion]).fold(0.0, f64::max);
    assert!((again - most).abs() < 0.1, "{again} {most}");
    let nonsense =
        gaitway(&folder, &["convert", "bow.mcap", "x.csv", "--calibration-body", "bow.mcap"]);
    assert_eq!(nonsense.status.code(), Some(1));
    for bad in ["0", "nan", "-5", "1e9"] {
        let refused = gaitway(
            &folder,
            &["convert", "bow.mcap", "y.csv", "--calibration-body", "bow.toml", "--rate", bad],
        );
        assert_eq!(refused.status.code(), Some(1), "{bad}");
    }
}

/// From when on a sensor is spoilt, since all filters have settled, s: half a second after the walk began.
const BEGINS_S: f64 = STAND_S - 0.5;

/// What is doubted of somebody who walks, with the left thigh's sensor spoilt.
fn doubted_of(folder: &Path, spoil: impl Fn(f64, &mut SensorMoment)) -> Vec<Doubted> {
    let mut series = sensor_series(&folder.join("walk.mcap")).expect("recorded");
    let metadata = &series.start.as_ref().expect("a start").metadata;
    let kept = Kept::parse(&metadata["body_calibration"]).expect("a calibration");
    // Times count from when every filter has settled.
    let settled = |said: &Vec<SensorMoment>| {
        let mut said = said.iter().filter(|moment| moment.orientation.is_some());
        said.next().map(|moment| moment.taken_ns)
    };
    let first_ns = series.sensors.values().filter_map(settled).max().expect("all speak");
    let moments = series.sensors.get_mut("left_thigh").expect("worn");
    let mut last: Option<SensorMoment> = None;
    for moment in moments {
        let time_s = (moment.taken_ns as f64 - first_ns as f64) / 1e9;
        if time_s >= BEGINS_S {
            let taken_ns = moment.taken_ns;
            spoil(time_s - BEGINS_S, moment);
            // Not a number stands for what was said last.
            if moment.rate_rad_s.is_some_and(|rate| rate.x.is_nan()) {
                *moment = SensorMoment { taken_ns, ..last.expect("one before") };
            }
        }
        last = Some(*moment);
    }
    doubted(&series, &kept).expect("doubts, or none")
}

#[test]
fn what_a_sensor_said_that_cannot_be_is_told_of_a_recording_with_its_time() {
    let folder = crate::program::folder("convert-doubted");
    let worn = [Segment::Pelvis, Segment::LeftThigh, Segment::LeftShank];
    record(&folder.join("walk.mcap"), &Person::doing("walk"), &worn, true, Spoilt::Nothing);
    assert_eq!(doubted_of(&folder, |_, _| ()), []);
    type Spoil = fn(f64, &mut SensorMoment);
    let faults: [(Spoil, Why, f64, f64); 3] = [
        // Turned over within a sample, and back 0.2 s later.
        (
            |since_s, said| {
                if since_s < 0.2 {
                    said.orientation = said.orientation.map(|q| DQuat::from_rotation_x(2.0) * q);
                }
            },
            Why::Turn,
            0.05,
            // It is taken up again after a stride: until then its heading is not known.
            1.43,
        ),
        (
            |since_s, said| {
                if since_s < 1.0 {
                    said.rate_rad_s = Some(DVec3::NAN);
                }
            },
            Why::Stuck,
            0.1,
            1.5,
        ),
        // The axis about which a thigh turns most.
        (
            |since_s, said| {
                if since_s < 0.5 {
                    said.rate_rad_s = said.rate_rad_s.map(|rate| rate.with_y(0.0));
                }
            },
            Why::Stuck,
            0.2,
            1.0,
        ),
    ];
    for (spoil, why, within_s, ends_s) in faults {
        let found = doubted_of(&folder, spoil);
        let [Doubted { segment: Segment::LeftThigh, why: seen, from_s, to_s }] = found[..] else {
            panic!("{why:?}: {found:?}")
        };
        assert_eq!(seen, why);
        assert!((-0.02..within_s).contains(&(from_s - BEGINS_S)), "{found:?}");
        assert!((to_s - BEGINS_S - ends_s).abs() < 0.05, "{found:?}");
        let words = found[0].words();
        assert!(words.contains("left thigh") && words.contains(why.words()), "{words}");
    }
}

#[test]
fn whoever_converts_a_recording_is_told_and_whoever_plays_it_as_well() {
    let folder = crate::program::folder("convert-knocked");
    let worn = [Segment::Pelvis, Segment::LeftThigh, Segment::LeftShank];
    let knocked = Spoilt::Knocked(Segment::LeftThigh);
    record(&folder.join("walk.mcap"), &Person::doing("walk"), &worn, true, knocked);
    let output = gaitway(&folder, &["convert", "walk.mcap", "walk.csv"]);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(0), "{said}");
    let words = "the sensor on the left thigh is doubted from ";
    assert!(said.contains(words) && said.contains("it turns faster than anybody can"), "{said}");
    let motion = folder.join("walk.mcap").display().to_string();
    let (capture, _) = body_motion(&motion, None, &Default::default()).expect("a motion");
    let notes: Vec<_> = capture.notes.iter().filter(|note| note.contains(words)).collect();
    assert_eq!(notes.len(), 1, "{:?}", capture.notes);
}

#[test]
fn one_time_that_was_misread_by_a_century_is_no_work_and_no_doubt() {
    let folder = crate::program::folder("convert-century");
    let worn = [Segment::Pelvis, Segment::LeftThigh];
    record(&folder.join("walk.mcap"), &Person::doing("walk"), &worn, true, Spoilt::Nothing);
    let mut series = sensor_series(&folder.join("walk.mcap")).expect("recorded");
    let metadata = &series.start.as_ref().expect("a start").metadata;
    let kept = Kept::parse(&metadata["body_calibration"]).expect("a calibration");
    let last = series.sensors.get_mut("left_thigh").and_then(|said| said.last_mut());
    last.expect("said").taken_ns += 100 * 365 * 86_400 * 1_000_000_000;
    assert_eq!(doubted(&series, &kept).expect("doubts, or none"), []);
}
