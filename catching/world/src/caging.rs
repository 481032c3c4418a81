//! Second judge: contact of balls with fingers and palm, and if the fingers cage a ball.
//!
//! A copy of each ball that comes near a hand moves on in steps of 0.1 ms among the palms and fingers of both hands.
//! The hands move as the true hands do and feel nothing; the fingers give way. A contact is an impulse with restitution
//! along the normal and Coulomb friction across it, one contact after the other, none of which can add energy.
//! The ball is *caged* if it stays inside the closing fingers for a set time. The first judge and the cameras do not
//! notice this copy.

use nalgebra::Vector3;
use tactnet_catching_packets::ARMS;

use crate::ball::{Aerodynamics, BallState};
use crate::fingers::{Basket, FINGERS, FingerPoint, Fingers, nearest};
use crate::robot::FrameMotion;

/// Distance between the centres of ball and catch frame within which contacts are simulated, in m.
pub(crate) const NEAR: f64 = 0.25;
/// Distance beyond which a ball has left, in m.
const LEFT: f64 = 0.35;
/// Maximum duration of the simulation of contacts, in ns.
const LONGEST_NS: u64 = 600_000_000;
/// Maximum number of passes over all contacts in a step.
const PASSES: usize = 8;
/// Normal speed below which a contact has no restitution, in m/s.
const SLOW: f64 = 0.1;
/// Penetration that is left alone, in m, and share of the rest that is corrected in a step.
const SLOP: f64 = 1e-4;
const CORRECTED: f64 = 0.1;
/// Moment of inertia of a solid ball, divided by `m R^2`.
const SOLID: f64 = 0.4;

/// Verdict of the second judge.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Cage {
    /// The ball stayed inside the closing fingers.
    Caged,
    /// The ball was between palm and finger tips and left again, or was never held.
    BouncedOut,
    /// The ball touched a hand and was never inside.
    Deflected,
    /// The ball touched no hand.
    Untouched,
}

/// Progress of the second judge with one ball.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Approach {
    /// Far from both hands.
    Far,
    Near(Copied),
    Ended(Cage),
}

/// Copy of a ball near the hands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Copied {
    pub(crate) state: BallState,
    /// Angular velocity, in rad/s.
    pub(crate) spin: Vector3<f64>,
    mass: f64,
    radius: f64,
    touched: bool,
    entered: bool,
    /// Duration of the simulation, and of the stay inside closing fingers, in ns.
    simulated_ns: u64,
    inside_ns: u64,
}

/// A place where ball and hand touch. Vectors are in the inertial frame.
struct Touch {
    arm: usize,
    /// Finger, `None` for the palm.
    finger: Option<usize>,
    /// Unit vector from the hand to the ball's centre.
    normal: Vector3<f64>,
    /// Velocity of the hand's point without the finger's motion, in m/s.
    carried: Vector3<f64>,
    /// Derivative of the finger's point by its closing coordinate, in m/rad.
    motion: Vector3<f64>,
    depth: f64,
}

impl Touch {
    /// Returns the finger, if it is free to turn in this direction.
    fn gives_way(&self, turn: f64, basket: &Basket, fingers: &Fingers) -> Option<usize> {
        self.finger.filter(|&finger| {
            // A finger that leaves its stop can be stopped.
            let leaves = fingers.rates[finger] * turn < 0.0;
            leaves || !basket.is_blocked(fingers.angles[finger], turn)
        })
    }
}

impl Copied {
    pub(crate) fn new(state: BallState, air: &Aerodynamics, mass: f64) -> Self {
        Self {
            state,
            spin: air.spin,
            mass,
            radius: air.radius,
            touched: false,
            entered: false,
            simulated_ns: 0,
            inside_ns: 0,
        }
    }

    /// Moves the ball for `h` seconds in the air, and resolves its contacts with both hands.
    pub(crate) fn step(
        &mut self,
        air: &Aerodynamics,
        h: f64,
        basket: &Basket,
        hands: &[FrameMotion; ARMS],
        fingers: &mut [Fingers; ARMS],
    ) {
        self.state = air.fly(&self.state, h);
        let mut touches: [Option<Touch>; ARMS * (1 + 3 * FINGERS)] = [const { None }; _];
        let mut count = 0;
        for (arm, hand) in hands.iter().enumerate() {
            if (self.state.position - hand.position).norm() > LEFT {
                continue;
            }
            let place = hand.rotation.transpose() * (self.state.position - hand.position);
            let mut look = |finger, found: FingerPoint, radius: f64| {
                let apart = place - found.point;
                let depth = self.radius + radius - apart.norm();
                if depth > 0.0 {
                    let normal = hand.rotation * apart.normalize();
                    let point = hand.rotation * found.point + normal * radius;
                    touches[count] = Some(Touch {
                        arm,
                        finger,
                        normal,
                        carried: hand.velocity + hand.rate.cross(&point),
                        motion: hand.rotation * found.motion,
                        depth,
                    });
                    count += 1;
                }
            };
            look(None, palm(basket, &place), 0.0);
            for finger in 0..FINGERS {
                let chain = basket.chain(finger, fingers[arm].angles[finger]);
                for ends in chain.windows(2) {
                    look(Some(finger), nearest(ends, &place), basket.config.radius);
                }
            }
        }
        self.touched |= count > 0;
        let touches = touches.iter().flatten();
        for _ in 0..PASSES {
            let mut approaching = false;
            for touch in touches.clone() {
                approaching |= self.collide(touch, basket, &mut fingers[touch.arm]);
            }
            if !approaching {
                break;
            }
        }
        for touch in touches {
            self.state.position += touch.normal * ((touch.depth - SLOP).max(0.0) * CORRECTED);
        }
    }

