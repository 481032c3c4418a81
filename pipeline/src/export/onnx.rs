//! A classifier as an ONNX file: digits in, log-probabilities out, for any program that has an ONNX runtime.
//!
//! ```text
//! digits [sweeps, steps, taxels] ─ levels, scaling ─ blocks ─ features ─┬─────────── head ─> log_probability    [sweeps, materials]
//! masks  [runs, features] (optional: ones) ─────────────────────────────┴─ product ─ head ─> mc_log_probability [sweeps, materials]
//!                                                                                         └> mutual_information [sweeps], nats
//! ```
//!
//! Masks are those of inverted dropout: `1 / keep_probability` or 0. The mean over runs is that of probabilities (thesis, section 4.5.2).

mod message;

use std::collections::BTreeMap;

use prost::Message;
use tactnet_models::{NORM_EPSILON, Weights};

use super::properties::{network_setup, properties};
use crate::{Calibration, ClassifierConfig, PipelineError};
use message::{
    Attribute, Graph, IR_VERSION, Model, Node, OPSET, OperatorSet, Property, Size, Tensor, Value,
};

/// Writes nodes and keeps count of their names.
#[derive(Default)]
struct Builder {
    graph: Graph,
}

impl Builder {
    /// Adds `op`; its result is called `output`.
    fn node(&mut self, op: &str, inputs: &[&str], output: &str, attributes: Vec<Attribute>) {
        self.graph.node.push(Node {
            input: inputs.iter().map(ToString::to_string).collect(),
            output: vec![output.into()],
            name: output.into(),
            op_type: op.into(),
            attribute: attributes,
        });
    }

    fn floats(&mut self, name: &str, shape: &[usize], values: &[f32]) {
        self.graph
            .initializer
            .push(Tensor::floats(name, shape, values));
    }

    fn integers(&mut self, name: &str, values: &[i64]) {
        self.graph.initializer.push(Tensor::integers(name, values));
    }

    /// From features `[sweeps, runs, features]` to log-probabilities `[sweeps, runs, materials]`, all names beginning with `prefix`.
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

    /// `-sum_k p_k ln p_k` over the last axis, which goes.
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
}

