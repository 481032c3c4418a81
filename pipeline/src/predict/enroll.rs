//! Enrolment: adds a material to a trained classifier from a few sweeps.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use tactnet_data::{LabelSet, SweepView, sha256_hex};
use tactnet_models::{LinearHead, WeightPrior, Weights, argmax, fit_new_class};

use super::judged_sweeps::JudgedSweeps;
use super::overlap::sweep_sha256;
use crate::{
    Calibration, Classifier, ClassifierConfig, Embedding, LeftOutMember, NoveltyScorer,
    PipelineError, PredictionMethod, TrainEmbeddings,
};

/// Classifier with one more material.
#[derive(Debug, Clone)]
pub struct Enrolled {
    /// Configuration with the material as last label.
    pub config: ClassifierConfig,
    /// Weights with one more row in the output layer.
    pub weights: Weights,
    /// Embeddings of the training sweeps and the new sweeps; `None` for a committee.
    pub known: Option<TrainEmbeddings>,
    /// Refitted thresholds; `None` if the classifier is not calibrated.
    pub calibration: Option<Calibration>,
    /// Loss of accuracy on the other materials; `None` without held-out sweeps of them.
    pub cost: Option<EnrolmentCost>,
    /// Prior with which the new row was fitted; `None` for a committee.
    pub prior: Option<RowPrior>,
    /// Members of a committee that cannot learn the material, and that the new committee lacks.
    pub left_out: Vec<LeftOutMember>,
}

/// Network with one more row in its output layer.
struct Extended {
    config: ClassifierConfig,
    weights: Weights,
    known: TrainEmbeddings,
    prior: RowPrior,
}

impl Extended {
    fn with(self, calibration: Option<Calibration>, cost: Option<EnrolmentCost>) -> Enrolled {
        Enrolled {
            config: self.config,
            weights: self.weights,
            known: Some(self.known),
            calibration,
            cost,
            prior: Some(self.prior),
            left_out: Vec::new(),
        }
    }
}

impl Enrolled {
    /// Measures the accuracy on held-out `sweeps` of the known materials before and after the enrolment.
    ///
    /// - `before`: classifier before the enrolment
    ///
    /// # Errors
    /// Sweeps of another shape, or of materials that the classifier does not know.
    pub fn cost_on(
        &self,
        before: &Classifier,
        sweeps: &SweepView<'_>,
    ) -> Result<EnrolmentCost, PipelineError> {
        let after = Classifier::new(self.config.clone(), &self.weights, &before.device())?;
        let rows = |of: &Classifier| of.log_probabilities(sweeps, PredictionMethod::Plain);
        let labels = before.own_labels(sweeps)?;
        Ok(EnrolmentCost::of(&rows(before)?, &rows(&after)?, &labels))
    }
}

/// Accuracy on held-out sweeps of the known materials before and after an enrolment.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct EnrolmentCost {
    /// Number of held-out sweeps.
    pub held_out: usize,
    /// Number of correct predictions before.
    pub right_before: usize,
    /// Number of correct predictions after.
    pub right_after: usize,
    /// Number of sweeps now predicted as the new material.
    pub claimed: usize,
}

impl EnrolmentCost {
    /// Counts predictions before and after the enrolment, `[sweeps][materials]`; the new material is the last one after it.
    pub(crate) fn of(before: &[Vec<f64>], after: &[Vec<f64>], labels: &[usize]) -> Self {
        let right = |rows: &[Vec<f64>]| {
            let pairs = rows.iter().zip(labels);
            pairs.filter(|(row, label)| argmax(row) == **label).count()
        };
        let is_new = |row: &&Vec<f64>| argmax(row) + 1 == row.len();
        Self {
            held_out: labels.len(),
            right_before: right(before),
            right_after: right(after),
            claimed: after.iter().filter(is_new).count(),
        }
    }

    /// Returns true if more than one in twenty of the held-out sweeps are lost, and at least two.
    fn is_high(&self) -> bool {
        let lost = self.right_before.saturating_sub(self.right_after);
        lost >= 2 && lost * 20 > self.held_out
    }

    /// Returns a warning if more than one in twenty of the held-out sweeps are lost, and at least two.
    pub fn caution(&self) -> Option<String> {
        self.is_high().then(|| {
            let remedy = if self.right_after * 2 < self.right_before {
                "the network has most likely memorised its few training sweeps, so that all others look new to it: train it on more sweeps \
                 of each material, or on all materials with the new one among them"
            } else {
                "more sweeps of it, or a training anew with all materials, avoids that"
            };
            format!("the new material costs the others; {remedy}")
        })
    }
}

