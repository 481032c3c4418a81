//! The result of a training run on a terminal, with published values, advice and next commands.

use tactnet_data::SweepView;
use tactnet_data::twin::TwinVersion;
use tactnet_experiments::{ExperimentRecipe, Probe, published_for};
use tactnet_pipeline::{
    Confusion, ModelRecipe, PipelineError, RunDir, RunResult, Session, TrainingSteps, quoted,
};

use crate::commands::block_text::{confounded_text, random_fold_text};
use crate::commands::eval_text::{guessing_text, mistakes_text};
use crate::commands::evaluation_table::evaluation_table;
use crate::commands::recall_text::recall_text;

/// Accuracy from which no advice is given.
const GOOD: f64 = 0.95;
/// The recipe that has an alternative for few sweeps.
const FAST: &str = "fast";
/// Number of training sweeps of a material up to which the network on spectra was clearly better on the twin.
const FEW_SWEEPS: usize = 20;

/// Returns `result` as text: data, accuracies, the most frequent confusions, the comparable published values, selected
/// settings, time and folder.
///
/// # Errors
/// A run directory with damaged configuration, split or predictions.
pub fn run_text(run: &RunDir, result: &RunResult) -> Result<String, PipelineError> {
    let mut lines = vec![
        format!(
            "{} ({}), recipe {}: {} training sweeps, {} test sweeps",
            result.data, result.split, result.recipe, result.n_train, result.n_test
        ),
        evaluation_table(&result.evaluations),
    ];
    let (config, split) = (run.config()?, run.split()?);
    let method = config.recipe.method();
    let (_, predictions) = run.predictions(method)?;
    let confusion = Confusion::from(&predictions);
    let (accuracy, balanced) = (predictions.one_sweep(), predictions.balanced());
    lines.push(guessing_text(&confusion, accuracy, balanced) + &recall_text(&confusion));
    lines.push(mistakes_text(&confusion));
    lines.extend(result.random_fold.as_ref().map(random_fold_text));
    lines.extend(result.confounded.as_ref().map(confounded_text));
    if let Some(row) = published_for(&config, result.origin, &split, method) {
        lines.push(format!(
            "published for TactMat, {}: {:.1} % with 1 sweep, {:.1} % with 3 (thesis, table 4.2)",
            row.classifier, row.one_sweep.0, row.three_sweeps.0
        ));
    }
    for (setting, value) in &result.chosen {
        lines.push(format!(
            "selected on training sweeps: {setting} = {}",
            in_four_digits(*value)
        ));
    }
    let seconds = result.train_seconds;
    let work = match (result.epochs, result.seconds_per_epoch) {
        (Some(epochs), Some(each)) => {
            let plural = if epochs == 1 { "" } else { "s" };
            format!("{epochs} epoch{plural} in {seconds:.0} s ({each:.2} s an epoch)")
        }
        _ => format!("fitted in {seconds:.1} s"),
    };
    lines.push(format!("{work}; run directory {}", run.path().display()));
    Ok(lines.join("\n"))
}

/// Formats the value of a setting: integers unchanged, other numbers with four digits.
fn in_four_digits(value: f64) -> String {
    if value == value.trunc() && value.abs() < 1e6 {
        return value.to_string();
    }
    let digits = (3 - value.abs().log10().floor() as i32).clamp(0, 12) as usize;
    format!("{value:.digits$}")
}

/// Returns advice for a poor result, one line each: more steps, another model, or more sweeps. Empty for a good result.
///
/// # Errors
/// A run directory with damaged configuration or split.
pub fn advice(session: &Session, result: &RunResult) -> Result<Vec<String>, PipelineError> {
    let run = session.run();
    let config = run.config()?;
    let mut lines = Vec::new();
    let ModelRecipe::Network(recipe) = &config.recipe else {
        return Ok(lines);
    };
    let accuracies = result.evaluations.values().map(|of| of.one_sweep);
    let best = accuracies.clone().map(|of| of.mean).fold(0.0, f64::max);
    if best < GOOD {
        let steps = TrainingSteps::of(&recipe.training, result.n_train);
        lines.extend(steps.hint("--epochs "));
    }
    let train = SweepView::new(session.dataset(), run.split()?.train);
    let counts = train.sweeps_per_label();
    let fewest = counts.iter().min().copied().unwrap_or_default();
    if best < GOOD && recipe.name == FAST && fewest <= FEW_SWEEPS {
        lines.push(
            "another network may be more accurate with so few sweeps: `--recipe spectra` (on ten sweeps of each material of the synthetic twin 78 \
             instead of 45 %, but no better on a real BioTac)"
                .into(),
        );
    }
    let (_, predictions) = run.predictions(config.recipe.method())?;
    let chance = predictions.guessing();
    let surely = accuracies.map(|of| of.ci95_low).fold(0.0, f64::max);
    if surely <= chance {
        lines.push(format!(
            "the accuracy is not better than chance ({:.1} %); {}",
            100.0 * chance,
            with_few_sweeps(&counts)
        ));
    }
    Ok(lines)
}

