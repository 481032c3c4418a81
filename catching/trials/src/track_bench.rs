//! Benchmark of the tracker: accuracy and computation time, with an exactly known head at rest.

use serde::Serialize;
use tactnet_catching::Robot;
use tactnet_catching::track::TrackConfig;

use crate::error::TrialError;
use crate::look_ahead::{LookAhead, PredictionErrors};
use crate::parallel::on_all_cores;
use crate::still_head::{StillThrow, perfect};
use tactnet_catching_world::CamerasConfig;
use tactnet_plot::Quantiles;

/// Number of throws that are simulated in parallel before the tracker runs on them sequentially.
const TOGETHER: usize = 200;

/// Settings of the benchmark.
#[derive(Debug, Clone, Copy)]
pub struct TrackBench {
    /// Number of throws of one ball each.
    pub throws: usize,
    /// Seed of throws, noise and clutter.
    pub seed: u64,
    /// Settings of the tracker.
    pub config: TrackConfig,
}

/// Results. Everything except the times is reproducible bit by bit.
#[derive(Debug, Clone, Serialize)]
pub struct TrackReport {
    /// Number of throws.
    pub throws: usize,
    /// Seed of throws, noise and clutter.
    pub seed: u64,
    /// Results with perfect detection.
    pub without_clutter: TrackFigures,
    /// Results for the same throws with the default clutter and misses.
    pub with_clutter: TrackFigures,
}

/// Statistics of the tracker for one quality of detection.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TrackFigures {
    /// Mean number of false detections per picture.
    pub clutter: f64,
    /// Detection probability of a ball in a picture.
    pub detection: f64,
    /// Errors of the predictions.
    #[serde(flatten)]
    pub ahead: PredictionErrors,
    /// Number of balls without a correct prediction 200 ms before the catch.
    pub lost: usize,
    /// Time from the circles of a pair of pictures with a flying ball to the prediction on one core, in µs.
    pub pair_us: Option<Quantiles>,
}

/// Collected results for one quality of detection.
#[derive(Default)]
struct Kept {
    ahead: Vec<LookAhead>,
    lost: usize,
    micros: Vec<f64>,
}

impl TrackBench {
    /// Runs the benchmark. `progress` receives the number of finished throws.
    ///
    /// # Errors
    /// An invalid description of the robot or an invalid setting of the tracker.
    pub fn run(
        &self,
        robot: &Robot,
        mut progress: impl FnMut(usize),
    ) -> Result<TrackReport, TrialError> {
        let kinds = [perfect(), CamerasConfig::default()];
        let mut kept: [Kept; 2] = std::array::from_fn(|_| Kept::default());
        let mut done = 0;
        while done < self.throws {
            let wanted = (self.throws - done).min(TOGETHER);
            let thrown = on_all_cores(done..done + wanted, |number| {
                let of = |kind: &CamerasConfig| {
                    StillThrow::new(robot, kind.clone(), self.seed, number as u64)
                };
                Ok([of(&kinds[0])?, of(&kinds[1])?])
            })?;
            // Sequential, because it is timed.
            for throws in &thrown {
                for (throw, kept) in throws.iter().zip(&mut kept) {
                    kept.add(throw, robot, self.config)?;
                }
            }
            done += wanted;
            progress(done);
        }
        let [without_clutter, with_clutter] = kept;
        Ok(TrackReport {
            throws: done,
            seed: self.seed,
            without_clutter: without_clutter.figures(&kinds[0]),
            with_clutter: with_clutter.figures(&kinds[1]),
        })
    }
}

impl Kept {
    fn add(
        &mut self,
        throw: &StillThrow,
        robot: &Robot,
        config: TrackConfig,
    ) -> Result<(), TrialError> {
        let tracked = throw.track(robot, config)?;
        match throw.ahead(&tracked) {
            Some((_, ahead)) => self.ahead.push(ahead),
            None => self.lost += 1,
        }
        let timed = throw.pairs.iter().zip(&tracked.micros);
        self.micros.extend(
            timed
                .filter(|(pair, _)| throw.shows_ball(pair))
                .map(|(_, micros)| micros),
        );
        Ok(())
    }

    fn figures(self, cameras: &CamerasConfig) -> TrackFigures {
        TrackFigures {
            clutter: cameras.clutter,
            detection: cameras.detection,
            ahead: PredictionErrors::of(&self.ahead, true),
            lost: self.lost,
            pair_us: Quantiles::of(self.micros),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parallel::on_threads;

    fn run(throws: usize, threads: usize) -> TrackReport {
        let bench = TrackBench {
            throws,
            seed: 5,
            config: TrackConfig::default(),
        };
        on_threads(threads, || bench.run(&Robot::nominal(), |_| ())).unwrap()
    }

    /// The limits are the goals for a head at rest, 1.5 times the Cramer-Rao bound.
    #[test]
    fn predictions_keep_their_limits_and_repeat_to_the_bit_but_for_times() {
        let report = run(30, 2);
        for figures in [&report.without_clutter, &report.with_clutter] {
            assert!(
                figures.ahead.across_mm_rms_200ms.unwrap() <= 4.4,
                "{figures:?}"
            );
            assert!(
                figures.ahead.along_ms_rms_200ms.unwrap() <= 1.3,
                "{figures:?}"
            );
            // The band of 30 balls is 2.2 to 3.9; the filter expects a little more noise than there is.
            let nees = figures.ahead.nees_200ms.unwrap();
            assert!((1.8..3.9).contains(&nees), "{nees}");
            assert!(figures.lost <= 1, "{figures:?}");
        }
        let clear = &report.without_clutter;
        assert_eq!((clear.lost, clear.ahead.predictions), (0, 30), "{clear:?}");
        let bits = |report: TrackReport| {
            [report.without_clutter, report.with_clutter].map(|figures| {
                let mut timeless = figures;
                timeless.pair_us = None;
                // The shortest text that parses to the same number.
                serde_json::to_string(&timeless).unwrap()
            })
        };
        assert_eq!(bits(report), bits(run(30, 1)));
    }
}
