//! The end of what a process writes to its standard error.

use std::collections::VecDeque;
use std::io::{BufRead, BufReader, Read};

/// Lines that are kept.
const KEPT: usize = 3;

/// Reads to the end and returns the last lines that are not empty, as one line.
pub(crate) fn last_lines(from: impl Read) -> String {
    let mut from = BufReader::new(from);
    let mut kept = VecDeque::new();
    let mut line = Vec::new();
    // What cannot be read any more is not needed.
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
    Vec::from(kept).join(" / ")
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
}
