//! Camera pictures: background, people, balls, blur and noise.
//!
//! Pictures are rendered from the true state only. The background is infinitely far away: it rotates, but has no
//! parallax. People and balls are ellipsoids, lit from one side, which hide everything behind them. A picture
//! averages over the exposure time and has noise. The lens distortion is that of the robot's description, after the
//! planted errors of the camera: a ray through `(a, b)`, in focal lengths to the right and below the optical axis, is
//! imaged at `(a, b) (1 + k1 s + k2 s^2)` with `s = a^2 + b^2`.
//!
//! Not modelled: parallax of the background, reflections, shadows, arms in the picture, focus.

mod noise;
mod optics;
mod solid;
mod surroundings;

use std::sync::Arc;

use nalgebra::{Matrix3, Rotation3, Vector3};
use serde::{Deserialize, Serialize};
use tactnet_catching_packets::packets::Circle;
use tactnet_catching_packets::{Cameras as Optics, RobotDescription};

use crate::cameras::{CAMERAS, Cameras, evenly};
use crate::config::WorldConfig;
use crate::error::{WorldError, from_to, not_negative, rising};
use crate::robot::FrameMotion;
use crate::stream::{Stream, picture};
use crate::world::Truth;
use noise::Noise;
use optics::Rays;
use solid::Solid;
use surroundings::Surroundings;

/// Direction of the light in the inertial frame: above and behind the robot's left shoulder.
const LIGHT: [f64; 3] = [-0.45, 0.4, 0.8];
/// Brightness of a fully lit marker, as a share of 255.
const MARKER_SHADE: f32 = 0.9;
/// Distances of people from the robot, in m: behind the thrower, so that they hide no ball.
const PEOPLE: [f64; 2] = [6.3, 8.5];

tactnet_catching_packets::settings! {
    /// Settings of the pictures.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)] #[serde(deny_unknown_fields, default)]
    pub struct PicturesConfig in "pictures.": WorldError {
        /// Standard deviation of the pixel noise, in grey levels of 0 to 255.
        pub noise: f64 = 2.0 => not_negative,
        /// Number of discs on the walls in front of the robot.
        pub discs: usize = 12 => from_to([0.0, 1000.0], "0 to 1000"),
        /// Number of people in front of the robot; their round heads resemble balls.
        pub people: usize = 3 => from_to([0.0, 50.0], "0 to 50"),
        /// Minimum and maximum brightness of a fully lit ball, as a share of 255; drawn for each ball.
        pub ball: [f64; 2] = [0.6, 0.95] => shares,
        /// True to draw the markers on the wrists.
        pub markers: bool = false,
        /// Delay of the exposure relative to its timestamp, in s.
        pub clock_offset: f64 = 0.0 => from_to([-0.02, 0.02], "a magnitude of at most 20 ms"),
    }
}

/// Returns an error unless a range consists of shares.
fn shares(setting: &'static str, value: &[f64; 2]) -> Result<(), WorldError> {
    rising(0.0, "[least, greatest] share of 255")(setting, value)?;
    Ok(from_to([0.0, 1.0], "shares up to 1")(setting, value)?)
}

/// Renderer of pictures.
#[derive(Debug, Clone)]
pub struct Pictures {
    config: PicturesConfig,
    cameras: Cameras,
    optics: Optics,
    radius: f64,
    marker_radius: f64,
    /// Rays of each camera; shared if both lenses are equal.
    rays: [Arc<Rays>; CAMERAS],
    surroundings: Surroundings,
    people: Vec<Person>,
    noise: Noise,
    seed: u64,
    row: Vec<f32>,
}

/// A person who sways a little.
#[derive(Debug, Clone, Copy)]
struct Person {
    feet: Vector3<f64>,
    height: f64,
    skin: f32,
    hair: f32,
    cloth: f32,
    phase: f64,
}

impl Pictures {
    /// Draws the background.
    ///
    /// - `seed`: seed of the world, for background, people, brightness and noise
    ///
    /// # Errors
    /// A setting that is out of range.
    pub fn new(
        description: &RobotDescription,
        config: &WorldConfig,
        seed: u64,
    ) -> Result<Self, WorldError> {
        config.check()?;
        let optics = description.cameras;
        for (setting, pixels) in [
            ("description.cameras.width", optics.width),
            ("description.cameras.height", optics.height),
        ] {
            from_to([16.0, 8192.0], "16 to 8192 pixels")(setting, &pixels)?;
        }
        let mut rng = Stream::People.rng(seed, 0);
        let mut between = |range| evenly(range, &mut rng);
        let people = (0..config.pictures.people)
            .map(|_| {
                let distance = between(PEOPLE);
                let aside = between([-0.45, 0.45]) * distance;
                Person {
                    feet: Vector3::new(distance, aside, 0.0),
                    height: between([1.5, 1.95]),
                    skin: between([0.35, 0.75]) as f32,
                    hair: between([0.05, 0.45]) as f32,
                    cloth: between([0.1, 0.8]) as f32,
                    phase: between([0.0, std::f64::consts::TAU]),
                }
            })
            .collect();
        let [left, right] = config.errors.each_camera(seed);
        let rays = Arc::new(Rays::new(&optics, &left));
        let rays = match left.has_lens_of(&right) {
            true => [rays.clone(), rays],
            false => [rays, Arc::new(Rays::new(&optics, &right))],
        };
        Ok(Self {
            cameras: Cameras::new(&config.cameras, &config.errors, &optics, seed),
            radius: config.ball.radius,
            marker_radius: config.markers.radius,
            rays,
            surroundings: Surroundings::draw(config.pictures.discs, seed),
            people,
            noise: Noise::new(config.pictures.noise, seed),
            config: config.pictures.clone(),
            optics,
            seed,
            row: vec![0.0; optics.width as usize],
        })
    }

