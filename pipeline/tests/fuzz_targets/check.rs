//! Assertions of what a successful load guarantees.

use super::MAX_BYTES;
use curitiba_pipeline::diagnostic::Problems;
use curitiba_pipeline::image::MAX_SIDE;
use curitiba_pipeline::plan::{Plan, Settings, Work};
use curitiba_pipeline::programs::Fidelity;
use curitiba_pipeline::project::{ChannelRef, Falloff, Pass, PassKind, Project, QuadSource};
use curitiba_pipeline::scene::{
    BuildOptions, Layout, LoadOptions, Material, Needs, Object, RenderScene, Scene, SceneError, load, statistics,
    write_cbo,
};
use glam::Vec3;
use std::collections::HashSet;
use std::path::Path;

/// Result of loading an input.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// The input was read, and all guarantees hold.
    Loaded,
    /// The input was refused, and the error says why.
    Refused,
}

/// Checks that an error names the file and contains a message.
pub fn scene_error(error: &SceneError) {
    assert!(!error.what.is_empty() && !error.what.ends_with('.'), "{error}");
    assert!(!error.file.as_os_str().is_empty(), "{error}");
}

/// A scene, and the folder of its file.
pub struct LoadedScene<'a> {
    pub scene: Scene,
    pub folder: &'a Path,
}

impl LoadedScene<'_> {
    /// Checks a loaded scene, the render scene built from it, and the scene as read again after writing.
    pub fn check(&self) {
        scene(&self.scene);
        let plain = BuildOptions { max_bytes: MAX_BYTES, ..BuildOptions::default() };
        let turned = BuildOptions { model_space_normals: true, swap_yz: true, unitize: true, ..plain };
        for options in [plain, turned] {
            match RenderScene::build(self.scene.clone(), &options) {
                Ok((built, _)) => render_scene(&built, &options),
                Err(error) => scene_error(&error),
            }
        }
        for layout in [Layout::Cbo2014, Layout::NboToday] {
            self.round_trip(layout);
        }
    }

    /// Checks that a load without normals and textures has the same triangles.
    pub fn check_positions_only(&self, bare: &Scene) {
        scene(bare);
        let (all, less) = (statistics(&self.scene), statistics(bare));
        assert_eq!((all.triangles, all.bounds), (less.triangles, less.bounds), "what is needed changes what is there");
        assert!(bare.meshes.iter().all(|mesh| mesh.normals.is_empty() && mesh.texcoords.is_empty()));
        assert!(bare.textures.is_empty() && bare.materials.iter().all(|material| material.texture.is_none()));
    }

    /// Writes the scene and reads it again: it must have the same objects, triangles and materials.
    fn round_trip(&self, layout: Layout) {
        let name = if layout == Layout::Cbo2014 { "written.cbo" } else { "written.nbo" };
        let path = self.folder.join(name);
        match write_cbo(&self.scene, &path, layout) {
            Ok(_) => {}
            // A texture that is no image cannot be written, and the message says so.
            Err(error) if self.scene.textures.iter().any(|texture| error.what.contains(&texture.name())) => return,
            Err(error) => panic!("a loaded scene can be written: {error}"),
        }
        // Names may take more memory than in the original file, if many objects share one; and textures may be large images.
        let options = LoadOptions { max_bytes: 16 * MAX_BYTES, ..LoadOptions::default() };
        let read = match load(&[path], &options, &|_| {}) {
            Ok(read) => read,
            Err(error) => panic!("a written scene can be read: {error}"),
        };
        scene(&read);
        same(&self.scene, &read);
    }
}

