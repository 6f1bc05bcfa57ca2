//! Maps: pictures of the scene from other cameras, drawn before the pixels are computed.

use super::Context;
use crate::raster::gpu::device::Gpu;
use crate::raster::gpu::draws::DrawList;
use crate::raster::gpu::faults::unsupported;
use crate::raster::gpu::job::check_scene;
use crate::raster::gpu::resources::{texture, texture_array};
use crate::raster::gpu::targets::{CHANNEL_FORMATS, DEPTH_FORMAT};
use crate::raster::gpu::timer::Timer;
use curitiba_pipeline::backend::{Attachments, BackendError, EffectJob, LoadStore, Part, RasterJob, Rect, View};
use curitiba_pipeline::executor::Progress;
use curitiba_pipeline::programs::RasterProgram;
use glam::Vec4;
use std::time::Instant;

/// Number of faces of a cube map.
const FACES: u32 = crate::raster::effects::cube::FACES as u32;

/// Kind and size of the maps of an effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum MapsKey {
    /// Depths from the light.
    Depth {
        /// Texels along a side.
        size: u32,
        /// Number of depth maps.
        cascades: u32,
    },
    /// Colours in all directions around some points.
    Cubes {
        /// Texels along a side of a face.
        size: u32,
        /// Number of these points.
        probes: u32,
    },
    /// Colours from mirrored cameras, with as many pixels as the picture.
    Mirrors {
        /// Columns and rows of the picture.
        size: [u32; 2],
        /// Number of layers; mirrors at separate places of the picture share a layer.
        layers: u32,
    },
}

/// One picture to draw into a map.
#[derive(Debug, Clone, Copy)]
pub struct Shot {
    /// The camera.
    pub view: View,
    /// Index of the map's layer.
    pub layer: u32,
    /// The rectangle of the layer to draw, if other pictures share the layer; `None` draws the whole layer.
    pub pixels: Option<Rect>,
    /// Whether the layer already holds other pictures, which are kept.
    pub keeps: bool,
}

impl Shot {
    /// A picture that fills a layer.
    pub fn whole(view: View, layer: u32) -> Self {
        Self { view, layer, pixels: None, keeps: false }
    }
}

impl MapsKey {
    /// Bytes of device memory, including the one depth buffer that all faces or all layers of mirrors share.
    pub fn bytes(self) -> u64 {
        let texels = |size: u32| u64::from(size) * u64::from(size);
        match self {
            Self::Depth { size, cascades } => 4 * u64::from(cascades) * texels(size),
            Self::Cubes { size, probes } => (16 * u64::from(FACES) * u64::from(probes) + 4) * texels(size),
            Self::Mirrors { size: [width, height], layers } => {
                (16 * u64::from(layers) + 4) * u64::from(width) * u64::from(height)
            }
        }
    }
}

/// Maps of one size: square depth maps, the faces of cube maps with colours, or pictures of mirrors.
#[derive(Debug, Clone)]
pub struct Maps {
    /// The array that the pixel program reads: all depth maps, all faces, probe by probe, or all layers of mirrors.
    pub read: wgpu::TextureView,
    /// Colour targets, one for each face or layer of mirrors; empty for depth maps.
    faces: std::sync::Arc<[wgpu::TextureView]>,
    /// Depth targets, one for each depth map; all faces, or all layers of mirrors, share one.
    depths: std::sync::Arc<[wgpu::TextureView]>,
    /// Bytes of device memory, see [`MapsKey::bytes`].
    pub bytes: u64,
    /// Width and height of each map in texels.
    size: [u32; 2],
    /// Whether depth is interpolated by the device instead of computed on the triangles' planes. Pictures of mirrors have the depth of
    /// planes, as the picture that shows the mirrors does.
    snapped_depth: bool,
}

impl Maps {
    /// Allocates maps; nothing is drawn yet.
    pub fn new(gpu: &Gpu, key: MapsKey) -> Result<Self, BackendError> {
        match key {
            MapsKey::Depth { size, cascades } => Self::depth(gpu, size, cascades),
            MapsKey::Cubes { size, probes } => Self::cubes(gpu, size, probes),
            MapsKey::Mirrors { size, layers } => Self::mirrors(gpu, size, layers),
        }
    }

