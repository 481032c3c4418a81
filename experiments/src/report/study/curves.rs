//! The figures of a study: lines and bars.

use maud::{Markup, PreEscaped, html};
use tactnet_pipeline::MeanRemoval;
use tactnet_plot::{Axes, Axis, Scale, Series, Tick, figure, legend};

use super::super::text::{percent, px};
use super::strengths::strengths;
use crate::measure::method_name;
use crate::questions::Figure;
use crate::{Measure, Row, Summary};

/// Returns the figures of each data set; `None` if there is nothing to draw.
pub(super) fn curves(study: &Summary) -> Option<Markup> {
    let mut sets: Vec<(&str, MeanRemoval, usize, &str)> = Vec::new();
    for row in &study.rows {
        let set = set_of(row);
        if !sets.contains(&set) {
            sets.push(set);
        }
    }
    let mut figures: Vec<Markup> = Vec::new();
    for set in sets {
        let rows: Vec<&Row> = study.rows.iter().filter(|row| set_of(row) == set).collect();
        let name = format!("{}, levels {}", set.0, set.1.name());
        let drawn = study
            .question
            .ask()
            .figures()
            .into_iter()
            .filter_map(|figure| match figure {
                Figure::Shots { title, methods } => accuracy_by_shots(&name, title, &rows, methods),
                Figure::Sweeps => accuracy_by_sweeps(&name, &rows),
                Figure::Bars(measure) => bars(&name, &rows, measure),
                Figure::Strengths { .. } => None,
            });
        figures.extend(drawn);
    }
    figures.extend(strengths(study));
    (!figures.is_empty()).then(|| html! { @for figure in figures { (figure) } })
}

/// Returns data set, levels, steps and networks of a row.
fn set_of(row: &Row) -> (&str, MeanRemoval, usize, &str) {
    (&row.data, row.levels, row.steps, &row.model)
}

/// A line with its name and its points.
type Line = (String, Vec<(f64, f64)>);

/// Returns a figure of accuracy with one line for each method; `None` without lines.
fn lines(horizontal: Axis, mut lines: Vec<Line>, title: &str, caption: &str) -> Option<Markup> {
    if lines.is_empty() {
        return None;
    }
    let axes = Axes {
        left: 52.0,
        top: 10.0,
        width: 440.0,
        height: 300.0,
        horizontal,
        vertical: Axis::percent("accuracy, %", 1.0, 0.2),
    };
    let mut content = axes.grid();
    for (index, (_, points)) in lines.iter_mut().enumerate() {
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        content.push_str(&axes.line(Series::nth(index), points, 1));
    }
    let names: Vec<String> = lines.into_iter().map(|(name, _)| name).collect();
    Some(html! {
        figure {
            (PreEscaped(figure(510.0, 360.0, title, &content)))
            (PreEscaped(legend(&names)))
            figcaption { (title) (caption) }
        }
    })
}

fn accuracy_by_shots(name: &str, subject: &str, rows: &[&Row], methods: &[&str]) -> Option<Markup> {
    let mut shots: Vec<usize> = rows.iter().filter_map(|row| row.shots).collect();
    shots.sort_unstable();
    shots.dedup();
    let most = *shots.last().filter(|most| **most > 1)?;
    let tick = |n: &usize| Tick {
        value: *n as f64,
        label: n.to_string(),
    };
    let horizontal = Axis {
        label: "sweeps of each new material".into(),
        scale: Scale::Logarithmic(1.0..=most as f64),
        ticks: shots.iter().map(tick).collect(),
    };
    let line = |method: &&str| -> Line {
        let own = rows.iter().filter(|row| row.method == *method);
        let points = own.filter_map(|row| Some((row.shots? as f64, row.statistic.mean)));
        ((*method).to_string(), points.collect())
    };
    let drawn = methods.iter().take(Series::COUNT).map(line);
    let drawn = drawn.filter(|(_, points)| !points.is_empty()).collect();
    let title = format!("{subject}: accuracy against shots on {name}");
    lines(
        horizontal,
        drawn,
        &title,
        ". The axis of shots is logarithmic.",
    )
}

