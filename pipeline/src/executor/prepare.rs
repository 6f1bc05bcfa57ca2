//! Loads scenes, resolves materials, and hands both to the engines.

use super::shaders;
use super::{LoadedScenes, Observer, PassMaterials, Progress, RenderError, Renderer, SceneNotes, StepKind};
use crate::backend::{Attachments, BackendError, GBuffer, Glow, NormalMap, Shade};
use crate::camera_programs::{CUT_OUT, SurfaceKind};
use crate::color::ColorSpace;
use crate::diagnostic::Decision;
use crate::glass::{self, Decided, Dielectric, GlassShadow, Shape};
use crate::kept_scenes::{Built, Kept};
use crate::memory::mebibytes;
use crate::memory::{self, Refused};
use crate::plan::{PlannedPass, Traced, Work};
use crate::programs::{Fidelity, RayParams};
use crate::project::{CameraStart, ColorMap, MaterialPattern, PassKind, TextureMap};
use crate::scene::{BuildOptions, LoadOptions, Material, RenderScene, TextureSource};
use glam::{DVec3, Vec3, Vec4};
use std::sync::Arc;
use std::time::Instant;

/// The colour where nothing is drawn: opaque black in the window (`None`), 0 in a target.
pub(super) fn undrawn(target: Option<usize>) -> [f32; 4] {
    if target.is_none() { [0.0, 0.0, 0.0, 1.0] } else { [0.0; 4] }
}

/// The window before the first frame.
pub(super) fn window([width, height]: [u32; 2]) -> Result<GBuffer, Refused> {
    let mut window = GBuffer::try_new(width, height, Attachments { color: true, ..Attachments::default() })?;
    window.color.fill(undrawn(None));
    Ok(window)
}

impl Renderer {
    /// Loads every scene set and resolves the materials for each pass. Then uploads the scene set of the first raster or effect pass,
    /// and builds the structure for the first pass that traces rays.
    pub(super) fn prepare(&mut self, observer: &mut dyn Observer) -> Result<(), RenderError> {
        self.check_drawn()?;
        self.load_scenes(observer)?;
        for index in 0..self.plan.passes.len() {
            self.resolve_materials(index);
        }
        // The glass features that the ray backends need are known only once the scenes are loaded.
        if let Some((pass, error)) = self.unsupported() {
            self.stand_in(&pass, error, observer)?;
        }
        let plan = &self.plan;
        let drawn = plan.passes.iter().find_map(|planned| match planned.work {
            Work::Raster { scene_set, .. } | Work::Effect { scene_set, .. } => {
                Some((plan.pass(planned).name.clone(), scene_set))
            }
            _ => None,
        });
        let traced = plan
            .passes
            .iter()
            .find_map(|planned| Some((plan.pass(planned).name.clone(), plan.traced(planned)?.scene_set)));
        if let Some((pass, set)) = drawn {
            self.upload(set, observer).map_err(|error| RenderError::Pass { pass, frame: None, error })?;
        }
        if let Some((pass, set)) = traced {
            self.build_or_stand_in(set, &pass, observer)?;
        }
        self.join_engines();
        Ok(())
    }

    /// Fails if the rasteriser cannot draw something in the plan (exact spheres, own shaders).
    pub(super) fn check_drawn(&self) -> Result<(), RenderError> {
        let raster = &*self.engines.raster;
        match self.plan.undrawn_spheres(raster).or_else(|| self.plan.undrawn_shaders(raster)) {
            Some((pass, error)) => Err(RenderError::Pass { pass, frame: None, error }),
            None => Ok(()),
        }
    }