/// Asserts that two scenes have the same objects, with the same positions, triangles and materials, bit by bit. Groups without
/// triangles and all names are not compared: the writer leaves out empty groups and may change names.
pub fn same(written: &Scene, read: &Scene) {
    let transforms = |scene: &Scene| -> Vec<[u32; 16]> {
        scene.objects.iter().map(|object| scene.to_world(object).as_mat4().to_cols_array().map(f32::to_bits)).collect()
    };
    assert_eq!(transforms(written), transforms(read), "objects and their transforms");
    for (ours, theirs) in written.objects.iter().zip(&read.objects) {
        let positions = |scene: &Scene, object: &Object| -> Vec<[u32; 3]> {
            let mesh = &scene.meshes[object.mesh as usize];
            mesh.positions.iter().map(|position| position.to_array().map(f32::to_bits)).collect()
        };
        assert_eq!(positions(written, ours), positions(read, theirs), "positions");
        let groups = |scene: &Scene, object: &Object| -> Vec<(Vec<u32>, Vec<[u32; 3]>)> {
            let groups = scene.meshes[object.mesh as usize].groups.iter().filter(|group| !group.triangles.is_empty());
            groups.map(|group| (kept_of(&scene.materials[group.material as usize]), group.triangles.clone())).collect()
        };
        assert_eq!(groups(written, ours), groups(read, theirs), "triangles and their materials");
    }
}

/// The numbers of a material that both layouts store.
fn kept_of(material: &Material) -> Vec<u32> {
    let colors = [material.diffuse, material.ambient, material.specular, material.emission];
    colors.iter().flat_map(|color| color.to_array()).chain([material.shininess]).map(f32::to_bits).collect()
}

/// Asserts the guarantees of [`Scene`]: indices, lengths, numbers, names, and the memory cap.
pub fn scene(scene: &Scene) {
    for object in &scene.objects {
        assert!((object.mesh as usize) < scene.meshes.len(), "object {} has no mesh", object.name);
    }
    let mut bytes = 0;
    for mesh in &scene.meshes {
        for group in &mesh.groups {
            assert!((group.material as usize) < scene.materials.len(), "mesh {} has no material", mesh.name);
            bytes += 12 * group.triangles.len() as u64;
        }
        for list in [mesh.normals.len(), mesh.texcoords.len()] {
            assert!(list == 0 || list == mesh.positions.len(), "mesh {}: {list} values", mesh.name);
        }
        bytes += (12 * mesh.positions.len() + 12 * mesh.normals.len() + 8 * mesh.texcoords.len()) as u64;
    }
    // The cap with which a written scene is read.
    assert!(bytes <= 16 * MAX_BYTES, "{bytes} bytes of vertices and triangles");
    let mut names = HashSet::new();
    for material in &scene.materials {
        assert!(names.insert(&material.name), "two materials are named {}", material.name);
        assert!(material.texture.is_none_or(|texture| (texture as usize) < scene.textures.len()));
        self::material(material);
    }
    let meshes: usize = scene.files.iter().map(|file| file.meshes as usize).sum();
    let objects: usize = scene.files.iter().map(|file| file.objects as usize).sum();
    assert_eq!((meshes, objects), (scene.meshes.len(), scene.objects.len()), "the files hold everything");
    let found = statistics(scene);
    assert_eq!(found.objects, scene.objects.len() as u64);
}

/// Asserts that no number of a material is NaN, and that only numbers with a meaningful infinity are infinite.
fn material(material: &Material) {
    for color in [material.diffuse, material.ambient, material.specular, material.emission] {
        assert!(color.is_finite(), "{material:?}");
    }
    assert!(material.attenuation_color.is_finite() && material.shininess.is_finite(), "{material:?}");
    assert!(material.thickness.is_finite() && (0.0..=1.0).contains(&material.transmission), "{material:?}");
    assert!(material.ior >= 1.0 && !material.attenuation_distance.is_nan(), "{material:?}");
    assert!((0.0..=1.0).contains(&material.roughness), "{material:?}");
    assert!(material.reflectance.is_none_or(|curve| curve.is_valid()), "{material:?}");
    assert!(material.reflection.cmpge(Vec3::ZERO).all() && material.reflection.cmple(Vec3::ONE).all(), "{material:?}");
    assert!(material.dispersion >= 0.0 && material.dispersion.is_finite(), "{material:?}");
    assert!(material.alpha_cutoff.is_none_or(|cutoff| !cutoff.is_nan()), "{material:?}");
}

