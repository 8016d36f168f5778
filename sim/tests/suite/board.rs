//! The board in an OP3's base, by the maker's firmware: opencr_op3/dxl_node_op3.h and .cpp in ROBOTIS-GIT/OpenCR,
//! scales in open_cr_module.h of ROBOTIS-GIT/ROBOTIS-OP3.

use crate::scene::{Scene, Status, instruction, read, write};
use gaitway_sim::{Body, Fault, Felt, Outside, Push, Turned};

const ID: u8 = 200;
const GYRO_X: u16 = 32;
/// 16384 counts are 1 g, 16.4 are 1 deg/s.
const COUNTS_PER_G: f64 = 16384.0;
const COUNTS_PER_DEG_S: f64 = 16.4;

fn op3() -> Scene {
    Scene::new(&gaitway_profiles::robot("op3").unwrap())
}

fn words(status: &Status) -> Vec<i16> {
    status.params.chunks_exact(2).map(|two| i16::from_le_bytes([two[0], two[1]])).collect()
}

/// What it measures, all six words.
fn felt(scene: &mut Scene) -> Vec<i16> {
    let statuses = scene.tell(&read(ID, GYRO_X, 12));
    assert_eq!((statuses.len(), statuses[0].id, statuses[0].error), (1, ID, 0));
    words(&statuses[0])
}

#[test]
fn it_answers_a_ping_with_the_makers_model_number_and_firmware() {
    let pinged = op3().tell(&instruction(ID, 0x01, &[]));
    assert_eq!(pinged, [Status { id: ID, error: 0, params: vec![0x00, 0x74, 0x02] }]);
}

#[test]
fn of_a_robot_that_stands_it_feels_one_g_upwards_and_no_turn() {
    assert_eq!(felt(&mut op3()), [0, 0, 0, 0, 0, 16384]);
}

#[test]
fn it_answers_in_its_turn_among_servos_that_are_asked_together() {
    // As the maker's manager asks: positions of servos, and the board's sensors.
    let mut params = Vec::new();
    for (id, address, length) in [(1_u8, 132_u16, 4_u16), (ID, GYRO_X, 12), (2, 132, 4)] {
        params.push(id);
        params.extend([address.to_le_bytes(), length.to_le_bytes()].concat());
    }
    let statuses = op3().tell(&instruction(0xFE, 0x92, &params));
    let ids: Vec<u8> = statuses.iter().map(|status| status.id).collect();
    assert_eq!(ids, [1, ID, 2]);
    assert_eq!(words(&statuses[1])[5], 16384);
}

#[test]
fn what_it_measures_cannot_be_written_and_what_it_shines_can() {
    let mut scene = op3();
    // processWrite: bytes that cannot be written are left out, and the status has said yes already.
    assert_eq!(scene.error(&write(ID, 42, &[0, 0])), 0);
    assert_eq!(felt(&mut scene)[5], 16384);
    assert_eq!(scene.error(&write(ID, 25, &[5])), 0);
    assert_eq!(scene.world.read_register("opencr-op3", "LED").unwrap(), 5);
    assert_eq!(scene.world.read_register("body/200", "led").unwrap(), 5);
}

#[test]
fn bytes_without_meaning_read_as_zero_what_begins_after_its_table_is_a_length_error_and_a_reboot_is_not_known()
 {
    let mut scene = op3();
    let statuses = scene.tell(&read(ID, 3, 16));
    // ID, baud rate 4 (2 Mbit/s), return delay 0, ten bytes of nothing, status return level 2.
    assert_eq!(statuses[0].params, [200, 4, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 2, 0, 0]);
    assert_eq!(scene.error(&read(ID, 51, 1)), 5);
    assert_eq!(scene.error(&write(ID, 51, &[1])), 5);
    assert_eq!(scene.ask(&instruction(ID, 0x08, &[])), [0_u8; 0]);
}

#[test]
fn it_measures_on_after_its_power_was_gone() {
    let mut scene = op3();
    scene.error(&write(ID, 25, &[5]));
    scene.world.begin(&[Fault::Brownout { from_ns: 0, until_ns: 1_000_000 }]).unwrap();
    scene.wait_ms(1_000);
    assert_eq!(felt(&mut scene)[5], 16384);
    assert_eq!(scene.world.read_register("opencr-op3", "LED").unwrap(), 0, "RAM");
}

#[test]
fn silent_or_unplugged_it_does_not_answer_and_nobody_takes_its_place() {
    let mut scene = op3();
    scene.world.unplug("opencr-op3").unwrap();
    assert_eq!(scene.ask(&read(ID, GYRO_X, 12)), [0_u8; 0]);
    scene.world.duplicate("r_el", 0.1);
    assert_eq!(scene.ask(&read(ID, GYRO_X, 12)), [0_u8; 0]);
    scene.world.plug("opencr-op3").unwrap();
    scene.wait_ms(500);
    assert_eq!(felt(&mut scene)[5], 16384);
}

/// A body that feels this once it was let go.
struct Feels(Felt);

impl Body for Feels {
    fn let_go(&mut self, _: &[f64], _: u64) {}

    fn step(&mut self, pushes: &[Push], _: &Outside, _: f64, _: u64) -> Vec<Turned> {
        vec![Turned::default(); pushes.len()]
    }

    fn felt(&self) -> Felt {
        self.0
    }

    fn fallen(&self) -> Option<String> {
        None
    }
}

#[test]
fn a_body_that_was_let_go_is_felt_along_the_sensors_own_axes_up_to_the_ends_of_its_words() {
    let mut scene = op3();
    // X and Y of the sensor are the other way: open_cr_module.cpp.
    let felt_by_body = Felt { spin_rad_s: [0.5, -1.0, 2.0], acceleration_g: [0.25, -0.5, 3.0] };
    scene.world.give_weight(Box::new(Feels(felt_by_body))).unwrap();
    assert_eq!(felt(&mut scene), [0, 0, 0, 0, 0, 16384], "somebody holds it");
    assert_eq!(scene.error(&write(1, 64, &[1])), 0);
    scene.wait_ms(500);
    let counts = |rad_s: f64| (rad_s.to_degrees() * COUNTS_PER_DEG_S).round() as i16;
    let of_g = |g: f64| (g * COUNTS_PER_G).round() as i16;
    let expected = [-counts(0.5), counts(1.0), counts(2.0), -of_g(0.25), of_g(0.5), i16::MAX];
    assert_eq!(felt(&mut scene), expected);
    scene.world.reset().unwrap();
    assert_eq!(felt(&mut scene), [0, 0, 0, 0, 0, 16384], "held again");
}
