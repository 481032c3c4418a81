use super::*;

#[test]
fn few_sweeps_are_trained_on_for_more_epochs() {
    let fast = NetworkRecipe::load("fast").unwrap();
    let epochs = |sweeps| fast.for_sweeps(sweeps).training.epochs;
    assert_eq!((epochs(2880), epochs(1000)), (12, 12));
    // 96 sweeps give 3 batches per epoch, 20 sweeps give one.
    assert_eq!((epochs(96), epochs(20)), (100, 300));
    assert_eq!(fast.for_sweeps(20).training.least_steps, None);
    let thesis = NetworkRecipe::load("thesis").unwrap();
    assert_eq!(thesis.for_sweeps(20), thesis);
}

#[test]
fn built_in_recipes_parse_and_carry_their_name() {
    for name in NetworkRecipe::built_in_names() {
        let recipe = NetworkRecipe::load(name).unwrap();
        assert_eq!(recipe.name, name);
        assert_eq!(
            NetworkRecipe::parse("again", &recipe.to_toml()).unwrap(),
            recipe
        );
    }
}

#[test]
fn thesis_recipe_holds_the_published_setting() {
    let recipe = NetworkRecipe::load("thesis").unwrap();
    assert_eq!(recipe.network, Architecture::default());
    assert_eq!((recipe.training.epochs, recipe.training.batch), (200, 36));
    assert_eq!(recipe.learning_rate(0, 0, 80), 1e-4);
    assert_eq!(recipe.learning_rate(169, 79, 80), 1e-4);
    assert!((recipe.learning_rate(170, 0, 80) - 1e-5).abs() < 1e-18);
    let adversarial = TrainingMethod::Adversarial {
        alpha: 0.5,
        epsilon: 0.1,
        statistics: AdversarialStatistics::Clean,
        mask: AdversarialMask::Own,
        attack: AttackedLabel::True,
    };
    assert_eq!(recipe.training.method, adversarial);
    assert_eq!(
        recipe.prediction.method,
        PredictionMethod::McDropout { mc_samples: 100 }
    );
}

#[test]
fn one_cycle_rises_and_falls() {
    let mut recipe = NetworkRecipe::load("thesis").unwrap();
    recipe.training.epochs = 2;
    recipe.training.learning_rate = 0.1;
    recipe.training.learning_rate_drops.clear();
    recipe.training.one_cycle = Some(OneCycle { warm_up: 0.25 });
    let rates: Vec<f64> = (0..9).map(|b| recipe.learning_rate(0, b, 5)).collect();
    assert!((rates[0] - 0.004).abs() < 1e-12);
    assert!(rates[2] > rates[1] && rates[3] < rates[2], "{rates:?}");
    assert!((recipe.learning_rate(1, 4, 5) - 4e-7).abs() < 1e-12);
    assert!((OneCycle { warm_up: 0.5 }.factor(0.25) - 0.52).abs() < 1e-12);
    let mut both = recipe.clone();
    both.training.learning_rate_drops = vec![LearningRateDrop {
        after_epoch: 1,
        factor: 0.1,
    }];
    let refused = NetworkRecipe::parse("r.toml", &both.to_toml()).unwrap_err();
    assert!(refused.to_string().contains("one_cycle"), "{refused}");
}

#[test]
fn mistakes_are_named_in_one_line() {
    let thesis = BUILT_IN[2].1;
    let message = |from: &str, to: &str| {
        assert!(thesis.contains(from), "{from}");
        NetworkRecipe::parse("r.toml", &thesis.replace(from, to))
            .unwrap_err()
            .to_string()
    };
    for (from, to, named) in [
        ("epochs = 200", "epochs = 0", "training.epochs"),
        ("epochs = 200", "epoch = 200", "unknown field `epoch`"),
        (
            "learning_rate = 1e-4",
            "learning_rate = -1.0",
            "training.learning_rate",
        ),
        ("alpha = 0.5", "alpha = 1.5", "alpha"),
        ("mc_samples = 100", "mc_samples = 0", "mc_samples"),
        ("\"digits\"", "\"volts\"", "volts"),
    ] {
        let message = message(from, to);
        assert!(
            message.contains(named) && message.contains("r.toml"),
            "{message}"
        );
        assert!(!message.contains('\n'), "{message}");
    }
    let unknown = NetworkRecipe::load("tesis").unwrap_err().to_string();
    assert!(
        unknown.contains("tesis") && unknown.contains("fast, spectra, thesis"),
        "{unknown}"
    );
}
