//! Finding training sweeps among others, whatever file they came in.

use std::collections::BTreeSet;

use sha2::{Digest, Sha256};
use tactnet_data::SweepView;

/// `view` without the sweeps whose values also occur in `train`, and how many those were.
///
/// Values are compared as `f32`, so a copy in another element type or file format is still recognised.
pub fn without_sweeps_of<'a>(
    view: &SweepView<'a>,
    train: &SweepView<'_>,
) -> (SweepView<'a>, usize) {
    let known: BTreeSet<[u8; 32]> = (0..train.len()).map(|p| fingerprint(train, p)).collect();
    let unseen: Vec<usize> = (0..view.len())
        .filter(|position| !known.contains(&fingerprint(view, *position)))
        .map(|position| view.indices()[position])
        .collect();
    let dropped = view.len() - unseen.len();
    (SweepView::new(view.dataset(), unseen), dropped)
}

fn fingerprint(view: &SweepView<'_>, position: usize) -> [u8; 32] {
    let mut values = vec![0.0; view.shape().values()];
    view.copy_batch(&[position], &mut values);
    let mut hash = Sha256::new();
    for value in values {
        hash.update(value.to_le_bytes());
    }
    hash.finalize().into()
}
