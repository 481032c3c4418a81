//! Dialects of text tables: encoding, separator, decimal mark, lines before the table.

use super::taxel_names::is_line_of_names;

/// Number of lines that show the dialect.
const SHOWN: usize = 60;
/// Separators in order of preference, where several fit equally well.
const SEPARATORS: [char; 5] = [';', '\t', '|', ',', ' '];
/// Beginnings of comment lines.
const COMMENTS: [&str; 3] = ["#", "%", "//"];
/// Longest unit in a line of units, in characters.
const LONGEST_UNIT: usize = 12;

/// Text of a table with its dialect.
pub(super) struct Table {
    /// The text, in UTF-8; a table with blanks as separator has tabs in their place.
    pub(super) text: String,
    /// Separator of the cells.
    pub(super) separator: u8,
    /// Start of the table in the text, in bytes.
    pub(super) start: usize,
    /// First byte of comment lines within the table.
    pub(super) comment: u8,
    /// Names of the columns from a comment before the table, as NumPy writes them.
    pub(super) names: Option<Vec<String>>,
    /// Units of the columns, from a line after that of the names.
    pub(super) units: Option<Vec<String>>,
    /// Number of cells in most rows.
    pub(super) cells: usize,
    /// Number of lines before the table that are neither comments nor empty.
    pub(super) preamble: usize,
}

/// Returns the text of a file: UTF-8, UTF-16 with a byte order mark, or Latin-1.
///
/// # Errors
/// Bytes that are not text in one of these encodings.
pub(super) fn decode(bytes: Vec<u8>) -> Result<String, &'static str> {
    let wide = |bytes: &[u8], of: fn([u8; 2]) -> u16| {
        let (units, _) = bytes.as_chunks();
        let units: Vec<u16> = units.iter().map(|unit| of(*unit)).collect();
        String::from_utf16(&units).map_err(|_| "bytes that are no text, after a mark of UTF-16")
    };
    match bytes.as_slice() {
        [0xff, 0xfe, rest @ ..] => return wide(rest, u16::from_le_bytes),
        [0xfe, 0xff, rest @ ..] => return wide(rest, u16::from_be_bytes),
        _ => {}
    }
    if bytes.contains(&0) {
        return Err("bytes that are no text");
    }
    Ok(match String::from_utf8(bytes) {
        Ok(text) => match text.strip_prefix('\u{feff}') {
            Some(rest) => rest.into(),
            None => text,
        },
        Err(error) => error
            .as_bytes()
            .iter()
            .map(|byte| char::from(*byte))
            .collect(),
    })
}

/// Returns the place of the line of names, or else of the first line of values.
fn first_line(content: &[&(usize, &str)], separator: char, cells: usize) -> usize {
    let of_line = |(_, line): &&(usize, &str)| split(line, separator).len();
    // A line of names may lack the separator that ends all other lines.
    let first = content
        .iter()
        .position(|line| of_line(line) == cells)
        .unwrap_or(0);
    let ends_empty = |line: &str| {
        split(line, separator)
            .last()
            .is_some_and(|cell| cell.trim().is_empty())
    };
    match first.checked_sub(1) {
        Some(before) if of_line(&content[before]) + 1 == cells && ends_empty(content[first].1) => {
            before
        }
        _ => first,
    }
}

impl Table {
    /// Finds the dialect of a text.
    ///
    /// # Errors
    /// A description of a text whose commas may separate numbers or belong to them.
    pub(super) fn of(text: String) -> Result<Self, String> {
        let lines = shown_lines(&text);
        let content: Vec<&(usize, &str)> =
            lines.iter().filter(|(_, line)| !is_comment(line)).collect();
        let Some((separator, cells)) = separator(&content) else {
            let start = content.first().map_or(text.len(), |(start, _)| *start);
            return Ok(Self::single(text, start));
        };
        if separator == ',' && cells == 2 && is_ambiguous(&content) {
            return Err(format!(
                "lines such as `{}`, which are one number with a decimal comma or two numbers; name the columns in a first line",
                content[0].1.trim()
            ));
        }
        let first = first_line(&content, separator, cells);
        let start = content[first].0;
        let row = |place: usize| content.get(place).map(|(_, line)| split(line, separator));
        let names = if row(first).is_some_and(|row| !is_line_of_names(&row)) {
            let before = lines
                .iter()
                .rev()
                .find(|(at, line)| *at < start && is_comment(line));
            before.and_then(|(_, line)| comment_names(line, separator, cells))
        } else {
            None
        };
        let units = match (row(first), row(first + 1), row(first + 2)) {
            (Some(head), Some(units), Some(values)) if is_line_of_names(&head) => {
                are_units(&units, &values).then_some(units)
            }
            _ => None,
        };
        let table = Self {
            separator: if separator == ' ' {
                b'\t'
            } else {
                separator as u8
            },
            start,
            comment: comment_byte(&lines),
            names,
            units,
            cells,
            preamble: first,
            text: String::new(),
        };
        Ok(if separator == ' ' {
            let lines = text[start..].split_inclusive('\n').map(with_tabs);
            Self {
                text: text[..start].to_owned() + &lines.collect::<String>(),
                ..table
            }
        } else {
            Self { text, ..table }
        })
    }

