//! How many frames of each sweep are read, where a file says how many there are.

use std::path::Path;

use crate::{DataError, Remedy};

/// How many frames of each sweep are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Keep {
    /// All; sweeps must be equally long.
    Equal,
    /// That many from the beginning; longer sweeps are cut, shorter ones refused.
    First(usize),
    /// As many as more than half of the sweeps have, or where none is so common, the number of which most frames are left; longer sweeps are
    /// cut, shorter ones left out, and all are named.
    Most,
}

impl From<Option<usize>> for Keep {
    /// The first `steps` of each, or all.
    fn from(steps: Option<usize>) -> Self {
        steps.map_or(Self::Equal, Self::First)
    }
}

/// A sweep that is longer or shorter than the others.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OddLength {
    /// Its name or file.
    pub sweep: String,
    /// Its frames.
    pub frames: usize,
}

/// Returns the frames of a sweep that are read, and the sweeps that have more or fewer.
///
/// # Errors
/// No sweep; one of another length, where `keep` allows none.
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
        Keep::Equal if odd > 1 => {
            format!(" ({odd} sweeps differ)")
        }
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

/// The number of frames that more than half of the sweeps have; where none is so common, that of which most are left.
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

/// The number of frames of which most are left, if longer sweeps are cut to it and shorter ones left out.
fn longest_of_most(sorted: &[usize]) -> usize {
    let left = |at: usize| (sorted.len() - at) * sorted[at];
    // Where sweeps are alike, the first of them counts all.
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
        // None is common: 2 x 20 frames are more than 4 x 9, and fewer than 3 x 19.
        assert_eq!(usual(&[9, 19, 20, 20]), 19);
        assert_eq!(usual(&[9, 13, 20, 21]), 20);
        assert_eq!(usual(&[]), 0);
    }
}
