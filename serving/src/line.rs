//! One line of text without the heap.

use std::fmt::{Arguments, Write};

/// Up to `BYTES` bytes; what does not fit is cut off.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Line<const BYTES: usize> {
    bytes: [u8; BYTES],
    len: usize,
}

impl<const BYTES: usize> Default for Line<BYTES> {
    fn default() -> Self {
        Self {
            bytes: [0; BYTES],
            len: 0,
        }
    }
}

impl<const BYTES: usize> Line<BYTES> {
    /// Adds what `text` says.
    pub(crate) fn write(&mut self, text: Arguments<'_>) {
        // It never fails: what does not fit is left out.
        let _ = self.write_fmt(text);
    }

    /// What was written.
    pub(crate) fn as_str(&self) -> &str {
        std::str::from_utf8(&self.bytes[..self.len]).unwrap_or("")
    }
}

impl<const BYTES: usize> Write for Line<BYTES> {
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
        let mut line = Line::<8>::default();
        line.write(format_args!("{}-{}", 12, "äöü"));
        assert_eq!(line.as_str(), "12-äö");
    }
}
