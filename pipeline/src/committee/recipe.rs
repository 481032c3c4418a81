//! Recipe of a committee: the models whose probabilities are averaged.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};
use tactnet_data::SweepShape;

use crate::{ModelRecipe, PipelineError, PredictionMethod};

/// Recipe of a committee. In TOML a member is the name of a built-in recipe or a recipe of its own.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CommitteeRecipe {
    /// Name of the recipe.
    pub name: String,
    /// Models whose probabilities are averaged, with names of their own; at least one.
    pub members: Vec<ModelRecipe>,
}

/// Member that a committee lacks.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LeftOutMember {
    /// Name of the member's recipe.
    pub name: String,
    /// Reason.
    pub reason: String,
}

/// Training sweeps of a committee.
#[derive(Debug, Clone, Copy)]
pub(crate) struct CommitteeSweeps<'a> {
    pub shape: SweepShape,
    pub rate_hz: f64,
    /// Number of training sweeps of each material.
    pub counts: &'a [usize],
}

/// TOML of a committee.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Table {
    name: String,
    members: Vec<Member>,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum Member {
    Named(String),
    Own(toml::Table),
}

impl CommitteeRecipe {
    /// Parses and validates TOML.
    ///
    /// # Errors
    /// A sentence about the first mistake.
    pub(crate) fn parse(text: &str) -> Result<Self, String> {
        let table: Table = toml::from_str(text)
            .map_err(|error| error.to_string().trim_end().replace('\n', " / "))?;
        let members = table.members.into_iter().map(|member| {
            let recipe = match member {
                Member::Named(name) => ModelRecipe::load(&name),
                Member::Own(own) => ModelRecipe::parse("a member", &own.to_string()),
            };
            recipe.map_err(|error| error.to_string())
        });
        let recipe = Self {
            name: table.name,
            members: members.collect::<Result<_, _>>()?,
        };
        recipe.validate()?;
        Ok(recipe)
    }

    fn validate(&self) -> Result<(), String> {
        if self.members.is_empty() {
            return Err("members: expected at least one model".into());
        }
        let mut names = BTreeSet::new();
        for member in &self.members {
            if let ModelRecipe::Committee(inner) = member {
                return Err(format!("members: `{}` is a committee itself", inner.name));
            }
            if !names.insert(member.name()) {
                return Err(format!(
                    "members: two are named `{}`; give one of them another name",
                    member.name()
                ));
            }
        }
        Ok(())
    }

    /// Returns the recipe as TOML, with the complete recipes of all members.
    pub(crate) fn to_toml(&self) -> String {
        let table = |member: &ModelRecipe| {
            let text = member.to_toml();
            text.parse::<toml::Table>()
                .unwrap_or_else(|error| panic!("a recipe is always valid TOML: {error}"))
        };
        let members: Vec<toml::Value> = self.members.iter().map(table).map(Into::into).collect();
        let mut whole = toml::Table::new();
        whole.insert("name".into(), self.name.clone().into());
        whole.insert("members".into(), members.into());
        whole.to_string()
    }

    /// Returns the prediction method: Monte Carlo dropout if a member uses it, with the number of samples of the first of them.
    pub fn method(&self) -> PredictionMethod {
        let methods = self.members.iter().map(ModelRecipe::method);
        let dropout = methods.filter(|method| *method != PredictionMethod::Plain);
        dropout.take(1).next().unwrap_or(PredictionMethod::Plain)
    }

    /// Returns the committee of the members that can be trained on these sweeps, and the others.
    ///
    /// # Errors
    /// The error of the first member if no member can be trained.
    pub(crate) fn for_sweeps(
        self,
        sweeps: CommitteeSweeps<'_>,
    ) -> Result<(Self, Vec<LeftOutMember>), PipelineError> {
        let (mut kept, mut left_out, mut first) = (Vec::new(), Vec::new(), None);
        for member in self.members {
            let name = member.name().to_string();
            let starved = member.starved(sweeps.counts);
            match member.check_sweeps(sweeps.shape, sweeps.rate_hz) {
                Err(error) => {
                    left_out.push(LeftOutMember {
                        name,
                        reason: error.to_string(),
                    });
                    first.get_or_insert(error);
                }
                Ok(()) => match starved {
                    None => kept.push(member),
                    Some((label, needed)) => left_out.push(LeftOutMember {
                        name,
                        reason: format!(
                            "it needs {needed} training sweeps of every material, and one has {}",
                            sweeps.counts[label]
                        ),
                    }),
                },
            }
        }
        match (kept.is_empty(), first) {
            (true, Some(error)) => Err(error),
            (true, None) => Err(PipelineError::incompatible(
                "training sweeps",
                "enough for one member of the committee",
                "too few of a material",
            )),
            (false, _) => Ok((
                Self {
                    name: self.name,
                    members: kept,
                },
                left_out,
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(members: &str) -> Result<CommitteeRecipe, String> {
        CommitteeRecipe::parse(&format!("name = \"own\"\nmembers = [{members}]"))
    }

    #[test]
    fn members_are_named_or_defined() {
        let own = "{ name = \"near\", features = \"means\", classifier = { kind = \"knn\", neighbours = [3] } }";
        let recipe = parse(&format!("\"lda\", {own}")).unwrap();
        let names: Vec<&str> = recipe.members.iter().map(ModelRecipe::name).collect();
        assert_eq!(names, ["lda", "near"]);
        assert_eq!(recipe.method(), PredictionMethod::Plain);
        let again = CommitteeRecipe::parse(&recipe.to_toml()).unwrap();
        assert_eq!(again, recipe);
        let with_network = parse("\"lda\", \"spectra\", \"fast\"").unwrap();
        assert_eq!(
            with_network.method(),
            PredictionMethod::McDropout { mc_samples: 100 }
        );
    }

    #[test]
    fn committees_that_cannot_be_are_refused() {
        for (members, reason) in [
            ("", "at least one"),
            ("\"lda\", \"lda\"", "two are named `lda`"),
            ("\"committee\"", "is a committee itself"),
            ("\"lta\"", "did you mean `lda`?"),
        ] {
            let refused = parse(members).unwrap_err();
            assert!(refused.contains(reason), "{refused}");
        }
    }

    #[test]
    fn members_that_the_sweeps_do_not_allow_are_left_out_with_the_reason() {
        let shape = |steps| SweepShape {
            steps,
            rows: 1,
            cols: 3,
        };
        let sweeps = |steps, counts| CommitteeSweeps {
            shape: shape(steps),
            rate_hz: 20.0,
            counts,
        };
        let recipe = parse("\"knn-h\", \"lda\", \"means\"").unwrap();
        let (kept, left_out) = recipe.clone().for_sweeps(sweeps(100, &[5, 5])).unwrap();
        assert_eq!(kept.members.len(), 2);
        assert_eq!(left_out[0].name, "knn-h");
        assert!(left_out[0].reason.contains("Hz"), "{}", left_out[0].reason);
        let recipe = parse("\"svm-spectra\", \"spectra\"").unwrap();
        let (kept, left_out) = recipe.for_sweeps(sweeps(100, &[5, 1])).unwrap();
        assert_eq!(kept.members[0].name(), "spectra");
        assert!(left_out[0].reason.contains("2 training sweeps"));
        let only = parse("\"knn-h\"").unwrap();
        assert!(only.for_sweeps(sweeps(100, &[5, 5])).is_err());
    }
}
