//! What people read on the terminal after training or evaluation.

use std::collections::BTreeMap;
use std::process::ExitCode;

use tactnet_experiments::published_for;
use tactnet_pipeline::{Estimate, Evaluation, FusedAccuracy, RunDir, RunResult};

/// Data sets that the published numbers may be set beside.
const COMPARABLE: [&str; 2] = ["twin", "tactmat"];

/// Prints `result.json`, or a table.
pub fn print_result(run: &RunDir, result: &RunResult, json: bool) -> anyhow::Result<ExitCode> {
    if json {
        println!("{}", serde_json::to_string_pretty(result)?);
        return Ok(ExitCode::SUCCESS);
    }
    println!(
        "{} ({}), recipe {}: {} training sweeps, {} test sweeps",
        result.data, result.split, result.recipe, result.n_train, result.n_test
    );
    print_evaluations(&result.evaluations);
    let config = run.config()?;
    let comparable =
        COMPARABLE.contains(&result.data.as_str()) && config.classifier.labels.len() == 36;
    if let Some(row) = published_for(&config.recipe).filter(|_| comparable) {
        println!(
            "published for TactMat, {}: {:.1} % with 1 sweep, {:.1} % with 3 (thesis, table 4.2)",
            row.classifier, row.one_sweep.0, row.three_sweeps.0
        );
    }
    println!(
        "{} epochs in {:.0} s ({:.2} s an epoch); run directory {}",
        result.epochs,
        result.train_seconds,
        result.seconds_per_epoch,
        run.path().display()
    );
    Ok(ExitCode::SUCCESS)
}

/// One row per way of predicting.
pub fn print_evaluations(evaluations: &BTreeMap<String, Evaluation>) {
    println!(
        "{:<12} {:>22} {:>22} {:>22} {:>7} {:>7} {:>7}",
        "prediction", "1 sweep [%]", "fused, Bayes [%]", "fused, vote [%]", "NLL", "ECE", "Brier"
    );
    for (name, evaluation) in evaluations {
        let fused = |pick: fn(&FusedAccuracy) -> Estimate| {
            evaluation.fused.as_ref().map_or_else(
                || "too few sweeps".into(),
                |fused| format!("{}x {}", fused.sweeps, percent(pick(fused))),
            )
        };
        println!(
            "{name:<12} {:>22} {:>22} {:>22} {:>7.3} {:>7.3} {:>7.3}",
            percent(evaluation.one_sweep),
            fused(|f| f.bayes),
            fused(|f| f.majority),
            evaluation.negative_log_likelihood,
            evaluation.expected_calibration_error,
            evaluation.brier,
        );
    }
}

fn percent(estimate: Estimate) -> String {
    format!(
        "{:.1} ({:.1} to {:.1})",
        100.0 * estimate.mean,
        100.0 * estimate.ci95_low,
        100.0 * estimate.ci95_high
    )
}
