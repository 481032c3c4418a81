//! Aggregates the results of tasks into the summary of an experiment.

mod audits;
mod contenders;
mod finished;
mod training;

use std::collections::{BTreeMap, BTreeSet};

use tactnet_data::Seed;
use tactnet_pipeline::LabelOrder;

use crate::benchmark::Benchmark;
use crate::comparison::{RowOfTasks, comparisons};
use crate::measure::Unit;
use crate::published_confusion::TACTMAT_MATERIALS;
use crate::questions::{Crossval, costs, sample_efficiency};
use crate::tasks::{ExperimentDir, TaskState};
use crate::{
    DataRecord, ExperimentError, FailedTasks, Job, Measure, Measurement, Part, Question, Row,
    Statistic, Summary, Task, TaskRecord, grouping_of_counts,
};
use audits::audits;
use contenders::contenders;
use finished::FinishedTask;
use training::read_training;

/// Returns the key of a row.
fn key(contender: &str, measurement: &Measurement) -> String {
    let count = |count: Option<usize>, what: &str| {
        count.map_or(String::new(), |count| format!(", {count} {what}"))
    };
    format!(
        "{contender}, {}{}{}",
        measurement.measure,
        count(measurement.shots, "shots"),
        count(measurement.sweeps, "sweeps")
    )
}

/// Summarises all finished tasks.
///
/// # Errors
/// A damaged task folder; tasks on different versions of a data set or a recipe.
pub fn summarise(dir: &ExperimentDir) -> Result<Summary, ExperimentError> {
    let recipe = &dir.plan.recipe;
    let question = recipe.question.ask();
    let finished: Vec<FinishedTask<'_>> = dir
        .plan
        .tasks
        .iter()
        .filter(|task| dir.state(task) == TaskState::Done)
        .map(|task| dir.finished(task))
        .collect::<Result<_, _>>()?;
    let rows = rows(dir, &finished)?;
    let comparisons = comparisons(&rows, |measure| question.compared(measure));
    let rows = rows.into_iter().map(|of| of.row).collect();
    let set = |of: &dyn Fn(&FinishedTask<'_>) -> Vec<String>| -> Vec<String> {
        let all: BTreeSet<String> = finished.iter().flat_map(of).collect();
        all.into_iter().collect()
    };
    let beside_published = finished.iter().all(|task| {
        task.origin.is_comparable_to_published() && task.materials == TACTMAT_MATERIALS.len()
    });
    let tasks = || dir.plan.tasks.iter();
    let mut summary = Summary {
        schema_version: Summary::SCHEMA_VERSION,
        name: recipe.name.clone(),
        title: if beside_published {
            recipe.title.clone()
        } else {
            without_source(&recipe.title).into()
        },
        expects: recipe.expected_of_run(beside_published).into(),
        command: dir.plan.command.clone(),
        question: recipe.question.clone(),
        data_warnings: dir.plan.data_warnings.clone(),
        left_out: dir.plan.left_out.clone(),
        git: set(&|task| task.record.git.clone()),
        seed: recipe.seed,
        tasks_done: finished.len(),
        tasks: dir.plan.tasks.len(),
        tasks_running: tasks()
            .filter(|task| dir.state(task) == TaskState::Running)
            .count(),
        failed: FailedTasks::of(tasks().filter_map(|task| Some((task, dir.failure(task)?)))),
        train_seconds: finished.iter().map(|task| task.record.seconds).sum(),
        processors: set(&|task| task.processors.clone()),
        data: finished.iter().map(data_record).collect(),
        rows,
        comparisons,
        records: finished.iter().map(|task| task.record.clone()).collect(),
        contenders: Vec::new(),
        benchmark: None,
        audits: Vec::new(),
        groups: BTreeMap::new(),
        sample_efficiency: None,
        maps: Vec::new(),
    };
    complete(&mut summary, dir, &finished)?;
    Ok(summary)
}

/// Returns the name of a task's data set and its record.
fn data_record(task: &FinishedTask<'_>) -> (String, DataRecord) {
    let record = DataRecord {
        sha256: task.data_sha256.clone(),
        origin: task.origin,
        assumed_rate_hz: task.assumed_rate_hz,
    };
    (task.data.clone(), record)
}

