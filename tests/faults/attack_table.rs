//! What broke version 0.1.0 from outside, as a table: what it did, what happens now, what is seen of
//! it on the wire, and which test holds it. `docs/attacks.md` has the same table.
//!
//! The figures come from the scenes themselves, which are run here in virtual time, and from the
//! bytes that left the host. `GAITWAY_WRITE_ATTACKS=1` writes the document's rows anew.

use super::attacks::{
    Freed, armed_until, armed_with_a_stall, blocked_and_freed, killed_and_started_again, kills,
    stalled_motion, window,
};
use super::scene::{STRICT, Scene, Side, is_excused};
use super::sent::Told;
use super::table::{self, Held};
use super::{MID_NS, first_joint};
use gaitway::control::Settings;
use gaitway::robot::preflight::preflight;
use gaitway::time::Duration;
use gaitway_sim::{Damage, Fault, Options, Rule};
use std::process::{Command, Output, Stdio};

const DOCUMENT: &str = "docs/attacks.md";

/// One way in which 0.1.0 broke a promise.
struct Row {
    attack: &'static str,
    /// What 0.1.0 did.
    before: &'static str,
    now: &'static str,
    /// What a run of the scene shows now.
    seen: fn() -> String,
    held_by: &'static [Held],
}

const ATTACKS: &str = "tests/faults/attacks.rs";
const ARM: &str = "src/control/arm/tests.rs";
const CYCLE: &str = "src/control/cycle/tests.rs";
const MATRIX: &str = "tests/matrix.rs";
const TOLD: &str = "tests/told.rs";
const LATE_HOST: &str = "tests/preflight/late_host.rs";
const LOCK: &str = "src/job/servo/lock_tests.rs";
const SLIMEVR: &str = "src/sensing/slimevr.rs";

const OP3: &str = "op3";
const DUCK: &str = "open-duck-mini-v2";

fn nothing() -> String {
    "-".to_owned()
}

