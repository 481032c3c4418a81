//! Figures of accuracy against the strength of a disturbance, with one line for each model.

use maud::{Markup, PreEscaped, html};
use tactnet_pipeline::MeanRemoval;
use tactnet_plot::{Axes, Axis, Scale, Series, Tick, figure, legend};

use crate::questions::{Figure, Strength};
use crate::{Row, Summary};

/// Returns all such figures of the question, for each data set.
pub(super) fn strengths(study: &Summary) -> Vec<Markup> {
    let mut sets: Vec<(&str, MeanRemoval, usize)> = Vec::new();
    for row in &study.rows {
        if !sets.contains(&set_of(row)) {
            sets.push(set_of(row));
        }
    }
    let drawn = sets.into_iter().flat_map(|set| {
        let rows: Vec<&Row> = study
            .rows
            .iter()
            .filter(|row| set_of(row) == set && row.is_one_sweep_accuracy())
            .collect();
        let figures = study.question.ask().figures().into_iter();
        figures.filter_map(move |figure| drawn(figure, &rows, set.0))
    });
    drawn.collect()
}

fn set_of(row: &Row) -> (&str, MeanRemoval, usize) {
    (&row.data, row.levels, row.steps)
}

/// Returns the figure; `None` if no row has a strength, and for other figures.
fn drawn(figure_of: Figure, rows: &[&Row], data: &str) -> Option<Markup> {
    let Figure::Strengths {
        title,
        label,
        prefix,
        undisturbed,
        strength: kind,
    } = figure_of
    else {
        return None;
    };
    let neutral = match kind {
        Strength::Factor => 1.0,
        Strength::Size => 0.0,
    };
    let strength = |row: &Row| {
        let text = row.setting.strip_prefix(prefix);
        let named = text.and_then(|text| text.parse::<f64>().ok());
        named.or((row.setting == undisturbed).then_some(neutral))
    };
    let mut values: Vec<f64> = rows.iter().filter_map(|row| strength(row)).collect();
    values.sort_by(f64::total_cmp);
    values.dedup();
    let (&first, &last) = (values.first()?, values.last()?);
    if first == last {
        return None;
    }
    let tick = |value: &f64| Tick {
        value: *value,
        label: value.to_string(),
    };
    let horizontal = Axis {
        label: label.into(),
        scale: match kind {
            Strength::Factor => Scale::Logarithmic(first..=last),
            Strength::Size => Scale::Linear(first..=last),
        },
        ticks: values.iter().map(tick).collect(),
    };
    let axes = Axes {
        left: 52.0,
        top: 10.0,
        width: 440.0,
        height: 300.0,
        horizontal,
        vertical: Axis::percent("accuracy, %", 1.0, 0.2),
    };
    let mut models: Vec<String> = Vec::new();
    for row in rows {
        if !models.contains(&row.model) {
            models.push(row.model.clone());
        }
    }
    let mut content = axes.grid();
    for (index, model) in models.iter().enumerate() {
        let own = rows.iter().filter(|row| row.model == *model);
        let mut own: Vec<(f64, &Row)> =
            own.filter_map(|row| Some((strength(row)?, *row))).collect();
        own.sort_by(|a, b| a.0.total_cmp(&b.0));
        let points: Vec<(f64, f64)> = own
            .iter()
            .map(|(x, row)| (*x, row.statistic.mean))
            .collect();
        let ends = |(x, row): &(f64, &Row)| {
            let [low, high] = row.statistic.ci95?;
            Some((*x, low.max(0.0), high.min(1.0)))
        };
        let intervals: Vec<(f64, f64, f64)> = own.iter().filter_map(ends).collect();
        content.push_str(&axes.line(Series::nth(index), &points, 1));
        content.push_str(&axes.intervals(Series::nth(index), &intervals));
    }
    let title = format!("{title}: accuracy on {data}");
    Some(html! {
        figure {
            (PreEscaped(figure(510.0, 360.0, &title, &content)))
            (PreEscaped(legend(&models)))
            figcaption { (title) ", with 95 % intervals." @if kind == Strength::Factor { " The horizontal axis is logarithmic." } }
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::row::tests::row;
    use crate::{Measure, Statistic};

    #[test]
    fn a_line_goes_from_the_undisturbed_sweeps_through_all_strengths() {
        let of = |model: &str, setting: &str, mean: f64| Row {
            setting: setting.into(),
            sweeps: Some(1),
            statistic: Statistic::of(vec![mean - 0.01, mean + 0.01], 0.25),
            ..row("twin", model, "plain", Measure::Accuracy)
        };
        let rows = [
            of("fast", "clean", 0.9),
            of("fast", "gain 2", 0.7),
            of("fast", "gain 0.5", 0.8),
            of("fast", "speed 2", 0.1),
            of("lda", "clean", 0.6),
        ];
        let rows: Vec<&Row> = rows.iter().collect();
        let gain = |prefix| Figure::Strengths {
            title: "Gain",
            label: "factor",
            prefix,
            undisturbed: "clean",
            strength: Strength::Factor,
        };
        let page = drawn(gain("gain "), &rows, "twin").unwrap().into_string();
        // From 0.5 over 1, in the middle of the logarithmic axis, to 2; 90 % is 30 units below the top.
        assert!(
            page.contains("points=\"52.0,70.0 272.0,40.0 492.0,100.0\""),
            "{page}"
        );
        assert_eq!(page.matches("class=\"range\"").count(), 4, "{page}");
        assert!(drawn(gain("drift "), &rows, "twin").is_none());
    }
}
