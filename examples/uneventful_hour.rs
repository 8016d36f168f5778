//! What the recogniser names in an hour in which nothing happens that a model knows: a table.
//!
//! ```text
//! cargo run --release --example uneventful_hour -- [--models DIR] MINUTES CLIP ...
//! ```
//!
//! Half of the time somebody stands and fidgets, which is made; the other half are the clips, one after the other with
//! transitions of half a second, then the same mirrored, slower and faster, until it is full. Strides count as right: people
//! walk in such clips. Anything else is false, and told with the clips that it is in.

use gaitway::Error;
use gaitway::body::{BodyFigure, Dof, JointAngles, Proportions, SegmentPose, root};
use gaitway::job::recognise::models;
use gaitway::job::source::{CaptureOptions, body_motion};
use gaitway::mocap::anatomy::Capture;
use gaitway::recognise::machine::ActionEvent;
use gaitway::recognise::model::ActionModel;
use gaitway::recognise::points::{Lengths, Points};
use gaitway::recognise::posture::EquationReading;
use gaitway::recognise::stream::Recogniser;
use glam::{DQuat, DVec3};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

const RATE_HZ: f64 = 60.0;
const TRANSITION_S: f64 = 0.5;
const STATURE_M: f64 = 1.75;
/// Share of the clips' own speed, and whether they are mirrored, round by round.
const ROUNDS: [(f64, bool); 6] =
    [(1.0, false), (1.0, true), (0.85, false), (1.15, false), (0.85, true), (1.15, true)];

fn main() -> Result<(), Error> {
    let mut words: Vec<String> = std::env::args().skip(1).collect();
    let mut folder = None;
    if words.len() > 1 && words[0] == "--models" {
        folder = Some(PathBuf::from(words.remove(1)));
        words.remove(0);
    }
    let models = models(folder.as_deref())?;
    let minutes = words.first().and_then(|word| word.parse::<f64>().ok());
    let Some(minutes) = minutes.filter(|_| words.len() > 1) else {
        return Err(Error::new("minutes and clips are wanted").allowed("MINUTES CLIP ..."));
    };
    let clips: Vec<Capture> = words[1..]
        .iter()
        .map(|clip| Ok(body_motion(clip, None, &CaptureOptions::default())?.0))
        .collect::<Result<_, Error>>()?;
    let half = (minutes * 30.0 * RATE_HZ) as usize;
    let own_s: f64 = clips.iter().map(|clip| clip.poses.len() as f64 / clip.rate_hz).sum();
    println!("{} clips, {:.1} min; {minutes} min in all", clips.len(), own_s / 60.0);
    let (frames, of_clip) = captured(&clips, half);
    let name = |frame: usize| {
        let clip = of_clip.get(frame).map_or("", |clip| words[1 + clip].as_str());
        Path::new(clip).file_stem().map_or_else(String::new, |stem| stem.display().to_string())
    };
    tell("clips", &models, &frames, &name, minutes / 2.0)?;
    tell("standing and fidgeting", &models, &fidgeting(half)?, &|_| String::new(), minutes / 2.0)
}

/// A frame: where the body is, and what of it is shown.
type Frame = (SegmentPose, [bool; 13]);

/// The clips one after the other, each from where the one before has ended, and which clip each frame is of.
fn captured(clips: &[Capture], frames: usize) -> (Vec<Frame>, Vec<usize>) {
    let mut out: Vec<Frame> = Vec::with_capacity(frames);
    let mut of_clip = Vec::with_capacity(frames);
    let body = Proportions::of_stature(STATURE_M).expect("a body");
    for (pace, is_mirrored) in ROUNDS.into_iter().cycle() {
        for (index, clip) in clips.iter().enumerate() {
            let mut clip = clip.clone();
            if is_mirrored {
                clip.mirror();
            }
            let length_s = clip.poses.len().saturating_sub(1) as f64 / clip.rate_hz / pace;
            let poses =
                (0..=(length_s * RATE_HZ) as usize).map(|n| clip.at(n as f64 / RATE_HZ * pace));
            let mut poses: Vec<SegmentPose> = poses.collect();
            let floor_m = poses
                .iter()
                .map(|pose| {
                    let at = body.positions(pose);
                    root::SOLES.map(|end| at.end_m(end).z).into_iter().fold(f64::MAX, f64::min)
                })
                .fold(f64::MAX, f64::min);
            let moved_m = out.last().map_or(DVec3::ZERO, |(last, _)| {
                (last.root_m - poses[0].root_m).truncate().extend(0.0)
            });
            for pose in &mut poses {
                pose.root_m += moved_m - DVec3::Z * floor_m;
            }
            if let Some((last, _)) = out.last().cloned() {
                let steps = (TRANSITION_S * RATE_HZ) as usize;
                out.extend((1..steps).map(|n| {
                    let share = n as f64 / steps as f64;
                    (last.towards(&poses[0], share * share * (3.0 - 2.0 * share)), clip.tracked)
                }));
            }
            out.extend(poses.into_iter().map(|pose| (pose, clip.tracked)));
            of_clip.resize(out.len(), index);
            if out.len() >= frames {
                out.truncate(frames);
                return (out, of_clip);
            }
        }
    }
    (out, of_clip)
}

