//! How much of what is wrong is found: artefacts of known truth put into real trials, and trials in which nothing is
//! wrong. A hit is an artefact of that marker whose frames and the true ones share more than half of both together.

use super::captured::{bvh_files, captured};
use super::gaps::{Dice, HELD_OUT, is_long, read_trials, trials};
use super::made::noise;
use gaitway::body::proportions::proximal_joint;
use gaitway::body::{Proportions, Segment};
use gaitway::clean::artefact::{Artefact, ArtefactKind};
use gaitway::clean::detect;
use gaitway::clean::trial::Trial;
use gaitway::mocap::anatomy::Capture;
use gaitway::mocap::read_bvh;
use glam::DVec3;
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::ops::Range;

/// What is put in, with its size: mm of a jump or of shaking, s of sticking. Of each kind the second size and larger
/// ones are to be found, and what has no size.
const WRONG: [(ArtefactKind, f64, bool); 12] = [
    (ArtefactKind::Jump, 20.0, false),
    (ArtefactKind::Jump, 50.0, true),
    (ArtefactKind::Jump, 100.0, true),
    (ArtefactKind::Shake, 2.0, false),
    (ArtefactKind::Shake, 5.0, true),
    (ArtefactKind::Shake, 10.0, true),
    (ArtefactKind::Stuck, 0.1, false),
    (ArtefactKind::Stuck, 0.5, true),
    (ArtefactKind::Fallen, 0.0, true),
    (ArtefactKind::SwapAtStart, 0.0, true),
    (ArtefactKind::SwapInside, 0.0, true),
    (ArtefactKind::SwapAfterGap, 0.0, true),
];
/// Share of them that must be found.
const FOUND: f64 = 0.95;
/// Fewest minutes of trials in which nothing is wrong, and false alarms a minute in them.
const MINUTES: f64 = 30.0;
const MOST_A_MINUTE: f64 = 0.2;

/// The interval that holds a share with 95 % (Wilson, Journal of the American Statistical Association 22, 1927).
fn interval(hits: usize, count: usize) -> [f64; 2] {
    let (n, z) = (count as f64, 1.96);
    let share = hits as f64 / n;
    let middle = share + z * z / (2.0 * n);
    let half = z * (share * (1.0 - share) / n + z * z / (4.0 * n * n)).sqrt();
    [-half, half].map(|of| (middle + of) / (1.0 + z * z / n))
}

fn direction(dice: &mut Dice) -> DVec3 {
    loop {
        let side = DVec3::new(dice.share(), dice.share(), dice.share()) * 2.0 - 1.0;
        if (0.1..1.0).contains(&side.length()) {
            return side.normalize();
        }
    }
}

