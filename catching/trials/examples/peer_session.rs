//! Writes the least-squares problem of a simulated calibration session for other solvers as JSON, with the solution of
//! this project.
//!
//!     cargo run --release -p tactnet-catching-trials --example peer_session -- SEED > problem.json

use serde::Serialize;
use tactnet_catching::Robot;
use tactnet_catching::calibrate::{
    CalibrationConfig, Noise, RoutineConfig, Session, UNKNOWNS, Unknowns, at, name,
};
use tactnet_catching_packets::RobotDescription;
use tactnet_catching_trials::{CalibrationTrial, SolveReport, TrialError};
use tactnet_catching_world::{PlantedErrors, WorldConfig};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let seed: u64 = std::env::args().nth(1).ok_or("expected SEED")?.parse()?;
    let trial = CalibrationTrial {
        robot: Robot::new(RobotDescription::nominal()),
        world: WorldConfig {
            errors: PlantedErrors::uncalibrated(seed),
            ..WorldConfig::default()
        },
        config: CalibrationConfig::default(),
        routine: RoutineConfig::default(),
        seed,
        of_each_arm: 15,
        candidates: 500,
        unseen: 200,
        throws: 0,
    };
    let report = trial.run(|_| ())?;
    let problem = peer_session(&trial.robot, &trial.config, &report.session, &report.solved)?;
    println!("{}", serde_json::to_string(&problem)?);
    Ok(())
}

/// Least-squares problem of a session and its solution.
#[derive(Debug, Clone, Serialize)]
struct PeerSession {
    /// Names of the unknowns.
    names: Vec<String>,
    /// Indices of the unknowns: left camera, marker, offsets, compliances, mount; neck; rotation of the inertial
    /// unit, biases; clocks.
    places: Vec<usize>,
    /// Means of the priors, the starting point of solvers.
    guess: Vec<f64>,
    /// Standard deviations of the priors.
    sigmas: Vec<f64>,
    /// Standard deviations of the measurements.
    noise: Noise,
    /// Threshold of the Huber loss, in standard deviations.
    huber: f64,
    /// Recorded session.
    session: Session,
    /// Solution of this project.
    ours: Vec<f64>,
    /// Cost of the solution.
    cost: f64,
    /// Time of this project's solver, in s.
    solve_seconds: f64,
    /// Height of the neck above the chest, in m.
    neck_height: f64,
    /// Centre between the cameras and baseline in m; focal length, width and height in pixels.
    cameras: ([f64; 3], f64, [f64; 3]),
    /// Position in m, inclination in rad, and lengths from base to shoulder, elbow and wrist in m, for each arm.
    arms: Vec<([f64; 3], f64, [f64; 3])>,
}

/// Returns the problem of a session.
///
/// # Errors
/// An invalid setting.
fn peer_session(
    robot: &Robot,
    config: &CalibrationConfig,
    session: &Session,
    report: &SolveReport,
) -> Result<PeerSession, TrialError> {
    let description = robot.description();
    let cameras = &description.cameras;
    let list = |x: Unknowns| x.as_slice().to_vec();
    Ok(PeerSession {
        names: (0..UNKNOWNS).map(name).collect(),
        places: vec![
            at::camera(0),
            at::marker(0),
            at::offsets(0),
            at::compliances(0),
            at::mount(0),
            at::NECK,
            at::IMU_TURN,
            at::ACCELEROMETER_BIAS,
            at::GYROSCOPE_BIAS,
            at::CAMERA_JOINTS,
        ],
        guess: list(config.priors.guess()),
        sigmas: list(config.priors.sigmas()?),
        noise: config.noise,
        huber: config.huber,
        session: session.clone(),
        ours: list(report.calibration.unknowns()),
        cost: report.cost,
        solve_seconds: report.solve_seconds,
        neck_height: description.neck.height,
        cameras: (
            cameras.centre,
            cameras.baseline,
            [
                cameras.focal,
                f64::from(cameras.width),
                f64::from(cameras.height),
            ],
        ),
        arms: description
            .arms
            .iter()
            .map(|arm| {
                let lengths = [
                    arm.base_to_shoulder,
                    arm.shoulder_to_elbow,
                    arm.elbow_to_wrist,
                ];
                (arm.position, arm.lean, lengths)
            })
            .collect(),
    })
}
