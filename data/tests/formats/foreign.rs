//! Files of other laboratories: HDF5 with groups, links and user blocks, and MATLAB (`tests/golden/write_foreign_fixtures.py`).

use super::*;
use tactnet_data::format::{ReadOptions, read_to_classify_with};
use tactnet_data::{DataError, FindingKind};

fn foreign(name: &str) -> PathBuf {
    fixture("foreign").join(name)
}

/// Returns the values of the script, `[6][12][4]`.
fn values() -> Vec<u8> {
    let value = |index: usize| {
        let (sweep, step, taxel) = (index / 48, index / 4 % 12, index % 4);
        ((37 * sweep + 5 * step + taxel) % 251) as u8
    };
    (0..6 * 48).map(value).collect()
}

fn named(samples: &str, labels: &str) -> ReadOptions {
    let name = |name: &str| (!name.is_empty()).then(|| name.to_owned());
    ReadOptions {
        samples: name(samples),
        labels: name(labels),
        ..ReadOptions::default()
    }
}

fn read(file: &str, samples: &str, labels: &str) -> Result<Dataset, DataError> {
    format::read_with(&foreign(file), &named(samples, labels))
}

/// Returns the material of each sweep.
fn materials(dataset: &Dataset) -> Vec<&str> {
    let records = dataset.records().iter();
    records
        .map(|record| dataset.labels().name(record.label))
        .collect()
}

/// Returns the names of the files' sweeps: three materials twice.
fn twice(names: [&str; 3]) -> Vec<&str> {
    [names, names].concat()
}

const WORDS: [&str; 3] = ["cork", "denim", "felt"];
const NUMBERS: [&str; 3] = ["1", "2", "3"];

fn shape(dataset: &Dataset) -> [usize; 4] {
    let shape = dataset.shape();
    [dataset.len(), shape.steps, shape.rows, shape.cols]
}

#[track_caller]
fn assert_read(file: &str, [samples, labels]: [&str; 2], names: [&str; 3], rate: Option<f64>) {
    let dataset = read(file, samples, labels).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(shape(&dataset), [6, 12, 1, 4], "{file}");
    assert_eq!(dataset.samples(), &Samples::U8(values()), "{file}");
    assert_eq!(materials(&dataset), twice(names), "{file}");
    let found = (!dataset.is_rate_assumed()).then(|| dataset.sample_rate_hz());
    assert_eq!(found, rate, "{file}");
}

#[test]
fn a_file_behind_a_user_block_is_whole() {
    for file in [
        "user_block_512.h5",
        "user_block_2048.h5",
        "user_block_contiguous.h5",
    ] {
        let dataset = format::read(&foreign(file)).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(shape(&dataset), [6, 12, 2, 2], "{file}");
        let sweep = |sweep: usize| values()[48 * sweep..48 * (sweep + 1)].to_vec();
        let expected: Vec<u8> = match file {
            "user_block_contiguous.h5" => values(),
            _ => [0, 3, 1, 4, 2, 5].into_iter().flat_map(sweep).collect(),
        };
        assert_eq!(dataset.samples(), &Samples::U8(expected), "{file}");
        assert_eq!(names(&dataset), WORDS, "{file}");
    }
    let bytes = std::fs::read(foreign("user_block_512.h5")).unwrap();
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("cut.h5");
    std::fs::write(&path, &bytes[..bytes.len() - 1]).unwrap();
    let error = format::read(&path).unwrap_err().to_string();
    let expected = format!("expected {} bytes, as its header says", bytes.len());
    assert!(error.contains(&expected), "{error}");
}

