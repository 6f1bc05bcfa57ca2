//! Counter-based hashes of the PCG family: four integers in, four out, no state.

/// Counter of [`dimensions`] for the scrambling seeds of a point set; above every sample number.
pub const SCRAMBLE: u32 = u32::MAX;

/// Counter of [`dimensions`] for the microfacets of a rough surface.
pub const FACETS: u32 = u32::MAX - 1;

/// Counter of [`dimensions`] for points of a light's disc.
pub const DISC: u32 = u32::MAX - 2;

/// Highest counter of [`dimensions`] for the choices of paths from the camera, which also use counters below it.
pub const PATHS: u32 = u32::MAX - 3;

/// Counter of [`dimensions`] for random decisions on paths in glass (Russian roulette).
pub const ROULETTE: u32 = 1 << 31;

/// Counter of [`dimensions`] for the part of the spectrum that a path in glass carries.
pub const SPECTRUM: u32 = ROULETTE + 1;

/// Counter of [`dimensions`] for the seed that shuffles the sample points of microfacets.
pub const FACET_ORDER: u32 = ROULETTE + 2;

/// Counter of [`dimensions`] for the place where a photon starts, on the disc that covers its target.
pub const PHOTON_PLACE: u32 = ROULETTE + 3;

/// Counter of [`dimensions`] for the direction of a photon. The counter before it seeds the shuffle of these directions.
pub const PHOTON_DIRECTION: u32 = ROULETTE + 5;

/// Counter of [`dimensions`] for the choice between reflection and refraction of a photon at a surface.
pub const PHOTON_WAY: u32 = ROULETTE + 6;

/// Branch of [`path_key`] for the second half of a pixel's sample.
pub const HALF: u32 = 1 << 30;

/// Added to a light's number: the branch of [`path_key`] for that light of a pass. Light 0 has the pixel's own key instead.
pub const LIGHTS: u32 = 1 << 29;

/// Last word of the input of [`pixel_key`]. Purposes with different last words never hash the same input. Only [`OCCLUSION`], [`PHOTON`]
/// and the points of `visibility` share one.
pub const PIXEL: u32 = 0;
/// Last word of the input of [`path_key`].
pub const PATH: u32 = 1;
/// Last word of the input of [`dimensions`].
pub const DIMENSIONS: u32 = 2;
/// Last word of the input of [`occlusion_bits`].
pub const OCCLUSION: u32 = 3;

/// Last word of the input of [`photon_key`].
pub const PHOTON: u32 = 3;

/// The hash `pcg4d` (Jarzynski and Olano 2020, "Hash Functions for GPU Rendering", JCGT 9(3), listing in section 4): a permutation of
/// 128-bit values. Written word by word: a vector in memory would be read just after its words were written, which stalls.
#[must_use]
#[inline(always)]
pub fn pcg4d([x, y, z, w]: [u32; 4]) -> [u32; 4] {
    let start = |word: u32| word.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
    let (mut x, mut y, mut z, mut w) = (start(x), start(y), start(z), start(w));
    let mut mix = |shift: bool| {
        x = x.wrapping_add(y.wrapping_mul(w));
        y = y.wrapping_add(z.wrapping_mul(x));
        z = z.wrapping_add(x.wrapping_mul(y));
        w = w.wrapping_add(y.wrapping_mul(z));
        if shift {
            (x, y, z, w) = (x ^ (x >> 16), y ^ (y >> 16), z ^ (z >> 16), w ^ (w >> 16));
        }
    };
    mix(true);
    mix(false);
    [x, y, z, w]
}

/// The key of a pixel: all its random numbers derive from this.
#[must_use]
#[inline(always)]
pub fn pixel_key(x: u32, y: u32, seed: u32) -> u32 {
    pcg4d([x, y, seed, PIXEL])[3]
}

/// The key of the photons that are shot at one of a scene's targets, in run number `round` of the sequence.
#[must_use]
pub fn photon_key(target: u32, round: u32, seed: u32) -> u32 {
    // One word holds both target and round, because both are small: there are few targets, and a round has 2^32 photons.
    pcg4d([target ^ round.rotate_left(16), seed, 0, PHOTON])[3]
}

/// The key for the surface that a ray along `branch` hits: each path has random numbers of its own.
#[must_use]
pub fn path_key(key: u32, branch: u32) -> u32 {
    pcg4d([key, branch, 0, PATH])[3]
}

/// The key for a light of a pass, by its number: the discs of several lights have random numbers of their own.
#[must_use]
pub fn light_key(key: u32, number: u32) -> u32 {
    if number == 0 { key } else { path_key(key, LIGHTS + number) }
}

/// Two independent random words for a key and a counter, one a dimension.
#[must_use]
#[inline(always)]
pub fn dimensions(key: u32, counter: u32) -> [u32; 2] {
    let [_, _, x, y] = pcg4d([key, counter, 0, DIMENSIONS]);
    [x, y]
}

/// Four random words of a pixel: all that screen-space occlusion needs.
#[must_use]
#[inline(always)]
pub fn occlusion_bits(x: u32, y: u32, seed: u32) -> [u32; 4] {
    pcg4d([x, y, seed, OCCLUSION])
}

/// The 23 high bits as a number in [0, 1); exact. Without a conversion from integers, which graphics processors do slowly.
#[must_use]
#[inline(always)]
pub fn fraction(bits: u32) -> f32 {
    f32::from_bits((bits >> 9) | 0x3f80_0000) - 1.0
}

/// The 24 high bits as a number in [0, 1); exact.
#[must_use]
#[inline(always)]
pub fn unit(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / 16_777_216.0)
}
