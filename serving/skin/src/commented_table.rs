//! The table of channels as text, with a comment behind every setting.

use tactnet_channel::Table;

/// A setting of the table.
struct Setting {
    /// The part of the table that it is in; `channels` is each of them.
    section: &'static str,
    key: &'static str,
    /// What it sets, with its unit.
    comment: &'static str,
    /// A value for a setting that is left out, since it follows the network.
    example: Option<Example>,
}

/// A value that a setting may have.
enum Example {
    /// As it stands.
    Text(&'static str),
    /// The time of so many frames, milliseconds.
    Frames(u32),
}

impl Example {
    /// - `rate_hz`: frames a second
    fn text(&self, rate_hz: f64) -> String {
        match self {
            Self::Text(text) => (*text).into(),
            Self::Frames(frames) => {
                let ms = 1e3 * f64::from(*frames) / rate_hz;
                // As TOML has it, always with a decimal point.
                format!("{:?}", (1e3 * ms).round() / 1e3)
            }
        }
    }
}

const fn setting(section: &'static str, key: &'static str, comment: &'static str) -> Setting {
    Setting {
        section,
        key,
        comment,
        example: None,
    }
}

const fn follows(
    section: &'static str,
    key: &'static str,
    example: Example,
    comment: &'static str,
) -> Setting {
    Setting {
        section,
        key,
        comment,
        example: Some(example),
    }
}

const CLASSIFIER: &str = "components.tactnet";
const SEGMENTER: &str = "components.tactnet.segmenter";

const SETTINGS: [Setting; 41] = [
    setting(
        "",
        "bus",
        "name of the bus; buses of different names never meet",
    ),
    setting(
        "network",
        "host",
        "tells hosts apart that share one machine, in tests",
    ),
    setting(
        "network",
        "listen",
        "where the hub waits for other hosts, like \"tcp/10.0.0.2:7447\"",
    ),
    setting("network", "connect", "hubs of other hosts to connect to"),
    setting(
        "network",
        "authority",
        "PEM file of who vouches for this robot's hosts, for endpoints like \"tls/10.0.0.2:7447\"",
    ),
    setting(
        "network",
        "certificate",
        "PEM file of this host's certificate",
    ),
    setting(
        "network",
        "private_key",
        "PEM file of the key of this host's certificate",
    ),
    setting(
        "network",
        "plain_text",
        "endpoints beyond this machine may be without TLS",
    ),
    setting("channels", "packet", "type of its packets"),
    setting("channels", "version", "version of the type of its packets"),
    setting("channels", "item_bytes", "size of an item, bytes"),
    setting("channels", "items", "most items of a packet"),
    setting(
        "channels",
        "depth",
        "packets that wait at a get-port before the oldest is lost",
    ),
    setting("channels", "put_ports", "most ports that put"),
    setting("channels", "get_ports", "most ports that get"),
    setting(
        "channels",
        "history",
        "newest packets that a late joiner gets",
    ),
    setting(
        "channels",
        "held",
        "packets that a get-port may hold at once",
    ),
    setting(
        "channels",
        "loaned",
        "packets that a put-port may prepare at once",
    ),
    setting(
        "channels",
        "distributed",
        "whether other hosts get its packets",
    ),
    setting(
        "channels",
        "congestion",
        "when the network is too slow: \"drop\" packets or \"block\"",
    ),
    setting(
        "channels",
        "put_from",
        "hosts whose packets are taken, by the common name of their certificate [default: every host]",
    ),
    setting(
        "channels",
        "get_from",
        "hosts that may have its packets [default: every host]",
    ),
    setting(
        "channels",
        "remote_rate",
        "most packets a second from other hosts [default: 10000]",
    ),
    setting(
        CLASSIFIER,
        "fingers",
        "channels of skin frames, one a finger",
    ),
    setting(
        CLASSIFIER,
        "command",
        "channel of commands: start, stop, reset, enrol",
    ),
    setting(CLASSIFIER, "belief", "channel of beliefs"),
    setting(CLASSIFIER, "status", "channel of events and counters"),
    setting(
        CLASSIFIER,
        "model",
        "channel of the network's materials and shape",
    ),
    setting(
        CLASSIFIER,
        "anytime_ms",
        "time between beliefs during a sweep, milliseconds; 0: none",
    ),
    setting(
        CLASSIFIER,
        "mc_samples",
        "Monte Carlo dropout masks of the last belief; 0: none",
    ),
    follows(
        CLASSIFIER,
        "plain_deadline_ms",
        Example::Frames(1),
        "a belief without masks is late after, milliseconds; left out: one frame",
    ),
    follows(
        CLASSIFIER,
        "dropout_deadline_ms",
        Example::Frames(3),
        "a belief with masks is late after, milliseconds; left out: three frames",
    ),
    setting(
        SEGMENTER,
        "segmentation",
        "who begins sweeps: \"command\", or { contact = { begins = 10.0, ends = 5.0, frames = 8 } } by the mean value of a frame",
    ),
    setting(
        SEGMENTER,
        "skip",
        "frames skipped after the motion starts: the classifier's window begins behind them; 0 where a motion begins as the sweeps of the training data do",
    ),
    setting(
        SEGMENTER,
        "longest_gap",
        "lost frames in a row that are filled in",
    ),
    setting(
        SEGMENTER,
        "most_filled_in",
        "frames of a sweep that may be filled in",
    ),
    setting(
        SEGMENTER,
        "clock_tolerance",
        "how far the sensor's clock may be off between two frames, periods",
    ),
    setting(
        SEGMENTER,
        "clock_drift",
        "how far the sensor's clock may be off over a whole sweep, periods",
    ),
    setting(
        SEGMENTER,
        "stalled_frames",
        "a taxel with the same value, other than 0, for so many frames is stalled",
    ),
    follows(
        SEGMENTER,
        "values",
        Example::Text("[0.0, 255.0]"),
        "least and greatest value of a taxel, others reject the sweep; left out: 0 to 255 if the network's training sweeps lie within, else their range and as much again on either side",
    ),
    setting(
        SEGMENTER,
        "saturated_frames",
        "a taxel at the greatest value for so many frames is saturated",
    ),
];

/// Returns the table as TOML, every setting with its comment. Settings that are left out, since they follow the network, stand there as comments.
///
/// - `rate_hz`: frames a second of the network that such settings follow
///
/// # Errors
/// Settings of components that TOML cannot hold.
pub fn commented(table: &Table, rate_hz: f64) -> Result<String, toml::ser::Error> {
    let mut out = Vec::new();
    let mut section = "";
    let text = toml::to_string(table)?;
    let mut lines = text.lines().peekable();
    while let Some(line) = lines.next() {
        if let Some(name) = line.strip_prefix('[') {
            section = match name.trim_end_matches(']') {
                name if name.starts_with("channels.") => "channels",
                name => name,
            };
            out.push(line.into());
        } else if let Some((key, _)) = line.split_once(" = ") {
            out.push(match find(section, key) {
                Some(setting) => format!("{line:<32} # {}", setting.comment),
                None => line.into(),
            });
        } else {
            out.push(line.into());
        }
        let ends = lines.peek().is_none_or(|next| next.is_empty());
        if ends && !line.is_empty() {
            let given = |key: &str| {
                let here = out.iter().rev().take_while(|line| !line.starts_with('['));
                here.into_iter().any(|line| line.starts_with(key))
            };
            let left_out: Vec<String> = SETTINGS
                .iter()
                .filter(|setting| setting.section == section && !given(setting.key))
                .filter_map(|setting| {
                    let example = setting.example.as_ref()?.text(rate_hz);
                    let assigned = format!("# {} = {example}", setting.key);
                    Some(format!("{assigned:<32} # {}", setting.comment))
                })
                .collect();
            out.extend(left_out);
        }
    }
    Ok(out.join("\n"))
}

fn find(section: &str, key: &str) -> Option<&'static Setting> {
    SETTINGS
        .iter()
        .find(|setting| setting.section == section && setting.key == key)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ServeConfig;

    #[test]
    fn every_setting_has_a_comment_and_the_table_is_read_as_it_was() {
        let mut config = ServeConfig::default();
        for values in [None, Some([-3.5, 9.0])] {
            config.segmenter.values = values;
            let table = config.table("robot");
            let text = commented(&table, 750.0).unwrap();
            assert_eq!(Table::parse(&text).unwrap(), table);
            for line in text.lines().filter(|line| line.contains(" = ")) {
                assert!(line.contains(" # "), "{line}");
            }
            assert_eq!(text.contains("\n# values = [0.0, 255.0]"), values.is_none());
            assert!(text.contains("\n# plain_deadline_ms = 1.333"), "{text}");
            assert!(text.contains("\n# dropout_deadline_ms = 4.0 "), "{text}");
            let slower = commented(&table, 500.0).unwrap();
            assert!(slower.contains("\n# plain_deadline_ms = 2.0 "), "{slower}");
            assert!(
                slower.contains("\n# dropout_deadline_ms = 6.0 "),
                "{slower}"
            );
            assert_eq!(text.matches("# least and greatest").count(), 1, "{text}");
        }
    }
}
