//! The photons of a pass, as programs read them (`programs/photons.wgsl`).

use super::layout::CLOUD_WORDS;
use crate::effects::dielectric::{Cloud, PhotonMap};
use curitiba_pipeline::memory::Refused;

/// Appends the photons of a pass to the tables: the number of clouds, the words of each cloud ([`CLOUD_WORDS`]), and for each cloud its photons and
/// the starts of the table's entries. Clouds without photons are left out: their bounds are infinite, and programs have no infinities.
/// Returns the place in the tables.
///
/// # Errors
/// If there is too little memory.
pub fn append(words: &mut Vec<u32>, photons: &PhotonMap) -> Result<u32, Refused> {
    let clouds: Vec<&Cloud> = photons.clouds().iter().filter(|cloud| !cloud.photons().is_empty()).collect();
    let parts = |cloud: &Cloud| [size_of_val(cloud.photons()) / size_of::<u32>(), cloud.starts().len()];
    let place = words.len();
    let mut next = place + 1 + CLOUD_WORDS as usize * clouds.len();
    let end = next + clouds.iter().flat_map(|cloud| parts(cloud)).sum::<usize>();
    words.try_reserve_exact(end - place).map_err(|_| Refused::items::<u32>(end))?;
    words.push(clouds.len() as u32);
    for cloud in &clouds {
        let [photons_at, starts_at] = parts(cloud).map(|length| {
            next += length;
            (next - length) as u32
        });
        let [low, high] = cloud.bounds().map(|corner| corner.to_array().map(f32::to_bits));
        let numbers = [cloud.radius(), cloud.cells_a_unit(), cloud.greatest_weight()].map(f32::to_bits);
        words.extend([photons_at, starts_at, cloud.starts().len() as u32 - 1]);
        words.extend(low.into_iter().chain(high).chain(numbers));
    }
    for cloud in clouds {
        words.extend_from_slice(bytemuck::cast_slice(cloud.photons()));
        words.extend_from_slice(cloud.starts());
    }
    Ok(place as u32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::dielectric::Photon;
    use curitiba_pipeline::backend::PhotonCounts;
    use glam::Vec3;

    #[test]
    fn clouds_lie_where_their_words_say_and_those_without_photons_are_left_out() {
        let of = |places: &[f32], radius| {
            let photon = |x: &f32| Photon::new(Vec3::X * *x, (Vec3::NEG_Y, Vec3::Y), Vec3::splat(*x), 7);
            Cloud::new(places.iter().map(photon).collect(), radius).expect("there is memory")
        };
        let clouds = [of(&[1.0, 2.0, 5.0], 0.5), of(&[], 0.1), of(&[9.0], 0.25)];
        let photons = PhotonMap::new(clouds.into(), PhotonCounts::default());
        let mut words = vec![u32::MAX; 5];
        assert_eq!(append(&mut words, &photons), Ok(5));
        assert_eq!(words[5], 2, "a cloud is left out");
        let mut next = 6 + 2 * CLOUD_WORDS as usize;
        for (number, (cloud, entries)) in [(&photons.clouds()[0], 4), (&photons.clouds()[2], 1)].into_iter().enumerate()
        {
            let head = 6 + CLOUD_WORDS as usize * number;
            let starts_at = next + 14 * cloud.photons().len();
            assert_eq!(words[head..head + 3], [next as u32, starts_at as u32, entries]);
            let [low, high] = cloud.bounds();
            let numbers = [cloud.radius(), cloud.cells_a_unit(), cloud.greatest_weight()];
            let numbers: Vec<f32> = low.to_array().into_iter().chain(high.to_array()).chain(numbers).collect();
            assert_eq!(words[head + 3..head + CLOUD_WORDS as usize], *bytemuck::cast_slice::<f32, u32>(&numbers));
            for (photon, words) in cloud.photons().iter().zip(words[next..starts_at].as_chunks::<14>().0) {
                assert_eq!(Vec3::from_slice(bytemuck::cast_slice(&words[..3])), photon.position);
                assert_eq!(Vec3::from_slice(bytemuck::cast_slice(&words[3..6])), photon.direction);
                assert_eq!(Vec3::from_slice(bytemuck::cast_slice(&words[6..9])), photon.normal);
                assert_eq!(Vec3::from_slice(bytemuck::cast_slice(&words[9..12])), photon.power);
            }
            next = starts_at + cloud.starts().len();
            assert_eq!(words[starts_at..next], *cloud.starts());
        }
        assert_eq!(words.len(), next);
    }
}