/// Somebody who stands: breathes, sways, shifts weight, scratches, looks about.
fn fidgeting(frames: usize) -> Result<Vec<Frame>, Error> {
    // Degree of freedom, usual angle, deviation, and how long it stays about, deg and s.
    const MOVED: [(Dof, f64, f64, f64); 18] = [
        (Dof::TorsoFlexion, 2.0, 4.0, 3.0),
        (Dof::TorsoLateralBend, 0.0, 3.0, 3.0),
        (Dof::TorsoAxial, 0.0, 8.0, 3.0),
        (Dof::NeckFlexion, 5.0, 10.0, 2.0),
        (Dof::LeftShoulderFlexion, 5.0, 12.0, 2.0),
        (Dof::LeftShoulderAbduction, 8.0, 6.0, 2.0),
        (Dof::LeftShoulderRotation, 0.0, 15.0, 2.0),
        (Dof::LeftElbowFlexion, 35.0, 25.0, 2.0),
        (Dof::RightShoulderFlexion, 5.0, 12.0, 2.0),
        (Dof::RightShoulderAbduction, 8.0, 6.0, 2.0),
        (Dof::RightShoulderRotation, 0.0, 15.0, 2.0),
        (Dof::RightElbowFlexion, 35.0, 25.0, 2.0),
        (Dof::LeftHipFlexion, 3.0, 3.0, 4.0),
        (Dof::LeftHipAbduction, 3.0, 2.0, 4.0),
        (Dof::LeftKneeFlexion, 6.0, 5.0, 4.0),
        (Dof::RightHipFlexion, 3.0, 3.0, 4.0),
        (Dof::RightHipAbduction, 3.0, 2.0, 4.0),
        (Dof::RightKneeFlexion, 6.0, 5.0, 4.0),
    ];
    let body = Proportions::of_stature(STATURE_M)?;
    let mut chance = 0x9E37_79B9_7F4A_7C15_u64;
    let mut normal = move || {
        // Xorshift (Marsaglia 2003); a sum of twelve is near a normal distribution.
        let mut uniform = || {
            chance ^= chance << 13;
            chance ^= chance >> 7;
            chance ^= chance << 17;
            (chance >> 11) as f64 / (1u64 << 53) as f64
        };
        (0..12).map(|_| uniform()).sum::<f64>() - 6.0
    };
    // Twice a first-order low-pass of white noise: angles and speeds have no jumps.
    let mut state = [[0.0_f64; 2]; MOVED.len()];
    let mut poses = Vec::with_capacity(frames);
    for _ in 0..frames {
        let mut angles = JointAngles::default();
        for ((dof, usual, deviation, stays_s), [first, second]) in MOVED.iter().zip(&mut state) {
            let share = 3.0 / (stays_s * RATE_HZ);
            *first += share * (normal() * (2.0 / share).sqrt() - *first);
            *second += share * (*first - *second);
            angles[*dof] = (usual + deviation * std::f64::consts::SQRT_2 * *second).to_radians();
        }
        angles[Dof::LeftKneeFlexion] = angles[Dof::LeftKneeFlexion].max(0.0);
        angles[Dof::RightKneeFlexion] = angles[Dof::RightKneeFlexion].max(0.0);
        poses.push(angles.to_pose(DVec3::ZERO, DQuat::IDENTITY));
    }
    let roots_m = root::path_m(&body, &poses, RATE_HZ);
    let placed = poses.into_iter().zip(roots_m);
    Ok(placed.map(|(pose, root_m)| (SegmentPose { root_m, ..pose }, [true; 13])).collect())
}

fn tell(
    name: &str,
    models: &[ActionModel],
    frames: &[Frame],
    clip: &impl Fn(usize) -> String,
    minutes: f64,
) -> Result<(), Error> {
    let body = Proportions::of_figure(BodyFigure::DrillisContini, STATURE_M)?;
    let mut recogniser =
        Recogniser::new(models.to_vec(), Lengths::of(&body), EquationReading::Repaired, None);
    let mut found: BTreeMap<&str, BTreeMap<String, usize>> = BTreeMap::new();
    let mut hear = |index: usize, _, what| {
        if let ActionEvent::Done { span, .. } = what {
            let of = clip((span.end_s * RATE_HZ) as usize);
            *found.entry(&models[index].action).or_default().entry(of).or_default() += 1;
        }
    };
    for (pose, tracked) in frames {
        recogniser.next(&Points::of(&body, pose, tracked), 1.0 / RATE_HZ, &mut hear);
    }
    let strides = |action: &str| ["walk", "run"].contains(&action);
    let times = |of: &BTreeMap<String, usize>| of.values().sum::<usize>();
    let count: usize = found.iter().filter(|of| !strides(of.0)).map(|of| times(of.1)).sum();
    println!("{name}: {count} false in {minutes:.1} min, {:.2} a minute", count as f64 / minutes);
    for (action, of) in found {
        let clips = of.iter().map(|(clip, times)| format!("{clip} {times}"));
        let clips = match strides(action) {
            true => "right".to_owned(),
            false => clips.collect::<Vec<_>>().join(", "),
        };
        println!("  {:5} x {action} ({clips})", times(&of));
    }
    Ok(())
}
