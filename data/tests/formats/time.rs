//! Tests of time stamps: their forms, and rates of loggers that round, buffer and delay frames.

use std::path::Path;

use tactnet_data::format::{self, ReadOptions};
use tactnet_data::{Dataset, Finding, FindingKind, Severity, check};

use crate::tables::write;

/// Time stamps of a sweep as texts, one for each frame.
pub(crate) type Stamps = Vec<String>;

/// Returns reproducible numbers from 0 to 1.
pub(crate) fn random(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// Returns a table of sweeps with these stamps; materials alternate, values are noise.
fn table(column: &str, sweeps: &[Stamps]) -> String {
    let mut noise = random(7);
    let mut text = format!("sweep,material,{column},a,b\n");
    for (sweep, stamps) in sweeps.iter().enumerate() {
        let material = ["cork", "felt"][sweep % 2];
        for stamp in stamps {
            text.push_str(&format!(
                "s{sweep},{material},{stamp},{},{}\n",
                noise(),
                noise()
            ));
        }
    }
    text
}

/// Writes the same sweeps as a table and as a folder of files, reads both and compares them.
pub(crate) fn read(column: &str, sweeps: &[Stamps]) -> Dataset {
    let dir = tempfile::tempdir().unwrap();
    let one = dir.path().join("frames.csv");
    write(&one, &table(column, sweeps));
    let folder = dir.path().join("folder");
    let mut noise = random(7);
    for (sweep, stamps) in sweeps.iter().enumerate() {
        let rows: Vec<String> = stamps
            .iter()
            .map(|stamp| format!("{stamp};{};{}", noise(), noise()))
            .collect();
        let text = format!(
            "{};a;b\n{}\n",
            column.replace(',', ";"),
            rows.join("\n").replace(',', ";")
        );
        write(
            &folder.join(format!("{}/s{sweep}.csv", ["cork", "felt"][sweep % 2])),
            &text,
        );
    }
    let read = |path: &Path| format::read(path).unwrap();
    let (table, folder) = (read(&one), read(&folder));
    assert!(
        (table.sample_rate_hz() - folder.sample_rate_hz()).abs() < 1e-9 * table.sample_rate_hz()
    );
    assert_eq!(kinds(&table), kinds(&folder));
    table
}

/// Returns severities and kinds of the findings about time, without repetitions.
pub(crate) fn kinds(dataset: &Dataset) -> Vec<(Severity, FindingKind)> {
    let mut kinds: Vec<_> = dataset
        .reading_findings()
        .iter()
        .map(|f| (f.severity, f.kind))
        .collect();
    kinds.dedup();
    kinds
}

pub(crate) fn of_kind(dataset: &Dataset, kind: FindingKind) -> Vec<Finding> {
    check(dataset)
        .into_iter()
        .filter(|finding| finding.kind == kind)
        .collect()
}

/// Returns stamps of even frames, written with three digits.
pub(crate) fn rounded(frames: usize, rate: f64) -> Stamps {
    (0..frames)
        .map(|frame| format!("{:.3}", frame as f64 / rate))
        .collect()
}

#[test]
fn rounded_stamps_give_the_true_rate() {
    // Rate in Hz, digits of a second, and if mean and median differ by more than 5 %.
    for (rate, digits, irregular) in [
        (750.0, 3, true),
        (400.0, 3, true),
        (60.0, 2, true),
        (300.0, 3, true),
        (1000.0, 3, false),
        (100.0, 2, false),
        (48.0, 2, false),
        (6000.0, 4, true),
    ] {
        for frames in [200, 700] {
            let stamps = |offset: f64| -> Stamps {
                (0..frames)
                    .map(|frame| format!("{:.digits$}", offset + f64::from(frame) / rate))
                    .collect()
            };
            let dataset = read(
                "time",
                &[stamps(0.0), stamps(3.1), stamps(17.7), stamps(1.7e9)],
            );
            let found = dataset.sample_rate_hz();
            assert!(
                (found / rate - 1.0).abs() < 2e-3,
                "{rate} Hz, {digits} digits: {found}"
            );
            let expected = irregular.then_some((Severity::Warning, FindingKind::IrregularRate));
            assert_eq!(kinds(&dataset), Vec::from_iter(expected), "{rate}");
        }
    }
}

#[test]
fn bursts_are_no_fault_and_give_the_true_rate() {
    // Frames of a burst, time between the frames of a burst in seconds.
    for (burst, within) in [(10, 1e-4), (10, 0.0), (4, 0.0), (32, 1e-5), (64, 0.0)] {
        let stamps = |frames: usize| -> Stamps {
            let stamp = |frame: usize| {
                (frame / burst * burst) as f64 / 200.0 + (frame % burst) as f64 * within
            };
            (0..frames)
                .map(|frame| format!("{:.6}", stamp(frame)))
                .collect()
        };
        let dataset = read("t", &[stamps(1000), stamps(1000), stamps(1000)]);
        let found = dataset.sample_rate_hz();
        assert!(
            (found / 200.0 - 1.0).abs() < 0.01,
            "bursts of {burst}: {found}"
        );
        assert_eq!(
            kinds(&dataset),
            [(Severity::Warning, FindingKind::IrregularRate)],
            "{burst}"
        );
    }
}

#[test]
fn stamps_that_jitter_give_the_true_rate() {
    let mut random = random(3);
    // Delays up to twice the period, as on a network; the sensor's own clock is exact.
    let mut stamps = |rate: f64, jitter: f64| -> Stamps {
        let mut last = 0.0_f64;
        (0..600)
            .map(|frame| {
                last = last.max(f64::from(frame) / rate + jitter * random() / rate);
                format!("{:.9}", 1.7e9 + last)
            })
            .collect()
    };
    for (rate, jitter) in [(138.8, 2.0), (138.8, 0.7), (93.4, 1.5)] {
        let sweeps = [
            stamps(rate, jitter),
            stamps(rate, jitter),
            stamps(rate, jitter),
        ];
        let dataset = read("timestamp", &sweeps);
        assert!(
            (dataset.sample_rate_hz() / rate - 1.0).abs() < 2e-3,
            "{}",
            dataset.sample_rate_hz()
        );
        let errors = dataset
            .reading_findings()
            .iter()
            .filter(|f| f.severity == Severity::Error);
        assert_eq!(errors.count(), 0);
    }
}

/// Intervals of a busy computer: each has its own length, and none makes up for another.
#[test]
fn independent_intervals_give_frames_by_duration() {
    let mut random = random(5);
    for rate in [138.8, 90.0] {
        let mut sweep = || -> Stamps {
            let intervals: Vec<f64> = (0..199).map(|_| -random().ln()).collect();
            let unit = 199.0 / rate / intervals.iter().sum::<f64>();
            let mut time = 0.0;
            let mut stamps = vec!["0".to_string()];
            for interval in intervals {
                time += unit * interval;
                stamps.push(format!("{time:.9}"));
            }
            stamps
        };
        let sweeps: Vec<Stamps> = (0..24).map(|_| sweep()).collect();
        let dataset = read("time", &sweeps);
        let found = dataset.sample_rate_hz();
        assert!((found / rate - 1.0).abs() < 1e-3, "{rate}: {found}");
        let irregular = (Severity::Warning, FindingKind::IrregularRate);
        assert_eq!(kinds(&dataset), [irregular], "{rate}");
    }
}

#[test]
fn a_named_rate_takes_precedence_with_a_warning() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("frames.csv");
    write(
        &path,
        &table("time", &[rounded(100, 250.0), rounded(100, 250.0)]),
    );
    let named = |rate: f64| {
        let options = ReadOptions {
            rate_hz: Some(rate),
            ..ReadOptions::default()
        };
        format::read_with(&path, &options).unwrap()
    };
    let other = named(100.0);
    assert_eq!(
        (other.sample_rate_hz(), other.is_rate_assumed()),
        (100.0, false)
    );
    let warned = of_kind(&other, FindingKind::NamedRate);
    assert_eq!(
        warned[0].message,
        "the time stamps give 250 Hz; the named 100 Hz takes precedence"
    );
    assert_eq!(of_kind(&named(250.1), FindingKind::NamedRate), []);
    let equal = dir.path().join("equal.csv");
    write(
        &equal,
        &table("time", &[vec!["3".into(); 50], vec!["4".into(); 50]]),
    );
    let refused = format::read(&equal).unwrap_err().to_string();
    assert!(
        refused.contains("found equal times in all frames"),
        "{refused}"
    );
    let options = ReadOptions {
        rate_hz: Some(50.0),
        ..ReadOptions::default()
    };
    assert_eq!(
        format::read_with(&equal, &options)
            .unwrap()
            .sample_rate_hz(),
        50.0
    );
}

