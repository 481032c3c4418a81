//! k-nearest-neighbour classifier with Euclidean distance; linfa-nn does the search.

use linfa_nn::distance::L2Dist;
use linfa_nn::{CommonNearestNeighbour, NearestNeighbour};
use rayon::prelude::*;

use crate::Features;

/// Training sweeps and the number of neighbours that vote.
#[derive(Debug, Clone, PartialEq)]
pub struct Knn {
    /// `[sweeps][width]`
    pub features: Features,
    /// `[sweeps]`
    pub labels: Vec<usize>,
    /// Number of materials.
    pub materials: usize,
    /// Number of neighbours that vote, k.
    pub neighbours: usize,
}

impl Knn {
    /// Returns log-probabilities `[sweeps][materials]` from the share of votes.
    ///
    /// One extra vote is spread evenly over all materials, so that a material without votes is not ruled out when sweeps are fused.
    ///
    /// # Panics
    /// If `queries` have another width.
    pub fn log_probabilities(&self, queries: &Features) -> Vec<Vec<f64>> {
        let points = self.features.to_ndarray();
        let queries = queries.to_ndarray();
        let index = CommonNearestNeighbour::LinearSearch
            .from_batch(&points, L2Dist)
            .unwrap_or_else(|error| panic!("features have a width: {error}"));
        (0..queries.nrows())
            .into_par_iter()
            .map(|query| {
                let nearest = index
                    .k_nearest(queries.row(query), self.neighbours)
                    .unwrap_or_else(|error| panic!("queries are as wide as features: {error}"));
                let mut votes = vec![0.0; self.materials];
                for (_, position) in &nearest {
                    votes[self.labels[*position]] += 1.0;
                }
                let all = nearest.len() as f64 + 1.0;
                votes
                    .iter()
                    .map(|votes: &f64| ((votes + 1.0 / self.materials as f64) / all).ln())
                    .collect()
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_sweeps_vote() {
        let knn = Knn {
            features: Features::new(1, vec![0.0, 1.0, 2.0, 10.0, 11.0]),
            labels: vec![0, 0, 1, 1, 1],
            materials: 3,
            neighbours: 3,
        };
        let rows = knn.log_probabilities(&Features::new(1, vec![0.4, 10.6]));
        let expected = [[2.0, 1.0, 0.0], [0.0, 3.0, 0.0]];
        for (row, votes) in rows.iter().zip(expected) {
            for (log_p, votes) in row.iter().zip(votes) {
                assert!((log_p.exp() - (votes + 1.0 / 3.0) / 4.0).abs() < 1e-12);
            }
        }
    }
}
