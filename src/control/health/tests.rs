//! Every rule of the watch, on both sides of its bound.

use super::*;
use crate::device::{Health, JointState};
use std::collections::BTreeSet;

/// Time between two cycles of these tests.
const T: Duration = Duration::from_millis(10);
const NS: Duration = Duration::from_nanos(1);

type State = Result<(JointState, bool), Miss>;

/// Three joints that are stopped at 70 degrees and below 6 V, cycle by cycle.
struct Cycles {
    watch: Watch,
    cycle: u64,
    at: Instant,
    wanted_rad: [f64; 3],
    health: Option<(usize, Health)>,
}

impl Cycles {
    fn new() -> Self {
        let facts = ["hip", "knee", "neck"].map(|name| JointFacts {
            name: name.to_owned(),
            temperature_limit_c: Some(70.0),
            min_voltage_v: Some(6.0),
        });
        Self {
            watch: Watch::new(Bounds::default(), facts.to_vec()),
            cycle: 0,
            at: Instant::ZERO,
            wanted_rad: [0.0; 3],
            health: None,
        }
    }

    /// What is said of these states, `after` the cycle before.
    fn after(&mut self, after: Duration, states: [State; 3]) -> Option<StopReason> {
        self.at = self.at + after;
        self.cycle += 1;
        let sample = Sample {
            cycle: self.cycle,
            at: self.at,
            // The goal stays near a joint that does not follow, so it must not be what is judged.
            goal_rad: &[0.0; 3],
            wanted_rad: &self.wanted_rad,
            goal_velocity_rad_s: &[0.0; 3],
            states: &states,
            health: self.health,
        };
        self.watch.judge(&sample, |joint, bits| format!("bits {bits} of joint {joint}"))
    }

    fn see(&mut self, states: [State; 3]) -> Option<StopReason> {
        self.after(T, states)
    }

    /// A cycle in letters, one per joint: it answered (`.`), was silent (`x`), was not asked (`-`).
    fn heard(&mut self, letters: &str) -> Option<StopReason> {
        let mut letters = letters.chars();
        let state = |letter| match letter {
            Some('.') => well(),
            Some('x') => Err(Miss::Silent),
            _ => Err(Miss::NotAsked),
        };
        self.see(std::array::from_fn(|_| state(letters.next())))
    }

    /// A cycle in which all is well with the states, and these slow facts of a joint are read.
    fn slow(&mut self, joint: usize, health: Health) -> Option<StopReason> {
        self.health = Some((joint, health));
        let reason = self.see([well(), well(), well()]);
        self.health = None;
        reason
    }
}

fn state(state: JointState) -> State {
    Ok((state, false))
}

fn well() -> State {
    state(JointState::default())
}

fn there(position_rad: f64) -> State {
    state(JointState { position_rad, ..JointState::default() })
}

fn warm(temperature_c: f64) -> State {
    state(JointState { temperature_c: Some(temperature_c), ..JointState::default() })
}

fn supplied(voltage_v: f64) -> State {
    state(JointState { voltage_v: Some(voltage_v), ..JointState::default() })
}

fn silent(joint: &str, cycles: u32) -> Option<StopReason> {
    Some(StopReason::Silent { joint: joint.to_owned(), cycles, miss: "no answer".to_owned() })
}

fn code(reason: Option<StopReason>) -> Option<StopCode> {
    reason.map(|reason| reason.code())
}

#[test]
fn four_misses_in_a_row_are_borne_and_the_fifth_stops() {
    let mut cycles = Cycles::new();
    for _ in 0..4 {
        assert_eq!(cycles.heard(".x."), None);
    }
    assert_eq!(cycles.heard(".x."), silent("knee", 5));
    assert_eq!(cycles.heard(".x."), silent("knee", 6), "it goes on counting");
}

#[test]
fn an_answer_ends_a_row_of_misses() {
    let mut cycles = Cycles::new();
    for letters in [".x.", ".x.", ".x.", ".x.", "...", ".x.", ".x.", ".x.", ".x."] {
        assert_eq!(cycles.heard(letters), None);
    }
    assert_eq!(cycles.heard(".x."), silent("knee", 5));
}

