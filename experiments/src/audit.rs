//! What a data set gives away: random folds beside a block left out beside the probes.

use std::collections::BTreeSet;

use crate::{Audit, Row};

/// One audit for each data set and treatment of levels.
pub(crate) fn audits(rows: &[Row]) -> Vec<Audit> {
    let keys: BTreeSet<(&str, &str, usize)> = rows
        .iter()
        .map(|row| (row.data.as_str(), row.levels.as_str(), row.steps))
        .collect();
    keys.into_iter()
        .filter_map(|(data, levels, steps)| {
            let own: Vec<&Row> = rows
                .iter()
                .filter(|row| row.data == data && row.levels == levels && row.steps == steps)
                .collect();
            audit(data, levels, steps, &own)
        })
        .collect()
}

fn audit(data: &str, levels: &str, steps: usize, rows: &[&Row]) -> Option<Audit> {
    let by_block = |row: &&&Row| row.split.contains("block");
    let contenders = || rows.iter().filter(|row| !row.probe);
    let best = contenders()
        .filter(|row| !by_block(row))
        .max_by(|a, b| a.one_sweep.mean.total_cmp(&b.one_sweep.mean));
    let probe = |name: &str| {
        let row = rows
            .iter()
            .find(|row| row.probe && !by_block(row) && row.model.contains(name));
        row.map(|row| (row.one_sweep.mean, row.n_test * row.one_sweep.folds.len()))
    };
    let block_out = best.and_then(|best| {
        contenders()
            .filter(by_block)
            .find(|row| row.model == best.model && row.prediction == best.prediction)
            .map(|row| row.one_sweep.mean)
    });
    let (means, permuted) = (probe("means"), probe("permuted"));
    if means.is_none() && permuted.is_none() && block_out.is_none() {
        return None;
    }
    let chance = 1.0 / rows[0].materials.len() as f64;
    let tested = permuted.map_or(rows[0].n_test, |(_, tested)| tested) as f64;
    let chance_sigma = (chance * (1.0 - chance) / tested).sqrt();
    let mut audit = Audit {
        data: format!("{data}, levels {levels}, {steps} steps"),
        chance,
        best: best.map(|row| (row.model.clone(), row.one_sweep.mean)),
        block_out,
        means: means.map(|(mean, _)| mean),
        permuted: permuted.map(|(mean, _)| mean),
        chance_sigma,
        verdict: String::new(),
    };
    audit.verdict = verdict(&audit);
    Some(audit)
}

fn verdict(audit: &Audit) -> String {
    let percent = |share: f64| format!("{:.1} %", 100.0 * share);
    let mut sentences = Vec::new();
    if let Some(permuted) = audit.permuted {
        let away = (permuted - audit.chance) / audit.chance_sigma;
        sentences.push(if away.abs() <= 2.0 {
            format!(
                "With permuted labels the score is chance ({} against {}, {away:+.1} sigma): no test sweep leaks into training.",
                percent(permuted),
                percent(audit.chance)
            )
        } else {
            format!(
                "With permuted labels the score is {} where chance is {} ({away:+.1} sigma): more than two sigma off, so look for test \
                 sweeps that leak into training before trusting anything else here.",
                percent(permuted),
                percent(audit.chance)
            )
        });
    }
    if let (Some(means), Some((model, best))) = (audit.means, &audit.best) {
        let share = (means - audit.chance) / (best - audit.chance).max(1e-9);
        let judged = if share > 0.8 {
            "so a high score here says little about texture"
        } else if share > 0.3 {
            "so part of every score here is level, not texture"
        } else {
            "so levels alone explain little"
        };
        sentences.push(format!(
            "Taxel means alone recognise {}, {model} {}: {judged}.",
            percent(means),
            percent(*best)
        ));
    }
    if let (Some(block_out), Some((model, best))) = (audit.block_out, &audit.best) {
        sentences.push(format!(
            "On recording blocks it has never seen, {model} scores {} instead of {}: the difference of {:.1} points is what random folds \
             owe to sweeps of the same block on both sides.",
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

    #[test]
    fn the_verdict_names_what_is_wrong() {
        let mut audit = Audit {
            data: "x".into(),
            chance: 0.05,
            best: Some(("svm-h".into(), 0.95)),
            block_out: Some(0.6),
            means: Some(0.9),
            permuted: Some(0.055),
            chance_sigma: 0.01,
            verdict: String::new(),
        };
        let text = verdict(&audit);
        assert!(
            text.contains("the score is chance") && text.contains("little about texture"),
            "{text}"
        );
        assert!(text.contains("35.0 points"), "{text}");
        audit.permuted = Some(0.2);
        assert!(verdict(&audit).contains("leak into training before"));
    }
}
