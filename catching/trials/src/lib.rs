//! Throw series in stepped time, and benchmarks of planner and tracker: the stack and the world together.
//!
//! A [`Series`] runs throw after throw, tick by tick, with all configured delays, and is reproducible bit by bit. The
//! world provides the sensor values, the stack the joint commands and closing times, and the world's judge the
//! verdicts. A [`CatchSpace`](tactnet_catching::CatchSpace) with knowledge of the true flight determines the
//! catchable balls.

mod ablation;
mod bound;
mod calibration;
mod detect_bench;
mod error;
mod eyes;
mod look;
mod look_ahead;
mod parallel;
mod peer_circles;
mod perception;
mod picture;
mod plan_bench;
mod problems;
mod rally;
mod safety_bench;
mod section;
mod series;
mod stepped_stack;
mod stepped_time;
mod still_head;
mod throw;
mod throw_aim;
mod throw_bench;
mod throw_config;
mod throw_outcome;
mod trace;
mod track_bench;
mod watch;
mod way;

pub use ablation::Ablation;
pub use bound::{Bound, bounds};
pub use calibration::{
    CalibrationFileError, CalibrationReport, CalibrationSamples, CalibrationTrial, Distances,
    FeatureReport, Progress, RandomFigures, SolveReport, calibration_page, keep_calibration,
};
pub use detect_bench::{DetectBench, DetectFigures, DetectReport, RadiusClass};
pub use error::TrialError;
pub use look_ahead::{AHEAD, LookAhead, PredictionErrors};
pub use peer_circles::peer_circles;
pub use picture::picture_file;
pub use plan_bench::{PlanBench, PlanReport};
pub use problems::{PlanProblem, plan_problem};
pub use rally::{Rally, RallyConfig, RallyFlight, RallyReport, rally_page};
pub use safety_bench::{PeerHulls, SafetyBench, SafetyReport};
pub use series::{FingersReport, ObstaclesReport, Series, SeriesReport, WithoutMap, series_page};
pub use stepped_stack::StepObserver;
pub use tactnet_plot::Quantiles;
pub use throw_aim::{AimRound, ThrowAim, ThrowAimReport};
pub use throw_bench::{Goal, ThrowBench, ThrowReport};
pub use throw_config::{Mapping, ThrowConfig};
pub use throw_outcome::{AmongObstacles, BallOutcome, ThrowOutcome};
pub use trace::{Trace, TracePlan, TraceTick};
pub use track_bench::{TrackBench, TrackFigures, TrackReport};
pub use watch::{Braked, Motion};
pub use way::{WayOutcome, WayReport, WayTrials};
