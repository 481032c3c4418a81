//! Committees whose members are models of the experiment.

use std::collections::BTreeMap;

use tactnet_pipeline::{ModelRecipe, TrainSpec};

use super::models::Model;
use super::{Job, Task};

/// Names the tasks that train the members of each committee on the same sweeps.
///
/// A committee with a member that is no model of the experiment trains all members itself. A member that a data set does not allow has no
/// task; the committee leaves it out likewise.
pub(super) fn share_members(tasks: &mut [Task], models: &[Model]) {
    for committee in models {
        let ModelRecipe::Committee(recipe) = &committee.loaded else {
            continue;
        };
        let model_of = |member: &ModelRecipe| models.iter().find(|model| model.loaded == *member);
        let members: Option<Vec<&Model>> = recipe.members.iter().map(model_of).collect();
        let Some(members) = members else {
            continue;
        };
        let mut by_place: BTreeMap<String, Vec<String>> = BTreeMap::new();
        for task in tasks.iter().filter(|task| task.probe.is_none()) {
            if members.iter().any(|member| member.name == task.model)
                && let Some(place) = place_of(task)
            {
                by_place.entry(place).or_default().push(task.id.clone());
            }
        }
        for task in tasks.iter_mut().filter(|task| task.model == committee.name) {
            let place = place_of(task);
            task.members = place
                .and_then(|place| by_place.get(&place).cloned())
                .unwrap_or_default();
        }
    }
}

/// Returns the settings that a committee shares with its members: data, split and seed.
fn place_of(task: &Task) -> Option<String> {
    let Job::Train(spec) = &task.job else {
        return None;
    };
    let place = TrainSpec {
        recipe: String::new(),
        epochs: None,
        ..spec.clone()
    };
    serde_json::to_string(&place).ok()
}

#[cfg(test)]
mod tests {
    use tactnet_data::format::Format;
    use tactnet_data::twin;

    use super::*;
    use crate::{ExperimentRecipe, Plan};

    /// Returns the tasks of the public benchmark on a small twin.
    fn tasks(settings: &[&str]) -> Vec<Task> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("twin.npz");
        let twin = twin::small(3, 10, 100).unwrap();
        Format::Npz.write(&path, &twin).unwrap();
        let data = format!("data=[{:?}]", path.display().to_string());
        let settings = settings.iter().map(|setting| setting.to_string());
        let settings: Vec<String> = settings.chain([data]).collect();
        let recipe = ExperimentRecipe::load("public", &settings).unwrap();
        Plan::new(&recipe.with_data().unwrap(), "").unwrap().tasks
    }

    #[test]
    fn the_public_benchmark_trains_no_member_of_the_committee_twice() {
        let recipe = ModelRecipe::load("committee").unwrap();
        let ModelRecipe::Committee(committee) = recipe else {
            panic!("a committee");
        };
        let tasks = tasks(&["epochs=3", "shots=4"]);
        let committees = tasks.iter().filter(|task| task.model == "committee");
        let mut count = 0;
        for task in committees {
            count += 1;
            let members: Vec<&Task> = tasks
                .iter()
                .filter(|other| task.members.contains(&other.id))
                .collect();
            assert_eq!(members.len(), committee.members.len(), "{}", task.id);
            assert!(members.iter().all(|of| place_of(of) == place_of(task)));
        }
        assert_eq!(count, 10, "five folds, with all and with few sweeps");
    }

    #[test]
    fn a_committee_with_a_member_of_its_own_trains_all_of_them() {
        let tasks = tasks(&["models=[\"lda\", \"committee\"]"]);
        assert!(tasks.iter().all(|task| task.members.is_empty()));
    }
}
