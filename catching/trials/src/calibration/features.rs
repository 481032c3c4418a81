//! Features of a session, compared with the true markers.

use serde::Serialize;
use tactnet_catching_packets::packets::Circle;

use tactnet_plot::quantile;

/// Maximum distance of a correct feature from the true marker along each axis, in pixels: twenty standard deviations of the
/// features without pictures.
const NEAR: f64 = 5.0;

/// Numbers of features of a session, and their errors. All counts are of markers in single pictures.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct FeatureReport {
    /// Number of markers that are completely in a picture.
    pub shown: usize,
    /// Number of these that were found.
    pub found: usize,
    /// Number of these without a feature.
    pub missed: usize,
    /// Number of features that are not the marker.
    pub wrong: usize,
    /// Number of found markers whose outline crosses the edge of the picture.
    pub cut: usize,
    /// Median distance of correct features from the true markers, in pixels; 0 without features.
    pub error_px_median: f64,
    /// Distance below which 95 % of the correct features are, in pixels.
    pub error_px_p95: f64,
}

#[derive(Debug, Clone, Default)]
pub(super) struct FeatureCounts {
    report: FeatureReport,
    errors: Vec<f64>,
}

impl FeatureCounts {
    /// Adds a picture.
    ///
    /// - `truth`: true centre and outline of the marker, if its centre is in the picture
    /// - `size`: width and height of the picture, in pixels
    pub fn add(&mut self, found: Option<[f64; 2]>, truth: Option<Circle>, size: [f64; 2]) {
        let inside = |x: f64, r: f64, size: f64| x >= r && x + r <= size;
        let whole = truth.is_some_and(|marker| {
            inside(marker.u, marker.r, size[0]) && inside(marker.v, marker.r, size[1])
        });
        let report = &mut self.report;
        report.shown += usize::from(whole);
        let Some([u, v]) = found else {
            report.missed += usize::from(whole);
            return;
        };
        match truth.map(|marker| [u - marker.u, v - marker.v]) {
            Some(error) if error.iter().all(|x| x.abs() < NEAR) => {
                report.found += usize::from(whole);
                report.cut += usize::from(!whole);
                self.errors.push(error[0].hypot(error[1]));
            }
            _ => report.wrong += 1,
        }
    }

    /// Returns the counts.
    pub fn report(mut self) -> FeatureReport {
        self.errors.sort_by(f64::total_cmp);
        if !self.errors.is_empty() {
            self.report.error_px_median = quantile(&self.errors, 0.5);
            self.report.error_px_p95 = quantile(&self.errors, 0.95);
        }
        self.report
    }
}
