//! Data sets that are derived from others.

use super::conditions::ConditionColumns;
use crate::format::{NamedSweeps, named_rate, records};
use crate::twin::TwinVersion;
use crate::{
    DataError, Dataset, Finding, FindingKind, LabelSet, Samples, Seed, Severity, SweepRecord,
    SweepShape, shuffle,
};

impl Dataset {
    /// Sets the sample rate, in Hz. A rate that differs from the one that the data names takes precedence, with a warning
    /// among the findings. With `None` the data set does not change.
    ///
    /// # Errors
    /// A rate that is not a positive number.
    ///
    /// ```
    /// use tactnet_data::FindingKind;
    /// use tactnet_data::twin::{self, TwinConfig};
    ///
    /// let config = TwinConfig { materials: 2, sweeps: 2, steps: 100, ..TwinConfig::default() };
    /// let twin = twin::generate(&config)?.with_named_rate(Some(100.0))?;
    /// assert_eq!(twin.sample_rate_hz(), 100.0);
    /// assert_eq!(twin.reading_findings()[0].kind, FindingKind::NamedRate);
    /// # Ok::<(), tactnet_data::DataError>(())
    /// ```
    pub fn with_named_rate(self, rate_hz: Option<f64>) -> Result<Self, DataError> {
        let own = self.sample_rate_hz;
        let Some(named) = rate_hz else {
            return Ok(self);
        };
        if !self.rate_assumed && (own - named).abs() <= 1e-6 * own {
            return Ok(self);
        }
        let differs = !self.rate_assumed;
        let mut dataset = self.with_sample_rate(named)?;
        // The named rate makes up for a clock that cannot be relied on.
        let of_clock = [FindingKind::ClockBackwards, FindingKind::LostFrames];
        for finding in &mut dataset.reading_findings {
            if of_clock.contains(&finding.kind) {
                finding.severity = finding.severity.max(Severity::Warning);
            }
        }
        let finding = differs.then(|| named_rate(own, named, "the data names"));
        Ok(dataset.with_reading_findings(finding))
    }

    /// Returns a data set with these sweeps, which were cut from those of this data set.
    pub(crate) fn with_sweeps(&self, sweeps: NamedSweeps) -> Result<Self, DataError> {
        let materials = sweeps.materials.unwrap_or_default();
        let has_sweeps = |name: &&str| materials.iter().any(|material| material == name);
        let names: Vec<&str> = self.labels.names().filter(has_sweeps).collect();
        let label = |material: &String| names.iter().position(|name| name == material);
        let of_sweep: Vec<usize> = materials.iter().filter_map(label).collect();
        let labels = LabelSet::new(names)?;
        let cut = Self::new(
            self.name.clone(),
            sweeps.rate_hz.unwrap_or(self.sample_rate_hz),
            sweeps.shape,
            labels.clone(),
            records(&of_sweep, labels.len(), sweeps.blocks, sweeps.test),
            sweeps.samples,
        )?
        .with_known_lengths(sweeps.lengths)?;
        let mut reading_findings = self.reading_findings.clone();
        reading_findings.extend(sweeps.findings);
        Ok(Self {
            origin: self.origin,
            rate_assumed: self.rate_assumed && sweeps.rate_hz.is_none(),
            patch_assumed: self.patch_assumed,
            reading_findings,
            ..cut.declared(self.columns.clone())
        })
    }

    /// Sets the sample rate, in Hz.
    ///
    /// # Errors
    /// A rate that is not a positive number.
    pub fn with_sample_rate(self, sample_rate_hz: f64) -> Result<Self, DataError> {
        let (origin, patch_assumed) = (self.origin, self.patch_assumed);
        let (reading_findings, columns) = (self.reading_findings, self.columns);
        let known = Self::new(
            self.name,
            sample_rate_hz,
            self.shape,
            self.labels,
            self.records,
            self.samples,
        )?
        .with_known_lengths(self.lengths)?;
        Ok(Self {
            origin,
            patch_assumed,
            reading_findings,
            ..known.declared(columns)
        })
    }

