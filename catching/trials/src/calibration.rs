//! Calibration of the simulated robot and its evaluation: positions of hands in held-out poses, and catch rates
//! before and after.

mod features;
mod file;
mod page;
mod rehearsal;
mod samples;
mod unseen;

use std::collections::BTreeMap;
use std::time::Instant;

use serde::Serialize;
use tactnet_catching::Robot;
use tactnet_catching::calibrate::{
    Calibration, CalibrationConfig, Candidate, Determined, KeptCalibration, Model, Problem,
    RoutineConfig, Session, Solved, UNKNOWNS, Unknowns, calibrate, choose, gain,
};
use tactnet_catching_packets::ARMS;
use tactnet_catching_world::WorldConfig;

pub use features::FeatureReport;
pub use file::{CalibrationFileError, keep_calibration};
pub use page::calibration_page;
pub use samples::CalibrationSamples;
pub use unseen::Distances;

use crate::error::TrialError;
use crate::parallel::on_all_cores;
use crate::series::{Series, SeriesReport};
use crate::throw_config::ThrowConfig;
use rehearsal::{candidates, rehearse};
use tactnet_plot::wilson_of_counts;
use unseen::{Standing, distances};

/// Number of points of a sweep that the choice of configurations considers.
const VIEWS: usize = 6;
/// Offset between the session's seed and the seed of held-out poses and their noise.
const APART: u64 = 7_919;

/// A calibration of the simulated robot.
#[derive(Debug, Clone)]
pub struct CalibrationTrial {
    /// Robot as described.
    pub robot: Robot,
    /// World including planted errors. If they name no robot, they are those of robot `seed`. If its pictures show
    /// markers, the features are detected in them, otherwise they are truth plus noise.
    pub world: WorldConfig,
    /// Settings of the calibration.
    pub config: CalibrationConfig,
    /// Motion of the robot during the session.
    pub routine: RoutineConfig,
    /// Seed of noise, candidates, held-out poses and throws.
    pub seed: u64,
    /// Number of configurations per arm.
    pub of_each_arm: usize,
    /// Number of random candidates for the configurations.
    pub candidates: usize,
    /// Number of held-out poses.
    pub unseen: usize,
    /// Number of throws before and after the calibration each; 0 for none.
    pub throws: u64,
}

/// Result of the calibration of a session.
#[derive(Debug, Clone, Serialize)]
pub struct SolveReport {
    /// Number of configurations of both arms.
    pub configurations: usize,
    /// Number of features in pictures.
    pub features: usize,
    /// Duration of the session at the joint speeds of the robot, in s.
    pub robot_seconds: f64,
    /// Time of the solver, in s.
    pub solve_seconds: f64,
    /// Number of iterations.
    pub iterations: usize,
    /// Cost at the minimum.
    pub cost: f64,
    /// Median residual of the features divided by that of the noise alone.
    pub fit: f64,
    /// Share of features with a residual of more than five standard deviations.
    pub outlying: f64,
    /// Parameter directions that the session determines worst.
    pub worst_determined: Vec<Determined>,
    /// Estimated parameters.
    pub calibration: Calibration,
    /// The calibration in its file format.
    #[serde(skip)]
    pub kept: KeptCalibration,
}

