//! Findings of a check, singly and in groups.

use crate::Remedy;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt;
use std::path::PathBuf;

/// Severity of a finding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// Training would fail or give a meaningless result; the data set is refused.
    Error,
    /// Likely a fault of the sensor or the recording.
    Warning,
    /// Normal for some sensors.
    Note,
}

/// Kind of a finding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FindingKind {
    /// NaN or infinite values.
    NotFinite,
    /// Sweeps of several lengths.
    UnequalLengths,
    /// The lengths of the sweeps alone separate the materials.
    TellingLengths,
    /// A sweep in which no taxel ever changes.
    ConstantSweep,
    /// Two sweeps have equal values.
    IdenticalSweeps,
    /// A material with fewer than two sweeps, or fewer than the usual folds.
    FewSweeps,
    /// A taxel has the same value in the whole data set.
    DeadTaxel,
    /// A taxel is constant during a sweep.
    ConstantTaxel,
    /// Many values are at the sensor's maximum.
    Saturation,
    /// Values are unlike those of the other sweeps.
    OutOfRange,
    /// Materials have unequal numbers of sweeps.
    UnbalancedMaterials,
    /// The data does not name its sample rate.
    AssumedRate,
    /// The data does not name the unit of its time stamps.
    AssumedUnit,
    /// The caller named another sample rate than the data.
    NamedRate,
    /// All names of materials are numbers.
    NumberedMaterials,
    /// More taxels on a side of the patch than time steps.
    AxisOrder,
    /// Sweeps shorter than 50 ms.
    ShortSweeps,
    /// Sweeps longer than ten minutes.
    LongSweeps,
    /// A taxel rises steadily and identically in all sweeps.
    ClockTaxel,
    /// The data set has only one material.
    SingleMaterial,
    /// Names of materials that look alike.
    AlikeNames,
    /// Mean and median time between frames disagree.
    IrregularRate,
    /// Sweeps or files of different sample rates.
    MixedRates,
    /// A pause between two frames.
    TimeGap,
    /// Frames are missing, by the time stamps.
    LostFrames,
    /// A time stamp that is earlier than the one before it.
    ClockBackwards,
    /// Values that programs write for missing ones.
    FillValue,
    /// A few values far outside the range of their taxel.
    Spike,
    /// All taxels are zero or frozen during several frames.
    Dropout,
    /// Sweeps were filled up to a common length.
    Padding,
    /// Two sweeps share frames.
    Overlap,
    /// Two sweeps are equal except for rounding, offset or gain.
    NearDuplicate,
    /// A taxel is constant in every sweep and follows the material.
    LeakingColumn,
    /// Materials that were recorded in one block each.
    ConfoundedBlocks,
    /// A part of the file that cannot be read.
    Unreadable,
    /// Taxels are in one row, because the file does not name their arrangement.
    AssumedPatch,
    /// Meaning of the axes of an array, which the file does not name.
    AxesRead,
    /// Folders in folders: the finding says which level names the material.
    FolderLayout,
    /// A part of the file is not read.
    NotRead,
    /// Conditions that differ from those of the training sweeps of a classifier.
    OtherConditions,
}

impl FindingKind {
    /// Returns true if the finding concerns the materials and not the values.
    pub fn is_about_materials(self) -> bool {
        matches!(
            self,
            Self::FewSweeps
                | Self::UnbalancedMaterials
                | Self::NumberedMaterials
                | Self::SingleMaterial
                | Self::AlikeNames
                | Self::ConfoundedBlocks
        )
    }
}

/// Place of a finding; all parts are `None` if it concerns the whole data set.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct Place {
    /// File, if the data set consists of several or could not be read.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// Line of the text file, from 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub line: Option<usize>,
    /// Column of the table, by name or number from 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub column: Option<String>,
    /// Name of the material.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub material: Option<String>,
    /// Index of the sweep in the data set.
    pub sweep: Option<usize>,
    /// Index of the taxel, row by row.
    pub taxel: Option<usize>,
    /// Time step.
    pub step: Option<usize>,
}

/// Error, warning or note about a data set.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// Severity.
    pub severity: Severity,
    /// Kind.
    pub kind: FindingKind,
    /// First place where it occurs.
    pub at: Place,
    /// Sentence that names material, sweep, taxels and numbers.
    pub message: String,
    /// Cure, if the caller can apply one; [`Finding::message`] does not contain it.
    #[serde(skip)]
    pub remedy: Option<Remedy>,
}

impl fmt::Display for Severity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Error => "error",
            Self::Warning => "warning",
            Self::Note => "note",
        })
    }
}

