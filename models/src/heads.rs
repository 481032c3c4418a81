//! Output layers for a few sweeps of new materials, on the features of a trained network.
//!
//! All are fitted to `[sweeps][width]` features `u` of the task's sweeps. `OL` and `OL-mean` are convex problems and solved until the
//! gradient vanishes (thesis, section 4.6); SimpleShot and whitened LDA have closed forms.

use faer::{Mat, Par, Side};

use crate::lbfgs::{Minimum, dot, minimise};
use crate::{Features, ModelError, log_softmax};

/// Norm of the gradient at the end of a fit, relative to the larger of 1 and the norm of the weights.
const TOLERANCE: f64 = 1e-7;
/// Iterations after which a fit is given up.
const ITERATIONS: usize = 5000;

/// Weights of class neurons: `score = weights . u + bias`.
#[derive(Debug, Clone, PartialEq)]
pub struct LinearHead {
    /// `[materials][width]`
    pub weights: Vec<Vec<f64>>,
    /// `[materials]`
    pub biases: Vec<f64>,
}

/// Gaussian prior on the weights of class neurons.
#[derive(Debug, Clone, PartialEq)]
pub struct WeightPrior {
    /// `[width + 1]`: mean weights, then mean bias.
    pub mean: Vec<f64>,
    /// Strength s: the penalty is `s |w - mean|^2` for each class.
    pub strength: f64,
}

impl WeightPrior {
    /// The prior that knowledge classes give: their mean, and `s = 1 / (2 sigma^2)` with `sigma^2` their mean squared distance
    /// from it per dimension (thesis, section 4.6.3; Bauer et al., 2017). The bias counts as one more dimension, so `F = width + 1`.
    ///
    /// # Panics
    /// With fewer than two classes, or classes that are all the same.
    pub fn of_knowledge(head: &LinearHead) -> Self {
        let classes = head.weights.len();
        assert!(classes > 1, "a variance needs at least two classes");
        let rows: Vec<Vec<f64>> = head
            .weights
            .iter()
            .zip(&head.biases)
            .map(|(weights, bias)| [weights.as_slice(), &[*bias]].concat())
            .collect();
        let size = rows[0].len();
        let mean: Vec<f64> = (0..size)
            .map(|i| rows.iter().map(|row| row[i]).sum::<f64>() / classes as f64)
            .collect();
        let squares: f64 = rows
            .iter()
            .flat_map(|row| row.iter().zip(&mean).map(|(w, m)| (w - m).powi(2)))
            .sum();
        let variance = squares / (classes * size) as f64;
        assert!(variance > 0.0, "knowledge classes differ");
        Self {
            mean,
            strength: 1.0 / (2.0 * variance),
        }
    }

    /// Centred at zero: the penalty that training a network with this L2 puts on the sum of the losses of `sweeps` sweeps. Adding
    /// `l2 * w` to the gradient of their mean is a penalty of `sweeps * l2 / 2` on their sum.
    pub fn weight_decay(width: usize, l2: f64, sweeps: usize) -> Self {
        Self {
            mean: vec![0.0; width + 1],
            strength: l2 * sweeps as f64 / 2.0,
        }
    }
}

/// Sweeps in an orthonormal basis of what they span, where they are fewer than the features: the loss only depends on a weight's part
/// in that span, and the penalty is least with its other part at the prior's mean. So a few sweeps make a small problem.
struct Span {
    /// `[sweeps][dimension]`
    coordinates: Vec<Vec<f64>>,
    /// `[width + 1, dimension]`; absent where nothing is gained.
    basis: Option<Mat<f64>>,
}

impl Span {
    fn of(features: &Features) -> Self {
        let (sweeps, width) = (features.len(), features.width() + 1);
        let rows: Vec<Vec<f64>> = features
            .rows()
            .map(|row| row.iter().map(|v| f64::from(*v)).chain([1.0]).collect())
            .collect();
        if sweeps >= width {
            return Self {
                coordinates: rows,
                basis: None,
            };
        }
        // On several threads faer's sums depend on how many there are.
        faer::set_global_parallelism(Par::Seq);
        let columns = Mat::<f64>::from_fn(width, sweeps, |i, j| rows[j][i]);
        let qr = columns.qr();
        let triangle = qr.thin_R();
        Self {
            coordinates: (0..sweeps)
                .map(|sweep| {
                    (0..sweeps)
                        .map(|i| {
                            if i <= sweep {
                                triangle[(i, sweep)]
                            } else {
                                0.0
                            }
                        })
                        .collect()
                })
                .collect(),
            basis: Some(qr.compute_thin_Q()),
        }
    }

    fn dimension(&self) -> usize {
        self.coordinates.first().map_or(0, Vec::len)
    }

