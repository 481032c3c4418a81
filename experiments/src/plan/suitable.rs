//! Checks before the first task that data sets fit an experiment.

use std::collections::{BTreeMap, BTreeSet};

use tactnet_data::{DataError, Dataset, Finding, Fold, Scheme, SweepShape, refuse_leaks};
use tactnet_pipeline::{ModelRecipe, TrainSpec};

use super::data::RecipeWithData;
use super::{Job, LeftOut, Task};
use crate::questions::Question;
use crate::{Probe, Setting};

/// Minimum number of known materials: with a single one, every sweep would be classified correctly.
const LEAST_KNOWN: usize = 2;

/// The reason why a data set is too small, and the settings with which the experiment is possible.
pub(super) struct Unsuitable {
    pub(super) reason: String,
    pub(super) settings: Vec<Setting>,
}

impl From<String> for Unsuitable {
    fn from(reason: String) -> Self {
        Self {
            reason,
            settings: Vec::new(),
        }
    }
}

/// Removes the tasks whose model needs longer sweeps or a higher sample rate than its data set has, and returns them.
///
/// The twin always has enough of all.
///
/// - `recipe_of`: returns the recipe of a task's model
///
/// # Errors
/// A task that needs more sweeps or materials than its data set has; no task that remains.
pub(super) fn leave_out_unsuitable(
    tasks: &mut Vec<Task>,
    data: &RecipeWithData<'_>,
    recipe_of: impl Fn(&TrainSpec) -> Option<ModelRecipe>,
) -> Result<Vec<LeftOut>, Unsuitable> {
    let (mut starved, mut fed) = (BTreeMap::new(), BTreeSet::new());
    let (mut left_out, mut unmet) = (BTreeSet::new(), BTreeSet::new());
    for task in tasks.iter() {
        let spec = match &task.job {
            Job::Train(spec) => spec,
            Job::Question(task) => &task.networks,
        };
        let Some(file) = data.file(&spec.data) else {
            continue;
        };
        let (dataset, shared) = (&file.dataset, file.shared());
        let of_data = |mut error: Unsuitable| {
            error.reason = format!("data `{}`: {}", spec.data, error.reason);
            error
        };
        match &task.job {
            Job::Train(spec) => {
                has_fold(spec, dataset).map_err(of_data)?;
                leaks_nothing(spec, dataset, shared).map_err(of_data)?;
                let model = (task.probe, task.model.as_str());
                let recipe = recipe_of(spec);
                let checked = recipe.as_ref().map(|of| unmet_by(of, spec, dataset));
                if let Some(Some(reason)) = checked {
                    unmet.insert(all_folds(task));
                    left_out.insert(LeftOut {
                        model: task.model.clone(),
                        data: dataset.name().into(),
                        shots: spec.shots,
                        reason,
                    });
                    continue;
                }
                match recipe.and_then(|recipe| lacking(&recipe, spec, dataset)) {
                    Some(lacking) => {
                        starved
                            .entry(model)
                            .or_insert_with(|| of_data(lacking.into()).reason);
                    }
                    None => {
                        fed.insert(model);
                    }
                }
            }
            Job::Question(task) => suits(&task.question, dataset, shared).map_err(of_data)?,
        }
    }
    refuse_starved(&starved, fed)?;
    let remains = |task: &Task| !unmet.contains(&all_folds(task));
    let contends = |task: &Task| remains(task) && task.probe.is_none();
    if let Some(first) = left_out.first()
        && !tasks.iter().any(contends)
    {
        return Err(format!("no model can be trained; {first}").into());
    }
    tasks.retain(remains);
    Ok(left_out.into_iter().collect())
}

/// Returns a key of a task and of the same task on other folds: a model that one fold does not allow is left out in all of them.
fn all_folds(task: &Task) -> String {
    let settings = match &task.job {
        Job::Train(spec) => serde_json::to_string(&TrainSpec {
            fold: None,
            repeat: 0,
            ..spec.clone()
        }),
        Job::Question(_) => return task.id.clone(),
    };
    format!("{} {}", task.model, settings.unwrap_or_default())
}

/// Returns the requirement of a model that the sweeps of a data set, or the few that are drawn from a fold, do not meet; `None` if they meet
/// all.
fn unmet_by(recipe: &ModelRecipe, spec: &TrainSpec, dataset: &Dataset) -> Option<String> {
    let shape = SweepShape {
        steps: spec.steps.unwrap_or(dataset.shortest()),
        ..dataset.shape()
    };
    let checked = recipe.check_sweeps(shape, dataset.sample_rate_hz());
    if let Err(error) = checked {
        return Some(error.to_string());
    }
    spec.shots?;
    match spec.fold_of(dataset) {
        Err(error) => Some(error.to_string()),
        Ok(fold) => {
            let (_, needed) = recipe.starved(&fold.train.sweeps_per_label())?;
            Some(format!(
                "it needs {needed} training sweeps of every material"
            ))
        }
    }
}

