//! The forty faults as a table: which test holds each of them, and what is owed.
//!
//! `docs/faults.md` has the same table. A fault is held if every case that can exist today is, with the
//! referee watching, and the same scene without the fault ends done.

use super::table::{self, Held};

/// One of the forty.
struct Row {
    id: &'static str,
    fault: &'static str,
    held_by: &'static [Held],
    /// Which rules of the referee are watched.
    rules: &'static str,
    /// The same without the fault.
    twin: &'static str,
    /// Cases that need something that does not exist yet; none: empty.
    owed: &'static str,
}

/// All rules, over every robot of [`super::ROBOTS`].
const ALL: &str = "all";
/// All rules; a servo or line that is gone cannot hear its last goals.
const ALL_BUT_GONE: &str = "all but the last goals of who is gone";
/// Refused before torque: neither a goal nor torque may be seen.
const NO_GOAL: &str = "no goal, no torque";
/// Nothing is moved.
const NONE: &str = "none: nothing moves";

const DONE: &str = "without_a_fault_the_motion_ends_done_with_every_read";
const SAME: &str = "in the test";
const READY: &str = "a_healthy_robot_passes_and_stands_where_its_file_says";

const F: &str = "tests/faults.rs";
const ATTACKS: &str = "tests/faults/attacks.rs";
const BROKEN: &str = "tests/faults/broken.rs";
const DOORS: &str = "tests/faults/doors.rs";
const HOST: &str = "tests/faults/host.rs";
const MOTIONS: &str = "tests/faults/motions.rs";
const SERVOS: &str = "tests/faults/servos.rs";
const CAN: &str = "tests/can_robot.rs";
const PROCESS: &str = "tests/process.rs";
const PREFLIGHT: &str = "tests/preflight.rs";

