//! Softmax regression with a Gaussian prior: OL and OL-mean.

use crate::heads::span::Span;
use crate::lbfgs::{Minimum, dot, minimise};
use crate::{Features, ModelError, log_softmax};

/// Bound of the gradient's norm at the end of a fit, relative to the larger of 1 and the norm of the weights.
pub(super) const TOLERANCE: f64 = 1e-7;
/// Maximum number of iterations of a fit.
pub(super) const ITERATIONS: usize = 5000;

/// Weights of the class neurons: `score = weights . u + bias`.
#[derive(Debug, Clone, PartialEq)]
pub struct LinearHead {
    /// `[materials][width]`
    pub weights: Vec<Vec<f64>>,
    /// `[materials]`
    pub biases: Vec<f64>,
}

/// Gaussian prior on the weights of the class neurons.
#[derive(Debug, Clone, PartialEq)]
pub struct WeightPrior {
    /// `[width + 1]`: mean weights, then mean bias.
    pub mean: Vec<f64>,
    /// Strength s of the penalty `s |w - mean|^2` of each class.
    pub strength: f64,
    /// Scale of the bias penalty `s (b - mean)^2 / bias_scale^2`; 1 penalises the bias as strongly as the weights.
    pub bias_scale: f64,
}

/// Bias scale of a nearly unpenalised bias; the small penalty selects one of the solutions that differ by a constant.
const FREE_BIAS: f64 = 30.0;

impl WeightPrior {
    /// Returns the prior given by known classes: their mean, and `s = 1 / (2 sigma^2)` with `sigma^2` their mean squared distance
    /// from it per dimension (thesis, section 4.6.3; Bauer et al., 2017).
    ///
    /// The prior applies to the weights only; biases are nearly unpenalised. A strong pull of the biases towards one value would
    /// favour classes with large features.
    ///
    /// # Panics
    /// If there are fewer than two classes, or all classes are equal.
    pub fn of_knowledge(head: &LinearHead) -> Self {
        let classes = head.weights.len();
        assert!(classes > 1, "a variance needs at least two classes");
        let width = head.weights[0].len();
        let average = |values: &mut dyn Iterator<Item = f64>| values.sum::<f64>() / classes as f64;
        let mut mean: Vec<f64> = (0..width)
            .map(|i| average(&mut head.weights.iter().map(|row| row[i])))
            .collect();
        let squares: f64 = head
            .weights
            .iter()
            .flat_map(|row| row.iter().zip(&mean).map(|(w, m)| (w - m).powi(2)))
            .sum();
        let variance = squares / (classes * width) as f64;
        assert!(variance > 0.0, "knowledge classes differ");
        mean.push(average(&mut head.biases.iter().copied()));
        Self {
            mean,
            strength: 1.0 / (2.0 * variance),
            bias_scale: FREE_BIAS,
        }
    }

    /// Returns the prior with its strength divided by `times`.
    pub fn weaker(&self, times: f64) -> Self {
        Self {
            strength: self.strength / times,
            ..self.clone()
        }
    }

    /// Returns the prior with a bias that is penalised as strongly as the weights.
    pub fn with_penalised_bias(&self) -> Self {
        Self {
            bias_scale: 1.0,
            ..self.clone()
        }
    }

    /// Returns the prior that corresponds to training a network on `sweeps` sweeps with L2 penalty `l2`; its mean is zero.
    ///
    /// Adding `l2 * w` to the gradient of the mean loss is a penalty of `sweeps * l2 / 2` on the sum of the losses.
    pub fn weight_decay(width: usize, l2: f64, sweeps: usize) -> Self {
        Self {
            mean: vec![0.0; width + 1],
            strength: l2 * sweeps as f64 / 2.0,
            bias_scale: 1.0,
        }
    }
}

/// Penalised negative log-likelihood of softmax regression.
struct SoftmaxRegression<'a> {
    /// `[sweeps][dimension]`
    rows: &'a [Vec<f64>],
    /// `[sweeps]`
    labels: &'a [usize],
    /// `[dimension]`, mean of the prior
    mean: &'a [f64],
    strength: f64,
}

