//! Golden tests of features and ridge classifier against aeon, scikit-learn, numpy and scipy (`tests/golden/features_with_aeon.py`).

use tactnet_data::SweepShape;
use tactnet_models::{Features, Gram, NamedTensor, Ridge, RidgeTargets, Weights};

use crate::MeanRemoval;
use crate::features::arrays::get;
use crate::features::extractor::{load_kernels, load_lists};
use crate::features::hydra::Hydra;
use crate::features::quant::Quant;
use crate::features::rocket::{Kernels, Order, Pooling, WAYS, Workspace};
use crate::features::scaler::Scaler;
use crate::features::series::Series;
use crate::features::spectrum::{HighFeatures, LowFeatures};

fn golden() -> Weights {
    read("features.safetensors")
}

/// Reads a file of golden values.
fn read(name: &str) -> Weights {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/golden/");
    Weights::from_safetensors(&std::fs::read(format!("{folder}{name}")).unwrap()).unwrap()
}

fn tensor<'a>(golden: &'a Weights, name: &str) -> &'a NamedTensor {
    get(golden, name).unwrap()
}

/// Compares with a tolerance relative to the larger of the expected value and `floor`.
fn assert_close(name: &str, found: &[f32], expected: &[f32], tolerance: f32, floor: f32) {
    assert_eq!(found.len(), expected.len(), "{name}");
    for (index, (f, e)) in found.iter().zip(expected).enumerate() {
        let error = (f - e).abs() / e.abs().max(floor);
        assert!(error <= tolerance, "{name}[{index}]: {f} instead of {e}");
    }
}

fn each_series(golden: &Weights, case: &str, visit: impl Fn(usize, &Series)) {
    let sweeps = tensor(golden, &format!("{case}.sweeps"));
    let [_, steps, taxels] = sweeps.shape[..] else {
        panic!("sweeps have three axes")
    };
    for (index, sweep) in sweeps.values.chunks_exact(steps * taxels).enumerate() {
        visit(index, &Series::from_frames(sweep, taxels));
    }
}

const CASES: [&str; 3] = ["digits", "noise", "one_taxel"];

#[test]
fn minirocket_features_are_aeons() {
    let golden = golden();
    for case in CASES {
        let kernels = load_kernels(&golden, &format!("{case}.minirocket"), usize::MAX).unwrap();
        let expected = tensor(&golden, &format!("{case}.minirocket.features"));
        each_series(&golden, case, |index, series| {
            let mut found = vec![0.0; kernels.len()];
            kernels.transform(
                series,
                Order::Base,
                Pooling::Share,
                &mut Workspace::default(),
                &mut found,
            );
            let expected = &expected.values[index * found.len()..][..found.len()];
            // Shares are counts over steps; 1e-5 detects a single step.
            assert_close(case, &found, expected, 1e-5, 1.0);
        });
    }
}

#[test]
fn multirocket_features_are_aeons() {
    let golden = golden();
    for case in CASES {
        let load =
            |name: &str| load_kernels(&golden, &format!("{case}.{name}"), usize::MAX).unwrap();
        let (base, difference): (Kernels, Kernels) =
            (load("multirocket"), load("multirocket_difference"));
        let expected = tensor(&golden, &format!("{case}.multirocket.features"));
        each_series(&golden, case, |index, series| {
            let mut found = vec![0.0; WAYS * (base.len() + difference.len())];
            let (first, second) = found.split_at_mut(WAYS * base.len());
            base.transform(
                series,
                Order::Base,
                Pooling::FourWays,
                &mut Workspace::default(),
                first,
            );
            let change = series.difference();
            difference.transform(
                &change,
                Order::Difference,
                Pooling::FourWays,
                &mut Workspace::default(),
                second,
            );
            let expected = &expected.values[index * found.len()..][..found.len()];
            // Means of values above a bias are sums that may cancel, so the tolerance is relative to 1.
            assert_close(case, &found, expected, 1e-5, 1.0);
        });
    }
}

#[test]
fn hydra_features_are_aeons() {
    let golden = golden();
    for case in CASES {
        let hydra = Hydra {
            weights: tensor(&golden, &format!("{case}.hydra.weights"))
                .values
                .clone(),
            taxels: load_lists(&golden, &format!("{case}.hydra"), usize::MAX).unwrap(),
        };
        let expected = tensor(&golden, &format!("{case}.hydra.features"));
        each_series(&golden, case, |index, series| {
            let mut found = vec![0.0; hydra.width()];
            hydra.transform(series, &series.difference(), &mut found);
            let expected = &expected.values[index * found.len()..][..found.len()];
            // Sums of up to 150 results, in another order than torch's.
            assert_close(case, &found, expected, 1e-5, 1.0);
        });
    }
}

/// Golden values from `tests/golden/quant_with_aeon.py`.
#[test]
fn quantiles_over_intervals_are_aeons() {
    let (golden, of_quant) = (golden(), read("quant.safetensors"));
    for case in CASES {
        let sweeps = tensor(&golden, &format!("{case}.sweeps"));
        let [_, steps, cols] = sweeps.shape[..] else {
            panic!("sweeps have three axes")
        };
        for steps_kept in [3, 4, 17, steps] {
            let expected = tensor(&of_quant, &format!("{case}.{steps_kept}"));
            let shape = SweepShape {
                steps: steps_kept,
                rows: 1,
                cols,
            };
            let quant = Quant::new(shape).unwrap();
            let mut found = vec![0.0; expected.values.len()];
            let sweeps = sweeps.values.chunks_exact(steps * cols);
            for (sweep, out) in sweeps.zip(found.chunks_exact_mut(quant.width())) {
                quant.write(&sweep[..shape.values()], out);
            }
            let taxel = quant.width_of_taxel();
            let pairs = found.chunks_exact(taxel).zip(expected.values.chunks(taxel));
            for (found, expected) in pairs {
                // aeon adds up to 150 values in single precision; their sum, a magnitude of the spectrum, is about the largest feature.
                let largest = expected.iter().fold(1.0_f32, |most, v| most.max(v.abs()));
                assert_close(case, found, expected, 1e-6, largest);
            }
        }
    }
}

