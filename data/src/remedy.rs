//! Cures of errors and findings.

/// Cure of an error or a finding that the caller can apply.
///
/// Messages of this crate say what was expected and what was found. A front end adds the cure in its own words: the command line names
/// an option, the Python package names an argument.
///
/// ```
/// use tactnet_data::{DataError, Remedy};
///
/// let error = DataError::inconsistent("sweeps", "a sample rate", "none").with_remedy(Remedy::NameRate);
/// assert_eq!(error.to_string(), "sweeps: expected a sample rate, found none");
/// assert_eq!(error.remedy(), Some(Remedy::NameRate));
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Remedy {
    /// Name the sample rate, which the data does not name.
    NameRate,
    /// Name the material of all sweeps, or only classify them.
    NameLabels,
    /// Name the array or feature that holds the samples.
    NameSamples,
    /// Arrange the taxels as a grid.
    NameShape {
        /// Rows of the grid that is closest to a square.
        rows: usize,
        /// Columns of that grid.
        cols: usize,
    },
    /// Keep the length of every sweep, or the first frames of all.
    KeepLengths {
        /// Number of frames of the shortest sweep.
        steps: usize,
    },
    /// Keep the first frames of every sweep.
    KeepSteps {
        /// Number of frames to keep.
        steps: usize,
    },
    /// Convert the data set to one with frames at one rate.
    Resample,
    /// Cut continuous recordings into windows, between the gaps and changes of the label.
    CutWindows,
    /// Leave out the frames with an empty label.
    DropUnlabelled,
    /// Subtract a fixed offset from each taxel, the same one in all data, before values are narrowed to 32-bit floats.
    SubtractOffset,
    /// Choose another number of folds, or hold out a part of the sweeps.
    ChooseFolds,
    /// Split so that sweeps of one recording block stay together.
    LeaveBlocksOut,
    /// Check the data set, which lists all findings.
    ListFindings {
        /// Name or file of the data set.
        data: String,
    },
    /// Convert the recording to a data set.
    ConvertRecording,
    /// Download the file by hand, then pass its path or convert it.
    PassDownloadedFile,
}
