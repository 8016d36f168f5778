//! The page that shows motions, as a person gets it: written by the program, opened from a file in a browser without
//! a network, played, clicked at, and looked at.

mod aloud;
mod browser;
mod captured;
#[allow(dead_code)]
mod chromium;
mod page;
mod program;

use aloud::aloud;
use browser::browser;
use chromium::Browser;
use gaitway::rigid::Placement;
use gaitway::robot::{Robot, RobotBody};
use gaitway::view::ViewPage;
use gaitway::view::scene::ViewScene;
use gaitway::view::series::Coded;
use gaitway::view::tracks::{JointTrack, JointTracks, SampleClock};
use glam::{DQuat, DVec3};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Runs the program, which writes a page.
fn run(arguments: &[&str]) {
    let done = program::gaitway().args(arguments).output().expect("it runs");
    // A virtual robot is told that it would fall, and a mended trial that some of it is left.
    let code = done.status.code();
    assert!(matches!(code, Some(0 | 3)), "{arguments:?}: {}", program::words(&done));
}

fn path(folder: &Path, name: &str) -> String {
    folder.join(name).to_str().expect("UTF-8").to_owned()
}

/// A person who walks, as a table of markers on every joint: one of them is away for a while, one jumps.
fn marker_table(folder: &Path) -> String {
    let page = path(folder, "walker.html");
    run(&["synth", "walk", "-o", &page]);
    let data = page::data(&std::fs::read_to_string(&page).unwrap());
    let points: Vec<Vec<[f64; 3]>> =
        data["person"]["points"].as_array().unwrap().iter().map(page::rows::<3>).collect();
    let titles = (0..points.len()).map(|n| format!(",M{n}_x_m,M{n}_y_m,M{n}_z_m"));
    let mut text = format!("time_s{}\n", titles.collect::<String>());
    for at in 0..points[0].len() {
        text += &format!("{:.6}", at as f64 / 60.0);
        for (n, point) in points.iter().enumerate() {
            let [x, y, z] = point[at];
            let away = n == 3 && (20..28).contains(&at);
            let jump = if n == 5 && (40..44).contains(&at) { 0.2 } else { 0.0 };
            text +=
                &if away { ",,,".to_owned() } else { format!(",{x:.5},{y:.5},{:.5}", z + jump) };
        }
        text += "\n";
    }
    let file = path(folder, "walker.csv");
    std::fs::write(&file, text).unwrap();
    file
}

/// A kick on OP3, in which it falls.
fn retarget_kick(table: &str, page: &str) {
    let kick = ["retarget", "kick-r", "--allow-fall", "--robot", "op3"];
    run(&[&kick[..], &["-o", table, "--html", page]].concat());
}

/// One page of each command, and what it shows.
fn pages(folder: &Path) -> Vec<(PathBuf, &'static [&'static str])> {
    let at = |name: &str| path(folder, name);
    let markers = marker_table(folder);
    let [play, kick, synth, seen, info, trial, clean, arm] =
        ["play", "kick", "synth", "seen", "info", "trial", "clean", "arm"]
            .map(|name| at(&format!("{name}.html")));
    let sim = ["--robot", "op3", "--bus", "sim"];
    run(&[&["play", "walk:x1"], &sim[..], &["--record", &at("walk.mcap"), "--html", &play]]
        .concat());
    retarget_kick(&at("kick.csv"), &kick);
    run(&["retarget", "wave-r", "--robot", "so101", "-o", &at("arm.csv"), "--html", &arm]);
    run(&["synth", "kick-r", "-o", &synth]);
    run(&["recognise", "walk:4s,wave-r,bow", "--html", &seen]);
    let hand = at("hand.html");
    let taught = ["record", "servos:op3@sim:pty", "--limp", "--for", "1s", "-o"];
    run(&[&taught[..], &[&at("hand.mcap"), "--html", &hand]].concat());
    run(&["info", &at("walk.mcap"), "--html", &info]);
    run(&["info", &markers, "--html", &trial]);
    let plates = at("plates.html");
    let walked = captured::captured("mocap/c3d/pig").map(|of| of.join("cgm_Movement_trial.c3d"));
    if let Some(walked) = &walked {
        run(&["info", walked.to_str().expect("UTF-8"), "--html", &plates]);
    }
    run(&["clean", &markers, "-o", &at("mended.csv"), "--html", &clean]);
    let two = at("two.html");
    run(&["synth", "bow", "-o", &at("bow.bvh")]);
    run(&["synth", "walk:x2", "-o", &at("walks.bvh")]);
    run(&["info", &at("bow.bvh"), "--beside", &at("walks.bvh"), "--html", &two]);
    let plates: Option<(PathBuf, &[&str])> =
        walked.is_some().then(|| (plates.into(), &["markers", "force plates"][..]));
    let mut all: Vec<(PathBuf, &[&str])> = vec![
        (play.into(), &["robot", "goal", "person"]),
        (kick.into(), &["robot", "person"]),
        (arm.into(), &["robot", "person"]),
        (synth.into(), &["person", "support"]),
        (seen.into(), &["person"]),
        (hand.into(), &["robot"]),
        (info.into(), &["robot", "goal"]),
        (trial.into(), &["markers"]),
        (clean.into(), &["markers", "before"]),
        (two.into(), &["person", "contacts"]),
    ];
    all.extend(plates);
    all
}

