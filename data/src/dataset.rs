//! Data sets: ordered sweeps with material, block and checksum.

mod conditions;
mod derived;
mod lengths;

use crate::{DataError, DataOrigin, Finding, LabelSet, Samples, hex, is_control};
use conditions::ConditionColumns;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

pub use conditions::{Condition, ConditionValues, Quantity};

/// Assumed sample rate of data that names none, in Hz: the rate of TactMat's 4256E skin.
pub const ASSUMED_RATE_HZ: f64 = 750.0;

/// Shape of all sweeps of a data set: time steps by a `rows x cols` patch of taxels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct SweepShape {
    /// Number of time steps.
    pub steps: usize,
    /// Number of rows of taxels.
    pub rows: usize,
    /// Number of columns of taxels.
    pub cols: usize,
}

impl SweepShape {
    /// Returns the number of taxels.
    pub fn taxels(self) -> usize {
        self.rows * self.cols
    }

    /// Returns the number of values in one sweep.
    pub fn values(self) -> usize {
        self.steps * self.taxels()
    }
}

impl std::fmt::Display for SweepShape {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{} steps of {}x{} taxels",
            self.steps, self.rows, self.cols
        )
    }
}

/// Metadata of one sweep.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct SweepRecord {
    /// Label of the material, an index into the data set's [`LabelSet`].
    pub label: usize,
    /// Number of the sweep among those of its material, in recording order.
    pub sweep: usize,
    /// Recording block: sweeps of one block were recorded in one session, under the same drift.
    pub block: Option<u32>,
    /// True if the author of the data set assigned the sweep to the test set.
    pub test: Option<bool>,
}

impl SweepRecord {
    /// Returns the metadata of a sweep without recording block and test set.
    ///
    /// - `sweep`: number of the sweep among those of its material
    ///
    /// ```
    /// assert_eq!(tactnet_data::SweepRecord::new(1, 0).block, None);
    /// ```
    pub fn new(label: usize, sweep: usize) -> Self {
        Self {
            label,
            sweep,
            block: None,
            test: None,
        }
    }
}

/// Ordered sweeps, each with its material. They have one shape, except for their lengths; see [`Dataset::with_lengths`].
///
/// ```
/// use tactnet_data::{Dataset, LabelSet, Samples, SweepRecord, SweepShape};
///
/// let shape = SweepShape { steps: 3, rows: 1, cols: 2 };
/// let labels = LabelSet::new(["cork", "denim"])?;
/// let of_label = |label| SweepRecord::new(label, 0);
/// let samples = Samples::U8(vec![0, 9, 1, 9, 2, 9, 7, 5, 7, 4, 7, 3]);
/// let records = vec![of_label(0), of_label(1)];
/// let dataset = Dataset::new("two sweeps", 100.0, shape, labels, records, samples)?;
/// assert_eq!(dataset.len(), 2);
/// assert_eq!(dataset.sweep(1), [7.0, 5.0, 7.0, 4.0, 7.0, 3.0]);
/// assert_eq!(dataset.describe(1), "`denim` sweep 0");
/// # Ok::<(), tactnet_data::DataError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Dataset {
    name: String,
    sample_rate_hz: f64,
    rate_assumed: bool,
    patch_assumed: bool,
    /// Findings that only the reader of the file can make.
    reading_findings: Vec<Finding>,
    shape: SweepShape,
    /// Number of frames of each sweep; `None` if all have `shape.steps`.
    lengths: Option<Vec<usize>>,
    labels: LabelSet,
    records: Vec<SweepRecord>,
    samples: Samples,
    sha256: String,
    origin: DataOrigin,
    /// Columns behind the taxels that hold conditions.
    columns: ConditionColumns,
}

