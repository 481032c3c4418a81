use super::*;

fn digits(dataset: &Dataset) -> &[u8] {
    match dataset.samples() {
        Samples::U8(digits) => digits,
        other => panic!("the twin is u8, not {}", other.element()),
    }
}

#[test]
fn smaller_twin_is_a_part_of_the_larger_one() {
    let large = TwinConfig {
        materials: 3,
        sweeps: 13,
        steps: 120,
        seed: 5,
        ..TwinConfig::default()
    };
    let small = TwinConfig {
        materials: 2,
        sweeps: 12,
        steps: 70,
        ..large.clone()
    };
    let (large, small) = (generate(&large).unwrap(), generate(&small).unwrap());
    for label in 0..2 {
        for sweep in 0..12 {
            let whole = large.sweep(label * 13 + sweep);
            assert_eq!(small.sweep(label * 12 + sweep), whole[..70 * TAXELS]);
        }
    }
}

#[test]
fn values_do_not_depend_on_the_number_of_threads() {
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| small(4, 3, 50).unwrap().sha256().to_owned())
    };
    assert_eq!(with(1), with(3));
}

/// Committed results on version 1 can be repeated.
#[test]
fn version_one_stays_as_it_is() {
    let config = TwinConfig {
        version: TwinVersion::One,
        sweeps: 2,
        steps: 300,
        seed: 5,
        ..TwinConfig::default()
    };
    assert_eq!(
        generate(&config).unwrap().sha256(),
        "f36ea0d72351d12c5c246c8ab399ee27d22c6f03f56b5e3d8e40d7192bd1ee64"
    );
}

/// Committed results on version 2 can be repeated.
#[test]
fn version_two_stays_as_it_is() {
    let config = TwinConfig {
        sweeps: 2,
        steps: 300,
        seed: 5,
        ..TwinConfig::default()
    };
    assert_eq!(
        generate(&config).unwrap().sha256(),
        "83bf05909de4ff5f96beea6171692d6907e582ac33f93c71a7ea3ae5f9e68fbc"
    );
}

/// Rows of the published confusion matrix are materials in the order of [`NAMES`].
#[test]
fn materials_that_are_confused_feel_alike() {
    let config = TwinConfig {
        sweeps: 8,
        steps: 500,
        ..TwinConfig::default()
    };
    let twin = generate(&config).unwrap();
    // Logarithm of the mean square of differences between frames at this distance, over all taxels and sweeps of a
    // material.
    let features: Vec<Vec<f64>> = (0..NAMES.len())
        .map(|label| {
            let sweeps: Vec<Vec<f32>> = (0..config.sweeps)
                .map(|sweep| twin.sweep(label * config.sweeps + sweep))
                .collect();
            let apart = |steps: usize| {
                let squares = sweeps.iter().flat_map(|sweep| {
                    let later = sweep[TAXELS * steps..].iter();
                    later.zip(sweep).map(|(a, b)| f64::from(a - b).powi(2))
                });
                squares.sum::<f64>().ln()
            };
            [1, 4, 16, 64].map(apart).to_vec()
        })
        .collect();
    let confusions = published_confusions();
    let (mut confused, mut all) = (Vec::new(), Vec::new());
    for a in 0..NAMES.len() {
        for b in 0..a {
            let both = features[a].iter().zip(&features[b]);
            let distance = both.map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
            if confusions[a][b] + confusions[b][a] > 0.05 {
                confused.push(distance);
            }
            all.push(distance);
        }
    }
    let mean = |of: &[f64]| of.iter().sum::<f64>() / of.len() as f64;
    assert!(confused.len() > 20);
    assert!(
        mean(&confused) < 0.6 * mean(&all),
        "{} {}",
        mean(&confused),
        mean(&all)
    );
}

#[test]
fn seed_decides_the_sweeps() {
    let config = TwinConfig {
        materials: 2,
        sweeps: 2,
        steps: 50,
        ..TwinConfig::default()
    };
    let other = TwinConfig {
        seed: 2,
        ..config.clone()
    };
    assert_ne!(
        digits(&generate(&config).unwrap()),
        digits(&generate(&other).unwrap())
    );
}

#[test]
fn records_say_material_sweep_and_block() {
    let twin = small(2, 11, 5).unwrap();
    assert_eq!(
        (twin.name(), twin.sample_rate_hz(), twin.len()),
        ("twin", 750.0, 22)
    );
    assert_eq!(
        twin.records()[21],
        SweepRecord {
            label: 1,
            sweep: 10,
            block: Some(1),
            test: None
        }
    );
    assert_eq!(twin.labels().name(1), "synthetic leather smooth reverse");
}