/// Adds the results that are specific to the question.
fn complete(
    summary: &mut Summary,
    dir: &ExperimentDir,
    finished: &[FinishedTask<'_>],
) -> Result<(), ExperimentError> {
    match &dir.plan.recipe.question {
        Question::Crossval(asked) => complete_crossval(summary, dir, finished, asked)?,
        Question::Nshot(_) => {
            let seed = Seed(summary.seed);
            summary.sample_efficiency = Some(sample_efficiency(&summary.rows, seed));
        }
        Question::FeatureMaps(_) => {
            summary.maps = finished.iter().flat_map(|task| task.maps.clone()).collect();
        }
        Question::Networks(_) => {
            let costs = costs(&summary.rows);
            let rows = summary.rows.iter_mut().zip(costs);
            rows.for_each(|(row, cost)| row.cost = cost);
        }
        _ => {}
    }
    Ok(())
}

/// Adds contenders, published values, audits and groups to the summary of a cross-validation.
fn complete_crossval(
    summary: &mut Summary,
    dir: &ExperimentDir,
    finished: &[FinishedTask<'_>],
    asked: &Crossval,
) -> Result<(), ExperimentError> {
    summary.contenders = contenders(dir, summary, finished, asked)?;
    for row in &mut summary.rows {
        let published = summary
            .contenders
            .iter()
            .find(|contender| contender.key == row.contender)
            .and_then(|contender| contender.published.as_ref());
        row.published = match (published, row.measure, row.sweeps) {
            (Some(published), Measure::Accuracy, Some(1)) => Some(published.one_sweep / 100.0),
            (Some(published), Measure::Accuracy, Some(3)) => Some(published.three_sweeps / 100.0),
            _ => None,
        };
    }
    let scored = summary.scored();
    let audits = audits(&scored, &dir.plan.data_probes);
    let grouped = scored.iter().filter(|contender| {
        asked.groups > 0 && !contender.probe && contender.materials.len() > asked.groups
    });
    let groups = grouped
        .map(|contender| {
            let (counts, repeats) = (&contender.confusion, contender.repeats());
            let grouping = grouping_of_counts(counts, asked.groups, repeats, summary.seed);
            let grouping = grouping.with_three_sweeps(&contender.fused_confusion);
            (contender.key.clone(), grouping)
        })
        .collect();
    let recipe = &dir.plan.recipe;
    // Several treatments of one data set are not several data sets.
    let one_treatment = recipe.levels.len() == 1 && recipe.steps.len() <= 1;
    let benchmark = one_treatment.then(|| Benchmark::of(&scored, &summary.left_out));
    let benchmark = benchmark.flatten();
    (summary.audits, summary.groups, summary.benchmark) = (audits, groups, benchmark);
    Ok(())
}

/// Returns the means of all quantities over the tasks, in the order of their first measurement.
fn rows(
    dir: &ExperimentDir,
    finished: &[FinishedTask<'_>],
) -> Result<Vec<RowOfTasks>, ExperimentError> {
    let mut order: Vec<String> = Vec::new();
    let mut measured: BTreeMap<String, Vec<(&FinishedTask<'_>, &Measurement)>> = BTreeMap::new();
    for task in finished {
        for measurement in &task.measurements {
            let contender = task.contender(&measurement.method, &measurement.setting);
            let key = key(&contender, measurement);
            if !measured.contains_key(&key) {
                order.push(key.clone());
            }
            measured.entry(key).or_default().push((task, measurement));
        }
    }
    order
        .into_iter()
        .map(|key| {
            let mut values = measured.remove(&key).unwrap_or_default();
            values.sort_by_key(|(task, _)| task.record.part);
            unmixed(dir, &key, &values)?;
            Ok(row(dir, key, &values))
        })
        .collect()
}

fn row(
    dir: &ExperimentDir,
    key: String,
    values: &[(&FinishedTask<'_>, &Measurement)],
) -> RowOfTasks {
    let (first, measurement) = values[0];
    let own: Vec<f64> = values.iter().map(|(_, of)| of.value).collect();
    let share = first.test_share;
    let statistic = match measurement.measure.unit() {
        Unit::Share => Statistic::of_shares(own, share),
        _ => Statistic::of(own, share),
    };
    let mut row = Row {
        key,
        contender: first.contender(&measurement.method, &measurement.setting),
        data: first.data_name().into(),
        origin: first.origin,
        materials: first.materials,
        levels: first.levels,
        steps: first.steps.0,
        model: first.model.clone(),
        method: measurement.method.clone(),
        setting: measurement.setting.clone(),
        shots: measurement.shots,
        sweeps: measurement.sweeps,
        measure: measurement.measure,
        n: statistic.values.len(),
        statistic,
        decisions: values.iter().map(|(_, of)| of.decisions).sum(),
        published: None,
        humans: None,
        cost: None,
    };
    if row.is_beside_published() {
        let published = dir.plan.recipe.question.ask().published(&row);
        (row.published, row.humans) = (published.robot, published.humans);
    }
    RowOfTasks {
        row,
        tasks: values
            .iter()
            .map(|(task, _)| (task.record.part, task.record.split_sha256.clone()))
            .collect(),
        test_share: share,
        probe: first.task.probe.is_some(),
    }
}

/// Checks that the tasks of one row use the same data set and recipe, and that no part occurs twice.
fn unmixed(
    dir: &ExperimentDir,
    key: &str,
    values: &[(&FinishedTask<'_>, &Measurement)],
) -> Result<(), ExperimentError> {
    let first = values[0].0;
    let all = || values.iter().map(|(task, _)| task);
    let parts: BTreeSet<Part> = values.iter().map(|(task, _)| task.record.part).collect();
    for (what, mixed) in [
        (
            "data sets (the file has changed between tasks)",
            all().any(|task| task.data_sha256 != first.data_sha256),
        ),
        (
            "recipes",
            all().any(|task| task.recipe_key != first.recipe_key),
        ),
        ("results of one fold", parts.len() < values.len()),
    ] {
        if mixed {
            return Err(ExperimentError::Folder {
                path: dir.path().into(),
                reason: format!("`{key}` would mix several {what}; run it in a new folder"),
            });
        }
    }
    Ok(())
}

impl ExperimentDir {
    /// Reads the result of a finished task.
    fn finished<'a>(&'a self, task: &'a Task) -> Result<FinishedTask<'a>, ExperimentError> {
        match &task.job {
            Job::Train(_) => read_training(self, task),
            Job::Question(asked) => {
                let result = self.question_result(task)?;
                Ok(FinishedTask {
                    task,
                    model: task.model.clone(),
                    data: result.data,
                    label_order: LabelOrder::True,
                    recipe_key: result.recipe_sha256.clone(),
                    origin: result.origin,
                    data_sha256: result.data_sha256,
                    assumed_rate_hz: result.assumed_rate_hz,
                    materials: result.materials.len(),
                    levels: result.levels,
                    steps: (result.steps, asked.networks.steps),
                    processors: vec![result.provenance.processor],
                    test_share: asked.question.ask().test_share(),
                    measurements: result.measurements,
                    maps: result.maps,
                    record: TaskRecord {
                        id: task.id.clone(),
                        part: asked.part,
                        command: String::new(),
                        split: result.split,
                        split_sha256: result.split_sha256,
                        recipe_sha256: result.recipe_sha256,
                        git: vec![result.provenance.git],
                        seconds: result.seconds,
                        chosen: result.chosen,
                    },
                })
            }
        }
    }
}

/// Returns a title without the reference to the thesis in brackets, which only applies to TactMat.
fn without_source(title: &str) -> &str {
    title.split(" (thesis, ").next().unwrap_or(title)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn titles_of_other_data_name_no_figure_of_the_thesis() {
        let thesis = "Classifiers side by side (thesis, figure 4.6)";
        assert_eq!(without_source(thesis), "Classifiers side by side");
        assert_eq!(without_source("Pairs (own idea)"), "Pairs (own idea)");
    }
}
