//! Training of a network in one call, without a run directory.

use burn::tensor::Device;
use tactnet_data::{Seed, TrainSplit};

use crate::network::soft_targets::SoftTargets;
use crate::{
    BatchReport, Classifier, ClassifierConfig, ModelConfig, NetworkRecipe, NetworkSetup,
    PipelineError, Training,
};

/// Trains a network in one call, for experiments that train several in one unit of work. Returns `None` if `go_on` stopped it.
///
/// - `go_on`: called after every batch; false stops the training, whose work is then lost
///
/// # Errors
/// A training set without sweeps; a setting that is out of range; a loss that is not finite.
pub fn train_network(
    recipe: &NetworkRecipe,
    train: &TrainSplit<'_>,
    seed: Seed,
    device: &Device,
    mut go_on: impl FnMut(&BatchReport) -> bool,
) -> Result<Option<Classifier>, PipelineError> {
    let Some(teacher) = &recipe.training.teacher else {
        return train_whole(recipe, train, seed, device, |training| training, go_on);
    };
    let targets = SoftTargets::of(teacher.recipe(), train, seed, device, &mut go_on)?;
    let Some(targets) = targets else {
        return Ok(None);
    };
    train_whole(
        recipe,
        train,
        seed,
        device,
        |training| training.towards(targets),
        go_on,
    )
}

/// Trains a Siamese network: sweeps of one material move close to each other in its embedding (Koch et al., 2015). Its output layer is not
/// trained. Returns `None` if `go_on` stopped it.
///
/// - `go_on`: called after every batch; false stops the training, whose work is then lost. The reported accuracy is the share of sweeps whose
///   nearest neighbour in the batch is of the same material
///
/// # Errors
/// A training set without sweeps; a setting that is out of range; a loss that is not finite.
pub fn train_siamese(
    recipe: &NetworkRecipe,
    train: &TrainSplit<'_>,
    seed: Seed,
    device: &Device,
    go_on: impl FnMut(&BatchReport) -> bool,
) -> Result<Option<Classifier>, PipelineError> {
    if train.weights().is_some() {
        return Err(PipelineError::SampleWeights {
            model: format!("{}, Siamese", recipe.name),
        });
    }
    train_whole(
        recipe,
        train,
        seed,
        device,
        |training| training.on_pairs(),
        go_on,
    )
}

