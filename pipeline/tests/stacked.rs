//! Networks trained at once on a GPU, compared with each of them trained alone.
#![cfg(feature = "vulkan")]
#![allow(clippy::unwrap_used)]

use tactnet_data::twin;
use tactnet_data::{Dataset, Fold, Scheme, Seed};
use tactnet_models::{Compute, NetworkConfig, Weights};

use tactnet_pipeline::{
    BatchReport, ClassifierConfig, Device, ModelConfig, NetworkRecipe, NetworkSetup, StackMember,
    StackedTraining, Training, TrainingState,
};

const PLAIN: &str = "{ kind = \"base\" }";
const ATTACKED: &str = "{ kind = \"adversarial\", alpha = 0.5, epsilon = 4.0 }";
const BOTH: &str = "{ kind = \"adversarial\", alpha = 0.3, epsilon = 2.0, statistics = \"both\", mask = \"shared\" }";

fn recipe(method: &str) -> NetworkRecipe {
    let text = format!(
        "name = \"small\"\nnetwork = {{ maps = [4, 6], hidden = 8 }}\ninput = {{ scaling = \"per-taxel\" }}\n\
         [training]\nepochs = 5\nbatch = 8\nlearning_rate = 0.01\nl2 = 0.001\nl2_on = \"weights\"\nmethod = {method}\n"
    );
    NetworkRecipe::parse("small", &text).unwrap()
}

/// Seven sweeps of each of three materials: folds have 16 or 17 training sweeps, so two batches of 8 or three of 5 and 6.
fn twin() -> Dataset {
    twin::small(3, 7, 60).unwrap()
}

/// Three folds of one data set, each with a different seed.
struct Folds<'a> {
    recipe: NetworkRecipe,
    folds: Vec<Fold<'a>>,
    fitted: Vec<(NetworkSetup, NetworkConfig)>,
}

impl<'a> Folds<'a> {
    fn of(twin: &'a Dataset, method: &str) -> Self {
        let recipe = recipe(method);
        let folds: Vec<Fold<'a>> = [0, 2, 4]
            .map(|fold| Fold::new(twin, Scheme::default(), Seed(1), 0, fold).unwrap())
            .into();
        let fitted = folds.iter().map(|fold| {
            let setup = NetworkSetup::fit(&recipe, &fold.train);
            let model = ModelConfig::Network(setup.clone());
            let config = ClassifierConfig::new(model, &fold.train, Seed(1));
            let network = config.network_config(&setup).unwrap();
            (setup, network)
        });
        Self {
            fitted: fitted.collect(),
            recipe,
            folds,
        }
    }

    fn members(&self) -> Vec<StackMember<'_>> {
        let folds = self.folds.iter().zip(&self.fitted).enumerate();
        let members = folds.map(|(index, (fold, (setup, config)))| StackMember {
            recipe: &self.recipe,
            train: &fold.train,
            normalizer: &setup.normalizer,
            config,
            seed: Seed(index as u64 + 1),
        });
        members.collect()
    }
}

fn device() -> Device {
    Compute::Vulkan.open().unwrap()
}

fn begun<'a>(members: &[StackMember<'a>]) -> StackedTraining<'a> {
    let states = members.iter().map(|_| None).collect();
    StackedTraining::start(members.to_vec(), states, &device()).unwrap()
}

/// Takes `steps` steps and returns the reports at the ends of epochs, for each network.
fn advance(training: &mut StackedTraining<'_>, steps: usize) -> Vec<Vec<BatchReport>> {
    let mut reports: Vec<Vec<BatchReport>> = vec![Vec::new(); training.len()];
    for _ in 0..steps {
        for (of, report) in reports.iter_mut().zip(training.step()) {
            of.extend(report.map(Result::unwrap).filter(BatchReport::ends_epoch));
        }
    }
    reports
}

fn states(training: &mut StackedTraining<'_>) -> Vec<TrainingState> {
    let states = training.states().into_iter();
    states.map(Result::unwrap).collect()
}

/// Returns the largest relative distance of a tensor from the expected one, in the 2-norm.
fn apart(found: &Weights, expected: &Weights) -> f64 {
    assert_eq!(found.0.len(), expected.0.len());
    let tensors = found.0.iter().map(|(name, tensor)| {
        let expected = &expected.0[name];
        assert_eq!(tensor.shape, expected.shape, "{name}");
        let pairs = tensor.values.iter().zip(&expected.values);
        let off: f64 = pairs.map(|(a, b)| f64::from(a - b).powi(2)).sum();
        let all: f64 = expected.values.iter().map(|v| f64::from(*v).powi(2)).sum();
        (off / all.max(1e-12)).sqrt()
    });
    tensors.fold(0.0, f64::max)
}

/// Trains a network alone for ten steps.
fn alone(member: &StackMember<'_>) -> (Vec<BatchReport>, TrainingState) {
    let mut training = Training::start(
        member.recipe,
        member.train,
        member.normalizer,
        member.config,
        member.seed,
        &device(),
    )
    .unwrap();
    let mut reports = Vec::new();
    for _ in 0..10 {
        if let Some(report) = training.step().unwrap()
            && report.ends_epoch()
        {
            reports.push(report);
        }
    }
    (reports, training.state().unwrap())
}

