//! Two recognisers that learn from examples, over the same features as the models.

use gaitway::recognise::features::FEATURES;

pub type Row = [f64; FEATURES];
type Examples<'a> = [(&'a str, Vec<Row>)];

/// How far paths may be from the diagonal, as a share of the length (Sakoe and Chiba, 1978).
const BAND: f64 = 0.2;
/// States of a hidden Markov model, in a circle: actions repeat.
const STATES: usize = 8;
/// Rounds of Viterbi training (Juang and Rabiner, "The segmental K-means algorithm", 1990).
const ROUNDS: usize = 10;
/// Least variance of a feature of a state, of that of all examples.
const LEAST_VARIANCE: f64 = 0.05;

/// Mean and deviation of each feature over all examples; what is unknown is at the mean.
pub struct Scale {
    mean: Row,
    deviation: Row,
}

impl Scale {
    pub fn of(examples: &Examples<'_>) -> Self {
        let (mut mean, mut deviation) = ([0.0; FEATURES], [1.0; FEATURES]);
        for feature in 0..FEATURES {
            let values = || {
                let rows = examples.iter().flat_map(|(_, rows)| rows);
                rows.map(|row| row[feature]).filter(|value| value.is_finite())
            };
            let count = values().count().max(1) as f64;
            mean[feature] = values().sum::<f64>() / count;
            let square = values().map(|value| (value - mean[feature]).powi(2)).sum::<f64>();
            // What never changes tells nothing.
            deviation[feature] = Some((square / count).sqrt())
                .filter(|deviation| *deviation > 1e-9)
                .unwrap_or(f64::INFINITY);
        }
        Self { mean, deviation }
    }

    pub fn scaled(&self, rows: &[Row]) -> Vec<Row> {
        let scaled = |row: &Row| {
            core::array::from_fn(|of| {
                let value = (row[of] - self.mean[of]) / self.deviation[of];
                if value.is_finite() { value } else { 0.0 }
            })
        };
        rows.iter().map(scaled).collect()
    }
}

fn square_distance(a: &Row, b: &Row) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

/// The label of the example that is nearest after both were warped onto one another.
pub struct Nearest {
    examples: Vec<(String, Vec<Row>)>,
}

impl Nearest {
    pub fn new(scale: &Scale, examples: &Examples<'_>) -> Self {
        let scaled = |(label, rows): &(&str, Vec<Row>)| ((*label).to_owned(), scale.scaled(rows));
        Self { examples: examples.iter().map(scaled).collect() }
    }

    pub fn label(&self, rows: &[Row]) -> String {
        let distances = self.examples.iter().map(|(label, of)| (label, warped(rows, of)));
        let nearest = distances.min_by(|a, b| a.1.total_cmp(&b.1)).expect("an example");
        nearest.0.clone()
    }
}

/// Mean distance of two rows of frames along the best path.
fn warped(a: &[Row], b: &[Row]) -> f64 {
    let slope = b.len() as f64 / a.len() as f64;
    let reach = (BAND * a.len().max(b.len()) as f64).max(2.0);
    let mut before = vec![f64::INFINITY; b.len() + 1];
    before[0] = 0.0;
    for (i, row) in a.iter().enumerate() {
        let mut now = vec![f64::INFINITY; b.len() + 1];
        let middle = i as f64 * slope;
        let from = (middle - reach).max(0.0) as usize;
        let to = ((middle + reach) as usize + 1).min(b.len());
        for j in from..to {
            let least = before[j].min(before[j + 1]).min(now[j]);
            now[j + 1] = least + square_distance(row, &b[j]).sqrt();
        }
        before = now;
    }
    before[b.len()] / (a.len() + b.len()) as f64
}

/// A hidden Markov model: states in a circle, each a Gaussian with a variance for every feature.
struct MarkovModel {
    label: String,
    mean: Vec<Row>,
    variance: Vec<Row>,
    stay: Vec<f64>,
}

/// A model for each label.
pub struct MarkovModels(Vec<MarkovModel>);

