//! How variations of some actions stand on their feet, as they are drawn and as they are taken, and how
//! far they spread: a table. Arguments: how many, then names of actions.

use gaitway::action::corpus::{Corpus, VariationStatus, Variations};
use gaitway::action::{Database, Join, Motion, Spread, mutate, phrase};
use gaitway::actionlet::Shape;
use gaitway::body::contact::{Footing, ON_FLOOR_M, places_m};
use gaitway::body::{Proportions, SegmentPose};
use gaitway::error::Error;
use glam::DVec3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// How far a sole slides from one to another of those poses in which it is on the floor.
fn slides_m(body: &Proportions, poses: &[SegmentPose]) -> f64 {
    let mut worst_m = 0f64;
    for end in 0..4 {
        let places: Vec<DVec3> = poses.iter().map(|pose| places_m(body, pose)[end]).collect();
        for contact in places.split(|place| place.z >= ON_FLOOR_M) {
            let Some(first) = contact.first() else { continue };
            let (least, most) = contact
                .iter()
                .fold((*first, *first), |(least, most), at| (least.min(*at), most.max(*at)));
            worst_m = worst_m.max((most - least).truncate().length());
        }
    }
    worst_m
}

const RATE_HZ: f64 = 250.0;

/// Of a motion: its duration, the angles its actionlets end at, and their T.
type Figures = (f64, Vec<f64>, Vec<f64>);

/// What the worst and the usual of some motions do.
#[derive(Default)]
struct Seen {
    footings: Vec<[f64; 8]>,
    /// Of those that slide by more than 5 mm when looked at so often.
    slid: [u32; 3],
    /// By motion.
    figures: Vec<Figures>,
}

impl Seen {
    fn add(&mut self, body: &Proportions, motion: &Motion) -> Result<(), Error> {
        let poses = motion.poses(body, RATE_HZ)?;
        let footing = Footing::of(body, &poses, RATE_HZ)?;
        for (slid, rate_hz) in self.slid.iter_mut().zip([240.0, 250.0, 1000.0]) {
            let poses = motion.poses(body, rate_hz)?;
            *slid += u32::from(slides_m(body, &poses) > 0.005);
        }
        let middle = poses.len() / 4..3 * poses.len() / 4;
        self.footings.push([
            footing.lowest_m() * 1e3,
            footing.slide_m() * 1e3,
            footing.root_acceleration_m_s2(),
            footing.both_feet(middle.clone()) * 1e2,
            footing.flying(middle) * 1e2,
            footing.force_quantile(0.05),
            footing.force_quantile(0.95),
            footing.travel_m().1,
        ]);
        let (mut angles, mut peaks) = (Vec::new(), Vec::new());
        for (_, piece) in motion.moving() {
            angles.push(piece.to_rad().to_degrees());
            if let Shape::HalfSine(peak_at) = piece.shape() {
                peaks.push(peak_at.value());
            }
        }
        self.figures.push((motion.duration_s(), angles, peaks));
        Ok(())
    }

    fn tell(&self, name: &str, tail: &str) {
        let at = |figure: usize, share: f64| {
            let mut all: Vec<f64> = self.footings.iter().map(|row| row[figure]).collect();
            all.sort_by(f64::total_cmp);
            all.get((share * (all.len() as f64 - 1.0)) as usize).copied().unwrap_or(f64::NAN)
        };
        let deviation = |all: &[f64]| {
            let mean = all.iter().sum::<f64>() / all.len() as f64;
            all.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / all.len() as f64
        };
        // Of actionlets at the same place; those of other numbers are left out.
        let pooled = |get: fn(&Figures) -> &Vec<f64>| {
            let count = self.figures.first().map_or(0, |figures| get(figures).len());
            let alike: Vec<&Vec<f64>> =
                self.figures.iter().map(get).filter(|all| all.len() == count).collect();
            let each =
                (0..count).map(|i| deviation(&alike.iter().map(|all| all[i]).collect::<Vec<_>>()));
            (each.sum::<f64>() / count.max(1) as f64).sqrt()
        };
        let durations: Vec<f64> = self.figures.iter().map(|figures| figures.0).collect();
        println!(
            "{name:18} {:6.1} {:6.1} {:6.1} {:6.1} {:6.1} {:6.1} {:6.1} {:6.1} {:6.2} {:6.2} {:6.2} \
             {:6.3} {:6.3} {:6.3} {tail} over 5 mm {:?}, away {:.3} to {:.3}",
            at(0, 0.0),
            at(0, 0.05),
            at(1, 0.5),
            at(1, 0.95),
            at(2, 0.5),
            at(2, 0.95),
            at(3, 0.5),
            at(4, 0.5),
            at(5, 0.5),
            at(6, 0.5),
            at(7, 0.95),
            pooled(|figures| &figures.1),
            deviation(&durations).sqrt(),
            pooled(|figures| &figures.2),
            self.slid,
            at(7, 0.5),
            at(7, 0.95),
        );
    }
}

fn main() -> Result<(), Error> {
    let mut words = std::env::args().skip(1);
    let count: u32 = words.next().and_then(|word| word.parse().ok()).unwrap_or(600);
    let mut names: Vec<String> = words.collect();
    if names.is_empty() {
        names = ["walk", "run", "jump", "kick-r", "box-r"].map(str::to_owned).to_vec();
    }
    println!(
        "{:18} {:>13} {:>13} {:>13} {:>6} {:>6} {:>13} {:>6} {:>20}",
        "", "lowest, mm", "slide, mm", "root, m/s2", "both", "flight", "force", "travel", "spread"
    );
    println!(
        "{:18} {:>6} {:>6} {:>6} {:>6} {:>6} {:>6} {:>6} {:>6} {:>6} {:>6} {:>6} {:>6} {:>6} {:>6}",
        "",
        "worst",
        "5 %",
        "50 %",
        "95 %",
        "50 %",
        "95 %",
        "%",
        "%",
        "5 %",
        "95 %",
        "m",
        "deg",
        "s",
        "T"
    );
    for name in names {
        let corpus = Corpus {
            label: name.clone(),
            parts: phrase::load(&name)?,
            join: Join::Transition,
            spread: Spread::default(),
            database: Database::shipped()?,
            seed: 1,
            rate_hz: 120.0,
            body: Proportions::of_stature(1.75)?,
            has_points: false,
        };
        let (body, action) = (corpus.body, corpus.parts[0].action.clone());
        let mut drawn = Seen::default();
        let mut random = ChaCha8Rng::seed_from_u64(1);
        for _ in 0..count {
            let varied = mutate(&action, &corpus.spread, &corpus.database, &mut random);
            drawn.add(&body, &varied.perform()?)?;
        }
        drawn.tell(&format!("{name} as drawn"), "");
        let variations = Variations::of(corpus)?;
        let mut taken = Seen::default();
        let (mut rejected, mut by_status) = (0, [0; 3]);
        for number in 0..count {
            let varied = variations.variation(number)?;
            rejected += varied.rejected;
            by_status[match varied.status {
                VariationStatus::Valid => 0,
                VariationStatus::Repaired => 1,
                VariationStatus::Implausible => 2,
            }] += 1;
            taken.add(&body, &varied.motion)?;
        }
        let share = |part: u32| 100.0 * f64::from(part) / f64::from(count + rejected);
        let [valid, repaired, implausible] = by_status.map(share);
        let tail = format!(
            "valid {valid:.0} %, repaired {repaired:.0} %, rejected {:.0} %, none found {implausible:.0} %",
            share(rejected)
        );
        taken.tell(&name, &tail);
    }
    Ok(())
}
