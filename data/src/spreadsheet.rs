//! Cells of CSV tables that people open in a spreadsheet.

use std::borrow::Cow;

/// Returns a text as a cell of a CSV table for spreadsheets: in quotes if it needs them, and after an apostrophe if it begins
/// like a formula and is not a number, so that spreadsheets do not compute it.
///
/// ```
/// use tactnet_data::spreadsheet_cell;
///
/// assert_eq!(spreadsheet_cell("cork, oiled"), "\"cork, oiled\"");
/// assert_eq!(spreadsheet_cell("=1+1"), "'=1+1");
/// assert_eq!(spreadsheet_cell("-3"), "-3");
/// ```
pub fn spreadsheet_cell(text: &str) -> Cow<'_, str> {
    let is_formula = text.starts_with(['=', '+', '-', '@', '\t', '\r']);
    let text = match is_formula && text.parse::<f64>().is_err() {
        true => Cow::Owned(format!("'{text}")),
        false => Cow::Borrowed(text),
    };
    match text.contains(['"', ',', '\n', '\r']) {
        true => Cow::Owned(format!("\"{}\"", text.replace('"', "\"\""))),
        false => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_begin_like_a_formula_are_text() {
        for (text, cell) in [
            ("cork", "cork"),
            ("cork = old", "cork = old"),
            ("=cmd|' /C calc'!A0", "'=cmd|' /C calc'!A0"),
            ("@SUM(A1)", "'@SUM(A1)"),
            ("+49", "+49"),
            ("+a", "'+a"),
            ("-wood", "'-wood"),
            ("-1.5e3", "-1.5e3"),
            ("=1,2", "\"'=1,2\""),
            ("5\" disk", "\"5\"\" disk\""),
        ] {
            assert_eq!(spreadsheet_cell(text), cell);
        }
    }
}
