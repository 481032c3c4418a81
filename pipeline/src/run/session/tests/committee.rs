use super::*;
use crate::{CalibrationTarget, PredictionMethod};

const MEMBERS: &str = "name = \"three\"\nmembers = [\"lda\", \"means\", { name = \"net\", network = { maps = [4], hidden = 8 }, \
    training = { epochs = 2, batch = 12, learning_rate = 0.01, method = { kind = \"base\" } } }]";

const TARGET: CalibrationTarget = CalibrationTarget {
    false_alarms: 0.2,
    coverage: 0.8,
};

fn session(folder: &Path, name: &str, data: &Path) -> Session {
    let [recipe, run] = ["toml", "run"].map(|end| folder.join(format!("{name}-committee.{end}")));
    std::fs::write(&recipe, MEMBERS).unwrap();
    let spec = TrainSpec {
        data: data.display().to_string(),
        recipe: recipe.display().to_string(),
        calibration: Some(TARGET),
        split: Some(SplitKind::KFold),
        ..TrainSpec::default()
    };
    let job = TrainJob::try_from(spec).unwrap();
    let session = Session::begin(&job, Some(&run), program(), |_| Ok(())).unwrap();
    session.train(|_| {}, || false).unwrap();
    session
}

/// Returns weights and thresholds of a committee trained on `data`.
pub fn calibrated(folder: &Path, name: &str, data: &Path) -> (Weights, Calibration) {
    let session = session(folder, name, data);
    let run = session.run();
    (run.weights().unwrap(), run.calibration().unwrap().unwrap())
}

#[test]
fn thresholds_of_a_committee_are_order_statistics_of_its_mean_posteriors() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("twin.h5");
    let config = TwinConfig {
        materials: 3,
        sweeps: 20,
        steps: 100,
        ..TwinConfig::default()
    };
    let twin = twin::generate(&config).unwrap();
    Format::TactMat.write(&data, &twin).unwrap();
    let session = session(folder.path(), "own", &data);
    let (run, config) = (session.run(), session.run().config().unwrap());
    let calibration = run.calibration().unwrap().unwrap();
    let fold = run.split().unwrap().fold(&twin).unwrap();
    let (fitted, aside) = fold.set_aside().unwrap();
    assert_eq!(calibration.sweeps, aside.len());

    let device = session.device(&config).unwrap();
    let weights = run.weights().unwrap();
    let classifier = Classifier::new(config.classifier.clone(), &weights, device).unwrap();
    let rows = classifier.log_probabilities(&aside, PredictionMethod::Plain);
    let (mut largest, mut losses) = (Vec::new(), Vec::new());
    for (row, label) in rows.unwrap().iter().zip(aside.labels()) {
        let best = row.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        largest.push(-best);
        losses.push(1.0 - row[label].exp());
    }
    // Of n scores the ceil(0.8 (n + 1))-th smallest.
    let rank = (0.8 * (aside.len() + 1) as f64).ceil() as usize;
    for (values, found) in [
        (&mut largest, calibration.threshold),
        (&mut losses, 1.0 - calibration.least_probability),
    ] {
        values.sort_by(f64::total_cmp);
        assert!((values[rank - 1] - found).abs() < 1e-12, "{found}");
    }
    // Test and training sweeps have verdicts; those of more confident sweeps are known.
    let detector = run.unknown_detector().unwrap().unwrap();
    let verdicts = detector.assess(&classifier, &fold.test).unwrap();
    assert_eq!(verdicts.len(), fold.test.len());
    let known = detector.assess(&classifier, &fitted.train).unwrap();
    let unknown = known.iter().filter(|verdict| verdict.unknown).count();
    assert!(5 * unknown <= 2 * known.len(), "{unknown}");
    assert!(verdicts.iter().all(|verdict| !verdict.set.is_empty()));
}
