//! Tests of windows that are cut from continuous recordings, and of resampling.

use std::path::PathBuf;

use proptest::prelude::*;
use tactnet_data::format::{self, Keep, ReadOptions, Span, Windows, npz};
use tactnet_data::{DataError, Dataset, FindingKind, Remedy, Severity, check};

use crate::tables::write;

/// Returns a table with a label in each frame; the value of a frame is its number.
fn stream(time: Option<f64>, runs: &[(&str, usize)]) -> String {
    let mut text = String::from("acc_x,acc_y,alt,label\n");
    if time.is_some() {
        text.insert_str(0, "time,");
    }
    let labels = runs
        .iter()
        .flat_map(|(label, frames)| std::iter::repeat_n(label, *frames));
    for (frame, label) in labels.enumerate() {
        if let Some(rate) = time {
            text.push_str(&format!("{},", frame as f64 / rate));
        }
        text.push_str(&format!("{frame},{}.5,high,{label}\n", frame % 7));
    }
    text
}

fn windows(length: Span, hop: Option<Span>) -> ReadOptions {
    ReadOptions {
        columns: vec!["acc_x".into(), "acc_y".into()],
        windows: Some(Windows {
            hop,
            ..Windows::of(length)
        }),
        ..ReadOptions::default()
    }
}

fn in_folder(text: &str) -> (tempfile::TempDir, PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("stream.csv");
    write(&path, text);
    (dir, path)
}

/// Returns material, block and first value of each window.
fn contents(dataset: &Dataset) -> Vec<(String, u32, f32)> {
    let of = |index: usize| {
        let record = &dataset.records()[index];
        (
            dataset.labels().name(record.label).to_string(),
            record.block.unwrap(),
            dataset.sweep(index)[0],
        )
    };
    (0..dataset.len()).map(of).collect()
}

#[test]
fn windows_end_where_the_label_changes() {
    let (_dir, path) = in_folder(&stream(
        Some(20.0),
        &[("none", 25), ("walk", 10), ("up", 9), ("walk", 30)],
    ));
    let dataset = format::read_with(&path, &windows(Span::Steps(10), None)).unwrap();
    let expected = [
        ("none", 0, 0.0),
        ("none", 0, 10.0),
        ("walk", 1, 25.0),
        ("walk", 2, 44.0),
        ("walk", 2, 54.0),
        ("walk", 2, 64.0),
    ];
    assert_eq!(
        contents(&dataset),
        expected.map(|(label, block, first)| (label.to_string(), block, first))
    );
    assert_eq!(dataset.sample_rate_hz(), 20.0);
    assert_eq!(dataset.shape().taxels(), 2);
    let note = &dataset.reading_findings()[0].message;
    assert_eq!(
        note,
        "6 windows of 10 steps, 10 steps apart, in 3 stretches of one label; 14 frames are in no window, 1 of the stretches are shorter"
    );

    // Half of a second, overlapping by half, without `none`.
    let mut options = windows(Span::Seconds(0.5), Some(Span::Seconds(0.25)));
    options.windows.as_mut().unwrap().drop_labels = vec!["none".into()];
    let dataset = format::read_with(&path, &options).unwrap();
    let firsts: Vec<f32> = contents(&dataset).iter().map(|window| window.2).collect();
    assert_eq!(firsts, [25.0, 44.0, 49.0, 54.0, 59.0, 64.0]);
    options.windows.as_mut().unwrap().drop_labels = vec!["nothing".into()];
    let refused = format::read_with(&path, &options).unwrap_err().to_string();
    assert!(
        refused.contains("expected `nothing`, to drop, found `none`, `up`, `walk`"),
        "{refused}"
    );
    let refused = format::read_with(&path, &windows(Span::Seconds(2.0), None))
        .unwrap_err()
        .to_string();
    assert!(
        refused.contains("at least 40 steps, the length of a window, found 30 steps"),
        "{refused}"
    );
}

