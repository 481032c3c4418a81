//! Git's checksum of a file, which is published for TactMat.

use crate::{DataError, hex};
use sha1::{Digest, Sha1};
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Returns the git blob id of a file in hex: SHA-1 over `blob <size>\0` and the content, as `git hash-object FILE` prints
/// it.
///
/// # Errors
/// A file that cannot be read.
pub fn git_blob_id(path: &Path) -> Result<String, DataError> {
    let unreadable = |error| DataError::io(path, "read", error);
    let mut file = File::open(path).map_err(unreadable)?;
    let size = file.metadata().map_err(unreadable)?.len();
    let mut hash = Sha1::new_with_prefix(format!("blob {size}\0"));
    let mut buffer = vec![0; 1 << 16];
    loop {
        match file.read(&mut buffer) {
            Ok(0) => break,
            Ok(read) => hash.update(&buffer[..read]),
            Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
            Err(error) => return Err(unreadable(error)),
        }
    }
    Ok(hex(hash.finalize()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blob_ids_are_those_of_git_hash_object() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("file");
        let long: Vec<u8> = (0..200_000u32).map(|i| (i % 251) as u8).collect();
        for (content, id) in [
            (&b""[..], "e69de29bb2d1d6434b8b29ae775ad8c2e48c5391"),
            (&b"hello\n"[..], "ce013625030ba8dba906f756967f9e9ca394464a"),
            (&long, "4b5aafc78e13e1979389caabe88bd0fbc339398e"),
        ] {
            std::fs::write(&path, content).unwrap();
            assert_eq!(git_blob_id(&path).unwrap(), id);
        }
    }

    #[test]
    fn a_missing_file_is_named() {
        let error = git_blob_id(Path::new("no/such/file.h5"))
            .unwrap_err()
            .to_string();
        assert!(error.starts_with("no/such/file.h5: cannot read"), "{error}");
    }
}
