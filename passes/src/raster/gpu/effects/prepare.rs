//! Prepares the data that a pixel program reads: drawn maps, the pyramid of the picture, and the program's uniforms.

use super::depths::Depths;
use super::inputs::Ready;
use super::maps::{self, Maps, MapsKey, Shot};
use super::programs::Task;
use super::screen::Marching;
use super::survey::Surveyor;
use super::uniforms::{
    CubeUniform, MirrorPlane, OcclusionUniform, PlanarUniform, ProbeBox, ScreenUniform, ShadowUniform,
};
use super::{Context, Effects, Prepared, shader, together};
use crate::raster::cpu::find_proxy;
use crate::raster::effects::cascades::Cascades;
use crate::raster::effects::mirrors::{Mirrors, Survey};
use crate::raster::effects::planes::Run;
use crate::raster::effects::screen::camera::ScreenCamera;
use crate::raster::effects::{check_map_bytes, cube};
use crate::raster::gpu::device::Gpu;
use crate::raster::gpu::faults::{failure, unsupported};
use curitiba_pipeline::backend::{BackendError, EffectJob, EffectStats, Rect};
use curitiba_pipeline::executor::Progress;
use curitiba_pipeline::raster_effects::{EffectProgram, Missing, Parallax};

impl Effects {
    /// Makes the depths available from which an ambient occlusion computes positions.
    pub(super) fn occlusion(&mut self, gpu: &Gpu, job: &EffectJob<'_>) -> Result<Prepared, BackendError> {
        let camera = ScreenCamera::or_blind(&job.view, job.width, job.height);
        let depths = match &mut self.depths {
            Some(depths) => depths,
            none => none.insert(Depths::new(gpu, &self.inputs)?),
        };
        depths.require(gpu, (job.width, job.height), || self.groups.clear())?;
        depths.look(gpu, camera);
        let params = bytemuck::bytes_of(&OcclusionUniform::new(job, camera)).to_vec();
        Ok(Prepared { params, ..Prepared::default() })
    }

    /// Draws the cascaded depth maps.
    pub(super) fn shadow_maps(
        &mut self,
        context: &mut Context<'_>,
        job: &EffectJob<'_>,
        depths: Option<[f32; 2]>,
        task: &Task,
        stats: &mut EffectStats,
        progress: &Progress,
    ) -> Result<Prepared, BackendError> {
        let Some(sun) = &job.sun else {
            return Err(unsupported(job.program.info().name, "the pass has no light: name one in <lights>;"));
        };
        let bounds = context.cache.bounds(job.scene);
        let cascades = depths.map(|depths| Cascades::new(sun, &bounds, &job.view, depths, &job.params));
        let cascades = cascades.unwrap_or_default();
        let count = cascades.fits.len() as u32;
        let key = match count {
            0 => MapsKey::Depth { size: 1, cascades: 1 },
            _ => MapsKey::Depth { size: job.params.map_size, cascades: count },
        };
        let maps = self.require_maps(context.gpu, job.program, key)?;
        if count > 0 {
            progress.start(u64::from(count) + task.submissions());
            self.shots.clear();
            self.shots.extend(cascades.fits.iter().zip(0..).map(|(fit, layer)| Shot::whole(fit.view, layer)));
            let (part, triangles) =
                maps::draw(context, &mut self.draws, &maps, job, &self.shots, &job.scene.skies(), progress)?;
            (stats.maps, stats.triangles, stats.map_count, stats.bytes) = (Some(part), triangles, count, maps.bytes);
        }
        let params = bytemuck::bytes_of(&ShadowUniform::new(job, &cascades)).to_vec();
        Ok(Prepared { maps: Some(key), params, ..Prepared::default() })
    }

