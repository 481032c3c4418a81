//! Search for runs of frames that two sweeps share, by anchors: frames whose hashes mark the same places in both sweeps.

use std::collections::HashSet;

use super::run_evidence::{Evidence, bits};

/// Minimum length of a shared run, in frames.
const SHORTEST: usize = 8;
/// Part of a sweep that a shared run has at least: one in so many frames.
const SHARE: usize = 20;
/// Number of sweeps after a sweep in the same group of anchors that it is compared with.
const PARTNERS: usize = 16;
/// Maximum number of candidates in a data set.
const MAX_CANDIDATES: usize = 1 << 21;
/// Number of bits by which a run exceeds one that occurs by chance: the probability of a false finding is one in a
/// million.
const MARGIN_BITS: f64 = 20.0;
/// Maximum number of repetitions within a sweep that are compared.
const REPETITIONS: usize = 8;
/// Hash of consecutive frames that are all equal.
const CONSTANT: u64 = u64::MAX;

/// Hash of consecutive frames and the step of the first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Anchor {
    pub(super) hash: u64,
    pub(super) sweep: u32,
    pub(super) step: u32,
}

/// Two sweeps that share an anchor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct Candidate {
    pub(super) later: u32,
    pub(super) earlier: u32,
    /// Step of the earlier sweep minus step of the later one.
    pub(super) lag: i32,
}

/// Consecutive frames that two sweeps share.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct SharedRun {
    /// First frame in the first of the sweeps.
    pub(super) start: usize,
    /// Number of frames.
    pub(super) frames: usize,
}

/// Frames of a sweep with their hashes.
pub(super) struct Frames {
    evidence: Evidence,
    /// Hash of each frame: `[steps]`.
    hashes: Vec<u64>,
    /// True for a frame that equals the one before: `[steps]`.
    repeated: Vec<bool>,
}

/// Returns the minimum length of a shared run in sweeps of this length, in frames; `None` if they are too short.
pub(super) fn shortest_run(steps: usize) -> Option<usize> {
    (steps > SHORTEST).then_some(SHORTEST.max(steps / SHARE))
}

impl Frames {
    /// Returns the frames of a sweep, `[steps][taxels]`.
    pub(super) fn of(values: Vec<f32>, taxels: usize) -> Self {
        let frames = || values.chunks_exact(taxels);
        // Adding zero makes a negative zero positive.
        let hash = |frame: &[f32]| hash_of(frame.iter().map(|value| (value + 0.0).to_bits()));
        let pairs = frames().zip(frames().skip(1));
        Self {
            hashes: frames().map(hash).collect(),
            repeated: std::iter::once(false)
                .chain(pairs.map(|(before, after)| before == after))
                .collect(),
            evidence: Evidence::of(values, taxels),
        }
    }

    fn steps(&self) -> usize {
        self.hashes.len()
    }

    /// Returns the anchors of the sweep: of each stretch of `run` frames the smallest hash of `run / 2` frames in it.
    /// Equal stretches of two sweeps have equal anchors. Stretches that occur twice have none.
    ///
    /// Returns `None` if the sweep repeats itself, as a periodic signal does: its frames prove nothing.
    pub(super) fn anchors(&self, run: usize) -> Option<Vec<(u64, usize)>> {
        let length = run / 2;
        let hashes = self.hashes_of_runs(length);
        let window = run - length + 1;
        let mut anchors: Vec<(u64, usize)> = Vec::new();
        let mut smallest: Option<usize> = None;
        for end in 0..hashes.len() {
            let start = (end + 1).saturating_sub(window);
            smallest = match smallest {
                Some(at) if at >= start && hashes[at] <= hashes[end] => Some(at),
                Some(at) if at >= start => Some(end),
                _ => (start..=end).min_by_key(|&at| hashes[at]),
            };
            let anchor = smallest.filter(|&at| end + 1 >= window && hashes[at] != CONSTANT);
            if let Some(at) = anchor
                && anchors.last().is_none_or(|last| last.1 != at)
            {
                anchors.push((hashes[at], at));
            }
        }
        anchors.sort_unstable();
        if self.repeats_itself(&anchors) {
            return None;
        }
        let once = |&&(hash, _): &&(u64, usize)| {
            let first = anchors.partition_point(|anchor| anchor.0 < hash);
            anchors.get(first + 1).is_none_or(|next| next.0 != hash)
        };
        Some(anchors.iter().filter(once).copied().collect())
    }

    /// Returns the hashes of all stretches of `length` frames: `[steps - length + 1]`.
    fn hashes_of_runs(&self, length: usize) -> Vec<u64> {
        /// Odd number with well-mixed bits.
        const FACTOR: u64 = 0x9e37_79b9_7f4a_7c15;
        let steps = self.steps();
        let leaving = (1..length).fold(1_u64, |power, _| power.wrapping_mul(FACTOR));
        let (mut rolling, mut still) = (0_u64, 0_usize);
        let mut hashes = Vec::with_capacity(steps);
        for (step, &hash) in self.hashes.iter().enumerate() {
            if step >= length {
                let left = self.hashes[step - length].wrapping_mul(leaving);
                rolling = rolling.wrapping_sub(left);
            }
            rolling = rolling.wrapping_mul(FACTOR).wrapping_add(hash);
            still = match self.repeated[step] {
                true => still + 1,
                false => 0,
            };
            if step + 1 >= length {
                hashes.push(match still + 1 >= length {
                    true => CONSTANT,
                    false => mixed(rolling),
                });
            }
        }
        hashes
    }

