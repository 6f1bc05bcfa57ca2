//! Lines that raster passes draw in addition to their scenes: view frusta of cameras, and coordinate axes.

use super::{Plan, Rect};
use crate::programs::Fidelity;
use crate::project::{Camera, Pass, RasterPass, SceneDecl, frustum_corners};
use crate::scene::lines::{Line, LineColor, LineViewer, scene};
use crate::scene::{Scene, ShapeKind};
use glam::{DVec2, DVec3};
use std::sync::Arc;

impl Plan {
    /// The scenes that a raster pass draws. If it draws lines, a scene of these lines is added, made for its camera and rectangle.
    pub(super) fn with_lines(&mut self, pass: &Pass, raster: &RasterPass, camera: usize, rect: Rect) -> Vec<usize> {
        let mut scenes = raster.scenes.clone();
        // A camera's own frustum is the border of its picture, so it is not drawn.
        let others = raster.frusta.iter().filter(|frustum| **frustum != camera);
        let mut lines: Vec<Line> = others.flat_map(|frustum| self.frustum(*frustum)).collect();
        lines.extend(raster.scenes.iter().flat_map(|scene| axes(&self.project.scenes[*scene])));
        // A light's camera draws a depth map, which contains no lines.
        if lines.is_empty() || self.project.is_of_light(raster.camera) {
            return scenes;
        }
        let corrected = self.settings.fidelity == Fidelity::Corrected;
        let made = scene(&lines, &viewer(&self.project.cameras[camera], rect)).filter(|_| corrected);
        let why = match (corrected, made.is_some()) {
            (false, _) => "the report's programs draw triangles alone",
            (true, false) => "all of them are behind the camera",
            (true, true) => "each is a pair of triangles a pixel wide, made for the pass's camera",
        };
        self.decide(format!("lines of cameras and axes in pass `{}`", pass.name), made.is_some(), why.to_owned());
        if let Some(made) = made {
            let name = format!("lines of pass {}", pass.name);
            self.project.scenes.push(SceneDecl { memory: Some(Arc::new(made)), ..SceneDecl::empty(name) });
            scenes.push(self.project.scenes.len() - 1);
        }
        scenes
    }

    /// The lines of a camera's frustum in a window of the plan's size.
    fn frustum(&self, camera: usize) -> [Line; 12] {
        /// Pairs of neighbouring corners: edges of the near rectangle, edges of the far rectangle, and edges from the near to the far one.
        const EDGES: [[usize; 2]; 12] =
            [[0, 1], [1, 3], [3, 2], [2, 0], [4, 5], [5, 7], [7, 6], [6, 4], [0, 4], [1, 5], [2, 6], [3, 7]];
        let camera = &self.project.cameras[camera];
        let (_, rect) = self.view_of(camera);
        let corners = frustum_corners(camera, aspect(rect), [camera.near, camera.far].map(f64::from));
        EDGES.map(|edge| {
            let color = if edge.iter().all(|corner| *corner < 4) { LineColor::Red } else { LineColor::Green };
            Line { ends: edge.map(|corner| corners[corner]), color }
        })
    }

    /// The scenes of lines, one for each pass that draws any.
    pub(crate) fn lines(&self) -> impl Iterator<Item = &Scene> {
        self.project.scenes[self.declared.scenes.len()..].iter().filter_map(|scene| scene.memory.as_deref())
    }
}

fn aspect(rect: Rect) -> f64 {
    f64::from(rect.width.max(1)) / f64::from(rect.height.max(1))
}

/// The axes of a scene's `AXIS` primitives in the world: each from -1 to 1 in the primitive's own coordinates.
fn axes(declared: &SceneDecl) -> impl Iterator<Item = Line> {
    let shapes = declared.shapes.iter().filter(|shape| shape.kind == ShapeKind::Axis);
    shapes.flat_map(|shape| {
        let (own, whole) = (shape.place.matrix().as_dmat4(), declared.place.matrix().as_dmat4());
        let colored = [LineColor::Red, LineColor::Green, LineColor::Blue];
        [0, 1, 2].map(|axis| {
            let ends = [-1.0, 1.0].map(|end| {
                let placed = own.transform_point3(DVec3::AXES[axis] * end);
                let turned = if declared.swap_yz { DVec3::new(placed.x, placed.z, -placed.y) } else { placed };
                whole.transform_point3(turned)
            });
            Line { ends, color: colored[axis] }
        })
    })
}

