use rand::RngExt;
use tactnet_data::twin;
use tactnet_data::{Dataset, Fold, Samples, Scheme, Seed, SweepView};
use tactnet_models::Compute;

use super::{AdaptRisk, Adapted, NewSweeps, RiskPolicy, adapt};
use crate::{
    Classifier, ClassifierConfig, Likeness, LikenessVerdict, ModelConfig, ModelRecipe,
    NetworkRecipe, PipelineError, PredictionMethod, fit_baseline, fit_model, train_network,
};

fn twin() -> Dataset {
    twin::small(6, 40, 120).unwrap()
}

fn first_fold(dataset: &Dataset) -> Fold<'_> {
    Fold::new(dataset, Scheme::default(), Seed(1), 0, 0).unwrap()
}

fn baseline(fold: &Fold<'_>, name: &str) -> Classifier {
    let ModelRecipe::Baseline(recipe) = ModelRecipe::load(name).unwrap() else {
        panic!("{name} is a baseline");
    };
    let fit = fit_baseline(&recipe, &fold.train, Seed(1), |_| {}).unwrap();
    let config = ClassifierConfig::new(ModelConfig::Baseline(recipe), &fold.train, Seed(1));
    Classifier::new(config, &fit.weights, &Compute::Cpu.open().unwrap()).unwrap()
}

fn network(fold: &Fold<'_>) -> Classifier {
    let text = "name = \"small\"\nnetwork = { maps = [8, 8], hidden = 32 }\ninput = { scaling = \"per-taxel\" }\n\
                [training]\nepochs = 12\nbatch = 16\nlearning_rate = 0.005\nmethod = { kind = \"base\" }\n";
    let recipe = NetworkRecipe::parse("small", text).unwrap();
    let device = Compute::Cpu.open().unwrap();
    let trained = train_network(&recipe, &fold.train, Seed(1), &device, |_| true);
    trained.unwrap().unwrap()
}

/// Returns the sweeps as another skin feels them: every taxel has another gain and an offset of up to four spreads.
fn other_skin(view: &SweepView<'_>) -> Dataset {
    let (dataset, shape) = (view.dataset(), view.shape());
    let taxels = shape.taxels();
    let mut rng = Seed(5).rng("other skin");
    let gains: Vec<f32> = (0..taxels).map(|_| rng.random_range(0.6..1.6)).collect();
    let offsets: Vec<f32> = (0..taxels).map(|_| rng.random_range(-80.0..80.0)).collect();
    let mut values = vec![0.0; view.len() * shape.values()];
    for (position, sweep) in values.chunks_exact_mut(shape.values()).enumerate() {
        view.copy_batch(&[position], sweep);
        for frame in sweep.chunks_exact_mut(taxels) {
            let scales = gains.iter().zip(&offsets);
            for (value, (gain, offset)) in frame.iter_mut().zip(scales) {
                *value = *value * gain + offset;
            }
        }
    }
    let records = view.indices().iter();
    let records = records.map(|&at| dataset.records()[at].clone()).collect();
    let (rate, labels) = (dataset.sample_rate_hz(), dataset.labels().clone());
    Dataset::new("other", rate, shape, labels, records, Samples::F32(values)).unwrap()
}

/// Returns every second sweep of each material, from `first` on.
fn every_other(dataset: &Dataset, first: usize) -> SweepView<'_> {
    let mut met = vec![first; dataset.labels().len()];
    let is_chosen = |index: &usize| {
        let count = &mut met[dataset.records()[*index].label];
        *count += 1;
        *count % 2 == 1
    };
    SweepView::new(dataset, (0..dataset.len()).filter(is_chosen).collect())
}

fn accuracy(classifier: &Classifier, view: &SweepView<'_>) -> f64 {
    let predictions = classifier.predict(view, PredictionMethod::Plain).unwrap();
    let right = predictions.sweeps.iter().filter(|sweep| {
        let rows = &sweep.log_probability;
        rows.iter().all(|of| *of <= rows[sweep.label])
    });
    right.count() as f64 / view.len() as f64
}

