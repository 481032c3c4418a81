use super::*;

/// Writes sweeps of three materials in ten recordings each, whose level is all that distinguishes them.
fn write_recordings(path: &Path) {
    let shape = SweepShape {
        steps: 60,
        rows: 2,
        cols: 2,
    };
    let (mut values, mut records) = (Vec::new(), Vec::new());
    for (label, block, sweep) in (0..3).flat_map(|label| {
        (0..10).flat_map(move |block| (0..6).map(move |sweep| (label, block, sweep)))
    }) {
        let level = 1000.0 * Seed(1).rng(("level", label, block)).random::<f32>();
        let mut rng = Seed(1).rng(("noise", 100 * block + sweep, label));
        values.extend((0..shape.values()).map(|_| level + rng.random::<f32>()));
        records.push(SweepRecord {
            label,
            sweep: 6 * block + sweep,
            block: Some((10 * label + block) as u32),
            test: None,
        });
    }
    let labels = LabelSet::new(["cork", "felt", "wood"]).unwrap();
    let samples = Samples::F32(values);
    let recordings = Dataset::new("recordings", 750.0, shape, labels, records, samples).unwrap();
    Format::Npz.write(path, &recordings).unwrap();
}

#[test]
fn a_random_fold_shows_what_sweeps_of_the_same_recordings_are_worth() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("recordings.npz");
    write_recordings(&data);
    let result = |name: &str, recipe: &str, split: Option<SplitKind>, limit: Option<Duration>| {
        let own = spec(folder.path());
        let spec = TrainSpec {
            data: data.display().to_string(),
            recipe: match recipe {
                "network" => own.recipe.clone(),
                baseline => baseline.into(),
            },
            split,
            ..own
        };
        let job = TrainJob::try_from(spec).unwrap();
        let run = folder.path().join(name);
        let session = Session::begin(&job, Some(&run), program(), |_| Ok(())).unwrap();
        let session = match limit {
            Some(limit) => session.with_random_fold(limit),
            None => session,
        };
        let trained = session.train(|_| {}, || false).unwrap();
        let TrainOutcome::Finished(result) = trained else {
            panic!("{trained:?}");
        };
        let stored = session.run().result().unwrap().unwrap();
        assert_eq!(stored.random_fold.is_some(), result.random_fold.is_some());
        *result
    };
    let soon = Some(Duration::from_secs(600));
    let blocks = result("blocks", "means", None, soon);
    let random = blocks.random_fold.unwrap();
    // A level names its recording, and the recording its material; an unseen recording has an unrelated level.
    assert!(random.one_sweep.mean > 0.95, "{random:?}");
    assert!(
        blocks.accuracy_one_sweep.mean < 0.7,
        "{:?}",
        blocks.accuracy_one_sweep
    );
    assert_eq!(
        (random.split.as_str(), random.n_train, random.one_sweep.n),
        ("fold 1 of 5", 144, 36)
    );
    // It is the accuracy of a run on that fold.
    let folds = result("folds", "means", Some(SplitKind::KFold), soon);
    assert_eq!(folds.accuracy_one_sweep, random.one_sweep);
    assert_eq!(folds.random_fold, None);
    // Trainings that take longer than the limit are not repeated.
    assert_eq!(
        result("long", "means", None, Some(Duration::ZERO)).random_fold,
        None
    );
    assert_eq!(result("unasked", "means", None, None).random_fold, None);
    let network = result("network", "network", None, soon);
    let folds = result("network-folds", "network", Some(SplitKind::KFold), None);
    assert_eq!(
        network.random_fold.unwrap().one_sweep,
        folds.accuracy_one_sweep
    );
}