    /// Returns width and height, in pixels.
    pub fn size(&self) -> [usize; 2] {
        [self.optics.width as usize, self.optics.height as usize]
    }

    /// Renders the picture of a camera (0 left, 1 right), exposed around the time of `truth`.
    ///
    /// - `frame`: number of the picture, for the noise
    /// - `pixels`: brightness, shape `[height][width]`
    ///
    /// # Panics
    /// Unknown camera, or wrong size of `pixels`.
    pub fn draw(&mut self, truth: &Truth, frame: u64, camera: usize, pixels: &mut [u8]) {
        assert!(camera < CAMERAS, "cameras are 0 and 1");
        let [width, height] = self.size();
        assert_eq!(pixels.len(), width * height, "pixels of a picture");
        let exposure = self.optics.exposure;
        let offset = self.config.clock_offset;
        // Two samples if the background is blurred over more than a pixel.
        let smear = truth.head.rate.norm() * exposure * self.optics.focal;
        let moments: &[f64] = if smear > 1.5 { &[-0.25, 0.25] } else { &[0.0] };
        let views: Vec<Matrix3<f64>> = moments
            .iter()
            .map(|part| self.eye(camera, &truth.head, offset + part * exposure).turn)
            .collect();
        let solids = self.solids(truth, camera);
        let mut rng = Stream::PictureNoise.rng(self.seed, picture(frame, camera, 0));
        for (v, line) in pixels.chunks_exact_mut(width).enumerate() {
            let rays = self.rays[camera].row(v);
            self.row.fill(0.0);
            for view in &views {
                self.surroundings
                    .add(view, rays, 1.0 / views.len() as f32, &mut self.row);
            }
            for solid in &solids {
                solid.cover(v, rays, self.optics.focal, &mut self.row);
            }
            self.noise.add(&self.row, line, &mut rng);
        }
    }

    /// Returns the outline of a ball without noise and distortion, or `None` if its centre is outside the picture.
    pub fn outline(&self, truth: &Truth, camera: usize, ball: usize) -> Option<Circle> {
        let ball = truth.balls.get(ball).copied().flatten()?;
        self.cameras
            .outline(camera, &truth.head, &ball.state.position, self.radius)
    }

    /// Returns all objects in front of the background, the farthest first.
    fn solids(&self, truth: &Truth, camera: usize) -> Vec<Solid> {
        let exposure = self.optics.exposure;
        let offset = self.config.clock_offset;
        let (light, rays) = (Vector3::from(LIGHT).normalize(), &self.rays[camera]);
        let during = [-0.5, 0.5].map(|part| offset + part * exposure);
        let eyes = during.map(|dt| self.eye(camera, &truth.head, dt));
        let now = truth.time_ns as f64 * 1e-9;
        let mut solids: Vec<Solid> = Vec::new();
        let mut add = |centres: [Vector3<f64>; 2], axes: Vector3<f64>, shades: [f32; 2]| {
            let seen = [0, 1].map(|i| eyes[i].turn.tr_mul(&(centres[i] - eyes[i].position)));
            let turn = (eyes[0].turn + eyes[1].turn) * 0.5;
            solids.extend(Solid::new(seen, axes, &turn, light, shades, rays));
        };
        for person in &self.people {
            let sway = Vector3::new(0.0, 0.04 * (1.3 * now + person.phase).sin(), 0.0);
            let head = person.feet + sway + Vector3::z() * (person.height - 0.12);
            let chest = person.feet + sway * 0.5 + Vector3::z() * (person.height - 0.62);
            let legs = person.feet + Vector3::z() * (person.height * 0.25);
            let (cloth, face) = (person.cloth, [person.skin, person.hair]);
            let of_legs = Vector3::new(0.14, 0.18, person.height * 0.28);
            add([legs; 2], of_legs, [cloth * 0.6; 2]);
            add([chest; 2], Vector3::new(0.14, 0.22, 0.36), [cloth; 2]);
            add([head; 2], Vector3::new(0.1, 0.08, 0.12), face);
        }
        let marker_axes = Vector3::repeat(self.marker_radius);
        for marker in truth.markers.iter().filter(|_| self.config.markers) {
            let centres = during.map(|dt| marker.position + marker.velocity * dt);
            add(centres, marker_axes, [MARKER_SHADE; 2]);
        }
        for ball in truth.balls.iter().flatten() {
            let mut rng = Stream::BallBrightness.rng(self.seed, ball.number);
            let shade = evenly(self.config.ball, &mut rng) as f32;
            let centres = during.map(|dt| ball.state.position + ball.state.velocity * dt);
            add(centres, Vector3::repeat(self.radius), [shade; 2]);
        }
        solids.sort_by(|a, b| b.depth.total_cmp(&a.depth));
        solids
    }

