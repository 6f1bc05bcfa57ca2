//! Exact spheres. Each is drawn as a rectangle on the screen. Its fragments intersect their line of sight with the sphere and write the
//! depth of the hit.
//!
//! Spheres are drawn after all triangles, in the order of their ids. Of equal depths the first drawn stays, as in the rasteriser on the
//! processor. Pipelines and buffers are made when they are first needed.

mod record;

use super::device::Gpu;
use super::faults::NAME;
use super::resources::entry;
use super::shader::{FrameUniform, LIGHTS_BYTES, cut};
use super::targets::{DEPTH_FORMAT, Stored};
use curitiba_pipeline::backend::{Attachments, BackendError, RasterJob, Rect};
use rayon::prelude::*;
use record::{Screen, SphereRecord};
use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::num::NonZeroU64;

/// The WGSL source that all programs are cut from.
const TEXT: &str = concat!(
    include_str!("spheres.wgsl"),
    "\n",
    include_str!("../lights.wgsl"),
    "\n",
    include_str!("../camera_planes.wgsl")
);

/// The variant of a program.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
struct Kind {
    attachments: Attachments,
    /// Whether there are several lights or a positional light.
    many: bool,
}

impl Kind {
    #[cfg(test)]
    fn whole() -> Self {
        Self { attachments: Attachments { color: true, position: true, normal: true, triangle: true }, many: true }
    }

    /// Whether the program reads `Lights`.
    fn reads_lights(self) -> bool {
        self.many && (self.attachments.color || self.attachments.position)
    }

    fn source(self) -> String {
        let Attachments { color, position, normal, triangle } = self.attachments;
        cut("spheres.wgsl", TEXT, |name| {
            Some(match name {
                "COLOR" => color,
                "POSITION" => position,
                "NORMAL" => normal,
                "TRIANGLE" => triangle,
                "LIT" => color || position,
                "SURFACE" => color || position || normal,
                "LIGHTS" => self.reads_lights(),
                "PLANE_DEPTH" => false,
                _ => return None,
            })
        })
    }
}

/// A run of spheres whose records are in one buffer.
#[derive(Debug)]
struct Run {
    buffer: wgpu::Buffer,
    group: wgpu::BindGroup,
    count: u32,
}

/// The spheres of the current pass.
#[derive(Debug, Default)]
pub(super) struct Spheres {
    /// Layouts of group 0, by whether they have `Lights`.
    layouts: HashMap<bool, wgpu::BindGroupLayout>,
    pipelines: HashMap<(Kind, Stored), wgpu::RenderPipeline>,
    runs: Vec<Run>,
    /// The key of the pipeline that draws the runs.
    drawn: Option<(Kind, Stored)>,
}

