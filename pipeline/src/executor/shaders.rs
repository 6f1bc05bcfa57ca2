//! Own shaders of projects: the values of their uniforms, and their textures.

use super::textures::sampled;
use super::{Renderer, Surface};
use crate::backend::{BackendError, GBuffer, OwnMaterial, OwnTexture, QuadJob, QuadTexture, Rect, Shade, View};
use crate::glsl::{CameraValue, ColorValue, FRAME, LightValue, Matrix, Member, Program, Scalar, Value};
use crate::memory;
use crate::plan::{PlannedPass, Work};
use crate::project::{Bound, Camera, ChannelRef, ColorMap, OwnShader, Pass, PassKind, RasterPass, ShaderTexture};
use crate::scene::Material;
use glam::camera::rh;
use glam::{DMat4, DVec3, Mat4, Vec3, Vec4};
use std::path::PathBuf;
use std::sync::Arc;

/// By material: the surface that an own shader draws; empty for a pass without own shaders.
pub(super) fn surfaces(
    raster: &RasterPass,
    materials: &[Material],
    shades: &[Shade],
    colors: &[ColorMap],
) -> Vec<Option<Surface>> {
    if raster.shaders.is_empty() {
        return Vec::new();
    }
    let surface = |(material, shade): (&Material, &Shade)| {
        let shader = raster.own_shader(&material.name)?;
        let mut surface = Surface {
            shader,
            diffuse: shade.diffuse,
            ambient: material.ambient,
            specular: material.specular,
            emission: material.emission,
            shininess: material.shininess,
            texture: shade.texture,
        };
        for map in colors.iter().filter(|map| map.to.matches(&material.name)) {
            surface.emission = map.emission.unwrap_or(surface.emission);
            surface.ambient = map.phong.ambient.unwrap_or(surface.ambient);
            surface.specular = map.phong.specular.unwrap_or(surface.specular);
            surface.shininess = map.phong.shininess.unwrap_or(surface.shininess);
        }
        Some(surface)
    };
    materials.iter().zip(shades).map(surface).collect()
}

/// The channels of earlier passes that the own shaders of a pass sample, each listed once.
pub(super) fn own_channels(raster: &RasterPass) -> Vec<ChannelRef> {
    let mut channels = Vec::new();
    for texture in raster.shaders.iter().flat_map(|map| &map.shader.textures) {
        if let ShaderTexture::Channel(channel) = texture
            && !channels.contains(channel)
        {
            channels.push(*channel);
        }
    }
    channels
}

/// The buffers and images that the own shaders of a raster pass bind, each listed once, without the pass's own target.
pub(super) fn own_bound(pass: &Pass) -> Vec<Bound> {
    pass.kind.bound().into_iter().filter(|bound| pass.target != Some(bound.target)).collect()
}

/// Inputs that all uniforms of a pass share.
struct Scope<'a> {
    /// Camera of the pass; `None` in a quad pass.
    pass: Option<Seen<'a>>,
    viewport: Rect,
    /// Height of the target in pixels.
    height: u32,
}

/// A camera and its view of the viewport.
#[derive(Clone, Copy)]
struct Seen<'a> {
    camera: &'a Camera,
    view: View,
}