    /// Returns a table of one column.
    fn single(text: String, start: usize) -> Self {
        Self {
            text,
            separator: b',',
            start,
            comment: b'#',
            names: None,
            units: None,
            cells: 1,
            preamble: 0,
        }
    }
}

/// Replaces runs of blanks by tabs; blanks at the ends are removed.
fn with_tabs(line: &str) -> String {
    let end = &line[line.trim_end_matches(['\r', '\n']).len()..];
    line.split_whitespace().collect::<Vec<_>>().join("\t") + end
}

/// Returns the first lines that are not empty, each with its place in bytes.
fn shown_lines(text: &str) -> Vec<(usize, &str)> {
    let mut start = 0;
    let lines = text.split(['\n', '\r']).map(|line| {
        let place = start;
        start += line.len() + 1;
        (place, line)
    });
    // Excel writes the separator into a first line.
    let is_shown = |(_, line): &(usize, &str)| {
        let line = line.trim();
        !line.is_empty() && (line.len() > 5 || !line.starts_with("sep="))
    };
    lines.filter(is_shown).take(SHOWN).collect()
}

fn is_comment(line: &str) -> bool {
    COMMENTS
        .iter()
        .any(|mark| line.trim_start().starts_with(mark))
}

fn comment_byte(lines: &[(usize, &str)]) -> u8 {
    let is_percent = |(_, line): &(usize, &str)| line.trim_start().starts_with('%');
    if lines.iter().any(is_percent) {
        b'%'
    } else {
        b'#'
    }
}

/// Returns the separator of most lines and the number of cells; `None` for lines of one cell.
fn separator(lines: &[&(usize, &str)]) -> Option<(char, usize)> {
    let mut best: Option<(f64, char, usize)> = None;
    for separator in SEPARATORS {
        let rows: Vec<Vec<String>> = lines
            .iter()
            .map(|(_, line)| split(line, separator))
            .collect();
        let with = |cells: usize| rows.iter().filter(move |row| row.len() == cells);
        let lengths = rows.iter().map(Vec::len).filter(|cells| *cells > 1);
        let Some(cells) = lengths.max_by_key(|cells| (with(*cells).count(), *cells)) else {
            continue;
        };
        let shown: Vec<&String> = with(cells).flatten().collect();
        let numbers = shown.iter().filter(|cell| number(cell).is_some()).count();
        let score =
            with(cells).count() as f64 / rows.len() as f64 + numbers as f64 / shown.len() as f64;
        if best.is_none_or(|(found, _, _)| score > found + 1e-9) {
            best = Some((score, separator, cells));
        }
    }
    best.map(|(_, separator, cells)| (separator, cells))
}

/// Returns true for lines `60,476` without names whose second parts all have the same number of digits.
fn is_ambiguous(lines: &[&(usize, &str)]) -> bool {
    let digits = |part: &str| !part.is_empty() && part.bytes().all(|byte| byte.is_ascii_digit());
    let parts: Option<Vec<(&str, &str)>> = lines
        .iter()
        .map(|(_, line)| {
            let (whole, rest) = line.trim().split_once(',')?;
            (digits(whole.trim_start_matches('-')) && digits(rest)).then_some((whole, rest))
        })
        .collect();
    parts.is_some_and(|parts| {
        let length = parts[0].1.len();
        length > 1 && parts.iter().all(|(_, rest)| rest.len() == length)
    })
}

/// Returns the names in a comment such as `# t0,t1`, if there is one for every column.
fn comment_names(line: &str, separator: char, cells: usize) -> Option<Vec<String>> {
    let line = line.trim_start().trim_start_matches(['#', '%', '/']);
    let names: Vec<String> = split(line, separator)
        .iter()
        .map(|name| clean(name).to_owned())
        .collect();
    (names.len() == cells && names.iter().all(|name| number(name).is_none())).then_some(names)
}

