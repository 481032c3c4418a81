//! A session's problem written out for other solvers, with our answer.

use serde::Serialize;
use tactnet_catching::Robot;
use tactnet_catching::calibrate::{
    CalibrationConfig, Noise, Session, UNKNOWNS, Unknowns, at, name,
};

use super::SolveReport;

/// The problem of a session, and what we made of it.
#[derive(Debug, Clone, Serialize)]
pub struct PeerSession {
    /// Names of the unknowns.
    pub names: Vec<String>,
    /// Where the unknowns stand: first of the left camera, marker, offsets, compliances, mount; neck; turn of the inertial unit, biases; clocks.
    pub places: Vec<usize>,
    /// Middles of the priors, where solvers begin.
    pub guess: Vec<f64>,
    /// Their standard deviations.
    pub sigmas: Vec<f64>,
    /// Standard deviations of measurements.
    pub noise: Noise,
    /// Edge of Huber's loss, standard deviations.
    pub huber: f64,
    /// What was recorded.
    pub session: Session,
    /// Our minimum.
    pub ours: Vec<f64>,
    /// Its cost.
    pub cost: f64,
    /// Time of our solver, s.
    pub solve_seconds: f64,
    /// Height of the neck over the chest, m.
    pub neck_height: f64,
    /// Middle between the cameras, m; baseline, m; focal length, width, height, pixels.
    pub cameras: ([f64; 3], f64, [f64; 3]),
    /// Position, m, lean, rad, and lengths from base to shoulder, elbow, wrist, m, of each arm.
    pub arms: Vec<([f64; 3], f64, [f64; 3])>,
}

/// Puts a problem together.
///
/// # Errors
/// Where a setting makes no sense.
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
