//! A simulated robot, ball and sensors, and the judge of catches. Depends on nothing of the stack that it judges, and is worse than the
//! robot's description says: its torso gives way, its wheels slip, its arms may be mounted elsewhere.
//!
//! A [`World`] goes in ticks of a millisecond and repeats to the bit from its seed. It reads no clock, starts no threads, and its step
//! does not allocate.
//!
//! | part | model | step |
//! |---|---|---|
//! | ball | `(m + m_a) dv/dt = -(m - m_b) g - 1/2 rho C_d A \|v\| v + lift`, Runge-Kutta | 0.1 ms |
//! | drives | `ddq = a_c + w^2 (q_c - q) + 2 w (dq_c - dq)`, limits kept | 0.5 ms |
//! | torso | `M_ee dde = -K e - D de - b(q, dq, ddq)`, Newton-Euler over 21 bodies (Luh, Walker and Paul 1980), drift-kick-drift | 0.5 ms |
//! | platform | true place = drive + slip, `s tanh(way / 0.15 m)` | 0.5 ms |
//! | inertial unit | specific force and rate of its place in the true head, with bias, scale, noise | 512 Hz |
//! | cameras | outline of a sphere, with noise, misses, clutter; both exposed together | 25 Hz |
//! | hands | close once, 10 ms after they begin to; let go 10 ms after they begin to open | 1 ms |
//! | obstacles | boxes: which parts of the robot are in one, whether a ball flies into one | 1 ms |
//! | depth camera | rays to boxes, floor and the robot itself, with noise and holes | when asked for |
//! | markers | [`MarkersConfig`]: features of a calibration session, with noise, misses, outlying ones | when asked for |
//! | pictures | [`Pictures`]: a room, people, balls, blur, distortion, noise, from the truth of a moment | when asked for |
//!
//! The drives prescribe the motion of their joints, whatever torque it takes; the reaction of arms, neck and platform goes into the
//! torso's springs, and so shakes chest and head. The neck is stiff; arms are, or sag under their
//! weight ([`PlantedErrors::arm_compliance`]).
//!
//! Frames and joint numbers are those of [`tactnet_catching_packets`]. The numbers that the thesis does not give (springs, damping, noise,
//! latency, spin) are settings; the defaults are ours, most from the digest of its chapter 3.
//!
//! Left out: self-collision, forces of contact, contact of ball with robot and fingers, boxes and arms hiding the ball, the delay from
//! exposure to circles (the runner's), elasticity of the neck, what motion adds to the sag of the arms, torque limits.

mod ball;
mod cameras;
mod config;
mod contact;
mod depth;
mod drives;
mod dynamics;
mod error;
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
pub use cameras::CamerasConfig;
pub use config::WorldConfig;
pub use contact::{Contact, Contacts};
pub use depth::{DepthConfig, DepthPicture};
pub use drives::{ACCELERATION_HEADROOM, DrivesConfig};
pub use error::WorldError;
pub use hand::{CLOSED_NS, CLOSING_NS};
pub use imu::ImuConfig;
pub use judge::{Crossing, MAX_ACROSS, MAX_ALONG_NS, MAX_ANGLE, Miss, NEAR, Verdict};
pub use markers::MarkersConfig;
pub use obstacles::{BoxConfig, ObstaclesConfig, StandingBox};
pub use pictures::{Outline, Pictures, PicturesConfig};
pub use planted::PlantedErrors;
pub use release::{OPENING_NS, OpenCommand, ReleaseConfig, Released};
pub use robot::FrameMotion;
pub use tendon::TendonSlip;
pub use thrower::ThrowerConfig;
pub use torso::{Stiffness, TorsoConfig};
pub use world::{BallTruth, FlightSample, Ignored, Sensed, TICK_NS, Truth, World, down_to};

/// Gravity, m/s^2.
pub const GRAVITY: f64 = 9.81;
