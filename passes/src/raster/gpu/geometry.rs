//! Geometry in device memory, in chunks that fit the device's largest buffer.

use super::device::Gpu;
use super::faults::failure;
use curitiba_pipeline::backend::BackendError;
use curitiba_pipeline::scene::Geometry;
use glam::{Vec3, Vec4};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::OnceLock;

/// Size of `Plane` of the shaders, a triangle's plane, in bytes. It is greater than the size of the triangle's indices.
pub(super) const PLANE_BYTES: u64 = 32;

/// A run of triangles with one material, in one chunk, that one draw call draws.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Part {
    /// Index into [`DeviceGeometry::chunks`].
    pub chunk: usize,
    /// Index of the material.
    pub material: u32,
    /// Index in the scene of the first triangle.
    pub first: u32,
    /// Number of triangles.
    pub count: u32,
    /// Corners of the box around the triangles.
    pub bounds: [Vec3; 2],
}

/// A run of triangles whose buffers are bound together.
#[derive(Debug)]
pub(super) struct Chunk {
    /// Index in the scene of the first triangle.
    pub first: u32,
    /// Number of triangles.
    pub count: u32,
    /// Vertex indices, 32 bits each.
    pub indices: wgpu::Buffer,
    /// Index into [`DeviceGeometry::vertices`].
    pub vertices: usize,
    /// The triangles' planes as the last camera sees them; made by the first pass that reads them.
    planes: OnceLock<wgpu::Buffer>,
}

impl Chunk {
    /// The buffer for the triangles' planes, made on the first call.
    pub fn planes(&self, gpu: &Gpu) -> Result<&wgpu::Buffer, BackendError> {
        if let Some(planes) = self.planes.get() {
            return Ok(planes);
        }
        let bytes = PLANE_BYTES * u64::from(self.count);
        let planes = gpu.buffer("creation of the triangles' planes", wgpu::BufferUsages::STORAGE, bytes)?;
        Ok(self.planes.get_or_init(|| planes))
    }
}

/// Vertex attributes, each in its own buffer so that a pass binds only those that it reads.
#[derive(Debug)]
pub(super) struct Vertices {
    pub positions: wgpu::Buffer,
    pub normals: Option<wgpu::Buffer>,
    pub texcoords: Option<wgpu::Buffer>,
    pub colors: Option<wgpu::Buffer>,
    pub tangents: Option<wgpu::Buffer>,
}

/// A scene's triangles in device memory.
#[derive(Debug)]
pub(super) struct DeviceGeometry {
    pub chunks: Vec<Chunk>,
    pub vertices: Vec<Vertices>,
    /// The parts of all chunks, in the order of their triangles.
    pub parts: Vec<Part>,
    pub has_normals: bool,
    /// Bytes of the vertices and indices.
    bytes: u64,
}

impl DeviceGeometry {
    /// Bytes of device memory.
    pub fn bytes(&self) -> u64 {
        self.bytes + self.chunks.iter().filter_map(|chunk| chunk.planes.get()).map(wgpu::Buffer::size).sum::<u64>()
    }

    /// Uploads the attributes that the geometry has, and its triangles.
    pub fn upload(gpu: &Gpu, geometry: &Geometry) -> Result<Self, BackendError> {
        let vertex_count = geometry.positions.len();
        let counts = [
            ("normals", geometry.normals.len()),
            ("texcoords", geometry.texcoords.len()),
            ("colors", geometry.colors.len()),
            ("tangents", geometry.tangents.len()),
        ];
        for (name, count) in counts {
            if count != 0 && count != vertex_count {
                return Err(failure(&format!("the scene has {vertex_count} positions and {count} {name}")));
            }
        }
        let narrow = geometry.colors.is_empty() && geometry.tangents.is_empty();
        let widest = if narrow { size_of::<Vec3>() } else { size_of::<Vec4>() } as u64;
        // Compute programs read indices and vertices as storage buffers.
        let largest = gpu.max_buffer_bytes.min(gpu.limits.max_storage_buffer_binding_size);
        let layout = Layout::new(geometry.triangles.len(), vertex_count, widest, largest)?;
        let mut this = Self {
            chunks: Vec::new(),
            vertices: Vec::new(),
            parts: parts(geometry, &layout),
            has_normals: !geometry.normals.is_empty(),
            bytes: 0,
        };
        if layout.shared_vertices && layout.chunks().len() > 0 {
            this.push_vertices(gpu, geometry)?;
        }
        let mut compactor = Compactor::default();
        for range in layout.chunks() {
            let triangles = &geometry.triangles[range.clone()];
            let indices = if layout.shared_vertices {
                this.push_indices(gpu, triangles)?
            } else {
                let local = compactor.compact(triangles, vertex_count);
                let used = compactor.used();
                let part = Geometry {
                    positions: gather(&geometry.positions, used),
                    normals: gather(&geometry.normals, used),
                    texcoords: gather(&geometry.texcoords, used),
                    colors: gather(&geometry.colors, used),
                    tangents: gather(&geometry.tangents, used),
                    ..Geometry::default()
                };
                this.push_vertices(gpu, &part)?;
                this.push_indices(gpu, &local)?
            };
            this.chunks.push(Chunk {
                first: range.start as u32,
                count: range.len() as u32,
                indices,
                vertices: this.vertices.len() - 1,
                planes: OnceLock::new(),
            });
        }
        Ok(this)
    }