#[rustfmt::skip]
const ROWS: [Row; 19] = [
    Row {
        attack: "A joint is blocked in a fast motion and let go later; or the host is killed \
                 while it is blocked.",
        before: "Stopped, and left the goal 0.75 to 1.21 rad from the joint with torque on; let \
                 go, a Feetech knee went there by itself, 0.83 rad at 5.4 rad/s. Killed: 0.51 to \
                 0.74 rad.",
        now: "No goal goes further than 0.35 rad from where its joint was last read: not in the \
              motion, not in the stop, not after it.",
        seen: blocked,
        held_by: &[
            (ATTACKS, "the_goal_of_a_blocked_joint_stays_within_the_bound_in_the_motion_the_ramp_\
                       and_after_it", 0),
            (ATTACKS, "a_blocked_joint_that_is_freed_later_turns_no_further_than_the_bound_with_\
                       no_host", 0)],
    },
    Row {
        attack: "The host stands still for 3 s while it arms, and somebody turns a joint \
                 meanwhile.",
        before: "Took the answer from before: torque came on 0.31 rad from the goal (0.92 rad when \
                 the joint was turned further), and the run ended `done`, exit code 0.",
        now: "Torque comes on only after a look that is at most 50 ms old. A host that stalls \
              after its last look cannot keep the word back: it sees by its clock once the word \
              has left, switches torque off again and says so.",
        seen: turned_while_arming,
        held_by: &[
            (ATTACKS, "a_stall_at_any_step_of_arming_never_lets_torque_move_a_joint_that_was_\
                       turned_meanwhile", 0),
            (ARM, "a_look_during_which_the_host_stalled_is_repeated", 0),
            (ARM, "a_host_that_stalls_between_its_last_look_and_torque_has_torque_off_again", 0)],
    },
    Row {
        attack: "One servo falls silent for good, and for 20 ms of the stop all others do.",
        before: "Gave the line up after one lost cycle: goals ended at 1.54 rad/s, the last two of \
                 7 joints differed, the watchdogs of the others stayed on, and the report said \
                 only that the joints hold.",
        now: "A line is given up after five cycles without any answer, and even then its motion is \
              run down: the stop goes on to rest, and watchdogs are switched off.",
        seen: silent_and_a_lost_cycle,
        held_by: &[
            (ATTACKS, "a_silent_servo_and_a_lost_cycle_still_end_at_rest", 0),
            ("tests/faults/mixed.rs", "no_seed_of_several_faults_together_breaks_a_rule", 0)],
    },
    Row {
        attack: "No answer arrives any more although goals do (a broken wire), or all are late by \
                 120 ms once.",
        before: "Cut the motion off: last goals at 2.1 rad/s (OP3) and 0.97 rad/s (Open Duck \
                 Mini), watchdogs on, not said; answers that were only late: 1.86 rad/s, the last \
                 two goals of 8 joints differed.",
        now: "The stop is run down blindly, for no longer than a stop may take, and that is said, \
              and which watchdogs may be on. Not to Dynamixel 1.0 servos, which a goal switches \
              on: nothing is sent into the silence of their line, and they go to their last goal.",
        seen: answers_gone,
        held_by: &[
            (ATTACKS, "answers_lost_while_goals_still_arrive_end_in_a_ramp_that_is_said_to_be_\
                       blind", 0),
            (ATTACKS, "answers_that_are_only_late_for_a_moment_end_at_rest", 0),
            (CYCLE, "a_motion_nobody_answers_is_run_down_blindly_and_no_longer_than_a_stop_may_\
                     last", 0)],
    },
    Row {
        attack: "The host stands still inside a cycle, between reading and writing.",
        before: "Made up for it: 0.388 rad in one write after 0.25 s; only the next cycle saw the \
                 stall.",
        now: "The time since the last goals is looked at right before the guard: after more than \
              100 ms no goal moves any more.",
        seen: stalls_in_a_cycle,
        held_by: &[
            (ATTACKS, "a_stall_at_any_step_of_a_cycle_is_no_jump", 0),
            (CYCLE, "a_host_that_stands_still_for_longer_inside_a_cycle_leaves_the_joints_at_\
                     their_last_goal", 0)],
    },
    Row {
        attack: "Ctrl-C while the robot is armed.",
        before: "Torque came on 33 ms after the signal, 19 cycles were played, and it stayed on (2 \
                 of 2); `live` and `servo move` likewise, `hold` did not listen at all.",
        now: "A wish to stop is looked at before each word of arming: torque never comes on, or \
              goes off again where it came on a moment before. A robot that was held stays held.",
        seen: asked_while_arming,
        held_by: &[
            (ATTACKS, "a_wish_to_stop_at_any_step_of_arming_leaves_a_limp_robot_limp_and_a_held_\
                       one_held", 0),
            (ARM, "a_wish_to_stop_is_looked_at_before_each_word_and_leaves_a_limp_robot_limp", 0),
            ("tests/process.rs", "a_wish_to_stop_before_torque_is_on_leaves_the_robot_limp", 0),
            (MATRIX, "every_command_ends_well_whatever_disturbs_it_and_whenever", 0)],
    },
    Row {
        attack: "Standard error cannot be written: full, closed, or a pipe that nobody reads.",
        before: "`live` and `hold` panicked after torque was on: exit code 101, all 20 joints left \
                 under torque, no report, the recording not closed.",
        now: "No write to standard output or error ends anything; what could not be told shows in \
              the exit code, and a lost remark is no loss.",
        seen: full_stderr,
        held_by: &[
            (TOLD, "the_exit_code_says_what_was_done_and_whether_it_could_be_told", 0),
            (TOLD, "a_terminal_that_goes_away_under_a_progress_bar_ends_nothing", 0),
            (MATRIX, "every_command_ends_well_whatever_disturbs_it_and_whenever", 0),
            ("tests/architecture.rs", "one_place_alone_writes_to_the_terminal", 0)],
    },
    Row {
        attack: "Answers are lost while a Feetech servo's ID or speed is changed.",
        before: "Exit code 1, the ID changed, and the EEPROM lock open for good, unsaid.",
        now: "The lock is closed on every way out; where nobody can know whether it is, that is \
              said, with the command that closes it.",
        seen: nothing,
        held_by: &[
            (LOCK, "whatever_answers_are_lost_the_lock_is_closed_or_said_to_be_open", 0),
            (LOCK, "a_servo_that_hears_nothing_any_more_is_said_to_be_open", 0),
            (LOCK, "a_lock_that_was_left_open_is_closed_with_the_command_that_was_named", 0)],
    },
    Row {
        attack: "`play --record FILE --force` is refused while arming.",
        before: "The old recording was gone although nothing had moved.",
        now: "A recording takes the place of another with its first cycle or sample.",
        seen: nothing,
        held_by: &[
            ("tests/replaced.rs", "a_start_that_is_refused_while_arming_leaves_the_recording_that_\
                                   was_there", 0),
            ("tests/replaced.rs",
             "a_recording_takes_the_place_of_another_with_its_first_cycle", 0)],
    },
    Row {
        attack: "The machine is so busy that the host is late for answers before the start.",
        before: "Of 24 starts 13 blamed a servo's status return level and advised to change its \
                 EEPROM, 8 called a servo silent, 3 named the host.",
        now: "A servo is blamed only for questions whose answers this host was on time to hear; \
              else the host is named.",
        seen: late_starts,
        held_by: &[
            (LATE_HOST, "a_host_that_stalls_again_and_again_passes_or_is_named_itself", 0),
            (LATE_HOST, "one_stall_wherever_it_comes_keeps_no_healthy_robot_from_passing", 0),
            (LATE_HOST, "nobody_is_told_to_write_eeprom_while_the_host_was_late", 0),
            ("src/bus/patience.rs", "a_late_host_excuses_a_device_until_it_has_been_late_for_too_\
                                     long", 0)],
    },
    Row {
        attack: "A table of angles names one joint in two columns.",
        before: "Played the first, ignored the second without a word, exit code 0.",
        now: "Refused, both columns named.",
        seen: named_twice,
        held_by: &[
            ("tests/commands_joint_motions.rs",
             "a_joint_that_a_motion_names_twice_is_refused_and_both_places_are_named", 0)],
    },
    Row {
        attack: "A recording of 60 kB claims a text of 2 GB.",
        before: "1.6 to 1.9 GB were asked for; with 1 GB of address space `info` was killed by \
                 SIGABRT.",
        now: "Reading any file asks for at most four times its size and 16 MiB.",
        seen: huge_claim,
        held_by: &[
            ("tests/memory/mcap_files.rs", "lengths-of-texts-are-huge", 0),
            ("tests/memory/mcap_files.rs", "a-length-anywhere-is-huge", 0),
            ("src/recording/record.rs", "lengths_beyond_the_body_and_names_said_twice_are_\
                                         malformed", 0)],
    },
    Row {
        attack: "A servo answers under another ID for good, in a read of the whole line.",
        before: "Reported as `no answer`.",
        now: "Both IDs are told.",
        seen: wrong_id,
        held_by: &[
            ("tests/faults.rs",
             "b06_five_answers_in_a_row_under_a_wrong_id_stop_the_motion_and_the_id_is_named", 0),
            ("tests/wire_bus.rs", "who_answers_for_the_one_device_that_is_missing_is_named", 0)],
    },
    Row {
        attack: "A file holds commands to the terminal: a topic of a recording, a joint of a \
                 capture.",
        before: "They reached the terminal as they were, and set its title.",
        now: "They are shown, not obeyed.",
        seen: escapes,
        held_by: &[(TOLD, "no_text_from_a_file_is_a_command_to_the_terminal", 0)],
    },
    Row {
        attack: "A stranger of the network says that it is a SlimeVR tracker.",
        before: "The socket was always open to the network; who first said a known address was \
                 that tracker, and 64 forged greetings would have kept all others out for good.",
        now: "The socket is open to this machine alone unless another address is given, which is \
              said; only trackers that are named as worn are heard; one that speaks is not \
              displaced, and forged ones make room. A tracker proves nothing: who says the address \
              of a worn one before it speaks is still taken for it.",
        seen: nothing,
        held_by: &[
            ("tests/record_command.rs", "trackers_of_the_network_are_heard_only_where_the_socket_\
                                         is_open_to_it", 0),
            (SLIMEVR, "only_trackers_that_are_worn_are_heard_and_the_others_counted", 0),
            (SLIMEVR, "forged_handshakes_do_not_keep_a_tracker_out_for_good", 0),
            (SLIMEVR, "a_tracker_that_speaks_is_not_displaced_and_one_that_was_away_comes_back",
             0)],
    },
    Row {
        attack: "`servo move --limp` is stopped under way, or its servo falls silent; `live \
                 --recalibrate` beside a file called X.toml.new.",
        before: "Went limp after the stop; said nothing of a watchdog that may be on; the file was \
                 overwritten without `--force`.",
        now: "Only a motion that came to its end is followed by limp; what the run has to say is \
              said; no other file is touched.",
        seen: nothing,
        held_by: &[
            ("tests/commands_servo.rs", "a_move_that_was_stopped_is_not_followed_by_limp", 0),
            ("tests/commands_servo.rs", "a_servo_that_falls_silent_in_a_move_is_told_with_its_\
                                         watchdog", 0),
            ("src/draft.rs", "a_file_that_is_to_stay_stays_and_one_that_is_replaced_touches_no_\
                              other", 0)],
    },
    Row {
        attack: "A program writes a goal 2.3 rad from the last to the virtual robot behind a port.",
        before: "`simulate` said `referee: no rule broken`.",
        now: "Steps behind a port are judged by the times that they can have had.",
        seen: nothing,
        held_by: &[
            ("tests/simulate.rs", "a_client_that_jumps_is_told_so_unless_nobody_wants_to_know", 0),
            ("sim/tests/suite/door.rs", "a_goal_that_jumps_is_seen_through_the_door", 0),
            ("sim/tests/suite/door.rs", "a_door_that_wakes_late_sees_no_step_that_was_none", 0)],
    },
    Row {
        attack: "A start after the watchdogs of Dynamixel servos have stopped them, their old \
                 goals ahead.",
        before: "Cleared the watchdog 18 ms before it told the goal to stay, with the old goal \
                 0.60 rad away. What a real servo does then the maker does not say.",
        now: "Each servo is made as slow as it can be first, and the goal to stay where it is is \
              the very next word.",
        seen: bitten_watchdogs,
        held_by: &[
            (ATTACKS, "a_servo_that_its_watchdog_stopped_is_cleared_slowly_and_told_to_stay_in_the_\
                       very_next_word", 0),
            ("src/control/testing/preflight.rs", "a_watchdog_that_was_left_on_or_has_bitten_is_\
                                                  cleared_and_said", 0)],
    },
    Row {
        attack: "A reader looks for what the documents promise.",
        before: "The table of faults called the sensors rooms that do not exist yet, though they \
                 did; there was no SECURITY.md and nothing about the dependencies.",
        now: "Tables of faults are compared with the suite; SECURITY.md, deny.toml and a reason \
              for each dependency are there.",
        seen: nothing,
        held_by: &[
            ("tests/faults/forty.rs",
             "the_forty_are_those_of_the_document_and_every_test_that_is_named_exists", 0),
            ("tests/dependencies.rs", "every_direct_dependency_is_named_with_its_reason", 0)],
    },
];

