//! Two robots play catch (thesis, section 3.5.4): each throws back the balls that it has caught.
//!
//! The robots face each other in separate worlds. Only the ball passes between them, with its true position, velocity
//! and rotation at the release. Before the games, each arm of each robot practises: the catcher reports the landing
//! point according to its tracker, and the thrower corrects its aim. The torso oscillates during a throw, so the
//! first balls fall short.

mod catching;
mod flight;
mod page;
mod player;

use std::collections::BTreeMap;

use nalgebra::{Rotation3, Vector2, Vector3};
use serde::{Deserialize, Serialize};
use tactnet_catching::throw::{ThrowPlan, ThrowPlanConfig};
use tactnet_catching::throw_back::ThrowBack;
use tactnet_catching::{CatchSpace, Robot};
use tactnet_catching_packets::checks::{all, from_to};
use tactnet_catching_packets::{ARMS, RobotDescription};
use tactnet_catching_world::{BallState, Released, WorldConfig, down_to};

use crate::error::TrialError;
use crate::parallel::on_all_cores;
use crate::stepped_time::world_seed;
use crate::throw_config::ThrowConfig;
pub use flight::RallyFlight;
use flight::profile;
pub use page::rally_page;
pub(crate) use player::Player;
use tactnet_plot::wilson_of_counts;

tactnet_catching_packets::settings! {
    /// Settings of two robots that play catch.
    #[derive(Debug, Clone, PartialEq, Deserialize)] #[serde(deny_unknown_fields, default)]
    pub struct RallyConfig {
        /// Distance between the robots' axes, in m.
        pub distance: f64 = 5.0,
        /// Target of throws in the catcher's frame, in m.
        pub target: [f64; 3] = [0.5, 0.4, 1.2],
        /// Distance of the wheels from the centre of the platform, which turns in throws, in m. `None`: the vertical
        /// axis of the torso turns with its own limits.
        pub wheels: Option<f64> = None,
        /// Settings of the planner of throws.
        pub throws: ThrowPlanConfig = ThrowPlanConfig::default(),
        /// Number of practice throws of each arm before the games.
        pub practice: usize = 4,
        /// Share of the observed error by which the next aim is corrected.
        pub gain: f64 = 0.8,
        /// Maximum number of catches per game.
        pub most: usize = 100,
    }
}

/// A set of games.
#[derive(Debug, Clone)]
pub struct Rally {
    /// Settings.
    pub config: RallyConfig,
    /// Robot, the same for both sides.
    pub robot: Robot,
    /// Settings of the worlds.
    pub world: WorldConfig,
    /// Number of games.
    pub rallies: usize,
    /// Seed of all random numbers.
    pub seed: u64,
}

/// Result of the games.
#[derive(Debug, Clone, Serialize)]
pub struct RallyReport {
    /// Number of games.
    pub rallies: usize,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Distance between the robots, in m.
    pub between_m: f64,
    /// Maximum number of consecutive catches.
    pub longest: usize,
    /// Mean number of consecutive catches over games.
    pub mean: f64,
    /// Number of caught balls.
    pub catches: usize,
    /// Number of thrown balls.
    pub throws: usize,
    /// Number of games that ended because no throw was possible.
    pub no_throws: usize,
    /// Catches per throw.
    pub rate: f64,
    /// Lower end of the 95 % Wilson interval of the rate.
    pub ci95_low: f64,
    /// Upper end of the interval.
    pub ci95_high: f64,
    /// Number of throws in the catch space.
    pub in_catch_space: usize,
    /// Number of caught throws in the catch space.
    pub caught_in_catch_space: usize,
    /// Mean length of the true flights down to the height of the target, in m.
    pub distance_m: Option<f64>,
    /// Mean loss of distance of the planned throws if the fingers open 2 ms early or late, whichever is larger, in
    /// mm.
    pub distance_lost_mm_at_2ms: Option<f64>,
    /// Mean displacement of the landing point in that case, in mm.
    pub displaced_mm_at_2ms: Option<f64>,
    /// Root mean square distance of the true landing points from the target, in mm.
    pub beside_mm_rms: Option<f64>,
    /// Number of missed balls, by cause.
    pub causes: BTreeMap<String, usize>,
    /// Number of games without a possible throw, by cause.
    pub no_throw_causes: BTreeMap<String, usize>,
    /// Number of catches of each game.
    pub lengths: Vec<usize>,
    /// First throws of the first games.
    #[serde(skip)]
    pub flights: Vec<RallyFlight>,
}

/// A throw of a game.
#[derive(Debug, Clone, Copy)]
struct Exchange {
    caught: bool,
    cause: &'static str,
    in_catch_space: bool,
    distance: f64,
    beside: f64,
    /// Loss of distance and displacement for fingers that open 2 ms early or late, in m.
    at_2ms: [f64; 2],
}

#[derive(Debug, Clone, Default)]
struct Game {
    exchanges: Vec<Exchange>,
    no_throw: Option<String>,
    flights: Vec<RallyFlight>,
}

