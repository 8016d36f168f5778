use super::super::Solver;
use super::super::online::Floor;
use super::super::tests::{Op3, op3};
use super::*;
use crate::rigid::ground::SupportPolygon;
use glam::DVec2;

/// Poses per second of the clips here.
const RATE_HZ: f64 = 60.0;

/// Two seconds in which an OP3 draws its left leg up within 0.1 s, holds it for a second, and puts it down again.
fn leg_drawn_up(op3: &Op3) -> Vec<Vec<f64>> {
    let mut series: Vec<Vec<f64>> = op3.start_rad.iter().map(|rad| vec![*rad; 121]).collect();
    for (name, share) in [("l_hip_pitch", -0.5), ("l_knee", 1.0), ("l_ank_pitch", 0.5)] {
        for (at, angle) in series[op3.joint(name)].iter_mut().enumerate() {
            let time_s = at as f64 / RATE_HZ;
            let up =
                ((time_s - 0.4) / 0.1).clamp(0.0, 1.0) - ((time_s - 1.5) / 0.1).clamp(0.0, 1.0);
            *angle += 0.5 * share * up;
        }
    }
    series
}

fn moved(op3: &Op3, series: &[Vec<f64>], feet_may: FeetMay, speed: f64) -> Waited {
    let free = vec![true; op3.start_rad.len()];
    let velocity_rad_s = vec![4.8; free.len()];
    let footfalls = vec![Footfall::STANDING; series[0].len()];
    waited(op3.adjustable(&free), &velocity_rad_s, series, &footfalls, [RATE_HZ, speed], feet_may)
        .expect("splines")
        .expect("it stands")
}

/// How high each sole is over the lower one, m, and how far inside those on the floor the centre of mass is, m, pose by pose.
fn on_floor(op3: &Op3, of: &Waited) -> Vec<([f64; 2], f64)> {
    let free = vec![true; op3.start_rad.len()];
    let solver = Solver::new(op3.adjustable(&free));
    let soles = solver.feet().expect("two feet");
    (0..of.clock.len())
        .map(|at| {
            let pose: Vec<f64> = of.angles_rad.iter().map(|series| series[at]).collect();
            let floor = Floor::of(&solver, soles, &solver.place(&pose), DVec3::Z);
            let stands = floor.height_m.map(|height_m| height_m < 0.003);
            let by = usize::from(!stands[0]);
            let on = floor.soles_m[by].iter().zip(stands).filter(|(_, stands)| *stands);
            let corners: Vec<DVec2> = on.flat_map(|(sole, _)| sole.iter().copied()).collect();
            let centre_m = floor.centre_m[by].truncate();
            let inside_m = SupportPolygon::of(&corners).margin_m(centre_m).expect("a sole");
            (floor.height_m, inside_m)
        })
        .collect()
}

#[test]
fn the_person_waits_until_the_weight_is_over_the_other_foot_and_the_whole_clip_is_done() {
    let op3 = op3();
    let series = leg_drawn_up(&op3);
    for speed in [1.0, 0.5] {
        let of = moved(&op3, &series, FeetMay::Step, speed);
        assert_eq!(of.lifts, Lifts { lifted: 1, kept_down: 0 }, "{speed}");
        // From the pose it starts in, and all of it, never backwards.
        for (series, start_rad) in of.angles_rad.iter().zip(&op3.start_rad) {
            assert!((series[0] - start_rad).abs() < 1e-3, "{speed}");
        }
        assert!(of.clock.is_sorted(), "{speed}");
        assert_eq!((of.clock[0], of.clock.last()), (0.0, Some(&120.0)), "{speed}");
        // While the weight goes over the clip stands still, with the leg drawn up: it is down again from 1.5 s on.
        let stood = of.clock.windows(2).filter(|two| two[1] - two[0] < 0.05);
        let stood: Vec<f64> =
            stood.map(|two| two[0]).filter(|at| (24.0..90.0).contains(at)).collect();
        assert!(stood.len() as f64 > 0.4 * RATE_HZ * speed, "{speed}: {}", stood.len());
        let on_floor = on_floor(&op3, &of);
        let highest_m = on_floor.iter().map(|(height_m, _)| height_m[0]).fold(0.0, f64::max);
        assert!(highest_m > 0.01, "{speed}: {highest_m}");
        for (at, (height_m, inside_m)) in on_floor.iter().enumerate() {
            assert!(*inside_m > 0.008, "{speed}, {at}: {inside_m}");
            assert!(height_m[1] < 0.003, "{speed}, {at}: {height_m:?}");
        }
        let (last, _) = on_floor.last().expect("poses");
        assert!(last[0] < 0.003, "{speed}: {last:?}");
        // What is said of the feet is what they do.
        let alone = of.footfalls.iter().filter(|of| of.touches == Some([false, true])).count();
        assert!(alone as f64 > RATE_HZ * speed, "{speed}: {alone}");
    }
}

#[test]
fn feet_that_may_not_step_stay_and_the_rest_is_done() {
    let op3 = op3();
    let mut series = leg_drawn_up(&op3);
    let elbow = op3.joint("l_el");
    // Slowly: while an arm is still on its way to the first pose no foot is lifted anyhow.
    series[elbow].iter_mut().enumerate().for_each(|(at, angle)| *angle = -0.003 * at as f64);
    let of = moved(&op3, &series, FeetMay::Stay, 1.0);
    assert_eq!(of.lifts, Lifts::default());
    assert!(of.footfalls.iter().all(|of| of.touches == Some([true; 2])));
    for (at, (height_m, inside_m)) in on_floor(&op3, &of).iter().enumerate() {
        assert!(height_m[0].max(height_m[1]) < 0.003, "{at}: {height_m:?}");
        assert!(*inside_m > 0.008, "{at}: {inside_m}");
    }
    let went = of.angles_rad[elbow].last().expect("poses");
    assert!((went + 0.36).abs() < 0.02, "{went}");
}

#[test]
fn whoever_ends_on_one_foot_gets_the_other_one_back() {
    let op3 = op3();
    let mut series = leg_drawn_up(&op3);
    series.iter_mut().for_each(|series| series.truncate(80));
    let of = moved(&op3, &series, FeetMay::Step, 1.0);
    assert_eq!(of.lifts.lifted, 1);
    let on_floor = on_floor(&op3, &of);
    let (last, _) = on_floor.last().expect("poses");
    assert!(last[0].max(last[1]) < 0.003, "{last:?}");
}

#[test]
fn what_has_no_poses_is_not_moved() {
    let op3 = op3();
    let free = vec![true; op3.start_rad.len()];
    let velocity_rad_s = vec![4.8; free.len()];
    let of = op3.adjustable(&free);
    let none = waited(of, &velocity_rad_s, &[], &[], [RATE_HZ, 1.0], FeetMay::Step);
    assert_eq!(none.expect("nothing to do"), None);
}
