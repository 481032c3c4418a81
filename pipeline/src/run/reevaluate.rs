//! Evaluation of a trained classifier on held-out or new sweeps.

use std::collections::BTreeMap;

use serde::Serialize;
use tactnet_data::{Dataset, Seed, SweepView, is_same_name};
use tactnet_models::argmax;

use crate::{
    Classifier, ConfoundedAccuracy, Confusion, Evaluation, LikenessReport, PipelineError,
    PredictionMethod, RunDir, RuntimeComparison, RuntimeKind, TestSweeps, Verdicts,
    compare_runtime, evaluate_all_ways, serialize_by_method,
};

/// Settings of an evaluation.
#[derive(Debug, Clone, Copy)]
pub struct Reevaluation {
    /// Number of sweeps of one material that are fused into one decision.
    pub fused: usize,
    /// Number of Monte Carlo dropout passes; 0 for none; `None` for the recipe's number, or 100.
    pub mc_samples: Option<usize>,
    /// Runtime that computes the scores; `None` for Burn in whole batches.
    pub runtime: Option<RuntimeKind>,
}

/// Result of an evaluation.
#[derive(Debug, Serialize)]
pub struct EvalResult {
    /// Version of this layout.
    pub schema_version: u32,
    /// Path of the run directory.
    pub run: String,
    /// Commit of the program.
    pub git: &'static str,
    /// Seed of the run.
    pub seed: Seed,
    /// SHA-256 of the run's split.
    pub split_sha256: String,
    /// False if the run has not ended; the weights are then those of its last checkpoint.
    pub finished: bool,
    /// Name of the data set.
    pub data: String,
    /// SHA-256 of the data set's content.
    pub data_sha256: String,
    /// Description of the tested sweeps.
    pub tested: String,
    /// Number of tested sweeps.
    pub n_test: usize,
    /// Masked taxels.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub dead_taxels: Vec<usize>,
    /// Evaluations by prediction method; empty if no sweep is of a known material.
    #[serde(serialize_with = "serialize_by_method")]
    pub evaluations: BTreeMap<PredictionMethod, Evaluation>,
    /// Confusion matrix of plain predictions; absent if no sweep is of a known material.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub confusion: Option<Confusion>,
    /// Accuracy of plain predictions without the materials that coincide with recording blocks; absent if there are none, and for
    /// other data than the training data.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub confounded: Option<ConfoundedAccuracy>,
    /// Comparisons with Burn by prediction method; empty for Burn itself.
    #[serde(
        skip_serializing_if = "BTreeMap::is_empty",
        serialize_with = "serialize_by_method"
    )]
    pub runtimes: BTreeMap<PredictionMethod, RuntimeSummary>,
    /// Measured rates of a calibrated classifier.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub verdicts: Option<Verdicts>,
    /// Number of sweeps of materials that the classifier does not know.
    pub n_unknown: usize,
    /// Numbers of sweeps by unknown material, then by most probable known material.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub unknown_taken_for: BTreeMap<String, BTreeMap<String, usize>>,
    /// Unknown materials whose names differ from a known one only in case or spaces, with that name.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub unknown_meant: BTreeMap<String, String>,
    /// Comparison with the training sweeps; absent for runs with few training sweeps or of earlier versions.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub likeness: Option<LikenessReport>,
    /// Warning about the range of the values.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub values: Option<String>,
}

/// Comparison of another runtime with Burn's predictions of whole batches.
#[derive(Debug, Serialize)]
pub struct RuntimeSummary {
    /// Name of the runtime.
    pub runtime: &'static str,
    /// Largest absolute difference of a probability.
    pub largest_difference: f64,
    /// Median time from the last frame of a single sweep to its probabilities, in microseconds.
    pub p50_us: f64,
    /// 99th percentile of that time, in microseconds.
    pub p99_us: f64,
    /// Maximum of that time, in microseconds.
    pub max_us: f64,
}

/// Results on sweeps of known materials.
#[derive(Default)]
struct KnownSweeps {
    evaluations: BTreeMap<PredictionMethod, Evaluation>,
    runtimes: BTreeMap<PredictionMethod, RuntimeSummary>,
    confusion: Option<Confusion>,
    confounded: Option<ConfoundedAccuracy>,
}

