//! One throw in stepped time: world and stack tick by tick, with all delays.

use std::collections::VecDeque;
use std::time::Instant;

use tactnet_catching::coordinate::{CatchState, Coordinator, PlanRequest, Planned, Room};
use tactnet_catching::plan::{NoPlan, ObstacleConfig, PlanConditions, Planner, Surroundings};
use tactnet_catching_packets::packets::JointCommand;
use tactnet_catching_packets::{ARMS, JOINTS, joint};
use tactnet_catching_world::{FlightSample, TICK_NS, World};

use crate::ablation::Ablation;
use crate::bound::{Bound, bounds};
use crate::error::TrialError;
use crate::look::begin;
use crate::look_ahead::{AHEAD, LookAhead, SAME_BALL, TimedPrediction, as_flight, true_at};
use crate::perception::Perception;
use crate::stepped_time::{nanoseconds, ticks, world_seed};
use crate::throw_config::{Mapping, ThrowConfig};
use crate::throw_outcome::{AmongObstacles, BallOutcome, ThrowOutcome};
use crate::trace::{Trace, TracePlan};
use crate::watch::Watch;
use tactnet_catching::CatchSpace;

/// Standstill before the throw in s, in which the pose estimator determines the bias of the inertial unit.
const REST: f64 = 1.0;
/// Standstill after the robot has looked around in s, until the torso is at rest.
const REST_AFTER_LOOK: f64 = 2.5;
/// Maximum time after a throw until its verdict, in s.
const LONGEST: f64 = 2.5;

pub(crate) struct Answers {
    pub due_ns: u64,
    pub answers: Vec<Planned>,
}