#[test]
fn windows_end_at_gaps() {
    let text = stream(Some(100.0), &[("walk", 100)]);
    let moved = |line: (usize, &str)| match line {
        (at, line) if at > 55 => {
            let (time, rest) = line.split_once(',').unwrap();
            format!("{},{rest}\n", time.parse::<f64>().unwrap() + 60.0)
        }
        (_, line) => format!("{line}\n"),
    };
    let (_dir, path) = in_folder(&text.lines().enumerate().map(moved).collect::<String>());
    let dataset = format::read_with(&path, &windows(Span::Steps(20), None)).unwrap();
    let firsts: Vec<(u32, f32)> = contents(&dataset)
        .iter()
        .map(|window| (window.1, window.2))
        .collect();
    assert_eq!(firsts, [(0, 0.0), (0, 20.0), (1, 55.0), (1, 75.0)]);
    let gap = check(&dataset)
        .into_iter()
        .find(|finding| finding.kind == FindingKind::TimeGap)
        .unwrap();
    assert_eq!((gap.severity, gap.at.line), (Severity::Note, Some(57)));
    // Resampled frames do not bridge it either.
    let options = ReadOptions {
        resample_hz: Some(50.0),
        ..windows(Span::Steps(20), None)
    };
    let dataset = format::read_with(&path, &options).unwrap();
    let near: Vec<bool> = contents(&dataset)
        .iter()
        .zip([0.0, 55.0])
        .map(|(window, first)| (window.2 - first).abs() < 1e-3)
        .collect();
    assert_eq!((dataset.sample_rate_hz(), near), (50.0, vec![true, true]));
}

/// A split recording in two folds would be trained and tested on at once.
#[test]
fn the_parts_of_a_recording_with_a_gap_share_a_block_and_are_counted() {
    let dir = tempfile::tempdir().unwrap();
    for (material, recordings) in [("cork", 3), ("felt", 2)] {
        std::fs::create_dir(dir.path().join(material)).unwrap();
        for recording in 0..recordings {
            let mut text = String::from("time,a,b\n");
            for frame in 0..100 {
                // The first recording of each material stands still for a second after frame 39.
                let lost = if recording == 0 && frame >= 40 {
                    1.0
                } else {
                    0.0
                };
                let time = f64::from(frame) / 100.0 + lost;
                text.push_str(&format!(
                    "{time},{},{}\n",
                    frame * 7 % 13,
                    frame * recording
                ));
            }
            write(
                &dir.path().join(format!("{material}/{recording}.csv")),
                &text,
            );
        }
    }
    let options = ReadOptions {
        resample_hz: Some(50.0),
        keep: Keep::Shortest,
        ..ReadOptions::default()
    };
    let dataset = format::read_with(dir.path(), &options).unwrap();
    let blocks = |material: &str| -> Vec<u32> {
        let of_material = contents(&dataset)
            .into_iter()
            .filter(|found| found.0 == material);
        of_material.map(|(_, block, _)| block).collect()
    };
    assert_eq!(
        (blocks("cork"), blocks("felt")),
        (vec![0, 0, 1, 2], vec![3, 3, 4])
    );
    let said = "2 of 5 recordings have gaps and became 4 sweeps of 20 to 30 steps; the sweeps of one recording share a block";
    let findings = dataset.reading_findings();
    assert!(
        findings.iter().any(|finding| finding.message == said),
        "{findings:?}"
    );
}

#[test]
fn a_recording_without_a_sweep_column_names_the_cure() {
    let (_dir, path) = in_folder(&stream(None, &[("none", 25), ("walk", 10)]).replace("high", "1"));
    let error = format::read(&path).unwrap_err();
    assert_eq!(error.remedy(), Some(Remedy::CutWindows), "{error}");
    // Windows in seconds need a rate.
    let seconds = windows(Span::Seconds(0.5), None);
    let error = format::read_with(&path, &seconds).unwrap_err();
    assert_eq!(error.remedy(), Some(Remedy::NameRate), "{error}");
    let named = format::read_with(
        &path,
        &ReadOptions {
            rate_hz: Some(20.0),
            ..seconds.clone()
        },
    )
    .unwrap();
    assert_eq!(
        (named.len(), named.sample_rate_hz(), named.shape().steps),
        (3, 20.0, 10)
    );
    let typo = ReadOptions {
        columns: vec!["acc_z".into()],
        ..seconds
    };
    let refused = format::read_with(&path, &typo).unwrap_err().to_string();
    assert!(
        refused.contains(
            "expected a taxel `acc_z`, found `acc_x`, `acc_y`, `alt`; did you mean `acc_x`?"
        ),
        "{refused}"
    );
    let (_dir, path) = in_folder(&stream(None, &[("", 25), ("walk", 10)]));
    let error = format::read_with(&path, &windows(Span::Steps(5), None)).unwrap_err();
    assert_eq!(error.remedy(), Some(Remedy::DropUnlabelled), "{error}");
}

