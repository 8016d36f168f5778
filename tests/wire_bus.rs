//! Questions in all four protocols on one line: against scripted answers made of the manuals'
//! packets, and on virtual robots. Packets cite their sources in `wire_vectors.rs`.

#[path = "wire_bus/mod.rs"]
mod line;

use gaitway::bus::Protocol::{Dynamixel1, Dynamixel2, FeetechScs, FeetechSts};
use gaitway::bus::{AskError, FactoryReset, GroupItem, GroupQuestion, GroupRead, Miss, Protocol};
use gaitway::time::Duration;
use gaitway_sim::{Damage, Fault, Options};
use line::{ScriptedLine, at_s, hex, in_s, op3, sts_robot, virtual_bus};

/// Soon after the question: the return delay of the factory.
const SOON: Duration = Duration::from_micros(500);

fn unsayable<T: std::fmt::Debug>(asked: Result<T, AskError>) -> String {
    match asked {
        Err(AskError::Unsayable(text)) => text,
        other => panic!("{other:?}"),
    }
}

#[test]
fn one_line_carries_questions_in_all_four_protocols() {
    let line = ScriptedLine::default();
    line.on(
        "FF FF FD 00 01 07 00 02 84 00 04 00 1D 15",
        &[(SOON, "FF FF FD 00 01 08 00 55 00 A6 00 00 00 8C C0")],
    )
    .on("FF FF 01 04 02 24 02 D2", &[(SOON, "FF FF 01 04 00 00 02 F8")])
    .on("FF FF 01 04 02 38 02 BE", &[(SOON, "FF FF 01 04 00 18 05 DD")])
    .on("FF FF 01 04 02 38 02 BE", &[(SOON, "FF FF 01 04 00 01 FF FA")]);
    let mut bus = line.bus();
    let mut read = |protocol, address, length| {
        bus.read(protocol, 1, address, length, at_s(1.0)).expect("an answer").bytes
    };
    assert_eq!(read(Dynamixel2, 132, 4), 166_u32.to_le_bytes());
    assert_eq!(read(Dynamixel1, 36, 2), 512_u16.to_le_bytes());
    assert_eq!(read(FeetechSts, 56, 2), 1304_u16.to_le_bytes());
    assert_eq!(read(FeetechScs, 56, 2), 511_u16.to_be_bytes());
    assert_eq!(line.asked().len(), 4, "each asked once");
}

#[test]
fn a_protocol_1_device_refuses_by_name_and_alerts_without_refusing() {
    let line = ScriptedLine::default();
    let torque = "FF FF 01 05 03 0C 64 AA DC";
    // Range error (bit 3), then overload and overheating (the manual's example).
    line.on(torque, &[(SOON, "FF FF 01 02 08 F4")]).on(torque, &[(SOON, "FF FF 01 02 24 D8")]);
    let mut bus = line.bus();
    let refused = bus.write(Dynamixel1, 1, 12, &hex("64 AA"), at_s(1.0));
    assert_eq!(refused, Err(AskError::Miss(Miss::Refused("range error".to_owned()))));
    let alert = bus.write(Dynamixel1, 1, 12, &hex("64 AA"), at_s(1.0)).expect("carried out");
    assert!(alert.alert && alert.bytes.is_empty());
}

#[test]
fn a_device_that_heard_the_question_damaged_is_asked_again() {
    let line = ScriptedLine::default();
    let torque = "FF FF 01 05 03 0C 64 AA DC";
    line.on(torque, &[(SOON, "FF FF 01 02 10 EC")]).on(torque, &[(SOON, "FF FF 01 02 00 FC")]);
    let mut bus = line.bus();
    bus.write(Dynamixel1, 1, 12, &hex("64 AA"), at_s(1.0)).expect("heard the second time");
    assert_eq!((bus.stats().asked, bus.stats().retried), (2, 1));
}

