//! Kinds of files, by their first bytes: data under any name, and files that only pretend to be data.

use std::io::Read;
use std::path::Path;

use super::{MCAP, npz};
use crate::DataError;

/// Number of bytes that show the kind.
const SHOWN: u64 = 512;

/// Kind of a file, by its first bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum FileKind {
    /// HDF5, also behind a user block.
    Hdf5,
    /// An archive of numpy arrays.
    Npz,
    /// A single numpy array.
    Npy,
    /// A Parquet table.
    Parquet,
    /// A recording.
    Mcap,
    /// A file of MATLAB of version 5 to 7.2.
    Matlab,
    /// Text, or bytes of no known kind.
    Other,
    /// No data; what it is, with the cure.
    Pretended(&'static str),
}

/// First bytes of files without data, and the names of their kinds.
const PRETENDED: [(&[u8], &str); 12] = [
    (
        b"version https://git-lfs.github.com/",
        "a Git LFS pointer, which stands for the file; `git lfs pull` downloads it",
    ),
    (b"\x1f\x8b", "a gzip archive; unpack it with `gunzip`"),
    (b"7z\xbc\xaf\x27\x1c", "a 7z archive; unpack it"),
    (b"Rar!", "a RAR archive; unpack it"),
    (
        b"\x28\xb5\x2f\xfd",
        "a file packed by zstd; unpack it with `zstd -d`",
    ),
    (b"BZh", "a bzip2 archive; unpack it with `bunzip2`"),
    (
        b"#ROSBAG V",
        "a ROS 1 bag; convert it with `mcap convert IN.bag OUT.mcap`",
    ),
    (
        b"SQLite format 3\0",
        "an SQLite database; convert a ROS 2 bag with `mcap convert IN.db3 OUT.mcap`",
    ),
    (b"%PDF", "a PDF document"),
    (b"\x89PNG", "a PNG picture"),
    (b"\xff\xd8\xff", "a JPEG picture"),
    (
        b"\xd0\xcf\x11\xe0",
        "an old Excel or Office document; save it as CSV",
    ),
];
/// Reason why pickles are refused, with the cure.
const PICKLE: &str = "a Python pickle, which can run code when it is loaded; save arrays with np.savez_compressed(\"sweeps.npz\", X=X, y=y)";
/// Mark that some programs write in front of UTF-8.
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";
/// Beginnings of web pages, in lower case.
const PAGES: [&[u8]; 4] = [b"<!doctype html", b"<html", b"<head", b"<?xml"];

/// Returns the kind of a file.
///
/// # Errors
/// A file that cannot be read.
pub(super) fn of(path: &Path) -> Result<FileKind, DataError> {
    let file = crate::open_file(path).map_err(|error| DataError::io(path, "open", error))?;
    let mut head = Vec::new();
    file.take(SHOWN)
        .read_to_end(&mut head)
        .map_err(|error| DataError::io(path, "read", error))?;
    Ok(match of_bytes(&head) {
        // MATLAB writes a block of 512 bytes before the HDF5 signature; any power of two from there is allowed.
        FileKind::Other | FileKind::Matlab if has_user_block(path) => FileKind::Hdf5,
        kind => kind,
    })
}

/// Returns an error for a file without data.
///
/// - `expected`: what the file should be
///
/// # Errors
/// A file that cannot be read, is empty, or is of a kind without data.
pub(super) fn refuse_pretended(path: &Path, expected: &str) -> Result<(), DataError> {
    match of(path)? {
        FileKind::Pretended(found) => Err(DataError::format(path, "file", expected, found)),
        _ => Ok(()),
    }
}

fn of_bytes(head: &[u8]) -> FileKind {
    let known: [(&[u8], FileKind); 6] = [
        (b"\x89HDF\r\n\x1a\n", FileKind::Hdf5),
        (b"PK\x03\x04", FileKind::Npz),
        (b"PK\x05\x06", FileKind::Npz),
        (npz::NPY, FileKind::Npy),
        (b"PAR1", FileKind::Parquet),
        (MCAP, FileKind::Mcap),
    ];
    if head.is_empty() {
        return FileKind::Pretended("an empty file");
    }
    if let Some((_, kind)) = known.iter().find(|(magic, _)| head.starts_with(magic)) {
        // An Excel workbook is a zip archive of XML.
        let is_workbook = head.windows(3).any(|part| part == b"xl/")
            || head.windows(19).any(|part| part == b"[Content_Types].xml");
        return match kind {
            FileKind::Npz if is_workbook => {
                FileKind::Pretended("an Excel workbook; save its sheet as CSV")
            }
            kind => *kind,
        };
    }
    if head.starts_with(b"MATLAB 5.0") || (head.starts_with(b"MATLAB") && head.len() >= 128) {
        return FileKind::Matlab;
    }
    if let Some((_, found)) = PRETENDED.iter().find(|(magic, _)| head.starts_with(magic)) {
        return FileKind::Pretended(found);
    }
    if is_pickle(head) {
        return FileKind::Pretended(PICKLE);
    }
    let text = head.strip_prefix(BYTE_ORDER_MARK).unwrap_or(head);
    let text = text.trim_ascii_start().to_ascii_lowercase();
    if PAGES.iter().any(|page| text.starts_with(page)) {
        return FileKind::Pretended(
            "an HTML page or XML: a download of a web page in place of the file?",
        );
    }
    FileKind::Other
}