#[test]
fn sparse_scaling_is_aeons() {
    let golden = golden();
    let train = tensor(&golden, "sparse.train");
    let mut features = Features::new(40, train.values.clone());
    Scaler::fit(&features, 40).apply(&mut features);
    let expected = &tensor(&golden, "sparse.scaled").values;
    assert_close("sparse", features.values(), expected, 1e-5, 1.0);
}

#[test]
fn ridge_classifier_is_scikit_learns() {
    let golden = golden();
    let features = Features::new(90, tensor(&golden, "ridge.train").values.clone());
    let labels = crate::features::arrays::get_indices(&golden, "ridge.labels").unwrap();
    let penalties: Vec<f64> = (0..10)
        .map(|i| 10.0_f64.powf(-3.0 + f64::from(i) * 6.0 / 9.0))
        .collect();
    let targets = RidgeTargets {
        labels: &labels,
        materials: 4,
        weights: None,
        penalties: &penalties,
    };
    let ridge = Ridge::fit(&features, Gram::of(&features), targets).unwrap();
    let penalty = tensor(&golden, "ridge.penalty").values[0];
    assert!(
        (ridge.penalty as f32 / penalty - 1.0).abs() < 1e-6,
        "{}",
        ridge.penalty
    );
    let queries = Features::new(90, tensor(&golden, "ridge.queries").values.clone());
    let found: Vec<f32> = ridge
        .scores(&queries)
        .concat()
        .iter()
        .map(|s| *s as f32)
        .collect();
    // Coefficients are stored in single precision.
    assert_close(
        "scores",
        &found,
        &tensor(&golden, "ridge.scores").values,
        1e-5,
        1.0,
    );

    // Held-out scores equal those of a classifier fitted without the held-out sweeps.
    let (train, held): (Vec<usize>, Vec<usize>) = (0..40).partition(|i| i % 5 != 0);
    let held_scores = Gram::of(&features)
        .held_out_scores(&train, &held, targets)
        .unwrap();
    let part = features.select(&train);
    let of_part: Vec<usize> = train.iter().map(|&i| labels[i]).collect();
    let of_part = RidgeTargets {
        labels: &of_part,
        ..targets
    };
    let alone = Ridge::fit(&part, Gram::of(&part), of_part).unwrap();
    let expected = alone.scores(&features.select(&held));
    for (found, expected) in held_scores.concat().iter().zip(expected.concat()) {
        assert!((found - expected).abs() < 1e-5, "{found} {expected}");
    }
}

#[test]
fn spectral_features_are_numpys() {
    let golden = golden();
    for case in ["thesis", "tactmat", "biotac", "odd"] {
        let of = |part: &str| tensor(&golden, &format!("spectrum.{case}.{part}"));
        let sweeps = of("sweeps");
        let [_, steps, taxels] = sweeps.shape[..] else {
            panic!("sweeps have three axes")
        };
        let shape = SweepShape {
            steps,
            rows: 1,
            cols: taxels,
        };
        let rate = f64::from(of("rate").values[0]);
        let low = LowFeatures::new(shape, rate, MeanRemoval::None).unwrap();
        let high = HighFeatures::new(shape, rate, MeanRemoval::None).unwrap();
        let (mut found_low, mut found_high) = (Vec::new(), Vec::new());
        for sweep in sweeps.values.chunks_exact(shape.values()) {
            found_low.extend(low.of(sweep));
            let mut out = vec![0.0; high.width()];
            high.write(sweep, &mut out);
            found_high.extend(out);
        }
        assert_close(case, &found_low, &of("l").values, 1e-5, 1e-3);
        assert_close(case, &found_high, &of("h").values, 1e-5, 1e-3);
    }
    let widths = |steps: usize, rate: f64| {
        let shape = SweepShape {
            steps,
            rows: 4,
            cols: 4,
        };
        HighFeatures::new(shape, rate, MeanRemoval::None)
            .unwrap()
            .width()
    };
    assert_eq!(widths(1500, 750.0), 760);
    assert_eq!(widths(1000, 750.0), 26 * 19);
}

#[test]
fn a_sweep_without_room_for_a_window_is_refused() {
    let shape = SweepShape {
        steps: 60,
        rows: 4,
        cols: 4,
    };
    let refused = HighFeatures::new(shape, 750.0, MeanRemoval::None)
        .err()
        .unwrap()
        .to_string();
    assert!(
        refused.contains("0.1 s") && refused.contains("60 steps at 750 Hz"),
        "{refused}"
    );
    let refused = LowFeatures::new(shape, 30.0, MeanRemoval::None)
        .err()
        .unwrap()
        .to_string();
    assert!(
        refused.contains("at least 40 Hz for L-features"),
        "{refused}"
    );
    // At 38 Hz all of the power lies in the first band, so that the H-features would be the same for every sweep.
    let refused = HighFeatures::new(shape, 38.0, MeanRemoval::None)
        .err()
        .unwrap()
        .to_string();
    assert!(
        refused.contains("at least 40 Hz for H-features"),
        "{refused}"
    );
    assert!(HighFeatures::new(shape, 40.0, MeanRemoval::None).is_ok());
}
