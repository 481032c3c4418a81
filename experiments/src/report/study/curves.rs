//! What a study found, as lines and bars.

use tactnet_pipeline::MeanRemoval;
use tactnet_plot::{Axes, Axis, Scale, Series, Tick, escape, figure, legend};

use super::super::text::percent;
use crate::measure::method_name;
use crate::questions::Figure;
use crate::{Measure, Row, Summary};

/// Figures for every data set; `None` if there is nothing to draw.
pub(super) fn curves(study: &Summary) -> Option<String> {
    let mut sets: Vec<(&str, MeanRemoval, usize, &str)> = Vec::new();
    for row in &study.rows {
        let set = set_of(row);
        if !sets.contains(&set) {
            sets.push(set);
        }
    }
    let html: String = sets
        .into_iter()
        .flat_map(|set| {
            let rows: Vec<&Row> = study.rows.iter().filter(|row| set_of(row) == set).collect();
            let name = format!("{}, levels {}", set.0, set.1.name());
            let figures = study.question.ask().figures();
            figures.into_iter().map(move |figure| match figure {
                Figure::Shots { title, methods } => accuracy_by_shots(&name, title, &rows, methods),
                Figure::Sweeps => accuracy_by_sweeps(&name, &rows),
                Figure::Bars(measure) => bars(&name, &rows, measure),
            })
        })
        .collect();
    (!html.is_empty()).then_some(html)
}

/// Data set, levels, steps and networks.
fn set_of(row: &Row) -> (&str, MeanRemoval, usize, &str) {
    (&row.data, row.levels, row.steps, &row.model)
}

fn axes(horizontal: Axis) -> Axes {
    Axes {
        left: 52.0,
        top: 10.0,
        width: 440.0,
        height: 300.0,
        horizontal,
        vertical: Axis::percent("accuracy, %", 1.0, 0.2),
    }
}

fn accuracy_by_shots(name: &str, what: &str, rows: &[&Row], methods: &[&str]) -> String {
    let mut shots: Vec<usize> = rows.iter().filter_map(|row| row.shots).collect();
    shots.sort_unstable();
    shots.dedup();
    let Some(most) = shots.last().filter(|most| **most > 1) else {
        return String::new();
    };
    let axes = axes(Axis {
        label: "sweeps of every new material".into(),
        scale: Scale::Logarithmic(1.0..=*most as f64),
        ticks: shots
            .iter()
            .map(|n| Tick {
                value: *n as f64,
                label: n.to_string(),
            })
            .collect(),
    });
    let mut content = axes.grid();
    let mut names = Vec::new();
    for method in methods.iter().take(Series::COUNT) {
        let mut points: Vec<(f64, f64)> = rows
            .iter()
            .filter(|row| row.method == *method)
            .filter_map(|row| Some((row.shots? as f64, row.statistic.mean)))
            .collect();
        if points.is_empty() {
            continue;
        }
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        content.push_str(&axes.line(Series::nth(names.len()), &points, 1));
        names.push((*method).to_string());
    }
    if names.is_empty() {
        return String::new();
    }
    let title = format!("{what}: accuracy against shots on {name}");
    format!(
        "<figure>\n{}{}<figcaption>{}. The axis of shots is logarithmic.</figcaption>\n</figure>\n",
        figure(510.0, 360.0, &title, &content),
        legend(&names),
        escape(&title)
    )
}

/// Accuracy against mean number of sweeps: stopping when sure beside fixed numbers.
fn accuracy_by_sweeps(name: &str, rows: &[&Row]) -> String {
    let mut series: Vec<(String, Vec<(f64, f64)>)> = Vec::new();
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
    if series.is_empty() {
        return String::new();
    }
    let most = series
        .iter()
        .flat_map(|(_, points)| points)
        .fold(1.0_f64, |most, point| most.max(point.0));
    let axes = axes(Axis::linear("mean number of sweeps", 0.0..=most, 1.0));
    let mut content = axes.grid();
    for (index, (_, points)) in series.iter_mut().enumerate() {
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        content.push_str(&axes.line(Series::nth(index), points, 1));
    }
    let names: Vec<String> = series.into_iter().map(|(name, _)| name).collect();
    let title = format!("Accuracy against sweeps on {name}");
    format!(
        "<figure>\n{}{}<figcaption>{}: fixed numbers of sweeps, and sweeping until sure.</figcaption>\n</figure>\n",
        figure(510.0, 360.0, &title, &content),
        legend(&names),
        escape(&title)
    )
}

/// A bar for every method and circumstance.
fn bars(name: &str, rows: &[&Row], measure: Measure) -> String {
    const STEP: f64 = 22.0;
    let rows: Vec<&&Row> = rows.iter().filter(|row| row.measure == measure).collect();
    let (left, width) = (250.0, 240.0);
    let (ours, theirs) = (Series::nth(0), Series::nth(1));
    let mut content = String::new();
    for (index, row) in rows.iter().enumerate() {
        let y = 8.0 + STEP * index as f64;
        let sweeps = row
            .sweeps
            .map_or(String::new(), |sweeps| format!(", {sweeps} sw."));
        let setting = if row.setting.is_empty() {
            String::new()
        } else {
            format!(", {}", row.setting)
        };
        let at = |value: f64| left + width * value.clamp(0.0, 1.0);
        content.push_str(&format!(
            "<text class=\"end\" x=\"{:.1}\" y=\"{:.1}\">{}</text><line class=\"grid\" x1=\"{left}\" x2=\"{:.1}\" y1=\"{:.1}\" y2=\"{:.1}\"/>\n",
            left - 8.0,
            y + 4.0,
            escape(&format!("{}{setting}{sweeps}", method_name(&row.method))),
            left + width,
            y,
            y
        ));
        if let Some([low, high]) = row.statistic.ci95 {
            content.push_str(&ours.group(&format!(
                "<polyline points=\"{:.1},{y:.1} {:.1},{y:.1}\"/>",
                at(low),
                at(high)
            )));
        }
        content.push_str(&ours.group(&ours.marker(at(row.statistic.mean), y)));
        content.push_str(&format!(
            "<text x=\"{:.1}\" y=\"{:.1}\">{}</text>\n",
            left + width + 8.0,
            y + 4.0,
            percent(row.statistic.mean)
        ));
        if let Some(published) = row.published {
            content.push_str(&theirs.group(&theirs.marker(at(published), y)));
        }
    }
    if rows.is_empty() {
        return String::new();
    }
    let squares = if rows.iter().any(|row| row.published.is_some()) {
        " Squares: published for TactMat."
    } else {
        ""
    };
    let title = format!("{measure} on {name}");
    format!(
        "<figure>\n{}<figcaption>{}, %, with 95 % intervals; from 0 to 100.{squares}</figcaption>\n</figure>\n",
        figure(560.0, 16.0 + STEP * rows.len() as f64, &title, &content),
        escape(&title)
    )
}
