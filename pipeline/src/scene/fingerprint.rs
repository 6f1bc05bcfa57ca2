//! Hashes that identify a scene by its contents.

use super::RenderScene;
use crate::color::ColorSpace;
use glam::DVec3;
use rayon::prelude::*;

/// 128-bit FNV-1a (Fowler, Noll and Vo; RFC 9923): the same on every machine and in every version of this program.
///
/// It detects accidental differences; it does not resist deliberate collisions.
#[must_use]
pub fn fnv1a(bytes: &[u8]) -> u128 {
    const OFFSET: u128 = 0x6c62_272e_07bb_0142_62b8_2175_6295_c58d;
    const PRIME: u128 = 0x0000_0000_0100_0000_0000_0000_0000_013b;
    bytes.iter().fold(OFFSET, |hash, byte| (hash ^ u128::from(*byte)).wrapping_mul(PRIME))
}

/// Bytes hashed by one task.
const CHUNK: usize = 1 << 18;

/// Hash of a long list: its chunks are hashed in parallel, then their hashes.
fn parts(bytes: &[u8]) -> [u8; 16] {
    let hashes: Vec<[u8; 16]> = bytes.par_chunks(CHUNK).map(|chunk| fnv1a(chunk).to_be_bytes()).collect();
    fnv1a(hashes.as_flattened()).to_be_bytes()
}

impl RenderScene {
    /// A hash of all parts of the scene that can affect a picture: geometry, materials and texels. It does not depend on the files
    /// that the scene came from.
    #[must_use]
    pub fn fingerprint(&self) -> u128 {
        let geometry = &self.geometry;
        let mut hashes = vec![
            parts(bytemuck::cast_slice(&geometry.positions)),
            parts(bytemuck::cast_slice(&geometry.normals)),
            parts(bytemuck::cast_slice(&geometry.texcoords)),
            parts(bytemuck::cast_slice(&geometry.triangles)),
            parts(format!("{:?}", geometry.batches).as_bytes()),
            parts(format!("{:?}", self.materials).as_bytes()),
        ];
        if !geometry.colors.is_empty() {
            hashes.push(parts(bytemuck::cast_slice(&geometry.colors)));
        }
        if !geometry.tangents.is_empty() {
            hashes.push(parts(bytemuck::cast_slice(&geometry.tangents)));
        }
        if !geometry.spheres.is_empty() {
            hashes.push(parts(format!("{:?}", geometry.spheres).as_bytes()));
        }
        if self.origin != DVec3::ZERO {
            hashes.push(parts(format!("{:?}", self.origin).as_bytes()));
        }
        for (index, texture) in self.textures.iter().enumerate().filter(|(_, texture)| !texture.repeats()) {
            hashes.push(parts(format!("{:?} of {index}", texture.sampling.wrap).as_bytes()));
        }
        for (index, _) in self.textures.iter().enumerate().filter(|(_, texture)| texture.sampling.is_nearest()) {
            hashes.push(parts(format!("nearest texels of {index}").as_bytes()));
        }
        let linear = self.textures.iter().map(|texture| texture.space == ColorSpace::Linear);
        if linear.clone().any(|linear| linear) {
            hashes.push(parts(&linear.map(u8::from).collect::<Vec<_>>()));
        }
        for level in self.textures.iter().flat_map(|texture| &texture.levels) {
            hashes.push(parts(format!("{} x {}", level.width, level.height).as_bytes()));
            hashes.push(parts(bytemuck::cast_slice(&level.texels)));
        }
        fnv1a(hashes.as_flattened())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::texture::{Magnification, Wrap};
    use crate::scene::{Batch, Geometry, Material, Texture};
    use glam::{Vec3, Vec4};

    #[test]
    fn the_hash_is_the_published_one() {
        assert_eq!(fnv1a(b""), 0x6c62_272e_07bb_0142_62b8_2175_6295_c58d);
        assert_eq!(fnv1a(b"a"), 0xd228_cb69_6f1a_8caf_7891_2b70_4e4a_8964);
        assert_eq!(fnv1a(b"foobar"), 0x343e_1662_793c_64bf_6f0d_3597_ba44_6f18);
    }

    #[test]
    fn whatever_changes_in_a_scene_changes_its_fingerprint() {
        let scene = RenderScene {
            geometry: Geometry {
                positions: vec![Vec3::X, Vec3::Y, Vec3::Z],
                triangles: vec![[0, 1, 2]],
                batches: vec![Batch { material: 0, first: 0, count: 1 }],
                ..Geometry::default()
            },
            materials: vec![Material::default()],
            textures: ["t", "u"].map(|name| Texture::new(name.to_owned(), 2, 1, vec![[1, 2, 3, 4]; 2])).to_vec(),
            ..RenderScene::default()
        };
        let changes: [fn(&mut RenderScene); 9] = [
            |scene| scene.geometry.positions[1].x = 1e-30,
            |scene| scene.geometry.triangles[0] = [0, 2, 1],
            |scene| scene.geometry.normals = vec![Vec3::X; 3],
            |scene| scene.geometry.colors = vec![Vec4::ONE; 3],
            |scene| scene.geometry.tangents = vec![Vec4::X; 3],
            |scene| scene.materials[0].diffuse.x = 0.1,
            |scene| scene.textures[0].levels[0].texels[1][2] = 9,
            |scene| scene.textures[0].space = ColorSpace::Linear,
            |scene| scene.origin.y = 4096.0,
        ];
        assert_eq!(scene.clone().fingerprint(), scene.fingerprint());
        for (index, change) in changes.iter().enumerate() {
            let mut changed = scene.clone();
            change(&mut changed);
            assert_ne!(changed.fingerprint(), scene.fingerprint(), "change {index}");
        }
        // The same change of another texture is another scene.
        let with = |change: fn(&mut Texture)| {
            [0, 1].map(|index| {
                let mut changed = scene.clone();
                change(&mut changed.textures[index]);
                changed.fingerprint()
            })
        };
        let changes: [fn(&mut Texture); 3] = [
            |texture| texture.sampling.wrap = [Wrap::Clamp; 2],
            |texture| texture.sampling.magnification = Magnification::Nearest,
            |texture| texture.space = ColorSpace::Linear,
        ];
        for change in changes {
            let [first, second] = with(change);
            assert_ne!(first, second);
        }
    }
}
