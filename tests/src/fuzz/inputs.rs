//! Inputs from a seed: valid ones spoiled in a few places, spliced, cut, and pure chance.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Longest input that is made of chance alone.
const CHANCE_LEN: usize = 400;

/// Numbers at the edges of what a double can be and of what the engines believe.
const STRANGE: [f64; 16] = [
    0.0,
    -0.0,
    -1.0,
    1e-18,
    1e-9,
    1e5,
    -1e9,
    1e18,
    1e150,
    -1e300,
    f64::MAX,
    f64::MIN_POSITIVE,
    5e-324,
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
];

/// The next input.
pub fn make(seeds: &[Vec<u8>], rng: &mut ChaCha8Rng) -> Vec<u8> {
    if seeds.is_empty() || rng.random_bool(0.1) {
        let len = rng.random_range(0..CHANCE_LEN);
        return (0..len).map(|_| rng.random()).collect();
    }
    let mut input = seeds[rng.random_range(0..seeds.len())].clone();
    for _ in 0..rng.random_range(0..6) {
        spoil(&mut input, seeds, rng);
    }
    input
}

fn spoil(input: &mut Vec<u8>, seeds: &[Vec<u8>], rng: &mut ChaCha8Rng) {
    if input.is_empty() {
        input.push(rng.random());
        return;
    }
    let at = rng.random_range(0..input.len());
    match rng.random_range(0..8) {
        0 => input[at] = rng.random(),
        1 => input[at] ^= 1 << rng.random_range(0..8),
        // A number, where messages have their numbers.
        2 | 3 => {
            let number = STRANGE[rng.random_range(0..STRANGE.len())];
            overwrite(input, at & !7, &number.to_le_bytes());
        }
        4 => {
            let number: u64 =
                [0, 1, u64::MAX, u64::MAX - 1, 1 << 63, rng.random()][rng.random_range(0..6)];
            overwrite(input, at & !7, &number.to_le_bytes());
        }
        5 => input.truncate(at),
        6 => {
            let len = rng.random_range(0..=32.min(input.len() - at));
            let piece = input[at..at + len].to_vec();
            let to = rng.random_range(0..=input.len());
            input.splice(to..to, piece);
        }
        _ => {
            let other = &seeds[rng.random_range(0..seeds.len())];
            let from = rng.random_range(0..=other.len());
            input.truncate(at);
            input.extend(&other[from..]);
        }
    }
}

fn overwrite(input: &mut [u8], at: usize, bytes: &[u8]) {
    for (old, new) in input.iter_mut().skip(at).zip(bytes) {
        *old = *new;
    }
}
