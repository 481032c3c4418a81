//! Beliefs about complete sweeps, and their comparison.

use std::collections::BTreeMap;

use serde::Serialize;
use sha2::{Digest, Sha256};
use tactnet_data::hex;
use tactnet_skin::packets::{Command, Stage, TactileBelief};
use tactnet_skin::{Segmentation, ServeConfig};

use crate::{RecordedPacket, Recording, RecordingError};

/// Beliefs about complete sweeps.
#[derive(Debug, Clone, Serialize)]
pub struct SweepBeliefs {
    /// Number of complete sweeps.
    pub sweeps: usize,
    /// Number of beliefs about them, including anytime beliefs.
    pub beliefs: usize,
    /// Number of beliefs about incomplete sweeps, which are not compared.
    pub unfinished: usize,
    /// SHA-256 of finger, stage, frames, last frame and posterior of all beliefs, in order.
    pub posterior_sha256: String,
    /// Beliefs ordered by finger, then by arrival.
    #[serde(skip)]
    pub(super) about: Vec<TactileBelief>,
}

impl SweepBeliefs {
    /// Groups beliefs by sweep.
    ///
    /// - `beliefs`: in order of arrival
    pub fn of(beliefs: &[TactileBelief]) -> Self {
        let last = if beliefs.iter().any(|b| b.stage == Stage::Dropout as u32) {
            Stage::Dropout
        } else {
            Stage::Plain
        };
        // Beliefs about the current sweep, by finger.
        let mut open: BTreeMap<u32, Vec<TactileBelief>> = BTreeMap::new();
        let mut whole: BTreeMap<u32, Vec<Vec<TactileBelief>>> = BTreeMap::new();
        for belief in beliefs {
            let sweep = open.entry(belief.finger).or_default();
            // Another sweep has begun, perhaps after a restart of the classifier.
            if sweep
                .last()
                .is_some_and(|before| before.sweep != belief.sweep)
            {
                sweep.clear();
            }
            sweep.push(*belief);
            if belief.stage == last as u32 {
                let ended = std::mem::take(sweep);
                whole.entry(belief.finger).or_default().push(ended);
            }
        }
        let sweeps = whole.values().map(Vec::len).sum();
        let about: Vec<TactileBelief> = whole.into_values().flatten().flatten().collect();
        let mut hash = Sha256::new();
        for belief in &about {
            for number in [belief.finger, belief.stage, belief.frames] {
                hash.update(number.to_le_bytes());
            }
            hash.update(belief.last_frame.to_le_bytes());
            for p in posterior(belief) {
                hash.update(p.to_le_bytes());
            }
        }
        Self {
            sweeps,
            beliefs: about.len(),
            unfinished: beliefs.len() - about.len(),
            posterior_sha256: hex(hash.finalize()),
            about,
        }
    }

    /// Returns the number of beliefs without an equal one in `others`, bit by bit, with label, verdict and
    /// strangeness.
    pub fn missing_in(&self, others: &Self) -> usize {
        // Several beliefs may have the same key, since a restarted skin counts its frames from zero again.
        let key = |b: &TactileBelief| (b.finger, b.last_frame, b.stage);
        let mut by_key: BTreeMap<_, Vec<&TactileBelief>> = BTreeMap::new();
        for belief in &others.about {
            by_key.entry(key(belief)).or_default().push(belief);
        }
        let missing = self.about.iter().filter(|belief| {
            let Some(left) = by_key.get_mut(&key(belief)) else {
                return true;
            };
            let same = left.iter().position(|other| {
                let numbers = |b: &TactileBelief| (b.frames, b.filled_in, b.label, b.verdict);
                let floats =
                    |b: &TactileBelief| [b.entropy, b.strangeness, b.threshold].map(f32::to_bits);
                let bits = |b: &TactileBelief| -> Vec<u32> {
                    posterior(b).iter().map(|p| p.to_bits()).collect()
                };
                numbers(belief) == numbers(other)
                    && floats(belief) == floats(other)
                    && bits(belief) == bits(other)
            });
            // Each belief of `others` matches once.
            same.map(|place| left.remove(place)).is_none()
        });
        missing.count()
    }

    /// Returns the beliefs of a recording about sweeps that were recorded from their beginning.
    ///
    /// # Errors
    /// The recorded table has a wrong section of the classifier.
    pub fn recorded(recording: &Recording) -> Result<Self, RecordingError> {
        let config = ServeConfig::of(&recording.table)?;
        let by_command = config.segmenter.segmentation == Segmentation::Command;
        let mut begun: Vec<(u32, u64)> = Vec::new();
        let (mut beliefs, mut all) = (Vec::new(), 0);
        for entry in &recording.entries {
            all += usize::from(matches!(entry.packet, RecordedPacket::Belief(_)));
            match &entry.packet {
                RecordedPacket::Command(command) if command.command() == Some(Command::Start) => {
                    begun.push((command.finger, command.motion));
                }
                RecordedPacket::Belief(belief)
                    if !by_command || begun.contains(&(belief.finger, belief.motion)) =>
                {
                    beliefs.push(**belief);
                }
                _ => {}
            }
        }
        let of_whole = Self::of(&beliefs);
        Ok(Self {
            unfinished: all - of_whole.beliefs,
            ..of_whole
        })
    }
}

fn posterior(belief: &TactileBelief) -> &[f32] {
    &belief.posterior[..(belief.materials as usize).min(belief.posterior.len())]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn belief(sweep: u64, stage: Stage, last_frame: u64) -> TactileBelief {
        TactileBelief {
            sweep,
            last_frame,
            stage: stage as u32,
            materials: 2,
            ..bytemuck::Zeroable::zeroed()
        }
    }

    #[test]
    fn only_whole_sweeps_count_and_one_changed_bit_is_noticed() {
        let received = [
            belief(1, Stage::Anytime, 5),
            // A sweep without an end.
            belief(2, Stage::Anytime, 25),
            belief(2, Stage::Plain, 29),
            belief(2, Stage::Dropout, 29),
        ];
        let beliefs = SweepBeliefs::of(&received);
        assert_eq!((beliefs.sweeps, beliefs.beliefs), (1, 3));
        assert_eq!(beliefs.unfinished, received.len() - 3);
        assert_eq!(beliefs.missing_in(&SweepBeliefs::of(&received)), 0);
        // Two skins in succession with the same frame numbers.
        let mut other = received.map(|mut belief| {
            belief.sweep += 10;
            belief.posterior[0] = 0.25;
            belief
        });
        let both = SweepBeliefs::of(&[received, other].concat());
        assert_eq!(both.missing_in(&both), 0);
        other[3].posterior[0] = 0.5;
        let changed = SweepBeliefs::of(&[received, other].concat());
        assert_eq!(both.missing_in(&changed), 1);
        let mut changed = received;
        changed[3].posterior[1] = f32::MIN_POSITIVE;
        let changed = SweepBeliefs::of(&changed);
        assert_eq!(beliefs.missing_in(&changed), 1);
        assert_ne!(beliefs.posterior_sha256, changed.posterior_sha256);
        // `missing_in` is not symmetric.
        let fewer = SweepBeliefs::of(&[]);
        assert_eq!(
            (fewer.missing_in(&beliefs), beliefs.missing_in(&fewer)),
            (0, beliefs.beliefs - fewer.beliefs)
        );
    }
}
