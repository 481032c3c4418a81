//! Frames of a continuous recording of any origin, read as a table of frames.

use std::path::Path;

use super::frame_table::{Column, FrameTable};
use super::named_sweeps::Labels;
use super::read_options::ReadOptions;
use super::to_classify::SweepsToClassify;
use crate::DataError;

/// Frames of one continuous recording.
///
/// ```
/// use tactnet_data::format::{FrameSeries, ReadOptions, Span, Windows};
///
/// let series = FrameSeries {
///     seconds: (0..300).map(|frame| f64::from(frame) / 100.0).collect(),
///     taxels: vec!["a".into(), "b".into()],
///     values: (0..600).map(|value| f64::from(value % 7)).collect(),
///     labels: Some((0..300).map(|frame| if frame < 150 { "felt" } else { "cork" }.into()).collect()),
/// };
/// let options = ReadOptions { windows: Some(Windows::of(Span::Seconds(0.5))), ..ReadOptions::default() };
/// let sweeps = series.into_sweeps("walk.mcap".as_ref(), &options)?;
/// assert_eq!((sweeps.dataset.len(), sweeps.dataset.shape().steps), (6, 50));
/// # Ok::<(), tactnet_data::DataError>(())
/// ```
#[derive(Debug, Clone, Default)]
pub struct FrameSeries {
    /// Times, in seconds: `[frames]`.
    pub seconds: Vec<f64>,
    /// Names of the taxels.
    pub taxels: Vec<String>,
    /// Values: `[frames][taxels]`.
    pub values: Vec<f64>,
    /// Materials, if they are known: `[frames]`.
    pub labels: Option<Vec<String>>,
}

impl FrameSeries {
    /// Returns the sweeps: windows if the options ask for them, otherwise all frames as one.
    ///
    /// - `path`: file of the recording, for names and messages
    ///
    /// # Errors
    /// Options that the recording does not allow; values that are not finite.
    pub fn into_sweeps(
        self,
        path: &Path,
        options: &ReadOptions,
    ) -> Result<SweepsToClassify, DataError> {
        let taxels = self.taxels.len();
        let column = |taxel: usize| {
            let of_taxel = self.values.iter().skip(taxel).step_by(taxels.max(1));
            Column::Numbers(of_taxel.copied().collect())
        };
        let mut columns = vec![("time [s]".to_owned(), Column::Numbers(self.seconds))];
        columns.extend(
            self.labels
                .map(|labels| ("material".to_owned(), Column::Words(labels))),
        );
        // A prefix: a taxel may have the name of a time or label.
        let names: Vec<String> = self
            .taxels
            .iter()
            .map(|name| format!("taxel {name}"))
            .collect();
        columns.extend(
            names
                .iter()
                .cloned()
                .enumerate()
                .map(|(taxel, name)| (name, column(taxel))),
        );
        let options = &ReadOptions {
            columns: names,
            ..options.clone()
        };
        let table = FrameTable {
            path,
            columns,
            lines: Vec::new(),
            findings: Vec::new(),
        };
        let sweeps = table
            .into_recordings(Labels::Optional, options)?
            .into_sweeps(options)?;
        SweepsToClassify::of_named(path, sweeps)?.refuse_non_finite(path)
    }
}
