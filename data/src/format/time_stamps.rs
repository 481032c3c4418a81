//! Values of time stamps: seconds and other units, Unix time, dates with a time, times of day.

use std::path::Path;

use super::frame_table::Column;
use super::stamp::{Stamp, stamp};
use super::time_names::{TimeColumns, time_columns};
use crate::{DataError, Finding, FindingKind, Place, Severity};

/// Unix times of 2001 and of 2106, in seconds. Numbers between them, in some unit, are probably Unix time.
const UNIX_TIME: std::ops::Range<f64> = 1e9..4.3e9;
/// Units in which Unix time is written: its length in seconds, and its name.
const UNIX_UNITS: [(f64, &str); 4] = [(1.0, "s"), (1e-3, "ms"), (1e-6, "µs"), (1e-9, "ns")];
/// Longest time between frames that is plausible, in seconds. Above it the numbers have another unit.
const LONGEST_INTERVAL: f64 = 60.0;
/// Maximum number of unreadable stamps that are listed.
const LISTED: usize = 1000;

/// Meaning of the stamps of a clock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Clockwork {
    /// Numbers of this unit, in seconds.
    Numbers(f64),
    /// Dates with a time; seconds count from 1970.
    Dates,
    /// Times of day; seconds count from midnight.
    TimesOfDay,
}

/// Time stamps of the frames of one file.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct TimeStamps {
    /// Seconds: `[frames]`.
    pub(super) seconds: Vec<f64>,
    pub(super) clockwork: Clockwork,
    /// Unit of the last digit of all stamps, in seconds; 0 if their numbers of digits differ or are not known.
    pub(super) resolution: f64,
    /// Note about a unit that was recognised by the size of the numbers.
    pub(super) finding: Option<Finding>,
}

/// Returns the time stamps of a file; `None` if no column has the name of a time.
///
/// - `lines`: lines of the frames in a text file, from 1; empty for other files
///
/// # Errors
/// Stamps that cannot be read, each with its place; numbers whose unit is not known.
pub(super) fn time_stamps(
    path: &Path,
    lines: &[usize],
    columns: &[(String, Column)],
) -> Result<Option<TimeStamps>, DataError> {
    let names: Vec<&str> = columns.iter().map(|(name, _)| name.as_str()).collect();
    let digit = |at: usize| last_digit(&columns[at].1);
    let read = |at: usize| {
        let (name, column) = &columns[at];
        stamps(column).map_err(|unreadable| refused(path, lines, name, &unreadable))
    };
    let Some(found) = time_columns(&names) else {
        return Ok(None);
    };
    let (column, unit) = match found {
        TimeColumns::One { column, unit } => (column, unit),
        TimeColumns::DateAndTime { date, time } => {
            let mut times = in_unit(path, names[time], read(time)?, None, digit(time))?;
            if times.clockwork == Clockwork::TimesOfDay
                && let Ok(dates) = stamps(&columns[date].1)
                && let Some(Stamp::Date(_)) = dates.first()
            {
                let sum = |(time, date): (&f64, &Stamp)| time + date.seconds();
                times.seconds = times.seconds.iter().zip(&dates).map(sum).collect();
                times.clockwork = Clockwork::Dates;
            }
            return Ok(Some(times));
        }
        TimeColumns::Parts { whole, rest, unit } => {
            let (wholes, rests) = (read(whole)?, read(rest)?);
            if rests.iter().all(|rest| rest.seconds().abs() * unit <= 1.0) {
                let sum = |(whole, rest): (&Stamp, &Stamp)| whole.seconds() + unit * rest.seconds();
                return Ok(Some(TimeStamps {
                    seconds: wholes.iter().zip(&rests).map(sum).collect(),
                    clockwork: Clockwork::Numbers(1.0),
                    resolution: 0.0,
                    finding: None,
                }));
            }
            // The same time in two units.
            (rest, Some(unit))
        }
    };
    in_unit(path, names[column], read(column)?, unit, digit(column)).map(Some)
}

/// Returns the times in the recording's clock, for example the ends of intervals.
///
/// # Errors
/// Times of another kind than the clock's; those that cannot be read.
pub(super) fn times_of(
    path: &Path,
    lines: &[usize],
    name: &str,
    column: &Column,
    clockwork: Clockwork,
) -> Result<Vec<f64>, DataError> {
    let stamps = stamps(column).map_err(|unreadable| refused(path, lines, name, &unreadable))?;
    let unit = super::time_names::unit_of(name);
    let seconds = |stamp: &Stamp| match (stamp, clockwork) {
        (Stamp::Number(value), Clockwork::Numbers(of_clock)) => {
            Some(value * unit.unwrap_or(of_clock))
        }
        (Stamp::Date(seconds), Clockwork::Dates) => Some(*seconds),
        (Stamp::TimeOfDay(seconds), Clockwork::TimesOfDay) => Some(*seconds),
        _ => None,
    };
    let found: Option<Vec<f64>> = stamps.iter().map(seconds).collect();
    found.ok_or_else(|| {
        let expected = match clockwork {
            Clockwork::Numbers(_) => "numbers, as the times of the recording",
            Clockwork::Dates => "dates with a time, as the times of the recording",
            Clockwork::TimesOfDay => "times of day, as the times of the recording",
        };
        DataError::format(path, format!("column `{name}`"), expected, kind_of(&stamps))
    })
}

