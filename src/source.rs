//! Reading of data sets, with notes about the twin and assumed sample rates.

use tactnet_data::format::{Keep, ReadOptions};
use tactnet_data::{
    DataError, DataSource, Dataset, Finding, FindingKind, Remedy, Severity, SweepShape,
    group_findings,
};
use tactnet_pipeline::{LabelOrder, PipelineError, PipelineRemedy, TrainSpec, quoted};

use crate::failure;

/// Prints a note before the twin is generated, which takes a moment.
pub fn announce(data: &str) {
    if DataSource::is_twin(data) {
        say!("generating the twin (synthetic sweeps, not TactMat) …");
    }
}

/// Generates the twin, or reads a file.
pub fn load(data: &str) -> Result<Dataset, DataError> {
    announce(data);
    DataSource::named(data).read()
}

/// Reads `data` with the settings of a run, with labels in `order`.
pub fn load_as(spec: &TrainSpec, data: &str, order: LabelOrder) -> Result<Dataset, DataError> {
    announce(data);
    spec.read_sweeps_of(data, order)
}

/// Returns the number of time steps of the shortest sweep of the settings' data, and prints it.
///
/// # Errors
/// Data that cannot be read.
pub fn shortest(spec: &TrainSpec) -> Result<usize, DataError> {
    let options = ReadOptions {
        keep: Keep::Shortest,
        rate_hz: spec.rate_hz,
        samples: spec.samples.clone(),
        labels: spec.labels.clone(),
        blocks: spec.blocks.clone(),
        ..ReadOptions::default()
    };
    let source = DataSource::named(&spec.data);
    let steps = source.read_with(&options)?.shape().steps;
    say!("the shortest sweep has {steps} time steps: `--steps {steps}`");
    Ok(steps)
}

/// Notes that the taxels were arranged in the run's rows and columns.
pub fn note_arranged(shape: SweepShape) {
    say!(
        "note: the data does not state the arrangement of its taxels; they are read row by row as the run's {}x{}",
        shape.rows,
        shape.cols
    );
}

/// Doubts about data that the user settled.
#[derive(Clone, Copy)]
pub struct Doubts {
    /// True if the order of the axes is confirmed.
    pub axes_are_right: bool,
    /// True if warnings are errors.
    pub strict: bool,
}

/// Prints warnings about a data set as a whole, except about an assumed rate, which has its own warning.
///
/// - `name`: name of the data set, if there may be several
///
/// # Errors
/// Fails if the axes are probably exchanged, or for any warning if warnings are errors.
pub fn review(name: Option<&str>, finding: &Finding, doubts: Doubts) -> Result<(), PipelineError> {
    let is_of_axes = finding.kind == FindingKind::AxisOrder;
    let remedy = match finding.severity {
        _ if is_of_axes && !doubts.axes_are_right => Some(PipelineRemedy::ConfirmAxes),
        Severity::Warning if doubts.strict && !is_of_axes => Some(PipelineRemedy::AcceptWarnings),
        _ => None,
    };
    if let Some(remedy) = remedy {
        let of = name.map_or(String::new(), |name| format!("{name}: "));
        return Err(PipelineError::Doubtful {
            finding: format!("{of}{}", finding.message),
            remedy,
        });
    }
    let other = finding.kind != FindingKind::AssumedRate;
    // A trained network keeps its arrangement of taxels.
    let shown = finding.severity == Severity::Warning
        || matches!(
            finding.kind,
            FindingKind::AssumedPatch | FindingKind::FolderLayout
        );
    // It names the first of several materials.
    let is_general = finding.is_general() || finding.kind == FindingKind::ConfoundedBlocks;
    if shown && is_general && other {
        let message = failure::with_cure(&finding.message, finding.remedy.as_ref());
        match name {
            Some(name) => say!("{}: {name}: {message}", finding.severity),
            None => say!("{}: {message}", finding.severity),
        }
    }
    Ok(())
}

/// Adds the file name to an error about sweeps that do not fit a classifier, with a remedy for another sample rate.
///
/// - `rate`: value of `--rate`
pub fn in_file(data: &str, rate: Option<f64>, error: PipelineError) -> PipelineError {
    match error {
        PipelineError::Incompatible {
            item,
            expected,
            mut found,
            mut remedy,
        } if ["sweeps", "sample rate", "materials"].contains(&item.as_str()) => {
            if item == "sample rate" && remedy.is_none() {
                found.push_str(&match rate {
                    Some(_) => String::from(", as named with `--rate`"),
                    None => format!(
                        "; sweeps must be recorded at the same rate (if the file names a wrong rate, fix it there: `sample_rate_hz` of an .npz; or \
                         `tactnet data import {} --out fixed.npz --rate HZ`, with `--material NAME` if no material is named)",
                        quoted(data)
                    ),
                });
            }
            let words = match remedy {
                Some(PipelineRemedy::Data(Remedy::NameShape { rows, cols })) => {
                    let rate = rate.map_or(String::new(), |rate| format!(" --rate {rate}"));
                    Some(format!(
                        "; `tactnet data import {} --out arranged.npz{rate} --shape {rows}x{cols}` arranges the same taxels",
                        quoted(data)
                    ))
                }
                Some(PipelineRemedy::Data(Remedy::KeepSteps { steps })) => {
                    Some(format!("; `--steps {steps}` keeps the first of them"))
                }
                _ => None,
            };
            if let Some(words) = words {
                found.push_str(&words);
                remedy = None;
            }
            PipelineError::Incompatible {
                item: data.into(),
                expected,
                found,
                remedy,
            }
        }
        PipelineError::Data(DataError::Inconsistent {
            item,
            expected,
            found,
            remedy,
        }) => DataError::Inconsistent {
            item: format!("{data}: {item}"),
            expected,
            found,
            remedy,
        }
        .into(),
        other => other,
    }
}

/// Number of findings of a kind that are printed.
const SHOWN: usize = 3;

/// Prints errors and warnings that only the reader of the data can make, the first of each kind.
pub fn warn_of_findings(findings: &[Finding]) {
    for group in group_findings(findings) {
        if group.severity == Severity::Note {
            continue;
        }
        for finding in group.findings.iter().take(SHOWN) {
            let message = failure::with_cure(&finding.message, finding.remedy.as_ref());
            say!("{}: {message}", finding.severity);
        }
        match group.findings.len().saturating_sub(SHOWN) {
            0 => {}
            more => say!("{}: {more} more: {}", group.severity, group.kind),
        }
    }
}

/// Warns about an assumed sample rate.
pub fn warn_of_assumed_rate(assumed: bool, rate_hz: f64) {
    if assumed {
        say!(
            "warning: the data does not state its sample rate; {rate_hz} Hz is assumed, `--rate HZ` sets it"
        );
    }
}
