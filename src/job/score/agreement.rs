//! How far two annotators agree, frame by frame.

use super::motions::{Judging, MotionScore, MotionScoreOrder, mean_interval};
use crate::error::Error;
use std::collections::{BTreeMap, BTreeSet};

/// What somebody says of a frame: it is not done, nobody can say, it is done.
const VALUES: [f64; 3] = [0.0, 0.5, 1.0];

/// Frames that one says this of and the other that, of one trial and label.
type Table = [[f64; 3]; 3];

/// Agreement of every two annotators of a trial on every label that either gave there: of what two would not agree on by
/// chance, how much they do (Cohen, "A coefficient of agreement for nominal scales", 1960), over all frames together.
///
/// # Errors
/// As [`super::motions::generalisation`].
pub fn agreement(order: &MotionScoreOrder) -> Result<MotionScore, Error> {
    let mut judging = Judging::of(order)?;
    let labels = judging.labels()?;
    let mut trials = std::mem::take(&mut judging.trials);
    trials.retain(|held| judging.split.judges(&held.entry));
    let mut report = judging.report(
        "agreement",
        ("each of two annotators for the other: what they agree on beyond chance (Cohen's kappa)", "share"),
    );
    let mut by_label: BTreeMap<String, Table> = BTreeMap::new();
    let mut by_trial: Vec<Table> = Vec::new();
    for held in &trials {
        let own = labels.get(&held.entry.trial).map_or(&[][..], Vec::as_slice);
        let who: BTreeSet<&str> = own.iter().map(|of| of.annotator.as_str()).collect();
        if who.len() < 2 {
            report.pass_over("labelled by fewer than two", 1);
            continue;
        }
        let names: BTreeSet<&str> = own.iter().map(|of| of.label.as_str()).collect();
        let frames = held.frames.len();
        let series = |annotator: &str, label: &str| {
            let mut said = vec![0usize; frames];
            let of = own.iter().filter(|of| of.annotator == annotator && of.label == label);
            for of in of {
                let from = usize::try_from(of.first_frame).unwrap_or(0).min(frames);
                let to = usize::try_from(of.last_frame.saturating_add(1))
                    .unwrap_or(0)
                    .clamp(from, frames);
                let value = VALUES.iter().position(|value| *value == of.value).unwrap_or(2);
                said[from..to].fill(value);
            }
            said
        };
        let mut of_trial = Table::default();
        for label in names {
            for one in &who {
                for other in who
                    .range::<str, _>((std::ops::Bound::Excluded(*one), std::ops::Bound::Unbounded))
                {
                    let of_label = by_label.entry(label.to_owned()).or_default();
                    for (a, b) in series(one, label).into_iter().zip(series(other, label)) {
                        of_label[a][b] += 1.0;
                        of_trial[a][b] += 1.0;
                    }
                }
            }
        }
        by_trial.push(of_trial);
        report.judged += 1;
    }
    let all = by_trial.iter().fold(Table::default(), |sum, of| added(sum, *of));
    report.value = kappa(&all);
    report.bound = report.value.map(|_| ("all of it", 1.0));
    // Trials drawn anew, each with its own share.
    let own: Vec<f64> = by_trial.iter().filter_map(kappa).collect();
    report.interval = (own.len() > 1).then(|| mean_interval(&own, order.seed));
    report.per_class =
        by_label.iter().filter_map(|(label, table)| Some((label.clone(), kappa(table)?))).collect();
    Ok(report)
}

fn added(mut sum: Table, of: Table) -> Table {
    sum.iter_mut().flatten().zip(of.iter().flatten()).for_each(|(sum, of)| *sum += of);
    sum
}

/// What is agreed on beyond chance; none where chance alone agrees on all.
fn kappa(table: &Table) -> Option<f64> {
    let all: f64 = table.iter().flatten().sum();
    let agreed: f64 = (0..3).map(|at| table[at][at]).sum::<f64>() / all;
    let said =
        |at: usize| table[at].iter().sum::<f64>() * table.iter().map(|row| row[at]).sum::<f64>();
    let chance: f64 = (0..3).map(said).sum::<f64>() / (all * all);
    (chance < 1.0).then(|| (agreed - chance) / (1.0 - chance))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Fleiss, Levin and Paik, "Statistical Methods for Rates and Proportions", 3rd edition, table 18.1: 100 people, two
    /// raters, 0.676.
    #[test]
    fn kappa_is_that_of_a_published_table() {
        let table = [[75.0, 1.0, 4.0], [5.0, 4.0, 1.0], [0.0, 0.0, 10.0]];
        assert!((kappa(&table).expect("both say several") - 0.676).abs() < 5e-4);
    }

    #[test]
    fn who_says_the_same_of_all_frames_says_nothing_and_who_agrees_on_different_ones_says_one() {
        assert_eq!(kappa(&[[0.0; 3], [0.0; 3], [0.0, 0.0, 50.0]]), None);
        assert_eq!(kappa(&Table::default()), None);
        assert_eq!(kappa(&[[50.0, 0.0, 0.0], [0.0; 3], [0.0, 0.0, 50.0]]), Some(1.0));
        let opposite = kappa(&[[0.0, 0.0, 50.0], [0.0; 3], [50.0, 0.0, 0.0]]);
        assert_eq!(opposite, Some(-1.0));
    }
}
