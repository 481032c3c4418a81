//! Counters and latencies of the service, shared between threads and exported to Prometheus.

use std::collections::BTreeMap;
use std::fmt::{self, Write};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use tactnet_skin::packets::{Counters, Stage};

/// Upper bounds of the histogram buckets of compute times, in µs.
const BOUNDS_US: [u64; 12] = [
    100, 200, 300, 500, 750, 1000, 1333, 2000, 3000, 4000, 6000, 10_000,
];

/// Metrics of the service: written by one thread, read by any.
#[derive(Debug, Default)]
pub struct Metrics {
    frames: AtomicU64,
    dropped_frames: AtomicU64,
    unknown: AtomicU64,
    rejected: AtomicU64,
    deadline_misses: AtomicU64,
    worst_delay_ns: AtomicU64,
    uncompared: AtomicU64,
    compute: [Histogram; 3],
    version: AtomicU64,
    /// Run directory of each version.
    models: Mutex<BTreeMap<u64, String>>,
}

/// Histogram of the compute times of one prediction stage.
#[derive(Debug, Default)]
struct Histogram {
    buckets: [AtomicU64; BOUNDS_US.len() + 1],
    sum_ns: AtomicU64,
}

const STAGES: [(Stage, &str); 3] = [
    (Stage::Anytime, "anytime"),
    (Stage::Plain, "plain"),
    (Stage::Dropout, "dropout"),
];

impl Metrics {
    pub(crate) fn count(&self, counters: &Counters) {
        for (to, from) in [
            (&self.frames, counters.frames),
            (&self.dropped_frames, counters.dropped_frames),
            (&self.unknown, counters.unknown),
            (&self.rejected, counters.rejected),
            (&self.deadline_misses, counters.deadline_misses),
            (&self.worst_delay_ns, counters.worst_delay_ns),
        ] {
            to.store(from, Ordering::Relaxed);
        }
    }

    /// Returns metrics with a first serving version.
    pub(crate) fn serving(version: u64, model: &Path) -> Self {
        let metrics = Self::default();
        metrics.loaded(version, model);
        metrics.serve(version);
        metrics
    }

    /// Records the run directory of a version, before it serves.
    pub(crate) fn loaded(&self, version: u64, model: &Path) {
        let mut models = self.models.lock().unwrap_or_else(PoisonError::into_inner);
        models.insert(version, model.display().to_string());
    }

    /// Sets the serving version. Neither allocates nor blocks.
    pub(crate) fn serve(&self, version: u64) {
        self.version.store(version, Ordering::Relaxed);
    }

    /// Counts a complete sweep that is not compared with the training data. Neither allocates nor blocks.
    pub(crate) fn count_uncompared(&self) {
        self.uncompared.fetch_add(1, Ordering::Relaxed);
    }

    pub(crate) fn count_prediction(&self, stage: Stage, compute_ns: u64) {
        let histogram = &self.compute[stage as usize - 1];
        let bucket = BOUNDS_US.partition_point(|bound| bound * 1000 < compute_ns);
        histogram.buckets[bucket].fetch_add(1, Ordering::Relaxed);
        histogram.sum_ns.fetch_add(compute_ns, Ordering::Relaxed);
    }

    /// Returns the metrics in Prometheus's text format, version 0.0.4.
    pub fn prometheus(&self) -> String {
        let mut out = String::new();
        // Writing to a string does not fail.
        let _ = self
            .write_histograms(&mut out)
            .and_then(|()| self.write_counters(&mut out))
            .and_then(|()| self.write_model(&mut out));
        out
    }

    fn write_histograms(&self, out: &mut String) -> fmt::Result {
        writeln!(out, "# HELP tactnet_inference_total Number of predictions.")?;
        writeln!(out, "# TYPE tactnet_inference_total counter")?;
        for (histogram, (_, stage)) in self.compute.iter().zip(STAGES) {
            let count: u64 = histogram.buckets.iter().map(read).sum();
            writeln!(out, "tactnet_inference_total{{stage=\"{stage}\"}} {count}")?;
        }
        let name = "tactnet_compute_seconds";
        writeln!(out, "# HELP {name} Compute time of predictions.")?;
        writeln!(out, "# TYPE {name} histogram")?;
        for (histogram, (_, stage)) in self.compute.iter().zip(STAGES) {
            let stage = format!("stage=\"{stage}\"");
            let mut count = 0;
            for (bucket, bound) in histogram.buckets.iter().zip(BOUNDS_US) {
                count += read(bucket);
                let bound = bound as f64 / 1e6;
                writeln!(out, "{name}_bucket{{{stage},le=\"{bound}\"}} {count}")?;
            }
            count += read(&histogram.buckets[BOUNDS_US.len()]);
            let sum = read(&histogram.sum_ns) as f64 / 1e9;
            writeln!(out, "{name}_bucket{{{stage},le=\"+Inf\"}} {count}")?;
            writeln!(out, "{name}_sum{{{stage}}} {sum}")?;
            writeln!(out, "{name}_count{{{stage}}} {count}")?;
        }
        Ok(())
    }