#[test]
fn a_cycle_in_which_a_joint_is_not_asked_is_neither_a_miss_nor_an_answer() {
    let mut cycles = Cycles::new();
    for letters in [".x.", ".-.", ".x.", ".-.", ".-.", ".x.", ".x.", ".-.", ".-.", ".-.", ".-."] {
        assert_eq!(cycles.heard(letters), None);
    }
    assert_eq!(cycles.heard(".x."), silent("knee", 5));
}

#[test]
fn a_joint_read_in_turn_that_is_twice_where_it_cannot_be_is_not_waited_for_longer_than_others() {
    let wrong = || Err(Miss::Implausible);
    let not_asked = || Err(Miss::NotAsked);
    // Every third cycle; the second wrong reading is in the sixth after the last that was believed.
    let mut cycles = Cycles::new();
    let turns = [well(), not_asked(), not_asked(), wrong(), not_asked(), not_asked()];
    for turn in turns {
        assert_eq!(cycles.see([well(), turn, well()]), None);
    }
    let miss = "a position the joint cannot have reached".to_owned();
    let silent = StopReason::Silent { joint: "knee".to_owned(), cycles: 6, miss };
    assert_eq!(cycles.see([well(), wrong(), well()]), Some(silent));
    // One such reading is a lie, and a lost one is no reading.
    let mut cycles = Cycles::new();
    for turn in [well(), not_asked(), not_asked(), wrong(), not_asked(), not_asked()] {
        assert_eq!(cycles.see([well(), turn, well()]), None);
    }
    for turn in [Err(Miss::Garbled), not_asked(), not_asked(), well(), wrong(), wrong()] {
        assert_eq!(cycles.see([well(), turn, well()]), None);
    }
}

#[test]
fn every_kind_of_miss_counts_and_the_last_is_named() {
    let mut cycles = Cycles::new();
    let misses = [
        Miss::Garbled,
        Miss::WrongId { asked: 1, got: 2 },
        Miss::Refused("no".to_owned()),
        Miss::HostLate { by_ms: 3 },
    ];
    for miss in misses {
        assert_eq!(cycles.see([well(), Err(miss), well()]), None);
    }
    let reason = cycles.see([well(), Err(Miss::Implausible), well()]);
    let miss = "a position the joint cannot have reached".to_owned();
    assert_eq!(reason, Some(StopReason::Silent { joint: "knee".to_owned(), cycles: 5, miss }));
}

#[test]
fn a_silence_of_all_where_joints_are_asked_in_turn_stops_after_as_many_cycles_as_one_of_one() {
    let mut cycles = Cycles::new();
    for letters in ["x--", "-x-", "--x", "x--"] {
        assert_eq!(cycles.heard(letters), None);
    }
    assert_eq!(cycles.heard("-x-"), silent("knee", 5), "whoever was asked first in this cycle");
}

#[test]
fn one_answer_of_anybody_ends_a_silence_of_all() {
    for answer in [".--", "-.-", ".x-", "x.-", "x-."] {
        let mut cycles = Cycles::new();
        for letters in ["-x-", "--x", "-x-", "--x", answer, "--x", "-x-", "--x", "---"] {
            assert_eq!(cycles.heard(letters), None, "{answer}, then {letters}");
        }
    }
}

#[test]
fn cycles_in_which_nobody_is_asked_are_no_silence() {
    let mut cycles = Cycles::new();
    for letters in ["x--", "-x-", "---", "--x", "---", "---", "x--", "---", "---"] {
        assert_eq!(cycles.heard(letters), None);
    }
    assert_eq!(cycles.heard("-x-"), silent("knee", 5));
}

/// What is said at each of `cycles`, of which these are late.
fn paced(late: &[usize], cycles: usize) -> Vec<Option<StopReason>> {
    let mut watch = Cycles::new().watch;
    (0..cycles).map(|cycle| watch.pace(T, late.contains(&cycle))).collect()
}

#[test]
fn four_late_cycles_of_a_hundred_are_borne_and_the_fifth_stops() {
    assert_eq!(paced(&[0, 1, 2, 3], 300), vec![None; 300]);
    let said = paced(&[0, 1, 2, 3, 99], 100);
    assert_eq!(said[..99], vec![None; 99]);
    assert_eq!(said[99], Some(StopReason::Late { cycles: 5 }));
    assert_eq!(paced(&[0, 1, 2, 3, 4, 5], 6)[5], Some(StopReason::Late { cycles: 6 }));
}