fn train_whole(
    recipe: &NetworkRecipe,
    train: &TrainSplit<'_>,
    seed: Seed,
    device: &Device,
    objective: impl FnOnce(Training<'_>) -> Training<'_>,
    mut go_on: impl FnMut(&BatchReport) -> bool,
) -> Result<Option<Classifier>, PipelineError> {
    let recipe = &recipe.for_sweeps(train.len());
    let setup = NetworkSetup::fit(recipe, train);
    let model = ModelConfig::Network(setup.clone());
    let config = ClassifierConfig::new(model, train, seed);
    let network = config.network_config(&setup)?;
    let training = Training::start(recipe, train, &setup.normalizer, &network, seed, device)?;
    let mut training = objective(training);
    while let Some(batch) = training.step()? {
        if !go_on(&batch) {
            return Ok(None);
        }
    }
    let weights = training.state()?.weights;
    Classifier::new(config, &weights, device).map(Some)
}

#[cfg(test)]
mod tests {
    use rand::RngExt;
    use tactnet_data::twin;
    use tactnet_data::{Dataset, Fold, Samples, Scheme};
    use tactnet_models::{Compute, Weights};

    use super::*;
    use crate::PredictionMethod;

    fn twin() -> Dataset {
        twin::small(3, 6, 60).unwrap()
    }

    /// Returns the weights after one step over all training sweeps; `training` is TOML.
    fn after_one_step(dataset: &Dataset, keep: f64, training: &str) -> Weights {
        let text = format!(
            "name = \"small\"\nnetwork = {{ maps = [3, 4], hidden = 8, keep_probability = {keep} }}\n\
             input = {{ scaling = \"per-taxel\" }}\n\
             [training]\nepochs = 1\nbatch = 64\nlearning_rate = 0.01\n{training}\n"
        );
        let recipe = NetworkRecipe::parse("small", &text).unwrap();
        let fold = Fold::new(dataset, Scheme::default(), Seed(1), 0, 0).unwrap();
        let device = Compute::Cpu.open().unwrap();
        let fitted = train_network(&recipe, &fold.train, Seed(1), &device, |_| true);
        fitted.unwrap().unwrap().network().unwrap().weights()
    }

    /// The second material weighs a thousandth: the network learns to answer with the first or the third. Equal weights of any size are none.
    #[test]
    fn a_network_follows_the_sweeps_that_weigh_more() {
        let dataset = twin();
        let text = "name = \"small\"\nnetwork = { maps = [3, 4], hidden = 8, keep_probability = 1.0 }\n\
             [training]\nepochs = 30\nbatch = 9\nlearning_rate = 0.01\nmethod = { kind = \"base\" }\n";
        let recipe = NetworkRecipe::parse("small", text).unwrap();
        let device = Compute::Cpu.open().unwrap();
        let all = || TrainSplit::all(&dataset, Seed(1));
        let trained = |train: TrainSplit<'_>| {
            let fitted = train_network(&recipe, &train, Seed(1), &device, |_| true);
            fitted.unwrap().unwrap()
        };
        let weights: Vec<f64> = all()
            .labels()
            .map(|label| if label == 1 { 1e-3 } else { 1.0 })
            .collect();
        let answers = |network: &Classifier| {
            let rows = network
                .log_probabilities(&all(), PredictionMethod::Plain)
                .unwrap();
            let is_second = |row: &&Vec<f64>| row[1] > row[0].max(row[2]);
            rows.iter().filter(is_second).count()
        };
        let plain = trained(all());
        assert!(answers(&plain) >= 4, "{} of 6", answers(&plain));
        let weighted = trained(all().weighted(weights).unwrap());
        assert_eq!(answers(&weighted), 0);
        let equal = trained(all().weighted(vec![0.5; dataset.len()]).unwrap());
        let numbers = |network: &Classifier| network.network().unwrap().weights();
        assert_eq!(numbers(&equal), numbers(&plain));
    }

    fn adversarial(more: &str) -> String {
        format!("method = {{ kind = \"adversarial\", alpha = 0.5, epsilon = 2.0{more} }}")
    }

    type Named<'a> = Vec<(&'a String, &'a Vec<f32>)>;

    /// Splits weights into running statistics and trained parameters.
    fn split(weights: &Weights) -> (Named<'_>, Named<'_>) {
        let all = weights
            .0
            .iter()
            .map(|(name, tensor)| (name, &tensor.values));
        all.partition(|(name, _)| name.contains("running"))
    }

    /// Returns sweeps with a pitch for each material, a random phase for each sweep, and noise.
    fn tones(materials: usize, sweeps: usize, steps: usize) -> Dataset {
        let like = twin::small(materials, sweeps, steps).unwrap();
        let mut rng = Seed(1).rng("tones");
        let mut digits = Vec::new();
        for index in 0..like.len() {
            let pitch = 0.2 + 0.25 * like.records()[index].label as f32;
            let phase: f32 = rng.random_range(0.0..6.0);
            for step in 0..steps {
                for _ in 0..like.shape().taxels() {
                    let noise: f32 = rng.random_range(-3.0..3.0);
                    digits.push(100.0 + 10.0 * (pitch * step as f32 + phase).sin() + noise);
                }
            }
        }
        Dataset::new(
            "tones",
            like.sample_rate_hz(),
            like.shape(),
            like.labels().clone(),
            like.records().to_vec(),
            Samples::F32(digits),
        )
        .unwrap()
    }

    /// Returns the ratio of mean distances in the embedding: test sweeps of different materials over those of the same.
    fn apart(classifier: &Classifier, fold: &Fold<'_>) -> f64 {
        let embedding = classifier.embed(&fold.test).unwrap();
        let (hidden, labels) = (&embedding.hidden, &embedding.labels);
        let mut sums = [(0.0, 0); 2];
        for i in 0..labels.len() {
            for j in 0..i {
                let squares = hidden.row(i).iter().zip(hidden.row(j));
                let square: f32 = squares.map(|(a, b)| (a - b).powi(2)).sum();
                let (sum, count) = &mut sums[usize::from(labels[i] != labels[j])];
                *sum += f64::from(square).sqrt();
                *count += 1;
            }
        }
        let [same, different] = sums.map(|(sum, count)| sum / f64::from(count));
        different / same
    }

    #[test]
    fn a_siamese_network_brings_unseen_sweeps_of_one_material_close() {
        let tones = tones(4, 30, 100);
        let recipe = |epochs: usize| {
            let text = format!(
                "name = \"small\"\nnetwork = {{ maps = [4, 8], hidden = 16, keep_probability = 0.8 }}\n\
                 [training]\nepochs = {epochs}\nbatch = 24\nlearning_rate = 0.005\nmethod = {{ kind = \"base\" }}\n"
            );
            NetworkRecipe::parse("small", &text).unwrap()
        };
        let fold = Fold::new(&tones, Scheme::default(), Seed(1), 0, 0).unwrap();
        let device = Compute::Cpu.open().unwrap();
        let trained = |epochs: usize| {
            train_siamese(&recipe(epochs), &fold.train, Seed(1), &device, |_| true)
                .unwrap()
                .unwrap()
        };
        let (one, many) = (trained(1), trained(30));
        let [before, after] = [&one, &many].map(|classifier| apart(classifier, &fold));
        assert!(after > 1.5 * before, "{before} {after}");
        let [untouched, still] =
            [one, many].map(|classifier| classifier.network().unwrap().output_layer().weights);
        assert_eq!(untouched, still);
        assert!(
            train_siamese(&recipe(1), &fold.train, Seed(1), &device, |_| false)
                .unwrap()
                .is_none()
        );
    }

    #[test]
    fn each_adversarial_setting_changes_what_it_names_and_nothing_else() {
        let twin = twin();
        let usual = after_one_step(&twin, 0.8, &adversarial(""));
        let (running, trained) = split(&usual);
        assert!(!running.is_empty() && !trained.is_empty());

        let both = after_one_step(&twin, 0.8, &adversarial(", statistics = \"both\""));
        let (running_of_both, trained_of_both) = split(&both);
        assert_eq!(trained, trained_of_both);
        assert_ne!(running, running_of_both);

        let shared = after_one_step(&twin, 0.8, &adversarial(", mask = \"shared\""));
        assert_ne!(split(&shared).1, trained);
        let [own, shared] = ["own", "shared"]
            .map(|mask| after_one_step(&twin, 1.0, &adversarial(&format!(", mask = \"{mask}\""))));
        assert_eq!(
            own.0, shared.0,
            "where nothing is dropped, masks do not differ"
        );

        let predicted = after_one_step(&twin, 0.8, &adversarial(", attack = \"predicted\""));
        assert_ne!(split(&predicted).1, trained);
        assert_eq!(split(&predicted).0, running, "of the clean sweeps");
    }

    /// Without a perturbation the adversarial half sees clean sweeps; alpha 1 removes it.
    #[test]
    fn alpha_weighs_the_clean_loss_and_epsilon_moves_the_sweeps() {
        let twin = twin();
        let method = |alpha: f64, epsilon: f64| {
            format!("method = {{ kind = \"adversarial\", alpha = {alpha}, epsilon = {epsilon} }}")
        };
        let base = after_one_step(&twin, 0.8, "method = { kind = \"base\" }");
        assert_eq!(base.0, after_one_step(&twin, 0.8, &method(1.0, 3.0)).0);
        assert_ne!(base.0, after_one_step(&twin, 0.8, &method(0.1, 3.0)).0);
        let [weak, strong] =
            [0.0, 3.0].map(|epsilon| after_one_step(&twin, 1.0, &method(0.0, epsilon)));
        assert_eq!(
            weak.0,
            after_one_step(&twin, 1.0, "method = { kind = \"base\" }").0
        );
        assert_ne!(weak.0, strong.0);
    }

    #[test]
    fn an_l2_penalty_on_weights_alone_leaves_biases_and_normalisation() {
        let twin = twin();
        let with =
            |l2: &str| after_one_step(&twin, 1.0, &format!("{l2}method = {{ kind = \"base\" }}"));
        let (none, all) = (with(""), with("l2 = 10.0\n"));
        let weights = with("l2 = 10.0\nl2_on = \"weights\"\n");
        for (name, tensor) in &weights.0 {
            let penalized = tensor.shape.len() > 1;
            let expected = if penalized {
                &all.0[name]
            } else {
                &none.0[name]
            };
            assert_eq!(tensor, expected, "{name}");
        }
        assert_ne!(all.0, none.0);
    }

    /// Doubled digits give the same sweeps after scaling by taxel, so a perturbation of the same number of digits is half as strong.
    #[test]
    fn a_perturbation_is_in_digits_whatever_the_scaling() {
        let twin = twin();
        let times = |factor: f32| {
            // No taxel is constant, since constant taxels are not scaled.
            let digits = (0..twin.len())
                .flat_map(|index| twin.sweep(index))
                .enumerate()
                .map(|(i, digit)| factor * (digit + (i % 7) as f32));
            Dataset::new(
                "scaled",
                twin.sample_rate_hz(),
                twin.shape(),
                twin.labels().clone(),
                twin.records().to_vec(),
                Samples::F32(digits.collect()),
            )
            .unwrap()
        };
        let (once, twice) = (times(1.0), times(2.0));
        let with = |dataset: &Dataset, epsilon: f64| {
            let method =
                format!("method = {{ kind = \"adversarial\", alpha = 0.5, epsilon = {epsilon} }}");
            after_one_step(dataset, 0.8, &method).0
        };
        let expected = with(&once, 1.0);
        assert!(with(&twice, 2.0) == expected, "the same perturbation");
        assert!(with(&twice, 1.0) != expected, "half of it");
    }
}
