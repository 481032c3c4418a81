//! One throw in stepped time: world and stack tick by tick, with all delays.

use std::ops::Range;

use tactnet_catching::CatchSpace;
use tactnet_catching_packets::packets::{ControllerMode, PlanResult};
use tactnet_catching_packets::{ARMS, JOINTS, joint};
use tactnet_catching_world::{FlightSample, TICK_NS, World};

use crate::bound::{Bound, bounds};
use crate::error::TrialError;
use crate::look::{Looked, begin};
use crate::look_ahead::{AHEAD, LookAhead, SAME_BALL, TimedPrediction, as_flight, true_at};
use crate::stepped_stack::{StackCommands, StepObserver, SteppedStack};
use crate::stepped_time::{ticks, world_seed};
use crate::throw_config::{Mapping, ThrowConfig};
use crate::throw_outcome::{AmongObstacles, BallOutcome, ThrowOutcome};
use crate::trace::{Trace, TracePlan};
use crate::watch::{Braked, watch};

/// Standstill before the throw in s, in which the pose estimator determines the bias of the inertial unit.
const REST: f64 = 1.0;
/// Standstill after the robot has looked around in s, until the torso is at rest.
const REST_AFTER_LOOK: f64 = 2.5;
/// Maximum time after a throw until its verdict, and from there until that of the second judge, in s.
pub(crate) const LONGEST: f64 = 2.5;
/// Maximum time after a throw until the robot waits for the next one, in s.
pub(crate) const LONGEST_BACK: f64 = 20.0;

/// World and stack during a throw.
pub(crate) struct SimulatedThrow<'a> {
    pub config: &'a ThrowConfig,
    pub world: World,
    /// Result of looking around.
    looked: Looked,
    /// Joint positions before the throw.
    pub ready: [f64; JOINTS],
    pub stack: SteppedStack,
    pub watching: Watching<'a>,
    /// Time of the last throw, in ns.
    thrown_ns: Option<u64>,
    balls: Range<u64>,
}

#[derive(Default)]
pub(crate) struct Watching<'a> {
    pub trace: Option<Trace>,
    pub steps: Option<&'a mut StepObserver<'a>>,
    /// Time for which the trace continues after the last verdict, in s.
    pub after: f64,
}

impl ThrowConfig {
    /// Simulates throw `number` of a series, and calls `steps` after each step of the coordinator.
    ///
    /// # Errors
    /// Invalid settings of the world or the stack.
    pub fn run(
        &self,
        seed: u64,
        number: u64,
        oracle: &CatchSpace,
        steps: Option<&mut StepObserver<'_>>,
    ) -> Result<ThrowOutcome, TrialError> {
        let watching = Watching {
            steps: steps.map(|steps| steps as &mut StepObserver<'_>),
            ..Watching::default()
        };
        let simulated = self.simulate(seed, number, oracle, watching);
        simulated.map(|(outcome, _)| outcome)
    }

    /// Simulates a throw with its observers. Returns the trace if there is one.
    pub(crate) fn simulate<'a>(
        &'a self,
        seed: u64,
        number: u64,
        oracle: &CatchSpace,
        watching: Watching<'a>,
    ) -> Result<(ThrowOutcome, Option<Trace>), TrialError> {
        let mut throw = SimulatedThrow::new(self, world_seed(seed, number), watching)?;
        let braked = throw.run();
        let mut outcome = ThrowOutcome {
            number,
            balls: throw.outcomes(oracle),
            no_plans: throw.stack.no_plans(),
            obstacles: (self.mapping != Mapping::Off).then(|| throw.among_obstacles()),
            stops: throw.stack.safety.brakes,
            braked,
        };
        let trace = throw.end_trace();
        throw.judge_fingers(&mut outcome.balls);
        Ok((outcome, trace))
    }
}

