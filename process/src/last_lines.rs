//! Last lines of a process's standard error.

use std::collections::VecDeque;
use std::io::{BufRead, BufReader, Read};

/// Number of lines that are kept.
const KEPT: usize = 3;

/// Beginning of the line with the error of a command.
const PREFIX: &str = "error: ";

/// Returns the output of a command without its `error: `, to be quoted in a message.
pub fn without_prefix(line: &str) -> &str {
    let line = line.trim();
    line.strip_prefix(PREFIX).unwrap_or(line)
}

/// Reads to the end and returns the last lines that are not empty, as one line; if a command printed an error, only that
/// line.
pub(crate) fn last_lines(from: impl Read) -> String {
    let mut from = BufReader::new(from);
    let mut kept = VecDeque::new();
    let mut line = Vec::new();
    // Output that cannot be read is ignored.
    while from.read_until(b'\n', &mut line).is_ok_and(|read| read > 0) {
        let text = String::from_utf8_lossy(&line).trim().to_string();
        line.clear();
        if text.is_empty() {
            continue;
        }
        if kept.len() == KEPT {
            kept.pop_front();
        }
        kept.push_back(text);
    }
    match kept.back() {
        Some(last) if last.starts_with(PREFIX) => without_prefix(last).into(),
        _ => Vec::from(kept).join(" / "),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_last_lines_with_text_are_kept() {
        let text = b"one\n\ntwo\r\nthree \n\xff four".as_slice();
        assert_eq!(last_lines(text), "two / three / \u{fffd} four");
        assert_eq!(last_lines(b"\n".as_slice()), "");
    }

    #[test]
    fn the_line_that_says_why_is_quoted_alone_and_without_its_prefix() {
        let text = b"reading a.h5\nerror: no hub runs on this host\n".as_slice();
        assert_eq!(last_lines(text), "no hub runs on this host");
        assert_eq!(without_prefix(" error: no hub\n"), "no hub");
        assert_eq!(without_prefix("no error: here"), "no error: here");
    }
}
