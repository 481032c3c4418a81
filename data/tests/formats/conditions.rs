//! Tests of `speed` and `force`, numbers per sweep, in all formats.

use std::path::Path;

use tactnet_data::format::{self, Format, ReadOptions};
use tactnet_data::{
    Condition, ConditionValues, Dataset, FindingKind, LabelSet, Quantity, Samples, SweepRecord,
    SweepShape,
};

use crate::f32_bytes;
use crate::hostile::{archive, npy};
use crate::tables::write;
use crate::written::is_same;

/// Returns six sweeps of two materials, not in the order of the materials, without conditions.
fn bare() -> Dataset {
    let shape = SweepShape {
        steps: 3,
        rows: 2,
        cols: 2,
    };
    let record = |index: usize| SweepRecord {
        block: Some((index / 2) as u32),
        ..SweepRecord::new(index % 2, index / 2)
    };
    let labels = LabelSet::new(["cork", "denim"]).unwrap();
    let digits = (0..6 * 12).map(|i| (i * i % 251) as u8).collect();
    let records = (0..6).map(record).collect();
    Dataset::new("t", 10.0, shape, labels, records, Samples::U8(digits)).unwrap()
}

fn of(name: &str, values: &[f32]) -> ConditionValues {
    ConditionValues {
        condition: Condition::of_name(name).unwrap(),
        values: values.to_vec(),
    }
}

#[test]
fn conditions_survive_npz_and_hdf5_with_their_units_and_sweeps() {
    let dir = tempfile::tempdir().unwrap();
    let speed = of("speed [mm/s]", &[30.0, 20.0, 31.0, 21.0, 32.0, 22.0]);
    let force = of("force", &[0.5, 1.5, 2.5, 3.5, 4.5, 5.5]);
    for (conditions, element) in [
        (vec![speed.clone()], "u8"),
        (vec![speed.clone(), force.clone()], "f32"),
    ] {
        let known = bare().with_conditions(&conditions).unwrap();
        assert_eq!(known.samples().element(), element);
        assert_ne!(known.sha256(), bare().sha256());
        let archive = dir.path().join("a.npz");
        Format::Npz.write(&archive, &known).unwrap();
        let read = format::read(&archive).unwrap();
        assert_eq!(read.taxel_shape(), bare().shape());
        assert_eq!(read.condition_values().len(), conditions.len());
        assert!(
            conditions
                .iter()
                .all(|of| read.condition_values().contains(of))
        );
        assert!(is_same(&read.without_conditions(), &bare()));

        // HDF5 is in the order of the materials.
        let file = dir.path().join("a.h5");
        Format::TactMat.write(&file, &known).unwrap();
        let read = format::read(&file).unwrap();
        let sorted = [30.0, 31.0, 32.0, 20.0, 21.0, 22.0];
        assert!(
            read.condition_values()
                .contains(&of("speed [mm/s]", &sorted))
        );
        let last = read.sweep(5);
        assert_eq!(last[..4], bare().sweep(5)[..4]);
        assert_eq!(last[4], 22.0);
    }
}

#[test]
fn derived_data_sets_keep_the_conditions_of_their_sweeps() {
    let speed = of("speed", &[30.0, 20.0, 31.0, 21.0, 32.0, 22.0]);
    let known = bare()
        .with_conditions(std::slice::from_ref(&speed))
        .unwrap();
    let of_denim = known.of_materials(&[1]).unwrap();
    assert_eq!(
        of_denim.condition_values(),
        [of("speed", &[20.0, 21.0, 22.0])]
    );
    let short = known.clone().first_steps(2).unwrap();
    assert_eq!(short.condition_values(), std::slice::from_ref(&speed));
    let wide = known.clone().with_patch(1, 4).unwrap();
    assert_eq!((wide.taxel_shape().rows, wide.shape().cols), (1, 5));
    assert_eq!(
        known.clone().with_patch(2, 2).unwrap().sha256(),
        known.sha256()
    );
    let timed = known.clone().with_sample_rate(20.0).unwrap();
    assert_eq!(timed.condition_values(), std::slice::from_ref(&speed));
    assert!(known.with_conditions(&[speed]).is_err());
    assert!(bare().with_conditions(&[of("force", &[1.0; 5])]).is_err());
    assert!(
        bare()
            .with_conditions(&[of("force", &[f32::NAN; 6])])
            .is_err()
    );
}

/// Returns a table of four sweeps of three frames.
///
/// - `taxels`: names of the taxels
/// - `speed`: speed of a sweep in a frame
fn table(taxels: &[&str], speed: impl Fn(usize, usize) -> String) -> String {
    let mut text = format!("sweep,material,Speed [mm/s],{}\n", taxels.join(","));
    for sweep in 0..4 {
        for step in 0..3 {
            let values = (0..taxels.len()).map(|t| ((7 * sweep + 3 * step + t) % 10).to_string());
            let values: Vec<String> = values.collect();
            let material = ["cork", "denim"][sweep % 2];
            let (speed, values) = (speed(sweep, step), values.join(","));
            text += &format!("{sweep},{material},{speed},{values}\n");
        }
    }
    text
}

