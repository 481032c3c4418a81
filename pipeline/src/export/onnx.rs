//! Export of a network as an ONNX file: digits in, log-probabilities out, for any ONNX runtime.
//!
//! ```text
//! digits [sweeps, steps, taxels] ─ levels, scaling ─ trunk ── features ─┬─────────── head ─> log_probability    [sweeps, materials]
//! masks  [runs, features] ──────────────────────────────────────────────┴─ product ─ head ─> mc_log_probability [sweeps, materials]
//!                                                                                         └> mutual_information [sweeps], nats
//! ```
//!
//! The output `likeness` is the p-value of every sweep against the training data ([`crate::Likeness`]), if there is a description of these.
//! The second row exists only with [`OnnxInputs::DigitsAndMasks`]. A mask value is `1 / keep_probability` or 0 (inverted dropout). Monte Carlo
//! outputs average probabilities over runs (thesis, section 4.5.2).
//!
//! A committee of networks has all of them in one graph, with their names as prefixes: inputs `MEMBER/masks`, and the mean of the members'
//! probabilities as outputs `log_probability` and `mc_log_probability`.

mod builder;
mod committee;
mod convolutions;
mod likeness;
mod message;
mod spectral;

use std::collections::BTreeMap;

use prost::Message;
use tactnet_data::SweepShape;
use tactnet_models::{Compute, NORM_EPSILON, NetworkConfig, Weights};

use super::properties::{network_setup, properties};
use crate::{
    Calibration, Classifier, ClassifierConfig, Likeness, ModelConfig, NetworkSetup, PipelineError,
};
use builder::{Builder, Stored};
use committee::committee;
use convolutions::convolutions;
use likeness::likeness as add_likeness;
use message::{Attribute, Graph, IR_VERSION, Model, OPSET, OperatorSet, Property, Size, Value};
use spectral::spectral;

/// Inputs of an exported network. ONNX has no optional inputs; ONNX Runtime warns at every load of an input with a default.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OnnxInputs {
    /// Sweeps only.
    Digits,
    /// Sweeps and dropout masks for Monte Carlo prediction.
    DigitsAndMasks,
}

/// Documentation inside the file. A test runs its Python code with the file as `model.onnx`.
const USE: &str = r#"Which material did the fingertip sweep over? In Python, with onnxruntime and numpy:

import json, numpy, onnxruntime
session = onnxruntime.InferenceSession("model.onnx")  # this file
labels = json.loads(session.get_modelmeta().custom_metadata_map["labels"])
digits = numpy.zeros((1, STEPS, TAXELS), numpy.float32)  # sweeps x steps x taxels, as the skin gives them
print(labels[session.run(["log_probability"], {"digits": digits})[0][0].argmax()])"#;
/// Documentation inside a file with masks as mandatory input.
const USE_WITH_MASKS: &str = r#"Which material did the fingertip sweep over? In Python, with onnxruntime and numpy:

import json, numpy, onnxruntime
session = onnxruntime.InferenceSession("model.onnx")  # this file
labels = json.loads(session.get_modelmeta().custom_metadata_map["labels"])
digits = numpy.zeros((1, STEPS, TAXELS), numpy.float32)  # sweeps x steps x taxels, as the skin gives them
masks = (numpy.random.default_rng(1).random((100, FEATURES)) < KEEP).astype(numpy.float32) * KEPT  # runs x features
print(labels[session.run(["mc_log_probability"], {"digits": digits, "masks": masks})[0][0].argmax()])

A mask has KEPT with probability KEEP in each place, else 0; "mc_log_probability" is that of the mean over runs. "log_probability" is without dropout and takes any masks."#;

/// Sizes of the exported network.
struct Sizes {
    steps: usize,
    taxels: usize,
    features: usize,
    materials: usize,
}

impl Sizes {
    fn of(config: &ClassifierConfig, network: &NetworkConfig) -> Self {
        Self {
            steps: config.shape.steps,
            taxels: config.shape.taxels(),
            features: network.features(),
            materials: network.materials(),
        }
    }
}

