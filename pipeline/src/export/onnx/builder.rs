//! Builder of graphs from nodes and constants.

use tactnet_models::NORM_EPSILON;

use super::message::{Attribute, Graph, Node, Tensor};
use crate::PipelineError;

/// Shape and values of one of the network's tensors.
pub(super) type Stored<'a> = (&'a [usize], &'a [f32]);

/// Graph under construction.
#[derive(Default)]
pub(super) struct Builder {
    pub(super) graph: Graph,
}

impl Builder {
    /// Adds the operator `op` with the result `output`.
    pub(super) fn node(
        &mut self,
        op: &str,
        inputs: &[&str],
        output: &str,
        attributes: Vec<Attribute>,
    ) {
        self.graph.node.push(Node {
            input: inputs.iter().map(ToString::to_string).collect(),
            output: vec![output.into()],
            name: output.into(),
            op_type: op.into(),
            attribute: attributes,
        });
    }

    pub(super) fn floats(&mut self, name: &str, shape: &[usize], values: &[f32]) {
        self.graph
            .initializer
            .push(Tensor::floats(name, shape, values));
    }

    /// Adds a constant of rows of equal length.
    pub(super) fn matrix(&mut self, name: &str, rows: &[Vec<f32>]) {
        self.floats(name, &[rows.len(), rows[0].len()], &rows.concat());
    }

    pub(super) fn integers(&mut self, name: &str, values: &[i64]) {
        self.graph.initializer.push(Tensor::integers(name, values));
    }

    /// Adds batch normalisation over the second axis with the stored statistics of `layer`, and ReLU. Returns the name of the result.
    pub(super) fn normalized<'a>(
        &mut self,
        tensor: impl Fn(&str) -> Result<Stored<'a>, PipelineError>,
        layer: &str,
        input: &str,
    ) -> Result<String, PipelineError> {
        let name = |what: &str| format!("{layer}.{what}");
        for what in ["gamma", "beta", "running_mean", "running_variance"] {
            let (shape, values) = tensor(&name(what))?;
            self.floats(&name(what), shape, values);
        }
        self.node(
            "BatchNormalization",
            &[
                input,
                &name("gamma"),
                &name("beta"),
                &name("running_mean"),
                &name("running_variance"),
            ],
            &name("normalized"),
            vec![Attribute::float("epsilon", NORM_EPSILON as f32)],
        );
        let rectified = name("rectified");
        self.node("Relu", &[&name("normalized")], &rectified, vec![]);
        Ok(rectified)
    }
}
