//! Tests of written files, which other programs read, too.

use super::*;

pub(crate) fn is_same(a: &Dataset, b: &Dataset) -> bool {
    a.sha256() == b.sha256() && a.records() == b.records() && a.samples() == b.samples()
}

#[test]
fn what_is_written_reads_back_as_it_was() {
    let dir = tempfile::tempdir().unwrap();
    for file in [
        "edge_chunks.h5",
        "values_16bit.h5",
        "values_negative_f32.h5",
        "names_utf8.h5",
    ] {
        let dataset = format::read(&fixture("read").join(file)).unwrap();
        for target in ["copy.h5", "copy.npz"] {
            let path = dir.path().join(target);
            Format::from_extension(&path)
                .unwrap()
                .write(&path, &dataset)
                .unwrap();
            assert!(
                is_same(&format::read(&path).unwrap(), &dataset),
                "{file} as {target}"
            );
        }
    }
    let left: Vec<_> = std::fs::read_dir(dir.path()).unwrap().collect();
    assert_eq!(left.len(), 2, "no part of a file stays: {left:?}");
}

fn unbalanced() -> Dataset {
    let shape = SweepShape {
        steps: 2,
        rows: 1,
        cols: 1,
    };
    let records = [(1, 0), (0, 0), (1, 1)].map(|(label, sweep)| SweepRecord::new(label, sweep));
    let labels = LabelSet::new(["a b", "A:b?"]).unwrap();
    Dataset::new(
        "t",
        10.0,
        shape,
        labels,
        records.into(),
        Samples::U8(vec![1, 2, 3, 4, 5, 6]),
    )
    .unwrap()
}

#[test]
fn unequal_numbers_of_sweeps_fit_npz_but_not_hdf5() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("t.npz");
    npz::write(&path, &unbalanced()).unwrap();
    assert!(is_same(&npz::read(&path).unwrap(), &unbalanced()));
    let path = dir.path().join("t.h5");
    let error = tactmat::write(&path, &unbalanced())
        .unwrap_err()
        .to_string();
    assert!(
        error.ends_with("data set `samples`: expected as many sweeps of every material as of `a b`, 1 (.npz holds any number), found 2 of `A:b?`"),
        "{error}"
    );
    assert!(!path.exists());
}

#[test]
fn class_labels_that_collide_or_values_without_a_number_do_not_become_a_ts_file() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("t.ts");
    let gaps = format::read_with_gaps(&fixture("h5/bad_nan.h5")).unwrap();
    let error = ts::write(&path, &gaps).unwrap_err().to_string();
    assert!(
        error.contains("found NaN in `denim` sweep 2 at step 30"),
        "{error}"
    );
    let twice = Dataset::new(
        "t",
        10.0,
        unbalanced().shape(),
        LabelSet::new(["a b", "A:b"]).unwrap(),
        unbalanced().records().to_vec(),
        unbalanced().samples().clone(),
    );
    let error = ts::write(&path, &twice.unwrap()).unwrap_err().to_string();
    assert!(error.contains("two that both become `a_b`"), "{error}");
}

#[test]
fn a_failed_write_leaves_the_old_file_alone() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("missing folder").join("t.h5");
    let dataset = format::read(&fixture("h5/u8_gzip_fixed.h5")).unwrap();
    let error = tactmat::write(&path, &dataset).unwrap_err().to_string();
    assert!(error.contains("cannot write"), "{error}");
}

/// Returns the record of a `tests/golden` script about the file that `dataset` is written to; panics if the file has
/// changed.
fn found_by(script: &str, dataset: &Dataset, target: &str) -> Value {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join(target);
    Format::from_extension(&path)
        .unwrap()
        .write(&path, dataset)
        .unwrap();
    let golden = std::fs::read_to_string(tests_dir().join("golden").join(script)).unwrap();
    let golden: Value = serde_json::from_str(&golden).unwrap();
    let written = sha256_hex(std::fs::read(&path).unwrap());
    assert_eq!(
        golden["file_sha256"], written,
        "the file has changed: run tests/golden/{script}'s script"
    );
    golden["read"].clone()
}

fn read_by_python(dataset: &Dataset, compression: Option<&str>) -> Value {
    let records = dataset.records();
    let table = |value: &dyn Fn(&SweepRecord) -> u32| -> Vec<Vec<u32>> {
        records
            .chunks(4)
            .map(|material| material.iter().map(value).collect())
            .collect()
    };
    let mut expected = json!({
        "shape": [3, 4, 60, 4, 4],
        "type": "uint8",
        "samples_sha256": sha256_hex(expected_samples()),
        "materials": expected_materials(),
        "blocks": table(&|r| r.block.unwrap()),
        "test_flag": table(&|r| u32::from(r.test.unwrap())),
        "sample_rate_hz": 100.0,
    });
    if let Some(compression) = compression {
        expected["compression"] = compression.into();
    }
    expected
}

#[test]
fn h5py_reads_what_is_written() {
    let dataset = format::read(&fixture("read/edge_chunks.h5")).unwrap();
    let found = found_by("read_h5_with_h5py.json", &dataset, "t.h5");
    assert_eq!(found, read_by_python(&dataset, Some("gzip")));
}

#[test]
fn numpy_reads_what_is_written() {
    let dataset = format::read(&fixture("read/edge_chunks.h5")).unwrap();
    let found = found_by("read_npz_with_numpy.json", &dataset, "t.npz");
    assert_eq!(found, read_by_python(&dataset, None));
}

#[test]
fn aeon_reads_what_is_written() {
    let dataset = format::read(&fixture("read/values_negative_f32.h5")).unwrap();
    let found = found_by("read_ts_with_aeon.json", &dataset, "t.ts");
    let mut values = Vec::new();
    for index in 0..dataset.len() {
        let sweep = dataset.sweep(index);
        for taxel in 0..16 {
            values.extend(f32_bytes(sweep.iter().skip(taxel).step_by(16).copied()));
        }
    }
    let labels: Vec<String> = dataset
        .records()
        .iter()
        .map(|record| ts::class_label(dataset.labels().name(record.label)))
        .collect();
    let expected = json!({
        "shape": [12, 16, 60],
        "values_sha256": sha256_hex(values),
        "exact": true,
        "labels": labels,
        "class_values": ["cork", "denim", "spun_fleece"],
        "univariate": false,
        "missing": false,
    });
    assert_eq!(found, expected);
}
