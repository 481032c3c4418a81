//! Two-dimensional maps of sweeps.

use maud::{Markup, PreEscaped, html};
use tactnet_plot::{Scale, Series, figure, legend};

use crate::FeatureMap;

/// Width and height of a map, in user units.
const SIZE: f64 = 300.0;

/// Draws each sweep as a mark of its material.
pub(super) fn map(map: &FeatureMap) -> Markup {
    let scale = |axis: usize| {
        let values = map.points.iter().map(|point| f64::from(point[axis]));
        let low = values.clone().fold(f64::INFINITY, f64::min);
        let high = values.fold(f64::NEG_INFINITY, f64::max);
        Scale::Linear(low..=high)
    };
    let scales = [scale(0), scale(1)];
    let at = |point: &[f32; 2], axis: usize| {
        8.0 + (SIZE - 16.0) * scales[axis].share(f64::from(point[axis]))
    };
    let group = |material: usize| {
        let series = Series::nth(material);
        let own = map
            .points
            .iter()
            .zip(&map.labels)
            .filter(|(_, label)| **label == material);
        let marks: String = own
            .map(|(point, _)| series.marker(at(point, 0), at(point, 1)))
            .collect();
        series.group(&marks)
    };
    let content: String = (0..map.materials.len()).map(group).collect();
    let title = format!("{} materials, {} space", map.choice, map.space);
    html! {
        figure {
            (PreEscaped(figure(SIZE, SIZE, &title, &content)))
            (PreEscaped(legend(&map.materials)))
            figcaption { "t-SNE: " (title) ". Distances between far groups are not meaningful." }
        }
    }
}