#[test]
fn every_page_opens_from_a_file_plays_and_says_nothing_into_the_console() {
    let Some(mut browser) = browser("opened") else { return };
    let folder = program::folder("pages");
    for (page, shown) in pages(&folder) {
        let name = page.display();
        browser.look(1280, 900, false);
        browser.open(&page, "");
        let labels = browser.value("document.getElementById('shown').innerText");
        for part in shown {
            assert!(labels.as_str().unwrap().contains(part), "{name} has no {part}: {labels}");
        }
        assert_eq!(browser.value("document.getElementById('nothing').hidden"), true, "{name}");
        // The play head moves when somebody presses the space bar, and stands when somebody does again.
        assert_eq!(browser.value("gaitway.figures().now"), 0.0, "{name}");
        browser.key(" ", "Space");
        browser.frames(5);
        let later = browser.value("gaitway.figures().now").as_f64().unwrap();
        assert!(later > 0.0, "{name} plays");
        browser.key(" ", "Space");
        let stands = browser.value("gaitway.figures().now");
        browser.frames(3);
        assert_eq!(browser.value("gaitway.figures().now"), stands, "{name} stands");
        // A step is a sample.
        browser.key("Home", "Home");
        browser.key(".", "Period");
        browser.frames(2);
        let step = browser.value("gaitway.figures().now").as_f64().unwrap();
        // A robot that was recorded in real time on a busy machine has late cycles.
        assert!((0.001..1.0).contains(&step), "{name}: a step of {step} s");
        // Who hears instead of seeing is told the same.
        let said = browser.value("document.getElementById('said').textContent");
        assert!(said.as_str().unwrap().starts_with(&format!("{step:.2} s")), "{name}: {said}");
        assert_eq!(browser.complaints(), [""; 0], "{name}");
        if shown.contains(&"force plates") {
            the_floor_pushes_at_a_heel_or_toe(&mut browser, &page);
        }
    }
}

#[test]
fn a_motion_that_was_stopped_has_the_moment_on_its_time_line_from_which_it_brakes() {
    let folder = program::folder("brakes");
    let [script, html] = ["mute.toml", "stopped.html"].map(|name| path(&folder, name));
    let mute = "[[fault]]\nkind = 'mute'\njoint = 'head_pan'\nfrom_s = 4\n";
    std::fs::write(&script, mute).expect("a script");
    let done = program::gaitway()
        .args(["play", "walk", "--hang", "--robot", "op3", "--bus", "sim", "--json"])
        .args(["--faults", &script, "--html", &html])
        .output()
        .expect("it runs");
    let report = program::json(&done);
    assert_eq!(report["outcome"], "stopped", "{report:#}");
    let found_s = report["stop"]["cycle"].as_f64().expect("a cycle")
        / report["cycle_hz"].as_f64().expect("a rate");
    let data = page::data(&std::fs::read_to_string(&html).expect("a page"));
    let parts: Vec<(&str, f64, f64)> = data["spans"]
        .as_array()
        .expect("spans")
        .iter()
        .filter(|span| span["row"] == "part")
        .map(|span| {
            let time = |key: &str| span[key].as_f64().expect("a time");
            (span["label"].as_str().expect("a label"), time("start_s"), time("end_s"))
        })
        .collect();
    let [(approach, ..), (motion, _, left_s), (brakes, from_s, end_s)] = parts[..] else {
        panic!("{parts:?}")
    };
    assert_eq!((approach, motion, brakes), ("approach", "motion", "brakes"));
    assert_eq!(left_s, from_s);
    assert!((from_s - found_s).abs() < 0.02, "found at {found_s} s, brakes from {from_s} s");
    // It comes to rest, and the page ends there.
    assert!(end_s > from_s + 0.05 && end_s == data["duration_s"].as_f64().expect("a time"));
}

