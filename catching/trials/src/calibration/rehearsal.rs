//! Calibration session in the simulated world.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tactnet_catching::calibrate::{
    CalibrationConfig, Candidate, Model, Phase, Recorder, Routine, RoutineConfig, Session,
    draw_candidate,
};
use tactnet_catching::safety::Bodies;
use tactnet_catching_packets::ARMS;
use tactnet_catching_packets::packets::JointCommand;
use tactnet_catching_world::{TICK_NS, World, WorldConfig};

use super::features::{FeatureCounts, FeatureReport};
use crate::error::TrialError;
use crate::eyes::Eyes;

/// Maximum number of draws of a configuration with visible markers.
const DRAWS: usize = 2_000_000;

/// Draws `count` configurations, alternating between both arms, with a visible marker and a collision-free path.
///
/// # Errors
/// Too few such configurations.
pub(crate) fn candidates(
    model: &Model,
    config: &CalibrationConfig,
    seed: u64,
    count: usize,
) -> Result<Vec<Candidate>, TrialError> {
    let bodies = Bodies::new(model.robot().description());
    let guess = config.priors.guess();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut found = Vec::with_capacity(count);
    for _ in 0..DRAWS {
        if found.len() == count {
            break;
        }
        let arm = found.len() % ARMS;
        found.extend(draw_candidate(model, &bodies, &guess, arm, || {
            rng.random::<f64>()
        }));
    }
    if found.len() < count {
        return Err(TrialError::NoConfigurations {
            expected: count,
            found: found.len(),
        });
    }
    Ok(found)
}

/// Runs a session: the robot moves through its configurations and back, with a tick of 1 ms. If the pictures of the
/// world show markers, the features are detected in them. Returns the session and its features compared with the truth.
///
/// # Errors
/// Invalid settings of the world.
pub(crate) fn rehearse(
    model: &Model,
    world: &WorldConfig,
    routine: &RoutineConfig,
    configurations: &[Candidate],
    seed: u64,
) -> Result<(Session, FeatureReport), TrialError> {
    let robot = model.robot();
    let guess = CalibrationConfig::default().priors.guess();
    let routine = Routine::new(robot, routine, configurations);
    let mut eyes = match world.pictures.markers {
        true => Some(Eyes::new(robot, world, seed)?),
        false => None,
    };
    let mut world = World::new(robot.description(), world, seed, &robot.waiting())?;
    let mut counts = FeatureCounts::default();
    let cameras = &robot.description().cameras;
    let size = [cameras.width, cameras.height].map(f64::from);
    let mut recorder = Recorder::new(routine.seconds());
    let ticks = (routine.seconds() * 1e9) as u64 / TICK_NS + 100;
    for number in 0..ticks {
        let t = number as f64 * 1e-3;
        let (q, dq, phase) = routine.at(t);
        let command = JointCommand {
            number,
            command_ns: number * TICK_NS,
            ..JointCommand::of(q, dq)
        };
        let sensed = *world.step(&command, &[None; ARMS]);
        // The joints lag slightly behind; at the ends of a phase the arm stands still.
        recorder.joints(&sensed.joints);
        if let Some(sample) = &sensed.imu {
            recorder.sample(sample, phase);
        }
        let (Some([left, _]), Phase::Marker { arm, .. }) = (&sensed.circles, phase) else {
            continue;
        };
        let features = match &mut eyes {
            Some(eyes) => {
                let mut circles = eyes.see(&world.truth(), None);
                for of in &mut circles {
                    (of.frame, of.exposure_ns) = (left.frame, left.exposure_ns);
                }
                recorder.circles(model, &guess, &circles, phase)
            }
            None => {
                let features = world.marker_features();
                recorder.features(left.frame, left.exposure_ns, &features, phase);
                features[arm]
            }
        };
        for (camera, found) in features.into_iter().enumerate() {
            counts.add(found, world.true_feature(camera, arm), size);
        }
    }
    Ok((recorder.finish(), counts.report()))
}