    /// Loads every scene set, and stores decisions and warnings about them.
    pub(super) fn load_scenes(&mut self, observer: &mut dyn Observer) -> Result<(), RenderError> {
        let before = std::mem::take(&mut self.warnings);
        let decided = self.plan.decisions.len();
        // The report's programs have no origin other than 0, and their noise depends on the origin.
        let mut origin = (self.plan.settings.fidelity == Fidelity::Thesis).then_some(DVec3::ZERO);
        for set in self.plan.scene_sets.clone() {
            let mut scene = self.load(&set, &mut origin, observer)?;
            let dielectrics = self.decide_glass(self.scenes.len(), &mut scene);
            let images = self.load_images(self.scenes.len(), &mut scene)?;
            let mapped = self.load_mapped(self.scenes.len(), &mut scene)?;
            self.scenes.push(LoadedScenes { scene, dielectrics, images, mapped, structure: false });
        }
        let origin = origin.unwrap_or_default();
        self.plan.move_origin(origin);
        if origin != DVec3::ZERO {
            let why = format!(
                "the scene is farther from the origin than 16 times its size; positions that are shown or written are relative to {} {} {}",
                origin.x, origin.y, origin.z
            );
            self.plan.decisions.push(Decision { what: "origin near the scene".to_owned(), built: true, why });
        }
        let warnings = std::mem::replace(&mut self.warnings, before);
        self.warnings.append(warnings.clone());
        self.scene_notes = SceneNotes { decisions: self.plan.decisions[decided..].to_vec(), warnings };
        Ok(())
    }

    /// The glass properties of each material of a scene set, if a pass asks for them. The choices are added to the plan's
    /// decisions.
    fn decide_glass(&mut self, set: usize, scene: &mut Arc<RenderScene>) -> Vec<Dielectric> {
        let asks = |planned: &&PlannedPass| {
            matches!(planned.work, Work::Rays { scene_set, .. } if scene_set == set)
                && self.plan.asks_materials(planned)
        };
        if self.plan.passes.iter().find(asks).is_none() {
            return Vec::new();
        }
        let Decided { dielectrics, decisions, warnings } = glass::decide(scene, &self.plan.project.path);
        self.plan.decisions.extend(decisions);
        self.warnings.append(warnings);
        dielectrics
    }

    /// Loads a scene set, unless an earlier renderer kept it. The first scene loaded chooses the origin, and the later ones use it too.
    fn load(
        &mut self,
        set: &[usize],
        origin: &mut Option<DVec3>,
        observer: &mut dyn Observer,
    ) -> Result<Arc<RenderScene>, RenderError> {
        let names: Vec<&str> = set.iter().map(|index| self.plan.project.scenes[*index].name.as_str()).collect();
        let name = names.join(" + ");
        let declared = set.iter().map(|index| &self.plan.project.scenes[*index]);
        let thesis = self.plan.settings.fidelity == Fidelity::Thesis;
        let built = Built::new(declared, (self.plan.needs, self.plan.display.space, thesis), *origin);
        let kept_scenes = self.plan.settings.scenes.clone();
        let known = built.as_ref().and_then(|built| kept_scenes.find(built));
        let was_kept = known.is_some();
        let Kept { scene, warnings, took } = match known {
            Some(kept) => kept,
            None => {
                let progress = Arc::new(Progress::default());
                observer.begin(StepKind::Load, &name, &progress);
                let start = Instant::now();
                let before = std::mem::take(&mut self.warnings);
                let loaded = self.load_set(set, *origin, &progress);
                let warnings = std::mem::replace(&mut self.warnings, before);
                observer.end();
                let kept = Kept { scene: Arc::new(loaded?), warnings, took: start.elapsed() };
                if let Some(built) = built {
                    kept_scenes.keep(built, kept.clone());
                }
                kept
            }
        };
        if !set.is_empty() {
            *origin = Some(scene.origin);
        }
        self.warnings.append(warnings);
        let row = self.timeline.record(StepKind::Load, &name, took);
        let (triangles, textures) = (scene.geometry.triangles.len(), scene.textures.len());
        let spheres = match scene.geometry.spheres.len() {
            0 => String::new(),
            count => format!("{count} exact spheres, "),
        };
        row.note = format!("{triangles} triangles, {spheres}{} materials, {textures} textures", scene.materials.len());
        if was_kept {
            row.note += ", kept by an earlier renderer: the time is that of its load";
        }
        Ok(scene)
    }

