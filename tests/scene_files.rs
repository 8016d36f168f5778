//! Scenes for other people's viewers: the reference reader of MCAP decodes every message by Foxglove's own published
//! descriptors, and what stands in them is where other programs say it is.

mod aloud;
mod captured;
mod program;
mod python;

use aloud::aloud;
use program::{folder, gaitway, words};
use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output};

/// Decodes a scene; every schema in it is that of the package that publishes them, and no field is unknown to it.
const READ: &str = r#"
import json, sys
from importlib import import_module
from mcap.reader import make_reader
from mcap_protobuf.schema import build_file_descriptor_set
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.unknown_fields import UnknownFieldSet

def known(message):
    assert not UnknownFieldSet(message), message
    for field, value in message.ListFields():
        if field.type == field.TYPE_MESSAGE:
            for one in (value if field.is_repeated else [value]):
                known(one)

def scene(path):
    with open(path, "rb") as file:
        for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages():
            if schema.encoding != "protobuf":
                yield channel.topic, message.log_time * 1e-9, json.loads(message.data)
                continue
            package, name = schema.name.split(".")
            assert package == "foxglove"
            kind = getattr(import_module(f"foxglove_schemas_protobuf.{name}_pb2"), name)
            assert FileDescriptorSet.FromString(schema.data) == build_file_descriptor_set(kind), name
            told = kind.FromString(message.data)
            known(told)
            yield channel.topic, message.log_time * 1e-9, told
"#;

/// Where the links of a walk are: by its transforms, and by MuJoCo, which reads the robot's URDF out of the same file
/// and is told the joints' angles.
const ROBOT: &str = r#"
import mujoco, numpy as np, re
frames, angles, entities, urdf, logs = [], [], {}, None, []
for topic, at, told in scene(sys.argv[1]):
    if topic == "/transforms": frames.append((at, told))
    elif topic == "/joints/present": angles.append((at, {j.name: j.position for j in told.joints}))
    elif topic == "/robot_description": urdf = told["data"]
    elif topic == "/scene/robot": entities.update({e.id: e for e in told.entities})
    elif topic == "/events": logs.append(told.message)
urdf = urdf.replace("</robot>", '<mujoco><compiler fusestatic="false" discardvisual="false"/></mujoco></robot>')
model = mujoco.MjModel.from_xml_string(urdf)
data = mujoco.MjData(model)

def matrix(translation, rotation):
    m, q = np.eye(4), np.array([rotation.w, rotation.x, rotation.y, rotation.z])
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, q)
    m[:3, :3], m[:3, 3] = turn.reshape(3, 3), [translation.x, translation.y, translation.z]
    return m

def placed(told):
    where = {"world": np.eye(4)}
    for t in told.transforms:
        where[t.child_frame_id] = where[t.parent_frame_id] @ matrix(t.translation, t.rotation)
    return where

worst, moved, lowest, first = 0.0, {}, [], placed(frames[0][1])
assert [at for at, _ in frames] == [at for at, _ in angles]
for (at, told), (_, joints) in list(zip(frames, angles))[::40]:
    where = placed(told)
    for name, angle in joints.items():
        data.qpos[model.joint(name).qposadr[0]] = angle
    mujoco.mj_kinematics(model, data)
    base = where["base"]
    for i in range(1, model.nbody):
        name = model.body(i).name
        theirs = base[:3, :3] @ data.xpos[i] + base[:3, 3]
        worst = max(worst, float(np.abs(theirs - where[name][:3, 3]).max()))
    for name, m in where.items():
        moved[name] = max(moved.get(name, 0.0), float(np.abs(m - first[name]).max()))
    # The lowest corner of boxes in the world.
    low = []
    for e in entities.values():
        for cube in e.cubes:
            half = np.array([cube.size.x, cube.size.y, cube.size.z]) / 2
            m = where[e.frame_id] @ matrix(cube.pose.position, cube.pose.orientation)
            low.append(m[2, 3] - float(np.abs(m[2, :3]) @ half))
    lowest.append(min(low))
print(json.dumps({"worst_m": worst, "moved": moved, "bodies": model.nbody, "frames": len(frames),
    "first_s": frames[0][0], "last_s": frames[-1][0], "entities": sorted(entities), "lowest_m": lowest, "logs": logs}))
"#;

