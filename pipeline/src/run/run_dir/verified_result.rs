//! Results checked against their predictions.

use crate::run::evaluate_run::FUSED;
use crate::{Evaluation, PipelineError, RunDir, RunResult};

/// Tolerance of a single-sweep accuracy.
const EXACT: f64 = 1e-9;
/// Tolerance of a fused accuracy. Log-probabilities add up, and files round probabilities close to zero.
const ROUNDED: f64 = 0.01;

impl RunDir {
    /// Reads the result, if the run has ended, and recomputes its accuracies from the prediction files.
    ///
    /// # Errors
    /// A missing or damaged file; accuracies that differ from those of the predictions.
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
                return Err(PipelineError::run(
                    self.file(&file),
                    format!(
                        "{:.1} % of {} are right by it, {:.1} % of {} by result.json: one of the two was edited",
                        100.0 * counted.mean,
                        counted.n,
                        100.0 * said.mean,
                        said.n
                    ),
                ));
            }
        }
        Ok(Some(result))
    }
}
