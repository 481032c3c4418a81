//! The table of data sets and models.

use maud::{Markup, html};

use super::text::{ABSENT, decimal, percent, prose, scroll};
use crate::benchmark::{
    Benchmark, Candidate, Condition, ConditionScores, ModelScore, Objection, SetResult, SetScores,
};
use crate::phrases::{in_percent, interval, rank};
use crate::plan::LeftOut;
use crate::questions::Headline;

/// Maximum number of models whose violations of the rule are listed.
const LISTED: usize = 3;

/// Returns the headline: the least mean error and the model that the rule selects; `None` without a complete data set.
pub(super) fn headline(benchmark: &Benchmark) -> Option<(String, Headline)> {
    let scores = benchmark.under(Condition::Headline)?;
    let best = scores.best()?;
    let headline = Headline {
        value: in_percent(best.mean_error?),
        interval: None,
        interval_note: Some("in the table for each data set".into()),
        says: format!(
            "mean error of `{}` over {} data sets, the least of {} models",
            best.model,
            best.sets,
            scores.models.len()
        ),
        qualifier: selected(benchmark),
    };
    let place = "held-out groups of the data sets that have groups, random folds of the others";
    Some((place.into(), headline))
}

/// Returns a sentence about the model that the rule selects.
fn selected(benchmark: &Benchmark) -> String {
    match &benchmark.default.model {
        Some(model) => format!("The rule for the default selects `{model}`."),
        None => "No model satisfies the rule for the default.".into(),
    }
}

/// Returns the table, the rule for the default and what it selects.
///
/// - `left_out`: models that data sets do not allow
pub(super) fn section(benchmark: &Benchmark, left_out: &[LeftOut]) -> Markup {
    let default = &benchmark.default;
    let is_selected = |of: &&Candidate| default.model.as_ref() == Some(&of.model);
    let refused: Vec<&Candidate> = default
        .candidates
        .iter()
        .take_while(|of| !is_selected(of))
        .take(LISTED)
        .collect();
    html! {
        (scroll("Data sets and models", &table(benchmark)))
        p {
            "Accuracy of single sweeps in %, with its 95\u{a0}% interval; each row's best in bold. Each model predicts by the method of its "
            "recipe. A model that a data set does not allow has the last rank there."
        }
        p { (default.rule) " " strong { (prose(&selected(benchmark))) } }
        @if !refused.is_empty() {
            p { "With less mean error, but against the rule:" }
            ul {
                @for candidate in refused {
                    li { code { (candidate.model) } ": " (objections(&candidate.objections)) }
                }
            }
        }
        @for left_out in left_out { p.note { strong { "Left out:" } " " (left_out) "." } }
    }
}

/// Lists the data sets on which a model violates the rule.
fn objections(all: &[Objection]) -> String {
    let text = |of: &Objection| match (&of.best_single, of.behind) {
        (Some(best), Some(behind)) => format!(
            "{best} is {} points better on {} ({})",
            decimal(100.0 * behind, 1),
            of.data,
            of.split
        ),
        _ => format!("left out on {}", of.data),
    };
    all.iter().map(text).collect::<Vec<_>>().join("; ")
}

fn table(benchmark: &Benchmark) -> Markup {
    let Some(headline) = benchmark.under(Condition::Headline) else {
        return html! {};
    };
    let columns = headline.models.len() + 1;
    let separator = |text: &str| {
        html! { tr.separator { th scope="rowgroup" colspan=(columns) { span { (text) } } } }
    };
    let others = benchmark.conditions.iter();
    let others = others.filter(|of| of.condition != Condition::Headline);
    html! {
        table.results {
            caption.hidden { "Accuracy by data set and model" }
            thead {
                tr {
                    th scope="col" { "Data set" }
                    @for model in &headline.models { th.number scope="col" { (model.model) } }
                }
            }
            tbody {
                (separator("All data sets: held-out groups where a set has them, else random folds"))
                (means("Mean error, %", headline, |of| of.mean_error.map(percent)))
                (means("Mean rank", headline, |of| of.mean_rank.map(|rank| decimal(rank, 2))))
                (means("Training, s/fold", headline, |of| of.train_seconds.map(|s| decimal(s, 1))))
            }
            @for scores in others {
                tbody {
                    (separator(&heading(scores.condition)))
                    @for set in &scores.sets { (line(set)) }
                    (means("Mean error, %", scores, |of| of.mean_error.map(percent)))
                }
            }
        }
    }
}

/// Returns the heading of the data sets under a condition.
fn heading(condition: Condition) -> String {
    match condition {
        Condition::HeldOutGroups => {
            "Held-out groups: no recording of the test sweeps is trained on".into()
        }
        Condition::RandomFolds => "Random folds".into(),
        other => other.to_string(),
    }
}

/// Returns a row of means over data sets; those of models that are left out somewhere name the number of data sets.
fn means(
    label: &str,
    scores: &ConditionScores,
    shown: impl Fn(&ModelScore) -> Option<String>,
) -> Markup {
    let sets = scores.models.iter().map(|of| of.sets).max().unwrap_or(0);
    html! {
        tr {
            th scope="row" { (label) }
            @for model in &scores.models {
                td.number {
                    (shown(model).unwrap_or_else(|| ABSENT.into()))
                    @if model.sets < sets { br; small { (model.sets) " of " (sets) " sets" } }
                }
            }
        }
    }
}

fn line(set: &SetScores) -> Markup {
    let (materials, sweeps, steps) = (set.materials, set.sweeps, set.steps);
    html! {
        tr {
            th scope="row" {
                (set.data)
                br;
                small { (materials) " materials, " (sweeps) " sweeps, " (steps) " steps; guessing " (percent(set.chance)) }
            }
            @for result in &set.models { (cell(set, result)) }
        }
    }
}

fn cell(set: &SetScores, result: &SetResult) -> Markup {
    let Some(score) = &result.score else {
        return match &result.left_out {
            Some(reason) => html! { td.number title=(reason) { "left out" } },
            None => html! { td.number { (ABSENT) } },
        };
    };
    html! {
        td.number {
            @if set.highest().map(rank) == Some(rank(score.accuracy)) {
                strong { (percent(score.accuracy)) }
            } @else {
                (percent(score.accuracy))
            }
            @if let Some(ends) = score.ci95 { br; small { (interval(ends)) } }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::benchmark::tests::{of_accuracies, shots_of};

    #[test]
    fn the_table_has_every_data_set_and_marks_the_best_and_the_left_out() {
        let benchmark = of_accuracies(&[
            ("felt", &[Some(0.9), Some(0.8), None]),
            ("<b>", &[Some(0.7), Some(0.75), Some(0.6)]),
        ]);
        let page = section(&benchmark, &[]).into_string();
        assert!(page.contains("<strong>90.0</strong>") && page.contains("<strong>75.0</strong>"));
        assert!(page.contains("title=\"too short\">left out"));
        assert!(
            page.contains("1 of 2 sets") && !page.contains("<b>"),
            "{page}"
        );
        let (_, headline) = headline(&benchmark).unwrap();
        assert_eq!(headline.value, in_percent(0.2));
    }

    #[test]
    fn few_sweeps_are_conditions_of_their_own() {
        let page = section(&shots_of(5), &[]).into_string();
        assert!(page.contains("<span>5 sweeps a material</span>"), "{page}");
    }
}
