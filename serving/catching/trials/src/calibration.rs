//! Calibration of the simulated robot, and what it is worth: hands at poses that it has not seen, balls caught before and after.

mod file;
mod peer;
mod rehearsal;
mod unseen;

use std::time::Instant;

use rayon::prelude::*;
use serde::Serialize;
use tactnet_catching::Robot;
use tactnet_catching::calibrate::{
    Calibration, CalibrationConfig, Candidate, Determined, Model, RoutineConfig, Session, Solved,
    UNKNOWNS, Unknowns, calibrate, choose, gain,
};
use tactnet_catching_packets::ARMS;
use tactnet_catching_world::WorldConfig;

pub use file::{SessionFileError, keep_calibration, read_session, write_session};
pub use peer::{PeerSession, peer_session};
pub use unseen::Distances;

use crate::error::TrialError;
use crate::series::Series;
use crate::throw::ThrowConfig;
use crate::timing::Timing;
use crate::wilson::wilson;
use rehearsal::{candidates, rehearse};
use unseen::Standing;

/// Places of a sweep that the choice of configurations looks at.
const VIEWS: usize = 6;
/// Seeds of unseen poses and of noise in them are this far from the session's.
const APART: u64 = 7_919;

/// A calibration of the simulated robot.
#[derive(Debug, Clone)]
pub struct CalibrationTrial {
    /// The robot as described.
    pub robot: Robot,
    /// The world, planted errors included; where they name no robot, they are those of robot `seed`.
    pub world: WorldConfig,
    /// The stack's settings.
    pub config: CalibrationConfig,
    /// How the robot moves.
    pub routine: RoutineConfig,
    /// Of noise, candidates, unseen poses and throws.
    pub seed: u64,
    /// Configurations of each arm.
    pub of_each_arm: usize,
    /// Random configurations that they are chosen from.
    pub candidates: usize,
    /// Unseen poses.
    pub unseen: usize,
    /// Throws of the series before and after; 0: none.
    pub throws: u64,
}

/// What came out of a session.
#[derive(Debug, Clone, Serialize)]
pub struct SolveReport {
    /// Configurations of both arms.
    pub configurations: usize,
    /// Features in pictures.
    pub features: usize,
    /// Time that the robot needs at its joints' speeds, s.
    pub robot_seconds: f64,
    /// Time of the solver, s.
    pub solve_seconds: f64,
    /// Its iterations.
    pub iterations: usize,
    /// Cost of the minimum.
    pub cost: f64,
    /// Median residual of features, in that of the noise alone.
    pub fit: f64,
    /// Share of features more than five standard deviations off.
    pub outlying: f64,
    /// Directions of which the session says least.
    pub worst_determined: Vec<Determined>,
    /// The parameters.
    pub calibration: Calibration,
}

/// What a calibration of the simulated robot gave. All but the times repeats to the bit.
#[derive(Debug, Clone, Serialize)]
pub struct CalibrationReport {
    /// Of noise, candidates, unseen poses and throws.
    pub seed: u64,
    /// Mean distance between where the calibrated stack and the world put hands at unseen poses, in the cameras' frames, mm.
    pub mean_mm: f64,
    /// Worst, mm.
    pub worst_mm: f64,
    /// The same before.
    pub raw: Distances,
    /// Unseen poses, each seen from both cameras.
    pub unseen: usize,
    /// Of the session.
    #[serde(flatten)]
    pub solved: SolveReport,
    /// Random configurations that those of the session were chosen from.
    pub candidates: usize,
    /// `log det` of what is known with the chosen configurations, in standard deviations of the priors.
    pub log_det: f64,
    /// As many configurations, drawn and not chosen.
    pub random: RandomFigures,
    /// Throws of each series.
    pub throws: u64,
    /// Of those, in the catch space.
    pub in_catch_space: usize,
    /// Share of them that is caught with the planted errors; `None` without throws.
    pub catch_rate_before: Option<f64>,
    /// The same after calibration.
    pub catch_rate_after: Option<f64>,
    /// Wilson's 95 % interval of `catch_rate_before`.
    pub catch_rate_before_ci95: Option<[f64; 2]>,
    /// Wilson's 95 % interval of `catch_rate_after`.
    pub catch_rate_after_ci95: Option<[f64; 2]>,
    /// What was recorded.
    #[serde(skip)]
    pub session: Session,
}

