//! Texts written by users: channel tables, recipes of networks and of experiments.

use tactnet_channel::Table;
use tactnet_experiments::ExperimentRecipe;
use tactnet_pipeline::NetworkRecipe;
use tactnet_skin::ServeConfig;

use super::Target;

/// Input: a byte that selects the kind, and the text.
pub(super) fn tables() -> Target {
    let table = toml::to_string(&ServeConfig::default().table("attacked")).unwrap_or_default();
    let network = "name = \"small\"\nnetwork = { maps = [2, 3], hidden = 8, keep_probability = 0.5 }\n\
                   [training]\nepochs = 1\nbatch = 12\nlearning_rate = 0.01\nmethod = { kind = \"base\" }\n";
    let experiment = "name = \"own\"\ntitle = \"Own\"\nexpects = \"Nothing.\"\ntakes = \"a minute\"\ndata = \"twin\"\n\
                      models = [\"fast\"]\n[question]\nkind = \"enrolment\"\nsplits = 20\nshots = [1, 2]\nnew_materials = 6\n";
    let seeds = (0..)
        .zip([table.as_str(), network, experiment])
        .map(|(kind, text)| {
            let mut seed = vec![kind];
            seed.extend(text.bytes());
            seed
        });
    let mut target = Target::new(seeds.collect(), |input| {
        let Some((kind, text)) = input.split_first() else {
            return false;
        };
        let Ok(text) = std::str::from_utf8(text) else {
            return false;
        };
        match kind % 3 {
            0 => Table::parse(text).is_ok_and(|table| ServeConfig::of(&table).is_ok()),
            1 => NetworkRecipe::parse("attacked", text).is_ok(),
            _ => ExperimentRecipe::parse("attacked", text, &[]).is_ok(),
        }
    });
    target.may_abort = false;
    target
}
