//! Sweeps that feel like another material: a seam, a worn patch, a different position of the tube.

use rand_chacha::ChaCha8Rng;

use super::embedding::MATERIALS;
use super::gaussian::unit;

/// Materials that the sweeps of each material may feel like, from the published confusions.
pub(super) struct Excursions {
    /// Share of excursions among the sweeps of each material.
    share: Vec<f64>,
    /// Confusions of each material with the others, as shares of their sum.
    others: Vec<[f64; MATERIALS]>,
}

/// Target of one sweep's excursion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Excursion {
    /// Label of the other material.
    pub(super) towards: usize,
    /// Share of the way to the other material; above 1 the sweep goes beyond it.
    pub(super) reach: f64,
}

impl Excursions {
    /// Returns shares that are proportional to each material's errors, with the given mean.
    ///
    /// - `confusions`: `[36][36]`, rows are true materials
    pub(super) fn new(confusions: &[[f64; MATERIALS]], mean: f64) -> Self {
        let errors: Vec<f64> = (0..confusions.len())
            .map(|true_one| {
                let row: f64 = confusions[true_one].iter().sum();
                1.0 - confusions[true_one][true_one] / row
            })
            .collect();
        let average = errors.iter().sum::<f64>() / errors.len() as f64;
        let others = (0..confusions.len()).map(|true_one| {
            let mut others = confusions[true_one];
            others[true_one] = 0.0;
            let sum: f64 = others.iter().sum();
            // A material that is never confused has no excursions.
            others.map(|share| if sum > 0.0 { share / sum } else { 0.0 })
        });
        Self {
            others: others.collect(),
            share: errors.iter().map(|error| mean * error / average).collect(),
        }
    }

    /// Draws the excursion of a sweep of material `label` from a separate stream; `None` if it has none.
    pub(super) fn draw(
        &self,
        label: usize,
        reach: [f64; 2],
        rng: &mut ChaCha8Rng,
    ) -> Option<Excursion> {
        let (astray, mut left, along) = (unit(rng), unit(rng), unit(rng));
        if astray >= self.share[label] {
            return None;
        }
        let towards = self.others[label].iter().position(|&share| {
            left -= share;
            left < 0.0
        })?;
        Some(Excursion {
            towards,
            reach: reach[0] + along * (reach[1] - reach[0]),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::embedding::published_confusions;
    use super::*;
    use crate::Seed;

    #[test]
    fn sweeps_go_astray_as_often_and_where_the_published_errors_say() {
        let confusions = published_confusions();
        let excursions = Excursions::new(&confusions, 0.13);
        const DRAWS: usize = 20_000;
        let mut all = 0;
        for label in [0, 10, 20, 35] {
            let mut rng = Seed(3).rng(("test", label));
            let mut towards = [0usize; MATERIALS];
            for _ in 0..DRAWS {
                if let Some(found) = excursions.draw(label, [0.44, 1.24], &mut rng) {
                    assert!((0.44..1.24).contains(&found.reach));
                    towards[found.towards] += 1;
                }
            }
            let astray: usize = towards.iter().sum();
            assert_eq!(towards[label], 0);
            for (other, &count) in towards.iter().enumerate() {
                let expected = excursions.share[label] * excursions.others[label][other];
                // The tolerance is four standard errors of a share.
                let error = 4.0 * (expected.max(1e-4) / DRAWS as f64).sqrt();
                let found = count as f64 / DRAWS as f64;
                assert!((found - expected).abs() < error, "{label} to {other}");
            }
            all += astray;
        }
        assert!(all > 0);
        let mean = excursions.share.iter().sum::<f64>() / MATERIALS as f64;
        assert!((mean - 0.13).abs() < 1e-12);
    }
}