/// Returns true for a line of units between a line of names and the first numbers.
fn are_units(units: &[String], values: &[String]) -> bool {
    let short = |cell: &String| {
        cell.chars().count() <= LONGEST_UNIT && (cell.trim().is_empty() || number(cell).is_none())
    };
    let any_unit = units.iter().any(|cell| !cell.trim().is_empty());
    let numbers = values.iter().filter(|cell| number(cell).is_some()).count();
    any_unit && units.iter().all(short) && 2 * numbers >= values.len()
}

/// Returns the cells of a line; a separator in quotes belongs to its cell.
pub(super) fn split(line: &str, separator: char) -> Vec<String> {
    if separator == ' ' {
        return line.split_whitespace().map(Into::into).collect();
    }
    let (mut cells, mut quoted) = (vec![String::new()], false);
    for letter in line.chars() {
        if letter == '"' {
            quoted = !quoted;
        } else if letter == separator && !quoted {
            cells.push(String::new());
            continue;
        }
        if let Some(last) = cells.last_mut() {
            last.push(letter);
        }
    }
    cells
}

/// Returns a cell without blanks and quotes around it.
pub(super) fn clean(cell: &str) -> &str {
    let cell = cell.trim();
    match cell
        .strip_prefix('"')
        .and_then(|rest| rest.strip_suffix('"'))
    {
        Some(inner) => inner.trim(),
        None => cell,
    }
}

/// Words for a value that is missing.
const MISSING: [&str; 7] = ["", "na", "n/a", "-", "null", "none", "nan"];

/// Returns the number in a cell: with a decimal point or a decimal comma (`1,5`, `1.234,5`); NaN for a missing value; `None` for other
/// text, also for thousands separators (`1,234.5`).
pub(super) fn number(cell: &str) -> Option<f64> {
    let cell = clean(cell);
    if let Ok(number) = cell.parse() {
        return Some(number);
    }
    if cell.len() <= 4 && MISSING.contains(&cell.to_ascii_lowercase().as_str()) {
        return Some(f64::NAN);
    }
    let (whole, fraction) = cell.split_once(',')?;
    if fraction.contains([',', '.']) {
        return None;
    }
    let whole: String = match whole.contains('.') {
        // Points between groups of three digits.
        true if whole.split('.').skip(1).all(|group| group.len() == 3) => {
            whole.split('.').collect()
        }
        true => return None,
        false => whole.into(),
    };
    format!("{whole}.{fraction}").parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_with_a_point_or_a_comma() {
        for (cell, expected) in [
            ("1.5", 1.5),
            (" 1,5 ", 1.5),
            ("\"-60,476\"", -60.476),
            ("1,5e-3", 1.5e-3),
            ("1.234,5", 1234.5),
            ("inf", f64::INFINITY),
        ] {
            assert_eq!(number(cell), Some(expected), "{cell}");
        }
        for cell in ["", "NA", "nan", "-", "None"] {
            assert!(number(cell).unwrap().is_nan(), "{cell}");
        }
        for cell in ["1,234.5", "12;5", "n/a?", "1,2,3", "1.23,4", "x"] {
            assert_eq!(number(cell), None, "{cell}");
        }
    }

    #[test]
    fn the_dialect_follows_from_all_first_lines() {
        let found = |text: &str| {
            let table = Table::of(text.into()).unwrap();
            (table.separator as char, table.cells, table.preamble)
        };
        assert_eq!(found("a;b\n1,5;2,5\n"), (';', 2, 0));
        assert_eq!(found("1,5\t2,5\n1,7\t2,2\n"), ('\t', 2, 0));
        assert_eq!(found("1.0   2.0\n3.0 4.0\n"), ('\t', 2, 0));
        assert_eq!(
            found("Device: X, old\nRate 100\n\nt0,t1,t2\n1,2,3\n4,5,6\n"),
            (',', 3, 2)
        );
        assert_eq!(found("x\n1.5\n2.5\n").1, 1);
        assert_eq!(
            found("time,t0\n2026-01-01 10:00:00,5\n2026-01-01 10:00:01,6\n"),
            (',', 2, 0)
        );
        let numpy = Table::of("# a,b\n1,2\n3,4\n".into()).unwrap();
        assert_eq!(numpy.names.unwrap(), ["a", "b"]);
        let units = Table::of("time,F\nms,N\n1,2\n3,4\n".into()).unwrap();
        assert_eq!(units.units.unwrap(), ["ms", "N"]);
        assert!(Table::of("60,476\n61,122\n59,911\n".into()).is_err());
    }
}