impl Rally {
    /// Practises, then plays all games on all cores. `done` is called after every throw of a game. The result does
    /// not depend on the number of cores.
    ///
    /// # Errors
    /// Invalid settings, or a target that no throw reaches.
    pub fn run(&self, done: impl Fn() + Sync) -> Result<RallyReport, TrialError> {
        self.check()?;
        let oracle = CatchSpace::new(&self.robot, true);
        let learnt = self.practise(&oracle)?;
        let games = on_all_cores(0..self.rallies, |number| {
            self.play(number as u64, &learnt, &oracle, &done)
        })?;
        Ok(self.report(&games))
    }

    fn check(&self) -> Result<(), TrialError> {
        let RallyConfig {
            distance,
            target,
            gain,
            ..
        } = &self.config;
        let far = |x: f64| x.is_finite() && x > 1.5;
        all("distance", distance, "more than 1.5 m", far)?;
        let near = |x: f64| x.is_finite() && target[0] < distance - 0.5;
        let expected = "a place nearer to the catcher than to the thrower";
        all("target", target, expected, near)?;
        from_to([0.0, 1.5], "0 to 1.5")("gain", gain)?;
        from_to([1.0, f64::MAX], "1 or more")("most", &self.config.most)?;
        Ok(())
    }

    fn player(&self, seed: u64) -> Result<Player, TrialError> {
        let config = ThrowConfig::new(self.robot.clone(), self.world.clone());
        let description = with_turn(self.robot.description(), self.config.wheels)?;
        let throws = ThrowBack {
            at: Some(self.across(&self.config.target.into()).into()),
            tries: 1,
            planner: self.config.throws,
            ..ThrowBack::default()
        };
        Player::new(&config, &description, throws, seed)
    }

    /// Returns a point of one robot's frame in the other's.
    fn across(&self, p: &Vector3<f64>) -> Vector3<f64> {
        Vector3::new(self.config.distance - p.x, -p.y, p.z)
    }

