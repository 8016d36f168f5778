use super::*;
use crate::body::worn::{Calibration, HeadingBy, Mount, Wearing};
use crate::body::{Dof, JointAngles};
use glam::DQuat;

const RATE_HZ: f64 = 100.0;
const DEGREE: f64 = core::f64::consts::PI / 180.0;

/// A walk: thighs and shanks as sines of usual size, 1 Hz; arms swing.
fn walk(t: f64) -> JointAngles {
    let mut angles = JointAngles::default();
    let swing = |phase: f64| (core::f64::consts::TAU * (t + phase)).sin();
    for (hip, knee, shoulder, phase) in [
        (Dof::LeftHipFlexion, Dof::LeftKneeFlexion, Dof::LeftShoulderFlexion, 0.0),
        (Dof::RightHipFlexion, Dof::RightKneeFlexion, Dof::RightShoulderFlexion, 0.5),
    ] {
        angles[hip] = (10.0 + 25.0 * swing(phase)) * DEGREE;
        angles[knee] = (32.0 - 30.0 * swing(phase + 0.15)) * DEGREE;
        angles[shoulder] = 20.0 * DEGREE * swing(phase + 0.5);
    }
    angles
}

/// What went wrong with what all said, and what the body was taken to do.
struct Run {
    changes: Vec<(f64, DoubtChange)>,
    /// How far any angle of a joint goes beyond what it does on the walk, rad.
    excess_rad: f64,
    /// How far any segment is from the truth in the end, rad.
    after_rad: f64,
}

/// Half a minute of walking with sensors along the segments; `spoil` says what the left thigh's sensor says instead, and whether it is stuck.
fn run(wears: [bool; 13], spoil: impl Fn(f64, Segment, DQuat) -> (DQuat, bool)) -> Run {
    let mount = |segment: Segment| Mount {
        segment,
        heading_rad: 0.0,
        sensor_from_segment: DQuat::IDENTITY,
        heading_by: HeadingBy::Strapping,
        consistency: None,
        strapped_off_rad: None,
    };
    let worn = Segment::ALL.into_iter().filter(|segment| wears[segment.index()]);
    let mut wearing =
        Wearing::new(&Calibration { mounts: worn.map(mount).collect(), notes: Vec::new() });
    let mut doubts = Doubts::default();
    let mut run = Run { changes: Vec::new(), excess_rad: 0.0, after_rad: 0.0 };
    let dt_s = 1.0 / RATE_HZ;
    let mut range = [(f64::INFINITY, f64::NEG_INFINITY); 22];
    for (n, dof) in (0..100).flat_map(|n| Dof::ALL.map(|dof| (n, dof))) {
        let angle = walk(f64::from(n) * dt_s)[dof];
        let (least, most) = &mut range[dof.index()];
        (*least, *most) = (least.min(angle), most.max(angle));
    }
    for n in 0..3000_u32 {
        let t = f64::from(n) * dt_s;
        let truth = walk(t);
        let pose = truth.to_pose(DVec3::ZERO, DQuat::from_rotation_z(0.2 * t));
        let mut said = [None; 13];
        for segment in Segment::ALL {
            let (one, stuck) = spoil(t, segment, pose.orientation[segment.index()]);
            let taken = Instant::from_nanos(u64::from(n) * 10_000_000 + 1);
            doubts.hear(segment, one, taken, stuck);
            said[segment.index()] = Some(one);
        }
        for change in doubts.judge(dt_s) {
            match change.doubted {
                Some(_) => wearing.hold(change.segment),
                None => wearing.release(change.segment, change.heading_lost),
            }
            run.changes.push((t, change));
        }
        let shown = wearing.pose(&said, dt_s);
        doubts.look(&wearing.as_said(), &wearing.worn());
        let angles = shown.measured.angles;
        for dof in Dof::ALL {
            let (least, most) = range[dof.index()];
            let beyond = (angles[dof] - most).max(least - angles[dof]);
            run.excess_rad = run.excess_rad.max(beyond);
        }
        if t > 25.0 {
            let off = Segment::ALL.map(|segment| {
                let at = segment.index();
                let off = shown.pose.orientation[at].angle_between(pose.orientation[at]);
                if wears[at] { off } else { 0.0 }
            });
            run.after_rad = off.into_iter().fold(run.after_rad, f64::max);
        }
    }
    run
}