    /// A vector's part in the span, in its coordinates.
    fn project(&self, vector: &[f64]) -> Vec<f64> {
        match &self.basis {
            None => vector.to_vec(),
            Some(basis) => (0..basis.ncols())
                .map(|j| {
                    vector
                        .iter()
                        .enumerate()
                        .map(|(i, v)| basis[(i, j)] * v)
                        .sum()
                })
                .collect(),
        }
    }

    /// The vector with these coordinates whose part outside the span is that of `outside`, which itself projects to `projected`.
    fn lift(&self, coordinates: &[f64], projected: &[f64], outside: &[f64]) -> Vec<f64> {
        match &self.basis {
            None => coordinates.to_vec(),
            Some(basis) => outside
                .iter()
                .enumerate()
                .map(|(i, out)| {
                    let inside = coordinates.iter().zip(projected).enumerate();
                    out + inside
                        .map(|(j, (c, p))| basis[(i, j)] * (c - p))
                        .sum::<f64>()
                })
                .collect(),
        }
    }
}

impl LinearHead {
    /// Softmax regression: minimises `-log p(labels | W) + s sum over classes of |w_c - m|^2`.
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
        let span = Span::of(features);
        let (rows, size) = (&span.coordinates, span.dimension());
        let mean = span.project(&prior.mean);
        let start: Vec<f64> = mean.repeat(materials);
        let objective = |x: &[f64], gradient: &mut [f64]| -> f64 {
            let mut value = 0.0;
            for (class, gradient) in gradient.chunks_exact_mut(size).enumerate() {
                let weights = &x[class * size..][..size];
                for ((g, w), m) in gradient.iter_mut().zip(weights).zip(&mean) {
                    *g = 2.0 * prior.strength * (w - m);
                    value += prior.strength * (w - m).powi(2);
                }
            }
            for (row, label) in rows.iter().zip(labels) {
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
        };
        let Minimum {
            point,
            gradient_norm,
            start_norm,
            ..
        } = minimise(start, objective, TOLERANCE, ITERATIONS);
        let norm = point.iter().map(|w| w * w).sum::<f64>().sqrt().max(1.0);
        // Rounding leaves a gradient that grows with the one at the start, a sum over all sweeps.
        let most = TOLERANCE * (100.0 * norm).max(start_norm);
        if gradient_norm.is_nan() || gradient_norm > most {
            return Err(ModelError::Fit {
                what: "output layer",
                reason: format!("the gradient's norm is still {gradient_norm:e}"),
            });
        }
        let rows: Vec<Vec<f64>> = point
            .chunks_exact(size)
            .map(|row| span.lift(row, &mean, &prior.mean))
            .collect();
        Ok(Self {
            weights: rows.iter().map(|row| row[..width - 1].to_vec()).collect(),
            biases: rows.iter().map(|row| row[width - 1]).collect(),
        })
    }

    /// Log-probabilities `[sweeps][materials]`.
    pub fn log_probabilities(&self, features: &Features) -> Vec<Vec<f64>> {
        features
            .rows()
            .map(|row| {
                let scores: Vec<f32> = self
                    .weights
                    .iter()
                    .zip(&self.biases)
                    .map(|(weights, bias)| {
                        let products = weights.iter().zip(row).map(|(w, u)| w * f64::from(*u));
                        (products.sum::<f64>() + bias) as f32
                    })
                    .collect();
                log_softmax(&scores)
            })
            .collect()
    }
}

/// Nearest class mean after centring on the knowledge set's mean and scaling to unit length (SimpleShot, CL2N; Wang et al., 2019).
#[derive(Debug, Clone, PartialEq)]
pub struct SimpleShot {
    /// `[width]`, mean feature of the knowledge set.
    centre: Vec<f64>,
    /// `[materials][width]`, means of centred, normalised features.
    means: Vec<Vec<f64>>,
}

impl SimpleShot {
    /// Means of the task's classes.
    ///
    /// # Panics
    /// If a class has no sweep.
    pub fn fit(features: &Features, labels: &[usize], materials: usize, centre: Vec<f64>) -> Self {
        let rows: Vec<Vec<f64>> = features
            .rows()
            .map(|row| centred_unit(row, &centre))
            .collect();
        Self {
            means: class_means(&rows, labels, materials),
            centre,
        }
    }

    /// Minus the squared distance to every class mean: `[sweeps][materials]`.
    pub fn scores(&self, features: &Features) -> Vec<Vec<f64>> {
        features
            .rows()
            .map(|row| {
                let row = centred_unit(row, &self.centre);
                self.means
                    .iter()
                    .map(|mean| -squared_distance(&row, mean))
                    .collect()
            })
            .collect()
    }
}

