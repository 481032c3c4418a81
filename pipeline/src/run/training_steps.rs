//! Number of steps of a network's training, and advice if they are few.

use serde::{Deserialize, Serialize};

use crate::TrainingSettings;

/// Number of steps below which a network rarely reaches the accuracy that its data allows.
const FEW: usize = 300;
/// Number of steps of the default recipe on TactMat: 12 epochs of 80 batches.
const OF_TACTMAT: usize = 960;

/// Number of training steps, by epochs and batches.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct TrainingSteps {
    /// Passes over the training sweeps.
    pub epochs: usize,
    /// Batches of an epoch.
    pub batches: usize,
}

impl TrainingSteps {
    /// Returns the steps of a recipe on `sweeps` training sweeps.
    pub fn of(settings: &TrainingSettings, sweeps: usize) -> Self {
        Self {
            epochs: settings.epochs,
            batches: sweeps.div_ceil(settings.batch.max(1)),
        }
    }

    /// Returns the number of steps.
    pub fn count(self) -> usize {
        self.epochs * self.batches
    }

    /// Returns true if there are fewer than 300 steps.
    pub fn are_few(self) -> bool {
        self.count() < FEW
    }

    /// Returns the number of epochs that gives at least 300 steps.
    pub fn epochs_for_enough(self) -> usize {
        FEW.div_ceil(self.batches.max(1))
    }

    /// Returns the reason why a training takes more epochs than its recipe names, in one line; `None` if it does not.
    pub fn why_more_epochs(self, recipe: &TrainingSettings) -> Option<String> {
        let least = recipe.least_steps?;
        let (epochs, batches) = (self.epochs, self.batches);
        (epochs > recipe.epochs).then(|| {
            format!(
                "{epochs} epochs instead of {}, since these few sweeps give {batches} batch{} per epoch and the recipe trains on at least {least} \
                 batches",
                recipe.epochs,
                if batches == 1 { "" } else { "es" },
            )
        })
    }

    /// Returns advice to train for more epochs, in one line; `None` if the steps are not few.
    ///
    /// - `setting`: notation of the front end for setting the epochs, without the number
    pub fn hint(self, setting: &str) -> Option<String> {
        let epochs = self.epochs_for_enough();
        self.are_few().then(|| {
            format!(
                "{} training step{} few; `{setting}{epochs}` trains for {} (TactMat: {OF_TACTMAT})",
                self.count(),
                if self.count() == 1 { " is" } else { "s are" },
                epochs * self.batches
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use crate::NetworkRecipe;

    use super::*;

    #[test]
    fn more_epochs_than_the_recipe_has_are_explained_by_its_least_steps() {
        let fast = NetworkRecipe::parse(
            "fast",
            "name = \"fast\"\nnetwork = { maps = [3, 4], hidden = 8, keep_probability = 0.8 }\n[training]\nepochs = 12\nleast_steps = 300\nbatch = 35\n\
             learning_rate = 0.005\nmethod = { kind = \"base\" }",
        )
        .unwrap();
        let why = |recipe: &NetworkRecipe, sweeps| {
            let taken = recipe.for_sweeps(sweeps).training;
            TrainingSteps::of(&taken, sweeps).why_more_epochs(&recipe.training)
        };
        assert_eq!(
            why(&fast, 90).unwrap(),
            "100 epochs instead of 12, since these few sweeps give 3 batches per epoch and the recipe trains on at least 300 batches"
        );
        assert_eq!(why(&fast, 2800), None);
        let mut free = fast.clone();
        free.training.least_steps = None;
        assert_eq!(why(&free, 90), None);
    }

    #[test]
    fn few_steps_come_with_the_epochs_that_make_them_enough() {
        let steps = |epochs, batches| TrainingSteps { epochs, batches };
        assert_eq!(
            steps(12, 3).hint("epochs ").unwrap(),
            "36 training steps are few; `epochs 100` trains for 300 (TactMat: 960)"
        );
        assert_eq!(
            steps(12, 7).hint("epochs=").unwrap(),
            "84 training steps are few; `epochs=43` trains for 301 (TactMat: 960)"
        );
        assert!(
            steps(1, 1)
                .hint("epochs ")
                .unwrap()
                .starts_with("1 training step is few")
        );
        for enough in [steps(100, 3), steps(12, 80), steps(300, 1)] {
            assert_eq!(enough.hint("epochs "), None);
        }
    }
}