impl<'a> SimulatedThrow<'a> {
    /// Creates the world and lets the robot look around if required.
    pub fn new(
        config: &'a ThrowConfig,
        seed: u64,
        mut watching: Watching<'a>,
    ) -> Result<Self, TrialError> {
        let ready = config.robot.waiting();
        let (world, looked) = begin(config, seed, &config.corrections().sensors(&ready))?;
        let ready = match config.mapping {
            Mapping::Off => ready,
            Mapping::Blind | Mapping::Depth => looked.joints,
        };
        if let Some(trace) = &mut watching.trace {
            trace.field.clone_from(&looked.field);
            trace.boxes = world.boxes().to_vec();
        }
        Ok(Self {
            config,
            stack: SteppedStack::new(config, ready, looked.field.clone(), seed)?,
            world,
            looked,
            ready,
            watching,
            thrown_ns: None,
            balls: 0..0,
        })
    }

    /// Runs until all balls are judged. Returns the first command at which the monitor would have braked.
    fn run(&mut self) -> Option<Braked> {
        let config = self.config;
        let rest = match config.mapping {
            Mapping::Off => REST,
            Mapping::Blind | Mapping::Depth => REST_AFTER_LOOK,
        };
        let first_tick = self.world.time_ns() / TICK_NS;
        let rest_ticks = first_tick + ticks(rest);
        let mut braked = None;
        let longest = if config.watch { LONGEST_BACK } else { LONGEST };
        let mut judged_tick = None;
        for tick in first_tick..rest_ticks + ticks(longest) {
            if tick == rest_ticks {
                self.throw_now();
            }
            let commands = self.tick();
            let mode = self.stack.mode();
            if config.watch {
                let since = (tick as f64 - rest_ticks as f64) * 1e-3;
                let (safety, verdict) = (&self.stack.safety, &commands.verdict);
                watch(&mut braked, safety, &commands.joints, verdict, mode, since);
            }
            if tick > rest_ticks && self.is_judged() {
                let judged_tick = *judged_tick.get_or_insert(tick);
                let shown = tick >= judged_tick + ticks(self.watching.after);
                if shown && (!config.watch || mode == Some(ControllerMode::Ready)) {
                    break;
                }
            }
        }
        braked
    }

    /// Throws the next balls.
    pub fn throw_now(&mut self) {
        self.balls = self.balls.end..self.balls.end + self.config.balls as u64;
        self.thrown_ns = Some(self.world.time_ns());
        self.world.throw(self.config.balls);
    }

    /// Returns true if all thrown balls are judged.
    pub fn is_judged(&self) -> bool {
        let judged = |ball| self.world.verdicts().iter().any(|one| one.ball == ball);
        self.balls.clone().all(judged)
    }

    /// Advances by a tick.
    pub fn tick(&mut self) -> StackCommands {
        let (config, now_ns) = (self.config, self.world.time_ns());
        let steps = self.watching.steps.as_deref_mut();
        let mut commands = self.stack.step(now_ns, steps);
        for hand in commands.hands.iter_mut().flatten() {
            let late_ns = (config.closing_error * 1e9) as i64;
            hand.catch_ns = hand.catch_ns.saturating_add_signed(late_ns);
        }
        let command = &commands.joints;
        let sensed = *self.world.step(command, &commands.hands);
        let truth = self.world.truth();
        if let (Some(trace), Some(thrown_ns)) = (&mut self.watching.trace, self.thrown_ns) {
            let since = (now_ns - thrown_ns) as f64 * 1e-9;
            trace.tick(since, &config.robot, &self.world, command, &sensed);
        }
        self.stack.sense(&sensed, &truth);
        commands
    }

    /// Goes on without observers until the second judge has decided on the balls of the last throw.
    pub fn judge_fingers(&mut self, outcomes: &mut [BallOutcome]) {
        self.watching = Watching::default();
        let balls = self.balls.clone();
        for _ in 0..ticks(LONGEST) {
            if balls.clone().all(|ball| self.world.cage(ball).is_some()) {
                break;
            }
            self.tick();
        }
        for (outcome, ball) in outcomes.iter_mut().zip(balls) {
            outcome.cage = self.world.cage(ball);
        }
    }

    /// Returns the trace since the last throw, with the executed plans.
    pub fn end_trace(&mut self) -> Option<Trace> {
        let mut trace = self.watching.trace.take()?;
        trace.plans = traced(&self.stack.chosen, self.thrown_ns?);
        Some(trace)
    }

    /// Returns the results of the balls of the last throw.
    pub fn outcomes(&self, oracle: &CatchSpace) -> Vec<BallOutcome> {
        let balls = self.balls.clone();
        balls.map(|ball| self.outcome(ball, oracle)).collect()
    }

