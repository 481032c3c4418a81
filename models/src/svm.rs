//! Support vector machine, one against one, with a radial basis kernel.
//!
//! linfa-svm solves the binary problems. This module adds what version 0.8 lacks: pairs of materials, decision values from one shared kernel
//! matrix (linfa copies the support vectors for each pair), and probabilities. linfa fits Platt's sigmoid to decision values of the training
//! sweeps, which are too optimistic; here the sigmoids are fitted to held-out decisions, as by Platt (1999) and LIBSVM.

use linfa::ParamGuard;
use linfa::composing::platt_scaling::{Platt, platt_newton_method};
use linfa::traits::Fit;
use ndarray::{Array1, Array2, Axis};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::{Features, ModelError};

/// Hyperparameters of the machine.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SvmSettings {
    /// Penalty of a margin violation, C.
    pub c: f64,
    /// Kernel coefficient: `k(x, y) = exp(-gamma |x - y|^2)`.
    pub gamma: f64,
}

/// One of the `materials * (materials - 1) / 2` binary machines.
#[derive(Debug, Clone, PartialEq)]
pub struct Pair {
    first: usize,
    second: usize,
    /// Training rows with non-zero weight: the support vectors.
    pub rows: Vec<usize>,
    /// `[rows]`, dual variables, positive for the pair's first material.
    pub weights: Vec<f64>,
    /// Offset: the decision value is the weighted kernel sum minus `rho`.
    pub rho: f64,
}

/// Fitted machines for all pairs of materials.
#[derive(Debug, Clone, PartialEq)]
pub struct Svm {
    /// Training sweeps, `[sweeps][width]`.
    pub features: Features,
    /// See [`SvmSettings::gamma`].
    pub gamma: f64,
    /// Machines ordered by first material, then second.
    pub pairs: Vec<Pair>,
    materials: usize,
}

/// Slope and offset of each pair's sigmoid: `p(first) = 1 / (1 + exp(slope * decision + offset))`.
#[derive(Debug, Clone, PartialEq)]
pub struct PlattSigmoids(pub Vec<[f64; 2]>);

impl Svm {
    /// Fits a machine to every pair of materials.
    ///
    /// - `labels`: `[sweeps]`, below `materials`
    ///
    /// # Errors
    /// linfa-svm rejects the settings, for example a negative C.
    pub fn fit(
        features: &Features,
        labels: &[usize],
        materials: usize,
        settings: SvmSettings,
    ) -> Result<Self, ModelError> {
        let rows_of: Vec<Vec<usize>> = (0..materials)
            .map(|label| (0..labels.len()).filter(|&i| labels[i] == label).collect())
            .collect();
        let pairs = pairs_of(materials)
            .into_par_iter()
            .map(|(first, second)| {
                let rows = [&rows_of[first][..], &rows_of[second][..]].concat();
                let positive: Vec<bool> = rows.iter().map(|&row| labels[row] == first).collect();
                let (weights, rho) = fit_pair(&features.select(&rows), positive, settings)?;
                let (rows, weights) = rows
                    .into_iter()
                    .zip(weights)
                    .filter(|(_, weight)| *weight != 0.0)
                    .unzip();
                Ok(Pair {
                    first,
                    second,
                    rows,
                    weights,
                    rho,
                })
            })
            .collect::<Result<Vec<_>, ModelError>>()?;
        Ok(Self {
            features: features.clone(),
            gamma: settings.gamma,
            materials,
            pairs,
        })
    }