/// The bytes of an ONNX file.
///
/// - `about`: goes into its properties, besides labels, rate, window and calibration
///
/// # Errors
/// A classifier that is no network; weights of another one.
pub fn to_onnx(
    config: &ClassifierConfig,
    weights: &Weights,
    calibration: Option<&Calibration>,
    about: &BTreeMap<String, String>,
) -> Result<Vec<u8>, PipelineError> {
    let setup = network_setup(config)?;
    let network = config.network_config(setup)?;
    let mut builder = Builder::default();
    let (steps, taxels) = (config.shape.steps, config.shape.taxels());
    let (features, materials) = (network.features(), network.materials());
    let tensor = |name: &str| -> Result<(&[usize], &[f32]), PipelineError> {
        let found = weights
            .0
            .get(name)
            .ok_or_else(|| PipelineError::Incompatible {
                item: "weights",
                expected: name.into(),
                found: "none".into(),
            })?;
        Ok((&found.shape, &found.values))
    };

    let mut digits = "digits";
    if setup.normalizer.needs_whole_sweep() {
        builder.node(
            "ReduceMean",
            &[digits],
            "levels",
            vec![Attribute::ints("axes", &[1]), Attribute::int("keepdims", 1)],
        );
        builder.node("Sub", &[digits, "levels"], "without_levels", vec![]);
        digits = "without_levels";
    }
    builder.floats("offset", &[taxels], setup.normalizer.offset());
    builder.floats("gain", &[taxels], setup.normalizer.gain());
    builder.node("Sub", &[digits, "offset"], "centred", vec![]);
    builder.node("Mul", &["centred", "gain"], "scaled", vec![]);
    builder.integers("channel_axis", &[1]);
    builder.node("Unsqueeze", &["scaled", "channel_axis"], "maps0", vec![]);

    let [along, across] = network.architecture().kernel;
    for (number, pool) in network.pools().iter().enumerate() {
        let (before, layer) = (format!("maps{number}"), format!("conv{}", number + 1));
        let name = |what: &str| format!("{layer}.{what}");
        for what in [
            "weight",
            "gamma",
            "beta",
            "running_mean",
            "running_variance",
        ] {
            let (shape, values) = tensor(&name(what))?;
            builder.floats(&name(what), shape, values);
        }
        builder.node(
            "Conv",
            &[&before, &name("weight")],
            &name("convolved"),
            vec![
                Attribute::ints("kernel_shape", &[along, across]),
                Attribute::ints("pads", &[along / 2, across / 2, along / 2, across / 2]),
            ],
        );
        builder.node(
            "BatchNormalization",
            &[
                &name("convolved"),
                &name("gamma"),
                &name("beta"),
                &name("running_mean"),
                &name("running_variance"),
            ],
            &name("normalized"),
            vec![Attribute::float("epsilon", NORM_EPSILON as f32)],
        );
        builder.node("Relu", &[&name("normalized")], &name("rectified"), vec![]);
        builder.node(
            "MaxPool",
            &[&name("rectified")],
            &format!("maps{}", number + 1),
            vec![
                Attribute::ints("kernel_shape", &[*pool, 1]),
                Attribute::ints("strides", &[*pool, 1]),
                Attribute::int("ceil_mode", 1),
            ],
        );
    }
    let last = format!("maps{}", network.pools().len());
    builder.node(
        "Flatten",
        &[&last],
        "features",
        vec![Attribute::int("axis", 1)],
    );

    // Batch normalisation of the dense layer, folded: ONNX's own wants the channels second.
    let (shape, values) = tensor("hidden.weight")?;
    let hidden = shape[0];
    builder.floats(
        "hidden.weight_t",
        &[features, hidden],
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
    builder.floats("hidden.scale", &[hidden], &scale);
    builder.floats("hidden.shift", &[hidden], &shift);
    let (shape, values) = tensor("output.weight")?;
    builder.floats(
        "output.weight_t",
        &[hidden, materials],
        &transposed(shape, values),
    );
    builder.floats("output.bias", &[materials], tensor("output.bias")?.1);

    builder.integers("run_axis", &[1]);
    builder.node("Unsqueeze", &["features", "run_axis"], "one_run", vec![]);
    let plain = builder.head("plain", "one_run");
    builder.node("Squeeze", &[&plain, "run_axis"], "log_probability", vec![]);

    // Whoever gives no masks gets one that keeps everything.
    builder.floats("masks", &[1, features], &vec![1.0; features]);
    builder.node("Mul", &["one_run", "masks"], "dropped", vec![]);
    let runs = builder.head("mc", "dropped");
    builder.node(
        "ReduceLogSumExp",
        &[&runs],
        "mc_sum",
        vec![Attribute::ints("axes", &[1]), Attribute::int("keepdims", 0)],
    );
    builder.node("Shape", &["masks"], "masks_shape", vec![]);
    builder.integers("first", &[0]);
    builder.node("Gather", &["masks_shape", "first"], "runs", vec![]);
    builder.node(
        "Cast",
        &["runs"],
        "runs_float",
        vec![Attribute::int("to", 1)],
    );
    builder.node("Log", &["runs_float"], "log_runs", vec![]);
    builder.node("Sub", &["mc_sum", "log_runs"], "mc_log_probability", vec![]);
    builder.entropy("mc_log_probability", 1, "entropy_of_mean");
    builder.entropy(&runs, 2, "entropy_of_runs");
    builder.node(
        "ReduceMean",
        &["entropy_of_runs"],
        "mean_entropy",
        vec![Attribute::ints("axes", &[1]), Attribute::int("keepdims", 0)],
    );
    builder.node(
        "Sub",
        &["entropy_of_mean", "mean_entropy"],
        "mutual_information",
        vec![],
    );

    let sweeps = || Size::open("sweeps");
    builder.graph.name = "TactNet-II".into();
    builder.graph.input = vec![
        Value::floats(
            "digits",
            vec![sweeps(), Size::of(steps), Size::of(taxels)],
            "digits, taxels row by row",
        ),
        Value::floats(
            "masks",
            vec![Size::open("runs"), Size::of(features)],
            "dropout: 1 / keep_probability or 0; may be left out",
        ),
    ];
    let scores = || vec![sweeps(), Size::of(materials)];
    builder.graph.output = vec![
        Value::floats(
            "log_probability",
            scores(),
            "without dropout, natural logarithm",
        ),
        Value::floats(
            "mc_log_probability",
            scores(),
            "of the mean probability over masks, natural logarithm",
        ),
        Value::floats(
            "mutual_information",
            vec![sweeps()],
            "between material and mask, nats",
        ),
    ];
    let model = Model {
        ir_version: IR_VERSION,
        producer_name: "tactnet".into(),
        producer_version: env!("CARGO_PKG_VERSION").into(),
        doc_string: "Which material did the fingertip sweep over?".into(),
        graph: Some(builder.graph),
        opset_import: vec![OperatorSet {
            domain: String::new(),
            version: OPSET,
        }],
        metadata_props: properties(config, setup, calibration, about)
            .into_iter()
            .map(|(key, value)| Property { key, value })
            .collect(),
    };
    Ok(model.encode_to_vec())
}

/// `[rows][columns]` to `[columns][rows]`.
fn transposed(shape: &[usize], values: &[f32]) -> Vec<f32> {
    let (rows, columns) = (shape[0], shape[1]);
    (0..columns)
        .flat_map(|column| (0..rows).map(move |row| values[row * columns + column]))
        .collect()
}
