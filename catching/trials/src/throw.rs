//! One throw in stepped time: world and stack tick by tick, with all delays.

use tactnet_catching::CatchSpace;
use tactnet_catching_packets::packets::{ControllerMode, PlanResult};
use tactnet_catching_packets::{ARMS, JOINTS, joint};
use tactnet_catching_world::{FlightSample, TICK_NS, World};

use crate::bound::{Bound, bounds};
use crate::error::TrialError;
use crate::look::{Looked, begin};
use crate::look_ahead::{AHEAD, LookAhead, SAME_BALL, TimedPrediction, as_flight, true_at};
use crate::stepped_stack::{StepObserver, SteppedStack};
use crate::stepped_time::{ticks, world_seed};
use crate::throw_config::{Mapping, ThrowConfig};
use crate::throw_outcome::{AmongObstacles, BallOutcome, ThrowOutcome};
use crate::trace::{Trace, TracePlan};
use crate::watch::{Braked, Watch};

/// Standstill before the throw in s, in which the pose estimator determines the bias of the inertial unit.
const REST: f64 = 1.0;
/// Standstill after the robot has looked around in s, until the torso is at rest.
const REST_AFTER_LOOK: f64 = 2.5;
/// Maximum time after a throw until its verdict, in s.
const LONGEST: f64 = 2.5;
/// Maximum time after a throw until the robot is back in its waiting pose, in s.
const LONGEST_BACK: f64 = 20.0;

/// World and stack during a throw.
struct SimulatedThrow<'a> {
    config: &'a ThrowConfig,
    world: World,
    /// Result of looking around.
    looked: Looked,
    /// Joint positions before the throw.
    ready: [f64; JOINTS],
    stack: SteppedStack,
    watching: Watching<'a>,
}

/// Observers of a throw.
#[derive(Default)]
struct Watching<'a> {
    trace: Option<&'a mut Trace>,
    steps: Option<&'a mut StepObserver<'a>>,
}

impl ThrowConfig {
    /// Simulates throw `number` of a series.
    ///
    /// # Errors
    /// Invalid settings of the world or the stack.
    pub fn run(
        &self,
        seed: u64,
        number: u64,
        ready: &[f64; JOINTS],
        oracle: &CatchSpace,
    ) -> Result<ThrowOutcome, TrialError> {
        self.simulate(seed, number, ready, oracle, Watching::default())
    }

    /// Simulates a throw and returns the trace of its ticks.
    ///
    /// # Errors
    /// Same as [`ThrowConfig::run`].
    pub fn trace(
        &self,
        seed: u64,
        number: u64,
        ready: &[f64; JOINTS],
        oracle: &CatchSpace,
    ) -> Result<(ThrowOutcome, Trace), TrialError> {
        let mut trace = Trace::default();
        let watching = Watching {
            trace: Some(&mut trace),
            steps: None,
        };
        let outcome = self.simulate(seed, number, ready, oracle, watching)?;
        Ok((outcome, trace))
    }

    /// Simulates a throw and calls `steps` after each step of the coordinator.
    ///
    /// # Errors
    /// Same as [`ThrowConfig::run`].
    pub fn observe(
        &self,
        seed: u64,
        number: u64,
        ready: &[f64; JOINTS],
        oracle: &CatchSpace,
        steps: &mut StepObserver<'_>,
    ) -> Result<ThrowOutcome, TrialError> {
        let watching = Watching {
            trace: None,
            steps: Some(steps),
        };
        self.simulate(seed, number, ready, oracle, watching)
    }

    fn simulate<'a>(
        &'a self,
        seed: u64,
        number: u64,
        ready: &[f64; JOINTS],
        oracle: &CatchSpace,
        watching: Watching<'a>,
    ) -> Result<ThrowOutcome, TrialError> {
        let mut throw = SimulatedThrow::new(self, world_seed(seed, number), ready, watching)?;
        let braked = throw.run();
        Ok(ThrowOutcome {
            number,
            balls: (0..self.balls as u64)
                .map(|ball| throw.outcome(ball, oracle))
                .collect(),
            no_plans: throw.stack.no_plans(),
            obstacles: (self.mapping != Mapping::Off).then(|| throw.among_obstacles()),
            stops: throw.stack.safety().brakes(),
            braked,
        })
    }
}

