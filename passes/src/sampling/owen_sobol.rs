//! The first two dimensions of the Sobol sequence, with a hash instead of Owen's random permutations.
//!
//! Burley 2020, "Practical Hash-based Owen Scrambling", JCGT 9(4). Any 2^k consecutive points that start at a multiple of 2^k, and so any
//! first 2^k, put exactly one point into each elementary interval of area 2^-k.

/// Both dimensions of point `index` of the Sobol sequence, bits reversed (the first binary digit is the lowest bit).
#[must_use]
pub fn reversed_sobol(index: u32) -> [u32; 2] {
    // Dimension 0 is the van der Corput sequence: with reversed bits, the index itself. The columns of dimension 1 are those of Pascal's
    // triangle modulo 2: each is the one before, xor that one shifted by a digit.
    let (mut second, mut column, mut digits) = (0, 1, index);
    while digits != 0 {
        if digits & 1 != 0 {
            second ^= column;
        }
        column ^= column << 1;
        digits >>= 1;
    }
    [index, second]
}

/// The permutation of Laine and Karras with Burley's constants (section 3.1): each bit of the result depends only on the seed and on the
/// same and lower bits of `v`.
#[must_use]
#[inline(always)]
pub fn laine_karras(mut v: u32, seed: u32) -> u32 {
    v = v.wrapping_add(seed);
    v ^= v.wrapping_mul(0x6c50_b47c);
    v ^= v.wrapping_mul(0xb82f_1e52);
    v ^= v.wrapping_mul(0xc7af_e638);
    v ^= v.wrapping_mul(0x8d22_f6e6);
    v
}

/// Scrambles a coordinate given with reversed bits; the result has its first binary digit in the highest bit.
#[must_use]
#[inline(always)]
pub fn scramble_reversed(reversed: u32, seed: u32) -> u32 {
    laine_karras(reversed, seed).reverse_bits()
}
