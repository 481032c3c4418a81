//! Properties of an exported file.

use std::collections::BTreeMap;

use crate::{Calibration, ClassifierConfig, ModelConfig, NetworkSetup, PipelineError};

/// Returns the network settings of a classifier.
///
/// # Errors
/// A classifier that is not a network.
pub(super) fn network_setup(config: &ClassifierConfig) -> Result<&NetworkSetup, PipelineError> {
    match &config.model {
        ModelConfig::Network(setup) => Ok(setup),
        ModelConfig::Baseline(_) => Err(PipelineError::incompatible(
            "export",
            "a network",
            "a baseline",
        )),
        ModelConfig::Committee(_) => Err(PipelineError::incompatible(
            "export",
            "a network",
            "a committee, which has only an ONNX form",
        )),
    }
}

/// Returns the properties that a program needs besides the weights, by name: labels, rate, window, calibration and `about`. Lists are JSON.
pub(super) fn properties(
    config: &ClassifierConfig,
    calibration: Option<&Calibration>,
    about: &BTreeMap<String, String>,
) -> BTreeMap<String, String> {
    let labels: Vec<&str> = config.labels.names().collect();
    let mut properties = BTreeMap::from([
        ("labels".to_owned(), serde_json::json!(labels).to_string()),
        ("sample_rate_hz".into(), config.sample_rate_hz.to_string()),
        (
            "sample_rate_assumed".into(),
            config.sample_rate_assumed.to_string(),
        ),
        ("window_steps".into(), config.shape.steps.to_string()),
        ("rows".into(), config.shape.rows.to_string()),
        ("cols".into(), config.shape.cols.to_string()),
    ]);
    properties.extend(of_model(&config.model));
    if !config.conditions.is_empty() {
        let names = config.conditions.columns().iter();
        let names: Vec<String> = names.map(|of| of.condition.to_string()).collect();
        // They are the last columns; an unknown one has its mean.
        properties.extend([
            (
                "conditions".to_owned(),
                serde_json::json!(names).to_string(),
            ),
            ("condition_means".into(), means(config)),
        ]);
    }
    if let Some(calibration) = calibration {
        let score = serde_json::json!(calibration.score);
        properties.extend([
            (
                "unknown_score".to_owned(),
                score.as_str().unwrap_or_default().to_owned(),
            ),
            (
                "unknown_threshold".into(),
                calibration.threshold.to_string(),
            ),
            (
                "unknown_false_alarms".into(),
                calibration.target.false_alarms.to_string(),
            ),
            (
                "set_least_probability".into(),
                calibration.least_probability.to_string(),
            ),
            (
                "set_coverage".into(),
                calibration.target.coverage.to_string(),
            ),
        ]);
    }
    properties.extend(about.clone());
    properties
}

/// Returns the properties of a network, or the names of a committee's members.
fn of_model(model: &ModelConfig) -> Vec<(String, String)> {
    match model {
        ModelConfig::Network(setup) => {
            let levels = match setup.normalizer.needs_whole_sweep() {
                true => "removed",
                false => "kept",
            };
            let keep = setup.network.keep_probability.to_string();
            vec![
                ("keep_probability".into(), keep),
                ("levels".into(), levels.into()),
            ]
        }
        ModelConfig::Committee(members) => {
            let names: Vec<&str> = members.iter().map(|member| member.name.as_str()).collect();
            vec![("members".into(), serde_json::json!(names).to_string())]
        }
        ModelConfig::Baseline(_) => Vec::new(),
    }
}

/// Returns the means of the conditions of the training sweeps, as JSON.
fn means(config: &ClassifierConfig) -> String {
    let conditions = config.conditions.columns().iter();
    let means: Vec<f32> = conditions.map(|of| of.mean).collect();
    serde_json::json!(means).to_string()
}