    fn load_set(
        &mut self,
        set: &[usize],
        mut origin: Option<DVec3>,
        progress: &Progress,
    ) -> Result<RenderScene, RenderError> {
        let max_bytes = self.plan.settings.max_memory.saturating_sub(self.plan.target_bytes());
        let mut whole: Option<RenderScene> = None;
        for index in set {
            let declared = &self.plan.project.scenes[*index];
            let places: Vec<_> = declared.files.iter().map(|file| file.place.as_str()).collect();
            let place = places.join(", ");
            let wrong = |error| RenderError::Scene { place: place.clone(), error };
            let loaded = declared.load(&LoadOptions { needs: self.plan.needs, max_bytes }, &|state| {
                progress.start(state.bytes_total);
                progress.advance(state.bytes_done);
            });
            let mut loaded = loaded.map_err(wrong)?;
            self.warnings.append(std::mem::take(&mut loaded.warnings));
            let thesis = self.plan.settings.fidelity == Fidelity::Thesis;
            if thesis {
                // The report's programs have no alpha test and no sky. Without an alpha test textures get the mip levels of opaque ones.
                for material in &mut loaded.materials {
                    (material.alpha_cutoff, material.sky) = (None, false);
                }
            }
            let (needs, model_space_normals) = (self.plan.needs, thesis);
            let color = self.plan.display.space;
            let options = BuildOptions { needs, model_space_normals, color, max_bytes, ..BuildOptions::default() };
            let options = BuildOptions { origin, ..declared.build_options(options) };
            let (built, warnings) = RenderScene::build(loaded, &options).map_err(wrong)?;
            origin = Some(built.origin);
            self.warnings.append(warnings);
            match &mut whole {
                None => whole = Some(built),
                Some(whole) => whole.append(built),
            }
        }
        Ok(whole.unwrap_or_default())
    }

