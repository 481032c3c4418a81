use std::cell::Cell;
use std::collections::BTreeMap;

use rand::RngExt;
use tactnet_data::format::Format;
use tactnet_data::twin::{self, TwinConfig};
use tactnet_data::{LabelSet, Remedy, Samples, Scheme, SweepRecord, SweepShape};
use tactnet_models::Weights;

mod committee;
mod random_fold;
mod teacher;

use super::*;
use crate::{CalibrationTarget, EpochMetrics, SplitKind, TestSweeps, TrainEmbeddings};

const RECIPE: &str = r#"
        name = "small"
        network = { maps = [3, 4], hidden = 8, keep_probability = 0.8 }
        [training]
        epochs = 3
        batch = 8
        learning_rate = 0.005
        method = { kind = "base" }
    "#;

fn program() -> Program {
    Program {
        provenance: Provenance::of_this_process("0", "test"),
        command: |spec| format!("train {}", spec.data),
    }
}

fn spec(folder: &Path) -> TrainSpec {
    let [data, recipe] = ["twin.h5", "small.toml"].map(|name| folder.join(name));
    Format::TactMat
        .write(&data, &twin::small(3, 10, 60).unwrap())
        .unwrap();
    std::fs::write(&recipe, RECIPE).unwrap();
    TrainSpec {
        data: data.display().to_string(),
        recipe: recipe.display().to_string(),
        ..TrainSpec::default()
    }
}

#[test]
fn a_session_that_is_stopped_after_every_batch_ends_with_the_same_bits() {
    let folder = tempfile::tempdir().unwrap();
    let job = TrainJob::try_from(spec(folder.path())).unwrap();
    let [whole, parts] = ["whole", "parts"].map(|name| folder.path().join(name));
    let session = Session::begin(&job, Some(&whole), program(), |_| Ok(())).unwrap();
    let mut batches = 0;
    let count = |event: TrainEvent<'_>| {
        batches += usize::from(matches!(event, TrainEvent::Batch { .. }));
    };
    let outcome = session.train(count, || false).unwrap();
    assert!(matches!(outcome, TrainOutcome::Finished(_)), "{outcome:?}");
    assert_eq!(batches, 9, "three epochs of three batches");
    drop(session);

    drop(Session::begin(&job, Some(&parts), program(), |_| Ok(())).unwrap());
    let mut sessions = 0;
    loop {
        let session = Session::resume(&parts, None, program()).unwrap();
        let trained = Cell::new(false);
        let note = |event: TrainEvent<'_>| {
            trained.set(trained.get() || matches!(event, TrainEvent::Batch { .. }));
        };
        sessions += 1;
        if let TrainOutcome::Finished(_) = session.train(note, || trained.get()).unwrap() {
            break;
        }
    }
    assert_eq!(sessions, 10, "one for every batch, one to end");
    for file in ["weights.safetensors", "predictions_test.csv"] {
        let [whole, parts] = [&whole, &parts].map(|run| std::fs::read(run.join(file)).unwrap());
        assert!(whole == parts, "{file}");
    }
    let again = Session::resume(&whole, None, program()).unwrap();
    let ended = Cell::new(false);
    let note = |event: TrainEvent<'_>| ended.set(matches!(event, TrainEvent::AlreadyEnded));
    again.train(note, || false).unwrap();
    assert!(ended.get());
}

/// Writes windows of 60 steps, each 30 steps after the one before; each material has four recordings.
fn write_windows(path: &Path) {
    let long = twin::small(3, 4, 180).unwrap();
    let (mut values, mut records) = (Vec::new(), Vec::new());
    for (sweep, record) in long.records().iter().enumerate() {
        for window in 0..5 {
            let start = window * 30 * 16;
            values.extend_from_slice(&long.sweep(sweep)[start..start + 60 * 16]);
            records.push(SweepRecord {
                label: record.label,
                sweep: 5 * record.sweep + window,
                block: Some(record.sweep as u32),
                test: None,
            });
        }
    }
    let shape = SweepShape {
        steps: 60,
        rows: 4,
        cols: 4,
    };
    let labels = LabelSet::new(["cork", "felt", "wood"]).unwrap();
    let samples = Samples::F32(values);
    let windows = Dataset::new("windows", 750.0, shape, labels, records, samples).unwrap();
    Format::Npz.write(path, &windows).unwrap();
}