impl<'a> SimulatedThrow<'a> {
    /// Creates the world and lets the robot look around if required.
    fn new(
        config: &'a ThrowConfig,
        seed: u64,
        ready: &[f64; JOINTS],
        mut watching: Watching<'a>,
    ) -> Result<Self, TrialError> {
        let (world, looked) = begin(config, seed, &config.corrections().sensors(ready))?;
        let ready = match config.mapping {
            Mapping::Off => *ready,
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
        let mut watch = config.watch.then(Watch::default);
        let longest = if config.watch { LONGEST_BACK } else { LONGEST };
        for tick in first_tick..rest_ticks + ticks(longest) {
            if tick == rest_ticks {
                self.world.throw(config.balls);
            }
            let since = (tick - first_tick) as f64 * 1e-3 - rest;
            let steps = self.watching.steps.as_deref_mut();
            let mut commands = self.stack.step(tick * TICK_NS, steps);
            let (command, mode) = (&commands.joints, self.stack.mode());
            if let Some(watch) = &mut watch {
                let safety = self.stack.safety();
                watch.look(safety, command, &commands.verdict, mode, since);
            }
            for hand in commands.hands.iter_mut().flatten() {
                let late_ns = (config.closing_error * 1e9) as i64;
                hand.catch_ns = hand.catch_ns.saturating_add_signed(late_ns);
            }
            let sensed = *self.world.step(command, &commands.hands);
            let truth = self.world.truth();
            let trace = self.watching.trace.as_mut();
            if let Some(trace) = trace.filter(|_| tick >= rest_ticks) {
                trace.tick(since, &config.robot, &truth, command, &sensed);
            }
            self.stack.sense(&sensed, &truth);
            let judged = tick > rest_ticks && self.world.verdicts().len() == config.balls;
            if judged && (watch.is_none() || mode == Some(ControllerMode::Ready)) {
                break;
            }
        }
        if let Some(trace) = &mut self.watching.trace {
            trace.plans = traced(&self.stack.chosen, rest_ticks * TICK_NS);
        }
        watch.and_then(|watch| watch.braked)
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
        let SteppedStack {
            perception, said, ..
        } = &self.stack;
        let flight = world.true_flight(ball).unwrap_or_default();
        let reaction = config
            .timing
            .reaction(config.robot.description().cameras.rate);
        let verdict = world
            .verdicts()
            .iter()
            .find(|verdict| verdict.ball == ball)
            .copied();
        let catch = verdict
            .and_then(|verdict| verdict.crossing)
            .and_then(|crossing| Some((crossing.at_ns, true_at(&flight, crossing.at_ns)?)));
        let own: Vec<&TimedPrediction> = said
            .iter()
            .filter(|said| is_of(said, ball, &flight, world))
            .collect();
        let predictions: Vec<LookAhead> = catch.map_or_else(Vec::new, |(at_ns, there)| {
            let aligned = perception.alignment(at_ns);
            own.iter()
                .filter(|said| said.exposure_ns < at_ns)
                .map(|said| said.judge(&aligned, at_ns, &there.p, &there.v))
                .collect()
        });
        let ahead = predictions
            .iter()
            .rfind(|prediction| prediction.left >= AHEAD)
            .copied();
        let bound = ahead
            .zip(catch)
            .and_then(|(ahead, (at_ns, _))| self.bound(&ahead, flight.first()?, at_ns));
        BallOutcome {
            arms: oracle.arms_of(flight.iter().map(as_flight), reaction, &self.ready),
            tracked: !own.is_empty(),
            planned: own
                .iter()
                .any(|said| self.stack.reached_for(said.prediction.ball)),
            ahead,
            bound,
            predictions,
            verdict,
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
