//! The printed forms: an actionlet (Zheng et al. 2007, Eq. 1, integrated), and a clock that gains
//! or loses its speed as half of one.

use gaitway::action::Motion;
use gaitway::actionlet::Shape;
use gaitway::body::Dof;
use std::f64::consts::{FRAC_PI_2, PI};

/// Part of the way gone at the part `u` of the time, when speed peaks at `t`: 2 S(u).
fn gone(u: f64, t: f64) -> f64 {
    let u = u.clamp(0.0, 1.0);
    if u <= t {
        u - t / PI * (PI * u / t).sin()
    } else {
        u + (1.0 - t) / PI * (PI * (u - t) / (1.0 - t)).sin()
    }
}

/// From 0 to 1 in so many seconds, speed peaking in the middle.
pub fn middle(time_s: f64, lasts_s: f64) -> f64 {
    if lasts_s > 0.0 { gone(time_s / lasts_s, 0.5) } else { 1.0 }
}

/// The angle of a degree of freedom at a time of its action, rad.
pub fn angle_rad(motion: &Motion, dof: Dof, time_s: f64) -> f64 {
    let track = motion.track(dof);
    let Some(piece) = track.actionlets().iter().find(|piece| time_s <= piece.end_s()) else {
        return track.to_rad();
    };
    match piece.shape() {
        _ if time_s <= piece.begin_s() => piece.from_rad(),
        Shape::HalfSine(peak) => {
            let u = (time_s - piece.begin_s()) / piece.duration_s();
            piece.from_rad() + (piece.to_rad() - piece.from_rad()) * gone(u, peak.value())
        }
        Shape::MinimumJerk | Shape::Sampled(_) => piece.at(time_s).position_rad,
    }
}

/// Time that a clock shows which gains its speed in `ease_s`: its rate is half an actionlet's
/// speed, `(1 - cos(pi t / D)) / 2`.
fn gained_s(time_s: f64, ease_s: f64) -> f64 {
    let time_s = time_s.max(0.0);
    if time_s >= ease_s {
        return time_s - ease_s / 2.0;
    }
    time_s / 2.0 - ease_s / (2.0 * PI) * (PI * time_s / ease_s).sin()
}

/// A clock that runs through a clip of `clip_s`, gaining its speed in the first and losing it in
/// the second of `eases_s`.
pub fn clip_clock_s(time_s: f64, clip_s: f64, eases_s: [f64; 2]) -> f64 {
    let [gains_s, loses_s] = eases_s;
    let left_s = clip_s + gains_s / 2.0 + loses_s / 2.0 - time_s;
    if left_s < loses_s {
        clip_s - gained_s(left_s, loses_s)
    } else {
        gained_s(time_s, gains_s).min(clip_s)
    }
}

/// A clock that runs until `stop_s` and loses its speed in `ramp_s` then.
pub fn stopped_clock_s(time_s: f64, stop_s: f64, ramp_s: f64) -> f64 {
    let since_s = time_s - stop_s;
    if since_s <= 0.0 {
        return time_s;
    }
    let since_s = since_s.min(ramp_s);
    stop_s + since_s / 2.0 + ramp_s / (2.0 * PI) * (PI * since_s / ramp_s).sin()
}

/// Time in which the half form loses a speed at a greatest deceleration: its peak is pi v / (2 D).
pub fn half_form_s(velocity_rad_s: f64, acceleration_rad_s2: f64) -> f64 {
    FRAC_PI_2 * velocity_rad_s / acceleration_rad_s2
}
