//! A result that its predictions confirm.

use super::evaluate_run::FUSED;
use crate::{Evaluation, PipelineError, RunDir, RunResult};

/// Difference of an accuracy of single sweeps that is no contradiction.
const EXACT: f64 = 1e-9;
/// The same of fused sweeps, whose log-probabilities add up: predictions keep probabilities, and those of almost zero are rounded.
const ROUNDED: f64 = 0.01;

impl RunDir {
    /// Reads the result, if the run has ended, and counts again in the files of predictions what its accuracies say.
    ///
    /// # Errors
    /// A file that is missing or damaged; accuracies that are not those of the predictions.
    pub fn verified_result(&self) -> Result<Option<RunResult>, PipelineError> {
        let Some(result) = self.result()? else {
            return Ok(None);
        };
        for (method, said) in &result.evaluations {
            let (file, predictions) = self.predictions(*method)?;
            let counted = Evaluation::of(&predictions, FUSED, result.seed);
            let one = (said.one_sweep, counted.one_sweep, EXACT);
            let fused = said
                .fused
                .zip(counted.fused)
                .map(|(said, counted)| (said.bayes, counted.bayes, ROUNDED));
            let differing = std::iter::once(one)
                .chain(fused)
                .find(|(said, counted, tolerance)| {
                    said.n != counted.n || (said.mean - counted.mean).abs() > *tolerance
                })
                .map(|(said, counted, _)| (said, counted));
            if let Some((said, counted)) = differing {
                return Err(PipelineError::Run {
                    path: self.file(&file),
                    reason: format!(
                        "{:.1} % of {} are right by it, {:.1} % of {} by result.json: one of the two was edited",
                        100.0 * counted.mean,
                        counted.n,
                        100.0 * said.mean,
                        said.n
                    ),
                });
            }
        }
        Ok(Some(result))
    }
}