    /// Returns the pose of a camera in the inertial frame, `dt` seconds after the head was at `head`.
    fn eye(&self, camera: usize, head: &FrameMotion, dt: f64) -> Eye {
        let turned = Rotation3::new(head.rate * dt).into_inner() * head.rotation;
        let (offset, turn) = self.cameras.mount(camera);
        Eye {
            position: head.position + head.velocity * dt + turned * offset,
            turn: turned * turn,
        }
    }
}

struct Eye {
    position: Vector3<f64>,
    turn: Matrix3<f64>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose::ready;
    use crate::world::World;
    use tactnet_catching_packets::packets::JointCommand;

    /// A quarter of the resolution, for speed.
    fn description() -> RobotDescription {
        let mut description = RobotDescription::nominal();
        let cameras = &mut description.cameras;
        (cameras.width, cameras.height, cameras.focal) = (400, 312, 346.5);
        description
    }

    /// Returns true states during the flight of a ball.
    fn in_flight(description: &RobotDescription, config: &WorldConfig, seed: u64) -> Vec<Truth> {
        let mut world = World::new(description, config, seed, &ready()).unwrap();
        world.throw(1);
        let command = JointCommand::still(ready());
        let mut truths = Vec::new();
        for tick in 0..700 {
            world.step(&command, &[None; 2]);
            if tick % 100 == 50 {
                truths.push(world.truth());
            }
        }
        truths
    }

    fn drawn(pictures: &mut Pictures, truth: &Truth, camera: usize) -> Vec<u8> {
        let [width, height] = pictures.size();
        let mut pixels = vec![0; width * height];
        pictures.draw(truth, 3, camera, &mut pixels);
        pixels
    }

    #[test]
    fn pictures_repeat_to_the_bit_from_their_seed() {
        let (description, config) = (description(), WorldConfig::default());
        let truth = in_flight(&description, &config, 7)[2];
        let picture = |seed: u64, camera: usize| {
            let mut pictures = Pictures::new(&description, &config, seed).unwrap();
            drawn(&mut pictures, &truth, camera)
        };
        let first = picture(7, 0);
        assert!(first == picture(7, 0));
        assert!(first != picture(8, 0));
        assert!(first != picture(7, 1));
        // The grey levels are spread over the range, neither black nor saturated.
        let mean = first.iter().map(|&digit| f64::from(digit)).sum::<f64>() / first.len() as f64;
        assert!((40.0..220.0).contains(&mean), "{mean}");
    }

    /// Pictures with and without the ball differ only within its outline, also with a lens that is not as described.
    #[test]
    fn a_ball_is_drawn_where_its_outline_says() {
        let mut description = description();
        description.cameras.distortion = [0.0; 2];
        description.cameras.exposure = 1e-6;
        let mut config = WorldConfig::default();
        (config.pictures.noise, config.pictures.people) = (0.0, 0);
        let errors = &mut config.errors;
        (errors.focal, errors.centre, errors.distortion) = (10.0, 8.0, 0.015);
        let mut pictures = Pictures::new(&description, &config, 5).unwrap();
        let [width, _] = pictures.size();
        let mut seen = 0;
        for truth in in_flight(&description, &config, 5) {
            for camera in 0..2 {
                let Some(outline) = pictures.outline(&truth, camera, 0) else {
                    continue;
                };
                let mut empty = truth;
                empty.balls = Default::default();
                let (with, without) = (
                    drawn(&mut pictures, &truth, camera),
                    drawn(&mut pictures, &empty, camera),
                );
                let differing = with.iter().zip(&without).enumerate();
                let differing: Vec<[f64; 2]> = differing
                    .filter(|(_, (a, b))| a.abs_diff(**b) > 3)
                    .map(|(i, _)| [(i % width) as f64 + 0.5, (i / width) as f64 + 0.5])
                    .collect();
                let away = |[u, v]: &[f64; 2]| (u - outline.u).hypot(v - outline.v);
                let farthest = differing.iter().map(away).fold(0.0, f64::max);
                assert!(farthest < outline.r + 1.0, "{farthest} {outline:?}");
                let area = std::f64::consts::PI * outline.r * outline.r;
                assert!(differing.len() as f64 > 0.5 * area, "{outline:?}");
                seen += 1;
            }
        }
        assert!(seen >= 4, "{seen}");
    }
}