impl MarkovModels {
    pub fn new(scale: &Scale, examples: &Examples<'_>) -> Self {
        let mut labels: Vec<&str> = examples.iter().map(|(label, _)| *label).collect();
        labels.sort_unstable();
        labels.dedup();
        let model = |label: &&str| {
            let own = examples.iter().filter(|(of, _)| of == label);
            let own: Vec<Vec<Row>> = own.map(|(_, rows)| scale.scaled(rows)).collect();
            MarkovModel::trained(label, &own)
        };
        Self(labels.iter().map(model).collect())
    }

    pub fn label(&self, rows: &[Row]) -> String {
        let likelihoods = self.0.iter().map(|model| (&model.label, model.path(rows).0));
        let most = likelihoods.max_by(|a, b| a.1.total_cmp(&b.1)).expect("a model");
        most.0.clone()
    }
}

impl MarkovModel {
    fn trained(label: &str, examples: &[Vec<Row>]) -> Self {
        let even = |rows: &Vec<Row>| (0..rows.len()).map(|n| n * STATES / rows.len()).collect();
        let mut paths: Vec<Vec<usize>> = examples.iter().map(even).collect();
        let mut model = Self::of(label, examples, &paths);
        for _ in 0..ROUNDS {
            paths = examples.iter().map(|rows| model.path(rows).1).collect();
            model = Self::of(label, examples, &paths);
        }
        model
    }

    /// What frames that are in known states say.
    fn of(label: &str, examples: &[Vec<Row>], paths: &[Vec<usize>]) -> Self {
        let mut count = vec![1e-9; STATES];
        let mut stayed = [1.0; STATES];
        let mut mean = vec![[0.0; FEATURES]; STATES];
        let mut variance = vec![[0.0; FEATURES]; STATES];
        let frames = || {
            let pairs = examples.iter().zip(paths);
            pairs.flat_map(|(rows, path)| rows.iter().zip(path.iter().copied()))
        };
        for (row, state) in frames() {
            count[state] += 1.0;
            mean[state].iter_mut().zip(row).for_each(|(sum, value)| *sum += value);
        }
        for (mean, count) in mean.iter_mut().zip(&count) {
            mean.iter_mut().for_each(|sum| *sum /= count);
        }
        for (row, state) in frames() {
            for feature in 0..FEATURES {
                variance[state][feature] += (row[feature] - mean[state][feature]).powi(2);
            }
        }
        for (variance, count) in variance.iter_mut().zip(&count) {
            variance.iter_mut().for_each(|sum| *sum = (*sum / count).max(LEAST_VARIANCE));
        }
        for path in paths {
            for pair in path.windows(2).filter(|pair| pair[0] == pair[1]) {
                stayed[pair[0]] += 1.0;
            }
        }
        let stay =
            stayed.iter().zip(&count).map(|(stayed, count)| stayed / (count + 2.0)).collect();
        Self { label: label.to_owned(), mean, variance, stay }
    }

    /// Logarithm of the likelihood along the best path, and the path; it may begin in any state.
    fn path(&self, rows: &[Row]) -> (f64, Vec<usize>) {
        let norm: Vec<f64> = self
            .variance
            .iter()
            .map(|variance| -0.5 * variance.iter().map(|of| of.ln()).sum::<f64>())
            .collect();
        let emitted = |state: usize, row: &Row| {
            let of = self.mean[state].iter().zip(&self.variance[state]).zip(row);
            norm[state]
                - 0.5 * of.map(|((mean, variance), x)| (x - mean).powi(2) / variance).sum::<f64>()
        };
        let mut best: Vec<f64> = (0..STATES).map(|state| emitted(state, &rows[0])).collect();
        let mut came: Vec<[usize; STATES]> = Vec::with_capacity(rows.len());
        for row in &rows[1..] {
            let mut from = [0; STATES];
            let next = (0..STATES).map(|state| {
                let before = (state + STATES - 1) % STATES;
                let stays = best[state] + self.stay[state].ln();
                let comes = best[before] + (1.0 - self.stay[before]).ln();
                from[state] = if stays >= comes { state } else { before };
                stays.max(comes) + emitted(state, row)
            });
            best = next.collect();
            came.push(from);
        }
        let last = (0..STATES).max_by(|a, b| best[*a].total_cmp(&best[*b])).unwrap_or(0);
        let mut path = vec![last];
        for from in came.iter().rev() {
            path.push(from[path[path.len() - 1]]);
        }
        path.reverse();
        (best[last], path)
    }
}