#[test]
fn two_captures_are_drawn_in_one_room_each_as_in_a_page_of_its_own() {
    let Some(mut browser) = browser("both") else { return };
    let folder = program::folder("both");
    let at = |name: &str| path(&folder, name);
    run(&["synth", "bow", "-o", &at("bow.bvh")]);
    run(&["synth", "walk:x2", "-o", &at("walk.bvh")]);
    let mut places = |page: &str, who: usize, t: f64| {
        browser.open(Path::new(page), "");
        assert_eq!(browser.complaints(), [""; 0]);
        browser.value(&format!("gaitway.persons({t})[{who}]"))
    };
    for name in ["bow", "walk"] {
        run(&["info", &at(&format!("{name}.bvh")), "--html", &at(&format!("{name}.html"))]);
    }
    run(&["info", &at("bow.bvh"), "--beside", &at("walk.bvh"), "--html", &at("both.html")]);
    for (who, name) in ["bow", "walk"].into_iter().enumerate() {
        for t in [0.0, 0.7, 1.4] {
            let alone = places(&at(&format!("{name}.html")), 0, t);
            assert_eq!(places(&at("both.html"), who, t), alone, "{name} at {t} s");
        }
    }
    let robot = program::gaitway()
        .args(["info", &at("bow.bvh"), "--html", &at("x.html"), "--beside", &marker_table(&folder)])
        .output()
        .expect("it runs");
    assert_eq!(robot.status.code(), Some(1));
    assert!(program::words(&robot).contains("there is nobody in it"), "{}", program::words(&robot));
}

/// An arrow begins on its plate, at a foot that stands there, and points up as far as somebody weighs.
fn the_floor_pushes_at_a_heel_or_toe(browser: &mut Browser, page: &Path) {
    let data = page::data(&std::fs::read_to_string(page).unwrap());
    let plates = data["plates"]["plates"].as_array().unwrap();
    let points = data["markers"]["points"].as_array().unwrap();
    let feet: Vec<Vec<[f64; 3]>> = points
        .iter()
        .filter(|point| {
            ["LHEE", "LTOE", "RHEE", "RTOE"]
                .iter()
                .any(|end| point["name"].as_str().unwrap().ends_with(end))
        })
        .map(|point| page::rows::<3>(&point["at"]))
        .collect();
    assert_eq!(feet.len(), 4);
    let rate_hz = data["plates"]["clock"]["rate_hz"].as_f64().unwrap();
    let (mut pressed, mut up_n) = (0, 0.0_f64);
    for at in (0..feet[0].len()).step_by(10) {
        let arrows = browser.value(&format!("gaitway.arrows({})", at as f64 / rate_hz + 1e-4));
        for (plate, arrow) in plates.iter().zip(arrows.as_array().unwrap()) {
            let Some(ends) = arrow.as_array() else { continue };
            let end = |n: usize| [0, 1, 2].map(|k| ends[n][k].as_f64().unwrap());
            let ([x, y, z], [.., top]) = (end(0), end(1));
            let height_m = top - z;
            // A touch says little of where it is.
            if height_m < 0.1 {
                continue;
            }
            let corners = plate["corners_m"].as_array().unwrap();
            for (axis, place) in [x, y].into_iter().enumerate() {
                let of = |corner: &Value| corner[axis].as_f64().unwrap();
                let low = corners.iter().map(of).fold(f64::INFINITY, f64::min);
                let high = corners.iter().map(of).fold(f64::NEG_INFINITY, f64::max);
                assert!((low - 0.03..high + 0.03).contains(&place), "{place} on {low} to {high}");
            }
            let near = feet.iter().map(|foot| (foot[at][0] - x).hypot(foot[at][1] - y));
            assert!(near.fold(f64::INFINITY, f64::min) < 0.25, "nobody stands there: {x}, {y}");
            (pressed, up_n) = (pressed + 1, up_n.max(800.0 * height_m));
        }
    }
    // The same force that `info` tells: see tests/mocap/force_plates.rs and tests/mocap/measured_force.rs.
    assert!(pressed > 5 && (400.0..2000.0).contains(&up_n), "{pressed} arrows, {up_n} N");
}