#[test]
fn data_sets_in_groups_are_read_by_their_paths() {
    let skin = "recorded/skin/pressure";
    assert_read("groups.h5", [skin, "recorded/material"], WORDS, Some(250.0));
    assert_read(
        "groups.h5",
        ["/recorded/skin/pressure", "/recorded/number"],
        NUMBERS,
        Some(250.0),
    );
    assert_read(
        "groups.h5",
        ["recorded/half", "recorded/material"],
        WORDS,
        None,
    );
    assert_read("x_y.h5", ["", ""], NUMBERS, Some(50.0));
    assert_read("x_y.h5", ["X", "y"], NUMBERS, Some(50.0));
    let sweeps = read_to_classify_with(&foreign("groups.h5"), &named(skin, "")).unwrap();
    assert!(!sweeps.labelled);
    assert_eq!(sweeps.dataset.samples(), &Samples::U8(values()));
}

#[test]
fn a_check_of_named_data_sets_finds_no_errors() {
    let dataset = read("groups.h5", "recorded/skin/pressure", "recorded/material").unwrap();
    let errors = check(&dataset)
        .into_iter()
        .filter(|of| of.severity == Severity::Error);
    assert_eq!(
        errors.map(|of| of.message).collect::<Vec<_>>(),
        Vec::<String>::new()
    );
}

#[test]
fn a_file_without_known_names_lists_paths_shapes_and_types() {
    let listed = "found only `recorded/half` [6, 12, 4] f16, `recorded/material` [6] strings, \
        `recorded/number` [6] i32, `recorded/skin/pressure` [6, 12, 4] f64, `robot/joints` [6, 7] f32";
    let error = read("groups.h5", "", "").unwrap_err();
    let message = error.to_string();
    assert!(
        message.contains("data set `samples`: expected to be in the file (or `X`)"),
        "{message}"
    );
    assert!(message.ends_with(listed), "{message}");
    assert_eq!(error.remedy(), Some(Remedy::NameSamples));
    let error = read("groups.h5", "recorded/skin/pressure", "recorded/word").unwrap_err();
    let message = error.to_string();
    assert!(
        message.contains("data set `recorded/word`: expected to be in the file, found only"),
        "{message}"
    );
}

#[test]
fn a_group_for_each_sweep_is_read_by_a_path_with_a_star() {
    let shortest = |labels: &str| ReadOptions {
        keep: format::Keep::Shortest,
        ..named("data/demo_*/obs/tactile", labels)
    };
    for labels in ["data/demo_*/material", "data/demo_*@task"] {
        let dataset = format::read_with(&foreign("episodes.h5"), &shortest(labels)).unwrap();
        // The first sweep has 11 frames.
        assert_eq!(shape(&dataset), [6, 11, 1, 4]);
        let cut = |sweep: &[u8]| sweep[..44].to_vec();
        let expected: Vec<u8> = values().chunks(48).flat_map(cut).collect();
        assert_eq!(dataset.samples(), &Samples::U8(expected));
        assert_eq!(materials(&dataset), twice(WORDS));
        assert_eq!(dataset.sample_rate_hz(), 20.0);
    }
    let error = read("episodes.h5", "data/*/obs/tactile", "data/*/material").unwrap_err();
    assert_eq!(error.remedy(), Some(Remedy::KeepLengths { steps: 11 }));
    let error = format::read_with(&foreign("episodes.h5"), &shortest("")).unwrap_err();
    assert_eq!(error.remedy(), Some(Remedy::NameLabels));
    let error = read("episodes.h5", "", "").unwrap_err().to_string();
    let listed = "`data/demo_*/obs/joints` [12, 7] f32, the first of 6, `data/demo_*/obs/tactile` [11, 4] f32, the first of 6";
    assert!(error.contains(listed), "{error}");
    let error = read("episodes.h5", "data/*/skin", "")
        .unwrap_err()
        .to_string();
    let expected = "data sets `data/*/skin`: expected to be in the file, found only";
    assert!(error.contains(expected), "{error}");
}

