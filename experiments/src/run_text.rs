//! One training run's result as text, beside what was published.

use tactnet_pipeline::{EvaluationTable, PipelineError, RunDir, RunResult};

use crate::published_for;

/// Returns `result` as lines of text: data, accuracies, the published row that it may be set beside, chosen settings, time, folder.
///
/// # Errors
/// A run directory whose configuration or split is damaged.
pub fn run_text(run: &RunDir, result: &RunResult) -> Result<String, PipelineError> {
    let mut lines = vec![
        format!(
            "{} ({}), recipe {}: {} training sweeps, {} test sweeps",
            result.data, result.split, result.recipe, result.n_train, result.n_test
        ),
        EvaluationTable(&result.evaluations).to_string(),
    ];
    let (config, split) = (run.config()?, run.split()?);
    let method = config.recipe.method();
    if let Some(row) = published_for(&config, result.origin, &split, method) {
        lines.push(format!(
            "published for TactMat, {}: {:.1} % with 1 sweep, {:.1} % with 3 (thesis, table 4.2)",
            row.classifier, row.one_sweep.0, row.three_sweeps.0
        ));
    }
    for (setting, value) in &result.chosen {
        lines.push(format!("chosen on training sweeps: {setting} = {value}"));
    }
    let seconds = result.train_seconds;
    let work = match (result.epochs, result.seconds_per_epoch) {
        (Some(epochs), Some(each)) => {
            format!("{epochs} epochs in {seconds:.0} s ({each:.2} s an epoch)")
        }
        _ => format!("fitted in {seconds:.1} s"),
    };
    lines.push(format!("{work}; run directory {}", run.path().display()));
    Ok(lines.join("\n"))
}
