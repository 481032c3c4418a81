//! Recognition of columns of time stamps by their names.
//!
//! A name is split into words: `Zeit [ms]` is `zeit`, `ms`; `header.stamp.nanosec` is `header`, `stamp`, `nanosec`. It
//! belongs to a column of time stamps if all words are about time and one of them means it.

use super::named_sweeps::some_names;
use crate::Finding;

/// Words that name a time, in the languages of spreadsheets that were seen.
const TIME: &[&str] = &[
    "time",
    "times",
    "t",
    "ts",
    "timestamp",
    "timestamps",
    "stamp",
    "datetime",
    "epoch",
    "unixtime",
    "zeit",
    "zeitpunkt",
    "zeitstempel",
    "uhrzeit",
    "temps",
    "horodatage",
    "tiempo",
    "tempo",
    "tijd",
    "tid",
    "czas",
    "aika",
    "время",
    "时间",
    "時間",
    "時刻",
    "시간",
];
/// Words that say more about a time.
const ABOUT: &[&str] = &[
    "abs",
    "absolute",
    "arrival",
    "capture",
    "clock",
    "date",
    "device",
    "elapsed",
    "field",
    "frame",
    "gmt",
    "header",
    "host",
    "local",
    "log",
    "monotonic",
    "msg",
    "receive",
    "received",
    "recording",
    "rel",
    "relative",
    "ros",
    "rosbag",
    "sample",
    "sensor",
    "since",
    "start",
    "sys",
    "system",
    "tv",
    "unix",
    "utc",
    "wall",
];
/// Units of time, with their length in seconds.
const UNITS: &[(f64, &[&str])] = &[
    (60.0, &["min", "minutes", "minuten"]),
    (
        1.0,
        &[
            "s", "sec", "secs", "second", "seconds", "sek", "sekunden", "secondes", "segundos",
        ],
    ),
    (
        1e-3,
        &[
            "ms",
            "msec",
            "msecs",
            "millis",
            "milliseconds",
            "millisekunden",
            "millisecondes",
        ],
    ),
    (
        1e-6,
        &[
            "us",
            "usec",
            "usecs",
            "micros",
            "microseconds",
            "mikrosekunden",
        ],
    ),
    (
        1e-9,
        &[
            "ns",
            "nsec",
            "nsecs",
            "nanos",
            "nanosec",
            "nanosecs",
            "nanoseconds",
        ],
    ),
];
/// Words that name a column of time stamps on their own; `s` and `min` may be something else.
const SHORT: &[&str] = &["s", "min"];
/// Words for the whole seconds of a time stamp in two columns.
const WHOLE: &[&str] = &["sec", "secs", "seconds"];
/// Words for the rest of a time stamp in two columns, with their unit in seconds.
const REST: &[(f64, &[&str])] = &[
    (
        1e-9,
        &[
            "nanosec",
            "nanosecs",
            "nanoseconds",
            "nsec",
            "nsecs",
            "nanos",
        ],
    ),
    (1e-6, &["usec", "usecs", "microseconds", "micros"]),
];
/// Names of a column of dates next to a column of times of day.
const DATE: &[&str] = &["date", "datum", "fecha"];

/// Columns that hold the times of the frames.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum TimeColumns {
    /// One column.
    One {
        column: usize,
        /// Unit in seconds, if the name has one.
        unit: Option<f64>,
    },
    /// Whole seconds, and the rest in another unit.
    Parts {
        whole: usize,
        rest: usize,
        unit: f64,
    },
    /// Date, and time of day.
    DateAndTime { date: usize, time: usize },
}

impl TimeColumns {
    /// Returns the columns, one or two.
    fn used(self) -> Vec<usize> {
        match self {
            Self::One { column, .. } => vec![column],
            Self::Parts { whole, rest, .. } => vec![whole, rest],
            Self::DateAndTime { date, time } => vec![date, time],
        }
    }
}

/// Returns true for each column that holds times: the used ones and others.
pub(super) fn are_times(names: &[&str]) -> Vec<bool> {
    let mut times: Vec<bool> = names.iter().map(|name| is_time(name)).collect();
    for column in time_columns(names)
        .iter()
        .flat_map(|columns| columns.used())
    {
        times[column] = true;
    }
    times
}

/// Returns a note about columns of times beside those that are used.
pub(super) fn unused_times(names: &[&str]) -> Option<Finding> {
    let used = time_columns(names)?.used();
    let is_unused = |at: &usize| is_time(names[*at]) && !used.contains(at);
    let unused: Vec<&str> = (0..names.len())
        .filter(is_unused)
        .map(|at| names[at])
        .collect();
    let of = some_names(used.iter().map(|at| names[*at]));
    (!unused.is_empty()).then(|| {
        let message = format!(
            "{}: not read, since {of} gives the times of the frames",
            some_names(unused)
        );
        Finding::not_read(message)
    })
}

/// Returns true for the name of a column with time stamps, or with a part of them.
pub(super) fn is_time(name: &str) -> bool {
    stamp_unit(name).is_some() || is_date(name)
}

fn is_date(name: &str) -> bool {
    DATE.contains(&words(name).join(" ").as_str())
}

