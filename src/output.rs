//! Results on standard output.

use std::io::Write;
use std::path::Path;
use std::process::ExitCode;

use anyhow::bail;
use tactnet_data::is_control;

/// Writes `text` and a line end, with control characters replaced. A reader that has closed the output is an error, not
/// a panic.
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

/// Replaces every control character except tabs and line ends by a replacement character.
pub fn harmless(text: &str) -> std::borrow::Cow<'_, str> {
    let harmful = |character: char| is_control(character) && !matches!(character, '\n' | '\t');
    if text.contains(harmful) {
        text.replace(harmful, "\u{fffd}").into()
    } else {
        text.into()
    }
}

/// Refuses to overwrite an existing file without `force`.
///
/// # Errors
/// Fails if the file exists, or if its folder does not.
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

/// Returns `number` with its noun, in the plural unless it is 1.
pub fn counted(number: usize, noun: &str) -> String {
    let plural = if number == 1 { "" } else { "s" };
    format!("{number} {noun}{plural}")
}

/// Format of a result.
#[derive(Clone, Copy)]
pub enum OutputFormat {
    /// Text for people.
    Table,
    /// JSON for programs.
    Json,
}

impl OutputFormat {
    /// Returns `Json` if `--json` was given.
    pub fn from_flag(json: bool) -> Self {
        if json { Self::Json } else { Self::Table }
    }

    /// Prints the result of a successful command: one JSON document, or its text with `print`.
    pub fn report<T: serde::Serialize>(
        self,
        result: &T,
        print: impl FnOnce(&T) -> anyhow::Result<()>,
    ) -> anyhow::Result<ExitCode> {
        match self {
            Self::Json => print_json(result)?,
            Self::Table => print(result)?,
        }
        Ok(ExitCode::SUCCESS)
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
