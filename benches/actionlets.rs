//! Angles of 22 degrees of freedom at 3,000 frames a second, on one core, written to memory, against
//! what memory takes and against numpy at the same formula: `cargo bench --bench actionlets`.

use gaitway::action::corpus::{Corpus, Variations};
use gaitway::action::{Database, Join, Spread, phrase, vocabulary};
use gaitway::body::{Dof, Proportions};
use std::hint::black_box;
use std::process::Command;
use std::time::Instant;

const RATE_HZ: f64 = 3000.0;
const ROUNDS: usize = 15;

/// Median seconds of a call.
fn time_s(mut call: impl FnMut()) -> f64 {
    let mut times: Vec<f64> = (0..ROUNDS)
        .map(|_| {
            let start = Instant::now();
            call();
            start.elapsed().as_secs_f64()
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

/// The same half sines in numpy, vectorised over each actionlet's samples.
const NUMPY: &str = r"
import sys, time
import numpy as np
rows = [list(map(float, line.split())) for line in sys.stdin]
rate, count = rows[0][0], int(rows[0][1])
out = np.empty((22, count))
def once():
    done = [0] * 22
    for d, a, D, p, q, T in rows[1:]:
        d = int(d)
        i = done[d]
        j = min(count, int(np.ceil((a + D) * rate)))
        done[d] = j
        if p == q:
            out[d, i:j] = p
            continue
        u = (np.arange(i, j) / rate - a) / D
        r = u <= T
        S = np.where(r, u - T / np.pi * np.sin(np.pi * u / T),
                     u + (1 - T) / np.pi * np.sin(np.pi * (u - T) / (1 - T)))
        out[d, i:j] = p + (q - p) * S
times = []
for _ in range(7):
    s = time.perf_counter()
    once()
    times.append(time.perf_counter() - s)
print(np.__version__, sorted(times)[3], *(out[20, ::max(1, count // 16)]))
";

fn main() {
    let motion = vocabulary::find("run").and_then(|run| run.perform_rounds(300)).expect("a run");
    let poses = motion.pose_count(RATE_HZ).expect("poses");
    let samples = (poses * Dof::ALL.len()) as f64;
    let mut columns = vec![0.0f64; poses * Dof::ALL.len()];
    println!("run, {:.0} s at {RATE_HZ} Hz: {samples:.2e} angles", motion.duration_s());
    let floor_s = time_s(|| {
        // A new value every time, so that nothing can be left out.
        let value = f64::from(columns[0] as f32) + 1.0;
        black_box(&mut columns).fill(value);
    });
    let ours_s = time_s(|| {
        for (dof, column) in Dof::ALL.into_iter().zip(columns.chunks_exact_mut(poses)) {
            motion.track(dof).sample_into(RATE_HZ, column);
        }
        black_box(&mut columns);
    });
    let row = |what: &str, seconds: f64| {
        println!(
            "{what:<34} {:>8.1} million angles/s   {:>5.2} of the floor",
            samples / seconds / 1e6,
            floor_s / seconds
        );
    };
    row("memory, written once (the floor)", floor_s);
    row("actionlets, ours", ours_s);
    match numpy(&motion, poses) {
        Some((version, seconds)) => row(&format!("numpy {version}, same formula"), seconds),
        None => println!("numpy: not installed, SKIPPED"),
    }
    variations();
}

fn numpy(motion: &gaitway::action::Motion, poses: usize) -> Option<(String, f64)> {
    use std::io::Write;
    let mut rows = format!("{RATE_HZ} {poses}\n");
    for dof in Dof::ALL {
        for piece in motion.track(dof).actionlets() {
            let gaitway::actionlet::Shape::HalfSine(peak) = piece.shape() else { return None };
            rows += &format!(
                "{} {} {} {} {} {}\n",
                dof.index(),
                piece.begin_s(),
                piece.duration_s(),
                piece.from_rad(),
                piece.to_rad(),
                peak.value()
            );
        }
    }
    let mut python = Command::new("python3")
        .args(["-c", NUMPY])
        .stdin(std::process::Stdio::piped())
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::null())
        .spawn()
        .ok()?;
    python.stdin.take()?.write_all(rows.as_bytes()).ok()?;
    let output = python.wait_with_output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    let mut words = text.split_whitespace();
    let (version, seconds) = (words.next()?.to_owned(), words.next()?.parse().ok()?);
    // The same numbers, or the comparison means nothing.
    let step = (poses / 16).max(1);
    for (index, word) in words.enumerate() {
        let theirs: f64 = word.parse().ok()?;
        let ours = motion.at(Dof::RightKneeFlexion, (index * step) as f64 / RATE_HZ).position_rad;
        assert!((ours - theirs).abs() < 1e-9, "numpy says {theirs}, not {ours}");
    }
    Some((version, seconds))
}

/// Variations of `run` at 120 Hz as they go into a corpus, without the disk.
fn variations() {
    let corpus = Corpus {
        label: "run".to_owned(),
        parts: phrase::load("run").expect("a run"),
        join: Join::Transition,
        spread: Spread::default(),
        database: Database::shipped().expect("actions"),
        seed: 1,
        rate_hz: 120.0,
        body: Proportions::of_stature(1.75).expect("a body"),
        has_points: true,
    };
    let corpus = Variations::of(corpus).expect("a run");
    let mut poses = 0;
    let seconds = time_s(|| poses = black_box(corpus.batch(0, 250)).expect("a batch").time_s.len());
    println!(
        "variations of run at 120 Hz: {:.0} a second on one core, {:.1} million angles/s; a million \
         in {:.1} min",
        250.0 / seconds,
        (poses * 22) as f64 / seconds / 1e6,
        seconds / 250.0 * 1e6 / 60.0
    );
}