/// Thresholds of a calibrated classifier, with the data to refit them.
#[derive(Debug, Clone)]
pub struct Thresholds {
    /// The thresholds.
    pub calibration: Calibration,
    /// Embeddings of the sweeps that they were fitted to; runs of earlier versions do not keep them.
    pub held_out: Option<Embedding>,
}

/// `enrolled.json`: origin of a material that was added to a trained classifier.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EnrolledMaterial {
    /// Name of the material.
    pub material: String,
    /// Name of the data set of its sweeps.
    pub data: String,
    /// SHA-256 of that data set.
    pub data_sha256: String,
    /// Indices of the sweeps in the data set.
    pub sweeps: Vec<usize>,
    /// SHA-256 of each sweep's values, which identifies it in other files; absent in files of earlier versions.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sweeps_sha256: Vec<String>,
    /// SHA-256 of the weights before the enrolment.
    pub weights_sha256: String,
    /// Commit of the program.
    pub git: String,
}

impl EnrolledMaterial {
    /// Returns the record of a material enrolled from `sweeps`.
    ///
    /// - `weights`: weights of the classifier before
    /// - `git`: commit of the program
    ///
    /// # Errors
    /// Weights that cannot be serialised; a network's always can.
    pub fn new(
        material: &str,
        sweeps: &SweepView<'_>,
        weights: &Weights,
        git: &str,
    ) -> Result<Self, PipelineError> {
        Ok(Self {
            material: material.into(),
            data: sweeps.dataset().name().into(),
            data_sha256: sweeps.dataset().sha256().into(),
            sweeps: sweeps.indices().to_vec(),
            sweeps_sha256: (0..sweeps.len())
                .map(|position| sweep_sha256(sweeps, position))
                .collect(),
            weights_sha256: weights_sha256(weights)?,
            git: git.into(),
        })
    }
}

/// Returns the SHA-256 of weights as a safetensors file without metadata, in hexadecimal digits. It identifies the classifier in exported files.
///
/// # Errors
/// Weights that cannot be serialised; those of networks and baselines always can.
pub fn weights_sha256(weights: &Weights) -> Result<String, PipelineError> {
    Ok(sha256_hex(weights.to_safetensors(BTreeMap::new())?))
}

/// Prior of the new material's row in the output layer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum RowPrior {
    /// A tenth of the prior strength of the known materials' rows, with a practically free bias.
    ///
    /// A single row is known less firmly than the distribution of many. The enrolment experiment (few-sweeps.md) supports the choice: full
    /// strength lowers the accuracy of the known materials, and of the new one from ten sweeps on. A penalised bias lowers the accuracy of the
    /// new material.
    Tenth,
    /// A hundredth of the prior strength, with a bias penalised like the weights.
    HundredthWithBias,
    /// A thousandth of the prior strength, with a bias penalised like the weights.
    ///
    /// An overfitted network responds less strongly to sweeps outside its training set. A free bias then absorbs that weak response, and the new
    /// material claims sweeps of the known ones.
    ThousandthWithBias,
}

/// Mean number of training sweeps per known material below which a network counts as overfitted.
const MANY_SWEEPS: usize = 50;

impl RowPrior {
    /// Returns the prior for a network without held-out sweeps that could measure the cost of a new material.
    ///
    /// Measured on networks with 12, 24, 40 and 80 training sweeps per material (few-sweeps.md). Up to 40, a hundredth with a penalised bias is 0
    /// to 26 points more accurate over all materials than a tenth, whose new material claims sweeps of the others. With 80, a tenth is better.
    fn without_held_out(known: &TrainEmbeddings) -> Self {
        let mut materials = known.labels.clone();
        materials.sort_unstable();
        materials.dedup();
        if known.labels.len() < MANY_SWEEPS * materials.len() {
            Self::HundredthWithBias
        } else {
            Self::Tenth
        }
    }

