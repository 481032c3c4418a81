//! Counters and times of the service for other threads, and as Prometheus reads them.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use tactnet_skin::packets::{Counters, Stage};

/// Upper bounds of the buckets of computing times, microseconds.
const BOUNDS_US: [u64; 12] = [
    100, 200, 300, 500, 750, 1000, 1333, 2000, 3000, 4000, 6000, 10_000,
];

/// Written by one thread, read by any.
#[derive(Debug, Default)]
pub struct Measures {
    frames: AtomicU64,
    dropped_frames: AtomicU64,
    unknown: AtomicU64,
    rejected: AtomicU64,
    deadline_misses: AtomicU64,
    worst_delay_ns: AtomicU64,
    compute: [Histogram; 3],
    version: AtomicU64,
    /// Where versions come from.
    models: Mutex<BTreeMap<u64, String>>,
}

/// Computing times of predictions of one stage.
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

impl Measures {
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

    /// Notes where a version comes from, before it serves.
    pub(crate) fn loaded(&self, version: u64, model: &Path) {
        let mut models = self.models.lock().unwrap_or_else(PoisonError::into_inner);
        models.insert(version, model.display().to_string());
    }

    /// Notes which version serves. Neither allocates nor waits.
    pub(crate) fn serve(&self, version: u64) {
        self.version.store(version, Ordering::Relaxed);
    }

    pub(crate) fn count_prediction(&self, stage: Stage, compute_ns: u64) {
        let histogram = &self.compute[stage as usize - 1];
        let bucket = BOUNDS_US.partition_point(|bound| bound * 1000 < compute_ns);
        histogram.buckets[bucket].fetch_add(1, Ordering::Relaxed);
        histogram.sum_ns.fetch_add(compute_ns, Ordering::Relaxed);
    }

    /// Prometheus's text format, version 0.0.4.
    pub fn prometheus(&self) -> String {
        let read = |value: &AtomicU64| value.load(Ordering::Relaxed);
        let mut out = String::new();
        let mut add = |line: std::fmt::Arguments<'_>| {
            // Writing to a string does not fail.
            let _ = writeln!(out, "{line}");
        };
        add(format_args!(
            "# HELP tactnet_inference_total Predictions of sweeps."
        ));
        add(format_args!("# TYPE tactnet_inference_total counter"));
        for (histogram, (_, stage)) in self.compute.iter().zip(STAGES) {
            let count: u64 = histogram.buckets.iter().map(read).sum();
            add(format_args!(
                "tactnet_inference_total{{stage=\"{stage}\"}} {count}"
            ));
        }
        add(format_args!(
            "# HELP tactnet_compute_seconds Time that predictions took."
        ));
        add(format_args!("# TYPE tactnet_compute_seconds histogram"));
        for (histogram, (_, stage)) in self.compute.iter().zip(STAGES) {
            let mut count = 0;
            for (bucket, bound) in histogram.buckets.iter().zip(BOUNDS_US) {
                count += read(bucket);
                add(format_args!(
                    "tactnet_compute_seconds_bucket{{stage=\"{stage}\",le=\"{}\"}} {count}",
                    bound as f64 / 1e6
                ));
            }
            count += read(&histogram.buckets[BOUNDS_US.len()]);
            add(format_args!(
                "tactnet_compute_seconds_bucket{{stage=\"{stage}\",le=\"+Inf\"}} {count}"
            ));
            add(format_args!(
                "tactnet_compute_seconds_sum{{stage=\"{stage}\"}} {}",
                read(&histogram.sum_ns) as f64 / 1e9
            ));
            add(format_args!(
                "tactnet_compute_seconds_count{{stage=\"{stage}\"}} {count}"
            ));
        }
        for (name, help, value) in [
            ("frames", "Frames that came.", &self.frames),
            (
                "dropped_frames",
                "Frames that were put and never came.",
                &self.dropped_frames,
            ),
            (
                "unknown",
                "Whole sweeps of unknown materials.",
                &self.unknown,
            ),
            ("rejected", "Sweeps that were rejected.", &self.rejected),
            (
                "deadline_miss",
                "Predictions that took longer than promised.",
                &self.deadline_misses,
            ),
        ] {
            add(format_args!("# HELP tactnet_{name}_total {help}"));
            add(format_args!("# TYPE tactnet_{name}_total counter"));
            add(format_args!("tactnet_{name}_total {}", read(value)));
        }
        add(format_args!(
            "# HELP tactnet_worst_delay_seconds Longest time from a frame's put until it was dealt with."
        ));
        add(format_args!("# TYPE tactnet_worst_delay_seconds gauge"));
        add(format_args!(
            "tactnet_worst_delay_seconds {}",
            read(&self.worst_delay_ns) as f64 / 1e9
        ));
        add(format_args!(
            "# HELP tactnet_model_info The model that serves."
        ));
        add(format_args!("# TYPE tactnet_model_info gauge"));
        let version = read(&self.version);
        let models = self.models.lock().unwrap_or_else(PoisonError::into_inner);
        let model = models.get(&version).map_or("", String::as_str);
        let model = model.replace('\\', "\\\\").replace('"', "\\\"");
        let model = model.replace('\n', "\\n");
        add(format_args!(
            "tactnet_model_info{{model=\"{model}\",version=\"{version}\"}} 1"
        ));
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn histograms_are_cumulative_and_names_are_those_promised() {
        let measures = Measures::default();
        measures.count_prediction(Stage::Plain, 150_000);
        measures.count_prediction(Stage::Plain, 200_000);
        measures.count_prediction(Stage::Plain, 50_000_000);
        measures.count(&Counters {
            deadline_misses: 2,
            ..Counters::default()
        });
        measures.loaded(3, Path::new("a \"b\""));
        measures.loaded(4, Path::new("c\nd"));
        measures.serve(4);
        let newer = "tactnet_model_info{model=\"c\\nd\",version=\"4\"} 1";
        assert!(measures.prometheus().lines().any(|line| line == newer));
        measures.serve(3);
        let text = measures.prometheus();
        for line in [
            "tactnet_inference_total{stage=\"plain\"} 3",
            "tactnet_compute_seconds_bucket{stage=\"plain\",le=\"0.0001\"} 0",
            "tactnet_compute_seconds_bucket{stage=\"plain\",le=\"0.0002\"} 2",
            "tactnet_compute_seconds_bucket{stage=\"plain\",le=\"+Inf\"} 3",
            "tactnet_compute_seconds_sum{stage=\"plain\"} 0.05035",
            "tactnet_deadline_miss_total 2",
            "tactnet_dropped_frames_total 0",
            "tactnet_unknown_total 0",
            "tactnet_model_info{model=\"a \\\"b\\\"\",version=\"3\"} 1",
        ] {
            assert!(text.lines().any(|found| found == line), "{line}\n{text}");
        }
    }
}
