//! What is drawn of a moving body: the scene (X3D) that a camera follows over a floor, and the page that
//! shows what carries. Scenes are read back as XML and moved here, by nothing but what stands in the file.

use crate::aloud::aloud;
use crate::captured;
use crate::page;
use crate::program;
use gaitway::action::vocabulary;
use gaitway::body::contact::Footing;
use gaitway::body::mass::{centre_of_mass_m, segment_masses};
use gaitway::body::{Joint, JointAngles, Proportions, Segment, SegmentPose, contact};
use gaitway::job::source::{CaptureOptions, body_motion};
use gaitway::mocap::scene::{DrawnFeet, Scene};
use gaitway::view::scene::page_of;
use glam::{DMat4, DQuat, DVec3};
use roxmltree::{Document, Node, ParsingOptions};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;

fn body() -> Proportions {
    Proportions::of_stature(1.75).unwrap()
}

fn poses(action: &str, rate_hz: f64) -> Vec<SegmentPose> {
    vocabulary::find(action).unwrap().perform().unwrap().poses(&body(), rate_hz).unwrap()
}

/// Runs the command and reads what it wrote.
fn written(command: &str, from: &str, out: &Path) -> String {
    let mut gaitway = program::gaitway();
    gaitway.args([command, from]);
    if command == "synth" {
        gaitway.arg("-o");
    }
    let done = gaitway.arg(out).output().unwrap();
    assert!(done.status.success(), "{}", program::words(&done));
    std::fs::read_to_string(out).unwrap()
}

fn synth(action: &str, name: &str) -> String {
    written("synth", action, &program::folder(&format!("{action}-{name}")).join(name))
}

fn parsed(text: &str) -> Document<'_> {
    let options = ParsingOptions { allow_dtd: true, ..ParsingOptions::default() };
    Document::parse_with_options(text, options).unwrap()
}

fn numbers(node: Node<'_, '_>, field: &str) -> Vec<f64> {
    let text = node.attribute(field).unwrap_or_else(|| panic!("{node:?} has no {field}"));
    text.split([' ', ','])
        .filter(|word| !word.is_empty())
        .map(|word| word.parse().unwrap())
        .collect()
}

fn vector(node: Node<'_, '_>, field: &str) -> DVec3 {
    DVec3::from_slice(&numbers(node, field))
}

fn turn(axis_and_angle: &[f64]) -> DQuat {
    DQuat::from_axis_angle(DVec3::from_slice(axis_and_angle).normalize(), axis_and_angle[3])
}

fn named<'a>(scene: &'a Document<'_>, name: &str) -> Node<'a, 'a> {
    let mut found = scene.descendants().filter(|node| node.attribute("DEF") == Some(name));
    let node = found.next().unwrap_or_else(|| panic!("no node {name}"));
    assert!(found.next().is_none(), "two nodes {name}");
    node
}

/// Values of an interpolator, key by key.
fn values<const N: usize>(scene: &Document<'_>, name: &str) -> Vec<[f64; N]> {
    let (rows, rest) = {
        let all = numbers(named(scene, name), "keyValue");
        let (rows, rest) = all.as_chunks::<N>();
        (rows.to_vec(), rest.len())
    };
    assert_eq!((rows.len(), rest), (numbers(named(scene, name), "key").len(), 0), "{name}");
    rows
}

/// Corners of all that is drawn of the humanoid, at each key; soles apart.
struct Moved {
    bodies_m: Vec<Vec<DVec3>>,
    soles_m: Vec<Vec<DVec3>>,
}

impl Moved {
    fn of(scene: &Document<'_>) -> Self {
        let root = named(scene, "humanoid_root");
        let keys = values::<3>(scene, "path").len();
        let turns: BTreeMap<String, Vec<[f64; 4]>> = scene
            .descendants()
            .filter_map(|node| node.attribute("DEF")?.strip_prefix("turn_"))
            .map(|joint| (joint.to_owned(), values(scene, &format!("turn_{joint}"))))
            .collect();
        let places = values::<3>(scene, "path");
        let mut moved = Self { bodies_m: Vec::new(), soles_m: Vec::new() };
        for key in 0..keys {
            let (mut corners, mut soles) = (Vec::new(), Vec::new());
            let start = DMat4::from_translation(DVec3::from_array(places[key]));
            placed(root, start, &|joint| turn(&turns[joint][key]), &mut corners, &mut soles);
            moved.bodies_m.push(corners);
            moved.soles_m.push(soles);
        }
        moved
    }
}