#[test]
fn overlapping_windows_are_trained_on_only_if_blocks_are_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("windows.npz");
    write_windows(&data);
    let begin = |name: &str, split: Option<SplitKind>| {
        let spec = TrainSpec {
            data: data.display().to_string(),
            split,
            ..spec(folder.path())
        };
        let job = TrainJob::try_from(spec).unwrap();
        let run = folder.path().join(name);
        Session::begin(&job, Some(&run), program(), |_| Ok(()))
    };
    for split in [Some(SplitKind::KFold), Some(SplitKind::HoldOut)] {
        let refused = begin("random", split).unwrap_err();
        let PipelineError::Data(error) = &refused else {
            panic!("{refused}");
        };
        assert_eq!(error.remedy(), Some(Remedy::LeaveBlocksOut), "{error}");
    }
    begin("blocks", Some(SplitKind::LeaveBlockOut)).unwrap();
    // Whole blocks are held out by default.
    begin("default", None).unwrap();
}

#[test]
fn watched_test_sweeps_are_noted_and_change_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let asked = spec(folder.path());
    let trained = |name: &str, method: &str, watch_test: bool| {
        std::fs::write(
            &asked.recipe,
            RECIPE.replace("method = { kind = \"base\" }", method),
        )
        .unwrap();
        let spec = TrainSpec {
            watch_test,
            ..asked.clone()
        };
        let job = TrainJob::try_from(spec).unwrap();
        let run = folder.path().join(name);
        let session = Session::begin(&job, Some(&run), program(), |_| Ok(())).unwrap();
        session.train(|_| {}, || false).unwrap();
        let weights = std::fs::read(run.join("weights.safetensors")).unwrap();
        (weights, session.run().metrics_before(usize::MAX).unwrap())
    };
    let method = |epsilon: f64| {
        format!("method = {{ kind = \"adversarial\", alpha = 0.5, epsilon = {epsilon} }}")
    };
    let (unwatched, course) = trained("unwatched", &method(0.1), false);
    assert!(course.iter().all(|epoch| epoch.test_accuracy.is_none()));
    let (watched, course) = trained("watched", &method(0.1), true);
    assert!(watched == unwatched, "nothing is learnt from test sweeps");
    assert_eq!(course.len(), 3);
    for epoch in &course {
        let (clean, adversarial) = (epoch.test_accuracy, epoch.adversarial_test_accuracy);
        assert!(clean.is_some_and(|share| (0.0..=1.0).contains(&share)));
        assert!(adversarial.is_some(), "{epoch:?}");
    }
    // A perturbation of 200 digits hides the textures.
    let last = |course: Vec<EpochMetrics>| {
        let last = course.last().unwrap().clone();
        (
            last.test_accuracy.unwrap(),
            last.adversarial_test_accuracy.unwrap(),
        )
    };
    let (clean, attacked) = last(trained("hard", &method(200.0), true).1);
    assert!(attacked <= clean, "{attacked} {clean}");
    let (_, course) = trained("base", "method = { kind = \"base\" }", true);
    let base = course.last().unwrap();
    assert!(base.test_accuracy.is_some() && base.adversarial_test_accuracy.is_none());
}

#[test]
fn a_run_names_its_data_from_anywhere_and_says_how_to_name_a_new_place() {
    let folder = tempfile::tempdir().unwrap();
    let asked = spec(folder.path());
    let job = TrainJob::try_from(asked.clone()).unwrap();
    let run = folder.path().join("run");
    let session = Session::begin(&job, Some(&run), program(), |_| Ok(())).unwrap();
    let named = session.run().config().unwrap().spec.data;
    drop(session);
    assert_eq!(named, asked.data, "an absolute path stays as it is");
    let here = std::env::current_dir().unwrap().join("sweeps.h5");
    assert_eq!(
        DataSource::from_anywhere("sweeps.h5"),
        here.display().to_string()
    );
    assert_eq!(DataSource::from_anywhere("twin"), "twin");

    let moved = folder.path().join("moved.h5");
    std::fs::rename(&named, &moved).unwrap();
    let resume = |data: Option<&str>| Session::resume(&run, data, program()).map(drop);
    let lost = resume(None).unwrap_err();
    assert!(
        lost.is_usage() && lost.to_string().contains(&named),
        "{lost}"
    );
    assert_eq!(lost.pipeline_remedy(), Some(PipelineRemedy::NameData));
    let other = folder.path().join("other.h5");
    let config = TwinConfig {
        materials: 3,
        sweeps: 10,
        steps: 60,
        seed: 2,
        ..TwinConfig::default()
    };
    let twin = twin::generate(&config).unwrap();
    Format::TactMat.write(&other, &twin).unwrap();
    let refused = resume(other.to_str()).unwrap_err().to_string();
    assert!(
        refused.contains("another data set than the run began with"),
        "{refused}"
    );
    resume(moved.to_str()).unwrap();
}

