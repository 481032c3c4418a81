//! Requirements of models: the sweeps without which a model cannot be trained.

use tactnet_data::{Dataset, SweepShape};
use tactnet_models::{InputShape, NetworkConfig};

use crate::{ModelRecipe, PipelineError};

/// Sweeps that a model needs at one sample rate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Requirements {
    /// Minimum number of steps of a sweep; `None` if the sample rate is too low for any length.
    pub steps: Option<usize>,
    /// Minimum number of training sweeps of each material.
    pub sweeps: usize,
    /// Minimum number of materials.
    pub materials: usize,
}

/// Minimum number of materials of every model: a classifier of one material is always right.
const LEAST_MATERIALS: usize = 2;
/// Longest sweep and most sweeps that the search for the smallest ones tries.
const SEARCHED: usize = 2000;

impl ModelRecipe {
    /// Returns the smallest sweeps that the model can be trained on.
    ///
    /// - `rate_hz`: sample rate
    /// - `taxels`: number of taxels
    ///
    /// ```
    /// use tactnet_pipeline::ModelRecipe;
    ///
    /// let needed = ModelRecipe::load("minirocket")?.requirements(20.0, 3);
    /// assert_eq!((needed.steps, needed.sweeps), (Some(10), 2));
    /// // Short-time spectra in bands of 20 Hz need a rate of at least 40 Hz.
    /// assert_eq!(ModelRecipe::load("knn-h")?.requirements(20.0, 3).steps, None);
    /// # Ok::<(), tactnet_pipeline::PipelineError>(())
    /// ```
    pub fn requirements(&self, rate_hz: f64, taxels: usize) -> Requirements {
        let fits = |steps: &usize| {
            let shape = SweepShape {
                steps: *steps,
                rows: 1,
                cols: taxels,
            };
            self.check_sweeps(shape, rate_hz).is_ok()
        };
        let enough = |count: &usize| self.starved(&[*count; LEAST_MATERIALS]).is_none();
        Requirements {
            steps: (1..=SEARCHED).find(fits),
            sweeps: (1..=SEARCHED).find(enough).unwrap_or(SEARCHED),
            materials: LEAST_MATERIALS,
        }
    }

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_model_states_the_sweeps_that_it_can_be_trained_on() {
        for name in ModelRecipe::built_in_names() {
            let recipe = ModelRecipe::load(name).unwrap();
            let slow = recipe.requirements(20.0, 3);
            let needs_bands = ["knn-l", "knn-h", "svm-l", "svm-h"].contains(&name);
            assert_eq!(slow.steps.is_none(), needs_bands, "{name}");
            let fast = recipe.requirements(750.0, 16);
            let least = fast.steps.unwrap();
            let shape = |steps| SweepShape {
                steps,
                rows: 4,
                cols: 4,
            };
            assert!(recipe.check_sweeps(shape(least), 750.0).is_ok(), "{name}");
            if least > 1 {
                assert!(
                    recipe.check_sweeps(shape(least - 1), 750.0).is_err(),
                    "{name}"
                );
            }
            assert!(recipe.starved(&[fast.sweeps; 3]).is_none(), "{name}");
        }
    }
}
