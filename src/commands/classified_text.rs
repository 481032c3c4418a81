//! Predictions for sweeps as text: a table, warnings and hints.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use tactnet_models::argmax;
use tactnet_pipeline::{ClassifiedObject, ClassifiedSweep, ClassifiedSweeps, LikenessReport};

use crate::output::counted;

/// Maximum number of names in a message.
const MAX_NAMES: usize = 5;
/// Maximum number of sweeps in the table.
const MAX_ROWS: usize = 40;

/// Returns a table with the two most probable materials of each sweep, and a summary.
pub fn table(found: &ClassifiedSweeps) -> String {
    let likeness = found.likeness.as_ref().map(LikenessReport::text);
    let mut text = likeness.map_or_else(String::new, |verdict| format!("{verdict}\n"));
    text.push_str(&rows(found));
    text.push_str(&summary(found));
    if found.sweeps.iter().any(|sweep| sweep.named.is_some()) {
        text.push_str(&comparison_with_names(found));
    }
    if let Some(object) = &found.object {
        text.push_str(&object_line(found, object));
    }
    if let Some(caution) = &found.caution {
        let _ = write!(text, "\nwarning: {caution}");
    }
    text
}

fn rows(found: &ClassifiedSweeps) -> String {
    let listed = &found.sweeps[..found.sweeps.len().min(MAX_ROWS)];
    let widest = |texts: &mut dyn Iterator<Item = &str>, least: usize| {
        texts
            .map(|text| text.chars().count())
            .fold(least, usize::max)
    };
    let first = widest(&mut listed.iter().map(|sweep| sweep.sweep.as_str()), 5);
    let second = widest(&mut listed.iter().map(|sweep| sweep.material.as_str()), 8);
    let named = listed.iter().filter_map(|sweep| sweep.named.as_deref());
    let third = widest(&mut named.clone(), 5);
    let is_labelled = named.clone().next().is_some();
    let mut text = format!("{:first$}", "sweep");
    if is_labelled {
        let _ = write!(text, "  {:third$}", "named");
    }
    let _ = writeln!(text, "  {:second$}  probability  runner-up", "material");
    for sweep in listed {
        let (best, next) = two_largest(&sweep.probabilities);
        let _ = write!(text, "{:first$}", sweep.sweep);
        if is_labelled {
            let named = sweep.named.as_deref().unwrap_or_default();
            let _ = write!(text, "  {named:third$}");
        }
        let probability = 100.0 * sweep.probabilities[best];
        let _ = write!(text, "  {:second$}  {probability:>9.1} %", sweep.material);
        if let Some(next) = next {
            let probability = 100.0 * sweep.probabilities[next];
            let _ = write!(text, "  {} {probability:.1} %", found.materials.name(next));
        }
        if is_unknown(sweep) {
            text.push_str("  probably unknown");
        }
        if sweep.still {
            text.push_str("  no taxel ever changes");
        }
        text.push('\n');
    }
    if listed.len() < found.sweeps.len() {
        let more = found.sweeps.len() - listed.len();
        let _ = writeln!(text, "… and {more} more");
    }
    text
}

/// Returns the number of sweeps by predicted material.
fn summary(found: &ClassifiedSweeps) -> String {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for sweep in &found.sweeps {
        let predicted = match is_unknown(sweep) {
            true => "probably unknown",
            false => &sweep.material,
        };
        *counts.entry(predicted).or_default() += 1;
    }
    let mut counts: Vec<_> = counts.into_iter().collect();
    counts.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    let counts: Vec<String> = counts
        .into_iter()
        .map(|(predicted, count)| format!("{predicted} {count}"))
        .collect();
    let all = found.sweeps.len();
    let mut text = format!("{}: {}", counted(all, "sweep"), counts.join(", "));
    if is_calibrated(found) {
        let unknown = found.sweeps.iter().filter(|sweep| is_unknown(sweep));
        let _ = write!(text, "\nprobably unknown: {} of {all}", unknown.count());
    }
    text
}

