//! The glossary of a report.

use maud::{Markup, PreEscaped, html};

/// Returns the glossary.
///
/// - `terms`: word and meaning, as trusted HTML
pub(super) fn terms(terms: &[(&str, &str)]) -> Markup {
    html! {
        dl.glossary {
            @for (term, meaning) in terms {
                div { dt { (PreEscaped(term)) } dd { (PreEscaped(meaning)) } }
            }
        }
    }
}
