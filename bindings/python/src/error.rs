//! Conversion of errors into Python exceptions.

use pyo3::create_exception;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use tactnet_channel::ChannelError;
use tactnet_data::{DataError, Remedy};
use tactnet_pipeline::{PipelineError, PipelineRemedy};
use tactnet_recording::{RecordingError, RecordingRemedy};

create_exception!(
    tactnet,
    TactnetError,
    PyValueError,
    "Error of the package: one line with expected and found values."
);

/// Returns the exception for an error of any crate, with its causes and its cure.
pub(crate) fn raised(error: impl std::error::Error + 'static) -> PyErr {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(inner) = cause {
        let more = inner.to_string();
        if !text.contains(&more) {
            text.push_str(": ");
            text.push_str(&more);
        }
        cause = inner.source();
    }
    if let Some(cure) = cure_of(&error) {
        text.push_str("; ");
        text.push_str(&cure);
    }
    TactnetError::new_err(text)
}

/// Returns the words of an error's cure; `None` if the caller cannot apply one.
fn cure_of(error: &(dyn std::error::Error + 'static)) -> Option<String> {
    if let Some(error) = error.downcast_ref::<PipelineError>() {
        let data = error.remedy().as_ref().map(words_of);
        return data.or_else(|| words_of_pipeline(&error.pipeline_remedy()?));
    }
    match error.downcast_ref::<DataError>() {
        Some(error) => error.remedy().as_ref().map(words_of),
        None => cure_of_channels(error).map(String::from),
    }
}

/// Returns a message with the words of its cure, if there is one.
pub(crate) fn with_cure(message: String, remedy: Option<&Remedy>) -> String {
    match remedy.map(words_of) {
        Some(words) => format!("{message}; {words}"),
        None => message,
    }
}

/// Returns the arguments and functions that apply a cure.
fn words_of(remedy: &Remedy) -> String {
    match remedy {
        Remedy::NameRate => "pass `rate=`".into(),
        Remedy::NameLabels => {
            "tactnet.read_sweeps opens it, and `predict` of a classifier takes arrays without materials"
                .into()
        }
        Remedy::NameSamples => "pass `samples=`".into(),
        Remedy::NameShape { rows, cols } => {
            format!("if the skin is a grid, pass an array [sweeps][steps][{rows}][{cols}]")
        }
        Remedy::KeepLengths { steps } => {
            format!("`steps=\"all\"` keeps the length of every sweep, `steps={steps}` the first {steps} steps of all")
        }
        Remedy::KeepSteps { steps } => {
            format!("`X[:, :{steps}]`, or `steps={steps}` when reading, keeps the first {steps} steps")
        }
        Remedy::Resample => "pass `resample=`".into(),
        Remedy::CutWindows => "pass `window=` to cut recordings into sweeps".into(),
        Remedy::DropUnlabelled => "pass `drop_labels=[\"\"]`".into(),
        Remedy::SubtractOffset => {
            "subtract the offset of each taxel first, the same one in all arrays: `X - X.mean((0, 1))` of the training sweeps"
                .into()
        }
        Remedy::ChooseFolds => "pass `folds=`".into(),
        Remedy::LeaveBlocksOut => "pass `scheme=\"leave-block-out\"`".into(),
        Remedy::ListFindings { data } => format!("`Dataset.read({data:?}).check()` lists all"),
        Remedy::ConvertRecording => "open it with `tactnet.Recording`".into(),
        Remedy::PassDownloadedFile => "pass its path".into(),
    }
}

/// Returns the arguments and functions that apply a cure; `None` for cures of errors that only commands raise.
fn words_of_pipeline(remedy: &PipelineRemedy) -> Option<String> {
    Some(match remedy {
        PipelineRemedy::Data(remedy) => words_of(remedy),
        PipelineRemedy::TrainWithRate => {
            "if the classifier was fitted to sweeps of this rate, fit it again with `rate=`".into()
        }
        PipelineRemedy::NameRun => {
            "name a folder that `save` of a classifier or `tactnet train` made".into()
        }
        PipelineRemedy::NameFolder => "name another folder".into(),
        PipelineRemedy::Resume { run } => {
            format!("`tactnet train --resume {}` continues it", run.display())
        }
        PipelineRemedy::ResumeOrNameFolder { run } => format!(
            "name another folder, or continue it with `tactnet train --resume {}`",
            run.display()
        ),
        PipelineRemedy::AcceptRisk => {
            "record sweeps of all materials in about equal numbers, or pass `accept_risk=True`"
                .into()
        }
        PipelineRemedy::ChooseScaledModel => {
            "fit a TactNetClassifier, or `lda`, `svm-spectra` or `minirocket` instead".into()
        }
        PipelineRemedy::AdaptWithoutLabels => {
            "leave out `y`, or fit a TactNetClassifier, `lda` or `minirocket` instead".into()
        }
        PipelineRemedy::ConfirmAxes
        | PipelineRemedy::AcceptWarnings
        | PipelineRemedy::NameData
        | PipelineRemedy::ChooseModel { .. }
        | PipelineRemedy::TrainNetwork
        | PipelineRemedy::Distill { .. }
        | PipelineRemedy::EnrollOrCalibrate
        | PipelineRemedy::Calibrate
        | PipelineRemedy::EnrollFewerSweeps
        | PipelineRemedy::RelaxTargets { .. }
        | PipelineRemedy::ListNetworks
        | PipelineRemedy::RecordMore => return None,
    })
}

/// Returns the call or keyword argument that cures an error of channels or recordings.
fn cure_of_channels(error: &(dyn std::error::Error + 'static)) -> Option<&'static str> {
    let channel = match error.downcast_ref() {
        Some(RecordingError::Channel(error)) => Some(error),
        _ => error.downcast_ref(),
    };
    if let Some(remedy) = channel.and_then(ChannelError::remedy) {
        return Some(match remedy {
            tactnet_channel::Remedy::StartHub => {
                "start one with the same table, for example `tactnet.channel.Hub`"
            }
        });
    }
    let recording: &RecordingError = error.downcast_ref()?;
    match recording.remedy()? {
        RecordingRemedy::NameShape => Some("pass `rows_cols=`"),
        RecordingRemedy::NameRate => Some("pass `rate_hz=`"),
        RecordingRemedy::NameTopic => {
            Some("`tactnet data import` reads one with `--topic NAME --field PATH`")
        }
        RecordingRemedy::UseDescribedPackets | RecordingRemedy::WriteFile => None,
    }
}