#[test]
fn a_joint_is_chosen_from_the_list_or_by_a_click_on_the_robot() {
    let Some(mut browser) = browser("chosen") else { return };
    let folder = program::folder("joint");
    let page = path(&folder, "kick.html");
    let table = path(&folder, "kick.csv");
    retarget_kick(&table, &page);
    browser.look(1280, 900, false);
    browser.open(Path::new(&page), "#t=3.5");
    // The knee that kicks goes furthest: it is chosen at first.
    assert_eq!(browser.value("gaitway.figures().chosen"), serde_json::json!(["r_knee"]));
    // Joints that never move are folded away.
    let folded =
        "[...document.querySelectorAll('#choice details')].map(d => [d.open, d.innerText])";
    let folded = browser.value(folded);
    assert_eq!((&folded[0][0], &folded[1][0]), (&true.into(), &false.into()), "{folded}");
    assert!(folded[1][1].as_str().unwrap().contains("joints that never move"), "{folded}");
    let press = "(name => { const chip = [...document.querySelectorAll('.chip')]\
                 .find(chip => chip.textContent === name); chip.click(); \
                 return chip.getAttribute('aria-pressed'); })";
    assert_eq!(browser.value(&format!("{press}('l_el')")), "true");
    let chosen = serde_json::json!(["r_knee", "l_el"]);
    assert_eq!(browser.value("gaitway.figures().chosen"), chosen);
    browser.frames(2);
    let plots =
        browser.value("[...document.querySelectorAll('figcaption b')].map(b => b.textContent)");
    let expected = ["r_knee \u{b7} angle", "r_knee \u{b7} velocity", "l_el \u{b7} angle"];
    for title in expected {
        assert!(plots.as_array().unwrap().contains(&title.into()), "{plots}");
    }
    // Row by row over the middle of the scene, until the robot is hit somewhere.
    let place = browser.value(
        "(() => { const box = document.getElementById('scene').getBoundingClientRect(); \
         return [box.left, box.top, box.width, box.height]; })()",
    );
    let [left, top, width, height] = [0, 1, 2, 3].map(|at| place[at].as_f64().unwrap());
    let grid = (0..8).flat_map(|down| (0..12).map(move |across| (across, down)));
    let mut clicked = chosen.clone();
    for (across, down) in grid {
        let (across, down) = (0.4 + 0.05 * f64::from(across), 0.3 + 0.06 * f64::from(down));
        browser.click(left + across * width, top + down * height);
        browser.frames(2);
        clicked = browser.value("gaitway.figures().chosen");
        if clicked != chosen {
            break;
        }
    }
    assert_ne!(clicked, chosen, "a click on the robot chooses a joint, or lets it go");
    assert_eq!(browser.complaints(), [""; 0]);
}

/// Links where the body's own mathematics has them, from the table that is written beside the page.
#[test]
fn links_stand_in_the_page_where_the_table_puts_them() {
    let Some(mut browser) = browser("links") else { return };
    let folder = program::folder("where");
    let (page, table) = (path(&folder, "kick.html"), path(&folder, "kick.csv"));
    retarget_kick(&table, &page);
    browser.open(Path::new(&page), "");
    let body = RobotBody::of(&Robot::load("op3").unwrap().file).unwrap().unwrap();
    let text = std::fs::read_to_string(&table).unwrap();
    let rows: Vec<Vec<f64>> = text
        .lines()
        .skip(1)
        .map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect())
        .collect();
    let mut farthest_m: f64 = 0.0;
    for row in rows.iter().step_by(37) {
        let angles = &row[1..21];
        let base = &row[21..28];
        let turn = DQuat::from_xyzw(base[4], base[5], base[6], base[3]);
        let base = Placement { at_m: DVec3::from_slice(&base[..3]), turn };
        let placed = body.tree.place(base, &body.angles(angles));
        let drawn = browser.value(&format!("gaitway.links({}, 'goal')", row[0]));
        for (link, place) in placed.iter().enumerate() {
            let at = [0, 1, 2].map(|axis| drawn[link][axis].as_f64().unwrap());
            farthest_m = farthest_m.max(DVec3::from_array(at).distance(place.at_m));
        }
        let centre = browser.value(&format!("gaitway.centre({})", row[0]));
        let centre = DVec3::from_array([0, 1, 2].map(|axis| centre[axis].as_f64().unwrap()));
        farthest_m = farthest_m.max(centre.distance(body.tree.centre_of_mass_m(&placed)));
    }
    // Angles are rounded to 0.011 degrees, places to a tenth of a millimetre.
    assert!(farthest_m < 5e-4, "{farthest_m} m");
}

/// What is to be seen of a picture: how many colours there are in the scene, and which part of it is red, orange,
/// or bright.
fn seen(browser: &mut Browser, area: [f64; 4]) -> Value {
    let picture = browser.picture();
    browser.ask("Page.navigate", serde_json::json!({ "url": "about:blank" }));
    let [left, top, width, height] = area;
    browser.value(&format!(
        "new Promise(done => {{ const image = new Image(); image.onload = () => {{ \
           const sheet = document.createElement('canvas'); \
           sheet.width = image.width; sheet.height = image.height; \
           const pen = sheet.getContext('2d'); pen.drawImage(image, 0, 0); \
           const dots = pen.getImageData({left}, {top}, {width}, {height}).data; \
           const colours = new Set(); let red = 0, orange = 0, bright = 0; \
           for (let i = 0; i < dots.length; i += 4) {{ \
             const [r, g, b] = [dots[i], dots[i + 1], dots[i + 2]]; \
             colours.add((r >> 4) * 256 + (g >> 4) * 16 + (b >> 4)); \
             red += r > 110 && g < r / 2.6 && b < r / 2.6; \
             orange += r > 120 && g > 0.5 * r && g < 0.85 * r && b < 0.35 * r; \
             bright += r + g + b > 450; }} \
           const all = dots.length / 4; \
           done({{ colours: colours.size, red: red / all, orange: orange / all, bright: bright / all }}); \
         }}; image.src = 'data:image/png;base64,{picture}'; }})"
    ))
}

