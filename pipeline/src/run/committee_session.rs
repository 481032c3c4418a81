//! Training of a committee in a run directory: one member after the other, each in a folder of its own until all have ended.

use std::fs;

use super::session::{Begun, Trained};
use crate::committee::fitted::joined_weights;
use crate::{
    CommitteeRecipe, MemberConfig, ModelConfig, ModelRecipe, PipelineError, RunDir, Session,
    TrainEvent, TrainingSummary,
};

/// Folder of the members of an unfinished committee.
const MEMBERS: &str = "members";

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
        let mut weights = Vec::new();
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
            let chosen = trained.chosen.into_iter();
            let named = chosen.map(|(setting, value)| (format!("{}.{setting}", setup.name), value));
            summary.chosen.extend(named);
            weights.push(run.weights()?);
        }
        let names = setups.iter().map(|setup| setup.name.as_str());
        self.run()
            .write_weights(&joined_weights(names.zip(&weights)))?;
        fs::remove_dir_all(&folder).map_err(failed)?;
        Ok(Some(summary))
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
