//! Colours and style sheet of figures.

/// Rules of the CSS classes of figures. Their colours are the variables of [`theme`].
pub const STYLE: &str = include_str!("plot.css");

/// Name, colour on a light background, colour on a dark background.
const COLOURS: [(&str, &str, &str); 14] = [
    ("ground", "#fcfcfa", "#16181a"),
    ("ink", "#1c1e20", "#e7e5e0"),
    ("muted", "#55595e", "#abafb4"),
    ("rule", "#d5d5cf", "#3c4045"),
    ("heat", "#0b3d73", "#8ecbff"),
    ("cell", "#eeeeea", "#24282c"),
    ("s0", "#14588c", "#79b8ec"),
    ("s1", "#b4510a", "#f0a04f"),
    ("s2", "#1a7553", "#5fc79c"),
    ("s3", "#854b9b", "#cda3df"),
    ("s4", "#b02a3c", "#f38d93"),
    ("s5", "#75582c", "#d0b07c"),
    ("s6", "#00727f", "#5ecad6"),
    ("s7", "#53575c", "#b6babf"),
];

/// Returns the colours of figures as CSS variables, with dark ones if the reader prefers them.
///
/// `--ground` and `--ink` are background and text, `--muted` secondary text, `--rule` grid lines, `--heat` and `--cell`
/// heat maps and their background, `--s0` to `--s7` the series.
pub fn theme() -> String {
    let light: String = COLOURS
        .iter()
        .map(|(name, light, _)| format!(" --{name}: {light};"))
        .collect();
    let dark: String = COLOURS
        .iter()
        .map(|(name, _, dark)| format!(" --{name}: {dark};"))
        .collect();
    // Printed pages are light.
    format!(
        ":root {{{light} }}\n@media screen and (prefers-color-scheme: dark) {{ :root {{{dark} }} }}\n"
    )
}

/// Returns the style of a stand-alone file: light, and without CSS variables, which not all SVG viewers support.
pub(crate) fn plain_style() -> String {
    COLOURS
        .iter()
        .fold(STYLE.to_string(), |style, (name, light, _)| {
            style.replace(&format!("var(--{name})"), light)
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_variable_of_the_style_has_a_colour() {
        assert!(STYLE.contains("var(--s7)"));
        let plain = plain_style();
        assert!(!plain.contains("var("), "{plain}");
    }

    #[test]
    fn the_style_may_stand_in_xml() {
        assert!(!STYLE.contains(['<', '&']));
    }

    #[test]
    fn the_theme_has_both_grounds() {
        let theme = theme();
        assert!(theme.contains("--s0: #14588c;") && theme.contains("--s0: #79b8ec;"));
        assert_eq!(theme.matches('{').count(), theme.matches('}').count());
    }
}