/// The most of all.
fn most(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().fold(0.0, f64::max)
}

/// How fast goals went when something began to be lost, and at last.
fn speeds(told: &Told, joints: &[usize]) -> String {
    let last: Vec<String> =
        told.last_speeds(joints).iter().map(|speed| format!("{speed:.2}")).collect();
    let begun = told.speed_at(joints, MID_NS);
    format!("goals at {begun:.2} rad/s when it began, and at last {} rad/s", last.join(", "))
}

fn blocked() -> String {
    let of = |robot: &str| {
        let freed: Vec<Freed> = kills().map(|kill| blocked_and_freed(robot, kill)).collect();
        let (killed, stopped): (Vec<_>, Vec<_>) = freed.iter().partition(|freed| freed.killed);
        let stopped = stopped.first().expect("one that stopped by itself");
        format!(
            "{robot}: goal at most {:.3} rad from the joint, {:.3} rad when left; let go, it \
             turned {:.3} rad; killed at {} moments: {:.3} rad at most",
            stopped.farthest_rad,
            stopped.left_rad,
            stopped.turned_rad,
            killed.len(),
            most(killed.iter().map(|freed| freed.turned_rad))
        )
    };
    [OP3, DUCK].map(of).join("; ")
}

fn turned_while_arming() -> String {
    let joint = first_joint(DUCK);
    let (twin, _) = armed_with_a_stall(DUCK, None, 0, 0.0);
    let at_rad = |scene: &Scene| scene.world.lock().joint_position_rad(&joint).expect("a joint");
    let begun_rad = at_rad(&twin);
    let (mut refused, mut later, mut on, mut far) = (0, 0, 0, 0);
    let (mut lasted_ms, mut turned_rad) = (Vec::new(), Vec::new());
    for step in 0..twin.host.steps() {
        let (scene, said) = armed_with_a_stall(DUCK, Some(step), 3_000, 0.31);
        if scene.host.stalled() == 0 {
            continue;
        }
        let verdict = scene.world.lock().verdict();
        let is_far = verdict.violations.iter().any(|broken| broken.rule == Rule::TorqueOn);
        if said == "armed" {
            assert!(!is_far, "before step {step}: torque came on away from the joint, and stayed");
            later += 1;
            continue;
        }
        refused += 1;
        let is_on = |joint: &String| scene.world.lock().register(joint, "Torque Enable") == Some(1);
        on += scene.link.robot().joint_names().iter().filter(|joint| is_on(joint)).count();
        if is_far {
            far += 1;
            lasted_ms.extend(Told::by(&scene).torque_lasted_ms());
            turned_rad.push((at_rad(&scene) - begun_rad - 0.31).abs());
        }
    }
    format!(
        "{DUCK}, a stall before each of {} steps: {refused} refused, torque left on in {on} \
         joints, {later} came when torque was on already; torque came on away from the joint in {far}, \
         was off again within {:.1} ms, and turned the joint by {:.3} rad at most",
        refused + later,
        most(lasted_ms),
        most(turned_rad)
    )
}

