//! Order in which a simulated skin plays sweeps.

use rand::seq::SliceRandom;
use tactnet_data::{Dataset, Seed, known_names};

use crate::SimulationError;

/// Returns sweeps of the materials in turns, in random order within each material.
///
/// - `sweeps`: indices of the sweeps to choose from
/// - `materials`: names of the materials; empty for all materials, in another order every round
/// - `in_a_row`: number of sweeps of a material per turn, at least one
///
/// # Errors
/// Fails if the data set does not have a material, or if a material has fewer sweeps than a turn.
pub fn play_order(
    dataset: &Dataset,
    sweeps: &[usize],
    materials: &[String],
    in_a_row: usize,
    seed: Seed,
) -> Result<Vec<usize>, SimulationError> {
    let names: Vec<&str> = dataset.labels().names().collect();
    let labels = labels_of(dataset, sweeps, materials)?;
    let mut sweeps: Vec<Vec<usize>> = labels
        .iter()
        .map(|label| {
            let own = sweeps.iter().copied();
            own.filter(|sweep| dataset.records()[*sweep].label == *label)
                .collect()
        })
        .collect();
    for (sweeps, label) in sweeps.iter_mut().zip(&labels) {
        sweeps.shuffle(&mut seed.rng(("simulated sweeps", *label)));
    }
    let in_a_row = in_a_row.max(1);
    let fewest = sweeps.iter().zip(&labels).min_by_key(|(own, _)| own.len());
    let (found, material) = fewest.map_or((0, String::new()), |(own, label)| {
        (own.len(), names[*label].to_string())
    });
    let rounds = found / in_a_row;
    if rounds == 0 {
        return Err(SimulationError::TooFewSweeps {
            material,
            found,
            in_a_row,
        });
    }
    let mut order = Vec::with_capacity(rounds * in_a_row * labels.len());
    for round in 0..rounds {
        let turns = sweeps
            .iter()
            .map(|sweeps| &sweeps[round * in_a_row..][..in_a_row]);
        let mut turns: Vec<&[usize]> = turns.collect();
        if materials.is_empty() {
            turns.shuffle(&mut seed.rng(("simulated round", round)));
        }
        order.extend(turns.concat());
    }
    Ok(order)
}

/// Returns the labels of the materials; without names, all labels with at least one sweep.
fn labels_of(
    dataset: &Dataset,
    sweeps: &[usize],
    materials: &[String],
) -> Result<Vec<usize>, SimulationError> {
    let names: Vec<&str> = dataset.labels().names().collect();
    if materials.is_empty() {
        // All materials with at least one sweep.
        let has_sweep = |label: &usize| {
            let mut sweeps = sweeps.iter();
            sweeps.any(|sweep| dataset.records()[*sweep].label == *label)
        };
        Ok((0..names.len()).filter(has_sweep).collect())
    } else {
        let label_of = |material: &String| {
            let found = names.iter().position(|name| name == material);
            found.ok_or_else(|| SimulationError::NoMaterial {
                material: material.clone(),
                known: known_names(material, names.iter().copied()),
            })
        };
        materials.iter().map(label_of).collect()
    }
}

#[cfg(test)]
mod tests {
    use tactnet_data::twin;

    use super::*;

    #[test]
    fn materials_take_turns_and_unknown_ones_are_named() {
        let twin = twin::small(3, 4, 60).unwrap();
        let all: Vec<usize> = (0..twin.len()).collect();
        let names: Vec<String> = twin.labels().names().map(Into::into).collect();
        let wanted = [names[2].clone(), names[0].clone()];
        let order = play_order(&twin, &all, &wanted, 1, Seed(1)).unwrap();
        let labels: Vec<usize> = order.iter().map(|s| twin.records()[*s].label).collect();
        assert_eq!(labels, [2, 0].repeat(4));
        let every = play_order(&twin, &all, &[], 1, Seed(1)).unwrap();
        assert_eq!(every.len(), all.len());
        // Three of four sweeps, all of a material before the next.
        let objects = play_order(&twin, &all, &[], 3, Seed(1)).unwrap();
        let mut labels: Vec<usize> = objects.iter().map(|s| twin.records()[*s].label).collect();
        labels.dedup();
        assert_eq!((objects.len(), labels.len()), (9, 3));
        let error = play_order(&twin, &all, &[], 5, Seed(1)).unwrap_err();
        assert_eq!(
            error.to_string(),
            format!(
                "`{}` has 4 playable sweeps, but an object needs 5",
                names[0]
            )
        );
        let unknown = play_order(&twin, &all, &["kryptonite".into()], 1, Seed(1)).unwrap_err();
        assert!(
            unknown
                .to_string()
                .contains("no material `kryptonite`; there are")
        );
        let typed = [names[0].to_uppercase()];
        let mistyped = play_order(&twin, &all, &typed, 1, Seed(1)).unwrap_err();
        let proposed = format!("did you mean `{}`?", names[0]);
        assert!(mistyped.to_string().ends_with(&proposed), "{mistyped}");
        assert!(
            play_order(&twin, &[], &[], 1, Seed(1))
                .unwrap_err()
                .is_usage()
        );
    }
}
