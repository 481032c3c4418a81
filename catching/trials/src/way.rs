//! Ways of the whole body around a box (thesis, figure 3.8): the robot looks at a table with a box, maps them, and moves
//! its left hand from the left of the box to the right.

use std::fmt::Write;
use std::time::Instant;

use nalgebra::{Point3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use tactnet_catching::map::{
    ARM_SPHERES, DistanceField, Fusion, FusionConfig, STILL_SPHERES, VoxelGrid,
};
use tactnet_catching::plan::{BodyWay, WholeBody};
use tactnet_catching::safety::Bodies;
use tactnet_catching::{HandPose, Robot, rotation_towards};
use tactnet_catching_packets::{JOINTS, joint};
use tactnet_catching_world::{BoxConfig, World, WorldConfig};
use tactnet_plot::{Quantiles, stand_alone, wilson_of_counts};

use crate::error::TrialError;
use crate::look::{Motions, VIEWS, fusion_config, looking, own_body};
use crate::section::{Section, View};

/// Arm that moves: the left one.
const ARM: usize = 0;
/// Edge length of the small cells, in m, and of the large ones.
const FINE: f64 = 0.005;
/// Distance of the hand from the sides of the box before and after the way, in m.
const ASIDE: f64 = 0.24;
/// Minimum height of the hand above the table, in m.
const ABOVE_TABLE: f64 = 0.24;
/// Space around both places of the hand that has small cells, in m: to all sides, above.
const AROUND: [f64; 2] = [0.2, 0.35];

/// Ways around boxes, one scene after the other.
#[derive(Debug, Clone)]
pub struct WayTrials {
    /// Robot.
    pub robot: Robot,
    /// Settings of the world; its obstacles are replaced.
    pub world: WorldConfig,
    /// Number of scenes.
    pub scenes: u64,
    /// Seed of the first scene; each further scene has the next one.
    pub seed: u64,
}

/// Results. All but the times repeat to the bit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WayReport {
    /// Number of scenes in which the hand has a place on both sides of the box.
    pub scenes: usize,
    /// Number of ways without contact.
    pub clear: usize,
    /// Share of clear ways.
    pub rate: f64,
    /// Wilson interval of the share.
    pub ci95: [f64; 2],
    /// Number of straight ways with contact.
    pub straight_touches: usize,
    /// Time from the last depth picture to the way, in ms.
    pub picture_to_way_ms: Option<Quantiles>,
    /// Time of the plan alone, in ms.
    pub plan_ms: Option<Quantiles>,
    /// Single scenes.
    pub outcomes: Vec<WayOutcome>,
}

/// Result of one scene.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WayOutcome {
    /// Seed of the scene.
    pub seed: u64,
    /// Reason for a missing way; `None` if the robot moved.
    pub no_way: Option<String>,
    /// Duration of the motion, in s.
    pub seconds: f64,
    /// Ticks with contact between the robot and the table or the box.
    pub contacts: u64,
    /// True if the straight motion has contact.
    pub straight_touches: bool,
    /// Minimum distance of the robot's spheres from table and box during the motion, in mm; NaN without a motion.
    pub least_mm: f64,
    /// Times in ms: fusion of the last depth picture, distances, plan.
    pub fusion_ms: f64,
    /// Time of the distance transforms, in ms.
    pub distances_ms: f64,
    /// Time of the plan, in ms.
    pub plan_ms: f64,
}

/// Scene before the motion.
struct Scene {
    world: World,
    field: DistanceField,
    from: [f64; JOINTS],
    to: [f64; JOINTS],
    fusion_ms: f64,
    distances_ms: f64,
}

impl WayTrials {
    /// Runs all scenes.
    ///
    /// - `on_done`: called after each scene
    ///
    /// # Errors
    /// Settings that are out of range.
    pub fn run(&self, on_done: impl Fn()) -> Result<WayReport, TrialError> {
        let mut outcomes = Vec::new();
        for number in 0..self.scenes {
            let seed = self.seed.wrapping_add(number);
            if let Some(mut scene) = self.scene(seed)? {
                outcomes.push(self.outcome(seed, &mut scene)?);
            }
            on_done();
        }
        let good = |outcome: &&WayOutcome| outcome.no_way.is_none() && outcome.contacts == 0;
        let clear = outcomes.iter().filter(good).count();
        let of =
            |value: fn(&WayOutcome) -> f64| Quantiles::of(outcomes.iter().map(value).collect());
        Ok(WayReport {
            scenes: outcomes.len(),
            clear,
            rate: clear as f64 / outcomes.len().max(1) as f64,
            ci95: wilson_of_counts(clear, outcomes.len()),
            straight_touches: outcomes
                .iter()
                .filter(|outcome| outcome.straight_touches)
                .count(),
            picture_to_way_ms: of(|one| one.fusion_ms + one.distances_ms + one.plan_ms),
            plan_ms: of(|one| one.plan_ms),
            outcomes,
        })
    }