    pub(super) fn resolve_materials(&mut self, index: usize) {
        let planned = self.plan.passes[index].clone();
        let pass = self.plan.pass(&planned);
        let corrected = self.plan.settings.fidelity == Fidelity::Corrected;
        let (set, colors) = match (&planned.work, &pass.kind) {
            (Work::Raster { scene_set, .. }, PassKind::Raster(raster)) => (*scene_set, &raster.colors),
            // A program that does not shade hits reads no colours. The pass's colour maps are left out, so that they do not remove the
            // holes of materials.
            (Work::Rays { scene_set, .. }, PassKind::Ray(ray)) => {
                let shades_hits = ray.program.info().material_attributes.contains(&"diffuse");
                (*scene_set, if shades_hits { &ray.colors } else { const { &Vec::new() } })
            }
            (Work::Effect { scene_set, .. }, PassKind::Effect(effect)) => (*scene_set, &effect.colors),
            _ => {
                self.decide_structure(&planned);
                self.materials.push(PassMaterials::default());
                return;
            }
        };
        let colors = in_space(colors, self.plan.display.space);
        let (materials, mapped) = (&self.scenes[set].scene.materials, &self.scenes[set].mapped);
        let mut resolved = PassMaterials {
            shades: materials.iter().map(|material| shade(material, &colors, mapped, corrected)).collect(),
            ..PassMaterials::default()
        };
        if !matches!(&pass.kind, PassKind::Ray(ray) if ray.from_camera.is_some()) {
            let skies = resolved.shades.iter_mut().zip(materials).filter(|(_, material)| material.sky);
            skies.for_each(|(shade, _)| *shade = shining(shade));
        }
        let matching = |patterns: &[MaterialPattern]| -> Vec<bool> {
            let matches = |material: &Material| patterns.iter().any(|pattern| pattern.matches(&material.name));
            materials.iter().map(matches).collect()
        };
        if let PassKind::Raster(raster) = &pass.kind {
            resolved.own = shaders::surfaces(raster, materials, &resolved.shades, &colors);
        }
        // The report's programs draw both sides of every surface.
        if let PassKind::Raster(_) = &pass.kind
            && corrected
        {
            // A solid body is seen from inside too, so its back faces are kept.
            let solid =
                |index: usize| matches!(self.scenes[set].dielectrics.get(index), Some(d) if d.shape == Shape::Solid);
            let culled = |(index, material): (usize, &Material)| material.single_sided && !solid(index);
            resolved.culled = materials.iter().enumerate().map(culled).collect();
        }
        let mut focused = Vec::new();
        if let PassKind::Effect(effect) = &pass.kind {
            resolved.glass = matching(&effect.glass);
            resolved.shadow_glass = vec![false; materials.len()];
        }
        if let PassKind::Ray(ray) = &pass.kind {
            resolved.glass = matching(&ray.glass);
            resolved.shadow_glass = matching(&ray.shadow_glass);
            if let Some(start) = &ray.from_camera {
                resolved.start_at_camera(start, materials);
            }
            if self.plan.asks_materials(&planned) {
                resolved.dielectrics = self.scenes[set].dielectrics.clone();
                let table = resolved.dielectrics.iter_mut().zip(&mut resolved.glass).zip(&mut resolved.shadow_glass);
                for ((dielectric, glass), shadow_glass) in table {
                    // A material that the project names as glass, but whose properties do not make it glass, is a pane as in the
                    // report.
                    if *glass && dielectric.shape == Shape::Opaque {
                        dielectric.shape = Shape::Pane;
                    }
                    let own = matches!(dielectric.shape, Shape::Thin | Shape::Solid);
                    *glass |= own;
                    *shadow_glass |= own;
                }
            }
            match &planned.work {
                Work::Rays { params: RayParams { shadow: GlassShadow::Opaque, .. }, .. } => {
                    resolved.shadow_glass.fill(false);
                }
                Work::Rays { params: RayParams { shadow: GlassShadow::Caustic, .. }, .. } => {
                    let photons = self.plan.photons(&planned);
                    focused = glass::caustics(&pass.name, &self.scenes[set].scene, &resolved.dielectrics, photons);
                }
                _ => {}
            }
        }
        self.decide_structure(&planned);
        self.plan.decisions.extend(focused);
        self.materials.push(resolved);
    }

    /// Adds the decision whether a pass needs an acceleration structure.
    fn decide_structure(&mut self, planned: &PlannedPass) {
        let Some(set) = self.plan.traced(planned).map(|traced| traced.scene_set) else { return };
        let (needed, why) = self.plan.needs_structure(planned, &self.scenes[set].scene.materials);
        let what = format!("acceleration structure for pass `{}`", self.plan.pass(planned).name);
        self.plan.decisions.push(Decision { what, built: needed, why });
        self.scenes[set].structure |= needed;
    }

    /// Hands a scene set to the rasteriser, unless it holds it already.
    pub(super) fn upload(&mut self, set: usize, observer: &mut dyn Observer) -> Result<(), BackendError> {
        if self.uploaded == Some(set) {
            return Ok(());
        }
        let name = self.engines.raster.name();
        observer.begin(StepKind::Upload, name, &Arc::new(Progress::default()));
        let start = Instant::now();
        let result = self.engines.raster.upload(&self.scenes[set].scene);
        observer.end();
        result?;
        self.timeline.record(StepKind::Upload, name, start.elapsed());
        self.uploaded = Some(set);
        Ok(())
    }

