//! Contacts of the robot with obstacles, computed from the true state at the end of every tick.

use crate::kinematics::{BODIES, Place};
use crate::obstacles::StandingBox;
use crate::shape::{CAPSULES, Capsule};

/// A contact of a part of the robot with a box.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contact {
    /// Time, in ns.
    pub at_ns: u64,
    /// Name of the robot's part.
    pub part: &'static str,
    /// Index of the box in the settings.
    pub obstacle: usize,
    /// Penetration depth, in m.
    pub depth_m: f64,
}

/// Summary of all contacts so far.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Contacts {
    /// Number of ticks with a contact.
    pub ticks: u64,
    /// First contact.
    pub first: Option<Contact>,
    /// Deepest contact.
    pub deepest: Option<Contact>,
}

impl Contacts {
    pub(crate) fn take(&mut self, contact: Contact) {
        self.ticks += 1;
        self.first.get_or_insert(contact);
        let stays = |deepest: &Contact| contact.depth_m <= deepest.depth_m;
        self.deepest = self.deepest.filter(stays).or(Some(contact));
    }
}

/// Returns the deepest contact of the robot with any box.
pub(crate) fn deepest(
    at_ns: u64,
    capsules: &[Capsule; CAPSULES],
    places: &[Place; BODIES],
    boxes: &[StandingBox],
) -> Option<Contact> {
    let mut deepest: Option<Contact> = None;
    for capsule in capsules {
        let placed = capsule.placed(places);
        for (obstacle, standing) in boxes.iter().enumerate() {
            if standing.distance(&placed.middle()) > placed.reach() {
                continue;
            }
            let depth_m = placed.radius - standing.distance_of_segment(&placed.ends);
            if depth_m > 0.0 && deepest.is_none_or(|deepest| depth_m > deepest.depth_m) {
                deepest = Some(Contact {
                    at_ns,
                    part: capsule.part,
                    obstacle,
                    depth_m,
                });
            }
        }
    }
    deepest
}

/// Returns true if the distance between a box and the robot is at least the given one, in m.
pub(crate) fn is_clear_of(
    standing: &StandingBox,
    capsules: &[Capsule; CAPSULES],
    places: &[Place; BODIES],
    apart: f64,
) -> bool {
    capsules.iter().all(|capsule| {
        let placed = capsule.placed(places);
        standing.distance_of_segment(&placed.ends) > placed.radius + apart
    })
}

#[cfg(test)]
mod tests {
    use tactnet_catching_packets::packets::JointCommand;
    use tactnet_catching_packets::{ARMS, RobotDescription};

    use super::*;
    use crate::pose::ready;
    use crate::{BoxConfig, ObstaclesConfig, World, WorldConfig};

    fn with_box(middle: [f64; 3], size: [f64; 3]) -> World {
        let config = WorldConfig {
            obstacles: ObstaclesConfig {
                boxes: vec![BoxConfig {
                    turn: 0.3,
                    ..BoxConfig::fixed(middle, size)
                }],
            },
            ..WorldConfig::default()
        };
        World::new(&RobotDescription::nominal(), &config, 1, &ready()).unwrap()
    }

    fn stand(world: &mut World, ticks: u64) {
        for _ in 0..ticks {
            world.step(&JointCommand::still(ready()), &[None; ARMS]);
        }
    }

    #[test]
    fn a_hand_in_a_box_touches_it_and_one_beside_it_does_not() {
        let mut world = with_box([10.0; 3], [0.1; 3]);
        stand(&mut world, 1);
        let hand = world.truth().hands[0].position;
        let place = |x: f64| [hand.x + x, hand.y, hand.z];
        let mut touching = with_box(place(0.06), [0.2; 3]);
        stand(&mut touching, 5);
        let contacts = touching.contacts();
        assert_eq!(contacts.ticks, 5);
        let first = contacts.first.unwrap();
        assert_eq!((first.at_ns, first.obstacle), (1_000_000, 0));
        assert!(["finger", "palm"].contains(&first.part), "{first:?}");
        assert!(first.depth_m > 0.0 && first.depth_m < 0.2);
        let mut beside = with_box(place(0.35), [0.1; 3]);
        stand(&mut beside, 5);
        assert_eq!(*beside.contacts(), Contacts::default());
    }

    #[test]
    fn a_ball_that_meets_a_box_is_missed() {
        // A wall in front of the robot.
        let mut world = with_box([1.5, 0.0, 1.5], [0.1, 6.0, 3.0]);
        world.throw(1);
        stand(&mut world, 2000);
        let [verdict] = world.verdicts() else {
            panic!("one verdict")
        };
        assert!(!verdict.caught());
        let flight = world.true_flight(0).unwrap();
        assert!(flight.iter().all(|sample| sample.state.position.x > 1.4));
        assert!(world.truth().balls.iter().all(Option::is_none));
    }

    #[test]
    fn what_is_put_elsewhere_stays_away_from_the_robot() {
        let config = WorldConfig {
            obstacles: ObstaclesConfig::table_and_box(),
            ..WorldConfig::default()
        };
        for seed in 0..20 {
            let mut world =
                World::new(&RobotDescription::nominal(), &config, seed, &ready()).unwrap();
            world.rearrange();
            stand(&mut world, 2);
            assert_eq!(world.contacts().ticks, 0);
        }
    }
}