/// A reset turns headings by 20 deg/s: what is usual of a knee is found anew, and is not what it was.
#[test]
fn a_heading_that_is_mended_is_no_knee_that_turns() {
    let mut doubts = Doubts::default();
    let worn = [true; 13];
    let mut wrong = Vec::new();
    for n in 0..3000_u32 {
        let t = f64::from(n) / RATE_HZ;
        let mut pose = walk(t).to_pose(DVec3::ZERO, DQuat::IDENTITY);
        // It ran away slowly, by 34 degrees, and is back within two seconds.
        let off_deg = if t < 20.0 { 1.7 * t } else { (34.0 - 20.0 * (t - 20.0)).max(0.0) };
        let shank = &mut pose.orientation[Segment::LeftShank.index()];
        *shank = DQuat::from_rotation_z(off_deg * DEGREE) * *shank;
        if n == 2000 {
            doubts.mended();
        }
        wrong.extend(doubts.judge(1.0 / RATE_HZ));
        doubts.look(&pose, &worn);
    }
    assert!(wrong.is_empty(), "{wrong:?}");
}

fn of_thigh(run: &Run) -> Vec<Option<Why>> {
    assert!(
        run.changes.iter().all(|(_, change)| change.segment == Segment::LeftThigh),
        "{:?}",
        run.changes
    );
    run.changes.iter().map(|(_, change)| change.doubted).collect()
}

#[test]
fn who_walks_and_turns_round_is_not_doubted() {
    let run = run([true; 13], |_, _, said| (said, false));
    assert!(
        run.changes.is_empty() && run.excess_rad < 1e-6,
        "{:?} {}",
        run.changes,
        run.excess_rad
    );
}

/// A knock: the sensor says 12 rad/s about its own length for 0.3 s, and its heading is elsewhere ever after.
fn knocked(on: Segment) -> Run {
    run([true; 13], |t, segment, said| {
        let turned = if segment == on { 12.0 * (t - 8.003).clamp(0.0, 0.3) } else { 0.0 };
        (DQuat::from_rotation_z(turned) * said, false)
    })
}

#[test]
fn a_knock_on_the_trunk_is_no_turn_and_it_is_taken_up_again() {
    let run = knocked(Segment::Torso);
    let found: Vec<_> = run.changes.iter().map(|(_, of)| (of.segment, of.doubted)).collect();
    assert_eq!(found, [(Segment::Torso, Some(Why::Jolt)), (Segment::Torso, None)]);
    eprintln!("knock on the trunk: {:.1} deg at most", run.excess_rad / DEGREE);
    assert!(run.excess_rad < 10.0 * DEGREE, "{}", run.excess_rad / DEGREE);
    assert!(run.after_rad < 12.0 * DEGREE, "{}", run.after_rad / DEGREE);
}

/// A step shakes a sensor on a thigh as hard as that: only that the knee does not go so far shows it.
#[test]
fn a_knock_on_a_leg_turns_it_no_further_than_a_knee_may_be_off() {
    let run = knocked(Segment::LeftThigh);
    assert_eq!(of_thigh(&run), [Some(Why::Range)], "until its heading is mended");
    eprintln!("knock on a thigh: {:.1} deg at most", run.excess_rad / DEGREE);
    assert!(run.excess_rad < 32.0 * DEGREE, "{}", run.excess_rad / DEGREE);
}

