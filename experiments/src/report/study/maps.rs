//! Sweeps in a plane.

use tactnet_plot::{Scale, Series, escape, figure, legend};

use crate::FeatureMap;

/// Every sweep as a mark of its material.
pub(super) fn map(map: &FeatureMap) -> String {
    const SIZE: f64 = 300.0;
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
    let mut content = String::new();
    for material in 0..map.materials.len() {
        let series = Series::nth(material);
        let marks: String = map
            .points
            .iter()
            .zip(&map.labels)
            .filter(|(_, label)| **label == material)
            .map(|(point, _)| series.marker(at(point, 0), at(point, 1)))
            .collect();
        content.push_str(&series.group(&marks));
    }
    let title = format!("{} materials, {} space", map.choice, map.space);
    format!(
        "<figure>\n{}{}<figcaption>t-SNE: {}. Distances between far groups mean little.</figcaption>\n</figure>\n",
        figure(SIZE, SIZE, &title, &content),
        legend(&map.materials),
        escape(&title)
    )
}
