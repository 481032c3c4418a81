//! HTML page of games of two robots: flights and all numbers.

use maud::{Markup, html};
use tactnet_plot::{Axis, Series as Curve};

use super::RallyReport;
use tactnet_plot::report::{axes, captioned, chart, legend, percent, report_page};

/// Returns a self-contained page.
pub fn rally_page(report: &RallyReport) -> String {
    let text = format!(
        "{} of {} throws were caught: {}.\nAt most {} catches in a row, {:.1} on average over {} games at {} m.",
        report.catches,
        report.throws,
        percent(report.rate, [report.ci95_low, report.ci95_high]),
        report.longest,
        report.mean,
        report.rallies,
        report.between_m
    );
    report_page("Two robots play catch", &text, flights(report), report)
}

fn flights(report: &RallyReport) -> Markup {
    let points = || report.flights.iter().flat_map(|flight| &flight.path);
    let farthest = points().map(|[far, _]| *far).fold(0.0, f64::max);
    let highest = points().map(|[_, high]| *high).fold(0.0, f64::max);
    if farthest <= 0.0 {
        return html! {};
    }
    let axes = axes(
        220.0,
        Axis::linear("from the release [m]", 0.0..=farthest.ceil(), 1.0),
        Axis::linear("height [m]", 0.0..=(2.0 * highest).ceil() / 2.0, 0.5),
    );
    let mut lines = String::new();
    for flight in &report.flights {
        let path: Vec<(f64, f64)> = flight.path.iter().map(|[x, z]| (*x, *z)).collect();
        lines += &axes.path(Curve::nth(usize::from(!flight.caught)), &path);
    }
    let title = format!(
        "{} flights from the side, up to {farthest:.2} m far and {highest:.2} m high",
        report.flights.len()
    );
    html! {
        h2 { "Flights" }
        (captioned(
            &chart(&title, &axes, &lines),
            "The first throws of the first games, as the balls truly flew or would have flown on, down to the height that they are aimed at.",
        ))
        (legend(&["caught", "missed"]))
    }
}
