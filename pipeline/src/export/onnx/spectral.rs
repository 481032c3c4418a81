//! Spectra of windows and the layers after them, all as convolutions: `[sweeps, 1, steps, taxels]` to `[sweeps, 2 x units, 1, 1]`.

use tactnet_models::{DEVIATION_EPSILON, ENERGY_FLOOR, LOG_GAIN, LOG_OFFSET, SpectralShape};

use super::builder::{Builder, Stored};
use super::message::Attribute;
use crate::PipelineError;

/// Adds the layers from `maps0` to `trunk`.
pub(super) fn spectral<'a>(
    builder: &mut Builder,
    tensor: impl Fn(&str) -> Result<Stored<'a>, PipelineError>,
    shape: &SpectralShape,
    taxels: usize,
) -> Result<(), PipelineError> {
    logarithms(builder, shape);

    let (size, values) = tensor("taxel.weight")?;
    let [units, inputs] = [size[0], size[1]];
    builder.floats("taxel.weight", &[units, inputs, 1, 1], values);
    builder.node("Conv", &["spectra", "taxel.weight"], "taxel.sum", vec![]);
    let of_taxels = builder.normalized(&tensor, "taxel", "taxel.sum")?;

    // The weights are stored as [units][taxels][inputs].
    let inputs = units;
    let (size, values) = tensor("window.weight")?;
    let units = size[0];
    let mut weight = Vec::with_capacity(values.len());
    for row in values.chunks_exact(taxels * inputs) {
        for input in 0..inputs {
            weight.extend((0..taxels).map(|taxel| row[taxel * inputs + input]));
        }
    }
    builder.floats("window.weight", &[units, inputs, 1, taxels], &weight);
    builder.node("Conv", &[&of_taxels, "window.weight"], "window.sum", vec![]);
    let of_windows = builder.normalized(&tensor, "window", "window.sum")?;

    let mean = |builder: &mut Builder, input: &str, output: &str| {
        let axes = vec![Attribute::ints("axes", &[2]), Attribute::int("keepdims", 1)];
        builder.node("ReduceMean", &[input], output, axes);
    };
    mean(builder, &of_windows, "mean");
    builder.node("Sub", &[&of_windows, "mean"], "from_mean", vec![]);
    builder.node("Mul", &["from_mean", "from_mean"], "squares", vec![]);
    mean(builder, "squares", "variance");
    builder.floats("variance_floor", &[1], &[DEVIATION_EPSILON as f32]);
    builder.node(
        "Add",
        &["variance", "variance_floor"],
        "variance_above",
        vec![],
    );
    builder.node("Sqrt", &["variance_above"], "deviation", vec![]);
    let axis = vec![Attribute::int("axis", 1)];
    builder.node("Concat", &["mean", "deviation"], "trunk", axis);
    Ok(())
}

/// Adds the layers from `maps0` to `spectra`, `[sweeps, bands + 1, windows, taxels]`.
fn logarithms(builder: &mut Builder, shape: &SpectralShape) {
    let tables = shape.tables();
    let (window, bins, bands) = (shape.window(), tables.bins, shape.bands());
    let strides = || vec![Attribute::ints("strides", &[shape.hop(), 1])];
    builder.floats("fourier", &[2 * bins, 1, window, 1], &tables.fourier);
    builder.node("Conv", &["maps0", "fourier"], "parts", strides());
    builder.node("Mul", &["parts", "parts"], "powers", vec![]);
    // The same weights apply to real and imaginary parts.
    let rows = tables.bands.chunks_exact(bins);
    let both: Vec<f32> = rows.flat_map(|row| [row, row].concat()).collect();
    builder.floats("bands", &[bands, 2 * bins, 1, 1], &both);
    builder.node("Conv", &["powers", "bands"], "energies", vec![]);
    builder.floats("energy_floor", &[1], &[ENERGY_FLOOR]);
    builder.node(
        "Add",
        &["energies", "energy_floor"],
        "energies_above",
        vec![],
    );
    builder.node("Log", &["energies_above"], "natural_log", vec![]);
    builder.floats("log_gain", &[1], &[LOG_GAIN]);
    builder.node("Mul", &["natural_log", "log_gain"], "decimal_log", vec![]);
    builder.floats("log_offset", &[1], &[LOG_OFFSET]);
    builder.node(
        "Add",
        &["decimal_log", "log_offset"],
        "log_energies",
        vec![],
    );
    let average = vec![1.0 / window as f32; window];
    builder.floats("average", &[1, 1, window, 1], &average);
    builder.node("Conv", &["maps0", "average"], "means", strides());
    let axis = vec![Attribute::int("axis", 1)];
    builder.node("Concat", &["log_energies", "means"], "spectra", axis);
}
