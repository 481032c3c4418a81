//! HTML page of games of two robots: lengths, flights and causes of their ends.

use maud::{Markup, html};
use std::collections::BTreeMap;
use tactnet_plot::{Axis, Page, Series as Curve};

use super::RallyReport;
use crate::page_parts::{axes, captioned, chart, counts_table, legend, percent, table};

/// Maximum throwing distance of the robot in the thesis, in m.
const THESIS_M: f64 = 7.0;

/// Returns a self-contained page.
pub fn rally_page(report: &RallyReport) -> String {
    let content = html! {
        (headline(report))
        (figures(report))
        (flights(report))
        (games(report))
        (counts_table(["Missed because", "Balls"], &report.causes))
        (counts_table(["Nothing thrown because", "Games"], &report.no_throw_causes))
    };
    Page::new("Two robots play catch", content).to_html()
}

fn headline(report: &RallyReport) -> Markup {
    html! {
        p.headline {
            (report.catches) " of " (report.throws) " throws were caught: "
            (percent(report.rate, [report.ci95_low, report.ci95_high])) ". At most " (report.longest) " catches in a row, "
            (format!("{:.1}", report.mean)) " on average over " (report.rallies) " games."
        }
        p {
            "The robots stand " (report.between_m) " m apart; a game ends with the first ball that is not caught. A simulation in stepped "
            "time, seed " (report.seed) "; the interval is Wilson's, 95 %. The thesis shows two robots at it and gives no count."
        }
    }
}

fn figures(report: &RallyReport) -> Markup {
    let none = || "none".to_string();
    let mut rows = vec![[
        "Caught of throws that can be".into(),
        format!(
            "{} of {}",
            report.caught_in_catch_space, report.in_catch_space
        ),
        none(),
    ]];
    let mut row = |what: &str, value: Option<f64>, decimals: usize, thesis: String| {
        if let Some(value) = value {
            rows.push([what.into(), format!("{value:.decimals$}"), thesis]);
        }
    };
    let theirs = format!("up to {THESIS_M:.0}");
    row("Length of flights, mean [m]", report.distance_m, 2, theirs);
    row(
        "Beside the target, root mean square [mm]",
        report.beside_mm_rms,
        0,
        none(),
    );
    row(
        "Nearer for fingers 2 ms early or late, as planned, mean [mm]",
        report.distance_lost_mm_at_2ms,
        0,
        none(),
    );
    row(
        "Elsewhere for fingers 2 ms early or late, as planned, mean [mm]",
        report.displaced_mm_at_2ms,
        0,
        none(),
    );
    table(["What", "Here", "The thesis"], &rows)
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
        lines += &axes.path(Curve::nth(flight.look()), &path);
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

fn games(report: &RallyReport) -> Markup {
    let mut lengths: BTreeMap<usize, usize> = BTreeMap::new();
    for length in &report.lengths {
        *lengths.entry(*length).or_default() += 1;
    }
    let rows: Vec<[String; 2]> = lengths
        .iter()
        .map(|(length, games)| [length.to_string(), games.to_string()])
        .collect();
    html! {
        @if !rows.is_empty() {
            h2 { "Games by length" }
            (table(["Catches in a row", "Games"], &rows))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::page_parts::tests::assert_page;
    use crate::rally::RallyFlight;

    fn report(lengths: Vec<usize>) -> RallyReport {
        let catches = lengths.iter().sum::<usize>();
        RallyReport {
            rallies: lengths.len(),
            seed: 3,
            between_m: 5.0,
            longest: lengths.iter().copied().max().unwrap_or(0),
            mean: 4.5,
            catches,
            throws: catches + lengths.len(),
            no_throws: 0,
            rate: 0.818,
            ci95_low: 0.523,
            ci95_high: 0.949,
            in_catch_space: 11,
            caught_in_catch_space: catches,
            distance_m: Some(4.28),
            distance_lost_mm_at_2ms: Some(13.4),
            displaced_mm_at_2ms: Some(77.0),
            beside_mm_rms: Some(33.0),
            causes: BTreeMap::from([("across".to_string(), 2)]),
            no_throw_causes: BTreeMap::from([("a < b".to_string(), 1)]),
            lengths,
            flights: Vec::new(),
        }
    }

    #[test]
    fn the_page_of_games_shows_flights_lengths_and_causes() {
        let mut games = report(vec![2, 7]);
        games.flights = vec![
            RallyFlight {
                game: 0,
                arm: 0,
                caught: true,
                path: vec![[0.0, 1.4], [2.0, 2.3], [4.3, 1.2]],
            },
            RallyFlight {
                game: 1,
                arm: 1,
                caught: false,
                path: vec![[0.0, 1.4], [2.0, 2.1], [4.0, 1.2]],
            },
        ];
        let page = rally_page(&games);
        assert_page(&page);
        for expected in [
            "9 of 11 throws were caught: 81.8 % [52.3, 94.9]",
            "2 flights from the side, up to 4.30 m far and 2.30 m high",
            "<th scope=\"row\">7</th><td>1</td>",
            "<th scope=\"row\">across</th><td>2</td>",
            "a &lt; b",
            "up to 7",
        ] {
            assert!(page.contains(expected), "{expected}: {page}");
        }
        assert_eq!(page.matches("<svg class=\"figure\"").count(), 1);
        // One caught, one missed.
        assert!(
            page.contains("<g class=\"series s0\"><polyline")
                && page.contains("<g class=\"series s1\"><polyline")
        );
    }

    #[test]
    fn the_page_of_nothing_is_whole() {
        let mut nothing = report(Vec::new());
        nothing.causes.clear();
        nothing.no_throw_causes.clear();
        (nothing.distance_m, nothing.beside_mm_rms) = (None, None);
        (nothing.distance_lost_mm_at_2ms, nothing.displaced_mm_at_2ms) = (None, None);
        let page = rally_page(&nothing);
        assert_page(&page);
        assert!(page.contains("0 of 0 throws") && !page.contains("<svg class=\"figure\""));
        // Games without a catch.
        assert_page(&rally_page(&report(vec![0, 0])));
    }
}
