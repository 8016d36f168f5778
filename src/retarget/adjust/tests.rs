use super::*;
use core::f64::consts::PI;

const RATE_HZ: f64 = 100.0;

pub(super) struct Op3 {
    body: RobotBody,
    names: Vec<String>,
    limits_rad: Vec<(f64, f64)>,
    pub(super) start_rad: Vec<f64>,
}

pub(super) fn op3() -> Op3 {
    let file = gaitway_profiles::robot("op3").expect("shipped");
    let body = RobotBody::of(&file).expect("a body").expect("it has one");
    let limit = |joint: &gaitway_profiles::Joint| (joint.lower_rad, joint.upper_rad);
    Op3 {
        body,
        names: file.joints.iter().map(|joint| joint.name.clone()).collect(),
        limits_rad: file.joints.iter().map(limit).collect(),
        start_rad: file.joints.iter().map(|joint| joint.initial_rad()).collect(),
    }
}

impl Op3 {
    pub(super) fn joint(&self, name: &str) -> usize {
        self.names.iter().position(|known| known == name).expect("a joint")
    }

    /// Three seconds in which joints swing from zero, by their own way.
    fn swinging(&self, ways: &[(&str, &dyn Fn(f64) -> f64)]) -> Vec<Vec<f64>> {
        let mut series = vec![vec![0.0; 301]; self.names.len()];
        // Arms down: at zero they are stretched out sideways.
        series[self.joint("r_sho_roll")].fill(-1.3);
        series[self.joint("l_sho_roll")].fill(1.3);
        for (name, way) in ways {
            let joint = self.joint(name);
            for (at, angle) in series[joint].iter_mut().enumerate() {
                *angle = way(at as f64 / RATE_HZ);
            }
        }
        series
    }

    pub(super) fn adjustable<'a>(&'a self, free: &'a [bool]) -> Adjustable<'a> {
        Adjustable {
            body: &self.body,
            start_rad: &self.start_rad,
            limits_rad: &self.limits_rad,
            free,
        }
    }

    fn adjusting<'a>(&'a self, free: &'a [bool]) -> Adjusting<'a> {
        Adjusting { robot: self.adjustable(free), rate_hz: RATE_HZ, footfalls: None, slower: None }
    }

    fn adjusted(
        &self,
        angles_rad: &[Vec<f64>],
        free: &[bool],
        footfalls: Option<&[Footfall]>,
    ) -> (Vec<Vec<f64>>, Adjusted) {
        let of = Adjusting { footfalls, ..self.adjusting(free) };
        let mut moved = angles_rad.to_vec();
        let told = adjust(&of, &mut moved).expect("adjusted");
        (moved, told)
    }

    pub(super) fn depths_m(&self, angles_rad: &[Vec<f64>]) -> Vec<f64> {
        let inside = SelfContact::of(&self.body, &self.start_rad);
        let pose = |at: usize| angles_rad.iter().map(|series| series[at]).collect::<Vec<f64>>();
        let placed = |at| self.body.tree.place(Placement::IDENTITY, &self.body.angles(&pose(at)));
        let deepest = |at| inside.deepest(&placed(at)).map_or(0.0, |overlap| overlap.depth_m);
        (0..angles_rad[0].len()).map(deepest).collect()
    }
}

/// Once there and back between the first and the second second.
fn once(time_s: f64) -> f64 {
    let part = (time_s - 1.0).clamp(0.0, 1.0);
    (1.0 - (2.0 * PI * part).cos()) / 2.0
}

/// Most that neighbours differ in their first difference, per s².
fn sharpest(series: &[f64]) -> f64 {
    let bend = |w: &[f64]| (w[0] - 2.0 * w[1] + w[2]).abs() * RATE_HZ * RATE_HZ;
    series.windows(3).map(bend).fold(0.0, f64::max)
}

#[test]
fn legs_that_cross_pass_one_another_and_nothing_else_is_changed() {
    let op3 = op3();
    let given =
        op3.swinging(&[("r_hip_roll", &|t| -0.12 * once(t)), ("l_hip_roll", &|t| 0.12 * once(t))]);
    let deepest = |series: &[Vec<f64>]| op3.depths_m(series).into_iter().fold(0.0, f64::max);
    assert!(deepest(&given) > 0.01, "{}", deepest(&given));
    let (moved, told) = op3.adjusted(&given, &vec![true; given.len()], None);
    assert!(deepest(&moved) < TOUCHES_M, "{}", deepest(&moved));
    assert!(told.before_share > 0.2 && told.after_share == 0.0, "{told:?}");
    for (joint, (given, moved)) in given.iter().zip(&moved).enumerate() {
        let name = &op3.names[joint];
        // Half a second and more from where they touch.
        assert_eq!(given[..=50], moved[..=50], "{name}");
        assert_eq!(given[250..], moved[250..], "{name}");
        if !(name.contains("hip") || name.contains("knee") || name.contains("ank")) {
            assert_eq!(given, moved, "{name}");
        }
        // A jump by 0.02 rad from pose to pose would be 200.
        assert!(sharpest(moved) < sharpest(given) + 60.0, "{name}: {}", sharpest(moved));
    }
}

