//! What all joints are to do, tick by tick.

use tactnet_catching_packets::packets::{
    ArmPath, BodyPath, ControllerMode, ControllerState, Gaze, Reason, reason,
};
use tactnet_catching_packets::{ARM_JOINTS, ARMS, JOINTS, joint};

use super::trail::Trail;
use crate::coordinate::{BodyMotion, Neck};
use crate::flight::Flight;
use crate::ramp::Ramp;
use crate::robot::Robot;
use crate::safety::Bodies;

/// A path goes on from where the arm is then, rad,
const SAME_PLACE: f64 = 1e-4;
/// and rad/s.
const SAME_SPEED: f64 = 1e-3;
/// Limits are kept to rounding.
const ROUNDING: f64 = 1e-6;
/// A path that begins later than this has a wrong clock, ns.
const FARTHEST_NS: u64 = 2_000_000_000;
/// A robot this near to where it waits, at its start, is there, rad and m.
const THERE: f64 = 2e-3;

/// Why a path is refused.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum PathError {
    /// The robot brakes, goes back or stands elsewhere.
    #[error("a path while the robot does not follow any")]
    NotFollowing,
    /// There are two arms.
    #[error("a path of no arm")]
    Arm,
    /// A number that is none.
    #[error("a path with numbers that are not finite")]
    NotFinite,
    /// Its begin is over, or far ahead.
    #[error("a path that came {late_us} us late")]
    Time {
        /// Less than 0: early.
        late_us: i64,
    },
    /// It does not go on from what the arm does.
    #[error("a path that jumps at joint {joint}")]
    Jump {
        /// Counted from 0.
        joint: usize,
    },
    /// Outside ranges, speeds or accelerations.
    #[error("a path outside the limits of joint {joint}")]
    Limits {
        /// Counted from 0.
        joint: usize,
    },
}

/// Commands all joints. Nothing allocates after [`Controller::new`].
#[derive(Debug, Clone)]
pub struct Controller {
    robot: Robot,
    /// Carried out.
    arms: [ArmPath; ARMS],
    /// Begin later.
    next: [Option<ArmPath>; ARMS],
    body: BodyMotion,
    neck: Neck,
    brakes: [Ramp; JOINTS],
    braking_ns: u64,
    /// Brakes on the way back.
    on_trail: bool,
    trail: Trail,
    mode: ControllerMode,
    why: Reason,
    refused: u64,
    beats: u64,
    last: Option<u64>,
    q: [f64; JOINTS],
    dq: [f64; JOINTS],
}

