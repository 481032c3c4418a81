//! Preprocessing of sweeps: scaling, augmentation, features of baselines.

pub(crate) mod arrays;
pub(crate) mod augment;
pub(crate) mod disturbance;
pub(crate) mod extractor;
pub(crate) mod feature_timing;
#[cfg(test)]
pub(crate) mod golden;
pub(crate) mod hydra;
pub(crate) mod log_spectra;
pub(crate) mod mean_removal;
pub(crate) mod normalize;
pub(crate) mod quant;
pub(crate) mod rocket;
pub(crate) mod scaler;
pub(crate) mod series;
pub(crate) mod spectrum;
