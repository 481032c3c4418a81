//! Conditions that a classifier was trained with: speed and force of each sweep, which the robot may know.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};
use tactnet_data::{
    Condition, ConditionValues, Dataset, Finding, FindingKind, Severity, SweepShape, TrainSplit,
};

use crate::{ClassifierConfig, PipelineError};

/// Conditions of the training sweeps, in the order of their columns behind the taxels.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainedConditions {
    /// Number of rows of the taxels.
    rows: usize,
    columns: Vec<TrainedCondition>,
}

/// Condition with its values in the training sweeps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainedCondition {
    /// Quantity and unit.
    pub condition: Condition,
    /// Mean, which stands for an unknown value.
    pub mean: f32,
    /// Smallest and largest value.
    pub range: [f32; 2],
}

impl TrainedConditions {
    /// Returns the conditions of the training sweeps.
    pub(crate) fn of(train: &TrainSplit<'_>) -> Self {
        let dataset = train.dataset();
        let columns = dataset.condition_values().into_iter().map(|of| {
            let values = || train.indices().iter().map(|&index| of.values[index]);
            TrainedCondition {
                mean: (values().map(f64::from).sum::<f64>() / train.len() as f64) as f32,
                range: [
                    values().fold(f32::INFINITY, f32::min),
                    values().fold(f32::NEG_INFINITY, f32::max),
                ],
                condition: of.condition.clone(),
            }
        });
        Self {
            columns: columns.collect(),
            rows: match dataset.conditions() {
                [] => 0,
                _ => dataset.taxel_shape().rows,
            },
        }
    }

    /// Returns the conditions in the order of their columns.
    pub fn columns(&self) -> &[TrainedCondition] {
        &self.columns
    }

    /// Returns true if the training sweeps have none.
    pub fn is_empty(&self) -> bool {
        self.columns.is_empty()
    }
}

impl ClassifierConfig {
    /// Returns the shape of the sweeps of the skin, without conditions.
    pub fn taxel_shape(&self) -> SweepShape {
        let conditions = self.conditions.columns.len();
        if conditions == 0 {
            return self.shape;
        }
        SweepShape {
            rows: self.conditions.rows,
            cols: (self.shape.taxels() - conditions) / self.conditions.rows.max(1),
            ..self.shape
        }
    }

    /// Returns the sweeps with the conditions of the training sweeps. One that the data lacks has its mean of the training
    /// sweeps; one that training lacked is left out.
    ///
    /// # Errors
    /// A condition in another unit.
    pub fn with_own_conditions<'a>(
        &self,
        dataset: &'a Dataset,
    ) -> Result<Cow<'a, Dataset>, PipelineError> {
        let own = &self.conditions.columns;
        for known in own.iter().map(|of| &of.condition) {
            let mut found = dataset.conditions().iter();
            let found = found.find(|of| of.quantity == known.quantity);
            let units = (&known.unit, found.and_then(|of| of.unit.as_ref()));
            if let (Some(unit), Some(other)) = units
                && unit != other
            {
                return Err(PipelineError::incompatible(
                    known.quantity.name(),
                    format!("values in {unit}, as in training"),
                    format!("values in {other}"),
                ));
            }
        }
        let quantities = own.iter().map(|of| of.condition.quantity);
        if quantities.eq(dataset.conditions().iter().map(|of| of.quantity)) {
            return Ok(Cow::Borrowed(dataset));
        }
        let found = dataset.condition_values();
        let values = own.iter().map(|known| {
            let quantity = known.condition.quantity;
            let given = found.iter().find(|of| of.condition.quantity == quantity);
            ConditionValues {
                condition: known.condition.clone(),
                values: match given {
                    Some(of) => of.values.clone(),
                    None => vec![known.mean; dataset.len()],
                },
            }
        });
        let values: Vec<ConditionValues> = values.collect();
        let bare = dataset.without_conditions().into_owned();
        Ok(Cow::Owned(bare.with_conditions(&values)?))
    }

    /// Returns sweeps as [`ClassifierConfig::with_own_conditions`], with a finding on every condition that differs.
    ///
    /// # Errors
    /// A condition in another unit.
    pub(crate) fn conformed(&self, dataset: Dataset) -> Result<Dataset, PipelineError> {
        let findings = self.condition_findings(&dataset);
        let own = self.with_own_conditions(&dataset)?;
        let own = match own {
            Cow::Borrowed(_) => dataset,
            Cow::Owned(own) => own,
        };
        Ok(own.with_reading_findings(findings))
    }

    /// Returns a warning on every condition that the data lacks, that training lacked, or that is outside its training range.
    fn condition_findings(&self, dataset: &Dataset) -> Vec<Finding> {
        let warning = |message: String| {
            Finding::new(Severity::Warning, FindingKind::OtherConditions, message)
        };
        let found = dataset.condition_values();
        let mut findings = Vec::new();
        for TrainedCondition {
            condition,
            mean,
            range: [low, high],
        } in &self.conditions.columns
        {
            let (name, unit) = (condition.quantity.name(), condition.unit.as_deref());
            let unit = unit.map_or(String::new(), |unit| format!(" {unit}"));
            let is_same = |of: &&ConditionValues| of.condition.quantity == condition.quantity;
            let Some(given) = found.iter().find(is_same) else {
                findings.push(warning(format!(
                    "the data does not name the {name} of its sweeps, which training knew: the mean of training, {mean}{unit}, stands for it"
                )));
                continue;
            };
            let is_outside = |value: &&f32| !(low..=high).contains(value);
            let outside = given.values.iter().filter(is_outside).count();
            if outside > 0 {
                findings.push(warning(format!(
                    "{outside} of {} sweeps have a {name} outside that of training, {low} to {high}{unit}",
                    dataset.len()
                )));
            }
        }
        for of in dataset.conditions() {
            let mut known = self.conditions.columns.iter();
            if !known.any(|known| known.condition.quantity == of.quantity) {
                findings.push(warning(format!(
                    "the classifier was trained without `{}`, which is ignored",
                    of.quantity.name()
                )));
            }
        }
        findings
    }
}
