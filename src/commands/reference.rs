//! The reference of all commands as Markdown, for the book (`tests/book.py`).

use std::fmt::Write;

use clap::{Arg, ArgAction, Command};

/// Returns a section for each command: what it does, its options with defaults, its examples.
pub fn markdown(command: &Command) -> String {
    let mut text = String::new();
    let mut command = command.clone();
    command.build();
    write_section(&command, "", &mut text);
    text
}

fn write_section(command: &Command, parent: &str, text: &mut String) {
    let name = format!("{parent}{}", command.get_name());
    let subcommands: Vec<&Command> = command
        .get_subcommands()
        .filter(|sub| !sub.is_hide_set() && sub.get_name() != "help")
        .collect();
    if !parent.is_empty() {
        write_command(command, &name, text);
    }
    for sub in subcommands {
        write_section(sub, &format!("{name} "), text);
    }
}

fn write_command(command: &Command, name: &str, text: &mut String) {
    let level = if name.matches(' ').count() == 1 {
        "##"
    } else {
        "###"
    };
    let about = command
        .get_about()
        .map(ToString::to_string)
        .unwrap_or_default();
    let _ = write!(
        text,
        "{level} {}\n\n{}.\n\n",
        name.trim_start_matches("tactnet "),
        about.trim_end_matches('.')
    );
    let shown = |argument: &&Arg| !argument.is_hide_set() && !is_common(argument);
    let arguments: Vec<&Arg> = command.get_arguments().filter(shown).collect();
    if !arguments.is_empty() {
        text.push_str("| argument | meaning |\n|---|---|\n");
        for argument in arguments {
            let _ = writeln!(
                text,
                "| {} | {} |",
                usage_of(argument),
                meaning_of(argument)
            );
        }
        text.push('\n');
    }
    let Some(after) = command.get_after_help() else {
        return;
    };
    let after = after.to_string();
    let (examples, note) = after.split_once("\n\n").unwrap_or((&after, ""));
    let lines: Vec<&str> = examples.lines().skip(1).map(str::trim).collect();
    let _ = write!(text, "```sh\n{}\n```\n\n", lines.join("\n"));
    if !note.is_empty() {
        let _ = write!(text, "{}\n\n", cell(note));
    }
}

/// Returns true for arguments that every command has.
fn is_common(argument: &Arg) -> bool {
    matches!(argument.get_id().as_str(), "help" | "version")
}

/// Returns an option with the names of its values, such as `` `--rate HZ` ``.
fn usage_of(argument: &Arg) -> String {
    let takes_values = matches!(argument.get_action(), ArgAction::Set | ArgAction::Append);
    let values: Vec<String> = argument
        .get_value_names()
        .unwrap_or_default()
        .iter()
        .map(ToString::to_string)
        .collect();
    let values = if takes_values {
        values.join(" ")
    } else {
        String::new()
    };
    let name = match argument.get_long() {
        Some(long) if values.is_empty() => format!("--{long}"),
        Some(long) => format!("--{long} {values}"),
        None => values,
    };
    format!("`{}`", name.replace('|', "\\|"))
}

/// Returns the help of an option with its possible values and its default.
fn meaning_of(argument: &Arg) -> String {
    let mut meaning = cell(
        &argument
            .get_help()
            .map(ToString::to_string)
            .unwrap_or_default(),
    );
    let possible: Vec<String> = argument
        .get_possible_values()
        .iter()
        .filter(|value| !value.is_hide_set())
        .map(|value| format!("`{}`", value.get_name()))
        .collect();
    if possible.len() > 1 && argument.get_action().takes_values() {
        let _ = write!(meaning, "; {}", possible.join(", "));
    }
    let defaults = argument.get_default_values();
    if !defaults.is_empty() && argument.get_action().takes_values() {
        let defaults: Vec<_> = defaults
            .iter()
            .map(|value| value.to_string_lossy())
            .collect();
        let _ = write!(meaning, " [default: {}]", defaults.join(","));
    }
    meaning
}

/// Returns text that fits a cell of a table.
fn cell(text: &str) -> String {
    let words: Vec<&str> = text.split_whitespace().collect();
    words.join(" ").replace('|', "\\|").replace('<', "\\<")
}