/// Returns an error if some models have too few sweeps, with settings that keep only the others.
///
/// - `starved`: reason for each model with too few sweeps
/// - `fed`: models that have enough sweeps in some fold
fn refuse_starved(
    starved: &BTreeMap<Asked<'_>, String>,
    mut fed: BTreeSet<Asked<'_>>,
) -> Result<(), Unsuitable> {
    let Some(lacking) = starved.values().next() else {
        return Ok(());
    };
    fed.retain(|model| !starved.contains_key(model));
    let (probes, models): (Vec<Asked<'_>>, Vec<_>) =
        fed.iter().partition(|(probe, _)| probe.is_some());
    let reason = format!("{lacking} for {}", names(starved.keys()));
    let mut settings = Vec::new();
    if starved.keys().any(|(probe, _)| probe.is_none()) {
        if models.is_empty() {
            return Err(format!("{reason}; record more sweeps").into());
        }
        let value = format!("[{}]", names(&models));
        settings.push(Setting {
            field: "models",
            value,
        });
    }
    if starved.keys().any(|(probe, _)| probe.is_some()) {
        let kinds = probes.iter().filter_map(|(probe, _)| *probe);
        let kinds: Vec<String> = kinds.map(|probe| format!("\"{}\"", probe.name())).collect();
        let value = format!("[{}]", kinds.join(", "));
        settings.push(Setting {
            field: "probes",
            value,
        });
    }
    Err(Unsuitable { reason, settings })
}

/// A model, or a probe and its model.
type Asked<'a> = (Option<Probe>, &'a str);

/// Returns the quoted names of models, separated by commas.
fn names<'a>(asked: impl IntoIterator<Item = &'a Asked<'a>>) -> String {
    let quoted: Vec<String> = asked
        .into_iter()
        .map(|(_, model)| format!("\"{model}\""))
        .collect();
    quoted.join(", ")
}

/// Returns the material that has too few training sweeps for a model, as part of a message; `None` if there is none.
fn lacking(recipe: &ModelRecipe, spec: &TrainSpec, dataset: &Dataset) -> Option<String> {
    let fold = spec.fold_of(dataset).ok()?;
    let counts = fold.train.sweeps_per_label();
    let (label, _) = recipe.starved(&counts)?;
    Some(format!(
        "`{}` has {} training sweep{} in fold {}, which is too few",
        dataset.labels().name(label),
        counts[label],
        if counts[label] == 1 { "" } else { "s" },
        spec.fold.unwrap_or(0),
    ))
}

/// Checks that a data set has as many folds as a training asks for.
fn has_fold(spec: &TrainSpec, dataset: &Dataset) -> Result<(), Unsuitable> {
    let text = |error: DataError| Unsuitable::from(error.to_string());
    let scheme = spec.scheme(dataset);
    let folds = scheme.folds(dataset).map_err(text)?;
    let asked = spec.fold.unwrap_or(0) + 1;
    if asked <= folds {
        return Ok(());
    }
    let fewest = dataset.sweeps_per_label().into_iter().min();
    let why = match scheme {
        Scheme::StratifiedKFold { .. } if fewest == Some(folds) => {
            format!("since a material has {folds} sweeps")
        }
        scheme => format!("to {scheme}"),
    };
    Err(Unsuitable {
        reason: format!("expected `folds` of at most {folds}, {why}, found {asked} or more"),
        settings: vec![Setting {
            field: "folds",
            value: folds.to_string(),
        }],
    })
}

/// Checks that a training's split keeps sweeps that share frames together.
///
/// - `shared`: findings about sweeps of one block that share frames
fn leaks_nothing(
    spec: &TrainSpec,
    dataset: &Dataset,
    shared: &[Finding],
) -> Result<(), Unsuitable> {
    let refused = refuse_leaks(dataset, shared, spec.scheme(dataset), dataset.name());
    refused.map_err(|error| Unsuitable {
        reason: error.to_string(),
        settings: vec![Setting {
            field: "split",
            value: "leave-block-out".into(),
        }],
    })
}

/// Checks the numbers of materials and sweeps that a question needs, and that no sweeps share frames. Questions draw new
/// materials and split the sweeps of each material into five folds.
fn suits(question: &Question, dataset: &Dataset, shared: &[Finding]) -> Result<(), Unsuitable> {
    if dataset.lengths().is_some() {
        return Err(Unsuitable {
            reason: "expected sweeps of one length for this question, found unequal ones".into(),
            settings: vec![Setting {
                field: "steps",
                value: "shortest".into(),
            }],
        });
    }
    let materials = dataset.labels().len();
    if let Some(new) = question.ask().new_materials() {
        let most = materials.saturating_sub(LEAST_KNOWN);
        if most < 2 {
            return Err(format!(
                "expected at least four materials, two known and two new, found {materials}"
            )
            .into());
        }
        if new > most {
            return Err(Unsuitable {
                reason: format!(
                    "expected `new_materials` of at most {most}, so that {LEAST_KNOWN} of {materials} are known, found {new}"
                ),
                settings: vec![Setting {
                    field: "new_materials",
                    value: most.to_string(),
                }],
            });
        }
    }
    let leaks = refuse_leaks(dataset, shared, Scheme::default(), dataset.name());
    leaks.map_err(|error| error.to_string())?;
    let seed = tactnet_data::Seed(0);
    match Fold::new(dataset, Scheme::default(), seed, 0, 0) {
        Ok(_) => Ok(()),
        Err(error) => Err(format!(
            "{error}; this experiment splits the sweeps of every material into five"
        )
        .into()),
    }
}