    fn handed_over(&self, released: &Released) -> Released {
        let half_turn = Rotation3::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI);
        Released {
            state: BallState {
                position: self.across(&released.state.position),
                velocity: half_turn * released.state.velocity,
            },
            spin: half_turn * released.spin,
            ..*released
        }
    }

    /// Returns the learnt offsets of the aim, by robot and arm.
    fn practise(&self, oracle: &CatchSpace) -> Result<[[[f64; 3]; ARMS]; 2], TrialError> {
        let sides = on_all_cores(0..2 * ARMS, |number| {
            let arm = number % ARMS;
            let seed = |side: usize| world_seed(self.seed, PRACTICE + (2 * number + side) as u64);
            let mut players = [self.player(seed(0))?, self.player(seed(1))?];
            let mut before = [0.0; 3];
            for number in 0..self.config.practice {
                let [thrower, catcher] = &mut players;
                thrower.world.give(arm)?;
                let throw = match thrower.throw(arm) {
                    // No throw is possible with this offset, so the previous aim stays.
                    Err(TrialError::Throw(_)) if number > 0 => {
                        thrower.thrower().settings.beside[arm] = before;
                        break;
                    }
                    throw => throw?,
                };
                before = thrower.thrower().settings.beside[arm];
                let released = self.handed_over(&throw.released);
                let catch = catcher.catch(&released, &self.config.target, oracle)?;
                if let Some(beside) = catch.beside {
                    // The catcher looks in the opposite direction.
                    let aim = &mut thrower.thrower().settings.beside[arm];
                    aim[0] += beside.x * self.config.gain;
                    aim[1] += beside.y * self.config.gain;
                }
                (0..ARMS).for_each(|arm| catcher.world.take(arm));
                thrower.rest()?;
            }
            Ok(players[0].thrower().settings.beside[arm])
        })?;
        Ok([0, 1].map(|side| std::array::from_fn(|arm| sides[side * ARMS + arm])))
    }

    fn play(
        &self,
        number: u64,
        learnt: &[[[f64; 3]; ARMS]; 2],
        oracle: &CatchSpace,
        done: &(impl Fn() + Sync),
    ) -> Result<Game, TrialError> {
        let seed = |side: u64| world_seed(self.seed, 2 * number + side);
        let mut players = [self.player(seed(0))?, self.player(seed(1))?];
        for (player, learnt) in players.iter_mut().zip(learnt) {
            player.thrower().settings.beside = *learnt;
        }
        let [x, y, height] = self.config.target;
        let target = Vector2::new(x, y);
        let mut game = Game::default();
        let mut arm = (number % ARMS as u64) as usize;
        let mut thrower = 0;
        players[thrower].world.give(arm)?;
        for _ in 0..self.config.most {
            let throw = match players[thrower].throw(arm) {
                Ok(throw) => throw,
                Err(error @ (TrialError::Throw(_) | TrialError::NotThrown { .. })) => {
                    game.no_throw = Some(error.to_string());
                    break;
                }
                Err(error) => return Err(error),
            };
            let catcher = &mut players[1 - thrower];
            let released = self.handed_over(&throw.released);
            let catch = catcher.catch(&released, &self.config.target, oracle)?;
            let flight = catcher.world.flight_of(&released);
            let robot = &players[thrower].throwing;
            let begin = released.state.position.xy();
            let down = down_to(&flight, height).unwrap_or(begin);
            game.exchanges.push(Exchange {
                caught: catch.arm.is_some(),
                cause: catch.cause,
                in_catch_space: catch.in_catch_space,
                distance: (down - begin).norm(),
                beside: (down - target).norm(),
                at_2ms: lost(&throw.plan, robot, height),
            });
            if number < GAMES_KEPT && game.flights.len() < THROWS_KEPT {
                game.flights.push(RallyFlight {
                    game: number,
                    arm: throw.plan.arm,
                    caught: catch.arm.is_some(),
                    path: profile(&flight, height),
                });
            }
            done();
            let Some(with) = catch.arm else {
                break;
            };
            arm = with;
            thrower = 1 - thrower;
        }
        Ok(game)
    }

    fn report(&self, games: &[Game]) -> RallyReport {
        let all: Vec<&Exchange> = games.iter().flat_map(|game| &game.exchanges).collect();
        let catches = all.iter().filter(|exchange| exchange.caught).count();
        let lengths: Vec<usize> = games
            .iter()
            .map(|game| game.exchanges.iter().filter(|one| one.caught).count())
            .collect();
        let mut causes = BTreeMap::new();
        for exchange in all.iter().filter(|exchange| !exchange.caught) {
            *causes.entry(exchange.cause.to_string()).or_insert(0) += 1;
        }
        let mut no_throw_causes = BTreeMap::new();
        for why in games.iter().filter_map(|game| game.no_throw.as_ref()) {
            *no_throw_causes.entry(why.clone()).or_insert(0) += 1;
        }
        let mean = |of: &dyn Fn(&Exchange) -> f64| {
            let sum: f64 = all.iter().map(|exchange| of(exchange)).sum();
            (!all.is_empty()).then(|| sum / all.len() as f64)
        };
        let [ci95_low, ci95_high] = wilson_of_counts(catches, all.len());
        let possible = || all.iter().filter(|exchange| exchange.in_catch_space);
        RallyReport {
            rallies: games.len(),
            seed: self.seed,
            between_m: self.config.distance,
            longest: lengths.iter().copied().max().unwrap_or(0),
            mean: catches as f64 / games.len().max(1) as f64,
            catches,
            throws: all.len(),
            no_throws: no_throw_causes.values().sum(),
            rate: catches as f64 / all.len().max(1) as f64,
            ci95_low,
            ci95_high,
            in_catch_space: possible().count(),
            caught_in_catch_space: possible().filter(|exchange| exchange.caught).count(),
            distance_m: mean(&|exchange| exchange.distance),
            distance_lost_mm_at_2ms: mean(&|exchange| exchange.at_2ms[0] * 1e3),
            displaced_mm_at_2ms: mean(&|exchange| exchange.at_2ms[1] * 1e3),
            beside_mm_rms: mean(&|exchange| exchange.beside.powi(2)).map(|mean| mean.sqrt() * 1e3),
            causes,
            no_throw_causes,
            lengths,
            flights: games.iter().flat_map(|game| game.flights.clone()).collect(),
        }
    }
}

/// Number of games whose flights are kept.
const GAMES_KEPT: u64 = 4;
const THROWS_KEPT: usize = 2;

/// Offset of the numbers of practice worlds, beyond those of the games.
const PRACTICE: u64 = 1 << 32;

/// Returns a robot's description with the limits of a platform that turns on wheels `wheels` m from its centre. The
/// vertical axis of the torso, in the same place, represents it. The thesis gives the platform's speed, 1.4 m/s; at
/// 0.4 m that is 200 deg/s. `None` leaves the description unchanged.
pub(crate) fn with_turn(
    description: &RobotDescription,
    wheels: Option<f64>,
) -> Result<RobotDescription, TrialError> {
    let mut description = description.clone();
    let Some(wheels) = wheels else {
        return Ok(description);
    };
    from_to([0.1, 2.0], "0.1 to 2 m")("wheels", &wheels)?;
    let platform = description.platform.joint;
    let turn = &mut description.torso.joints[0];
    turn.speed = platform.speed / wheels;
    turn.acceleration = platform.acceleration / wheels;
    Ok(description)
}

/// Returns the loss of distance and the displacement of a planned flight in m if the fingers open 2 ms early or late,
/// whichever is larger.
pub(crate) fn lost(plan: &ThrowPlan, robot: &Robot, height: f64) -> [f64; 2] {
    let mut worst = [0.0f64; 2];
    let flown = plan.landing.p - plan.p;
    let heading = flown.xy() / flown.xy().norm();
    for late in [-2e-3, 2e-3] {
        if let Some(landing) = plan.released_late(robot, late, height) {
            let moved = (landing.p - plan.landing.p).xy();
            worst[0] = worst[0].max(-moved.dot(&heading));
            worst[1] = worst[1].max(moved.norm());
        }
    }
    worst
}

#[cfg(test)]
mod tests;
