//! Taxels and sweeps in messages.

use crate::{Place, SweepShape};

pub(super) fn in_sweep(sweep: usize) -> Place {
    Place {
        sweep: Some(sweep),
        ..Place::default()
    }
}

pub(super) fn taxel_name(shape: SweepShape, taxel: usize) -> String {
    format!("({}, {})", taxel / shape.cols, taxel % shape.cols)
}

pub(super) fn taxel_names(shape: SweepShape, taxels: &[usize]) -> String {
    let names: Vec<String> = taxels
        .iter()
        .map(|&taxel| taxel_name(shape, taxel))
        .collect();
    format!(
        "taxel{} {}",
        if names.len() == 1 { "" } else { "s" },
        names.join(", ")
    )
}
