//! Textures by definition: level 0, bilinear or the nearest texel, in `f64`.

use curitiba_pipeline::color::{ColorSpace, DECODED};
use curitiba_pipeline::scene::texture::{Texture, Wrap};
use glam::{DVec2, DVec4};

/// The texture's value at `uv`: bilinear between the centres of four texels of level 0, or the value of the texel that holds the point
/// (Vulkan 1.3, section 16.6).
/// Coarser levels are not read, because the samples of a pixel filter the texture.
pub(super) fn texel(texture: &Texture, uv: DVec2) -> DVec4 {
    let level = &texture.levels[0];
    let size = [i64::from(level.width), i64::from(level.height)];
    let fetch = |x: i64, y: i64| {
        let index = |at: i64, axis: usize| wrapped(texture.sampling.wrap[axis], at, size[axis]);
        // v grows upwards, while rows are stored from the top: wrap v first, then convert it to a row.
        let (column, row) = (index(x, 0), size[1] - 1 - index(y, 1));
        let [r, g, b, a] = level.texels[(row * size[0] + column) as usize];
        let color = |byte: u8| match texture.space {
            ColorSpace::Report => f64::from(byte) / 255.0,
            ColorSpace::Linear => f64::from(DECODED[usize::from(byte)]),
        };
        DVec4::new(color(r), color(g), color(b), f64::from(a) / 255.0)
    };
    if !uv.is_finite() {
        return fetch(0, size[1] - 1);
    }
    let scaled = uv * DVec2::new(size[0] as f64, size[1] as f64);
    if texture.sampling.is_nearest() {
        return fetch(scaled.x.floor() as i64, scaled.y.floor() as i64);
    }
    let at = scaled - 0.5;
    let (corner, share) = (at.floor(), at - at.floor());
    let (x, y) = (corner.x as i64, corner.y as i64);
    let (right, up) = (x.saturating_add(1), y.saturating_add(1));
    let lower = fetch(x, y).lerp(fetch(right, y), share.x);
    let upper = fetch(x, up).lerp(fetch(right, up), share.x);
    lower.lerp(upper, share.y)
}

/// The index of the texel that replaces an index beyond the sides.
fn wrapped(wrap: Wrap, index: i64, count: i64) -> i64 {
    match wrap {
        Wrap::Repeat => index.rem_euclid(count),
        Wrap::Clamp => index.clamp(0, count - 1),
        Wrap::Mirror => {
            let twice = index.rem_euclid(2 * count);
            if twice < count { twice } else { 2 * count - 1 - twice }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use curitiba_pipeline::scene::texture::Magnification;
    use glam::Vec2;

    /// Compares with the renderer's sampler in `f32`. The two share only the definition.
    #[test]
    fn texels_are_those_of_the_rasteriser_at_level_0() {
        let texels: Vec<[u8; 4]> = (0..15_u8).map(|i| [i * 17, 255 - i * 9, i.wrapping_mul(77), 40 + i * 10]).collect();
        for wrap in [[Wrap::Repeat; 2], [Wrap::Mirror, Wrap::Clamp], [Wrap::Clamp, Wrap::Mirror]] {
            let texture = Texture::new("t".into(), 5, 3, texels.clone()).wrapped(wrap);
            let mut control = 0.0_f64;
            for step in 0..400_u32 {
                let uv = DVec2::new(f64::from(step) * 0.0173 - 2.1, 1.9 - f64::from(step) * 0.0091);
                let theirs = texture.sample(uv.as_vec2(), 0.0).as_dvec4();
                let off = (texel(&texture, uv) - theirs).abs().max_element();
                assert!(off < 1e-5, "{wrap:?} {uv}: {off}");
                let upside_down = Vec2::new(uv.x as f32, 1.0 - uv.y as f32);
                control = control.max((texture.sample(upside_down, 0.0).as_dvec4() - theirs).abs().max_element());
                let nearest = texture.clone().magnified(Magnification::Nearest);
                let off = (texel(&nearest, uv) - nearest.sample(uv.as_vec2(), 0.0).as_dvec4()).abs().max_element();
                assert!(off < 1e-7, "nearest, {wrap:?} {uv}: {off}");
            }
            assert!(control > 0.1, "control: rows from the bottom go unnoticed");
        }
    }
}
