//! One time stamp as text: a number, a date or a time of day.

use jiff::Timestamp;
use jiff::civil::{Date, DateTime};
use jiff::tz::Offset;

/// Value of a time stamp.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Stamp {
    Number(f64),
    /// Seconds since 1970.
    Date(f64),
    /// Seconds since midnight.
    TimeOfDay(f64),
}

impl Stamp {
    pub(super) fn seconds(self) -> f64 {
        match self {
            Self::Number(value) | Self::Date(value) | Self::TimeOfDay(value) => value,
        }
    }
}

/// Reads one stamp; `None` for other text.
pub(super) fn stamp(text: &str) -> Option<Stamp> {
    let text = text.trim();
    if let Ok(number) = text.parse::<f64>() {
        return number.is_finite().then_some(Stamp::Number(number));
    }
    if !text.starts_with(|c: char| c.is_ascii_digit() || "+-.,".contains(c)) {
        return None;
    }
    if !text.contains([':', '/'])
        && text.matches(',').count() == 1
        && let Ok(number) = text.replace(',', ".").parse::<f64>()
    {
        return Some(Stamp::Number(number));
    }
    time_of_day(text)
        .map(Stamp::TimeOfDay)
        .or_else(|| date(text).map(Stamp::Date))
}

/// Returns the seconds since 1970 of a date, with or without a time and a zone; without a zone it counts as UTC.
fn date(text: &str) -> Option<f64> {
    let (text, utc) = match text
        .strip_suffix("UTC")
        .or_else(|| text.strip_suffix("GMT"))
    {
        Some(text) => (text.trim_end(), true),
        None => (text, false),
    };
    // A blank before the offset is usual, but not in the standard.
    let text = match text.rsplit_once(' ') {
        Some((time, offset)) if offset.starts_with(['+', '-', 'Z']) => format!("{time}{offset}"),
        _ => text.to_string(),
    };
    let since_1970 = |at: Timestamp| at.as_duration().as_secs_f64();
    let of_civil = |at: DateTime| Some(since_1970(Offset::UTC.to_timestamp(at).ok()?));
    if !utc && let Ok(at) = text.parse::<Timestamp>() {
        return Some(since_1970(at));
    }
    // `DateTime` ignores an offset, which would be wrong by hours.
    let has_zone = text
        .get(10..)
        .is_some_and(|time| time.contains(['+', '-', 'Z', 'z', '[']));
    if has_zone {
        return None;
    }
    if let Ok(at) = text.parse::<DateTime>() {
        return of_civil(at);
    }
    // `31.05.2024 12:00:01`, as spreadsheets of many countries write it.
    let (day, time) = text.split_once([' ', 'T']).unwrap_or((&text, "00:00:00"));
    let mut parts = day.split('.').map(|part| part.parse::<i16>().ok());
    let (Some(Some(day)), Some(Some(month)), Some(Some(year)), None) =
        (parts.next(), parts.next(), parts.next(), parts.next())
    else {
        return None;
    };
    let midnight = Date::new(year, month.try_into().ok()?, day.try_into().ok()?).ok()?;
    Some(of_civil(midnight.to_datetime(jiff::civil::Time::midnight()))? + time_of_day(time)?)
}

/// Returns the seconds of `hours:minutes:seconds`, or of `minutes:seconds` with a fraction; hours may exceed a day.
fn time_of_day(text: &str) -> Option<f64> {
    let text = text.replace(',', ".");
    let parts: Vec<&str> = text.split(':').collect();
    let whole = |part: &str| part.parse::<u32>().ok().map(f64::from);
    let seconds: f64 = parts
        .last()?
        .parse()
        .ok()
        .filter(|seconds| (0.0..61.0).contains(seconds))?;
    match parts[..] {
        [hours, minutes, _] => {
            Some(3600.0 * whole(hours)? + 60.0 * whole(minutes).filter(|m| *m < 60.0)? + seconds)
        }
        [minutes, last] if last.contains('.') => Some(60.0 * whole(minutes)? + seconds),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_and_times_are_seconds() {
        let noon = 1_717_156_800.0;
        for (text, expected) in [
            ("12.5", Some(Stamp::Number(12.5))),
            (" 0,25 ", Some(Stamp::Number(0.25))),
            ("-1e-3", Some(Stamp::Number(-0.001))),
            ("2024-05-31T12:00:00Z", Some(Stamp::Date(noon))),
            ("2024-05-31 12:00:00.25", Some(Stamp::Date(noon + 0.25))),
            ("2024-05-31T12:00:00,250", Some(Stamp::Date(noon + 0.25))),
            ("2024-05-31T14:00:00+02:00", Some(Stamp::Date(noon))),
            ("2024-05-31 14:00:00 +0200", Some(Stamp::Date(noon))),
            ("2024-05-31 12:00:00 UTC", Some(Stamp::Date(noon))),
            (
                "2024-05-31T14:00:00+02:00[Europe/Berlin]",
                Some(Stamp::Date(noon)),
            ),
            ("2024-05-31", Some(Stamp::Date(noon - 43200.0))),
            ("31.05.2024 12:00:00,5", Some(Stamp::Date(noon + 0.5))),
            ("1:00:02.5", Some(Stamp::TimeOfDay(3602.5))),
            ("25:00:00", Some(Stamp::TimeOfDay(90000.0))),
            ("01:02.5", Some(Stamp::TimeOfDay(62.5))),
            ("12:30", None),
            ("05/31/2024 12:00:00", None),
            ("2024-13-31T12:00:00", None),
            ("nan", None),
            ("inf", None),
            ("", None),
            ("noon", None),
        ] {
            assert_eq!(stamp(text), expected, "{text}");
        }
    }
}
