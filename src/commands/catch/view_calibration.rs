//! Residuals of a calibration in the Rerun viewer.

use tactnet_catching_trials::CalibrationReport;
use tactnet_recording::view::{Curves, Motion, Target, show_motion};

/// Time between two features or poses, which have no times, in ns.
const STEP_NS: i64 = 10_000_000;

/// Shows features next to the predictions of description and calibration, and hands in held-out poses, one after the
/// other.
pub fn view(report: &CalibrationReport, target: &Target) -> anyhow::Result<()> {
    let samples = &report.samples;
    let line = |name: &str, values: &[f64]| {
        let times = (0..).map(|number| number * STEP_NS);
        (
            name.to_string(),
            times.zip(values.iter().copied()).collect(),
        )
    };
    let motion = Motion {
        curves: vec![
            Curves {
                name: "residuals of markers with the calibration, pixels".into(),
                lines: vec![line("calibrated", &samples.residuals_px)],
            },
            Curves {
                name: "residuals of markers with the description, pixels".into(),
                lines: vec![line("as described", &samples.before_px)],
            },
            Curves {
                name: "hands in held-out poses, mm".into(),
                lines: vec![
                    line("as described", &samples.raw_mm),
                    line("calibrated", &samples.found_mm),
                ],
            },
        ],
        ..Motion::default()
    };
    Ok(show_motion(target, "calibration", &motion)?)
}
