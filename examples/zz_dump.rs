//! Temporary.
use gaitway::body::{BodyFigure, Proportions};
use gaitway::job::source::{CaptureOptions, body_motion};
use gaitway::recognise::features::{Extractor, Feature, Noise};
use gaitway::recognise::points::{Lengths, Points};
use gaitway::recognise::posture::EquationReading;
use std::io::Write;
fn main() {
    let mut args = std::env::args().skip(1);
    let out = args.next().unwrap();
    let names: Vec<String> = Feature::all().map(Feature::name).collect();
    std::fs::write(format!("{out}/features.txt"), names.join("\n")).unwrap();
    for motion in args {
        let capture = match body_motion(&motion, None, &CaptureOptions::default()) {
            Ok((capture, _)) => capture,
            Err(e) => {
                println!("{motion}: {e}");
                continue;
            }
        };
        let body = Proportions::of_figure(BodyFigure::DrillisContini, capture.stature_m).unwrap();
        let lengths = Lengths::of(&body);
        let frames: Vec<Points> =
            capture.poses.iter().map(|p| Points::of(&body, p, &capture.tracked)).collect();
        let noise = Noise::of_quietest(&frames, capture.rate_hz).filter(|n| n.is_still(&lengths));
        let mut x = Extractor::new(lengths, EquationReading::Repaired, noise);
        let name = motion.rsplit('/').next().unwrap();
        let mut file = std::io::BufWriter::new(
            std::fs::File::create(format!("{out}/{name}.f32")).unwrap(),
        );
        writeln!(
            std::fs::File::create(format!("{out}/{name}.txt")).unwrap(),
            "{} {} {} {} {} {:?}",
            capture.rate_hz,
            frames.len(),
            lengths.leg_m(),
            lengths.arm_m,
            capture.stature_m,
            capture.tracked
        )
        .unwrap();
        for p in &frames {
            let row = x.next(p, 1.0 / capture.rate_hz);
            for v in row.values.iter().chain(p.0.iter().flat_map(|v| v.as_ref().iter())) {
                file.write_all(&(*v as f32).to_le_bytes()).unwrap();
            }
        }
    }
}