    fn push_indices(&mut self, gpu: &Gpu, triangles: &[[u32; 3]]) -> Result<wgpu::Buffer, BackendError> {
        let bytes = bytemuck::cast_slice(triangles);
        self.bytes += bytes.len() as u64;
        gpu.upload_buffer("upload of the triangles", wgpu::BufferUsages::INDEX | wgpu::BufferUsages::STORAGE, bytes)
    }

    /// Uploads the vertices of a geometry.
    fn push_vertices(&mut self, gpu: &Gpu, geometry: &Geometry) -> Result<(), BackendError> {
        let Geometry { positions, normals, texcoords, colors, tangents, .. } = geometry;
        let mut upload = |label: &str, bytes: &[u8]| {
            self.bytes += bytes.len() as u64;
            gpu.upload_buffer(label, wgpu::BufferUsages::VERTEX | wgpu::BufferUsages::STORAGE, bytes)
        };
        let positions = upload("upload of the positions", bytemuck::cast_slice(positions))?;
        let mut optional = |label: &str, bytes: &[u8]| {
            if bytes.is_empty() { Ok(None) } else { upload(label, bytes).map(Some) }
        };
        let normals = optional("upload of the normals", bytemuck::cast_slice(normals))?;
        let texcoords = optional("upload of the texture coordinates", bytemuck::cast_slice(texcoords))?;
        let colors = optional("upload of the vertex colours", bytemuck::cast_slice(colors))?;
        let tangents = optional("upload of the tangents", bytemuck::cast_slice(tangents))?;
        self.vertices.push(Vertices { positions, normals, texcoords, colors, tangents });
        Ok(())
    }
}

/// The values of some vertices; empty if `list` is empty.
fn gather<T: Copy>(list: &[T], vertices: &[u32]) -> Vec<T> {
    if list.is_empty() { Vec::new() } else { vertices.iter().map(|vertex| list[*vertex as usize]).collect() }
}

/// The division of the triangles into chunks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Layout {
    triangles: usize,
    per_chunk: usize,
    /// Whether all chunks index the same vertices. If not, each chunk has a copy of the vertices that it uses.
    shared_vertices: bool,
}

impl Layout {
    /// Chunks whose buffers have at most `max_bytes` bytes. `widest` is the size of the widest vertex attribute in bytes.
    fn new(triangles: usize, vertices: usize, widest: u64, max_bytes: u64) -> Result<Self, BackendError> {
        let shared_vertices = vertices as u64 * widest <= max_bytes;
        // Without shared vertices, each triangle of a chunk may use three vertices of its own.
        let triangle_bytes = if shared_vertices { PLANE_BYTES } else { 3 * widest };
        let per_chunk = usize::try_from(max_bytes / triangle_bytes).unwrap_or(usize::MAX);
        if per_chunk == 0 {
            return Err(failure(&format!("buffers of at most {max_bytes} bytes cannot hold a triangle")));
        }
        Ok(Self { triangles, per_chunk, shared_vertices })
    }

    fn chunks(&self) -> impl ExactSizeIterator<Item = Range<usize>> + use<> {
        let Self { triangles, per_chunk, .. } = *self;
        let count = triangles.div_ceil(per_chunk);
        (0..count).map(move |chunk| chunk * per_chunk..((chunk + 1) * per_chunk).min(triangles))
    }
}

/// The batches, divided where chunks end.
fn parts(geometry: &Geometry, layout: &Layout) -> Vec<Part> {
    let mut parts = Vec::with_capacity(geometry.batches.len() + layout.chunks().len());
    for batch in &geometry.batches {
        let end = (batch.first as usize + batch.count as usize).min(layout.triangles);
        let mut first = batch.first as usize;
        while first < end {
            let chunk = first / layout.per_chunk;
            let stop = end.min((chunk + 1) * layout.per_chunk);
            let count = (stop - first) as u32;
            let bounds = bounds(geometry, first..stop);
            parts.push(Part { chunk, material: batch.material, first: first as u32, count, bounds });
            first = stop;
        }
    }
    parts
}