/// Returns the columns that hold the times of the frames: whole seconds with a rest before a single column, the first of
/// several.
pub(super) fn time_columns(names: &[&str]) -> Option<TimeColumns> {
    if let Some(parts) = parts(names) {
        return Some(parts);
    }
    let time = names.iter().position(|name| stamp_unit(name).is_some());
    let date = names.iter().position(|name| is_date(name));
    Some(match (date, time) {
        (Some(date), Some(time)) => TimeColumns::DateAndTime { date, time },
        (None, Some(column)) => TimeColumns::One {
            column,
            unit: stamp_unit(names[column])?,
        },
        (Some(column), None) => TimeColumns::One { column, unit: None },
        (None, None) => return None,
    })
}

fn parts(names: &[&str]) -> Option<TimeColumns> {
    let split = |name: &str| {
        let mut words = words(name);
        let last = words.pop()?;
        Some((words, last))
    };
    let places = || {
        names
            .iter()
            .enumerate()
            .filter_map(|(at, name)| Some((at, split(name)?)))
    };
    for (whole, (before, last)) in places() {
        if !WHOLE.contains(&last.as_str()) || !before.iter().all(|word| is_about_time(word)) {
            continue;
        }
        for (rest, (same, last)) in places() {
            let unit = REST
                .iter()
                .find(|(_, words)| words.contains(&last.as_str()));
            if let Some(&(unit, _)) = unit.filter(|_| same == before) {
                return Some(TimeColumns::Parts { whole, rest, unit });
            }
        }
    }
    None
}

/// Returns the unit of a column of time stamps in seconds, if the name has one; `None` for the name of another column.
fn stamp_unit(name: &str) -> Option<Option<f64>> {
    let mut words = words(name);
    let unit = words.last().and_then(|word| unit_of_word(word));
    if unit.is_some() && words.len() > 1 {
        words.pop();
    } else if unit.is_some() {
        return (!SHORT.contains(&words[0].as_str())).then_some(unit);
    }
    let named = words.iter().any(|word| TIME.contains(&word.as_str()));
    let only = words.iter().all(|word| is_about_time(word));
    (named && only).then_some(unit)
}

/// Returns the unit at the end of any name, in seconds.
pub(super) fn unit_of(name: &str) -> Option<f64> {
    let words = words(name);
    unit_of_word(words.last()?)
}

fn unit_of_word(word: &str) -> Option<f64> {
    let of_word = UNITS.iter().find(|(_, names)| names.contains(&word));
    of_word.map(|(unit, _)| *unit)
}

fn is_about_time(word: &str) -> bool {
    TIME.contains(&word) || ABOUT.contains(&word)
}

/// Splits a name at signs, blanks and capital letters within words, in lower case.
fn words(name: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let mut before_is_lower = false;
    for c in name.trim().chars() {
        if !c.is_alphanumeric() || (before_is_lower && c.is_uppercase()) {
            words.push(String::new());
        }
        if c.is_alphanumeric() {
            // Both signs for micro.
            let plain = if c == 'µ' || c == 'μ' { 'u' } else { c };
            if let Some(word) = words.last_mut() {
                word.extend(plain.to_lowercase());
            }
        }
        before_is_lower = c.is_lowercase();
    }
    words.retain(|word| !word.is_empty());
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_times_have_units() {
        for (name, unit) in [
            ("time", None),
            (" T ", None),
            ("Zeit", None),
            ("Temps", None),
            ("tiempo", None),
            ("%time", None),
            ("field.header.stamp", None),
            ("rosbagTimestamp", None),
            ("Time Stamp", None),
            ("Zeit [ms]", Some(1e-3)),
            ("t_ms", Some(1e-3)),
            ("Time (µs)", Some(1e-6)),
            ("Recording timestamp [μs]", Some(1e-6)),
            ("time/ns", Some(1e-9)),
            ("timeMs", Some(1e-3)),
            ("millis", Some(1e-3)),
            ("seconds", Some(1.0)),
        ] {
            let found = time_columns(&["force", name]);
            assert_eq!(found, Some(TimeColumns::One { column: 1, unit }), "{name}");
        }
    }

    #[test]
    fn taxels_are_no_times() {
        for name in [
            "t0",
            "t_1",
            "time1",
            "s",
            "min",
            "step",
            "stamp force",
            "t0_ms",
            "contact_time",
            "tide",
            "",
        ] {
            assert!(!is_time(name), "{name}");
        }
    }

    #[test]
    fn a_stamp_may_have_two_columns() {
        let parts = |names: &[&str]| match time_columns(names) {
            Some(TimeColumns::Parts { whole, rest, unit }) => Some((whole, rest, unit)),
            _ => None,
        };
        assert_eq!(parts(&["sec", "nanosec", "a"]), Some((0, 1, 1e-9)));
        assert_eq!(
            parts(&["a", "header.stamp.nsecs", "header.stamp.secs"]),
            Some((2, 1, 1e-9))
        );
        assert_eq!(parts(&["time", "tv_sec", "tv_usec"]), Some((1, 2, 1e-6)));
        assert_eq!(parts(&["start.sec", "stamp.nanosec"]), None);
        assert_eq!(
            time_columns(&["Date", "x", "Time"]),
            Some(TimeColumns::DateAndTime { date: 0, time: 2 })
        );
    }
}