/// Runs all checks in one process, so that the driver compiles the kernels once.
#[test]
fn networks_train_together_as_each_does_alone() {
    for (method, tolerance) in [(PLAIN, 2e-3), (ATTACKED, 2e-2), (BOTH, 2e-2)] {
        trains_as_alone(method, tolerance);
    }
    a_network_does_not_depend_on_those_beside_it();
    an_interrupted_stack_goes_on_as_if_nothing_had_happened_and_alone_too();
    networks_end_with_their_own_last_epoch();
}

/// - `tolerance`: tolerance of weights after ten steps. Rounding changes the signs of gradients near zero, and Adam's first steps are as large for
///   small gradients as for large ones
fn trains_as_alone(method: &str, tolerance: f64) {
    let twin = twin();
    let folds = Folds::of(&twin, method);
    let members = folds.members();
    let sizes: Vec<usize> = members.iter().map(|member| member.train.len()).collect();
    assert!(sizes.contains(&16) && sizes.contains(&17), "{sizes:?}");
    let mut together = begun(&members);
    let reports = advance(&mut together, 10);
    let found = states(&mut together);
    for ((member, reports), state) in members.iter().zip(reports).zip(found) {
        let (expected_reports, expected) = alone(member);
        assert_eq!(reports.len(), expected_reports.len());
        for (report, expected) in reports.iter().zip(&expected_reports) {
            let (loss, of) = (report.mean_loss.unwrap(), expected.mean_loss.unwrap());
            assert!((loss - of).abs() < tolerance * of, "{loss} instead of {of}");
            assert_eq!(
                report.adversarial_accuracy.is_some(),
                expected.adversarial_accuracy.is_some()
            );
            assert_eq!(report.learning_rate, expected.learning_rate);
        }
        assert_eq!(state.position.epoch, expected.position.epoch);
        assert_eq!(state.position.batch, expected.position.batch);
        let apart = apart(&state.weights, &expected.weights);
        println!("{method}: {apart:e}");
        assert!(apart < tolerance, "{method}: {apart:e}");
    }
}

fn a_network_does_not_depend_on_those_beside_it() {
    let twin = twin();
    for method in [PLAIN, ATTACKED] {
        let folds = Folds::of(&twin, method);
        let members = folds.members();
        let mut together = begun(&members);
        let reports = advance(&mut together, 10);
        let all = states(&mut together);
        assert_ne!(all[0].weights, all[1].weights);
        for (index, member) in members.iter().enumerate() {
            let mut one = begun(std::slice::from_ref(member));
            assert_eq!(advance(&mut one, 10)[0], reports[index]);
            let one = states(&mut one).remove(0);
            assert_eq!(one.weights, all[index].weights);
            assert_eq!(one.position, all[index].position);
        }
    }
}

fn an_interrupted_stack_goes_on_as_if_nothing_had_happened_and_alone_too() {
    let twin = twin();
    let folds = Folds::of(&twin, PLAIN);
    let members = folds.members();
    let mut whole = begun(&members);
    advance(&mut whole, 7);
    let expected = states(&mut whole);

    let mut first = begun(&members);
    advance(&mut first, 4);
    let halfway = states(&mut first);
    let from: Vec<Option<TrainingState>> = halfway.iter().cloned().map(Some).collect();
    let mut second = StackedTraining::start(members.clone(), from, &device()).unwrap();
    advance(&mut second, 3);
    for (found, expected) in states(&mut second).iter().zip(&expected) {
        assert_eq!(found.weights, expected.weights);
        assert_eq!(found.position, expected.position);
    }

    for ((member, state), expected) in members.iter().zip(halfway).zip(&expected) {
        let training = Training::start(
            member.recipe,
            member.train,
            member.normalizer,
            member.config,
            member.seed,
            &device(),
        );
        let mut training = training.unwrap().resume(state).unwrap();
        for _ in 0..3 {
            training.step().unwrap();
        }
        let found = training.state().unwrap();
        assert_eq!(found.position.batch, expected.position.batch);
        assert!(apart(&found.weights, &expected.weights) < 2e-3);
    }
}

fn networks_end_with_their_own_last_epoch() {
    let twin = twin();
    let folds = Folds::of(&twin, PLAIN);
    let mut training = begun(&folds.members());
    let mut steps = [0; 3];
    while !training.has_ended() {
        for (steps, report) in steps.iter_mut().zip(training.step()) {
            *steps += usize::from(report.is_some());
        }
    }
    let expected: Vec<usize> = folds
        .members()
        .iter()
        .map(|member| 5 * member.train.len().div_ceil(8))
        .collect();
    assert_eq!(steps.to_vec(), expected);
    assert!(training.step().iter().all(Option::is_none));
}

#[test]
fn networks_of_one_kind_fit_each_other() {
    let twin = twin();
    let (folds, others) = (Folds::of(&twin, PLAIN), Folds::of(&twin, ATTACKED));
    let (members, attacked) = (folds.members(), others.members());
    assert!(members[0].fits(&members[1]));
    assert!(!members[0].fits(&attacked[1]));
    let mut longer = folds.recipe.clone();
    longer.training.epochs = 50;
    longer.training.learning_rate = 0.1;
    let longer = StackMember {
        recipe: &longer,
        ..members[1].clone()
    };
    assert!(members[0].fits(&longer));
    let predicted =
        "{ kind = \"adversarial\", alpha = 0.5, epsilon = 4.0, attack = \"predicted\" }";
    let predicted = Folds::of(&twin, predicted);
    assert!(!predicted.members()[0].can_be_stacked());
}