#[test]
fn a_late_cycle_a_hundred_cycles_ago_counts_no_more() {
    assert_eq!(paced(&[0, 1, 2, 3, 100], 300), vec![None; 300]);
    assert_eq!(paced(&[150, 151, 152, 153, 250], 300), vec![None; 300]);
    let said = paced(&[150, 151, 152, 153, 249], 250);
    assert_eq!(said[249], Some(StopReason::Late { cycles: 5 }));
}

#[test]
fn a_gap_of_a_hundred_milliseconds_is_borne_and_a_longer_one_stops() {
    let mut watch = Cycles::new().watch;
    let gap = Duration::from_millis(100);
    assert_eq!(watch.pace(gap, false), None);
    assert_eq!(watch.pace(gap + NS, false), Some(StopReason::Stalled { gap_s: 0.100_000_001 }));
}

#[test]
fn a_stall_is_named_before_late_cycles() {
    let mut watch = Cycles::new().watch;
    for _ in 0..4 {
        assert_eq!(watch.pace(T, true), None);
    }
    let reason = watch.pace(Duration::from_secs(2), true);
    assert_eq!(reason, Some(StopReason::Stalled { gap_s: 2.0 }));
    assert_eq!(watch.pace(T, false), Some(StopReason::Late { cycles: 5 }), "it counted as well");
}

/// Just beyond the tracking bound.
fn beyond() -> f64 {
    f64::from_bits(0.35_f64.to_bits() + 1)
}

#[test]
fn a_joint_on_the_tracking_bound_follows() {
    let mut cycles = Cycles::new();
    for _ in 0..100 {
        assert_eq!(cycles.see([there(0.35), there(-0.35), well()]), None);
    }
}

#[test]
fn a_joint_beyond_the_bound_for_300_ms_is_borne_and_for_longer_does_not_follow() {
    for away in [beyond(), -beyond()] {
        let mut cycles = Cycles::new();
        assert_eq!(cycles.see([well(), there(away), well()]), None);
        assert_eq!(cycles.after(30 * T, [well(), there(away), well()]), None);
        let reason = cycles.after(NS, [well(), there(away), well()]);
        let (joint, error_rad) = ("knee".to_owned(), -away);
        assert_eq!(reason, Some(StopReason::NotFollowing { joint, error_rad }));
    }
}

#[test]
fn it_is_where_the_motion_wanted_the_joint_that_counts_and_not_the_goal_held_near_it() {
    let mut cycles = Cycles::new();
    cycles.wanted_rad = [0.0, 0.5, 0.0];
    assert_eq!(cycles.see([well(), well(), well()]), None);
    let reason = cycles.after(31 * T, [well(), well(), well()]);
    let joint = "knee".to_owned();
    assert_eq!(reason, Some(StopReason::NotFollowing { joint, error_rad: 0.5 }));
}

#[test]
fn a_joint_that_comes_back_inside_the_bound_begins_anew() {
    let mut cycles = Cycles::new();
    let away = || [well(), there(1.0), well()];
    assert_eq!(cycles.see(away()), None);
    assert_eq!(cycles.after(30 * T, [well(), there(0.35), well()]), None);
    assert_eq!(cycles.see(away()), None);
    assert_eq!(cycles.after(30 * T, away()), None);
    assert_eq!(code(cycles.after(NS, away())), Some(StopCode::NotFollowing));
}

#[test]
fn cycles_without_a_reading_do_not_bring_a_joint_back() {
    let mut cycles = Cycles::new();
    assert_eq!(cycles.see([well(), there(1.0), well()]), None);
    for letters in [".x.", ".-."] {
        assert_eq!(cycles.heard(letters), None);
    }
    let reason = cycles.after(30 * T, [well(), there(1.0), well()]);
    assert_eq!(code(reason), Some(StopCode::NotFollowing));
}

#[test]
fn a_position_that_is_no_number_does_not_follow() {
    let mut cycles = Cycles::new();
    assert_eq!(cycles.see([well(), there(f64::NAN), well()]), None);
    let reason = cycles.after(31 * T, [well(), there(f64::NAN), well()]);
    assert_eq!(code(reason), Some(StopCode::NotFollowing));
}