impl SoftmaxRegression<'_> {
    /// Returns the value at weights `x` `[materials][dimension]` and writes the gradient.
    fn value(&self, x: &[f64], gradient: &mut [f64]) -> f64 {
        let size = self.mean.len();
        let mut value = 0.0;
        for (class, gradient) in gradient.chunks_exact_mut(size).enumerate() {
            let weights = &x[class * size..][..size];
            for ((g, w), m) in gradient.iter_mut().zip(weights).zip(self.mean) {
                *g = 2.0 * self.strength * (w - m);
                value += self.strength * (w - m).powi(2);
            }
        }
        for (row, label) in self.rows.iter().zip(self.labels) {
            let scores: Vec<f64> = x
                .chunks_exact(size)
                .map(|weights| dot(weights, row))
                .collect();
            let largest = scores.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let sum: f64 = scores.iter().map(|s| (s - largest).exp()).sum();
            value += largest + sum.ln() - scores[*label];
            for (class, gradient) in gradient.chunks_exact_mut(size).enumerate() {
                let p = (scores[class] - largest).exp() / sum;
                let error = p - f64::from(u8::from(class == *label));
                gradient
                    .iter_mut()
                    .zip(row)
                    .for_each(|(g, u)| *g += error * u);
            }
        }
        value
    }
}

impl LinearHead {
    /// Fits softmax regression: minimises `-log p(labels | W) + s sum over classes of |w_c - m|^2`.
    ///
    /// - `labels`: `[sweeps]`, below `materials`
    ///
    /// # Errors
    /// The gradient does not vanish.
    pub fn fit(
        features: &Features,
        labels: &[usize],
        materials: usize,
        prior: &WeightPrior,
    ) -> Result<Self, ModelError> {
        let width = features.width() + 1;
        assert_eq!(
            prior.mean.len(),
            width,
            "a mean for each weight and the bias"
        );
        // Dividing the bias by its scale makes the penalty the same in all directions.
        let scale = prior.bias_scale;
        let mut centre = prior.mean.clone();
        centre[width - 1] /= scale;
        let span = Span::of(features, scale);
        let (rows, size) = (&span.coordinates, span.dimension());
        let mean = span.project(&centre);
        let start: Vec<f64> = mean.repeat(materials);
        let problem = SoftmaxRegression {
            rows,
            labels,
            mean: &mean,
            strength: prior.strength,
        };
        let Minimum {
            point,
            gradient_norm,
            start_norm,
            ..
        } = minimise(
            start,
            |x, gradient| problem.value(x, gradient),
            TOLERANCE,
            ITERATIONS,
        );
        let norm = point.iter().map(|w| w * w).sum::<f64>().sqrt().max(1.0);
        // The gradient is a sum over all sweeps, so its rounding error grows with its norm at the start.
        let most = TOLERANCE * (100.0 * norm).max(start_norm);
        if gradient_norm.is_nan() || gradient_norm > most {
            return Err(ModelError::Fit {
                what: "output layer",
                reason: format!("the gradient's norm is still {gradient_norm:e}"),
            });
        }
        let rows: Vec<Vec<f64>> = point
            .chunks_exact(size)
            .map(|row| span.lift(row, &mean, &centre))
            .collect();
        Ok(Self {
            weights: rows.iter().map(|row| row[..width - 1].to_vec()).collect(),
            biases: rows.iter().map(|row| row[width - 1] * scale).collect(),
        })
    }

    /// Returns the scores in front of the softmax, `[sweeps][materials]`.
    pub fn scores(&self, features: &Features) -> Vec<Vec<f64>> {
        features
            .rows()
            .map(|row| {
                let own = self.weights.iter().zip(&self.biases);
                own.map(|(weights, bias)| {
                    let products = weights.iter().zip(row).map(|(w, u)| w * f64::from(*u));
                    products.sum::<f64>() + bias
                })
                .collect()
            })
            .collect()
    }

    /// Returns log-probabilities `[sweeps][materials]`.
    pub fn log_probabilities(&self, features: &Features) -> Vec<Vec<f64>> {
        self.scores(features)
            .iter()
            .map(|scores| {
                let scores: Vec<f32> = scores.iter().map(|score| *score as f32).collect();
                log_softmax(&scores)
            })
            .collect()
    }
}
