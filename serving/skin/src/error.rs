//! Errors of the section `[components.tactnet]`.

/// Error in the section `[components.tactnet]` of the channel table.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SkinError {
    /// The section cannot be read: an unknown setting, or a value of the wrong type.
    #[error("[components.tactnet]: {0}")]
    Section(String),
    /// A setting is out of range.
    #[error("[components.tactnet]: `{setting}`: {reason}")]
    Setting {
        /// Name of the setting, with the names of its tables.
        setting: &'static str,
        /// The expected value.
        reason: &'static str,
    },
}

impl SkinError {
    /// Returns true if the caller must correct the table (exit code 2), false for other failures (exit code 1).
    ///
    /// # Example
    /// ```
    /// use tactnet_skin::ServeConfig;
    ///
    /// let no_finger = ServeConfig { fingers: vec![], ..ServeConfig::default() };
    /// let error = ServeConfig::of(&no_finger.table("robot")).unwrap_err();
    /// assert!(error.is_usage());
    /// ```
    pub fn is_usage(&self) -> bool {
        match self {
            Self::Section(_) | Self::Setting { .. } => true,
        }
    }
}