/// What the referee has against a run, that the run does not except by itself.
fn refereed(violations: &[gaitway_sim::Violation]) -> String {
    match violations.len() {
        0 => "referee: no rule broken".to_owned(),
        count => format!("referee: {count} x {}", violations[0].rule.code()),
    }
}

fn silent_and_a_lost_cycle() -> String {
    let joint = first_joint(OP3);
    let silent = Fault::Silent { joint: joint.clone(), from_ns: MID_NS, until_ns: u64::MAX };
    let faults = vec![silent, window(None, 90, 20, Damage::Mute)];
    let mut scene = Scene::with_faults(OP3, faults);
    scene.host.keep_sent();
    let mut played = scene.play_until(0.5, 4, &|| false);
    let told = Told::by(&scene);
    let others: Vec<usize> =
        (0..20).filter(|&index| scene.link.robot().joints[index].name != joint).collect();
    let watchdog = |&index: &usize| {
        let world = scene.world.lock();
        world.register(&scene.link.robot().joints[index].name, "Bus Watchdog") != Some(0)
    };
    played.verdict.excuse(|violation| violation.joint.as_ref() == Some(&joint));
    format!(
        "{OP3}, the 19 that hear: {}; the last two equal in {} of {}; watchdogs \
         on in {}; {}",
        speeds(&told, &others),
        told.at_rest(&others),
        others.len(),
        others.iter().filter(|index| watchdog(index)).count(),
        refereed(&played.verdict.violations)
    )
}

