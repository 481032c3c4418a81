//! Least-squares problem of a session for other solvers, with the solution of this project.

use serde::Serialize;
use tactnet_catching::Robot;
use tactnet_catching::calibrate::{
    CalibrationConfig, Noise, Session, UNKNOWNS, Unknowns, at, name,
};

use super::SolveReport;

/// Least-squares problem of a session and its solution.
#[derive(Debug, Clone, Serialize)]
pub struct PeerSession {
    /// Names of the unknowns.
    pub names: Vec<String>,
    /// Indices of the unknowns: left camera, marker, offsets, compliances, mount; neck; rotation of the inertial
    /// unit, biases; clocks.
    pub places: Vec<usize>,
    /// Means of the priors, the starting point of solvers.
    pub guess: Vec<f64>,
    /// Standard deviations of the priors.
    pub sigmas: Vec<f64>,
    /// Standard deviations of the measurements.
    pub noise: Noise,
    /// Threshold of the Huber loss, in standard deviations.
    pub huber: f64,
    /// Recorded session.
    pub session: Session,
    /// Solution of this project.
    pub ours: Vec<f64>,
    /// Cost of the solution.
    pub cost: f64,
    /// Time of this project's solver, in s.
    pub solve_seconds: f64,
    /// Height of the neck above the chest, in m.
    pub neck_height: f64,
    /// Centre between the cameras and baseline in m; focal length, width and height in pixels.
    pub cameras: ([f64; 3], f64, [f64; 3]),
    /// Position in m, inclination in rad, and lengths from base to shoulder, elbow and wrist in m, for each arm.
    pub arms: Vec<([f64; 3], f64, [f64; 3])>,
}

/// Returns the problem of a session.
///
/// # Errors
/// An invalid setting.
pub fn peer_session(
    robot: &Robot,
    config: &CalibrationConfig,
    session: &Session,
    report: &SolveReport,
) -> Result<PeerSession, crate::error::TrialError> {
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
