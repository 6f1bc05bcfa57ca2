//! A picture as the window shows it.

use crate::texture::{Device, OnDevice, Texture};
use curitiba::pipeline::color::Display;
use curitiba::pipeline::executor::Renderer;
use curitiba::pipeline::image::{Content, Image, byte, make_visible};
use curitiba::pipeline::plan::Plan;
use curitiba::pipeline::project::ChannelRef;
use egui::{Color32, ColorImage};
use rayon::prelude::*;
use std::sync::Arc;

/// A picture: its values, and the colours that the screen shows.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// Its name: `result`, or the full name of an output.
    pub name: String,
    /// Its values, as passes read them.
    pub image: Image,
    /// The size at which it is shown. It differs from the picture's own size only while the camera moves and the picture has fewer pixels.
    pub whole: [u32; 2],
    /// Names of the four components of a pixel.
    pub components: [&'static str; 4],
    /// The colours on the screen: those of the PNG file that `render` writes. They are uploaded to the window's device unchanged.
    pub shown: Arc<ColorImage>,
    on_device: OnDevice,
}

impl Picture {
    /// A picture that is shown at its own size and whose values are colours, as in the window's picture: for example a picture from a file.
    #[must_use]
    pub fn of_window(name: impl Into<String>, image: Image, display: Display) -> Self {
        let (shown, whole) = (shown(&image, display), [image.width, image.height]);
        Self {
            name: name.into(),
            image,
            whole,
            components: ["R", "G", "B", "W"],
            shown,
            on_device: OnDevice::default(),
        }
    }

    /// The result: the window's picture.
    #[must_use]
    pub fn of_result(image: Image, plan: &Plan) -> Self {
        let reduced = plan.settings.preview.is_some_and(|preview| preview.divisor > 1);
        let own = Self::of_window("result", image, plan.display);
        Self { whole: if reduced { plan.whole_size(None) } else { own.whole }, ..own }
    }

    /// An output as `render --show` writes it: colours as they are displayed, positions and normals made visible.
    #[must_use]
    pub fn of_channel(name: impl Into<String>, renderer: &Renderer, channel: ChannelRef) -> Self {
        let plan = renderer.plan();
        let image = renderer.channel_image(channel);
        let reduced = plan.settings.preview.is_some_and(|preview| preview.divisor > 1);
        let whole = if reduced { plan.whole_size(Some(channel.target)) } else { [image.width, image.height] };
        let content = renderer.content(channel);
        let (shown, components) = match content {
            Content::Color => (shown(&image, plan.display), ["R", "G", "B", "W"]),
            Content::Position => (shown(&make_visible(&image, content), Display::default()), ["X", "Y", "Z", "cosine"]),
            Content::Normal => (shown(&make_visible(&image, content), Display::default()), ["X", "Y", "Z", "W"]),
        };
        Self { name: name.into(), image, whole, components, shown, on_device: OnDevice::default() }
    }

    /// The picture's texture, which no other picture uses as long as this value exists. The first caller uploads the picture to the device; other
    /// callers wait for the upload.
    ///
    /// # Errors
    /// If the device cannot hold the picture.
    pub(crate) fn on(&self, device: &Device) -> Result<&Texture, &str> {
        self.on_device.get(device, &self.shown)
    }

    /// Whether it has fewer pixels than the size at which it is shown.
    #[must_use]
    pub fn is_reduced(&self) -> bool {
        self.whole != [self.image.width, self.image.height]
    }

    /// The values of a pixel at coordinates of [`Self::whole`], column and row from the top left; `None` outside.
    #[must_use]
    pub fn pixel(&self, at: [u32; 2]) -> Option<[f32; 4]> {
        let held = [self.image.width, self.image.height];
        // The pixel of the picture that contains the centre of the shown pixel.
        let [x, y] = [0, 1].map(|axis| {
            let middle = (2 * u64::from(at[axis]) + 1) * u64::from(held[axis]);
            (middle / (2 * u64::from(self.whole[axis]))) as usize
        });
        let inside = at[0] < self.whole[0] && at[1] < self.whole[1];
        inside.then(|| self.image.pixels[y * held[0] as usize + x])
    }
}

fn shown(image: &Image, display: Display) -> Arc<ColorImage> {
    let color = |pixel: &[f32; 4]| {
        let [r, g, b, _] = display.stored(*pixel);
        Color32::from_rgb(byte(r), byte(g), byte(b))
    };
    let colors = image.pixels.par_iter().with_min_len(4096).map(color).collect();
    Arc::new(ColorImage::new([image.width, image.height].map(|side| side as usize), colors))
}