/// What is told to a robot whose answers are damaged for a while.
fn told_without_answers(
    robot: &str,
    rate_hz: Option<f64>,
    lasts_ms: u64,
    damage: Damage,
) -> String {
    let mut scene = Scene::with_faults(robot, vec![window(None, 0, lasts_ms, damage)]);
    scene.host.keep_sent();
    if let Some(rate_hz) = rate_hz {
        scene.settings = Settings::at_rate(rate_hz);
    }
    let played = scene.play_until(0.5, 4, &|| false);
    let told = Told::by(&scene);
    let all: Vec<usize> = (0..scene.link.robot().joints.len()).collect();
    let at_rest = told.at_rest(&all);
    let excused =
        |violation: &gaitway_sim::Violation| !is_excused(violation, &played.run, &scene.link);
    let kept: Vec<_> = played.verdict.violations.iter().filter(|v| excused(v)).cloned().collect();
    let watched = scene.link.robot().joint_names();
    let world = scene.world.lock();
    let watchdogs: Vec<i64> =
        watched.iter().filter_map(|joint| world.register(joint, "Bus Watchdog")).collect();
    let said = if played.verdict.violations.len() > kept.len() {
        format!("{}, but for what the run itself excepts", refereed(&kept))
    } else {
        refereed(&kept)
    };
    let on = watchdogs.iter().filter(|&&raw| raw != 0).count();
    let named = |joint: &&String| {
        let words = "bus watchdog may still be on";
        played.run.notes.iter().any(|note| note.contains(words) && note.contains(joint.as_str()))
    };
    let watchdogs = match watchdogs.len() {
        0 => String::new(),
        _ => format!("watchdogs on in {on}, named {}, ", watched.iter().filter(named).count()),
    };
    format!(
        "{}, the last two equal in {at_rest} of {}, {watchdogs}{said}",
        speeds(&told, &all),
        all.len()
    )
}

