//! Errors become one line and an exit code: 1 for a run that failed, 2 for something to correct in the call.

use std::error::Error;
use std::process::ExitCode;

use clap::CommandFactory;
use clap::error::{ContextKind, ErrorKind};
use tactnet_channel::ChannelError;
use tactnet_data::{DataError, Remedy, near_name};
use tactnet_experiments::ExperimentError;
use tactnet_pipeline::PipelineError;
use tactnet_serving::ServeError;
use tactnet_simulation::SimulationError;
use tactnet_skin::SkinError;

use crate::Cli;
use crate::output::harmless;

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
            return match error.print() {
                Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
                    report(&error.into())
                }
                _ => ExitCode::SUCCESS,
            };
        }
        ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => {
            let _ = error.print();
            return ExitCode::from(USAGE);
        }
        _ => {}
    }
    let text = error.render().to_string();
    let (mut message, mut verb) = (String::new(), verb_in(std::env::args().skip(1)));
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
    let meant = in_the_recipe(error, &verb).or_else(|| {
        let word = misplaced_path(error, &verb).or_else(|| mistyped_word(error))?;
        Some(format!("did you mean `{word}`?"))
    });
    if let Some(meant) = meant {
        // What clap takes for similar is not what was meant.
        let said = message.split("; tip: ").next().unwrap_or_default();
        message = format!("{said}; {meant}");
    }
    say!("{}; see `{verb} --help`", harmless(&message));
    ExitCode::from(USAGE)
}

/// Returns the option that a file or folder belongs behind which was given without one.
fn misplaced_path(error: &clap::Error, verb: &str) -> Option<String> {
    if error.kind() != ErrorKind::UnknownArgument {
        return None;
    }
    let clap::error::ContextValue::String(word) = error.get(ContextKind::InvalidArg)? else {
        return None;
    };
    let path = std::path::Path::new(word);
    let option = match (path.is_dir(), path.is_file()) {
        (true, _) => "run",
        (_, true) => "data",
        _ => return None,
    };
    let mut command = Cli::command();
    for name in verb.split_whitespace().skip(1) {
        command = command.find_subcommand(name)?.clone();
    }
    let has = command
        .get_arguments()
        .any(|argument| argument.get_long() == Some(option));
    has.then(|| format!("--{option} {}", tactnet_pipeline::quoted(word)))
}

/// Settings of a training that have no option, as other programs call them.
const OF_THE_RECIPE: [&str; 12] = [
    "batch",
    "batch-size",
    "lr",
    "learning-rate",
    "dropout",
    "optimizer",
    "optimiser",
    "weight-decay",
    "l2",
    "momentum",
    "hidden",
    "epsilon",
];

/// Returns where a setting of a training stands that somebody looks for among the options of `train`.
fn in_the_recipe(error: &clap::Error, verb: &str) -> Option<String> {
    if error.kind() != ErrorKind::UnknownArgument || verb != "tactnet train" {
        return None;
    }
    let clap::error::ContextValue::String(word) = error.get(ContextKind::InvalidArg)? else {
        return None;
    };
    let name = word.trim_start_matches('-').replace('_', "-");
    let name = name.split('=').next()?;
    OF_THE_RECIPE.contains(&name).then(|| {
        "it stands in the recipe: `tactnet train --print-recipe fast > my.toml`, then `--recipe my.toml`".into()
    })
}

/// Returns the value or command that was meant, where clap proposes none.
fn mistyped_word(error: &clap::Error) -> Option<String> {
    use clap::error::ContextValue::{String as Word, Strings};
    match error.kind() {
        // Vulkan reaches the cards of every maker.
        ErrorKind::InvalidValue
            if matches!(error.get(ContextKind::InvalidValue)?, Word(word) if word.eq_ignore_ascii_case("gpu"))
                && matches!(error.get(ContextKind::ValidValue)?, Strings(known) if known.iter().any(|it| it == "vulkan")) =>
        {
            Some("vulkan".into())
        }
        ErrorKind::InvalidValue if error.get(ContextKind::SuggestedValue).is_none() => {
            let (Word(word), Strings(known)) = (
                error.get(ContextKind::InvalidValue)?,
                error.get(ContextKind::ValidValue)?,
            ) else {
                return None;
            };
            meant_by(word, known.iter().map(String::as_str))
        }
        ErrorKind::InvalidSubcommand if error.get(ContextKind::SuggestedSubcommand).is_none() => {
            let Word(word) = error.get(ContextKind::InvalidSubcommand)? else {
                return None;
            };
            let mut command = Cli::command();
            // `help data chek` is about the commands of `data`.
            let words = std::env::args().skip(1).filter(|word| word != "help");
            for name in words.take_while(|name| name != word) {
                command = command.find_subcommand(&name)?.clone();
            }
            let shown = command.get_subcommands().filter(|it| !it.is_hide_set());
            let names: Vec<&str> = shown.map(clap::Command::get_name).collect();
            meant_by(word, names.iter().copied())
        }
        _ => None,
    }
}