/// As the standard has it: a joint turns about its centre what it carries.
fn placed(
    joint: Node<'_, '_>,
    carrier: DMat4,
    turned: &dyn Fn(&str) -> DQuat,
    corners: &mut Vec<DVec3>,
    soles: &mut Vec<DVec3>,
) {
    let centre = vector(joint, "center");
    let here = carrier
        * DMat4::from_translation(centre)
        * DMat4::from_quat(turned(joint.attribute("DEF").unwrap()))
        * DMat4::from_translation(-centre);
    for child in joint.children().filter(Node::is_element) {
        match child.tag_name().name() {
            "HAnimJoint" => placed(child, here, turned, corners, soles),
            _ => {
                for node in child.descendants() {
                    match node.tag_name().name() {
                        "Cylinder" => {
                            let transform = node.parent().unwrap().parent().unwrap();
                            let up = turn(&numbers(transform, "rotation")) * DVec3::Y;
                            let half = up * numbers(node, "height")[0] / 2.0;
                            let middle = vector(transform, "translation");
                            corners.extend(
                                [middle - half, middle + half].map(|p| here.transform_point3(p)),
                            );
                        }
                        "Coordinate" => {
                            let points = numbers(node, "point");
                            let points = points.chunks(3).map(DVec3::from_slice);
                            let points: Vec<DVec3> =
                                points.map(|p| here.transform_point3(p)).collect();
                            corners.extend(&points);
                            // The last is the ankle.
                            soles.extend(&points[..4]);
                        }
                        _ => {}
                    }
                }
            }
        }
    }
}

#[test]
fn routes_join_fields_of_one_type_between_nodes_that_are_there() {
    let text = synth("bow", "bow.x3d");
    let scene = parsed(&text);
    // ISO/IEC 19775-1: 8.4.1 TimeSensor, 19.4 interpolators, 10.4.4 Transform; 26.3.3 HAnimJoint.
    let kind = |node: &str, field: &str| match (node, field) {
        ("TimeSensor", "fraction_changed") => ("out", "SFFloat"),
        ("PositionInterpolator" | "OrientationInterpolator", "set_fraction") => ("in", "SFFloat"),
        ("PositionInterpolator", "value_changed") => ("out", "SFVec3f"),
        ("OrientationInterpolator", "value_changed") => ("out", "SFRotation"),
        ("Transform" | "HAnimJoint", "set_translation") => ("in", "SFVec3f"),
        ("HAnimJoint", "set_rotation") => ("in", "SFRotation"),
        _ => panic!("{node} has no {field}"),
    };
    let routes: Vec<Node<'_, '_>> =
        scene.descendants().filter(|node| node.has_tag_name("ROUTE")).collect();
    // Clock to interpolator to node: 13 joints turn, root and camera move.
    assert_eq!(routes.len(), 2 * (13 + 2));
    for route in &routes {
        let end = |node: &str, field: &str| {
            let node = named(&scene, route.attribute(node).unwrap());
            kind(node.tag_name().name(), route.attribute(field).unwrap())
        };
        let (from, to) = (end("fromNode", "fromField"), end("toNode", "toField"));
        assert_eq!((from.0, to.0, from.1), ("out", "in", to.1), "{route:?}");
    }
    for used in scene.descendants().filter_map(|node| node.attribute("USE")) {
        named(&scene, used);
    }
    for keyed in scene.descendants().filter(|node| node.has_attribute("key")) {
        let keys = numbers(keyed, "key");
        assert!(keys.is_sorted_by(|a, b| a < b) && keys[0] == 0.0 && keys[keys.len() - 1] == 1.0);
    }
}

#[test]
fn the_camera_goes_with_a_walk_at_one_distance_and_does_not_bob() {
    let text = synth("walk", "walk.x3d");
    let scene = parsed(&text);
    let camera = named(&scene, "camera");
    let (root, level) = (values::<3>(&scene, "path"), values::<3>(&scene, "level_path"));
    assert!(root[root.len() - 1][2] > 2.0, "it walks forward");
    for viewpoint in camera.children().filter(Node::is_element) {
        let from = vector(viewpoint, "position");
        let away = |(root, level): (&[f64; 3], &[f64; 3])| {
            let eye = DVec3::from_array(*level) + from;
            (DVec3::from_array(*root) - eye).with_y(0.0).length()
        };
        let first = away((&root[0], &level[0]));
        for at in root.iter().zip(&level) {
            assert!((away(at) - first).abs() < 1e-4, "{} m, {first} m", away(at));
            assert_eq!(at.1[1], 0.0);
        }
    }
}