fn read(path: &Path, text: &str) -> Dataset {
    write(path, text);
    format::read(path).unwrap()
}

#[test]
fn a_column_of_that_name_is_a_condition_if_it_is_constant_in_every_sweep() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.csv");
    let numbered = ["t0", "t1", "t2", "t3"];
    for taxels in [&["left", "right"][..], &numbered] {
        let known = read(
            &path,
            &table(taxels, |sweep, _| format!("{}.5", 10 + sweep)),
        );
        assert_eq!(
            known.condition_values(),
            [of("speed [mm/s]", &[10.5, 11.5, 12.5, 13.5])]
        );
        assert_eq!(known.taxel_shape().taxels(), taxels.len());
        assert!(
            !known
                .reading_findings()
                .iter()
                .any(|of| of.message.contains("Speed"))
        );
    }
    let changing = |_, step: usize| step.to_string();
    let taxel = read(&path, &table(&["left", "right"], changing));
    assert_eq!((taxel.conditions().len(), taxel.shape().taxels()), (0, 3));
    let unread = read(&path, &table(&numbered, changing));
    assert_eq!((unread.conditions().len(), unread.shape().taxels()), (0, 4));
    let words = read(&path, &table(&numbered, |_, _| "slow".into()));
    for dataset in [unread, words] {
        let mut findings = dataset.reading_findings().iter();
        assert!(findings.any(|of| of.kind == FindingKind::NotRead && of.message.contains("Speed")));
    }
    // A column that is named as a taxel is one.
    let options = ReadOptions {
        columns: vec!["left".into(), "Speed [mm/s]".into()],
        ..ReadOptions::default()
    };
    write(
        &path,
        &table(&["left", "right"], |sweep, _| sweep.to_string()),
    );
    let named = format::read_with(&path, &options).unwrap();
    assert_eq!((named.conditions().len(), named.shape().taxels()), (0, 2));
}

#[test]
fn folders_name_conditions_in_their_files_or_in_the_table_of_labels() {
    let dir = tempfile::tempdir().unwrap();
    let sweep = |force: &dyn Fn(usize) -> usize, at: usize| -> String {
        let rows = (0..3).map(|step| format!("{},{},{}\n", at + step, 9 - step, force(step)));
        format!("a,b,force\n{}", rows.collect::<String>())
    };
    let files = dir.path().join("files");
    for (at, place) in ["cork/a", "cork/b", "denim/a", "denim/b"]
        .iter()
        .enumerate()
    {
        write(&files.join(format!("{place}.csv")), &sweep(&|_| 5 + at, at));
    }
    let known = format::read(&files).unwrap();
    assert_eq!(
        known.condition_values(),
        [of("force", &[5.0, 6.0, 7.0, 8.0])]
    );
    assert_eq!(known.taxel_shape().taxels(), 2);
    // One file with a changing force makes it a taxel of all.
    write(&files.join("denim/b.csv"), &sweep(&|step| step, 3));
    let taxels = format::read(&files).unwrap();
    assert_eq!((taxels.conditions().len(), taxels.shape().taxels()), (0, 3));

    let listed = dir.path().join("listed");
    let mut labels = String::from("file,material,speed [m/s]\n");
    for (at, material) in ["cork", "denim", "cork", "denim"].iter().enumerate() {
        write(
            &listed.join(format!("{at}.csv")),
            &format!("a,b\n{at},1\n2,5\n"),
        );
        labels += &format!("{at}.csv,{material},0.{at}\n");
    }
    write(&listed.join("labels.csv"), &labels);
    let known = format::read(&listed).unwrap();
    assert_eq!(
        known.condition_values(),
        [of("speed [m/s]", &[0.0, 0.1, 0.2, 0.3])]
    );
    assert_eq!(known.conditions()[0].quantity, Quantity::Speed);
}

#[test]
fn an_array_of_that_name_that_is_not_one_number_per_sweep_is_ignored_as_others_are() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.npz");
    let digits: Vec<u8> = (0..6 * 12).map(|i| (i * i % 251) as u8).collect();
    let labels = npy("|u1", "6", &[0, 1, 0, 1, 0, 1]);
    for (shape, numbers, is_condition) in [("6", 6, true), ("6, 1", 6, true), ("6, 3", 18, false)] {
        let speed = f32_bytes((0..numbers).map(|value| value as f32));
        let members = [
            ("X", npy("|u1", "6, 3, 4", &digits)),
            ("y", labels.clone()),
            ("speed", npy("<f4", shape, &speed)),
        ];
        archive(&path, &members);
        let read = format::read(&path).unwrap();
        assert_eq!(
            read.conditions().len(),
            usize::from(is_condition),
            "{shape}"
        );
        let mut findings = read.reading_findings().iter();
        let is_ignored = findings.any(|of| of.message.contains("`speed`"));
        assert_eq!(is_ignored, !is_condition, "{shape}");
    }
}
