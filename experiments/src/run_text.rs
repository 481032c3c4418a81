//! One training run's result as text, beside what was published, and what may come next.

use tactnet_data::twin::TwinVersion;
use tactnet_pipeline::{
    Confusion, EvaluationTable, ModelRecipe, PipelineError, RunDir, RunResult, TrainingSteps,
    quoted,
};

use crate::{ExperimentRecipe, published_for};

/// Accuracy from which on nobody needs advice.
const GOOD: f64 = 0.95;

/// Returns `result` as lines of text: data, accuracies, the most frequent mistakes, the published row that it may be set beside, chosen settings, time, folder.
///
/// # Errors
/// A run directory whose configuration, split or predictions are damaged.
pub fn run_text(run: &RunDir, result: &RunResult) -> Result<String, PipelineError> {
    let mut lines = vec![
        format!(
            "{} ({}), recipe {}: {} training sweeps, {} test sweeps",
            result.data, result.split, result.recipe, result.n_train, result.n_test
        ),
        EvaluationTable(&result.evaluations).to_string(),
    ];
    let (config, split) = (run.config()?, run.split()?);
    let materials = config.classifier.labels.len();
    lines.push(format!(
        "guessing one of {materials} materials is right in {:.1} %",
        100.0 / materials as f64
    ));
    let method = config.recipe.method();
    let (_, predictions) = run.predictions(method)?;
    lines.push(Confusion::from(&predictions).to_string());
    if let Some(row) = published_for(&config, result.origin, &split, method) {
        lines.push(format!(
            "published for TactMat, {}: {:.1} % with 1 sweep, {:.1} % with 3 (thesis, table 4.2)",
            row.classifier, row.one_sweep.0, row.three_sweeps.0
        ));
    }
    for (setting, value) in &result.chosen {
        lines.push(format!(
            "chosen on training sweeps: {setting} = {}",
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

/// A number of a setting: whole ones as they are, others with four digits.
fn in_four_digits(value: f64) -> String {
    if value == value.trunc() && value.abs() < 1e6 {
        return value.to_string();
    }
    let digits = (3 - value.abs().log10().floor() as i32).clamp(0, 12) as usize;
    format!("{value:.digits$}")
}

/// Returns what may make a poor result better, a line each: more steps where there were few, a simpler model where the result may as well be
/// guessed. Empty for others.
///
/// # Errors
/// A run directory whose configuration is damaged.
pub fn advice(run: &RunDir, result: &RunResult) -> Result<Vec<String>, PipelineError> {
    let config = run.config()?;
    let mut lines = Vec::new();
    let ModelRecipe::TactNet2(recipe) = &config.recipe else {
        return Ok(lines);
    };
    let accuracies = result.evaluations.values().map(|of| of.one_sweep);
    let best = accuracies.clone().map(|of| of.mean).fold(0.0, f64::max);
    if best < GOOD {
        let steps = TrainingSteps::of(&recipe.training, result.n_train);
        lines.extend(steps.hint("--epochs "));
    }
    let chance = 1.0 / config.classifier.labels.len() as f64;
    let surely = accuracies.map(|of| of.ci95_low).fold(0.0, f64::max);
    if surely <= chance {
        lines.push(format!(
            "this may as well be guessed ({:.1} %); from few sweeps `--model minirocket` and `--model lda` learn faster",
            100.0 * chance
        ));
    }
    Ok(lines)
}

/// Returns what may follow a training, as two lines of commands.
///
/// - `fits_serving`: whether an online classifier takes sweeps and materials like the run's
///
/// # Errors
/// A run directory whose configuration is damaged.
pub fn next_steps(run: &RunDir, fits_serving: bool) -> Result<String, PipelineError> {
    let config = run.config()?;
    let folder = quoted(&run.path().display().to_string());
    let network = matches!(config.recipe, ModelRecipe::TactNet2(_));
    let first = if network && fits_serving {
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
    let models = beside_others(config.recipe.name())
        .map_or(String::new(), |models| format!(" --set 'models={models}'"));
    Ok(format!(
        "next: {first}\n      `tactnet experiment run crossval_baselines{data}{rate}{epochs}{models}` makes a report of models side by side"
    ))
}

/// Returns the models of the report that `next_steps` names where a built-in recipe is not among the experiment's own: the recipe, and what it is
/// to be held against.
fn beside_others(recipe: &str) -> Option<String> {
    let own = ExperimentRecipe::built_in().find(|own| own.name == "crossval_baselines")?;
    let known = ModelRecipe::built_in_names().any(|name| name == recipe);
    (known && !own.models.iter().any(|model| model == recipe))
        .then(|| format!("[\"{recipe}\", \"fast\", \"lda\", \"minirocket\"]"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recipe_that_the_report_lacks_is_added_to_it() {
        assert_eq!(beside_others("fast"), None);
        assert_eq!(beside_others("lda"), None);
        assert_eq!(beside_others("my-own"), None);
        let models = beside_others("spectra").unwrap();
        let settings = [format!("models={models}")];
        let recipe = ExperimentRecipe::load("crossval_baselines", &settings).unwrap();
        assert_eq!(recipe.models[0], "spectra");
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