    fn write_counters(&self, out: &mut String) -> fmt::Result {
        for (name, help, value) in [
            ("frames", "Received frames.", &self.frames),
            (
                "dropped_frames",
                "Frames sent but not received.",
                &self.dropped_frames,
            ),
            (
                "unknown",
                "Complete sweeps of unknown materials.",
                &self.unknown,
            ),
            ("rejected", "Rejected sweeps.", &self.rejected),
            (
                "uncompared",
                "Complete sweeps not compared with the training data because the model worker was busy.",
                &self.uncompared,
            ),
            (
                "deadline_miss",
                "Predictions that missed their deadline.",
                &self.deadline_misses,
            ),
        ] {
            writeln!(out, "# HELP tactnet_{name}_total {help}")?;
            writeln!(out, "# TYPE tactnet_{name}_total counter")?;
            writeln!(out, "tactnet_{name}_total {}", read(value))?;
        }
        let name = "tactnet_worst_delay_seconds";
        writeln!(
            out,
            "# HELP {name} Maximum time from the sending of a frame to the end of its processing."
        )?;
        writeln!(out, "# TYPE {name} gauge")?;
        writeln!(out, "{name} {}", read(&self.worst_delay_ns) as f64 / 1e9)
    }

    fn write_model(&self, out: &mut String) -> fmt::Result {
        writeln!(out, "# HELP tactnet_model_info The serving model.")?;
        writeln!(out, "# TYPE tactnet_model_info gauge")?;
        let version = read(&self.version);
        let models = self.models.lock().unwrap_or_else(PoisonError::into_inner);
        let model = models.get(&version).map_or("", String::as_str);
        let model = model.replace('\\', "\\\\").replace('"', "\\\"");
        let model = model.replace('\n', "\\n");
        writeln!(
            out,
            "tactnet_model_info{{model=\"{model}\",version=\"{version}\"}} 1"
        )
    }
}

fn read(value: &AtomicU64) -> u64 {
    value.load(Ordering::Relaxed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn histograms_are_cumulative_and_metric_names_are_stable() {
        let metrics = Metrics::default();
        metrics.count_prediction(Stage::Plain, 150_000);
        metrics.count_prediction(Stage::Plain, 200_000);
        metrics.count_prediction(Stage::Plain, 50_000_000);
        metrics.count(&Counters {
            deadline_misses: 2,
            ..Counters::default()
        });
        metrics.count_uncompared();
        metrics.loaded(3, Path::new("a \"b\""));
        metrics.loaded(4, Path::new("c\nd"));
        metrics.serve(4);
        let newer = "tactnet_model_info{model=\"c\\nd\",version=\"4\"} 1";
        assert!(metrics.prometheus().lines().any(|line| line == newer));
        metrics.serve(3);
        let text = metrics.prometheus();
        for line in [
            "tactnet_inference_total{stage=\"plain\"} 3",
            "tactnet_compute_seconds_bucket{stage=\"plain\",le=\"0.0001\"} 0",
            "tactnet_compute_seconds_bucket{stage=\"plain\",le=\"0.0002\"} 2",
            "tactnet_compute_seconds_bucket{stage=\"plain\",le=\"+Inf\"} 3",
            "tactnet_compute_seconds_sum{stage=\"plain\"} 0.05035",
            "tactnet_deadline_miss_total 2",
            "tactnet_dropped_frames_total 0",
            "tactnet_unknown_total 0",
            "tactnet_uncompared_total 1",
            "tactnet_model_info{model=\"a \\\"b\\\"\",version=\"3\"} 1",
        ] {
            assert!(text.lines().any(|found| found == line), "{line}\n{text}");
        }
    }
}