    /// Builds the pyramid for marching rays (with refraction, that of the picture without glass), and draws the cube
    /// maps for rays whose hits the picture does not show.
    #[expect(clippy::too_many_arguments, reason = "as the other preparations, and where the G-buffer is")]
    pub(super) fn screen(
        &mut self,
        context: &mut Context<'_>,
        job: &EffectJob<'_>,
        called: bool,
        gbuffer: &wgpu::BindGroup,
        task: &Task,
        stats: &mut EffectStats,
        progress: &Progress,
    ) -> Result<Prepared, BackendError> {
        let gpu = context.gpu;
        let mut marching = match self.marching.take() {
            Some(marching) => marching,
            None => Marching::new(gpu, &self.inputs)?,
        };
        let camera = ScreenCamera::new(&job.view, job.width, job.height).filter(|_| called);
        let size = if camera.is_some() { [job.width, job.height] } else { [1; 2] };
        let behind = shader::reads_behind(job.program);
        if behind {
            marching.require_behind(gpu, size)?;
        }
        marching.require(gpu, size, job.program.info().name, || self.groups.clear())?;
        let mut building = None;
        if let Some(camera) = &camera {
            let mut seen = gbuffer.clone();
            if behind {
                let (part, triangles, bytes) = marching.draw_behind(context, &mut self.draws, job)?;
                (stats.maps, stats.map_count, stats.triangles, stats.bytes) = (Some(part), 1, triangles, bytes);
                seen = marching.behind_group(gpu, &self.inputs).ok_or_else(|| failure("there is no picture"))?;
            }
            building = Some(marching.build(gpu, context.timer, &seen, camera)?);
        }
        let cubes = camera.is_some() && job.params.missing == Missing::Cube;
        let prepared = self.cube_maps(context, job, cubes, task, stats, progress)?;
        let Some(MapsKey::Cubes { size: map_size, .. }) = prepared.maps else {
            return Err(failure("there are no cube maps"));
        };
        let probes = self.shots.len() / cube::FACES;
        let seen = camera.as_ref().map(|camera| (camera, marching.levels()));
        let uniform = ScreenUniform::new(job, seen, map_size, probes, self.ranges.as_slice().len());
        self.marching = Some(marching);
        Ok(Prepared { params: bytemuck::bytes_of(&uniform).to_vec(), building, ..prepared })
    }

    /// Draws the cube maps of the panes that cover the most area of the picture.
    pub(super) fn cube_maps(
        &mut self,
        context: &mut Context<'_>,
        job: &EffectJob<'_>,
        called: bool,
        task: &Task,
        stats: &mut EffectStats,
        progress: &Progress,
    ) -> Result<Prepared, BackendError> {
        let bounds = context.cache.bounds(job.scene);
        let panes = if called { context.cache.panes(job.scene, job.glass) } else { &[] };
        // Room for as many cube maps as any view may need, so that the maps are kept when the camera moves.
        let most = job.params.probes.min(panes.len() as u32);
        self.probes.choose(panes, &bounds, &job.view, job.params.probes);
        if job.params.parallax == Parallax::Box {
            let raster = self.surroundings.get_or_insert_with(Box::default);
            context.cache.add_proxies(self.probes.chosen_mut(), |probe| find_proxy(raster, job, probe))?;
        }
        let probes = self.probes.chosen();
        let chosen = probes.len();
        let key = match chosen {
            0 => MapsKey::Cubes { size: 1, probes: 1 },
            _ => MapsKey::Cubes { size: job.params.map_size, probes: most },
        };
        self.shots.clear();
        let views = probes.iter().flat_map(|probe| (0..cube::FACES).map(|face| probe.view(face)));
        self.shots.extend(views.zip(0..).map(|(view, layer)| Shot::whole(view, layer)));
        let boxes: Vec<ProbeBox> = probes.iter().map(ProbeBox::new).collect();
        if self.boxes.write(context.gpu, bytemuck::cast_slice(&boxes))? {
            self.groups.clear();
        }
        let maps = self.require_maps(context.gpu, job.program, key)?;
        if chosen > 0 {
            progress.start(self.shots.len() as u64 + task.submissions());
            let (part, triangles) = maps::draw(context, &mut self.draws, &maps, job, &self.shots, job.glass, progress)?;
            stats.map_count += chosen as u32;
            stats.triangles += triangles;
            stats.bytes += maps.bytes;
            stats.maps = Some(stats.maps.map_or(part, |before| together(before, part)));
        }
        let params = bytemuck::bytes_of(&CubeUniform::new(job, chosen, self.ranges.as_slice().len())).to_vec();
        Ok(Prepared { maps: Some(key), params, ..Prepared::default() })
    }

