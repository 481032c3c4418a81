//! Sweeps in a plane.

use super::super::svg::{SERIES, figure, legend, marker};
use super::super::text::escape;
use crate::FeatureMap;

/// Every sweep as a mark of its material.
pub(super) fn map(map: &FeatureMap) -> String {
    const SIZE: f64 = 300.0;
    let range = |axis: usize| {
        let values = map.points.iter().map(|point| f64::from(point[axis]));
        let low = values.clone().fold(f64::INFINITY, f64::min);
        let high = values.fold(f64::NEG_INFINITY, f64::max);
        (low, (high - low).max(f64::MIN_POSITIVE))
    };
    let ranges = [range(0), range(1)];
    let at = |point: &[f32; 2], axis: usize| {
        let (low, width) = ranges[axis];
        8.0 + (SIZE - 16.0) * (f64::from(point[axis]) - low) / width
    };
    let mut content = String::new();
    for material in 0..map.materials.len() {
        let marks: String = map
            .points
            .iter()
            .zip(&map.labels)
            .filter(|(_, label)| **label == material)
            .map(|(point, _)| marker(material, at(point, 0), at(point, 1)))
            .collect();
        content.push_str(&format!(
            "<g class=\"series s{}\">{marks}</g>\n",
            material % SERIES
        ));
    }
    let title = format!("{} materials, {} space", map.choice, map.space);
    format!(
        "<figure>\n{}{}<figcaption>t-SNE: {}. Distances between far groups mean little.</figcaption>\n</figure>\n",
        figure(SIZE, SIZE, &title, &content),
        legend(&map.materials),
        escape(&title)
    )
}
