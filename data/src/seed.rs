//! Named random streams of one seed.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use sha2::{Digest, Sha256};

/// Seed of all random choices of a run.
///
/// Each consumer names its stream, so a new consumer does not change the numbers of the others:
///
/// ```
/// use rand::Rng;
/// use tactnet_data::Seed;
/// let seed = Seed(7);
/// assert_eq!(seed.rng(("shuffle", 3)).next_u64(), seed.rng(("shuffle", 3)).next_u64());
/// assert_ne!(seed.rng(("shuffle", 3)).next_u64(), seed.rng(("shuffle", 4)).next_u64());
/// assert_ne!(seed.rng(("shuffle", 3)).next_u64(), seed.rng(("dropout", 3)).next_u64());
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(transparent)]
pub struct Seed(pub u64);

/// Name of a stream: a word with up to two indices.
pub trait StreamName {
    /// Returns the word and the indices.
    fn parts(&self) -> (&str, [u64; 2]);
}

impl StreamName for &str {
    fn parts(&self) -> (&str, [u64; 2]) {
        (self, [0, 0])
    }
}

impl StreamName for (&str, usize) {
    fn parts(&self) -> (&str, [u64; 2]) {
        (self.0, [self.1 as u64, 0])
    }
}

impl StreamName for (&str, usize, usize) {
    fn parts(&self) -> (&str, [u64; 2]) {
        (self.0, [self.1 as u64, self.2 as u64])
    }
}

impl Seed {
    /// Returns the stream with this name: ChaCha8 keyed by SHA-256 of seed, word and indices.
    pub fn rng(self, name: impl StreamName) -> ChaCha8Rng {
        let (word, indices) = name.parts();
        let mut hash = Sha256::new();
        hash.update(self.0.to_le_bytes());
        hash.update((word.len() as u64).to_le_bytes());
        hash.update(word.as_bytes());
        for index in indices {
            hash.update(index.to_le_bytes());
        }
        ChaCha8Rng::from_seed(hash.finalize().into())
    }
}