/// A linear map that makes the knowledge set's within-class covariance the identity, shrunk towards its mean variance.
#[derive(Debug, Clone)]
pub struct Whitening {
    /// `[width]`
    centre: Vec<f64>,
    /// `[width][width]`
    map: Mat<f64>,
}

impl Whitening {
    /// Fits to the knowledge set.
    ///
    /// - `shrinkage`: share of the mean variance in every direction, 0 to 1; above 0 where there are fewer sweeps than features
    ///
    /// # Errors
    /// A covariance whose eigenvalues are not found.
    pub fn fit(
        features: &Features,
        labels: &[usize],
        materials: usize,
        shrinkage: f64,
    ) -> Result<Self, ModelError> {
        let width = features.width();
        let rows: Vec<Vec<f64>> = features
            .rows()
            .map(|row| row.iter().map(|v| f64::from(*v)).collect())
            .collect();
        let means = class_means(&rows, labels, materials);
        faer::set_global_parallelism(Par::Seq);
        let residuals =
            Mat::<f64>::from_fn(rows.len(), width, |i, j| rows[i][j] - means[labels[i]][j]);
        let degrees = rows.len().saturating_sub(materials).max(1) as f64;
        let mut covariance = residuals.transpose() * &residuals;
        let mean_variance =
            (0..width).map(|i| covariance[(i, i)]).sum::<f64>() / degrees / width as f64;
        for i in 0..width {
            for j in 0..width {
                covariance[(i, j)] *= (1.0 - shrinkage) / degrees;
            }
            covariance[(i, i)] += shrinkage * mean_variance;
        }
        let eigen = covariance
            .self_adjoint_eigen(Side::Lower)
            .map_err(|error| ModelError::Fit {
                what: "whitening",
                reason: format!("no eigenvalues of the covariance: {error:?}"),
            })?;
        let (vectors, values) = (eigen.U(), eigen.S().column_vector());
        let floor = 1e-9 * mean_variance.max(f64::MIN_POSITIVE);
        let scaled = Mat::<f64>::from_fn(width, width, |i, j| {
            vectors[(i, j)] / values[j].max(floor).sqrt()
        });
        let centre = (0..width)
            .map(|i| rows.iter().map(|row| row[i]).sum::<f64>() / rows.len() as f64)
            .collect();
        Ok(Self {
            centre,
            map: vectors * scaled.transpose(),
        })
    }

    /// Whitened features: `[sweeps][width]`.
    pub fn apply(&self, features: &Features) -> Features {
        faer::set_global_parallelism(Par::Seq);
        let width = features.width();
        let centred = Mat::<f64>::from_fn(features.len(), width, |i, j| {
            f64::from(features.row(i)[j]) - self.centre[j]
        });
        let mapped = centred * &self.map;
        let values = (0..features.len())
            .flat_map(|i| (0..width).map(move |j| (i, j)))
            .map(|(i, j)| mapped[(i, j)] as f32)
            .collect();
        Features::new(width, values)
    }
}

/// Linear discriminant analysis with the knowledge set's within-class covariance: the nearest class mean among whitened features.
#[derive(Debug, Clone, PartialEq)]
pub struct NearestMean {
    /// `[materials][width]`
    means: Vec<Vec<f64>>,
}

impl NearestMean {
    /// Means of the task's classes.
    ///
    /// # Panics
    /// If a class has no sweep.
    pub fn fit(features: &Features, labels: &[usize], materials: usize) -> Self {
        let rows: Vec<Vec<f64>> = features
            .rows()
            .map(|row| row.iter().map(|v| f64::from(*v)).collect())
            .collect();
        Self {
            means: class_means(&rows, labels, materials),
        }
    }

    /// Minus half the squared distance to every class mean: log-likelihoods up to a constant where features are whitened.
    pub fn scores(&self, features: &Features) -> Vec<Vec<f64>> {
        features
            .rows()
            .map(|row| {
                let row: Vec<f64> = row.iter().map(|v| f64::from(*v)).collect();
                self.means
                    .iter()
                    .map(|mean| -0.5 * squared_distance(&row, mean))
                    .collect()
            })
            .collect()
    }
}

fn class_means(rows: &[Vec<f64>], labels: &[usize], materials: usize) -> Vec<Vec<f64>> {
    let width = rows.first().map_or(0, Vec::len);
    let mut means = vec![vec![0.0; width]; materials];
    let mut counts = vec![0.0; materials];
    for (row, &label) in rows.iter().zip(labels) {
        means[label].iter_mut().zip(row).for_each(|(m, v)| *m += v);
        counts[label] += 1.0;
    }
    for (mean, count) in means.iter_mut().zip(&counts) {
        assert!(*count > 0.0, "every class has a sweep");
        mean.iter_mut().for_each(|m| *m /= count);
    }
    means
}

