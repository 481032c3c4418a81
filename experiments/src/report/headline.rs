//! The headline of a report: the best result of each data set with its interval, and a sentence that qualifies it.

use maud::{Markup, html};

use super::data_set::{DataSet, split_name};
use super::text::prose;
use crate::audit::LevelShare;
use crate::interval_note::interval_note;
use crate::phrases::{in_percent, interval, listed};
use crate::questions::Headline;
use crate::scored::Scored;
use crate::{Audit, Row, Summary};

/// Data set and headline.
pub(super) type Placed = (String, Headline);

/// Returns the headlines of a cross-validation.
pub(super) fn of_contenders(summary: &Summary, sets: &[DataSet]) -> Markup {
    let found: Vec<Placed> = sets
        .iter()
        .filter_map(|set| Some((set.heading(), contender(summary, set, set.best()?))))
        .collect();
    drawn(summary, &found, "No model has finished yet.")
}

/// Returns the headline of a comparison over several data sets.
pub(super) fn of_benchmark(summary: &Summary, headline: Placed) -> Markup {
    drawn(summary, &[headline], "")
}

/// Returns the headlines of a study.
pub(super) fn of_study(study: &Summary) -> Markup {
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

/// Groups rows by data set, levels, steps and network, in the order of the summary.
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

fn drawn(summary: &Summary, headlines: &[Placed], none: &str) -> Markup {
    html! {
        div.headline.many[headlines.len() > 1] role="group" aria-label="Headline" {
            @for (place, headline) in headlines { (part(place, headline)) }
            @if headlines.is_empty() { p.lead { (none) } }
        }
        @if summary.tasks_done < summary.tasks {
            p.warning {
                strong { "Unfinished:" } " " (summary.tasks_done) " of " (summary.tasks) " tasks are done; all numbers come from "
                "these tasks"
                @match summary.tasks_running {
                    0 => { ". No task is running; the same command continues." }
                    running => { " and will change: " (running) " are running." }
                }
            }
        }
        @for warning in &summary.data_warnings {
            p.warning { strong { "Beware:" } " " (warning) }
        }
        @for failed in &summary.failed {
            p.warning {
                strong { "Failed:" } " " (failed.tasks) " of " (summary.tasks) " tasks, model " code { (failed.model) } ", first "
                code { (failed.first) } ": " (failed.reason)
            }
        }
    }
}

fn part(place: &str, headline: &Headline) -> Markup {
    let note = headline.interval_note.as_deref();
    html! {
        div {
            p.lead {
                span.result {
                    strong { (headline.value) }
                    @if let Some(interval) = &headline.interval { " " (interval) }
                }
                " " (prose(&headline.says))
            }
            p.qualifier { (prose(&headline.qualifier)) }
            p.where {
                (place) "; "
                @match (&headline.interval, note) {
                    (Some(_), None) => "in brackets the 95\u{a0}% interval",
                    (Some(_), Some(note)) => { "in brackets the 95\u{a0}% interval, " (note) }
                    (None, note) => { "95\u{a0}% interval: " (note.unwrap_or("none")) }
                }
            }
        }
    }
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
        format!(" ({})", split_name(&best.split))
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
            "{}{}{}{}{}",
            same_recordings(set, best),
            unconfounded(best),
            qualifier(set, audit, best),
            network(set, best),
            others(summary, set, best)
        ),
    }
}

/// Returns a sentence on random folds, if the accuracy is that on held-out blocks and both were measured.
fn same_recordings(set: &DataSet, best: &Scored<'_>) -> String {
    let random = set
        .on_random_folds(best)
        .filter(|_| best.split_kind.holds_out_blocks());
    random.map_or(String::new(), |random| {
        format!(
            "With sweeps of the same recordings in training it would be {}. ",
            in_percent(random)
        )
    })
}

