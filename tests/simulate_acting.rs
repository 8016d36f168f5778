//! A virtual person who does what is asked as it is asked: pose after pose, wherever the body is by then.

use gaitway::body::worn::Movement;
use gaitway::body::worn::check::{restless, t_pose};
use gaitway::body::{Dof, JointAngles, Segment};
use gaitway::job::simulate::acting::{Act, Acting, Stays};
use gaitway::job::simulate::person::RATE_HZ;
use gaitway::mocap::anatomy::Capture;
use gaitway_sim::imu::SegmentAt;
use glam::{DQuat, DVec3};
use std::sync::Arc;

/// Number of the next pose.
fn next(person: &Acting) -> u64 {
    (person.next_s() * RATE_HZ).round() as u64
}

/// There and back.
fn swing(time: f64) -> f64 {
    0.5 * (1.0 - (std::f64::consts::TAU * time).cos())
}

fn somebody(act: Act) -> Acting {
    Acting::new(1.75, act).expect("a stature")
}

fn turned(at: SegmentAt) -> DQuat {
    let [w, x, y, z] = at.orientation;
    DQuat::from_xyzw(x, y, z, w)
}

fn overhead() -> Arc<Capture> {
    let mut angles = JointAngles::default();
    let poses = (0..120).map(|n| {
        angles[Dof::LeftShoulderFlexion] = 3.3 * swing(f64::from(n) / 119.0);
        angles[Dof::RightShoulderAbduction] = 2.9 * swing(f64::from(n) / 119.0);
        angles.to_pose(DVec3::new(0.01 * f64::from(n), 0.0, 1.0), DQuat::from_rotation_z(0.7))
    });
    Arc::new(Capture { poses: poses.collect(), ..standing_capture() })
}

fn standing_capture() -> Capture {
    let (capture, _) = gaitway::job::source::body_motion("bow", None, &Default::default())
        .expect("a shipped action");
    capture
}

/// Whatever is asked and whenever, also in the middle of something else, no segment jumps: neither where it is, nor how fast
/// it turns.
#[test]
fn wherever_the_body_is_it_goes_over_smoothly_into_what_is_asked() {
    let acts = [
        Act::Stay(Stays::TPose),
        Act::Repeat(overhead(), 0.2),
        Act::Stay(Stays::Sit),
        Act::Move(Movement::Bend),
        Act::Table,
        Act::Repeat(overhead(), 0.0),
        Act::Stay(Stays::ArmsForward),
        Act::Move(Movement::RaiseArms),
        Act::Stay(Stays::NPose),
        Act::Move(Movement::Bow),
        Act::Move(Movement::SitToStand),
    ];
    let mut person = somebody(Act::Table);
    let (mut number, mut random) = (0_u64, 7_u64);
    let mut before: [Vec<SegmentAt>; 13] = Default::default();
    for round in 0..60_u64 {
        person.does(acts[(round * 7 % 11) as usize].clone());
        if round % 5 == 0 {
            person.stumbles(round as f64);
        }
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        for _ in 0..20 + (random >> 33) % 400 {
            for segment in Segment::ALL {
                let at = person.at(number, segment);
                let past = &mut before[segment.index()];
                if let [.., two, one] = past[..] {
                    let step = |a: SegmentAt, b: SegmentAt| {
                        let q = turned(a).inverse() * turned(b);
                        (if q.w < 0.0 { -q } else { q }).to_scaled_axis() * RATE_HZ
                    };
                    let (was, is) = (step(two, one), step(one, at));
                    assert!(is.length() < 20.0, "{segment:?} turns by {is} rad/s");
                    let change = (is - was).length() * RATE_HZ;
                    assert!(change < 350.0, "round {round}, {segment:?}: {change} rad/s^2");
                    let way = |a: SegmentAt, b: SegmentAt| {
                        DVec3::from_array(b.position_m) - DVec3::from_array(a.position_m)
                    };
                    let change = (way(one, at) - way(two, one)).length() * RATE_HZ * RATE_HZ;
                    assert!(change < 120.0, "round {round}, {segment:?}: {change} m/s^2");
                }
                past.push(at);
            }
            number += 1;
        }
    }
}

#[test]
fn what_is_held_is_what_was_asked_for_as_long_as_it_is_asked() {
    let mut person = somebody(Act::Table);
    for (stays, angles) in [(Stays::TPose, t_pose()), (Stays::NPose, JointAngles::default())] {
        person.does(Act::Stay(stays));
        let from = next(&person);
        let wanted = angles.to_pose(DVec3::ZERO, DQuat::IDENTITY);
        let held_from = from + (1.3 * RATE_HZ) as u64;
        let mut said = vec![Vec::new(); 13];
        for number in from..from + 1200 {
            for segment in Segment::ALL {
                let q = turned(person.at(number, segment));
                if number >= held_from {
                    said[segment.index()].push(q);
                }
            }
        }
        assert_eq!(restless(&said), None);
        for segment in Segment::ALL {
            let off = said[segment.index()][0].angle_between(wanted.orientation[segment.index()]);
            assert!(off < 1e-6, "{segment:?} is {off} rad off in {stays:?}");
        }
    }
}

