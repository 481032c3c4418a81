//! Convolution blocks: `[sweeps, 1, steps, taxels]` to `[sweeps, maps, pooled steps, taxels]`.

use super::builder::{Builder, Stored};
use super::message::Attribute;
use crate::PipelineError;

/// Adds the layers from `maps0` to `trunk`.
pub(super) fn convolutions<'a>(
    builder: &mut Builder,
    tensor: impl Fn(&str) -> Result<Stored<'a>, PipelineError>,
    [along, across]: [usize; 2],
    pools: &[usize],
) -> Result<(), PipelineError> {
    for (number, pool) in pools.iter().enumerate() {
        let (before, layer) = (format!("maps{number}"), format!("conv{}", number + 1));
        let name = |what: &str| format!("{layer}.{what}");
        let (shape, values) = tensor(&name("weight"))?;
        builder.floats(&name("weight"), shape, values);
        builder.node(
            "Conv",
            &[&before, &name("weight")],
            &name("convolved"),
            vec![
                Attribute::ints("kernel_shape", &[along, across]),
                Attribute::ints("pads", &[along / 2, across / 2, along / 2, across / 2]),
            ],
        );
        let rectified = builder.normalized(&tensor, &layer, &name("convolved"))?;
        let pooled = if number + 1 == pools.len() {
            "trunk".into()
        } else {
            format!("maps{}", number + 1)
        };
        builder.node(
            "MaxPool",
            &[&rectified],
            &pooled,
            vec![
                Attribute::ints("kernel_shape", &[*pool, 1]),
                Attribute::ints("strides", &[*pool, 1]),
                Attribute::int("ceil_mode", 1),
            ],
        );
    }
    Ok(())
}
