//! The results of an experiment as a table on a terminal.

use std::fmt::{self, Write};

use tactnet_experiments::{
    AssumedRate, Benchmark, Comparison, Condition, ConditionScores, FewSteps, Measure, ModelScore,
    Question, Row, SampleEfficiency, Scored, Statistic, Summary, interval_notes, method_name,
    name_in_comparison,
};

use crate::commands::evaluation_table::percent;

/// Returns a summary as text: title, command, tables and comparisons.
pub fn to_table(summary: &Summary) -> String {
    let mut text = String::new();
    // Writing to a string cannot fail.
    let _ = write_all(&mut text, summary);
    text
}

/// Returns the warning about an assumed sample rate, with the option that sets it.
pub fn assumed_rate_text(assumed: AssumedRate<'_>) -> String {
    format!("{assumed}; `--set rate_hz=HZ` sets it")
}

/// Returns the hint about few training steps, with the options that set more epochs.
fn few_steps_text(few: &FewSteps) -> String {
    let FewSteps { model, data, steps } = few;
    let epochs = steps.epochs_for_enough();
    format!(
        "{model} on {data}: {} training steps are few; `--set epochs={epochs}` trains for {}; name another folder with `--out`",
        steps.count(),
        epochs * steps.batches
    )
}

fn write_all(out: &mut String, summary: &Summary) -> fmt::Result {
    writeln!(out, "{}\n{}", summary.title, summary.command)?;
    if summary.tasks_done < summary.tasks {
        writeln!(
            out,
            "only {} of {} tasks are finished",
            summary.tasks_done, summary.tasks
        )?;
    }
    for failed in &summary.failed {
        writeln!(
            out,
            "failed: {} of {} tasks, model {}, first {}: {}",
            failed.tasks, summary.tasks, failed.model, failed.first, failed.reason
        )?;
    }
    for warning in &summary.data_warnings {
        writeln!(out, "warning: {warning}")?;
    }
    for left_out in &summary.left_out {
        writeln!(out, "note: {left_out}")?;
    }
    for assumed in summary.assumed_rates() {
        writeln!(out, "warning: {}", assumed_rate_text(assumed))?;
    }
    if let Question::Crossval(_) = summary.question {
        contenders(out, summary)
    } else {
        measures(out, summary)
    }
}

fn contenders(out: &mut String, summary: &Summary) -> fmt::Result {
    let contenders = summary.scored();
    let published = contenders.iter().any(|row| row.published.is_some());
    let published_heading = if published {
        format!(" {:>11}", "published")
    } else {
        String::new()
    };
    let mut setting = None;
    for probe in [false, true] {
        for row in contenders.iter().filter(|row| row.probe == probe) {
            let own = (&row.data, row.levels, &row.split, row.steps);
            if setting != Some(own) {
                setting = Some(own);
                writeln!(
                    out,
                    "\n{}, {}, levels {}, {} steps, guessing {:.1} %\n{:<44} {:>5} {:>24} {:>16} {:>16} {:>6} {:>7} {:>9}{published_heading}",
                    row.data,
                    row.split,
                    row.levels.name(),
                    row.steps,
                    100.0 * row.guessing(),
                    "model",
                    "folds",
                    "1 sweep [%], sd, 95 %",
                    "3 sweeps [%], sd",
                    "3, vote [%], sd",
                    "NLL",
                    "ECE [%]",
                    "train [s]"
                )?;
            }
            writeln!(out, "{}", contender(row, published))?;
        }
    }
    let unequal = contenders.iter().filter(|row| row.is_unbalanced());
    let unequal: Vec<String> = unequal.filter_map(balanced).collect();
    if !unequal.is_empty() {
        let each = unequal.join(", ");
        writeln!(
            out,
            "\nbalanced accuracy, the mean of the materials' recalls [%]: {each}"
        )?;
    }
    let shared: Vec<String> = contenders.iter().filter_map(unconfounded).collect();
    if !shared.is_empty() {
        let each = shared.join(", ");
        writeln!(
            out,
            "\naccuracy on the materials that share their sessions with others [%]: {each}"
        )?;
    }
    let rows = contenders.iter().map(|row| (row.name(), row.one_sweep));
    notes(out, &interval_notes(rows, "fold"))?;
    for few in summary.few_steps() {
        writeln!(out, "\nhint: {}", few_steps_text(&few))?;
    }
    for audit in &summary.audits {
        writeln!(out, "\n{}: {}", audit.data, audit.verdict)?;
    }
    match &summary.benchmark {
        Some(found) => benchmark(out, found),
        None => Ok(()),
    }
}

