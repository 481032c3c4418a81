//! Settings of a world.

use serde::{Deserialize, Serialize};

use crate::ball::{Aerodynamics, BallConfig};
use crate::cameras::CamerasConfig;
use crate::depth::DepthConfig;
use crate::drives::DrivesConfig;
use crate::error::WorldError;
use crate::fingers::FingersConfig;
use crate::imu::ImuConfig;
use crate::markers::MarkersConfig;
use crate::obstacles::ObstaclesConfig;
use crate::pictures::PicturesConfig;
use crate::planted::PlantedErrors;
use crate::release::ReleaseConfig;
use crate::thrower::ThrowerConfig;
use crate::torso::TorsoConfig;

/// Settings of a world, checked by [`crate::World::new`]. Missing fields have the values of `Default`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct WorldConfig {
    /// Balls and air.
    pub ball: BallConfig,
    /// Thrower of the balls.
    pub thrower: ThrowerConfig,
    /// Drives of the joints.
    pub drives: DrivesConfig,
    /// Springs of the torso.
    pub torso: TorsoConfig,
    /// Inertial unit.
    pub imu: ImuConfig,
    /// Circle detector.
    pub cameras: CamerasConfig,
    /// Markers on the wrists.
    pub markers: MarkersConfig,
    /// Rendered pictures.
    pub pictures: PicturesConfig,
    /// Obstacles; none by default.
    pub obstacles: ObstaclesConfig,
    /// Depth camera.
    pub depth: DepthConfig,
    /// Deviations of the robot from its description.
    pub errors: PlantedErrors,
    /// Fingers and palms of the second judge.
    pub fingers: FingersConfig,
    /// Release of balls by the hands.
    pub release: ReleaseConfig,
}

impl WorldConfig {
    /// Checks all settings.
    ///
    /// # Errors
    /// The first setting that is out of range.
    pub(crate) fn check(&self) -> Result<(), WorldError> {
        self.ball.check_settings()?;
        // The ball with the highest drag has the shortest range.
        let without_spin = nalgebra::Vector3::zeros();
        let air = Aerodynamics::new(&self.ball, self.ball.drag[1], without_spin);
        self.thrower.check(&air)?;
        self.drives.check_settings()?;
        self.torso.check_settings()?;
        self.imu.check_settings()?;
        self.cameras.check_settings()?;
        self.markers.check_settings()?;
        self.pictures.check_settings()?;
        self.obstacles.check()?;
        self.depth.check_settings()?;
        self.fingers.check_settings()?;
        self.release.check_settings()?;
        self.errors.check_settings()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_out_of_range_are_named() {
        type Spoil = fn(&mut WorldConfig);
        let cases: [(&str, Spoil); 24] = [
            ("fingers.restitution", |c| c.fingers.restitution = 1.1),
            ("pictures.noise", |c| c.pictures.noise = -1.0),
            ("pictures.ball", |c| c.pictures.ball = [0.5, 1.5]),
            ("ball.mass", |c| c.ball.mass = 0.0),
            ("ball.air", |c| c.ball.air = f64::NAN),
            ("ball.drag", |c| c.ball.drag = [0.5, 0.4]),
            ("ball.restitution", |c| c.ball.restitution = 1.5),
            ("thrower.speed", |c| c.thrower.speed = [0.0, 8.0]),
            ("thrower.box", |c| c.thrower.box_least[1] = 1.0),
            ("out of reach", |c| c.thrower.box_greatest[2] = 9.0),
            ("drives.latency", |c| c.drives.latency = -0.001),
            ("drives.bandwidth", |c| c.drives.bandwidth = 500.0),
            ("torso.frequencies", |c| c.torso.frequencies[2] = 0.0),
            ("imu.scale", |c| c.imu.scale = f64::INFINITY),
            ("cameras.detection", |c| c.cameras.detection = 1.1),
            ("cameras.clutter", |c| c.cameras.clutter = 100.0),
            ("depth.noise", |c| c.depth.noise = f64::NAN),
            ("depth.width", |c| c.depth.width = 0),
            ("obstacles.boxes.size", |c| {
                c.obstacles = crate::ObstaclesConfig::table_and_box();
                c.obstacles.boxes[1].size[2] = 0.0;
            }),
            ("obstacles.boxes", |c| {
                let shape = crate::ObstaclesConfig::table_and_box().boxes[0];
                c.obstacles.boxes = vec![shape; 17];
            }),
            ("release.jitter", |c| c.release.jitter = -1e-3),
            ("markers.detection", |c| c.markers.detection = 2.0),
            ("errors.imu_clock", |c| c.errors.imu_clock = f64::NAN),
            ("errors.arm_mount", |c| c.errors.arm_mount = -0.01),
        ];
        for (named, spoil) in cases {
            let mut config = WorldConfig::default();
            spoil(&mut config);
            let error = config.check().unwrap_err().to_string();
            assert!(error.contains(named), "{named}: {error}");
        }
        assert_eq!(WorldConfig::default().check(), Ok(()));
    }

    #[test]
    fn unknown_settings_are_refused_and_missing_ones_are_defaults() {
        let parse = |text: &str| serde_json::from_str::<WorldConfig>(text);
        assert_eq!(parse("{}").unwrap(), WorldConfig::default());
        let rigid = parse(r#"{"torso": {"stiffness": "rigid"}}"#).unwrap();
        assert_eq!(rigid.torso.stiffness, crate::Stiffness::Rigid);
        for text in [r#"{"bal": {}}"#, r#"{"ball": {"weight": 1.0}}"#] {
            let error = parse(text).unwrap_err().to_string();
            assert!(error.contains("unknown field"), "{error}");
        }
    }
}
