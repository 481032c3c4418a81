//! What a study found, as a table on the terminal.

use tactnet_experiments::{StudyRow, StudySummary};

use crate::output;

/// Prints rows, comparisons and sample efficiency.
pub fn print(study: &StudySummary) -> anyhow::Result<()> {
    let mut block = None;
    for row in &study.rows {
        let own = (&row.data, &row.levels, &row.model, &row.measure);
        if block != Some(own) {
            block = Some(own);
            output::print(format_args!(
                "\n{}, levels {}, networks by {}: {}\n{:<22} {:<14} {:>5} {:>6} {:>8} {:>18} {:>4} {:>10}",
                row.data,
                row.levels,
                row.model,
                row.measure,
                "method",
                "",
                "shots",
                "sweeps",
                "mean",
                "95 %",
                "n",
                "published"
            ))?;
        }
        output::print(line(row))?;
    }
    for comparison in &study.comparisons {
        let interval = match (comparison.ci95_low, comparison.ci95_high) {
            (Some(low), Some(high)) => format!(" [{:+.1}, {:+.1}]", 100.0 * low, 100.0 * high),
            _ => String::new(),
        };
        let place: Vec<String> = [
            (!comparison.setting.is_empty()).then(|| comparison.setting.clone()),
            comparison.shots.map(|shots| format!("{shots} shots")),
            comparison.sweeps.map(|sweeps| format!("{sweeps} sweeps")),
        ]
        .into_iter()
        .flatten()
        .collect();
        output::print(format_args!(
            "{}, levels {}, {}, {}: {} - {} = {:+.1} points{interval}{}",
            comparison.data,
            comparison.levels,
            comparison.measure,
            place.join(", "),
            comparison.first,
            comparison.second,
            100.0 * comparison.difference,
            comparison
                .p
                .map_or(String::new(), |p| format!(", p {p:.3}")),
        ))?;
    }
    for found in &study.sample_efficiency {
        let shown = |value: Option<f64>| {
            value.map_or("more than tried".into(), |value| format!("{value:.1}"))
        };
        let interval = found.ci95.map_or(String::new(), |ends| {
            format!(" [{}, {}]", shown(ends[0]), shown(ends[1]))
        });
        output::print(format_args!(
            "{}, levels {}: without pre-knowledge {} sweeps{interval} for the {:.1} % of transfer with {}{}",
            found.data,
            found.levels,
            shown(found.shots),
            100.0 * found.accuracy,
            found.transfer_shots,
            found
                .published_ratio
                .map_or(String::new(), |ratio| format!("; published ratio {ratio}"))
        ))?;
    }
    Ok(())
}

fn line(row: &StudyRow) -> String {
    // Numbers of labels or sweeps are no shares.
    let scale = if matches!(row.measure.as_str(), "set size" | "mean sweeps") {
        1.0
    } else {
        100.0
    };
    let number = |value: f64| {
        if scale == 1.0 {
            format!("{value:.2}")
        } else {
            format!("{:.1}", scale * value)
        }
    };
    let interval = match (row.ci95_low, row.ci95_high) {
        (Some(low), Some(high)) => format!("{} to {}", number(low), number(high)),
        _ => "-".into(),
    };
    let count = |value: Option<usize>| value.map_or("-".into(), |value| value.to_string());
    format!(
        "{:<22} {:<14} {:>5} {:>6} {:>8} {:>18} {:>4} {:>10}",
        row.method,
        row.setting,
        count(row.shots),
        count(row.sweeps),
        number(row.mean),
        interval,
        row.n,
        row.published.map_or(String::new(), number)
    )
}
