//! Errors of the command line: one line with a suggestion and the command whose help to read.

use std::process::ExitCode;

use clap::CommandFactory;
use clap::error::{ContextKind, ErrorKind};
use tactnet_data::near_name;

use super::{USAGE, report};
use crate::Cli;
use crate::output::harmless;

/// Prints the requested help, or an error of the command line in one line.
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
    let (mut message, mut verb) = (String::new(), verb_in(words_of_call()));
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
    let suggestion = recipe_setting(error, &verb).or_else(|| {
        let word = misplaced_path(error, &verb).or_else(|| mistyped_word(error))?;
        Some(format!("did you mean `{word}`?"))
    });
    if let Some(suggestion) = suggestion {
        // It replaces clap's own suggestion.
        let problem = message.split("; tip: ").next().unwrap_or_default();
        message = format!("{problem}; {suggestion}");
    }
    say!("{}; see `{verb} --help`", harmless(&message));
    ExitCode::from(USAGE)
}

/// Returns the arguments of this program; bytes that are not UTF-8 are replaced.
fn words_of_call() -> impl Iterator<Item = String> {
    let arguments = std::env::args_os().skip(1);
    arguments.map(|word| word.to_string_lossy().into_owned())
}

/// Returns the missing option for a file or folder that was given as a positional argument.
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

/// Training settings that belong to the recipe, by the names that other programs use for options.
const RECIPE_SETTINGS: [&str; 12] = [
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

/// Returns a hint for an unknown option of `train` that is a setting of the recipe.
fn recipe_setting(error: &clap::Error, verb: &str) -> Option<String> {
    if error.kind() != ErrorKind::UnknownArgument || verb != "tactnet train" {
        return None;
    }
    let clap::error::ContextValue::String(word) = error.get(ContextKind::InvalidArg)? else {
        return None;
    };
    let name = word.trim_start_matches('-').replace('_', "-");
    let name = name.split('=').next()?;
    RECIPE_SETTINGS.contains(&name).then(|| {
        "it is a setting of the recipe: `tactnet train --print-recipe fast > my.toml`, then `--recipe my.toml`".into()
    })
}

/// Returns the most similar value or command if clap suggests none.
fn mistyped_word(error: &clap::Error) -> Option<String> {
    use clap::error::ContextValue::{String as Word, Strings};
    match error.kind() {
        // Vulkan supports GPUs of every vendor.
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
            nearest(word, known.iter().map(String::as_str))
        }
        ErrorKind::InvalidSubcommand if error.get(ContextKind::SuggestedSubcommand).is_none() => {
            let Word(word) = error.get(ContextKind::InvalidSubcommand)? else {
                return None;
            };
            let mut command = Cli::command();
            // In `help data chek`, the mistyped word is a command of `data`.
            let words = words_of_call().filter(|word| word != "help");
            for name in words.take_while(|name| name != word) {
                command = command.find_subcommand(&name)?.clone();
            }
            let shown = command.get_subcommands().filter(|it| !it.is_hide_set());
            let names: Vec<&str> = shown.map(clap::Command::get_name).collect();
            nearest(word, names.iter().copied())
        }
        _ => None,
    }
}

/// Returns the most similar known name; the same letters in another order count as similar.
pub(super) fn nearest<'a>(
    word: &str,
    known: impl Iterator<Item = &'a str> + Clone,
) -> Option<String> {
    let letters = |name: &str| {
        let mut letters: Vec<char> = name.to_lowercase().chars().collect();
        letters.sort_unstable();
        letters
    };
    let typed = letters(word);
    let reordered = known.clone().find(|name| letters(name) == typed);
    let nearest = reordered.or_else(|| near_name(word, known));
    nearest.map(Into::into)
}

/// Returns `tactnet data check` for the words `data check --rate fast own.npz`. Some errors of clap carry no usage line.
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

/// Returns `tactnet data check` for the usage line `tactnet data check [OPTIONS] <FILE>`.
fn verb_of(usage: &str) -> String {
    usage
        .split_whitespace()
        .take_while(|word| word.chars().all(|c| c.is_ascii_lowercase()))
        .collect::<Vec<_>>()
        .join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mistyped_word_gets_a_suggestion() {
        let models = ["knn-l", "lda", "svm-h"];
        let suggested = |word| nearest(word, models.into_iter());
        assert_eq!(suggested("lad").as_deref(), Some("lda"));
        assert_eq!(suggested("svmh").as_deref(), Some("svm-h"));
        assert_eq!(suggested("xyz"), None);
    }
}