const fn row(
    id: &'static str,
    fault: &'static str,
    held_by: &'static [Held],
    (rules, twin, owed): (&'static str, &'static str, &'static str),
) -> Row {
    Row { id, fault, held_by, rules, twin, owed }
}

#[rustfmt::skip]
const FORTY: [Row; 40] = [
    row("B01", "a byte of a status lost",
        &[(F, "b01_a_byte_lost_from_a_status_costs_at_most_that_cycle", 60)], (ALL, DONE, "")),
    row("B02", "a bit of a status flipped",
        &[(F, "b02_no_flipped_bit_is_ever_taken_for_a_value", 600)], (ALL, SAME, "")),
    row("B03", "a lie with a sound checksum",
        &[(SERVOS, "b03_a_lie_with_a_sound_checksum_is_not_believed", 0),
          ("src/control/plausible.rs", "a_joint_may_move_as_fast_as_it_can_and_no_faster", 0)],
        (ALL_BUT_GONE, DONE, "")),
    row("B04", "a status twice",
        &[(F, "b04_a_status_that_arrives_twice_shifts_nothing", 5)], (ALL, SAME, "")),
    row("B05", "a status that comes late",
        &[(F, "b05_a_stale_reply_is_never_the_next_answer", 105),
          (ATTACKS, "answers_that_are_only_late_for_a_moment_end_at_rest", 0)], (ALL, SAME, "")),
    row("B06", "an answer under another ID",
        &[(F, "b06_an_answer_under_a_wrong_id_is_not_assigned", 5),
          (F, "b06_five_answers_in_a_row_under_a_wrong_id_stop_the_motion_and_the_id_is_named", 5),
          ("tests/wire_bus.rs", "who_answers_for_the_one_device_that_is_missing_is_named", 0)],
        (ALL_BUT_GONE, SAME, "")),
    row("B07", "two servos with one ID",
        &[(SERVOS, "b07_two_servos_with_one_id_are_refused_before_torque", 0),
          ("tests/wire_scan.rs",
           "twins_whose_pings_are_the_same_are_told_apart_by_their_positions", 0),
          ("tests/wire_scan.rs", "twins_that_answer_at_different_times_are_heard_twice_or_garbled",
           0)],
        (NO_GOAL, DONE, "")),
    row("B08", "noise, false headers, own echo",
        &[(F, "b08_garbage_before_a_status_costs_at_most_one_cycle", 25),
          ("tests/wire_bus.rs", "on_an_echoing_adapter_our_own_bytes_are_no_answer", 0),
          ("src/wire/properties.rs", "garbage_before_a_status_costs_only_itself", 0)],
        (ALL, DONE, "")),
    row("B09", "false lengths, bodies without end",
        &[(SERVOS, "b09_false_lengths_and_bodies_without_end_cost_a_cycle_at_most", 0),
          ("src/wire/properties.rs", "every_length_field_is_survived_with_a_crc_that_fits", 0),
          ("src/wire/properties.rs",
           "unstuffing_the_longest_status_takes_less_than_a_kibibyte", 0)],
        (ALL, DONE, "")),
    row("B10", "a servo silent for a while, or for good",
        &[(F, "b10_a_servo_silent_for_four_cycles_is_bridged_and_five_stop_the_motion", 25),
          (F, "b10_the_joints_behind_a_silent_one_keep_answering", 0),
          (ATTACKS, "a_silent_servo_and_a_lost_cycle_still_end_at_rest", 0),
          (ATTACKS,
           "answers_lost_while_goals_still_arrive_end_in_a_ramp_that_is_said_to_be_blind", 0)],
        (ALL_BUT_GONE, DONE, "")),
    row("B11", "a servo restarts",
        &[(SERVOS, "b11_a_restart_on_any_robot_is_seen_and_torque_never_comes_back_by_itself", 0)],
        (ALL_BUT_GONE, DONE, "")),
    row("B12", "overload, alert",
        &[(SERVOS, "b12_an_overload_on_any_robot_stops_the_motion_and_the_others_hold", 0)],
        (ALL, DONE, "")),
    row("B13", "a brown-out of all",
        &[(SERVOS, "b13_servos_that_come_back_from_a_brown_out_get_no_goal_and_no_torque", 0)],
        ("no goal after the first answer, no torque", DONE, "")),
    row("B14", "a joint stuck; an encoder that jumps",
        &[(SERVOS, "b14_a_blocked_joint_on_any_robot_stops_the_motion_in_time", 5),
          (SERVOS, "b14_an_encoder_that_jumps_a_turn_moves_no_goal_and_stops_the_motion", 0),
          (ATTACKS, "the_goal_of_a_blocked_joint_stays_within_the_bound_in_the_motion_the_ramp_\
                     and_after_it", 0),
          (ATTACKS,
           "a_blocked_joint_that_is_freed_later_turns_no_further_than_the_bound_with_no_host", 0)],
        (ALL, DONE, "")),
    row("B15", "another model, firmware or limit",
        &[(SERVOS, "b15_a_servo_that_is_not_what_the_file_says_is_refused_with_both_values", 0),
          (PREFLIGHT, "unknown_firmware_is_refused_unless_accepted", 0)],
        (NO_GOAL, READY, "")),
    row("B16", "a line too slow for the rate",
        &[(PREFLIGHT, "a_rate_the_line_cannot_carry_is_refused_with_the_highest_it_can", 0),
          ("tests/preflight/reading.rs",
           "b16_an_adapter_that_holds_bytes_back_is_found_out_by_measuring", 0),
          ("tests/preflight/reading.rs",
           "a_return_delay_that_makes_the_line_too_slow_is_named_with_what_it_costs", 0)],
        (NO_GOAL, READY, "")),
    row("B17", "CAN: bus-off, full queue, short and foreign frames",
        &[(CAN, "a_line_that_goes_bus_off_is_lost_and_the_others_come_to_rest", 0),
          (CAN, "a_send_queue_that_stays_full_is_a_lost_line", 0),
          (CAN, "a_send_queue_that_is_full_for_a_moment_costs_no_more_than_that", 0),
          (CAN, "frames_that_are_short_or_foreign_are_passed_over_and_counted", 0),
          ("tests/can.rs", "the_can_suite_passes_on_a_kernel_with_socketcan", 0)],
        (ALL_BUT_GONE, "twelve_actuators_on_one_line_play_at_200_hz", "")),
    row("H18", "a line unplugged in a motion",
        &[(HOST, "h18_the_other_lines_come_to_rest_when_one_is_lost", 0),
          (HOST, "h18_the_only_line_lost_ends_the_motion_at_once", 0),
          (HOST, "h18_nobody_spins_on_a_line_that_is_gone", 0),
          (PROCESS, "h18_a_port_that_vanishes_ends_the_motion_within_a_second", 0)],
        (ALL_BUT_GONE, SAME, "")),
    row("H19", "plugged in again",
        &[(PROCESS, "h19_a_port_that_comes_back_is_not_used_by_itself", 0),
          ("tests/commands_ports.rs", "an_adapter_is_named_with_its_stable_names_and_its_latency",
           0)],
        ("R1, R3", "a_robot_in_another_process_is_played_over_a_real_port", "")),
    row("H20", "hang-up, open that blocks, a write nobody takes",
        &[(PROCESS, "h20_a_write_that_nobody_takes_ends_by_its_deadline_and_a_hang_up_is_gone", 0),
          (PROCESS, "h20_opening_what_would_block_returns", 0)],
        (NONE, "a_robot_in_another_process_is_played_over_a_real_port", "")),
    row("H21", "a port in use, without permission, no terminal",
        &[(PROCESS, "a_port_in_use_is_refused_by_name", 0),
          (PROCESS, "h21_a_port_without_permission_is_refused_with_what_to_do", 0),
          (PROCESS, "ports_that_are_none_are_refused_with_what_to_do", 0),
          ("tests/commands_ports.rs", "the_program_that_holds_a_port_is_named", 0),
          ("src/port/can.rs", "an_interface_is_claimed_by_one_at_a_time", 0)],
        (NONE, "a_robot_in_another_process_is_played_over_a_real_port", "")),
    row("C22", "the host stalls once",
        &[(F, "c22_c24_a_short_stall_is_bridged_and_a_long_one_stops_without_a_jump", 0),
          (ATTACKS, "a_stall_at_any_step_of_a_cycle_is_no_jump", 0),
          (ATTACKS, "a_stall_at_any_step_of_arming_never_lets_torque_move_a_joint_that_was_turned_\
                     meanwhile", 0)],
        (ALL, SAME, "")),
    row("C23", "the host is always too slow",
        &[(F, "c23_a_host_that_is_always_too_slow_is_stopped_within_ten_cycles", 0)],
        (ALL, DONE, "")),
    row("C24", "the wall clock jumps; the machine sleeps",
        &[(F, "c22_c24_a_short_stall_is_bridged_and_a_long_one_stops_without_a_jump", 0),
          (HOST, "c24_nothing_that_moves_a_joint_can_read_the_wall_clock", 0),
          ("src/port.rs", "the_monotonic_clock_counts_the_time_the_machine_was_suspended", 0),
          ("tests/recording_files.rs", "log_times_follow_the_monotonic_clock_alone", 0)],
        (ALL, SAME, "")),
    row("X25", "the first read of a joint fails",
        &[(SERVOS,
           "x25_a_first_read_that_fails_at_any_joint_and_any_try_means_no_goal_and_no_torque", 0),
          (PREFLIGHT, "a_failed_first_read_of_any_joint_means_no_goal_and_no_torque", 0)],
        (NO_GOAL, READY, "")),
    row("X26", "a wish to stop at any moment, and again",
        &[(SERVOS, "x26_a_wish_to_stop_at_any_of_fifty_points_ends_in_a_hold_and_a_second_changes_\
                    nothing", 0),
          (ATTACKS,
           "a_wish_to_stop_at_any_step_of_arming_leaves_a_limp_robot_limp_and_a_held_one_held", 0),
          (PROCESS, "an_interrupt_slows_the_motion_down_and_holds", 0)],
        (ALL, SAME, "")),
    row("X27", "the host is killed",
        &[(HOST, "x27_servos_stop_by_themselves_when_their_host_is_killed", 0),
          (HOST, "x27_the_goal_of_a_killed_host_is_within_the_bound_on_every_robot", 250),
          (HOST, "x27_the_next_start_clears_what_the_last_host_left_behind", 0),
          (ATTACKS,
           "a_blocked_joint_that_is_freed_later_turns_no_further_than_the_bound_with_no_host", 0),
          (PROCESS, "a_killed_player_leaves_the_joints_at_rest_and_a_readable_recording", 0)],
        ("R1 to R4", DONE, "")),
    row("X28", "a panic at any step",
        &[(BROKEN, "x28_a_panic_of_any_part_in_any_cycle_is_a_stop_that_ends_at_rest", 180),
          (BROKEN, "x28_a_panic_at_any_look_of_arming_leaves_a_limp_robot_limp", 0),
          (BROKEN, "x28_a_panic_at_every_step_of_a_cycle_ends_at_rest_and_is_reported", 14)],
        (ALL, "x28_motions_that_nothing_breaks_end_done", "")),
    row("M29", "no numbers",
        &[("src/guard.rs", "what_is_no_number_is_refused_at_every_place", 0),
          ("src/motion/path.rs",
           "a_position_that_is_not_finite_is_refused_with_joint_and_index", 0),
          ("src/motion/trajectory.rs", "values_that_are_not_finite_never_become_a_trajectory", 0),
          ("tests/mocap/bvh_reader.rs", "a_number_that_is_not_one_is_refused_with_line_and_joint", 0)],
        (NONE, "whatever_is_asked_no_admitted_goal_breaks_a_rule", "")),
    row("M30", "times equal, backwards, empty, endless",
        &[("src/motion/path.rs", "times_must_rise_evenly", 0),
          ("src/motion/path.rs", "shapes_that_do_not_fit_are_refused", 0),
          ("tests/commands_joint_motions.rs", "what_cannot_be_played_is_refused_in_words", 0)],
        (NONE, "a_table_and_a_recording_of_goals_play_as_the_action_they_are_made_from", "")),
    row("M31", "beyond a limit, by a millionth or ten times (there is no jerk limit)",
        &[(MOTIONS, "m31_the_guard_admits_what_is_within_each_limit_and_nothing_beyond_it", 614),
          (MOTIONS,
           "m31_a_motion_beyond_a_limit_is_refused_or_slowed_until_it_holds_and_position_never",
           1806),
          ("src/motion/trajectory.rs",
           "a_limit_passed_by_a_billionth_is_refused_with_joint_quantity_value_limit_and_time", 0)],
        (NONE, SAME, "")),
    row("M32", "a motion that starts far away, or ends moving",
        &[("src/motion/path.rs",
           "an_end_at_rest_becomes_exactly_a_rest_and_a_moving_end_keeps_its_velocity", 0),
          ("src/motion/trajectory.rs",
           "a_trajectory_starts_and_ends_with_exactly_no_velocity", 0),
          ("tests/commands_joint_motions.rs",
           "a_motion_taught_by_hand_is_played_back_from_rest_to_rest", 0)],
        (ALL, SAME, "")),
    row("M33", "joints unknown, missing, twice",
        &[("tests/commands_joint_motions.rs", "what_cannot_be_played_is_refused_in_words", 0),
          ("tests/commands_joint_motions.rs",
           "a_joint_that_a_motion_names_twice_is_refused_and_both_places_are_named", 0),
          ("tests/command_line.rs", "only_and_mirror_do_what_they_say", 0)],
        (NONE, "a_table_and_a_recording_of_goals_play_as_the_action_they_are_made_from", "")),
    row("R34", "a recorder killed",
        &[("tests/recording_kill.rs",
           "a_process_killed_at_any_moment_loses_at_most_one_second", 0),
          ("tests/recording_killed_sensors.rs",
           "recordings_of_sensors_killed_at_a_hundred_random_moments_lose_at_most_a_second", 0)],
        (NONE, "what_was_recorded_is_read_back_exactly", "")),
    row("R35", "a disk full, or failing at any call",
        &[(MOTIONS,
           "r35_a_disk_that_fails_at_any_call_disturbs_no_goal_and_no_time_of_the_motion", 0),
          ("tests/recording_files.rs",
           "a_disk_that_fails_at_any_call_keeps_what_was_stored_and_every_message_is_counted", 0),
          ("tests/recording_files.rs",
           "a_sector_of_zeros_costs_its_own_chunks_at_most_those_behind_it", 0),
          ("tests/told.rs",
           "a_recording_that_may_not_grow_any_more_is_a_loss_and_ends_no_motion", 0)],
        (ALL, SAME, "")),
    row("R36", "a disk that stands still",
        &[("tests/recording_files.rs",
           "a_disk_that_stands_still_never_holds_up_the_cycle_and_the_gap_is_marked", 0),
          ("tests/recording_sensors.rs",
           "a_disk_that_stands_still_holds_up_no_sensor_and_what_is_dropped_is_counted_by_topic",
           0)],
        (NONE, "what_was_recorded_is_read_back_exactly", "")),
    row("F37", "broken captures, tables, recordings",
        &[("tests/mocap/bvh_reader.rs", "a_file_cut_off_at_any_byte_is_refused", 0),
          ("tests/mocap/bvh_reader.rs", "any_bytes_give_a_value_or_an_error", 0),
          ("tests/recording_files.rs",
           "a_file_cut_at_any_byte_gives_every_closed_chunk_and_nothing_else", 0),
          ("tests/recording_files.rs",
           "a_file_that_claims_more_joints_than_it_has_values_for_is_refused", 0),
          ("tests/mocap/c3d_reader.rs", "no_truncation_flipped_byte_or_lie_breaks_the_reader", 0),
          ("tests/mocap/c3d_reader.rs", "every_count_may_lie_by_any_amount", 0),
          ("tests/mocap/malformed.rs",
           "texts_that_are_cut_off_or_changed_or_that_lie_are_read_or_refused", 0),
          ("tests/decoders_hunted.rs", "no_decoder_breaks_on_bytes_made_up_by_a_fuzzer", 0)],
        (NONE, "what_is_written_reads_back_equal", "")),
    row("F38", "broken robot files, tricks with paths",
        &[("firmware-profiles/tests/validator.rs",
           "the_name_must_be_the_files_own_and_never_a_path", 0),
          ("firmware-profiles/tests/validator.rs",
           "a_file_cut_off_at_any_byte_is_an_error_or_a_whole_profile_never_a_panic", 0),
          ("firmware-profiles/tests/validator.rs",
           "parents_exist_come_first_and_make_no_cycle", 0),
          ("tests/robot_models.rs", "broken_models_are_read_or_refused", 0),
          (MOTIONS, "f38_an_output_never_goes_through_a_link_without_being_forced", 6),
          ("tests/command_line.rs",
           "outputs_that_cannot_be_written_are_refused_before_anything_moves", 0)],
        (NONE, "the_unchanged_fixtures_are_accepted", "")),
    row("S39", "sensors silent, gone, swapped, late; strangers who call themselves one",
        &[("tests/live_sensors.rs",
           "a_sensor_that_is_pulled_out_brings_the_robot_to_rest_and_is_named", 0),
          ("tests/live_sensors.rs",
           "a_sensor_that_falls_silent_is_said_and_the_robot_stands_until_it_is_stopped", 0),
          ("tests/worn_body.rs", "sensors_that_were_swapped_are_doubted_and_others_are_not", 0),
          ("tests/swapped_sensors.rs", "a_walk_names_sensors_that_were_swapped_and_no_others", 0),
          ("src/capture/stuck.rs",
           "an_axis_that_dies_is_seen_within_a_fifth_of_a_second_and_no_coarse_or_filtered_one_is_\
            taken_for_it", 0),
          ("src/capture/timeline/tests.rs", "a_counter_that_goes_round_is_no_gap", 0),
          ("src/capture/timeline/tests.rs",
           "gaps_repetitions_and_disorder_are_told_apart_and_counted", 0),
          ("src/body/worn/doubt/tests.rs",
           "a_sensor_that_stands_still_leaves_its_segment_where_it_is_and_is_taken_up_again_slowly",
           0),
          ("tests/record_command.rs",
           "a_sensor_that_is_plugged_in_again_is_taken_up_in_the_same_recording", 0),
          ("tests/record_command.rs",
           "trackers_of_the_network_are_heard_only_where_the_socket_is_open_to_it", 0)],
        (NONE, "a_person_with_13_sensors_walks_and_a_virtual_op3_walks_along_now_and_from_the_\
                recording",
         "sensors that lie: of a wrong scale")),
    row("W40", "strangers at a door (TCP, UDP, control, web)",
        &[(DOORS, "w40_a_tcp_door_serves_one_and_sends_a_thousand_others_away", 1200),
          (DOORS, "w40_the_tcp_door_of_simulate_listens_to_this_machine_alone", 0),
          (DOORS, "w40_a_udp_port_takes_garbage_and_a_crowd_and_goes_on", 1100),
          ("sim/tests/suite/door.rs", "one_program_at_a_time_talks_over_tcp", 0),
          ("sim/tests/suite/control.rs", "a_program_that_never_reads_costs_no_more_than_its_share",
           0),
          ("sim/tests/suite/control.rs",
           "a_crowd_at_the_socket_is_sent_away_and_those_inside_are_served", 0),
          ("tests/view_live.rs",
           "garbage_floods_and_clients_that_never_read_are_refused_counted_and_in_nobodys_way",
           0)],
        (NONE, SAME, "")),
];

/// A test ran so many cases: what the table says.
pub fn ran(test: &str, cases: u64) {
    let held = FORTY.iter().flat_map(|row| row.held_by).find(|(_, name, _)| *name == test);
    let (_, _, stated) = held.unwrap_or_else(|| panic!("{test} holds none of the forty"));
    assert_eq!(cases, *stated, "{test}: the table says {stated} cases");
}

impl Row {
    fn state(&self) -> &'static str {
        match (self.held_by.is_empty(), self.owed.is_empty()) {
            (true, _) => "owed",
            (false, true) => "held",
            (false, false) => "held as far as it can be today",
        }
    }

    fn cases(&self) -> String {
        let counted: u64 = self.held_by.iter().map(|(_, _, cases)| cases).sum();
        if counted == 0 { "-".to_owned() } else { counted.to_string() }
    }

    /// As a line of a table.
    fn line(&self) -> String {
        let owed =
            if self.owed.is_empty() { String::new() } else { format!("; owed: {}", self.owed) };
        format!(
            "| {} | {} | {} | {} | {} | `{}` | {}{owed} |",
            self.id,
            self.fault,
            table::named(self.held_by),
            self.cases(),
            self.rules,
            self.twin,
            self.state()
        )
        .replace("`in the test`", SAME)
    }
}

