//! What a study found: tables, curves, comparisons, and the tasks behind them.

use super::results::Heading::{Number, Text};
use super::results::{number, sortable};
use super::svg::{Axes, SERIES, figure, legend};
use super::text::{ABSENT, decimal, duration, escape, hash, p_value, percent, scroll};
use crate::{FeatureMap, Study, StudyRow, StudySummary};

const TERMS: [(&str, &str); 11] = [
    (
        "95 % interval",
        "Of the mean over tasks. Where tasks share training sweeps it is widened for that (Nadeau and Bengio, 2003). Draws of new \
         materials all come from one data set: their interval says nothing about other data sets.",
    ),
    (
        "Shots",
        "Sweeps of every new material that are learnt from.",
    ),
    (
        "OL, OL-FCL, OL-mean",
        "The network learnt on the known materials stays as it is but for its output layer; or its last two layers; or the output layer \
         is drawn towards the known materials' weights (thesis, section 4.6). As a prior mean that all classes share changes no softmax, \
         OL-mean differs from OL by the strength of the prior alone.",
    ),
    (
        "NK",
        "No pre-knowledge: a whole network learns the new materials alone, in one of the five folds.",
    ),
    (
        "SimpleShot, LDA, whitened OL, tuned OL",
        "Nearest class mean of centred, normalised features (Wang et al., 2019); nearest class mean, and an output layer, on features \
         whitened with the known materials' covariance; an output layer on plain features. Strengths are chosen on known materials.",
    ),
    (
        "AUROC",
        "Chance that a sweep of an unknown material looks stranger than one of a known material.",
    ),
    (
        "False alarms, detected",
        "Share of known and of unknown sweeps above a threshold that sweeps of known materials, which nothing was trained on, set for 5 % \
         false alarms.",
    ),
    (
        "Conformal set",
        "All labels whose probability is above a calibrated bound; it holds the true one as often as its target says.",
    ),
    (
        "Known, before, after, lost",
        "Accuracy on test sweeps of the known materials before and after one more was added, and the difference.",
    ),
    (
        "Purity",
        "Share of the five nearest sweeps that are of the same material, in the whole space or in the plane that t-SNE makes of it.",
    ),
    (
        "Until 0.99",
        "Sweeps are fused until the most probable material has this probability, at most ten.",
    ),
];

/// Sections of the page: identifier, heading, content.
pub(super) fn sections(study: &StudySummary) -> Vec<(&'static str, &'static str, String)> {
    let mut sections = vec![("results", "Results", results(study))];
    sections.push(("curves", "At a glance", curves(study)));
    if !study.maps.is_empty() {
        let maps: String = study.maps.iter().map(map).collect();
        sections.push((
            "maps",
            "Feature maps",
            format!("<div class=\"panels\">\n{maps}</div>\n"),
        ));
    }
    if !study.comparisons.is_empty() {
        sections.push(("comparisons", "Paired comparisons", comparisons(study)));
    }
    if study.kind == Study::Nshot {
        sections.push(("efficiency", "Sweeps saved", efficiency(study)));
    }
    sections.push(("tasks", "Where the numbers come from", tasks(study)));
    let terms: String = TERMS
        .iter()
        .map(|(term, meaning)| format!("<div><dt>{term}</dt><dd>{meaning}</dd></div>\n"))
        .collect();
    sections.push((
        "glossary",
        "How to read this",
        format!("<dl class=\"glossary\">\n{terms}</dl>\n"),
    ));
    sections
}

/// Whether a measure is a share, which is shown in percent.
fn is_share(measure: &str) -> bool {
    !matches!(measure, "set size" | "mean sweeps")
}

fn shown(measure: &str, value: f64) -> String {
    if is_share(measure) {
        percent(value)
    } else {
        decimal(value, 2)
    }
}

