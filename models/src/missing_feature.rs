//! Error of a build without an optional part.

/// Error if the build lacks a cargo feature.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("this program was built without the cargo feature `{feature}`")]
pub struct MissingFeature {
    /// Name of the cargo feature.
    pub feature: &'static str,
}
