//! Reading of files, which may turn out to be pipes or devices.

use std::fs::File;
use std::io::{Error, ErrorKind, Read, Result};
use std::path::Path;

/// Opens a file for reading; never waits for the other end of a pipe.
///
/// # Errors
/// A file that cannot be opened; a folder, a pipe or a device.
pub fn open_file(path: &Path) -> Result<File> {
    let mut options = File::options();
    options.read(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::custom_flags(&mut options, libc::O_NONBLOCK);
    let file = options.open(path)?;
    let found = file.metadata()?;
    if found.is_dir() {
        return Err(ErrorKind::IsADirectory.into());
    }
    if !found.is_file() {
        return Err(Error::new(
            ErrorKind::InvalidInput,
            "it is a pipe or a device, and no file",
        ));
    }
    Ok(file)
}

/// Reads a whole file.
///
/// # Errors
/// As [`open_file`].
///
/// ```
/// assert!(tactnet_data::read_file(&std::env::temp_dir()).is_err());
/// ```
pub fn read_file(path: &Path) -> Result<Vec<u8>> {
    let mut file = open_file(path)?;
    let mut bytes = Vec::with_capacity(file.metadata()?.len() as usize);
    file.read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Reads a whole file of UTF-8.
///
/// # Errors
/// As [`open_file`], and other encodings.
pub fn read_text(path: &Path) -> Result<String> {
    String::from_utf8(read_file(path)?).map_err(|error| Error::new(ErrorKind::InvalidData, error))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pipes_and_devices_are_refused_at_once() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        std::fs::write(path("file"), "text").unwrap();
        std::os::unix::fs::symlink(path("file"), path("link")).unwrap();
        assert_eq!(read_text(&path("link")).unwrap(), "text");
        let made = std::process::Command::new("mkfifo")
            .arg(path("pipe"))
            .status();
        assert!(made.unwrap().success());
        for name in [path("pipe").as_path(), Path::new("/dev/zero")] {
            let refused = read_file(name).unwrap_err();
            assert_eq!(refused.kind(), ErrorKind::InvalidInput, "{refused}");
        }
        let folder = read_file(folder.path()).unwrap_err();
        assert_eq!(folder.kind(), ErrorKind::IsADirectory);
    }
}
