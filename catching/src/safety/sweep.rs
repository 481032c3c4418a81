//! Space covered by bodies while joints move through intervals.

use nalgebra::{Isometry3, Point3, Rotation3, Translation3, Unit, UnitQuaternion, Vector3};
use tactnet_catching_packets::packets::JointCommand;
use tactnet_catching_packets::{JOINTS, Joint};

use super::gjk::core_bounds;
use super::hull::{Hull, MAX_POINTS};

/// Path length below which a swept point becomes a sphere, in m.
const MAX_SPHERE_PATH: f64 = 0.004;
/// Maximum half angle of an arc segment, in rad.
const MAX_HALF_ANGLE: f64 = 0.4;
/// Number of points that remain after thinning.
const THINNED_POINTS: usize = 20;
/// Golden ratio, for evenly distributed directions.
const GOLDEN: f64 = 1.618_033_988_749_895;

/// Interval of a joint position, in rad or m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval {
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Interval {
    /// Returns the centre.
    pub fn middle(&self) -> f64 {
        0.5 * (self.low + self.high)
    }

    /// Returns half of the length.
    pub fn half(&self) -> f64 {
        0.5 * (self.high - self.low)
    }

    /// Returns the maximum distance by which `other` exceeds this interval.
    pub fn beyond(&self, other: &Self) -> f64 {
        (self.low - other.low).max(other.high - self.high).max(0.0)
    }
}

/// Returns the interval of a joint until it rests: it continues for `reaction` seconds, then brakes with maximum
/// deceleration.
///
/// - `q`, `dq`: current position and velocity
/// - `joint`: provides the deceleration; its range is ignored
pub fn braking(q: f64, dq: f64, joint: &Joint, reaction: f64) -> Interval {
    let end = q + dq * reaction + dq * dq.abs() / (2.0 * joint.acceleration);
    Interval {
        low: q.min(end),
        high: q.max(end),
    }
}

/// Braking motion of all joints after a command. During part of the reaction time they continue, then all drives start
/// to brake at the same moment. Two values describe the state: the time until the drives brake and the time since.
#[derive(Debug, Clone)]
pub(super) struct Braking {
    q: [f64; JOINTS],
    dq: [f64; JOINTS],
    deceleration: [f64; JOINTS],
    /// Maximum time until the drives brake, in s.
    pub reaction: f64,
}

impl Braking {
    pub fn new(command: &JointCommand, joints: &[Joint; JOINTS], reaction: f64) -> Self {
        Self {
            q: command.q,
            dq: command.dq,
            deceleration: std::array::from_fn(|i| joints[i].acceleration),
            reaction,
        }
    }

    /// Returns the braking time of the slowest joint, in s.
    pub fn longest(&self) -> f64 {
        (0..JOINTS)
            .map(|i| self.dq[i].abs() / self.deceleration[i])
            .fold(0.0, f64::max)
    }

    /// Returns the joint positions.
    ///
    /// - `begun`: time from the command until the drives brake or until now, in s
    /// - `braked`: braking time since, in s
    pub fn at(&self, begun: f64, braked: f64) -> [f64; JOINTS] {
        std::array::from_fn(|i| self.joint(i, begun, braked))
    }

    /// Returns the joint intervals of a part of the motion. Each joint moves in one direction only.
    pub fn between(&self, begun: [f64; 2], braked: [f64; 2]) -> [Interval; JOINTS] {
        std::array::from_fn(|i| {
            let first = self.joint(i, begun[0], braked[0]);
            let last = self.joint(i, begun[1], braked[1]);
            Interval {
                low: first.min(last),
                high: first.max(last),
            }
        })
    }

    fn joint(&self, i: usize, begun: f64, braked: f64) -> f64 {
        let (dq, deceleration) = (self.dq[i], self.deceleration[i]);
        let slowing = braked.min(dq.abs() / deceleration);
        self.q[i] + dq * (begun + slowing) - 0.5 * dq.signum() * deceleration * slowing * slowing
    }
}

/// Element of a chain from the reference frame to the body's frame.
#[derive(Debug, Clone, Copy)]
pub(super) enum Step {
    Fixed(Isometry3<f64>),
    /// Rotation about an axis through the origin by `sign` times a joint's position.
    Turn {
        joint: usize,
        axis: Unit<Vector3<f64>>,
        sign: f64,
    },
}

