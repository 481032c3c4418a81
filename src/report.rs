//! What people read on the terminal after training or evaluation.

use std::collections::BTreeMap;
use std::process::ExitCode;

use tactnet_experiments::published_for;
use tactnet_pipeline::{Estimate, Evaluation, FusedAccuracy, RunDir, RunResult, Verdicts};

use crate::output;

/// How a result is shown.
#[derive(Clone, Copy)]
pub enum OutputFormat {
    /// For people.
    Table,
    /// For programs.
    Json,
}

impl OutputFormat {
    /// Returns `Json` where `--json` was given.
    pub fn from_flag(json: bool) -> Self {
        if json { Self::Json } else { Self::Table }
    }
}

/// Prints `result.json`, or a table.
pub fn print_result(
    run: &RunDir,
    result: &RunResult,
    format: OutputFormat,
) -> anyhow::Result<ExitCode> {
    if let OutputFormat::Json = format {
        output::print_json(result)?;
        return Ok(ExitCode::SUCCESS);
    }
    output::print(format_args!(
        "{} ({}), recipe {}: {} training sweeps, {} test sweeps",
        result.data, result.split, result.recipe, result.n_train, result.n_test
    ))?;
    print_evaluations(&result.evaluations)?;
    let config = run.config()?;
    if let Some(row) = published_for(
        &config,
        result.origin,
        &run.split()?,
        config.recipe.method(),
    ) {
        output::print(format_args!(
            "published for TactMat, {}: {:.1} % with 1 sweep, {:.1} % with 3 (thesis, table 4.2)",
            row.classifier, row.one_sweep.0, row.three_sweeps.0
        ))?;
    }
    for (setting, value) in &result.chosen {
        output::print(format_args!(
            "chosen on training sweeps: {setting} = {value}"
        ))?;
    }
    let work = match (result.epochs, result.seconds_per_epoch) {
        (Some(epochs), Some(each)) => {
            format!(
                "{epochs} epochs in {:.0} s ({each:.2} s an epoch)",
                result.train_seconds
            )
        }
        _ => format!("fitted in {:.1} s", result.train_seconds),
    };
    output::print(format_args!(
        "{work}; run directory {}",
        run.path().display()
    ))?;
    Ok(ExitCode::SUCCESS)
}

/// One row per way of predicting.
pub fn print_evaluations(evaluations: &BTreeMap<String, Evaluation>) -> anyhow::Result<()> {
    output::print(format_args!(
        "{:<12} {:>22} {:>22} {:>22} {:>7} {:>7} {:>7}",
        "prediction", "1 sweep [%]", "fused, Bayes [%]", "fused, vote [%]", "NLL", "ECE", "Brier"
    ))?;
    for (name, evaluation) in evaluations {
        let fused = |pick: fn(&FusedAccuracy) -> Estimate| {
            evaluation.fused.as_ref().map_or_else(
                || "too few sweeps".into(),
                |fused| format!("{}x {}", fused.sweeps, percent(pick(fused))),
            )
        };
        output::print(format_args!(
            "{name:<12} {:>22} {:>22} {:>22} {:>7.3} {:>7.3} {:>7.3}",
            percent(evaluation.one_sweep),
            fused(|f| f.bayes),
            fused(|f| f.majority),
            evaluation.negative_log_likelihood,
            evaluation.expected_calibration_error,
            evaluation.brier,
        ))?;
    }
    Ok(())
}

/// How well a calibration's targets were met.
pub fn print_verdicts(verdicts: &Verdicts) -> anyhow::Result<()> {
    let percent = |estimate: Estimate| {
        format!(
            "{:.1} % ({:.1} to {:.1})",
            100.0 * estimate.mean,
            100.0 * estimate.ci95_low,
            100.0 * estimate.ci95_high
        )
    };
    if let (Some(alarms), Some(coverage), Some(size)) =
        (verdicts.false_alarms, verdicts.coverage, verdicts.set_size)
    {
        output::print(format_args!(
            "known materials called unknown: {}, promised {:.1} %",
            percent(alarms),
            100.0 * verdicts.target.false_alarms
        ))?;
        output::print(format_args!(
            "material in the prediction set: {}, promised {:.1} %; {size:.1} materials in a set",
            percent(coverage),
            100.0 * verdicts.target.coverage
        ))?;
    }
    if let Some(detected) = verdicts.detected {
        output::print(format_args!(
            "unknown materials called unknown: {} of {} sweeps ({})",
            percent(detected),
            detected.n,
            verdicts.unknown_materials.join(", ")
        ))?;
    }
    Ok(())
}

fn percent(estimate: Estimate) -> String {
    format!(
        "{:.1} ({:.1} to {:.1})",
        100.0 * estimate.mean,
        100.0 * estimate.ci95_low,
        100.0 * estimate.ci95_high
    )
}
