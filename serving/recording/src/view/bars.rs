//! A belief as bars and in words.

use re_sdk_types::archetypes::{LineStrips2D, Points2D};
use re_sdk_types::components::Color;
use re_sdk_types::datatypes::Rgba32;
use tactnet_serving::packets::{Stage, TactileBelief, Verdict};

/// Materials that are drawn.
const SHOWN: usize = 8;
/// Length of a bar of probability one, in heights of a bar.
const LENGTH: f32 = 10.0;
const BAR: Color = Color(Rgba32(0x5e81_acff));
const LIKELIEST: Color = Color(Rgba32(0xf0a0_3cff));
const NAME: Color = Color(Rgba32(0xc8c8_c8ff));

/// The likeliest materials first: names and probabilities.
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

/// What the viewer calls a material whose name has not come yet, too.
pub(super) fn name(number: usize, names: &[String]) -> String {
    names
        .get(number)
        .cloned()
        .unwrap_or_else(|| format!("material {number}"))
}

/// Bars from the left, and what is written before them.
pub(super) fn drawn(materials: &[(String, f32)]) -> (LineStrips2D, Points2D) {
    let row = |place: usize| place as f32 + 0.5;
    let strips = materials
        .iter()
        .enumerate()
        .map(|(place, (_, p))| [(0.0, row(place)), (LENGTH * p.max(0.002), row(place))]);
    let colors = (0..materials.len()).map(|place| if place == 0 { LIKELIEST } else { BAR });
    let bars = LineStrips2D::new(strips)
        .with_radii([0.3])
        .with_colors(colors);
    let names = Points2D::new((0..materials.len()).map(|place| (-3.0, row(place))))
        .with_labels(
            materials
                .iter()
                .map(|(name, p)| format!("{name} {:.0} %", 100.0 * p)),
        )
        .with_show_labels(true)
        .with_radii([0.0])
        .with_colors([NAME]);
    (bars, names)
}

/// The outline of all bars, which keeps the picture's size.
pub(super) fn outline() -> LineStrips2D {
    let bottom = SHOWN as f32;
    let (left, right) = (-6.0, LENGTH);
    LineStrips2D::new([[
        (left, 0.0),
        (right, 0.0),
        (right, bottom),
        (left, bottom),
        (left, 0.0),
    ]])
    .with_radii([0.02])
    .with_colors([Color::from_rgb(60, 60, 60)])
}

/// The belief in words, Markdown.
pub(super) fn words(belief: &TactileBelief, names: &[String]) -> String {
    let stage = if belief.stage == Stage::Anytime as u32 {
        format!("after {} frames", belief.frames)
    } else if belief.stage == Stage::Plain as u32 {
        "whole sweep".into()
    } else {
        "whole sweep, Monte Carlo dropout".into()
    };
    let unknown = if belief.verdict == Verdict::Unknown as u32 {
        "\n\n**unknown material**"
    } else {
        ""
    };
    let posterior = super::scene::posterior(belief);
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
