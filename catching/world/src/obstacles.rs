//! Obstacles: upright boxes, rotated about the vertical.

use nalgebra::Vector3;
use rand::RngExt;
use serde::{Deserialize, Serialize};

use crate::error::{WorldError, from_to};
use crate::stream::Stream;

/// Maximum number of boxes.
pub(crate) const MOST_BOXES: usize = 16;
/// Maximum number of draws for a place without collision with the robot.
const DRAWS: u64 = 64;

/// Settings of the obstacles; none by default.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ObstaclesConfig {
    /// Boxes.
    pub boxes: Vec<BoxConfig>,
}

/// A box in the inertial frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BoxConfig {
    /// Centre, in m.
    pub middle: [f64; 3],
    /// Edge lengths, in m.
    pub size: [f64; 3],
    /// Rotation about the vertical, in rad.
    #[serde(default)]
    pub turn: f64,
    /// Maximum displacement of the centre along x, y and z, in m; drawn uniformly at each rearrangement.
    #[serde(default)]
    pub drawn: [f64; 3],
    /// Maximum additional rotation, in rad; drawn in the same way.
    #[serde(default)]
    pub drawn_turn: f64,
}

impl BoxConfig {
    /// Returns a box that is not moved, with edges along the axes.
    pub fn fixed(middle: [f64; 3], size: [f64; 3]) -> Self {
        Self {
            middle,
            size,
            turn: 0.0,
            drawn: [0.0; 3],
            drawn_turn: 0.0,
        }
    }
}

impl ObstaclesConfig {
    /// Returns a table next to the robot's left arm, and a box on or next to it with a new place at each
    /// rearrangement.
    pub fn table_and_box() -> Self {
        Self {
            boxes: vec![
                BoxConfig::fixed([0.55, 1.1, 0.77], [0.9, 0.7, 0.04]),
                BoxConfig {
                    drawn: [0.2, 0.15, 0.0],
                    drawn_turn: 0.8,
                    ..BoxConfig::fixed([0.65, 0.85, 0.99], [0.25, 0.25, 0.4])
                },
            ],
        }
    }

    pub(crate) fn check(&self) -> Result<(), WorldError> {
        let limits = [0.0, MOST_BOXES as f64];
        from_to(limits, "at most 16 boxes")("obstacles.boxes", &self.boxes.len())?;
        for shape in &self.boxes {
            let turns = [shape.turn, shape.drawn_turn];
            from_to([-100.0, 100.0], "-100 to 100 m")("obstacles.boxes.middle", &shape.middle)?;
            from_to([0.0, 10.0], "0 to 10 m")("obstacles.boxes.drawn", &shape.drawn)?;
            from_to([1e-3, 100.0], "0.001 to 100 m")("obstacles.boxes.size", &shape.size)?;
            from_to([-10.0, 10.0], "-10 to 10 rad")("obstacles.boxes.turn", &turns)?;
        }
        Ok(())
    }

    /// Draws the places of all boxes for a given number of rearrangements. `is_free` returns true for an allowed
    /// place.
    pub(crate) fn place(
        &self,
        seed: u64,
        rearrangements: u64,
        is_free: impl Fn(&StandingBox) -> bool,
    ) -> Vec<StandingBox> {
        let boxes = self.boxes.iter().enumerate();
        boxes
            .map(|(number, shape)| {
                let index = rearrangements << 8 | number as u64;
                let mut rng = Stream::Obstacles.rng(seed, index);
                let mut draw = || {
                    let mut even = || rng.random::<f64>() * 2.0 - 1.0;
                    let middle = std::array::from_fn(|i| shape.middle[i] + shape.drawn[i] * even());
                    let turn = shape.turn + shape.drawn_turn * even();
                    StandingBox::new(middle, shape.size, turn)
                };
                let mut place = draw();
                for _ in 0..DRAWS {
                    if is_free(&place) {
                        break;
                    }
                    place = draw();
                }
                place
            })
            .collect()
    }
}

/// A box at its current place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StandingBox {
    /// Centre, in m.
    pub middle: [f64; 3],
    /// Edge lengths, in m.
    pub size: [f64; 3],
    /// Rotation about the vertical, in rad.
    pub turn: f64,
    sin_cos: [f64; 2],
}

impl StandingBox {
    fn new(middle: [f64; 3], size: [f64; 3], turn: f64) -> Self {
        Self {
            middle,
            size,
            turn,
            sin_cos: [turn.sin(), turn.cos()],
        }
    }

    /// Returns a direction in the frame of the box.
    fn turned(&self, d: &Vector3<f64>) -> Vector3<f64> {
        let [sin, cos] = self.sin_cos;
        Vector3::new(cos * d.x + sin * d.y, cos * d.y - sin * d.x, d.z)
    }

