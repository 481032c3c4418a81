//! Sweeps of unequal length in every format that can hold them.

use std::fmt::Write as _;

use tactnet_data::format::{Keep, ReadOptions, Span, Windows};

use super::*;
use crate::hostile::{self, npy};
use crate::tables::write;
use crate::written::is_same;

/// Numbers of frames of six sweeps of two materials, which alternate.
const LENGTHS: [usize; 6] = [30, 24, 28, 30, 21, 27];
/// Materials of the sweeps.
const MATERIALS: [&str; 2] = ["cork", "felt"];

fn digit(sweep: usize, step: usize, taxel: usize) -> usize {
    (37 * sweep + 11 * step * (taxel + 1) + step * step) % 251
}

/// Returns the rows of a sweep as lines of numbers.
fn lines(sweep: usize) -> Vec<String> {
    let row = |step| format!("{},{}", digit(sweep, step, 0), digit(sweep, step, 1));
    (0..LENGTHS[sweep]).map(row).collect()
}

fn all() -> ReadOptions {
    ReadOptions {
        keep: Keep::All,
        ..ReadOptions::default()
    }
}

/// Returns the lengths and checks the values; `order` gives the sweep of each entry.
#[track_caller]
fn assert_sweeps(dataset: &Dataset, order: &[usize]) {
    assert_eq!(dataset.shape().steps, 30);
    let lengths: Vec<usize> = order.iter().map(|sweep| LENGTHS[*sweep]).collect();
    assert_eq!(dataset.lengths(), Some(lengths.as_slice()));
    for (index, &sweep) in order.iter().enumerate() {
        let expected: Vec<f32> = (0..LENGTHS[sweep])
            .flat_map(|step| [0, 1].map(|taxel| digit(sweep, step, taxel) as f32))
            .collect();
        assert_eq!(dataset.sweep(index), expected, "sweep {sweep}");
        let material = dataset.labels().name(dataset.records()[index].label);
        assert_eq!(material, MATERIALS[sweep % 2]);
    }
}

fn table(path: &Path) {
    let mut text = String::from("sweep,material,a,b\n");
    for sweep in 0..LENGTHS.len() {
        for line in lines(sweep) {
            let _ = writeln!(text, "{sweep},{},{line}", MATERIALS[sweep % 2]);
        }
    }
    write(path, &text);
}

fn from_table(dir: &tempfile::TempDir) -> Dataset {
    let path = dir.path().join("table.csv");
    table(&path);
    format::read_with(&path, &all()).unwrap()
}

#[test]
fn tables_and_folders_keep_the_length_of_every_sweep_if_asked() {
    let dir = tempfile::tempdir().unwrap();
    assert_sweeps(&from_table(&dir), &[0, 1, 2, 3, 4, 5]);
    let folders = dir.path().join("folders");
    for sweep in 0..LENGTHS.len() {
        let folder = folders.join(MATERIALS[sweep % 2]);
        std::fs::create_dir_all(&folder).unwrap();
        write(
            &folder.join(format!("{sweep}.csv")),
            &lines(sweep).join("\n"),
        );
    }
    let dataset = format::read_with(&folders, &all()).unwrap();
    assert_sweeps(&dataset, &[0, 2, 4, 1, 3, 5]);
    let refused = format::read(&folders).unwrap_err();
    assert_eq!(refused.remedy(), Some(Remedy::KeepLengths { steps: 21 }));
    let steps = |keep| {
        let options = ReadOptions {
            keep,
            ..ReadOptions::default()
        };
        format::read_with(&folders, &options).unwrap()
    };
    assert_eq!(steps(Keep::Shortest).shape().steps, 21);
    assert_eq!(steps(Keep::Shortest).lengths(), None);
}

#[test]
fn written_files_state_the_lengths_and_are_read_with_them() {
    let dir = tempfile::tempdir().unwrap();
    let dataset = from_table(&dir);
    for target in ["copy.h5", "copy.npz"] {
        let path = dir.path().join(target);
        Format::from_extension(&path)
            .unwrap()
            .write(&path, &dataset)
            .unwrap();
        let read = format::read(&path).unwrap();
        let order: &[usize] = match target {
            "copy.h5" => &[0, 2, 4, 1, 3, 5],
            _ => &[0, 1, 2, 3, 4, 5],
        };
        assert_sweeps(&read, order);
        if target == "copy.npz" {
            assert!(is_same(&read, &dataset.clone().with_patch(1, 2).unwrap()));
        }
        let cut = |keep| {
            let options = ReadOptions {
                keep,
                ..ReadOptions::default()
            };
            format::read_with(&path, &options)
        };
        assert_eq!(cut(Keep::Shortest).unwrap().shape().steps, 21);
        assert_eq!(cut(Keep::First(10)).unwrap().lengths(), None);
        let refused = cut(Keep::First(25)).unwrap_err().to_string();
        assert!(refused.contains("1 to 21"), "{refused}");
        // Windows have one length; they come from the frames of the sweeps alone.
        let windows = ReadOptions {
            windows: Some(Windows::of(Span::Steps(10))),
            ..ReadOptions::default()
        };
        let cut = format::read_with(&path, &windows).unwrap();
        assert_eq!((cut.len(), cut.lengths()), (3 + 2 + 2 + 3 + 2 + 2, None));
    }
    let text = dir.path().join("copy.ts");
    ts::write(&text, &dataset).unwrap();
    let text = std::fs::read_to_string(text).unwrap();
    assert!(text.contains("@equalLength false\n@classLabel"), "{text}");
    let values = |line: &str| line.split(':').next().unwrap().split(',').count();
    let data = text.split_once("@data\n").unwrap().1;
    assert!(data.lines().map(values).eq(LENGTHS));
}