#[test]
fn a_servo_below_its_limit_is_borne_and_at_it_too_hot() {
    let below = f64::from_bits(70.0_f64.to_bits() - 1);
    let mut cycles = Cycles::new();
    assert_eq!(cycles.see([well(), warm(below), well()]), None);
    for hot in [70.0, 71.0, f64::INFINITY] {
        let joint = "knee".to_owned();
        let reason = StopReason::Hot { joint, temperature_c: hot, limit_c: 70.0 };
        assert_eq!(cycles.see([well(), warm(hot), well()]), Some(reason.clone()));
        let told = Health { temperature_c: Some(hot), ..Health::default() };
        assert_eq!(cycles.slow(1, told), Some(reason));
    }
    let told = Health { temperature_c: Some(below), ..Health::default() };
    assert_eq!(cycles.slow(1, told), None);
}

#[test]
fn a_temperature_that_is_no_number_is_too_hot() {
    let mut cycles = Cycles::new();
    let reason = cycles.see([well(), warm(f64::NAN), well()]);
    assert_eq!(code(reason), Some(StopCode::Hot));
}

#[test]
fn a_joint_whose_limits_nobody_knows_is_neither_hot_nor_low() {
    let mut cycles = Cycles::new();
    for facts in &mut cycles.watch.facts {
        (facts.temperature_limit_c, facts.min_voltage_v) = (None, None);
    }
    for _ in 0..30 {
        assert_eq!(cycles.see([well(), warm(200.0), supplied(0.0)]), None);
    }
}

#[test]
fn a_supply_at_its_minimum_is_borne_and_below_it_for_100_ms() {
    let below = f64::from_bits(6.0_f64.to_bits() - 1);
    let mut cycles = Cycles::new();
    for _ in 0..30 {
        assert_eq!(cycles.see([well(), supplied(6.0), well()]), None);
    }
    assert_eq!(cycles.see([well(), supplied(below), well()]), None);
    assert_eq!(cycles.after(10 * T, [well(), supplied(below), well()]), None);
    let reason = cycles.after(NS, [well(), supplied(below), well()]);
    let joint = "knee".to_owned();
    let low = StopReason::LowVoltage { joint, voltage_v: below, minimum_v: 6.0 };
    assert_eq!(reason, Some(low));
}

#[test]
fn all_joints_hang_on_one_supply() {
    // Seen low by one, well by another: it was only that one's wire, or a moment.
    let mut cycles = Cycles::new();
    assert_eq!(cycles.see([supplied(5.0), well(), well()]), None);
    assert_eq!(cycles.see([well(), supplied(7.0), well()]), None);
    assert_eq!(cycles.after(10 * T, [supplied(5.0), well(), well()]), None);
    // Seen low by one after another: it is low.
    assert_eq!(cycles.after(9 * T, [well(), supplied(5.0), well()]), None);
    let low = Health { voltage_v: Some(5.5), ..Health::default() };
    assert_eq!(cycles.slow(2, low), None);
    let joint = "neck".to_owned();
    let reason = StopReason::LowVoltage { joint, voltage_v: 5.5, minimum_v: 6.0 };
    assert_eq!(cycles.slow(2, low), Some(reason));
    assert_eq!(cycles.see([well(), supplied(6.0), well()]), None);
    assert_eq!(cycles.slow(2, low), None);
}

#[test]
fn a_servo_that_reports_error_bits_is_at_fault_and_they_are_named() {
    let mut cycles = Cycles::new();
    assert_eq!(cycles.slow(1, Health { error_bits: Some(0), ..Health::default() }), None);
    let reason = cycles.slow(2, Health { error_bits: Some(5), ..Health::default() });
    let (joint, fault) = ("neck".to_owned(), "bits 5 of joint 2".to_owned());
    assert_eq!(reason, Some(StopReason::ServoFault { joint, fault }));
}

#[test]
fn a_servo_that_let_go_is_at_fault() {
    let mut cycles = Cycles::new();
    assert_eq!(cycles.slow(1, Health { torque_on: Some(true), ..Health::default() }), None);
    let reason = cycles.slow(1, Health { torque_on: Some(false), ..Health::default() });
    let fault = "the servo switched its torque off (did it restart?)".to_owned();
    assert_eq!(reason, Some(StopReason::ServoFault { joint: "knee".to_owned(), fault }));
}

