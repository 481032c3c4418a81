//! Classifiers, predictions and their evaluation.

pub(crate) mod by_length;
pub(crate) mod by_method;
pub(crate) mod calibration;
pub(crate) mod classifier;
pub(crate) mod classifier_config;
pub(crate) mod classify;
pub(crate) mod conditions;
#[cfg(test)]
mod conditions_tests;
pub(crate) mod confounded_accuracy;
pub(crate) mod confusion;
pub(crate) mod confusion_picture;
pub(crate) mod enroll;
pub(crate) mod evaluation;
pub(crate) mod judged_sweeps;
#[cfg(test)]
mod length_tests;
mod long_online;
mod long_sweeps;
#[cfg(test)]
mod mask_tests;
pub(crate) mod metrics;
pub(crate) mod online;
pub(crate) mod overlap;
pub(crate) mod predictions;
pub(crate) mod runtime;
pub(crate) mod same;
pub(crate) mod unknown_detector;
pub(crate) mod verdicts;
