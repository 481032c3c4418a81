//! Aggregates the results of tasks into the summary of an experiment.

use std::collections::{BTreeMap, BTreeSet};

use tactnet_data::DataOrigin;
use tactnet_pipeline::{LabelOrder, MeanRemoval};

use crate::comparison::{RowOfTasks, comparisons};
use crate::measure::Unit;
use crate::published_confusion::TACTMAT_MATERIALS;
use crate::tasks::{ExperimentDir, TaskState};
use crate::{
    DataRecord, ExperimentError, FeatureMap, Measure, Measurement, Part, Row, Statistic, Summary,
    Task, TaskRecord,
};

/// A finished task with everything that the summary needs, for all questions.
pub(crate) struct FinishedTask<'a> {
    pub(crate) task: &'a Task,
    /// Name inside the model's recipe.
    pub(crate) model: String,
    /// Name of the data set, including its treatment.
    pub(crate) data: String,
    pub(crate) label_order: LabelOrder,
    pub(crate) origin: DataOrigin,
    pub(crate) data_sha256: String,
    pub(crate) assumed_rate_hz: Option<f64>,
    pub(crate) materials: usize,
    pub(crate) levels: MeanRemoval,
    /// Time steps of a sweep, and the requested number of steps.
    pub(crate) steps: (usize, Option<usize>),
    pub(crate) processors: Vec<String>,
    pub(crate) test_share: f64,
    pub(crate) measurements: Vec<Measurement>,
    pub(crate) maps: Vec<FeatureMap>,
    pub(crate) record: TaskRecord,
}

impl FinishedTask<'_> {
    /// Returns the name of the data set without its treatment.
    pub(crate) fn data_name(&self) -> &str {
        let mut name = self.data.as_str();
        if self.label_order == LabelOrder::Permuted {
            name = name.strip_suffix(", labels permuted").unwrap_or(name);
        }
        if let Some(steps) = self.steps.1 {
            name = name
                .strip_suffix(&format!(", first {steps} steps"))
                .unwrap_or(name);
        }
        name
    }

    /// Returns the key of the contender that a measurement belongs to.
    pub(crate) fn contender(&self, method: &str, setting: &str) -> String {
        let levels = match self.levels {
            MeanRemoval::None => "",
            MeanRemoval::PerSweep => ", levels removed",
        };
        let steps = self
            .steps
            .1
            .map_or(String::new(), |steps| format!(", {steps} steps"));
        let setting = match setting {
            "" => String::new(),
            setting => format!(", {setting}"),
        };
        let method = match method {
            "plain" => String::new(),
            "mc_dropout" => ", MC dropout".into(),
            method => format!(", {method}"),
        };
        format!(
            "{}{levels}{steps}{setting}: {}{method}",
            self.data_name(),
            self.task.model
        )
    }
}

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
        git: set(&|task| task.record.git.clone()),
        seed: recipe.seed,
        tasks_done: finished.len(),
        tasks: dir.plan.tasks.len(),
        train_seconds: finished.iter().map(|task| task.record.seconds).sum(),
        processors: set(&|task| task.processors.clone()),
        data: finished
            .iter()
            .map(|task| {
                let record = DataRecord {
                    sha256: task.data_sha256.clone(),
                    origin: task.origin,
                    assumed_rate_hz: task.assumed_rate_hz,
                };
                (task.data.clone(), record)
            })
            .collect(),
        rows,
        comparisons,
        records: finished.iter().map(|task| task.record.clone()).collect(),
        contenders: Vec::new(),
        audits: Vec::new(),
        groups: BTreeMap::new(),
        sample_efficiency: None,
        maps: Vec::new(),
    };
    question.complete(dir, &mut summary, &finished)?;
    Ok(summary)
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
            all().any(|task| task.record.recipe_sha256 != first.record.recipe_sha256),
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
            crate::Job::Train(_) => crate::questions::read_training(self, task),
            crate::Job::Question(asked) => {
                let result = self.question_result(task)?;
                Ok(FinishedTask {
                    task,
                    model: task.model.clone(),
                    data: result.data,
                    label_order: LabelOrder::True,
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

/// Returns true for a row of single-sweep accuracy, which ranks the contenders of a cross-validation.
pub(crate) fn is_one_sweep_accuracy(row: &Row) -> bool {
    row.measure == Measure::Accuracy && row.sweeps == Some(1)
}

/// Returns a title without the reference to the thesis in brackets, which only applies to TactMat.
fn without_source(title: &str) -> &str {
    title.split(" (thesis, ").next().unwrap_or(title)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ExperimentRecipe, Job};

    #[test]
    fn titles_of_other_data_name_no_figure_of_the_thesis() {
        let thesis = "Classifiers side by side (thesis, figure 4.6)";
        assert_eq!(without_source(thesis), "Classifiers side by side");
        assert_eq!(without_source("Pairs (own idea)"), "Pairs (own idea)");
    }

    /// Returns a finished training on the data set of a file with this stem.
    fn finished<'a>(
        task: &'a Task,
        data: &str,
        label_order: LabelOrder,
        steps: Option<usize>,
    ) -> FinishedTask<'a> {
        FinishedTask {
            task,
            model: "net".into(),
            data: data.into(),
            label_order,
            origin: DataOrigin::Recorded,
            data_sha256: String::new(),
            assumed_rate_hz: None,
            materials: 2,
            levels: MeanRemoval::None,
            steps: (steps.unwrap_or(1000), steps),
            processors: Vec::new(),
            test_share: 0.25,
            measurements: Vec::new(),
            maps: Vec::new(),
            record: TaskRecord {
                id: task.id.clone(),
                part: Part::Draw(0),
                command: String::new(),
                split: String::new(),
                split_sha256: String::new(),
                recipe_sha256: String::new(),
                git: Vec::new(),
                seconds: 0.0,
                chosen: BTreeMap::new(),
            },
        }
    }

    #[test]
    fn the_name_of_a_data_set_may_hold_a_comma() {
        let recipe = ExperimentRecipe::load("crossval_baselines", &[]).unwrap();
        let task = Task {
            id: "a".into(),
            model: recipe.models[0].clone(),
            job: Job::Train(tactnet_pipeline::TrainSpec::default()),
            probe: None,
        };
        for (data, order, steps) in [
            ("wood, cork", LabelOrder::True, None),
            ("wood, cork, labels permuted", LabelOrder::Permuted, None),
            (
                "wood, cork, first 100 steps, labels permuted",
                LabelOrder::Permuted,
                Some(100),
            ),
            ("wood, cork, first 100 steps", LabelOrder::True, Some(100)),
        ] {
            assert_eq!(
                finished(&task, data, order, steps).data_name(),
                "wood, cork",
                "{data}"
            );
        }
        // A suffix that belongs to the file's own name is kept.
        let own = finished(&task, "first, first 9 steps", LabelOrder::True, None);
        assert_eq!(own.data_name(), "first, first 9 steps");
    }
}
