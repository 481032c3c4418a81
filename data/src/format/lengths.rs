//! Number of frames of each sweep that are read.

use std::path::Path;

use crate::{DataError, Remedy};

/// Maximum length of a sweep as a multiple of the mean: sweeps are padded to the longest in memory.
const MOST_TIMES: usize = 50;

/// Frames of each sweep that are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Keep {
    /// All frames; sweeps must be equally long, unless the file states the length of each.
    #[default]
    Equal,
    /// All frames of each sweep; see [`Dataset::with_lengths`](crate::Dataset::with_lengths).
    All,
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

    /// Reads a number of frames, `shortest` or `all`.
    ///
    /// ```
    /// use tactnet_data::format::Keep;
    ///
    /// assert_eq!("100".parse::<Keep>()?, Keep::First(100));
    /// assert_eq!("shortest".parse::<Keep>()?, Keep::Shortest);
    /// assert_eq!("all".parse::<Keep>()?, Keep::All);
    /// assert!("0".parse::<Keep>().is_err());
    /// # Ok::<(), tactnet_data::DataError>(())
    /// ```
    fn from_str(text: &str) -> Result<Self, DataError> {
        let text = text.trim();
        if text.eq_ignore_ascii_case("shortest") {
            return Ok(Self::Shortest);
        }
        if text.eq_ignore_ascii_case("all") {
            return Ok(Self::All);
        }
        match text.parse() {
            Ok(steps) if steps > 0 => Ok(Self::First(steps)),
            _ => {
                let expected = "a number of time steps, `all` or `shortest`";
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

/// Frames of the sweeps that are read.
#[derive(Debug)]
pub(super) struct Settled {
    /// Number of frames of the shape; longer sweeps are cut.
    pub(super) steps: usize,
    /// Number of frames below which a sweep is omitted.
    pub(super) least: usize,
    /// Sweeps that are cut or omitted without being asked for.
    pub(super) odd: Vec<OddLength>,
}

/// Returns the frames that are read.
///
/// # Errors
/// No sweep, or a sweep of a length that `keep` does not allow.
pub(super) fn settle(
    path: &Path,
    sweeps: &[&str],
    lengths: &[usize],
    keep: Keep,
) -> Result<Settled, DataError> {
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
        Keep::All => {
            let longest = lengths.iter().copied().max().unwrap_or(shortest);
            let most = MOST_TIMES * lengths.iter().sum::<usize>() / lengths.len();
            let is_odd = |&length: &usize| length == 0 || length > most;
            (longest, lengths.iter().position(is_odd))
        }
        Keep::Most => (usual(lengths), None),
    };
    let Some(refused) = refused else {
        let odd = |&(_, &frames): &(&&str, &usize)| keep == Keep::Most && frames != wanted;
        let odd = sweeps.iter().zip(lengths).filter(odd);
        let odd = odd.map(|(sweep, &frames)| OddLength {
            sweep: (*sweep).into(),
            frames,
        });
        return Ok(Settled {
            steps: wanted,
            least: if keep == Keep::All { shortest } else { wanted },
            odd: odd.collect(),
        });
    };
    let expected = match keep {
        Keep::First(_) => format!("at least the {wanted} frames asked for"),
        Keep::All => format!("1 frame to {MOST_TIMES} times the mean length"),
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
    let error = DataError::format(
        path,
        format!("sweep `{}`", sweeps[refused]),
        expected,
        format!("{}{all}", lengths[refused]),
    );
    Err(match keep {
        Keep::All => error,
        Keep::Equal => error.with_remedy(Remedy::KeepLengths { steps: shortest }),
        _ => error.with_remedy(Remedy::KeepSteps { steps: shortest }),
    })
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
    fn all_lengths_but_none_and_far_longer_ones_than_the_others_are_kept() {
        let settled = |lengths: &[usize]| {
            let names = vec!["s"; lengths.len()];
            settle(Path::new("a.csv"), &names, lengths, Keep::All)
        };
        let kept = settled(&[3, 7, 5]).unwrap();
        assert_eq!((kept.steps, kept.least, kept.odd.len()), (7, 3, 0));
        assert!(settled(&[3, 0, 5]).is_err());
        let mut lengths = vec![10; 200];
        lengths[7] = 2000;
        assert!(settled(&lengths).is_err());
        lengths[7] = 400;
        assert!(settled(&lengths).is_ok());
    }

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
