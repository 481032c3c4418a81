//! Commands of all joints, tick by tick.

use bytemuck::Zeroable;
use tactnet_catching_packets::packets::{
    ArmPath, BodyPath, ControllerMode, ControllerState, Gaze, Text, ThrowPath,
};
use tactnet_catching_packets::{ARM_JOINTS, ARMS, JOINTS, Joint, joint};

use super::throwing::Throwing;
use super::trail::Trail;
use crate::coordinate::{BodyMotion, Neck};
use crate::flight::Flight;
use crate::ramp::Ramp;
use crate::robot::Robot;
use crate::safety::Bodies;

/// Maximum position difference between a path's start and the current motion, in rad.
pub(super) const POSITION_TOLERANCE: f64 = 1e-4;
/// Maximum velocity difference between a path's start and the current motion, in rad/s.
pub(super) const SPEED_TOLERANCE: f64 = 1e-3;
/// Tolerance of limit checks for rounding, absolute in rad or m and relative for speeds.
const ROUNDING: f64 = 1e-6;
/// Maximum time from now to the start of a path, in ns. A later start indicates a wrong clock.
pub(super) const MAX_AHEAD_NS: u64 = 2_000_000_000;
/// Maximum distance from the waiting pose at which a starting robot counts as waiting, in rad and m.
const WAITING_TOLERANCE: f64 = 2e-3;

/// Reason why a path is rejected.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum PathError {
    /// The robot brakes, returns or rests outside the waiting pose.
    #[error("a path in a mode that accepts none")]
    NotFollowing,
    /// The robot is not in the waiting pose.
    #[error("a throw outside the waiting pose")]
    NotReady,
    /// The arm index is out of range.
    #[error("a path for an unknown arm")]
    Arm,
    /// A value is not finite.
    #[error("a path with values that are not finite")]
    NotFinite,
    /// The start is in the past or too far in the future.
    #[error("a path that came {late_us} us late")]
    Time {
        /// Delay in us; negative if the path is early.
        late_us: i64,
    },
    /// Another path with an earlier start is still waiting.
    #[error("a path behind one that has not started")]
    Waiting,
    /// Approach, swing and release of a throw are out of order.
    #[error("a throw with approach, swing and release out of order")]
    Order,
    /// The path does not continue the current motion.
    #[error("a path that jumps at joint {joint}")]
    Jump {
        /// Index of the joint within the path.
        joint: usize,
    },
    /// The path exceeds a range, speed or acceleration.
    #[error("a path outside the limits of joint {joint}")]
    Limits {
        /// Index of the joint within the path.
        joint: usize,
    },
}

/// Controller of all joints. Does not allocate after [`Controller::new`].
#[derive(Debug, Clone)]
pub struct Controller {
    robot: Robot,
    /// Current paths.
    arms: [ArmPath; ARMS],
    /// Paths that start later.
    next: [Option<ArmPath>; ARMS],
    body: BodyMotion,
    neck: Neck,
    throwing: Option<Throwing>,
    brakes: [Ramp; JOINTS],
    braking_ns: u64,
    /// True if it brakes on the way back.
    on_trail: bool,
    trail: Trail,
    mode: ControllerMode,
    why: Text<64>,
    refused: u64,
    beats: u64,
    last: Option<u64>,
    q: [f64; JOINTS],
    dq: [f64; JOINTS],
}

impl Controller {
    /// Creates a controller for a robot at rest in `q`. Outside of the waiting pose `ready`, it can return only if the
    /// straight way is collision-free.
    pub fn new(robot: Robot, ready: [f64; JOINTS], q: &[f64; JOINTS]) -> Self {
        let bodies = Bodies::new(robot.description());
        let mut trail = Trail::new(&ready);
        let is_there = q
            .iter()
            .zip(&ready)
            .all(|(q, r)| (q - r).abs() < WAITING_TOLERANCE);
        let within = |i: usize| {
            let [low, high] = robot.joints()[i].range;
            q[i].clamp(low, high)
        };
        let q: [f64; JOINTS] = if is_there {
            ready
        } else {
            std::array::from_fn(within)
        };
        let (mode, why) = if is_there {
            (ControllerMode::Ready, "started in the waiting pose")
        } else if trail.straight(&q, robot.joints(), &bodies) {
            (ControllerMode::Standing, "started outside the waiting pose")
        } else {
            (
                ControllerMode::Stuck,
                "started outside the waiting pose, and the way back is blocked",
            )
        };
        Self {
            arms: std::array::from_fn(|arm| standing(arm, &q)),
            next: [None; ARMS],
            body: BodyMotion::standing(&q),
            neck: Neck::standing(&q),
            throwing: None,
            brakes: q.map(Ramp::standing),
            braking_ns: 0,
            on_trail: false,
            trail,
            mode,
            why: Text::new(why),
            refused: 0,
            beats: 0,
            last: None,
            q,
            dq: [0.0; JOINTS],
            robot,
        }
    }