fn scene_area(browser: &mut Browser) -> [f64; 4] {
    let area = browser.value(
        "(() => { const box = document.getElementById('scene').getBoundingClientRect(); \
         return [box.left, box.top + 40, box.width, box.height - 90].map(Math.round); })()",
    );
    [0, 1, 2, 3].map(|at| area[at].as_f64().unwrap())
}

/// A robot that puts a hand into its hip.
#[test]
fn links_that_touch_are_red_and_the_joint_that_is_chosen_is_orange() {
    let Some(mut browser) = browser("red") else { return };
    let folder = program::folder("touching");
    let (page, table) = (path(&folder, "arms.html"), path(&folder, "arms.csv"));
    // From where the robot starts, the right arm down and its hand to the left, into the hip.
    let cross: String = [(0.0, 0.0), (0.5, 0.0), (1.0, 0.5), (1.5, 1.0), (2.0, 1.0), (2.5, 1.0)]
        .iter()
        .map(|(t, part)| format!("{t},{},{}\n", -0.785 - 0.7 * part, 0.785 + 0.715 * part))
        .collect();
    let arms = path(&folder, "in.csv");
    std::fs::write(&arms, format!("time_s,r_sho_roll_rad,r_el_rad\n{cross}")).unwrap();
    let hands = ["--robot", "op3", "--hang", "--retime", "-o", &table, "--html", &page];
    run(&[&["retarget", &arms][..], &hands].concat());
    let data = page::data(&std::fs::read_to_string(&page).unwrap());
    let spans = data["spans"].as_array().unwrap();
    let touches = spans.iter().find(|span| span["row"] == "touches itself");
    let touches = touches.unwrap_or_else(|| panic!("the hand goes into the hip: {spans:#?}"));
    let middle_s =
        f64::midpoint(touches["start_s"].as_f64().unwrap(), touches["end_s"].as_f64().unwrap());
    let (mut red, mut orange) = (Vec::new(), Vec::new());
    for moment_s in [0.0, middle_s] {
        browser.look(1280, 900, false);
        browser.open(Path::new(&page), &format!("#t={moment_s}&joint=r_knee"));
        let area = scene_area(&mut browser);
        let seen = seen(&mut browser, area);
        assert!(seen["colours"].as_u64().unwrap() > 30, "{seen}");
        red.push(seen["red"].as_f64().unwrap());
        orange.push(seen["orange"].as_f64().unwrap());
    }
    assert!(red[0] < 1e-4 && red[1] > 0.003, "{red:?}");
    assert!(orange.iter().all(|part| *part > 0.001), "{orange:?}");
}

/// A tetrahedron: three corners along the axes and the origin.
const SPIKE: [[f64; 3]; 4] =
    [[0.0, 0.0, 0.0], [60.0, 0.0, 0.0], [0.0, 60.0, 0.0], [0.0, 0.0, 240.0]];
const SPIKE_FACES: [[usize; 3]; 4] = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];

