//! What hands hold in real time: until it has been felt, until it is thrown back, or until nobody waits any longer.

use tactnet_catching_packets::packets::{HandOpening, ThrowPath};
use tactnet_catching_world::{FlightSample, OPENING_NS, OpenCommand, Released, TICK_NS, World};

use crate::judge::Over;

/// Fingers begin to open only if they were told to within so long before, ns.
const TOLD_NS: u64 = 25_000_000;
/// Samples of a flight.
const LONGEST: usize = 3000;

/// A ball that a hand holds.
pub(crate) struct Held {
    pub arm: usize,
    /// What is to be told once it has been felt.
    pub over: Option<Over>,
    /// Nobody waits for longer.
    pub until_ns: u64,
}

/// A ball that was thrown back.
#[derive(Debug, Clone)]
pub(crate) struct Thrown {
    /// Counted from 1.
    pub number: u64,
    /// What was meant.
    pub path: ThrowPath,
    pub released: Released,
    /// From the hand to the floor.
    pub flight: Vec<FlightSample>,
    /// Adds to the world's time to make it the host's.
    pub epoch_ns: u64,
}

/// Opens hands in time, and follows what leaves them.
#[derive(Debug, Default)]
pub(crate) struct Letting {
    /// The newest word, with the time at which it came.
    told: Option<(HandOpening, u64)>,
    /// The one that was carried out last.
    opened: Option<HandOpening>,
    /// When the last ball left, by the world's clock.
    left_ns: Option<u64>,
    /// What was planned last.
    path: Option<ThrowPath>,
    away: Option<Thrown>,
    /// Balls that were thrown back.
    pub thrown: u64,
}

impl Letting {
    /// Takes what the thrower means to do.
    pub fn plan(&mut self, path: &ThrowPath) {
        self.path = Some(*path);
    }

    /// Takes a hand's release.
    pub fn tell(&mut self, now_ns: u64, opening: &HandOpening) {
        if self.opened != Some(*opening) {
            self.told = Some((*opening, now_ns));
        }
    }

    /// Returns true while a ball is in the air.
    pub fn is_away(&self) -> bool {
        self.away.is_some()
    }

    /// Begins to open a hand in the last tick in which it lets go in time.
    ///
    /// - `epoch_ns`: adds to the world's time to make it the host's
    pub fn open(&mut self, world: &mut World, epoch_ns: u64) {
        let now_ns = world.time_ns() + epoch_ns;
        let due = |told: &mut (HandOpening, u64)| now_ns + OPENING_NS + TICK_NS > told.0.open_ns;
        let Some((opening, told_ns)) = self.told.take_if(due) else {
            return;
        };
        if now_ns.saturating_sub(told_ns) > TOLD_NS {
            return;
        }
        self.opened = Some(opening);
        // A hand that holds nothing opens in vain.
        let _ = world.open(&OpenCommand {
            arm: usize::try_from(opening.arm).unwrap_or(usize::MAX),
            open_ns: opening.open_ns.saturating_sub(epoch_ns),
        });
    }

    /// Lets what has left a hand in the last tick fly; returns a ball that was thrown back and has come down.
    pub fn follow(&mut self, world: &mut World, epoch_ns: u64) -> Option<Thrown> {
        let left = world
            .released()
            .filter(|released| self.left_ns != Some(released.at_ns))
            .copied();
        if let Some(released) = left {
            self.left_ns = Some(released.at_ns);
            world.let_fly();
            let meant = |path: &ThrowPath| {
                let opening = HandOpening {
                    arm: path.arm,
                    open_ns: path.open_ns,
                };
                self.opened == Some(opening)
            };
            if let Some(path) = self.path.filter(meant) {
                self.thrown += 1;
                let mut flight = Vec::with_capacity(LONGEST);
                flight.push(FlightSample {
                    t_ns: released.at_ns,
                    state: released.state,
                });
                self.away = Some(Thrown {
                    number: self.thrown,
                    path,
                    released,
                    flight,
                    epoch_ns,
                });
            }
        }
        let away = self.away.as_mut()?;
        match world.flying() {
            Some(ball) if away.flight.len() < LONGEST => {
                away.flight.push(FlightSample {
                    t_ns: world.time_ns(),
                    state: *ball,
                });
                None
            }
            _ => self.away.take(),
        }
    }
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;
    use tactnet_catching::Robot;
    use tactnet_catching_packets::packets::JointCommand;
    use tactnet_catching_packets::{ARMS, JOINTS, RobotDescription};
    use tactnet_catching_world::WorldConfig;

    use super::*;

    const EPOCH_NS: u64 = 5_000_000_000;

    /// A hand that stands, is told so every 4 ms until a time, and lets go at 5.2 s.
    fn told_until(last_ms: u64) -> (Option<Thrown>, World) {
        let robot = Robot::new(RobotDescription::nominal());
        let mut config = WorldConfig::default();
        config.release.jitter = 0.0;
        let mut world = World::new(robot.description(), &config, 1, &robot.waiting()).unwrap();
        world.give(1).unwrap();
        let opening = HandOpening {
            arm: 1,
            open_ns: EPOCH_NS + 200 * TICK_NS + 300_000,
        };
        let stay = JointCommand {
            number: 0,
            command_ns: 0,
            q: robot.waiting(),
            dq: [0.0; JOINTS],
        };
        let mut letting = Letting::default();
        letting.plan(&ThrowPath {
            arm: 1,
            open_ns: opening.open_ns,
            ..ThrowPath::zeroed()
        });
        for ms in 0..1500 {
            if ms % 4 == 0 && (100..=last_ms).contains(&ms) {
                letting.tell(EPOCH_NS + ms * TICK_NS, &opening);
            }
            letting.open(&mut world, EPOCH_NS);
            world.step(&stay, &[None; ARMS]);
            if let Some(thrown) = letting.follow(&mut world, EPOCH_NS) {
                return (Some(thrown), world);
            }
        }
        (None, world)
    }

    #[test]
    fn a_hand_lets_go_in_time_and_its_ball_is_followed_to_the_floor() {
        let (thrown, world) = told_until(200);
        let thrown = thrown.unwrap();
        assert_eq!(thrown.number, 1);
        let meant = thrown.path.open_ns - EPOCH_NS;
        assert_eq!(thrown.released.at_ns, meant);
        let last = thrown.flight.last().unwrap();
        assert!(last.state.position.z < 0.1, "{last:?}");
        assert_eq!(world.holding(), [false; ARMS]);
        let same = world.flight_of(&thrown.released);
        assert!(same.len().abs_diff(thrown.flight.len()) <= 2);
    }

    /// The robot has braked, or the thrower was killed.
    #[test]
    fn a_hand_that_is_not_told_any_more_keeps_its_ball() {
        let (thrown, world) = told_until(160);
        assert!(thrown.is_none());
        assert_eq!(world.holding(), [false, true]);
    }
}