#[test]
fn protocol_1_devices_are_read_in_bulk_each_its_own_bytes() {
    let line = ScriptedLine::default();
    line.on(
        "FF FF FE 09 92 00 02 01 1E 02 02 24 1D",
        &[(SOON, "FF FF 01 04 00 00 80 7A"), (2 * SOON, "FF FF 02 04 00 00 80 79")],
    );
    let mut bus = line.bus();
    let item = |id, address| GroupItem { id, address, length: 2 };
    let items = vec![item(1, 30), item(2, 36)];
    let question = GroupQuestion { protocol: Dynamixel1, kind: GroupRead::Bulk, items };
    bus.begin_group_read(&question, at_s(1.0)).expect("sayable");
    let answers = bus.finish_group_read(at_s(1.0)).expect("a line");
    let bytes: Vec<_> = answers.into_iter().map(|answer| answer.expect("whole").bytes).collect();
    assert_eq!(bytes, [[0x00, 0x80], [0x00, 0x80]]);
}

#[test]
fn what_a_protocol_cannot_say_is_refused_before_anything_is_sent() {
    let line = ScriptedLine::default();
    let mut bus = line.bus();
    let soon = at_s(1.0);
    for protocol in [Dynamixel1, FeetechSts, FeetechScs] {
        let address = unsayable(bus.read(protocol, 1, 580, 4, soon));
        assert!(address.contains("580") && address.contains(&protocol.to_string()), "{address}");
        let length = unsayable(bus.read(protocol, 1, 0, 300, soon));
        assert!(length.contains("300") && length.contains("one byte"), "{length}");
        unsayable(bus.write(protocol, 1, 256, &[0], soon));
        unsayable(bus.sync_write(protocol, 256, &[(1, &[0])], soon));
        unsayable(bus.bulk_write(protocol, &[(1, 30, &[0])], soon));
        unsayable(bus.reboot(protocol, 1, soon));
        unsayable(bus.clear_turns(protocol, 1, soon));
        unsayable(bus.backup_store(protocol, 1, soon));
        unsayable(bus.backup_restore(protocol, 1, soon));
        unsayable(bus.factory_reset(protocol, 1, FactoryReset::KeepId, soon));
        unsayable(bus.ping(protocol, 254, soon));
    }
    unsayable(bus.ping(Dynamixel2, 253, soon));
    for protocol in [Dynamixel1, FeetechScs] {
        unsayable(bus.ping_all(protocol, soon));
    }
    let knows = |protocol, kind| {
        protocol == Dynamixel2
            || (protocol, kind) == (Dynamixel1, GroupRead::Bulk)
            || (protocol, kind) == (FeetechSts, GroupRead::Sync)
    };
    for protocol in [Dynamixel1, Dynamixel2, FeetechSts, FeetechScs] {
        for kind in [GroupRead::Sync, GroupRead::Fast, GroupRead::Bulk, GroupRead::FastBulk] {
            let items = vec![GroupItem { id: 1, address: 36, length: 2 }];
            let question = GroupQuestion { protocol, kind, items };
            let asked = ScriptedLine::default().bus().begin_group_read(&question, soon);
            assert_eq!(asked.is_ok(), knows(protocol, kind), "{protocol} {kind:?}");
        }
    }
    let items = [30, 36].map(|address| GroupItem { id: address as u8, address, length: 2 });
    let items = items.to_vec();
    let mixed = GroupQuestion { protocol: FeetechSts, kind: GroupRead::Sync, items };
    unsayable(bus.begin_group_read(&mixed, soon));
    assert_eq!(bus.finish_group_read(soon), Ok(vec![]), "nothing is under way");
    assert!(line.asked().is_empty());
}

#[test]
fn on_an_echoing_adapter_our_own_bytes_are_no_answer() {
    let [position, ping] = ["FF FF 01 04 02 38 02 BE", "FF FF 01 02 01 FB"];
    let line = ScriptedLine::default();
    line.echoing().on(position, &[(SOON, "FF FF 01 04 00 18 05 DD")]);
    let mut bus = line.bus();
    bus.set_echo(true);
    // Left to right: a write to all whose echo is still coming, a read, and nobody there.
    bus.sync_write(FeetechSts, 42, &[(1, &[0, 8])], at_s(1.0)).expect("a line");
    let reply = bus.read(FeetechSts, 1, 56, 2, at_s(1.0)).expect("the device's answer");
    assert_eq!((reply.alert, reply.bytes), (false, hex("18 05")));
    bus.set_retries(0);
    assert_eq!(bus.read(FeetechSts, 1, 56, 2, at_s(1.0)), Err(AskError::Miss(Miss::Silent)));
    assert_eq!(bus.ping(FeetechSts, 1, at_s(1.0)), Err(AskError::Miss(Miss::Silent)));
    // A voltage error makes the answer to a ping equal to the ping.
    line.on(ping, &[(SOON, ping)]);
    assert!(bus.ping(FeetechSts, 1, at_s(1.0)).expect("an answer").alert);
}