#[test]
fn a_group_for_each_sweep_keeps_its_length() {
    let options = ReadOptions {
        samples: Some("data/demo_*/obs/tactile".into()),
        labels: Some("data/demo_*/material".into()),
        ..all()
    };
    let dataset = format::read_with(&fixture("foreign/episodes.h5"), &options).unwrap();
    assert_eq!(dataset.lengths(), Some(&[11, 12, 12, 12, 12, 12][..]));
}

/// Returns an archive with `X` of two sweeps of three frames and an array `lengths`.
fn archive(path: &Path, descr: &str, count: &str, lengths: &[u8]) {
    let members = [
        ("X", npy("|u1", "2, 3, 1", &[1, 2, 3, 4, 5, 99])),
        ("y", npy("|u1", "2", &[0, 1])),
        ("lengths", npy(descr, count, lengths)),
    ];
    hostile::archive(path, &members);
}

#[test]
fn an_array_of_lengths_that_means_something_else_is_ignored_with_a_note() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("lengths.npz");
    archive(&path, "|u1", "2", &[3, 2]);
    let read = format::read(&path).unwrap();
    assert_eq!(read.lengths(), Some(&[3, 2][..]));
    assert_eq!(read.samples(), &Samples::U8(vec![1, 2, 3, 4, 5, 5]));
    for (descr, shape, values) in [
        ("|u1", "3", vec![1, 2, 3]),
        ("<f4", "2", f32_bytes([0.5, 1.5])),
    ] {
        archive(&path, descr, shape, &values);
        let read = format::read(&path).unwrap();
        assert_eq!(read.lengths(), None);
        let noted =
            |finding: &tactnet_data::Finding| finding.message.contains("`lengths` that is ignored");
        assert!(read.reading_findings().iter().any(noted), "{shape}");
    }
    for impossible in [[3, 0], [4, 2]] {
        archive(&path, "|u1", "2", &impossible);
        let refused = format::read(&path).unwrap_err().to_string();
        assert!(refused.contains("1 to 3 frames"), "{refused}");
    }
}

#[test]
fn checks_look_at_the_frames_of_the_sweeps_alone() {
    let twin = twin::small(3, 8, 200).unwrap();
    let lengths = |length: fn(usize) -> usize| (0..24).map(length).collect::<Vec<usize>>();
    let mixed = twin
        .clone()
        .with_lengths(lengths(|sweep| 200 - sweep * 7 % 11 * 10))
        .unwrap();
    use tactnet_data::FindingKind::{Dropout, Padding, TellingLengths, UnequalLengths};
    let of_length = [Dropout, Padding, TellingLengths, UnequalLengths];
    let found = check(&mixed);
    assert!(
        !found
            .iter()
            .any(|finding| of_length.contains(&finding.kind)),
        "{found:?}"
    );
    // The same sweeps, with the last frames repeated, are padded.
    let shape = mixed.shape();
    let records = mixed.records().to_vec();
    let (labels, samples) = (mixed.labels().clone(), mixed.samples().clone());
    let padded = Dataset::new("padded", 750.0, shape, labels, records, samples).unwrap();
    assert!(check(&padded).iter().any(|finding| finding.kind == Padding));
    // The length of each material's own.
    let telling = twin
        .with_lengths(lengths(|sweep| 200 - sweep / 8 * 40))
        .unwrap();
    let found = check(&telling);
    let finding = found
        .iter()
        .find(|finding| finding.kind == TellingLengths)
        .unwrap();
    assert_eq!(finding.severity, Severity::Warning);
    assert!(
        finding.message.contains("100 % of the sweeps"),
        "{}",
        finding.message
    );
    let info = tactnet_data::info(&telling);
    let range = info.lengths.unwrap();
    assert_eq!(
        (range.shortest, range.median, range.longest),
        (120, 160, 200)
    );
    assert_eq!(info.materials[2].lengths.unwrap().longest, 120);
}
