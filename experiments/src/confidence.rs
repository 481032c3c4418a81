//! Calibration of predictions: reliability diagram and risk-coverage curve.

use serde::{Deserialize, Serialize};
use tactnet_pipeline::SweepScore;

/// Number of bins of the reliability diagram.
const BINS: usize = 15;
/// Number of points of the risk-coverage curve.
const COVERAGES: usize = 50;

/// One bin of a reliability diagram.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ReliabilityBin {
    /// Mean confidence, 0 to 1.
    pub confidence: f64,
    /// Share of correct predictions, 0 to 1.
    pub accuracy: f64,
    /// Number of sweeps; empty bins are left out.
    pub count: usize,
}

/// One point of a risk-coverage curve.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct RiskCoverage {
    /// Share of the sweeps that are answered, most confident first.
    pub coverage: f64,
    /// Share of wrong answers.
    pub risk: f64,
}

fn confidence(sweep: &SweepScore) -> f64 {
    sweep.log_probability[sweep.predicted()].exp()
}

pub(crate) fn reliability(sweeps: &[&SweepScore]) -> Vec<ReliabilityBin> {
    let mut bins = vec![(0.0, 0, 0); BINS];
    for sweep in sweeps {
        let confidence = confidence(sweep);
        // Bins include their right end, as in the calibration error.
        let bin = &mut bins[((confidence * BINS as f64).ceil() as usize).clamp(1, BINS) - 1];
        bin.0 += confidence;
        bin.1 += usize::from(sweep.predicted() == sweep.label);
        bin.2 += 1;
    }
    bins.into_iter()
        .filter(|(_, _, count)| *count > 0)
        .map(|(sum, right, count)| ReliabilityBin {
            confidence: sum / count as f64,
            accuracy: right as f64 / count as f64,
            count,
        })
        .collect()
}

pub(crate) fn risk_coverage(sweeps: &[&SweepScore]) -> Vec<RiskCoverage> {
    let mut sorted: Vec<(f64, f64)> = sweeps
        .iter()
        .map(|sweep| {
            let wrong = sweep.predicted() != sweep.label;
            (confidence(sweep), f64::from(u8::from(wrong)))
        })
        .collect();
    sorted.sort_by(|a, b| b.0.total_cmp(&a.0));
    // The order of equal confidences is arbitrary, so each counts with their mean error.
    for tie in sorted.chunk_by_mut(|a, b| a.0 == b.0) {
        let mean = tie.iter().map(|(_, wrong)| wrong).sum::<f64>() / tie.len() as f64;
        tie.iter_mut().for_each(|(_, wrong)| *wrong = mean);
    }
    (1..=COVERAGES)
        .map(|point| {
            let answered = (sorted.len() * point).div_ceil(COVERAGES);
            let wrong: f64 = sorted[..answered].iter().map(|(_, wrong)| wrong).sum();
            RiskCoverage {
                coverage: answered as f64 / sorted.len() as f64,
                risk: wrong / answered as f64,
            }
        })
        .collect()
}
