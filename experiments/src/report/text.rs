//! Text and numbers in HTML.

use maud::{Markup, html};

use crate::Statistic;

/// Text in place of a missing number.
pub(super) const ABSENT: &str = "\u{2013}";

/// Maximum length of a material's name in a figure, in characters.
pub(super) const NAME_LIMIT: usize = 34;

/// Formats a number with a typographic minus sign and without negative zeros.
pub(super) fn decimal(value: f64, decimals: usize) -> String {
    if !value.is_finite() {
        return ABSENT.to_string();
    }
    let shown = format!("{:.decimals$}", value.abs());
    let zero = shown.bytes().all(|byte| byte == b'0' || byte == b'.');
    if value < 0.0 && !zero {
        format!("\u{2212}{shown}")
    } else {
        shown
    }
}

/// Formats a share, 0 to 1, in percent with one decimal and without the percent sign.
pub(super) fn percent(share: f64) -> String {
    decimal(100.0 * share, 1)
}

/// Formats a coordinate of a figure, in user units.
pub(super) fn px(value: f64) -> String {
    format!("{value:.1}")
}

/// Formats a p-value with three digits; empty without one.
pub(super) fn p_value(p: Option<f64>) -> String {
    match p {
        None => String::new(),
        Some(p) if p < 0.0005 => "<0.001".into(),
        Some(p) => decimal(p, 3),
    }
}

/// Formats mean and standard deviation of shares in percent: "86.3 (1.2)".
pub(super) fn percent_and_sd(statistic: &Statistic) -> String {
    match statistic.sd {
        Some(sd) => format!("{} ({})", percent(statistic.mean), percent(sd)),
        None => percent(statistic.mean),
    }
}

/// Formats the 95 % interval of a mean of shares in percent: "[84.1, 88.5]".
pub(super) fn percent_interval(statistic: &Statistic) -> String {
    match statistic.ci95 {
        Some([low, high]) => format!("[{}, {}]", percent(low), percent(high)),
        None => ABSENT.to_string(),
    }
}

/// Formats a duration with its two largest units: "3 h 12 min".
pub(super) fn duration(seconds: f64) -> String {
    let whole = seconds.max(0.0).round() as u64;
    let (days, hours, minutes) = (whole / 86_400, whole / 3600 % 24, whole / 60 % 60);
    if days > 0 {
        format!("{days} d {hours} h")
    } else if hours > 0 {
        format!("{hours} h {minutes} min")
    } else if minutes > 0 {
        format!("{minutes} min {} s", whole % 60)
    } else {
        format!("{} s", decimal(seconds, 1))
    }
}

/// Returns the first twelve digits of a hash, with the complete hash as title. The mark of uncommitted changes is kept.
pub(super) fn hash(full: &str) -> Markup {
    let mut short: String = full.chars().take(12).collect();
    if let Some((_, mark)) = full.split_once('-') {
        short.push('-');
        short.push_str(mark);
    }
    html! { code title=(full) { (short) } }
}

/// Returns the hashes of commits, separated by commas.
pub(super) fn commits(all: &[String]) -> Markup {
    html! {
        @for (k, commit) in all.iter().enumerate() {
            @if k > 0 { ", " }
            (hash(commit))
        }
    }
}

/// Returns a link to a file next to the page. The path is encoded, so it cannot contain a scheme or a host.
pub(super) fn file_link(path: &str) -> Markup {
    let encoded: String = path
        .bytes()
        .map(|byte| match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'-' | b'_' | b'.' | b'~' | b'/' => {
                char::from(byte).to_string()
            }
            _ => format!("%{byte:02X}"),
        })
        .collect();
    html! { a href={ "./" (encoded) } { (path) } }
}

/// Returns a sentence with text between backticks as code.
pub(super) fn prose(sentence: &str) -> Markup {
    let parts: Vec<&str> = sentence.split('`').collect();
    html! {
        @for (k, part) in parts.iter().enumerate() {
            @if k % 2 == 0 { (part) }
            @else if k + 1 < parts.len() { code { (part) } }
            // The last backtick has no partner.
            @else { "`" (part) }
        }
    }
}

/// Returns a note for each line.
pub(super) fn notes(lines: &[String]) -> Markup {
    html! { @for line in lines { p.note { (prose(line)) } } }
}

/// Shortens a name to at most `limit` characters.
pub(super) fn shortened(name: &str, limit: usize) -> String {
    if name.chars().count() <= limit {
        return name.to_string();
    }
    let mut short: String = name.chars().take(limit.saturating_sub(1)).collect();
    short.push('\u{2026}');
    short
}

/// Returns a frame that scrolls sideways instead of the page and is reachable by keyboard.
pub(super) fn scroll(label: &str, content: &Markup) -> Markup {
    html! { div.scroll tabindex="0" role="group" aria-label=(label) { (content) } }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn code_of_a_sentence_is_shown_as_code() {
        let shown = prose("with `seed = 2` and <b>, `again` and ` alone").into_string();
        let expected = "with <code>seed = 2</code> and &lt;b&gt;, <code>again</code> and ` alone";
        assert_eq!(shown, expected);
    }

    #[test]
    fn numbers_are_rounded_and_signed_for_reading() {
        assert_eq!(percent(0.8634), "86.3");
        assert_eq!(percent(-0.0123), "\u{2212}1.2");
        assert_eq!(percent(-0.0001), "0.0");
        assert_eq!(decimal(f64::NAN, 2), ABSENT);
        assert_eq!(p_value(Some(0.0123)), "0.012");
        assert_eq!(p_value(Some(1e-7)), "<0.001");
    }

    #[test]
    fn durations_keep_their_two_largest_units() {
        let shown = [0.42, 75.0, 3600.0 * 3.2, 86_400.0 * 2.5].map(duration);
        assert_eq!(shown, ["0.4 s", "1 min 15 s", "3 h 12 min", "2 d 12 h"]);
    }

    #[test]
    fn a_hash_is_shortened_but_not_its_mark() {
        assert!(hash("0123456789abcdef").0.contains(">0123456789ab<"));
        assert!(
            hash("0123456789ab-dirty")
                .0
                .contains(">0123456789ab-dirty<")
        );
    }

    #[test]
    fn a_link_is_a_relative_path_whatever_it_is_made_from() {
        let link = file_link("javascript:alert(\"1\")").into_string();
        assert!(
            link.starts_with("<a href=\"./javascript%3Aalert%28%221%22%29\">"),
            "{link}"
        );
    }
}