#[test]
fn what_changes_a_device_is_said_once() {
    let line = ScriptedLine::default();
    let mut bus = line.bus();
    let silent = Err(AskError::Miss(Miss::Silent));
    assert_eq!(bus.reboot(Dynamixel2, 1, at_s(1.0)), silent);
    assert_eq!(bus.factory_reset(Dynamixel2, 1, FactoryReset::KeepId, at_s(1.0)), silent);
    assert_eq!(bus.factory_reset(Dynamixel1, 0, FactoryReset::Everything, at_s(1.0)), silent);
    bus.action(Dynamixel2, at_s(1.0)).expect("a line");
    bus.action(FeetechSts, at_s(1.0)).expect("a line");
    let said = [
        "FF FF FD 00 01 03 00 08 2F 4E",
        "FF FF FD 00 01 04 00 06 01 A1 E6",
        "FF FF 00 02 06 F7",
        // By hand, from the CRC's definition: an action of all.
        "FF FF FD 00 FE 03 00 05 2A C2",
        "FF FF FE 02 05 FA",
    ];
    assert_eq!(line.asked(), said.map(hex));
}

#[test]
fn a_clear_and_a_back_up_are_waited_for_as_long_as_the_caller_likes() {
    let line = ScriptedLine::default();
    let (late, yes) = (Duration::from_secs(2), "FF FF FD 00 01 04 00 55 00 A1 0C");
    line.on("FF FF FD 00 01 08 00 10 01 44 58 4C 22 B1 DC", &[(late, yes)])
        .on("FF FF FD 00 01 08 00 20 01 43 54 52 4C 16 F5", &[(late, yes)])
        .on("FF FF FD 00 01 08 00 20 02 43 54 52 4C 9E F5", &[(late, yes)]);
    let mut bus = line.bus();
    assert!(bus.clear_turns(Dynamixel2, 1, at_s(10.0)).is_ok());
    assert!(bus.backup_store(Dynamixel2, 1, at_s(10.0)).is_ok());
    assert!(bus.backup_restore(Dynamixel2, 1, at_s(10.0)).is_ok());
}

#[test]
fn a_registered_write_waits_for_the_action() {
    for (robot, protocol, address) in [(op3(), Dynamixel2, 65), (sts_robot(), FeetechSts, 41)] {
        let id = robot.joints[3].id;
        let (world, mut bus) = virtual_bus(&robot, Options::default());
        let soon = in_s(&world, 1.0);
        bus.write(protocol, id, address, &[0], soon).expect("written");
        bus.register(protocol, id, address, &[1], soon).expect("registered");
        assert_eq!(bus.read(protocol, id, address, 1, soon).expect("read").bytes, [0]);
        bus.action(protocol, soon).expect("a line");
        assert_eq!(bus.read(protocol, id, address, 1, soon).expect("read").bytes, [1]);
    }
}

#[test]
fn a_device_that_answers_reads_only_is_told_by_what_nobody_answers() {
    let robot = op3();
    let joint = &robot.joints[0];
    let (world, mut bus) = virtual_bus(&robot, Options::default());
    assert!(world.lock().set_register(&joint.name, "Status Return Level", 1));
    let soon = in_s(&world, 1.0);
    bus.set_retries(0);
    let written = bus.write(Dynamixel2, joint.id, 65, &[1], soon);
    assert_eq!(written, Err(AskError::Miss(Miss::Silent)));
    assert_eq!(bus.read(Dynamixel2, joint.id, 65, 1, soon).expect("read").bytes, [1]);
    bus.sync_write(Dynamixel2, 65, &[(joint.id, &[0])], soon).expect("a line");
    assert_eq!(bus.read(Dynamixel2, joint.id, 65, 1, soon).expect("read").bytes, [0]);
}

