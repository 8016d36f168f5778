//! A program of one's own has a virtual person before it, whose sensors it opens.

mod program;

use gaitway::body::Segment;
use gaitway::error::ErrorKind;
use gaitway::job::simulate::imus::{ImusOrder, SensorDoors, Wearer, put_on};
use gaitway::job::simulate::person::Person;
use gaitway::job::simulate::worn::{KnownStrap, Strapping, Worn};
use gaitway::job::source::body_motion;
use gaitway::sensing::Wear;
use glam::{DQuat, DVec3};
use std::io::Read;
use std::path::Path;

fn order(folder: &Path) -> ImusOrder {
    ImusOrder {
        motion: "bow".to_owned(),
        segments: vec![Segment::Pelvis, Segment::Head, Segment::Pelvis],
        known: Vec::new(),
        profile: "xsens-mti".to_owned(),
        doors: SensorDoors::Terminals(folder.to_owned()),
        wear_file: None,
        stand_s: 2.0,
        strapping: Strapping {
            noise: 0.0,
            drift_rad_s: 0.0,
            twist_rad: 0.0,
            batch_s: 0.0,
            loss: 0.0,
        },
        seed: 1,
    }
}

#[test]
fn a_program_straps_sensors_on_opens_one_and_the_performance_begins() {
    let folder = program::folder("simulate-imus").join("body");
    let wearer = Wearer::open(&order(&folder)).expect("two sensors");
    let worn: Vec<_> = wearer.sensors().iter().map(|sensor| sensor.segment).collect();
    assert_eq!(worn, [Segment::Pelvis, Segment::Head], "each segment wears one");
    assert_eq!(wearer.doing(), None, "nobody listens yet");

    let wear = wearer.wear_file().expect("a file of what is worn").to_owned();
    let table: toml::Table =
        std::fs::read_to_string(&wear).expect("a file").parse().expect("a table");
    for sensor in wearer.sensors() {
        let name = gaitway::body::segment_name(sensor.segment);
        let source = format!("imu:xsens-mti@serial:{}", sensor.place);
        assert_eq!(table["segments"][name].as_str(), Some(source.as_str()));
    }

    let mut terminal = std::fs::File::open(&wearer.sensors()[1].place).expect("a terminal");
    let mut bytes = [0; 64];
    terminal.read_exact(&mut bytes).expect("samples");
    // Xsens MT low-level protocol, MTData2: preamble FA, bus FF, message 36.
    assert!(bytes.windows(3).any(|w| w == [0xFA, 0xFF, 0x36]), "{bytes:02x?}");
    assert_eq!(wearer.doing(), Some("N pose"));
    let place = wearer.sensors()[1].place.clone();
    drop(wearer);
    assert!(!Path::new(&place).exists(), "the link goes with the sensor");
    Wearer::open(&order(&folder)).expect("its own file of what is worn may be written anew");
}

#[test]
fn what_somebody_else_wrote_of_what_is_worn_is_kept_and_nothing_is_opened() {
    let folder = program::folder("simulate-imus-kept");
    let wear = folder.join("wear.toml");
    std::fs::write(&wear, "[segments]\npelvis = \"mine\"\n").expect("a file");
    let refused = Wearer::open(&order(&folder)).err().expect("a refusal");
    assert_eq!(refused.kind, ErrorKind::Exists, "{refused}");
    assert_eq!(std::fs::read_to_string(&wear).expect("it"), "[segments]\npelvis = \"mine\"\n");
    assert_eq!(std::fs::read_dir(&folder).expect("a folder").count(), 1, "no terminal was linked");
}

#[test]
fn a_profile_that_does_not_go_with_the_way_it_is_sent_is_refused_before_a_folder_is_made() {
    let folder = program::folder("simulate-imus-misfit").join("body");
    let trackers = ImusOrder { profile: "slimevr".to_owned(), ..order(&folder) };
    let refused = Wearer::open(&trackers).err().expect("a refusal").to_string();
    assert!(refused.contains("--udp 127.0.0.1:6969"), "{refused}");
    assert!(!folder.exists());
    let doors = SensorDoors::SlimeVr("127.0.0.1:6969".to_owned());
    let refused = Wearer::open(&ImusOrder { doors, ..order(&folder) }).err().expect("a refusal");
    assert!(refused.to_string().contains("--pty DIR"), "{refused}");
}

