//! Arithmetic that gives the same bits on every platform: only IEEE additions, multiplications, divisions and square
//! roots. The standard library's `sin` and `cos` come from the platform's C library and differ in the last place.

use glam::Vec2;

/// Cosine and sine of `turn` full turns, within 1e-14.
pub(super) fn cos_sin(turn: f64) -> (f64, f64) {
    let quarters = (turn * 4.0).round();
    // At most an eighth of a turn in either direction; within it the Taylor series below converges.
    let x = (turn - quarters * 0.25) * std::f64::consts::TAU;
    let xx = x * x;
    let sin = x
        * (1.0
            - xx / 6.0
                * (1.0
                    - xx / 20.0
                        * (1.0
                            - xx / 42.0
                                * (1.0 - xx / 72.0 * (1.0 - xx / 110.0 * (1.0 - xx / 156.0 * (1.0 - xx / 210.0)))))));
    let cos = 1.0
        - xx / 2.0
            * (1.0
                - xx / 12.0
                    * (1.0
                        - xx / 30.0 * (1.0 - xx / 56.0 * (1.0 - xx / 90.0 * (1.0 - xx / 132.0 * (1.0 - xx / 182.0))))));
    match quarters.rem_euclid(4.0) as u32 {
        0 => (cos, sin),
        1 => (-sin, cos),
        2 => (-cos, -sin),
        _ => (sin, -cos),
    }
}

/// Point `index` of `count` on the unit circle, counted anticlockwise from `(1, 0)`.
pub(super) fn on_circle(index: u32, count: u32) -> Vec2 {
    let (cos, sin) = cos_sin(f64::from(index % count) / f64::from(count));
    Vec2::new(cos as f32, sin as f32)
}

/// A hash of three integers ("lowbias32" of C. Wellons, applied after each integer).
pub(super) fn hash(a: u32, b: u32, c: u32) -> u32 {
    fn mix(mut x: u32) -> u32 {
        x ^= x >> 16;
        x = x.wrapping_mul(0x7feb_352d);
        x ^= x >> 15;
        x = x.wrapping_mul(0x846c_a68b);
        x ^ (x >> 16)
    }
    mix(mix(mix(a.wrapping_add(0x9e37_79b9)) ^ b).wrapping_add(0x85eb_ca6b) ^ c)
}

/// A hash of three integers in `0.0..1.0`.
pub(super) fn hash01(a: u32, b: u32, c: u32) -> f32 {
    (hash(a, b, c) >> 8) as f32 / 16_777_216.0
}

/// A sequence of reproducible numbers.
#[derive(Debug, Clone)]
pub(super) struct Random {
    seed: u32,
    drawn: u32,
}

impl Random {
    pub(super) fn new(seed: u32) -> Self {
        Self { seed, drawn: 0 }
    }

    /// A number in `0.0..1.0`.
    pub(super) fn unit(&mut self) -> f32 {
        self.drawn = self.drawn.wrapping_add(1);
        hash01(self.seed, self.drawn, 0x51)
    }

    /// A number in `low..high`.
    pub(super) fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.unit()
    }

    /// True with the given probability.
    pub(super) fn chance(&mut self, probability: f32) -> bool {
        self.unit() < probability
    }
}

/// Smooth noise in 0..=1 that repeats after `period` cells along both axes.
pub(super) fn noise(at: Vec2, period: u32, seed: u32) -> f32 {
    let cell = at.floor();
    let fraction = at - cell;
    let ease = fraction * fraction * (Vec2::splat(3.0) - 2.0 * fraction);
    let wrap = |value: f32| (value as i64).rem_euclid(i64::from(period)) as u32;
    let (x0, y0) = (wrap(cell.x), wrap(cell.y));
    let (x1, y1) = ((x0 + 1) % period, (y0 + 1) % period);
    let upper = hash01(x0, y0, seed) * (1.0 - ease.x) + hash01(x1, y0, seed) * ease.x;
    let lower = hash01(x0, y1, seed) * (1.0 - ease.x) + hash01(x1, y1, seed) * ease.x;
    upper * (1.0 - ease.y) + lower * ease.y
}

/// `octaves` of [`noise`], each twice as fine and half as strong, in 0..=1.
pub(super) fn fractal(at: Vec2, period: u32, octaves: u32, seed: u32) -> f32 {
    let (mut sum, mut weight, mut total, mut scale) = (0.0, 1.0, 0.0, 1);
    for octave in 0..octaves {
        sum += weight * noise(at * scale as f32, period * scale, seed.wrapping_add(octave));
        total += weight;
        weight *= 0.5;
        scale *= 2;
    }
    sum / total
}

/// 0 below `from`, 1 above `to`, smooth between.
pub(super) fn smoothstep(from: f32, to: f32, x: f32) -> f32 {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cosine_and_sine_agree_with_the_standard_library() {
        for step in -2000..2000 {
            let turn = f64::from(step) / 777.0;
            let (cos, sin) = cos_sin(turn);
            let angle = turn * std::f64::consts::TAU;
            assert!((cos - angle.cos()).abs() < 1e-13 && (sin - angle.sin()).abs() < 1e-13, "turn {turn}");
        }
    }

    #[test]
    fn noise_repeats_after_its_period_and_is_not_constant() {
        let at = Vec2::new(1.3, 2.6);
        assert!((noise(at, 8, 1) - noise(at + Vec2::new(8.0, 16.0), 8, 1)).abs() < 1e-5);
        assert_ne!(noise(at, 8, 1), noise(at + Vec2::X, 8, 1));
        assert_ne!(noise(at, 8, 1), noise(at, 8, 2));
    }
}