#[test]
fn a_servo_that_raises_its_alert_flag_is_at_fault_at_once() {
    let mut cycles = Cycles::new();
    let reason = cycles.see([well(), Ok((JointState::default(), true)), well()]);
    let fault = "the servo raised its alert flag".to_owned();
    assert_eq!(reason, Some(StopReason::ServoFault { joint: "knee".to_owned(), fault }));
}

#[test]
fn the_first_reason_of_a_cycle_wins() {
    let named = |reason: Option<StopReason>| reason.map(|reason| reason.to_string());
    let alert = || Ok((JointState::default(), true));
    let raised = |joint: &str| Some(format!("joint {joint}: the servo raised its alert flag"));
    assert_eq!(named(Cycles::new().see([alert(), alert(), well()])), raised("hip"));
    assert_eq!(named(Cycles::new().see([well(), alert(), warm(90.0)])), raised("knee"));

    // What the states say comes before the slow facts, and those before a silence of all.
    let mut cycles = Cycles::new();
    cycles.health = Some((0, Health { error_bits: Some(1), ..Health::default() }));
    assert_eq!(named(cycles.see([well(), alert(), well()])), raised("knee"));
    for letters in ["x--", "-x-", "--x", "x--", "-x-"] {
        let reason = named(cycles.heard(letters));
        assert_eq!(reason.as_deref(), Some("joint hip: bits 1 of joint 0"));
    }

    // Of one joint: its alert, that it does not follow, then its heat.
    let all = JointState {
        position_rad: 1.0,
        temperature_c: Some(90.0),
        voltage_v: Some(1.0),
        ..JointState::default()
    };
    let mut cycles = Cycles::new();
    let hot = "joint hip is too hot: 90 deg C";
    assert_eq!(named(cycles.see([state(all), well(), well()])).as_deref(), Some(hot));
    let reason = named(cycles.after(31 * T, [state(all), well(), well()]));
    assert_eq!(reason.as_deref(), Some("joint hip does not follow: -57.3 deg from its goal"));
    assert_eq!(named(cycles.see([Ok((all, true)), well(), well()])), raised("hip"));

    // Error bits before torque, torque before heat.
    let health = Health {
        error_bits: Some(2),
        torque_on: Some(false),
        temperature_c: Some(90.0),
        ..Health::default()
    };
    let reason = named(Cycles::new().slow(0, health));
    assert_eq!(reason.as_deref(), Some("joint hip: bits 2 of joint 0"));
    let reason = named(Cycles::new().slow(0, Health { error_bits: Some(0), ..health }));
    assert!(reason.is_some_and(|reason| reason.contains("switched its torque off")));
}

#[test]
fn a_joint_that_is_silent_for_long_is_named_before_a_later_joints_trouble() {
    let mut cycles = Cycles::new();
    for _ in 0..4 {
        assert_eq!(cycles.heard("x.."), None);
    }
    assert_eq!(cycles.see([Err(Miss::Silent), warm(90.0), well()]), silent("hip", 5));
}

