//! Page and picture with the figures of the stress test.

use std::collections::BTreeSet;

use maud::{Markup, PreEscaped, html};
use tactnet_plot::{Page, escape, figure, stand_alone, text_width};

use crate::Row;
use crate::figures::{FigureKind, figures};

const TITLE: &str = "Stress test of the channels";

/// Height of the title of a figure in the picture, user units.
const TITLE_HEIGHT: f64 = 24.0;
/// Left edge of the title, which is that of the axes, user units.
const TITLE_LEFT: f64 = 52.0;

/// Origin of the measurements, as text.
#[derive(Debug, Clone, Copy)]
pub struct Origin<'a> {
    /// Command that was run.
    pub command: &'a str,
    /// Commit and machine.
    pub machine: &'a str,
}

/// Returns a self-contained HTML page with figures 2.6 to 2.9 of the thesis, as far as `rows` has the data, and a table of all rows.
pub fn page(rows: &[Row], origin: Origin<'_>) -> String {
    let content = html! {
        p {
            "A master sends to C clients, and each answers with a packet of the same size. The round trip ends with the last answer "
            "(thesis, section 2.4.1). The figures show medians."
        }
        p { code { (origin.command) } }
        p { (origin.machine) }
        @for drawn in figures(rows).into_iter().flatten() {
            h2 { (drawn.title) }
            figure { (PreEscaped(figure(drawn.chart.width, drawn.chart.height, &drawn.chart.title, &drawn.chart.content))) }
        }
        h2 { "All cells" }
        (table(rows))
    };
    Page::new(TITLE, content).to_html()
}

/// Returns figures 2.6 to 2.9 of the thesis, as far as `rows` has the data, as one SVG file: a column for each domain, a row for each
/// figure. `None` if there are too few measurements for a line.
pub fn picture(rows: &[Row]) -> Option<String> {
    let columns = figures(rows);
    let drawn = || columns.iter().flatten();
    let title_end = |title: &String| TITLE_LEFT + 1.2 * text_width(&[title]);
    let column_width = drawn()
        .map(|figure| figure.chart.width.max(title_end(&figure.title)))
        .reduce(f64::max)?;
    let kinds: BTreeSet<FigureKind> = drawn().map(|figure| figure.kind).collect();
    let (mut content, mut height) = (String::new(), 0.0);
    for kind in kinds {
        let mut bottom = height;
        for (number, column) in columns.iter().enumerate() {
            for figure in column.iter().filter(|figure| figure.kind == kind) {
                let chart = &figure.chart;
                content.push_str(&format!(
                    "<g transform=\"translate({:.0} {:.0})\"><text x=\"{TITLE_LEFT}\" y=\"0\">{}</text>\n{}</g>\n",
                    number as f64 * column_width,
                    height + TITLE_HEIGHT,
                    escape(&figure.title),
                    chart.content
                ));
                bottom = f64::max(bottom, height + TITLE_HEIGHT + chart.height);
            }
        }
        height = bottom;
    }
    let width = column_width * columns.len() as f64;
    Some(stand_alone(width, height, TITLE, &content))
}

fn table(rows: &[Row]) -> Markup {
    html! {
        div.scroll tabindex="0" {
            table {
                tr {
                    @for heading in [
                        "transport", "domain", "configuration", "size [B]", "clients", "rounds", "min [µs]", "median [µs]", "p99 [µs]",
                        "max [µs]", "MB/s", "failures",
                    ] {
                        th { (heading) }
                    }
                }
                @for row in rows {
                    tr {
                        td { (row.transport) }
                        td { (row.domain.name()) }
                        td { (row.configuration) }
                        td { (row.size) }
                        td { (row.clients) }
                        td { (row.rounds) }
                        @for number in [row.min_us, row.median_us, row.p99_us, row.max_us, row.bandwidth_mb_s] {
                            td { (format!("{number:.1}")) }
                        }
                        td {
                            (row.failures)
                            @if let Some(failure) = &row.failure { ": " (failure) }
                        }
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Configuration, StressDomain};

    /// Measurements of 1, 10 and 100 clients in two domains, two turns each.
    fn rows() -> Vec<Row> {
        let mut rows = Vec::new();
        for domain in [StressDomain::Process, StressDomain::Namespaces] {
            let own = Configuration::ALL.map(|configuration| ("tactnet", configuration.name()));
            for (transport, configuration) in own.into_iter().chain([("zenoh", "standard")]) {
                for (turn, clients) in [(1.0, 1), (1.0, 10), (1.0, 100), (2.0, 1)] {
                    rows.push(Row {
                        transport,
                        domain,
                        configuration,
                        size: 4,
                        clients,
                        rounds: 7,
                        min_us: 10.0 * turn,
                        median_us: 50.0 * turn,
                        p99_us: 80.0 * turn,
                        max_us: 90.0 * turn,
                        failures: 0,
                        bandwidth_mb_s: 1.0,
                        failure: None,
                    });
                }
            }
        }
        rows
    }

    /// Returns the numbers of points of all lines, without those of the legends.
    fn points(svg: &str) -> Vec<usize> {
        svg.split("<polyline points=\"")
            .skip(1)
            .map(|line| line.split('"').next().unwrap_or_default())
            .map(|points| points.split(' ').count())
            .filter(|count| *count != 2)
            .collect()
    }

    #[test]
    fn the_picture_has_a_line_for_each_configuration_and_transport_of_a_domain() {
        let rows = rows();
        let svg = picture(&rows).unwrap();
        // Of each domain: two transports (figure 2.7), five configurations (2.8), sync on N (2.9); repeated turns are one point.
        assert_eq!(points(&svg), [3; 2 * (2 + 5 + 1)]);
        for name in ["process domain", "namespaces domain", "zenoh", "1 sync"] {
            assert!(svg.contains(name), "{name}");
        }
        let bars = svg.matches("class=\"range\"").count();
        assert_eq!(bars, 2 * 4, "a bar for each measurement of figure 2.9");

        let without = |name: &str| {
            let kept = rows
                .iter()
                .filter(|row| row.transport != name && row.configuration != name);
            points(&picture(&kept.cloned().collect::<Vec<_>>()).unwrap()).len()
        };
        assert_eq!(without("zenoh"), 2 * (1 + 5 + 1));
        assert_eq!(without("N sync"), 2 * (2 + 4 + 1));
    }

    #[test]
    fn one_number_of_clients_and_one_size_make_no_picture() {
        let rows: Vec<Row> = rows().into_iter().filter(|row| row.clients == 1).collect();
        assert_eq!(picture(&rows), None);
    }
}