impl Reevaluation {
    /// Predicts the `tested` sweeps of `dataset` with the classifier of `run` and evaluates the predictions.
    ///
    /// - `git`: commit of this program
    ///
    /// # Errors
    /// A damaged run; sweeps of another shape; sweeps of an unknown material if the classifier is not calibrated; a runtime that this build
    /// lacks.
    pub fn of(
        self,
        run: &RunDir,
        classifier: &Classifier,
        dataset: &Dataset,
        tested: TestSweeps<'_>,
        git: &'static str,
    ) -> Result<EvalResult, PipelineError> {
        let config = run.config()?;
        let seed = config.spec.seed;
        let usual = config.recipe.method().mc_samples_or(100);
        let mc_samples = self.mc_samples.unwrap_or(usual);
        let (known, unknown) = classifier.by_known_material(&tested.view);
        let verdicts = run
            .unknown_detector()?
            .map(|detector| Verdicts::of(&detector, classifier, &known, &unknown))
            .transpose()?;
        // Only a calibrated classifier accepts materials that it does not know.
        let view = if verdicts.is_some() {
            &known
        } else {
            &tested.view
        };
        let unknown_taken_for = match verdicts.is_some() && !unknown.is_empty() {
            true => taken_for(classifier, &unknown)?,
            false => BTreeMap::new(),
        };
        let unknown_meant = meant_by(classifier, unknown_taken_for.keys());
        let likeness = run.likeness()?.filter(|_| !view.is_empty());
        let likeness = likeness.map(|likeness| likeness.assess(view, seed));
        let known = match view.is_empty() {
            true => KnownSweeps::default(),
            false => self.known_sweeps(classifier, view, mc_samples, seed)?,
        };
        Ok(EvalResult {
            schema_version: 1,
            likeness,
            run: run.path().display().to_string(),
            git,
            seed,
            split_sha256: run.split()?.sha256,
            finished: run.has_final_weights(),
            data: dataset.name().into(),
            data_sha256: dataset.sha256().into(),
            n_test: tested.view.len(),
            dead_taxels: classifier.dead().0.keys().copied().collect(),
            tested: tested.description,
            evaluations: known.evaluations,
            confusion: known.confusion,
            // The classifier has not seen the recordings of other data.
            confounded: known
                .confounded
                .filter(|_| dataset.sha256() == config.data_sha256),
            runtimes: known.runtimes,
            verdicts,
            n_unknown: unknown.len(),
            unknown_taken_for,
            unknown_meant,
            values: config
                .classifier
                .values
                .and_then(|known| known.caution(&tested.view)),
        })
    }

    /// Evaluates sweeps of known materials by every method, and with the other runtime if one was named.
    fn known_sweeps(
        &self,
        classifier: &Classifier,
        view: &SweepView<'_>,
        mc_samples: usize,
        seed: Seed,
    ) -> Result<KnownSweeps, PipelineError> {
        let mut found = KnownSweeps::default();
        let ways = evaluate_all_ways(classifier, view, mc_samples, self.fused, seed)?;
        for (burn, mut evaluation) in ways {
            if let Some(kind) = self.runtime {
                let compared = compare_runtime(kind, classifier, view, &burn)?;
                evaluation = Evaluation::of(&compared.predictions, self.fused, seed);
                let summary = RuntimeSummary::of(kind, &compared);
                found.runtimes.insert(burn.method, summary);
            }
            if burn.method == PredictionMethod::Plain {
                found.confusion = Some(Confusion::from(&burn));
                found.confounded = ConfoundedAccuracy::of(view.dataset(), &burn);
            }
            found.evaluations.insert(burn.method, evaluation);
        }
        Ok(found)
    }
}

/// Returns the known material of the same name in another spelling, by name.
fn meant_by<'a>(
    classifier: &Classifier,
    names: impl Iterator<Item = &'a String>,
) -> BTreeMap<String, String> {
    let meant = |name: &String| {
        let mut known = classifier.config().labels.names();
        let known = known.find(|known| is_same_name(known, name))?;
        Some((name.clone(), known.to_string()))
    };
    names.filter_map(meant).collect()
}

/// Counts the most probable known materials of sweeps of unknown materials.
fn taken_for(
    classifier: &Classifier,
    unknown: &SweepView<'_>,
) -> Result<BTreeMap<String, BTreeMap<String, usize>>, PipelineError> {
    let mut found: BTreeMap<String, BTreeMap<String, usize>> = BTreeMap::new();
    let rows = classifier.log_probabilities(unknown, PredictionMethod::Plain)?;
    for (position, row) in rows.iter().enumerate() {
        let truth = unknown.dataset().labels().name(unknown.label(position));
        let label = classifier.config().labels.name(argmax(row));
        *found
            .entry(truth.into())
            .or_default()
            .entry(label.into())
            .or_default() += 1;
    }
    Ok(found)
}

impl RuntimeSummary {
    fn of(kind: RuntimeKind, compared: &RuntimeComparison) -> Self {
        let sorted = &compared.microseconds;
        // The nearest rank, so that the result is a measured value.
        let at = |share: f64| {
            let rank = (sorted.len() as f64 * share).ceil() as usize;
            sorted.get(rank.max(1) - 1).copied().unwrap_or(0.0)
        };
        Self {
            runtime: kind.name(),
            largest_difference: compared.largest_difference,
            p50_us: at(0.5),
            p99_us: at(0.99),
            max_us: at(1.0),
        }
    }
}