/// A package of ROS with an arm of two joints, whose meshes are millimetres and far larger than what the arm takes up.
fn arm_package(folder: &Path) -> PathBuf {
    let package = folder.join("arm_description");
    for of in ["urdf", "meshes"] {
        std::fs::create_dir_all(package.join(of)).unwrap();
    }
    let corner = |at: &usize| SPIKE[*at].map(|value| value.to_string()).join(" ");
    let facet = |of: &[usize; 3]| {
        let corners: String = of.iter().map(|at| format!("vertex {}\n", corner(at))).collect();
        format!("facet normal 0 0 0\nouter loop\n{corners}endloop\nendfacet\n")
    };
    let stl: String = SPIKE_FACES.iter().map(facet).collect();
    std::fs::write(package.join("meshes/upper.stl"), format!("solid s\n{stl}endsolid\n")).unwrap();
    let points: String = (0..4).map(|at| format!("v {}\n", corner(&at))).collect();
    let faces =
        SPIKE_FACES.map(|of| format!("f {}\n", of.map(|at| (at + 1).to_string()).join(" ")));
    std::fs::write(package.join("meshes/tool.obj"), points + &faces.concat()).unwrap();
    let link = |name: &str, mesh: &str, origin: &str| {
        format!(
            "<link name=\"{name}\"><inertial><mass value=\"0.1\"/><inertia ixx=\"1e-4\" iyy=\"1e-4\" izz=\"1e-4\"/>\
             </inertial><visual>{origin}<geometry><mesh filename=\"{mesh}\" scale=\"0.001 0.001 0.001\"/></geometry>\
             </visual><collision><geometry><box size=\"0.01 0.01 0.01\"/></geometry></collision></link>"
        )
    };
    let joint = |name: &str, parent: &str, child: &str, origin: &str| {
        format!(
            "<joint name=\"{name}\" type=\"revolute\"><parent link=\"{parent}\"/><child link=\"{child}\"/>{origin}\
             <axis xyz=\"0 1 0\"/><limit lower=\"-1\" upper=\"1\" velocity=\"3\" effort=\"1\"/></joint>"
        )
    };
    let turned = "<origin xyz=\"0 0 0.1\" rpy=\"0 0 1.5707963267948966\"/>";
    let urdf = format!(
        "<robot name=\"arm\"><link name=\"world\"/>{}{}{}{}{}{}</robot>",
        link("upper", "package://arm_description/meshes/upper.stl", "<origin xyz=\"0.02 0 0\"/>"),
        link("tool", "../meshes/tool.obj", ""),
        link("end", "../meshes/gone.stl", ""),
        joint("shoulder", "world", "upper", turned),
        joint("elbow", "upper", "tool", "<origin xyz=\"0 0 0.2\"/>"),
        joint("wrist", "tool", "end", "<origin xyz=\"0 0 0.2\"/>"),
    );
    let file = package.join("urdf/arm.urdf");
    std::fs::write(&file, urdf).unwrap();
    file
}

#[test]
fn a_robot_looks_like_the_meshes_of_its_model_or_like_the_shapes_that_stand_for_them() {
    let Some(mut browser) = browser("meshes") else { return };
    let folder = program::folder("meshes-of-an-arm");
    let model = arm_package(&folder);
    let robots = folder.join("robots");
    std::fs::create_dir_all(&robots).unwrap();
    let (robot, page, table) =
        (path(&robots, "arm.toml"), path(&folder, "arm.html"), path(&folder, "arm.csv"));
    // As somebody types it who stands beside the model.
    let order = ["robot", "import", "arm.urdf", "--servo", "sts3215", "-o", &robot];
    let beside = model.parent().unwrap();
    let done = program::gaitway().current_dir(beside).args(order).output().expect("it runs");
    let said = program::words(&done);
    assert!(done.status.success() && said.contains("2 meshes"), "{said}");
    assert!(said.contains("pages cannot show ../meshes/gone.stl"), "{said}");
    // As they are seen from the robot's file, so that a folder with both can be moved.
    let text = std::fs::read_to_string(&robot).unwrap();
    assert!(text.contains("file = \"../arm_description/meshes/tool.obj\""), "{text}");
    let turns = path(&folder, "turns.csv");
    std::fs::write(&turns, "time_s,shoulder_rad,elbow_rad\n0,0,0\n1,0.3,0.3\n2,0,0\n").unwrap();
    let order = ["retarget", &turns, "--robot", &robot, "-o", &table, "--html", &page];
    run(&[&order[..], &["--retime"]].concat());

    let links = &page::data(&std::fs::read_to_string(&page).unwrap())["robot"]["links"];
    // Axes of links are the base's with all joints at zero: the shoulder is turned by a quarter about Z.
    let expected: [(usize, [[f64; 3]; 4]); 2] = [
        (1, SPIKE.map(|[x, y, z]| [-y / 1e3, x / 1e3 + 0.02, z / 1e3])),
        (2, SPIKE.map(|[x, y, z]| [-y / 1e3, x / 1e3, z / 1e3])),
    ];
    for (link, expected) in expected {
        let points = page::rows::<3>(&links[link]["mesh"]["points"]);
        let triangles = page::rows::<3>(&links[link]["mesh"]["triangles"]);
        let near = |of: &[f64; 3], point: &[f64; 3]| {
            of.iter().zip(point).all(|(a, b)| (a - b).abs() < 1e-4)
        };
        let corners = triangles.iter().map(|of| of.map(|at| points[at as usize]));
        let faces = SPIKE_FACES.map(|of| of.map(|at| expected[at]));
        let mut found = 0;
        for triangle in corners {
            let is_same = |face: &[[f64; 3]; 3]| {
                (0..3).any(|turn| (0..3).all(|at| near(&triangle[(at + turn) % 3], &face[at])))
            };
            found += faces.iter().filter(|face| is_same(face)).count();
        }
        assert_eq!((found, triangles.len()), (4, 4), "link {link}: {points:?}");
    }
    assert_eq!((&links[0]["mesh"], &links[3]["mesh"]), (&Value::Null, &Value::Null));

    let mut orange = Vec::new();
    for are_shown in [true, false] {
        browser.look(1280, 900, false);
        browser.open(Path::new(&page), "#t=0&joint=shoulder");
        if !are_shown {
            browser.value(
                "[...document.querySelectorAll('#shown label')].find(of => \
                 of.innerText.includes('its meshes')).click()",
            );
            browser.frames(3);
        }
        let area = scene_area(&mut browser);
        orange.push(seen(&mut browser, area)["orange"].as_f64().unwrap());
    }
    // Its box is 10 mm wide, its spike 240 mm long.
    assert!(orange[1] > 0.0 && orange[0] > 5.0 * orange[1], "{orange:?}");

    // Lengths in mm that nobody scaled: that mesh alone is left out.
    let (before, after) = text.split_once("tool.obj\", scale = [0.001, 0.001, 0.001]").expect("it");
    std::fs::write(&robot, format!("{before}tool.obj\"{after}")).unwrap();
    run(&[&order[..], &["--retime", "--force"]].concat());
    let html = std::fs::read_to_string(&page).unwrap();
    assert!(html.contains("tool.obj (it reaches 2.400e2 m far"), "it is said on the page");
    let links = &page::data(&html)["robot"]["links"];
    assert!(links[1]["mesh"].is_object() && links[2]["mesh"].is_null(), "the others are drawn");
    std::fs::write(&robot, &text).unwrap();

    std::fs::remove_file(folder.join("arm_description/meshes/tool.obj")).unwrap();
    run(&[&order[..], &["--retime", "--force"]].concat());
    let html = std::fs::read_to_string(&page).unwrap();
    assert!(html.contains("1 mesh of the robot cannot be shown"), "it is said on the page");
    let links = &page::data(&html)["robot"]["links"];
    assert!(links[1]["mesh"].is_object() && links[2]["mesh"].is_null(), "the others are drawn");
}