#[test]
fn an_arm_makes_way_and_what_it_would_go_through_stays() {
    let op3 = op3();
    // The forearm across, into the trunk.
    let given = op3.swinging(&[("r_el", &|t| 1.3 * once(t)), ("r_sho_pitch", &|t| 0.2 * once(t))]);
    let other =
        op3.swinging(&[("r_el", &|t| -1.3 * once(t)), ("r_sho_pitch", &|t| -0.2 * once(t))]);
    let deepest = |series: &[Vec<f64>]| op3.depths_m(series).into_iter().fold(0.0, f64::max);
    let inward = [given, other].into_iter().max_by(|a, b| deepest(a).total_cmp(&deepest(b)));
    let given = inward.expect("one of them");
    assert!(deepest(&given) > 0.005, "{}", deepest(&given));
    let (moved, _) = op3.adjusted(&given, &vec![true; given.len()], None);
    assert!(deepest(&moved) < TOUCHES_M, "{}", deepest(&moved));
    for (joint, (given, moved)) in given.iter().zip(&moved).enumerate() {
        let name = &op3.names[joint];
        if !["r_el", "r_sho_pitch", "r_sho_roll"].contains(&name.as_str()) {
            assert_eq!(given, moved, "{name}");
        }
    }
}

#[test]
fn joints_that_are_not_free_stay_and_none_goes_over_its_limit() {
    let op3 = op3();
    let given = op3.swinging(&[("r_hip_roll", &|t| -0.25 * once(t))]);
    let mut free = vec![true; given.len()];
    free[op3.joint("l_hip_roll")] = false;
    let (moved, _) = op3.adjusted(&given, &free, None);
    let held = op3.joint("l_hip_roll");
    assert!(given[held] == moved[held] && given != moved);
    for (series, (lower_rad, upper_rad)) in moved.iter().zip(&op3.limits_rad) {
        assert!(series.iter().all(|angle| (*lower_rad..=*upper_rad).contains(angle)));
    }
}

#[test]
fn feet_that_are_planted_stay_side_by_side_and_flat_and_one_in_the_air_may_move() {
    let op3 = op3();
    // The left leg swings all the time; until 1.5 s both feet are said to stand, then the right one.
    let given = op3.swinging(&[
        ("l_hip_pitch", &|t| 0.1 * (4.0 * t).sin()),
        ("l_ank_roll", &|t| 0.06 * (3.0 * t).cos()),
        ("l_hip_yaw", &|t| 0.1 * (2.0 * t).sin()),
    ]);
    let footfalls: Vec<Footfall> = (0..given[0].len())
        .map(|at| {
            let touches = [at < 150, true];
            let carries = touches.map(|is| f64::from(u8::from(is)));
            Footfall { carries, flat: carries, touches: Some(touches), ..Footfall::STANDING }
        })
        .collect();
    let soles = StandingSole::all(&op3.body);
    let sole = |side: usize| soles.iter().find(|sole| sole.side == side).expect("a sole");
    let frame = Solver::frame(sole(0));
    let across = |series: &[Vec<f64>], at: usize| {
        let pose: Vec<f64> = series.iter().map(|series| series[at]).collect();
        let placed = op3.body.tree.place(Placement::IDENTITY, &op3.body.angles(&pose));
        (Solver::across(&placed, &frame, sole(1)), placed[sole(1).link].turn * sole(1).normal)
    };
    let wander_m = |series: &[Vec<f64>], range: Range<usize>| {
        let (first, _) = across(series, range.start);
        let off = |at: usize| {
            let (now, _) = across(series, at);
            now.iter().zip(&first).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max)
        };
        range.map(off).fold(0.0, f64::max)
    };
    let (moved, _) = op3.adjusted(&given, &vec![true; given.len()], Some(&footfalls));
    assert!(wander_m(&given, 10..140) > 0.02, "{}", wander_m(&given, 10..140));
    assert!(wander_m(&moved, 10..140) < 0.001, "{}", wander_m(&moved, 10..140));
    assert!(wander_m(&moved, 170..300) > 0.02, "{}", wander_m(&moved, 170..300));
    for at in 5..145 {
        let (corners, _) = across(&moved, at);
        assert!(corners.iter().all(|corner| corner.z.abs() < 0.0005), "{at}: {corners:?}");
    }
    for at in 0..300 {
        let (corners, up) = across(&moved, at);
        assert!(up.angle_between(DVec3::Z) < 0.0175, "{at}: {up}");
        // The other is in the air: not below.
        let above = corners.iter().map(|corner| corner.z).fold(f64::MIN, f64::max);
        assert!(above < 0.005, "{at}: {above}");
    }
}

