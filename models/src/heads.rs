//! Output layers for new materials with few sweeps, on the features of a trained network.
//!
//! All heads are fitted to features `u` of the task's sweeps, `[sweeps][width]`. `OL` and `OL-mean` are convex problems, which are solved
//! until the gradient vanishes (thesis, section 4.6). SimpleShot and whitened LDA have closed forms.

mod linear;
mod nearest_mean;
mod new_class;
mod simpleshot;
mod span;
mod whitening;

pub use linear::{LinearHead, WeightPrior};
pub use nearest_mean::NearestMean;
pub use new_class::{NewClass, fit_new_class};
pub use simpleshot::SimpleShot;
pub use whitening::Whitening;

/// Returns the mean row of each label.
///
/// # Panics
/// If a label has no row.
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

fn squared_distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Features, Weights, log_softmax};

    /// Tensors written by `tests/golden/heads_with_scipy.py`.
    struct Golden(Weights);

    impl Golden {
        fn read() -> Self {
            let file = include_bytes!("../../tests/golden/heads.safetensors");
            Self(Weights::from_safetensors(file).unwrap())
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
                    // The weak penalty of OL leaves a flat valley: the gradient is below 1e-6 at both solutions.
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
                // Whitened values are stored in single precision.
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
