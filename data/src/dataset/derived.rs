//! Data sets that are derived from others.

use crate::format::{NamedSweeps, named_rate, records};
use crate::twin::TwinVersion;
use crate::{
    DataError, DataOrigin, Dataset, Finding, FindingKind, LabelSet, Seed, Severity, SweepRecord,
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
    /// use tactnet_data::twin;
    ///
    /// let twin = twin::small(2, 2, 100)?.with_named_rate(Some(100.0))?;
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
        let mut reading_findings = self.reading_findings.clone();
        reading_findings.extend(sweeps.findings);
        let cut = Self {
            name: self.name.clone(),
            sample_rate_hz: sweeps.rate_hz.unwrap_or(self.sample_rate_hz),
            rate_assumed: self.rate_assumed && sweeps.rate_hz.is_none(),
            patch_assumed: self.patch_assumed,
            reading_findings,
            shape: sweeps.shape,
            lengths: sweeps.lengths,
            records: records(&of_sweep, labels.len(), sweeps.blocks, sweeps.test),
            labels,
            samples: sweeps.samples,
            sha256: String::new(),
            origin: self.origin,
            columns: self.columns.clone(),
        };
        cut.sealed()
    }

    /// Sets the sample rate, in Hz.
    ///
    /// # Errors
    /// A rate that is not a positive number.
    pub fn with_sample_rate(self, sample_rate_hz: f64) -> Result<Self, DataError> {
        let known = Self {
            sample_rate_hz,
            rate_assumed: false,
            ..self
        };
        known.sealed()
    }

    /// Sets the name.
    ///
    /// ```
    /// use tactnet_data::twin;
    ///
    /// assert_eq!(twin::small(2, 2, 100)?.with_name("Monday").name(), "Monday");
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
    /// use tactnet_data::twin;
    ///
    /// assert!(twin::small(2, 2, 100)?.with_assumed_rate().is_rate_assumed());
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
    /// use tactnet_data::twin;
    ///
    /// let flat = twin::small(2, 2, 100)?.with_patch(2, 8)?;
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
        let named = Self {
            patch_assumed: false,
            shape,
            columns,
            ..self
        };
        named.sealed()
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
    /// use tactnet_data::twin;
    ///
    /// let short = twin::small(2, 2, 100)?.first_steps(40)?;
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
        let heads = Self {
            name,
            shape,
            lengths: None,
            samples,
            ..self
        };
        heads.sealed()
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
        let permuted = Self {
            name,
            records,
            ..self
        };
        permuted.sealed()
    }

    /// Returns the sweeps of the materials with these labels, relabelled in the order of `labels`.
    ///
    /// # Errors
    /// No label, a duplicate or unknown label, or materials without sweeps.
    ///
    /// ```
    /// use tactnet_data::twin;
    ///
    /// let part = twin::small(4, 2, 100)?.of_materials(&[3, 1])?;
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
        let name = format!("{}, {} materials", self.name, labels.len());
        self.part(name, set, records, &indices)
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
    /// use tactnet_data::twin;
    ///
    /// let twin = twin::small(4, 2, 100)?;
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
        let name = format!("{}, {} sweeps", self.name, indices.len());
        self.part(name, set, records, indices)
    }

    /// Returns the sweeps with these indices, as `records` and `labels` describe them.
    fn part(
        &self,
        name: String,
        labels: LabelSet,
        records: Vec<SweepRecord>,
        indices: &[usize],
    ) -> Result<Self, DataError> {
        let lengths = self.lengths.as_ref();
        let part = Self {
            name,
            sample_rate_hz: self.sample_rate_hz,
            rate_assumed: self.rate_assumed,
            patch_assumed: self.patch_assumed,
            reading_findings: Vec::new(),
            shape: self.shape,
            lengths: lengths.map(|all| indices.iter().map(|index| all[*index]).collect()),
            labels,
            records,
            samples: self.samples.gather(self.shape.values(), indices),
            sha256: String::new(),
            origin: self.origin,
            columns: self.columns.clone(),
        };
        part.sealed()
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
        let one = Self {
            records: records.collect(),
            origin: DataOrigin::of_recording(self.shape, &labels),
            labels,
            ..self
        };
        one.sealed()
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
        let one = Self {
            patch_assumed: false,
            shape,
            records: vec![SweepRecord::new(0, 0)],
            ..self
        };
        one.sealed()
    }
}
