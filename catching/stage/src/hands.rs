//! Balls in the hands in real time. A hand holds a ball until it is explored, thrown back, or a timeout ends.

use tactnet_catching_packets::packets::{HandOpening, ThrowPath};
use tactnet_catching_world::{FlightSample, Released, World};

use crate::judge::Over;

/// Maximum number of samples of a flight.
const LONGEST: usize = 3000;

/// A ball that a hand holds.
pub(crate) struct Held {
    pub arm: usize,
    /// Result that is published once the ball is explored.
    pub over: Option<Over>,
    /// End of the timeout, in ns.
    pub until_ns: u64,
}

/// A ball that was thrown back.
#[derive(Debug, Clone)]
pub(crate) struct Thrown {
    /// Number of the throw, counted from 1.
    pub number: u64,
    /// Planned throw.
    pub path: ThrowPath,
    pub released: Released,
    /// Flight from the hand to the floor.
    pub flight: Vec<FlightSample>,
    /// Offset from the world's time to the host's, in ns.
    pub epoch_ns: u64,
}

/// Tracks the balls that leave the hands.
#[derive(Debug, Default)]
pub(crate) struct Letting {
    /// Time at which the last ball left, in ns of the world's clock.
    left_ns: Option<u64>,
    /// Latest planned throw.
    pub path: Option<ThrowPath>,
    /// Ball that was thrown back and is in the air.
    pub away: Option<Thrown>,
    /// Number of balls that were thrown back.
    pub thrown: u64,
}

impl Letting {
    /// Advances the flights of released balls by a tick. Returns a ball that was thrown back and has landed.
    ///
    /// - `epoch_ns`: offset from the world's time to the host's, in ns
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
                    open_ns: path.open_ns.saturating_sub(epoch_ns),
                };
                world.opened() == Some(&opening)
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
    use tactnet_catching_packets::ARMS;
    use tactnet_catching_packets::packets::JointCommand;
    use tactnet_catching_world::{TICK_NS, WorldConfig};

    use super::*;

    const EPOCH_NS: u64 = 5_000_000_000;

    /// Simulates a hand at rest with a release at 5.2 s. The command is repeated every 4 ms until `last_ms`.
    fn told_until(last_ms: u64) -> (Option<Thrown>, World) {
        let robot = Robot::nominal();
        let mut config = WorldConfig::default();
        config.release.jitter = 0.0;
        let mut world = World::new(robot.description(), &config, 1, &robot.waiting()).unwrap();
        world.give(1).unwrap();
        let opening = HandOpening {
            arm: 1,
            open_ns: 200 * TICK_NS + 300_000,
        };
        let stay = JointCommand::still(robot.waiting());
        let mut path = ThrowPath::zeroed();
        (path.arm, path.open_ns) = (1, EPOCH_NS + opening.open_ns);
        let mut letting = Letting {
            path: Some(path),
            ..Letting::default()
        };
        for ms in 0..1500 {
            if ms % 4 == 0 && (100..=last_ms).contains(&ms) {
                world.tell_opening(&opening);
            }
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

    /// As after a braking of the robot, or when the thrower was killed.
    #[test]
    fn a_hand_that_is_not_told_any_more_keeps_its_ball() {
        let (thrown, world) = told_until(160);
        assert!(thrown.is_none());
        assert_eq!(world.holding(), [false, true]);
    }
}
