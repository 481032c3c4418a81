//! Judge: determines the outcome of a throw, the arms that could have caught it, and the landing point of a ball that
//! was thrown back.

use std::sync::mpsc::Receiver;

use nalgebra::Vector3;
use tactnet_catching::flight::{DRAG, Flight};
use tactnet_catching::{CatchSpace, ChainDelays, Robot};
use tactnet_catching_packets::packets::{CatchOutcome, FeltMaterial, Text, ThrownBack};
use tactnet_catching_packets::{ARMS, JOINTS};
use tactnet_catching_roles::channels::{CATCH_OUTCOME, THROW_OUTCOME};
use tactnet_catching_world::{FlightSample, Verdict, down_to};
use tactnet_channel::Bus;

use crate::StageError;
use crate::hands::Thrown;

pub(crate) struct Over {
    pub throw: u64,
    pub verdict: Verdict,
    /// Flight of the ball as if no hand had caught it.
    pub flight: Vec<FlightSample>,
    /// Offset from the world's time to the host's, in ns.
    pub epoch_ns: u64,
    /// True material of a caught ball, if it is explored.
    pub material: Option<String>,
    /// Predicted material.
    pub felt: Option<FeltMaterial>,
}

pub(crate) enum Judged {
    Over(Box<Over>),
    Thrown(Box<Thrown>),
}

/// Judges flights until the sender is dropped.
pub(crate) fn judge(
    bus: &Bus,
    robot: &Robot,
    ready: &[f64; JOINTS],
    lower_body: bool,
    throws: &Receiver<Judged>,
) -> Result<(), StageError> {
    let (outcomes, backs) = (CATCH_OUTCOME.put(bus)?, THROW_OUTCOME.put(bus)?);
    let oracle = CatchSpace::new(robot, lower_body);
    // The catch space of stepped time applies here, too, so that rates are comparable.
    let reaction = ChainDelays::ours().reaction(robot.description().cameras.rate);
    for judged in throws {
        match judged {
            Judged::Over(over) => {
                let flight = over.flight.iter().map(|sample| {
                    Flight::without_spin(sample.state.position, sample.state.velocity, DRAG)
                });
                let arms = oracle.arms_of(flight, reaction, ready);
                outcomes.put_copy(&[outcome(&over, arms)])?;
            }
            Judged::Thrown(thrown) => {
                backs.put_copy(&[thrown_back(&thrown)])?;
            }
        }
    }
    Ok(())
}

fn thrown_back(thrown: &Thrown) -> ThrownBack {
    let (path, start) = (&thrown.path, &thrown.released.state);
    let target = Vector3::from(path.target);
    let places = thrown.flight.iter().map(|sample| sample.state.position);
    let nearest = || {
        places.min_by(|a, b| {
            let beside = |p: &Vector3<f64>| (p - target).norm();
            beside(a).total_cmp(&beside(b))
        })
    };
    let came_down = down_to(&thrown.flight, target.z)
        .map(|place| Vector3::new(place.x, place.y, target.z))
        .or_else(nearest)
        .unwrap_or(start.position);
    ThrownBack {
        number: thrown.number,
        grip: path.grip,
        arm: path.arm,
        open_ns: path.open_ns,
        left_ns: thrown.released.at_ns + thrown.epoch_ns,
        target: path.target,
        came_down: came_down.into(),
        miss: (came_down - target).norm(),
        speed: start.velocity.norm(),
        length: (came_down - start.position).xy().norm(),
    }
}

fn outcome(over: &Over, arms: [bool; ARMS]) -> CatchOutcome {
    let verdict = &over.verdict;
    let crossing = verdict.crossing.as_ref();
    let (felt, first) = (over.felt.as_ref(), over.flight.first());
    CatchOutcome {
        throw: over.throw,
        ball: verdict.ball,
        release_ns: first.map_or(0, |sample| sample.t_ns + over.epoch_ns),
        crossing_ns: crossing.map_or(0, |crossing| crossing.at_ns + over.epoch_ns),
        across: crossing.map_or(0.0, |crossing| crossing.across_m),
        along: crossing.map_or(0.0, |crossing| crossing.along_s.unwrap_or(0.0)),
        angle: crossing.map_or(0.0, |crossing| crossing.angle),
        caught: u32::from(verdict.caught()),
        cause: verdict.miss.map_or(0, |miss| miss as u32),
        arms: u32::from(arms[0]) + 2 * u32::from(arms[1]),
        arm: crossing.map_or(0, |crossing| crossing.arm as u32),
        material: Text::new(over.material.as_deref().unwrap_or_default()),
        felt: felt.map_or_else(Text::default, |felt| felt.material),
        posterior: felt.map_or(0.0, |felt| felt.posterior),
        sweeps: felt.map_or(0, |felt| felt.sweeps),
        reserved: 0,
    }
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;
    use tactnet_catching_packets::packets::ThrowPath;
    use tactnet_catching_world::{BallState, FlightSample, Released};

    use super::*;

    /// Returns a ball on a parabola from a height of 1 m, with 3 m/s ahead and 4 m/s up.
    fn thrown(target: [f64; 3]) -> Thrown {
        let state = |t: f64| BallState {
            position: Vector3::new(3.0 * t, 0.1, 1.0 + 4.0 * t - 5.0 * t * t),
            velocity: Vector3::new(3.0, 0.0, 4.0 - 10.0 * t),
        };
        let flight = (0..1000).map(|i| FlightSample {
            t_ns: i * 1_000_000,
            state: state(1e-3 * i as f64),
        });
        Thrown {
            number: 2,
            path: ThrowPath {
                arm: 1,
                target,
                ..ThrowPath::zeroed()
            },
            released: Released {
                arm: 1,
                at_ns: 70,
                state: state(0.0),
                spin: Vector3::zeros(),
                drag: 0.47,
            },
            flight: flight.collect(),
            epoch_ns: 1000,
        }
    }

    #[test]
    fn a_ball_comes_down_to_its_targets_height_and_one_that_stays_below_is_measured_where_it_was_nearest()
     {
        // The ball is at 1.2 m again after 0.746 s.
        let down = thrown_back(&thrown([2.2, 0.0, 1.2]));
        let [x, y, z] = down.came_down;
        assert!((x - 2.239).abs() < 1e-3 && y == 0.1 && z == 1.2, "{x}");
        let off = down.miss - 0.039_f64.hypot(0.1);
        assert!(off.abs() < 1e-3, "{off}");
        assert_eq!((down.speed, down.left_ns, down.number), (5.0, 1070, 2));
        assert!((down.length - x).abs() < 1e-9);
        // Its apex is at a height of 1.8 m, 1.2 m ahead.
        let below = thrown_back(&thrown([1.2, 0.1, 2.8]));
        assert!((below.miss - 1.0).abs() < 1e-3, "{}", below.miss);
    }
}
