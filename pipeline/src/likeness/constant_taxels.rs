//! Taxels that do not change during a sweep, and how unusual they are.

use tactnet_data::SweepView;

/// Constant taxels of the training sweeps.
pub(super) struct ConstantTaxels {
    /// True for the taxels that do not change: `[sweeps][taxels]`.
    of_sweeps: Vec<Vec<bool>>,
    /// Number of sweeps in which a taxel does not change, `[taxels]`.
    counts: Vec<usize>,
}

impl ConstantTaxels {
    /// - `of_sweeps`: true for the taxels that do not change, `[sweeps][taxels]`
    pub fn new(of_sweeps: Vec<Vec<bool>>) -> Self {
        let taxels = of_sweeps.first().map_or(0, Vec::len);
        let count = |taxel: usize| of_sweeps.iter().filter(|of| of[taxel]).count();
        Self {
            counts: (0..taxels).map(count).collect(),
            of_sweeps,
        }
    }

    /// Returns the number of sweeps.
    pub fn sweeps(&self) -> usize {
        self.of_sweeps.len()
    }

    /// Returns the share of sweeps in which a taxel does not change; at least that of one among one more sweep.
    pub fn share(&self, taxel: usize) -> f64 {
        (1 + self.counts[taxel]) as f64 / (1 + self.of_sweeps.len()) as f64
    }

    /// Returns the surprise about the constant taxels of a further sweep, see [`surprise`].
    pub fn surprise(&self, constant: &[bool]) -> f64 {
        surprise(constant, |taxel| self.share(taxel))
    }

    /// Returns the surprise about the constant taxels of a training sweep that is left out.
    pub fn surprise_of_training(&self, sweep: usize) -> f64 {
        let constant = &self.of_sweeps[sweep];
        surprise(constant, |taxel| {
            self.counts[taxel] as f64 / self.of_sweeps.len() as f64
        })
    }

    /// Returns how many standard deviations a taxel of a further sweep is more constant than in training sweeps, `[taxels]`.
    pub fn scores(&self, constant: &[bool]) -> Vec<f64> {
        let scores = constant.iter().enumerate();
        scores
            .map(|(taxel, is)| standardized(*is, self.share(taxel)))
            .collect()
    }

    /// Returns the same of a training sweep that is left out.
    pub fn scores_of_training(&self, sweep: usize) -> Vec<f64> {
        let constant = self.of_sweeps[sweep].iter().enumerate();
        let others = |taxel: usize, is: bool| self.counts[taxel] - usize::from(is);
        let share = |others: usize| (1 + others) as f64 / (1 + self.of_sweeps.len()) as f64;
        constant
            .map(|(taxel, is)| standardized(*is, share(others(taxel, *is))))
            .collect()
    }
}

fn standardized(is_constant: bool, share: f64) -> f64 {
    let deviation = (share * (1.0 - share)).sqrt().max(1e-6);
    (f64::from(u8::from(is_constant)) - share) / deviation
}

/// Returns minus the logarithm of the share of training sweeps in which the most unusual of the constant taxels is
/// constant, too; 0 if none is.
fn surprise(constant: &[bool], share: impl Fn(usize) -> f64) -> f64 {
    let taxels = (0..constant.len()).filter(|taxel| constant[*taxel]);
    taxels.map(|taxel| -share(taxel).ln()).fold(0.0, f64::max)
}

/// Returns true for the taxels that do not change during a sweep: `[sweeps][taxels]`.
pub(super) fn constant_taxels(view: &SweepView<'_>) -> Vec<Vec<bool>> {
    let taxels = view.shape().taxels();
    let mut sweep = vec![0.0; view.shape().values()];
    (0..view.len())
        .map(|position| {
            view.copy_batch(&[position], &mut sweep);
            (0..taxels)
                .map(|taxel| {
                    let mut values = sweep[taxel..].iter().step_by(taxels);
                    values.all(|value| *value == sweep[taxel])
                })
                .collect()
        })
        .collect()
}
