//! A finished task with everything that the summary needs.

use tactnet_data::DataOrigin;
use tactnet_pipeline::{LabelOrder, MeanRemoval};

use crate::answer::FeatureMap;
use crate::measure::Measurement;
use crate::plan::Task;
use crate::summary::TaskRecord;

/// A finished task with everything that the summary needs, for all questions.
pub(crate) struct FinishedTask<'a> {
    pub(crate) task: &'a Task,
    /// Name inside the model's recipe.
    pub(crate) model: String,
    /// Name of the data set, including its treatment.
    pub(crate) data: String,
    pub(crate) label_order: LabelOrder,
    /// Text that is equal for all tasks of one recipe, whatever the size of their folds.
    pub(crate) recipe_key: String,
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ExperimentRecipe, Job, Part};
    use std::collections::BTreeMap;

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
            recipe_key: String::new(),
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
            members: Vec::new(),
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