/// Recordings of 200 frames, with a table of intervals that label them.
struct Intervals {
    dir: tempfile::TempDir,
    table: PathBuf,
}

impl Intervals {
    fn new() -> Self {
        let dir = tempfile::tempdir().unwrap();
        let table = dir.path().join("intervals.csv");
        Self { dir, table }
    }

    /// Writes a recording whose values are the numbers of the frames.
    fn record(&self, name: &str, header: &str, stamp: impl Fn(usize) -> String) {
        let rows = (0..200).map(|frame| format!("{},{frame}\n", stamp(frame)));
        write(
            &self.dir.path().join(format!("in/{name}.csv")),
            &format!("{header},p\n{}", rows.collect::<String>()),
        );
    }

    fn read(&self, name: &str) -> Result<Vec<(String, u32, f32)>, DataError> {
        let options = ReadOptions {
            windows: Some(Windows {
                intervals: Some(self.table.clone()),
                ..Windows::of(Span::Steps(20))
            }),
            ..ReadOptions::default()
        };
        let dataset = format::read_with(&self.dir.path().join(name), &options)?;
        Ok(contents(&dataset))
    }
}

fn windows_of(found: &[(&str, u32, f32)]) -> Vec<(String, u32, f32)> {
    let owned = |(label, block, first): &(&str, u32, f32)| (label.to_string(), *block, *first);
    found.iter().map(owned).collect()
}

/// Returns a stamp of 100 Hz in seconds.
fn seconds(frame: usize) -> String {
    format!("{}", frame as f64 / 100.0)
}

#[test]
fn intervals_label_recordings_in_their_clock() {
    let intervals = Intervals::new();
    let expected = windows_of(&[("felt", 0, 50.0), ("cork", 1, 100.0), ("cork", 1, 120.0)]);
    // Seconds, milliseconds, Unix time in nanoseconds, dates.
    for (header, stamp, table) in [
        (
            "time",
            &seconds as &dyn Fn(usize) -> String,
            "start,end,label\n0.5,0.75,felt\n1,1.4,cork\n",
        ),
        (
            "t_ms",
            &|frame| format!("{}", 10 * frame),
            "start,end,label\n500,750,felt\n1000,1400,cork\n",
        ),
        (
            "t_ms",
            &|frame| format!("{}", 10 * frame),
            "start_s;end_s;label\n0.5;0.75;felt\n1;1.4;cork\n",
        ),
        (
            "stamp",
            &|frame| format!("17171568{:02}{:02}0000000", frame / 100, frame % 100),
            "start,end,material\n1717156800500000000,1717156800750000000,felt\n1717156801000000000,1717156801400000000,cork\n",
        ),
        (
            "time",
            &|frame| format!("2024-05-31 12:00:{:02}.{:02}", frame / 100, frame % 100),
            "start,end,label\n2024-05-31T12:00:00.5,2024-05-31T12:00:00.75,felt\n2024-05-31T12:00:01,2024-05-31T12:00:01.4,cork\n",
        ),
    ] {
        intervals.record("a", header, stamp);
        write(&intervals.table, table);
        let found = intervals.read("in/a.csv").unwrap();
        assert_eq!(found, expected, "{header} {table}");
    }
}

