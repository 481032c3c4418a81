//! The rule that selects the default model.

use serde::Serialize;

use super::{ConditionScores, SetScores};
use crate::phrases::rank;

/// The rule, written before any measurement.
const RULE: &str = "The default is the model with the least mean error over the data sets that is on no set worse than the best single model by \
    more than the half-width of its 95 % interval. Held-out groups count where a set has them, random folds elsewhere.";

/// Model that the rule for the default selects.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DefaultModel {
    /// The rule.
    pub rule: &'static str,
    /// Selected model; absent if no model satisfies the rule.
    pub model: Option<String>,
    /// All models, the one with the least mean error of the headline first.
    pub candidates: Vec<Candidate>,
}

/// A model with the data sets on which it violates the rule.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Candidate {
    /// Name of the model.
    pub model: String,
    /// Mean error of the headline.
    pub mean_error: f64,
    /// Data sets on which it is left out or worse than the best single model by more than its interval.
    pub objections: Vec<Objection>,
}

/// A data set on which a model is left out or too much worse than the best single model.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Objection {
    /// Name of the data set.
    pub data: String,
    /// Description of the split.
    pub split: String,
    /// The best single model; absent if the candidate is left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub best_single: Option<String>,
    /// Lead of the best single model in accuracy; absent if the candidate is left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub behind: Option<f64>,
}

impl DefaultModel {
    /// Applies the rule to the data sets on which every model has a result or is left out.
    ///
    /// - `headline`: results on held-out groups where a set has them, else on random folds
    /// - `is_committee`: returns true for a model that is no single model
    pub(super) fn of(headline: &ConditionScores, is_committee: impl Fn(&str) -> bool) -> Self {
        let objections = |model: &str| {
            let sets = headline.sets.iter().filter(|set| set.is_complete());
            let found = sets.filter_map(|set| objection(model, set, &is_committee));
            found.collect::<Vec<_>>()
        };
        let models = headline.models.iter();
        let mut candidates: Vec<Candidate> = models
            .filter_map(|model| {
                Some(Candidate {
                    model: model.model.clone(),
                    mean_error: model.mean_error?,
                    objections: objections(&model.model),
                })
            })
            .collect();
        candidates.sort_by_key(|of| rank(of.mean_error));
        let satisfies = candidates.iter().find(|of| of.objections.is_empty());
        Self {
            rule: RULE,
            model: satisfies.map(|of| of.model.clone()),
            candidates,
        }
    }
}

/// Returns the reason why a model violates the rule on a data set; `None` if it does not.
fn objection(
    model: &str,
    set: &SetScores,
    is_committee: &impl Fn(&str) -> bool,
) -> Option<Objection> {
    let scores = || {
        let all = set.models.iter();
        all.filter_map(|of| Some((of.model.as_str(), of.score.as_ref()?)))
    };
    let objection = |best_single: Option<&str>, behind| Objection {
        data: set.data.clone(),
        split: set.split.clone(),
        best_single: best_single.map(String::from),
        behind,
    };
    let Some((_, own)) = scores().find(|(name, _)| *name == model) else {
        return Some(objection(None, None));
    };
    let single = scores().filter(|(name, _)| !is_committee(name));
    let (name, best) = single.max_by(|a, b| a.1.accuracy.total_cmp(&b.1.accuracy))?;
    // Without an interval, no lead is allowed.
    let reach = own.ci95.map_or(own.accuracy, |[_, high]| high);
    let is_worse = rank(best.accuracy) > rank(reach.max(own.accuracy));
    is_worse.then(|| objection(Some(name), Some(best.accuracy - own.accuracy)))
}
