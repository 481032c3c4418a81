//! The tactile channels in the Rerun viewer (<https://rerun.io>): live, from a recording, or the sweeps of a data set.
//!
//! | entity | content |
//! |---|---|
//! | `FINGER/heatmap` | `[rows, cols]` digits, 25 times a second |
//! | `FINGER/traces` | one line a taxel, every frame, digits |
//! | `FINGER/belief/bars` | the likeliest materials of the newest belief |
//! | `FINGER/belief/posterior` | one line a material, of every belief |
//! | `FINGER/belief/text` | the belief in words |
//! | `FINGER/latency/plain`, `…/dropout` | from the last frame to the belief, ms |
//! | `events` | what the classifier and the motion controller say |
//!
//! `FINGER` is the id of its channel. All of it lies on the timeline `time`, frames also on `frame`, their sequence number.

mod bars;
mod layout;
mod live;
mod scene;

use std::path::PathBuf;

pub use live::LiveView;
pub use scene::{Scene, Stretch, TimeOrigin};

/// Where the pictures go.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Target {
    /// A viewer that is started for it, on loopback; needs the program `rerun`.
    Viewer {
        /// Above this the viewer forgets the oldest, for example `2GB`.
        memory_limit: String,
    },
    /// A viewer that runs already, for example `rerun+http://127.0.0.1:9876/proxy`.
    Connect {
        /// Its address.
        url: String,
    },
    /// A file that the viewer opens.
    File {
        /// Its path, `.rrd`.
        path: PathBuf,
    },
}

/// One line for people.
#[derive(Debug, thiserror::Error)]
pub enum ViewError {
    /// There is no viewer to start.
    #[error(
        "no program `rerun` here; install it with `pip install rerun-sdk=={}`, or write a file with `--save`",
        VIEWER_VERSION
    )]
    NoViewer,
    /// The file is there already.
    #[error("{}: is there already; choose another name", path.display())]
    Exists {
        /// Its path.
        path: PathBuf,
    },
    /// The file cannot be written.
    #[error("{}: {reason}", path.display())]
    Write {
        /// Its path.
        path: PathBuf,
        /// What the viewer's library says.
        reason: String,
    },
    /// The viewer's library refuses.
    #[error("the Rerun viewer: {0}")]
    Rerun(String),
    /// The viewer was closed.
    #[error("the viewer has gone ({0})")]
    Gone(String),
}

/// The viewer that shows what this library writes; other versions may not.
pub const VIEWER_VERSION: &str = "0.36.3";

impl From<re_sdk::RecordingStreamError> for ViewError {
    fn from(error: re_sdk::RecordingStreamError) -> Self {
        match error {
            re_sdk::RecordingStreamError::SpawnViewer(
                re_sdk::SpawnError::ExecutableNotFoundInPath { .. },
            ) => Self::NoViewer,
            error => Self::Rerun(error.to_string()),
        }
    }
}