#[test]
fn runs_of_the_versions_before_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let asked = TrainSpec {
        steps: Some(40),
        inner: Some(1),
        ..spec(folder.path())
    };
    let job = TrainJob::try_from(asked.clone()).unwrap();
    let run = folder.path().join("run");
    let session = Session::begin(&job, Some(&run), program(), |_| Ok(())).unwrap();
    let config = session.run().config().unwrap();
    assert_eq!(config.spec, asked);
    let mut old = serde_json::to_value(&config).unwrap();
    let fields = old.as_object_mut().unwrap();
    fields.remove("spec");
    fields["schema_version"] = 2.into();
    for (field, value) in [
        ("data", asked.data.clone().into()),
        ("recipe_source", asked.recipe.clone().into()),
        ("steps", 40.into()),
        ("inner", 1.into()),
        ("seed", asked.seed.0.into()),
        ("compute", "cpu".into()),
    ] {
        fields.insert(field.into(), value);
    }
    let read = RunConfig::from_json(&old.to_string()).unwrap();
    assert_eq!(read, config);
    old["schema_version"] = 5.into();
    let refused = RunConfig::from_json(&old.to_string()).unwrap_err();
    assert_eq!(refused, "expected schema version 4, 3 or 2, found 5");

    let mut old = serde_json::to_value(&config).unwrap();
    old["schema_version"] = 3.into();
    let read = RunConfig::from_json(&old.to_string()).unwrap();
    assert_eq!(read, config);
    old["spec"]["data"] = "twin".into();
    let read = RunConfig::from_json(&old.to_string()).unwrap();
    assert_eq!(read.spec.data, "twin1", "the only twin that there was");
}

#[test]
fn a_run_names_the_spec_that_leads_to_it_again() {
    let folder = tempfile::tempdir().unwrap();
    let asked = TrainSpec {
        fold: Some(2),
        ..spec(folder.path())
    };
    let job = TrainJob::try_from(asked.clone()).unwrap();
    let run = folder.path().join("run");
    let session = Session::begin(&job, Some(&run), program(), |_| Ok(())).unwrap();
    let config = session.run().config().unwrap();
    let manifest = session.run().split().unwrap();
    let fold = manifest.fold(&session.dataset).unwrap();
    let named = config.named_spec(&fold);
    assert_eq!(named.epochs, Some(3), "what the recipe says is named");
    let again = TrainSpec {
        mean_removal: None,
        split: None,
        epochs: None,
        ..named
    };
    assert_eq!(again, asked);
}

/// Everything that a training fits.
struct Fitted {
    weights: Weights,
    classifier: ClassifierConfig,
    calibration: Calibration,
    embeddings: TrainEmbeddings,
    /// Weights and selected settings.
    baselines: [(Weights, BTreeMap<String, f64>); 5],
    /// Weights and thresholds.
    committee: (Weights, Calibration),
}

