//! Balls in hands, and their release.

use tactnet_catching_packets::ARMS;
use tactnet_catching_packets::packets::HandOpening;

use super::{BALL_STEPS, FlightSample, TICK_NS, World, touches};
use crate::ball::{Aerodynamics, BALL_STEP, BallState};
use crate::error::WorldError;
use crate::release::{Held, OPENING_NS, Released, TOLD_NS};
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
            return Err(WorldError::Hand { arm });
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

    /// Takes an opening command of a hand. The fingers begin to open in the last tick that still releases the ball on
    /// time, if the command was repeated shortly before. An empty or unknown hand ignores it.
    pub fn tell_opening(&mut self, opening: &HandOpening) {
        if self.opened != Some(*opening) {
            self.told = Some((*opening, self.time_ns));
        }
    }

    /// Returns the last executed opening command.
    pub fn opened(&self) -> Option<&HandOpening> {
        self.opened.as_ref()
    }

    /// Starts to open the hand whose command is due.
    pub(super) fn open(&mut self) {
        let now_ns = self.time_ns;
        let due = |told: &mut (HandOpening, u64)| now_ns + OPENING_NS + TICK_NS > told.0.open_ns;
        let Some((opening, told_ns)) = self.told.take_if(due) else {
            return;
        };
        if now_ns - told_ns > TOLD_NS {
            return;
        }
        self.opened = Some(opening);
        let arm = usize::try_from(opening.arm).unwrap_or(usize::MAX);
        if let Some(held) = self.held.get_mut(arm).and_then(Option::as_mut) {
            let (config, open_ns) = (&self.config.release, opening.open_ns);
            held.open(now_ns, open_ns, config, self.seed, self.releases);
            self.releases += 1;
        }
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
        self.hold(air, self.time_ns, release);
    }
}

/// Returns a ball after the given number of seconds.
fn flown(air: &Aerodynamics, from: BallState, seconds: f64) -> BallState {
    let steps = (seconds / BALL_STEP).ceil().max(1.0);
    (0..steps as usize).fold(from, |state, _| air.fly(&state, seconds / steps))
}
