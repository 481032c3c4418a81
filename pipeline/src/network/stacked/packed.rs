//! Digits of training sweeps in GPU memory.

use tactnet_data::Samples;

use super::StackMember;
use crate::network::resident::{MOST_BYTES, packed};

/// Digits of all training sweeps, packed into words.
pub(super) struct PackedDigits {
    pub(super) bits: usize,
    pub(super) words: Vec<u32>,
    /// Numbers of each member's sweeps, by position.
    pub(super) numbers: Vec<Vec<u32>>,
}

impl PackedDigits {
    /// Returns `None` if sweeps are not digits, are too large, or are augmented. Data sets of equal content are stored once.
    pub(super) fn of(members: &[StackMember<'_>]) -> Option<Self> {
        let mut bits = None;
        let mut words = Vec::new();
        let mut numbers = Vec::with_capacity(members.len());
        let mut known: Vec<(&str, usize, u32)> = Vec::new();
        for member in members {
            let dataset = member.train.dataset();
            let changes = member
                .recipe
                .training
                .augmentation
                .changes(member.normalizer);
            if changes || member.normalizer.needs_whole_sweep() {
                return None;
            }
            let of = match dataset.samples() {
                Samples::U8(_) => u8::BITS as usize,
                Samples::U16(_) => u16::BITS as usize,
                Samples::F32(_) => return None,
            };
            if *bits.get_or_insert(of) != of {
                return None;
            }
            let key = (dataset.sha256(), dataset.len());
            let found = known.iter().find(|(sha, len, _)| (*sha, *len) == key);
            let first = match found {
                Some((_, _, first)) => *first,
                None => {
                    let values = dataset.shape().values();
                    let width = values.div_ceil(u32::BITS as usize / of);
                    let first = (words.len() / width) as u32;
                    if (words.len() + dataset.len() * width) * size_of::<u32>() > MOST_BYTES {
                        return None;
                    }
                    match dataset.samples() {
                        Samples::U8(digits) => digits
                            .chunks(values)
                            .for_each(|sweep| words.extend(packed(sweep))),
                        Samples::U16(digits) => digits
                            .chunks(values)
                            .for_each(|sweep| words.extend(packed(sweep))),
                        Samples::F32(_) => return None,
                    }
                    known.push((key.0, key.1, first));
                    first
                }
            };
            let indices = member.train.indices().iter();
            numbers.push(indices.map(|&index| first + index as u32).collect());
        }
        Some(Self {
            bits: bits?,
            words,
            numbers,
        })
    }
}