    /// Chooses the planes of glass that the most pixels show.
    pub(super) fn choose_mirrors(
        &mut self,
        context: &mut Context<'_>,
        job: &EffectJob<'_>,
        ready: &Ready<'_>,
    ) -> Result<Mirrors, BackendError> {
        let gpu = context.gpu;
        let bounds = context.cache.bounds(job.scene);
        let glazing = context.cache.glazing(job.scene, job.glass).map_err(|refused| failure(&refused.to_string()))?;
        if self.runs.write(gpu, bytemuck::cast_slice(&glazing.runs))? {
            self.groups.clear();
        }
        let survey = if glazing.runs.is_empty() {
            Survey::default()
        } else if job.resident {
            let surveyor = match &mut self.surveyor {
                Some(surveyor) => surveyor,
                none => none.insert(Surveyor::new(gpu, &self.inputs)?),
            };
            surveyor.look(gpu, ready, job, glazing, &self.runs.buffer)?
        } else {
            Survey::new(job, glazing, &mut self.plane_of).map_err(|refused| failure(&refused.to_string()))?
        };
        Ok(Mirrors::choose(glazing, &survey, &bounds, &job.view, job.params.planes))
    }

    /// Draws the pictures of the mirrors.
    pub(super) fn pictures(
        &mut self,
        context: &mut Context<'_>,
        job: &EffectJob<'_>,
        mirrors: &Mirrors,
        task: &Task,
        stats: &mut EffectStats,
        progress: &Progress,
    ) -> Result<Prepared, BackendError> {
        stats.glass_pixels = mirrors.glass_pixels;
        let chosen = &mirrors.chosen;
        let layers = share_layers(chosen.iter().map(|mirror| mirror.pixels));
        // The number of layers is a power of two, so that the maps are mostly kept when the camera moves.
        let count = layers.iter().max().map_or(1, |last| (last + 1).next_power_of_two());
        let size = if chosen.is_empty() { [1; 2] } else { [job.width, job.height] };
        let key = MapsKey::Mirrors { size, layers: count };
        let planes: Vec<MirrorPlane> =
            chosen.iter().zip(&layers).map(|(m, layer)| MirrorPlane::new(m, *layer)).collect();
        if self.mirrors.write(context.gpu, bytemuck::cast_slice(&planes))? {
            self.groups.clear();
        }
        let maps = self.require_maps(context.gpu, job.program, key)?;
        if !chosen.is_empty() {
            progress.start(chosen.len() as u64 + task.submissions());
            self.shots.clear();
            for (index, (mirror, layer)) in chosen.iter().zip(&layers).enumerate() {
                let keeps = layers[..index].contains(layer);
                self.shots.push(Shot { view: mirror.view, layer: *layer, pixels: Some(mirror.pixels), keeps });
            }
            let (part, triangles) = maps::draw(context, &mut self.draws, &maps, job, &self.shots, job.glass, progress)?;
            stats.map_count = chosen.len() as u32;
            (stats.maps, stats.triangles, stats.bytes) = (Some(part), triangles, maps.bytes);
        }
        let uniform = PlanarUniform { mirrors: chosen.len() as u32, ranges: self.runs.count::<Run>() };
        Ok(Prepared { maps: Some(key), params: bytemuck::bytes_of(&uniform).to_vec(), ..Prepared::default() })
    }

    fn require_maps(&mut self, gpu: &Gpu, program: EffectProgram, key: MapsKey) -> Result<Maps, BackendError> {
        check_map_bytes(program, key.bytes()).map_err(|why| unsupported(program.info().name, &format!("{why};")))?;
        self.maps.require(gpu, key, || self.groups.clear(), |key| Maps::new(gpu, *key)).cloned()
    }
}

/// The layer of each picture: the first layer in which it overlaps no earlier picture.
fn share_layers(pictures: impl Iterator<Item = Rect>) -> Vec<u32> {
    let apart = |a: &Rect, b: &Rect| {
        a.x + a.width <= b.x || b.x + b.width <= a.x || a.y + a.height <= b.y || b.y + b.height <= a.y
    };
    let mut placed: Vec<(Rect, u32)> = Vec::new();
    for picture in pictures {
        let is_free = |layer: &u32| placed.iter().all(|(other, taken)| taken != layer || apart(&picture, other));
        let layer = (0..).find(is_free).unwrap_or(0);
        placed.push((picture, layer));
    }
    placed.into_iter().map(|(_, layer)| layer).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_that_meet_have_different_layers() {
        let rect = |x, y, width, height| Rect { x, y, width, height };
        let pictures = [rect(0, 0, 10, 10), rect(10, 0, 5, 5), rect(9, 9, 3, 3), rect(9, 0, 1, 1), rect(12, 9, 1, 1)];
        assert_eq!(share_layers(pictures.into_iter()), [0, 0, 1, 1, 0]);
        assert_eq!(share_layers([rect(0, 0, 4, 4); 3].into_iter()), [0, 1, 2]);
        assert!(share_layers(std::iter::empty()).is_empty());
    }
}
