//! A picture as the window shows it.

use curitiba::pipeline::color::Display;
use curitiba::pipeline::executor::Renderer;
use curitiba::pipeline::image::{Content, Image, byte, make_visible};
use curitiba::pipeline::project::ChannelRef;
use rayon::prelude::*;

/// A picture: its numbers, and what a screen shows of them.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// What it is: `result`, or the full name of an output.
    pub name: String,
    /// Its numbers, as passes read them.
    pub image: Image,
    /// Names of the four numbers of a pixel.
    pub components: [&'static str; 4],
    /// Red, green, blue and 255: the bytes of the PNG file that `render` writes of it.
    pub bytes: Vec<[u8; 4]>,
}

impl Picture {
    /// The window's picture, or one that is to be compared with it.
    #[must_use]
    pub fn of_window(name: impl Into<String>, image: Image, display: Display) -> Self {
        let bytes = bytes(&image, display);
        Self { name: name.into(), image, components: ["R", "G", "B", "A"], bytes }
    }

    /// An output as `render --show` writes it: colours as they are displayed, positions and normals made visible.
    #[must_use]
    pub fn of_channel(name: impl Into<String>, renderer: &Renderer, channel: ChannelRef) -> Self {
        let plan = renderer.plan();
        let [width, height] = plan.target_size(Some(channel.target));
        let image = Image { width, height, pixels: renderer.channel(channel).to_vec() };
        let content = renderer.content(channel);
        let (bytes, components) = match content {
            Content::Color => (bytes(&image, plan.display), ["R", "G", "B", "A"]),
            Content::Position => (bytes(&make_visible(&image, content), Display::default()), ["X", "Y", "Z", "cosine"]),
            Content::Normal => (bytes(&make_visible(&image, content), Display::default()), ["X", "Y", "Z", "W"]),
        };
        Self { name: name.into(), image, components, bytes }
    }

    /// The numbers of a pixel, column and row from the top left; `None` outside.
    #[must_use]
    pub fn pixel(&self, [x, y]: [u32; 2]) -> Option<[f32; 4]> {
        let inside = x < self.image.width && y < self.image.height;
        inside.then(|| self.image.pixels[y as usize * self.image.width as usize + x as usize])
    }
}

fn bytes(image: &Image, display: Display) -> Vec<[u8; 4]> {
    let shown = |pixel: &[f32; 4]| {
        let [r, g, b, _] = display.stored(*pixel);
        [byte(r), byte(g), byte(b), 255]
    };
    image.pixels.par_iter().with_min_len(4096).map(shown).collect()
}