impl Builder {
    /// Adds the layers from features `[sweeps, runs, features]` to log-probabilities `[sweeps, runs, materials]`, with names that begin with `prefix`.
    fn head(&mut self, prefix: &str, features: &str) -> String {
        let name = |step: &str| format!("{prefix}_{step}");
        self.node(
            "MatMul",
            &[features, "hidden.weight_t"],
            &name("hidden"),
            vec![],
        );
        self.node(
            "Mul",
            &[&name("hidden"), "hidden.scale"],
            &name("scaled"),
            vec![],
        );
        self.node(
            "Add",
            &[&name("scaled"), "hidden.shift"],
            &name("normalized"),
            vec![],
        );
        self.node("Relu", &[&name("normalized")], &name("rectified"), vec![]);
        self.node(
            "MatMul",
            &[&name("rectified"), "output.weight_t"],
            &name("weighted"),
            vec![],
        );
        self.node(
            "Add",
            &[&name("weighted"), "output.bias"],
            &name("logits"),
            vec![],
        );
        let scores = name("run_log_probability");
        self.node(
            "LogSoftmax",
            &[&name("logits")],
            &scores,
            vec![Attribute::int("axis", 2)],
        );
        scores
    }

    /// Adds the entropy `-sum_k p_k ln p_k` over the last axis, which is removed.
    fn entropy(&mut self, log_p: &str, axis: i64, output: &str) {
        let name = |step: &str| format!("{output}_{step}");
        self.node("Exp", &[log_p], &name("p"), vec![]);
        self.node("Mul", &[&name("p"), log_p], &name("terms"), vec![]);
        self.integers(&name("axis"), &[axis]);
        self.node(
            "ReduceSum",
            &[&name("terms"), &name("axis")],
            &name("sum"),
            vec![Attribute::int("keepdims", 0)],
        );
        self.node("Neg", &[&name("sum")], output, vec![]);
    }

    /// Adds Monte Carlo dropout, from features and `masks` to scores.
    fn monte_carlo(&mut self) {
        self.node("Mul", &["one_run", "masks"], "dropped", vec![]);
        let runs = self.head("mc", "dropped");
        self.node(
            "ReduceLogSumExp",
            &[&runs],
            "mc_sum",
            vec![Attribute::ints("axes", &[1]), Attribute::int("keepdims", 0)],
        );
        self.node("Shape", &["masks"], "masks_shape", vec![]);
        self.integers("first", &[0]);
        self.node("Gather", &["masks_shape", "first"], "runs", vec![]);
        self.node(
            "Cast",
            &["runs"],
            "runs_float",
            vec![Attribute::int("to", 1)],
        );
        self.node("Log", &["runs_float"], "log_runs", vec![]);
        self.node("Sub", &["mc_sum", "log_runs"], "mc_log_probability", vec![]);
        self.entropy("mc_log_probability", 1, "entropy_of_mean");
        self.entropy(&runs, 2, "entropy_of_runs");
        self.node(
            "ReduceMean",
            &["entropy_of_runs"],
            "mean_entropy",
            vec![Attribute::ints("axes", &[1]), Attribute::int("keepdims", 0)],
        );
        self.node(
            "Sub",
            &["entropy_of_mean", "mean_entropy"],
            "mutual_information",
            vec![],
        );
    }

    /// Adds the scaling of `digits`, `[sweeps, steps, taxels]`, to `maps0`, `[sweeps, 1, steps, taxels]`.
    fn scaled_digits(&mut self, setup: &NetworkSetup, taxels: usize) {
        let mut digits = "digits";
        if setup.normalizer.needs_whole_sweep() {
            self.node(
                "ReduceMean",
                &[digits],
                "levels",
                vec![Attribute::ints("axes", &[1]), Attribute::int("keepdims", 1)],
            );
            self.node("Sub", &[digits, "levels"], "without_levels", vec![]);
            digits = "without_levels";
        }
        self.floats("offset", &[taxels], setup.normalizer.offset());
        self.floats("gain", &[taxels], setup.normalizer.gain());
        self.node("Sub", &[digits, "offset"], "centred", vec![]);
        self.node("Mul", &["centred", "gain"], "scaled", vec![]);
        self.integers("channel_axis", &[1]);
        self.node("Unsqueeze", &["scaled", "channel_axis"], "maps0", vec![]);
    }