/// Trains a calibrated network and baselines.
fn fitted(folder: &Path, name: &str, dataset: &Dataset) -> Fitted {
    let [data, recipe, run] = ["h5", "toml", "run"].map(|end| folder.join(format!("{name}.{end}")));
    Format::TactMat.write(&data, dataset).unwrap();
    std::fs::write(
        &recipe,
        format!("{RECIPE}\n[input]\nscaling = \"per-taxel\""),
    )
    .unwrap();
    let spec = TrainSpec {
        data: data.display().to_string(),
        recipe: recipe.display().to_string(),
        calibration: Some(CalibrationTarget {
            false_alarms: 0.2,
            coverage: 0.8,
        }),
        split: Some(SplitKind::KFold),
        ..TrainSpec::default()
    };
    let job = TrainJob::try_from(spec).unwrap();
    let session = Session::begin(&job, Some(&run), program(), |_| Ok(())).unwrap();
    session.train(|_| {}, || false).unwrap();
    let run = session.run();
    let fold = Fold::new(dataset, Scheme::default(), Seed(1), 0, 0).unwrap();
    let baselines = ["lda", "svm-h", "knn-l", "minirocket", "quant"].map(|name| {
        let ModelRecipe::Baseline(recipe) = ModelRecipe::load(name).unwrap() else {
            panic!("{name} is a baseline");
        };
        let fit = fit_baseline(&recipe, &fold.train, Seed(1), |_| {}).unwrap();
        (fit.weights, fit.chosen)
    });
    Fitted {
        weights: run.weights().unwrap(),
        classifier: run.config().unwrap().classifier,
        calibration: run.calibration().unwrap().unwrap(),
        embeddings: run.train_embeddings().unwrap(),
        baselines,
        committee: committee::calibrated(folder, name, &data),
    }
}

/// Compares two recordings that differ only in their test sweeps.
#[test]
fn nothing_that_is_fitted_depends_on_the_test_sweeps() {
    let folder = tempfile::tempdir().unwrap();
    let twin = twin::small(3, 20, 200).unwrap();
    let tested = Fold::new(&twin, Scheme::default(), Seed(1), 0, 0).unwrap();
    let digits: Vec<f32> = (0..twin.len())
        .flat_map(|index| {
            let other = tested.test.indices().contains(&index);
            let digits = twin.sweep(index).into_iter().enumerate();
            digits.map(move |(i, x)| {
                if other {
                    ((i + 7 * index) * (i + 1) % 97) as f32
                } else {
                    x
                }
            })
        })
        .collect();
    let changed = Dataset::new(
        "changed",
        twin.sample_rate_hz(),
        twin.shape(),
        twin.labels().clone(),
        twin.records().to_vec(),
        Samples::U8(digits.into_iter().map(|x| x as u8).collect()),
    )
    .unwrap();
    assert_ne!(twin.sha256(), changed.sha256());
    let (first, second) = (
        fitted(folder.path(), "twin", &twin),
        fitted(folder.path(), "changed", &changed),
    );
    assert_eq!(first.classifier, second.classifier, "normaliser");
    assert_eq!(first.weights, second.weights, "weights");
    assert_eq!(first.calibration, second.calibration, "calibration");
    assert_eq!(first.embeddings, second.embeddings, "embeddings");
    assert_eq!(first.baselines, second.baselines, "baselines");
    assert_eq!(first.committee, second.committee, "committee");
}

/// A moved or converted file holds the same test sweeps. Without the training data, overlap with other sweeps is unknown, and reported as such.
#[test]
fn training_sweeps_are_left_out_wherever_the_data_lies_now() {
    let folder = tempfile::tempdir().unwrap();
    let spec = spec(folder.path());
    let job = TrainJob::try_from(spec.clone()).unwrap();
    let run = folder.path().join("run");
    let session = Session::begin(&job, Some(&run), program(), |_| Ok(())).unwrap();
    let split = session.run().split().unwrap();
    let moved = folder.path().join("moved.h5");
    let copied = folder.path().join("copied.npz");
    let sweeps = |path: &Path| tactnet_data::format::read(path).unwrap();
    Format::Npz
        .write(&copied, &sweeps(Path::new(&spec.data)))
        .unwrap();
    let unseen = |path: &Path| {
        let dataset = sweeps(path);
        let (config, split) = (
            session.run().config().unwrap(),
            session.run().split().unwrap(),
        );
        let test = TestSweeps::unseen(&dataset, &config, &split).unwrap();
        (test.view.indices().to_vec(), test.training_sweeps_known)
    };
    let mut test = split.test.clone();
    test.sort_unstable();
    assert_eq!(unseen(&copied), (test.clone(), true));
    std::fs::rename(&spec.data, &moved).unwrap();
    assert_eq!(unseen(&moved), (test.clone(), true));
    assert_eq!(unseen(&copied), (test, true));
    let others = folder.path().join("others.npz");
    Format::Npz
        .write(&others, &twin::small(3, 9, 60).unwrap())
        .unwrap();
    assert_eq!(unseen(&others), ((0..27).collect(), false));
}
