//! Common parts of the pages: style, tables, shares with their intervals.

use std::collections::BTreeMap;
use std::fmt::Write;

use tactnet_plot::{
    Axes, Axis, STYLE as FIGURE_STYLE, Scale, Series as Curve, Tick, escape, figure, theme,
};

const STYLE: &str = "
html{color-scheme:light dark}
body{font:16px/1.5 system-ui,sans-serif;color:var(--ink);background:var(--ground);max-width:60rem;margin:2rem auto;padding:0 1rem}
.headline{font-size:1.25rem}figure{margin:1rem 0}figcaption{color:var(--muted);font-size:.9rem}
.scroll{overflow-x:auto}table{border-collapse:collapse;font-size:.9rem}td,th{padding:.15rem .8rem .15rem 0;text-align:left;border-bottom:1px solid var(--rule)}";

/// Width of figures, in user units.
pub(crate) const WIDTH: f64 = 640.0;
/// Space for labels left of the axes, in user units.
pub(crate) const LEFT: f64 = 56.0;

/// Returns a self-contained page.
///
/// - `body`: HTML
pub(crate) fn sheet(title: &str, body: &str) -> String {
    let title = escape(title);
    format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"/><meta name=\"viewport\" content=\"width=device-width,initial-scale=1\"/>\
         <title>{title}</title><style>{}{FIGURE_STYLE}{STYLE}</style></head><body><h1>{title}</h1>\n{body}</body></html>\n",
        theme()
    )
}

/// Returns a table of counts, or nothing if there are none.
pub(crate) fn counts_table(head: [&str; 2], counts: &BTreeMap<String, usize>) -> String {
    let rows: Vec<[String; 2]> = counts
        .iter()
        .map(|(name, count)| [name.clone(), count.to_string()])
        .collect();
    if rows.is_empty() {
        return String::new();
    }
    table(head, &rows)
}

/// Returns a table that scrolls on narrow screens; the cells are escaped here.
pub(crate) fn table<const N: usize>(head: [&str; N], rows: &[[String; N]]) -> String {
    let mut html = String::from("<div class=\"scroll\" tabindex=\"0\"><table><thead><tr>");
    for cell in head {
        let _ = write!(html, "<th scope=\"col\">{}</th>", escape(cell));
    }
    html.push_str("</tr></thead><tbody>");
    for row in rows {
        html.push_str("<tr>");
        for (column, cell) in row.iter().enumerate() {
            let cell = escape(cell);
            let _ = match column {
                0 => write!(html, "<th scope=\"row\">{cell}</th>"),
                _ => write!(html, "<td>{cell}</td>"),
            };
        }
        html.push_str("</tr>");
    }
    html.push_str("</tbody></table></div>\n");
    html
}

/// Returns a figure with its caption, which is escaped here, and the content below it, such as a legend.
pub(crate) fn captioned(figure: &str, caption: &str, below: &str) -> String {
    format!(
        "<figure>{figure}<figcaption>{}</figcaption></figure>{below}",
        escape(caption)
    )
}

/// Returns a share with its interval, in percent.
pub(crate) fn percent(share: f64, [low, high]: [f64; 2]) -> String {
    format!(
        "{:.1} % [{:.1}, {:.1}]",
        100.0 * share,
        100.0 * low,
        100.0 * high
    )
}

/// Returns empirical distribution functions on a logarithmic axis; `None` without a value above 0.
///
/// - `title`: description for screen readers
/// - `label`: name and unit of the values
pub(crate) fn at_most(title: &str, label: &str, curves: &[Vec<f64>]) -> Option<String> {
    let axes = Axes {
        left: LEFT,
        top: 12.0,
        width: WIDTH - LEFT - 16.0,
        height: 240.0,
        horizontal: Axis::decades(label, curves.iter().flatten().copied())?,
        vertical: Axis::percent("share that is at most so great [%]", 1.0, 0.2),
    };
    let lines: String = curves
        .iter()
        .enumerate()
        .map(|(number, values)| axes.path(Curve::nth(number), &steps(values)))
        .collect();
    Some(figure(WIDTH, 300.0, title, &(axes.grid() + &lines)))
}

/// A share with its interval and its name.
pub(crate) struct Share {
    /// Label below the bar, about 15 letters.
    pub name: String,
    /// Index of the style.
    pub look: usize,
    pub share: f64,
    pub ci95: [f64; 2],
}

/// Returns a chart of shares, each with its interval and its name below. The alternative text has all names and
/// numbers.
pub(crate) fn shares(what: &str, label: &str, all: &[Share]) -> String {
    let places = || (1..).map(f64::from).zip(all);
    let axes = Axes {
        left: LEFT,
        top: 12.0,
        width: WIDTH - LEFT - 16.0,
        height: 160.0,
        horizontal: Axis {
            label: String::new(),
            scale: Scale::Linear(0.5..=all.len() as f64 + 0.5),
            ticks: places()
                .map(|(value, one)| Tick {
                    value,
                    label: one.name.clone(),
                })
                .collect(),
        },
        vertical: Axis::percent(label, 1.0, 0.25),
    };
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

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Panics unless elements are closed in order, entities are known, and nothing is loaded from elsewhere.
    pub(crate) fn assert_page(page: &str) {
        let mut rest = page.strip_prefix("<!doctype html>").expect("a page");
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
            if !tag.ends_with('/') {
                open.push(tag.split(' ').next().expect("a name"));
            }
        }
        assert!(open.is_empty(), "{open:?} stay open");
        for entity in page.split('&').skip(1) {
            let known = ["amp;", "lt;", "gt;", "quot;", "#39;"];
            assert!(
                known.iter().any(|name| entity.starts_with(name)),
                "{entity:.20}"
            );
        }
        for outside in ["http", "url(", "@import", "src=", "href"] {
            assert!(!page.contains(outside), "{outside}");
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

    #[test]
    fn a_sheet_is_whole_and_text_stays_text() {
        let rows = [["a < b".to_string(), "1".to_string()]];
        let page = sheet("Hands & balls", &table(["what", "mm"], &rows));
        assert_page(&page);
        assert!(page.contains("<h1>Hands &amp; balls</h1>"));
        assert!(page.contains("<th scope=\"row\">a &lt; b</th><td>1</td>"));
        for wrong in [
            "<!doctype html><h1></h2>",
            "<!doctype html><p>a & b</p>",
            "<!doctype html><img src=\"http:\"/>",
            "<!doctype html><p>NaN</p>",
        ] {
            assert!(
                std::panic::catch_unwind(|| assert_page(wrong)).is_err(),
                "{wrong}"
            );
        }
    }

    #[test]
    fn shares_rise_to_all_values() {
        assert_eq!(
            steps(&[3.0, 1.0, 2.0, 2.0]),
            [(1.0, 0.25), (2.0, 0.5), (2.0, 0.75), (3.0, 1.0)]
        );
        assert!(steps(&[]).is_empty());
        let many: Vec<f64> = (0..10_001).map(f64::from).collect();
        let few = steps(&many);
        assert!(few.len() <= POINTS + 2 && few.last() == Some(&(10_000.0, 1.0)));
        assert_eq!(at_most("t", "x [mm]", &[vec![], vec![0.0]]), None);
        let drawn = at_most("t", "x [mm]", &[vec![1.0, 20.0], vec![]]).unwrap();
        assert!(drawn.contains("polyline points=\"56"), "{drawn}");
    }
}
