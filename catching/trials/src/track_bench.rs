//! How exactly the tracker predicts balls, and how long it takes, with a head that stands still and is known.

use rayon::prelude::*;
use serde::Serialize;
use tactnet_catching::Robot;
use tactnet_catching::track::TrackConfig;

use crate::error::TrialError;
use crate::look_ahead::{Errors, LookAhead};
use crate::quantiles::Quantiles;
use crate::still_head::{Detectors, StillThrow};

/// Throws that are simulated together, on all cores, before the tracker gets them, alone.
const TOGETHER: usize = 200;

/// What is measured.
#[derive(Debug, Clone, Copy)]
pub struct TrackBench {
    /// Throws of one ball each.
    pub throws: usize,
    /// Of throws, noise and clutter.
    pub seed: u64,
    /// Of the tracker.
    pub config: TrackConfig,
}

/// What was measured. All but the times repeats to the bit.
#[derive(Debug, Clone, Serialize)]
pub struct TrackReport {
    /// Throws.
    pub throws: usize,
    /// Of throws, noise and clutter.
    pub seed: u64,
    /// Every ball is found in every picture, and nothing else.
    pub without_clutter: TrackFigures,
    /// The same throws with the clutter and the misses that are usual.
    pub with_clutter: TrackFigures,
}

/// The tracker's figures for one kind of detectors.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TrackFigures {
    /// Circles that are no balls, mean number a picture.
    pub clutter: f64,
    /// Probability that a ball in a picture is found.
    pub detection: f64,
    /// Error of the prediction from the last pictures at least 200 ms before the catch, across the flight, mm, root mean square over balls.
    pub across_mm_rms_200ms: Option<f64>,
    /// The same along the flight, ms.
    pub along_ms_rms_200ms: Option<f64>,
    /// Mean of the normalised squared error of the position predicted then; 3 if the filter's covariance is right.
    pub nees_200ms: Option<f64>,
    /// 95 % band of that mean, if it were.
    pub nees_band: Option<[f64; 2]>,
    /// True if it lies in the band.
    pub nees_in_band: Option<bool>,
    /// Balls that those figures are of.
    pub predictions: usize,
    /// Balls of which nothing was said 200 ms before the catch, or something else than where they were.
    pub lost: usize,
    /// From the circles of a pair of pictures with a ball in flight to the prediction, microseconds, one core.
    pub pair_us: Option<Quantiles>,
}

/// What is kept of the throws seen by one kind of detectors.
#[derive(Default)]
struct Kept {
    ahead: Vec<LookAhead>,
    lost: usize,
    micros: Vec<f64>,
}

impl TrackBench {
    /// Measures. `progress` is told how many throws are done.
    ///
    /// # Errors
    /// Where the robot's description or a setting of the tracker makes no sense.
    pub fn run(
        &self,
        robot: &Robot,
        mut progress: impl FnMut(usize),
    ) -> Result<TrackReport, TrialError> {
        const KINDS: [Detectors; 2] = [Detectors::Perfect, Detectors::Usual];
        let mut kept: [Kept; 2] = std::array::from_fn(|_| Kept::default());
        let mut done = 0;
        while done < self.throws {
            let wanted = (self.throws - done).min(TOGETHER);
            let thrown: Result<Vec<[StillThrow; 2]>, TrialError> = (done..done + wanted)
                .into_par_iter()
                .map(|number| {
                    let of = |kind| StillThrow::new(robot, kind, self.seed, number as u64);
                    Ok([of(KINDS[0])?, of(KINDS[1])?])
                })
                .collect();
            // Alone, since it is timed.
            for throws in &thrown? {
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
            without_clutter: without_clutter.figures(KINDS[0]),
            with_clutter: with_clutter.figures(KINDS[1]),
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

    fn figures(self, kind: Detectors) -> TrackFigures {
        let cameras = kind.cameras();
        let errors = Errors::of(&self.ahead);
        TrackFigures {
            clutter: cameras.clutter,
            detection: cameras.detection,
            across_mm_rms_200ms: errors.map(|errors| errors.across_mm_rms),
            along_ms_rms_200ms: errors.map(|errors| errors.along_ms_rms),
            nees_200ms: errors.map(|errors| errors.nees),
            nees_band: errors.map(|errors| errors.nees_band),
            nees_in_band: errors.map(|errors| errors.nees_in_band()),
            predictions: self.ahead.len(),
            lost: self.lost,
            pair_us: Quantiles::of(self.micros),
        }
    }
}

#[cfg(test)]
mod tests {
    use tactnet_catching_packets::RobotDescription;

    use super::*;

    fn run(throws: usize, threads: usize) -> TrackReport {
        let bench = TrackBench {
            throws,
            seed: 5,
            config: TrackConfig::default(),
        };
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        let robot = Robot::new(RobotDescription::nominal());
        pool.install(|| bench.run(&robot, |_| ())).unwrap()
    }

    /// The limits are the goals for a head that stands still, 1.5 times the bound of Cramer and Rao.
    #[test]
    fn predictions_keep_their_limits_and_repeat_to_the_bit_but_for_times() {
        let report = run(30, 2);
        let figures = report.without_clutter;
        assert!(figures.across_mm_rms_200ms.unwrap() <= 4.4, "{figures:?}");
        assert!(figures.along_ms_rms_200ms.unwrap() <= 1.3, "{figures:?}");
        assert_eq!((figures.lost, figures.predictions), (0, 30), "{figures:?}");
        let cluttered = report.with_clutter;
        assert!(cluttered.lost <= 1, "{cluttered:?}");
        let bits = |report: TrackReport| {
            [report.without_clutter, report.with_clutter].map(|figures| {
                let timeless = TrackFigures {
                    pair_us: None,
                    ..figures
                };
                // The shortest text that reads back as the same number.
                serde_json::to_string(&timeless).unwrap()
            })
        };
        assert_eq!(bits(report), bits(run(30, 1)));
    }
}
