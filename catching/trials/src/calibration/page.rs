//! HTML page of a calibration: hands before and after, residuals in pictures, value of the configurations, caught
//! balls.

use maud::{Markup, html};
use std::collections::BTreeMap;
use tactnet_plot::Page;

use super::CalibrationReport;
use crate::page_parts::{Share, at_most, captioned, legend, percent, shares, table};

/// Goals for mean and maximum distance, in mm: the results of Agile Justin's calibration (arXiv 2311.08338).
const GOAL_MM: [f64; 2] = [3.9, 9.1];
/// Goal for the time of the solver, in s.
const GOAL_SOLVE: f64 = 10.0;
/// Maximum error of the nominal geometry of Agile Justin, in mm.
const THEIRS_RAW_MM: f64 = 61.0;
/// Duration of a session in the thesis, in min.
const THESIS_MINUTES: f64 = 5.0;
/// Number of listed parameter directions.
const DIRECTIONS: usize = 8;

/// Returns a self-contained page.
pub fn calibration_page(report: &CalibrationReport) -> String {
    let content = html! {
        (headline(report))
        (figures(report))
        (hands(report))
        (features(report))
        (configurations(report))
        (determined(report))
        (catches(report))
    };
    Page::new("Calibration", content).to_html()
}

fn headline(report: &CalibrationReport) -> Markup {
    let mm = |value: f64| format!("{value:.2} mm");
    let [mean, worst] = GOAL_MM;
    let met = report.mean_mm <= mean && report.worst_mm <= worst;
    html! {
        p.headline {
            @if report.unseen == 0 {
                "No unseen poses: nothing says how good the calibration is."
            } @else {
                "Hands are " (mm(report.mean_mm)) " from where the calibrated stack puts them, " (mm(report.worst_mm))
                (format!(" at the worst; before it was {:.1} mm and {:.1} mm.", report.raw.mean_mm, report.raw.worst_mm))
            }
            @if let (Some(before), Some(after), Some(ci95_before), Some(ci95_after)) = (
                report.catch_rate_before,
                report.catch_rate_after,
                report.catch_rate_before_ci95,
                report.catch_rate_after_ci95,
            ) {
                " Balls caught: " (percent(before, ci95_before)) " before, " (percent(after, ci95_after)) " after."
            }
        }
        p {
            @if report.unseen > 0 {
                "The goal of " (mean) " and " (worst) " mm is " (if met { "met" } else { "missed" }) ". Distances are over "
                (report.unseen) " poses that the calibration has not seen, from both cameras. "
            }
            "A simulated robot with planted errors, seed " (report.seed) "; intervals are Wilson's, 95 %."
        }
    }
}

fn figures(report: &CalibrationReport) -> Markup {
    let solved = &report.solved;
    let none = || "none".to_string();
    let mut rows = Vec::new();
    if report.unseen > 0 {
        let mm = |value: f64| format!("{value:.2} mm");
        let raw = &report.raw;
        rows.push(["Hands off before: mean".into(), mm(raw.mean_mm), none()]);
        let theirs = format!("{THEIRS_RAW_MM:.0} mm on Agile Justin");
        rows.push(["Hands off before: worst".into(), mm(raw.worst_mm), theirs]);
        let goal = |mm: f64| format!("at most {mm} mm, as on Agile Justin");
        rows.push([
            "Hands off after: mean".into(),
            mm(report.mean_mm),
            goal(GOAL_MM[0]),
        ]);
        rows.push([
            "Hands off after: worst".into(),
            mm(report.worst_mm),
            goal(GOAL_MM[1]),
        ]);
    }
    rows.push([
        "Time of the robot".into(),
        format!("{:.0} s", solved.robot_seconds),
        format!("about {THESIS_MINUTES:.0} min in the thesis"),
    ]);
    rows.push([
        "Time of the solver (this machine)".into(),
        format!(
            "{:.2} s, {} iterations",
            solved.solve_seconds, solved.iterations
        ),
        format!("less than {GOAL_SOLVE:.0} s"),
    ]);
    rows.push([
        "Configurations, features".into(),
        format!("{}, {}", solved.configurations, solved.features),
        none(),
    ]);
    table(["What", "Here", "Goal, or elsewhere"], &rows)
}

