//! What goes from text to text: labels of what is done when, as a table and frame by frame, and tables of joint angles, which
//! go where captures go.

use crate::program::{folder, gaitway, json, words};
use std::fs;
use std::path::Path;
use std::process::Output;

fn run(folder: &Path, arguments: &str) -> Output {
    let mut command = gaitway();
    command.current_dir(folder).args(arguments.split_whitespace());
    command.output().expect("the command")
}

fn done(output: &Output) {
    assert_eq!(output.status.code(), Some(0), "{}", words(output));
}

fn refused(output: &Output, said: &str) {
    assert_eq!(output.status.code(), Some(1), "{}", words(output));
    assert!(words(output).contains(said), "{said}: {}", words(output));
}

#[test]
fn what_is_recognised_is_written_frame_by_frame_and_judged_as_right() {
    let folder = folder("labels-of-frames");
    fs::create_dir_all(folder.join("clips")).expect("a folder");
    for action in ["bow", "kick-r"] {
        done(&run(&folder, &format!("synth {action} -o clips/{action}.bvh")));
    }
    done(&run(&folder, "recognise clips/bow.bvh clips/kick-r.bvh --labels frames/"));
    let of = |file: &str| fs::read_to_string(folder.join("frames").join(file)).expect("labels");
    let bow = of("bow/bow.txt");
    let poses = fs::read_to_string(folder.join("clips/bow.bvh")).expect("a clip");
    let poses = poses.lines().skip_while(|line| !line.starts_with("Frame Time")).count() - 1;
    assert_eq!(bow.lines().count(), poses);
    assert!(bow.starts_with("0.0\n") && bow.contains("\n1.0\n"));
    assert!(!of("bow/kick.txt").contains('1') && of("kick-r/kick.txt").contains('1'));
    let score = |labels: &str| {
        let output = run(&folder, &format!("score classification clips --labels {labels} --json"));
        done(&output);
        json(&output)["global"].clone()
    };
    let global = score("frames");
    assert_eq!(
        (&global["correct"], &global["recognised"], &global["truth"]),
        (&2.into(), &2.into(), &2.into())
    );
    // As a table and back nothing changes, and the table is judged alike.
    done(&run(&folder, "convert frames clips/labels.csv --clips clips"));
    done(&run(&folder, "convert clips/labels.csv again"));
    for trial in ["bow", "kick-r"] {
        let names = |of: &str| {
            let all = fs::read_dir(folder.join(of).join(trial)).expect("a trial");
            let mut names: Vec<_> = all.map(|entry| entry.expect("an entry").file_name()).collect();
            names.sort();
            names
        };
        assert_eq!(names("frames"), names("again"));
        for name in names("frames") {
            let of = |of: &str| fs::read(folder.join(of).join(trial).join(&name)).expect("labels");
            assert_eq!(of("frames"), of("again"), "{trial} {name:?}");
        }
    }
    assert_eq!(score("clips/labels.csv"), global);
    // What is unclear stays so.
    let unclear = bow.replacen("1.0", "0.5", 3);
    fs::write(folder.join("frames/bow/bow.txt"), &unclear).expect("labels");
    done(&run(&folder, "convert frames unclear.csv --rate 120"));
    let table = fs::read_to_string(folder.join("unclear.csv")).expect("a table");
    assert!(
        table.lines().any(|line| line.starts_with("bow,bow,") && line.ends_with(",0.5")),
        "{table}"
    );
    let told = run(&folder, "info frames --json");
    done(&told);
    let told = json(&told);
    assert_eq!(
        (&told["format"], &told["kind"], &told["clips"]),
        (&"labels".into(), &"frames".into(), &2.into())
    );
    assert_eq!(told["actions"]["bow"]["unclear"], 1, "{told}");
    assert_eq!(told["actions"]["bow"]["absent_in"], 1, "{told}");
    done(&run(&folder, "info clips/labels.csv"));
    // Nothing is written over, and labels of another vocabulary do not mix with these.
    refused(&run(&folder, "recognise clips/bow.bvh --labels frames/"), "exists already");
    fs::write(folder.join("frames/bow/stretch.txt"), &unclear).expect("labels");
    refused(&run(&folder, "recognise clips/bow.bvh --labels frames/ --force"), "other labels");
    refused(&run(&folder, "convert frames other.csv --rate 0"), "no clip has such a rate");
    refused(&run(&folder, "convert frames other.csv"), "how many frames a second");
    fs::write(folder.join("frames/bow/bow.txt"), "1.0\n").expect("labels");
    refused(&run(&folder, "info frames"), "other numbers of frames");
    refused(&run(&folder, "convert clips/labels.csv out.txt"), "cannot be written");
    refused(&run(&folder, "convert clips/bow.bvh out.csv --clips clips"), "--clips");
}