/// A finished throw.
struct Finished<'a> {
    world: &'a World,
    perception: &'a Perception,
    coordinator: &'a Coordinator,
    said: &'a [TimedPrediction],
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
        self.simulate(seed, number, ready, oracle, None)
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
        let outcome = self.simulate(seed, number, ready, oracle, Some(&mut trace))?;
        Ok((outcome, trace))
    }

    fn simulate(
        &self,
        seed: u64,
        number: u64,
        ready: &[f64; JOINTS],
        oracle: &CatchSpace,
        mut trace: Option<&mut Trace>,
    ) -> Result<ThrowOutcome, TrialError> {
        let seed = world_seed(seed, number);
        let corrections = self.corrections();
        let known = corrections.robot();
        let start = corrections.sensors(ready);
        let (mut world, looked) = begin(self, seed, &start)?;
        let ready = &match self.mapping {
            Mapping::Off => *ready,
            Mapping::Blind | Mapping::Depth => looked.joints,
        };
        let rest = match self.mapping {
            Mapping::Off => REST,
            Mapping::Blind | Mapping::Depth => REST_AFTER_LOOK,
        };
        let mut perception = Perception::new(self, seed)?;
        let planners = self.planners(known);
        let mut coordinator = Coordinator::new(known.clone(), self.coordination(), *ready);
        if let Some(field) = &looked.field {
            let apart = ObstacleConfig::default().hard;
            coordinator.stay_in(Room::new(known, field.clone(), apart));
        }
        if let Some(trace) = &mut trace {
            trace.field.clone_from(&looked.field);
            trace.boxes = world.boxes().to_vec();
        }
        let (mut obstructed, mut first_plan) = (0, None);
        let mut answers: VecDeque<Answers> = VecDeque::new();
        let mut said: Vec<TimedPrediction> = Vec::new();
        let first_tick = world.time_ns() / TICK_NS;
        let (rest_ticks, ticks) = (first_tick + ticks(rest), first_tick + ticks(rest + LONGEST));
        let ahead_ns = nanoseconds(self.timing.drives);
        let mut watch = self.watch.then(|| Watch::new(&self.robot, ready));
        for tick in first_tick..ticks {
            let now_ns = tick * TICK_NS;
            if tick == rest_ticks {
                world.throw(self.balls);
            }
            let since = (tick - first_tick) as f64 * 1e-3 - rest;
            while let Some(due) = answers.pop_front_if(|answer| answer.due_ns <= now_ns) {
                coordinator.planned(&due.answers);
                if let Some(trace) = &mut trace {
                    trace.plans.extend(
                        due.answers
                            .iter()
                            .filter_map(|answer| carried_out(answer, &coordinator, since)),
                    );
                }
            }
            while let Some(seen) = perception.predictions(now_ns)? {
                said.extend(seen.said());
                let requests = coordinator.predictions(now_ns, &seen.predictions, &seen.chest);
                let begun = Instant::now();
                let asked: Vec<Planned> = requests
                    .iter()
                    .flatten()
                    .map(|request| {
                        let among = looked.field.as_deref().map(|field| Surroundings {
                            field,
                            chest: coordinator.chest_way(request.start_ns),
                        });
                        let near = !self.is_without(Ablation::NearMiss);
                        answer(&planners, request, among.as_ref(), near)
                    })
                    .collect();
                if !asked.is_empty() {
                    first_plan.get_or_insert_with(|| begun.elapsed().as_secs_f64());
                    let none = |answer: &&Planned| answer.plan == Err(NoPlan::Obstructed);
                    obstructed += asked.iter().filter(none).count() as u64;
                    answers.push_back(Answers {
                        due_ns: now_ns + nanoseconds(self.timing.to_path()),
                        answers: asked,
                    });
                }
            }
            // For the time at which the command takes effect.
            let (q, dq) = coordinator.tick(now_ns + ahead_ns);
            let command = JointCommand {
                number: tick,
                command_ns: now_ns,
                q,
                dq,
            };
            if let Some(watch) = &mut watch {
                watch.look(&command, since);
            }
            let mut hands = *coordinator.hands();
            for hand in hands.iter_mut().flatten() {
                hand.catch_ns = hand
                    .catch_ns
                    .saturating_add_signed((self.closing_error * 1e9) as i64);
            }
            let sensed = *world.step(&corrections.command(&command), &hands);
            if let Some(trace) = trace.as_mut().filter(|_| tick >= rest_ticks) {
                trace.tick(since, &self.robot, &world.truth(), &command, &sensed);
            }
            perception.sense(
                &sensed,
                &world.truth(),
                coordinator.state() == CatchState::Armed,
            )?;
            if tick > rest_ticks && world.verdicts().len() == self.balls {
                break;
            }
        }
        let braked =
            watch.and_then(|watch| watch.end(&mut coordinator, world.time_ns() + ahead_ns));
        let balls = (0..self.balls as u64)
            .map(|ball| {
                let run = Finished {
                    world: &world,
                    perception: &perception,
                    coordinator: &coordinator,
                    said: &said,
                };
                self.outcome(&run, ball, ready, oracle)
            })
            .collect();
        Ok(ThrowOutcome {
            number,
            balls,
            no_plans: coordinator.no_plans(),
            obstacles: (self.mapping != Mapping::Off).then(|| AmongObstacles {
                contacts: *world.contacts(),
                obstructed,
                arms_held_up: (0..ARMS)
                    .filter(|arm| {
                        let own = joint::ARM[*arm].clone();
                        ready[own] != self.robot.ready(*arm)
                    })
                    .count(),
                look_seconds: looked.seconds,
                plan_seconds: first_plan,
            }),
            braked,
        })
    }

    fn outcome(
        &self,
        run: &Finished<'_>,
        ball: u64,
        ready: &[f64; JOINTS],
        oracle: &CatchSpace,
    ) -> BallOutcome {
        let Finished {
            world,
            perception,
            coordinator,
            said,
        } = run;
        let flight = world.true_flight(ball).unwrap_or_default();
        let reaction = self.timing.reaction(self.robot.description().cameras.rate);
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
        let target = |arm: usize| coordinator.target(arm).map(|(number, _)| number);
        let ahead = predictions
            .iter()
            .rfind(|prediction| prediction.left >= AHEAD)
            .copied();
        let bound = ahead
            .zip(catch)
            .and_then(|(ahead, (at_ns, _))| self.bound(&ahead, flight.first()?, at_ns, ready));
        BallOutcome {
            arms: oracle.arms_of(flight.iter().map(as_flight), reaction, ready),
            tracked: !own.is_empty(),
            planned: own
                .iter()
                .any(|said| (0..ARMS).any(|arm| target(arm) == Some(said.prediction.ball))),
            ahead,
            bound,
            predictions,
            verdict,
        }
    }

    fn bound(
        &self,
        ahead: &LookAhead,
        release: &FlightSample,
        catch_ns: u64,
        ready: &[f64; JOINTS],
    ) -> Option<Bound> {
        let cameras = &self.robot.description().cameras;
        let seconds = (catch_ns - release.t_ns) as f64 * 1e-9;
        let first = (seconds - ahead.left).rem_euclid(1.0 / cameras.rate);
        let head = self.robot.chest(ready) * self.robot.head(ready);
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

fn carried_out(answer: &Planned, coordinator: &Coordinator, since: f64) -> Option<TracePlan> {
    let plan = answer.plan.ok()?;
    let (ball, _) = coordinator.target(answer.request.arm)?;
    (ball == answer.request.ball).then_some(TracePlan {
        t: since,
        arm: answer.request.arm,
        cost: plan.cost,
        catch: since + plan.t,
    })
}

pub(crate) fn answer(
    planners: &[Planner; ARMS],
    request: &PlanRequest,
    among: Option<&Surroundings<'_>>,
    near: bool,
) -> Planned {
    let planner = &planners[request.arm];
    let conditions = PlanConditions {
        surroundings: among.copied(),
        last: request.last,
        ..PlanConditions::default()
    };
    let plan = planner.plan(&request.catch, &conditions, || false);
    Planned {
        request: *request,
        plan: plan.or_else(|no_plan| {
            if !near {
                return Err(no_plan);
            }
            let miss = planner.plan(&request.catch, &conditions.nearest_miss(), || false);
            // With a map, the reason of the exact plan is reported.
            miss.map_err(|missed| if among.is_some() { no_plan } else { missed })
        }),
    }
}