impl Dataset {
    /// Returns a data set of these parts; see [`Dataset`] for an example.
    ///
    /// - `name`: name of the data set ("twin", a file's stem)
    /// - `sample_rate_hz`: frames per second
    /// - `samples`: `[records][steps][rows][cols]`, row-major
    ///
    /// # Errors
    /// Values that do not match the shape, labels without a material, a sample rate that is not a positive number, or
    /// `block`/`test` known for only some of the sweeps.
    pub fn new(
        name: impl Into<String>,
        sample_rate_hz: f64,
        shape: SweepShape,
        labels: LabelSet,
        records: Vec<SweepRecord>,
        samples: Samples,
    ) -> Result<Self, DataError> {
        let origin = DataOrigin::of_recording(shape, &labels);
        let dataset = Self {
            // File names may contain control characters.
            name: name.into().replace(is_control, "\u{fffd}"),
            sample_rate_hz,
            rate_assumed: false,
            patch_assumed: false,
            reading_findings: Vec::new(),
            shape,
            lengths: None,
            labels,
            records,
            samples,
            sha256: String::new(),
            origin,
            columns: ConditionColumns::default(),
        };
        dataset.sealed()
    }

    /// Checks the parts, and sets what follows from them: the lengths, if they differ, and the checksum.
    fn sealed(mut self) -> Result<Self, DataError> {
        self.check_parts()?;
        match self.lengths.take() {
            Some(lengths) => self.with_lengths(lengths),
            None => Ok(self.with_checksum()),
        }
    }

    /// Sets the checksum of the content.
    fn with_checksum(mut self) -> Self {
        self.sha256 = self.digest();
        self
    }

    /// Returns a data set of these parts; without a sample rate [`ASSUMED_RATE_HZ`] is assumed.
    ///
    /// # Errors
    /// As [`Dataset::new`].
    pub fn at_rate(
        name: impl Into<String>,
        sample_rate_hz: Option<f64>,
        shape: SweepShape,
        labels: LabelSet,
        records: Vec<SweepRecord>,
        samples: Samples,
    ) -> Result<Self, DataError> {
        let rate = sample_rate_hz.unwrap_or(ASSUMED_RATE_HZ);
        let dataset = Self::new(name, rate, shape, labels, records, samples)?;
        Ok(Self {
            // TactMat's rate is published.
            rate_assumed: sample_rate_hz.is_none() && dataset.origin != DataOrigin::Tactmat,
            ..dataset
        })
    }

    /// Returns true if the arrangement of the taxels is assumed, as for tables, which have one column per taxel.
    pub fn is_patch_assumed(&self) -> bool {
        self.patch_assumed
    }

    /// Returns the findings that only the reader of the file can make, for example about time stamps and columns that
    /// are not read. [`check`](crate::check()) includes them.
    pub fn reading_findings(&self) -> &[Finding] {
        &self.reading_findings
    }

    /// Returns true if the sample rate is assumed to be [`ASSUMED_RATE_HZ`], because the data does not name it.
    pub fn is_rate_assumed(&self) -> bool {
        self.rate_assumed
    }

    /// Returns the data set's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the origin of the sweeps.
    pub fn origin(&self) -> DataOrigin {
        self.origin
    }

    /// Returns the sample rate, in Hz; see [`Dataset::is_rate_assumed`].
    pub fn sample_rate_hz(&self) -> f64 {
        self.sample_rate_hz
    }

    /// Returns the shape of all sweeps; of the longest if their lengths differ. See [`Dataset::taxel_shape`] if there are conditions.
    pub fn shape(&self) -> SweepShape {
        self.shape
    }

    /// Returns the materials in label order.
    pub fn labels(&self) -> &LabelSet {
        &self.labels
    }

    /// Returns the metadata of all sweeps.
    pub fn records(&self) -> &[SweepRecord] {
        &self.records
    }

    /// Returns all values: `[sweeps][steps][rows][cols]`. The last frame of a shorter sweep is repeated to the length of
    /// the longest.
    pub fn samples(&self) -> &Samples {
        &self.samples
    }

    /// Returns the number of sweeps, at least 1.
    #[allow(clippy::len_without_is_empty)] // never empty, by construction
    pub fn len(&self) -> usize {
        self.records.len()
    }

    /// Returns the number of sweeps per label.
    pub fn sweeps_per_label(&self) -> Vec<usize> {
        let mut counts = vec![0; self.labels.len()];
        for record in &self.records {
            counts[record.label] += 1;
        }
        counts
    }

    /// Returns true if the author's test split is known.
    pub fn has_test_flag(&self) -> bool {
        self.records[0].test.is_some()
    }

    /// Returns true if recording blocks are known.
    pub fn has_blocks(&self) -> bool {
        self.records[0].block.is_some()
    }

