//! HTML page of games of two robots: lengths, flights and causes of their ends.

use std::collections::BTreeMap;
use std::fmt::Write;

use tactnet_plot::{Axes, Axis, Series as Curve, figure, legend};

use super::RallyReport;
use super::flight::MOST_LATE;
use crate::sheet::{LEFT, WIDTH, captioned, counts_table, percent, sheet, table};

/// Maximum throwing distance of the robot in the thesis, in m.
const THESIS_M: f64 = 7.0;

/// Returns a self-contained page.
pub fn rally_page(report: &RallyReport) -> String {
    let mut html = String::new();
    headline(&mut html, report);
    html += &figures(report);
    flights(&mut html, report);
    timing(&mut html, report);
    games(&mut html, report);
    causes(&mut html, report);
    sheet("Two robots play catch", &html)
}

fn headline(html: &mut String, report: &RallyReport) {
    let _ = write!(
        html,
        "<p class=\"headline\">{} of {} throws were caught: {}. At most {} catches in a row, {:.1} on average over {} games.</p>\
         <p>The robots stand {} m apart; a game ends with the first ball that is not caught. A simulation in stepped time, seed {}; the \
         interval is Wilson's, 95 %. The thesis shows two robots at it and gives no count.</p>",
        report.catches,
        report.throws,
        percent(report.rate, [report.ci95_low, report.ci95_high]),
        report.longest,
        report.mean,
        report.rallies,
        report.between_m,
        report.seed
    );
}

fn figures(report: &RallyReport) -> String {
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

fn flights(html: &mut String, report: &RallyReport) {
    let points = || report.flights.iter().flat_map(|flight| &flight.path);
    let farthest = points().map(|[far, _]| *far).fold(0.0, f64::max);
    let highest = points().map(|[_, high]| *high).fold(0.0, f64::max);
    if farthest <= 0.0 {
        return;
    }
    let axes = Axes {
        left: LEFT,
        top: 12.0,
        width: WIDTH - LEFT - 16.0,
        height: 220.0,
        horizontal: Axis::linear("from the release [m]", 0.0..=farthest.ceil(), 1.0),
        vertical: Axis::linear("height [m]", 0.0..=(2.0 * highest).ceil() / 2.0, 0.5),
    };
    let mut lines = axes.grid();
    for flight in &report.flights {
        let path: Vec<(f64, f64)> = flight.path.iter().map(|[x, z]| (*x, *z)).collect();
        lines += &axes.path(Curve::nth(flight.look()), &path);
    }
    let title = format!(
        "{} flights from the side, up to {farthest:.2} m far and {highest:.2} m high",
        report.flights.len()
    );
    let caption = "The first throws of the first games, as the balls truly flew or would have flown on, down to the height that they are \
                   aimed at.";
    let _ = write!(
        html,
        "<h2>Flights</h2>{}",
        captioned(
            &figure(WIDTH, 280.0, &title, &lines),
            caption,
            &legend(&["caught", "missed"])
        )
    );
}

fn timing(html: &mut String, report: &RallyReport) {
    let most = report
        .flights
        .iter()
        .flat_map(|flight| &flight.timing)
        .map(|[_, nearer]| nearer.abs())
        .fold(0.0, f64::max);
    if most <= 0.0 {
        return;
    }
    let step = 10f64.powf(most.log10().floor());
    let edge = (most / step).ceil() * step;
    let latest = f64::from(MOST_LATE);
    let axes = Axes {
        left: LEFT,
        top: 12.0,
        width: WIDTH - LEFT - 16.0,
        height: 220.0,
        horizontal: Axis::linear("fingers open late [ms]", -latest..=latest, 1.0),
        vertical: Axis::linear("farther [mm]", -edge..=edge, edge / 2.0),
    };
    let mut lines = axes.grid();
    for flight in &report.flights {
        let points: Vec<(f64, f64)> = flight.timing.iter().map(|[t, near]| (*t, -near)).collect();
        lines += &axes.line(Curve::nth(flight.arm), &points, 1);
    }
    let lost = report.distance_lost_mm_at_2ms.unwrap_or_default();
    let title = format!(
        "How much farther balls come down if fingers open early or late; 2 ms cost {lost:.0} mm on average"
    );
    let caption = "The same throws as planned, if fingers open early (to the left) or late: how much farther the ball comes down; less than \
                   0: nearer.";
    let _ = write!(
        html,
        "<h2>What a release early or late costs</h2>{}",
        captioned(
            &figure(WIDTH, 280.0, &title, &lines),
            caption,
            &legend(&["left arm", "right arm"])
        )
    );
}

fn games(html: &mut String, report: &RallyReport) {
    let mut lengths: BTreeMap<usize, usize> = BTreeMap::new();
    for length in &report.lengths {
        *lengths.entry(*length).or_default() += 1;
    }
    if lengths.is_empty() {
        return;
    }
    let rows: Vec<[String; 2]> = lengths
        .iter()
        .map(|(length, games)| [length.to_string(), games.to_string()])
        .collect();
    html.push_str("<h2>Games by length</h2>");
    if report.longest > 0 {
        // Games with at least the given number of catches.
        let lasted: Vec<(f64, f64)> = (0..=report.longest)
            .map(|catches| {
                let on = report.lengths.iter().filter(|length| **length >= catches);
                (
                    catches as f64,
                    on.count() as f64 / report.lengths.len() as f64,
                )
            })
            .collect();
        let axes = Axes {
            left: LEFT,
            top: 12.0,
            width: WIDTH - LEFT - 16.0,
            height: 180.0,
            horizontal: Axis::linear(
                "catches in a row",
                0.0..=report.longest as f64,
                (report.longest as f64 / 10.0).ceil(),
            ),
            vertical: Axis::percent("games that lasted so long [%]", 1.0, 0.25),
        };
        let title = format!(
            "Share of games by catches in a row: {:.1} on average, {} at most",
            report.mean, report.longest
        );
        let lines = axes.grid() + &axes.path(Curve::nth(0), &lasted);
        let caption = "The share of games with at least so many catches in a row.";
        *html += &captioned(&figure(WIDTH, 240.0, &title, &lines), caption, "");
    }
    *html += &table(["Catches in a row", "Games"], &rows);
}

fn causes(html: &mut String, report: &RallyReport) {
    for (head, causes) in [
        (["Missed because", "Balls"], &report.causes),
        (["Nothing thrown because", "Games"], &report.no_throw_causes),
    ] {
        *html += &counts_table(head, causes);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rally::RallyFlight;
    use crate::sheet::tests::assert_page;

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
                timing: vec![[-2.0, 13.0], [0.0, 0.0], [2.0, -11.0]],
            },
            RallyFlight {
                game: 1,
                arm: 1,
                caught: false,
                path: vec![[0.0, 1.4], [2.0, 2.1], [4.0, 1.2]],
                timing: Vec::new(),
            },
        ];
        let page = rally_page(&games);
        assert_page(&page);
        for expected in [
            "9 of 11 throws were caught: 81.8 % [52.3, 94.9]",
            "2 flights from the side, up to 4.30 m far and 2.30 m high",
            "2 ms cost 13 mm on average",
            "<th scope=\"row\">7</th><td>1</td>",
            "<th scope=\"row\">across</th><td>2</td>",
            "a &lt; b",
            "up to 7",
        ] {
            assert!(page.contains(expected), "{expected}: {page}");
        }
        assert_eq!(page.matches("<svg class=\"figure\"").count(), 3);
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
