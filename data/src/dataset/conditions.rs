//! Conditions: numbers per sweep that the robot knows, such as speed and force.
//!
//! A data set holds them as columns behind the taxels, constant during a sweep, so that every model has them as inputs.

use std::borrow::Cow;
use std::fmt;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::{DataError, Dataset, Samples, SweepShape, hex};

/// Quantity that is known for every sweep.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Quantity {
    /// Speed of the motion.
    Speed,
    /// Contact force.
    Force,
}

impl Quantity {
    /// All quantities.
    pub const ALL: [Self; 2] = [Self::Speed, Self::Force];

    /// Returns the name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Speed => "speed",
            Self::Force => "force",
        }
    }
}

/// Quantity and unit of a number per sweep.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Condition {
    /// Quantity.
    pub quantity: Quantity,
    /// Unit, if the data names one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
}

impl Condition {
    /// Returns the condition that a column or array of this name holds; `None` for another name.
    ///
    /// ```
    /// use tactnet_data::{Condition, Quantity};
    ///
    /// let speed = Condition::of_name("Speed [mm/s]").unwrap();
    /// assert_eq!((speed.quantity, speed.unit.as_deref()), (Quantity::Speed, Some("mm/s")));
    /// assert_eq!(speed.to_string(), "speed [mm/s]");
    /// assert_eq!(Condition::of_name("force_x"), None);
    /// ```
    pub fn of_name(name: &str) -> Option<Self> {
        let (name, unit) = match name.split_once(['[', '(']) {
            Some((name, unit)) => (name, unit.trim_end().trim_end_matches([']', ')']).trim()),
            None => (name, ""),
        };
        let name = name.trim();
        let is_named = |of: &Quantity| name.eq_ignore_ascii_case(of.name());
        Some(Self {
            quantity: Quantity::ALL.into_iter().find(is_named)?,
            unit: (!unit.is_empty()).then(|| unit.to_owned()),
        })
    }
}

impl fmt::Display for Condition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.unit {
            None => f.write_str(self.quantity.name()),
            Some(unit) => write!(f, "{} [{unit}]", self.quantity.name()),
        }
    }
}

/// Condition with its value in every sweep.
#[derive(Debug, Clone, PartialEq)]
pub struct ConditionValues {
    /// Quantity and unit.
    pub condition: Condition,
    /// One number per sweep, in the unit of the data: `[sweeps]`.
    pub values: Vec<f32>,
}

/// Meaning of the last columns of a data set.
#[derive(Debug, Clone, Default)]
pub(super) struct ConditionColumns {
    /// The conditions, in the order of their columns, each quantity once.
    pub(super) conditions: Vec<Condition>,
    /// Number of rows of the taxels in front of them.
    pub(super) rows: usize,
}

impl ConditionColumns {
    /// Returns the checksum of a data set with these columns; `sha256` is that of everything except their meaning.
    pub(super) fn digest(&self, sha256: String) -> String {
        if self.conditions.is_empty() {
            return sha256;
        }
        let mut hash = Sha256::new();
        hash.update(sha256);
        hash.update((self.rows as u64).to_le_bytes());
        for condition in &self.conditions {
            hash.update(condition.to_string());
            hash.update([0]);
        }
        hex(hash.finalize())
    }
}

impl Dataset {
    /// Returns the conditions, in the order of their columns behind the taxels.
    pub fn conditions(&self) -> &[Condition] {
        &self.columns.conditions
    }

    /// Returns the shape of the sweeps without conditions.
    pub fn taxel_shape(&self) -> SweepShape {
        if self.conditions().is_empty() {
            return self.shape();
        }
        let taxels = self.shape().taxels() - self.conditions().len();
        SweepShape {
            rows: self.columns.rows,
            cols: taxels / self.columns.rows,
            ..self.shape()
        }
    }

    /// Returns the conditions with their values.
    pub fn condition_values(&self) -> Vec<ConditionValues> {
        let first = self.taxel_shape().taxels();
        let of_column = |(place, condition): (usize, &Condition)| ConditionValues {
            condition: condition.clone(),
            values: (0..self.len())
                .map(|sweep| {
                    let mut value = [0.0];
                    let start = sweep * self.shape().values() + first + place;
                    self.samples().copy_to(start, &mut value);
                    value[0]
                })
                .collect(),
        };
        let conditions = self.conditions().iter().enumerate();
        conditions.map(of_column).collect()
    }