    fn depth(gpu: &Gpu, size: u32, cascades: u32) -> Result<Self, BackendError> {
        check_size(gpu, "a shadow map", size)?;
        let usage = wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING;
        let texture = texture_array(gpu, "shadow maps", DEPTH_FORMAT, [size; 2], cascades, usage);
        gpu.check("creation of the shadow maps")?;
        let depths = (0..cascades).map(|layer| layers(&texture, layer, 1, wgpu::TextureViewDimension::D2)).collect();
        let read = layers(&texture, 0, cascades, wgpu::TextureViewDimension::D2Array);
        gpu.check("creation of the shadow maps")?;
        let bytes = MapsKey::Depth { size, cascades }.bytes();
        Ok(Self { read, faces: [].into(), depths, bytes, size: [size; 2], snapped_depth: true })
    }

    fn cubes(gpu: &Gpu, size: u32, probes: u32) -> Result<Self, BackendError> {
        check_size(gpu, "a cube map", size)?;
        let most = gpu.limits.max_texture_array_layers / FACES;
        if probes > most {
            let why = format!("{} takes {most} at most: set `probes` to that or less, or", gpu.adapter);
            return Err(unsupported(&format!("{probes} cube maps"), &why));
        }
        Self::colors(gpu, "cube maps", [size; 2], FACES * probes, MapsKey::Cubes { size, probes }.bytes())
    }

    fn mirrors(gpu: &Gpu, size: [u32; 2], count: u32) -> Result<Self, BackendError> {
        let most = gpu.limits.max_texture_array_layers;
        if count > most {
            let why = format!("{} takes {most} at most: set `planes` to that or less, or", gpu.adapter);
            return Err(unsupported(&format!("{count} pictures of mirrors"), &why));
        }
        let maps = Self::colors(gpu, "mirrors", size, count, MapsKey::Mirrors { size, layers: count }.bytes())?;
        Ok(Self { snapped_depth: false, ..maps })
    }

    /// `count` maps with colours, which share a depth buffer.
    fn colors(gpu: &Gpu, label: &str, size: [u32; 2], count: u32, bytes: u64) -> Result<Self, BackendError> {
        let doing = format!("creation of the {label}");
        let usage = wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING;
        let color = texture_array(gpu, label, CHANNEL_FORMATS[0], size, count, usage);
        gpu.check(&doing)?;
        let depth = texture(gpu, "depth of maps", DEPTH_FORMAT, size, wgpu::TextureUsages::RENDER_ATTACHMENT);
        gpu.check(&doing)?;
        let faces = (0..count).map(|layer| layers(&color, layer, 1, wgpu::TextureViewDimension::D2)).collect();
        let read = layers(&color, 0, count, wgpu::TextureViewDimension::D2Array);
        let depths = [depth.create_view(&wgpu::TextureViewDescriptor::default())].into();
        gpu.check(&doing)?;
        Ok(Self { read, faces, depths, bytes, size, snapped_depth: true })
    }
}

/// A view of some layers of a texture.
fn layers(texture: &wgpu::Texture, first: u32, count: u32, dimension: wgpu::TextureViewDimension) -> wgpu::TextureView {
    texture.create_view(&wgpu::TextureViewDescriptor {
        dimension: Some(dimension),
        base_array_layer: first,
        array_layer_count: Some(count),
        ..Default::default()
    })
}

fn check_size(gpu: &Gpu, what: &str, size: u32) -> Result<(), BackendError> {
    let largest = gpu.limits.max_texture_dimension_2d;
    if size > largest {
        let why = format!("{} takes {largest} texels a side at most: set `mapsize` to that or less, or", gpu.adapter);
        return Err(unsupported(&format!("{what} of {size} x {size} texels"), &why));
    }
    Ok(())
}

