//! Adaptation of a committee, member by member.

use tactnet_data::SweepView;
use tactnet_models::Weights;

use super::head::fit_head;
use super::{Statistics, adapted_statistics};
use crate::committee::fitted::{Committee, joined_weights, weights_of};
use crate::{ClassifierConfig, LeftOutMember, MemberConfig, ModelConfig, PipelineError};

/// Returns the committee of those members that can be adapted, with the statistics of `sweeps`.
///
/// # Errors
/// The error of the first member if no member can be adapted.
pub(super) fn statistics(
    config: &ClassifierConfig,
    committee: &Committee,
    sweeps: &SweepView<'_>,
    with_labels: bool,
) -> Result<Statistics, PipelineError> {
    let (mut members, mut weights, mut left_out) = (Vec::new(), Vec::new(), Vec::new());
    let (mut first, mut refused) = (None, None);
    for (name, member) in committee.named_members() {
        match adapted_statistics(member, sweeps, with_labels) {
            Ok(adapted) => {
                first.get_or_insert(adapted.shift);
                weights.push(adapted.weights);
                members.push(MemberConfig {
                    name: name.into(),
                    model: adapted.config.model,
                });
            }
            Err(error @ (PipelineError::AdaptScaling { .. } | PipelineError::AdaptHead { .. })) => {
                left_out.push(LeftOutMember {
                    name: name.into(),
                    reason: error.to_string(),
                });
                refused.get_or_insert(error);
            }
            Err(error) => return Err(error),
        }
    }
    match (first, refused) {
        (Some(shift), _) => Ok(Statistics {
            weights: joined(&members, &weights),
            config: ClassifierConfig {
                model: ModelConfig::Committee(members),
                ..config.clone()
            },
            shift,
            left_out,
        }),
        (None, Some(error)) => Err(error),
        (None, None) => Err(PipelineError::incompatible("members", "some", "none")),
    }
}

/// Fits the output layers of all members to labelled sweeps, each with its old layer as mean of the prior.
pub(super) fn fit_heads(
    committee: &Committee,
    weights: &mut Weights,
    sweeps: &SweepView<'_>,
) -> Result<(), PipelineError> {
    let fitted = committee.named_members().map(|(name, member)| {
        let mut own = weights_of(weights, name);
        fit_head(member, &mut own, sweeps)?;
        Ok((name, own))
    });
    let fitted = fitted.collect::<Result<Vec<(&str, Weights)>, PipelineError>>()?;
    *weights = joined_weights(fitted.iter().map(|(name, own)| (*name, own)));
    Ok(())
}

fn joined(members: &[MemberConfig], weights: &[Weights]) -> Weights {
    let names = members.iter().map(|member| member.name.as_str());
    joined_weights(names.zip(weights))
}