/// One reason of each kind, with the words a person reads and the data a program does.
fn reasons() -> Vec<(StopReason, &'static str, Stop)> {
    let of = |code, joint: Option<&str>, line: Option<&str>, figures: Option<(f64, f64, _)>| Stop {
        code,
        joint: joint.map(str::to_owned),
        line: line.map(str::to_owned),
        got: figures.map(|figures| figures.0),
        allowed: figures.map(|figures| figures.1),
        unit: figures.map(|figures| figures.2),
        cycle: Some(7),
    };
    let joint = || "knee".to_owned();
    let line = || "left".to_owned();
    let joints = || vec!["hip".to_owned(), "knee".to_owned()];
    vec![
        (StopReason::Asked, "stopped as asked", of(StopCode::Asked, None, None, None)),
        (
            StopReason::Silent { joint: joint(), cycles: 6, miss: "no answer".to_owned() },
            "joint knee gave no feedback for 6 cycles: no answer",
            of(StopCode::Silent, Some("knee"), None, Some((6.0, 4.0, "cycles"))),
        ),
        (
            StopReason::Late { cycles: 5 },
            "the host cannot keep the rate: 5 of 100 cycles late",
            of(StopCode::Late, None, None, Some((5.0, 4.0, "of 100 cycles"))),
        ),
        (
            StopReason::Stalled { gap_s: 0.25 },
            "the host stalled for 250 ms",
            of(StopCode::Stalled, None, None, Some((0.25, 0.1, "s"))),
        ),
        (
            StopReason::NotFollowing { joint: joint(), error_rad: -0.5 },
            "joint knee does not follow: -28.6 deg from its goal",
            of(StopCode::NotFollowing, Some("knee"), None, Some((0.5, 0.35, "rad"))),
        ),
        (
            StopReason::ServoFault { joint: joint(), fault: "overload".to_owned() },
            "joint knee: overload",
            of(StopCode::ServoFault, Some("knee"), None, None),
        ),
        (
            StopReason::Hot { joint: joint(), temperature_c: 71.0, limit_c: 70.0 },
            "joint knee is too hot: 71 deg C",
            of(StopCode::Hot, Some("knee"), None, Some((71.0, 70.0, "deg C"))),
        ),
        (
            StopReason::LowVoltage { joint: joint(), voltage_v: 5.5, minimum_v: 6.0 },
            "the supply is too low at joint knee: 5.5 V",
            of(StopCode::LowVoltage, Some("knee"), None, Some((5.5, 6.0, "V"))),
        ),
        (
            StopReason::Refused { joint: joint(), reason: "too far".to_owned() },
            "the guard refused a goal for joint knee: too far",
            of(StopCode::RefusedByGuard, Some("knee"), None, None),
        ),
        (
            StopReason::CameBackLimp { line: line(), joints: joints() },
            "line left came back without torque; nothing more is sent to hip, knee",
            of(StopCode::CameBackLimp, None, Some("left"), None),
        ),
        (
            StopReason::Broke { words: "oops".to_owned() },
            "the control loop broke: oops",
            of(StopCode::Broke, None, None, None),
        ),
        (
            StopReason::LineLost { line: line(), text: "gone".to_owned(), joints: joints() },
            "the line was lost: line left: gone; no word reaches hip, knee",
            of(StopCode::LineLost, None, Some("left"), None),
        ),
    ]
}

#[test]
fn a_reason_has_words_for_people_and_figures_with_units_for_programs() {
    for (reason, words, data) in reasons() {
        assert_eq!(reason.to_string(), words);
        assert_eq!(reason.as_data(&Bounds::default(), Some(7)), data);
        assert_eq!(reason.code(), data.code);
        assert_eq!(reason.as_data(&Bounds::default(), None).cycle, None);
    }
}

#[test]
fn the_figures_allowed_are_those_of_the_bounds_in_force() {
    let bounds = Bounds {
        misses_in_a_row: 9,
        late_of_hundred: 8,
        gap: Duration::from_secs(2),
        tracking_rad: 0.2,
        ..Bounds::default()
    };
    let allowed = |code| {
        let mut of_kind = reasons().into_iter().filter(|(reason, ..)| reason.code() == code);
        of_kind.next().and_then(|(reason, ..)| reason.as_data(&bounds, None).allowed)
    };
    assert_eq!(allowed(StopCode::Silent), Some(8.0));
    assert_eq!(allowed(StopCode::Late), Some(7.0));
    assert_eq!(allowed(StopCode::Stalled), Some(2.0));
    assert_eq!(allowed(StopCode::NotFollowing), Some(0.2));
}

#[test]
fn the_words_of_the_kinds_differ_and_are_the_same_in_print_and_as_data() {
    let words: BTreeSet<String> = StopCode::ALL.iter().map(ToString::to_string).collect();
    assert_eq!(words.len(), StopCode::ALL.len());
    for code in StopCode::ALL {
        let word = code.to_string();
        let kebab = |c: char| c.is_ascii_lowercase() || c == '-';
        assert!(!word.is_empty() && word.chars().all(kebab), "{word}");
        assert_eq!(serde_json::to_value(code).expect("a word"), word);
    }
}

#[test]
fn a_stop_of_which_only_the_kind_is_known_says_no_more() {
    let said = serde_json::to_value(Stop::of(StopCode::SensorLost)).expect("data");
    let expected = serde_json::json!({
        "code": "sensor-lost", "joint": null, "line": null, "got": null, "allowed": null,
        "unit": null, "cycle": null,
    });
    assert_eq!(said, expected);
}