    /// Adds the weights of dense and output layer. Batch normalisation of the dense layer is folded, since ONNX's operator expects the channels
    /// on the second axis.
    fn head_weights<'a>(
        &mut self,
        tensor: impl Fn(&str) -> Result<Stored<'a>, PipelineError>,
        sizes: &Sizes,
    ) -> Result<(), PipelineError> {
        let (shape, values) = tensor("hidden.weight")?;
        let hidden = shape[0];
        self.floats(
            "hidden.weight_t",
            &[sizes.features, hidden],
            &transposed(shape, values),
        );
        let [gamma, beta, mean, variance] = ["gamma", "beta", "running_mean", "running_variance"]
            .map(|what| tensor(&format!("hidden.{what}")));
        let (gamma, beta, mean, variance) = (gamma?.1, beta?.1, mean?.1, variance?.1);
        let scale: Vec<f32> = gamma
            .iter()
            .zip(variance)
            .map(|(gamma, variance)| gamma / (variance + NORM_EPSILON as f32).sqrt())
            .collect();
        let shift: Vec<f32> = (0..hidden)
            .map(|unit| beta[unit] - mean[unit] * scale[unit])
            .collect();
        self.floats("hidden.scale", &[hidden], &scale);
        self.floats("hidden.shift", &[hidden], &shift);
        let (shape, values) = tensor("output.weight")?;
        self.floats(
            "output.weight_t",
            &[hidden, sizes.materials],
            &transposed(shape, values),
        );
        self.floats("output.bias", &[sizes.materials], tensor("output.bias")?.1);
        Ok(())
    }

    /// Declares the input `digits` and the output `log_probability`.
    fn declare(&mut self, shape: SweepShape, materials: usize) {
        self.graph.input = vec![Value::floats(
            "digits",
            vec![
                Size::open("sweeps"),
                Size::of(shape.steps),
                Size::of(shape.taxels()),
            ],
            "digits, taxels row by row",
        )];
        self.graph.output = vec![Value::floats(
            "log_probability",
            vec![Size::open("sweeps"), Size::of(materials)],
            "without dropout, natural logarithm",
        )];
    }

    /// Declares an input of dropout masks.
    fn declare_masks(&mut self, name: &str, features: usize) {
        self.graph.input.push(Value::floats(
            name,
            vec![Size::open("runs"), Size::of(features)],
            "dropout: 1 / keep_probability or 0",
        ));
    }

    /// Declares the output of Monte Carlo dropout.
    fn declare_mean_over_masks(&mut self, materials: usize) {
        self.graph.output.push(Value::floats(
            "mc_log_probability",
            vec![Size::open("sweeps"), Size::of(materials)],
            "of the mean probability over masks, natural logarithm",
        ));
    }
}

/// Returns the documentation inside the file, with the sizes of its network.
///
/// - `keep`: probability with which dropout keeps a feature
fn documentation(inputs: OnnxInputs, sizes: &Sizes, keep: f64) -> String {
    match inputs {
        OnnxInputs::Digits => USE,
        OnnxInputs::DigitsAndMasks => USE_WITH_MASKS,
    }
    .replace("STEPS", &sizes.steps.to_string())
    .replace("TAXELS", &sizes.taxels.to_string())
    .replace("FEATURES", &sizes.features.to_string())
    .replace("KEPT", &(1.0 / keep).to_string())
    .replace("KEEP", &keep.to_string())
}

/// Graph of a model, with its documentation.
struct Exported {
    builder: Builder,
    documentation: String,
}

