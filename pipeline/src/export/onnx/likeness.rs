//! p-value of every sweep against the training data: `digits` to `likeness`, `[sweeps]`.
//!
//! ```text
//! digits ─┬─ means, spreads, changes, band powers ─ whitening ─ nearest material ─ excess distance ─┬─ ranks ─> likeness
//!         └─ taxels that do not change ─────────────────────────────────────────────────────────────┘
//! ```
//!
//! The arithmetic is that of [`crate::Likeness`], in `f32`.

use super::builder::Builder;
use super::message::Attribute;
use crate::likeness::LikenessTables;

fn axis(axis: i64) -> Vec<Attribute> {
    vec![Attribute::int("axis", axis)]
}

/// Attributes of a reduction over one axis.
fn over(axis: usize, keepdims: i64) -> Vec<Attribute> {
    vec![
        Attribute::ints("axes", &[axis]),
        Attribute::int("keepdims", keepdims),
    ]
}

/// Adds the layers from `digits` to `likeness`.
pub(super) fn likeness(builder: &mut Builder, tables: &LikenessTables) {
    let scalar =
        |builder: &mut Builder, name: &str, value: f32| builder.floats(name, &[1], &[value]);
    scalar(builder, "like_floor", tables.floor);
    builder.matrix("like_groups", &tables.groups);
    moments(builder);
    spectrum(builder, tables);
    builder.node(
        "Concat",
        &["like_level", "like_spread", "like_change", "like_spectrum"],
        "like_description",
        axis(1),
    );
    excess(builder, tables);
    surprise(builder, tables);

    let references = tables.excesses.len();
    rank(builder, "like_excess", &tables.excesses, "GreaterOrEqual");
    rank(
        builder,
        "like_surprise",
        &tables.surprises,
        "GreaterOrEqual",
    );
    builder.node(
        "Min",
        &["like_excess_rank", "like_surprise_rank"],
        "like_smaller",
        vec![],
    );
    rank(
        builder,
        "like_smaller",
        &tables.smaller_ranks,
        "LessOrEqual",
    );
    scalar(builder, "like_references", (1 + references) as f32);
    builder.node(
        "Div",
        &["like_smaller_rank", "like_references"],
        "like_p",
        vec![],
    );
    builder.integers("like_last_axis", &[1]);
    builder.node("Squeeze", &["like_p", "like_last_axis"], "likeness", vec![]);
}

/// Adds `like_level`, `like_spread` and `like_change`, `[sweeps, groups]`, and `like_centred`, `[sweeps, steps, taxels]`.
fn moments(builder: &mut Builder) {
    let deviation = |builder: &mut Builder, input: &str, name: &str| {
        let of = |what: &str| format!("{name}_{what}");
        builder.node("ReduceMean", &[input], &of("mean"), over(1, 1));
        builder.node("Sub", &[input, &of("mean")], &of("centred"), vec![]);
        let centred = of("centred");
        builder.node("Mul", &[&centred, &centred], &of("squares"), vec![]);
        builder.node("ReduceMean", &[&of("squares")], &of("variance"), over(1, 0));
        builder.node("Sqrt", &[&of("variance")], &of("deviation"), vec![]);
        let above = [of("deviation"), of("above")];
        builder.node("Add", &[&above[0], "like_floor"], &above[1], vec![]);
        builder.node("Log", &[&above[1]], &of("log"), vec![]);
    };
    deviation(builder, "digits", "like_taxel");
    for (name, [start, end]) in [("like_after", [1, i64::MAX]), ("like_before", [0, -1])] {
        let [from, to, at] = ["from", "to", "at"].map(|what| format!("{name}_{what}"));
        builder.integers(&from, &[start]);
        builder.integers(&to, &[end]);
        builder.integers(&at, &[1]);
        builder.node("Slice", &["digits", &from, &to, &at], name, vec![]);
    }
    builder.node("Sub", &["like_after", "like_before"], "like_steps", vec![]);
    deviation(builder, "like_steps", "like_step");
    builder.node(
        "Sub",
        &["like_step_log", "like_taxel_log"],
        "like_relative",
        vec![],
    );
    builder.integers("like_time", &[1]);
    builder.node(
        "Squeeze",
        &["like_taxel_mean", "like_time"],
        "like_means",
        vec![],
    );
    for (input, output) in [
        ("like_means", "like_level"),
        ("like_taxel_log", "like_spread"),
        ("like_relative", "like_change"),
    ] {
        builder.node("MatMul", &[input, "like_groups"], output, vec![]);
    }
}