fn summary() -> String {
    let of = |state: &str| FORTY.iter().filter(|row| row.state() == state).count();
    format!(
        "Of forty: {} held, {} held as far as it can be today, {} owed.",
        of("held"),
        of("held as far as it can be today"),
        of("owed")
    )
}

#[test]
fn the_forty_are_those_of_the_document_and_every_test_that_is_named_exists() {
    let lines: Vec<String> = FORTY.iter().map(Row::line).collect();
    super::aloud!("{}\n{}", lines.join("\n"), summary());
    let mut missing = table::missing(FORTY.iter().flat_map(|row| row.held_by));
    let sources = table::every_source();
    for row in FORTY.iter().filter(|row| row.twin != SAME) {
        if !sources.iter().any(|text| table::has_test(text, row.twin)) {
            missing.push(format!("{}: there is no twin {}", row.id, row.twin));
        }
    }
    assert_eq!(missing, [""; 0]);
    let is_id = |id: &str| id.len() == 3 && id[1..].parse::<u8>().is_ok();
    table::assert_repeated("docs/faults.md", is_id, &lines);
    let document = table::read("docs/faults.md");
    assert!(document.contains(&summary()), "docs/faults.md does not say: {}", summary());
}

#[test]
fn the_forty_are_forty_and_in_order() {
    let numbers: Vec<u8> = FORTY.iter().map(|row| row.id[1..].parse().expect("a number")).collect();
    assert_eq!(numbers, (1..=40).collect::<Vec<u8>>());
}
