//! Results on stdout.

use std::io::Write;

/// Writes `text` and a line end; a reader that has gone is an error, not a panic.
pub fn print(text: impl std::fmt::Display) -> anyhow::Result<()> {
    let mut out = std::io::stdout().lock();
    writeln!(out, "{text}")?;
    out.flush()?;
    Ok(())
}

/// Writes `value` as one JSON document.
pub fn print_json(value: &impl serde::Serialize) -> anyhow::Result<()> {
    print(serde_json::to_string_pretty(value)?)
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
