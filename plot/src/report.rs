//! Pages of reports: the report's text, figures, and all numbers of its JSON document; and a check of pages for tests.

use std::fmt::Write;

use crate::{Axes, Axis, Page, Scale, Series as Curve, Tick, figure};
use maud::{Markup, PreEscaped, html};
use serde::Serialize;
use serde_json::Value;

/// Width of figures, in user units.
const WIDTH: f64 = 640.0;
/// Space for labels left of the axes, in user units.
pub const LEFT: f64 = 56.0;

/// Returns a self-contained page of a report.
///
/// - `text`: the report in words; the first line is the headline
pub fn report_page(title: &str, text: &str, figures: Markup, report: &impl Serialize) -> String {
    let mut rows = Vec::new();
    let numbers = serde_json::to_value(report).unwrap_or_default();
    add_rows("", &numbers, &mut rows);
    let (headline, rest) = text.split_once('\n').unwrap_or((text, ""));
    let content = html! {
        p.headline { (headline) }
        @for line in rest.lines() { p { (line) } }
        (figures)
        h2 { "All numbers" }
        (table(["What", "Value"], &rows))
    };
    Page::new(title, content).to_html()
}

/// Adds a row for each number or text in a JSON value, with the path to it.
fn add_rows(path: &str, value: &Value, rows: &mut Vec<[String; 2]>) {
    let below = |name: &str| match path {
        "" => name.replace('_', " "),
        path => format!("{path}, {}", name.replace('_', " ")),
    };
    match value {
        Value::Null => {}
        Value::Object(fields) => {
            for (name, field) in fields {
                add_rows(&below(name), field, rows);
            }
        }
        Value::Array(all) if all.iter().any(|one| one.is_object() || one.is_array()) => {
            for (number, one) in (1..).zip(all) {
                add_rows(&below(&format!("{number}")), one, rows);
            }
        }
        Value::Array(all) => {
            let all: Vec<String> = all.iter().map(short).collect();
            rows.push([path.into(), all.join("; ")]);
        }
        one => rows.push([path.into(), short(one)]),
    }
}

/// Returns a scalar as text, numbers with four digits.
fn short(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Number(number) if number.is_f64() => {
            let number = number.as_f64().unwrap_or_default();
            let digits = number.abs().max(1e-9).log10().floor();
            format!("{number:.0$}", (3.0 - digits).clamp(0.0, 9.0) as usize)
        }
        other => other.to_string(),
    }
}

/// Returns a table that scrolls on narrow screens.
fn table<const N: usize>(head: [&str; N], rows: &[[String; N]]) -> Markup {
    html! {
        div.scroll tabindex="0" {
            table {
                thead {
                    tr { @for cell in head { th scope="col" { (cell) } } }
                }
                tbody {
                    @for (name, cells) in rows.iter().filter_map(|row| row.split_first()) {
                        tr {
                            th scope="row" { (name) }
                            @for cell in cells { td { (cell) } }
                        }
                    }
                }
            }
        }
    }
}

/// Returns a figure with its caption.
pub fn captioned(figure: &str, caption: &str) -> Markup {
    html! {
        figure {
            (PreEscaped(figure))
            figcaption { (caption) }
        }
    }
}

/// Returns the legend of the series from the first on.
pub fn legend<S: AsRef<str>>(names: &[S]) -> Markup {
    PreEscaped(crate::legend(names))
}

/// Returns axes across the whole width of a figure.
pub fn axes(height: f64, horizontal: Axis, vertical: Axis) -> Axes {
    Axes {
        left: LEFT,
        top: 12.0,
        width: WIDTH - LEFT - 16.0,
        height,
        horizontal,
        vertical,
    }
}

/// Returns the figure of axes and the lines in them.
///
/// - `title`: description for screen readers
pub fn chart(title: &str, axes: &Axes, lines: &str) -> String {
    figure(WIDTH, axes.height + 60.0, title, &(axes.grid() + lines))
}

/// Returns a share with its interval, in percent.
pub fn percent(share: f64, [low, high]: [f64; 2]) -> String {
    let [share, low, high] = [share, low, high].map(|x| 100.0 * x);
    format!("{share:.1} % [{low:.1}, {high:.1}]")
}

/// Returns empirical distribution functions on a logarithmic axis; `None` without a value above 0.
///
/// - `title`: description for screen readers
/// - `label`: name and unit of the values
pub fn at_most(title: &str, label: &str, curves: &[Vec<f64>]) -> Option<String> {
    let axes = axes(
        240.0,
        Axis::decades(label, curves.iter().flatten().copied())?,
        Axis::percent("share that is at most so great [%]", 1.0, 0.2),
    );
    let lines: String = curves
        .iter()
        .enumerate()
        .map(|(number, values)| axes.path(Curve::nth(number), &steps(values)))
        .collect();
    Some(chart(title, &axes, &lines))
}

/// A share with its interval and its name.
pub struct Share {
    /// Label below the bar, about 15 letters.
    pub name: String,
    /// Index of the style.
    pub look: usize,
    /// The share, 0 to 1.
    pub share: f64,
    /// Its 95 % interval.
    pub ci95: [f64; 2],
}

