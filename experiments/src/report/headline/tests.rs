use super::super::data_set::data_sets;
use super::super::fake;
use super::*;
use crate::{Comparison, FailedTasks, Measure};
use tactnet_pipeline::{ConfoundedAccuracy, Estimate, SplitKind, TrainingSteps};

fn page(summary: &Summary) -> String {
    let rows = summary.scored();
    of_contenders(summary, &data_sets(&rows)).into_string()
}

fn audit(means: Option<f64>, permuted: Option<f64>, block_out: Option<f64>) -> Audit {
    Audit {
        data: "sweeps, levels kept, 1000 steps".into(),
        chance: 1.0 / 36.0,
        permuted_chance: None,
        best: Some(("net".into(), 0.8)),
        tied: Vec::new(),
        block_out,
        means,
        first_frame: None,
        last_frame: None,
        recording_order: None,
        sweep_length: None,
        block_identity: None,
        permuted,
        chance_sigma: 0.01,
        verdict: String::new(),
    }
}

#[test]
fn the_best_result_comes_with_its_interval() {
    let page = page(&fake::tactmat());
    assert!(
        page.contains("of single sweeps of 36 materials recognised by net, MC dropout (k-fold)")
    );
    let [low, high] = fake::tactmat().rows[0].statistic.ci95.unwrap();
    let ends = format!(
        "<strong>80.0\u{a0}%</strong> [{:.1}, {:.1}]",
        100.0 * low,
        100.0 * high
    );
    assert!(page.contains(&ends), "{page}");
    assert!(page.contains("interval, wide, since it rests on 2 folds only</p>"));
}

#[test]
fn models_that_tie_are_named_with_the_one_that_stands_for_them() {
    let mut summary = fake::tactmat();
    assert!(!page(&summary).contains("as many by"));
    let best = summary.rows[0].statistic.clone();
    for row in &mut summary.rows {
        if row.measure == Measure::Accuracy && row.sweeps == Some(1) {
            row.statistic = best.clone();
        }
    }
    let page = page(&summary);
    assert!(
        page.contains(
            "recognised by net, MC dropout (k-fold), and as many by knn, MC dropout; three"
        ),
        "{page}"
    );
}

#[test]
fn models_that_cannot_be_told_from_the_best_are_named() {
    let mut summary = fake::tactmat();
    assert!(!page(&summary).contains("distinguishable"));
    let key = |contender: &str| {
        let mut rows = summary.rows.iter();
        let own = rows.find(|row| row.contender == contender && row.sweeps == Some(1));
        own.unwrap().key.clone()
    };
    summary.comparisons = vec![Comparison {
        first: key(&summary.contenders[1].key),
        second: key(&summary.contenders[0].key),
        difference: -0.2,
        ci95: None,
        p: Some(0.2),
        p_holm: Some(0.2),
        n: 2,
    }];
    assert!(page(&summary).contains("No other model is distinguishable from "));
    summary.comparisons[0].p_holm = Some(0.01);
    assert!(page(&summary).contains("The other model is distinguishable from "));
}

#[test]
fn what_weighs_most_qualifies_the_result() {
    let mut summary = fake::tactmat();
    assert!(page(&summary).contains("Guessing recognises 2.8\u{a0}%."));
    for (audit, said) in [
        (
            audit(Some(0.75), Some(0.03), Some(0.6)),
            "Levels alone recognise 75.0\u{a0}%, so this says little about texture.",
        ),
        (
            audit(Some(0.4), None, Some(0.6)),
            "Levels alone recognise 40.0\u{a0}%, guessing 2.8\u{a0}%: part of this is level",
        ),
        (
            audit(Some(0.1), None, Some(0.6)),
            "With a recording block left out it recognises 60.0\u{a0}%.",
        ),
        (
            audit(Some(0.1), Some(0.03), None),
            "Levels alone recognise 10.0\u{a0}%, guessing 2.8\u{a0}%.",
        ),
        (
            audit(None, Some(0.03), None),
            "Guessing recognises 2.8\u{a0}%.",
        ),
        (
            audit(Some(0.75), Some(0.2), None),
            "With permuted labels a classifier still scores 20.0\u{a0}%",
        ),
    ] {
        summary.audits = vec![audit];
        let page = page(&summary);
        assert!(page.contains(said), "{said}: {page}");
        assert_eq!(page.matches("class=\"qualifier\"").count(), 1);
    }
    // The audit of another data set does not apply to this one.
    summary.audits[0].data = "other, levels kept, 1000 steps".into();
    assert!(page(&summary).contains("Guessing recognises"));
}