/// Returns true for the first bytes of a Python pickle.
fn is_pickle(head: &[u8]) -> bool {
    // Protocols 2 to 5 begin with their number, a dict or list of protocol 0 or 1 with its mark.
    let marks: [&[u8]; 4] = [b"(dp0\n", b"(lp0\n", b"}q\0", b"]q\0"];
    if matches!(head, [0x80, 2..=5, ..]) || marks.iter().any(|mark| head.starts_with(mark)) {
        return true;
    }
    // Objects of protocol 0 and 1 begin with `c`, a module, a line feed, a class and a line feed.
    let tuple = head.strip_prefix(b"(").unwrap_or(head);
    let Some(module) = tuple.strip_prefix(b"c") else {
        return false;
    };
    let mut lines = module.split(|byte| *byte == b'\n');
    let module = lines.next().unwrap_or_default();
    let of_python = [
        &b"numpy"[..],
        b"copy_reg",
        b"builtins",
        b"__builtin__",
        b"pandas",
        b"collections",
    ];
    let is_known = |name: &&[u8]| {
        module
            .strip_prefix(*name)
            .is_some_and(|rest| matches!(rest, [] | [b'.', ..]))
    };
    let is_class = |line: &[u8]| {
        line.iter()
            .all(|byte| byte.is_ascii_alphanumeric() || *byte == b'_')
    };
    of_python.iter().any(is_known) && lines.next().is_some_and(is_class)
}

/// Returns true if the signature of HDF5 follows at 512, 1024, 2048, ... bytes.
fn has_user_block(path: &Path) -> bool {
    use std::io::{Seek, SeekFrom};
    let Ok(mut file) = crate::open_file(path) else {
        return false;
    };
    let length = file.metadata().map_or(0, |of| of.len());
    let mut places = (9..40)
        .map(|power| 1_u64 << power)
        .take_while(|place| place + 8 <= length);
    places.any(|place| {
        let mut signature = [0; 8];
        let read = file
            .seek(SeekFrom::Start(place))
            .and_then(|_| file.read_exact(&mut signature));
        read.is_ok() && &signature == b"\x89HDF\r\n\x1a\n"
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_that_are_no_data_are_named_with_their_cure() {
        for (head, word) in [
            (&b""[..], "empty"),
            (
                b"version https://git-lfs.github.com/spec/v1\noid",
                "git lfs pull",
            ),
            (b"\n <!DOCTYPE HTML><html>", "HTML"),
            (b"\xef\xbb\xbf<!DOCTYPE html>", "HTML"),
            (b"\x80\x04\x95\x1c", "pickle"),
            // pickle.dumps({"X": array}, protocol) and pickle.dumps(array, protocol) of Python 3.11 and numpy 2.
            (b"(dp0\nVX\np1\n", "pickle"),
            (b"}q\x00X\x01\x00\x00\x00Xq\x01", "pickle"),
            (b"cnumpy._core.multiarray\n_reconstruct\np0\n", "pickle"),
            (b"(cnumpy._core.multiarray\n_reconstruct\nq\0", "pickle"),
            (b"(lp0\nI1\naI2\na.", "pickle"),
            (b"]q\x00(K\x01K\x02e.", "pickle"),
            (b"\x1f\x8b\x08", "gunzip"),
            (b"PK\x03\x04..........[Content_Types].xml", "Excel"),
            (b"%PDF-1.7", "PDF"),
            (b"#ROSBAG V2.0\n", "mcap convert"),
            (b"SQLite format 3\0\x10\0", "mcap convert"),
        ] {
            let FileKind::Pretended(found) = of_bytes(head) else {
                panic!("{}", head.escape_ascii());
            };
            assert!(found.contains(word), "{found}");
        }
        assert_eq!(of_bytes(b"PK\x03\x04\x14\0"), FileKind::Npz);
        assert_eq!(of_bytes(b"% recorded on Monday\n1,2"), FileKind::Other);
        assert_eq!(of_bytes(b"1.5,2.5\n"), FileKind::Other);
        assert_eq!(of_bytes(b"cork\nfelt\np0\n"), FileKind::Other);
        assert_eq!(of_bytes(b"cnumpy,a\n1,2\n"), FileKind::Other);
        assert_eq!(of_bytes(b"\xef\xbb\xbfa,b\n1,2\n"), FileKind::Other);
    }
}