/// Writes the table of data sets and models, and the model that the rule for the default selects.
fn benchmark(out: &mut String, found: &Benchmark) -> fmt::Result {
    for scores in &found.conditions {
        condition(out, scores)?;
    }
    let selected = found.default.model.as_deref();
    writeln!(
        out,
        "\n{} Selected: {}.",
        found.default.rule,
        selected.unwrap_or("no model")
    )
}

/// Writes the results under one condition: data sets in rows, models in columns.
fn condition(out: &mut String, scores: &ConditionScores) -> fmt::Result {
    let named = match scores.condition {
        Condition::Headline => "all data sets, held-out groups first".into(),
        other => other.to_string(),
    };
    write!(out, "\n{:<52}", format!("{named}, accuracy [%]"))?;
    for model in &scores.models {
        write!(out, " {:>17}", model.model)?;
    }
    writeln!(out)?;
    for set in &scores.sets {
        write!(out, "{:<52}", set.data)?;
        for result in &set.models {
            let shown = match (&result.score, &result.left_out) {
                (Some(score), _) => format!("{:.1}", 100.0 * score.accuracy),
                (None, Some(_)) => "left out".into(),
                (None, None) => "-".into(),
            };
            write!(out, " {shown:>17}")?;
        }
        writeln!(out)?;
    }
    type Mean = fn(&ModelScore) -> Option<String>;
    let means: [(&str, Mean); 3] = [
        ("mean error [%]", |of| {
            Some(format!("{:.1}", 100.0 * of.mean_error?))
        }),
        ("mean rank", |of| Some(format!("{:.2}", of.mean_rank?))),
        ("train [s]", |of| Some(format!("{:.1}", of.train_seconds?))),
    ];
    for (label, mean) in means {
        write!(out, "{label:<52}")?;
        for model in &scores.models {
            write!(out, " {:>17}", mean(model).unwrap_or("-".into()))?;
        }
        writeln!(out)?;
    }
    Ok(())
}

/// Returns name and balanced accuracy of a contender, with its interval.
fn balanced(row: &Scored<'_>) -> Option<String> {
    let statistic = row.balanced?;
    let interval = statistic.ci95.map_or(String::new(), |[low, high]| {
        format!(" ({:.1} to {:.1})", 100.0 * low, 100.0 * high)
    });
    Some(format!(
        "{} {:.1}{interval}",
        row.name(),
        100.0 * statistic.mean
    ))
}

/// Returns name and accuracy of a contender on the materials that do not coincide with recording blocks, if others do.
fn unconfounded(row: &Scored<'_>) -> Option<String> {
    let found = row.confounded.as_ref().filter(|_| !row.probe)?;
    let accuracy = percent(found.unconfounded_one_sweep?);
    Some(format!("{}, {} {accuracy}", row.name(), row.split))
}

/// Writes notes on missing and wide intervals.
fn notes(out: &mut String, lines: &[String]) -> fmt::Result {
    if !lines.is_empty() {
        writeln!(out)?;
    }
    lines
        .iter()
        .try_for_each(|line| writeln!(out, "note: {line}"))
}

/// Returns the line of a contender.
///
/// - `published`: true with a column of published accuracies
fn contender(row: &Scored<'_>, published: bool) -> String {
    let percent = |statistic: &Statistic| {
        let sd = statistic
            .sd
            .map_or(String::new(), |sd| format!(" ({:.1})", 100.0 * sd));
        format!("{:.1}{sd}", 100.0 * statistic.mean)
    };
    let interval = row.one_sweep.ci95.map_or(String::new(), |[low, high]| {
        format!(" {:.1} to {:.1}", 100.0 * low, 100.0 * high)
    });
    let beside = row.published.as_ref().map_or(String::new(), |p| {
        format!("{:.1} / {:.1}", p.one_sweep, p.three_sweeps)
    });
    let beside = if published {
        format!(" {beside:>11}")
    } else {
        String::new()
    };
    format!(
        "{:<44} {:>5} {:>24} {:>16} {:>16} {:>6.3} {:>7.1} {:>9.1}{beside}",
        row.name(),
        row.folds.len(),
        format!("{}{interval}", percent(row.one_sweep)),
        row.three_sweeps.map_or("-".into(), percent),
        row.three_votes.map_or("-".into(), percent),
        row.negative_log_likelihood.mean,
        100.0 * row.expected_calibration_error.mean,
        row.train_seconds.mean,
    )
}