/// Draws one picture for each of `shots` into `maps`, colours or depths, without the materials in `left_out`, and
/// waits. If the pass is given up, the remaining pictures are not drawn. Returns the time, and the number of triangles submitted.
pub fn draw(
    context: &mut Context<'_>,
    draws: &mut DrawList,
    maps: &Maps,
    job: &EffectJob<'_>,
    shots: &[Shot],
    left_out: &[bool],
    progress: &Progress,
) -> Result<(Part, u64), BackendError> {
    let start = Instant::now();
    let (Some(first), Some(shared)) = (shots.first(), maps.depths.first()) else { return Ok((Part::default(), 0)) };
    let color = !maps.faces.is_empty();
    let [width, height] = maps.size;
    let raster = RasterJob {
        scene: job.scene,
        program: RasterProgram::Deferred,
        view: first.view,
        sun: job.sun,
        lights: &[],
        shades: job.shades,
        // Maps show what rays hit, so both sides of every triangle are drawn.
        culled: &[],
        viewport: Rect { x: 0, y: 0, width, height },
        clear_color: Vec4::ZERO,
        attachments: Attachments { color, ..Attachments::default() },
        shared: Attachments::default(),
        half: Attachments::default(),
        snapped_depth: maps.snapped_depth,
        load_store: LoadStore::default(),
    };
    check_scene(&raster)?;
    let Context { gpu, layouts, pipelines, timer, geometry, textures, .. } = context;
    draws.leave_out(left_out);
    draws.prepare(gpu, layouts, pipelines, geometry, textures, &raster)?;
    let doing = "drawing a map";
    let mut device = None;
    for (index, shot) in shots.iter().enumerate() {
        if gives_up(gpu, progress, doing)? {
            return Ok((Part { host: start.elapsed(), device: None }, draws.triangles() * index as u64));
        }
        let (is_first, is_last) = (index == 0, index + 1 == shots.len());
        let layer = shot.layer as usize;
        draws.look(gpu, &shot.view, maps.size, job.sun)?;
        let descriptor = wgpu::CommandEncoderDescriptor { label: Some("map") };
        let mut encoder = gpu.device.create_command_encoder(&descriptor);
        let face = maps.faces.get(layer).map(|view| wgpu::RenderPassColorAttachment {
            view,
            depth_slice: None,
            resolve_target: None,
            ops: wgpu::Operations {
                load: if shot.keeps { wgpu::LoadOp::Load } else { wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT) },
                store: wgpu::StoreOp::Store,
            },
        });
        let store = if color { wgpu::StoreOp::Discard } else { wgpu::StoreOp::Store };
        let attachments = [face, None, None, None];
        let begin = timer.and_then(|timer| timer.compute_span(is_first, false));
        draws.record_planes(gpu, &mut encoder, layouts, geometry, begin);
        {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("map"),
                color_attachments: if color { &attachments } else { &[] },
                depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                    view: maps.depths.get(layer).unwrap_or(shared),
                    depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(0.0), store }),
                    stencil_ops: None,
                }),
                timestamp_writes: timer.and_then(|timer| timer.render_span(is_first && !draws.has_planes(), is_last)),
                occlusion_query_set: None,
                multiview_mask: None,
            });
            if let Some(Rect { x, y, width, height }) = shot.pixels {
                pass.set_scissor_rect(x, y, width, height);
            }
            draws.record(&mut pass, pipelines, geometry, textures);
        }
        device = submit(gpu, *timer, encoder, is_last, doing)?;
        progress.advance(1);
    }
    Ok((Part { host: start.elapsed(), device }, draws.triangles() * shots.len() as u64))
}

/// Whether a series of submissions ends here because the pass is given up. Then it waits for those made so far. The series has no time: the
/// timestamps of its begin are written again by the next series before they are read.
pub fn gives_up(gpu: &Gpu, progress: &Progress, doing: &str) -> Result<bool, BackendError> {
    let ends = progress.is_cancelled();
    if ends {
        gpu.submit_and_wait(None, doing)?;
    }
    Ok(ends)
}

/// Submits the commands. After the last submission of a series it waits, and returns the time of the whole series where
/// the device measures it.
pub fn submit(
    gpu: &Gpu,
    timer: Option<&Timer>,
    encoder: wgpu::CommandEncoder,
    is_last: bool,
    doing: &str,
) -> Result<Option<std::time::Duration>, BackendError> {
    match timer {
        _ if !is_last => {
            gpu.queue.submit([encoder.finish()]);
            gpu.check(doing)?;
            Ok(None)
        }
        Some(timer) => timer.submit_and_wait(gpu, encoder, doing).map(Some),
        None => gpu.submit_and_wait(Some(encoder.finish()), doing).map(|()| None),
    }
}