fn kind_of(stamps: &[Stamp]) -> &'static str {
    match stamps.first() {
        Some(Stamp::Number(_)) => "numbers",
        Some(Stamp::Date(_)) => "dates",
        Some(Stamp::TimeOfDay(_)) => "times of day",
        None => "nothing",
    }
}

/// Converts stamps to seconds.
///
/// - `unit`: unit of numbers, if the name of the column has one
/// - `digit`: unit of the last digit, before conversion to seconds; 0 if not known
fn in_unit(
    path: &Path,
    name: &str,
    stamps: Vec<Stamp>,
    unit: Option<f64>,
    digit: f64,
) -> Result<TimeStamps, DataError> {
    let mut seconds: Vec<f64> = stamps.iter().map(|stamp| stamp.seconds()).collect();
    let clockwork = match (stamps.first(), unit) {
        (Some(Stamp::Date(_)), _) => Clockwork::Dates,
        (Some(Stamp::TimeOfDay(_)), _) => Clockwork::TimesOfDay,
        (_, Some(unit)) => Clockwork::Numbers(unit),
        (_, None) => Clockwork::Numbers(unit_by_size(path, name, &seconds)?),
    };
    let mut finding = None;
    let mut resolution = digit;
    if let Clockwork::Numbers(used) = clockwork {
        seconds.iter_mut().for_each(|value| *value *= used);
        resolution *= used;
        if unit.is_none() && used != 1.0 {
            let of_unit = UNIX_UNITS.iter().find(|(unit, _)| *unit == used);
            let message = format!(
                "column `{name}`: read as Unix time in {}, by the size of its numbers; the name `{name}_{}` says so",
                of_unit.map_or("", |(_, name)| name),
                of_unit.map_or("", |(_, name)| name).replace('µ', "u"),
            );
            let at = Place {
                column: Some(name.into()),
                ..Place::default()
            };
            finding = Some(Finding::new(Severity::Note, FindingKind::AssumedUnit, message).at(at));
        }
    }
    Ok(TimeStamps {
        seconds,
        clockwork,
        resolution,
        finding,
    })
}

/// Returns the unit of the last digit of all stamps; 0 if their numbers of digits differ, as if they were computed.
fn last_digit(column: &Column) -> f64 {
    let Column::Words(words) = column else {
        return 0.0;
    };
    let digits = |word: &String| match word.trim().rsplit_once(['.', ',']) {
        None => 0,
        Some((_, fraction)) => fraction.bytes().take_while(u8::is_ascii_digit).count(),
    };
    match words.split_first() {
        Some((first, others)) if others.iter().all(|other| digits(other) == digits(first)) => {
            0.1_f64.powi(digits(first) as i32)
        }
        _ => 0.0,
    }
}

/// Returns the unit of numbers without one, in seconds: that of Unix time, otherwise seconds.
fn unit_by_size(path: &Path, name: &str, numbers: &[f64]) -> Result<f64, DataError> {
    let largest = numbers
        .iter()
        .fold(0.0_f64, |largest, value| largest.max(*value));
    let mut intervals: Vec<f64> = numbers
        .array_windows()
        .map(|[a, b]| b - a)
        .filter(|d| *d > 0.0)
        .collect();
    intervals.sort_unstable_by(f64::total_cmp);
    let interval = intervals.get(intervals.len() / 2).copied().unwrap_or(0.0);
    let plausible = |unit: f64| interval * unit <= LONGEST_INTERVAL;
    let unix = UNIX_UNITS
        .iter()
        .find(|(unit, _)| UNIX_TIME.contains(&(largest * unit)) && plausible(*unit));
    match unix {
        Some((unit, _)) => Ok(*unit),
        None if plausible(1.0) => Ok(1.0),
        None => Err(DataError::format(
            path,
            format!("column `{name}`"),
            format!(
                "times in seconds, or the unit in the name: `{name}_ms`, `{name}_us` or `{name}_ns`"
            ),
            format!("{interval} between frames and no unit"),
        )),
    }
}