impl Controller {
    /// Begins with a robot that stands in `q`; where that is not where it waits, it knows a way back only if the straight one is free.
    pub fn new(robot: Robot, ready: [f64; JOINTS], q: &[f64; JOINTS]) -> Self {
        let bodies = Bodies::new(robot.description());
        let mut trail = Trail::new(&ready);
        let is_there = q.iter().zip(&ready).all(|(q, r)| (q - r).abs() < THERE);
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
            (ControllerMode::Ready, "started where the robot waits")
        } else if trail.straight(&q, robot.joints(), &bodies) {
            (ControllerMode::Standing, "started elsewhere")
        } else {
            (
                ControllerMode::Stuck,
                "started elsewhere, and the straight way is not free",
            )
        };
        Self {
            arms: std::array::from_fn(|arm| standing(arm, &q)),
            next: [None; ARMS],
            body: BodyMotion::standing(&q),
            neck: Neck::standing(&q),
            brakes: q.map(Ramp::standing),
            braking_ns: 0,
            on_trail: false,
            trail,
            mode,
            why: reason(why),
            refused: 0,
            beats: 0,
            last: None,
            q,
            dq: [0.0; JOINTS],
            robot,
        }
    }

    /// Returns what it does.
    pub fn mode(&self) -> ControllerMode {
        self.mode
    }

    /// Returns what it does, as it travels.
    pub fn state(&self, now_ns: u64) -> ControllerState {
        ControllerState {
            t_ns: now_ns,
            mode: self.mode as u64,
            refused: self.refused,
            beats: self.beats,
            loop_ns: 0,
            reason: self.why,
            paths: std::array::from_fn(|arm| self.next[arm].unwrap_or(self.arms[arm])),
        }
    }

    /// Takes a path of an arm.
    ///
    /// # Errors
    /// Where it does not go on from what the arm does, or is outside limits; nothing changes then.
    pub fn arm_path(&mut self, now_ns: u64, path: &ArmPath) -> Result<(), PathError> {
        let taken = self.check(now_ns, path);
        match taken {
            Ok(arm) => {
                self.next[arm] = Some(*path);
                self.mode = ControllerMode::Following;
                self.why = reason("a path");
            }
            Err(error) => {
                self.refused += 1;
                self.why = reason(&error.to_string());
            }
        }
        taken.map(|_| ())
    }

    fn check(&self, now_ns: u64, path: &ArmPath) -> Result<usize, PathError> {
        if !matches!(self.mode, ControllerMode::Ready | ControllerMode::Following) {
            return Err(PathError::NotFollowing);
        }
        let arm = usize::try_from(path.arm).ok().filter(|arm| *arm < ARMS);
        let arm = arm.ok_or(PathError::Arm)?;
        let ramps: [Ramp; ARM_JOINTS] = std::array::from_fn(|i| Ramp::of(&path.ramps[i]));
        let finite = |ramp: &Ramp| {
            [ramp.q0, ramp.w0, ramp.a, ramp.t1, ramp.t2, ramp.end]
                .iter()
                .all(|number| number.is_finite())
                && (0.0..=ramp.t2).contains(&ramp.t1)
                && ramp.t2 <= ramp.end
                && ramp.end < 10.0
        };
        if !ramps.iter().all(finite) {
            return Err(PathError::NotFinite);
        }
        let since = self.last.unwrap_or(now_ns).max(now_ns);
        if path.start_ns < since || path.start_ns > since + FARTHEST_NS {
            let late_us = (since as i64 - path.start_ns as i64) / 1000;
            return Err(PathError::Time { late_us });
        }
        let before = self.next[arm]
            .filter(|next| next.start_ns <= path.start_ns)
            .unwrap_or(self.arms[arm]);
        for (i, ramp) in ramps.iter().enumerate() {
            let (q, w) = at(&before, i, path.start_ns);
            if (ramp.q0 - q).abs() > SAME_PLACE || (ramp.w0 - w).abs() > SAME_SPEED {
                return Err(PathError::Jump { joint: i });
            }
            let limits = &self.robot.joints()[joint::ARM[arm].start + i];
            let [low, high] = ramp.extent();
            // It has to come to rest as well.
            let stands = (ramp.w0 + ramp.a * (ramp.t1 + ramp.t2 - ramp.end)).abs();
            let kept = low >= limits.range[0] - ROUNDING
                && high <= limits.range[1] + ROUNDING
                && ramp.top_speed() <= limits.speed * (1.0 + ROUNDING) + ROUNDING
                && ramp.a.abs() <= limits.acceleration * (1.0 + 1e-3)
                && stands <= 1e-3 + limits.acceleration * 1e-3;
            if !kept {
                return Err(PathError::Limits { joint: i });
            }
        }
        Ok(arm)
    }

    /// Takes a motion of platform and torso; it is followed only from standstill, and within limits.
    pub fn body_path(&mut self, path: &BodyPath) -> bool {
        let motion = BodyMotion {
            start_ns: path.start_ns,
            platform: Ramp::of(&path.platform),
            turn: Ramp::of(&path.turn),
        };
        let follows = matches!(self.mode, ControllerMode::Ready | ControllerMode::Following);
        let goes_on = [
            (motion.platform, joint::PLATFORM),
            (motion.turn, joint::TORSO.start),
        ]
        .iter()
        .all(|(ramp, index)| {
            let limits = &self.robot.joints()[*index];
            let [low, high] = ramp.extent();
            let numbers = [ramp.q0, ramp.w0, ramp.a, ramp.t1, ramp.t2, ramp.end];
            numbers.iter().all(|number| number.is_finite())
                && (ramp.q0 - self.q[*index]).abs() <= SAME_PLACE
                && self.dq[*index].abs() <= SAME_SPEED
                && ramp.w0.abs() <= SAME_SPEED
                && low >= limits.range[0] - ROUNDING
                && high <= limits.range[1] + ROUNDING
                && ramp.top_speed() <= limits.speed * (1.0 + ROUNDING)
                && ramp.a.abs() <= limits.acceleration * (1.0 + 1e-3)
        });
        let on_time = self.last.is_none_or(|last| {
            // What has begun a little before is a small step; more would be a jump.
            path.start_ns + 3_000_000 >= last && path.start_ns <= last + FARTHEST_NS
        });
        if !(follows && goes_on && on_time) {
            self.refused += 1;
            return false;
        }
        // From now on at the earliest.
        let start_ns = motion.start_ns.max(self.last.unwrap_or(0));
        self.body = BodyMotion { start_ns, ..motion };
        self.mode = ControllerMode::Following;
        true
    }

    /// Takes what the head is to look at.
    pub fn gaze(&mut self, now_ns: u64, gaze: &Gaze) {
        if !matches!(self.mode, ControllerMode::Ready | ControllerMode::Following) {
            return;
        }
        let count = (gaze.count as usize).min(gaze.flights.len());
        let looked = std::array::from_fn(|i| {
            let flight = gaze.flights.get(i).filter(|_| i < count)?;
            let finite = flight
                .p
                .iter()
                .chain(&flight.v)
                .chain(&flight.lift)
                .all(|n| n.is_finite());
            // Integration takes steps of 10 ms.
            let near = flight.t_ns.abs_diff(now_ns) < 3_000_000_000;
            (finite && flight.k.is_finite() && near).then(|| {
                let packet = Flight {
                    p: flight.p.into(),
                    v: flight.v.into(),
                    k: flight.k,
                    lift: flight.lift.into(),
                };
                (flight.t_ns, packet)
            })
        });
        self.neck.look_at(now_ns, looked);
        if looked.iter().any(Option::is_some) {
            self.mode = ControllerMode::Following;
        }
    }

    /// Brakes all joints as fast as they may, from the last command; on the way back together, so that they stay on it.
    pub fn brake(&mut self, why: &str) {
        if matches!(
            self.mode,
            ControllerMode::Braking | ControllerMode::Standing | ControllerMode::Stuck
        ) {
            return;
        }
        self.why = reason(why);
        self.on_trail = self.mode == ControllerMode::GoingBack;
        self.mode = ControllerMode::Braking;
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

    /// Goes back to where the robot waits; what still moves is braked first, and the command is to be given again.
    pub fn go_back(&mut self) {
        let moves = self.dq.iter().any(|dq| dq.abs() > SAME_SPEED);
        match self.mode {
            ControllerMode::Ready => {}
            ControllerMode::Following if moves => self.brake("still moved when it was to go back"),
            ControllerMode::Following | ControllerMode::Standing => {
                self.next = [None; ARMS];
                self.trail.turn_round();
                self.mode = ControllerMode::GoingBack;
                self.why = reason("told to go back");
            }
            ControllerMode::Braking | ControllerMode::GoingBack | ControllerMode::Stuck => {}
        }
    }

    /// Returns where all joints are to be at a time, and how fast. To be called a thousand times a second.
    pub fn tick(&mut self, now_ns: u64) -> (&[f64; JOINTS], &[f64; JOINTS]) {
        self.beats += 1;
        self.last = Some(now_ns);
        match self.mode {
            ControllerMode::Ready | ControllerMode::Following => self.follow(now_ns),
            ControllerMode::Braking if self.on_trail => {
                let stands;
                (self.q, self.dq, stands) = self.trail.stop();
                if stands {
                    self.stand();
                    self.mode = ControllerMode::Standing;
                }
                return (&self.q, &self.dq);
            }
            ControllerMode::Braking => self.brake_on(now_ns),
            ControllerMode::GoingBack => {
                let there;
                (self.q, self.dq, there) = self.trail.back();
                if there {
                    self.stand();
                    self.mode = ControllerMode::Ready;
                    self.why = reason("is back");
                }
                return (&self.q, &self.dq);
            }
            ControllerMode::Standing | ControllerMode::Stuck => self.dq = [0.0; JOINTS],
        }
        if !self.trail.push(&self.q) {
            self.brake("moved for longer than the way back is kept");
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
            self.stand();
            self.mode = ControllerMode::Standing;
        }
    }

    /// Follows nothing any more, from where it is.
    fn stand(&mut self) {
        self.arms = std::array::from_fn(|arm| standing(arm, &self.q));
        self.next = [None; ARMS];
        self.body = BodyMotion::standing(&self.q);
        self.neck = Neck::standing(&self.q);
        self.dq = [0.0; JOINTS];
    }
}