impl Spheres {
    /// Lists the spheres of a job that may be seen in `part`, relative to the viewport. `frame` and `lights` are the uniforms of the pass;
    /// `owned` holds, by material, whether an own shader draws it.
    ///
    /// # Errors
    /// If the device lacks storage buffers, a sphere's material has an own shader, or the device fails.
    pub fn prepare(
        &mut self,
        gpu: &Gpu,
        (frame, lights): (&wgpu::Buffer, Option<&wgpu::Buffer>),
        job: &RasterJob<'_>,
        part: Option<Rect>,
        owned: &[bool],
    ) -> Result<(), BackendError> {
        check(gpu, job, owned)?;
        let kind = Kind { attachments: job.attachments, many: lights.is_some() };
        let stored = Stored::of(job);
        let records = part.map_or_else(Vec::new, |part| records(job, part));
        let old = std::mem::take(&mut self.runs);
        self.drawn = None;
        if records.is_empty() {
            return Ok(());
        }
        let layout = self.layouts.entry(kind.reads_lights()).or_insert_with(|| layout(gpu, kind.reads_lights()));
        if let Entry::Vacant(entry) = self.pipelines.entry((kind, stored)) {
            entry.insert(build(gpu, layout, kind, stored));
        }
        gpu.check("building the program of spheres")?;
        let bytes = gpu.max_buffer_bytes.min(gpu.limits.max_storage_buffer_binding_size);
        let most = (bytes / size_of::<SphereRecord>() as u64).max(1) as usize;
        let mut old = old.into_iter();
        for records in records.chunks(most) {
            let bytes: &[u8] = bytemuck::cast_slice(records);
            let buffer = match old.next().map(|run| run.buffer).filter(|buffer| buffer.size() >= bytes.len() as u64) {
                Some(buffer) => {
                    gpu.queue.write_buffer(&buffer, 0, bytes);
                    buffer
                }
                None => gpu.upload_buffer("upload of the spheres", wgpu::BufferUsages::STORAGE, bytes)?,
            };
            let mut entries = vec![entry(0, frame), entry(1, &buffer)];
            entries.extend(lights.filter(|_| kind.reads_lights()).map(|lights| entry(2, lights)));
            let descriptor = wgpu::BindGroupDescriptor { label: Some("spheres"), layout, entries: &entries };
            let group = gpu.device.create_bind_group(&descriptor);
            self.runs.push(Run { buffer, group, count: records.len() as u32 });
        }
        self.drawn = Some((kind, stored));
        gpu.check("binding of the spheres")
    }

    /// Whether the job has no sphere that may be seen.
    pub fn is_empty(&self) -> bool {
        self.runs.is_empty()
    }

    /// Records the draws, after those of triangles.
    pub fn record(&self, pass: &mut wgpu::RenderPass<'_>) {
        let Some(pipeline) = self.drawn.and_then(|drawn| self.pipelines.get(&drawn)) else { return };
        pass.set_pipeline(pipeline);
        for run in &self.runs {
            pass.set_bind_group(0, &run.group, &[]);
            pass.draw(0..4, 0..run.count);
        }
    }

    /// Bytes of device memory.
    pub fn bytes(&self) -> u64 {
        self.runs.iter().map(|run| run.buffer.size()).sum()
    }
}

/// Refuses jobs whose spheres cannot be drawn. The check of the scene has already found that every sphere has colours.
fn check(gpu: &Gpu, job: &RasterJob<'_>, owned: &[bool]) -> Result<(), BackendError> {
    if !gpu.draws_spheres() {
        let why =
            format!("{} has no storage buffers in vertex and fragment shaders; draw with --raster cpu", gpu.adapter);
        return Err(BackendError::Unsupported { backend: NAME, what: "a scene with exact spheres".to_owned(), why });
    }
    let (spheres, materials) = (&job.scene.geometry.spheres, &job.scene.materials);
    if let Some(sphere) = spheres.iter().find(|sphere| owned.get(sphere.material as usize) == Some(&true)) {
        let name = materials.get(sphere.material as usize).map_or("", |material| &material.name);
        let what = format!("an exact sphere of the material `{name}`, which an own shader draws");
        let why =
            "own shaders draw triangles; declare it without exact=\"true\", or give it another material".to_owned();
        return Err(BackendError::Unsupported { backend: NAME, what, why });
    }
    Ok(())
}

/// The records of the spheres that may be seen in a part of the viewport, in the order of their ids. A record does not depend on the
/// part, so that the part's pixels are the same as in the whole picture.
fn records(job: &RasterJob<'_>, part: Rect) -> Vec<SphereRecord> {
    let (screen, first) = (Screen::new(job), job.scene.geometry.triangles.len() as u32);
    let [columns, rows] = [(part.x, part.width), (part.y, part.height)]
        .map(|(start, length)| start as usize..start as usize + length as usize);
    let spheres = job.scene.geometry.spheres.par_iter().enumerate();
    let record = |(index, sphere): (usize, &_)| {
        let covered = screen.covered(sphere)?;
        let is_apart = |covered: &std::ops::Range<usize>, part: &std::ops::Range<usize>| {
            covered.end <= part.start || part.end <= covered.start
        };
        if is_apart(&covered[0], &columns) || is_apart(&covered[1], &rows) {
            return None;
        }
        let is_culled = job.culled.get(sphere.material as usize) == Some(&true);
        let shade = &job.shades[sphere.material as usize];
        Some(screen.record(sphere, &covered)?.shown(first + index as u32, shade, is_culled))
    };
    spheres.filter_map(record).collect()
}