impl Renderer {
    /// The programs of a raster pass, and by material the inputs of its own shader; both empty for a pass without own shaders.
    pub(super) fn own_shaders(
        &self,
        index: usize,
        planned: &PlannedPass,
    ) -> (Vec<Arc<Program>>, Vec<Option<OwnMaterial>>) {
        let (Work::Raster { scene_set, view, viewport, .. }, PassKind::Raster(raster)) =
            (&planned.work, &self.plan.pass(planned).kind)
        else {
            return Default::default();
        };
        let surfaces = &self.materials[index].own;
        if surfaces.iter().all(Option::is_none) {
            return Default::default();
        }
        let scope = Scope {
            pass: Some(Seen { camera: &self.plan.project.cameras[self.plan.camera_of(raster)], view: *view }),
            viewport: *viewport,
            height: self.plan.target_size(self.plan.pass(planned).target)[1],
        };
        let images = &self.scenes[*scene_set].images;
        let channels = own_channels(raster);
        let bound = own_bound(self.plan.pass(planned));
        let stored = |of: &Bound| bound.iter().position(|bound| bound.target == of.target);
        let made = |surface: &Surface| {
            let shader = &raster.shaders[surface.shader].shader;
            let image = |path: &PathBuf| images.iter().find(|(file, _)| file == path).map(|(_, index)| *index);
            let texture = |texture: &ShaderTexture| match texture {
                ShaderTexture::Material => surface.texture.map(OwnTexture::Scene),
                ShaderTexture::File(path) => image(path).map(OwnTexture::Scene),
                ShaderTexture::Cube(paths) => match paths.each_ref().map(image) {
                    [Some(a), Some(b), Some(c), Some(d), Some(e), Some(f)] => {
                        Some(OwnTexture::Cube([a, b, c, d, e, f]))
                    }
                    _ => None,
                },
                ShaderTexture::Channel(channel) => {
                    channels.iter().position(|other| other == channel).map(OwnTexture::Channel)
                }
                // Passes that draw scenes cannot sample stored mip levels.
                ShaderTexture::Levels(_) | ShaderTexture::Nothing => None,
            };
            OwnMaterial {
                program: surface.shader,
                uniforms: self.uniforms(shader, surface, &scope),
                textures: shader.textures.iter().map(|of| texture(of).unwrap_or(OwnTexture::Nothing)).collect(),
                storage: shader.storage.iter().map(|of| stored(of.as_ref()?)).collect(),
                drawn: shader.drawn,
            }
        };
        let programs = raster.shaders.iter().map(|map| Arc::clone(&map.shader.program)).collect();
        (programs, surfaces.iter().map(|surface| surface.as_ref().map(made)).collect())
    }

    /// Fills a viewport of a buffer's colour with an own shader. Without `writes_color` the shader only stores to its buffers and images.
    pub(super) fn fill_quad(
        &mut self,
        (shader, pass, writes_color): (&OwnShader, usize, bool),
        viewport: Rect,
        buffer: &mut GBuffer,
    ) -> Result<(), BackendError> {
        let mut buffers = self.take_buffers(shader, pass);
        let filled = self.fill_with((shader, writes_color), &mut buffers, viewport, buffer);
        self.give_buffers(shader, buffers);
        filled
    }

    fn fill_with(
        &mut self,
        (shader, writes_color): (&OwnShader, bool),
        buffers: &mut [Vec<[f32; 4]>],
        viewport: Rect,
        buffer: &mut GBuffer,
    ) -> Result<(), BackendError> {
        self.load_sampled(shader)?;
        let failed = |message: String| BackendError::Device { backend: self.engines.raster.name(), message };
        let uniforms = self.quad_uniforms(shader, viewport, buffer.height);
        let textures: Vec<QuadTexture<'_>> = sampled(shader, &self.targets, &self.quad_images);
        let Rect { x, y, width, height } = viewport;
        if width == 0 || height == 0 {
            return Ok(());
        }
        let row = |line: u32| (y + line) as usize * buffer.width as usize + x as usize;
        let mut pixels =
            memory::with_capacity(width as usize * height as usize).map_err(|error| failed(error.to_string()))?;
        for line in 0..height {
            pixels.extend_from_slice(&buffer.color[row(line)..][..width as usize]);
        }
        let program = &shader.program;
        let job = QuadJob { program, uniforms: &uniforms, textures: &textures, width, height };
        self.engines.raster.fill(&job, &mut pixels, buffers)?;
        if !writes_color {
            return Ok(());
        }
        for (line, filled) in (0..).zip(pixels.chunks_exact(width as usize)) {
            buffer.color[row(line)..][..width as usize].copy_from_slice(filled);
        }
        Ok(())
    }

    /// The bytes of each uniform block of a compute pass's shader, which has no pixels.
    pub(super) fn compute_uniforms(&self, shader: &OwnShader) -> Vec<Vec<u8>> {
        self.quad_uniforms(shader, Rect { x: 0, y: 0, width: 0, height: 0 }, 0)
    }