/// Every corner of the body lies in the cone whose angle is the field of view, which any picture holds.
#[test]
fn the_whole_body_is_in_the_picture_all_the_time() {
    for action in ["walk", "jump", "side-kick-r", "jumping-jacks"] {
        let text = synth(action, "seen.x3d");
        let scene = parsed(&text);
        let (moved, level) = (Moved::of(&scene), values::<3>(&scene, "level_path"));
        let mut seen = 0;
        for viewpoint in named(&scene, "camera").children().filter(Node::is_element) {
            let ahead = turn(&numbers(viewpoint, "orientation")) * DVec3::NEG_Z;
            let half_rad = numbers(viewpoint, "fieldOfView")[0] / 2.0;
            let mut widest_rad = 0.0f64;
            for (corners, level) in moved.bodies_m.iter().zip(&level) {
                let eye = DVec3::from_array(*level) + vector(viewpoint, "position");
                for corner in corners {
                    widest_rad = widest_rad.max((*corner - eye).angle_between(ahead));
                }
            }
            assert!(widest_rad < half_rad, "{action}: {widest_rad} of {half_rad}");
            // Nor is it a speck.
            assert!(widest_rad > half_rad / 2.0, "{action}: {widest_rad} of {half_rad}");
            seen += 1;
        }
        assert_eq!(seen, 2, "from ahead and from aside");
    }
}

#[test]
fn the_floor_is_as_high_as_the_lowest_sole_and_goes_on_beyond_the_way() {
    for action in ["walk", "run", "sit-down", "kick-r"] {
        let text = synth(action, "floor.x3d");
        let scene = parsed(&text);
        let floor = named(&scene, "floor");
        let corner = vector(floor, "translation");
        let soles = Moved::of(&scene).soles_m;
        let lowest_m = soles.iter().flatten().map(|sole| sole.y).fold(f64::MAX, f64::min);
        assert!((lowest_m - corner.y).abs() < 1.5e-3, "{action}: {lowest_m} m, {} m", corner.y);
        let grid = floor.descendants().find(|node| node.has_tag_name("ElevationGrid")).unwrap();
        let number = |field: &str| numbers(grid, field)[0];
        let (columns, rows) = (number("xDimension"), number("zDimension"));
        assert!(numbers(grid, "height") == vec![0.0; (columns * rows) as usize]);
        let colour = grid.children().find(|node| node.has_tag_name("Color")).unwrap();
        let colours = numbers(colour, "color");
        assert_eq!(colours.len(), 3 * ((columns - 1.0) * (rows - 1.0)) as usize);
        // Squares of half a metre that differ from their neighbours tell how fast it goes.
        assert_eq!((number("xSpacing"), number("zSpacing")), (0.5, 0.5));
        let square =
            |column: usize, row: usize| colours[3 * (row * (columns as usize - 1) + column)];
        assert!(square(0, 0) != square(1, 0) && square(0, 0) != square(0, 1));
        assert!(square(0, 0) == square(1, 1));
        for sole in soles.iter().flatten() {
            let (x, z) = (sole.x - corner.x, sole.z - corner.z);
            let beyond = [x, 0.5 * (columns - 1.0) - x, z, 0.5 * (rows - 1.0) - z];
            assert!(beyond.iter().all(|beyond_m| *beyond_m > 2.0), "{action}: {beyond:?}");
        }
    }
}

/// The person that a page draws.
fn motion(page: &str) -> Value {
    page::data(page)["person"].clone()
}

/// A series of it.
fn list(of: &Value, at: &str) -> Vec<f64> {
    page::series(&of[at])
}

/// The corners that soles span in one of its poses, m.
fn corners(of: &Value, pose: usize) -> Vec<[f64; 2]> {
    let support = &of["support"];
    let counts: Vec<usize> = list(support, "counts").iter().map(|count| *count as usize).collect();
    let begins: usize = counts[..pose].iter().sum();
    let (x, y) = (list(support, "x"), list(support, "y"));
    (begins..begins + counts[pose]).map(|at| [x[at], y[at]]).collect()
}

