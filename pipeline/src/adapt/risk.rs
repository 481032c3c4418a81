//! Signs that an adaptation would lower the accuracy.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Minimum number of sweeps to adapt to.
pub(super) const MIN_SWEEPS: usize = 8;
/// Number of sweeps from which a shift differs clearly from chance.
const ENOUGH_SWEEPS: usize = 16;
/// Minimum diversity of the sweeps.
pub(super) const MIN_DIVERSITY: f64 = 0.4;
/// Diversity from which an adaptation costs nothing in the experiments.
const ENOUGH_DIVERSITY: f64 = 0.7;

/// Numbers by which an adaptation is judged.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Presence {
    /// Number of sweeps.
    pub sweeps: usize,
    /// Number of materials that the classifier knows.
    pub known: usize,
    /// Number of materials that the adapted classifier predicts for at least one sweep; with labels, the number of materials named.
    pub materials: usize,
    /// Share of the most frequent of these.
    pub largest_share: f64,
    /// Share of the differences between materials that the sweeps show: 0 for one material, 1 for all in equal numbers. Absent with labels
    /// of all sweeps, and for classifiers of fewer than 20 training sweeps.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub diversity: Option<f64>,
}

/// Sign that an adaptation would lower the accuracy.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum AdaptRisk {
    /// Too few sweeps to distinguish a shift from chance.
    FewSweeps {
        /// Number of sweeps.
        found: usize,
        /// Recommended number of sweeps.
        wanted: usize,
    },
    /// Too few of the materials: their difference from the mean of all would be taken for a change of the skin.
    FewMaterials {
        /// Number of materials predicted, or named by labels.
        found: usize,
        /// Number of materials that the classifier knows.
        known: usize,
        /// See [`Presence::diversity`].
        diversity: Option<f64>,
    },
    /// The sweeps differ from the training sweeps as their recording blocks differ from one another. Adapting without labels lowered the
    /// accuracy on such sweeps in all experiments.
    OtherRecording {
        /// See [`LikenessReport::p_other_block`](crate::LikenessReport::p_other_block).
        p: f64,
    },
}

impl fmt::Display for AdaptRisk {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::FewSweeps { found, wanted } => write!(
                f,
                "{found} sweeps are too few to tell a change of the skin from chance; {wanted} or more of mixed materials are recommended"
            ),
            Self::OtherRecording { p } => write!(
                f,
                "the sweeps are like another recording on the skin of training (p = {p:.2}): adapting without labels lowers the accuracy, \
                 labelled sweeps raise it"
            ),
            Self::FewMaterials {
                found,
                known,
                diversity,
            } => {
                write!(
                    f,
                    "the sweeps seem to be of few of the {known} known materials ("
                )?;
                match diversity {
                    Some(share) => write!(
                        f,
                        "they show {:.0} % of the differences between materials; {found} predicted)",
                        100.0 * share.max(0.0)
                    )?,
                    None => write!(f, "{found} named)")?,
                }
                write!(
                    f,
                    "; what is special about these materials would be taken for a change of the skin"
                )
            }
        }
    }
}

/// Risks of an adaptation: those for which it is refused, and those of which it warns.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Risks {
    pub refused: Vec<AdaptRisk>,
    pub warned: Vec<AdaptRisk>,
}

impl Risks {
    /// - `labelled`: true if every sweep has a label
    pub fn of(presence: &Presence, labelled: bool) -> Self {
        let mut risks = Self::default();
        let few = AdaptRisk::FewSweeps {
            found: presence.sweeps,
            wanted: ENOUGH_SWEEPS,
        };
        match presence.sweeps {
            // Labels correct the output layer, so that two sweeps are better than none.
            ..MIN_SWEEPS if !labelled => risks.refused.push(few),
            ..ENOUGH_SWEEPS => risks.warned.push(few),
            _ => {}
        }
        let share = match presence.diversity {
            Some(share) => share,
            None => presence.materials as f64 / presence.known as f64,
        };
        let few = AdaptRisk::FewMaterials {
            found: presence.materials,
            known: presence.known,
            diversity: presence.diversity,
        };
        if share < MIN_DIVERSITY && !labelled {
            risks.refused.push(few);
        } else if share < ENOUGH_DIVERSITY {
            risks.warned.push(few);
        }
        risks
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_sweeps_and_few_materials_are_refused_before_they_are_warned_of() {
        let risks = |sweeps: usize, diversity: Option<f64>, materials: usize, labelled: bool| {
            let presence = Presence {
                sweeps,
                known: 10,
                materials,
                largest_share: 0.1,
                diversity,
            };
            let risks = Risks::of(&presence, labelled);
            (risks.refused.len(), risks.warned.len())
        };
        assert_eq!(risks(40, Some(0.9), 10, false), (0, 0));
        assert_eq!(risks(40, Some(0.5), 10, false), (0, 1));
        assert_eq!(risks(40, Some(-0.2), 10, false), (1, 0));
        assert_eq!(risks(12, Some(0.9), 10, false), (0, 1));
        assert_eq!(risks(5, Some(-0.2), 10, false), (2, 0));
        assert_eq!(risks(40, None, 2, false), (1, 0));
        assert_eq!(risks(10, None, 10, true), (0, 1));
        assert_eq!(risks(2, None, 2, true), (0, 2));
    }
}
