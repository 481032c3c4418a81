//! Sample efficiency of transfer: the number of sweeps at which a network from scratch reaches the accuracy of
//! transfer.

use rand::RngExt;
use serde::{Deserialize, Serialize};
use tactnet_data::Seed;
use tactnet_pipeline::MeanRemoval;

use crate::Row;

/// Number of bootstrap resamples.
const RESAMPLES: usize = 2000;
/// Numbers of shots at which transfer is compared with networks from scratch.
const TARGETS: [usize; 2] = [1, 10];

/// Number of sweeps that a network from scratch needs to reach the accuracy of transfer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SampleEfficiency {
    /// Name of the data set.
    pub data: String,
    /// Name of the networks' recipe.
    pub model: String,
    /// Treatment of the mean of each taxel.
    pub levels: MeanRemoval,
    /// Support sweeps of each new material for transfer.
    pub transfer_shots: usize,
    /// Accuracy of transfer.
    pub accuracy: f64,
    /// Sweeps from scratch for the same accuracy, interpolated on a logarithmic scale; absent if the largest tested
    /// number is not enough.
    pub shots: Option<f64>,
    /// 95 % bootstrap interval over draws; absent with one draw. An absent end exceeds the largest tested number.
    pub ci95: Option<[Option<f64>; 2]>,
    /// Published ratio, if the materials are TactMat's.
    pub published_ratio: Option<f64>,
}

/// Returns the values of all draws by number of shots, of the method on the data and model of a row.
fn curve(rows: &[Row], of: &Row, method: &str) -> Vec<(usize, Vec<f64>)> {
    let mut points: Vec<(usize, Vec<f64>)> = rows
        .iter()
        .filter(|row| {
            (&row.data, row.levels, row.steps, &row.model)
                == (&of.data, of.levels, of.steps, &of.model)
        })
        .filter(|row| row.method == method)
        .filter_map(|row| Some((row.shots?, row.statistic.values.clone())))
        .collect();
    points.sort_by_key(|(shots, _)| *shots);
    points
}

/// Returns the sample efficiency for each data set with both curves.
pub(crate) fn sample_efficiency(rows: &[Row], seed: Seed) -> Vec<SampleEfficiency> {
    let mut found = Vec::new();
    for row in rows.iter().filter(|row| row.method == "ol-mean") {
        let Some(target) = row.shots.filter(|shots| TARGETS.contains(shots)) else {
            continue;
        };
        let scratch = curve(rows, row, "nk");
        // Only complete draws of both curves can be resampled together.
        if scratch.len() < 2
            || scratch
                .iter()
                .any(|(_, values)| values.len() != row.statistic.values.len())
        {
            continue;
        }
        let everything: Vec<usize> = (0..row.statistic.values.len()).collect();
        let mut rng = seed.rng(("sample efficiency", target));
        let mut draws: Vec<f64> = (0..RESAMPLES)
            .map(|_| {
                let drawn: Vec<usize> = everything
                    .iter()
                    .map(|_| rng.random_range(0..everything.len()))
                    .collect();
                crossing(&scratch, &row.statistic.values, &drawn).unwrap_or(f64::INFINITY)
            })
            .collect();
        draws.sort_by(f64::total_cmp);
        let end = |share: f64| {
            let value = draws[((RESAMPLES - 1) as f64 * share).round() as usize];
            value.is_finite().then_some(value)
        };
        found.push(SampleEfficiency {
            data: row.data.clone(),
            model: row.model.clone(),
            levels: row.levels,
            transfer_shots: target,
            accuracy: row.statistic.mean,
            shots: crossing(&scratch, &row.statistic.values, &everything),
            ci95: (everything.len() > 1).then(|| [end(0.025), end(0.975)]),
            published_ratio: row.is_beside_published().then_some(if target == 1 {
                15.0
            } else {
                5.0
            }),
        });
    }
    found
}

/// Returns the smallest number of shots at which the mean of `curve` reaches the mean of `target`, over the draws with
/// indices `drawn`. Between two tested numbers it interpolates linearly over their logarithm.
fn crossing(curve: &[(usize, Vec<f64>)], target: &[f64], drawn: &[usize]) -> Option<f64> {
    let mean = |values: &[f64]| drawn.iter().map(|i| values[*i]).sum::<f64>() / drawn.len() as f64;
    let target = mean(target);
    let mut before: Option<(f64, f64)> = None;
    for (shots, values) in curve {
        let (position, accuracy) = ((*shots as f64).ln(), mean(values));
        if accuracy >= target {
            return Some(match before {
                None => *shots as f64,
                Some((last, low)) => {
                    let share = (target - low) / (accuracy - low);
                    (last + share * (position - last)).exp()
                }
            });
        }
        before = Some((position, accuracy));
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_crosses_between_tested_shots_on_a_logarithmic_scale() {
        let curve = vec![
            (1, vec![0.2, 0.4]),
            (4, vec![0.5, 0.7]),
            (16, vec![0.8, 1.0]),
        ];
        let at = |target: f64, drawn: &[usize]| crossing(&curve, &[target, target], drawn);
        assert_eq!(at(0.1, &[0, 1]), Some(1.0));
        // Means 0.3, 0.6, 0.9: half way between 4 and 16 is 8.
        assert!((at(0.75, &[0, 1]).unwrap() - 8.0).abs() < 1e-9);
        assert!((at(0.65, &[0, 0]).unwrap() - 8.0).abs() < 1e-9);
        assert_eq!(at(0.95, &[0, 1]), None);
    }
}
