//! Text in a packet.

use bytemuck::{Pod, Zeroable};

use crate::{FieldType, IsField};

/// Up to `BYTES` bytes of UTF-8, padded with zeros.
///
/// ```
/// use tactnet_packet::Text;
///
/// assert_eq!(Text::<8>::new("cork").as_str(), "cork");
/// assert_eq!(Text::<4>::new("sandpaper").as_str(), "sand");
/// ```
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Text<const BYTES: usize>([u8; BYTES]);

// SAFETY: an array of bytes, for any length.
unsafe impl<const BYTES: usize> Zeroable for Text<BYTES> {}
// SAFETY: as above; no padding, any bits.
unsafe impl<const BYTES: usize> Pod for Text<BYTES> {}

impl<const BYTES: usize> IsField for Text<BYTES> {
    const TYPE: FieldType = FieldType::Text(BYTES);
}

impl<const BYTES: usize> Text<BYTES> {
    /// Returns a text, truncated at a character boundary if it is too long.
    pub fn new(text: &str) -> Self {
        let mut end = text.len().min(BYTES);
        while !text.is_char_boundary(end) {
            end -= 1;
        }
        let mut bytes = [0; BYTES];
        bytes[..end].copy_from_slice(&text.as_bytes()[..end]);
        Self(bytes)
    }

    /// Returns the text; empty if a faulty sender put other bytes.
    pub fn as_str(&self) -> &str {
        let end = self.0.iter().position(|b| *b == 0).unwrap_or(BYTES);
        std::str::from_utf8(&self.0[..end]).unwrap_or("")
    }
}

impl<const BYTES: usize> Default for Text<BYTES> {
    fn default() -> Self {
        Self([0; BYTES])
    }
}

impl<const BYTES: usize> std::fmt::Debug for Text<BYTES> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        std::fmt::Debug::fmt(self.as_str(), f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_cut_between_characters_and_survives_nonsense() {
        assert_eq!(Text::<4>::new("ab").as_str(), "ab");
        assert_eq!(Text::<4>::new("abcü").as_str(), "abc");
        assert_eq!(Text::<4>::new("").as_str(), "");
        assert_eq!(Text::<2>([0xff, 0xff]).as_str(), "");
    }
}
