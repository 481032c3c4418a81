//! HTML page of a calibration: hands before and after, residuals in pictures, caught balls, all numbers.

use maud::{Markup, html};

use super::CalibrationReport;
use tactnet_plot::report::{Share, at_most, captioned, legend, report_page, shares};

/// Goals for mean and maximum distance, in mm: the results of Agile Justin's calibration (arXiv 2311.08338).
const GOAL_MM: [f64; 2] = [3.9, 9.1];

/// Returns a self-contained page.
pub fn calibration_page(report: &CalibrationReport) -> String {
    let [mean, worst] = GOAL_MM;
    let met = report.mean_mm <= mean && report.worst_mm <= worst;
    let text = format!(
        "Hands are {:.2} mm from where the calibrated stack puts them, {:.2} mm at the worst; before it was {:.1} mm and {:.1} mm.\n\
         The goal of {mean} and {worst} mm is {}. Distances are over {} poses that the calibration has not seen, from both cameras.",
        report.mean_mm,
        report.worst_mm,
        report.raw.mean_mm,
        report.raw.worst_mm,
        if met { "met" } else { "missed" },
        report.unseen
    );
    let figures = html! {
        (hands(report))
        (features(report))
        (catches(report))
    };
    report_page("Calibration", &text, figures, report)
}

fn hands(report: &CalibrationReport) -> Markup {
    let samples = &report.samples;
    let title = format!(
        "Distances of hands at unseen poses: before {:.1} mm on average, after {:.2} mm, from random configurations {:.2} mm",
        report.raw.mean_mm, report.mean_mm, report.random.mean_mm
    );
    let curves = [&samples.raw_mm, &samples.found_mm, &samples.random_mm].map(Vec::clone);
    html! {
        @if let Some(figure) = at_most(&title, "distance [mm]", &curves) {
            h2 { "Hands at unseen poses" }
            (captioned(
                &figure,
                "How far hands are from where the stack puts them, in the cameras' frames: the share of poses and cameras at which it is \
                 at most so much.",
            ))
            (legend(&["before", "after", "after, from random configurations"]))
        }
    }
}

fn features(report: &CalibrationReport) -> Markup {
    let samples = &report.samples;
    let noise = rayleigh(samples.noise_px);
    let curves = [&samples.before_px, &samples.residuals_px, &noise].map(Vec::clone);
    if samples.residuals_px.is_empty() {
        return html! {};
    }
    let caption = format!(
        "Distances of markers in pictures from where the model puts them. After calibration the median is {:.2} times that of noise of {} \
         pixels each way; {:.1} % are more than five standard deviations off, most of them features that are something else.",
        report.solved.fit,
        samples.noise_px,
        100.0 * report.solved.outlying
    );
    html! {
        @if let Some(figure) = at_most("Residuals of markers in pictures", "residual [pixels]", &curves) {
            h2 { "Markers in pictures" }
            (captioned(&figure, &caption))
            (legend(&["before", "after", "noise alone, as the stack assumes it"]))
        }
    }
}

/// Returns lengths of two-dimensional noise: the medians of 100 equally likely parts.
fn rayleigh(sigma: f64) -> Vec<f64> {
    (0..100)
        .map(|part| sigma * (-2.0 * (1.0 - (f64::from(part) + 0.5) / 100.0).ln()).sqrt())
        .filter(|length| *length > 0.0)
        .collect()
}

fn catches(report: &CalibrationReport) -> Markup {
    let share = |look, name: &str, share: Option<f64>, ci95: Option<[f64; 2]>| {
        Some(Share {
            name: name.into(),
            look,
            share: share?,
            ci95: ci95?,
        })
    };
    let (before, after) = (report.catch_rate_before, report.catch_rate_after);
    let all = [
        share(0, "before", before, report.catch_rate_before_ci95),
        share(1, "after", after, report.catch_rate_after_ci95),
    ];
    let all: Vec<Share> = all.into_iter().flatten().collect();
    if all.is_empty() {
        return html! {};
    }
    let caption = format!(
        "Caught of {} balls in the catch space ({} throws), with Wilson's 95 % intervals. The thesis gives no figures.",
        report.in_catch_space, report.throws
    );
    html! {
        h2 { "Balls caught" }
        (captioned(&shares("Balls caught", "caught [%]", &all), &caption))
    }
}
