//! Comparison of two objects as text.

use std::fmt::Write as _;

use tactnet_pipeline::SameMaterial;

use crate::output::counted;

/// Returns a line for each object, the answer, and warnings.
pub fn text(same: &SameMaterial) -> String {
    let mut text = String::new();
    let width = same.data.iter().map(|name| name.chars().count()).max();
    for (name, object) in same.data.iter().zip(&same.objects) {
        let largest = object.probabilities.iter().copied().fold(0.0, f64::max);
        let _ = writeln!(
            text,
            "{name:0$}  {1}, {2} with {3:.1} %",
            width.unwrap_or(0),
            counted(object.sweeps, "sweep"),
            object.material,
            100.0 * largest
        );
    }
    let answer = if same.same >= 0.5 {
        "same"
    } else {
        "different"
    };
    let objects = same.data.iter().zip(&same.objects);
    let unknown: Vec<&String> = objects
        .filter(|(_, object)| object.unknown == Some(true))
        .map(|(name, _)| name)
        .collect();
    let caveat = if unknown.is_empty() {
        ""
    } else {
        ", unreliable (see below)"
    };
    let _ = write!(
        text,
        "{answer}{caveat}: probability of one material {:.1} % (prior: 50 %)",
        100.0 * same.same
    );
    for name in unknown {
        let _ = write!(
            text,
            "\nwarning: {name} is probably of an unknown material, so the answer is unreliable"
        );
    }
    if let [Some(first), Some(second)] = &same.named
        && (first == second) != (same.same >= 0.5)
    {
        let [a, b] = &same.data;
        let relation = if first == second {
            "the same material"
        } else {
            "different materials"
        };
        let _ = write!(
            text,
            "\nwarning: the files name {relation}: {a} names `{first}`, {b} names `{second}`"
        );
    }
    for caution in &same.cautions {
        let _ = write!(text, "\nwarning: {caution}");
    }
    text
}
