//! Sessions and calibrations as files.
//!
//! A session is JSON lines: the first says what it is, each other line is a picture, a rest or a turn.

use std::fs;
use std::io::{BufRead, BufReader, BufWriter, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use tactnet_catching::calibrate::{Calibration, Picture, Rest, Session, Turn};

/// Version of the format.
const VERSION: u32 = 1;

/// Why a file cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum SessionFileError {
    /// The system says no.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// What it says.
        source: std::io::Error,
    },
    /// A line that is not what it should be.
    #[error("{path}, line {line}: expected {expected}: {found}")]
    Line {
        /// The file.
        path: PathBuf,
        /// From 1.
        line: usize,
        /// What should be there.
        expected: &'static str,
        /// What is wrong.
        found: String,
    },
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    calibration_session: u32,
    robot_seconds: f64,
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Line {
    Picture(Picture),
    Rest(Rest),
    Turn(Turn),
}

/// Writes a session.
///
/// # Errors
/// Where the system says no.
pub fn write_session(path: &Path, session: &Session) -> Result<(), SessionFileError> {
    let written = || -> std::io::Result<()> {
        let mut file = BufWriter::new(fs::File::create(path)?);
        let mut line = |text: serde_json::Result<String>| writeln!(file, "{}", text?);
        line(serde_json::to_string(&Header {
            calibration_session: VERSION,
            robot_seconds: session.robot_seconds,
        }))?;
        for picture in &session.pictures {
            line(serde_json::to_string(&Line::Picture(*picture)))?;
        }
        for rest in &session.rests {
            line(serde_json::to_string(&Line::Rest(*rest)))?;
        }
        for turn in &session.turns {
            line(serde_json::to_string(&Line::Turn(*turn)))?;
        }
        file.flush()
    };
    written().map_err(|source| io(path, source))
}

/// Reads a session.
///
/// # Errors
/// Where there is no such file, and where a line is not what it should be.
pub fn read_session(path: &Path) -> Result<Session, SessionFileError> {
    let file = fs::File::open(path).map_err(|source| io(path, source))?;
    let wrong = |line: usize, expected, found: String| SessionFileError::Line {
        path: path.into(),
        line,
        expected,
        found,
    };
    let mut session = None;
    for (number, text) in (1..).zip(BufReader::new(file).lines()) {
        let text = text.map_err(|source| io(path, source))?;
        let Some(session) = &mut session else {
            let expected = "the head of a calibration session";
            let header: Header = serde_json::from_str(&text)
                .map_err(|error| wrong(number, expected, error.to_string()))?;
            if header.calibration_session != VERSION {
                let found = format!("version {}", header.calibration_session);
                return Err(wrong(number, "version 1", found));
            }
            session = Some(Session {
                robot_seconds: header.robot_seconds,
                ..Session::default()
            });
            continue;
        };
        let line = serde_json::from_str(&text)
            .map_err(|error| wrong(number, "a picture, rest or turn", error.to_string()))?;
        match line {
            Line::Picture(picture) => session.pictures.push(picture),
            Line::Rest(rest) => session.rests.push(rest),
            Line::Turn(turn) => session.turns.push(turn),
        }
    }
    session.ok_or_else(|| {
        let expected = "the head of a calibration session";
        wrong(1, expected, "an empty file".into())
    })
}

/// Puts a calibration in the place of the last good one: whole, or not at all.
///
/// # Errors
/// Where the system says no.
pub fn keep_calibration(path: &Path, calibration: &Calibration) -> Result<(), SessionFileError> {
    let mut beside = path.as_os_str().to_owned();
    beside.push(".new");
    let beside = PathBuf::from(beside);
    fs::write(&beside, calibration.to_toml()).map_err(|source| io(&beside, source))?;
    fs::rename(&beside, path).map_err(|source| io(path, source))
}

fn io(path: &Path, source: std::io::Error) -> SessionFileError {
    SessionFileError::Io {
        path: path.into(),
        source,
    }
}

#[cfg(test)]
mod tests {
    use tactnet_catching::calibrate::NeckMotion;

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
    fn a_session_comes_back_to_rounding() {
        let folder = tempfile();
        let path = folder.join("session.jsonl");
        write_session(&path, &session()).unwrap();
        let (wrote, read) = (session(), read_session(&path).unwrap());
        let features = |of: &Session| of.pictures[0].features[0].unwrap();
        for (wrote, read) in features(&wrote).iter().zip(features(&read)) {
            // The reader may be off by a bit.
            assert!((wrote - read).abs() <= 2.0 * f64::EPSILON * wrote.abs());
        }
        assert_eq!(read.pictures[0].arm, 1);
        assert_eq!(read.pictures[0].features[1], None);
        assert_eq!((read.rests.len(), read.turns.len()), (1, 1));
        assert_eq!((read.rests[0].samples, read.robot_seconds), (512, 12.5));
        let text = fs::read_to_string(&path).unwrap();
        fs::write(&path, text.replace("robot_seconds", "seconds")).unwrap();
        let error = read_session(&path).unwrap_err().to_string();
        assert!(
            error.contains("line 1") && error.contains("seconds"),
            "{error}"
        );
        fs::write(&path, format!("{text}{{\"picture\": 3}}\n")).unwrap();
        let error = read_session(&path).unwrap_err().to_string();
        assert!(error.contains("line 5"), "{error}");
        fs::remove_dir_all(folder).unwrap();
    }

    fn tempfile() -> PathBuf {
        let folder = std::env::temp_dir().join(format!("tactnet-session-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        folder
    }
}