/// Returns the accuracy against the mean number of sweeps, for sequential decisions and for fixed numbers.
fn accuracy_by_sweeps(name: &str, rows: &[&Row]) -> Option<Markup> {
    let mut series: Vec<Line> = Vec::new();
    for accuracy in rows.iter().filter(|row| row.measure == Measure::Accuracy) {
        let Some(sweeps) = rows.iter().find(|row| {
            row.measure == Measure::MeanSweeps
                && row.method == accuracy.method
                && row.setting == accuracy.setting
        }) else {
            continue;
        };
        let rule = accuracy.setting.split(' ').next().unwrap_or_default();
        let label = format!("{}, {rule}", method_name(&accuracy.method));
        let point = (sweeps.statistic.mean, accuracy.statistic.mean);
        match series.iter_mut().find(|(known, _)| *known == label) {
            Some((_, points)) => points.push(point),
            None => series.push((label, vec![point])),
        }
    }
    let points = series.iter().flat_map(|(_, points)| points);
    let most = points.fold(1.0_f64, |most, point| most.max(point.0));
    let title = format!("Accuracy against sweeps on {name}");
    let caption = ": fixed numbers of sweeps, and sequential decisions.";
    lines(
        Axis::linear("mean number of sweeps", 0.0..=most, 1.0),
        series,
        &title,
        caption,
    )
}

/// Left end of the bars, in user units.
const LEFT: f64 = 250.0;
/// Length of 100 %, in user units.
const WIDTH: f64 = 240.0;
/// Height of a line of bars, in user units.
const STEP: f64 = 22.0;

/// Returns one bar for each method and condition; `None` without rows of the measure.
fn bars(name: &str, rows: &[&Row], measure: Measure) -> Option<Markup> {
    let rows: Vec<&Row> = rows
        .iter()
        .copied()
        .filter(|row| row.measure == measure)
        .collect();
    if rows.is_empty() {
        return None;
    }
    let content = html! { @for (index, row) in rows.iter().enumerate() { (bar(row, 8.0 + STEP * index as f64)) } };
    let title = format!("{measure} on {name}");
    let height = 16.0 + STEP * rows.len() as f64;
    Some(html! {
        figure {
            (PreEscaped(figure(560.0, height, &title, &content.0)))
            figcaption {
                (title) ", %, with 95 % intervals; from 0 to 100."
                @if rows.iter().any(|row| row.published.is_some()) { " Squares: published for TactMat." }
            }
        }
    })
}

/// Draws mean, interval and published value of a row.
fn bar(row: &Row, y: f64) -> Markup {
    let (ours, theirs) = (Series::nth(0), Series::nth(1));
    let at = |value: f64| LEFT + WIDTH * value.clamp(0.0, 1.0);
    html! {
        text.end x=(px(LEFT - 8.0)) y=(px(y + 4.0)) {
            (method_name(&row.method))
            @if !row.setting.is_empty() { ", " (row.setting) }
            @if let Some(sweeps) = row.sweeps { ", " (sweeps) " sw." }
        }
        line.grid x1=(LEFT) x2=(px(LEFT + WIDTH)) y1=(px(y)) y2=(px(y)) {}
        @if let Some([low, high]) = row.statistic.ci95 {
            @let points = format!("{:.1},{y:.1} {:.1},{y:.1}", at(low), at(high));
            (PreEscaped(ours.group(&html! { polyline points=(points) {} }.0)))
        }
        (PreEscaped(ours.group(&ours.marker(at(row.statistic.mean), y))))
        text x=(px(LEFT + WIDTH + 8.0)) y=(px(y + 4.0)) { (percent(row.statistic.mean)) }
        @if let Some(published) = row.published { (PreEscaped(theirs.group(&theirs.marker(at(published), y)))) }
    }
}