    /// Builds the acceleration structures of a scene set, unless they are built already or no pass traces in it. If a backend
    /// fails, an allowed fallback takes over.
    pub(super) fn build_or_stand_in(
        &mut self,
        set: usize,
        pass: &str,
        observer: &mut dyn Observer,
    ) -> Result<(), RenderError> {
        loop {
            if self.built != Some(set) {
                self.check_structure_memory(set)?;
            }
            if self.built == Some(set) || !self.scenes[set].structure {
                return Ok(());
            }
            // A backend releases its previous structure.
            self.built = None;
            let filtered = self.filtered_materials(set);
            let mut passes = self.engines.first_traced(&self.plan, Some(set));
            if passes.is_empty() {
                passes.push(pass.to_owned());
            }
            let built = passes
                .iter()
                .try_for_each(|pass| self.build(set, pass, &filtered, observer).map_err(|error| (pass.clone(), error)));
            self.check_cancelled()?;
            match built {
                Ok(()) => {
                    self.built = Some(set);
                    (self.built_filtered, self.built_for) = (filtered, passes);
                    return Ok(());
                }
                Err((pass, error)) => self.stand_in(&pass, error, observer)?,
            }
        }
    }

    /// Builds the structure of a scene set in the ray backend that a pass uses.
    fn build(
        &mut self,
        set: usize,
        pass: &str,
        filtered: &[bool],
        observer: &mut dyn Observer,
    ) -> Result<(), BackendError> {
        let progress = self.progress();
        let rays = self.engines.rays_of_mut(pass);
        let name = rays.name();
        observer.begin(StepKind::Build, name, &progress);
        let start = Instant::now();
        let built = rays.build_until(&self.scenes[set].scene, filtered, &progress);
        observer.end();
        self.given_up |= progress.is_given_up();
        let stats = built?;
        let row = self.timeline.record(StepKind::Build, name, start.elapsed());
        row.bytes = stats.bytes;
        row.note = format!("{} nodes, {}", stats.nodes, mebibytes(stats.bytes));
        Ok(())
    }

    /// By material: whether rays of some ray pass may pass through its triangles.
    pub(super) fn filtered_materials(&self, set: usize) -> Vec<bool> {
        let mut filtered = vec![false; self.scenes[set].scene.materials.len()];
        for (planned, materials) in self.plan.passes.iter().zip(&self.materials) {
            // Rays of a storage buffer ignore materials: every surface stops them.
            let asks = |traced: Traced<'_>| traced.scene_set == set && traced.program.is_some();
            if self.plan.traced(planned).is_some_and(asks) {
                for (material, filtered) in filtered.iter_mut().enumerate() {
                    *filtered |= materials.shades[material].alpha_cutoff.is_some() || materials.shadow_glass[material];
                }
            }
        }
        filtered
    }

    fn check_structure_memory(&self, set: usize) -> Result<(), RenderError> {
        let loaded = &self.scenes[set];
        if !loaded.structure {
            return Ok(());
        }
        let geometry = &loaded.scene.geometry;
        let texels = loaded.scene.textures.iter().flat_map(|texture| &texture.levels);
        let textures: u64 = texels.map(|level| 4 * level.texels.len() as u64).sum();
        let held = geometry.positions.len() as u64 * 32 + geometry.triangles.len() as u64 * 12 + textures;
        let left = self.plan.settings.max_memory.saturating_sub(self.plan.target_bytes() + held);
        let passes = self.engines.first_traced(&self.plan, Some(set));
        let each: u64 = passes.iter().map(|pass| self.engines.rays_of(pass).bytes_per_triangle()).sum();
        let needed = geometry.triangles.len() as u64 * each;
        if needed > left {
            return Err(RenderError::Memory {
                what: format!("the acceleration structure of {} triangles", geometry.triangles.len()),
                needed: mebibytes(needed),
                left: mebibytes(left),
            });
        }
        // The BVH builder is another crate, which allocates without a check: test first whether the memory is there.
        memory::probe(needed)?;
        Ok(())
    }
}