/// Result of a calibration trial. Everything except the times is reproducible bit by bit.
#[derive(Debug, Clone, Serialize)]
pub struct CalibrationReport {
    /// Seed of noise, candidates, held-out poses and throws.
    pub seed: u64,
    /// Mean distance between the estimated and the true hand in held-out poses in the cameras' frames, in mm.
    pub mean_mm: f64,
    /// Maximum of that distance, in mm.
    pub worst_mm: f64,
    /// Distances before the calibration.
    pub raw: Distances,
    /// Number of held-out poses, each seen by both cameras.
    pub unseen: usize,
    /// Result of the session.
    #[serde(flatten)]
    pub solved: SolveReport,
    /// Features of the session compared with the true markers.
    pub detected: FeatureReport,
    /// Number of random candidates for the configurations.
    pub candidates: usize,
    /// `log det` of the information from the chosen configurations, relative to the priors.
    pub log_det: f64,
    /// Results of the same number of random configurations, always with features from truth plus noise.
    pub random: RandomFigures,
    /// Number of throws before and after the calibration each.
    pub throws: u64,
    /// Number of throws in the catch space.
    pub in_catch_space: usize,
    /// Catch rate in the catch space with the planted errors; `None` without throws.
    pub catch_rate_before: Option<f64>,
    /// Catch rate after the calibration.
    pub catch_rate_after: Option<f64>,
    /// 95 % Wilson interval of `catch_rate_before`.
    pub catch_rate_before_ci95: Option<[f64; 2]>,
    /// 95 % Wilson interval of `catch_rate_after`.
    pub catch_rate_after_ci95: Option<[f64; 2]>,
    /// Number of missed balls in the catch space before the calibration, by cause.
    pub misses_before: BTreeMap<String, usize>,
    /// Number of missed balls in the catch space after the calibration, by cause.
    pub misses_after: BTreeMap<String, usize>,
    /// Recorded session.
    #[serde(skip)]
    pub session: Session,
    /// Values behind means and maxima.
    #[serde(skip)]
    pub samples: CalibrationSamples,
}

/// Results of random configurations.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct RandomFigures {
    /// `log det` of the same number of random configurations.
    pub log_det: f64,
    /// Additional `log det` of the chosen configurations.
    pub log_det_gain: f64,
    /// Mean distance of hands in the same held-out poses, in mm.
    pub mean_mm: f64,
    /// Maximum distance, in mm.
    pub worst_mm: f64,
    /// Duration of the session, in s.
    pub robot_seconds: f64,
}

/// Phase of a trial.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Progress {
    /// Choosing configurations.
    Choosing,
    /// Simulating sessions.
    Moving,
    /// Solving the least-squares problem.
    Solving,
    /// Throwing balls; reported after each throw.
    Throwing,
}

impl SolveReport {
    /// Calibrates a robot from a session.
    ///
    /// - `last`: last valid calibration, the starting point of the solver
    ///
    /// # Errors
    /// A session that does not give a valid calibration.
    pub fn new(
        model: &Model,
        config: &CalibrationConfig,
        session: &Session,
        last: Option<&Calibration>,
    ) -> Result<(Self, Solved), TrialError> {
        let begun = Instant::now();
        let solved = calibrate(model, session, config, last)?;
        let solve_seconds = begun.elapsed().as_secs_f64();
        let features = session.pictures.iter().flat_map(|p| p.features).flatten();
        let report = Self {
            configurations: (0..ARMS).map(|arm| session.configurations(arm)).sum(),
            features: features.count(),
            robot_seconds: session.robot_seconds,
            solve_seconds,
            iterations: solved.iterations,
            cost: solved.cost,
            fit: solved.fit,
            outlying: solved.outlying,
            worst_determined: solved.worst.clone(),
            calibration: solved.calibration(),
            kept: KeptCalibration::new(model.robot(), &solved.unknowns, &solved.covariance),
        };
        Ok((report, solved))
    }
}

/// Configurations of a session with their `log det M`.
type Configurations = (Vec<Candidate>, f64);

