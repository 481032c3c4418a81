//! Selection of a table's channels by name or pattern.

use tactnet_channel::Table;

use crate::RecordingError;

/// Returns the table with only the channels that match one of the patterns, in which `*` stands for any characters.
/// Without patterns, returns all channels.
///
/// # Errors
/// A pattern that no channel matches.
///
/// ```
/// use tactnet_channel::{ChannelConfig, Table};
/// use tactnet_recording::select_channels;
///
/// let ids = ["skin/left", "skin/right", "tactile/belief"];
/// let table = ids.iter().fold(Table::new("lab"), |table, id| table.with(id, ChannelConfig::of::<f32>(1)));
/// let selected = select_channels(&table, &["skin/*".into()])?;
/// assert_eq!(selected.channels.keys().collect::<Vec<_>>(), ["skin/left", "skin/right"]);
/// assert!(select_channels(&table, &["arm/*".into()]).is_err());
/// # Ok::<_, tactnet_recording::RecordingError>(())
/// ```
pub fn select_channels(table: &Table, patterns: &[String]) -> Result<Table, RecordingError> {
    let mut selected = table.clone();
    for pattern in patterns {
        if !table.channels.keys().any(|id| matches(pattern, id)) {
            return Err(RecordingError::NoChannel {
                channel: pattern.clone(),
            });
        }
    }
    if !patterns.is_empty() {
        let is_selected = |id: &str| patterns.iter().any(|pattern| matches(pattern, id));
        selected.channels.retain(|id, _| is_selected(id));
    }
    Ok(selected)
}

/// Returns true if the id matches the pattern.
fn matches(pattern: &str, id: &str) -> bool {
    let Some((first, rest)) = pattern.split_once('*') else {
        return pattern == id;
    };
    let Some(id) = id.strip_prefix(first) else {
        return false;
    };
    (0..=id.len()).any(|skipped| id.is_char_boundary(skipped) && matches(rest, &id[skipped..]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_star_stands_for_any_characters() {
        for pattern in [
            "skin/left",
            "*",
            "skin/*",
            "*left",
            "s*/l*t",
            "skin/left*",
            "**",
        ] {
            assert!(matches(pattern, "skin/left"), "{pattern}");
        }
        for pattern in ["", "skin", "skin/right", "*right", "s*x", "left*"] {
            assert!(!matches(pattern, "skin/left"), "{pattern}");
        }
    }
}
