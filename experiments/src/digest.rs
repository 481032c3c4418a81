//! Hashes as people and file names have them.

use sha2::{Digest, Sha256};

/// SHA-256 of a text, 64 hexadecimal digits.
pub(crate) fn sha256_hex(text: &str) -> String {
    let digest = Sha256::digest(text);
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}
