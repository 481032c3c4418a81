//! Names of materials: their normal form, and names that look alike.

use unicode_normalization::UnicodeNormalization;

/// Letters of the Cyrillic and Greek scripts, each with the Latin letter that looks the same.
const LOOK_ALIKES: [(&str, &str); 5] = [
    // Cyrillic capitals and small letters.
    ("АВЕЅІЈКМНОРСТУХ", "ABESIJKMHOPCTYX"),
    ("аеѕіјорсухһԁԛԝ", "aesijopcyxhdqw"),
    // Greek capitals and small letters.
    ("ΑΒΕΖΗΙΚΜΝΟΡΤΥΧ", "ABEZHIKMNOPTYX"),
    ("ονι", "ovi"),
    // Latin letters beyond ASCII.
    ("ıɑɡ", "iag"),
];

/// Returns a name in Unicode's composed form (NFC): macOS writes `ü` in names of files as two characters, other systems
/// as one.
///
/// ```
/// assert_eq!(tactnet_data::normal_name("gru\u{308}n"), "gr\u{fc}n");
/// ```
pub fn normal_name(name: &str) -> String {
    name.nfc().collect()
}

/// Returns a name in lower case, without white space and invisible characters.
pub(crate) fn plain_name(name: &str) -> String {
    let visible = name.nfc().filter(|letter| !is_invisible(*letter));
    let lower = visible.flat_map(char::to_lowercase);
    lower.filter(|letter| !letter.is_whitespace()).collect()
}

/// Returns a name with Latin letters in place of those that look the same, and wide or raised letters as plain ones, as
/// [`plain_name`]. Names that look alike have the same skeleton.
pub(crate) fn skeleton(name: &str) -> String {
    let latin = |letter: char| {
        let pairs = LOOK_ALIKES.iter();
        let mut pairs = pairs.flat_map(|(from, to)| from.chars().zip(to.chars()));
        let pair = pairs.find(|(from, _)| *from == letter);
        pair.map_or(letter, |(_, to)| to)
    };
    plain_name(&name.nfkc().map(latin).collect::<String>())
}

/// Returns true for characters without width, which make equal names different.
pub(crate) fn is_invisible(letter: char) -> bool {
    matches!(
        letter,
        '\u{ad}'
            | '\u{34f}'
            | '\u{61c}'
            | '\u{115f}'
            | '\u{1160}'
            | '\u{180e}'
            | '\u{200b}'..='\u{200f}'
            | '\u{2060}'..='\u{2064}'
            | '\u{3164}'
            | '\u{fe00}'..='\u{fe0f}'
            | '\u{feff}'
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_look_alike_has_its_letter() {
        for (from, to) in LOOK_ALIKES {
            assert_eq!(from.chars().count(), to.chars().count(), "{from}");
            assert!(from.chars().all(|letter| !letter.is_ascii()), "{from}");
            assert!(to.is_ascii(), "{to}");
        }
    }

    #[test]
    fn names_that_look_alike_have_one_skeleton() {
        for (one, other) in [
            ("cork", "c\u{43e}rk"),
            ("CORK", "\u{421}ORK"),
            ("Cork", "c\u{43e}rk"),
            ("cork", "co\u{200b}rk"),
            ("cork", "\u{feff}cork"),
            ("NYLON", "\u{39d}YLON"),
            ("cork 2", "cork\u{a0}2"),
            ("felt", "\u{ff46}\u{ff45}\u{ff4c}\u{ff54}"),
            ("\u{43a}\u{43e}\u{436}\u{430}", "\u{43a}o\u{436}\u{430}"),
        ] {
            assert_eq!(skeleton(one), skeleton(other), "{one} {other:?}");
        }
        for (one, other) in [
            ("cork", "fork"),
            ("grun", "gr\u{fc}n"),
            ("\u{432}\u{43e}\u{43b}", "\u{431}\u{43e}\u{43b}"),
            ("cork 1", "cork l"),
        ] {
            assert_ne!(skeleton(one), skeleton(other), "{one} {other}");
        }
    }
}