#[test]
fn a_page_fits_a_phone_and_is_dark_where_everything_is() {
    let Some(mut browser) = browser("phone") else { return };
    let folder = program::folder("small");
    let (page, table) = (path(&folder, "kick.html"), path(&folder, "kick.csv"));
    retarget_kick(&table, &page);
    let mut bright = Vec::new();
    for dark in [false, true] {
        browser.look(390, 844, dark);
        browser.open(Path::new(&page), "#t=3.5");
        let widths = browser.value("[document.documentElement.scrollWidth, innerWidth]");
        assert_eq!((&widths[0], &widths[1]), (&390.into(), &390.into()), "nothing is beside it");
        let heights = browser.value(
            "['stage', 'time', 'signals'].map(id => document.getElementById(id)\
             .getBoundingClientRect().top)",
        );
        let [stage, time, signals] = [0, 1, 2].map(|at| heights[at].as_f64().unwrap());
        assert!(stage < time && time < signals, "one below the other: {heights}");
        // A finger can hit what is to be hit.
        let play = browser.value("document.getElementById('play').getBoundingClientRect().height");
        assert!(play.as_f64().unwrap() >= 24.0, "{play}");
        bright.push(seen(&mut browser, [0.0, 0.0, 390.0, 844.0])["bright"].as_f64().unwrap());
    }
    assert!(bright[0] > 0.5 && bright[1] < 0.2, "{bright:?}");
}

#[test]
fn where_nothing_can_be_drawn_in_space_the_page_says_so_and_the_rest_works() {
    let Some(mut browser) = browser("flat") else { return };
    let folder = program::folder("no-webgl");
    let (page, table) = (path(&folder, "wave.html"), path(&folder, "wave.csv"));
    run(&["retarget", "wave-r", "--robot", "op3", "-o", &table, "--html", &page]);
    browser.beforehand(
        "const usual = HTMLCanvasElement.prototype.getContext; \
         HTMLCanvasElement.prototype.getContext = function(kind, ...more) { \
         return kind.startsWith('webgl') ? null : usual.call(this, kind, ...more); };",
    );
    browser.open(Path::new(&page), "#t=4");
    let said = browser.value("document.getElementById('nothing').innerText");
    assert!(said.as_str().unwrap().contains("draws nothing in space"), "{said}");
    let places = browser.value(
        "['nothing', 'now'].map(id => document.getElementById(id).getBoundingClientRect())\
         .map(at => [at.top, at.bottom])",
    );
    assert!(places[0][1].as_f64() <= places[1][0].as_f64(), "one is under the other: {places}");
    browser.key(" ", "Space");
    browser.frames(4);
    assert!(browser.value("gaitway.figures().now").as_f64().unwrap() > 4.0, "it plays");
    let plots = browser.value("document.querySelectorAll('figure canvas').length");
    assert!(plots.as_u64().unwrap() >= 2, "{plots}");
}