    /// Returns true if a long run of frames occurs twice in the sweep.
    fn repeats_itself(&self, anchors: &[(u64, usize)]) -> bool {
        let twice = anchors.array_windows().filter(|[a, b]| a.0 == b.0);
        let mut twice = twice.take(REPETITIONS);
        let possible = bits(self.steps() as f64 * self.steps() as f64) + MARGIN_BITS;
        twice.any(|[first, second]| {
            let run = self.longest_run(self, first.1 as i32 - second.1 as i32);
            self.evidence.exceeds(run, possible)
        })
    }

    /// Returns the longest run of equal frames at this lag.
    ///
    /// - `lag`: step of `earlier` minus step of this sweep
    fn longest_run(&self, earlier: &Self, lag: i32) -> SharedRun {
        let lag = lag as isize;
        let start = usize::try_from(-lag).unwrap_or(0);
        let end = self
            .steps()
            .min(earlier.steps().saturating_add_signed(-lag));
        let mut longest = SharedRun {
            start: 0,
            frames: 0,
        };
        let mut run = longest;
        for step in start..end {
            if self.hashes[step] == earlier.hashes[step.wrapping_add_signed(lag)] {
                if run.frames == 0 {
                    run.start = step;
                }
                run.frames += 1;
                if run.frames > longest.frames {
                    longest = run;
                }
            } else {
                run.frames = 0;
            }
        }
        longest
    }

    /// Returns the run that two sweeps share at this lag, if it is too long to occur by chance.
    ///
    /// - `lag`: step of `earlier` minus step of this sweep
    /// - `all_frames`: number of frames in the data set
    pub(super) fn shared_run(
        &self,
        earlier: &Self,
        lag: i32,
        all_frames: usize,
    ) -> Option<SharedRun> {
        let run = self.longest_run(earlier, lag);
        let is_long = shortest_run(self.steps()).is_some_and(|shortest| run.frames >= shortest);
        let possible = 2.0 * bits(all_frames as f64) + MARGIN_BITS;
        (is_long && self.evidence.exceeds(run, possible)).then_some(run)
    }
}

/// Returns the pairs of sweeps that share an anchor, in order; a sweep is paired with at most [`PARTNERS`] others per
/// anchor.
pub(super) fn candidates(anchors: &[Anchor]) -> Vec<Candidate> {
    let mut candidates = HashSet::new();
    for group in anchors.chunk_by(|a, b| a.hash == b.hash) {
        for (place, earlier) in group.iter().enumerate() {
            for later in group[place + 1..].iter().take(PARTNERS) {
                candidates.insert(Candidate {
                    later: later.sweep,
                    earlier: earlier.sweep,
                    lag: earlier.step as i32 - later.step as i32,
                });
            }
        }
        if candidates.len() >= MAX_CANDIDATES {
            break;
        }
    }
    let mut candidates: Vec<Candidate> = candidates.into_iter().collect();
    candidates.sort_unstable();
    candidates
}

fn hash_of(words: impl Iterator<Item = u32>) -> u64 {
    let hash = words.fold(0xcbf2_9ce4_8422_2325, |hash: u64, word| {
        (hash.rotate_left(5) ^ u64::from(word)).wrapping_mul(0x9e37_79b9_7f4a_7c15)
    });
    mixed(hash)
}

/// Returns the number with its bits mixed, below [`CONSTANT`].
fn mixed(number: u64) -> u64 {
    let number = (number ^ (number >> 32)).wrapping_mul(0xd6e8_feb8_6659_fd93);
    let number = (number ^ (number >> 32)).wrapping_mul(0xd6e8_feb8_6659_fd93);
    (number ^ (number >> 32)).min(CONSTANT - 1)
}

#[cfg(test)]
mod tests {
    use super::super::run_evidence::tests::noise;
    use super::*;

    #[test]
    fn equal_stretches_have_equal_anchors() {
        let long = noise(1, 500, 1000);
        let run = 20;
        for shift in 1..60 {
            let (a, b) = (&long[..2 * 100], &long[2 * shift..2 * (100 + shift)]);
            let [a, b] = [a, b].map(|values| Frames::of(values.to_vec(), 2).anchors(run).unwrap());
            let in_both = a.iter().filter(|of_a| {
                b.iter()
                    .any(|of_b| (of_a.0, of_a.1) == (of_b.0, of_b.1 + shift))
            });
            // Two consecutive anchors are at most 11 frames apart.
            assert!(in_both.count() >= (100 - shift - 10) / 11, "{shift}");
        }
    }

    #[test]
    fn the_longest_run_is_found_at_its_lag() {
        let a = noise(1, 100, 1000);
        let b = [&noise(2, 30, 1000)[..], &a[..2 * 70]].concat();
        let [a, b] = [a, b].map(|values| Frames::of(values, 2));
        let run = b.longest_run(&a, -30);
        let expected = SharedRun {
            start: 30,
            frames: 70,
        };
        assert_eq!(run, expected);
        assert_eq!(b.shared_run(&a, -30, 1 << 20), Some(expected));
        assert_eq!(
            a.longest_run(&b, 30),
            SharedRun {
                start: 0,
                ..expected
            }
        );
        assert_eq!(a.longest_run(&b, 200).frames, 0);
        assert_eq!(a.longest_run(&b, -200).frames, 0);
    }

    #[test]
    fn periodic_sweeps_have_no_anchors() {
        let once = noise(1, 30, 50);
        let periodic = once.repeat(5);
        assert_eq!(Frames::of(periodic, 2).anchors(20), None);
        assert!(Frames::of(noise(2, 150, 50), 2).anchors(20).is_some());
    }
}