    /// Returns the corners seen from above, at the height of the centre, in m.
    pub fn corners(&self) -> [Vector3<f64>; 4] {
        let [sin, cos] = self.sin_cos;
        [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)].map(|(a, b)| {
            let (u, v) = (0.5 * a * self.size[0], 0.5 * b * self.size[1]);
            Vector3::from(self.middle) + Vector3::new(cos * u - sin * v, sin * u + cos * v, 0.0)
        })
    }

    /// Returns the distance of a point from the surface, in m; negative inside.
    pub fn distance(&self, p: &Vector3<f64>) -> f64 {
        let from_middle = self.turned(&(p - Vector3::from(self.middle)));
        let beyond: [f64; 3] = std::array::from_fn(|i| from_middle[i].abs() - 0.5 * self.size[i]);
        let outside = Vector3::from(beyond.map(|x| x.max(0.0))).norm();
        outside + beyond[0].max(beyond[1]).max(beyond[2]).min(0.0)
    }

    /// Returns the minimum distance of the points of a segment, in m. The distance is convex along a line, so a
    /// ternary search finds it.
    pub(crate) fn distance_of_segment(&self, [from, to]: &[Vector3<f64>; 2]) -> f64 {
        let at = |share: f64| self.distance(&(from + (to - from) * share));
        let (mut low, mut high) = (0.0, 1.0);
        // Accuracy: 1e-5 of the segment.
        for _ in 0..30 {
            let third = (high - low) / 3.0;
            if at(low + third) < at(high - third) {
                high -= third;
            } else {
                low += third;
            }
        }
        at(0.5 * (low + high))
    }

    /// Returns the distance from `origin` to the surface in units of `direction`, or `None` if the ray misses the
    /// box.
    pub(crate) fn on_ray(&self, origin: &Vector3<f64>, direction: &Vector3<f64>) -> Option<f64> {
        let from = self.turned(&(origin - Vector3::from(self.middle)));
        let along = self.turned(direction);
        let (mut enters, mut leaves) = (0.0f64, f64::INFINITY);
        for i in 0..3 {
            let half = 0.5 * self.size[i];
            if along[i] == 0.0 {
                if from[i].abs() > half {
                    return None;
                }
                continue;
            }
            let (a, b) = ((-half - from[i]) / along[i], (half - from[i]) / along[i]);
            enters = enters.max(a.min(b));
            leaves = leaves.min(a.max(b));
        }
        (enters <= leaves).then_some(enters)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn some_box() -> impl Strategy<Value = StandingBox> {
        (
            proptest::array::uniform3(-1.0..1.0f64),
            proptest::array::uniform3(0.05..1.0f64),
            -3.0..3.0f64,
        )
            .prop_map(|(middle, size, turn)| StandingBox::new(middle, size, turn))
    }

    fn point() -> impl Strategy<Value = Vector3<f64>> {
        proptest::array::uniform3(-2.0..2.0f64).prop_map(Vector3::from)
    }

    proptest! {
        #[test]
        fn rays_end_at_the_surface(shape in some_box(), origin in point(), to in point()) {
            prop_assume!(shape.distance(&origin) > 1e-3 && (to - origin).norm() > 0.1);
            let direction = to - origin;
            match shape.on_ray(&origin, &direction) {
                Some(t) => prop_assert!(shape.distance(&(origin + direction * t)).abs() < 1e-9),
                None => for i in 0..=300 {
                    prop_assert!(shape.distance(&(origin + direction * (f64::from(i) * 0.02))) > -1e-9);
                },
            }
        }

        #[test]
        fn segments_are_as_near_as_their_nearest_point(shape in some_box(), from in point(), to in point()) {
            let sampled = (0..=400).map(|i| shape.distance(&(from + (to - from) * (f64::from(i) / 400.0)))).fold(f64::INFINITY, f64::min);
            let found = shape.distance_of_segment(&[from, to]);
            prop_assert!(found <= sampled + 1e-4 && found >= sampled - 0.01, "{found} {sampled}");
        }

        #[test]
        fn a_box_turns_as_its_frame_does(shape in some_box(), p in point()) {
            let turned = nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), shape.turn);
            let own = turned.inverse() * (p - Vector3::from(shape.middle));
            let straight = StandingBox::new([0.0; 3], shape.size, 0.0);
            prop_assert!((straight.distance(&own) - shape.distance(&p)).abs() < 1e-12);
        }
    }

    #[test]
    fn what_is_drawn_is_drawn_anew_and_the_table_stays() {
        let config = ObstaclesConfig::table_and_box();
        let anywhere = |_: &StandingBox| true;
        let first = config.place(3, 0, anywhere);
        assert_eq!(first, config.place(3, 0, anywhere));
        let second = config.place(3, 1, anywhere);
        assert_eq!(first[0], second[0]);
        assert_ne!(first[1], second[1]);
        assert_eq!(first[1].size, second[1].size);
        for i in 0..3 {
            let off = (second[1].middle[i] - config.boxes[1].middle[i]).abs();
            assert!(off <= config.boxes[1].drawn[i]);
        }
        // Drawn again if the place is not allowed.
        let left = config.place(3, 1, |place| place.middle[0] < 0.5);
        assert!(left[1].middle[0] < 0.5);
    }
}
