//! How many sweeps a simulated skin plays before they come again.

use std::fmt;

use serde::{Deserialize, Serialize};

/// One round of a simulated skin, which is played over and over. As text: how many sweeps, why no more, and from which object on they come
/// again.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlayCycle {
    /// Different sweeps.
    pub sweeps: usize,
    /// Those that they were chosen from.
    pub all: usize,
    /// Objects that they are of; 0 where nobody says when the object is another one.
    pub objects: usize,
}

impl PlayCycle {
    /// Returns the round of so many sweeps.
    ///
    /// - `all`: those that they were chosen from
    /// - `object_sweeps`: those of one object; 0 where nobody says when the object is another one
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
