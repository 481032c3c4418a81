//! Calibration sessions as MCAP files, from which a calibration can be repeated.
//!
//! | topic | message, JSON |
//! |---|---|
//! | `calibration/session` | version and duration of the session on the robot; first message |
//! | `calibration/picture` | [`Picture`](tactnet_catching::calibrate::Picture) |
//! | `calibration/rest` | [`Rest`](tactnet_catching::calibrate::Rest) |
//! | `calibration/turn` | [`Turn`](tactnet_catching::calibrate::Turn) |
//!
//! Message times are sequence numbers, because a session has no clock.

use std::path::Path;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use tactnet_catching::calibrate::Session;
use tactnet_recording::{JsonMessage, RecordingError, read_json_messages, write_json_messages};

const VERSION: u32 = 1;

const HEAD: &str = "calibration/session";
const PICTURE: &str = "calibration/picture";
const REST: &str = "calibration/rest";
const TURN: &str = "calibration/turn";

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Head {
    version: u32,
    /// Duration of the session on the robot, in s.
    robot_seconds: f64,
}

/// Writes a session to a new file.
///
/// # Errors
/// A file that exists or cannot be written.
pub fn write_session(path: &Path, session: &Session) -> Result<(), RecordingError> {
    let head = Head {
        version: VERSION,
        robot_seconds: session.robot_seconds,
    };
    let pictures = session.pictures.iter().map(|it| (PICTURE, text(it)));
    let rests = session.rests.iter().map(|it| (REST, text(it)));
    let turns = session.turns.iter().map(|it| (TURN, text(it)));
    let messages = std::iter::once((HEAD, text(&head)))
        .chain(pictures)
        .chain(rests)
        .chain(turns);
    let numbered = (0..).zip(messages);
    write_json_messages(
        path,
        numbered.map(|(time_ns, (topic, text))| JsonMessage {
            topic: topic.into(),
            time_ns,
            text,
        }),
    )
}

/// Reads a session.
///
/// # Errors
/// A file that is damaged or not a session, or an invalid message.
pub fn read_session(path: &Path) -> Result<Session, RecordingError> {
    let unreadable = |reason: String| RecordingError::Unreadable {
        path: path.into(),
        reason,
    };
    let mut messages = read_json_messages(path)?.into_iter().enumerate();
    let head = messages.next().filter(|(_, first)| first.topic == HEAD);
    let Some((_, head)) = head else {
        return Err(unreadable(
            "expected a calibration session, found none".into(),
        ));
    };
    let head: Head = parse(0, &head).map_err(unreadable)?;
    if head.version != VERSION {
        return Err(unreadable(format!(
            "expected version {VERSION} of a calibration session, found {}",
            head.version
        )));
    }
    let mut session = Session {
        robot_seconds: head.robot_seconds,
        ..Session::default()
    };
    for (number, message) in messages {
        let taken = match message.topic.as_str() {
            PICTURE => parse(number, &message).map(|it| session.pictures.push(it)),
            REST => parse(number, &message).map(|it| session.rests.push(it)),
            TURN => parse(number, &message).map(|it| session.turns.push(it)),
            // Messages of later versions or of other programs are ignored.
            _ => Ok(()),
        };
        taken.map_err(unreadable)?;
    }
    Ok(session)
}

fn text(message: &impl Serialize) -> String {
    serde_json::to_string(message).unwrap_or_else(|error| panic!("plain numbers: {error}"))
}

fn parse<T: DeserializeOwned>(number: usize, message: &JsonMessage) -> Result<T, String> {
    serde_json::from_str(&message.text)
        .map_err(|error| format!("message {number}, `{}`: {error}", message.topic))
}

#[cfg(test)]
mod tests {
    use tactnet_catching::calibrate::{NeckMotion, Picture, Rest, Turn};

    use super::*;

    fn session() -> Session {
        Session {
            pictures: vec![Picture {
                configuration: 2,
                arm: 1,
                features: [Some([1.25, 0.1 + 0.2]), None],
                q: [0.1; 7],
                loads: [1.0 / 3.0; 7],
                neck: NeckMotion::standing([0.1, -0.2]),
            }],
            rests: vec![Rest {
                neck: [0.0, 0.1],
                acceleration: [0.0, 0.1, 9.8],
                rate: [1e-9, 0.0, 0.0],
                samples: 512,
            }],
            turns: vec![Turn {
                neck: NeckMotion::standing([0.0; 2]),
                rate: [0.1, 0.2, 0.3],
            }],
            robot_seconds: 12.5,
        }
    }

    #[test]
    fn a_session_comes_back() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("session.mcap");
        write_session(&path, &session()).unwrap();
        let (found, recorded) = (read_session(&path).unwrap(), session());
        assert_eq!(found.rests, recorded.rests);
        assert_eq!(found.turns, recorded.turns);
        assert_eq!(found.robot_seconds, recorded.robot_seconds);
        let (found, recorded) = (&found.pictures[0], &recorded.pictures[0]);
        assert_eq!(found.configuration, recorded.configuration);
        // The JSON parser may be wrong in the last bit.
        let error = found.loads[0] - recorded.loads[0];
        assert!(error.abs() <= f64::EPSILON, "{error}");
    }

    #[test]
    fn what_is_no_session_is_said() {
        let dir = tempfile::tempdir().unwrap();
        let refused = |name: &str, messages: &[(&str, &str)]| {
            let path = dir.path().join(name);
            let messages = messages.iter().map(|(topic, text)| JsonMessage {
                topic: (*topic).into(),
                time_ns: 0,
                text: (*text).into(),
            });
            write_json_messages(&path, messages).unwrap();
            read_session(&path).unwrap_err().to_string()
        };
        let head = (HEAD, r#"{"version":1,"robot_seconds":1.0}"#);
        let cases = [
            (refused("a", &[]), "expected a calibration session"),
            (
                refused("b", &[("other", "{}")]),
                "expected a calibration session",
            ),
            (
                refused("c", &[(HEAD, r#"{"version":7,"robot_seconds":1.0}"#)]),
                "expected version 1 of a calibration session, found 7",
            ),
            (
                refused("d", &[head, (PICTURE, r#"{"arm":"left"}"#)]),
                "message 1, `calibration/picture`",
            ),
        ];
        for (found, expected) in cases {
            assert!(found.contains(expected), "{found}");
        }
    }
}