/// Markers of a trial as another program reads them, and in the scene: m.
const MARKERS: &str = r#"
import ezc3d, numpy as np
file = ezc3d.c3d(sys.argv[2])
names = file["parameters"]["POINT"]["LABELS"]["value"]
rate = file["parameters"]["POINT"]["RATE"]["value"][0]
unit = {"mm": 1e-3, "m": 1.0}[file["parameters"]["POINT"]["UNITS"]["value"][0]]
points = file["data"]["points"][:3] * unit
worst, compared, drawn, dots = 0.0, 0, {}, {}
for topic, at, told in scene(sys.argv[1]):
    frame = round(at * rate)
    if topic == "/scene/markers": dots[frame] = len(told.entities[0].spheres)
    if topic != "/scene/marker_names": continue
    # Names stand 3 cm above what they name.
    drawn[frame] = {t.text: [t.pose.position.x, t.pose.position.y, t.pose.position.z - 0.03]
        for t in told.entities[0].texts}
for frame, places in drawn.items():
    assert len(places) <= dots[frame]
    if not any(names.count(name) == 1 for name in places): continue
    rows = {name: points[:, names.index(name), frame] for name in places if names.count(name) == 1}
    seen, ours = np.array(list(rows.values())), np.array([places[name] for name in rows])
    # Where it is in the room is the scene's.
    apart = np.linalg.norm(ours[:, None] - ours[None], axis=2) - np.linalg.norm(seen[:, None] - seen[None], axis=2)
    worst = max(worst, float(np.abs(apart).max()))
    compared += len(rows)
texts = {name for places in drawn.values() for name in places}
print(json.dumps({"worst_m": worst, "compared": compared, "texts": len(texts), "names": len(names)}))
"#;

/// A person: how long its rods are over time, and what is told of its balance.
const PERSON: &str = r#"
import numpy as np
rods, heads, carries = [], [], 0
for topic, at, told in scene(sys.argv[1]):
    if topic == "/scene/person":
        [entity] = told.entities
        assert entity.frame_id == "world"
        rods.append([c.size.z for c in entity.cylinders])
        heads.append(max(s.pose.position.z for s in entity.spheres))
    if topic == "/scene/person_balance":
        carries += any(line.type == 1 for line in told.entities[0].lines)
rods = np.array(rods)
print(json.dumps({"spread_m": float((rods.max(axis=0) - rods.min(axis=0)).max()), "instants": len(rods),
    "tall_m": max(heads), "carries": carries}))
"#;

/// What rerun holds of a scene that the example put into it, as its own tool prints it: each transform, beside that of the scene.
const RERUN: &str = r#"
import os, re, subprocess, sys
example, file, made = sys.argv[1:]
subprocess.run([sys.executable, example, file, made], check=True, stdout=subprocess.DEVNULL)
tool = os.path.join(os.path.dirname(sys.executable), "rerun")
def printed(*more):
    asked = [tool, "rrd", "print", "-vvv", made, *more]
    return subprocess.run(asked, check=True, capture_output=True, text=True).stdout
row = re.compile(r"┆ \[([\w/]+)\]\s+┆ \[([\w/]+)\]\s+┆ \[\[([^\]]+)\]\]\s+┆ \[\[([^\]]+)\]\]")
numbers = lambda text: [float(number) for number in text.split(",")]
theirs, ours = {}, {}
for line in printed("--entity", "/transforms").splitlines():
    found = row.search(line)
    if found:
        child, parent, turn, place = found.groups()
        theirs.setdefault(child, []).append((parent, numbers(turn) + numbers(place)))
for topic, at, told in scene(file):
    if topic == "/transforms":
        for one in told.transforms:
            turn, place = one.rotation, one.translation
            if one.child_frame_id == "world":  # in nothing: rerun leaves it out
                continue
            ours.setdefault(one.child_frame_id, []).append((one.parent_frame_id,
                [turn.x, turn.y, turn.z, turn.w, place.x, place.y, place.z]))
apart = lambda one, other: max(abs(a - b) for a, b in zip(one[1], other[1]))
assert theirs.keys() == ours.keys(), theirs.keys() ^ ours.keys()
print(json.dumps({
    "counts": [[len(theirs[link]), len(ours[link])] for link in ours],
    "parents": all(a[0] == b[0] for link in ours for a, b in zip(theirs[link], ours[link])),
    "worst": max(apart(a, b) for link in ours for a, b in zip(theirs[link], ours[link])),
    "moved": {link: max(apart(one, theirs[link][0]) for one in theirs[link]) for link in theirs},
    "drawn": sorted(set(re.findall(r"/drawn/scene/[a-z]+", printed()))),
}))
"#;

/// Runs the program in a folder, with arguments that have no spaces in them.
fn run(folder: &Path, arguments: &str) -> Output {
    let mut command = gaitway();
    command.current_dir(folder).args(arguments.split(' '));
    command.output().expect("the program")
}

fn succeed(folder: &Path, arguments: &str) {
    let output = run(folder, arguments);
    assert!(output.status.success(), "{arguments}: {}", words(&output));
}

