//! The header of a report: title, headline and warnings.

use std::collections::BTreeSet;

use maud::{Markup, html};

use crate::Summary;

/// Returns the header.
///
/// - `headline`: the first text after the title
pub(super) fn header(summary: &Summary, headline: &Markup) -> Markup {
    let twins = twins(summary);
    html! {
        p.overline { (summary.name) }
        h1 { (summary.title) }
        (headline)
        @if !twins.is_empty() {
            p.note {
                "The sweeps of "
                @for (k, name) in twins.into_iter().enumerate() {
                    @if k > 0 { ", " }
                    code { (name) }
                }
                " are synthetic: a generator made them, and their results do not hold for TactMat."
            }
        }
        // The table of a comparison over several data sets names them.
        @for left_out in summary.left_out.iter().filter(|_| summary.benchmark.is_none()) {
            p.note { strong { "Left out:" } " " (left_out) "." }
        }
        @for assumed in summary.assumed_rates() {
            p.note { strong { "Assumed:" } " " (assumed) "." }
        }
    }
}

/// Returns the names of the synthetic data sets; `twin` also stands for `twin, labels permuted`.
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
        let header = header(&summary, &html! {}).into_string();
        assert!(header.contains("<code>twin</code>, <code>twins</code> are synthetic"));
        assert_eq!(header.matches("class=\"note\"").count(), 1);
    }

    #[test]
    fn a_rate_that_nobody_named_is_marked() {
        let mut summary = fake::summary();
        assert!(
            !header(&summary, &html! {})
                .into_string()
                .contains("Assumed")
        );
        let record = crate::DataRecord {
            sha256: "00".into(),
            origin: tactnet_data::DataOrigin::Recorded,
            assumed_rate_hz: Some(750.0),
        };
        summary.data.insert("own".into(), record);
        let header = header(&summary, &html! {}).into_string();
        assert!(header.contains("own does not state its sample rate; 750 Hz is assumed"));
    }
}