fn unlabelled<'a>(view: &'a SweepView<'a>) -> NewSweeps<'a> {
    NewSweeps {
        unlabelled: Some(view),
        labelled: None,
    }
}

fn built(adapted: &Adapted) -> Classifier {
    let device = Compute::Cpu.open().unwrap();
    Classifier::new(adapted.config.clone(), &adapted.weights, &device).unwrap()
}

#[test]
fn unlabelled_sweeps_of_another_skin_restore_the_accuracy_on_held_out_ones() {
    let dataset = twin();
    let fold = first_fold(&dataset);
    let likeness = Likeness::fit(&fold.train, Seed(1)).unwrap().unwrap();
    let other = other_skin(&fold.test);
    let (new, held_out) = (every_other(&other, 0), every_other(&other, 1));
    let clean = SweepView::clone(&fold.test);
    for classifier in [network(&fold), baseline(&fold, "lda")] {
        let name = classifier.model_name();
        let before = accuracy(&classifier, &held_out);
        let found = adapt(
            &classifier,
            Some(&likeness),
            unlabelled(&new),
            RiskPolicy::Refuse,
        );
        let found = found.unwrap();
        let after = accuracy(&built(&found), &held_out);
        let clean = accuracy(&classifier, &clean);
        // 24 sweeps: three of them are less than two standard errors.
        assert!(after > clean - 0.13, "{name}: {clean} {before} {after}");
        assert!(after > before + 0.2, "{name}: {clean} {before} {after}");
        assert!(found.shift.level > 0.5, "{name}: {:?}", found.shift);
        assert_eq!(found.risks, [], "{name}");
        // Verdicts are about the new skin now.
        let moved = found.likeness.unwrap();
        let unlike = |of: &Likeness, view: &SweepView<'_>| {
            of.assess(view, Seed(1)).verdict == LikenessVerdict::Unlike
        };
        assert!(unlike(&likeness, &held_out), "{name}");
        assert!(!unlike(&moved, &held_out), "{name}");
        assert!(unlike(&moved, &fold.test), "{name}");
    }
}

#[test]
fn sweeps_of_the_training_skin_hardly_change_predictions() {
    let dataset = twin();
    let fold = first_fold(&dataset);
    for classifier in [network(&fold), baseline(&fold, "lda")] {
        let found = adapt(
            &classifier,
            None,
            unlabelled(&fold.train),
            RiskPolicy::Refuse,
        );
        let adapted = built(&found.unwrap());
        let rows = |of: &Classifier| {
            of.log_probabilities(&fold.test, PredictionMethod::Plain)
                .unwrap()
        };
        let (before, after) = (rows(&classifier), rows(&adapted));
        let apart: f64 = before
            .iter()
            .flatten()
            .zip(after.iter().flatten())
            .map(|(a, b)| (a.exp() - b.exp()).abs())
            .sum();
        // Total variation per sweep.
        let apart = apart / 2.0 / before.len() as f64;
        // Running statistics of a network that is trained at a constant rate lag behind its last batches.
        let most = if classifier.has_dropout() { 0.2 } else { 0.05 };
        assert!(apart < most, "{}: {apart}", classifier.model_name());
    }
}