/// What Python says of files; `None` where there is none.
fn told(script: &str, files: &[&Path]) -> Option<Value> {
    let python = match python::python() {
        Ok(python) => python.program,
        Err(cause) => {
            aloud!("SKIPPED: no Python with Foxglove's schemas, nothing was decoded: {cause}");
            return None;
        }
    };
    let mut command = Command::new(python);
    command.arg("-c").arg([READ, script].concat()).args(files);
    let run = command.output().expect("Python");
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    Some(serde_json::from_slice(&run.stdout).expect("JSON"))
}

fn number(of: &Value) -> f64 {
    of.as_f64().unwrap_or_else(|| panic!("a number: {of}"))
}

#[test]
fn a_recorded_walk_moves_in_the_scene_as_mujoco_moves_the_model_that_is_in_it() {
    let folder = folder("walk");
    succeed(&folder, "play walk --robot op3 --bus sim --record walk.mcap");
    succeed(&folder, "convert walk.mcap scene.mcap --scene");
    let Some(found) = told(ROBOT, &[&folder.join("scene.mcap")]) else { return };
    assert!(number(&found["worst_m"]) < 1e-9, "{found}");
    assert_eq!(found["entities"].as_array().expect("a list").len(), 21, "20 joints and the base");
    let moved = found["moved"].as_object().expect("a map");
    let links: Vec<&String> = moved.keys().filter(|name| !name.starts_with("goal/")).collect();
    assert_eq!((links.len(), moved.len()), (22, 43), "the world, 21 links, 21 of the goal");
    let still: Vec<&&String> = links.iter().filter(|name| number(&moved[**name]) < 1e-3).collect();
    assert_eq!(still, [&"world"], "every link of a walk moves");
    // On its way to the walk and from it, and in the walk, it stands on the floor.
    let lowest = found["lowest_m"].as_array().expect("a list");
    let is_on_floor = |low_m: &&Value| number(low_m).abs() < 0.008;
    let on_floor = lowest.iter().filter(is_on_floor).count();
    assert!(on_floor * 10 > lowest.len() * 9, "{lowest:?}");
    // As long as the recording, at 60 instants a second.
    let long_s = number(&found["last_s"]) - number(&found["first_s"]);
    let frames = number(&found["frames"]);
    assert!((frames - 1.0 - long_s * 60.0).abs() < 0.5, "{frames} in {long_s} s");
}

#[test]
fn rerun_has_every_link_of_a_walk_where_the_scene_has_it() {
    let folder = folder("rerun");
    succeed(&folder, "play walk:3s --robot op3 --bus sim --record walk.mcap");
    succeed(&folder, "convert walk.mcap scene.mcap --scene");
    let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/in_rerun.py");
    let (scene, made) = (folder.join("scene.mcap"), folder.join("walk.rrd"));
    let Some(found) = told(RERUN, &[&example, &scene, &made]) else { return };
    let counts = found["counts"].as_array().expect("a list");
    assert!(counts.iter().all(|of| of[0] == of[1] && number(&of[0]) > 100.0), "{counts:?}");
    assert_eq!(found["parents"], true);
    // rerun keeps places as numbers of 32 bits.
    assert!(number(&found["worst"]) < 1e-6, "{}", found["worst"]);
    let moved = found["moved"].as_object().expect("a map");
    let own = moved.iter().filter(|(name, _)| !name.starts_with("goal/"));
    let moving = own.filter(|(_, far)| number(far) > 1e-3).count();
    assert!(moving >= 18, "links of a walk that move: {moving} of {moved:?}");
    let drawn = found["drawn"].to_string();
    for part in ["robot", "goal", "balance"] {
        assert!(drawn.contains(&format!("/drawn/scene/{part}")), "{part}: {drawn}");
    }
}

#[test]
fn links_are_red_while_they_are_in_one_another_and_the_log_says_so() {
    let folder = folder("touch");
    // From where the robot starts, the right arm down and its hand to the left, into the hip, and back.
    let parts = [0.0, 0.0, 0.5, 1.0, 1.0, 0.5, 0.0, 0.0];
    let rows = parts.iter().enumerate().map(|(n, part)| {
        let (roll_rad, elbow_rad) = (-0.785 - 0.7 * part, 0.785 + 0.715 * part);
        format!("{},{roll_rad},{elbow_rad}\n", n as f64 / 2.0)
    });
    let table = format!("time_s,r_sho_roll_rad,r_el_rad\n{}", rows.collect::<String>());
    std::fs::write(folder.join("in.csv"), table).expect("a table");
    succeed(&folder, "play in.csv --robot op3 --bus sim --hang --retime --record arm.mcap");
    succeed(&folder, "convert arm.mcap scene.mcap --scene");
    const RED: &str = r#"
told = [(topic, at, told) for topic, at, told in scene(sys.argv[1])]
red = lambda e: bool(e.cubes or e.spheres) and (list(e.cubes) + list(e.spheres))[0].color.r > 0.8
updates = [[(e.id, red(e)) for e in t.entities] for topic, _, t in told if topic == "/scene/robot"]
logs = [t.message for topic, _, t in told if topic == "/events" and t.level == 4 and t.name == "touches itself"]
print(json.dumps({"red": sum(any(r for _, r in u) for u in updates), "updates": len(updates), "logs": len(logs)}))
"#;
    let Some(found) = told(RED, &[&folder.join("scene.mcap")]) else { return };
    let times = number(&found["logs"]);
    // What is told first is not red; each touch turns links red, and back.
    assert!(times > 0.0 && number(&found["red"]) > 0.0, "{found}");
    assert!(number(&found["updates"]) <= 1.0 + 2.0 * times, "{found}");
    assert!(number(&found["updates"]) > number(&found["red"]), "{found}");
}

