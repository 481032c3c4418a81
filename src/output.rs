//! Results on stdout.

use std::io::Write;
use std::path::Path;

use anyhow::bail;
use tactnet_data::is_control;

/// Writes `text` and a line end; a reader that has gone is an error, not a panic. Control characters do not reach the terminal.
pub fn print(text: impl std::fmt::Display) -> anyhow::Result<()> {
    let mut out = std::io::stdout().lock();
    writeln!(out, "{}", harmless(&text.to_string()))?;
    out.flush()?;
    Ok(())
}

/// Writes `value` as one JSON document.
pub fn print_json(value: &impl serde::Serialize) -> anyhow::Result<()> {
    print(serde_json::to_string_pretty(value)?)
}

/// Returns `text` with a mark in place of every control character but tabs and line ends.
pub fn harmless(text: &str) -> std::borrow::Cow<'_, str> {
    let harmful = |character: char| is_control(character) && !matches!(character, '\n' | '\t');
    if text.contains(harmful) {
        text.replace(harmful, "\u{fffd}").into()
    } else {
        text.into()
    }
}

/// Refuses a file that is there, unless `force` says that it may go.
///
/// # Errors
/// It is there, or its folder is not.
pub fn refuse_to_overwrite(out: &Path, force: bool) -> anyhow::Result<()> {
    if out.exists() && !force {
        bail!(
            "{}: exists already; overwrite it with `--force`",
            out.display()
        );
    }
    if let Some(folder) = out.parent().filter(|folder| !folder.as_os_str().is_empty())
        && !folder.is_dir()
    {
        bail!("{}: its folder does not exist", out.display());
    }
    Ok(())
}

/// Returns `number` with its noun, in the plural unless it is one.
pub fn counted(number: usize, noun: &str) -> String {
    let plural = if number == 1 { "" } else { "s" };
    format!("{number} {noun}{plural}")
}

/// How a result is shown.
#[derive(Clone, Copy)]
pub enum OutputFormat {
    /// For people.
    Table,
    /// For programs.
    Json,
}

impl OutputFormat {
    /// Returns `Json` where `--json` was given.
    pub fn from_flag(json: bool) -> Self {
        if json { Self::Json } else { Self::Table }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_terminal_would_obey_is_shown_as_a_mark() {
        assert_eq!(harmless("a\tb\nü"), "a\tb\nü");
        assert_eq!(harmless("a\u{1b}[2Jb\r"), "a\u{fffd}[2Jb\u{fffd}");
    }
}
