//! Result of an evaluation as text.

use std::fmt::Write as _;

use tactnet_pipeline::{Confusion, Estimate, EvalResult, LikenessReport, Verdicts};

use super::block_text::{confounded_text, share_text};
use super::evaluation_table::evaluation_table;
use super::recall_text::recall_text;
use crate::output::counted;

/// Maximum number of pairs of materials in the text.
const MOST: usize = 5;

/// Returns accuracies, comparisons of runtimes, the most frequent confusions, rates of a calibrated classifier, and warnings.
pub fn text(result: &EvalResult) -> String {
    let likeness = result.likeness.as_ref().map(LikenessReport::text);
    let mut text = likeness.map_or_else(String::new, |verdict| format!("{verdict}\n"));
    let _ = writeln!(
        text,
        "{}: {} ({})",
        result.data,
        result.tested,
        counted(result.n_test, "sweep")
    );
    if !result.dead_taxels.is_empty() {
        let dead: Vec<String> = result.dead_taxels.iter().map(usize::to_string).collect();
        let _ = writeln!(text, "masked taxels: {}", dead.join(", "));
    }
    if result.evaluations.is_empty() {
        text.push_str("no sweep is of a known material, so there is no accuracy");
    } else {
        if result.n_unknown > 0 {
            let known = result.n_test - result.n_unknown;
            let _ = writeln!(text, "{} of known materials:", counted(known, "sweep"));
        }
        text.push_str(&evaluation_table(&result.evaluations));
    }
    for (method, compared) in &result.runtimes {
        let _ = write!(
            text,
            "\n{}: {}: probabilities differ from Burn's by at most {:.1e}; {:.0} us after the last frame, 99 % below {:.0} us",
            method.name(),
            compared.runtime,
            compared.largest_difference,
            compared.p50_us,
            compared.p99_us
        );
    }
    if let Some(confusion) = &result.confusion {
        let evaluations = result.evaluations.values();
        let known = evaluations.map(|of| of.balanced.map(|balanced| (of.one_sweep, balanced)));
        if let Some((accuracy, balanced)) = known.flatten().next() {
            let _ = write!(text, "\n{}", guessing_text(confusion, accuracy, balanced));
        }
        let (recalls, mistakes) = (recall_text(confusion), mistakes_text(confusion));
        let _ = write!(text, "{recalls}\n{mistakes}");
    }
    if let Some(confounded) = &result.confounded {
        let _ = write!(text, "\n{}", confounded_text(confounded));
    }
    if let Some(verdicts) = &result.verdicts {
        let _ = write!(text, "\n{}", rates(verdicts));
    }
    text += &unknown_text(result);
    if let Some(values) = &result.values {
        let _ = write!(text, "\nwarning: {values}");
    }
    text
}

/// Returns a line for each unknown material with the predicted labels, the most frequent first.
fn unknown_text(result: &EvalResult) -> String {
    let mut text = String::new();
    for (material, predicted) in &result.unknown_taken_for {
        let mut predicted: Vec<_> = predicted.iter().collect();
        predicted.sort_by_key(|(_, count)| std::cmp::Reverse(**count));
        let predicted: Vec<String> = predicted
            .iter()
            .map(|(label, count)| format!("{label} ({count})"))
            .collect();
        let _ = write!(
            text,
            "\nunknown material {material}, most similar: {}",
            predicted.join(", ")
        );
        if let Some(known) = result.unknown_meant.get(material) {
            let _ = write!(
                text,
                "; if it is the known `{known}`, use the same spelling"
            );
        }
    }
    text
}

/// Returns the accuracy of guessing and, for materials with unequal numbers of sweeps, the balanced accuracy; and that the
/// accuracy does not differ from guessing, if its interval includes that.
pub fn guessing_text(confusion: &Confusion, accuracy: Estimate, balanced: Estimate) -> String {
    let counts = confusion.counts.iter().map(|row| row.iter().sum());
    let sweeps: Vec<(usize, &String)> = counts.zip(&confusion.materials).collect();
    // Of equally frequent materials the first.
    let frequent = sweeps.iter().rev().max_by_key(|(count, _)| *count);
    let Some((most, name)) = frequent else {
        return String::new();
    };
    let all: usize = sweeps.iter().map(|(count, _)| count).sum();
    let guessing = 100.0 * *most as f64 / all as f64;
    let mut text = if sweeps.iter().all(|(count, _)| count == most) {
        format!("guessing, with {} materials: {guessing:.1} %", sweeps.len())
    } else {
        format!(
            "guessing (always `{name}`, the most frequent): {guessing:.1} %; balanced accuracy, the mean of the materials' recalls: {}",
            share_text(balanced)
        )
    };
    if 100.0 * accuracy.ci95_low <= guessing {
        let _ = write!(
            text,
            "\nnot better than guessing: the 95 % interval of the accuracy, {:.1} to {:.1} %, begins below it",
            100.0 * accuracy.ci95_low,
            100.0 * accuracy.ci95_high
        );
    }
    text
}

