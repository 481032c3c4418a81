//! Tendon slip (thesis, section 3.3.2): the link of a joint jumps while its sensor does not change.

use serde::{Deserialize, Serialize};
use tactnet_catching_packets::{ARM_JOINTS, ARMS};

use crate::error::{WorldError, from_to};

/// A slip of an arm's joint.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TendonSlip {
    /// Arm, 0 for left and 1 for right.
    pub arm: usize,
    /// Joint, counted from the shoulder, from 0.
    pub joint: usize,
    /// Rotation of the link relative to its former position, in rad; magnitude at most 0.2.
    pub angle: f64,
}

impl TendonSlip {
    /// Checks the slip.
    ///
    /// # Errors
    /// Unknown joint or arm, or an angle that is too large.
    pub fn check(&self) -> Result<(), WorldError> {
        if self.arm >= ARMS {
            return Err(WorldError::Arm { arm: self.arm });
        }
        let last = (ARM_JOINTS - 1) as f64;
        from_to([0.0, last], "a joint from 0 to 6")("slip.joint", &self.joint)?;
        from_to([-0.2, 0.2], "a magnitude of at most 0.2 rad")("slip.angle", &self.angle)?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slips_of_no_joint_and_by_no_angle_are_refused() {
        let slip = TendonSlip {
            arm: 1,
            joint: 6,
            angle: -0.0175,
        };
        assert_eq!(slip.check(), Ok(()));
        let angle = f64::NAN;
        for (wrong, named) in [
            (TendonSlip { arm: 2, ..slip }, "arm 2"),
            (TendonSlip { joint: 7, ..slip }, "slip.joint"),
            (TendonSlip { angle, ..slip }, "slip.angle"),
        ] {
            let error = wrong.check().unwrap_err().to_string();
            assert!(error.contains(named), "{error}");
        }
    }
}
