//! Numbers and lists as parts of sentences.

/// Formats a share with one decimal: "84.5 %".
pub(crate) fn in_percent(share: f64) -> String {
    format!("{:.1}\u{a0}%", 100.0 * share)
}

/// Formats an interval of shares in percent: "[82.7, 86.3]".
pub(crate) fn interval([low, high]: [f64; 2]) -> String {
    format!("[{:.1}, {:.1}]", 100.0 * low, 100.0 * high)
}

/// Returns "one sweep" or "3 sweeps".
pub(crate) fn sweeps(count: usize) -> String {
    match count {
        1 => "one sweep".into(),
        count => format!("{count} sweeps"),
    }
}

/// Returns the number of training sweeps of each material as the end of a description: ", 5 sweeps a material".
pub(crate) fn few_sweeps(shots: usize) -> String {
    format!(", {} a material", sweeps(shots))
}

/// Joins names that may contain commas: "a", "a and b", "a; b; c", "a; b; and 3 others".
pub(crate) fn listed(names: &[String]) -> String {
    match names {
        [] => String::new(),
        [one] => one.clone(),
        [one, two] => format!("{one} and {two}"),
        [one, two, three] => format!("{one}; {two}; {three}"),
        [one, two, others @ ..] => format!("{one}; {two}; and {} others", others.len()),
    }
}

/// Returns the sort key of a mean; means that only differ by rounding are equal.
pub(crate) fn rank(mean: f64) -> i64 {
    (1e9 * mean).round() as i64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_lists_of_names_are_cut_short() {
        let many: Vec<String> = (0..5).map(|k| k.to_string()).collect();
        assert_eq!(listed(&many), "0; 1; and 3 others");
        assert_eq!(listed(&many[..3]), "0; 1; 2");
    }
}
