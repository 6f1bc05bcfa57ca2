//! Pictures as textures of the window's device.

use crate::worker::Picture;
use egui::{ColorImage, Context, TextureHandle, TextureOptions};
use std::sync::Arc;

/// A texture with the picture that it was made from, and whether it is magnified as squares.
#[derive(Default)]
pub(crate) struct Slot {
    held: Option<(Arc<Picture>, bool, TextureHandle)>,
}

/// The texture of a picture. It is made again if the picture or the magnification filter changed.
pub fn texture<'a>(context: &Context, slot: &'a mut Slot, picture: &Arc<Picture>, squares: bool) -> &'a TextureHandle {
    let serves = slot.held.as_ref().is_some_and(|(held, how, _)| Arc::ptr_eq(held, picture) && *how == squares);
    if !serves {
        let mut options = TextureOptions::LINEAR;
        if squares {
            options.magnification = egui::TextureFilter::Nearest;
        }
        let image = color_image(picture, context.input(|input| input.max_texture_side));
        let texture = match slot.held.take() {
            Some((_, _, mut texture)) => {
                texture.set(image, options);
                texture
            }
            None => context.load_texture("picture", image, options),
        };
        slot.held = Some((Arc::clone(picture), squares, texture));
    }
    &slot.held.as_ref().expect("it was made above").2
}

/// The picture as the texture's data: only every n-th pixel if it is larger than the device's largest texture.
fn color_image(picture: &Picture, most: usize) -> Arc<ColorImage> {
    let [width, height] = picture.shown.size;
    let step = width.max(height).div_ceil(most.max(1)).max(1);
    if step == 1 {
        return Arc::clone(&picture.shown);
    }
    let rows = picture.shown.pixels.chunks_exact(width).step_by(step);
    let pixels = rows.flat_map(|row| row.iter().step_by(step).copied()).collect();
    Arc::new(ColorImage::new([width.div_ceil(step), height.div_ceil(step)], pixels))
}