    /// Returns the mode.
    pub fn mode(&self) -> ControllerMode {
        self.mode
    }

    /// Returns true while the brakes of the torso must be engaged.
    pub fn brakes_torso(&self, now_ns: u64) -> bool {
        self.throwing
            .is_some_and(|throwing| throwing.brakes_torso(now_ns))
    }

    /// Returns the state as a packet.
    pub fn state(&self, now_ns: u64) -> ControllerState {
        let throwing = self.throwing.map(|throwing| throwing.arm_path(now_ns));
        let carried_out = |arm: usize| {
            let throws = throwing.filter(|path| path.arm == arm as u64);
            throws.unwrap_or_else(|| self.next[arm].unwrap_or(self.arms[arm]))
        };
        ControllerState {
            t_ns: now_ns,
            mode: self.mode as u64,
            refused: self.refused,
            beats: self.beats,
            loop_ns: 0,
            reason: self.why,
            paths: std::array::from_fn(carried_out),
        }
    }

    /// Accepts a path of an arm.
    ///
    /// # Errors
    /// Returns an error and changes nothing if the path does not continue the arm's motion or exceeds limits.
    pub fn arm_path(&mut self, now_ns: u64, path: &ArmPath) -> Result<(), PathError> {
        let checked = self.check(now_ns, path);
        let arm = self.refuse_errors(checked)?;
        self.next[arm] = Some(*path);
        self.mode = ControllerMode::Following;
        self.why = Text::new("path accepted");
        Ok(())
    }

    /// Counts a rejected path and states its reason.
    fn refuse_errors<T>(&mut self, checked: Result<T, PathError>) -> Result<T, PathError> {
        checked.inspect_err(|error| {
            self.refused += 1;
            self.why = Text::new(&error.to_string());
        })
    }

    /// Accepts a throw. It must start in the waiting pose, and nothing else is accepted until it ends.
    ///
    /// # Errors
    /// Returns an error and changes nothing if the throw starts elsewhere or exceeds limits.
    pub fn throw_path(&mut self, now_ns: u64, path: &ThrowPath) -> Result<(), PathError> {
        let since_ns = self.last.unwrap_or(now_ns).max(now_ns);
        let checked = match self.mode {
            ControllerMode::Ready => Throwing::new(path, &self.robot, &self.q, since_ns),
            _ => Err(PathError::NotReady),
        };
        self.throwing = Some(self.refuse_errors(checked)?);
        self.mode = ControllerMode::Throwing;
        self.why = Text::new("throw accepted");
        Ok(())
    }

    fn check(&self, now_ns: u64, path: &ArmPath) -> Result<usize, PathError> {
        if !matches!(self.mode, ControllerMode::Ready | ControllerMode::Following) {
            return Err(PathError::NotFollowing);
        }
        let arm = usize::try_from(path.arm).ok().filter(|arm| *arm < ARMS);
        let arm = arm.ok_or(PathError::Arm)?;
        let ramps: [Ramp; ARM_JOINTS] = std::array::from_fn(|i| Ramp::of(&path.ramps[i]));
        if !ramps.iter().all(is_whole) {
            return Err(PathError::NotFinite);
        }
        let since = self.last.unwrap_or(now_ns).max(now_ns);
        if path.start_ns < since || path.start_ns > since + MAX_AHEAD_NS {
            let late_us = (since as i64 - path.start_ns as i64) / 1000;
            return Err(PathError::Time { late_us });
        }
        if self.next[arm].is_some_and(|next| next.start_ns < path.start_ns) {
            return Err(PathError::Waiting);
        }
        let before = self.arms[arm];
        for (i, ramp) in ramps.iter().enumerate() {
            let (q, w) = at(&before, i, path.start_ns);
            if (ramp.q0 - q).abs() > POSITION_TOLERANCE || (ramp.w0 - w).abs() > SPEED_TOLERANCE {
                return Err(PathError::Jump { joint: i });
            }
            let limits = &self.robot.joints()[joint::ARM[arm].start + i];
            if !keeps(ramp, limits) {
                return Err(PathError::Limits { joint: i });
            }
        }
        Ok(arm)
    }

    /// Accepts a motion of platform and torso.
    ///
    /// # Errors
    /// Returns an error and changes nothing if the motion does not start at rest here and now or exceeds limits.
    pub fn body_path(&mut self, path: &BodyPath) -> Result<(), PathError> {
        let motion = BodyMotion::of(path);
        self.refuse_errors(self.check_body(path.start_ns, &motion))?;
        // Start no earlier than now.
        let start_ns = motion.start_ns.max(self.last.unwrap_or(0));
        self.body = BodyMotion { start_ns, ..motion };
        self.mode = ControllerMode::Following;
        Ok(())
    }