#[test]
fn a_sensor_that_stands_still_leaves_its_segment_where_it_is_and_is_taken_up_again_slowly() {
    let stuck = |t: f64| (8.0..10.0).contains(&t);
    let at = walk(8.0).to_pose(DVec3::ZERO, DQuat::from_rotation_z(1.6));
    let at = at.orientation[Segment::LeftThigh.index()];
    let run = run([true; 13], |t, segment, said| match segment == Segment::LeftThigh && stuck(t) {
        true => (at, true),
        false => (said, false),
    });
    assert_eq!(of_thigh(&run), [Some(Why::Stuck), None]);
    let back_s = run.changes[1].0;
    assert!((10.45..10.8).contains(&back_s), "{back_s}");
    eprintln!("stuck: {:.1} deg at most", run.excess_rad / DEGREE);
    assert!(run.excess_rad < 10.0 * DEGREE && run.after_rad < 1e-6, "{}", run.excess_rad / DEGREE);
}

/// No filter can tell such a bias from a turn: the knee can.
#[test]
fn a_heading_that_runs_away_is_stopped_where_the_knee_cannot_follow() {
    let run = run([true; 13], |t, segment, said| {
        let turned = if segment == Segment::LeftThigh { 0.2 * (t - 8.0).max(0.0) } else { 0.0 };
        (DQuat::from_rotation_z(turned) * said, false)
    });
    assert_eq!(
        run.changes.first().map(|(_, change)| (change.segment, change.doubted)),
        Some((Segment::LeftThigh, Some(Why::Range))),
        "{:?}",
        run.changes
    );
    eprintln!("bias: {:.1} deg at most", run.excess_rad / DEGREE);
    assert!(run.excess_rad < 35.0 * DEGREE, "{}", run.excess_rad / DEGREE);
}

/// For `lasts_s` sensors measure `force`, each in the world; who was doubted, why and when, and who was taken up again.
fn weighed(
    doubts: &mut Doubts,
    lasts_s: f64,
    force: impl Fn(f64, Segment) -> Option<DVec3>,
) -> Vec<(f64, Segment, Option<Why>)> {
    let mut found = Vec::new();
    for n in 0..(lasts_s * RATE_HZ) as u32 {
        let t = f64::from(n) / RATE_HZ;
        for segment in Segment::ALL {
            doubts.weigh(segment, force(t, segment), 1.0 / RATE_HZ);
        }
        let changes = doubts.judge(1.0 / RATE_HZ);
        found.extend(changes.iter().map(|change| (t, change.segment, change.doubted)));
    }
    found
}

/// Somebody who walks: each limb is pulled to and fro, by half of what it weighs.
fn pulled(t: f64) -> DVec3 {
    let swing = (core::f64::consts::TAU * t).sin();
    DVec3::new(5.0 * swing, 2.0 * swing, 9.8 + 4.0 * swing * swing - 2.0)
}

#[test]
fn a_sensor_whose_down_is_elsewhere_is_doubted_until_it_is_not() {
    let mut doubts = Doubts::default();
    assert_eq!(weighed(&mut doubts, 60.0, |t, _| Some(pulled(t))), []);
    // As a gyroscope makes it that says 0.2 rad/s beside what is: the filter is three seconds late.
    let tilted = |t: f64, segment: Segment| {
        let off = if segment == Segment::LeftThigh { 0.2 * t.min(3.0) } else { 0.0 };
        Some(DQuat::from_rotation_y(off) * pulled(t))
    };
    let found = weighed(&mut doubts, 10.0, tilted);
    assert_eq!(found.len(), 1, "{found:?}");
    assert_eq!((found[0].1, found[0].2), (Segment::LeftThigh, Some(Why::Gravity)));
    assert!((1.0..3.0).contains(&found[0].0), "{found:?}");
    let found = weighed(&mut doubts, 10.0, |t, _| Some(pulled(t)));
    assert_eq!(found.len(), 1, "{found:?}");
    assert_eq!((found[0].1, found[0].2), (Segment::LeftThigh, None));
}

