//! Readers of crates that may panic on damaged files.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use crate::DataError;

thread_local! {
    /// True while this thread runs a reader that may panic.
    static READING: Cell<bool> = const { Cell::new(false) };
}

/// Returns true on a thread that runs [`caught`]: panics there become errors and need no output.
pub fn is_reading() -> bool {
    READING.get()
}

/// Returns the result of a reader that may panic on damaged files; `None` after a panic.
///
/// It runs on the calling thread, so that its parallel parts run in the thread pool of the caller.
///
/// ```
/// use tactnet_data::format::{caught, is_reading};
///
/// assert_eq!(caught(is_reading), Some(true));
/// assert!(!is_reading());
/// ```
pub fn caught<T>(read: impl FnOnce() -> T) -> Option<T> {
    let before = READING.replace(true);
    let result = catch_unwind(AssertUnwindSafe(read));
    READING.set(before);
    result.ok()
}

/// Reads a file; a panic of the reader becomes an error.
///
/// - `kind`: kind of the file, for messages: "a Parquet table"
///
/// # Errors
/// Errors of `read`; a panic.
pub(super) fn guarded<T>(
    path: &Path,
    kind: &str,
    read: impl FnOnce() -> Result<T, DataError>,
) -> Result<T, DataError> {
    caught(read)
        .unwrap_or_else(|| Err(DataError::format(path, "file", kind, "one that is damaged")))
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
        assert!(!is_reading());
    }
}
