//! Figures 2.6 to 2.9 of the thesis.

use std::ops::RangeInclusive;

use crate::Row;
use crate::chart::{Chart, Line, log_log};
use crate::plan::{Configuration, StressDomain};

/// Packet sizes of the bandwidth figure, of which the largest is drawn, in bytes.
const LARGE: RangeInclusive<usize> = 1 << 16..=1 << 20;

/// Kind of a figure, in the order of the thesis.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum FigureKind {
    /// Figure 2.6.
    OverSize,
    /// Figure 2.7, left.
    OverClients,
    /// Figure 2.7, right.
    Bandwidth,
    /// Figure 2.8.
    Configurations,
    /// Figure 2.9.
    Extremes,
}

/// A figure of the thesis.
pub(super) struct Figure {
    pub(super) kind: FigureKind,
    pub(super) title: String,
    pub(super) chart: Chart,
}

impl Figure {
    /// Returns `None` without a chart.
    fn new(kind: FigureKind, title: String, chart: Option<Chart>) -> Option<Self> {
        chart.map(|chart| Self { kind, title, chart })
    }
}

/// Returns the figures of each domain that has any.
pub(super) fn figures(rows: &[Row]) -> Vec<Vec<Figure>> {
    StressDomain::ALL
        .iter()
        .filter_map(|&domain| DomainRows::new(domain, rows))
        .map(|rows| {
            let figures = [
                rows.over_size(),
                rows.over_clients(),
                rows.bandwidth(),
                rows.configurations(),
                rows.extremes(),
            ];
            figures.into_iter().flatten().collect::<Vec<_>>()
        })
        .filter(|figures| !figures.is_empty())
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

    fn over_size(&self) -> Option<Figure> {
        let rows = self.filtered(|row| is_standard(row) && row.clients == self.min_clients);
        Figure::new(
            FigureKind::OverSize,
            format!(
                "Round trip over packet size, {} domain, C = {} (figure 2.6)",
                self.domain, self.min_clients
            ),
            log_log(
                "packet size [B]",
                "round trip [µs]",
                &lines(&rows, |row| row.transport, |row| row.size, median),
            ),
        )
    }

    fn over_clients(&self) -> Option<Figure> {
        let rows = self.filtered(|row| is_standard(row) && row.size == self.min_size);
        Figure::new(
            FigureKind::OverClients,
            format!(
                "Round trip over clients, {} domain, {} B (figure 2.7, left)",
                self.domain, self.min_size
            ),
            log_log(
                "clients C",
                "round trip [µs]",
                &lines(&rows, |row| row.transport, |row| row.clients, median),
            ),
        )
    }

    fn bandwidth(&self) -> Option<Figure> {
        let sizes = self.rows.iter().map(|row| row.size);
        let large = sizes.filter(|size| LARGE.contains(size)).max()?;
        let rows = self.filtered(|row| is_standard(row) && row.size == large);
        let bandwidth = |row: &Row| row.bandwidth_mb_s;
        Figure::new(
            FigureKind::Bandwidth,
            format!(
                "Effective bandwidth over clients, {} domain, {} B (figure 2.7, right)",
                self.domain, large
            ),
            log_log(
                "clients C",
                "bandwidth [MB/s]",
                &lines(&rows, |row| row.transport, |row| row.clients, bandwidth),
            ),
        )
    }

    /// Returns `None` if only the standard configuration was measured.
    fn configurations(&self) -> Option<Figure> {
        let rows = self.filtered(|row| self.is_small_and_own(row));
        if rows.iter().all(|row| is_standard(row)) {
            return None;
        }
        Figure::new(
            FigureKind::Configurations,
            format!(
                "Channels and sync groups, {} domain, {} B (figure 2.8)",
                self.domain, self.min_size
            ),
            log_log(
                "clients C",
                "round trip [µs]",
                &lines(&rows, |row| row.configuration, |row| row.clients, median),
            ),
        )
    }

    fn extremes(&self) -> Option<Figure> {
        let is_sync_on_n = |row: &Row| row.configuration == Configuration::SyncOnN.name();
        let rows = self.filtered(|row| self.is_small_and_own(row) && is_sync_on_n(row));
        let mut lines = lines(&rows, |row| row.configuration, |row| row.clients, median);
        let bars = rows
            .iter()
            .map(|row| (row.clients as f64, row.min_us, row.max_us));
        for line in &mut lines {
            line.bars = bars.clone().collect();
        }
        Figure::new(
            FigureKind::Extremes,
            format!(
                "Fastest, median and slowest round trip, {} domain, sync on N (figure 2.9)",
                self.domain
            ),
            log_log("clients C", "round trip [µs]", &lines),
        )
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

/// Returns one line per value of `name`, through the medians of repeated measurements.
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
        line.points = medians(std::mem::take(&mut line.points));
    }
    lines
}

/// Returns one point per value of x, ascending: the median of y, the upper one of an even number.
fn medians(mut points: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    points.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let repeated = points.chunk_by(|a, b| a.0 == b.0);
    repeated.map(|same| same[same.len() / 2]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn repeated_measurements_are_one_point_at_their_median() {
        let points = vec![(2.0, 9.0), (1.0, 3.0), (1.0, 1.0), (1.0, 2.0)];
        assert_eq!(medians(points), [(1.0, 2.0), (2.0, 9.0)]);
    }
}
