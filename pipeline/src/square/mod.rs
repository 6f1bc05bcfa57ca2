//! The generated stand-in scene: a town square with a fountain.
//!
//! The report's model, the Largo de Camões in Ponte de Lima, is not free to ship. This square resembles it, at any triangle count,
//! so that the same projects, cameras and sun work on it: granite paving, a stone fountain, houses with granite-framed openings and
//! panes of the material `Vidro`, arcades, lamps, trees, hills and sky. Units are metres, y is up. The same count gives the same
//! bits on every platform.

mod backdrop;
mod cafe;
mod church;
mod detail;
mod facade;
mod fountain;
mod ground;
mod house;
mod math;
mod mesh;
mod opening;
mod paint;
mod pillory;
mod roof;
mod street;
mod surface;
#[cfg(test)]
mod tests;
mod town;
mod tree;
mod write;

pub use write::{SCENE_FILE, TEXTURE_FOLDER};

use crate::scene::{Object, Scene, TextureSource};
use detail::Detail;
use glam::{Mat4, Vec2, Vec3};
use ground::Paving;
use mesh::Builder;
use paint::Picture;
use roof::Tiling;
use street::Placed;
use surface::Surface;

/// Centre of the fountain, x and z.
const FOUNTAIN: Vec2 = Vec2::new(22.0, 3.0);
/// Direction in which the sun's light travels in the projects.
const SUN: Vec3 = Vec3::new(0.597, -0.390, 0.700);
/// Approximate number of triangles of the scene that the projects come with.
pub const SHIPPED_TRIANGLES: u32 = 56_000;
/// Least and largest number of triangles that [`generate`] makes.
pub const TRIANGLES: std::ops::RangeInclusive<u32> = 10_000..=40_000_000;

/// A texture of the square.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Painting {
    /// Name of the file.
    pub name: &'static str,
    /// Texels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// RGBA, top row first.
    pub texels: Vec<[u8; 4]>,
}

/// A generated square.
#[derive(Debug, Clone)]
pub struct Square {
    /// Geometry, materials, and the textures as embedded images: it renders without being written to files.
    pub scene: Scene,
    /// The textures, in the order of [`Scene::textures`].
    pub paintings: Vec<Painting>,
}

/// Position (x, z) of each tree, and the index of its shape.
const TREES: [(f32, f32, usize); 9] = [
    (43.6, -9.0, 0),
    (43.4, 0.0, 1),
    (43.8, 9.0, 2),
    (43.4, 18.0, 0),
    (5.2, 10.5, 1),
    (5.6, 19.5, 2),
    (30.5, 27.0, 1),
    (6.0, -4.5, 0),
    (25.5, -19.0, 2),
];