/// Returns a hull in the first frame of a chain that contains a body for all joint positions within the intervals.
pub(super) fn swept(body: &Hull, chain: &[Step], intervals: &[Interval]) -> Hull {
    let mut hull = *body;
    for step in chain.iter().rev() {
        match step {
            Step::Fixed(to) => hull = hull.moved(to),
            Step::Turn { joint, axis, sign } => {
                let interval = intervals[*joint];
                turn(&mut hull, axis, sign * interval.middle(), interval.half());
            }
        }
    }
    hull
}

/// Rotates a hull by `middle` plus and minus `half`.
fn turn(hull: &mut Hull, axis: &Unit<Vector3<f64>>, middle: f64, half: f64) {
    let to_middle = Rotation3::from_axis_angle(axis, middle);
    let radii = hull.points().iter().map(|point| point.cross(axis).norm());
    let way = radii.fold(0.0, f64::max) * half;
    if way <= MAX_SPHERE_PATH {
        let turn = Isometry3::from_parts(Translation3::identity(), to_middle.into());
        *hull = hull.moved(&turn);
        hull.radius += way;
        return;
    }
    let pieces = (half / MAX_HALF_ANGLE).ceil().max(1.0) as usize;
    let delta = half / pieces as f64;
    // End points of all segments, and for each segment a point outside of its middle where the tangents at its ends
    // intersect.
    let room = MAX_POINTS / (2 * pieces + 1);
    if hull.points().len() > room {
        thin_out(hull, room.min(THINNED_POINTS));
    }
    let points = *hull;
    hull.clear();
    for point in points.points() {
        let along = axis.scale(point.dot(axis));
        for end in 0..=2 * pieces {
            let angle = middle - half + delta * end as f64;
            let outside = if end % 2 == 1 { 1.0 / delta.cos() } else { 1.0 };
            let turned = Rotation3::from_axis_angle(axis, angle) * (point - along);
            hull.push(along + turned * outside);
        }
    }
    if hull.points().len() > THINNED_POINTS {
        thin_out(hull, THINNED_POINTS);
    }
}

/// Keeps the farthest points in all directions and increases the radius by the maximum distance of the others.
fn thin_out(hull: &mut Hull, count: usize) {
    let all = *hull;
    let mut kept = [false; MAX_POINTS];
    for i in 0..count {
        // Fibonacci sphere.
        let z = 1.0 - (2.0 * i as f64 + 1.0) / count as f64;
        let across = (1.0 - z * z).sqrt();
        let (sin, cos) = (std::f64::consts::TAU * i as f64 / GOLDEN).sin_cos();
        let direction = Vector3::new(across * cos, across * sin, z);
        let farthest = (0..all.points().len())
            .max_by(|a, b| {
                let along = |i: &usize| all.points()[*i].dot(&direction);
                along(a).total_cmp(&along(b))
            })
            .unwrap_or(0);
        kept[farthest] = true;
    }
    hull.clear();
    for (point, kept) in all.points().iter().zip(kept) {
        if kept {
            hull.push(*point);
        }
    }
    let mut out = 0.0_f64;
    for (point, kept) in all.points().iter().zip(kept) {
        if !kept {
            let [_, outside] = core_bounds(hull, &Hull::new(&[*point], 0.0));
            out = out.max(outside);
        }
    }
    hull.radius = all.radius + out;
}

/// Returns a body in the first frame of a chain at joint positions `q`.
pub(super) fn placed(body: &Hull, chain: &[Step], q: &[f64]) -> Hull {
    let mut place = Isometry3::identity();
    for step in chain {
        match step {
            Step::Fixed(to) => place *= to,
            Step::Turn { joint, axis, sign } => {
                place *= UnitQuaternion::from_axis_angle(axis, sign * q[*joint]);
            }
        }
    }
    body.moved(&place)
}

/// Returns, for each joint, the maximum distance of a body's points from its axis, in m; 0 for joints that are not in the
/// chain. This bounds the motion per radian.
pub(super) fn reaches(body: &Hull, chain: &[Step]) -> [f64; JOINTS] {
    let mut reaches = [0.0; JOINTS];
    let radii = body.points().iter().map(|point| point.norm());
    let mut farthest = radii.fold(0.0, f64::max);
    for step in chain.iter().rev() {
        match step {
            // The distance from the next origin is larger by at most the distance between both.
            Step::Fixed(to) => farthest += (to * Point3::origin()).coords.norm(),
            Step::Turn { joint, .. } => reaches[*joint] += farthest,
        }
    }
    reaches
}
