//! Simulated robot, ball and sensors, and the judge of catches. The crate does not depend on the stack that it
//! judges. It deviates from the robot's description: the torso is elastic, the wheels slip, and the arms may be
//! mounted with errors.
//!
//! A [`World`] advances in ticks of 1 ms and is reproducible from its seed, bit by bit. It reads no clock and starts
//! no threads, and its step does not allocate.
//!
//! | part | model | step |
//! |---|---|---|
//! | ball | `(m + m_a) dv/dt = -(m - m_b) g - 1/2 rho C_d A \|v\| v + lift`, Runge-Kutta | 0.1 ms |
//! | drives | `ddq = a_c + w^2 (q_c - q) + 2 w (dq_c - dq)`, limits kept | 0.5 ms |
//! | torso | `M_ee dde = -K e - D de - b(q, dq, ddq)`, Newton-Euler over 21 bodies (Luh, Walker and Paul 1980), drift-kick-drift | 0.5 ms |
//! | platform | true position = drive + slip, `s tanh(distance / 0.15 m)` | 0.5 ms |
//! | inertial unit | specific force and angular rate at its place in the true head, with bias, scale and noise | 512
//! Hz |
//! | cameras | outline of a sphere, with noise, misses and clutter; simultaneous exposures | 25 Hz |
//! | hands | enclose the ball 10 ms after they start to close; release it 10 ms after they start to open | 1 ms |
//! | fingers | four chains of three phalanges and a palm in contact with a copy of each ball ([`Cage`]) | 0.1 ms |
//! | obstacles | boxes; contacts with the robot, collisions with balls | 1 ms |
//! | depth camera | rays to boxes, floor and the robot itself, with noise and invalid pixels | on request |
//! | markers | [`MarkersConfig`]: features of a calibration session, with noise, misses and outliers | on request |
//! | pictures | [`Pictures`]: room, people, balls, blur, distortion and noise, rendered from the true state | on
//! request |
//!
//! The drives prescribe the motion of their joints, regardless of the torque. The reaction of arms, neck and platform
//! acts on the springs of the torso and shakes chest and head. The neck is stiff. The arms are stiff, or bend under
//! their weight ([`PlantedErrors::arm_compliance`]).
//!
//! Frames and joint numbers are those of [`tactnet_catching_packets`]. Values that the thesis does not give (springs,
//! damping, noise, latency, spin) are settings. Their defaults are estimates, most of them from the digest of its
//! chapter 3.
//!
//! Not modelled: self-collisions, contact forces, contact of the ball with the robot's arms and body, occlusion of the
//! ball by boxes and arms, the delay from exposure to circles (the caller adds it), elasticity of the neck, bending of
//! the arms by their motion, torque limits.

mod ball;
mod caging;
mod cameras;
mod config;
mod contact;
mod depth;
mod drives;
mod dynamics;
mod error;
mod fingers;
mod hand;
mod imu;
mod judge;
mod kinematics;
mod markers;
mod obstacles;
mod pictures;
mod planted;
#[cfg(test)]
mod pose;
mod release;
mod robot;
mod shape;
mod stream;
mod tendon;
mod thrower;
mod torso;
mod world;

pub use ball::{BallConfig, BallState};
pub use caging::Cage;
pub use cameras::CamerasConfig;
pub use config::WorldConfig;
pub use contact::{Contact, Contacts};
pub use depth::DepthConfig;
pub use drives::{ACCELERATION_HEADROOM, DrivesConfig};
pub use error::WorldError;
pub use fingers::FingersConfig;
pub use hand::{CLOSED_NS, CLOSING_NS};
pub use imu::ImuConfig;
pub use judge::{Crossing, MAX_ACROSS, MAX_ALONG_NS, MAX_ANGLE, Miss, NEAR, Verdict};
pub use markers::MarkersConfig;
pub use obstacles::{BoxConfig, ObstaclesConfig, StandingBox};
pub use pictures::{Pictures, PicturesConfig};
pub use planted::PlantedErrors;
pub use release::{ReleaseConfig, Released};
pub use robot::FrameMotion;
pub use tendon::TendonSlip;
pub use thrower::ThrowerConfig;
pub use torso::{Stiffness, TorsoConfig};
pub use world::{BallTruth, FlightSample, Grasp, Ignored, Sensed, TICK_NS, Truth, World, down_to};

/// Gravity, in m/s^2.
pub const GRAVITY: f64 = 9.81;