    /// The bytes of each uniform block of a quad's shader, for a viewport of a target of the given height.
    pub(super) fn quad_uniforms(&self, shader: &OwnShader, viewport: Rect, height: u32) -> Vec<Vec<u8>> {
        let scope = Scope { pass: None, viewport, height };
        let white = Surface {
            shader: 0,
            diffuse: Vec4::ONE,
            ambient: Vec4::ONE,
            specular: Vec4::ONE,
            emission: Vec4::ONE,
            shininess: 0.0,
            texture: None,
        };
        self.uniforms(shader, &white, &scope)
    }

    /// The bytes of each uniform block.
    fn uniforms(&self, shader: &OwnShader, surface: &Surface, scope: &Scope<'_>) -> Vec<Vec<u8>> {
        let fill = |(block, values): (&crate::glsl::Block, &Vec<Option<Value>>)| {
            let mut bytes = vec![0; block.size as usize];
            for (member, value) in block.members.iter().zip(values) {
                match value {
                    Some(value) => self.put(&mut bytes, member, *value, shader, surface, scope),
                    None if member.name == FRAME => {
                        let Rect { x, y, .. } = scope.viewport;
                        put_columns(&mut bytes, member, &[Vec4::new(x as f32, (scope.height - y) as f32, 0.0, 0.0)]);
                    }
                    None => put_columns(&mut bytes, member, &[Vec4::from_array(member.default.unwrap_or_default())]),
                }
            }
            bytes
        };
        shader.program.blocks.iter().zip(&shader.values).map(fill).collect()
    }

    fn put(
        &self,
        bytes: &mut [u8],
        member: &Member,
        value: Value,
        shader: &OwnShader,
        surface: &Surface,
        scope: &Scope<'_>,
    ) {
        let number = |number: f32| vec![Vec4::new(number, 0.0, 0.0, 0.0)];
        let columns = match (value, scope.pass) {
            (Value::Matrix(_) | Value::NormalMatrix, None) => columns(DMat4::IDENTITY),
            // This value needs the pass's camera; a project that uses it in a quad is refused.
            (Value::Camera(None, _), None) => return,
            (Value::Matrix(matrix), Some(pass)) => self.matrix(pass, matrix),
            (Value::NormalMatrix, Some(pass)) => {
                let columns = self.view_model(pass.camera).inverse().transpose().as_mat4();
                columns.to_cols_array_2d()[..3].iter().map(|column| Vec4::from_array(*column)).collect()
            }
            (Value::Camera(camera, value), pass) => {
                let seen = |camera: usize| {
                    let camera = &self.plan.project.cameras[camera];
                    let own = pass.filter(|pass| std::ptr::eq(pass.camera, camera));
                    own.unwrap_or_else(|| Seen { camera, view: self.plan.view_of(camera).0 })
                };
                let Some(seen) = camera.map(seen).or(pass) else { return };
                self.of_camera(seen, value)
            }
            (Value::Light(light, value), _) => {
                let light = &self.plan.project.lights[light];
                vec![match value {
                    LightValue::Position => light.position.unwrap_or_default().as_vec3().extend(1.0),
                    // If the project names no direction, the default of the report's engine applies.
                    LightValue::Direction { length } => {
                        let axis = light.falloff.spot.map(|spot| spot.axis);
                        (light.direction.or(axis).unwrap_or(Vec3::NEG_Z) * length).extend(0.0)
                    }
                    LightValue::Color => light.color.extend(1.0),
                }]
            }
            (Value::Color(ColorValue::Diffuse), _) => vec![surface.diffuse],
            (Value::Color(ColorValue::Ambient), _) => vec![surface.ambient],
            (Value::Color(ColorValue::Specular), _) => vec![surface.specular],
            (Value::Color(ColorValue::Emission), _) => vec![surface.emission],
            (Value::Color(ColorValue::Shininess), _) => number(surface.shininess),
            (Value::TextureCount, _) => {
                let own = u32::from(surface.texture.is_some());
                number(shader.bound.unwrap_or(own + shader.injected) as f32)
            }
            (Value::Constant(constant), _) => vec![Vec4::from_array(constant)],
            (Value::Unit(unit), _) => number(unit as f32),
        };
        put_columns(bytes, member, &columns);
    }

