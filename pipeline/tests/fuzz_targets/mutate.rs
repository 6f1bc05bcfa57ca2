//! A deterministic mutation loop for the ordinary tests: a few hundred inputs, as a fuzzer would make them.

use super::fuzz_targets::Target;
use super::fuzz_targets::check::Outcome;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Number of inputs that were loaded, and number refused.
#[derive(Debug, Default, Clone, Copy)]
pub struct Tally {
    pub loaded: usize,
    pub refused: usize,
}

/// An input on which a body panicked, with the message.
#[derive(Debug)]
pub struct Finding {
    pub input: Vec<u8>,
    pub message: String,
}

/// Runs one input; a panic is returned as a finding.
pub fn run_one(target: &Target, input: &[u8], tally: &mut Tally) -> Result<(), Finding> {
    match catch_unwind(AssertUnwindSafe(|| (target.run)(input))) {
        Ok(Outcome::Loaded) => tally.loaded += 1,
        Ok(Outcome::Refused) => tally.refused += 1,
        Err(panic) => {
            let text = panic.downcast_ref::<String>().cloned();
            let message = text.or_else(|| panic.downcast_ref::<&str>().map(|text| (*text).to_owned()));
            return Err(Finding { input: input.to_owned(), message: message.unwrap_or_default() });
        }
    }
    Ok(())
}

/// Runs `rounds` mutations of the seeds, the same in every run, until the first finding.
pub fn run(target: &Target, seeds: &[Vec<u8>], rounds: usize) -> Result<Tally, Finding> {
    let mut random = Random(0x9E37_79B9_7F4A_7C15);
    let mut tally = Tally::default();
    for round in 0..rounds {
        let mut input = seeds[round % seeds.len()].clone();
        for _ in 0..1 + random.below(4) {
            mutate(&mut input, &seeds[random.below(seeds.len())], &mut random);
        }
        run_one(target, &input, &mut tally)?;
    }
    Ok(tally)
}

/// xorshift64* (Vigna, "An experimental exploration of Marsaglia's xorshift generators, scrambled", 2016).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u32 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 32) as u32
    }

    /// A random number below a bound; 0 for the bound 0.
    fn below(&mut self, bound: usize) -> usize {
        self.next() as usize % bound.max(1)
    }
}

fn mutate(input: &mut Vec<u8>, other: &[u8], random: &mut Random) {
    /// Numbers, as counts and as bit patterns of floats, that readers tend to mishandle.
    const WORDS: [u32; 8] = [0, 1, 0x7FFF_FFFF, 0xFFFF_FFFF, 0x8000_0000, 0x7F80_0000, 0x7FC0_0000, 0x0100_0000];
    const TEXTS: [&[u8]; 10] =
        [b"-1", b"0", b"1e39", b"nan", b"4294967296", b"<", b"\"", b"\n", b"9999999999999999999", b"\xC4\x80"];
    let at = random.below(input.len());
    match random.below(8) {
        0 if !input.is_empty() => input[at] ^= 1 << random.below(8),
        1 if !input.is_empty() => input[at] = random.next() as u8,
        2 => input.truncate(at),
        3 => {
            let end = (at + 1 + random.below(32)).min(input.len());
            input.drain(at..end);
        }
        4 => {
            let from = random.below(other.len());
            let piece = other[from..(from + 1 + random.below(48)).min(other.len())].to_vec();
            input.splice(at..at, piece);
        }
        5 => {
            let word = WORDS[random.below(WORDS.len())].to_le_bytes();
            let end = (at + 4).min(input.len());
            input.splice(at..end, word);
        }
        6 => {
            let text = TEXTS[random.below(TEXTS.len())];
            let length = input[at..].iter().take_while(|byte| byte.is_ascii_alphanumeric() || **byte == b'.').count();
            input.splice(at..at + length, text.iter().copied());
        }
        _ => {
            let from = random.below(other.len());
            let end = (from + 1 + random.below(16)).min(other.len());
            let length = (end - from).min(input.len() - at);
            input[at..at + length].copy_from_slice(&other[from..from + length]);
        }
    }
}
