//! Photons that have landed on surfaces, and the light that they bring there.
//!
//! A photon carries power, by colour: the area of the part of the light's cross section that the photon represents, where the light's irradiance
//! across its direction is 1. The irradiance at a point is the sum of the powers that landed within a radius r, each weighted by Epanechnikov's
//! kernel 2 / (π r²) (1 - d² / r²) of its distance d, whose integral over the disc is 1 (Jensen, "Global Illumination using Photon Maps", EGWR
//! 1996, with another kernel).
//!
//! The sum has two errors: the blur, which falls as r², and the noise of the number of photons in the disc. Both fall where r is proportional to
//! the number of photons to the power of -1/6. Over batches, r is the progressive radius of Knaus and Zwicker ("Progressive Photon Mapping: A
//! Probabilistic Approach", ACM TOG 30(3), 2011, equation 20) with alpha = 2/3, so that the mean over batches converges to the right value.
//!
//! Photons are found by a table of cells. They are sorted by cell and number, so that sums have the same order whichever thread shot a photon.

use bytemuck::{Pod, Zeroable};
use curitiba_pipeline::backend::PhotonCounts;
use curitiba_pipeline::memory::{Refused, zeroed};
use curitiba_pipeline::programs::PHOTON_BYTES;
use glam::{IVec3, Vec3};
use rayon::prelude::*;

/// Least cosine between the normals at a point and at a photon for which both count as on the same surface.
pub const ALIKE: f32 = 0.7;

/// Greatest distance of a photon from the tangent plane of a point, as a share of the radius.
pub const FLAT: f32 = 0.3;

/// Radius of the discs for one photon, as a share of the target's radius: for a million photons the share is 0.015.
const SPREAD: f64 = 0.15;

/// A photon on a surface. Device programs read it word by word.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Photon {
    /// Where it landed, world.
    pub position: Vec3,
    /// Unit direction in which it came.
    pub direction: Vec3,
    /// Unit geometric normal there, on the side that it came from.
    pub normal: Vec3,
    /// Its power, by colour; see the module's documentation. 0 for a photon that did not land.
    pub power: Vec3,
    /// Its number among those that were shot at the same target.
    pub number: u32,
    /// Its entry in the table of cells.
    bucket: u32,
}

// The table has one entry for each photon, rounded up to a power of two.
const _: () = assert!(size_of::<Photon>() as u64 + 2 * 4 <= PHOTON_BYTES);

impl Photon {
    /// A photon that did not land.
    pub const NONE: Self = Self {
        position: Vec3::ZERO,
        direction: Vec3::ZERO,
        normal: Vec3::ZERO,
        power: Vec3::ZERO,
        number: 0,
        bucket: 0,
    };

    /// A photon that landed.
    #[must_use]
    pub fn new(position: Vec3, (direction, normal): (Vec3, Vec3), power: Vec3, number: u32) -> Self {
        Self { position, direction, normal, power, number, bucket: 0 }
    }
}

/// Least radius of the discs, as a share of the target's radius. It keeps the kernel's weights and the numbers of cells finite.
const LEAST: f64 = 1e-5;

/// The radius of the discs of a target of radius `target`, for `photons` photons in batch `batch`. `chosen` is the radius of the discs in the
/// first batch; 0 chooses one.
#[must_use]
pub fn radius(chosen: f32, target: f64, photons: u32, batch: u32) -> f32 {
    let first =
        if chosen > 0.0 { f64::from(chosen) } else { SPREAD * target * f64::from(photons.max(1)).powf(-1.0 / 6.0) };
    let square: f64 = (1..=batch).map(|k| (f64::from(k) + 2.0 / 3.0) / (f64::from(k) + 1.0)).product();
    (first * square.sqrt()).max(LEAST * target) as f32
}

/// The photons of one target.
#[derive(Debug)]
pub struct Cloud {
    photons: Vec<Photon>,
    /// For each entry of the table its first photon, and at the end the number of photons.
    starts: Vec<u32>,
    low: Vec3,
    high: Vec3,
    radius: f32,
    cells_a_unit: f32,
}

