//! The grid of a recipe: all data sets, treatments of levels and lengths of sweeps.

use tactnet_data::Seed;
use tactnet_pipeline::{LabelOrder, MeanRemoval, SplitKind, TrainSpec};

use super::data::{RecipeWithData, absolute};
use super::models::Model;
use super::{Job, QuestionTask, Task, stem};
use crate::questions::{Ask, Crossval, Question};
use crate::{ExperimentRecipe, Part, Probe, SweepLength};

/// The recipe with its models.
pub(super) struct Grid<'a> {
    pub(super) recipe: &'a ExperimentRecipe,
    pub(super) models: &'a [Model],
    pub(super) data: &'a RecipeWithData<'a>,
}

/// A data set with a treatment of levels and a length of sweeps.
struct GridPoint<'a> {
    recipe: &'a ExperimentRecipe,
    data: &'a str,
    levels: MeanRemoval,
    /// Number of time steps to which sweeps are cut; `None` for complete sweeps.
    length: Option<SweepLength>,
}

/// Position of a training in the cross-validation.
#[derive(Clone, Copy)]
struct Place {
    split: SplitKind,
    repeat: usize,
    fold: usize,
    /// Number of training sweeps of each material; `None` for all of the fold.
    shots: Option<usize>,
}

impl<'a> Grid<'a> {
    /// Returns all combinations of data set, treatment of levels and length of sweeps.
    fn points(&self) -> Vec<GridPoint<'a>> {
        let recipe = self.recipe;
        let lengths: Vec<Option<SweepLength>> = if recipe.steps.is_empty() {
            vec![None]
        } else {
            recipe.steps.iter().copied().map(Some).collect()
        };
        let mut points = Vec::new();
        for data in &recipe.data {
            for &levels in &recipe.levels {
                points.extend(lengths.iter().map(|&length| GridPoint {
                    recipe,
                    data,
                    levels,
                    length,
                }));
            }
        }
        points
    }

    /// Plans all tasks of the recipe's question.
    ///
    /// # Errors
    /// A model that is not a network, for a question about networks.
    pub(super) fn tasks(&self) -> Result<Vec<Task>, String> {
        match &self.recipe.question {
            Question::Crossval(asked) => Ok(self.trainings(asked)),
            question => self.question_tasks(question.ask()),
        }
    }

    /// Plans the trainings of a cross-validation fold by fold, so that a partly finished experiment has the same folds
    /// of every model.
    fn trainings(&self, asked: &Crossval) -> Vec<Task> {
        let folds =
            (0..asked.repeats).flat_map(|repeat| (0..asked.folds).map(move |fold| (repeat, fold)));
        let mut tasks = Vec::new();
        for (repeat, fold) in folds {
            for point in self.points() {
                for (order, split) in self.splits(asked, point.data).into_iter().enumerate() {
                    if fold >= self.data.folds(point.data, split).unwrap_or(usize::MAX) {
                        continue;
                    }
                    // Only random splits differ between repeats; the author's split and a hold-out have one fold.
                    let random = matches!(
                        split,
                        SplitKind::KFold | SplitKind::HoldOut | SplitKind::GroupKFold
                    );
                    let single = matches!(split, SplitKind::TestFlag | SplitKind::HoldOut);
                    if repeat > 0 && !random || fold > 0 && single {
                        continue;
                    }
                    let place = Place {
                        split,
                        repeat,
                        fold,
                        shots: None,
                    };
                    tasks.extend(asked.probes.iter().map(|probe| point.probe(*probe, place)));
                    // Few sweeps are drawn from the folds of the headline only.
                    let few = asked.shots.iter().copied().filter(|_| order == 0);
                    for shots in std::iter::once(None).chain(few.map(Some)) {
                        let place = Place { shots, ..place };
                        let models = self.models.iter();
                        tasks.extend(models.map(|model| point.training(asked, model, place)));
                    }
                }
            }
        }
        tasks
    }

    /// Returns the splits of a data set: those of the question, or folds of whole blocks and random folds. Only the former
    /// where sweeps of a block share frames, only the latter without blocks.
    fn splits(&self, asked: &Crossval, data: &str) -> Vec<SplitKind> {
        match asked.split[..] {
            [] if self.data.folds(data, SplitKind::GroupKFold).is_some() => {
                let shares_frames = self
                    .data
                    .file(data)
                    .is_some_and(|file| !file.shared().is_empty());
                let random = (!shares_frames).then_some(SplitKind::KFold);
                [SplitKind::GroupKFold].into_iter().chain(random).collect()
            }
            [] => vec![SplitKind::KFold],
            _ => asked.split.clone(),
        }
    }

    /// Plans one task for each part of the data, grid point and network.
    fn question_tasks(&self, question: &dyn Ask) -> Result<Vec<Task>, String> {
        let name = question.name();
        let is_unfit = |model: &&Model| !model.is_network() && !question.takes_baselines();
        if let Some(model) = self.models.iter().find(is_unfit) {
            return Err(format!(
                "model `{}`: the question `{name}` needs networks",
                model.name
            ));
        }
        let mut tasks = Vec::new();
        for part in question.parts() {
            for point in self.points() {
                tasks.extend(
                    self.models
                        .iter()
                        .map(|model| point.question(name, model, part)),
                );
            }
        }
        Ok(tasks)
    }
}

