//! Room for text.

/// Mean width of a letter, user units.
const LETTER: f64 = 6.1;

/// Returns the room that the longest of `texts` takes in a figure, user units. It is an estimate: a wide font needs a fifth more.
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
