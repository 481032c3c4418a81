use nalgebra::Matrix3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::ball::{BALL_STEP, BallConfig};
use crate::fingers::FingersConfig;

/// A ball before a hand at the origin whose axis points up, without air.
#[derive(Clone, Copy)]
struct Drop {
    position: [f64; 3],
    velocity: [f64; 3],
    /// Start of closing in s, if the hand closes.
    closes: Option<f64>,
    /// Velocity of the hand and of the observer, in m/s.
    moving: [f64; 3],
    h: f64,
}

/// A ball on the axis at 7 m/s whose centre crosses the plane of the open finger tips after [`CROSSING`].
const ALONG_THE_AXIS: Drop = Drop {
    position: [0.0, 0.0, 0.24],
    velocity: [0.0, 0.0, -7.0],
    closes: None,
    moving: [0.0; 3],
    h: BALL_STEP,
};
const CROSSING: f64 = 0.2 / 7.0;

impl Drop {
    fn at(self, aside: f64, late: f64) -> Self {
        Self {
            position: [aside, 0.0, 0.24],
            closes: Some(CROSSING + late),
            ..self
        }
    }

    /// Returns the verdict, and the ball after each step with the energy of ball and fingers before and after it, in J.
    fn run(&self) -> (Cage, Vec<(Copied, [f64; 2])>) {
        let basket = Basket::new(&FingersConfig::default());
        let config = BallConfig {
            air: 0.0,
            ..BallConfig::default()
        };
        let air = Aerodynamics::new(&config, 0.5, Vector3::zeros());
        let moving = Vector3::from(self.moving);
        let state = BallState {
            position: self.position.into(),
            velocity: Vector3::from(self.velocity) + moving,
        };
        let mut ball = Copied::new(state, &air, config.mass);
        let mut fingers = [Fingers::default(); ARMS];
        let mut steps = Vec::new();
        let a_tick = (1e-3 / self.h).round() as usize;
        for step in 1.. {
            let t = step as f64 * self.h;
            let at = |position| FrameMotion {
                velocity: moving,
                ..FrameMotion::still(position, Matrix3::identity())
            };
            let hands = [at(moving * t), at(Vector3::x() * 50.0)];
            fingers[0].closing = self.closes.is_some_and(|closes| closes <= t);
            basket.drive(&mut fingers[0], self.h);
            let before = energy(&ball, &basket, &fingers[0]);
            ball.step(&air, self.h, &basket, &hands, &mut fingers);
            steps.push((ball, [before, energy(&ball, &basket, &fingers[0])]));
            basket.turn(&mut fingers[0], self.h);
            if step % a_tick == 0
                && let Some(cage) = ball.judge(1_000_000, &basket, &hands, &fingers)
            {
                return (cage, steps);
            }
        }
        unreachable!("the judge ends")
    }
}

fn energy(ball: &Copied, basket: &Basket, fingers: &Fingers) -> f64 {
    let turning = SOLID * ball.radius.powi(2) * ball.spin.norm_squared();
    let kinetic = 0.5 * ball.mass * (ball.state.velocity.norm_squared() + turning);
    let rates = fingers.rates.iter().map(|rate| rate * rate);
    let height = ball.state.position.z;
    kinetic + ball.mass * crate::GRAVITY * height + 0.5 * basket.inertia * rates.sum::<f64>()
}

/// Returns random balls from the front, up to 6 cm off the axis and 30 degrees against it.
fn drops(count: usize) -> Vec<Drop> {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut even = |most: f64| most * (2.0 * rng.random::<f64>() - 1.0);
    let drops = (0..count).map(|_| {
        let lean = [even(2.5), even(2.5)];
        let aside = lean.map(|lean| even(0.042) - lean * CROSSING);
        Drop {
            position: [aside[0], aside[1], 0.24],
            velocity: [lean[0], lean[1], -7.0],
            closes: Some(CROSSING + even(0.03)),
            ..ALONG_THE_AXIS
        }
    });
    drops.collect()
}

#[test]
fn fingers_cage_a_ball_if_they_close_when_it_crosses_their_tips() {
    for (aside, late, cage) in [
        (0.0, 0.0, Cage::Caged),
        (0.0, -0.005, Cage::Caged),
        (0.015, 0.0, Cage::Caged),
        (0.0, 0.04, Cage::BouncedOut),
        (0.0, -0.04, Cage::Deflected),
        (0.06, 0.0, Cage::Deflected),
        (0.06, 1.0, Cage::Deflected),
    ] {
        let found = ALONG_THE_AXIS.at(aside, late).run().0;
        assert_eq!(found, cage, "{aside} m aside, {late} s late");
    }
    let beside = ALONG_THE_AXIS.at(0.2, 0.0).run().0;
    assert_eq!(beside, Cage::Untouched);
}

#[test]
fn contacts_never_add_energy() {
    for drop in drops(200) {
        for (_, [before, after]) in drop.run().1 {
            // The correction of penetrations lifts the ball by less than 0.1 mm: 5e-5 J.
            assert!(after < before + 5e-5, "{before} J, then {after} J");
        }
    }
}

/// Impulses of a sphere on a plane: `(1 + e) m v` along the normal, and across it what stops the slip, `m u / 3.5`, or
/// friction.
#[test]
fn a_bounce_on_the_palm_follows_restitution_and_friction() {
    let config = FingersConfig::default();
    let (e, friction) = (config.restitution, config.friction);
    for aside in [0.0, 0.2, 2.0] {
        let drop = Drop {
            position: [-0.0018 * aside, 0.0, -0.0555],
            velocity: [aside, 0.0, -0.5],
            ..ALONG_THE_AXIS
        };
        let (_, steps) = drop.run();
        let bounce = steps.iter().position(|(ball, _)| ball.touched).unwrap();
        let [before, after] = [&steps[bounce - 1].0, &steps[bounce].0];
        let down = before.state.velocity.z - crate::GRAVITY * BALL_STEP;
        assert!((after.state.velocity.z + e * down).abs() < 1e-9);
        let slowed = (aside / 3.5).min(-friction * (1.0 + e) * down);
        assert!((aside - after.state.velocity.x - slowed).abs() < 1e-9);
        assert!((after.spin.y - slowed / (SOLID * 0.0425)).abs() < 1e-6);
    }
}

#[test]
fn half_the_step_changes_few_verdicts() {
    let drops = drops(300);
    let with = |h: f64| drops.iter().map(move |drop| Drop { h, ..*drop }.run().0);
    let cages: Vec<Cage> = with(BALL_STEP).collect();
    let pairs = cages.iter().zip(with(BALL_STEP / 2.0));
    let changed = pairs.filter(|(one, other)| *one != other).count();
    assert!(changed <= 9, "{changed} of {}", drops.len());
    let caged = cages.iter().filter(|one| **one == Cage::Caged).count();
    assert!((60..240).contains(&caged), "{caged}: the drops are no test");
}

#[test]
fn equal_balls_move_equally_and_a_common_velocity_changes_nothing() {
    for drop in drops(20) {
        let (cage, steps) = drop.run();
        assert_eq!((cage, &steps), (drop.run().0, &drop.run().1));
        let moving = [0.5, -0.3, 0.25];
        let (carried, _) = Drop { moving, ..drop }.run();
        assert_eq!(carried, cage);
    }
}