impl PassMaterials {
    /// How rays that start at the camera behave at each material.
    fn start_at_camera(&mut self, start: &CameraStart, materials: &[Material]) {
        let kind = |material: &Material| {
            let named = start.surfaces.iter().rfind(|(pattern, _)| pattern.matches(&material.name));
            named.map_or(SurfaceKind::Painted, |(_, kind)| *kind)
        };
        self.surfaces = materials.iter().map(kind).collect();
        for ((kind, shade), shadow_glass) in self.surfaces.iter().zip(&mut self.shades).zip(&mut self.shadow_glass) {
            if *kind == SurfaceKind::CutOut {
                shade.alpha_cutoff.get_or_insert(CUT_OUT);
            }
            *shadow_glass |= kind.passes_light();
        }
    }
}

/// Converts the colours of a project's maps from display values to a colour space.
fn in_space(colors: &[ColorMap], space: ColorSpace) -> Vec<ColorMap> {
    let made = |map: &ColorMap| ColorMap {
        diffuse: map.diffuse.map(|color| space.of_display(color)),
        emission: map.emission.map(|color| space.of_display(color)),
        ..map.clone()
    };
    colors.iter().map(made).collect()
}

/// The colours of a material in a pass. A colour map that replaces colours keeps the holes of the material: the alpha cutoff uses the
/// material's own opacity. A colour map that replaces or removes the texture removes the holes. `mapped` lists the textures that the
/// project maps to materials, with their indices in the scene's textures.
fn shade(material: &Material, colors: &[ColorMap], mapped: &[(TextureSource, u32)], corrected: bool) -> Shade {
    let mut shade = Shade {
        diffuse: material.diffuse,
        emission: material.emission,
        texture: material.texture,
        normal_map: material
            .normal_texture
            .filter(|_| corrected)
            .map(|texture| NormalMap { texture, scale: material.normal_scale }),
        vertex_colors: material.vertex_colors && corrected,
        alpha_cutoff: material.cutoff().filter(|_| corrected),
        glow: None,
    };
    if corrected && material.emission_added {
        let glow = Glow { color: material.emission.truncate(), texture: material.emission_texture };
        shade.glow = Some(glow).filter(|glow| glow.color != Vec3::ZERO);
        shade.emission = Vec4::ZERO;
    }
    for map in colors.iter().filter(|map| map.to.matches(&material.name)) {
        shade.diffuse = map.diffuse.unwrap_or(shade.diffuse);
        if let Some(emission) = map.emission {
            (shade.emission, shade.glow) = (emission, None);
        }
        if map.texture != TextureMap::Kept {
            let source = map.texture.source();
            let found = mapped.iter().find(|(known, _)| Some(known) == source.as_ref());
            shade.texture = found.map(|(_, index)| *index);
            shade.vertex_colors = false;
            shade.alpha_cutoff = None;
        }
    }
    shade
}

