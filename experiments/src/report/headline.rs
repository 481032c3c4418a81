//! What the page says first: the best result of every data set with its interval, and the one sentence that qualifies it.

use tactnet_plot::escape;

use super::data_set::{DataSet, split_name};
use super::text::prose;
use crate::interval_note::interval_note;
use crate::questions::{Headline, LevelShare, Scored, in_percent, interval, listed};
use crate::{Audit, Row, Summary};

/// Data set and headline.
type Placed = (String, Headline);

/// The headlines of a cross-validation.
pub(super) fn of_contenders(summary: &Summary, sets: &[DataSet]) -> String {
    let found: Vec<Placed> = sets
        .iter()
        .filter_map(|set| Some((set.heading(), contender(summary, set, set.best()?))))
        .collect();
    drawn(summary, &found, "No model has ended yet.")
}

/// The headlines of a study.
pub(super) fn of_study(study: &Summary) -> String {
    let question = study.question.ask();
    let found: Vec<Placed> = sets_of_rows(&study.rows)
        .into_iter()
        .filter_map(|rows| {
            let first = *rows.first()?;
            let place = format!("{}, levels {}", first.data, first.levels.name());
            Some((place, question.headline(&rows)?))
        })
        .collect();
    drawn(study, &found, "Nothing has been measured yet.")
}

/// Rows of one data set, levels, steps and network, in the order of the summary.
fn sets_of_rows(rows: &[Row]) -> Vec<Vec<&Row>> {
    let set_of = |row: &Row| (row.data.clone(), row.levels, row.steps, row.model.clone());
    let mut sets: Vec<Vec<&Row>> = Vec::new();
    for row in rows {
        match sets.iter_mut().find(|set| set_of(set[0]) == set_of(row)) {
            Some(set) => set.push(row),
            None => sets.push(vec![row]),
        }
    }
    sets
}

fn drawn(summary: &Summary, headlines: &[Placed], none: &str) -> String {
    let unfinished = if summary.tasks_done < summary.tasks {
        format!(
            "<p class=\"warning\"><strong>Unfinished:</strong> {} of {} tasks are done. Every number comes from those alone and \
             will change.</p>\n",
            summary.tasks_done, summary.tasks
        )
    } else {
        String::new()
    };
    let many = if headlines.len() > 1 { " many" } else { "" };
    let parts: String = headlines
        .iter()
        .map(|(place, headline)| {
            let note = headline.interval_note.as_deref();
            let (interval, meaning) = match &headline.interval {
                Some(interval) => (
                    format!(" {interval}"),
                    note.map_or("in brackets the 95\u{a0}% interval".into(), |note| {
                        format!("in brackets the 95\u{a0}% interval, {note}")
                    }),
                ),
                None => (
                    String::new(),
                    format!("95\u{a0}% interval: {}", note.unwrap_or("none")),
                ),
            };
            format!(
                "<div>\n<p class=\"lead\"><span class=\"result\"><strong>{}</strong>{interval}</span> {}</p>\n<p class=\"qualifier\">{}</p>\n\
                 <p class=\"where\">{}; {meaning}</p>\n</div>\n",
                headline.value,
                prose(&headline.says),
                prose(&headline.qualifier),
                escape(place)
            )
        })
        .collect();
    let parts = if parts.is_empty() {
        format!("<p class=\"lead\">{none}</p>\n")
    } else {
        parts
    };
    format!(
        "<div class=\"headline{many}\" role=\"group\" aria-label=\"Headline\">\n{parts}</div>\n{unfinished}"
    )
}

fn contender(summary: &Summary, set: &DataSet, best: &Scored<'_>) -> Headline {
    let name = format!("{}, {} steps", set.heading(), best.steps);
    let audit = summary.audits.iter().find(|audit| audit.data == name);
    let three = best.three_sweeps.map_or(String::new(), |three| {
        format!("; three sweeps fused: {}", in_percent(three.mean))
    });
    let split = if set.rows.iter().any(|row| row.split != best.split) {
        String::new()
    } else {
        format!(" ({})", split_name(best.split))
    };
    let tied = match set.tied().as_slice() {
        [] => String::new(),
        others => format!(", and as many by {}", listed(others)),
    };
    Headline {
        value: in_percent(best.one_sweep.mean),
        interval: best.one_sweep.ci95.map(interval),
        interval_note: interval_note(best.one_sweep, "fold"),
        says: format!(
            "of single sweeps of {} materials recognised by {}{split}{tied}{three}",
            best.materials.len(),
            set.name(best)
        ),
        qualifier: format!(
            "{}{}{}",
            qualifier(audit, best),
            network(set, best),
            others(summary, set, best)
        ),
    }
}