/// Asserts the guarantees of [`RenderScene`] and its geometry.
pub fn render_scene(built: &RenderScene, options: &BuildOptions) {
    let geometry = &built.geometry;
    let vertices = geometry.positions.len();
    assert!(geometry.positions.iter().all(|position| position.is_finite()));
    let Needs { normals, textures, colors, normal_maps, .. } = options.needs;
    assert!(geometry.colors.is_empty() || (colors && geometry.colors.len() == vertices));
    assert!(geometry.colors.iter().all(|color| color.min_element() >= 0.0 && color.max_element() <= 1.0));
    assert_eq!(geometry.normals.len(), if normals { vertices } else { 0 });
    let mapped = !geometry.tangents.is_empty();
    assert_eq!(geometry.texcoords.len(), if textures || mapped { vertices } else { 0 });
    assert!(!mapped || (normals && normal_maps && geometry.tangents.len() == vertices));
    let unit = |tangent: &glam::Vec4| (tangent.truncate().length() - 1.0).abs() < 1e-5 && tangent.w.abs() == 1.0;
    assert!(geometry.tangents.iter().all(|tangent| *tangent == glam::Vec4::ZERO || unit(tangent)), "unit tangents");
    assert!(
        built.materials.iter().all(|m| m.normal_texture.is_none_or(|t| mapped && (t as usize) < built.textures.len()))
    );
    assert!(built.materials.iter().all(|m| m.normal_scale.abs() <= 1e6));
    let rough = |m: &Material| m.roughness_texture.is_none_or(|texture| (texture as usize) < built.textures.len());
    assert!(built.materials.iter().all(rough), "a roughness texture that is not there");
    assert!(geometry.normals.iter().all(|normal| (normal.length() - 1.0).abs() < 1e-5), "unit normals");
    assert!(geometry.texcoords.iter().all(|texcoord| texcoord.is_finite()));
    if options.unitize {
        assert!(geometry.positions.iter().all(|position| position.abs().max_element() <= 1.0));
    }
    for (id, triangle) in geometry.triangles.iter().enumerate() {
        assert!(triangle.iter().all(|vertex| (*vertex as usize) < vertices), "triangle {id}");
        let [a, b, c] = geometry.corners(id as u32).map(|corner: Vec3| corner.as_dvec3());
        let twice_area = (b - a).cross(c - a).length();
        assert!(twice_area >= f64::from(f32::MIN_POSITIVE), "triangle {id} has no area");
    }
    let mut next = 0;
    for pair in geometry.batches.windows(2) {
        assert!(pair[0].material < pair[1].material, "batches are sorted and distinct");
    }
    for batch in &geometry.batches {
        assert!(batch.first == next && batch.count > 0 && (batch.material as usize) < built.materials.len());
        next += batch.count;
    }
    assert_eq!(next as usize, geometry.triangles.len(), "batches cover all triangles");
    let mut texels = 0;
    for texture in &built.textures {
        let last = texture.levels.last().expect("a texture has levels");
        assert_eq!((last.width, last.height), (1, 1), "the mip chain ends at one texel");
        for level in &texture.levels {
            assert_eq!(level.texels.len() as u64, u64::from(level.width) * u64::from(level.height));
            texels += level.texels.len() as u64;
        }
        assert!(texture.sample(glam::Vec2::new(0.3, 7.9), 0.5).is_finite());
    }
    assert!(built.materials.iter().all(|m| m.texture.is_none_or(|t| (t as usize) < built.textures.len())));
    let vertex =
        12 + if normals { 12 } else { 0 } + if textures || mapped { 8 } else { 0 } + if mapped { 16 } else { 0 };
    let vertex = vertex + if geometry.colors.is_empty() { 0 } else { 16 };
    let bytes = 4 * texels + vertices as u64 * vertex + 12 * geometry.triangles.len() as u64;
    // The mip chain of a texture one texel wide has twice the image's size, not 4/3.
    assert!(bytes <= MAX_BYTES + MAX_BYTES / 2, "{bytes} bytes built");
}