/// Returns the accuracy on sweeps of known materials and the detection of others, by the materials that the file names.
fn comparison_with_names(found: &ClassifiedSweeps) -> String {
    let known: BTreeSet<&str> = found.materials.names().collect();
    let is_known = |sweep: &&ClassifiedSweep| {
        let named = sweep.named.as_deref();
        named.is_some_and(|named| known.contains(named))
    };
    let is_correct = |sweep: &&&ClassifiedSweep| {
        !is_unknown(sweep) && sweep.named.as_ref() == Some(&sweep.material)
    };
    let (known, unknown): (Vec<&ClassifiedSweep>, Vec<_>) = found.sweeps.iter().partition(is_known);
    let called_unknown =
        |sweeps: &[&ClassifiedSweep]| sweeps.iter().filter(|sweep| is_unknown(sweep)).count();
    let is_calibrated = is_calibrated(found);
    let mut text = String::new();
    if !known.is_empty() {
        let correct = known.iter().filter(is_correct).count();
        let all = known.len();
        let _ = write!(text, "\nknown materials: {correct} of {all} correct");
        if is_calibrated {
            let _ = write!(text, ", {} called unknown", called_unknown(&known));
        }
    }
    if !unknown.is_empty() {
        let all = unknown.len();
        let _ = match is_calibrated {
            true => write!(
                text,
                "\nunknown materials: {} of {all} detected",
                called_unknown(&unknown)
            ),
            false => write!(text, "\nunknown materials: {}", counted(all, "sweep")),
        };
    }
    text
}

fn object_line(found: &ClassifiedSweeps, object: &ClassifiedObject) -> String {
    let probability = 100.0 * object.probabilities[argmax(&object.probabilities)];
    let mut text = format!(
        "\nall {} as one object: {} with {probability:.1} %",
        object.sweeps, object.material
    );
    if object.unknown == Some(true) {
        text.push_str(", but probably unknown");
    }
    let all = found.sweeps.len();
    let alike = found
        .sweeps
        .iter()
        .filter(|sweep| sweep.material == object.material)
        .count();
    if 2 * alike < all {
        let _ = write!(
            text,
            "\nwarning: only {alike} of {all} sweeps are predicted as this material; check that all are of one object"
        );
    }
    text
}

/// Returns a warning that names the sweeps in which no taxel changes; `None` if there are none.
pub fn still(found: &ClassifiedSweeps) -> Option<String> {
    let still: BTreeSet<&str> = found
        .sweeps
        .iter()
        .filter(|sweep| sweep.still)
        .map(|sweep| sweep.sweep.as_str())
        .collect();
    (!still.is_empty()).then(|| {
        format!(
            "no taxel ever changes in sweep{} {}: such a prediction is meaningless",
            if still.len() == 1 { "" } else { "s" },
            listed(&still)
        )
    })
}

/// Returns a warning if the file names several materials for sweeps that count as one object.
pub fn not_one_object(found: &ClassifiedSweeps) -> Option<String> {
    let named: BTreeSet<&str> = names(found).collect();
    found.object.as_ref().filter(|_| named.len() > 1)?;
    Some(format!(
        "--one-object: expected sweeps of one material, the file names {}: {}",
        named.len(),
        listed(&named)
    ))
}

/// Returns advice about sweeps of materials that the classifier does not know; `None` if the file names only known materials, or names none and
/// the classifier is calibrated.
pub fn hint(found: &ClassifiedSweeps) -> Option<String> {
    let known: BTreeSet<&str> = found.materials.names().collect();
    let unknown: BTreeSet<&str> = names(found).filter(|name| !known.contains(name)).collect();
    let is_calibrated = is_calibrated(found);
    if unknown.is_empty() {
        let is_nameless = names(found).next().is_none();
        return (is_nameless && !is_calibrated).then(|| {
            format!(
                "every sweep is assigned to one of the run's {} materials, even if it is of another; a network or committee of `train --calibrate` detects \
                 some of the others",
                known.len()
            )
        });
    }
    let detection = match is_calibrated {
        true => "",
        false => ", and cannot detect that without `train --calibrate`",
    };
    Some(format!(
        "the run does not know {}{detection}; `tactnet enroll` adds a material to a network or committee",
        listed(&unknown)
    ))
}

fn names(found: &ClassifiedSweeps) -> impl Iterator<Item = &str> {
    let sweeps = found.sweeps.iter();
    sweeps.filter_map(|sweep| sweep.named.as_deref())
}

fn is_unknown(sweep: &ClassifiedSweep) -> bool {
    sweep.unknown == Some(true)
}

/// Returns true if the classifier detects unknown materials.
fn is_calibrated(found: &ClassifiedSweeps) -> bool {
    found.sweeps.iter().any(|sweep| sweep.unknown.is_some())
}

/// Returns the first names in backquotes, and the number of the others.
fn listed(names: &BTreeSet<&str>) -> String {
    let mut shown: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
    let hidden = shown.len().saturating_sub(MAX_NAMES);
    shown.truncate(MAX_NAMES);
    if hidden > 0 {
        shown.push(format!("and {hidden} more"));
    }
    shown.join(", ")
}

/// Returns the labels of the largest and of the second largest value.
fn two_largest(values: &[f64]) -> (usize, Option<usize>) {
    let best = argmax(values);
    let others = (0..values.len()).filter(|label| *label != best);
    (
        best,
        others.max_by(|a, b| values[*a].total_cmp(&values[*b])),
    )
}