fn count(value: Option<usize>) -> String {
    number(
        value.map(|value| value as f64),
        &value.map(|value| value.to_string()).unwrap_or_default(),
    )
}

fn interval(measure: &str, low: Option<f64>, high: Option<f64>) -> String {
    match (low, high) {
        (Some(low), Some(high)) => format!("[{}, {}]", shown(measure, low), shown(measure, high)),
        _ => ABSENT.to_string(),
    }
}

fn results(study: &StudySummary) -> String {
    if study.rows.is_empty() {
        return "<p>No task has ended yet.</p>\n".to_string();
    }
    let lines: String = study
        .rows
        .iter()
        .map(|row| {
            let published = |value: Option<f64>| {
                number(value, &value.map(|value| shown(&row.measure, value)).unwrap_or_default())
            };
            format!(
                "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><th scope=\"row\">{}</th><td>{}</td>{}{}{}{}{}{}{}</tr>\n",
                escape(&row.data),
                escape(&row.levels),
                escape(&row.model),
                escape(&row.measure),
                escape(&row.method),
                escape(&row.setting),
                count(row.shots),
                count(row.sweeps),
                number(Some(row.mean), &shown(&row.measure, row.mean)),
                number(row.ci95_low, &interval(&row.measure, row.ci95_low, row.ci95_high)),
                number(Some(row.n as f64), &row.n.to_string()),
                published(row.published),
                published(row.humans),
            )
        })
        .collect();
    let table = format!(
        "<table class=\"sortable results\">\n<caption class=\"hidden\">What was measured</caption>\n<thead><tr>{}</tr></thead>\n\
         <tbody>\n{lines}</tbody>\n</table>\n",
        sortable(&[
            Text("Data"),
            Text("Levels"),
            Text("Networks"),
            Text("Measure"),
            Text("Method"),
            Text("Setting"),
            Number("Shots"),
            Number("Sweeps"),
            Number("Mean<br><small>%, or a number</small>"),
            Number("95 % interval"),
            Number("Tasks"),
            Number("Published<br><small>TactMat</small>"),
            Number("Humans<br><small>published</small>"),
        ])
    );
    format!(
        "<p>Means over tasks. Shares are in percent; set sizes and numbers of sweeps are numbers.</p>\n{}",
        scroll("Results table", &table)
    )
}

/// A figure for every data set.
fn curves(study: &StudySummary) -> String {
    let mut sets: Vec<(&str, &str, &str)> = Vec::new();
    for row in &study.rows {
        let set = (row.data.as_str(), row.levels.as_str(), row.model.as_str());
        if !sets.contains(&set) {
            sets.push(set);
        }
    }
    let html: String = sets
        .into_iter()
        .flat_map(|set| {
            let rows: Vec<&StudyRow> = study
                .rows
                .iter()
                .filter(|row| (row.data.as_str(), row.levels.as_str(), row.model.as_str()) == set)
                .collect();
            let name = format!("{}, levels {}", set.0, set.1);
            match study.kind {
                Study::Nshot => vec![
                    accuracy_by_shots(
                        &name,
                        "Methods of the thesis",
                        &rows,
                        &["nk", "ol", "ol-fcl", "ol-mean", "nn", "siamese"],
                    ),
                    accuracy_by_shots(
                        &name,
                        "Beyond the thesis",
                        &rows,
                        &["ol-mean", "simpleshot", "lda", "tuned-ol", "whitened-ol"],
                    ),
                ],
                Study::Sequential => vec![accuracy_by_sweeps(&name, &rows)],
                Study::Differentiate => vec![bars(&name, &rows, "accuracy")],
                Study::Unknown => vec![bars(&name, &rows, "auroc")],
                Study::FeatureMaps => vec![bars(&name, &rows, "purity")],
                Study::Enrolment => vec![
                    bars(&name, &rows, "new material"),
                    bars(&name, &rows, "known, after"),
                ],
            }
        })
        .collect();
    if html.is_empty() {
        "<p>Nothing to draw yet.</p>\n".into()
    } else {
        html
    }
}

