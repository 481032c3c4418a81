//! Readers of crates that may panic on damaged files.

use std::path::Path;

use super::READING;
use crate::DataError;

/// Reads a file on a separate thread; a panic of the reader becomes an error.
///
/// - `kind`: kind of the file, for messages: "a Parquet table"
///
/// # Errors
/// Errors of `read`; a panic.
pub(super) fn guarded<T: Send>(
    path: &Path,
    kind: &str,
    read: impl FnOnce() -> Result<T, DataError> + Send,
) -> Result<T, DataError> {
    let joined = std::thread::scope(|scope| {
        let thread = std::thread::Builder::new().name(READING.into());
        Ok(thread.spawn_scoped(scope, read)?.join())
    });
    joined
        .map_err(|error| DataError::io(path, "read", error))?
        .unwrap_or_else(|_| Err(DataError::format(path, "file", kind, "one that is damaged")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_of_the_reader_is_an_error() {
        let path = Path::new("a.h5");
        assert_eq!(guarded(path, "HDF5", || Ok(7)).unwrap(), 7);
        let error = guarded::<u8>(path, "HDF5", || panic!("overflow")).unwrap_err();
        assert_eq!(
            error.to_string(),
            "a.h5: file: expected HDF5, found one that is damaged"
        );
    }
}