    /// Returns the settings of a world with a table and a box of random place and size.
    fn with_box(&self, seed: u64) -> WorldConfig {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut between = |low: f64, high: f64| low + (high - low) * rng.random::<f64>();
        let (table, size) = (
            between(0.6, 0.8),
            [between(0.12, 0.3), between(0.12, 0.3), between(0.35, 0.6)],
        );
        let middle = [
            between(0.62, 0.78),
            between(0.12, 0.32),
            table + 0.5 * size[2],
        ];
        let turn = between(-0.8, 0.8);
        let mut config = self.world.clone();
        config.obstacles.boxes = vec![
            BoxConfig::fixed([0.8, 0.2, table - 0.02], [0.6, 1.2, 0.04]),
            BoxConfig {
                turn,
                ..BoxConfig::fixed(middle, size)
            },
        ];
        config
    }

    /// Looks at a scene and finds poses on both sides of the box; `None` if the hand has no place there.
    fn scene(&self, seed: u64) -> Result<Option<Scene>, TrialError> {
        let (robot, config) = (&self.robot, self.with_box(seed));
        let mut world = World::new(robot.description(), &config, seed, &looking(robot))?;
        let one = world.boxes()[1];
        let half = one
            .corners()
            .iter()
            .map(|corner| corner.y - one.middle[1])
            .fold(0.0, f64::max);
        let places = [1.0, -1.0]
            .map(|side| Vector3::from(one.middle) + Vector3::y() * side * (half + ASIDE));
        // The hand stays above the table.
        let table = world.boxes()[0].middle[2];
        let places =
            places.map(|place| Vector3::new(place.x, place.y, place.z.max(table + ABOVE_TABLE)));
        let coarse = fusion_config(&config.depth);
        let fine = FusionConfig {
            grid: around(&places),
            truncation: 0.03,
            ..coarse
        };
        let mut maps = [Fusion::new(coarse)?, Fusion::new(fine)?];
        let mut motions = Motions::raised(robot, &mut world);
        let mut fusion_ms = 0.0;
        for (number, view) in VIEWS.iter().enumerate() {
            motions.turn_head(*view);
            let picture = motions.world.depth_picture(number as u64);
            let measured = &motions.measured;
            let chest = robot.chest(measured);
            let (head, own) = (
                chest * robot.head(measured),
                own_body(robot, measured, &chest),
            );
            let begun = Instant::now();
            let [coarse, fine] = &mut maps;
            std::thread::scope(|scope| {
                let other = scope.spawn(|| fine.push(&picture, &head, &own));
                coarse.push(&picture, &head, &own)?;
                other
                    .join()
                    .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
            })?;
            fusion_ms = 1e3 * begun.elapsed().as_secs_f64();
        }
        motions.turn_head([0.0; 2]);
        let begun = Instant::now();
        let [coarse, fine] = maps.map(|map| map.field());
        let field = coarse.with_finer(fine);
        let distances_ms = 1e3 * begun.elapsed().as_secs_f64();
        let poses = WholeBody::new(robot, &field, ARM);
        let Some(from) = self.pose(&poses, &motions.joints, &places[0]) else {
            return Ok(None);
        };
        let Some(to) = self.pose(&poses, &from, &places[1]) else {
            return Ok(None);
        };
        Ok(Some(Scene {
            world,
            field,
            from,
            to,
            fusion_ms,
            distances_ms,
        }))
    }

    /// Returns a pose with the left hand at a place, clear of obstacles and near a given pose.
    fn pose(
        &self,
        poses: &WholeBody<'_>,
        near: &[f64; JOINTS],
        place: &Vector3<f64>,
    ) -> Option<[f64; JOINTS]> {
        let (robot, bodies) = (&self.robot, Bodies::new(self.robot.description()));
        let arm = robot.arm(ARM);
        let mut best: Option<(f64, [f64; JOINTS])> = None;
        for number in 0..5 * 12 * 18 {
            let [yaw, spin, elbow] = [number / 216, number / 18 % 12, number % 18].map(f64::from);
            let mut q = *near;
            q[joint::TORSO.start] = 0.4 * (yaw - 2.0);
            let in_chest = robot.chest(&q).inverse();
            let ahead = in_chest * Vector3::new(1.0, 0.0, -0.2).normalize();
            let pose = HandPose {
                position: (in_chest * Point3::from(*place)).coords,
                rotation: rotation_towards(&ahead, spin * std::f64::consts::TAU / 12.0),
            };
            arm.inverse(&pose, elbow * std::f64::consts::TAU / 18.0, |angles| {
                q[joint::ARM[ARM].clone()].copy_from_slice(&angles);
                let inside = arm
                    .joints()
                    .iter()
                    .zip(&angles)
                    .all(|(joint, q)| (joint.range[0]..joint.range[1]).contains(q));
                let far: f64 = q.iter().zip(near).map(|(a, b)| (a - b).abs()).sum();
                let better = best.as_ref().is_none_or(|(least, _)| far < *least);
                let clear = || poses.clearance(&q) > 0.04 && bodies.least(&q) > 0.03;
                if inside && better && clear() {
                    best = Some((far, q));
                }
            });
        }
        best.map(|(_, q)| q)
    }