/// Loads a project, checks it, and plans each of its pipelines.
pub fn project(path: &Path) -> Outcome {
    let project = match curitiba_pipeline::project::load(path) {
        Ok(project) => project,
        Err(problems) => {
            assert!(problems.has_errors(), "a refusal has an error");
            problems_shown(&problems);
            return Outcome::Refused;
        }
    };
    assert!(!project.problems.has_errors());
    problems_shown(&project.problems);
    project_references(&project);
    for pipeline in project.pipelines.iter().take(4) {
        for (fidelity, size) in [(Fidelity::Corrected, None), (Fidelity::Thesis, Some([33, 7]))] {
            let settings = Settings {
                pipeline: Some(pipeline.name.clone()),
                show: vec!["all".to_owned()],
                size,
                fidelity,
                ..Settings::default()
            };
            match Plan::new(project.clone(), settings) {
                Ok(planned) => plan(&planned),
                Err(error) => assert!(!error.to_string().is_empty()),
            }
        }
    }
    Outcome::Loaded
}

/// Asserts that every problem can be shown with its place, and that their number is limited.
fn problems_shown(problems: &Problems) {
    assert!(problems.0.len() <= 202, "{} problems", problems.0.len());
    for problem in &problems.0 {
        assert!(!problem.message.is_empty());
        if let Some((source, range)) = &problem.place {
            assert!(range.start <= range.end, "{}: {range:?}", problem.message);
            assert!(
                source.text.get(range.clone()).is_some() || source.text.is_empty(),
                "{}: {range:?}",
                problem.message
            );
        }
    }
    let text = problems.to_string();
    assert!(text.len() <= 202 * 16_384, "{} bytes of messages", text.len());
}

/// Asserts the guarantees of [`Project`]: every index is valid, and every number in its range.
pub fn project_references(project: &Project) {
    assert!(project.window.iter().all(|side| (1..=MAX_SIDE).contains(side)));
    assert!(project.default_pipeline < project.pipelines.len());
    for viewport in &project.viewports {
        assert!(viewport.origin.iter().all(|edge| (0.0..=MAX_SIDE as f32).contains(edge)), "{viewport:?}");
        assert!(viewport.size.iter().all(|side| *side > 0.0 && *side <= MAX_SIDE as f32), "{viewport:?}");
        assert!(viewport.clear_color.is_finite(), "{viewport:?}");
    }
    for camera in &project.cameras {
        assert!(camera.position.is_finite() && camera.direction.is_normalized(), "{camera:?}");
        assert!(camera.direction.cross(camera.up).length() > 0.0, "{camera:?}");
        assert!(camera.fov_y > 0.0 && camera.fov_y < std::f32::consts::PI, "{camera:?}");
        assert!(camera.near > 0.0 && camera.far > camera.near && camera.far.is_finite(), "{camera:?}");
        assert!(camera.viewport.is_none_or(|viewport| viewport < project.viewports.len()), "{camera:?}");
    }
    for light in &project.lights {
        assert!(light.color.is_finite() && light.direction.is_none_or(Vec3::is_normalized), "{light:?}");
        assert!(light.direction.is_some() || light.position.is_some(), "{light:?}");
        let Falloff { attenuation, range, spot } = light.falloff;
        assert!(
            attenuation.iter().all(|part| *part >= 0.0 && part.is_finite()) && attenuation != [0.0; 3],
            "{light:?}"
        );
        assert!(range > 0.0, "{light:?}");
        if let Some(spot) = spot {
            assert!(spot.axis.is_normalized() && spot.exponent >= 0.0 && spot.inner <= spot.cutoff, "{light:?}");
            assert!(spot.cutoff > 0.0 && spot.cutoff <= 180.0 && spot.inner >= 0.0, "{light:?}");
        }
    }
    for target in &project.targets {
        assert!(target.size.iter().all(|side| (1..=MAX_SIDE).contains(side)), "{target:?}");
        assert!(target.channels.len() <= 32, "{target:?}");
    }
    for scene in &project.scenes {
        assert!(!scene.files.is_empty(), "{scene:?}");
    }
    for pipeline in &project.pipelines {
        assert!(pipeline.camera.is_none_or(|camera| camera < project.cameras.len()));
        assert!(!pipeline.passes.is_empty() || pipeline.broken.is_some());
        pipeline.passes.iter().for_each(|pass| references_of(pass, project));
    }
}