fn axes(x_max: f64, y_max: f64) -> Axes {
    Axes {
        left: 52.0,
        top: 10.0,
        width: 440.0,
        height: 300.0,
        x_max,
        y_max,
    }
}

fn accuracy_by_shots(name: &str, what: &str, rows: &[&StudyRow], methods: &[&str]) -> String {
    let mut shots: Vec<usize> = rows.iter().filter_map(|row| row.shots).collect();
    shots.sort_unstable();
    shots.dedup();
    let Some(most) = shots.last().filter(|most| **most > 1) else {
        return String::new();
    };
    let axes = axes((*most as f64).ln(), 1.0);
    let marks: Vec<(f64, String)> = shots
        .iter()
        .map(|n| ((*n as f64).ln(), n.to_string()))
        .collect();
    let mut content = axes.rows(0.2, "accuracy, %");
    content.push_str(&axes.marks(&marks, "sweeps of every new material"));
    let mut names = Vec::new();
    for method in methods.iter().take(SERIES) {
        let mut points: Vec<(f64, f64)> = rows
            .iter()
            .filter(|row| row.method == *method)
            .filter_map(|row| Some(((row.shots? as f64).ln(), row.mean)))
            .collect();
        if points.is_empty() {
            continue;
        }
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        content.push_str(&axes.series(names.len(), &points, 1));
        names.push((*method).to_string());
    }
    if names.is_empty() {
        return String::new();
    }
    let title = format!("{what}: accuracy against shots on {name}");
    format!(
        "<figure>\n{}{}<figcaption>{}. Six new materials unless the command says otherwise; the axis of shots is logarithmic.</figcaption>\n</figure>\n",
        figure(510.0, 360.0, &title, &content),
        legend(&names),
        escape(&title)
    )
}

/// Accuracy against mean number of sweeps: stopping when sure beside fixed numbers.
fn accuracy_by_sweeps(name: &str, rows: &[&StudyRow]) -> String {
    let mut series: Vec<(String, Vec<(f64, f64)>)> = Vec::new();
    for accuracy in rows.iter().filter(|row| row.measure == "accuracy") {
        let Some(sweeps) = rows.iter().find(|row| {
            row.measure == "mean sweeps"
                && row.method == accuracy.method
                && row.setting == accuracy.setting
        }) else {
            continue;
        };
        let rule = accuracy.setting.split(' ').next().unwrap_or_default();
        let label = format!("{}, {rule}", accuracy.method);
        let point = (sweeps.mean, accuracy.mean);
        match series.iter_mut().find(|(known, _)| *known == label) {
            Some((_, points)) => points.push(point),
            None => series.push((label, vec![point])),
        }
    }
    let most = series
        .iter()
        .flat_map(|(_, points)| points)
        .fold(1.0_f64, |most, point| most.max(point.0));
    let axes = axes(most, 1.0);
    let marks: Vec<(f64, String)> = (0..=most as usize)
        .map(|n| (n as f64, n.to_string()))
        .collect();
    let mut content = axes.rows(0.2, "accuracy, %");
    content.push_str(&axes.marks(&marks, "mean number of sweeps"));
    for (index, (_, points)) in series.iter_mut().enumerate() {
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        content.push_str(&axes.series(index, points, 1));
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
fn bars(name: &str, rows: &[&StudyRow], measure: &str) -> String {
    const STEP: f64 = 22.0;
    let rows: Vec<&&StudyRow> = rows.iter().filter(|row| row.measure == measure).collect();
    let (left, width) = (250.0, 240.0);
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
            escape(&format!("{}{setting}{sweeps}", row.method)),
            left + width,
            y,
            y
        ));
        if let (Some(low), Some(high)) = (row.ci95_low, row.ci95_high) {
            content.push_str(&format!(
                "<g class=\"series s0\"><polyline points=\"{:.1},{y:.1} {:.1},{y:.1}\"/></g>\n",
                at(low),
                at(high)
            ));
        }
        content.push_str(&format!(
            "<g class=\"series s0\">{}</g><text x=\"{:.1}\" y=\"{:.1}\">{}</text>\n",
            super::svg::marker(0, at(row.mean), y),
            left + width + 8.0,
            y + 4.0,
            percent(row.mean)
        ));
        if let Some(published) = row.published {
            content.push_str(&format!(
                "<g class=\"series s1\">{}</g>\n",
                super::svg::marker(1, at(published), y)
            ));
        }
    }
    let title = format!("{measure} on {name}");
    format!(
        "<figure>\n{}<figcaption>{}, %, with 95 % intervals; from 0 to 100. Squares: published for TactMat.</figcaption>\n</figure>\n",
        figure(560.0, 16.0 + STEP * rows.len() as f64, &title, &content),
        escape(&title)
    )
}