#[test]
fn a_column_of_a_table_of_intervals_names_the_recording() {
    let intervals = Intervals::new();
    intervals.record("a", "time", seconds);
    intervals.record("b", "time", seconds);
    write(
        &intervals.table,
        "file,start,end,label\nb.csv,0,0.25,felt\na,1,1.25,cork\n,1.5,1.75,foam\n",
    );
    let found = intervals.read("in").unwrap();
    assert_eq!(
        found,
        windows_of(&[
            ("cork", 0, 100.0),
            ("foam", 1, 150.0),
            ("felt", 2, 0.0),
            ("foam", 3, 150.0)
        ])
    );
}

#[test]
fn mistakes_in_a_table_of_intervals_are_named() {
    let intervals = Intervals::new();
    intervals.record("a", "time", seconds);
    for (table, complaint) in [
        (
            "start,end,label\n0,1,felt\n0.5,1.5,cork\n",
            "line 3: expected a start after the end of `felt`, 1 s (line 2), found 0.5",
        ),
        (
            "start,end,label\n1,1,felt\n",
            "line 2: expected an end after the start, 1 s, found 1",
        ),
        (
            "start,label\n1,felt\n",
            "expected the columns start, end, label",
        ),
        (
            "start,end,label\n5,6,felt\n",
            "expected times within the recordings, found none",
        ),
        (
            "start,end,label\n2024-05-31T12:00:00,2024-05-31T12:00:01,felt\n",
            "expected numbers, as the times of the recording, found dates",
        ),
    ] {
        write(&intervals.table, table);
        let refused = intervals.read("in/a.csv").unwrap_err().to_string();
        assert!(refused.contains(complaint), "{complaint}: {refused}");
    }
}

#[test]
fn arrays_are_cut_and_resampled_too() {
    let dir = tempfile::tempdir().unwrap();
    let twin = tactnet_data::twin::small(3, 2, 400).unwrap();
    let path = dir.path().join("twin.npz");
    npz::write(&path, &twin).unwrap();
    let options = ReadOptions {
        windows: Some(Windows::of(Span::Seconds(0.2))),
        ..ReadOptions::default()
    };
    let cut = format::read_with(&path, &options).unwrap();
    assert_eq!((cut.len(), cut.shape().steps), (12, 150));
    assert_eq!(cut.sweep(1), twin.sweep(0)[150 * 16..300 * 16]);
    assert_eq!((cut.origin(), cut.labels()), (twin.origin(), twin.labels()));
    let options = ReadOptions {
        resample_hz: Some(250.0),
        ..ReadOptions::default()
    };
    let slow = format::read_with(&path, &options).unwrap();
    assert_eq!(
        (slow.len(), slow.shape().steps, slow.sample_rate_hz()),
        (6, 134, 250.0)
    );
    let mad = ReadOptions {
        resample_hz: Some(1e9),
        ..ReadOptions::default()
    };
    assert!(format::read_with(&path, &mad).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn no_window_crosses_a_change_of_the_label(
        runs in prop::collection::vec((0usize..3, 1usize..40), 1..12),
        length in 1usize..30,
        hop in 1usize..30,
    ) {
        let names = ["a", "b", "c"];
        let named: Vec<(&str, usize)> = runs.iter().map(|(label, frames)| (names[*label], *frames)).collect();
        let (_dir, path) = in_folder(&stream(None, &named));
        let labels: Vec<&str> = named.iter().flat_map(|(label, frames)| std::iter::repeat_n(*label, *frames)).collect();
        let mut expected = 0;
        let mut start = 0;
        for end in 1..=labels.len() {
            if end == labels.len() || labels[end] != labels[start] {
                let frames = end - start;
                expected += if frames < length { 0 } else { (frames - length) / hop + 1 };
                start = end;
            }
        }
        match format::read_with(&path, &windows(Span::Steps(length), Some(Span::Steps(hop)))) {
            Err(_) => prop_assert_eq!(expected, 0),
            Ok(dataset) => {
                prop_assert_eq!(dataset.len(), expected);
                for (label, _, first) in contents(&dataset) {
                    let first = first as usize;
                    prop_assert!(labels[first..first + length].iter().all(|other| *other == label));
                }
            }
        }
    }
}
