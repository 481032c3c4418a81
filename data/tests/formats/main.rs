//! Tests of the file formats on fixtures of h5py and numpy (`tests/golden/write_read_fixtures.py` and the issue's own).

#![allow(clippy::unwrap_used)] // a test may panic; the lint spares only functions marked `#[test]`

mod conditions;
mod foreign;
mod hostile;
mod layouts;
mod lengths;
mod own_data;
mod resolution;
mod tables;
mod time;
mod time_faults;
mod windows;
mod written;

use proptest::prelude::*;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use tactnet_data::format::{self, Format, npz, tactmat, ts};
use tactnet_data::twin::{self, TwinConfig, TwinVersion};
use tactnet_data::{
    ASSUMED_RATE_HZ, DataOrigin, Dataset, LabelSet, Remedy, Samples, Severity, SweepRecord,
    SweepShape, check, sha256_hex,
};

fn tests_dir() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests")
}

fn fixture(name: &str) -> PathBuf {
    tests_dir().join("fixtures").join(name)
}

fn files(folder: &str) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> = std::fs::read_dir(fixture(folder))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    files.retain(|path| path.extension().is_some_and(|e| e == "h5" || e == "npz"));
    files.sort();
    files
}

fn name(path: &Path) -> &str {
    path.file_name().unwrap().to_str().unwrap()
}

/// Returns the values of the `.npy` file, 3 x 4 sweeps of 60 x 4 x 4 digits.
fn expected_samples() -> Vec<u8> {
    let file = std::fs::read(fixture("h5/expected_samples_u8.npy")).unwrap();
    file[file.len() - 3 * 4 * 60 * 16..].to_vec()
}

