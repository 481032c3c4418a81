//! Throws among obstacles: contacts, catches, and time from looking to planning.

mod page;
mod scene;

use std::collections::BTreeMap;
use std::fmt;

use serde::Serialize;
use tactnet_plot::{Quantiles, wilson_of_counts};

use super::SeriesReport;
use crate::throw_outcome::{AmongObstacles, ThrowOutcome};

pub(super) use page::scene_figures;

/// Additional results of a series among obstacles.
#[derive(Debug, Clone, Serialize)]
pub struct ObstaclesReport {
    /// Number of throws with a contact, from the first look to the verdict.
    pub contacts: usize,
    /// 95 % Wilson interval of their share.
    pub contacts_ci95: [f64; 2],
    /// Number of throws with a contact, by the part of the robot with the deepest one.
    pub contact_parts: BTreeMap<String, usize>,
    /// Deepest contact, in mm.
    pub contact_mm_max: f64,
    /// Number of throws with at least one plan without a collision-free path.
    pub obstructed: usize,
    /// Number of arms that stayed up because their path down was not clear.
    pub arms_held_up: usize,
    /// Number of throws with all balls caught and no contact.
    pub untouched_catches: usize,
    /// Time from the four depth pictures of a look to the first plans of both arms (fusion, transform, planning), in
    /// ms. Depends on the machine.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub look_to_plan_ms: Option<Quantiles>,
    /// Time of fusion and transform, in ms.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub look_ms: Option<Quantiles>,
    /// Results of the same throws without a map.
    #[serde(flatten)]
    pub without_map: Option<WithoutMap>,
}

/// Results of the same throws by a robot that does not look around.
#[derive(Debug, Clone, Serialize)]
pub struct WithoutMap {
    /// Number of throws with a contact.
    pub contacts_without_map: usize,
    /// Catch rate in the catch space.
    pub rate_without_map: f64,
    /// Number of throws with all balls caught and no contact.
    pub untouched_catches_without_map: usize,
    /// Deepest contact, in mm.
    pub contact_mm_max_without_map: f64,
    /// Numbers of the throws with a contact.
    #[serde(skip)]
    pub touched: Vec<u64>,
}

fn untouched_catches(outcomes: &[ThrowOutcome]) -> usize {
    let good = |outcome: &&ThrowOutcome| !outcome.touched() && outcome.all_caught();
    outcomes.iter().filter(good).count()
}

fn deepest_mm(outcomes: &[ThrowOutcome]) -> f64 {
    let contacts = outcomes
        .iter()
        .filter_map(|outcome| outcome.obstacles?.contacts.deepest);
    contacts
        .map(|contact| 1e3 * contact.depth_m)
        .fold(0.0, f64::max)
}

impl ObstaclesReport {
    /// Returns the results of a series; `None` if the robot did not look around.
    pub(crate) fn of(outcomes: &[ThrowOutcome]) -> Option<Self> {
        let among: Vec<AmongObstacles> = outcomes
            .iter()
            .filter_map(|outcome| outcome.obstacles)
            .collect();
        if among.is_empty() {
            return None;
        }
        let mut contact_parts = BTreeMap::new();
        for contact in among.iter().filter_map(|among| among.contacts.deepest) {
            *contact_parts.entry(contact.part.to_string()).or_insert(0) += 1;
        }
        let contacts = outcomes.iter().filter(|outcome| outcome.touched()).count();
        let looked = |among: &&AmongObstacles| among.look_seconds > 0.0;
        let quantiles = |of: &dyn Fn(&AmongObstacles) -> Option<f64>| {
            let seconds = among.iter().filter(looked).filter_map(of);
            Quantiles::of(seconds.map(|seconds| 1e3 * seconds).collect())
        };
        Some(Self {
            contacts,
            contacts_ci95: wilson_of_counts(contacts, outcomes.len()),
            contact_parts,
            contact_mm_max: deepest_mm(outcomes),
            obstructed: among.iter().filter(|among| among.obstructed > 0).count(),
            arms_held_up: among.iter().map(|among| among.arms_held_up).sum(),
            untouched_catches: untouched_catches(outcomes),
            look_to_plan_ms: quantiles(&|among| Some(among.look_seconds + among.plan_seconds?)),
            look_ms: quantiles(&|among| Some(among.look_seconds)),
            without_map: None,
        })
    }
}

impl WithoutMap {
    /// Returns the results of a series of a robot that does not look around.
    pub(crate) fn of(report: &SeriesReport) -> Self {
        let outcomes = &report.outcomes;
        let those = outcomes.iter().filter(|outcome| outcome.touched());
        let touched: Vec<u64> = those.map(|outcome| outcome.number).collect();
        Self {
            contacts_without_map: touched.len(),
            rate_without_map: report.rate,
            untouched_catches_without_map: untouched_catches(outcomes),
            contact_mm_max_without_map: deepest_mm(outcomes),
            touched,
        }
    }
}

impl fmt::Display for ObstaclesReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "\nobstacles touched in {} throws, at most {:.0} mm deep; in their way every plan in {} throws; {} arms stayed up",
            self.contacts, self.contact_mm_max, self.obstructed, self.arms_held_up
        )?;
        if let Some(times) = self.look_to_plan_ms {
            write!(
                f,
                "\nfrom depth pictures to plans: median {:.0} ms, 99 % {:.0} ms, longest {:.0} ms",
                times.p50, times.p99, times.max
            )?;
        }
        if let Some(without) = &self.without_map {
            write!(
                f,
                "\nwithout the map: touched in {} throws, caught {:.1} %; caught and nothing touched: {} throws, with it {}",
                without.contacts_without_map,
                100.0 * without.rate_without_map,
                without.untouched_catches_without_map,
                self.untouched_catches
            )?;
        }
        Ok(())
    }
}