    /// Restores a machine from its parts.
    ///
    /// # Panics
    /// If the lengths do not match.
    pub fn from_parts(
        features: Features,
        gamma: f64,
        materials: usize,
        counts: &[usize],
        mut rows: &[usize],
        mut weights: &[f64],
        rho: &[f64],
    ) -> Self {
        let pairs = pairs_of(materials)
            .into_iter()
            .zip(counts.iter().zip(rho))
            .map(|((first, second), (&count, &rho))| {
                let (own_rows, other_rows) = rows.split_at(count);
                let (own_weights, other_weights) = weights.split_at(count);
                (rows, weights) = (other_rows, other_weights);
                Pair {
                    first,
                    second,
                    rows: own_rows.to_vec(),
                    weights: own_weights.to_vec(),
                    rho,
                }
            })
            .collect();
        Self {
            features,
            gamma,
            materials,
            pairs,
        }
    }

    /// Returns decision values `[sweeps][pairs]`, positive for the first material of a pair.
    ///
    /// # Panics
    /// If `queries` have another width.
    pub fn decisions(&self, queries: &Features) -> Vec<Vec<f64>> {
        assert_eq!(queries.width(), self.features.width(), "width of a row");
        (0..queries.len())
            .into_par_iter()
            .map(|query| {
                let query = queries.row(query);
                let kernel: Vec<f64> = self
                    .features
                    .rows()
                    .map(|row| (-self.gamma * squared_distance(row, query)).exp())
                    .collect();
                self.pairs
                    .iter()
                    .map(|pair| {
                        let weighted = pair.rows.iter().zip(&pair.weights);
                        weighted
                            .map(|(&row, weight)| weight * kernel[row])
                            .sum::<f64>()
                            - pair.rho
                    })
                    .collect()
            })
            .collect()
    }

    /// Returns the label that wins most pairs, the lowest one on a tie, as scikit-learn's `SVC.predict`.
    ///
    /// - `decisions`: `[pairs]`
    pub fn vote(&self, decisions: &[f64]) -> usize {
        let mut won = vec![0.0; self.materials];
        for (pair, decision) in self.pairs.iter().zip(decisions) {
            won[if *decision > 0.0 {
                pair.first
            } else {
                pair.second
            }] += 1.0;
        }
        crate::argmax(&won)
    }

    /// Returns log-probabilities `[sweeps][materials]` for decisions `[sweeps][pairs]`.
    pub fn log_probabilities(
        &self,
        decisions: &[Vec<f64>],
        sigmoids: &PlattSigmoids,
    ) -> Vec<Vec<f64>> {
        decisions
            .par_iter()
            .map(|decisions| {
                let mut pairwise = vec![vec![0.0; self.materials]; self.materials];
                for ((pair, decision), [slope, offset]) in
                    self.pairs.iter().zip(decisions).zip(&sigmoids.0)
                {
                    // LIBSVM also limits the probability of a pair.
                    let p = 1.0 / (1.0 + (slope * decision + offset).exp());
                    let p = p.clamp(1e-7, 1.0 - 1e-7);
                    pairwise[pair.first][pair.second] = p;
                    pairwise[pair.second][pair.first] = 1.0 - p;
                }
                couple(&pairwise).iter().map(|p| p.ln()).collect()
            })
            .collect()
    }
}

/// Slope and offset of a pair of which held-out sweeps of one side or both are missing: a decision value counts as log-odds.
const UNCALIBRATED: [f64; 2] = [-1.0, 0.0];

/// Fits the sigmoids of all pairs (Platt, 1999; Lin, Lin & Weng, 2007) to decisions on held-out sweeps. A pair without held-out sweeps of both
/// materials is not calibrated.
///
/// - `decisions`: `[sweeps][pairs]`
/// - `labels`: `[sweeps]`
///
/// # Errors
/// Newton's method does not converge.
pub fn fit_platt(
    decisions: &[Vec<f64>],
    labels: &[usize],
    materials: usize,
) -> Result<PlattSigmoids, ModelError> {
    pairs_of(materials)
        .into_par_iter()
        .enumerate()
        .map(|(pair, (first, second))| {
            let rows = (0..labels.len()).filter(|&i| labels[i] == first || labels[i] == second);
            let (values, positive): (Vec<f64>, Vec<bool>) = rows
                .map(|i| (decisions[i][pair], labels[i] == first))
                .unzip();
            if !positive.contains(&true) || !positive.contains(&false) {
                return Ok(UNCALIBRATED);
            }
            sigmoid(&Array1::from(values), &Array1::from(positive))
        })
        .collect::<Result<Vec<_>, _>>()
        .map(PlattSigmoids)
}

