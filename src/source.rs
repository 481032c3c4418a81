//! Reading data sets, with a word on the twin and on rates that nobody named.

use tactnet_data::{DataError, DataSource, Dataset, Finding, FindingKind, Severity, SweepShape};
use tactnet_pipeline::{LabelOrder, PipelineError, TrainSpec, quoted};

use crate::failure;

/// Says so where the twin is about to be generated, which takes a moment and is no recording.
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

/// Reads `data` as the run of `spec` read its own, with labels in `order`.
pub fn load_as(spec: &TrainSpec, data: &str, order: LabelOrder) -> Result<Dataset, DataError> {
    announce(data);
    spec.read_sweeps_of(data, order)
}

/// Says that the taxels were put into a run's rows and columns.
pub fn note_arranged(shape: SweepShape) {
    say!(
        "note: the taxels are read row by row as the run's {}x{}, since the data does not say how they are arranged",
        shape.rows,
        shape.cols
    );
}

/// Warns of what concerns a data set as a whole; a rate that nobody named has a warning of its own.
///
/// - `name`: of the data set where there may be several
/// - `axes_are_right`: somebody said so, see `--axes-are-right`
///
/// # Errors
/// Axes in an order that makes no sense.
pub fn review(
    name: Option<&str>,
    finding: &Finding,
    axes_are_right: bool,
) -> Result<(), PipelineError> {
    if finding.kind == FindingKind::AxisOrder && !axes_are_right {
        let of = name.map_or(String::new(), |name| format!("{name}: "));
        return Err(PipelineError::Doubtful {
            finding: format!("{of}{}", finding.message),
            remedy: "if they are right as they are, add --axes-are-right",
        });
    }
    let other = finding.kind != FindingKind::AssumedRate;
    // Once trained, a network keeps its arrangement.
    let told = finding.severity == Severity::Warning || finding.kind == FindingKind::AssumedPatch;
    if told && finding.is_general() && other {
        let message = failure::with_cure(&finding.message, finding.remedy.as_ref());
        match name {
            Some(name) => say!("{}: {name}: {message}", finding.severity),
            None => say!("{}: {message}", finding.severity),
        }
    }
    Ok(())
}

/// Names the file whose sweeps do not fit a classifier or its run, and what can be done about another sample rate.
///
/// - `rate`: what `--rate` says
pub fn in_file(data: &str, rate: Option<f64>, error: PipelineError) -> PipelineError {
    match error {
        PipelineError::Incompatible {
            item,
            expected,
            mut found,
        } if ["sweeps", "sample rate", "materials"].contains(&item.as_str()) => {
            if item == "sample rate" && !found.contains("--rate") {
                found.push_str(&match rate {
                    Some(_) => String::from(", as `--rate` says"),
                    None => format!(
                        "; sweeps have to be recorded at the same rate (if the file is wrong about its own, mend it there: `sample_rate_hz` of an \
                         .npz; or `tactnet data import {} --out mended.npz --rate HZ`, with `--material NAME` where no material is named)",
                        quoted(data)
                    ),
                });
            }
            PipelineError::Incompatible {
                item: data.into(),
                expected,
                found: with_names(&found, data, rate),
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

/// Puts names into a command that a message proposes: the file, a new one and what `--rate` said.
fn with_names(message: &str, data: &str, rate: Option<f64>) -> String {
    let rate = rate.map_or(String::new(), |rate| format!(" --rate {rate}"));
    let named = format!("data import {} --out arranged.npz{rate}", quoted(data));
    message.replace("data import FILE --out NEW", &named)
}

/// Says so where the sample rate is assumed.
pub fn warn_of_assumed_rate(assumed: bool, rate_hz: f64) {
    if assumed {
        say!(
            "warning: the data does not say its sample rate; {rate_hz} Hz is assumed, `--rate HZ` names it"
        );
    }
}
