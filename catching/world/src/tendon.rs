//! Tendons that slip (thesis, section 3.3.2): a joint's link jumps while its sensor says the same.

use serde::{Deserialize, Serialize};
use tactnet_catching_packets::{ARM_JOINTS, ARMS};

use crate::error::{WorldError, within};

/// A slip of an arm's joint.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TendonSlip {
    /// 0 left, 1 right.
    pub arm: usize,
    /// Counted from the shoulder, from 0.
    pub joint: usize,
    /// By how much the link stands farther than before, rad, at most 0.2 either way.
    pub angle: f64,
}

impl TendonSlip {
    /// # Errors
    /// Where there is no such joint, and where it slips too far.
    pub fn check(&self) -> Result<(), WorldError> {
        if self.arm >= ARMS {
            return Err(WorldError::Arm { arm: self.arm });
        }
        let last = (ARM_JOINTS - 1) as f64;
        within(
            "slip.joint",
            self.joint as f64,
            [0.0, last],
            "a joint from 0 to 6",
        )?;
        within(
            "slip.angle",
            self.angle,
            [-0.2, 0.2],
            "at most 0.2 rad either way",
        )
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
        for (wrong, named) in [
            (TendonSlip { arm: 2, ..slip }, "arm 2"),
            (TendonSlip { joint: 7, ..slip }, "slip.joint"),
            (
                TendonSlip {
                    angle: f64::NAN,
                    ..slip
                },
                "slip.angle",
            ),
        ] {
            let error = wrong.check().unwrap_err().to_string();
            assert!(error.contains(named), "{error}");
        }
    }
}
