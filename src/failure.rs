//! Errors as one line and an exit code: 1 for a failed run, 2 for a call that must be corrected.

mod channel_remedy;
mod pipeline_remedy;
mod remedy;
mod usage;

use std::error::Error;
use std::process::ExitCode;

use tactnet_channel::ChannelError;
use tactnet_data::DataError;
use tactnet_experiments::ExperimentError;
use tactnet_pipeline::PipelineError;
use tactnet_serving::ServeError;
use tactnet_simulation::SimulationError;
use tactnet_skin::SkinError;

use crate::output::harmless;
pub use remedy::with_cure;
pub use usage::usage;

/// Exit code of a failed check or run.
pub const FAILED: u8 = 1;
/// Exit code of a call that must be corrected.
pub const USAGE: u8 = 2;
/// Exit code after Ctrl-C or SIGTERM, as shells expect.
pub const INTERRUPTED: u8 = 130;

/// Prints an error as one line.
pub fn report(error: &anyhow::Error) -> ExitCode {
    let mut causes = error.chain();
    if causes.any(is_closed_pipe) {
        return ExitCode::SUCCESS;
    }
    // A cause that its error already quotes is not repeated.
    let mut message = String::new();
    for cause in error.chain().map(ToString::to_string) {
        if !message.contains(&cause) {
            if !message.is_empty() {
                message.push_str(": ");
            }
            message.push_str(&cause);
        }
    }
    let mut message = with_cure(&message, error.chain().find_map(remedy::remedy_of).as_ref());
    if let Some(meant) = error.chain().find_map(mistyped_twin) {
        message.push_str(&format!("; did you mean `{meant}`?"));
    }
    if let Some(remedy) = error.chain().find_map(remedy::words_of_simulation) {
        message.push_str(&format!("; {remedy}"));
    }
    if let Some(remedy) = error.chain().find_map(pipeline_remedy::words_of_pipeline) {
        message.push_str(&format!("; {remedy}"));
    }
    if let Some(remedy) = error.chain().find_map(remedy::words_of_experiment) {
        message.push_str(&format!("; {remedy}"));
    }
    if let Some(remedy) = error.chain().find_map(channel_remedy::words_of_channels) {
        message.push_str("; ");
        message.push_str(remedy);
    }
    if let Some(remedy) = error.chain().find_map(remedy::words_of_missing_feature) {
        message.push_str(&format!("; {remedy}"));
    }
    say!(
        "error: {}",
        shortened(&harmless(&without_codes(&message).replace('\n', " ")))
    );
    ExitCode::from(if error.chain().any(is_failure) {
        FAILED
    } else {
        USAGE
    })
}

/// Removes the operating system's error numbers from a text: `(os error 2)`.
fn without_codes(text: &str) -> String {
    let mut parts = text.split(" (os error ");
    let mut plain = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let digits = part.trim_start_matches(|c: char| c.is_ascii_digit());
        match digits.strip_prefix(')').filter(|_| digits != part) {
            Some(rest) => plain.push_str(rest),
            None => plain.extend([" (os error ", part]),
        }
    }
    plain.replace("No such file or directory", "no such file or folder")
}

/// Maximum length of a printed error, in characters.
const MAX_CHARACTERS: usize = 2000;

/// Truncates a text that quotes too much of a damaged file.
fn shortened(text: &str) -> String {
    match text.char_indices().nth(MAX_CHARACTERS) {
        None => text.into(),
        Some((end, _)) => format!("{}… and {} bytes more", &text[..end], text.len() - end),
    }
}