fn expected_materials() -> Vec<String> {
    let text = std::fs::read_to_string(fixture("h5/expected_materials.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

fn names(dataset: &Dataset) -> Vec<String> {
    dataset.labels().names().map(str::to_owned).collect()
}

fn f32_bytes(values: impl IntoIterator<Item = f32>) -> Vec<u8> {
    values.into_iter().flat_map(f32::to_le_bytes).collect()
}

#[test]
fn every_good_file_holds_the_expected_values_and_names() {
    let (mut read, samples) = (0, expected_samples());
    for path in files("h5").into_iter().chain(files("read")) {
        let file = name(&path);
        let special = [
            "bad_",
            "values_",
            "unwritten",
            "names_",
            "f64_lzf",
            "text_labels",
            "x_y_",
            "materials_are_numbers",
        ];
        if special.iter().any(|prefix| file.starts_with(prefix)) {
            continue;
        }
        let dataset = format::read(&path).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(dataset.samples(), &Samples::U8(samples.clone()), "{file}");
        assert_eq!(names(&dataset), expected_materials(), "{file}");
        assert_eq!(
            dataset.shape(),
            SweepShape {
                steps: 60,
                rows: 4,
                cols: 4
            },
            "{file}"
        );
        let errors = check(&dataset)
            .into_iter()
            .filter(|f| f.severity == Severity::Error)
            .count();
        assert_eq!(errors, 0, "{file}");
        read += 1;
    }
    assert_eq!(read, 10 + 7 + 4, "good files that were read");
}

#[test]
fn values_of_any_type_narrow_to_the_smallest_that_holds_them() {
    let digits = expected_samples();
    let negative = format::read(&fixture("read/values_negative_f32.h5")).unwrap();
    let expected = digits.iter().map(|&x| f32::from(x) / 8.0 - 3.0).collect();
    assert_eq!(negative.samples(), &Samples::F32(expected));
    let wide = format::read(&fixture("read/values_16bit.h5")).unwrap();
    let expected = digits.iter().map(|&x| u16::from(x) * 200).collect();
    assert_eq!(wide.samples(), &Samples::U16(expected));
}

#[test]
fn chunks_that_were_never_written_hold_the_fill_value() {
    let dataset = format::read(&fixture("read/unwritten_chunks.h5")).unwrap();
    let mut expected = expected_samples();
    let material = 4 * 960;
    expected[material..2 * material].fill(7);
    expected[2 * material + 2 * 960..].fill(7);
    assert_eq!(dataset.samples(), &Samples::U8(expected));
}

#[test]
fn names_may_be_any_unicode_text() {
    let dataset = format::read(&fixture("read/names_utf8.h5")).unwrap();
    assert_eq!(names(&dataset), ["Möbelstoff", "denim", "绒布"]);
}

#[test]
fn blocks_flags_and_rate_are_read_where_they_stand() {
    for file in ["read/edge_chunks.h5", "read/five_dimensions.npz"] {
        let dataset = format::read(&fixture(file)).unwrap();
        let of_denim: Vec<_> = dataset.records()[4..8]
            .iter()
            .map(|r| (r.label, r.sweep, r.block, r.test))
            .collect();
        let block = |sweep, block, test| (1, sweep, Some(block), Some(test));
        let expected = [
            block(0, 2, false),
            block(1, 2, true),
            block(2, 3, false),
            block(3, 3, true),
        ];
        assert_eq!(of_denim, expected, "{file}");
        assert_eq!(dataset.sample_rate_hz(), 100.0);
    }
    let booleans = format::read(&fixture("read/fixed_array.h5")).unwrap();
    assert_eq!(booleans.records()[1].test, Some(true));
    assert_eq!(
        (booleans.has_blocks(), booleans.sample_rate_hz()),
        (false, 2200.0)
    );
    let on_samples = format::read(&fixture("read/big_endian_f4_contiguous.h5")).unwrap();
    assert_eq!(on_samples.sample_rate_hz(), 100.0);
    let silent = format::read(&fixture("read/btree_v2.h5")).unwrap();
    assert!(silent.is_rate_assumed());
    assert_eq!(silent.sample_rate_hz(), ASSUMED_RATE_HZ);
}

#[test]
fn labels_given_as_text_become_materials_in_alphabetical_order() {
    let dataset = format::read(&fixture("read/text_labels.npz")).unwrap();
    assert_eq!(names(&dataset), expected_materials());
    assert_eq!(
        (dataset.records()[11].label, dataset.records()[11].sweep),
        (2, 3)
    );
}

/// Bad files, and the LZF file, with their messages.
const REFUSED: [(&str, &str); 23] = [
    (
        "h5/bad_materials_count.h5",
        "data set `materials`: expected 3 names, one per material of `samples`, found 2 names",
    ),
    (
        "h5/bad_nan.h5",
        "sweeps: expected finite numbers, found 1 that are not, the first NaN in `denim` sweep 2 at step 30, taxel (1, 1)",
    ),
    (
        "h5/bad_no_samples.h5",
        "data set `samples`: expected to be in the file (or `X`), found only `materials` [3] text",
    ),
    (
        "h5/bad_not_hdf5.h5",
        "file: expected HDF5 (.h5), numpy (.npz), MATLAB (.mat), tables (.csv, .parquet) or a folder of .csv or .npy, found a file that begins with `samples,`",
    ),
    (
        "h5/bad_rank3.h5",
        "data set `samples`: expected 5 dimensions [materials][sweeps][steps][rows][cols], found 3 dimensions [60, 4, 4]",
    ),
    (
        "h5/bad_truncated.h5",
        "HDF5 file with data set `samples`: expected 14189 bytes, as its header says, found 9459 bytes: the file is cut short",
    ),
    (
        "h5/f64_lzf_fixed.h5",
        "data set `samples`: expected no filter, or gzip, shuffle, fletcher32, szip, nbit or scale-offset, found the filter LZF (filter 32000); h5py copies all values into one file: `with h5py.File(FILE) as f, h5py.File(\"copy.h5\", \"w\") as g: [g.create_dataset(n, data=f[n][()]) for n in f]; g.attrs.update(f.attrs)`",
    ),
    (
        "read/bad_beyond_f32.h5",
        "data set `samples`: expected values that a 32-bit float holds, found 16777217",
    ),
    (
        "read/bad_blocks_shape.h5",
        "data set `blocks`: expected shape [3, 4], materials by sweeps, found shape [2, 4]",
    ),
    (
        "read/bad_flag_2.h5",
        "data set `test_flag`: expected 0 or 1, found 2",
    ),
    (
        "read/bad_float16.h5",
        "data set `samples`: expected numbers of 8, 16, 32 or 64 bits, found float16; store it as float32: `samples.astype('f4')`",
    ),
    (
        "read/bad_infinite.h5",
        "sweeps: expected finite numbers, found 1 that are not, the first inf in `denim` sweep 1 at step 12, taxel (2, 0)",
    ),
    (
        "read/bad_materials_are_floats.h5",
        "data set `materials`: expected names or whole numbers, found f64",
    ),
    (
        "read/bad_rate.h5",
        "attribute `sample_rate_hz`: expected a positive number of Hz, found -1",
    ),
    (
        "read/bad_same_names.h5",
        "data set `materials`: expected distinct names, found `cork` at labels 0 and 2",
    ),
    (
        "read/bad_samples_are_text.h5",
        "data set `samples`: expected integers of 8, 16, 32 or 64 bits or floats of 32 or 64 bits, found strings",
    ),
    (
        "read/bad_samples_is_a_group.h5",
        "data set `samples`: expected to be in the file (or `X`), found only `materials` [3] text",
    ),
    (
        "read/bad_complex.npz",
        "array `samples`: expected numbers or text saved without pickle, found complex numbers (complex64); `np.abs(X)` or `X.real.astype(np.float32)` gives real ones",
    ),
    (
        "read/bad_label_range.npz",
        "array `labels`: expected indices of the 3 materials, found 3",
    ),
    (
        "read/bad_nan.npz",
        "sweeps: expected finite numbers, found 1 that are not, the first NaN in `denim` sweep 2 at step 59, taxel (1, 3)",
    ),
    (
        "read/bad_no_samples.npz",
        "array `X`: expected to be in the archive: np.savez_compressed(\"sweeps.npz\", X=X, y=y) with X [n][steps][taxels] and y [n], found only `x` [60, 4, 4]; rename `x` to `X`, if that is what it holds",
    ),
    (
        "read/bad_pickled.npz",
        "array `materials`: expected numbers or text saved without pickle, found an object array (pickled), as numpy saves a dict, or a list of sweeps of several lengths: sweeps must be one array of numbers, names text (`.astype(str)`)",
    ),
    (
        "read/bad_rank2.npz",
        "array `samples`: expected 3 dimensions [n][steps][taxels], 4 [n][steps][rows][cols] or 5 [materials][sweeps][steps][rows][cols], found 2 dimensions [4, 4]",
    ),
];

#[test]
fn every_bad_file_is_refused_with_file_data_set_expected_and_found() {
    for (file, message) in REFUSED {
        let path = fixture(file);
        let error = format::read(&path)
            .err()
            .unwrap_or_else(|| panic!("{file} was read"));
        assert_eq!(error.to_string(), format!("{}: {message}", path.display()));
    }
    let bad = files("h5")
        .into_iter()
        .chain(files("read"))
        .filter(|p| name(p).starts_with("bad_"));
    assert_eq!(
        bad.count() + 1,
        REFUSED.len(),
        "bad files, and the LZF file, that are tested"
    );
}

#[test]
fn a_check_may_read_what_training_refuses() {
    for file in ["h5/bad_nan.h5", "read/bad_nan.npz", "read/bad_infinite.h5"] {
        let dataset = format::read_with_gaps(&fixture(file)).unwrap();
        let findings = check(&dataset);
        assert_eq!(findings[0].severity, Severity::Error, "{file}");
        assert!(
            findings[0]
                .at
                .sweep
                .is_some_and(|sweep| (4..8).contains(&sweep)),
            "{file}"
        );
    }
}

#[test]
fn files_of_another_kind_are_refused_by_what_they_are() {
    let dir = tempfile::tempdir().unwrap();
    let refusal = |name: &str, content: &[u8]| {
        let path = dir.path().join(name);
        std::fs::write(&path, content).unwrap();
        format::read(&path).unwrap_err()
    };
    let recording = refusal("a.mcap", b"\x89MCAP0\r\n").remedy();
    assert_eq!(recording, Some(Remedy::ConvertRecording));
    let refusal = |name: &str, content: &[u8]| refusal(name, content).to_string();
    assert!(refusal("a.bin", b"1,2,3").ends_with("found a file that begins with `1,2,3`"));
    assert!(refusal("a.txt", b"1,2,3").contains("a table with columns `sweep`, `material`"));
    assert!(refusal("a.csv", b"1,2,3").contains("a table with columns `sweep`, `material`"));
    assert!(refusal("a.dat", b"").ends_with("found an empty file"));
    for name in ["a.npz", "a.h5", "a.csv", "a.parquet"] {
        assert!(
            refusal(name, b"").ends_with("found an empty file"),
            "{name}"
        );
        let pointer = b"version https://git-lfs.github.com/spec/v1\noid sha256:0\n";
        assert!(refusal(name, pointer).contains("`git lfs pull`"), "{name}");
        assert!(refusal(name, b"<!DOCTYPE html>").contains("HTML"), "{name}");
    }
    assert!(refusal("a.npy", b"\x93NUMPY\x01\x00").contains("np.savez_compressed"));
    let missing = format::read(&dir.path().join("none.h5"))
        .unwrap_err()
        .to_string();
    assert!(missing.contains("none.h5: cannot open"), "{missing}");
    let odd = Format::from_extension(Path::new("a.csv"))
        .unwrap_err()
        .to_string();
    assert_eq!(
        odd,
        "a.csv: file name: expected the extension .h5, .hdf5, .npz or .ts, found .csv"
    );
}

/// Generates a damaged file: its truncated length and changed bytes (mostly in the first 3 kB, which contain the
/// structure).
fn damaged() -> impl Strategy<
    Value = (
        usize,
        Option<prop::sample::Index>,
        Vec<(prop::sample::Index, bool, u8)>,
    ),
> {
    let place = (
        any::<prop::sample::Index>(),
        prop::bool::weighted(0.8),
        any::<u8>(),
    );
    (
        any::<usize>(),
        prop::option::weighted(0.2, any::<prop::sample::Index>()),
        prop::collection::vec(place, 0..8),
    )
}

/// Writes a copy of a file with changed bytes, cut to a part of its length, into `folder`.
fn write_damaged(
    folder: &Path,
    path: &Path,
    cut: Option<prop::sample::Index>,
    changes: &[(prop::sample::Index, bool, u8)],
) -> PathBuf {
    let mut bytes = std::fs::read(path).unwrap();
    for (place, in_front, value) in changes {
        let range = match in_front {
            true => bytes.len().min(3000),
            false => bytes.len(),
        };
        bytes[place.index(range)] = *value;
    }
    if let Some(cut) = cut {
        bytes.truncate(cut.index(bytes.len()));
    }
    let damaged = folder.join(name(path));
    std::fs::write(&damaged, bytes).unwrap();
    damaged
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1500, max_shrink_iters: 200, ..ProptestConfig::default() })]

    #[test]
    fn damaged_files_give_an_error_or_a_data_set_but_never_a_panic((file, cut, changes) in damaged()) {
        let files: Vec<PathBuf> = files("h5").into_iter().chain(files("read")).collect();
        let path = &files[file % files.len()];
        let dir = tempfile::tempdir().unwrap();
        let damaged = write_damaged(dir.path(), path, cut, &changes);
        match format::read_with_gaps(&damaged) {
            Ok(dataset) => { check(&dataset); }
            Err(error) => prop_assert!(error.to_string().contains(name(path)), "{}", error),
        }
    }
}

#[test]
fn files_keep_where_their_sweeps_come_from() {
    let directory = tempfile::tempdir().unwrap();
    let twin = |version| {
        let config = TwinConfig {
            version,
            materials: 3,
            sweeps: 4,
            steps: 40,
            ..TwinConfig::default()
        };
        twin::generate(&config).unwrap()
    };
    let recorded = format::read(&fixture("read/edge_chunks.h5")).unwrap();
    for (dataset, origin) in [
        (twin(TwinVersion::One), DataOrigin::Twin1),
        (twin(TwinVersion::Two), DataOrigin::Twin2),
        (recorded, DataOrigin::Recorded),
    ] {
        assert_eq!(dataset.origin(), origin);
        for file in ["a.h5", "a.npz"] {
            let path = directory.path().join(file);
            let format = Format::from_extension(&path).unwrap();
            format.write(&path, &dataset).unwrap();
            assert_eq!(format::read(&path).unwrap().origin(), origin, "{file}");
        }
    }
}
