//! Mutations of valid inputs.

use rand::seq::IndexedRandom;
use rand::{Rng, RngExt};

/// Numbers that often cause failures.
const NUMBERS: [u64; 16] = [
    0,
    1,
    2,
    0x7f,
    0x80,
    0xff,
    0x7fff,
    0xffff,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_ffff,
    0x1_0000_0000,
    1_000_000_000_000,
    0x7fff_ffff_ffff_ffff,
    0x8000_0000_0000_0000,
    u64::MAX,
];
/// Texts that often cause failures.
const TEXTS: [&str; 12] = [
    "0",
    "-1",
    "1e999",
    "NaN",
    "4294967296",
    "1000000000000",
    "18446744073709551615",
    "-9223372036854775808",
    "0.1e-400",
    "null",
    "\"\\u0000\"",
    "[]",
];
/// Maximum length of a mutated input, in bytes.
const LONGEST: usize = 1 << 20;

/// Returns an input made from one of `seeds` by one to eight changes.
pub fn mutated(seeds: &[Vec<u8>], rng: &mut impl Rng) -> Vec<u8> {
    let mut input = seeds.choose(rng).cloned().unwrap_or_default();
    for _ in 0..rng.random_range(1..=8) {
        change(&mut input, seeds, rng);
    }
    input.truncate(LONGEST);
    input
}

fn change(input: &mut Vec<u8>, seeds: &[Vec<u8>], rng: &mut impl Rng) {
    if input.is_empty() {
        input.push(rng.random());
        return;
    }
    let at = rng.random_range(0..input.len());
    let end = (at + rng.random_range(1..=64)).min(input.len());
    match rng.random_range(0..10) {
        0 => input[at] ^= 1 << rng.random_range(0..8),
        1 => input[at] = rng.random(),
        2 | 3 => {
            let bytes = [2, 4, 8][rng.random_range(0..3)];
            let number = NUMBERS[rng.random_range(0..NUMBERS.len())].to_le_bytes();
            for (place, byte) in input[at..].iter_mut().zip(&number[..bytes]) {
                *place = *byte;
            }
        }
        4 => drop(input.drain(at..end)),
        5 => {
            let again = input[at..end].to_vec();
            input.splice(at..at, again);
        }
        6 => {
            let other = seeds.choose(rng).map_or(&[][..], Vec::as_slice);
            if !other.is_empty() {
                let from = rng.random_range(0..other.len());
                let to = (from + rng.random_range(1..=256)).min(other.len());
                input.splice(at..end, other[from..to].iter().copied());
            }
        }
        7 => input.truncate(at),
        _ => another_number(input, at, rng),
    }
}

/// Replaces the next decimal number, if there is one.
fn another_number(input: &mut Vec<u8>, at: usize, rng: &mut impl Rng) {
    let digits = |byte: &u8| byte.is_ascii_digit();
    let Some(begin) = input[at..].iter().position(digits).map(|found| at + found) else {
        return;
    };
    let length = input[begin..]
        .iter()
        .take_while(|byte| digits(byte))
        .count();
    let text = TEXTS[rng.random_range(0..TEXTS.len())];
    input.splice(begin..begin + length, text.bytes());
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;

    #[test]
    fn a_seed_gives_the_same_inputs_and_they_differ() {
        let seeds = vec![b"{\"steps\": 1000}".to_vec(), vec![0; 100]];
        let draw = |seed| -> Vec<Vec<u8>> {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            (0..2000).map(|_| mutated(&seeds, &mut rng)).collect()
        };
        assert_eq!(draw(1), draw(1));
        assert_ne!(draw(1), draw(2));
        let different = draw(1)
            .iter()
            .filter(|input| !seeds.contains(input))
            .count();
        assert!(different > 1800, "{different}");
        let large = draw(1).iter().any(|input| {
            let digits = b"1000000000000";
            input.windows(digits.len()).any(|window| window == digits)
        });
        assert!(large, "numbers in digits become large ones");
    }
}