/// Replaces one contender by a probe on the first frame.
fn with_first_frame(accuracy: f64, first_frame: f64) -> Summary {
    let mut summary = fake::tactmat();
    summary.contenders[1].model = "probe: first frame alone".into();
    summary.contenders[1].probe = true;
    let keys = [0, 1].map(|index| summary.contenders[index].key.clone());
    for row in &mut summary.rows {
        if row.measure == Measure::Accuracy && row.sweeps == Some(1) {
            let mean = if row.contender == keys[0] {
                accuracy
            } else {
                first_frame
            };
            row.statistic = crate::Statistic::of(vec![mean, mean], 0.25);
        }
    }
    summary.audits = vec![audit(None, None, None)];
    summary
}

#[test]
fn a_first_frame_as_accurate_as_the_model_is_in_the_headline() {
    let page = |summary: &Summary| page(summary).replace('\u{a0}', " ");
    let sentence =
        "The first frame alone gives 97.3 % (model: 100.0 %), so this says little about texture.";
    let mut told = with_first_frame(1.0, 0.973);
    assert!(page(&told).contains(sentence), "{}", page(&told));
    assert!(!page(&with_first_frame(1.0, 0.6)).contains("first frame alone gives"));
    // On other folds than those of the headline it says nothing about it.
    told.contenders[1].split = "leave_one_block_out".into();
    assert!(!page(&told).contains("first frame alone gives"));
    // The order of the sweeps in the file matters where neighbours are in training.
    told.audits[0].recording_order = Some(0.99);
    let order = "The order of the sweeps in the file alone gives 99.0 % (model: 100.0 %)";
    assert!(page(&told).contains(order), "{}", page(&told));
    told.contenders[0].split_kind = SplitKind::GroupKFold;
    assert!(!page(&told).contains(order));
}

#[test]
fn partly_confounded_materials_come_with_the_accuracy_on_the_others() {
    let page = |summary: &Summary| page(summary).replace('\u{a0}', " ");
    let floors =
        |range: std::ops::Range<usize>| range.map(|floor| format!("floor {floor}")).collect();
    let mut summary = fake::tactmat();
    let found = ConfoundedAccuracy {
        confounded: floors(0..8),
        n_confounded: 160,
        materials: 10,
        unconfounded: floors(8..10),
        unconfounded_one_sweep: Some(Estimate::wilson(0.75, 40)),
    };
    summary.contenders[0].confounded = Some(found.clone());
    let partly = "On the materials that share their sessions with others (floor 8 and floor 9) it is 75.0 % [59.8, 85.8].";
    assert!(page(&summary).contains(partly), "{}", page(&summary));
    // Whole sessions are held out, which leaves nothing to train on for the others.
    summary.contenders[0].confounded = Some(ConfoundedAccuracy {
        n_confounded: 0,
        ..found
    });
    assert!(page(&summary).contains(
        "Only 2 of 10 materials were tested: the others were recorded in one session each."
    ));
    // The warning about the data is next to the headline.
    let warning = "floors.csv: 8 of 10 materials were recorded in one session each: this accuracy cannot be told from recognising the session";
    summary.data_warnings = vec![warning.into()];
    assert!(page(&summary).contains(warning));
}

