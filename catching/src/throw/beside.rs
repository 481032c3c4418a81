//! Throws that are aimed next to their target to compensate known errors.

use nalgebra::Vector3;

use super::planner::{NoThrow, ThrowPlan, ThrowRequest, Thrower};
use super::problem::Aim;

impl Thrower {
    /// Plans the requested throw and, starting from it, a second one that lands at the offset `beside` from the target, in m. The second throw
    /// stays close to the first, so corrections learned for one apply to the other.
    ///
    /// # Errors
    /// Same as [`Thrower::plan`].
    pub fn plan_beside(
        &self,
        request: &ThrowRequest,
        beside: &Vector3<f64>,
    ) -> Result<ThrowPlan, NoThrow> {
        let plan = self.plan(request)?;
        match request.aim {
            Aim::At { target } if *beside != Vector3::zeros() => self.plan(&ThrowRequest {
                aim: Aim::At {
                    target: target + beside,
                },
                last: Some(plan.unknowns),
                ..*request
            }),
            _ => Ok(plan),
        }
    }
}

#[cfg(test)]
mod tests {

    use super::*;
    use crate::robot::Robot;
    use crate::throw::ThrowPlanConfig;

    #[test]
    fn a_throw_beside_is_the_throw_to_the_place_aimed_differently() {
        let robot = Robot::nominal();
        let thrower = Thrower::new(&robot, ThrowPlanConfig::default());
        let target = Vector3::new(4.2, 0.1, 1.2);
        let request = ThrowRequest::new(1, Aim::At { target });
        let plan = thrower.plan(&request).unwrap();
        assert_eq!(thrower.plan_beside(&request, &Vector3::zeros()), Ok(plan));
        let beside = Vector3::new(-0.2, 0.05, 0.0);
        let aimed = thrower.plan_beside(&request, &beside).unwrap();
        assert!((aimed.landing.p - target - beside).norm() < 1e-3);
        assert_eq!(aimed.effort.starts, 1, "found from the throw to the place");
    }
}