#[test]
fn markers_are_as_far_from_one_another_as_ezc3d_reads_them() {
    let Some(files) = captured::c3d_files() else { return };
    let folder = folder("markers");
    let mut compared = 0;
    for (n, file) in files.iter().step_by(files.len() / 3).take(3).enumerate() {
        let scene = folder.join(format!("{n}.mcap"));
        succeed(&folder, &format!("convert {} {n}.mcap --scene", file.display()));
        let Some(found) = told(MARKERS, &[&scene, file]) else { return };
        aloud!("{}: {found}", file.display());
        // Places are rounded to a tenth of a millimetre.
        assert!(number(&found["worst_m"]) < 4e-4 && number(&found["compared"]) > 1000.0, "{found}");
        assert!(number(&found["texts"]) > 3.0, "{found}");
        compared += 1;
    }
    assert_eq!(compared, 3);
}

#[test]
fn a_trial_that_is_cut_off_becomes_a_scene_of_what_is_there_and_says_so() {
    let Some(file) = captured::captured("mocap/c3d/pig") else { return };
    let folder = folder("cut");
    let bytes = std::fs::read(file.join("PiG_Motion-FlatFoot-Full.c3d")).expect("a trial");
    std::fs::write(folder.join("cut.c3d"), &bytes[..bytes.len() / 2]).expect("a file");
    let output = run(&folder, "convert cut.c3d scene.mcap --scene");
    assert_eq!(output.status.code(), Some(3), "{}", words(&output));
    assert!(words(&output).contains("cut off"), "{}", words(&output));
    let Some(found) =
        told(MARKERS, &[&folder.join("scene.mcap"), &file.join("PiG_Motion-FlatFoot-Full.c3d")])
    else {
        return;
    };
    assert!(number(&found["worst_m"]) < 4e-4 && number(&found["compared"]) > 1000.0, "{found}");
}

#[test]
fn a_person_has_limbs_of_one_length_and_stands_on_what_carries() {
    let folder = folder("person");
    succeed(&folder, "synth walk -o walk.bvh");
    succeed(&folder, "convert walk.bvh scene.mcap --scene");
    let Some(found) = told(PERSON, &[&folder.join("scene.mcap")]) else { return };
    // Places are rounded to a millimetre.
    assert!(number(&found["spread_m"]) < 3e-3, "{found}");
    assert!((1.5..1.8).contains(&number(&found["tall_m"])), "{found}");
    let (carries, instants) = (number(&found["carries"]), number(&found["instants"]));
    assert!(carries > 0.95 * instants && instants > 60.0, "a walk has no flight: {found}");
}

#[test]
fn what_holds_no_scene_is_refused_before_anything_is_written() {
    let folder = folder("refused");
    std::fs::write(folder.join("text.mcap"), "no recording").expect("a file");
    std::fs::write(folder.join("there.mcap"), "mine").expect("a file");
    succeed(&folder, "synth bow -o bow.bvh");
    for (command, said) in [
        ("convert bow.bvh bow.html --scene", "ends in .mcap"),
        ("convert bow.bvh there.mcap --scene", "exists"),
        ("convert text.mcap out.mcap --scene", "text.mcap"),
        ("convert there.mcap there.mcap --scene --force", "written over"),
        ("robot export op3 -o op3.xml", "ends in .urdf"),
        ("robot export nobody -o nobody.urdf", "nobody"),
    ] {
        let output = run(&folder, command);
        assert_eq!(output.status.code(), Some(1), "{command}: {}", words(&output));
        assert!(words(&output).contains(said), "{command}: {}", words(&output));
    }
    let kept = std::fs::read_to_string(folder.join("there.mcap")).expect("a file");
    assert_eq!(kept, "mine");
    let left = std::fs::read_dir(&folder).expect("a folder").count();
    assert_eq!(left, 3, "nothing else was written");
}