/// Puts something wrong into a trial; the marker, the one it is exchanged with, and the frames.
fn wrong(
    trial: &mut Trial,
    kind: ArtefactKind,
    size: f64,
    dice: &mut Dice,
) -> Option<(usize, Option<usize>, Range<usize>)> {
    let marker = dice.below(trial.markers());
    let frames = trial.frames();
    if !trial.is_seen_throughout(marker, 0..frames) {
        return None;
    }
    let mut within = |trial: &Trial, least_s: f64, more_s: f64, edge: usize| {
        let length = trial.frames_of(least_s + more_s * dice.share());
        let start = edge + dice.below(frames - length - 2 * edge);
        start..start + length
    };
    let put = |trial: &mut Trial, run: &Range<usize>, by: &dyn Fn(usize, DVec3) -> DVec3| {
        for frame in run.clone() {
            let place = trial.at(marker, frame).map(|place| by(frame, place));
            trial.put(marker, frame, place);
        }
    };
    match kind {
        ArtefactKind::Jump => {
            let run = within(trial, 0.1, 0.3, 10);
            let off = direction(dice) * size / 1e3;
            put(trial, &run, &|_, place| place + off);
            Some((marker, None, run))
        }
        ArtefactKind::Shake => {
            let run = within(trial, 0.2, 0.4, 10);
            let (off, hz) = (direction(dice) * size / 1e3, 10.0 + 20.0 * dice.share());
            let (phase, rate_hz) = (TAU * dice.share(), trial.rate_hz());
            let wave = |frame: usize| (phase + TAU * hz * frame as f64 / rate_hz).sin();
            put(trial, &run, &|frame, place| place + off * wave(frame));
            Some((marker, None, run))
        }
        ArtefactKind::Stuck => {
            let run = within(trial, size, 0.0, 10);
            let stands = trial.at(marker, run.start - 1)?;
            put(trial, &run, &|_, _| stands);
            Some((marker, None, run))
        }
        ArtefactKind::Fallen => {
            // It falls, drifting a little, onto the floor below the lowest marker, and lies there.
            let start = frames / 4 + dice.below(frames / 2);
            let from = trial.at(marker, start)?;
            let lowest = (0..trial.markers()).filter_map(|of| trial.at(of, start)).map(|of| of.z);
            let height = from.z - lowest.fold(f64::INFINITY, f64::min) + 0.03;
            let (drift, rate_hz) = (direction(dice) * 0.3, trial.rate_hz());
            let lands_s = (2.0 * height / 9.81).sqrt();
            put(trial, &(start..frames), &|frame, _| {
                let time_s = ((frame - start) as f64 / rate_hz).min(lands_s);
                let down = DVec3::Z * (4.905 * time_s * time_s);
                let noise = DVec3::Z * (1e-4 * (frame as f64 * 1.7).sin());
                DVec3::new(from.x + drift.x * time_s, from.y + drift.y * time_s, from.z) - down
                    + noise
            });
            Some((marker, None, start..frames))
        }
        _ => {
            let place = trial.at(marker, 0)?;
            let mut others: Vec<(f64, usize)> = (0..trial.markers())
                .filter(|of| *of != marker && trial.is_seen_throughout(*of, 0..frames))
                .filter_map(|of| Some((trial.at(of, 0)?.distance(place), of)))
                .collect();
            others.sort_by(|a, b| a.0.total_cmp(&b.0));
            let other = others[dice.below(2)].1;
            let length = trial.frames_of(0.2 + 0.6 * dice.share());
            let run = match kind {
                ArtefactKind::SwapAtStart => 0..length,
                _ => {
                    let start = 20 + dice.below(frames - length - 40);
                    start..start + length
                }
            };
            trial.exchange(marker, other, run.clone());
            if kind == ArtefactKind::SwapAfterGap {
                let gap = trial.frames_of(0.1);
                trial.take_out(marker, run.start - gap..run.start);
            }
            Some((marker, Some(other), run))
        }
    }
}

fn shares_half(one: &Range<usize>, other: &Range<usize>) -> bool {
    let both = one.end.min(other.end).saturating_sub(one.start.max(other.start));
    2 * both > one.end.max(other.end) - one.start.min(other.start)
}

fn found_in(trial: &Trial) -> Vec<Artefact> {
    let found = detect::artefacts(trial, |_, _| {});
    found.into_iter().filter(|of| of.kind != ArtefactKind::Dropout).collect()
}

#[test]
fn what_is_wrong_is_found_in_real_trials_and_nothing_where_nothing_is() {
    let Some(trials) = trials() else { return };
    let count = if is_long() { 200 } else { 40 };
    println!("| trial | artefact | size | found | 95 % | rightly named | others |");
    for (name, whole) in trials {
        assert_eq!(found_in(&whole), [], "{name} has nothing wrong");
        for (kind, size, is_aim, hits) in put_in_and_found(name, &whole, count) {
            assert!(
                !is_aim || hits as f64 >= FOUND * count as f64,
                "{name}: {} of {size}: {hits} of {count} found",
                kind.word()
            );
        }
    }
}

/// Trials that nobody looked at: what is told is written down, and most of it is found.
#[test]
fn most_that_is_wrong_is_found_in_trials_that_nobody_looked_at() {
    if !is_long() {
        println!("SKIPPED: minutes, and therefore where GAITWAY_LONG is set");
        return;
    }
    let Some(trials) = read_trials("mocap/c3d", &HELD_OUT) else { return };
    let count = 20;
    println!("| trial | artefact | size | found | 95 % | rightly named | others |");
    let (mut all, mut found) = (0, 0);
    for (name, whole) in trials {
        for artefact in found_in(&whole) {
            let (kind, frames) = (artefact.kind.word(), artefact.frames);
            println!(
                "{name} as it is: {kind} of {} in {frames:?}",
                whole.labels()[artefact.marker]
            );
        }
        for (_, _, _, hits) in put_in_and_found(name, &whole, count).iter().filter(|of| of.2) {
            all += count;
            found += hits;
        }
    }
    println!("{found} of {all} of the second size and up");
    assert!(3 * found > 2 * all, "{found} of {all}");
}