impl Cloud {
    /// Builds the table of photons, to be averaged over discs of radius `radius` (above 0). Photons of power 0 are left out.
    ///
    /// # Errors
    /// If there is too little memory for the table.
    pub fn new(mut photons: Vec<Photon>, radius: f32) -> Result<Self, Refused> {
        photons.retain(|photon| photon.power != Vec3::ZERO);
        let entries = photons.len().next_power_of_two();
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for photon in &photons {
            (low, high) = (low.min(photon.position), high.max(photon.position));
        }
        let cells_a_unit = cells_a_unit([low, high], radius);
        let mut cloud = Self { photons, starts: zeroed(entries + 1)?, low, high, radius, cells_a_unit };
        cloud
            .photons
            .par_iter_mut()
            .for_each(|photon| photon.bucket = bucket((photon.position * cells_a_unit).floor().as_ivec3(), entries));
        cloud.photons.par_sort_unstable_by_key(|photon| (photon.bucket, photon.number));
        for photon in &cloud.photons {
            cloud.starts[photon.bucket as usize + 1] += 1;
        }
        for entry in 0..entries {
            cloud.starts[entry + 1] += cloud.starts[entry];
        }
        Ok(cloud)
    }

    /// The photons, sorted by cell and number.
    #[must_use]
    pub fn photons(&self) -> &[Photon] {
        &self.photons
    }

    /// For each entry of the table of cells the index of its first photon, and at the end the number of photons. The number of entries is a power
    /// of two.
    #[must_use]
    pub fn starts(&self) -> &[u32] {
        &self.starts
    }

    /// Greatest number of photons that are looked at for a point.
    #[must_use]
    pub fn most_near(&self) -> u64 {
        let longest = self.starts.windows(2).map(|ends| ends[1] - ends[0]).max();
        (8 * u64::from(longest.unwrap_or(0))).min(self.photons.len() as u64)
    }

    /// Low and high corner of the photons' bounds.
    #[must_use]
    pub fn bounds(&self) -> [Vec3; 2] {
        [self.low, self.high]
    }

    /// Radius of the discs.
    #[must_use]
    pub fn radius(&self) -> f32 {
        self.radius
    }

    /// Number of cells per scene unit. A disc touches at most two cells along each axis.
    #[must_use]
    pub fn cells_a_unit(&self) -> f32 {
        self.cells_a_unit
    }

    /// The kernel's weight at distance 0, in 1 / area.
    #[must_use]
    pub fn greatest_weight(&self) -> f32 {
        2.0 / (std::f32::consts::PI * self.radius * self.radius)
    }

    /// Calls `each` with every photon that landed near a point on the side of a surface with this unit normal, and with the kernel's weight there,
    /// in 1 / area.
    fn each_near(&self, point: Vec3, normal: Vec3, mut each: impl FnMut(&Photon, f32)) {
        let radius = self.radius;
        if point.cmplt(self.low - radius).any() || point.cmpgt(self.high + radius).any() {
            return;
        }
        let (square, whole) = (radius * radius, self.greatest_weight());
        let side = self.cells_a_unit;
        let [low, high] = [point - radius, point + radius].map(|corner| (corner * side).floor().as_ivec3());
        // Two cells may share an entry of the table; its photons count once.
        let (mut seen, mut count) = ([0; 8], 0);
        for corner in 0..8 {
            let pick = |axis: usize| if corner >> axis & 1 == 0 { low[axis] } else { high[axis] };
            let entry = bucket(IVec3::new(pick(0), pick(1), pick(2)), self.starts.len() - 1) as usize;
            if seen[..count].contains(&entry) {
                continue;
            }
            seen[count] = entry;
            count += 1;
            for photon in &self.photons[self.starts[entry] as usize..self.starts[entry + 1] as usize] {
                let from = photon.position - point;
                let height = from.dot(normal);
                let distance = from.length_squared() - height * height;
                let same = photon.normal.dot(normal) >= ALIKE && photon.direction.dot(normal) < 0.0;
                if distance < square && height.abs() <= FLAT * radius && same {
                    each(photon, whole * (1.0 - distance.max(0.0) / square));
                }
            }
        }
    }
}

/// Number of cells per scene unit for discs of radius `radius` around points near these bounds.
///
/// Both ends of a disc are computed in `f32`, in cells, and each is off by up to 2^-23 of its distance from the origin. With cells exactly as wide
/// as a disc the two numbers could differ by more than 1, and the cell between them would be left out. So cells are wider by four such errors.
fn cells_a_unit([low, high]: [Vec3; 2], radius: f32) -> f32 {
    let radius = f64::from(radius);
    let farthest = f64::from(low.abs().max(high.abs()).max_element()) + 2.0 * radius;
    let wider = 4.0 * f64::from(f32::EPSILON) * farthest / (2.0 * radius);
    (0.5 / (radius * (1.0 + wider))) as f32
}