#[test]
fn a_table_that_recognise_wrote_is_read_with_its_sides() {
    let folder = folder("labels-with-sides");
    for action in ["wave-l", "kick-r"] {
        done(&run(&folder, &format!("synth {action} -o {action}.bvh")));
    }
    done(&run(&folder, "recognise wave-l.bvh kick-r.bvh --labels found.csv"));
    let output = run(&folder, "score classification . --labels found.csv --json");
    done(&output);
    let sides = json(&output)["sides"].clone();
    assert_eq!(json(&output)["global"]["correct"], 2, "{}", words(&output));
    assert!(sides.is_object());
}

#[test]
fn a_table_of_joint_angles_goes_where_a_capture_goes_and_comes_back_as_it_was() {
    let folder = folder("angle-tables");
    done(&run(&folder, "synth walk:2s -o walk.csv"));
    done(&run(&folder, "convert walk.csv again.csv"));
    let numbers = |file: &str| -> Vec<f64> {
        let text = fs::read_to_string(folder.join(file)).expect("a table");
        let cells = text.lines().skip(1).flat_map(|row| row.split(','));
        cells.map(|cell| cell.parse().expect("a number")).collect()
    };
    let (before, after) = (numbers("walk.csv"), numbers("again.csv"));
    assert_eq!(before.len(), after.len());
    let most = before.iter().zip(&after).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(most < 1e-8, "{most}");
    let told = run(&folder, "info walk.csv --json");
    done(&told);
    let told = json(&told);
    assert_eq!((&told["format"], &told["rate_hz"]), (&"angles".into(), &120.0.into()), "{told}");
    assert_eq!(told["body"].as_array().map(Vec::len), Some(22));
    let recognised = run(&folder, "recognise walk.csv --json");
    done(&recognised);
    assert!(
        json(&recognised)["events"]
            .as_array()
            .expect("events")
            .iter()
            .all(|of| of["action"] == "walk")
    );
    done(&run(&folder, "retarget walk.csv --robot op3 -o robot.csv"));
    done(&run(&folder, "play walk.csv --robot op3 --bus sim --to 1"));
    done(&run(&folder, "convert walk.csv walk.bvh"));
    done(&run(&folder, "actionlets walk.csv -o walk.toml --tolerance 5"));
    // A table in the robot's own joints stays one.
    done(&run(&folder, "play robot.csv --robot op3 --bus sim --to 1"));
    refused(&run(&folder, "convert walk.csv no.bvh --mapping x.toml"), "needs no mapping");
    fs::write(folder.join("odd.csv"), "time_s,left_knee_flexion_deg\n0,1\n0.1,nan\n")
        .expect("a table");
    refused(&run(&folder, "info odd.csv"), "line 3");
    fs::write(folder.join("strange.csv"), "a,b\n1,2\n").expect("a table");
    let strange = run(&folder, "info strange.csv");
    done(&strange);
    assert!(words(&strange).contains("column    a: 1 to 1"), "{}", words(&strange));
    fs::write(folder.join("bones.asf"), ":version 1.10\n").expect("a skeleton");
    refused(&run(&folder, "info bones.asf"), "without motion");
}
