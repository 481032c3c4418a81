//! Page with the figures of the stress test.

use maud::{Markup, PreEscaped, html};
use tactnet_plot::Page;

use crate::Row;
use crate::chart::{Line, log_log};
use crate::plan::{Configuration, StressDomain};

const TITLE: &str = "Stress test of the channels";

/// Largest packet of the bandwidth figure, in bytes.
const LARGE: usize = 1 << 20;

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
        @for figure in figures(rows) {
            @if let Some(chart) = figure.chart {
                h2 { (figure.title) }
                figure { (PreEscaped(chart)) }
            }
        }
        h2 { "All cells" }
        (table(rows))
    };
    Page::new(TITLE, content).to_html()
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

/// A figure of the thesis.
struct Figure {
    title: String,
    /// `None` if there are too few measurements.
    chart: Option<String>,
}

fn figures(rows: &[Row]) -> Vec<Figure> {
    let domains = [
        StressDomain::Process,
        StressDomain::Host,
        StressDomain::Distributed,
    ];
    domains
        .iter()
        .filter_map(|&domain| DomainRows::new(domain, rows))
        .flat_map(|rows| {
            let figures = [rows.over_size(), rows.over_clients(), rows.bandwidth()];
            let rest = rows.configurations().into_iter().chain([rows.extremes()]);
            figures.into_iter().chain(rest).collect::<Vec<_>>()
        })
        .collect()
}

/// Measurements of one domain.
struct DomainRows<'a> {
    domain: &'static str,
    rows: Vec<&'a Row>,
    min_clients: usize,
    min_size: usize,
}

impl<'a> DomainRows<'a> {
    /// Returns `None` for a domain without measurements.
    fn new(domain: StressDomain, rows: &'a [Row]) -> Option<Self> {
        let measured = |row: &&Row| row.domain == domain && row.rounds > 0;
        let rows: Vec<&Row> = rows.iter().filter(measured).collect();
        Some(Self {
            domain: domain.name(),
            min_clients: rows.iter().map(|row| row.clients).min()?,
            min_size: rows.iter().map(|row| row.size).min()?,
            rows,
        })
    }

    fn filtered(&self, is_shown: impl Fn(&Row) -> bool) -> Vec<&'a Row> {
        let rows = self.rows.iter().copied();
        rows.filter(|row| is_shown(row)).collect()
    }

    /// Figure 2.6.
    fn over_size(&self) -> Figure {
        let rows = self.filtered(|row| is_standard(row) && row.clients == self.min_clients);
        Figure {
            title: format!(
                "Round trip over packet size, {} domain, C = {} (figure 2.6)",
                self.domain, self.min_clients
            ),
            chart: log_log(
                "packet size [B]",
                "round trip [µs]",
                &lines(&rows, |row| row.transport, |row| row.size, median),
            ),
        }
    }

    /// Figure 2.7, left.
    fn over_clients(&self) -> Figure {
        let rows = self.filtered(|row| is_standard(row) && row.size == self.min_size);
        Figure {
            title: format!(
                "Round trip over clients, {} domain, {} B (figure 2.7, left)",
                self.domain, self.min_size
            ),
            chart: log_log(
                "clients C",
                "round trip [µs]",
                &lines(&rows, |row| row.transport, |row| row.clients, median),
            ),
        }
    }

    /// Figure 2.7, right.
    fn bandwidth(&self) -> Figure {
        let sizes = self.rows.iter().map(|row| row.size);
        let large = sizes.filter(|size| *size <= LARGE).max();
        let rows = self.filtered(|row| is_standard(row) && Some(row.size) == large);
        let bandwidth = |row: &Row| row.bandwidth_mb_s;
        Figure {
            title: format!(
                "Effective bandwidth over clients, {} domain, {} B (figure 2.7, right)",
                self.domain,
                large.unwrap_or(0)
            ),
            chart: log_log(
                "clients C",
                "bandwidth [MB/s]",
                &lines(&rows, |row| row.transport, |row| row.clients, bandwidth),
            ),
        }
    }

    /// Figure 2.8; `None` if only the standard configuration was measured.
    fn configurations(&self) -> Option<Figure> {
        let rows = self.filtered(|row| self.is_small_and_own(row));
        rows.iter().any(|row| !is_standard(row)).then(|| Figure {
            title: format!(
                "Channels and sync groups, {} domain, {} B (figure 2.8)",
                self.domain, self.min_size
            ),
            chart: log_log(
                "clients C",
                "round trip [µs]",
                &lines(&rows, |row| row.configuration, |row| row.clients, median),
            ),
        })
    }

    /// Figure 2.9.
    fn extremes(&self) -> Figure {
        let is_sync_on_n = |row: &Row| row.configuration == Configuration::SyncOnN.name();
        let rows = self.filtered(|row| self.is_small_and_own(row) && is_sync_on_n(row));
        let mut lines = lines(&rows, |row| row.configuration, |row| row.clients, median);
        let bars = rows
            .iter()
            .map(|row| (row.clients as f64, row.min_us, row.max_us));
        for line in &mut lines {
            line.bars = bars.clone().collect();
        }
        Figure {
            title: format!(
                "Fastest, median and slowest round trip, {} domain, sync on N (figure 2.9)",
                self.domain
            ),
            chart: log_log("clients C", "round trip [µs]", &lines),
        }
    }

    fn is_small_and_own(&self, row: &Row) -> bool {
        row.size == self.min_size && row.transport == "tactnet"
    }
}

fn is_standard(row: &Row) -> bool {
    row.configuration == Configuration::Standard.name()
}

fn median(row: &Row) -> f64 {
    row.median_us
}

/// Returns one line per value of `name`.
fn lines(
    rows: &[&Row],
    name: fn(&Row) -> &'static str,
    x: fn(&Row) -> usize,
    y: fn(&Row) -> f64,
) -> Vec<Line> {
    let mut lines: Vec<Line> = Vec::new();
    for row in rows {
        let point = (x(row) as f64, y(row));
        match lines.iter_mut().find(|line| line.name == name(row)) {
            Some(line) => line.points.push(point),
            None => lines.push(Line {
                name: name(row).into(),
                points: vec![point],
                bars: Vec::new(),
            }),
        }
    }
    for line in &mut lines {
        line.points.sort_by(|a, b| a.0.total_cmp(&b.0));
    }
    lines
}