    /// Sets the name.
    ///
    /// ```
    /// use tactnet_data::twin::{self, TwinConfig};
    ///
    /// let config = TwinConfig { materials: 2, sweeps: 2, steps: 100, ..TwinConfig::default() };
    /// assert_eq!(twin::generate(&config)?.with_name("Monday").name(), "Monday");
    /// # Ok::<(), tactnet_data::DataError>(())
    /// ```
    #[must_use]
    pub fn with_name(self, name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            ..self
        }
    }

    /// Marks the sample rate as assumed.
    ///
    /// ```
    /// use tactnet_data::twin::{self, TwinConfig};
    ///
    /// let config = TwinConfig { materials: 2, sweeps: 2, steps: 100, ..TwinConfig::default() };
    /// assert!(twin::generate(&config)?.with_assumed_rate().is_rate_assumed());
    /// # Ok::<(), tactnet_data::DataError>(())
    /// ```
    #[must_use]
    pub fn with_assumed_rate(self) -> Self {
        Self {
            rate_assumed: true,
            ..self
        }
    }

    /// Arranges the taxels in `rows` by `cols`, row by row. Conditions stay behind them.
    ///
    /// # Errors
    /// Another number of taxels than `rows * cols`.
    ///
    /// ```
    /// use tactnet_data::twin::{self, TwinConfig};
    ///
    /// let config = TwinConfig { materials: 2, sweeps: 2, steps: 100, ..TwinConfig::default() };
    /// let flat = twin::generate(&config)?.with_patch(2, 8)?;
    /// assert_eq!((flat.shape().rows, flat.shape().cols), (2, 8));
    /// assert!(flat.with_patch(3, 3).is_err());
    /// # Ok::<(), tactnet_data::DataError>(())
    /// ```
    pub fn with_patch(self, rows: usize, cols: usize) -> Result<Self, DataError> {
        let taxels = self.taxel_shape().taxels();
        if rows * cols != taxels {
            return Err(DataError::inconsistent(
                "shape",
                format!("rows by columns of {taxels} taxels"),
                format!("{rows}x{cols}"),
            ));
        }
        let mut shape = SweepShape {
            rows,
            cols,
            ..self.shape
        };
        let mut columns = self.columns.clone();
        if !columns.conditions.is_empty() {
            (shape, columns.rows) = (self.shape, rows);
        }
        let name = self.name.clone();
        let named = self.rebuilt_with(name, shape, columns, |this| (this.records, this.samples))?;
        Ok(Self {
            patch_assumed: false,
            ..named
        })
    }

    /// Marks the arrangement of the taxels in one row as assumed, because the file does not name one.
    pub(crate) fn with_assumed_patch(self) -> Self {
        Self {
            patch_assumed: true,
            ..self
        }
    }

    /// Adds findings that only the reader of the file can make.
    pub fn with_reading_findings(mut self, findings: impl IntoIterator<Item = Finding>) -> Self {
        self.reading_findings.extend(findings);
        self
    }

    /// Marks the sweeps as generated by a twin. Files keep the mark, and another name becomes "twin (name)", so results
    /// on the twin cannot be mistaken for results on TactMat.
    pub fn into_twin(mut self, version: TwinVersion) -> Self {
        if self.name != version.name() {
            self.name = format!("{} ({})", version.name(), self.name);
        }
        self.origin = version.into();
        self
    }

    /// Keeps the first `steps` time steps of every sweep, for classifiers that decide early.
    ///
    /// # Errors
    /// No step, or more steps than a sweep has.
    ///
    /// ```
    /// use tactnet_data::twin::{self, TwinConfig};
    ///
    /// let config = TwinConfig { materials: 2, sweeps: 2, steps: 100, ..TwinConfig::default() };
    /// let short = twin::generate(&config)?.first_steps(40)?;
    /// assert_eq!(short.shape().steps, 40);
    /// # Ok::<(), tactnet_data::DataError>(())
    /// ```
    pub fn first_steps(self, steps: usize) -> Result<Self, DataError> {
        let shortest = self.shortest();
        if steps == 0 || steps > shortest {
            return Err(DataError::inconsistent(
                "steps",
                format!("1 to {shortest}"),
                steps.to_string(),
            ));
        }
        if steps == self.shape.steps {
            return Ok(self);
        }
        let shape = SweepShape {
            steps,
            ..self.shape
        };
        let samples = self.samples.heads(self.shape.values(), shape.values());
        let name = format!("{}, first {steps} steps", self.name);
        let equal = Self {
            lengths: None,
            ..self
        };
        equal.rebuilt(name, shape, |this| (this.records.clone(), samples))
    }

    /// Permutes the labels at random among all sweeps. A sound experiment on the result scores chance; a better score
    /// shows leaked test sweeps (permutation test, Ojala & Garriga, 2010).
    ///
    /// # Errors
    /// None for a valid data set.
    pub fn permute_labels(self, seed: Seed) -> Result<Self, DataError> {
        let mut labels: Vec<usize> = self.records.iter().map(|record| record.label).collect();
        shuffle(&mut labels, &mut seed.rng("permuted labels"));
        let mut sweeps = vec![0; self.labels.len()];
        let records = self
            .records
            .iter()
            .zip(labels)
            .map(|(record, label)| {
                sweeps[label] += 1;
                SweepRecord {
                    label,
                    sweep: sweeps[label] - 1,
                    ..record.clone()
                }
            })
            .collect();
        let name = format!("{}, labels permuted", self.name);
        let shape = self.shape;
        self.rebuilt(name, shape, |this| (records, this.samples))
    }

    /// Returns the sweeps of the materials with these labels, relabelled in the order of `labels`.
    ///
    /// # Errors
    /// No label, a duplicate or unknown label, or materials without sweeps.
    ///
    /// ```
    /// use tactnet_data::twin::{self, TwinConfig};
    ///
    /// let config = TwinConfig { materials: 4, sweeps: 2, steps: 100, ..TwinConfig::default() };
    /// let part = twin::generate(&config)?.of_materials(&[3, 1])?;
    /// assert_eq!((part.len(), part.labels().len()), (4, 2));
    /// # Ok::<(), tactnet_data::DataError>(())
    /// ```
    pub fn of_materials(&self, labels: &[usize]) -> Result<Self, DataError> {
        if let Some(label) = labels.iter().find(|label| **label >= self.labels.len()) {
            return Err(DataError::inconsistent(
                "materials",
                format!("labels below {}", self.labels.len()),
                format!("label {label}"),
            ));
        }
        let set = LabelSet::new(labels.iter().map(|label| self.labels.name(*label)))?;
        let mut indices = Vec::new();
        let mut records = Vec::new();
        for (index, record) in self.records.iter().enumerate() {
            if let Some(label) = labels.iter().position(|label| *label == record.label) {
                indices.push(index);
                records.push(SweepRecord {
                    label,
                    ..record.clone()
                });
            }
        }
        let samples = self.samples.gather(self.shape.values(), &indices);
        let name = format!("{}, {} materials", self.name, labels.len());
        let lengths = self.lengths.as_ref();
        let lengths = lengths.map(|all| indices.iter().map(|index| all[*index]).collect());
        let part = Self::new(name, self.sample_rate_hz, self.shape, set, records, samples)?
            .with_known_lengths(lengths)?;
        Ok(Self {
            origin: self.origin,
            rate_assumed: self.rate_assumed,
            patch_assumed: self.patch_assumed,
            ..part.declared(self.columns.clone())
        })
    }

    /// Returns the sweeps with these indices, in this order, with the materials that occur. Repetitions are allowed.
    ///
    /// # Errors
    /// No index.
    ///
    /// # Panics
    /// If an index is out of range.
    ///
    /// ```
    /// use tactnet_data::twin::{self, TwinConfig};
    ///
    /// let config = TwinConfig { materials: 4, sweeps: 2, steps: 100, ..TwinConfig::default() };
    /// let twin = twin::generate(&config)?;
    /// let part = twin.of_sweeps(&[6, 0, 7])?;
    /// assert_eq!((part.len(), part.labels().len()), (3, 2));
    /// assert_eq!(part.sweep(0), twin.sweep(6));
    /// # Ok::<(), tactnet_data::DataError>(())
    /// ```
    pub fn of_sweeps(&self, indices: &[usize]) -> Result<Self, DataError> {
        let known = || indices.iter().map(|index| &self.records[*index]);
        let occurs = |label: &usize| known().any(|record| record.label == *label);
        let labels: Vec<usize> = (0..self.labels.len()).filter(occurs).collect();
        let mut sweeps = vec![0; labels.len()];
        let records = known().map(|record| {
            let label = labels
                .iter()
                .take_while(|label| **label < record.label)
                .count();
            sweeps[label] += 1;
            SweepRecord {
                label,
                sweep: sweeps[label] - 1,
                ..record.clone()
            }
        });
        let records: Vec<SweepRecord> = records.collect();
        let set = LabelSet::new(labels.iter().map(|label| self.labels.name(*label)))?;
        let samples = self.samples.gather(self.shape.values(), indices);
        let name = format!("{}, {} sweeps", self.name, indices.len());
        let lengths = self.lengths.as_ref();
        let lengths = lengths.map(|all| indices.iter().map(|index| all[*index]).collect());
        let part = Self::new(name, self.sample_rate_hz, self.shape, set, records, samples)?
            .with_known_lengths(lengths)?;
        Ok(Self {
            origin: self.origin,
            rate_assumed: self.rate_assumed,
            patch_assumed: self.patch_assumed,
            ..part.declared(self.columns.clone())
        })
    }

    /// Assigns all sweeps of an unlabelled file to one material.
    ///
    /// # Errors
    /// An invalid name, see [`LabelSet::new`].
    pub fn of_one_material(self, name: &str) -> Result<Self, DataError> {
        let labels = LabelSet::new([name])?;
        let records = self.records.iter().enumerate();
        let records = records.map(|(sweep, record)| SweepRecord {
            label: 0,
            sweep,
            ..record.clone()
        });
        let one = Self::new(
            self.name,
            self.sample_rate_hz,
            self.shape,
            labels,
            records.collect(),
            self.samples,
        )?
        .with_known_lengths(self.lengths)?;
        Ok(Self {
            rate_assumed: self.rate_assumed,
            patch_assumed: self.patch_assumed,
            reading_findings: self.reading_findings,
            ..one.declared(self.columns)
        })
    }

    /// Reinterprets all values as one sweep of this shape with the first material, for a file of `[steps][rows][cols]`
    /// that was read as `[sweeps][steps][taxels]`.
    ///
    /// # Errors
    /// Another number of values.
    pub fn as_one_sweep(self, shape: SweepShape) -> Result<Self, DataError> {
        let found = self.len() * self.shape.values();
        if found != shape.values() {
            return Err(DataError::inconsistent(
                "values",
                format!("{} of one sweep", shape.values()),
                found.to_string(),
            ));
        }
        let name = self.name.clone();
        let one = self.rebuilt(name, shape, |this| {
            let record = SweepRecord::new(0, 0);
            (vec![record], this.samples)
        })?;
        Ok(Self {
            patch_assumed: false,
            ..one
        })
    }

    fn rebuilt(
        self,
        name: String,
        shape: SweepShape,
        parts: impl FnOnce(Self) -> (Vec<SweepRecord>, Samples),
    ) -> Result<Self, DataError> {
        let columns = self.columns.clone();
        self.rebuilt_with(name, shape, columns, parts)
    }

    /// Returns a data set with other sweeps and conditions.
    pub(super) fn rebuilt_with(
        self,
        name: String,
        shape: SweepShape,
        columns: ConditionColumns,
        parts: impl FnOnce(Self) -> (Vec<SweepRecord>, Samples),
    ) -> Result<Self, DataError> {
        let (rate, labels, origin) = (self.sample_rate_hz, self.labels.clone(), self.origin);
        let (rate_assumed, patch_assumed) = (self.rate_assumed, self.patch_assumed);
        let reading_findings = self.reading_findings.clone();
        let lengths = self.lengths.clone();
        let (records, samples) = parts(self);
        let rebuilt =
            Self::new(name, rate, shape, labels, records, samples)?.with_known_lengths(lengths)?;
        Ok(Self {
            origin,
            rate_assumed,
            patch_assumed,
            reading_findings,
            ..rebuilt.declared(columns)
        })
    }
}
