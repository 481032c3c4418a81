//! Detection of training sweeps in other data sets, whatever the file format.

use std::collections::BTreeSet;

use sha2::{Digest, Sha256};
use tactnet_data::{SweepView, hex};

/// Returns `view` without the sweeps whose values also occur in `train`, and the number removed.
///
/// Values are compared as `f32`, so a copy in another element type or file format is still recognised.
pub fn without_sweeps_of<'a>(
    view: &SweepView<'a>,
    train: &SweepView<'_>,
) -> (SweepView<'a>, usize) {
    without_sweeps(
        view,
        &(0..train.len()).map(|p| sweep_sha256(train, p)).collect(),
    )
}

/// Returns `view` without the sweeps with these digests ([`sweep_sha256`]), and the number removed.
pub(crate) fn without_sweeps<'a>(
    view: &SweepView<'a>,
    sha256: &BTreeSet<String>,
) -> (SweepView<'a>, usize) {
    let others: Vec<usize> = (0..view.len())
        .filter(|position| !sha256.contains(&sweep_sha256(view, *position)))
        .map(|position| view.indices()[position])
        .collect();
    let dropped = view.len() - others.len();
    (SweepView::new(view.dataset(), others), dropped)
}

/// Returns the SHA-256 of a sweep's values as little-endian `f32`, in hexadecimal digits.
pub(crate) fn sweep_sha256(view: &SweepView<'_>, position: usize) -> String {
    let mut hash = Sha256::new();
    for value in view.sweep(position) {
        hash.update(value.to_le_bytes());
    }
    hex(hash.finalize())
}
