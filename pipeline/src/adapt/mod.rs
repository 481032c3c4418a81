//! Adaptation of a classifier to sweeps of another skin, robot or day.
//!
//! ```text
//! unlabelled sweeps ─> scaling of taxels, running statistics (networks); scaling of features (baselines)
//! labelled sweeps   ─> output layer, with the old one as prior
//! ```
//!
//! Trained weights stay the same, except for the output layer where labels are given. An adaptation takes what the new sweeps have in common
//! for a property of the skin. So they must be of mixed materials; [`AdaptRisk`] says when they seem not to be.

mod committee;
mod head;
mod network;
mod record;
mod risk;
pub(crate) mod shift;
#[cfg(test)]
mod tests;

use tactnet_data::SweepView;
use tactnet_models::{Weights, argmax};

pub use record::{Adaptation, AdaptedSweeps};
pub use risk::{AdaptRisk, Presence};
pub use shift::Shift;

use crate::features::scaler::Scaler;
use crate::{
    Classifier, ClassifierConfig, LeftOutMember, Likeness, LikenessVerdict, ModelConfig,
    PipelineError, PredictionMethod,
};
use head::{check_head, fit_head};
use network::adapt_network;
use risk::{MIN_DIVERSITY, MIN_SWEEPS, Risks};

/// Action on risks that probably lower the accuracy.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum RiskPolicy {
    /// Refuse to adapt.
    #[default]
    Refuse,
    /// Adapt nevertheless, and list the risk as a warning.
    Accept,
}

/// Sweeps of another skin, robot or day.
#[derive(Debug, Clone, Copy)]
pub struct NewSweeps<'a> {
    /// Sweeps whose labels are ignored; `None`: the labelled ones serve for both.
    pub unlabelled: Option<&'a SweepView<'a>>,
    /// Sweeps of known materials, matched by name, to which the output layer is fitted.
    pub labelled: Option<&'a SweepView<'a>>,
}

/// Adapted classifier.
pub struct Adapted {
    /// Configuration, with the new scaling of a network.
    pub config: ClassifierConfig,
    /// Weights with new statistics, and with a new output layer if labels are given.
    pub weights: Weights,
    /// Description of sweeps like the new ones; `None` if that of the training sweeps is missing.
    pub likeness: Option<Likeness>,
    /// Numbers by which the adaptation is judged.
    pub presence: Presence,
    /// Shift of the taxels' values (networks) or of the features (baselines); of a committee, that of its first member.
    pub shift: Shift,
    /// Warnings.
    pub risks: Vec<AdaptRisk>,
    /// Members of a committee that cannot be adapted, and that the adapted committee lacks.
    pub left_out: Vec<LeftOutMember>,
}

/// Classifier with the statistics of new sweeps.
struct Statistics {
    config: ClassifierConfig,
    weights: Weights,
    shift: Shift,
    left_out: Vec<LeftOutMember>,
}

/// Minimum number of unlabelled sweeps, and minimum diversity of their materials, to which a classifier is adapted without complaint.
pub const ADAPT_MINIMUM: (usize, f64) = (MIN_SWEEPS, MIN_DIVERSITY);

