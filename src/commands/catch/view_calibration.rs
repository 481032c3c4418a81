//! What a calibration leaves unexplained, in the Rerun viewer.

use tactnet_catching_trials::CalibrationReport;
use tactnet_recording::view::{Curves, Motion, Target, show_motion};

/// A feature or a pose takes so long, ns: they have no times of their own.
const STEP_NS: i64 = 10_000_000;

/// Shows features beside where description and calibration put them, and hands at unseen poses, one after the other.
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
                name: "markers beside where the calibration puts them, pixels".into(),
                lines: vec![line("calibrated", &samples.residuals_px)],
            },
            Curves {
                name: "the same of the description, pixels".into(),
                lines: vec![line("as described", &samples.before_px)],
            },
            Curves {
                name: "hands at unseen poses, mm".into(),
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
