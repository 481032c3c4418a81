//! Signals of a sweep whose noise is compared: single taxels, or the sum of taxels that seldom respond.

/// Maximum number of taxels that are looked at.
const TAXELS: usize = 16;
/// Minimum number of taxels that seldom respond, as those of an event camera, for their sum to be a signal.
const SPARSE_TAXELS: usize = 4;

/// Signal of a sweep.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Series {
    Taxel(usize),
    /// Sum of the taxels that have one value in most frames.
    Sparse,
}

impl Series {
    /// Returns up to 16 taxels.
    pub(super) fn of_taxels(taxels: usize) -> impl Iterator<Item = Self> {
        (0..taxels)
            .step_by(taxels.div_ceil(TAXELS))
            .map(Self::Taxel)
    }

    /// Returns the values of the signal: `[steps]`; an empty list if too few taxels are sparse.
    ///
    /// - `values`: values of the sweep, `[steps][taxels]`
    pub(super) fn of(self, values: &[f32], taxels: usize) -> Vec<f64> {
        match self {
            Self::Taxel(taxel) => taxel_of(values, taxel, taxels).map(f64::from).collect(),
            Self::Sparse => sparse_sum(values, taxels),
        }
    }
}

fn taxel_of(values: &[f32], taxel: usize, taxels: usize) -> impl Iterator<Item = f32> {
    values.iter().skip(taxel).step_by(taxels).copied()
}

fn sparse_sum(values: &[f32], taxels: usize) -> Vec<f64> {
    let usual_values = (0..taxels).filter_map(|taxel| {
        let mut of_taxel: Vec<f32> = taxel_of(values, taxel, taxels).collect();
        let middle = of_taxel.len() / 2;
        let usual = *of_taxel.select_nth_unstable_by(middle, f32::total_cmp).1;
        let at_rest = of_taxel.iter().filter(|value| **value == usual).count();
        let is_sparse = 2 * at_rest > of_taxel.len() && at_rest < of_taxel.len();
        is_sparse.then_some((taxel, usual))
    });
    let sparse: Vec<(usize, f32)> = usual_values.collect();
    if sparse.len() < SPARSE_TAXELS {
        return Vec::new();
    }
    let sum = |frame: &[f32]| -> f64 {
        let parts = sparse
            .iter()
            .map(|&(taxel, usual)| f64::from(frame[taxel] - usual));
        parts.sum()
    };
    values.chunks_exact(taxels).map(sum).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn taxels_that_seldom_respond_are_added() {
        // Six taxels: four respond once each, one always, one never.
        let mut values = vec![2.0_f32; 5 * 6];
        for step in 0..5 {
            values[step * 6 + 4] = step as f32;
        }
        for taxel in 0..4 {
            values[(taxel / 2) * 6 + taxel] = 5.0;
        }
        assert_eq!(Series::Sparse.of(&values, 6), [6.0, 6.0, 0.0, 0.0, 0.0]);
        assert_eq!(Series::Taxel(4).of(&values, 6), [0.0, 1.0, 2.0, 3.0, 4.0]);
        assert!(Series::Sparse.of(&[1.0, 2.0, 1.0], 1).is_empty());
        assert_eq!(Series::of_taxels(40).count(), 14);
    }
}