fn bulk_question(ids: &[u8], kind: GroupRead) -> GroupQuestion {
    // Position, voltage, temperature and model in turn: other places, other lengths.
    let blocks = [(132, 4), (144, 2), (146, 1), (0, 2)];
    let asked = ids.iter().zip(blocks.iter().cycle());
    let items = asked.map(|(&id, &(address, length))| GroupItem { id, address, length }).collect();
    GroupQuestion { protocol: Dynamixel2, kind, items }
}

#[test]
fn a_bulk_read_gives_what_single_reads_give() {
    let robot = op3();
    let ids: Vec<u8> = robot.joints.iter().map(|joint| joint.id).collect();
    let (world, mut bus) = virtual_bus(&robot, Options::default());
    let soon = in_s(&world, 1.0);
    let question = bulk_question(&ids, GroupRead::Bulk);
    let before_s = world.lock().now_ns() as f64 / 1e9;
    bus.begin_group_read(&question, soon).expect("sayable");
    let answers = bus.finish_group_read(soon).expect("a line");
    let took_s = world.lock().now_ns() as f64 / 1e9 - before_s;
    assert!(took_s <= bus.read_time_s(&question), "{took_s} s");
    assert_eq!(answers.len(), ids.len());
    for (item, answer) in question.items.iter().zip(answers) {
        let single = bus.read(Dynamixel2, item.id, item.address, item.length, soon);
        assert_eq!(answer.expect("whole").bytes, single.expect("whole").bytes, "ID {}", item.id);
    }
}

#[test]
fn a_lost_answer_of_a_bulk_read_is_asked_for_once_more() {
    let robot = op3();
    let ids: Vec<u8> = robot.joints.iter().map(|joint| joint.id).collect();
    let damage = Damage::FlipBit { bit: Some(75) };
    let faults = vec![Fault::Status { joint: robot.joints[5].name.clone(), nth: 0, damage }];
    let options = Options { faults, ..Options::default() };
    let (world, mut bus) = virtual_bus(&robot, options);
    let soon = in_s(&world, 1.0);
    bus.begin_group_read(&bulk_question(&ids, GroupRead::Bulk), soon).expect("sayable");
    let answers = bus.finish_group_read(soon).expect("a line");
    assert!(answers.iter().all(Result::is_ok), "{answers:?}");
    assert_eq!(bus.stats().retried, 1);
}

#[test]
fn who_answers_for_the_one_device_that_is_missing_is_named() {
    // The third servo of the line says that it is number 77, always.
    let wrong = |joint: &str| -> Vec<Fault> {
        let damage = Damage::WrongId { id: 77 };
        let status = |nth| Fault::Status { joint: joint.to_owned(), nth, damage };
        (0..40).map(status).collect()
    };
    // Present Position of each.
    for (robot, protocol, kind, address, length) in [
        (sts_robot(), FeetechSts, GroupRead::Sync, 56, 2),
        (op3(), Dynamixel2, GroupRead::Sync, 132, 4),
        (op3(), Dynamixel2, GroupRead::Bulk, 132, 4),
    ] {
        let item = |id| GroupItem { id, address, length };
        // Dynamixels behind one that they did not hear stay silent until they are asked again.
        let once = (protocol == FeetechSts).then_some(false);
        for retries in [true].into_iter().chain(once) {
            let joint = &robot.joints[2];
            let options = Options { faults: wrong(&joint.name), ..Options::default() };
            let (world, mut bus) = virtual_bus(&robot, options);
            let items: Vec<GroupItem> = robot.joints.iter().map(|j| item(j.id)).collect();
            let question = GroupQuestion { protocol, kind, items };
            let only = Duration::from_secs_f64(bus.read_time_s(&question)) + 2 * SOON;
            bus.begin_group_read(&question, in_s(&world, 0.1)).expect("sayable");
            let budget = if retries { in_s(&world, 0.1) } else { in_s(&world, only.as_secs_f64()) };
            let answers = bus.finish_group_read(budget).expect("a line");
            let named = Err(Miss::WrongId { asked: joint.id, got: 77 });
            for (of, answer) in robot.joints.iter().zip(answers) {
                match of.id == joint.id {
                    true => assert_eq!(answer, named, "{protocol} {kind:?}, retries: {retries}"),
                    false => {
                        assert!(answer.is_ok(), "{protocol} {kind:?}, {}: {answer:?}", of.name)
                    }
                }
            }
        }
    }
}

