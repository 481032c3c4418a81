//! Training of a committee in a run directory: one member after the other, each in a folder of its own until all have ended. The first network
//! remains as a run of its own, since only networks classify frame by frame.

use std::fs;

use super::session::{Begun, Trained};
use crate::committee::fitted::joined_weights;
use crate::{
    ClassifierConfig, CommitteeRecipe, MemberConfig, ModelConfig, ModelRecipe, PipelineError,
    RunConfig, RunDir, Session, TrainEvent, TrainSpec, TrainingSummary,
};
use tactnet_models::Weights;

/// Folder of the members of an unfinished committee.
const MEMBERS: &str = "members";
/// Folder with the run of a committee's first network.
const NETWORK: &str = "network";

impl Session {
    /// Trains all members; returns `None` if stopped. A later session keeps the finished members and continues the one that was
    /// interrupted.
    pub(super) fn train_committee(
        &self,
        begun: &Begun<'_>,
        recipe: &CommitteeRecipe,
        setups: &[MemberConfig],
        on_event: &mut impl FnMut(TrainEvent<'_>),
        stop: &impl Fn() -> bool,
    ) -> Trained {
        let folder = self.run().file(MEMBERS);
        let failed = |error| PipelineError::io(&folder, "make the members' folder", error);
        let mut summary = TrainingSummary {
            sweeps: begun.fitted.train.len(),
            ..TrainingSummary::default()
        };
        let (mut weights, mut network) = (Vec::new(), None);
        for (number, (member, setup)) in recipe.members.iter().zip(setups).enumerate() {
            let run = RunDir::unopened(&folder.join(number.to_string()));
            fs::create_dir_all(run.path()).map_err(failed)?;
            on_event(TrainEvent::Member {
                name: &setup.name,
                number: number + 1,
                members: recipe.members.len(),
            });
            let trained: TrainingSummary = match run.summary()? {
                Some(summary) => summary,
                None => match self.train_member(&run, begun, member, setup, on_event, stop)? {
                    Some(trained) => trained,
                    None => return Ok(None),
                },
            };
            summary.seconds += trained.seconds;
            let trained_weights = run.weights()?;
            if network.is_none() && matches!(member, ModelRecipe::Network(_)) {
                network = Some((member, setup, trained.clone(), trained_weights.clone()));
            }
            let chosen = trained.chosen.into_iter();
            let named = chosen.map(|(setting, value)| (format!("{}.{setting}", setup.name), value));
            summary.chosen.extend(named);
            weights.push(trained_weights);
        }
        if let Some((member, setup, trained, weights)) = network {
            self.keep_network(begun, member, setup, trained, &weights)?;
        }
        let names = setups.iter().map(|setup| setup.name.as_str());
        self.run()
            .write_weights(&joined_weights(names.zip(&weights)))?;
        fs::remove_dir_all(&folder).map_err(failed)?;
        Ok(Some(summary))
    }

    /// Writes the run of the committee's network.
    fn keep_network(
        &self,
        begun: &Begun<'_>,
        member: &ModelRecipe,
        setup: &MemberConfig,
        trained: TrainingSummary,
        weights: &Weights,
    ) -> Result<(), PipelineError> {
        let folder = self.run().file(NETWORK);
        if folder.exists() {
            let failed = |error| PipelineError::io(&folder, "replace the network's run", error);
            fs::remove_dir_all(&folder).map_err(failed)?;
        }
        let whole = &begun.config;
        let config = RunConfig {
            spec: TrainSpec {
                recipe: member.name().into(),
                ..whole.spec.clone()
            },
            recipe: member.clone(),
            classifier: ClassifierConfig {
                model: setup.model.clone(),
                ..whole.classifier.clone()
            },
            ..whole.clone()
        };
        let split = begun.fold.manifest();
        let run = RunDir::create(&folder, &config, &split, &self.program.provenance)?;
        run.write_weights(weights)?;
        let result = self.evaluated(&run, &config, begun, trained, &mut |_| {})?;
        run.write_json("result.json", &result)?;
        run.write_manifest()
    }

    fn train_member(
        &self,
        run: &RunDir,
        begun: &Begun<'_>,
        member: &ModelRecipe,
        setup: &MemberConfig,
        on_event: &mut impl FnMut(TrainEvent<'_>),
        stop: &impl Fn() -> bool,
    ) -> Trained {
        let trained = self.train_model(run, begun, (member, &setup.model), on_event, stop)?;
        if let Some(summary) = &trained {
            run.write_summary(summary)?;
        }
        Ok(trained)
    }
}

impl RunDir {
    /// Returns the run of a network, which classifies frame by frame: this one, or that of a committee's first network.
    ///
    /// - `what`: action that only networks support, as a verb phrase
    ///
    /// # Errors
    /// A baseline, or a committee without the run of a network.
    pub fn network(self, what: &str) -> Result<Self, PipelineError> {
        let config = self.config()?;
        let below = self.file(NETWORK);
        match config.recipe {
            ModelRecipe::Committee(_) if below.exists() => Self::open(&below),
            _ => config.require_network(self.path(), what).map(|()| self),
        }
    }

    /// Reads the summary of a finished member; returns `None` if it has not ended.
    fn summary(&self) -> Result<Option<TrainingSummary>, PipelineError> {
        match self.file(SUMMARY).exists() {
            true => self.read_json(SUMMARY).map(Some),
            false => Ok(None),
        }
    }

    fn write_summary(&self, summary: &TrainingSummary) -> Result<(), PipelineError> {
        self.write_json(SUMMARY, summary)
    }
}

/// File that a member has once it has ended.
const SUMMARY: &str = "summary.json";

/// Returns the setups of the members, in order.
pub(super) fn setups(
    recipe: &CommitteeRecipe,
    mut setup: impl FnMut(&ModelRecipe) -> ModelConfig,
) -> Vec<MemberConfig> {
    let members = recipe.members.iter().map(|member| MemberConfig {
        name: member.name().into(),
        model: setup(member),
    });
    members.collect()
}
