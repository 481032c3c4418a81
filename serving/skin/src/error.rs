//! Errors of the table's section.

/// Errors of the section `[components.tactnet]`; each is one line for people.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SkinError {
    /// The section cannot be read: an unknown setting, a value of another kind.
    #[error("[components.tactnet]: {0}")]
    Section(String),
    /// A setting is out of range.
    #[error("[components.tactnet]: `{setting}`: {reason}")]
    Setting {
        /// Its name, with the names of the tables that it is in.
        setting: &'static str,
        /// Expected and found.
        reason: &'static str,
    },
}

impl SkinError {
    /// Returns true where the call or the table must be corrected (exit code 2), false where something broke (exit code 1).
    pub fn is_usage(&self) -> bool {
        match self {
            Self::Section(_) | Self::Setting { .. } => true,
        }
    }
}