/// Figures of configurations that were drawn and not chosen.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct RandomFigures {
    /// Of as many configurations.
    pub log_det: f64,
    /// How much more of `log det` the chosen ones give.
    pub log_det_gain: f64,
    /// Mean distance of hands at the same unseen poses, mm.
    pub mean_mm: f64,
    /// Worst, mm.
    pub worst_mm: f64,
    /// Time that the robot needs, s.
    pub robot_seconds: f64,
}

/// What a trial is at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Progress {
    /// Configurations are chosen.
    Choosing,
    /// Sessions are simulated.
    Moving,
    /// The problem is solved.
    Solving,
    /// Balls are thrown; told after each.
    Throwing,
}

impl SolveReport {
    /// Calibrates a robot from a session.
    ///
    /// - `last`: the last good calibration, to begin from
    ///
    /// # Errors
    /// Where there is no calibration.
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
        };
        Ok((report, solved))
    }
}

impl CalibrationTrial {
    /// Runs session, solver, unseen poses and throws.
    ///
    /// # Errors
    /// Where settings make no sense, and where there is no calibration.
    pub fn run(&self, progress: impl Fn(Progress) + Sync) -> Result<CalibrationReport, TrialError> {
        let model = Model::new(&self.robot);
        progress(Progress::Choosing);
        let drawn = candidates(&model, &self.config, self.seed, self.candidates)?;
        let views = self.routine.sweep.views(VIEWS);
        let chosen = choose(&model, &self.config, &drawn, &views, self.of_each_arm)?;
        let configurations: Vec<Candidate> =
            chosen.numbers.iter().map(|number| drawn[*number]).collect();
        // Arms are drawn in turn.
        let random: Vec<Candidate> = drawn[..ARMS * self.of_each_arm].to_vec();
        progress(Progress::Moving);
        let world = self.world();
        let sessions: Vec<Session> = [&configurations, &random]
            .into_par_iter()
            .map(|of| rehearse(&model, &world, &self.routine, of, self.seed))
            .collect::<Result<_, _>>()?;
        progress(Progress::Solving);
        let (report, solved) = SolveReport::new(&model, &self.config, &sessions[0], None)?;
        let (_, beside) = SolveReport::new(&model, &self.config, &sessions[1], None)?;
        let poses = self.poses(&model, &world)?;
        let found = Distances::of(&poses, &model, &solved.unknowns);
        let found_random = Distances::of(&poses, &model, &beside.unknowns);
        let log_det_random = gain(&model, &self.config, &random, &views)?;
        let mut all = CalibrationReport {
            seed: self.seed,
            mean_mm: found.mean_mm,
            worst_mm: found.worst_mm,
            raw: Distances::of(&poses, &model, &Unknowns::zeros(UNKNOWNS)),
            unseen: self.unseen,
            solved: report,
            candidates: self.candidates,
            log_det: chosen.log_det,
            random: RandomFigures {
                log_det: log_det_random,
                log_det_gain: chosen.log_det - log_det_random,
                mean_mm: found_random.mean_mm,
                worst_mm: found_random.worst_mm,
                robot_seconds: sessions[1].robot_seconds,
            },
            throws: self.throws,
            in_catch_space: 0,
            catch_rate_before: None,
            catch_rate_after: None,
            catch_rate_before_ci95: None,
            catch_rate_after_ci95: None,
            session: sessions.into_iter().next().unwrap_or_default(),
        };
        if self.throws > 0 {
            let throwing = || progress(Progress::Throwing);
            let before = self.series(None).run(throwing)?;
            let calibration = all.solved.calibration.clone();
            let after = self.series(Some(calibration)).run(throwing)?;
            all.in_catch_space = before.in_catch_space;
            all.catch_rate_before = Some(before.rate);
            all.catch_rate_after = Some(after.rate);
            all.catch_rate_before_ci95 = Some(wilson(before.caught, before.in_catch_space));
            all.catch_rate_after_ci95 = Some(wilson(after.caught, after.in_catch_space));
        }
        Ok(all)
    }

    /// The world, with a robot that is the same in all of its runs.
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
                robot: self.robot.clone(),
                calibration,
                world: self.world(),
                timing: Timing::ours(),
                without: Vec::new(),
                balls: 1,
                perfect_perception: false,
                pixels: false,
                watch: false,
                closing_error: 0.0,
            },
            throws: self.throws,
            seed: self.seed,
        }
    }
}