/// Returns a chart of shares, each with its interval and its name below. The alternative text has all names and
/// numbers.
pub fn shares(what: &str, label: &str, all: &[Share]) -> String {
    let places = || (1..).map(f64::from).zip(all);
    let names = Axis {
        label: String::new(),
        scale: Scale::Linear(0.5..=all.len() as f64 + 0.5),
        ticks: places()
            .map(|(value, one)| Tick {
                value,
                label: one.name.clone(),
            })
            .collect(),
    };
    let axes = axes(160.0, names, Axis::percent(label, 1.0, 0.25));
    let mut svg = axes.grid();
    let mut title = what.to_string();
    for (x, one) in places() {
        let [low, high] = one.ci95;
        svg += &axes.intervals(Curve::nth(one.look), &[(x, low, high)]);
        svg += &axes.line(Curve::nth(one.look), &[(x, one.share)], 1);
        let _ = write!(title, "; {}: {}", one.name, percent(one.share, one.ci95));
    }
    figure(WIDTH, 206.0, &title, &svg)
}

/// Maximum number of points of a curve.
const POINTS: usize = 400;

/// Returns points `(value, share of values at most as large)` in rising order, at most [`POINTS`].
fn steps(values: &[f64]) -> Vec<(f64, f64)> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let count = sorted.len();
    let every = count.div_ceil(POINTS).max(1);
    (1..=count)
        .filter(|place| place % every == 0 || *place == 1 || *place == count)
        .map(|place| (sorted[place - 1], place as f64 / count as f64))
        .collect()
}

/// Elements without content, in the head of a page.
const VOID: [&str; 2] = ["meta", "link"];
/// Parts of the head that name a protocol or a reference but load nothing.
const HEAD: [&str; 2] = [
    "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'\">",
    "<link rel=\"icon\" href=\"data:,\">",
];

/// Panics unless elements are closed in order, entities are known, and nothing is loaded from elsewhere.
pub fn assert_page(page: &str) {
    let mut rest = page.strip_prefix("<!DOCTYPE html>").expect("a page");
    let mut open: Vec<&str> = Vec::new();
    while let Some(at) = rest.find('<') {
        let end = at + rest[at..].find('>').expect("an end of a tag");
        let tag = &rest[at + 1..end];
        rest = &rest[end + 1..];
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop(), Some(name), "</{name}>");
            continue;
        }
        assert_eq!(tag.matches('"').count() % 2, 0, "{tag}");
        let name = tag.split(' ').next().expect("a name");
        if !tag.ends_with('/') && !VOID.contains(&name) {
            open.push(name);
        }
    }
    assert!(open.is_empty(), "{open:?} stay open");
    for entity in page.split('&').skip(1) {
        let known = ["amp;", "lt;", "gt;", "quot;", "#39;"];
        let is_known = known.iter().any(|name| entity.starts_with(name));
        assert!(is_known, "{entity:.20}");
    }
    let mut content = page.to_string();
    for part in HEAD {
        assert_eq!(content.matches(part).count(), 1, "{part}");
        content = content.replace(part, "");
    }
    for outside in ["http", "url(", "@import", "src=", "href"] {
        assert!(!content.contains(outside), "{outside}");
    }
    for nothing in ["NaN", ">inf", " inf", "None"] {
        assert!(!page.contains(nothing), "{nothing}");
    }
    // Each figure has an alternative text.
    let figures = page.matches("<svg class=\"figure\"").count();
    assert_eq!(figures, page.matches("role=\"img\"").count());
    assert_eq!(page.matches("<h1>").count(), 1);
    assert!(page.contains("prefers-color-scheme: dark") && page.contains("width=device-width"));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_has_all_numbers_of_its_report_and_text_stays_text() {
        let report = serde_json::json!({
            "mean_mm": 1.234567, "throws": 12, "rate": null, "mode": "soft", "ci95": [0.5, 1.0],
            "misses": {"a < b": 3}, "worst": [{"left": 1e-3, "axes": [["tilt", -20.0]]}],
        });
        let page = report_page("Hands & balls", "First.\nSecond.", html! {}, &report);
        assert_page(&page);
        for expected in [
            "<h1>Hands &amp; balls</h1><p class=\"headline\">First.</p><p>Second.</p>",
            "<th scope=\"row\">mean mm</th><td>1.235</td>",
            "<th scope=\"row\">throws</th><td>12</td>",
            "<th scope=\"row\">mode</th><td>soft</td>",
            "<th scope=\"row\">ci95</th><td>0.5000; 1.000</td>",
            "<th scope=\"row\">misses, a &lt; b</th><td>3</td>",
            "<th scope=\"row\">worst, 1, left</th><td>0.001000</td>",
            "<th scope=\"row\">worst, 1, axes, 1</th><td>tilt; -20.00</td>",
        ] {
            assert!(page.contains(expected), "{expected}: {page}");
        }
        assert!(!page.contains(">rate<"));
        for wrong in ["<p></h2>", "<p>a & b</p>", "<p>NaN</p>", "<h1></h1>"] {
            let wrong = report_page("t", "", PreEscaped(wrong.into()), &report);
            let found = std::panic::catch_unwind(|| assert_page(&wrong));
            assert!(found.is_err(), "{wrong}");
        }
    }

    #[test]
    fn shares_rise_to_all_values() {
        let four = [(1.0, 0.25), (2.0, 0.5), (2.0, 0.75), (3.0, 1.0)];
        assert_eq!(steps(&[3.0, 1.0, 2.0, 2.0]), four);
        assert!(steps(&[]).is_empty());
        let many: Vec<f64> = (0..10_001).map(f64::from).collect();
        let few = steps(&many);
        assert!(few.len() <= POINTS + 2 && few.last() == Some(&(10_000.0, 1.0)));
        assert_eq!(at_most("t", "x [mm]", &[vec![], vec![0.0]]), None);
        let drawn = at_most("t", "x [mm]", &[vec![1.0, 20.0], vec![]]).unwrap();
        assert!(drawn.contains("polyline points=\"56"), "{drawn}");
    }
}
