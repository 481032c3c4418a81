//! Belief as bars and as text.

use re_sdk_types::archetypes::LineStrips2D;
use re_sdk_types::components::Color;
use re_sdk_types::datatypes::Rgba32;
use tactnet_skin::packets::{Stage, TactileBelief, Verdict};

/// Maximum number of materials in the picture.
const SHOWN: usize = 8;
/// Length of a bar for probability one, in heights of a bar.
const LENGTH: f32 = 8.0;
/// Left edge of the names, in heights of a bar.
const LEFT: f32 = -10.0;
const BAR: Color = Color(Rgba32(0x5e81_acff));
const LIKELIEST: Color = Color(Rgba32(0xf0a0_3cff));
/// Color of the names before the bars.
pub(super) const NAME: Color = Color(Rgba32(0xc8c8_c8ff));
/// Half of a bar's height.
pub(super) const RADIUS: f32 = 0.3;

/// Returns names and probabilities of the most likely materials, in descending order.
pub(super) fn likeliest(posterior: &[f32], names: &[String]) -> Vec<(String, f32)> {
    let mut materials: Vec<(String, f32)> = posterior
        .iter()
        .enumerate()
        .map(|(number, p)| (name(number, names), *p))
        .collect();
    materials.sort_by(|a, b| b.1.total_cmp(&a.1));
    materials.truncate(SHOWN);
    materials
}

/// Returns the name of a material, or a placeholder before the names have arrived.
pub(super) fn name(number: usize, names: &[String]) -> String {
    names
        .get(number)
        .cloned()
        .unwrap_or_else(|| format!("material {number}"))
}

/// Returns the vertical middle of a row.
fn row(place: usize) -> f32 {
    place as f32 + 0.5
}

/// Returns the bar of a row, from the left.
pub(super) fn strip(place: usize, p: f32) -> [(f32, f32); 2] {
    [(0.0, row(place)), (LENGTH * p.max(0.002), row(place))]
}

/// Returns the middle of the name before a bar.
pub(super) fn before(place: usize) -> (f32, f32) {
    (LEFT / 2.0, row(place))
}

/// Returns the color of a bar; that of the most likely material differs.
pub(super) fn color(place: usize) -> Color {
    if place == 0 { LIKELIEST } else { BAR }
}

/// Returns the outline of all bars, which keeps the size of the picture constant.
pub(super) fn outline() -> LineStrips2D {
    let bottom = SHOWN as f32;
    LineStrips2D::new([[
        (LEFT, 0.0),
        (LENGTH, 0.0),
        (LENGTH, bottom),
        (LEFT, bottom),
        (LEFT, 0.0),
    ]])
    .with_radii([0.02])
    .with_colors([Color::from_rgb(60, 60, 60)])
}

/// Returns the belief as Markdown text.
pub(super) fn words(belief: &TactileBelief, names: &[String]) -> String {
    let stage = if belief.stage == Stage::Anytime as u32 {
        format!("{} frames so far, provisional", belief.frames)
    } else if belief.stage == Stage::Plain as u32 {
        "whole sweep".into()
    } else {
        "whole sweep, mean over dropout masks".into()
    };
    let unknown = if belief.verdict == Verdict::Unknown as u32 {
        "\n\n**unknown material**"
    } else {
        ""
    };
    let posterior = super::beliefs::posterior(belief);
    let label = belief.label as usize;
    let p = posterior.get(label).copied().unwrap_or(0.0);
    let fused = match belief.fused_sweeps {
        0 => String::new(),
        sweeps => format!(
            "\n\n{sweeps} sweeps fused: **{}** ({:.0} %)",
            name(belief.fused_label as usize, names),
            100.0
                * belief
                    .fused
                    .get(belief.fused_label as usize)
                    .unwrap_or(&0.0)
        ),
    };
    format!(
        "# {} {:.0} %\n\nsweep {}, {stage}{unknown}\n\nentropy {:.2} nat, model version {}{fused}",
        name(label, names),
        100.0 * p,
        belief.sweep,
        belief.entropy,
        belief.model_version
    )
}
