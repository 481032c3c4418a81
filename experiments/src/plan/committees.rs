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