fn centred_unit(row: &[f32], centre: &[f64]) -> Vec<f64> {
    let centred: Vec<f64> = row
        .iter()
        .zip(centre)
        .map(|(v, c)| f64::from(*v) - c)
        .collect();
    let norm = centred.iter().map(|v| v * v).sum::<f64>().sqrt();
    if norm == 0.0 {
        return centred;
    }
    centred.iter().map(|v| v / norm).collect()
}

fn squared_distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Weights;

    /// `tests/golden/heads_with_scipy.py`
    struct Golden(Weights);

    impl Golden {
        fn read() -> Self {
            let path = concat!(
                env!("CARGO_MANIFEST_DIR"),
                "/../tests/golden/heads.safetensors"
            );
            Self(Weights::from_safetensors(&std::fs::read(path).unwrap()).unwrap())
        }

        fn values(&self, name: &str) -> &[f32] {
            &self.0.0[name].values
        }

        fn features(&self, name: &str) -> Features {
            Features::new(self.0.0[name].shape[1], self.values(name).to_vec())
        }

        fn labels(&self, name: &str) -> Vec<usize> {
            self.values(name).iter().map(|v| *v as usize).collect()
        }

        fn knowledge(&self) -> LinearHead {
            let rows = self.features("knowledge");
            let part = |range: std::ops::Range<usize>| -> Vec<Vec<f64>> {
                rows.rows()
                    .map(|row| row[range.clone()].iter().map(|v| f64::from(*v)).collect())
                    .collect()
            };
            LinearHead {
                weights: part(0..12),
                biases: part(12..13).concat(),
            }
        }
    }

    #[test]
    fn the_prior_of_knowledge_classes_is_the_published_one() {
        let golden = Golden::read();
        let prior = WeightPrior::of_knowledge(&golden.knowledge());
        let expected = f64::from(golden.values("strength")[0]);
        assert!(
            (prior.strength / expected - 1.0).abs() < 1e-6,
            "{}",
            prior.strength
        );
    }

    #[test]
    fn output_layers_are_at_scipys_minimum() {
        let golden = Golden::read();
        let (features, labels) = (golden.features("features"), golden.labels("labels"));
        let priors = [
            (
                "ol_mean.weights",
                WeightPrior::of_knowledge(&golden.knowledge()),
            ),
            (
                "ol.weights",
                WeightPrior::weight_decay(12, 1e-3, labels.len()),
            ),
        ];
        for (name, prior) in priors {
            let head = LinearHead::fit(&features, &labels, 4, &prior).unwrap();
            for (class, expected) in golden.features(name).rows().enumerate() {
                let found = head.weights[class].iter().chain([&head.biases[class]]);
                for (found, expected) in found.zip(expected) {
                    // The weak penalty of OL leaves a flat valley; both ends have gradients below 1e-6.
                    let tolerance = 2e-5 * f64::from(expected.abs()).max(1.0);
                    assert!(
                        (found - f64::from(*expected)).abs() < tolerance,
                        "{name}: {found} {expected}"
                    );
                }
            }
        }
    }

    #[test]
    fn whitened_nearest_means_are_gaussians_with_one_covariance() {
        let golden = Golden::read();
        let (features, labels) = (golden.features("lda.features"), golden.labels("lda.labels"));
        let whitening = Whitening::fit(&features, &labels, 4, 0.0).unwrap();
        let means = NearestMean::fit(&whitening.apply(&features), &labels, 4);
        let scores = means.scores(&whitening.apply(&golden.features("queries")));
        for (scores, expected) in scores
            .iter()
            .zip(golden.values("lda.log_p").chunks_exact(4))
        {
            let scores: Vec<f32> = scores.iter().map(|s| *s as f32).collect();
            for (found, expected) in log_softmax(&scores).iter().zip(expected) {
                // Whitened values are kept in single precision.
                let error = (found - f64::from(*expected)).abs();
                assert!(
                    error < 2e-4 * f64::from(expected.abs()).max(1.0),
                    "{found} {expected}"
                );
            }
        }
    }

    #[test]
    fn simpleshot_takes_the_nearest_direction() {
        let features = Features::new(2, vec![2.0, 1.0, 9.0, 1.0, 1.0, 2.0, 1.0, 7.0]);
        let head = SimpleShot::fit(&features, &[0, 0, 1, 1], 2, vec![1.0, 1.0]);
        let scores = head.scores(&Features::new(2, vec![50.0, 2.0, 1.5, 30.0]));
        assert!(
            scores[0][0] > scores[0][1] && scores[1][1] > scores[1][0],
            "{scores:?}"
        );
    }
}