#[test]
fn a_page_tells_the_contacts_and_the_force_that_footing_tells() {
    for action in ["walk", "run", "jump", "kick-r"] {
        let motion = motion(&synth(action, "page.html"));
        // 120 poses a second, of which every other is drawn.
        assert_eq!(motion["clock"]["rate_hz"], 60.0);
        let poses = poses(action, 120.0);
        let footing = Footing::of(&body(), &poses, 120.0).unwrap();
        let (contacts, forces) = (list(&motion, "contacts"), list(&motion, "force"));
        let support = list(&motion["support"], "counts");
        assert_eq!(contacts.len(), poses.len().div_ceil(2), "{action}");
        assert_eq!((forces.len(), support.len()), (contacts.len(), contacts.len()), "{action}");
        let mut kinds = std::collections::BTreeSet::new();
        for (drawn, told) in contacts.iter().enumerate() {
            let [a, b, c, d] = footing.on_floor(2 * drawn).map(u8::from);
            assert_eq!(*told, f64::from(a + 2 * b + 4 * c + 8 * d), "{action}, {drawn}");
            let force = footing.force_body_weights()[2 * drawn];
            assert!((forces[drawn] - force).abs() < 6e-4, "{action}, {drawn}");
            kinds.insert(*told as u8);
        }
        assert!(kinds.len() > 2, "{action}: {kinds:?}");
    }
}

#[test]
fn a_page_beside_a_table_is_the_page_that_is_written_alone_and_two_outputs_are_two_files() {
    let folder = program::folder("beside");
    let (table, beside, alone) =
        (folder.join("bow.csv"), folder.join("bow.html"), folder.join("alone.html"));
    let run = |outputs: &[&Path]| {
        let mut gaitway = program::gaitway();
        gaitway.args(["synth", "bow", "--html"]).arg(outputs[0]);
        if let Some(table) = outputs.get(1) {
            gaitway.arg("-o").arg(table);
        }
        gaitway.output().unwrap()
    };
    let done = run(&[&beside, &table]);
    assert!(done.status.success(), "{}", program::words(&done));
    assert!(program::words(&done).contains("bow.html"), "{}", program::words(&done));
    assert!(std::fs::read_to_string(&table).unwrap().starts_with("time_s,"));
    assert!(run(&[&alone]).status.success());
    let read = |path: &Path| std::fs::read_to_string(path).unwrap();
    assert_eq!(read(&beside), read(&alone));
    assert_eq!(read(&alone), synth("bow", "the-same.html"));
    // Neither is written over, nor are they one.
    let (again, one) = (run(&[&beside, &folder.join("other.csv")]), folder.join("one.html"));
    assert!(!again.status.success() && !folder.join("other.csv").exists());
    assert!(!run(&[&one, &one]).status.success() && !one.exists());
}

#[test]
fn a_page_draws_the_centre_of_mass_and_the_points_of_the_body() {
    let motion = motion(&synth("sit-down", "centre.html"));
    let (body, poses) = (body(), poses("sit-down", 120.0));
    let masses = segment_masses(&body);
    let centres = page::rows::<3>(&motion["centre"]);
    let points: Vec<Vec<[f64; 3]>> =
        motion["points"].as_array().unwrap().iter().map(page::rows::<3>).collect();
    assert_eq!((centres.len(), points.len()), (poses.len().div_ceil(2), 22));
    let near = |drawn: [f64; 3], place_m: DVec3| {
        let off_m = (DVec3::from_array(drawn) - place_m).abs().max_element();
        assert!(off_m <= 5e-4 + 1e-12, "{drawn:?} for {place_m} m");
    };
    for (drawn, pose) in poses.iter().step_by(2).enumerate() {
        near(centres[drawn], centre_of_mass_m(&body, &masses, pose));
        let at = body.positions(pose);
        for (point, place_m) in points.iter().zip(at.joints_m.iter().chain(&at.ends_m)) {
            near(point[drawn], *place_m);
        }
    }
}

