//! Errors become one line and an exit code: 1 for a run that failed, 2 for something to correct in the call.

use std::process::ExitCode;

use clap::error::ErrorKind;
use tactnet_data::{DataError, FetchError};
use tactnet_experiments::ExperimentError;
use tactnet_pipeline::PipelineError;
use tactnet_recording::RecordingError;

/// Exit code of a failed check or a run that broke.
pub const FAILED: u8 = 1;
/// Exit code of a call that must be corrected.
pub const USAGE: u8 = 2;
/// Exit code after Ctrl-C or SIGTERM, as shells expect.
pub const INTERRUPTED: u8 = 130;

/// Prints help as asked, or a wrong flag as one line.
pub fn usage(error: &clap::Error) -> ExitCode {
    match error.kind() {
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => {
            let _ = error.print();
            return ExitCode::SUCCESS;
        }
        ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => {
            let _ = error.print();
            return ExitCode::from(USAGE);
        }
        _ => {}
    }
    let text = error.render().to_string();
    let (mut message, mut verb) = (String::new(), "tactnet".to_string());
    for part in text.lines().map(str::trim).filter(|part| !part.is_empty()) {
        if let Some(usage) = part.strip_prefix("Usage:") {
            verb = verb_of(usage);
            break;
        }
        if part.starts_with("For more information") {
            break;
        }
        let separator = if message.is_empty() {
            ""
        } else if message.ends_with(':') {
            " "
        } else {
            "; "
        };
        message.push_str(separator);
        message.push_str(part);
    }
    eprintln!("{message}; see `{verb} --help`");
    ExitCode::from(USAGE)
}

/// `tactnet data check` of `tactnet data check [OPTIONS] <FILE>`.
fn verb_of(usage: &str) -> String {
    usage
        .split_whitespace()
        .take_while(|word| word.chars().all(|c| c.is_ascii_lowercase()))
        .collect::<Vec<_>>()
        .join(" ")
}

/// Prints an error as one line.
pub fn report(error: &anyhow::Error) -> ExitCode {
    let mut causes = error.chain();
    if causes.any(is_closed_pipe) {
        return ExitCode::SUCCESS;
    }
    // A cause that its error already quotes is not said twice.
    let mut message = String::new();
    for cause in error.chain().map(ToString::to_string) {
        if !message.contains(&cause) {
            if !message.is_empty() {
                message.push_str(": ");
            }
            message.push_str(&cause);
        }
    }
    eprintln!("error: {}", message.replace('\n', " "));
    ExitCode::from(if error.chain().any(broke) {
        FAILED
    } else {
        USAGE
    })
}

/// Whether whoever read our output has gone (`tactnet … | head`).
fn is_closed_pipe(cause: &(dyn std::error::Error + 'static)) -> bool {
    cause
        .downcast_ref::<std::io::Error>()
        .is_some_and(|error| error.kind() == std::io::ErrorKind::BrokenPipe)
}

/// Whether something failed that another call would not mend: disk, network, numbers.
fn broke(cause: &(dyn std::error::Error + 'static)) -> bool {
    let pipeline = cause.downcast_ref::<PipelineError>().is_some_and(|error| {
        matches!(
            error,
            PipelineError::NotFinite { .. }
                | PipelineError::Optimizer(_)
                | PipelineError::Io { .. }
                | PipelineError::Data(DataError::Io { .. })
        )
    });
    let experiment = cause
        .downcast_ref::<ExperimentError>()
        .is_some_and(|error| {
            matches!(
                error,
                ExperimentError::Tasks { .. }
                    | ExperimentError::Io { .. }
                    | ExperimentError::Slurm { .. }
            )
        });
    let recording = matches!(
        cause.downcast_ref(),
        Some(
            RecordingError::Write { .. }
                | RecordingError::Channel(_)
                | RecordingError::NoViewerAt { .. }
                | RecordingError::Viewer(_)
                | RecordingError::ViewerGone(_)
                | RecordingError::Unwritten { .. }
        )
    );
    pipeline
        || experiment
        || recording
        || cause.is::<FetchError>()
        || matches!(cause.downcast_ref(), Some(DataError::Io { .. }))
}