#[test]
fn few_sweeps_and_few_materials_are_refused() {
    let dataset = twin();
    let fold = first_fold(&dataset);
    let likeness = Likeness::fit(&fold.train, Seed(1)).unwrap();
    let classifier = baseline(&fold, "lda");
    let risks = |indices: Vec<usize>| {
        let view = SweepView::new(&dataset, indices);
        let found = adapt(
            &classifier,
            likeness.as_ref(),
            unlabelled(&view),
            RiskPolicy::Refuse,
        );
        let Err(PipelineError::AdaptRefused { risks }) = found else {
            panic!("not refused: {:?}", found.map(|found| found.presence));
        };
        let policy = RiskPolicy::Accept;
        let accepted = adapt(&classifier, likeness.as_ref(), unlabelled(&view), policy).unwrap();
        assert!(risks.iter().all(|risk| accepted.risks.contains(risk)));
        risks
    };
    let one_material = (0..dataset.len()).filter(|at| dataset.records()[*at].label == 2);
    let risks_of_one = risks(one_material.collect());
    assert!(
        matches!(risks_of_one[..], [AdaptRisk::FewMaterials { known: 6, .. }]),
        "{risks_of_one:?}"
    );
    let six = fold.test.indices().iter().copied().step_by(8).collect();
    let wanted = AdaptRisk::FewSweeps {
        found: 6,
        wanted: 16,
    };
    assert!(risks(six).contains(&wanted));
}

/// Returns the sweeps with other levels of the taxels in every recording block.
fn with_levels_of_blocks(dataset: &Dataset) -> Dataset {
    let (shape, records) = (dataset.shape(), dataset.records().to_vec());
    let level = |block: u32, taxel: usize| {
        let mut rng = Seed(u64::from(block) * 1000 + taxel as u64).rng("level");
        rng.random_range(-30.0_f32..30.0)
    };
    let mut values = Vec::new();
    for (index, record) in records.iter().enumerate() {
        let block = record.block.unwrap();
        let sweep = dataset.sweep(index).into_iter().enumerate();
        values.extend(sweep.map(|(at, value)| value + level(block, at % shape.taxels())));
    }
    let (rate, labels) = (dataset.sample_rate_hz(), dataset.labels().clone());
    Dataset::new("blocks", rate, shape, labels, records, Samples::F32(values)).unwrap()
}

#[test]
fn another_recording_on_the_same_skin_is_refused_without_labels() {
    let dataset = with_levels_of_blocks(&twin());
    let mut refused = 0;
    for block in 0..4 {
        let fold = Fold::new(&dataset, Scheme::LeaveBlockOut, Seed(1), 0, block).unwrap();
        let likeness = Likeness::fit(&fold.train, Seed(1)).unwrap().unwrap();
        let classifier = baseline(&fold, "lda");
        let labels = NewSweeps {
            unlabelled: None,
            labelled: Some(&fold.test),
        };
        let adapted = |new| adapt(&classifier, Some(&likeness), new, RiskPolicy::Refuse);
        assert!(adapted(labels).is_ok());
        let verdict = likeness.assess(&fold.test, Seed(1)).verdict;
        let risks = match adapted(unlabelled(&fold.test)) {
            Ok(found) => found.risks,
            Err(PipelineError::AdaptRefused { risks }) => risks,
            Err(error) => panic!("{error}"),
        };
        let is_listed = risks
            .iter()
            .any(|risk| matches!(risk, AdaptRisk::OtherRecording { .. }));
        assert_eq!(is_listed, verdict == LikenessVerdict::OtherBlock);
        refused += usize::from(is_listed);
    }
    assert!(refused >= 2, "{refused} of 4");
}