/// Returns the stamps of a column, all of one kind.
///
/// # Errors
/// Frames whose stamp cannot be read, with the text.
fn stamps(column: &Column) -> Result<Vec<Stamp>, Vec<(usize, String)>> {
    let mut unreadable = Vec::new();
    let stamps: Vec<Stamp> = match column {
        Column::Numbers(numbers) => {
            for (frame, number) in numbers.iter().enumerate().filter(|(_, n)| !n.is_finite()) {
                unreadable.push((frame, number.to_string()));
            }
            numbers.iter().copied().map(Stamp::Number).collect()
        }
        Column::Words(words) => {
            let mut stamps: Vec<Stamp> = Vec::with_capacity(words.len());
            for (frame, word) in words.iter().enumerate() {
                match stamp(word) {
                    Some(stamp)
                        if stamps.first().is_none_or(|first| {
                            std::mem::discriminant(first) == std::mem::discriminant(&stamp)
                        }) =>
                    {
                        stamps.push(stamp);
                    }
                    _ => unreadable.push((frame, word.clone())),
                }
            }
            stamps
        }
    };
    if unreadable.is_empty() {
        Ok(stamps)
    } else {
        Err(unreadable)
    }
}

fn refused(path: &Path, lines: &[usize], name: &str, unreadable: &[(usize, String)]) -> DataError {
    let finding = |(frame, text): &(usize, String)| {
        let place = match lines.get(*frame) {
            Some(line) => format!("line {line}"),
            None => format!("row {}", frame + 1),
        };
        let found = if text.trim().is_empty() {
            "nothing".into()
        } else {
            format!("`{text}`")
        };
        let message = format!(
            "{place}, column `{name}`: expected a time (a number such as 12.34, or a date such as 2024-05-31T12:00:01.25Z), found {found}; \
             write it so, or rename the column if it is not a time"
        );
        Finding::new(Severity::Error, FindingKind::Unreadable, message).at(Place {
            file: Some(path.into()),
            line: lines.get(*frame).copied(),
            column: Some(name.into()),
            ..Place::default()
        })
    };
    DataError::Unreadable {
        path: path.into(),
        findings: unreadable.iter().take(LISTED).map(finding).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(name: &str, cells: &[&str]) -> Result<TimeStamps, DataError> {
        let column = Column::Words(cells.iter().map(|cell| cell.to_string()).collect());
        let lines: Vec<usize> = (2..2 + cells.len()).collect();
        time_stamps(Path::new("a.csv"), &lines, &[(name.into(), column)]).map(Option::unwrap)
    }

    #[test]
    fn unix_time_is_recognised_by_its_size() {
        for (cells, unit) in [
            (["1717156800.00", "1717156800.01"], 1.0),
            (["1717156800000", "1717156800010"], 1e-3),
            (["1717156800000000", "1717156800010000"], 1e-6),
            (["1717156800000000000", "1717156800010000000"], 1e-9),
        ] {
            let found = read("timestamp", &cells).unwrap();
            assert!(
                (found.seconds[1] - found.seconds[0] - 0.01).abs() < 1e-6,
                "{found:?}"
            );
            assert_eq!(found.clockwork, Clockwork::Numbers(unit));
            assert_eq!(found.finding.is_some(), unit != 1.0);
        }
        // The unit of the name counts, and a clock since the start of a machine is not Unix time.
        assert_eq!(
            read("t_us", &["1717156800000", "1717156800010"])
                .unwrap()
                .clockwork,
            Clockwork::Numbers(1e-6)
        );
        let refused = read("timestamp", &["120000000000000", "120000010000000"])
            .unwrap_err()
            .to_string();
        assert!(
            refused
                .contains("column `timestamp`: expected times in seconds, or the unit in the name"),
            "{refused}"
        );
        assert_eq!(read("time", &["0", "1"]).unwrap().seconds, [0.0, 1.0]);
    }

    #[test]
    fn every_unreadable_stamp_has_its_line() {
        let error = read("Zeit [ms]", &["1", "", "2024-05-31T12:00:00Z", "4"]).unwrap_err();
        let findings = error.findings();
        let lines: Vec<_> = findings.iter().map(|finding| finding.at.line).collect();
        assert_eq!(lines, [Some(3), Some(4)]);
        assert!(
            findings[0]
                .message
                .starts_with("line 3, column `Zeit [ms]`: expected a time"),
            "{findings:?}"
        );
    }

    #[test]
    fn a_date_column_continues_a_time_of_day_after_midnight() {
        let words = |cells: [&str; 2]| Column::Words(cells.map(str::to_string).into());
        let columns = [
            ("date".into(), words(["2024-05-31", "2024-06-01"])),
            ("time".into(), words(["23:59:59.5", "00:00:00.0"])),
        ];
        let found = time_stamps(Path::new("a"), &[], &columns).unwrap().unwrap();
        assert_eq!(found.seconds[1] - found.seconds[0], 0.5);
        let parts = [
            ("sec".into(), Column::Numbers(vec![1.7e9, 1.7e9 + 1.0])),
            ("nanosec".into(), Column::Numbers(vec![9e8, 1e8])),
        ];
        let found = time_stamps(Path::new("a"), &[], &parts).unwrap().unwrap();
        assert!((found.seconds[1] - found.seconds[0] - 0.2).abs() < 1e-6);
    }
}
