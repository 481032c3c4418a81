//! Members of a stack.

use tactnet_data::{Seed, TrainSplit};
use tactnet_models::{NetStack, NetworkConfig};

use crate::{AttackedLabel, NetworkRecipe, Normalizer, TrainingMethod, TrainingSettings};

/// One of several networks that are trained at once.
#[derive(Debug, Clone)]
pub struct StackMember<'a> {
    /// Recipe; only epochs and learning rates may differ between members.
    pub recipe: &'a NetworkRecipe,
    /// Training sweeps.
    pub train: &'a TrainSplit<'a>,
    /// Normaliser of the sweeps.
    pub normalizer: &'a Normalizer,
    /// Layers of the network.
    pub config: &'a NetworkConfig,
    /// Seed of every random choice.
    pub seed: Seed,
}

impl StackMember<'_> {
    /// Returns true if the network can be trained in a stack: a convolutional network without attacks on the predicted label.
    pub fn can_be_stacked(&self) -> bool {
        let attacks_own = !matches!(
            self.recipe.training.method,
            TrainingMethod::Adversarial {
                attack: AttackedLabel::Predicted,
                ..
            }
        );
        attacks_own && !self.train.is_empty() && NetStack::shape(self.config, 1, 1).is_some()
    }

    /// Returns true if two networks can be trained in the same stack.
    pub fn fits(&self, other: &Self) -> bool {
        let settings = |member: &Self| TrainingSettings {
            epochs: 0,
            least_steps: None,
            learning_rate: 0.0,
            learning_rate_drops: Vec::new(),
            one_cycle: None,
            ..member.recipe.training.clone()
        };
        self.can_be_stacked()
            && other.can_be_stacked()
            && self.config == other.config
            && settings(self) == settings(other)
    }

    pub(super) fn batches(&self) -> usize {
        self.train.len().div_ceil(self.recipe.training.batch)
    }

    /// Returns the maximum number of sweeps in a batch.
    pub(super) fn batch(&self) -> usize {
        self.recipe.training.batch.min(self.train.len())
    }
}
