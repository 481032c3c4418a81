//! Text of a status packet, written without heap allocation.

use std::fmt::{Arguments, Write};

/// Text of up to `BYTES` bytes; the rest is truncated at a character boundary.
#[derive(Debug, Clone, Copy)]
pub(crate) struct StatusLine<const BYTES: usize> {
    bytes: [u8; BYTES],
    len: usize,
}

impl<const BYTES: usize> Default for StatusLine<BYTES> {
    fn default() -> Self {
        Self {
            bytes: [0; BYTES],
            len: 0,
        }
    }
}

impl<const BYTES: usize> StatusLine<BYTES> {
    /// Appends `text`.
    pub(crate) fn write(&mut self, text: Arguments<'_>) {
        // `write_str` never fails: text that does not fit is truncated.
        let _ = self.write_fmt(text);
    }

    /// Returns the text.
    pub(crate) fn as_str(&self) -> &str {
        std::str::from_utf8(&self.bytes[..self.len]).unwrap_or("")
    }
}

impl<const BYTES: usize> Write for StatusLine<BYTES> {
    fn write_str(&mut self, text: &str) -> std::fmt::Result {
        let mut end = text.len().min(BYTES - self.len);
        while !text.is_char_boundary(end) {
            end -= 1;
        }
        self.bytes[self.len..self.len + end].copy_from_slice(&text.as_bytes()[..end]);
        self.len += end;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_fit_is_cut_between_characters() {
        let mut line = StatusLine::<8>::default();
        line.write(format_args!("{}-{}", 12, "äöü"));
        assert_eq!(line.as_str(), "12-äö");
    }
}