/// Every sweep as a mark of its material.
fn map(map: &FeatureMap) -> String {
    const SIZE: f64 = 300.0;
    let range = |axis: usize| {
        let values = map.points.iter().map(|point| f64::from(point[axis]));
        let low = values.clone().fold(f64::INFINITY, f64::min);
        let high = values.fold(f64::NEG_INFINITY, f64::max);
        (low, (high - low).max(f64::MIN_POSITIVE))
    };
    let ranges = [range(0), range(1)];
    let at = |point: &[f32; 2], axis: usize| {
        let (low, width) = ranges[axis];
        8.0 + (SIZE - 16.0) * (f64::from(point[axis]) - low) / width
    };
    let mut content = String::new();
    for material in 0..map.materials.len() {
        let marks: String = map
            .points
            .iter()
            .zip(&map.labels)
            .filter(|(_, label)| **label == material)
            .map(|(point, _)| super::svg::marker(material, at(point, 0), at(point, 1)))
            .collect();
        content.push_str(&format!(
            "<g class=\"series s{}\">{marks}</g>\n",
            material % SERIES
        ));
    }
    let title = format!("{} materials, {} space", map.choice, map.space);
    format!(
        "<figure>\n{}{}<figcaption>t-SNE: {}. Distances between far groups mean little.</figcaption>\n</figure>\n",
        figure(SIZE, SIZE, &title, &content),
        legend(&map.materials),
        escape(&title)
    )
}

fn comparisons(study: &StudySummary) -> String {
    let lines: String = study
        .comparisons
        .iter()
        .map(|comparison| {
            let points = 100.0 * comparison.difference;
            let ends = match (comparison.ci95_low, comparison.ci95_high) {
                (Some(low), Some(high)) => format!("[{}, {}]", decimal(100.0 * low, 1), decimal(100.0 * high, 1)),
                _ => ABSENT.to_string(),
            };
            format!(
                "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td>{}{}<td>{}</td><td>{}</td>{}{}{}{}</tr>\n",
                escape(&comparison.data),
                escape(&comparison.levels),
                escape(&comparison.measure),
                escape(&comparison.setting),
                count(comparison.shots),
                count(comparison.sweeps),
                escape(&comparison.first),
                escape(&comparison.second),
                number(Some(points), &decimal(points, 1)),
                number(comparison.ci95_low, &ends),
                number(comparison.p, &comparison.p.map(p_value).unwrap_or_default()),
                number(Some(comparison.n as f64), &comparison.n.to_string())
            )
        })
        .collect();
    let table = format!(
        "<table class=\"sortable\">\n<caption class=\"hidden\">Differences on the same tasks</caption>\n<thead><tr>{}</tr></thead>\n\
         <tbody>\n{lines}</tbody>\n</table>\n",
        sortable(&[
            Text("Data"),
            Text("Levels"),
            Text("Measure"),
            Text("Setting"),
            Number("Shots"),
            Number("Sweeps"),
            Text("First"),
            Text("Second"),
            Number("First \u{2212} second<br><small>points</small>"),
            Number("95 % interval"),
            Number("p"),
            Number("Tasks"),
        ])
    );
    format!(
        "<p>Differences on the same tasks. p is two-sided and not adjusted for the number of comparisons.</p>\n{}",
        scroll("Paired comparisons", &table)
    )
}