fn answers_gone() -> String {
    let gone = |robot: &str| {
        format!("{robot}: {}", told_without_answers(robot, None, u64::MAX, Damage::Mute))
    };
    let late = Damage::StaleReply { by_ns: 120_000_000 };
    [
        gone(OP3),
        gone(DUCK),
        gone("protocol-1").replace("protocol-1", "Dynamixel 1.0"),
        format!("late at 50 Hz, {OP3}: {}", told_without_answers(OP3, Some(50.0), 120, late)),
    ]
    .join("; ")
}

fn stalls_in_a_cycle() -> String {
    let of = |robot: &str| {
        let (twin, _, steps) = stalled_motion(robot, None);
        let undisturbed_rad = Told::by(&twin).longest_step_rad();
        let middle = steps / 4;
        let longest = |lasts_ms: u64| {
            most((middle..middle + 24).map(|step| {
                let (scene, ..) = stalled_motion(robot, Some((step, lasts_ms)));
                Told::by(&scene).longest_step_rad()
            }))
        };
        format!(
            "{robot}, longest step of a goal in one write: {undisturbed_rad:.3} rad undisturbed; a \
             stall before each of 24 steps in turn: {:.3} rad with 0.09 s, which is bridged, {:.3} \
             rad with 0.25 s, {:.3} rad with 1 s",
            longest(90),
            longest(250),
            longest(1_000)
        )
    };
    [OP3, DUCK].map(of).join("; ")
}

fn asked_while_arming() -> String {
    let of = |robot: &str| {
        let (_, _, looks) = armed_until(robot, false, u64::MAX);
        let (mut never, mut lasted_ms, mut on) = (0, Vec::new(), 0);
        for after in 0..looks {
            let (scene, ..) = armed_until(robot, false, after);
            if scene.host.sent().is_empty() {
                never += 1;
                continue;
            }
            match Told::by(&scene).torque_lasted_ms() {
                None => never += 1,
                Some(ms) => lasted_ms.push(ms),
            }
            let world = scene.world.lock();
            let joints = scene.link.robot().joint_names();
            on += joints.iter().filter(|of| world.register(of, "Torque Enable") == Some(1)).count();
        }
        format!(
            "{robot}, asked at each of {looks} looks: torque never told to come on in {never}, off \
             again within {:.1} ms in {}, left on in {on} joints",
            most(lasted_ms.iter().copied()),
            lasted_ms.len()
        )
    };
    [OP3, DUCK].map(of).join("; ")
}

fn gaitway(arguments: &str, errors: Stdio) -> Output {
    crate::program::gaitway()
        .args(arguments.split(' '))
        .stdin(Stdio::null())
        .stderr(errors)
        .output()
        .expect("the command")
}

fn folder() -> std::path::PathBuf {
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("attacks");
    std::fs::create_dir_all(&folder).expect("a folder");
    folder
}

fn full_stderr() -> String {
    let of = |arguments: &str| {
        let full = std::fs::OpenOptions::new().write(true).open("/dev/full").expect("Linux");
        let output = gaitway(arguments, full.into());
        let code = output.status.code().expect("an end");
        let report: serde_json::Value = serde_json::from_slice(&output.stdout).expect("a report");
        format!("exit code {code}, `{}`", report["outcome"].as_str().expect("an outcome"))
    };
    format!(
        "`live`: {}; `hold`: {}",
        of("live --from file:walk --robot op3 --bus sim --for 2 --json"),
        of("hold op3 --bus sim --json")
    )
}

fn late_starts() -> String {
    let (mut passed, mut host, mut servo) = (0, 0, 0);
    for start in 0..24_u64 {
        let mut scene = Scene::of(OP3, Options::default());
        let stall = (Side::After, Duration::from_millis(150));
        let every = 10 * (start + 1);
        scene.host.stall_by(Box::new(move |step| step.is_multiple_of(every).then_some(stall)));
        match preflight(&mut scene.link, scene.settings.period, STRICT) {
            Ok(_) => passed += 1,
            Err(error) if error.to_string().contains("this host") => host += 1,
            Err(_) => servo += 1,
        }
    }
    format!(
        "{OP3}, 24 starts, a stall of 150 ms in every 10th, 20th, .. 240th call of the port: \
         {passed} pass, {host} name the host, {servo} blame a servo"
    )
}