fn hands(report: &CalibrationReport) -> Markup {
    let samples = &report.samples;
    let title = format!(
        "Distances of hands at unseen poses: before {:.1} mm on average, after {:.2} mm, from random configurations {:.2} mm",
        report.raw.mean_mm, report.mean_mm, report.random.mean_mm
    );
    let curves = [
        samples.raw_mm.clone(),
        samples.found_mm.clone(),
        samples.random_mm.clone(),
    ];
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
    let curves = [
        samples.before_px.clone(),
        samples.residuals_px.clone(),
        noise,
    ];
    if samples.residuals_px.is_empty() {
        return html! {};
    }
    let title = format!(
        "Residuals of markers in pictures: the median is {:.2} times that of the noise, {:.1} % are more than five standard deviations off",
        report.solved.fit,
        100.0 * report.solved.outlying
    );
    let caption = format!(
        "How far markers are in pictures from where the model puts them. After calibration the median is {:.2} times that of noise of {} \
         pixels each way; {:.1} % are more than five standard deviations off, most of them features that are something else.",
        report.solved.fit,
        samples.noise_px,
        100.0 * report.solved.outlying
    );
    html! {
        @if let Some(figure) = at_most(&title, "residual [pixels]", &curves) {
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

fn configurations(report: &CalibrationReport) -> Markup {
    let (solved, random) = (&report.solved, &report.random);
    let rows = [
        [
            "log det of what is known, in standard deviations of the priors".into(),
            format!("{:.1}", report.log_det),
            format!("{:.1}", random.log_det),
        ],
        [
            "Hands off: mean [mm]".into(),
            format!("{:.2}", report.mean_mm),
            format!("{:.2}", random.mean_mm),
        ],
        [
            "Hands off: worst [mm]".into(),
            format!("{:.2}", report.worst_mm),
            format!("{:.2}", random.worst_mm),
        ],
        [
            "Time of the robot [s]".into(),
            format!("{:.0}", solved.robot_seconds),
            format!("{:.0}", random.robot_seconds),
        ],
    ];
    let chosen = format!("Chosen from {}", report.candidates);
    html! {
        h2 { "Chosen and random configurations" }
        (table(["What", &chosen, "As many drawn ones"], &rows))
    }
}

fn determined(report: &CalibrationReport) -> Markup {
    let rows: Vec<[String; 2]> = report
        .solved
        .worst_determined
        .iter()
        .take(DIRECTIONS)
        .map(|direction| {
            let parts: Vec<String> = direction
                .unknowns
                .iter()
                .map(|(name, part)| format!("{part:+.2} {name}"))
                .collect();
            [parts.join("; "), format!("{:.3}", direction.left)]
        })
        .collect();
    html! {
        @if !rows.is_empty() {
            h2 { "What is hardly determined" }
            p {
                "Directions of the 79 unknowns, measured in standard deviations of their priors, of which the session says least. 1: it says "
                "nothing, and the prior decides."
            }
            (table(["Direction", "Standard deviation left, of that before"], &rows))
        }
    }
}

fn catches(report: &CalibrationReport) -> Markup {
    let rates = [
        (
            "before",
            report.catch_rate_before,
            report.catch_rate_before_ci95,
        ),
        (
            "after",
            report.catch_rate_after,
            report.catch_rate_after_ci95,
        ),
    ];
    let all: Vec<Share> = rates
        .into_iter()
        .enumerate()
        .filter_map(|(look, (name, share, ci95))| {
            Some(Share {
                name: name.into(),
                look,
                share: share?,
                ci95: ci95?,
            })
        })
        .collect();
    if all.is_empty() {
        return html! {};
    }
    let caption = format!(
        "Caught of {} balls in the catch space ({} throws), with Wilson's 95 % intervals. The thesis gives no figures.",
        report.in_catch_space, report.throws
    );
    let mut causes: BTreeMap<&str, [usize; 2]> = BTreeMap::new();
    for (column, misses) in [&report.misses_before, &report.misses_after]
        .into_iter()
        .enumerate()
    {
        for (cause, count) in misses {
            causes.entry(cause).or_default()[column] = *count;
        }
    }
    let rows: Vec<[String; 3]> = causes
        .into_iter()
        .map(|(cause, [before, after])| [cause.to_string(), before.to_string(), after.to_string()])
        .collect();
    html! {
        h2 { "Balls caught" }
        (captioned(&shares("Balls caught", "caught [%]", &all), &caption))
        @if !rows.is_empty() { (table(["Missed because", "Balls before", "Balls after"], &rows)) }
    }
}

#[cfg(test)]
mod tests {
    use tactnet_catching::Robot;
    use tactnet_catching::calibrate::{
        Calibration, Determined, KeptCalibration, Priors, Session, UNKNOWNS, Unknowns,
    };

    use super::*;
    use crate::calibration::{CalibrationSamples, Distances, RandomFigures, SolveReport};
    use crate::page_parts::tests::assert_page;

    /// Returns the report of an empty session.
    fn nothing() -> CalibrationReport {
        let unknowns = Unknowns::zeros(UNKNOWNS);
        let sigmas = Priors::default().sigmas().unwrap();
        let covariance = &sigmas * sigmas.transpose();
        let robot = Robot::nominal();
        CalibrationReport {
            seed: 7,
            mean_mm: 0.0,
            worst_mm: 0.0,
            raw: Distances {
                mean_mm: 0.0,
                worst_mm: 0.0,
            },
            unseen: 0,
            solved: SolveReport {
                configurations: 0,
                features: 0,
                robot_seconds: 0.0,
                solve_seconds: 0.0,
                iterations: 0,
                cost: 0.0,
                fit: 0.0,
                outlying: 0.0,
                worst_determined: Vec::new(),
                calibration: Calibration::of(&unknowns),
                kept: KeptCalibration::new(&robot, &unknowns, &covariance),
            },
            candidates: 0,
            log_det: 0.0,
            random: RandomFigures {
                log_det: 0.0,
                log_det_gain: 0.0,
                mean_mm: 0.0,
                worst_mm: 0.0,
                robot_seconds: 0.0,
            },
            throws: 0,
            in_catch_space: 0,
            catch_rate_before: None,
            catch_rate_after: None,
            catch_rate_before_ci95: None,
            catch_rate_after_ci95: None,
            misses_before: BTreeMap::new(),
            misses_after: BTreeMap::new(),
            session: Session::default(),
            samples: CalibrationSamples::default(),
        }
    }

    #[test]
    fn the_page_of_a_calibration_says_what_it_found() {
        let mut report = nothing();
        report.unseen = 2;
        (report.mean_mm, report.worst_mm) = (0.87, 1.93);
        report.raw = Distances {
            mean_mm: 28.44,
            worst_mm: 58.21,
        };
        report.solved.fit = 1.01;
        report.solved.worst_determined = vec![Determined {
            left: 0.998,
            unknowns: vec![("tilt <neck>".into(), 0.71), ("turn".into(), -0.7)],
        }];
        report.samples = CalibrationSamples {
            raw_mm: vec![20.0, 25.0, 30.0, 58.21],
            found_mm: vec![0.5, 0.6, 0.9, 1.93],
            random_mm: vec![0.4, 0.6, 1.0, 2.0],
            before_px: vec![9.0, 30.0, 1000.0],
            residuals_px: vec![0.1, 0.3, 0.5],
            noise_px: 0.3,
        };
        report.in_catch_space = 40;
        (report.catch_rate_before, report.catch_rate_after) = (Some(0.0), Some(0.975));
        report.catch_rate_before_ci95 = Some([0.0, 0.088]);
        report.catch_rate_after_ci95 = Some([0.871, 0.996]);
        report.misses_before.insert("not tracked".into(), 40);
        report.misses_after.insert("across".into(), 1);
        let page = calibration_page(&report);
        assert_page(&page);
        for expected in [
            "0.87 mm from where the calibrated stack puts them, 1.93 mm at the worst",
            "28.4 mm and 58.2 mm",
            "is met",
            "97.5 % [87.1, 99.6] after",
            "+0.71 tilt &lt;neck&gt;; -0.70 turn</th><td>0.998",
            "<th scope=\"row\">not tracked</th><td>40</td><td>0</td>",
            "61 mm on Agile Justin",
        ] {
            assert!(page.contains(expected), "{expected}: {page}");
        }
        // Hands, markers and catches.
        assert_eq!(page.matches("<svg class=\"figure\"").count(), 3);
        report.worst_mm = 9.2;
        assert!(calibration_page(&report).contains("is missed"));
    }

    #[test]
    fn the_page_of_nothing_is_whole() {
        let mut report = nothing();
        let page = calibration_page(&report);
        assert_page(&page);
        assert!(page.contains("No unseen poses") && !page.contains("<svg class=\"figure\""));
        (report.catch_rate_before, report.catch_rate_after) = (Some(0.0), Some(0.0));
        report.catch_rate_before_ci95 = Some([0.0, 1.0]);
        report.catch_rate_after_ci95 = Some([0.0, 1.0]);
        assert_page(&calibration_page(&report));
    }
}
