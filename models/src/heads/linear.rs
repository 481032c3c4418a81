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
    /// Scores that are added to those of the weights, `[sweeps][materials]`; `None`: none.
    offsets: Option<&'a [Vec<f64>]>,
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
        for (sweep, (row, label)) in self.rows.iter().zip(self.labels).enumerate() {
            let mut scores: Vec<f64> = x
                .chunks_exact(size)
                .map(|weights| dot(weights, row))
                .collect();
            if let Some(offsets) = self.offsets {
                let own = scores.iter_mut().zip(&offsets[sweep]);
                own.for_each(|(score, offset)| *score += offset);
            }
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
        Self::fit_beside(features, labels, materials, prior, None)
    }

    /// Fits softmax regression with this head as the mean of the prior: minimises `-log p(labels | W) + s sum over classes of |w_c - old_c|^2`.
    ///
    /// Features count from their mean over the sweeps, and `s` is `strength` times their mean squared length, so that it does not depend on
    /// their scale. The bias is penalised with `strength`.
    ///
    /// - `labels`: `[sweeps]`, below the number of this head's materials; materials may be missing
    ///
    /// # Errors
    /// The gradient does not vanish.
    pub fn fit_from(
        &self,
        features: &Features,
        labels: &[usize],
        strength: f64,
    ) -> Result<Self, ModelError> {
        let (width, sweeps) = (features.width(), features.len().max(1) as f64);
        let mut centre = vec![0.0; width];
        for row in features.rows() {
            let own = centre.iter_mut().zip(row);
            own.for_each(|(mean, value)| *mean += f64::from(*value) / sweeps);
        }
        let centred = features.rows().flat_map(|row| {
            let own = row.iter().zip(&centre);
            own.map(|(value, mean)| (f64::from(*value) - mean) as f32)
        });
        let centred = Features::new(width, centred.collect());
        let squares = centred.values().iter().map(|v| f64::from(*v).powi(2));
        // The length of a single sweep, which is its own mean, is zero.
        let square = (squares.sum::<f64>() / sweeps).max(1e-12);
        let prior = WeightPrior {
            mean: vec![0.0; width + 1],
            strength: strength * square,
            bias_scale: square.sqrt(),
        };
        let scores = self.scores(features);
        let materials = self.biases.len();
        let change = Self::fit_beside(&centred, labels, materials, &prior, Some(&scores))?;
        let mut fitted = self.clone();
        for (label, row) in change.weights.iter().enumerate() {
            let own = fitted.weights[label].iter_mut().zip(row);
            own.for_each(|(weight, change)| *weight += change);
            fitted.biases[label] += change.biases[label] - dot(row, &centre);
        }
        Ok(fitted)
    }

    /// - `offsets`: scores that are added to those of the head, `[sweeps][materials]`
    fn fit_beside(
        features: &Features,
        labels: &[usize],
        materials: usize,
        prior: &WeightPrior,
        offsets: Option<&[Vec<f64>]>,
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
            offsets,
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Two overlapping clouds, so that the likelihood has a maximum at finite weights.
    fn clouds(shift: f32) -> (Features, Vec<usize>) {
        let values = (0..24).flat_map(|i| {
            let label = (i % 2) as f32;
            let wave = |k: f32| (i as f32 * k).sin();
            [
                label + 1.5 * wave(1.7) + shift,
                2.0 * wave(2.3) - 0.5 * label,
            ]
        });
        (
            Features::new(2, values.collect()),
            (0..24).map(|i| i % 2).collect(),
        )
    }

    fn fresh(features: &Features, labels: &[usize], strength: f64) -> LinearHead {
        let prior = WeightPrior {
            mean: vec![0.0; 3],
            strength,
            bias_scale: 1.0,
        };
        LinearHead::fit(features, labels, 2, &prior).unwrap()
    }

    fn most_apart(a: &LinearHead, b: &LinearHead, features: &Features) -> f64 {
        let (a, b) = (a.log_probabilities(features), b.log_probabilities(features));
        let pairs = a.iter().flatten().zip(b.iter().flatten());
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn a_strong_prior_keeps_the_old_head_and_a_weak_one_gives_the_fresh_one() {
        let (features, labels) = clouds(0.0);
        let old = fresh(&features, &labels, 0.1);
        let (moved, labels) = clouds(3.0);
        let strong = old.fit_from(&moved, &labels, 1e9).unwrap();
        // The change of a score is about one over the strength.
        assert!(most_apart(&strong, &old, &moved) < 1e-6);
        let weak = old.fit_from(&moved, &labels, 1e-8).unwrap();
        let anew = fresh(&moved, &labels, 1e-8);
        // Both stop at a relative gradient of 1e-7; scores are below 100.
        assert!(most_apart(&weak, &anew, &moved) < 1e-3);
        assert!(most_apart(&old, &anew, &moved) > 0.5, "the sets differ");
    }

    #[test]
    fn the_prior_does_not_depend_on_the_scale_of_the_features() {
        let (features, labels) = clouds(0.0);
        let old = fresh(&features, &labels, 0.1);
        let (moved, labels) = clouds(3.0);
        let times = |by: f32| {
            let values = moved.values().iter().map(|value| by * value);
            Features::new(2, values.collect())
        };
        let by_eight = |by: f64| LinearHead {
            weights: old
                .weights
                .iter()
                .map(|row| row.iter().map(|weight| weight / by).collect())
                .collect(),
            biases: old.biases.clone(),
        };
        let plain = old.fit_from(&moved, &labels, 0.3).unwrap();
        let large = by_eight(8.0).fit_from(&times(8.0), &labels, 0.3).unwrap();
        let plain = plain.log_probabilities(&moved);
        let large = large.log_probabilities(&times(8.0));
        for (a, b) in plain.iter().flatten().zip(large.iter().flatten()) {
            // Both stop at a relative gradient of 1e-7.
            assert!((a - b).abs() < 1e-4, "{a} {b}");
        }
    }
}