#[test]
fn values_in_other_files_and_unknown_filters_are_named_with_the_cure() {
    for (file, found) in [
        (
            "bad_virtual.h5",
            "a virtual data set, whose values are in other files",
        ),
        ("bad_external_link.h5", "a link to the file `other.h5`"),
        (
            "bad_external_raw.h5",
            "external raw data file 'other.raw' could not be resolved",
        ),
    ] {
        let error = read(file, "", "").unwrap_err().to_string();
        assert!(error.contains("data set `samples`"), "{error}");
        assert!(
            error.contains(found) && error.contains("h5py copies all values"),
            "{error}"
        );
    }
    let error = format::read(&fixture("h5/f64_lzf_fixed.h5"))
        .unwrap_err()
        .to_string();
    assert!(error.contains("LZF (filter 32000); h5py copies"), "{error}");
}

#[test]
fn matlab_files_of_version_5_are_read() {
    assert_read("v5_cell.mat", ["", ""], WORDS, Some(100.0));
    assert_read("v5_compressed.mat", ["", ""], NUMBERS, Some(250.0));
    assert_read("v5_char.mat", ["", ""], WORDS, None);
    // Labels count from 1 where `materials` names them.
    assert_read("v5_indices.mat", ["", ""], WORDS, None);
    assert_read("v5_big_endian.mat", ["", ""], WORDS, Some(50.0));
}

#[test]
fn matlab_files_of_version_7_3_are_read() {
    assert_read("v73_cell.mat", ["", ""], WORDS, Some(100.0));
    assert_read("v73_numbers.mat", ["", ""], NUMBERS, None);
    assert_read(
        "v73_struct.mat",
        ["recording.skin", "recording.material"],
        WORDS,
        None,
    );
    assert_read("v73_struct.mat", ["recording/skin", ""], WORDS, None);
}

#[test]
fn fields_of_a_matlab_struct_are_read_and_listed() {
    let dataset = read("v5_struct.mat", "recording.skin", "").unwrap();
    let quarters = values().into_iter().map(|value| f32::from(value) / 4.0);
    assert_eq!(dataset.samples(), &Samples::F32(quarters.collect()));
    let expected = ["Möbelstoff", "绒布"].repeat(3);
    assert_eq!(materials(&dataset), expected);
    assert_eq!(dataset.sample_rate_hz(), 20.0);
    let error = read("v5_struct.mat", "", "").unwrap_err();
    let listed = "found only `recording/skin` [6, 12, 4] double, `recording/material` [6, 1] cell, `recording/rate` [1, 1] double";
    assert!(error.to_string().ends_with(listed), "{error}");
    assert_eq!(error.remedy(), Some(Remedy::NameSamples));
}

#[test]
fn matlab_numbers_of_every_class_keep_their_values() {
    for kind in ["i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "f4", "f8"] {
        let dataset = read("v5_types.mat", &format!("X_{kind}"), "y").unwrap();
        let mut found = vec![0.0; values().len()];
        dataset.samples().copy_to(0, &mut found);
        let value = |value: u8| match kind {
            // The script's cast wraps around at 127.
            "i1" => f32::from((i16::from(value) - 100) as i8),
            _ if kind.starts_with('u') => f32::from(value),
            _ => f32::from(value) - 100.0,
        };
        let expected: Vec<f32> = values().into_iter().map(value).collect();
        assert_eq!(found, expected, "{kind}");
    }
    let flags = read("v5_types.mat", "flags", "y").unwrap();
    let expected = values().into_iter().map(|value| u8::from(value > 100));
    assert_eq!(flags.samples(), &Samples::U8(expected.collect()));
}

#[test]
fn a_note_names_the_axes_of_matlab() {
    for (file, message) in [
        (
            "v5_cell.mat",
            "`X`: the size 6x12x4 in MATLAB is read as sweeps x steps x taxels",
        ),
        (
            "v73_cell.mat",
            "`X`: the size 6x12x4 in MATLAB is read as sweeps x steps x taxels",
        ),
        (
            "v5_five.mat",
            "`samples`: the size 3x2x12x2x2 in MATLAB is read as materials x sweeps x steps x rows x cols",
        ),
    ] {
        let dataset = read(file, "", "").unwrap();
        let note = dataset
            .reading_findings()
            .iter()
            .find(|of| of.kind == FindingKind::AxesRead);
        let note = note.unwrap_or_else(|| panic!("{file}"));
        assert_eq!(
            (note.severity, note.message.as_str()),
            (Severity::Note, message)
        );
    }
}

