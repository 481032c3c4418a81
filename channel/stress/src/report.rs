//! The stress test's figures as one page.

use std::fmt::Write;

use tactnet_plot::{STYLE as FIGURE_STYLE, escape, theme};

use crate::Row;
use crate::chart::{Line, log_log};
use crate::plan::{Configuration, StressDomain};

const STYLE: &str = "
html{color-scheme:light dark}
body{font:16px/1.5 system-ui,sans-serif;color:var(--ink);background:var(--ground);max-width:60rem;margin:2rem auto;padding:0 1rem}
figure{margin:1rem 0}
.scroll{overflow-x:auto}table{border-collapse:collapse;font-size:.9rem}td,th{padding:.15rem .6rem;text-align:right;border-bottom:1px solid var(--rule)}
td:nth-child(-n+3),th:nth-child(-n+3){text-align:left}code{overflow-wrap:anywhere}";

/// A self-contained page with the figures 2.6 to 2.9 of the thesis, as far as `rows` has them, and a table of all.
///
/// - `command`, `provenance`: what was run, of which commit, on what machine
pub fn page(rows: &[Row], command: &str, provenance: &str) -> String {
    let mut html = format!(
        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\
         <title>Stress test of the channels</title><style>{}{FIGURE_STYLE}{STYLE}</style><h1>Stress test of the channels</h1>\
         <p>A master sends to C clients, each answers with a packet of the same size; the round trip ends with the last answer (thesis, \
         section 2.4.1). Medians.</p><p><code>{}</code></p><p>{}</p>",
        theme(),
        escape(command),
        escape(provenance)
    );
    for (title, chart) in figures(rows) {
        if let Some(chart) = chart {
            let _ = write!(html, "<h2>{}</h2><figure>{chart}</figure>", escape(&title));
        }
    }
    html.push_str(
        "<h2>All cells</h2><div class=\"scroll\" tabindex=\"0\"><table><tr><th>transport<th>domain<th>configuration<th>size [B]<th>clients\
         <th>rounds<th>min [µs]<th>median [µs]<th>p99 [µs]<th>max [µs]<th>MB/s<th>failures</tr>",
    );
    for row in rows {
        let _ = write!(
            html,
            "<tr><td>{}<td>{}<td>{}<td>{}<td>{}<td>{}<td>{:.1}<td>{:.1}<td>{:.1}<td>{:.1}<td>{:.1}<td>{}{}</tr>",
            row.transport,
            name(row.domain),
            row.configuration,
            row.size,
            row.clients,
            row.rounds,
            row.min_us,
            row.median_us,
            row.p99_us,
            row.max_us,
            row.bandwidth_mb_s,
            row.failures,
            row.failure
                .as_ref()
                .map_or(String::new(), |failure| format!(": {}", escape(failure)))
        );
    }
    html.push_str("</table></div></html>\n");
    html
}

fn figures(rows: &[Row]) -> Vec<(String, Option<String>)> {
    let mut figures = Vec::new();
    let standard = |row: &&Row| row.configuration == Configuration::Standard.name();
    for domain in [
        StressDomain::Process,
        StressDomain::Host,
        StressDomain::Distributed,
    ] {
        let here: Vec<&Row> = rows
            .iter()
            .filter(|row| row.domain == domain && row.rounds > 0)
            .collect();
        let Some(least) = here.iter().map(|row| row.clients).min() else {
            continue;
        };
        let smallest = here.iter().map(|row| row.size).min().unwrap_or(4);
        let large = here
            .iter()
            .map(|row| row.size)
            .filter(|size| *size <= 1 << 20)
            .max();
        let of_least: Vec<&Row> = here
            .iter()
            .copied()
            .filter(standard)
            .filter(|row| row.clients == least)
            .collect();
        figures.push((
            format!(
                "Round trip over packet size, {} domain, C = {least} (figure 2.6)",
                name(domain)
            ),
            log_log(
                "packet size [B]",
                "round trip [µs]",
                &lines(
                    &of_least,
                    |row| row.transport,
                    |row| row.size,
                    |row| row.median_us,
                ),
            ),
        ));
        let small: Vec<&Row> = here
            .iter()
            .copied()
            .filter(|row| row.size == smallest)
            .collect();
        let plain: Vec<&Row> = small.iter().copied().filter(standard).collect();
        figures.push((
            format!(
                "Round trip over clients, {} domain, {smallest} B (figure 2.7, left)",
                name(domain)
            ),
            log_log(
                "clients C",
                "round trip [µs]",
                &lines(
                    &plain,
                    |row| row.transport,
                    |row| row.clients,
                    |row| row.median_us,
                ),
            ),
        ));
        let big: Vec<&Row> = here
            .iter()
            .copied()
            .filter(standard)
            .filter(|row| Some(row.size) == large)
            .collect();
        figures.push((
            format!(
                "Effective bandwidth over clients, {} domain, {} B (figure 2.7, right)",
                name(domain),
                large.unwrap_or(0)
            ),
            log_log(
                "clients C",
                "bandwidth [MB/s]",
                &lines(
                    &big,
                    |row| row.transport,
                    |row| row.clients,
                    |row| row.bandwidth_mb_s,
                ),
            ),
        ));
        let own: Vec<&Row> = small
            .iter()
            .copied()
            .filter(|row| row.transport == "tactnet")
            .collect();
        if own.iter().any(|row| !standard(row)) {
            figures.push((
                format!(
                    "Channels and sync groups, {} domain, {smallest} B (figure 2.8)",
                    name(domain)
                ),
                log_log(
                    "clients C",
                    "round trip [µs]",
                    &lines(
                        &own,
                        |row| row.configuration,
                        |row| row.clients,
                        |row| row.median_us,
                    ),
                ),
            ));
        }
        let hardest: Vec<&Row> = own
            .iter()
            .copied()
            .filter(|row| row.configuration == Configuration::SyncOnN.name())
            .collect();
        let mut with_bars = lines(
            &hardest,
            |row| row.configuration,
            |row| row.clients,
            |row| row.median_us,
        );
        for line in &mut with_bars {
            line.bars = hardest
                .iter()
                .map(|row| (row.clients as f64, row.min_us, row.max_us))
                .collect();
        }
        figures.push((
            format!(
                "Fastest, median and slowest round trip, {} domain, sync on N (figure 2.9)",
                name(domain)
            ),
            log_log("clients C", "round trip [µs]", &with_bars),
        ));
    }
    figures
}

fn lines(
    rows: &[&Row],
    of: fn(&Row) -> &'static str,
    x: fn(&Row) -> usize,
    y: fn(&Row) -> f64,
) -> Vec<Line> {
    let mut lines: Vec<Line> = Vec::new();
    for row in rows {
        let point = (x(row) as f64, y(row));
        match lines.iter_mut().find(|line| line.name == of(row)) {
            Some(line) => line.points.push(point),
            None => lines.push(Line {
                name: of(row).into(),
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

fn name(domain: StressDomain) -> &'static str {
    match domain {
        StressDomain::Process => "process",
        StressDomain::Host => "host",
        StressDomain::Distributed => "distributed",
    }
}