fn efficiency(study: &StudySummary) -> String {
    if study.sample_efficiency.is_empty() {
        return "<p>Needs the methods <code>nk</code> and <code>ol-mean</code> with one or ten shots among several.</p>\n".to_string();
    }
    let lines: String = study
        .sample_efficiency
        .iter()
        .map(|found| {
            let shots = |value: Option<f64>| value.map_or("more than tried".to_string(), |value| decimal(value, 1));
            format!(
                "<tr><td>{}</td><td>{}</td><td class=\"number\">{}</td><td class=\"number\">{}</td><td class=\"number\">{}</td>\
                 <td class=\"number\">{}</td><td class=\"number\">{}</td><td class=\"number\">{}</td></tr>\n",
                escape(&found.data),
                escape(&found.levels),
                found.transfer_shots,
                percent(found.accuracy),
                shots(found.shots),
                found
                    .ci95
                    .map_or(ABSENT.to_string(), |ends| format!("{} to {}", shots(ends[0]), shots(ends[1]))),
                found
                    .shots
                    .map_or(ABSENT.to_string(), |shots| decimal(shots / found.transfer_shots as f64, 1)),
                decimal(found.published_ratio, 0)
            )
        })
        .collect();
    let table = format!(
        "<table>\n<caption class=\"hidden\">Sweeps saved by transfer</caption>\n<thead><tr><th scope=\"col\">Data</th><th scope=\"col\">Levels</th>\
         <th scope=\"col\" class=\"number\">Shots of transfer</th><th scope=\"col\" class=\"number\">Its accuracy, %</th>\
         <th scope=\"col\" class=\"number\">Shots without pre-knowledge</th><th scope=\"col\" class=\"number\">95 % interval</th>\
         <th scope=\"col\" class=\"number\">Ratio</th><th scope=\"col\" class=\"number\">Published ratio</th></tr></thead>\n<tbody>\n{lines}</tbody>\n</table>\n"
    );
    format!(
        "<p>Sweeps of every new material that a network without pre-knowledge needs to be as good as OL-mean. Between tested numbers a straight \
         line over their logarithm; intervals by bootstrap over draws of the materials.</p>\n{}",
        scroll("Sweeps saved", &table)
    )
}

fn tasks(study: &StudySummary) -> String {
    let lines: String = study
        .tasks
        .iter()
        .map(|task| {
            let chosen: Vec<String> = task.chosen.iter().map(|(name, value)| format!("{name} = {value}")).collect();
            format!(
                "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td class=\"number\">{}</td><td>{}</td></tr>\n",
                escape(&task.id),
                escape(&task.split),
                hash(&task.split_sha256),
                hash(&task.recipe_sha256),
                hash(&task.git),
                duration(task.seconds),
                escape(&chosen.join("; "))
            )
        })
        .collect();
    let table = format!(
        "<table>\n<thead><tr><th scope=\"col\">Task</th><th scope=\"col\">Split</th><th scope=\"col\">Its hash</th><th scope=\"col\">Recipe</th>\
         <th scope=\"col\">Commit</th><th scope=\"col\">Time</th><th scope=\"col\">Chosen</th></tr></thead>\n<tbody>\n{lines}</tbody>\n</table>\n"
    );
    format!(
        "<details><summary>All {} tasks that have ended</summary>\n<div class=\"inset\">\n{}</div>\n</details>\n",
        study.tasks.len(),
        scroll("Tasks", &table)
    )
}