#[test]
fn five_dimensions_of_matlab_have_materials_and_blocks() {
    let dataset = read("v5_five.mat", "", "").unwrap();
    assert_eq!(shape(&dataset), [6, 12, 2, 2]);
    assert_eq!(
        materials(&dataset),
        ["cork", "cork", "denim", "denim", "felt", "felt"]
    );
    let blocks: Vec<_> = dataset.records().iter().map(|of| of.block).collect();
    assert_eq!(blocks, [Some(0), Some(1)].repeat(3));
    let sweep = |sweep: usize| values()[48 * sweep..48 * (sweep + 1)].to_vec();
    let expected = [0, 3, 1, 4, 2, 5].into_iter().flat_map(sweep).collect();
    assert_eq!(dataset.samples(), &Samples::U8(expected));
}

#[test]
fn matlab_without_labels_is_classified() {
    let sweeps = read_to_classify_with(&foreign("v5_unlabelled.mat"), &named("", "")).unwrap();
    assert!(!sweeps.labelled);
    assert_eq!(sweeps.dataset.samples(), &Samples::U8(values()));
    let error = read("v5_unlabelled.mat", "", "").unwrap_err();
    assert_eq!(error.remedy(), Some(Remedy::NameLabels));
}

#[test]
fn matlab_files_that_cannot_be_used_name_the_cure() {
    for (file, words) in [
        (
            "bad_v5_rank2.mat",
            vec!["found 2 dimensions [6, 12]", "MATLAB drops a last axis"],
        ),
        (
            "bad_v5_axes.mat",
            vec![
                "variable `y`: expected shape [12], as `X`",
                "along axis 3? X = permute(X, [3 1 2]) puts",
            ],
        ),
        (
            "bad_v5_complex.mat",
            vec!["variable `X`", "complex numbers; `abs(X)`"],
        ),
        ("bad_v5_sparse.mat", vec!["variable `X`", "`X = full(X)`"]),
        (
            "bad_v5_names.mat",
            vec!["only `skin` [6, 12, 4] double, `joints` [12, 4] double, `stuff` [6, 1] cell"],
        ),
        (
            "bad_v4.mat",
            vec![
                "a MATLAB file of version 4, or no MATLAB file; `save(FILE, \"-v7\")` writes one that is read",
            ],
        ),
        (
            "bad_v5_string.mat",
            vec!["variable `y`", "a string array", "`y = cellstr(y)`"],
        ),
        (
            "bad_v73_string.mat",
            vec!["variable `y`", "a string array", "`y = cellstr(y)`"],
        ),
        // MATLAB wrote this file itself, behind its own user block; HDF5 has the size 1x9 in reverse.
        ("matlab_made.mat", vec!["only `testdouble` [1, 9] double"]),
        ("matlab_made_cell.mat", vec!["only `testcell` [1, 4] cell"]),
    ] {
        let error = read(file, "", "").unwrap_err().to_string();
        for word in words {
            assert!(error.contains(word), "{error}\n{word}");
        }
    }
    let error = read("matlab_made_cell.mat", "testcell", "").unwrap_err();
    assert!(
        error.to_string().contains("cell 3 with [1, 2] numbers"),
        "{error}"
    );
}

