//! A program of one's own has a virtual person before it, whose sensors it opens.

mod program;

use gaitway::body::Segment;
use gaitway::error::ErrorKind;
use gaitway::job::simulate::imus::{ImusOrder, SensorDoors, Wearer};
use gaitway::job::simulate::worn::Strapping;
use std::io::Read;
use std::path::Path;

fn order(folder: &Path) -> ImusOrder {
    ImusOrder {
        motion: "bow".to_owned(),
        segments: vec![Segment::Pelvis, Segment::Head, Segment::Pelvis],
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
