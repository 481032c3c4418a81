//! Training of any kind of model in memory.

use burn::tensor::Device;
use tactnet_data::{Seed, TrainSplit};
use tactnet_models::Weights;

use super::fitted::{MemberConfig, joined_weights};
use crate::{
    BatchReport, Classifier, ClassifierConfig, ModelConfig, ModelRecipe, PipelineError,
    fit_baseline, train_network,
};

/// Trained classifier with its weights.
pub struct FittedModel {
    /// Classifier.
    pub classifier: Classifier,
    /// Weights, from which [`Classifier::new`] restores it.
    pub weights: Weights,
}

/// Trains a model of any kind without writing anything; returns `None` if `go_on` stopped it.
///
/// - `go_on`: called after every batch of a network; false ends the training
///
/// # Errors
/// Settings that do not match the sweeps; too few sweeps; weights of the sweeps that a model cannot use; a loss that is not finite; a solver that
/// fails.
///
/// ```
/// use tactnet_data::twin;
/// use tactnet_data::{Fold, Scheme, Seed};
/// use tactnet_models::Compute;
/// use tactnet_pipeline::{ModelRecipe, fit_model};
///
/// let dataset = twin::small(2, 10, 100)?;
/// let fold = Fold::new(&dataset, Scheme::default(), Seed(1), 0, 0)?;
/// let recipe = ModelRecipe::parse("two", "name = \"two\"\nmembers = [\"lda\", \"means\"]")?;
/// let device = Compute::Cpu.open()?;
/// let fitted = fit_model(&recipe, &fold.train, Seed(1), &device, |_| true)?.expect("not stopped");
/// let predictions = fitted.classifier.predict(&fold.test, recipe.method())?;
/// assert_eq!(predictions.sweeps.len(), fold.test.len());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn fit_model(
    recipe: &ModelRecipe,
    train: &TrainSplit<'_>,
    seed: Seed,
    device: &Device,
    mut go_on: impl FnMut(&BatchReport) -> bool,
) -> Result<Option<FittedModel>, PipelineError> {
    recipe.refuse_weights(train)?;
    fit(recipe, train, seed, device, &mut go_on)
}

fn fit(
    recipe: &ModelRecipe,
    train: &TrainSplit<'_>,
    seed: Seed,
    device: &Device,
    go_on: &mut dyn FnMut(&BatchReport) -> bool,
) -> Result<Option<FittedModel>, PipelineError> {
    let (model, weights) = match recipe {
        ModelRecipe::Network(recipe) => {
            let trained = train_network(recipe, train, seed, device, |batch| go_on(batch))?;
            let Some(classifier) = trained else {
                return Ok(None);
            };
            let weights = classifier.network()?.weights();
            return Ok(Some(FittedModel {
                classifier,
                weights,
            }));
        }
        ModelRecipe::Baseline(recipe) => (
            ModelConfig::Baseline(recipe.clone()),
            fit_baseline(recipe, train, seed, |_| {})?.weights,
        ),
        ModelRecipe::Committee(recipe) => {
            let (mut members, mut weights) = (Vec::new(), Vec::new());
            for member in &recipe.members {
                let Some(fitted) = fit(member, train, seed, device, go_on)? else {
                    return Ok(None);
                };
                members.push(MemberConfig {
                    name: member.name().into(),
                    model: fitted.classifier.config().model.clone(),
                });
                weights.push(fitted.weights);
            }
            let names = members.iter().map(|member| member.name.as_str());
            let weights = joined_weights(names.zip(&weights));
            (ModelConfig::Committee(members), weights)
        }
    };
    let config = ClassifierConfig::new(model, train, seed);
    let classifier = Classifier::new(config, &weights, device)?;
    Ok(Some(FittedModel {
        classifier,
        weights,
    }))
}

#[cfg(test)]
mod tests {
    use tactnet_data::twin;
    use tactnet_data::{Fold, Scheme};
    use tactnet_models::Compute;

    use super::*;
    use crate::{PredictionMethod, Predictions};

    #[test]
    fn weights_that_a_member_cannot_use_are_refused_by_its_name() {
        let twin = twin::small(2, 4, 100).unwrap();
        let device = Compute::Cpu.open().unwrap();
        let fit = |text: &str| {
            let train = TrainSplit::all(&twin, Seed(1)).weighted(vec![1.0; 8]);
            let recipe = ModelRecipe::parse("own", text).unwrap();
            fit_model(&recipe, &train.unwrap(), Seed(1), &device, |_| true)
        };
        let refused = fit("name = \"own\"\nmembers = [\"lda\", \"svm-spectra\"]");
        let refused = refused.err().unwrap().to_string();
        assert!(
            refused.starts_with("model `svm-spectra` cannot use sample weights"),
            "{refused}"
        );
        assert!(fit("name = \"own\"\nmembers = [\"lda\", \"minirocket\"]").is_ok());
    }

    #[test]
    fn a_committee_averages_the_probabilities_of_its_members() {
        let twin = twin::small(3, 15, 100).unwrap();
        let fold = Fold::new(&twin, Scheme::default(), Seed(1), 0, 0).unwrap();
        let device = Compute::Cpu.open().unwrap();
        let network = "{ name = \"net\", network = { maps = [4], hidden = 8 }, \
            training = { epochs = 1, batch = 12, learning_rate = 0.01, method = { kind = \"base\" } } }";
        let members = format!("[\"lda\", {network}, \"means\"]");
        let text = format!("name = \"three\"\nmembers = {members}");
        let recipe = ModelRecipe::parse("three", &text).unwrap();
        let fitted = |recipe: &ModelRecipe| {
            fit_model(recipe, &fold.train, Seed(1), &device, |_| true)
                .unwrap()
                .unwrap()
        };
        let whole = fitted(&recipe);
        let ModelRecipe::Committee(committee) = &recipe else {
            panic!("a committee");
        };
        for method in [
            PredictionMethod::Plain,
            PredictionMethod::McDropout { mc_samples: 5 },
        ] {
            let predict = |of: &FittedModel, method| -> Predictions {
                of.classifier.predict(&fold.test, method).unwrap()
            };
            let found = predict(&whole, method);
            let of_members: Vec<Predictions> = committee
                .members
                .iter()
                .map(|member| {
                    let member = fitted(member);
                    let own = match member.classifier.has_dropout() {
                        true => method,
                        false => PredictionMethod::Plain,
                    };
                    predict(&member, own)
                })
                .collect();
            for (sweep, of) in found.sweeps.iter().enumerate() {
                for (label, log_p) in of.log_probability.iter().enumerate() {
                    let sum: f64 = of_members
                        .iter()
                        .map(|member| member.sweeps[sweep].log_probability[label].exp())
                        .sum();
                    assert!((log_p.exp() - sum / 3.0).abs() < 1e-12);
                }
            }
        }
        let config = whole.classifier.config().clone();
        let again = Classifier::new(config, &whole.weights, &device).unwrap();
        let method = PredictionMethod::Plain;
        assert_eq!(
            again.log_probabilities(&fold.test, method).unwrap(),
            whole
                .classifier
                .log_probabilities(&fold.test, method)
                .unwrap()
        );
        assert!(
            fit_model(&recipe, &fold.train, Seed(1), &device, |_| false)
                .unwrap()
                .is_none()
        );
    }
}
