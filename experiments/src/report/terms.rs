//! The words of a page and their meanings.

/// - `terms`: word and meaning, as HTML
pub(super) fn terms(terms: &[(&str, &str)]) -> String {
    let terms: String = terms
        .iter()
        .map(|(term, meaning)| format!("<div><dt>{term}</dt><dd>{meaning}</dd></div>\n"))
        .collect();
    format!("<dl class=\"glossary\">\n{terms}</dl>\n")
}