/// The entry of a cell in a table whose length is a power of two (Teschner and others, "Optimized Spatial Hashing for Collision Detection of
/// Deformable Objects", VMV 2003).
fn bucket(cell: IVec3, entries: usize) -> u32 {
    let [x, y, z] = cell.to_array().map(|coordinate| coordinate as u32);
    let mixed = x.wrapping_mul(73_856_093) ^ y.wrapping_mul(19_349_663) ^ z.wrapping_mul(83_492_791);
    // The low bits of such products depend on the low bits of the coordinates alone, so higher bits are mixed in.
    (mixed ^ mixed >> 15) & (entries - 1) as u32
}

/// All photons of a pass.
#[derive(Debug, Default)]
pub struct PhotonMap {
    clouds: Vec<Cloud>,
    /// Counts of the photons that were shot.
    pub counts: PhotonCounts,
}

impl PhotonMap {
    /// The map of the photons of each target.
    #[must_use]
    pub fn new(clouds: Vec<Cloud>, counts: PhotonCounts) -> Self {
        Self { clouds, counts }
    }

    /// The photons of each target.
    #[must_use]
    pub fn clouds(&self) -> &[Cloud] {
        &self.clouds
    }

    /// Whether no photons were shot.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.clouds.is_empty()
    }

    /// Calls `each` with every photon that landed near a point on the side of a surface with this unit normal, and with the kernel's weight there,
    /// in 1 / area.
    pub fn each_near(&self, point: Vec3, normal: Vec3, mut each: impl FnMut(&Photon, f32)) {
        for cloud in &self.clouds {
            cloud.each_near(point, normal, &mut each);
        }
    }

    /// The irradiance on the side of a surface with this unit normal, by colour; 1 is the light's irradiance across its direction.
    #[must_use]
    pub fn irradiance(&self, point: Vec3, normal: Vec3) -> Vec3 {
        let mut sum = Vec3::ZERO;
        self.each_near(point, normal, |photon, weight| sum += photon.power * weight);
        sum
    }

    /// Number of targets.
    #[cfg(test)]
    pub fn targets(&self) -> usize {
        self.clouds.len()
    }

    /// The power of all photons that landed.
    #[cfg(test)]
    pub fn power(&self) -> Vec3 {
        let of = |photon: &Photon| photon.power.as_dvec3();
        self.clouds.iter().flat_map(|cloud| &cloud.photons).map(of).sum::<glam::DVec3>().as_vec3()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The photons that are found near a point, and those that lie within the radius.
    fn found(radius: f32, positions: &[Vec3], point: Vec3) -> [usize; 2] {
        let photons = (0..)
            .zip(positions)
            .map(|(number, position)| Photon::new(*position, (Vec3::NEG_Z, Vec3::Z), Vec3::ONE, number));
        let cloud = Cloud::new(photons.collect(), radius).expect("enough memory");
        let mut count = 0;
        cloud.each_near(point, Vec3::Z, |_, _| count += 1);
        [count, positions.iter().filter(|position| position.distance_squared(point) < radius * radius).count()]
    }

    #[test]
    fn no_photon_of_a_disc_is_missed_far_from_the_origin() {
        let radius = 0.013_7_f32;
        // With cells as wide as a disc, both ends of this disc lie two cells apart.
        let ends = [25.687_5 - radius, 25.687_5 + radius].map(|end| (end * (0.5 / radius)).floor());
        assert_eq!(ends[1] - ends[0], 2.0, "control");
        let mut missed = 0;
        for scale in [1.0, 16.0, 256.0, 4096.0] {
            for step in 0..500_u16 {
                let point = Vec3::new(25.687_5, f32::from(step) * 0.037, 0.0) * scale;
                // One photon is beside the point. The others widen the bounds, and make the table so long that few cells share an entry.
                let mut photons = vec![Vec3::ZERO; 256];
                photons[0] = point + Vec3::new(0.3, -0.4, 0.0) * radius;
                photons[1] = Vec3::X * 30.0 * scale;
                let [found, expected] = found(radius, &photons, point);
                missed += expected.saturating_sub(found);
            }
        }
        assert_eq!(missed, 0);
    }
}
