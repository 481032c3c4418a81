//! Fit of one new class next to fixed known classes.

use super::linear::{ITERATIONS, TOLERANCE};
use super::{LinearHead, WeightPrior};
use crate::lbfgs::{Minimum, dot, minimise};
use crate::{Features, ModelError};

/// Weights of a new class neuron.
#[derive(Debug, Clone, PartialEq)]
pub struct NewClass {
    /// `[width]`
    pub weights: Vec<f64>,
    /// Bias.
    pub bias: f64,
}

/// Fits one new class to a few of its sweeps and to sweeps of the known classes, whose weights stay fixed.
///
/// It minimises `-sum of log p(label) + s |w - m|^2` over the new class's weights only, a convex problem in `width + 1` numbers.
/// The prior's mean matters here, unlike in a fit of new classes only.
///
/// All classes have equal weight, whatever their number of sweeps. So a class with few sweeps keeps them when a further class is added.
/// With unequal numbers the result is therefore not a maximum a posteriori estimate.
///
/// - `known`, `new`: features of sweeps of the known classes and of the new class
/// - `labels`: labels of the known sweeps
///
/// # Errors
/// The gradient does not vanish.
pub fn fit_new_class(
    head: &LinearHead,
    known: &Features,
    labels: &[usize],
    new: &Features,
    prior: &WeightPrior,
) -> Result<NewClass, ModelError> {
    let size = new.width() + 1;
    assert_eq!(
        prior.mean.len(),
        size,
        "a mean for each weight and the bias"
    );
    let classes = head.weights.len();
    let mut counts = vec![0.0; classes];
    labels.iter().for_each(|label| counts[*label] += 1.0);
    let present = counts.iter().filter(|count| **count > 0.0).count();
    let each = known.len() as f64 / present as f64;
    let problem = NewClassProblem {
        known: rows(head, known),
        known_weights: labels.iter().map(|label| each / counts[*label]).collect(),
        new_weights: vec![each / new.len() as f64; new.len()],
        new: rows(head, new),
        prior,
    };
    let Minimum {
        point,
        gradient_norm,
        start_norm,
        ..
    } = minimise(
        prior.mean.clone(),
        |x, gradient| problem.value(x, gradient),
        TOLERANCE,
        ITERATIONS,
    );
    let most = TOLERANCE * (100.0 * dot(&point, &point).sqrt().max(1.0)).max(start_norm);
    if gradient_norm.is_nan() || gradient_norm > most {
        return Err(ModelError::Fit {
            what: "new class",
            reason: format!("the gradient's norm is still {gradient_norm:e}"),
        });
    }
    Ok(NewClass {
        bias: point[size - 1],
        weights: point[..size - 1].to_vec(),
    })
}

/// Features of a sweep, followed by the constant 1 of the bias, and the log-sum-exp of the known classes' scores.
type Row = (Vec<f64>, f64);

fn rows(head: &LinearHead, features: &Features) -> Vec<Row> {
    let scores = head.scores(features);
    features
        .rows()
        .zip(scores)
        .map(|(row, scores)| {
            let row = row.iter().map(|v| f64::from(*v)).chain([1.0]).collect();
            (row, log_sum_exp(&scores))
        })
        .collect()
}

/// Penalised negative log-likelihood of a new class.
struct NewClassProblem<'a> {
    known: Vec<Row>,
    known_weights: Vec<f64>,
    new: Vec<Row>,
    new_weights: Vec<f64>,
    prior: &'a WeightPrior,
}

impl NewClassProblem<'_> {
    /// Returns the value at weights and bias `x` and writes the gradient.
    fn value(&self, x: &[f64], gradient: &mut [f64]) -> f64 {
        let (prior, last) = (self.prior, x.len() - 1);
        let mut value = 0.0;
        for ((g, w), m) in gradient.iter_mut().zip(x).zip(&prior.mean) {
            *g = 2.0 * prior.strength * (w - m);
            value += prior.strength * (w - m).powi(2);
        }
        // The bias has a separate penalty.
        let (away, share) = (x[last] - prior.mean[last], prior.bias_scale.powi(-2));
        gradient[last] *= share;
        value -= prior.strength * (1.0 - share) * away * away;
        // The loss of a sweep is the softplus of the margin by which the wrong side leads.
        for (rows, sign, weights) in [
            (&self.known, 1.0, &self.known_weights),
            (&self.new, -1.0, &self.new_weights),
        ] {
            for ((row, others), weight) in rows.iter().zip(weights) {
                let ahead = sign * (dot(x, row) - others);
                value += weight * (ahead.max(0.0) + (-ahead.abs()).exp().ln_1p());
                let slope = weight * sign / (1.0 + (-ahead).exp());
                gradient
                    .iter_mut()
                    .zip(row)
                    .for_each(|(g, u)| *g += slope * u);
            }
        }
        value
    }
}