#[test]
fn labels_improve_on_unlabelled_sweeps_where_materials_are_renamed() {
    // Names of two materials are exchanged on the new skin: only labels can tell.
    let dataset = twin();
    let fold = first_fold(&dataset);
    let mut other = other_skin(&SweepView::all(&dataset));
    let records = other.records().iter().cloned().map(|mut record| {
        record.label = match record.label {
            0 => 1,
            1 => 0,
            other => other,
        };
        record
    });
    let (rate, labels) = (other.sample_rate_hz(), other.labels().clone());
    let mut values = vec![0.0; other.len() * other.shape().values()];
    let all: Vec<usize> = (0..other.len()).collect();
    SweepView::all(&other).copy_batch(&all, &mut values);
    let samples = Samples::F32(values);
    other = Dataset::new(
        "renamed",
        rate,
        other.shape(),
        labels,
        records.collect(),
        samples,
    )
    .unwrap();
    // Sweeps that trained the classifier serve again, so that 32 of each material have labels.
    let new = SweepView::new(&other, fold.train.indices().to_vec());
    let held_out = SweepView::new(&other, fold.test.indices().to_vec());
    let labelled = NewSweeps {
        unlabelled: None,
        labelled: Some(&new),
    };
    for classifier in [
        network(&fold),
        baseline(&fold, "lda"),
        baseline(&fold, "minirocket"),
    ] {
        let without = adapt(&classifier, None, unlabelled(&new), RiskPolicy::Accept).unwrap();
        let with = adapt(&classifier, None, labelled, RiskPolicy::Refuse).unwrap();
        let (without, with) = (built(&without), built(&with));
        let [without, with] = [without, with].map(|of| accuracy(&of, &held_out));
        assert!(
            // Three of 48 sweeps; the prior still speaks for the old names.
            with > without + 0.06,
            "{}: {without} {with}",
            classifier.model_name()
        );
    }
    let refused = adapt(
        &baseline(&fold, "svm-spectra"),
        None,
        labelled,
        RiskPolicy::Refuse,
    );
    assert!(matches!(refused, Err(PipelineError::AdaptHead { .. })));
    let refused = adapt(
        &baseline(&fold, "knn-h"),
        None,
        unlabelled(&new),
        RiskPolicy::Refuse,
    );
    assert!(matches!(refused, Err(PipelineError::AdaptScaling { .. })));
}

#[test]
fn a_committee_adapts_as_its_members_do_and_leaves_out_those_that_cannot() {
    let dataset = twin();
    let fold = first_fold(&dataset);
    let other = other_skin(&fold.test);
    let (new, held_out) = (every_other(&other, 0), every_other(&other, 1));
    let text = "name = \"four\"\nmembers = [\"lda\", \"means\", \"svm-spectra\"]";
    let recipe = ModelRecipe::parse("four", text).unwrap();
    let device = Compute::Cpu.open().unwrap();
    let fitted = fit_model(&recipe, &fold.train, Seed(1), &device, |_| true);
    let committee = fitted.unwrap().unwrap().classifier;
    let alone = ["lda", "svm-spectra"].map(|name| baseline(&fold, name));
    let with_labels = NewSweeps {
        unlabelled: None,
        labelled: Some(&new),
    };
    for (sweeps, lacking) in [
        (unlabelled(&new), &["means"][..]),
        (with_labels, &["means", "svm-spectra"]),
    ] {
        let found = adapt(&committee, None, sweeps, RiskPolicy::Accept).unwrap();
        let left_out: Vec<&str> = found.left_out.iter().map(|of| of.name.as_str()).collect();
        assert_eq!(left_out, lacking);
        let rows = |of: &Classifier| {
            let rows = of.log_probabilities(&held_out, PredictionMethod::Plain);
            rows.unwrap().concat()
        };
        let members: Vec<Vec<f64>> = alone
            .iter()
            .filter(|member| !lacking.contains(&member.model_name().as_str()))
            .map(|member| {
                let adapted = adapt(member, None, sweeps, RiskPolicy::Accept).unwrap();
                rows(&built(&adapted))
            })
            .collect();
        for (at, log_p) in rows(&built(&found)).iter().enumerate() {
            let sum: f64 = members.iter().map(|member| member[at].exp()).sum();
            assert!((log_p.exp() - sum / members.len() as f64).abs() < 1e-9);
        }
    }
    let text = "name = \"one\"\nmembers = [\"means\"]";
    let recipe = ModelRecipe::parse("one", text).unwrap();
    let fitted = fit_model(&recipe, &fold.train, Seed(1), &device, |_| true);
    let nobody = fitted.unwrap().unwrap().classifier;
    let refused = adapt(&nobody, None, unlabelled(&new), RiskPolicy::Accept);
    assert!(matches!(refused, Err(PipelineError::AdaptScaling { .. })));
}