/// Returns slope and offset of one sigmoid.
///
/// linfa fails where its line search makes no further progress, even next to the optimum; LIBSVM keeps the current solution there.
/// A stronger ridge on the Hessian shortens the steps, so that linfa converges there too.
fn sigmoid(values: &Array1<f64>, positive: &Array1<bool>) -> Result<[f64; 2], ModelError> {
    let mut last = String::new();
    for ridge in [1e-12, 1e-6, 1e-3, 1e-1] {
        let params = Platt::<f64, ()>::params().sigma(ridge).maxiter(1000);
        let fitted = params
            .check()
            .and_then(|params| platt_newton_method(values.view(), positive.view(), &params));
        match fitted {
            Ok((slope, offset)) => return Ok([slope, offset]),
            Err(error) => last = error.to_string(),
        }
    }
    Err(ModelError::Fit {
        what: "Platt scaling of the support vector machine",
        reason: last,
    })
}

/// Returns all pairs `(first, second)` with `first < second`, in scikit-learn's order.
fn pairs_of(materials: usize) -> Vec<(usize, usize)> {
    (0..materials)
        .flat_map(|first| (first + 1..materials).map(move |second| (first, second)))
        .collect()
}

/// Returns the signed dual variables and rho of one machine.
fn fit_pair(
    features: &Features,
    positive: Vec<bool>,
    settings: SvmSettings,
) -> Result<(Vec<f64>, f64), ModelError> {
    let records: Array2<f64> = features.to_ndarray();
    assert_eq!(
        records.len_of(Axis(0)),
        positive.len(),
        "a label for each row"
    );
    let dataset = linfa::DatasetBase::new(records, Array1::from(positive));
    let machine = linfa_svm::Svm::<f64, bool>::params()
        .pos_neg_weights(settings.c, settings.c)
        .gaussian_kernel(1.0 / settings.gamma)
        .eps(1e-3)
        .fit(&dataset)
        .map_err(|error| ModelError::Fit {
            what: "support vector machine",
            reason: error.to_string(),
        })?;
    Ok((machine.alpha, machine.rho))
}

fn squared_distance(a: &[f32], b: &[f32]) -> f64 {
    const LANES: usize = 8;
    let mut sums = [0.0_f64; LANES];
    let (a_lanes, b_lanes) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    let rest: f64 = a_lanes
        .remainder()
        .iter()
        .zip(b_lanes.remainder())
        .map(|(x, y)| f64::from(x - y).powi(2))
        .sum();
    for (a, b) in a_lanes.zip(b_lanes) {
        for ((sum, x), y) in sums.iter_mut().zip(a).zip(b) {
            *sum += f64::from(x - y).powi(2);
        }
    }
    sums.iter().sum::<f64>() + rest
}