/// What is put into a trial, its size, whether it is to be found, and how many were.
fn put_in_and_found(
    name: &str,
    whole: &Trial,
    count: usize,
) -> Vec<(ArtefactKind, f64, bool, usize)> {
    let own = found_in(whole).len();
    let mut table = Vec::new();
    for (kind, size, is_aim) in WRONG {
        let mut dice = Dice(0x9e37_79b9_7f4a_7c15);
        let (mut done, mut hits, mut named, mut others) = (0, 0, 0, 0);
        let mut thrown = 0;
        while done < count && thrown < 200 * count {
            thrown += 1;
            let mut trial = whole.clone();
            let put = wrong(&mut trial, kind, size, &mut dice);
            let Some((marker, with, run)) = put else { continue };
            done += 1;
            let found = found_in(&trial);
            let is_pair = |of: &Artefact| {
                let pair = [Some(of.marker), of.with];
                pair.contains(&Some(marker)) && (with.is_none() || pair.contains(&with))
            };
            let hit: Vec<&Artefact> =
                found.iter().filter(|of| is_pair(of) && shares_half(&of.frames, &run)).collect();
            hits += usize::from(!hit.is_empty());
            named += usize::from(hit.iter().any(|of| of.kind == kind));
            others += (found.len() - hit.len()).saturating_sub(own);
        }
        if done < count {
            println!("| {name} | {} | {size} | nowhere to be put |", kind.word());
            continue;
        }
        let [from, to] = interval(hits, count).map(|share| 100.0 * share);
        println!(
            "| {name} | {} | {size} | {hits}/{count} | {from:.0} to {to:.0} | {named} | {others} |",
            kind.word()
        );
        table.push((kind, size, is_aim, hits));
    }
    table
}

/// Three markers on each segment of a captured body, m: 0.3 mm of noise, and skin that moves by 2 mm, slowly.
fn virtual_markers(capture: &Capture, seed: u64) -> Option<Trial> {
    let body = Proportions::of_stature(1.7).ok()?;
    let labels = Segment::ALL.iter().flat_map(|of| (0..3).map(move |n| format!("{of:?}-{n}")));
    let mut trial = Trial::new(capture.rate_hz, labels.collect(), capture.poses.len())?;
    for (frame, pose) in capture.poses.iter().enumerate() {
        let positions = body.positions(pose);
        let time_s = frame as f64 / capture.rate_hz;
        for (at, segment) in Segment::ALL.into_iter().enumerate() {
            for n in 0..3 {
                let marker = 3 * at + n;
                let chance = |of: u64| noise(seed << 40 ^ (marker as u64) << 20 ^ of);
                let side = TAU * (n as f64 + 0.3 * chance(0)) / 3.0;
                let along = if segment == Segment::Torso { 0.3 } else { -0.25 };
                let own = DVec3::new(
                    0.07 * side.cos(),
                    0.07 * side.sin(),
                    along * (0.2 + 0.35 * n as f64),
                );
                let skin = |of: u64| {
                    0.002 * (TAU * ((1.0 + 0.5 * chance(of)) * time_s + chance(of + 1))).sin()
                };
                let skin = DVec3::new(skin(1), skin(3), skin(5));
                let shaken = |of: u64| 3e-4 * chance(of << 16 ^ frame as u64);
                let shaken = DVec3::new(shaken(1), shaken(2), shaken(3));
                let origin = positions.joint_m(proximal_joint(segment));
                let place = origin + pose.orientation[segment.index()] * (own + skin) + shaken;
                trial.put(marker, frame, Some(place));
            }
        }
    }
    Some(trial)
}

#[test]
fn virtual_markers_on_captured_bodies_give_few_false_alarms() {
    let Some(folder) = captured("mocap/bvh") else { return };
    let seeds = if is_long() { 1..11 } else { 1..5 };
    let (mut minutes, mut alarms, mut trials) = (0.0, BTreeMap::new(), 0);
    for file in bvh_files(&folder) {
        let Ok(capture) = read_bvh(&file, None) else { continue };
        for seed in seeds.clone() {
            let Some(trial) = virtual_markers(&capture, seed) else { continue };
            minutes += trial.frames() as f64 / trial.rate_hz() / 60.0;
            trials += 1;
            let found = found_in(&trial);
            if !found.is_empty() {
                println!("{}: {}", file.display(), found.len());
            }
            for artefact in found {
                *alarms.entry(artefact.kind.word()).or_insert(0) += 1;
            }
        }
    }
    let all: i32 = alarms.values().sum();
    println!("{all} false alarms in {minutes:.1} min of {trials} trials: {alarms:?}");
    assert!(minutes > MINUTES, "{minutes} min");
    assert!(f64::from(all) < MOST_A_MINUTE * minutes, "{all} in {minutes:.1} min");
}