/// Returns the nearest of the known names; letters in another order are near, too.
fn meant_by<'a>(word: &str, known: impl Iterator<Item = &'a str> + Clone) -> Option<String> {
    let letters = |name: &str| {
        let mut letters: Vec<char> = name.to_lowercase().chars().collect();
        letters.sort_unstable();
        letters
    };
    let typed = letters(word);
    let reordered = known.clone().find(|name| letters(name) == typed);
    let meant = reordered.or_else(|| near_name(word, known));
    meant.map(Into::into)
}

/// Returns `twin` where a data set that is not there was called something like it.
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
    meant_by(name, ["twin"].into_iter())
}

/// `tactnet data check` of the words `data check --rate fast own.npz`, for errors that come without their usage.
fn verb_in(words: impl Iterator<Item = String>) -> String {
    let mut command = Cli::command();
    let mut verb = command.get_name().to_string();
    for word in words {
        let Some(inner) = command.find_subcommand(&word).cloned() else {
            break;
        };
        verb = format!("{verb} {word}");
        command = inner;
    }
    verb
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
    let mut message = with_cure(&message, error.chain().find_map(remedy_of).as_ref());
    if let Some(meant) = error.chain().find_map(mistyped_twin) {
        message.push_str(&format!("; did you mean `{meant}`?"));
    }
    say!(
        "error: {}",
        shortened(&harmless(&without_codes(&message).replace('\n', " ")))
    );
    ExitCode::from(if error.chain().any(broke) {
        FAILED
    } else {
        USAGE
    })
}

/// Returns a message with the words of its cure, if there is one.
pub fn with_cure(message: &str, remedy: Option<&Remedy>) -> String {
    match remedy {
        Some(remedy) => format!("{message}; {}", words_of(remedy)),
        None => message.to_owned(),
    }
}

/// Returns the options and commands that apply a cure.
fn words_of(remedy: &Remedy) -> String {
    match remedy {
        Remedy::NameRate => "`--rate HZ` names it".into(),
        Remedy::NameLabels => {
            "`tactnet predict` classifies sweeps without materials, `tactnet data import --material NAME` names the material of all"
                .into()
        }
        Remedy::NameShape { rows, cols } => format!(
            "if the skin is a grid: `tactnet data import FILE --shape {rows}x{cols} --out NEW.npz`"
        ),
        Remedy::KeepSteps { steps } => format!(
            "`tactnet data import FILE --out NEW.npz --steps {steps}` keeps the first {steps} frames of every sweep"
        ),
        Remedy::ChooseFolds => "`--folds N` or `--split hold-out` chooses another split".into(),
        Remedy::ListFindings { data } => format!("`tactnet data check {data}` lists all"),
        Remedy::ConvertRecording => {
            "`tactnet data import FILE --out NEW.npz` converts it to a data set".into()
        }
        Remedy::PassDownloadedFile => {
            "then pass it with `--data FILE` or convert it with `tactnet data import FILE`".into()
        }
    }
}

