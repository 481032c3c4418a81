//! Free space of the whole robot in a map. Platform and torso move only as far as it allows, with the arms in their
//! waiting pose. Arms move straight between two poses only if the way is clear.

use std::sync::Arc;

use nalgebra::{Isometry3, Point3};
use tactnet_catching_packets::{ARM_JOINTS, ARMS, JOINTS, joint};

use super::body::BodyMotion;
use crate::map::{ArmSpheres, DistanceField, StillSpheres};
use crate::plan::{ChestWay, TOO_NEAR_ALREADY};
use crate::ramp::Ramp;
use crate::robot::Robot;

const CHECKS: usize = 40;
/// Fractions of a motion that are tried, in this order.
const SHARES: [f64; 4] = [1.0, 0.75, 0.5, 0.25];

/// Obstacles and the required distance to them.
#[derive(Debug, Clone)]
pub struct Room {
    field: Arc<DistanceField>,
    /// Minimum distance, in m.
    apart: f64,
    still: StillSpheres,
    arms: [ArmSpheres; ARMS],
}

impl Room {
    /// Creates the free space of a robot.
    ///
    /// - `apart`: minimum distance of the robot from obstacles, in m, unless it is closer already
    pub fn new(robot: &Robot, field: Arc<DistanceField>, apart: f64) -> Self {
        Self {
            field,
            apart,
            still: StillSpheres::new(robot),
            arms: std::array::from_fn(|arm| ArmSpheres::new(robot, arm)),
        }
    }

    /// Returns the longest part of a motion of platform and torso that keeps the distance, or a body at rest if none
    /// does.
    pub fn within(
        &self,
        robot: &Robot,
        joints: &[f64; JOINTS],
        deviation: &Isometry3<f64>,
        wanted: &BodyMotion,
    ) -> BodyMotion {
        let chains: [_; ARMS] =
            std::array::from_fn(|arm| robot.arm(arm).chain(&joint::of_arm(joints, arm)));
        let distance = |chest: &Isometry3<f64>| {
            let still = self.still.spheres.iter().map(|sphere| {
                let centre = chest * Point3::from(sphere.centre);
                self.field.distance(&centre.coords) - sphere.radius
            });
            let arms =
                (0..ARMS).map(|arm| self.arms[arm].distance(&chains[arm], chest, &self.field));
            still.chain(arms).fold(f64::INFINITY, f64::min)
        };
        let is_clear = |motion: &BodyMotion| {
            let end = motion.platform.end.max(motion.turn.end);
            let way = motion.chest_way(robot, joints, deviation, motion.start_ns);
            self.keeps_away(|share| distance(&way.at(share * end)))
        };
        SHARES
            .iter()
            .map(|share| match *share {
                1.0 => *wanted,
                share => wanted.shortened(robot, share),
            })
            .find(is_clear)
            .unwrap_or_else(|| wanted.shortened(robot, 0.0))
    }

    /// Returns true if an arm keeps the distance while it moves along `ramps` with the chest at rest.
    pub fn is_clear(
        &self,
        robot: &Robot,
        arm: usize,
        ramps: &[Ramp; ARM_JOINTS],
        chest: &Isometry3<f64>,
    ) -> bool {
        let end = ramps.iter().map(|ramp| ramp.end).fold(0.0, f64::max);
        let way = ChestWay::standing(*chest);
        self.keeps_away(|share| {
            let q = ramps.map(|ramp| ramp.at(share * end).0);
            let chain = robot.arm(arm).chain(&q);
            self.arms[arm].distance(&chain, &way.at(0.0), &self.field)
        })
    }

    fn keeps_away(&self, distance: impl Fn(f64) -> f64) -> bool {
        let bound = self.apart.min(distance(0.0) - TOO_NEAR_ALREADY);
        (1..=CHECKS).all(|i| distance(i as f64 / CHECKS as f64) >= bound)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::VoxelGrid;

    fn grid() -> VoxelGrid {
        VoxelGrid {
            voxel: 0.04,
            cells: [64; 3],
            ..VoxelGrid::default()
        }
    }

    /// Returns the field of a solid wall to the left of `y`.
    fn wall(y: f64) -> Arc<DistanceField> {
        let grid = grid();
        let solid: Vec<bool> = (0..grid.count())
            .map(|n| grid.middle([n % 64, n / 64 % 64, n / 4096]).y > y)
            .collect();
        Arc::new(DistanceField::new(grid, &solid))
    }

    #[test]
    fn the_platform_rolls_no_farther_than_there_is_room() {
        let robot = Robot::nominal();
        let joints = robot.waiting();
        let wanted = BodyMotion {
            start_ns: 5,
            platform: Ramp::between(0.0, 0.0, 0.3, 0.6, 1.4),
            turn: Ramp::standing(0.0),
        };
        let rolls = |y: f64| {
            let room = Room::new(&robot, wall(y), 0.05);
            let motion = room.within(&robot, &joints, &Isometry3::identity(), &wanted);
            assert_eq!(motion.start_ns, 5);
            motion.platform.at(motion.platform.end).0
        };
        // The elbow is the outermost part.
        let outermost = (0..ARMS)
            .flat_map(|arm| ArmSpheres::new(&robot, arm).placed(&robot, arm, &robot.ready(arm)))
            .map(|sphere| sphere.centre.y + sphere.radius)
            .fold(f64::NEG_INFINITY, f64::max);
        assert!((rolls(outermost + 0.3 + 0.12) - 0.3).abs() < 1e-12);
        let some = rolls(outermost + 0.15 + 0.12);
        assert!(some > 0.05 && some < 0.2, "{some}");
        assert_eq!(rolls(outermost + 0.06), 0.0);
    }

    #[test]
    fn an_arm_is_lowered_only_where_nothing_is_in_its_way() {
        let robot = Robot::nominal();
        let (up, down) = (robot.raised(0), robot.ready(0));
        let joints = robot.arm(0).joints();
        let ramps =
            std::array::from_fn(|i| Ramp::between(up[i], 0.0, down[i], 2.0, joints[i].speed));
        let chest = robot.chest(&robot.waiting());
        let hand = chest * Point3::from(robot.arm(0).forward(&down).position);
        let clear = |y: f64| Room::new(&robot, wall(y), 0.05).is_clear(&robot, 0, &ramps, &chest);
        assert!(clear(hand.y + 1.0));
        // The raised arm is free, and one solid cell is at the lowered hand.
        let grid = grid();
        let mut solid = vec![false; grid.count()];
        solid[grid.number(grid.cell_at(&hand.coords).unwrap())] = true;
        let room = Room::new(&robot, Arc::new(DistanceField::new(grid, &solid)), 0.05);
        assert!(!room.is_clear(&robot, 0, &ramps, &chest));
    }
}