/// The corners of the box around some triangles.
fn bounds(geometry: &Geometry, triangles: Range<usize>) -> [Vec3; 2] {
    let corners = geometry.triangles[triangles].par_iter().flatten_iter();
    let boxes = corners.map(|vertex| [geometry.positions[*vertex as usize]; 2]);
    boxes.reduce(|| [Vec3::INFINITY, Vec3::NEG_INFINITY], union)
}

/// The box around two boxes.
pub(super) fn union(one: [Vec3; 2], other: [Vec3; 2]) -> [Vec3; 2] {
    [one[0].min(other[0]), one[1].max(other[1])]
}

/// Renumbers the vertices of a chunk by first use.
#[derive(Debug, Default)]
struct Compactor {
    /// By vertex: its new index, or `u32::MAX` if the chunk does not use it.
    renumbered: Vec<u32>,
    used: Vec<u32>,
}

impl Compactor {
    /// The triangles with new indices; [`Self::used`] then lists the old index of each new one.
    fn compact(&mut self, triangles: &[[u32; 3]], vertex_count: usize) -> Vec<[u32; 3]> {
        for vertex in self.used.drain(..) {
            self.renumbered[vertex as usize] = u32::MAX;
        }
        self.renumbered.resize(vertex_count, u32::MAX);
        let mut renumber = |vertex: u32| {
            let new = &mut self.renumbered[vertex as usize];
            if *new == u32::MAX {
                *new = self.used.len() as u32;
                self.used.push(vertex);
            }
            *new
        };
        triangles.iter().map(|triangle| triangle.map(&mut renumber)).collect()
    }

    fn used(&self) -> &[u32] {
        &self.used
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use curitiba_pipeline::scene::Batch;

    fn strip(triangles: u32) -> Geometry {
        let batches = [(0, 0, 3), (1, 3, 1), (2, 4, triangles - 4)];
        Geometry {
            positions: (0..triangles + 2).map(|i| Vec3::new(i as f32, (i % 2) as f32, 0.0)).collect(),
            triangles: (0..triangles).map(|i| [i, i + 1, i + 2]).collect(),
            batches: batches.map(|(material, first, count)| Batch { material, first, count }).to_vec(),
            ..Geometry::default()
        }
    }

    #[test]
    fn parts_cover_every_triangle_once_in_order_and_stay_within_their_chunk() {
        let geometry = strip(100);
        for max_bytes in [36, 37, 96, 120, 1200, 1224, 1 << 20] {
            let layout = Layout::new(100, geometry.positions.len(), 12, max_bytes).expect("room");
            let mut next = 0;
            for part in parts(&geometry, &layout) {
                assert_eq!(part.first, next, "{max_bytes}");
                assert!(part.count > 0);
                let (from, to) = (part.first as f32, (part.first + part.count + 1) as f32);
                assert_eq!(part.bounds, [Vec3::new(from, 0.0, 0.0), Vec3::new(to, 1.0, 0.0)]);
                assert_eq!(part.material, geometry.material_of(part.first));
                assert_eq!(part.material, geometry.material_of(part.first + part.count - 1));
                let chunk = layout.chunks().nth(part.chunk).expect("exists");
                assert!(chunk.contains(&(part.first as usize)));
                assert!(chunk.contains(&((part.first + part.count - 1) as usize)));
                next += part.count;
            }
            assert_eq!(next, 100);
        }
    }

    #[test]
    fn no_chunk_exceeds_the_largest_buffer() {
        for (triangles, vertices) in [(10_000_000, 5_000_000), (10_000_000, 30_000_000)] {
            for max_bytes in [16 << 20, 256 << 20, 1 << 30] {
                let layout = Layout::new(triangles, vertices, 12, max_bytes).expect("room");
                let largest = layout.chunks().map(|range| range.len() as u64).max().expect("chunks");
                assert!(largest * 12 <= max_bytes);
                let chunk_vertices = if layout.shared_vertices { vertices as u64 } else { 3 * largest };
                assert!(chunk_vertices * 12 <= max_bytes);
                assert_eq!(layout.chunks().map(|range| range.len()).sum::<usize>(), triangles);
            }
        }
        assert!(Layout::new(1, 3, 12, 35).is_err(), "one triangle needs 36 bytes");
    }

    #[test]
    fn compacted_chunks_keep_every_corner() {
        let geometry = strip(50);
        let mut compactor = Compactor::default();
        for triangles in geometry.triangles.chunks(7) {
            let local = compactor.compact(triangles, geometry.positions.len());
            assert_eq!(compactor.used().len(), triangles.len() + 2, "a strip shares its vertices");
            for (new, old) in local.iter().zip(triangles) {
                assert_eq!(new.map(|vertex| compactor.used()[vertex as usize]), *old);
            }
        }
    }
}
