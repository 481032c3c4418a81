//! Width of text.

/// Mean width of a letter, user units.
const LETTER: f64 = 6.1;

/// Returns the estimated width of the longest of `texts` in a figure, user units. Wide fonts need a fifth more.
pub fn text_width<S: AsRef<str>>(texts: &[S]) -> f64 {
    let longest = texts.iter().map(|text| text.as_ref().chars().count()).max();
    LETTER * longest.unwrap_or(0) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longest_text_decides() {
        assert_eq!(text_width(&["a", "µµµ"]), 3.0 * LETTER);
        assert_eq!(text_width::<&str>(&[]), 0.0);
    }
}
