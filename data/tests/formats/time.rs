//! Tests of time stamps: rates of loggers that round, buffer, delay and lose frames.

use std::path::Path;

use tactnet_data::format::{self, ReadOptions};
use tactnet_data::{Dataset, Finding, FindingKind, Severity, check};

use crate::tables::write;

/// Time stamps of a sweep as texts, one for each frame.
type Stamps = Vec<String>;

/// Returns reproducible numbers from 0 to 1.
fn random(seed: u64) -> impl FnMut() -> f64 {
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
fn read(column: &str, sweeps: &[Stamps]) -> Dataset {
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
fn kinds(dataset: &Dataset) -> Vec<(Severity, FindingKind)> {
    let mut kinds: Vec<_> = dataset
        .reading_findings()
        .iter()
        .map(|f| (f.severity, f.kind))
        .collect();
    kinds.dedup();
    kinds
}

fn of_kind(dataset: &Dataset, kind: FindingKind) -> Vec<Finding> {
    check(dataset)
        .into_iter()
        .filter(|finding| finding.kind == kind)
        .collect()
}

/// Returns stamps of even frames, written with three digits.
fn rounded(frames: usize, rate: f64) -> Stamps {
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
fn all_sweeps_of_another_rate_are_named() {
    for (rate, other) in [(500.0, 250.0), (100.0, 103.0), (100.0, 1000.0)] {
        let sweeps: Vec<Stamps> = (0..12)
            .map(|sweep| {
                let rate = if sweep % 3 == 1 { other } else { rate };
                (0..150)
                    .map(|frame| format!("{:.6}", f64::from(frame) / rate))
                    .collect()
            })
            .collect();
        let dataset = read("time", &sweeps);
        assert_eq!(dataset.sample_rate_hz(), rate);
        let odd = of_kind(&dataset, FindingKind::MixedRates);
        let places: Vec<_> = odd
            .iter()
            .map(|finding| finding.at.sweep.unwrap())
            .collect();
        assert_eq!(places, [1, 4, 7, 10]);
        assert!(
            odd.iter()
                .all(|finding| finding.severity == Severity::Error)
        );
        let expected = format!(
            "sweep `s1`: {other} Hz, other than the {rate} Hz of most recordings, by the time stamps"
        );
        assert_eq!(odd[0].message, expected);
    }
    // A difference of a per cent is the clocks'.
    let near: Vec<Stamps> = [100.0, 101.0, 100.0].map(|rate| rounded(200, rate)).into();
    assert_eq!(of_kind(&read("time", &near), FindingKind::MixedRates), []);
}

#[test]
fn gaps_have_a_place_and_a_length() {
    // Rate, frame after the gap, length of the gap in seconds, severity.
    for (rate, at, gap, severity) in [
        (100.0, 50, 3600.0, Severity::Error),
        (100.0, 120, 0.5, Severity::Error),
        (100.0, 30, 0.1, Severity::Warning),
        (750.0, 7, 60.0, Severity::Error),
        (20.0, 100, 1.7e9, Severity::Error),
    ] {
        let plain = || -> Stamps {
            (0..300)
                .map(|frame| format!("{:.5}", f64::from(frame) / rate))
                .collect()
        };
        let with_gap = (0..300).map(|frame| {
            format!(
                "{:.5}",
                f64::from(frame) / rate + if frame >= at { gap } else { 0.0 }
            )
        });
        let dataset = read("time", &[plain(), with_gap.collect(), plain()]);
        assert_eq!(dataset.sample_rate_hz(), rate, "{gap}");
        let found = of_kind(&dataset, FindingKind::TimeGap);
        assert_eq!(found.len(), 1, "{rate} {gap}");
        assert_eq!(found[0].severity, severity, "{gap}");
        assert_eq!(
            (found[0].at.sweep, found[0].at.step),
            (Some(1), Some(at as usize))
        );
        // The line of names and the first sweep come before it.
        assert_eq!(found[0].at.line, Some(302 + at as usize));
        assert_eq!(
            found[0].message.contains("the clock was set"),
            gap > 1e9,
            "{}",
            found[0].message
        );
        assert_eq!(kinds(&dataset).len(), 1, "{:?}", kinds(&dataset));
    }
}

#[test]
fn lost_frames_are_counted() {
    for (rate, share, severity) in [
        (100.0, 0.25, Severity::Error),
        (100.0, 0.01, Severity::Warning),
        (750.0, 0.25, Severity::Error),
        (138.8, 0.1, Severity::Error),
    ] {
        let mut random = random(11);
        let mut lost = Vec::new();
        let mut sweeps = Vec::new();
        for _ in 0..4 {
            let kept: Vec<usize> = (0..900)
                .filter(|frame| *frame == 0 || random() >= share)
                .take(600)
                .collect();
            lost.push(kept[kept.len() - 1] + 1 - kept.len());
            sweeps.push(
                kept.iter()
                    .map(|frame| format!("{:.6}", *frame as f64 / rate))
                    .collect(),
            );
        }
        let dataset = read("time", &sweeps);
        assert!(
            (dataset.sample_rate_hz() / rate - 1.0).abs() < 1e-3,
            "{}",
            dataset.sample_rate_hz()
        );
        let found = of_kind(&dataset, FindingKind::LostFrames);
        assert_eq!(found.len(), 4, "{rate} {share}");
        for (finding, lost) in found.iter().zip(lost) {
            assert_eq!(finding.severity, severity);
            let of = format!("{lost} of {} frames are missing", 600 + lost);
            assert!(finding.message.contains(&of), "{}", finding.message);
        }
    }
}

/// Frames that are lost regularly look like rounded stamps, except for the digits of the stamps.
#[test]
fn frames_that_are_lost_regularly_are_counted() {
    let stamps = |rate: f64, every: usize, digits: Option<usize>| -> Stamps {
        let kept = (0..800).filter(|frame| frame % every != every - 1);
        kept.map(|frame| match digits {
            Some(digits) => format!("{:.digits$}", frame as f64 / rate),
            None => (frame as f64 / rate).to_string(),
        })
        .collect()
    };
    for (rate, every, digits) in [
        (100.0, 4, None),
        (100.0, 4, Some(3)),
        (200.0, 4, None),
        (200.0, 3, Some(4)),
        (50.0, 3, None),
        (750.0, 4, Some(6)),
    ] {
        let sweeps = [stamps(rate, every, digits), stamps(rate, every, digits)];
        let dataset = read("time", &sweeps);
        assert!(
            (dataset.sample_rate_hz() / rate - 1.0).abs() < 1e-3,
            "{rate} {every}: {}",
            dataset.sample_rate_hz()
        );
        let found = of_kind(&dataset, FindingKind::LostFrames);
        assert_eq!(found.len(), 2, "{rate} {every}");
        assert_eq!(found[0].severity, Severity::Error);
    }
    // The same intervals as of 100 Hz without every fourth frame, but hundredths of a second are the last digit.
    for rate in [75.0, 80.0, 90.0] {
        let sweep: Stamps = (0..800)
            .map(|frame| format!("{:.2}", f64::from(frame) / rate))
            .collect();
        assert_eq!(read("time", &[sweep.clone(), sweep]).sample_rate_hz(), rate);
    }
}

#[test]
fn late_frames_are_neither_lost_nor_a_gap() {
    // Once a second, seven frames wait for 70 ms and come at once.
    let stamps = |frame: usize| match frame % 100 {
        phase @ 40..47 => (frame - phase + 46) as f64 / 100.0 + 1e-3 * (phase - 40) as f64,
        _ => frame as f64 / 100.0,
    };
    let sweep: Stamps = (0..600)
        .map(|frame| format!("{:.5}", stamps(frame)))
        .collect();
    let dataset = read("time", &[sweep.clone(), sweep]);
    assert!(
        (dataset.sample_rate_hz() - 100.0).abs() < 0.2,
        "{}",
        dataset.sample_rate_hz()
    );
    assert_eq!(kinds(&dataset), []);
}

#[test]
fn a_clock_that_goes_backwards_is_an_error_that_can_be_read() {
    for (at, back) in [(5, 0.03), (60, 3600.0)] {
        let sweep = |back: f64| -> Stamps {
            (0..100)
                .map(|frame| {
                    format!(
                        "{:.3}",
                        5000.0 + f64::from(frame) / 100.0 - if frame >= at { back } else { 0.0 }
                    )
                })
                .collect()
        };
        let sweeps = [sweep(0.0), sweep(back)];
        let dataset = read("time", &sweeps);
        assert_eq!(dataset.sample_rate_hz(), 100.0);
        let found = of_kind(&dataset, FindingKind::ClockBackwards);
        assert_eq!(found.len(), 1);
        assert_eq!(
            (found[0].severity, found[0].at.line),
            (Severity::Error, Some(102 + at as usize))
        );
        assert!(
            found[0]
                .message
                .contains("sweep `s1`: the time goes back from"),
            "{}",
            found[0].message
        );
        let named = dataset.with_named_rate(Some(100.0)).unwrap();
        assert_eq!(named.sample_rate_hz(), 100.0);
    }
}

#[test]
fn stamps_have_many_forms() {
    let rate = 100.0;
    let time = |frame: u64| (1_717_156_800 + frame / 100, frame % 100 * 10);
    let forms: [(&str, &dyn Fn(u64) -> String); 11] = [
        ("time", &|frame| {
            let (s, ms) = time(frame);
            format!("{s}.{ms:03}")
        }),
        ("timestamp", &|frame| {
            let (s, ms) = time(frame);
            format!("{s}{ms:03}")
        }),
        ("timestamp", &|frame| {
            let (s, ms) = time(frame);
            format!("{s}{ms:03}000")
        }),
        ("header.stamp", &|frame| {
            let (s, ms) = time(frame);
            format!("{s}{ms:03}000000")
        }),
        ("Zeit [ms]", &|frame| format!("{}", 10 * frame)),
        ("sec,nanosec", &|frame| {
            let (s, ms) = time(frame);
            format!("{s},{ms}000000")
        }),
        ("stamp.secs,stamp.nsecs", &|frame| {
            let (s, ms) = time(frame);
            format!("{s},{ms}000000")
        }),
        ("time", &|frame| {
            format!(
                "2024-05-31T12:{:02}:{:02}.{:03}Z",
                frame / 6000,
                frame / 100 % 60,
                frame % 100 * 10
            )
        }),
        ("Temps", &|frame| {
            format!(
                "2024-05-31 12:{:02}:{:02}.{:03}",
                frame / 6000,
                frame / 100 % 60,
                frame % 100 * 10
            )
        }),
        ("tiempo", &|frame| {
            format!(
                "2024-05-31T12:{:02}:{:02}.{:03}+02:00",
                frame / 6000,
                frame / 100 % 60,
                frame % 100 * 10
            )
        }),
        ("uhrzeit", &|frame| {
            format!(
                "23:{:02}:{:02}.{:03}",
                frame / 6000,
                frame / 100 % 60,
                frame % 100 * 10
            )
        }),
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