#[test]
fn the_network_is_named_where_a_baseline_won_and_few_steps_are_said() {
    let steps = |epochs, batches| Some(TrainingSteps { epochs, batches });
    let mut summary = fake::tactmat();
    summary.contenders[1].training = steps(12, 3);
    summary.contenders[1].network = Some("TactNet-II".into());
    let beaten = page(&summary);
    assert!(
        beaten.contains(
            "TactNet-II (knn), MC dropout recognises 60.0\u{a0}%, with 36 training steps a fold, which are few."
        ),
        "{beaten}"
    );
    summary.contenders[1].training = steps(12, 80);
    assert!(page(&summary).contains("TactNet-II (knn), MC dropout recognises 60.0\u{a0}%."));
    summary.contenders[0].training = steps(12, 3);
    summary.contenders[0].network = Some("TactNet-II".into());
    let won = page(&summary);
    assert!(
        won.contains("recognised by TactNet-II (net), MC dropout"),
        "{won}"
    );
    assert!(
        won.contains("It had 36 training steps a fold, which are few."),
        "{won}"
    );
}

#[test]
fn a_probe_is_no_headline() {
    let mut summary = fake::tactmat();
    summary.contenders[0].probe = true;
    assert!(page(&summary).contains("<strong>60.0\u{a0}%</strong>"));
    summary.contenders[1].probe = true;
    assert!(page(&summary).contains("No model has finished yet."));
}

#[test]
fn an_unfinished_run_says_so_beside_its_headline() {
    let mut summary = fake::tactmat();
    assert!(!page(&summary).contains("Unfinished"));
    summary.tasks_done = 3;
    assert!(page(&summary).contains("<strong>Unfinished:</strong> 3 of 4 tasks"));
    assert!(!page(&summary).contains("will change"));
    summary.tasks_running = 1;
    assert!(page(&summary).contains("will change: 1 are running"));
    summary.failed = vec![FailedTasks {
        model: "lda".into(),
        tasks: 1,
        first: "twin-lda-fold0".into(),
        reason: "expected two materials, found one".into(),
    }];
    assert!(
        page(&summary)
            .contains("<code>lda</code>, first <code>twin-lda-fold0</code>: expected two")
    );
    assert!(
        of_study(&fake::empty())
            .0
            .contains("Nothing has been measured yet.")
    );
}

/// A row of a study: measure, method, setting, shots, sweeps, mean.
type Found = (
    Measure,
    &'static str,
    &'static str,
    Option<usize>,
    Option<usize>,
    f64,
);

fn study(question: &str, found: &[Found]) -> String {
    let mut summary = fake::study();
    summary.question = toml::from_str(question).unwrap();
    let template = summary.rows[0].clone();
    summary.rows = found
        .iter()
        .map(|&(measure, method, setting, shots, sweeps, mean)| {
            let mut row = template.clone();
            (row.measure, row.shots, row.sweeps) = (measure, shots, sweeps);
            (row.method, row.setting) = (method.into(), setting.into());
            row.statistic = crate::Statistic::of(vec![mean], 0.0);
            row
        })
        .collect();
    let page = of_study(&summary).into_string();
    assert!(
        page.contains("95\u{a0}% interval: none, since there is one task only"),
        "{page}"
    );
    page.replace('\u{a0}', " ").replace("</span>", "")
}

#[test]
fn the_headline_of_nshot_is_its_best_method() {
    use Measure::*;
    let nshot = study(
        "kind='nshot'\nshots=[1, 5]\nnew_materials=4",
        &[
            (Accuracy, "nk", "", Some(1), None, 0.3),
            (Accuracy, "ol", "", Some(1), None, 0.7),
            (Accuracy, "lda", "", Some(1), None, 0.75),
            (Accuracy, "lda", "", Some(5), None, 0.9),
        ],
    );
    assert!(nshot.contains("<strong>75.0 %</strong> of sweeps recognised after one sweep of each of 4 new materials, by lda"), "{nshot}");
    assert!(
        nshot.contains("A network from scratch reaches 30.0 %, guessing 25.0 %."),
        "{nshot}"
    );
}

