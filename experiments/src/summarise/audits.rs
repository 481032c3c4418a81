//! Audit of a data set: random folds compared with a left-out block and with probes.

use tactnet_pipeline::MeanRemoval;

use crate::audit::{Audit, LevelShare, TOO_WELL};
use crate::data_probes::DataProbes;
use crate::phrases::rank;
use crate::scored::Scored;

/// Returns one audit for each data set and treatment of levels.
///
/// - `probes`: probes of the data sets that need no training
pub(crate) fn audits(rows: &[Scored<'_>], probes: &[DataProbes]) -> Vec<Audit> {
    let mut keys: Vec<(&str, MeanRemoval, usize)> = rows
        .iter()
        .map(|row| (row.data.as_str(), row.levels, row.steps))
        .collect();
    keys.sort_by_key(|(data, levels, steps)| (*data, levels.name(), *steps));
    keys.dedup();
    keys.into_iter()
        .filter_map(|(data, levels, steps)| {
            let own: Vec<&Scored<'_>> = rows
                .iter()
                .filter(|row| row.data == data && row.levels == levels && row.steps == steps)
                .collect();
            // They see whole sweeps with their levels.
            let is_own = |of: &&DataProbes| of.data.split(", first ").next() == Some(data);
            let probes = probes.iter().find(is_own).filter(|_| levels.is_none());
            audit(data, levels, steps, &own, probes)
        })
        .collect()
}

fn audit(
    data: &str,
    levels: MeanRemoval,
    steps: usize,
    rows: &[&Scored<'_>],
    of_data: Option<&DataProbes>,
) -> Option<Audit> {
    let by_block = |row: &&&Scored<'_>| row.split_kind.holds_out_blocks();
    // Random folds or the author's split, evaluated on test sweeps.
    let usual = |row: &&&Scored<'_>| !by_block(row) && row.inner.is_none();
    let contenders = || rows.iter().filter(|row| !row.probe && row.shots.is_none());
    let most = contenders()
        .filter(usual)
        .map(|row| rank(row.one_sweep.mean))
        .max();
    let mut most_accurate = contenders()
        .filter(usual)
        .filter(|row| Some(rank(row.one_sweep.mean)) == most);
    let best = most_accurate.next();
    let tied: Vec<String> = most_accurate.map(|row| row.name()).collect();
    let split = &best.unwrap_or(&rows[0]).split;
    let probe = |name: &str| {
        rows.iter()
            .find(|row| row.probe && row.split == *split && row.model.contains(name))
    };
    let block_out = best.and_then(|best| {
        contenders()
            .filter(by_block)
            .find(|row| row.model == best.model && row.prediction == best.prediction)
            .map(|row| row.one_sweep.mean)
    });
    let (means, permuted) = (probe("means"), probe("permuted"));
    let (first, last) = (probe("first frame"), probe("last frame"));
    let probes = [means, permuted, first, last];
    if probes.iter().all(Option::is_none) && block_out.is_none() && of_data.is_none() {
        return None;
    }
    let chance = rows[0].guessing();
    let guessing = permuted.map(|row| guessing(row));
    let binomial = (chance * (1.0 - chance) / rows[0].n_test as f64).sqrt();
    let mut audit = Audit {
        data: format!("{data}, levels {}, {steps} steps", levels.name()),
        chance,
        permuted_chance: guessing.map(|(chance, _)| chance),
        best: best.map(|row| (row.model_name(), row.one_sweep.mean)),
        tied,
        block_out,
        means: means
            .filter(|_| levels.is_none())
            .map(|row| row.one_sweep.mean),
        first_frame: first.map(|row| row.one_sweep.mean),
        last_frame: last.map(|row| row.one_sweep.mean),
        recording_order: of_data.and_then(|of| of.recording_order),
        sweep_length: of_data.and_then(|of| of.sweep_length),
        block_identity: of_data.and_then(|of| of.block_identity),
        permuted: permuted.map(|row| row.one_sweep.mean),
        chance_sigma: guessing.map_or(binomial, |(_, sigma)| sigma),
        verdict: String::new(),
    };
    audit.verdict = verdict(&audit);
    Some(audit)
}

/// Returns accuracy and standard deviation of random predictions that name each material as often as those of `row`.
///
/// Each sweep counts once, independent of the number of repeats. Sweeps of one fold depend on each other through
/// training, so the binomial deviation is multiplied by 1.2 (simulated with ridge and nearest neighbours: 1.1 to 1.2).
fn guessing(row: &Scored<'_>) -> (f64, f64) {
    let all: usize = row.confusion.iter().flatten().sum();
    let chance: f64 = (0..row.confusion.len())
        .map(|label| {
            let truly: usize = row.confusion[label].iter().sum();
            let predicted: usize = row.confusion.iter().map(|counts| counts[label]).sum();
            truly as f64 / all as f64 * (predicted as f64 / all as f64)
        })
        .sum();
    let sweeps = all as f64 / row.repeats() as f64;
    (chance, 1.2 * (chance * (1.0 - chance) / sweeps).sqrt())
}

fn verdict(audit: &Audit) -> String {
    let percent = |share: f64| format!("{:.1} %", 100.0 * share);
    let mut sentences = Vec::new();
    if let Some(permuted) = audit.permuted {
        let guessed = audit.guessed();
        let away = (permuted - guessed) / audit.chance_sigma;
        sentences.push(if audit.leak().is_none() {
            format!(
                "With permuted labels MiniRocket scores chance: {}, where random guesses that name each material as often as it does would score {} \
                 ({away:+.1} standard deviations). No sign that labels of test sweeps reach training; {} would have been one.",
                percent(permuted),
                percent(guessed),
                percent(guessed + TOO_WELL * audit.chance_sigma)
            )
        } else {
            format!(
                "With permuted labels MiniRocket scores {} where chance is {} ({away:+.1} standard deviations): look for test sweeps that leak into training \
                 before using any other result of this data set. Another seed, with another permutation, shows if it is chance.",
                percent(permuted),
                percent(guessed)
            )
        });
    }
    if let (Some(means), Some((model, best))) = (audit.means, &audit.best) {
        let judged = match audit.level_share(*best) {
            Some(LevelShare::Mostly) => "so a high score here says little about texture",
            Some(LevelShare::Partly) => "so part of every score here is level, not texture",
            // For example with a single material.
            _ if *best <= audit.chance => "and neither more than chance",
            _ => "so levels alone explain little",
        };
        sentences.push(format!(
            "Taxel means alone recognise {}, {model} {}: {judged}.",
            percent(means),
            percent(*best)
        ));
    }
    if let Some((model, best)) = &audit.best
        && let Some((which, alone)) = audit.telling_probe(*best)
    {
        sentences.push(format!(
            "The {which} alone recognises {}, {model} {}: the motion tells little more.",
            percent(alone),
            percent(*best)
        ));
    }
    if let Some(blocks) = audit.alike_blocks() {
        sentences.push(format!(
            "Taxel means recognise the recording block of {} of the sweeps among those of their material, guessing {}: sweeps of one block \
             are alike, so random folds overstate the accuracy on a new recording.",
            percent(blocks.accuracy),
            percent(blocks.guessing)
        ));
    }
    if let (Some(block_out), Some((model, best))) = (audit.block_out, &audit.best) {
        sentences.push(format!(
            "On recording blocks it has never seen, {model} scores {} instead of {}: {:.1} points less. Sweeps of the same block on both sides \
             of random folds explain that, but for the unequal numbers of training sweeps and the choice of the best model by its random folds.",
            percent(block_out),
            percent(*best),
            100.0 * (best - block_out)
        ));
    }
    sentences.join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::BlockIdentity;

    #[test]
    fn the_verdict_names_what_is_wrong() {
        let mut audit = Audit {
            data: "x".into(),
            chance: 0.05,
            permuted_chance: None,
            best: Some(("svm-h".into(), 0.95)),
            tied: Vec::new(),
            block_out: Some(0.6),
            means: Some(0.9),
            first_frame: Some(0.93),
            last_frame: None,
            recording_order: None,
            sweep_length: None,
            block_identity: None,
            permuted: Some(0.055),
            chance_sigma: 0.01,
            verdict: String::new(),
        };
        let text = verdict(&audit);
        assert!(
            text.contains("scores chance") && text.contains("little about texture"),
            "{text}"
        );
        assert!(text.contains("35.0 points"), "{text}");
        assert!(
            text.contains("first frame alone recognises 93.0 %"),
            "{text}"
        );
        assert!(!text.contains("recording block of"), "{text}");
        audit.recording_order = Some(0.94);
        audit.block_identity = Some(BlockIdentity {
            accuracy: 0.9,
            guessing: 0.1,
        });
        let text = verdict(&audit);
        assert!(
            text.contains(
                "The order of the sweeps in the file alone recognises 94.0 %, svm-h 95.0 %"
            ),
            "{text}"
        );
        assert!(
            text.contains("recognise the recording block of 90.0 % of the sweeps among those of their material, guessing 10.0 %"),
            "{text}"
        );
        audit.permuted = Some(0.2);
        assert!(verdict(&audit).contains("leak into training before"));
        // Guesses on few test sweeps may be correct slightly less often than one over the number of materials.
        audit.permuted_chance = Some(0.19);
        let text = verdict(&audit);
        assert!(
            text.contains("scores chance: 20.0 %, where random guesses")
                && text.contains("would score 19.0 % (+1.0 standard"),
            "{text}"
        );
        assert_eq!(audit.chance, 0.05);
    }
}
