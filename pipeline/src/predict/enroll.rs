//! A material more, from a few sweeps, for a classifier that stays as it is otherwise.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use tactnet_data::{LabelSet, SweepView, sha256_hex};
use tactnet_models::{LinearHead, WeightPrior, Weights, argmax, fit_new_class};

use super::calibration::Judged;
use super::overlap::sweep_sha256;
use crate::{
    Calibration, Classifier, ClassifierConfig, Embedding, NoveltyScorer, PipelineError,
    TrainEmbeddings,
};

/// A classifier with one more material.
#[derive(Debug, Clone)]
pub struct Enrolled {
    /// With the material as its last label.
    pub config: ClassifierConfig,
    /// With a row more in the output layer.
    pub weights: Weights,
    /// With the new sweeps.
    pub known: TrainEmbeddings,
    /// What tells unknown materials now; absent where nothing did.
    pub calibration: Option<Calibration>,
    /// What the others lose by it; absent where no sweeps of them were held out.
    pub cost: Option<EnrolmentCost>,
    /// How the new row was fitted.
    pub prior: RowPrior,
}

impl Enrolled {
    /// Returns what the new material costs the known ones on `sweeps`, to which nothing was fitted.
    ///
    /// - `before`: the classifier that the material was added to
    ///
    /// # Errors
    /// Sweeps of another shape or of materials that it does not know.
    pub fn cost_on(
        &self,
        before: &Classifier,
        sweeps: &SweepView<'_>,
    ) -> Result<EnrolmentCost, PipelineError> {
        cost(before, self, &before.embed(sweeps)?)
    }
}

/// Accuracy on sweeps of the known materials that nothing was fitted to, before and after a material was added.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct EnrolmentCost {
    /// Number of these sweeps.
    pub held_out: usize,
    /// Recognised before.
    pub right_before: usize,
    /// Recognised after.
    pub right_after: usize,
    /// Taken for the new material now.
    pub claimed: usize,
}

impl EnrolmentCost {
    /// Returns true if more than one in twenty of the known materials' sweeps are lost, and at least two.
    fn is_high(&self) -> bool {
        let lost = self.right_before.saturating_sub(self.right_after);
        lost >= 2 && lost * 20 > self.held_out
    }

    /// Returns a warning if more than one in twenty of the known materials' sweeps are lost, and at least two.
    pub fn caution(&self) -> Option<String> {
        self.is_high().then(|| {
            let remedy = if self.right_after * 2 < self.right_before {
                "the network most likely knows its few training sweeps by heart, so that all others look new to it: train it on more sweeps \
                 of each material, or on all materials with the new one among them"
            } else {
                "more sweeps of it, or a training anew with all materials, avoids that"
            };
            format!("the new material costs the others; {remedy}")
        })
    }
}

/// Thresholds of a calibrated classifier.
#[derive(Debug, Clone)]
pub struct Thresholds {
    /// The thresholds.
    pub calibration: Calibration,
    /// The sweeps that they were fitted to; runs of former versions did not keep them.
    pub held_out: Option<Embedding>,
}

/// `enrolled.json`: where the materials come from that were added to a trained classifier.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EnrolledMaterial {
    /// The material.
    pub material: String,
    /// Name of the data set that its sweeps are from.
    pub data: String,
    /// SHA-256 of that data set.
    pub data_sha256: String,
    /// The sweeps, as indices into it.
    pub sweeps: Vec<usize>,
    /// SHA-256 of each sweep's values, by which it is recognised in another file; absent in files of former versions.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sweeps_sha256: Vec<String>,
    /// SHA-256 of the weights before.
    pub weights_sha256: String,
    /// Commit of the program.
    pub git: String,
}

