//! Evaluations as a text table.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use tactnet_pipeline::{Estimate, Evaluation, FusedAccuracy, LengthAccuracy, PredictionMethod};

/// Returns a table with one row per prediction method: accuracies in percent with 95 % intervals, NLL in nats, ECE in percent, Brier
/// score. Lines below explain the columns; no line of words exceeds 100 columns.
pub fn evaluation_table(evaluations: &BTreeMap<PredictionMethod, Evaluation>) -> String {
    let mut text = format!(
        "{:<15} {:>22} {:>22} {:>22} {:>7} {:>8} {:>7}",
        "prediction",
        "1 sweep [%]",
        "fused, Bayes [%]",
        "fused, vote [%]",
        "NLL",
        "ECE [%]",
        "Brier"
    );
    for (method, evaluation) in evaluations {
        // A baseline has no other method.
        let name = match evaluations.len() {
            1 if *method == PredictionMethod::Plain => "as fitted",
            _ => method.title(),
        };
        let fused = |pick: fn(&FusedAccuracy) -> Estimate| {
            evaluation.fused.as_ref().map_or_else(
                || "too few sweeps".into(),
                |fused| format!("{}x {}", fused.sweeps, percent(pick(fused))),
            )
        };
        let _ = write!(
            text,
            "\n{name:<15} {:>22} {:>22} {:>22} {:>7.3} {:>8.1} {:>7.3}",
            percent(evaluation.one_sweep),
            fused(|f| f.bayes),
            fused(|f| f.majority),
            evaluation.negative_log_likelihood,
            100.0 * evaluation.expected_calibration_error,
            evaluation.brier,
        );
    }
    let fused = evaluations.values().find_map(|of| of.fused.as_ref());
    let fused = fused.map_or(String::new(), |fused| {
            format!(
                "\n{0}x: {0} sweeps of a material fused into one decision, mean over {1} random groupings",
                fused.sweeps,
                FusedAccuracy::GROUPINGS
            )
        });
    let passes = evaluations.keys().find_map(|method| match method {
        PredictionMethod::McDropout { mc_samples } => Some(mc_samples),
        PredictionMethod::Plain => None,
    });
    let passes = passes.map_or(String::new(), |passes| {
        format!("\nMC dropout: mean over {passes} passes with dropout left on")
    });
    let _ = write!(
        text,
        "\nin brackets: 95 % interval{fused}{passes}\n\
             smaller is better: NLL, how improbable the true material was held (nats); ECE, gap between\n\
             confidence and accuracy; Brier, squared error of the probabilities (0 to 2)"
    );
    // The last method is that of the recipe, if there are several.
    if let Some(evaluation) = evaluations.values().next_back() {
        text.push_str(&by_length(&evaluation.by_length));
    }
    text
}

/// Returns the accuracies for the quartiles of length as one line; empty if there are none.
fn by_length(groups: &[LengthAccuracy]) -> String {
    if groups.is_empty() {
        return String::new();
    }
    let group = |of: &LengthAccuracy| {
        let steps = match of.shortest == of.longest {
            true => of.longest.to_string(),
            false => format!("{} to {}", of.shortest, of.longest),
        };
        format!("{steps} steps: {}", percent(of.accuracy))
    };
    let groups: Vec<String> = groups.iter().map(group).collect();
    format!("\naccuracy by length, 1 sweep [%]: {}", groups.join("; "))
}

/// Returns a share with its interval, in percent without the sign.
pub fn percent(estimate: Estimate) -> String {
    format!(
        "{:.1} ({:.1} to {:.1})",
        100.0 * estimate.mean,
        100.0 * estimate.ci95_low,
        100.0 * estimate.ci95_high
    )
}