#[test]
fn a_clip_that_begins_later_is_changed_alike() {
    let op3 = op3();
    let given = op3.swinging(&[
        ("r_hip_roll", &|t| 0.06 * (5.0 * t).sin()),
        ("l_hip_roll", &|t| -0.06 * (5.0 * t).sin()),
        ("l_hip_pitch", &|t| 0.3 * (3.0 * t).sin()),
    ]);
    let later: Vec<Vec<f64>> = given.iter().map(|series| series[17..].to_vec()).collect();
    let free = vec![true; given.len()];
    let (whole, _) = op3.adjusted(&given, &free, None);
    let (cut, _) = op3.adjusted(&later, &free, None);
    for (whole, cut) in whole.iter().zip(&cut) {
        for (whole, cut) in whole[67..].iter().zip(&cut[50..]) {
            assert!((whole - cut).abs() < 0.1, "{whole} {cut}");
        }
    }
}

#[test]
fn short_blinks_are_bridged_and_a_ramp_reaches_as_far_as_it_says() {
    let mut on = [true, false, false, true, false, false, false, true];
    bridge(&mut on, 2);
    assert_eq!(on, [true, true, true, true, false, false, false, true]);
    let found = ramps(&[false, false, false, true, false, false, false], 1.0);
    assert_eq!([found[0], found[1], found[3], found[5]], [0.0, 0.0, 1.0, 0.0]);
    assert!(found[2] > 0.0 && found[2] == found[4]);
    assert_eq!(ramps(&[false; 3], 2.0), [0.0; 3]);
}

/// Three seconds in which the left leg is drawn up in the second one, from the pose it starts in, and what feet do:
/// both stand before and after.
fn on_one_leg(op3: &Op3) -> (Vec<Vec<f64>>, Vec<Footfall>) {
    let mut series: Vec<Vec<f64>> = op3.start_rad.iter().map(|angle| vec![*angle; 301]).collect();
    for (name, size) in [("l_hip_pitch", -0.3), ("l_knee", 0.6), ("l_ank_pitch", 0.3)] {
        for (at, angle) in series[op3.joint(name)].iter_mut().enumerate() {
            *angle += size * once(at as f64 / RATE_HZ);
        }
    }
    let footfalls = (0..301).map(|at| standing([!(100..=200).contains(&at), true])).collect();
    (series, footfalls)
}

fn standing(touches: [bool; 2]) -> Footfall {
    let carries = touches.map(|is| f64::from(u8::from(is)));
    Footfall { carries, flat: carries, touches: Some(touches), ..Footfall::STANDING }
}

/// How far inside the right sole the centre of mass is, seen along that sole's normal, m.
fn over_right_m(op3: &Op3, series: &[Vec<f64>], at: usize) -> f64 {
    let pose: Vec<f64> = series.iter().map(|series| series[at]).collect();
    let placed = op3.body.tree.place(Placement::IDENTITY, &op3.body.angles(&pose));
    let soles = StandingSole::all(&op3.body);
    let sole = soles.iter().find(|sole| sole.side == 1).expect("a sole");
    let up = placed[sole.link].turn * sole.normal;
    let level = glam::DQuat::from_rotation_arc(up, DVec3::Z);
    let corners = sole.corners_m.iter().map(|corner| level * placed[sole.link].point(*corner));
    let corners: Vec<glam::DVec2> = corners.map(DVec3::truncate).collect();
    let centre = (level * op3.body.tree.centre_of_mass_m(&placed)).truncate();
    crate::rigid::ground::SupportPolygon::of(&corners).margin_m(centre).expect("a sole")
}