    /// Returns a note on a prior other than the default; `None` for the default.
    pub fn note(self) -> Option<&'static str> {
        match self {
            Self::Tenth => None,
            Self::HundredthWithBias | Self::ThousandthWithBias => Some(
                "the network has few training sweeps or has memorised them, so the new material is held back: that spares the known ones, and it \
                 is itself recognised less often; more sweeps of it, or a training anew with all materials, helps",
            ),
        }
    }

    fn of(self, head: &LinearHead) -> WeightPrior {
        let knowledge = WeightPrior::of_knowledge(head);
        match self {
            Self::Tenth => knowledge.weaker(10.0),
            Self::HundredthWithBias => knowledge.with_penalised_bias().weaker(100.0),
            Self::ThousandthWithBias => knowledge.with_penalised_bias().weaker(1000.0),
        }
    }
}

/// Number of parts of the cross-validation over the new sweeps.
const PARTS: usize = 5;

/// Adds `material` to `classifier`.
///
/// All layers stay the same. The output layer gets one more row, fitted to the new sweeps and the known ones with equal weight for each material
/// (after OL-mean; Bauer et al., 2017). The prior of the row is a tenth of that of the known rows.
///
/// If the known materials lose more than one in twenty held-out sweeps, the two other priors of [`RowPrior`] are tried. The one with the best
/// accuracy over all materials is kept, measured on the held-out sweeps and on the cross-validated new ones. Without held-out sweeps, and with
/// fewer than 50 training sweeps per known material, the prior is a hundredth with a penalised bias.
///
/// Thresholds are fitted again, since the new row changes the scores of all sweeps. They are fitted to the held-out sweeps and to the new ones,
/// each scored by one of five classifiers that were fitted without it.
///
/// - `thresholds`: thresholds of `classifier`, if it is calibrated; unchanged if their held-out sweeps were not kept
/// - `sweeps`: sweeps of the new material only, with any label in their data set
///
/// # Errors
/// A name that is already known; sweeps of another shape or rate; a model that is not a network; a fit that does not converge.
pub fn enroll(
    classifier: &Classifier,
    known: &TrainEmbeddings,
    thresholds: Option<&Thresholds>,
    sweeps: &SweepView<'_>,
    material: &str,
) -> Result<Enrolled, PipelineError> {
    refuse_impossible(classifier, sweeps, material)?;
    let new = classifier.embed(sweeps)?;
    let fitted = |prior| with_row(classifier, known, &new, material, prior);
    let Some((calibration, held_out)) = thresholds
        .and_then(|thresholds| Some((&thresholds.calibration, thresholds.held_out.as_ref()?)))
    else {
        let calibration = thresholds.map(|thresholds| thresholds.calibration.clone());
        let extended = fitted(RowPrior::without_held_out(known))?;
        return Ok(extended.with(calibration, None));
    };
    let mut extended = fitted(RowPrior::Tenth)?;
    let mut lost = cost(classifier, &extended, held_out)?;
    let mut in_turns = judge_in_turns(classifier, known, &new, &extended, calibration)?;
    if lost.is_high() {
        let known_materials = classifier.config().labels.len() as f64;
        // Every material has the same weight.
        let balanced = |cost: &EnrolmentCost, new: &JudgedSweeps| {
            let known = cost.right_after as f64 / cost.held_out.max(1) as f64;
            known_materials * known + new.accuracy()
        };
        let mut best = balanced(&lost, &in_turns);
        for prior in [RowPrior::HundredthWithBias, RowPrior::ThousandthWithBias] {
            let other = fitted(prior)?;
            let cost = cost(classifier, &other, held_out)?;
            let turns = judge_in_turns(classifier, known, &new, &other, calibration)?;
            let score = balanced(&cost, &turns);
            if score > best {
                (best, extended, lost, in_turns) = (score, other, cost, turns);
            }
        }
    }
    let mut judged = judge(classifier, &extended, calibration, held_out.clone())?;
    judged.append(in_turns);
    let calibration = Calibration::fit(calibration.target, calibration.score, &judged)?;
    Ok(extended.with(Some(calibration), Some(lost)))
}

/// Checks the name of a new material, and that there are sweeps of it.
///
/// # Errors
/// A name that is already known; no sweep.
pub(crate) fn refuse_known(
    classifier: &Classifier,
    sweeps: &SweepView<'_>,
    material: &str,
) -> Result<(), PipelineError> {
    let mut names = classifier.config().labels.names();
    if names.any(|name| name == material) {
        let reason = "the classifier knows a material of this name";
        return Err(PipelineError::enroll(material, reason));
    }
    match sweeps.is_empty() {
        true => Err(PipelineError::enroll(material, "no sweep to learn from")),
        false => Ok(()),
    }
}