    fn among_obstacles(&self) -> AmongObstacles {
        AmongObstacles {
            contacts: *self.world.contacts(),
            obstructed: self.stack.obstructed,
            arms_held_up: (0..ARMS)
                .filter(|arm| {
                    let own = joint::ARM[*arm].clone();
                    self.ready[own] != self.config.robot.ready(*arm)
                })
                .count(),
            look_seconds: self.looked.seconds,
            plan_seconds: self.stack.first_plan,
        }
    }

    fn outcome(&self, ball: u64, oracle: &CatchSpace) -> BallOutcome {
        let (config, world) = (self.config, &self.world);
        let (perception, said) = (&self.stack.perception, &self.stack.said);
        let mut chosen = self.stack.chosen.iter();
        let flight = world.true_flight(ball).unwrap_or_default();
        let rate = config.robot.description().cameras.rate;
        let reaction = config.timing.reaction(rate);
        let mut verdicts = world.verdicts().iter();
        let verdict = verdicts.find(|verdict| verdict.ball == ball).copied();
        let catch = verdict
            .and_then(|verdict| verdict.crossing)
            .and_then(|crossing| Some((crossing.at_ns, true_at(&flight, crossing.at_ns)?)));
        let own = said.iter().filter(|said| is_of(said, ball, &flight, world));
        let own: Vec<&TimedPrediction> = own.collect();
        let predictions: Vec<LookAhead> = catch.map_or_else(Vec::new, |(at_ns, there)| {
            let aligned = perception.alignment(at_ns);
            own.iter()
                .filter(|said| said.exposure_ns < at_ns)
                .map(|said| said.judge(&aligned, at_ns, &there.p, &there.v))
                .collect()
        });
        let is_ahead = |prediction: &&LookAhead| prediction.left >= AHEAD;
        let ahead = predictions.iter().rfind(is_ahead).copied();
        let bound = ahead
            .zip(catch)
            .and_then(|(ahead, (at_ns, _))| self.bound(&ahead, flight.first()?, at_ns));
        BallOutcome {
            arms: oracle.arms_of(flight.iter().map(as_flight), reaction, &self.ready),
            tracked: !own.is_empty(),
            planned: chosen.any(|(_, plan)| {
                let is_of = |said: &&TimedPrediction| said.prediction.ball == plan.request.ball;
                own.iter().any(is_of)
            }),
            ahead,
            bound,
            predictions,
            verdict,
            cage: None,
        }
    }

    fn bound(&self, ahead: &LookAhead, release: &FlightSample, catch_ns: u64) -> Option<Bound> {
        let robot = &self.config.robot;
        let cameras = &robot.description().cameras;
        let seconds = (catch_ns - release.t_ns) as f64 * 1e-9;
        let first = (seconds - ahead.left).rem_euclid(1.0 / cameras.rate);
        let head = robot.chest(&self.ready) * robot.head(&self.ready);
        bounds(&as_flight(release), first, seconds, &head, cameras)
            .into_iter()
            .find(|bound| (bound.left - ahead.left).abs() < 0.5 / cameras.rate)
    }
}

/// Returns true if this ball is the nearest of all balls to the prediction, at its exposure.
fn is_of(said: &TimedPrediction, ball: u64, flight: &[FlightSample], world: &World) -> bool {
    let Some(own) = said.distance(flight) else {
        return false;
    };
    let others = (0..).map_while(|other| world.true_flight(other).map(|flight| (other, flight)));
    own < SAME_BALL
        && others
            .filter(|(other, _)| *other != ball)
            .all(|(_, flight)| said.distance(&flight).is_none_or(|distance| distance > own))
}

/// Returns chosen plans for a trace, with times since the throw.
fn traced(chosen: &[(u64, PlanResult)], thrown_ns: u64) -> Vec<TracePlan> {
    let since = |t_ns: u64| (t_ns as f64 - thrown_ns as f64) * 1e-9;
    chosen
        .iter()
        .map(|(now_ns, plan)| TracePlan {
            t: since(*now_ns),
            arm: plan.request.arm as usize,
            cost: plan.cost,
            catch: since(plan.request.start_ns) + plan.t,
        })
        .collect()
}