/// Adds `like_spectrum`, `[sweeps, bands]`.
fn spectrum(builder: &mut Builder, tables: &LikenessTables) {
    builder.integers("like_parts_axis", &[3]);
    builder.node(
        "Unsqueeze",
        &["like_taxel_centred", "like_parts_axis"],
        "like_signal",
        vec![],
    );
    builder.node(
        "DFT",
        &["like_signal"],
        "like_bins",
        vec![Attribute::int("axis", 1), Attribute::int("onesided", 1)],
    );
    builder.node("Mul", &["like_bins", "like_bins"], "like_parts", vec![]);
    // Sum over real and imaginary parts and taxels.
    builder.integers("like_part_axes", &[2, 3]);
    builder.node(
        "ReduceSum",
        &["like_parts", "like_part_axes"],
        "like_powers",
        vec![Attribute::int("keepdims", 0)],
    );
    let bands: Vec<Vec<f32>> = (0..tables.band_bins[0].len())
        .map(|bin| tables.band_bins.iter().map(|band| band[bin]).collect())
        .collect();
    builder.matrix("like_bands", &bands);
    builder.node(
        "MatMul",
        &["like_powers", "like_bands"],
        "like_energies",
        vec![],
    );
    builder.integers("like_band_axis", &[1]);
    builder.node(
        "ReduceSum",
        &["like_energies", "like_band_axis"],
        "like_energy",
        vec![Attribute::int("keepdims", 1)],
    );
    builder.floats("like_least_power", &[1], &[tables.least_power]);
    builder.node(
        "Mul",
        &["like_energy", "like_least_power"],
        "like_share",
        vec![],
    );
    builder.floats("like_floor_power", &[1], &[tables.floor * tables.floor]);
    builder.node(
        "Add",
        &["like_share", "like_floor_power"],
        "like_least",
        vec![],
    );
    builder.node(
        "Add",
        &["like_energies", "like_least"],
        "like_energies_above",
        vec![],
    );
    builder.node("Log", &["like_energies_above"], "like_logarithms", vec![]);
    builder.node(
        "ReduceMean",
        &["like_logarithms"],
        "like_log_mean",
        over(1, 1),
    );
    builder.node(
        "Sub",
        &["like_logarithms", "like_log_mean"],
        "like_spectrum",
        vec![],
    );
}

/// Adds `like_excess`, `[sweeps, 1]`: the logarithmic distance from the nearest material relative to the typical one.
fn excess(builder: &mut Builder, tables: &LikenessTables) {
    builder.floats("like_centre", &[tables.centre.len()], &tables.centre);
    builder.matrix("like_map", &tables.map);
    builder.matrix("like_materials", &tables.means);
    builder.floats("like_typical", &[tables.typical.len()], &tables.typical);
    builder.node(
        "Sub",
        &["like_description", "like_centre"],
        "like_shifted",
        vec![],
    );
    builder.node(
        "MatMul",
        &["like_shifted", "like_map"],
        "like_whitened",
        vec![],
    );
    builder.integers("like_material_axis", &[1]);
    builder.node(
        "Unsqueeze",
        &["like_whitened", "like_material_axis"],
        "like_rows",
        vec![],
    );
    builder.node(
        "Sub",
        &["like_rows", "like_materials"],
        "like_offsets",
        vec![],
    );
    builder.node(
        "Mul",
        &["like_offsets", "like_offsets"],
        "like_square_offsets",
        vec![],
    );
    builder.integers("like_width_axis", &[2]);
    builder.node(
        "ReduceSum",
        &["like_square_offsets", "like_width_axis"],
        "like_distances",
        vec![Attribute::int("keepdims", 0)],
    );
    builder.node(
        "ReduceMin",
        &["like_distances"],
        "like_distance",
        over(1, 1),
    );
    builder.floats("like_least_distance", &[1], &[f32::MIN_POSITIVE]);
    builder.node(
        "Max",
        &["like_distance", "like_least_distance"],
        "like_positive",
        vec![],
    );
    builder.node("Log", &["like_positive"], "like_log_distance", vec![]);
    builder.node("ArgMin", &["like_distances"], "like_nearest", axis(1));
    builder.node(
        "Gather",
        &["like_typical", "like_nearest"],
        "like_usual",
        vec![],
    );
    builder.node(
        "Sub",
        &["like_log_distance", "like_usual"],
        "like_excess",
        vec![],
    );
}

/// Adds `like_surprise`, `[sweeps, 1]`: the surprise about the most unusual taxel that does not change, 0 if there is none.
fn surprise(builder: &mut Builder, tables: &LikenessTables) {
    builder.node("ReduceMax", &["digits"], "like_greatest", over(1, 0));
    builder.node("ReduceMin", &["digits"], "like_smallest", over(1, 0));
    builder.node(
        "Equal",
        &["like_greatest", "like_smallest"],
        "like_constant",
        vec![],
    );
    let float = vec![Attribute::int("to", 1)];
    builder.node("Cast", &["like_constant"], "like_constant_float", float);
    builder.floats("like_shares", &[tables.surprise.len()], &tables.surprise);
    builder.node(
        "Mul",
        &["like_constant_float", "like_shares"],
        "like_surprises",
        vec![],
    );
    builder.node(
        "ReduceMax",
        &["like_surprises"],
        "like_surprise",
        over(1, 1),
    );
}

/// Adds `{input}_rank`, `[sweeps, 1]`: one more than the number of reference values for which `comparison` with the input holds.
fn rank(builder: &mut Builder, input: &str, references: &[f32], comparison: &str) {
    let name = |what: &str| format!("{input}_{what}");
    builder.floats(&name("references"), &[references.len()], references);
    builder.node(
        comparison,
        &[&name("references"), input],
        &name("holds"),
        vec![],
    );
    let float = vec![Attribute::int("to", 1)];
    builder.node("Cast", &[&name("holds")], &name("counted"), float);
    builder.integers(&name("axis"), &[1]);
    builder.node(
        "ReduceSum",
        &[&name("counted"), &name("axis")],
        &name("count"),
        vec![Attribute::int("keepdims", 1)],
    );
    builder.floats(&name("one"), &[1], &[1.0]);
    builder.node(
        "Add",
        &[&name("count"), &name("one")],
        &name("rank"),
        vec![],
    );
}
