//! Number of frames of each sweep that are read.

use std::path::Path;

use crate::{DataError, Remedy};

/// Frames of each sweep that are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Keep {
    /// All frames; sweeps must be equally long.
    #[default]
    Equal,
    /// This many frames from the beginning; longer sweeps are cut, shorter ones refused.
    First(usize),
    /// As many frames as the shortest sweep has.
    Shortest,
    /// The length of more than half of the sweeps, or, if none is so common, the length that keeps most frames. Longer
    /// sweeps are cut, shorter ones omitted, and all are reported.
    Most,
}

impl From<Option<usize>> for Keep {
    /// Returns [`Keep::First`] with a number of steps, otherwise [`Keep::Equal`].
    fn from(steps: Option<usize>) -> Self {
        steps.map_or(Self::Equal, Self::First)
    }
}

impl std::str::FromStr for Keep {
    type Err = DataError;

    /// Reads a number of frames, or `shortest`.
    ///
    /// ```
    /// use tactnet_data::format::Keep;
    ///
    /// assert_eq!("100".parse::<Keep>()?, Keep::First(100));
    /// assert_eq!("shortest".parse::<Keep>()?, Keep::Shortest);
    /// assert!("0".parse::<Keep>().is_err());
    /// # Ok::<(), tactnet_data::DataError>(())
    /// ```
    fn from_str(text: &str) -> Result<Self, DataError> {
        let text = text.trim();
        if text.eq_ignore_ascii_case("shortest") {
            return Ok(Self::Shortest);
        }
        match text.parse() {
            Ok(steps) if steps > 0 => Ok(Self::First(steps)),
            _ => {
                let expected = "a number of time steps, or `shortest`";
                Err(DataError::inconsistent(
                    "steps",
                    expected,
                    format!("`{text}`"),
                ))
            }
        }
    }
}

/// Sweep that is longer or shorter than the others.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OddLength {
    /// Name or file of the sweep.
    pub sweep: String,
    /// Number of its frames.
    pub frames: usize,
}

/// Returns the number of frames that are read, and the sweeps that have more or fewer.
///
/// # Errors
/// No sweep, or a sweep of a length that `keep` does not allow.
pub(super) fn settle(
    path: &Path,
    sweeps: &[&str],
    lengths: &[usize],
    keep: Keep,
) -> Result<(usize, Vec<OddLength>), DataError> {
    let Some(&shortest) = lengths.iter().min() else {
        return Err(DataError::format(path, "sweeps", "at least one", "none"));
    };
    let (wanted, refused) = match keep {
        Keep::First(steps) => (steps, lengths.iter().position(|&length| length < steps)),
        Keep::Equal => {
            let most = usual(lengths);
            (most, lengths.iter().position(|&length| length != most))
        }
        Keep::Shortest => (shortest, None),
        Keep::Most => (usual(lengths), None),
    };
    let Some(refused) = refused else {
        let odd = |&(_, &frames): &(&&str, &usize)| keep == Keep::Most && frames != wanted;
        let odd = sweeps.iter().zip(lengths).filter(odd);
        let odd = odd.map(|(sweep, &frames)| OddLength {
            sweep: (*sweep).into(),
            frames,
        });
        return Ok((wanted, odd.collect()));
    };
    let expected = match keep {
        Keep::First(_) => format!("at least the {wanted} frames asked for"),
        _ => {
            let like = lengths.iter().position(|&length| length == wanted);
            format!("{wanted} frames, as `{}`", sweeps[like.unwrap_or(0)])
        }
    };
    let odd = lengths.iter().filter(|&&length| length != wanted).count();
    let all = match keep {
        Keep::Equal => format!(
            " ({odd} of {} sweeps differ; the shortest has {shortest} frames, the longest {}, most have {wanted})",
            lengths.len(),
            lengths.iter().max().unwrap_or(&wanted),
        ),
        _ => String::new(),
    };
    Err(DataError::format(
        path,
        format!("sweep `{}`", sweeps[refused]),
        expected,
        format!("{}{all}", lengths[refused]),
    )
    .with_remedy(Remedy::KeepSteps { steps: shortest }))
}

/// Returns the length of more than half of the sweeps, or, if none is so common, the length that keeps most frames.
fn usual(lengths: &[usize]) -> usize {
    let mut sorted = lengths.to_vec();
    sorted.sort_unstable();
    let middle = sorted.get(sorted.len() / 2).copied().unwrap_or(0);
    let alike = sorted.iter().filter(|&&length| length == middle).count();
    if 2 * alike > sorted.len() {
        return middle;
    }
    longest_of_most(&sorted)
}

/// Returns the length that keeps most frames if longer sweeps are cut and shorter ones omitted.
fn longest_of_most(sorted: &[usize]) -> usize {
    let left = |at: usize| (sorted.len() - at) * sorted[at];
    // For equal lengths the first index counts all sweeps.
    let best = (0..sorted.len()).rev().max_by_key(|&at| left(at));
    best.map_or(0, |at| sorted[at])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_odd_sweep_does_not_make_the_others_odd() {
        let mut lengths = vec![300; 47];
        lengths.push(299);
        assert_eq!(usual(&lengths), 300);
        lengths[0] = 5000;
        assert_eq!(usual(&lengths), 300);
        // No length is common: 2 x 20 frames are more than 4 x 9, and fewer than 3 x 19.
        assert_eq!(usual(&[9, 19, 20, 20]), 19);
        assert_eq!(usual(&[9, 13, 20, 21]), 20);
        assert_eq!(usual(&[]), 0);
    }
}