/// Returns the cure of an error of our own crates; `None` for others.
fn remedy_of(cause: &(dyn Error + 'static)) -> Option<Remedy> {
    if let Some(ServeError::Pipeline(error)) = cause.downcast_ref() {
        return error.remedy();
    }
    #[cfg(feature = "fetch")]
    if let Some(error) = cause.downcast_ref::<tactnet_data::FetchError>() {
        return error.remedy();
    }
    #[cfg(feature = "recording")]
    if let Some(tactnet_recording::RecordingError::Data(error)) = cause.downcast_ref() {
        return error.remedy();
    }
    None.or_else(|| cause.downcast_ref().and_then(DataError::remedy))
        .or_else(|| cause.downcast_ref().and_then(PipelineError::remedy))
        .or_else(|| cause.downcast_ref().and_then(ExperimentError::remedy))
}

/// Returns a text without the numbers that the system has for its answers: `(os error 2)`.
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

/// Longest error that is printed whole, characters.
const LONGEST: usize = 2000;

/// Returns the beginning of a text that repeats too much of a damaged file.
fn shortened(text: &str) -> String {
    match text.char_indices().nth(LONGEST) {
        None => text.into(),
        Some((end, _)) => format!("{}… and {} bytes more", &text[..end], text.len() - end),
    }
}

/// Returns true if whoever read our output has gone (`tactnet … | head`).
fn is_closed_pipe(cause: &(dyn Error + 'static)) -> bool {
    cause
        .downcast_ref::<std::io::Error>()
        .is_some_and(|error| error.kind() == std::io::ErrorKind::BrokenPipe)
}

/// Returns true if something failed that another call would not mend: disk, network, numbers.
fn broke(cause: &(dyn Error + 'static)) -> bool {
    if let Some(error) = cause.downcast_ref::<std::io::Error>() {
        return is_about_disk(error);
    }
    is_usage(cause) == Some(false)
}

/// Returns what an error of our own crates says of itself; `None` for others.
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

/// Returns the same for errors of crates and modules that a cargo feature adds.
fn is_usage_of_features(cause: &(dyn Error + 'static)) -> Option<bool> {
    #[cfg_attr(
        not(any(feature = "fetch", feature = "recording", feature = "catching")),
        expect(unused_mut, reason = "features add answers")
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

/// Returns true for a disk that is full or cannot be written; other errors of the system, such as a file that is not there, may well be
/// mistakes in the call.
fn is_about_disk(error: &std::io::Error) -> bool {
    use std::io::ErrorKind;
    matches!(
        error.kind(),
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded | ErrorKind::ReadOnlyFilesystem
    )
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use anyhow::Context;

    use super::*;

    fn broken(error: impl Into<anyhow::Error>) -> bool {
        error.into().chain().any(broke)
    }

    fn full_disk() -> PipelineError {
        PipelineError::Io {
            path: PathBuf::from("report.html"),
            action: "write",
            source: std::io::Error::from(std::io::ErrorKind::StorageFull),
        }
    }

    #[test]
    fn answers_of_the_system_come_without_their_numbers() {
        let missing = std::fs::read("is/nowhere").unwrap_err();
        let said = format!("day.mcap: {missing}; and then");
        let plain = "day.mcap: no such file or folder; and then";
        assert_eq!(without_codes(&said), plain);
        for text in ["", "(os error 2)", "a (os error ) b", "a (os error 2"] {
            assert_eq!(without_codes(text), text);
        }
    }

    #[test]
    fn a_full_disk_fails_however_it_is_wrapped() {
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
    fn a_wrong_path_is_a_mistake_whichever_crate_finds_it() {
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

    /// The wording of the cures is asserted only here.
    #[test]
    fn an_error_comes_with_the_command_that_cures_it() {
        let error = || DataError::inconsistent("sweeps", "150 frames", "300");
        let cut = || error().with_remedy(Remedy::KeepSteps { steps: 150 });
        for error in [
            anyhow::Error::from(cut()),
            PipelineError::from(cut()).into(),
            ExperimentError::from(PipelineError::from(cut())).into(),
            ServeError::from(PipelineError::from(cut())).into(),
        ] {
            let remedy = error.chain().find_map(remedy_of);
            assert_eq!(remedy, Some(Remedy::KeepSteps { steps: 150 }));
        }
        for (remedy, words) in [
            (Remedy::NameRate, "--rate HZ"),
            (Remedy::NameLabels, "data import --material NAME"),
            (Remedy::NameShape { rows: 4, cols: 5 }, "--shape 4x5"),
            (Remedy::KeepSteps { steps: 150 }, "--steps 150`"),
            (Remedy::ChooseFolds, "--split hold-out"),
            (
                Remedy::ListFindings {
                    data: "a.h5".into(),
                },
                "data check a.h5`",
            ),
            (Remedy::ConvertRecording, "data import FILE"),
            (Remedy::PassDownloadedFile, "--data FILE"),
        ] {
            let text = with_cure("no", Some(&remedy));
            assert!(text.starts_with("no; ") && text.contains(words), "{text}");
        }
    }

    #[test]
    fn a_mistyped_word_is_answered_with_the_one_that_was_meant() {
        let models = ["knn-l", "lda", "svm-h"];
        let meant = |word| meant_by(word, models.into_iter());
        assert_eq!(meant("lad").as_deref(), Some("lda"));
        assert_eq!(meant("svmh").as_deref(), Some("svm-h"));
        assert_eq!(meant("xyz"), None);
        let missing = |name: &str| {
            let error = DataError::format(name.as_ref(), "file", "a data set", "no such file");
            mistyped_twin(&error)
        };
        assert_eq!(missing("twim").as_deref(), Some("twin"));
        assert_eq!(missing("sweeps.h5"), None);
    }

    #[test]
    fn a_mistake_in_the_call_is_none_of_the_machine() {
        let unknown = || PipelineError::UnknownRecipe {
            name: "fats".into(),
            known: "fast".into(),
        };
        assert!(!broken(unknown()));
        assert!(!broken(ExperimentError::from(unknown())));
        assert!(!broken(anyhow::anyhow!("no such material")));
    }
}