/// Builds the square with about `triangles` triangles (within 15 %); a mesh placed several times counts each time. Numbers outside
/// [`TRIANGLES`] are clamped to it. Paving, roof tiles and leaves are refined most, where detail shows.
#[must_use]
pub fn generate(triangles: u32) -> Square {
    let wanted = triangles.clamp(*TRIANGLES.start(), *TRIANGLES.end()) as usize;
    let detail = Detail::of(wanted as u32);
    let mut houses = Builder::default();
    let slopes = town::build(&mut houses, detail);
    let fountain = fountain::build(detail);
    let backdrop = backdrop::build(detail);
    let street = street::build(detail);
    let trees = [tree::Tree::new(7.6, 11), tree::Tree::new(8.6, 12), tree::Tree::new(6.9, 13)];
    let mut crowns = trees.each_ref().map(|tree| {
        let mut builder = Builder::default();
        tree.build(&mut builder, detail);
        builder
    });

    let placed: usize = street.iter().map(|thing| thing.builder.triangles() * thing.places.len()).sum();
    let crowned: usize = TREES.iter().map(|&(_, _, shape)| crowns[shape].triangles()).sum();
    let fixed = houses.triangles() + fountain.triangles() + backdrop.triangles() + placed + crowned;
    let coarse = detail.tier == 0;
    let mut left = wanted.saturating_sub(fixed);

    // The finest paving and tiles that fit into their share; leaves take the rest.
    let paving_cost = |paving: Paving| ground::triangles(paving, coarse);
    let paving = finest(&Paving::ALL, paving_cost, left * 4 / 10);
    left = left.saturating_sub(paving_cost(paving));
    let tiling_cost = |tiling: Tiling| slopes.iter().map(|slope| slope.triangles(tiling)).sum::<usize>();
    let tiling = finest(&Tiling::ALL, tiling_cost, left * 6 / 10);
    left = left.saturating_sub(tiling_cost(tiling));
    for slope in &slopes {
        slope.build(&mut houses, tiling);
    }
    let leaves = left / (2 * TREES.len());
    for (tree, builder) in trees.iter().zip(&mut crowns) {
        tree.leaves(builder, leaves);
    }

    let mut parts = vec![
        Placed { name: "paving", builder: ground::build(paving, coarse), places: vec![Vec3::ZERO] },
        Placed { name: "fountain", builder: fountain, places: vec![Vec3::ZERO] },
        Placed { name: "houses", builder: houses, places: vec![Vec3::ZERO] },
        Placed { name: "backdrop", builder: backdrop, places: vec![Vec3::ZERO] },
    ];
    parts.extend(street);
    for (shape, (name, builder)) in ["limes", "planes", "oaks"].into_iter().zip(crowns).enumerate() {
        let places = TREES.iter().filter(|tree| tree.2 == shape).map(|&(x, z, _)| Vec3::new(x, 0.0, z)).collect();
        parts.push(Placed { name, builder, places });
    }
    assemble(parts)
}

/// The last of `options`, which go from coarse to fine, that costs at most `budget`; the first if none does.
fn finest<T: Copy>(options: &[T], cost: impl Fn(T) -> usize, budget: usize) -> T {
    options.iter().rev().copied().find(|&option| cost(option) <= budget).unwrap_or(options[0])
}

fn assemble(parts: Vec<Placed>) -> Square {
    let mut used = [false; Surface::ALL.len()];
    for part in &parts {
        part.builder.mark_used(&mut used);
    }
    let used = |surface: &Surface| used[*surface as usize];
    let pictures: Vec<Picture> = Picture::ALL
        .into_iter()
        .filter(|&picture| {
            Surface::ALL.iter().filter(|surface| used(surface)).any(|surface| surface.picture() == Some(picture))
        })
        .collect();
    let texture = |picture: Picture| pictures.iter().position(|&other| other == picture).map(|index| index as u32);
    let mut scene = Scene::default();
    let mut materials = [None; Surface::ALL.len()];
    for surface in Surface::ALL.iter().filter(|surface| used(surface)) {
        materials[*surface as usize] = Some(scene.materials.len() as u32);
        scene.materials.push(surface.material(surface.picture().and_then(texture)));
    }
    for part in parts {
        let mesh = scene.meshes.len() as u32;
        for (index, &place) in part.places.iter().enumerate() {
            let name =
                if part.places.len() == 1 { part.name.to_owned() } else { format!("{}-{}", part.name, index + 1) };
            scene.objects.push(Object { name, mesh, transform: Mat4::from_translation(place) });
        }
        scene.meshes.push(part.builder.finish(part.name, &materials));
    }
    let paintings: Vec<Painting> = pictures
        .into_iter()
        .map(|picture| {
            let (name, width, height) = picture.file();
            Painting { name, width, height, texels: picture.texels() }
        })
        .collect();
    let embedded = |painting: &Painting| {
        let png = painting.png().expect("a painting has as many texels as its size says, and memory takes any file");
        TextureSource::Embedded { name: painting.name.to_owned(), bytes: png.into() }
    };
    scene.textures = paintings.iter().map(embedded).collect();
    Square { scene, paintings }
}