/// The shade of a sky: it shows its emission, or else its diffuse colour, whatever the light of the pass. A sky with vertex colours is
/// lit like any other surface.
fn shining(shade: &Shade) -> Shade {
    /// Light that every surface reflects, as in the report.
    const AMBIENT: f32 = 0.3;
    if shade.vertex_colors {
        return *shade;
    }
    // A texture that cuts holes stays and reflects ambient light, which is subtracted from the emission. Otherwise the only texture is
    // that of the emission.
    let texture = shade.texture.filter(|_| shade.alpha_cutoff.is_some());
    let ambient = if texture.is_some() { AMBIENT } else { 0.0 };
    let glow = shade.glow.unwrap_or(Glow { color: shade.diffuse.truncate(), texture: shade.texture });
    let glow = Glow { color: glow.color - ambient, ..glow };
    Shade { diffuse: Vec3::ZERO.extend(shade.diffuse.w), emission: Vec4::ZERO, texture, glow: Some(glow), ..*shade }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::project::PhongMap;
    use crate::scene::texture::Magnification;
    use std::path::PathBuf;

    fn cut_out(opacity: f32) -> Material {
        let diffuse = Vec4::new(0.1, 0.2, 0.3, opacity);
        Material { name: "leaf".to_owned(), diffuse, texture: Some(4), alpha_cutoff: Some(0.25), ..Material::default() }
    }

    #[test]
    fn an_injected_colour_without_alpha_leaves_a_cut_out_where_it_was() {
        // The report's `deferredVidro` is (1, 0, 1, 0).
        let mask = Vec4::new(1.0, 0.0, 1.0, 0.0);
        let to = MaterialPattern::All;
        let phong = PhongMap::default();
        let map = ColorMap { to, diffuse: Some(mask), emission: None, phong, texture: TextureMap::Kept };
        for (opacity, expected) in [(1.0, 0.25), (0.5, 0.5), (0.0, f32::INFINITY)] {
            let material = cut_out(opacity);
            let plain = shade(&material, &[], &[], true);
            assert_eq!((plain.diffuse, plain.alpha_cutoff), (material.diffuse, Some(expected)));
            let mapped = shade(&material, std::slice::from_ref(&map), &[], true);
            assert_eq!((mapped.diffuse, mapped.texture, mapped.alpha_cutoff), (mask, Some(4), Some(expected)));
        }
    }

    #[test]
    fn added_emission_is_light_of_its_own_in_corrected_fidelity_until_a_map_replaces_it() {
        let emission = Vec4::new(0.5, 0.0, 2.0, 1.0);
        let lamp = Material { emission, emission_added: true, emission_texture: Some(7), ..cut_out(1.0) };
        let glow = Some(Glow { color: emission.truncate(), texture: Some(7) });
        let plain = shade(&lamp, &[], &[], true);
        assert_eq!((plain.glow, plain.emission), (glow, Vec4::ZERO));
        let thesis = shade(&lamp, &[], &[], false);
        assert_eq!((thesis.glow, thesis.emission), (None, emission));
        let (to, phong) = (MaterialPattern::All, PhongMap::default());
        let map = |emission| ColorMap { to: to.clone(), diffuse: None, emission, phong, texture: TextureMap::Kept };
        assert_eq!(shade(&lamp, &[map(None)], &[], true).glow, glow);
        let mapped = shade(&lamp, &[map(Some(Vec4::ONE))], &[], true);
        assert_eq!((mapped.glow, mapped.emission), (None, Vec4::ONE));
        let dark = Material { emission: Vec4::W, ..lamp };
        assert_eq!(shade(&dark, &[], &[], true).glow, None);
    }

    #[test]
    fn a_mapped_texture_takes_the_place_of_the_materials_own_unless_it_could_not_be_read() {
        let map = |texture| ColorMap {
            to: MaterialPattern::All,
            diffuse: None,
            emission: None,
            phong: PhongMap::default(),
            texture,
        };
        let (read, broken) = (PathBuf::from("read.png"), PathBuf::from("broken.png"));
        let source = |magnification| TextureMap::File(read.clone(), magnification).source().expect("a file");
        let mapped = [(source(Magnification::Nearest), 8), (source(Magnification::Linear), 9)];
        for (texture, expected) in [
            (TextureMap::Kept, Some(4)),
            (TextureMap::Removed, None),
            (TextureMap::File(read.clone(), Magnification::Nearest), Some(8)),
            (TextureMap::File(read.clone(), Magnification::Linear), Some(9)),
            (TextureMap::File(broken, Magnification::Linear), None),
        ] {
            let cut = (texture == TextureMap::Kept).then_some(0.25);
            let found = shade(&cut_out(1.0), &[map(texture)], &mapped, true);
            assert_eq!((found.texture, found.alpha_cutoff), (expected, cut));
        }
    }

    #[test]
    fn nothing_is_cut_without_a_texture_or_in_thesis_fidelity() {
        assert_eq!(shade(&cut_out(1.0), &[], &[], false).alpha_cutoff, None);
        let bare = Material { texture: None, ..cut_out(1.0) };
        assert_eq!(shade(&bare, &[], &[], true).alpha_cutoff, None);
    }
}
