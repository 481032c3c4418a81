//! Small archives that claim, or unpack to, more than fits in memory.

use std::fs::File;
use std::io::Write;
use std::path::Path;
use std::time::{Duration, Instant};

use tactnet_data::format;
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

/// Returns a `.npy` with this type, shape and values, which need not match.
pub(crate) fn npy(descr: &str, shape: &str, values: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': ({shape},), }}\n");
    let length = (header.len() as u16).to_le_bytes();
    [b"\x93NUMPY\x01\x00", &length[..], header.as_bytes(), values].concat()
}

pub(crate) fn archive(path: &Path, members: &[(&str, Vec<u8>)]) {
    let mut zip = ZipWriter::new(File::create(path).unwrap());
    for (name, content) in members {
        zip.start_file(format!("{name}.npy"), SimpleFileOptions::default())
            .unwrap();
        zip.write_all(content).unwrap();
    }
    zip.finish().unwrap();
}

fn sweeps() -> Vec<u8> {
    npy("|u1", "4, 20, 2, 2", &[7; 320])
}

fn labels() -> Vec<u8> {
    npy("|u1", "4", &[0, 0, 1, 1])
}

#[test]
fn small_archives_that_declare_huge_arrays_are_refused_at_once() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("small.npz");
    let many = "100000000000";
    let zeros = vec![0; 50 << 20];
    for (members, refused) in [
        (
            vec![
                ("X", sweeps()),
                ("y", labels()),
                ("materials", npy("<U0", many, &[])),
            ],
            "array `materials`: expected numbers or text saved without pickle, found no values: [100000000000] of type `<U0`",
        ),
        (
            vec![("X", sweeps()), ("y", npy("|S0", many, &[]))],
            "found no values: [100000000000] of type `|S0`",
        ),
        (
            vec![
                ("X", npy("|u1", "400000000, 0, 2, 2", &[])),
                ("y", labels()),
            ],
            "found no values: [400000000, 0, 2, 2] of type `|u1`",
        ),
        (
            vec![
                ("samples", npy("|u1", "1, 1000000000000, 0, 4, 4", &[])),
                ("materials", npy("|S4", "1", b"wood")),
            ],
            "found no values: [1, 1000000000000, 0, 4, 4] of type `|u1`",
        ),
        (
            vec![
                ("X", npy("|u1", "4, 1000000000000, 4", &[])),
                ("y", labels()),
            ],
            "for [4, 1000000000000, 4] values of type `u1`",
        ),
        // The member unpacks to more bytes than its header declares.
        (
            vec![("X", [sweeps(), zeros.clone()].concat()), ("y", labels())],
            "found more than 320 bytes for [4, 20, 2, 2] values of type `u1`",
        ),
    ] {
        archive(&path, &members);
        let begun = Instant::now();
        let error = format::read(&path).err().unwrap().to_string();
        assert!(error.ends_with(refused), "{error}");
        assert!(begun.elapsed() < Duration::from_secs(1), "{error}");
    }
}

#[test]
fn members_that_are_not_read_are_not_unpacked() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("small.npz");
    let other = npy("|u1", "52428800", &vec![0; 50 << 20]);
    archive(&path, &[("X", sweeps()), ("y", labels()), ("other", other)]);
    let begun = Instant::now();
    assert_eq!(format::read(&path).unwrap().len(), 4);
    assert!(begun.elapsed() < Duration::from_millis(200));
}

#[test]
fn a_list_of_many_names_stays_short() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("small.npz");
    let names: Vec<String> = (0..5000).map(|number| format!("a{number}")).collect();
    let members: Vec<(&str, Vec<u8>)> = names.iter().map(|name| (&**name, labels())).collect();
    archive(&path, &members);
    let error = format::read(&path).err().unwrap().to_string();
    assert!(
        error.contains("and 4992 more") && error.len() < 500,
        "{error}"
    );
}
