//! Text and numbers as HTML.

use tactnet_plot::escape;

use crate::Statistic;

/// Stands where there is no number.
pub(super) const ABSENT: &str = "\u{2013}";

/// A number with a proper minus sign and without negative zeros.
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

/// A share, 0 to 1, in percent with one decimal, without the sign.
pub(super) fn percent(share: f64) -> String {
    decimal(100.0 * share, 1)
}

/// A p-value with three digits, escaped.
pub(super) fn p_value(p: f64) -> String {
    if p < 0.0005 {
        "&lt;0.001".to_string()
    } else {
        decimal(p, 3)
    }
}

/// Mean and standard deviation of shares, percent: "86.3 (1.2)".
pub(super) fn percent_and_sd(statistic: &Statistic) -> String {
    match statistic.sd {
        Some(sd) => format!("{} ({})", percent(statistic.mean), percent(sd)),
        None => percent(statistic.mean),
    }
}

/// The 95 % interval of a mean of shares, percent: "[84.1, 88.5]".
pub(super) fn percent_interval(statistic: &Statistic) -> String {
    match statistic.ci95 {
        Some([low, high]) => format!("[{}, {}]", percent(low), percent(high)),
        None => ABSENT.to_string(),
    }
}

/// A time for people: "3 h 12 min".
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

/// The first twelve digits of a hash; all of it as the title. That a build had uncommitted changes is not cut off.
pub(super) fn hash(full: &str) -> String {
    let mut short: String = full.chars().take(12).collect();
    if let Some((_, mark)) = full.split_once('-') {
        short.push('-');
        short.push_str(mark);
    }
    format!("<code title=\"{}\">{}</code>", escape(full), escape(&short))
}

/// The hashes of commits, with commas between them.
pub(super) fn commits(all: &[String]) -> String {
    let shown: Vec<String> = all.iter().map(|commit| hash(commit)).collect();
    shown.join(", ")
}

/// A link to a file beside the page. Whatever the path holds, it is a path: no scheme, no host.
pub(super) fn file_link(path: &str) -> String {
    let encoded: String = path
        .bytes()
        .map(|byte| match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'-' | b'_' | b'.' | b'~' | b'/' => {
                char::from(byte).to_string()
            }
            _ => format!("%{byte:02X}"),
        })
        .collect();
    format!("<a href=\"./{encoded}\">{}</a>", escape(path))
}

/// A sentence, with what stands between backticks as code.
pub(super) fn prose(sentence: &str) -> String {
    let escaped = escape(sentence);
    let mut html = String::new();
    let mut parts = escaped.split('`').peekable();
    let mut is_code = false;
    while let Some(part) = parts.next() {
        match (is_code, parts.peek()) {
            (true, Some(_)) => html.push_str(&format!("<code>{part}</code>")),
            // The last backtick has no partner.
            (true, None) => html.push_str(&format!("`{part}")),
            (false, _) => html.push_str(part),
        }
        is_code = !is_code;
    }
    html
}

/// At most `limit` characters of a name, for a label in a figure; not yet escaped.
pub(super) fn shortened(name: &str, limit: usize) -> String {
    if name.chars().count() <= limit {
        return name.to_string();
    }
    let mut short: String = name.chars().take(limit.saturating_sub(1)).collect();
    short.push('\u{2026}');
    short
}

/// A container that scrolls sideways on its own, so that the page does not; reachable by keyboard.
pub(super) fn scroll(label: &str, content: &str) -> String {
    format!(
        "<div class=\"scroll\" tabindex=\"0\" role=\"group\" aria-label=\"{}\">\n{content}</div>\n",
        escape(label)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn code_of_a_sentence_is_shown_as_code() {
        let shown = prose("with `--set seed=2` and <b>, `again` and ` alone");
        let expected =
            "with <code>--set seed=2</code> and &lt;b&gt;, <code>again</code> and ` alone";
        assert_eq!(shown, expected);
    }

    #[test]
    fn numbers_are_rounded_and_signed_for_reading() {
        assert_eq!(percent(0.8634), "86.3");
        assert_eq!(percent(-0.0123), "\u{2212}1.2");
        assert_eq!(percent(-0.0001), "0.0");
        assert_eq!(decimal(f64::NAN, 2), ABSENT);
        assert_eq!(p_value(0.0123), "0.012");
        assert_eq!(p_value(1e-7), "&lt;0.001");
    }

    #[test]
    fn durations_keep_their_two_largest_units() {
        let shown = [0.42, 75.0, 3600.0 * 3.2, 86_400.0 * 2.5].map(duration);
        assert_eq!(shown, ["0.4 s", "1 min 15 s", "3 h 12 min", "2 d 12 h"]);
    }

    #[test]
    fn a_hash_is_shortened_but_not_its_mark() {
        assert!(hash("0123456789abcdef").contains(">0123456789ab<"));
        assert!(hash("0123456789ab-dirty").contains(">0123456789ab-dirty<"));
    }

    #[test]
    fn a_link_is_a_relative_path_whatever_it_is_made_from() {
        let link = file_link("javascript:alert(\"1\")");
        assert!(
            link.starts_with("<a href=\"./javascript%3Aalert%28%221%22%29\">"),
            "{link}"
        );
    }
}