/// Adapts `classifier` to new sweeps. The members of a committee adapt one by one.
///
/// - `likeness`: description of the training sweeps, if there is one; without, few materials are harder to notice
///
/// # Errors
/// No sweep; sweeps of another shape or rate; a risk that is not accepted; a model without scaling; labels of an unknown material, or for a
/// classifier that is not linear.
pub fn adapt(
    classifier: &Classifier,
    likeness: Option<&Likeness>,
    new: NewSweeps<'_>,
    policy: RiskPolicy,
) -> Result<Adapted, PipelineError> {
    let sweeps = new.unlabelled.or(new.labelled);
    let Some(sweeps) = sweeps.filter(|sweeps| !sweeps.is_empty()) else {
        return Err(PipelineError::incompatible("sweeps", "some", "none"));
    };
    classifier.config().check_view(sweeps)?;
    if let Some(labelled) = new.labelled {
        classifier.own_labels(labelled)?;
    }
    let statistics = adapted_statistics(classifier, sweeps, new.labelled.is_some())?;
    let Statistics {
        config,
        mut weights,
        shift,
        left_out,
    } = statistics;
    let device = classifier.device();
    let adapted = Classifier::new(config.clone(), &weights, &device)?;
    let presence = match (new.unlabelled, new.labelled) {
        (None, Some(labelled)) => presence_by_labels(&adapted, labelled)?,
        _ => presence_by_predictions(&adapted, likeness, sweeps)?,
    };
    let mut found = Risks::of(&presence, new.unlabelled.is_none());
    if let (Some(likeness), Some(sweeps)) = (likeness, new.unlabelled) {
        let report = likeness.assess(sweeps, classifier.config().seed);
        if let (LikenessVerdict::OtherBlock, Some(p)) = (report.verdict, report.p_other_block) {
            found.refused.push(AdaptRisk::OtherRecording { p });
        }
    }
    if policy == RiskPolicy::Refuse && !found.refused.is_empty() {
        return Err(PipelineError::AdaptRefused {
            risks: found.refused,
        });
    }
    if let Some(labelled) = new.labelled {
        fit_head(&adapted, &mut weights, labelled)?;
    }
    Ok(Adapted {
        likeness: likeness.map(|of| of.moved_to(sweeps)).transpose()?,
        config,
        weights,
        presence,
        shift,
        risks: [found.refused, found.warned].concat(),
        left_out,
    })
}

/// Returns the classifier with the statistics of `sweeps`.
///
/// - `with_labels`: true if the output layer is going to be fitted to labels
fn adapted_statistics(
    classifier: &Classifier,
    sweeps: &SweepView<'_>,
    with_labels: bool,
) -> Result<Statistics, PipelineError> {
    if let Some(committee) = classifier.committee() {
        return committee::statistics(classifier.config(), committee, sweeps, with_labels);
    }
    if with_labels {
        check_head(classifier)?;
    }
    let (config, weights, shift) = match &classifier.config().model {
        ModelConfig::Network(setup) => adapt_network(classifier, setup, sweeps)?,
        ModelConfig::Baseline(_) | ModelConfig::Committee(_) => adapt_features(classifier, sweeps)?,
    };
    Ok(Statistics {
        config,
        weights,
        shift,
        left_out: Vec::new(),
    })
}

/// Returns configuration and weights of a baseline with the scaling of `sweeps`.
fn adapt_features(
    classifier: &Classifier,
    sweeps: &SweepView<'_>,
) -> Result<(ClassifierConfig, Weights, Shift), PipelineError> {
    let scaled = classifier.baseline().and_then(|baseline| {
        let scaler = baseline.scaler.as_ref()?;
        Some((baseline, scaler.adapted(&baseline.features(sweeps))))
    });
    let Some((baseline, (scaler, shift))) = scaled else {
        return Err(PipelineError::AdaptScaling {
            model: classifier.model_name(),
        });
    };
    let mut weights = baseline.to_weights();
    Scaler::save(&scaler, &mut weights);
    Ok((classifier.config().clone(), weights, shift))
}

fn presence_by_labels(
    adapted: &Classifier,
    labelled: &SweepView<'_>,
) -> Result<Presence, PipelineError> {
    Ok(counted(adapted, &adapted.own_labels(labelled)?, None))
}

fn presence_by_predictions(
    adapted: &Classifier,
    likeness: Option<&Likeness>,
    sweeps: &SweepView<'_>,
) -> Result<Presence, PipelineError> {
    let rows = adapted.log_probabilities(sweeps, PredictionMethod::Plain)?;
    let labels: Vec<usize> = rows.iter().map(|row| argmax(row)).collect();
    let diversity = likeness.and_then(|likeness| likeness.diversity(sweeps));
    Ok(counted(adapted, &labels, diversity))
}

fn counted(adapted: &Classifier, labels: &[usize], diversity: Option<f64>) -> Presence {
    let mut counts = vec![0_usize; adapted.config().labels.len()];
    labels.iter().for_each(|label| counts[*label] += 1);
    let most = counts.iter().copied().max().unwrap_or(0);
    Presence {
        sweeps: labels.len(),
        known: counts.len(),
        materials: counts.iter().filter(|count| **count > 0).count(),
        largest_share: most as f64 / labels.len().max(1) as f64,
        diversity,
    }
}
