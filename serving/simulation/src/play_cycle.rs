//! The repeating cycle of sweeps that a simulated skin plays.

use std::fmt;

use serde::{Deserialize, Serialize};

/// One cycle of a simulated skin, played in a loop. As text: number of sweeps, reason for a smaller number, and the
/// object at which the cycle repeats.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlayCycle {
    /// Number of different sweeps.
    pub sweeps: usize,
    /// Number of sweeps from which they were chosen.
    pub all: usize,
    /// Number of objects; 0 if no command marks a new object.
    pub objects: usize,
}

impl PlayCycle {
    /// Returns the cycle of `sweeps` sweeps.
    ///
    /// - `all`: number of sweeps from which they were chosen
    /// - `object_sweeps`: number of sweeps per object; 0 if no command marks a new object
    pub fn of(sweeps: usize, all: usize, object_sweeps: usize) -> Self {
        Self {
            sweeps,
            all,
            objects: sweeps.checked_div(object_sweeps).unwrap_or(0),
        }
    }
}

impl fmt::Display for PlayCycle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let plural = if self.sweeps.max(self.all) == 1 {
            ""
        } else {
            "s"
        };
        if self.sweeps < self.all {
            write!(f, "{} of {} test sweep{plural} (", self.sweeps, self.all)?;
            match self.sweeps.checked_div(self.objects) {
                Some(2..) => write!(
                    f,
                    "whole objects of {} sweeps, equally many of each material",
                    self.sweeps / self.objects
                )?,
                _ => write!(f, "equally many of each material")?,
            }
            write!(f, "), shown again ")?;
        } else {
            write!(f, "{} test sweep{plural}, shown again ", self.sweeps)?;
        }
        match self.objects {
            0 => write!(f, "after the last"),
            objects => write!(f, "from object {}", objects + 1),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_object_with_which_sweeps_come_again_is_named() {
        let said = PlayCycle::of(18, 18, 3).to_string();
        assert_eq!(said, "18 test sweeps, shown again from object 7");
        let said = PlayCycle::of(18, 18, 0).to_string();
        assert_eq!(said, "18 test sweeps, shown again after the last");
        let said = PlayCycle::of(15, 24, 3).to_string();
        assert_eq!(
            said,
            "15 of 24 test sweeps (whole objects of 3 sweeps, equally many of each material), shown again from object 6"
        );
    }
}
