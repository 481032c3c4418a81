//! Title, headline, and what must be known before the numbers.

use std::collections::BTreeSet;

use tactnet_plot::escape;

use super::text::prose;
use crate::Summary;

/// - `headline`: HTML, the first text after the title
pub(super) fn header(summary: &Summary, headline: &str) -> String {
    let twins = twins(summary);
    let assumed: String = summary
        .assumed_rates()
        .iter()
        .map(|line| {
            format!(
                "<p class=\"note\"><strong>Assumed:</strong> {}</p>\n",
                prose(line)
            )
        })
        .collect();
    let note = if twins.is_empty() {
        String::new()
    } else {
        let names: Vec<String> = twins
            .into_iter()
            .map(|name| format!("<code>{}</code>", escape(name)))
            .collect();
        format!(
            "<p class=\"note\">The sweeps of {} are synthetic: a generator made them, and the numbers on them are not \
             TactMat's.</p>\n",
            names.join(", ")
        )
    };
    format!(
        "<p class=\"overline\">{}</p>\n<h1>{}</h1>\n{headline}{note}{assumed}",
        escape(&summary.name),
        escape(&summary.title)
    )
}

/// Names of the synthetic data sets; `twin` stands for `twin, labels permuted`, too.
fn twins(summary: &Summary) -> BTreeSet<&str> {
    let rows = summary.rows.iter();
    let of_rows = rows.map(|row| (row.data.as_str(), row.origin));
    let data = summary.data.iter();
    let of_data = data.map(|(name, data)| (name.as_str(), data.origin));
    let all: BTreeSet<&str> = of_rows
        .chain(of_data)
        .filter(|(_, origin)| origin.is_synthetic())
        .map(|(name, _)| name)
        .collect();
    let treated = |name: &str| {
        let whole = |other: &&str| {
            name.strip_prefix(*other)
                .is_some_and(|rest| rest.starts_with(", "))
        };
        all.iter().any(whole)
    };
    all.iter().copied().filter(|name| !treated(name)).collect()
}

#[cfg(test)]
mod tests {
    use super::super::fake;
    use super::*;

    #[test]
    fn one_note_names_every_synthetic_data_set_once() {
        let mut summary = fake::summary();
        for name in ["twin", "twin, labels permuted", "twins"] {
            let twin = crate::DataRecord {
                sha256: "00".into(),
                origin: tactnet_data::DataOrigin::Twin2,
                assumed_rate_hz: None,
            };
            summary.data.insert(name.into(), twin);
        }
        let header = header(&summary, "");
        assert!(header.contains("<code>twin</code>, <code>twins</code> are synthetic"));
        assert_eq!(header.matches("class=\"note\"").count(), 1);
    }

    #[test]
    fn a_rate_that_nobody_named_is_marked() {
        let mut summary = fake::summary();
        assert!(!header(&summary, "").contains("Assumed"));
        let record = crate::DataRecord {
            sha256: "00".into(),
            origin: tactnet_data::DataOrigin::Recorded,
            assumed_rate_hz: Some(750.0),
        };
        summary.data.insert("own".into(), record);
        let header = header(&summary, "");
        assert!(header.contains("own does not say its sample rate; 750 Hz is assumed"));
    }
}
