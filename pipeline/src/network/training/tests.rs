use tactnet_data::twin;
use tactnet_data::{Fold, Scheme};
use tactnet_models::{Compute, values};

use super::*;
use crate::{ClassifierConfig, ModelConfig, NetworkSetup};

#[test]
fn watched_batches_have_sweeps_of_all_materials_and_every_sweep_once() {
    // Three materials with twelve sweeps each, in order.
    let batches: Vec<Vec<usize>> = (0..5).map(|batch| round_robin(36, 5, batch)).collect();
    for batch in &batches {
        let mut materials: Vec<usize> = batch.iter().map(|position| position / 12).collect();
        materials.dedup();
        assert_eq!(materials, [0, 1, 2]);
    }
    let mut all = batches.concat();
    all.sort_unstable();
    assert!(all.into_iter().eq(0..36));
}

#[test]
fn every_batch_drops_other_features_and_every_epoch_has_an_order_of_its_own() {
    let text = "name = \"small\"\nnetwork = { maps = [3, 4], hidden = 8, keep_probability = 0.5 }\n\
                [training]\nepochs = 2\nbatch = 8\nlearning_rate = 0.01\nmethod = { kind = \"base\" }\n";
    let recipe = NetworkRecipe::parse("small", text).unwrap();
    let twin = twin::small(3, 10, 60).unwrap();
    let fold = Fold::new(&twin, Scheme::default(), Seed(1), 0, 0).unwrap();
    let setup = NetworkSetup::fit(&recipe, &fold.train);
    let model = ModelConfig::Network(setup.clone());
    let config = ClassifierConfig::new(model, &fold.train, Seed(1))
        .network_config(&setup)
        .unwrap();
    let device = Compute::Cpu.open().unwrap();
    let training = Training::start(
        &recipe,
        &fold.train,
        &setup.normalizer,
        &config,
        Seed(1),
        &device,
    )
    .unwrap();
    let mut drawn: Vec<Vec<f32>> = Vec::new();
    for (epoch, batch) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
        for stream in ["dropout", "adversarial dropout"] {
            drawn.push(values(training.mask(
                stream,
                BatchNumber { epoch, batch },
                8,
            )));
        }
    }
    for (index, mask) in drawn.iter().enumerate() {
        assert!(!drawn[..index].contains(mask), "{index}");
    }
    let order = |epoch: usize| -> Vec<usize> {
        (0..training.batches())
            .flat_map(|batch| training.batch_positions(BatchNumber { epoch, batch }))
            .collect()
    };
    assert_ne!(order(0), order(1));
    let mut all = order(1);
    all.sort_unstable();
    assert!(all.into_iter().eq(0..fold.train.len()), "every sweep once");
}

#[test]
fn batches_group_sweeps_of_about_one_length_and_are_cut_to_the_shortest() {
    let twin = twin::small(3, 32, 80).unwrap();
    let lengths: Vec<usize> = (0..twin.len()).map(|sweep| 30 + sweep * 37 % 51).collect();
    let unequal = twin.with_lengths(lengths).unwrap();
    let train = TrainSplit::all(&unequal, Seed(1));
    let epoch = |epoch: usize| -> Vec<Vec<usize>> {
        let batch = |batch| batch_positions(&train, 8, Seed(1), BatchNumber { epoch, batch });
        (0..8).map(batch).collect()
    };
    for batch in epoch(0) {
        let steps = || batch.iter().map(|position| train.steps(*position));
        let (shortest, longest) = (steps().min().unwrap(), steps().max().unwrap());
        // The change of the lengths before grouping, and an eighth of their range.
        assert!(
            longest as f64 <= 1.25 * shortest as f64 + 8.0,
            "{shortest} {longest}"
        );
        assert_eq!(batch_shape(&train, &batch, 80).steps, shortest);
    }
    let mut all = epoch(0).concat();
    all.sort_unstable();
    assert!(all.into_iter().eq(0..train.len()), "every sweep once");
    let sorted = |mut batch: Vec<usize>| {
        batch.sort_unstable();
        batch
    };
    let sets = |number| epoch(number).into_iter().map(sorted).collect::<Vec<_>>();
    let (first, second) = (sets(0), sets(1));
    assert!(
        first.iter().all(|batch| !second.contains(batch)),
        "other batches in every epoch"
    );
    let means: Vec<usize> = epoch(0)
        .iter()
        .map(|batch| batch.iter().map(|position| train.steps(*position)).sum())
        .collect();
    assert!(
        !means.is_sorted() && !means.is_sorted_by(|a, b| a >= b),
        "groups in random order"
    );
}
