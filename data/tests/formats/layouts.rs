//! Tests of columns and folders whose meaning their names leave open.

use tactnet_data::{FindingKind, Remedy, format};

use crate::own_data::assert_line;
use crate::tables::{columns, frames, write};
use crate::{expected_materials, names};

/// Columns are neither read nor left out in silence.
#[test]
fn columns_of_doubtful_meaning_are_noted() {
    let dir = tempfile::tempdir().unwrap();
    let materials = expected_materials();
    let notes = |dataset: &tactnet_data::Dataset| -> Vec<String> {
        let notes = dataset.reading_findings().iter();
        notes.map(|note| note.message.clone()).collect()
    };
    let folder = dir.path().join("folder");
    for (sweep, text) in frames(',', |sweep, step| format!("{step},{},", sweep / 4))
        .iter()
        .enumerate()
    {
        let file = folder.join(format!("{}/{sweep:02}.csv", materials[sweep / 4]));
        let names: String = (0..16).map(|taxel| format!(",{}", NAMES[taxel])).collect();
        write(&file, &format!(",class{names}\n{text}"));
    }
    let dataset = format::read(&folder).unwrap();
    assert_eq!(dataset.shape().taxels(), 17, "the class is read as a taxel");
    let [first, second] = &notes(&dataset)[..] else {
        panic!("{:?}", notes(&dataset));
    };
    assert!(
        first.starts_with("column 1 without a name: not read"),
        "{first}"
    );
    assert!(
        second.starts_with("`class`: read as a taxel, although"),
        "{second}"
    );
    let findings = tactnet_data::check(&dataset);
    assert_eq!(findings[0].kind, FindingKind::LeakingColumn);
    assert_eq!(findings[0].at.taxel, Some(0));

    let path = dir.path().join("frames.csv");
    let rows = frames(',', |sweep, step| {
        format!("{step},{sweep},{},{},", materials[sweep / 4], sweep / 4)
    });
    let table = format!(",sweep,material,class{}\n{}", columns(','), rows.concat());
    write(&path, &table);
    let dataset = format::read(&path).unwrap();
    assert_line(&dataset);
    let [first, second] = &notes(&dataset)[..] else {
        panic!("{:?}", notes(&dataset));
    };
    assert!(
        first.starts_with("column 1 without a name: not read"),
        "{first}"
    );
    assert_eq!(
        second,
        "`class`: not read, since `material` has its meaning"
    );
}

/// Names without a common pattern.
const NAMES: [&str; 16] = [
    "thumb",
    "index tip",
    "middle",
    "ring",
    "little",
    "palm",
    "heel",
    "edge",
    "left",
    "right",
    "top",
    "bottom",
    "inner",
    "outer",
    "near",
    "far",
];

/// macOS writes names of folders in another form of Unicode than tables have.
#[test]
fn both_forms_of_unicode_are_one_material() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("frames.csv");
    let rows = frames(',', |sweep, _| {
        let name = ["gru\u{308}n", "gr\u{fc}n", "rot"][sweep % 3];
        format!("{sweep},{name},")
    });
    write(
        &path,
        &format!("sweep,material{}\n{}", columns(','), rows.concat()),
    );
    let dataset = format::read(&path).unwrap();
    assert_eq!(names(&dataset), ["gr\u{fc}n", "rot"]);
    assert_eq!(dataset.sweeps_per_label(), [8, 4]);
}

/// Folders `train` and `test` are a split and no materials.
#[test]
fn folders_of_a_split_hold_the_folders_of_the_materials() {
    let dir = tempfile::tempdir().unwrap();
    let materials = expected_materials();
    let parts = ["Train", "train", "Validation", "TEST"];
    for (sweep, text) in frames(',', |_, _| String::new()).iter().enumerate() {
        // Sweeps have the same names in all parts.
        let file = format!("{}/{}/1.csv", parts[sweep % 4], materials[sweep / 4]);
        write(&dir.path().join(file), text);
    }
    let dataset = format::read(dir.path()).unwrap();
    assert_eq!(names(&dataset), materials);
    let tests: Vec<Option<bool>> = dataset.records().iter().map(|of| of.test).collect();
    assert_eq!(tests.iter().filter(|test| **test == Some(true)).count(), 3);
    assert_eq!(tests.iter().filter(|test| **test == Some(false)).count(), 9);
    let is_note = |found: &&tactnet_data::Finding| found.kind == FindingKind::FolderLayout;
    let note = dataset.reading_findings().iter().find(is_note).unwrap();
    let end = "read as a split; the folders in them name the materials; sweeps in `TEST` are test sweeps; sweeps in `Validation` are training sweeps";
    assert!(note.message.ends_with(end), "{}", note.message);
    let found = format::read_to_classify(dir.path(), None).unwrap();
    let different: std::collections::BTreeSet<&String> = found.names.iter().collect();
    assert_eq!(different.len(), 12, "{:?}", found.names);

    // Without folders of materials in them, nothing names the materials.
    let flat = dir.path().join("flat");
    for (sweep, text) in frames(',', |_, _| String::new()).iter().enumerate() {
        let part = ["train", "test"][sweep % 2];
        write(&flat.join(format!("{part}/{sweep:02}.csv")), text);
    }
    let refused = format::read(&flat).unwrap_err();
    assert_eq!(refused.remedy(), Some(Remedy::NameLabels), "{refused}");
    let found = format::read_to_classify(&flat, None).unwrap();
    assert!(!found.labelled && found.dataset.len() == 12);
}

/// Only one level of folders names the materials, and the other one is reported.
#[test]
fn folders_in_the_folders_of_materials_are_reported() {
    let dir = tempfile::tempdir().unwrap();
    let materials = expected_materials();
    for (sweep, text) in frames(',', |_, _| String::new()).iter().enumerate() {
        let file = format!("{}/day {}/{sweep:02}.csv", materials[sweep / 4], sweep % 2);
        write(&dir.path().join(file), text);
    }
    let refused = format::read(dir.path()).unwrap_err().to_string();
    let expected = "found sweeps two levels below, such as `";
    assert!(refused.contains(expected), "{refused}");
    for (sweep, text) in frames(',', |_, _| String::new()).iter().enumerate() {
        let file = format!("{}/{sweep:02}.csv", materials[sweep / 4]);
        write(&dir.path().join(file), text);
    }
    let dataset = format::read(dir.path()).unwrap();
    assert_line(&dataset);
    let note = &dataset.reading_findings()[0].message;
    let expected = "folders in the folders that name the materials, which are not read: `";
    assert!(note.starts_with(expected), "{note}");
}
