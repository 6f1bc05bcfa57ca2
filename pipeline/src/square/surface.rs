//! The materials of the square.

use super::paint::Picture;
use crate::scene::Material;
use glam::Vec4;

/// The surface of a triangle, in the order of the scene's materials.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Surface {
    Setts,
    Basalt,
    Slabs,
    SettStone,
    BasaltStone,
    SlabStone,
    Granite,
    Ashlar,
    PlasterWhite,
    PlasterCream,
    PlasterOchre,
    PlasterRose,
    Glazed,
    RoofTiles,
    Terracotta,
    Timber,
    PaintWhite,
    PaintGreen,
    PaintRed,
    Iron,
    Glass,
    Curtain,
    Room,
    ShopFloor,
    ShopWall,
    ShopShelf,
    Brass,
    Bark,
    Foliage,
    FoliageDark,
    Water,
    Spray,
    Lantern,
    Canvas,
    Garden,
    Forest,
    Ridge,
    Sky,
}

/// Name, diffuse colour, texture, and the length in metres of one repeat of the texture.
struct Look {
    name: &'static str,
    diffuse: [f32; 3],
    picture: Option<(Picture, f32)>,
}

const fn plain(name: &'static str, diffuse: [f32; 3]) -> Look {
    Look { name, diffuse, picture: None }
}

const fn painted(name: &'static str, picture: Picture, metres: f32) -> Look {
    Look { name, diffuse: [1.0; 3], picture: Some((picture, metres)) }
}

impl Surface {
    pub(super) const ALL: [Surface; 38] = [
        Self::Setts,
        Self::Basalt,
        Self::Slabs,
        Self::SettStone,
        Self::BasaltStone,
        Self::SlabStone,
        Self::Granite,
        Self::Ashlar,
        Self::PlasterWhite,
        Self::PlasterCream,
        Self::PlasterOchre,
        Self::PlasterRose,
        Self::Glazed,
        Self::RoofTiles,
        Self::Terracotta,
        Self::Timber,
        Self::PaintWhite,
        Self::PaintGreen,
        Self::PaintRed,
        Self::Iron,
        Self::Glass,
        Self::Curtain,
        Self::Room,
        Self::ShopFloor,
        Self::ShopWall,
        Self::ShopShelf,
        Self::Brass,
        Self::Bark,
        Self::Foliage,
        Self::FoliageDark,
        Self::Water,
        Self::Spray,
        Self::Lantern,
        Self::Canvas,
        Self::Garden,
        Self::Forest,
        Self::Ridge,
        Self::Sky,
    ];

    fn look(self) -> Look {
        match self {
            Self::Setts => painted("Calcada", Picture::Setts, 4.0),
            Self::Basalt => painted("Basalto", Picture::Basalt, 2.0),
            Self::Slabs => painted("Lajes", Picture::Slabs, 2.4),
            Self::SettStone => painted("Cubo", Picture::SettStone, 1.0),
            Self::BasaltStone => painted("Cubo de basalto", Picture::BasaltStone, 1.0),
            Self::SlabStone => painted("Laje", Picture::SlabStone, 1.5),
            Self::Granite => painted("Granito", Picture::Granite, 1.5),
            Self::Ashlar => painted("Cantaria", Picture::Ashlar, 1.8),
            Self::PlasterWhite => painted("Reboco branco", Picture::PlasterWhite, 3.7),
            Self::PlasterCream => painted("Reboco creme", Picture::PlasterCream, 3.7),
            Self::PlasterOchre => painted("Reboco ocre", Picture::PlasterOchre, 3.7),
            Self::PlasterRose => painted("Reboco rosa", Picture::PlasterRose, 3.7),
            Self::Glazed => painted("Azulejo", Picture::Azulejo, 0.6),
            Self::RoofTiles => painted("Telha", Picture::RoofTiles, 2.88),
            Self::Terracotta => painted("Barro", Picture::Terracotta, 2.3),
            Self::Timber => painted("Madeira", Picture::Timber, 0.8),
            Self::PaintWhite => plain("Tinta branca", [0.84, 0.84, 0.80]),
            Self::PaintGreen => plain("Tinta verde", [0.13, 0.29, 0.20]),
            Self::PaintRed => plain("Tinta vermelha", [0.46, 0.13, 0.11]),
            Self::Iron => plain("Ferro", [0.10, 0.11, 0.12]),
            Self::Glass => plain("Vidro", [0.55, 0.65, 0.68]),
            Self::Curtain => plain("Cortina", [0.74, 0.71, 0.64]),
            Self::Room => plain("Sala", [0.21, 0.17, 0.14]),
            Self::ShopFloor => painted("Ladrilho", Picture::Checker, 1.2),
            Self::ShopWall => plain("Parede do cafe", [0.17, 0.12, 0.09]),
            Self::ShopShelf => painted("Garrafas", Picture::Bottles, 1.2),
            Self::Brass => plain("Latao", [0.80, 0.60, 0.25]),
            Self::Bark => painted("Casca", Picture::Bark, 0.9),
            Self::Foliage => painted("Folhagem", Picture::Foliage, 1.6),
            Self::FoliageDark => painted("Copa", Picture::Canopy, 1.6),
            Self::Water => painted("Agua", Picture::Water, 2.2),
            Self::Spray => plain("Jacto", [0.82, 0.90, 0.93]),
            Self::Lantern => plain("Lanterna", [0.93, 0.88, 0.70]),
            Self::Canvas => plain("Lona", [0.92, 0.88, 0.76]),
            Self::Garden => painted("Quintal", Picture::Garden, 21.0),
            Self::Forest => painted("Monte", Picture::Forest, 67.0),
            Self::Ridge => plain("Serra", [0.43, 0.54, 0.63]),
            Self::Sky => painted("Ceu", Picture::Sky, 1.0),
        }
    }

    /// Length of one repeat of the texture, metres.
    pub(super) fn metres(self) -> f32 {
        self.look().picture.map_or(1.0, |(_, metres)| metres)
    }

    /// The texture of the surface.
    pub(super) fn picture(self) -> Option<Picture> {
        self.look().picture.map(|(picture, _)| picture)
    }

    /// The scene's material; `texture` is the index of its texture.
    pub(super) fn material(self, texture: Option<u32>) -> Material {
        let look = self.look();
        let [red, green, blue] = look.diffuse;
        Material {
            name: look.name.to_owned(),
            diffuse: Vec4::new(red, green, blue, 1.0),
            ambient: Vec4::new(0.3 * red, 0.3 * green, 0.3 * blue, 1.0),
            texture,
            ..Material::default()
        }
    }
}