/// Returns advice for a network that is not better than chance.
///
/// - `counts`: training sweeps of each material
fn with_few_sweeps(counts: &[usize]) -> String {
    let names = ["minirocket", "lda"];
    match &ModelRecipe::not_starved(names, counts)[..] {
        [] => "record more: with two training sweeps of each material, `--model minirocket` and `--model lda` learn faster".into(),
        [one] => format!("`--model {one}` needs fewer sweeps"),
        several => format!(
            "`--model {}` need fewer sweeps",
            several.join("` and `--model ")
        ),
    }
}

/// Returns commands that may follow a training, as two lines.
///
/// - `fits_serving`: true if the online classifier supports the run's sweeps and materials
///
/// # Errors
/// A run directory with a damaged configuration.
pub fn next_steps(session: &Session, fits_serving: bool) -> Result<String, PipelineError> {
    let run = session.run();
    let config = run.config()?;
    let folder = quoted(&run.path().display().to_string());
    let serves = RunDir::open(run.path())?.network("be served").is_ok();
    let first = if serves && fits_serving {
        format!("`tactnet demo --run {folder}` shows it live")
    } else {
        format!("`tactnet eval {folder} --data FILE` tests it on other sweeps")
    };
    let data = match config.spec.data.as_str() {
        twin if twin == TwinVersion::default().name() => String::new(),
        file => format!(" --set {}", quoted(&format!("data={file}"))),
    };
    let rate = config
        .spec
        .rate_hz
        .map_or(String::new(), |rate| format!(" --set rate_hz={rate}"));
    let epochs = config
        .spec
        .epochs
        .map_or(String::new(), |epochs| format!(" --set epochs={epochs}"));
    let report = match comparison_settings(
        config.recipe.name(),
        &session.dataset().sweeps_per_label(),
    ) {
        Some(settings) => format!(
            "\n      `tactnet experiment run {COMPARISON}{data}{rate}{epochs}{settings}` reports a comparison of models"
        ),
        None => String::new(),
    };
    Ok(format!("next: {first}{report}"))
}

/// The experiment that compares a recipe with others.
const COMPARISON: &str = "crossval_baselines";
/// Number of folds of that experiment.
const FOLDS: usize = 5;

/// Returns the settings with which [`COMPARISON`] includes a recipe: as many folds as there are sweeps for, and models that
/// can learn from the remaining training sweeps. `None` if there are none.
///
/// - `counts`: sweeps of each material
fn comparison_settings(recipe: &str, counts: &[usize]) -> Option<String> {
    let own = ExperimentRecipe::built_in().find(|own| own.name == COMPARISON)?;
    let fewest = *counts.iter().min()?;
    if fewest < 2 {
        return None;
    }
    let folds = FOLDS.min(fewest);
    let set_folds = match folds {
        FOLDS => String::new(),
        few => format!(" --set folds={few}"),
    };
    let known = ModelRecipe::built_in_names().any(|name| name == recipe);
    let usual: Vec<&str> = own.models.iter().map(String::as_str).collect();
    let models = match usual.contains(&recipe) || !known {
        true => usual.clone(),
        false => vec![recipe, "fast", "lda", "minirocket"],
    };
    let to_train_on: Vec<usize> = counts.iter().map(|of| of - of.div_ceil(folds)).collect();
    let models = ModelRecipe::not_starved(models, &to_train_on);
    let set_models = match models == usual {
        true => String::new(),
        false => format!(" --set 'models={models:?}'"),
    };
    let probes = Probe::ALL
        .into_iter()
        .filter(|probe| !ModelRecipe::not_starved([probe.recipe()], &to_train_on).is_empty());
    let probes: Vec<&str> = probes.map(Probe::name).collect();
    let set_probes = match probes.len() == Probe::ALL.len() {
        true => String::new(),
        false => format!(" --set 'probes={probes:?}'"),
    };
    Some(set_folds + &set_models + &set_probes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recipe_that_the_report_lacks_is_added_to_it() {
        let many = [20, 30];
        for own in ["fast", "lda", "my-own"] {
            assert_eq!(comparison_settings(own, &many).unwrap(), "");
        }
        let settings = comparison_settings("spectra", &many).unwrap();
        let models = settings.strip_prefix(" --set '").unwrap();
        let models = models.strip_suffix('\'').unwrap();
        let recipe = ExperimentRecipe::load(COMPARISON, &[models.into()]).unwrap();
        assert_eq!(recipe.models[0], "spectra");
    }

    #[test]
    fn few_sweeps_make_few_folds_of_models_that_can_learn_from_them() {
        assert_eq!(
            comparison_settings("fast", &[3, 9]).unwrap(),
            " --set folds=3"
        );
        assert_eq!(
            comparison_settings("fast", &[2; 5]).unwrap(),
            " --set folds=2 --set 'models=[\"knn-l\", \"knn-h\", \"fast\"]' --set 'probes=[\"means\", \"first-frame\", \"last-frame\"]'"
        );
        assert_eq!(comparison_settings("fast", &[1, 9]), None);
        assert!(with_few_sweeps(&[1, 1]).starts_with("record more"));
        assert!(with_few_sweeps(&[2, 2]).contains("`--model minirocket` and `--model lda`"));
    }

    #[test]
    fn settings_are_shown_with_four_digits() {
        for (value, shown) in [
            (0.021_544_346_9, "0.02154"),
            (0.288_103_378, "0.2881"),
            (3.0, "3"),
            (1234.567, "1235"),
            (0.0, "0"),
        ] {
            assert_eq!(in_four_digits(value), shown);
        }
    }
}