/// A file says who wears what and which way: as the virtual person wears it, and as it is written down for whoever listens.
#[test]
fn sensors_are_worn_as_a_file_says_and_that_is_told_to_whoever_listens() {
    let folder = program::folder("simulate-imus-wear");
    let file = folder.join("lab.toml");
    let text = "[segments]\nleft_shank = { sensor = \"imu:bno08x-rvc@/dev/ttyUSB7\", forward = \"-y\" }\n\
                torso = { sensor = \"tracker-00aa01-0\", forward = \"none\" }\nhead = \"any\"\n";
    std::fs::write(&file, text).expect("a file");
    let (segments, known) =
        put_on(&[file.display().to_string(), "pelvis".to_owned()]).expect("worn");
    let order = ImusOrder { segments, known, ..order(&folder.join("body")) };
    let wearer = Wearer::open(&order).expect("four sensors");
    assert_eq!(wearer.sensors().len(), 4);
    let worn = wearer.wear_file().expect("a file").display().to_string();
    let heard = Wear::of(Vec::new(), &[worn]).expect("as live reads it");
    let forward = |segment: Segment| {
        heard.places.iter().find(|place| place.segment == segment).expect("worn").forward
    };
    assert_eq!(forward(Segment::LeftShank), Some(DVec3::NEG_Y));
    assert_eq!(forward(Segment::Torso), None);
    assert_eq!(
        (forward(Segment::Head), forward(Segment::Pelvis)),
        (Some(DVec3::X), Some(DVec3::X))
    );
    let profiles: Vec<&str> = heard.sources.iter().map(|source| source.text.as_str()).collect();
    assert_eq!(profiles.iter().filter(|text| text.contains("imu:bno08x-rvc@")).count(), 1);
    assert_eq!(profiles.iter().filter(|text| text.contains("imu:xsens-mti@")).count(), 3);

    for (text, said) in [
        ("[segments]\nnose = \"a\"\n", "no such segment"),
        ("[segments]\nhead = { sensor = \"a\", forward = \"up\" }\n", "no direction of a sensor"),
        ("segments = 3\n", "does not say what is worn"),
    ] {
        std::fs::write(&file, text).expect("a file");
        let refused = put_on(&[file.display().to_string()]).expect_err(said).to_string();
        assert!(refused.contains(said), "{refused}");
    }
    let none = put_on(&["/no/such.toml".to_owned()]).expect_err("no file").to_string();
    assert!(none.contains("/no/such.toml"), "{none}");
}

/// What points forward does: the sensor that stands in N pose with its -Y ahead is turned so.
#[test]
fn a_virtual_sensor_points_ahead_with_what_the_file_says() {
    let sensor = gaitway_profiles::sensor("xsens-mti").expect("shipped");
    let strapping =
        Strapping { noise: 0.0, drift_rad_s: 0.0, twist_rad: 0.0, batch_s: 0.0, loss: 0.0 };
    let (capture, _) = body_motion("bow", None, &Default::default()).expect("shipped");
    let person = Person::new(&capture, 2.0).expect("performed");
    let ahead_of = |forward: DVec3| {
        let known = KnownStrap {
            segment: Segment::LeftThigh,
            profile: None,
            forward: Some(forward),
            tracker: None,
        };
        let mut worn = Worn::new(&sensor, &[known], strapping, 5).expect("worn");
        let mut imu = worn.on(&person, Segment::LeftThigh).expect("a sensor");
        let [w, x, y, z] = imu.next().expect("a sample").truth.orientation;
        DQuat::from_xyzw(x, y, z, w) * forward
    };
    // The seed decides which way the world faces and how far the strap leans: the same of both.
    let (one, other) = (ahead_of(DVec3::X), ahead_of(DVec3::new(0.0, -0.6, 0.8)));
    assert!((one - other).length() < 1e-9, "{one} {other}");
}
