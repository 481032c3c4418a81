//! Digests as text.

use std::fmt::Write;

use sha2::{Digest, Sha256};

/// Returns bytes as lower-case hexadecimal digits, two per byte.
///
/// ```
/// assert_eq!(tactnet_data::hex([1, 255]), "01ff");
/// ```
pub fn hex(bytes: impl AsRef<[u8]>) -> String {
    let bytes = bytes.as_ref();
    let mut text = String::with_capacity(2 * bytes.len());
    for byte in bytes {
        write!(text, "{byte:02x}").unwrap_or_else(|_| panic!("a string takes any text"));
    }
    text
}

/// Returns the SHA-256 of `content` as hexadecimal digits.
///
/// ```
/// assert!(tactnet_data::sha256_hex("cork").starts_with(|digit: char| digit.is_ascii_hexdigit()));
/// ```
pub fn sha256_hex(content: impl AsRef<[u8]>) -> String {
    hex(Sha256::digest(content))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digests_are_those_of_sha256sum() {
        assert_eq!(
            sha256_hex("abc"),
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
        );
        assert_eq!(hex([0, 10, 255]), "000aff");
    }
}
