//! Beliefs about whole sweeps, and whether they came again.

use std::collections::BTreeMap;

use serde::Serialize;
use sha2::{Digest, Sha256};
use tactnet_data::hex;
use tactnet_skin::packets::{Command, Stage, TactileBelief};
use tactnet_skin::{Segmentation, ServeConfig};

use crate::{RecordedPacket, Recording, RecordingError};

/// Beliefs about sweeps that were classified as a whole.
#[derive(Debug, Clone, Serialize)]
pub struct SweepBeliefs {
    /// Such sweeps.
    pub sweeps: usize,
    /// Beliefs about them, anytime beliefs included.
    pub beliefs: usize,
    /// Beliefs about sweeps whose beginning or end is missing, which are not compared.
    pub unfinished: usize,
    /// Of finger, stage, frames, last frame and posterior of each, in order.
    pub posterior_sha256: String,
    /// By finger, in the order in which they came.
    #[serde(skip)]
    pub(super) about: Vec<TactileBelief>,
}

impl SweepBeliefs {
    /// - `beliefs`: in the order in which they came
    pub fn of(beliefs: &[TactileBelief]) -> Self {
        let last = if beliefs.iter().any(|b| b.stage == Stage::Dropout as u32) {
            Stage::Dropout
        } else {
            Stage::Plain
        };
        // By finger: the beliefs about the sweep that is going on.
        let mut open: BTreeMap<u32, Vec<TactileBelief>> = BTreeMap::new();
        let mut whole: BTreeMap<u32, Vec<Vec<TactileBelief>>> = BTreeMap::new();
        for belief in beliefs {
            let sweep = open.entry(belief.finger).or_default();
            // Another one has begun, perhaps of a service that was started anew.
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

    /// Returns how many of these are not among `others`, bit by bit, with label, verdict and strangeness.
    pub fn missing_in(&self, others: &Self) -> usize {
        // A skin that was started anew counts its frames from the beginning: several beliefs may have one key.
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
            // Each is found once.
            same.map(|place| left.remove(place)).is_none()
        });
        missing.count()
    }

    /// Those of a recording about sweeps whose beginning was recorded, too.
    ///
    /// # Errors
    /// A wrong section of the classifier in the recorded table.
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
        let came = [
            belief(1, Stage::Anytime, 5),
            // Its end never came.
            belief(2, Stage::Anytime, 25),
            belief(2, Stage::Plain, 29),
            belief(2, Stage::Dropout, 29),
        ];
        let beliefs = SweepBeliefs::of(&came);
        assert_eq!((beliefs.sweeps, beliefs.beliefs), (1, 3));
        assert_eq!(beliefs.unfinished, came.len() - 3);
        assert_eq!(beliefs.missing_in(&SweepBeliefs::of(&came)), 0);
        // Two skins, one after the other, whose frames have the same numbers.
        let mut other = came.map(|mut belief| {
            belief.sweep += 10;
            belief.posterior[0] = 0.25;
            belief
        });
        let both = SweepBeliefs::of(&[came, other].concat());
        assert_eq!(both.missing_in(&both), 0);
        other[3].posterior[0] = 0.5;
        let changed = SweepBeliefs::of(&[came, other].concat());
        assert_eq!(both.missing_in(&changed), 1);
        let mut changed = came;
        changed[3].posterior[1] = f32::MIN_POSITIVE;
        let changed = SweepBeliefs::of(&changed);
        assert_eq!(beliefs.missing_in(&changed), 1);
        assert_ne!(beliefs.posterior_sha256, changed.posterior_sha256);
        // Fewer come again in more, not the other way round.
        let fewer = SweepBeliefs::of(&[]);
        assert_eq!(
            (fewer.missing_in(&beliefs), beliefs.missing_in(&fewer)),
            (0, beliefs.beliefs - fewer.beliefs)
        );
    }
}