fn standing(arm: usize, q: &[f64; JOINTS]) -> ArmPath {
    ArmPath {
        arm: arm as u64,
        ball: 0,
        exposure_ns: 0,
        head_ns: 0,
        start_ns: 0,
        ramps: std::array::from_fn(|i| Ramp::standing(q[joint::ARM[arm].start + i]).packet()),
    }
}

fn at(path: &ArmPath, i: usize, now_ns: u64) -> (f64, f64) {
    let t = (now_ns as f64 - path.start_ns as f64) * 1e-9;
    Ramp::of(&path.ramps[i]).at(t)
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;
    use proptest::prelude::*;
    use tactnet_catching_packets::RobotDescription;

    use super::*;

    const TICK_NS: u64 = 1_000_000;

    fn robot() -> Robot {
        Robot::new(RobotDescription::nominal())
    }

    /// A path from what the controller carries out, by shares of the ranges, that takes `seconds`.
    fn path(
        robot: &Robot,
        state: &ControllerState,
        arm: usize,
        start_ns: u64,
        shares: &[f64],
        seconds: f64,
    ) -> ArmPath {
        let before = &state.paths[arm];
        ArmPath {
            arm: arm as u64,
            start_ns,
            ramps: std::array::from_fn(|i| {
                let limits = &robot.joints()[joint::ARM[arm].start + i];
                let (q, w) = at(before, i, start_ns);
                let wanted = limits.range[0] + (limits.range[1] - limits.range[0]) * shares[i];
                // A tenth of the way, so that limits are kept where there is time.
                Ramp::between(q, w, q + 0.1 * (wanted - q), seconds, limits.speed).packet()
            }),
            ..ArmPath::zeroed()
        }
    }

    #[derive(Debug, Clone)]
    enum Event {
        Path {
            arm: usize,
            shares: Vec<f64>,
            seconds: f64,
            early_ms: u64,
            shifted: f64,
        },
        Body {
            turn: f64,
        },
        Brake,
        GoBack,
    }

    fn events() -> impl Strategy<Value = Vec<(u64, Event)>> {
        let path = (
            0..3usize,
            proptest::collection::vec(0.0..1.0f64, ARM_JOINTS),
            0.2..1.0f64,
            0..20u64,
            prop_oneof![4 => Just(0.0), 1 => -1.0..1.0f64],
        )
            .prop_map(|(arm, shares, seconds, early_ms, shifted)| Event::Path {
                arm,
                shares,
                seconds,
                early_ms,
                shifted,
            });
        let event = prop_oneof![6 => path, 1 => (-0.5..0.5f64).prop_map(|turn| Event::Body { turn }), 1 => Just(Event::Brake), 1 => Just(Event::GoBack)];
        proptest::collection::vec((1..400u64, event), 1..12)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        /// Whoever sends whatever, commands are smooth and within limits, and the robot finds back.
        #[test]
        fn commands_stay_within_limits_and_the_robot_finds_back(events in events()) {
            let robot = robot();
            let ready = robot.waiting();
            let mut controller = Controller::new(robot.clone(), ready, &ready);
            let (mut now, mut last) = (TICK_NS, (ready, [0.0; JOINTS]));
            let mut tick = |controller: &mut Controller, now: u64| -> Result<(), TestCaseError> {
                let (q, dq) = controller.tick(now);
                for (i, limits) in robot.joints().iter().enumerate() {
                    prop_assert!(q[i] >= limits.range[0] - 1e-9 && q[i] <= limits.range[1] + 1e-9, "joint {i} at {}", q[i]);
                    prop_assert!(dq[i].abs() <= limits.speed * 1.001, "joint {i}: {}", dq[i]);
                    let change = (dq[i] - last.1[i]).abs();
                    prop_assert!(change <= limits.acceleration * 1.6e-3 + 2e-3, "joint {i} changes by {change}");
                    let moved = q[i] - last.0[i];
                    prop_assert!((moved - 0.5e-3 * (dq[i] + last.1[i])).abs() < limits.acceleration * 1.1e-6 + SAME_PLACE, "joint {i} moved by {moved}");
                }
                last = (*q, *dq);
                Ok(())
            };
            for (wait, event) in events {
                for _ in 0..wait {
                    tick(&mut controller, now)?;
                    now += TICK_NS;
                }
                match event {
                    Event::Path { arm, shares, seconds, early_ms, shifted } => {
                        let state = controller.state(now);
                        let mut path = path(&robot, &state, arm.min(1), now + early_ms * TICK_NS, &shares, seconds);
                        path.arm = arm as u64;
                        path.ramps[3].q0 += shifted;
                        let refused = state.refused;
                        let taken = controller.arm_path(now, &path);
                        prop_assert_eq!(controller.state(now).refused, refused + u64::from(taken.is_err()));
                        prop_assert!(taken.is_err() || (arm < 2 && shifted.abs() <= SAME_PLACE));
                    }
                    Event::Body { turn } => {
                        let mut body = BodyPath::zeroed();
                        let q = controller.q;
                        body.start_ns = now;
                        body.platform = Ramp::standing(q[joint::PLATFORM]).packet();
                        let from = q[joint::TORSO.start];
                        body.turn = Ramp::between(from, 0.0, from + turn, 1.0, robot.joints()[joint::TORSO.start].speed).packet();
                        controller.body_path(&body);
                    }
                    Event::Brake => controller.brake("asked"),
                    Event::GoBack => controller.go_back(),
                }
            }
            let mut asked = 0;
            while controller.mode() != ControllerMode::Ready {
                if matches!(controller.mode(), ControllerMode::Following | ControllerMode::Standing) {
                    controller.go_back();
                }
                tick(&mut controller, now)?;
                now += TICK_NS;
                asked += 1;
                prop_assert!(asked < 40_000, "{:?}", controller.mode());
            }
            prop_assert_eq!(controller.q, ready);
        }
    }

    #[test]
    fn the_way_back_is_the_way_that_it_came() {
        let robot = robot();
        let ready = robot.waiting();
        let mut controller = Controller::new(robot.clone(), ready, &ready);
        controller.tick(TICK_NS);
        let way = path(&robot, &controller.state(0), 1, 5 * TICK_NS, &[0.9; 7], 0.7);
        controller.arm_path(TICK_NS, &way).unwrap();
        let (mut there, mut now) = (Vec::new(), TICK_NS);
        for _ in 0..800 {
            now += TICK_NS;
            there.push(*controller.tick(now).0);
        }
        controller.go_back();
        let mut ticks = 0;
        while controller.mode() == ControllerMode::GoingBack {
            now += TICK_NS;
            let q = *controller.tick(now).0;
            let nearest = there
                .iter()
                .map(|t| {
                    t.iter()
                        .zip(&q)
                        .map(|(a, b)| (a - b).abs())
                        .fold(0.0, f64::max)
                })
                .fold(f64::INFINITY, f64::min);
            assert!(nearest < 3e-3, "{nearest} rad beside the way");
            ticks += 1;
        }
        assert_eq!(controller.mode(), ControllerMode::Ready);
        assert!((1400..2200).contains(&ticks), "half as fast: {ticks}");
    }

    #[test]
    fn a_controller_that_starts_elsewhere_goes_back_where_the_way_is_free() {
        let robot = robot();
        let ready = robot.waiting();
        let mut elsewhere = ready;
        elsewhere[joint::RIGHT_ARM.start + 3] += 0.4;
        let mut controller = Controller::new(robot, ready, &elsewhere);
        assert_eq!(controller.mode(), ControllerMode::Standing);
        controller.tick(TICK_NS);
        controller.go_back();
        for tick in 2..6000 {
            controller.tick(tick * TICK_NS);
        }
        assert_eq!(controller.mode(), ControllerMode::Ready);
    }

    #[test]
    fn late_paths_and_paths_that_jump_are_refused_with_a_reason() {
        let robot = robot();
        let ready = robot.waiting();
        let mut controller = Controller::new(robot.clone(), ready, &ready);
        controller.tick(10 * TICK_NS);
        let good = path(
            &robot,
            &controller.state(0),
            0,
            20 * TICK_NS,
            &[0.2; 7],
            0.8,
        );
        let late = ArmPath {
            start_ns: 5 * TICK_NS,
            ..good
        };
        assert_eq!(
            controller.arm_path(10 * TICK_NS, &late),
            Err(PathError::Time { late_us: 5000 })
        );
        let mut jumps = good;
        jumps.ramps[2].q0 += 0.01;
        assert_eq!(
            controller.arm_path(10 * TICK_NS, &jumps),
            Err(PathError::Jump { joint: 2 })
        );
        let mut fast = good;
        fast.ramps[1].a *= 40.0;
        assert_eq!(
            controller.arm_path(10 * TICK_NS, &fast),
            Err(PathError::Limits { joint: 1 })
        );
        let mut spoilt = good;
        spoilt.ramps[0].t2 = f64::NAN;
        assert_eq!(
            controller.arm_path(10 * TICK_NS, &spoilt),
            Err(PathError::NotFinite)
        );
        assert_eq!(
            controller.mode(),
            ControllerMode::Ready,
            "nothing has changed"
        );
        controller.arm_path(10 * TICK_NS, &good).unwrap();
        controller.brake("asked");
        assert_eq!(
            controller.arm_path(10 * TICK_NS, &good),
            Err(PathError::NotFollowing)
        );
        assert_eq!(controller.state(0).refused, 5);
    }
}
