//! Accuracies published for TactMat.

use tactnet_data::{DataOrigin, Scheme, SplitManifest};
use tactnet_pipeline::{
    LabelOrder, ModelRecipe, NetworkRecipe, PredictionMethod, RunConfig, TrainingMethod,
};

use crate::published_confusion::TACTMAT_MATERIALS;

/// A published accuracy in percent, mean and standard deviation over 2 x 5 folds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PublishedAccuracy {
    /// Name of the classifier, or the human subjects.
    pub classifier: &'static str,
    /// Accuracy with one sweep: mean and standard deviation, in %.
    pub one_sweep: (f64, Option<f64>),
    /// Accuracy with three sweeps: mean and standard deviation, in %.
    pub three_sweeps: (f64, Option<f64>),
}

/// Table 4.2 of Bäuml's thesis (the same numbers as Tulbure & Bäuml, Humanoids 2018), and the human subjects of
/// section 4.5.2.
pub const PUBLISHED: [PublishedAccuracy; 4] = [
    PublishedAccuracy {
        classifier: "base network",
        one_sweep: (85.5, Some(1.5)),
        three_sweeps: (94.3, Some(1.5)),
    },
    PublishedAccuracy {
        classifier: "adversarial",
        one_sweep: (86.1, Some(1.1)),
        three_sweeps: (94.5, Some(1.4)),
    },
    PublishedAccuracy {
        classifier: "TactNet-II (adversarial + MC dropout)",
        one_sweep: (86.3, Some(1.2)),
        three_sweeps: (95.0, Some(0.9)),
    },
    PublishedAccuracy {
        classifier: "human, 15 subjects",
        one_sweep: (33.9, None),
        three_sweeps: (38.4, None),
    },
];

/// Returns the published row that is comparable with a run, if there is one.
///
/// Comparable runs use complete sweeps of TactMat or its twin with true labels and kept levels, random folds, and the
/// published network. They train at least as many epochs as the recipe `fast`. No accuracy was published for a base
/// network with MC dropout.
///
/// - `origin`: origin of the run's data set
/// - `way`: prediction method
pub fn published_for(
    config: &RunConfig,
    origin: DataOrigin,
    split: &SplitManifest,
    way: PredictionMethod,
) -> Option<&'static PublishedAccuracy> {
    let ModelRecipe::Network(recipe) = &config.recipe else {
        return None;
    };
    let shortest = NetworkRecipe::load("fast").ok()?.training.epochs;
    let comparable = origin.is_comparable_to_published()
        && config.classifier.labels.len() == TACTMAT_MATERIALS.len()
        && config.spec.steps.is_none()
        && config.spec.inner.is_none()
        && config.spec.label_order == LabelOrder::True
        && config.recipe.levels().is_none()
        && matches!(split.scheme, Scheme::StratifiedKFold { .. })
        && recipe.network == NetworkRecipe::load("thesis").ok()?.network
        && recipe.training.epochs >= shortest;
    comparable.then(|| row_for(recipe.training.method, way))?
}

fn row_for(method: TrainingMethod, way: PredictionMethod) -> Option<&'static PublishedAccuracy> {
    let row = match (method, way) {
        (TrainingMethod::Base, PredictionMethod::Plain) => 0,
        (TrainingMethod::Adversarial { .. }, PredictionMethod::Plain) => 1,
        (TrainingMethod::Adversarial { .. }, PredictionMethod::McDropout { .. }) => 2,
        (TrainingMethod::Base, PredictionMethod::McDropout { .. }) => return None,
    };
    Some(&PUBLISHED[row])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_thesis_recipe_is_set_beside_tactnet_ii() {
        let thesis = NetworkRecipe::load("thesis").unwrap();
        let row = row_for(thesis.training.method, thesis.prediction.method).unwrap();
        assert_eq!((row.one_sweep.0, row.three_sweeps.0), (86.3, 95.0));
        let fast = NetworkRecipe::load("fast").unwrap();
        assert_eq!(row_for(fast.training.method, fast.prediction.method), None);
    }
}