/// Error rate of the tests whether other models are distinguishable from the best one.
const ERROR_RATE: f64 = 0.05;

/// Returns which contenders cannot be told from the best one by the paired test, after Holm's correction; empty where none was compared.
fn others(summary: &Summary, set: &DataSet, best: &Scored<'_>) -> String {
    let contender_of = |key: &str| summary.row(key).map(|row| row.contender.as_str());
    let p_beside = |other: &Scored<'_>| {
        summary.comparisons.iter().find_map(|comparison| {
            let pair = [&comparison.first, &comparison.second].map(|key| contender_of(key));
            let both = [Some(best.key), Some(other.key)];
            let is_theirs = pair == both || pair == [both[1], both[0]];
            comparison.p_holm.filter(|_| is_theirs)
        })
    };
    let compared: Vec<(&Scored<'_>, f64)> = set
        .contenders()
        .into_iter()
        .filter(|row| row.key != best.key)
        .filter_map(|row| Some((row, p_beside(row)?)))
        .collect();
    let alike: Vec<String> = compared
        .iter()
        .filter(|(_, p)| *p > ERROR_RATE)
        .map(|(row, _)| set.name(row))
        .collect();
    let (test, best) = (
        "the corrected paired t-test at 5\u{a0}% (Holm)",
        set.name(best),
    );
    match (alike.as_slice(), compared.len()) {
        (_, 0) => String::new(),
        ([], 1) => format!(" The other model is distinguishable from {best} by {test}."),
        ([], _) => format!(" Every other model is distinguishable from {best} by {test}."),
        (alike, all) if alike.len() == all => {
            format!(" No other model is distinguishable from {best} by {test}.")
        }
        (alike, _) => format!(
            " Not distinguishable from {best} by {test}: {}.",
            listed(alike)
        ),
    }
}

/// Returns how the best network did where another model is best, and how long it was trained where that was short.
fn network(set: &DataSet, best: &Scored<'_>) -> String {
    let trained = |row: &Scored<'_>| {
        row.few_steps()
            .map(|steps| format!("{} training steps a fold, which are few", steps.count()))
    };
    if best.training.is_some() {
        return trained(best).map_or(String::new(), |few| format!(" It had {few}."));
    }
    let rows = set.contenders();
    let Some(row) = rows.iter().find(|row| row.training.is_some()) else {
        return String::new();
    };
    let few = trained(row).map_or(String::new(), |few| format!(", with {few}"));
    let accuracy = in_percent(row.one_sweep.mean);
    format!(" {} recognises {accuracy}{few}.", set.name(row))
}

/// What weighs most against the accuracy of the best contender.
fn qualifier(audit: Option<&Audit>, best: &Scored<'_>) -> String {
    let accuracy = best.one_sweep.mean;
    if best.inner.is_some() {
        return "Judged by sweeps of the inner split, by which it was also chosen: no test sweep was read.".into();
    }
    let chance = 1.0 / best.materials.len().max(1) as f64;
    let guessing = in_percent(audit.map_or(chance, |audit| audit.chance));
    let Some(audit) = audit else {
        return format!("Guessing recognises {guessing}.");
    };
    if let Some(permuted) = audit.leak() {
        return format!(
            "With permuted labels a classifier still scores {}, which guessing hardly does: look for test sweeps that leak into \
             training before trusting this, and see whether another seed (`--set seed=2`) says the same.",
            in_percent(permuted)
        );
    }
    let levels = audit.means.map(in_percent).unwrap_or_default();
    let blocks = audit.block_out.map(|block_out| {
        format!(
            "With a recording block left out it recognises {}.",
            in_percent(block_out)
        )
    });
    match (audit.level_share(accuracy), blocks) {
        (Some(LevelShare::Mostly), _) => {
            format!("Levels alone recognise {levels}, so this says little about texture.")
        }
        (Some(LevelShare::Partly), _) => format!(
            "Levels alone recognise {levels}, guessing {guessing}: part of this is level, not texture."
        ),
        (_, Some(blocks)) => blocks,
        (Some(LevelShare::Little), None) => {
            format!("Levels alone recognise {levels}, guessing {guessing}.")
        }
        (None, None) => format!("Guessing recognises {guessing}."),
    }
}

