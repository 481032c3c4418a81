//! Tables of a report.

use maud::{Markup, PreEscaped, html};

use super::text::{ABSENT, scroll};

/// Kind of a column.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Column {
    Text,
    Number,
    /// The main number of the rows, which stays visible on a phone without scrolling.
    Score,
}

/// Heading of a column.
#[derive(Clone, Copy)]
pub(super) struct Heading {
    column: Column,
    /// Trusted HTML.
    label: &'static str,
    /// Second line; empty for none.
    unit: &'static str,
}

impl Heading {
    /// Returns the heading of a column of text.
    pub fn text(label: &'static str) -> Self {
        let column = Column::Text;
        Self {
            column,
            label,
            unit: "",
        }
    }

    /// Returns the heading of a column of numbers.
    pub fn number(label: &'static str, unit: &'static str) -> Self {
        let column = Column::Number;
        Self {
            column,
            label,
            unit,
        }
    }

    /// Returns the heading of the column with the main number.
    pub fn score(label: &'static str, unit: &'static str) -> Self {
        let column = Column::Score;
        Self {
            column,
            label,
            unit,
        }
    }

    fn class(self) -> Option<&'static str> {
        match self.column {
            Column::Text => None,
            Column::Number => Some("number"),
            Column::Score => Some("number score"),
        }
    }

    /// Returns the label with its unit.
    fn content(self) -> Markup {
        html! {
            (PreEscaped(self.label))
            @if !self.unit.is_empty() { br; small { (self.unit) } }
        }
    }
}

/// Returns a table in a scrolling frame whose headings sort it.
///
/// - `class`: further classes of the table
/// - `caption`: caption for screen readers
/// - `bodies`: `tbody` elements
pub(super) fn sortable(
    label: &str,
    class: &str,
    caption: &str,
    headings: &[Heading],
    bodies: &Markup,
) -> Markup {
    let table = html! {
        table class={ "sortable" @if !class.is_empty() { " " (class) } } {
            caption.hidden { (caption) }
            thead {
                tr {
                    @for heading in headings {
                        th scope="col" class=[heading.class()] aria-sort="none" {
                            button type="button" { (heading.content()) }
                        }
                    }
                }
            }
            (bodies)
        }
    };
    scroll(label, &table)
}

/// Returns a table with plain headings.
///
/// - `caption`: `caption` element, or nothing
pub(super) fn plain(caption: &Markup, headings: &[Heading], rows: &Markup) -> Markup {
    html! {
        table {
            (caption)
            thead {
                tr {
                    @for heading in headings {
                        th scope="col" class=[heading.class()] { (heading.content()) }
                    }
                }
            }
            tbody { (rows) }
        }
    }
}

/// Returns rows under a common heading; sorting keeps them together.
pub(super) fn body(heading: Option<&str>, columns: usize, rows: &Markup) -> Markup {
    html! {
        tbody {
            @if let Some(heading) = heading {
                tr.separator {
                    th scope="rowgroup" colspan=(columns) { span { (heading) } }
                }
            }
            (rows)
        }
    }
}

/// Returns a cell that sorts by `value` and shows `shown`.
pub(super) fn number(value: Option<f64>, shown: &str) -> Markup {
    match value.filter(|value| value.is_finite()) {
        Some(value) => html! { td.number data-value=(value) { (shown) } },
        None => html! { td.number { (ABSENT) } },
    }
}

/// Returns a cell with a number of things.
pub(super) fn count(value: Option<usize>) -> Markup {
    let shown = value.map(|value| value.to_string()).unwrap_or_default();
    number(value.map(|value| value as f64), &shown)
}