    /// Returns the SHA-256 of the content (rate, shape, names, records, values, conditions), in hex. It does not depend on the file
    /// format.
    pub fn sha256(&self) -> &str {
        &self.sha256
    }

    /// Copies sweep `index` as `f32` to `out` (`[steps][rows][cols]`, digits), up to the length of the longest sweep.
    ///
    /// # Panics
    /// If there is no such sweep, or `out` has another length.
    pub fn copy_sweep(&self, index: usize, out: &mut [f32]) {
        assert_eq!(
            out.len(),
            self.shape.values(),
            "one sweep is {}",
            self.shape
        );
        self.samples.copy_to(index * self.shape.values(), out);
    }

    /// Returns the frames of sweep `index` as `[steps][rows][cols]` digits.
    ///
    /// # Panics
    /// If there is no such sweep.
    pub fn sweep(&self, index: usize) -> Vec<f32> {
        let mut out = vec![0.0; self.steps_of(index) * self.shape.taxels()];
        self.samples.copy_to(index * self.shape.values(), &mut out);
        out
    }

    /// Returns material and number of sweep `index`, for messages.
    pub fn describe(&self, index: usize) -> String {
        let record = &self.records[index];
        format!(
            "`{}` sweep {}",
            self.labels.name(record.label),
            record.sweep
        )
    }

    /// Returns an error if the parts of a data set contradict each other.
    fn check_parts(&self) -> Result<(), DataError> {
        let Self {
            sample_rate_hz,
            shape,
            labels,
            records,
            samples,
            ..
        } = self;
        if !(sample_rate_hz.is_finite() && *sample_rate_hz > 0.0) {
            return Err(DataError::inconsistent(
                "sample rate",
                "a positive number of Hz",
                sample_rate_hz.to_string(),
            ));
        }
        if shape.values() == 0 || records.is_empty() {
            return Err(DataError::inconsistent(
                "samples",
                "at least one sweep with at least one step and one taxel",
                format!("{} sweeps of {shape}", records.len()),
            ));
        }
        if samples.len() != records.len() * shape.values() {
            return Err(DataError::inconsistent(
                "samples",
                format!(
                    "{} values ({} sweeps of {shape})",
                    records.len() * shape.values(),
                    records.len()
                ),
                format!("{} values", samples.len()),
            ));
        }
        if let Some(record) = records.iter().find(|r| r.label >= labels.len()) {
            return Err(DataError::inconsistent(
                "labels",
                format!("labels below {}", labels.len()),
                format!("label {}", record.label),
            ));
        }
        let blocks = records.iter().filter(|r| r.block.is_some()).count();
        let flags = records.iter().filter(|r| r.test.is_some()).count();
        for (item, known) in [("blocks", blocks), ("test_flag", flags)] {
            if known != 0 && known != records.len() {
                return Err(DataError::inconsistent(
                    item,
                    format!("a value for all {} sweeps or for none", records.len()),
                    format!("{known}"),
                ));
            }
        }
        Ok(())
    }

    /// Returns the SHA-256 of the content, in hex.
    fn digest(&self) -> String {
        let Self {
            sample_rate_hz,
            shape,
            labels,
            records,
            samples,
            ..
        } = self;
        let mut hash = Sha256::new();
        hash.update(b"tactnet dataset 1\0");
        hash.update(sample_rate_hz.to_le_bytes());
        for extent in [
            records.len(),
            shape.steps,
            shape.rows,
            shape.cols,
            labels.len(),
        ] {
            hash.update((extent as u64).to_le_bytes());
        }
        for name in labels.names() {
            hash.update((name.len() as u64).to_le_bytes());
            hash.update(name.as_bytes());
        }
        for record in records {
            hash.update((record.label as u64).to_le_bytes());
            hash.update((record.sweep as u64).to_le_bytes());
            hash.update(record.block.map_or(0, |b| u64::from(b) + 1).to_le_bytes());
            hash.update([record.test.map_or(0, |t| u8::from(t) + 1)]);
        }
        hash.update(samples.element().as_bytes());
        samples.for_each_le_chunk(|chunk| hash.update(chunk));
        let mut sha256 = hex(hash.finalize());
        if let Some(lengths) = &self.lengths {
            sha256 = lengths::digest(&sha256, lengths);
        }
        self.columns.digest(sha256)
    }
}
