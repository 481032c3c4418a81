//! Targets of a network that learns from a teacher (Hinton et al., 2015).

use burn::tensor::{Device, Tensor, TensorData};
use serde::{Deserialize, Serialize};
use tactnet_data::{Seed, TrainSplit};

use crate::{BatchReport, ModelRecipe, PipelineError, fit_model};

/// Share of the teacher's probabilities in the targets; the rest is 1 for the label.
const TEACHER_SHARE: f32 = 0.5;

/// Teacher's probabilities for one part of the training sweeps, `[sweeps][materials]`; it was trained on the other parts.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub(crate) struct TaughtPart(Vec<Vec<f32>>);

impl TaughtPart {
    /// Trains the teacher on all parts but one; returns `None` if `go_on` stopped it.
    ///
    /// - `part`: part of [`TrainSplit::inner`]
    /// - `go_on`: called after every batch of a network; false ends the training
    ///
    /// # Errors
    /// As [`fit_model`].
    pub fn of(
        teacher: &ModelRecipe,
        train: &TrainSplit<'_>,
        part: usize,
        seed: Seed,
        device: &Device,
        go_on: &mut dyn FnMut(&BatchReport) -> bool,
    ) -> Result<Option<Self>, PipelineError> {
        let (others, held_out) = train.inner(part)?;
        let (recipe, _) = teacher.for_sweeps(&others)?;
        let Some(fitted) = fit_model(&recipe, &others, seed, device, |batch| go_on(batch))? else {
            return Ok(None);
        };
        let method = recipe.method();
        let logarithms = fitted.classifier.log_probabilities(&held_out, method)?;
        let row = |row: Vec<f64>| row.into_iter().map(|log_p| log_p.exp() as f32).collect();
        Ok(Some(Self(logarithms.into_iter().map(row).collect())))
    }
}

/// Target probabilities of training sweeps: the mean of the label and the teacher's out-of-fold probabilities; the label of a material's only sweep.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SoftTargets {
    materials: usize,
    /// `[sweeps][materials]`
    values: Vec<f32>,
}

impl SoftTargets {
    /// Trains the teacher once for every part of the training sweeps; returns `None` if `go_on` stopped it.
    ///
    /// # Errors
    /// As [`TaughtPart::of`].
    pub fn of(
        teacher: &ModelRecipe,
        train: &TrainSplit<'_>,
        seed: Seed,
        device: &Device,
        go_on: &mut dyn FnMut(&BatchReport) -> bool,
    ) -> Result<Option<Self>, PipelineError> {
        let mut parts = Vec::new();
        for part in 0..train.inner_folds() {
            match TaughtPart::of(teacher, train, part, seed, device, go_on)? {
                Some(taught) => parts.push(taught),
                None => return Ok(None),
            }
        }
        Self::new(train, &parts).map(Some)
    }

    /// - `parts`: all parts, in order
    ///
    /// # Errors
    /// Parts of other training sweeps.
    pub fn new(train: &TrainSplit<'_>, parts: &[TaughtPart]) -> Result<Self, PipelineError> {
        let materials = train.dataset().labels().len();
        let mut values = vec![0.0; train.len() * materials];
        // The only sweep of a material is in no part.
        for (target, label) in values.chunks_exact_mut(materials).zip(train.labels()) {
            target[label] = 1.0;
        }
        let other = || {
            let found = "those of other sweeps";
            PipelineError::incompatible(
                "probabilities of the teacher",
                "one for each training sweep",
                found,
            )
        };
        for (part, taught) in parts.iter().enumerate() {
            let held_out = train.inner(part)?.1;
            if held_out.len() != taught.0.len() {
                return Err(other());
            }
            for (sweep, row) in held_out.indices().iter().zip(&taught.0) {
                let position = train.indices().iter().position(|own| own == sweep);
                let position = position
                    .filter(|_| row.len() == materials)
                    .ok_or_else(other)?;
                let target = &mut values[position * materials..][..materials];
                for (target, p) in target.iter_mut().zip(row) {
                    *target = TEACHER_SHARE * p;
                }
                target[train.label(position)] += 1.0 - TEACHER_SHARE;
            }
        }
        Ok(Self { materials, values })
    }

    /// Returns the targets of the sweeps at `positions`, `[positions, materials]`.
    pub fn batch(&self, positions: &[usize], device: &Device) -> Tensor<2> {
        let rows = positions
            .iter()
            .flat_map(|position| &self.values[position * self.materials..][..self.materials]);
        let extents = [positions.len(), self.materials];
        Tensor::from_data(TensorData::new(rows.copied().collect(), extents), device)
    }
}

#[cfg(test)]
mod tests {
    use tactnet_data::twin;
    use tactnet_data::{Fold, Scheme};
    use tactnet_models::Compute;

    use super::*;

    #[test]
    fn targets_are_half_the_label_and_half_what_a_teacher_says_that_has_not_seen_the_sweep() {
        let twin = twin::small(3, 15, 100).unwrap();
        let fold = Fold::new(&twin, Scheme::default(), Seed(1), 0, 0).unwrap();
        let (teacher, device) = (
            ModelRecipe::load("lda").unwrap(),
            Compute::Cpu.open().unwrap(),
        );
        let targets = SoftTargets::of(&teacher, &fold.train, Seed(1), &device, &mut |_| true);
        let targets = targets.unwrap().unwrap();
        let (others, held_out) = fold.train.inner(1).unwrap();
        let fitted = fit_model(&teacher, &others, Seed(1), &device, |_| true);
        let classifier = fitted.unwrap().unwrap().classifier;
        let said = classifier
            .log_probabilities(&held_out, teacher.method())
            .unwrap();
        for (sweep, said) in held_out.indices().iter().zip(said) {
            let position = fold
                .train
                .indices()
                .iter()
                .position(|own| own == sweep)
                .unwrap();
            let row = &targets.values[3 * position..][..3];
            // Sums of single-precision numbers.
            assert!((row.iter().sum::<f32>() - 1.0).abs() < 1e-5);
            for (material, (target, log_p)) in row.iter().zip(said).enumerate() {
                let is_label = fold.train.label(position) == material;
                let expected = 0.5 * log_p.exp() as f32 + if is_label { 0.5 } else { 0.0 };
                assert!((target - expected).abs() < 1e-6, "{target} {expected}");
            }
        }
        let network = ModelRecipe::parse(
            "net",
            "name = \"net\"\nnetwork = { maps = [4], hidden = 8 }\n\
             training = { epochs = 1, batch = 12, learning_rate = 0.01, method = { kind = \"base\" } }",
        );
        let stopped = SoftTargets::of(
            &network.unwrap(),
            &fold.train,
            Seed(1),
            &device,
            &mut |_| false,
        );
        assert!(stopped.unwrap().is_none());
    }
}