#[test]
fn the_headline_of_unknown_is_its_best_score() {
    use Measure::*;
    let unknown = study(
        "kind='unknown'",
        &[
            (Auroc, "energy", "", None, Some(1), 0.8),
            (Auroc, "whitened distance", "", None, Some(1), 0.9),
            (Auroc, "energy", "", None, Some(3), 0.99),
            (Detected, "whitened distance", "", None, Some(1), 0.6),
            (FalseAlarms, "whitened distance", "", None, Some(1), 0.07),
        ],
    );
    assert!(
        unknown.contains("<strong>90.0 %</strong> AUROC of whitened distance over one sweep"),
        "{unknown}"
    );
    assert!(
        unknown.contains(
            "it detects 60.0 % of the unknown sweeps and rejects 7.0 % of the known ones."
        ),
        "{unknown}"
    );
}

#[test]
fn the_headline_of_sequential_is_the_earliest_sufficient_rule() {
    use Measure::*;
    let sequential = study(
        "kind='sequential'",
        &[
            (Accuracy, "plain", "until 0.9", None, None, 0.90),
            (MeanSweeps, "plain", "until 0.9", None, None, 1.4),
            (Accuracy, "plain", "until 0.99", None, None, 0.96),
            (MeanSweeps, "plain", "until 0.99", None, None, 2.1),
            (Accuracy, "plain", "until 0.999", None, None, 0.97),
            (MeanSweeps, "plain", "until 0.999", None, None, 2.9),
            (Accuracy, "plain", "fixed 1", None, None, 0.85),
            (Accuracy, "plain", "fixed 3", None, None, 0.95),
        ],
    );
    assert!(sequential.contains("<strong>96.0 %</strong> of decisions correct after 2.1 sweeps on average, rule: until 0.99"), "{sequential}");
    assert!(
        sequential.contains("Three fixed sweeps reach 95.0 %, a single one 85.0 %."),
        "{sequential}"
    );
}

#[test]
fn the_headline_of_enrolment_is_the_new_material() {
    use Measure::*;
    let enrolment = study(
        "kind='enrolment'\nshots=[1, 5]",
        &[
            (NewMaterial, "knowledge prior", "", Some(1), None, 0.5),
            (NewMaterial, "knowledge prior", "", Some(5), None, 0.8),
            (KnownBefore, "knowledge prior", "", Some(5), None, 0.85),
            (KnownAfter, "knowledge prior", "", Some(5), None, 0.84),
        ],
    );
    assert!(
        enrolment.contains(
            "<strong>80.0 %</strong> of sweeps of a new material recognised after 5 sweeps of it"
        ),
        "{enrolment}"
    );
    assert!(
        enrolment.contains("changes from 85.0 % to 84.0 %."),
        "{enrolment}"
    );
}

#[test]
fn the_headline_of_differentiate_is_all_pairs() {
    use Measure::*;
    let differentiate = study(
        "kind='differentiate'",
        &[
            (Accuracy, "siamese", "all pairs", None, Some(1), 0.9),
            (Accuracy, "threshold", "all pairs", None, Some(1), 0.93),
            (Accuracy, "threshold", "hard pairs", None, Some(1), 0.77),
            (Accuracy, "threshold", "all pairs", None, Some(3), 0.97),
        ],
    );
    assert!(differentiate.contains("<strong>93.0 %</strong> of pairs classified correctly as the same or different material, from one sweep of each (threshold)"), "{differentiate}");
    assert!(
        differentiate
            .contains("Of the hardest pairs it classifies 77.0 % correctly; guessing, 50.0 %."),
        "{differentiate}"
    );
}

#[test]
fn the_headline_of_feature_maps_is_the_purity() {
    use Measure::*;
    let maps = study(
        "kind='feature-maps'",
        &[
            (
                Purity,
                "input",
                "hard materials, whole space",
                None,
                None,
                0.4,
            ),
            (
                Purity,
                "embedding",
                "hard materials, whole space",
                None,
                None,
                0.8,
            ),
            (
                Purity,
                "embedding",
                "hard materials, plane",
                None,
                None,
                0.9,
            ),
        ],
    );
    assert!(
        maps.contains(
            "<strong>80.0 %</strong> of the nearest neighbours in the network's features"
        ),
        "{maps}"
    );
    assert!(
        maps.contains("In the raw digits it is 40.0 %, by chance about 16.7 %."),
        "{maps}"
    );
}