/// Returns probabilities of all materials from pairwise ones: the second method of Wu, Lin & Weng (2004), as in LIBSVM.
///
/// - `pairwise`: `[materials][materials]`, probability of the row's material against the column's
fn couple(pairwise: &[Vec<f64>]) -> Vec<f64> {
    let materials = pairwise.len();
    if materials == 1 {
        return vec![1.0];
    }
    let mut q = vec![vec![0.0; materials]; materials];
    for t in 0..materials {
        for j in 0..materials {
            if j != t {
                q[t][t] += pairwise[j][t].powi(2);
                q[t][j] = -pairwise[j][t] * pairwise[t][j];
            }
        }
    }
    let mut p = vec![1.0 / materials as f64; materials];
    let tolerance = 0.005 / materials as f64;
    for _ in 0..materials.max(100) {
        let mut qp: Vec<f64> = q
            .iter()
            .map(|row| row.iter().zip(&p).map(|(q, p)| q * p).sum())
            .collect();
        let mut pqp: f64 = p.iter().zip(&qp).map(|(p, qp)| p * qp).sum();
        if qp.iter().all(|qp| (qp - pqp).abs() < tolerance) {
            break;
        }
        for t in 0..materials {
            let change = (pqp - qp[t]) / q[t][t];
            p[t] += change;
            let scale = 1.0 + change;
            pqp = (pqp + change * (change * q[t][t] + 2.0 * qp[t])) / scale / scale;
            for j in 0..materials {
                qp[j] = (qp[j] + change * q[t][j]) / scale;
                p[j] /= scale;
            }
        }
    }
    let sum: f64 = p.iter().sum();
    p.iter().map(|p| (p / sum).max(1e-12)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    fn rings(sweeps: usize) -> (Features, Vec<usize>) {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let (mut values, mut labels) = (Vec::new(), Vec::new());
        for sweep in 0..sweeps {
            let label = sweep % 3;
            let (radius, angle) = (
                1.0 + label as f32 + 0.4 * rng.random::<f32>(),
                std::f32::consts::TAU * rng.random::<f32>(),
            );
            values.extend([radius * angle.cos(), radius * angle.sin()]);
            labels.push(label);
        }
        (Features::new(2, values), labels)
    }

    #[test]
    fn a_pair_without_held_out_sweeps_of_one_side_keeps_its_decisions() {
        let decisions = [[2.0, 1.0, -1.0], [-1.0, 0.5, 2.0], [1.5, 1.0, 0.0]].map(Vec::from);
        let sigmoids = fit_platt(&decisions, &[0, 1, 0], 3).unwrap();
        // Pairs (0, 1), (0, 2), (1, 2): nothing is held out of material 2.
        assert_ne!(sigmoids.0[0], UNCALIBRATED);
        assert_eq!(sigmoids.0[1..], [UNCALIBRATED; 2]);
    }

    #[test]
    fn rings_need_the_kernel_and_get_it() {
        let (features, labels) = rings(240);
        let (train, held): (Vec<usize>, Vec<usize>) = (0..240).partition(|i| i % 8 < 4);
        let pick = |rows: &[usize]| -> Vec<usize> { rows.iter().map(|&i| labels[i]).collect() };
        let settings = SvmSettings {
            c: 10.0,
            gamma: 1.0,
        };
        let svm = Svm::fit(&features.select(&train), &pick(&train), 3, settings).unwrap();
        let decisions = svm.decisions(&features.select(&held));
        let truth = pick(&held);
        let sigmoids = fit_platt(&decisions, &truth, 3).unwrap();
        let scores = svm.log_probabilities(&decisions, &sigmoids);
        for ((row, decision), truth) in scores.iter().zip(&decisions).zip(&truth) {
            assert_eq!(svm.vote(decision), *truth);
            assert_eq!(crate::argmax(row), *truth);
            let sum: f64 = row.iter().map(|log_p| log_p.exp()).sum();
            assert!((sum - 1.0).abs() < 1e-9, "{sum}");
        }
        let scale = SvmSettings {
            c: -1.0,
            gamma: 1.0,
        };
        assert!(Svm::fit(&features, &labels, 3, scale).is_err());
    }

    #[test]
    fn coupled_probabilities_agree_with_consistent_pairs() {
        let p = [0.5, 0.3, 0.15, 0.05];
        let pairwise: Vec<Vec<f64>> = p
            .iter()
            .map(|a| p.iter().map(|b| a / (a + b)).collect())
            .collect();
        for (found, expected) in couple(&pairwise).iter().zip(p) {
            assert!((found - expected).abs() < 5e-3, "{found} {expected}");
        }
    }
}
