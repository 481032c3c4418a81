//! Ways of the whole body around obstacles (thesis, section 3.5 and figure 3.8): platform, torso and one arm move from
//! one pose to another.
//!
//! ```text
//! cost = steps  sum over steps  |(q_next - q) / speed|^2  +  weight / samples  sum over samples, spheres  max(0, soft + r - d(p))^2
//! ```
//!
//! Here `d` is the distance of the map at the centre `p` of a sphere of radius `r`, or of another sphere of the robot.
//! The Levenberg-Marquardt method finds the waypoints `q`; its normal equations are block tridiagonal. Descents from the
//! straight way and from detours of the hand run side by side. The cheapest way whose fine check is clear is taken.

use nalgebra::{Cholesky, Isometry3, Matrix3, Point3, SMatrix, SVector, Vector3};
use tactnet_catching_packets::{ARM_JOINTS, ARMS, JOINTS, joint};

use crate::map::{ARM_SPHERES, ArmSpheres, DistanceField, Sphere, StillSpheres};
use crate::robot::{Chain, Robot};
use crate::safety::Bodies;

/// Number of steps between waypoints.
const STEPS: usize = 24;
/// Number of poses at which a way is checked.
const CHECKS: usize = 600;
/// Number of free joints: platform, torso, arm.
const FREE: usize = joint::TORSO.end + ARM_JOINTS;
/// Detours of the hand half way, in m.
const DETOURS: [[f64; 3]; 6] = [
    [0.0; 3],
    [0.0, 0.0, 0.35],
    [0.0, 0.0, 0.6],
    [-0.25, 0.0, 0.0],
    [-0.2, 0.0, 0.3],
    [-0.35, 0.0, 0.15],
];
/// Forearm, hand and head-side spheres that are compared with the rest of the robot.
const OUTER: std::ops::Range<usize> = 6..ARM_SPHERES;
/// Spheres of the torso below the chest among the fixed ones.
const BELOW: std::ops::Range<usize> = 5..10;

type Block = SMatrix<f64, FREE, FREE>;
type Column = SVector<f64, FREE>;
type Pose = [f64; JOINTS];

/// Distance from obstacles below which a way has a cost, in m.
const SOFT: f64 = 0.06;
/// Minimum distance from obstacles, in m. It covers the errors of the map and of the motion.
const HARD: f64 = 0.03;
/// Minimum distance between the robot's own bodies, in m.
const OWN: f64 = 0.02;
/// Weight of the squared hinge, in 1/m^2.
const WEIGHT: f64 = 4000.0;
/// Maximum number of iterations of each descent.
const ITERATIONS: usize = 50;
/// Share of the joints' speeds and accelerations that a motion uses.
const PACE: f64 = 0.4;

/// Reason why no way is clear.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("no clear way: at {:.0} % of the best one, the robot is {:.0} mm from {from}", 100.0 * .share, 1e3 * .distance)]
pub struct NoWay {
    /// Share of the way.
    pub share: f64,
    /// Distance in m, negative inside.
    pub distance: f64,
    /// Name of the nearest body: an obstacle or the robot itself.
    pub from: &'static str,
}

/// Motion of all joints along a smooth curve through waypoints, from rest to rest.
#[derive(Debug, Clone, PartialEq)]
pub struct BodyWay {
    points: Vec<Pose>,
    /// Duration, in s.
    pub seconds: f64,
}

impl BodyWay {
    /// Returns joint positions and speeds at a time, in s.
    pub fn at(&self, t: f64) -> (Pose, Pose) {
        let [share, rate, _] = eased((t / self.seconds).clamp(0.0, 1.0));
        let [q, slope, _] = self.along(share);
        (q, slope.map(|by_share| by_share * rate / self.seconds))
    }