#[test]
fn what_all_measure_is_how_they_are_carried_and_no_fault_and_silence_is_none() {
    let mut doubts = Doubts::default();
    let lift = |t: f64| if (10.0..14.0).contains(&t) { DVec3::Z * 4.0 } else { DVec3::ZERO };
    assert_eq!(weighed(&mut doubts, 30.0, |t, _| Some(pulled(t) + lift(t))), []);
    // One alone that measures it is doubted.
    let alone = |t: f64, segment: Segment| {
        Some(pulled(t) + if segment == Segment::Head { lift(t) } else { DVec3::ZERO })
    };
    let found = weighed(&mut Doubts::default(), 30.0, alone);
    let found: Vec<_> = found.iter().map(|found| (found.1, found.2)).collect();
    assert_eq!(found, [(Segment::Head, Some(Why::Gravity)), (Segment::Head, None)]);
    assert_eq!(weighed(&mut doubts, 10.0, |_, _| None), []);
    let nan = |_: f64, _: Segment| Some(DVec3::splat(f64::NAN));
    assert_eq!(weighed(&mut doubts, 10.0, nan), []);
}

/// A sensor that is turned on as nobody turns is tilted as well afterwards, until the filter has found down again.
#[test]
fn after_a_knock_a_segment_waits_until_its_sensor_has_found_down_again_and_not_for_ever() {
    // A tilt after a knock at 10 s, with what a filter of 3 s leaves of it; and one that stays.
    let waits_s = |tilt_deg: f64, finds_down_s: f64, pulled_m_s2: f64| {
        let mut doubts = Doubts::default();
        let tilt_rad = |t: f64| tilt_deg * DEGREE * (-(t - 10.0).max(0.0) / finds_down_s).exp();
        let turned = |t: f64| match t < 10.0 {
            true => DQuat::IDENTITY,
            false => DQuat::from_rotation_z(1.0) * DQuat::from_rotation_y(tilt_rad(t)),
        };
        let mut released_s = None;
        for n in 0..3000_u64 {
            let t = n as f64 / RATE_HZ;
            let taken = Instant::from_nanos(n * 10_000_000 + 1);
            for segment in [Segment::Pelvis, Segment::Torso, Segment::Head] {
                let said = if segment == Segment::Torso { turned(t) } else { DQuat::IDENTITY };
                doubts.hear(segment, said, taken, false);
                // It is shaken seven times a second.
                let pull = DVec3::X * pulled_m_s2 * (7.3 * core::f64::consts::TAU * t).sin();
                doubts.weigh(segment, Some(said * DVec3::Z * 9.81 + pull), 1.0 / RATE_HZ);
            }
            let changes = doubts.judge(1.0 / RATE_HZ);
            let released = changes.iter().any(|change| change.doubted.is_none());
            released_s = released_s.or(released.then_some(t - 10.0));
        }
        released_s
    };
    for (waits_s, range_s) in [
        (waits_s(0.0, 3.0, 0.0), 1.2..1.3),
        // 12 degrees are 4 after 3.3 s, and the mean of them a little later.
        (waits_s(12.0, 3.0, 0.0), 3.3..5.5),
        // Of 14 degrees that stay nobody knows whether they are a tilt, where somebody moves.
        (waits_s(14.0, f64::INFINITY, 18.0), 8.0..8.1),
    ] {
        assert!(waits_s.is_some_and(|waits_s| range_s.contains(&waits_s)), "{waits_s:?}");
    }
    // Of who hardly moves it is known: what lies 8 degrees off for good is not down.
    assert_eq!(waits_s(8.0, f64::INFINITY, 0.0), None);
}

/// Two sensors are nobody to compare with: weight is.
#[test]
fn who_wears_two_sensors_is_weighed_alone() {
    let mut doubts = Doubts::default();
    let two = |t: f64, segment: Segment| match segment {
        Segment::LeftUpperArm => Some(pulled(t)),
        Segment::LeftForearm => Some(1.3 * pulled(t)),
        _ => None,
    };
    let found = weighed(&mut doubts, 20.0, two);
    assert_eq!(found.len(), 1, "{found:?}");
    assert_eq!((found[0].1, found[0].2), (Segment::LeftForearm, Some(Why::Gravity)));
}
