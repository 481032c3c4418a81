//! Simple bodies that the hand must avoid (thesis, figure 3.1: a virtual cylinder and walls), in the chest frame.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Number of bodies of a problem, as in the thesis.
pub const BODIES: usize = 8;

/// Body that the origin of the catch frame must stay out of.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Body {
    /// Vertical cylinder of infinite length.
    Cylinder {
        /// x and y of its axis, in m.
        centre: [f64; 2],
        /// Radius, in m.
        radius: f64,
    },
    /// Half space behind a plane: points with `normal . p < offset`.
    Wall {
        /// Unit normal that points away from the body.
        normal: [f64; 3],
        /// Offset of the plane along its normal, in m.
        offset: f64,
    },
}

impl Body {
    /// Returns the bodies around the chest for the left (0) or the right arm: trunk, rear, front limit, sides, floor,
    /// ceiling, and the other arm's side.
    pub fn around_chest(arm: usize) -> [Self; BODIES] {
        let side = if arm == 0 { 1.0 } else { -1.0 };
        let wall = |normal, offset| Self::Wall { normal, offset };
        [
            Self::Cylinder {
                centre: [0.0, 0.0],
                radius: 0.3,
            },
            wall([1.0, 0.0, 0.0], 0.1),
            wall([-1.0, 0.0, 0.0], -1.4),
            wall([0.0, 1.0, 0.0], -1.6),
            wall([0.0, -1.0, 0.0], -1.6),
            wall([0.0, 0.0, 1.0], -0.8),
            wall([0.0, 0.0, -1.0], -1.2),
            wall([0.0, side, 0.0], -0.35),
        ]
    }

    /// Returns the signed distance of a point from the body, in m, negative inside, and its gradient.
    pub fn distance(&self, p: &Vector3<f64>) -> (f64, Vector3<f64>) {
        match self {
            Self::Cylinder { centre, radius } => {
                let (x, y) = (p.x - centre[0], p.y - centre[1]);
                let distance = x.hypot(y);
                if distance == 0.0 {
                    return (-radius, Vector3::x());
                }
                (
                    distance - radius,
                    Vector3::new(x / distance, y / distance, 0.0),
                )
            }
            Self::Wall { normal, offset } => {
                let normal = Vector3::from(*normal);
                (normal.dot(p) - offset, normal)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn gradients_are_differences(p in proptest::array::uniform3(-2.0..2.0f64), arm in 0..2usize, body in 0..BODIES) {
            let body = Body::around_chest(arm)[body];
            let p = Vector3::from(p);
            prop_assume!(p.x.hypot(p.y) > 1e-3);
            let (_, gradient) = body.distance(&p);
            for i in 0..3 {
                let mut step = Vector3::zeros();
                step[i] = 1e-6;
                let slope = (body.distance(&(p + step)).0 - body.distance(&(p - step)).0) / 2e-6;
                prop_assert!((slope - gradient[i]).abs() < 1e-6);
            }
        }
    }
}
