//! The channel table as TOML text with a comment after every setting.

use tactnet_channel::Table;

/// Comment on one setting of the table.
struct Setting {
    /// Section of the setting; `channels` stands for the section of any channel.
    section: &'static str,
    key: &'static str,
    /// Meaning of the setting, with its unit.
    comment: &'static str,
    /// Example value of a setting that is absent by default because it follows the network.
    example: Option<Example>,
}

/// Example value of a setting.
enum Example {
    /// Literal TOML.
    Text(&'static str),
    /// Duration of this many frames, in ms.
    Frames(u32),
}

impl Example {
    /// Returns the value as TOML.
    ///
    /// - `rate_hz`: frames per second
    fn text(&self, rate_hz: f64) -> String {
        match self {
            Self::Text(text) => (*text).into(),
            Self::Frames(frames) => {
                let ms = 1e3 * f64::from(*frames) / rate_hz;
                // TOML floats always have a decimal point.
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

const SETTINGS: [Setting; 44] = [
    setting(
        "",
        "bus",
        "name of the bus; buses of different names never meet",
    ),
    setting(
        "network",
        "host",
        "name of this host; tests use it to run several hosts on one machine",
    ),
    setting(
        "network",
        "listen",
        "address on which the hub listens for other hosts, for example \"tcp/10.0.0.2:7447\"",
    ),
    setting("network", "connect", "hubs of other hosts to connect to"),
    setting(
        "network",
        "authority",
        "PEM file of the certificate authority of this robot's hosts, for endpoints such as \"tls/10.0.0.2:7447\"",
    ),
    setting(
        "network",
        "certificate",
        "PEM file of this host's certificate",
    ),
    setting(
        "network",
        "private_key",
        "PEM file of the private key of this host's certificate",
    ),
    setting(
        "network",
        "plain_text",
        "allows endpoints on other machines without TLS",
    ),
    setting("channels", "packet", "packet type"),
    setting("channels", "version", "version of the packet type"),
    setting("channels", "item_bytes", "size of an item, in bytes"),
    setting("channels", "items", "maximum number of items per packet"),
    setting(
        "channels",
        "depth",
        "queue length of a get-port, in packets; when it is full, the oldest is dropped",
    ),
    setting("channels", "put_ports", "maximum number of put-ports"),
    setting("channels", "get_ports", "maximum number of get-ports"),
    setting(
        "channels",
        "history",
        "number of newest packets that a late subscriber receives",
    ),
    setting(
        "channels",
        "held",
        "maximum number of packets that a get-port may hold at once",
    ),
    setting(
        "channels",
        "loaned",
        "maximum number of packets that a put-port may prepare at once",
    ),
    setting(
        "channels",
        "distributed",
        "true if other hosts receive the packets",
    ),
    setting(
        "channels",
        "congestion",
        "behaviour when the network is too slow: \"drop\" or \"block\"",
    ),
    setting(
        "channels",
        "put_from",
        "hosts allowed to send, by the common name of their certificate [default: every host]",
    ),
    setting(
        "channels",
        "get_from",
        "hosts allowed to receive, by the common name of their certificate [default: every host]",
    ),
    setting(
        "channels",
        "remote_rate",
        "maximum rate from other hosts, in packets per second [default: 10000]",
    ),
    setting(
        CLASSIFIER,
        "fingers",
        "channels of skin frames, one per finger",
    ),
    setting(
        CLASSIFIER,
        "command",
        "channel of commands: start, stop, reset, enroll",
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
        "time between beliefs during a sweep, in ms; 0 disables them",
    ),
    setting(
        CLASSIFIER,
        "mc_samples",
        "number of Monte Carlo dropout masks of the final belief; 0 disables dropout",
    ),
    setting(
        CLASSIFIER,
        "dead",
        "dead taxels of every finger, counted from 0 row by row, which are masked from the start",
    ),
    setting(
        CLASSIFIER,
        "mask_dead",
        "true: masks further taxels that change in none of three sweeps in succession, but in 99 % of the training sweeps, until they change again",
    ),
    follows(
        CLASSIFIER,
        "plain_deadline_ms",
        Example::Frames(1),
        "deadline of a plain belief after the sweep's last frame, in ms [default: one frame period]",
    ),
    follows(
        CLASSIFIER,
        "dropout_deadline_ms",
        Example::Frames(3),
        "deadline of a dropout belief after the sweep's last frame, in ms [default: three frame periods]",
    ),
    setting(
        SEGMENTER,
        "segmentation",
        "start of sweeps: \"command\", or { contact = { begins = 10.0, ends = 5.0, frames = 8 } } by the mean value of a frame",
    ),
    setting(
        SEGMENTER,
        "skip",
        "time or number of frames between the start of the motion and the window, such as \"333ms\"; 0 if motions start where the training sweeps start",
    ),
    follows(
        SEGMENTER,
        "longest",
        Example::Text("\"4s\""),
        "longest window: longer sweeps than the training sweeps are classified when they end, as the mean over windows [default: the length of the longest training sweep]",
    ),
    setting(
        SEGMENTER,
        "longest_gap",
        "longest run of lost frames that is interpolated, in frames, or a time such as \"4ms\"",
    ),
    setting(
        SEGMENTER,
        "most_filled_in",
        "maximum of interpolated frames in a sweep, or a time",
    ),
    setting(
        SEGMENTER,
        "clock_tolerance",
        "tolerance of the sensor's clock between two frames, in frame periods",
    ),
    setting(
        SEGMENTER,
        "clock_drift",
        "tolerance of the sensor's clock over a whole sweep, in frame periods",
    ),
    setting(
        SEGMENTER,
        "stalled_frames",
        "consecutive frames with the same nonzero value, or a time, after which a taxel is stalled",
    ),
    follows(
        SEGMENTER,
        "values",
        Example::Text("[0.0, 255.0]"),
        "minimum and maximum value of a taxel, others reject the sweep [default: 0 to 255 if the training sweeps lie within, else their range extended by its width on both sides]",
    ),
    setting(
        SEGMENTER,
        "saturated_frames",
        "consecutive frames at the maximum value, or a time, after which a taxel is saturated",
    ),
];

/// Returns the table as TOML with a comment on every setting. Absent settings that follow the network appear as comments.
///
/// - `rate_hz`: sample rate of the network, in frames per second
///
/// # Errors
/// Fails if a component has settings that TOML cannot represent.
///
/// # Example
/// ```
/// use tactnet_skin::{ServeConfig, commented};
///
/// let text = commented(&ServeConfig::default().table("robot"), 750.0).unwrap();
/// assert!(text.starts_with("bus = \"robot\""));
/// ```
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
                here.into_iter()
                    .any(|line| line.split(" = ").next() == Some(key))
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
            assert!(text.contains("\n# longest = \"4s\""), "{text}");
            assert!(text.contains("\n# dropout_deadline_ms = 4.0 "), "{text}");
            let slower = commented(&table, 500.0).unwrap();
            assert!(slower.contains("\n# plain_deadline_ms = 2.0 "), "{slower}");
            assert!(
                slower.contains("\n# dropout_deadline_ms = 6.0 "),
                "{slower}"
            );
            assert_eq!(text.matches("# minimum and maximum").count(), 1, "{text}");
        }
    }
}
