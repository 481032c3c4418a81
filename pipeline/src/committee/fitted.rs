//! Trained committee.

use std::collections::BTreeMap;

use burn::tensor::Device;
use serde::{Deserialize, Serialize};
use tactnet_data::SweepView;
use tactnet_models::{Weights, log_mean_exp_into};

use crate::{Classifier, ClassifierConfig, ModelConfig, PipelineError, PredictionMethod};

/// Member of a committee.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MemberConfig {
    /// Name of the member's recipe, the prefix of its weights.
    pub name: String,
    /// Model that scores sweeps.
    pub model: ModelConfig,
}

/// Trained members, whose probabilities are averaged.
pub(crate) struct Committee {
    names: Vec<String>,
    members: Vec<Classifier>,
}

impl Committee {
    /// - `config`: configuration of the committee
    /// - `weights`: result of [`joined_weights`]
    ///
    /// # Errors
    /// Weights of another model.
    pub fn new(
        config: &ClassifierConfig,
        members: &[MemberConfig],
        weights: &Weights,
        device: &Device,
    ) -> Result<Self, PipelineError> {
        let names = members.iter().map(|member| member.name.clone()).collect();
        let members = members.iter().map(|member| {
            let config = ClassifierConfig {
                model: member.model.clone(),
                ..config.clone()
            };
            Classifier::new(config, &weights_of(weights, &member.name), device)
        });
        Ok(Self {
            names,
            members: members.collect::<Result<_, _>>()?,
        })
    }

    /// Returns the members, in the order of the recipe.
    pub fn members(&self) -> &[Classifier] {
        &self.members
    }

    /// Returns the members with their names, in the order of the recipe.
    pub fn named_members(&self) -> impl Iterator<Item = (&str, &Classifier)> {
        self.names.iter().map(String::as_str).zip(&self.members)
    }

    /// Returns the weights of all members, see [`joined_weights`].
    pub fn weights(&self) -> Weights {
        let weights: Vec<Weights> = self.members.iter().map(Classifier::weights).collect();
        joined_weights(self.names.iter().map(String::as_str).zip(&weights))
    }

    /// Masks dead taxels in all members.
    pub fn mask(&mut self, dead: &[usize]) -> Result<(), PipelineError> {
        self.members
            .iter_mut()
            .try_for_each(|member| member.mask(dead))
    }

    /// Returns the natural logarithms of the mean probabilities, `[sweeps][materials]`.
    pub fn log_probabilities(
        &self,
        view: &SweepView<'_>,
        method: PredictionMethod,
    ) -> Result<Vec<Vec<f64>>, PipelineError> {
        let of_members = self.member_log_probabilities(view, method)?;
        Ok(by_sweep(&of_members, |_, mean| mean))
    }

    /// Returns the log-probabilities of every member, `[members][sweeps][materials]`. Members without dropout predict without it.
    pub fn member_log_probabilities(
        &self,
        view: &SweepView<'_>,
        method: PredictionMethod,
    ) -> Result<Vec<Vec<Vec<f64>>>, PipelineError> {
        let of_members = self.members.iter().map(|member| {
            let own = match member.has_dropout() {
                true => method,
                false => PredictionMethod::Plain,
            };
            member.log_probabilities(view, own)
        });
        of_members.collect()
    }
}

/// Returns the result of `of` for every sweep, from the log-probabilities of all members, `[members][materials]`, and those of their mean.
pub(crate) fn by_sweep<T>(
    of_members: &[Vec<Vec<f64>>],
    of: impl Fn(&[f64], Vec<f64>) -> T,
) -> Vec<T> {
    let sweeps = of_members.first().map_or(0, Vec::len);
    let result = (0..sweeps).map(|sweep| {
        let rows = of_members.iter().map(|member| member[sweep].as_slice());
        let rows: Vec<f64> = rows.collect::<Vec<_>>().concat();
        let mut mean = vec![0.0; of_members[0][sweep].len()];
        log_mean_exp_into(&rows, &mut mean);
        of(&rows, mean)
    });
    result.collect()
}

/// Returns the weights of all members, with the names of the members as prefixes.
pub(crate) fn joined_weights<'a>(
    members: impl IntoIterator<Item = (&'a str, &'a Weights)>,
) -> Weights {
    let named = members.into_iter().flat_map(|(member, weights)| {
        let tensors = weights.0.iter();
        tensors.map(move |(name, tensor)| (format!("{member}/{name}"), tensor.clone()))
    });
    Weights(named.collect::<BTreeMap<_, _>>())
}

/// Returns the weights of a member.
pub(crate) fn weights_of(weights: &Weights, member: &str) -> Weights {
    let own = weights.0.iter().filter_map(|(name, tensor)| {
        let name = name.strip_prefix(member)?.strip_prefix('/')?;
        Some((name.to_string(), tensor.clone()))
    });
    Weights(own.collect())
}