#[test]
fn stamps_have_many_forms() {
    let rate = 100.0;
    let time = |frame: u64| (1_717_156_800 + frame / 100, frame % 100 * 10);
    let clock = |frame: u64| {
        let (minutes, seconds, ms) = (frame / 6000, frame / 100 % 60, frame % 100 * 10);
        format!("{minutes:02}:{seconds:02}.{ms:03}")
    };
    let unix = |point: &'static str, digits: &'static str| {
        move |frame| {
            let (s, ms) = time(frame);
            format!("{s}{point}{ms:03}{digits}")
        }
    };
    let pair = |frame| {
        let (s, ms) = time(frame);
        format!("{s},{ms}000000")
    };
    let forms: [(&str, &dyn Fn(u64) -> String); 11] = [
        ("time", &unix(".", "")),
        ("timestamp", &unix("", "")),
        ("timestamp", &unix("", "000")),
        ("header.stamp", &unix("", "000000")),
        ("Zeit [ms]", &|frame| format!("{}", 10 * frame)),
        ("sec,nanosec", &pair),
        ("stamp.secs,stamp.nsecs", &pair),
        ("time", &|frame| format!("2024-05-31T12:{}Z", clock(frame))),
        ("Temps", &|frame| format!("2024-05-31 12:{}", clock(frame))),
        ("tiempo", &|frame| {
            format!("2024-05-31T12:{}+02:00", clock(frame))
        }),
        ("uhrzeit", &|frame| format!("23:{}", clock(frame))),
    ];
    for (column, stamp) in forms {
        let sweep: Stamps = (0..250).map(stamp).collect();
        let dataset = read(column, &[sweep.clone(), sweep]);
        assert!(
            (dataset.sample_rate_hz() - rate).abs() < 1e-9,
            "{column}: {}",
            dataset.sample_rate_hz()
        );
        assert_eq!(dataset.shape().taxels(), 2, "{column}");
        let only_notes = dataset
            .reading_findings()
            .iter()
            .all(|f| f.kind == FindingKind::AssumedUnit);
        assert!(only_notes, "{column}: {:?}", kinds(&dataset));
    }
}

#[test]
fn stamps_that_cannot_be_read_name_column_line_and_cure() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("frames.csv");
    let stamps: Stamps = ["0.0", "soon", "0.2", "", "0.4"].map(str::to_string).into();
    write(&path, &table("Temps", &[stamps]));
    let findings = format::read(&path).unwrap_err().findings();
    let places: Vec<_> = findings
        .iter()
        .map(|finding| (finding.at.line, finding.at.column.as_deref()))
        .collect();
    assert_eq!(places, [(Some(3), Some("Temps")), (Some(5), Some("Temps"))]);
    assert!(
        findings[0]
            .message
            .contains("found `soon`; write it so, or rename the column"),
        "{}",
        findings[0].message
    );
    write(
        &path,
        &table(
            "time",
            &[["05/31/2024 12:00", "05/31/2024 12:01"]
                .map(str::to_string)
                .into()],
        ),
    );
    assert!(
        format::read(&path)
            .unwrap_err()
            .to_string()
            .contains("2024-05-31T12:00:01.25Z")
    );
}