    /// Returns joint positions at a share of the curve, with first and second derivative.
    fn along(&self, share: f64) -> [Pose; 3] {
        let steps = self.points.len() - 1;
        let at = share * steps as f64;
        let first = (at as usize).min(steps - 1);
        let x = at - first as f64;
        let mut found = [[0.0; JOINTS]; 3];
        for i in 0..JOINTS {
            let p = |k: usize| self.points[k.min(steps)][i];
            let slope = |k: usize| 0.5 * (p(k + 1) - p(k.saturating_sub(1)));
            let (a, b, from, to) = (p(first), p(first + 1), slope(first), slope(first + 1));
            let (cubic, square) = (2.0 * (a - b) + from + to, 3.0 * (b - a) - 2.0 * from - to);
            let scale = steps as f64;
            found[0][i] = a + x * (from + x * (square + x * cubic));
            found[1][i] = (from + x * (2.0 * square + x * 3.0 * cubic)) * scale;
            found[2][i] = (2.0 * square + x * 6.0 * cubic) * scale * scale;
        }
        found
    }
}

/// Returns a share of a way at a share of its time, from rest to rest, with first and second derivative.
fn eased(x: f64) -> [f64; 3] {
    let left = 1.0 - x;
    [
        x * x * x * (10.0 + x * (6.0 * x - 15.0)),
        30.0 * x * x * left * left,
        60.0 * x * left * (1.0 - 2.0 * x),
    ]
}

/// Cost of a way with its normal equations, by waypoint.
struct Normal {
    cost: f64,
    diagonal: Vec<Block>,
    /// Blocks between a waypoint and the next one.
    above: Vec<Block>,
    slope: Vec<Column>,
}

/// Planner of ways of the whole body.
pub struct WholeBody<'a> {
    robot: &'a Robot,
    field: &'a DistanceField,
    arm: usize,
    bodies: Bodies,
    spheres: [ArmSpheres; ARMS],
    still: StillSpheres,
    /// Indices of the free joints.
    free: [usize; FREE],
}

impl<'a> WholeBody<'a> {
    /// Creates a planner.
    ///
    /// - `field`: map in the inertial frame, positions of the platform included
    /// - `arm`: moving arm, 0 left, 1 right; the other one keeps its joint angles
    pub fn new(robot: &'a Robot, field: &'a DistanceField, arm: usize) -> Self {
        let own = joint::ARM[arm].start;
        Self {
            robot,
            field,
            arm,
            bodies: Bodies::new(robot.description()),
            spheres: [0, 1].map(|arm| ArmSpheres::new(robot, arm)),
            still: StillSpheres::new(robot),
            free: std::array::from_fn(|i| match i.checked_sub(joint::TORSO.end) {
                Some(of_arm) => own + of_arm,
                None => i,
            }),
        }
    }