    /// Applies the impulses of a contact if ball and hand approach each other there, and returns true in that case.
    fn collide(&mut self, touch: &Touch, basket: &Basket, fingers: &mut Fingers) -> bool {
        let normal = &touch.normal;
        let speed = normal.dot(&self.slip(touch, fingers));
        if speed > -1e-9 {
            return false;
        }
        let restitution = match -speed > SLOW {
            true => basket.config.restitution,
            false => 0.0,
        };
        let give = self.give(touch, normal, basket, fingers);
        let pushed = -(1.0 + restitution) * speed / (1.0 / self.mass + give);
        self.push(touch, &(normal * pushed), basket, fingers);
        let slip = self.slip(touch, fingers);
        let slip = slip - normal * normal.dot(&slip);
        if let Some(direction) = (-slip).try_normalize(1e-9) {
            let give = self.give(touch, &direction, basket, fingers);
            let stuck = slip.norm() / ((1.0 + 1.0 / SOLID) / self.mass + give);
            let rubbed = direction * stuck.min(basket.config.friction * pushed);
            self.push(touch, &rubbed, basket, fingers);
        }
        true
    }

    /// Returns the velocity of the ball's surface relative to the hand's, in m/s.
    fn slip(&self, touch: &Touch, fingers: &Fingers) -> Vector3<f64> {
        let rate = touch.finger.map_or(0.0, |finger| fingers.rates[finger]);
        let arm = touch.normal * -self.radius;
        self.state.velocity + self.spin.cross(&arm) - touch.carried - touch.motion * rate
    }

    /// Returns the inverse mass of the hand in a direction in which it pushes the ball, in 1/kg.
    fn give(&self, touch: &Touch, to: &Vector3<f64>, basket: &Basket, fingers: &Fingers) -> f64 {
        let turn = touch.motion.dot(to);
        let free = touch.gives_way(-turn, basket, fingers);
        free.map_or(0.0, |_| turn * turn / basket.inertia)
    }

    /// Applies an impulse in N s to the ball, and its reaction to the finger.
    fn push(&mut self, touch: &Touch, by: &Vector3<f64>, basket: &Basket, fingers: &mut Fingers) {
        self.state.velocity += by / self.mass;
        let inertia = SOLID * self.mass * self.radius * self.radius;
        self.spin += (touch.normal * -self.radius).cross(by) / inertia;
        let turn = -touch.motion.dot(by);
        if let Some(finger) = touch.gives_way(turn, basket, fingers) {
            fingers.rates[finger] += turn / basket.inertia;
        }
    }

    /// Judges the ball after a tick of `tick_ns`.
    pub(crate) fn judge(
        &mut self,
        tick_ns: u64,
        basket: &Basket,
        hands: &[FrameMotion; ARMS],
        fingers: &[Fingers; ARMS],
    ) -> Option<Cage> {
        let inside = hands.iter().zip(fingers).find(|(hand, fingers)| {
            let place = hand.rotation.transpose() * (self.state.position - hand.position);
            place.xy().norm() < basket.config.base
                && (basket.palm_height()..basket.tips_height(fingers)).contains(&place.z)
        });
        self.entered |= inside.is_some();
        self.inside_ns = match inside {
            Some((_, fingers)) if fingers.closing => self.inside_ns + tick_ns,
            _ => 0,
        };
        self.simulated_ns += tick_ns;
        let left = |hand: &FrameMotion| (self.state.position - hand.position).norm() > LEFT;
        if self.inside_ns as f64 * 1e-9 >= basket.config.hold {
            return Some(Cage::Caged);
        }
        let ended = hands.iter().all(left) || self.simulated_ns >= LONGEST_NS;
        ended.then_some(match (self.entered, self.touched) {
            (true, _) => Cage::BouncedOut,
            (false, true) => Cage::Deflected,
            (false, false) => Cage::Untouched,
        })
    }
}

/// Returns the point of the palm that is nearest to a place.
fn palm(basket: &Basket, place: &Vector3<f64>) -> FingerPoint {
    let out = place.xy().norm();
    let inside = (basket.config.palm / out.max(1e-9)).min(1.0);
    FingerPoint {
        point: Vector3::new(place.x * inside, place.y * inside, basket.palm_height()),
        motion: Vector3::zeros(),
    }
}

#[cfg(test)]
mod tests;