#[test]
fn weight_goes_over_the_foot_that_is_left_alone_in_the_time_that_takes() {
    let op3 = op3();
    let (given, footfalls) = on_one_leg(&op3);
    let free = vec![true; given.len()];
    let mut of =
        Adjusting { footfalls: Some(&footfalls), slower: Some(1.0), ..op3.adjusting(&free) };
    let unweighed = |mut series: Vec<Vec<f64>>| {
        adjust(&Adjusting { slower: None, ..of }, &mut series).expect("adjusted");
        series
    };
    assert!(over_right_m(&op3, &unweighed(given.clone()), 150) < -0.005);
    assert!(!is_steady(&of, &given).expect("looked at"));
    // Half a second from two feet to one is too fast at a tenth of the time.
    of.slower = Some(0.1);
    let Pace::Slowed(times) = pace(&of, &given) else { panic!("it is slowed") };
    let end = (given[0].len() - 1) as f64;
    assert!((times[times.len() - 1] - end).abs() < 1e-9 && times.len() > 400, "{}", times.len());
    assert!(times.windows(2).all(|two| two[1] > two[0] && two[1] - two[0] < 1.01));
    of.slower = Some(4.0);
    let mut moved = given.clone();
    adjust(&of, &mut moved).expect("adjusted");
    for at in 105..=195 {
        let inside_m = over_right_m(&op3, &moved, at);
        assert!(inside_m > 0.02, "{at}: {inside_m}");
    }
    assert!(matches!(steady(&of, &moved).expect("looked at"), Pace::Even | Pace::Slowed(_)));
    // It ends as it began, between both feet.
    assert!(over_right_m(&op3, &moved, 300) < 0.0);
}

#[test]
fn who_stands_well_is_neither_slowed_nor_moved() {
    let op3 = op3();
    let mut series: Vec<Vec<f64>> = op3.start_rad.iter().map(|angle| vec![*angle; 301]).collect();
    for (at, angle) in series[op3.joint("r_el")].iter_mut().enumerate() {
        *angle += 0.3 * once(at as f64 / RATE_HZ);
    }
    let footfalls = vec![standing([true; 2]); 301];
    let free = vec![true; series.len()];
    let of = Adjusting { footfalls: Some(&footfalls), slower: Some(1.0), ..op3.adjusting(&free) };
    assert!(is_steady(&of, &series).expect("looked at"));
    assert_eq!(
        (pace(&of, &series), steady(&of, &series).expect("looked at")),
        (Pace::Even, Pace::Even)
    );
}

#[test]
fn who_leaps_from_foot_to_foot_is_not_helped_by_any_pace() {
    let op3 = op3();
    let mut given = on_one_leg(&op3).0;
    // Feet far apart.
    for (name, angle) in [("l_hip_roll", 0.4), ("r_hip_roll", -0.4)] {
        let outward = given[op3.joint(name)][0] - angle;
        given[op3.joint(name)].fill(outward);
    }
    let footfalls: Vec<Footfall> = (0..301)
        .map(|at| standing(if at % 100 < 50 { [true, false] } else { [false, true] }))
        .collect();
    let free = vec![true; given.len()];
    let of = Adjusting { footfalls: Some(&footfalls), slower: Some(0.05), ..op3.adjusting(&free) };
    assert_eq!(pace(&of, &given), Pace::Hopeless);
}

#[test]
fn a_clock_takes_as_long_as_its_pace_says_and_ends_at_the_end() {
    let even = weight::clock(&[1.0; 4], 2, 7);
    assert_eq!(even, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    let slow = weight::clock(&[3.0; 4], 2, 7);
    assert!(slow.len() == 19 && (slow[18] - 6.0).abs() < 1e-9, "{slow:?}");
    let half = weight::clock(&[1.0, 1.0, 1.0, 4.0, 4.0, 4.0], 2, 11);
    let later = half.iter().filter(|time| **time > 6.0).count();
    assert!((15..=17).contains(&later), "{half:?}");
}

#[test]
fn curves_over_a_limit_are_drawn_in_and_all_others_stay() {
    let mut series = vec![vec![0.0, 0.5, 1.02, 0.5, 0.0, 0.1], vec![0.0, 0.9, -0.9, 0.9, 0.0, 0.1]];
    let given = series.clone();
    drawn_in(&[(-1.0, 1.0), (-2.0, 2.0)], &mut series).expect("drawn in");
    assert_eq!(series[1], given[1]);
    let curve = Spline::through(series[0].clone(), 1.0, End::Free, End::Free).expect("a curve");
    assert!(curve.extremes().position.max.value <= 1.0 && series[0][0] == 0.0);
}

#[test]
fn nothing_is_nothing() {
    let op3 = op3();
    for count in [0, 1, 2] {
        let given = vec![vec![0.0; count]; op3.names.len()];
        let (moved, told) = op3.adjusted(&given, &vec![true; given.len()], None);
        assert_eq!((moved, told.before_share), (given, 0.0));
    }
}
