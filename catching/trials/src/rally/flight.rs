//! Flights of a game for drawings.

use tactnet_catching_world::FlightSample;

/// Number of points of a kept flight.
const POINTS: usize = 60;

/// A throw of a game.
#[derive(Debug, Clone, PartialEq)]
pub struct RallyFlight {
    /// Number of the game.
    pub game: u64,
    /// Throwing arm: 0 left, 1 right.
    pub arm: usize,
    /// True if the ball was caught.
    pub caught: bool,
    /// True flight down to the height of the target: horizontal distance from the release and height, in m. For an
    /// earlier catch, the flight continues as if the ball were missed.
    pub path: Vec<[f64; 2]>,
}

/// Returns a flight from the side, down to a height.
pub(super) fn profile(flight: &[FlightSample], height: f64) -> Vec<[f64; 2]> {
    let Some(first) = flight.first() else {
        return Vec::new();
    };
    let mut highest = f64::NEG_INFINITY;
    let all: Vec<[f64; 2]> = flight
        .iter()
        .take_while(|sample| {
            let p = sample.state.position;
            highest = highest.max(p.z);
            // The flight may start below the height and rise first.
            p.z >= height || highest < height
        })
        .map(|sample| {
            let p = sample.state.position;
            [(p - first.state.position).xy().norm(), p.z]
        })
        .collect();
    let every = all.len().div_ceil(POINTS).max(1);
    let kept = all.iter().enumerate();
    kept.filter(|(i, _)| i % every == 0 || i + 1 == all.len())
        .map(|(_, point)| *point)
        .collect()
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use tactnet_catching_world::BallState;

    use super::*;

    /// Balls on a parabola, from below the height until they are below it again.
    #[test]
    fn profiles_end_where_the_ball_comes_down_to_the_height() {
        let flight: Vec<FlightSample> = (0..1000)
            .map(|i| {
                let t = 1e-3 * f64::from(i);
                FlightSample {
                    t_ns: 0,
                    state: BallState {
                        position: Vector3::new(1.0 + 3.0 * t, 4.0 * t, 1.0 + 4.0 * t - 5.0 * t * t),
                        velocity: Vector3::zeros(),
                    },
                }
            })
            .collect();
        let path = profile(&flight, 1.2);
        assert!(path.len() <= POINTS + 1 && path[0] == [0.0, 1.0]);
        // The height is 1.2 m again after 0.746 s, at 5 m/s.
        let [far, high] = *path.last().unwrap();
        assert!((far - 3.73).abs() < 0.01, "{far}");
        assert!((high - 1.2).abs() < 0.01, "{high}");
        assert!(profile(&[], 1.0).is_empty());
    }
}