fn named_twice() -> String {
    let file = folder().join("twice.csv");
    std::fs::write(&file, "time_s,r_knee_rad,r_knee_rad\n0,0,0.1\n0.4,0,0.1\n").expect("a table");
    let play = format!("play {} --robot op3 --bus sim", file.display());
    format!("exit code {}", gaitway(&play, Stdio::null()).status.code().expect("an end"))
}

/// An MCAP file, by the format's description, whose only record begins with a text of 2 GB.
fn huge_claim() -> String {
    let mut file = b"\x89MCAP0\r\n".to_vec();
    let header = [1, 8, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0];
    file.extend(header);
    let body = [&0x7FFF_FFF0_u32.to_le_bytes()[..], &[b'a'; 60_000]].concat();
    file.push(12);
    file.extend((body.len() as u64).to_le_bytes());
    file.extend(body);
    let path = folder().join("claims.mcap");
    std::fs::write(&path, file).expect("a file");
    let output = Command::new("sh")
        .args(["-c", "ulimit -v 1000000; exec \"$0\" info \"$1\"", crate::program::PATH])
        .arg(&path)
        .output()
        .expect("a shell");
    let code = output.status.code().map_or("none: a signal".to_owned(), |code| code.to_string());
    format!("with 1 GB of address space: exit code {code}")
}

fn wrong_id() -> String {
    let joint = first_joint(OP3);
    let wrong = window(Some(&joint), 0, u64::MAX, Damage::WrongId { id: 77 });
    let mut scene = Scene::with_faults(OP3, vec![wrong]);
    scene.host.keep_sent();
    let played = scene.play_until(0.2, 4, &|| false);
    let reason = played.run.stop.expect("a reason").to_string();
    let all: Vec<usize> = (0..20).collect();
    let told = Told::by(&scene);
    format!("\"{reason}\"; the last two goals equal in {} of 20", told.at_rest(&all))
}

fn escapes() -> String {
    let file = folder().join("escapes.bvh");
    let text = "HIERARCHY\nROOT Hips\n{\nOFFSET 0 0 0\nCHANNELS 3 Xrotation Yrotation Zrotation\n\
                JOINT evil\u{1b}]0;gotcha\u{7}\n{\nOFFSET 0 0 0\nCHANNELS 1 Wrong\n}\n}\n";
    std::fs::write(&file, text).expect("a capture");
    let play = format!("play {} --robot op3 --bus sim", file.display());
    let output = gaitway(&play, Stdio::piped());
    let said = String::from_utf8([output.stdout, output.stderr].concat()).expect("UTF-8");
    assert!(said.contains("gotcha"), "it is not shown:\n{said}");
    let commands = said.chars().filter(|&c| c.is_control() && c != '\n').count();
    format!("control characters that reach the terminal: {commands}")
}

fn bitten_watchdogs() -> String {
    let started = killed_and_started_again();
    format!(
        "{OP3}: {} servos stopped, their goals up to {:.2} rad away; goals are the next word after \
         {} of {} clearings, {:.1} ms later at most; the speed limit is {} then, the lowest there \
         is; no joint turned by more than {:.3} rad",
        started.stopped,
        started.goal_off_rad,
        started.goals_next,
        started.cleared,
        started.within_ms,
        started.speed,
        started.turned_rad
    )
}

impl Row {
    /// As a line of the table.
    fn line(&self, number: usize) -> String {
        let seen = (self.seen)();
        assert!(!seen.contains('|'), "{seen}");
        let held_by = table::named(self.held_by);
        format!(
            "| {number} | {} | {} | {} | {seen} | {held_by} |",
            self.attack, self.before, self.now
        )
    }
}

#[test]
fn what_broke_0_1_0_is_answered_as_the_document_says_with_the_figures_of_this_run() {
    let missing = table::missing(ROWS.iter().flat_map(|row| row.held_by));
    assert_eq!(missing, [""; 0]);
    let lines: Vec<String> =
        ROWS.iter().enumerate().map(|(index, row)| row.line(index + 1)).collect();
    super::aloud!("{}", lines.join("\n"));
    let is_id = |id: &str| id.parse::<u8>().is_ok();
    if std::env::var_os("GAITWAY_WRITE_ATTACKS").is_some() {
        table::rewrite(DOCUMENT, is_id, &lines);
    }
    table::assert_repeated(DOCUMENT, is_id, &lines);
}