/// Who stands still on both soles spans a rectangle: as long as a foot (de Leva's women and men: 0.2283 of
/// 1.735 m, 0.2581 of 1.741 m), and a sole's breadth (0.055 of the stature) broader than the ankles are apart.
#[test]
fn a_page_draws_what_the_soles_span() {
    let motion = motion(&synth("bow", "span.html"));
    let corners: Vec<[f64; 2]> =
        corners(&motion, 0).into_iter().map(|corner| corner.map(|at_m| at_m * 1e3)).collect();
    assert_eq!(corners.len(), 4, "{corners:?}");
    let extent = |axis: usize| {
        let along = corners.iter().map(|corner| corner[axis]);
        let (least, most) = along.fold((f64::MAX, f64::MIN), |(a, b), at| (a.min(at), b.max(at)));
        most - least
    };
    let at = body().positions(&poses("bow", 120.0)[0]);
    let apart_mm = 1e3 * (at.joint_m(Joint::LeftAnkle).y - at.joint_m(Joint::RightAnkle).y);
    let long_mm = 1750.0 * f64::midpoint(0.2283 / 1.735, 0.2581 / 1.741);
    assert!((extent(0) - long_mm).abs() < 2.0, "{corners:?}");
    assert!((extent(1) - apart_mm - 1750.0 * 0.055).abs() < 2.0, "{corners:?}");
}

fn page(scene: &Scene<'_>) -> Value {
    motion(&page_of(scene).unwrap())
}

#[test]
fn a_page_says_nothing_of_forces_that_few_poses_cannot_tell_and_of_feet_that_nobody_captured() {
    let (body, poses) = (body(), poses("walk", 30.0));
    let few = Scene {
        title: "a </title><script> & walk",
        poses: &poses,
        body: &body,
        rate_hz: 30.0,
        floor_m: 0.0,
        feet: DrawnFeet::Made,
    };
    let told = page(&few);
    assert!(told.get("force").is_none());
    assert_eq!(list(&told, "contacts").len(), poses.len());
    assert!(
        page_of(&few).unwrap().contains("<title>a &lt;/title&gt;&lt;script&gt; &amp; walk</title>")
    );
    // Frames of 0.008333 s are 120.0048 a second: two make one of 60.
    let fast = page(&Scene { rate_hz: 1.0 / 0.008333, ..few });
    assert_eq!(list(&fast, "contacts").len(), poses.len().div_ceil(2));
    let no_feet = page(&Scene { feet: DrawnFeet::DrawnOn, ..few });
    assert!(no_feet.get("contacts").is_none() && no_feet.get("support").is_none());
}

/// A walk that was captured 0.3 m above the zero of its file.
#[test]
fn a_capture_is_drawn_on_the_floor_that_it_stands_on() {
    let folder = program::folder("lifted");
    let bvh = written("synth", "walk", &folder.join("walk.bvh"));
    let (head, rows) = bvh.split_once("Frame Time").unwrap();
    let (time, rows) = rows.split_once('\n').unwrap();
    let scale = 100.0;
    let lifted: Vec<String> = rows
        .lines()
        .map(|row| {
            let (x, rest) = row.split_once(' ').unwrap();
            let (y, rest) = rest.split_once(' ').unwrap();
            let y: f64 = y.parse().unwrap();
            format!("{x} {} {rest}", y + 0.3 * scale)
        })
        .collect();
    let capture = folder.join("lifted.bvh");
    std::fs::write(&capture, format!("{head}Frame Time{time}\n{}\n", lifted.join("\n"))).unwrap();
    let capture = capture.to_str().unwrap();
    let text = written("convert", capture, &folder.join("lifted.x3d"));
    let scene = parsed(&text);
    let floor_m = vector(named(&scene, "floor"), "translation").y;
    assert!((floor_m - 0.3).abs() < 0.02, "{floor_m} m");
    let told = motion(&written("convert", capture, &folder.join("lifted.html")));
    let on_floor = list(&told, "contacts").iter().filter(|sum| **sum > 0.0).count();
    let all = list(&told, "contacts").len();
    assert!(on_floor > all * 8 / 10, "{on_floor} of {all}");
    let points = told["points"].as_array().unwrap();
    let heights = points.iter().flat_map(|point| page::series(&point[2]));
    let lowest_m = heights.fold(f64::MAX, f64::min);
    assert!(lowest_m.abs() < 0.02, "{lowest_m} m");
}

/// Lengths of the runs of `wanted` that begin and end within the series, in samples.
fn runs(series: &[bool], wanted: bool) -> Vec<usize> {
    let all: Vec<&[bool]> = series.chunk_by(|a, b| a == b).collect();
    let inner = all.get(1..all.len().saturating_sub(1)).unwrap_or_default();
    inner.iter().filter(|run| run[0] == wanted).map(|run| run.len()).collect()
}