#[cfg(test)]
mod tests {
    use super::super::data_set::data_sets;
    use super::super::fake;
    use super::*;
    use tactnet_pipeline::TrainingSteps;

    use crate::questions::scored;
    use crate::{Comparison, Measure};

    fn page(summary: &Summary) -> String {
        let rows = scored(summary);
        of_contenders(summary, &data_sets(&rows))
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
            permuted,
            chance_sigma: 0.01,
            verdict: String::new(),
        }
    }

    #[test]
    fn the_best_result_comes_with_its_interval() {
        let page = page(&fake::tactmat());
        assert!(
            page.contains(
                "of single sweeps of 36 materials recognised by net, MC dropout (k-fold)"
            )
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
        // The audit of another data set says nothing of this one.
        summary.audits[0].data = "other, levels kept, 1000 steps".into();
        assert!(page(&summary).contains("Guessing recognises"));
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
        assert!(page(&summary).contains("No model has ended yet."));
    }

    #[test]
    fn an_unfinished_run_says_so_beside_its_headline() {
        let mut summary = fake::tactmat();
        assert!(!page(&summary).contains("Unfinished"));
        summary.tasks_done = 3;
        assert!(page(&summary).contains("<strong>Unfinished:</strong> 3 of 4 tasks"));
        assert!(of_study(&fake::empty()).contains("Nothing has been measured yet."));
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
        let page = of_study(&summary);
        assert!(
            page.contains("95\u{a0}% interval: none, since there is one task only"),
            "{page}"
        );
        page.replace('\u{a0}', " ").replace("</span>", "")
    }

    #[test]
    fn every_study_begins_with_its_result_and_what_it_is_to_be_judged_by() {
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
            nshot.contains("without pre-knowledge reaches 30.0 %, guessing 25.0 %."),
            "{nshot}"
        );
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
                "it finds 60.0 % of the unknown sweeps and calls 7.0 % of the known ones unknown."
            ),
            "{unknown}"
        );
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
        assert!(sequential.contains("<strong>96.0 %</strong> of decisions right after 2.1 sweeps on average, sweeping until 0.99"), "{sequential}");
        assert!(
            sequential.contains("Three sweeps in any case reach 95.0 %, one alone 85.0 %."),
            "{sequential}"
        );
        let enrolment = study(
            "kind='enrolment'\nshots=[1, 5]",
            &[
                (NewMaterial, "knowledge prior", "", Some(1), None, 0.5),
                (NewMaterial, "knowledge prior", "", Some(5), None, 0.8),
                (KnownBefore, "knowledge prior", "", Some(5), None, 0.85),
                (KnownAfter, "knowledge prior", "", Some(5), None, 0.84),
            ],
        );
        assert!(enrolment.contains("<strong>80.0 %</strong> of sweeps of a new material recognised after 5 sweeps of it"), "{enrolment}");
        assert!(
            enrolment.contains("goes from 85.0 % to 84.0 % by it."),
            "{enrolment}"
        );
        let differentiate = study(
            "kind='differentiate'",
            &[
                (Accuracy, "siamese", "all pairs", None, Some(1), 0.9),
                (Accuracy, "threshold", "all pairs", None, Some(1), 0.93),
                (Accuracy, "threshold", "hard pairs", None, Some(1), 0.77),
                (Accuracy, "threshold", "all pairs", None, Some(3), 0.97),
            ],
        );
        assert!(differentiate.contains("<strong>93.0 %</strong> of pairs rightly called one material or two, from one sweep of each (threshold)"), "{differentiate}");
        assert!(
            differentiate
                .contains("hardest to tell apart it answers 77.0 % rightly; guessing, 50.0 %."),
            "{differentiate}"
        );
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
                "<strong>80.0 %</strong> of the nearest neighbours in the network&#39;s features"
            ),
            "{maps}"
        );
        assert!(
            maps.contains("Among the raw digits it is 40.0 %, by chance about 16.7 %."),
            "{maps}"
        );
    }
}