fn layout(gpu: &Gpu, lights: bool) -> wgpu::BindGroupLayout {
    let entry = |binding, visibility, ty, size: usize| wgpu::BindGroupLayoutEntry {
        binding,
        visibility,
        ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: NonZeroU64::new(size as u64) },
        count: None,
    };
    let (uniform, storage) = (wgpu::BufferBindingType::Uniform, wgpu::BufferBindingType::Storage { read_only: true });
    let (fragment, both) = (wgpu::ShaderStages::FRAGMENT, wgpu::ShaderStages::VERTEX_FRAGMENT);
    let mut entries = vec![
        entry(0, fragment, uniform, size_of::<FrameUniform>()),
        entry(1, both, storage, size_of::<SphereRecord>()),
    ];
    if lights {
        entries.push(entry(2, fragment, uniform, LIGHTS_BYTES));
    }
    let descriptor = wgpu::BindGroupLayoutDescriptor { label: Some("spheres"), entries: &entries };
    gpu.device.create_bind_group_layout(&descriptor)
}

fn build(gpu: &Gpu, layout: &wgpu::BindGroupLayout, kind: Kind, stored: Stored) -> wgpu::RenderPipeline {
    let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("spheres.wgsl"),
        source: wgpu::ShaderSource::Wgsl(kind.source().into()),
    });
    let layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some("spheres"),
        bind_group_layouts: &[Some(layout)],
        immediate_size: 0,
    });
    let targets = stored.formats().map(|format| format.map(wgpu::ColorTargetState::from));
    gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("spheres"),
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("vertex_main"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState {
            topology: wgpu::PrimitiveTopology::TriangleStrip,
            ..wgpu::PrimitiveState::default()
        },
        depth_stencil: Some(wgpu::DepthStencilState {
            format: DEPTH_FORMAT,
            depth_write_enabled: Some(true),
            // As for triangles: of equal depths the first drawn stays.
            depth_compare: Some(wgpu::CompareFunction::Greater),
            stencil: wgpu::StencilState::default(),
            bias: wgpu::DepthBiasState::default(),
        }),
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some("fragment_main"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            targets: &targets,
        }),
        multiview_mask: None,
        cache: None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use wgpu::naga;

    #[test]
    fn every_program_validates_and_has_what_its_attachments_need() {
        for bits in 1_u32..32 {
            let bit = |index: u32| bits >> index & 1 == 1;
            let attachments = Attachments { color: bit(0), position: bit(1), normal: bit(2), triangle: bit(3) };
            let kind = Kind { attachments, many: bit(4) };
            let source = kind.source();
            let module = naga::front::wgsl::parse_str(&source).unwrap_or_else(|error| panic!("{error}\n{source}"));
            let flags = naga::valid::ValidationFlags::all();
            naga::valid::Validator::new(flags, naga::valid::Capabilities::empty())
                .validate(&module)
                .unwrap_or_else(|error| panic!("{kind:?}: {error:?}"));
            let lit = attachments.color || attachments.position;
            assert_eq!(source.contains("let normal ="), lit || attachments.normal, "{kind:?}");
            assert_eq!(source.contains("lamps"), kind.many && lit, "{kind:?}");
            let written =
                ["out.color =", "out.position =", "out.normal =", "out.triangle ="].map(|it| source.contains(it));
            let Attachments { color, position, normal, triangle } = attachments;
            assert_eq!(written, [color, position, normal, triangle], "{kind:?}");
        }
    }
}