#[test]
fn impossible_configs_are_refused_by_name() {
    let good = TwinConfig {
        materials: 1,
        sweeps: 1,
        steps: 1,
        ..TwinConfig::default()
    };
    assert!(generate(&good).is_ok());
    type Change = fn(&mut TwinConfig);
    let cases: [(Change, &str); 8] = [
        (
            |config| config.materials = 37,
            "materials: expected 1 to 36, found 37",
        ),
        (|config| config.materials = 0, "materials"),
        (|config| config.sweeps = 0, "sweeps"),
        (|config| config.steps = 0, "steps"),
        (|config| config.difficulty = 0.0, "difficulty"),
        (|config| config.difficulty = f64::NAN, "difficulty"),
        (|config| config.contact_force = -1.0, "contact force"),
        (|config| config.speed = f64::INFINITY, "speed"),
    ];
    for (change, named) in cases {
        let mut config = good.clone();
        change(&mut config);
        let error = generate(&config).unwrap_err().to_string();
        assert!(error.contains(named), "{error}");
    }
}

/// Levels are proportional to the force; at twice the speed, digits correlate less with those five steps earlier.
#[test]
fn a_sweep_can_be_felt_again_harder_or_faster() {
    let usual = TwinConfig {
        materials: 6,
        sweeps: 10,
        steps: 600,
        ..TwinConfig::default()
    };
    let harder = TwinConfig {
        contact_force: 1.5,
        ..usual.clone()
    };
    let faster = TwinConfig {
        speed: 2.0,
        ..usual.clone()
    };
    let twins = [&usual, &harder, &faster].map(|config| generate(config).unwrap());
    // The strongest taxel is always above the dead zone.
    let taxel = |dataset: &Dataset, index: usize| -> Vec<f64> {
        let sweep = dataset.sweep(index);
        let after = sweep[300 * TAXELS..].chunks_exact(TAXELS);
        after.map(|frame| f64::from(frame[5])).collect()
    };
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let [levels, likeness] = [0, 1].map(|what| {
        twins.each_ref().map(|twin| {
            let of_sweep = |index: usize| {
                let values = taxel(twin, index);
                let level = mean(&values);
                if what == 0 {
                    return level;
                }
                let (mut products, mut squares) = (0.0, 0.0);
                for pair in values.windows(6) {
                    products += (pair[0] - level) * (pair[5] - level);
                    squares += (pair[0] - level).powi(2);
                }
                products / squares
            };
            mean(&(0..twin.len()).map(of_sweep).collect::<Vec<_>>())
        })
    });
    assert!((levels[1] / levels[0] - 1.5).abs() < 0.03, "{levels:?}");
    assert!((levels[2] / levels[0] - 1.0).abs() < 0.03, "{levels:?}");
    assert!((likeness[1] - likeness[0]).abs() < 0.03, "{likeness:?}");
    assert!(likeness[2] < likeness[0] - 0.03, "{likeness:?}");
}

#[test]
fn config_refuses_unknown_fields_and_fills_missing_ones() {
    let config: TwinConfig = serde_json::from_str(r#"{"sweeps": 20}"#).unwrap();
    assert_eq!(
        config,
        TwinConfig {
            sweeps: 20,
            ..TwinConfig::default()
        }
    );
    assert!(serde_json::from_str::<TwinConfig>(r#"{"rows": 5}"#).is_err());
}

/// A nearest neighbour classifier on a taxel's mean level shows that levels predict the material poorly.
#[test]
fn levels_hardly_tell_materials_apart() {
    let config = TwinConfig {
        sweeps: 20,
        steps: 400,
        ..TwinConfig::default()
    };
    let twin = generate(&config).unwrap();
    let levels: Vec<[f32; TAXELS]> = (0..twin.len())
        .map(|index| {
            let sweep = twin.sweep(index);
            std::array::from_fn(|taxel| sweep[taxel..].iter().step_by(TAXELS).sum::<f32>() / 400.0)
        })
        .collect();
    let far = |a: &[f32; TAXELS], b: &[f32; TAXELS]| {
        a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f32>()
    };
    let block = |index: usize| twin.records()[index].block;
    let right = (0..twin.len())
        .filter(|&query| {
            let nearest = (0..twin.len())
                .filter(|&other| block(other) != block(query))
                .min_by(|&a, &b| {
                    far(&levels[a], &levels[query]).total_cmp(&far(&levels[b], &levels[query]))
                });
            nearest.is_some_and(|n| twin.records()[n].label == twin.records()[query].label)
        })
        .count();
    // Chance is 0.028.
    assert!(
        (right as f64) < 0.15 * twin.len() as f64,
        "{right} of {}",
        twin.len()
    );
}