    /// World (relative to the scenes' origin) to view space.
    fn view_model(&self, camera: &Camera) -> DMat4 {
        let position = (camera.position - self.plan.origin).as_vec3();
        rh::view::look_to_mat4(position, camera.direction, camera.up).as_dmat4()
    }

    /// World (absolute) to view space.
    fn world_view(&self, camera: &Camera) -> DMat4 {
        self.view_model(camera) * DMat4::from_translation(-self.plan.origin)
    }

    /// World (absolute) to OpenGL's clip space.
    fn to_clip(&self, Seen { camera, view }: Seen<'_>) -> DMat4 {
        in_opengl(view.clip_from_world) * self.view_model(camera).inverse() * self.world_view(camera)
    }

    fn matrix(&self, Seen { camera, view }: Seen<'_>, matrix: Matrix) -> Vec<Vec4> {
        let clip = in_opengl(view.clip_from_world);
        let projection = || clip * self.view_model(camera).inverse();
        columns(match matrix {
            Matrix::Projection => projection(),
            Matrix::Model => DMat4::from_translation(self.plan.origin),
            Matrix::View => self.world_view(camera),
            Matrix::ViewModel => self.view_model(camera),
            Matrix::ProjectionViewModel => clip,
            Matrix::ProjectionView => self.to_clip(Seen { camera, view }),
        })
    }

    fn of_camera(&self, seen: Seen<'_>, value: CameraValue) -> Vec<Vec4> {
        let camera = seen.camera;
        let number = |number: f32| vec![Vec4::new(number, 0.0, 0.0, 0.0)];
        match value {
            CameraValue::Position => vec![camera.position.as_vec3().extend(1.0)],
            CameraValue::View => vec![camera.direction.extend(0.0)],
            CameraValue::Up => vec![camera.up.normalize_or_zero().extend(0.0)],
            CameraValue::ViewMatrix => self.matrix(seen, Matrix::View),
            CameraValue::ProjectionMatrix => self.matrix(seen, Matrix::Projection),
            CameraValue::ProjectionViewMatrix => self.matrix(seen, Matrix::ProjectionView),
            CameraValue::TextureMatrix => {
                let half = DVec3::splat(0.5);
                columns(DMat4::from_translation(half) * DMat4::from_scale(half) * self.to_clip(seen))
            }
            CameraValue::Fov => number(camera.fov_y.to_degrees()),
            CameraValue::Near => number(camera.near),
            CameraValue::Far => number(camera.far),
        }
    }
}

/// Converts a projection with our depth (1 at the near plane, 0 at the far plane) to OpenGL's depth (-1 and 1).
fn in_opengl(clip: Mat4) -> DMat4 {
    let mut depth = DMat4::IDENTITY;
    (depth.z_axis.z, depth.w_axis.z) = (-2.0, 1.0);
    depth * clip.as_dmat4()
}

fn columns(matrix: DMat4) -> Vec<Vec4> {
    matrix.as_mat4().to_cols_array_2d().map(Vec4::from_array).to_vec()
}

/// Writes columns at a member's offset, with as many components as the member has.
fn put_columns(bytes: &mut [u8], member: &Member, columns: &[Vec4]) {
    let Some(shape) = member.shape else { return };
    for (index, column) in columns.iter().take(shape.columns as usize).enumerate() {
        for (row, value) in column.to_array().into_iter().take(shape.rows as usize).enumerate() {
            let word = match shape.scalar {
                Scalar::Float => value.to_ne_bytes(),
                Scalar::Int => (value as i32).to_ne_bytes(),
                Scalar::Uint => (value as u32).to_ne_bytes(),
            };
            // In std140 the columns of matrices are 16 bytes apart.
            let at = member.offset as usize + 16 * index + 4 * row;
            if let Some(place) = bytes.get_mut(at..at + 4) {
                place.copy_from_slice(&word);
            }
        }
    }
}