/// Returns true if the reader of the output has closed it (`tactnet … | head`).
fn is_closed_pipe(cause: &(dyn Error + 'static)) -> bool {
    cause
        .downcast_ref::<std::io::Error>()
        .is_some_and(|error| error.kind() == std::io::ErrorKind::BrokenPipe)
}

/// Returns true for a failure that no other call would avoid: disk, network, numerics.
fn is_failure(cause: &(dyn Error + 'static)) -> bool {
    if let Some(error) = cause.downcast_ref::<std::io::Error>() {
        return is_about_disk(error);
    }
    is_usage(cause) == Some(false)
}

/// Returns the classification by an error of this workspace; `None` for other errors.
fn is_usage(cause: &(dyn Error + 'static)) -> Option<bool> {
    None.or_else(|| cause.downcast_ref().map(DataError::is_usage))
        .or_else(|| cause.downcast_ref().map(PipelineError::is_usage))
        .or_else(|| cause.downcast_ref().map(ExperimentError::is_usage))
        .or_else(|| cause.downcast_ref().map(ChannelError::is_usage))
        .or_else(|| cause.downcast_ref().map(SkinError::is_usage))
        .or_else(|| cause.downcast_ref().map(ServeError::is_usage))
        .or_else(|| cause.downcast_ref().map(SimulationError::is_usage))
        .or_else(|| is_usage_of_features(cause))
}

/// Returns the classification by an error of an optional crate.
fn is_usage_of_features(cause: &(dyn Error + 'static)) -> Option<bool> {
    #[cfg_attr(
        not(any(feature = "fetch", feature = "recording", feature = "catching")),
        expect(unused_mut, reason = "only features assign it")
    )]
    let mut answer = None;
    #[cfg(feature = "fetch")]
    {
        let error = cause.downcast_ref::<tactnet_data::FetchError>();
        answer = answer.or_else(|| error.map(tactnet_data::FetchError::is_usage));
    }
    #[cfg(feature = "recording")]
    {
        let error = cause.downcast_ref::<tactnet_recording::RecordingError>();
        answer = answer.or_else(|| error.map(tactnet_recording::RecordingError::is_usage));
    }
    #[cfg(feature = "catching")]
    {
        use tactnet_catching_roles::RoleError;
        use tactnet_catching_stage::StageError;
        answer = answer
            .or_else(|| cause.downcast_ref().map(RoleError::is_usage))
            .or_else(|| cause.downcast_ref().map(StageError::is_usage));
    }
    let _ = cause;
    answer
}

/// Returns true for a disk that is full or read-only, or takes no file of that size. Other system errors, such as a missing file, count as wrong calls.
fn is_about_disk(error: &std::io::Error) -> bool {
    use std::io::ErrorKind;
    matches!(
        error.kind(),
        ErrorKind::StorageFull
            | ErrorKind::QuotaExceeded
            | ErrorKind::FileTooLarge
            | ErrorKind::ReadOnlyFilesystem
    )
}

/// Returns `twin` if a missing data set has a similar name.
fn mistyped_twin(cause: &(dyn Error + 'static)) -> Option<String> {
    let wrapped = || match cause.downcast_ref::<PipelineError>()? {
        PipelineError::Data(error) => Some(error),
        _ => None,
    };
    let path = match cause.downcast_ref::<DataError>().or_else(wrapped)? {
        DataError::Format { path, found, .. } if found == "no such file" => path,
        DataError::Io { path, source, .. } if source.kind() == std::io::ErrorKind::NotFound => path,
        _ => return None,
    };
    let is_word = |name: &&str| name.len() > 2 && !name.contains(['.', '/']);
    let name = path.to_str().filter(is_word)?;
    usage::nearest(name, ["twin"].into_iter())
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use anyhow::Context;

    use super::*;

    fn broken(error: impl Into<anyhow::Error>) -> bool {
        error.into().chain().any(is_failure)
    }

    fn full_disk() -> PipelineError {
        PipelineError::Io {
            path: PathBuf::from("report.html"),
            action: "write",
            source: std::io::Error::from(std::io::ErrorKind::StorageFull),
        }
    }

    #[test]
    fn system_errors_are_printed_without_their_numbers() {
        let missing = std::fs::read("is/nowhere").unwrap_err();
        let said = format!("day.mcap: {missing}; and then");
        let plain = "day.mcap: no such file or folder; and then";
        assert_eq!(without_codes(&said), plain);
        for text in ["", "(os error 2)", "a (os error ) b", "a (os error 2"] {
            assert_eq!(without_codes(text), text);
        }
    }

    #[test]
    fn a_full_disk_is_a_failure_however_it_is_wrapped() {
        assert!(broken(full_disk()));
        assert!(broken(ExperimentError::from(full_disk())));
        assert!(broken(ServeError::from(full_disk())));
        let wrapped: anyhow::Result<()> = Err(ExperimentError::from(full_disk()).into());
        assert!(broken(
            wrapped.context("cannot write the report").unwrap_err()
        ));
        assert!(broken(std::io::Error::from(
            std::io::ErrorKind::StorageFull
        )));
    }

    #[test]
    fn a_wrong_path_is_a_usage_error_in_every_crate() {
        use std::io::ErrorKind;
        let (path, action) = (PathBuf::from("sweeps.h5"), "read");
        for (kind, fails) in [
            (ErrorKind::IsADirectory, false),
            (ErrorKind::NotADirectory, false),
            (ErrorKind::NotFound, false),
            (ErrorKind::PermissionDenied, false),
            (ErrorKind::StorageFull, true),
            (ErrorKind::ReadOnlyFilesystem, true),
        ] {
            let (path, source) = (|| path.clone(), || std::io::Error::from(kind));
            let data = || DataError::io(&path(), action, source());
            let pipeline = || PipelineError::Io {
                path: path(),
                action,
                source: source(),
            };
            #[cfg_attr(
                not(any(feature = "fetch", feature = "recording")),
                expect(unused_mut, reason = "features add errors")
            )]
            let mut errors: Vec<anyhow::Error> = vec![
                source().into(),
                data().into(),
                pipeline().into(),
                PipelineError::from(data()).into(),
                ExperimentError::from(pipeline()).into(),
                ExperimentError::Io {
                    path: path(),
                    action,
                    source: source(),
                }
                .into(),
                ChannelError::Io {
                    path: path(),
                    action,
                    source: source(),
                }
                .into(),
                ServeError::Io {
                    path: path(),
                    source: source(),
                }
                .into(),
                SimulationError::from(data()).into(),
            ];
            #[cfg(feature = "fetch")]
            errors.push(tactnet_data::FetchError::Disk(data()).into());
            #[cfg(feature = "recording")]
            errors.push(
                tactnet_recording::RecordingError::Io {
                    path: path(),
                    source: source(),
                }
                .into(),
            );
            for error in errors {
                assert_eq!(broken(error), fails, "{kind:?}");
            }
        }
    }

    #[test]
    fn a_mistyped_twin_gets_a_suggestion() {
        let missing = |name: &str| {
            let error = DataError::format(name.as_ref(), "file", "a data set", "no such file");
            mistyped_twin(&error)
        };
        assert_eq!(missing("twim").as_deref(), Some("twin"));
        assert_eq!(missing("sweeps.h5"), None);
    }

    #[test]
    fn a_wrong_call_is_a_usage_error() {
        let unknown = || PipelineError::UnknownRecipe {
            name: "fats".into(),
            known: "fast".into(),
        };
        assert!(!broken(unknown()));
        assert!(!broken(ExperimentError::from(unknown())));
        assert!(!broken(anyhow::anyhow!("no such material")));
    }
}