impl fmt::Display for FindingKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::NotFinite => "values that are not finite",
            Self::UnequalLengths => "sweeps of several lengths",
            Self::TellingLengths => "lengths that tell the material",
            Self::ConstantSweep => "constant sweeps",
            Self::IdenticalSweeps => "identical sweeps",
            Self::FewSweeps => "too few sweeps",
            Self::DeadTaxel => "dead taxels",
            Self::ConstantTaxel => "constant taxels",
            Self::Saturation => "saturation",
            Self::OutOfRange => "values out of range",
            Self::UnbalancedMaterials => "unbalanced materials",
            Self::AssumedRate => "assumed sample rate",
            Self::AssumedUnit => "assumed unit of time",
            Self::NamedRate => "a named sample rate that differs",
            Self::NumberedMaterials => "numbered materials",
            Self::AxisOrder => "suspicious order of axes",
            Self::ShortSweeps => "short sweeps",
            Self::LongSweeps => "long sweeps",
            Self::ClockTaxel => "a clock among the taxels",
            Self::SingleMaterial => "a single material",
            Self::AlikeNames => "names that are alike",
            Self::IrregularRate => "irregular sample rate",
            Self::MixedRates => "mixed sample rates",
            Self::TimeGap => "time gaps",
            Self::LostFrames => "lost frames",
            Self::ClockBackwards => "a clock that goes backwards",
            Self::FillValue => "fill values",
            Self::Spike => "spikes",
            Self::Dropout => "dropouts",
            Self::Padding => "padding",
            Self::Overlap => "sweeps that overlap",
            Self::NearDuplicate => "near duplicates",
            Self::LeakingColumn => "columns that leak the material",
            Self::ConfoundedBlocks => "materials in one block each",
            Self::Unreadable => "unreadable parts",
            Self::AssumedPatch => "assumed arrangement of the taxels",
            Self::AxesRead => "axes as they are read",
            Self::FolderLayout => "layout of the folders",
            Self::NotRead => "not read",
            Self::OtherConditions => "conditions unlike those of training",
        })
    }
}

impl Finding {
    /// Returns a finding without a remedy about the whole data set.
    pub fn new(severity: Severity, kind: FindingKind, message: impl Into<String>) -> Self {
        Self {
            severity,
            kind,
            at: Place::default(),
            message: message.into(),
            remedy: None,
        }
    }

    /// Returns the finding at this place.
    #[must_use]
    pub fn at(self, at: Place) -> Self {
        Self { at, ..self }
    }

    /// Returns the finding with this cure.
    #[must_use]
    pub fn with_remedy(self, remedy: Remedy) -> Self {
        Self {
            remedy: Some(remedy),
            ..self
        }
    }

    /// Returns a note that a part of the file is not read.
    pub(crate) fn not_read(message: impl Into<String>) -> Self {
        Self::new(Severity::Note, FindingKind::NotRead, message)
    }

    /// Returns true if the finding concerns the whole data set instead of one sweep or taxel.
    pub fn is_general(&self) -> bool {
        self.at == Place::default()
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.severity, self.message)
    }
}

/// All findings of a check, with the numbers of errors and warnings.
#[derive(Debug, Clone, Serialize)]
pub struct CheckReport {
    /// Findings of [`Severity::Error`].
    pub errors: usize,
    /// Findings of [`Severity::Warning`].
    pub warnings: usize,
    /// All findings, errors first.
    pub findings: Vec<Finding>,
}

impl CheckReport {
    /// Counts the errors and warnings of `findings`.
    pub fn of(findings: Vec<Finding>) -> Self {
        let count = |severity| findings.iter().filter(|f| f.severity == severity).count();
        Self {
            errors: count(Severity::Error),
            warnings: count(Severity::Warning),
            findings,
        }
    }
}

/// Findings of one kind and severity.
#[derive(Debug, Clone, Serialize)]
pub struct FindingGroup {
    /// Severity of all of them.
    pub severity: Severity,
    /// Kind of all of them.
    pub kind: FindingKind,
    /// Findings in the order of the sweeps.
    pub findings: Vec<Finding>,
}

/// Groups findings by severity and kind, errors first.
pub fn group_findings(findings: &[Finding]) -> Vec<FindingGroup> {
    let mut groups: BTreeMap<(Severity, FindingKind), Vec<Finding>> = BTreeMap::new();
    for finding in findings {
        groups
            .entry((finding.severity, finding.kind))
            .or_default()
            .push(finding.clone());
    }
    groups
        .into_iter()
        .map(|((severity, kind), findings)| FindingGroup {
            severity,
            kind,
            findings,
        })
        .collect()
}