impl GridPoint<'_> {
    /// Returns the task that trains and evaluates one model.
    fn training(&self, asked: &Crossval, model: &Model, place: Place) -> Task {
        let mut spec = self.spec(&model.recipe, place);
        spec.inner = model.inner;
        spec.epochs = self.recipe.epochs.filter(|_| model.has_epochs());
        spec.watch_test = asked.watch_test;
        Task {
            id: self.id(&model.name, place),
            model: model.name.clone(),
            job: Job::Train(spec),
            probe: None,
            members: Vec::new(),
        }
    }

    /// Returns the task of a probe.
    fn probe(&self, probe: Probe, place: Place) -> Task {
        let (name, model, label_order) = match probe {
            Probe::Means => (
                "probe_means",
                "probe: nearest taxel means",
                LabelOrder::True,
            ),
            Probe::FirstFrame => (
                "probe_first_frame",
                "probe: first frame alone",
                LabelOrder::True,
            ),
            Probe::LastFrame => (
                "probe_last_frame",
                "probe: last frame alone",
                LabelOrder::True,
            ),
            Probe::Permuted => (
                "probe_permuted",
                "probe: permuted labels (minirocket)",
                LabelOrder::Permuted,
            ),
        };
        Task {
            id: self.id(name, place),
            model: model.into(),
            job: Job::Train(TrainSpec {
                label_order,
                ..self.spec(probe.recipe(), place)
            }),
            probe: Some(probe),
            members: Vec::new(),
        }
    }

    /// Returns the task that answers the recipe's question for one part of the data.
    fn question(&self, name: &str, model: &Model, part: Part) -> Task {
        let [data, rest] = self.parts();
        let networks = TrainSpec {
            epochs: self.recipe.epochs.filter(|_| model.has_epochs()),
            ..self.of_recipe(&model.recipe)
        };
        Task {
            id: format!("{data}-{}{rest}-{name}-{}", model.name, part.id()),
            model: model.name.clone(),
            job: Job::Question(QuestionTask {
                question: self.recipe.question.clone(),
                part,
                networks,
            }),
            probe: None,
            members: Vec::new(),
        }
    }

    fn of_recipe(&self, recipe: &str) -> TrainSpec {
        TrainSpec {
            data: absolute(self.data),
            recipe: recipe.into(),
            mean_removal: Some(self.levels),
            rate_hz: self.recipe.rate_hz,
            steps: self.length.and_then(SweepLength::steps),
            lengths: self.length.map(SweepLength::lengths).unwrap_or_default(),
            seed: Seed(self.recipe.seed),
            device: self.recipe.device,
            ..TrainSpec::default()
        }
    }

    fn spec(
        &self,
        recipe: &str,
        Place {
            split,
            repeat,
            fold,
            shots,
        }: Place,
    ) -> TrainSpec {
        TrainSpec {
            split: Some(split),
            repeat,
            fold: Some(fold),
            shots,
            ..self.of_recipe(recipe)
        }
    }

    /// Returns the parts of a task's name before and after the model: data set; levels and steps.
    fn parts(&self) -> [String; 2] {
        let levels = if self.levels.is_none() {
            ""
        } else {
            "-no_levels"
        };
        let steps = self.length.and_then(SweepLength::steps);
        let steps = steps.map_or(String::new(), |steps| format!("-{steps}_steps"));
        [stem(self.data), format!("{levels}{steps}")]
    }

    fn id(
        &self,
        model: &str,
        Place {
            split,
            repeat,
            fold,
            shots,
        }: Place,
    ) -> String {
        let [data, mut rest] = self.parts();
        if let Some(shots) = shots {
            rest.push_str(&format!("-{shots}_shots"));
        }
        match split {
            SplitKind::KFold => format!("{data}-{model}{rest}-run{repeat}-fold{fold}"),
            SplitKind::HoldOut => format!("{data}-{model}{rest}-holdout{repeat}"),
            SplitKind::TestFlag => format!("{data}-{model}{rest}-test_flag"),
            SplitKind::LeaveBlockOut => format!("{data}-{model}{rest}-block{fold}"),
            SplitKind::GroupKFold => format!("{data}-{model}{rest}-run{repeat}-groups{fold}"),
            SplitKind::TrainOnAll => format!("{data}-{model}{rest}-all"),
        }
    }
}