#[test]
fn damaged_matlab_files_are_refused() {
    let bytes = std::fs::read(foreign("v5_compressed.mat")).unwrap();
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("damaged.mat");
    let refusal = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        format::read(&path).unwrap_err().to_string()
    };
    for length in [1, 127, 130, 140, bytes.len() - 1] {
        let error = refusal(&bytes[..length]);
        assert!(error.contains("damaged.mat"), "{error}");
    }
    // The last four bytes of a packed variable are its checksum.
    let mut flipped = bytes.clone();
    let last = flipped.len() - 1;
    flipped[last] ^= 1;
    assert!(refusal(&flipped).contains("a packed variable that is damaged"));
    // A variable of 4 GB in a file of 600 bytes.
    let mut claim = bytes[..128].to_vec();
    let mut packed = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::best());
    let head = [
        14_u32,
        u32::MAX,
        6,
        8,
        6,
        0,
        5,
        12,
        6,
        12,
        4,
        0,
        1 | 1 << 16,
        0x58,
    ];
    let head: Vec<u8> = head.iter().flat_map(|word| word.to_le_bytes()).collect();
    std::io::Write::write_all(&mut packed, &head).unwrap();
    let packed = packed.finish().unwrap();
    claim.extend(
        [15_u32, packed.len() as u32]
            .iter()
            .flat_map(|word| word.to_le_bytes()),
    );
    claim.extend(packed);
    let error = refusal(&claim);
    assert!(error.contains("bytes that unpack to 4294967295"), "{error}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1500, max_shrink_iters: 200, ..ProptestConfig::default() })]

    #[test]
    fn damaged_foreign_files_give_an_error_or_a_data_set((file, cut, changes) in damaged()) {
        let mut files: Vec<PathBuf> = std::fs::read_dir(fixture("foreign")).unwrap().map(|entry| entry.unwrap().path()).collect();
        files.retain(|path| path.extension().is_some_and(|extension| extension == "h5" || extension == "mat"));
        files.sort();
        let path = &files[file % files.len()];
        let dir = tempfile::tempdir().unwrap();
        let damaged = write_damaged(dir.path(), path, cut, &changes);
        for options in [
            named("", ""),
            named("recording.skin", "recording.material"),
            named("recorded/skin/pressure", "recorded/material"),
            named("data/*/obs/tactile", "data/*@task"),
        ] {
            match read_to_classify_with(&damaged, &options) {
                Ok(sweeps) => { check(&sweeps.dataset); }
                Err(error) => prop_assert!(error.to_string().contains(name(path)), "{}", error),
            }
        }
    }
}

#[test]
fn tables_and_folders_have_no_named_arrays() {
    let error = format::read_with(&fixture("read/frames.parquet"), &named("x", "")).unwrap_err();
    assert!(
        error
            .to_string()
            .contains("samples: expected a file with named arrays"),
        "{error}"
    );
    let error = format::read_with(&fixture("read"), &named("", "y")).unwrap_err();
    assert!(
        error
            .to_string()
            .contains("labels: expected a file with named arrays"),
        "{error}"
    );
    let npz = fixture("read/x_y_names.npz");
    let read = format::read_with(&npz, &named("X", "y")).unwrap();
    assert_eq!(read.sha256(), format::read(&npz).unwrap().sha256());
    let error = format::read_with(&npz, &named("skin", "y"))
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("array `skin`: expected to be in the archive, found only"),
        "{error}"
    );
}

#[test]
fn zip_archives_without_arrays_name_their_members_and_the_cure() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("sweeps.zip");
    let refusal = |members: &[&str]| {
        let mut zip = zip::ZipWriter::new(std::fs::File::create(&path).unwrap());
        for member in members {
            let options = zip::write::SimpleFileOptions::default();
            zip.start_file(*member, options).unwrap();
        }
        zip.finish().unwrap();
        format::read(&path).unwrap_err().to_string()
    };
    let error = refusal(&["felt/1.csv", "felt/2.csv"]);
    assert!(
        error.contains("a zip archive with `felt/1.csv`, `felt/2.csv`; unpack it"),
        "{error}"
    );
    let error = refusal(&["model/data.pkl", "model/version"]);
    assert!(error.contains("a file of PyTorch"), "{error}");
}