    fn check_body(&self, start_ns: u64, motion: &BodyMotion) -> Result<(), PathError> {
        if !matches!(self.mode, ControllerMode::Ready | ControllerMode::Following) {
            return Err(PathError::NotFollowing);
        }
        for (ramp, joint) in [
            (&motion.platform, joint::PLATFORM),
            (&motion.turn, joint::TORSO.start),
        ] {
            let limits = &self.robot.joints()[joint];
            let [low, high] = ramp.extent();
            if !ramp.is_finite() {
                return Err(PathError::NotFinite);
            }
            if (ramp.q0 - self.q[joint]).abs() > POSITION_TOLERANCE
                || self.dq[joint].abs() > SPEED_TOLERANCE
                || ramp.w0.abs() > SPEED_TOLERANCE
            {
                return Err(PathError::Jump { joint });
            }
            if low < limits.range[0] - ROUNDING
                || high > limits.range[1] + ROUNDING
                || ramp.top_speed() > limits.speed * (1.0 + ROUNDING)
                || ramp.a.abs() > limits.acceleration * (1.0 + 1e-3)
            {
                return Err(PathError::Limits { joint });
            }
        }
        // A start slightly in the past causes a small step; a larger delay would cause a jump.
        match self.last {
            Some(last)
                if start_ns.saturating_add(3_000_000) < last || start_ns > last + MAX_AHEAD_NS =>
            {
                let late_us = (last as i64).saturating_sub_unsigned(start_ns) / 1000;
                Err(PathError::Time { late_us })
            }
            _ => Ok(()),
        }
    }

    /// Sets the gaze target.
    pub fn gaze(&mut self, now_ns: u64, gaze: &Gaze) {
        if !matches!(self.mode, ControllerMode::Ready | ControllerMode::Following) {
            return;
        }
        let count = (gaze.count as usize).min(gaze.flights.len());
        let looked = std::array::from_fn(|i| {
            let flight = gaze.flights.get(i).filter(|_| i < count)?;
            let mut numbers = flight.p.iter().chain(&flight.v).chain(&flight.lift);
            let finite = numbers.all(|n| n.is_finite());
            // Limits the integration, which takes steps of 10 ms.
            let near = flight.t_ns.abs_diff(now_ns) < 3_000_000_000;
            (finite && flight.k.is_finite() && near)
                .then(|| (flight.t_ns, Flight::of_packet(flight)))
        });
        self.neck.look_at(now_ns, looked);
        if looked.iter().any(Option::is_some) {
            self.mode = ControllerMode::Following;
        }
    }

    /// Brakes all joints with maximum deceleration from the last command. On the way back, all joints brake together
    /// and stay on the trail.
    pub fn brake(&mut self, why: &str) {
        if matches!(
            self.mode,
            ControllerMode::Braking | ControllerMode::Standing | ControllerMode::Stuck
        ) {
            return;
        }
        self.why = Text::new(why);
        self.on_trail = self.mode == ControllerMode::GoingBack;
        self.mode = ControllerMode::Braking;
        self.throwing = None;
        if self.on_trail {
            self.trail.slower();
            return;
        }
        self.brakes = std::array::from_fn(|i| {
            let limits = &self.robot.joints()[i];
            Ramp::braking(self.q[i], self.dq[i], limits.acceleration)
        });
        self.braking_ns = self.last.unwrap_or(0);
        self.next = [None; ARMS];
    }

    /// Starts the return to the waiting pose. A moving robot brakes first, and the caller must repeat the order.
    pub fn go_back(&mut self) {
        let moves = self.dq.iter().any(|dq| dq.abs() > SPEED_TOLERANCE);
        match self.mode {
            ControllerMode::Ready => {}
            ControllerMode::Following if moves => {
                self.brake("was still moving when ordered to go back")
            }
            ControllerMode::Following | ControllerMode::Standing => {
                self.next = [None; ARMS];
                self.trail.turn_round();
                self.mode = ControllerMode::GoingBack;
                self.why = Text::new("ordered to go back");
            }
            ControllerMode::Braking
            | ControllerMode::GoingBack
            | ControllerMode::Stuck
            | ControllerMode::Throwing => {}
        }
    }

