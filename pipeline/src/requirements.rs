//! Requirements of models: the sweeps without which a model cannot be trained.

use tactnet_data::{Dataset, SweepShape};
use tactnet_models::{InputShape, NetworkConfig};

use crate::{ModelRecipe, PipelineError};

/// Minimum number of materials of every model: a classifier of one material is always right.
const LEAST_MATERIALS: usize = 2;

impl ModelRecipe {
    /// Succeeds if the model exists for sweeps of this shape and rate.
    ///
    /// # Errors
    /// Sweeps that are too short for the model; a sample rate that is too low.
    pub fn check_sweeps(&self, shape: SweepShape, rate_hz: f64) -> Result<(), PipelineError> {
        match self {
            Self::Network(recipe) => {
                let input = InputShape {
                    steps: shape.steps,
                    taxels: shape.taxels(),
                };
                NetworkConfig::new(recipe.network.clone(), input, LEAST_MATERIALS)?;
                Ok(())
            }
            Self::Baseline(recipe) => recipe.features.check(shape, rate_hz),
            // Members that do not exist for these sweeps are left out.
            Self::Committee(recipe) => {
                let mut checks = recipe
                    .members
                    .iter()
                    .map(|member| member.check_sweeps(shape, rate_hz));
                let first = checks.next().unwrap_or(Ok(()));
                match first.is_ok() || checks.any(|check| check.is_ok()) {
                    true => Ok(()),
                    false => first,
                }
            }
        }
    }

    /// Succeeds if the model exists for all sweeps of a data set.
    ///
    /// # Errors
    /// As [`ModelRecipe::check_sweeps`].
    pub(crate) fn check_data(&self, dataset: &Dataset) -> Result<(), PipelineError> {
        let shortest = SweepShape {
            steps: dataset.shortest(),
            ..dataset.shape()
        };
        self.check_sweeps(shortest, dataset.sample_rate_hz())
    }

    /// Succeeds if there are enough materials to tell apart.
    ///
    /// # Errors
    /// A single material.
    pub(crate) fn check_materials(
        &self,
        names: &tactnet_data::LabelSet,
    ) -> Result<(), PipelineError> {
        if names.len() >= LEAST_MATERIALS {
            return Ok(());
        }
        let found = format!("only `{}`", names.name(0));
        Err(PipelineError::incompatible(
            "materials",
            "at least two",
            found,
        ))
    }
}