/// Returns the most frequent pairs of a material and another one that was predicted for it.
pub fn mistakes_text(confusion: &Confusion) -> String {
    let mut mistakes: Vec<(usize, usize, usize)> = Vec::new();
    for (truth, row) in confusion.counts.iter().enumerate() {
        for (predicted, count) in row.iter().enumerate() {
            if truth != predicted && *count > 0 {
                mistakes.push((*count, truth, predicted));
            }
        }
    }
    if mistakes.is_empty() {
        return "no sweep was taken for another material".into();
    }
    // The sort is stable: equal counts stay in the order of the materials.
    mistakes.sort_by_key(|(count, _, _)| std::cmp::Reverse(*count));
    let shown = mistakes.iter().take(MOST).map(|(count, truth, predicted)| {
        let (of, materials) = (&confusion.counts[*truth], &confusion.materials);
        format!(
            "{} taken for {} ({count} of {})",
            materials[*truth],
            materials[*predicted],
            of.iter().sum::<usize>()
        )
    });
    let shown = shown.collect::<Vec<_>>().join(", ");
    let rest = match mistakes.len().saturating_sub(MOST) {
        0 => String::new(),
        1 => " and 1 other pair".into(),
        more => format!(" and {more} other pairs"),
    };
    format!("most frequent mistakes: {shown}{rest}")
}

fn rates(verdicts: &Verdicts) -> String {
    let mut lines = Vec::new();
    if let (Some(alarms), Some(coverage), Some(size)) =
        (verdicts.false_alarms, verdicts.coverage, verdicts.set_size)
    {
        lines.push(format!(
            "known materials called unknown: {}, target {:.1} %",
            share_text(alarms),
            100.0 * verdicts.target.false_alarms
        ));
        lines.push(format!(
            "material in the prediction set: {}, target {:.1} %; {size:.1} materials in a set",
            share_text(coverage),
            100.0 * verdicts.target.coverage
        ));
    }
    if let Some(detected) = verdicts.detected {
        lines.push(format!(
            "unknown materials called unknown: {} of {} ({})",
            share_text(detected),
            counted(detected.n, "sweep"),
            verdicts.unknown_materials.join(", ")
        ));
    }
    lines.extend(verdicts.caution.clone());
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_accuracy_whose_interval_includes_guessing_is_called_so() {
        let confusion = |right: usize| Confusion {
            materials: vec!["felt".into(), "cork".into()],
            counts: vec![vec![right, 50 - right], vec![50 - right, right]],
        };
        let estimate = |mean: f64| Estimate {
            mean,
            ci95_low: mean - 0.1,
            ci95_high: mean + 0.1,
            n: 100,
        };
        let text = |right| {
            let accuracy = estimate(right as f64 / 50.0);
            guessing_text(&confusion(right), accuracy, accuracy)
        };
        assert!(text(28).contains(
            "not better than guessing: the 95 % interval of the accuracy, 46.0 to 66.0 %"
        ));
        assert_eq!(text(40), "guessing, with 2 materials: 50.0 %");
    }

    #[test]
    fn the_most_frequent_mistakes_come_first_with_how_many_sweeps_there_were() {
        let text = |counts: &[&[usize]]| {
            let names = (0..counts.len()).map(|label| format!("m{label}"));
            mistakes_text(&Confusion {
                materials: names.collect(),
                counts: counts.iter().map(|row| row.to_vec()).collect(),
            })
        };
        assert_eq!(
            text(&[&[9, 1, 0], &[0, 7, 3], &[1, 0, 9]]),
            "most frequent mistakes: m1 taken for m2 (3 of 10), m0 taken for m1 (1 of 10), m2 taken for m0 (1 of 10)"
        );
        assert_eq!(
            text(&[&[9, 0], &[0, 9]]),
            "no sweep was taken for another material"
        );
        assert!(text(&[&[1, 1, 1], &[1, 1, 1], &[1, 1, 1]]).ends_with(" and 1 other pair"));
    }
}