impl EnrolledMaterial {
    /// Describes a material that was learnt from `sweeps`.
    ///
    /// - `weights`: of the classifier before
    /// - `git`: commit of the program
    ///
    /// # Errors
    /// None with weights of a network.
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

/// SHA-256 of weights as a safetensors file without metadata, in hexadecimal digits: names a classifier in files made from it.
///
/// # Errors
/// None with weights of a network or of a baseline.
pub fn weights_sha256(weights: &Weights) -> Result<String, PipelineError> {
    Ok(sha256_hex(weights.to_safetensors(BTreeMap::new())?))
}

/// What the new material's row is drawn towards, and how firmly.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum RowPrior {
    /// A tenth of the prior of the known materials' rows, with a bias that is as good as free: one material is not drawn as firmly as a draw of
    /// many is. Chosen by `tactnet experiment run enrolment` (few-sweeps.md): at full strength the known materials lose more and the new one is
    /// recognised less from ten sweeps on; with a penalised bias it is recognised less.
    Tenth,
    /// A hundredth, with a bias that is penalised as the weights are.
    HundredthWithBias,
    /// A thousandth, likewise. A network that knows its training sweeps by heart feels others less strongly, and a free bias comes to stand for
    /// "not strongly felt": the new material then takes sweeps of the known ones.
    ThousandthWithBias,
}

/// Training sweeps of a known material, on average, below which a network is taken to know them by heart.
const MANY_SWEEPS: usize = 50;

impl RowPrior {
    /// Returns the prior for a network of which no held-out sweeps say what a new material costs.
    ///
    /// Measured on networks of 12, 24, 40 and 80 training sweeps a material (few-sweeps.md): up to 40 a hundredth with a penalised bias is 0 to 26
    /// points more accurate over all materials than a tenth, whose new material takes sweeps of the others; with 80 a tenth is better.
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