    /// Adds conditions behind the taxels, which then form one row. [`Dataset::taxel_shape`] keeps their arrangement.
    ///
    /// # Errors
    /// A value for another number of sweeps; a value that is not finite; a quantity that the data set has.
    ///
    /// ```
    /// use tactnet_data::twin;
    /// use tactnet_data::{Condition, ConditionValues};
    ///
    /// let twin = twin::small(2, 2, 100)?;
    /// let condition = Condition::of_name("speed [mm/s]").unwrap();
    /// let speed = ConditionValues { condition, values: vec![30.0, 25.0, 40.0, 35.0] };
    /// let known = twin.clone().with_conditions(&[speed])?;
    /// assert_eq!((known.shape().cols, known.taxel_shape().cols), (17, 4));
    /// assert_eq!(known.sweep(1)[16], 25.0);
    /// assert_eq!(known.without_conditions().sha256(), twin.sha256());
    /// # Ok::<(), tactnet_data::DataError>(())
    /// ```
    pub fn with_conditions(self, added: &[ConditionValues]) -> Result<Self, DataError> {
        let mut columns = ConditionColumns {
            rows: self.taxel_shape().rows,
            ..self.columns.clone()
        };
        for ConditionValues { condition, values } in added {
            let quantity = condition.quantity;
            let finite = values.iter().filter(|value| value.is_finite()).count();
            if [values.len(), finite] != [self.len(); 2] {
                let expected = format!("a finite number for each of {} sweeps", self.len());
                let found = format!("{finite} of {}", values.len());
                return Err(DataError::inconsistent(quantity.name(), expected, found));
            }
            if columns.conditions.iter().any(|of| of.quantity == quantity) {
                let expected = "one number per sweep";
                return Err(DataError::inconsistent(quantity.name(), expected, "two"));
            }
            columns.conditions.push(condition.clone());
        }
        if added.is_empty() {
            return Ok(self);
        }
        let shape = SweepShape {
            rows: 1,
            cols: self.shape().taxels() + added.len(),
            ..self.shape()
        };
        let numbers: Vec<&[f32]> = added.iter().map(|of| of.values.as_slice()).collect();
        let samples = with_columns(&self, &numbers);
        let known = Self {
            shape,
            columns,
            samples,
            ..self
        };
        known.sealed()
    }

    /// Returns the data set without its conditions.
    pub fn without_conditions(&self) -> Cow<'_, Self> {
        if self.conditions().is_empty() {
            return Cow::Borrowed(self);
        }
        let shape = self.taxel_shape();
        let samples = self.samples.heads(self.shape.taxels(), shape.taxels());
        let plain = Self {
            name: self.name.clone(),
            sample_rate_hz: self.sample_rate_hz,
            rate_assumed: self.rate_assumed,
            patch_assumed: self.patch_assumed,
            reading_findings: self.reading_findings.clone(),
            shape,
            labels: self.labels.clone(),
            records: self.records.clone(),
            samples: samples.narrowed(),
            sha256: String::new(),
            origin: self.origin,
            lengths: self.lengths.clone(),
            columns: ConditionColumns::default(),
        };
        Cow::Owned(plain.with_checksum())
    }
}

/// Returns the samples with a column for each of `added` (`[columns][sweeps]`), in the smallest type that holds them.
fn with_columns(dataset: &Dataset, added: &[&[f32]]) -> Samples {
    let shape = dataset.shape();
    let mut values =
        Vec::with_capacity(dataset.len() * (shape.values() + shape.steps * added.len()));
    let mut sweep = vec![0.0; shape.values()];
    for index in 0..dataset.len() {
        dataset.samples.copy_to(index * shape.values(), &mut sweep);
        for frame in sweep.chunks_exact(shape.taxels()) {
            values.extend_from_slice(frame);
            values.extend(added.iter().map(|of| of[index]));
        }
    }
    Samples::F32(values).narrowed()
}