#[test]
fn nobody_is_named_for_a_missing_device_where_it_could_be_another() {
    let question = |ids: &[u8]| GroupQuestion {
        protocol: FeetechSts,
        kind: GroupRead::Sync,
        items: ids.iter().map(|&id| GroupItem { id, address: 56, length: 2 }).collect(),
    };
    let ask = |answers: &[(Duration, &str)]| {
        let line = ScriptedLine::default();
        line.on("FF FF FE 07 82 38 02 01 02 03 38", answers);
        let mut bus = line.bus();
        bus.begin_group_read(&question(&[1, 2, 3]), at_s(1.0)).expect("sayable");
        // No time to ask again.
        let answers = bus.finish_group_read(at_s(0.002)).expect("a line");
        answers.into_iter().map(|answer| answer.map(|reply| reply.bytes)).collect::<Vec<_>>()
    };
    // Statuses as those above: ID, two bytes of a position, sum.
    let one = (SOON, "FF FF 01 04 00 18 05 DD");
    let nine = (2 * SOON, "FF FF 09 04 00 18 05 D5");
    let ten = (3 * SOON, "FF FF 0A 04 00 18 05 D4");
    let three = (3 * SOON, "FF FF 03 04 00 18 05 DB");
    let position = Ok(vec![0x18, 0x05]);
    let silent = Err(Miss::Silent);
    let named = Err(Miss::WrongId { asked: 2, got: 9 });
    assert_eq!(ask(&[one, nine, three]), [position.clone(), named, position.clone()]);
    // Two are missing, one stranger: it answered for either.
    assert_eq!(ask(&[one, nine]), [position.clone(), silent.clone(), silent.clone()]);
    // One is missing, two strangers.
    let two = [(Duration::from_micros(400), "FF FF 01 04 00 18 05 DD"), nine, ten, three];
    assert_eq!(ask(&two), [position.clone(), silent.clone(), position.clone()]);
    // One is missing, and nobody else speaks.
    assert_eq!(ask(&[one, three]), [position.clone(), silent, position]);
}

#[test]
fn many_registers_are_written_in_bulk() {
    let robot = op3();
    let [first, second] = [robot.joints[0].id, robot.joints[1].id];
    let (world, mut bus) = virtual_bus(&robot, Options::default());
    let soon = in_s(&world, 1.0);
    let gain = 700_u16.to_le_bytes();
    bus.bulk_write(Dynamixel2, &[(first, 65, &[1]), (second, 84, &gain)], soon).expect("a line");
    assert_eq!(bus.read(Dynamixel2, first, 65, 1, soon).expect("read").bytes, [1]);
    assert_eq!(bus.read(Dynamixel2, second, 84, 2, soon).expect("read").bytes, gain);
}

fn all_present(robot: &gaitway_profiles::Robot, protocol: Protocol) {
    let (world, mut bus) = virtual_bus(robot, Options::default());
    let roll = bus.ping_all(protocol, in_s(&world, 5.0)).expect("a line");
    let mut ids: Vec<u8> = robot.joints.iter().map(|joint| joint.id).collect();
    ids.sort_unstable();
    let present: Vec<u8> = roll.present.iter().map(|&(id, _)| id).collect();
    assert_eq!(present, ids);
    assert_eq!(roll.garbled_bytes, 0);
}

#[test]
fn a_ping_of_all_is_answered_by_all() {
    all_present(&op3(), Dynamixel2);
    all_present(&sts_robot(), FeetechSts);
}