    /// Returns the commanded positions and velocities of all joints. Must be called at 1 kHz.
    pub fn tick(&mut self, now_ns: u64) -> (&[f64; JOINTS], &[f64; JOINTS]) {
        self.beats += 1;
        self.last = Some(now_ns);
        match self.mode {
            ControllerMode::Ready | ControllerMode::Following => self.follow(now_ns),
            ControllerMode::Braking if self.on_trail => {
                let stands;
                (self.q, self.dq, stands) = self.trail.stop();
                if stands {
                    self.stand(ControllerMode::Standing);
                }
                return (&self.q, &self.dq);
            }
            ControllerMode::Braking => self.brake_on(now_ns),
            ControllerMode::GoingBack => {
                let there;
                (self.q, self.dq, there) = self.trail.back();
                if there {
                    self.stand(ControllerMode::Ready);
                    self.why = Text::new("returned to the waiting pose");
                }
                return (&self.q, &self.dq);
            }
            ControllerMode::Throwing => self.throw(now_ns),
            ControllerMode::Standing | ControllerMode::Stuck => self.dq = [0.0; JOINTS],
        }
        if !self.trail.push(&self.q) {
            self.brake("the trail for the way back is full");
        }
        (&self.q, &self.dq)
    }

    fn follow(&mut self, now_ns: u64) {
        for (path, next) in self.arms.iter_mut().zip(&mut self.next) {
            if let Some(due) = next.take_if(|next| next.start_ns <= now_ns) {
                *path = due;
            }
        }
        let (mut q, mut dq) = (self.q, [0.0; JOINTS]);
        self.body.write(now_ns, &mut q, &mut dq);
        for (arm, path) in self.arms.iter().enumerate() {
            for i in 0..ARM_JOINTS {
                let index = joint::ARM[arm].start + i;
                (q[index], dq[index]) = at(path, i, now_ns);
            }
        }
        self.neck.turn(now_ns, &self.robot, &q);
        self.neck.write(&mut q, &mut dq);
        (self.q, self.dq) = (q, dq);
    }

    fn throw(&mut self, now_ns: u64) {
        self.dq = [0.0; JOINTS];
        let goes_on = self
            .throwing
            .is_some_and(|throwing| throwing.write(now_ns, &mut self.q, &mut self.dq));
        if !goes_on {
            self.stand(ControllerMode::Standing);
            self.why = Text::new("the throw is over");
        }
    }

    fn brake_on(&mut self, now_ns: u64) {
        let t = (now_ns.saturating_sub(self.braking_ns)) as f64 * 1e-9;
        let mut moves = false;
        for (i, ramp) in self.brakes.iter().enumerate() {
            let limits = &self.robot.joints()[i];
            let (q, dq) = ramp.at(t);
            self.q[i] = q.clamp(limits.range[0], limits.range[1]);
            self.dq[i] = dq;
            moves |= t < ramp.end;
        }
        if !moves {
            self.stand(ControllerMode::Standing);
        }
    }

    /// Ends all motions at the current position.
    fn stand(&mut self, mode: ControllerMode) {
        self.mode = mode;
        self.arms = std::array::from_fn(|arm| standing(arm, &self.q));
        self.next = [None; ARMS];
        self.body = BodyMotion::standing(&self.q);
        self.neck = Neck::standing(&self.q);
        self.throwing = None;
        self.dq = [0.0; JOINTS];
    }
}

/// Returns true if all values are finite and describe a motion of at most 10 s.
pub(super) fn is_whole(ramp: &Ramp) -> bool {
    ramp.is_finite() && (0.0..=ramp.t2).contains(&ramp.t1) && ramp.t2 <= ramp.end && ramp.end < 10.0
}

/// Returns true if a motion keeps range, speed and acceleration of its joint and ends at rest.
pub(super) fn keeps(ramp: &Ramp, limits: &Joint) -> bool {
    let [low, high] = ramp.extent();
    let stands = (ramp.w0 + ramp.a * (ramp.t1 + ramp.t2 - ramp.end)).abs();
    low >= limits.range[0] - ROUNDING
        && high <= limits.range[1] + ROUNDING
        && ramp.top_speed() <= limits.speed * (1.0 + ROUNDING) + ROUNDING
        && ramp.a.abs() <= limits.acceleration * (1.0 + 1e-3)
        && stands <= 1e-3 + limits.acceleration * 1e-3
}

fn standing(arm: usize, q: &[f64; JOINTS]) -> ArmPath {
    ArmPath {
        arm: arm as u64,
        ramps: joint::of_arm(q, arm).map(|q| Ramp::standing(q).packet()),
        ..ArmPath::zeroed()
    }
}

fn at(path: &ArmPath, i: usize, now_ns: u64) -> (f64, f64) {
    let t = (now_ns as f64 - path.start_ns as f64) * 1e-9;
    Ramp::of(&path.ramps[i]).at(t)
}

#[cfg(test)]
mod tests;