/// The soles of a capture as a page finds them, as measured ones and as those of a body that was made would be; and poses
/// per second.
fn soles(path: &Path) -> Option<([Vec<[bool; 4]>; 2], f64)> {
    let read = body_motion(path.to_str().unwrap(), None, &CaptureOptions::default());
    let (capture, _) = read.ok()?;
    let feet = DrawnFeet::of(capture.is_made, &capture.tracked);
    if feet == DrawnFeet::DrawnOn {
        return None;
    }
    assert_eq!(feet, DrawnFeet::Measured, "{}", path.display());
    let body = Proportions::of_stature(capture.stature_m).ok()?;
    let angles = JointAngles::of_clip(&capture.poses, capture.rate_hz).angles;
    let modelled = |(angles, pose): (&JointAngles, &SegmentPose)| {
        angles.to_pose(pose.root_m, pose.orientation[Segment::Pelvis.index()])
    };
    let poses: Vec<SegmentPose> = angles.iter().zip(&capture.poses).map(modelled).collect();
    let (rate_hz, floor_m) = (capture.rate_hz, contact::floor_m(&body, &poses));
    let found = [feet, DrawnFeet::Made].map(|feet| {
        let scene = Scene { title: "", poses: &poses, body: &body, rate_hz, floor_m, feet };
        scene.carries().unwrap()
    });
    Some((found, rate_hz))
}

/// Of each foot, whether heel or toe carry.
fn feet(soles: &[[bool; 4]]) -> [Vec<bool>; 2] {
    [0, 2].map(|at| soles.iter().map(|on| on[at] || on[at + 1]).collect())
}

/// Contacts and gaps of a heel, a toe that are over in less than 50 ms.
fn flickers(soles: &[[bool; 4]], rate_hz: f64) -> usize {
    let short = |samples: &usize| *samples as f64 / rate_hz < 0.05;
    let of = |end: usize| {
        let series: Vec<bool> = soles.iter().map(|on| on[end]).collect();
        [true, false].map(|wanted| runs(&series, wanted).iter().filter(|n| short(n)).count())
    };
    (0..4).flat_map(of).sum()
}

#[test]
fn contacts_of_captured_feet_do_not_flicker_and_standing_feet_stand() {
    let Some(folder) = captured::captured("mocap/bvh") else { return };
    let (mut files, mut of_made, mut seconds) = (0, 0, 0.0);
    // All of them take half a minute.
    let few = ["_bow_", "_walk_normal", "_run_normal", "jumping", "01_01", "kicking"];
    let is_long = std::env::var_os("GAITWAY_LONG").is_some();
    for path in captured::bvh_files(&folder) {
        if !is_long && !few.iter().any(|name| path.to_string_lossy().contains(name)) {
            continue;
        }
        let Some(([measured, made], rate_hz)) = soles(&path) else { continue };
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let counts = [&measured, &made].map(|soles| flickers(soles, rate_hz));
        let share = |soles: &[[bool; 4]]| {
            feet(soles).map(|foot| foot.iter().filter(|on| **on).count() as f64 / foot.len() as f64)
        };
        aloud!("{name:50} {counts:?} {:.2?} {:.2?}", share(&measured), share(&made));
        assert_eq!(counts[0], 0, "{name}");
        files += 1;
        of_made += counts[1];
        seconds += measured.len() as f64 / rate_hz;
        if name.contains("run_normal") {
            // Runners fly; each foot stands for a quarter to two fifths of the time.
            let share = share(&measured);
            assert!(share.iter().all(|share| (0.15..0.5).contains(share)), "{name}: {share:?}");
        }
        if name.contains("_bow_") {
            // Nobody lifts a foot from the middle of a bow.
            let [left, right] = feet(&measured);
            let (from, to) = (left.len() / 3, 2 * left.len() / 3);
            let stand = |foot: &[bool]| foot[from..to].iter().all(|on| *on);
            assert!(stand(&left) && stand(&right), "{name}");
        }
    }
    aloud!("{files} captures, {seconds:.0} s: no flicker, {of_made} by the rule of made bodies");
    assert!(of_made > 50, "{of_made}: nothing was to be mended");
}
