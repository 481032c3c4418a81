//! Balls in hands, and their release.

use tactnet_catching_packets::ARMS;

use super::{BALL_STEPS, FlightSample, Phase, Thrown, World, touches};
use crate::ball::{Aerodynamics, BALL_STEP, BallState};
use crate::error::WorldError;
use crate::judge::Crossings;
use crate::release::{Held, OpenCommand, Released};
use crate::stream::Stream;

/// A ball that has left a hand and flies in this world without being judged.
#[derive(Debug, Clone, Copy)]
pub(super) struct Away {
    pub number: u64,
    pub state: BallState,
    air: Aerodynamics,
}

impl World {
    /// Puts a ball into an empty hand, with the drag of the next ball's number. A caught ball is in the hand
    /// automatically.
    ///
    /// # Errors
    /// Unknown arm, or a hand that already holds a ball.
    pub fn give(&mut self, arm: usize) -> Result<(), WorldError> {
        let number = self.thrown.len() as u64;
        let air = Aerodynamics::draw(&self.config.ball, &mut Stream::Ball.rng(self.seed, number));
        let held = self.held.get_mut(arm).ok_or(WorldError::Arm { arm })?;
        if held.is_some() {
            return Err(WorldError::Hand {
                arm,
                expected: "nothing",
                found: "a ball",
            });
        }
        *held = Some(Held::new(air.coefficient));
        Ok(())
    }

    /// Removes the ball from a hand, if there is one.
    pub fn take(&mut self, arm: usize) {
        if let Some(held) = self.held.get_mut(arm) {
            *held = None;
        }
    }

    /// Returns true for each hand that holds a ball.
    pub fn holding(&self) -> [bool; ARMS] {
        self.held.map(|held| held.is_some())
    }

    /// Sets the release time of a hand; only the first command counts.
    ///
    /// # Errors
    /// Unknown arm, or a hand without a ball.
    pub fn open(&mut self, command: &OpenCommand) -> Result<(), WorldError> {
        let OpenCommand { arm, open_ns } = *command;
        let held = self.held.get_mut(arm).ok_or(WorldError::Arm { arm })?;
        let held = held.as_mut().ok_or(WorldError::Hand {
            arm,
            expected: "a ball",
            found: "nothing",
        })?;
        held.open(
            self.time_ns,
            open_ns,
            &self.config.release,
            self.seed,
            self.releases,
        );
        self.releases += 1;
        Ok(())
    }

    /// Returns the ball that was released last.
    pub fn released(&self) -> Option<&Released> {
        self.released.as_ref()
    }

    /// Returns the flight of a released ball, as [`World::true_flight`] does.
    pub fn flight_of(&self, released: &Released) -> Vec<FlightSample> {
        let air = Aerodynamics::new(&self.config.ball, released.drag, released.spin);
        self.flight(released.at_ns, &released.state, &air)
    }

    /// Lets the last released ball fly in this world. Cameras see it, but it is not judged; it disappears when it
    /// touches the floor or a box. Call this in the tick of the release, because the ball has already flown since.
    pub fn let_fly(&mut self) {
        self.away = self.released.map(|released| {
            let air = Aerodynamics::new(&self.config.ball, released.drag, released.spin);
            let ago = self.time_ns.saturating_sub(released.at_ns) as f64 * 1e-9;
            Away {
                // Far from the numbers of thrown balls.
                number: u64::MAX - self.releases,
                state: flown(&air, released.state, ago),
                air,
            }
        });
    }

    /// Returns the ball of [`World::let_fly`] while it is in the air.
    pub fn flying(&self) -> Option<&BallState> {
        self.away.as_ref().map(|away| &away.state)
    }

    pub(super) fn fly_on(&mut self) {
        let (boxes, radius) = (&self.boxes, self.config.ball.radius);
        self.away = self.away.and_then(|mut away| {
            for _ in 0..BALL_STEPS {
                away.state = away.air.fly(&away.state, BALL_STEP);
            }
            let stops = away.state.position.z <= radius || touches(boxes, &away.state, radius);
            (!stops).then_some(away)
        });
    }

    /// Adds a ball that was released `ago` seconds earlier, given in this world's inertial frame. Its number follows
    /// the last one.
    ///
    /// # Panics
    /// Same as [`World::throw`].
    pub fn launch(&mut self, released: &Released, ago: f64) {
        self.take_away_missed(1);
        let air = Aerodynamics::new(&self.config.ball, released.drag, released.spin);
        let release = flown(&air, released.state, ago);
        self.thrown.push(Thrown {
            number: self.thrown.len() as u64,
            air,
            release_ns: self.time_ns,
            release,
            state: release,
            crossings: Crossings::default(),
            phase: Phase::Held,
        });
        self.verdicts.reserve(self.thrown.len());
    }
}

/// Returns a ball after the given number of seconds.
fn flown(air: &Aerodynamics, from: BallState, seconds: f64) -> BallState {
    let steps = (seconds / BALL_STEP).ceil().max(1.0);
    (0..steps as usize).fold(from, |state, _| air.fly(&state, seconds / steps))
}