    /// Returns what to know of the choice, in one line; `None` of the usual one.
    pub fn note(self) -> Option<&'static str> {
        match self {
            Self::Tenth => None,
            Self::HundredthWithBias | Self::ThousandthWithBias => Some(
                "the network has few training sweeps or knows them by heart, so the new material is held back: that spares the known ones, and it \
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

/// Parts in which the new sweeps are judged by classifiers that learnt the material from the others.
const PARTS: usize = 5;

/// Adds `material` to `classifier`: all layers stay, the output layer gets one more row, which is fitted to the new sweeps and those
/// known so far, every material with the same weight, with a tenth of the prior of the known materials' rows (after OL-mean; Bauer et al., 2017).
/// If that costs the known materials more than one in twenty of the sweeps that were held out, the two other priors of [`RowPrior`] are tried,
/// and the one with the best accuracy over all materials is kept: of the held-out sweeps, and of the new ones as below. Where none were held
/// out and the known materials have fewer than 50 training sweeps each, the prior is a hundredth and penalises the bias.
///
/// Thresholds are fitted again, since one more row changes what all sweeps score: to the sweeps that were held out before, and to the
/// new ones as five classifiers judge them that learnt the material from the other four fifths.
///
/// - `thresholds`: of `classifier`, if it is calibrated; they stay as they are where their sweeps were not kept
/// - `sweeps`: of the new material alone, whatever their label in their data set
///
/// # Errors
/// A name that is known already; sweeps of another shape or rate; a model that is no network; a fit that does not end.
pub fn enroll(
    classifier: &Classifier,
    known: &TrainEmbeddings,
    thresholds: Option<&Thresholds>,
    sweeps: &SweepView<'_>,
    material: &str,
) -> Result<Enrolled, PipelineError> {
    let refused = |reason: &str| PipelineError::Enroll {
        material: material.into(),
        reason: reason.into(),
    };
    let mut names = classifier.config().labels.names();
    if names.any(|name| name == material) {
        return Err(refused("the classifier knows a material of this name"));
    }
    if sweeps.is_empty() {
        return Err(refused("no sweep to learn from"));
    }
    let rows = classifier.network()?.output_layer().weights;
    if rows.windows(2).all(|pair| pair[0] == pair[1]) {
        return Err(refused(
            "the classifier's output layer is the same for every material; its weights are damaged",
        ));
    }
    let new = classifier.embed(sweeps)?;
    let fitted = |prior| with_row(classifier, known, &new, material, prior);
    let Some((calibration, held_out)) = thresholds
        .and_then(|thresholds| Some((&thresholds.calibration, thresholds.held_out.as_ref()?)))
    else {
        let mut enrolled = fitted(RowPrior::without_held_out(known))?;
        enrolled.calibration = thresholds.map(|thresholds| thresholds.calibration.clone());
        return Ok(enrolled);
    };
    let mut enrolled = fitted(RowPrior::Tenth)?;
    let first = cost(classifier, &enrolled, held_out)?;
    enrolled.cost = Some(first);
    let mut in_turns = judge_in_turns(classifier, known, &new, &enrolled, calibration)?;
    if first.is_high() {
        let known_materials = classifier.config().labels.len() as f64;
        // Every material weighs the same.
        let balanced = |cost: &EnrolmentCost, new: &Judged| {
            let known = cost.right_after as f64 / cost.held_out.max(1) as f64;
            known_materials * known + new.accuracy()
        };
        let mut best = balanced(&first, &in_turns);
        for prior in [RowPrior::HundredthWithBias, RowPrior::ThousandthWithBias] {
            let mut other = fitted(prior)?;
            let cost = cost(classifier, &other, held_out)?;
            let turns = judge_in_turns(classifier, known, &new, &other, calibration)?;
            let score = balanced(&cost, &turns);
            if score > best {
                other.cost = Some(cost);
                (best, enrolled, in_turns) = (score, other, turns);
            }
        }
    }
    let mut judged = judge(classifier, &enrolled, calibration, held_out.clone())?;
    judged.append(in_turns);
    enrolled.calibration = Some(Calibration::of(
        calibration.target,
        calibration.score,
        &judged,
    )?);
    Ok(enrolled)
}

/// What classifiers say of each fifth of the new sweeps that learnt the material from the other four; nothing of a single sweep.
fn judge_in_turns(
    classifier: &Classifier,
    known: &TrainEmbeddings,
    new: &Embedding,
    enrolled: &Enrolled,
    calibration: &Calibration,
) -> Result<Judged, PipelineError> {
    let label = enrolled.config.labels.len() - 1;
    let material = enrolled.config.labels.name(label);
    let mut judged = Judged::default();
    for part in 0..new.len().min(PARTS) {
        let (own, others): (Vec<usize>, Vec<usize>) =
            (0..new.len()).partition(|position| position % PARTS == part);
        if others.is_empty() {
            break;
        }
        let others = new.select(&others);
        let without = with_row(classifier, known, &others, material, enrolled.prior)?;
        let mut own = new.select(&own);
        own.labels.fill(label);
        judged.append(judge(classifier, &without, calibration, own)?);
    }
    Ok(judged)
}

/// What the known materials lose.
fn cost(
    before: &Classifier,
    enrolled: &Enrolled,
    held_out: &Embedding,
) -> Result<EnrolmentCost, PipelineError> {
    let device = before.scorer()?.device();
    let after = Classifier::new(enrolled.config.clone(), &enrolled.weights, device)?;
    let predicted = |classifier: &Classifier| -> Result<Vec<usize>, PipelineError> {
        let scored = held_out
            .clone()
            .scored_by(&classifier.network()?.output_layer());
        let rows = scored.log_probabilities();
        Ok(rows.iter().map(|row| argmax(row)).collect())
    };
    let right = |predicted: &[usize]| {
        let pairs = predicted.iter().zip(&held_out.labels);
        pairs.filter(|(found, label)| found == label).count()
    };
    let (before, after) = (predicted(before)?, predicted(&after)?);
    let new = enrolled.config.labels.len() - 1;
    Ok(EnrolmentCost {
        held_out: held_out.len(),
        right_before: right(&before),
        right_after: right(&after),
        claimed: after.iter().filter(|label| **label == new).count(),
    })
}

/// What the classifier with the new material says of sweeps that the one before has embedded.
fn judge(
    before: &Classifier,
    enrolled: &Enrolled,
    calibration: &Calibration,
    sweeps: Embedding,
) -> Result<Judged, PipelineError> {
    let device = before.scorer()?.device();
    let after = Classifier::new(enrolled.config.clone(), &enrolled.weights, device)?;
    let sweeps = sweeps.scored_by(&after.network()?.output_layer());
    let strangeness = NoveltyScorer::fit(&after, &enrolled.known)?;
    Judged::of(calibration.score, &strangeness, &sweeps)
}

/// The classifier with a row more, fitted to embedded sweeps.
fn with_row(
    classifier: &Classifier,
    known: &TrainEmbeddings,
    embedding: &Embedding,
    material: &str,
    prior: RowPrior,
) -> Result<Enrolled, PipelineError> {
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
    Ok(Enrolled {
        config,
        weights,
        known,
        calibration: None,
        cost: None,
        prior,
    })
}