#[test]
fn every_control_has_a_name_and_is_reached_by_the_keyboard() {
    let Some(mut browser) = browser("keyboard") else { return };
    let folder = program::folder("keys");
    let page = path(&folder, "walk.html");
    run(&["synth", "walk", "-o", &page]);
    browser.look(1280, 900, false);
    browser.open(Path::new(&page), "");
    let tree = browser.ask("Accessibility.getFullAXTree", serde_json::json!({}));
    let roles = ["button", "checkbox", "slider", "combobox", "image"];
    let mut counts = std::collections::BTreeMap::new();
    for node in tree["nodes"].as_array().unwrap() {
        let role = node["role"]["value"].as_str().unwrap_or_default();
        if node["ignored"] == true || !roles.contains(&role) {
            continue;
        }
        let name = node["name"]["value"].as_str().unwrap_or_default();
        assert!(!name.is_empty(), "{role} without a name: {node:#}");
        *counts.entry(role.to_owned()).or_insert(0) += 1;
    }
    assert!(counts["button"] >= 4 && counts["slider"] == 1 && counts["image"] >= 3, "{counts:?}");
    let mut reached = Vec::new();
    for _ in 0..30 {
        browser.key("Tab", "Tab");
        let id = browser.value("document.activeElement.id || document.activeElement.className");
        reached.push(id.as_str().unwrap_or_default().to_owned());
    }
    for id in ["scene", "play", "back", "forth", "speed", "loop", "follow", "head", "chip"] {
        assert!(reached.iter().any(|at| at == id), "{id}: {reached:?}");
    }
}

/// Goals and angles of ten minutes at 100 Hz: as large a page as there should be.
#[test]
fn ten_minutes_of_sixty_joints_stay_below_eight_megabytes_and_play() {
    let mut state = 7_u32;
    let mut noise = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 8) / f64::from(1 << 24) - 0.5
    };
    let count = std::f64::consts::TAU / 4096.0;
    let joints = (0..60).map(|joint| {
        let rate = 3.0 + 0.07 * f64::from(joint);
        let angle = |n: i32| 0.7 * (f64::from(n) * 0.01 * rate).sin();
        let present = (0..60_000).map(|n| (angle(n - 3) / count + 1.2 * noise()).round() * count);
        JointTrack {
            name: format!("joint_{joint}"),
            goal: Some(Coded::of((0..60_000).map(angle), gaitway::view::ANGLE_RAD)),
            present: Some(Coded::of(present, gaitway::view::ANGLE_RAD)),
            ..JointTrack::default()
        }
    });
    let clock = SampleClock::of(&(0..60_000).map(|n| f64::from(n) * 0.01).collect::<Vec<f64>>());
    let joints = Some(JointTracks { clock, joints: joints.collect() });
    let scene = ViewScene { duration_s: 599.99, joints, ..ViewScene::default() };
    let html = ViewPage { title: "long".into(), scene, ..ViewPage::default() }.html().unwrap();
    assert!(html.len() < 8_000_000, "{} bytes", html.len());
    let Some(mut browser) = browser("long") else { return };
    let page = program::folder("ten-minutes").join("long.html");
    std::fs::write(&page, &html).unwrap();
    browser.look(1280, 900, false);
    browser.open(&page, "#t=300&joint=joint_7");
    let took = browser.value(
        "(() => { gaitway.redraw(); const began = performance.now(); \
         for (let i = 0; i < 50; i++) gaitway.redraw(); \
         return [(performance.now() - began) / 50, performance.memory.usedJSHeapSize / 2 ** 20]; })()",
    );
    aloud!(
        "ten minutes of sixty joints: {:.1} MB, {:.2} ms of script a frame, {:.0} MiB of memory",
        html.len() as f64 * 1e-6,
        took[0].as_f64().unwrap(),
        took[1].as_f64().unwrap()
    );
    let said = browser.value("document.querySelector('figcaption .goal').textContent");
    let degrees = (0.7_f64 * (300.0_f64 * (3.0 + 0.07 * 7.0)).sin()).to_degrees();
    let told: f64 = said.as_str().unwrap().split(' ').nth(1).unwrap().parse().unwrap();
    assert!((told - degrees).abs() < 0.06, "{said} for {degrees}");
    assert_eq!(browser.complaints(), [""; 0]);
}