    /// Plans a way between two poses. Equal arguments give equal bits.
    ///
    /// # Errors
    /// No way is clear; the reason is that of the cheapest one.
    pub fn plan(&self, from: &Pose, to: &Pose) -> Result<BodyWay, NoWay> {
        let mut ways: Vec<(f64, BodyWay)> = std::thread::scope(|scope| {
            let descents =
                DETOURS.map(|detour| scope.spawn(move || self.descend(from, to, detour)));
            let joined = descents
                .into_iter()
                .map(std::thread::ScopedJoinHandle::join);
            joined
                .map(|way| way.unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
                .collect()
        });
        ways.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut reason = None;
        for (_, way) in ways {
            match self.check(&way) {
                Ok(()) => return Ok(way),
                Err(no_way) => reason = reason.or(Some(no_way)),
            }
        }
        Err(reason.expect("there are descents"))
    }

    /// Returns the straight motion between two poses, clear or not.
    pub fn straight(&self, from: &Pose, to: &Pose) -> BodyWay {
        let part = |share: f64| std::array::from_fn(|i| from[i] + share * (to[i] - from[i]));
        self.timed((0..=STEPS).map(|k| part(k as f64 / STEPS as f64)).collect())
    }

    /// Returns the minimum distance of all spheres from obstacles, in m.
    pub fn clearance(&self, q: &Pose) -> f64 {
        let spheres = self.placed(q).into_iter();
        let distances = spheres.map(|one| self.field.distance(&one.centre) - one.radius);
        distances.fold(f64::INFINITY, f64::min)
    }

    /// Returns the spheres of the whole robot in the inertial frame.
    pub fn placed(&self, q: &Pose) -> Vec<Sphere> {
        let chest = self.robot.chest(q);
        let in_chest = |sphere: Sphere| Sphere {
            centre: (chest * Point3::from(sphere.centre)).coords,
            ..sphere
        };
        let mut spheres: Vec<Sphere> = self.still.spheres.iter().copied().map(in_chest).collect();
        // The torso follows its two links instead of the upright line below the chest.
        let [pivot, knee, top] = self.torso(q, &chest);
        for (number, sphere) in spheres[BELOW].iter_mut().enumerate() {
            let down = 2.0 * (number + 1) as f64 / BELOW.len() as f64;
            sphere.centre = match down {
                upper if upper <= 1.0 => top.lerp(&knee, upper),
                lower => knee.lerp(&pivot, lower - 1.0),
            };
        }
        for arm in 0..ARMS {
            let of_arm = self.spheres[arm].placed(self.robot, arm, &joint::of_arm(q, arm));
            spheres.extend(of_arm.map(in_chest));
        }
        spheres
    }

    /// Returns lower and upper pitch axis of the torso and the chest, in m.
    fn torso(&self, q: &Pose, chest: &Isometry3<f64>) -> [Vector3<f64>; 3] {
        let torso = &self.robot.description().torso;
        let pivot = Vector3::new(0.0, q[joint::PLATFORM], torso.lower_pitch_height);
        let lean = q[joint::TORSO.start + 1];
        let along = Vector3::new(lean.sin(), 0.0, lean.cos()) * torso.lower_length;
        [
            pivot,
            pivot + chest.rotation * along,
            chest.translation.vector,
        ]
    }

    /// Returns the derivatives of `p . g` for a point `p` of an arm's sphere or of the chest (`of_arm` empty).
    ///
    /// - `of_arm`: derivatives by the arm's joints
    fn by_joints(
        &self,
        torso: &[Vector3<f64>; 3],
        yaw: &Matrix3<f64>,
        p: &Vector3<f64>,
        g: &Vector3<f64>,
        of_arm: Option<[f64; ARM_JOINTS]>,
    ) -> Column {
        let [pivot, knee, top] = torso;
        let mut by = Column::zeros();
        by[0] = g.y;
        by[1] = Vector3::z().cross(&(p - pivot)).dot(g);
        // A passive joint keeps the chest upright.
        by[2] = yaw.column(1).cross(&(top - pivot)).dot(g);
        by[3] = yaw.column(1).cross(&(top - knee)).dot(g);
        for (to, from) in by
            .iter_mut()
            .skip(joint::TORSO.end)
            .zip(of_arm.into_iter().flatten())
        {
            *to = from;
        }
        by
    }

    /// Calls `tell` with the lack of distance of each sphere, in m, and its derivatives by the free joints.
    fn each_near(&self, q: &Pose, tell: &mut impl FnMut(f64, &Column)) {
        let chest = self.robot.chest(q);
        let yaw = chest.rotation.to_rotation_matrix().into_inner();
        let torso = self.torso(q, &chest);
        let chains: [Chain; ARMS] =
            std::array::from_fn(|arm| self.robot.arm(arm).chain(&joint::of_arm(q, arm)));
        let against_map = |centre: &Vector3<f64>, radius: f64| {
            let p = (chest * Point3::from(*centre)).coords;
            let (distance, slope) = self.field.gradient(&p);
            (SOFT + radius - distance, p, slope)
        };
        let fixed = self
            .still
            .spheres
            .iter()
            .enumerate()
            .filter(|(number, _)| !BELOW.contains(number));
        let fixed: Vec<Sphere> = fixed.map(|(_, sphere)| *sphere).collect();
        for sphere in &fixed {
            let (lack, p, slope) = against_map(&sphere.centre, sphere.radius);
            if lack > 0.0 {
                tell(lack, &-self.by_joints(&torso, &yaw, &p, &slope, None));
            }
        }
        for arm in 0..ARMS {
            for sphere in 0..ARM_SPHERES {
                let spheres = &self.spheres[arm];
                let centre = spheres.centre(sphere, &chains[arm]);
                let (lack, p, slope) = against_map(&centre, spheres.radius(sphere));
                if lack > 0.0 {
                    let moves = |g: &Vector3<f64>| spheres.slopes(sphere, &chains[arm], &centre, g);
                    let of_arm = (arm == self.arm).then(|| moves(&(yaw.transpose() * slope)));
                    tell(lack, &-self.by_joints(&torso, &yaw, &p, &slope, of_arm));
                }
            }
        }
        // Forearm and hand keep away from trunk, head and the other arm.
        let (own, other) = (&self.spheres[self.arm], (self.arm + 1) % ARMS);
        let others = (0..ARM_SPHERES).map(|i| {
            (
                self.spheres[other].centre(i, &chains[other]),
                self.spheres[other].radius(i),
            )
        });
        let all: Vec<_> = fixed[..BELOW.start]
            .iter()
            .map(|sphere| (sphere.centre, sphere.radius))
            .chain(others)
            .collect();
        for sphere in OUTER {
            let centre = own.centre(sphere, &chains[self.arm]);
            for (against, radius) in &all {
                let apart = centre - against;
                let lack = own.radius(sphere) + radius - apart.norm();
                if lack > 0.0 {
                    let slopes = own.slopes(sphere, &chains[self.arm], &centre, &apart.normalize());
                    let mut by = Column::zeros();
                    by.fixed_rows_mut::<ARM_JOINTS>(joint::TORSO.end)
                        .copy_from(&-SVector::from(slopes));
                    tell(lack, &by);
                }
            }
        }
    }

    /// Returns the cost of a way and its normal equations.
    fn normal(&self, points: &[Pose]) -> Normal {
        let mut normal = Normal {
            cost: 0.0,
            diagonal: vec![Block::zeros(); STEPS + 1],
            above: vec![Block::zeros(); STEPS],
            slope: vec![Column::zeros(); STEPS + 1],
        };
        let weight = 0.5 * WEIGHT / STEPS as f64;
        for k in 0..STEPS {
            let (from, to) = (&points[k], &points[k + 1]);
            for (i, joint) in self.free.iter().enumerate() {
                let weight = STEPS as f64 / self.robot.joints()[*joint].speed.powi(2);
                let step = to[*joint] - from[*joint];
                normal.cost += weight * step * step;
                normal.slope[k][i] -= weight * step;
                normal.slope[k + 1][i] += weight * step;
                normal.diagonal[k][(i, i)] += weight;
                normal.diagonal[k + 1][(i, i)] += weight;
                normal.above[k][(i, i)] -= weight;
            }
            self.each_near(to, &mut |lack, by| {
                normal.cost += weight * lack * lack;
                normal.slope[k + 1] += by * (weight * lack);
                normal.diagonal[k + 1].ger(weight, by, by, 1.0);
            });
            let between = std::array::from_fn(|i| 0.5 * (from[i] + to[i]));
            self.each_near(&between, &mut |lack, by| {
                normal.cost += weight * lack * lack;
                for number in [k, k + 1] {
                    normal.slope[number] += by * (0.5 * weight * lack);
                    normal.diagonal[number].ger(0.25 * weight, by, by, 1.0);
                }
                normal.above[k].ger(0.25 * weight, by, by, 1.0);
            });
        }
        normal
    }

    /// Descends from the straight way with a detour of the hand. Returns the cost and the way.
    fn descend(&self, from: &Pose, to: &Pose, detour: [f64; 3]) -> (f64, BodyWay) {
        let middle: Pose = std::array::from_fn(|i| 0.5 * (from[i] + to[i]));
        let via = self.with_hand_moved(&middle, Vector3::from(detour));
        let mut points: Vec<Pose> = (0..=STEPS)
            .map(|k| {
                let share = 2.0 * k as f64 / STEPS as f64;
                let (a, b, part) = if share < 1.0 {
                    (from, &via, share)
                } else {
                    (&via, to, share - 1.0)
                };
                std::array::from_fn(|i| a[i] + part * (b[i] - a[i]))
            })
            .collect();
        let (mut normal, mut damping) = (self.normal(&points), 1e-2);
        for _ in 0..ITERATIONS {
            let Some(change) = solve(&normal, damping) else {
                break;
            };
            let mut moved = points.clone();
            for (point, change) in moved[1..STEPS].iter_mut().zip(&change) {
                self.change(point, change);
            }
            let next = self.normal(&moved);
            let gain = normal.cost - next.cost;
            damping *= if gain > 0.0 { 0.3 } else { 5.0 };
            if gain > 0.0 {
                (points, normal) = (moved, next);
            }
            if damping > 1e6 || (0.0..1e-5 * normal.cost).contains(&gain) {
                break;
            }
        }
        (normal.cost, self.timed(points))
    }

    /// Adds a change of the free joints, within their ranges.
    fn change(&self, q: &mut Pose, change: &Column) {
        for (joint, change) in self.free.iter().zip(change.iter()) {
            let [low, high] = self.robot.joints()[*joint].range;
            q[*joint] = (q[*joint] + change).clamp(low, high);
        }
    }

    /// Returns a pose whose hand is moved, as far as the joints allow.
    fn with_hand_moved(&self, q: &Pose, by: Vector3<f64>) -> Pose {
        let (mut q, spheres, hand) = (*q, &self.spheres[self.arm], OUTER.start + 8);
        let mut target = None;
        for _ in 0..12 {
            let chest = self.robot.chest(&q);
            let yaw = chest.rotation.to_rotation_matrix().into_inner();
            let chain = self.robot.arm(self.arm).chain(&joint::of_arm(&q, self.arm));
            let centre = spheres.centre(hand, &chain);
            let p = (chest * Point3::from(centre)).coords;
            let torso = self.torso(&q, &chest);
            let lack = *target.get_or_insert(p + by) - p;
            let rows = [0, 1, 2].map(|axis| {
                let g = Vector3::ith(axis, 1.0);
                let of_arm = spheres.slopes(hand, &chain, &centre, &(yaw.transpose() * g));
                self.by_joints(&torso, &yaw, &p, &g, Some(of_arm))
                    .transpose()
            });
            let rows = SMatrix::<f64, 3, FREE>::from_rows(&rows);
            let square = rows * rows.transpose() + Matrix3::identity() * 0.01;
            let Some(pull) = square.try_inverse() else {
                break;
            };
            self.change(&mut q, &(rows.transpose() * pull * lack));
        }
        q
    }

    /// Returns the motion through waypoints within the share of speeds and accelerations.
    fn timed(&self, points: Vec<Pose>) -> BodyWay {
        let mut way = BodyWay {
            points,
            seconds: 0.1,
        };
        for check in 0..=CHECKS {
            let [share, rate, bend] = eased(check as f64 / CHECKS as f64);
            let [_, slope, curve] = way.along(share);
            for (i, joint) in self.robot.joints().iter().enumerate() {
                let speed = (slope[i] * rate).abs() / (PACE * joint.speed);
                let acceleration = (curve[i] * rate * rate + slope[i] * bend).abs();
                let by_acceleration = (acceleration / (PACE * joint.acceleration)).sqrt();
                way.seconds = way.seconds.max(speed).max(by_acceleration);
            }
        }
        way
    }

    /// Checks the distances along a way.
    fn check(&self, way: &BodyWay) -> Result<(), NoWay> {
        for check in 0..=CHECKS {
            let share = check as f64 / CHECKS as f64;
            let [q, ..] = way.along(share);
            let (map, own) = (self.clearance(&q), self.bodies.least(&q));
            for (distance, least, from) in [(map, HARD, "an obstacle"), (own, OWN, "itself")] {
                if distance < least {
                    return Err(NoWay {
                        share,
                        distance,
                        from,
                    });
                }
            }
        }
        Ok(())
    }
}

/// Returns the changes of the inner waypoints, or `None` if the equations are singular.
fn solve(normal: &Normal, damping: f64) -> Option<Vec<Column>> {
    let mut rows: Vec<(Cholesky<f64, nalgebra::Const<FREE>>, Column)> = Vec::with_capacity(STEPS);
    for k in 1..STEPS {
        let mut block =
            normal.diagonal[k] + Block::from_diagonal(&(normal.diagonal[k].diagonal() * damping));
        let mut right = -normal.slope[k];
        if let Some((before, its_right)) = rows.last() {
            let coupling = &normal.above[k - 1];
            block -= coupling.transpose() * before.solve(coupling);
            right -= coupling.transpose() * before.solve(its_right);
        }
        rows.push((Cholesky::new(block)?, right));
    }
    let mut changes = vec![Column::zeros(); STEPS - 1];
    for k in (1..STEPS).rev() {
        let (block, mut right) = (&rows[k - 1].0, rows[k - 1].1);
        if k + 1 < STEPS {
            right -= normal.above[k] * changes[k];
        }
        changes[k - 1] = block.solve(&right);
    }
    Some(changes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::VoxelGrid;

    /// Returns the field of a box, 4 cm cells.
    fn with_box(middle: [f64; 3], half: [f64; 3]) -> DistanceField {
        let grid = VoxelGrid {
            voxel: 0.04,
            cells: [64; 3],
            ..VoxelGrid::default()
        };
        let solid = |n: usize| {
            let p = grid.middle([n % 64, n / 64 % 64, n / 4096]);
            (0..3).all(|i| (p[i] - middle[i]).abs() < half[i])
        };
        DistanceField::new(grid, &(0..grid.count()).map(solid).collect::<Vec<_>>())
    }

    /// Returns two poses with the torso turned to the left and to the right, the left hand in front, the right arm raised.
    fn ends(robot: &Robot) -> [Pose; 2] {
        [0.5, -1.2].map(|yaw| {
            let mut q = robot.waiting();
            q[joint::ARM[1].clone()].copy_from_slice(&robot.raised(1));
            q[joint::TORSO.start] = yaw;
            q
        })
    }

    #[test]
    fn a_hand_goes_around_a_box_that_its_straight_way_touches() {
        let robot = Robot::nominal();
        let [from, to] = ends(&robot);
        let field = with_box([0.7, 0.42, 0.9], [0.08, 0.08, 0.3]);
        let planner = WholeBody::new(&robot, &field, 0);
        let straight = planner.straight(&from, &to);
        assert!(planner.check(&straight).is_err());
        let way = planner.plan(&from, &to).unwrap();
        assert_eq!(
            planner.plan(&from, &to).unwrap(),
            way,
            "the same to the bit"
        );
        assert_eq!(way.at(0.0), (from, [0.0; JOINTS]));
        // Positions are integrals of speeds, within the limits.
        let (dt, mut q) = (way.seconds / 4000.0, from);
        for step in 0..4000 {
            let (_, speeds) = way.at((f64::from(step) + 0.5) * dt);
            for i in 0..JOINTS {
                q[i] += speeds[i] * dt;
                assert!(speeds[i].abs() <= 0.41 * robot.joints()[i].speed);
            }
        }
        assert!(
            (0..JOINTS).all(|i| (q[i] - to[i]).abs() < 1e-4),
            "{q:?} {to:?}"
        );
        // A box that reaches to the ceiling and to the robot leaves no way.
        let wall = with_box([0.9, 0.4, 1.3], [0.75, 0.1, 1.3]);
        let planner = WholeBody::new(&robot, &wall, 0);
        let none = planner.plan(&from, &to).unwrap_err().to_string();
        assert!(none.contains("no clear way"), "{none}");
    }

    #[test]
    fn slopes_of_the_cost_are_differences() {
        let robot = Robot::nominal();
        let [from, to] = ends(&robot);
        let field = with_box([0.7, 0.42, 0.9], [0.08, 0.08, 0.3]);
        let planner = WholeBody::new(&robot, &field, 0);
        let points = planner.straight(&from, &to).points;
        let normal = planner.normal(&points);
        assert!(normal.cost > 1.0);
        for k in [5, 12, 18] {
            for (i, joint) in planner.free.iter().enumerate() {
                let cost = |h: f64| {
                    let mut points = points.clone();
                    points[k][*joint] += h;
                    planner.normal(&points).cost
                };
                // The residuals count half.
                let slope = (cost(1e-6) - cost(-1e-6)) / 4e-6;
                let found = normal.slope[k][i];
                assert!(
                    (slope - found).abs() < 1e-3 * (1.0 + slope.abs()),
                    "{k} {i}: {slope} {found}"
                );
            }
        }
    }
}