    /// Plans the way and moves.
    fn outcome(&self, seed: u64, scene: &mut Scene) -> Result<WayOutcome, TrialError> {
        let robot = &self.robot;
        let planner = WholeBody::new(robot, &scene.field, ARM);
        let begun = Instant::now();
        let way = planner.plan(&scene.from, &scene.to);
        let plan_ms = 1e3 * begun.elapsed().as_secs_f64();
        let move_along = |way: &BodyWay| -> Result<(u64, f64), TrialError> {
            let mut world =
                World::new(robot.description(), &self.with_box(seed), seed, &scene.from)?;
            let (boxes, mut least) = (world.boxes().to_vec(), f64::INFINITY);
            let mut motions = Motions::raised(robot, &mut world);
            motions.follow(way.seconds, |t| way.at(t));
            for step in 0..=200 {
                let (q, _) = way.at(f64::from(step) / 200.0 * way.seconds);
                for sphere in planner.placed(&q) {
                    let distances = boxes
                        .iter()
                        .map(|one| one.distance(&sphere.centre) - sphere.radius);
                    least = distances.fold(least, f64::min);
                }
            }
            Ok((world.contacts().ticks, 1e3 * least))
        };
        let straight = planner.straight(&scene.from, &scene.to);
        let (straight_contacts, _) = move_along(&straight)?;
        let (contacts, least_mm) = match &way {
            Ok(way) => move_along(way)?,
            Err(_) => (0, f64::NAN),
        };
        Ok(WayOutcome {
            seed,
            no_way: way.as_ref().err().map(ToString::to_string),
            seconds: way.map_or(0.0, |way| way.seconds),
            contacts,
            straight_touches: straight_contacts > 0,
            least_mm,
            fusion_ms: scene.fusion_ms,
            distances_ms: scene.distances_ms,
            plan_ms,
        })
    }

    /// Draws the straight and the planned way of the first scene as a stand-alone file; `None` if it has none.
    ///
    /// # Errors
    /// Same as [`WayTrials::run`].
    pub fn picture(&self) -> Result<Option<String>, TrialError> {
        let Some(scene) = self.scene(self.seed)? else {
            return Ok(None);
        };
        let planner = WholeBody::new(&self.robot, &scene.field, ARM);
        let Ok(way) = planner.plan(&scene.from, &scene.to) else {
            return Ok(None);
        };
        let boxes = scene.world.boxes();
        let (mut svg, mut size) = (String::new(), [0.0; 2]);
        let ways = [&planner.straight(&scene.from, &scene.to), &way];
        for (row, way) in ways.into_iter().enumerate() {
            let poses =
                (0..=8).map(|step| planner.placed(&way.at(f64::from(step) / 8.0 * way.seconds).0));
            // The whole robot at both ends, forearm and hand in between.
            let spheres = poses.enumerate().flat_map(|(step, placed)| {
                let shown = if step % 8 == 0 {
                    0..STILL_SPHERES + ARM_SPHERES
                } else {
                    STILL_SPHERES + 6..STILL_SPHERES + ARM_SPHERES
                };
                placed[shown].to_vec()
            });
            let section = Section {
                field: &scene.field,
                boxes,
                cut: boxes[1].middle.into(),
                spheres: spheres.collect(),
                ball: None,
            };
            let mut across = 0.0;
            for view in [&View::ABOVE, &View::FRONT] {
                let (width, height, panel) = section.draw(view);
                let _ = write!(
                    svg,
                    "<g transform=\"translate({across},{})\">{panel}</g>",
                    row as f64 * height
                );
                across += width;
                size = [across, (row + 1) as f64 * height];
            }
        }
        let title = "Straight way through the box (above) and planned way around it (below), seen from above and from the robot";
        Ok(Some(stand_alone(size[0], size[1], title, &svg)))
    }
}

/// Returns the grid of small cells around the places of the hand.
fn around(places: &[Vector3<f64>; 2]) -> VoxelGrid {
    let [sides, above] = AROUND;
    let corner = places[0].inf(&places[1]).add_scalar(-sides);
    let size = places[0].sup(&places[1]) + Vector3::new(sides, sides, above) - corner;
    VoxelGrid {
        corner: corner.into(),
        voxel: FINE,
        cells: std::array::from_fn(|i| (size[i] / FINE).ceil() as usize),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Scene 4: the straight way touches the box, the planned one does not. Costs two seconds.
    #[test]
    fn the_hand_goes_around_the_box_in_the_robots_own_map() {
        let trials = WayTrials {
            robot: Robot::nominal(),
            world: WorldConfig::default(),
            scenes: 1,
            seed: 4,
        };
        let report = trials.run(|| ()).unwrap();
        let [one] = &report.outcomes[..] else {
            panic!("one scene")
        };
        assert_eq!(
            (report.clear, one.contacts, one.straight_touches),
            (1, 0, true)
        );
        assert!(one.least_mm > 10.0, "{one:?}");
        let again = trials.scene(4).unwrap().unwrap();
        let planner = WholeBody::new(&trials.robot, &again.field, ARM);
        let way = planner.plan(&again.from, &again.to).unwrap();
        assert_eq!(way.seconds, one.seconds, "the same to the bit");
    }
}