impl CalibrationTrial {
    /// Runs session, solver, held-out poses and throws.
    ///
    /// # Errors
    /// Invalid settings, or a session that does not give a valid calibration.
    pub fn run(&self, progress: impl Fn(Progress) + Sync) -> Result<CalibrationReport, TrialError> {
        let model = Model::new(&self.robot);
        progress(Progress::Choosing);
        let [(chosen, log_det), (random, random_log_det)] = self.choose(&model)?;
        progress(Progress::Moving);
        let world = self.world();
        let mut without = world.clone();
        without.pictures.markers = false;
        let both = [(&world, &chosen), (&without, &random)];
        let sessions = on_all_cores(both, |(world, of)| {
            rehearse(&model, world, &self.routine, of, self.seed)
        })?;
        progress(Progress::Solving);
        let (report, solved) = SolveReport::new(&model, &self.config, &sessions[0].0, None)?;
        let (_, beside) = SolveReport::new(&model, &self.config, &sessions[1].0, None)?;
        let poses = self.poses(&model, &world)?;
        let raw = distances(&poses, &model, &Unknowns::zeros(UNKNOWNS));
        let all_found = distances(&poses, &model, &solved.unknowns);
        let all_random = distances(&poses, &model, &beside.unknowns);
        let (found, found_random) = (Distances::of(&all_found), Distances::of(&all_random));
        let problem = Problem::new(&model, &sessions[0].0, &self.config)?;
        let guess = self.config.priors.guess();
        let [before_px, residuals_px] =
            [&guess, &solved.unknowns].map(|x| problem.feature_residuals(x));
        let done = || progress(Progress::Throwing);
        let (before, after) = self.throw_balls(&report.calibration, done)?.unzip();
        let rate = |of: &Option<SeriesReport>| of.as_ref().map(|of| of.rate);
        let ci95 = |of: &Option<SeriesReport>| {
            let of = of.as_ref()?;
            Some(wilson_of_counts(of.caught, of.in_catch_space))
        };
        Ok(CalibrationReport {
            seed: self.seed,
            mean_mm: found.mean_mm,
            worst_mm: found.worst_mm,
            raw: Distances::of(&raw),
            unseen: self.unseen,
            solved: report,
            detected: sessions[0].1,
            candidates: self.candidates,
            log_det,
            random: RandomFigures {
                log_det: random_log_det,
                log_det_gain: log_det - random_log_det,
                mean_mm: found_random.mean_mm,
                worst_mm: found_random.worst_mm,
                robot_seconds: sessions[1].0.robot_seconds,
            },
            throws: self.throws,
            in_catch_space: before.as_ref().map_or(0, |of| of.in_catch_space),
            catch_rate_before: rate(&before),
            catch_rate_after: rate(&after),
            catch_rate_before_ci95: ci95(&before),
            catch_rate_after_ci95: ci95(&after),
            misses_before: before.map(|of| of.misses).unwrap_or_default(),
            misses_after: after.map(|of| of.misses).unwrap_or_default(),
            session: sessions.into_iter().next().unwrap_or_default().0,
            samples: CalibrationSamples {
                raw_mm: raw,
                found_mm: all_found,
                random_mm: all_random,
                before_px,
                residuals_px,
                noise_px: self.config.noise.feature,
            },
        })
    }

    fn choose(&self, model: &Model) -> Result<[Configurations; 2], TrialError> {
        let drawn = candidates(model, &self.config, self.seed, self.candidates)?;
        let views = self.routine.sweep.views(VIEWS);
        let chosen = choose(model, &self.config, &drawn, &views, self.of_each_arm)?;
        // Candidates alternate between both arms.
        let random = drawn[..ARMS * self.of_each_arm].to_vec();
        let gain = |of: &[Candidate]| gain(model, &self.config, of, &views);
        let gains = [gain(&chosen)?, gain(&random)?];
        Ok([(chosen, gains[0]), (random, gains[1])])
    }

    /// Throws balls before and after the calibration, if there are any throws.
    fn throw_balls(
        &self,
        calibration: &Calibration,
        done: impl Fn() + Sync,
    ) -> Result<Option<(SeriesReport, SeriesReport)>, TrialError> {
        if self.throws == 0 {
            return Ok(None);
        }
        let before = self.series(None).run(&done)?;
        let after = self.series(Some(calibration.clone())).run(&done)?;
        Ok(Some((before, after)))
    }

    /// Returns the world with the same robot in all runs.
    fn world(&self) -> WorldConfig {
        let mut world = self.world.clone();
        world.errors.robot.get_or_insert(self.seed);
        world
    }

    fn poses(&self, model: &Model, world: &WorldConfig) -> Result<Vec<Standing>, TrialError> {
        let seed = self.seed.wrapping_add(APART);
        candidates(model, &self.config, seed, self.unseen)?
            .iter()
            .map(|pose| Standing::new(model, world, seed, pose))
            .collect()
    }

    fn series(&self, calibration: Option<Calibration>) -> Series {
        Series {
            config: ThrowConfig {
                calibration,
                ..ThrowConfig::new(self.robot.clone(), self.world())
            },
            throws: self.throws,
            seed: self.seed,
        }
    }
}

#[cfg(test)]
mod tests;