/// Sensors that lie are all turned alike, whoever comes first makes the poses, and the same requests before the same poses
/// make the same motion.
#[test]
fn the_same_requests_make_the_same_motion_whichever_sensor_asks_first() {
    let run = |order: [Segment; 13], at_once: u64| {
        let mut person = somebody(Act::Table);
        let mut seen: Vec<[SegmentAt; 13]> = Vec::new();
        for asked in [Act::Stay(Stays::NPose), Act::Move(Movement::Bow), Act::Stay(Stays::Sit)] {
            person.does(asked);
            let from = next(&person);
            for first in (from..from + 240).step_by(at_once as usize) {
                let last = (first + at_once - 1).min(from + 239);
                let _ = order.map(|segment| person.at(last, segment));
                for number in first..=last {
                    seen.push(Segment::ALL.map(|segment| person.at(number, segment)));
                }
            }
        }
        seen
    };
    let mut backwards = Segment::ALL;
    backwards.reverse();
    let one = run(Segment::ALL, 1);
    assert!(one == run(backwards, 13));
    let lying = one[0][0].orientation;
    assert!(one[0].iter().all(|at| at.orientation == lying));
    assert!((turned(one[0][4]) * DVec3::X).distance(DVec3::Z) < 1e-9, "on its back");
}

#[test]
fn sensors_that_changed_places_feel_what_the_other_segment_does() {
    let mut person = somebody(Act::Stay(Stays::NPose));
    let mut twin = somebody(Act::Stay(Stays::NPose));
    person.swaps(Segment::LeftShank, Segment::RightThigh);
    for person in [&mut person, &mut twin] {
        let _ = person.at(200, Segment::Head);
        person.does(Act::Move(Movement::Bend));
    }
    let mut moved = 0.0_f64;
    for number in 201..900 {
        let is = person.at(number, Segment::LeftShank);
        let other = twin.at(number, Segment::RightThigh);
        assert_eq!(is.position_m, other.position_m);
        assert!(turned(is).angle_between(turned(other)) < 1e-6);
        assert_eq!(person.at(number, Segment::Head), twin.at(number, Segment::Head));
        moved = moved.max(turned(is).angle_between(DQuat::IDENTITY));
    }
    assert!(moved > 0.4, "the right thigh moved: {moved}");
}

/// Rounds of an action follow one another where the body is by then, and who is asked to stand stands there.
#[test]
fn an_action_is_done_again_from_where_it_ended() {
    let mut person = somebody(Act::Stay(Stays::NPose));
    let _ = person.at(10, Segment::Pelvis);
    // Its first pose is turned by 0.7 rad, and it goes 1.19 m against that.
    person.does(Act::Repeat(overhead(), 1.0));
    let round_s = 119.0 / standing_capture().rate_hz + 3.0 * 0.8 + 0.5;
    let end = 11 + ((1.0 + 2.0 * round_s) * RATE_HZ) as u64;
    let pelvis = person.at(end, Segment::Pelvis);
    let gone = DVec3::from_array(pelvis.position_m) * DVec3::new(1.0, 1.0, 0.0);
    let wanted = DQuat::from_rotation_z(-0.7) * DVec3::X * (2.0 * 1.19);
    assert!(gone.distance(wanted) < 0.02, "{gone} is not {wanted}");
    assert!(turned(pelvis).angle_between(DQuat::IDENTITY) < 1e-6, "it faces as before");
    person.does(Act::Stay(Stays::NPose));
    let stood = DVec3::from_array(person.at(end + 600, Segment::Pelvis).position_m);
    assert!((stood * DVec3::new(1.0, 1.0, 0.0)).distance(gone) < 0.05, "{stood}");
}

/// What the guide of a calibration waits for: the segments that a movement turns turn, their far ends forward where it says
/// so, and all are back where they stood.
#[test]
fn movements_turn_what_they_are_asked_to_turn() {
    for movement in Movement::ALL {
        let mut person = somebody(Act::Stay(Stays::NPose));
        let _ = person.at(10, Segment::Pelvis);
        person.does(Act::Move(movement));
        let end = 11 + ((1.2 + 0.9 + 3.3) * RATE_HZ) as u64;
        let mut most = [0.0_f64; 13];
        for number in 11..end {
            for segment in Segment::ALL {
                let about_y = turned(person.at(number, segment)).to_scaled_axis().y;
                let most = &mut most[segment.index()];
                *most = if about_y.abs() > most.abs() { about_y } else { *most };
            }
        }
        for (segment, sign) in movement.turns() {
            assert!(most[segment.index()] * sign > 0.5, "{movement:?}: {segment:?} {most:?}");
        }
        for segment in Segment::ALL {
            let off = turned(person.at(end + 60, segment)).angle_between(DQuat::IDENTITY);
            assert!(off < 1e-6, "{movement:?}: {segment:?} is not back: {off}");
        }
    }
}
