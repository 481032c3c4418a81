//! Destination of the pictures: a viewer or a file.

use std::fs::File;
use std::io::ErrorKind;
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use re_sdk::external::re_log_encoding::rrd::FileSinkOptions;
use re_sdk::sink::FileSink;
use re_sdk::{RecordingStream, RecordingStreamBuilder};

use super::Play;
use crate::RecordingError;

/// Program of the viewer.
const PROGRAM: &str = "rerun";
/// Memory limit of its server, which keeps data for viewers that join later.
const SERVER_KEEPS: &str = "256MB";
/// Timeout of a viewer's start, enough for a busy machine.
const STARTED: Duration = Duration::from_secs(60);

/// Destination of the pictures.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Target {
    /// A viewer that is started on loopback; needs the program `rerun`.
    Viewer {
        /// Memory limit above which the viewer drops the oldest data, for example `2GB`.
        memory_limit: String,
    },
    /// A running viewer, for example `rerun+http://127.0.0.1:9876/proxy`.
    Connect {
        /// Address of the viewer.
        url: String,
    },
    /// A file that the viewer can open.
    File {
        /// Path ending in `.rrd`; must not exist.
        path: PathBuf,
    },
}

impl Target {
    /// Opens a stream.
    pub(super) fn open(
        &self,
        builder: RecordingStreamBuilder,
        play: Play,
    ) -> Result<RecordingStream, RecordingError> {
        let stream = match self {
            Self::Viewer { memory_limit } => {
                let port = start_viewer(memory_limit)?;
                builder.connect_grpc_opts(format!("rerun+http://127.0.0.1:{port}/proxy"))?
            }
            Self::Connect { url } => builder.connect_grpc_opts(url.as_str())?,
            Self::File { path } => {
                File::create_new(path).map_err(|source| RecordingError::Io {
                    path: path.clone(),
                    source,
                })?;
                // No manifest at the end of the file: it is kept in memory until then, which long recordings cannot
                // afford.
                let options = FileSinkOptions {
                    write_footer: play == Play::FromBeginning,
                };
                let sink = FileSink::with_options(path, options)
                    .map_err(|error| self.broken(&error.to_string()))?;
                builder.set_sinks((sink,))?
            }
        };
        if !stream.is_enabled() {
            return Err(RecordingError::Viewer(
                "it is switched off (the environment variable RERUN)".into(),
            ));
        }
        Ok(stream)
    }

    /// Returns the error of a viewer or file that stopped accepting data.
    pub(super) fn broken(&self, reason: &str) -> RecordingError {
        match self {
            Self::File { path } => RecordingError::Unwritten {
                path: path.clone(),
                reason: reason.into(),
            },
            _ => RecordingError::ViewerGone(reason.into()),
        }
    }

    /// Returns the error of a viewer or file that never accepted data.
    pub(super) fn absent(&self, reason: &str) -> RecordingError {
        match self {
            Self::Connect { url } => RecordingError::NoViewerAt {
                url: url.clone(),
                reason: reason.into(),
            },
            _ => self.broken(reason),
        }
    }
}

/// Starts a viewer that survives this program, waits until it listens, and returns its port.
fn start_viewer(memory_limit: &str) -> Result<u16, RecordingError> {
    let failed = |reason: String| RecordingError::Viewer(reason);
    let free = TcpListener::bind((Ipv4Addr::LOCALHOST, 0));
    let port = free
        .and_then(|free| Ok(free.local_addr()?.port()))
        .map_err(|error| failed(error.to_string()))?;
    let mut command = Command::new(PROGRAM);
    command
        .args(["--bind=127.0.0.1", "--expect-data-soon"])
        .arg(format!("--port={port}"))
        .arg(format!("--memory-limit={memory_limit}"))
        .arg(format!("--server-memory-limit={SERVER_KEEPS}"))
        .stdin(Stdio::null())
        .stdout(Stdio::null());
    #[cfg(unix)]
    {
        use std::os::unix::process::CommandExt;
        // Ctrl-C ends this program, but not the viewer.
        command.process_group(0);
    }
    let mut viewer = command.spawn().map_err(|error| match error.kind() {
        ErrorKind::NotFound => RecordingError::NoViewer,
        _ => failed(error.to_string()),
    })?;
    let begun = Instant::now();
    while TcpStream::connect((Ipv4Addr::LOCALHOST, port)).is_err() {
        if let Ok(Some(status)) = viewer.try_wait() {
            return Err(failed(format!("it exited at once ({status})")));
        }
        if begun.elapsed() > STARTED {
            let _ = viewer.kill();
            return Err(failed(format!("it does not listen after {STARTED:?}")));
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    Ok(port)
}