/// Returns the bytes of an ONNX file.
///
/// - `likeness`: description of the training sweeps
/// - `about`: additional properties besides labels, rate, window and calibration
///
/// # Errors
/// A baseline, or a committee with baselines; a classifier that was trained on sweeps of unequal length; weights of another model.
pub fn to_onnx(
    config: &ClassifierConfig,
    weights: &Weights,
    calibration: Option<&Calibration>,
    likeness: Option<&Likeness>,
    inputs: OnnxInputs,
    about: &BTreeMap<String, String>,
) -> Result<Vec<u8>, PipelineError> {
    let exported = match &config.model {
        ModelConfig::Committee(members) => committee(config, members, weights, inputs)?,
        ModelConfig::Network(_) | ModelConfig::Baseline(_) => network(config, weights, inputs)?,
    };
    let Exported {
        mut builder,
        documentation,
    } = exported;
    // A single frame has no changes.
    if let Some(likeness) = likeness.filter(|_| config.shape.steps > 1) {
        add_likeness(&mut builder, &likeness.tables());
        builder.graph.output.push(Value::floats(
            "likeness",
            vec![Size::open("sweeps")],
            "p-value: share of training sweeps that differ as much from the others",
        ));
    }
    let properties = properties(config, calibration, about);
    Ok(model(builder.graph, documentation, properties).encode_to_vec())
}

/// Returns the graph of a network.
fn network(
    config: &ClassifierConfig,
    weights: &Weights,
    inputs: OnnxInputs,
) -> Result<Exported, PipelineError> {
    let setup = network_setup(config)?;
    if config.trained_steps.is_some() {
        let (expected, found) = (
            "a network trained on sweeps of one length",
            "unequal lengths",
        );
        return Err(PipelineError::incompatible("export", expected, found));
    }
    let network = config.network_config(setup)?;
    // Checks the sizes of the tensors.
    Classifier::new(config.clone(), weights, &Compute::Cpu.open()?)?;
    let mut builder = Builder::default();
    let sizes = Sizes::of(config, &network);
    let tensor = |name: &str| -> Result<Stored<'_>, PipelineError> {
        let found = weights
            .0
            .get(name)
            .ok_or_else(|| PipelineError::incompatible("weights", name, "none"))?;
        Ok((&found.shape, &found.values))
    };

    builder.scaled_digits(setup, sizes.taxels);
    if let Some((kernel, pools)) = network.convolutions() {
        convolutions(&mut builder, tensor, kernel, pools)?;
    }
    if let Some(spectra) = network.spectra() {
        spectral(&mut builder, tensor, spectra, sizes.taxels)?;
    }
    builder.node(
        "Flatten",
        &["trunk"],
        "features",
        vec![Attribute::int("axis", 1)],
    );
    builder.head_weights(tensor, &sizes)?;
    builder.integers("run_axis", &[1]);
    builder.node("Unsqueeze", &["features", "run_axis"], "one_run", vec![]);
    let plain = builder.head("plain", "one_run");
    builder.node("Squeeze", &[&plain, "run_axis"], "log_probability", vec![]);
    builder.declare(config.shape, sizes.materials);
    if inputs == OnnxInputs::DigitsAndMasks {
        builder.monte_carlo();
        builder.declare_masks("masks", sizes.features);
        builder.declare_mean_over_masks(sizes.materials);
        builder.graph.output.push(Value::floats(
            "mutual_information",
            vec![Size::open("sweeps")],
            "between material and mask, nats",
        ));
    }
    builder.graph.name = setup.network.kind().into();
    let documentation = documentation(inputs, &sizes, setup.network.keep_probability);
    Ok(Exported {
        builder,
        documentation,
    })
}

fn model(graph: Graph, doc_string: String, properties: BTreeMap<String, String>) -> Model {
    Model {
        ir_version: IR_VERSION,
        producer_name: "tactnet".into(),
        producer_version: env!("CARGO_PKG_VERSION").into(),
        doc_string,
        graph: Some(graph),
        opset_import: vec![OperatorSet {
            domain: String::new(),
            version: OPSET,
        }],
        metadata_props: properties
            .into_iter()
            .map(|(key, value)| Property { key, value })
            .collect(),
    }
}

/// Transposes `[rows][columns]` to `[columns][rows]`.
fn transposed(shape: &[usize], values: &[f32]) -> Vec<f32> {
    let (rows, columns) = (shape[0], shape[1]);
    (0..columns)
        .flat_map(|column| (0..rows).map(move |row| values[row * columns + column]))
        .collect()
}