fn measures(out: &mut String, summary: &Summary) -> fmt::Result {
    let published = summary.rows.iter().any(|row| row.published.is_some());
    let published_heading = if published {
        format!(" {:>10}", "published")
    } else {
        String::new()
    };
    let widest = summary.rows.iter().map(|row| row.setting.chars().count());
    let wide = widest.max().unwrap_or(0).max(14);
    let mut block = None;
    for row in &summary.rows {
        let own = (&row.data, row.levels, row.steps, &row.model, row.measure);
        if block != Some(own) {
            block = Some(own);
            writeln!(
                out,
                "\n{}, levels {}, networks by {}: {}\n{:<22} {:<wide$} {:>5} {:>6} {:>8} {:>18} {:>4}{published_heading}",
                row.data,
                row.levels.name(),
                row.model,
                row.measure,
                "method",
                "",
                "shots",
                "sweeps",
                "mean",
                "95 %",
                "n"
            )?;
        }
        writeln!(out, "{}", measure(row, wide, published))?;
    }
    let rows = summary.rows.iter();
    let rows = rows.map(|row| {
        (
            format!("{} of {}", row.measure, method_name(&row.method)),
            &row.statistic,
        )
    });
    notes(out, &interval_notes(rows, "task"))?;
    for comparison in &summary.comparisons {
        if let Some(line) = compared(summary, comparison) {
            writeln!(out, "{line}")?;
        }
    }
    for found in summary.sample_efficiency.iter().flatten() {
        writeln!(out, "{}", saved(found))?;
    }
    Ok(())
}

/// Returns the line of a row.
///
/// - `wide`: width of the column of conditions, in characters
/// - `published`: true with a column of published values
fn measure(row: &Row, wide: usize, published: bool) -> String {
    let number = |value: f64| shown(row.measure, value);
    let interval = row.statistic.ci95.map_or("-".into(), |[low, high]| {
        format!("{} to {}", number(low), number(high))
    });
    let count = |value: Option<usize>| value.map_or("-".into(), |value| value.to_string());
    let beside = if published {
        format!(" {:>10}", row.published.map_or(String::new(), number))
    } else {
        String::new()
    };
    format!(
        "{:<22} {:<wide$} {:>5} {:>6} {:>8} {:>18} {:>4}{beside}",
        method_name(&row.method),
        row.setting,
        count(row.shots),
        count(row.sweeps),
        number(row.statistic.mean),
        interval,
        row.n
    )
}

fn shown(measure: Measure, value: f64) -> String {
    if measure.unit().in_percent() {
        format!("{:.1}", 100.0 * value)
    } else {
        format!("{value:.2}")
    }
}

fn compared(summary: &Summary, comparison: &Comparison) -> Option<String> {
    let (first, second) = (
        summary.row(&comparison.first)?,
        summary.row(&comparison.second)?,
    );
    let interval = comparison.ci95.map_or(String::new(), |[low, high]| {
        format!(" [{:+.1}, {:+.1}]", 100.0 * low, 100.0 * high)
    });
    let place: Vec<String> = [
        (!first.setting.is_empty()).then(|| first.setting.clone()),
        first.shots.map(|shots| format!("{shots} shots")),
        first.sweeps.map(|sweeps| format!("{sweeps} sweeps")),
    ]
    .into_iter()
    .flatten()
    .collect();
    Some(format!(
        "{}, levels {}, {}, {}: {} - {} = {:+.1} points{interval}{}",
        first.data,
        first.levels.name(),
        first.measure,
        place.join(", "),
        name_in_comparison(first, second),
        name_in_comparison(second, first),
        100.0 * comparison.difference,
        comparison
            .p
            .map_or(String::new(), |p| format!(", p {p:.3}"))
            + &comparison
                .p_holm
                .map_or(String::new(), |p| format!(" ({p:.3} by Holm)")),
    ))
}

fn saved(found: &SampleEfficiency) -> String {
    let shown =
        |value: Option<f64>| value.map_or("more than tested".into(), |value| format!("{value:.1}"));
    let interval = found.ci95.map_or(String::new(), |ends| {
        format!(" [{}, {}]", shown(ends[0]), shown(ends[1]))
    });
    format!(
        "{}, levels {}: from scratch {} sweeps{interval} for the {:.1} % of transfer with {}{}",
        found.data,
        found.levels.name(),
        shown(found.shots),
        100.0 * found.accuracy,
        found.transfer_shots,
        found
            .published_ratio
            .map_or(String::new(), |ratio| format!("; published ratio {ratio}"))
    )
}
