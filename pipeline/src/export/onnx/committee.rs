//! Committee of networks: the graphs of its members, and the mean of their probabilities.

use tactnet_models::Weights;

use super::builder::Builder;
use super::message::{Attribute, Graph};
use super::{Exported, OnnxInputs, USE, network};
use crate::committee::fitted::weights_of;
use crate::{ClassifierConfig, MemberConfig, ModelConfig, NetworkSetup, PipelineError};

/// Documentation inside a file with masks as mandatory inputs.
const USE_WITH_MASKS: &str = r#"Which material did the fingertip sweep over? In Python, with onnxruntime and numpy:

import json, numpy, onnxruntime
session = onnxruntime.InferenceSession("model.onnx")  # this file
labels = json.loads(session.get_modelmeta().custom_metadata_map["labels"])
random = numpy.random.default_rng(1)
inputs = {"digits": numpy.zeros((1, STEPS, TAXELS), numpy.float32)}  # sweeps x steps x taxels, as the skin gives them
for member, (features, keep) in MEMBERS.items():
    inputs[f"{member}/masks"] = (random.random((100, features)) < keep).astype(numpy.float32) / numpy.float32(keep)  # runs x features
print(labels[session.run(["mc_log_probability"], inputs)[0][0].argmax()])

A mask has 1 / keep with probability keep in each place, else 0; "mc_log_probability" is that of the mean over runs and members. "log_probability" is without dropout and takes any masks."#;

/// Member of an exported committee.
struct Member<'a> {
    name: &'a str,
    setup: &'a NetworkSetup,
    config: ClassifierConfig,
}

/// Returns the graph of a committee.
///
/// # Errors
/// A member that is a baseline; sweeps of unequal length; weights of another committee.
pub(super) fn committee(
    config: &ClassifierConfig,
    members: &[MemberConfig],
    weights: &Weights,
    inputs: OnnxInputs,
) -> Result<Exported, PipelineError> {
    let members = networks(config, members)?;
    let (shape, materials) = (config.shape, config.labels.len());
    let mut builder = Builder::default();
    builder.declare(shape, materials);
    for member in &members {
        let own = weights_of(weights, member.name);
        let graph = network(&member.config, &own, inputs)?.builder.graph;
        builder.add_member(member.name, graph);
    }
    let names: Vec<&str> = members.iter().map(|member| member.name).collect();
    builder.mean_probability(&names, "log_probability");
    let mut documentation = USE;
    let mut sizes = serde_json::Map::new();
    if inputs == OnnxInputs::DigitsAndMasks {
        for member in &members {
            let network = member.config.network_config(member.setup)?;
            let (features, keep) = (network.features(), member.setup.network.keep_probability);
            builder.declare_masks(&format!("{}/masks", member.name), features);
            sizes.insert(member.name.into(), serde_json::json!([features, keep]));
        }
        builder.mean_probability(&names, "mc_log_probability");
        builder.declare_mean_over_masks(materials);
        documentation = USE_WITH_MASKS;
    }
    builder.graph.name = "committee".into();
    let sizes = serde_json::Value::Object(sizes).to_string();
    let documentation = documentation
        .replace("STEPS", &shape.steps.to_string())
        .replace("TAXELS", &shape.taxels().to_string())
        .replace("MEMBERS", &sizes);
    Ok(Exported {
        builder,
        documentation,
    })
}

/// Returns the members, which must be networks.
fn networks<'a>(
    config: &ClassifierConfig,
    members: &'a [MemberConfig],
) -> Result<Vec<Member<'a>>, PipelineError> {
    let (mut networks, mut others) = (Vec::new(), Vec::new());
    for member in members {
        match &member.model {
            ModelConfig::Network(setup) => networks.push(Member {
                name: &member.name,
                setup,
                config: ClassifierConfig {
                    model: member.model.clone(),
                    ..config.clone()
                },
            }),
            ModelConfig::Baseline(_) | ModelConfig::Committee(_) => {
                others.push(member.name.clone());
            }
        }
    }
    match others.is_empty() {
        true => Ok(networks),
        false => Err(PipelineError::NotExportable { members: others }),
    }
}

impl Builder {
    /// Adds the nodes and constants of a member with its name as prefix; all members read `digits`.
    fn add_member(&mut self, name: &str, mut graph: Graph) {
        graph.add_prefix(&format!("{name}/"), "digits");
        self.graph.node.append(&mut graph.node);
        self.graph.initializer.append(&mut graph.initializer);
    }

    /// Adds the logarithm of the members' mean probability as `output`, from their outputs of that name, `[sweeps, materials]`.
    fn mean_probability(&mut self, members: &[&str], output: &str) {
        let name = |step: &str| format!("{output}_{step}");
        self.integers(&name("axis"), &[1]);
        let mut rows = Vec::new();
        for member in members {
            let row = format!("{member}/{}", name("row"));
            let own = format!("{member}/{output}");
            self.node("Unsqueeze", &[&own, &name("axis")], &row, vec![]);
            rows.push(row);
        }
        let rows: Vec<&str> = rows.iter().map(String::as_str).collect();
        let axis = vec![Attribute::int("axis", 1)];
        self.node("Concat", &rows, &name("rows"), axis);
        self.node(
            "ReduceLogSumExp",
            &[&name("rows")],
            &name("sum"),
            vec![Attribute::ints("axes", &[1]), Attribute::int("keepdims", 0)],
        );
        let count = (members.len() as f32).ln();
        self.floats(&name("log_members"), &[1], &[count]);
        self.node("Sub", &[&name("sum"), &name("log_members")], output, vec![]);
    }
}
