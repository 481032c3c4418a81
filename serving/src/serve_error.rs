//! What can go wrong while serving.

use std::path::PathBuf;

/// One line for people.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The channels.
    #[error(transparent)]
    Channel(#[from] tactnet_channel::ChannelError),
    /// The classifier.
    #[error(transparent)]
    Pipeline(#[from] tactnet_pipeline::PipelineError),
    /// The device.
    #[error(transparent)]
    Model(#[from] tactnet_models::ModelError),
    /// The table's section of the classifier.
    #[error(transparent)]
    Skin(#[from] tactnet_skin::SkinError),
    /// More materials than packets hold.
    #[error("`{material}` would be material {number}, packets hold {most}")]
    TooManyMaterials {
        /// The material that was to be learnt.
        material: String,
        /// Its number, from 1.
        number: usize,
        /// Materials of a packet.
        most: usize,
    },
    /// A model that cannot serve.
    #[error("{}: cannot serve: {reason}", path.display())]
    Unfit {
        /// Its run directory.
        path: PathBuf,
        /// Why not.
        reason: String,
    },
    /// A folder without models.
    #[error("{}: no model; expected run directories with numbers for names", folder.display())]
    NoVersion {
        /// The folder.
        folder: PathBuf,
    },
    /// The system refused something.
    #[error("{}: {source}", path.display())]
    Io {
        /// What it was about.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
}
