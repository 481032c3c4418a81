//! The text format of aeon, sktime and the UEA archive (`.ts`), written only.
//!
//! A classification problem: one line per sweep, one dimension per taxel (row by row), one value per
//! step; the class is last. Class labels are the material names in a form that aeon's reader does not change (see
//! [`class_label`]). The format has no sample rate, blocks or test flags.

use crate::{DataError, Dataset, write_whole};
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::Path;

/// Writes `dataset` in the order of its sweeps.
///
/// # Errors
/// A NaN or an infinity, which the format cannot represent; two materials with the same class label; or a file that
/// cannot be written.
pub fn write(path: &Path, dataset: &Dataset) -> Result<(), DataError> {
    let labels = class_labels(dataset).map_err(|error| super::in_file(path, error))?;
    let shape = dataset.shape();
    let length = match dataset.lengths() {
        None => format!("@equalLength true\n@seriesLength {}", shape.steps),
        Some(_) => "@equalLength false".into(),
    };
    let mut text = format!(
        "# {} sweeps at {} Hz, one dimension per taxel of a patch of {}x{}\n\
         @problemName {}\n@timeStamps false\n@missing false\n@univariate {}\n@dimensions {}\n\
         {length}\n@classLabel true {}\n@data\n",
        dataset.len(),
        dataset.sample_rate_hz(),
        shape.rows,
        shape.cols,
        class_label(dataset.name()),
        shape.taxels() == 1,
        shape.taxels(),
        labels.join(" "),
    );
    let lines: Result<Vec<String>, DataError> = (0..dataset.len())
        .into_par_iter()
        .map(|index| line(dataset, index, &labels[dataset.records()[index].label]))
        .collect();
    for line in lines.map_err(|error| super::in_file(path, error))? {
        text.push_str(&line);
    }
    write_whole(path, text.as_bytes())
}

fn line(dataset: &Dataset, index: usize, label: &str) -> Result<String, DataError> {
    let sweep = dataset.sweep(index);
    let taxels = dataset.shape().taxels();
    let mut line = String::with_capacity(4 * sweep.len());
    for taxel in 0..taxels {
        for (step, &value) in sweep.iter().skip(taxel).step_by(taxels).enumerate() {
            if !value.is_finite() {
                return Err(DataError::inconsistent(
                    "samples",
                    "finite numbers",
                    format!("{value} in {} at step {step}", dataset.describe(index)),
                ));
            }
            if step > 0 {
                line.push(',');
            }
            // Writing to a string cannot fail.
            let _ = write!(line, "{value}");
        }
        line.push(':');
    }
    line.push_str(label);
    line.push('\n');
    Ok(line)
}

fn class_labels(dataset: &Dataset) -> Result<Vec<String>, DataError> {
    let labels: Vec<String> = dataset.labels().names().map(class_label).collect();
    let mut seen = BTreeSet::new();
    match labels.iter().find(|&label| !seen.insert(label)) {
        Some(twice) => Err(DataError::inconsistent(
            "materials",
            "names that differ in letters and digits",
            format!("two that both become `{twice}`"),
        )),
        None => Ok(labels),
    }
}

/// Returns a material's name as a class label. It is in lower case, because aeon lowers labels. `_` replaces all
/// characters except ASCII letters, digits, `.`, `-` and `_`, because spaces, colons and commas are separators. `nan`
/// becomes `n_an`, because aeon reads it as a missing value even inside a label.
///
/// ```
/// # use tactnet_data::format::ts::class_label;
/// assert_eq!(class_label("Linen fabric (smooth)"), "linen_fabric__smooth_");
/// assert_eq!(class_label("banana"), "ban_ana");
/// ```
pub fn class_label(name: &str) -> String {
    let plain: String = name
        .to_lowercase()
        .chars()
        .map(|c| {
            if c.is_ascii_alphanumeric() || ".-_".contains(c) {
                c
            } else {
                '_'
            }
        })
        .collect();
    plain.replace("nan", "n_an")
}