/// The viewer, for ribbons of lines, of a camera that draws into a rectangle.
fn viewer(camera: &Camera, rect: Rect) -> LineViewer {
    let forward = camera.direction.as_dvec3().normalize();
    let right = forward.cross(camera.up.as_dvec3()).normalize();
    let sides = DVec2::new(f64::from(rect.width.max(1)), f64::from(rect.height.max(1)));
    let (pixel, near) = match camera.orthographic {
        // The camera has the rectangle's aspect ratio, so pixels are square.
        None => (DVec2::splat(2.0 * (f64::from(camera.fov_y) * 0.5).tan() / sides.y), Some(f64::from(camera.near))),
        Some(sees) => {
            let seen = DVec2::new(f64::from(sees.right - sees.left), f64::from(sees.top - sees.bottom));
            (seen / sides, None)
        }
    };
    LineViewer { position: camera.position, axes: [right, right.cross(forward), forward], pixel, near }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::project::Orthographic;
    use glam::Vec3;

    fn camera(orthographic: Option<Orthographic>) -> Camera {
        Camera {
            name: String::new(),
            position: DVec3::new(3.0, -2.0, 7.0),
            direction: Vec3::new(0.6, -0.2, 0.77).normalize(),
            up: Vec3::new(0.1, 1.0, 0.0),
            fov_y: 0.8,
            near: 0.5,
            far: 40.0,
            orthographic,
            viewport: None,
        }
    }

    /// The corners of a frustum are those of clip space: -1 and 1 on x and y, 1 at the near plane and 0 at the far one.
    #[test]
    fn the_projection_maps_the_corners_of_a_frustum_to_those_of_clip_space() {
        let rect = Rect { x: 0, y: 0, width: 300, height: 200 };
        let sides = Orthographic { left: -3.0, right: 5.0, bottom: -1.0, top: 2.0 };
        for camera in [camera(None), camera(Some(sides))] {
            let matrix = super::super::view(&camera, rect, DVec3::ZERO).clip_from_world.as_dmat4();
            let corners = frustum_corners(&camera, aspect(rect), [0.5, 40.0]);
            for (index, corner) in corners.into_iter().enumerate() {
                let sign = |bit: usize| if index & bit == 0 { -1.0 } else { 1.0 };
                let expected = DVec3::new(sign(1), sign(2), if index < 4 { 1.0 } else { 0.0 });
                let found = matrix.project_point3(corner);
                assert!(found.distance(expected) < 1e-4, "corner {index}: {found} beside {expected}");
            }
        }
    }

    /// A ribbon's corners are half a pixel beside the line in the picture of any camera.
    #[test]
    fn ribbons_are_a_pixel_wide_in_the_picture() {
        let rect = Rect { x: 0, y: 0, width: 300, height: 200 };
        let sides = Orthographic { left: -12.0, right: 12.0, bottom: -5.0, top: 5.0 };
        for camera in [camera(None), camera(Some(sides))] {
            let viewer = viewer(&camera, rect);
            let ahead =
                |x: f64, y: f64, z: f64| camera.position + viewer.axes[0] * x + viewer.axes[1] * y + viewer.axes[2] * z;
            let line = Line { ends: [ahead(-1.0, 0.2, 5.0), ahead(2.0, 0.5, 9.0)], color: LineColor::Red };
            let made = scene(&[line], &viewer).expect("it is seen");
            let matrix = super::super::view(&camera, rect, DVec3::ZERO).clip_from_world.as_dmat4();
            let pixels = |point: DVec3| matrix.project_point3(point).truncate() * DVec2::new(150.0, 100.0);
            let corners = &made.meshes[0].positions;
            for (end, sides) in line.ends.iter().zip(corners.chunks(2)) {
                let [low, high] = [0, 1].map(|side| pixels(made.origin + sides[side].as_dvec3()) - pixels(*end));
                assert!(low.distance(DVec2::new(0.0, -0.5)) < 1e-3 && high.distance(DVec2::new(0.0, 0.5)) < 1e-3);
            }
        }
    }
}