fn log_sum_exp(scores: &[f64]) -> f64 {
    let largest = scores.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    largest + scores.iter().map(|s| (s - largest).exp()).sum::<f64>().ln()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four corners, of which the fourth is the new class.
    #[test]
    fn a_new_class_takes_its_own_corner_and_leaves_the_others() {
        let corners: [[f32; 2]; 4] = [[0.0, 0.0], [4.0, 0.0], [0.0, 4.0], [4.0, 4.0]];
        let jitter = |i: usize| [(i % 5) as f32 * 0.2 - 0.4, (i / 5) as f32 * 0.2 - 0.4];
        let cloud = |corner: [f32; 2], count: usize| -> Vec<f32> {
            (0..count)
                .flat_map(|i| [corner[0] + jitter(i)[0], corner[1] + jitter(i)[1]])
                .collect()
        };
        let known = Features::new(2, (0..3).flat_map(|c| cloud(corners[c], 25)).collect());
        let labels: Vec<usize> = (0..75).map(|i| i / 25).collect();
        let weak = WeightPrior {
            mean: vec![0.0; 3],
            strength: 0.01,
            bias_scale: 1.0,
        };
        let head = LinearHead::fit(&known, &labels, 3, &weak).unwrap();
        let new = Features::new(2, cloud(corners[3], 3));
        let NewClass { weights, bias } =
            fit_new_class(&head, &known, &labels, &new, &weak).unwrap();
        let mut both = head.clone();
        both.weights.push(weights);
        both.biases.push(bias);
        let label = |features: &Features| -> Vec<usize> {
            both.log_probabilities(features)
                .iter()
                .map(|row| crate::argmax(row))
                .collect()
        };
        assert_eq!(label(&known), labels, "the known classes keep their sweeps");
        assert!(
            label(&Features::new(2, cloud(corners[3], 25)))
                .iter()
                .all(|l| *l == 3)
        );
    }

    const CLASSES: usize = 4;
    const WIDTH: usize = 8 * (CLASSES + 1);

    /// Returns features in which a class activates its eight features; the last eight belong to the new class.
    fn activation(class: usize, strength: f32) -> Vec<f32> {
        let own = 8 * class..8 * class + 8;
        (0..WIDTH)
            .map(|feature| {
                if own.contains(&feature) {
                    strength
                } else {
                    0.0
                }
            })
            .collect()
    }

    /// Features of training sweeps are stronger than those of other sweeps. With a free bias, the new class would claim all weak features.
    #[test]
    fn a_penalised_bias_does_not_claim_weak_features_of_known_classes() {
        let jitter = |i: usize| 0.8 + 0.1 * (i % 5) as f32;
        let sweeps = |strength: f32| {
            let rows = (0..CLASSES * 12).flat_map(|i| activation(i / 12, strength * jitter(i)));
            Features::new(WIDTH, rows.collect())
        };
        let (learnt, others) = (sweeps(1.0), sweeps(0.3));
        let labels: Vec<usize> = (0..CLASSES * 12).map(|i| i / 12).collect();
        let news = |range: std::ops::Range<usize>| {
            let rows = range.flat_map(|i| {
                let beside = activation(i % 2, 0.15);
                let own = activation(CLASSES, 0.4 * jitter(i));
                own.into_iter()
                    .zip(beside)
                    .map(|(a, b)| a + b)
                    .collect::<Vec<_>>()
            });
            Features::new(WIDTH, rows.collect())
        };
        let head = LinearHead {
            weights: (0..CLASSES)
                .map(|class| {
                    activation(class, 0.5)
                        .iter()
                        .map(|w| f64::from(w - 0.05))
                        .collect()
                })
                .collect(),
            biases: vec![0.0; CLASSES],
        };
        let knowledge = WeightPrior::of_knowledge(&head);
        let claimed = |prior: &WeightPrior, features: &Features| {
            let NewClass { weights, bias } =
                fit_new_class(&head, &learnt, &labels, &news(0..6), prior).unwrap();
            let mut both = head.clone();
            both.weights.push(weights);
            both.biases.push(bias);
            let scores = both.scores(features);
            let claimed = scores.iter().filter(|row| crate::argmax(row) == CLASSES);
            claimed.count()
        };
        let free = knowledge.weaker(10.0);
        assert_eq!(claimed(&free, &learnt), 0);
        assert!(claimed(&free, &others) > 24, "half of the others are lost");
        for times in [100.0, 1000.0] {
            let penalised = knowledge.with_penalised_bias().weaker(times);
            assert_eq!(claimed(&penalised, &others), 0);
            assert_eq!(claimed(&penalised, &news(6..10)), 4);
        }
    }
}