/// Returns a sentence on the materials that do not coincide with recording blocks, if others do.
fn unconfounded(best: &Scored<'_>) -> String {
    let Some(found) = &best.confounded else {
        return String::new();
    };
    let (confounded, materials) = (found.confounded.len(), found.materials);
    match found.unconfounded_one_sweep {
        _ if found.n_confounded == 0 => format!(
            "Only {} of {materials} materials were tested: the others were recorded in one session each. ",
            materials - confounded
        ),
        Some(accuracy) => format!(
            "On the materials that share their sessions with others ({}) it is {} {}. ",
            listed(&found.unconfounded),
            in_percent(accuracy.mean),
            interval([accuracy.ci95_low, accuracy.ci95_high])
        ),
        // The warning about the data says it.
        None => String::new(),
    }
}

/// Returns the name and accuracy of a probe on the same folds that is nearly as accurate as the best contender.
fn telling_probe(set: &DataSet, audit: &Audit, best: &Scored<'_>) -> Option<(&'static str, f64)> {
    let on_same_folds = |probe: &'static str| {
        let rows = set
            .rows
            .iter()
            .filter(|row| row.probe && row.steps == best.steps);
        let mut rows = rows.filter(|row| row.split == best.split && row.model.contains(probe));
        (probe, rows.next().map(|row| row.one_sweep.mean))
    };
    let is_random = !best.split_kind.holds_out_blocks();
    let order = audit.recording_order.filter(|_| is_random);
    let probes = [
        on_same_folds("first frame"),
        on_same_folds("last frame"),
        ("order of the sweeps in the file", order),
        ("length of the sweeps", audit.sweep_length),
    ];
    audit.nearly_as_accurate(best.one_sweep.mean, probes)
}

/// Significance level for differences from the best model.
const ERROR_RATE: f64 = 0.05;

/// Returns a sentence on the contenders that the paired test, after Holm's correction, cannot distinguish from the
/// best one. Empty without comparisons.
fn others(summary: &Summary, set: &DataSet, best: &Scored<'_>) -> String {
    let contender_of = |key: &str| summary.row(key).map(|row| row.contender.as_str());
    let p_beside = |other: &Scored<'_>| {
        summary.comparisons.iter().find_map(|comparison| {
            let pair = [&comparison.first, &comparison.second].map(|key| contender_of(key));
            let both = [Some(best.key.as_str()), Some(other.key.as_str())];
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

/// Returns a sentence on the best network if another model is best, and on few training steps.
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

/// Returns the main qualification of the best contender's accuracy.
fn qualifier(set: &DataSet, audit: Option<&Audit>, best: &Scored<'_>) -> String {
    let accuracy = best.one_sweep.mean;
    if best.inner.is_some() {
        return "Evaluated on the inner split, which also selected it; no test sweep was read."
            .into();
    }
    let guessing = in_percent(audit.map_or_else(|| best.guessing(), |audit| audit.chance));
    let Some(audit) = audit else {
        return format!("Guessing recognises {guessing}.");
    };
    if let Some(permuted) = audit.leak() {
        return format!(
            "With permuted labels a classifier still scores {}, far above chance: look for test sweeps that leak into \
             training before using this result, and repeat it with another seed.",
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
    if let Some((which, alone)) = telling_probe(set, audit, best) {
        return format!(
            "The {which} alone gives {} (model: {}), so this says little about texture.",
            in_percent(alone),
            in_percent(accuracy)
        );
    }
    match (audit.level_share(accuracy), blocks) {
        (Some(LevelShare::Mostly), _) => {
            format!("Levels alone recognise {levels}, so this says little about texture.")
        }
        (Some(LevelShare::Partly), _) => format!(
            "Levels alone recognise {levels}, guessing {guessing}: part of this is level, not texture."
        ),
        (_, Some(blocks)) if !best.split_kind.holds_out_blocks() => blocks,
        (Some(LevelShare::Little), _) => {
            format!("Levels alone recognise {levels}, guessing {guessing}.")
        }
        (None, _) => format!("Guessing recognises {guessing}."),
    }
}

#[cfg(test)]
mod tests;