fn references_of(pass: &Pass, project: &Project) {
    let channel = |channel: &ChannelRef| {
        let target = project.targets.get(channel.target).expect("a channel's target is declared");
        assert!(channel.channel < target.channels.len(), "pass {}: {channel:?}", pass.name);
    };
    let seen = |scenes: &[usize], camera: usize, lights: &[usize]| {
        assert!(scenes.iter().all(|scene| *scene < project.scenes.len()), "pass {}", pass.name);
        assert!(camera < project.cameras.len(), "pass {}", pass.name);
        assert!(lights.iter().all(|light| *light < project.lights.len()), "pass {}", pass.name);
    };
    assert!(pass.viewport.is_none_or(|viewport| viewport < project.viewports.len()), "pass {}", pass.name);
    assert!(pass.target.is_none_or(|target| target < project.targets.len()), "pass {}", pass.name);
    match &pass.kind {
        PassKind::Raster(raster) => seen(&raster.scenes, raster.camera, &raster.lights),
        PassKind::Ray(ray) => {
            seen(&ray.scenes, ray.camera, &ray.lights);
            [ray.position, ray.normal, ray.color].iter().flatten().for_each(channel);
        }
        PassKind::Effect(effect) => {
            seen(&effect.scenes, effect.camera, &effect.lights);
            [effect.position, effect.normal, effect.color].iter().flatten().for_each(channel);
        }
        PassKind::Quad(quad) => match &quad.source {
            QuadSource::Show(shown) => channel(shown),
            QuadSource::Combine { color, factor } => [color, factor].into_iter().for_each(channel),
            QuadSource::Own => assert!(quad.shader.is_some(), "pass {}", pass.name),
        },
        PassKind::Intersection(intersection) => {
            assert!(intersection.scenes.iter().all(|scene| *scene < project.scenes.len()), "pass {}", pass.name);
            intersection.reads().for_each(|read| channel(&read));
            assert_eq!(pass.target, Some(intersection.hits), "pass {}", pass.name);
        }
        PassKind::Compute(compute) => {
            assert_eq!(pass.target, Some(compute.stored), "pass {}", pass.name);
            assert!(compute.groups.iter().all(|count| *count > 0), "pass {}", pass.name);
        }
    }
}

/// Asserts the guarantees of a plan: passes draw within their targets, and the memory is within the cap.
fn plan(plan: &Plan) {
    assert!(plan.target_bytes() <= plan.settings.max_memory);
    for planned in &plan.passes {
        let declared = plan.pass(planned);
        let [width, height] = plan.target_size(declared.target);
        let (view, viewport, scene_set) = match &planned.work {
            Work::Raster { view, viewport, scene_set, .. } => (Some(view), Some(viewport), Some(*scene_set)),
            Work::Rays { view, scene_set, .. } | Work::Effect { view, scene_set, .. } => {
                (Some(view), None, Some(*scene_set))
            }
            Work::Quad { viewport } => (None, Some(viewport), None),
            Work::Intersection { scene_set } => (None, None, Some(*scene_set)),
            Work::Off { .. } | Work::Compute => (None, None, None),
        };
        if let Some(rect) = viewport {
            assert!(rect.x + rect.width <= width && rect.y + rect.height <= height, "{}: {rect:?}", declared.name);
        }
        assert!(scene_set.is_none_or(|set| set < plan.scene_sets.len()), "{}", declared.name);
        assert!(view.is_none_or(|view| view.eye.is_finite()), "{}", declared.name);
    }
}