/// Checks that the network can learn the material from these sweeps.
///
/// # Errors
/// A name that is already known; no sweep; damaged weights; a model that is not a network.
fn refuse_impossible(
    classifier: &Classifier,
    sweeps: &SweepView<'_>,
    material: &str,
) -> Result<(), PipelineError> {
    refuse_known(classifier, sweeps, material)?;
    let rows = classifier.network()?.output_layer().weights;
    if rows.windows(2).all(|pair| pair[0] == pair[1]) {
        let reason =
            "the classifier's output layer is the same for every material; its weights are damaged";
        return Err(PipelineError::enroll(material, reason));
    }
    Ok(())
}

/// Scores each fifth of the new sweeps by a classifier fitted to the other four; returns nothing for a single sweep.
fn judge_in_turns(
    classifier: &Classifier,
    known: &TrainEmbeddings,
    new: &Embedding,
    extended: &Extended,
    calibration: &Calibration,
) -> Result<JudgedSweeps, PipelineError> {
    let label = extended.config.labels.len() - 1;
    let material = extended.config.labels.name(label);
    let mut judged = JudgedSweeps::default();
    for part in 0..new.len().min(PARTS) {
        let (own, others): (Vec<usize>, Vec<usize>) =
            (0..new.len()).partition(|position| position % PARTS == part);
        if others.is_empty() {
            break;
        }
        let others = new.select(&others);
        let without = with_row(classifier, known, &others, material, extended.prior)?;
        let mut own = new.select(&own);
        own.labels.fill(label);
        judged.append(judge(classifier, &without, calibration, own)?);
    }
    Ok(judged)
}

/// Measures the accuracy on the held-out sweeps before and after the enrolment.
fn cost(
    before: &Classifier,
    extended: &Extended,
    held_out: &Embedding,
) -> Result<EnrolmentCost, PipelineError> {
    let device = before.scorer()?.device();
    let after = Classifier::new(extended.config.clone(), &extended.weights, device)?;
    let rows = |classifier: &Classifier| -> Result<Vec<Vec<f64>>, PipelineError> {
        let head = classifier.network()?.output_layer();
        Ok(held_out.clone().scored_by(&head).log_probabilities())
    };
    let (before, after) = (rows(before)?, rows(&after)?);
    Ok(EnrolmentCost::of(&before, &after, &held_out.labels))
}

/// Scores sweeps that `before` has embedded by the classifier with the new material.
fn judge(
    before: &Classifier,
    extended: &Extended,
    calibration: &Calibration,
    sweeps: Embedding,
) -> Result<JudgedSweeps, PipelineError> {
    let device = before.scorer()?.device();
    let after = Classifier::new(extended.config.clone(), &extended.weights, device)?;
    let sweeps = sweeps.scored_by(&after.network()?.output_layer());
    let strangeness = NoveltyScorer::fit(&after, &extended.known)?;
    JudgedSweeps::of_embedding(calibration.score, &strangeness, &sweeps)
}

/// Returns the classifier with one more row, fitted to embedded sweeps.
fn with_row(
    classifier: &Classifier,
    known: &TrainEmbeddings,
    embedding: &Embedding,
    material: &str,
    prior: RowPrior,
) -> Result<Extended, PipelineError> {
    let mut config = classifier.config().clone();
    config.labels = LabelSet::new(config.labels.names().chain([material]))?;
    let net = classifier.network()?;
    let head = net.output_layer();
    let new = fit_new_class(
        &head,
        &known.hidden,
        &known.labels,
        &embedding.hidden,
        &prior.of(&head),
    )?;
    let mut weights = net.weights();
    for (name, row) in [
        ("output.weight", new.weights.as_slice()),
        ("output.bias", &[new.bias]),
    ] {
        let tensor = weights
            .0
            .get_mut(name)
            .unwrap_or_else(|| panic!("a network has `{name}`"));
        tensor.shape[0] += 1;
        tensor.values.extend(row.iter().map(|v| *v as f32));
    }
    let mut known = known.clone();
    let label = config.labels.len() - 1;
    known.labels.extend(embedding.labels.iter().map(|_| label));
    let values = [known.hidden.values(), embedding.hidden.values()].concat();
    known.hidden = tactnet_models::Features::new(known.hidden.width(), values);
    Ok(Extended {
        config,
        weights,
        known,
        prior,
    })
}
